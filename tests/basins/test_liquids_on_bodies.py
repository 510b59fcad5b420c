"""Liquids in boxes on bodies: rest in any axes, spin-up, rotating axes, acceleration, joint loads, springs."""

import math

import numpy as np
import pytest
from reference.basins import HEAVY, cart, model_of, sliding, slowing, straight, turning
from reference.meshes import shaken, write
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, scene
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import j0

from fvsolve import advance, load, run
from fvsolve.core.model.model import State
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.energy_balance import energy

TILT = {"roll": "30 deg", "pitch": "-70 deg", "yaw": "25 deg"}
TABLE = {"name": "Water", "temperature": "20 degC", "pressure": "3 bar", "law": "table"}
FLUIDS = {"linear": WATER, "log": {**WATER, "law": "log"}, "table": TABLE}
STIFF = WATER["bulk_modulus"]
REST = 3e5


def full(cells=(12, 10), size=(2.0, 1.5), **more):
    """Return a closed box full of liquid, between plates 0.1 m apart."""
    outline = {} if "mesh" in more else {"size": list(size), "cells": list(cells)}
    return {
        "type": "basin",
        "physics": "liquid",
        "on": "body",
        **outline,
        "pressure": REST,
        "thickness": 0.1,
        **more,
    }


def case_of(body, basin, end, law="linear", probes=(), **numerics):
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5, **numerics}
    if "step" in numerics:
        del numerics["courant"]
    return scene({"body": body, "b": basin}, {}, end, numerics, probes, fluid=FLUIDS[law])


def after(case, until, start=None):
    """Return (basin, its deviations) at a time, from the states `start` gives if it is not None."""
    model = model_of(case)
    y = model.start.copy()
    if start is not None:
        model.meshed[0].states_of(y)[:] = start(model.meshed[0])
    return model.meshed[0], model.meshed[0].deviations(advance(model, State(0.0, y), until).y)


def resting(law, phi):
    """Pressure at rest over that at phi = 0: -rho phi, or K ln(rho / rho0) with 1 / rho - 1 / rho0 = phi / K."""
    if law == "linear":
        return -RHO * phi
    dense = RHO * math.exp((REST - AMBIENT) / STIFF)
    return -STIFF * np.log1p(dense * phi / STIFF)


# at rest ----------


@pytest.mark.in_turn
@pytest.mark.parametrize("law", FLUIDS)
@pytest.mark.parametrize("cells", ["even", "graded", "mesh"])
def test_a_leaning_box_holds_its_liquid_at_rest_and_pressure_grows_with_depth(law, cells, tmp_path):
    more = {"even": {}, "graded": {"grading": [3.0, 0.4]}, "mesh": {}}[cells]
    if cells == "mesh":
        more = {"mesh": {"file": str(write(tmp_path / "m.msh", *shaken()))}}
    body = {**HEAVY, "joint": {"kind": "fixed", "attitude": TILT}}
    basin, found = after(case_of(body, full(**more), 0.01, law), 0.01)
    assert np.abs(found[1:]).max() < (1e-9 if law == "table" else 1e-12)
    turn = basin.case.poses["body"].attitude
    middle = basin.mesh.area @ basin.mesh.centre / basin.mesh.area.sum()
    height = (basin.mesh.centre - middle) @ turn[2, :2]
    pressure = basin.pressure(found[0])
    assert np.ptp(height) > 1.0
    if law == "table":
        assert pressure == pytest.approx(-basin.density * GRAVITY * height, rel=1e-4)
    else:
        assert pressure == pytest.approx(resting(law, GRAVITY * height), abs=1e-6)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("cells", ["grid", "mesh"])
