"""Scenario study: runs of a case with every combination of events and protections, with limit verdicts."""

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
from fvsolve.output.summary_file import plain, write_summary
from fvsolve.run import run
from fvsolve.studies.case_pickle import PickledCase
from fvsolve.studies.parallel import run_tasks
from fvsolve.studies.scenario_file import Scenarios, read_scenarios

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
        return plain({"title": design.title, "study": design.name, "case": str(design.case), "ok": self.ok,
                      "events": list(design.events), "protections": list(design.protections), "holds": self.holds,
                      "changes": {"events": design.events, "protections": design.protections},
                      "error": design.error, "runs": self.rows})  # fmt: skip


def run_passes(row: dict[str, Any]) -> bool:
    """True if a run is ok and satisfies all its limits; row : as in `ScenarioResults.rows`."""
    return row["ok"] and all(verdict["ok"] for verdict in row["verdicts"])


def study(source, out: str | Path | None = None, jobs: int = 1, dask: str | None = None, force: bool = False,
          progress=None) -> ScenarioResults:  # fmt: skip
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
        tasks.append({"event": event, "protection": protection, "keys": keys, "directory": str(place)})
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any] | None] = [None] * len(tasks)
    for done, (at, row) in enumerate(run_tasks(ScenarioRun(design.case, design.error, force), tasks, jobs, dask), 1):
        rows[at] = row
        if progress is not None:
            progress(done, len(tasks), row_name(row))
    results = ScenarioResults(design, folder, rows)
    write_study(results)
    return results


class ScenarioRun:
    """Callable that makes one run of a scenario study, in this or another process; returns its row of results."""

    def __init__(self, source: Any, error: bool, force: bool) -> None:
        self.sent, self.error, self.force = PickledCase(source), error, force

    def __call__(self, task: dict[str, Any]) -> dict[str, Any]:
        place = Path(task["directory"])
        case: Case = load(self.sent.source, task["keys"])
        place.parent.mkdir(parents=True, exist_ok=True)
        result = run(case, out=place, force=self.force, resume=not self.force and place.exists())
        if self.error and "peaks" not in result.summary:
            from fvsolve.studies.peak_error import peak_errors

            peak_errors(result, case)
            write_summary(place / "summary.json", result.summary)
        summary = result.summary
        keys_shown = ("ok", "reason", "t", "invalid_from", "verdicts", "extremes", "peaks", "resolution", "marks",
                      "events", "expectations", "time_unit", "envelope_units", "warnings")  # fmt: skip
        return {key: task[key] for key in ("event", "protection", "directory")} | {
            key: plain(summary[key]) for key in keys_shown if key in summary
        }

    def lost_result(self, task: dict[str, Any]) -> Any:
        """Raise RunError, because a run that crashed its process has no results."""
        raise RunError(f"the process that ran {task['directory']} was killed repeatedly. Is there enough memory?")


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
    temporary = results.folder / f"{STUDY}.tmp"
    temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, results.folder / STUDY)
    limits = list(dict.fromkeys(verdict["name"] for row in results.rows for verdict in row["verdicts"]))
    columns = [
        f"{name} {quantity}"
        for name in limits
        for quantity in ("value", "margin", "unit", "state", "place", "time [s]")
    ]
    with open(results.folder / "study.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["event", "protection", "ok", "reason", *columns])
        for row in results.rows:
            verdicts = {verdict["name"]: verdict for verdict in row["verdicts"]}
            cells = [verdicts.get(name, {}).get(key) for name in limits
                     for key in ("value", "margin", "unit", "state", "place", "time")]  # fmt: skip
            table.writerow([row["event"] or "", row["protection"] or "", row["ok"], row["reason"], *cells])


def open_study(folder: str | Path) -> dict[str, Any]:
    """Read study.json of a folder; the paths of run directories are changed to start with the folder.

    Raises FvsolveError if the file is missing or invalid.
    """
    folder = Path(folder)
    try:
        data = json.loads((folder / STUDY).read_text(encoding="utf-8"))
        for row in data["runs"]:
            row["directory"] = str(folder / row["directory"])
        return data
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FvsolveError(f"{folder} has no finished study: {STUDY} is missing or invalid ({error})") from None
