"""Moving walls of basins: closed forms, conservation, forces, bodies, limits, equivalent cases, transport theorem."""

import math

import numpy as np
import pytest
from reference.basins import SIDES, ended, model_of, straight
from reference.scenes import GRAVITY, RHO, scene
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from fvsolve import advance, run
from fvsolve.core.model.model import State
from fvsolve.studies.energy_balance import energy

STEPPED = {"scheme": "muscl", "limiter": "minmod", "method": "ssp-rk2"}


def flume(
    patches, cells=50, wide=2, length=2.0, side="east", level=1.0, physics="free-surface", **more
):
    """Return a basin 2 m long in the direction of the wall on a side, and 1 m wide."""
    along = side in ("west", "east")
    size, many = ([length, 1.0], [cells, wide]) if along else ([1.0, length], [wide, cells])
    shape = {"type": "basin", "physics": physics, "size": size, "cells": many}
    return {**shape, "level": level, "patches": patches, **more}


# closed forms ----------


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "method", ["euler", "ssp-rk2", "rk4", "implicit-midpoint", "gauss-4", "rodas-4"]
)
@pytest.mark.parametrize("side", ["east", "north"])
def test_homologous_expansion_is_exact_to_round_off_under_every_method(method, side):
    rate, n = 0.4, 20
    velocity = "u" if side == "east" else "v"
    start = {velocity: f"{rate} * {'x' if side == 'east' else 'y'}"}
    nodes = {
        "b": flume(
            {"lid": {"side": side, "travel": straight(2.0 * rate)}}, n, side=side, start=start
        )
    }
    model, state = ended(scene(nodes, {}, 1.0, {**STEPPED, "method": method, "step": 5e-3}), 1.0)
    basin = model.meshed[0]
    found, x = (
        basin.deviations(state.y),
        (basin.mesh.centre[:, 0 if side == "east" else 1]) * (1.0 + rate),
    )
    # Rosenbrock methods have a Jacobian by differences
    close = 1e-10 if method == "rodas-4" else 1e-13
    assert 1.0 + found[0] == pytest.approx(1.0 / (1.0 + rate), abs=close)
    flow = found[1 if side == "east" else 2] / (1.0 + found[0])
    assert flow == pytest.approx(rate * x / (1.0 + rate), abs=close)
    assert abs(model.contents(state.y)[1]) < 1e-12 * model.contents(state.y)[0]


@pytest.mark.in_turn
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_wall_that_is_pushed_in_sends_out_the_exact_shock_and_does_its_work(side, scheme):
    speed, sign = 0.8, 1.0 if side in ("west", "south") else -1.0
    nodes = {
        "b": flume(
            {"lid": {"side": side, "travel": straight(sign * speed, 0.5)}}, 100, 1, side=side
        )
    }
    case = scene(
        nodes,
        {},
        0.3,
        {"scheme": scheme, "method": "ssp-rk2", "courant": 0.8},
        ["b.lid.force", "b.lid.power", "b.lid.travel"],
        every=0.02,
    )
    depth = brentq(lambda h: (h - 1.0) * math.sqrt(0.5 * GRAVITY * (h + 1.0) / h) - speed, 1.0, 3.0)
    force = 0.5 * RHO * GRAVITY * depth**2
    result = run(case)
    close = 1e-3 if scheme == "upwind" else 1e-4  # error of the sudden start of the wall
    assert result["b.lid.force"][-1] == pytest.approx(force, rel=close)
    assert result["b.lid.power"][-1] == pytest.approx(force * speed, rel=close)
    assert result["b.lid.travel"][-1] == pytest.approx(sign * speed * 0.3, rel=1e-13)


