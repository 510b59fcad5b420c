"""Walls of basins that move: closed forms, geometric conservation, force and power, bodies, limits, restatements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from fvsolve import advance, build, load, run
from fvsolve.model.model import State
from tests.truth.scenes import GRAVITY, RHO, scene

SIDES = ("west", "east", "south", "north")
STEPPED = {"scheme": "muscl", "limiter": "minmod", "method": "ssp-rk2"}


def flume(patches, cells=50, wide=2, length=2.0, side="east", level=1.0, physics="free-surface", **more):
    """A basin 2 m long along the way in which the wall on a side moves, 1 m wide."""
    along = side in SIDES[:2]
    size, many = ([length, 1.0], [cells, wide]) if along else ([1.0, length], [wide, cells])
    return {
        "type": "basin",
        "physics": physics,
        "size": size,
        "cells": many,
        "level": level,
        "patches": patches,
        **more,
    }


def moved(case, until):
    """(model, state) at a time."""
    model = build(load(case))
    return model, advance(model, State(case["numerics"].get("start", 0.0), model.start.copy()), until)


def straight(speed, end=10.0):
    return {"time": [0.0, end], "value": [0.0, speed * end]}


# closed forms ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["euler", "ssp-rk2", "rk4", "implicit-midpoint", "gauss-4", "rodas-4"])
@pytest.mark.parametrize("side", ["east", "north"])
def test_homologous_expansion_is_exact_to_round_off_under_every_method(method, side):
    rate, n = 0.4, 20
    velocity = "u" if side == "east" else "v"
    start = {velocity: f"{rate} * {'x' if side == 'east' else 'y'}"}
    nodes = {"b": flume({"lid": {"side": side, "travel": straight(2.0 * rate)}}, n, side=side, start=start)}
    model, state = moved(scene(nodes, {}, 1.0, {**STEPPED, "method": method, "step": 5e-3}), 1.0)
    basin = model.basins[0]
    found, x = basin.of(state.y), (basin.mesh.centre[:, 0 if side == "east" else 1]) * (1.0 + rate)
    close = 1e-10 if method == "rodas-4" else 1e-13  # Rosenbrock methods step by differences for a Jacobian
    assert 1.0 + found[0] == pytest.approx(1.0 / (1.0 + rate), abs=close)
    flow = found[1 if side == "east" else 2] / (1.0 + found[0])
    assert flow == pytest.approx(rate * x / (1.0 + rate), abs=close)
    assert abs(model.contents(state.y)[1]) < 1e-12 * model.contents(state.y)[0]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_wall_that_is_pushed_in_sends_out_the_exact_shock_and_does_its_work(side, scheme):
    speed, sign = 0.8, 1.0 if side in ("west", "south") else -1.0
    nodes = {"b": flume({"lid": {"side": side, "travel": straight(sign * speed, 0.5)}}, 100, 1, side=side)}
    case = scene(nodes, {}, 0.3, {"scheme": scheme, "method": "ssp-rk2", "courant": 0.8},
                 ["b.lid.force", "b.lid.power", "b.lid.travel"], every=0.02)  # fmt: skip
    depth = brentq(lambda h: (h - 1.0) * math.sqrt(0.5 * GRAVITY * (h + 1.0) / h) - speed, 1.0, 3.0)
    force = 0.5 * RHO * GRAVITY * depth**2
    result = run(case)
    close = 1e-3 if scheme == "upwind" else 1e-4  # a wall that starts at once leaves some of its start behind
    assert result["b.lid.force"][-1] == pytest.approx(force, rel=close)
    assert result["b.lid.power"][-1] == pytest.approx(force * speed, rel=close)
    assert result["b.lid.travel"][-1] == pytest.approx(sign * speed * 0.3, rel=1e-13)


def test_a_wall_drawn_out_makes_a_simple_wave_and_faster_than_twice_the_waves_a_dry_wall():
    c = math.sqrt(GRAVITY)
    for speed in (0.5, 2.5 * c):
        nodes = {"b": flume({"lid": {"side": "east", "travel": straight(speed), "zone": 1.0}}, 200, 1)}
        model, state = moved(scene(nodes, {}, 0.15, {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.5}), 0.15)
        depth = 1.0 + model.basins[0].of(state.y)[0][-1]
        wanted = max(1.0 - 0.5 * speed / c, 0.0) ** 2
        assert depth == pytest.approx(wanted, abs=4e-3)
        assert 1.0 + model.basins[0].of(state.y)[0].min() >= 0.0


@pytest.mark.parametrize("method", ["ssp-rk3", "rodas-4"])
def test_a_free_piston_on_a_spring_swings_at_the_root_of_the_cotangent_law(method):
    mass, stiff, length = 800.0, 9000.0, 2.0
    c = math.sqrt(GRAVITY)

    def law(w):
        return stiff - mass * w * w + RHO * GRAVITY * (w / c) / math.tan(w / c * length)

    w = brentq(law, 0.3, math.pi * c / length * 0.999)
    errors = []
    for n in (20, 40):
        nodes = {
            "b": flume({"lid": {"side": "east", "body": "lid"}}, n, 1),
            "lid": {"type": "mass", "mass": mass, "initial_velocity": 1e-4},
            "ground": {"type": "frame"},
        }
        nodes["b"]["start"] = {"u": f"1e-4 * sin({w / c} * x) / sin({w / c * length})"}
        rest = 0.5 * RHO * GRAVITY
        links = {"spring": {"type": "spring", "from": "lid", "to": "ground", "stiffness": stiff, "preload": rest}}
        numerics = {"scheme": "upwind5", "method": method, "step": 0.2 * length / n / c}
        result = run(scene(nodes, links, 4.0 * math.pi / w, numerics, ["lid.velocity"], every=0.01))
        wanted = 1e-4 * np.cos(w * result.t)
        errors.append(np.abs(result["lid.velocity"] - wanted).max() / 1e-4)
    assert errors[1] < 0.3 * errors[0]
    assert errors[1] < 4e-3


# what is carried, and what rides ------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("method", ["ssp-rk3", "radau-iia-3"])
def test_what_is_even_stays_even_and_amounts_and_mass_are_kept_between_walls_that_swing(scheme, method):
    swings = {"mean": 0.1, "amplitude": 0.25, "period": 1.1, "phase": 0.4}
    patches = {
        "left": {"side": "west", "travel": swings, "zone": 0.9},
        "right": {"side": "east", "travel": straight(-0.3)},
    }
    more = {"start": {"level": "1 + 0.1 * cos(3 * x) * cos(2 * y)", "u": "0.2 * x", "v": "0.1 * y"}}
    nodes = {"b": flume(patches, 24, 4, **more, scalars={"even": 3.0, "patchy": "1 + x"})}
    scalars = {"even": {"initial": 3.0}, "patchy": {"initial": 1.0}}
    step = {"courant": 0.5} if method == "ssp-rk3" else {"step": 0.01}
    case = scene(nodes, {}, 0.8, {"scheme": scheme, "method": method, **step}, scalars=scalars)
    model, state = moved(case, 0.8)
    basin = model.basins[0]
    values = basin.values(state.y)
    close = 1e-12 if method == "ssp-rk3" else 1e-8
    assert values["even"] == pytest.approx(3.0, abs=close)
    held = basin.held()
    for first, last in zip(basin.amounts(model.start), basin.amounts(state.y), strict=True):
        assert np.sum(held * last) == pytest.approx(np.sum(held * first), rel=close)
    mass, change = model.contents(state.y)
    assert abs(change) < close * mass
    assert np.ptp(values["patchy"]) > 0.5
