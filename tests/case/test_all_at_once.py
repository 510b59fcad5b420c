"""Faults of all sections are reported together: a file with several faults has those of files with one fault each."""

import copy
import re
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest
from reference.folders import DOCS
from reference.placed_parts import placed
from reference.refusals import refused

import fvsolve

POINT = {"basin": "pool", "from": [0, 0], "to": [1, 1]}
ODD: dict[tuple, Any] = {  # path of a key -> invalid value
    ("schema",): 3,
    ("titel",): "x",
    ("gravity",): "9 kg",
    ("fluid", "densty"): 3,
    ("nodes", "end", "area"): "3 kg",
    ("nodes", "top", "at"): "9 km",
    ("links", "main", "pieces"): 3,
    ("links", "hole", "coefficent"): 1,
    ("links", "half", "on"): "mian",
    ("links", "pump", "efficiency"): 80,
    ("signals", "tide", "value"): [1.2e5],
    ("scalars", "dye", "unitt"): "g",
    ("defaults", "pipe", "colour"): "red",
    ("routes", "way", "pipes"): ["main", "tial"],
    ("limits", "high", "on"): "wya",
    ("limits", "quick", "maximum"): "9 bar",
    ("numerics", "method"): "rk44",
    ("output", "every"): "3 m",
    ("output", "units", "pressure"): "m3/h",
    ("output", "probes", 0): "gat.pressure",
    ("output", "lines"): {"across": POINT},
    ("expect", "max(gate.presure)"): {"value": 1.0, "rtol": 1.0},
    ("expect", "max(gate.pressure)", "value"): "3 m3/h",
    ("expect", "at(gate.pressure, 99 s)"): {"value": 1.0, "rtol": 1.0},
    ("compare", "gate.head"): {"file": "lost.csv"},
    ("exact",): {"name": "rayz"},
}


def whole() -> dict:
    """Case with keys in every section."""
    case = placed()
    case["nodes"] |= {
        "top": {"type": "junction", "on": "main", "at": "2.2 km"},
        "end": {"type": "tank", "area": 10.0, "level": 5.0, "elevation": 20.0},
    }
    case["nodes"]["sea"]["pressure"] = {"signal": "tide"}
    case["links"] |= {
        "tail": {
            "type": "pipe",
            "from": "gate",
            "to": "end",
            "length": 100.0,
            "diameter": 0.3,
            "wave_speed": 1e3,
        },
        "pump": {
            "type": "pump",
            "from": "end",
            "to": "sea",
            "curve": {"flow": [0.1], "head": [20.0]},
        },
    }
    probes = ["gate.pressure", "main.head@2 km", "main-2.flow@0", "hole.flow", "way.pressure@0.2"]
    case["output"] |= {"units": {"pressure": "barg"}, "probes": probes}
    return case | {
        "signals": {"tide": {"time": [0, 1], "value": [1.2e5, 1.3e5]}},
        "scalars": {"dye": {"unit": "g"}},
        "defaults": {"pipe": {"minor_loss": 1.0}},
        "routes": {"way": {"pipes": ["main", "tail"]}},
        "limits": {
            "high": {"on": "way", "maximum": "30 bar"},
            "quick": {"on": ["main", "tail"], "quantity": "velocity", "maximum": "9 m/s"},
        },
        "expect": {"max(gate.pressure)": {"value": 1e6, "rtol": 10.0}},
    }


def faults(*paths: tuple) -> set[tuple[str, str]]:
    """(place, message) of each fault of the case with the invalid values of the given paths."""
    case = copy.deepcopy(whole())
    for path in paths:
        table: Any = case
        for key in path[:-1]:
            table = table[key] if isinstance(table, list) else table.setdefault(key, {})
        table[path[-1]] = ODD[path]
    try:
        fvsolve.load(case)
    except fvsolve.CaseError as error:
        return {(one.place, one.message) for one in error.faults}
    return set()


def test_a_fault_in_each_section_gives_a_message_each_and_all_come_at_once() -> None:
    alone = [faults(path) for path in ODD]
    assert [len(one) for one in alone] == [1] * len(ODD)
    assert faults(*ODD) == set().union(*alone)


@pytest.mark.parametrize(
    "first", [path for path in ODD if path[0] in ("nodes", "links", "numerics", "routes")]
)
def test_no_fault_hides_or_makes_another(first: tuple) -> None:
    for other in ODD:
        assert faults(first, other) == faults(first) | faults(other), other


def test_faults_that_follow_from_another_are_not_reported() -> None:
    case = whole()
    case["nodes"]["gate"]["type"] = "juncton"  # links, probes, claims and limits refer to it
    case["links"]["main"]["diameter"] = "3 kg"  # pieces, routes, a limit and elevations use it
    case["links"]["tap"]["to"] = "see"  # and no other link joins the sea
    del case["links"]["pump"], case["links"]["safe"]
    error = refused(case)
    assert [one.place for one in error.faults] == [
        "links.main.diameter",
        "nodes.gate.type",
        "links.tap.to",
    ]


@pytest.mark.parametrize("cells", [[10**7, 10**7], "many"])
def test_a_basin_without_a_mesh_hides_nothing(cells: Any) -> None:
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.load(
            "basin-draining",
            {
                "nodes.pool.cells": cells,
                "output.units": {"pressure": "m3/h"},
                "limits.high": {"on": "outsied", "maximum": 1.0},
            },
        )
    assert sorted(one.place for one in error.value.faults) == [
        "limits.high.on",
        "nodes.pool.cells",
        "output.units.pressure",
    ]


def keys_of(table: Any, above: tuple = ()) -> Iterator[tuple]:
    for key, value in (
        table.items()
        if isinstance(table, dict)
        else enumerate(table if isinstance(table, list) else ())
    ):
        yield (*above, key)
        yield from keys_of(value, (*above, key))


@pytest.mark.parametrize(
    "name", ["pumping-main", "plastic-main", "bend-force", "basin-draining", "closed-cylinder"]
)
def test_every_invalid_value_is_reported_at_its_own_place_only(name: str) -> None:
    base = tomllib.loads((DOCS.parent / "cases" / f"{name}.toml").read_text(encoding="utf-8"))
    for path in keys_of(base):
        case = copy.deepcopy(base)
        table: Any = case
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = "3 zz"
        try:
            fvsolve.load(case)
        except fvsolve.CaseError as error:
            places = [re.sub(r'["\]]', "", one.place.replace("[", ".")) for one in error.faults]
            own = ".".join(map(str, path))
            assert all(one.startswith(own) or own.startswith(f"{one}.") for one in places), (
                own,
                str(error),
            )


def test_an_exact_solution_without_a_viscosity_is_refused_with_the_reason() -> None:
    case = tomllib.loads((DOCS.parent / "cases" / "laminar-line.toml").read_text(encoding="utf-8"))
    del case["fluid"]["viscosity"]
    case["nodes"]["valve"]["demand"] = {
        "time": [0.0, 1.0, 2.0],
        "value": [1e-5, 1e-5, 0.0],
        "kind": "smooth",
    }
    refused(case, "viscosity is missing")
