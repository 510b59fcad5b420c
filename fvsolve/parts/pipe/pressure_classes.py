"""Wall, bore and allowable pressure of pipe classes by nominal size.

Ductile iron, class K: nominal wall e = K (0.5 + 0.001 DN) mm, at least 6 mm; least wall e - (1.3 + 0.001 DN) mm.
Class C: least walls of EN 545:2010; the nominal wall is 1.3 + 0.001 DN mm more. Allowable pressure of K classes:
20 e R / (D S) bar, at most 64 bar, with e the least wall, D = DE - e, DE the outer diameter, R = 420 MPa the tensile
strength and S = 3 the safety factor. A C class has the pressure of its name. Polyethylene by SDR: e = d / SDR, d the
outer diameter, allowable pressure 20 MRS / (C (SDR - 1)) bar, MRS the minimum required strength [MPa] and C the design
coefficient; by PN: the wall with that allowable pressure.
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
STRENGTH, SAFETY = 420.0, 3.0  # tensile strength of ductile iron [MPa], and safety factor of EN 545
MAX_PRESSURE = 64.0  # greatest allowable pressure of K classes [bar]
MRS, DESIGN_COEFFICIENT = (
    {"PE80": 8.0, "PE100": 10.0},
    1.25,
)  # minimum required strength [MPa], and design coefficient C for water
SDR_RANGE = (6.0, 41.0)  # least and greatest SDR
BAR = 1e5

# DN, outer diameter and least walls of class 25, 30, 40, 50, 64, 100 [mm]; - is a size that is not in the brochure
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


class ClassSize(NamedTuple):
    """Data of a class at a nominal size: bore and wall thickness [m], allowable gauge pressure [Pa] or None, source."""

    diameter: float
    thickness: float
    pressure: float | None
    source: str


class UnknownSize(ValueError):
    """Error for a text that is not a nominal size of classes, such as "NPS 4"."""


@functools.cache
def ductile() -> dict[int, tuple[float, dict[int, float]]]:
    """Ductile iron pipes: DN -> (outer diameter, class -> least wall) [mm]."""
    sizes = {}
    for line in DUCTILE.strip().splitlines():
        size, outer, *walls = line.split()
        least = {pressure: float(wall) for pressure, wall in zip(PRESSURES, walls, strict=True) if wall != "-"}
        sizes[int(size)] = float(outer), least
    return sizes


IRON, PLASTIC = re.compile(r"(K|C|CLASS)(\d+)"), re.compile(r"(SDR|PN)(\d+(?:\.\d+)?)")
SCHEDULE = re.compile(r"(?:schedule|sch\.?)\s*(\w+)", re.IGNORECASE)


def class_size(name: str, nominal: str, material: str | None) -> ClassSize:
    """Size data of a class at a nominal size, for a material name or None.

    Raises ValueError for an unknown class, a class of another material or a size without data, UnknownSize for a text
    that is not a nominal size.
    """
    text = name.strip().upper().replace(" ", "")
    if match := IRON.fullmatch(text):
        if material != "ductile-iron":
            raise ValueError(f'{name} is a class of ductile iron; expected material = "ductile-iron"')
        return _ductile(match[1][0], int(match[2]), name, _size(nominal))
    if match := PLASTIC.fullmatch(text):
        return _plastic(match[1], float(match[2]), name, _size(nominal), material)
    raise ValueError(unknown_class(name))


def unknown_class(name: str) -> str | None:
    """Text of the fault if a name is not a class of any material; None for a known class."""
    text = name.strip().upper().replace(" ", "")
    if IRON.fullmatch(text) or PLASTIC.fullmatch(text) or SCHEDULE.fullmatch(name.strip()):
        return None
    known = ("K9", "C40", "SDR11", "PN16", "schedule 40")
    return f"unknown class {show(name)}{did_you_mean(name, known)}; expected for example {listing(known)}"


def _size(nominal: str) -> float:
    match = re.fullmatch(r"D[NE]?\s*(\d+(?:\.\d+)?)", nominal.strip(), re.IGNORECASE)
    if match is None:
        raise UnknownSize(f'{show(nominal)} is not a nominal size of a class; expected for example "DN300"')
    return float(match[1])


def _ductile(series: str, number: int, name: str, size: float) -> ClassSize:
    if size not in ductile():
        nearest = sorted(ductile(), key=lambda dn: abs(dn - size))[:3]
        raise ValueError(
            f"no data for DN{size:g} of ductile iron; the nearest sizes are {listing([f'DN{x}' for x in nearest])}"
        )
    (outer, walls), spare = ductile()[int(size)], 1.3 + 0.001 * size
    if series == "K":
        if not 7 <= number <= 14:
            raise ValueError(f"unknown class {show(name)}; expected K7 to K14")
        wall = max(number * (0.5 + 0.001 * size), 6.0)
        least = wall - spare
        allowable = min(20.0 * least * STRENGTH / ((outer - least) * SAFETY), MAX_PRESSURE)
        source = f"K{number} DN{size:g}: wall {wall:g} mm, K (0.5 + 0.001 DN), at least 6 mm; {K_SOURCES}"
    elif number not in walls:
        available = [f"C{pressure}" for pressure in walls]
        raise ValueError(f"no class {show(name)} of DN{size:g} in the catalogue; expected one of {listing(available)}")
    else:
        wall, allowable = walls[number] + spare, float(number)
        source = f"C{number} DN{size:g}: wall at least {walls[number]:g} mm, nominal wall {spare:g} mm more; {EN_545}"
    return ClassSize(1e-3 * (outer - 2.0 * wall), 1e-3 * wall, BAR * allowable, source)


def _plastic(series: str, number: float, name: str, size: float, material: str | None) -> ClassSize:
    strength = MRS.get(material or "")
    if series == "PN" and strength is None:
        raise ValueError(f"the wall of {name} is known only for {listing(list(MRS))}. Expected one of these "
                         'materials, or a class such as "SDR11" and the key `allowable_pressure`')  # fmt: skip
    ratio = number if series == "SDR" else 1.0 + 20.0 * strength / (DESIGN_COEFFICIENT * number)
    if not SDR_RANGE[0] <= ratio <= SDR_RANGE[1]:
        raise ValueError(
            f"{name} has SDR {ratio:g} (diameter over wall). Expected {SDR_RANGE[0]:g} to {SDR_RANGE[1]:g}"
        )
    wall = size / ratio
    allowable = None if strength is None else BAR * 20.0 * strength / (DESIGN_COEFFICIENT * (ratio - 1.0))
    source = f"{name} of {size:g} mm outer diameter: wall d / SDR, SDR {ratio:.4g}"
    source += f"; {PE_SOURCES}" if strength else "; no source for its allowable pressure"
    return ClassSize(1e-3 * (size - 2.0 * wall), 1e-3 * wall, allowable, source)
