"""How bodies start: what of their joints' forces is balanced, what pins hold, what moves. Knows names; no rhs."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.model.statics import ACCELERATE, GAPS, HOLD, MOTION, PINNED, Statics

ALIKE = 1e-8  # share of the largest row of pins that a row has beside all others: below, it says nothing new
LOOSE = 1e-6  # rate at which a pin may open at the start [m/s]
SNAP = 1e-12  # share of what makes up a joint's force below which their sum is rounding
CLOSE = 1e-9  # likewise at a place that was found: by so much stiff springs turn the rounding of a length into force


def refuse_weightless(draft, at: Statics) -> None:
    """Faults of bodies whose joint lets them move where neither they nor what hangs on them have inertia."""
    at.run(MOTION, ACCELERATE)
    n = len(draft.freedom_table)
    for name, row in reversed(list(zip(draft.body_names, draft.body_table, strict=True))):
        own = np.linalg.norm(row["inertia"]) + row["mass"] * float(row["centre"] @ row["centre"])
        least = ALIKE**2 * (own if row["joint"] in (rec.REVOLUTE, rec.BALL) else 0.0)
        for freedom in draft.freedom_table[row["freedom"] : row["freedom"] + row["freedoms"]]:
            left = at.written.scratch[8 * n + freedom["row"] + freedom["depth"]] ** -2.0
            if np.isnan(left) and len(draft.ride_table):
                text = "fluid in tall tanks, whose own flow has no inertia here, outweighs what carries it"
                wanted = "wanted wider tanks, a heavier body, or a driven joint"
                return draft.fault(f"nodes.{name}.mass", f"{text}; {wanted}")
            if not left > least:
                text = "nothing resists the motion that its joint leaves it: its inertia there is 0"
                return draft.fault(f"nodes.{name}.inertia", f"{text}; give it some, about the axis of the joint")


def start_bodies(draft, start) -> list[str]:
    """Lengths of lines, and of joints what is balanced at the start; returns what moves, in words."""
    if not len(draft.body_table):
        return []
    at = Statics(draft, start.t)
    tables = (draft.brace_table, draft.stop_table, draft.piston_table)
    pushes = np.array([row["force"] for table in tables for row in table])
    travel, first = int(at.layout["travel"]), int(at.layout["push"])
    rows = [row for table in tables for row in table]
    for line in draft.line_table:
        line["length"] = at.out[travel + 2 * line["push"]] if line["acts"] == rec.ALONG else 0.0
        if "speed" in rows[line["push"]].dtype.names:
            rows[line["push"]]["speed"] = at.out[travel + 2 * line["push"] + 1]
    refuse_weightless(draft, at)
    draft.check()
    at.out[first : first + pushes.size] = pushes
    at.run(*at.pushes)
    left, accelerate = at.forces(), ACCELERATE
    if len(draft.pin_table):
        left, accelerate = start_pins(draft, at), PINNED
    size = at.sizes(pushes)
    draft.freedom_table["balance"] = np.where(np.abs(left) <= rounding(draft) * size, left, 0.0)
    at.run(*at.pushes, accelerate)
    return moves(draft, at.accelerations())


def rounding(draft) -> float:
    """Share of forces below which their sum is rounding."""
    return CLOSE if draft.case.numerics.initial == "equilibrium" else SNAP


def pin_rows(draft, at: Statics) -> np.ndarray:
    """G of all rows of pins at the start : float64[rows, freedoms]."""
    n, many = len(draft.freedom_table), int(draft.pin_table["rows"].sum())
    if many:
        at.run(*at.pushes, PINNED)
    first = 8 * n + draft.factor_size + 16 * len(draft.body_table)
    return at.written.scratch[first : first + many * n].reshape(many, n).copy()


def start_pins(draft, at: Statics) -> np.ndarray:
    """Gaps and forces of pins at the start: what is left of forces of freedoms with these. Faults."""
    at.run(*at.pushes, GAPS)
    first = int(at.layout["pin"])
    for k, row in enumerate(draft.pin_table):
        row["gap"][: row["rows"]] = at.out[first + 3 * k :][: row["rows"]]
    rows = pin_rows(draft, at)
    names = [name for name, row in zip(draft.pin_names, draft.pin_table, strict=True) for _ in range(row["rows"])]
    for name in dict.fromkeys(redundant(rows, names)):
        text = "in some direction nothing can open it, or others hold it there already"
        draft.fault(f"links.{name}", f"{text}; of a loop in a plane give its axis, else leave one pin out")
    slips = dict(zip(names, rows @ at.rates(), strict=True))
    for name, slip in slips.items():
        if abs(slip) > LOOSE:
            quick = draft.case.amount(abs(slip), "velocity")
            draft.fault(f"links.{name}", f"the rates of the start open it at {quick}; let them agree")
    draft.check()
    forces = at.out[int(at.layout["pin"]) :][: 3 * len(draft.pin_table)].reshape(-1, 3)
    for row, force in zip(draft.pin_table, forces, strict=True):
        row["force"][: row["rows"]] = force[: row["rows"]]
    at.run(*at.pushes, HOLD)
    return at.forces()


def redundant(rows: np.ndarray, names: list[str]) -> list[str]:
    """Pins of rows that are sums of those before, or nothing."""
    found, basis = [], np.zeros((0, rows.shape[1]))
    size = np.linalg.norm(rows, axis=1).max()
    for name, row in zip(names, rows, strict=True):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)
        if np.linalg.norm(rest) <= ALIKE * size:
            found.append(name)
        else:
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
    return found


def moves(draft, accelerations: np.ndarray) -> list[str]:
    """What moves at the start, and what begins to, in words."""
    found, told = [], draft.case.amount
    for name, row in zip(draft.body_names, draft.body_table, strict=True):
        pose, own = draft.case.poses[name], accelerations[row["freedom"] : row["freedom"] + row["freedoms"]]
        stated = name in draft.case.nodes  # of water in modes only what it begins to do
        if stated and (fast := np.linalg.norm(pose.spin)) > 0.0:
            found.append(f"body {name} turns at {told(fast, 'angular_velocity')}")
        if stated and (fast := np.linalg.norm(pose.velocity)) > 0.0:
            found.append(f"body {name} moves at {told(fast, 'velocity')}")
        slides = 0 if row["joint"] in (rec.REVOLUTE, rec.BALL) else 3 if row["joint"] == rec.FREE else 1
        for part, unit in ((own[:slides], "m/s2"), (own[slides:], "rad/s2")):
            if np.any(part):
                found.append(f"body {name} accelerates at {np.linalg.norm(part):.4g} {unit}")
    return found
