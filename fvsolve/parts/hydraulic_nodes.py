"""Junctions, given inflows, reservoirs and chambers."""

import math
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.core.assembly.lowering import FLOW, HEAD, PRESSURE, Input, Lowering
from fvsolve.core.kernels import dtypes as rec
from fvsolve.parts.nodes_and_links import PlaceOnBody
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import VALUE, Number, Quantity, UsualRange, between, positive


class Junction(PlaceOnBody, kind="junction"):
    """A node without volume: the flows into its links and its demand sum to zero.

    Ports: any number. Stored energy: none. Dissipated energy: none; the demand removes p times demand [W], p its
    pressure.

    With a `required_pressure` the flow is demand ((p - minimum) / (required - minimum))^demand_exponent: 0 up to
    `minimum_pressure`, the full demand from `required_pressure` on (Wagner, Shamir and Marks 1988). It flows out to
    ambient, and (p - ambient) times the flow is dissipated [W].
    """

    driven: ClassVar[tuple[str, float]] = "demand", -1.0

    demand: Annotated[
        Schedule, Scheduled("flow", about="demand at reference density, positive outward [m3/s]")
    ] = Field(default_factory=lambda: constant(0.0))
    required_pressure: Annotated[
        float | None,
        Quantity(
            "pressure",
            about="pressure from which the full demand is supplied [Pa]; always supplied if left out",
        ),
    ] = None
    minimum_pressure: Annotated[
        float | None,
        Quantity(
            "pressure", about="pressure up to which no demand is supplied [Pa]; ambient if left out"
        ),
    ] = None
    demand_exponent: Annotated[
        float,
        Number(
            between(0, 3, open=True),
            "exponent of the supplied demand over pressure, between minimum_pressure and required_pressure",
        ),
    ] = 0.5

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        if self.required_pressure is None:
            return {name: self}, {}
        from fvsolve.parts.outlet.part import outlet_to_ambient

        full = float(self.demand.value.max())
        law = {
            "flow": full,
            "exponent": self.demand_exponent,
            "opening": self.demand,
            "full": full,
            "most": 1.0,
        }
        law |= {"least": self.minimum_pressure, "upper": self.required_pressure, "demand": True}
        places, links = outlet_to_ambient(f"{name}.demand", name, **law)
        return {
            name: self.model_copy(update={"demand": constant(0.0), "required_pressure": None}),
            **places,
        }, links

    def faults(self, name: str, around: CaseContext) -> Faults:
        least = around.ambient if self.minimum_pressure is None else self.minimum_pressure
        if self.required_pressure is None:
            if self.minimum_pressure is not None:
                text = (
                    "has no effect without `required_pressure`; give both keys, or remove this key"
                )
                yield ("minimum_pressure",), text
            return
        if self.required_pressure <= least:
            text = (
                f"{self.required_pressure:g} Pa is not above {least:g} Pa, at which no demand is supplied; "
                "expected a higher pressure"
            )
            yield ("required_pressure",), text
        if least < around.ambient:
            message = (
                f"{least:g} Pa is below ambient pressure, at which nothing can flow out; "
                f"expected at least {around.ambient:g} Pa"
            )
            yield ("minimum_pressure",), message
        full = float(self.demand.value.max())
        if math.isinf(full):
            text = "follows a control without `limits`, which `required_pressure` needs; expected limits of at least 0"
            yield ("demand",), text
        elif not (self.demand.value.min() >= 0.0 and full > 0.0):
            text = "is negative at some time, or always 0; `required_pressure` needs values of at least 0, not all 0"
            yield ("demand",), text


class JunctionRows(Lowering, kind="junction"):
    """Conversion to table rows of junctions, at which the flows add up to the demand."""

    ledger_name = "demand"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = (
            rec.JUNCTION,
            draft.schedules.add(node.demand, draft.fluid.density),
        )

    def inputs(self, model, name, part):
        schedule = int(model.tables.nodes[model.node_names.index(name)]["schedule"])
        return {"demand": Input(FLOW, schedule, model.case.properties.density)}


class Inflow(PlaceOnBody, kind="inflow"):
    """A node without volume that supplies a given flow(t) to its links.

    Ports: any number. Stored energy: none. Dissipated energy: none; it supplies p times flow [W], p its pressure.
    """

    driven: ClassVar[tuple[str, float]] = "flow", 1.0
    own_scalars: ClassVar[str] = "inflow"

    flow: Annotated[
        Schedule,
        Scheduled("flow", about="flow at reference density, positive into the network [m3/s]"),
    ]


class InflowRows(Lowering, kind="inflow"):
    """Conversion to table rows of inflows: junctions with a negative demand."""

    ledger_name = "inflow"

    def place(self, draft, name, node, row) -> None:
        row["kind"], row["schedule"] = (
            rec.JUNCTION,
            draft.schedules.add(node.flow, -draft.fluid.density),
        )

    def inputs(self, model, name, part):
        schedule = int(model.tables.nodes[model.node_names.index(name)]["schedule"])
        return {"flow": Input(FLOW, schedule, -model.case.properties.density)}


