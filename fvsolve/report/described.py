"""The model as it was understood: pipes, other parts and the fluid, in the units of [output]. Knows declarations."""

from __future__ import annotations

from typing import Any

from fvsolve.case.case import default_cells
from fvsolve.case.text import inline
from fvsolve.output.column import column
from fvsolve.parts.table import Table as Keys
from fvsolve.parts.table import plain
from fvsolve.parts.value import Quantity
from fvsolve.report.tables import ReportTable, worded
from fvsolve.units import DIMENSIONS, UNITS

ELSEWHERE = "in case.toml and in the workbook (--xlsx)"
LONG = 120  # letters of a value
FLUID = (
    ("density", "density", "density"), ("bulk_modulus", "bulk modulus", "modulus"),
    ("sound_speed", "speed of sound", "velocity"), ("viscosity", "viscosity", "viscosity"),
    ("vapor_pressure", "vapour pressure", "pressure"),
)  # fmt: skip
SILENT = ("position", "elevation", "type", "from", "to", "ports", "scalars")  # keys that stand elsewhere, or draw


def model(result) -> list[ReportTable | None]:
    """All tables of this page, in order; None of what a case has not."""
    return [fluid(result), pipes(result), walls(result), parts(result)]


def fluid(result) -> ReportTable:
    """The liquid at its reference state, and where its numbers are from."""
    case, said = result.case, result.summary["fluid"]
    rows = []
    for key, words, dimension in FLUID:
        shown = _pressed(column(key, dimension, case), case)
        rows.append([words, "unknown" if said[key] is None else worded(float(shown.from_si(said[key]))), shown.unit])
    ambient = column("", "pressure", case)
    rows.append(["ambient pressure", worded(float(ambient.from_si(case.ambient_pressure))), ambient.unit])
    gravity = column("", "acceleration", case)
    rows.append(["gravity", worded(float(gravity.from_si(case.gravity))), gravity.unit])
    rows += [["density law", case.fluid.law, ""], ["source", said["source"], ""]]
    return ReportTable(f"Fluid: {said['name']}", ("", "", ""), rows)


def pipes(result) -> ReportTable | None:
    """Every pipe: its ends, sizes, wave speed, friction and cells."""
    case = result.case
    found = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    if not found:
        return None
    cells = default_cells(found, case.properties, case.numerics.cell_time)
    length, height, speed = (column("", one, case) for one in ("length", "head", "velocity"))
    profiled = any(link.profile is not None for link in found.values())
    stated = case.elevations_stated or profiled
    rows = []
    for name, link in found.items():
        ends = [link.ports["from"], link.ports["to"]]
        sizes = [float(length.from_si(link.length)), float(length.from_si(link.diameter))]
        heights = [case.elevation(end) for end in ends] if link.profile is None else link.profile.elevation[[0, -1]]
        heights = [float(height.from_si(one)) for one in heights] if stated else []
        points = [None if link.profile is None else len(link.profile.chainage)] if profiled else []
        rows.append([name, *ends, *sizes, float(speed.from_si(case.wave_speed(name))), *heights, *points,
                     _friction(link, case), cells[name]])  # fmt: skip
    heads = [*["elevation at from", "at to"] * stated, *["points of profile"] * profiled]
    heads = ("pipe", "from", "to", "length", "diameter", "wave speed", *heads, "friction", "cells")
    units = ("", "", "", length.unit, length.unit, speed.unit, *[height.unit] * (2 * stated))
    return ReportTable("Pipes", heads, rows, units, more=ELSEWHERE)


