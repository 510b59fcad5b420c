"""A table as CSV, as CSV with decimal commas and as a sheet gives the same bits, wherever a table file is legal."""

import datetime
import re
from pathlib import Path

import pytest
from reference.dated_cases import fed
from reference.scenes import inflow, junction, lake, pipe, reservoir, scene, stiff_pipe
from reference.table_files import FORMS, table_file

import fvsolve
from fvsolve.studies import sweep

PACKAGE = Path(fvsolve.__file__).parent
READER = re.compile(r"\b(?:read_rows|read_columns|read_table_file)\(")
FIRST = datetime.datetime(2026, 3, 1, 6)
STAMPS = [FIRST + datetime.timedelta(seconds=t) for t in (0.0, 12.5, 40.0, 61.0)]
SERIES = (["Datum", "Q [l/s]"], [*zip(STAMPS, (2.1, 3.5, 1, 2.75), strict=True)])
SECONDS = (["t [s]", "Q [l/s]"], [*zip((0, 12.5, 40.0, 61.1), (2.1, 3.5, 1, 2.75), strict=True)])
HILL = (
    ["chainage [m]", "elevation [m]"],
    [(0.0, 3.1), (100.5, 7.25), (250.0, -1.0), (500.0, 0.3)],
)
CHART = (
    ["opening [%]", "unit_speed", "unit_flow", "efficiency [%]"],
    [
        *((50, n, q, e) for n, q, e in ((60.5, 0.52, 88.0), (75.0, 0.48, 85.5), (90.0, 0.4, 70.0))),
        *((100, n, q, e) for n, q, e in ((60.0, 0.92, 90.0), (75.0, 0.88, 91.5), (90.0, 0.8, 80))),
    ],
)
GAUGES = (["name", "basin", "x [m]", "y [m]"], [("kerb", "pool", 1.5, 0.7), (2, "pool", 3, 1.25)])
BED = (
    ["x [m]", "y [m]", "bed [cm]"],
    [(0.0, 0.0, 1.5), (4.0, 0.0, 12.25), (0.0, 2.0, 0), (4.0, 2.0, 7.1), (2.0, 1.1, 3.3)],
)
STREAM = (
    ["x", "y", "u [cm/s]", "v"],
    [(-9.0, -9.0, 50.5, 0), (9.0, -9.0, 50.5, 0), (-9.0, 9.0, 50.5, 0), (9.0, 9.0, 50.5, 0)],
)
START = {"start_time": FIRST.isoformat()}


def basin(**keys) -> dict:
    probes = keys.pop("probes", ())
    pool = {"type": "basin", "size": [4.0, 2.0], "cells": [8, 4], "level": 0.5, "elevation": 0.0}
    case = scene({"pool": pool | keys}, {}, 0.5, {"scheme": "muscl"}, probes, every=0.1)
    return {key: table for key, table in case.items() if key != "links"}


def schedule(given: dict) -> dict:
    return fed(given, FIRST.isoformat())


def measurement(given: dict) -> dict:
    return fed(2e-3, FIRST.isoformat(), compare={"main.flow": given})


def profile(given: dict) -> dict:
    nodes = {"up": lake(30.0, elevation=3.1), "gate": junction(1e-3, elevation=0.3)}
    links = {"main": pipe("up", "gate", 500.0, 0.2, 1000.0, 10, profile=given)}
    return scene(nodes, links, 2.0, {"method": "rk4", "courant": 0.9}, every=0.1)


def hill_chart(given: dict) -> dict:
    unit = {"type": "turbine", "from": "up", "to": "low", "diameter": 1.5, "speed": "375 rpm"}
    unit |= {"hill_chart": given, "opening": 0.7}
    return scene({"up": lake(80.0), "low": lake(0.0)}, {"unit": unit}, 1.0, {"step": 0.1})


def gauges(given: dict) -> dict:
    case = basin(start={"level": "0.5 + 0.01*x"}, probes=["pool.depth@kerb", "pool.depth@2"])
    case["output"]["gauges"] = given
    return case


