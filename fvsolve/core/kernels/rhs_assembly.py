"""Assembly of the right-hand side of a model: a list of its functions, phase by phase.

Each function has the arguments (t, y, dydt, out, handle) and may read what earlier phases have written. With an empty
dydt it computes `out` alone. Bands of a state (`band_exchange`) use the same functions, each with a handle to its own
parts of the tables.
"""

from collections.abc import Iterator
from importlib import import_module
from typing import NamedTuple

from fvsolve.core.kernels.calls import hook_of

KERNELS = "fvsolve.core.kernels"


class RhsTerms(NamedTuple):
    """Names of the functions that a component adds to a model: one for each phase of the right-hand side, and each job.

    A name is "module: function", or "" for none. The fields of phases come first, in the order in which they run.
    package : package of the modules
    """

    exchange: str = ""  # exchange of states between bands
    prepare: str = ""  # from (t, y) alone: conductances, speeds, pressures of vessels
    outgoing_waves: str = ""  # outgoing waves at pipe ends
    # pressures of nodes with storage or given pressure, flows from outside
    known_pressures: str = ""
    # outputs of blocks that drive restrictions, devices and nodes, from states alone
    decide: str = ""
    inflow: str = ""  # flows of rigid columns into nodes
    solve_nodes: str = ""  # pressures of other nodes, flows of restrictions
    column_nodes: str = ""  # pressures of nodes that only columns determine
    incoming_waves: str = ""  # incoming waves from nodes into pipes
    balance: str = ""  # net flows into nodes, rates of storage in nodes
    rate_limits: str = ""  # rates that limit the step; event functions need the phases up to here
    move: str = ""  # rates of columns, devices, and what moves
    rates: str = ""  # rates of cells
    boundary_exchange: str = ""  # exchange between bands of flows through boundaries
    boundary_inflow: str = ""  # flows into cells through the boundary
    accelerate: str = ""  # accelerations of frames that move, from all forces
    fluid_response: str = ""  # terms that depend on the accelerations of frames
    outlet_values: str = ""  # values of scalars in the water that leaves pipes and cells
    mix: str = ""  # values of scalars at nodes
    scalar_rates: str = ""  # rates of scalars in cells
    control_rates: str = ""  # rates of states of blocks, from all values of the state
    # conversion of rates of scalars in stretching cells to rates of their content
    stretching: str = ""
    reduce_rate: str = ""  # greatest rate of all bands
    # jobs other than the right-hand side
    observe: str = ""  # probe values
    record: str = ""  # records of an accepted state
    events: str = ""  # event functions
    network_power: str = ""  # powers of pipes, restrictions and columns
    power: str = ""  # all other powers
    stored: str = ""
    derive_state: str = ""  # values that these jobs read instead of the state, written to dydt
    # divides rates dydt of a stage by 1 + h r; step h passed as t, h r written to out
    damp: str = ""
    package: str = KERNELS


JOBS = tuple(name for name in RhsTerms._fields if name != "package")
PHASES = JOBS[: JOBS.index("reduce_rate") + 1]
CLOSING = PHASES[: PHASES.index("rate_limits") + 1]

