"""Networks that move their bodies, against Lagrange's equations (docs/course.md, 70) and conserved quantities."""

import numpy as np
import pytest
from reference.jacobians import stray
from reference.refusals import messages_of
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, area, scene
from reference.u_tubes import BORE, DEPTH, HALF, LEVEL, ROLL, TANK, u_tube
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares

import fvsolve as fv
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.build import build
from fvsolve.core.solve import initial_state
from fvsolve.errors import CaseError
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.studies.energy_balance import energy

# hull: mass [kg], depth of its centre [m], inertia about it [kg m2]
MASS, LOW, TURN = 60e3, 0.8, 4e5
START = 0.15  # angle [rad]
BODY = {
    "type": "body",
    "mass": MASS,
    "inertia": [TURN, 2 * TURN, 2 * TURN],
    "centre_of_mass": [0, 0, -LOW],
}


def free(**drawn):
    """Return a case of the U-tube on a hull that rolls freely."""
    case = u_tube(**{"minor_loss": 0.0, **drawn})
    axis = case["nodes"]["hull"]["joint"]["axis"]
    case["nodes"]["hull"] = {
        **BODY,
        "inertia": [TURN] * 3,
        "joint": {"kind": "revolute", "axis": axis, "angle": START},
    }
    case["output"]["probes"] += ["hull.angle"]
    return case


def hull_and_water():
    """Return a function of (angle, angle', z, z') for (angle'', z'') by Lagrange's equations (docs/course.md, 70).

    The flow relative to the arms has no kinetic energy.
    """
    sp = pytest.importorskip("sympy", reason="derives Lagrange's equations")
    t, s = sp.symbols("t s")
    angle, z = sp.Function("angle")(t), sp.Function("z")(t)
    bore = sp.Float(area(BORE))
    turn = sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])
    action = (TURN + MASS * LOW**2) * angle.diff(t) ** 2 / 2 + MASS * GRAVITY * LOW * sp.cos(angle)
    for place, tangent, size, low, high, own in (
        ([s, -DEPTH], [1, 0], bore, -HALF, HALF, 1),
        ([HALF, -DEPTH + s], [0, 1], TANK, 0, LEVEL + z, 0),
        ([-HALF, -DEPTH + s], [0, -1], TANK, 0, LEVEL - z, 0),
    ):
        where = turn * sp.Matrix(place)
        drag, slide = where.diff(t), turn * sp.Matrix(tangent) * TANK * z.diff(t) / size
        square = drag.dot(drag) + 2 * drag.dot(slide) + own * slide.dot(slide)
        action += (
            RHO * size * sp.integrate(sp.expand(square / 2 - GRAVITY * where[1]), (s, low, high))
        )
    left = [action.diff(one.diff(t)).diff(t).doit() - action.diff(one) for one in (angle, z)]
    a, b, c, x, v, w = sp.symbols("a b c x v w")
    derivatives = (
        (angle.diff(t, 2), c),
        (z.diff(t, 2), w),
        (angle.diff(t), b),
        (z.diff(t), v),
        (angle, a),
        (z, x),
    )
    for old, new in derivatives:
        left = [one.subs(old, new) for one in left]
    matrix = sp.Matrix(2, 2, lambda i, j: left[i].diff((c, w)[j]))
    right = sp.Matrix([-one.subs({c: 0, w: 0}) for one in left])
    both = sp.lambdify((a, b, x, v), (matrix, right))
    return lambda *now: np.linalg.solve(*(np.array(one, dtype=float) for one in both(*now))).ravel()


WAYS = {
    "as drawn": ({}, {}),
    "the duct to starboard": ({"swap": True}, {}),
    "bow along y": ({"turned": True}, {}),
    "implicit": ({}, {"method": "radau-iia-5", "rtol": 1e-8}),
}


@pytest.fixture(scope="module")
def truth():
    rates = hull_and_water()

    def rhs(t, y):
        c, w = rates(*y)
        return [y[1], c, y[3], w]

    return solve_ivp(
        rhs, (0, 20), [START, 0, 0, 0], rtol=1e-11, atol=1e-12, method="DOP853", dense_output=True
    ).sol


