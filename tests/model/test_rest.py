"""Networks at rest or in steady flow do not change, mass balances close, and the right-hand side is pure.

Closed chambers without a stated pressure carry their load: pressures by balances of forces, without motion.
"""

import numpy as np
import pytest
from pytest import approx
from reference import scenes
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    NO_FRICTION,
    RHO,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    step,
    tank,
    valve,
)
from reference.still_networks import ROUGH, moved, still_probes, town

import fvsolve
from fvsolve.errors import CaseError

SCHEMES = ["upwind", "muscl", "upwind5", "weno5", "central", "fromm", "linear-upwind", "upwind3"]


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    "friction",
    [ROUGH, {"model": "quasi-steady", "roughness": 2.6e-4}],
    ids=["steady", "quasi-steady"],
)
def test_a_looped_network_without_an_event_does_not_change_any_bit(scheme, friction):
    result = fvsolve.run(town(friction, {"scheme": scheme}))
    assert result.reason == "finished"  # linear-upwind is beyond its limit
    pipes, others = still_probes(result)
    assert len(pipes) == 45
    assert {n: moved(result, n) for n in pipes if moved(result, n) != 0.0} == {}
    assert max(moved(result, n) for n in others) <= 1e-12
    assert abs(result["ab.flow@0.31"][0]) > 1e-3  # steady flow
    assert np.all(result["shut.flow"] == 0.0)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["muscl", "upwind5"])
@pytest.mark.parametrize(
    "friction",
    [{"model": "hazen-williams", "coefficient": 110.0}, {"model": "steady", "factor": 0.02}],
)
def test_other_friction_laws_do_not_move_it_either(scheme, friction):
    result = fvsolve.run(town(friction, {"scheme": scheme}))
    assert {n: moved(result, n) for n in still_probes(result)[0] if moved(result, n) != 0.0} == {}


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_nor_does_the_log_law_move_the_pipes(scheme):
    """Under the law `log` the pipes do not change, except the two pipes at the tank.

    The lakes are not symmetric about this tank under the law `log`, so its level changes slowly.
    """
    result = fvsolve.run(town(ROUGH, {"scheme": scheme}, law="log"))
    names = [n for n in still_probes(result)[0] if n.split(".")[0] not in ("in", "on")]
    assert {n: moved(result, n) for n in names if moved(result, n) != 0.0} == {}
    assert moved(result, "middle.level") < 1e-4


@pytest.mark.parametrize(
    "air", [{"air_fraction": 0.01}, {"air_fraction": 0.02, "gas_exponent": 1.4}]
)
def test_nor_does_air_in_the_water(air):
    case = town(ROUGH, {"scheme": "muscl"}, 20.0)
    result = fvsolve.run({**case, "fluid": {**scenes.WATER, "law": "mixture", **air}})
    assert result.ok
    names = [n for n in still_probes(result)[0] if n.split(".")[0] not in ("in", "on")]
    assert {n: moved(result, n) for n in names if moved(result, n) != 0.0} == {}


@pytest.mark.parametrize("method", ["euler", "rk4", "bogacki-shampine", "dormand-prince"])
def test_no_method_moves_it(method):
    settings = {"scheme": "upwind", "method": method}
    result = fvsolve.run(town(ROUGH, settings))
    assert {n: moved(result, n) for n in still_probes(result)[0] if moved(result, n) != 0.0} == {}


def pond(law: str, friction: dict, scheme: str = "muscl") -> dict:
    """Case of equal heads that are exact in binary, with various elevations, wave speeds and loops."""
    nodes = {
        "lake": lake(47.25),
        "pool": tank(50.0, 6.25, elevation=41.0),
        "a": junction(elevation=12.7),
        "b": junction(elevation=-31.9),
        "c": junction(elevation=30.3),
    }
    rows = {
        "la": ("lake", "a", 311.0, 0.31, 1234.5, 9),
        "ab": ("a", "b", 173.2, 0.22, 987.6, 6),
        "bc": ("b", "c", 220.1, 0.17, 1111.1, 7),
        "ca": ("c", "a", 90.9, 0.41, 777.7, 5),
        "bp": ("b", "pool", 287.6, 0.26, 1312.3, 8),
    }
    links = {n: pipe(*row, friction=friction) for n, row in rows.items()}
    links["tap"] = valve("c", "pool", 0.01)
    numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.9}
    probes = [f"{n}.flow@{x}" for n in rows for x in (0.0, 0.4, 1.0)] + [
        "tap.flow",
        "a.head",
        "b.head",
        "c.head",
    ]
    return scene(
        nodes,
        links,
        20.0,
        numerics,
        [*probes, "pool.level"],
        1.0,
        fluid={**scenes.WATER, "law": law},
    )


