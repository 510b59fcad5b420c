"""Moving networks: rolling U-tubes, turned and accelerated pipes, against closed forms and (70) of docs/course.md."""

import meshio
import numpy as np
import pytest
from reference.refusals import messages_of
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, area, pipe, scene
from reference.u_tubes import BORE, DEPTH, HALF, LEVEL, LOSS, ROLL, TANK, hull, u_tube
from scipy.integrate import simpson, solve_ivp

import fvsolve as fv
from fvsolve.core.output.fields import read_series
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.energy_balance import energy


def roll(t):
    """Angle [rad], rate [rad/s] and acceleration [rad/s2] of the hull."""
    w = 2 * np.pi / ROLL["period"]
    return ROLL["amplitude"] * np.array([np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)])


def lagrange():
    """Return a function (angle, rate, acceleration, z, q) for dq/dt by Lagrange's equation (docs/course.md, 70).

    q is the flow from starboard to port [m3/s], z the rise at port [m]. Water in the tanks counts as columns along
    their axes. The kinetic energy of their relative flow, in q^2, is left out as in the model.
    """
    sp = pytest.importorskip("sympy", reason="derives Lagrange's equation")
    t, s = sp.symbols("t s")
    angle, z = sp.Function("angle")(t), sp.Function("z")(t)
    bore = sp.Rational(str(BORE)) ** 2 * sp.pi / 4
    q = TANK * z.diff(t)

    def along(place, tangent, size, low, high, own):
        """Return (kinetic, potential) energy over density of water that flows along a line in the rolling hull."""
        turn = sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])
        where = turn * sp.Matrix(place)
        drag = where.diff(t)
        slide = turn * sp.Matrix(tangent) * q / size
        square = drag.dot(drag) + 2 * drag.dot(slide) + (slide.dot(slide) if own else 0)
        return [
            size * sp.integrate(sp.expand(one), (s, low, high))
            for one in (square / 2, GRAVITY * where[1])
        ]

    parts = [
        along([s, -DEPTH], [1, 0], bore, -HALF, HALF, True),  # from starboard to port
        along([HALF, -DEPTH + s], [0, 1], TANK, 0, LEVEL + z, False),
        along([-HALF, -DEPTH + s], [0, -1], TANK, 0, LEVEL - z, False),
    ]
    action = sum(one for one, _ in parts) - sum(one for _, one in parts)
    left = action.diff(z.diff(t)).diff(t) - action.diff(z)
    a, b, c, x, v, w = sp.symbols("a b c x v w")
    left = left.doit()
    for old, new in (
        (angle.diff(t, 2), c),
        (z.diff(t, 2), w),
        (angle.diff(t), b),
        (z.diff(t), v),
        (angle, a),
        (z, x),
    ):
        left = left.subs(old, new)
    heavy = left.diff(w)
    answer = -left.subs(w, 0) / heavy
    free = sp.lambdify((a, b, c, x, v), answer)
    return lambda a, b, c, x, q: (
        TANK * free(a, b, c, x, q / TANK) - LOSS / (2 * 2 * HALF * area(BORE)) * abs(q) * q
    )


WAYS = {  # equivalent cases: (density law, keys of u_tube, keys of numerics)
    "as drawn": ("linear", {}, {}),
    "the duct to starboard": ("linear", {"swap": True}, {}),
    "bow along y": ("linear", {"turned": True}, {}),
    "implicit": ("linear", {}, {"method": "radau-iia-5", "rtol": 1e-8}),
    "rosenbrock": ("linear", {"swap": True}, {"method": "rodas-4", "rtol": 1e-8}),
    "fixed steps": ("linear", {}, {"method": "rk4", "rtol": None, "step": 0.01}),
    "log": ("log", {}, {}),
    "log, to starboard": ("log", {"swap": True, "turned": True}, {}),
}


@pytest.fixture(scope="module")
def rate():
    return lagrange()


@pytest.mark.parametrize("way", WAYS)
def test_a_u_tube_that_rolls_obeys_lagrange(way, rate):
    law, drawn, numerics = WAYS[way]
    case = u_tube(**drawn)
    case["fluid"] = {**WATER, "law": law}
    case["numerics"] = {
        key: one for key, one in {**case["numerics"], **numerics}.items() if one is not None
    }
    run = fv.run(case)
    t = run.t
    truth = solve_ivp(
        lambda t, y: [y[1] / TANK, rate(*roll(t), *y)],
        (0, 20),
        [0.0, 0.0],
        t_eval=t,
        rtol=1e-11,
        atol=1e-12,
        method="DOP853",
    )
    rise = run["port.level"] - LEVEL
    assert np.max(np.abs(truth.y[0])) > 0.1
    # water under 1 m is 5e-6 denser
    assert rise == pytest.approx(truth.y[0], abs=1e-6 if law == "linear" else 1e-5)