@pytest.mark.parametrize("way", WAYS)
def test_a_free_hull_and_the_water_in_its_u_tube_obey_lagrange(way, truth):
    drawn, numerics = WAYS[way]
    case = free(**drawn)
    case["numerics"] |= numerics
    run = fv.run(case)
    angle, _, rise, _ = truth(run.t)
    assert np.max(np.abs(rise)) > 0.3
    assert run["hull.angle"] == pytest.approx(angle, abs=1e-6)
    assert run["port.level"] - LEVEL == pytest.approx(rise, abs=1e-6)


def test_a_cart_with_a_u_tube_on_rails_conserves_the_total_momentum():
    case = u_tube(
        minor_loss=0.0, route=[[0, HALF, -DEPTH - 0.5], [0, -HALF, -DEPTH - 0.5]], length=9.5
    )
    slides = {"kind": "prismatic", "axis": [0, 1, 0], "travel": 0.0, "rate": 0.3}
    case["links"]["duct"]["length"] = 9.5
    case["links"]["duct"] |= {"from": "port", "to": "starboard"}
    case["nodes"]["hull"] = {**BODY, "joint": slides}
    case["nodes"]["port"]["level"] = LEVEL + 0.3
    case["output"]["probes"] += ["hull.vy"]
    run = fv.run(case)
    water = RHO * (TANK * (2 * LEVEL + 0.3) + area(BORE) * 9.5)
    # the duct runs towards -y
    momentum = (MASS + water) * run["hull.vy"] - RHO * run["duct.flow"] * 2 * HALF
    assert np.ptp(run["hull.vy"]) > 1e-3
    assert momentum == pytest.approx(momentum[0], rel=1e-8)


OBLIQUE = {"port": [1.0, 3.0, -1.5], "starboard": [-2.0, -2.5, -1.0]}
ROUTE = [[1.0, 1.0, -2.0], [-1.0, 0.5, -2.5]]


def line_inertia(mass, a, b):
    """Inertia about the origin of a line of uniform mass from a to b : float64[3, 3]."""
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    return mass * (apart(middle) + apart(half) / 3.0)


def apart(r):
    return r @ r * np.eye(3) - np.outer(r, r)


def oblique(joint, **body):
    """Return a case of the U-tube along an oblique route, on a hull with the joint `joint`."""
    case = u_tube(minor_loss=0.0, route=ROUTE, length=9.0, diameter=WIDE)
    case["nodes"]["hull"] = {**BODY, "inertia": OWN.tolist(), **body, "joint": joint}
    for name, at in OBLIQUE.items():
        case["nodes"][name] |= {"at": at, "area": 3.0, "level": 2.0}
    what = ["eta", "eps_x", "eps_y", "eps_z", "wx", "wy", "wz"]
    case["output"]["probes"] = [
        "duct.flow",
        "port.level",
        "starboard.level",
        *(f"hull.{one}" for one in what),
    ]
    case["numerics"]["end"] = 6.0  # before the tank starboard is empty
    return case


WIDE, OWN = 1.0, np.diag([4e5, 6e5, 5e5])
BALL = {
    "kind": "ball",
    "attitude": {"roll": 0.1, "pitch": -0.05, "yaw": 0.4},
    "rate": [0.1, -0.05, 0.15],
}


