"""Initial steady state of a run: pressures, flows, and motions at the start. States are deviations from it."""

import math
from collections import Counter
from functools import cached_property
from itertools import islice
from random import Random
from typing import Any

import numpy as np

from fvsolve.core.assembly.lowering import lowering_of
from fvsolve.core.assembly.schedule_tables import value_at
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.restrictions import conductance_of, flow_at_drop, transition_of
from fvsolve.core.kernels.steady_edges import FRICTION, LEAK, RESTRICTION, friction_drop, law_of
from fvsolve.core.kernels.steady_friction import drag, drag_slope, factor_times_reynolds
from fvsolve.core.kernels.table_handle import make_handle
from fvsolve.core.model.run_data import zeros_for_run
from fvsolve.core.model.shut_off import shut_off_faults
from fvsolve.core.steady import Edge, solve_steady, union
from fvsolve.errors import Notice, listing

FIXED_PRESSURE = (rec.FIXED, rec.TANK, rec.PATCH)  # nodes whose pressure does not depend on flows
STORING = (rec.CHAMBER, rec.MOVING, rec.VESSEL)
MAX_REVISIONS = 200  # greatest number of revisions of devices
# revisions in which all devices change together; interval at which regulating devices restart at random
SIMULTANEOUS_REVISIONS, RESTART_INTERVAL = 10, 20
PRESSURE_SCALE = 1e5
ROUNDING_SHARE = 1e-12  # flows below this share of the flow scale are zero


