"""Quasi-steady pipes: closed forms, hand-written networks in SciPy, restatements, energy, probes, faults."""

import math

import numpy as np
import pytest
from reference.jacobians import stray
from reference.level_control import METHODS
from reference.quasi_steady import FACTOR, HAZEN, loss_of, pipe
from reference.resumed_runs import killed_and_resumed, same_files
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    WATER,
    area,
    junction,
    lake,
    reservoir,
    scene,
    step,
    tank,
    valve,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

import fvsolve
from fvsolve.core.fluid import LAWS
from fvsolve.errors import CaseError
from fvsolve.studies import energy

CLOSE = 1e-9
EXACT = {"rtol": 1e-12}


def two_tanks(friction=FACTOR, end=600.0, numerics=EXACT, probes=(), **more):
    nodes = {"upper": tank(2.0, 5.0, elevation=3.0), "lower": tank(3.0, 1.0, elevation=0.0)}
    probes = ["upper.level", "lower.level", "main.flow", *probes]
    return scene(
        nodes,
        {"main": pipe("upper", "lower", friction=friction, **more)},
        end,
        dict(numerics),
        probes,
        20.0,
    )


# laws -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_tanks_equalise_as_in_the_closed_form(method):
    """With h the difference of heads and a quadratic loss, sqrt(h) falls at a constant rate."""
    run = fvsolve.run(two_tanks(minor_loss=3.0), {"numerics.method": method})
    bore = area(0.05)
    speed = bore * math.sqrt(2.0 * GRAVITY / (0.02 * 100.0 / 0.05 + 3.0)) * (1.0 / 2.0 + 1.0 / 3.0)
    heads = 3.0 + run["upper.level"] - run["lower.level"]
    assert run.ok and heads == pytest.approx((math.sqrt(7.0) - 0.5 * speed * run.t) ** 2, abs=CLOSE)


FRICTIONS = [
    FACTOR,
    HAZEN,
    {"model": "chezy-manning", "coefficient": 0.011},
    {"model": "quasi-steady", "roughness": 2e-4},
    {"model": "swamee-jain", "roughness": 2e-4},
]


@pytest.mark.parametrize("friction", FRICTIONS, ids=lambda one: one["model"])
def test_the_flow_has_the_losses_of_its_friction_model(friction):
    run = fvsolve.run(two_tanks(friction, 900.0, minor_loss=2.0))
    heads = 3.0 + run["upper.level"] - run["lower.level"]
    flows = [brentq(lambda q, h=h: loss_of(friction, q) - h, 1e-4, 0.1, xtol=1e-16) for h in heads]
    assert run.ok and run["main.flow"] == pytest.approx(flows, rel=1e-8)


def test_laminar_flow_is_poiseuilles():
    """In 0.5 mm of bore: heads fall exponentially with the flow pi d^4 / (128 mu L)."""
    case = two_tanks(
        {"model": "quasi-steady", "roughness": 0.0}, 3600.0, diameter=0.0005, length=1.0
    )
    case["nodes"]["upper"]["area"] = case["nodes"]["lower"]["area"] = 1e-4
    case["nodes"]["upper"] |= {"elevation": 0.5, "level": 7.5}
    run = fvsolve.run(case)
    per_head = math.pi * 0.0005**4 / (128.0 * 1e-3) * RHO * GRAVITY
    heads = 0.5 + run["upper.level"] - run["lower.level"]
    assert heads == pytest.approx(7.0 * np.exp(-2.0 * per_head / 1e-4 * run.t), abs=CLOSE)


# networks ---------------------------------------------------------------------------------------------------------

LOOP = {
    "p1": ("high", "a", 400.0, 0.25),
    "p2": ("a", "b", 300.0, 0.15),
    "p3": ("b", "c", 350.0, 0.2),
    "p4": ("a", "c", 500.0, 0.15),
    "p5": ("c", "tower", 450.0, 0.2),
    "p6": ("b", "pond", 200.0, 0.1),
}
DEMANDS, SECTIONS = {"a": 5e-3, "b": 3e-3, "c": 4e-3}, {"tower": 60.0, "pond": 40.0}


def loop(friction=HAZEN, end=7200.0, numerics=EXACT, **top):
    nodes = {
        "high": lake(60.0, elevation=50.0),
        "tower": tank(60.0, 3.0, elevation=40.0),
        "pond": tank(40.0, 2.0, elevation=35.0),
    }
    nodes |= {
        name: junction(step(3600.0, demand, 2.0 * demand), elevation=10.0)
        for name, demand in DEMANDS.items()
    }
    links = {name: pipe(*keys, friction) for name, keys in LOOP.items()}
    probes = ["tower.level", "pond.level", "a.head", *(f"{name}.flow" for name in LOOP)]
    return scene(nodes, links, end, dict(numerics), probes, 360.0, **top)


