"""Figures drawn by the method `plot()` of cases, models, states and sweeps."""

from __future__ import annotations

import math

from fvsolve.draw import style
from fvsolve.draw.sweep_picture import map_figure
from fvsolve.units import convert

MAX_NAMED_NODES = 40  # greatest number of nodes, links or bars with names
MAX_PANELS = 4  # greatest number of columns of a sweep that are drawn


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
            axes.text(*middle, f"{name} ({link.kind})", fontsize=7, color=style.MUTED, ha="center", va="bottom")
    for k, kind in enumerate(dict.fromkeys(node.kind for node in case.nodes.values())):
        own = [at[name] for name, node in case.nodes.items() if node.kind == kind]
        axes.scatter(*zip(*own, strict=True), s=40, label=kind, color=style.COLOURS[k % len(style.COLOURS)], zorder=2)
    for name in case.nodes if len(case.nodes) <= MAX_NAMED_NODES else ():
        axes.annotate(
            name, at[name], xytext=(0, 7), textcoords="offset points", fontsize=8, color=style.INK, ha="center"
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
    """Bar chart of the heads at the nodes of a model at the start, see `bar_figure`."""
    names, unit = model.node_names, model.case.unit_of("head")
    heads = [convert(node["head"], "head", unit) for node in model.checks["nodes"].values()]
    return bar_figure(names, heads, f"head at the start [{unit}]", model.case.title or model.case.name)


@style.without_markup
def state_figure(state):
    """Figure of all values of a state vector over their index."""
    figure = style.figure(3.0)
    axes = figure.subplots()
    axes.plot(state.y, color=style.COLOURS[0], linewidth=1.0)
    style.style_axes(axes)
    axes.set_xlabel("index of the state", fontsize=8.5, color=style.INK)
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
    panels[-1].set_xlabel(key if numbers else "run", fontsize=8.5, color=style.INK)
    return figure


def bar_figure(names, values, label: str, title: str):
    """Bar chart with a bar for each of the first MAX_NAMED_NODES names; label : label of the axis of values."""
    names, values = list(names)[:MAX_NAMED_NODES], list(values)[:MAX_NAMED_NODES]
    figure = style.figure(0.9 + 0.22 * max(len(names), 3))
    axes = figure.subplots()
    axes.barh(range(len(names)), values, color=style.COLOURS[0], height=0.6)
    style.style_axes(axes)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.ticklabel_format(axis="x", scilimits=(-4, 5))
    axes.set_xlabel(label, fontsize=8.5, color=style.INK)
    style.title(figure, title)
    return figure
