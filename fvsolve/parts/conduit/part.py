"""Conduits: partly full and filling pipes such as sewers, and the basin of cells that represents their water."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.parts.basin import MANNING_RANGE, Basin, Physics
from fvsolve.parts.carried_scalar import ScalarValues
from fvsolve.parts.full_pipe import LOSS
from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import (
    PROFILE,
    SHAPE,
    Number,
    Quantity,
    Rows,
    UsualRange,
    Whole,
    between,
    nonnegative,
    positive,
)

DIAMETERS = UsualRange(0.05, 14.0, "house drains to tunnels")
DEFAULT_CELLS = 50
SLOT = 0.01  # width of the slot over the diameter by default, as in EPA SWMM
WIDEST_SLOT = 0.1  # over the diameter: waves in a wider slot are slower than on a free surface


class Conduit(TwoPort, kind="conduit"):
    """Partly full or full circular pipe: A_t + Q_x = 0, Q_t + (Q^2 / A + g I)_x = -g A z_x - friction.

    A is the wetted area, Q the flow, z the invert, I the integral of A over the depth; friction by Manning. Above the
    crown a slot contains the water, whose width gives waves the `surcharge_celerity`. Ports: from, to; the flow through
    an end follows from the head of its node and the waves in the conduit. Stored energy: of its water.
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    along: ClassVar[dict[str, str]] = {
        "depth": "level",
        "filling": "number",
        "flow": "flow",
        "head": "head",
    }
    fixes_pressure: ClassVar[bool] = True
    own_scalars: ClassVar[str] = "along"

    diameter: Annotated[
        float, Quantity("length", positive, "inner diameter [m]", DIAMETERS, PROFILE)
    ]
    length: Annotated[
        float, Quantity("length", positive, "length along its axis [m]", changes=PROFILE)
    ]
    inverts: Annotated[
        tuple[float, float],
        Rows(
            "length",
            length=2,
            about="height of the invert above datum at `from` and at `to` [m]",
            changes=PROFILE,
        ),
    ]
    manning: Annotated[
        float, Number(nonnegative, "Manning's n of the wall [s/m^(1/3)]", MANNING_RANGE, PROFILE)
    ]
    minor_loss: Annotated[float, LOSS] = 0.0
    cells: Annotated[int, Whole(between(1, 10**6), "number of cells", SHAPE)] = DEFAULT_CELLS
    surcharge_celerity: Annotated[
        float | None,
        Quantity(
            "velocity",
            positive,
            "speed of waves in the full conduit [m/s]; 28 sqrt(diameter), by a slot of 1 % of it "
            "if left out",
            UsualRange(1.0, 400.0, "wide slots to elastic pipes"),
            PROFILE,
        ),
    ] = None
    initial_depth: Annotated[
        float | None,
        Quantity(
            "length",
            nonnegative,
            "depth of water at the start, above the diameter under pressure [m]; that of gradually "
            "varied flow, without flow a level between those of both nodes, if left out",
            changes=PROFILE,
        ),
    ] = None
    initial_flow: Annotated[
        float | None,
        Quantity(
            "flow",
            about="flow at the start [m3/s]; that of an inflow at an end, or the steady flow between the heads "
            "of both nodes, 0 where these are not known, if left out",
            changes=PROFILE,
        ),
    ] = None

    scalars: Annotated[
        dict[str, Any], ScalarValues("scalar values in the conduit at the start", Number())
    ] = {}

    def celerity(self, gravity: float) -> float:
        """Speed of waves in the full conduit [m/s]."""
        return self.surcharge_celerity or math.sqrt(0.25 * math.pi * gravity * self.diameter / SLOT)

    def rough(self, gravity: float) -> tuple[float, float]:
        """(g n^2 with Manning's number n [m^(1/3)], minor loss coefficient over twice the length [1/m])."""
        return gravity * self.manning**2, self.minor_loss / (2.0 * self.length)

    def faults(self, name: str, around: CaseContext) -> Faults:
        if name in around.nodes:
            yield (
                (),
                f"a node has the name {name} too; expected another name, since results name the water by it",
            )
        fall = abs(self.inverts[0] - self.inverts[1])
        if fall >= self.length:
            text = f"fall by {fall:g} m over a length of {self.length:g} m; expected a slope below 1: check the units"
            yield ("inverts",), text
        for key, invert, node in zip(
            (0, 1), self.inverts, map(around.nodes.get, self.ports.values()), strict=True
        ):
            bottom = getattr(node, "elevation", None) or 0.0
            if getattr(node, "kind", "") == "tank" and invert < bottom:
                text = f"{invert:g} m is below the bottom of {list(self.ports.values())[key]} at {bottom:g} m"
                yield ("inverts", key), f"{text}; expected the bottom or a higher invert"
        if around.gravity == 0.0:
            yield (), "has a free surface, which needs gravity; expected `gravity` above 0"
        elif around.gravity is not None:
            least = math.sqrt(0.25 * math.pi * around.gravity * self.diameter / WIDEST_SLOT)
            if self.surcharge_celerity is not None and self.surcharge_celerity < least:
                text = (
                    f"{self.surcharge_celerity:g} m/s is slower than waves in a nearly full section"
                )
                yield ("surcharge_celerity",), f"{text}; expected at least {least:.3g} m/s"
        if around.fluid is not None and not ConduitFlow.accepts_law(around.fluid.law):
            text = f'density law "{around.fluid.law}" does not apply to conduits; expected fluid.law = "linear"'
            yield (), text

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        return {}, {}


