"""Sudden closure of a frictionless pipe: dp = rho a v, a square wave of period 4 L / a."""

import math

import numpy as np
import pytest
from reference import scenes
from reference.scenes import AMBIENT, RHO, SHARP, junction, pipe, reservoir, scene, step, valve

import fvsolve

LENGTH, DIAMETER, SPEED, CELLS = 914.4, 0.3048, 1219.2, 40
SHUT, END = 0.0411, 4.0
STEP = LENGTH / CELLS / SPEED
PLACES = {"gate.pressure": 1.0, "main.pressure@0.5": 0.5, "main.pressure@0.21": 0.21}


def shut_pipe(velocity: float, how: str, every: float = 0.01, turned: bool = False, **numerics) -> tuple[dict, float]:
    """Return (case, jump rho a v [Pa]) of a flow that stops by `how`: initial_flow, demand or valve."""
    jump = RHO * SPEED * velocity
    supply = 2 * AMBIENT + 2 * jump
    q = velocity * scenes.area(DIAMETER)
    ends = ("gate", "lake") if turned else ("lake", "gate")
    main = pipe(*ends, LENGTH, DIAMETER, SPEED, CELLS)
    nodes = {"lake": reservoir(supply), "gate": junction()}
    links = {"main": main}
    if how == "initial_flow":
        main["initial_flow"] = -q if turned else q
    elif how == "demand":
        nodes["gate"] = junction(step(SHUT, q, 0.0))
    elif how == "valve":
        nodes["air"] = reservoir(AMBIENT)
        flow_area = q / math.sqrt(2 * (supply - AMBIENT) / RHO)
        links["valve"] = valve("gate", "air", flow_area, step(SHUT, 1.0, 0.0))
    places = {name: 1 - x if turned and "@" in name else x for name, x in PLACES.items()}
    probes = ["gate.pressure", *(f"main.pressure@{x}" for n, x in places.items() if "@" in n)]
    case = scene(nodes, links, END, {**SHARP, **numerics}, probes, every)
    return case, jump


def square_wave(t: np.ndarray, fraction: float, shut: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (square wave over its jump [-], time to the nearest front [s])."""
    period = 2 * LENGTH / SPEED
    value, distance = np.zeros_like(t), np.full_like(t, np.inf)
    for k in range(math.ceil(END / period) + 1):
        for sign, path in ((1, 1 - fraction), (-1, 1 + fraction)):
            front = shut + path * LENGTH / SPEED + k * period
            value += sign * (-1) ** k * (t >= front)
            distance = np.minimum(distance, np.abs(t - front))
    return value, distance


def worst(result, jump: float, shut: float, turned: bool = False) -> float:
    """Greatest difference from the square wave over the jump, three steps away from fronts (probes interpolate)."""
    t, errors = np.asarray(result.t), []
    for name in result.probes:
        fraction = 1.0 if "@" not in str(name) else float(str(name).split("@")[1])
        fraction = 1 - fraction if turned and "@" in str(name) else fraction
        exact, distance = square_wave(t, fraction, shut)
        clear = distance > 3.01 * STEP
        assert clear.mean() > 0.6
        supply = 2 * AMBIENT + 2 * jump
        errors.append(np.max(np.abs(result[str(name)] - supply - jump * exact)[clear]) / jump)
    return max(errors)


@pytest.mark.parametrize("velocity", [1e-4, 1e-2, 0.3, 2.0])
@pytest.mark.parametrize("how", ["initial_flow", "demand", "valve"])
def test_upwind_with_euler_at_courant_one_is_exact(velocity, how):
    case, jump = shut_pipe(velocity, how)
    shut = 0.0 if how == "initial_flow" else SHUT
    assert worst(fvsolve.run(case), jump, shut) < 1e-10


@pytest.mark.parametrize("every", [STEP / 3, 0.00731, 0.1, 0.25])
def test_exactness_does_not_depend_on_how_often_it_is_written(every):
    case, jump = shut_pipe(1.0, "demand", every)
    result = fvsolve.run(case)
    assert worst(result, jump, SHUT) < 1e-10
    often = fvsolve.run(shut_pipe(1.0, "demand", 0.003)[0])
    assert dict(result.extremes) == dict(often.extremes)


def test_a_pipe_laid_the_other_way_round_gives_the_same_wave():
    case, jump = shut_pipe(0.5, "valve", turned=True)
    assert worst(fvsolve.run(case), jump, SHUT, turned=True) < 1e-10


def test_extremes_are_the_jump_up_and_down():
    case, jump = shut_pipe(1.0, "demand")
    supply = 2 * AMBIENT + 2 * jump
    least, t_least, greatest, t_greatest = fvsolve.run(case).extremes["gate.pressure"]
    assert [least, greatest] == pytest.approx([supply - jump, supply + jump], abs=1e-10 * jump)
    for time, side in ((t_least, -1.0), (t_greatest, 1.0)):  # on a plateau of this sign
        assert square_wave(np.array([time + 1e-9]), 1.0, SHUT)[0][0] == side


def test_history_has_two_rows_at_the_jump():
    case, jump = shut_pipe(1.0, "demand")
    result = fvsolve.run(case)
    rows = np.flatnonzero(np.abs(np.asarray(result.t) - SHUT) < 1e-12)
    assert len(rows) == 2
    before, after = result["gate.pressure"][rows]
    assert after - before == pytest.approx(jump, rel=1e-9)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
def test_every_scheme_keeps_the_plateau(scheme):
    case, jump = shut_pipe(1.0, "demand", scheme=scheme, method="ssp-rk3", courant=0.8)
    case["links"]["main"]["cells"] = 400
    result = fvsolve.run(case)
    mean = np.mean(result["gate.pressure"][(result.t > SHUT + 0.3) & (result.t < SHUT + 1.2)])
    assert mean - (2 * AMBIENT + 2 * jump) == pytest.approx(jump, rel=1e-3)


def test_the_mass_ledger_closes():
    case, _ = shut_pipe(2.0, "valve")
    assert abs(fvsolve.run(case).ledger["mass"]["relative"]) < 1e-12
