"""A pipe's material and class turned into bore, wall, roughness and allowable pressure. Knows keys; computes no wave.

What the file says itself stands; `source` gathers whose figures the others are.
"""

from __future__ import annotations

from typing import Any

from fvsolve.parts.conduit import sized
from fvsolve.parts.friction import DARCY, KEYS
from fvsolve.parts.pipe.classes import SCHEDULE, NoSize, no_class, rated
from fvsolve.parts.pipe.materials import Material, materials
from fvsolve.parts.value import Misfit
from fvsolve.units import parse, show

STEELS = ("steel", "stainless-steel", "hydraulic-tube")
OF_WALL = ("youngs_modulus", "poisson_ratio")


def from_catalogue(given: dict[str, Any]) -> dict[str, Any]:
    """The table of a pipe with what its material and class stand for, where it does not say it; Misfit with faults."""
    name = given.get("material")
    material = materials().get(name) if isinstance(name, str) else None
    if material is None and "class" not in given and "lining" not in given:
        return given
    found, said = {**given}, []
    if name is not None and material is None:  # blamed where it is read; nothing follows from it
        if isinstance(found.get("class"), str) and (text := no_class(found["class"])) is not None:
            raise Misfit([(("class",), text)])
        return {key: one for key, one in stood_in(found).items() if key not in ("class", "nominal")}
    if not all(isinstance(found.get(key, ""), str) for key in ("class", "nominal")):
        return stood_in(found)  # likewise
    if isinstance(found.get("class"), str):
        _add_class(found, said, name if isinstance(name, str) else None)
    if isinstance(found.get("nominal"), str) and "diameter" not in found:
        _add_schedule(found, material)
    if material is not None:
        _add_wall(found, said, material)
        _add_roughness(found, said, material)
    if said:
        found.setdefault("source", "; ".join(said))
    return found


def stood_in(given: dict[str, Any]) -> dict[str, Any]:
    """A table with a bore, wall and roughness in place of those that a name at fault would stand for."""
    found = {**given}
    if not {"class", "nominal"}.isdisjoint(given):
        found["diameter"] = 1.0
    if isinstance(given.get("wall"), dict):
        found["wall"] = {OF_WALL[0]: 1e11, "thickness": 0.01, **given["wall"]}
    friction = given.get("friction")
    if isinstance(friction, dict) and DARCY[0] in KEYS.get(str(friction.get("model")), ()):
        found["friction"] = friction if any(key in friction for key in DARCY) else {**friction, DARCY[0]: 1e-4}
    return found


def _add_class(found: dict[str, Any], said: list[str], material: str | None) -> None:
    """Bore, wall and allowable pressure of a class; a schedule stays one."""
    name, nominal = found["class"], found.get("nominal")
    if (schedule := SCHEDULE.fullmatch(name.strip())) is not None:
        del found["class"]
        found["schedule"] = schedule[1]
        return
    if not isinstance(nominal, str):
        raise Misfit([(("class",), f'{show(name)} is of a nominal size; give one too, nominal = "DN300"')])
    try:
        one = rated(name, nominal, material)
    except ValueError as error:
        raise Misfit([(("nominal" if isinstance(error, NoSize) else "class",), str(error))]) from None
    del found["class"], found["nominal"]
    _size(found, one.diameter, one.thickness)
    if one.pressure is not None:
        found.setdefault("allowable_pressure", one.pressure)
    said.append(one.source)


def _add_schedule(found: dict[str, Any], material: Material | None) -> None:
    """Bore and wall of steel by its nominal size."""
    if material is not None and material.name not in STEELS:
        raise Misfit([(("nominal",), f"is a schedule of steel; a size of {material.name} wants a class")])
    try:
        bore, thickness = sized(found["nominal"], found.get("schedule", "40"))
    except Misfit:
        return  # blamed where it is read
    del found["nominal"]
    found.pop("schedule", None)
    _size(found, bore, thickness)


def _size(found: dict[str, Any], bore: float, thickness: float) -> None:
    """The bore within the lining, and the wall where the waves are to follow from it."""
    try:
        lining = parse(found["lining"]["thickness"], "length")
    except (KeyError, TypeError, ValueError):  # none, or blamed where it is read
        lining = 0.0
    found["diameter"] = bore - 2.0 * lining
    wall = found.get("wall", {} if "material" in found and "wave_speed" not in found else None)
    if isinstance(wall, dict):
        found["wall"] = {"thickness": thickness, **wall}


def _add_wall(found: dict[str, Any], said: list[str], material: Material) -> None:
    """Modulus and Poisson's ratio of a wall that states none."""
    wall = found.get("wall", {})
    if "wave_speed" in found or not isinstance(wall, dict):
        return
    if "thickness" not in wall:
        text = (f'{material.name} of which thickness? give a class or schedule with nominal, wall = {{ thickness = '
                '"8 mm" }, or wave_speed')  # fmt: skip
        raise Misfit([(("material",), text)])
    found["wall"] = {**wall}
    for key in OF_WALL:
        if key not in wall and (figure := material.figures.get(key)) is not None:
            found["wall"][key] = figure.used
            said.append(f"{material.name}: {figure.said}" if key == OF_WALL[0] else figure.said)


def _add_roughness(found: dict[str, Any], said: list[str], material: Material) -> None:
    """Roughness of a wall that the flow touches, where friction asks for one and has none."""
    friction = found.get("friction")
    if not isinstance(friction, dict) or "lining" in found or any(key in friction for key in DARCY):
        return
    model = friction.get("model")
    if isinstance(model, str) and DARCY[0] in KEYS.get(model, ()) and "roughness" in material.figures:
        figure = material.figures["roughness"]
        found["friction"] = {**friction, "roughness": figure.used}
        said.append(figure.said)
