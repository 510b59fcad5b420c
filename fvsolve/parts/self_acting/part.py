"""Self-acting valves: check, relief, pressure-reducing, pressure-sustaining and flow-control valves."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import ListTable, Table, exclusive_key_faults, keys_json, read_lists
from fvsolve.parts.value import (
    NEEDED,
    SHAPE,
    VALUE,
    Number,
    Quantity,
    ReadContext,
    Rows,
    UsualRange,
    Value,
    nonnegative,
    positive,
)
from fvsolve.parts.valve import Sized

DROPS = UsualRange(20.0, 1e8, "millimetres of water to the springs of test rigs")


class Disc(Table):
    """A disc on a spring; its lift x, from 0 on the seat to 1 at the stop, tends to a target that pressures set.

    time_constant dx/dt = target - x, or x'' = w^2 (target - x) - 2 damping_ratio w x' with w = 2 pi natural_frequency.
    """

    time_constant: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            "time constant of the disc, damping over stiffness [s]; no delay if left out",
            UsualRange(1e-6, 300.0, "poppets to damped flaps"),
            VALUE,
        ),
    ] = None
    natural_frequency: Annotated[
        float | None,
        Quantity(
            "frequency",
            positive,
            "undamped natural frequency of the disc, instead of `time_constant` [Hz]",
            UsualRange(1e-2, 2e4, "flaps to poppets"),
            VALUE,
        ),
    ] = None
    damping_ratio: Annotated[
        float | None,
        Number(
            nonnegative,
            "damping ratio of the disc, with `natural_frequency`; 1 is critical",
            changes=VALUE,
        ),
    ] = None

    @property
    def has_dynamics(self) -> bool:
        """True if the disc moves with a delay, so that its lift is a state."""
        return self.time_constant is not None or self.natural_frequency is not None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given) + exclusive_key_faults(
            given, ("time_constant", "natural_frequency")
        )
        if "natural_frequency" in given and "damping_ratio" not in given:
            faults.append(
                (("natural_frequency",), "needs the key `damping_ratio`, for example 0.3")
            )
        if "damping_ratio" in given and "natural_frequency" not in given:
            faults.append((("damping_ratio",), "needs the key `natural_frequency`"))
        return faults


@dataclass(frozen=True)
class SlamCurve(ListTable):
    """Reverse velocity at which a check valve shuts, over the deceleration of the flow; linear between entries.

    rate : deceleration, ascending [m/s2]; reverse_velocity : velocity in the bore [m/s]
    """

    rate: tuple[float, ...]
    reverse_velocity: tuple[float, ...]


class SlamCurveTable(Value):
    """Value of a case file for a manufacturer's curve of slam velocities."""

    about = "manufacturer's curve of the reverse velocity at which the valve shuts, over the deceleration of the flow"
    takes = "`{ rate = [...], reverse_velocity = [...] }`, m/s2 and m/s"
    keys = {
        "rate": (Rows("acceleration", nonnegative), NEEDED),
        "reverse_velocity": (Rows("velocity", nonnegative), NEEDED),
    }

    def read(self, given: Any, setting: ReadContext) -> SlamCurve:
        if isinstance(given, SlamCurve):
            return given
        if not isinstance(given, dict):
            raise ValueError(f"is not a table; expected {self.takes}")
        return SlamCurve(*read_lists(given, self.keys, setting, "rates"))

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys)


