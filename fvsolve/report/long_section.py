"""Long sections: results, limits and devices along a path, in the units of [output], and animated heads.

Sections are the routes of the case, then the longest paths through the remaining pipes. No pipe is in two such paths.
A path continues through common nodes and through links other than pipes between two junctions.
"""

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case.case import default_cells
from fvsolve.case.pipe_routes import Leg, is_cut, joined_places, pipe_leg
from fvsolve.case.pipe_routes import legs as legs_of
from fvsolve.case.probe import OF_PRESSURE
from fvsolve.core.output.csv_files import ENVELOPE_QUANTITIES, joined_envelopes
from fvsolve.core.output.fields import read_pipe_lines, read_series
from fvsolve.core.output.summary_shape import FAILS
from fvsolve.core.output.unit_columns import UnitColumn
from fvsolve.core.run.result import not_valid
from fvsolve.core.run.verdicts import NEAR, Chainages
from fvsolve.errors import RunError
from fvsolve.parts.nodes_and_links import kind_text

MAX_SECTIONS = 6  # greatest number of sections of a run, unless it has more routes


class SectionPath(NamedTuple):
    """Path of a long section.

    legs : pipes in order, with chainages and directions; places : (node, chainage [m]) of the ends of its pipes
    """

    name: str
    legs: list[Leg]
    places: list[tuple[str, float]]

    @property
    def begin(self) -> float:
        """Chainage of the start of the path [m]."""
        return self.legs[0].begin

    @property
    def end(self) -> float:
        """Chainage of the end of the path [m]."""
        return self.legs[-1].end

    @property
    def length(self) -> float:
        """Length of the path from end to end [m]."""
        return self.end - self.begin


def section_paths(result) -> list[SectionPath]:
    """Paths of the long sections of a run: routes of the case, then the longest other paths.

    The list is empty without pipes, or if the run diverged.
    """
    if not_valid(result.summary):
        return []
    heads = {
        name: (float(arrays["initial_head"][0]), float(arrays["initial_head"][-1]))
        for name, arrays in result.envelope.items()
    }
    return paths_of(result.case, heads)


def paths_of(case, heads: dict[str, tuple[float, float]]) -> list[SectionPath]:
    """Paths of the long sections of a case: its routes, then the longest other paths.

    heads : pipe -> heads at its first and last point at the start
    """
    links = case.links
    paths = [
        _section_path(name, legs_of(route, links), links) for name, route in case.routes.items()
    ]
    # no duplicates
    paths = list({tuple(leg.pipe for leg in way.legs): way for way in reversed(paths)}.values())[
        ::-1
    ]
    paths = [way for way in paths if not _is_covered(way, paths)]
    strung = {leg.pipe for way in paths for leg in way.legs}
    # a section may continue through a link between junctions
    junctions = {name for name, node in case.nodes.items() if node.kind == "junction"}
    merged = joined_places(
        {name: link for name, link in links.items() if {*link.ports.values()} <= junctions}
    )
    free = [name for name in heads if name in links and name not in strung]
    pipes = {
        name: (
            *(merged.get(end, end) for end in (links[name].from_, links[name].to)),
            links[name].length,
        )
        for name in free
    }
    others = []
    while pipes and len(paths) + len(others) < MAX_SECTIONS:
        chain = _longest_chain(pipes)
        for pipe, _, _ in chain:
            del pipes[pipe]
        others.append(_path_of_chain(chain, links, heads))
    return [*paths, *sorted(others, key=lambda path: -path.length)]


def _is_covered(way: SectionPath, ways: list[SectionPath]) -> bool:
    """True if a path consists of the pieces of one cut pipe, and all these pieces are on another path."""
    pipes, others = [leg.pipe for leg in way.legs], [other for other in ways if other is not way]
    return is_cut(way.name, pipes) and any(
        set(pipes) <= {leg.pipe for leg in other.legs} for other in others
    )


