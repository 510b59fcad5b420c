"""A study of a design: events times protections of one case, each a run with verdicts. Knows cases and runs."""

from __future__ import annotations

import csv
import json
import os
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fvsolve.case import Case, load, shipped
from fvsolve.case.lines import key_lines
from fvsolve.case.raw import dotted
from fvsolve.errors import CaseError, Fault, FvsolveError, RunError, did_you_mean
from fvsolve.output.summary import plain, write_summary
from fvsolve.run import run
from fvsolve.studies.many import many
from fvsolve.studies.sent import Sent
from fvsolve.units import show

KEYS = ("case", "title", "error", "events", "protections")
DEEP = ("nodes", "links", "limits", "routes", "scalars", "defaults")  # of named tables whose keys are set one by one
STUDY = "study.json"


@dataclass(frozen=True)
class Design:
    """What a study file says: sets of overrides, dotted key -> value, by the names of events and protections."""

    name: str
    path: Path
    title: str
    case: Path
    error: bool
    events: dict[str, dict[str, Any]]
    protections: dict[str, dict[str, Any]]

    def runs(self) -> Iterator[tuple[str | None, str | None, dict[str, Any]]]:
        """(event, protection, keys) of every run; None where the file has none of a kind."""
        for event, of_event in (self.events or {None: {}}).items():
            for protection, of_protection in (self.protections or {None: {}}).items():
                yield event, protection, {**of_protection, **of_event}


def read_design(path: str | Path) -> Design:
    """The study of a TOML file; CaseError with all that is wrong in it, by line."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig").replace("\r\n", "\n")
        said = tomllib.loads(text)
    except OSError as error:
        raise CaseError([Fault("", f"cannot be read: {error.strerror or error}")], path.name) from None
    except ValueError as error:
        raise CaseError([Fault("", f"TOML: {error}")], path.name) from None
    lines, faults = key_lines(text), []

    def fault(keys: tuple, message: str) -> None:
        at = next((lines[keys[:n]] for n in range(len(keys), 0, -1) if keys[:n] in lines), None)
        faults.append(Fault(".".join(keys), message, at))

    for key in said:
        if key not in KEYS:
            fault((key,), f"unknown key{did_you_mean(key, KEYS) or '; keys are ' + ', '.join(KEYS)}")
    for key, kind, what in (("title", str, "text"), ("error", bool, "true or false")):
        if not isinstance(said.get(key, kind()), kind):
            fault((key,), f"{show(said[key])} is not {what}")
    case = said.get("case")
    if not isinstance(case, str):
        fault(("case",) if "case" in said else (), "case is missing, the file that is studied" if case is None
              else f"{show(case)} is no text")  # fmt: skip
    sets = {group: read_sets(said.get(group, {}), group, fault) for group in ("events", "protections")}
    if not faults and not any(sets.values()):
        fault((), "nothing is studied; wanted [events.NAME], [protections.NAME] or both")
    for event, of_event in sets["events"].items():
        for protection, of_protection in sets["protections"].items():
            for one, other in clashes(of_event, of_protection):
                text = f"{one} is set here and {other} by protections.{protection}; a run cannot have both"
                fault(("events", event), text)
    place = None if not isinstance(case, str) else path.parent / case
    if place is not None and not place.is_file() and case in shipped.names():
        place = shipped.find(case)
    if place is not None and not place.is_file():
        fault(("case",), f"{show(case)}: there is no such file; a path is relative to the study")
    if faults:
        raise CaseError(faults, path.name)
    return Design(path.stem, path, said.get("title", ""), place, said.get("error", False), **sets)


def read_sets(given: Any, group: str, fault) -> dict[str, dict[str, Any]]:
    """Sets of overrides by name, as dotted keys."""
    if not isinstance(given, dict):
        fault((group,), f"{show(given)} is no table of tables by name")
        return {}
    found = {}
    for name, one in given.items():
        if not isinstance(one, dict):
            fault((group, name), f'{show(one)} is no table; wanted keys of the case, such as links.pump.trip = "2 s"')
        elif not name.replace("-", "").replace("_", "").isalnum():
            fault((group, name), f"{show(name)} is no name; a name has letters, digits, _ and -")
        else:
            found[name] = dict(keys_of(one))
    return found


def keys_of(table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Dotted keys of nested tables: those of parts one by one, whatever stands under them whole."""
    for first, inner in table.items():
        if "." in first or not isinstance(inner, dict):
            yield first, inner
            continue
        for second, below in inner.items():
            if first in DEEP and isinstance(below, dict):
                yield from ((path(first, second, third), value) for third, value in below.items())
            else:
                yield path(first, second), below


def path(*keys: str) -> str:
    """Keys as TOML writes them, in quotes where they are not bare."""
    return ".".join(key if key.replace("-", "").replace("_", "").isalnum() else json.dumps(key) for key in keys)