def test_a_wall_drawn_out_makes_a_simple_wave_and_faster_than_twice_the_waves_a_dry_wall():
    c = math.sqrt(GRAVITY)
    for speed in (0.5, 2.5 * c):
        nodes = {
            "b": flume({"lid": {"side": "east", "travel": straight(speed), "zone": 1.0}}, 200, 1)
        }
        model, state = ended(
            scene(nodes, {}, 0.15, {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.5}), 0.15
        )
        depth = 1.0 + model.meshed[0].deviations(state.y)[0][-1]
        wanted = max(1.0 - 0.5 * speed / c, 0.0) ** 2
        assert depth == pytest.approx(wanted, abs=4e-3)
        assert 1.0 + model.meshed[0].deviations(state.y)[0].min() >= 0.0


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
        links = {
            "spring": {
                "type": "spring",
                "from": "lid",
                "to": "ground",
                "stiffness": stiff,
                "preload": rest,
            }
        }
        numerics = {"scheme": "upwind5", "method": method, "step": 0.2 * length / n / c}
        result = run(scene(nodes, links, 4.0 * math.pi / w, numerics, ["lid.velocity"], every=0.01))
        wanted = 1e-4 * np.cos(w * result.t)
        errors.append(np.abs(result["lid.velocity"] - wanted).max() / 1e-4)
    assert errors[1] < 0.3 * errors[0]
    assert errors[1] < 4e-3


# scalars, and walls on masses ----------


@pytest.mark.parametrize(
    "method, scheme",
    [
        ("radau-iia-3", "upwind"),
        ("ssp-rk3", "muscl"),
        ("radau-iia-3", "muscl"),
        ("ssp-rk3", "weno5"),
    ],
)
def test_uniform_values_stay_uniform_and_amounts_and_mass_are_conserved_between_oscillating_walls(
    scheme, method
):
    swings = {"mean": 0.1, "amplitude": 0.25, "period": 1.1, "phase": 0.4}
    patches = {
        "left": {"side": "west", "travel": swings, "zone": 0.9},
        "right": {"side": "east", "travel": straight(-0.3)},
    }
    more = {"start": {"level": "1 + 0.1 * cos(3 * x) * cos(2 * y)", "u": "0.2 * x", "v": "0.1 * y"}}
    cells = (24, 4) if method == "ssp-rk3" else (12, 2)
    nodes = {"b": flume(patches, *cells, **more, scalars={"even": 3.0, "patchy": "1 + x"})}
    scalars = {"even": {"initial": 3.0}, "patchy": {"initial": 1.0}}
    step = {"courant": 0.5} if method == "ssp-rk3" else {"step": 0.01}
    case = scene(nodes, {}, 0.8, {"scheme": scheme, "method": method, **step}, scalars=scalars)
    model, state = ended(case, 0.8)
    basin = model.meshed[0]
    values = basin.values(state.y)
    close = 1e-12 if method == "ssp-rk3" else 1e-8
    assert values["even"] == pytest.approx(3.0, abs=close)
    held = basin.mass_per_depth()
    for first, last in zip(basin.amounts(model.start), basin.amounts(state.y), strict=True):
        assert np.sum(held * last) == pytest.approx(np.sum(held * first), rel=close)
    mass, change = model.contents(state.y)
    assert abs(change) < close * mass
    assert np.ptp(values["patchy"]) > 0.5


@pytest.mark.in_turn
@pytest.mark.parametrize("cells", [(8, 1), (8, 2), (2, 8), (1, 8), (2, 2)])
@pytest.mark.parametrize("scheme", ["upwind5", "weno5"])
@pytest.mark.parametrize("method", ["ssp-rk3", "radau-iia-3"])
def test_no_water_flows_through_the_walls_of_a_basin_of_1_or_2_cells_across(cells, scheme, method):
    """Ghost cells of one or two cells are not exact mirror images."""
    start = {"level": "1 + 0.1 * cos(3 * x) * cos(2 * y)", "u": "0.2 * x", "v": "0.1 * y"}
    nodes = {"b": flume({}, *cells, start=start, scalars={"even": 3.0})}
    case = scene(
        nodes,
        {},
        0.1,
        {"scheme": scheme, "method": method, "step": 0.01},
        scalars={"even": {"initial": 3.0}},
    )
    model, state = ended(case, 0.1)
    assert model.meshed[0].values(state.y)["even"] == pytest.approx(3.0, abs=1e-9)
    mass, change = model.contents(state.y)
    assert abs(change) < 1e-12 * mass and np.abs(state.y).max() > 0.01


