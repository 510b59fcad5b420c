"""Masses on an axis, bodies in space, and the force elements and joints between them."""

from __future__ import annotations

import numpy as np

from fvsolve.core.assembly.features import Feature, Squares
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.features.motion import lower

PACKAGE = "fvsolve.features.motion.kernels"
MASSES = RhsTerms(
    prepare="mass_dynamics: piston_chambers",
    move="mass_dynamics: mass_rates",
    observe="mass_dynamics: observe_masses",
    record="mass_dynamics: record_masses",
    events="mass_dynamics: mass_events",
    package=PACKAGE,
)
FORCES_FOR_EVENTS = RhsTerms(events="mass_dynamics: forces_for_events", package=PACKAGE)
ENERGY = {  # of masses, by True for the density law `linear`
    True: RhsTerms(power="mass_energy: add_power_linear", stored="mass_energy: add_stored_linear", package=PACKAGE),
    False: RhsTerms(
        power="mass_energy: add_power_barotropic", stored="mass_energy: add_stored_barotropic", package=PACKAGE
    ),
}
BODIES = RhsTerms(
    prepare="body_kinematics: kinematics",
    observe="body_values: observe_bodies",
    power="body_values: power_bodies",
    stored="body_values: stored_bodies",
    package=PACKAGE,
)
ACCELERATIONS = {  # by True for bodies with pins
    False: RhsTerms(accelerate="mass_matrix: solve_accelerations", package=PACKAGE),
    True: RhsTerms(
        accelerate="bushings_and_pins: solve_pinned_accelerations",
        observe="bushings_and_pins: observe_pins",
        package=PACKAGE,
    ),
}
BUSHINGS = RhsTerms(
    move="bushings_and_pins: add_bushing_loads",
    accelerate="bushings_and_pins: bushing_rate_limit",
    observe="bushings_and_pins: observe_bushings",
    power="bushings_and_pins: power_bushings",
    stored="bushings_and_pins: stored_bushings",
    package=PACKAGE,
)
STRETCHES = RhsTerms(events="body_kinematics: kinematics_for_events", package=PACKAGE)
LINES = RhsTerms(move="bushings_and_pins: add_element_forces", package=PACKAGE)
FLUID = RhsTerms(
    prepare="inertial_forces: set_segment_drives",
    boundary_inflow="fluid_loads: add_fluid_loads",
    accelerate="inertial_forces: pipe_rate_limit",
    fluid_response="inertial_forces: accelerate_network_flow",
    power="fluid_energy: add_power",
    stored="fluid_energy: add_stored",
    package=PACKAGE,
)
MOVING_FLUID = {  # by True for the density law `linear`
    True: FLUID._replace(
        known_pressures="inertial_forces: moving_tank_pressures", rates="inertial_forces: add_cell_drives"
    ),
    False: FLUID._replace(
        known_pressures="inertial_forces: moving_tank_pressures_barotropic",
        rates="inertial_forces: add_cell_drives_barotropic",
    ),
}


class Motion(Feature, slot=5, wakes="kind mass, kind frame, kind body"):
    """Masses, bodies, and what acts between them, of a case."""

    reads_nodes = True

    # build ----------

    def lower_behind_links(self, draft) -> None:
        lower.lower_bodies(draft)
        lower.lower_moving_segments(draft)
        lower.lower_masses(draft)
        lower.lower_lines(draft)

    def probe(self, draft, probe, row) -> bool:
        case = draft.case
        if probe.part != "nodes":
            return False
        if probe.point is not None and probe.name in case.lumped:
            lower.lower_surface(draft, row, probe)
            return True
        if probe.point is None and probe.name in case.poses:
            lower.lower_body_probe(draft, row, probe)
            return True
        elsewhere = probe.name in (case.nodes.keys() | case.places.keys() | case.network_places)
        if probe.point is not None or elsewhere:
            return False
        lower.lower_body_point(draft, row, probe)
        return True

    def reserve(self, draft) -> None:
        lower.reserve_mechanics(draft)

    def rest(self, case, draft):
        from fvsolve.features.motion.equilibrium_search import with_equilibrium

        return with_equilibrium(case, draft)

    def supported(self, draft, start) -> dict[int, float]:
        if not len(draft.piston_table):
            return {}
        lower.find_closed_chambers(draft, start)
        return lower.supporting_pressures(draft, start)

    def moving(self, draft, start) -> list[str]:
        from fvsolve.features.motion.static_forces import start_bodies

        return lower.start_masses(draft, start) + start_bodies(draft, start) + lower.driven_at_start(draft, start)

    # model ----------

    def terms(self, model, cast) -> list[tuple[str, RhsTerms]]:
        tables, linear, found = model.tables, cast.family == "linear", []
        if len(tables.masses):
            found.append(ENERGY[linear])
        if len(tables.bodies):
            found += [BODIES, ACCELERATIONS[len(tables.pins) > 0]]
        if len(tables.bushings):
            found.append(BUSHINGS)
        if len(tables.moving_segments):
            found.append(MOVING_FLUID[linear])
        found += [STRETCHES] if len(tables.lines) else []
        found += [MASSES] if len(tables.masses) else []
        found += [LINES] if len(tables.lines) else []
        events = [FORCES_FOR_EVENTS] if len(tables.masses) and model.network is not None else []
        return [("links", terms) for terms in found] + [("closed", terms) for terms in events]

    def pattern(self, couplings):
        from fvsolve.features.motion.pattern import MotionPattern

        return MotionPattern(self, couplings)

    def squares(self, model, y: np.ndarray) -> Squares:
        from fvsolve.features.motion.energy_norm import squares_of_motion

        return squares_of_motion(model, y)

    def weigh(self, model, weights: np.ndarray) -> None:
        for row in model.tables.masses:
            if row["y"] >= 0:
                weights[int(row["y"]) + 1] = 0.5 / row["lightness"]

    def stored_states(self, model) -> np.ndarray:
        places = model.tables.masses["y"]
        return places[places >= 0]
