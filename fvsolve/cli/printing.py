"""Terminal output of runs, checks of cases, and differences of runs."""

from __future__ import annotations

from collections.abc import Callable

from fvsolve.cli.terminal import console as _console
from fvsolve.cli.terminal import line as _line
from fvsolve.cli.terminal import table as _table
from fvsolve.errors import listing
from fvsolve.output.directory import existing_pictures
from fvsolve.units import span

ROWS = 20  # greatest number of rows of a table of probes; summary.json has all
MANY_ROWS = 40  # greatest number of rows of a table of `check`; of longer tables only notable rows are printed
FLUID = {
    "density": "density", "bulk_modulus": "modulus", "sound_speed": "velocity", "viscosity": "viscosity",
    "vapor_pressure": "pressure",
}  # fmt: skip
NODE = {"elevation": ("elevation", "head"), "pressure": ("pressure", "pressure"), "head": ("head", "head")}
MASS = {
    "position": ("position", "position"), "velocity": ("velocity", "velocity"), "force": ("net force", "force")
}  # fmt: skip
BODY = {
    **{key: (key, "position") for key in "xyz"}, **{key: (key, "angle") for key in ("roll", "pitch", "yaw")},
    "speed": ("speed", "velocity"), "spin": ("spin", "angular_velocity"),
}  # fmt: skip
PIPE = {
    "length": ("length", "length"),
    "cells": ("cells", "number"),
    "wave_speed": ("wave speed", "velocity"),
    "velocity": ("velocity", "velocity"),
    "reynolds": ("Reynolds", "number"),
    "friction_factor": ("friction factor", "number"),
    "from_head": ("head at from", "head"),
    "to_head": ("head at to", "head"),
}

BASIN = {
    "physics": ("physics", ""), "cells": ("cells", ""), "path": ("kernels over", ""), "area": ("area", "area"),
    "depth": ("depth", "level"), "wave_speed": ("wave speed", "velocity"), "memory": ("memory [B]", ""),
}  # fmt: skip
PATCH = {
    "faces": ("faces", ""), "length": ("length", "length"), "area": ("cells behind", "area"),
    "reflects": ("waves reflected", ""),
}  # fmt: skip
PLACES_SHOWN = 3
EVENTS_SHOWN = 12
REASONS_SHOWN = 10  # summary.json has all


def print_result(run) -> None:
    """Print the results of a run: extremes, marks, cavities, events, ledgers, verdicts, comparisons, notices and steps.

    Verdicts are those on expectations and limits. At most ROWS probes, EVENTS_SHOWN events and REASONS_SHOWN reasons of
    errors are printed. All notices of wrong results are printed, but of many other notices only the first EVENTS_SHOWN.
    """
    summary, time_text = run.summary, time_formatter(run.summary)
    console = _console()
    if summary["title"]:
        _line(console, summary["title"], "bold")
    _print_extremes(console, run)
    for text in mark_lines(summary["marks"], time_text):
        _line(console, text, "yellow")
    for cavity in summary["cavities"]:
        _line(console, cavity["text"])
    for event in summary["events"][:EVENTS_SHOWN]:
        _line(console, f"{event['name']} {event['what']} at t = {time_text(event['time'])}")
    if len(summary["events"]) > EVENTS_SHOWN:
        more = len(summary["events"]) - EVENTS_SHOWN
        _line(console, f"and {more} more event{'s' if more > 1 else ''}; summary.json has all")
    for name, ledger in summary["ledgers"].items():
        _line(console, f"{name} ledger: {_ledger_text(ledger)}")
    for claim in summary["expectations"]:
        _line(console, _expectation_text(claim, summary), "green" if claim["ok"] else "bold red")
    for verdict in summary["verdicts"]:
        _line(console, _limit_text(verdict, summary), "green" if verdict["ok"] else "bold red")
    for measured in summary["comparisons"]:
        _line(console, _comparison_text(measured, summary))
    _print_notices(console, summary["warnings"])
    if "resolution" in summary:
        _line(console, summary["resolution"]["words"])
        for text in summary["resolution"]["reasons"][:REASONS_SHOWN]:
            _line(console, f"error of {text}", "yellow")
    end = "" if "at t = " in summary["reason"] else f" at t = {time_text(summary['t'])}"
    _line(console, f"{summary['reason']}{end}; {_cost_text(summary)}", None if run.ok else "bold red")


