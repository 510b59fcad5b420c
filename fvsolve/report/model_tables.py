"""Tables of the model: fluid, pipes, pipe walls and other parts, in the units of [output]."""

from typing import Any

from fvsolve.case.case import default_cells
from fvsolve.case.text import inline
from fvsolve.output.unit_columns import column
from fvsolve.parts.table_model import Table as Keys
from fvsolve.parts.table_model import plain_value
from fvsolve.parts.value import Quantity
from fvsolve.report.tables import ReportTable, value_text
from fvsolve.units import DIMENSIONS, UNITS

FULL_VALUES_NOTE = "in case.toml and in the workbook (--xlsx)"
MAX_VALUE_LENGTH = 120  # greatest number of letters of a value
FLUID_ROWS = (
    ("density", "density", "density"), ("bulk_modulus", "bulk modulus", "modulus"),
    ("sound_speed", "speed of sound", "velocity"), ("viscosity", "viscosity", "viscosity"),
    ("vapor_pressure", "vapour pressure", "pressure"),
)  # fmt: skip
# Keys in other columns, or only for pictures.
HIDDEN_KEYS = ("position", "elevation", "type", "from", "to", "ports", "scalars")


def all_tables(result) -> list[ReportTable | None]:
    """Tables of the fluid, pipes, walls and other parts; None instead of pipes or walls that the case lacks."""
    return [fluid(result), pipes(result), walls(result), parts(result)]


def fluid(result) -> ReportTable:
    """Table of the fluid: properties at the reference state, ambient pressure, gravity, density law and source."""
    case, liquid = result.case, result.summary["fluid"]
    rows = []
    for key, words, dimension in FLUID_ROWS:
        shown = _pressure_column(column(key, dimension, case), case)
        rows.append(
            [words, "unknown" if liquid[key] is None else value_text(float(shown.from_si(liquid[key]))), shown.unit]
        )
    ambient = column("", "pressure", case)
    rows.append(["ambient pressure", value_text(float(ambient.from_si(case.ambient_pressure))), ambient.unit])
    gravity = column("", "acceleration", case)
    rows.append(["gravity", value_text(float(gravity.from_si(case.gravity))), gravity.unit])
    rows += [["density law", case.fluid.law, ""], ["source", liquid["source"], ""]]
    return ReportTable(f"Fluid: {liquid['name']}", ("", "", ""), rows)


def pipes(result) -> ReportTable | None:
    """Table of pipes: ends, sizes, wave speed, friction and cells; None without pipes."""
    case = result.case
    links = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    if not links:
        return None
    cells = default_cells(links, case.properties, case.numerics.cell_time)
    length, height, speed = (column("", item, case) for item in ("length", "head", "velocity"))
    profiled = any(link.profile is not None for link in links.values())
    stated = case.elevations_stated or profiled
    rows = []
    for name, link in links.items():
        ends = [link.ports["from"], link.ports["to"]]
        sizes = [float(length.from_si(link.length)), float(length.from_si(link.diameter))]
        heights = [case.elevation(end) for end in ends] if link.profile is None else link.profile.elevation[[0, -1]]
        heights = [float(height.from_si(item)) for item in heights] if stated else []
        points = [None if link.profile is None else len(link.profile.chainage)] if profiled else []
        rows.append([name, *ends, *sizes, float(speed.from_si(case.wave_speed(name))), *heights, *points,
                     _friction_text(link, case), cells[name]])  # fmt: skip
    heads = [*["elevation at from", "at to"] * stated, *["points of profile"] * profiled]
    heads = ("pipe", "from", "to", "length", "diameter", "wave speed", *heads, "friction", "cells")
    units = ("", "", "", length.unit, length.unit, speed.unit, *[height.unit] * (2 * stated))
    return ReportTable("Pipes", heads, rows, units, more=FULL_VALUES_NOTE)