def loop_rates(t, y):
    """d/dt of the levels of tower and pond [m/s]: heads of three junctions by Newton on mass balances."""
    factor = 2.0 if t >= 3600.0 else 1.0
    held = {"high": 60.0, "tower": 40.0 + y[0], "pond": 35.0 + y[1]}

    def flows(heads):
        known, result = held | dict(zip(DEMANDS, heads, strict=True)), {}
        for name, (start, end, length, diameter) in LOOP.items():
            per = 4.727 * 0.3048**-0.685 * length / HAZEN["coefficient"] ** 1.852 / diameter**4.871
            drop = known[start] - known[end]
            result[name] = math.copysign((abs(drop) / per) ** (1.0 / 1.852), drop)
        return result

    def balances(heads):
        result = dict.fromkeys(DEMANDS, 0.0)
        for name, flow in flows(heads).items():
            for end, sign in zip(LOOP[name][:2], (-1.0, 1.0), strict=True):
                if end in result:
                    result[end] += sign * flow
        return [result[name] - factor * demand for name, demand in DEMANDS.items()]

    found = flows(root(balances, loop_rates.guess, tol=1e-13).x)
    return [found["p5"] / SECTIONS["tower"], found["p6"] / SECTIONS["pond"]]


loop_rates.guess = [50.0, 45.0, 45.0]


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5"])
def test_tanks_behind_a_loop_of_pipes_follow_explicit_equations(method):
    run = fvsolve.run(loop(), {"numerics.method": method})
    first = solve_ivp(
        loop_rates, (0.0, 3600.0 - 1e-9), [3.0, 2.0], "DOP853", rtol=1e-11, atol=1e-12
    )
    last = solve_ivp(loop_rates, (3600.0, 7200.0), first.y[:, -1], "DOP853", rtol=1e-11, atol=1e-12)
    assert run.ok
    assert [run["tower.level"][-1], run["pond.level"][-1]] == pytest.approx(last.y[:, -1], abs=1e-8)


@pytest.mark.parametrize("size", [3, 9])
def test_a_grid_of_pipes_balances_at_every_node(size):
    """The sparse order of elimination leaves no node and no fill out: each pipe has its loss, each node its balance."""
    rng = np.random.default_rng(size)
    places = [(i, j) for i in range(size) for j in range(size)]
    nodes = {
        f"n{i}{j}": junction(float(rng.uniform(0.0, 1e-3)), elevation=float(rng.uniform(0.0, 5.0)))
        for i, j in places
    }
    nodes |= {"west": lake(50.0, elevation=0.0), "east": tank(30.0, 20.0, elevation=20.0)}
    joins = [
        (f"n{i}{j}", f"n{k}{m}")
        for i, j in places
        for k, m in ((i + 1, j), (i, j + 1))
        if max(k, m) < size
    ]
    joins += [("west", "n00"), (f"n{size - 1}{size - 1}", "east")]
    links = {
        f"p{k}": pipe(*ends, float(rng.uniform(50.0, 300.0)), float(rng.uniform(0.05, 0.2)), HAZEN)
        for k, ends in enumerate(joins)
    }
    probes = [*(f"{name}.flow" for name in links), *(f"{name}.head" for name in nodes)]
    run = fvsolve.run(scene(nodes, links, 1800.0, dict(EXACT), probes, 1800.0))
    inflow = {name: -node.get("demand", 0.0) for name, node in nodes.items()}
    for name, link in links.items():
        flow = run[f"{name}.flow"][-1]
        drop = run[f"{link['from']}.head"][-1] - run[f"{link['to']}.head"][-1]
        loss = loss_of(HAZEN, abs(flow), link["length"], link["diameter"], 0.0)
        assert math.copysign(loss, flow) == pytest.approx(drop, rel=1e-8, abs=1e-9)
        inflow[link["from"]] -= flow
        inflow[link["to"]] += flow
    assert [inflow[f"n{i}{j}"] for i, j in places] == pytest.approx([0.0] * size**2, abs=1e-13)


