"""Water that moves its body: heave, sway and roll on springs in closed form, momentum, energy, frozen water."""

import math

import numpy as np
import pytest
from reference.basins import cart, model_of
from reference.scenes import GRAVITY, RHO, scene
from scipy.optimize import brentq

from fvsolve import advance, run
from fvsolve.core.model.model import State
from fvsolve.studies.energy_balance import energy

LENGTH, DEPTH = 2.0, 0.1


def tank(n=20, along="x", level=DEPTH, **more):
    cells, size = ((n, 1), (LENGTH, 1.0)) if along == "x" else ((1, n), (1.0, LENGTH))
    return {
        "type": "basin",
        "on": "cart",
        "size": list(size),
        "cells": list(cells),
        "level": level,
        **more,
    }


def sprung(basin, body, stiffness, end, numerics, probes, toward=(5.0, 0, 0), **spring):
    world = {"type": "frame", "points": {"far": list(toward)}}
    links = {
        "spring": {
            "type": "spring",
            "from": "cart",
            "to": "world.far",
            "stiffness": stiffness,
            **spring,
        }
    }
    nodes = {"cart": body, "world": world, "b": basin}
    return scene(
        nodes, links, end, {"scheme": "upwind5", "method": "rk4", **numerics}, probes, every=0.01
    )


@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
def test_water_at_rest_on_a_vertical_spring_swings_as_frozen_mass(method):
    stiff, water = 2e4, RHO * DEPTH * LENGTH
    case = sprung(
        tank(4),
        cart(axis=(0, 0, 1), rate=0.05),
        stiff,
        1.0,
        {"method": method, "step": 2e-3},
        ["cart.z", "b.speed@1,0.5"],
        (0, 0, 9.0),
        preload=-(100.0 + water) * GRAVITY,
    )
    result = run(case)
    w = math.sqrt(stiff / (100.0 + water))
    assert np.abs(result["cart.z"] - 0.05 / w * np.sin(w * result.t)).max() < 1e-6 * 0.05 / w
    assert np.abs(result["b.speed@1,0.5"]).max() < 1e-12


def test_a_tank_at_rest_on_its_spring_does_not_move_by_a_bit():
    preload = -(100.0 + RHO * DEPTH * LENGTH) * GRAVITY
    case = sprung(
        tank(8),
        cart(axis=(0, 0, 1)),
        2e4,
        1.0,
        {"step": 2e-3},
        ["cart.z"],
        (0, 0, 9.0),
        preload=preload,
    )
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
        # cart at speed cos(w t): u of the forced mode relative to the cart
        ratio = math.tan(0.5 * k * LENGTH)
        flow = f"{speed} * (cos({k} * {along}) + {ratio} * sin({k} * {along}) - 1)"
        basin = tank(n, along, start={"u" if along == "x" else "v": flow})
        toward = tuple(5.0 * a for a in axis)
        case = sprung(
            basin,
            cart(mass, axis, rate=speed),
            stiff,
            4.0,
            {"step": 0.1 / n},
            ["cart.rate"],
            toward,
            preload=0.0,
        )
        result = run(case)
        errors.append(np.abs(result["cart.rate"] - speed * np.cos(w * result.t)).max() / speed)
    assert errors[1] < errors[0] / 2.5
    assert errors[1] < 5e-3


def test_a_free_tank_on_rails_conserves_its_momentum():
    basin = tank(30, start={"level": f"{DEPTH} + 0.03 * cos(1.5 * x)"})
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5}
    case = scene({"cart": cart(50.0, rate=0.3), "b": basin}, {}, 2.0, numerics)
    model = model_of(case)
    basin, at = model.meshed[0], model.state_names.index("cart.travel_rate")

    def momentum(y):
        found, area = basin.deviations(y), basin.mesh.area
        v = 0.3 + y[at]
        return 50.0 * v + RHO * np.sum(area * ((basin.depth + found[0]) * v + found[1]))

    state = advance(model, State(0.0, model.start.copy()), 2.0)
    assert abs(state.y[at]) > 1e-3
    assert momentum(state.y) == pytest.approx(momentum(model.start), rel=1e-13)


# energy -----------


