"""Data of the map of a basin: pixels, hill shading, layers of greatest values, and frames over time.

All values are in the units of the map; coordinates are those of the reference system of the basin, if it has one.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.fields import read_series
from fvsolve.core.output.grid_files import cells_of_pixels, frame_field
from fvsolve.core.output.unit_columns import UnitColumn, column
from fvsolve.core.run.plot_scene import unit_of
from fvsolve.core.run.result import not_valid
from fvsolve.parts.formula import samples
from fvsolve.report.draw.scene import DrawnUnit
from fvsolve.report.maps import map_classes
from fvsolve.report.maps.map_classes import Classes
from fvsolve.report.maps.map_shapes import MapShape, shapes_of
from fvsolve.report.report_table import ReportTable, report_table
from fvsolve.report.tables import value_text

MAX_PIXELS = 160_000  # of a map
PIXELS_PER_CELL = 1.6  # of a cell that is not a rectangle, along each side
SUN_AZIMUTH, SUN_HEIGHT = math.radians(315.0), math.radians(45.0)
SHADED_SLOPE = 0.6  # slope to which the slope that most of the bed does not exceed is drawn
DARKEST = 0.55  # brightness of the darkest bed; flat ground has a brightness near 0.9
DEPTHS = (0.05, 0.1, 0.3, 0.5, 1.0, 2.0)  # limits of depth classes [m]
SPEEDS = (0.0, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0)  # [m/s]
# Limits of depth times speed [m2/s], after AIDR Handbook 7, guideline 7-3 (Smith, Davey and Cox 2014): H1 to H6 without
# their further limits on depth and speed.
HAZARDS = (0.0, 0.3, 0.6, 1.0, 4.0)
TIME_UNITS = (("d", 4 * 86400.0), ("h", 4 * 3600.0), ("min", 240.0), ("s", 0.0))


class MapLayer(NamedTuple):
    """Layer of a map: a value for each cell, in classes.

    key : of the quantity, such as "max_depth"; name : for the reader; values : float64[cells], NaN where none is drawn
    source : sentence on the origin of the values
    """

    key: str
    name: str
    values: np.ndarray
    classes: Classes
    source: str


class MapFrames(NamedTuple):
    """Values of a quantity over time, in the unit `shown`.

    times : of the frames [s]; files : of each frame
    least : lower values are raised to it, which differ from it by rounding; -inf for none
    """

    key: str
    name: str
    classes: Classes
    shown: DrawnUnit
    times: list[float]
    files: list[Path]
    least: float = -math.inf

    def values(self, k: int) -> np.ndarray:
        """Values of frame `k` : float64[cells]."""
        values = self.shown.factor * frame_field(self.files[k], self.key) + self.shown.shift
        return np.maximum(values, self.least)


@dataclass
class FloodMap:
    """Map of a basin.

    basin : name; title : of the case; mesh : `Mesh`; x, y : float64[nx], float64[ny]  centres of pixels [m]
    cell : int64[ny, nx]  number of the cell of each pixel, -1 outside; bed : float64[cells], or None
    origin : of the coordinates [m]; crs : their reference system, or ""
    stopped : sentence if the run stopped early or its values are not valid, else ""
    """

    basin: str
    title: str
    mesh: Any
    x: np.ndarray
    y: np.ndarray
    cell: np.ndarray
    bed: np.ndarray | None
    origin: tuple[float, float]
    crs: str
    stopped: str
    layers: list[MapLayer] = field(default_factory=list)
    frames: MapFrames | None = None
    shapes: list[MapShape] = field(default_factory=list)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least and greatest easting, least and greatest northing of the pixels [m]."""
        (dx, dy), (east, north) = self.pixel, self.origin
        half_x, half_y = 0.5 * dx, 0.5 * dy
        return (
            east + float(self.x[0]) - half_x,
            east + float(self.x[-1]) + half_x,
            north + float(self.y[0]) - half_y,
            north + float(self.y[-1]) + half_y,
        )

    @property
    def pixel(self) -> tuple[float, float]:
        """Width and height of a pixel [m]."""
        return tuple(
            float(at[1] - at[0]) if at.size > 1 else float(span)
            for at, span in zip(
                (self.x, self.y), np.ptp(self.mesh.points, axis=0).tolist(), strict=True
            )
        )

    @cached_property
    def shade(self) -> np.ndarray:
        """Brightness of the bed, lit from the north-west, from 0 to 1; NaN outside the mesh : float64[ny, nx]."""
        inside = self.cell >= 0
        if self.bed is None or float(np.ptp(self.bed)) == 0.0:
            return np.where(inside, 0.93, np.nan)
        height = np.where(inside, self.bed[self.cell], np.nan)
        dx, dy = self.pixel
        slope_x, slope_y = _slopes(height, dx, 1), _slopes(height, dy, 0)
        steep = float(np.quantile(np.hypot(slope_x, slope_y)[inside], 0.9))
        scale = SHADED_SLOPE / steep if steep > 0.0 else 1.0
        slope_x, slope_y = scale * slope_x, scale * slope_y
        sun = np.array([math.sin(SUN_AZIMUTH), math.cos(SUN_AZIMUTH)]) * math.cos(SUN_HEIGHT)
        light = math.sin(SUN_HEIGHT) - slope_x * sun[0] - slope_y * sun[1]
        light /= np.sqrt(1.0 + slope_x**2 + slope_y**2)
        return np.where(inside, np.clip(DARKEST + 0.5 * np.clip(light, 0.0, 1.0), 0.0, 1.0), np.nan)

    def class_numbers(self, layer: MapLayer) -> np.ndarray:
        """Number of the class of each pixel, -1 for none : int64[ny, nx]."""
        numbers = layer.classes.of(layer.values)
        return np.where(self.cell >= 0, numbers[self.cell], -1)

    def areas(self, layer: MapLayer) -> np.ndarray:
        """Area of the cells of each class [m2] : float64[classes]."""
        numbers = layer.classes.of(layer.values)
        drawn = numbers >= 0
        count = len(layer.classes.limits)
        return np.bincount(numbers[drawn], self.mesh.area[drawn], minlength=count)

    def area_texts(self, layer: MapLayer) -> list[str]:
        """Area of the cells of each class, with its unit."""
        return [area_text(area) for area in self.areas(layer).tolist()]