def of_all(case, run):
    """Return totals over time: kinetic energy, total energy, momentum, angular momentum, weight, torque against it.

    Angular momentum and torque are about the origin; each row has 12 numbers.
    """
    duct, foot = case["links"]["duct"], {name: np.array(at) for name, at in OBLIQUE.items()}
    way = [
        foot[duct["from"]],
        *map(np.array, ROUTE if duct["from"] == "port" else ROUTE[::-1]),
        foot[duct["to"]],
    ]
    lengths = [float(np.linalg.norm(b - a)) for a, b in zip(way, way[1:], strict=False)]
    low, found = np.array([0, 0, -LOW]), []
    for k in range(len(run.t)):
        h, e = run["hull.eta"][k], np.array([run[f"hull.eps_{one}"][k] for one in "xyz"])
        skew = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
        turn = np.eye(3) + 2 * h * skew + 2 * skew @ skew
        spin = turn.T @ [run[f"hull.w{one}"][k] for one in "xyz"]
        flow, whole, first = RHO * run["duct.flow"][k], OWN + MASS * apart(low), MASS * low
        swept, moved, total = np.zeros(3), np.zeros(3), MASS
        for a, b, length in zip(way, way[1:], lengths, strict=False):
            mass = RHO * area(WIDE) * 9.0 * length / sum(lengths)
            whole, first, total = (
                whole + line_inertia(mass, a, b),
                first + 0.5 * mass * (a + b),
                total + mass,
            )
            swept, moved = swept + np.cross(a, b), moved + b - a
        for name, sign in ((duct["from"], -1.0), (duct["to"], 1.0)):
            a, up = foot[name], run[f"{name}.level"][k] * np.array([0, 0, 1.0])
            mass = RHO * 3.0 * up[2]
            whole, first, total = (
                whole + line_inertia(mass, a, a + up),
                first + mass * (a + 0.5 * up),
                total + mass,
            )
            swept, moved = swept + sign * np.cross(a, up), moved + sign * up
        kinetic = (
            0.5 * spin @ whole @ spin
            + flow * spin @ swept
            + 0.5 * flow**2 * 9.0 / (RHO * area(WIDE))
        )
        high, weight = turn @ first, GRAVITY * total
        found.append(
            [
                kinetic,
                kinetic + GRAVITY * high[2],
                *(turn @ (np.cross(spin, first) + flow * moved)),
                *(turn @ (whole @ spin + flow * swept)),
                weight,
                *np.cross(high, [0, 0, GRAVITY]),
            ]
        )
    return np.array(found)


def test_a_body_on_a_ball_conserves_its_energy_and_its_spin_about_the_vertical_with_all_flows():
    case = oblique(BALL)
    run = fv.run(case)
    kinetic, energy, about = of_all(case, run)[:, [0, 1, 7]].T
    assert np.ptp(kinetic) > 1e3 and np.ptp(run["duct.flow"]) > 0.1
    assert np.ptp(energy) < 1e-6 * np.ptp(kinetic)
    assert np.ptp(about) < 1e-6 * np.max(np.abs(about))


TURNED = {"kind": "revolute", "axis": [1, 0.3, -0.2], "angle": ROLL}


@pytest.mark.parametrize("joint", [BALL, TURNED], ids=["ball", "driven"])
def test_force_in_a_joint_is_the_rate_of_all_momentum_less_the_weight(joint):
    case = oblique(joint)
    held = [f"hull.joint_{one}{axis}" for one in "ft" for axis in "xyz"]
    case["output"]["probes"] += held
    case["output"]["every"] = step = 0.02
    run = fv.run(case)
    found = of_all(case, run)
    # fourth order
    rate = (8 * (found[3:-1] - found[1:-3]) - (found[4:] - found[:-4]))[:, 2:8] / (12 * step)
    rate[:, 2] += found[2:-2, 8]
    rate[:, 3:] += found[2:-2, 9:]
    size = np.max(np.abs(rate))
    assert np.array([run[one] for one in held]).T[2:-2] == pytest.approx(rate, abs=1e-8 * size)
    if joint is BALL:
        assert np.max(np.abs(rate[:, 3:])) < 1e-8 * size


@pytest.mark.parametrize("swap", [False, True])
def test_the_energy_of_a_free_hull_with_its_water_stays_but_for_steps(swap):
    losses = []
    for step in (0.1, 0.05):
        case = free(swap=swap)
        case["numerics"] = {"end": 20.0, "method": "rk4", "step": step}
        found = energy(fv.load(case))
        losses.append(abs(found.remainder[-1]))
    assert losses[1] < 0.1 * losses[0] < 1e-5 * found.throughput
    assert not found.supplied and not found.dissipated and found.throughput > 1e4


# pipes ----------

LONG, FAST, CART, VOLUME, STIFF = 20.0, 1000.0, 300.0, 0.02, 2e6
BETA = WATER["bulk_modulus"]


