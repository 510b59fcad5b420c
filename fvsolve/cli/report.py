"""What the terminal says about runs, cases and differences. Knows words and tables; computes nothing."""

from __future__ import annotations

from collections.abc import Callable

from fvsolve.cli.terminal import console as _console
from fvsolve.cli.terminal import line as _line
from fvsolve.cli.terminal import table as _table
from fvsolve.errors import listing
from fvsolve.output.directory import pictures_there
from fvsolve.units import span

ROWS = 20  # of a table at most; the rest is on disk
MANY = 40  # rows of a table of `check`: beyond, those that stand out
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
REASONS_SHOWN = 10  # the rest stands in summary.json


def result(one) -> None:
    """Least and greatest of every probe, marks, ledgers, expectations, comparisons, steps."""
    said, told = one.summary, when(one.summary)
    console = _console()
    if said["title"]:
        _line(console, said["title"], "bold")
    _extremes(console, one)
    for text in marks_of(said["marks"], told):
        _line(console, text, "yellow")
    for cavity in said["cavities"]:
        _line(console, cavity["text"])
    for event in said["events"][:EVENTS_SHOWN]:
        _line(console, f"{event['name']} {event['what']} at t = {told(event['time'])}")
    if len(said["events"]) > EVENTS_SHOWN:
        _line(console, f"and {len(said['events']) - EVENTS_SHOWN} more events; all stand in summary.json")
    for name, ledger in said["ledgers"].items():
        _line(console, f"{name} ledger: {_ledger(ledger)}")
    for claim in said["expectations"]:
        _line(console, _claim(claim, said), "green" if claim["ok"] else "bold red")
    for verdict in said["verdicts"]:
        _line(console, _verdict(verdict, said), "green" if verdict["ok"] else "bold red")
    for measured in said["comparisons"]:
        _line(console, _comparison(measured, said))
    _notices(console, said["warnings"])
    if "resolution" in said:
        _line(console, said["resolution"]["words"])
        for text in said["resolution"]["reasons"][:REASONS_SHOWN]:
            _line(console, f"error of {text}", "yellow")
    end = "" if "at t = " in said["reason"] else f" at t = {told(said['t'])}"
    _line(console, f"{said['reason']}{end}; {_cost(said)}", None if one.ok else "bold red")


def clock_of(said: dict):
    """The column of times of a run."""
    from fvsolve.output.column import UnitColumn

    return UnitColumn("t", "time", said["time_unit"])


def when(said: dict) -> Callable[[float], str]:
    """What tells times [s] in the unit of a run."""
    clock = clock_of(said)
    return lambda t: f"{_number(float(clock.from_si(t)))} {clock.unit}"


def files(one) -> None:
    """What is in the run directory now."""
    names = sorted([*one.summary["files"], *pictures_there(one.directory)])
    _line(_console(), f"{one.directory}: {', '.join(names)}")
    if one.reason.startswith("interrupted"):
        _line(_console(), "go on with the same command and --resume")


def exit_code(one) -> int:
    """0, or 1 where the run stopped early, a claim fails or a limit does not hold, or 130 where it was interrupted."""
    if one.reason.startswith("interrupted"):
        return 130
    return 0 if one.ok and all(claim.ok for claim in [*one.expectations, *one.verdicts]) else 1


def checks(case, found: dict, every: bool = False) -> None:
    """Fluid, nodes, pipes and basins at the start, the step and its cost, what will move; `every` row, or what stands
    out of many."""
    console = _console()
    _line(console, case.title or case.name, "bold")
    _line(console, _fluid(case, found["fluid"]))
    odd = {one["place"] for one in found["warnings"]}
    for group, word, keys in (
        ("nodes", "node", NODE),
        ("masses", "mass", MASS),
        ("bodies", "body", BODY),
        ("pipes", "pipe", PIPE),
    ):
        place = "links" if group == "pipes" else "nodes"
        _states(
            console, case, word, found[group], keys, every, {name for name in found[group] if f"{place}.{name}" in odd}
        )
    basins = found["basins"]
    _rows(console, case, "basin", basins, BASIN)
    patches = {f"{name}.{patch}": faces for name, one in basins.items() for patch, faces in one["patches"].items()}
    _rows(console, case, "patch", patches, PATCH)
    said = [f"friction of {name} remembers: {_memory(one['unsteady'])}"
            for name, one in found["pipes"].items() if "unsteady" in one]  # fmt: skip
    said += _walls(case, found["pipes"])
    lines = {name: one for name, one in found["pipes"].items() if one["line"] == "delay"}
    said += [f"{name} is a delay line, off by at most {one['line_bound']:.2g} of the greatest jump: {one['line_why']}"
             for name, one in lines.items()]  # fmt: skip
    if lines:
        said += [f"{name} has cells: {one['line_why']}" for name, one in found["pipes"].items() if name not in lines]
    _cut(console, said, every)
    _cut(console, [f"moves from the start: {text}" for text in found["moving"]], every)
    _notices(console, found["warnings"], every)
    if found["basins"]:
        _line(console, _threads(found["threads"]))
    _line(console, _step(case, found))


