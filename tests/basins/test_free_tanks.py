"""Water that moves its body: frozen in heave, sway and roll on springs by closed forms, momentum, energy, restated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from fvsolve import advance, build, load, run
from fvsolve.model.model import State
from tests.truth.scenes import GRAVITY, RHO, scene

LENGTH, DEPTH = 2.0, 0.1


def tank(n=20, along="x", level=DEPTH, **more):
    cells, size = ((n, 1), (LENGTH, 1.0)) if along == "x" else ((1, n), (1.0, LENGTH))
    return {"type": "basin", "on": "cart", "size": list(size), "cells": list(cells), "level": level, **more}


def cart(mass=100.0, axis=(1, 0, 0), **more):
    return {
        "type": "body", "mass": mass, "inertia": [50.0, 50.0, 50.0],
        "joint": {"kind": "prismatic", "axis": list(axis), **more},
    }  # fmt: skip


def sprung(basin, body, stiffness, end, numerics, probes, toward=(5.0, 0, 0), **spring):
    world = {"type": "frame", "points": {"far": list(toward)}}
    links = {"spring": {"type": "spring", "from": "cart", "to": "world.far", "stiffness": stiffness, **spring}}
    nodes = {"cart": body, "world": world, "b": basin}
    return scene(nodes, links, end, {"scheme": "upwind5", "method": "rk4", **numerics}, probes, every=0.01)


@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
def test_water_at_rest_on_a_vertical_spring_swings_as_frozen_mass(method):
    stiff, water = 2e4, RHO * DEPTH * LENGTH
    case = sprung(tank(4), cart(axis=(0, 0, 1), rate=0.05), stiff, 1.0, {"method": method, "step": 2e-3},
                  ["cart.z", "b.speed@1,0.5"], (0, 0, 9.0), preload=-(100.0 + water) * GRAVITY)  # fmt: skip
    result = run(case)
    w = math.sqrt(stiff / (100.0 + water))
    assert np.abs(result["cart.z"] - 0.05 / w * np.sin(w * result.t)).max() < 1e-6 * 0.05 / w * 100
    assert np.abs(result["b.speed@1,0.5"]).max() < 1e-12


def test_a_tank_at_rest_on_its_spring_does_not_move_by_a_bit():
    preload = -(100.0 + RHO * DEPTH * LENGTH) * GRAVITY
    case = sprung(tank(8), cart(axis=(0, 0, 1)), 2e4, 1.0, {"step": 2e-3}, ["cart.z"], (0, 0, 9.0), preload=preload)
    result = run(case)
    assert np.ptp(result["cart.z"]) == 0.0


@pytest.mark.parametrize("along", ["x", "y"])
def test_a_tank_on_a_spring_swings_at_the_root_of_the_tangent_law(along):
    mass, stiff = 100.0, 3e3
    c, water = math.sqrt(GRAVITY * DEPTH), RHO * DEPTH * LENGTH

    def law(w):
        s = 0.5 * w * LENGTH / c
        return stiff - mass * w * w - water * w * w * math.tan(s) / s

    w = brentq(law, 0.2, math.pi * c / LENGTH * 0.999)
    k, axis = w / c, (1, 0, 0) if along == "x" else (0, 1, 0)
    speed = 1e-5
    errors = []
    for n in (20, 40):
        # cart at speed cos(w t): u from the forced mode, relative to it
        ratio = math.tan(0.5 * k * LENGTH)
        flow = f"{speed} * (cos({k} * {along}) + {ratio} * sin({k} * {along}) - 1)"
        basin = tank(n, along, start={"u" if along == "x" else "v": flow})
        toward = tuple(5.0 * a for a in axis)
        case = sprung(basin, cart(mass, axis, rate=speed), stiff, 4.0, {"step": 0.1 / n}, ["cart.rate"], toward,
                      preload=0.0)  # fmt: skip
        result = run(case)
        errors.append(np.abs(result["cart.rate"] - speed * np.cos(w * result.t)).max() / speed)
    assert errors[1] < errors[0] / 2.5
    assert errors[1] < 5e-3


def test_a_free_tank_on_rails_keeps_its_momentum():
    case = scene({"cart": cart(50.0, rate=0.3), "b": tank(30, start={"level": f"{DEPTH} + 0.03 * cos(1.5 * x)"})}, {}, 2.0,
                 {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5}, [])  # fmt: skip
    model = build(load(case))
    basin, at = model.basins[0], model.state_names.index("cart.travel_rate")

    def momentum(y):
        found, area = basin.of(y), basin.mesh.area
        v = 0.3 + y[at]
        return 50.0 * v + RHO * np.sum(area * ((basin.depth + found[0]) * v + found[1]))

    state = advance(model, State(0.0, model.start.copy()), 2.0)
    assert abs(state.y[at]) > 1e-3
    assert momentum(state.y) == pytest.approx(momentum(model.start), rel=1e-13)
