"""Masses on an axis, bodies in space, and the force elements and joints between them."""

from __future__ import annotations

import copy
from collections.abc import Iterator

import numpy as np

from fvsolve.case import bodies
from fvsolve.core.assembly.features import Coordinate, Feature, FeatureRun, Squares
from fvsolve.core.assembly.lowering import rows_in
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.errors import FvsolveError, Notice
from fvsolve.features.motion import lower, ports
from fvsolve.features.motion.kernels import tables as records
from fvsolve.features.motion.kernels.tables import MotionTables
from fvsolve.parts.network_elements import network_of

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
    True: RhsTerms(
        power="mass_energy: add_power_linear",
        stored="mass_energy: add_stored_linear",
        package=PACKAGE,
    ),
    False: RhsTerms(
        power="mass_energy: add_power_barotropic",
        stored="mass_energy: add_stored_barotropic",
        package=PACKAGE,
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
        known_pressures="inertial_forces: moving_tank_pressures",
        rates="inertial_forces: add_cell_drives",
    ),
    False: FLUID._replace(
        known_pressures="inertial_forces: moving_tank_pressures_barotropic",
        rates="inertial_forces: add_cell_drives_barotropic",
    ),
}


TABLES = {  # name of a table of a case -> its record
    "body_table": records.BODY,
    "freedom_table": records.FREEDOM,
    "point_table": records.POINT,
    "line_table": records.LINE,
    "pin_table": records.PIN,
    "bushing_table": records.BUSHING,
    "moving_segment_table": records.MOVING_SEGMENT,
    "tank_table": records.TANK,
    "mass_table": records.MASS,
    "brace_table": records.BRACE,
    "stop_table": records.STOP,
    "piston_table": records.PISTON,
    "settings": records.MOTION_SETTINGS,
}

DRIFT = 1e-6  # deviation of the length of Euler parameters from 1 above which a notice is given


