"""A study of a design: events times protections of one case, each a run with verdicts. Knows cases and runs."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fvsolve.case import Case, load
from fvsolve.errors import FvsolveError, RunError
from fvsolve.output.directory import clear_reports
from fvsolve.output.summary import plain, write_summary
from fvsolve.run import run
from fvsolve.studies.design_file import Design, read_design
from fvsolve.studies.many import many
from fvsolve.studies.sent import Sent

STUDY = "study.json"


@dataclass(frozen=True)
class Studied:
    """A study that has run: of every run event, protection, directory, ok, reason, t, verdicts, extremes and more."""

    design: Design
    folder: Path
    rows: list[dict[str, Any]] = field(default_factory=list)

    @property
    def holds(self) -> list[str]:
        """Protections (the case itself where there are none) whose runs are ok and hold all limits in all events; none
        without limits."""
        of: dict[str, list[dict[str, Any]]] = {}
        for row in self.rows:
            of.setdefault(row["protection"] or "", []).append(row)
        return [name for name, rows in of.items() if all(map(passed, rows)) and any(row["verdicts"] for row in rows)]

    @property
    def limited(self) -> bool:
        """True if a run has limits."""
        return any(row["verdicts"] for row in self.rows)

    @property
    def ok(self) -> bool:
        """True if all runs are ok, and one protection at least holds all limits, if there are any."""
        return all(row["ok"] for row in self.rows) and (bool(self.holds) or not self.limited)

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

    What is there of the same study goes on or stays; `force` begins anew. Raises CaseError with the faults of the file
    and of all runs, RunError where a directory holds another run.
    """
    design = source if isinstance(source, Design) else read_design(source)
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
        kept = ("ok", "reason", "t", "invalid_from", "verdicts", "extremes", "peaks", "resolution", "marks", "events",
                "expectations", "time_unit", "envelope_units", "warnings")  # fmt: skip
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
    """study.json and study.csv: a row a run, value, margin and state of every limit."""
    said = found.plain()
    for row in said["runs"]:
        row["directory"] = os.path.relpath(row["directory"], found.folder)
    clear_reports(found.folder)
    fresh = found.folder / f"{STUDY}.tmp"
    fresh.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
    os.replace(fresh, found.folder / STUDY)
    limits = list(dict.fromkeys(one["name"] for row in found.rows for one in row["verdicts"]))
    columns = [
        f"{name} {what}" for name in limits for what in ("value", "margin", "unit", "state", "place", "time [s]")
    ]
    with open(found.folder / "study.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["event", "protection", "ok", "reason", *columns])
        for row in found.rows:
            verdicts = {one["name"]: one for one in row["verdicts"]}
            cells = [verdicts.get(name, {}).get(key) for name in limits
                     for key in ("value", "margin", "unit", "state", "place", "time")]  # fmt: skip
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