def mass_and_spring(
    patches, mass, stiff, rest, n=40, start=None, numerics=None, end=1.0, probes=(), **more
):
    nodes = {
        "b": flume(patches, n, 1, **({"start": start} if start else {}), **more),
        "lid": mass,
        "ground": {"type": "frame"},
    }
    links = {
        "spring": {
            "type": "spring",
            "from": "lid",
            "to": "ground",
            "stiffness": stiff,
            "preload": rest,
        }
    }
    return scene(
        nodes,
        links,
        end,
        {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5, **(numerics or {})},
        probes,
    )


def test_water_at_rest_before_a_wall_that_a_spring_holds_does_not_move_by_a_bit():
    rest = 0.5 * RHO * GRAVITY
    case = mass_and_spring(
        {"lid": {"side": "east", "body": "lid"}}, {"type": "mass", "mass": 10.0}, 9e3, rest, end=2.0
    )
    model, state = ended(case, 2.0)
    assert not state.y.any()


def test_two_basins_that_share_a_bulkhead_level_out_and_push_it_from_both_sides():
    nodes = {
        "left": flume({"wall-a": {"side": "east", "body": "head"}}, 30, 1, level=1.2),
        "right": flume({"wall-b": {"side": "west", "body": "head"}}, 30, 1, level=1.0),
        "head": {"type": "mass", "mass": 400.0},
        "ground": {"type": "frame"},
    }
    links = {
        "spring": {"type": "spring", "from": "head", "to": "ground", "stiffness": 4e3},
        "brake": {"type": "damper", "from": "head", "to": "ground", "damping": 6e3},
    }
    probes = [
        "head.position",
        "left.wall-a.force",
        "right.wall-b.force",
        "left.wall-a.travel",
        "right.wall-b.travel",
    ]
    result = run(
        scene(
            nodes,
            links,
            40.0,
            {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.7},
            probes,
            every=0.5,
        )
    )

    def balance(x):
        left, right = 1.2 * 2.0 / (2.0 + x), 1.0 * 2.0 / (2.0 - x)
        return 0.5 * RHO * GRAVITY * (left**2 - right**2) - 4e3 * x

    x = brentq(balance, 0.0, 1.0)
    assert result["head.position"][-1] == pytest.approx(x, rel=2e-3)
    assert np.array_equal(result["left.wall-a.travel"], result["right.wall-b.travel"])
    assert result["left.wall-a.travel"] == pytest.approx(result["head.position"], abs=1e-12)
    assert result.ok


@pytest.mark.parametrize("mass", [1.0, 10.0])
def test_a_light_wall_limits_the_step_exactly_where_lambda_dt_does(mass):
    rate = RHO * math.sqrt(GRAVITY) / mass  # rho c h W / M
    push = {"mass": mass, "type": "mass", "initial_velocity": 1e-6}
    ends = {}
    for factor in (2.45, 2.58):  # the limit of ssp-rk3 is 2.513
        case = mass_and_spring(
            {"lid": {"side": "east", "body": "lid"}},
            push,
            1.0,
            0.5 * RHO * GRAVITY,
            n=4,
            numerics={"courant": None, "step": factor / rate, "limiter": "minmod"},
            end=400 * factor / rate,
            probes=["lid.velocity"],
        )
        case["numerics"].pop("courant")
        result = run(case)
        ends[factor] = np.abs(result["lid.velocity"][np.isfinite(result["lid.velocity"])]).max()
    assert ends[2.45] < 2e-6
    assert ends[2.58] > 1e-4


def test_courant_numbers_count_a_light_wall():
    case = mass_and_spring(
        {"lid": {"side": "east", "body": "lid"}},
        {"type": "mass", "mass": 1.0, "initial_velocity": 1e-3},
        1.0,
        0.5 * RHO * GRAVITY,
        n=4,
        numerics={"courant": 0.9},
        end=0.05,
        probes=["lid.velocity"],
    )
    assert np.abs(run(case)["lid.velocity"]).max() < 1.001e-3


def test_a_wall_that_uses_up_its_zone_ends_the_run_by_name():
    case = mass_and_spring(
        {"lid": {"side": "east", "body": "lid", "zone": 0.2}},
        {"type": "mass", "mass": 1e4, "initial_velocity": -2.0},
        1.0,
        0.0,
    )
    result = run(case)
    assert not result.ok
    assert "the wall has no space left at b.lid" in result.reason and "end-stop" in result.reason


# a link at a side along which grid lines move ----------


