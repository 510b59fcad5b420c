"""Tanks that drain, equalise and reverse their flow against closed forms, also beyond finite times of emptying.

Tanks with a connection: extremes of a mass oscillation with friction and throttle.
"""

import math

import numpy as np
import pytest
from reference import scenes, vessels
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    WATER,
    area,
    lake,
    pipe,
    reservoir,
    scene,
    tank,
    valve,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.studies.energy_balance import energy

CLOSE = {"method": "dormand-prince", "rtol": 1e-9}
OUTLET = 0.01
NU = 1e-6
# (numerics, tolerance of the level [m]); the default tolerance is 1e-6 of the deviation per step
SETTINGS = [(CLOSE, 1e-6), ({}, 1e-5), ({"method": "rk4", "step": 0.02}, 1e-6)]


def laminar_flow(flow_area: float) -> float:
    """Flow at Reynolds number 10 through a valve of `scenes.valve` [m3/s]."""
    diameter = math.sqrt(4 / math.pi * flow_area / 0.61)
    return 10.0 * NU * diameter * math.pi / 4


def drained(section, level: float, end: float, numerics: dict = CLOSE, **outlet):
    nodes = {"basin": tank(section, level), "air": reservoir(AMBIENT)}
    links = {"hole": valve("basin", "air", OUTLET, **outlet)}
    return fvsolve.run(scene(nodes, links, end, numerics, ["basin.level", "hole.flow"], 1.0))


@pytest.mark.parametrize("numerics, near", SETTINGS, ids=["tight", "default", "fixed step"])
def test_a_prism_drains_in_finite_time_and_stays_empty(numerics, near):
    section, level = 2.0, 1.5
    emptied = 2 * section * math.sqrt(level) / (OUTLET * math.sqrt(2 * GRAVITY))
    result = drained(section, level, emptied + 60.0, numerics)
    assert result.ok
    assert result["basin.level"] == pytest.approx(
        vessels.prism(section, OUTLET, level, result.t), abs=near
    )


@pytest.mark.parametrize(
    "foot, growth", [(0.5, 1.5), (3.0, -1.0), (0.01, 2.0)], ids=["funnel", "dome", "near a point"]
)
def test_a_shaped_tank_drains_as_its_closed_form(foot, growth):
    level = 2.0
    section = {"level": [0.0, 2.5], "area": [foot, foot + 2.5 * growth]}
    emptied = (2 * foot * math.sqrt(level) + 2 / 3 * growth * level**1.5) / (
        OUTLET * math.sqrt(2 * GRAVITY)
    )
    result = drained(section, level, emptied + 5.0)
    exact = vessels.tapered(foot, growth, OUTLET, level, np.asarray(result.t))
    assert result["basin.level"] == pytest.approx(exact, abs=1e-6)


def test_the_flow_out_is_torricelli_s():
    result = drained(2.0, 1.5, 50.0)
    speed = np.sqrt(2 * GRAVITY * result["basin.level"])
    assert result["hole.flow"] == pytest.approx(OUTLET * speed, rel=1e-9)


@pytest.mark.parametrize("numerics, near", SETTINGS, ids=["tight", "default", "fixed step"])
@pytest.mark.parametrize("levels", [(3.0, 1.0), (0.5, 2.0)], ids=["down", "up"])
def test_two_tanks_level_in_finite_time_and_rest(levels, numerics, near):
    areas, flow_area = (2.0, 3.0), 0.02
    nodes = {"one": tank(areas[0], levels[0]), "two": tank(areas[1], levels[1])}
    links = {"gap": valve("one", "two", flow_area)}
    slope = flow_area * math.sqrt(2 * GRAVITY) * (1 / areas[0] + 1 / areas[1])
    drop = abs(levels[0] - levels[1])
    end = 2 * math.sqrt(drop) / slope + 60.0
    result = fvsolve.run(
        scene(nodes, links, end, numerics, ["one.level", "two.level", "gap.flow"], 1.0)
    )
    left = vessels.levelling(areas, flow_area, drop, result.t) * math.copysign(
        1, levels[0] - levels[1]
    )
    mean = (areas[0] * levels[0] + areas[1] * levels[1]) / sum(areas)
    assert result.ok
    assert result["one.level"] == pytest.approx(mean + left * areas[1] / sum(areas), abs=near)
    assert result["two.level"] == pytest.approx(mean - left * areas[0] / sum(areas), abs=near)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("numerics, drop", [(CLOSE, 0.0), ({}, 1e-7)], ids=["tight", "default"])
