"""Bodies in space against closed forms, Lagrange's equations and SciPy, with conserved quantities and orders."""

import math
from importlib import import_module

import numpy as np
import pytest
from pytest import approx
from reference.bodies import (
    CLOSE,
    COUPLER,
    CRANK,
    OIL,
    Crane,
    bodies,
    body,
    parallelogram,
    pendulum,
    random_tree,
    turn,
)
from reference.cylinders import valve_flow
from reference.jacobians import stray
from reference.scenes import AMBIENT, GRAVITY, scene
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import fvsolve
from fvsolve.studies import energy, linearise, stability


def run(case, **more):
    result = fvsolve.run(case, **more)
    assert result.ok, result.reason
    return result


def falls(t, values) -> np.ndarray:
    """Times at which a smooth series crosses zero downwards."""
    series = CubicSpline(t, values)
    return np.array(
        [one for one in series.roots(extrapolate=False) if series.derivative()(one) < 0.0]
    )


# joints and trees -------------------------------------------------------------------------------------------


def test_a_pendulum_swings_by_the_elliptic_integral():
    """T = 4 sqrt(l / g) K(sin^2(angle / 2)) of a swing with a large amplitude `angle`."""
    length, angle = 0.7, 2.0
    result = run(bodies({"arm": pendulum(angle, length)}, 10.0, ["arm.angle"], every=1e-3))
    period = 4.0 * math.sqrt(length / GRAVITY) * ellipk(math.sin(angle / 2.0) ** 2)
    assert np.diff(falls(result.t, result["arm.angle"])) == approx(period, rel=1e-8)


def test_a_pendulum_shows_the_order_of_its_method():
    length, angle = 0.7, 1.0
    period = 4.0 * math.sqrt(length / GRAVITY) * ellipk(math.sin(angle / 2.0) ** 2)
    errors = []
    for steps in (100, 200, 400):
        case = bodies(
            {"arm": pendulum(angle, length)},
            period,
            ["arm.angle", "arm.rate"],
            method="rk4",
            step=period / steps,
        )
        result = run(case)
        errors.append(abs(result["arm.rate"][-1]))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == approx(4.0, abs=0.2)


def test_a_double_pendulum_moves_by_lagranges_equations():
    """Two rods of length l with mass m in the middle; a and b are their angles to the vertical."""
    m, l, inertia = 1.5, 0.8, 0.09  # noqa: E741
    rod = {
        "inertia": [inertia, inertia, 0.0],
        "centre_of_mass": [0, 0, -l / 2],
        "points": {"end": [0, 0, -l]},
    }
    upper = body(m, **rod, joint={"kind": "revolute", "axis": [0, 1, 0], "angle": 1.2})
    lower = body(
        m, **rod, joint={"kind": "revolute", "on": "upper.end", "axis": [0, 1, 0], "angle": -0.5}
    )

    def rates(t, y):
        a, b, u, v = y
        c, s = math.cos(a - b), math.sin(a - b)
        mass = np.array(
            [
                [inertia + m * l * l * 1.25, m * l * l / 2 * c],
                [m * l * l / 2 * c, inertia + m * l * l / 4],
            ]
        )
        force = [
            -m * l * l / 2 * s * v * v - 1.5 * m * GRAVITY * l * math.sin(a),
            m * l * l / 2 * s * u * u - 0.5 * m * GRAVITY * l * math.sin(b),
        ]
        return [u, v, *np.linalg.solve(mass, force)]

    truth = solve_ivp(rates, (0.0, 3.0), [1.2, 0.7, 0.0, 0.0], rtol=1e-12, atol=1e-13).y[:, -1]
    result = run(bodies({"lower": lower, "upper": upper}, 3.0, ["upper.angle", "lower.angle"]))
    assert result["upper.angle"][-1] == approx(truth[0], abs=1e-7)
    assert result["lower.angle"][-1] == approx(truth[1] - truth[0], abs=1e-7)


def test_a_slider_on_a_turning_arm_feels_coriolis_and_centrifugal_terms():
    """r'' = r w^2, and (I + m r^2) w is constant, because the arm turns about the vertical."""
    arm = body(1.0, [0.0, 0.0, 0.0], {"kind": "revolute", "axis": [0, 0, 1], "rate": 2.0})
    bead = body(
        0.5, [0, 0, 0], {"kind": "prismatic", "on": "arm", "axis": [1, 0, 0], "travel": 0.3}
    )
    arm["inertia"] = [0.2, 0.2, 0.2]

    def rates(t, y):
        angle, r, w, v = y
        return [w, v, -2.0 * 0.5 * r * v * w / (0.2 + 0.5 * r * r), r * w * w]

    truth = solve_ivp(rates, (0.0, 1.0), [0.0, 0.3, 2.0, 0.0], rtol=1e-12, atol=1e-13).y[:, -1]
    result = run(
        bodies(
            {"arm": arm, "bead": bead}, 1.0, ["arm.angle", "bead.travel", "arm.rate", "bead.rate"]
        )
    )
    found = [result[probe][-1] for probe in ("arm.angle", "bead.travel", "arm.rate", "bead.rate")]
    assert found == approx(truth, abs=1e-8)


TUMBLING = {"kind": "free", "rate": [0.1, 2.0, 0.3], "velocity": [0.5, 0.0, 0.2]}
STONE = body(3.0, [0.3, 0.5, 0.7], TUMBLING, centre_of_mass=[0.2, -0.1, 0.3])
TURNS = [
    f"stone.{one}"
    for one in ("angular_momentum_x", "angular_momentum_y", "angular_momentum_z", "kinetic_energy")
]
WEIGHTLESS = {"gravity": 0.0}


def drift(method: str, step: float) -> float:
    case = {**bodies({"stone": STONE}, 8.0, TURNS, method=method, step=step), **WEIGHTLESS}
    result = run(case)
    return max(
        float(np.abs(result[one] / result[one][0] - 1.0).max())
        for one in TURNS
        if abs(result[one][0]) > 0.1
    )


def test_a_tumbling_body_conserves_energy_and_momentum_to_the_order_of_its_method():
    """Rotation about the middle axis is unstable, so the body turns over; the drift by rk4 falls as h^4 or faster."""
    coarse, fine = drift("rk4", 0.04), drift("rk4", 0.02)
    assert coarse < 1e-5 and coarse / fine > 14.0


def test_gauss_methods_keep_energy_and_momentum_of_a_tumbling_body_to_rounding():
    """Kinetic energy and angular momentum are quadratic invariants; the centre of mass is at rest."""
    joint = {"kind": "free", "rate": TUMBLING["rate"], "at": [-0.2, 0.1, -0.3]}
    case = {
        **bodies(
            {"stone": {**STONE, "joint": joint}},
            8.0,
            TURNS,
            every=0.04,
            method="gauss-4",
            step=0.02,
        ),
        **WEIGHTLESS,
    }
    result = run(case)
    for series in (result[TURNS[3]], np.linalg.norm([result[one] for one in TURNS[:3]], axis=0)):
        assert np.abs(series / series[0] - 1.0).max() < 1e-12


