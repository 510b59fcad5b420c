"""Basins on driven bodies: water at rest in rotating, decelerated or tilted boxes, forced waves, moments, faults."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from reference.basins import HEAVY, ended, model_of, sliding, slowing, straight, turning
from reference.scenes import GRAVITY, scene

from fvsolve import advance, load, run
from fvsolve.core.model.model import State
from fvsolve.errors import CaseError
from fvsolve.features.basins import frame_forces
from fvsolve.features.basins.basin_frames import CELL_POSITIONS, REST_LEVEL, REST_SURFACE

METHODS = ("ssp-rk3", "gauss-4", "rodas-4")


def tank(cells=(20, 20), size=(2.0, 2.0), level=0.3, on="body", **more):
    return {
        "type": "basin",
        "on": on,
        "size": list(size),
        "cells": list(cells),
        "level": level,
        **more,
    }


def moved(body, basin, until, numerics=None, **nodes):
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5, **(numerics or {})}
    model, state = ended(scene({"body": body, "b": basin, **nodes}, {}, until, numerics), until)
    return model, state, model.meshed[0].deviations(state.y)


# water at rest ----------


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 0, -1]])
def test_water_that_turns_with_its_box_rests_as_a_paraboloid_wherever_the_axis_is(method, axis):
    rate, (cx, cy) = 2.0, (0.7, 1.3)
    bowl = f"0.3 + {rate**2 / (2 * GRAVITY)} * ((x - {cx})**2 + (y - {cy})**2)"
    basin = tank((10, 10), at=[-cx, -cy, 0.0], start={"level": bowl})
    case = {
        "scheme": "muscl",
        "method": method,
        **({"courant": 0.5} if method == "ssp-rk3" else {"step": 0.05}),
    }
    model, state = ended(
        scene({"body": turning(straight(rate, 100.0), axis), "b": basin}, {}, 1.0, case), 1.0
    )
    found = model.meshed[0].deviations(state.y)
    assert np.abs(found[1:]).max() < (1e-13 if method == "ssp-rk3" else 1e-10)
    assert found[0] == pytest.approx(model.meshed[0].deviations(model.start)[0], abs=1e-10)


def test_a_box_that_turns_so_fast_that_its_middle_is_dry_rests_too():
    rate = 6.0
    bowl = f"{rate**2 / (2 * GRAVITY)} * ((x - 1)**2 + (y - 1)**2) - 0.6"
    flows = []
    for n in (20, 40):  # cells at the curved shore adjust
        basin = tank((n, n), at=[-1, -1, 0], start={"level": bowl})
        flows.append(np.abs(moved(turning(straight(rate, 100.0)), basin, 1.0)[2][1:]).mean())
    assert flows[1] < 0.5 * flows[0] < 1e-3


def test_a_box_that_decelerates_steadily_has_an_inclined_surface_and_a_tilted_box_a_level_surface():
    slows = 0.2  # x = 10 (1 - (1 - t / 10)^2)
    travel = slowing(slows)
    slope = slows / GRAVITY
    _, _, found = moved(sliding(travel), tank(start={"level": f"0.3 + {slope} * (x - 1)"}), 2.0)
    assert np.abs(found[1:]).max() < 1e-13
    tilt = {"roll": "3 deg", "pitch": "-4 deg", "yaw": "30 deg"}
    held = {**HEAVY, "joint": {"kind": "fixed", "attitude": tilt}}
    model, _, found = moved(held, tank(), 2.0)
    assert np.abs(found[1:]).max() < 1e-13
    assert np.ptp(found[0]) > 0.1
    assert abs(np.sum(found[0])) < 1e-9
    again, _, same = moved({**HEAVY, "joint": {"kind": "fixed"}}, tank(attitude=tilt), 2.0)
    assert same[0] == pytest.approx(found[0], abs=1e-12)


# linear waves ----------


def forced(x, length, w, push, depth=0.3):
    """V(x) [m/s] of u = V cos(w t) under the force per mass push sin(w t) in a closed box, with u = V at the start."""
    k = w / math.sqrt(GRAVITY * depth)
    a = push / w
    return (
        -a
        + a * np.cos(k * x)
        + a * (1.0 - math.cos(k * length)) / math.sin(k * length) * np.sin(k * x)
    )


def start_of(length, w, push, depth=0.3, along="x"):
    k, a = w / math.sqrt(GRAVITY * depth), push / w
    b = a * (1.0 - math.cos(k * length)) / math.sin(k * length)
    return f"{-a} + {a} * cos({k} * {along}) + {b} * sin({k} * {along})"


@pytest.mark.parametrize("way", ["sway", "surge", "roll", "pitch", "heading"])
def test_a_box_that_swings_a_little_has_the_waves_of_the_closed_form(way):
    a, w, length, high = 1e-5, 3.0, 2.0, 1.5
    swing = {"mean": 0.0, "amplitude": a, "period": 2.0 * math.pi / w}
    rolled = a * (GRAVITY + high * w**2)  # gravity along the box, and acceleration of its bed
    push = {
        "sway": a * w**2,
        "surge": a * w**2,
        "heading": a * w**2,
        "roll": -rolled,
        "pitch": rolled,
    }[way]
    along = "y" if way in ("surge", "roll") else "x"
    body = {
        "sway": sliding(swing),
        "surge": sliding(swing, (0, 1, 0)),
        "heading": sliding(swing, (0, 1, 0)),
        "pitch": turning(swing, (0, 1, 0)),
        "roll": turning(swing, (1, 0, 0)),
    }[way]
    errors = []
    for n in (16, 32):
        more = {"start": {"u" if along == "x" else "v": start_of(length, w, push, along=along)}}
        if way in ("roll", "pitch"):
            more["at"] = [-1.0, -1.0, high]
        if way == "heading":
            more["attitude"] = {"yaw": "90 deg"}
        cells, size = ((n, 2), (length, 1.0)) if along == "x" else ((2, n), (1.0, length))
        numerics = {"scheme": "upwind5", "method": "rk4", "step": 0.2 * length / n}
        case = scene({"body": body, "b": tank(cells, size, **more)}, {}, 1.0, numerics)
        model = model_of(case)
        found = model.meshed[0].deviations(advance(model, State(0.0, model.start.copy()), 1.0).y)
        x = model.meshed[0].mesh.centre[:, 0 if along == "x" else 1]
        wanted = 0.3 * forced(x, length, w, push) * math.cos(w)
        errors.append(np.abs(found[1 if along == "x" else 2] - wanted).max() / np.abs(wanted).max())
    assert errors[1] < errors[0] / 3.0
    assert errors[1] < 1e-2


# nonlinear: a fixed bowl in rotating axes ----------


def test_thackers_bowl_seen_from_axes_that_swing_is_the_bowl_that_stands_still():
    h0, a, eta = 0.5, 1.0, 0.25
    w = math.sqrt(2.0 * GRAVITY * h0) / a
    amplitude, period, end = 0.8, 2.0, 1.0

    def depth(x, y, t):
        return eta * h0 / a**2 * (2 * x * math.cos(w * t) + 2 * y * math.sin(w * t) - eta) + h0 * (
            1 - (x**2 + y**2) / a**2
        )

    spin = amplitude * 2.0 * math.pi / period
    swing = {"mean": 0.0, "amplitude": amplitude, "period": period}
    bed = f"{h0 / a**2} * ((x - 2)**2 + (y - 2)**2)"
    start = {
        "level": f"{h0} + {eta * h0 / a**2} * (2 * (x - 2) - {eta})",
        "u": f"{spin} * (y - 2)",
        "v": f"{eta * w} - {spin} * (x - 2)",
    }
    errors = []
    for n in (30, 60):
        basin = tank((n, n), (4.0, 4.0), level=h0, at=[-2.0, -2.0, 0.0], bed=bed, start=start)
        model, _, found = moved(turning(swing), basin, end)
        one = model.meshed[0]
        angle = amplitude * math.sin(2.0 * math.pi * end / period)
        x, y = one.x - 2.0, one.y - 2.0
        east, north = (
            math.cos(angle) * x - math.sin(angle) * y,
            math.sin(angle) * x + math.cos(angle) * y,
        )
        wanted = np.maximum(depth(east, north, end), 0.0)
        errors.append(np.abs(one.depth + found[0] - wanted).sum() / wanted.sum())
    assert errors[1] < errors[0] / 2.0
    assert errors[1] < 2.5e-2


def test_a_tank_that_falls_freely_ends_the_run_by_name():
    rises = sliding(slowing(12.0), (0, 0, 1))
    case = scene({"body": rises, "b": tank((4, 4))}, {}, 1.0, {"scheme": "upwind"}, every=0.1)
    result = run(case)
    assert not result.ok and "the water in b has no weight left" in result.reason


# faults ----------

FAULTS = {
    "has no effect on a body; give the position in the axes of body as `at`": (
        {},
        {"elevation": 1.0},
    ),
    "expected a body: body; did you mean": ({}, {"on": "bdy"}),
    "give the body as `on = BODY`": ({}, {"on": None, "at": [0, 0, 1]}),
    "and the reaction to outflow is not modelled": (
        {"joint": {"kind": "revolute", "axis": [0, 0, 1]}},
        {"patches": {"gap": {"side": "east", "boundary": "open"}}},
    ),
    "cannot be on a body; expected": (
        {},
        {"physics": "transport", "level": None, "velocity": {"u": 0.0, "v": 0.0}},
    ),
    "a basin on a body cannot have moving walls": (
        {},
        {"patches": {"lid": {"side": "east", "travel": 0.1}}},
    ),
    "unknown key": ({}, {"attitude": {"rol": 0.1}}),
}


@pytest.mark.parametrize("text", FAULTS)
def test_features_that_cannot_move_with_a_body_are_refused_by_name(text):
    body, keys = FAULTS[text]
    basin = {key: value for key, value in {**tank(), **keys}.items() if value is not None}
    with pytest.raises(CaseError, match=text):
        load(scene({"body": {**turning(straight(1.0, 100.0)), **body}, "b": basin}, {}, 1.0, {}))


WIDE, LONG, DENSITY, THICKNESS, LEVEL = 4, 3, 998.0, 0.7, 0.25
N = WIDE * LONG


@pytest.mark.parametrize("deep", [True, False])
@pytest.mark.parametrize("grid", [True, False])
def test_moments_are_sums_over_cells(monkeypatch, deep, grid):
    """deep : water with a free surface, else a liquid of constant thickness; grid : rows of cells, else any mesh"""
    for name in ("mass_factor", "row_sums"):
        monkeypatch.setattr(frame_forces, name, getattr(frame_forces, name).py_func)
    random = np.random.default_rng(8)
    columns, lines = random.normal(0.0, 2.0, WIDE), random.normal(0.0, 2.0, LONG)
    x, y = np.tile(columns, LONG), np.repeat(lines, WIDE)
    area, rest, surface = random.uniform(0.5, 2.0, (3, N))
    h, qx, qy, dh, dx, dy = random.normal(0.0, 0.1, (6, N))
    places = np.concatenate([columns, lines] if grid else [x, y])
    frame = np.zeros(1 + max(CELL_POSITIONS, REST_LEVEL, REST_SURFACE))
    frame[REST_LEVEL] = LEVEL
    start = frame.size + places.size
    frame[CELL_POSITIONS], frame[REST_SURFACE] = frame.size, start + 2 * N
    basin = {
        "n": N,
        "y": 0,
        "frame": 0,
        "deep": int(deep),
        "thickness": THICKNESS,
        "area": start,
        "plan": start + N,
        "nx": WIDE if grid else 0,
        "ny": LONG if grid else 0,
    }
    tables = SimpleNamespace(
        plane=np.concatenate([frame, places, area, rest, surface]), settings=[{"rho": DENSITY}]
    )
    found = frame_forces.mass_moments.py_func(
        tables, basin, np.concatenate([h, qx, qy]), np.concatenate([dh, dx, dy]), 0, 0.0, 0.0, 0.0
    )

    per = (DENSITY if deep else THICKNESS) * area
    mass, rate = per * (rest + h), per * dh
    height = surface - rest + LEVEL + 0.5 * (rest + h) if deep else 0.0 * x
    wanted = [
        *(np.sum(mass * one) for one in (np.ones(N), x, y, x * x, x * y, y * y, height)),
        *(np.sum(rate * one) for one in (x, y, x * x, x * y, y * y)),
        *(np.sum(per * one) for one in (qx, qy, x * qy - y * qx, dx, dy, x * dy - y * dx)),
    ]
    assert found == pytest.approx(wanted, rel=1e-12)