PIPE = {"type": "pipe", "diameter": 0.1, "wave_speed": 1000.0, "cells": 40}
LONG, PRESSURE = 20.0, 5e5


def line(near, far, joint, law="linear", from_="open", cells=40, length=LONG, **numerics):
    """Return a case of a frictionless pipe on a driven body, from a reservoir to a dead end."""
    nodes = {
        "rig": hull(**joint),
        "open": {"type": "reservoir", "pressure": PRESSURE, "on": "rig", "at": near},
        "shut": {"type": "junction", "on": "rig", "at": far},
    }
    ends = {"from": "open", "to": "shut"} if from_ == "open" else {"from": "shut", "to": "open"}
    case = scene(
        nodes,
        {"pipe": {**PIPE, **ends, "length": length, "cells": cells}},
        0.32,
        {"scheme": "upwind5", "method": "rk4", "courant": 0.8, **numerics},
        ["shut.pressure", "pipe.pressure@0.5", "pipe.flow@0.5"],
        every=4e-4,
    )
    case["fluid"] = {**WATER, "law": law}
    return case


@pytest.mark.in_turn
@pytest.mark.parametrize("from_", ["open", "shut"])
@pytest.mark.parametrize(
    ("law", "scheme"), [("linear", "upwind5"), ("linear", "muscl"), ("log", "upwind5")]
)
def test_a_pipe_that_slows_down_has_the_wave_of_the_closed_form_at_its_dead_end(law, scheme, from_):
    a = 2.0
    joint = {
        "kind": "prismatic",
        "axis": [1, 0, 0],
        "travel": {"start": 0, "duration": 10, "value": [0, 0.5 * a * 100], "exponent": 2},
    }
    run = fv.run(line([0, 0, 0], [LONG, 0, 0], joint, law, from_, scheme=scheme))
    beats = run.t * 1000.0 / LONG  # period 4; the wave from the open end returns at 2
    truth = RHO * a * LONG * (1.0 - np.abs(1.0 - beats % 4.0 / 2.0)) * 2.0
    off = np.abs(run["shut.pressure"] - PRESSURE - truth) / (RHO * a * LONG)
    assert np.max(off[beats < 4.0]) < 0.03  # at its kinks
    # density rises by p / K
    assert np.max(off[beats < 1.5]) < (1e-7 if law == "linear" else 2.5e-4)


@pytest.mark.in_turn
@pytest.mark.parametrize("from_", ["open", "shut"])
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("inner", [0.0, 5.0])
def test_a_pipe_that_turns_is_pressed_outward_by_the_squares_of_radii(inner, law, from_):
    w = 1.2
    joint = {
        "kind": "revolute",
        "axis": [0, 0, 1],
        "angle": {"time": [0, 60], "value": [0, 60 * w]},
    }
    run = fv.run(line([inner, 0, 0], [inner + LONG, 0, 0], joint, law, from_))
    periods = slice(0, 801)  # four periods of 4 L / c, over which oscillations have the mean 0
    rise = np.trapezoid(run["shut.pressure"][periods] - PRESSURE, run.t[periods]) / run.t[800]
    assert rise == pytest.approx(
        RHO * w**2 * ((inner + LONG) ** 2 - inner**2) / 2, rel=1e-3 if law == "linear" else 3e-3
    )