def walls(result) -> ReportTable | None:
    """Table of pipe walls: allowable pressure, thickness, modulus and source.

    The result is None if no pipe has an elastic wall or an allowable pressure.
    """
    case, rows = result.case, []
    thick, allowable = column("", "length", case), column("", "pressure", case)
    modulus = _pressure_column(column("", "modulus", case), case)
    for name, link in case.links.items():
        wall, allowed = getattr(link, "wall", None), getattr(link, "allowable_pressure", None)
        wall = None if wall == "rigid" else wall
        if wall is None and allowed is None:
            continue
        row = [name, None if allowed is None else float(allowable.span_from_si(allowed)), None, None, link.source or ""]
        if wall is not None:
            row[2:4] = float(thick.from_si(wall.thickness)), float(modulus.from_si(wall.youngs_modulus))
        rows.append(row)
    heads = ("pipe", "allowable", "wall", "modulus", "source")
    units = ("", allowable.span_unit, thick.unit, modulus.unit)
    return ReportTable("Walls", heads, rows, units, more=FULL_VALUES_NOTE) if rows else None


def _friction_text(link, case) -> str:
    text = _value_text(type(link).values()["friction"], plain_value(link.friction), case)
    return text.removeprefix("(model ").removesuffix(")")


def parts(result) -> ReportTable:
    """Table of all parts but pipes and plain junctions: kind, connected nodes, elevation and keys."""
    case, rows = result.case, []
    height, stated = column("", "head", case), case.elevations_stated
    for name, part in [*case.nodes.items(), *case.links.items()]:
        if part.kind == "pipe" or (part.kind == "junction" and part.table().get("demand") == 0.0):
            continue  # pipes have their own table; a junction without demand only connects pipes
        joins = ", ".join(map(str, getattr(part, "ports", {}).values()))
        lies = getattr(part, "elevation", None)
        lies = [None if lies is None else float(height.from_si(lies))] if stated else []
        rows.append([name, part.kind, joins, *lies, key_text(part, case)])
    heads = ("part", "kind", "connects", *["elevation"] * stated, "keys")
    return ReportTable("Other parts", heads, rows, ("", "", "", *[height.unit] * stated, ""), more=FULL_VALUES_NOTE)


def key_text(part: Keys, case) -> str:
    """Text with the keys of a part and their values, in the units of [output]."""
    values, texts = type(part).values(), []
    for key, value in part.table().items():
        if key not in HIDDEN_KEYS and value is not False and value not in ({}, []):
            texts.append(f"{key.replace('_', ' ')} {_value_text(values.get(key), value, case)}")
    return " \u00b7 ".join(texts)


def _value_text(value: Any, given: Any, case) -> str:
    """Text of the value of a key in the units of [output]; value : declaration of the key, given : its value in SI."""
    dimension = getattr(value, "dimension", None)
    if isinstance(given, dict):
        texts = [f"{key.replace('_', ' ')} {_value_text(_value_of_key(value, key), item, case)}"
                 for key, item in given.items()]  # fmt: skip
        text = f"({', '.join(texts)})"
    elif isinstance(given, bool) or isinstance(given, str):
        text = inline(given).strip('"')
    elif dimension is None or not _is_numeric(given):
        text = inline(given)
    else:
        shown = _pressure_column(column("", dimension, case), case)
        numbers = [float(shown.from_si(item)) for item in (given if isinstance(given, list) else [given])]
        joined = ", ".join(value_text(item) for item in numbers)
        unit = "" if dimension == "number" else f" {shown.unit}"
        text = f"[{joined}]{unit}" if isinstance(given, list) else f"{joined}{unit}"
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[: MAX_VALUE_LENGTH - 1]}\u2026"


def _value_of_key(value: Any, key: str) -> Any:
    """Declaration of the key `key` in a table with the declaration `value`; None if unknown.

    A key with the name of a dimension, such as the column `flow` of a curve, has this dimension.
    """
    for form in getattr(value, "forms", {}).values():
        if key in form:
            return form[key][0]
    try:
        result = value.below(key)
    except (AttributeError, KeyError):
        result = None
    return Quantity(key) if result is None and key in DIMENSIONS else result  # columns of a curve, such as `flow`


def _is_numeric(given: Any) -> bool:
    rows = given if isinstance(given, list) else [given]
    return all(isinstance(number, (int, float)) and not isinstance(number, bool) for number in rows)


def _pressure_column(shown, case):
    """Column `shown` with the unit of a pressure difference if its quantity is one: bar instead of barg.

    Such quantities are moduli and pressure drops; any other column is returned unchanged.
    """
    if shown.dimension in ("modulus", "pressure_drop") and (UNITS[shown.unit].gauge or UNITS[shown.unit].absolute):
        return column(shown.name, shown.dimension, case, shown.unit[:-1])
    return shown
