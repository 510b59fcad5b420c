"""Throat between a vessel and its node: keys, the link made from them, and its table rows."""

import math
from typing import Annotated, Any, ClassVar

from fvsolve.core.assembly.lowering import Restriction, opening_input
from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import SHAPE, Number, Quantity, ReadContext, UsualRange, Value, positive
from fvsolve.units import show


class Connection(Table):
    """Throat between a vessel and its node, with a loss coefficient K for each direction: dp = K rho v |v| / 2.

    v is the velocity in the area of the throat.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("area", "diameter"),)
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("area", "diameter"),)

    area: Annotated[
        float | None,
        Quantity(
            "area",
            positive,
            "area of the throat [m2]",
            UsualRange(1e-9, 200.0, "capillaries to shafts"),
        ),
    ] = None
    diameter: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "diameter of the throat [m]",
            UsualRange(5e-5, 14.0, "capillaries to shafts"),
        ),
    ] = None
    # shape: with equal losses a pipe end has other roots
    loss_in: Annotated[
        float,
        Number(
            positive,
            "loss coefficient K in K rho v^2 / 2, v in the throat, for flow into the vessel",
            changes=SHAPE,
        ),
    ]
    loss_out: Annotated[
        float, Number(positive, "loss coefficient K for flow out of the vessel", changes=SHAPE)
    ]


class ConnectionTable(Value):
    """Value of a case file for a connection."""

    about = (
        "throat with a loss coefficient for each flow direction; joined without loss if left out"
    )
    takes = "[connection](#connection)"

    def read(self, given: Any, setting: ReadContext) -> Connection:
        if isinstance(given, Connection):
            return given
        if not isinstance(given, dict):
            raise ValueError(
                f"{show(given)} is not a connection; expected {{ diameter, loss_in, loss_out }}"
            )
        return Connection.model_validate(given, context=setting)

    def below(self, key: str) -> Value | None:
        return Connection.values()[key]

    def json(self) -> dict[str, Any]:
        return Connection.model_json_schema()


class Throat(TwoPort):
    """A connection as a link from the node of a vessel to the vessel behind the throat."""

    kind: ClassVar[str] = "connection"

    size: Connection
    diameter: float | None
    area: float | None
    laminar_reynolds: float | None = None

    def flow_area(self, density: float = 1000.0) -> float:
        """Area of the throat [m2], divided by the square root of the loss coefficient `loss_in`, at any density."""
        return self.throat_area / math.sqrt(self.size.loss_in)

    @property
    def throat_area(self) -> float:
        """Area of the throat [m2]."""
        return (
            self.size.area if self.size.area is not None else math.pi / 4.0 * self.size.diameter**2
        )

    @property
    def outflow_ratio(self) -> float:
        """Ratio of conductances [-]: for flow out of the vessel over that for flow into it."""
        return self.size.loss_in / self.size.loss_out


def with_connection(name: str, vessel: Any, place: Any) -> tuple[dict[str, Any], dict[str, Throat]]:
    """(places, links) that represent a vessel: two dicts by name.

    A vessel without connection is the only place, and there are no links. Otherwise the result is that of
    `behind_throat`. place : node that other links join if there is a connection; it gets the name of the vessel
    """
    if vessel.connection is None:
        return {name: vessel}, {}
    return behind_throat(
        name, vessel.model_copy(update={"connection": None}), place, vessel.connection
    )


def behind_throat(
    name: str, inside: Any, place: Any, size: Connection
) -> tuple[dict[str, Any], dict[str, Throat]]:
    """(places, links) of a vessel behind a throat, each by name: the node `place`, the vessel `inside`, and the throat.

    name : name of the node `place`; size : areas and losses of the throat
    """
    ends = {"from": name, "to": f"{name}.inside"}
    throat = Throat.model_construct(**ends, size=size, diameter=size.diameter, area=size.area)
    return {name: place, f"{name}.inside": inside}, {f"{name}.connection": throat}


class ConnectionRows(Restriction, kind="connection"):
    """Conversion to table rows of the throats of vessels: restrictions with a loss coefficient for each direction."""

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"], row["back"] = draft.schedules.add_constant(1.0), link.outflow_ratio
        super().restriction(draft, name, link, row)

    def inputs(self, model, name, part):
        return opening_input(model, name)