def cart(law="linear", cells=20, mass=CART, **numerics):
    """Return a case of a moving cart on a spring that carries a pipe between two chambers."""

    def chamber(x):
        return {
            "type": "chamber",
            "volume": VOLUME,
            "initial_pressure": AMBIENT,
            "on": "cart",
            "at": [x, 0, 0],
        }

    nodes = {
        "cart": {
            "type": "body",
            "mass": mass,
            "inertia": [1.0] * 3,
            "points": {"eye": [0, 0, 0]},
            "joint": {"kind": "prismatic", "axis": [1, 0, 0], "travel": 0.0, "rate": 0.1},
        },
        "ground": {"type": "frame", "points": {"eye": [-5.0, 0, 0]}},
        "a": chamber(-LONG / 2),
        "b": chamber(LONG / 2),
    }
    links = {
        "pipe": {
            "type": "pipe",
            "from": "a",
            "to": "b",
            "length": LONG,
            "diameter": 0.1,
            "wave_speed": FAST,
            "cells": cells,
        },
        "spring": {
            "type": "spring",
            "from": "ground.eye",
            "to": "cart.eye",
            "stiffness": STIFF,
            "free_length": 5.0,
        },
    }
    case = scene(
        nodes,
        links,
        0.5,
        {"scheme": "upwind5", "method": "rk4", "courant": 0.8, **numerics},
        ["cart.vx"],
        every=1e-3,
    )
    case["fluid"] = {**WATER, "law": law}
    return case


def out_of_tune(w):
    """Frequency equation K - M w^2 - 2 rho A w^2 (B / k) sin(k L / 2), zero at the frequencies of the cart.

    In a cart of velocity v the fluid has the relative velocity u, with u + v = v B cos(k x). The chambers have p' =
    beta A u / V and are part of M. With closed ends it would be K - M w^2 - 2 rho c A w tan(w L / (2 c)).
    """
    k, yields = w / FAST, BETA * area(0.1) / (VOLUME * RHO * FAST**2)
    sine, cosine = np.sin(k * LONG / 2), np.cos(k * LONG / 2)
    swings = yields / (yields * cosine - k * sine)
    return STIFF - w**2 * (CART + 2 * RHO * VOLUME) - 2 * w**2 * RHO * area(0.1) * swings * sine / k


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_sprung_cart_swings_with_the_waves_in_its_pipe(law):
    run, first = fv.run(cart(law)), [brentq(out_of_tune, 40, 63), brentq(out_of_tune, 150, 180)]

    def rest(rates):
        waves = np.hstack([np.sin(np.outer(run.t, rates)), np.cos(np.outer(run.t, rates))])
        return run["cart.vx"] - waves @ np.linalg.lstsq(waves, run["cart.vx"], rcond=None)[0]

    found = least_squares(rest, first, x_scale=first, xtol=1e-14, ftol=1e-14).x
    frozen = np.sqrt(STIFF / (CART + 2 * RHO * VOLUME + RHO * area(0.1) * LONG))
    assert abs(found[0] / frozen - 1.0) > 0.01
    assert found == pytest.approx(first, rel=5e-5)


RIG = {
    "type": "body",
    "mass": 60.0,
    "inertia": [40.0, 90.0, 100.0],
    "centre_of_mass": [0.1, 0.05, -0.2],
}
FLIES = {"kind": "free", "rate": [0.3, -0.2, 0.4], "velocity": [0.1, 0.2, 0.0]}
RAILS = {"kind": "prismatic", "axis": [1, 0, 0], "travel": 0.0, "rate": 0.2}