def _rows(console, case, word: str, found: dict, keys: dict) -> None:
    """A table of basins or patches in the units of `[output]`, none of none."""
    from fvsolve.output.column import column

    columns = [column(said, dimension, case) if dimension else None for said, dimension in keys.values()]
    heads = [said if one is None else one.header for (said, _), one in zip(keys.values(), columns, strict=True)]
    rows = [[name, *(_number(one.get(key) if unit is None else _in(unit, one.get(key)))
                     for key, unit in zip(keys, columns, strict=True))] for name, one in found.items()]  # fmt: skip
    if rows:
        _table([word, *heads], rows, console)
        _line(console, "")


def _walls(case, pipes: dict) -> list[str]:
    """What walls are and whose figures these are, of pipes alike in one line."""
    alike: dict[str, list[str]] = {}
    for name, one in pipes.items():
        if said := _wall(case, one):
            alike.setdefault(said, []).append(name)
    return [f"wall of {listing(names)}: {said}" for said, names in alike.items()]


def _wall(case, one: dict) -> str:
    from fvsolve.output.column import column

    said = []
    if "allowable_pressure" in one:
        unit = column("allowable", "gauge_pressure", case)
        said.append(f"bears {_number(_in(unit, one['allowable_pressure']))} {unit.unit}")
    if "creep" in one:
        speed = case.amount(one["creep"]["slow_speed"], "velocity")
        said.append(f"{one['creep']['elements']} elements creep, slow waves run at {speed}")
    if "restraint_factor" in one:
        said.append(f"restraint {one['restraint_factor']:.4g}")
    if "source" in one:
        said.append(one["source"])
    if one.get("unread"):
        keys = listing(one["unread"]).replace("_", " ")
        said.append(f"{keys} of {one['material']}: no source was read, so they are the user's to give")
    return "; ".join(said)


def _threads(found: dict) -> str:
    """What threads can share out."""
    if found["why"]:
        return f"threads: one; {found['why']}"
    rows = ", ".join(f"{many} rows of {name}" for name, many in found["rows"].items())
    kept = "; ".join(f"{name}: {why}" for name, why in found["whole"].items())
    return f"threads: up to {found['most']} share out {rows}" + (f"; each steps the whole of {kept}" if kept else "")


def _states(console, case, word: str, found: dict, keys: dict, every: bool, odd: set[str]) -> None:
    """Parts at the start in the units of `[output]`; of many, least and greatest of each column and the `odd`."""
    from fvsolve.output.column import column

    if not found:
        return
    columns = [column(said, dimension, case) for said, dimension in keys.values()]
    names = list(found) if every or len(found) <= MANY else _outstanding(found, keys, odd)
    rows = [[name, *(_number(_in(one, found[name][key])) for key, one in zip(keys, columns, strict=True))]
            for name in names]  # fmt: skip
    _table([word, *(one.name if one.dimension == "number" else one.header for one in columns)], rows, console)
    if len(names) < len(found):
        _line(console, f"... {len(found) - len(names)} more of {len(found)}; here stand least and greatest of each "
                       "column and what is noted, --all shows all")  # fmt: skip
    _line(console, "")


def _outstanding(found: dict, keys: dict, odd: set[str]) -> list[str]:
    """Names with the least or greatest value of a column, and the `odd` ones, in their order."""
    kept = set(sorted(odd)[:MANY])
    for key in keys:
        there = [name for name, one in found.items() if one[key] is not None]
        if there:
            kept |= {pick(there, key=lambda name: found[name][key]) for pick in (min, max)}  # noqa: B023
    return [name for name in found if name in kept]


def _fluid(case, found: dict) -> str:
    """The fluid in the units of `[output]`; its modulus in that of pressures."""
    from fvsolve.output.column import column

    said = []
    for key, dimension in FLUID.items():
        one = column(key, dimension, case)
        if dimension == "modulus":
            one = column(key, dimension, case, span(one.unit))
        said.append(f"{key.replace('_', ' ')} {'unknown' if found[key] is None else _number(_in(one, found[key]))}"
                    f"{'' if found[key] is None else ' ' + one.unit}")  # fmt: skip
    name = "" if found["name"] == found["source"] else f" ({found['source']})"
    return f"fluid {found['name']}{name}: {', '.join(said)}"


