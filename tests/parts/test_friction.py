"""Darcy and Hazen-Williams friction against formulas, a fine method of characteristics and a damped mode.

Unsteady friction against the exact laminar line and printed weighting functions; its energy, and a first plateau.
"""

import functools
import math

import numpy as np
import pytest
from pytest import approx
from reference import scenes, stopped_lines
from reference.characteristics import Line, Network, ValvePipe, darcy, hazen_williams
from reference.folders import CASES
from reference.jacobians import random_state, stray
from reference.orders import observed_order
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    WATER,
    area,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    valve,
)
from scipy.optimize import brentq

import fvsolve
from fvsolve import exact
from fvsolve.core.assembly import pipe_terms as unsteady_terms
from fvsolve.errors import CaseError
from fvsolve.studies.accuracy.model_hierarchy import rigid_column
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.ports.response import response
from fvsolve.studies.reference import initial_values

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
    return scene(
        nodes, links, end, settings, ["gate.pressure", "gate.head", "valve.flow", "main.flow"], 0.01
    )


def reference(opening, gradient=None) -> ValvePipe:
    gradient = gradient or darcy(FACTOR, DIAMETER, RHO)
    return ValvePipe(
        LENGTH,
        DIAMETER,
        SPEED,
        RHO,
        gradient,
        AMBIENT + STATIC,
        AMBIENT,
        lambda t: FLOW_AREA * opening(t),
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
        assert result[f"main.pressure@{x}"] == pytest.approx(
            AMBIENT + STATIC - x * lost, abs=1e-9 * STATIC
        )


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


def test_hazen_williams_loss_is_the_textbook_value():
    q, diameter, length, coefficient = 0.1, 0.3, 500.0, 110.0
    nodes = {"lake": lake(100.0), "gate": junction(q)}
    friction = {"model": "hazen-williams", "coefficient": coefficient}
    links = {"main": pipe("lake", "gate", length, diameter, 1200.0, 10, friction=friction)}
    result = fvsolve.run(scene(nodes, links, 0.5, scenes.SMOOTH, ["gate.head"]))
    lost = (
        length
        * float(hazen_williams(coefficient, diameter, RHO)(np.float64(RHO * q)))
        / (RHO * GRAVITY)
    )
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
def test_peaks_decay_as_by_fine_characteristics(scheme):
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

    assert result["main.flow"][-1] == pytest.approx(
        area * brentq(gap, 0.01, 10.0, xtol=1e-14), rel=1e-6
    )


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
    result = fvsolve.run(
        scene(nodes, links, 4.0, scenes.SMOOTH, ["N7.pressure", "valve.flow"], 0.01)
    )
    assert result["valve.flow"][0] == pytest.approx(0.1, rel=1e-3)

    t, exact = net.gate_pressure(100.0, lambda s: max(0.0, 1 - max(s - shut, 0.0)) ** 2, 1.0, 4.0)
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
                fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {}))).checks["pipes"]["p"][
                    "friction_factor"
                ]
            )
    assert found[0] is None and found[1:] == pytest.approx([0.02, 0.02], rel=1e-9)


FOOT = 0.3048
NUMBERS = (0.005, 0.05)  # nu L / (a R^2)
START, DURATION = 0.1, 0.4  # smooth closure, in travel times of the line [s]


def line(
    number: float,
    cells: int,
    kind: str = "smooth",
    end: float = 4.0,
    reynolds: float = 500.0,
    **more,
) -> dict:
    """Return a case of a line with a travel time of 1 s between a reservoir and a demand that stops.

    number : nu L / (a R^2); reynolds : Reynolds number at the start
    """
    d, rho = 0.02, WATER["density"]
    mu = number / 1.0 * (d / 2) ** 2 * rho
    flow = area(d) * reynolds * mu / (rho * d)
    s = np.linspace(0.0, 1.0, 400)
    stop = 1.0 - s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)
    demand = {
        "time": (START + DURATION * s).tolist(),
        "value": (flow * stop).tolist(),
        "kind": "smooth",
    }
    if kind == "step":
        demand = {"time": [0.0, START], "value": [flow, 0.0], "kind": "step"}
    pipe = {
        "type": "pipe",
        "from": "lake",
        "to": "gate",
        "length": 1000.0,
        "diameter": d,
        "wave_speed": 1000.0,
        "cells": cells,
        "friction": {"model": "unsteady", "roughness": 0.0},
    }
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.8}
    nodes, probes = (
        {"lake": reservoir(1e6), "gate": junction(demand)},
        ["gate.pressure", "main.flow@0.3"],
    )
    case = scene(nodes, {"main": pipe}, end, numerics, probes, 0.02)
    case["fluid"] = {**WATER, "viscosity": mu}
    return {**case, **more}


