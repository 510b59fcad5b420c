"""EPANET files of folders: import, start, day and closure by fvsolve, beside EPANET's own toolkit on the original file.

python benchmarks/epanet_files.py [--quick] [--day] [--closure] [--version 2.2] [--jobs 1] [--limit-nodes N]
    [--limit 120] [--day-limit 300] [--json FILE] PATH...

PATH is an .inp file or a folder. Files with equal bytes are examined once, each in a process of its own, so that a file
that hangs or crashes does not stop the table. Start: worst difference of heads and of flows at hour 0; nodes without a
path of open links to a source are left out, because no law gives their heads ("dead"). Day: worst difference of levels
at any time, and of heads at two rows in a row (5 min apart, because switches differ by seconds), from EPANET with steps
of 10 s, or of 2 s where that differs by more than 1 cm, because EPANET delays switches by up to a step; CPU times of
both at 10 s, without compilation. Closure: the largest demand stops within 4 s, in a run with waves.
A difference above 1 cm, or 1 % of the largest flow, is `named` if a note of the import explains it, else `silent`.
"""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
import os
import signal
import tempfile
import tomllib
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from time import monotonic, process_time, sleep
from typing import Any

import epanet_engine
import numpy as np
from measure import SKIPPED, agree, parser

# differences of heads [m], and of flows over the largest flow
CLOSE, NEAR, SHARE = 1e-3, 1e-2, 0.01
TINY_FLOW = 1e-5  # a smaller largest flow is no measure: closed links of EPANET leak 3e-8 [m3/s]
DRY = ("dry",)  # marks of a run that explain a difference: EPANET shuts the links of an empty tank
# times between which the largest demand stops [s], end of the run
CLOSURE, CLOSURE_END = (1.0, 5.0), "15 s"
ROWS, GRACE = 150, 60.0  # interval of rows of a day [s]; time after a limit to end in order [s]
# of EPANET over a day [s]; the second where the first differs: EPANET delays switches by a step
STEPS = (10, 2)
HARD = {"EPANET day": 1200.0}  # time limits of stages that have no option [s]

Row = dict[str, Any]


# Judgement -----------------------------------------------------------------------------------------------------------


def worst(
    ours: dict[str, float], theirs: dict[str, float], left_out: tuple[str, ...] | list[str] = ()
) -> Row:
    """Greatest difference of two tables of values, with its name and both values; a value that is missing is infinite.

    left_out : names that are not compared
    """
    found = {"difference": 0.0, "name": "", "ours": math.nan, "theirs": math.nan}
    for name in theirs.keys() - set(left_out):
        mine = ours.get(name, math.nan)
        apart = abs(mine - theirs[name])
        apart = apart if math.isfinite(apart) else math.inf
        if apart > found["difference"] or not found["name"]:
            found = {"difference": apart, "name": name, "ours": mine, "theirs": theirs[name]}
    return found


def worst_in_rows(times: np.ndarray, apart: np.ndarray, names: list[str]) -> Row:
    """Greatest difference in rows, with its name and time; apart : differences float64[rows, names]"""
    if not apart.size:
        return {"difference": 0.0, "name": "", "time": 0.0}
    apart = np.where(np.isfinite(apart), apart, np.inf)
    row, column = np.unravel_index(np.argmax(apart), apart.shape)
    return {
        "difference": float(apart[row, column]),
        "name": names[column],
        "time": float(times[row]),
    }


def lasting(apart: np.ndarray) -> np.ndarray:
    """Differences that hold at two rows in a row: the smaller of each and the next; a single row is kept."""
    apart = np.where(np.isfinite(apart), apart, np.inf)
    return np.minimum(apart[:-1], apart[1:]) if len(apart) > 1 else apart