class ConduitEnd(TwoPort):
    """End of a conduit, a restriction from the node there to the cells.

    conduit : name; patch : "from" or "to"
    """

    kind: ClassVar[str] = "conduit-end"
    conduit: str
    patch: str


class ConduitFlow(Physics, name=""):
    """Area and flow of the cells of a conduit."""

    package: ClassVar[str] = "fvsolve.features.basins.conduit"
    states: ClassVar[dict[str, str]] = {"area": "m2", "flow": "m3/s"}
    fields: ClassVar[dict[str, str]] = {"depth": "level", "surface": "level", "bed": "level"}
    laws: ClassVar[tuple[str, ...]] = ("linear",)
    carries: ClassVar[bool] = True
    has_shocks: ClassVar[bool] = True
    has_closures: ClassVar[bool] = True

    @classmethod
    def has_friction(cls, basin: Basin) -> bool:
        return any(basin.conduit.rough(1.0))

    @classmethod
    def rest(cls, basin: Basin, mean: Any, cells: np.ndarray, area: np.ndarray) -> dict[str, Any]:
        bed = float(basin.bed_at_centres()[cells[0]])
        return {"elevation": bed, "depth": max(basin.level - bed, 0.0), "pressure": None}


@dataclass(frozen=True, eq=False)
class Chain:
    """Conduits that junctions and inflows join, with what keys of their nodes give at the start.

    links : conduits; heads : of nodes of other kinds at its ends, -inf if unknown [m]
    inflows : of junctions and inflows [m3/s]
    """

    links: dict[str, Conduit]
    heads: dict[str, float]
    inflows: dict[str, float]


class ConduitWater(Basin):
    """Basin of a row of cells that represents the water of a conduit.

    level : level of the water at rest above datum [m]; heads : of both nodes at the start, None if unknown [m]
    chain : that of the conduit
    """

    added: ClassVar[bool] = True
    level: float
    conduit: Conduit
    heads: tuple[float | None, float | None]
    chain: Chain

    @property
    def physics_type(self) -> type[Physics]:
        return ConduitFlow

    def bed_at_centres(self) -> np.ndarray:
        """Heights of the invert at the centres of cells above datum [m]."""
        first, last = self.conduit.inverts
        return first + (last - first) * (np.arange(self.conduit.cells) + 0.5) / self.conduit.cells

    def face_link(self, name: str, patch: str, length: float) -> ConduitEnd:
        ends = {
            "from_": self.conduit.ports[patch],
            "to": f"{name}.{patch}",
            "conduit": name,
            "patch": patch,
        }
        return ConduitEnd.model_construct(**ends)