class CheckValve(Disc, Sized, TwoPort, kind="check-valve"):
    """Check valve: a turbulent restriction q = Cd A sqrt(2 dp / rho) while open, shut when the flow reverses.

    It opens again when the drop dp from `from` to `to` exceeds `cracking_pressure`. With `time_constant` or
    `natural_frequency` its disc moves with a delay: q = x Cd A sqrt(2 |dp| / rho) sign(dp), and the lift x of the disc
    tends to (dp - cracking_pressure) / overpressure, so the flow reverses before the valve shuts. With `deceleration`
    it shuts at the reverse velocity of that curve. Ports: from, to (docs/course.md, 79). Stored energy: none, that of
    the disc is neglected. Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    cracking_pressure: Annotated[
        float,
        Quantity(
            "pressure_drop", nonnegative, "pressure drop above which the valve opens [Pa]", DROPS
        ),
    ] = 0.0
    overpressure: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "drop above `cracking_pressure` that opens the valve fully, with time_constant or natural_frequency [Pa]",
            DROPS,
        ),
    ] = None
    deceleration: Annotated[Any, SlamCurveTable()] = None

    @property
    def bore_area(self) -> float:
        """Area of the bore [m2], to which the velocities of the key `deceleration` refer."""
        return self.area if self.area is not None else math.pi / 4.0 * self.diameter**2

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        moves = "time_constant" in given or "natural_frequency" in given
        if moves and "overpressure" not in given:
            faults.append(
                (
                    (),
                    "overpressure is missing: the drop above `cracking_pressure` that holds the valve fully open",
                )
            )
        if "overpressure" in given and not moves:
            faults.append(
                (("overpressure",), "needs the key `time_constant` or `natural_frequency`")
            )
        if "deceleration" in given and moves:
            text = (
                "is not valid with `time_constant` or `natural_frequency`, which also define how the valve shuts; "
                "keep either this key or the others"
            )
            faults.append((("deceleration",), text))
        if "deceleration" in given and not {"area", "diameter"} & set(given):
            text = (
                "the velocities of this curve refer to a bore, whose size is missing; give `diameter` or `area`, and "
                "`loss_coefficient` instead of Kv or Cv"
            )
            faults.append((("deceleration",), text))
        return faults


class ReliefValve(Disc, Sized, TwoPort, kind="relief-valve"):
    """Relief valve, q = x Cd A sqrt(2 |dp| / rho) sign(dp), with flow q, drop dp and lift x between 0 and 1.

    x = (p_from - set_pressure) / overpressure. The lift follows the pressure at once, or with the dynamics of a disc
    that has a time_constant or a natural_frequency. Ports: from, to. Stored energy: none, that of the disc is
    neglected. Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    set_pressure: Annotated[
        float,
        Quantity(
            "pressure",
            about="pressure at `from` above which the valve opens, gauge or absolute by its unit [Pa]",
        ),
    ]
    overpressure: Annotated[
        float,
        Quantity(
            "pressure_drop",
            positive,
            "pressure above `set_pressure` at which the valve is fully open [Pa]",
            DROPS,
        ),
    ]


STROKES = UsualRange(1e-4, 1e5, "servo valves to motor drives")
BAND = Quantity(
    "pressure_drop",
    positive,
    "pressure error that moves the valve over its stroke in one time constant [Pa]",
    UsualRange(20.0, 1e8, "millimetres of water to servo valves"),
)


class Regulating(Sized, TwoPort):
    """Base of self-acting control valves: time_constant dx/dt = error / band, with the opening x from 0 to 1."""

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    time_constant: Annotated[
        float,
        Quantity(
            "time",
            nonnegative,
            "time in which an error of one `band` (or of `set_flow`) opens the shut "
            "valve [s]; 0: it acts at once, between "
            "pipes without waves",
            STROKES,
            SHAPE,
        ),
    ]


class PressureReducing(Regulating, kind="pressure-reducing"):
    """Valve that limits the pressure at `to`: q = x Cd A sqrt(2 dp / rho), never backwards.

    q is the flow, dp the drop. The opening x follows time_constant dx/dt = (set_pressure - p_to) / band, 0 <= x <= 1.
    Ports: from, to; p_to is taken at the elevation of `to`. Stored energy: none. Dissipated power: dp q [W].
    """

    set_pressure: Annotated[Schedule, Scheduled("pressure", about="set pressure at `to` [Pa]")]
    band: Annotated[float, BAND] = 1e5


class PressureSustaining(Regulating, kind="pressure-sustaining"):
    """Valve that keeps up the pressure at `from`: q = x Cd A sqrt(2 dp / rho), never backwards.

    q is the flow, dp the drop. The opening x follows time_constant dx/dt = (p_from - set_pressure) / band, 0 <= x <= 1.
    Ports: from, to; p_from is taken at the elevation of `from`. Stored energy: none. Dissipated power: dp q [W].
    """

    set_pressure: Annotated[Schedule, Scheduled("pressure", about="set pressure at `from` [Pa]")]
    band: Annotated[float, BAND] = 1e5


class FlowControl(Regulating, kind="flow-control"):
    """Valve that limits the flow q from `from` to `to`: q = x Cd A sqrt(2 |dp| / rho) sign(dp).

    dp is the drop. The opening x follows time_constant dx/dt = (set_flow - q) / q0, 0 <= x <= 1, with the first value
    q0 of `set_flow`. For reverse flow the valve is open. Ports: from, to. Stored energy: none. Dissipated power: dp q
    [W].
    """

    set_flow: Annotated[
        Schedule, Scheduled("flow", positive, "greatest flow, at the reference density [m3/s]")
    ]