@functools.cache
def joukowsky(number: float, reynolds: float = 500.0) -> float:
    """Joukowsky jump rho a v of `line` [Pa]."""
    return WATER["density"] * 1000.0 * reynolds * number * 0.01**2 / 0.02


def solved(case: dict):
    """Return (run, function (k, t) of the exact value of probe k, exact solution) of a case."""
    model = fvsolve.build(fvsolve.load({**case, "exact": {"name": "laminar-line"}}))
    truth = exact.solution(model.case, initial_values(model))
    return fvsolve.run(model), lambda k, t: truth.probe(model.probes[k], t), truth


def errors(number: float, cells: int, kind: str):
    """Return (times, error of the pressure at the gate over the Joukowsky jump)."""
    run, probe, _ = solved(line(number, cells, kind))
    return run.t, (run["gate.pressure"] - probe(0, run.t)) / joukowsky(number)


# weighting functions ------------------------------------------------------------------------------------------------


def test_the_transform_of_zielkes_function_is_his_sum_over_the_zeros_of_a_bessel_function():
    s = np.array([0.3, 20.0, 5.0 + 40.0j, 2000.0j])
    assert unsteady_terms.zielke(s) == approx(
        (stopped_lines.inertia(s) - 1.0 - 8.0 / s) / 4.0, rel=1e-8
    )


def printed(weighting: str, tau: np.ndarray, reynolds: float, roughness: float) -> np.ndarray:
    """W(tau) as the papers print it; Zielke's is a series below tau = 0.02 and five exponentials above."""
    if weighting == "zielke":
        powers = (0.282095, -1.25, 1.057855, 0.9375, 0.396696, -0.351563)
        early = sum(c * tau ** (0.5 * (k - 1)) for k, c in enumerate(powers))
        decays = (26.3744, 70.8493, 135.0198, 218.9216, 322.5544)
        return np.where(tau < 0.02, early, sum(np.exp(-n * tau) for n in decays))
    if roughness > 0.0:
        a, b = 0.0103 * reynolds**0.5 * roughness**0.39, 0.352 * reynolds * roughness**0.41
    else:
        a, b = 0.5 / math.sqrt(math.pi), reynolds ** math.log10(15.29 / reynolds**0.0567) / 12.86
    return a * np.exp(-b * tau) / np.sqrt(tau)


@pytest.mark.parametrize(
    ("weighting", "reynolds", "roughness", "cell", "span"),
    [("zielke", 100.0, 0.0, 2e-5, 0.2), ("zielke", 1e3, 0.0, 1e-7, 1e-3), ("vardy-brown", 1e4, 0.0, 1e-6, 1e-2),
     ("vardy-brown", 3e6, 0.0, 3e-8, 1e-3), ("vardy-brown", 1e7, 1e-2, 1e-9, 1e-5)],
)  # fmt: skip
def test_a_sum_of_exponentials_is_the_printed_function_over_all_times_that_are_resolved(
    weighting, reynolds, roughness, cell, span
):
    m, n, _ = unsteady_terms.terms(weighting, reynolds, roughness, cell, span, 1e-4)
    tau = np.geomspace(32.0 * cell, span, 200)
    exact_w = printed(weighting, tau, reynolds, roughness)
    kept = exact_w > 1e-3 * exact_w[0]
    assert (np.exp(-np.outer(tau, n)) @ m)[kept] == approx(exact_w[kept], rel=1e-3)
    assert np.all(m > 0.0) and m.size <= 20