def test_a_tank_that_joins_a_patch_on_a_side_that_stretches_follows_the_depth_and_nothing_is_lost():
    patches = {
        "lid": {"side": "east", "travel": {"start": 0.0, "duration": 20.0, "value": [0.0, -0.8]}},
        "gate": {"side": "south"},
    }
    nodes = {"b": flume(patches, 20, 4), "t": {"type": "tank", "area": 0.5, "level": 1.0}}
    links = {"v": {"type": "valve", "from": "b.gate", "to": "t", "area": 0.05}}
    case = scene(
        nodes,
        links,
        25.0,
        {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.8},
        ["t.level", "b.gate.pressure"],
        every=1.0,
    )
    result = run(case)
    level = 1.0 * (2.0 + 0.5) / (1.2 + 0.5)
    assert result["t.level"][-1] == pytest.approx(level, abs=2e-3)
    assert abs(result.ledger["mass"]["remainder"]) < 1e-9 * 2500.0


# equivalent cases ----------


TURNS = {"east": "south", "north": "east", "west": "north", "south": "west"}  # wall -> gate


def test_a_rotated_flume_fills_a_tank_through_its_gate_alike():
    """The gate lies on a side that stretches, along x and along y."""
    found = []
    for side, gate in TURNS.items():
        sign = 1.0 if side in ("west", "south") else -1.0
        patches = {
            "lid": {
                "side": side,
                "travel": {"start": 0.0, "duration": 4.0, "value": [0.0, 0.8 * sign]},
            },
            "gate": {"side": gate},
        }
        nodes = {
            "b": flume(patches, 20, 4, side=side),
            "t": {"type": "tank", "area": 0.5, "level": 0.5},
        }
        links = {"v": {"type": "valve", "from": "b.gate", "to": "t", "area": 0.05}}
        numerics = {"scheme": "muscl", "method": "ssp-rk2", "step": 0.01}
        case = scene(nodes, links, 5.0, numerics, ["t.level", "b.gate.pressure"], every=0.5)
        result = run(case)
        found.append(np.column_stack([result["t.level"], result["b.gate.pressure"] / 1e4]))
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-11)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
def test_a_rotated_or_mirrored_flume_has_the_same_results_to_the_bit(scheme):
    found = []
    for side, sign in (("west", 1.0), ("east", -1.0), ("south", 1.0), ("north", -1.0)):
        travel = {"mean": 0.0, "amplitude": sign * 0.1, "period": 1.5}
        nodes = {
            "b": flume({"lid": {"side": side, "travel": travel, "zone": 0.7}}, 24, 3, side=side)
        }
        case = scene(
            nodes,
            {},
            1.0,
            {"scheme": scheme, "method": "ssp-rk3", "step": 0.01},
            ["b.lid.force", "b.lid.power"],
            every=0.1,
        )
        result = run(case)
        found.append(np.column_stack([result["b.lid.force"], result["b.lid.power"]]))
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-12, abs=1e-9)


def test_a_mass_that_moves_as_a_travel_does_drives_the_water_alike():
    speed = 0.3
    wall = flume({"lid": {"side": "west", "travel": straight(speed, 1.0)}}, 30, 1)
    other = flume({"lid": {"side": "west", "body": "lid"}}, 30, 1)
    heavy = {"type": "mass", "mass": 1e15, "initial_velocity": speed}
    numerics = {"scheme": "muscl", "method": "ssp-rk2", "step": 0.005}
    links = {"brake": {"type": "damper", "from": "lid", "to": "ground", "damping": 1.0}}
    one = run(scene({"b": wall}, {}, 0.5, numerics, ["b.lid.force"], every=0.05))
    two = run(
        scene(
            {"b": other, "lid": heavy, "ground": {"type": "frame"}},
            links,
            0.5,
            numerics,
            ["b.lid.force"],
            every=0.05,
        )
    )
    # the travel starts at rest
    assert two["b.lid.force"][1:] == pytest.approx(one["b.lid.force"][1:], rel=1e-9)


# order, energy ----------


