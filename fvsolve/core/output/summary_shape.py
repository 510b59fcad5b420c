"""Shape of summary.json: its entries, and the type of each value."""

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, NotRequired, TypedDict

from fvsolve import units
from fvsolve.core.output.json_files import faults_of, joined
from fvsolve.errors import Notice
from fvsolve.parts.date_keys import start_time_in
from fvsolve.units import show

HOLDS, OPEN, FAILS = "holds", "open", "fails"  # states of a limit
IN_WORDS = {HOLDS: "holds", OPEN: "open", FAILS: "FAILS"}
State = Literal["holds", "open", "fails"]
Bound = Literal["minimum", "maximum"]


class ResultMark(NamedTuple):
    """First part and time [s] at which the model does not describe what happens; later results are not valid.

    what : name of the event; place : part, such as "links.main"; text : message
    volume : volume that lacks in a scheduled discharge [m3]; None for other events
    """

    what: str
    place: str
    time: float
    text: str
    volume: float | None = None


class Extremes(NamedTuple):
    """Least and greatest value of a probe over all accepted steps and rows, in its unit, and their times [s].

    A value and its time are None if it was reached at or after the time from which a diverged run is not valid.
    """

    minimum: float | None
    t_min: float | None
    maximum: float | None
    t_max: float | None


class Expectation(NamedTuple):
    """Claim of `[expect]` and its outcome; `claimed`, `found`, `tolerance` and `error` are in `unit`.

    state : `holds`, `fails`, or `open` if the run cannot decide; ok : True if it holds
    error : bound of the error of `found`, None without an error estimate
    """

    text: str
    claimed: float
    found: float | None
    tolerance: float
    unit: str
    state: State
    ok: bool
    error: float | None


class WorstPlace(TypedDict):
    """Place of a limit: entries as in `LimitVerdict`."""

    place: str
    chainage: float | None
    elevation: float | None
    time: float | None
    bound: Bound
    value: float | None
    limit: float | None
    margin: float | None
    error: float | None
    reason: str | None
    state: State


class LimitVerdict(NamedTuple):
    """Limit of `[limits]` and its outcome at the part and time with the least margin.

    Lengths are in m, times in s; value, limit, margin and error are in `unit`.
    state : `holds`; `fails` if the limit is exceeded; `open` if the run cannot decide or an error exceeds its margin
    place, chainage, elevation, time : part, position and time of the least margin; ok : True if the limit holds
    margin : distance of the value from the limit, negative if the limit is exceeded
    bound : "minimum" or "maximum"; until : end time of the run
    error : bound of the error of `value`, None without an error estimate; reason : cause of a large or unknown error
    worst : dicts with these entries for the parts and bounds with the least margins, worst first
    """

    name: str
    ok: bool
    state: State
    place: str
    chainage: float | None
    elevation: float | None
    time: float | None
    bound: Bound
    value: float | None
    limit: float | None
    margin: float | None
    unit: str
    quantity: str
    until: float
    error: float | None
    reason: str | None
    worst: list[WorstPlace]

    @property
    def doubtful(self) -> bool:
        """True if the limit is not exceeded, but the error of its value is greater than its margin."""
        return (
            self.state == OPEN
            and None not in (self.error, self.margin)
            and self.margin < self.error
        )


class Comparison(NamedTuple):
    """Comparison of a measured series with a probe (`[compare]`): differences and peaks in `unit`, times in s."""

    probe: str
    unit: str
    file: str
    shift: float
    points: int
    rms: float | None
    greatest_difference: float | None
    t_greatest_difference: float | None
    measured_peak: float | None
    t_measured_peak: float | None
    computed_peak: float | None
    t_computed_peak: float | None


class CavityRow(TypedDict):
    """Entries of a cavity: key path of its pipe, lengths [m], times [s], volume [m3]."""

    place: str
    time: float
    distance: float
    volume: float
    t_volume: float
    text: str


class EventRow(TypedDict):
    """Entries of an event: time [s], name of the device, kind of event."""

    time: float
    name: str
    what: str


class ProbeRow(TypedDict):
    """Entries of a probe: its dimension and the unit of its values."""

    dimension: str
    unit: str


class ExtremesRow(TypedDict):
    """Entries of the extremes of a probe, as in `Extremes`, and their unit."""

    unit: str
    minimum: float | None
    t_min: float | None
    maximum: float | None
    t_max: float | None


class FluidRow(TypedDict):
    """Properties of the liquid in its reference state [SI]."""

    name: str
    density: float
    bulk_modulus: float | None
    sound_speed: float | None
    viscosity: float | None
    vapor_pressure: float | None
    source: str


class EnvelopeUnits(TypedDict):
    """Units of the columns of envelope.csv."""

    distance: str
    elevation: str
    initial_head: str
    min_pressure: str
    t_min: str
    max_pressure: str
    t_max: str
    min_head: str
    max_head: str


class LedgerRow(TypedDict):
    """Entries of a balance [SI]; further entries are amounts by part."""

    initial: NotRequired[float | None]
    final: NotRequired[float | None]
    inflow: NotRequired[float | None]
    outflow: NotRequired[float | None]
    remainder: float | None
    relative: NotRequired[float | None]


class MethodRow(TypedDict):
    """Entries of a time method: the time from which it was used [s], its name, and the reason."""

    time: float
    method: str
    why: str