@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5, 1e-6])
def test_a_wave_of_any_resolved_frequency_has_the_friction_within_the_accuracy(accuracy):
    for weighting, transform in (("zielke", unsteady_terms.zielke), ("vardy-brown", None)):
        m, n, highest = unsteady_terms.terms(weighting, 1e5, 0.0, 1e-6, 1e-2, accuracy)
        s = 1j * np.geomspace(100.0, highest, 500)  # from 1 / span of the run
        if transform is None:
            a, b = unsteady_terms.vardy_brown(1e5, 0.0)
            value = a * np.sqrt(np.pi / (s + b))
        else:
            value = transform(s)
        assert (1.0 / (s[:, None] + n)) @ m / value == approx(np.ones(s.size), abs=accuracy)


def test_the_weighting_function_follows_the_initial_flow_unless_the_case_states_it():
    def taken(reynolds, **friction):
        case = line(0.005, 5, reynolds=reynolds)
        case["links"]["main"]["friction"] |= friction
        return fvsolve.build(fvsolve.load(case)).checks["pipes"]["main"]["unsteady"]["weighting"]

    assert taken(1900.0) == "zielke" and taken(1e5) == "vardy-brown"
    assert (
        taken(1900.0, weighting="vardy-brown") == "vardy-brown"
        and taken(1e5, weighting="zielke") == "zielke"
    )


# the exact laminar line ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", NUMBERS)
def test_the_exact_line_is_that_of_another_inversion(number):
    run, probe, _ = solved(line(number, 5, "step"))
    start = float(run["gate.pressure"][0])
    t = np.array([0.01, 0.5, 1.9, 2.1, 3.7]) + START
    other = [stopped_lines.laminar_jump(number, late - START) for late in t]
    assert (probe(0, t) - start) / joukowsky(number) == approx(other, abs=1e-9)
    _, probe, _ = solved(line(number, 5))
    t = np.array([0.3, 0.8, 2.35, 3.0])
    other = [stopped_lines.smooth(number, START, DURATION, late) for late in t]
    assert (probe(0, t) - start) / joukowsky(number) == approx(other, abs=5e-8)


def test_the_first_plateau_rises_as_boundary_layers_do():
    """Early after a jump sqrt(I0 / I2) = 1 + 1/x + O(1/x^2): the pressure is 1 + 2 sqrt(tau / pi) Joukowsky jumps."""
    for t in (1e-6, 1e-4):
        assert stopped_lines.laminar_jump(0.05, t) - 1.0 == approx(
            2.0 * math.sqrt(0.05 * t / math.pi), rel=20.0 * math.sqrt(0.05 * t)
        )


def test_pressure_and_flow_along_the_exact_line_obey_conservation_of_mass():
    truth = solved(line(0.05, 40, end=2.3))[2]
    edges = np.linspace(0.0, 1000.0, 11)
    p = [truth.averages("main", edges, t)[0] for t in (2.29, 2.3)]
    t, h = (
        2.295 + 0.005 * np.polynomial.legendre.leggauss(4)[0],
        0.5 * np.polynomial.legendre.leggauss(4)[1],
    )
    q = np.array([truth.pipe("main", edges, np.full(11, when))[1] for when in t])
    left = (p[1] - p[0]) / 0.01 / (WATER["density"] * 1e6) * 100.0 * area(0.02)
    assert left == approx(-np.diff(h @ q), abs=1e-7 * np.max(np.abs(left)))


@pytest.mark.parametrize("number", NUMBERS)
def test_a_smooth_closure_is_within_1e_4_of_the_jump_everywhere(number):
    assert np.max(np.abs(errors(number, 200, "smooth")[1])) < 1e-4


@pytest.mark.parametrize("number", NUMBERS)
def test_a_sudden_closure_is_within_1e_4_of_the_jump_away_from_fronts(number):
    """Fronts pass the gate every 2 s after the closure; errors within 0.1 s of them are left out."""
    t, error = errors(number, 400, "step")
    phase = (t - START + 1.0) % 2.0 - 1.0
    assert np.max(np.abs(error[np.abs(phase) > 0.1])) < 1e-4


