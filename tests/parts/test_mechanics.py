"""Cylinders, masses and force elements on an axis, against closed forms and SciPy."""

import math
from importlib import import_module

import numpy as np
import pytest
from pytest import approx
from reference.cylinders import AMBIENT, BETA, RHO, Jack, valve_flow
from reference.scenes import reservoir, scene
from scipy.interpolate import CubicSpline

import fvsolve

CLOSE = {"method": "dormand-prince", "rtol": 1e-10}
PROBES = ("cyl.A.pressure", "cyl.B.pressure", "load.position", "load.velocity")
LAWS = ("linear", "log")


def run(
    jack: Jack,
    end: float,
    nodes: dict | None = None,
    links: dict | None = None,
    probes=(),
    rows=400,
    **more,
):
    """Return the result of a cylinder `jack` with further parts, with its four states and `probes`."""
    numerics = {**CLOSE, **more}
    case = scene(
        {**jack.nodes(), **(nodes or {})},
        {**jack.links(), **(links or {})},
        end,
        numerics,
        [*PROBES, *probes],
        end / rows,
        fluid=jack.fluid(),
    )
    result = fvsolve.run(case)
    assert result.ok, result.reason
    return result


def states(result) -> np.ndarray:
    return np.array([result[probe] for probe in PROBES])


def crossings(t, values) -> np.ndarray:
    """Times at which a smooth series crosses zero upwards."""
    roots = CubicSpline(t, values).roots(extrapolate=False)
    slope = CubicSpline(t, values).derivative()
    return np.array([root for root in roots if slope(root) > 0])


@pytest.mark.parametrize("law", LAWS)
def test_a_closed_cylinder_swings_at_the_root_of_its_hydraulic_spring_over_mass(law):
    jack = Jack(law, v=1e-4)
    result = run(jack, 0.05, rows=4000)
    found = crossings(result.t, result["load.position"] - jack.x)
    period = np.mean(np.diff(found))
    assert 2 * math.pi / period == approx(math.sqrt(jack.hydraulic_spring() / jack.mass), rel=1e-5)


def test_a_closed_cylinder_of_a_real_fluid_swings_by_its_isentropic_modulus():
    jack = Jack(v=1e-4)
    case = scene(
        jack.nodes(),
        jack.links(),
        0.05,
        CLOSE,
        PROBES,
        1e-5,
        fluid={"name": "n-Dodecane", "temperature": 293.15, "law": "table"},
    )
    model = fvsolve.build(fvsolve.load(case))
    result = fvsolve.run(model)
    period = np.mean(np.diff(crossings(result.t, result["load.position"] - jack.x)))
    spring = jack.hydraulic_spring() * model.case.properties.bulk_modulus / BETA
    assert 2 * math.pi / period == approx(math.sqrt(spring / jack.mass), rel=1e-4)


def test_a_closed_cylinder_has_the_exact_period_of_its_log_law():
    """p = p0 - beta ln(V / V0); the period of large oscillations is computed by quadrature."""
    jack = Jack(pressures=(60e6, 60e6 * 12 / 8), v=22.0, dead=(2e-5, 2e-5), stroke=0.2)
    period, low, high = jack.closed_period()
    small = 2 * math.pi / math.sqrt(jack.hydraulic_spring() / jack.mass)
    assert high - low > 0.02 and abs(period / small - 1) > 1e-3
    result = run(jack, 6 * period, rows=6000, rtol=1e-12)
    found = crossings(result.t, result["load.velocity"])
    assert np.diff(found) == approx(period, rel=1e-8)
    assert [
        result.extremes["load.position"].minimum,
        result.extremes["load.position"].maximum,
    ] == approx([low, high], abs=1e-4 * (high - low))


def spool(area: float, position, **more) -> dict:
    return {
        "type": "spool-valve",
        "ports": {"P": "pump", "T": "sump", "A": "cyl.A", "B": "cyl.B"},
        "area": area,
        "position": position,
        **more,
    }


