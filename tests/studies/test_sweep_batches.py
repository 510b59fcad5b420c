"""Rows of a sweep that are computed in batches have the bits of rows that are computed alone."""

import random
from dataclasses import replace

import numpy as np
import pytest
from reference.scenes import junction, pipe, reservoir, scene, valve

from fvsolve.case import load
from fvsolve.core.run import model_of
from fvsolve.errors import Notice
from fvsolve.studies import sweep, sweep_batches
from fvsolve.studies.sweep_batches import BatchedRows
from fvsolve.studies.sweep_row import RowMaker

CLOSING = {"start": 0.1, "duration": 0.1, "value": [1.0, 0.0]}
METHODS = {
    "upwind5": {"scheme": "upwind5", "method": "rk4", "courant": 0.9},
    "muscl": {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8},
    "fused": {"scheme": "upwind", "method": "euler", "courant": 0.95},
    "step": {"scheme": "weno5", "method": "ssp-rk3", "step": 2e-3},
    "delay": {"pipe_model": "delay-line", "method": "euler", "step": 5e-3},
}


def network(numerics: dict, opening=CLOSING, head=20.0) -> dict:
    """Case of a loop of pipes with a demand, and a valve that closes."""
    steady = {"model": "steady", "factor": 0.02}
    nodes = {
        name: junction(demand) for name, demand in {"fork": 0.0, "side": 0.002, "gate": 0.0}.items()
    }
    nodes |= {"lake": reservoir(101325.0 + 9810.0 * head), "out": reservoir(101325.0)}
    links = {
        "main": pipe("lake", "fork", 120.0, 0.3, 1000.0, 12, friction=steady),
        "upper": pipe("fork", "gate", 80.0, 0.2, 1000.0, 8, friction=steady),
        "first": pipe("fork", "side", 40.0, 0.15, 1000.0, 6, friction=steady),
        "second": pipe("side", "gate", 50.0, 0.15, 1000.0, 6, friction=steady),
        "valve": valve("gate", "out", 0.004, opening),
    }
    return scene(nodes, links, 1.0, numerics, ["gate.pressure", "valve.flow", "upper.pressure@0.5"])


VARIED = {
    "area": lambda draw: {"links.valve.area": draw(0.002, 0.006)},
    "pressure": lambda draw: {
        "nodes.lake.pressure": draw(2.5e5, 4e5),
        "nodes.side.demand": draw(5e-4, 3e-3),
    },
    "diameter": lambda draw: {
        "links.upper.diameter": draw(0.15, 0.25),
        "links.main.friction.factor": draw(0.01, 0.03),
    },
    "opening": lambda draw: {
        "links.valve.opening.value": [1.0, draw(0.0, 0.6)],
        "links.valve.area": draw(0.002, 0.006),
    },
}


def tasks_of(name: str, count: int, seed=1) -> list[dict]:
    rng = random.Random(seed)
    return [VARIED[name](rng.uniform) for _ in range(count)]


def alone(case: dict, tasks: list[dict]) -> list[dict]:
    make = RowMaker(case, {})
    return [make(task) for task in tasks]


def batched(case: dict, tasks: list[dict], failed=0) -> list[dict]:
    """Rows in batches; `failed` is the number of batches at the end of the sweep that could not be used."""
    work = BatchedRows(RowMaker(case, {}))
    rows = list(work.results(tasks))
    assert work.failed == failed and work.batch is not None
    return rows


def untimed(rows: list[dict]) -> list[dict]:
    return [{key: value for key, value in row.items() if key != "seconds"} for row in rows]


@pytest.mark.in_turn
@pytest.mark.parametrize("varied", VARIED)
@pytest.mark.parametrize("name", METHODS)
def test_rows_of_batches_have_the_bits_of_rows_alone(name, varied):
    case, tasks = network(METHODS[name]), tasks_of(varied, 20)
    one, other = untimed(alone(case, tasks)), untimed(batched(case, tasks))
    assert one == other and all(row["ok"] for row in one)
    assert len({row["max(gate.pressure) [Pa]"] for row in one}) == len(tasks)