@pytest.mark.parametrize(("scheme", "order"), [("upwind", 1.0), ("muscl", 2.0), ("upwind5", 2.0)])
def test_waves_of_a_small_swing_come_out_to_the_order_of_the_scheme(scheme, order):
    """For the travel a sin(w t), u = a w cos(w t) sin(k x) / sin(k L), which is also the start."""
    a, w, length = 1e-5, 2.0, 2.0
    k = w / math.sqrt(GRAVITY)
    errors = []
    for n in (16, 32, 64):
        travel = {"mean": 0.0, "amplitude": a, "period": 2.0 * math.pi / w}
        start = {"u": f"{a * w / math.sin(k * length)} * sin({k} * x)"}
        nodes = {"b": flume({"lid": {"side": "east", "travel": travel}}, n, 1, start=start)}
        limiter = {"limiter": "van-leer"} if scheme == "muscl" else {}
        case = scene(
            nodes, {}, 1.0, {"scheme": scheme, "method": "rk4", "step": 0.25 / n, **limiter}
        )
        model, state = ended(case, 1.0)
        basin = model.meshed[0]
        x = basin.mesh.centre[:, 0]
        wanted = a * w * math.cos(w) * np.sin(k * x) / math.sin(k * length)
        errors.append(np.abs(basin.deviations(state.y)[1] - wanted).mean() / (a * w))
    assert math.log2(errors[1] / errors[2]) > order - 0.25


@pytest.mark.parametrize("body", [False, True])
def test_the_ledger_of_energy_has_the_work_of_the_wall_and_its_step_part_falls_with_the_step(body):
    parts = []
    for step in (8e-3, 4e-3):
        if body:
            case = mass_and_spring(
                {"lid": {"side": "east", "body": "lid"}},
                {"type": "mass", "mass": 500.0, "initial_velocity": 0.3},
                9e3,
                0.5 * RHO * GRAVITY,
                n=20,
                end=1.6,
            )
        else:
            swings = {"mean": 0.0, "amplitude": 0.1, "period": 2.0}
            nodes = {"b": flume({"lid": {"side": "east", "travel": swings, "zone": 1.0}}, 20, 2)}
            case = scene(nodes, {}, 1.6, {})
        case["numerics"] = {"end": 1.6, "scheme": "muscl", "method": "ssp-rk3", "step": step}
        found = energy(case)
        passed = 0.5 * 500.0 * 0.3**2 if body else np.abs(found.supplied["b.lid"]).max()
        assert (np.diff(sum(found.scheme.values())) > -1e-9 * passed).all()
        parts.append(abs(found.step[-1]) / passed)
    assert parts[1] < parts[0] / 5.0
    assert parts[1] < 1e-3


@pytest.mark.in_turn
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("toward", [1.0, -1.0])
def test_a_body_on_a_prismatic_joint_takes_a_wall_along_as_a_mass_does(side, toward):
    """A piston on a spring has equal results as a mass on the axis and as a body that slides either way along it."""
    axis = [0.0, 0.0, 0.0]
    axis[0 if side in ("west", "east") else 1] = toward
    out = 1.0 if side in ("east", "north") else -1.0
    rest, stiff = 0.5 * RHO * GRAVITY, 9e3
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "step": 0.004}
    wall = {"lid": {"side": side, "body": "lid"}}
    one = {
        "b": flume(wall, 20, 1, side=side),
        "lid": {"type": "mass", "mass": 500.0, "initial_velocity": 0.2},
        "ground": {"type": "frame"},
    }
    spring = {
        "type": "spring",
        "from": "lid",
        "to": "ground",
        "stiffness": stiff,
        "preload": out * rest,
    }
    mass = run(
        scene(
            one, {"spring": spring}, 1.0, numerics, ["b.lid.force", "b.lid.power", "b.lid.travel"]
        )
    )
    slides = {"kind": "prismatic", "axis": axis, "rate": 0.2 * toward}
    far = [0.0, 0.0, 0.0]
    far[0 if side in ("west", "east") else 1] = 4.0 * out
    other = {
        "b": flume(wall, 20, 1, side=side),
        "world": {"type": "frame", "points": {"far": far}},
        "lid": {"type": "body", "mass": 500.0, "inertia": [1.0, 1.0, 1.0], "joint": slides},
    }
    stay = {"type": "spring", "from": "lid", "to": "world.far", "stiffness": stiff, "preload": rest}
    body = run(
        scene(other, {"stay": stay}, 1.0, numerics, ["b.lid.force", "b.lid.power", "b.lid.travel"])
    )
    for probe in ("b.lid.travel", "b.lid.force", "b.lid.power"):
        assert body[probe] == pytest.approx(mass[probe], rel=1e-9, abs=1e-9)
    assert np.ptp(mass["b.lid.travel"]) > 0.02


