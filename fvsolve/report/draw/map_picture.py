"""Pictures of maps: basins with classes over the shaded bed and outlines, and plans of networks with coloured pipes."""

import math

import numpy as np

from fvsolve.report.draw import style

# colours of the kinds of shapes, also on maps of a page; other than those that a page changes on dark screens
SHAPE_COLOURS = {
    "patch": "#0f8069",
    "section": "#7d3f98",
    "pipe": "#1d2730",
    "conduit": "#1d2730",
    "wall": "#7a1f1f",
    "structure": "#c9571f",
    "node": "#1d2730",
    "gauge": "#9c2c45",
}
LINES = {  # kind of a shape -> width [points] and dashes
    "patch": (2.2, "-"),
    "section": (1.3, (0, (5, 3))),
    "pipe": (1.4, "-"),
    "conduit": (2.0, "-"),
    "wall": (2.2, "-"),
    "structure": (2.6, "-"),
}
POINTS = {  # kind of a shape -> marker, size, and shift of its name [points]
    "node": ("o", 5.0, (0, 5)),
    "structure": ("s", 4.0, (0, -11)),
    "gauge": ("D", 5.0, (8, -3)),
}
ASSUMED_DASHES = (0, (2, 2))  # of lines whose place is not stated
MAX_NAMES = 60  # greatest number of names of a kind
WIDTH, LEGEND_WIDTH = 9.0, 2.3  # of a picture and its legend [inch]
LEAST_HEIGHT, MOST_HEIGHT = 2.6, 9.0  # of a picture [inch]
BAR_SHARE = 0.28  # greatest length of the scale bar, as a fraction of the map


@style.without_markup
def map_figure(plan, layer):
    """Figure of a layer of a map.

    plan : `FloodMap` of `report.maps`; layer : `MapLayer` of it
    """
    low_x, high_x, low_y, high_y = plan.extent
    wide = WIDTH - LEGEND_WIDTH - 0.9
    height = wide * (high_y - low_y) / (high_x - low_x) + 1.2
    figure = style.figure(min(max(height, LEAST_HEIGHT), MOST_HEIGHT))
    axes = figure.subplots()
    axes.imshow(
        painted(plan, layer),
        extent=plan.extent,
        origin="lower",
        interpolation="nearest",
        zorder=0,
    )
    for shape in plan.shapes:
        _draw_line(axes, plan, shape)
    for kind in POINTS:
        _draw_points(axes, plan, kind)
    axes.set_xlim(low_x, high_x)
    axes.set_ylim(low_y, high_y)
    axes.set_aspect("equal")
    axes.tick_params(colors=style.MUTED, labelcolor=style.INK, labelsize=7.5, width=0.6, length=3)
    axes.ticklabel_format(style="plain", useOffset=False)
    axes.locator_params(nbins=5)
    names = ("easting", "northing") if plan.crs else ("x", "y")
    crs = f" ({plan.crs})" if plan.crs else ""
    style.name_axes(axes, f"{names[0]} [m]{crs}", f"{names[1]} [m]")
    _scale_bar(axes, plan.extent)
    if plan.crs:
        _north(axes)
    _legend(axes, plan, layer)
    title = f"{plan.title}\n{plan.basin}: {layer.name} [{layer.classes.unit}]"
    style.title(figure, title)
    if plan.stopped:
        axes.set_title(plan.stopped, fontsize=9, color=style.DOUBT, loc="left")
    return figure


def painted(plan, layer) -> np.ndarray:
    """Colours of the pixels of a layer, transparent outside the mesh : float64[ny, nx, 4]."""
    numbers, shade = plan.class_numbers(layer), plan.shade
    colours = layer.classes.rgb / 255.0
    light = np.nan_to_num(shade)[..., None]
    water = colours[np.maximum(numbers, 0)] * (0.45 + 0.55 * light)
    rgb = np.where((numbers >= 0)[..., None], water, light * (1.0, 1.0, 0.99))
    return np.concatenate([rgb, ~np.isnan(shade)[..., None]], axis=2)


def _draw_line(axes, plan, shape) -> None:
    if shape.kind not in LINES or len(shape.points) < 2:
        return
    colour, (width, dashes) = SHAPE_COLOURS[shape.kind], LINES[shape.kind]
    x, y = (shape.points + np.array(plan.origin)).T
    dashes = ASSUMED_DASHES if shape.assumed else dashes
    axes.plot(x, y, color=colour, linewidth=width, linestyle=dashes, zorder=2)


def _draw_points(axes, plan, kind: str) -> None:
    colour, (marker, size, shift) = SHAPE_COLOURS[kind], POINTS[kind]
    own = [shape for shape in plan.shapes if shape.kind == kind]
    for shape in own:
        x, y = np.nanmean(shape.points, axis=0) + plan.origin
        face = "white" if shape.assumed or kind == "node" else colour
        axes.plot(
            x, y, marker=marker, color=colour, markersize=size, markerfacecolor=face, zorder=3
        )
        if len(own) <= MAX_NAMES:
            _name_point(axes, shape.name, (x, y), shift)


def _halo() -> list:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.0, foreground="white", alpha=0.8)]


def _scale_bar(axes, extent: tuple[float, float, float, float]) -> None:
    low_x, high_x, low_y, high_y = extent
    longest = BAR_SHARE * (high_x - low_x)
    power = 10.0 ** math.floor(math.log10(longest))
    length = next(step * power for step in (5.0, 2.0, 1.0) if step * power <= longest)
    x, y = low_x + 0.03 * (high_x - low_x), low_y + 0.05 * (high_y - low_y)
    axes.plot([x, x + length], [y, y], color="#111820", linewidth=2.5, zorder=5)
    text = f"{length / 1000.0:g} km" if length >= 1000.0 else f"{length:g} m"
    axes.annotate(
        text,
        (x + 0.5 * length, y),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=7.5,
        color="#111820",
        zorder=5,
        path_effects=_halo(),
    )


