"""Bore, wall, roughness and allowable pressure of a pipe from its material and class.

Values of the case file take precedence. The key `source`, if it is not given, lists the sources of all other values,
except those of steel schedules.

Ductile iron, class K: nominal wall e = K (0.5 + 0.001 DN) mm, at least 6 mm; least wall e - (1.3 + 0.001 DN) mm.
Class C: least walls of EN 545:2010; the nominal wall is 1.3 + 0.001 DN mm more. Allowable pressure of K classes:
20 e R / (D S) bar, at most 64 bar, with e the least wall, D = DE - e, DE the outer diameter, R = 420 MPa the tensile
strength and S = 3 the safety factor. A C class has the pressure of its name. Polyethylene by SDR: e = d / SDR, d the
outer diameter, allowable pressure 20 MRS / (C (SDR - 1)) bar, MRS the minimum required strength [MPa] and C the design
coefficient; by PN: the wall with that allowable pressure.
"""

import functools
import re
from typing import Any, NamedTuple

from fvsolve.data import read_table
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.full_pipe import DARCY, KEYS_OF_MODEL, pipe_size
from fvsolve.parts.pipe.pipe_wall import HEAT_KEYS, OF_WALL, Material, materials
from fvsolve.parts.value import ValueFault
from fvsolve.units import parse, show

STEELS = ("steel", "stainless-steel", "hydraulic-tube")
WALL_KEYS = ("youngs_modulus", "poisson_ratio")
EN_545 = "EN 545:2010, brochure of Duktus"
K_SOURCES = "ISO 2531, EN 545: Winsen DCI, Dimensions and pressure ratings; Aquaflo and SLR Pipeline, tables of K9"
PE_SOURCES = "ISO 4427: PE100+ Association, SDR; Firat, PE pipe technical informations (MRS, C = 1.25 for water)"
STRENGTH, SAFETY = 420.0, 3.0  # tensile strength of ductile iron [MPa], and safety factor of EN 545
MAX_PRESSURE = 64.0  # greatest allowable pressure of K classes [bar]
MRS = {"PE80": 8.0, "PE100": 10.0}  # minimum required strength [MPa]
DESIGN_COEFFICIENT = 1.25  # C, for water
SDR_RANGE = (6.0, 41.0)  # least and greatest SDR
BAR = 1e5
IRON, PLASTIC = re.compile(r"(K|C|CLASS)(\d+)"), re.compile(r"(SDR|PN)(\d+(?:\.\d+)?)")
SCHEDULE = re.compile(r"(?:schedule|sch\.?)\s*(\w+)", re.IGNORECASE)


def from_catalogue(given: dict[str, Any]) -> dict[str, Any]:
    """Table of a pipe, completed with the data of its material and class; raises ValueFault at the first fault."""
    name = given.get("material")
    material = materials().get(name) if isinstance(name, str) else None
    if material is None and "class" not in given and "lining" not in given:
        return given
    table, sources = {**given}, []
    # reported where the key is read; nothing can be derived from it
    if name is not None and material is None:
        if (
            isinstance(table.get("class"), str)
            and (text := unknown_class(table["class"])) is not None
        ):
            raise ValueFault([(("class",), text)])
        return {
            key: value
            for key, value in with_substitutes(table).items()
            if key not in ("class", "nominal")
        }
    if not all(isinstance(table.get(key, ""), str) for key in ("class", "nominal")):
        return with_substitutes(table)  # reported where the keys are read
    if isinstance(table.get("class"), str):
        _add_class(table, sources, name if isinstance(name, str) else None)
    if isinstance(table.get("nominal"), str) and "diameter" not in table:
        _add_schedule(table, material)
    if material is not None:
        _add_wall(table, sources, material)
        _add_roughness(table, sources, material)
    if sources:
        table.setdefault("source", "; ".join(sources))
    return table


def with_substitutes(given: dict[str, Any]) -> dict[str, Any]:
    """Table of a pipe with placeholders for the bore, wall and roughness that follow from its material and class.

    It is used for wrong names, so that reading finds the other faults.
    """
    table = {**given}
    if not {"class", "nominal"}.isdisjoint(given):
        table["diameter"] = 1.0
    if isinstance(given.get("wall"), dict):
        table["wall"] = {WALL_KEYS[0]: 1e11, "thickness": 0.01, **given["wall"]}
    friction = given.get("friction")
    if isinstance(friction, dict) and DARCY[0] in KEYS_OF_MODEL.get(str(friction.get("model")), ()):
        table["friction"] = (
            friction if any(key in friction for key in DARCY) else {**friction, DARCY[0]: 1e-4}
        )
    return table