def velocity(given: dict) -> dict:
    flow = {"type": "basin", "size": [4.0, 2.0], "cells": [8, 4], "physics": "transport"}
    flow |= {"velocity": given, "patches": {key: {"side": key} for key in ("west", "east")}}
    case = scene({"pool": flow}, {}, 0.5, {"scheme": "muscl"}, ["pool.dye@1,1"], every=0.1)
    case["scalars"] = {"dye": {"initial": "x + 0.5*y"}}
    case["nodes"]["pool"]["scalars"] = {"dye": "x + 0.5*y"}
    case["scalars"] = {"dye": {}}
    return {key: table for key, table in case.items() if key != "links"}


def bed(given: dict) -> dict:
    return basin(bed=given, start={"level": "0.5 + 0.01*x"}, probes=["pool.depth@1.3,0.8"])


def rain(given: dict) -> dict:
    return basin(rain={**given, "unit": "mm/h"}, probes=["pool.depth@1,1", "pool.rained"])


RAIN = (["t [s]", "rate"], [(0, 1.5), (0.25, 90.25), (1.1, 3)])
# place -> (table, function of its { file } that makes a case)
PLACES = {
    "schedule with dates": (SERIES, schedule),
    "schedule": (SECONDS, schedule),
    "measurement with dates": (SERIES, measurement),
    "measurement": (SECONDS, measurement),
    "profile of a pipe": (HILL, profile),
    "hill chart": (CHART, hill_chart),
    "gauges": (GAUGES, gauges),
    "bed": (BED, bed),
    "rain": (RAIN, rain),
    "velocity": (STREAM, velocity),
}
# module that reads table files -> number of calls of the reader, and the places above that test it
READERS = {
    "parts/csv_rows.py": (5, ()),  # the readers themselves
    "parts/schedule.py": (1, ("schedule", "schedule with dates", "rain")),
    "parts/formula.py": (1, ("bed",)),
    "parts/pipe/elevation_profile.py": (1, ("profile of a pipe",)),
    "parts/turbine/hill_chart.py": (1, ("hill chart",)),
    "case/sections.py": (1, ("gauges",)),
    "case/claims.py": (1, ("measurement", "measurement with dates")),
    "features/basins/transport/lower.py": (1, ("velocity",)),
    "studies/sampling.py": (1, ()),  # points of a sweep: the test below
    "studies/validation/measures.py": (1, ()),  # a curve in a figure of a validation
}


def bits_of(case: dict, folder: Path) -> list[bytes]:
    """Files with numbers of a run of a case, and of the run of its resolved case."""
    found = []
    for source, name in ((case, "run"), (folder / "run" / "case.toml", "again")):
        result = fvsolve.run(source, out=folder / name)
        rows = [row._replace(file="") for row in result.comparisons]
        found.append((folder / name / "history.csv").read_bytes() + str(rows).encode())
    return found


@pytest.mark.parametrize("place", PLACES)
def test_a_table_in_any_form_gives_the_same_bits(place, tmp_path, monkeypatch):
    (header, rows), case = PLACES[place]
    found = {}
    for form in FORMS:
        folder = tmp_path / form
        folder.mkdir()
        monkeypatch.chdir(folder)
        found[form] = bits_of(case(table_file(folder, form, header, rows)), folder)
    assert {first for first, _ in found.values()} == {found["comma"][0]}
    assert all(first == again for first, again in found.values())


def test_points_of_a_sweep_in_any_form_give_the_same_rows(tmp_path):
    case = scene(
        {"a": reservoir(2e5), "b": inflow(1e-3)},
        {"main": stiff_pipe("a", "b", 100.0, 0.1, 4)},
        0.2,
        {"method": "rk4", "courant": 0.9},
    )
    header, rows = ["links.main.diameter [mm]", "nodes.b.flow"], [(100.5, "1.5 l/s"), (80, 0.002)]
    found = []
    for form in ("comma", "semicolon", "workbook"):
        folder = tmp_path / form
        folder.mkdir()
        path = folder / table_file(folder, form, header, rows)["file"]
        rows_of_sweep = sweep(case, points=path).rows
        found.append([{k: v for k, v in row.items() if k != "seconds"} for row in rows_of_sweep])
    assert found[0] == found[1] == found[2]


def test_every_reader_of_table_files_is_tested_here():
    calls = {
        path.relative_to(PACKAGE).as_posix(): len(READER.findall(text))
        for path in PACKAGE.rglob("*.py")
        if READER.search(text := path.read_text(encoding="utf-8"))
    }
    assert calls == {path: count for path, (count, _) in READERS.items()}
    named = {place for _, places in READERS.values() for place in places}
    assert named == PLACES.keys()