def test_a_tumbling_body_turns_as_euler_and_poisson_have_it():
    joint = {**TUMBLING, "attitude": {"roll": 0.3, "pitch": -0.4, "yaw": 1.0}}
    case = {
        **bodies(
            {"stone": {**STONE, "joint": joint}},
            4.0,
            [
                f"stone.{one}"
                for one in (
                    "eta",
                    "eps_x",
                    "eps_y",
                    "eps_z",
                    "wx",
                    "wy",
                    "wz",
                    "roll",
                    "pitch",
                    "yaw",
                )
            ],
        ),
        **WEIGHTLESS,
    }
    j = np.array(STONE["inertia"])

    def rates(t, y):
        e, w = y[:4], y[4:]
        return [
            *(0.5 * np.array([-e[1:] @ w, *(e[0] * w + np.cross(e[1:], w))])),
            *(np.cross(j * w, w) / j),
        ]

    first = Rotation.from_euler("ZYX", [1.0, -0.4, 0.3])
    e = first.as_quat()[[3, 0, 1, 2]]
    y = solve_ivp(rates, (0.0, 4.0), [*e, *TUMBLING["rate"]], rtol=1e-12, atol=1e-13).y[:, -1]
    result = run(case)
    found = np.array([result[f"stone.{one}"][-1] for one in ("eta", "eps_x", "eps_y", "eps_z")])
    assert found == approx(y[:4], abs=1e-8)
    there = Rotation.from_quat(y[[1, 2, 3, 0]])
    assert [result[f"stone.{one}"][-1] for one in ("wx", "wy", "wz")] == approx(
        there.apply(y[4:]), abs=1e-7
    )
    angles = [result[f"stone.{one}"][-1] for one in ("yaw", "pitch", "roll")]
    assert angles == approx(there.as_euler("ZYX"), abs=1e-7)


def test_a_top_precesses_steadily():
    """Steady precession on a ball joint: m g l = J3 (s + w c) w - J1' w^2 c.

    s is the spin about the z axis of the top, w the rate of precession and c the cosine of the tilt. l is the distance
    of the centre of mass from the joint, and J1' = J1 + m l^2.
    """
    m, l, tilt, w, j1, j3 = 0.5, 0.1, 0.6, 1.7, 2e-3, 1e-3  # noqa: E741
    about = j1 + m * l * l
    spin = (m * GRAVITY * l + (about - j3) * w * w * math.cos(tilt)) / (j3 * w)
    turned = Rotation.from_euler("Y", tilt).inv().apply([0.0, 0.0, w])
    joint = {"kind": "ball", "attitude": {"pitch": tilt}, "rate": [*turned[:2], turned[2] + spin]}
    top = body(m, [j1, j1, j3], joint, centre_of_mass=[0, 0, l], points={"tip": [0, 0, 1.0]})
    result = run(bodies({"top": top}, 2.0, ["top.tip.x", "top.tip.y", "top.tip.z"], every=0.05))
    assert result["top.tip.z"] == approx(math.cos(tilt), abs=1e-7)
    assert result["top.tip.x"] == approx(math.sin(tilt) * np.cos(w * result.t), abs=1e-6)
    assert result["top.tip.y"] == approx(math.sin(tilt) * np.sin(w * result.t), abs=1e-6)


# points -----------------------------------------------------------------------------------------------------

SHARES = ("relative", "coriolis", "transversal", "centripetal")


def test_the_terms_of_65_are_those_of_motion_seen_from_the_axes_that_move():
    """Terms of equation (65) of docs/course.md for a point on the third body of a chain, in the axes of the second.

    The relative velocity and acceleration are finite differences of the position in the axes of the second body.
    """
    rng = np.random.default_rng(5)
    tree = random_tree(rng, 3, "free")
    tree["b1"]["joint"]["on"], tree["b2"]["joint"]["on"] = "b0", "b1"
    names = [
        f"b2.p.{one}"
        for one in ("x", "y", "z", "ax", "ay", "az", *(f"a{k}_{s}" for s in SHARES for k in "xyz"))
    ]
    names += [
        f"b1.{one}"
        for one in ("x", "y", "z", "roll", "pitch", "yaw", "ax", "ay", "az", "wx", "wy", "wz")
    ]
    h = 1e-3
    result = run(bodies(tree, 0.4, names, every=h, method="gauss-4", step=h))
    k = 200

    def rows(name, axes="xyz"):
        return np.array([result[f"{name}{axis}"] for axis in axes]).T

    turns = Rotation.from_euler("ZYX", rows("b1.", ("yaw", "pitch", "roll")))
    seen = turns.inv().apply(rows("b2.p.") - rows("b1."))
    about = slice(k - 3, k + 4)
    weights = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180.0 * h * h)
    rates = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / (60.0 * h)
    w, turned = rows("b1.w")[k], turns[k]
    r = rows("b2.p.")[k] - rows("b1.")[k]
    v = turned.apply(rates @ seen[about])
    expected = {
        "relative": turned.apply(weights @ seen[about]),
        "coriolis": 2.0 * np.cross(w, v),
        "transversal": np.cross(rates @ rows("b1.w")[about], r),
        "centripetal": np.cross(w, np.cross(w, r)),
    }
    for share, value in expected.items():
        found = [result[f"b2.p.a{axis}_{share}"][k] for axis in "xyz"]
        assert found == approx(value, abs=2e-6 * max(1.0, np.abs(value).max())), share
    total = sum(expected.values()) + rows("b1.a")[k]
    assert rows("b2.p.a")[k] == approx(total, abs=1e-5)
    assert rows("b2.p.a")[k] == approx(weights @ rows("b2.p.")[about], abs=1e-5)


def test_joint_forces_of_a_pendulum_are_those_of_its_motion():
    result = run(
        bodies(
            {"arm": pendulum(1.0)},
            1.0,
            [
                "arm.angle",
                "arm.rate",
                "arm.joint_fx",
                "arm.joint_fz",
                "arm.bob.ax",
                "arm.bob.az",
                "arm.joint_ty",
            ],
        )
    )
    pull = 2.0 * (GRAVITY * np.cos(result["arm.angle"]) + 0.7 * result["arm.rate"] ** 2)
    assert np.hypot(result["arm.joint_fx"], result["arm.joint_fz"]) == approx(pull, rel=1e-9)
    assert result["arm.joint_fx"] == approx(2.0 * result["arm.bob.ax"], abs=1e-9)
    assert result["arm.joint_ty"] == approx(0.0, abs=1e-9)


@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
def test_the_spring_of_a_joint_pulls_its_angle_or_travel_back_to_0(method):
    k, c = 25.0, 0.4
    arm = pendulum(1.0)
    arm["joint"] |= {"stiffness": k, "damping": c}
    sled = {
        "type": "body",
        "mass": 3.0,
        "inertia": [1, 1, 1],
        "joint": {"kind": "prismatic", "axis": [0, 2, 0], "travel": 0.2, "stiffness": "12 N/cm"},
    }
    case = bodies(
        {"arm": arm, "sled": sled}, 1.5, ["arm.angle", "sled.travel"], method=method, step=1e-3
    )
    result, inertia = run(case), 2.0 * 0.7**2

    def rates(t, y):
        return [y[1], -(k * y[0] + c * y[1] + 2.0 * GRAVITY * 0.7 * math.sin(y[0])) / inertia]

    truth = solve_ivp(rates, (0.0, 1.5), [1.0, 0.0], rtol=1e-11, atol=1e-12, t_eval=result.t).y[0]
    assert result["arm.angle"] == approx(truth, abs=1e-6)
    assert result["sled.travel"] == approx(0.2 * np.cos(20.0 * result.t), abs=1e-7)
    ledger = energy(case)
    assert ledger.stored["sled"] == approx(0.0, abs=1e-6)  # kinetic plus elastic energy is constant
    assert abs(ledger.step[-1]) < 1e-6 and abs(ledger.remainder[-1]) < 1e-6