def time_column(summary: dict):
    """Column of times in the time unit of a run, from its summary."""
    from fvsolve.output.unit_columns import UnitColumn

    return UnitColumn("t", "time", summary["time_unit"])


def time_formatter(summary: dict) -> Callable[[float], str]:
    """Function that formats a time [s] in the time unit of a run, from its summary."""
    clock = time_column(summary)
    return lambda t: f"{_number(float(clock.from_si(t)))} {clock.unit}"


def print_files(run) -> None:
    """Print the files in the run directory, and how to resume an interrupted run."""
    names = sorted([*run.summary["files"], *existing_pictures(run.directory)])
    _line(_console(), f"{run.directory}: {', '.join(names)}")
    if run.reason.startswith("interrupted"):
        _line(_console(), "to resume, use the same command with --resume")


def exit_code(run) -> int:
    """Exit code: 130 interrupted; 1 if the run is not ok, or an expectation or limit fails or is open; otherwise 0."""
    if run.reason.startswith("interrupted"):
        return 130
    return 0 if run.ok and all(claim.ok for claim in [*run.expectations, *run.verdicts]) else 1


def print_checks(case, facts: dict, every: bool = False) -> None:
    """Print fluid, parts and basins at the start, moving parts, notices, the step and its cost.

    facts : contents of the case, as `Model.checks`, with the result of `divisible_rows` as "threads"
    every : True for all rows, otherwise only notable rows of long tables
    """
    console = _console()
    _line(console, case.title or case.name, "bold")
    _line(console, _fluid_text(case, facts["fluid"]))
    odd = {part["place"] for part in facts["warnings"]}
    for group, word, keys in (
        ("nodes", "node", NODE),
        ("masses", "mass", MASS),
        ("bodies", "body", BODY),
        ("pipes", "pipe", PIPE),
    ):
        place = "links" if group == "pipes" else "nodes"
        _print_states(
            console, case, word, facts[group], keys, every, {name for name in facts[group] if f"{place}.{name}" in odd}
        )
    basins = facts["basins"]
    _print_rows(console, case, "basin", basins, BASIN)
    patches = {f"{name}.{patch}": faces for name, part in basins.items() for patch, faces in part["patches"].items()}
    _print_rows(console, case, "patch", patches, PATCH)
    notes = [f"unsteady friction of {name}: {_unsteady_friction_text(part['unsteady'])}"
            for name, part in facts["pipes"].items() if "unsteady" in part]  # fmt: skip
    notes += _wall_lines(case, facts["pipes"])
    lines = {name: part for name, part in facts["pipes"].items() if part["line"] == "delay-line"}
    notes += [f"{name} is a delay line, error at most {part['line_bound']:.2g} of the greatest jump: {part['line_why']}"
             for name, part in lines.items()]  # fmt: skip
    if lines:
        notes += [f"{name} has cells: {part['line_why']}" for name, part in facts["pipes"].items() if name not in lines]
    _print_first(console, notes, every)
    _print_first(console, [f"moves from the start: {text}" for text in facts["moving"]], every)
    _print_notices(console, facts["warnings"], every)
    if facts["basins"]:
        _line(console, _thread_text(facts["threads"]))
    _line(console, _step_text(case, facts))


