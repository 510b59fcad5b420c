"""Start of bodies: balance of joint forces, constraint forces of pins, velocities and accelerations at the start."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import dtypes as rec
from fvsolve.model.static_forces import ACCELERATE, GAPS, HOLD, MOTION, PINNED, StaticForces

RANK_TOLERANCE = 1e-8  # a row of pins is redundant if its independent part is below this share of the largest row
PIN_RATE_TOLERANCE = 1e-6  # greatest rate at which a pin may open at the start [m/s]
ROUNDING_SHARE = 1e-12  # a sum of forces of a joint below this share of their magnitudes is rounding
EQUILIBRIUM_SHARE = (
    1e-9  # likewise in a computed equilibrium: stiff springs amplify the rounding of a length by this much
)


def refuse_massless(draft, at: StaticForces) -> None:
    """Add a fault for a body whose joint allows a motion without inertia, of the body or of bodies attached to it.

    A body that the fluid in its tanks outweighs gets a fault too. Only the last such body in the table gets one.
    """
    at.run(MOTION, ACCELERATE)
    n = len(draft.freedom_table)
    for name, row in reversed(list(zip(draft.body_names, draft.body_table, strict=True))):
        own = np.linalg.norm(row["inertia"]) + row["mass"] * float(row["centre"] @ row["centre"])
        least = RANK_TOLERANCE**2 * (own if row["joint"] in (rec.REVOLUTE, rec.BALL) else 0.0)
        for freedom in draft.freedom_table[row["freedom"] : row["freedom"] + row["freedoms"]]:
            left = at.written.scratch[8 * n + freedom["row"] + freedom["depth"]] ** -2.0
            if np.isnan(left) and len(draft.moving_segment_table):
                text = "fluid in tall tanks, whose own flow has no inertia in the model, outweighs its carrying body"
                remedy = "expected wider tanks, a heavier body, or a driven joint"
                return draft.fault(f"nodes.{name}.mass", f"{text}; {remedy}")
            if not left > least:
                text = "the inertia of the body is 0 in a direction in which its joint allows motion"
                return draft.fault(
                    f"nodes.{name}.inertia", f"{text}. Expected an inertia above 0 about the axis of the joint"
                )


def start_bodies(draft, start) -> list[str]:
    """Set lengths and rates of lines of action, data of pins and `balance` of freedoms at the start.

    Returns texts of motions at the start. Raises CaseError for motions without inertia and for pins that are redundant
    or open.
    """
    if not len(draft.body_table):
        return []
    at = StaticForces(draft, start.t)
    tables = (draft.brace_table, draft.stop_table, draft.piston_table)
    pushes = np.array([row["force"] for table in tables for row in table])
    travel, first = int(at.layout["travel"]), int(at.layout["push"])
    rows = [row for table in tables for row in table]
    for line in draft.line_table:
        line["length"] = at.out[travel + 2 * line["push"]] if line["acts"] == rec.ALONG else 0.0
        if "speed" in rows[line["push"]].dtype.names:
            rows[line["push"]]["speed"] = at.out[travel + 2 * line["push"] + 1]
    refuse_massless(draft, at)
    draft.check()
    at.out[first : first + pushes.size] = pushes
    at.run(*at.pushes)
    left, accelerate = at.forces(), ACCELERATE
    if len(draft.pin_table):
        left, accelerate = start_pins(draft, at), PINNED
    size = at.sizes(pushes)
    draft.freedom_table["balance"] = np.where(np.abs(left) <= rounding(draft) * size, left, 0.0)
    at.run(*at.pushes, accelerate)
    return motion_at_start(draft, at.accelerations())


def rounding(draft) -> float:
    """Fraction of the sum of force magnitudes below which the sum of these forces counts as rounding error."""
    return EQUILIBRIUM_SHARE if draft.case.numerics.initial == "equilibrium" else ROUNDING_SHARE


def pin_rows(draft, at: StaticForces) -> np.ndarray:
    """Constraint matrix of all pins at the start : float64[constraints, freedoms].

    The matrix times the joint velocities gives the velocities at which the pins open, one per constrained direction.
    """
    n, count = len(draft.freedom_table), int(draft.pin_table["rows"].sum())
    if count:
        at.run(*at.pushes, PINNED)
    first = 8 * n + draft.factor_size + 16 * len(draft.body_table)
    return at.written.scratch[first : first + count * n].reshape(count, n).copy()


def start_pins(draft, at: StaticForces) -> np.ndarray:
    """Set gaps and constraint forces of pins at the start; raises CaseError for pins that are redundant or open.

    Returns the remaining generalised force on each joint freedom : float64[freedoms] [N] or [N m].
    """
    at.run(*at.pushes, GAPS)
    first = int(at.layout["pin"])
    for k, row in enumerate(draft.pin_table):
        row["gap"][: row["rows"]] = at.out[first + 3 * k :][: row["rows"]]
    rows = pin_rows(draft, at)
    names = [name for name, row in zip(draft.pin_names, draft.pin_table, strict=True) for _ in range(row["rows"])]
    for name in dict.fromkeys(redundant_pins(rows, names)):
        text = "this pin is redundant: in some direction joints or other pins already hold its two points together"
        draft.fault(f"links.{name}", f"{text}. Give the key `axis` for a loop in a plane, else remove one pin")
    slips: dict[str, float] = {}
    for name, slip in zip(names, rows @ at.rates(), strict=True):
        slips[name] = float(np.hypot(slips.get(name, 0.0), slip))
    for name, slip in slips.items():
        if slip > PIN_RATE_TOLERANCE:
            rate = draft.case.amount(slip, "velocity")
            draft.fault(
                f"links.{name}",
                f"velocities at the start separate the two points of this pin at {rate}. Expected equal velocities",
            )
    draft.check()
    forces = at.out[int(at.layout["pin"]) :][: 3 * len(draft.pin_table)].reshape(-1, 3)
    for row, force in zip(draft.pin_table, forces, strict=True):
        row["force"][: row["rows"]] = force[: row["rows"]]
    at.run(*at.pushes, HOLD)
    return at.forces()


def redundant_pins(rows: np.ndarray, names: list[str]) -> list[str]:
    """Names of pins whose constraint rows are zero or linearly dependent on earlier rows.

    rows : float64[constraints, freedoms]  see `pin_rows`; names : name of the pin of each row
    """
    dependent, basis = [], np.zeros((0, rows.shape[1]))
    size = np.linalg.norm(rows, axis=1).max()
    for name, row in zip(names, rows, strict=True):
        remainder = row - basis.T @ (basis @ row)
        remainder -= basis.T @ (basis @ remainder)
        if np.linalg.norm(remainder) <= RANK_TOLERANCE * size:
            dependent.append(name)
        else:
            basis = np.vstack([basis, remainder / np.linalg.norm(remainder)])
    return dependent


def motion_at_start(draft, accelerations: np.ndarray) -> list[str]:
    """Texts of the velocities and accelerations of bodies at the start.

    accelerations : float64[freedoms]  [m/s2] or [rad/s2]
    """
    texts, amount = [], draft.case.amount
    for name, row in zip(draft.body_names, draft.body_table, strict=True):
        pose, own = draft.case.poses[name], accelerations[row["freedom"] : row["freedom"] + row["freedoms"]]
        # water in sloshing modes is not among the nodes: only its accelerations are listed
        stated = name in draft.case.nodes
        if stated and (size := np.linalg.norm(pose.spin)) > 0.0:
            texts.append(f"body {name} turns at {amount(size, 'angular_velocity')}")
        if stated and (size := np.linalg.norm(pose.velocity)) > 0.0:
            texts.append(f"body {name} moves at {amount(size, 'velocity')}")
        slides = 0 if row["joint"] in (rec.REVOLUTE, rec.BALL) else 3 if row["joint"] == rec.FREE else 1
        for part, unit in ((own[:slides], "m/s2"), (own[slides:], "rad/s2")):
            if np.any(part):
                texts.append(f"body {name} accelerates at {np.linalg.norm(part):.4g} {unit}")
    return texts