SUPPLY = {"pump": reservoir(140e5), "sump": reservoir(2e5)}
CUTS = ([0.0, 0.004, 0.012, 0.02, 0.03], [0.6, 0.6, -0.5, -0.5, 0.1])


def edge_flows(jack: Jack, area: float, cuts=CUTS):
    """Return a function (t, p_A, p_B) for mass flows into A and B; the spool position is linear between `cuts`."""

    def through(share, p_up, p_down):
        return valve_flow(area, share, p_up, p_down, jack.density(max(p_up, p_down)))

    def flows(t, p_a, p_b):
        u = float(np.interp(t, *cuts))
        plus, minus = max(u, 0.0), max(-u, 0.0)
        return (
            through(plus, 140e5, p_a) - through(minus, p_a, 2e5),
            through(minus, 140e5, p_b) - through(plus, p_b, 2e5),
        )

    return flows


@pytest.mark.in_turn
@pytest.mark.parametrize("method, rtol", [("dormand-prince", 1e-11), ("radau-iia-5", 1e-10)])
@pytest.mark.parametrize("law", LAWS)
def test_a_servo_cylinder_follows_the_trajectory_of_scipy(law, method, rtol):
    """Spool valve, leakage, friction, spring, damper and a force ramp: pressures within 1e-9 of 100 bar."""
    jack = Jack(
        law,
        pressures=(60e5, 80e5),
        leakage=2e-13,
        friction=300.0,
        stiffness=4e4,
        free=0.08,
        damping=150.0,
    )
    cuts = [0.002, 0.01]
    push = {"type": "force", "to": "load", "force": {"time": cuts, "value": [0.0, -900.0]}}
    position = dict(zip(("time", "value"), CUTS, strict=True))
    result = run(
        jack, 0.03, SUPPLY, {"spool": spool(1e-5, position), "push": push}, method=method, rtol=rtol
    )
    zeros = [0.004 + 0.008 * 0.6 / 1.1, 0.02 + 0.01 * 0.5 / 0.6]
    truth = jack.trajectory(
        np.asarray(result.t),
        edge_flows(jack, 1e-5),
        lambda t, x, v: np.interp(t, cuts, [0.0, -900.0]),
        sorted([*CUTS[0][1:-1], *zeros, *cuts]),
    )
    assert np.ptp(truth[2]) > 2e-3 and np.ptp(truth[0]) > 20e5
    error = np.max(np.abs(states(result) - truth), axis=1)
    assert error / np.array([1e7, 1e7, 0.1, 1.0]) == approx(0.0, abs=1e-9)
    assert abs(result.ledger["mass"]["relative"]) < 1e-14


@pytest.mark.parametrize("side", ["from air", "plugged"])
@pytest.mark.parametrize("law", LAWS)
def test_a_cylinder_open_to_the_air_on_both_sides_does_not_change_any_bit(law, side):
    jack = Jack(
        law,
        leakage=1e-12,
        friction=100.0,
        extra={"initial_pressure_A": AMBIENT, "initial_pressure_B": AMBIENT},
    )
    links = {}
    if side == "from air":
        links = {
            end: {"type": "orifice", "from": "air", "to": f"cyl.{end}", "area": 1e-5}
            for end in "AB"
        }
    nodes = {"air": reservoir(AMBIENT)} if links else {}
    result = run(jack, 0.1, nodes, links, ["cyl.force"], initial="equilibrium")
    still = np.array([[AMBIENT], [AMBIENT], [jack.x], [0.0]])
    assert np.all(states(result) == still) and np.all(result["cyl.force"] == 0.0)


