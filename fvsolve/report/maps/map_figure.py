"""Map of a basin as data for the page of a report: outlines for plotly.js, and packed rasters."""

from typing import Any

import numpy as np

from fvsolve.report.draw.map_picture import SHAPE_COLOURS
from fvsolve.report.draw.style import DOUBT, INK
from fvsolve.report.figures import FONT, chart_layout, escape_markup
from fvsolve.report.maps.flood_map import FloodMap, MapFrames, MapLayer, map_clock
from fvsolve.report.maps.map_classes import Classes
from fvsolve.report.maps.map_shapes import MapShape
from fvsolve.report.maps.packed_levels import (
    greatest_of,
    legend_data,
    levels_of,
    packed,
    packed_series,
    scale_data,
)
from fvsolve.report.tables import decimal_sign

MAX_FRAMES = 90  # of a map
MAX_RAW = 24_000_000  # greatest number of bytes of the frames of a map in the browser
MAX_PACKED = 5_000_000  # greatest number of bytes of the frames of a map in the page
LOOKS = {  # kind of a shape -> width [px] and dash
    "patch": (3.0, "solid"),
    "section": (2.0, "6px,4px"),
    "pipe": (2.0, "solid"),
    "conduit": (3.0, "solid"),
    "wall": (3.0, "solid"),
    "structure": (4.0, "solid"),
}
EDGE = 0.08  # share of the width of a map from an edge at which a name would be cut
POINTS = {  # kind of a shape -> symbol of Plotly, size [px], position of its name
    "node": ("circle-open-dot", 9, "top center"),
    "structure": ("square", 7, "bottom center"),
    "gauge": ("diamond", 9, "middle right"),
}
# the cell that a reader has clicked; the script sets its place
CHOSEN_CELL = {
    "type": "scatter",
    "mode": "markers",
    "x": [None],
    "y": [None],
    "hoverinfo": "skip",
    "marker": {"symbol": "cross-thin", "size": 16, "line": {"width": 2, "color": DOUBT}},
}
CELL_HEIGHT = 240  # of the chart of a cell [px]
MAX_NAMES = 40  # greatest number of names on a map


def raster_data(plan: FloodMap, case: Any) -> dict[str, Any]:
    """Data of a map for the script of the page: rasters, layers, frames, and outlines as traces and layout."""
    low_x, high_x, low_y, high_y = plan.extent
    shade = np.where(np.isnan(plan.shade), 0.0, 1.0 + 254.0 * np.nan_to_num(plan.shade))
    clock, per = map_clock(case, plan.frames.times[-1] if plan.frames else 0.0)
    data: dict[str, Any] = {
        "width": plan.x.size,
        "height": plan.y.size,
        "extent": [low_x, high_x, low_y, high_y],
        "shade": packed(shade.astype(np.uint8)[::-1]),
        "layers": [_layer(plan, layer) for layer in plan.layers],
        "clock": clock,
    }
    if plan.frames is not None:
        text = f"{plan.frames.name} [{plan.frames.classes.unit}]"
        data["cell"] = {"layout": chart_layout(text, f"time [{clock}]", CELL_HEIGHT)}
        data["frames"] = frames_data(plan, plan.frames, per)
    return data


def _layer(plan: FloodMap, layer: MapLayer) -> dict[str, Any]:
    return {
        "name": layer.name,
        "source": layer.source,
        **legend_data(layer.classes),
        "amounts": plan.area_texts(layer),
        **scale_data(layer.classes, greatest_of(layer.values)),
        "data": packed(_bytes_of(plan, layer.values, layer.classes)),
    }


def _bytes_of(
    plan: FloodMap, values: np.ndarray, classes: Classes, greatest: float | None = None
) -> np.ndarray:
    """Levels of the pixels of a field from the northern row : uint8[ny, nx]. values : float64[cells]"""
    most = greatest_of(values) if greatest is None else greatest
    levels = levels_of(values, classes, most)
    return np.where(plan.cell >= 0, levels[plan.cell], 0).astype(np.uint8)[::-1]


