"""Chambers and orifices against closed forms and SciPy, also beyond the finite time of filling."""

import math

import numpy as np
import pytest
from reference import vessels
from reference.scenes import RHO, WATER, chamber, junction, pipe, ramp, reservoir, scene, valve
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve

BETA = WATER["bulk_modulus"]
CLOSE = {"method": "dormand-prince", "rtol": 1e-12}
P0, VOLUME, HOLE = 1e6, 0.5, 1e-6


@pytest.mark.parametrize("supply", [5e6, 2e5], ids=["filling", "emptying"])
@pytest.mark.parametrize("numerics, near", [(CLOSE, 1e-6), ({}, 1e-5)], ids=["tight", "default"])
def test_a_chamber_fills_in_finite_time_and_rests(supply, numerics, near):
    """The pressure error is at most `near` times the initial drop; the default tolerance is 1e-6 per step."""
    nodes = {"pump": reservoir(supply), "pot": chamber(VOLUME, P0)}
    slope = BETA / VOLUME * HOLE * math.sqrt(2 / RHO)
    filled = 2 * math.sqrt(abs(supply - P0)) / slope
    case = scene(
        nodes,
        {"hole": valve("pump", "pot", HOLE)},
        filled + 60.0,
        numerics,
        ["pot.pressure", "hole.flow"],
        0.1,
    )
    result = fvsolve.run(case)
    drop = vessels.filling(VOLUME, BETA, HOLE, RHO, abs(supply - P0), result.t)
    exact = supply - math.copysign(1, supply - P0) * drop
    assert result.ok
    assert result["pot.pressure"] == pytest.approx(exact, abs=near * abs(supply - P0))
    rest = result["pot.pressure"][result.t > filled + 1.0]
    assert np.ptp(rest) < near * abs(supply - P0)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_two_chambers_level_in_finite_time_and_rest():
    volumes, pressures = (0.3, 0.7), (4e6, 1e6)
    nodes = {"a": chamber(volumes[0], pressures[0]), "b": chamber(volumes[1], pressures[1])}
    nodes["tap"] = reservoir(1e6)  # a given pressure is required; its valve stays shut
    links = {"gap": valve("a", "b", HOLE), "shut": valve("b", "tap", HOLE, 0.0)}
    result = fvsolve.run(scene(nodes, links, 70.0, CLOSE, ["a.pressure", "b.pressure"], 0.1))
    drop = vessels.chambers_levelling(volumes, BETA, HOLE, RHO, 3e6, result.t)
    mean = float(np.dot(volumes, pressures))
    assert result["a.pressure"] == pytest.approx(mean + 0.7 * drop, abs=3.0)
    assert result["b.pressure"] == pytest.approx(mean - 0.3 * drop, abs=3.0)
    assert result.ok


def orifice(k: float, drop):
    return k * math.sqrt(2 / RHO) * np.sign(drop) * np.sqrt(np.abs(drop))


def test_chambers_and_orifices_agree_with_scipy_to_ten_digits():
    """Supply, orifice, chamber, closing valve, chamber and two outlets, with all drops far from zero."""
    nodes = {
        "pump": reservoir(8e6),
        "a": chamber(0.02, 5e6),
        "b": chamber(0.05, 3e6),
        "out": reservoir(5e5),
    }
    links = {
        "in": valve("pump", "a", 2e-7),
        "mid": valve("a", "b", 4e-7, ramp(0.0, 4.0, 1.0, 0.2, 2.0)),
        "out1": valve("b", "out", 1e-7),
        "out2": {
            "type": "orifice",
            "from": "out",
            "to": "b",
            "discharge_coefficient": 0.5,
            "area": 1e-7,
        },
    }
    end, every = 1.0, 0.05
    probes = ["a.pressure", "b.pressure", "mid.flow", "out2.flow"]
    result = fvsolve.run(scene(nodes, links, end, CLOSE, probes, every))

    def rate(t, p):
        opening = 0.2 + 0.8 * (1 - t / 4.0) ** 2
        through = orifice(4e-7 * opening, p[0] - p[1])
        leaves = orifice(1.5e-7, p[1] - 5e5)
        return [
            BETA / 0.02 * (orifice(2e-7, 8e6 - p[0]) - through),
            BETA / 0.05 * (through - leaves),
        ]

    t = np.asarray(result.t)
    run = solve_ivp(rate, (0, end), [5e6, 3e6], "DOP853", rtol=1e-13, atol=1e-6, t_eval=t)
    assert result["a.pressure"] == pytest.approx(run.y[0], rel=1e-10)
    assert result["b.pressure"] == pytest.approx(run.y[1], rel=1e-10)
    assert result["out2.flow"] == pytest.approx(-orifice(5e-8, run.y[1] - 5e5), rel=1e-9)