@pytest.mark.parametrize("law", LAWS)
def test_a_piston_in_balance_does_not_change_any_bit(law):
    """Equilibrium of pressures on unequal areas, a loaded spring and a closed spool valve."""
    jack = Jack(
        law, stiffness=5e4, free=0.05, extra={"initial_pressure_A": AMBIENT + 60e5 + 2500 / 12e-4}
    )
    jack.pressures = (0.0, AMBIENT + 90e5)
    result = run(jack, 0.5, SUPPLY, {"spool": spool(1e-5, 0.0)}, initial="equilibrium")
    assert np.all(states(result) == states(result)[:, :1])


def test_motion_is_reported_and_equilibrium_refuses_it():
    jack = Jack(pressures=(AMBIENT + 10e5, AMBIENT), v=0.5)
    case = scene(jack.nodes(), jack.links(), 1.0, CLOSE, PROBES, 0.1, fluid=jack.fluid())
    moving = fvsolve.build(fvsolve.load(case)).checks["moving"]
    assert "mass load moves at 0.5 m/s" in moving and "mass load accelerates at 60 m/s2" in moving
    assert any(text.startswith("chamber cyl.A: pressure changes by -") for text in moving)
    with pytest.raises(
        fvsolve.CaseError, match="expects that nothing moves, but mass load accelerates at 60 m/s2"
    ):
        fvsolve.build(fvsolve.load(case, {"numerics.initial": "equilibrium"}))


def test_chambers_without_a_stated_pressure_are_in_equilibrium_or_at_ambient():
    """Behind closed edges the pressure is that of equal small leaks: the mean of supply and return."""
    jack = Jack("linear")
    links = jack.links()
    del links["cyl"]["initial_pressure_A"], links["cyl"]["initial_pressure_B"]
    for more, wanted in (({}, AMBIENT), ({"spool": spool(1e-5, 0.0)}, 71e5)):
        nodes = {**jack.nodes(), **(SUPPLY if more else {})}
        case = scene(nodes, {**links, **more}, 1.0, CLOSE, PROBES, 0.1, fluid=jack.fluid())
        assert fvsolve.build(fvsolve.load(case)).checks["nodes"]["cyl.A"]["pressure"] == approx(
            wanted, rel=1e-12
        )


def test_power_is_balanced_across_the_piston_and_its_ports():
    """Kinetic, spring and fluid energy change by the port power beta (exp(p / beta) - 1) q minus damping."""
    jack = Jack(
        pressures=(60e5, 80e5),
        leakage=2e-13,
        friction=300.0,
        stiffness=4e4,
        free=0.08,
        damping=150.0,
    )
    result = run(
        jack, 0.02, SUPPLY, {"spool": spool(1e-5, 0.6)}, ["spool.flow_A", "spool.flow_B"], rows=4000
    )
    p_a, p_b, x, v = states(result)
    q = [
        -result[f"spool.flow_{side}"]
        * np.where(result[f"spool.flow_{side}"] < 0, density(140e5), density(p))
        / density(p)
        for side, p in (("A", p_a), ("B", p_b))
    ]
    leak = jack.leakage * (p_a - p_b) * density(np.maximum(p_a, p_b))
    q = [q[0] - leak / density(p_a), q[1] + leak / density(p_b)]
    power = sum(
        BETA * np.expm1((p - AMBIENT) / BETA) * flow for p, flow in zip((p_a, p_b), q, strict=True)
    )
    power -= (jack.friction + jack.damping) * v**2
    stored = (
        0.5 * jack.mass * v**2
        + 0.5 * jack.stiffness * (x - jack.free) ** 2
        + jack.fluid_energy(x, p_a, p_b)
    )
    brought = CubicSpline(result.t, power).antiderivative()(result.t)
    assert np.ptp(stored) > 5.0
    assert stored - stored[0] == approx(brought, abs=1e-6 * np.ptp(stored))


def density(p):
    return RHO * np.exp((p - AMBIENT) / BETA)


