"""Bore, wall, roughness and allowable pressure of a pipe from its material and class.

Values of the case file take precedence. The key `source`, if it is not given, lists the sources of all other values,
except those of steel schedules.
"""

from __future__ import annotations

from typing import Any

from fvsolve.parts.conduit import DARCY, KEYS_OF_MODEL, pipe_size
from fvsolve.parts.pipe.materials import Material, materials
from fvsolve.parts.pipe.pressure_classes import SCHEDULE, UnknownSize, class_size, unknown_class
from fvsolve.parts.value import ValueFault
from fvsolve.units import parse, show

STEELS = ("steel", "stainless-steel", "hydraulic-tube")
WALL_KEYS = ("youngs_modulus", "poisson_ratio")


def from_catalogue(given: dict[str, Any]) -> dict[str, Any]:
    """Table of a pipe, completed with the data of its material and class; raises ValueFault at the first fault."""
    name = given.get("material")
    material = materials().get(name) if isinstance(name, str) else None
    if material is None and "class" not in given and "lining" not in given:
        return given
    table, sources = {**given}, []
    if name is not None and material is None:  # reported where the key is read; nothing can be derived from it
        if isinstance(table.get("class"), str) and (text := unknown_class(table["class"])) is not None:
            raise ValueFault([(("class",), text)])
        return {key: value for key, value in with_substitutes(table).items() if key not in ("class", "nominal")}
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
        table["friction"] = friction if any(key in friction for key in DARCY) else {**friction, DARCY[0]: 1e-4}
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
        raise ValueFault([(("class",), f'{show(name)} needs a nominal size; give for example nominal = "DN300"')])
    try:
        size = class_size(name, nominal, material)
    except ValueError as error:
        raise ValueFault([(("nominal" if isinstance(error, UnknownSize) else "class",), str(error))]) from None
    del table["class"], table["nominal"]
    _size(table, size.diameter, size.thickness)
    if size.pressure is not None:
        table.setdefault("allowable_pressure", size.pressure)
    sources.append(size.source)


def _add_schedule(table: dict[str, Any], material: Material | None) -> None:
    """Replace nominal size and pipe schedule (default 40) of a steel pipe in its table by bore and wall thickness.

    Raises ValueFault if a material is given and is not a steel. Nothing is done for an unknown size.
    """
    if material is not None and material.name not in STEELS:
        raise ValueFault(
            [
                (
                    ("nominal",),
                    f"is a steel size without the key `class`; expected a class for {material.name}, or `diameter` and "
                    "a wall thickness instead of `nominal`",
                )
            ]
        )
    try:
        bore, thickness = pipe_size(table["nominal"], table.get("schedule", "40"))
    except ValueFault:
        return  # reported where the key is read
    del table["nominal"]
    table.pop("schedule", None)
    _size(table, bore, thickness)


def _size(table: dict[str, Any], bore: float, thickness: float) -> None:
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
    """Add Young's modulus and Poisson's ratio of the material to the wall of a pipe, if they are not given.

    sources : list to which the sources of these values are appended
    Do nothing if the wave speed is given; otherwise raise ValueFault if the wall thickness is missing.
    """
    wall = table.get("wall", {})
    if "wave_speed" in table or not isinstance(wall, dict):
        return
    if "thickness" not in wall:
        text = (f'wall thickness of {material.name} is missing. Give `nominal` together with `class` or `schedule`, '
                'or wall = { thickness = "8 mm" }, or wave_speed')  # fmt: skip
        raise ValueFault([(("material",), text)])
    table["wall"] = {**wall}
    for key in WALL_KEYS:
        if key not in wall and (figure := material.figures.get(key)) is not None:
            table["wall"][key] = figure.used
            sources.append(f"{material.name}: {figure.description}" if key == WALL_KEYS[0] else figure.description)


def _add_roughness(table: dict[str, Any], sources: list[str], material: Material) -> None:
    """Add the roughness of the material to an unlined pipe, if its friction model needs a roughness and none is given.

    sources : list to which the source of the value is appended
    """
    friction = table.get("friction")
    if not isinstance(friction, dict) or "lining" in table or any(key in friction for key in DARCY):
        return
    model = friction.get("model")
    if isinstance(model, str) and DARCY[0] in KEYS_OF_MODEL.get(model, ()) and "roughness" in material.figures:
        figure = material.figures["roughness"]
        table["friction"] = {**friction, "roughness": figure.used}
        sources.append(figure.description)
