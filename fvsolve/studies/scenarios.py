"""Scenario study: a file with named sets of overrides of a case, runs of all combinations, and limit verdicts."""

import csv
import itertools
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any, TypedDict

from fvsolve.case import Case, load, shipped
from fvsolve.case.reading import read_toml, split_key
from fvsolve.case.text import key_lines
from fvsolve.core.output.directory import clear_reports
from fvsolve.core.output.json_files import faults_of, read_json, refuse_faults
from fvsolve.core.output.summary_file import plain, write_summary
from fvsolve.core.run import run
from fvsolve.declarations import declared
from fvsolve.errors import CaseError, Fault, FvsolveError, RunError, did_you_mean
from fvsolve.file_replacement import replacing, write_file
from fvsolve.studies.parallel import PickledCase, TaskPool, Work
from fvsolve.units import show

KEYS = ("case", "title", "estimate_error", "events", "protections")
# of parts: keys are set one by one
NAMED_TABLES = "nodes", "links", "limits", "routes", "scalars", "defaults"
AddFault = Callable[[tuple, str], None]


@dataclass(frozen=True)
class Scenarios:
    """Content of a study file.

    name, path : name and path of the file; case : path of the case file; error : True if errors of peaks are estimated
    events, protections : name -> overrides (dotted key -> value)
    """

    name: str
    path: Path
    title: str
    case: Path
    error: bool
    events: dict[str, dict[str, Any]]
    protections: dict[str, dict[str, Any]]

    def runs(self) -> Iterator[tuple[str | None, str | None, dict[str, Any]]]:
        """Yield (event, protection, overrides) of every run; event or protection is None if the file has none."""
        for event, of_event in (self.events or {None: {}}).items():
            for protection, of_protection in (self.protections or {None: {}}).items():
                yield event, protection, {**of_protection, **of_event}


def read_scenarios(path: str | Path) -> Scenarios:
    """Read a study from a TOML file, or a shipped study by its name.

    Raises CaseError with all faults of the file and its runs, with line numbers.
    """
    path, shipped_file = Path(path), shipped.folder() / "studies" / f"{path}.toml"
    path = shipped_file if not path.exists() and shipped_file.is_file() else path
    data, content = read_toml(path)
    lines = key_lines(content)
    faults: dict[tuple, Fault] = {}

    def fault(keys: tuple, message: str) -> None:
        place = ".".join(keys)
        line = next(
            (lines[spelling] for spelling in possible_paths(keys) if spelling in lines), None
        )
        faults.setdefault((place, message), Fault(place, message, line))

    if {"nodes", "fluid"} & data.keys():
        text = f'A study refers to it by case = "{path.name}" and has [events.NAME], [protections.NAME]'
        raise CaseError([Fault("", f"is a case, not a study. {text}")], path.name)
    for key in data:
        if key not in KEYS:
            fault(
                (key,), f"unknown key{did_you_mean(key, KEYS) or '; expected ' + ', '.join(KEYS)}"
            )
    for key, kind, kind_text in (("title", str, "text"), ("estimate_error", bool, "true or false")):
        if not isinstance(data.get(key, kind()), kind):
            fault((key,), f"{show(data[key])} is not {kind_text}")
    sets = {
        group: read_overrides(data.get(group, {}), group, fault)
        for group in ("events", "protections")
    }
    if not faults and not any(sets.values()):
        fault((), "the study has no runs; expected [events.NAME], [protections.NAME] or both")
    for event, protection, key, other in all_conflicts(**sets):
        text = (
            f"{key} is set here, and {other} in protections.{protection}; the two are in conflict"
        )
        fault(("events", event, key), text)
    place = case_path(data.get("case"), path.parent, fault)
    design = Scenarios(
        path.stem, path, data.get("title", ""), place, data.get("estimate_error", False), **sets
    )
    if place is not None:
        run_faults(design, fault)
    if faults:
        raise CaseError(list(faults.values()), path.name)
    return design


def possible_paths(keys: tuple) -> Iterator[tuple]:
    """Yield paths in the TOML file under which an override may be written, to find its line; most specific first.

    keys : (group, name of the event or protection, dotted key), or its first entries alone. The dotted key may be
    written as nested tables or as one quoted key. The paths of the tables that contain it follow.
    """
    below = split_key(keys[2]) if len(keys) > 2 else ()
    for n in range(len(below), 0, -1):
        yield (*keys[:2], *below[:n])
        yield (*keys[:2], ".".join(below[:n]))
    yield from (keys[:n] for n in range(min(len(keys), 2), 0, -1))