class Motion(Feature, slot=5, wakes="kind mass, kind frame, kind body"):
    """Masses, bodies, and what acts between them, of a case.

    TABLES : attributes with the tables; names of their rows are in lists such as `mass_names`
    mass_index : name -> row of `mass_table`; None -> row of the fixed frame of elements between points
    points, lines : rows of their tables while these are filled; point_index : name of a point -> its row
    factor_size : number of entries of the factor of the mass matrix
    still_pushes : rows of `pushes_at_rest` of all features
    locked : piston -> sides whose closed chambers may support a load
    shut : piston -> sides that no open link joins to another node
    """

    reads_nodes = True

    def __init__(self, case, given_up=()) -> None:
        super().__init__(case, given_up)
        for name, record in TABLES.items():
            setattr(self, name, np.zeros(int(name == "settings"), record))
        self.body_names: list[str] = []
        self.mass_names: list[str] = []
        self.piston_names: list[str] = []
        self.push_names: list[str] = []
        self.pin_names: list[str] = []
        self.bushing_names: list[str] = []
        self.mass_index: dict[str | None, int] = {None: 0}
        self.points: list[tuple] = []
        self.point_index: dict[str, int] = {}
        self.lines: list[tuple] = []
        self.factor_size = 0
        self.still_pushes: list = []
        self.locked: dict[int, list[str]] = {}
        self.shut: dict[int, list[str]] = {}

    def tables(self) -> MotionTables:
        """Tables as compiled functions read them."""
        return MotionTables(*(getattr(self, name) for name in TABLES))

    # build ----------

    def join(
        self, draft, row, ports_of_row, places, toward=None, about=None
    ) -> tuple[float, float]:
        return ports.join_ports(draft, row, ports_of_row, places, toward, about)

    def coordinate(self, name: str) -> Coordinate | None:
        if name in self.mass_index:
            i = self.mass_index[name]
            row, at = self.mass_table[i], int(self.mass_table[i]["y"])
            start = (float(row[key]) for key in ("position", "velocity", "force"))
            return Coordinate(
                i, -1, at, at + 1 if at >= 0 else -1, -1, *start, 0.0, float(row["lightness"])
            )
        if name in self.body_names:
            i = self.body_names.index(name)
            row = self.body_table[i]
            places = (int(row[key]) for key in ("y", "rate", "schedule"))
            start = float(row["start"][0]), float(row["speed"][0]), 0.0
            return Coordinate(-1, i, *places, *start, float(row["mass"]), 0.0)
        return None

    def lower_behind_links(self, draft) -> None:
        lower.lower_bodies(draft)
        self.frames = self.body_names
        lower.lower_moving_segments(draft)
        lower.lower_masses(draft)
        lower.lower_lines(draft)
        self.leaks, self.leak_names = self.piston_table, self.piston_names

    def lower_behind_meshes(self, draft) -> None:
        rows = [(part.row["body"], part.row["loads_body"]) for part in draft.meshed]
        self.tank_table = np.array(rows, records.TANK)
        self.still_pushes = [row for own in draft.features for row in own.pushes_at_rest]

    def probe(self, draft, probe, row) -> bool:
        case = draft.case
        if probe.part == "links" and probe.name in case.links:
            return lower.lower_link_probe(draft, row, probe)
        if probe.part != "nodes" or probe.point is not None:
            return False
        if probe.name in self.mass_names:
            row["kind"] = rec.POSITION if probe.quantity == "position" else rec.VELOCITY
            row["index"] = self.mass_index[probe.name]
            return True
        is_body = probe.name in case.poses
        if not is_body and probe.name in (
            case.nodes.keys() | case.places.keys() | case.network_places
        ):
            return False
        from fvsolve.features.motion.kernels.body_values import BODY_QUANTITIES, POINT_QUANTITIES

        if is_body:
            quantity = "angle" if probe.quantity == "travel" else probe.quantity
            row["kind"], row["side"] = rec.BODY_VALUE, BODY_QUANTITIES.index(quantity)
            row["index"] = self.body_names.index(probe.name)
        else:
            row["kind"], row["side"] = rec.POINT_VALUE, POINT_QUANTITIES.index(probe.quantity)
            row["index"] = ports.point_row(draft, probe.name)
        return True

    def reserve(self, draft) -> None:
        pushes = len(self.push_names)
        masses = len(self.mass_table)
        bodies = len(self.body_table)
        for name, size in (
            ("net_force", masses),
            ("push", pushes),
            ("forcing", len(self.moving_segment_table)),
            ("travel", 2 * pushes),
            ("along", 3 * len(self.line_table)),
            ("pin", 3 * len(self.pin_table)),
            ("body", rec.BODY_OUT * bodies),
        ):
            draft.sizes.out(name, size)
        constraints, freedoms = int(sum(self.pin_table["rows"])), len(self.freedom_table)
        spatial = 8 * freedoms + self.factor_size + 16 * bodies
        spatial += constraints * (2 * freedoms + constraints + 1)
        draft.sizes.need_scratch(max(spatial, 18 if bodies else 0))
        draft.sizes.need_scratch(2 * masses)
        self.settings[0]["mark"] = draft.sizes.mark(len(self.piston_table))
        self.settings[0]["flag"] = draft.sizes.flags(2 * len(self.stop_table))
        draft.sizes.feature_power += 2 * len(self.bushing_table) + 3 * bodies
        draft.sizes.feature_stored += len(self.bushing_table) + bodies
        draft.sizes.reads_rates |= bool(self.moving_segment_table["loads_body"].any())
        self.point_table = np.array(self.points, records.POINT)
        self.fast_parts = [*self.mass_names, *self.body_names]
        self.marks = [("beyond its stroke", f"links.{name}") for name in self.piston_names]
        schedules = self.brace_table["schedule"].tolist()
        self.link_schedules = dict(zip(self.push_names, schedules, strict=False))

    def rest(self, case, draft):
        from fvsolve.features.motion.equilibrium_search import with_equilibrium

        return with_equilibrium(case, draft)

    def supported(self, draft, start) -> dict[int, float]:
        if not len(self.piston_table):
            return {}
        lower.find_closed_chambers(draft, start)
        return lower.supporting_pressures(draft, start)

    def begin_forces(self, draft, start) -> list[str]:
        from fvsolve.features.motion.static_forces import start_bodies

        return (
            lower.start_masses(draft, start)
            + start_bodies(draft, start)
            + lower.driven_at_start(draft, start)
        )

    def close(self, draft) -> None:
        for name in TABLES:
            getattr(self, name).flags.writeable = False

    def copy_for(self, case) -> Motion:
        own = copy.copy(self)
        own.case, own.locked, own.shut = case, dict(self.locked), dict(self.shut)
        for name, record in TABLES.items():  # as bytes: numpy would copy records field by field
            table = getattr(self, name)
            setattr(own, name, np.ndarray(table.shape, record, bytearray(table.tobytes())))
        own.leaks = own.piston_table
        return own

    # model ----------

    def terms(self, model, cast) -> list[tuple[str, RhsTerms]]:
        linear, found = cast.family == "linear", []
        if len(self.mass_table):
            found.append(ENERGY[linear])
        if len(self.body_table):
            found += [BODIES, ACCELERATIONS[len(self.pin_table) > 0]]
        # after the accelerations, whose factored mass matrix the rate limits of bushings and pipes use
        if len(self.bushing_table):
            found.append(BUSHINGS)
        if len(self.moving_segment_table):
            found.append(MOVING_FLUID[linear])
        # before the masses: their event functions read the lengths of elements between bodies
        found += [STRETCHES] if len(self.line_table) else []
        found += [MASSES] if len(self.mass_table) else []
        # after the masses, whose functions compute the forces of all elements
        found += [LINES] if len(self.line_table) else []
        events = (
            [FORCES_FOR_EVENTS] if len(self.mass_table) and network_of(model) is not None else []
        )
        return [("links", terms) for terms in found] + [("closed", terms) for terms in events]

    def run(self, run_data) -> MotionRun:
        return MotionRun(self, run_data)

    def pattern(self, couplings):
        from fvsolve.features.motion.pattern import MotionPattern

        return MotionPattern(self, couplings)

    def squares(self, model, y: np.ndarray) -> Squares:
        from fvsolve.features.motion import energy_norm as norm

        elongations = norm.Elongations(model, y)
        last = [*norm.kinetic_rows(model, y), *norm.joint_spring_rows(model)]
        stored = dict(norm.chamber_rows(model, y, elongations))
        return Squares(stored, [*norm.spring_rows(model, y, elongations)], last)

    def weigh(self, model, weights: np.ndarray, y: np.ndarray) -> None:
        for row in self.mass_table:
            if row["y"] >= 0:
                weights[int(row["y"]) + 1] = 0.5 / row["lightness"]

    def begin_accounts(self, accounts) -> None:
        names = [*self.mass_names, *[""] * (len(self.mass_table) - len(self.mass_names))]
        for name, row in zip(names, self.mass_table, strict=True):
            at = accounts.take(1)
            accounts.hold(name, "mass", at if row["y"] >= 0 else None)
        for name, link, lowering in rows_in(self.case, "brace"):
            at, stores = accounts.take(1), lowering.ledger_name == "stored"
            accounts.hold(name, link.kind, at if stores else None)
            if not stores:
                accounts.add(lowering.ledger_name, name, link.kind, at)
        for name, link, _ in rows_in(self.case, "stop"):
            at = accounts.take(2)
            accounts.contacts.append((len(accounts.accounts), len(accounts.accounts) + 1))
            accounts.hold(name, link.kind, at)
            accounts.add("dissipated", name, link.kind, at + 1)
        for name in self.piston_names:
            at = accounts.take(3)
            accounts.add("dissipated", name, "leak", at)
            accounts.add("dissipated", name, "friction", at + 1)
            accounts.add("law", name, "cylinder", at + 2)

    def add_accounts(self, accounts) -> None:
        for name in self.bushing_names:
            at = accounts.take(2)
            accounts.hold(name, "bushing", at)
            accounts.add("dissipated", name, "bushing", at + 1)
        for name, row in zip(self.body_names, self.body_table, strict=True):
            at = accounts.take(3)
            accounts.hold(name, "body", at)
            if row["damping"] > 0.0:
                accounts.add("dissipated", name, "joint", at + 1)
            if row["schedule"] >= 0:
                accounts.add("supplied", name, "drive", at + 2)

    def above(self, model) -> dict[str, float]:
        case, energies = self.case, {}
        for name, row in zip(self.mass_names, self.mass_table, strict=False):
            if row["y"] >= 0:
                energies[name] = 0.5 * row["velocity"] ** 2 / row["lightness"]
        for (name, *_), row in zip(rows_in(case, "brace"), self.brace_table, strict=True):
            if row["stiffness"] > 0.0:
                energies[name] = 0.5 * row["force"] ** 2 / row["stiffness"]
        for (name, *_), row in zip(rows_in(case, "stop"), self.stop_table, strict=True):
            energies[name] = 0.5 * row["stiffness"] * min(0.0, row["below"], row["above"]) ** 2
        return energies

    def masses(self, model, y: np.ndarray) -> Iterator[tuple[float, float]]:
        for row in self.piston_table:  # of chambers on an axis, whose mass is state plus swept mass
            if row["line"] < 0:
                places = self.mass_table[[row["case"], row["rod"]]]["y"]
                back, forth = (float(y[place]) if place >= 0 else 0.0 for place in places)
                yield 0.0, float(row["sweep_a"] + row["sweep_b"]) * (forth - back)

    def driven(self) -> set[int]:
        return {int(row["schedule"]) for row in self.body_table}

    def stored_states(self, model) -> np.ndarray:
        places = self.mass_table["y"]
        return places[places >= 0]

    def facts(self, model) -> dict:
        names = self.mass_names
        masses = {
            name: {key: row[key].item() for key in ("position", "velocity", "force")}
            for name, row in zip(names, self.mass_table, strict=False)
        }
        return {
            "masses": masses,
            "bodies": {name: lower.pose_facts(pose) for name, pose in self.case.poses.items()},
        }

    def drawn(self, model):
        from fvsolve.features.motion.drawing import BodyLines

        return BodyLines(model) if self.body_names else None