def test_a_closed_cylinder_on_a_spring_conserves_its_energy():
    jack = Jack(pressures=(60e5, 90e5), v=3.0, stiffness=3e5, free=0.12)
    result = run(jack, 0.05, rtol=1e-12)
    p_a, p_b, x, v = states(result)
    total = (
        0.5 * jack.mass * v**2
        + 0.5 * jack.stiffness * (x - jack.free) ** 2
        + jack.fluid_energy(x, p_a, p_b)
    )
    assert total == approx(total[0], rel=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_rod_and_case_have_equal_and_opposite_forces(law):
    """A cylinder between two free masses keeps their momentum and its fluid mass to rounding."""
    jack = Jack(law, pressures=(90e5, 20e5), friction=50.0)
    nodes = {"ground": {"type": "mass", "mass": 35.0, "initial_velocity": 0.2}}
    result = run(
        jack,
        0.05,
        nodes,
        {},
        ["ground.velocity", "ground.position", "cyl.position", "cyl.velocity"],
    )
    momentum = 20.0 * result["load.velocity"] + 35.0 * result["ground.velocity"]
    assert np.ptp(result["load.velocity"]) > 0.5
    assert momentum == approx(7.0, abs=1e-10)
    assert result["cyl.position"] == approx(
        result["load.position"] - result["ground.position"], abs=1e-15
    )
    assert result["cyl.velocity"] == approx(
        result["load.velocity"] - result["ground.velocity"], abs=1e-13
    )
    assert abs(result.ledger["mass"]["relative"]) < 1e-15


@pytest.mark.parametrize("method", ["rk4", "euler", "radau-iia-5"])
def test_mass_is_conserved_with_moving_volumes_over_thousands_of_steps(method):
    jack = Jack(pressures=(60e5, 80e5), leakage=2e-13)
    case = scene(
        {**jack.nodes(), **SUPPLY},
        {**jack.links(), "spool": spool(1e-5, 0.6)},
        0.05,
        {"method": method, "step": 1e-5 if method == "radau-iia-5" else 1e-6},
        PROBES,
        1e-2,
        fluid=jack.fluid(),
    )
    result = fvsolve.run(case)
    assert result.ok and np.ptp(result["load.position"]) > 5e-3
    assert abs(result.ledger["mass"]["relative"]) < 1e-13


@pytest.mark.parametrize("law", LAWS)
def test_a_spool_and_its_mirror_image_move_the_piston_alike(law):
    found = []
    for side in (1.0, -1.0):
        jack = Jack(law, areas=(1e-3, 1e-3), dead=(5e-5, 5e-5), pressures=(7e6, 7e6))
        ramp = {"start": 0.001, "duration": 0.01, "value": [0.0, 0.8 * side], "exponent": 2.0}
        result = run(
            jack,
            0.02,
            SUPPLY,
            {"spool": spool(1e-5, ramp)},
            ["spool.flow_P", "spool.flow_A", "spool.flow_B"],
        )
        found.append(
            (
                side * (result["load.position"] - jack.x),
                result["spool.flow_P"],
                result["spool.flow_A" if side > 0 else "spool.flow_B"],
            )
        )
    assert np.max(found[0][0]) > 1e-3
    for one, other in zip(*found, strict=True):
        assert one == approx(other, rel=1e-9, abs=1e-14)


SWINGS = {
    "linear": {"time": [0, 1, 2, 4], "value": [0.5, -0.5, -0.5, 0.25]},
    "smooth": {"time": [0, 1, 2, 4], "value": [0.5, -0.5, -0.7, 0.25], "kind": "smooth"},
    "step": {"time": [0, 1, 2], "value": [0.5, -0.5, 0.25], "kind": "step"},
    "ramp": {"start": 0.5, "duration": 2.0, "value": [0.75, -0.5], "exponent": 1.7},
    "constant": -0.3,
}


@pytest.mark.parametrize("kind", SWINGS)
def test_a_spool_opens_a_pair_of_edges_on_each_side_of_zero(kind):
    """Flows follow the positive and the negative part of the position; each zero crossing is a step boundary."""
    nodes = {"P": reservoir(5e6), "T": reservoir(1e5), "A": reservoir(3e6), "B": reservoir(2e6)}
    ports = {port: port for port in "PTAB"}
    links = {
        "spool": {"type": "spool-valve", "ports": ports, "area": 1e-4, "position": SWINGS[kind]}
    }
    numerics = {"method": "rk4", "step": 0.01}
    case = scene(nodes, links, 4.0, numerics, [f"spool.flow_{port}" for port in "PTAB"], 0.01)
    model = fvsolve.build(fvsolve.load(case))
    result = fvsolve.run(model)
    plain = {**links["spool"], "type": "valve", "from": "P", "to": "A", "opening": 0.5}
    for key in ("ports", "position"):
        del plain[key]
    schedule = model.case.links["spool"].position
    from fvsolve.core.assembly.schedule_tables import piece_value, schedule_pieces

    pieces = schedule_pieces(schedule)
    jumps = [t for t, jump in model.breaks if jump]
    t = np.asarray(result.t)
    smooth = ~np.isin(t, jumps)
    u = np.array([piece_value(pieces[np.searchsorted(pieces[:, 0], x, "right") - 1], x) for x in t])
    size = 0.61e-4 * math.sqrt(2.0 / 1000.0)
    plus, minus = np.maximum(u, 0.0), np.maximum(-u, 0.0)
    wanted = {
        "P": plus * math.sqrt(2e6) + minus * math.sqrt(3e6),
        "T": -(plus * math.sqrt(1.9e6) + minus * math.sqrt(2.9e6)),
        "A": minus * math.sqrt(2.9e6) - plus * math.sqrt(2e6),
        "B": plus * math.sqrt(1.9e6) - minus * math.sqrt(3e6),
    }
    for port, flow in wanted.items():
        assert result[f"spool.flow_{port}"][smooth] == approx(
            size * flow[smooth], abs=2e-3 * size * 1e3
        )
    zeros = {
        "linear": [0.5, 2 + 2 * 0.5 / 0.75],
        "ramp": [0.5 + 2.0 * (1 - (0.5 / 1.25) ** (1 / 1.7))],
    }.get(kind, [])
    assert all(min(abs(time - zero) for time, _ in model.breaks) < 1e-12 for zero in zeros)
    if kind == "smooth":
        assert (
            sum(np.diff(np.sign(u)) != 0)
            == 2
            == sum(0 < t < 4 and t not in (1, 2) for t, _ in model.breaks)
        )


def test_leakage_levels_a_locked_cylinder_by_its_exponential():
    """With closed ports and a fixed rod, dp falls as exp(-leakage (beta / V_A + beta / V_B) t)."""
    jack = Jack("linear", pressures=(60e5, 20e5), leakage=1e-12)
    nodes = {"ground": {"type": "frame"}, "load": {"type": "frame", "initial_position": 0.1}}
    case = scene(nodes, jack.links(), 0.5, CLOSE, PROBES[:2], 0.01, fluid=jack.fluid())
    result = fvsolve.run(case)
    rate = jack.leakage * sum(BETA / volume for volume in jack.volumes(0.1))
    fall = result["cyl.A.pressure"] - result["cyl.B.pressure"]
    assert fall == approx(40e5 * np.exp(-rate * np.asarray(result.t)), abs=1e-9 * 40e5)
    assert rate * 0.5 > 2.0


def bodies(links: dict, end: float, probes, rows=1000, load=None, **numerics):
    """Return the result of a mass of 2 kg and a fixed frame with `links`, without fluid."""
    nodes = {"wall": {"type": "frame"}, "load": {"type": "mass", "mass": 2.0, **(load or {})}}
    return fvsolve.run(scene(nodes, links, end, {**CLOSE, **numerics}, probes, end / rows))


@pytest.mark.parametrize(
    "given", [{}, {"free_length": 0.3}, {"preload": 50.0}], ids=["plain", "free length", "preload"]
)
def test_a_mass_on_a_spring_swings_about_where_the_spring_is_slack(given):
    """Force -k x and energy k x^2 / 2 of a spring (docs/course.md, 81 and 82)."""
    spring = {"type": "spring", "from": "wall", "to": "load", "stiffness": 800.0, **given}
    probes = ["load.position", "load.velocity", "spring.force"]
    result = bodies(
        {"spring": spring}, 2.0, probes, load={"initial_position": 0.1, "initial_velocity": 0.5}
    )
    slack = {"free_length": 0.3, "preload": 0.1 + 50.0 / 800.0}.get(next(iter(given), ""), 0.0)
    t, w = np.asarray(result.t), math.sqrt(800.0 / 2.0)
    x = slack + (0.1 - slack) * np.cos(w * t) + 0.5 / w * np.sin(w * t)
    assert result["load.position"] == approx(x, abs=1e-8)
    assert result["spring.force"] == approx(-800.0 * (x - slack), abs=1e-5)
    energy = result["load.velocity"] ** 2 + 400.0 * (result["load.position"] - slack) ** 2
    assert energy == approx(energy[0], rel=1e-7)


def test_a_damper_brakes_by_its_exponential_and_a_force_speeds_up():
    links = {
        "damper": {"type": "damper", "from": "wall", "to": "load", "damping": 10.0},
        "push": {"type": "force", "from": "wall", "to": "load", "force": 30.0},
    }
    probes = ["load.velocity", "damper.force", "push.force"]
    result = bodies(links, 1.0, probes, load={"initial_velocity": 1.0})
    v = 3.0 - 2.0 * np.exp(-5.0 * np.asarray(result.t))
    assert result["load.velocity"] == approx(v, abs=1e-8)
    assert result["damper.force"] == approx(-10.0 * v, abs=1e-7) and np.all(
        result["push.force"] == 30.0
    )


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["maximum", "minimum"])
@pytest.mark.parametrize("damping", [0.0, 400.0], ids=["elastic", "damped"])
def test_an_end_stop_throws_a_mass_back_and_never_holds_it(damping, side):
    """Contact from x = 0.1 at v0 lasts half a period, or with damping until the contact force would pull."""
    key, m, k, v0 = ("maximum" if side > 0 else "minimum"), 2.0, 5e5, 3.0
    stop = {
        "type": "end-stop",
        "from": "wall",
        "to": "load",
        "stiffness": k,
        "damping": damping,
        key: 0.1 * side,
    }
    result = bodies(
        {"stop": stop},
        0.1,
        ["load.velocity", "load.position", "stop.force"],
        20000,
        load={"initial_velocity": v0 * side},
        rtol=1e-11,
    )
    t, force = np.asarray(result.t), side * result["stop.force"]
    brake = damping / (2 * m)
    w = math.sqrt(k / m - brake**2)
    leaves = math.atan2(2 * brake * w, 2 * brake**2 - k / m) / w if damping else math.pi / w
    back = (
        v0 * math.exp(-brake * leaves) * (math.cos(w * leaves) - brake / w * math.sin(w * leaves))
    )
    assert np.all(force <= 0.0)
    touching = t[force < 0.0]
    assert touching[0] == approx(0.1 / v0, abs=6e-6) and touching[-1] == approx(
        0.1 / v0 + leaves, abs=6e-6
    )
    assert side * result["load.velocity"][-1] == approx(back, rel=1e-6)