def case_path(case: Any, folder: Path, fault: AddFault) -> Path | None:
    """Path of the case file of a study, or of a shipped case; adds a fault and returns None if there is no such file.

    case : value of the key `case`, which must be a text; folder : folder of the study
    fault : fault(keys, message) records a fault
    """
    if not isinstance(case, str):
        missing = "case is missing; expected the name of the case file of the study"
        text = missing if case is None else f"{show(case)} is not a text"
        fault(() if case is None else ("case",), text)
        return None
    place = folder / case
    if not place.is_file() and case in shipped.names():
        return shipped.find(case)
    if not place.is_file():
        suggestion = (
            [file.name for file in place.parent.glob("*.toml")] if place.parent.is_dir() else []
        )
        suggestion = did_you_mean(place.name, [*suggestion, *shipped.names()])
        fault(
            ("case",),
            f"{show(case)}: there is no such file{suggestion}; a path is relative to the study",
        )
        return None
    return place


def read_overrides(table: Any, group: str, fault) -> dict[str, dict[str, Any]]:
    """Overrides of a group, "events" or "protections" : name -> {dotted key: value}; adds faults by fault()."""
    if not isinstance(table, dict):
        fault((group,), f"{show(table)} is not a table; expected named tables, [{group}.NAME]")
        return {}
    sets = {}
    for name, overrides in table.items():
        if not isinstance(overrides, dict):
            fault(
                (group, name),
                f'{show(overrides)} is not a table; expected keys such as links.pump.trip = "2 s"',
            )
        elif not name.replace("-", "").replace("_", "").isalnum():
            fault(
                (group, name),
                f"{show(name)} is not a valid name; expected letters, digits, _ and -",
            )
        else:
            sets[name] = dict(dotted_keys(overrides))
    return sets


