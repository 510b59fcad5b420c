"""routes.csv: envelopes of the pipes of each route along a continuous chainage."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case.pipe_routes import legs
from fvsolve.output.envelope import envelope_columns
from fvsolve.output.unit_columns import column


def route_envelopes(envelope: dict, case) -> dict[str, dict[str, Any]]:
    """Envelopes along all routes: route -> "chainage", "pipe" or quantity -> array along the route.

    envelope : pipe -> quantity -> float64[cells]; both it and the result are in the units of envelope.csv
    """
    distances = column("distance", "length", case)
    return {name: joined_envelopes(envelope, legs(route, case.links), distances) for name, route in case.routes.items()}


def joined_envelopes(envelope: dict, route, distances) -> dict[str, Any]:
    """Envelopes of the pipes of a route in order: "chainage", "pipe" or quantity -> array along the route.

    Pipes followed backwards are reversed. distances : column with the unit of lengths
    """
    arrays: dict[str, list] = {"chainage": [], "pipe": []}
    for leg in route:
        turn = slice(None, None, -1) if leg.backwards else slice(None)
        pipe = {key: np.asarray(values)[turn] for key, values in envelope[leg.pipe].items()}
        arrays["chainage"].append(distances.from_si(leg.chainage(distances.to_si(pipe["distance"]))))
        arrays["pipe"].append(np.full(pipe["distance"].size, leg.pipe))
        for key, values in pipe.items():
            arrays.setdefault(key, []).append(values)
    return {key: np.concatenate(parts) for key, parts in arrays.items()}


def write_routes(path: Path, envelope: dict, case) -> None:
    """Write routes.csv with a row for each cell along each route. envelope : in the units of envelope.csv"""
    columns = envelope_columns(case)
    headers = ["route", column("chainage", "length", case).header, "pipe", *(item.header for item in columns)]
    with open(path, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(headers)
        for name, item in route_envelopes(envelope, case).items():
            values = zip(*(item[key.name].tolist() for key in columns), strict=True)
            for chainage, pipe, row in zip(item["chainage"].tolist(), item["pipe"].tolist(), values, strict=True):
                table.writerow([name, repr(chainage), pipe, *map(repr, row)])