# force elements ---------------------------------------------------------------------------------------------


def held(links: dict, nodes: dict, end: float, probes, **numerics):
    ground = {"type": "frame", "points": {"hook": [1.0, 0.0, 2.0], "low": [0.0, 0.0, -0.25]}}
    return bodies({**nodes, "ground": ground}, end, probes, links, **numerics)


def test_springs_dampers_and_forces_push_along_the_line_between_points():
    crane, k, c, free = Crane(), 2000.0, 50.0, 1.5
    boom = crane.nodes()["boom"]
    links = {
        "spring": {
            "type": "spring",
            "from": "ground.hook",
            "to": "boom.tip",
            "stiffness": k,
            "free_length": free,
        },
        "damper": {"type": "damper", "from": "boom.tip", "to": "ground.hook", "damping": c},
        "pull": {"type": "force", "from": "boom.tip", "to": "ground.hook", "force": -30.0},
        "load": {"type": "force", "to": "boom.tip", "force": 20.0, "direction": [0, 0, -2]},
        "motor": {"type": "torque", "to": "boom", "torque": 40.0, "axis": [0, -3, 0]},
    }

    def rates(t, y):
        angle, w = y
        tip, along = (
            np.array([math.cos(angle), math.sin(angle)]),
            np.array([-math.sin(angle), math.cos(angle)]),
        )
        far = tip - np.array([1.0, 2.0])
        length = np.linalg.norm(far)
        e = far / length
        push = -k * (length - free) - c * w * (e @ along) - 30.0
        weight = crane.mass * GRAVITY * crane.length / 2.0 * math.cos(angle)
        return [w, (push * (e @ along) - weight - 20.0 * math.cos(angle) + 40.0) / crane.inertia]

    truth = solve_ivp(rates, (0.0, 2.0), [0.0, 0.0], rtol=1e-12, atol=1e-13).y[:, -1]
    result = run(held(links, {"boom": boom}, 2.0, ["boom.angle", "boom.rate", "spring.force"]))
    assert [result["boom.angle"][-1], result["boom.rate"][-1]] == approx(truth, abs=1e-7)
    assert result["spring.force"][0] == approx(-k * (2.0 - free))


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_crane_on_shut_chambers_does_not_change_any_bit(law):
    result = run(Crane().case(10.0, ["boom.angle", "lift.A.pressure"], law))
    assert np.all(result["boom.angle"] == 0.0) and np.ptp(result["lift.A.pressure"]) == 0.0


@pytest.mark.parametrize("stated", [("B",), ("A",), ()])
def test_shut_chambers_without_a_stated_pressure_support_their_load(stated):
    """The balance of the crane gives the pressure that is not stated; a valve closes chamber A, a plug chamber B."""
    crane = Crane()
    pressures = {"initial_pressure_A": crane.p_a, "initial_pressure_B": crane.p_b}
    links = crane.links()
    for key in pressures:
        if key[-1] not in stated:
            del links["lift"][key]
    links["shut"] = {
        "type": "valve",
        "from": "pump",
        "to": "lift.A",
        "area": 1e-5,
        "opening": {"start": 0.5, "duration": 0.1, "value": [0, 1]},
    }
    nodes = {**crane.nodes(), "pump": {"type": "reservoir", "pressure": 2e7}}
    case = bodies(nodes, 0.6, ["lift.A.pressure", "lift.B.pressure", "boom.angle"], links)
    case["fluid"] = dict(OIL)
    result = run(case)
    if stated:
        assert result["lift.A.pressure"][0] == approx(crane.p_a, rel=1e-12)
        assert result["lift.B.pressure"][0] == approx(crane.p_b, rel=1e-10)
    else:
        assert result["lift.B.pressure"][0] == AMBIENT
    early = result.t < 0.5
    assert np.all(result["boom.angle"][early] == 0.0) and result["boom.angle"][-1] > 1e-4


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_locked_cylinder_swings_at_the_root_of_its_spring_and_never_creeps(law):
    crane = Crane()
    case = crane.case(4.0, ["boom.angle"], law, 2e-4, {"rate": 1e-4})
    result = run(case)
    times = falls(result.t, result["boom.angle"])
    # the lever grows on sinking
    tilting = crane.mass * GRAVITY * crane.length / 2.0 * crane.lever / crane.distance
    stiffness = crane.spring(law) * crane.lever**2 + tilting
    assert 2 * math.pi / np.mean(np.diff(times)) == approx(
        math.sqrt(stiffness / crane.inertia), rel=1e-4
    )
    early, late = result["boom.angle"][:4000], result["boom.angle"][-4000:]
    for extreme in (np.max, np.min):
        assert extreme(late) == approx(extreme(early), rel=1e-4)
    assert result.ledger["mass"]["relative"] < 1e-15


def test_a_long_swing_of_a_locked_cylinder_loses_no_oil_by_steps():
    """A closed chamber keeps its mass to the bit at coarse steps, so its load cannot sink."""
    case = Crane().case(
        2.0, ["lift.A.pressure"], "log", joint={"rate": 0.05}, method="rk4", step=5e-3
    )
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.advance(model, fvsolve.initial_state(model), 2.0)
    at = [model.state_names.index(f"lift.{side}.mass") for side in "AB"]
    assert np.all(state.y[at] == 0.0)