def verdict(row: Row) -> str:
    """Word for the start of a file: `1 mm`, `1 cm`, `named`, `silent`, `left out`, or who refused it."""
    if "left_out" in row:
        return "left out"
    if row["epanet"] != "ok":
        return "refused by EPANET"
    if row.get("import") != "ok" or "head" not in row:
        return "refused by us"
    if row["head"]["difference"] <= NEAR and row["flow"]["share"] <= SHARE:
        return "1 mm" if row["head"]["difference"] <= CLOSE else "1 cm"
    return "named" if row["causes"] or unsolved(row) else "silent"


def unsolved(row: Row) -> list[str]:
    """Reasons why EPANET's values are not a solution that a network could have."""
    return [text for text in row["warnings"] if text in epanet_engine.UNSOLVED]


def reason(row: Row) -> str:
    """Reason of a difference or refusal: EPANET's message, ours, or the notes that explain it."""
    word = verdict(row)
    if word == "left out":
        return row["left_out"]
    if word == "refused by EPANET":
        return row["epanet"]
    if word in ("1 mm", "1 cm"):
        return ""
    found = [f"EPANET: {text}" for text in unsolved(row)]
    if word == "refused by us":
        return "; ".join([*found, row.get("error", row.get("import", "no result"))])
    return "; ".join([*found, *row["causes"]]) or "no note explains it"


def day_verdict(day: Row) -> str:
    """Word for the day of a file: `1 mm`, `1 cm`, `named`, `silent`, `stopped`, or who refused it."""
    if "level" not in day:
        return "refused by EPANET" if day.get("error", "").startswith("EPANET") else "refused by us"
    if not day["ok"]:
        return "stopped"
    if is_near(day):
        return "1 mm" if is_near(day, CLOSE) else "1 cm"
    return "named" if day["causes"] or day_unsolved(day) else "silent"


def is_near(day: Row, most: float = NEAR) -> bool:
    """True if levels and heads of a day differ by `most` or less [m]."""
    return max(day["level"]["difference"], day["head"]["difference"]) <= most


def day_unsolved(day: Row) -> list[str]:
    """Reasons, with times, why EPANET's values of a day are not those that a network could have."""
    found = day.get("epanet_warnings", {})
    return [
        f"EPANET: {text} from {time / 3600.0:.2f} h"
        for text, time in found.items()
        if text in epanet_engine.UNSOLVED
    ]


def counts(rows: list[Row], files: int) -> dict[str, int]:
    """Numbers of files, by verdict; files : number of files before equal ones were left out"""
    words = Counter(verdict(row) for row in rows)
    runs = [row for row in rows if row["epanet"] == "ok"]
    refused = [row for row in runs if verdict(row) == "refused by us"]
    found = {
        "files found": files,
        "distinct files": len(rows),
        "EPANET runs": len(runs),
        "left out": words["left out"],
        "imported": sum(row.get("import") == "ok" for row in runs),
        "imported, its case refused": sum(row.get("import") == "ok" for row in refused),
        "within 1 mm": words["1 mm"],
        "within 1 cm": words["1 mm"] + words["1 cm"],
        "above, with named cause": words["named"],
        "silent": words["silent"],
        "refused by us": words["refused by us"],
        "of these, without a solution of EPANET": sum(bool(unsolved(row)) for row in refused),
        "refused by EPANET": words["refused by EPANET"],
        "refused by EPANET, imported": sum(
            row["epanet"] != "ok" and row.get("import") == "ok" for row in rows
        ),
    }
    days = [row["day"] for row in rows if "day" in row]
    if days:
        words = Counter(day_verdict(day) for day in days)
        ended = [day for day in days if day["ok"]]
        found |= {
            "days": len(days),
            "days to their end": len(ended),
            "days within 1 mm": words["1 mm"],
            "days within 1 cm": words["1 mm"] + words["1 cm"],
            "days above, with named cause": words["named"],
            "days silent": words["silent"],
            "days that stop": words["stopped"],
            "days refused by us": words["refused by us"],
            "days within 3 times EPANET's CPU": sum(
                day["cpu"] <= 3.0 * day["epanet_cpu"] for day in ended
            ),
        }
    closures = [row["closure"] for row in rows if "closure" in row]
    if closures:
        found |= {"closures": len(closures), "closures ok": sum(item == "ok" for item in closures)}
    return found