def _in(column, value):
    """A number in the unit of a column; None where there is none."""
    if isinstance(value, list):  # a range
        return [_in(column, one) for one in value]
    return value if value is None or column.plain else float(column.from_si(value))


def _cut(console, lines: list[str], every: bool) -> None:
    """Lines, the first ones of many."""
    shown = len(lines) if every or len(lines) <= EVENTS_SHOWN + 2 else EVENTS_SHOWN
    for text in lines[:shown]:
        _line(console, text)
    if len(lines) > shown:
        _line(console, f"... {len(lines) - shown} more like these")


def _notices(console, warnings: list[dict], every: bool = False) -> None:
    """What is wrong, and of what is only to be known the first ones of many."""
    for one in warnings:
        if not one["ok"]:
            _line(console, f"note: {one['text']}", "bold red")
    _cut(console, [f"note: {one['text']}" for one in warnings if one["ok"]], every)


def _memory(one: dict) -> str:
    return (f"{one['weighting']}, {one['terms']} terms a cell, within {one['accuracy']:g} up to "
            f"{one['frequency']:.3g} Hz")  # fmt: skip


def titles(found: dict[str, str]) -> None:
    """The shipped cases."""
    _table(["case", "title"], [[name, title] for name, title in found.items()])


def differences(found: dict, said: dict) -> None:
    """Differences of two runs, per shared probe, times in the unit of the first, whose summary is `said`."""
    clock, rows = clock_of(said), []
    for name, one in found["probes"].items():
        when = None if one["t_greatest"] is None else clock.from_si(one["t_greatest"])
        rows.append([name, span(one["unit"]), *map(_number, (one["greatest"], when, one["rms"]))])
    _table(["probe", "unit", "greatest difference", f"at [{clock.unit}]", "rms"], rows)
    for key in ("only_a", "only_b"):
        if found[key]:
            _line(_console(), f"only in {found[key[-1]]}: {', '.join(found[key])}")


def _extremes(console, one) -> None:
    from fvsolve.output.column import UnitColumn
    from fvsolve.run.result import not_valid

    clock = UnitColumn("at", "time", one.summary["time_unit"])
    none = not_valid(one.summary) or "-"
    rows = [[name, one.units[name], none if found.least is None else _number(found.least),
             _number(_in(clock, found.t_least)), none if found.greatest is None else _number(found.greatest),
             _number(_in(clock, found.t_greatest))] for name, found in one.extremes.items()]  # fmt: skip
    heads = ["probe", "unit", "least", clock.header, "greatest", clock.header]
    if "peaks" in one.summary:
        heads = ["probe", "unit", "least", "+-", clock.header, "greatest", "+-", clock.header]
        for row, peak in zip(rows, one.summary["peaks"].values(), strict=True):
            row[3:3] = [_off(peak["least"])]
            row[6:6] = [_off(peak["greatest"])]
    if rows:
        _table(heads, rows[:ROWS], console)
    if len(rows) > ROWS:
        where = f"in {one.directory / 'summary.json'}" if one.directory else "in Result.extremes"
        _line(console, f"... {len(rows) - ROWS} more {where}")


def _step(case, found: dict) -> str:
    if found["step"] is None:
        return f"step: {found['step_set_by']}"
    expected = found["expected_seconds"]
    cost = "" if expected is None else f", about {expected:.2g} s"
    step = f"step at the start {case.step_amount(found['step'])}, set by {found['step_set_by']}"
    return f"{step}; {found['steps']} such steps{cost}"


def _ledger(ledger: dict) -> str:
    kept = f"remainder {_number(ledger['remainder'])}"
    return f"{kept}, {_number(ledger['relative'])} of the largest term" if "relative" in ledger else kept


def _claim(one: dict, said: dict) -> str:
    from fvsolve.run.result import IN_WORDS, OPEN

    why = "" if one["state"] != OPEN else why_open(said) or "its value is not known"
    verdict = f"OPEN, as {why}" if why else IN_WORDS[one["state"]]
    return (
        f"{verdict}: {one['text']} = {_number(one['claimed'])} {one['unit']} within "
        f"{_number(one['tolerance'])} {span(one['unit'])}: found {_number(one['found'])}"
        f"{'' if one['error'] is None else f' +- {_off(one)}'}"
    )


def _off(peak: dict) -> str:
    """How far a peak may be off; "?" where that is not known."""
    return "?" if peak["error"] is None else f"{peak['error']:.2g}"