def _path_of_chain(
    chain: list[tuple[str, bool, float]], links: dict, heads: dict[str, tuple[float, float]]
) -> SectionPath:
    """Section path of a chain of pipes, directed so that the initial head falls along it.

    chain : list of (name of the pipe, True if it is passed backwards, length [m]). A single pipe keeps its direction.
    heads : as for `paths_of`
    """
    if len(chain) == 1:
        pipe = chain[0][0]
        return _section_path(pipe, [pipe_leg(pipe, links)], links)
    first, last = chain[0], chain[-1]
    begins, ends = heads[first[0]][first[1]], heads[last[0]][not last[1]]
    mostly_turned = sum(turned for _, turned, _ in chain) * 2 > len(chain)
    if ends > begins + 1e-9 * abs(begins) or (ends >= begins and mostly_turned):
        chain = [(pipe, not turned, length) for pipe, turned, length in reversed(chain)]
    at, legs = 0.0, []
    for pipe, turned, length in chain:
        legs.append(Leg(pipe, at, at + length, turned))
        at += length
    way = _section_path("", legs, links)
    names = [leg.pipe for leg in legs]
    name = (
        " \u2013 ".join(names) if len(names) < 4 else f"{way.places[0][0]} to {way.places[-1][0]}"
    )
    return way._replace(name=name)


def _section_path(name: str, legs: list[Leg], links: dict) -> SectionPath:
    """Section path from legs. Its places are both end nodes of each pipe, so both nodes of a device are included."""
    places = []
    for leg in legs:
        ends = (
            (links[leg.pipe].from_, leg.chainage(0.0)),
            (links[leg.pipe].to, leg.chainage(links[leg.pipe].length)),
        )
        places += ends[::-1] if leg.backwards else ends
    return SectionPath(name, legs, list(dict.fromkeys((place, float(at)) for place, at in places)))


def _longest_chain(pipes: dict) -> list[tuple[str, bool, float]]:
    """Pipes between the two nodes that are farthest apart along pipes : list of (pipe, backwards, length [m]).

    pipes : name -> (first node, second node, length); backwards : True if the pipe is passed from second to first node
    The search finds the node farthest from an end of the longest pipe, then the node farthest from this node. It gives
    the exact result for networks without loops.
    """
    around: dict[str, list] = {}
    for name, (a, b, length) in pipes.items():
        around.setdefault(a, []).append((b, name, False, length))
        around.setdefault(b, []).append((a, name, True, length))
    longest = max(pipes, key=lambda name: pipes[name][2])
    if pipes[longest][0] == pipes[longest][1]:  # a link without length connects its ends
        return [(longest, False, pipes[longest][2])]
    far = _farthest(around, pipes[longest][0])[0]
    end, came = _farthest(around, far)
    chain = []
    while end != far:
        end, name, turned, length = came[end]
        chain.append((name, turned, length))
    return chain[::-1]


def _farthest(around: dict, start: str) -> tuple[str, dict]:
    """Node farthest from `start` along pipes, and the shortest way to each node (Dijkstra 1959).

    around : node -> list of (other node, pipe, backwards, length)
    The way is a dict: node -> (previous node, pipe, backwards, length).
    """
    distance = {start: 0.0}
    came = {}
    queue = [(0.0, start)]
    end = start
    done = set()
    while queue:
        so_far, place = heapq.heappop(queue)
        if place in done:
            continue
        done.add(place)
        end = place
        for other, name, turned, length in around[place]:
            if other != place and so_far + length < distance.get(other, float("inf")):
                distance[other], came[other] = so_far + length, (place, name, turned, length)
                heapq.heappush(queue, (so_far + length, other))
    return end, came


MAX_LIMIT_LINES = 6  # greatest number of limit lines in a section
SECTION_QUANTITIES = (
    "elevation",
    "initial_head",
    "min_head",
    "max_head",
    "min_pressure",
    "max_pressure",
    "t_min",
    "t_max",
)
HEAD_QUANTITIES = ("initial_head", "min_head", "max_head")
VAPOUR_LINE = "vapour line"
# least distance of names, as a fraction of the length; closer names would overlap
LABEL_DISTANCE = 0.035
# Limits farther away than this fraction of the range of heads are only named at the edge of the picture.
LIMIT_REACH = 0.5
# Fractions of the head axis: free at each end, and for each limit that is named there.
EDGE_MARGIN, NAME_MARGIN = 0.05, 0.07
# greatest number of bins of a long line; the extremes of head and elevation of each bin are drawn
MAX_BINS = 150
MAX_POINTS = 240  # greatest number of points of an animated line
# greatest number of values of all animated lines of a report; frames are skipped above it
MAX_NUMBERS = 45_000