# Examination of a file, in its own process ---------------------------------------------------------------------------


class Record:
    """Row of a file, written to a JSON file after each stage, so that a killed process leaves what it found."""

    def __init__(self, path: Path) -> None:
        self.path, self.row = path, {"epanet": "no result", "seconds": {}}

    def stage(self, name: str) -> None:
        """Begin a stage."""
        self.row["stage"] = name
        self.write()

    def write(self) -> None:
        """Write the row."""
        fresh = self.path.with_suffix(".new")
        fresh.write_text(json.dumps(self.row))
        os.replace(fresh, self.path)


def set_error(row: Row, stage: str, text: str) -> None:
    """Write an error to the part of a row that a stage fills."""
    if stage == "EPANET":
        row["epanet"] = text
    elif "day" in stage:
        row["day"]["error"] = text
    elif stage == "closure":
        row["closure"] = text
    else:
        row["error"] = text
        row.setdefault("import", "refused")


def examine(path: Path, options: Any, record: Record) -> None:
    """Fill the row of a file."""
    from fvsolve.errors import FvsolveError

    row = record.row
    record.stage("EPANET")
    theirs = None
    try:
        theirs = epanet_engine.start(path, options.version)
    except epanet_engine.EpanetError as error:
        row["epanet"] = str(error)
    else:
        row |= {
            "epanet": "ok",
            "nodes": len(theirs.heads),
            "links": len(theirs.flows),
            "dead": theirs.dead,
            "warnings": theirs.warnings,
            "accuracy": theirs.accuracy,
        }
        if options.limit_nodes and row["nodes"] > options.limit_nodes:
            row["left_out"] = f"more than {options.limit_nodes} nodes"
            return
    record.stage("import")
    try:
        imported = timed(record, "import", lambda: imported_network(path))
        row |= {"import": "ok", "notes": imported.notes, "causes": imported.causes}
        record.stage("start")
        case = tomllib.loads(imported.text)
        if theirs is not None:
            compare_start(imported, case, theirs, record)
        if options.closure and theirs is not None:
            record.stage("closure")
            row["closure"] = closure(case, options.limit)
    except FvsolveError as error:
        set_error(row, row["stage"], f"{row['stage']}: {error}")
    if options.day and theirs is not None:
        examine_day(path, options, record)


def imported_network(path: Path, **options: Any) -> Any:
    """Import a network by fvsolve."""
    from fvsolve.exchange.epanet import import_network

    return import_network(path, **options)


def timed(record: Record, name: str, function: Callable[[], Any]) -> Any:
    """Call a function; its wall time is written to the row."""
    began = monotonic()
    try:
        return function()
    finally:
        record.row["seconds"][name] = round(monotonic() - began, 3)


def compare_start(imported: Any, case: dict, theirs: epanet_engine.Start, record: Record) -> None:
    """Compare heads of all nodes and flows of all links at the start of a case with EPANET's."""
    import fvsolve

    nodes, links = imported.nodes, imported.links
    probes = [f"nodes.{name}.head" for name in nodes.values()] + [
        f"links.{name}.flow" for name in links.values()
    ]
    given = fvsolve.load({**case, "output": {"probes": probes}})
    model = timed(record, "start", lambda: fvsolve.build(given))
    values = model.observe(fvsolve.initial_state(model)).tolist()
    flow = worst(dict(zip(links, values[len(nodes) :], strict=True)), theirs.flows)
    largest = max(map(abs, theirs.flows.values()), default=0.0)
    flow["share"] = flow["difference"] / max(largest, TINY_FLOW)
    record.row["flow"] = flow
    record.row["head"] = worst(
        dict(zip(nodes, values[: len(nodes)], strict=True)), theirs.heads, theirs.dead
    )