def rocking(n=24, **numerics):
    """Return a case of a hull with a transverse tank that rolls on two springs."""
    hull = {
        "type": "body",
        "mass": 400.0,
        "inertia": [800.0, 800.0, 800.0],
        "centre_of_mass": [0, 0, -0.5],
        "points": {"right": [0, 2.0, 0], "left": [0, -2.0, 0]},
        "joint": {"kind": "revolute", "axis": [1, 0, 0], "rate": 0.03},
    }
    basin = {
        "type": "basin",
        "on": "hull",
        "at": [-0.5, -1.0, 0.4],
        "size": [1.0, 2.0],
        "cells": [1, n],
        "level": 0.1,
    }
    world = {"type": "frame", "points": {"right": [0, 2.0, -3.0], "left": [0, -2.0, -3.0]}}
    links = {
        side: {
            "type": "spring",
            "from": f"world.{side}",
            "to": f"hull.{side}",
            "stiffness": 400.0,
            "preload": 0.0,
        }
        for side in ("right", "left")
    }
    nodes = {"hull": hull, "world": world, "b": basin}
    return scene(
        nodes,
        links,
        2.0,
        {"scheme": "muscl", "method": "ssp-rk3", **numerics},
        ["hull.angle"],
        every=0.02,
    )


def test_energy_of_a_hull_and_its_water_is_lost_by_the_scheme_alone_and_never_created():
    parts = []
    for step in (4e-3, 2e-3):
        found = energy(rocking(step=step))
        swung = 0.5 * 800.0 * 0.03**2
        scheme = sum(found.scheme.values())
        assert (np.diff(scheme) > -1e-6 * swung).all()
        assert scheme[-1] < 0.1 * swung
        parts.append(abs(found.step[-1]) / swung)
    assert parts[1] < parts[0] / 5.0 and parts[1] < 1e-4


def test_work_on_a_driven_tank_is_the_gain_and_the_loss_of_its_water():
    body = {
        "type": "body",
        "mass": 50.0,
        "inertia": [5.0, 5.0, 5.0],
        "joint": {
            "kind": "revolute",
            "axis": [0, 1, 0],
            "angle": {"mean": 0, "amplitude": 0.03, "period": 1.7},
        },
    }
    basin = {
        "type": "basin",
        "on": "cart",
        "at": [-1, -0.5, 0.6],
        "size": [2.0, 1.0],
        "cells": [30, 2],
        "level": 0.2,
    }
    case = scene(
        {"cart": body, "b": basin}, {}, 1.6, {"scheme": "muscl", "method": "ssp-rk3", "step": 2e-3}
    )
    found = energy(case)
    passed = max(np.abs(one).max() for one in found.supplied.values())
    assert passed > 1.0
    assert abs(found.step[-1]) < 1e-4 * passed
    assert 0.0 <= sum(found.scheme.values())[-1] < 0.1 * passed


# frozen -----------


def test_frozen_water_is_the_body_that_weighs_as_much():
    """Frozen water of 2 m x 1 m x 0.1 m at an angle on its body equals a body with its mass and inertia."""
    turn = {"yaw": "30 deg", "roll": "10 deg"}
    hull = {
        "type": "body",
        "mass": 300.0,
        "inertia": [30.0, 60.0, 70.0],
        "centre_of_mass": [0.1, 0.0, -0.2],
        "joint": {"kind": "revolute", "axis": [0, 1, 0], "angle": 0.3},
    }
    basin = {
        **tank(8),
        "on": "hull",
        "at": [0.3, -0.2, -1.0],
        "attitude": turn,
        "sloshing": "frozen",
    }
    block = {
        "type": "body", "mass": 200.0, "centre_of_mass": [1.0, 0.5, 0.05],
        "inertia": [200.0 * (1 + 0.01) / 12, 200.0 * (4 + 0.01) / 12, 200.0 * 5 / 12],
        "joint": {"kind": "fixed", "on": "hull", "at": [0.3, -0.2, -1.0], "attitude": turn},
    }  # fmt: skip
    numerics = {"method": "rk4", "step": 0.01}
    one = run(scene({"hull": hull, "b": basin}, {}, 2.0, numerics, ["hull.angle"]))
    two = run(scene({"hull": hull, "block": block}, {}, 2.0, numerics, ["hull.angle"]))
    assert one["hull.angle"] == pytest.approx(two["hull.angle"], abs=1e-12)
    assert np.ptp(one["hull.angle"]) > 0.3


