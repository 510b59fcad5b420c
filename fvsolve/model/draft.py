"""The tables of one model while they are filled: all that grows, declared in one place."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case.case import Case
from fvsolve.errors import CaseError, Fault, Notice
from fvsolve.kernels import limits
from fvsolve.kernels import records as rec
from fvsolve.model.device import Device
from fvsolve.model.hydraulics import Hydraulics
from fvsolve.model.lowering import Lowering, lowered
from fvsolve.model.model import PipeMesh
from fvsolve.model.schedules import Schedules
from fvsolve.model.slate import LINE, lined
from fvsolve.model.state_names import StateNames


def rows(record: np.dtype) -> Any:
    """A table that has no rows yet."""
    return field(default_factory=lambda: np.zeros(0, record))


def twin(table: np.ndarray) -> np.ndarray:
    """A copy, by bytes: numpy would copy records field by field."""
    return np.ndarray(table.shape, table.dtype, bytearray(table.tobytes()))


@dataclass(slots=True, eq=False)
class Draft:
    """Tables, names and states of a model on the way; nothing else may be hung on it."""

    case: Case
    fluid: Any = None
    hydraulics: Any = None
    faults: list[Fault] = field(default_factory=list)
    warnings: list[Notice] = field(default_factory=list)

    # numbers that rows point to
    schedules: Schedules = field(default_factory=Schedules)
    floats: list[float] = field(default_factory=list)
    integers: list[int] = field(default_factory=list)
    pieces_of_plane: list[np.ndarray] = field(default_factory=list)
    plane_size: int = 0
    work_size: int = 0

    # states
    size: int = 0
    state_names: StateNames = field(default_factory=StateNames)
    scale: array = field(default_factory=lambda: array("d"))  # what counts as a small deviation of each
    cells: int = 0  # of pipes
    tanks: int = 0
    moving: int = 0  # places whose pressure follows what they hold by a stiffness that changes

    # names, in the order of rows; places that links own
    node_index: dict[str, int] = field(default_factory=dict)
    owned: set[str] = field(default_factory=set)
    pipe_names: list[str] = field(default_factory=list)
    column_names: list[str] = field(default_factory=list)
    valve_names: list[str] = field(default_factory=list)
    body_names: list[str] = field(default_factory=list)
    point_index: dict[str, int] = field(default_factory=dict)
    points: list[tuple] = field(default_factory=list)  # rows, as they are asked for
    pin_names: list[str] = field(default_factory=list)
    bushing_names: list[str] = field(default_factory=list)
    lines: list[tuple] = field(default_factory=list)
    factor_size: int = 0  # entries of a mass matrix
    mass_names: list[str] = field(default_factory=list)
    mass_index: dict[str | None, int] = field(default_factory=dict)
    piston_names: list[str] = field(default_factory=list)
    push_names: list[str] = field(default_factory=list)
    wall_names: list[str] = field(default_factory=list)
    devices: list[tuple] = field(default_factory=list)  # (name, part, what it is lowered by)
    laws: list[str] = field(default_factory=list)  # modules of compiled laws, as rows of `hooks` lie
    events: list[tuple[str, str]] = field(default_factory=list)  # (what, what it means); "": nothing to a reader
    meshes: list[PipeMesh] = field(default_factory=list)
    basins: list[Any] = field(default_factory=list)
    links: dict[str, list[tuple]] = field(default_factory=dict)  # table -> links that fill it, see `model.lowering`
    followed: dict[str, Any] = field(default_factory=dict)  # pipe -> by cells or as a delay line, see `model.delay`

    # rows
    node_table: np.ndarray = rows(rec.NODE)
    pipe_table: np.ndarray = rows(rec.PIPE)
    column_table: np.ndarray = rows(rec.COLUMN)
    valve_table: np.ndarray = rows(rec.VALVE)
    cluster_table: np.ndarray = rows(rec.CLUSTER_RECORD)
    device_table: np.ndarray = rows(rec.DEVICE)
    body_table: np.ndarray = rows(rec.BODY)
    freedom_table: np.ndarray = rows(rec.FREEDOM)
    line_table: np.ndarray = rows(rec.LINE)
    pin_table: np.ndarray = rows(rec.PIN)
    bushing_table: np.ndarray = rows(rec.BUSHING)
    ride_table: np.ndarray = rows(rec.RIDE)
    mass_table: np.ndarray = rows(rec.MASS)
    brace_table: np.ndarray = rows(rec.BRACE)
    stop_table: np.ndarray = rows(rec.STOP)
    piston_table: np.ndarray = rows(rec.PISTON)
    basin_table: np.ndarray = rows(rec.BASIN)
    patch_table: np.ndarray = rows(rec.PATCHES)
    scalar_table: np.ndarray = rows(rec.SCALAR)
    wall_table: np.ndarray = rows(rec.WALL)
    delay_table: np.ndarray = rows(rec.DELAY)
    probe_table: np.ndarray = rows(rec.PROBE)

    # of the start
    locked: dict[int, list[str]] = field(default_factory=dict)  # piston -> sides at which shut chambers may hold
    shut: dict[int, list[str]] = field(default_factory=dict)  # and those that no open link joins to anything
    tables: Any = None  # all of them, as kernels read them
    shapes: Any = None  # of what runs write
    watched_start: np.ndarray = field(default_factory=lambda: np.zeros(0))  # see `Model`
    profiles: dict[int, np.ndarray] = field(default_factory=dict)  # pipe -> pressure of the profile at centres [Pa]
    steady: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        case = self.case
        self.fluid, self.hydraulics = case.properties, Hydraulics(case)
        self.warnings += case.notes
        self.links = lowered(case)
        self.schedules.span = case.numerics.start, case.numerics.end
        self.node_index = {name: i for i, name in enumerate(case.places)}
        self.owned = {f"{name}.{place}" for name, link in case.links.items() for place in link.owns}

    def copied(self, case: Case) -> Draft:
        """The same, packed, for a case of the same numbers but where it is changed: what a start writes is its own."""
        made = object.__new__(Draft)
        tables = {id(one): twin(one) for one in self.tables if one.flags.writeable}
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value = tables.get(id(value), value)
            elif isinstance(value, (list, dict)):
                value = value.copy()
            setattr(made, name, value)
        made.case, made.hydraulics = case, Hydraulics(case)
        made.tables = rec.Tables(*(tables.get(id(table), table) for table in self.tables))
        made.warnings = [*case.notes, *self.warnings[len(self.case.notes) :]]
        for table, rows in self.links.items():
            made.links[table] = [(name, case.links.get(name, link), lowering) for name, link, lowering in rows]
        return made

    def fault(self, place: str, message: str) -> None:
        self.faults.append(Fault(place, message))

    def check(self) -> None:
        if self.faults:
            raise CaseError(self.faults, str(self.case.path or self.case.name))

    def states(self, names: Sequence[str], scale: float | list[float]) -> int:
        """Offset of new states, `scale` of each or of all of them."""
        self.state_names.add(names)
        self.scale += array("d", scale) if isinstance(scale, list) else array("d", [scale]) * len(names)
        self.size += len(names)
        return self.size - len(names)

    def to_plane(self, values: np.ndarray) -> int:
        """Offset of new values in `plane`, where a cache line begins."""
        self.pieces_of_plane.append(np.append(np.ravel(values), np.zeros(-values.size % LINE)))
        self.plane_size += self.pieces_of_plane[-1].size
        return self.plane_size - self.pieces_of_plane[-1].size

    def plane(self) -> np.ndarray:
        """All values of the plane, from a cache line on."""
        made = lined(self.plane_size)
        np.concatenate([np.zeros(0), *self.pieces_of_plane], out=made)
        return made

    def to_work(self, size: int) -> int:
        """Offset of new room in `work`, where a cache line begins."""
        self.work_size += size + -size % LINE
        return self.work_size - size - -size % LINE

    def room(self) -> int:
        """Numbers that basins have taken so far."""
        return self.plane_size + self.work_size + len(self.integers)

    def flags(self, name: str, events: tuple[str, ...]) -> int:
        """Offset in `armed` of new flags, one an event function of a part."""
        found = limits.EVENTS * self.tanks + len(self.events)
        self.events += [(name.removesuffix(".inside"), text) for text in events]
        return found

    def hooks(self, lowering: Lowering) -> int:
        """Row of `hooks` of the functions of a law."""
        law = lowering.law.__name__
        self.laws += [] if law in self.laws else [law]
        return self.laws.index(law)

    def inside(self, name: str) -> str:
        """What lies behind the connection of a part, or the part itself."""
        return f"{name}.inside" if f"{name}.inside" in self.node_index else name

    @property
    def device_names(self) -> list[str]:
        """Parts that are devices, as their table has them."""
        return [name for name, _, _ in self.devices]

    def device_of(self, name: str) -> Device:
        """What a device is lowered by."""
        return self.devices[self.device_names.index(name)][2]

    def fill(self, table: str, record: np.dtype) -> tuple[list[str], np.ndarray]:
        """(names of links, the rows that they fill) of a table."""
        parts = self.links.get(table, [])
        names = [name for name, _, lowering in parts for _ in range(lowering.rows)]
        rows, at = np.zeros(len(names), record), 0
        if table == "valve":
            rows["device"] = rows["hooks"] = rows["data"] = rows["event"] = -1
            rows["back"] = 1.0
        for key in {"ride", "delay"}.intersection(record.names):
            rows[key] = -1
        for name, link, lowering in parts:
            lowering.fill(self, name, link, rows[at : at + lowering.rows])
            at += lowering.rows
        return names, rows

    def ends(self, link, row) -> None:
        """The nodes that a link joins."""
        row["from_node"], row["to_node"] = self.node_index[link.from_], self.node_index[link.to]

    def stiff(self) -> int:
        """Row of a place whose pressure follows what it holds by a stiffness that changes."""
        self.moving += 1
        return self.moving - 1

    def restriction(self, name, link, row) -> None:
        """G of a valve's size, and below which flow it is laminar."""
        row["conductance"] = 2.0 * self.fluid.density * link.flow_area() ** 2
        if link.laminar_reynolds is not None:
            row["transition"] = self.hydraulics.transition_flow(name, link, link.laminar_reynolds, self.fault)
