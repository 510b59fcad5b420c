"""Where bodies and masses stand under `equilibrium`: Newton on forces. Knows no law of a force.

With M the mass matrix and K = -dF/dq, steps are taken in M^(1/2) dq, where K has squares of frequencies as eigenvalues
and lengths and angles weigh alike; what constraints leave is searched. Where all of these are positive a step is
Newton's; a negative one counts by its size, so that bodies leave a place that is not stable, as they would. What stands
in balance by what is stated stays there, stable or not; so does what nothing pulls and nothing holds.
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
TURN = 0.3  # [rad] of a step at most
STRETCH = 0.5  # of the shortest line, likewise of what slides
FLAT = 1e-9  # share of the greatest eigenvalue below which nothing holds
LEAST = 1e-6  # share of it that a step reckons with at least, and that is unstable
NEAR = 1e-4  # share of its forces by which a place that is stated may be out of balance and is meant
SHUT = 1e-14  # [m] by which constraints may be open, likewise
OVER = 0.5  # share of the force along a step that may turn round by it


@dataclass(frozen=True)
class Found:
    """A place: states, forces and what makes them up, rows of constraints and their gaps [m]."""

    y: np.ndarray
    force: np.ndarray
    scale: np.ndarray
    rows: np.ndarray
    gaps: np.ndarray

    @property
    def share(self) -> float:
        """Greatest unbalanced force, as a share of the forces that make it up."""
        return float(np.max(np.abs(self.force) / np.where(self.scale > 0.0, self.scale, 1.0), initial=0.0))

    @property
    def open(self) -> float:
        """By how much a constraint is not met [m]."""
        return float(np.max(np.abs(self.gaps), initial=0.0))

    def better(self, other: Found) -> bool:
        """Whether it is clearly nearer to balance than another place."""
        mine, its = ((max(one.share, SNAP), max(one.open, SHUT)) for one in (self, other))
        return mine[0] < 0.5 * its[0] or mine[1] < 0.5 * its[1]


def settled(case, draft) -> tuple[Any, list[Notice]]:
    """(the case with bodies and masses where forces balance, what is to be known of that), by a draft of its steady
    start.

    CaseError where none is found. What moves at rates that are stated stays where it is.
    """
    at = Displaced(draft)
    if not at.size or at.moving():
        return case, []
    found = search(at)
    if found.share <= CLOSE:
        upset(at, found.y)
    else:
        report(at, found.force, found.scale)
    draft.check()
    case = replace(case, found=nodes_at(at, found.y))
    nodes, about = case.nodes | case.found, (case.ambient_pressure, case.gravity, None, None)
    for keys, text in check.parts(nodes, case.links, *about, at.t, case.meshes, case.lumped):
        draft.fault(".".join(map(str, keys)), f"where forces balance {text}")
    draft.check()
    return case, [*told(case), *unstable(at, found)]


def look(at: Displaced, y: np.ndarray) -> Found:
    """A place, constraints pushing so that least is left of forces."""
    rows, gaps, sizes = at.rows(y), at.gaps(y), np.zeros(at.count)
    at.hold(sizes)
    force = at.force(y)
    if at.count:
        easy = np.linalg.inv(np.linalg.cholesky(at.mass(y)))
        sizes = -np.linalg.lstsq(easy @ rows.T, easy @ force, rcond=ALIKE)[0]
        at.hold(sizes)
        force = at.force(y)
    return Found(y, force, at.scale(), rows, gaps)


def search(at: Displaced) -> Found:
    """The place in balance that steps lead to, or the nearest to one that they came."""
    here = best = look(at, at.y.copy())
    meant = here.share <= NEAR
    for _ in range(TRIES):
        if here.share <= SNAP and here.open <= SHUT:
            return here
        new = look(at, along(at, here, *step(at, here, meant)))
        if not np.all(np.isfinite(new.force)):
            break
        if here.share <= CLOSE and not new.better(here):
            return min(here, new, key=lambda one: one.share)
        here = new
        best = here if here.better(best) else best
    return best


def step(at: Displaced, here: Found, meant: bool) -> tuple[np.ndarray, np.ndarray]:
    """(step of all unknowns, what of it constraints leave free); one that is `meant` to the nearest of any kind."""
    easy, free, close = ways(at, here)
    k = easy @ at.stiffness(here.y) @ easy.T
    own, pull = free.T @ k @ free, free.T @ (easy @ here.force - k @ close)
    values, modes = np.linalg.eigh(0.5 * (own + own.T))
    great = np.max(np.abs(values), initial=0.0)
    flat, pulls = np.abs(values) <= FLAT * great, modes.T @ pull
    pulls[flat & (np.abs(pulls) <= CLOSE * np.linalg.norm(easy @ here.scale))] = 0.0
    if meant or not (np.any(values[~flat] < 0.0) or np.any(pulls[flat])):
        way = np.linalg.pinv(own, rcond=FLAT) @ pull
    else:
        way = modes @ (pulls / np.maximum(np.abs(values), LEAST * great or 1.0))
    return easy.T @ (close + free @ way), easy.T @ free @ way


def ways(at: Displaced, here: Found) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(M^(-1/2) as L^-1 of M = L L', in its coordinates what constraints leave free, and the way to meet them)."""
    easy = np.linalg.inv(np.linalg.cholesky(at.mass(here.y)))
    if not at.count:
        return easy, np.eye(at.size), np.zeros(at.size)
    rows = here.rows @ easy.T
    _, sizes, all_ways = np.linalg.svd(rows)
    rank = int(np.sum(sizes > ALIKE * sizes[0]))
    return easy, all_ways[rank:].T, -np.linalg.pinv(rows, rcond=ALIKE) @ here.gaps


def along(at: Displaced, here: Found, way: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Where a step leads, cut so that bodies turn little in it and the force along it does not turn round."""
    turns = at.turns()
    far = [np.max(np.abs(way[turns]), initial=0.0) / TURN,
           np.max(np.abs(way[~turns]), initial=0.0) / (STRETCH * at.shortest())]  # fmt: skip
    share, before = 1.0 / max(1.0, *far), here.force @ free
    for _ in range(HALVINGS if before > 0.0 else 0):
        if at.force(at.moved(here.y, share * way)) @ free >= -OVER * before:
            break
        share *= 0.5
    return at.moved(here.y, share * way)


def unstable(at: Displaced, found: Found) -> list[Notice]:
    """That a balance is not stable: what stands in it leaves it by itself, shut chambers holding as springs."""
    easy, free, _ = ways(at, found)
    own = free.T @ easy @ (at.stiffness(found.y) + at.oil(found.y)) @ easy.T @ free
    values, modes = np.linalg.eigh(0.5 * (own + own.T))
    if not len(values) or values[0] >= -LEAST * np.max(np.abs(values)):
        return []
    name, rate = owner(at, int(np.argmax(np.abs(free @ modes[:, 0])))), float(np.sqrt(-values[0]))
    takes = at.draft.case.amount(1.0 / rate, "time", 3)
    text = (f"{name}: its forces balance, but not stably: what moves it a little grows by e in {takes}; "
            "state another place, or hold it")  # fmt: skip
    return [Notice("start", f"nodes.{name}", text, "stability", rate, 0.0)]