def test_in_heave_cells_and_frozen_water_are_equal():
    case = sprung(
        {**tank(1), "sloshing": "cells"},
        cart(axis=(0, 0, 1), rate=0.05),
        2e4,
        1.0,
        {"step": 2e-3},
        ["cart.z"],
        (0, 0, 9.0),
        preload=-300.0 * GRAVITY,
    )
    cells = run(case)
    case["nodes"]["b"]["sloshing"] = "frozen"
    assert run(case)["cart.z"] == pytest.approx(cells["cart.z"], abs=1e-12)


# roll -----------


@pytest.mark.parametrize("high", [0.6, -0.4])
def test_a_hull_rolls_with_its_tank_at_the_root_of_the_closed_form(high):
    """-w^2 (I + I_f) + K - m g z_m + m (z_b w^2 + g)^2 / w^2 (1 - tan(s) / s) = 0, s = w L / (2 c)."""
    inertia, stiff, depth = 900.0, 2e4, 0.2
    c, water = math.sqrt(GRAVITY * depth), RHO * depth * LENGTH
    frozen, middle = water * (LENGTH**2 / 12.0 + high**2), high + 0.5 * depth

    def law(w):
        s = 0.5 * w * LENGTH / c
        slosh = water * (high * w * w + GRAVITY) ** 2 / (w * w) * (1.0 - math.tan(s) / s)
        return -w * w * (inertia + frozen) + stiff - water * GRAVITY * middle + slosh

    w = brentq(law, 0.3, 0.98 * math.pi * c / LENGTH)
    a, k = 1e-5, w / c
    push = -a * (GRAVITY + high * w * w) / w
    tilt = push * (1.0 - math.cos(k * LENGTH)) / math.sin(k * LENGTH)
    errors = []
    for n in (20, 40):
        hull = {
            "type": "body",
            "mass": 100.0,
            "inertia": [inertia, 500.0, 600.0],
            "points": {"pin": [0, 0, 0]},
            "joint": {"kind": "revolute", "axis": [1, 0, 0], "rate": a * w},
        }
        basin = {
            "type": "basin",
            "on": "hull",
            "at": [-0.5, -0.5 * LENGTH, high],
            "size": [1.0, LENGTH],
            "cells": [1, n],
            "level": depth,
            "start": {"v": f"{-push} + {push} * cos({k} * y) + {tilt} * sin({k} * y)"},
        }
        world = {"type": "frame", "points": {"pin": [0, 0, 0]}}
        links = {
            "twist": {
                "type": "bushing",
                "from": "world.pin",
                "to": "hull.pin",
                "stiffness": 1e3,
                "rotational_stiffness": stiff,
            }
        }
        case = scene(
            {"hull": hull, "world": world, "b": basin},
            links,
            3.0,
            {"scheme": "upwind5", "method": "rk4", "step": 0.08 / n},
            ["hull.angle"],
            every=0.02,
        )
        result = run(case)
        errors.append(np.abs(result["hull.angle"] - a * np.sin(w * result.t)).max() / a)
    assert errors[1] < errors[0] / 2.5
    assert errors[1] < 1e-2


def test_a_joint_holds_nothing_of_the_water_where_it_lets_its_body_move():
    hung = {
        "type": "body",
        "mass": 300.0,
        "inertia": [80.0, 60.0, 90.0],
        "centre_of_mass": [0.1, 0.2, -0.5],
        "joint": {
            "kind": "ball",
            "attitude": {"roll": 0.03, "yaw": 0.5},
            "rate": [0.02, -0.03, 0.1],
        },
    }
    heaves = cart(axis=(0, 0, 1), rate=0.05)
    held = {
        "tx ty tz": (hung, tank(8, at=[-0.7, -0.2, -0.4], attitude={"roll": 0.05})),
        "fz": (heaves, tank(4)),
    }
    for free, (body, basin) in held.items():
        probes = [f"cart.joint_{one}{axis}" for one in "ft" for axis in "xyz"]
        numerics = {"scheme": "muscl", "method": "rk4", "courant": 0.5}
        result = run(scene({"cart": body, "b": basin}, {}, 0.3, numerics, probes, every=0.01))
        size = max(np.abs(result[one]).max() for one in probes[:3]) + 1e3
        for one in free.split():
            assert np.abs(result[f"cart.joint_{one}"]).max() < 1e-11 * size, one