def walls(result) -> ReportTable | None:
    """What pipes bear, the wall they have, and whose figures these are; None where no pipe says any of it."""
    case, rows = result.case, []
    thick, bears = column("", "length", case), column("", "pressure", case)
    modulus = _pressed(column("", "modulus", case), case)
    for name, link in case.links.items():
        made, allowed = getattr(link, "wall", None), getattr(link, "allowable_pressure", None)
        made = None if made == "stiff" else made
        if made is None and allowed is None:
            continue
        row = [name, None if allowed is None else float(bears.span_from_si(allowed)), None, None, link.source or ""]
        if made is not None:
            row[2:4] = float(thick.from_si(made.thickness)), float(modulus.from_si(made.youngs_modulus))
        rows.append(row)
    heads, units = ("pipe", "bears", "wall", "modulus", "source"), ("", bears.span_unit, thick.unit, modulus.unit)
    return ReportTable("Walls", heads, rows, units, more=ELSEWHERE) if rows else None


def _friction(link, case) -> str:
    return _said(type(link).values()["friction"], plain(link.friction), case).removeprefix("(model ").removesuffix(")")


def parts(result) -> ReportTable:
    """Every other part: its kind, what it joins, and its keys."""
    case, rows = result.case, []
    height, stated = column("", "head", case), case.elevations_stated
    for name, part in [*case.nodes.items(), *case.links.items()]:
        if part.kind == "pipe" or (part.kind == "junction" and part.table().get("demand") == 0.0):
            continue  # pipes stand in a table of their own, and a joint is but where they meet
        joins = ", ".join(map(str, getattr(part, "ports", {}).values()))
        lies = getattr(part, "elevation", None)
        lies = [None if lies is None else float(height.from_si(lies))] if stated else []
        rows.append([name, part.kind, joins, *lies, keys(part, case)])
    heads = ("part", "kind", "joins", *["elevation"] * stated, "as understood")
    return ReportTable("Other parts", heads, rows, ("", "", "", *[height.unit] * stated, ""), more=ELSEWHERE)


def keys(part: Keys, case) -> str:
    """The keys of a part with their values in the units of [output]."""
    values, found = type(part).values(), []
    for key, value in part.table().items():
        if key not in SILENT and value is not False and value not in ({}, []):
            found.append(f"{key.replace('_', ' ')} {_said(values.get(key), value, case)}")
    return " \u00b7 ".join(found)


def _said(value: Any, given: Any, case) -> str:
    """What stands under a key, in words; `value` is what the key may be."""
    dimension = getattr(value, "dimension", None)
    if isinstance(given, dict):
        text = ", ".join(
            f"{key.replace('_', ' ')} {_said(_below(value, key), one, case)}" for key, one in given.items()
        )
        text = f"({text})"
    elif isinstance(given, bool) or isinstance(given, str):
        text = inline(given).strip('"')
    elif dimension is None or not _numbers(given):
        text = inline(given)
    else:
        shown = _pressed(column("", dimension, case), case)
        numbers = [float(shown.from_si(one)) for one in (given if isinstance(given, list) else [given])]
        joined = ", ".join(worded(one) for one in numbers)
        unit = "" if dimension == "number" else f" {shown.unit}"
        text = f"[{joined}]{unit}" if isinstance(given, list) else f"{joined}{unit}"
    return text if len(text) <= LONG else f"{text[: LONG - 1]}\u2026"


def _below(value: Any, key: str) -> Any:
    """What a key of a table may be; the values of a schedule are of its own dimension."""
    for form in getattr(value, "forms", {}).values():
        if key in form:
            return form[key][0]
    try:
        found = value.below(key)
    except (AttributeError, KeyError):
        found = None
    return Quantity(key) if found is None and key in DIMENSIONS else found  # of a curve: `flow`, `head`


def _numbers(given: Any) -> bool:
    rows = given if isinstance(given, list) else [given]
    return all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in rows)


def _pressed(shown, case):
    """A modulus in the unit of pressures without its zero point."""
    if shown.dimension in ("modulus", "pressure_drop") and (UNITS[shown.unit].gauge or UNITS[shown.unit].absolute):
        return column(shown.name, shown.dimension, case, shown.unit[:-1])
    return shown