def _print_rows(console, case, word: str, parts: dict, keys: dict) -> None:
    """Print a table of basins or patches in the units of `[output]`, if there are any.

    word : header of the column of names; parts : name -> key -> value [SI]
    keys : key of a column -> (its title, its dimension or "")
    """
    from fvsolve.output.unit_columns import column

    columns = [column(title, dimension, case) if dimension else None for title, dimension in keys.values()]
    heads = [title if part is None else part.header for (title, _), part in zip(keys.values(), columns, strict=True)]
    rows = [[name, *(_number(part.get(key) if unit is None else _in_unit(unit, part.get(key)))
                     for key, unit in zip(keys, columns, strict=True))] for name, part in parts.items()]  # fmt: skip
    if rows:
        _table([word, *heads], rows, console)
        _line(console, "")


def _wall_lines(case, pipes: dict) -> list[str]:
    """Lines on pipe walls and the sources of their data; pipes with the same text share a line.

    pipes : name -> values, as in `Model.checks`
    """
    alike: dict[str, list[str]] = {}
    for name, pipe in pipes.items():
        if text := _wall_text(case, pipe):
            alike.setdefault(text, []).append(name)
    return [f"wall of {listing(names)}: {text}" for text, names in alike.items()]


def _wall_text(case, pipe: dict) -> str:
    from fvsolve.output.unit_columns import column

    texts = []
    if "allowable_pressure" in pipe:
        unit = column("allowable", "gauge_pressure", case)
        texts.append(f"allowable pressure {_number(_in_unit(unit, pipe['allowable_pressure']))} {unit.unit}")
    if "creep" in pipe:
        speed = case.amount(pipe["creep"]["slow_speed"], "velocity")
        texts.append(f"viscoelastic, {pipe['creep']['elements']} elements, speed of slow waves {speed}")
    if "restraint_factor" in pipe:
        texts.append(f"restraint factor {pipe['restraint_factor']:.4g}")
    if "source" in pipe:
        texts.append(pipe["source"])
    if pipe.get("unread"):
        keys = listing(pipe["unread"]).replace("_", " ")
        texts.append(f"{keys} of {pipe['material']}: no source in the catalogue, give the values in the case")
    return "; ".join(texts)


def _thread_text(facts: dict) -> str:
    """Text on threads: rows of basins that threads share, or the reason for a single thread.

    facts : result of `divisible_rows`
    """
    if facts["why"]:
        return f"threads: 1; {facts['why']}"
    rows = ", ".join(f"{count} rows of {name}" for name, count in facts["rows"].items())
    undivided = "; ".join(f"{name}: {reason}" for name, reason in facts["whole"].items())
    whole = f"; each thread computes all of {undivided}" if undivided else ""
    return f"threads: up to {facts['most']} share {rows}{whole}"


def _print_states(console, case, word: str, parts: dict, keys: dict, every: bool, odd: set[str]) -> None:
    """Print a table of parts at the start in the units of `[output]`; of a long table only notable rows.

    every : True for all rows; odd : names of parts with notices, which are notable
    Other arguments as for `_print_rows`.
    """
    from fvsolve.output.unit_columns import column

    if not parts:
        return
    columns = [column(title, dimension, case) for title, dimension in keys.values()]
    names = list(parts) if every or len(parts) <= MANY_ROWS else _notable_rows(parts, keys, odd)
    rows = [[name, *(_number(_in_unit(unit, parts[name][key])) for key, unit in zip(keys, columns, strict=True))]
            for name in names]  # fmt: skip
    _table([word, *(unit.name if unit.dimension == "number" else unit.header for unit in columns)], rows, console)
    if len(names) < len(parts):
        _line(console, f"... {len(parts) - len(names)} more of {len(parts)}; the table has only parts with the least "
                       "or greatest value of a column or with a notice, --all prints all")  # fmt: skip
    _line(console, "")