def rig(joint, law="linear", tanks=False, cells=8, gravity=1e-12, **numerics):
    """Return a case of an oblique network on one body: two pipes with a valve that shuts between them.

    Rigid columns join the pipes to chambers, or to tanks if `tanks` is True.
    """

    def store(at, level, pressure):
        if tanks:
            return {"type": "tank", "on": "rig", "at": at, "area": 0.5, "level": level}
        return {
            "type": "chamber",
            "on": "rig",
            "at": at,
            "volume": 0.05,
            "initial_pressure": pressure,
        }

    places = {"l": [-2, 0.5, 0], "m": [0, 0.5, 0.3], "n": [0, 0.5, 0.3], "r": [2, 1.0, 0]}
    nodes = {
        "rig": {**RIG, "joint": joint},
        "left": store([-3, 0, 0], 2.5, 9e5),
        "right": store([3, 1, 0.5], 0.6, 3e5),
        "pot": {"type": "chamber", "on": "rig", "at": places["n"], "volume": 0.01},
        **{name: {"type": "junction", "on": "rig", "at": at} for name, at in places.items()},
    }
    pipe = {"type": "pipe", "diameter": 0.1, "wave_speed": 1000.0, "cells": cells}
    column = {"type": "rigid-column", "diameter": 0.1}
    shuts = {"time": [0.05, 0.15], "value": [1.0, 0.0]}
    links = {
        "in": {**column, "from": "left", "to": "l", "length": 1.2},
        "first": {**pipe, "from": "l", "to": "m", "length": 2.05},
        "gate": {
            "type": "valve",
            "from": "m",
            "to": "n",
            "area": 0.004,
            "opening": shuts,
            "discharge_coefficient": 0.6,
        },
        "drip": {
            "type": "orifice",
            "from": "n",
            "to": "pot",
            "area": 1e-4,
            "discharge_coefficient": 0.6,
        },
        "second": {**pipe, "from": "r", "to": "n", "length": 2.4},
        "out": {**column, "from": "r", "to": "right", "length": 1.3},
    }
    case = scene(
        nodes,
        links,
        0.3,
        {"scheme": "upwind5", "method": "rk4", "step": 2e-4, "initial": "rest", **numerics},
        ["rig.vx", "gate.flow"],
        every=1e-3,
        gravity=gravity,
    )
    case["fluid"] = {**WATER, "law": law}
    return case


def momenta(model, t, y):
    """Momentum and angular momentum about the origin of the world, of a body with its network : float64[6]."""
    out, tables, found = model.evaluate(t, y)[1], model.tables, np.zeros(6)
    row, linear = out[int(model.layout["body"]) :], model.case.law.linear
    # see `kernels.moving_frames`
    turn, place, speed, spin = row[:9].reshape(3, 3), row[9:12], row[12:15], row[15:18]

    def add(momentum, r, own=0.0):
        found[:3] += momentum
        found[3:] += np.cross(place + turn @ r, momentum) + own

    def line(mass, a, b, flow=0.0):
        half, r = turn @ (b - a) / 2, (a + b) / 2
        carried = mass * (speed + np.cross(spin, turn @ r))
        add(carried + 2.0 * flow * half, r, mass / 3.0 * np.cross(half, np.cross(spin, half)))

    body, levels = motion_of(model).body_table[0], {}
    segments = motion_of(model).moving_segment_table
    line(body["mass"], body["centre"], body["centre"])
    found[3:] += turn @ body["inertia"].reshape(3, 3) @ turn.T @ spin
    for i, node in enumerate(tables.nodes):
        r = segments[node["forcing"]]["start"]
        mass = node["mass"] + (y[node["y"]] if node["y"] >= 0 else 0.0)
        levels[i] = np.array(
            [0, 0, mass / (node["density"] * node["area"]) if node["kind"] == rec.TANK else 0.0]
        )
        line(mass, r, r + levels[i])
    for pipe in tables.pipes:
        for k in range(n := int(pipe["cells"])):
            forth, back, ride = (
                y[pipe["y"] + k],
                y[pipe["y"] + n + k],
                segments[pipe["forcing"] + k],
            )
            per = RHO * pipe["area"] if linear else tables.profile[pipe["center"] + k]
            mass = (per + (forth + back) / pipe["speed"]) * pipe["dx"]
            line(mass, ride["start"], ride["end"], pipe["flow"] + forth - back)
    for column in tables.columns:
        flow, ride = column["flow"] + y[column["y"]], segments[column["forcing"]]
        line(RHO * column["area"] * column["length"], ride["start"], ride["end"], flow)
        for i, sign in ((column["from_node"], -1.0), (column["to_node"], 1.0)):
            foot = segments[tables.nodes[i]["forcing"]]["start"]
            line(0.0, foot, foot + levels[i], sign * flow)
    return found