def _add_class(table: dict[str, Any], sources: list[str], material: str | None) -> None:
    """Add bore, wall and allowable pressure of the class of a pipe; replace a class that is a schedule by `schedule`.

    sources : list to which the source of the data is appended; material : name of the material, or None
    """
    name, nominal = table["class"], table.get("nominal")
    if (schedule := SCHEDULE.fullmatch(name.strip())) is not None:
        del table["class"]
        table["schedule"] = schedule[1]
        return
    if not isinstance(nominal, str):
        raise ValueFault(
            [(("class",), f'{show(name)} needs a nominal size; give for example nominal = "DN300"')]
        )
    try:
        size = class_size(name, nominal, material)
    except ValueError as error:
        raise ValueFault(
            [(("nominal" if isinstance(error, UnknownSize) else "class",), str(error))]
        ) from None
    del table["class"], table["nominal"]
    _add_size(table, size.diameter, size.thickness)
    if size.pressure is not None:
        table.setdefault("allowable_pressure", size.pressure)
    sources.append(size.source)


def _add_schedule(table: dict[str, Any], material: Material | None) -> None:
    """Replace nominal size and pipe schedule (default 40) of a steel pipe in its table by bore and wall thickness.

    Raises ValueFault if a material is given and is not a steel. Nothing is done for an unknown size.
    """
    if material is not None and material.name not in STEELS:
        text = (
            f"is a steel size without the key `class`; expected a class for {material.name}, or `diameter` and "
            "a wall thickness instead of `nominal`"
        )
        raise ValueFault([(("nominal",), text)])
    try:
        bore, thickness = pipe_size(table["nominal"], table.get("schedule", "40"))
    except ValueFault:
        return  # reported where the key is read
    del table["nominal"]
    table.pop("schedule", None)
    _add_size(table, bore, thickness)


def _add_size(table: dict[str, Any], bore: float, thickness: float) -> None:
    """Add the bore inside the lining, and the wall thickness if the wave speed follows from the wall.

    bore, thickness : of the pipe without lining [m]
    """
    try:
        lining = parse(table["lining"]["thickness"], "length")
    except (KeyError, TypeError, ValueError):  # no lining, or reported where the key is read
        lining = 0.0
    table["diameter"] = bore - 2.0 * lining
    wall = table.get("wall", {} if "material" in table and "wave_speed" not in table else None)
    if isinstance(wall, dict):
        table["wall"] = {"thickness": thickness, **wall}


def _add_wall(table: dict[str, Any], sources: list[str], material: Material) -> None:
    """Add elasticity of the material to the wall of a pipe, and density and specific heat for `retardation`.

    Values that are given remain.
    sources : list to which the sources of these values are appended
    Do nothing if the wave speed is given; otherwise raise ValueFault if the wall thickness is missing.
    """
    wall = table.get("wall", {})
    if "wave_speed" in table or not isinstance(wall, dict):
        return
    if "thickness" not in wall:
        text = (
            f"wall thickness of {material.name} is missing; give `nominal` together with `class` or `schedule`, "
            'or wall = { thickness = "8 mm" }, or wave_speed'
        )
        raise ValueFault([(("material",), text)])
    table["wall"] = {**wall}
    factors = table.get("retardation")
    heat = HEAT_KEYS if isinstance(factors, dict) and OF_WALL in factors.values() else ()
    for key in (*WALL_KEYS, *heat):
        if key not in wall and (figure := material.figures.get(key)) is not None:
            table["wall"][key] = figure.used
            sources.append(
                f"{material.name}: {figure.description}"
                if key == WALL_KEYS[0]
                else figure.description
            )


