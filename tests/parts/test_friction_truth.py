"""Darcy and Hazen-Williams friction against formulas, a fine method of characteristics and a damped mode."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference import scenes
from reference.characteristics import Line, Network, ValvePipe, darcy, hazen_williams
from reference.orders import observed_order
from reference.scenes import AMBIENT, GRAVITY, RHO, junction, lake, pipe, ramp, reservoir, scene, step, valve
from scipy.optimize import brentq

import fvsolve

LENGTH, DIAMETER, SPEED, FACTOR = 600.0, 0.5, 1200.0, 0.018
HEAD, FLOW_AREA = 150.0, 0.009
TC = 2.1
SMOOTH_SHUT = scenes.smooth_ramp(0.0, TC, 1.0, 0.0)
STATIC = RHO * GRAVITY * HEAD


def wylie(opening, cells: int, friction=None, end: float = 4.3, **numerics) -> dict:
    """Return a case of the single pipe of Wylie and Streeter with a valve to the air."""
    friction = friction or {"model": "steady", "factor": FACTOR}
    nodes = {"lake": lake(HEAD), "gate": junction(), "air": reservoir(AMBIENT)}
    links = {
        "main": pipe("lake", "gate", LENGTH, DIAMETER, SPEED, cells, friction=friction),
        "valve": valve("gate", "air", FLOW_AREA, opening),
    }
    settings = {"scheme": "upwind5", "method": "rk4", "courant": 0.8, **numerics}
    return scene(nodes, links, end, settings, ["gate.pressure", "gate.head", "valve.flow", "main.flow"], 0.01)


def reference(opening, gradient=None) -> ValvePipe:
    gradient = gradient or darcy(FACTOR, DIAMETER, RHO)
    return ValvePipe(
        LENGTH, DIAMETER, SPEED, RHO, gradient, AMBIENT + STATIC, AMBIENT, lambda t: FLOW_AREA * opening(t)
    )


def smooth_opening(t: float) -> float:
    return 1 - scenes.smooth_step(t, 0.0, TC)


def steady_velocity(factor: float = FACTOR) -> float:
    area = scenes.area(DIAMETER)
    return math.sqrt(2 * STATIC / RHO / (factor * LENGTH / DIAMETER + (area / FLOW_AREA) ** 2))


@pytest.mark.parametrize("model", ["steady", "quasi-steady"])
def test_steady_start_balances_friction_and_valve(model):
    result = fvsolve.run(wylie(1.0, 20, {"model": model, "factor": FACTOR}, end=0.1))
    v = steady_velocity()
    assert result["main.flow"] == pytest.approx(v * scenes.area(DIAMETER), rel=1e-11)
    lost = FACTOR * LENGTH / DIAMETER * RHO * v**2 / 2
    assert AMBIENT + STATIC - result["gate.pressure"] == pytest.approx(lost, rel=1e-10)


def test_steady_pressure_falls_in_a_straight_line():
    case = wylie(1.0, 20, end=0.1)
    places = (0.0, 0.1, 0.37, 0.5, 0.925, 1.0)
    case["output"]["probes"] = [f"main.pressure@{x}" for x in places]
    result = fvsolve.run(case)
    lost = FACTOR * LENGTH / DIAMETER * RHO * steady_velocity() ** 2 / 2
    for x in places:
        assert result[f"main.pressure@{x}"] == pytest.approx(AMBIENT + STATIC - x * lost, abs=1e-9 * STATIC)


@pytest.mark.parametrize("reynolds", [500.0, 1900.0, 1e4, 1e5, 3e6])
@pytest.mark.parametrize("model", ["steady", "quasi-steady"])
def test_loss_from_roughness_is_that_of_the_fluids_package(reynolds, model):
    from fluids.friction import friction_factor

    roughness, diameter, length = 2.6e-4, 0.3, 300.0
    v = reynolds * 1e-3 / (RHO * diameter)
    friction = {"model": model, "roughness": roughness}
    nodes = {"lake": reservoir(1e6), "gate": junction(v * scenes.area(diameter))}
    links = {"main": pipe("lake", "gate", length, diameter, 1200.0, 10, friction=friction)}
    result = fvsolve.run(scene(nodes, links, 0.5, scenes.SMOOTH, ["gate.pressure"]))
    factor = friction_factor(Re=reynolds, eD=roughness / diameter)
    lost = factor * length / diameter * RHO * v**2 / 2
    assert 1e6 - result["gate.pressure"][0] == pytest.approx(lost, rel=1e-6, abs=1e-8)


def test_hazen_williams_loss_is_the_textbook_one():
    q, diameter, length, coefficient = 0.1, 0.3, 500.0, 110.0
    nodes = {"lake": lake(100.0), "gate": junction(q)}
    friction = {"model": "hazen-williams", "coefficient": coefficient}
    links = {"main": pipe("lake", "gate", length, diameter, 1200.0, 10, friction=friction)}
    result = fvsolve.run(scene(nodes, links, 0.5, scenes.SMOOTH, ["gate.head"]))
    lost = length * float(hazen_williams(coefficient, diameter, RHO)(np.float64(RHO * q))) / (RHO * GRAVITY)
    assert 100.0 - result["gate.head"][0] == pytest.approx(lost, rel=5e-3)


def test_a_minor_loss_is_counted_on_the_velocity_head():
    nodes = {"lake": reservoir(1e6), "gate": junction(0.2)}
    links = {"main": pipe("lake", "gate", 300.0, 0.3, 1200.0, 10, minor_loss=2.5)}
    result = fvsolve.run(scene(nodes, links, 0.5, scenes.SMOOTH, ["gate.pressure"]))
    v = 0.2 / scenes.area(0.3)
    assert 1e6 - result["gate.pressure"] == pytest.approx(2.5 * RHO * v**2 / 2, rel=1e-10)


def head_error(cells: int, shut: dict, opening, model: str = "steady") -> float:
    """Greatest difference of the valve pressure from the characteristics, over the Joukowsky jump."""
    result = fvsolve.run(wylie(shut, cells, {"model": model, "factor": FACTOR}))
    t, exact = reference(opening).richardson(400, 4.4)
    at = np.interp(np.asarray(result.t), t, exact)
    return float(np.max(np.abs(result["gate.pressure"] - at)) / (RHO * SPEED * steady_velocity()))


@pytest.mark.parametrize("model", ["steady", "quasi-steady"])
def test_a_smooth_closure_follows_the_fine_characteristics(model):
    assert head_error(100, SMOOTH_SHUT, smooth_opening, model) < 1e-4


def test_the_closure_of_wylie_and_streeter_follows_the_fine_characteristics():
    def opening(t: float) -> float:
        return (1 - min(max(t / TC, 0.0), 1.0)) ** 1.5

    errors = [head_error(n, ramp(0.0, TC, 1.0, 0.0, 1.5), opening) for n in (25, 50, 100)]
    assert errors[-1] < 2e-3
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2]


def test_the_closure_with_hazen_williams_follows_the_fine_characteristics():
    friction = {"model": "hazen-williams", "coefficient": 100.0}
    result = fvsolve.run(wylie(SMOOTH_SHUT, 100, friction))
    t, exact = reference(smooth_opening, hazen_williams(100.0, DIAMETER, RHO)).richardson(400, 4.4)
    at = np.interp(np.asarray(result.t), t, exact)
    assert np.max(np.abs(result["gate.pressure"] - at)) < 2e-3 * np.ptp(exact)


def peaks(t: np.ndarray, p: np.ndarray, halves: int) -> np.ndarray:
    """Pressures in the middle of each half period after the closure at 0.5 s."""
    return np.array([np.interp(0.5 + (k + 0.5) * 2 * LENGTH / SPEED, t, p) for k in range(halves)])


@pytest.mark.parametrize("scheme", ["muscl", "weno5", "upwind5"])
def test_peaks_decay_as_the_fine_characteristics_say(scheme):
    factor = 0.3  # large, for a clear decay
    friction = {"model": "quasi-steady", "factor": factor}
    case = wylie(step(0.5, 1.0, 0.0), 600, friction, end=12.0, scheme=scheme, method="ssp-rk3")
    result = fvsolve.run(case)
    still = reference(lambda t: 1.0 if t < 0.5 - 1e-9 else 0.0, darcy(factor, DIAMETER, RHO))
    t, exact = still.richardson(400, 12.0)
    found, wanted = peaks(result.t, result["gate.pressure"], 11), peaks(t, exact, 11)
    rest = AMBIENT + STATIC
    assert abs(wanted[-1] - rest) < 0.8 * abs(wanted[0] - rest)
    assert found - rest == pytest.approx(wanted - rest, abs=2e-3 * abs(wanted[0] - rest))


def damped_mode(cells: int, scheme: str, method: str) -> float:
    """L1 error of the first mode of a laminar pipe between a reservoir and a dead end, after 1.3 periods.

    Its frequency w is given by w^2 = (pi a / 2 L)^2 - k^2 / 4, its decay by exp(-k t / 2), with k = 32 nu / D^2.
    """
    length, diameter, nu = 100.0, 0.02, 1e-4
    k = 32 * nu / diameter**2
    omega0 = math.pi * SPEED / (2 * length)
    omega = math.sqrt(omega0**2 - k**2 / 4)
    fluid = {**scenes.WATER, "viscosity": nu * RHO}
    nodes = {"lake": reservoir(1e6), "gate": junction()}
    friction = {"model": "quasi-steady", "roughness": 1e-6}
    links = {"main": pipe("lake", "gate", length, diameter, SPEED, cells, friction=friction)}
    end = 1.3 * 2 * math.pi / omega
    settings = {"scheme": scheme, "method": method, "courant": 0.5}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, settings, fluid=fluid)))
    state = fvsolve.initial_state(model)
    edges, kappa = np.linspace(0, length, cells + 1), math.pi / (2 * length)
    sine = -np.diff(np.cos(kappa * edges)) / (kappa * np.diff(edges))  # cell averages of the mode
    cosine = np.diff(np.sin(kappa * edges)) / (kappa * np.diff(edges))

    def waves(t: float) -> np.ndarray:
        """Exact averages of both waves, from pressure a m' ~ sin(kappa x) and mass flow ~ cos(kappa x)."""
        decay, scale = math.exp(-k * t / 2), 1e-4
        am = scale * decay * (math.cos(omega * t) + k / (2 * omega) * math.sin(omega * t))
        flow = -scale * decay * omega0 / omega * math.sin(omega * t)
        return np.concatenate([(am * sine + flow * cosine) / 2, (am * sine - flow * cosine) / 2])

    state.y[: 2 * cells] = waves(0.0)
    state = fvsolve.advance(model, state, end)
    return float(np.mean(np.abs(state.y[: 2 * cells] - waves(end))) / np.max(np.abs(waves(0.0))))