def restated(how: str) -> dict:
    """Case of `network` with another order, direction, start or unit."""
    case = network(METHODS["upwind5"])
    links = case["links"]
    if how == "order":
        case["links"], case["nodes"] = (
            dict(reversed(links.items())),
            dict(reversed(case["nodes"].items())),
        )
    elif how == "ends":
        for link in links.values():
            link["from"], link["to"] = link["to"], link["from"]
    elif how == "elevations":
        for node, height in zip(case["nodes"].values(), (3.0, 1.0, 2.0, 0.0, 1.5), strict=True):
            node["elevation"] = height
    elif how == "no pipes":
        case["links"] = {"valve": valve("lake", "out", 0.004, CLOSING)}
        case["nodes"] = {name: case["nodes"][name] for name in ("lake", "out")}
        case["numerics"] = {"end": 1.0, "method": "euler", "step": 0.01}
        case["output"]["probes"] = ["valve.flow"]
    elif how == "wave":
        links["valve"]["opening"] = {"mean": 0.5, "amplitude": 0.4, "period": 0.3}
    elif how == "units":
        links["main"]["length"], case["output"]["units"] = (
            "0.12 km",
            {"pressure": "bar", "flow": "l/s"},
        )
    elif how == "no probes":
        del case["output"]["probes"]
    else:
        case["numerics"] |= {"rest": {"initial": "rest"}, "early": {"start": -0.5}}[how]
    return case


@pytest.mark.parametrize(
    "how",
    ["order", "ends", "elevations", "no pipes", "wave", "units", "no probes", "rest", "early"],
)
def test_rows_of_restated_cases_have_the_bits_of_rows_alone(how):
    case, tasks = restated(how), tasks_of("area", 20)
    one, other = untimed(alone(case, tasks)), untimed(batched(case, tasks))
    assert one == other and all(row["reason"] == "finished" for row in one)


def test_variants_that_grow_are_stopped_as_alone():
    case, tasks = network(METHODS["muscl"] | {"courant": 3.0}), tasks_of("area", 20)
    rows = batched(case, tasks, failed=1)
    assert untimed(rows) == untimed(alone(case, tasks))
    assert not any(row["ok"] for row in rows) and all(
        row["reason"].startswith("stopped") for row in rows
    )


def test_rows_do_not_depend_on_order_and_size_of_batches(monkeypatch):
    case, tasks = network(METHODS["upwind5"]), tasks_of("area", 45)
    forward, backward = untimed(batched(case, tasks)), untimed(batched(case, tasks[::-1]))
    assert forward == backward[::-1]
    monkeypatch.setattr(sweep_batches, "SIZE", 9)
    assert untimed(batched(case, tasks)) == forward
    monkeypatch.undo()
    processes = sweep(case, points=tasks, jobs=2).rows
    assert [
        {key: row[key] for key in own} for row, own in zip(processes, forward, strict=True)
    ] == forward


def test_a_variant_that_is_refused_is_named_in_its_row_and_the_others_are_as_alone():
    case, tasks = network(METHODS["upwind5"]), tasks_of("area", 30)
    tasks[11] = {"links.valve.area": -1.0}
    rows = batched(case, tasks)
    assert untimed(rows) == untimed(alone(case, tasks))
    assert rows[11]["reason"].startswith("refused") and sum(row["ok"] for row in rows) == 29
    tasks[11] = {"links.valve.area": 0.004, "nodes.side.demand": 1e3}
    rows = batched(case, tasks, failed=1)
    assert untimed(rows) == untimed(alone(case, tasks)) and rows[11]["reason"].startswith(
        "refused: numerics.initial"
    )


def test_marks_and_notices_are_those_of_the_own_run():
    case = network(METHODS["muscl"] | {"below_vapor": "continue"}, head=8.0)
    tasks = [
        {"links.valve.area": area, "nodes.side.demand": 0.0}
        for area in np.linspace(1e-5, 0.02, 24).tolist()
    ]
    rows = batched(case, tasks)
    assert untimed(rows) == untimed(alone(case, tasks))
    assert 0 < sum(bool(row["marks"]) for row in rows) < 24
    assert any(row["warnings"] for row in rows) and "~" not in str(rows)


