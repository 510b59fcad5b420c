"""Solenoids against closed forms, SciPy on equations written by hand, and restatements."""

import functools
from math import pi

import numpy as np
import pytest
from parts.test_networks import GROUND, network, runs, two_port
from scipy.integrate import solve_ivp

EXACT = 1e-9
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"]
MU_0 = 4e-7 * pi
COIL = {"type": "solenoid", "ports": {"p": "b", "n": "gnd", "armature": "plunger"}, "turns": 800.0,
        "pole_area": 8e-5, "closed_position": 3e-3, "core_reluctance": 4e6}  # fmt: skip
OHM, VOLT = 12.0, 24.0


def coil(end=0.05, nodes=None, links=None, probes=None, voltage=VOLT, **keys):
    """Coil with a resistor on a source; its armature is fixed if `nodes` names no other."""
    nodes = GROUND | {"a": {"type": "terminal"}, "b": {"type": "terminal"}} | (nodes or {"plunger": {"type": "frame"}})
    links = {"supply": two_port("voltage-source", "gnd", "a", voltage=voltage),
             "wire": two_port("resistor", "a", "b", resistance=OHM), "coil": COIL | keys} | (links or {})  # fmt: skip
    return network(nodes, links, end, probes or ["coil.current", "coil.flux", "coil.force"])


@pytest.mark.parametrize("method", METHODS)
def test_the_current_of_a_locked_armature_is_that_of_a_coil_with_a_resistor(method):
    run = runs(coil(initial_flux=0.0), method)
    reluctance = COIL["core_reluctance"] + 3e-3 / (MU_0 * COIL["pole_area"])
    inductance = COIL["turns"] ** 2 / reluctance
    current = VOLT / OHM * (1.0 - np.exp(-OHM / inductance * np.array(run.t)))
    flux = COIL["turns"] * current / reluctance
    assert np.array(run["coil.current"]) == pytest.approx(current, abs=2.0 * EXACT)
    assert np.array(run["coil.flux"]) == pytest.approx(flux, abs=flux[-1] * EXACT)
    force = flux**2 / (2.0 * MU_0 * COIL["pole_area"])
    assert np.array(run["coil.force"]) == pytest.approx(force, abs=2.0 * force[-1] * EXACT)


MOVING = {"plunger": {"type": "mass", "mass": 0.02, "initial_position": -1e-6}, "wall": {"type": "frame"}, "base": {"type": "frame", "initial_position": -0.01}}
PULLED = {"spring": two_port("spring", "base", "plunger", stiffness=900.0, preload=-4.0),
          "stop": two_port("end-stop", "wall", "plunger", stiffness=4e6, damping=120.0, minimum=0.0, maximum=2.8e-3),
          "oil": two_port("damper", "wall", "plunger", damping=2.0)}  # fmt: skip
SATURATION = 1.5e-4


def moving(end=0.06, **keys):
    """Armature with a spring and stops: it closes when the voltage comes, and opens when it goes."""
    voltage = {"time": [0.0, 0.005, 0.035], "value": [0.0, VOLT, 0.0], "kind": "step"}
    return coil(end, MOVING, PULLED, ["coil.current", "coil.flux", "coil.force", "plunger.position", "stop.force"],
                voltage, saturation_flux=SATURATION, **keys)  # fmt: skip


@functools.cache
def by_hand(times, breaks=(0.005, 0.035), start=(0.0, -1e-6, 0.0), saturation=SATURATION):
    """Flux [Wb], position [m] and velocity [m/s] of the armature of `moving` at times, by SciPy with contact events."""
    mass, spring, free, stiff, damp, oil = 0.02, 900.0, 4.0, 4e6, 120.0, 2.0
    turns, closed, per_gap = COIL["turns"], COIL["closed_position"], 1.0 / (MU_0 * COIL["pole_area"])

    def current(flux, x):
        core = COIL["core_reluctance"] * (1.0 + (flux / saturation) ** 2)
        return (core + per_gap * abs(closed - x)) * flux / turns

    def rates(t, y, volt, touched):
        flux, x, v = y
        force = -spring * (x + 1e-6) - free - oil * v + np.sign(closed - x) * 0.5 * per_gap * flux**2
        if touched == -1:
            force += max(0.0, -stiff * x - damp * v)
        elif touched == 1:
            force -= max(0.0, stiff * (x - 2.8e-3) + damp * v)
        return [(volt - OHM * current(flux, x)) / turns, v, force / mass]

    def end(limit, direction):
        def left(t, y, *_):
            return y[1] - limit

        left.terminal, left.direction = True, direction
        return left

    times = np.array(times)
    y, found = np.array(start), np.empty((3, len(times)))
    edges = [times[0], *breaks, times[-1]]
    for low, high in zip(edges, edges[1:], strict=False):
        t, volt = low, VOLT if low == breaks[0] else 0.0
        touched = -1 if y[1] < 0.0 else 1 if y[1] > 2.8e-3 else 0
        while t < high:
            ends = {-1: [end(0.0, 1)], 0: [end(0.0, -1), end(2.8e-3, 1)], 1: [end(2.8e-3, -1)]}[touched]
            run = solve_ivp(rates, (t, high), y, "DOP853", args=(volt, touched), events=ends, dense_output=True,
                            rtol=1e-12, atol=[1e-18, 1e-16, 1e-13], max_step=1e-4)  # fmt: skip
            inside = (times >= t) & (times <= run.t[-1])
            if inside.any():
                found[:, inside] = run.sol(times[inside])
            t, y = run.t[-1], run.y[:, -1]
            if run.status == 1:
                touched = 0 if touched else -1 if len(run.t_events[0]) else 1
    return found, np.array([current(flux, x) for flux, x in found[:2].T])


@pytest.mark.parametrize("method", METHODS)
def test_an_armature_closes_and_opens_as_that_of_scipy(method):
    run = runs(moving(), method)
    times = np.array(run.t)
    (flux, x, _), current = by_hand(tuple(run.t))
    assert x.max() > 2.8e-3 and abs(x[-1]) < 3e-5
    for name, exact in (("coil.flux", flux), ("plunger.position", x), ("coil.current", current)):
        print(name, np.abs(np.array(run[name]) - exact).max() / np.abs(exact).max())
        assert np.array(run[name]) == pytest.approx(exact, abs=EXACT * np.abs(exact).max()), name
