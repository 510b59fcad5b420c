"""Static equilibrium of bodies and masses: Newton's method on forces, for `initial = "equilibrium"`.

With M the mass matrix and K = -dF/dq, steps are taken in M^(1/2) dq. There K has squares of angular frequencies as
eigenvalues, and lengths and angles have comparable weight. The search runs in the directions that constraints leave
free. If all eigenvalues are positive, a step is Newton's step. A negative eigenvalue enters by its magnitude, so that
bodies move away from an unstable position. A position that is stated and in balance is kept, stable or not; so is a
coordinate on which no force and no stiffness act.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fvsolve.case import check
from fvsolve.errors import Notice
from fvsolve.model.balance import nodes_at, owner, report, told, upset
from fvsolve.model.bodies_start import ALIKE, CLOSE, SNAP
from fvsolve.model.places import Displaced

TRIES, HALVINGS = 100, 30
TURN = 0.3  # largest rotation in a step [rad]
STRETCH = 0.5  # largest displacement in a step, as a share of the shortest line
FLAT = 1e-9  # share of the greatest eigenvalue below which the stiffness counts as zero
LEAST = 1e-6  # same share: least magnitude used in a step, and threshold of instability
NEAR = 1e-4  # unbalanced share of forces up to which a stated position counts as an intended equilibrium
SHUT = 1e-14  # gap of constraints that counts as closed [m]
OVER = 0.5  # a step may reverse the force along it up to this share


@dataclass(frozen=True)
class Found:
    """A configuration: states, generalised forces and their scale, rows of constraints and their gaps [m]."""

    y: np.ndarray
    force: np.ndarray
    scale: np.ndarray
    rows: np.ndarray
    gaps: np.ndarray

    @property
    def share(self) -> float:
        """Greatest unbalanced force, relative to the sum of magnitudes of the forces in it."""
        return float(np.max(np.abs(self.force) / np.where(self.scale > 0.0, self.scale, 1.0), initial=0.0))

    @property
    def open(self) -> float:
        """Greatest gap of a constraint [m]."""
        return float(np.max(np.abs(self.gaps), initial=0.0))

    def better(self, other: Found) -> bool:
        """True if this configuration is clearly nearer to equilibrium than the other."""
        own, others = ((max(place.share, SNAP), max(place.open, SHUT)) for place in (self, other))
        return own[0] < 0.5 * others[0] or own[1] < 0.5 * others[1]


def settled(case, draft) -> tuple[Any, list[Notice]]:
    """Case with bodies and masses in static equilibrium, and notices about it : (case, notices).

    draft : tables of the case with its steady start. Bodies with stated velocities stay where they are.
    Raises CaseError if no equilibrium is found.
    """
    at = Displaced(draft)
    if not at.size or at.moving():
        return case, []
    result = search(at)
    if result.share <= CLOSE:
        upset(at, result.y)
    else:
        report(at, result.force, result.scale)
    draft.check()
    case = replace(case, found=nodes_at(at, result.y))
    nodes, surroundings = case.nodes | case.found, (case.ambient_pressure, case.gravity, None, None)
    for keys, text in check.parts(nodes, case.links, *surroundings, at.t, case.meshes, case.lumped):
        draft.fault(".".join(map(str, keys)), f"where forces balance {text}")
    draft.check()
    return case, [*told(case), *unstable(at, result)]


def look(at: Displaced, y: np.ndarray) -> Found:
    """Evaluate a configuration. Constraint forces minimise the unbalanced forces, in the norm of M^-1."""
    rows, gaps, sizes = at.rows(y), at.gaps(y), np.zeros(at.count)
    at.hold(sizes)
    force = at.force(y)
    if at.count:
        inverse_root = np.linalg.inv(np.linalg.cholesky(at.mass(y)))
        sizes = -np.linalg.lstsq(inverse_root @ rows.T, inverse_root @ force, rcond=ALIKE)[0]
        at.hold(sizes)
        force = at.force(y)
    return Found(y, force, at.scale(), rows, gaps)


def search(at: Displaced) -> Found:
    """Equilibrium reached by Newton steps, or the best configuration that was visited."""
    here = best = look(at, at.y.copy())
    intended = here.share <= NEAR
    for _ in range(TRIES):
        if here.share <= SNAP and here.open <= SHUT:
            return here
        new = look(at, along(at, here, *step(at, here, intended)))
        if not np.all(np.isfinite(new.force)):
            break
        if here.share <= CLOSE and not new.better(here):
            return min(here, new, key=lambda place: place.share)
        here = new
        best = here if here.better(best) else best
    return best


def step(at: Displaced, here: Found, intended: bool) -> tuple[np.ndarray, np.ndarray]:
    """Newton step : (step of all unknowns, its part in directions that constraints leave free).

    With `intended` the step goes to the nearest equilibrium, stable or not.
    """
    inverse_root, free, close = ways(at, here)
    k = inverse_root @ at.stiffness(here.y) @ inverse_root.T
    own, pull = free.T @ k @ free, free.T @ (inverse_root @ here.force - k @ close)
    values, modes = np.linalg.eigh(0.5 * (own + own.T))
    great = np.max(np.abs(values), initial=0.0)
    flat, pulls = np.abs(values) <= FLAT * great, modes.T @ pull
    pulls[flat & (np.abs(pulls) <= CLOSE * np.linalg.norm(inverse_root @ here.scale))] = 0.0
    if intended or not (np.any(values[~flat] < 0.0) or np.any(pulls[flat])):
        way = np.linalg.pinv(own, rcond=FLAT) @ pull
    else:
        way = modes @ (pulls / np.maximum(np.abs(values), LEAST * great or 1.0))
    return inverse_root.T @ (close + free @ way), inverse_root.T @ free @ way


def ways(at: Displaced, here: Found) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions of a step : (L^-1 with M = L L', basis of directions free of constraints, step that closes gaps).

    The basis and the closing step are in the coordinates M^(1/2) dq.
    """
    inverse_root = np.linalg.inv(np.linalg.cholesky(at.mass(here.y)))
    if not at.count:
        return inverse_root, np.eye(at.size), np.zeros(at.size)
    rows = here.rows @ inverse_root.T
    _, sizes, directions = np.linalg.svd(rows)
    rank = int(np.sum(sizes > ALIKE * sizes[0]))
    return inverse_root, directions[rank:].T, -np.linalg.pinv(rows, rcond=ALIKE) @ here.gaps