def within(limit: float) -> Callable[[float, float, int], None]:
    """Progress of a run that ends it in order after a time [s]."""
    until = monotonic() + limit

    def progress(t: float, seconds: float, steps: int) -> None:
        if monotonic() > until:
            raise KeyboardInterrupt

    return progress


def closure(case: dict, limit: float) -> str:
    """Result of a run in which the largest demand stops within 4 s: `ok`, or the reason why not."""
    import fvsolve
    from fvsolve.errors import FvsolveError

    demands = {
        name: float(str(part["demand"]).split()[0])
        for name, part in case["nodes"].items()
        if "demand" in part
    }
    name = max(demands, key=demands.get, default="")
    if not name or demands[name] <= 0.0:
        return "no demand"
    value = case["nodes"][name]["demand"]
    stops = {"time": [0.0, *CLOSURE], "value": [value, value, "0 l/s"]}
    given = case | {"nodes": case["nodes"] | {name: case["nodes"][name] | {"demand": stops}}}
    given["numerics"] = case["numerics"] | {"end": CLOSURE_END}
    try:
        run = fvsolve.run(given, progress=within(limit))
    except FvsolveError as error:
        return f"{name}: {error}"
    return "ok" if run.ok else f"{name}: {run.reason} at {run.seconds[-1]:.4g} s"


def examine_day(path: Path, options: Any, record: Record) -> None:
    """Run a day by EPANET and by fvsolve, and compare levels and heads."""
    import fvsolve
    from fvsolve.errors import FvsolveError
    from fvsolve.exchange.epanet.self_check import cycling_tanks, late_switches, switches_at_limits

    day = record.row["day"] = {"ok": False}
    record.stage("EPANET day")
    try:
        theirs = epanet_engine.day(path, options.version, STEPS[0], ROWS)
    except epanet_engine.EpanetError as error:
        day["error"] = f"EPANET: {error}"
        return
    day |= {"epanet_cpu": theirs.cpu, "epanet_end": theirs.end, "epanet_warnings": theirs.warnings}
    try:
        record.stage("day import")
        imported = timed(record, "day import", lambda: imported_network(path, day=True))
        day |= {"notes": imported.notes, "causes": imported.causes}
        case = tomllib.loads(imported.text)
        case["output"] = {
            "every": float(ROWS),
            "probes": [f"nodes.{name}.head" for name in imported.nodes.values()],
        }
        record.stage("day")
        fvsolve.run(case, {"numerics.end": 1.0}, progress=within(options.day_limit))  # compiles
        began = process_time()
        run = fvsolve.run(case, progress=within(options.day_limit))
        day["cpu"] = process_time() - began
    except FvsolveError as error:
        day["error"] = f"{record.row['stage']}: {error}"
        return
    summary = run.summary
    steps = {key: summary[key] for key in ("steps", "seconds", "seconds_setup") if key in summary}
    day |= {"ok": run.ok, "reason": run.reason, "end": float(run.seconds[-1]), **steps}
    day["marks"] = [f"{mark['text']} at {mark['time'] / 3600.0:.2f} h" for mark in summary["marks"]]
    day["causes"] += [
        text
        for mark, text in zip(summary["marks"], day["marks"], strict=True)
        if mark["what"] in DRY
    ]
    day |= {"step": STEPS[0], **compare_day(run, imported.nodes, theirs)}
    if run.ok and not is_near(day) and not day_unsolved(day):
        record.stage("EPANET day")
        day |= {"step": STEPS[1], "at_first_step": [day["level"], day["head"]]}
        day |= compare_day(
            run, imported.nodes, epanet_engine.day(path, options.version, STEPS[1], ROWS)
        )
        day["causes"] = day["causes"] + late_switches(
            day["at_first_step"][0]["difference"], day["level"]["difference"]
        )
    day["causes"] = day["causes"] + switches_at_limits(summary["events"])
    if day["level"]["difference"] <= NEAR:  # a cycle at a limit keeps the levels
        day["causes"] = day["causes"] + cycling_tanks(summary["events"])
        text = "EPANET lets tanks give water at their least level, or take it at their greatest"
        day["causes"] += [f"{text}: {', '.join(theirs.crossed)}"] * bool(theirs.crossed)


