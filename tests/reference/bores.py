"""Flow of air through the bores of an air valve by textbook formulas."""

from __future__ import annotations

import math

import numpy as np

from reference.scenes import AMBIENT, area

HEAT = 287.05 * 293.15
SMALL = (
    1e-3  # relative to upstream pressure: below it an odd quintic replaces the root, with two continuous derivatives
)
QUINTIC = np.linalg.solve([[1, 1, 1], [1, 3, 5], [0, 6, 20]], [1.0, 0.5, -0.25])


def softened(x: float) -> float:
    """Ratio of the softened root to sqrt(x): 1 from SMALL on, the odd quintic over sqrt(x) below."""
    s = x / SMALL
    return 1.0 if s >= 1.0 else float(QUINTIC @ [s, s**3, s**5]) / math.sqrt(s) if s > 0.0 else 0.0


def bores(p: float, inlet: float, outlet: float, soft=softened) -> float:
    """Mass flow of air into a chamber at p, subsonic or choked, in or out (Wylie and Streeter 1993, 7-4) [kg/s]."""
    root = math.sqrt(HEAT)
    if p <= AMBIENT:
        size, r, sign = 0.6 * area(inlet) * AMBIENT / root, p / AMBIENT, 1.0
    else:
        size, r, sign = 0.6 * area(outlet) * p / root, AMBIENT / p, -1.0
    if r < 0.528281787717174:
        return sign * size * math.sqrt(1.4) * (2 / 2.4) ** (2.4 / 0.8)
    return sign * size * math.sqrt(7 * max(0.0, r ** (2 / 1.4) - r ** (2.4 / 1.4))) * soft(1.0 - r)
