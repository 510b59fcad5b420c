"""A vessel with gas over its fluid. Knows sizes and pressures; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.connection.part import Connection, Joined, joined
from fvsolve.parts.junction.part import Junction
from fvsolve.parts.node import Node
from fvsolve.parts.table import at_least_one
from fvsolve.parts.value import Number, Quantity, Range, Usual, positive

VOLUMES = Usual(1e-7, 1e5, "pilot accumulators to air cushions in rock")
GAS = Usual(1e4, 2e8, "vacuum to test rigs")
EXPONENTS = Usual(1.0, 2.0, "isothermal to adiabatic real gases")


class Accumulator(Node, kind="accumulator"):
    """A bladder accumulator (`precharge`) or an air vessel (`gas_volume`): p V^n constant in the gas over its fluid.

    Ports: any number, at one pressure, that of the gas: the height of the fluid inside is left out. Stored energy, p
    from ambient: the gas's, p0 V0 ((V0 / V)^(n-1) - 1) / (n - 1) less the work of ambient [J]. Dissipated energy: that
    of its connection.

    A bladder fills `volume` at `precharge`; below it nothing but the hundredth part of `volume`, of fluid in the neck,
    feels the pressure. An air vessel that runs empty lets its air into the place it is joined to.
    """

    no_scalars: ClassVar[str] = "its contents carry no scalars yet"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("precharge", "gas_volume"),)
    quantities: ClassVar[dict[str, str]] = {**Node.quantities, "gas_pressure": "pressure", "gas_volume": "volume"}
    fixes_pressure: ClassVar[bool] = True

    volume: Annotated[float, Quantity("volume", positive, "that gas and fluid share [m3]", VOLUMES)]
    precharge: Annotated[
        float | None,
        Quantity(
            "pressure",
            about="of the gas when it fills volume [Pa]: a bladder; gas_volume is needed if left out",
            usual=GAS,
        ),
    ] = None
    gas_volume: Annotated[
        float | None,
        Quantity(
            "volume", positive, "of the gas at the start [m3]: an air vessel; precharge is needed if left out", VOLUMES
        ),
    ] = None
    exponent: Annotated[float, Number(Range(1.0), "n of p V^n: 1 isothermal, 1.4 adiabatic air", EXPONENTS)] = 1.2
    initial_pressure: Annotated[
        float | None, Quantity("pressure", about="of the gas at the start [Pa]; in equilibrium if left out")
    ] = None
    connection: Annotated[Connection | None, Joined()] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        missing = at_least_one(given, ("precharge", "gas_volume"))
        return super().key_faults(given) + [(keys, f"no gas; {message}") for keys, message in missing]

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        return joined(name, self, Junction.model_construct(elevation=self.elevation))

    def faults(self, name: str, around: Around) -> Faults:
        if (self.gas_volume or 0.0) > self.volume:
            yield ("gas_volume",), f"{self.gas_volume:g} m3 is more than its volume of {self.volume:g} m3"
        if self.initial_pressure is not None:
            yield from around.vacuum("nodes", name, "initial_pressure", [self.initial_pressure])
