"""Tables of a model while they are filled; coefficients of friction, laminar transitions and hydrostatics of a case."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from copy import copy as shallow_copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.core.assembly.lowering import Lowering, links_by_table
from fvsolve.core.assembly.schedule_tables import Schedules
from fvsolve.core.assembly.state_names import StateNames
from fvsolve.core.fluid.oils import walther_viscosity
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels import tanks
from fvsolve.core.kernels.steady_friction import signed_roughness
from fvsolve.errors import CaseError, Fault, Notice

# h / L = 10.667 q^1.852 / (C^1.852 D^4.871), EPANET's 4.727 in feet, as SI
HAZEN_WILLIAMS = 4.727 * 0.3048**-0.685
MANNING = 4.0 ** (10.0 / 3.0) / math.pi**2  # h / L = 10.294 n^2 q^2 / D^(16/3), SI


class Hydraulics:
    """Coefficients of friction, transition and hydrostatics, from sizes of parts, the fluid and gravity."""

    def __init__(self, case) -> None:
        self.case, self.fluid = case, case.properties
        self.rho, self.gravity, self.ambient = (
            self.fluid.density,
            case.gravity,
            case.ambient_pressure,
        )

    def add_head(self, schedules, head, row) -> int:
        """Add a schedule of head [m] as pressure [Pa] at the elevation of a node's row; return its index.

        Under density laws other than `linear` the schedule remains a head, and `head_given` of the row is set.
        """
        if not self.case.law.linear:
            row["head_given"] = 1
            return schedules.add(head)
        elevation = row["elevation"]
        weight = self.rho * self.gravity
        return schedules.add(head, weight, self.ambient - weight * elevation)

    def friction(self, name: str, link, row, fault) -> None:
        """Set the friction coefficients of a pipe or rigid column in its row, for mass flow M [kg/s].

        They give dM/dt = -loss |M| M - rough f(Re) |M| M with the Darcy factor f, or for Hazen-Williams -loss |M| M -
        rough |M|^0.852 M, see `kernels.steady_friction`. For `steady` friction by roughness the factor is set later,
        from the starting flow. Adds a fault if the law needs a viscosity and the fluid has none.
        """
        area = math.pi / 4.0 * link.diameter**2
        law, row["loss"] = (
            link.friction,
            link.minor_loss / (2.0 * self.rho * area**2 * link.length) * area,
        )
        per_factor = 1.0 / (2.0 * link.diameter * self.rho * area)
        row["friction"] = rec.FRICTION_NONE if row["loss"] == 0.0 else rec.FRICTION_FACTOR
        if law.model == "none":
            return
        if law.model == "unsteady" and not self.fluid.viscosity:
            fault(
                f"links.{name}.friction",
                '"unsteady" needs the fluid\'s viscosity; give the key `fluid.viscosity`',
            )
            return
        if law.model == "hazen-williams":
            row["friction"] = rec.FRICTION_HAZEN
            row["rough"] = (
                area
                * self.rho
                * self.gravity
                * HAZEN_WILLIAMS
                / (self.rho**1.852 * law.coefficient**1.852 * link.diameter**4.871)
            )
        elif law.model == "chezy-manning":
            row["friction"] = rec.FRICTION_FACTOR
            row["loss"] += (
                area
                * self.gravity
                * MANNING
                * law.coefficient**2
                / (self.rho * link.diameter ** (16.0 / 3.0))
            )
        elif law.factor is not None:
            row["friction"] = rec.FRICTION_FACTOR
            row["loss"] += per_factor * law.factor
        elif not self.fluid.viscosity:
            text = "the key `roughness` needs the fluid's viscosity; give `fluid.viscosity`, or the key `factor`"
            fault(f"links.{name}.friction", text)
        else:
            row["friction"], row["rough"] = rec.FRICTION_ROUGH, per_factor
            row["roughness"] = signed_roughness(law.roughness / link.diameter, law.model)
            row["reynolds"] = link.diameter / (area * self.viscosity_at_start(link, row))

    def viscosity_at_start(self, link, row) -> float:
        """Dynamic viscosity in a pipe at the start [Pa s], by its temperature if its friction follows it."""
        heated = [(name, scalar) for name, scalar in self.case.scalars.items() if scalar.heat]
        if self.fluid.walther is None or not heated or "temperature" not in row.dtype.names:
            return self.fluid.viscosity
        (name, scalar), *_ = heated
        row["temperature"] = link.scalars.get(name, scalar.initial) + scalar.zero
        return self.rho * walther_viscosity(self.fluid.walther, float(row["temperature"]))

    def compliance(self, name: str, speed: float, fault) -> float:
        """Relative growth of a pipe's area with pressure [1/Pa], from the density law and the wave speed [m/s].

        Growth below rounding is 0. Adds a fault if it is negative, as the wave speed then exceeds the speed of sound in
        the fluid.
        """
        growth = self.case.law.compliance(speed)
        if growth < -1e-9 / self.fluid.bulk_modulus:
            given, sound = (
                self.case.amount(speed_value, "velocity", 6)
                for speed_value in (speed, self.fluid.sound_speed)
            )
            fault(
                f"links.{name}.wave_speed",
                f"{given} is faster than sound in the fluid, {sound}; expected at most "
                'the speed of sound, or law = "linear"',
            )
        return growth if growth > 1e-9 / self.fluid.bulk_modulus else 0.0

    def transition_flow(self, name: str, link, reynolds: float, fault) -> float:
        """Mass flow [kg/s] of a fully open restriction at the Reynolds number `reynolds` = 4 M / (pi d mu).

        M : mass flow [kg/s]; d : diameter of the opening [m]; mu : viscosity [Pa s]
        If the fluid has no viscosity, the kinematic viscosity of water is used; a stated key `laminar_reynolds` is then
        a fault.
        """
        area = link.flow_area(self.rho)
        if link.diameter is not None:
            area = math.pi / 4.0 * link.diameter**2
        elif link.area is not None:
            area = link.area
        diameter = math.sqrt(4.0 * area / math.pi)
        viscosity = self.fluid.viscosity
        if not viscosity:
            if link.laminar_reynolds is not None:
                fault(
                    f"links.{name}.laminar_reynolds",
                    "needs the fluid's viscosity; give the key `fluid.viscosity`",
                )
            viscosity = 1e-6 * self.rho  # water's: it only bounds the slope at zero drop
        return reynolds * math.pi / 4.0 * diameter * viscosity


# a sum of forces of a joint below this share of their magnitudes is rounding
ROUNDING_SHARE = 1e-12
# likewise in a computed equilibrium: stiff springs amplify the rounding of a length by this much
EQUILIBRIUM_SHARE = 1e-9
CACHE_LINE = 8  # floats of a cache line


def aligned_zeros(size: int) -> np.ndarray:
    """Array of zeros whose first element starts a cache line."""
    buffer = np.zeros(size + CACHE_LINE)
    first = -(buffer.ctypes.data // 8) % CACHE_LINE
    return buffer[first : first + size]


class RowNames(list):
    """Names of the links of a table, one for each row; complete from the start, so that a search needs no loop."""

    def __init__(self, names) -> None:
        super().__init__(names)
        self._first_rows = {name: row for row, name in reversed(list(enumerate(self)))}

    def index(self, name: str, *_) -> int:
        return self._first_rows[name]


@dataclass(frozen=True)
class PipeMesh:
    """Cells of a pipe, counted from its `from` end; for a delay line the places at which fields are computed.

    x, edges : centres and edges of cells, as distances along the pipe [m]; elevation : elevations of the centres [m]
    profile : elevation profile; None for a straight pipe
    """

    name: str
    from_: str
    to: str
    length: float
    diameter: float
    cells: int
    wave_speed: float
    x: np.ndarray
    edges: np.ndarray
    elevation: np.ndarray
    profile: Any  # `parts.pipe.elevation_profile.Profile`, or None
    ends: tuple[float, float]  # elevations of the pipe's ends [m]

    def height(self, distance: Any) -> Any:
        """Elevation of the pipe at distances from its `from` end [m]."""
        if self.profile is None:
            return self.ends[0] + (self.ends[1] - self.ends[0]) * (distance / self.length)
        return self.profile.at(distance)


def no_rows(record: np.dtype) -> Any:
    """Dataclass field for a table that has no rows at first."""
    return field(default_factory=lambda: np.zeros(0, record))


@dataclass(slots=True, eq=False, repr=False)
class ModelDraft:
    """Tables, names and states of a model while it is built. It has slots: no other attributes can be added."""

    case: Any  # `case.Case`
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
    maxima_size: int = 0

    # states
    size: int = 0
    state_names: StateNames = field(default_factory=StateNames)
    # size of a small deviation of each state
    scale: array = field(default_factory=lambda: array("d"))
    cells: int = 0  # cells of pipes
    tanks: int = 0
    moving: int = 0  # nodes whose pressure follows their mass by a variable stiffness

    # names, in the order of rows; nodes that links own
    node_index: dict[str, int] = field(default_factory=dict)
    owned: set[str] = field(default_factory=set)
    pipe_names: list[str] = field(default_factory=list)
    column_names: list[str] = field(default_factory=list)
    valve_names: list[str] = field(default_factory=list)
    devices: list[tuple] = field(default_factory=list)  # (name, part, lowering)
    # modules of compiled laws, in the order of the rows of `hooks`
    laws: list[str] = field(default_factory=list)
    # (name, meaning); "" if an event is not reported
    events: list[tuple[str, str]] = field(default_factory=list)
    meshes: list[PipeMesh] = field(default_factory=list)
    # table -> links with rows in it, see `assembly.lowering.links_by_table`
    links: dict[str, list[tuple]] = field(default_factory=dict)
    features: list[Any] = field(default_factory=list)  # see `assembly.features`

    sizes: Any = None  # `assembly.array_sizes.ArraySizes`, while tables are packed

    # rows
    node_table: np.ndarray = no_rows(rec.NODE)
    pipe_table: np.ndarray = no_rows(rec.PIPE)
    column_table: np.ndarray = no_rows(rec.COLUMN)
    valve_table: np.ndarray = no_rows(rec.VALVE)
    cluster_table: np.ndarray = no_rows(rec.CLUSTER_RECORD)
    device_table: np.ndarray = no_rows(rec.DEVICE)
    coupling_table: np.ndarray = no_rows(rec.COUPLING)
    probe_table: np.ndarray = no_rows(rec.PROBE)
    # event flags at the start that no state tells
    start_flags: dict[int, bool] = field(default_factory=dict)

    # results of the start
    tables: Any = None  # all tables, as kernels read them
    shapes: Any = None  # shapes of the arrays that runs write
    watched_start: np.ndarray = field(default_factory=lambda: np.zeros(0))  # see `Model`
    # pipe -> pressure of the profile at centres [Pa]
    profiles: dict[int, np.ndarray] = field(default_factory=dict)
    steady: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        case = self.case
        self.fluid, self.hydraulics = case.properties, Hydraulics(case)
        self.warnings += case.notices
        self.links = links_by_table(case)
        self.schedules.events = self.events
        self.schedules.span = case.numerics.start, case.numerics.end
        self.node_index = {name: i for i, name in enumerate(case.places)}
        self.owned = {f"{name}.{place}" for name, link in case.links.items() for place in link.owns}

    def copy_for(self, case: Any) -> ModelDraft:
        """Copy of packed tables for a case with tables of the same shapes.

        Writable tables and lists are copied, so that later changes do not reach the original.
        """
        copy = object.__new__(ModelDraft)
        # numpy would copy records field by field, so tables are copied as bytes
        tables = {
            id(source): np.ndarray(source.shape, source.dtype, bytearray(source.tobytes()))
            for source in self.tables
            if source.flags.writeable
        }
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value = tables.get(id(value), value)
            elif isinstance(value, (list, dict, array, StateNames)):
                value = shallow_copy(value)
            setattr(copy, name, value)
        copy.case, copy.hydraulics = case, Hydraulics(case)
        copy.features = [feature.copy_for(case) for feature in self.features]
        copy.tables = rec.Tables(*(tables.get(id(table), table) for table in self.tables))
        copy.warnings = [*case.notices, *self.warnings[len(self.case.notices) :]]
        for table, entries in self.links.items():
            copy.links[table] = [
                (name, case.links.get(name, link), lowering) for name, link, lowering in entries
            ]
        return copy

    @property
    def meshed(self) -> list[Any]:
        """Parts with a mesh of cells, see `assembly.meshed_parts`."""
        return [part for feature in self.features for part in feature.meshed]

    def fault(self, place: str, message: str) -> None:
        self.faults.append(Fault(place, message))

    def check(self) -> None:
        if self.faults:
            raise CaseError(self.faults, str(self.case.path or self.case.name))

    def states(self, names: Sequence[str], scale: float | list[float]) -> int:
        """Add states; return the offset of the first.

        scale : size of a small deviation, a number for all of them or a list with one for each
        """
        self.state_names.add(names)
        self.scale += (
            array("d", scale) if isinstance(scale, list) else array("d", [scale]) * len(names)
        )
        self.size += len(names)
        return self.size - len(names)

    def to_plane(self, values: np.ndarray) -> int:
        """Append values to `plane`, the constant data of meshes, at the start of a cache line; return their offset."""
        self.pieces_of_plane.append(
            np.append(np.ravel(values), np.zeros(-values.size % CACHE_LINE))
        )
        self.plane_size += self.pieces_of_plane[-1].size
        return self.plane_size - self.pieces_of_plane[-1].size

    def plane(self) -> np.ndarray:
        """Array of all values appended by `to_plane`, aligned to cache lines."""
        plane = aligned_zeros(self.plane_size)
        np.concatenate([np.zeros(0), *self.pieces_of_plane], out=plane)
        return plane

    def to_work(self, size: int) -> int:
        """Reserve `size` numbers of the array `work`, at the start of a cache line; return their offset."""
        self.work_size += size + -size % CACHE_LINE
        return self.work_size - size - -size % CACHE_LINE

    def to_maxima(self, size: int) -> int:
        """Reserve `size` numbers of the array `maxima`; return their offset."""
        self.maxima_size += size
        return self.maxima_size - size

    def used_size(self) -> int:
        """Count of the numbers used so far in `plane`, `work`, `maxima` and `integers`."""
        return self.plane_size + self.work_size + self.maxima_size + len(self.integers)

    def flags(self, name: str, events: tuple[str, ...]) -> int:
        """Reserve flags in `armed`, one for each event function of a part; return the offset of the first."""
        first = tanks.EVENTS * self.tanks + len(self.events)
        self.events += [(name.removesuffix(".inside"), text) for text in events]
        return first

    def hooks(self, lowering: Lowering) -> int:
        """Row of the functions of a part's law in the table `hooks`; added on first use."""
        law = lowering.law.__name__
        self.laws += [] if law in self.laws else [law]
        return self.laws.index(law)

    def inside(self, name: str) -> str:
        """Name of the inner node of a part that has one, else of the part itself."""
        return f"{name}.inside" if f"{name}.inside" in self.node_index else name

    @property
    def rounding(self) -> float:
        """Fraction of the sum of force magnitudes below which the sum of these forces counts as rounding error."""
        return EQUILIBRIUM_SHARE if self.case.numerics.initial == "equilibrium" else ROUNDING_SHARE

    @property
    def device_names(self) -> list[str]:
        """Names of devices, in the order of their table."""
        return [name for name, _, _ in self.devices]

    def fill(self, table: str, record: np.dtype) -> tuple[list[str], np.ndarray]:
        """Fill the rows of a table from the links of the case : (name of the link of each row, rows)."""
        parts = self.links.get(table, [])
        names = RowNames(name for name, _, lowering in parts for _ in range(lowering.rows))
        table_rows, at = np.zeros(len(names), record), 0
        if table == "valve":
            table_rows["device"] = table_rows["hooks"] = table_rows["data"] = table_rows[
                "event"
            ] = -1
            table_rows["command"] = table_rows["hold"] = -1
            table_rows["back"] = 1.0
        if "forcing" in record.names:
            table_rows["forcing"] = -1
        for name, link, lowering in parts:
            lowering.fill(self, name, link, table_rows[at : at + lowering.rows])
            at += lowering.rows
        return names, table_rows

    def join(
        self, row, ports: tuple[str, str], places: tuple[str | None, str], **line
    ) -> tuple[float, float]:
        """Write to the row of a force element what it joins, see `Feature.join`."""
        return next(
            found
            for feature in self.features
            if (found := feature.join(self, row, ports, places, **line))
        )

    def ends(self, link, row) -> None:
        """Write the indices of the nodes at both ends of a link to its row."""
        row["from_node"], row["to_node"] = self.node_index[link.from_], self.node_index[link.to]

    def stiff(self) -> int:
        """Index of a new node among the nodes whose stiffness (pressure per stored mass) is not constant."""
        self.moving += 1
        return self.moving - 1

    def restriction(self, name, link, row) -> None:
        """Set the conductance of a fully open valve [kg2/s2/Pa] in its row.

        If `laminar_reynolds` is stated, the flow below which the valve is laminar [kg/s] is set too.
        """
        row["conductance"] = 2.0 * self.fluid.density * link.flow_area(self.fluid.density) ** 2
        if link.laminar_reynolds is not None:
            row["transition"] = self.hydraulics.transition_flow(
                name, link, link.laminar_reynolds, self.fault
            )
