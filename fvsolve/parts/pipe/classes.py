"""What the class of a pipe stands for: wall, bore and allowable pressure by its nominal size. Knows no case.

Ductile iron, K: e = K (0.5 + 0.001 DN) mm, 6 mm at least, and e - (1.3 + 0.001 DN) mm at least stands. C: the least
walls of EN 545:2010, and 1.3 + 0.001 DN mm more as a rule. Both bear 20 e R / (D S) bar, D = DE - e with the least
wall, R = 420 MPa, S = 3; K classes 64 bar at most; a C class the pressure it is named for. Polyethylene by SDR: e = d /
SDR, d the outer diameter, bears 20 MRS / (C (SDR - 1)) bar; by PN the wall that bears it.
"""

from __future__ import annotations

import functools
import re
from typing import NamedTuple

from fvsolve.errors import did_you_mean, listing
from fvsolve.units import show

EN_545 = "EN 545:2010, brochure of Duktus"
K_SOURCES = "ISO 2531, EN 545: Winsen DCI, Dimensions and pressure ratings; Aquaflo and SLR Pipeline, tables of K9"
PE_SOURCES = "ISO 4427: PE100+ Association, SDR; Firat, PE pipe technical informations (MRS, C = 1.25 for water)"
STRENGTH, SAFETY = 420.0, 3.0  # of ductile iron [MPa], and the factor of EN 545
HIGHEST = 64.0  # bar, of K classes
MRS, DESIGN = {"PE80": 8.0, "PE100": 10.0}, 1.25  # least required strength [MPa] and C for water
SERIES = (6.0, 41.0)  # SDR of thick and of thin pipes
BAR = 1e5

# DN, outer diameter and least walls of class 25, 30, 40, 50, 64, 100 [mm]; - is none that the brochure has
DUCTILE = """
  80    98   -    -    3.0  3.5  4.0  4.7
 100   118   -    -    3.0  3.5  4.0  4.7
 125   144   -    -    3.0  3.5  4.0  5.0
 150   170   -    -    3.0  3.5  4.0  5.9
 200   222   -    -    3.1  3.9  5.0  7.7
 250   274   -    -    3.9  4.8  6.1  9.5
 300   326   -    -    4.6  5.7  7.3 11.2
 350   378   -    4.7  5.3  6.6  8.5 13.0
 400   429   -    4.8  6.0  7.5  9.6 14.8
 500   532   -    5.6  7.5  9.3 11.9 18.3
 600   635   -    6.7  8.9 11.1 14.2 21.9
 700   738   6.8  7.8 10.4 13.0 16.5  -
 800   842   7.5  8.9 11.9 14.8 18.8  -
 900   945   8.4 10.0 13.3 16.6  -    -
1000  1048   9.3 11.1 14.8 18.4  -    -
"""
PRESSURES = (25, 30, 40, 50, 64, 100)


class Rated(NamedTuple):
    """What a class stands for: bore and wall [m], allowable pressure [Pa, gauge] where known, and whose words it is."""

    diameter: float
    thickness: float
    pressure: float | None
    source: str


class NoSize(ValueError):
    """A nominal size that is none of a class."""


@functools.cache
def ductile() -> dict[int, tuple[float, dict[int, float]]]:
    """DN -> (outer diameter, class -> least wall) [mm]."""
    found = {}
    for line in DUCTILE.strip().splitlines():
        size, outer, *walls = line.split()
        least = {pressure: float(one) for pressure, one in zip(PRESSURES, walls, strict=True) if one != "-"}
        found[int(size)] = float(outer), least
    return found


IRON, PLASTIC = re.compile(r"(K|C|CLASS)(\d+)"), re.compile(r"(SDR|PN)(\d+(?:\.\d+)?)")
SCHEDULE = re.compile(r"(?:schedule|sch\.?)\s*(\w+)", re.IGNORECASE)


def rated(name: str, nominal: str, material: str | None) -> Rated:
    """What a class is at a nominal size; ValueError for what is not made or was not read."""
    text = name.strip().upper().replace(" ", "")
    if found := IRON.fullmatch(text):
        if material != "ductile-iron":
            raise ValueError(f'{name} is a class of ductile iron; wanted material = "ductile-iron"')
        return _ductile(found[1][0], int(found[2]), name, _size(nominal))
    if found := PLASTIC.fullmatch(text):
        return _plastic(found[1], float(found[2]), name, _size(nominal), material)
    raise ValueError(no_class(name))


def no_class(name: str) -> str | None:
    """What is said of a name that is that of no class, whatever the material; None of others."""
    text = name.strip().upper().replace(" ", "")
    if IRON.fullmatch(text) or PLASTIC.fullmatch(text) or SCHEDULE.fullmatch(name.strip()):
        return None
    known = ("K9", "C40", "SDR11", "PN16", "schedule 40")
    return f"no class named {show(name)}{did_you_mean(name, known)}; wanted one such as {listing(known)}"


def _size(nominal: str) -> float:
    found = re.fullmatch(r"D[NE]?\s*(\d+(?:\.\d+)?)", nominal.strip(), re.IGNORECASE)
    if found is None:
        raise NoSize(f'{show(nominal)} is no nominal size of a class; wanted for example "DN300"')
    return float(found[1])


def _ductile(sort: str, number: int, name: str, size: float) -> Rated:
    if size not in ductile():
        near = sorted(ductile(), key=lambda one: abs(one - size))[:3]
        raise ValueError(
            f"DN{size:g} of ductile iron was not read; the nearest are {listing([f'DN{x}' for x in near])}"
        )
    (outer, walls), spare = ductile()[int(size)], 1.3 + 0.001 * size
    if sort == "K":
        if not 7 <= number <= 14:
            raise ValueError(f"no class {show(name)}; K goes from 7 to 14")
        wall = max(number * (0.5 + 0.001 * size), 6.0)
        least = wall - spare
        bears = min(20.0 * least * STRENGTH / ((outer - least) * SAFETY), HIGHEST)
        said = f"K{number} DN{size:g}: wall {wall:g} mm, K (0.5 + 0.001 DN), 6 at least; {K_SOURCES}"
    elif number not in walls:
        made = [f"C{one}" for one in walls]
        raise ValueError(f"no class {show(name)} of DN{size:g} was read; there are {listing(made)}")
    else:
        wall, bears = walls[number] + spare, float(number)
        said = f"C{number} DN{size:g}: wall {walls[number]:g} mm at least, {spare:g} mm more as a rule; {EN_545}"
    return Rated(1e-3 * (outer - 2.0 * wall), 1e-3 * wall, BAR * bears, said)


def _plastic(sort: str, number: float, name: str, size: float, material: str | None) -> Rated:
    strength = MRS.get(material or "")
    if sort == "PN" and strength is None:
        raise ValueError(f"what wall bears {name} was read of {listing(list(MRS))} alone; wanted such a material, or "
                         "the SDR and allowable_pressure")  # fmt: skip
    ratio = number if sort == "SDR" else 1.0 + 20.0 * strength / (DESIGN * number)
    if not SERIES[0] <= ratio <= SERIES[1]:
        raise ValueError(f"{name} is an outer diameter of {ratio:g} walls; wanted {SERIES[0]:g} to {SERIES[1]:g}")
    wall = size / ratio
    bears = None if strength is None else BAR * 20.0 * strength / (DESIGN * (ratio - 1.0))
    said = f"{name} of {size:g} mm outside: wall d / SDR, SDR {ratio:.4g}"
    said += f"; {PE_SOURCES}" if strength else "; of what it bears no source was read"
    return Rated(1e-3 * (size - 2.0 * wall), 1e-3 * wall, bears, said)