def clashes(one: dict[str, Any], other: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of both of which one is, or lies within, the other, unless both say the same."""
    for key in one:
        for beside in other:
            a, b = dotted(key), dotted(beside)
            if a[: len(b)] == b[: len(a)] and not (a == b and one[key] == other[beside]):
                yield key, beside


@dataclass(frozen=True)
class Studied:
    """A study that has run: of every run event, protection, directory, ok, reason, t, verdicts, extremes and more."""

    design: Design
    folder: Path
    rows: list[dict[str, Any]] = field(default_factory=list)

    @property
    def holds(self) -> list[str]:
        """Protections (the case itself where there are none) whose runs are ok and hold all limits in all events."""
        names = list(dict.fromkeys(row["protection"] or "" for row in self.rows))
        return [name for name in names if all(passed(row) for row in self.rows if (row["protection"] or "") == name)]

    @property
    def ok(self) -> bool:
        """Whether all runs are, and one protection at least holds all limits."""
        return all(row["ok"] for row in self.rows) and bool(self.holds)

    def plain(self) -> dict[str, Any]:
        """As study.json has it."""
        design = self.design
        return plain({"title": design.title, "study": design.name, "case": str(design.case), "ok": self.ok,
                      "events": list(design.events), "protections": list(design.protections), "holds": self.holds,
                      "changes": {"events": design.events, "protections": design.protections},
                      "error": design.error, "runs": self.rows})  # fmt: skip


def passed(row: dict[str, Any]) -> bool:
    """Whether a run came to its end rightly and holds its limits."""
    return row["ok"] and all(one["ok"] for one in row["verdicts"])


def study(source, out: str | Path | None = None, jobs: int = 1, dask: str | None = None, force: bool = False,
          progress=None) -> Studied:  # fmt: skip
    """Run all events with all protections of a study file, `jobs` at a time, each into a run directory of its own.

    What is there of the same study goes on or stays; `force` begins anew. Raises CaseError with the faults of all
    runs, RunError where a directory holds another run.
    """
    design = source if isinstance(source, Design) else read_design(source)
    check_runs(design)
    folder = Path(out) if out is not None else Path("runs") / design.name
    tasks = []
    for event, protection, keys in design.runs():
        place = folder / ".".join(name for name in (event, protection) if name is not None)
        tasks.append({"event": event, "protection": protection, "keys": keys, "directory": str(place)})
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any] | None] = [None] * len(tasks)
    for done, (at, row) in enumerate(many(DesignRun(design.case, design.error, force), tasks, jobs, dask), 1):
        rows[at] = row
        if progress is not None:
            progress(done, len(tasks), name_of(row))
    found = Studied(design, folder, rows)
    write_study(found)
    return found


def check_runs(design: Design) -> None:
    """Raises CaseError with the faults of all runs that could not start, each by its event and protection."""
    base = load(design.case)
    faults: dict[tuple, Fault] = {}
    for event, protection, keys in design.runs():
        try:
            load(base, keys)
        except CaseError as error:
            where = [f"{group}.{name}" for group, name in (("events", event), ("protections", protection)) if name]
            for one in error.faults:
                text = f"{one.place}: {one.message}" if one.place else one.message
                faults.setdefault((one.place, one.message), Fault(" with ".join(where), text))
    if faults:
        raise CaseError(list(faults.values()), design.path.name)


class DesignRun:
    """What makes the runs of a study, wherever."""

    def __init__(self, source: Any, error: bool, force: bool) -> None:
        self.sent, self.error, self.force = Sent(source), error, force

    def __call__(self, task: dict[str, Any]) -> dict[str, Any]:
        place = Path(task["directory"])
        case: Case = load(self.sent.source, task["keys"])
        place.parent.mkdir(parents=True, exist_ok=True)
        result = run(case, out=place, force=self.force, resume=not self.force and place.exists())
        if self.error and "peaks" not in result.summary:
            from fvsolve.studies.peaks import peak_errors

            peak_errors(result, case)
            write_summary(place / "summary.json", result.summary)
        said = result.summary
        kept = ("ok", "reason", "t", "verdicts", "extremes", "peaks", "marks", "events", "expectations", "time_unit",
                "envelope_units", "warnings")  # fmt: skip
        return {key: task[key] for key in ("event", "protection", "directory")} | {
            key: plain(said[key]) for key in kept if key in said
        }

    def lost(self, task: dict[str, Any]) -> Any:
        """Nothing can stand for it."""
        raise RunError(f"the process that ran {task['directory']} has ended, again and again; was memory too small?")


def name_of(row: dict[str, Any]) -> str:
    """`trip with vessel`."""
    return " with ".join(name for name in (row["event"], row["protection"]) if name) or "the case"


def write_study(found: Studied) -> None:
    """study.json and study.csv: a row a run, value, margin and verdict of every limit."""
    said = found.plain()
    for row in said["runs"]:
        row["directory"] = os.path.relpath(row["directory"], found.folder)
    fresh = found.folder / f"{STUDY}.tmp"
    fresh.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
    os.replace(fresh, found.folder / STUDY)
    limits = list(dict.fromkeys(one["name"] for row in found.rows for one in row["verdicts"]))
    columns = [f"{name} {what}" for name in limits for what in ("value", "margin", "unit", "ok", "place", "time [s]")]
    with open(found.folder / "study.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["event", "protection", "ok", "reason", *columns])
        for row in found.rows:
            verdicts = {one["name"]: one for one in row["verdicts"]}
            cells = [verdicts.get(name, {}).get(key) for name in limits
                     for key in ("value", "margin", "unit", "ok", "place", "time")]  # fmt: skip
            table.writerow([row["event"] or "", row["protection"] or "", row["ok"], row["reason"], *cells])


def open_study(folder: str | Path) -> dict[str, Any]:
    """study.json of a folder, its directories as they lie from here; FvsolveError where there is none."""
    folder = Path(folder)
    try:
        said = json.loads((folder / STUDY).read_text(encoding="utf-8"))
        for row in said["runs"]:
            row["directory"] = str(folder / row["directory"])
        return said
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FvsolveError(f"{folder} holds no study that ended (no {STUDY}): {error}") from None
