"""Data of the plan of a network: pieces of pipes with extremes of pressure and head, and pressures over time.

Nodes lie at their stated positions, or else in a drawn layout in which distances approximate the lengths of pipes.
"""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output import network_layout
from fvsolve.core.output.fields import read_pipe_lines, read_series
from fvsolve.core.output.network_layout import PlaneReference, plane_of
from fvsolve.core.run.plot_scene import unit_of
from fvsolve.report.draw.scene import PLAUSIBLE_SCALE, STRAIGHT_TOLERANCE
from fvsolve.report.long_section import envelope_column
from fvsolve.report.maps import map_classes
from fvsolve.report.maps.flood_map import stopped_text
from fvsolve.report.maps.map_classes import Classes

MAX_PIECES = 12_000  # of all pipes together
PIECES_PER_PIPE = 60  # greatest number of pieces of a pipe
MAX_FRAMES = 60
UTILISATIONS = (0.0, 50.0, 70.0, 80.0, 90.0, 100.0)  # limits of classes of the utilisation [%]
USED = ("#3a78c3", "#2fa39b", "#7fb84d", "#d9b62c", "#ee8730", "#d8124f")


class PlanLayer(NamedTuple):
    """Layer of a network plan: a value for each piece, in classes.

    name : for the reader; values : float64[pieces]; classes : of the values; source : sentence on their origin
    worst : index of the piece with the worst value
    """

    name: str
    values: np.ndarray
    classes: Classes
    source: str
    worst: int


@dataclass
class NetworkMap:
    """Plan of the pipes of a network.

    title : of the case; names : of the pipes; pipe : int64[pieces]  number of the pipe of each piece
    ends : float64[pieces, 2, 2]  ends of the pieces in plan [m]
    span : float64[pieces, 2]  distances of the ends along the pipe [m]
    nodes : node -> float64[2] [m]; others : link without pieces -> float64[k, 2] [m]
    stated : True if all nodes have stated positions; scaled : True if these also agree with the lengths of pipes
    stopped : sentence if the run stopped early, else ""
    crs : reference system of the coordinates, "" if they are positions
    """

    title: str
    names: list[str]
    pipe: np.ndarray
    ends: np.ndarray
    span: np.ndarray
    nodes: dict[str, np.ndarray]
    others: dict[str, np.ndarray]
    stated: bool
    scaled: bool
    stopped: str
    crs: str = ""
    layers: list[PlanLayer] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    frames: list[np.ndarray] = field(default_factory=list)
    frame_classes: Classes | None = None

    def move(self, reference: PlaneReference) -> None:
        """Change positions to eastings and northings."""
        self.crs = reference.crs
        self.ends = self.ends + reference.origin
        self.nodes = {name: spot + reference.origin for name, spot in self.nodes.items()}
        self.others = {name: points + reference.origin for name, points in self.others.items()}