def where_and_when(one: dict, said: dict) -> str:
    """Where and when a verdict is nearest to its limit, in the units of a run's summary."""
    from fvsolve.output.column import UnitColumn

    along = UnitColumn("chainage", "length", said["envelope_units"]["distance"])
    where = "" if one["chainage"] is None else f" at {_number(_in(along, one['chainage']))} {along.unit}"
    return one["place"] + where + ("" if one["time"] is None else f", {when(said)(one['time'])}")


def _verdict(one: dict, said: dict) -> str:
    from fvsolve.run.result import IN_WORDS, OPEN, LimitVerdict, not_valid

    this = LimitVerdict(**one)
    beside = "at least" if one["bound"] == "least" else "at most"
    found = f"{one['quantity'].replace('_', ' ')} {_number(one['value'])} {one['unit']} ({where_and_when(one, said)})"
    held = IN_WORDS[this.state] if this.state != OPEN else f"OPEN, as {open_as(this, said)}"
    margin = not_valid(said) or "-" if one["margin"] is None else f"{_number(one['margin'])} {span(one['unit'])}"
    text = f"{held}: {one['name']}: {found}, {beside} {_number(one['limit'])}; margin {margin}"
    if one["error"] is not None and one["margin"] is not None:
        text += f" within {one['error']:.2g}"
    if one["time"] is not None and one["until"] > 0.0 and one["time"] >= one["until"] * (1.0 - 1e-9):
        text += ", at the end of the run: a later end may be worse"
    return text


def open_as(verdict, said: dict) -> str:
    """Why a limit that may be passed, or is not, does not hold either."""
    if verdict.doubtful:
        return "its margin is smaller than its error"
    return why_open(said) or f"its {'value' if verdict.margin is None else 'error'} is not known"


def marks_of(marks: list[dict], told) -> list[str]:
    """What the model carried on through, each said once with the places that met it, the first one first."""
    alike: dict[str, list[dict]] = {}
    for mark in sorted(marks, key=lambda mark: mark["time"]):
        alike.setdefault(mark["text"].partition(": ")[2], []).append(mark)
    found = []
    for text, those in alike.items():
        names = [mark["text"].partition(": ")[0] for mark in those]
        more = f" and {len(names) - PLACES_SHOWN} more" if len(names) > PLACES_SHOWN else ""
        where = ", ".join(names[:PLACES_SHOWN]) + more
        found.append(f"{where}: {text}: results from {told(those[0]['time'])} on are not to be trusted")
    return found


def why_open(said: dict) -> str:
    """Why a run cannot tell whether a limit holds that it does not pass; "" where it can."""
    from fvsolve.run.result import not_valid

    late = [one["text"] for one in said["warnings"] if one["kind"] == "end"]
    if text := not_valid(said):
        return f"the run is {text}"
    if not said["marks"]:
        return (late[0] if late else "") if said["ok"] else f"the run is not ok ({said['reason']})"
    first = min(said["marks"], key=lambda mark: mark["time"])
    return f"results from {when(said)(first['time'])} on are not to be trusted"


def _comparison(one: dict, said: dict) -> str:
    if one["rms"] is None:
        return f"{one['probe']} against {one['file']}: no measured time lies within the run"
    unit, apart, told = one["unit"], span(one["unit"]), when(said)
    return (
        f"{one['probe']} against {one['file']}: rms {_number(one['rms'])} {apart}, greatest difference "
        f"{_number(one['greatest_difference'])} {apart} at {told(one['t_greatest_difference'])}; peak "
        f"{_number(one['computed_peak'])} {unit} at {told(one['t_computed_peak'])}, measured "
        f"{_number(one['measured_peak'])} {unit} at {told(one['t_measured_peak'])}"
    )


def _cost(said: dict) -> str:
    rejected = f", {said['rejections']} rejected" if said["rejections"] else ""
    cells = f", {said['cells']} cells" if said["cells"] else ""
    cost = f" ({_number(said['cost'])} ns per cell and step)" if said["cells"] and said["cost"] else ""
    newton = f", {said['jacobians']} Jacobians, {said['factorisations']} factorisations" if said["jacobians"] else ""
    newton += f", {said['newton']} Newton iterations, {said['newton_failures']} failed" if said["newton"] else ""
    return f"{said['steps']} steps{rejected}{newton}{cells}, {said['seconds']:.3g} s{cost}"


def _number(value) -> str:
    if isinstance(value, list):  # a range
        return " to ".join(dict.fromkeys(map(_number, value)))
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