def test_expectations_are_those_of_the_own_run():
    case = network(METHODS["upwind5"])
    case["expect"] = {
        "max(gate.pressure)": {"value": 1e6, "atol": 2.5e5},
        "at(valve.flow, 0.12 s)": {"value": 0.05, "rtol": 1.0},
    }
    tasks = tasks_of("area", 20)
    rows = batched(case, tasks)
    assert (
        untimed(rows) == untimed(alone(case, tasks))
        and len({row["expectations"] for row in rows}) == 2
    )


LIMITS = {
    "pipes": {"on": "pipes", "maximum": 1e6, "minimum": "vacuum"},
    "nodes": {"on": "nodes", "quantity": "head", "maximum": 100.0},
    "gate": {"on": "gate", "quantity": "gauge_pressure", "maximum": 9e5},
    "speed": {"on": ["upper", "main"], "quantity": "velocity", "maximum": 1.0},
    "flow": {"on": "valve", "quantity": "flow", "minimum": -1e-3},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("limit", LIMITS)
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("shape", ["straight", "profile"])
def test_verdicts_are_those_of_the_own_run(shape, name, limit):
    case = network(METHODS[name])
    case["limits"] = {limit: LIMITS[limit]}
    for node, height in zip(case["nodes"].values(), (3.0, 1.0, 2.0, 0.0, 1.5), strict=True):
        node["elevation"] = height
    if shape == "profile":
        case["links"]["main"]["profile"] = {
            "chainage": [0.0, 50.0, 120.0],
            "elevation": [0.0, 9.0, 3.0],
        }
    case["expect"] = {"max(pipes.pressure)": {"value": 8e5, "atol": 2e5}}
    tasks = [{"links.valve.area": area} for area in np.linspace(5e-4, 0.012, 20).tolist()]
    rows = batched(case, tasks)
    assert untimed(rows) == untimed(alone(case, tasks))
    assert {row["verdicts"] for row in rows} == {True, False} and {
        row["expectations"] for row in rows
    } == {True, False}


OTHER_STEPS = {
    "links.valve.opening.duration": [0.1, 0.2],
    "links.main.cells": [12, 14],
    "numerics.end": [1.0, 0.8],
    "links.main.wave_speed": [1000.0, 1200.0],
}


@pytest.mark.parametrize("key", OTHER_STEPS)
def test_variants_with_other_steps_or_cells_run_alone(key):
    case = network(METHODS["upwind5"])
    tasks = [
        {key: OTHER_STEPS[key][k % 5 == 3]} | task for k, task in enumerate(tasks_of("area", 20))
    ]
    assert untimed(batched(case, tasks, failed=1)) == untimed(alone(case, tasks))


def suited(case: dict, **changes) -> bool:
    return sweep_batches.is_suited(model_of(load(case, changes)))


def test_cases_with_steps_that_depend_on_states_run_alone():
    case = network(METHODS["upwind5"])
    assert suited(case)
    assert not suited(case, **{"numerics.method": "tr-bdf2"})
    assert not suited(case, **{"numerics.method": "dormand-prince", "numerics.rtol": 1e-6})
    jumping = network(METHODS["delay"], {"time": [0.0, 0.1], "value": [1.0, 0.5], "kind": "step"})
    assert not suited(jumping) and suited(network(METHODS["delay"]))
    case["nodes"]["gate"] = {"type": "chamber", "volume": 0.1}
    assert not suited(case)


def test_a_notice_on_the_run_as_a_whole_or_on_two_copies_is_detected():
    own = Notice("range", "links.main~3~", "main~3~: odd")
    found = sweep_batches.notices_of_copies([own])
    assert found[3] == [replace(own, place="links.main", text="main: odd")] and not any(
        found[:3] + found[4:]
    )
    assert sweep_batches.notices_of_copies([Notice("range", "numerics", "all is odd")]) is None
    assert (
        sweep_batches.notices_of_copies([Notice("range", "links.main~3~", "main~3~ and main~4~")])
        is None
    )


def test_a_step_beyond_a_limit_is_reported_in_every_row():
    case = network(METHODS["fused"] | {"courant": 1.02})
    tasks = tasks_of("area", 20)
    rows = batched(case, tasks, failed=1)
    assert untimed(rows) == untimed(alone(case, tasks))
    assert all(any(notice["kind"] == "step-limit" for notice in row["warnings"]) for row in rows)
