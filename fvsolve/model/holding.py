"""Pressures of shut chambers that hold bodies and masses. Knows pistons and joints; solves no network."""

from __future__ import annotations

import numpy as np

from fvsolve.model.bodies_start import pin_rows
from fvsolve.model.masses import forces_on_masses
from fvsolve.model.statics import Statics

ROUNDS = 3  # of what holds bodies


def holding_pressures(draft, start) -> dict[int, float]:
    """Pressures at which shut chambers that state none hold bodies and masses : node -> pressure [Pa].

    Forces of their pistons by least squares, so that forces of joints and masses vanish; of two such chambers of one
    cylinder the one that need not push is as its shut links leave it, ambient without any. None of a chamber
    that would have to pull.
    """
    pistons = draft.locked
    if not pistons:
        return {}
    ambient, balance = draft.case.ambient_pressure, Balance(draft, start.t)
    first = len(draft.brace_table) + len(draft.stop_table)
    pushes = np.zeros(first + len(draft.piston_table))
    for k, row in enumerate([*draft.brace_table, *draft.stop_table]):
        scheduled = "schedule" in row.dtype.names and row["schedule"] >= 0
        pushes[k] = start.given(row["schedule"]) if scheduled else row["force"]
    gauge = {side: [start.pressure(int(row[side])) - ambient for row in draft.piston_table] for side in "ab"}
    for k, row in enumerate(draft.piston_table):
        if k not in pistons:
            pushes[first + k] = row["area_a"] * gauge["a"][k] - row["area_b"] * gauge["b"][k]
    size = draft.case.ambient_pressure * float(max(draft.piston_table["area_a"]))
    alone, nothing = size * np.eye(pushes.size)[first:], balance.under(0.0 * pushes)
    unit = np.array([balance.under(alone[k]) - nothing for k in pistons]).T / size
    unit = np.hstack([unit, balance.pins().T])  # what pins hold, pistons need not
    forces = np.zeros(len(pistons))
    for _ in range(ROUNDS):  # the second to rounding
        pushes[[first + k for k in pistons]] = forces
        forces = forces - np.linalg.lstsq(unit, balance.under(pushes), rcond=None)[0][: forces.size]
    found = {}
    for (k, free), force in zip(pistons.items(), forces, strict=True):
        row = draft.piston_table[k]
        side = free[0] if len(free) == 1 else "a" if force > 0.0 else "b"
        other, sign = ("b", 1.0) if side == "a" else ("a", -1.0)
        push = sign * force + row[f"area_{other}"] * gauge[other][k]
        found |= {int(row[one]): ambient + float(gauge[one][k]) for one in free}
        found[int(row[side])] = ambient + float(push / row[f"area_{side}"])
    return {i: p for i, p in found.items() if p > draft.case.law.cavity_pressure}


class Balance:
    """Rest of the forces on joints, then on masses that can move, under given pushes."""

    def __init__(self, draft, t: float) -> None:
        self.draft, self.free = draft, np.flatnonzero(draft.mass_table["y"] >= 0)
        self.joints = Statics(draft, t) if len(draft.body_table) else None

    def under(self, pushes: np.ndarray) -> np.ndarray:
        """Forces under these pushes : float64[freedoms + masses]."""
        joints = [] if self.joints is None else self.joints.under(pushes)
        return np.concatenate([joints, forces_on_masses(self.draft, pushes)[self.free]])

    def pins(self) -> np.ndarray:
        """G of all rows of pins : float64[rows, freedoms + masses]."""
        rows = np.zeros((0, 0)) if self.joints is None else pin_rows(self.draft, self.joints)
        return np.pad(rows, ((0, 0), (0, len(self.free))))


def find_shut(draft, start) -> None:
    """Note which chambers hold what stands on them, and behind which pistons fluid is shut in."""
    for k, row in enumerate(draft.piston_table):
        free = [side for side in "ab" if is_shut(draft, start, int(row[side]))]
        alone = [side for side in "ab" if start.reaches(int(row[side])) == [row[side]]]
        draft.locked |= {k: free} if free else {}
        draft.shut |= {k: alone} if alone else {}


def is_shut(draft, start, i: int) -> bool:
    """Whether a chamber that states no pressure is joined to nothing that has one."""
    places = list(draft.case.places.values())
    if places[i].initial_pressure is not None:
        return False
    return all(j == i or np.isnan(start.held[j]) for j in start.reaches(i))