def dotted_keys(table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Flatten tables of overrides; yields pairs (dotted key, value).

    A named part, such as links.main, gives a pair for each of its keys; deeper tables remain values.
    """
    for first, inner in table.items():
        if "." in first or not isinstance(inner, dict):
            yield first, inner
            continue
        for second, below in inner.items():
            if first in NAMED_TABLES and isinstance(below, dict):
                yield from (
                    (dotted_path(first, second, third), value) for third, value in below.items()
                )
            else:
                yield dotted_path(first, second), below


def dotted_path(*keys: str) -> str:
    """Join keys to a dotted TOML key, with quotes where necessary."""
    return ".".join(
        key if key.replace("-", "").replace("_", "").isalnum() else json.dumps(key) for key in keys
    )


def all_conflicts(events: dict, protections: dict) -> Iterator[tuple[str, str, str, str]]:
    """Yield (event, protection, key of the event, key of the protection) for each pair of overrides in conflict.

    Keys are in conflict if they are equal with different values, or if one of them contains the other.
    """
    for (event, of_event), (protection, of_protection) in itertools.product(
        events.items(), protections.items()
    ):
        for key, other_key in itertools.product(of_event, of_protection):
            a, b = split_key(key), split_key(other_key)
            if a[: len(b)] == b[: len(a)] and not (
                a == b and of_event[key] == of_protection[other_key]
            ):
                yield event, protection, key, other_key


def run_faults(design: Scenarios, fault: AddFault) -> None:
    """Add the faults of all runs whose case is invalid, each at the override that causes it.

    If only some runs with an event (or protection) have a fault, the message names their protections (or events). Runs
    with conflicting overrides are omitted. Faults of the case itself are added at the key `case`.
    fault : fault(keys, message) records a fault
    """
    try:
        base = load(design.case)
    except CaseError as error:
        for case_fault in error.faults:
            fault(("case",), f"{error.file}: {case_fault}")
        return
    clash = {
        (event, protection)
        for event, protection, *_ in all_conflicts(design.events, design.protections)
    }
    runs = [(pair, keys) for *pair, keys in design.runs() if tuple(pair) not in clash]
    groups: dict[tuple[str, str], list] = {}  # (place, message) -> pairs of event and protection
    for pair, keys in runs:
        try:
            load(base, keys)
        except CaseError as error:
            for case_fault in error.faults:
                groups.setdefault((case_fault.place, case_fault.message), []).append(pair)
    for (place, message), pairs in groups.items():
        of_keys = list(responsible_sets(design, place, pairs))
        for keys in of_keys or responsible_sets(design, None, pairs):
            position = 0 if keys[0] == "events" else 1
            partners = [pair[1 - position] for pair in pairs if pair[position] == keys[1]]
            in_all = len(partners) == sum(pair[position] == keys[1] for pair, _ in runs)
            text = message if of_keys or not place else f"{place}: {message}"
            fault(keys, text if in_all else f"{text} (with {', '.join(partners)})")


def responsible_sets(design: Scenarios, place: str | None, pairs: list) -> Iterator[tuple]:
    """Yield (group, name, place) of events and protections that set `place`, a part of it, or a table that contains it.

    place : key with a fault. If it is None, (group, name) of each event is yielded, or of each protection if there are
    no events. pairs : (event, protection) of the runs with the fault
    """
    for position, group in enumerate(("events", "protections")):
        for name in dict.fromkeys(pair[position] for pair in pairs if pair[position] is not None):
            if place is None:
                yield group, name
            elif any(
                within(place, key) or within(key, place) for key in getattr(design, group)[name]
            ):
                yield group, name, place
        if place is None and pairs[0][position] is not None:
            return


def within(place: str, key: str) -> bool:
    """True if the dotted path `place` is equal to `key` or lies below it."""
    return place == key or place.startswith((f"{key}.", f"{key}["))


# runs and results -------------------------------------------------------------------------------------------------

STUDY = "study.json"


@dataclass(frozen=True)
class ScenarioResults:
    """Results of a scenario study.

    design : content of the study file; folder : folder of all runs
    rows : a dict for each run: event, protection, directory, and ok, reason, t, verdicts, extremes, ... of its summary
    """

    design: Scenarios
    folder: Path
    rows: list[dict[str, Any]] = field(default_factory=list)

    @property
    def holds(self) -> list[str]:
        """Names of protections with which the runs of all events are ok and satisfy all limits.

        "" is the case without protection. Empty if there are no limits.
        """
        by_protection: dict[str, list[dict[str, Any]]] = {}
        for row in self.rows:
            by_protection.setdefault(row["protection"] or "", []).append(row)
        return [
            name
            for name, rows in by_protection.items()
            if all(map(run_passes, rows)) and any(row["verdicts"] for row in rows)
        ]

    @property
    def limited(self) -> bool:
        """True if at least one run has design limits."""
        return any(row["verdicts"] for row in self.rows)

    @property
    def ok(self) -> bool:
        """True if all runs are ok and, if there are limits, at least one protection satisfies all of them."""
        return all(row["ok"] for row in self.rows) and (bool(self.holds) or not self.limited)

    def plain(self) -> dict[str, Any]:
        """Plain values for study.json, in which directories are then relative to the folder of the study."""
        design = self.design
        return plain(
            {
                "title": design.title,
                "study": design.name,
                "case": str(design.case),
                "ok": self.ok,
                "events": list(design.events),
                "protections": list(design.protections),
                "holds": self.holds,
                "changes": {"events": design.events, "protections": design.protections},
                "error": design.error,
                "runs": self.rows,
            }
        )


def run_passes(row: dict[str, Any]) -> bool:
    """True if a run is ok and satisfies all its limits; row : as in `ScenarioResults.rows`."""
    return row["ok"] and all(verdict["ok"] for verdict in row["verdicts"])


@declared("study")
def study(
    source,
    out: str | Path | None = None,
    jobs: int = 1,
    dask: str | None = None,
    force: bool = False,
    progress=None,
) -> ScenarioResults:
    """Run all events with all protections of a study file, `jobs` runs at a time, each in its own run directory.

    source : path of the study file, or its content; out : folder of the runs (default runs/NAME of the study)
    dask : address of a Dask scheduler; progress : called as progress(done, total, name of the run)
    Runs of the same study that exist are kept, and resumed if unfinished; `force` repeats all. Raises CaseError with
    the faults of the file and of all runs, RunError if a directory holds a different run, or if a run crashes its
    process repeatedly.
    """
    design = source if isinstance(source, Scenarios) else read_scenarios(source)
    folder = Path(out) if out is not None else Path("runs") / design.name
    tasks = []
    for event, protection, keys in design.runs():
        place = folder / ".".join(name for name in (event, protection) if name is not None)
        tasks.append(
            {"event": event, "protection": protection, "keys": keys, "directory": str(place)}
        )
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any] | None] = [None] * len(tasks)
    with TaskPool(ScenarioRun(design.case, design.error, force), jobs, dask) as pool:
        for done, (at, row) in enumerate(pool.run(tasks), 1):
            rows[at] = row
            if progress is not None:
                progress(done, len(tasks), row_name(row))
    results = ScenarioResults(design, folder, rows)
    write_study(results)
    return results


class ScenarioRun(Work):
    """Callable that makes one run of a scenario study, in this or another process; returns its row of results."""

    def __init__(self, source: Any, error: bool, force: bool) -> None:
        self.sent, self.error, self.force = PickledCase(source), error, force

    def __call__(self, task: dict[str, Any]) -> dict[str, Any]:
        place = Path(task["directory"])
        case: Case = load(self.sent.source, task["keys"])
        place.parent.mkdir(parents=True, exist_ok=True)
        resume = not self.force and place.exists()
        if (
            resume
            and (place / "case.toml").is_file()
            and load(place / "case.toml").step_keys != case.step_keys
        ):
            text = "holds a run with other time steps, and a study has no runs with mixed steps"
            raise RunError(f"{place} {text}; repeat the study with --force")
        result = run(case, out=place, force=self.force, resume=resume)
        if self.error and "peaks" not in result.summary:
            from fvsolve.studies.peak_error import peak_errors

            peak_errors(result, case)
            write_summary(place / "summary.json", result.summary)
        summary = result.summary
        keys_shown = (
            "ok",
            "reason",
            "t",
            "invalid_from",
            "verdicts",
            "extremes",
            "peaks",
            "resolution",
            "marks",
            "events",
            "expectations",
            "time_unit",
            "start_time",
            "envelope_units",
            "warnings",
        )
        row = {key: task[key] for key in ("event", "protection", "directory")}
        return row | {key: plain(summary[key]) for key in keys_shown if key in summary}

    def process_text(self, task: dict[str, Any]) -> str:
        return f"that ran {task['directory']}"


def row_name(row: dict[str, Any]) -> str:
    """Name of the run of a row, such as "trip with vessel"."""
    return " with ".join(name for name in (row["event"], row["protection"]) if name) or "the case"


def write_study(results: ScenarioResults) -> None:
    """Write study.json, and study.csv with a row for each run: value, margin, state, place and time of every limit.

    Reports and pictures of earlier results in the folder are deleted.
    """
    data = results.plain()
    for row in data["runs"]:
        row["directory"] = os.path.relpath(row["directory"], results.folder)
    clear_reports(results.folder)
    limits = list(
        dict.fromkeys(verdict["name"] for row in results.rows for verdict in row["verdicts"])
    )
    quantities = ("value", "margin", "unit", "state", "place", "time [s]")
    columns = [f"{name} {quantity}" for name in limits for quantity in quantities]
    with (
        replacing(results.folder / "study.csv") as fresh,
        open(fresh, "w", encoding="utf-8", newline="") as file,
    ):
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["event", "protection", "ok", "reason", *columns])
        for row in results.rows:
            verdicts = {verdict["name"]: verdict for verdict in row["verdicts"]}
            cells = [
                verdicts.get(name, {}).get(key)
                for name in limits
                for key in ("value", "margin", "unit", "state", "place", "time")
            ]
            table.writerow(
                [row["event"] or "", row["protection"] or "", row["ok"], row["reason"], *cells]
            )
    write_file(results.folder / STUDY, json.dumps(data, indent=1) + "\n")


class StudyRow(TypedDict):
    """Entries of a run of a study; further entries are those of its summary."""

    event: str | None
    protection: str | None
    directory: str


class StudyChanges(TypedDict):
    """Keys that events and protections set, by name."""

    events: dict[str, dict[str, Any]]
    protections: dict[str, dict[str, Any]]


class StudyShape(TypedDict):
    """Entries of study.json."""

    title: str
    study: str
    case: str
    ok: bool
    events: list[str]
    protections: list[str]
    holds: list[str]
    changes: StudyChanges
    error: bool
    runs: list[StudyRow]


def open_study(folder: str | Path) -> dict[str, Any]:
    """Read study.json of a folder; the paths of run directories are changed to start with the folder.

    Raises FvsolveError if the file is missing or invalid, or names a run directory outside of the folder.
    """
    folder, again = Path(folder), "repeat the study with fvsolve study"
    if not (folder / STUDY).is_file():
        raise FvsolveError(f"{folder} has no finished study: {STUDY} is missing; {again}")
    data = read_json(folder / STUDY, again)
    refuse_faults(folder / STUDY, study_faults(data), again)
    for row in data["runs"]:
        row["directory"] = str(folder / row["directory"])
    return data


def study_faults(data: Any) -> Iterator[str]:
    """Yield a text for each entry of study.json with a wrong type, and for run directories outside of its folder."""
    faults = list(faults_of(data, StudyShape))
    if not faults and not data["runs"]:
        faults = ["runs: an empty list; expected at least one run"]
    yield from faults
    for k, row in enumerate(() if faults else data["runs"]):
        path = PurePath(row["directory"])
        if path.is_absolute() or ".." in path.parts or "\0" in row["directory"]:
            yield f"runs.{k}.directory: {show(row['directory'])} is outside of the folder; expected a path below it"