def compare_day(run: Any, nodes: dict[str, str], theirs: epanet_engine.Day) -> Row:
    """Worst differences of levels and heads over a day, up to the end of both runs."""
    until = min(run.seconds[-1], theirs.end)
    rows = np.flatnonzero((theirs.times <= until) & np.isin(theirs.times, np.round(run.seconds, 6)))
    at = np.searchsorted(np.round(run.seconds, 6), theirs.times[rows], side="right") - 1
    ours = np.stack([run.si(f"nodes.{nodes[name]}.head")[at] for name in theirs.names], axis=1)
    apart, times = np.abs(ours - theirs.heads[rows]), theirs.times[rows]
    tank = np.isin(theirs.names, theirs.tanks)
    heads = np.where(theirs.dead[rows], 0.0, apart)
    level = worst_in_rows(times, apart[:, tank], theirs.tanks)
    return {
        "level": level,
        "head": worst_in_rows(times, lasting(heads), theirs.names),
        "rows": len(rows),
    }


def child(path: Path, options: Any, record: Record) -> None:
    """Examine a file in a process of its own group, whatever happens."""
    os.setsid()
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
        os.dup2(nothing.fileno(), 2)
    try:
        examine(path, options, record)
    except BaseException as error:  # noqa: BLE001  a fault of the program is a line of the table
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        stage = record.row["stage"]
        set_error(record.row, stage, f"{stage}: {type(error).__name__}: {error} ({where})")
    record.row["stage"] = "end"
    record.write()


# Table ---------------------------------------------------------------------------------------------------------------


class Examination:
    """Process that examines a file, with the stage that it has reached."""

    def __init__(self, path: Path, options: Any, record: Record) -> None:
        self.path, self.options, self.record = path, options, record
        self.stage, self.since, self.late = "EPANET", monotonic(), False
        record.stage(self.stage)
        self.process = multiprocessing.get_context("fork").Process(
            target=child, args=(path, options, record)
        )
        self.process.start()

    def ended(self) -> bool:
        """True if the process has ended, or was stopped because a stage exceeded its limit."""
        stage = json.loads(self.record.path.read_text())["stage"]
        if stage != self.stage:
            self.stage, self.since = stage, monotonic()
        self.late = monotonic() - self.since > limit_of(stage, self.options)
        if self.late:
            self.stop()
        return not self.process.is_alive()

    def stop(self) -> None:
        """Kill the process and those that it started."""
        if self.process.is_alive():
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.join()

    def row(self) -> Row:
        """Row of the file; a process that was killed or crashed has an error with its stage."""
        row = json.loads(self.record.path.read_text())
        return with_fate(row, self.late, self.process.exitcode, self.options)


def examined(paths: list[Path], options: Any, show: Callable[[Path, Row], None]) -> None:
    """Examine files, `jobs` at a time, and show each row when it is complete."""
    waiting, active = list(paths), []
    with tempfile.TemporaryDirectory() as folder:
        try:
            while waiting or active:
                while waiting and len(active) < options.jobs:
                    record = Record(Path(folder) / f"{len(waiting)}.json")
                    active.append(Examination(waiting.pop(0), options, record))
                sleep(0.02)
                for item in [item for item in active if item.ended()]:
                    active.remove(item)
                    item.process.join()
                    show(item.path, item.row())
        finally:
            for item in active:
                item.stop()


