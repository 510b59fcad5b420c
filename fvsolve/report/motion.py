"""The head line that moves: heads along a section at the times of the stored fields. Knows frames; draws nothing."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fvsolve.case.case import default_cells
from fvsolve.errors import RunError
from fvsolve.output.fields import read_pipes, read_series
from fvsolve.report.heads import in_units
from fvsolve.report.legs import SectionWay

POINTS = 240  # of a moving line at most
NUMBERS = 45_000  # of all moving lines of a report at most: frames give way


class Motion(NamedTuple):
    """A line at each time: chainages float64[n] [m], times float64[k] [s], heads float64[k, n] in their unit."""

    chainage: np.ndarray
    times: np.ndarray
    heads: np.ndarray


def motions(result, ways: Iterable[SectionWay]) -> list[Motion]:
    """The moving lines of sections, none where no frames were stored; RunError where one cannot be read."""
    ways, frames = list(ways), _frames(result)
    if not frames or not ways:
        return []
    counts = default_cells({name: result.case.links[name] for name in result.envelope}, result.case.properties,
                           result.case.numerics.cell_time)  # fmt: skip
    spots = [_spots(result, way, counts) for way in ways]
    many = sum(len(where) for _, where in spots)
    step = -(-len(frames) * many // NUMBERS)
    frames = [*frames[:-1:step], frames[-1]]
    heads = np.array([_heads(path, sum(counts.values())) for _, path in frames])
    shown = in_units(result, "greatest_head").from_si(heads)
    times = np.array([t for t, _ in frames])
    return [Motion(chainage, times, shown[:, where]) for chainage, where in spots]


def _frames(result) -> list[tuple[float, Path]]:
    """Times and files of the frames of pipes."""
    listed = None if result.directory is None else result.directory / "fields.pvd"
    if listed is None or not listed.is_file():
        return []
    return [(t, path) for t, path in read_series(listed) if path.stem.isdecimal()]


def _spots(result, way: SectionWay, counts: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Chainages of cells of a way, some evenly picked of many, and their numbers in a frame.

    counts : cells of all pipes, in the order of a frame
    """
    first = dict(zip(counts, np.cumsum([0, *counts.values()]).tolist(), strict=False))
    chainage, where = [], []
    for leg in way.legs:
        order, n = slice(None, None, -1 if leg.backwards else 1), counts[leg.pipe]
        x = (np.arange(n) + 0.5) * (leg.end - leg.begin) / n
        chainage.append(leg.chainage(x)[order])
        where.append(first[leg.pipe] + np.arange(n)[order])
    chainage, where = np.concatenate(chainage), np.concatenate(where)
    kept = np.unique(np.linspace(0, len(where) - 1, min(POINTS, len(where))).round().astype(int))
    return in_units(result, "distance").from_si(chainage[kept]), where[kept]


def _heads(path: Path, cells: int) -> np.ndarray:
    """Heads of all cells of pipes in a frame [m]."""
    heads = read_pipes(path, "head")
    if len(heads) != cells:
        raise RunError(f"{path} has {len(heads)} cells of pipes, the case {cells}; run again with --force")
    return heads
