"""Spool valves: ports, edges, size, command and dynamics."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.nodes_and_links import Link, Ports
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import keys_json, read_keys
from fvsolve.parts.value import (
    PROFILE,
    SHAPE,
    VALUE,
    Choice,
    Number,
    Quantity,
    Range,
    ReadContext,
    UsualRange,
    Value,
    between,
    nonnegative,
    positive,
)
from fvsolve.parts.valve import Sized
from fvsolve.units import show

Edge = tuple[str, str, int]  # from, to, sign of the position at which it opens
EDGES: dict[str, tuple[Edge, ...]] = {
    "4/3": (("P", "A", 1), ("P", "B", -1), ("A", "T", -1), ("B", "T", 1)),
    "3/2": (("P", "A", 1), ("A", "T", -1)),
    "2/2": (("P", "A", 1),),
}
PORTS = {"4/3": ("P", "T", "A", "B"), "3/2": ("P", "A", "T"), "2/2": ("P", "A")}
SIZES = ("discharge_coefficient", "loss_coefficient", "Kv", "Cv", "area", "diameter")
DYNAMIC_KEYS = ("damping_ratio", "stroke_time", "hysteresis")  # keys that need `natural_frequency`


@dataclass(frozen=True)
class BelowUnity(Range):
    """Range of numbers below 1."""

    def check(self, value: float, given: Any) -> None:
        super().check(value, given)
        if not value < 1.0:
            raise ValueError(f"{show(given)} is out of range; expected a value {self}")

    def __str__(self) -> str:
        return "below 1" if self.least == -math.inf else f"of at least {self.least:g} and below 1"


@dataclass(frozen=True)
class Overlap(Value):
    """Value of a case file for the overlap of metering edges: a number for all of them, or a table by edge."""

    edges: tuple[Edge, ...]
    about: str = "overlap of the edges, share of the stroke from the centre to an end; negative is an underlap"
    changes: str = PROFILE
    number: ClassVar[Quantity] = Number(
        BelowUnity(), usual=UsualRange(-0.5, 0.5, "critical centre to wide overlap")
    )

    def read(self, given: Any, setting: ReadContext) -> Any:
        return (
            read_keys(given, self.keys, setting)
            if isinstance(given, dict)
            else self.number.read(given, setting)
        )

    @property
    def keys(self) -> dict[str, tuple[Value, Any]]:
        return {f"{start}-{end}": (self.number, 0.0) for start, end, _ in self.edges}

    @property
    def takes(self) -> str:
        return f"-, below 1; `{{ {', '.join(self.keys)} }}`"

    def below(self, key: str) -> Value | None:
        return self.keys[key][0]

    def json(self) -> dict[str, Any]:
        return {"anyOf": [self.number.json(), keys_json(self.keys)]}


@dataclass(frozen=True)
class WayPorts(Ports):
    """Ports of a spool valve; the JSON schema needs only those that all types have."""

    def json(self) -> dict[str, Any]:
        return super().json() | {"required": ["P", "A"]}


def flow_names(ways: str) -> dict[str, str]:
    """Quantities of a spool valve -> dimension."""
    return {f"flow_{port}": "flow" for port in PORTS[ways]} | {"position": "number"}


class SpoolValve(Sized, Link, kind="spool-valve"):
    """Spool valve: edges P-A and B-T open by the position x above 0, edges P-B and A-T by x below 0.

    Each edge is a valve, q = o Cd A sqrt(2 |dp| / rho) sign(dp), with flow q, drop dp (docs/course.md, 79) and opening
    o = max(0, (|x| - overlap) / (1 - overlap)). With `natural_frequency` x follows the command: x'' = w^2 (command - x)
    - 2 damping_ratio w x', |x'| <= 1 / stroke_time. Ports: P, T, A, B; P, A, T with ways = "3/2"; P, A with "2/2".
    Stored energy: none, that of the spool is neglected. Dissipated power: dp q [W], summed over the edges.
    """

    ways_of: ClassVar[str] = "4/3"
    sizes: ClassVar[str] = "area, diameter, Kv, Cv or rated_flow"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        *Sized.alternatives,
        ("rated_flow", *SIZES[:4]),
        ("rated_flow", *SIZES[4:]),
        ("position", "command"),
    )
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("position", "command"),)
    joins: ClassVar[dict[str, str]] = dict.fromkeys(PORTS["4/3"], "hydraulic")
    quantities: ClassVar[dict[str, str]] = flow_names("4/3")
    synonyms: ClassVar[dict[str, str]] = {
        "lap": "overlap",
        "deadband": "dead_band",
        "underlap": "a negative `overlap`",
        "rated_pressure": "rated_drop",
        "bandwidth": "natural_frequency",
        "spool_position": "position",
        "signal": "command",
    }

    ports: Annotated[dict[str, str], WayPorts(PORTS["4/3"])]
    ways: Annotated[
        str, Choice("type of spool valve", tuple(EDGES), "number of ports and positions")
    ] = "4/3"
    rated_flow: Annotated[
        float | None,
        Quantity(
            "flow",
            positive,
            "flow of each edge at full opening and `rated_drop`, instead of another size [m3/s]",
            UsualRange(1e-6, 1.0, "pilot valves to large servo valves"),
        ),
    ] = None
    rated_drop: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "pressure drop of each edge at `rated_flow` [Pa]",
            UsualRange(1e4, 3.5e7, "large spools to servo valves"),
        ),
    ] = None
    overlap: Annotated[Any, Overlap(EDGES["4/3"])] = 0.0
    position: Annotated[  # the schedule is divided where an edge opens
        Schedule | None,
        Scheduled("number", between(-1, 1), "position of the spool, -1 to 1", changes=SHAPE),
    ] = None
    command: Annotated[
        Schedule | None,
        Scheduled(
            "number",
            between(-1, 1),
            "position that the spool follows, -1 to 1, instead of `position`",
            changes=SHAPE,
        ),
    ] = None
    natural_frequency: Annotated[
        float | None,
        Quantity(
            "frequency",
            positive,
            "frequency at which the position lags the command by 90 degrees [Hz]; no delay if left "
            "out",
            UsualRange(0.1, 2e3, "large proportional valves to servo valves"),
            VALUE,
        ),
    ] = None
    damping_ratio: Annotated[
        float | None,
        Number(
            nonnegative,
            "damping ratio of the spool, with `natural_frequency`; 1 is critical",
            changes=VALUE,
        ),
    ] = None
    stroke_time: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "least time of the spool from the centre to an end [s]; no limit of its speed if left out",
            UsualRange(1e-4, 10.0, "servo valves to large proportional valves"),
        ),
    ] = None
    dead_band: Annotated[
        float | None,
        Number(
            BelowUnity(0),
            "command below which the spool stays in the centre; 0 if left out",
            UsualRange(1e-4, 0.5, "proportional valves"),
        ),
    ] = None
    hysteresis: Annotated[
        float | None,
        Number(
            BelowUnity(0),
            "width of the loop of position over command, with `natural_frequency`; 0 if left out",
            UsualRange(1e-4, 0.2, "servo valves to valves without position control"),
        ),
    ] = None

    @classmethod
    def variant(cls, given: dict[str, Any]) -> type[Link]:
        ways, ports = str(given.get("ways", "4/3")), given.get("ports")
        # a fault of its own; its ports tell what is meant
        if ways not in EDGES and isinstance(ports, dict):
            ways = next((other for other, names in PORTS.items() if {*ports} == {*names}), ways)
        return {"3/2": ThreeWaySpoolValve, "2/2": TwoWaySpoolValve}.get(ways, SpoolValve)

    def model_post_init(self, context: Any) -> None:
        if self.rated_flow is None:
            super().model_post_init(context)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        rated = "rated_flow" in given or "rated_drop" in given
        faults = super(Sized, cls).key_faults(given) if rated else super().key_faults(given)
        for key, other in (("rated_flow", "rated_drop"), ("rated_drop", "rated_flow")):
            if key in given and other not in given:
                faults.append(((key,), f"needs the key `{other}`"))
        dynamic = "natural_frequency" in given
        if dynamic and "damping_ratio" not in given:
            faults.append(
                (("natural_frequency",), "needs the key `damping_ratio`, for example 0.8")
            )
        faults += [
            ((key,), "needs the key `natural_frequency`")
            for key in DYNAMIC_KEYS
            if key in given and not dynamic
        ]
        if "position" in given and "command" not in given:
            text = "needs the key `command`; `position` is the position of the spool itself"
            faults += [((key,), text) for key in ("natural_frequency", "dead_band") if key in given]
        return faults

    def flow_area(self, density: float = 1000.0) -> float:
        if self.rated_flow is None:
            return super().flow_area(density)
        return self.rated_flow / math.sqrt(2.0 * self.rated_drop / density)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Metering edges: from, to, sign of the position at which each opens."""
        return EDGES[self.ways_of]

    def overlap_of(self, edge: Edge) -> float:
        """Overlap of an edge, share of the stroke."""
        return (
            self.overlap[f"{edge[0]}-{edge[1]}"] if isinstance(self.overlap, dict) else self.overlap
        )

    def opening_line(self, edge: Edge) -> tuple[float, float]:
        """(a, b) of the opening max(0, a x + b) of an edge at the position x."""
        overlap = self.overlap_of(edge)
        return edge[2] / (1.0 - overlap), 0.0 - overlap / (1.0 - overlap)

    @property
    def input_key(self) -> str:
        """Key of the schedule: "position" or "command"."""
        return "command" if self.position is None else "position"

    @property
    def schedule(self) -> Schedule:
        """Schedule of the position or of the command."""
        return getattr(self, self.input_key)

    def after_dead_band(self, command: float) -> float:
        """Position that a command asks for, sign(u) max(0, |u| - d) / (1 - d)."""
        d = self.dead_band or 0.0
        if d == 0.0:
            return command
        return (
            (command - d) / (1.0 - d)
            if command > d
            else (command + d) / (1.0 - d)
            if command < -d
            else 0.0
        )

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        if self.natural_frequency is not None and self.damping_ratio < 0.1:
            text = "damping ratio below 0.1: the spool swings for many periods"
            yield ("damping_ratio",), self.damping_ratio, 0.1, text


class ThreeWaySpoolValve(SpoolValve):
    """Spool valve with the ports P, A and T."""

    ways_of: ClassVar[str] = "3/2"
    joins: ClassVar[dict[str, str]] = dict.fromkeys(PORTS["3/2"], "hydraulic")
    quantities: ClassVar[dict[str, str]] = flow_names("3/2")

    ports: Annotated[dict[str, str], WayPorts(PORTS["3/2"])]
    overlap: Annotated[Any, Overlap(EDGES["3/2"])] = 0.0


class TwoWaySpoolValve(SpoolValve):
    """Spool valve with the ports P and A."""

    ways_of: ClassVar[str] = "2/2"
    joins: ClassVar[dict[str, str]] = dict.fromkeys(PORTS["2/2"], "hydraulic")
    quantities: ClassVar[dict[str, str]] = flow_names("2/2")

    ports: Annotated[dict[str, str], WayPorts(PORTS["2/2"])]
    overlap: Annotated[Any, Overlap(EDGES["2/2"])] = 0.0