def test_a_boom_lifted_through_valves_follows_scipy():
    """Reference: dp/dt = beta / V (q - A dx/dt), with x the change of the length of the cylinder since the start."""
    crane, beta, rho, share = Crane(), OIL["bulk_modulus"], OIL["density"], 2e-6
    supply, sump = 25e6, 1e5
    nodes = {
        **crane.nodes(),
        "pump": {"type": "reservoir", "pressure": supply},
        "tank": {"type": "reservoir", "pressure": sump},
    }
    opening = {"start": 0.1, "duration": 0.05, "value": [0.0, 1.0]}
    orifice = {"type": "valve", "area": share, "discharge_coefficient": 1.0, "opening": opening}
    links = {
        **crane.links(),
        "in": {**orifice, "from": "pump", "to": "lift.A"},
        "out": {**orifice, "from": "lift.B", "to": "tank"},
    }
    case = scene(
        nodes,
        links,
        0.6,
        CLOSE,
        ["boom.angle", "lift.A.pressure", "lift.B.pressure"],
        fluid={**OIL, "law": "log"},
    )
    a, b = crane.areas

    def rates(t, y):
        angle, w, p, q = y
        x, z = crane.eye * math.cos(angle), crane.eye * math.sin(angle) - crane.low
        length = math.hypot(x, z)
        lever = (crane.eye * math.cos(angle) * z - crane.eye * math.sin(angle) * x) / length
        travel, speed, open_ = (
            length - crane.distance,
            lever * w,
            min(max((t - 0.1) / 0.05, 0.0), 1.0),
        )
        force = a * (p - 101325.0) - b * (q - 101325.0)
        density = [rho * math.exp((one - 101325.0) / beta) for one in (supply, p, q)]
        into = (
            open_ * share * math.copysign(math.sqrt(2 * density[0] * abs(supply - p)), supply - p)
        )
        out = open_ * share * math.copysign(math.sqrt(2 * density[2] * abs(q - sump)), q - sump)
        volumes = (
            crane.dead[0] + a * (crane.x + travel),
            crane.dead[1] + b * (crane.stroke - crane.x - travel),
        )
        weight = crane.mass * GRAVITY * crane.length / 2.0 * math.cos(angle)
        return [
            w,
            (force * lever - weight) / crane.inertia,
            beta / volumes[0] * (into / density[1] - a * speed),
            beta / volumes[1] * (b * speed - out / density[2]),
        ]

    y, t = [0.0, 0.0, crane.p_a, crane.p_b], 0.0
    for until in (0.1, 0.15, 0.6):
        y = solve_ivp(
            rates, (t, until), y, rtol=1e-11, atol=[1e-12, 1e-11, 1e-2, 1e-2], max_step=1e-3
        ).y[:, -1]
        t = until
    result = run(case)
    assert result["boom.angle"][-1] == approx(y[0], abs=1e-6) and y[0] > 0.05
    assert [result["lift.A.pressure"][-1], result["lift.B.pressure"][-1]] == approx(y[2:], rel=1e-4)


def test_an_end_stop_between_points_throws_back_without_loss():
    """A body that falls on an elastic stop returns to its initial height at the time of the closed form."""
    drop = body(2.0, [0, 0, 0], {"kind": "prismatic", "axis": [0, 0, 1], "travel": 1.0})
    links = {
        "stop": {
            "type": "end-stop",
            "from": "ground.low",
            "to": "drop",
            "stiffness": 1e5,
            "minimum": 0.75,
        }
    }
    result = run(held(links, {"drop": drop}, 1.0, ["drop.travel", "stop.force"], every=1e-3))
    assert result["drop.travel"].min() < 0.5 and result["stop.force"].max() > 1000.0
    fall = math.sqrt(2 * 0.5 / GRAVITY)
    touch = math.sqrt(2.0 / 1e5) * (
        math.pi
        + 2 * math.atan(2.0 * GRAVITY / 1e5 / math.sqrt(2.0 / 1e5) / math.sqrt(2 * GRAVITY * 0.5))
    )  # noqa: E501
    back = 2 * fall + touch
    assert np.interp(back, result.t, result["drop.travel"]) == approx(1.0, abs=1e-5)


# loops ------------------------------------------------------------------------------------------------------


def swing(angle: float, end: float) -> float:
    """Angle of the parallelogram after `end` [s]: a pendulum with w^2 = (m + n) g a / (2/3 m a^2 + n a^2)."""
    (m, a), (n, _) = CRANK, COUPLER
    w2 = (m + n) * GRAVITY * a / (2.0 / 3.0 * m * a * a + n * a * a)
    return solve_ivp(
        lambda t, y: [y[1], -w2 * math.sin(y[0])], (0, end), [angle, 0], rtol=1e-12, atol=1e-13
    ).y[0, -1]


def test_a_parallelogram_swings_as_a_pendulum():
    nodes, links = parallelogram()
    case = bodies(
        nodes,
        4.0,
        ["one.angle", "two.angle", "loop.gap", "loop.force"],
        links,
        method="rk4",
        step=1e-3,
    )
    result = run(case)
    assert result["one.angle"][-1] == approx(swing(1.0, 4.0), abs=2e-8)
    assert result["two.angle"][-1] == approx(result["one.angle"][-1], abs=1e-9)
    assert result["loop.gap"].max() < 1e-9 and result["loop.force"].min() > 0.0


def test_a_loop_converges_at_the_order_of_its_method():
    nodes, links = parallelogram()

    def angles(h: float) -> np.ndarray:
        return run(bodies(nodes, 1.0, ["one.angle"], links, 0.05, method="rk4", step=h))[
            "one.angle"
        ]

    errors = [np.abs(angles(h) - angles(5e-4)).max() for h in (0.01, 0.005)]
    assert math.log2(errors[0] / errors[1]) == approx(4.0, abs=0.4)


@pytest.mark.parametrize("share, fails", [(0.95, False), (1.03, True)])
def test_the_pull_of_a_pin_is_a_rate_that_steps_must_bear(share, fails):
    """RK4 is unstable where stabilisation times step exceeds 2.785, its limit on the negative real axis."""
    nodes, links = parallelogram(0.3, stabilisation=share * 2.785 / 2e-3)
    model = fvsolve.build(
        fvsolve.load(bodies(nodes, 2.0, ["loop.gap"], links, method="rk4", step=2e-3))
    )
    result = fvsolve.run(model)
    assert (not result.ok or result["loop.gap"].max() > 1e-3) == fails


def test_a_slider_crank_moves_as_its_closed_form():
    """x = a cos q + sqrt(b^2 - a^2 sin^2 q); without gravity the kinetic energy is constant."""
    a, b, q, w = 0.3, 1.0, 0.5, 4.0
    tilt = math.asin(a * math.sin(q) / b)
    lean = a * w * math.cos(q) / (b * math.cos(tilt))
    far, speed = (
        a * math.cos(q) + b * math.cos(tilt),
        -a * w * math.sin(q) - b * lean * math.sin(tilt),
    )
    turns = {"kind": "revolute", "axis": [0, 0, 1]}
    nodes = {
        "crank": body(2.0, [0.1] * 3, {**turns, "angle": q, "rate": w}, points={"end": [a, 0, 0]}),
        "rod": body(
            1e-6,
            [0, 1e-9, 1e-9],
            {**turns, "on": "crank.end", "angle": -q - tilt, "rate": -w - lean},
            points={"end": [b, 0, 0]},
        ),
        "piston": body(
            0.5, [1, 1, 1], {"kind": "prismatic", "axis": [1, 0, 0], "travel": far, "rate": speed}
        ),
    }
    links = {"wrist": {"type": "pin", "from": "piston", "to": "rod.end", "axis": [0, 0, 1]}}
    case = {
        **bodies(nodes, 2.0, ["crank.angle", "crank.rate", "piston.travel", "piston.rate"], links),
        **WEIGHTLESS,
    }
    result = run(case)
    angle = result["crank.angle"]
    assert angle[-1] > 2 * math.pi
    x = a * np.cos(angle) + np.sqrt(b * b - (a * np.sin(angle)) ** 2)
    assert result["piston.travel"] == approx(x, abs=1e-7)
    per = -a * np.sin(angle) - a * a * np.sin(angle) * np.cos(angle) / np.sqrt(
        b * b - (a * np.sin(angle)) ** 2
    )
    energy_of = 0.5 * result["crank.rate"] ** 2 * (0.1 + 0.5 * per**2)
    assert energy_of == approx(energy_of[0], rel=2e-5)  # difference by the rod of 1 mg


