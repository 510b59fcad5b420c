"""Which functions each room of a scene adds to which job, and in which order. Knows names; knows no law."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module

from fvsolve.kernels.devices.loops import loops_of
from fvsolve.kernels.records import (
    ACOUSTIC_GRID,
    CARRIED_FACES,
    CARRIED_GRID,
    LIQUID_FACES,
    LIQUID_GRID,
    SHALLOW_FACES,
    SHALLOW_GRID,
    TABLE_FACES,
    TABLE_GRID,
)

HOME = "fvsolve.kernels"


@dataclass(frozen=True)
class Room:
    """Functions as `module: function`, "" for none.

    before : sets what the nodes are closed with; core : closes them; after : adds to rates; of the core's own parts,
    clusters : of nodes that several valves join; inflows, hold, move : of rigid columns; brake : rates that steps
    have to see
    observe : reads probes; record : notes an accepted state; events : event functions
    """

    before: str = ""
    core: str = ""
    after: str = ""
    clusters: str = ""
    inflows: str = ""
    hold: str = ""
    move: str = ""
    brake: str = ""
    observe: str = ""
    record: str = ""
    events: str = ""
    power: str = ""
    stored: str = ""


LINEAR = {
    "observe": "observer: observe_linear", "power": "energy: power_linear", "stored": "energy: stored_linear",
}  # fmt: skip
BAROTROPIC = {
    "observe": "barotropic: observe_barotropic",
    "power": "energy_barotropic: power_barotropic", "stored": "energy_barotropic: stored_barotropic",
}  # fmt: skip
FLUIDS = {  # (family of the density law, whether there are pipes)
    ("linear", True): Room(core="network: rhs_linear", **LINEAR),
    ("linear", False): Room(core="lumped: rhs_lumped_linear", **LINEAR),
    ("barotropic", True): Room(core="barotropic: rhs_barotropic", **BAROTROPIC),
    ("barotropic", False): Room(core="barotropic_lumped: rhs_lumped_barotropic", **BAROTROPIC),
    ("cavitating", True): Room(
        core="cavitating: rhs_cavitating", record="cavitating: record_cavities", **BAROTROPIC
    ),
}  # fmt: skip
ALONE = {"linear": Room(core="lumped: rhs_alone", **LINEAR), "barotropic": Room(core="lumped: rhs_alone", **BAROTROPIC)}
MEMORY = {"power": "unsteady.energy: add_power", "stored": "unsteady.energy: add_stored"}
COLUMNS = {"inflows": "columns: column_inflows", "brake": "columns: quickest_column"}
ROOMS = {
    "pipes": Room(record="observer: record_pipes"),
    "valves": Room(brake="network: quickest_valve"),
    "outlets": Room(events="outlets: outlet_events"),
    "closed": Room(events="calls: close_in_turn"),
    "clusters": Room(clusters="clusters: close_clusters"),
    "columns": Room(hold="columns: hold_columns", move="columns: column_rates", **COLUMNS),
    "columns, barotropic": Room(
        hold="barotropic_columns: hold_columns_barotropic", move="barotropic_columns: column_rates_barotropic",
        **COLUMNS,
    ),
    "bodies": Room(
        before="mechanics: chambers", after="mechanics: finish_bodies", observe="mechanics: observe_bodies",
        record="mechanics: record_bodies", events="mechanics: body_events",
    ),
    "basins": Room(
        observe="plane.observe: observe_basins", power="plane.energy: add_power", stored="plane.energy: add_stored",
    ),
    "patches": Room(
        before="plane.patches: patch_pressures", after="plane.patches: patch_flows",
        record="plane.patches: record_patches",
    ),
    "inflows": Room(brake="plane.patches: quickest_inflow"),
    "patches, barotropic": Room(observe="plane.observe: observe_dense_flows"),
    "patches, table": Room(
        before="plane.table_rooms: table_pressures", observe="plane.table_rooms: observe_pressures"
    ),
    "values": Room(after="plane.carried: patch_values", observe="plane.carried: observe_values"),
    "scalars": Room(after="scalars: clear_losses", observe="scalars: observe_scalars"),
    "leaving": Room(after="scalars: leave_pipes"),
    "mixed": Room(after="scalars: mix_scalars"),
    "carried": Room(after="scalars: carry_in_pipes"),
    "memory": Room(after="unsteady.memory: remember_linear", **MEMORY),
    "memory, barotropic": Room(after="unsteady.barotropic: remember_barotropic", **MEMORY),
}  # fmt: skip
GRIDS, MESHES = (SHALLOW_GRID, CARRIED_GRID), (SHALLOW_FACES, CARRIED_FACES)
CARRIED = {  # scalars in basins: on grids, what fifth order adds there, and what spreads; on other meshes
    "grids": Room(after="plane.carried_grids: carry_on_grids"),
    "fifth": Room(after="plane.carried_grids: add_on_grids"),
    "spread": Room(after="plane.carried_grids: spread_on_grids"),
    "meshes": Room(after="plane.carried_faces: carry_on_meshes"), "all": Room(after="plane.carried: settle_amounts"),
}  # fmt: skip
BASINS = {  # kind of basin
    SHALLOW_GRID: Room(after="plane.rooms: shallow_grids"),
    SHALLOW_FACES: Room(after="plane.rooms: shallow_meshes"),
    ACOUSTIC_GRID: Room(after="plane.rooms: acoustic_grids"),
    LIQUID_GRID: Room(after="plane.rooms: liquid_grids"),
    LIQUID_FACES: Room(after="plane.rooms: liquid_meshes"),
    TABLE_GRID: Room(after="plane.table_rooms: table_grids"),
    TABLE_FACES: Room(after="plane.table_rooms: table_meshes"),
    CARRIED_GRID: Room(observe="plane.carried: observe_given_flows"),
    CARRIED_FACES: Room(observe="plane.carried: observe_given_flows"),
}
ALWAYS = Room(record="observer: record_nodes", events="observer: tank_events")


@dataclass(frozen=True)
class Cast:
    """What decides which functions a scene is made of.

    law : of the fluid; cavities : whether it knows them; kinds, basins : codes of the kinds that there are
    fifth : order of what carries scalars on grids; spread : whether any scalar does
    alone : whether there is nothing but basins, and no link; outlets : whether leaks, or demands that follow pressure
    """

    law: str
    pipes: bool
    cavities: bool = False
    clusters: bool = False
    columns: bool = False
    bodies: bool = False
    memory: bool = False
    kinds: tuple[int, ...] = ()
    basins: tuple[int, ...] = ()
    scalars: bool = False
    fifth: bool = False
    spread: bool = False
    valves: bool = False
    alone: bool = False
    outlets: bool = False

    def rooms(self) -> Iterator[Room]:
        """Its rooms, in order."""
        linear = self.law == "linear"
        family = "linear" if linear else "cavitating" if self.cavities and self.pipes else "barotropic"
        yield ALONE[family] if self.alone else FLUIDS[family, self.pipes]
        if self.valves:
            yield ROOMS["valves"]
        if self.kinds or self.outlets:  # whose events are read off closed nodes
            yield ROOMS["closed"]
        yield ROOMS["outlets"] if self.outlets else Room()
        if self.clusters and linear:
            yield ROOMS["clusters"]
        if self.columns:
            yield ROOMS["columns" if linear else "columns, barotropic"]
        if self.bodies:
            yield ROOMS["bodies"]
        for kind in self.kinds:
            loops = loops_of(kind)
            yield Room(**{job: f"{loops.__name__}: {job}" for job in vars(Room()) if hasattr(loops, job)})
        if self.memory:
            yield ROOMS["memory" if linear else "memory, barotropic"]
        for kind in self.basins:
            yield BASINS[kind]
        flowing = any(kind not in (CARRIED_GRID, CARRIED_FACES) for kind in self.basins)
        if self.basins:
            yield ROOMS["basins"]
            yield Room() if linear else ROOMS["patches, barotropic"]
        if flowing:
            yield ROOMS["patches"]
            yield ROOMS["inflows"] if self.valves else Room()
            yield ROOMS["patches, table"] if self.law == "table" else Room()
        if self.scalars:  # carried by the flow that rates of waves now have
            yield ROOMS["values"] if self.basins else Room()
            yield ROOMS["scalars"]
            yield ROOMS["leaving"] if self.pipes else Room()
            yield ROOMS["mixed"] if flowing or not self.alone else Room()
            yield ROOMS["carried"] if self.pipes else Room()
            yield from self.carried()
        if self.pipes:
            yield ROOMS["pipes"]
        yield ALWAYS

    def carried(self) -> Iterator[Room]:
        """Rooms of scalars in basins."""
        if any(kind in GRIDS for kind in self.basins):
            yield CARRIED["grids"]
            yield CARRIED["fifth"] if self.fifth else Room()
            yield CARRIED["spread"] if self.spread else Room()
        if any(kind in MESHES for kind in self.basins):
            yield CARRIED["meshes"]
        if self.basins:
            yield CARRIED["all"]

    def functions(self, *jobs: str) -> list:
        """The functions of jobs, one job after the other; modules that a scene does not need are not even loaded."""
        return [found(name) for job in jobs for room in self.rooms() if (name := getattr(room, job))]


def found(name: str):
    """The function of a name."""
    module, function = name.split(": ")
    return getattr(import_module(module if module.startswith(HOME) else f"{HOME}.{module}"), function)