class RunUpRow(TypedDict):
    """Entries of a run-up in m and degrees, for each sector; `angle` or `distance` has the places of the sectors."""

    greatest: float | None
    greatest_angle: NotRequired[float | None]
    greatest_distance: NotRequired[float | None]
    angle: NotRequired[list[float]]
    distance: NotRequired[list[float]]
    run_up: list[float | None]
    x: list[float | None]
    y: list[float | None]


class PumpEnergyRow(TypedDict):
    """Entries of the electric energy of a pump [SI], see `parts.pump.energy_use`; cost in the currency of the price."""

    running_share: float | None
    efficiency: float | None
    specific_energy: float | None
    mean_power: float | None
    peak_power: float | None
    energy: float | None
    cost: float | None
    cost_per_day: float | None


class EnergyTotal(TypedDict):
    """Entries of the electric energy of all pumps [SI]."""

    energy: float | None
    peak_power: float | None
    cost: float | None
    cost_per_day: float | None
    demand_charge: float | None


class EnergyUseRows(TypedDict):
    """Entries of the electric energy of pumps."""

    pumps: dict[str, PumpEnergyRow]
    total: EnergyTotal


class PeakSide(TypedDict):
    """Entries of an extreme with its error."""

    value: float | None
    error: float | None
    order: float | None
    reason: str | None


class PeakRow(TypedDict):
    """Entries of the extremes of a probe with their errors."""

    unit: str
    minimum: PeakSide
    maximum: PeakSide


class Resolution(TypedDict):
    """Entries of an estimate of errors: its runs, and reasons of unknown errors."""

    levels: list[float]
    kept: list[str]
    words: str
    reasons: list[str]


class Versions(TypedDict):
    """Versions on which the numbers depend; further entries are those of libraries."""

    case: str
    fvsolve: str


class ChangedSteps(TypedDict):
    """Keys that a continued run changed at time t [s] : key -> value before and after, None if not stated."""

    t: float
    keys: dict[str, list[float | str | None]]


class SummaryShape(TypedDict):
    """Entries of summary.json; those that are not required depend on the command."""

    title: str
    case: str
    reason: str
    ok: bool
    t: float
    invalid_from: float | None
    marks: list[ResultMark]
    cavities: list[CavityRow]
    events: list[EventRow]
    probes: dict[str, ProbeRow]
    time_unit: str
    envelope_units: EnvelopeUnits
    ambient_pressure: float
    fluid: FluidRow
    extremes: dict[str, ExtremesRow]
    ledgers: dict[str, LedgerRow]
    steps: int
    rejections: int
    rhs: int
    jacobians: int
    factorisations: int
    newton: int
    newton_failures: int
    parted: int
    methods: list[MethodRow]
    cells: int
    threads: int
    seconds: float
    seconds_setup: float
    cost: float | None
    run_up: dict[str, RunUpRow]
    warnings: list[Notice]
    expectations: list[Expectation]
    verdicts: list[LimitVerdict]
    comparisons: list[Comparison]
    versions: Versions
    files: list[str]
    energy_use: NotRequired[EnergyUseRows]
    start_time: NotRequired[str]
    ended: NotRequired[str]
    seconds_total: NotRequired[float]
    peaks: NotRequired[dict[str, PeakRow]]
    resolution: NotRequired[Resolution]
    continued: NotRequired[list[ChangedSteps]]


REQUIRED_KEYS = tuple(
    key for key in SummaryShape.__annotations__ if key in SummaryShape.__required_keys__
)
UNITS_OF_ENVELOPE = dict(
    distance="length",
    elevation="head",
    initial_head="head",
    min_pressure="pressure",
    t_min="time",
    max_pressure="pressure",
    t_max="time",
    min_head="head",
    max_head="head",
)


def summary_faults(summary: dict[str, Any]) -> Iterator[str]:
    """Yield a text for each entry of a summary with a wrong type, and for entries that contradict each other."""
    faults = list(faults_of(summary, SummaryShape))
    yield from faults or contradictions(summary)


def contradictions(summary: dict[str, Any]) -> Iterator[str]:
    """Yield a text for each unknown unit, and for extremes and errors of other probes than those of the summary."""
    try:
        start_time_in(summary)
    except ValueError as error:
        yield f"start_time: {error}"
    columns = {"time_unit": ("time", summary["time_unit"])}
    columns |= {
        f"envelope_units.{key}": (kind, summary["envelope_units"][key])
        for key, kind in UNITS_OF_ENVELOPE.items()
    }
    columns |= {
        joined("probes", name): (row["dimension"], row["unit"])
        for name, row in summary["probes"].items()
    }
    for place, (dimension, unit) in columns.items():
        if dimension not in units.DIMENSIONS:
            yield f'{place}.dimension: {show(dimension)} is unknown; expected a dimension such as "pressure"'
        elif fault := unit_fault(unit, dimension):
            yield f"{place}: {fault}"
    for key in ("extremes", *(["peaks"] if "peaks" in summary else [])):
        if summary[key].keys() != summary["probes"].keys():
            yield f"{key}: its names differ from those of probes; expected the same names"


def unit_fault(unit: str, dimension: str) -> str:
    """Text of a unit that does not measure a dimension; "" for others, and for numbers, whose units are free."""
    try:
        if dimension != "number":
            units.find(unit, dimension)
    except ValueError as error:
        return str(error)
    return ""
