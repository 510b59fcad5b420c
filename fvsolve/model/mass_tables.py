"""Tables of masses on axes and of force elements, and their start, with closed chambers that support loads."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.assembly.mechanics import are_points, push_ends
from fvsolve.kernels import dtypes as rec
from fvsolve.model.static_forces import StaticForces, pin_rows, rounding

SMALL_PRESSURE = 1e5  # a small pressure, which sets the size of a small travel
SMALL_TRAVEL, SMALL_SPEED = 1e-3, 0.1  # of masses without chambers; of masses without stiffness


def lower_masses(draft) -> None:
    """Fill the tables of masses, braces (springs, dampers, forces), stops and pistons."""
    case = draft.case
    draft.mass_names = [name for name, node in case.nodes.items() if node.domain == "translational"]
    draft.mass_index = {name: i for i, name in enumerate(draft.mass_names)}
    pushes = [link for table in ("brace", "stop", "piston") for _, link, _ in draft.links.get(table, ())]
    outside = any(None in push_ends(link) or are_points(draft, *push_ends(link)) for link in pushes)
    draft.mass_table = np.zeros(len(draft.mass_names) + outside, rec.MASS)
    draft.mass_index |= {None: len(draft.mass_names)}
    for name, row in zip(draft.mass_names, draft.mass_table, strict=False):
        node = case.nodes_with_water[name]
        row["position"] = node.initial_position
        if (mass := getattr(node, "mass", None)) is not None:  # a frame is fixed
            row["velocity"], row["lightness"] = node.initial_velocity, 1.0 / mass
    braces, draft.brace_table = draft.fill("brace", rec.BRACE)
    stops, draft.stop_table = draft.fill("stop", rec.STOP)
    draft.piston_names, draft.piston_table = draft.fill("piston", rec.PISTON)
    draft.push_names = [*braces, *stops, *draft.piston_names]
    add_states(draft)


def add_states(draft) -> None:
    """Add position and velocity of every mass as states, with the size of a small deviation of each.

    A small travel changes the pressure of an adjacent chamber by 1 bar; a small velocity belongs to an oscillation with
    this travel as amplitude.
    """
    nodes, masses = draft.node_table, draft.mass_table
    travel, stiffness = np.full(len(masses), SMALL_TRAVEL), np.zeros(len(masses))
    for row in draft.brace_table:
        stiffness[[row["from_mass"], row["to_mass"]]] += row["stiffness"]
    for row in draft.piston_table:
        for node, area in ((nodes[row["a"]], row["area_a"]), (nodes[row["b"]], row["area_b"])):
            per_travel = draft.fluid.bulk_modulus * area / node["volume"]
            for mass in (row["case"], row["rod"]):
                travel[mass] = min(travel[mass], SMALL_PRESSURE / per_travel)
                stiffness[mass] += area * per_travel
    masses["y"] = -1
    for i, name in enumerate(draft.mass_names):
        if masses[i]["lightness"] > 0.0:
            speed = travel[i] * math.sqrt(stiffness[i] * masses[i]["lightness"]) if stiffness[i] > 0.0 else SMALL_SPEED
            masses[i]["y"] = draft.states([f"{name}.position"], travel[i])
            draft.states([f"{name}.velocity"], max(speed, abs(masses[i]["velocity"])))


def pushed_masses(draft) -> np.ndarray:
    """Indices of the masses that each force element joins : int64[elements, 2], braces, stops, then pistons."""
    ends = ((draft.brace_table, "from_mass", "to_mass"), (draft.stop_table, "from_mass", "to_mass"),
            (draft.piston_table, "case", "rod"))  # fmt: skip
    return np.concatenate([np.column_stack([table[a], table[b]]) for table, a, b in ends])


def forces_on_masses(draft, pushes: np.ndarray) -> np.ndarray:
    """Sum of the forces on each mass from force elements and from still water on moving walls : float64[masses] [N].

    pushes : force of each element on its second mass [N], opposite on its first, in the order of `pushed_masses`
    """
    total = np.zeros(len(draft.mass_table))
    for push, (first, second) in zip(pushes, pushed_masses(draft), strict=True):
        total[first] -= push
        total[second] += push
    for row in draft.wall_table:
        if row["mass"] >= 0:
            total[row["mass"]] += row["outward"] * row["rest"]
    return total


def start_masses(draft, start) -> list[str]:
    """Set forces of elements and the unbalanced force on each mass at the start; return texts of motions."""
    nodes, masses, ambient = draft.node_table, draft.mass_table, draft.case.ambient_pressure
    size = np.zeros(len(masses))
    for row in draft.brace_table:
        if row["schedule"] >= 0:
            row["given"] = row["force"] = start.schedule_value(row["schedule"])
    for row in draft.piston_table:
        a, b = nodes[row["a"]], nodes[row["b"]]
        row["sweep_a"] = a["mass"] / a["volume"] * row["area_a"]
        row["sweep_b"] = -b["mass"] / b["volume"] * row["area_b"]
        row["leak"] = start.leak_flow(row, float(a["pressure"]), float(b["pressure"]))
        pushed, back = row["area_a"] * (a["pressure"] - ambient), row["area_b"] * (b["pressure"] - ambient)
        row["force"] = pushed - back - row["damping"] * row["speed"]
        size[[row["case"], row["rod"]]] += abs(pushed) + abs(back)
    pushes = np.concatenate([table["force"] for table in (draft.brace_table, draft.stop_table, draft.piston_table)])
    total = forces_on_masses(draft, pushes)
    for push, ends in zip(pushes, pushed_masses(draft), strict=True):
        size[ends] += abs(push)
    for row in draft.wall_table:
        if row["mass"] >= 0:
            size[row["mass"]] += abs(row["rest"])
    masses["force"] = np.where(np.abs(total) > rounding(draft) * size, total, 0.0)
    moving = []
    for name, row in zip(draft.mass_names, masses, strict=False):
        if row["velocity"] != 0.0:
            moving.append(f"mass {name} moves at {draft.case.amount(row['velocity'], 'velocity')}")
        if row["force"] != 0.0 and row["lightness"] > 0.0:
            acceleration = draft.case.amount(row["force"] * row["lightness"], "acceleration")
            moving.append(f"mass {name} accelerates at {acceleration}")
    return moving


ITERATIONS = 3  # iterations for the forces that support bodies


def supporting_pressures(draft, start) -> dict[int, float]:
    """Pressures of closed chambers that carry loads and have no stated pressure : node -> pressure [Pa].

    Forces of pistons are the least-squares solution that balances the forces on joints and masses. If both chambers of
    a cylinder are closed, the chamber that does not push keeps the pressure of its closed links, or ambient pressure
    without links. A chamber that would need at most the `cavity_pressure` of the density law is left out.
    """
    pistons = draft.locked
    if not pistons:
        return {}
    ambient, balance = draft.case.ambient_pressure, UnbalancedForces(draft, start.t)
    first = len(draft.brace_table) + len(draft.stop_table)
    pushes = np.zeros(first + len(draft.piston_table))
    for k, row in enumerate([*draft.brace_table, *draft.stop_table]):
        scheduled = "schedule" in row.dtype.names and row["schedule"] >= 0
        pushes[k] = start.schedule_value(row["schedule"]) if scheduled else row["force"]
    gauge = {side: [start.pressure(int(row[side])) - ambient for row in draft.piston_table] for side in "ab"}
    for k, row in enumerate(draft.piston_table):
        if k not in pistons:
            pushes[first + k] = row["area_a"] * gauge["a"][k] - row["area_b"] * gauge["b"][k]
    size = draft.case.ambient_pressure * float(max(draft.piston_table["area_a"]))
    unit_pushes, base = size * np.eye(pushes.size)[first:], balance.under(0.0 * pushes)
    influence = np.array([balance.under(unit_pushes[k]) - base for k in pistons]).T / size
    # forces of pins are unknowns too, so pistons take none of their share
    influence = np.hstack([influence, balance.pins().T])
    forces = np.zeros(len(pistons))
    for _ in range(ITERATIONS):  # the second is exact to rounding
        pushes[[first + k for k in pistons]] = forces
        forces = forces - np.linalg.lstsq(influence, balance.under(pushes), rcond=None)[0][: forces.size]
    pressures = {}
    for (k, closed), force in zip(pistons.items(), forces, strict=True):
        row = draft.piston_table[k]
        side = closed[0] if len(closed) == 1 else "a" if force > 0.0 else "b"
        opposite, sign = ("b", 1.0) if side == "a" else ("a", -1.0)
        push = sign * force + row[f"area_{opposite}"] * gauge[opposite][k]
        pressures |= {int(row[chamber]): ambient + float(gauge[chamber][k]) for chamber in closed}
        pressures[int(row[side])] = ambient + float(push / row[f"area_{side}"])
    return {i: p for i, p in pressures.items() if p > draft.case.law.cavity_pressure}


class UnbalancedForces:
    """Computes unbalanced forces on joint freedoms and free masses, for given forces of springs, stops and pistons."""

    def __init__(self, draft, t: float) -> None:
        self.draft, self.free = draft, np.flatnonzero(draft.mass_table["y"] >= 0)
        self.joints = StaticForces(draft, t) if len(draft.body_table) else None

    def under(self, pushes: np.ndarray) -> np.ndarray:
        """Unbalanced forces for given pushes [N] : float64[freedoms + masses], joints first."""
        joints = [] if self.joints is None else self.joints.under(pushes)
        return np.concatenate([joints, forces_on_masses(self.draft, pushes)[self.free]])

    def pins(self) -> np.ndarray:
        """Constraint matrix of all pins, see `pin_rows` : float64[constraints, freedoms + masses], zero for masses."""
        rows = np.zeros((0, 0)) if self.joints is None else pin_rows(self.draft, self.joints)
        return np.pad(rows, ((0, 0), (0, len(self.free))))


def find_closed_chambers(draft, start) -> None:
    """Record, for each piston, the sides with a closed chamber that can carry a load, and those with trapped fluid.

    They are written to `draft.locked` and `draft.shut`, see `ModelDraft`.
    """
    for k, row in enumerate(draft.piston_table):
        closed = [side for side in "ab" if is_closed(draft, start, int(row[side]))]
        isolated = [side for side in "ab" if start.connected_nodes(int(row[side])) == [row[side]]]
        draft.locked |= {k: closed} if closed else {}
        draft.shut |= {k: isolated} if isolated else {}


def is_closed(draft, start, i: int) -> bool:
    """True if chamber i has no stated pressure, and no open path joins it to a node with a fixed pressure."""
    places = list(draft.case.places.values())
    if places[i].initial_pressure is not None:
        return False
    return all(j == i or np.isnan(start.fixed_potentials[j]) for j in start.connected_nodes(i))
