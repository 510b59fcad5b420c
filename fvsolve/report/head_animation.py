"""Animated head line: heads along a section at the times of the stored fields."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fvsolve.case.case import default_cells
from fvsolve.errors import RunError
from fvsolve.output.fields import read_pipes, read_series
from fvsolve.report.envelope_units import envelope_column
from fvsolve.report.section_pipes import SectionPath

MAX_POINTS = 240  # greatest number of points of an animated line
MAX_NUMBERS = 45_000  # greatest number of values of all animated lines of a report; frames are skipped above it


class HeadAnimation(NamedTuple):
    """Head along a section at several times.

    chainage : float64[n] and heads : float64[k, n], in the units of the envelope; times : float64[k] [s]
    """

    chainage: np.ndarray
    times: np.ndarray
    heads: np.ndarray


def head_animations(result, ways: Iterable[SectionPath]) -> list[HeadAnimation]:
    """Animated heads of the sections `ways`, with about `MAX_NUMBERS` values at most; [] if no frames were stored.

    Raises RunError if a frame cannot be read.
    """
    ways, frames = list(ways), _pipe_frames(result)
    if not frames or not ways:
        return []
    counts = default_cells({name: result.case.links[name] for name in result.envelope}, result.case.properties,
                           result.case.numerics.cell_time)  # fmt: skip
    spots = [_cells_along(result, way, counts) for way in ways]
    n = sum(len(indices) for _, indices in spots)
    step = -(-len(frames) * n // MAX_NUMBERS)
    frames = [*frames[:-1:step], frames[-1]]
    heads = np.array([_read_heads(path, sum(counts.values())) for _, path in frames])
    shown = envelope_column(result, "max_head").from_si(heads)
    times = np.array([t for t, _ in frames])
    return [HeadAnimation(chainage, times, shown[:, indices]) for chainage, indices in spots]


def _pipe_frames(result) -> list[tuple[float, Path]]:
    """Times [s] and files of the stored frames of pipes : list of (time, path)."""
    index = None if result.directory is None else result.directory / "fields.pvd"
    if index is None or not index.is_file():
        return []
    return [(t, path) for t, path in read_series(index) if path.stem.isdecimal()]


def _cells_along(result, way: SectionPath, counts: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """At most `MAX_POINTS` cells along a section, evenly chosen : (their chainages, their indices in a frame).

    counts : pipe -> number of its cells, in the order of a frame. Chainages are in the unit of the envelope.
    """
    first = dict(zip(counts, np.cumsum([0, *counts.values()]).tolist(), strict=False))
    chainage, indices = [], []
    for leg in way.legs:
        order, n = slice(None, None, -1 if leg.backwards else 1), counts[leg.pipe]
        x = (np.arange(n) + 0.5) * (leg.end - leg.begin) / n
        chainage.append(leg.chainage(x)[order])
        indices.append(first[leg.pipe] + np.arange(n)[order])
    chainage, indices = np.concatenate(chainage), np.concatenate(indices)
    picked = np.unique(np.linspace(0, len(indices) - 1, min(MAX_POINTS, len(indices))).round().astype(int))
    return envelope_column(result, "distance").from_si(chainage[picked]), indices[picked]


def _read_heads(path: Path, cells: int) -> np.ndarray:
    """Heads of all pipe cells in a frame [m]; raises RunError if their number differs from that of the case."""
    heads = read_pipes(path, "head")
    if len(heads) != cells:
        counts = f"number of pipe cells {len(heads)}, but {cells} in the case"
        raise RunError(f"{path}: {counts}; run the case again with --force")
    return heads
