"""Pressures of shut chambers that hold what stands on them. Knows pistons and joints; solves no network."""

from __future__ import annotations

import numpy as np

from fvsolve.model.bodies_start import pin_rows
from fvsolve.model.statics import Statics

ROUNDS = 3  # of what holds bodies


def holding_pressures(draft, start) -> dict[int, float]:
    """Pressures at which shut chambers that state none hold the bodies that stand on them : node -> pressure [Pa].

    Forces of their pistons by least squares, so that forces of joints vanish; of two such chambers of one cylinder the
    one that need not push is at ambient pressure. None of a chamber that would have to pull.
    """
    pistons = draft.locked
    if not pistons:
        return {}
    ambient, at = draft.case.ambient_pressure, Statics(draft, start.t)
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
    alone, nothing = size * np.eye(pushes.size)[first:], at.under(0.0 * pushes)
    unit = np.array([at.under(alone[k]) - nothing for k in pistons]).T / size
    unit = np.hstack([unit, pin_rows(draft, at).T])  # what pins hold, pistons need not
    forces = np.zeros(len(pistons))
    for _ in range(ROUNDS):  # the second to rounding
        pushes[[first + k for k in pistons]] = forces
        forces = forces - np.linalg.lstsq(unit, at.under(pushes), rcond=None)[0][: forces.size]
    found = {}
    for (k, free), force in zip(pistons.items(), forces, strict=True):
        row = draft.piston_table[k]
        side = free[0] if len(free) == 1 else "a" if force > 0.0 else "b"
        other = gauge["b" if side == "a" else "a"][k] if len(free) == 1 else 0.0
        sign, area, against = (1.0, "area_a", "area_b") if side == "a" else (-1.0, "area_b", "area_a")
        pressure = ambient + (sign * force + row[against] * other) / row[area]
        found |= dict.fromkeys([int(row[one]) for one in free], ambient)
        found[int(row[side])] = float(pressure)
    return {i: p for i, p in found.items() if p > draft.case.law.cavity_pressure}


def find_shut(draft, start) -> None:
    """Note which chambers hold what stands on them, and behind which pistons fluid is shut in."""
    for k, row in enumerate(draft.piston_table):
        free = [side for side in "ab" if row["line"] >= 0 and is_shut(draft, start, int(row[side]))]
        alone = [side for side in "ab" if start.reaches(int(row[side])) == [row[side]]]
        draft.locked |= {k: free} if free else {}
        draft.shut |= {k: alone} if alone else {}


def is_shut(draft, start, i: int) -> bool:
    """Whether a chamber that states no pressure is joined to nothing that has one."""
    places = list(draft.case.places.values())
    if places[i].initial_pressure is not None:
        return False
    return all(j == i or np.isnan(start.held[j]) for j in start.reaches(i))
