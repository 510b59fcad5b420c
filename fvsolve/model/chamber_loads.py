"""Pressures of closed chambers that support bodies and masses."""

from __future__ import annotations

import numpy as np

from fvsolve.model.bodies_start import pin_rows
from fvsolve.model.mass_tables import forces_on_masses
from fvsolve.model.static_forces import StaticForces

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