@pytest.mark.parametrize("how", ["turns", "slows", "leans and turns"])
def test_a_box_that_turns_or_slows_steadily_holds_its_liquid_at_rest(how, law, cells, tmp_path):
    rate, slows, (cx, cy) = 30.0, 20.0, (0.7, 1.3)
    more = {"at": [-cx, -cy, 0.0]}
    if cells == "mesh":
        more["mesh"] = {"file": str(write(tmp_path / "m.msh", *shaken()))}
    if how == "slows":
        body = sliding(slowing(slows))
    else:
        body = turning(straight(rate, 100.0))
    if how == "leans and turns":  # vertical axis, tilted box: W has three components in its axes
        more["attitude"] = TILT

    def start(basin):
        r = np.column_stack([basin.x, basin.y, np.zeros(basin.n)])
        turn = np.eye(3) if basin.part.attitude is None else basin.part.attitude.rotation
        world = r @ turn.T + np.array(more["at"])
        phi = GRAVITY * world[:, 2] - 0.5 * rate**2 * (world[:, 0] ** 2 + world[:, 1] ** 2)
        if how == "slows":
            phi = -slows * basin.x
        return [basin.deviation(resting(law, phi)), np.zeros(basin.n), np.zeros(basin.n)]

    basin, found = after(case_of(body, full(**more), 0.01, law), 0.01, start)
    assert np.abs(found[1:]).max() < 1e-9  # of 1e3 kg/m3 at 30 m/s
    assert found[0] == pytest.approx(np.array(start(basin)[0]), abs=1e-11)


# spun up ----------


def spun(x, y, long, wide):
    """(u, v) per rate of turning of the box, of liquid at rest in the world: curl 2, no flow through walls."""
    u, v = 2.0 * y - wide, np.zeros_like(x)
    for n in range(1, 200, 2):
        k, part = n * np.pi / wide, 8.0 * wide**2 / (np.pi * n) ** 3
        grow = np.exp(k * (np.abs(x - 0.5 * long) - 0.5 * long))
        cosh = grow * (1.0 + np.exp(-2.0 * k * np.abs(x - 0.5 * long))) / (1.0 + np.exp(-k * long))
        sinh = np.sign(x - 0.5 * long) * grow * (1.0 - np.exp(-2.0 * k * np.abs(x - 0.5 * long)))
        u = u + part * k * np.cos(k * y) * cosh
        v = v - part * k * np.sin(k * y) * sinh / (1.0 + np.exp(-k * long))
    return u, v


@pytest.mark.parametrize("law", ["linear", "log"])
def test_joukowskys_box_that_begins_to_turn_leaves_its_liquid_behind(law):
    long, wide, amplitude, period = 1.0, 0.7, 0.5, 1.0
    swing = {"mean": 0.0, "amplitude": amplitude, "period": period, "phase": "-90 deg"}
    rate = amplitude * 2.0 * np.pi / period
    errors = []
    for n in (10, 20):
        basin, numerics = (
            full((n, n), (long, wide), wave_speed=800.0),
            {"scheme": "upwind5", "method": "rk4"},
        )
        basin, found = after(
            case_of(turning(swing), basin, 0.25, law, courant=0.9, **numerics), 0.25
        )
        wanted = rate * np.array(spun(basin.x, basin.y, long, wide))
        errors.append(np.abs(found[1:] / RHO - wanted).mean() / np.abs(wanted).mean())
    assert errors[1] < errors[0] / 3.0
    assert errors[1] < 0.07


def ring(r, t, c, width):
    """Pressure at the radius r after a time t of a bump exp(-r^2 / (2 width^2)), by Hankel's transform."""

    def part(k):
        return k * width**2 * math.exp(-0.5 * (k * width) ** 2) * j0(k * r) * math.cos(c * k * t)

    return quad(part, 0.0, 9.0 / width, limit=400)[0]


@pytest.mark.parametrize("way", [1, -1])
def test_a_ring_of_pressure_seen_from_axes_that_turn_is_the_ring_that_stands_still(way):
    """In rotating axes centrifugal and Coriolis force (docs/course.md, 65) keep liquid at rest on circles."""
    c, rate, end, width, high, away = 60.0, way * 15.0, 0.005, 0.12, 2e-2, 0.25
    bulk = RHO * c**2
    start = {
        "pressure": f"{high * bulk} * exp(-((x - {1 + away})**2 + (y - 1)**2) / {2 * width**2})",
        "u": f"{rate} * (y - 1)",
        "v": f"{-rate} * (x - 1)",
    }
    errors = []
    for n in (48, 96):
        basin = full((n, n), (2.0, 2.0), at=[-1, -1, 0], start=start, wave_speed=c)
        basin, found = after(
            case_of(turning(straight(rate, 100.0)), basin, end, "log", courant=0.8), end
        )
        x, y = basin.x - 1.0, basin.y - 1.0
        near = np.hypot(x, y) < 0.5  # waves of the walls do not arrive here
        turned = rate * end
        east, north = (
            math.cos(turned) * x - math.sin(turned) * y,
            math.sin(turned) * x + math.cos(turned) * y,
        )
        far = np.hypot(east - away, north)
        radii = np.linspace(0.0, 1.2, 121)
        wanted = high * bulk * np.interp(far, radii, [ring(r, end, c, width) for r in radii])
        errors.append(
            np.abs(basin.pressure(found[0]) - wanted)[near].mean() / np.abs(wanted)[near].mean()
        )
    assert errors[1] < errors[0] / 3.0
    assert errors[1] < 0.03