FRICTIONS = [
    NO_FRICTION,
    ROUGH,
    {"model": "quasi-steady", "factor": 0.02},
    {"model": "hazen-williams", "coefficient": 120.0},
]


@pytest.mark.parametrize(
    "friction", FRICTIONS, ids=["none", "steady", "quasi-steady", "hazen-williams"]
)
def test_equal_heads_and_no_flow(friction):
    result = fvsolve.run(pond("linear", friction))
    flows = {
        str(p): float(np.max(np.abs(result[str(p)]))) for p in result.probes if ".flow" in str(p)
    }
    assert max(flows.values()) <= 1e-12, flows
    for place in "abc":
        assert result[f"{place}.head"] == pytest.approx(47.25, abs=1e-11)
    assert moved(result, "pool.level") <= 1e-12


@pytest.mark.parametrize("initial", ["steady", "equilibrium", "rest"])
def test_every_way_of_starting_finds_the_pond_at_rest(initial):
    case = pond("linear", ROUGH)
    case["numerics"]["initial"] = initial
    result = fvsolve.run(case)
    assert max(np.max(np.abs(result[str(p)])) for p in result.probes if ".flow" in str(p)) <= 1e-12


def busy(law: str, scheme: str) -> dict:
    """Case of the town with a burst at `b`."""
    case = town(ROUGH, {"scheme": scheme}, 20.0, step(1.0, 0.02, 0.06), law)
    case["output"]["every"] = 0.5
    return case


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
def test_the_mass_ledger_of_a_busy_network_closes(law, scheme):
    result = fvsolve.run(busy(law, scheme))
    mass = result.ledger["mass"]
    assert moved(result, "b.pressure") > 1e4
    assert abs(mass["relative"]) < 1e-12
    balance = (
        mass["initial"]
        + mass["inflow"]
        - mass["outflow"]
        - mass.get("spilled", 0.0)
        - mass["final"]
    )
    assert abs(balance) < 1e-12 * mass["initial"]


def test_outflow_in_the_ledger_is_the_demand():
    nodes = {"lake": reservoir(1e6), "gate": junction(step(1.0, 0.05, 0.01))}
    links = {"main": pipe("lake", "gate", 500.0, 0.3, 1000.0, 20)}
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    result = fvsolve.run(scene(nodes, links, 5.0, numerics, ["gate.pressure"]))
    gate = result.ledger["mass"]["nodes"]["gate"]  # waves also return mass to the lake
    assert gate == {"inflow": 0.0, "outflow": pytest.approx(1000.0 * (0.05 + 4 * 0.01), rel=1e-9)}


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_rhs_is_pure(law):
    model = fvsolve.build(fvsolve.load(busy(law, "muscl")))
    state = fvsolve.initial_state(model)
    rng = np.random.default_rng(3)
    states = [state.y + rng.normal(size=len(state.y)) * 1e-3 for _ in range(4)]
    first = [np.array(model.rhs(0.5, y)) for y in states]
    again = [np.array(model.rhs(0.5, y)) for y in reversed(states)][::-1]
    kept = [y.copy() for y in states]
    for one, two in zip(first, again, strict=True):
        assert np.array_equal(one, two)
    assert all(np.array_equal(a, b) for a, b in zip(states, kept, strict=True))