def test_levelled_tanks_stay_within_the_laminar_width_and_do_not_chatter(numerics, drop):
    """By default within the tolerance of the levels, 1e-6 of 0.1 m; fixed explicit steps do not ensure this."""
    nodes = {"one": tank(2.0, 1.5), "two": tank(3.0, 1.0), "air": reservoir(AMBIENT)}
    links = {"gap": valve("one", "two", 0.02), "shut": valve("two", "air", 0.01, 0.0)}
    end = 2 * math.sqrt(0.5) / (0.02 * math.sqrt(2 * GRAVITY) * (1 / 2.0 + 1 / 3.0)) + 60.0
    result = fvsolve.run(scene(nodes, links, end, numerics, ["gap.flow"], 0.37))
    most = max(laminar_flow(0.02), 0.02 * math.sqrt(2 * GRAVITY * drop))
    assert np.max(np.abs(result["gap.flow"][result.t > end - 50.0])) < most


def test_a_drained_tank_stays_within_the_laminar_width_and_does_not_chatter():
    result = drained(2.0, 1.5, 170.0)  # empty after 111 s
    assert np.max(np.abs(result["hole.flow"][result.t > 120.0])) < laminar_flow(OUTLET)


def test_a_tank_with_a_rising_and_falling_outfall_reverses_the_flow():
    """The outfall is chosen so that the root of the drop is S cos(w t) and the level h0 - K S sin(w t) / w."""
    section, level, root, period = 4.0, 3.0, 0.8, 240.0
    speed, w = OUTLET * math.sqrt(2 * GRAVITY) / section, 2 * math.pi / period

    def level_at(t):
        return level - speed * root * np.sin(w * t) / w

    def outfall(t):
        return level_at(t) - root**2 * np.cos(w * t) * np.abs(np.cos(w * t))

    t = np.linspace(0.0, 600.0, 12001)
    head = {"time": t.tolist(), "value": outfall(t).tolist(), "kind": "smooth"}
    nodes = {"basin": tank(section, level), "sea": lake(head)}
    case = scene(
        nodes,
        {"hole": valve("basin", "sea", OUTLET)},
        600.0,
        CLOSE,
        ["basin.level", "hole.flow"],
        1.0,
    )
    result = fvsolve.run(case)
    now = np.asarray(result.t)
    assert result["hole.flow"].min() < 0 < result["hole.flow"].max()
    assert result["basin.level"] == pytest.approx(level_at(now), abs=1e-6)
    turned = np.abs(np.cos(w * now)) > 0.05  # near zero drop the root amplifies errors of the table
    exact = speed * section * root * np.cos(w * now)
    assert result["hole.flow"][turned] == pytest.approx(exact[turned], abs=1e-6)


def test_an_outfall_that_goes_up_and_down_in_straight_lines_agrees_with_scipy():
    section, level = 4.0, 3.0
    times, heads = [0.0, 100.0, 200.0, 320.0], [2.5, 4.0, 2.0, 3.5]
    head = {"time": times, "value": heads, "kind": "linear"}
    nodes = {"basin": tank(section, level), "sea": lake(head)}
    case = scene(nodes, {"hole": valve("basin", "sea", OUTLET)}, 400.0, CLOSE, ["basin.level"], 4.0)
    result = fvsolve.run(case)
    k = OUTLET * math.sqrt(2 * GRAVITY) / section

    def rate(t, h):
        drop = h - np.interp(t, times, heads)
        return -k * np.sign(drop) * np.sqrt(np.abs(drop))

    y, found = np.array([level]), [level]
    for a, b in zip(range(0, 400, 4), range(4, 404, 4), strict=True):
        y = solve_ivp(rate, (a, b), y, "Radau", rtol=1e-11, atol=1e-12, max_step=0.5).y[:, -1]
        found.append(y[0])
    at = np.interp(np.arange(0, 401, 4), result.t, result["basin.level"])
    assert at == pytest.approx(np.array(found), abs=1e-6)