# pushed ----------


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("along", ["x", "y"])
def test_a_full_box_that_is_pushed_at_once_rings_as_a_closed_pipe(along, law):
    """u = F t until waves from both ends arrive; behind them liquid moves with the box, at the pressure rho c u."""
    slows, long, n, c = 2.0, 1.5, 60, 50.0
    body = sliding(
        {"start": 0.0, "duration": 10.0, "value": [0.0, 0.5 * slows * 100.0], "exponent": 2},
        (1, 0, 0) if along == "x" else (0, 1, 0),
    )
    cells, size = ((n, 1), (long, 0.2)) if along == "x" else ((1, n), (0.2, long))
    for share in (0.4, 0.9):
        end = share * long / c
        basin, found = after(
            case_of(
                body, full(cells, size, wave_speed=c), end, law, scheme="upwind5", method="rk4"
            ),
            end,
        )
        x = basin.x if along == "x" else basin.y
        reached = np.minimum(np.minimum(x, long - x) / c, end)
        wanted = slows * np.where(share > 0.5, np.minimum(reached, long / c - end), reached)
        speed = found[1 if along == "x" else 2] / RHO
        assert np.abs(speed - wanted).mean() < 5e-3 * slows * long / c
        west, east = np.maximum(end - x / c, 0.0), np.maximum(end - (long - x) / c, 0.0)
        pressure = RHO * c * slows * (east - west)
        assert np.abs(basin.pressure(found[0]) - pressure).mean() < 5e-3 * RHO * slows * long