@pytest.mark.parametrize("scheme, order", [("upwind5", 5), ("upwind3", 3), ("fromm", 2)])
def test_a_laminar_mode_decays_exactly_at_the_order_of_the_scheme(scheme, order):
    errors = [damped_mode(n, scheme, "dormand-prince") for n in (20, 40)]
    assert observed_order(errors, [2.0, 1.0]) == pytest.approx(order, abs=0.3)


def test_flow_from_quasi_steady_friction_settles_on_the_colebrook_flow():
    """Long after a partial opening the flow balances head and losses by the friction factor of `fluids`."""
    from fluids.friction import friction_factor

    friction = {"model": "quasi-steady", "roughness": 1e-3}
    nodes = {"lake": lake(20.0), "gate": junction(), "air": reservoir(AMBIENT)}
    links = {
        "main": pipe("lake", "gate", 200.0, 0.1, 1000.0, 20, friction=friction),
        "valve": valve("gate", "air", 0.004, ramp(0.5, 0.5, 0.2, 1.0)),
    }
    settings = {"scheme": "fromm", "method": "ssp-rk2", "courant": 0.9}
    result = fvsolve.run(scene(nodes, links, 60.0, settings, ["main.flow"], 1.0))
    area = scenes.area(0.1)

    def gap(v: float) -> float:
        factor = friction_factor(Re=RHO * v * 0.1 / 1e-3, eD=0.01)
        return 20 * GRAVITY - v**2 / 2 * (factor * 2000.0 + (area / 0.004) ** 2)

    assert result["main.flow"][-1] == pytest.approx(area * brentq(gap, 0.01, 10.0, xtol=1e-14), rel=1e-6)