def test_running_dry_is_marked_when_and_where_it_happens():
    """The outfall is below the bottom of the tank, so outflow continues at level 0."""
    section, level, below = 2.0, 1.5, 2.0
    nodes = {
        "basin": tank(section, level, elevation=10.0),
        "air": reservoir(AMBIENT, elevation=10.0 - below),
    }
    links = {"hole": valve("basin", "air", OUTLET)}
    slope = OUTLET * math.sqrt(2 * GRAVITY) / section
    dry = 2 * (math.sqrt(level + below) - math.sqrt(below)) / slope
    result = fvsolve.run(scene(nodes, links, dry + 20.0, CLOSE, ["basin.level"], 1.0))
    (mark,) = [m for m in result.marks if m.place.endswith("basin")]
    assert mark.time == pytest.approx(dry, abs=1e-6)
    wet = result.t <= dry
    exact = vessels.falling_root(level + below, slope, np.asarray(result.t)[wet]) - below
    assert result["basin.level"][wet] == pytest.approx(exact, abs=1e-6)
    assert np.min(result["basin.level"]) > -1e-6
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize(
    "numerics", [CLOSE, {"method": "rk4", "step": 0.3}], ids=["tight", "fixed step"]
)
def test_a_tank_filled_above_its_height_spills_and_the_ledger_has_it(numerics):
    nodes = {"basin": tank(2.0, 1.0, height=1.5), "spring": {"type": "inflow", "flow": 0.02}}
    links = {"pipe": valve("spring", "basin", 0.05)}
    result = fvsolve.run(scene(nodes, links, 100.0, numerics, ["basin.level"], 1.0))
    wanted = np.minimum(1.0 + 0.01 * np.asarray(result.t), 1.5)
    assert result["basin.level"] == pytest.approx(wanted, abs=1e-6)
    assert result.ledger["mass"]["spilled"] == pytest.approx(
        1000.0 * (0.02 * 100.0 - 1.0), rel=1e-6
    )
    (note,) = [one for one in result.warnings if one.kind == "spilling"]
    assert (
        note.place == "nodes.basin"
        and note.value == pytest.approx(50.0, abs=1e-6)
        and not result.marks
    )


def test_a_tank_through_a_pipe_swings_with_the_period_of_mass_oscillation():
    """Rigid column without friction: w^2 = g A / (L A_tank), about the level of the reservoir."""
    length, diameter, section = 200.0, 0.4, 0.5
    nodes = {"lake": lake(10.0), "surge": tank(section, 10.5)}
    column = {
        "type": "rigid-column",
        "from": "lake",
        "to": "surge",
        "length": length,
        "diameter": diameter,
    }
    links = {"main": {**column, "friction": scenes.NO_FRICTION, "initial_flow": 0.0}}
    w = math.sqrt(GRAVITY * scenes.area(diameter) / (length * section))
    case = scene(
        nodes,
        links,
        2.5 * 2 * math.pi / w,
        {**CLOSE, "rtol": 1e-10},
        ["surge.level", "main.flow"],
        0.5,
    )
    result = fvsolve.run(case)
    t = np.asarray(result.t)
    assert result["surge.level"] == pytest.approx(10 + 0.5 * np.cos(w * t), abs=1e-6)
    assert result["main.flow"] == pytest.approx(-section * 0.5 * w * np.sin(w * t), abs=1e-6)


def test_a_rigid_column_behind_a_valve_that_opens_at_once_starts_as_a_hyperbolic_tangent():
    """L / (g A) q' = H - (q / K)^2, so q = q1 tanh((t - 1) / T + artanh 0.2) with T = L q1 / (g A H)."""
    length, diameter, head = 1000.0, 0.3, 20.0
    nodes = {"lake": lake(head), "gate": scenes.junction(), "air": reservoir(AMBIENT)}
    column = {
        "type": "rigid-column",
        "from": "lake",
        "to": "gate",
        "length": length,
        "diameter": diameter,
    }
    links = {
        "main": {**column, "friction": scenes.NO_FRICTION},
        "valve": valve("gate", "air", OUTLET, scenes.step(1.0, 0.2, 1.0)),
    }
    case = scene(
        nodes, links, 40.0, {**CLOSE, "rtol": 1e-10}, ["valve.flow", "main.flow", "gate.head"], 0.5
    )
    result = fvsolve.run(case)
    most = OUTLET * math.sqrt(2 * GRAVITY * head)
    scale = length * most / (GRAVITY * scenes.area(diameter) * head)
    t = np.asarray(result.t)
    after = (t > 1.0) | (np.arange(len(t)) == np.flatnonzero(t == 1.0)[-1])
    flow = np.where(after, most * np.tanh((t - 1) / scale + math.atanh(0.2)), 0.2 * most)
    assert result["main.flow"] == pytest.approx(flow, abs=1e-8 * most)
    assert result["valve.flow"] == pytest.approx(flow, abs=1e-8 * most)
    opened = np.where(after, 1.0, 0.2)
    assert result["gate.head"] == pytest.approx(
        (flow / (opened * OUTLET)) ** 2 / (2 * GRAVITY), abs=1e-6 * head
    )