def _north(axes) -> None:
    axes.annotate(
        "N",
        (0.965, 0.96),
        xytext=(0.965, 0.86),
        xycoords="axes fraction",
        textcoords="axes fraction",
        ha="center",
        va="center",
        fontsize=9,
        color="#111820",
        arrowprops={"arrowstyle": "-|>", "color": "#111820", "linewidth": 1.2},
        zorder=5,
    )


def _legend(axes, plan, layer) -> None:
    from matplotlib.lines import Line2D

    classes = layer.classes
    texts = [
        f"{text} ({area})" for text, area in zip(classes.texts, plan.area_texts(layer), strict=True)
    ]
    handles = _class_handles(classes, texts)
    kinds = dict.fromkeys(shape.kind for shape in plan.shapes)
    for kind in [kind for kind in LINES if kind in kinds and kind not in POINTS]:
        colour, (width, dashes) = SHAPE_COLOURS[kind], LINES[kind]
        handles.append(Line2D([], [], color=colour, linewidth=width, linestyle=dashes, label=kind))
    for kind in [kind for kind in POINTS if kind in kinds]:
        colour, (marker, size, _) = SHAPE_COLOURS[kind], POINTS[kind]
        face = "white" if kind == "node" else colour
        handles.append(
            Line2D(
                [],
                [],
                marker=marker,
                color=colour,
                markersize=size,
                markerfacecolor=face,
                linestyle="",
                label=kind,
            )
        )
    if any(shape.assumed for shape in plan.shapes):
        handles.append(
            Line2D([], [], color=style.INK, linestyle=ASSUMED_DASHES, label="place not stated")
        )
    _outside_legend(axes.figure, handles, f"{layer.name} [{classes.unit}]")


@style.without_markup
def network_figure(plan, layer, extent):
    """Figure of a layer of the plan of a network.

    plan : `NetworkMap` of `report.maps`; layer : `PlanLayer` of it
    extent : least and greatest x, least and greatest y of the picture [m]
    """
    from matplotlib.collections import LineCollection

    low_x, high_x, low_y, high_y = extent
    wide = WIDTH - LEGEND_WIDTH - 0.9
    height = wide * (high_y - low_y) / (high_x - low_x) + 1.2
    figure = style.figure(min(max(height, LEAST_HEIGHT), MOST_HEIGHT))
    axes = figure.subplots()
    numbers = layer.classes.of(layer.values)
    for k, colour in enumerate(layer.classes.colours):
        axes.add_collection(
            LineCollection(plan.ends[numbers == k], colors=colour, linewidths=2.6, zorder=2)
        )
    for name, points in plan.others.items():
        axes.plot(*points.T, color=SHAPE_COLOURS["structure"], linewidth=1.2, zorder=1)
        spot = points.mean(axis=0)
        axes.plot(*spot, "s", color=SHAPE_COLOURS["structure"], markersize=4, zorder=3)
        if len(plan.others) <= MAX_NAMES:
            _name_point(axes, name, spot, (0, -11))
    for name, spot in plan.nodes.items():
        axes.plot(*spot, "o", color=style.INK, markersize=2.5, zorder=3)
        if len(plan.nodes) <= MAX_NAMES:
            _name_point(axes, name, spot, (0, 5))
    worst = plan.ends[layer.worst].mean(axis=0)
    axes.plot(*worst, "x", color=style.DOUBT, markersize=9, markeredgewidth=2.2, zorder=5)
    axes.set_xlim(low_x, high_x)
    axes.set_ylim(low_y, high_y)
    axes.set_aspect("equal")
    axes.tick_params(colors=style.MUTED, labelcolor=style.INK, labelsize=7.5, width=0.6, length=3)
    axes.ticklabel_format(style="plain", useOffset=False)
    if plan.scaled:
        names = (f"easting [m] ({plan.crs})", "northing [m]") if plan.crs else ("x [m]", "y [m]")
        style.name_axes(axes, *names)
        _scale_bar(axes, extent)
    elif not plan.stated:
        axes.set_axis_off()
    handles = _class_handles(layer.classes, layer.classes.texts)
    _outside_legend(figure, handles, f"{layer.name} [{layer.classes.unit}]")
    note = "" if plan.scaled else "positions as stated" if plan.stated else "drawn layout"
    title = f"{plan.title}\n{layer.name} [{layer.classes.unit}]{f' ({note})' if note else ''}"
    style.title(figure, title)
    if plan.stopped:
        axes.set_title(plan.stopped, fontsize=9, color=style.DOUBT, loc="left")
    return figure


def _name_point(axes, name: str, spot, shift: tuple[int, int]) -> None:
    axes.annotate(
        name,
        tuple(spot),
        xytext=shift,
        textcoords="offset points",
        fontsize=7,
        color="#111820",
        ha="left" if shift[0] else "center",
        zorder=4,
        path_effects=_halo(),
    )


def _class_handles(classes, texts: list[str]) -> list:
    from matplotlib.patches import Patch

    return [
        Patch(facecolor=colour, edgecolor=style.MUTED, linewidth=0.4, label=text)
        for colour, text in zip(classes.colours, texts, strict=True)
    ]


def _outside_legend(figure, handles: list, title: str) -> None:
    figure.legend(
        handles=handles,
        title=title,
        title_fontsize=8,
        alignment="left",
        loc="outside right upper",
        frameon=False,
        fontsize=7.5,
        labelcolor=style.INK,
        borderaxespad=0.0,
    )