def test_no_flow_passes_a_dead_end_and_a_shut_valve_parts_the_network():
    case = loop(end=360.0)
    case["nodes"]["stub"], case["nodes"]["gate"] = junction(elevation=5.0), junction(elevation=10.0)
    case["links"]["p7"] = pipe("c", "stub")
    case["links"]["p6"]["from"] = "gate"
    case["links"]["shut"] = valve("b", "gate", 0.01, step(100.0, 1.0, 0.0))
    case["output"]["probes"] = [
        "p7.flow",
        "stub.head",
        "c.head",
        "p6.flow",
        "pond.level",
        "gate.head",
    ]
    run = fvsolve.run(case)
    assert (
        run.ok
        and np.all(run["p7.flow"] == 0.0)
        and run["stub.head"] == pytest.approx(run["c.head"], abs=1e-9)
    )
    assert run["p6.flow"][-1] == 0.0
    assert run["gate.head"][-1] == pytest.approx(35.0 + run["pond.level"][-1], abs=1e-6)


# restatements -----------------------------------------------------------------------------------------------------


def final(case, method="dormand-prince", **settings):
    run = fvsolve.run(case, {"numerics.method": method, **settings})
    assert run.ok
    return np.array([run["tower.level"][-1], run["pond.level"][-1]])


@pytest.mark.parametrize("method", METHODS)
def test_the_method_does_not_matter(method):
    assert final(loop(end=3000.0), method) == pytest.approx(final(loop(end=3000.0)), abs=CLOSE)


def test_the_words_do_not_matter():
    case = loop(end=3000.0)
    exact = final(case)
    turned = loop(end=3000.0)
    for link in turned["links"].values():
        link["from"], link["to"] = link["to"], link["from"]
    shuffled = {
        **case,
        "nodes": dict(reversed(case["nodes"].items())),
        "links": dict(reversed(case["links"].items())),
    }
    units = loop(end=3000.0)
    for link in units["links"].values():
        link["length"], link["diameter"] = (
            f"{link['length'] * 1e-3!r} km",
            f"{link['diameter'] * 1e3!r} mm",
        )
    bare = loop(end=3000.0)
    for link in bare["links"].values():
        del link["pipe_model"]
    halved = loop(end=3000.0)
    halved["nodes"]["middle"] = junction(elevation=5.0)
    halved["links"]["p1"] |= {"to": "middle", "length": 150.0}
    halved["links"]["p9"] = halved["links"]["p1"] | {"from": "middle", "to": "a", "length": 250.0}
    waves = loop(end=3000.0)  # keys of waves have no effect
    waves["links"]["p1"] |= {"wave_speed": 900.0, "cells": 7}
    for other in (turned, shuffled, units, halved, waves):
        assert final(other) == pytest.approx(exact, abs=CLOSE)
    assert final(bare, **{"numerics.pipe_model": "quasi-steady"}) == pytest.approx(exact, abs=0.0)
    assert final({**bare, "defaults": {"pipe": {"pipe_model": "quasi-steady"}}}) == pytest.approx(
        exact, abs=0.0
    )


FLUIDS = {
    "log": {**WATER, "law": "log"},
    "table": {"name": "Water", "temperature": 293.15, "law": "table"},
    "mixture": {**WATER, "law": "mixture", "air_fraction": 1e-6},
}


@pytest.mark.parametrize("law", FLUIDS)
def test_every_density_law_has_the_flows_of_a_liquid_that_hardly_yields(law):
    assert set(FLUIDS) | {"linear"} == set(LAWS)
    assert final(loop(end=3000.0, fluid=FLUIDS[law])) == pytest.approx(
        final(loop(end=3000.0)), abs=3e-3
    )


def test_a_pipe_with_waves_comes_to_the_same_flow():
    """Levels of long tanks by delay lines and by quasi-steady pipes differ by the inertia of the water alone."""
    case = two_tanks(end=120.0, numerics={"method": "dormand-prince", "rtol": 1e-8})
    case["nodes"]["upper"]["area"] = case["nodes"]["lower"]["area"] = 20.0
    waves = two_tanks(
        end=120.0, numerics={"method": "rk4", "courant": 0.8}, wave_speed=1000.0, cells=4
    )
    waves["nodes"], waves["links"]["main"]["pipe_model"] = case["nodes"], "finite-volume"
    quick, slow = fvsolve.run(case), fvsolve.run(waves)
    assert quick["main.flow"][-1] == pytest.approx(slow["main.flow"][-1], rel=1e-4)