NINE = [  # Streeter and Wylie 1967: from, to, length [m], diameter [mm], Hazen-Williams coefficient
    ("R1", "N3", 610, 900, 92),
    ("N3", "N4", 914, 750, 107),
    ("N3", "N2", 610, 600, 98),
    ("N4", "N6", 457, 450, 105),
    ("N4", "N2", 549, 450, 100),
    ("N5", "N2", 671, 750, 93),
    ("N5", "N7", 610, 900, 105),
    ("N6", "N5", 457, 600, 105),
    ("N2", "N6", 488, 450, 140),
]


def test_the_nine_pipes_of_streeter_and_wylie_follow_the_characteristics():
    """All lengths are whole metres and all wave speeds 1200 m/s, so a grid of 1 m is exact for the characteristics."""
    supply, shut = AMBIENT + RHO * GRAVITY * 191.0, 0.5
    per_metre = 10.67 * RHO * GRAVITY  # factor of q^1.852 / (C^1.852 D^4.8704)
    lines = [
        Line(a, b, float(x), d / 1000, per_metre / (c**1.852 * (d / 1000) ** 4.8704 * RHO**1.852))
        for a, b, x, d, c in NINE
    ]
    net = Network(lines, 1.852, 1200.0, RHO, "R1", supply, "N7", AMBIENT)
    pressures, _ = net.steady(100.0)

    nodes = {n: junction() for n in pressures} | {"R1": lake(191.0), "air": reservoir(AMBIENT)}
    links = {
        f"{a}-{b}": pipe(
            a,
            b,
            float(x),
            d / 1000,
            1200.0,
            round(x / 6),
            friction={"model": "hazen-williams", "coefficient": c},
        )
        for a, b, x, d, c in NINE
    }
    flow_area = 0.1 / math.sqrt(2 * (pressures["N7"] - AMBIENT) / RHO)
    links["valve"] = valve("N7", "air", flow_area, ramp(shut, 1.0, 1.0, 0.0, 2.0))
    result = fvsolve.run(scene(nodes, links, 8.0, scenes.SMOOTH, ["N7.pressure", "valve.flow"], 0.01))
    assert result["valve.flow"][0] == pytest.approx(0.1, rel=1e-3)

    t, exact = net.gate_pressure(100.0, lambda s: max(0.0, 1 - max(s - shut, 0.0)) ** 2, 1.0, 8.0)
    at = np.interp(np.asarray(result.t), t, exact)
    assert np.max(np.abs(result["N7.pressure"] - at)) < 2e-3 * np.ptp(exact)


def test_a_friction_factor_is_that_of_the_wall_alone():
    """The reported factor excludes the minor loss and is None without friction."""
    nodes = {"a": lake(10.0), "b": lake(9.0)}
    found = []
    for friction in ({"model": "none"}, {"model": "steady", "factor": 0.02}):
        for loss in (1.5, 0.0) if friction["model"] != "none" else (1.5,):
            links = {"p": pipe("a", "b", 50.0, 0.1, 1000.0, 5, friction=friction, minor_loss=loss)}
            found.append(
                fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {}))).checks["pipes"]["p"]["friction_factor"]
            )
    assert found[0] is None and found[1:] == pytest.approx([0.02, 0.02], rel=1e-9)