def frames_data(plan: FloodMap, frames: MapFrames, per: float) -> dict[str, Any]:
    """Packed frames, thinned so that the page and the memory of the browser stay small. per : unit of times [s]"""
    count = max(min(MAX_FRAMES, MAX_RAW // plan.cell.size), 2)
    chosen = np.unique(np.linspace(0, len(frames.files) - 1, count).round().astype(int)).tolist()
    greatest = max(greatest_of(frames.values(k)) for k in chosen)
    rasters = [_bytes_of(plan, frames.values(k), frames.classes, greatest) for k in chosen]
    texts = packed_series(rasters)
    while sum(map(len, texts)) > MAX_PACKED and len(chosen) > 2:
        chosen, rasters = chosen[::2], rasters[::2]
        texts = packed_series(rasters)
    return {
        "name": frames.name,
        **legend_data(frames.classes),
        **scale_data(frames.classes, greatest),
        "times": [frames.times[k] / per for k in chosen],
        "seconds": [frames.times[k] for k in chosen],
        "stored": len(frames.files),
        "data": texts,
    }


def map_figure(plan: FloodMap, case: Any) -> dict[str, Any]:
    """Figure of a map for plotly.js: outlines, names, axes with equal scales; `map` holds the data for the script."""
    names = ("easting", "northing") if plan.crs else ("x", "y")
    crs = f" ({plan.crs})" if plan.crs else ""
    labels = f"{names[0]} [m]{crs}", f"{names[1]} [m]"
    layout = plan_layout(plan.extent, labels, plan.stopped)
    traces = [*_lines(plan), *_points(plan), CHOSEN_CELL]
    return {"data": traces, "layout": layout, "map": raster_data(plan, case)}


def plan_layout(
    extent: tuple[float, float, float, float], labels: tuple[str, str], stopped: str
) -> dict[str, Any]:
    """Layout of a figure in plan with equal scales of both axes.

    extent : least and greatest x, least and greatest y; labels : of the axes; stopped : sentence above the map, or ""
    """
    low_x, high_x, low_y, high_y = extent
    axis = {
        "showgrid": False,
        "zeroline": False,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": "#6b7785",
        "showline": True,
        "linecolor": "#6b7785",
        "separatethousands": True,
        "tickformat": "",
        "exponentformat": "none",
        "automargin": True,
        "nticks": 6,
    }
    layout: dict[str, Any] = {
        "margin": {"l": 70, "r": 12, "t": 28, "b": 48},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "font": {"family": FONT, "size": 12, "color": INK},
        "separators": f"{decimal_sign()}\u202f",
        "hovermode": "closest",
        "dragmode": "pan",
        "showlegend": False,
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "#6b7785", "activecolor": INK},
        "xaxis": axis
        | {"title": {"text": escape_markup(labels[0]), "standoff": 6}, "range": [low_x, high_x]},
        "yaxis": axis
        | {
            "title": {"text": escape_markup(labels[1]), "standoff": 6},
            "range": [low_y, high_y],
            "scaleanchor": "x",
            "constrain": "domain",
        },
    }
    layout["xaxis"]["constrain"] = "domain"
    if stopped:
        layout["annotations"] = [
            {
                "xref": "paper",
                "yref": "paper",
                "x": 0.0,
                "y": 1.0,
                "xanchor": "left",
                "yanchor": "bottom",
                "showarrow": False,
                "text": escape_markup(stopped),
                "font": {"size": 12, "color": DOUBT},
            }
        ]
    return layout


def _shifted(plan: FloodMap, shape: MapShape) -> tuple[list, list]:
    """Coordinates of the points of a shape on the map; None between separate lines."""
    points = shape.points + np.array(plan.origin)
    return tuple([None if np.isnan(v) else v for v in column] for column in points.T.tolist())


def _lines(plan: FloodMap) -> list[dict[str, Any]]:
    traces = []
    for shape in plan.shapes:
        if shape.kind not in LOOKS or len(shape.points) < 2:
            continue
        colour, (width, dash) = SHAPE_COLOURS[shape.kind], LOOKS[shape.kind]
        x, y = _shifted(plan, shape)
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": hover_name(shape),
                "x": x,
                "y": y,
                "hoverinfo": "name",
                "hoverlabel": {"namelength": -1},
                "line": {
                    "color": colour,
                    "width": width,
                    "dash": "4px,4px" if shape.assumed else dash,
                },
            }
        )
    return traces


def hover_name(shape: MapShape) -> str:
    """Name, type and state of a shape."""
    assumed = ", place not stated" if shape.assumed else ""
    return f"{escape_markup(shape.name)} ({escape_markup(shape.text or shape.kind)}{assumed})"


def inward(position: str, x: float, extent: tuple[float, float, float, float]) -> str:
    """Position of a name beside its point, such as "top center"; to the left or right near the edges of a map.

    x : of the point; extent : of the map [m]
    """
    west, east = extent[:2]
    share = (x - west) / (east - west)
    if EDGE < share < 1.0 - EDGE:
        return position
    return position.replace("center", "right" if share <= EDGE else "left")


def _points(plan: FloodMap) -> list[dict[str, Any]]:
    traces = []
    for kind, (symbol, size, position) in POINTS.items():
        colour = SHAPE_COLOURS[kind]
        own = [shape for shape in plan.shapes if shape.kind == kind]
        if not own:
            continue
        places = [np.nanmean(shape.points, axis=0) + plan.origin for shape in own]
        named = len(own) <= MAX_NAMES
        traces.append(
            {
                "type": "scatter",
                "mode": "markers+text" if named else "markers",
                "name": kind,
                "x": [float(place[0]) for place in places],
                "y": [float(place[1]) for place in places],
                "text": [escape_markup(shape.name) for shape in own],
                "hovertext": [hover_name(shape) for shape in own],
                "hoverinfo": "text",
                "textposition": [inward(position, float(at[0]), plan.extent) for at in places],
                "textfont": {"size": 11, "color": "#111820"},
                "marker": {
                    "symbol": symbol,
                    "size": size,
                    "color": colour,
                    "line": {"width": 1.5, "color": colour},
                },
            }
        )
    return traces