class SteadyStart:
    """Steady flow problem of a case and its solution, with the same density in all pressure drops.

    Potentials are p + rho g z [Pa], flows mass flows [kg/s].
    """

    def __init__(self, draft) -> None:
        self.draft, self.case, self.law = draft, draft.case, draft.case.law
        self.nodes, self.pipes = draft.node_table, draft.pipe_table
        self.columns, self.valves = draft.column_table, draft.valve_table
        self.leaks = [row for feature in draft.features for row in feature.leaks]
        self.rest = self.case.numerics.initial == "rest"
        self.t = self.case.numerics.start
        self.weight = draft.fluid.density * self.case.gravity
        sizes = [
            1e-9,
            *(draft.fluid.density * self.pipes["area"]),
            *(draft.fluid.density * self.columns["area"]),
        ]
        sizes += list(np.sqrt(self.valves["conductance"] * PRESSURE_SCALE))
        self.flow_scale = max(sizes)
        # typical mass flows of pipes, columns and restrictions [kg/s]
        self.flow_scales = np.array([*sizes[1:], *np.zeros(len(self.leaks))])
        # pressure drop in addition to the law's [Pa], for laws with changing density
        self.extra: dict[str, float] = {}
        # of pipes: loss of the flow that leaves at each end, per M^2 [Pa s2/kg2]
        self.exit_losses: dict[str, tuple[float, float]] = {}
        # of valves: density relative to reference, driving pressure drop relative to potential drop
        self.density_ratios: dict[int, tuple[float, float]] = {}
        self.factor: dict[int, float] = {}  # factor on the conductance of valves, likewise
        # driving pressure drop of valves relative to potential drop, likewise
        self.ratio: dict[int, float] = {}
        self.moving: list[str] = []
        self.shut: set[int] = set()  # valves that a device holds shut
        self.valve_modes: dict[int, str] = {}  # modes of valves that regulate
        # valves that cannot sustain a pressure, see `release_regulators`
        self.uncontrolled: set[int] = set()
        # of closed chambers: pressures that support bodies, held by `solve` [Pa]
        self.loads: dict[int, float] = {}

    @cached_property
    def out(self) -> np.ndarray:
        """Values that the right-hand side writes in addition to dydt, for zero deviations."""
        return np.zeros(int(self.draft.tables.layout[0]["size"]))

    @cached_property
    def run_arrays(self) -> rec.RunArrays:
        """Arrays that a run writes, as before any event."""
        return zeros_for_run(self.draft.shapes)

    @cached_property
    def handle(self) -> np.ndarray:
        """Handle of the tables, by which compiled laws read them."""
        return make_handle((*self.draft.tables, *self.run_arrays))

    def pressure(self, i: int) -> float:
        """Pressure [Pa] at node i in the latest solution."""
        return self.law.pressure_of(self.answer.potential[i], self.nodes["elevation"][i])

    def density_at(self, i: int) -> float:
        """Density [kg/m3] at node i; the reference density before a solution exists."""
        return self.law.density(self.pressure(i)) if hasattr(self, "answer") else self.law.rho

    def schedule_value(self, schedule: int) -> float:
        """Value of a schedule at the start, its left limit."""
        values, key = self.draft.schedules.known_values, (int(schedule), self.t)
        if key not in values:
            values[key] = value_at(self.draft.tables, key[0], self.t, self.t)
        return values[key]

    def solve(self) -> None:
        """Solve for the steady state in which the state of every device agrees with its pressures and flows.

        Raises CaseError if no such state is found.
        """
        random = Random(0)
        devices = list(zip(self.draft.devices, self.draft.device_table, strict=True))
        changing: dict[str, int] = {}  # device -> last revision in which it changed
        for turn in range(MAX_REVISIONS):
            self.balance()
            revised = (
                name
                for (name, part, device), row in devices
                if device.revise_state(self, part, row)
            )
            # later one by one, to avoid cycles
            now = [*islice(revised, 1 if turn > SIMULTANEOUS_REVISIONS else None)]
            changing |= dict.fromkeys(now, turn)
            if not now:
                return self.report_faults(self.fixed_potentials)
            random.shuffle(devices)
            if turn % RESTART_INTERVAL == RESTART_INTERVAL - 1:
                self.scatter(random)
        self.report_faults(self.fixed_potentials)
        names = listing(
            [name for name, turn in changing.items() if turn >= MAX_REVISIONS - RESTART_INTERVAL]
        )
        self.draft.fault(
            "numerics.initial",
            f'no steady state was found: the states of {names} keep changing; try initial = "rest"',
        )
        self.draft.check()

    def scatter(self, random: Random) -> None:
        """Shut regulating devices at random or reset their modes, after revisions of their states did not converge."""
        for k in sorted(self.valve_modes):
            if random.random() < 0.5:
                self.shut = self.shut | {k}
            else:
                self.shut = self.shut - {k}
                del self.valve_modes[k]

    def across(self, k: int) -> tuple[float, float]:
        """Potentials at both ends of valve k in the latest solution [Pa].

        At a node that cannot be supplied the potential is -inf, at a node whose inflow finds no way out inf.
        """
        potentials = []
        for i in (int(self.valves[k][end]) for end in ("from_node", "to_node")):
            unserved = i in self.answer.no_solution
            drawn = sum(self.demand[self.answer.no_solution]) if unserved else 0.0
            potentials.append(
                -math.copysign(math.inf, drawn) if unserved else float(self.answer.potential[i])
            )
        return potentials[0], potentials[1]

    def valve_flows(self) -> np.ndarray:
        """Flows of valves in the latest solution [kg/s]."""
        return self.answer.flow[len(self.pipes) + len(self.columns) :][: len(self.valves)]

    def balance(self) -> None:
        """Solve for the steady state with devices in their current states."""
        self.fixed_potentials, self.demand = self.boundary_values()
        held = self.fixed_potentials
        pipes = [
            self.friction_edge(mesh.name, row, mesh.length)
            for mesh, row in zip(self.draft.meshes, self.pipes, strict=True)
        ]
        columns = [
            self.friction_edge(name, row, row["length"])
            for name, row in zip(self.draft.column_names, self.columns, strict=True)
        ]
        valves = [self.valve_edge(k) for k in range(len(self.valves))]
        leaks = [
            self.leak_edge(k) for k in range(len(self.leaks)) if self.leaks[k]["leakage"] > 0.0
        ]
        self.edges = [*pipes, *columns, *valves, *leaks]
        self.release_regulators(len(pipes) + len(columns))
        sizes = self.flow_scales[: len(self.edges)]
        self.answer = solve_steady(held, self.demand, self.edges, (PRESSURE_SCALE, sizes))
        flow = self.answer.flow
        for _, own, typical in self.answer.pieces:
            flow[own] = np.where(np.abs(flow[own]) <= ROUNDING_SHARE * typical, 0.0, flow[own])
        self.inflow = -self.demand.copy()
        for edge, value in zip(self.edges, flow, strict=True):
            self.inflow[edge.i] -= value
            self.inflow[edge.j] += value
        for nodes, own, typical in self.answer.pieces:
            tolerance = 10.0 * ROUNDING_SHARE * (typical + np.max(np.abs(flow[own]), initial=0.0))
            self.inflow[nodes] = np.where(
                np.abs(self.inflow[nodes]) <= tolerance, 0.0, self.inflow[nodes]
            )
        n, m = len(pipes), len(pipes) + len(columns)
        self.pipe_flow, self.column_flow, self.valve_flow = (
            flow[:n],
            flow[n:m],
            flow[m : m + len(valves)],
        )

    def release_regulators(self, first: int) -> None:
        """Open or shut each valve that would hold a pressure although demands alone determine its flow.

        Such a valve is the only way to a group of nodes in which nothing else determines a potential. A valve that
        sustains the pressure before it is open, or shut if this pressure is too low; one that reduces the pressure
        behind it is shut.
        first : index of the edge of the first valve
        """
        self.uncontrolled = set()
        holding = [
            k for k in range(len(self.valves)) if self.edges[first + k].held_potential is not None
        ]
        while holding:
            open_edges = (
                edge for edge in self.edges if edge.held_potential is None and not edge.shut
            )
            joined = [(edge.i, edge.j) for edge in open_edges if edge.row is not None or edge.drop]
            group = union(len(self.nodes), joined)
            known = {group[i] for i in np.flatnonzero(~np.isnan(self.fixed_potentials)).tolist()}
            known |= {group[self.edges[first + k].held_potential[0]] for k in holding}
            lost = next((k for k in holding if group[self.other_end(first + k)] not in known), None)
            if lost is None:
                return
            self.valve_lowering(lost).release(self, lost)
            self.uncontrolled.add(lost)
            self.edges[first + lost] = self.valve_edge(lost)
            holding.remove(lost)

    def other_end(self, e: int) -> int:
        """Node of edge e at which it does not hold the potential."""
        edge = self.edges[e]
        return edge.j if edge.held_potential[0] == edge.i else edge.i

    def boundary_values(self) -> tuple[np.ndarray, np.ndarray]:
        """Fixed potentials of nodes [Pa], nan where unknown, and demands of junctions [kg/s] : float64[nodes] each.

        Demands are 0 for `initial = "rest"`.
        """
        held, demand = np.full(len(self.nodes), np.nan), np.zeros(len(self.nodes))
        for i, (node, row) in enumerate(zip(self.case.places.values(), self.nodes, strict=True)):
            if row["kind"] == rec.JUNCTION:
                demand[i] = self.schedule_value(row["schedule"])
            elif i in self.loads:
                held[i] = self.law.potential_of(self.loads[i], row["elevation"])
            elif (
                pressure := lowering_of(type(node)).pressure_at_start(self, i, node, row)
            ) is not None:
                held[i] = self.law.potential_of(pressure, row["elevation"])
        return held, np.zeros_like(demand) if self.rest else demand

    def connected_nodes(self, i: int) -> list[int]:
        """Nodes that open links join to node i, directly or through other nodes, including node i."""
        group = union(len(self.nodes), [(edge.i, edge.j) for edge in self.edges if not edge.shut])
        return [j for j in range(len(self.nodes)) if group[j] == group[i]]

    def is_joined(self, i: int) -> bool:
        """True if a pipe, column or valve joins node i."""
        tables = (self.pipes, self.columns, self.valves)
        return any(np.any((table["from_node"] == i) | (table["to_node"] == i)) for table in tables)

    def friction_edge(self, name: str, row, length: float) -> Edge:
        """Edge of a pipe or rigid column in the steady problem, with its potential drop.

        The drop is the sum of three terms: length / area times the drag, the entry of the part in `extra`, and M |M|
        times its loss coefficient in `exit_losses` for the end at which the mass flow M leaves. The drag [kg/s2] is the
        friction of the mass flow, see `kernels.steady_friction.drag`. A stated `initial_flow` is a fixed flow.
        """
        numbers = tuple(
            float(row[key]) for key in ("friction", "loss", "rough", "roughness", "reynolds")
        )
        least = drag_slope(*numbers, 1e-6 * self.draft.fluid.density * float(row["area"]))
        extra, losses = self.extra.get(name, 0.0), self.exit_losses.get(name, (0.0, 0.0))
        law = law_of(FRICTION, float(length / row["area"]), *numbers, least, extra, *losses)
        i, j = int(row["from_node"]), int(row["to_node"])
        if self.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        link = self.case.conduits[name]
        if link.initial_flow is not None:
            given = link.initial_flow * self.draft.fluid.density
            return Edge(i, j, None, given, drop=lambda flow: friction_drop(law, flow))
        free = row["friction"] == rec.FRICTION_NONE
        # so that loops without friction get the solution of least norm
        first = 0.0 if free else self.draft.fluid.density * row["area"]
        return Edge(i, j, law, first)

    def valve_edge(self, k: int) -> Edge:
        """Edge of a valve in the steady problem, with the square-root law M |M| = G dP or the valve's own law.

        The square-root law is linearised with the slope of a chord. The method also sets `open` of the row of the
        valve. M : mass flow [kg/s]; G : conductance [kg2/s2/Pa]; dP : drop of potential [Pa]
        """
        row = self.valves[k]
        own = self.valve_lowering(k).edge(self, k)
        if own is not None:
            return own
        g, back = self.conductance(k), float(row["back"])
        row["open"] = g
        g *= self.factor.get(k, 1.0)
        i, j = int(row["from_node"]), int(row["to_node"])
        if g <= 0.0:
            return Edge(i, j, None, 0.0, shut=True)
        if self.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        law = law_of(RESTRICTION, g, back, transition_of(row, g), transition_of(row, g * back))
        return Edge(i, j, law, math.sqrt(g * PRESSURE_SCALE))

    def valve_lowering(self, k: int):
        """Conversion object that sets the state of valve k: that of its device, or of the valve itself."""
        if self.valves[k]["device"] >= 0:
            return self.draft.devices[self.valves[k]["device"]][2]
        link = self.case.conduits[self.draft.valve_names[k]]
        return lowering_of(type(link)).of(link)

    def conductance(self, k: int) -> float:
        """Conductance of valve k at the start [kg2/s2/Pa]; if a device controls it, it is fully open or shut."""
        row = self.valves[k]
        if row["device"] >= 0:
            if k in self.shut:
                return 0.0
            _, part, device = self.draft.devices[row["device"]]
            opening = device.opening_at_start(self, part, self.draft.device_table[row["device"]], k)
            return float(row["conductance"]) * opening * opening
        opening = self.schedule_value(row["schedule"])
        if row["characteristic"] == 0:  # as `conductance_of`, which needs all tables
            return float(row["conductance"]) * opening * opening
        return conductance_of(self.draft.tables, k, opening)

    def leak_edge(self, k: int) -> Edge:
        """Edge of leak k in the steady problem: mass flow = density * leakage * pressure drop."""
        row = self.leaks[k]
        g = row["leakage"] * self.draft.fluid.density * self.factor.get(len(self.valves) + k, 1.0)
        i, j = int(row["a"]), int(row["b"])
        if self.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        return Edge(i, j, law_of(LEAK, g))

    def leak_flow(self, row, p_a: float, p_b: float) -> float:
        """Flow of a leak from node a to node b [kg/s]; p_a, p_b : pressures there [Pa]"""
        return self.law.density(max(p_a, p_b)) * row["leakage"] * (p_a - p_b)

    def report_faults(self, held) -> None:
        """Add a fault for each part for which no steady state exists; raises CaseError if there is any.

        held : float64[n]  fixed potentials of nodes [Pa]
        """
        for place, text in shut_off_faults(self):
            self.draft.fault(place, text)
        for name, row in zip(self.draft.pipe_names, self.pipes, strict=True):
            ends = [int(row["from_node"]), int(row["to_node"])]
            free = (
                row["friction"] == rec.FRICTION_NONE
                and self.case.conduits[name].initial_flow is None
            )
            if (
                free
                and not self.rest
                and abs(held[ends[0]] - held[ends[1]]) > 1e-6 * PRESSURE_SCALE
            ):
                a, b = ((held[k] - self.case.ambient_pressure) / self.weight for k in ends)
                a, b = (self.case.amount(head, "head", 6) for head in (a, b))
                self.draft.fault(
                    f"links.{name}",
                    "no steady state: this pipe has no friction, but different heads at "
                    f"its ends, {a} and {b}; give it `friction` or `initial_flow`, or use "
                    'initial = "rest"',
                )
        if not self.draft.faults and not self.answer.converged:
            weak = [list(self.case.places)[i] for i in self.answer.undetermined]
            worst = (
                f"the equations hardly determine the pressure at {listing(weak, 6)}"
                if weak
                else f"flows balance least at {list(self.case.places)[self.least_balanced()]}"
            )
            self.draft.fault(
                "numerics.initial",
                f"no steady state was found: {worst}; check "
                "there for demands that cannot be supplied, links of extreme resistance, and frictionless "
                'paths between unequal heads, or use initial = "rest"',
            )
        self.draft.check()

    def least_balanced(self) -> int:
        """Number of the node whose flows balance least in the latest solution, or whose potential is not a number."""
        free = np.isnan(self.fixed_potentials)
        errors = np.where(np.isfinite(self.answer.potential), np.abs(self.inflow), np.inf)
        return int(np.argmax(np.where(free, np.nan_to_num(errors, nan=np.inf), -1.0)))

    def report_frictionless(self) -> None:
        """Add notices of frictionless pipes and columns between unequal heads, and of loops without friction.

        Friction does not determine the distribution of flow in such loops.
        """
        # fixed nodes count as a single node: paths between them close loops
        merged = {
            i: -1 for i, potential in enumerate(self.fixed_potentials) if not np.isnan(potential)
        }
        rows = [
            *zip(self.draft.pipe_names, self.pipes, strict=True),
            *zip(self.draft.column_names, self.columns, strict=True),
        ]
        ends = {
            name: [merged.get(int(row[end]), int(row[end])) for end in ("from_node", "to_node")]
            for name, row in rows
            if row["friction"] == rec.FRICTION_NONE and row["loss"] == 0.0
        }
        fixed, free = self.fixed_potentials, [row for row in rows if row[0] in ends]
        swinging = [
            name
            for name, row in free
            if self.case.conduits[name].initial_flow is None
            and abs(fixed[row["from_node"]] - fixed[row["to_node"]]) > 1e-6 * PRESSURE_SCALE
        ]
        for name in swinging:
            text = f"{name}: without friction between unequal heads no flow is steady"
            text += "; the flow starts from rest, and oscillates or grows"
            self.draft.warnings.append(Notice("start", f"links.{name}", text))
        loops, before = {name: pair for name, pair in ends.items() if name not in swinging}, None
        # a link to a node that no other link joins is in no loop
        while self.answer.split and loops != before:
            before, counts = loops, Counter(end for pair in loops.values() for end in pair)
            loops = {
                name: pair for name, pair in loops.items() if min(counts[end] for end in pair) > 1
            }
        weak = [list(self.case.places)[i] for i in self.answer.undetermined] if not loops else []
        if weak:
            text = (
                f"{listing(weak, 6)}: the equations hardly determine the pressure here, because links of extreme "
                "resistance, or frictionless links alone, join this part; check diameters, lengths and openings of "
                "its links"
            )
            self.draft.warnings.append(Notice("start", f"nodes.{weak[0]}", text))
        elif self.answer.split and (loops or not swinging):
            text = f"{listing(loops) or 'paths'}: flow in loops without friction is not unique"
            text += "; the start has the smallest of these flows (least norm)"
            self.draft.warnings.append(
                Notice("start", f"links.{next(iter(loops))}" if loops else "links", text)
            )

    def freeze_factors(self) -> None:
        """Set the constant factors of `steady` friction by roughness, from the starting flow.

        Without flow at the start the factor is that of fully rough flow, 0 for a smooth wall, and a notice is added.
        """
        rows = [
            *zip(self.draft.pipe_names, self.pipes, self.pipe_flow, strict=True),
            *zip(self.draft.column_names, self.columns, self.column_flow, strict=True),
        ]
        for name, row, flow in rows:
            if (
                row["friction"] != rec.FRICTION_ROUGH
                or self.case.conduits[name].friction.model != "steady"
            ):
                continue
            reynolds = row["reynolds"] * abs(flow)
            if reynolds > 0.0:
                factor = factor_times_reynolds(reynolds, row["roughness"]) / reynolds
            else:
                e = row["roughness"]
                factor = (2.0 * math.log10(3.7 / e)) ** -2 if e > 0.0 else 0.0
                text = f"{name}: no flow at the start; its friction factor is that of fully rough flow, {factor:.4g}"
                self.draft.warnings.append(
                    Notice("start", f"links.{name}", text, "friction", factor)
                )
            if "temperature" in row.dtype.names and row["temperature"] > 0.0:
                text = f"{name}: its friction keeps the viscosity of the start; quasi-steady friction would follow it"
                self.draft.warnings.append(
                    Notice("start", f"links.{name}", text, "friction", factor)
                )
                row["temperature"] = 0.0
            row["loss"] += row["rough"] * factor
            row["rough"], row["friction"] = 0.0, rec.FRICTION_FACTOR

    def fill_nodes(self) -> None:
        for i, (node, row) in enumerate(zip(self.case.places.values(), self.nodes, strict=True)):
            held = row["kind"] in FIXED_PRESSURE
            own = lowering_of(type(node))
            row["pressure"] = (
                own.pressure_at_start(self, i, node, row) if held else self.pressure(i)
            )
            if row["kind"] in STORING:
                row["mass"] = self.law.mass_in(row["pressure"], row["volume"])
        self.nodes["demand"], self.nodes["inflow"] = self.demand, self.inflow

    def pipe_drop(self, row) -> float:
        return drag(
            *(row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds", "flow"))
        )

    def fill_pipes(self) -> None:
        """Set the steady pressures along pipes, from a potential that is linear between the ends.

        Pressure that friction does not balance drives the flow.
        """
        profile, self.unbalanced_drops = self.draft.tables.profile, {}
        for k, (row, mesh) in enumerate(zip(self.pipes, self.draft.meshes, strict=True)):
            row["flow"] = self.pipe_flow[k]
            row["drag"] = self.pipe_drop(row)
            p = self.answer.potential[[row["from_node"], row["to_node"]]]
            self.set_unbalanced_drop(mesh, row, p[0] - p[1])
            slope = row["drag"] / row["area"]
            cells = slice(int(row["cell"]), int(row["cell"]) + mesh.cells)
            pressure = self.draft.profiles[k] = p[0] - slope * mesh.x - self.weight * mesh.elevation
            profile[cells] = (self.draft.fluid.vapor_pressure - pressure) * row["admittance"]

    def set_unbalanced_drop(self, mesh, row, change: float) -> bool:
        """Set the drag of a pipe to balance its drop of potential `change` [Pa]; False if friction balances it."""
        excess = change - row["drag"] / row["area"] * mesh.length
        if abs(excess) <= 1e-10 * (PRESSURE_SCALE + abs(change)):
            return False
        self.unbalanced_drops[mesh.name] = excess
        row["drag"] = change * row["area"] / mesh.length
        return True

    def height(self, row, mesh, fraction: float) -> float:
        """Elevation of a pipe [m] at a fraction of its length."""
        if mesh.profile is not None:
            return float(mesh.profile.at(fraction * mesh.length))
        return self.nodes["elevation"][row["from_node"]] + row["slope"] * fraction * mesh.length

    def profile_at(self, k: int, fraction: float) -> tuple[float, float]:
        """Steady pressure [Pa] and elevation [m] at a fraction of the length of pipe k."""
        row, mesh = self.pipes[k], self.draft.meshes[k]
        z = self.height(row, mesh, fraction)
        potential = (
            self.answer.potential[row["from_node"]]
            - row["drag"] / row["area"] * fraction * mesh.length
        )
        return potential - self.weight * z, z

    def fill_columns(self) -> None:
        for row, flow in zip(self.columns, self.column_flow, strict=True):
            row["flow"] = flow
            row["drag"] = self.pipe_drop(row)
            p = self.answer.potential[[row["from_node"], row["to_node"]]]
            offset = (p[0] - p[1]) - row["drag"] * row["length"] / row["area"]
            row["offset"] = (
                offset if abs(offset) > 1e-10 * (PRESSURE_SCALE + abs(p[0] - p[1])) else 0.0
            )

    def fill_valves(self) -> None:
        for k, (row, flow) in enumerate(zip(self.valves, self.valve_flow, strict=True)):
            row["flow"] = flow
            row["drop"] = (
                self.answer.potential[row["from_node"]] - self.answer.potential[row["to_node"]]
            )
            size = PRESSURE_SCALE + abs(self.answer.potential[row["from_node"]])
            if flow == 0.0 and abs(row["drop"]) <= ROUNDING_SHARE * size:
                row["drop"] = 0.0
            if row["hooks"] >= 0:
                self.valve_lowering(k).follow(self, k)
                continue
            here = row["open"] * (row["back"] if row["drop"] < 0.0 else 1.0)
            law = flow_at_drop(here, transition_of(row, here), row["drop"])
            if abs(law - flow) > 1e-6 * (self.flow_scale * 1e-6 + abs(flow)):
                row["open"] = 0.0
            elif row["transition"] == 0.0 and row["open"] > 0.0:
                row["drop"] = abs(flow) * flow / here

    def set_point_tolerance(self, end: str) -> float:
        """Tolerance of a regulated pressure [Pa], 1e-6 of PRESSURE_SCALE.

        If `end` is "", it is that of a regulated flow [kg/s], 1e-6 of the flow scale.
        """
        return 1e-6 * PRESSURE_SCALE if end else 1e-6 * self.flow_scale

    def valve_drive(self, k: int) -> tuple[float, float]:
        """Drive of valve k in the steady state : (drop [Pa], density in the valve over reference density)."""
        return float(self.valves[k]["drop"]), 1.0

    def valve_law(self, k: int) -> tuple[float, float]:
        """Law of valve k in the steady state : (fully open conductance [kg2/s2/Pa], drop that drives the flow [Pa]).

        The conductance is that at the density in the valve.
        """
        drop, denser = self.valve_drive(k)
        return float(self.valves[k]["conductance"]) * denser, drop

    def use_start_flows(self, net: np.ndarray) -> None:
        """Replace the flows of dry conduits by those at the start, in the net inflows of nodes [kg/s]."""
        meshed = {part.name: part for part in self.draft.meshed}
        for name, row in zip(self.draft.valve_names, self.valves, strict=True):
            link = self.case.conduits[name]
            if link.kind == "conduit-end":
                net[row["to_node"]] = 0.0
                node, flow = row["from_node"], meshed[link.conduit].start_flow(link.patch)
                if self.nodes[node]["y"] >= 0:
                    net[node] += row["flow"] - self.draft.fluid.density * flow
                    net[node] *= abs(net[node]) > 1e-12 * self.flow_scale  # without rounding

    def report(self) -> dict[str, Any]:
        draft, moving = self.draft, []
        for feature in draft.features:
            moving += feature.begin_forces(draft, self)
        moving += self.moving
        for feature in draft.features:
            moving += feature.begin_motion(draft, self)
        fluid, net = self.draft.fluid, self.nodes["inflow"].copy()
        for row in self.leaks:
            net[[row["a"], row["b"]]] -= row["speed"] * np.array([row["sweep_a"], row["sweep_b"]])
        self.use_start_flows(net)
        for (name, node), row, inflow in zip(
            self.case.places.items(), self.nodes, net, strict=True
        ):
            name = name.removesuffix(".inside")
            if inflow != 0.0:
                own = lowering_of(type(node))
                text = own.motion_text(
                    name, node, row, inflow, inflow / fluid.density, self.case.amount
                )
                moving += [text] if text else []
        amount = self.case.amount
        for name, pressure in self.unbalanced_drops.items():
            drop = amount(pressure, "pressure", span=True)
            moving.append(
                f"pipe {name}: a pressure difference of {drop}, not balanced by friction, drives its flow"
            )
        for name, row in zip(self.draft.column_names, self.columns, strict=True):
            if row["offset"] != 0.0:
                drop = amount(row["offset"], "pressure", span=True)
                moving.append(
                    f"rigid column {name}: an unbalanced pressure of {drop} drives its flow"
                )
        for k, (name, row) in enumerate(zip(self.draft.valve_names, self.valves, strict=True)):
            still = row["drop"] != 0.0 and row["open"] == 0.0 and row["flow"] == 0.0
            if still and self.conductance(k) > 0.0:
                drop = amount(row["drop"], "pressure", span=True)
                moving.append(f"valve {name}: open with {drop} across it; a flow starts")
        if self.case.numerics.initial == "equilibrium":
            for text in moving:
                self.draft.fault(
                    "numerics.initial", f'"equilibrium" expects that nothing moves, but {text}'
                )
        return {"moving": moving}