def drift(case):
    """Return (greatest change of the momenta in a run, momenta at the start)."""
    model = build(fv.load(case))
    state = initial_state(model)
    first, most = momenta(model, state.t, state.y), np.zeros(6)
    for t in np.linspace(0.0, case["numerics"]["end"], 7)[1:]:
        state = fv.advance(model, state, t)
        most = np.maximum(most, np.abs(momenta(model, state.t, state.y) - first))
    return most, first


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("tanks", [False, True])
def test_a_rig_on_rails_conserves_its_momentum_while_a_valve_shuts_between_its_pipes(tanks, law):
    case = rig(RAILS, law, tanks, gravity=GRAVITY if tanks else 1e-12)
    run = fv.run(case)
    assert np.ptp(run["gate.flow"]) > 1e-3 and np.ptp(run["rig.vx"]) > 1e-5
    most, first = drift(case)
    assert most[0] < 1e-11 * first[0]


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_rig_in_free_flight_conserves_all_momenta_to_the_order_of_steps_and_cells(law):
    found = [
        drift(rig(FLIES, law, cells=cells, step=step))
        for cells, step in ((8, 2e-4), (8, 1e-4), (16, 1e-4))
    ]
    straight, spun = (
        [np.max(most[part]) for most, _ in found] for part in (slice(0, 3), slice(3, 6))
    )
    size = np.linalg.norm(found[0][1][3:])
    assert straight[1] < 0.1 * straight[0] < 1e-8 * np.linalg.norm(found[0][1][:3])
    # fluxes of faces equal momenta of cells to second order
    assert spun[2] < 0.4 * spun[1] < 1e-8 * size


@pytest.mark.in_turn
@pytest.mark.parametrize("tanks", [False, True])
@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_energy_of_a_rig_in_free_flight_closes_but_for_steps_cells_and_valves(law, tanks):
    found = [
        energy(fv.load(rig(FLIES, law, tanks, cells, GRAVITY, step=step, end=0.15)))
        for cells, step in ((8, 2e-4), (8, 1e-4), (16, 1e-4))
    ]
    through = found[0].throughput
    assert abs(found[1].step[-1]) < 0.15 * abs(found[0].step[-1]) < 1e-4 * through
    lost = [sum(abs(one[-1]) for one in ledger.scheme.values()) for ledger in found]
    assert lost[2] < 0.4 * lost[1] < 2e-3 * through
    assert all(abs(one[-1]) < 1e-4 * through for one in found[1].law.values())


def test_a_light_body_with_a_pipe_is_stepped_as_its_waves_brake_it():
    case = cart(mass=2.0)
    case["numerics"]["end"] = 0.05
    for name in ("a", "b"):
        case["nodes"][name] = {"type": "junction", "on": "cart", "at": case["nodes"][name]["at"]}
    case["nodes"]["still"] = {**case["nodes"]["a"], "type": "reservoir", "pressure": AMBIENT}
    case["links"]["leak"] = {
        "type": "orifice",
        "from": "still",
        "to": "a",
        "area": 1e-6,
        "discharge_coefficient": 0.6,
    }
    brakes = 2 * RHO * FAST * area(0.1) / 2.0  # rho c A of both ends over the mass [1/s]
    model = build(fv.load(case))
    assert model.evaluate(0.0, model.start)[1][rec.RATE] == pytest.approx(brakes, rel=0.2)
    assert np.max(np.abs(fv.run(case)["cart.vx"])) < 0.1001
    case["numerics"] |= {"courant": None, "step": 3.0 / brakes}
    case["numerics"].pop("courant")
    assert not fv.run(case).ok  # beyond the limit of rk4, 2.785


