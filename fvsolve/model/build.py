"""From a case to a model: the one place where names meet numbers."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.case.case import Case
from fvsolve.errors import CaseError, Fault, FvsolveError, Notice
from fvsolve.kernels import limits
from fvsolve.kernels import records as rec
from fvsolve.model.basins import at_start, dispersion, lower_basins
from fvsolve.model.bodies import lower_bodies
from fvsolve.model.cavities import coarse_for_cavities
from fvsolve.model.clusters import sort_nodes
from fvsolve.model.device import Device, lower_devices
from fvsolve.model.hydraulics import Hydraulics
from fvsolve.model.lowering import Lowering, lowering_of, rows_in
from fvsolve.model.model import Model, PipeMesh
from fvsolve.model.probes import lower_probes
from fvsolve.model.profile import start_profile
from fvsolve.model.ranges import flow_notices
from fvsolve.model.scalars import lower_scalars, settle_scalars, start_amounts
from fvsolve.model.schedules import Schedules
from fvsolve.model.schemes import scheme_settings
from fvsolve.model.slate import LINE, lined


def build(case) -> Model:
    """The model of a case, with the profile it starts from.

    Raises CaseError where no start can be found: a frictionless pipe between unequal heads, a demand that nothing
    can bring, a node joined only by rigid columns.
    """
    if not isinstance(case, Case):
        raise FvsolveError(f"build takes a Case, not {type(case).__name__}; wanted what load() gives")
    draft = Draft(case)
    draft.nodes()
    draft.links()
    draft.settle()
    return draft.model()


class Draft:
    """The tables of one model while they are filled."""

    def __init__(self, case) -> None:
        self.case, self.fluid = case, case.properties
        self.hydraulics = Hydraulics(case)
        self.schedules = Schedules()
        self.floats: list[float] = []
        self.pieces_of_plane: list[np.ndarray] = []
        self.plane_size = self.work_size = 0
        self.owned = {f"{name}.{place}" for name, link in case.links.items() for place in link.owns}
        self.node_index = {name: i for i, name in enumerate(case.places)}
        self.faults: list[Fault] = []
        self.warnings: list[Notice] = [*case.notes]
        self.size = self.tanks = self.cells = self.moving = 0
        self.laws: list[str] = []  # modules of compiled laws, as rows of `hooks` lie
        self.events: list[tuple[str, str]] = []  # (what, what it means); of those that mean nothing to a reader ""
        self.state_names: list[str] = []
        self.scale: list[float] = []
        self.meshes: list[PipeMesh] = []

    def fault(self, place: str, message: str) -> None:
        self.faults.append(Fault(place, message))

    def check(self) -> None:
        if self.faults:
            raise CaseError(self.faults, str(self.case.path or self.case.name))

    def states(self, names: list[str], scale: float) -> int:
        """Offset of new states."""
        self.state_names += names
        self.scale += [scale] * len(names)
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

    # rows ---------------------------------------------------------------------------------------------------

    def nodes(self) -> None:
        table = self.node_table = np.zeros(len(self.case.places), rec.NODE)
        table["y"] = table["shape"] = table["schedule"] = table["row"] = -1
        table["full"] = np.inf
        for row, (name, node) in zip(table, self.case.places.items(), strict=True):
            row["elevation"] = self.case.elevation(name)
            lowering_of(type(node)).place(self, name, node, row)

    def links(self) -> None:
        self.pipe_names, self.pipe_table = self.fill("pipe", rec.PIPE)
        self.column_names, self.column_table = self.fill("column", rec.COLUMN)
        self.valve_names, self.valve_table = self.fill("valve", rec.VALVE)
        lower_devices(self)
        for row in self.pipe_table:
            self.node_table["admittance"][row["from_node"]] += row["admittance"]
            self.node_table["admittance"][row["to_node"]] += row["admittance"]
        lower_bodies(self)

    def fill(self, table: str, record: np.dtype) -> tuple[list[str], np.ndarray]:
        """(names of links, the rows that they fill) of a table."""
        parts = rows_in(self.case, table)
        names = [name for name, _, lowering in parts for _ in range(lowering.rows)]
        rows, at = np.zeros(len(names), record), 0
        if table == "valve":
            rows["device"] = rows["hooks"] = rows["data"] = rows["event"] = -1
            rows["back"] = 1.0
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

    # the profile and the rest -------------------------------------------------------------------------------

    def settle(self) -> None:
        sort_nodes(self)
        lower_basins(self)
        lower_scalars(self)
        self.check()
        self.profiles: dict[int, np.ndarray] = {}  # pipe -> pressure of the profile at centres [Pa]
        self.pack(np.zeros(self.profile_size()))
        self.steady = start_profile(self)
        settle_scalars(self)
        self.check()

    def profile_size(self) -> int:
        """Place of every pipe's profile: a threshold a cell; under `log` and `table` masses and fluxes behind it."""
        at = self.cells
        if self.case.law.linear:
            return 2 * at if self.case.scalars else at
        for row in self.pipe_table:
            n = row["cells"]
            row["face"], row["flux"], row["center"] = at, at + n + 1, at + 2 * n + 2
            at += 3 * n + 2
        return int(at)

    def pack(self, profile: np.ndarray) -> None:
        """Make the tuple of tables, and shape what runs write; records stay the same arrays: later changes are seen."""
        case, pipes = self.case, self.pipe_table
        settings = np.zeros(1, rec.SETTINGS)
        s = settings[0]
        scheme_settings(s, case.numerics.scheme, case.numerics.limiter)
        s["viscosity"] = self.fluid.viscosity or 0.0
        s["ambient"], s["gravity"] = case.ambient_pressure, case.gravity
        s["vapor"] = self.fluid.vapor_pressure
        s["stop_below"] = case.numerics.below_vapor == "stop"
        case.law.lower(self.fluid, s, self.floats)
        s["rate"] = max([0.0, *(pipes["speed"] / pipes["dx"] * pipes["quicker"]), *self.column_rates()])
        self.probe_table = lower_probes(self)
        schedules, pieces = self.schedules.tables()
        schedules.flags.writeable = pieces.flags.writeable = False  # from here on, as in the model
        most, cells = max(pipes["cells"], default=0), self.cells
        system = max((c["nodes"] * (c["nodes"] + 4) + 5 * c["valves"] for c in self.cluster_table), default=0)
        rigid = int(np.sum(self.node_table["columns"] > 1))
        system = max(system, rigid * (rigid + 3))
        system += 6 * len(self.node_table) + 2 * len(self.valve_table) + 4 * len(self.cluster_table)
        many = len(self.scalar_table)
        carried = many * len(self.node_table)
        layout = np.zeros(1, rec.LAYOUT)
        at = rec.OUT_HEAD
        for name, size in (
            ("pressure", len(self.node_table)), ("supply", len(self.node_table)), ("gain", carried),
            ("loss", sum(self.scalar_table["losses"])),
            ("net", len(self.node_table)),
            ("ends", 4 * len(pipes)), ("valve", len(self.valve_table)), ("column", len(self.column_table)),
            ("led", len(self.column_table)),
            ("stiffness", self.moving), ("had", self.moving), ("swept", self.moving),
            ("net_force", len(self.body_table)), ("push", len(self.push_names)),
            ("conductance", len(self.valve_table)), ("drive", len(self.valve_table)),
            ("value", carried), ("edge", 2 * len(pipes) * many),
            ("carried", 2 * len(pipes) * many), ("brought", carried),
        ):  # fmt: skip
            layout[name], at = at, at + size
        layout["size"] = at
        parts = len(pipes) + 3 * len(self.node_table) + len(self.column_table)
        marks = parts + 2 * len(self.device_table) + len(self.piston_table)
        if case.law.cavitates:  # first place, greatest volume and its time of the cavities of each pipe
            marks += 3 * len(pipes)
            s["vapor"] = case.law.cavity_pressure
        self.tables = rec.Tables(
            settings, layout, pipes, self.node_table, self.valve_table, self.column_table, self.cluster_table,
            schedules, self.probe_table, self.body_table, self.brace_table, self.stop_table, self.piston_table,
            self.device_table, self.basin_table, self.patch_table, self.scalar_table,
            np.array(self.integers, dtype=np.int64), np.array(self.floats, dtype=float), profile, self.plane(), pieces,
        )  # fmt: skip
        self.shapes = rec.Written(
            clock=1, work=self.work_size, marks=marks,
            armed=limits.EVENTS * self.tanks + len(self.events) + 2 * len(self.stop_table),
            scratch=max((5 if many else 4) * most + 64, system, 2 * len(self.body_table), 4 * carried), spare=at,
            envelope=(4, cells), extremes=(4, len(self.probe_table)),
        )  # fmt: skip

    def column_rates(self):
        stiff = self.node_table["stiffness"]
        for row in self.column_table:
            k = stiff[row["from_node"]] + stiff[row["to_node"]]
            yield math.sqrt(k * row["area"] / row["length"])

    def start_state(self) -> np.ndarray:
        """No deviation from the profile but in basins that start from one, and the amounts of scalars."""
        found = at_start(self.basins, self.size)
        start_amounts(self, found)
        return found

    def model(self) -> Model:
        case = self.case
        inside = sorted(
            (t, jump) for t, jump in self.schedules.breaks.items() if case.numerics.start <= t <= case.numerics.end
        )
        start = self.start_state()
        self.warnings += [*dispersion.warnings(self.basins, start), *coarse_for_cavities(self), *flow_notices(self)]
        return Model(
            case, self.tables, self.shapes, self.state_names, np.array(self.scale), inside, self.schedules.spacing,
            self.meshes, list(case.places), list(case.links), self.valve_names, self.column_names, self.piston_names,
            self.body_names, {name: case.elevation(name) for name in case.places}, case.probes, self.warnings,
            self.steady, self.profiles, self.devices, self.laws, start, self.events,
            self.basins,
        )  # fmt: skip


def shaped_volume(level, area, volume, z: float) -> float:
    """Volume below level z [m3] of a tank whose areas are linear between levels and held above the last."""
    if z >= level[-1]:
        return float(volume[-1] + (z - level[-1]) * area[-1])
    k = int(np.searchsorted(level, z, side="right")) - 1
    s = z - level[k]
    return float(volume[k] + s * (area[k] + 0.5 * s * (area[k + 1] - area[k]) / (level[k + 1] - level[k])))
