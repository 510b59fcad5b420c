"""How far a run is from a reference: over the trajectory and at the end. Knows rows and fields; runs nothing.

Every probe is measured by its own range in the reference, every pipe's waves by the range of their sum there, so that
an error of 0.01 is a hundredth of what that component does. The error of a run is that of its worst component.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fvsolve.studies.accuracy.plane import contents, lowered
from fvsolve.studies.outcome import Outcome

STILL = 1e-9  # a component that moves by less of its size than this says nothing


@dataclass(frozen=True)
class Distance:
    """Error over the trajectory (mean over time), its greatest value at any row, and at the end; nan: not known.

    overshoot : by how much a probe leaves the range that it has in the reference
    worst : the component whose trajectory error is the greatest
    """

    trajectory: float = float("nan")
    greatest: float = float("nan")
    end: float = float("nan")
    overshoot: float = float("nan")
    worst: str = ""


@dataclass(frozen=True)
class Track:
    """What a run leaves to be compared.

    rows : float64[k, 1 + probes]  time [s] and probes [SI]; waves : pipe -> float64[2, cells], both waves at the end
    [kg/s]; spans : pipe -> range of their sum over the run [kg/s]; pools : what cells of basins hold at the end
    """

    probes: tuple[str, ...]
    rows: np.ndarray
    waves: dict[str, np.ndarray]
    spans: dict[str, float]
    pools: tuple[Pool, ...] = ()


class Pool(NamedTuple):
    """A basin and what its cells hold: quantity -> float64[n]."""

    basin: Any
    held: dict[str, np.ndarray]


def track(found: Outcome) -> Track:
    """Rows and last fields of a run."""
    waves, spans, model = {}, {}, found.model
    for pipe, row in zip(model.pipes, model.tables.pipes, strict=True):
        n, at, cell = pipe.cells, int(row["y"]), int(row["cell"])
        waves[pipe.name] = found.y[at : at + 2 * n].reshape(2, n).copy()
        envelope = found.slate.envelope[:, cell : cell + n]
        span = float(envelope[2].max() - envelope[0].min())
        spans[pipe.name] = span if span > STILL * model.scale[at] else 0.0
    pools = tuple(Pool(basin, contents(basin, found.y)) for basin in model.basins)
    return Track(found.probes, found.rows, waves, spans, pools)


def ranges(rows: np.ndarray) -> np.ndarray:
    """Range of every probe : float64[probes] [SI], nan for those that stand still."""
    values = rows[:, 1:]
    span, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    return np.where(span > STILL * size, span, np.nan)


def distance(run: Track, reference: Track) -> Distance:
    """Errors of a run against a reference of the same case; all nan where the run did not reach the end."""
    if run.rows.shape != reference.rows.shape:
        return Distance()
    span = ranges(reference.rows)
    moving = np.isfinite(span)
    with np.errstate(invalid="ignore", over="ignore"):
        off = np.abs(run.rows[:, 1:] - reference.rows[:, 1:])[:, moving] / span[moving]
        fields = [one for name in run.waves for one in _field_errors(run, reference, name)]
        for mine, theirs in zip(run.pools, reference.pools, strict=False):
            fields += _pool_errors(mine, theirs)
        if not off.shape[1]:
            return Distance(end=max(fields, default=float("nan")))
        t = reference.rows[:, 0]  # rows before and after a jump share a time: the second weighs nothing twice
        means = np.sum(0.5 * (off[1:] + off[:-1]) * np.diff(t)[:, None], axis=0) / (t[-1] - t[0])
        names = [name for name, moves in zip(run.probes, moving, strict=True) if moves]
        mine, theirs = run.rows[:, 1:][:, moving], reference.rows[:, 1:][:, moving]
        beyond = np.maximum(mine.max(axis=0) - theirs.max(axis=0), theirs.min(axis=0) - mine.min(axis=0))
        return Distance(
            float(means.max()),
            float(off.max()),
            max([float(off[-1].max()), *fields]),
            max(0.0, float((beyond / span[moving]).max())),
            names[int(np.argmax(means))],
        )


def extremes_apart(one: Track, other: Track) -> float:
    """How far greatest and least values of probes differ, over their ranges in the other; nan where none moves."""
    span = ranges(other.rows)
    if one.rows.shape != other.rows.shape or not np.isfinite(span).any():
        return float("nan")
    mine, theirs = one.rows[:, 1:], other.rows[:, 1:]
    off = [np.abs(mine.max(axis=0) - theirs.max(axis=0)), np.abs(mine.min(axis=0) - theirs.min(axis=0))]
    return float(np.nanmax(np.maximum(*off) / span))


def _field_errors(run: Track, reference: Track, pipe: str) -> list[float]:
    """Mean over the cells of the error of the sum and of the difference of both waves, over the sum's range."""
    mine, span = run.waves[pipe], reference.spans[pipe]
    if not span > 0.0:
        return []
    theirs = np.array([averages(wave, mine.shape[1]) for wave in reference.waves[pipe]])
    off = mine - theirs
    return [float(np.mean(np.abs(off[0] + sign * off[1]))) / span for sign in (1.0, -1.0)]


def _pool_errors(mine: Pool, theirs: Pool) -> list[float]:
    """Mean over the cells of the error of each quantity, over its range, or over that of another with its unit."""
    known = lowered(theirs.basin, list(theirs.held.values()), mine.basin)
    share = mine.basin.mesh.area / mine.basin.mesh.area.sum()
    spans = np.ptp(known, axis=1)
    if known.shape[0] >= 3 and mine.basin.quantities:
        spans[1:3] = spans[1:3].max()  # flows along x and y
    return [float(np.sum(share * np.abs(one - other))) / span
            for one, other, span in zip(mine.held.values(), known, spans, strict=True) if span > STILL]  # fmt: skip


def averages(fine: np.ndarray, cells: int) -> np.ndarray:
    """Averages over `cells` equal cells from those over finer ones: differences of the cubic through their sums.

    Exact where every edge is also one of the finer cells.
    """
    if len(fine) % cells == 0:
        return fine.reshape(cells, -1).mean(axis=1)
    from scipy.interpolate import CubicSpline

    total = np.concatenate([[0.0], np.cumsum(fine)]) / len(fine)
    edges = np.linspace(0.0, 1.0, cells + 1)
    if len(total) < 4:
        return np.diff(np.interp(edges, np.linspace(0.0, 1.0, len(total)), total)) * cells
    return np.diff(CubicSpline(np.linspace(0.0, 1.0, len(total)), total)(edges)) * cells
