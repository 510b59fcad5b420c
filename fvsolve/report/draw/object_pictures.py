"""Figures of cases, models, states, sweeps and sensitivities; most are drawn by a method `plot()`."""

import math
from collections.abc import Mapping

from fvsolve.parts.nodes_and_links import kind_text
from fvsolve.report.draw import style
from fvsolve.units import convert

MAX_NAMED_NODES = 40  # greatest number of nodes, links or bars with names
MAX_PANELS = 4  # greatest number of columns of a sweep that are drawn
MAX_KEYS = 6  # greatest number of keys that are drawn
MAX_WORDS = 12  # greatest number of named values along an axis
MAX_NUMBERS = 100  # greatest number of squares of a map with their values as text
KEY_WIDTH = 26  # letters of a line of a key


@style.without_markup
def case_figure(case):
    """Figure of the nodes and links of a case, at their positions or in columns; see `node_positions`."""
    at = node_positions(case)
    figure = style.figure(4.5)
    axes = figure.subplots()
    axes.set_axis_off()
    for name, link in case.links.items():
        ends = [at[place] for place in link_nodes(link) if place in at]
        for end in ends[1:]:
            axes.plot(*zip(ends[0], end, strict=True), color=style.MUTED, linewidth=1.0, zorder=1)
        if len(ends) > 1 and len(case.links) <= MAX_NAMED_NODES:
            middle = [sum(x) / len(ends) for x in zip(*ends, strict=True)]
            axes.text(
                *middle,
                f"{name} ({kind_text(link)})",
                fontsize=7,
                color=style.MUTED,
                ha="center",
                va="bottom",
            )
    for k, kind in enumerate(dict.fromkeys(node.kind for node in case.nodes.values())):
        own = [at[name] for name, node in case.nodes.items() if node.kind == kind]
        axes.scatter(
            *zip(*own, strict=True),
            s=40,
            label=kind,
            color=style.COLOURS[k % len(style.COLOURS)],
            zorder=2,
        )
    for name in case.nodes if len(case.nodes) <= MAX_NAMED_NODES else ():
        axes.annotate(
            name,
            at[name],
            xytext=(0, 7),
            textcoords="offset points",
            fontsize=8,
            color=style.INK,
            ha="center",
        )
    axes.margins(0.1)
    style.legend(axes)
    style.title(figure, case.title or case.name)
    return figure


def link_nodes(link) -> list[str]:
    """Names of the nodes that a link connects; a place NODE.PLACE is replaced by its node."""
    return [str(place).partition(".")[0] for place in link.ports.values()]


def node_positions(case) -> dict[str, tuple[float, float]]:
    """Position of each node in the figure of a case : name -> (x, y).

    It is the stated position if all nodes have one. Otherwise it is (number of links from the first node of the
    connected part of the network, row).
    """
    given = {name: node.position for name, node in case.nodes.items()}
    if all(item is not None for item in given.values()):
        return {name: (float(item[0]), float(item[1])) for name, item in given.items()}
    near: dict[str, list[str]] = {name: [] for name in case.nodes}
    for link in case.links.values():
        touched = [name for name in link_nodes(link) if name in near]
        for item in touched:
            near[item] += [other for other in touched if other != item]
    depth: dict[str, int] = {}
    for first in near:
        waiting = [] if first in depth else [first]
        depth.setdefault(first, 0)
        while waiting:
            item = waiting.pop(0)
            fresh = [other for other in near[item] if other not in depth]
            depth |= dict.fromkeys(fresh, depth[item] + 1)
            waiting += fresh
    rows: dict[int, int] = {}
    positions = {}
    for name, column in depth.items():
        row = rows[column] = rows.get(column, -1) + 1
        positions[name] = (float(column), float(math.ceil(row / 2) * (1 if row % 2 else -1)))
    return positions


@style.without_markup
def model_figure(model):
    """Bar chart of the heads at the first MAX_NAMED_NODES nodes of a model at the start."""
    names, unit = model.node_names[:MAX_NAMED_NODES], model.case.unit_of("head")
    heads = [convert(node["head"], "head", unit) for node in model.checks["nodes"].values()][
        :MAX_NAMED_NODES
    ]
    figure = style.figure(0.9 + 0.22 * max(len(names), 3))
    axes = figure.subplots()
    axes.barh(range(len(names)), heads, color=style.COLOURS[0], height=0.6)
    style.style_axes(axes)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.ticklabel_format(axis="x", scilimits=(-4, 5))
    style.name_axes(axes, f"head at the start [{unit}]")
    style.title(figure, model.case.title or model.case.name)
    return figure