def test_a_duct_that_is_mostly_a_pipe_is_the_former_rigid_column(truth):
    case = free()
    ends = {"port": HALF, "starboard": -HALF}
    for name, y in ends.items():
        at = [0, y * 0.75, -DEPTH]
        case["nodes"][f"{name}_mouth"] = {"type": "junction", "on": "hull", "at": at}
        case["links"][f"{name}_way"] = {
            "type": "rigid-column",
            "from": name,
            "to": f"{name}_mouth",
            "length": HALF / 4,
            "diameter": BORE,
        }
    case["links"]["duct"] = {
        "type": "pipe",
        "from": "port_mouth",
        "to": "starboard_mouth",
        "length": 1.5 * HALF,
        "diameter": BORE,
        "wave_speed": 1000.0,
        "cells": 4,
    }
    case["numerics"] = {"end": 10.0, "scheme": "upwind5", "method": "rk4", "courant": 0.9}
    case["output"]["probes"].remove("duct.flow")
    run = fv.run(case)
    angle, _, rise, _ = truth(run.t)
    assert run["hull.angle"] == pytest.approx(angle, abs=2e-4 * np.ptp(angle))
    assert run["port.level"] - LEVEL == pytest.approx(rise, abs=2e-4 * np.ptp(rise))


@pytest.mark.parametrize(("change", "place", "text"), [
    ({"nodes": {"port": {"height": 2.0}}}, "nodes.port.height", "the reaction of the spilled water"),
    ({"nodes": {"port": {"area": {"level": [0, 1], "area": [1, 2]}}}}, "nodes.port.area", "a constant area"),
])  # fmt: skip
def test_features_without_effect_on_a_free_body_are_refused_by_name(change, place, text):
    case = free()
    for group, tables in change.items():
        for name, one in tables.items():
            case[group][name] = one if group == "fluid" else {**case[group][name], **one}
    assert text in messages_of(case)[place]


def test_a_pipe_at_a_tank_of_a_free_body_and_a_column_controlled_by_a_valve_are_refused_by_name():
    case = free()
    case["links"]["duct"] |= {"type": "pipe", "wave_speed": 1000.0}
    assert "expected a rigid-column at the tank" in messages_of(case)["links.duct"]
    case = free()
    case["nodes"]["mouth"] = {"type": "junction", "on": "hull", "at": [0, HALF, -DEPTH]}
    case["links"]["duct"][
        next(key for key in ("from", "to") if case["links"]["duct"][key] == "port")
    ] = "mouth"
    case["links"]["gate"] = {
        "type": "valve",
        "from": "port",
        "to": "mouth",
        "area": 0.1,
        "discharge_coefficient": 1.0,
    }
    found = messages_of(case)
    assert "neither the flow of a valve nor the tank has inertia" in found["links.gate"]
    assert "at mouth this column joins only valves and columns" in found["links.duct"]


@pytest.mark.parametrize("law", ["linear", "log"])
def test_couplings_of_bodies_and_pipes_are_in_the_pattern(law):
    model, rng = build(fv.load(rig(FLIES, law, gravity=GRAVITY, cells=6))), np.random.default_rng(1)
    assert stray(model, 0.1, model.scale * rng.normal(size=model.y_size)) < 1e-9


@pytest.mark.parametrize("joint", ["revolute", "ball"])
def test_couplings_of_bodies_and_columns_are_in_the_pattern(joint):
    case = free(minor_loss=2.0)
    case["nodes"]["hull"]["joint"] = {"kind": joint} | (
        {"axis": [1, 0, 0]} if joint == "revolute" else {}
    )
    case["output"]["probes"].remove("hull.angle")
    case["nodes"]["wheel"] = {**BODY, "joint": {"kind": "revolute", "axis": [0, 0, 1]}}
    model, rng = build(fv.load(case)), np.random.default_rng(1)
    assert stray(model, 0.0, model.scale * rng.normal(size=model.y_size)) < 1e-9


def test_tall_arms_on_a_hull_without_weight_are_reported():
    case = free()
    case["nodes"]["hull"] |= {"mass": 1.0, "inertia": [1.0] * 3}
    for name in ("port", "starboard"):
        case["nodes"][name] |= {"area": area(BORE), "level": 8.0}
    with pytest.raises(CaseError, match="outweighs its carrying body"):
        fv.run(case)