def test_a_symmetric_network_stays_symmetric():
    """Two equal branches of opposite direction have equal pressures."""
    nodes = {"lake": reservoir(1e6), "fork": junction()}
    nodes |= {n: junction(step(0.2, 0.03, 0.0)) for n in ("left", "right")}
    links = {
        "main": pipe("lake", "fork", 200.0, 0.3, 1000.0, 20, friction=ROUGH),
        "to": pipe("fork", "left", 150.0, 0.2, 1000.0, 15, friction=ROUGH),
        "fro": pipe("right", "fork", 150.0, 0.2, 1000.0, 15, friction=ROUGH),
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    result = fvsolve.run(scene(nodes, links, 5.0, numerics, ["left.pressure", "right.pressure"]))
    assert result["left.pressure"] == pytest.approx(result["right.pressure"], rel=1e-10)
    assert moved(result, "left.pressure") > 1e5


def test_a_long_run_rounds_its_ledger_once():
    """The ledger of 200 000 equal steps has rounding errors below 1e-13; plain sums would have 1e-11."""
    nodes = {"spring": {"type": "inflow", "flow": 0.01}, "pond": tank(1.0, 0.2)}
    links = {"main": pipe("spring", "pond", 10.0, 0.1, 1000.0, 10)}
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    result = fvsolve.run(scene(nodes, links, 200.0, numerics, ["pond.level"], 10.0))
    assert result.summary["steps"] > 200_000
    assert result.ledger["mass"]["relative"] < 1e-13
    assert result.ledger["mass"]["inflow"] == pytest.approx(2000.0, rel=1e-14)


def test_rows_stay_finite_up_to_the_last_good_time_when_a_step_is_too_long():
    nodes = {"lake": lake(50.0), "gate": junction(), "sea": lake(0.0)}
    links = {
        "main": pipe("lake", "gate", 100.0, 0.3, 1000.0, 40, friction=ROUGH),
        "tap": valve("gate", "sea", 0.002, step(0.02, 1.0, 0.3)),
    }
    numerics = {"scheme": "upwind5", "method": "euler", "courant": 3.0}
    result = fvsolve.run(scene(nodes, links, 2.0, numerics, ["gate.pressure"], 0.001))
    assert "has grown to" in result.reason
    assert np.all(np.isfinite(result["gate.pressure"]))
    assert result.t[-1] <= result.summary["t"]


def test_a_jump_at_the_very_end_has_two_rows():
    nodes = {"lake": lake(50.0), "gate": junction(), "sea": lake(0.0)}
    links = {
        "main": pipe("lake", "gate", 100.0, 0.3, 1000.0, 10, friction=ROUGH),
        "tap": valve("gate", "sea", 0.002, step(1.0, 1.0, 0.3)),
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    result = fvsolve.run(scene(nodes, links, 1.0, numerics, ["tap.flow"], 0.1))
    assert result.t[-1] == result.t[-2] == 1.0
    assert result["tap.flow"][-1] < 0.5 * result["tap.flow"][-2]


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5"])
def test_from_rest_a_pipe_between_two_lakes_accelerates_as_a_rigid_body_in_either_direction(
    law, scheme
):
    """A frictionless pipe starts with dq/dt = g A dH / L at all places."""
    area = np.pi / 4 * 0.3**2
    for ways in (("high", "low"), ("low", "high")):
        nodes = {"high": lake(50.0), "low": lake(40.0)}
        links = {"main": pipe(*ways, 100.0, 0.3, 1000.0, 20, friction=scenes.NO_FRICTION)}
        numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.9, "initial": "rest"}
        probes = ["main.flow@0.0", "main.flow@0.5", "main.flow@1.0", "main.head@0.5"]
        case = scene(nodes, links, 0.5, numerics, probes, 0.05, fluid={**scenes.WATER, "law": law})
        result = fvsolve.run(case)
        side = 1.0 if ways[0] == "high" else -1.0
        wanted = side * 9.80665 * area * 10.0 / 100.0 * np.asarray(result.t)
        for name in probes[:3]:
            assert result[name] == pytest.approx(wanted, rel=2e-3, abs=1e-12), name
        assert result["main.head@0.5"] == pytest.approx(45.0, abs=1e-9 if law == "linear" else 0.02)


A, B = 12e-4, 8e-4
MASS = {"type": "mass", "mass": 1000.0, "initial_position": 0.1}
POOL = {
    "type": "basin",
    "size": [2.0, 1.0],
    "cells": [10, 5],
    "level": 1.0,
    "patches": {"east": {"side": "east", "body": "load"}},
}
WATER_FORCE = 0.5 * RHO * GRAVITY  # thrust of water 1 m deep on a wall 1 m wide [N]


def jack(rod: str = "load", case: str = "ground", **more) -> dict:
    ports = {"rod": rod, "case": case}
    dead = {"dead_volume_A": 2e-5, "dead_volume_B": 2e-5}
    return {
        "type": "cylinder",
        "ports": ports,
        "stroke": 0.2,
        "area_A": A,
        "area_B": B,
        **dead,
        **more,
    }


def standing(load: float, initial: str = "steady", law: str = "linear", nodes=(), **more) -> dict:
    places = {"ground": {"type": "frame"}, "load": MASS, **dict(nodes)}
    links = {"lift": jack(**more), "weight": {"type": "force", "to": "load", "force": load}}
    case = scene(
        places,
        links,
        0.02,
        {"method": "dormand-prince", "rtol": 1e-9, "initial": initial, "scheme": "muscl"},
    )
    case["fluid"]["law"] = law
    return case


def held(case: dict) -> tuple[dict[str, float], float]:
    """Initial pressures of both chambers [Pa], and displacement of the mass [m]."""
    case["output"] |= {"probes": ["lift.A.pressure", "lift.B.pressure", "load.position"]}
    run = fvsolve.run(case)
    return {side: run[f"lift.{side}.pressure"][0] for side in "AB"}, float(
        np.ptp(run["load.position"])
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("initial", ["steady", "equilibrium"])
@pytest.mark.parametrize(
    ("load", "more", "pressures"),
    [
        (-9810.0, {}, (AMBIENT + 9810.0 / A, AMBIENT)),
        (-9810.0, {"law": "log"}, (AMBIENT + 9810.0 / A, AMBIENT)),
        (9810.0, {}, (AMBIENT, AMBIENT + 9810.0 / B)),
        (-9810.0, {"initial_pressure_B": 2e6}, (AMBIENT + (9810.0 + B * (2e6 - AMBIENT)) / A, 2e6)),
        (2000.0, {"initial_pressure_A": 2e6}, (2e6, AMBIENT + (2000.0 + A * (2e6 - AMBIENT)) / B)),
        (-500.0, {"nodes": {"pool": POOL}}, (AMBIENT, AMBIENT + (WATER_FORCE - 500.0) / B)),
        (-8000.0, {"nodes": {"pool": POOL}}, (AMBIENT + (8000.0 - WATER_FORCE) / A, AMBIENT)),
    ],
)
def test_a_mass_and_a_wall_of_water_stand_on_shut_chambers(load, more, pressures, initial):
    found, moved = held(standing(load, initial, **more))
    assert (found["A"], found["B"]) == approx(pressures, rel=1e-9)
    assert moved == 0.0


@pytest.mark.parametrize("initial", ["steady", "equilibrium"])
def test_masses_stacked_on_cylinders_are_each_supported_by_their_own(initial):
    case = standing(-3000.0, initial)
    case["nodes"]["top"] = {**MASS, "initial_position": 0.2}
    case["links"] |= {
        "upper": jack("top", "load"),
        "more": {"type": "force", "to": "top", "force": -5000.0},
    }
    case["output"] |= {
        "probes": ["lift.A.pressure", "upper.A.pressure", "top.position", "load.position"]
    }
    run = fvsolve.run(case)
    assert run["lift.A.pressure"][0] == approx(AMBIENT + 8000.0 / A, rel=1e-9)
    assert run["upper.A.pressure"][0] == approx(AMBIENT + 5000.0 / A, rel=1e-9)
    assert np.ptp(run["top.position"]) == np.ptp(run["load.position"]) == 0.0


def test_a_mass_next_to_a_body_is_supported_by_its_own_cylinder():
    case = standing(-9810.0)
    case["nodes"]["post"] = {"type": "frame", "points": {"foot": [0, 0, 0]}}
    case["nodes"]["box"] = {
        "type": "body",
        "mass": 50.0,
        "inertia": [1.0, 1.0, 1.0],
        "joint": {"kind": "prismatic", "axis": [0, 0, 1], "travel": 0.1},
    }
    case["links"] |= {
        "post_lift": jack("box", "post.foot"),
        "gate": valve("lift.A", "post_lift.A", 1e-5, 0.0),
    }
    case["output"] |= {
        "probes": ["lift.A.pressure", "post_lift.A.pressure", "load.position", "box.travel"]
    }
    run = fvsolve.run(case)
    assert run["lift.A.pressure"][0] == approx(AMBIENT + 9810.0 / A, rel=1e-9)
    assert run["post_lift.A.pressure"][0] == approx(AMBIENT + 50.0 * GRAVITY / A, rel=1e-9)
    assert np.ptp(run["load.position"]) == np.ptp(run["box.travel"]) == 0.0


@pytest.mark.parametrize("load", [-9810.0, 9810.0, 0.0])
def test_behind_a_servo_valve_at_rest_a_chamber_is_at_half_the_supply_and_the_opposite_chamber_balances(
    load,
):
    high, low = AMBIENT + 140e5, AMBIENT
    case = standing(load, "equilibrium", nodes={"high": reservoir(high), "low": reservoir(low)})
    case["links"]["spool"] = {
        "type": "spool-valve",
        "ports": {"P": "high", "T": "low", "A": "lift.A", "B": "lift.B"},
        "area": 1e-5,
        "position": 0.0,
    }
    found, moved = held(case)
    half = 0.5 * (high + low)
    assert found["B" if load < 0.0 else "A"] == approx(half, rel=1e-9)
    assert A * (found["A"] - AMBIENT) - B * (found["B"] - AMBIENT) == approx(-load, abs=1e-6)
    assert moved == 0.0


def test_a_shut_chamber_that_would_have_to_pull_holds_no_mass():
    with pytest.raises(CaseError, match="nodes.load.* N remain"):
        fvsolve.build(fvsolve.load(standing(-20000.0, "equilibrium", initial_pressure_A=2e6)))