def limit_of(stage: str, options: Any) -> float:
    """Time limit of a stage [s]; runs end themselves in order before it."""
    limit = HARD.get(stage, options.day_limit if stage.startswith("day") else options.limit)
    return {"day": 2.0 * limit, "closure": limit}.get(stage, limit) + (
        GRACE if stage in ("day", "closure") else 0.0
    )


def with_fate(row: Row, late: bool, code: int | None, options: Any) -> Row:
    """Row of a process that has ended; late : True if it was killed, code : its exit status"""
    stage = row.pop("stage")
    if stage != "end":
        text = (
            f"no end within {limit_of(stage, options):g} s"
            if late
            else f"crash, exit status {code}"
        )
        set_error(row, stage, f"{stage}: {text}")
    return row


def length(value: float) -> str:
    """Difference of heads as a short text [m]."""
    return f"{value:8.4f}" if value < 1000.0 else f"{value:8.1e}"


def line(name: str, row: Row) -> str:
    """Line of the table."""
    nodes = str(row.get("nodes", "-"))
    seconds = row["seconds"]
    words = [f"{name:44.44}", f"{nodes:>6}", f"{verdict(row):17}"]
    words.append(f"{seconds.get('import', math.nan):6.1f}{seconds.get('start', math.nan):6.1f}")
    if "head" in row:
        head, flow = row["head"], row["flow"]
        words.append(f"{length(head['difference'])} {head['name']:12.12}")
        words.append(
            f"{1e3 * flow['difference']:9.4f} {100.0 * flow['share']:8.4f}% {flow['name']:12.12}"
        )
        words.append(f"{len(row['dead']):4}")
    extra = [", ".join(row.get("warnings", [])), reason(row).replace("\n", " ")]
    return " ".join([*words, " | ".join(text for text in extra if text)[:220]])


def day_line(day: Row) -> str:
    """Further line of the table: the day of a file."""
    words = [f"    day: {day_verdict(day):13}"]
    if "level" in day:
        level, head = day["level"], day["head"]
        words.append(
            f"level {length(level['difference'])} m {level['name']:12.12} at {level['time'] / 3600.0:5.2f} h,"
        )
        words.append(
            f"head {length(head['difference'])} m {head['name']:12.12} at {head['time'] / 3600.0:5.2f} h,"
        )
        words.append(
            f"CPU {day['cpu']:.2f} s, {day['steps']} steps; EPANET {day['epanet_cpu']:.2f} s;"
        )
        words += [f"EPANET with steps of {day['step']} s;"] if day["step"] != STEPS[0] else []
    told = (
        ""
        if day["ok"]
        else day.get("error") or f"{day.get('reason')} at {day.get('end', 0.0) / 3600.0:.2f} h"
    )
    parts = [told, *day_unsolved(day), *day.get("causes", [])]
    return " ".join([*words, " | ".join(part.replace("\n", " ") for part in parts if part)[:300]])


HEADER = (
    f"{'file':44} {'nodes':>6} {'start':17} {'import, start s':>12} {'head m':>6} {'node':12} {'flow l/s':>9} "
    f"{'share':>9} {'link':12} dead reason"
)


def files_of(places: list[Path]) -> list[tuple[str, Path]]:
    """Files of folders, each with its name in the table; one of equal names gets its folder."""
    found = []
    for place in places:
        inside = sorted(
            path for path in place.rglob("*") if path.suffix.lower() == ".inp" and path.is_file()
        )
        found += [place] if place.is_file() else inside
    names = Counter(path.name for path in found)
    return [
        (path.name if names[path.name] == 1 else f"{path.parent.name}/{path.name}", path)
        for path in found
    ]


def distinct(files: list[tuple[str, Path]]) -> list[tuple[str, Path]]:
    """Files without those whose bytes equal an earlier one's, the smallest first."""
    first: dict[str, tuple[str, Path]] = {}
    for name, path in files:
        first.setdefault(hashlib.sha256(path.read_bytes()).hexdigest(), (name, path))
    return sorted(first.values(), key=lambda item: item[1].stat().st_size)


