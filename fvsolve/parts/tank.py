"""Open tanks."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.core.kernels import dtypes as rec
from fvsolve.parts.connection import Connection, ConnectionTable, with_connection
from fvsolve.parts.hydraulic_nodes import Junction
from fvsolve.parts.nodes_and_links import PlaceOnBody
from fvsolve.parts.schedule import constant
from fvsolve.parts.table_model import CaseContext, Faults, ListTable, keys_json, read_lists
from fvsolve.parts.value import (
    NEEDED,
    PROFILE,
    VALUE,
    Quantity,
    ReadContext,
    Rows,
    UsualRange,
    Value,
    nonnegative,
    positive,
)

LEVELS = UsualRange(0.0, 2000.0, "tanks to lakes and shafts")


@dataclass(frozen=True, eq=False)
class AreaTable(ListTable):
    """Area of the free surface over the level, linear between entries and constant outside them.

    level : float64[n]  level above the bottom, ascending from 0 [m]; area : float64[n]  surface at that level [m2]
    """

    level: np.ndarray
    area: np.ndarray


class Surface(Value):
    """Value of a case file for a free surface: an area, or a table of areas over levels."""

    about = "area of the free surface, linear between levels and constant above the last level [m2]"
    takes = "m2, or `{ level = [0, ...], area = [...] }`"
    usual = UsualRange(1e-6, 1e10, "tubes to lakes")
    dimension = "area"
    number = Quantity("area", positive)
    changes = PROFILE
    keys = {"level": (Rows("level", nonnegative), NEEDED), "area": (Rows("area", positive), NEEDED)}

    def read(self, given: Any, setting: ReadContext) -> float | AreaTable:
        if isinstance(given, AreaTable):
            return given
        if not isinstance(given, dict):
            return self.number.read(given, setting)
        bottom = [(("level",), "levels are measured from the bottom; the first must be 0")]
        lists = read_lists(
            given, self.keys, setting, "levels", lambda level, _: bottom * (level[0] != 0)
        )
        return AreaTable(*map(np.array, lists))

    def json(self) -> dict[str, Any]:
        return {"anyOf": [self.number.json(), keys_json(self.keys)]}


class Tank(PlaceOnBody, kind="tank"):
    """An open tank, d(level)/dt = net flow / area(level); its pressure at the bottom is ambient + rho g level.

    Ports: any number, all at the bottom, or outside its `connection` (the throttle of a surge tank). Stored
    energy: rho g times the integral of (elevation + level) area over the level [J]. Dissipated energy: the
    potential energy of water that spills over `height`.
    """

    own_scalars: ClassVar[str] = "start"
    quantities: ClassVar[dict[str, str]] = {**PlaceOnBody.quantities, "level": "level"}
    fixes_pressure: ClassVar[bool] = True

    area: Annotated[Any, Surface()]
    level: Annotated[
        float,
        Quantity("level", nonnegative, "water level above the bottom at the start [m]", LEVELS),
    ]
    height: Annotated[
        float | None,
        Quantity(
            "level",
            positive,
            "level above the bottom at which the tank spills [m]; never if left out",
            LEVELS,
            VALUE,
        ),
    ] = None
    connection: Annotated[Connection | None, ConnectionTable()] = None

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        return with_connection(
            name, self, Junction.model_construct(**self.position_keys, demand=constant(0.0))
        )

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.height is not None and self.level > self.height:
            yield (
                ("level",),
                f"{self.level:g} m is above the `height` of {self.height:g} m; expected a lower level",
            )


class TankRows(Lowering, kind="tank"):
    """Conversion to table rows of tanks: nodes with the hydrostatic pressure at the bottom of their water."""

    ledger_name = "over the rim"

    def place(self, draft, name, node, row) -> None:
        rho = draft.case.law.open_density
        row["kind"], row["level"], row["density"] = rec.TANK, node.level, rho
        if hasattr(node.area, "area"):
            level, area = node.area.level, node.area.area
            volume = np.concatenate(
                ([0.0], np.cumsum(np.diff(level) * 0.5 * (area[1:] + area[:-1])))
            )
            row["shape"], row["shapes"] = len(draft.floats), len(level)
            if len(level) == 1:
                row["shape"] = -1
            else:
                draft.floats += [*level, *area, *volume]
            row["area"] = area.min()
            contents = lambda z: tank_volume(level, area, volume, z)  # noqa: E731
        else:
            row["area"] = node.area
            contents = lambda z: node.area * z  # noqa: E731
        row["mass"] = rho * contents(node.level)
        if node.height is not None:
            row["full"] = rho * contents(node.height)
        row["stiffness"] = draft.case.gravity / row["area"]
        row["row"] = draft.tanks
        draft.tanks += 1
        row["y"] = draft.states([f"{name}.mass"], 0.1 * rho * row["area"])

    def pressure_at_start(self, start, i, node, row) -> float:
        upright = 1.0 if node.on is None else start.case.poses[node.on].attitude[2, 2]
        return start.law.pressure_under(row["level"] * upright)

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        direction = "rises" if flow > 0 else "falls"
        return f"tank {name} {direction} at {amount(abs(flow) / row['area'], 'velocity', silent='mm/s')}"

    def probe(self, draft, name, probe, row) -> None:
        if probe.quantity != "level":
            return super().probe(draft, name, probe, row)
        row["kind"], row["index"] = rec.LEVEL, draft.node_index[draft.inside(name)]


def tank_volume(level, area, volume, z: float) -> float:
    """Volume [m3] of a tank from its bottom to level z [m] above it.

    level, area, volume : levels [m], areas [m2] there and volumes below them [m3]; the area is linear between levels
    and constant above the last level
    """
    if z >= level[-1]:
        return float(volume[-1] + (z - level[-1]) * area[-1])
    k = int(np.searchsorted(level, z, side="right")) - 1
    s = z - level[k]
    return float(
        volume[k] + s * (area[k] + 0.5 * s * (area[k + 1] - area[k]) / (level[k + 1] - level[k]))
    )