# rest, energy, pattern, resume --------------------------------------------------------------------------------------


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("friction", [HAZEN, *FRICTIONS[-2:]], ids=lambda one: one["model"])
def test_at_rest_no_bit_changes(method, law, friction):
    case = loop(friction, 600.0, {"rtol": 1e-8}, fluid={**WATER, "law": law})
    for node in case["nodes"].values():
        if node["type"] == "junction":
            del node["demand"]
        elif node["type"] == "tank":
            node["level"] = 60.0 - node["elevation"]
    # tanks and a lake at the same level, so that their pressures agree to the bit
    if law != "linear":
        case["nodes"] = {
            k: v | {"elevation": 10.0, "level": 20.0} if v["type"] == "tank" else v
            for k, v in case["nodes"].items()
        }
        case["nodes"]["high"] = tank(50.0, 20.0, elevation=10.0)
    model = fvsolve.build(fvsolve.load(case, {"numerics.method": method}))
    assert np.all(model.rhs(0.0, np.zeros(model.y_size)) == 0.0)
    run = fvsolve.run(case, {"numerics.method": method})
    assert run.ok and all(
        np.ptp(run[probe]) == 0.0 for probe in ("tower.level", "pond.level", "p3.flow", "a.head")
    )


def test_the_ledger_closes_and_pipes_dissipate_drop_times_flow():
    case = two_tanks(minor_loss=2.0)
    run, ledger = fvsolve.run(case), energy(case)
    assert abs(ledger.remainder[-1]) < 1e-12 * ledger.throughput
    fallen = (
        RHO
        * GRAVITY
        * (
            2.0 * 0.5 * (5.0**2 - run["upper.level"][-1] ** 2)
            + 3.0 * 0.5 * (1.0 - run["lower.level"][-1] ** 2)
            + 3.0 * 2.0 * (5.0 - run["upper.level"][-1])
        )
    )
    assert ledger.dissipated["main"][-1] == pytest.approx(fallen, rel=1e-9)
    ledger = energy(loop(end=3000.0))
    assert abs(ledger.remainder[-1]) < 1e-12 * ledger.throughput


@pytest.mark.parametrize("law", ["linear", "log"])
def test_no_rate_depends_on_a_state_outside_its_pattern(law):
    model = fvsolve.build(fvsolve.load(loop(fluid={**WATER, "law": law})))
    rng = np.random.default_rng(1)
    assert (
        max(stray(model, t, model.scale * rng.normal(size=model.y_size)) for t in (0.0, 4000.0))
        < 1e-7
    )


def test_a_killed_run_resumes_to_the_bit(tmp_path):
    case = loop(end=900.0, numerics={"method": "rk4", "step": 0.2})
    case["output"]["every"] = 0.5
    fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 450.0))


# probes and faults --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["linear", "log"])
def test_pressure_is_linear_along_the_pipe_and_flow_is_uniform(law):
    probes = [f"main.{q}@{x}" for q in ("pressure", "gauge_pressure", "head") for x in (0, 0.25, 1)]
    probes += [
        "main.flow@0.7",
        "main.velocity@0.3",
        "upper.pressure",
        "lower.pressure",
        "lower.head",
    ]
    case = two_tanks(probes=probes)
    case["fluid"]["law"] = law
    run = fvsolve.run(case)
    assert run["main.pressure@0"] == pytest.approx(run["upper.pressure"], rel=1e-12)
    assert run["main.pressure@1"] == pytest.approx(run["lower.pressure"], rel=1e-12)
    assert run["main.head@1"] == pytest.approx(run["lower.head"], rel=1e-12)
    mean = 0.75 * run["upper.pressure"] + 0.25 * run["lower.pressure"]
    assert run["main.pressure@0.25"] == pytest.approx(mean, rel=1e-12)
    assert run["main.gauge_pressure@0.25"] == pytest.approx(mean - AMBIENT, abs=1e-6)
    assert run["main.head@0.25"] == pytest.approx(
        2.25 + (mean - AMBIENT) / (RHO * GRAVITY), rel=1e-5
    )
    assert run["main.flow@0.7"] == pytest.approx(run["main.flow"], rel=1e-15)
    assert run["main.velocity@0.3"] * area(0.05) == pytest.approx(run["main.flow"], rel=1e-12)


def test_a_profile_sets_the_pressure_between_the_ends():
    profile = {"chainage": [0.0, 40.0, 100.0], "elevation": [3.0, 6.0, 0.0]}
    case = two_tanks(
        probes=["main.pressure@0.4", "main.head@0.4", "upper.head", "lower.head"], profile=profile
    )
    del case["links"]["main"]["length"]
    run = fvsolve.run(case)
    head = run["upper.head"] - 0.4 * (run["upper.head"] - run["lower.head"])
    assert run["main.head@0.4"] == pytest.approx(head, rel=1e-12)
    assert run["main.pressure@0.4"] == pytest.approx(
        AMBIENT + RHO * GRAVITY * (head - 6.0), rel=1e-12
    )