BAROTROPIC = {
    "known_pressures": "barotropic_nodes: known_pressures_barotropic",
    "solve_nodes": "barotropic_nodes: solve_nodes_barotropic",
}
NODES = {  # nodes, by the family of the density law
    "linear": RhsTerms(
        known_pressures="linear_nodes: known_pressures_linear",
        solve_nodes="linear_nodes: solve_nodes_linear",
    ),
    "barotropic": RhsTerms(**BAROTROPIC),
    "cavitating": RhsTerms(
        **BAROTROPIC | {"solve_nodes": "cavitating_nodes: solve_nodes_cavitating"}
    ),
}
NETWORK = RhsTerms(
    prepare="network_balance: begin_network", balance="network_balance: balance_network"
)
LUMPED = RhsTerms(
    prepare="linear_nodes: begin_lumped",
    solve_nodes="linear_nodes: solve_nodes_linear",
    balance="network_balance: balance_network",
)
ALONE = RhsTerms(prepare="network_balance: begin_basins")
PIPES = {
    "linear": RhsTerms(
        outgoing_waves="pipes: outgoing_waves_linear",
        incoming_waves="pipes: incoming_waves_linear",
        rates="pipes: wave_rates",
    ),
    "barotropic": RhsTerms(
        outgoing_waves="barotropic_nodes: outgoing_waves_barotropic",
        rates="barotropic_pipes: rates_barotropic",
    ),
    "cavitating": RhsTerms(
        outgoing_waves="cavitating_pipes: outgoing_states_cavitating",
        balance="cavitating_nodes: balance_junctions",
        rates="cavitating_pipes: rates_cavitating",
        record="cavitating_pipes: record_cavities",
    ),
}
READ = {
    "linear": RhsTerms(
        observe="observation: observe_linear",
        network_power="network_energy: power_linear",
        stored="network_energy: stored_linear",
    ),
    "barotropic": RhsTerms(
        observe="barotropic_pipes: observe_barotropic",
        network_power="network_energy: power_barotropic",
        stored="network_energy: stored_barotropic",
    ),
}
UNSTEADY_FRICTION = {
    "power": "relaxation: add_friction_power",
    "stored": "relaxation: add_friction_stored",
}
COLUMNS = {
    "inflow": "rigid_columns: column_inflows",
    "rate_limits": "rigid_columns: column_rate_limit",
}
COMPONENTS = {
    "formulas": RhsTerms(events="schedule_pieces: formula_events"),
    "pipes": RhsTerms(record="observation: record_pipes"),
    "valves": RhsTerms(rate_limits="network_balance: valve_rate_limit"),
    "bends": RhsTerms(events="restrictions: restriction_events"),
    "closed": RhsTerms(events="calls: solve_nodes_in_turn"),
    "clusters": RhsTerms(
        solve_nodes="node_clusters: solve_clusters", record="node_clusters: record_clusters"
    ),
    "columns": RhsTerms(
        column_nodes="rigid_columns: column_pressures",
        move="rigid_columns: column_rates",
        **COLUMNS,
    ),
    "columns, barotropic": RhsTerms(
        column_nodes="rigid_columns: column_pressures_barotropic",
        move="rigid_columns: column_rates_barotropic",
        **COLUMNS,
    ),
    "devices": RhsTerms(
        prepare="devices: set_devices",
        move="devices: device_rates",
        observe="devices: observe_devices",
        record="devices: record_devices",
        events="devices: device_events",
        power="devices: power_devices",
        stored="devices: stored_devices",
    ),
    "forces, linear": RhsTerms(observe="pipe_forces: observe_forces_linear"),
    "forces, barotropic": RhsTerms(observe="pipe_forces: observe_forces_barotropic"),
    "forces, cavitating": RhsTerms(observe="pipe_forces: observe_forces_cavitating"),
    "memory": RhsTerms(rates="relaxation: add_unsteady_friction", **UNSTEADY_FRICTION),
    "memory, barotropic": RhsTerms(
        rates="relaxation: add_unsteady_friction_barotropic", **UNSTEADY_FRICTION
    ),
    "creep, barotropic": RhsTerms(
        rates="relaxation: add_wall_creep_barotropic",
        power="relaxation: add_creep_power_barotropic",
        stored="relaxation: add_creep_stored_barotropic",
    ),
    "creep": RhsTerms(
        rates="relaxation: add_wall_creep",
        power="relaxation: add_creep_power",
        stored="relaxation: add_creep_stored",
    ),
}
COUPLED = RhsTerms(solve_nodes="node_clusters: solve_coupled_clusters")
BANDS = RhsTerms(
    exchange="band_exchange: exchange_states", reduce_rate="band_exchange: reduce_rate"
)
ALWAYS = RhsTerms(record="observation: record_nodes", events="observation: tank_events")