# weighed ----------


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_joint_holds_the_liquid_that_rests_on_its_body(law):
    """The joint of a tilted box carries the weight of liquid and body, and its moment."""
    held = {**HEAVY, "joint": {"kind": "fixed", "attitude": TILT}}
    probes = [f"body.joint_{what}{axis}" for what in "ft" for axis in "xyz"]
    result = run(case_of(held, full(at=[0.3, -0.2, 0.4]), 0.01, law, probes))
    pose = np.array(load(case_of(held, full(), 0.01, law)).poses["body"].attitude)
    dense = RHO if law == "linear" else RHO * math.exp((REST - AMBIENT) / STIFF)
    mass = 0.1 * 2.0 * 1.5 * dense  # the density in its middle is that at rest
    torque = np.cross(pose @ np.array([1.3, 0.55, 0.4]), [0, 0, GRAVITY * mass])
    for k, axis in enumerate("xyz"):
        force = GRAVITY * (mass + 10.0) if axis == "z" else 0.0
        assert result[f"body.joint_f{axis}"] == pytest.approx(force, rel=1e-8, abs=1e-9)
        assert result[f"body.joint_t{axis}"] == pytest.approx(torque[k], rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("way", ["pitches", "turns", "slides"])
def test_work_on_a_full_box_is_the_gain_and_the_loss_of_its_liquid(way):
    swing = {"mean": 0.0, "amplitude": 0.1, "period": 0.17}
    body = {
        "pitches": turning(swing, (0, 1, 0)),
        "turns": turning(swing),
        "slides": sliding(swing),
    }[way]
    basin = full((16, 12), at=[-0.8, -0.5, 0.6], attitude=TILT, wave_speed=60.0)
    parts = []
    for step in (4e-4, 2e-4):
        found = energy(case_of(body, basin, 0.16, step=step))
        passed = max(np.abs(one).max() for one in found.supplied.values())
        assert passed > 100.0
        assert found.law == {} or max(np.abs(one).max() for one in found.law.values()) == 0.0
        scheme = sum(found.scheme.values())
        assert (np.diff(scheme) > -1e-4 * passed).all()
        parts.append((abs(found.step[-1]) / passed, scheme[-1] / passed))
    assert parts[1][0] < parts[0][0] / 6.0 and parts[1][0] < 1e-6
    assert 0.0 <= parts[1][1] < 0.04


# free ----------


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_full_box_on_a_spring_swings_at_the_root_of_the_tangent_law(law):
    """stiff - M w^2 - m w^2 tan(s) / s = 0, with s = w L / (2 c)."""
    mass, stiff, long, c, dense = 100.0, 4e6, 2.0, 200.0, RHO
    if law == "log":
        dense *= math.exp((REST - AMBIENT) / STIFF)
    liquid = 0.1 * long * 0.5 * dense

    def tangent(w):
        s = 0.5 * w * long / c
        return stiff - mass * w * w - liquid * w * w * math.tan(s) / s

    w = brentq(tangent, 1.0, math.pi * c / long * 0.999)
    k, speed = w / c, 1e-4
    ratio, errors = math.tan(0.5 * k * long), []
    for n in (20, 40):
        flow = f"{speed} * (cos({k} * x) + {ratio} * sin({k} * x) - 1)"
        basin = full((n, 1), (long, 0.5), wave_speed=c, start={"u": flow})
        world = {"type": "frame", "points": {"far": [5.0, 0, 0]}}
        spring = {
            "type": "spring",
            "from": "body",
            "to": "world.far",
            "stiffness": stiff,
            "preload": 0.0,
        }
        case = scene(
            {"body": cart(mass, rate=speed), "world": world, "b": basin},
            {"spring": spring},
            0.06,
            {"scheme": "upwind5", "method": "rk4", "step": 0.5 * long / n / c},
            ["body.rate"],
            every=5e-4,
            fluid=FLUIDS[law],
        )
        result = run(case)
        errors.append(np.abs(result["body.rate"] - speed * np.cos(w * result.t)).max() / speed)
    assert errors[1] < errors[0] / 2.5
    assert errors[1] < 5e-3


@pytest.mark.parametrize("law", FLUIDS)
def test_a_free_box_on_rails_conserves_its_momentum(law):
    start = {"pressure": "2e5 * exp(-20 * (x - 0.5)**2)", "u": "0.2 * sin(1.5707963 * x)"}
    case = case_of(cart(50.0, rate=0.3), full((30, 4), (2.0, 0.5), start=start), 4e-3, law)
    model = model_of(case)
    basin, at = model.meshed[0], model.state_names.index("body.travel_rate")

    def momentum(y):
        found, area = basin.deviations(y), 0.1 * basin.mesh.area
        v = 0.3 + y[at]
        return 50.0 * v + np.sum(area * ((basin.density + found[0]) * v + found[1]))

    state = advance(model, State(0.0, model.start.copy()), 4e-3)
    assert abs(state.y[at]) > 1e-2
    assert momentum(state.y) == pytest.approx(momentum(model.start), rel=1e-12)


def slipping(long, wide):
    """Effective inertia of the liquid per mass [m2]: polar moment minus that of Saint-Venant's torsion."""
    rows = sum(math.tanh(0.5 * n * math.pi * long / wide) / n**5 for n in range(1, 60, 2))
    torsion = wide**2 / 3.0 * (1.0 - 192.0 / math.pi**5 * wide / long * rows)
    return (long**2 + wide**2) / 12.0 - torsion


@pytest.mark.parametrize("law", ["linear", "log"])
def test_an_upright_box_on_a_pin_oscillates_as_a_pendulum_with_a_slipping_liquid(law):
    long, high, arm, angle, end = 1.0, 0.6, 0.5, 1e-2, 0.5
    body = {
        "type": "body",
        "mass": 5.0,
        "inertia": [1.0, 1.0, 1.0],
        "joint": {
            "kind": "revolute",
            "axis": [0, 0, 1],
            "attitude": {"roll": "90 deg"},
            "angle": angle,
        },
    }
    mass = (
        0.1 * long * high * RHO * (1.0 if law == "linear" else math.exp((REST - AMBIENT) / STIFF))
    )
    w = math.sqrt(mass * GRAVITY * arm / (1.0 + mass * (arm**2 + slipping(long, high))))
    errors = []
    for n in (10, 20):
        basin = full(
            (n, n), (long, high), at=[-0.5 * long, -arm - 0.5 * high, 0.0], wave_speed=400.0
        )
        result = run(
            case_of(
                body, basin, end, law, ["body.angle"], scheme="upwind5", method="rk4", courant=0.9
            )
        )
        errors.append(np.abs(result["body.angle"] - angle * np.cos(w * result.t)).max() / angle)
    assert errors[1] < errors[0] / 2.0
    assert errors[1] < 5e-3


@pytest.mark.parametrize("method", ["gauss-4", "rodas-4"])
def test_implicit_methods_agree_on_a_box_that_is_free_to_turn(method):
    """Implicit methods converge to rk4, so their Jacobian contains the coupling of box and body."""
    body = {**HEAVY, "joint": {"kind": "revolute", "axis": [1, 0, 0], "angle": 0.4, "rate": 3.0}}
    basin = full(
        (5, 4),
        (1.0, 0.8),
        at=[-0.2, 0.3, 0.1],
        attitude={"roll": "70 deg", "yaw": "20 deg"},
        wave_speed=60.0,
    )
    errors = []
    for step in (1e-3, 5e-4):
        found = []
        for one in ("rk4", method):
            numerics = {"scheme": "upwind5", "method": one, "step": step}
            result = run(
                case_of(body, basin, 0.02, "log", ["body.angle", "b.pressure@0.3,0.2"], **numerics)
            )
            found.append(np.array([result["body.angle"], 1e-5 * result["b.pressure@0.3,0.2"]]))
        errors.append(np.abs(found[1] - found[0]).max())
    assert errors[1] < errors[0] / 8.0
    assert errors[1] < 2e-6


# open ----------


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("side", [{"boundary": "open"}, {"impedance": 0.0}])
def test_liquid_beyond_an_open_side_rests_in_the_same_axes(side, law):
    body = {**HEAVY, "joint": {"kind": "fixed", "attitude": TILT}}
    _, found = after(
        case_of(body, full(patches={"gap": {"side": "east", **side}}), 0.01, law), 0.01
    )
    assert np.abs(found[1:]).max() < 1e-12


def test_energy_and_joints_are_refused_by_name_where_a_side_is_open():
    gap = {"gap": {"side": "east", "boundary": "open"}}
    water = {"physics": "free-surface", "level": 0.3, "pressure": None, "thickness": None}
    for more in ({}, water):
        basin = {key: one for key, one in {**full(patches=gap), **more}.items() if one is not None}
        with pytest.raises(
            FvsolveError, match="a basin on a body with an open side is not supported"
        ):
            energy(case_of(turning(straight(1.0, 100.0)), basin, 0.01))
        with pytest.raises(CaseError, match=r"joint load omits the flow through b\.gap\."):
            model_of(case_of(turning(straight(1.0, 100.0)), basin, 0.01, probes=["body.joint_fz"]))


# faults ----------

FAULTS = {
    "on a body has only": ({}, {"sloshing": "frozen"}),
    "goes? by|on a body has only .cells.": ({}, {"sloshing": "modes"}),
    "a basin on a body cannot have moving walls": (
        {},
        {"patches": {"lid": {"side": "east", "travel": 0.1}}},
    ),
    "and the reaction to outflow": (
        {"joint": {"kind": "prismatic", "axis": [1, 0, 0]}},
        {"patches": {"gap": {"side": "east", "impedance": 0.0}}},
    ),
    "give the position in the axes of body as `at`": ({}, {"elevation": 1.0}),
}


@pytest.mark.parametrize("text", FAULTS)
def test_features_that_a_liquid_on_a_body_does_not_support_are_refused_by_name(text):
    body, keys = FAULTS[text]
    with pytest.raises(CaseError, match=text):
        load(case_of({**turning(straight(1.0, 100.0)), **body}, full(**keys), 1.0))
