"""summary.json: what is to be said about a run, for people and programs. Knows words; knows no solver."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, is_dataclass
from pathlib import Path

from fvsolve.errors import RunError, listing
from fvsolve.output.column import probe_columns, time_column
from fvsolve.output.envelope import envelope_columns

# What a reader looks for.
NEEDED = (
    "title", "case", "reason", "ok", "t", "invalid_from", "marks",
    "probes", "time_unit", "envelope_units", "ambient_pressure",
    "extremes", "ledgers", "expectations", "comparisons", "verdicts", "versions", "warnings", "files",
)  # fmt: skip


def described(summary, model) -> dict:
    """The summary of a solver as plain data: SI but for the extremes, which are in the columns' units."""
    return {
        "title": model.case.title,
        "case": model.case.name,
        "reason": summary.reason,
        "ok": bool(summary.ok),
        "t": float(summary.t),
        "invalid_from": plain(float(summary.invalid_from)),
        "marks": [
            {"what": mark.what, "place": mark.place, "time": float(mark.time), "text": mark.text}
            for mark in summary.marks
        ],
        "cavities": [asdict(cavity) for cavity in summary.cavities],
        "events": [{"time": float(one.time), "name": one.name, "what": one.what} for one in summary.events],
        "probes": {one.name: {"dimension": one.dimension, "unit": one.unit} for one in probe_columns(model)},
        "time_unit": time_column(model.case).unit,
        "envelope_units": {one.name: one.unit for one in envelope_columns(model.case)},
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
        "warnings": [one.plain() for one in (*model.warnings, *summary.warnings)],
    }


def plain(value):
    """`value` with numpy numbers and arrays as Python's own, objects as what they say, complex numbers as [re, im], and
    what JSON cannot say (NaN) as None."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(value.plain() if hasattr(value, "plain") else vars(value))
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    return value if isinstance(value, (str, int, bool, type(None))) else str(value)


def write_summary(path: Path, summary: dict) -> None:
    """Write summary.json in one move: a directory that has it holds a run that ended."""
    fresh = path.with_suffix(".json.tmp")
    fresh.write_text(json.dumps(plain(summary), indent=1) + "\n", encoding="utf-8")
    os.replace(fresh, path)


def read_summary(path: Path) -> dict:
    """summary.json as it was written; RunError where there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        lacks = [key for key in NEEDED if key not in found] if isinstance(found, dict) else ["a table"]
        if lacks:
            raise ValueError(f"it lacks {listing(lacks)}, so no run wrote it; run again with --force")
        return found
    except FileNotFoundError:
        raise RunError(f"{path.parent} holds no ended run (no {path.name})") from None
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}") from None


def _extremes(summary, model) -> dict:
    """Extremes in units of the probes; None from when on a run that blew up is not valid."""
    found = {}
    for one in probe_columns(model):
        least, t_least, greatest, t_greatest = (*summary.extremes[one.name],)
        sides = {"least": (least, t_least), "greatest": (greatest, t_greatest)}
        made: dict = {"unit": one.unit}
        for side, (value, t) in sides.items():
            valid = not t >= summary.invalid_from
            made |= {side: plain(float(one.from_si(value))) if valid else None,
                     f"t_{side}": plain(float(t)) if valid else None}  # fmt: skip
        found[one.name] = made
    return found