def _notable_rows(parts: dict, keys: dict, odd: set[str]) -> list[str]:
    """Names of parts with the least or greatest value of a column, and of parts in `odd`, in the original order.

    parts, keys : as for `_print_rows`; odd : names of parts with notices, of which at most MANY_ROWS are included
    """
    chosen = set(sorted(odd)[:MANY_ROWS])
    for key in keys:
        names = [name for name, part in parts.items() if part[key] is not None]
        if names:
            chosen |= {pick(names, key=lambda name: parts[name][key]) for pick in (min, max)}  # noqa: B023
    return [name for name in parts if name in chosen]


def _fluid_text(case, fluid: dict) -> str:
    """Text on the fluid in the units of `[output]`; the bulk modulus has the unit of pressure differences."""
    from fvsolve.output.unit_columns import column

    texts = []
    for key, dimension in FLUID.items():
        unit = column(key, dimension, case)
        if dimension == "modulus":
            unit = column(key, dimension, case, span(unit.unit))
        texts.append(
            f"{key.replace('_', ' ')} {'unknown' if fluid[key] is None else _number(_in_unit(unit, fluid[key]))}"
            f"{'' if fluid[key] is None else ' ' + unit.unit}"
        )
    name = "" if fluid["name"] == fluid["source"] else f" ({fluid['source']})"
    return f"fluid {fluid['name']}{name}: {', '.join(texts)}"


def _in_unit(column, value):
    """Convert a number or a range from SI to the unit of a column; None stays None."""
    if isinstance(value, list):  # a range
        return [_in_unit(column, x) for x in value]
    return value if value is None or column.plain else float(column.from_si(value))


def _print_first(console, lines: list[str], every: bool) -> None:
    """Print lines; every : True for all lines, False for only the first EVENTS_SHOWN of many lines."""
    count = len(lines) if every or len(lines) <= EVENTS_SHOWN + 2 else EVENTS_SHOWN
    for text in lines[:count]:
        _line(console, text)
    if len(lines) > count:
        _line(console, f"... {len(lines) - count} more of this kind")


def _print_notices(console, warnings: list[dict], every: bool = False) -> None:
    """Print all notices of wrong results in bold red, then the other notices.

    every : True for all other notices, False for only the first of them, as for `_print_first`
    """
    for notice in warnings:
        if not notice["ok"]:
            _line(console, f"note: {notice['text']}", "bold red")
    _print_first(console, [f"note: {notice['text']}" for notice in warnings if notice["ok"]], every)


def _unsteady_friction_text(terms: dict) -> str:
    return (f"{terms['weighting']}, {terms['terms']} terms a cell, within {terms['accuracy']:g} up to "
            f"{terms['frequency']:.3g} Hz")  # fmt: skip


def print_titles(cases: dict[str, str]) -> None:
    """Print names and titles of the shipped cases."""
    _table(["case", "title"], [[name, title] for name, title in cases.items()])


def print_differences(results: dict, summary: dict) -> None:
    """Print the differences of two runs for each common probe, and the probes that only one of the runs has.

    results : as from `differences` in `run.comparison`; summary : of the first run, whose time unit is used
    """
    clock, rows = time_column(summary), []
    for name, probe in results["probes"].items():
        time = None if probe["t_greatest"] is None else clock.from_si(probe["t_greatest"])
        rows.append([name, span(probe["unit"]), *map(_number, (probe["greatest"], time, probe["rms"]))])
    _table(["probe", "unit", "greatest difference", f"at [{clock.unit}]", "rms"], rows)
    for key in ("only_a", "only_b"):
        if results[key]:
            _line(_console(), f"only in {results[key[-1]]}: {', '.join(results[key])}")


