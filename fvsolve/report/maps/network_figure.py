"""Plan of a network as data for the page of a report: pieces of pipes that its script colours, links and nodes."""

from typing import Any

import numpy as np

from fvsolve.report.draw.map_picture import SHAPE_COLOURS
from fvsolve.report.draw.style import DOUBT
from fvsolve.report.figures import chart_layout, escape_markup, packed_array
from fvsolve.report.maps.flood_map import map_clock
from fvsolve.report.maps.map_figure import CELL_HEIGHT, CHOSEN_CELL, plan_layout
from fvsolve.report.maps.network_map import NetworkMap, PlanLayer
from fvsolve.report.maps.packed_levels import (
    greatest_of,
    legend_data,
    levels_of,
    packed,
    packed_series,
    scale_data,
)
from fvsolve.report.tables import value_text

MARGIN = 0.06  # around the network, as a fraction of its size
LEAST_SHARE = 0.25  # least height of a plan over its width
MAX_NAMES = 45  # greatest number of nodes with names
LINK_COLOUR, NODE_COLOUR, WORST_COLOUR = SHAPE_COLOURS["structure"], "#52606d", DOUBT


def network_figure(plan: NetworkMap, case: Any) -> dict[str, Any]:
    """Figure of a network for plotly.js; `map` holds the data for the script.

    The first traces are the pieces of each class, then follow links that are no pipes, nodes, the worst place, and the
    place that a reader has clicked.
    """
    count = max(len(layer.classes.limits) for layer in plan.layers)
    if plan.frame_classes is not None:
        count = max(count, len(plan.frame_classes.limits))
    pieces = [
        {
            "type": "scatter",
            "mode": "lines",
            "x": [None],
            "y": [None],
            "hoverinfo": "skip",
            "line": {"width": 4},
        }
        for _ in range(count)
    ]
    traces = [*pieces, *_links(plan, case), _nodes(plan, case), WORST, CHOSEN_CELL]
    labels = axis_names(plan)
    layout = plan_layout(extent_of(plan), labels, plan.stopped)
    if not plan.stated:  # distances between nodes have a rough meaning, coordinates have none
        for axis in (layout["xaxis"], layout["yaxis"]):
            axis |= {"showticklabels": False, "ticks": "", "showline": False}
    return {"data": traces, "layout": layout, "map": _data(plan, case, count)}


WORST = {
    "type": "scatter",
    "mode": "markers+text",
    "x": [None],
    "y": [None],
    "hoverinfo": "skip",
    "textposition": "bottom right",
    "textfont": {"size": 12, "color": WORST_COLOUR},
    "marker": {
        "symbol": "x-thin",
        "size": 13,
        "line": {"width": 3, "color": WORST_COLOUR},
    },
}


def axis_names(plan: NetworkMap) -> tuple[str, str]:
    """Names of the axes of a plan, with units only if its positions agree with the lengths of pipes."""
    if not plan.stated:
        return "", ""
    names = (f"easting ({plan.crs})", "northing") if plan.crs else ("x", "y")
    return (f"{names[0]} [m]", f"{names[1]} [m]") if plan.scaled or plan.crs else names


def extent_of(plan: NetworkMap) -> tuple[float, float, float, float]:
    """Least and greatest x, least and greatest y of the plan, with a margin [m]."""
    points = np.concatenate(
        [plan.ends.reshape(-1, 2), *(spot[None] for spot in plan.nodes.values())]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max()) or 1.0
    middle = 0.5 * (low + high)
    half = np.maximum(0.5 * (high - low), 0.5 * LEAST_SHARE * size) + MARGIN * size
    (x0, y0), (x1, y1) = (middle - half).tolist(), (middle + half).tolist()
    return x0, x1, y0, y1