def envelope_column(result, name: str) -> UnitColumn:
    """Column of a quantity of the envelope (extremes along pipes), with its unit and conversions from and to SI."""
    unit, ambient = result.summary["envelope_units"][name], result.summary["ambient_pressure"]
    return UnitColumn(name, ENVELOPE_QUANTITIES[name], unit, ambient)


def head_of(result, pressure: float | np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Heads of absolute pressures [Pa] at elevations; heads and elevations are in the units of the envelope."""
    height = envelope_column(result, "elevation")
    law: Callable[..., Any] = result.case.law.head
    return envelope_column(result, "max_head").from_si(law(pressure, height.to_si(elevation)))


def limit_lines(result, pipe: np.ndarray, elevation: np.ndarray) -> dict[str, np.ndarray]:
    """Heads of pressure classes and limits along a section : name -> float64[n], at most `MAX_LIMIT_LINES` lines.

    The line of pressure classes is first; values are NaN where a limit does not apply.
    pipe : str[n]  pipe of each point; elevation : float64[n]; heads and elevations are in the units of the envelope
    """
    case, lines = result.case, {}
    classes = {
        name: getattr(case.links[name], "allowable_pressure", None)
        for name in np.unique(pipe).tolist()
    }
    if any(allowable is not None for allowable in classes.values()):
        gauge = np.array(
            [np.nan if classes[name] is None else classes[name] for name in pipe.tolist()]
        )
        lines["class line"] = _as_head(result, "gauge_pressure", gauge, elevation)
    for limit in case.limits.values():
        quantity = limit.extent.quantity
        parts = [name for group, name in limit.extent.parts if group == "links"]
        applies = np.isin(pipe, parts)
        if quantity not in OF_PRESSURE or not applies.any():
            continue
        for bound in ("minimum", "maximum"):
            value = getattr(limit, bound)
            if value is None or isinstance(value, str):
                # "vacuum" is the line of the pipe itself, and the vapour line is drawn anyway
                continue
            line = _as_head(result, quantity, value, elevation)
            lines[f"{limit.name}, {bound}"] = np.where(applies, line, np.nan)
        if limit.class_fraction is not None and limit.class_fraction != 1.0:
            gauge = np.array(
                [limit.class_fraction * (classes[name] or np.nan) for name in pipe.tolist()]
            )
            line = _as_head(result, "gauge_pressure", gauge, elevation)
            lines[f"{limit.name}, maximum"] = np.where(applies, line, np.nan)
    return dict(list(_without_copies(lines).items())[:MAX_LIMIT_LINES])


def _without_copies(lines: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Lines without those that equal an earlier line of which a longer or equal part applies, such as a class line."""
    kept: dict[str, np.ndarray] = {}
    for name, line in lines.items():
        applies = np.isfinite(line)
        if not any(
            np.isfinite(other[applies]).all()
            and np.allclose(line[applies], other[applies], rtol=1e-9, atol=1e-9)
            for other in kept.values()
        ):
            kept[name] = line
    return kept


def _as_head(result, quantity: str, value, elevation: np.ndarray) -> np.ndarray:
    """Head that corresponds to a `value` [SI] of pressure, gauge pressure, pressure head or head, in the unit of heads.

    quantity : quantity of the value; elevation : float64[n]  in the unit of heads
    """
    shown = envelope_column(result, "max_head")
    if quantity == "head":
        return shown.from_si(value + 0.0 * elevation)
    if quantity == "pressure_head":
        return elevation + shown.from_si(value)
    ambient = result.case.ambient_pressure if quantity == "gauge_pressure" else 0.0
    return head_of(result, value + ambient, elevation)


class SectionDevice(NamedTuple):
    """Node of a section with its devices: the node itself, if it is not a junction, and links other than pipes.

    chainage : of the node; place : name of the node; parts : devices as texts "NAME (kind)"
    """

    chainage: float
    place: str
    parts: tuple[str, ...]  # "pump (pump)"


@dataclass(frozen=True)
class Section:
    """Long section: a path through the network with the results along it, in the units of `[output]`.

    way : the path; chainage : float64[n]; pipe : str[n]  pipe of each point
    along : quantity -> float64[n], for the quantities `SECTION_QUANTITIES` of envelope.csv
    lines : name -> float64[n]  heads of vapour pressure, pressure class and limits; NaN where a line does not apply
    ends : chainages of both ends
    cavity_spans : (begin, end) of chainage where the least pressure is at most `cavity_pressure`
    violations : (chainage, head, name of the limit) of points where a limit is violated
    devices : `SectionDevice` of each node of the path
    """

    way: SectionPath
    chainage: np.ndarray
    pipe: np.ndarray
    along: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    ends: tuple[float, float]
    cavity_spans: list[tuple[float, float]]
    violations: list[tuple[float, float, str]]
    devices: list[SectionDevice]

    def drawn_indices(self, bins: int = MAX_BINS) -> np.ndarray:
        """Indices of the points to draw: all, or for a long section the extremes of head and elevation in each bin.

        bins : number of equal bins of points
        """
        n = len(self.chainage)
        if n <= 4 * bins:
            return np.arange(n)
        edges = np.linspace(0, n, bins + 1).astype(int)
        most = [
            ("max_head", np.argmax),
            ("min_head", np.argmin),
            ("elevation", np.argmax),
            ("elevation", np.argmin),
        ]
        lines = [(self.along[name], end) for name, end in most]
        rows = [
            a + end(line[a:b])
            for line, end in lines
            for a, b in zip(edges[:-1], edges[1:], strict=True)
        ]
        return np.unique([0, *rows, n - 1])

    def labels(self) -> list[tuple[float, str, bool]]:
        """Labels of devices and nodes that do not overlap : list of (chainage, names, True if a device is there).

        Devices and ends have priority over plain junctions; devices close to each other share a label.
        """
        length = self.ends[1] - self.ends[0]
        order = sorted(
            self.devices, key=lambda device: (not device.parts, device.chainage not in self.ends)
        )
        shown: list[tuple[float, list[str], bool]] = []
        for device in order:
            names = [part.rpartition(" (")[0] for part in device.parts] or [device.place]
            near = [
                label
                for label in shown
                if abs(device.chainage - label[0]) < LABEL_DISTANCE * length
            ]
            if not near:
                shown.append((device.chainage, names, bool(device.parts)))
            elif device.parts:
                near[0][1].extend(name for name in names if name not in near[0][1])
        return [(chainage, ", ".join(names), stands) for chainage, names, stands in shown]


class HeadWindow(NamedTuple):
    """Range of the head axis of a picture of sections, and texts on the limits outside it, which are not drawn.

    low, high : ends of the axis; above, below : texts on limits above and below it
    """

    low: float
    high: float
    above: list[str]
    below: list[str]


def head_window(sections: Sequence[Section], unit: str) -> HeadWindow:
    """Range of the head axis for a picture of sections, which shows heads, pipes, vapour line and limits close to them.

    Limits far away are only named, so that they do not compress the heads. unit : unit of heads, for their texts
    """
    heads = value_range(
        [section.along[name] for section in sections for name in HEAD_QUANTITIES]
    ) or (0.0, 1.0)
    shown = [section.along["elevation"] for section in sections]
    shown += [
        limit
        for section in sections
        for name, limit in section.lines.items()
        if name == VAPOUR_LINE
    ]
    followed = value_range([*map(np.array, heads), *shown]) or heads
    reach, (low, high), above, below = LIMIT_REACH * (heads[1] - heads[0]), followed, [], []
    for name in dict.fromkeys(
        name for section in sections for name in section.lines if name != VAPOUR_LINE
    ):
        limit = value_range([section.lines[name] for section in sections if name in section.lines])
        if limit and limit[0] > followed[1] + reach:
            above.append(f"{name}: from {limit[0]:.4g} {unit}")
        elif limit and limit[1] < followed[0] - reach:
            below.append(f"{name}: from {limit[1]:.4g} {unit}")
        elif limit:
            low = min(low, max(limit[0], followed[0] - reach))
            high = max(high, min(limit[1], followed[1] + reach))
    span = high - low or 1.0
    low -= (EDGE_MARGIN + NAME_MARGIN * len(below)) * span
    high += (EDGE_MARGIN + NAME_MARGIN * len(above)) * span
    return HeadWindow(low, high, above, below)


def value_range(lines: list[np.ndarray]) -> tuple[float, float] | None:
    """Least and greatest of all finite values in some arrays : (least, greatest); None without finite values."""
    values = np.concatenate([np.ravel(line) for line in lines] or [np.empty(0)])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else None


def section_of(result, way: SectionPath) -> Section:
    """Long section of a run along the path `way`."""
    distances = envelope_column(result, "distance")
    strung_up = joined_envelopes(result.envelope, way.legs, distances)
    chainage, pipe = distances.to_si(strung_up["chainage"]), strung_up["pipe"]
    along = {name: strung_up[name] for name in SECTION_QUANTITIES}
    lines, boils = {}, result.summary["fluid"]["vapor_pressure"]
    # a law with cavities has no head at the vapour pressure itself, where vapour fills all
    if boils is not None:
        left = 1.0 + NEAR * result.case.law.cavitates
        lines[VAPOUR_LINE] = head_of(result, boils * left, along["elevation"])
    lines |= limit_lines(result, pipe, along["elevation"])
    parted = _cavity_spans(result, along["min_pressure"], chainage, way)
    beyond = _violations(result, way, chainage, along)
    to_unit = distances.from_si
    return Section(
        way,
        strung_up["chainage"],
        pipe,
        along,
        lines,
        (float(to_unit(way.begin)), float(to_unit(way.end))),
        [(float(to_unit(a)), float(to_unit(b))) for a, b in parted],
        [(float(to_unit(at)), head, name) for at, head, name in beyond],
        [
            device._replace(chainage=float(to_unit(device.chainage)))
            for device in _devices(result, way)
        ],
    )


def cavity_pressure(result) -> float | None:
    """Pressure [Pa] below which a pipe has a cavity: the vapour pressure, which is 0 for a fluid without one.

    It is twice the vapour pressure under a density law that computes cavities. The result is None if the summary of
    the run has no vapour pressure.
    """
    return (
        None
        if result.summary["fluid"]["vapor_pressure"] is None
        else result.case.law.cavity_pressure
    )


def _cavity_spans(
    result, least: np.ndarray, chainage: np.ndarray, way: SectionPath
) -> list[tuple[float, float]]:
    """Spans (begin, end) of chainage [m] around points whose least pressure is at most `cavity_pressure`.

    least : float64[n]  least pressures in the unit of the envelope; chainage : float64[n] [m]
    way : path of the section
    """
    limit = cavity_pressure(result)
    if limit is None:
        return []
    low = envelope_column(result, "min_pressure").to_si(least) <= limit * (1.0 + 1e-9)
    middles = np.concatenate([[way.begin], 0.5 * (chainage[1:] + chainage[:-1]), [way.end]])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low.astype(int), [0]])))
    return [
        (float(middles[a]), float(middles[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]


def _violations(
    result, way: SectionPath, chainage: np.ndarray, along: dict
) -> list[tuple[float, float, str]]:
    """Worst places on a path that violate limits on pressure or head : list of (chainage [m], head, name of the limit).

    chainage : float64[n]  chainages of the section [m]; along : quantity -> float64[n]  results of the section
    """
    violations, chainages = [], Chainages(result.case)
    for verdict in result.summary["verdicts"]:
        limit = result.case.limits.get(verdict["name"])
        on = limit.extent.on if limit is not None else ()
        for worst in verdict["worst"] if verdict["quantity"] in OF_PRESSURE else []:
            leg = next((leg for leg in way.legs if leg.pipe == worst["place"]), None)
            if leg is None or worst["state"] != FAILS or worst["chainage"] is None:
                continue
            at = float(leg.chainage(chainages.leg(leg.pipe, on).distance(worst["chainage"])))
            if leg.begin <= at <= leg.end:
                line = along["min_head" if worst["bound"] == "minimum" else "max_head"]
                violations.append(
                    (at, float(line[np.argmin(np.abs(chainage - at))]), verdict["name"])
                )
    return violations


def _devices(result, way: SectionPath) -> list[SectionDevice]:
    """A `SectionDevice` for each place of the path `way`, its chainage in m, not in the unit of the output."""
    case, devices = result.case, []
    for place, chainage in way.places:
        owner = place.partition(".")[0]
        kind = (
            case.nodes[place].kind
            if place in case.nodes
            else case.nodes[owner].kind
            if owner in case.nodes
            else ""
        )
        parts = [] if kind in ("junction", "") else [f"{place} ({kind})"]
        parts += [
            f"{name} ({kind_text(link)})"
            for name, link in case.links.items()
            if link.kind != "pipe" and place in link.ports.values()
        ]
        devices.append(SectionDevice(chainage, place, tuple(parts)))
    return devices


class HeadAnimation(NamedTuple):
    """Head along a section at several times.

    chainage : float64[n] and heads : float64[k, n], in the units of the envelope; times : float64[k] [s]
    """

    chainage: np.ndarray
    times: np.ndarray
    heads: np.ndarray


def head_animations(result, ways: Iterable[SectionPath]) -> list[HeadAnimation]:
    """Animated heads of the sections `ways`, with about `MAX_NUMBERS` values at most; [] if no frames were stored.

    Raises RunError if a frame cannot be read.
    """
    ways, index = list(ways), None if result.directory is None else result.directory / "fields.pvd"
    if not ways or index is None or not index.is_file():
        return []
    frames = [(t, path) for t, path in read_series(index) if path.stem.isdecimal()]  # of pipes
    if not frames:
        return []
    counts = default_cells(
        {name: result.case.links[name] for name in result.envelope},
        result.case.properties,
        result.case.numerics.cell_time,
    )
    spots = [_cells_along(result, way, counts) for way in ways]
    n = sum(len(indices) for _, indices in spots)
    step = -(-len(frames) * n // MAX_NUMBERS)
    frames = [*frames[:-1:step], frames[-1]]
    cells, rows = sum(counts.values()), []
    for _, path in frames:
        rows.append(read_pipe_lines(path, "head")[2])
        if len(rows[-1]) != cells:
            text = f"number of pipe cells {len(rows[-1])}, but {cells} in the case"
            raise RunError(f"{path}: {text}; run the case again with --force")
    shown = envelope_column(result, "max_head").from_si(np.array(rows))
    times = np.array([t for t, _ in frames])
    return [HeadAnimation(chainage, times, shown[:, indices]) for chainage, indices in spots]


def _cells_along(result, way: SectionPath, counts: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """At most `MAX_POINTS` cells along a section, evenly chosen : (their chainages, their indices in a frame).

    counts : pipe -> number of its cells, in the order of a frame. Chainages are in the unit of the envelope.
    """
    first = dict(zip(counts, np.cumsum([0, *counts.values()]).tolist(), strict=False))
    chainage, indices = [], []
    for leg in way.legs:
        order, n = slice(None, None, -1 if leg.backwards else 1), counts[leg.pipe]
        x = (np.arange(n) + 0.5) * (leg.end - leg.begin) / n
        chainage.append(leg.chainage(x)[order])
        indices.append(first[leg.pipe] + np.arange(n)[order])
    chainage, indices = np.concatenate(chainage), np.concatenate(indices)
    picked = np.unique(
        np.linspace(0, len(indices) - 1, min(MAX_POINTS, len(indices))).round().astype(int)
    )
    return envelope_column(result, "distance").from_si(chainage[picked]), indices[picked]