def test_a_mass_that_rests_on_a_stop_stays():
    """The mass starts where the force of the compressed stop balances the load."""
    links = {
        "stop": {
            "type": "end-stop",
            "from": "wall",
            "to": "load",
            "stiffness": 1e6,
            "damping": 1e3,
            "minimum": 0.1,
        },
        "push": {"type": "force", "to": "load", "force": -250.0},
    }
    result = bodies(
        links,
        0.5,
        ["load.position", "stop.force"],
        load={"initial_position": 0.1 - 250e-6},
        initial="equilibrium",
    )
    assert np.all(result["load.position"] == result["load.position"][0])
    assert result["stop.force"] == approx(250.0)


def test_a_piston_beyond_its_stroke_is_marked_and_a_piston_without_space_ends_the_run():
    jack = Jack("linear", v=50.0, stroke=0.12, dead=(6e-5, 1e-4))
    nodes = {"air": reservoir(AMBIENT)}
    links = {
        end: {"type": "orifice", "from": "air", "to": f"cyl.{end}", "area": 3e-3} for end in "AB"
    }
    case = scene(
        {**jack.nodes(), **nodes},
        {**jack.links(), **links},
        0.05,
        CLOSE,
        PROBES,
        1e-3,
        fluid=jack.fluid(),
    )
    result = fvsolve.run(case)
    assert [
        (mark.what, mark.place) for mark in result.marks if mark.what == "beyond its stroke"
    ] == [("beyond its stroke", "links.cyl")]
    light = {
        "links.cyl.dead_volume_B": 1e-6,
        "nodes.load.mass": 1e5,
        "numerics.method": "rk4",
        "numerics.step": 1e-5,
    }
    stopped = fvsolve.run(case, set=light)
    assert (
        not stopped.ok
        and "the chamber volume at cyl.B is zero" in stopped.reason
        and "give the piston an end-stop" in stopped.reason
    )


