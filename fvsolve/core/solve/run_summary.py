"""Summary of a run: reason of its end, first times outside validity, balances, extremes, envelopes, counts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model import Model, RunData
from fvsolve.errors import Notice, listing

if TYPE_CHECKING:
    from fvsolve.core.solve.run_up import RunUpTable

INTEGRATION_TIMES = 10001  # times at which a scheduled flow is integrated, beside its own
UNRECORDED = np.array([[np.inf], [np.nan], [-np.inf], [np.nan]])  # extremes before the first record


@dataclass(frozen=True)
class Mark:
    """First occurrence of a condition outside the validity of the model, after which results are not reliable.

    what : kind of condition; place : key path of the part; time : [s]; text : description with a remedy
    volume : volume that lacks in a discharge [m3], None for other conditions
    """

    what: str
    place: str
    time: float
    text: str
    volume: float | None = None


@dataclass(frozen=True)
class Cavity:
    """First column separation of a pipe.

    place : key path of the pipe; time : [s]; distance : distance from the `from` end [m]
    volume : greatest total volume of all cavities of the pipe [m3], reached at `t_volume` [s]
    """

    place: str
    time: float
    distance: float  # from the pipe's `from` end
    volume: float
    t_volume: float
    text: str


@dataclass(frozen=True)
class Event:
    """Event of a device: time [s], name of the device, kind of event."""

    time: float
    name: str
    what: str


@dataclass
class Summary:
    """Results of a run without output rows and field frames, in SI units with absolute pressures.

    reason : reason of the end; ok : True if the results are valid; t : time of the end [s]
    seconds, seconds_setup : elapsed time of the steps, and of the preparation of the run [s]
    extremes : result of `find_extremes`; envelope : result of `find_envelope`
    """

    reason: str
    ok: bool
    t: float
    marks: list[Mark] = field(default_factory=list)
    ledgers: dict[str, dict[str, Any]] = field(default_factory=dict)
    extremes: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    envelope: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    # envelope at points between cells of pipes
    points: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    # extremes without a probe
    watched: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    # steps, rejections, rhs calls, Newton iterations, ...
    counts: dict[str, int] = field(default_factory=dict)
    # methods with start time and reason
    methods: list[dict[str, Any]] = field(default_factory=list)
    cells: int = 0
    seconds: float = 0.0
    processor: float = 0.0  # CPU time of the steps
    seconds_setup: float = 0.0
    events: list[Event] = field(default_factory=list)
    cavities: list[Cavity] = field(default_factory=list)  # computed by the law `mixture`
    # notices of the run, without those of the model
    warnings: list[Notice] = field(default_factory=list)
    threads: int = 1
    # time from which results are invalid, because states have grown [s]
    invalid_from: float = np.inf
    # result of `find_maxima`
    maxima: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    run_ups: dict[str, RunUpTable] = field(default_factory=dict)  # result of `find_run_ups`
    # result of `energy_use` of `parts.pump`
    energy_use: dict[str, Any] = field(default_factory=dict)

    @property
    def finished(self) -> bool:
        """True if the run reached its end time, even with wrong numbers; studies use it with their own checks."""
        return self.reason == "finished"

    @property
    def steps(self) -> int:
        """Number of accepted steps."""
        return self.counts.get("steps", 0)

    @property
    def cost(self) -> float:
        """CPU time of the steps per step and cell [ns]; for a model without cells per step."""
        return 1e9 * self.processor / max(1, self.steps * max(1, self.cells))


def find_marks(run_data: RunData, of_features: list[Mark]) -> list[Mark]:
    """First time of each condition outside the model's validity, at each place.

    Pressures below vapour pressure are left out under a density law that models cavities. Overflow of tanks is always
    left out, because the mass ledger contains it. of_features : marks that replace "dry" at the same places
    """
    model, marks = run_data.model, run_data.marks
    if np.isnan(marks).all():
        return []
    pipes, nodes = model.pipes, model.node_names
    kinds = [("below vapor pressure", f"links.{pipe.name}") for pipe in pipes]
    kinds += [
        (kind, f"nodes.{name}")
        for kind in ("below vapor pressure", "dry", "spilling")
        for name in nodes
    ]
    kinds = [(kind, place.removesuffix(".inside")) for kind, place in kinds]
    kinds += [("stopped dead", f"links.{name}") for name in model.column_names]
    kinds += [mark for feature in model.features for mark in feature.marks]
    kinds += [("outside its curve", f"links.{name}") for name, *_ in model.devices]
    texts = {
        "stopped dead": (
            "the last outlet of the column shut during flow, or the column hit another column; a rigid column has "
            "no pressure surge: use a pipe"
        ),
        "outside its curve": (
            "the pump works in reverse or beyond the last flow of its curve; give the key `rated_speed` to extend the "
            "curve by the Suter table for the specific speed of the pump, or give "
            "`suter = { rated_flow, rated_head, table }` instead of the curve"
        ),
        "beyond its stroke": "the piston is beyond an end of its stroke; add an end-stop",
        "below vapor pressure": (
            "pressure falls below vapour pressure; the liquid column would separate; to model this, set "
            f"{model.case.law.cavitation_keys}cavitation = true in [fluid]"
        ),
        "dry": "no water is left for the outflow; the missing water is added (`made_up` in the mass balance)",
    }
    explained = {mark.place for mark in of_features}
    found = [(*kinds[k], float(marks[k])) for k in np.flatnonzero(np.isfinite(marks[: len(kinds)]))]
    return [
        Mark(kind, place, time, f"{place.split('.', 1)[1]}: {texts[kind]}")
        for kind, place, time in found
        if kind in texts
        and not (kind == "below vapor pressure" and model.cavitates)
        and not (kind == "dry" and place in explained)
    ]


def scheduled_volume(schedule, start: float, end: float) -> float:
    """Integral of a scheduled flow [m3] from `start` to `end`; nan for the output of a control."""
    from fvsolve.exact.solution import value

    inside = schedule.time[(schedule.time > start) & (schedule.time < end)]
    t = np.union1d(np.linspace(start, end, INTEGRATION_TIMES), inside)
    return float(
        0.5 * np.sum((value(schedule, t[:-1]) + value(schedule, t[1:], left=True)) * np.diff(t))
    )


def spill_notices(run_data: RunData) -> list[Notice]:
    """Notices for tanks that overflow, with the time of the first overflow."""
    model, notices = run_data.model, []
    first = len(model.pipes) + 2 * len(model.node_names)
    for node, time in zip(model.node_names, run_data.marks[first:], strict=False):
        if np.isfinite(time):
            name = node.removesuffix(".inside")
            when = model.case.moment(float(time))
            text = f"{name}: full to its height, it spills from {when} on; the mass ledger contains the lost water"
            notices.append(Notice("spilling", f"nodes.{name}", text, "height", float(time)))
    return notices


def unsupplied_demands(
    run_data: RunData, span: tuple[float, float], entered: np.ndarray, events: list[Event]
) -> tuple[list[Notice], list[Event]]:
    """Notices for demands that no open path could supply, one for those that lost their supply at the same time.

    The events are those losses. span : times of start and end of the run [s]
    entered : float64[nodes]  mass that has entered at each node [kg]; events : of the run
    """
    model = run_data.model
    marks = run_data.marks
    notices = []
    losses = []
    nodes = len(model.node_names)
    valves = model.valve_names
    amount = model.case.amount
    shut, first, last = np.split(
        marks[marks.size - 3 * nodes - len(valves) : -nodes], len(valves) + nodes * np.arange(2)
    )
    for begin in np.unique(first[np.isfinite(first)]).tolist():
        own = np.flatnonzero(first == begin)
        names = [model.node_names[i] for i in own]
        losses += [Event(begin, name, "loses its supply") for name in names]
        lack = sum(lacking_volume(model, name, span, entered) for name in names)
        amounts = (
            f"{amount(lack, 'volume', 4)} lack" if np.isfinite(lack) else "the demand is not met"
        )
        causes = listing(
            [_shut_by(valves[k], begin, events) for k in np.flatnonzero(shut == begin)], 6
        )
        text = (
            f"{listing(names, 6)}: no open path supplies the demand between {model.case.moment(begin)} and "
            f"{model.case.moment(float(last[own].max()))}{f'; shut: {causes}' if causes else ''}; {amounts}, and "
            "the pressure there is that of drained pipes"
        )
        notices.append(
            Notice(
                "unsupplied",
                f"nodes.{names[0]}",
                text,
                "demand",
                lack if np.isfinite(lack) else None,
            )
        )
    return notices, losses


def lacking_volume(
    model: Model, name: str, span: tuple[float, float], entered: np.ndarray
) -> float:
    """Demand of a node over a run less the volume drawn [m3]; arguments as for `unsupplied_demands`."""
    outlet = model.case.conduits.get(f"{name}.demand")  # of a demand that depends on pressure
    demand = model.case.places[name].demand if outlet is None else outlet.opening
    place = model.node_names.index(name if outlet is None else outlet.to)
    return scheduled_volume(demand, *span) + float(entered[place]) / model.case.properties.density


def undetermined_notices(run_data: RunData) -> list[Notice]:
    """Notice of probed or limited nodes that were isolated without a demand; empty without such nodes."""
    model, first = run_data.model, run_data.model.case.numerics.start
    numbers = np.unique(model.tables.probes["index"][run_data.undetermined_probes])
    names = [model.node_names[i].removesuffix(".inside") for i in numbers]
    if names:
        first = float(run_data.marks[run_data.marks.size - len(model.node_names) + numbers].min())
    probes = zip((*model.probes, *model.watched), run_data.isolated_probes, strict=True)
    names += [probe.name for probe, isolated in probes if isolated and probe.part == "nodes"]
    if not names:
        return []
    text = (
        f"{listing(names, 6)}: from {model.case.moment(first)} on, at least for a time, only shut links "
        "join this part of the network, which draws nothing: no flow determines its pressure, and extremes and "
        "limits leave it out"
    )
    return [Notice("isolated", f"nodes.{names[0]}", text)]


def _shut_by(name: str, time: float, events: list[Event]) -> str:
    """Name of a valve, with the reason of its last event up to a time [s] if that event has one."""
    *_, last = "", *(event.what for event in events if event.name == name and event.time <= time)
    reason = last.partition(": ")[2]
    return f"{name} ({reason})" if reason else name


def device_notices(run_data: RunData) -> list[Notice]:
    """Notices on devices that ran outside the given data, but within the model, such as pumps that ran down."""
    model, marks = run_data.model, run_data.marks
    times = marks[int(model.layout["device_mark"]) + len(model.devices) :]
    return [
        device.passing_notice(model, name, part, float(time))
        for (name, part, device), time in zip(model.devices, times, strict=False)
        if np.isfinite(time)
    ]


def find_cavities(run_data: RunData) -> list[Cavity]:
    """First cavity of every pipe whose pressure fell below twice the vapour pressure (more vapour than gas)."""
    model = run_data.model
    marks = run_data.marks
    cavities = []
    # the marks of islands follow
    end = marks.size - 3 * len(model.node_names) - len(model.valve_names)
    for k, pipe in enumerate(model.pipes if model.cavitates else ()):
        share, volume, t_volume = (float(x) for x in marks[end - 3 * (len(model.pipes) - k) :][:3])
        if np.isfinite(share):
            time, distance = float(marks[k]), share * pipe.length
            amount = model.case.amount
            text = (
                f"{pipe.name}: a cavity opened {amount(distance, 'length')} from {pipe.from_} at "
                f"{model.case.moment(time)}; its greatest volume is {amount(volume, 'volume', silent='l')}, "
                f"at {model.case.moment(t_volume)}"
            )
            cavities.append(Cavity(f"links.{pipe.name}", time, distance, volume, t_volume, text))
    return cavities


def find_extremes(run_data: RunData) -> tuple[dict, dict]:
    """Extremes over all accepted steps and rows of probes, and of what studies and limits need without a probe.

    Both are dicts: text of the probe -> (least value, its time [s], greatest value, its time [s]).
    """
    probes, watched = run_data.model.probes, run_data.model.watched
    columns, isolated = run_data.extremes.copy(), run_data.isolated_probes
    columns[:, : isolated.size][:, isolated] = UNRECORDED
    rows = [tuple(map(float, column)) for column in columns.T]
    found = [(probe.text, row) for probe, row in zip((*probes, *watched), rows, strict=False)]
    return dict(found[: len(probes)]), dict(found[len(probes) :])


def find_point_envelopes(run_data: RunData) -> dict[str, dict[str, np.ndarray]]:
    """Envelopes of pipes at their ends and at the points of their elevation profiles, in the form of `find_envelope`.

    Pipes without an elevation profile are left out, unless a limit or expectation refers to their pressure. Each
    envelope has in addition the initial pressure, `initial_pressure` [Pa].
    """
    model = run_data.model
    probe_count = len(run_data.model.probes)
    points = {}
    rows: dict[str, list[int]] = {}
    for k in np.flatnonzero(np.isfinite(model.watched_start)):
        rows.setdefault(model.watched[k].name, []).append(int(k))
    for pipe in model.pipes:
        if not (own := rows.get(pipe.name)):
            continue
        distance = np.array([model.watched[k].fraction * pipe.length for k in own])
        low, t_low, high, t_high = run_data.extremes[:, probe_count + np.array(own)]
        points[pipe.name] = pressure_envelope(
            model, distance, pipe.height(distance), (low, t_low, high, t_high)
        )
        points[pipe.name]["initial_pressure"] = model.watched_start[own]
    return points


def find_maxima(run_data: RunData, t: float) -> dict[str, dict[str, np.ndarray]]:
    """Greatest values up to time t [s] in cells of each mesh that records them: part -> quantity -> float64[n]."""
    return {
        part.name: part.maxima(t, run_data.maxima)
        for part in run_data.model.meshed
        if part.records_maxima
    }


def find_run_ups(model: Model, maxima: dict[str, dict[str, np.ndarray]]) -> dict[str, RunUpTable]:
    """Tables of the run-ups of a case by name; maxima : result of `find_maxima`"""
    if not model.case.output.run_up:
        return {}
    from fvsolve.core.solve.run_up import run_up_table

    meshed = {part.name: part for part in model.meshed}
    return {
        name: run_up_table(spec, meshed[spec.basin], maxima[spec.basin]["max_surface"])
        for name, spec in model.case.output.run_up.items()
    }


def find_envelope(run_data: RunData) -> dict[str, dict[str, np.ndarray]]:
    """Envelope of each pipe over its cells: name of the pipe -> dict of `pressure_envelope`."""
    model, (low, t_low, high, t_high) = run_data.model, run_data.envelope
    extremes = model.cell_pressures(low), t_low, model.cell_pressures(high), t_high
    distances = np.concatenate([np.zeros(0), *(pipe.x for pipe in model.pipes)])
    envelope = pressure_envelope(model, distances, model.cell_elevations, extremes)
    result = {}
    at = 0
    for pipe in model.pipes:
        cells = slice(at, at := at + pipe.cells)
        result[pipe.name] = {name: values[cells] for name, values in envelope.items()}
    return result


def pressure_envelope(model: Model, distance, elevation, extremes) -> dict[str, np.ndarray]:
    """Envelope of pipes as a dict of float64[points]: least and greatest pressure [Pa] and head [m], and their times.

    distance, elevation : chainage and height of the points [m]
    extremes : least pressures [Pa], their times [s], greatest pressures [Pa], their times [s]
    """
    least, t_min, greatest, t_max = extremes
    return {
        "distance": distance,
        "elevation": elevation,
        "min_pressure": least,
        "t_min": t_min,
        "max_pressure": greatest,
        "t_max": t_max,
        "min_head": model.head(least, elevation),
        "max_head": model.head(greatest, elevation),
    }


def relative(remainder: float, largest: float) -> float:
    """Magnitude of the remainder of a balance as a fraction of its largest term.

    Without positive terms it is 0 for a remainder of 0, otherwise 1.
    """
    return abs(remainder) / largest if largest > 0.0 else float(remainder != 0.0)


def mass_ledger(model: Model, y: np.ndarray, ledger: np.ndarray) -> dict[str, Any]:
    """Mass balance of a run as a dict: stored mass at start and end, inflow, outflow, spilled, made up, remainder [kg].

    ledger : float64[2, nodes + sources]  inflow at each node, and of `Model.sources` [kg]; outflow as negative numbers
    The entry `relative` is the remainder as a fraction of the largest term.
    """
    kinds = model.tables.nodes["kind"]
    initial, change = model.contents(y)
    at, passes = len(model.node_names), set()
    for feature in model.features:
        feature.book_sources(y, ledger[:, at : at + len(feature.sources)])
        at += len(feature.sources)
        passes |= feature.open_nodes(model)
    # nodes with `made_up` and `spilled`
    own = [kind in (rec.TANK, rec.PATCH) and i not in passes for i, kind in enumerate(kinds)]
    words = [("made_up", "spilled") if in_cells else ("inflow", "outflow") for in_cells in own]
    names = [*model.ledger_names, *model.sources]
    words = words + [("inflow", "outflow")] * len(model.sources)
    nodes: dict[str, dict[str, float]] = {}
    for name, (inflow_word, outflow_word), x, y in zip(
        names, words, ledger[0], ledger[1], strict=True
    ):
        if x != 0.0 or y != 0.0:
            nodes.setdefault(name, {}).update({inflow_word: float(x), outflow_word: float(0.0 - y)})
    total = {
        word: sum(row.get(word, 0.0) for row in nodes.values())
        for pair in set(words)
        for word in pair
    }
    remainder = change - float(np.sum(ledger))
    terms = {word: total.get(word, 0.0) for word in ("inflow", "outflow", "spilled", "made_up")}
    largest = max(initial, initial + change, *terms.values())
    return {
        "initial": initial,
        "final": initial + change,
        **terms,
        "by_node": {
            name: row["inflow"] - row["outflow"] for name, row in nodes.items() if "inflow" in row
        },
        "nodes": nodes,
        "remainder": remainder,
        "relative": relative(remainder, largest),
    }