def along(at: Displaced, here: Found, move: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Configuration after a step, shortened to limit rotations, displacements and a reversal of the force along it."""
    angular = at.turns()
    excess = [np.max(np.abs(move[angular]), initial=0.0) / TURN,
           np.max(np.abs(move[~angular]), initial=0.0) / (STRETCH * at.shortest())]  # fmt: skip
    share, before = 1.0 / max(1.0, *excess), here.force @ free
    for _ in range(HALVINGS if before > 0.0 else 0):
        if at.force(at.moved(here.y, share * move)) @ free >= -OVER * before:
            break
        share *= 0.5
    return at.moved(here.y, share * move)


def unstable(at: Displaced, result: Found) -> list[Notice]:
    """Notice if the equilibrium is unstable; closed chambers act as springs."""
    inverse_root, free, _ = ways(at, result)
    own = free.T @ inverse_root @ (at.stiffness(result.y) + at.oil(result.y)) @ inverse_root.T @ free
    values, modes = np.linalg.eigh(0.5 * (own + own.T))
    if not len(values) or values[0] >= -LEAST * np.max(np.abs(values)):
        return []
    name, rate = owner(at, int(np.argmax(np.abs(free @ modes[:, 0])))), float(np.sqrt(-values[0]))
    duration = at.draft.case.amount(1.0 / rate, "time", 3)
    text = (f"{name}: its forces balance, but the equilibrium is unstable: a small displacement grows by a factor e in "
            f"{duration}; state another position, or support it")  # fmt: skip
    return [Notice("start", f"nodes.{name}", text, "stability", rate, 0.0)]