def area_text(area: float) -> str:
    """Area with a unit that suits its size. area : [m2]"""
    for unit, size in (("km\u00b2", 1e6), ("ha", 1e4)):
        if area >= size:
            return f"{value_text(float(f'{area / size:.3g}'))} {unit}"
    return f"{value_text(float(f'{area:.3g}'))} m\u00b2"


def _slopes(height: np.ndarray, step: float, axis: int) -> np.ndarray:
    """Slopes of heights along an axis, zero where a neighbour lies outside : float64, same shape."""
    if height.shape[axis] < 2:
        return np.zeros_like(height)
    return np.nan_to_num(np.gradient(height, step, axis=axis))


def mapped_basins(result: Any) -> list[str]:
    """Names of the basins of which a run has values to draw on a map."""
    frames = basin_frames(result)
    return [
        name
        for name in result.case.meshes
        if name not in result.case.links  # the water of a conduit
        and (frames.get(name) or result.maxima.get(name))
    ]


def basins_without_values(result: Any) -> list[str]:
    """Names of the basins of which a run stored neither greatest values nor frames, so that they have no map."""
    mapped = mapped_basins(result)
    return [
        name for name in result.case.meshes if name not in result.case.links and name not in mapped
    ]


def basin_frames(result: Any) -> dict[str, list[tuple[float, Path]]]:
    """Frames of each basin : name -> list of (time [s], file)."""
    found: dict[str, list[tuple[float, Path]]] = {}
    index = None if result.directory is None else result.directory / "fields.pvd"
    for t, path in read_series(index) if index is not None and index.is_file() else []:
        found.setdefault(path.stem.rpartition("-")[0], []).append((t, path))
    return found


def flood_map(result: Any, basin: str) -> FloodMap:
    """Map of a basin of a run, see `FloodMap`."""
    case = result.case
    part = case.nodes[basin]
    found = _empty_map(case, basin)
    found.title = result.summary["title"] or result.summary["case"]
    found.stopped = stopped_text(result)
    frames = basin_frames(result).get(basin, [])
    settings = report_table(case)
    is_water = "depth" in part.physics_type.fields
    if is_water:
        found.frames = _water_frames(case, frames, settings)
        recorded = result.maxima.get(basin) or {}
        found.layers = (
            _recorded_layers(result, recorded, settings, found.frames)
            if recorded
            else _layers_of_frames(found.frames)
        )
    elif frames:
        found.frames, layer = _field_frames(case, part, frames)
        found.layers = [layer]
    return found


