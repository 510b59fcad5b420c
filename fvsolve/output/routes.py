"""routes.csv: what the pipes of each route have met, in one running chainage. Knows columns; knows no solver."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case.routes import legs
from fvsolve.output.column import column
from fvsolve.output.envelope import envelope_columns


def along_routes(envelope: dict, case) -> dict[str, dict[str, Any]]:
    """Route -> chainage, pipe, and what the envelope of these has, in its units : arrays of as many places."""
    distances = column("distance", "length", case)
    return {name: strung(envelope, legs(route, case.links), distances) for name, route in case.routes.items()}


def strung(envelope: dict, route, distances) -> dict[str, Any]:
    """The envelopes of the pipes of a route, one after the other, those run backwards from their other end."""
    found: dict[str, list] = {"chainage": [], "pipe": []}
    for leg in route:
        turn = slice(None, None, -1) if leg.backwards else slice(None)
        one = {key: np.asarray(values)[turn] for key, values in envelope[leg.pipe].items()}
        found["chainage"].append(distances.from_si(leg.chainage(distances.to_si(one["distance"]))))
        found["pipe"].append(np.full(one["distance"].size, leg.pipe))
        for key, values in one.items():
            found.setdefault(key, []).append(values)
    return {key: np.concatenate(parts) for key, parts in found.items()}


def write_routes(path: Path, envelope: dict, case) -> None:
    """One row per place along each route, `envelope` as envelope.csv has it."""
    columns = envelope_columns(case)
    headers = ["route", column("chainage", "length", case).header, "pipe", *(one.header for one in columns)]
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(headers)
        for name, one in along_routes(envelope, case).items():
            values = zip(*(one[key.name].tolist() for key in columns), strict=True)
            for chainage, pipe, row in zip(one["chainage"].tolist(), one["pipe"].tolist(), values, strict=True):
                table.writerow([name, repr(chainage), pipe, *map(repr, row)])