@style.without_markup
def state_figure(state):
    """Figure of all values of a state vector over their index."""
    figure = style.figure(3.0)
    axes = figure.subplots()
    axes.plot(state.y, color=style.COLOURS[0], linewidth=1.0)
    style.style_axes(axes)
    style.name_axes(axes, "index of the state")
    style.title(figure, f"state at t = {state.t:g} s")
    return figure


@style.without_markup
def sweep_figure(sweep):
    """Figure of the first MAX_PANELS extremes of probes in a sweep.

    For two keys the extremes are drawn as maps. For a single key with numbers they are curves over the key, otherwise
    curves over the index of the run.
    """
    names = [name for name in sweep.columns if name.startswith(("max(", "min("))][:MAX_PANELS]
    if len(sweep.keys) == 2 and names:
        return map_figure(sweep, names, {key: key for key in sweep.keys})
    key, rows = sweep.keys[0], sweep.rows
    numbers = all(isinstance(row[key], (int, float)) for row in rows) and len(sweep.keys) == 1
    x = [float(row[key]) for row in rows] if numbers else list(range(len(rows)))
    figure = style.figure(0.7 + 1.8 * max(len(names), 1))
    panels = figure.subplots(max(len(names), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names, strict=False):
        values = [row.get(name) for row in rows]
        y = [math.nan if value is None else float(value) for value in values]
        axes.plot(x, y, marker="o", markersize=4, color=style.COLOURS[0], linewidth=1.0)
        style.style_axes(axes)
        axes.margins(x=0.03)
        axes.set_ylabel(name, fontsize=8, color=style.INK)
    style.name_axes(panels[-1], key if numbers else "run")
    return figure


@style.without_markup
def quantity_figure(sweep, name: str, heads: Mapping[str, str]):
    """Figure of a column of a `Sweep` over each varied key, or as a map over two keys; failed runs have another colour.

    name : name of the column; heads : key -> label of its axis
    """
    if len(sweep.keys) == 2:
        return map_figure(sweep, [name], heads)
    keys = list(sweep.keys)[:MAX_KEYS]
    across = min(len(keys), 3)
    figure = style.figure(0.8 + 2.4 * -(-len(keys) // across))
    panels = figure.subplots(-(-len(keys) // across), across, sharey=True, squeeze=False).ravel()
    y = [math.nan if row.get(name) is None else float(row[name]) for row in sweep.rows]
    wrong = [not row["ok"] for row in sweep.rows]
    for axes in panels[len(keys) :]:
        axes.set_axis_off()
    for k, (axes, key) in enumerate(zip(panels, keys, strict=False)):
        x, words = axis_positions([row[key] for row in sweep.rows])
        for colour, is_wrong in ((style.COLOURS[0], False), (style.DOUBT, True)):
            own = [at for at, failed in enumerate(wrong) if failed is is_wrong]
            axes.plot(
                [x[at] for at in own],
                [y[at] for at in own],
                linestyle="",
                marker="o",
                markersize=3.5,
                color=colour,
                label="not ok" if is_wrong and own else None,
            )
        style.style_axes(axes)
        axes.margins(x=0.04)
        if words:
            axes.set_xticks(range(len(words)), words, fontsize=7, rotation=30, ha="right")
        else:
            axes.locator_params(axis="x", nbins=4)  # long numbers such as 0.0012 need the width
        style.name_axes(axes, heads[key])
        if k % across == 0:
            style.name_axes(axes, y=name)
    style.legend(panels[len(keys) - 1])
    return figure


def axis_positions(values: list) -> tuple[list[float], list[str]]:
    """Positions of values on an axis, and texts of the ticks : (positions, texts).

    Numbers keep their value and have no texts. Other values are numbered in order of first appearance; more than
    MAX_WORDS of them have no texts.
    """
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
        return [float(value) for value in values], []
    texts = [str(value) for value in values]
    known = {text: k for k, text in enumerate(dict.fromkeys(texts))}
    return [float(known[text]) for text in texts], [text[:24] for text in known] if len(
        known
    ) <= MAX_WORDS else []


@style.without_markup
def map_figure(sweep, names, heads: Mapping[str, str]):
    """Figure of columns of a `Sweep` over two keys, as maps of squares or as dots; failed runs are marked with a cross.

    Squares are drawn if there is exactly one run for each pair of values.
    names : names of the columns; heads : key -> label of its axis
    """
    across = min(len(names), 2)
    down = -(-len(names) // across)
    figure = style.figure(0.6 + (4.4 if across == 1 else 3.2) * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes, name in zip(panels, names, strict=False):
        _map(axes, sweep, name)
        style.name_axes(axes, heads[sweep.keys[0]], heads[sweep.keys[1]])
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    return figure


def _map(axes, sweep, name: str) -> None:
    import numpy as np

    values = [[row[key] for row in sweep.rows] for key in sweep.keys]
    numbers = np.array(
        [math.nan if row.get(name) is None else float(row[name]) for row in sweep.rows]
    )
    wrong = np.array([not row["ok"] for row in sweep.rows])
    steps = [sorted(set(axis_positions(column)[0])) for column in values]
    x, y = (np.array(axis_positions(column)[0]) for column in values)
    style.style_axes(axes)
    if len(steps[0]) * len(steps[1]) == len(set(zip(x, y, strict=True))) == len(numbers):
        x, y = (np.searchsorted(step, at) for step, at in zip(steps, (x, y), strict=True))
        table = np.full((len(steps[1]), len(steps[0])), math.nan)
        table[y, x] = numbers
        seen = axes.pcolormesh(table, cmap="viridis")
        x, y = x + 0.5, y + 0.5
        for axis, column, step in zip((axes.xaxis, axes.yaxis), values, steps, strict=True):
            labels = axis_positions(column)[1] or [
                "" if isinstance(column[0], str) else f"{at:.4g}" for at in step
            ]
            every = -(-len(labels) // MAX_WORDS)
            axis.set_ticks(np.arange(0, len(labels), every) + 0.5, labels[::every])
        if len(numbers) <= MAX_NUMBERS:
            for a, b, value, shade in zip(x, y, numbers, seen.norm(numbers), strict=True):
                if math.isfinite(value):
                    axes.text(
                        a,
                        b,
                        f"{value:.4g}",
                        ha="center",
                        va="center",
                        fontsize=7.5,
                        color="white" if shade < 0.6 else style.INK,
                    )
    else:
        seen = axes.scatter(x, y, c=numbers, s=36, cmap="viridis")
        axes.margins(0.05)
        for axis, column in zip((axes.xaxis, axes.yaxis), values, strict=True):
            if words := axis_positions(column)[1]:
                axis.set_ticks(range(len(words)), words)
    axes.plot(x[wrong], y[wrong], linestyle="", marker="x", markersize=9, color=style.DOUBT)
    bar = axes.figure.colorbar(seen, ax=axes)
    bar.set_label(
        name + (", crossed where not ok" if wrong.any() else ""), fontsize=8.5, color=style.INK
    )
    bar.ax.tick_params(labelsize=8, labelcolor=style.INK)


@style.without_markup
def sensitivity_figure(result):
    """Figure of the Sobol indices of each key with intervals, and of the mean and spread of elementary effects."""
    figure = style.figure(1.1 + 0.5 * max(len(result.keys), 3))
    panels = figure.subplots(1, 2, sharey=True)
    unit = result.quantity.rpartition(" ")[2] if result.quantity.endswith("]") else ""
    effects = f"elementary effect, per whole range of the key {unit}".strip()
    shown = (
        ("share of the variance", (("S1", "S1, first order"), ("ST", "ST, total"))),
        (effects, (("mu_star", "mean size"), ("sigma", "spread"))),
    )
    for axes, (label, bars) in zip(panels, shown, strict=True):
        style.style_axes(axes)
        for shift, (name, text), colour in zip((-0.2, 0.2), bars, style.COLOURS, strict=False):
            at = [k + shift for k in range(len(result.keys))]
            axes.barh(
                at,
                getattr(result, name),
                xerr=getattr(result, f"{name}_conf", None),
                height=0.36,
                color=colour,
                label=text,
                error_kw={"ecolor": style.MUTED, "elinewidth": 0.8},
            )
        axes.locator_params(axis="x", nbins=5)
        axes.ticklabel_format(axis="x", scilimits=(-3, 4))
        axes.xaxis.get_offset_text().set(fontsize=8, color=style.MUTED)
        style.name_axes(axes, label)
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=2,
            frameon=False,
            fontsize=8,
            borderaxespad=0.2,
        )
    panels[0].set_yticks(
        range(len(result.keys)), [break_key(key) for key in result.keys], fontsize=8
    )
    panels[0].invert_yaxis()
    style.title(figure, result.quantity)
    return figure


def break_key(key: str) -> str:
    """Break a long key into lines after its dots."""
    lines = [""]
    for piece in key.replace(".", ".\n").split("\n"):
        lines = (
            [*lines, piece]
            if len(lines[-1] + piece) > KEY_WIDTH and lines[-1]
            else [*lines[:-1], lines[-1] + piece]
        )
    return "\n".join(lines)