def _empty_map(case: Any, basin: str) -> FloodMap:
    """Map of a basin of a case without layers."""
    mesh, part = case.meshes[basin], case.nodes[basin]
    x, y = pixel_centres(mesh)
    bed = None
    if hasattr(part, "bed"):
        bed = samples(part.bed, mesh).mean(axis=0) + (part.elevation or 0.0)
    found = FloodMap(
        basin,
        case.title or case.name,
        mesh,
        x,
        y,
        cells_of_pixels(mesh, x, y),
        bed,
        part.origin or (0.0, 0.0),
        part.crs or "",
        "",
    )
    found.shapes = shapes_of(case, basin)
    return found


def plan_of(case: Any, basin: str, depth: np.ndarray) -> FloodMap:
    """Map of a basin before a run, with the depths at the start. depth : float64[cells] [m]"""
    found = _empty_map(case, basin)
    settings = report_table(case)
    classes, factor = _depth_classes(case, settings)
    values = np.where(depth >= settings.least_depth, factor * depth, np.nan)
    source = "Depths at the start."
    found.layers = [MapLayer("depth", "depth at the start", values, classes, source)]
    return found


def stopped_text(result: Any) -> str:
    """Sentence on a run that stopped early or whose values are not valid; "" for other runs."""
    texts = []
    if result.reason != "finished":
        clock = column("t", "time", result.case)
        at = value_text(float(clock.from_si(result.summary["t"])))
        texts.append(f"the run stopped at t = {at} {clock.unit}: {result.reason}")
    if invalid := not_valid(result.summary):
        texts.append(f"values are {invalid}")
    text = "; ".join(texts)
    return text[:1].upper() + text[1:]


