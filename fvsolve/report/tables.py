"""Report tables: words and numbers under headers with units, aligned at the decimal points; contents of all tables.

Tables of the model are in the units of [output]: fluid, pipes, pipe walls and other parts. Sentences and tables of a
run are verdicts, extremes, method, ledgers, events and versions.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case.case import default_cells
from fvsolve.case.text import inline
from fvsolve.core.output.result_table import ResultTable
from fvsolve.core.output.summary_shape import FAILS, HOLDS, IN_WORDS, OPEN
from fvsolve.core.output.unit_columns import UnitColumn, column
from fvsolve.core.run.result import not_valid
from fvsolve.errors import visible
from fvsolve.parts.nodes_and_links import kind_text
from fvsolve.parts.table_model import plain_value
from fvsolve.parts.value import Quantity
from fvsolve.report.long_section import SectionPath, envelope_column
from fvsolve.units import DIMENSIONS, span

DIGITS = 5  # significant digits of the greatest number of a column
DECIMALS = 6  # greatest number of decimals, unless the least number of the column needs more
# greatest number of digits after the first if all numbers of a column have the same decimals
MAX_SHARED_DIGITS = 7
ERROR_HEADER = "\u00b1"  # header of columns of errors, shown with two digits
# Spaces: between thousands, as wide as a digit, as wide as a point.
NARROW_SPACE, FIGURE_SPACE, POINT_SPACE = "\u202f", "\u2007", "\u2008"


# decimal sign of the numbers of a page, see `[report] decimal`
_DECIMAL: ContextVar[str] = ContextVar("decimal sign", default=".")


def decimal_sign() -> str:
    """Decimal sign of the numbers of the page that is written."""
    return _DECIMAL.get()


@contextmanager
def with_decimal_sign(sign: str) -> Iterator[None]:
    """Write numbers with another decimal sign within a `with` block. sign : a point or a comma"""
    token = _DECIMAL.set(sign)
    try:
        yield
    finally:
        _DECIMAL.reset(token)


def in_unit(unit_column, value: float | None) -> float | None:
    """Convert a number from SI to the unit of a column; None is returned unchanged."""
    return None if value is None else float(unit_column.from_si(value))


def page_rows(table: ResultTable) -> list[list[str]]:
    """Texts of the cells in the rows of a table that a page shows, aligned by column."""
    columns = []
    values = table.values[: table.most]
    for k, entry in enumerate(table.columns):
        shown = [row[k] for row in values]
        if entry.name == ERROR_HEADER:
            shown = [float(f"{value:.2g}") if is_number(value) else value for value in shown]
        columns.append(aligned_texts(shown, entry.mixed))
    return [list(row) for row in zip(*columns, strict=True)]


def numeric_columns(table: ResultTable) -> list[bool]:
    """List with True for each column that contains numbers and no words; it is then aligned to the right."""
    columns = [*zip(*table.values, strict=True)] or [()] * len(table.columns)
    return [
        any(map(is_number, cells)) and not any(isinstance(value, str) for value in cells)
        for cells in columns
    ]


def left_out(table: ResultTable) -> str:
    """Note below a table that has more rows than the page shows; "" if all rows are shown."""
    hidden = len(table.rows) - table.most
    text = (
        f"{hidden} more row{'' if hidden == 1 else 's'}: {table.more or 'in the workbook (--xlsx)'}"
    )
    return text if hidden > 0 else ""


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def aligned_texts(values: Sequence[Any], loose: bool = False) -> list[str]:
    """Texts of the values of a column, padded so that decimal points align.

    loose : True if the rows have different units, so that numbers may have different numbers of decimals
    """
    places = None if loose else decimal_places([value for value in values if is_number(value)])
    words = [value_text(value, places) for value in values]
    behind = [
        text.partition(decimal_sign())[1:]
        for text, value in zip(words, values, strict=True)
        if is_number(value)
    ]
    widest = max((len(rest) for point, rest in behind if point), default=-1)
    if widest < 0:
        return words
    for k, value in enumerate(values):
        if is_number(value) or value is None:
            _, point, rest = words[k].partition(decimal_sign())
            words[k] += ("" if point else POINT_SPACE) + FIGURE_SPACE * (widest - len(rest))
    return words


def decimal_places(numbers: Sequence[float]) -> int | None:
    """Number of decimals of all numbers in a column; None if they differ too much in size for a common number."""
    sizes = [abs(size) for size in numbers if math.isfinite(size) and size != 0.0]
    if not sizes:
        return 0
    top = math.floor(math.log10(max(sizes)))
    places = min(max(DIGITS - 1 - top, 0), DECIMALS)
    least = (
        0
        if all(float(size).is_integer() for size in sizes)
        else 1 - math.floor(math.log10(min(sizes)))
    )
    places = max(places, least)
    if top > 9 or top + places > MAX_SHARED_DIGITS:
        return None
    texts = [f"{size:.{places}f}" for size in sizes]
    while places and all(text.endswith("0") for text in texts):
        texts, places = [text[:-1] for text in texts], places - 1
    return places


def value_text(value: Any, places: int | None = None) -> str:
    """Text of a value; a number has `places` decimals, or if that is None `DIGITS` significant digits.

    The text of None and of numbers that are not finite is an en dash.
    """
    if value is None or is_number(value) and not math.isfinite(value):
        return "\u2013"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not is_number(value):
        return visible(str(value))
    text = _digits(value) if places is None else f"{value:,.{places}f}"
    text = text if text.strip("-0.,") else text.lstrip("-")  # no minus sign before zero
    text = text if abs(value) >= 1e4 else text.replace(",", "")
    text = text.replace(",", NARROW_SPACE).replace("-", "\u2212")
    return text.replace(".", decimal_sign())


def _digits(value: float) -> str:
    if isinstance(value, int) or value == 0.0:
        return f"{value:,.0f}"
    top = math.floor(math.log10(abs(value)))
    if not -4 <= top <= 9:
        return f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")
    text = f"{value:,.{max(DIGITS - 1 - top, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


FULL_VALUES_NOTE = "in case.toml and in the workbook (--xlsx)"
MAX_VALUE_LENGTH = 120  # greatest number of letters of a value
FLUID_ROWS = (
    ("density", "density", "density"),
    ("bulk_modulus", "bulk modulus", "modulus"),
    ("sound_speed", "speed of sound", "velocity"),
    ("viscosity", "viscosity", "viscosity"),
    ("vapor_pressure", "vapour pressure", "pressure"),
)
# Keys in other columns, or only for pictures.
HIDDEN_KEYS = ("position", "elevation", "type", "from", "to", "ports", "scalars")


def model_tables(result) -> list[ResultTable | None]:
    """Tables of the fluid, pipes, walls and other parts; None instead of pipes or walls that the case lacks."""
    return [fluid(result), pipes(result), walls(result), parts(result)]


def fluid(result) -> ResultTable:
    """Table of the fluid: properties at the reference state, ambient pressure, gravity, density law and source."""
    case, liquid = result.case, result.summary["fluid"]
    rows = []
    for key, words, dimension in FLUID_ROWS:
        shown = _pressure_column(column(key, dimension, case), case)
        value = "unknown" if liquid[key] is None else value_text(float(shown.from_si(liquid[key])))
        rows.append([words, value, shown.unit])
    ambient = column("", "pressure", case)
    rows.append(
        [
            "ambient pressure",
            value_text(float(ambient.from_si(case.ambient_pressure))),
            ambient.unit,
        ]
    )
    gravity = column("", "acceleration", case)
    rows.append(["gravity", value_text(float(gravity.from_si(case.gravity))), gravity.unit])
    rows += [["density law", case.fluid.law, ""], ["source", liquid["source"], ""]]
    return ResultTable.of(f"Fluid: {liquid['name']}", ("", "", ""), rows)


def pipes(result) -> ResultTable | None:
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
        heights = (
            [case.elevation(end) for end in ends]
            if link.profile is None
            else link.profile.elevation[[0, -1]]
        )
        heights = [float(height.from_si(item)) for item in heights] if stated else []
        points = [None if link.profile is None else len(link.profile.chainage)] if profiled else []
        friction = key_text(type(link).values()["friction"], plain_value(link.friction), case)
        friction = friction.removeprefix("(model ").removesuffix(")")
        wave_speed = float(speed.from_si(case.wave_speed(name)))
        rows.append([name, *ends, *sizes, wave_speed, *heights, *points, friction, cells[name]])
    heads = [*["elevation at from", "at to"] * stated, *["points of profile"] * profiled]
    heads = ("pipe", "from", "to", "length", "diameter", "wave speed", *heads, "friction", "cells")
    units = ("", "", "", length.unit, length.unit, speed.unit, *[height.unit] * (2 * stated))
    return ResultTable.of("Pipes", heads, rows, units, more=FULL_VALUES_NOTE)


def walls(result) -> ResultTable | None:
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
        row = [
            name,
            None if allowed is None else float(allowable.span_from_si(allowed)),
            None,
            None,
            link.source or "",
        ]
        if wall is not None:
            row[2:4] = (
                float(thick.from_si(wall.thickness)),
                float(modulus.from_si(wall.youngs_modulus)),
            )
        rows.append(row)
    heads = ("pipe", "allowable", "wall", "modulus", "source")
    units = ("", allowable.span_unit, thick.unit, modulus.unit)
    return ResultTable.of("Walls", heads, rows, units, more=FULL_VALUES_NOTE) if rows else None


def parts(result) -> ResultTable:
    """Table of all parts but pipes and plain junctions: kind, connected nodes, elevation and keys."""
    case, rows = result.case, []
    height, stated = column("", "head", case), case.elevations_stated
    nodes = [(name, node) for name, node in case.nodes.items() if not node.added]
    for name, part in [*nodes, *case.links.items()]:
        if part.kind == "pipe" or (part.kind == "junction" and part.table().get("demand") == 0.0):
            continue  # pipes have their own table; a junction without demand only connects pipes
        joins = ", ".join(map(str, getattr(part, "ports", {}).values()))
        lies = getattr(part, "elevation", None)
        lies = [None if lies is None else float(height.from_si(lies))] if stated else []
        values, texts = type(part).values(), []
        for key, value in part.table().items():
            if key not in HIDDEN_KEYS and value is not False and value not in ({}, []):
                texts.append(f"{key.replace('_', ' ')} {key_text(values.get(key), value, case)}")
        rows.append([name, kind_text(part), joins, *lies, " \u00b7 ".join(texts)])
    heads = ("part", "kind", "connects", *["elevation"] * stated, "keys")
    return ResultTable.of(
        "Other parts", heads, rows, ("", "", "", *[height.unit] * stated, ""), more=FULL_VALUES_NOTE
    )


def key_text(value: Any, given: Any, case) -> str:
    """Text of the value of a key in the units of [output]; value : declaration of the key, given : its value in SI."""
    dimension = getattr(value, "dimension", None)
    if isinstance(given, dict):
        texts = [
            f"{key.replace('_', ' ')} {key_text(_value_of_key(value, key), item, case)}"
            for key, item in given.items()
        ]
        text = f"({', '.join(texts)})"
    elif isinstance(given, bool) or isinstance(given, str):
        text = inline(given).strip('"')
    elif dimension is None or not all(
        map(is_number, given if isinstance(given, list) else [given])
    ):
        text = inline(given)
    else:
        shown = _pressure_column(column("", dimension, case), case)
        numbers = [
            float(shown.from_si(item)) for item in (given if isinstance(given, list) else [given])
        ]
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
    # columns of a curve, such as `flow`
    return Quantity(key) if result is None and key in DIMENSIONS else result


def _pressure_column(shown, case):
    """Column `shown` with the unit of a pressure difference if its quantity is one: bar instead of barg.

    Such quantities are moduli and pressure drops; any other column is returned unchanged.
    """
    if shown.dimension in ("modulus", "pressure_drop") and span(shown.unit) != shown.unit:
        return column(shown.name, shown.dimension, case, span(shown.unit))
    return shown


BOUND_WORDS = {"minimum": "at\u00a0least", "maximum": "at\u00a0most"}
MAX_LATER_MARKS = 6  # greatest number of marks named after the first
MAX_RANKED = 10  # greatest number of rows of a ranking on the page
EXTREMES = (  # quantity, its text, function of the index of the extreme, quantity of its time
    ("max_pressure", "maximum pressure", np.argmax, "t_max"),
    ("min_pressure", "minimum pressure", np.argmin, "t_min"),
    ("max_head", "maximum head", np.argmax, "t_max"),
    ("min_head", "minimum head", np.argmin, "t_min"),
)
# units of ledgers; ledgers of scalars, in kg times their unit, show none
LEDGER_UNITS = {"mass": "kg", "energy": "J"}
LEDGER_TERMS = ("initial", "inflow", "outflow", "heated", "spilled", "made_up", "final")


class Sentence(NamedTuple):
    """Sentence at the top of a report.

    level : "bad", "doubt", "good" or "none"; head : first words, in bold; links : (name, address) of pages
    """

    level: str
    head: str
    text: str
    links: tuple[tuple[str, str], ...] = ()


def top_sentences(result) -> list[Sentence]:
    """Sentences at the top of a report: early stop, errors, doubts, verdict on limits, failed or open expectations."""
    summary = result.summary
    rows = []
    if result.reason != "finished":
        reached, end = (
            result.case.moment(item) for item in (summary["t"], result.case.numerics.end)
        )
        text = f"{result.reason}. The run reached t = {reached} of {end}; later values are unknown."
        rows.append(Sentence("bad", "This run stopped early.", text))
    rows += [
        Sentence("bad", "Not to be trusted.", item.text) for item in result.warnings if not item.ok
    ]
    rows += [*_mark_sentences(result), verdict_sentence(result)]
    for state, level, head in (
        (FAILS, "bad", "The run does not meet an expected value of the case."),
        (OPEN, "doubt", "The verdict of an expected value is open."),
    ):
        if claims := [item for item in result.expectations if item.state == state]:
            first = claims[0]
            claimed, found = value_text(first.claimed), value_text(first.found)
            text = f"{first.text}: expected {claimed}, computed {found} {first.unit}"
            more = f"; and {len(claims) - 1} more, under Numerics" if len(claims) > 1 else ""
            rows.append(Sentence(level, head, text + more))
    return rows


def _mark_sentences(result) -> list[Sentence]:
    """List of one sentence on the time from which results are not valid, the first mark and the places of later marks.

    It is empty without marks.
    """
    marks = sorted(result.marks, key=lambda mark: mark.time)
    if not marks:
        return []
    when = [result.case.moment(mark.time) for mark in marks]
    places = [f"{mark.place.partition('.')[2]} at {t}" for mark, t in zip(marks, when, strict=True)]
    later = ", ".join(places[1 : 1 + MAX_LATER_MARKS])
    more = (
        f", and {len(marks) - 1 - MAX_LATER_MARKS} more places"
        if len(marks) > 1 + MAX_LATER_MARKS
        else ""
    )
    text = marks[0].text + (f". Later also {later}{more}" if later else "")
    return [Sentence("doubt", f"Results from {when[0]} on are not to be trusted.", text)]


WITHOUT_ERROR = "Numerical errors were not estimated (run --estimate-error)."


def verdict_sentence(result) -> Sentence:
    """Sentence on the limits of the case: some are violated, some are open, all hold, or none is stated."""
    verdicts = result.verdicts
    if not verdicts:
        text = "The case has no [limits], so this report shows what happens, but not whether this is allowed."
        return Sentence("none", "No limits were stated.", text)
    states = [item.state for item in verdicts]
    failed = [item.name for item, state in zip(verdicts, states, strict=True) if state == FAILS]
    if failed:
        text = f"{len(failed)} of {len(verdicts)} limits" if len(verdicts) > 1 else "The limit"
        return Sentence(
            "bad", f"{text} {'do' if len(failed) > 1 else 'does'} not hold.", ", ".join(failed)
        )
    unsure = [item.name for item, state in zip(verdicts, states, strict=True) if state == OPEN]
    if unsure:
        return Sentence(
            "doubt",
            f"The verdict of {'limits' if len(unsure) > 1 else 'a limit'} is open.",
            f"{', '.join(unsure)}: {open_reason(result)}.",
        )
    summary = f"All {len(verdicts)} limits hold" if len(verdicts) > 1 else "The limit holds"
    if result.reason == "finished" and result.ok and not result.marks:
        return Sentence(
            "good", f"{summary}.", "" if "resolution" in result.summary else WITHOUT_ERROR
        )
    return Sentence("doubt", f"{summary}, as far as results are reliable.", "")


def open_reason(result) -> str:
    """Reason for which the limits of a run are open (undecided), as a part of a sentence."""
    if text := not_valid(result.summary):
        return f"the run is {text}"
    if not result.ok:
        return "the run stopped early or its numbers are wrong"
    if result.marks:
        return "from some time on the results are not to be trusted"
    if any(notice.kind == "end" for notice in result.warnings):
        return "a schedule continues, or a trip occurs, after the end of the run"
    return "margins are smaller than the numerical errors"


def verdict_table(result) -> ResultTable:
    """Table of the verdicts on limits, violated limits first."""
    order = (FAILS, OPEN, HOLDS)
    ordered = sorted(result.verdicts, key=lambda check: order.index(check.state))
    length, height, time = (
        column("", dimension, result.case) for dimension in ("length", "head", "time")
    )
    errors = any(check.error is not None for check in ordered)
    rows = []
    for check in ordered:
        limit = f"{value_text(check.limit)} {check.unit}"
        requirement = f"{check.quantity.replace('_', ' ')} {BOUND_WORDS[check.bound]} {limit}"
        margin_unit = span(check.unit)
        unit_text = (
            check.unit if margin_unit == check.unit else f"{check.unit}, margin {margin_unit}"
        )
        place = (
            in_unit(length, check.chainage),
            in_unit(height, check.elevation),
            in_unit(time, check.time),
        )
        margin = not_valid(result.summary) or None if check.margin is None else check.margin
        rows.append(
            [
                check.name,
                requirement,
                IN_WORDS[check.state],
                check.value,
                *[check.error] * errors,
                margin,
                unit_text,
                check.place,
                *place,
            ]
        )
    heads = (
        "limit",
        "requirement",
        "verdict",
        "value",
        *[ERROR_HEADER] * errors,
        "margin",
        "unit",
        "worst place",
    )
    heads += ("chainage", "elevation", "time")
    bad = frozenset(k for k, check in enumerate(ordered) if check.state == FAILS)
    units = ("",) * (7 + errors) + (length.unit, height.unit, time.unit)
    return ResultTable.of("Limits", heads, rows, units, bad, frozenset({3, 4, *[5] * errors}))


def worst_tables(result) -> list[ResultTable]:
    """Tables of the positions with the least margins, for each limit with more than one part or bound."""
    length, height, time = (
        column("", dimension, result.case) for dimension in ("length", "head", "time")
    )
    tables = []
    for check in result.verdicts:
        keys = ((length, "chainage"), (height, "elevation"), (time, "time"))
        errors = any(row["error"] is not None for row in check.worst)
        rows = [
            [
                row["place"],
                *(in_unit(shown, row[key]) for shown, key in keys),
                row["value"],
                *[row["error"]] * errors,
                BOUND_WORDS[row["bound"]],
                row["limit"],
                row["margin"],
                IN_WORDS[row["state"]],
            ]
            for row in check.worst
        ]
        bad = frozenset(k for k, row in enumerate(check.worst) if row["state"] == FAILS)
        margin_unit = span(check.unit)
        units = (
            "",
            length.unit,
            height.unit,
            time.unit,
            check.unit,
            *[margin_unit] * errors,
            "",
            check.unit,
            margin_unit,
            "",
        )
        heads = (
            "place",
            "chainage",
            "elevation",
            "time",
            check.quantity.replace("_", " "),
            *[ERROR_HEADER] * errors,
        )
        heads += ("", "limit", "margin", "verdict")
        if len(rows) > 1:
            tables.append(
                ResultTable.of(f"Limit {check.name}: worst places", heads, rows, units, bad)
            )
    return tables


def claim_table(result) -> ResultTable:
    """Table of the expected values of the case and of the computed values."""
    rows = [
        [item.text, item.claimed, item.found, item.tolerance, item.unit, IN_WORDS[item.state]]
        for item in result.expectations
    ]
    bad = frozenset(k for k, item in enumerate(result.expectations) if item.state == FAILS)
    heads = ("expectation", "expected", "computed", "tolerance", "unit", "verdict")
    return ResultTable.of(
        "Expected values of the case", heads, rows, bad=bad, mixed=frozenset({1, 2, 3})
    )


def extremes_of_pipes(result, ways: list[SectionPath]) -> ResultTable | None:
    """Table of the extremes of each quantity over all pipes: value, pipe, distance, elevation, time.

    It is None without pipes, or if the run diverged. The chainage is added if the run has a single section, and if the
    chainage differs from the distance along the pipe. ways : paths of the long sections
    """
    envelope = result.envelope
    if not envelope or not_valid(result.summary):
        return None
    legs = {leg.pipe: leg for way in ways for leg in way.legs}
    if len(ways) > 1 or all(leg.begin == 0.0 and not leg.backwards for leg in legs.values()):
        legs = {}  # the chainage equals the distance, or the section would be ambiguous
    rows, along = [], envelope_column(result, "distance")
    for name, words, most, when in EXTREMES:
        ends = {pipe: int(most(arrays[name])) for pipe, arrays in envelope.items()}
        pipes = list(ends)
        pipe = pipes[int(most([envelope[key][name][ends[key]] for key in pipes]))]
        arrays, k = envelope[pipe], ends[pipe]
        value, distance, height, time = (
            float(arrays[key][k]) for key in (name, "distance", "elevation", when)
        )
        leg = legs.get(pipe)
        chainage = (
            None
            if leg is None
            else float(along.from_si(leg.chainage(along.to_si(arrays["distance"][k]))))
        )
        rows.append(
            [
                words,
                value,
                envelope_column(result, name).unit,
                pipe,
                distance,
                *[chainage] * bool(legs),
                height,
                time,
            ]
        )
    keys = ("distance", *["distance"] * bool(legs), "elevation", "t_max")
    units = [envelope_column(result, key).unit for key in keys]
    heads = (
        "",
        "value",
        "unit",
        "pipe",
        "from its start",
        *["chainage"] * bool(legs),
        "elevation",
        "time",
    )
    return ResultTable.of(
        "Worst of all pipes", heads, rows, ("",) * 4 + tuple(units), mixed=frozenset({1})
    )


def ranked_pipes(result) -> list[ResultTable]:
    """Tables of pipes ranked by greatest and by least pressure, worst first; [] for a single pipe or a diverged run."""
    if len(result.envelope) < 2 or not_valid(result.summary):
        return []
    return [_ranking(result, name, words, most, when) for name, words, most, when in EXTREMES[:2]]


def _ranking(result, name: str, words: str, most, when: str) -> ResultTable:
    rows = []
    for pipe, arrays in result.envelope.items():
        k = int(most(arrays[name]))
        rows.append(
            [pipe, *(float(arrays[key][k]) for key in (name, "distance", "elevation", when))]
        )
    rows.sort(key=lambda row: row[1], reverse=most is np.argmax)
    units = [
        "",
        *(envelope_column(result, key).unit for key in (name, "distance", "elevation", when)),
    ]
    heads = ("pipe", words, "from its start", "elevation", "time")
    return ResultTable.of(
        f"{words.capitalize()} by pipe",
        heads,
        rows,
        units,
        most=MAX_RANKED,
        more="in envelope.csv and in the workbook (--xlsx)",
    )


def extremes_of_probes(result) -> ResultTable:
    """Table of the extremes of each probe over all accepted steps, with times and errors."""
    peaks = result.summary.get("peaks", {})
    rows = []
    invalid = not_valid(result.summary) or None
    clock = UnitColumn("t", "time", result.summary["time_unit"])
    for name, extremes in result.extremes.items():
        errors = {
            side: [peaks[name][side]["error"]] if peaks else [] for side in ("minimum", "maximum")
        }
        first, last = (in_unit(clock, t) for t in (extremes.t_min, extremes.t_max))
        low, high = (
            invalid if value is None else value for value in (extremes.minimum, extremes.maximum)
        )
        rows.append(
            [
                name,
                result.units[name],
                low,
                *errors["minimum"],
                first,
                high,
                *errors["maximum"],
                last,
            ]
        )
    heads = [
        column
        for side in ("minimum", "maximum")
        for column in (side, *[ERROR_HEADER] * bool(peaks), "time")
    ]
    units = [clock.unit if column == "time" else "" for column in heads]
    loose = frozenset(2 + k for k, column in enumerate(heads) if column != "time")
    return ResultTable.of(
        "Probes",
        ("probe", "unit", *heads),
        rows,
        ("", "", *units),
        mixed=loose,
        more="in summary.json and in the workbook (--xlsx)",
    )


def numerics_tables(result) -> list[ResultTable | None]:
    """Tables of electric energy, settings, ledgers, expected values and measured series; None for absent tables."""
    return [
        energy_use(result),
        settings(result),
        ledgers(result),
        claim_table(result),
        comparisons(result),
    ]


def settings(result) -> ResultTable:
    """Table of scheme, method, time step, number of steps, and computing time of a run."""
    summary, numerics = result.summary, result.case.numerics
    steps = {"courant": "Courant number", "step": "given, s", "rtol": "by error, rtol"}
    sizes = {key: getattr(numerics, key, None) for key in steps}
    given = [f"{steps[key]} {value_text(size)}" for key, size in sizes.items() if size]
    time = column("", "time", result.case)
    span = [value_text(float(time.from_si(item))) for item in (numerics.start, summary["t"])]
    rows = [["time", f"{span[0]} to {span[1]} {time.unit}"]]
    if summary["cells"]:
        limiter = getattr(numerics, "limiter", None)
        scheme = (
            f"muscl, limiter {limiter}"
            if limiter and numerics.scheme == "muscl"
            else numerics.scheme
        )
        rows += [["scheme", scheme], ["cells", summary["cells"]]]
    rows += [
        ["method", "; ".join(_method_text(item, result.case) for item in summary["methods"])],
        ["step", "; ".join(given) or "by default"],
        ["steps", summary["steps"]],
        ["repeated steps", summary["rejections"]],
        ["evaluations of rates", summary["rhs"]],
        ["computing time [s]", summary["seconds"]],
    ]
    if "resolution" in summary:
        words, reasons = summary["resolution"]["words"], summary["resolution"]["reasons"]
        rows.append(["errors of peaks (\u00b1)", "; ".join([words, *reasons])])
    return ResultTable.of("Method", ("", ""), [[key, value_text(value)] for key, value in rows])


def ledgers(result) -> ResultTable | None:
    """Table of the balances of mass, energy and scalars: inflow, outflow, storage, remainder; None without balances."""
    balances = {name: row for name, row in result.summary["ledgers"].items() if "remainder" in row}
    if not balances:
        return None
    terms = [
        term
        for term in LEDGER_TERMS
        if any(isinstance(row.get(term), float) for row in balances.values())
    ]
    rows = [
        [
            name,
            LEDGER_UNITS.get(name, ""),
            *(row.get(term) for term in terms),
            _shortened(row["remainder"], ".2e"),
            _shortened(row.get("relative"), ".1e"),
        ]
        for name, row in balances.items()
    ]
    heads = (
        "ledger",
        "unit",
        *(term.replace("_", " ") for term in terms),
        "remainder",
        "of the largest term",
    )
    return ResultTable.of("Ledgers", heads, rows)


def _shortened(value: float | None, form: str) -> str | None:
    """Text of a number; None for None, as in the balances of a diverged run."""
    return None if value is None else format(value, form)


def energy_use(result) -> ResultTable | None:
    """Table of the electric energy of pumps and its cost; None for a case without `[energy]`."""
    from fvsolve.parts.pump.energy_use import HEADS, UNITS, table_rows

    use = result.summary.get("energy_use")
    if use is None:
        return None
    charge = use["total"]["demand_charge"]
    rows = [*table_rows(use), *([["demand charge", *[None] * 6, charge, None]] if charge else [])]
    return ResultTable.of("Electric energy of pumps", HEADS, rows, UNITS)


def versions(result) -> ResultTable:
    """Table of versions of programs and data, hash of the case, and date of the run."""
    rows = [["run ended", result.summary.get("ended", "not recorded")]]
    words = {
        "case": "hash of the case",
        "sources": "hash of compiled sources",
        "fluid": "fluid properties",
        "target": "machine",
    }
    rows += [[words.get(key, key), version] for key, version in result.summary["versions"].items()]
    return ResultTable.of("", ("", ""), rows)


def events(result) -> ResultTable:
    """Table of events of self-acting parts with their times."""
    rows = [[event["time"], event["name"], event["what"]] for event in result.summary["events"]]
    return ResultTable.of("Events", ("time", "part", "event"), rows, ("s",), more="in summary.json")


def cavities(result) -> ResultTable:
    """Table of cavities in pipes: first position and time, greatest volume and its time."""
    rows = [
        [
            row["place"].removeprefix("links."),
            row["distance"],
            row["time"],
            row["volume"],
            row["t_volume"],
        ]
        for row in result.summary["cavities"]
    ]
    heads = ("pipe", "first at", "time", "greatest volume", "time")
    return ResultTable.of("Cavities", heads, rows, ("", "m", "s", "m3", "s"))


def comparisons(result) -> ResultTable:
    """Table that compares probes with measured series."""
    rows = [
        [
            row.probe,
            row.file,
            row.unit,
            row.rms,
            row.greatest_difference,
            row.measured_peak,
            row.computed_peak,
        ]
        for row in result.comparisons
    ]
    heads = ("probe", "measured", "unit", "rms", "greatest difference", "peak measured", "computed")
    return ResultTable.of("Against measurements", heads, rows, mixed=frozenset({3, 4, 5, 6}))


def _method_text(row: dict, case) -> str:
    return (
        row["method"] if not row["time"] else f"{row['method']} from {case.moment(row['time'])} on"
    )
