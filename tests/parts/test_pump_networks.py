"""Pumps in networks that change: flows and heads lie on their curves, and check valves do not chatter."""

import numpy as np
import pytest
from pytest import approx
from reference.scenes import junction, lake, pipe, pump, scene, valve

import fvsolve

STEADY = {"model": "steady", "factor": 0.02}
CURVES = [
    {"curve": {"flow": [0.1], "head": [50.0]}},
    {"curve": {"flow": [0.0, 0.1, 0.15], "head": [60.0, 50.0, 35.0]}},
    {"curve": {"flow": [0.0, 0.05, 0.06, 0.15], "head": [60.0, 59.9, 30.0, 29.9]}},  # flat, steep, flat
    {"curve": {"flow": [0.0, 0.1, 0.11], "head": [50.0, 49.999, 20.0]}},  # a power of 50
    {"curve": {"flow": [0.0, 0.1, 0.4], "head": [60.0, 30.0, 15.0]}},  # a power below 1
    {"curve": {"coefficients": [60.0, 0.0, 0.0, -8000.0]}},
    {"power": 40e3},
    {"suter": {"rated_flow": 0.1, "rated_head": 50.0, "table": "radial-35"}},
]


def random_scene(seed: int) -> dict:
    """Return a case of random pumps with random speeds between lakes, with a pipe and a valve that closes and opens."""
    rng = np.random.default_rng(seed)
    many = int(rng.integers(1, 4))
    nodes = {"sump": lake(0.0), "top": lake(float(rng.uniform(-10.0, 70.0))), "end": junction(), "out": junction()}
    places = ["sump", *(f"n{k}" for k in range(many - 1)), "out"] if rng.random() < 0.5 else None
    nodes |= {name: junction() for name in (places or [])[1:-1]}
    links = {"main": pipe("out", "end", 300.0, 0.3, 1000.0, 8, friction=STEADY)}
    times = [0.0, 0.2, 0.8, 1.0, 1.6]
    links["tap"] = valve("end", "top", 0.02, {"time": times, "value": [1.0, 1.0, 0.0, 0.0, 1.0]})
    for k in range(many):
        start, stop = (places[k], places[k + 1]) if places else ("sump", "out")
        values = rng.choice([0.0, 0.3, 1.0, 1.2], 5).tolist()
        law = CURVES[int(rng.integers(len(CURVES)))]
        links[f"p{k}"] = pump(
            start, stop, **law, speed={"time": times, "value": values}, check_valve=bool(rng.random() < 0.5)
        )
    probes = [f"p{k}.{what}" for k in range(many) for what in ("flow", "head")] + [f"{name}.head" for name in nodes]
    return scene(nodes, links, 2.5, {}, probes, 0.02)


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("seed", range(12))
def test_flows_and_heads_lie_on_the_curves(seed, law):
    case = random_scene(seed)
    case["fluid"] = {**case["fluid"], "law": law}
    result = fvsolve.run(case)
    assert result.ok, result.reason
    for name, link in case["links"].items():
        if link["type"] != "pump":
            continue
        flow, head = result[f"{name}.flow"], result[f"{name}.head"]
        across = result[f"{link['to']}.head"] - result[f"{link['from']}.head"]
        if link["check_valve"]:
            assert flow.min() > -1e-9
            assert np.all(across[flow == 0.0] >= head[flow == 0.0] - 1e-3)
        flows = flow != 0.0 if link["check_valve"] else np.ones(flow.size, dtype=bool)
        assert across[flows] == approx(head[flows], abs=2e-6)
    assert len(result.summary["events"]) <= 24


def test_two_pumps_in_parallel_of_which_one_is_too_weak_stand_as_a_steady_state():
    """The check valve of the weak pump is shut at the start and opens after the strong pump stops."""
    strong, weak = {"flow": [0.1], "head": [50.0]}, {"flow": [0.05], "head": [20.0]}
    speed = {"time": [1.0, 2.0], "value": [1.0, 0.0]}
    links = {
        "strong": pump("sump", "out", curve=strong, check_valve=True, speed=speed),
        "weak": pump("sump", "out", curve=weak, check_valve=True),
        "main": pipe("out", "top", 1000.0, 0.2, 1000.0, 10, friction=STEADY),
    }
    nodes = {"sump": lake(0.0), "out": junction(), "top": lake(20.0)}
    probes = ["strong.flow", "weak.flow"]
    result = fvsolve.run(scene(nodes, links, 60.0, {}, probes, 0.1))
    assert not result["weak.flow"][result.t < 1.0].any() and np.ptp(result["strong.flow"][result.t < 1.0]) == 0.0
    assert result["strong.flow"][-1] == 0.0 and result["weak.flow"][-1] > 0.02
    assert len(result.summary["events"]) <= 6