def test_a_chamber_turned_round_by_its_supply_agrees_with_scipy():
    """The supply pressure changes linearly and reverses the drop, through the singularity of the square root at 0."""
    times, pressures = [0.0, 2.0, 6.0, 10.0], [2e6, 4e6, 1e6, 1e6]
    pump = {"time": times, "value": pressures, "kind": "linear"}
    nodes = {"pump": reservoir(pump), "pot": chamber(VOLUME, 2.1e6)}
    numerics = {"method": "dormand-prince", "rtol": 1e-10}
    result = fvsolve.run(
        scene(nodes, {"hole": valve("pump", "pot", HOLE)}, 10.0, numerics, ["pot.pressure"], 0.5)
    )

    def rate(t, p):
        return BETA / VOLUME * orifice(HOLE, np.interp(t, times, pressures) - p)

    y, found = np.array([2.1e6]), [2.1e6]
    for k in range(20):
        y = solve_ivp(
            rate, (k / 2, (k + 1) / 2), y, "Radau", rtol=1e-11, atol=1e-4, max_step=0.01
        ).y[:, -1]
        found.append(y[0])
    at = np.interp(np.arange(0, 10.01, 0.5), result.t, result["pot.pressure"])
    assert at == pytest.approx(np.array(found), abs=1e-6 * 3e6)


def test_a_chamber_without_a_stated_pressure_starts_in_equilibrium():
    nodes = {"pump": reservoir(3e6), "pot": chamber(VOLUME), "out": reservoir(1e6)}
    links = {"in": valve("pump", "pot", 2 * HOLE), "out": valve("pot", "out", HOLE)}
    result = fvsolve.run(scene(nodes, links, 5.0, CLOSE, ["pot.pressure"], 0.5))
    assert result["pot.pressure"] == pytest.approx(1e6 + 2e6 * 4 / 5, rel=1e-9)


def test_a_chamber_on_a_pipe_swings_as_mass_on_a_spring():
    """Frequency of a pipe with a spring at its end: w tan(w L / a) = A a / V, about w^2 = A beta / (rho L V)."""
    length, diameter, volume, speed = 2.0, 0.05, 0.5, 1483.2396974191
    nodes = {"lake": reservoir(2e6), "pot": chamber(volume, 2.1e6)}
    links = {"neck": pipe("lake", "pot", length, diameter, speed, 10, initial_flow=0.0)}
    area = math.pi / 4 * diameter**2

    def mode(w: float) -> float:
        return math.tan(w * length / speed) * w - area * speed / volume

    w = brentq(mode, 1e-3, 0.49 * math.pi * speed / length, xtol=1e-13)
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.8}
    result = fvsolve.run(
        scene(nodes, links, 2.4 * math.pi * 2 / w, numerics, ["pot.pressure"], 1e-3)
    )
    t, p = np.asarray(result.t), result["pot.pressure"] - 2e6
    rising = np.flatnonzero((p[:-1] < 0) & (p[1:] >= 0))
    crossing = t[rising] - p[rising] * (t[rising + 1] - t[rising]) / (p[rising + 1] - p[rising])
    assert len(crossing) == 2
    assert crossing[1] - crossing[0] == pytest.approx(2 * math.pi / w, rel=2e-3)