class MotionRun(FeatureRun):
    """Stretches of fluid on bodies of a run: `loads_body` is set where only energies need their loads."""

    def __init__(self, feature: Motion, run_data) -> None:
        super().__init__(feature, run_data)
        self.segments = feature.moving_segment_table.copy()
        self.tanks = feature.tank_table.copy()

    def tables(self, view: str = "") -> MotionTables:
        return self.feature.tables()._replace(moving_segments=self.segments, tanks=self.tanks)

    def for_energy(self) -> None:
        case = self.run_data.model.case
        if faults := [
            f"{'.'.join(place)}: {text}"
            for place, text in bodies.missing_reactions(case.nodes, case.links)
        ]:
            raise FvsolveError(
                f"the energy of this network on a body is not supported; {'; '.join(faults)}"
            )
        self.segments["loads_body"] = records.JOINT_LOAD_READ
        self.tanks["loads_body"] = 1

    def end_notices(self, y: np.ndarray) -> list:
        # the length of Euler parameters is 1; the difference measures the time error
        notices = []
        for name, row in zip(self.feature.body_names, self.feature.body_table, strict=True):
            if row["joint"] not in (records.BALL, records.FREE):
                continue
            first = 3 if row["joint"] == records.FREE else 0
            at = int(row["y"]) + first
            length = float(np.linalg.norm(row["start"][first : first + 4] + y[at : at + 4]))
            if abs(length - 1.0) > DRIFT:
                text = (
                    f"{name}: its Euler parameters have drifted from length 1 to "
                    f"{length:.9g} and are divided by this "
                )
                text += "length; the error of its attitude is about as large as this drift; "
                text += 'method = "gauss-4" conserves the length'
                notices.append(Notice("drift", f"nodes.{name}", text, None, length - 1.0, DRIFT))
        return notices