def tilted(law, rides):
    """Return a case of a network on a tilted body, or with the elevations that it then has if `rides` is False."""
    angle = 0.5
    places = {
        "top": [0, 0, 12.0],
        "tee": [9.0, 2.0, 3.0],
        "low": [-4.0, 1.0, -5.0],
        "end": [-4.0, 1.0, -5.0],
        "far": [15.0, 0, 4.0],
    }
    more = {
        "top": {"type": "reservoir", "pressure": 3e5},
        "tee": {"type": "junction", "demand": {"time": [0, 0.1], "value": [0.004, 0.008]}},
        "low": {"type": "chamber", "volume": 0.05},
        "end": {"type": "reservoir", "pressure": 1.5e5},
        "far": {"type": "junction"},
    }
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    for name, place in places.items():
        where = {"on": "frame", "at": place} if rides else {"elevation": float((turn @ place)[2])}
        more[name] |= where
    body = {"frame": hull(kind="fixed", attitude={"pitch": angle})} if rides else {}
    rough = {"model": "quasi-steady", "roughness": 1e-4}
    links = {
        "main": {**PIPE, "from": "top", "to": "tee", "length": 30.0, "friction": rough},
        "branch": {**PIPE, "from": "far", "to": "tee", "length": 12.0, "friction": rough},
        "rod": {
            "type": "rigid-column",
            "from": "tee",
            "to": "low",
            "length": 20.0,
            "diameter": 0.05,
            "friction": rough,
        },
        "tap": {
            "type": "valve",
            "from": "low",
            "to": "end",
            "area": 1e-4,
            "discharge_coefficient": 0.6,
        },
    }
    case = scene(
        {**body, **more},
        links,
        1.0,
        {"scheme": "upwind5", "method": "rk4", "courant": 0.8},
        ["tee.pressure", "low.pressure", "far.head", "main.pressure@0.5", "rod.flow", "tap.flow"],
    )
    case["fluid"] = {**WATER, "law": law} | ({"air_fraction": 1e-4} if law == "mixture" else {})
    return case


@pytest.mark.parametrize("law", ["linear", "log", "mixture"])
def test_a_network_on_a_tilted_body_is_the_network_drawn_as_it_stands(law):
    here, there = (fv.run(tilted(law, rides)) for rides in (True, False))
    for name in here.probes:
        size = np.max(np.abs(there[name]))
        assert here[name] == pytest.approx(there[name], abs=1e-9 * size), name


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_u_tube_laid_over_settles_level(law):
    angle = 0.05
    case = u_tube(
        angle={"start": 0, "duration": 20, "value": [0, angle], "exponent": 2}, minor_loss=2000.0
    )
    case["fluid"], case["numerics"] = (
        {**WATER, "law": law},
        {"end": 3000.0, "method": "radau-iia-5", "rtol": 1e-8},
    )
    case["output"]["every"] = 100.0
    run = fv.run(case)
    rise = run["starboard.level"][-1] - run["port.level"][-1]  # port, at positive y, rises
    assert rise == pytest.approx(2 * HALF * np.tan(angle), rel=2e-3)


def test_rolling_like_a_pendulum_as_long_as_its_lever_moves_no_water():
    period = 2 * np.pi * np.sqrt((DEPTH + LEVEL) / GRAVITY)
    run = fv.run(u_tube(angle={**ROLL, "period": period}))
    beside = fv.run(u_tube(angle={**ROLL, "period": 1.3 * period}))
    rise, other = (np.max(np.abs(one["port.level"] - LEVEL)) for one in (run, beside))
    assert rise < 2e-3 * other


def ring(**joint):
    """Return a case of a rigid column around a square on a body, between two reservoirs at one point."""
    ends = {
        one: {"type": "reservoir", "pressure": 1e5, "on": "rig", "at": [1, 0.5, 0]}
        for one in ("a", "b")
    }
    way = {"type": "rigid-column", "from": "a", "to": "b", "length": 8.0, "diameter": 0.1,
           "route": [[3, 0.5, 0], [3, 2.5, 0], [1, 2.5, 0]]}  # fmt: skip
    return scene(
        {"rig": hull(**joint), **ends},
        {"way": way},
        2.0,
        {"method": "rk4", "step": 0.01},
        ["way.flow"],
    )


@pytest.mark.parametrize("along", [(0, 0, 1), (0, 0.6, 0.8)])
def test_fluid_round_a_way_stays_behind_when_its_body_begins_to_turn(along):
    run = fv.run(ring(kind="revolute", axis=list(along), angle=ROLL))
    turns = roll(run.t)[1] - roll(0.0)[1]
    truth = -area(0.1) / 8.0 * 2.0 * 4.0 * along[2] * turns  # constant circulation v L + 2 S W
    assert run["way.flow"] == pytest.approx(
        truth, abs=1e-8 * area(0.1) + 1e-7 * np.max(np.abs(truth))
    )


def cut(law, **valve):
    """Return a case of the U-tube with a valve between the tank starboard and its duct."""
    case = u_tube(minor_loss=0.0)
    case["fluid"] = {**WATER, "law": law}
    case["nodes"]["beside"] = {"type": "junction", "on": "hull", "at": [0, -HALF, -DEPTH]}
    case["links"]["duct"] |= {"from": "beside", "to": "port"}
    case["links"]["gate"] = {
        "type": "valve",
        "from": "starboard",
        "to": "beside",
        "area": 0.1,
        "discharge_coefficient": 1.0,
        **valve,
    }
    case["output"]["probes"] += ["beside.pressure"]
    return case


