"""Studies of moving cases: poles, impedances and energy balances against closed forms, and messages."""

from __future__ import annotations

import math
from importlib import import_module

import numpy as np
import pytest
from invariance.moving import SCENES, flume, u_tube
from reference.bodies import bodies, body
from reference.scenes import GRAVITY, RHO, scene
from scipy.optimize import brentq

from fvsolve.case.text import write
from fvsolve.errors import FvsolveError
from fvsolve.studies.energy.energy_balance import energy
from fvsolve.studies.failure.failure_map import failure_map
from fvsolve.studies.linear.linearise import linearise
from fvsolve.studies.ports.response import response


def poles(case) -> np.ndarray:
    return np.linalg.eigvals(np.asarray(linearise(case).a))


def test_a_free_body_about_its_middle_axis_has_the_poles_of_eulers_equations():
    """Poles +-w sqrt((I2 - I1) (I3 - I2) / (I1 I3)), one of them unstable; rows of A may be rounding alone."""
    stone = body(5.0, [0.3, 0.5, 0.7], {"kind": "free", "rate": [0.0, 2.0, 0.0]})
    found = poles(bodies({"stone": stone}, 1.0, ["stone.wy"], method="gauss-4", step=0.01) | {"gravity": 0.0})
    wanted = 2.0 * math.sqrt(0.2 * 0.2 / (0.3 * 0.7))
    assert max(found.real) == pytest.approx(wanted, rel=1e-9) and min(found.real) == pytest.approx(-wanted, rel=1e-9)
    stone["joint"]["rate"] = [0.01, 2.0, 0.02]  # near the equilibrium; it can still be linearised
    found = poles(bodies({"stone": stone}, 1.0, ["stone.wy"], method="gauss-4", step=0.01) | {"gravity": 0.0})
    assert max(found.real) == pytest.approx(wanted, rel=1e-3)


def test_a_tank_on_a_spring_has_the_pole_of_the_tangent_law():
    mass, stiff, length, depth = 100.0, 3e3, 2.0, 0.1
    c, water = math.sqrt(GRAVITY * depth), RHO * depth * length

    def law(w):
        s = 0.5 * w * length / c
        return stiff - mass * w * w - water * w * w * math.tan(s) / s

    w = brentq(law, 0.2, math.pi * c / length * 0.999)
    off = []
    for n in (20, 40):
        nodes = {
            "cart": body(mass, [1, 1, 1], {"kind": "prismatic", "axis": [1, 0, 0]}),
            "world": {"type": "frame", "points": {"far": [5.0, 0, 0]}},
            "b": {"type": "basin", "on": "cart", "size": [length, 1.0], "cells": [n, 1], "level": depth},
        }  # fmt: skip
        spring = {"type": "spring", "from": "cart", "to": "world.far", "stiffness": stiff, "preload": 0.0}
        found = poles(
            scene(nodes, {"spring": spring}, 1.0, {"scheme": "upwind5", "method": "rk4", "step": 0.01}, ["cart.rate"])
        )
        off.append(np.abs(found - 1j * w).min() / w)
    assert off[1] < 5e-5 and off[0] / off[1] > 3.5


def test_the_impedance_of_a_u_tube_on_its_hull_is_that_of_two_tanks_and_what_lies_between():
    """Impedance rho g / (A s) (s^2 + w^2) / (s^2 + 2 w^2), w^2 = g a / (A L)."""
    case = u_tube("dormand-prince", free=False)
    case["nodes"]["hull"]["joint"]["angle"] = {"mean": 0.0, "amplitude": 0.0, "period": 5.0}
    case["links"]["duct"]["minor_loss"] = 0.0
    found = response(case, "port")
    s = 1j * np.array([0.1, 0.3, 1.0, 2.0])
    square = GRAVITY * math.pi / 4 * 0.6**2 / (1.2 * 8.0)
    wanted = RHO * GRAVITY / (1.2 * s) * (s**2 + square) / (s**2 + 2.0 * square)
    assert found(s) == pytest.approx(wanted, rel=1e-6)


def test_the_ledger_of_energy_of_a_basin_with_a_wall_and_of_a_device_beside_it_closes():
    """Rows of devices come after those of basins; a valve joins a basin with a moving wall to a tank."""
    parts = []
    for step in (8e-3, 4e-3):
        found = energy(flume("ssp-rk3"), {"numerics.step": step})
        parts.append(float(np.abs(found.step).max()))
    assert {"b.paddle"} <= {*found.supplied} and {"tap"} <= {*found.dissipated} and {"t"} <= {*found.stored}
    passed = max(np.abs(one).max() for one in [*found.supplied.values(), *found.dissipated.values()])
    assert found.dissipated["tap"][-1] > 1e-4 * passed
    assert parts[1] < parts[0] / 5.0 and parts[1] < 1e-3 * passed


def test_a_map_names_the_probe_that_its_reference_does_not_know():
    case = SCENES["loop"]("rk4")
    case["output"]["probes"] = ["one.angle", "loop.gap"]
    with pytest.raises(FvsolveError, match="of the range of loop.gap.*remove this probe from output.probes"):
        failure_map(case, methods=["rk4"], steps=[4e-3])


def test_a_basin_too_large_to_be_predicted_is_measured_and_drawn_no_spectrum(tmp_path, fvs, monkeypatch):
    monkeypatch.setattr(import_module("fvsolve.studies.stability.stability"), "TIME_LIMIT", 0.0)
    tank = {"type": "basin", "size": [1.0, 1.0], "cells": [20, 20], "level": 0.3, "start": {"level": "0.3 + 0.001 * x"}}
    case = scene({"b": tank}, {}, 1.0, {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.5}, ["b.depth@0.1,0.1"])
    (tmp_path / "pool.toml").write_text(write(case))
    code, said, error = fvs("stability", tmp_path / "pool.toml", "--steps", 20, "--out", tmp_path / "out")
    assert code == 0 and "give pipes or basins fewer cells" in said + error
    assert "1e4 / ||J||" not in said + error
