"""Samples fill their ranges and depend only on the seed; a file of points reports all its faults."""

import codecs

import numpy as np
import pytest
from scipy.stats import qmc

import fvsolve
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies import sweep
from fvsolve.studies.sampling import key_ranges, points_from_file, sample_points

RANGES = {"links.valve.area": ["10 cm2", 0.002], "links.valve.opening.start": [0.5, "1 s"], "nodes.outfall.pressure":
          ["0 barg", "1 barg"]}  # fmt: skip


@pytest.fixture(scope="module")
def case():
    return fvsolve.load("valve-closure")


def test_ends_of_ranges_are_read_in_their_units_pressures_absolute(case):
    assert key_ranges(case, RANGES) == {
        "links.valve.area": (0.001, 0.002), "links.valve.opening.start": (0.5, 1.0),
        "nodes.outfall.pressure": (101325.0, 201325.0),
    }  # fmt: skip


@pytest.mark.parametrize("kind", ["sobol", "lhs"])
def test_a_sample_fills_its_ranges_more_evenly_than_chance_and_its_seed_says_which(case, kind):
    found = sample_points(case, RANGES, f"{kind}:64", seed=3)
    values = np.array([[*one.values()] for one in found])
    low, high = np.array([*key_ranges(case, RANGES).values()]).T
    unit = (values - low) / (high - low)
    assert values.shape == (64, 3) and unit.min() >= 0.0 and unit.max() <= 1.0
    assert qmc.discrepancy(unit) < 0.5 * qmc.discrepancy(np.random.default_rng(0).random((64, 3)))
    assert all(np.array_equal(np.sort(np.floor(64 * column)), np.arange(64)) for column in unit.T)  # one in each 64th
    assert (
        sample_points(case, RANGES, f"{kind}:64", seed=3) == found != sample_points(case, RANGES, f"{kind}:64", seed=4)
    )


def test_all_that_is_wrong_of_ranges_is_said_at_once(case):
    wrong = {"links.valve.area": [0.002, 0.001], "links.main.length": ["900 m", 900], "links.main.cells": [10, 20],
             "numerics.scheme": ["muscl", "weno5"], "links.main.diameter": [0.1, "1 kg"], "links.main.lengt": [1, 2],
             "nodes.lake.head": [1, 2, 3], "links.main.wave_speed": [-1.0, 1000.0]}  # fmt: skip
    with pytest.raises(CaseError) as raised:
        key_ranges(case, wrong)
    said = str(raised.value)
    assert "8 faults" in said and "the range from 0.002 to 0.001 is reversed" in said
    assert 'the range from "900 m" to 900 is empty' in said and '"1 kg" is a mass; expected a length' in said
    assert (
        "links.main.cells: is not a continuous quantity" in said
        and "numerics.scheme: is not a continuous quantity" in said
    )
    assert (
        'unknown key "links.main.lengt"' in said
        and "[1, 2, 3] is not a range" in said
        and "-1.0 is out of range" in said
    )


@pytest.mark.parametrize("sample", ["sobol", "sobol:0", "sobol:-3", "halton:8", "lhs:1e3", "sobol:99999999999"])
def test_a_sample_that_is_none_is_named(case, sample):
    with pytest.raises(FvsolveError, match="Expected sobol:N or lhs:N with N runs"):
        sample_points(case, RANGES, sample, 0)


def read(case, tmp_path, text: str | bytes) -> list[dict]:
    path = tmp_path / "points.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return points_from_file(path, case, case.raw)


PLAIN = [
    {"links.valve.area": "17.5 cm2", "nodes.lake.head": 45.5},
    {"links.valve.area": "18.0 cm2", "nodes.lake.head": 30.0},
]