def table(places: list[Path], options: Any) -> list[Row]:
    """Print the table of all files and its counts; return the rows."""
    files = files_of(places)
    chosen, rows = distinct(files), []
    names = {path: name for name, path in chosen}

    def show(path: Path, row: Row) -> None:
        print(line(names[path], row), flush=True)
        if "day" in row:
            print(day_line(row["day"]), flush=True)
        if "closure" in row:
            print(f"    closure: {row['closure']}", flush=True)
        rows.append({"file": str(path), "verdict": verdict(row), "reason": reason(row), **row})
        if options.json:
            found = {"version": options.version, "counts": counts(rows, len(files)), "rows": rows}
            options.json.write_text(json.dumps(found, indent=1))

    print(HEADER, flush=True)
    examined([path for _, path in chosen], options, show)
    for text, number in counts(rows, len(files)).items():
        print(f"{number:6} {text}")
    return rows


SMALL = """[JUNCTIONS]
a 10 5 day
b 12 3
[RESERVOIRS]
lake 60
[TANKS]
tower 40 3 1 6 12 0
[PIPES]
p1 lake a 400 250 110 0 Open
p2 a b 300 150 110 2.5 Open
p3 b tower 350 200 110 0 Open
[PATTERNS]
day 0.5 1.5
[OPTIONS]
UNITS LPS
HEADLOSS H-W
[END]
"""
FAULTY = SMALL.replace("p2 a b", "p2 a nowhere")


def small_files(folder: Path) -> None:
    """Write a network that EPANET runs and a network that it refuses."""
    (folder / "small.inp").write_text(SMALL)
    (folder / "faulty.inp").write_text(FAULTY)


def main() -> None:
    """Print the table of the given files."""
    options = parser(__doc__)
    options.add_argument(
        "paths", nargs="*", type=Path, metavar="PATH", help="folders or files (default none)"
    )
    options.add_argument("--day", action="store_true", help="also a day of each network")
    options.add_argument(
        "--closure", action="store_true", help="also a closure of the largest demand in 4 s"
    )
    options.add_argument(
        "--version", choices=[*epanet_engine.LIBRARIES], help="of EPANET (default the first found)"
    )
    options.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="files at a time (default 1)"
    )
    options.add_argument(
        "--limit-nodes", type=int, default=0, metavar="N", help="most nodes (default no limit)"
    )
    options.add_argument(
        "--limit", type=float, default=120.0, metavar="S", help="time of a stage [s] (default 120)"
    )
    options.add_argument(
        "--day-limit",
        type=float,
        default=300.0,
        metavar="S",
        help="time of a day [s] (default 300)",
    )
    options.add_argument(
        "--json", type=Path, metavar="FILE", help="file of all rows (default none)"
    )
    options = options.parse_args()
    installed = [version for version in epanet_engine.LIBRARIES if epanet_engine.library(version)]
    if not installed or (options.version and options.version not in installed):
        print(f"wntr (EPANET 2.2) or owa-epanet (EPANET 2.3) is not installed: {SKIPPED}")
        return
    options.version = options.version or installed[0]
    options.day, options.closure = options.day or options.quick, options.closure or options.quick
    with tempfile.TemporaryDirectory() as folder:
        small_files(Path(folder))
        # imports and compiles, before processes are forked
        record = Record(Path(folder) / "small.json")
        examine(Path(folder) / "small.inp", options, record)
        rows = table([Path(folder)] if options.quick else options.paths, options)
    if options.quick:
        good = next(row for row in rows if row["epanet"] == "ok")
        agree("head at the start [m]", good["head"]["difference"], CLOSE)
        agree("level over the day [m]", good["day"]["level"]["difference"], CLOSE)


if __name__ == "__main__":
    main()