@pytest.mark.parametrize("opening", [0.0, 1.0], ids=["shut", "open"])
def test_a_valve_between_pipe_and_chamber_and_a_junction_between_valves_run(opening):
    nodes = {
        "lake": reservoir(2e6),
        "gate": junction(),
        "pot": chamber(0.01, 1e6),
        "mid": junction(),
        "out": reservoir(5e5),
    }
    links = {
        "main": pipe("lake", "gate", 100.0, 0.1, 1000.0, 20),
        "v1": valve("gate", "pot", 1e-4, opening),
        "v2": valve("pot", "mid", 1e-4, opening),
        "v3": valve("mid", "out", 2e-4, opening),
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    result = fvsolve.run(
        scene(nodes, links, 3.0, numerics, ["pot.pressure", "mid.pressure", "v2.flow"], 0.1)
    )
    assert result.ok
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
    if opening == 0.0:
        assert np.all(result["v2.flow"] == 0.0)
        assert np.all(result["pot.pressure"] == result["pot.pressure"][0])
    else:
        mid = (1e-4**2 * result["pot.pressure"] + 2e-4**2 * 5e5) / (1e-4**2 + 2e-4**2)
        assert result["mid.pressure"] == pytest.approx(mid, rel=1e-7)


PSI, GALLON = 6894.757293168361, 3.785411784e-3
SIZES = {
    "discharge": ({"area": 2e-4, "discharge_coefficient": 0.7}, 0.7 * 2e-4),
    "by diameter": ({"diameter": 0.02}, 0.61 * math.pi / 4 * 0.02**2),
    "loss": ({"loss_coefficient": 4.0, "area": 2e-4}, 1e-4),
    "loss by diameter": (
        {"loss_coefficient": 2.0, "diameter": 0.05},
        math.pi / 4 * 0.05**2 / math.sqrt(2.0),
    ),
    "Kv": ({"Kv": 10.0}, 10 / 3600 / math.sqrt(2 * 1e5 / RHO)),
    "Cv": ({"Cv": 10.0}, 10 * GALLON / 60 / math.sqrt(2 * PSI / 999.016)),
}


@pytest.mark.parametrize("kind", ["valve", "orifice"])
@pytest.mark.parametrize("name", SIZES)
def test_a_valve_passes_the_flow_of_its_size_in_both_directions(name, kind):
    size, flow_area = SIZES[name]
    nodes = {"a": reservoir(3e5), "b": reservoir(2e5), "c": reservoir(4.5e5)}
    links = {
        "down": {"type": kind, "from": "a", "to": "b", **size},
        "up": {"type": kind, "from": "b", "to": "c", **size},
    }
    result = fvsolve.run(
        scene(nodes, links, 0.1, {"method": "rk4", "step": 0.1}, ["down.flow", "up.flow"], 0.1)
    )
    assert result["down.flow"] == pytest.approx(flow_area * math.sqrt(2 * 1e5 / RHO), rel=1e-4)
    assert result["up.flow"] == pytest.approx(-flow_area * math.sqrt(2 * 2.5e5 / RHO), rel=1e-4)


CHARACTERISTICS = {
    "linear": ("linear", lambda x: x),
    "equal-percentage": ("equal-percentage", lambda x: 50.0 ** (x - 1)),
    "table": (
        {"opening": [0.0, 0.5, 1.0], "flow_area": [0.0, 0.1, 1.0]},
        lambda x: np.interp(x, [0, 0.5, 1], [0, 0.1, 1]),
    ),
}


@pytest.mark.parametrize("name", CHARACTERISTICS)
@pytest.mark.parametrize("opening", [0.2, 0.5, 0.8, 1.0])
def test_a_characteristic_turns_the_stem_into_flow_area(name, opening):
    given, share = CHARACTERISTICS[name]
    nodes = {"a": reservoir(3e5), "b": reservoir(2e5)}
    links = {"v": valve("a", "b", 1e-4, opening, characteristic=given)}
    result = fvsolve.run(scene(nodes, links, 0.1, {"method": "rk4", "step": 0.1}, ["v.flow"], 0.1))
    assert result["v.flow"] == pytest.approx(
        1e-4 * share(opening) * math.sqrt(2 * 1e5 / RHO), rel=1e-9
    )