def test_limits_know_the_pressures_at_its_ends():
    case = two_tanks()
    case["limits"] = {"strong": {"on": "main", "quantity": "pressure", "maximum": 1.2e5}}
    run = fvsolve.run(case)
    assert not run.summary["verdicts"][0]["ok"]


def test_the_resolved_case_is_the_case():
    case = fvsolve.load(two_tanks(wave_speed=800.0))
    again = fvsolve.load(two_tanks(wave_speed=800.0))
    assert case.links["main"].pipe_model == "quasi-steady" and '"quasi-steady"' in case.resolved()
    assert case.table() == again.table() and case.table()["links"]["main"]["type"] == "pipe"


def test_other_models_of_the_pipe_are_a_key_away():
    case = fvsolve.load(two_tanks(wave_speed=800.0))
    for model in ("delay-line", "finite-volume"):
        other = fvsolve.load(case, {"links.main.pipe_model": model, "numerics.method": "auto"})
        assert other.links["main"].kind == "pipe" and fvsolve.build(other).y_size > 2
        back = fvsolve.load(other, {"links.main.pipe_model": "quasi-steady"})
        assert fvsolve.build(back).y_size == 2


FAULTS = {
    "lossless": (
        pipe("upper", "lower", friction={"model": "none"}),
        "links.main.friction",
        "follows its losses",
    ),
    "factor": (
        pipe("upper", "lower", friction={"model": "steady", "factor": 0.0}),
        "links.main.friction",
        "has none",
    ),
    "history": (
        pipe("upper", "lower", friction={"model": "unsteady", "roughness": 1e-4}),
        "links.main.friction.model",
        "depends on waves",
    ),
    "frozen": (
        pipe("upper", "lower", friction={"model": "steady", "roughness": 1e-4}),
        "links.main.friction.model",
        "initial flow",
    ),
    "flow": (
        pipe("upper", "lower", initial_flow=1e-3),
        "links.main.initial_flow",
        "follows the pressures",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_names_its_key_and_its_remedy(name):
    link, place, text = FAULTS[name]
    with pytest.raises(CaseError) as caught:
        fvsolve.load(two_tanks() | {"links": {"main": link}})
    (fault,) = caught.value.faults
    assert (fault.place, text in fault.message) == (place, True)


def test_scalars_a_force_and_bodies_are_refused_by_name():
    for other, text in (
        ({"scalars": {"dye": {}}}, "no volume to carry scalars"),
        ({"output": {"probes": ["main.force"]}}, 'has no "force"'),
    ):
        with pytest.raises(CaseError, match=text):
            fvsolve.load({**two_tanks(), **other})
    rough = {"model": "quasi-steady", "roughness": 1e-4}
    fluid = {key: value for key, value in WATER.items() if key != "viscosity"}
    with pytest.raises(CaseError, match="viscosity"):
        fvsolve.build(fvsolve.load(two_tanks(rough) | {"fluid": fluid}))


def test_all_faults_of_a_pipe_are_reported_at_once():
    link = pipe(
        "upper", "lower", friction={"model": "unsteady", "roughness": 1e-4}, initial_flow=1e-3
    )
    with pytest.raises(CaseError) as caught:
        fvsolve.load(two_tanks() | {"links": {"main": link}})
    assert len(caught.value.faults) == 2


def test_a_reservoir_drains_through_pipes_in_series_without_any_state():
    nodes = {"up": reservoir(3e5), "mid": junction(), "down": reservoir(1e5)}
    links = {"one": pipe("up", "mid", 60.0), "two": pipe("mid", "down", 40.0)}
    run = fvsolve.run(
        scene(nodes, links, 1.0, {"rtol": 1e-9}, ["one.flow", "two.flow", "mid.pressure"], 0.5)
    )
    exact = area(0.05) * math.sqrt(2.0 * 2e5 / RHO / (0.02 * 100.0 / 0.05))
    assert run["one.flow"] == pytest.approx(exact, rel=1e-12) and run["two.flow"] == pytest.approx(
        exact, rel=1e-12
    )
    assert run["mid.pressure"] == pytest.approx(3e5 - 0.6 * 2e5, rel=1e-12)