def test_a_linkage_in_balance_does_not_change_any_bit():
    nodes, links = parallelogram(0.4)
    links["stay"] = {
        "type": "spring",
        "from": "ground.low",
        "to": "one.end",
        "stiffness": 1e3,
        "preload": 0.0,
    }
    truth = fvsolve.build(fvsolve.load(held(links, nodes, 1.0, [])))
    (m, a), (n, _) = CRANK, COUPLER
    end = np.array([-a * math.sin(0.4), -a * math.cos(0.4)])
    far = end - [0.0, -0.25]
    lever = float(far @ [-math.cos(0.4), math.sin(0.4)]) / np.linalg.norm(far) * a
    links["stay"]["preload"] = float((m + n) * GRAVITY * a * math.sin(0.4) / lever)
    result = run(held(links, nodes, 3.0, ["one.angle", "loop.force"]))
    assert (
        truth.steady["moving"]
        and np.ptp(result["one.angle"]) == 0.0
        and np.ptp(result["loop.force"]) == 0.0
    )


# driven joints ----------------------------------------------------------------------------------------------


def test_a_pendulum_on_a_driven_cart_feels_its_acceleration():
    """l q'' = -g sin q + a cos q, with a the acceleration of the cart; the joint force is the sum of m a."""
    swing, period, phase, l = 0.3, 1.3, 0.4, 0.7  # noqa: E741
    w = 2.0 * math.pi / period
    wave = {"mean": 0.1, "amplitude": swing, "period": period, "phase": phase}
    cart = body(3.0, [1, 1, 1], {"kind": "prismatic", "axis": [2, 0, 0], "travel": wave})
    arm = pendulum(0.5, l, on="cart")

    def rates(t, y):
        a = -swing * w * w * math.sin(w * t + phase)
        return [y[1], (-GRAVITY * math.sin(y[0]) + a * math.cos(y[0])) / l]

    probes = ["arm.angle", "cart.travel", "cart.rate", "cart.joint_fx", "arm.bob.ax", "cart.ax"]
    result = run(bodies({"cart": cart, "arm": arm}, 2.0, probes))
    y = solve_ivp(rates, (0.0, 2.0), [0.5, 0.0], rtol=1e-12, atol=1e-13).y[:, -1]
    assert result["arm.angle"][-1] == approx(y[0], abs=1e-7)
    assert result["cart.travel"] == approx(0.1 + swing * np.sin(w * result.t + phase), abs=1e-12)
    assert result["cart.rate"] == approx(swing * w * np.cos(w * result.t + phase), abs=1e-12)
    assert result["cart.ax"] == approx(-swing * w * w * np.sin(w * result.t + phase), abs=1e-11)
    assert result["cart.joint_fx"] == approx(
        3.0 * result["cart.ax"] + 2.0 * result["arm.bob.ax"], abs=1e-9
    )


def test_a_crank_that_is_driven_gives_its_torque():
    """About a vertical axis the torque of the joint is J d2(angle)/dt2."""
    wave = {"mean": 0.0, "amplitude": 1.0, "period": 2.0}
    crank = body(1.0, [0.3, 0.3, 0.4], {"kind": "revolute", "axis": [0, 0, 1], "angle": wave})
    crank["centre_of_mass"] = [0.5, 0, 0]
    result = run(bodies({"crank": crank}, 1.0, ["crank.joint_tz", "crank.angle"]))
    assert result["crank.joint_tz"] == approx(
        -0.65 * math.pi**2 * np.sin(math.pi * result.t), abs=1e-10
    )


@pytest.mark.parametrize("driven", [
    {"time": [0, 1], "value": [0.0, 1.0]}, {"time": [0, 1], "value": [0.0, 1.0], "kind": "step"},
    {"start": 0.2, "duration": 0.5, "value": [0.0, 1.0], "exponent": 2.0},
])  # fmt: skip
def test_the_drive_of_a_joint_may_not_jump_nor_its_rate(driven):
    with pytest.raises(
        fvsolve.errors.CaseError, match="nodes.arm.joint.angle: drives the joint, .* jumps"
    ):
        fvsolve.build(fvsolve.load(bodies({"arm": pendulum(driven)}, 1.0)))


# bushings ---------------------------------------------------------------------------------------------------


def test_a_body_on_a_bushing_swings_by_its_stiffnesses_and_fades_by_its_damping():
    """m r'' = F = -k r - d (r' - q'/2 x r), and J q'' = -K sin q - D q' - (r/2 x F) about z, r = (x, y)."""
    m, k, d, j, turn_k, turn_d = 2.0, 300.0, 1.5, 0.4, 50.0, 0.2
    block = body(m, [j, j, j], {"kind": "free", "velocity": [0.5, 0, 0], "rate": [0, 0, 12.0]})
    links = {
        "rubber": {
            "type": "bushing",
            "from": "ground.top",
            "to": "block",
            "stiffness": k,
            "damping": d,
            "rotational_stiffness": turn_k,
            "rotational_damping": turn_d,
        }
    }
    nodes = {"block": block, "ground": {"type": "frame", "points": {"top": [0, 0, 0]}}}
    probes = ["block.x", "block.y", "block.yaw", "rubber.gap", "rubber.torque"]
    result = run({**bodies(nodes, 2.0, probes, links), **WEIGHTLESS})

    def rates(t, state):
        (x, y), (u, v), q, w = state[:2], state[2:4], state[4], state[5]
        fx, fy = -k * x - d * (u + 0.5 * w * y), -k * y - d * (v - 0.5 * w * x)
        torque = -turn_k * math.sin(q) - turn_d * w - 0.5 * (x * fy - y * fx)
        return [u, v, fx / m, fy / m, w, torque / j]

    x, y, _, _, q, w = solve_ivp(
        rates, (0.0, 2.0), [0.0, 0.0, 0.5, 0.0, 0.0, 12.0], rtol=1e-12, atol=1e-13
    ).y[:, -1]
    assert result["block.x"][-1] == approx(x, abs=1e-8) and result["block.y"][-1] == approx(
        y, abs=1e-8
    )
    assert abs(y) > 1e-4 and result["rubber.gap"][-1] == approx(math.hypot(x, y), abs=1e-8)
    assert result["block.yaw"][-1] == approx(q, abs=1e-7)
    assert result["rubber.torque"][-1] == approx(abs(turn_k * math.sin(q) + turn_d * w), abs=1e-5)


