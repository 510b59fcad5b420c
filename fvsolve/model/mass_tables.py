"""Tables of masses on axes and of the springs, stops and cylinders between them, and their forces at the start."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.assembly.mechanics import are_points, push_ends
from fvsolve.kernels import dtypes as rec
from fvsolve.model.bodies_start import rounding

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