@pytest.mark.parametrize(
    "text",
    [
        "links.valve.area [cm2],nodes.lake.head\n17.5,45.5\n18,30\n",
        "links.valve.area [cm2];nodes.lake.head\n17,5;45,5\n18;30\n",
        "links.valve.area [cm2]\tnodes.lake.head\r\n17,5\t45,5\r\n\r\n18\t30\r\n",
        codecs.BOM_UTF8 + b"links.valve.area [cm2], nodes.lake.head\n17.5, 45.5\n18, 30\n",
        "links.valve.area [cm2];nodes.lake.head\n17.5;45.5\n18;30\n".encode("utf-16"),
        "# a remark\nlinks.valve.area [cm2],nodes.lake.head\n17.5,45.5\n18,30",
    ],
    ids=["commas", "semicolons and decimal commas", "tabs, blank and foreign lines", "a BOM", "UTF-16", "a remark"],
)
def test_separators_marks_and_decimal_commas_are_understood(case, tmp_path, text):
    assert read(case, tmp_path, text) == PLAIN


def test_cells_are_read_as_settings_are(case, tmp_path):
    text = 'numerics.scheme,links.main.cells,links.valve.opening,nodes.lake.head\nmuscl,20,"[1.0, 0.5]",45 m\n'
    assert read(case, tmp_path, text + "upwind5,40,0.5,30 m\n") == [
        {
            "numerics.scheme": "muscl",
            "links.main.cells": 20,
            "links.valve.opening": [1.0, 0.5],
            "nodes.lake.head": "45 m",
        },
        {"numerics.scheme": "upwind5", "links.main.cells": 40, "links.valve.opening": 0.5, "nodes.lake.head": "30 m"},
    ]


def test_all_that_is_wrong_of_a_file_is_said_at_once(case, tmp_path):
    text = "links.valve.aera;nodes.lake.head [kg];numerics.scheme [m];nodes.lake.head\n17,7;45;a;1\n;30 kg;b;2 kg\n"
    with pytest.raises(FvsolveError) as raised:
        read(case, tmp_path, text)
    said = str(raised.value)
    assert (
        'links.valve.aera: unknown key; did you mean "area"?' in said
        and "two columns have the key nodes.lake.head" in said
    )
    assert '"kg" is a mass; expected a head' in said and "values of numerics.scheme have no unit" in said
    assert "line 3, links.valve.aera: is empty. Expected a value in every row" in said and '"2 kg" is a mass' in said


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "has no rows; expected a header"),
        ("links.valve.area\n", "has no rows; expected a header"),
        ("1,2\n3,4\n", "has no header"),
        ("links.valve.area,nodes.lake.head\n1,2\n1\n", "line 3: 1 cell under 2 headers"),
        ("links.valve.area,nodes.lake.head\n0,5,3\n", "line 2: 3 cells under 2 headers; with decimal commas"),
        (b"\xff\xfe\x00", "is not UTF-8 or UTF-16 text"),
    ],
)
def test_what_is_no_table_is_named_with_its_line(case, tmp_path, text, said):
    with pytest.raises(FvsolveError, match=said):
        read(case, tmp_path, text)


def test_a_file_that_is_not_there_is_named(case, tmp_path):
    with pytest.raises(FvsolveError, match="nowhere.csv: No such file"):
        sweep(case, points=tmp_path / "nowhere.csv")


@pytest.mark.parametrize(
    "given, said",
    [
        ({"points": []}, "`points` is empty or has different keys"),
        ({"points": [{"links.valve.area": 1.0}, {"nodes.lake.head": 1.0}]}, "`points` is empty or has different keys"),
        ({"points": [{"links.valve.area": 1.0}], "vary": {"links.valve.area": [1.0, 2.0]}}, "Expected no `vary`"),
        ({"sample": "sobol:8"}, "no key varies"),
        ({"vary": {"links.valve.area": [1.0, 2.0], "nodes.lake.head": []}}, "nodes.lake.head: no values"),
    ],
)
def test_what_does_not_go_together_is_named(case, given, said):
    with pytest.raises(FvsolveError, match=said):
        sweep(case, **given)
