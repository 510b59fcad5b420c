"""Map of a basin as data for the page of a report: outlines for plotly.js, and packed rasters."""

import base64
import zlib
from typing import Any

import numpy as np

from fvsolve.report.draw.style import DOUBT, INK
from fvsolve.report.figures import FONT, chart_layout, escape_markup
from fvsolve.report.maps.flood_map import FloodMap, MapFrames, MapLayer, map_clock
from fvsolve.report.maps.map_classes import Classes
from fvsolve.report.maps.map_shapes import MapShape
from fvsolve.report.tables import decimal_sign

LEVELS = 252  # number of levels of a packed value, divided among the classes
MAX_FRAMES = 90  # of a map
MAX_RAW = 24_000_000  # greatest number of bytes of the frames of a map in the browser
MAX_PACKED = 5_000_000  # greatest number of bytes of the frames of a map in the page
LOOKS = {  # kind of a shape -> colour, width [px] and dash
    "patch": ("#0f8069", 3.0, "solid"),
    "section": ("#7d3f98", 2.0, "6px,4px"),
    "pipe": ("#1d2730", 2.0, "solid"),
    "conduit": ("#1d2730", 3.0, "solid"),
    "wall": ("#7a1f1f", 3.0, "solid"),
    "structure": ("#c9571f", 4.0, "solid"),
}
POINTS = {  # kind of a shape -> symbol of Plotly, colour, size [px], position of its name
    "node": ("circle-open-dot", "#1d2730", 9, "top center"),
    "structure": ("square", "#c9571f", 7, "bottom center"),
    "gauge": ("diamond", "#9c2c45", 9, "middle right"),
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


def map_data(plan: FloodMap, case: Any) -> dict[str, Any]:
    """Data of a map for the script of the page: rasters, layers, frames, and outlines as traces and layout."""
    low_x, high_x, low_y, high_y = plan.extent
    shade = np.where(np.isnan(plan.shade), 0.0, 1.0 + 254.0 * np.nan_to_num(plan.shade))
    clock, per = map_clock(case, plan.frames.times[-1] if plan.frames else 0.0)
    data: dict[str, Any] = {
        "width": plan.x.size,
        "height": plan.y.size,
        "extent": [low_x, high_x, low_y, high_y],
        "shade": _packed(shade.astype(np.uint8)),
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
        **_legend(layer.classes),
        "areas": plan.area_texts(layer),
        **_levels(layer.classes, float(np.nanmax(layer.values, initial=0.0))),
        "data": _packed(_bytes_of(plan, layer.values, layer.classes)),
    }


def _legend(classes: Classes) -> dict[str, Any]:
    return {"texts": classes.texts, "colours": list(classes.colours), "unit": classes.unit}


def _levels(classes: Classes, greatest: float) -> dict[str, Any]:
    """Limits of the classes and the number of levels of each class, from which the script computes values."""
    return {
        "limits": [*classes.limits, max(greatest, classes.limits[-1])],
        "each": LEVELS // len(classes.limits),
    }


def levels_of(values: np.ndarray, classes: Classes, greatest: float) -> np.ndarray:
    """Levels of values : uint8, same shape; 0 for none, else 1 + k each + j for part j of class k.

    Each class is divided into `each` = LEVELS // classes equal parts; the last one ends at `greatest`.
    """
    numbers = classes.of(values)
    each = LEVELS // len(classes.limits)
    low = np.array(classes.limits)
    high = np.array([*classes.limits[1:], max(greatest, classes.limits[-1])])
    width = np.maximum(high - low, 1e-300)
    k = np.maximum(numbers, 0)
    share = (np.nan_to_num(values) - low[k]) / width[k]
    part = np.clip(np.floor(share * each), 0, each - 1)
    return np.where(numbers >= 0, 1 + k * each + part, 0).astype(np.uint8)


def _bytes_of(
    plan: FloodMap, values: np.ndarray, classes: Classes, greatest: float | None = None
) -> np.ndarray:
    """Levels of the pixels of a field : uint8[ny, nx]. values : float64[cells]"""
    most = float(np.nanmax(values, initial=0.0)) if greatest is None else greatest
    levels = levels_of(values, classes, most)
    return np.where(plan.cell >= 0, levels[plan.cell], 0).astype(np.uint8)


def frames_data(plan: FloodMap, frames: MapFrames, per: float) -> dict[str, Any]:
    """Packed frames, thinned so that the page and the memory of the browser stay small. per : unit of times [s]"""
    count = max(min(MAX_FRAMES, MAX_RAW // plan.cell.size), 2)
    chosen = np.unique(np.linspace(0, len(frames.files) - 1, count).round().astype(int)).tolist()
    greatest = max(float(np.nanmax(frames.values(k), initial=0.0)) for k in chosen)
    rasters = [_bytes_of(plan, frames.values(k), frames.classes, greatest) for k in chosen]
    packed = _packed_series(rasters)
    while sum(map(len, packed)) > MAX_PACKED and len(chosen) > 2:
        chosen, rasters = chosen[::2], rasters[::2]
        packed = _packed_series(rasters)
    return {
        "name": frames.name,
        **_legend(frames.classes),
        **_levels(frames.classes, greatest),
        "times": [frames.times[k] / per for k in chosen],
        "seconds": [frames.times[k] for k in chosen],
        "stored": len(frames.files),
        "data": packed,
    }


def _packed_series(rasters: list[np.ndarray]) -> list[str]:
    """Rasters, each but the first as its difference from the raster before (exclusive or)."""
    pairs = zip([np.zeros_like(rasters[0]), *rasters[:-1]], rasters, strict=True)
    return [_packed(before ^ own) for before, own in pairs]


def _packed(raster: np.ndarray) -> str:
    """Bytes of a raster from its northern row to its southern row, compressed by zlib, in base 64."""
    return base64.b64encode(zlib.compress(raster[::-1].tobytes(), 9)).decode()


def map_figure(plan: FloodMap, case: Any) -> dict[str, Any]:
    """Figure of a map for plotly.js: outlines, names, axes with equal scales; `map` holds the data for the script."""
    traces = [*_lines(plan), *_points(plan), CHOSEN_CELL]
    low_x, high_x, low_y, high_y = plan.extent
    crs = f" ({plan.crs})" if plan.crs else ""
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
    names = ("easting", "northing") if plan.crs else ("x", "y")
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
        | {"title": {"text": f"{names[0]} [m]{crs}", "standoff": 6}, "range": [low_x, high_x]},
        "yaxis": axis
        | {
            "title": {"text": f"{names[1]} [m]", "standoff": 6},
            "range": [low_y, high_y],
            "scaleanchor": "x",
            "constrain": "domain",
        },
    }
    layout["xaxis"]["constrain"] = "domain"
    if plan.stopped:
        layout["annotations"] = [
            {
                "xref": "paper",
                "yref": "paper",
                "x": 0.0,
                "y": 1.0,
                "xanchor": "left",
                "yanchor": "bottom",
                "showarrow": False,
                "text": escape_markup(plan.stopped),
                "font": {"size": 12, "color": DOUBT},
            }
        ]
    return {"data": traces, "layout": layout, "map": map_data(plan, case)}


def _shifted(plan: FloodMap, shape: MapShape) -> tuple[list, list]:
    """Coordinates of the points of a shape on the map; None between separate lines."""
    points = shape.points + np.array(plan.origin)
    return tuple([None if np.isnan(v) else v for v in column] for column in points.T.tolist())


def _lines(plan: FloodMap) -> list[dict[str, Any]]:
    traces = []
    for shape in plan.shapes:
        if shape.kind not in LOOKS or len(shape.points) < 2:
            continue
        colour, width, dash = LOOKS[shape.kind]
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


def _points(plan: FloodMap) -> list[dict[str, Any]]:
    traces = []
    for kind, (symbol, colour, size, position) in POINTS.items():
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
                "textposition": position,
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
