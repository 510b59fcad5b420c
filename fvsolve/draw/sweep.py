"""An outcome of many runs over what varied. Knows numbers and matplotlib; runs nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fvsolve.draw import style

PANELS = 6  # keys that are drawn
WORDS = 12  # values that are none of numbers, up to which each is named


@style.as_it_stands
def outcome_figure(sweep, name: str, heads: Mapping[str, str]):
    """One column of a `Sweep` over each key that varied, under its head; runs without it, and not ok, apart."""
    keys = list(sweep.keys)[:PANELS]
    across = min(len(keys), 3)
    figure = style.figure(0.8 + 2.4 * -(-len(keys) // across))
    panels = figure.subplots(-(-len(keys) // across), across, sharey=True, squeeze=False).ravel()
    y = [math.nan if row.get(name) is None else float(row[name]) for row in sweep.rows]
    wrong = [not row["ok"] for row in sweep.rows]
    for axes in panels[len(keys) :]:
        axes.set_axis_off()
    for k, (axes, key) in enumerate(zip(panels, keys, strict=False)):
        x, words = places([row[key] for row in sweep.rows])
        for colour, which in ((style.COLOURS[0], False), (style.DOUBT, True)):
            own = [at for at, one in enumerate(wrong) if one is which]
            axes.plot([x[at] for at in own], [y[at] for at in own], linestyle="", marker="o", markersize=3.5,
                      color=colour, label="not ok" if which and own else None)  # fmt: skip
        style.dress(axes)
        axes.margins(x=0.04)
        if words:
            axes.set_xticks(range(len(words)), words, fontsize=7, rotation=30, ha="right")
        axes.set_xlabel(heads[key], fontsize=8.5, color=style.INK)
        if k % across == 0:
            axes.set_ylabel(name, fontsize=8.5, color=style.INK)
    style.legend(panels[len(keys) - 1])
    return figure


def places(values: list) -> tuple[list[float], list[str]]:
    """Where values stand on an axis: numbers as they are, others by their first appearance, with their words."""
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
        return [float(value) for value in values], []
    texts = [str(value) for value in values]
    known = {text: k for k, text in enumerate(dict.fromkeys(texts))}
    return [float(known[text]) for text in texts], [text[:24] for text in known] if len(known) <= WORDS else []


@style.as_it_stands
def sensitivity_figure(found):
    """Shares of the variance by key with their intervals, beside sizes and spreads of effects."""
    figure = style.figure(0.9 + 0.3 * max(len(found.keys), 4))
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    for shift, name, colour in ((-0.2, "S1", style.COLOURS[0]), (0.2, "ST", style.COLOURS[1])):
        at = [k + shift for k in range(len(found.keys))]
        left.barh(at, getattr(found, name), xerr=getattr(found, f"{name}_conf"), height=0.36, color=colour, label=name,
                  error_kw={"ecolor": style.MUTED, "elinewidth": 0.8})  # fmt: skip
    style.dress(left)
    left.set_yticks(range(len(found.keys)), found.keys, fontsize=8)
    left.invert_yaxis()
    left.set_xlabel("share of the variance", fontsize=8.5, color=style.INK)
    left.legend(frameon=False, fontsize=8)
    right.plot(found.mu_star, found.sigma, linestyle="", marker="o", color=style.COLOURS[2])
    style.dress(right)
    right.margins(0.15)
    for key, x, y in zip(found.keys, found.mu_star, found.sigma, strict=True):
        right.annotate(key.rpartition(".")[2], (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    right.set_xlabel("mean size of effects", fontsize=8.5, color=style.INK)
    right.set_ylabel("their spread", fontsize=8.5, color=style.INK)
    style.title(figure, found.outcome)
    return figure