@pytest.mark.parametrize("ends", [("wheel.e", "post.j"), ("post.j", "wheel.e")])
def test_a_bushing_with_a_gap_has_no_direction(ends):
    """A damper of 20 N s/m between the centre and a point 0.7 m out of a wheel slows it by 20 (0.7 / 2)^2 w.

    The middle of the gap moves by 0.35 w in axes that turn by w / 2. With the rate in axes of `from` it did not act.
    """
    post = {**body(10.0, [2, 3, 4], {"kind": "fixed"}), "points": {"j": [0.3, 0, 0]}}
    joint = {"kind": "revolute", "on": "post.j", "axis": [0, 0, 1], "rate": 2.0}
    wheel = {
        **body(5.0, [1, 1, 1], joint),
        "centre_of_mass": [0.2, 0, 0],
        "points": {"e": [0.7, 0, 0]},
    }
    links = {"l": {"type": "bushing", "from": ends[0], "to": ends[1], "damping": 20.0}}
    case = {
        **bodies({"post": post, "wheel": wheel}, 0.5, ["wheel.rate", "l.force", "l.gap"], links),
        **WEIGHTLESS,
    }
    result = run(case)
    rate = 2.0 * math.exp(-20.0 * 0.35**2 * 0.5 / (1.0 + 5.0 * 0.2**2))
    assert result["wheel.rate"][-1] == approx(rate, rel=1e-7)
    assert result["l.force"][-1] == approx(20.0 * 0.35 * rate, rel=1e-7) and result[
        "l.gap"
    ] == approx(0.7, abs=1e-12)


def test_a_bushing_does_not_damp_a_common_rotation():
    """Two bodies on one plate's rotation: a free body, joined by a bushing with a gap to a body that turns with it."""
    turn = {"kind": "revolute", "axis": [0, 0, 1], "rate": 3.0}
    disc = {**body(2.0, [1, 1, 1], turn), "points": {"p": [0.5, 0, 0]}}
    fixed = {
        **body(1.0, [1, 1, 1], {"kind": "fixed", "on": "disc.p"}),
        "points": {"q": [0.2, 0.3, 0]},
    }
    links = {
        "l": {
            "type": "bushing",
            "from": "disc.p",
            "to": "rider.q",
            "damping": 20.0,
            "rotational_damping": 5.0,
        }
    }
    result = run(
        {
            **bodies({"disc": disc, "rider": fixed}, 1.0, ["disc.rate", "l.force"], links),
            **WEIGHTLESS,
        }
    )
    assert result["disc.rate"] == approx(3.0, abs=1e-12) and result["l.force"] == approx(
        0.0, abs=1e-12
    )


def test_a_bushing_between_two_free_bodies_conserves_their_momenta():
    tree = random_tree(np.random.default_rng(12), 1, "free")
    other = random_tree(np.random.default_rng(13), 1, "free")["b0"]
    links = {
        "rubber": {
            "type": "bushing",
            "from": "b0.p",
            "to": "b1.p",
            "stiffness": 100.0,
            "damping": 1.0,
            "rotational_stiffness": 20.0,
            "rotational_damping": 0.3,
        }
    }
    sums = [f"{what}momentum_{axis}" for what in ("", "angular_") for axis in "xyz"]
    probes = [f"{name}.{one}" for name in ("b0", "b1") for one in sums]
    result = run({**bodies({**tree, "b1": other}, 2.0, probes, links), **WEIGHTLESS})
    for one in sums:
        total = result[f"b0.{one}"] + result[f"b1.{one}"]
        assert np.ptp(total) < 1e-7
        assert np.ptp(result[f"b0.{one}"]) > 0.1


# energy -----------------------------------------------------------------------------------------------------


def machine() -> dict:
    """Return a case of a damped tree of bodies with a driven joint and all kinds of force elements in space."""
    upper = pendulum(0.8, damping=0.3)
    lower = {
        **pendulum(-0.4),
        "joint": {"kind": "revolute", "on": "arm.bob", "axis": [0.6, 0.8, 0], "angle": 0.2},
    }
    lower["inertia"] = [0.1, 0.2, 0.3]
    wave = {"mean": 0.0, "amplitude": 0.2, "period": 0.9}
    cart = body(3.0, [1, 1, 1], {"kind": "prismatic", "axis": [1, 0, 0], "travel": wave})
    upper["joint"]["on"] = "cart"
    links = {
        "spring": {
            "type": "spring",
            "from": "ground.hook",
            "to": "lower.bob",
            "stiffness": 50.0,
            "free_length": 1.0,
        },
        "damper": {"type": "damper", "from": "ground.hook", "to": "arm.bob", "damping": 2.0},
        "load": {
            "type": "force",
            "to": "lower.bob",
            "force": {"mean": 0.0, "amplitude": 5.0, "period": 0.7},
            "direction": [1, 1, 0],
        },
        "motor": {"type": "torque", "from": "arm", "to": "lower", "torque": 0.5, "axis": [0, 0, 1]},
        "rubber": {
            "type": "bushing",
            "from": "cart",
            "to": "lower.bob",
            "stiffness": 20.0,
            "damping": 0.5,
            "rotational_stiffness": 3.0,
            "rotational_damping": 0.1,
        },
    }
    return held(
        links, {"cart": cart, "arm": upper, "lower": lower}, 1.5, [], method="rk4", step=2e-3
    )


def test_the_ledger_of_energy_closes_to_the_order_of_its_method():
    case = machine()
    found = [energy(case, {"numerics.step": h}) for h in (4e-3, 2e-3)]
    rest = [float(np.abs(one.remainder).max()) for one in found]
    assert rest[0] / rest[1] > 12.0 and found[1].relative < 1e-7
    assert {"cart", "load", "motor"} <= {*found[1].supplied} and {
        "arm joint",
        "damper",
        "rubber bushing",
    } <= {*found[1].dissipated}
    assert {"cart", "arm", "lower", "spring", "rubber"} <= {*found[1].stored}


@pytest.mark.parametrize(
    "kind, place", [("joint", "arm"), ("drive", "cart"), ("bushing", "rubber")]
)
def test_a_term_left_out_of_the_ledger_of_bodies_is_its_remainder(kind, place, monkeypatch):
    from fvsolve.features.motion.feature import Motion

    honest, plain = energy(machine()), Motion.add_accounts
    lost = (
        honest.supplied[place][-1] if kind == "drive" else honest.dissipated[f"{place} {kind}"][-1]
    )

    def forgetful(self, accounts):
        plain(self, accounts)
        own = [
            one
            for one in accounts.accounts
            if (one.place, one.kind) == (place, kind) and one.category != "rate"
        ]
        accounts.accounts = [one for one in accounts.accounts if one not in own]

    monkeypatch.setattr(Motion, "add_accounts", forgetful)
    remains = energy(machine()).remainder[-1]
    assert abs(lost) > 1e-3 and abs(remains) == approx(abs(lost), rel=1e-4)


# equivalent cases, methods and runs -------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["radau-iia-5", "rodas-5p", "auto", "implicit-midpoint"])
def test_every_family_of_methods_moves_a_crane_alike(method):
    crane, more = Crane(), {"rtol": 1e-9} if method != "implicit-midpoint" else {"step": 1e-4}
    truth = run(crane.case(0.2, ["boom.angle"], "log", joint={"rate": 0.05}))["boom.angle"]
    found = run(
        crane.case(0.2, ["boom.angle"], "log", joint={"rate": 0.05}, method=method, **more)
    )["boom.angle"]
    assert found == approx(truth, abs=2e-4 * np.abs(truth).max())


