"""Jumps that arrive within a step at a junction with a valve or a rigid column are computed to second order."""

from __future__ import annotations

import numpy as np
import pytest
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, area, chamber, junction, lake, pipe, scene, step, valve
from scipy.integrate import solve_ivp

import fvsolve

LENGTH, BORE, SPEED, FLOW, HEAD = 300.0, 0.3, 1000.0, 0.05, 50.0
AFTER = 0.55  # time since the arrival of the jump, before any other wave [s]
Y, JUMP = area(BORE) / SPEED, RHO * SPEED * FLOW / area(BORE)  # admittance [kg/(s Pa)], Joukowsky jump [Pa]
NARROW, VOLUME = 4e-3, 30.0  # effective area of the valve [m2], volume of the chamber [m3]
COLUMN = 40.0 / area(0.2)  # length over area of the column [1/m]
COLUMN_LINK = {"type": "rigid-column", "from": "j", "to": "behind", "length": 40.0, "diameter": 0.2}


def ran(behind: dict, gap: dict, method: str, h: float) -> fvsolve.Result:
    """Run of a demand that stops at a dead end, 0.3 s from a junction and 0.9 s from a lake.

    The link `gap` joins the junction to the node `behind`.
    """
    nodes = {"lake": lake(HEAD), "j": junction(), "gate": junction(step(0.1, FLOW, 0.0)), "behind": behind}
    links = {"far": pipe("lake", "j", 2 * LENGTH, BORE, SPEED, 4), "near": pipe("j", "gate", LENGTH, BORE, SPEED, 4)}
    numerics, end = {"pipe_model": "delay-line", "method": method, "step": h}, 0.1 + LENGTH / SPEED + AFTER
    found = fvsolve.run(scene(nodes, {**links, "gap": gap}, end, numerics, ["behind.pressure", "gap.flow"], end))
    assert found.reason == "finished"
    assert abs(found.ledger["mass"]["relative"]) < 1e-14
    return found


@pytest.mark.parametrize("method", ["rk4", "trapezoid"])
def test_a_chamber_behind_a_valve(method):
    """A chamber behind a valve follows V rho / beta dp/dt = M with M^2 = 2 rho (Cd A)^2 (jump - M / 2Y - p)."""
    k = 2.0 * RHO * NARROW**2

    def rate(t, p):
        half = k / (4.0 * Y)
        flow = np.sqrt(half**2 + k * max(JUMP - p[0], 0.0)) - half
        return [WATER["bulk_modulus"] / (RHO * VOLUME) * flow]

    exact = AMBIENT + RHO * GRAVITY * HEAD + solve_ivp(rate, (0.0, AFTER), [0.0], rtol=1e-11, atol=1e-3).y[0, -1]
    for h in (0.037, 0.017, 0.0041):
        found = ran(chamber(VOLUME), valve("j", "behind", NARROW), method, h)
        assert abs(found["behind.pressure"][-1] / exact - 1.0) < 0.6 * h**2


@pytest.mark.parametrize("method", ["rk4", "trapezoid"])
def test_a_column_at_a_junction(method):
    """A rigid column follows L / A dM/dt = jump - M / 2Y.

    The solution is M = 2 Y jump (1 - exp(-t / T)) with T = 2 Y L / A.
    """
    exact = 2.0 * Y * JUMP * (1.0 - np.exp(-AFTER / (2.0 * Y * COLUMN))) / RHO
    for h in (0.037, 0.017, 0.0041):
        found = ran(lake(HEAD), COLUMN_LINK | {"friction": {"model": "none"}}, method, h)
        assert abs((found["gap.flow"][-1] - found["gap.flow"][0]) / exact - 1.0) < 0.6 * h**2


@pytest.mark.parametrize("h", [0.02, 0.057, 0.095])
def test_a_store_that_fills_in_less_than_a_step_takes_no_more_than_there_is(h):
    """A small chamber next to a lake never stores more energy than the kinetic energy of the stopped flow."""
    flow, long, volume = 0.03, 317.0, 0.15
    nodes = {"lake": lake(600.0), "a": junction(step(0.0503, flow, 0.0)), "v": chamber(volume)}
    links = {"up": pipe("lake", "a", long, BORE, 1200.0, 2), "neck": pipe("a", "v", 123.0, 0.1, 1200.0, 2)}
    numerics = {"pipe_model": "delay-line", "method": "trapezoid", "step": h}
    found = fvsolve.run(scene(nodes, links, 30.0, numerics, ["v.pressure"], 0.05))
    risen = np.max(np.abs(found["v.pressure"] - found["v.pressure"][0]))
    assert volume * risen**2 / (2.0 * WATER["bulk_modulus"]) < RHO * flow**2 * long / (2.0 * area(BORE))