def _data(plan: NetworkMap, case: Any, count: int) -> dict[str, Any]:
    end = plan.times[-1] if plan.times else 0.0
    clock, per = map_clock(case, end)
    data: dict[str, Any] = {
        "extent": list(extent_of(plan)),
        "lines": {
            "x": packed_array(plan.ends[..., 0].ravel()),
            "y": packed_array(plan.ends[..., 1].ravel()),
            "pipe": plan.pipe.tolist(),
            "names": [escape_markup(name) for name in plan.names],
            "classes": count,
        },
        "layers": [_layer(plan, layer) for layer in plan.layers],
        "clock": clock,
    }
    if plan.frames and plan.frame_classes is not None:
        classes = plan.frame_classes
        most = max(greatest_of(values) for values in plan.frames)
        rasters = [levels_of(values, classes, most) for values in plan.frames]
        text = f"pressure [{classes.unit}]"
        data["cell"] = {"layout": chart_layout(text, f"time [{clock}]", CELL_HEIGHT)}
        data["frames"] = {
            "name": "pressure",
            **legend_data(classes),
            **scale_data(classes, most),
            "times": [t / per for t in plan.times],
            "seconds": plan.times,
            "stored": len(plan.times),
            "data": packed_series(rasters),
        }
    return data


def _layer(plan: NetworkMap, layer: PlanLayer) -> dict[str, Any]:
    most = greatest_of(layer.values)
    worst = plan.ends[layer.worst].mean(axis=0).tolist()
    value = f"{value_text(float(f'{layer.values[layer.worst]:.4g}'))} {layer.classes.unit}"
    return {
        "name": layer.name,
        "source": layer.source,
        **legend_data(layer.classes),
        **scale_data(layer.classes, most),
        "data": packed(levels_of(layer.values, layer.classes, most)),
        "worst": {
            "x": worst[0],
            "y": worst[1],
            "text": f"{escape_markup(plan.names[plan.pipe[layer.worst]])}: {escape_markup(value)}",
        },
    }


def _links(plan: NetworkMap, case: Any) -> list[dict[str, Any]]:
    """Links that are no pipes: a line between their ends, and a mark in its middle."""
    x: list[float | None] = []
    y: list[float | None] = []
    for points in plan.others.values():
        x += [*points[:, 0].tolist(), None]
        y += [*points[:, 1].tolist(), None]
    middles = [points.mean(axis=0).tolist() for points in plan.others.values()]
    texts = [
        f"{escape_markup(name)} ({case.links[name].kind.replace('-', ' ')})" for name in plan.others
    ]
    named = len(plan.others) <= MAX_NAMES
    line = {"width": 2, "color": LINK_COLOUR}
    marks = {"symbol": "square", "size": 8, "color": LINK_COLOUR}
    return [
        {"type": "scatter", "mode": "lines", "x": x, "y": y, "hoverinfo": "skip", "line": line},
        {
            "type": "scatter",
            "mode": "markers+text" if named else "markers",
            "x": [at[0] for at in middles],
            "y": [at[1] for at in middles],
            "text": [escape_markup(name) for name in plan.others],
            "textposition": "bottom center",
            "textfont": {"size": 11},
            "hovertext": texts,
            "hoverinfo": "text",
            "marker": marks,
        },
    ]


def _nodes(plan: NetworkMap, case: Any) -> dict[str, Any]:
    kinds = {name: case.nodes[name].kind.replace("-", " ") for name in plan.nodes}
    named = len(plan.nodes) <= MAX_NAMES
    return {
        "type": "scatter",
        "mode": "markers+text" if named else "markers",
        "x": [float(spot[0]) for spot in plan.nodes.values()],
        "y": [float(spot[1]) for spot in plan.nodes.values()],
        "text": [escape_markup(name) for name in plan.nodes],
        "textposition": "top center",
        "textfont": {"size": 11},
        "hovertext": [f"{escape_markup(name)} ({kind})" for name, kind in kinds.items()],
        "hoverinfo": "text",
        "marker": {
            "symbol": ["circle" if kind == "junction" else "square" for kind in kinds.values()],
            "size": [4 if kind == "junction" else 10 for kind in kinds.values()],
            "color": NODE_COLOUR,
        },
    }