@pytest.mark.parametrize("number", NUMBERS)
def test_heads_come_nearer_with_every_doubling_of_cells(number):
    found = [
        float(np.max(np.abs(errors(number, cells, "smooth")[1]))) for cells in (25, 50, 100, 200)
    ]
    assert all(finer < coarser / 4.0 for coarser, finer in zip(found, found[1:], strict=False))


def test_flow_upstream_is_exact_too():
    run, probe, _ = solved(line(0.02, 200))
    error = run["main.flow@0.3"] - probe(1, run.t)
    assert np.max(np.abs(error)) < 1e-4 * run["main.flow@0.3"][0]


@pytest.mark.parametrize("change", [{"method": "radau-iia-5", "rtol": 1e-7}, {"scheme": "weno5"}])
def test_other_methods_and_schemes_find_the_same(change):
    case = line(0.02, 100, end=1.5)
    base, numerics = fvsolve.run(case), {**case["numerics"], **change}
    if "rtol" in change:
        numerics.pop("courant")
    other = fvsolve.run({**case, "numerics": numerics})
    apart = np.max(np.abs(other["gate.pressure"] - base["gate.pressure"]))
    assert apart < 2e-4 * joukowsky(0.02)


@pytest.mark.parametrize("law", ["log", "table"])
def test_under_other_laws_it_is_the_same_except_for_the_effect_of_density(law):
    case = line(0.02, 60, end=1.5)
    fluid = {**case["fluid"], "bulk_modulus": 1e9, "law": "log"}
    if law == "table":
        fluid = {"name": "Water", "temperature": 293.15, "law": "table"}
        case = line(0.005, 60, end=1.5)  # a line of this size with water
    linear = fvsolve.run({**case, "fluid": {**fluid, "law": "linear"}})
    other = fvsolve.run({**case, "fluid": {**fluid, "law": law}})
    jump = float(np.ptp(linear["gate.pressure"]))
    assert np.max(np.abs(other["gate.pressure"] - linear["gate.pressure"])) < 2e-3 * jump


def test_its_port_is_the_impedance_of_the_exact_line_and_passive():
    """Impedance Z tanh(G L) of the linearised cells, with a real part that is never negative."""
    found = response(line(0.02, 40), "gate")
    s = 1j * np.array([0.2, 0.7, 1.5, 2.3])
    root = np.sqrt(stopped_lines.inertia(s / 0.02))
    exact_z = WATER["density"] * 1000.0 / area(0.02) * root * np.tanh(s * root)
    assert found.transfer(s) == approx(exact_z, rel=1e-4)
    assert found.verdict.positive_real


def test_a_rigid_column_in_its_place_has_no_memory():
    found = rigid_column(fvsolve.load(line(0.02, 9)), "main")
    assert found["friction"] == {"model": "quasi-steady", "roughness": 0.0}


# a main -------------------------------------------------------------------------------------------------------------


def test_a_main_stays_at_the_first_plateau_and_converges_from_a_single_side():
    """Heads stay below 326 ft, the sum of 45.116 m, Joukowsky's jump and the friction head.

    Other programs give 353 ft to 590 ft, and more with half the step.
    """
    heads = []
    for cells in (25, 50, 100, 200):
        keys = {
            "links.main.cells": cells,
            "links.main.friction": {"model": "unsteady", "roughness": "0.26 mm"},
        }
        run = fvsolve.run(CASES / "valve-closure.toml", keys)
        head = np.array(run["gate.head"]) / FOOT
        assert head.max() < 1.01 * 326.0
        heads.append(np.interp([1.5, 2.0, 5.0], run.t, head))
    steps = -np.diff(heads, axis=0)
    assert np.all(steps > 0.0) and np.all(steps[1:] < steps[:-1])


# states, energy, faults ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["linear", "log"])
def test_its_energy_is_booked(law):
    """The remainder falls with the order of the scheme, so stored and dissipated energies are complete."""
    found = []
    for cells in (30, 60):
        case = line(0.02, cells, end=2.0)
        found.append(energy({**case, "fluid": {**case["fluid"], "law": law}}))
    assert found[1].relative < 2e-6 and found[1].relative < found[0].relative / 8.0
    assert float(found[1].dissipated["main friction"][-1]) > 0.0