def test_a_controller_may_hold_spool_and_force():
    jack = Jack(pressures=(70e5, 70e5))
    links = {
        **jack.links(),
        "spool": spool(1e-5, 0.0),
        "push": {"type": "force", "to": "load", "force": 0.0},
    }
    case = scene({**jack.nodes(), **SUPPLY}, links, 1.0, CLOSE, PROBES, 0.1, fluid=jack.fluid())
    model = fvsolve.build(fvsolve.load(case))
    for sign in (1.0, -1.0):
        state = fvsolve.advance(
            model, fvsolve.initial_state(model), 0.02, {"spool.position": 0.5 * sign}
        )
        other = fvsolve.advance(
            model, fvsolve.initial_state(model), 0.02, {"push.force": -5000.0 * sign}
        )
        x = model.state_names.index("load.position")
        assert sign * state.y[x] > 1e-3 and sign * other.y[x] < 0.0
    with pytest.raises(
        fvsolve.FvsolveError,
        match="spool.position = 2 is out of range; expected a number from -1 to 1",
    ):
        fvsolve.advance(model, fvsolve.initial_state(model), 0.02, {"spool.position": 2.0})


def test_a_run_with_bodies_interrupted_and_resumed_is_the_uninterrupted_run(tmp_path, monkeypatch):
    monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), "CHECKPOINT_SECONDS", 0.0)
    jack = Jack(pressures=(60e5, 80e5), leakage=2e-13)
    links = {**jack.links(), "spool": spool(1e-5, 0.6)}
    case = scene(
        {**jack.nodes(), **SUPPLY},
        links,
        0.05,
        {"method": "rk4", "step": 1e-6},
        PROBES,
        1e-3,
        fluid=jack.fluid(),
    )
    calls = []

    def third(t, seconds, steps):
        calls.append(t)
        if len(calls) == 3:
            raise KeyboardInterrupt

    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert fvsolve.run(
        case, out=tmp_path / "broken", progress=third, pictures=False
    ).reason.startswith("interrupted")
    assert 0.0 < calls[1] < 0.05
    resumed = fvsolve.run(case, out=tmp_path / "broken", resume=True, pictures=False)
    assert whole.ok and resumed.ok and resumed.ledger == whole.ledger
    same = [(tmp_path / run / "history.csv").read_bytes() for run in ("whole", "broken")]
    assert same[0] == same[1]
