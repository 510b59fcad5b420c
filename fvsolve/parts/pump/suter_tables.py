"""Published Suter tables of pumps; the file data/suter_tables.toml has their numbers and sources."""

import functools
import math
from dataclasses import dataclass

from fvsolve.data import read_table

NAMES = ("radial-25", "radial-35", "mixed-94", "mixed-145", "axial-260")  # by rising specific speed


@dataclass(frozen=True)
class Quadrants:
    """Values of WH and WB at equal intervals of x from 0 to 2 pi, and the names of the published tables used.

    x = pi + atan2(v, n), with flow v and speed n over their rated values; head, torque : values of WH and WB
    words : names of the tables
    """

    head: tuple[float, ...]
    torque: tuple[float, ...]
    words: str


@functools.cache
def suter_tables() -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Values of WH and of WB of each published table : name -> (WH, WB)."""
    given = read_table("suter_tables")
    return {name: (tuple(given[name]["head"]), tuple(given[name]["torque"])) for name in NAMES}


def quadrants(speed: float) -> Quadrants:
    """Suter table for a specific speed [rpm, m3/s, m], interpolated between published tables over its logarithm.

    Outside their range it is the nearest table.
    """
    logs = [math.log(read_table("suter_tables")[name]["speed"]) for name in NAMES]
    place = min(max(math.log(speed), logs[0]), logs[-1])
    k = max(j for j in range(len(logs) - 1) if logs[j] <= place)
    share = (place - logs[k]) / (logs[k + 1] - logs[k])
    ends = suter_tables()[NAMES[k]], suter_tables()[NAMES[k + 1]]
    if share in (0.0, 1.0):
        return Quadrants(*ends[int(share)], NAMES[k + int(share)])
    head, torque = (
        tuple((1.0 - share) * a + share * b for a, b in zip(*pair, strict=True)) for pair in zip(*ends, strict=True)
    )
    return Quadrants(head, torque, f"{NAMES[k]} and {NAMES[k + 1]}")