def test_energy_in_the_memory_of_friction_is_part_of_the_available_energy():
    """Relaxation terms of a steady laminar flow add 1/3 of its kinetic energy to the available energy."""
    case = line(0.05, 10, "step", end=1.0)
    with_, without = case, line(0.05, 10, "step", end=1.0)
    without["links"]["main"]["friction"] = {"model": "quasi-steady", "roughness": 0.0}
    more = energy(with_).at_start["main"] - energy(without).at_start["main"]
    model = fvsolve.build(fvsolve.load(case))
    row = model.tables.pipes[0]
    kinetic = 0.5 * row["flow"] ** 2 * 1000.0 / (WATER["density"] * row["area"])
    assert more == approx(kinetic / 3.0, rel=0.01)  # a parabola has 4/3 of the energy of its mean


def test_without_an_event_no_bit_moves():
    case = line(0.02, 20)
    case["nodes"]["gate"] = junction(1e-6)
    model = fvsolve.build(fvsolve.load(case))
    assert not np.any(model.rhs(0.0, np.zeros(model.y_size)))
    run = fvsolve.run(model)
    assert np.all(run["gate.pressure"] == run["gate.pressure"][0])


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "upwind5", "muscl"])
@pytest.mark.parametrize("law", ["linear", "log"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(scheme, law):
    case = line(0.02, 9)
    case["numerics"]["scheme"], case["fluid"]["law"] = scheme, law
    model, rng = fvsolve.build(fvsolve.load(case)), np.random.default_rng(0)
    assert stray(model, 0.3, random_state(model, rng)) < 1e-7


def test_pipes_without_it_have_no_state_of_it():
    case = line(0.02, 9)
    case["links"]["main"]["friction"] = {"model": "quasi-steady", "roughness": 0.0}
    model = fvsolve.build(fvsolve.load(case))
    assert model.y_size == 18 and not model.unsteady


@pytest.mark.parametrize(
    ("friction", "kind", "words"),
    [({"model": "steady", "factor": 0.02, "weighting": "zielke"}, "pipe", "has no key weighting"),
     ({"model": "unsteady"}, "pipe", "roughness"),
     ({"model": "unsteady", "factor": 0.02, "weighting": "zielk"}, "pipe", 'did you mean "zielke"'),
     ({"model": "unsteady", "factor": 0.02, "accuracy": 1e-9}, "pipe", "out of range"),
     ({"model": "unsteady", "factor": 0.02}, "rigid-column", "in a rigid column")],
)  # fmt: skip
def test_faults(friction, kind, words):
    case = line(0.02, 9)
    case["links"]["main"] |= {"friction": friction, "type": kind}
    if kind == "rigid-column":
        del case["links"]["main"]["cells"], case["links"]["main"]["wave_speed"]
    refused(case, words)


def test_a_weighting_by_reynolds_number_requires_a_reynolds_number():
    case = line(0.02, 9)
    case["nodes"]["gate"]["demand"] = 0.0
    case["links"]["main"]["friction"] = {
        "model": "unsteady",
        "roughness": 1e-5,
        "weighting": "vardy-brown",
    }
    with pytest.raises(CaseError, match="friction.weighting: vardy-brown .* there is no flow"):
        fvsolve.build(fvsolve.load(case))


def test_it_needs_a_viscosity():
    case = line(0.02, 9)
    case["fluid"] = {key: value for key, value in case["fluid"].items() if key != "viscosity"}
    case["links"]["main"]["friction"] = {"model": "unsteady", "factor": 0.02}
    with pytest.raises(CaseError, match='"unsteady" needs the fluid\'s viscosity'):
        fvsolve.build(fvsolve.load(case))


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda case: case["nodes"]["gate"].update(demand=1e-3), "is laminar"),
     (lambda case: case["links"]["main"].update(friction={"model": "none"}), 'needs friction with model = "unsteady"'),
     (lambda case: case["nodes"]["lake"].update(pressure={"time": [0, 1], "value": [1e6, 2e6]}), "constant pressure")],
)  # fmt: skip
def test_the_exact_line_refuses_other_scenes(change, words):
    case = {**line(0.02, 9), "exact": {"name": "laminar-line"}}
    change(case)
    refused(case, words)
