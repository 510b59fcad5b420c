"""Allievi's interlocking recursion for a reservoir, a frictionless pipe and a closing valve.

`d_k + d_(k-1) - 2 = 2 A (tau_(k-1) z_(k-1) - tau_k z_k)` at the times `t_k = 2 L k / a`, with
`A = rho a v / (2 dp)` from the velocity v and the drop dp of the valve in the steady start. `tau` is the opening
relative to that start, `d` the drop of the valve relative to dp, and `z |z| = d` (Allievi 1902; Wylie and
Streeter 1993). The recursion is also valid for reverse flow through the valve.
"""

from __future__ import annotations

import math
from collections.abc import Sequence


def relative_drop(parameter: float, opening: Sequence[float]) -> list[float]:
    """Drop of the valve at `t = 2 L k / a` over that at the start, for relative openings at these times."""
    z, drops = 1.0, [1.0]
    for before, now in zip(opening[:-1], opening[1:], strict=True):
        known = 2 + 2 * parameter * before * z - drops[-1]
        size = -parameter * now + math.sqrt((parameter * now) ** 2 + abs(known))
        z = math.copysign(size, known)
        drops.append(z * abs(z))
    return drops