@pytest.mark.parametrize("law", ["linear", "log"])
def test_behind_a_shut_valve_the_pressure_is_weight_and_inertia_of_the_column(law):
    run = fv.run(cut(law, opening=0.0))
    angle, w, e = roll(run.t)
    down = {"y": -GRAVITY * np.sin(angle), "z": -GRAVITY * np.cos(angle)}
    # from beside to the surface at port
    first, last = np.array([-HALF, -DEPTH]), np.array([HALF, -DEPTH + LEVEL])
    between = np.array([HALF, -DEPTH])
    swept = (
        first[0] * between[1] - first[1] * between[0] + between[0] * last[1] - between[1] * last[0]
    )
    drive = down["y"] * (last - first)[0] + down["z"] * (last - first)[1] - e * swept
    drive += 0.5 * w**2 * (last @ last - first @ first)
    assert run["duct.flow"] == pytest.approx(np.zeros(len(run.t)), abs=1e-12)
    assert run["beside.pressure"] == pytest.approx(
        AMBIENT - RHO * drive, rel=1e-9 if law == "linear" else 2e-5
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_two_columns_at_a_shut_valve_act_as_a_single_column(law):
    whole, case = u_tube(), u_tube()
    middle = [0, 0.5, -DEPTH]
    case["nodes"] |= {
        "middle": {"type": "junction", "on": "hull", "at": middle},
        "outside": {"type": "reservoir", "pressure": AMBIENT, "on": "hull", "at": middle},
    }
    parts = {"first": ("port", "middle", HALF - 0.5), "second": ("middle", "starboard", HALF + 0.5)}
    case["links"] = {
        name: {
            **case["links"]["duct"],
            "from": a,
            "to": b,
            "length": length,
            "minor_loss": LOSS * length / (2 * HALF),
        }
        for name, (a, b, length) in parts.items()
    }
    case["links"]["gate"] = {
        "type": "valve",
        "from": "middle",
        "to": "outside",
        "area": 0.01,
        "opening": 0.0,
        "discharge_coefficient": 1.0,
    }
    case["output"]["probes"] = ["first.flow", "second.flow", "port.level"]
    case["fluid"] = whole["fluid"] = {**WATER, "law": law}
    one, two = fv.run(whole), fv.run(case)
    for name in ("first.flow", "second.flow"):
        assert two[name] == pytest.approx(one["duct.flow"], abs=1e-7)


def test_combinations_that_cannot_move_together_are_reported_all_at_once():
    case = cut("linear")
    case["nodes"]["port"] |= {"elevation": 1.0}
    case["nodes"]["starboard"]["on"] = "hul"
    case["nodes"]["beside"] |= {"at": [0, -HALF, 0.0]}
    case["nodes"]["shore"] = {"type": "reservoir", "pressure": 1e5, "at": [0, 0, 0]}
    case["nodes"]["head"] = {"type": "reservoir", "head": 3.0, "on": "hull"}
    case["links"]["bridge"] = {**PIPE, "from": "port", "to": "shore", "length": 3.0}
    case["links"]["long"] = {**PIPE, "from": "port", "to": "head", "length": 3.0}
    found = messages_of(case)
    assert "has no effect on a body" in found["nodes.port.elevation"]
    assert 'did you mean "hull"' in found["nodes.starboard.on"]
    assert "give the body as `on = BODY`" in found["nodes.shore.at"]
    assert "counts from the ground" in found["nodes.head.head"]
    assert (
        "port, on hull and shore, which is fixed: this would be a flexible hose"
        in found["links.bridge"]
    )
    assert "too short: the route on hull is" in found["links.long.length"]


def test_parts_without_a_route_between_their_ends_join_a_single_place():
    case = cut("linear")
    case["nodes"]["beside"]["at"] = [0, -HALF, 0.0]
    assert "the ends lie 1.5 m apart" in messages_of(case)["links.gate"]


def test_a_route_longer_than_its_column_is_reported():
    case = u_tube(route=[[3.0, 0.0, -DEPTH]])
    assert messages_of(case)["links.duct.length"].startswith(
        "8 m is too short: the route on hull is 10 m"
    )


def test_a_route_of_a_column_at_standstill_is_reported():
    case = ring(kind="fixed")
    del case["nodes"]["rig"]
    for name in ("a", "b"):
        case["nodes"][name] = {"type": "reservoir", "pressure": 1e5}
    assert "no end of the pipe is on a body" in messages_of(case)["links.way.route"]


def test_steps_without_divisions_include_the_force_on_the_body_too():
    joint = {
        "kind": "prismatic",
        "axis": [1, 0, 0],
        "travel": {"start": 0, "duration": 10, "value": [0, 100.0], "exponent": 2},
    }
    case = line([0, 0, 0], [LONG, 0, 0], joint, scheme="upwind", method="euler")
    case["output"]["every"] = 0.04  # many steps between rows
    run = fv.run(case)
    assert run["shut.pressure"][1] - PRESSURE == pytest.approx(RHO * 2.0 * LONG * 2.0, rel=0.1)


# energy and joints ----------


def water_energy(angle, spin, rise, flow):
    """Kinetic plus potential energy of the water in the U-tube [J].

    flow : from starboard to port [m3/s]; rise : of the level at port [m]
    """
    c, s = np.cos(angle), np.sin(angle)
    whole = np.zeros_like(angle)
    ends = (-HALF, LEVEL - rise), (HALF, LEVEL + rise)
    parts = [(RHO * area(BORE) * 2 * HALF, (-HALF, -DEPTH), (HALF, -DEPTH))]
    parts += [(RHO * TANK * high, (y, -DEPTH), (y, -DEPTH + high)) for y, high in ends]
    for mass, (y, z), (u, w) in parts:
        square = (y * y + y * u + u * u + z * z + z * w + w * w) / 3.0
        whole = whole + mass * (
            0.5 * spin**2 * square + GRAVITY * (s * 0.5 * (y + u) + c * 0.5 * (z + w))
        )
    # integral of r x dr between the surfaces
    swept = 2 * HALF * DEPTH + HALF * (ends[0][1] + ends[1][1])
    return whole + RHO * flow * spin * swept + 0.5 * RHO * flow**2 * 2 * HALF / area(BORE)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_energy_of_a_u_tube_that_rolls_is_the_work_of_its_drive_less_friction(law, rate):
    losses, case = [], u_tube()
    case["fluid"], case["numerics"] = (
        {**WATER, "law": law},
        {"end": 20.0, "method": "rk4", "step": 0.1},
    )
    for step in (0.1, 0.05):
        case["numerics"]["step"] = step
        found = energy(fv.load(case))
        losses.append(abs(found.step[-1]))
        assert (
            abs(found.law.get("duct", [0.0])[-1])
            < (1e-9 if law == "linear" else 1e-5) * found.throughput
        )
    assert losses[1] < 0.1 * losses[0] < 2e-6 * found.throughput  # fourth order
    truth = solve_ivp(
        lambda t, y: [y[1] / TANK, rate(*roll(t), *y)],
        (0, 20),
        [0.0, 0.0],
        t_eval=found.t,
        rtol=1e-11,
        atol=1e-12,
        method="DOP853",
    )
    held = water_energy(*roll(found.t)[:2], *truth.y)
    kept = sum(found.stored[name] for name in ("port", "starboard", "duct"))
    assert np.ptp(held) > 1e3
    assert kept == pytest.approx(
        held - held[0], abs=(1e-5 if law == "linear" else 2e-4) * np.ptp(held)
    )
    case["output"] |= {"probes": ["hull.joint_tx", "hull.rate"], "every": 0.01}
    run = fv.run(case)
    work = simpson(run["hull.joint_tx"] * run["hull.rate"], x=run.t)
    assert found.supplied["hull"][-1] == pytest.approx(work, rel=1e-6)


@pytest.mark.parametrize("other", [False, True], ids=["alone", "with a riser"])
@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_energy_of_a_pipe_between_tanks_that_roll_closes_but_for_its_cells(law, other):
    """The riser, a pipe with a dead end, is listed first and is steep."""
    found, case = [], u_tube(minor_loss=0.0)
    case["links"]["duct"] |= {"type": "pipe", "wave_speed": 300.0}
    if other:
        case["nodes"]["tip"] = {"type": "junction", "on": "hull", "at": [0, -6.0, 3.0]}
        riser = pipe("starboard", "tip", np.hypot(6.0 - HALF, 3.0 + DEPTH), 0.2, 300.0, 10)
        case["links"] = {"riser": riser, **case["links"]}
    case["fluid"] = {**WATER, "law": law}
    for cells in (10, 20):
        case["links"]["duct"]["cells"] = cells
        case["numerics"] = {"end": 2.0, "scheme": "upwind5", "method": "rk4", "courant": 0.8}
        found.append(energy(fv.load(case)))
        assert abs(found[-1].step[-1]) < 1e-9 * found[-1].throughput
    lost = [abs(one.scheme["duct"][-1]) for one in found]
    assert lost[1] < 0.6 * lost[0] < 1e-6 * found[0].throughput
    case["output"] |= {"probes": ["hull.joint_tx", "hull.rate"], "every": 0.005}
    run = fv.run(case)
    work = simpson(run["hull.joint_tx"] * run["hull.rate"], x=run.t)
    assert found[1].supplied["hull"][-1] == pytest.approx(work, rel=1e-5)


def test_water_from_a_moving_place_carries_the_work_of_moving_it():
    joint = {
        "kind": "revolute",
        "axis": [0, 0, 1],
        "angle": {"start": 0, "duration": 4, "value": [0, 2], "exponent": 2},
    }
    steps = []
    for courant in (0.8, 0.4):
        case = line(
            [1, 0, 0], [1 + LONG, 0, 3], joint, cells=10, length=LONG + 1.0, courant=courant
        )
        found = energy(fv.load(case))
        steps.append(abs(found.step[-1]))
        assert abs(found.scheme["pipe"][-1]) < 1e-5 * found.throughput
        assert found.supplied["open"][-1] != 0.0 and found.supplied["rig"][-1] != 0.0
    assert steps[1] < 0.1 * steps[0] or steps[0] < 1e-9 * found.throughput


# no reaction on bodies is modelled: function that returns the case, place of the fault, text
UNFELT = {
    "a valve at a tank": (lambda: cut("linear"), "links.gate", "rigid-column at the tank"),
    "what spills": (lambda: with_tank(height=3.0), "nodes.port.height", "not modelled"),
}


def with_tank(**keys):
    case = u_tube()
    case["nodes"]["port"] |= keys
    return case


@pytest.mark.parametrize("what", UNFELT)
def test_energy_and_joints_without_their_forces_on_bodies_are_refused_by_name(what):
    make, place, text = UNFELT[what]
    case = make()
    with pytest.raises(FvsolveError, match=f"{place}: .*{text}"):
        energy(fv.load(case))
    case["output"]["probes"] += ["hull.joint_tx"]
    with pytest.raises(CaseError) as caught:
        fv.run(case)
    (fault,) = (one for one in caught.value.faults if one.place == place)
    assert text in fault.message and "reads forces of joints" in fault.message


def test_a_tank_that_falls_ends_the_run_by_name():
    # upward, slowing by 10 m/s2
    slows = {"start": 0, "duration": 40, "value": [0, 8000.0], "exponent": 2}
    case = u_tube()
    case["nodes"]["hull"]["joint"] = {"kind": "prismatic", "axis": [0, 0, 1], "travel": slows}
    run = fv.run(case)
    assert not run.ok and "the water in starboard has no weight left" in run.reason


def test_pipes_and_basins_are_drawn_where_their_bodies_are(tmp_path):
    case = u_tube(minor_loss=0.0)
    case["links"]["duct"] |= {"type": "pipe", "wave_speed": 300.0, "cells": 4}
    case["nodes"]["pool"] = {
        "type": "basin",
        "on": "hull",
        "at": [1, 2, 3],
        "size": [2.0, 1.0],
        "cells": [2, 1],
        "level": 0.5,
    }
    case["numerics"] = {"end": 2.0, "scheme": "upwind5", "method": "rk4", "courant": 0.8}
    case["output"] |= {"fields": 3, "probes": ["hull.angle"]}
    fv.run(case, out=tmp_path / "run")
    frames = read_series(tmp_path / "run" / "fields.pvd")
    y = np.linspace(HALF, -HALF, 5)
    duct = np.column_stack([np.zeros(5), y, np.full(5, -DEPTH)])
    corners = np.array([[1.0, 2, 3], [3, 2, 3], [3, 3, 3], [1, 3, 3]])
    for t, path in frames:
        angle = roll(t)[0]
        turn = np.array(
            [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
        )
        truth = (corners if "pool" in path.name else duct) @ turn.T
        points = meshio.read(path).points
        if "bodies" not in path.name:
            for one in truth:
                assert np.min(np.linalg.norm(points - one, axis=1)) < 1e-9
    assert {path.name.rpartition("-")[0] for _, path in frames} == {"", "bodies", "pool"}