def test_a_driven_body_takes_a_wall_along_as_its_travel_would():
    swing = {"mean": 0.0, "amplitude": 0.1, "period": 1.5}
    board = {
        "type": "body",
        "mass": 5.0,
        "inertia": [1.0, 1.0, 1.0],
        "joint": {"kind": "prismatic", "axis": [1, 0, 0], "travel": swing},
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "step": 0.005}
    probes = ["b.lid.force", "b.lid.power", "b.lid.travel"]
    one = run(
        scene(
            {"b": flume({"lid": {"side": "west", "travel": swing}}, 20, 1)},
            {},
            1.0,
            numerics,
            probes,
        )
    )
    two = scene(
        {"b": flume({"lid": {"side": "west", "body": "board"}}, 20, 1), "board": board},
        {},
        1.0,
        numerics,
        [*probes, "board.joint_fx"],
    )
    found = run(two)
    for probe in probes:
        assert np.array_equal(found[probe], one[probe])
    w = 2.0 * math.pi / 1.5
    # m a, and the force of the water
    asked = 5.0 * -0.1 * w * w * np.sin(w * found.t) + found["b.lid.force"]
    assert np.abs(found["board.joint_fx"]) == pytest.approx(np.abs(asked), rel=1e-6, abs=1.0)


LENGTH, RATE, T, D = 2.0, 0.3, 0.4, 2e-3


def run_up(cells: int):
    """Return (model, states just before, at and after T) of a wave in a flume with an oscillating east wall."""
    travel = {"mean": 0.0, "amplitude": RATE, "period": 2.0}
    basin = {
        "type": "basin",
        "size": [LENGTH, 1.0],
        "cells": [cells, 1],
        "level": 1.0,
        "start": {
            "level": f"1 + 0.02 * cos({math.pi / LENGTH} * x)",
            "u": f"{RATE * math.pi / LENGTH} * x",
        },
        "patches": {"lid": {"side": "east", "travel": travel}},
    }
    model = model_of(
        scene({"b": basin}, {}, 1.0, {"scheme": "upwind5", "method": "rk4", "step": 2e-4})
    )
    states = [State(0.0, model.start.copy())]
    for until in (T - D, T, T + D):
        states.append(advance(model, states[-1], until))
    return model, states[1:]


def held(model, state) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (grid lines, volume of water west of each line, depth and velocity at inner lines)."""
    depth, flow, _ = model.meshed[0].deviations(state.y)[:3]
    depth, n = 1.0 + depth, len(depth)
    lines = np.linspace(0.0, LENGTH + RATE * math.sin(math.pi * state.t), n + 1)
    contents = np.concatenate([[0.0], np.cumsum(depth * np.diff(lines))])

    def at_lines(mean):
        # fourth order, lines 2 to n - 2
        return (7 * (mean[1:-2] + mean[2:-1]) - mean[:-3] - mean[3:]) / 12

    return lines, contents, at_lines(depth), at_lines(flow) / at_lines(depth)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_the_terms_of_a_volume_up_to_a_line_that_moves(share):
    errors = []
    for cells in (20, 40):
        model, states = run_up(cells)
        before, now, after = (held(model, state) for state in states)
        m = round(share * cells)
        lines, _, depth, velocity = now
        speed = RATE * math.pi * math.cos(math.pi * T) * m / cells
        whole = (after[1][m] - before[1][m]) / (2 * D)
        inside = sum(
            sign * CubicSpline(*one[:2])(lines[m]) for sign, one in ((1, after), (-1, before))
        ) / (2 * D)
        swept = depth[m - 2] * speed
        flux = depth[m - 2] * velocity[m - 2]
        assert abs(swept) > 0.05 and abs(inside) > 0.05  # not negligible
        # (71), (76), (77)
        errors.append([abs(whole - inside - swept), abs(inside + flux), abs(whole + flux - swept)])
    assert max(errors[1]) < 1e-5
    assert errors[1][2] < 0.2 * errors[0][2]