class ModelFeatures(NamedTuple):
    """Features of a model, which decide on the functions of its right-hand side.

    family : kernels of the density law, "linear", "barotropic" or "cavitating"
    laws : names of the modules of parts' laws, in the order of the rows of `hooks`
    features, further_packages : place and terms of features, and their further modules, see `assembly.features`
    alone : True if there are only meshes, and no link
    bands : True if threads or processes step bands of the state
    boundary_exchange : True if several bands have an open boundary
    forces : True if forces on pipes are probed
    device_hooks : names of further functions of laws that functions of features call, keys of `calls.HOOKS`
    other fields : True if the model has such parts or properties
    """

    family: str
    pipes: bool
    clusters: bool = False
    columns: bool = False
    unsteady_friction: bool = False
    viscoelastic_walls: bool = False
    devices: bool = False
    laws: tuple[str, ...] = ()
    valves: bool = False
    features: tuple[tuple[str, RhsTerms], ...] = ()
    further_packages: tuple[str, ...] = ()
    couplings: bool = False
    alone: bool = False
    bands: bool = False
    boundary_exchange: bool = False
    forces: bool = False
    formulas: bool = False
    device_hooks: tuple[str, ...] = ()

    def components(self) -> Iterator[RhsTerms]:
        """Yield the terms (`RhsTerms`) of all components of the model, in the order in which the functions run."""
        if self.bands:
            yield BANDS
        linear = self.family == "linear"
        # Only pipes have cavities: without pipes the barotropic functions serve a cavitating law too.
        family = self.family if linear or self.pipes else "barotropic"
        yield from self.terms_at("first")
        # Without pipes, and waves of features, no waves reach the nodes, which then have simpler functions.
        lumped = (
            linear
            and not self.pipes
            and not any(terms.outgoing_waves for terms in self.terms_at("pipes"))
        )
        yield from (ALONE,) if self.alone else (LUMPED,) if lumped else (NETWORK, NODES[family])
        yield READ["linear" if linear else "barotropic"]
        if self.pipes:
            yield PIPES[family]
        yield from self.terms_at("pipes")
        if self.valves:
            yield COMPONENTS["valves"]
        bends = any(hook_of(law, "bends") is not None for law in self.modules())
        if (
            self.devices
            or bends
            or any(terms.events for place, terms in self.features if place != "links")
        ):
            yield COMPONENTS["closed"]  # their event functions need solved nodes
        yield from self.terms_at("closed")
        yield from self.terms_at("given")
        if setting := list(self.terms_at("sources")):
            yield from setting
            yield from self.terms_at("followed")
        yield from self.terms_at("solved")
        if bends:
            yield COMPONENTS["bends"]
        yield from self.terms_at("events")
        if self.formulas:
            yield COMPONENTS["formulas"]
        if self.clusters and linear:
            yield COMPONENTS["clusters"]
            if self.couplings:
                yield COUPLED
        if self.columns:
            yield COMPONENTS["columns" if linear else "columns, barotropic"]
        yield from self.terms_at("links")
        if self.devices:
            yield COMPONENTS["devices"]
        yield from self.terms_at("devices")
        yield from self.last_components(family)

    def last_components(self, family: str) -> Iterator[RhsTerms]:
        """Yield the last terms: memory of pipes, flows, what they carry; family : kernels of the density law."""
        linear = self.family == "linear"
        # After the pipes: these functions subtract from the rates of waves.
        if self.unsteady_friction:
            yield COMPONENTS["memory" if linear else "memory, barotropic"]
        if self.viscoelastic_walls:
            yield COMPONENTS["creep" if linear else "creep, barotropic"]
        # what is carried needs the rates of the flow
        for place in ("flow", "carried", "cells", "last"):
            yield from self.terms_at(place)
        if self.forces:
            yield COMPONENTS[f"forces, {family}"]
        if self.pipes:
            yield COMPONENTS["pipes"]
        yield ALWAYS

    def terms_at(self, *places: str) -> Iterator[RhsTerms]:
        """Yield the terms of features at these places in the order of functions."""
        yield from (terms for where, terms in self.features if where in places)

    def modules(self) -> list:
        """Loaded modules of the laws of parts, in the order of `laws`."""
        return [import_module(name) for name in self.laws]

    def packages(self) -> list[str]:
        """Names of the modules of laws, and of the packages with functions of features, that the model needs."""
        return [
            *self.laws,
            *self.further_packages,
            *(member.package for _, member in self.features),
        ]

    def count(self, job: str) -> int:
        """Number of the functions of a job, which are not loaded."""
        return sum(bool(getattr(member, job)) for member in dict.fromkeys(self.components()))

    def functions(self, *jobs: str) -> list:
        """Functions of the model for these jobs, job by job; modules that the model does not need are not loaded.

        jobs : names of fields of `RhsTerms`
        """
        members = dict.fromkeys(self.components())  # components that several members need, once
        jobs = [job for job in jobs if job != "boundary_exchange" or self.boundary_exchange]
        return [
            load_function(member.package, name)
            for job in jobs
            for member in members
            if (name := getattr(member, job))
        ]


def load_function(home: str, name: str):
    """Load the function `name`, written "module: function", from the package `home`."""
    module, function = name.split(": ")
    return getattr(import_module(f"{home}.{module}"), function)