@pytest.mark.parametrize(
    "numerics, near",
    [
        (CLOSE, 1e-5),
        ({"method": "rk4", "step": 0.008}, 1e-5),
        ({"method": "ssp-rk3", "step": 0.02}, 1e-4),
    ],
    ids=["tight", "rk4", "ssp"],
)
def test_a_valve_that_shuts_brings_a_rigid_column_to_rest_and_the_run_goes_on(numerics, near):
    """The flow falls to zero with the opening tau, at a finite head.

    With q = tau s, and tau the time until the closing [s], the reference solves
    tau s' = s + g A / L (H - (f L / (D A^2) tau^2 + 1 / K^2) s^2 / (2 g)).
    """
    length, diameter, head, factor, start, shut = 100.0, 0.2, 60.0, 0.02, 2.0, 3.0
    nodes = {"lake": lake(head), "gate": scenes.junction(), "air": reservoir(AMBIENT)}
    column = {
        "type": "rigid-column",
        "from": "lake",
        "to": "gate",
        "length": length,
        "diameter": diameter,
    }
    links = {
        "main": {**column, "friction": {"model": "steady", "factor": factor}},
        "tap": valve("gate", "air", OUTLET, scenes.ramp(start, shut - start, 1.0, 0.0)),
    }
    result = fvsolve.run(
        scene(nodes, links, 5.0, numerics, ["main.flow", "tap.flow", "gate.head"], 0.1)
    )
    assert result.ok, result.reason
    area = scenes.area(diameter)
    wall = factor * length / diameter / area**2 / (2 * GRAVITY)
    steady = math.sqrt(head / (wall + 1 / (2 * GRAVITY * OUTLET**2)))

    def rate(t, s):
        tau = shut - t
        lost = wall * (tau * s) ** 2 + s**2 / (2 * GRAVITY * OUTLET**2)
        return (s + GRAVITY * area / length * (head - lost)) / tau

    times = np.linspace(2.0, 2.9, 10)
    run = solve_ivp(rate, (2.0, 2.9), [steady], "DOP853", rtol=1e-11, atol=1e-13, t_eval=times)
    at = np.interp(times, result.t, result["main.flow"])
    assert at == pytest.approx((shut - times) * run.y[0], abs=near * steady)
    after = result.t > shut + 1e-9
    assert np.all(result["main.flow"][after] == 0.0)
    assert result["gate.head"][after] == pytest.approx(head, rel=1e-12)


LENGTH, DIAMETER, FACTOR, SHAFT, THROAT = 2000.0, 3.0, 0.015, 80.0, 2.0
TIGHT = {"method": "dormand-prince", "rtol": 1e-11}


def turns(z: float, flow: float, losses: tuple[float, float], count: int) -> list[float]:
    """Levels above the lake at which the flow reverses: d(q^2)/dz = -k (z + c q |q|) (Forchheimer 1913).

    q^2 = 1 / (k c^2) -+ z / c + C exp(-+ k c z), with the upper sign while the tank fills.
    losses : loss coefficients K into the tank and out of it
    """
    bore, throat = area(DIAMETER), area(THROAT)
    k = 2 * GRAVITY * bore * SHAFT / LENGTH
    square, found = flow**2, []
    for turn in range(count):
        side = 1 if turn % 2 == 0 else -1
        c = FACTOR * LENGTH / DIAMETER / (2 * GRAVITY * bore**2) + losses[turn % 2] / (
            2 * GRAVITY * throat**2
        )

        def left(x, z=z, square=square, side=side, c=c):
            plain = (1 / (k * c * c) - side * z / c, 1 / (k * c * c) - side * x / c)
            return plain[1] + (square - plain[0]) * math.exp(-side * k * c * (x - z))

        far = z + side * 0.05
        while left(far) > 0.0:
            far += side * 0.05
        z, square = brentq(left, far - side * 0.05, far, xtol=1e-13), 0.0
        found.append(z)
    return found