def network_map(result: Any) -> NetworkMap | None:
    """Plan of the pipes of a run.

    It is None if no pipe has an envelope, if the run diverged, and for a chain of pipes without stated positions.
    """
    case, envelope = result.case, result.envelope
    if not envelope or result.summary["invalid_from"] is not None:
        return None
    names = list(envelope)
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    plan = network_layout.plan_positions(case, {name: link.length for name, link in pipes.items()})
    count = max(min(PIECES_PER_PIPE, MAX_PIECES // len(names)), 1)
    stated = all(node.position is not None for node in case.nodes.values())
    bends = network_layout.link_bends(case.links)
    pipe, ends, span = [], [], []
    for k, name in enumerate(names):
        cells = min(count, len(envelope[name]["distance"]))
        edges = np.linspace(0.0, case.links[name].length, cells + 1)
        points = _path(case, plan, name, edges, bends[name])
        pipe.append(np.full(len(edges) - 1, k))
        ends.append(np.stack([points[:-1], points[1:]], axis=1))
        span.append(np.column_stack([edges[:-1], edges[1:]]))
    nodes = {name: np.asarray(plan[name], float) for name in case.nodes if name in plan}
    found = NetworkMap(
        result.summary["title"] or result.summary["case"],
        names,
        np.concatenate(pipe),
        np.concatenate(ends),
        np.concatenate(span),
        nodes,
        _others(case, plan, pipes),
        stated,
        stated and _is_to_scale(np.concatenate(ends), np.concatenate(span)),
        stopped_text(result),
    )
    reference = plane_of(case)
    if stated and reference.crs:
        found.move(reference)
    if not stated and _is_straight(found.ends.reshape(-1, 2)):
        return None  # a long section shows more
    found.layers = _layers(result, found)
    _add_frames(result, found)
    return found


def _is_to_scale(ends: np.ndarray, span: np.ndarray) -> bool:
    """True if the drawn lengths of pieces float64[n, 2, 2] roughly agree with their lengths along pipes."""
    drawn = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    share = float(drawn.sum() / np.ptp(span, axis=1).sum())
    return PLAUSIBLE_SCALE[0] <= share <= PLAUSIBLE_SCALE[1]


def _is_straight(points: np.ndarray) -> bool:
    """True if all points float64[n, 2] lie on a straight line."""
    widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(widths) < 2 or widths[1] <= STRAIGHT_TOLERANCE * widths[0]


def _path(case: Any, plan: dict, name: str, edges: np.ndarray, bend: float) -> np.ndarray:
    """Points of a pipe in plan at distances along it : float64[n, 2] [m]."""
    link = case.links[name]
    if link.profile is not None and link.profile.plan is not None:
        return np.asarray(link.profile.plan_at(edges), float)
    start, end = (
        np.asarray(plan[network_layout.place(port)], float) for port in (link.from_, link.to)
    )
    return network_layout.link_path(start, end, edges / edges[-1], bend)


def _others(case: Any, plan: dict, pipes: dict) -> dict[str, np.ndarray]:
    """Ends in plan of the links that are no pipes, such as pumps and valves."""
    found = {}
    for name, link in case.links.items():
        if name in pipes:
            continue
        ends = [network_layout.place(port) for port in link.ports.values()]
        points = [np.asarray(plan[end], float) for end in ends if end in plan]
        if points:
            found[name] = np.array(points)
    return found


def extremes_of_pieces(result: Any, plan: NetworkMap, key: str, reduce: np.ufunc) -> np.ndarray:
    """Extreme of a quantity of the envelope on each piece, in the unit of pictures : float64[pieces].

    key : such as "max_pressure"; reduce : `numpy.maximum` or `numpy.minimum`
    """
    to_si = envelope_column(result, "distance").to_si
    values = np.empty(len(plan.pipe))
    shown, to_standard = unit_of(result.case, key), envelope_column(result, key).to_si
    for k, name in enumerate(plan.names):
        own = np.flatnonzero(plan.pipe == k)
        arrays = result.envelope[name]
        at = to_si(arrays["distance"])
        series = shown.factor * to_standard(arrays[key]) + shown.shift
        piece = np.clip(np.searchsorted(plan.span[own, 1], at, "left"), 0, len(own) - 1)
        found = np.full(len(own), -math.inf if reduce is np.maximum else math.inf)
        reduce.at(found, piece, series)
        lacking = ~np.isfinite(found)
        middle = plan.span[own].mean(axis=1)
        found[lacking] = np.interp(middle[lacking], at, series)
        values[own] = found
    return values


def _layers(result: Any, plan: NetworkMap) -> list[PlanLayer]:
    case, source = result.case, "Extremes over all accepted steps of the run."
    found = []
    for key, name, reduce, colours in (
        ("max_pressure", "greatest pressure", np.maximum, map_classes.SPECTRUM),
        ("min_pressure", "least pressure", np.minimum, map_classes.SPECTRUM[::-1]),
        ("max_head", "greatest head", np.maximum, map_classes.SPECTRUM),
        ("min_head", "least head", np.minimum, map_classes.SPECTRUM[::-1]),
    ):
        values = extremes_of_pieces(result, plan, key, reduce)
        unit = unit_of(case, key).unit
        classes = map_classes.equal_classes(float(values.min()), float(values.max()), unit, colours)
        worst = int(values.argmax() if reduce is np.maximum else values.argmin())
        # values that rounding brings below the first class belong to it
        values = np.maximum(values, classes.limits[0])
        found.append(PlanLayer(name, values, classes, source, worst))
    used = _utilisation(result, plan, found[0].values)
    if used is not None:
        classes = Classes(UTILISATIONS, USED, "%")
        text = f"Greatest gauge pressure over the allowable pressure of the pipe. {source}"
        worst = int(np.nanargmax(used))
        found.insert(
            0, PlanLayer("utilisation of the allowable pressure", used, classes, text, worst)
        )
    return found


def _utilisation(result: Any, plan: NetworkMap, greatest: np.ndarray) -> np.ndarray | None:
    """Greatest gauge pressure over the allowable pressure of the pipe [%]; None if no pipe states one."""
    allowed = [getattr(result.case.links[name], "allowable_pressure", None) for name in plan.names]
    if all(item is None for item in allowed):
        return None
    per_pipe = np.array([math.nan if item is None else item for item in allowed])
    shown = unit_of(result.case, "max_pressure")
    gauge = (greatest - shown.shift) / shown.factor - result.case.ambient_pressure
    return 100.0 * np.maximum(gauge, 0.0) / per_pipe[plan.pipe]


def _add_frames(result: Any, plan: NetworkMap) -> None:
    """Add the pressures of the stored frames, as the mean of the cells of each piece."""
    index = None if result.directory is None else result.directory / "fields.pvd"
    if index is None or not index.is_file():
        return
    files = [(t, path) for t, path in read_series(index) if path.stem.isdecimal()]
    if len(files) < 2:
        return
    chosen = np.unique(np.linspace(0, len(files) - 1, MAX_FRAMES).round().astype(int)).tolist()
    shown = unit_of(result.case, "pressure")
    pipes = [name for name, link in result.case.links.items() if link.kind == "pipe"]
    if pipes != plan.names:
        return
    for k in chosen:
        t, path = files[k]
        _, _, pressure, owner = read_pipe_lines(path, "pressure")
        plan.times.append(t)
        plan.frames.append(shown.factor * _means(plan, pressure, owner) + shown.shift)
    low = min(float(values.min()) for values in plan.frames)
    high = max(float(values.max()) for values in plan.frames)
    classes = map_classes.equal_classes(low, high, shown.unit, map_classes.SPECTRUM)
    plan.frames = [np.maximum(values, classes.limits[0]) for values in plan.frames]
    plan.frame_classes = classes


def _means(plan: NetworkMap, values: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Value at the middle of each piece, from the values of equal cells along each pipe : float64[pieces]."""
    found = np.empty(len(plan.pipe))
    for k in range(len(plan.names)):
        own, cells = plan.pipe == k, values[owner == k]
        length = float(plan.span[own][-1, 1])
        at = (np.arange(len(cells)) + 0.5) / len(cells) * length
        found[own] = np.interp(plan.span[own].mean(axis=1), at, cells)
    return found
