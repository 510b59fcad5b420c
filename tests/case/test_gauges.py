"""Gauges of a CSV file are those of a table."""

import pytest
from reference.scenes import scene

import fvsolve
from fvsolve.errors import CaseError

POOL = {
    "type": "basin",
    "size": [20.0, 4.0],
    "cells": [20, 4],
    "level": 0.5,
    "start": {"level": "0.5 + 0.01*x"},
}


def case(gauges) -> dict:
    made = scene(
        {"pool": POOL}, {}, 0.5, {"courant": 0.9}, ["pool.depth@kerb", "pool.speed@ford"], 0.1
    )
    made["output"]["gauges"] = gauges
    return made


@pytest.mark.parametrize("text", [
    "name,basin,x [m],y [m]\nkerb,pool,3,2\nford,pool,12.5,0.4\n",
    "y [cm];x [km];basin;name\n200;0,003;pool;kerb\n40;0,0125;pool;ford\n",
    "# surveyed\nname\tx\tbasin\ty\nkerb\t3\tpool\t2\nford\t12.5\tpool\t0.4\n",
])  # fmt: skip
def test_gauges_of_a_file_are_those_of_a_table(text, tmp_path):
    (tmp_path / "gauges.csv").write_text(text)
    here = fvsolve.run(case({"file": str(tmp_path / "gauges.csv")}), out=tmp_path / "out")
    there = fvsolve.run(
        case(
            {"kerb": {"basin": "pool", "at": [3, 2]}, "ford": {"basin": "pool", "at": [12.5, 0.4]}}
        )
    )
    again = fvsolve.run(tmp_path / "out" / "case.toml")
    for probe in ("pool.depth@kerb", "pool.speed@ford"):
        assert (
            here[probe] == pytest.approx(there[probe], rel=1e-12)
            and (again[probe] == here[probe]).all()
        )


@pytest.mark.parametrize("text, fault", [
    ("name,basin,x,y\nkerb,pool,3,2\nkerb,pool,4,2\n", 'line 3: "kerb" is the name of two gauges'),
    ("name,basin,x,y\n,pool,3,2\n", "line 2: a gauge has no name"),
    ("name,basin,x\nkerb,pool,3\n", 'has no column "y"; columns are "name", "basin", "x"'),
    ("name,basin,x,y\nkerb,pool,3,two\n", '"two" is not a number in column "y"'),
    ("name,basin,x [s],y\nkerb,pool,3,2\n", 'column "x [s]"'),
    ("name,basin,x,y\nkerb,pool,30,2\nford,pool,3,2\n", "output.gauges.kerb.at: 30,2 m lies outside the mesh"),
    ("name,basin,x,y\nkerb,pond,3,2\nford,pool,3,2\n", 'output.gauges.kerb.basin: no basin named "pond"'),
])  # fmt: skip
def test_faults_of_a_file_of_gauges_name_the_line(text, fault, tmp_path):
    (tmp_path / "gauges.csv").write_text(text)
    with pytest.raises(CaseError) as raised:
        fvsolve.load(case({"file": str(tmp_path / "gauges.csv")}))
    assert fault in str(raised.value)


def test_a_gauge_by_easting_and_northing_is_refused_with_its_place_in_the_basin(tmp_path):
    made = case(
        {
            "kerb": {"basin": "pool", "at": [412003.0, 5650002.5]},
            "ford": {"basin": "pool", "at": [3, 2]},
        }
    )
    made["nodes"]["pool"] = POOL | {"origin": [412000.0, 5650000.0]}
    with pytest.raises(
        CaseError,
        match="412003,5650002.5 m lies .* for easting and northing subtract `origin`: 3,2.5",
    ):
        fvsolve.load(made)


def test_a_file_of_gauges_excludes_others_and_must_exist():
    both = {"file": "a.csv", "kerb": {"basin": "pool", "at": [3, 2]}}
    for gauges, fault in [
        ({"file": "none.csv"}, "there is no such file"),
        (both, "file and kerb are given"),
    ]:
        with pytest.raises(CaseError) as raised:
            fvsolve.load(case(gauges))
        assert fault in str(raised.value)