def swing(losses: tuple[float, float], numerics: dict = TIGHT, law: str = "linear") -> dict:
    connection = {"diameter": THROAT, "loss_in": losses[0], "loss_out": losses[1]}
    nodes = {
        "lake": lake(50.0),
        "t": {"type": "tank", "area": SHAFT, "level": 45.9, "connection": connection},
    }
    tunnel = {
        "type": "rigid-column",
        "from": "lake",
        "to": "t",
        "length": LENGTH,
        "diameter": DIAMETER,
        "friction": {"model": "steady", "factor": FACTOR},
        "initial_flow": 20.0,
    }
    probes = ["t.level", "t.head", "c.flow"]
    return scene(nodes, {"c": tunnel}, 400.0, numerics, probes, 0.1, fluid=WATER | {"law": law})


@pytest.mark.parametrize("losses", [(1.0, 1.5), (4.0, 0.5)])
def test_the_turns_of_a_mass_oscillation_are_the_closed_ones(losses):
    """The extremes agree to the transition flow of the throttle and the interval of rows."""
    result = fvsolve.run(swing(losses))
    level = result["t.level"]
    slope = np.diff(level)
    found = level[1:-1][slope[:-1] * slope[1:] <= 0.0]
    assert found[:3] == pytest.approx([50.0 + z for z in turns(-4.1, 20.0, losses, 3)], abs=3e-6)
    assert abs(result.ledger["mass"]["relative"]) < 1e-14


def test_the_head_at_the_tank_is_its_level_and_the_loss():
    result = fvsolve.run(swing((1.0, 1.5)))
    flow = result["c.flow"]
    loss = np.where(flow > 0, 1.0, -1.5) * flow**2 / (2 * GRAVITY * area(THROAT) ** 2)
    assert result["t.head"] == pytest.approx(result["t.level"] + loss, abs=1e-5)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_throttle_dissipates_and_the_ledger_closes(law):
    one = energy(swing((1.0, 1.5), {"method": "gauss-6", "step": 0.25}, law), port="lake")
    column = sum(loss[-1] for loss in one.law.values())
    assert abs(one.numerical_remainder[-1] - column) < 1e-7 * one.throughput and one.port.passive
    assert one.dissipated["t.connection"][-1] > 0.0 and "t.inside" in one.stored


def test_a_tank_behind_a_pipe_starts_at_rest_and_stays():
    connection = {"area": 0.5, "loss_in": 1.0, "loss_out": 2.0}
    nodes = {
        "lake": lake(20.0),
        "t": {"type": "tank", "area": 9.0, "level": 20.0, "connection": connection},
    }
    links = {"main": pipe("lake", "t", 100.0, 0.5, 1000.0, 10)}
    for law in ("linear", "log"):
        model = fvsolve.build(
            fvsolve.load(scene(nodes, links, 1.0, {}, fluid=WATER | {"law": law}))
        )
        assert not model.rhs(0.0, np.zeros(model.y_size)).any()
        pattern = jacobian_pattern(model).toarray()[: model.y_size]
        assert not np.any((np.abs(model.jacobian(0.0, np.zeros(model.y_size))) > 1e-6) & ~pattern)


def test_marks_and_moving_parts_name_the_tank_itself():
    """Marks, notices and moving parts name the tank, without its inner node; an outlet below its bottom drains it."""
    nodes = {
        "t": {
            "type": "tank",
            "area": 1.0,
            "level": 0.5,
            "connection": {"diameter": 0.2, "loss_in": 1.0, "loss_out": 1.0},
        },
        "air": lake(-0.5),
    }
    result = fvsolve.run(scene(nodes, {"hole": valve("t", "air", 0.02)}, 40.0, {}, ["t.level"]))
    assert [mark.place for mark in result.marks] == ["nodes.t"] and result["t.level"][
        -1
    ] == pytest.approx(0.0, abs=1e-6)
    full = {"t": nodes["t"] | {"height": 0.6}, "spring": {"type": "inflow", "flow": 0.02}}
    spilt = fvsolve.run(scene(full, {"way": valve("spring", "t", 0.02)}, 40.0, {}, ["t.level"]))
    (note,) = [one for one in spilt.warnings if one.kind == "spilling"]
    assert (note.place, note.value) == (
        "nodes.t",
        pytest.approx(5.0, abs=1e-6),
    ) and "inside" not in note.text
    moving = fvsolve.build(
        fvsolve.load(scene(nodes, {"hole": valve("t", "air", 0.02)}, 1.0, {}))
    ).steady["moving"]
    assert moving[0].startswith("tank t falls at")