def test_bodies_in_another_order_and_in_other_units_move_alike():
    tree = random_tree(np.random.default_rng(3), 5, "free")
    probes = [f"b{k}.{axis}" for k in range(5) for axis in "xyz"]
    truth = run(bodies(tree, 0.5, probes))
    back = dict(reversed(tree.items()))
    for one in back.values():
        one["mass"] = f"{one['mass'] / 1000.0!r} t"
        one["centre_of_mass"] = [f"{1000.0 * x!r} mm" for x in one["centre_of_mass"]]
        one["inertia"] = [[f"{x / 1000.0!r} t m2" for x in row] for row in one["inertia"]]
        if one["joint"]["kind"] == "revolute":
            one["joint"]["angle"] = f"{math.degrees(one['joint']['angle'])!r} deg"
    found = run(bodies(back, 0.5, probes))
    for probe in probes:
        assert found[probe] == approx(truth[probe], abs=1e-7)


def test_a_scene_that_is_turned_about_the_vertical_moves_alike():
    tree = random_tree(np.random.default_rng(7), 4, "revolute")
    probes = [f"b{k}.{axis}" for k in range(4) for axis in "xyz"]
    truth, angle = run(bodies(tree, 0.5, probes)), 0.7
    spin = Rotation.from_euler("Z", angle)
    for one in tree.values():
        if "on" not in one["joint"]:
            one["joint"]["at"] = spin.apply(one["joint"]["at"]).tolist()
            one["joint"]["attitude"]["matrix"] = (
                spin.as_matrix() @ one["joint"]["attitude"]["matrix"]
            ).tolist()
    found = run(bodies(tree, 0.5, probes))
    for k in range(4):
        here, there = (
            np.array([one[f"b{k}.{axis}"][-1] for axis in "xyz"]) for one in (found, truth)
        )
        assert here == approx(spin.apply(there), abs=1e-7)


def test_bodies_fixed_to_each_other_act_as_a_single_body():
    """Three rods in a chain of fixed joints swing as one body of their common mass, centre and inertia."""
    rng, places, rods = np.random.default_rng(11), [], {}
    turns = [np.eye(3), turn(rng), turn(rng)]
    for k in range(3):
        joint = {
            "kind": "fixed",
            "on": f"r{k - 1}",
            "at": [0.1, 0.2, -0.5],
            "attitude": {"matrix": turns[k].tolist()},
        }
        if k == 0:
            joint = {"kind": "revolute", "axis": [0, 1, 0], "angle": 0.6}
        rods[f"r{k}"] = body(1.0 + k, [0.1, 0.2, 0.15], joint, centre_of_mass=[0.05, 0.02, -0.3])
    total, first, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    r, p = np.eye(3), np.zeros(3)
    for k in range(3):
        if k > 0:
            p, r = p + r @ [0.1, 0.2, -0.5], r @ turns[k]
        places.append((1.0 + k, p + r @ [0.05, 0.02, -0.3], r @ np.diag([0.1, 0.2, 0.15]) @ r.T))
    total = sum(one[0] for one in places)
    first = sum(one[0] * one[1] for one in places) / total
    for mass, place, own in places:
        far = place - first
        inertia = inertia + own + mass * (far @ far * np.eye(3) - np.outer(far, far))
    joint = {"kind": "revolute", "axis": [0, 1, 0], "angle": 0.6}
    one = body(total, inertia.tolist(), joint, centre_of_mass=first.tolist())
    alone = run(bodies({"r0": one}, 1.0, ["r0.angle", "r0.joint_fx", "r0.joint_tz"]))
    chain = run(bodies(rods, 1.0, ["r0.angle", "r0.joint_fx", "r0.joint_tz"]))
    for probe in ("r0.angle", "r0.joint_fx", "r0.joint_tz"):
        assert chain[probe] == approx(alone[probe], abs=1e-6)


def test_no_rate_depends_on_a_state_that_the_pattern_has_not():
    crane = Crane()
    nodes = {**crane.nodes(rate=0.1), **random_tree(np.random.default_rng(4), 4, "free")}
    nodes["jib"] = {**nodes.pop("b3"), "joint": {"kind": "ball", "on": "boom.tip"}}
    four, loop = parallelogram()
    nodes |= four
    rope = {"type": "spring", "from": "b1.p", "to": "jib.p", "stiffness": 1e3}
    links = {**crane.links(leakage=1e-13), **loop, "rope": rope}
    model = fvsolve.build(fvsolve.load(bodies(nodes, 1.0, [], links)))
    rng = np.random.default_rng(1)
    for _ in range(3):
        assert stray(model, 0.0, model.scale * rng.normal(scale=10.0, size=model.y_size)) < 1e-9


@pytest.mark.parametrize("method, step", [("rk4", 2e-6), ("implicit-midpoint", 2e-6)])
def test_a_run_interrupted_and_resumed_is_the_uninterrupted_run(
    method, step, tmp_path, monkeypatch
):
    monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), "CHECKPOINT_SECONDS", 0.0)
    case = Crane().case(
        0.1,
        ["boom.angle", "lift.A.pressure"],
        "log",
        joint={"rate": 0.05},
        method=method,
        step=step,
    )
    calls = []

    def third(t, seconds, steps):
        calls.append(t)
        if len(calls) == 3:
            raise KeyboardInterrupt

    whole = run(case, out=tmp_path / "whole")
    assert fvsolve.run(
        case, out=tmp_path / "broken", progress=third, pictures=False
    ).reason.startswith("interrupted")
    resumed = run(case, out=tmp_path / "broken", resume=True)
    assert 0.0 < calls[1] < 0.1 and resumed.ledger == whole.ledger
    assert np.array_equal(resumed["boom.angle"], whole["boom.angle"])


def test_linearised_a_locked_crane_swings_at_its_frequency_and_fails_where_predicted():
    """Eigenvalues are +-i w, and the step limit of RK4 is sqrt(8) / w, predicted and measured."""
    crane = Crane()
    case = crane.case(0.5, [], "log", joint={"rate": 1e-6}, method="rk4", step=1e-3)
    values = np.linalg.eigvals(linearise(case).a)
    stiffness = (
        crane.spring() * crane.lever**2
        + crane.mass * GRAVITY * crane.length / 2.0 * crane.lever / crane.distance
    )
    w = math.sqrt(stiffness / crane.inertia)
    assert np.sort(values.imag)[[0, -1]] == approx([-w, w], rel=1e-6)
    (found,) = stability(case).rows
    assert found.eigenvalues == approx(math.sqrt(8.0) / w, rel=1e-6)
    assert found.measured == approx(found.predicted, rel=0.05)


def test_a_body_with_drifting_parameters_gives_a_notice():
    nodes = {"stone": STONE}
    result = run({**bodies(nodes, 8.0, [], method="rk4", step=0.2), **WEIGHTLESS})
    (told,) = [one for one in result.warnings if one.kind == "drift"]
    assert told.place == "nodes.stone" and 1e-6 < abs(told.value) < 0.1 and told.ok
    result = run({**bodies(nodes, 8.0, [], method="gauss-4", step=0.2), **WEIGHTLESS})
    assert not [one for one in result.warnings if one.kind == "drift"]