def _print_extremes(console, run) -> None:
    from fvsolve.output.unit_columns import UnitColumn
    from fvsolve.run.result import not_valid

    clock = UnitColumn("at", "time", run.summary["time_unit"])
    missing = not_valid(run.summary) or "-"
    rows = [[name, run.units[name], missing if extreme.minimum is None else _number(extreme.minimum),
             _number(_in_unit(clock, extreme.t_min)), missing if extreme.maximum is None else _number(extreme.maximum),
             _number(_in_unit(clock, extreme.t_max))] for name, extreme in run.extremes.items()]  # fmt: skip
    heads = ["probe", "unit", "minimum", clock.header, "maximum", clock.header]
    if "peaks" in run.summary:
        heads = ["probe", "unit", "minimum", "+-", clock.header, "maximum", "+-", clock.header]
        for row, peak in zip(rows, run.summary["peaks"].values(), strict=True):
            row[3:3] = [_error_text(peak["minimum"])]
            row[6:6] = [_error_text(peak["maximum"])]
    if rows:
        _table(heads, rows[:ROWS], console)
    if len(rows) > ROWS:
        where = f"in {run.directory / 'summary.json'}" if run.directory else "in Result.extremes"
        _line(console, f"... {len(rows) - ROWS} more {where}")


def _step_text(case, facts: dict) -> str:
    if facts["step"] is None:
        return f"step: {facts['step_set_by']}"
    expected = facts["expected_seconds"]
    cost = "" if expected is None else f", about {expected:.2g} s of computing time"
    step = f"step at the start {case.step_amount(facts['step'])}, set by {facts['step_set_by']}"
    return f"{step}; {facts['steps']} steps of this size in the run{cost}"


def _ledger_text(ledger: dict) -> str:
    text = f"remainder {_number(ledger['remainder'])}"
    return f"{text}, {_number(ledger['relative'])} of the largest term" if "relative" in ledger else text


def _expectation_text(claim: dict, summary: dict) -> str:
    from fvsolve.run.result import IN_WORDS, OPEN

    reason = "" if claim["state"] != OPEN else undecided_reason(summary) or "its value is not known"
    verdict = f"OPEN, because {reason}" if reason else IN_WORDS[claim["state"]]
    return (
        f"{verdict}: {claim['text']} = {_number(claim['claimed'])} {claim['unit']} within "
        f"{_number(claim['tolerance'])} {span(claim['unit'])}: found {_number(claim['found'])}"
        f"{'' if claim['error'] is None else f' +- {_error_text(claim)}'}"
    )


def _error_text(peak: dict) -> str:
    """Text of the error of a peak; "?" if the error is not known."""
    return "?" if peak["error"] is None else f"{peak['error']:.2g}"


def where_and_when(verdict: dict, summary: dict) -> str:
    """Text of the place, chainage and time at which the margin of a limit is least, in the units of a run.

    verdict : verdict on the limit; summary : summary of the run
    """
    from fvsolve.output.unit_columns import UnitColumn

    along = UnitColumn("chainage", "length", summary["envelope_units"]["distance"])
    chainage = (
        "" if verdict["chainage"] is None else f" at {_number(_in_unit(along, verdict['chainage']))} {along.unit}"
    )
    return (
        verdict["place"]
        + chainage
        + ("" if verdict["time"] is None else f", {time_formatter(summary)(verdict['time'])}")
    )


def _limit_text(verdict: dict, summary: dict) -> str:
    from fvsolve.run.result import IN_WORDS, OPEN, LimitVerdict, not_valid

    this = LimitVerdict(**verdict)
    relation = "at least" if verdict["bound"] == "minimum" else "at most"
    value_text = (
        f"{verdict['quantity'].replace('_', ' ')} {_number(verdict['value'])} {verdict['unit']} "
        f"({where_and_when(verdict, summary)})"
    )
    state = IN_WORDS[this.state] if this.state != OPEN else f"OPEN, because {undecided_limit_reason(this, summary)}"
    margin = (
        not_valid(summary) or "-"
        if verdict["margin"] is None
        else f"{_number(verdict['margin'])} {span(verdict['unit'])}"
    )
    text = f"{state}: {verdict['name']}: {value_text}, {relation} {_number(verdict['limit'])}; margin {margin}"
    if verdict["error"] is not None and verdict["margin"] is not None:
        text += f" within {verdict['error']:.2g}"
    if verdict["time"] is not None and verdict["until"] > 0.0 and verdict["time"] >= verdict["until"] * (1.0 - 1e-9):
        text += ", at the end of the run: a longer run may reach a worse value"
    return text


