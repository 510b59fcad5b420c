"""Networks that move their bodies: a free hull with its U-tube, a cart with one, against (70) and what is conserved."""

import numpy as np
import pytest
from model.test_sparsity import stray
from parts.test_riding_networks import BORE, DEPTH, HALF, LEVEL, TANK, said, u_tube
from scipy.integrate import solve_ivp
from truth.scenes import GRAVITY, RHO, area

import fvsolve as fv
from fvsolve.errors import CaseError
from fvsolve.model.build import build

MASS, LOW, TURN = 60e3, 0.8, 4e5  # of the hull: its mass [kg], how low that lies [m], inertia about it [kg m2]
START = 0.15  # angle [rad]
BODY = {"type": "body", "mass": MASS, "inertia": [TURN, 2 * TURN, 2 * TURN], "centre_of_mass": [0, 0, -LOW]}


def free(**drawn):
    """The U-tube on a hull that rolls as it likes."""
    case = u_tube(**{"minor_loss": 0.0, **drawn})
    axis = case["nodes"]["hull"]["joint"]["axis"]
    case["nodes"]["hull"] = {**BODY, "inertia": [TURN] * 3, "joint": {"kind": "revolute", "axis": axis, "angle": START}}
    case["output"]["probes"] += ["hull.angle"]
    return case


def hull_and_water():
    """(angle'', z'') by (70) at (angle, angle', z, z'): what flows in the arms has no inertia of its own."""
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
        action += RHO * size * sp.integrate(sp.expand(square / 2 - GRAVITY * where[1]), (s, low, high))
    left = [action.diff(one.diff(t)).diff(t).doit() - action.diff(one) for one in (angle, z)]
    a, b, c, x, v, w = sp.symbols("a b c x v w")
    said = ((angle.diff(t, 2), c), (z.diff(t, 2), w), (angle.diff(t), b), (z.diff(t), v), (angle, a), (z, x))
    for old, new in said:
        left = [one.subs(old, new) for one in left]
    matrix = sp.Matrix(2, 2, lambda i, j: left[i].diff((c, w)[j]))
    right = sp.Matrix([-one.subs({c: 0, w: 0}) for one in left])
    both = sp.lambdify((a, b, x, v), (matrix, right))
    return lambda *now: np.linalg.solve(*(np.array(one, dtype=float) for one in both(*now))).ravel()


WAYS = {"as drawn": ({}, {}), "the duct to starboard": ({"swap": True}, {}), "bow along y": ({"turned": True}, {}),
        "implicit": ({}, {"method": "radau-iia-5", "rtol": 1e-8})}  # fmt: skip


@pytest.fixture(scope="module")
def truth():
    rates = hull_and_water()

    def rhs(t, y):
        c, w = rates(*y)
        return [y[1], c, y[3], w]

    return solve_ivp(rhs, (0, 20), [START, 0, 0, 0], rtol=1e-11, atol=1e-12, method="DOP853", dense_output=True).sol


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


def test_a_cart_with_a_u_tube_on_rails_keeps_the_momentum_of_the_whole():
    case = u_tube(minor_loss=0.0, route=[[0, HALF, -DEPTH - 0.5], [0, -HALF, -DEPTH - 0.5]], length=9.5)
    slides = {"kind": "prismatic", "axis": [0, 1, 0], "travel": 0.0, "rate": 0.3}
    case["links"]["duct"]["length"] = 9.5
    case["links"]["duct"] |= {"from": "port", "to": "starboard"}
    case["nodes"]["hull"] = {**BODY, "joint": slides}
    case["nodes"]["port"]["level"] = LEVEL + 0.3
    case["output"]["probes"] += ["hull.vy"]
    run = fv.run(case)
    water = RHO * (TANK * (2 * LEVEL + 0.3) + area(BORE) * 9.5)
    momentum = (MASS + water) * run["hull.vy"] - RHO * run["duct.flow"] * 2 * HALF  # it runs towards -y
    assert np.ptp(run["hull.vy"]) > 1e-3
    assert momentum == pytest.approx(momentum[0], rel=1e-8)


OBLIQUE = {"port": [1.0, 3.0, -1.5], "starboard": [-2.0, -2.5, -1.0]}
ROUTE = [[1.0, 1.0, -2.0], [-1.0, 0.5, -2.5]]


def line_inertia(mass, a, b):
    """Inertia about the origin of a line of even mass."""
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    return mass * (apart(middle) + apart(half) / 3.0)


def apart(r):
    return r @ r * np.eye(3) - np.outer(r, r)