def test_a_controller_may_hold_forces_on_bodies():
    links = {
        "load": {"type": "force", "to": "arm.bob", "force": 0.0, "direction": [1, 0, 0]},
        "motor": {"type": "torque", "to": "arm", "torque": 0.0, "axis": [0, 1, 0]},
    }
    model = fvsolve.build(fvsolve.load(bodies({"arm": pendulum(0.0)}, 1.0, [], links)))
    state = fvsolve.initial_state(model)
    held = fvsolve.advance(model, state, 1e-4, inputs={"load.force": 3.0, "motor.torque": 0.7})
    rate = held.y[model.state_names.index("arm.rate")]
    assert rate == approx((-3.0 * 0.7 + 0.7) / (2.0 * 0.49) * 1e-4, rel=1e-6)


def test_a_tree_far_from_the_origin_moves_as_a_tree_near_it():
    tree = random_tree(np.random.default_rng(2), 4, "free")
    model = [fvsolve.build(fvsolve.load(bodies(tree, 1.0)))]
    tree["b0"]["joint"]["at"] = [1e6, -2e6, 3e5]
    model.append(fvsolve.build(fvsolve.load(bodies(tree, 1.0))))
    near, far = (one.rhs(0.0, one.start) for one in model)
    assert far == approx(near, rel=1e-9, abs=1e-8)


def test_the_crane_that_is_shipped_moves_as_scipy_has_it():
    """Reference in the plane: double pendulum, chamber pressures as states, orifice law in the spool valve."""
    beta, rho, share = 1.2e9, 870.0, 8e-6
    bore, ring = math.pi / 4 * 0.125**2, math.pi / 4 * (0.125**2 - 0.07**2)
    result = fvsolve.run("cases/crane.toml", set={"numerics.end": 6.0})

    def turned(angle, x, z):
        c, s = math.cos(angle), math.sin(angle)
        return np.array([c * x - s * z, s * x + c * z])

    def rates(t, y, law):
        a, b, u, v, p, q = y
        arms = [turned(a, 2.2, 0.1), turned(a, 5.0, 0.0), turned(a + b, 0.0, -1.5)]
        across = [np.array([-r[1], r[0]]) for r in arms]
        jacobians = [
            np.column_stack([across[0], np.zeros(2)]),
            np.column_stack([across[1] + across[2], across[2]]),
        ]
        drags = [-u * u * arms[0], -u * u * arms[1] - (u + v) ** 2 * arms[2]]
        mass, force = np.zeros((2, 2)), np.array([0.0, -200.0 * v])
        for m, j, d in zip((800.0, 1000.0), jacobians, drags, strict=True):
            mass += m * j.T @ j
            force -= m * j.T @ (d + [0.0, GRAVITY])
        mass += [[1500.0 + 100.0, 100.0], [100.0, 100.0]]
        eye = turned(a, 1.5, -0.1)
        far = eye - [0.3, -1.4]
        length = np.linalg.norm(far)
        lever = float(far @ [-eye[1], eye[0]]) / length
        speed, x = lever * u, length - 1.5
        force[0] += lever * (bore * (p - 101325.0) - ring * (q - 101325.0) - 2e4 * speed)
        open_, dense = law(t), lambda one: rho * math.exp((one - 101325.0) / beta)
        into = valve_flow(share, open_, 250e5, p, dense(max(250e5, p))) if open_ else 0.0
        out = valve_flow(share, open_, q, 1e5, dense(max(q, 1e5))) if open_ else 0.0
        return [
            u,
            v,
            *np.linalg.solve(mass, force),
            beta / (5e-4 + bore * x) * (into / dense(p) - bore * speed),
            beta / (5e-4 + ring * (1.2 - x)) * (ring * speed - out / dense(q)),
        ]

    y = [
        math.radians(10.0),
        -math.radians(10.0),
        0.0,
        0.0,
        1e5 * result["lift.A.gauge_pressure"][0] + 101325.0,
        10e5,
    ]
    assert rates(0.0, y, lambda t: 0.0)[2:4] == approx([0.0, 0.0], abs=1e-9)
    ramps = [
        (1.2, lambda t: (t - 1.0) / 0.2),
        (4.0, lambda t: 1.0),
        (4.2, lambda t: (4.2 - t) / 0.2),
    ]
    ramps.append((6.0, lambda t: 0.0))
    at = 1.0
    for until, law in ramps:
        y = solve_ivp(
            rates, (at, until), y, method="LSODA", args=(law,), rtol=1e-9, atol=1e-9, max_step=0.01
        ).y[:, -1]
        at = until
    assert math.radians(result["boom.angle"][-1]) == approx(y[0], abs=1e-5)
    assert math.radians(result["load.angle"][-1]) == approx(y[1], abs=1e-4)
    assert np.all(result["boom.angle"][result.t < 1.0] == result["boom.angle"][0])


def bennett(axis: bool) -> dict:
    """Return a case of Bennett's linkage: four hinges in space that can move, as sin(alpha) / a = sin(beta) / b.

    alpha and beta are the twists of the links a and b. `axis` gives the pin an axis.
    """
    a, b, alpha = 1.0, 1.5, math.radians(30.0)
    beta = math.asin(b / a * math.sin(alpha))
    one = 1.0
    two = 2.0 * math.atan(
        math.sin((beta + alpha) / 2.0) / math.sin((beta - alpha) / 2.0) / math.tan(one / 2.0)
    )
    turns = {
        "one": (one, a, {}),
        "two": (two, b, {"on": "one.end", "attitude": {"roll": alpha}}),
        "three": (-one, a, {"on": "two.end", "attitude": {"roll": beta}}),
    }
    nodes = {
        name: body(
            1.0,
            [0.1, 0.2, 0.2],
            {"kind": "revolute", "axis": [0, 0, 1], "angle": angle, **joint},
            centre_of_mass=[0.5 * length, 0.1, 0.05],
            points={"end": [length, 0, 0]},
        )
        for name, (angle, length, joint) in turns.items()
    }
    nodes["ground"] = {"type": "frame", "points": {"hinge": [-b, 0, 0]}}
    pin = {"type": "pin", "from": "ground.hinge", "to": "three.end"}
    pin |= {"axis": [0, math.sin(beta), math.cos(beta)]} if axis else {}
    probes = ["one.angle", "two.angle", "three.angle", "three.end.x", "three.end.y", "three.end.z"]
    return bodies(nodes, 2.0, probes, {"loop": pin}, method="rk4", step=1e-3)


def test_bennetts_linkage_moves_as_its_half_angles_have_it_and_a_ball_there_is_redundant():
    result = run(bennett(axis=True))
    one, two, three = (result[f"{name}.angle"] for name in ("one", "two", "three"))
    assert np.ptp(one) > 0.5
    assert one + three == approx(np.zeros_like(one), abs=1e-8)
    ratio = math.tan(one[0] / 2.0) * math.tan(two[0] / 2.0)
    sines, cosines = np.sin(one / 2.0) * np.sin(two / 2.0), np.cos(one / 2.0) * np.cos(two / 2.0)
    assert sines == approx(ratio * cosines, abs=1e-7)
    gap = np.array([result["three.end.x"] + 1.5, result["three.end.y"], result["three.end.z"]])
    assert np.abs(gap).max() < 1e-8  # also along the axis of the pin, without a constraint
    with pytest.raises(
        fvsolve.errors.CaseError,
        match="in some direction joints or other pins already hold its two points together",
    ):
        fvsolve.build(fvsolve.load(bennett(axis=False)))