def _add_roughness(table: dict[str, Any], sources: list[str], material: Material) -> None:
    """Add the roughness of the material to an unlined pipe, if its friction model needs a roughness and none is given.

    sources : list to which the source of the value is appended
    """
    friction = table.get("friction")
    if not isinstance(friction, dict) or "lining" in table or any(key in friction for key in DARCY):
        return
    model = friction.get("model")
    if (
        isinstance(model, str)
        and DARCY[0] in KEYS_OF_MODEL.get(model, ())
        and "roughness" in material.figures
    ):
        figure = material.figures["roughness"]
        table["friction"] = {**friction, "roughness": figure.used}
        sources.append(figure.description)


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
    table, sizes = read_table("ductile_iron"), {}
    for size, (outer, *walls) in table["sizes"].items():
        least = {
            pressure: wall
            for pressure, wall in zip(table["classes"], walls, strict=True)
            if wall == wall
        }
        sizes[int(size)] = float(outer), least
    return sizes


def class_size(name: str, nominal: str, material: str | None) -> ClassSize:
    """Size data of a class at a nominal size, for a material name or None.

    Raises ValueError for an unknown class, a class of another material or a size without data, UnknownSize for a text
    that is not a nominal size.
    """
    text = name.strip().upper().replace(" ", "")
    if match := IRON.fullmatch(text):
        if material != "ductile-iron":
            raise ValueError(
                f'{name} is a class of ductile iron; expected material = "ductile-iron"'
            )
        return _ductile(match[1][0], int(match[2]), name, _nominal_size(nominal))
    if match := PLASTIC.fullmatch(text):
        return _plastic(match[1], float(match[2]), name, _nominal_size(nominal), material)
    raise ValueError(unknown_class(name))


def unknown_class(name: str) -> str | None:
    """Text of the fault if a name is not a class of any material; None for a known class."""
    text = name.strip().upper().replace(" ", "")
    if IRON.fullmatch(text) or PLASTIC.fullmatch(text) or SCHEDULE.fullmatch(name.strip()):
        return None
    known = ("K9", "C40", "SDR11", "PN16", "schedule 40")
    return f"unknown class {show(name)}{did_you_mean(name, known)}; expected for example {listing(known)}"


def _nominal_size(nominal: str) -> float:
    match = re.fullmatch(r"D[NE]?\s*(\d+(?:\.\d+)?)", nominal.strip(), re.IGNORECASE)
    if match is None:
        raise UnknownSize(
            f'{show(nominal)} is not a nominal size of a class; expected for example "DN300"'
        )
    return float(match[1])


def _ductile(series: str, number: int, name: str, size: float) -> ClassSize:
    if size not in ductile():
        nearest = sorted(ductile(), key=lambda dn: abs(dn - size))[:3]
        text = f"no data for DN{size:g} of ductile iron; the nearest sizes are {listing([f'DN{x}' for x in nearest])}"
        raise ValueError(text)
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
        raise ValueError(
            f"no class {show(name)} of DN{size:g} in the catalogue; expected one of {listing(available)}"
        )
    else:
        wall, allowable = walls[number] + spare, float(number)
        source = f"C{number} DN{size:g}: wall at least {walls[number]:g} mm, nominal wall {spare:g} mm more; {EN_545}"
    return ClassSize(1e-3 * (outer - 2.0 * wall), 1e-3 * wall, BAR * allowable, source)


def _plastic(series: str, number: float, name: str, size: float, material: str | None) -> ClassSize:
    strength = MRS.get(material or "")
    if series == "PN" and strength is None:
        raise ValueError(
            f"the wall of {name} is known only for {listing(list(MRS))}; expected one of these "
            'materials, or a class such as "SDR11" and the key `allowable_pressure`'
        )
    ratio = number if series == "SDR" else 1.0 + 20.0 * strength / (DESIGN_COEFFICIENT * number)
    if not SDR_RANGE[0] <= ratio <= SDR_RANGE[1]:
        text = f"{name} has SDR {ratio:g} (diameter over wall); expected {SDR_RANGE[0]:g} to {SDR_RANGE[1]:g}"
        raise ValueError(text)
    wall = size / ratio
    allowable = (
        None if strength is None else BAR * 20.0 * strength / (DESIGN_COEFFICIENT * (ratio - 1.0))
    )
    source = f"{name} of {size:g} mm outer diameter: wall d / SDR, SDR {ratio:.4g}"
    source += f"; {PE_SOURCES}" if strength else "; no source for its allowable pressure"
    return ClassSize(1e-3 * (size - 2.0 * wall), 1e-3 * wall, allowable, source)
