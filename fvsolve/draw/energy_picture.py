"""Pictures of energies over time: supplied, stored, dissipated, and lost by numerical errors."""

from __future__ import annotations

import numpy as np

from fvsolve.draw import style

BOUND_DISTANCE = 5.0  # a bound lower than this number of ranges of its integral is stated as text, not drawn
MAX_PARTS = 6  # greatest number of parts drawn of each kind; the rest is drawn as a sum
ENERGY_UNITS = ((1e9, "GJ"), (1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ"))
COLOUR_MAPS = {"stored": "Blues", "dissipated": "Oranges", "supplied": "Greens"}


@style.without_markup
def energy_figure(t, supplied, stored, dissipated, numerical, title="", port=None, units=("s", None)):
    """Figure with three panels over time: supplied energy, stored and dissipated energy, and numerical loss.

    supplied, stored, dissipated, numerical : name -> float64[k] [J], cumulative
    The first three are drawn as stacked areas, positive values upwards and negative values downwards. The last is drawn
    as lines. A stored energy that becomes negative is drawn relative to its least value. In the second panel, the gap
    between the areas and the line above them is the remainder of the energy balance.
    port : None, or data of a fourth panel as (name, work, bound): the integral of pressure times flow at the port
        float64[k] [J], and its lower bound float64[k] [J]
    units : (unit of t, unit of energies); the second is (size [J], name), or None to choose the unit by size
    """
    figure = style.figure(8.2 if port is None else 9.8)
    heights = (2, 3, 2, 2)[: 3 if port is None else 4]
    top, middle, low, *more = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    total = np.sum([np.zeros_like(t), *supplied.values()], axis=0)
    least = {name: np.min(line, initial=0.0) for name, line in stored.items()}
    stored, start = {name: line - least[name] for name, line in stored.items()}, -sum(least.values())
    shown = [total + start, *supplied.values(), *stored.values(), *dissipated.values()]
    clock, given = units
    size, unit = given or energy_unit(max(np.max(np.abs(line), initial=0.0) for line in shown))
    _stack(top, t, {"supplied": supplied}, size)
    top.plot(t, total / size, color=style.INK, linewidth=1.2, label="total supplied")
    _stack(middle, t, {"dissipated": dissipated, "stored": stored}, size)
    middle.plot(t, (total + start) / size, color=style.INK, linewidth=1.2, label="supplied and\nstored at the start")
    small, own = given or energy_unit(
        max((np.max(np.abs(line), initial=0.0) for line in numerical.values()), default=0.0)
    )
    for (name, values), colour in zip(numerical.items(), style.COLOURS, strict=False):
        look = {"color": style.INK, "linestyle": (0, (4, 2))} if name == "remainder" else {"color": colour}
        low.plot(t, values / small, linewidth=1.2, label=name, **look)
    low.axhline(0.0, color=style.MUTED, linewidth=0.6)
    names = (f"supplied [{unit}]", f"dissipated, stored [{unit}]", f"numerical loss [{own}]")
    for axes, name in zip((top, middle, low), names, strict=True):
        style.style_axes(axes)
        axes.set_ylabel(name, fontsize=8.5, color=style.INK)
        style.legend(axes)
    for axes in more:
        _port_panel(axes, t, *port, given)
    (more or [low])[-1].set_xlabel(f"time [{clock}]", fontsize=8.5, color=style.INK)
    style.title(figure, title)
    return figure


def _port_panel(axes, t, name, work, bound, given) -> None:
    """Draw the supplied energy at the port `name`, and its lower bound.

    work : float64[k]  integral of pressure times flow [J]
    bound : float64[k]  its lower bound [J]; a bound that lies far below is stated only in the legend
    given : (size [J], name) of the unit of energies, or None to choose it by size
    """
    span = max(np.ptp(work), np.max(np.abs(work)))
    far = span > 0.0 and np.max(bound) < -BOUND_DISTANCE * span
    size, unit = given or energy_unit(max(np.max(np.abs(work)), 0.0 if far else np.max(np.abs(bound))))
    axes.plot(t, work / size, color=style.COLOURS[0], linewidth=1.2, label="integral of p q")
    look = {"color": style.DOUBT, "linestyle": (0, (4, 2)), "linewidth": 1.2}
    if far:
        own, its = given or energy_unit(np.max(np.abs(bound)))
        axes.plot([], [], label=f"lower bound, {np.max(bound) / own:.4g} {its}", **look)
    else:
        axes.plot(t, bound / size, label="lower bound", **look)
    axes.axhline(0.0, color=style.MUTED, linewidth=0.6)
    style.style_axes(axes)
    axes.set_ylabel(f"port {name} [{unit}]", fontsize=8.5, color=style.INK)
    style.legend(axes)


def energy_unit(greatest: float) -> tuple[float, str]:
    """Size [J] and name of the largest unit in which the energy `greatest` [J] is at least 1.

    For an energy below 1 in all units, they are those of the smallest unit.
    """
    return next(((size, unit) for size, unit in ENERGY_UNITS if greatest >= size), ENERGY_UNITS[-1])


def _stack(axes, t, kinds, size) -> None:
    """Draw stacked areas of energies, kind by kind; positive and negative values are stacked separately.

    kinds : kind -> part -> float64[k] [J]; size : unit of the axis [J]
    """
    import matplotlib

    up, down = np.zeros_like(t), np.zeros_like(t)
    for kind, parts in kinds.items():
        named = _largest_parts(parts)
        shades = matplotlib.colormaps[COLOUR_MAPS[kind]](np.linspace(0.75, 0.3, len(named)))
        for (name, values), shade in zip(named.items(), shades, strict=True):
            above, below = up + np.maximum(values, 0.0) / size, down + np.minimum(values, 0.0) / size
            look = {"facecolor": shade, "edgecolor": "white", "linewidth": 0.3}
            axes.fill_between(t, up, above, label=name, **look)
            axes.fill_between(t, below, down, **look)
            up, down = above, below
    axes.axhline(0.0, color=style.MUTED, linewidth=0.6)


def _largest_parts(parts):
    """Energies of the parts with the largest energies, and the sum of all other parts : name -> float64[k] [J].

    parts : name -> float64[k] [J], of all parts
    """
    order = sorted(parts, key=lambda name: -np.max(np.abs(parts[name]), initial=0.0))
    if len(order) <= MAX_PARTS:
        return {name: parts[name] for name in order}
    rest = np.sum([parts[name] for name in order[MAX_PARTS - 1 :]], axis=0)
    return {name: parts[name] for name in order[: MAX_PARTS - 1]} | {f"{len(order) - MAX_PARTS + 1} others": rest}
