"""Lines and tables about runs, checks of cases, and differences of runs, for `terminal.show`.

`summary` is the summary of a run. `parts` maps names of parts to their values by key [SI]; `keys` maps the keys of
columns to (title, dimension).
"""

from collections.abc import Callable, Iterator

from fvsolve.case.resource_checks import byte_text, disk_size
from fvsolve.core.output.directory import existing_pictures
from fvsolve.core.output.result_table import ResultTable
from fvsolve.core.output.summary_shape import IN_WORDS, OPEN, LimitVerdict
from fvsolve.core.output.unit_columns import UnitColumn, column
from fvsolve.core.run.result import not_valid
from fvsolve.errors import listing
from fvsolve.parts.date_keys import moment_text, start_time_in
from fvsolve.parts.nodes_and_links import kind_text
from fvsolve.units import span

ROWS = 20  # greatest number of rows of a table of probes; summary.json has all
# greatest number of rows of a table of `check`; of longer tables only notable rows are printed
MANY_ROWS = 40
FLUID = {
    "density": "density",
    "bulk_modulus": "modulus",
    "sound_speed": "velocity",
    "viscosity": "viscosity",
    "vapor_pressure": "pressure",
}
NODE = {
    "elevation": ("elevation", "head"),
    "pressure": ("pressure", "pressure"),
    "head": ("head", "head"),
}
MASS = {
    "position": ("position", "position"),
    "velocity": ("velocity", "velocity"),
    "force": ("net force", "force"),
}
BODY = {
    **{key: (key, "position") for key in "xyz"},
    **{key: (key, "angle") for key in ("roll", "pitch", "yaw")},
    "speed": ("speed", "velocity"),
    "spin": ("spin", "angular_velocity"),
}
PIPE = {
    "length": ("length", "length"),
    "cells": ("cells", "number"),
    "wave_speed": ("wave speed", "velocity"),
    "flow": ("flow", "flow"),
    "velocity": ("velocity", "velocity"),
    "reynolds": ("Reynolds", "number"),
    "friction_factor": ("friction factor", "number"),
    "from_head": ("head at from", "head"),
    "to_head": ("head at to", "head"),
}
BASIN = {
    "physics": ("physics", "number"),
    "cells": ("cells", "number"),
    "path": ("kernels over", "number"),
    "area": ("area", "area"),
    "depth": ("depth", "level"),
    "wave_speed": ("wave speed", "velocity"),
    "memory": ("memory [B]", "number"),
}
PATCH = {
    "faces": ("faces", "number"),
    "length": ("length", "length"),
    "area": ("cells behind", "area"),
    "reflects": ("waves reflected", "number"),
}
# [s], [B] above which the cost of a run is estimated before it starts
LONG_RUN, LARGE_FILES = 180.0, 1e9
DURATIONS = ((86400.0 * 365.25, "years"), (86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"))
PLACES_SHOWN = 3
EVENTS_SHOWN = 12
REASONS_SHOWN = 10  # summary.json has all


def cost_estimate(model) -> str:
    """Text on the expected duration and file sizes of a run, and on steps that are too short; "" if all are small."""
    facts, bytes_ = model.checks, disk_size(model.case)
    seconds = facts["expected_seconds"] or 0.0
    parts = [duration(seconds)] if seconds > LONG_RUN else []
    parts += [f"{byte_text(bytes_)} on disk"] if bytes_ > LARGE_FILES else []
    lines = [f"{model.case.name} will take about {' and '.join(parts)}"] if parts else []
    lines += [f"note: {notice['text']}" for notice in facts["warnings"] if notice["kind"] == "cost"]
    return "\n".join(lines)


def duration(seconds: float) -> str:
    """Text of a duration in a suitable unit, such as "2.5 hours"."""
    length, name = next((unit for unit in DURATIONS if seconds >= 2.0 * unit[0]), (1.0, "s"))
    return f"{seconds / length:.2g} {name}"


def result_text(run) -> Iterator:
    """Results of a run: extremes, marks, cavities, events, ledgers, verdicts, comparisons, notices and steps.

    Verdicts are those on expectations and limits. At most ROWS probes, EVENTS_SHOWN events and REASONS_SHOWN reasons of
    errors are listed. All notices of wrong results are listed, but of many other notices only the first EVENTS_SHOWN.
    """
    summary, time_text = run.summary, time_formatter(run.summary)
    if summary["title"]:
        yield summary["title"], "bold"
    yield from _extremes(run)
    for text in mark_lines(summary["marks"], time_text):
        yield text, "yellow"
    for cavity in summary["cavities"]:
        yield cavity["text"]
    for event in summary["events"][:EVENTS_SHOWN]:
        yield f"{event['name']} {event['what']} at t = {time_text(event['time'])}"
    if len(summary["events"]) > EVENTS_SHOWN:
        more = len(summary["events"]) - EVENTS_SHOWN
        yield f"and {more} more event{'s' if more > 1 else ''}; summary.json has all"
    for name, table in summary.get("run_up", {}).items():
        along, unit = ("angle", "deg") if "angle" in table else ("distance", "m")
        if table["greatest"] is None:
            yield f"run-up {name}: no cell was wet"
        else:
            place = f"{along} {_number(table[f'greatest_{along}'])} {unit}"
            yield f"run-up {name}: {_number(table['greatest'])} m at {place}"
    if "energy_use" in summary:
        yield from energy_use_text(summary["energy_use"])
    for name, ledger in summary["ledgers"].items():
        relative = (
            f", {_number(ledger['relative'])} of the largest term" if "relative" in ledger else ""
        )
        yield f"{name} ledger: remainder {_number(ledger['remainder'])}{relative}"
    for claim in summary["expectations"]:
        yield _expectation_text(claim, summary), "green" if claim["ok"] else "bold red"
    for verdict in summary["verdicts"]:
        yield _limit_text(verdict, summary), "green" if verdict["ok"] else "bold red"
    for measured in summary["comparisons"]:
        yield _comparison_text(measured, summary)
    yield from _notices(summary["warnings"])
    if "resolution" in summary:
        yield summary["resolution"]["words"]
        for text in summary["resolution"]["reasons"][:REASONS_SHOWN]:
            yield f"error of {text}", "yellow"
    end = "" if "at t = " in summary["reason"] else f" at t = {time_text(summary['t'])}"
    yield f"{summary['reason']}{end}; {_cost_text(summary)}", None if run.ok else "bold red"


def energy_use_text(use: dict) -> Iterator:
    """Table of the electric energy of pumps and its cost; use : entry `energy_use` of a summary"""
    from fvsolve.parts.pump.energy_use import HEADS, UNITS, table_rows

    heads = [f"{head} [{unit}]" if unit else head for head, unit in zip(HEADS, UNITS, strict=True)]
    yield ResultTable.of("", heads, [[row[0], *map(_number, row[1:])] for row in table_rows(use)])
    if use["total"]["demand_charge"]:
        yield f"demand charge for the greatest power of all pumps together: {_number(use['total']['demand_charge'])}"


def time_column(summary: dict):
    """Column of times in the time unit of a run, from its summary."""
    return UnitColumn("t", "time", summary["time_unit"])


def time_formatter(summary: dict) -> Callable[[float], str]:
    """Function that formats a time [s] in the time unit of a run, with its date if the run has a start time."""
    clock, start = time_column(summary), start_time_in(summary)
    return lambda t: moment_text(f"{_number(float(clock.from_si(t)))} {clock.unit}", t, start)


def files_text(run) -> Iterator:
    """Files in the run directory, and how to resume an interrupted run."""
    names = sorted([*run.summary["files"], *existing_pictures(run.directory)])
    yield f"{run.directory}: {', '.join(names)}"
    if run.reason.startswith("interrupted"):
        yield "to resume, use the same command with --resume"


def exit_code(run) -> int:
    """Exit code: 130 interrupted; 1 if the run is not ok, or an expectation or limit fails or is open; otherwise 0."""
    if run.reason.startswith("interrupted"):
        return 130
    return 0 if run.ok and all(claim.ok for claim in [*run.expectations, *run.verdicts]) else 1


def check_text(case, facts: dict, every: bool = False) -> Iterator:
    """Contents of a case: fluid, parts and basins at the start, moving parts, notices, the step and its cost.

    facts : contents of the case, as `Model.checks`, with the result of `divisible_rows` as "threads"
    every : True for all rows, otherwise only notable rows of long tables
    """
    yield case.title or case.name, "bold"
    basins = facts.get("basins", {})
    if facts["nodes"] or basins:
        yield _fluid_text(case, facts["fluid"])
    odd = {part["place"] for part in facts["warnings"]}
    groups = (
        ("nodes", "node", NODE),
        ("masses", "mass", MASS),
        ("bodies", "body", BODY),
        ("pipes", "pipe", PIPE),
    )
    for group, word, keys in groups:
        place = "links" if group == "pipes" else "nodes"
        noticed = {name for name in facts[group] if f"{place}.{name}" in odd}
        yield from _parts_table(case, word, facts[group], keys, every, noticed)
    yield from _parts_table(case, "basin", basins, BASIN)
    patches = {
        f"{name}.{patch}": faces
        for name, part in basins.items()
        for patch, faces in part["patches"].items()
    }
    yield from _parts_table(case, "patch", patches, PATCH)
    unsteady = {
        name: part["unsteady"] for name, part in facts["pipes"].items() if "unsteady" in part
    }
    notes = [
        f"unsteady friction of {name}: {part['weighting']}, {part['terms']} terms a cell, within "
        f"{part['accuracy']:g} up to {part['frequency']:.3g} Hz"
        for name, part in unsteady.items()
    ]
    walls: dict[str, list[str]] = {}  # pipes with the same text share a line
    for name, pipe in facts["pipes"].items():
        if text := _wall_text(case, pipe):
            walls.setdefault(text, []).append(name)
    notes += [f"wall of {listing(names)}: {text}" for text, names in walls.items()]
    notes += [
        f"{name}: {kind_text(link)} in parallel; flow, torque and power are those of all"
        for name, link in case.links.items()
        if getattr(link, "count", 1) > 1
    ]
    lines = {name: part for name, part in facts["pipes"].items() if part["line"] == "delay-line"}
    notes += [
        f"{name} is a delay line, error at most {part['line_bound']:.2g} of the greatest jump: {part['line_why']}"
        for name, part in lines.items()
    ]
    if lines:
        notes += [
            f"{name} has cells: {part['line_why']}"
            for name, part in facts["pipes"].items()
            if name not in lines
        ]
    notes += [f"{name}: {text}" for name, part in basins.items() for text in part["chains"]]
    yield from _first([*notes, *facts["texts"]], every)
    yield from _first([f"moves from the start: {text}" for text in facts["moving"]], every)
    yield from _notices(facts["warnings"], every)
    if basins:
        yield _thread_text(facts["threads"])
    yield _step_text(case, facts)


def _parts_table(
    case, word: str, parts: dict, keys: dict, every: bool = True, odd: set[str] = frozenset()
) -> Iterator:
    """Table of parts in the units of `[output]`, if there are any; of a long table only notable rows.

    word : header of the column of names; every : True for all rows; odd : names of parts with notices
    """
    if not parts:
        return
    columns = [column(title, dimension, case) for title, dimension in keys.values()]
    names = list(parts) if every or len(parts) <= MANY_ROWS else _notable_rows(parts, keys, odd)
    rows = [
        [
            name,
            *(
                _number(_in_unit(unit, parts[name].get(key)))
                for key, unit in zip(keys, columns, strict=True)
            ),
        ]
        for name in names
    ]
    heads = [word, *(unit.name if unit.dimension == "number" else unit.header for unit in columns)]
    yield ResultTable.of("", heads, rows)
    if len(names) < len(parts):
        yield (
            f"... {len(parts) - len(names)} more of {len(parts)}; the table has only parts with the least "
            "or greatest value of a column or with a notice, --all prints all"
        )
    yield ""


def _wall_text(case, pipe: dict) -> str:
    texts = []
    if "allowable_pressure" in pipe:
        unit = column("allowable", "gauge_pressure", case)
        texts.append(
            f"allowable pressure {_number(_in_unit(unit, pipe['allowable_pressure']))} {unit.unit}"
        )
    if "creep" in pipe:
        speed = case.amount(pipe["creep"]["slow_speed"], "velocity")
        texts.append(
            f"viscoelastic, {pipe['creep']['elements']} elements, speed of slow waves {speed}"
        )
    if "restraint_factor" in pipe:
        texts.append(f"restraint factor {pipe['restraint_factor']:.4g}")
    texts += [
        f"retardation factor of {name} {factor:.4g}"
        for name, factor in pipe.get("retardation", {}).items()
    ]
    if "source" in pipe:
        texts.append(pipe["source"])
    if pipe.get("unread"):
        keys = listing(pipe["unread"]).replace("_", " ")
        texts.append(
            f"{keys} of {pipe['material']}: no source in the catalogue, give the values in the case"
        )
    return "; ".join(texts)


def _thread_text(facts: dict) -> str:
    """Text on threads: rows or blocks of cells of basins that threads share, or the reason for a single thread.

    facts : result of `divisible_rows`
    """
    if facts["why"]:
        return f"threads: 1; {facts['why']}"
    rows = ", ".join(f"{text} of {name}" for name, text in facts["texts"].items())
    undivided = "; ".join(f"{name}: {reason}" for name, reason in facts["whole"].items())
    whole = f"; each thread computes all of {undivided}" if undivided else ""
    return f"threads: up to {facts['most']} share {rows}{whole}"


def _notable_rows(parts: dict, keys: dict, odd: set[str]) -> list[str]:
    """Names of parts with the least or greatest value of a column, and of parts in `odd`, in the original order.

    odd : names of parts with notices, of which at most MANY_ROWS are included
    """
    chosen = set(sorted(odd)[:MANY_ROWS])
    for key in keys:
        names = [name for name, part in parts.items() if part[key] is not None]
        if names:
            chosen |= {pick(names, key=lambda name: parts[name][key]) for pick in (min, max)}  # noqa: B023
    return [name for name in parts if name in chosen]


def _fluid_text(case, fluid: dict) -> str:
    """Text on the fluid in the units of `[output]`; the bulk modulus has the unit of pressure differences."""
    texts = []
    for key, dimension in FLUID.items():
        unit = column(key, dimension, case)
        if dimension == "modulus":
            unit = column(key, dimension, case, span(unit.unit))
        value = (
            "unknown"
            if fluid[key] is None
            else f"{_number(_in_unit(unit, fluid[key]))} {unit.unit}"
        )
        texts.append(f"{key.replace('_', ' ')} {value}")
    name = "" if fluid["name"] == fluid["source"] else f" ({fluid['source']})"
    return f"fluid {fluid['name']}{name}: {', '.join(texts)}"


def _in_unit(column, value):
    """Convert a number or a range from SI to the unit of a column; None stays None."""
    if isinstance(value, list):  # a range
        return [_in_unit(column, x) for x in value]
    return value if value is None or column.plain else float(column.from_si(value))


def _first(lines: list[str], every: bool) -> Iterator:
    """Lines, and a note on omitted lines; every : True for all lines, False for only the first of many lines."""
    count = len(lines) if every or len(lines) <= EVENTS_SHOWN + 2 else EVENTS_SHOWN
    yield from lines[:count]
    if len(lines) > count:
        yield f"... {len(lines) - count} more of this kind"


def _notices(warnings: list[dict], every: bool = False) -> Iterator:
    """All notices of wrong results in bold red, then the other notices.

    every : True for all other notices, False for only the first of them, as for `_first`
    """
    for notice in warnings:
        if not notice["ok"]:
            yield f"note: {notice['text']}", "bold red"
    yield from _first([f"note: {notice['text']}" for notice in warnings if notice["ok"]], every)


def difference_text(results: dict, summary: dict) -> Iterator:
    """Differences of two runs for each common probe, and the probes that only one of the runs has.

    results : as from `differences` in `run.verdicts`; summary : of the first run, whose time unit is used
    """
    clock, rows = time_column(summary), []
    for name, probe in results["probes"].items():
        time = None if probe["t_greatest"] is None else clock.from_si(probe["t_greatest"])
        rows.append(
            [name, span(probe["unit"]), *map(_number, (probe["greatest"], time, probe["rms"]))]
        )
    yield ResultTable.of(
        "", ["probe", "unit", "greatest difference", f"at [{clock.unit}]", "rms"], rows
    )
    if results["note"]:
        yield results["note"]
    for key in ("only_a", "only_b"):
        if results[key]:
            yield f"only in {results[key[-1]]}: {', '.join(results[key])}"


def _extremes(run) -> Iterator:
    clock = UnitColumn("at", "time", run.summary["time_unit"])
    start = start_time_in(run.summary)
    missing = not_valid(run.summary) or "-"
    rows = [
        [
            name,
            run.units[name],
            missing if extreme.minimum is None else _number(extreme.minimum),
            moment_text(_number(_in_unit(clock, extreme.t_min)), extreme.t_min, start),
            missing if extreme.maximum is None else _number(extreme.maximum),
            moment_text(_number(_in_unit(clock, extreme.t_max)), extreme.t_max, start),
        ]
        for name, extreme in run.extremes.items()
    ]
    heads = ["probe", "unit", "minimum", clock.header, "maximum", clock.header]
    if "peaks" in run.summary:
        heads = ["probe", "unit", "minimum", "+-", clock.header, "maximum", "+-", clock.header]
        for row, peak in zip(rows, run.summary["peaks"].values(), strict=True):
            row[3:3] = [_error_text(peak["minimum"])]
            row[6:6] = [_error_text(peak["maximum"])]
    if rows:
        yield ResultTable.of("", heads, rows[:ROWS])
    if len(rows) > ROWS:
        where = f"in {run.directory / 'summary.json'}" if run.directory else "in Result.extremes"
        yield f"... {len(rows) - ROWS} more {where}"


def _step_text(case, facts: dict) -> str:
    if facts["step"] is None:
        return f"step: {facts['step_set_by']}"
    expected = facts["expected_seconds"]
    cost = "" if expected is None else f", about {expected:.2g} s of computing time"
    step = f"step at the start {case.step_amount(facts['step'])}, set by {facts['step_set_by']}"
    full = (
        "" if facts["steps_if_full"] is None else f" ({facts['steps_if_full']} with full conduits)"
    )
    return f"{step}; {facts['steps']} steps of this size in the run{full}{cost}"


def _expectation_text(claim: dict, summary: dict) -> str:
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
    """Text of the place, chainage and time at which the margin of a limit is least, in the units of a run."""
    along = UnitColumn("chainage", "length", summary["envelope_units"]["distance"])
    text = verdict["place"]
    if verdict["chainage"] is not None:
        text += f" at {_number(_in_unit(along, verdict['chainage']))} {along.unit}"
    return (
        text if verdict["time"] is None else f"{text}, {time_formatter(summary)(verdict['time'])}"
    )


def _limit_text(verdict: dict, summary: dict) -> str:
    this = LimitVerdict(**verdict)
    relation = "at least" if verdict["bound"] == "minimum" else "at most"
    value_text = (
        f"{verdict['quantity'].replace('_', ' ')} {_number(verdict['value'])} {verdict['unit']} "
        f"({where_and_when(verdict, summary)})"
    )
    state = (
        IN_WORDS[this.state]
        if this.state != OPEN
        else f"OPEN, because {undecided_limit_reason(this, summary)}"
    )
    margin = not_valid(summary) or "-"
    if verdict["margin"] is not None:
        margin = f"{_number(verdict['margin'])} {span(verdict['unit'])}"
    text = f"{state}: {verdict['name']}: {value_text}, {relation} {_number(verdict['limit'])}; margin {margin}"
    if verdict["error"] is not None and verdict["margin"] is not None:
        text += f" within {verdict['error']:.2g}"
    if (
        verdict["time"] is not None
        and verdict["until"] > 0.0
        and verdict["time"] >= verdict["until"] * (1.0 - 1e-9)
    ):
        text += ", at the end of the run: a longer run may reach a worse value"
    return text


def undecided_limit_reason(verdict, summary: dict) -> str:
    """Reason why a limit is undecided (state OPEN). verdict : `LimitVerdict`"""
    if verdict.doubtful:
        return "its margin is smaller than its error"
    return (
        undecided_reason(summary)
        or f"its {'value' if verdict.margin is None else 'error'} is not known"
    )


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
        lines.append(
            f"{places}: {text}: results from {time_text(group[0]['time'])} on are not to be trusted"
        )
    return lines


def undecided_reason(summary: dict) -> str:
    """Reason why a run cannot confirm a limit that it does not exceed; "" if it can."""
    late = [notice["text"] for notice in summary["warnings"] if notice["kind"] == "end"]
    if text := not_valid(summary):
        return f"the run is {text}"
    if not summary["marks"]:
        return (
            (late[0] if late else "")
            if summary["ok"]
            else f"the run is not ok ({summary['reason']})"
        )
    first = min(summary["marks"], key=lambda mark: mark["time"])
    return f"results from {time_formatter(summary)(first['time'])} on are not to be trusted"


def _comparison_text(comparison: dict, summary: dict) -> str:
    if comparison["rms"] is None:
        return f"{comparison['probe']} against {comparison['file']}: no measured time lies within the run"
    unit = comparison["unit"]
    span_unit = span(comparison["unit"])
    time_text = time_formatter(summary)
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
    cost = (
        f" ({_number(summary['cost'])} ns per cell and step)"
        if summary["cells"] and summary["cost"]
        else ""
    )
    newton = ""
    if summary["jacobians"]:
        newton += f", {summary['jacobians']} Jacobians, {summary['factorisations']} factorisations"
    if summary["newton"]:
        newton += f", {summary['newton']} Newton iterations, {summary['newton_failures']} failed"
    return f"{summary['steps']} steps{rejected}{newton}{cells}, {summary['seconds']:.3g} s{cost}"


def _number(value) -> str:
    if isinstance(value, list):  # a range
        return " to ".join(dict.fromkeys(map(_number, value)))
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