def test_a_body_on_a_ball_keeps_its_energy_and_its_spin_about_the_vertical_with_all_that_flows():
    case = u_tube(minor_loss=0.0, route=ROUTE, length=9.0, diameter=1.0)
    inertia = np.diag([4e5, 6e5, 5e5])
    ball = {"kind": "ball", "attitude": {"roll": 0.1, "pitch": -0.05, "yaw": 0.4}, "rate": [0.1, -0.05, 0.15]}
    case["nodes"]["hull"] = {**BODY, "inertia": np.diag(inertia).tolist(), "joint": ball}
    for name, at in OBLIQUE.items():
        case["nodes"][name] |= {"at": at, "area": 3.0, "level": 2.0}
    what = ["eta", "eps_x", "eps_y", "eps_z", "wx", "wy", "wz"]
    case["output"]["probes"] = ["duct.flow", "port.level", "starboard.level", *(f"hull.{one}" for one in what)]
    case["numerics"]["end"] = 6.0  # before starboard is empty
    run = fv.run(case)
    low = np.array([0, 0, -LOW])
    way = [np.array(one) for one in (OBLIQUE["port"], *ROUTE, OBLIQUE["starboard"])]
    ends, foot = {"port": -1.0, "starboard": 1.0}, {name: np.array(at) for name, at in OBLIQUE.items()}
    lengths = [float(np.linalg.norm(b - a)) for a, b in zip(way, way[1:], strict=False)]
    if case["links"]["duct"]["from"] == "starboard":
        ends, way, lengths = {"port": 1.0, "starboard": -1.0}, way[::-1], lengths[::-1]
    found = []
    for k in range(len(run.t)):
        h, e = run["hull.eta"][k], np.array([run[f"hull.eps_{one}"][k] for one in "xyz"])
        skew = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
        turn = np.eye(3) + 2 * h * skew + 2 * skew @ skew
        spin = turn.T @ [run[f"hull.w{one}"][k] for one in "xyz"]
        flow, whole, first, swept = RHO * run["duct.flow"][k], inertia + MASS * apart(low), MASS * low, np.zeros(3)
        for a, b, length in zip(way, way[1:], lengths, strict=False):
            mass = RHO * area(1.0) * 9.0 * length / sum(lengths)
            whole, first, swept = whole + line_inertia(mass, a, b), first + 0.5 * mass * (a + b), swept + np.cross(a, b)
        for name, sign in ends.items():
            a, up = foot[name], run[f"{name}.level"][k] * np.array([0, 0, 1.0])
            mass = RHO * 3.0 * up[2]
            whole, first = whole + line_inertia(mass, a, a + up), first + mass * (a + 0.5 * up)
            swept = swept + sign * np.cross(a, up)
        momentum = whole @ spin + flow * swept
        kinetic = 0.5 * spin @ whole @ spin + flow * spin @ swept + 0.5 * flow**2 * 9.0 / (RHO * area(1.0))
        found.append((kinetic + GRAVITY * (turn @ first)[2], (turn @ momentum)[2], kinetic))
    energy, about, kinetic = np.array(found).T
    assert np.ptp(kinetic) > 1e3 and np.ptp(run["duct.flow"]) > 0.1
    assert np.ptp(energy) < 1e-6 * np.ptp(kinetic)
    assert np.ptp(about) < 1e-6 * np.max(np.abs(about))


@pytest.mark.parametrize(("change", "place", "text"), [
    ({"fluid": {"law": "log"}}, "fluid.law", 'wanted "linear"'),
    ({"nodes": {"port": {"height": 2.0}}}, "nodes.port.height", "what passes here"),
    ({"nodes": {"port": {"area": {"level": [0, 1], "area": [1, 2]}}}}, "nodes.port.area", "one area"),
])  # fmt: skip
def test_what_a_free_body_does_not_feel_is_refused_by_name(change, place, text):
    case = free()
    for group, tables in change.items():
        for name, one in tables.items():
            case[group][name] = one if group == "fluid" else {**case[group][name], **one}
    assert text in said(case)[place]


def test_a_pipe_on_a_free_body_is_refused_by_name():
    case = free()
    case["links"]["duct"] |= {"type": "pipe", "wave_speed": 1000.0}
    assert "rigid columns between tanks alone" in said(case)["links.duct"]


@pytest.mark.parametrize("joint", ["revolute", "ball"])
def test_what_bodies_and_columns_feel_of_each_other_is_in_the_pattern(joint):
    case = free(minor_loss=2.0)
    case["nodes"]["hull"]["joint"] = {"kind": joint} | ({"axis": [1, 0, 0]} if joint == "revolute" else {})
    case["output"]["probes"].remove("hull.angle")
    case["nodes"]["wheel"] = {**BODY, "joint": {"kind": "revolute", "axis": [0, 0, 1]}}
    model, rng = build(fv.load(case)), np.random.default_rng(1)
    assert stray(model, 0.0, model.scale * rng.normal(size=model.y_size)) < 1e-9


def test_tall_arms_on_a_hull_of_no_weight_are_told():
    case = free()
    case["nodes"]["hull"] |= {"mass": 1.0, "inertia": [1.0] * 3}
    for name in ("port", "starboard"):
        case["nodes"][name] |= {"area": area(BORE), "level": 8.0}
    with pytest.raises(CaseError, match="outweighs what carries it"):
        fv.run(case)


def test_forces_of_its_joint_are_refused():
    case = free()
    case["output"]["probes"] += ["hull.joint_fz"]
    with pytest.raises(CaseError, match="hull carries a network"):
        fv.run(case)
