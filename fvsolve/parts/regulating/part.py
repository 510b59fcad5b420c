"""Control valves (pressure-reducing, pressure-sustaining, flow-control): keys."""

from typing import Annotated, ClassVar

from fvsolve.parts.link import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import VALUE, Quantity, UsualRange, positive
from fvsolve.parts.valve import Sized

STROKES = UsualRange(1e-4, 1e5, "servo valves to motor drives")
BANDS = UsualRange(20.0, 1e8, "millimetres of water to servo valves")


class Regulating(Sized, TwoPort):
    """Base of self-acting control valves: time_constant dx/dt = error / band, with the opening x from 0 to 1."""

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    time_constant: Annotated[
        float,
        Quantity(
            "time",
            positive,
            "time in which an error of one `band` (or of `set_flow`) opens the shut valve [s]",
            STROKES,
            VALUE,
        ),
    ]


class PressureReducing(Regulating, kind="pressure-reducing"):
    """Valve that limits the pressure at `to`: q = x Cd A sqrt(2 dp / rho), never backwards.

    q is the flow, dp the drop. The opening x follows time_constant dx/dt = (set_pressure - p_to) / band, 0 <= x <= 1.
    Ports: from, to; p_to is taken at the elevation of `to`. Stored energy: none. Dissipated power: dp q [W].
    """

    set_pressure: Annotated[Schedule, Scheduled("pressure", about="set pressure at `to` [Pa]")]
    band: Annotated[
        float,
        Quantity(
            "pressure_drop",
            positive,
            "pressure error that moves the valve over its stroke in one time constant [Pa]",
            BANDS,
        ),
    ] = 1e5


class PressureSustaining(Regulating, kind="pressure-sustaining"):
    """Valve that keeps up the pressure at `from`: q = x Cd A sqrt(2 dp / rho), never backwards.

    q is the flow, dp the drop. The opening x follows time_constant dx/dt = (p_from - set_pressure) / band, 0 <= x <= 1.
    Ports: from, to; p_from is taken at the elevation of `from`. Stored energy: none. Dissipated power: dp q [W].
    """

    set_pressure: Annotated[Schedule, Scheduled("pressure", about="set pressure at `from` [Pa]")]
    band: Annotated[
        float,
        Quantity(
            "pressure_drop",
            positive,
            "pressure error that moves the valve over its stroke in one time constant [Pa]",
            BANDS,
        ),
    ] = 1e5


class FlowControl(Regulating, kind="flow-control"):
    """Valve that limits the flow q from `from` to `to`: q = x Cd A sqrt(2 |dp| / rho) sign(dp).

    dp is the drop. The opening x follows time_constant dx/dt = (set_flow - q) / q0, 0 <= x <= 1, with the first value
    q0 of `set_flow`. For reverse flow the valve is open. Ports: from, to. Stored energy: none. Dissipated power: dp q
    [W].
    """

    set_flow: Annotated[Schedule, Scheduled("flow", positive, "greatest flow, at the reference density [m3/s]")]