def undecided_limit_reason(verdict, summary: dict) -> str:
    """Reason why a limit is undecided (state OPEN). verdict : `LimitVerdict`; summary : summary of the run"""
    if verdict.doubtful:
        return "its margin is smaller than its error"
    return undecided_reason(summary) or f"its {'value' if verdict.margin is None else 'error'} is not known"


def mark_lines(marks: list[dict], time_text) -> list[str]:
    """Lines on marks (first occurrences of events outside the model's validity), sorted by time.

    Marks with the same text share a line, which names the first `PLACES_SHOWN` places.
    time_text : function that formats a time [s]
    """
    alike: dict[str, list[dict]] = {}
    for mark in sorted(marks, key=lambda mark: mark["time"]):
        alike.setdefault(mark["text"].partition(": ")[2], []).append(mark)
    lines = []
    for text, group in alike.items():
        names = [mark["text"].partition(": ")[0] for mark in group]
        more = f" and {len(names) - PLACES_SHOWN} more" if len(names) > PLACES_SHOWN else ""
        places = ", ".join(names[:PLACES_SHOWN]) + more
        lines.append(f"{places}: {text}: results from {time_text(group[0]['time'])} on are not to be trusted")
    return lines


def undecided_reason(summary: dict) -> str:
    """Reason why a run cannot confirm a limit that it does not exceed; "" if it can. summary : summary of the run"""
    from fvsolve.run.result import not_valid

    late = [notice["text"] for notice in summary["warnings"] if notice["kind"] == "end"]
    if text := not_valid(summary):
        return f"the run is {text}"
    if not summary["marks"]:
        return (late[0] if late else "") if summary["ok"] else f"the run is not ok ({summary['reason']})"
    first = min(summary["marks"], key=lambda mark: mark["time"])
    return f"results from {time_formatter(summary)(first['time'])} on are not to be trusted"


def _comparison_text(comparison: dict, summary: dict) -> str:
    if comparison["rms"] is None:
        return f"{comparison['probe']} against {comparison['file']}: no measured time lies within the run"
    unit, span_unit, time_text = comparison["unit"], span(comparison["unit"]), time_formatter(summary)
    return (
        f"{comparison['probe']} against {comparison['file']}: rms {_number(comparison['rms'])} {span_unit}, greatest "
        f"difference {_number(comparison['greatest_difference'])} {span_unit} at "
        f"{time_text(comparison['t_greatest_difference'])}; "
        f"peak {_number(comparison['computed_peak'])} {unit} at {time_text(comparison['t_computed_peak'])}, measured "
        f"{_number(comparison['measured_peak'])} {unit} at {time_text(comparison['t_measured_peak'])}"
    )


def _cost_text(summary: dict) -> str:
    rejected = f", {summary['rejections']} rejected" if summary["rejections"] else ""
    cells = f", {summary['cells']} cells" if summary["cells"] else ""
    cost = f" ({_number(summary['cost'])} ns per cell and step)" if summary["cells"] and summary["cost"] else ""
    newton = (
        f", {summary['jacobians']} Jacobians, {summary['factorisations']} factorisations"
        if summary["jacobians"]
        else ""
    )
    newton += (
        f", {summary['newton']} Newton iterations, {summary['newton_failures']} failed" if summary["newton"] else ""
    )
    return f"{summary['steps']} steps{rejected}{newton}{cells}, {summary['seconds']:.3g} s{cost}"


def _number(value) -> str:
    if isinstance(value, list):  # a range
        return " to ".join(dict.fromkeys(map(_number, value)))
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