def pixel_centres(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Evenly spaced centres of pixels over a mesh : float64[nx], float64[ny] [m]; at most about `MAX_PIXELS`."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    if mesh.grid is not None:
        steps = [float(np.median(np.diff(lines))) for lines in (mesh.grid.x, mesh.grid.y)]
    else:
        steps = [math.sqrt(float(np.median(mesh.area))) / PIXELS_PER_CELL] * 2
    counts = [max((b - a) / step, 1.0) for a, b, step in zip(low, high, steps, strict=True)]
    coarser = max(math.sqrt(counts[0] * counts[1] / MAX_PIXELS), 1.0)
    numbers = [max(round(count / coarser), 1) for count in counts]
    return tuple(
        a + (b - a) * (np.arange(count) + 0.5) / count
        for a, b, count in zip(low.tolist(), high.tolist(), numbers, strict=True)
    )


def _unit(case: Any, dimension: str) -> tuple[float, str]:
    """Factor from SI, and unit, of a quantity on a map."""
    own = column("", dimension, case)
    return own.span_from_si(1.0), own.span_unit


def _depth_classes(case: Any, settings: ReportTable) -> tuple[Classes, float]:
    """Classes of depth, and factor of their unit. The lowest class begins at the least depth that is drawn."""
    factor, unit = _unit(case, "level")
    least, given = settings.least_depth, settings.depth_classes is not None
    above = [limit for limit in settings.depth_classes or DEPTHS if limit > least]
    limits = (least, *above)
    classes = map_classes.stated_classes(limits, factor, unit, map_classes.BLUES, not given)
    # the least depth is that of the case to the digit, also in units in which other limits are rounded
    exact = float(f"{factor * least:.12g}")
    return classes._replace(limits=(exact, *classes.limits[1:])), factor


def _water_frames(
    case: Any, frames: list[tuple[float, Path]], settings: ReportTable
) -> MapFrames | None:
    """Depths over time; None without frames.

    Where all cells are wet in all frames, as in a tank, classes of equal width show more than those of floods.
    """
    if not frames:
        return None
    classes, factor = _depth_classes(case, settings)
    times, files = [t for t, _ in frames], [path for _, path in frames]
    shown = DrawnUnit("depth", classes.unit, factor)
    found = MapFrames("depth", "depth", classes, shown, times, files)
    if settings.depth_classes is None:
        low, high = _range_of(found)
        if low >= classes.limits[0]:
            equal = map_classes.equal_classes(low, high, classes.unit, map_classes.BLUES)
            found = found._replace(classes=equal, least=equal.limits[0])
    return found


def _range_of(frames: MapFrames) -> tuple[float, float]:
    """Least and greatest value of all frames."""
    ends = [
        (float(own.min()), float(own.max())) for own in map(frames.values, range(len(frames.files)))
    ]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _recorded_layers(
    result: Any, recorded: dict[str, np.ndarray], settings: ReportTable, frames: MapFrames | None
) -> list[MapLayer]:
    """Layers of the greatest values over all accepted steps, of arrival and of duration.

    frames : of the depth, whose classes hold for the greatest depth too; None without frames
    """
    case = result.case
    depth = recorded["max_depth"]
    wet = depth >= settings.least_depth
    wet_depth = column("", "level", case)
    above = f"{value_text(float(wet_depth.from_si(case.output.wet_depth)))} {wet_depth.unit}"
    source = "Greatest values over all accepted steps of the run."
    depths, factor = _depth_classes(case, settings)
    depths = depths if frames is None else frames.classes
    speed_factor, speed_unit = _unit(case, "velocity")
    hazard_factor, hazard_unit = _unit(case, "unit_flow")
    speeds = map_classes.stated_classes(
        settings.speed_classes or SPEEDS,
        speed_factor,
        speed_unit,
        map_classes.HEAT,
        not settings.speed_classes,
    )
    hazards = map_classes.stated_classes(
        settings.hazard_classes or HAZARDS,
        hazard_factor,
        hazard_unit,
        map_classes.HAZARD,
        not settings.hazard_classes,
    )
    layers = [
        MapLayer("max_depth", "greatest depth", factor * depth, depths, source),
        MapLayer(
            "max_speed", "greatest speed", speed_factor * recorded["max_speed"], speeds, source
        ),
        MapLayer(
            "max_hazard",
            "greatest depth times speed",
            hazard_factor * recorded["max_hazard"],
            hazards,
            source,
        ),
    ]
    clock, per = map_clock(case, result.summary["t"])
    start = case.numerics.start or 0.0
    for key, name, text in (
        ("arrival_time", "time of arrival", f"First time with a depth above {above}."),
        ("wet_duration", "duration of flooding", f"Sum of the times with a depth above {above}."),
    ):
        values = recorded[key] / per
        known = values[wet & np.isfinite(values)]
        high = float(known.max(initial=0.0))
        low = float(known.min(initial=high)) if key == "arrival_time" else 0.0
        classes = map_classes.equal_classes(min(low, start / per), high, clock, map_classes.TIMES)
        layers.append(MapLayer(key, name, values, classes, text))
    return [layer._replace(values=np.where(wet, layer.values, np.nan)) for layer in layers]


def map_clock(case: Any, end: float) -> tuple[str, float]:
    """Unit of times on a map, and its length [s]: that of `[output]`, or one that suits the duration of the run."""
    if "time" in case.output.units:
        unit = case.output.units["time"]
    else:
        span = end - (case.numerics.start or 0.0)
        unit = next(name for name, least in TIME_UNITS if span >= least)
    return unit, 1.0 / UnitColumn("t", "time", unit).span_from_si(1.0)


def _layers_of_frames(frames: MapFrames | None) -> list[MapLayer]:
    """Layer of the greatest depths of the stored frames, for a run that recorded no greatest values."""
    if frames is None:
        return []
    greatest = frames.values(0)
    for k in range(1, len(frames.files)):
        greatest = np.maximum(greatest, frames.values(k))
    least = frames.classes.limits[0]
    values = np.where(greatest >= least, greatest, np.nan)
    source = (
        f"Greatest of the {len(frames.files)} stored frames; between them the water may have been deeper. For the "
        "greatest values of all steps set [output] maxima."
    )
    return [MapLayer("max_depth", "greatest stored depth", values, frames.classes, source)]


def _field_frames(
    case: Any, part: Any, frames: list[tuple[float, Path]]
) -> tuple[MapFrames, MapLayer]:
    """Frames of the first scalar or field of a basin without a free surface, and the layer of its last frame."""
    key = next(iter(case.scalars), "") or next(iter(part.physics_type.fields), "pressure")
    shown = unit_of(case, key)
    times, files = [t for t, _ in frames], [path for _, path in frames]
    found = MapFrames(key, key.replace("_", " "), Classes((), (), ""), shown, times, files)
    low, high = _range_of(found)
    classes = map_classes.equal_classes(low, high, shown.unit, map_classes.HEAT)
    found = found._replace(classes=classes, least=classes.limits[0])
    layer = MapLayer(
        key,
        f"{found.name} at the end",
        found.values(len(files) - 1),
        classes,
        "Values of the last stored frame.",
    )
    return found, layer
