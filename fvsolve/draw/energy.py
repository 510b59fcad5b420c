"""Energy over time: what came in, where it is, what the numbers took. Knows arrays and matplotlib; knows no run."""

from __future__ import annotations

import numpy as np

from fvsolve.draw import style

FAR = 5.0  # spans of an integral below which its bound is not drawn
MOST = 6  # parts drawn of each kind; the rest is one
UNITS = ((1e9, "GJ"), (1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ"))
KINDS = {"stored": "Blues", "dissipated": "Oranges", "supplied": "Greens"}


@style.as_it_stands
def energy_figure(t, supplied, stored, dissipated, numerical, title="", port=None, units=("s", None)):
    """Three panels over time: energy supplied by port, stored and dissipated by part, and lost to the numbers.

    supplied, stored, dissipated, numerical : {name: float64[k]} [J], cumulative. Positive ones are stacked upwards,
    negative ones downwards. What is stored is drawn above its least during the run; the gap between the areas and the
    line over them is the remainder.
    port : (name, integral of p q, its bound) for one panel more. units : of t, and (size [J], name) of energies; those
    that fit if None.
    """
    figure = style.figure(8.2 if port is None else 9.8)
    heights = (2, 3, 2, 2)[: 3 if port is None else 4]
    top, middle, low, *more = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    whole = np.sum([np.zeros_like(t), *supplied.values()], axis=0)
    least = {name: np.min(one, initial=0.0) for name, one in stored.items()}
    stored, start = {name: one - least[name] for name, one in stored.items()}, -sum(least.values())
    shown = [whole + start, *supplied.values(), *stored.values(), *dissipated.values()]
    clock, given = units
    size, unit = given or unit_of(max(np.max(np.abs(one), initial=0.0) for one in shown))
    _stack(top, t, {"supplied": supplied}, size)
    top.plot(t, whole / size, color=style.INK, linewidth=1.2, label="supplied by all")
    _stack(middle, t, {"dissipated": dissipated, "stored": stored}, size)
    middle.plot(t, (whole + start) / size, color=style.INK, linewidth=1.2, label="supplied and\nstored at the start")
    small, own = given or unit_of(max((np.max(np.abs(one), initial=0.0) for one in numerical.values()), default=0.0))
    for (name, values), colour in zip(numerical.items(), style.COLOURS, strict=False):
        look = {"color": style.INK, "linestyle": (0, (4, 2))} if name == "remainder" else {"color": colour}
        low.plot(t, values / small, linewidth=1.2, label=name, **look)
    low.axhline(0.0, color=style.MUTED, linewidth=0.6)
    names = (f"supplied [{unit}]", f"dissipated, stored [{unit}]", f"numerical loss [{own}]")
    for axes, name in zip((top, middle, low), names, strict=True):
        style.dress(axes)
        axes.set_ylabel(name, fontsize=8.5, color=style.INK)
        style.legend(axes)
    for axes in more:
        _port(axes, t, *port, given)
    (more or [low])[-1].set_xlabel(f"time [{clock}]", fontsize=8.5, color=style.INK)
    style.title(figure, title)
    return figure


def _port(axes, t, name, work, bound, given) -> None:
    """The running integral of p q at a port over its bound; a bound far below is told, not drawn."""
    span = max(np.ptp(work), np.max(np.abs(work)))
    far = span > 0.0 and np.max(bound) < -FAR * span
    size, unit = given or unit_of(max(np.max(np.abs(work)), 0.0 if far else np.max(np.abs(bound))))
    axes.plot(t, work / size, color=style.COLOURS[0], linewidth=1.2, label="integral of p q")
    look = {"color": style.DOUBT, "linestyle": (0, (4, 2)), "linewidth": 1.2}
    if far:
        own, its = given or unit_of(np.max(np.abs(bound)))
        axes.plot([], [], label=f"its bound, {np.max(bound) / own:.4g} {its}", **look)
    else:
        axes.plot(t, bound / size, label="its lower bound", **look)
    axes.axhline(0.0, color=style.MUTED, linewidth=0.6)
    style.dress(axes)
    axes.set_ylabel(f"port {name} [{unit}]", fontsize=8.5, color=style.INK)
    style.legend(axes)


def unit_of(greatest: float) -> tuple[float, str]:
    """The unit of energy in which a number is between 1 and 1000, if there is one."""
    return next(((size, unit) for size, unit in UNITS if greatest >= size), UNITS[-1])


def _stack(axes, t, kinds, size) -> None:
    """Areas of every kind one over the other, greatest first; above and below zero apart."""
    import matplotlib

    up, down = np.zeros_like(t), np.zeros_like(t)
    for kind, parts in kinds.items():
        named = _greatest(parts)
        shades = matplotlib.colormaps[KINDS[kind]](np.linspace(0.75, 0.3, len(named)))
        for (name, values), shade in zip(named.items(), shades, strict=True):
            above, below = up + np.maximum(values, 0.0) / size, down + np.minimum(values, 0.0) / size
            look = {"facecolor": shade, "edgecolor": "white", "linewidth": 0.3}
            axes.fill_between(t, up, above, label=name, **look)
            axes.fill_between(t, below, down, **look)
            up, down = above, below
    axes.axhline(0.0, color=style.MUTED, linewidth=0.6)


def _greatest(parts):
    """The parts with most energy, the others as one."""
    order = sorted(parts, key=lambda name: -np.max(np.abs(parts[name]), initial=0.0))
    if len(order) <= MOST:
        return {name: parts[name] for name in order}
    rest = np.sum([parts[name] for name in order[MOST - 1 :]], axis=0)
    return {name: parts[name] for name in order[: MOST - 1]} | {f"{len(order) - MOST + 1} others": rest}
