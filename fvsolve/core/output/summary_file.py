"""summary.json: results of a run for people and programs."""

import json
import math
from dataclasses import asdict, is_dataclass
from pathlib import Path

from fvsolve.core.output.csv_files import envelope_columns
from fvsolve.core.output.json_files import read_json, refuse_faults
from fvsolve.core.output.summary_shape import REQUIRED_KEYS, summary_faults
from fvsolve.core.output.unit_columns import probe_columns, time_column
from fvsolve.errors import RunError, listing, nearest
from fvsolve.file_replacement import write_file

MOST_MISSING = 5  # missing entries above which a file is not the summary of a run


def summary_data(summary, model) -> dict:
    """Results of a run as plain data in SI for summary.json; only the extremes are in the units of the probes."""
    return {
        "title": model.case.title,
        "case": model.case.name,
        "reason": summary.reason,
        "ok": bool(summary.ok),
        "t": float(summary.t),
        "invalid_from": plain(float(summary.invalid_from)),
        "marks": [asdict(mark) for mark in summary.marks],
        "cavities": [asdict(cavity) for cavity in summary.cavities],
        "events": [asdict(event) for event in summary.events],
        "probes": {
            item.name: {"dimension": item.dimension, "unit": item.unit}
            for item in probe_columns(model)
        },
        "time_unit": time_column(model.case).unit,
        **start_entry(model.case),
        "envelope_units": {item.name: item.unit for item in envelope_columns(model.case)},
        "ambient_pressure": model.case.ambient_pressure,
        "fluid": model.case.properties.plain(),
        "extremes": _extremes(summary, model),
        "ledgers": plain(summary.ledgers),
        **summary.counts,
        "methods": summary.methods,
        "cells": int(summary.cells),
        "threads": int(summary.threads),
        "seconds": float(summary.seconds),
        "seconds_setup": float(summary.seconds_setup),
        "cost": plain(summary.cost),
        "run_up": plain(summary.run_ups),
        **({"energy_use": plain(summary.energy_use)} if summary.energy_use else {}),
        "warnings": [item.plain() for item in (*model.warnings, *summary.warnings)],
    }


def start_entry(case) -> dict[str, str]:
    """Entry with the instant of t = 0, which only the summary of a case with a start time has."""
    start = case.numerics.start_time
    return {} if start is None else {"start_time": start.table()}


def plain(value):
    """Convert a value to plain Python data for JSON.

    Numpy numbers and arrays become Python numbers and lists, dataclasses dicts, complex numbers [re, im], NaN and
    infinity None, and other objects their text.
    """
    if type(value) is float:
        return value if math.isfinite(value) else None
    if type(value) in (str, int, bool):
        return value
    if is_dataclass(value) and not isinstance(value, type):
        return plain(value.plain() if hasattr(value, "plain") else vars(value))
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    return value if isinstance(value, (str, int, bool, type(None))) else str(value)


def write_summary(path: Path, summary: dict) -> None:
    """Write summary.json in a single step: a directory that contains the file holds a finished run."""
    write_file(path, json.dumps(plain(summary), indent=1) + "\n")


AGAIN = "run the case again with --force"


def _similar_run(path: Path) -> str:
    """Hint for a message: run directory beside a missing summary, or in `runs`, with a similar name; "" without one."""
    found = {
        other.parent.name: other.parent
        for folder in (path.parent.parent, Path("runs"))
        for other in folder.glob(f"*/{path.name}")
    }
    close = nearest(path.parent.name, found)
    return f'; did you mean "{found[close]}"?' if close else ""


def read_summary(path: Path) -> dict:
    """Read summary.json; raises RunError if it is missing, damaged, or an entry is missing or has a wrong type."""
    if not path.is_file():
        text = f"does not hold a finished run (no {path.name}); check the path, or finish the run"
        raise RunError(f"{path.parent} {text}{_similar_run(path)}")
    summary = read_json(path, AGAIN)
    missing = (
        ["a JSON object"]
        if not isinstance(summary, dict)
        else [k for k in REQUIRED_KEYS if k not in summary]
    )
    if len(missing) > MOST_MISSING or not isinstance(summary, dict):
        text = f"this is not the summary of a run (missing: {listing(missing)})"
        raise RunError(f"{path} cannot be read: {text}; {AGAIN}")
    refuse_faults(path, summary_faults(summary), AGAIN)
    return summary


def _extremes(summary, model) -> dict:
    """Extremes of each probe and their times, in the unit of the probe.

    They are None if reached at or after the time from which a diverged run is invalid.
    """
    extremes = {}
    for col in probe_columns(model):
        least, t_min, greatest, t_max = summary.extremes[col.name]
        row = extremes[col.name] = {"unit": col.unit}
        for side, value, time, t in (
            ("minimum", least, "t_min", t_min),
            ("maximum", greatest, "t_max", t_max),
        ):
            valid = not t >= summary.invalid_from
            row[side] = plain(float(col.from_si(value))) if valid else None
            row[time] = plain(float(t)) if valid else None
    return extremes