class Reservoir(PlaceOnBody, kind="reservoir"):
    """A place of given pressure, p = pressure(t) or p = ambient + rho g (head(t) - elevation) [Pa].

    Ports: any number, with any flow. Stored energy: none. The energy ledger books energy through its ports as work done
    on the network. Dissipated energy: none.
    """

    driven: ClassVar[tuple[str, float]] = "pressure", 0.0
    own_scalars: ClassVar[str] = "inflow"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("pressure", "head"),)
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("pressure", "head"),)
    fixes_pressure: ClassVar[bool] = True

    pressure: Annotated[
        Schedule | None,
        Scheduled("pressure", about="pressure at the elevation of the reservoir [Pa]"),
    ] = None
    head: Annotated[
        Schedule | None,
        Scheduled("head", about="head above datum, relative to ambient pressure [m]"),
    ] = None

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.pressure is not None:
            yield from around.boiling_faults(
                "nodes", name, "pressure", self.pressure.value.tolist()
            )
        if self.head is None or around.gravity is None or around.fluid is None:
            return
        head = float(self.head.value.min())
        boiling = around.fluid.vapor_pressure
        height = self.elevation or 0.0
        pressure = around.ambient + around.fluid.density * around.gravity * (head - height)
        if pressure <= boiling:
            place = f"a head of {head:g} m at elevation {height:g} m"
            low = (
                "a vacuum"
                if pressure <= 0.0
                else f"not above the vapour pressure of {boiling:.4g} Pa"
            )
            yield (
                ("head",),
                f"{place} is {pressure:.4g} Pa absolute, {low}; expected a greater head",
            )


class ReservoirRows(Lowering, kind="reservoir"):
    """Conversion to table rows of reservoirs, whose pressure or head follows a schedule."""

    ledger_name = "reservoir"

    def place(self, draft, name, node, row) -> None:
        row["kind"] = rec.FIXED
        if node.head is not None:
            row["schedule"] = draft.hydraulics.add_head(draft.schedules, node.head, row)
        else:
            row["schedule"] = draft.schedules.add(node.pressure)

    def pressure_at_start(self, start, i, node, row) -> float:
        value = start.schedule_value(row["schedule"])
        return start.law.pressure_under(value - row["elevation"]) if row["head_given"] else value

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return ""

    def inputs(self, model, name, part):
        i, weight = model.node_names.index(name), model.case.properties.density * model.case.gravity
        row = model.tables.nodes[i]
        index = int(row["schedule"])
        ground = model.case.ambient_pressure - weight * float(row["elevation"])
        return {
            "pressure": Input(PRESSURE, index, node=i),
            "head": Input(HEAD, index, weight, ground, node=i),
        }


class Chamber(PlaceOnBody, kind="chamber"):
    """A rigid vessel full of fluid, (V / beta) dp/dt = net flow into it; V `volume`, p pressure, beta bulk modulus.

    Ports: any number (docs/course.md, 80). Stored energy, p above ambient: V p^2 / (2 beta) [J] under the density law
    `linear`, V (beta (exp(p / beta) - 1) - p) under the law `log`. Dissipated energy: none.
    """

    own_scalars: ClassVar[str] = "start"
    fixes_pressure: ClassVar[bool] = True

    volume: Annotated[
        float,
        Quantity(
            "volume",
            positive,
            "volume of fluid [m3]",
            UsualRange(1e-10, 1e5, "cylinders to caverns"),
            VALUE,
        ),
    ]
    initial_pressure: Annotated[
        float | None,
        Quantity(
            "pressure", about="pressure at the start [Pa]; that of the steady state if left out"
        ),
    ] = None

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.initial_pressure is not None:
            yield from around.boiling_faults(
                "nodes", name, "initial_pressure", [self.initial_pressure]
            )


class ChamberRows(Lowering, kind="chamber"):
    """Conversion to table rows of chambers: nodes whose pressure follows from the mass of the fluid in them."""

    def place(self, draft, name, node, row) -> None:
        moving, air = name in draft.owned, draft.fluid.air
        row["kind"], row["volume"] = rec.MOVING if moving else rec.CHAMBER, node.volume
        row["stiffness"] = draft.fluid.bulk_modulus / (draft.fluid.density * node.volume)
        # by a piston whose both ends are masses or frames on one axis, not points of bodies
        swept = False
        if moving:
            cylinder = draft.case.links[name.rpartition(".")[0]]
            ends = [draft.case.nodes.get(cylinder.ports[port]) for port in ("case", "rod")]
            swept = all(getattr(end, "domain", "") == "translational" for end in ends)
        row["y"] = draft.states([f"{name}.{'excess' if swept else 'mass'}"], 1e5 / row["stiffness"])
        # air makes the stiffness depend on pressure
        if moving or (air is not None and air.fraction > 0.0):
            row["row"] = draft.stiff()

    def pressure_at_start(self, start, i, node, row) -> float | None:
        if node.initial_pressure is not None:
            return node.initial_pressure
        return (
            start.case.ambient_pressure
            if row["kind"] == rec.MOVING and not start.is_joined(i)
            else None
        )

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        return f"chamber {name}: pressure changes by {amount(row['stiffness'] * inflow, 'pressure', span=True)}/s"
