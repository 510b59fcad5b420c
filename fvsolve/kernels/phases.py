"""Assembly of the right-hand side of a model: a list of its functions, phase by phase.

Each function has the arguments (t, y, dydt, out, handle) and may read what earlier phases have written. With an empty
dydt it computes `out` alone. A band of rows is a handle whose tables are parts of these: no function depends on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from importlib import import_module

from fvsolve.kernels.calls import hook_of

HOME = "fvsolve.kernels"


@dataclass(frozen=True)
class Pieces:
    """Functions that a component adds to a model, as `module: function`, "" for none; the phases first, in order.

    home : package of the modules
    """

    meet: str = ""  # exchange of states between bands
    prepare: str = ""  # from (t, y) alone: conductances, speeds, pressures of vessels
    offer: str = ""  # outgoing waves at pipe ends
    store: str = ""  # pressures of nodes with storage or given pressure, flows from outside
    inflow: str = ""  # flows of rigid columns into nodes
    close: str = ""  # pressures of other nodes, flows of restrictions
    hold: str = ""  # pressures of nodes that only columns determine
    answer: str = ""  # incoming waves from nodes into pipes
    balance: str = ""  # net flows into nodes, rates of storage in nodes
    brake: str = ""  # rates that limit the step; event functions need the phases up to here
    move: str = ""  # rates of columns, bodies, devices
    rates: str = ""  # rates of cells, in pipes and basins
    together: str = ""  # exchange between bands of flows through boundaries
    enter: str = ""  # flows into cells through patches
    accelerate: str = ""  # accelerations of bodies, from all forces
    follow: str = ""  # terms that depend on the accelerations of bodies
    leave: str = ""  # values of scalars in the water that leaves pipes and cells
    mix: str = ""  # values of scalars at nodes
    carry: str = ""  # rates of scalars in cells
    swell: str = ""  # conversion of rates of scalars in stretching cells to rates of their content
    agree: str = ""  # greatest rate of all bands
    # jobs other than the right-hand side
    observe: str = ""  # probe values
    record: str = ""  # records of an accepted state
    events: str = ""  # event functions
    power: str = ""
    stored: str = ""
    see: str = ""  # values that these jobs read instead of the state, written to dydt
    damp: str = ""  # divides rates dydt of a stage by 1 + h r; step h passed as t, h r written to out
    home: str = HOME


JOBS = tuple(field.name for field in fields(Pieces) if field.name != "home")
PHASES = JOBS[: JOBS.index("agree") + 1]
CLOSING = PHASES[: PHASES.index("brake") + 1]

BAROTROPIC = {"store": "barotropic_nodes: store_barotropic", "close": "barotropic_nodes: close_barotropic"}
NODES = {  # nodes, by the family of the density law
    "linear": Pieces(store="nodes: store_linear", close="nodes: close_linear"),
    "barotropic": Pieces(**BAROTROPIC),
    "cavitating": Pieces(**BAROTROPIC | {"close": "cavitating_nodes: close_cavitating"}),
}
NETWORK = Pieces(prepare="network: open_network", balance="network: balance_network")
LUMPED = Pieces(prepare="lumped: open_lumped", close="nodes: close_linear", balance="network: balance_network")
ALONE = Pieces(prepare="network: open_alone")
PIPES = {
    "linear": Pieces(offer="linear: offer_waves", answer="linear: answer_waves", rates="linear: wave_rates"),
    "barotropic": Pieces(offer="barotropic_nodes: offer_barotropic", rates="barotropic: rates_barotropic"),
    "cavitating": Pieces(
        offer="cavitating: offer_cavitating", balance="cavitating_nodes: balance_junctions",
        rates="cavitating: rates_cavitating", record="cavitating: record_cavities",
    ),
}  # fmt: skip
READ = {
    "linear": Pieces(observe="observer: observe_linear", power="energy: power_linear", stored="energy: stored_linear"),
    "barotropic": Pieces(
        observe="barotropic: observe_barotropic",
        power="energy_barotropic: power_barotropic", stored="energy_barotropic: stored_barotropic",
    ),
}  # fmt: skip
MEMORY = {"power": "unsteady.energy: add_power", "stored": "unsteady.energy: add_stored"}
FREIGHT = {
    "enter": "mechanism.freight: load_networks", "accelerate": "mechanism.recoil: quicken_by_pipes",
    "follow": "mechanism.recoil: follow_networks",
    "power": "mechanism.freight_energy: add_power", "stored": "mechanism.freight_energy: add_stored",
}  # fmt: skip
COLUMNS = {"inflow": "columns: column_inflows", "brake": "columns: quickest_column"}
MEMBERS = {
    "pipes": Pieces(record="observer: record_pipes"),
    "valves": Pieces(brake="network: quickest_valve"),
    "bends": Pieces(events="restrictions: restriction_events"),
    "closed": Pieces(events="calls: close_in_turn"),
    "clusters": Pieces(close="clusters: close_clusters"),
    "columns": Pieces(hold="columns: hold_columns", move="columns: column_rates", **COLUMNS),
    "columns, barotropic": Pieces(
        hold="barotropic_columns: hold_columns_barotropic", move="barotropic_columns: column_rates_barotropic",
        **COLUMNS,
    ),
    "bodies": Pieces(
        prepare="mechanism.joints: kinematics",
        observe="mechanism.observe: observe_bodies", power="mechanism.energy: power_bodies",
        stored="mechanism.energy: stored_bodies",
    ),
    "no pins": Pieces(accelerate="mechanism.matrix: accelerate"),
    "pins": Pieces(accelerate="mechanism.pins: accelerate_pinned", observe="mechanism.pins: observe_pins"),
    "bushings": Pieces(
        move="mechanism.bushings: push_bushings", accelerate="mechanism.bushings: quicken_by_bushings",
        observe="mechanism.bushings: observe_bushings", power="mechanism.bushings: power_bushings",
        stored="mechanism.bushings: stored_bushings",
    ),
    "stretches": Pieces(events="mechanism.joints: stretch_again"),
    "lines": Pieces(move="mechanism.lines: push_bodies"),
    "rides": Pieces(
        prepare="mechanism.rides: set_rides", store="mechanism.rides: press_tanks",
        rates="mechanism.rides: push_cells", **FREIGHT,
    ),
    "rides, barotropic": Pieces(
        prepare="mechanism.rides: set_rides", store="mechanism.rides_barotropic: press_tanks_barotropic",
        rates="mechanism.rides_barotropic: push_cells_barotropic", **FREIGHT,
    ),
    "masses": Pieces(
        prepare="masses: chambers", move="masses: finish_masses", observe="masses: observe_masses",
        record="masses: record_masses", events="masses: mass_events",
    ),
    "devices": Pieces(
        prepare="devices: set_devices", move="devices: move_devices",
        observe="devices: observe_devices", record="devices: record_devices",
        events="devices: device_events",
        power="devices: power_devices", stored="devices: stored_devices",
    ),
    "scalars": Pieces(leave="scalars: clear_losses", observe="scalars: observe_scalars"),
    "carried": Pieces(leave="scalars: leave_pipes", carry="scalars: carry_in_pipes"),
    "forces, linear": Pieces(observe="forces: observe_forces_linear"),
    "forces, barotropic": Pieces(observe="forces: observe_forces_barotropic"),
    "forces, cavitating": Pieces(observe="forces: observe_forces_cavitating"),
    "memory": Pieces(rates="unsteady.memory: remember_linear", **MEMORY),
    "memory, barotropic": Pieces(rates="unsteady.barotropic: remember_barotropic", **MEMORY),
    "creep, barotropic": Pieces(
        rates="creep.barotropic: creep_walls_barotropic",
        power="creep.energy_barotropic: add_power_barotropic",
        stored="creep.energy_barotropic: add_stored_barotropic",
    ),
    "creep": Pieces(
        rates="creep.wall: creep_walls", power="creep.energy: add_power", stored="creep.energy: add_stored",
    ),
}  # fmt: skip
DELAYS = Pieces(
    offer="delay.lines: offer_lines", answer="delay.lines: answer_lines",
    observe="delay.along: observe_lines", record="delay.record: record_lines",
)  # fmt: skip
COUPLED = Pieces(close="delay.lines: couple_clusters")
BANDS = Pieces(meet="joint: meet", agree="joint: agree")
TOGETHER = Pieces(home="fvsolve.basins", together="bands: book_together")
MIXED = Pieces(mix="scalars: mix_scalars")
ALWAYS = Pieces(record="observer: record_nodes", events="observer: tank_events")


@dataclass(frozen=True)
class Cast:
    """Features of a model, which decide on the functions of its right-hand side.

    family : kernels of the density law, "linear", "barotropic" or "cavitating"
    laws : modules of the laws of parts, in the order of the rows of `hooks`
    basins, carried : components of basins, and of the scalars in them; see `basins.lower_pieces`
    alone : True if there are only basins, and no link
    bands, together : True if threads step bands of the state, and if several bands have an open boundary
    """

    family: str
    pipes: bool
    clusters: bool = False
    columns: bool = False
    masses: bool = False
    bodies: bool = False
    lines: bool = False
    pins: bool = False
    bushings: bool = False
    rides: bool = False
    memory: bool = False
    creep: bool = False
    devices: bool = False
    laws: tuple[str, ...] = ()
    basins: tuple[Pieces, ...] = ()
    carried: tuple[Pieces, ...] = ()
    scalars: bool = False
    valves: bool = False
    delays: bool = False
    alone: bool = False
    bands: bool = False
    together: bool = False
    forces: bool = False

    def members(self) -> Iterator[Pieces]:
        """Components of the model, in the order in which functions of a phase run."""
        if self.bands:
            yield BANDS
        if self.together:
            yield TOGETHER
        linear = self.family == "linear"
        family = self.family if linear or self.pipes else "barotropic"
        lumped = linear and not self.pipes and not self.delays
        yield from (ALONE,) if self.alone else (LUMPED,) if lumped else (NETWORK, NODES[family])
        yield READ["linear" if linear else "barotropic"]
        if self.pipes:
            yield PIPES[family]
        if self.delays:
            yield DELAYS
        if self.valves:
            yield MEMBERS["valves"]
        bends = any(hook_of(law, "bends") is not None for law in self.modules())
        if self.devices or bends:  # their event functions need solved nodes
            yield MEMBERS["closed"]
        if bends:
            yield MEMBERS["bends"]
        if self.clusters and linear:
            yield MEMBERS["clusters"]
            if self.delays:
                yield COUPLED
        if self.columns:
            yield MEMBERS["columns" if linear else "columns, barotropic"]
        if self.bodies:
            yield MEMBERS["bodies"]
            yield MEMBERS["pins" if self.pins else "no pins"]
        if self.bushings:
            yield MEMBERS["bushings"]
        if self.rides:
            yield MEMBERS["rides" if linear else "rides, barotropic"]
        if self.lines:
            yield MEMBERS["stretches"]
        if self.masses:
            yield MEMBERS["masses"]
        if self.lines:
            yield MEMBERS["lines"]
        if self.devices:
            yield MEMBERS["devices"]
        if self.memory:
            yield MEMBERS["memory" if linear else "memory, barotropic"]
        if self.creep:
            yield MEMBERS["creep" if linear else "creep, barotropic"]
        yield from self.basins
        if self.scalars:  # carried by the flow from the rates of waves, which come before
            yield MEMBERS["scalars"]
            if not self.alone:
                yield MIXED
            if self.pipes:
                yield MEMBERS["carried"]
        yield from self.carried
        if self.forces:
            yield MEMBERS[f"forces, {family}"]
        if self.pipes:
            yield MEMBERS["pipes"]
        yield ALWAYS

    def modules(self) -> list:
        """Modules of the laws of parts."""
        return [import_module(name) for name in self.laws]

    def homes(self) -> list[str]:
        """Modules and packages that the model needs."""
        return [*self.laws, *(member.home for member in self.basins)]

    def functions(self, *jobs: str) -> list:
        """Functions of jobs, job by job; modules that a model does not need are not loaded."""
        members = dict.fromkeys(self.members())  # components that several basins need, once
        return [found(member.home, name) for job in jobs for member in members if (name := getattr(member, job))]


def found(home: str, name: str):
    """Load a function by package and `module: function`."""
    module, function = name.split(": ")
    return getattr(import_module(f"{home}.{module}"), function)
