"""Bodies and what pushes them, lowered to tables, and the forces they start from. Knows names; knows no rhs."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.kernels import records as rec

BAR = 1e5  # what counts as a small pressure, and so the travel that makes it
SMALL_TRAVEL, SMALL_SPEED = 1e-3, 0.1  # of bodies that no chamber holds, of bodies that nothing holds
FAR = 1e300  # room before a stop that is not there
SNAP = 1e-12  # share of the forces on a body below which their sum is rounding


def lower_bodies(draft) -> None:
    """Fill the tables of bodies, braces, stops and pistons of a scene."""
    case = draft.case
    draft.body_names = [name for name, node in case.nodes.items() if node.domain == "translational"]
    of = {kind: [(name, link) for name, link in case.links.items() if link.kind == kind] for kind in KINDS}
    braces = [pair for kind in ("spring", "damper", "force") for pair in of[kind]]
    draft.brace_table = np.zeros(len(braces), rec.BRACE)
    draft.stop_table = np.zeros(len(of["end-stop"]), rec.STOP)
    draft.piston_table = np.zeros(len(of["cylinder"]), rec.PISTON)
    draft.piston_names = [name for name, _ in of["cylinder"]]
    draft.push_names = [name for name, _ in [*braces, *of["end-stop"], *of["cylinder"]]]
    outside = any(link.from_ is None for _, link in of["force"])
    draft.body_table = np.zeros(len(draft.body_names) + outside, rec.BODY)
    draft.body_index = {name: i for i, name in enumerate(draft.body_names)}
    draft.body_index |= {None: len(draft.body_names)}
    for name, row in zip(draft.body_names, draft.body_table, strict=False):
        fill_body(case.nodes[name], row)
    for (_, link), row in zip(braces, draft.brace_table, strict=True):
        fill_brace(draft, link, row)
    for (_, link), row in zip(of["end-stop"], draft.stop_table, strict=True):
        fill_stop(draft, link, row)
    for (name, link), row in zip(of["cylinder"], draft.piston_table, strict=True):
        fill_piston(draft, name, link, row)
    add_states(draft)


KINDS = ("spring", "damper", "force", "end-stop", "cylinder")


def fill_body(node, row) -> None:
    row["position"] = node.initial_position
    if node.kind == "mass":
        row["velocity"], row["lightness"] = node.initial_velocity, 1.0 / node.mass


def join(draft, row, ports: tuple[str, str], places: tuple[str | None, str]) -> tuple[float, float]:
    """Write the bodies at two ports; how far the second lies ahead at the start [m], and its speed ahead [m/s]."""
    for port, place in zip(ports, places, strict=True):
        row[port] = draft.body_index[place]
    first, second = (draft.body_table[int(row[port])] for port in ports)
    return second["position"] - first["position"], second["velocity"] - first["velocity"]


def fill_brace(draft, link, row) -> None:
    x, speed = join(draft, row, ("from_body", "to_body"), (link.from_, link.to))
    row["schedule"], row["speed"] = -1, speed
    if link.kind == "spring":
        row["stiffness"] = link.stiffness
        row["force"] = -link.stiffness * (x - link.free_length) if link.preload is None else link.preload
    elif link.kind == "damper":
        row["damping"], row["force"] = link.damping, -link.damping * speed
    else:
        row["schedule"] = draft.schedules.add(link.force)


def fill_stop(draft, link, row) -> None:
    from fvsolve.kernels.mechanics import contact  # scenes without bodies load none of it

    x, speed = join(draft, row, ("from_body", "to_body"), (link.from_, link.to))
    row["stiffness"], row["damping"] = link.stiffness, link.damping
    row["below"] = FAR if link.least is None else x - link.least
    row["above"] = FAR if link.greatest is None else link.greatest - x
    for room, sign in ((float(row["below"]), 1.0), (float(row["above"]), -1.0)):
        if room <= 0.0:
            row["force"] += sign * contact(float(link.stiffness), float(link.damping), -room, float(-sign * speed))


def fill_piston(draft, name: str, link, row) -> None:
    row["position"], row["speed"] = join(draft, row, ("case", "rod"), (link.ports["case"], link.ports["rod"]))
    row["a"], row["b"] = draft.node_index[f"{name}.A"], draft.node_index[f"{name}.B"]
    row["area_a"], row["area_b"] = link.areas()
    row["stroke"], row["leakage"], row["damping"] = link.stroke, link.leakage, link.viscous_friction


def add_states(draft) -> None:
    """Position and velocity of every mass; small is the travel that makes a bar, and its speed as it swings."""
    nodes, bodies = draft.node_table, draft.body_table
    travel, stiffness = np.full(len(bodies), SMALL_TRAVEL), np.zeros(len(bodies))
    for row in draft.brace_table:
        stiffness[[row["from_body"], row["to_body"]]] += row["stiffness"]
    for row in draft.piston_table:
        for node, area in ((nodes[row["a"]], row["area_a"]), (nodes[row["b"]], row["area_b"])):
            per_travel = draft.fluid.bulk_modulus * area / node["volume"]
            for body in (row["case"], row["rod"]):
                travel[body] = min(travel[body], BAR / per_travel)
                stiffness[body] += area * per_travel
    bodies["y"] = -1
    for i, name in enumerate(draft.body_names):
        if bodies[i]["lightness"] > 0.0:
            speed = travel[i] * math.sqrt(stiffness[i] * bodies[i]["lightness"]) if stiffness[i] > 0.0 else SMALL_SPEED
            bodies[i]["y"] = draft.states([f"{name}.position"], travel[i])
            draft.states([f"{name}.velocity"], max(speed, abs(bodies[i]["velocity"])))


def start_bodies(draft, start) -> list[str]:
    """The forces of the start and what is left of them on each body; returns what moves, in words."""
    nodes, bodies, ambient = draft.node_table, draft.body_table, draft.case.ambient_pressure
    size = np.zeros(len(bodies))
    for row in draft.brace_table:
        if row["schedule"] >= 0:
            row["given"] = row["force"] = start.given(row["schedule"])
    for row in draft.piston_table:
        a, b = nodes[row["a"]], nodes[row["b"]]
        row["sweep_a"] = a["mass"] / a["volume"] * row["area_a"]
        row["sweep_b"] = -b["mass"] / b["volume"] * row["area_b"]
        row["leak"] = start.leak_flow(row, float(a["pressure"]), float(b["pressure"]))
        pushed, back = row["area_a"] * (a["pressure"] - ambient), row["area_b"] * (b["pressure"] - ambient)
        row["force"] = pushed - back - row["damping"] * row["speed"]
        size[[row["case"], row["rod"]]] += abs(pushed) + abs(back)
    total = np.zeros(len(bodies))
    for table, ports in ((draft.brace_table, ("from_body", "to_body")), (draft.stop_table, ("from_body", "to_body")),
                         (draft.piston_table, ("case", "rod"))):  # fmt: skip
        for row in table:
            for port, sign in zip(ports, (-1.0, 1.0), strict=True):
                total[row[port]] += sign * row["force"]
                size[row[port]] += abs(row["force"])
    bodies["force"] = np.where(np.abs(total) > SNAP * size, total, 0.0)
    moving = []
    for name, row in zip(draft.body_names, bodies, strict=False):
        if row["velocity"] != 0.0:
            moving.append(f"mass {name} moves at {row['velocity']:.4g} m/s")
        if row["force"] != 0.0 and row["lightness"] > 0.0:
            moving.append(f"mass {name} accelerates at {row['force'] * row['lightness']:.4g} m/s2")
    return moving
