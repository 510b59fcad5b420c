"""Dry friction of cylinders against closed forms, SciPy with events, and restatements."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest
from reference.cylinders import AMBIENT, BETA, RHO, Jack
from reference.jacobians import stray
from reference.resumed_runs import killed_and_resumed, same_files
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.studies.energy_balance import energy

EXACT = 1e-9
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"]
FRICTION = {"coulomb": 60.0, "static": 100.0, "stribeck_velocity": 0.01}
JACK = Jack(
    "linear", mass=8.0, friction=300.0, pressures=(2e6, 2.85e6), extra={"friction": FRICTION}
)
END = 0.05
FEED = 1e-6  # flow into chamber A [m3/s]


def fed(jack=JACK, end=END, law="linear", **more):
    """Cylinder whose chamber A is fed by a constant flow."""
    nodes = {"feed": {"type": "inflow", "flow": FEED}, **jack.nodes()}
    links = {"line": {"type": "valve", "from": "feed", "to": "cyl.A", "area": 1e-7}, **jack.links()}
    return {
        "schema": 1,
        "fluid": replace(jack, law=law).fluid(),
        "nodes": nodes,
        "links": links,
        "numerics": {"end": end, "rtol": 1e-11},
        "output": {
            "every": end / 50,
            "probes": ["load.velocity", "load.position", "cyl.force", "cyl.A.pressure"],
        },
        **more,
    }


def runs(case, method="dormand-prince", **set):
    run = fvsolve.run(case, {"numerics.method": method} | set)
    assert run.ok, run.reason
    return run


def events_of(run):
    return [(event["time"], event["what"]) for event in run.summary["events"]]


def dry(v, friction=FRICTION):
    """Force of dry friction at a speed above 0."""
    excess = friction["static"] - friction["coulomb"]
    return friction["coulomb"] + excess * exp(-((v / friction["stribeck_velocity"]) ** 2))


def stick_slip(jack, flows, push, times, most):
    """Trajectory (p_A, p_B, x, v) at times, and (time, what) of events, by SciPy with events.

    flows, push : as for `Jack.rates`; most : greatest force at rest
    """
    y, t, direction = np.array([*jack.pressures, jack.x, jack.v]), times[0], 0.0
    found, events = np.empty((4, len(times))), []

    def force(t, y):
        return jack.thrust(y[0], y[1]) + push(t, y[2], y[3])

    while t < times[-1]:
        if direction == 0.0:

            def rates(t, y):
                return [*jack.rates(t, [y[0], y[1], y[2], 0.0], flows, push)[:2], 0.0, 0.0]

            ends = [lambda t, y: force(t, y) - most, lambda t, y: force(t, y) + most]
            ends[0].direction, ends[1].direction = 1.0, -1.0
        else:

            def rates(t, y, direction=direction):
                braked = lambda t, x, v: push(t, x, v) - direction * dry(abs(v))  # noqa: E731
                return jack.rates(t, y, flows, braked)

            begun = t + 1e-5  # it begins to move from a force that is exactly `most`
            ends = [lambda t, y, begun=begun, direction=direction: y[3] if t > begun else direction]
            ends[0].direction = -direction
        for end in ends:
            end.terminal = True
        run = solve_ivp(
            rates,
            (t, times[-1]),
            y,
            "DOP853",
            events=ends,
            rtol=1e-13,
            dense_output=True,
            atol=[1e-5, 1e-5, 1e-15, 1e-13],
            max_step=1e-3,
        )
        inside = (times >= t) & (times <= run.t[-1])
        if inside.any():
            found[:, inside] = run.sol(times[inside])
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status == 1:
            before = direction
            direction = 0.0
            if before == 0.0:
                direction = 1.0 if len(run.t_events[0]) else -1.0
            else:
                y[3] = 0.0
            what = {0.0: "sticks", 1.0: "slips forward", -1.0: "slips backward"}[direction]
            events.append((t, what))
    return found, events


def fed_flows(t, p_a, p_b):
    return RHO * FEED, 0.0


@pytest.mark.parametrize("method", METHODS)
def test_a_fed_cylinder_tears_off_and_sticks_as_that_of_scipy(method):
    """Stribeck friction: the pressure rises until it tears off, it moves, and sticks again, several times."""
    case = fed()
    run = runs(case, method)
    exact, events = stick_slip(
        JACK, fed_flows, lambda t, x, v: 0.0, np.array(run.t), FRICTION["static"]
    )
    assert len(events) > 3
    assert [what for _, what in events_of(run)] == [what for _, what in events]
    assert [t for t, _ in events_of(run)] == pytest.approx([t for t, _ in events], abs=END * EXACT)
    start = FRICTION["static"] - JACK.thrust(*JACK.pressures)
    rise = BETA * FEED / JACK.volumes(JACK.x)[0] * JACK.areas[0]
    assert events_of(run)[0][0] == pytest.approx(start / rise, abs=END * EXACT)
    assert np.array(run["load.position"]) == pytest.approx(exact[2], abs=EXACT * 0.2)
    assert np.array(run["load.velocity"]) == pytest.approx(exact[3], abs=EXACT)
    still = exact[3] == 0.0
    assert set(np.array(run["load.velocity"])[still]) == {0.0}
    force = np.array(run["cyl.force"])
    assert np.abs(force[still]).max() < 1e-9  # while it sticks, the friction balances the chambers
    speed = exact[3][~still]
    sliding = (
        JACK.thrust(*exact[:2, ~still]) - JACK.friction * speed - np.array([dry(v) for v in speed])
    )
    assert force[~still] == pytest.approx(sliding, abs=1e-4)


def in_two(case, share):
    """The same case with two cylinders side by side, which have a share of all areas and forces, and the rest."""
    links, nodes = dict(case["links"]), dict(case["nodes"])
    line, whole = links.pop("line"), links.pop("cyl")
    feed = nodes.pop("feed")
    sizes = ("area_A", "area_B", "dead_volume_A", "dead_volume_B", "viscous_friction")
    for name, part in (("cyl", share), ("twin", 1.0 - share)):
        friction = whole["friction"] | {
            key: part * whole["friction"][key] for key in ("coulomb", "static")
        }
        links[name] = whole | {key: part * whole[key] for key in sizes} | {"friction": friction}
        nodes[f"feed_{name}"] = feed | {"flow": part * feed["flow"]}
        links[f"line_{name}"] = line | {"from": f"feed_{name}", "to": f"{name}.A"}
    return case | {"nodes": nodes, "links": links}


@pytest.mark.parametrize("share", [0.5, 0.3])
@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5"])
def test_two_cylinders_on_a_mass_stick_and_tear_off_as_their_sum(share, method):
    """Both lock the same mass; each bears a part of the force in proportion to its own greatest force."""
    one, two = runs(fed(), method), runs(in_two(fed(), share), method)
    assert np.array(two["load.position"]) == pytest.approx(
        np.array(one["load.position"]), abs=0.2 * EXACT
    )
    assert np.array(two["load.velocity"]) == pytest.approx(
        np.array(one["load.velocity"]), abs=EXACT
    )
    assert np.array(two["cyl.force"]) == pytest.approx(share * np.array(one["cyl.force"]), abs=1e-4)
    times = [t for t, _ in events_of(one)]
    for name in ("cyl", "twin"):
        own = [event["time"] for event in two.summary["events"] if event["name"] == name]
        assert own == pytest.approx(times, abs=END * EXACT)


def restated():
    """Other order, ports exchanged (the case moves), other units, `static` as a text, all at once or alone."""
    case, links = fed(), fed()["links"]
    yield (
        "order",
        case
        | {"links": dict(reversed(links.items())), "nodes": dict(reversed(case["nodes"].items()))},
    )
    cylinder = links["cyl"]
    in_units = cylinder | {
        "friction": {"coulomb": "0.06 kN", "static": "100 N", "stribeck_velocity": "10 mm/s"}
    }
    yield "units", case | {"links": links | {"cyl": in_units}}


@pytest.mark.parametrize(("what", "case"), list(restated()))
def test_restated_friction_moves_alike(what, case):
    one, other = runs(fed()), runs(case)
    for probe in ("load.position", "load.velocity", "cyl.force"):
        assert np.array(other[probe]) == pytest.approx(np.array(one[probe]), abs=1e-9), what
    assert [t for t, _ in events_of(other)] == pytest.approx(
        [t for t, _ in events_of(one)], abs=END * EXACT
    )


def test_a_cylinder_with_a_moving_case_has_the_same_friction():
    """Rod on the frame, case on the mass: it moves backward, and tears off backward."""
    nodes = fed()["nodes"]
    nodes["ground"]["initial_position"] = 2.0 * JACK.x
    links = fed()["links"]
    links["cyl"] = links["cyl"] | {"ports": {"rod": "ground", "case": "load"}}
    one, other = runs(fed()), runs(fed() | {"nodes": nodes, "links": links})
    assert np.array(other["load.velocity"]) == pytest.approx(
        -np.array(one["load.velocity"]), abs=EXACT
    )
    assert np.array(other["cyl.force"]) == pytest.approx(np.array(one["cyl.force"]), abs=1e-4)
    assert events_of(other) == [
        (pytest.approx(t, abs=END * EXACT), what) for t, what in events_of(one)
    ]


def test_a_cylinder_between_two_masses_sticks_them_together():
    """A force moves both; they part where the inertia of the second exceeds the friction, and stick again."""
    links = {
        "cyl": JACK.links()["cyl"]
        | {
            "ports": {"rod": "load", "case": "base"},
            "friction": {"coulomb": 50.0},
            "viscous_friction": 0.0,
            "area_A": 1e-6,
            "area_B": 1e-6,
            "initial_pressure_A": 2e6,
            "initial_pressure_B": 2e6,
        },
        "push": {
            "type": "force",
            "to": "load",
            "force": {"time": [0.0, 1.0], "value": [0.0, 200.0]},
        },
        "soft": {"type": "spring", "from": "ground", "to": "base", "stiffness": 1e-3},
    }
    nodes = JACK.nodes() | {"base": {"type": "mass", "mass": 12.0}}
    case = fed(end=0.8) | {"nodes": nodes, "links": links}
    case["output"]["probes"] = ["load.velocity", "base.velocity"]
    run = runs(case)
    t, load, base = np.array(run.t), np.array(run["load.velocity"]), np.array(run["base.velocity"])
    # force on the base while both move: share 12 / 20 of the push
    tear = 50.0 / (200.0 * 12.0 / 20.0)
    assert events_of(run)[0] == (pytest.approx(tear, abs=1e-6), "slips forward")
    joined = t < tear
    assert np.array_equal(load[joined], base[joined])
    assert load[joined] == pytest.approx(200.0 * t[joined] ** 2 / 2.0 / 20.0, abs=1e-6)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method", METHODS)
def test_a_held_load_does_not_move_by_a_bit(law, method):
    """Shut chambers with stated pressures push with less than the force at rest, in either direction."""
    for force in (90.0, -90.0, 0.0):
        links = JACK.links() | {
            "push": {"type": "force", "to": "load", "force": force - JACK.thrust(*JACK.pressures)}
        }
        case = fed(end=1.0, law=law) | {"nodes": JACK.nodes(), "links": links}
        run = runs(case, method)
        assert set(run["load.velocity"]) == {0.0} and set(run["load.position"]) == {JACK.x}
        assert len(set(run["cyl.A.pressure"])) == 1 and not run.summary["events"]
        assert not fvsolve.build(fvsolve.load(case)).steady["moving"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("force", [90.0, -90.0, 500.0, -500.0])
def test_an_equilibrium_start_counts_the_friction_that_holds(force, method):
    """A mass stays where friction can hold it; a greater force moves it until its spring and friction hold it."""
    links = JACK.links() | {
        "push": {"type": "force", "to": "load", "force": force - JACK.thrust(*JACK.pressures)},
        "spring": {"type": "spring", "from": "post", "to": "load", "stiffness": 1e5},
    }
    nodes = JACK.nodes() | {"post": {"type": "frame", "initial_position": JACK.x}}
    case = fed() | {"nodes": nodes, "links": links}
    case["numerics"]["initial"] = "equilibrium"
    run, moved = runs(case, method), 0.0 if abs(force) < 100.0 else (abs(force) - 100.0) / 1e5
    assert set(run["load.velocity"]) == {0.0} and not run.summary["events"]
    assert run["load.position"] == pytest.approx(JACK.x + np.sign(force) * moved, abs=1e-12)


def test_a_force_that_nothing_holds_is_named():
    links = JACK.links() | {
        "push": {"type": "force", "to": "load", "force": 150.0 - JACK.thrust(*JACK.pressures)}
    }
    case = fed() | {"nodes": JACK.nodes(), "links": links}
    case["numerics"]["initial"] = "equilibrium"
    with pytest.raises(CaseError, match="the forces on load balance: 50 N remain; add a spring"):
        fvsolve.build(fvsolve.load(case))


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5"])
def test_friction_only_takes_energy_and_the_ledger_closes(method):
    # the law `linear` does not conserve energy, which is an account of its own
    case = fed(law="log")
    case["numerics"] |= {"method": method, "rtol": 1e-11 if method == "dormand-prince" else 1e-8}
    found = energy(case)
    assert abs(found.remainder).max() < 1e-9 * found.throughput
    lost = np.array(found.dissipated["cyl friction"])
    assert np.all(np.diff(lost) >= 0.0)
    case["output"]["every"] = END / 5000
    run = runs(case)
    t, v = np.array(run.t), np.array(run["load.velocity"])
    whole = np.trapezoid([JACK.friction * u * u + dry(u) * u for u in v], t)
    assert lost[-1] == pytest.approx(whole, rel=1e-5)


def test_a_run_with_friction_resumes_to_the_bit(tmp_path):
    case = fed(end=0.5)
    case["numerics"]["rtol"] = 1e-9
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 0.2))


@pytest.mark.parametrize("law", ["linear", "log"])
def test_cylinders_with_friction_keep_to_their_pattern(law):
    for case in (fed(law=law), in_two(fed(law=law), 0.4)):
        model = fvsolve.build(fvsolve.load(case))
        state = model.scale * np.random.default_rng(1).normal(scale=0.1, size=model.y_size)
        assert stray(model, 0.0, state) < 1e-7


def test_a_shut_chamber_holds_the_load_and_the_friction_has_nothing_to_do():
    """Without stated pressures a shut chamber has the pressure that supports the load, as without friction."""
    links = JACK.links() | {"weight": {"type": "force", "to": "load", "force": -3000.0}}
    for key in ("initial_pressure_A", "initial_pressure_B"):
        links["cyl"].pop(key)
    run = runs(fed(end=0.1) | {"nodes": JACK.nodes(), "links": links})
    assert set(run["load.velocity"]) == {0.0}
    assert run["cyl.A.pressure"][0] == pytest.approx(AMBIENT + 3000.0 / JACK.areas[0], rel=1e-12)


FAULTS = [
    (
        {"coulomb": 60.0, "static": 50.0},
        "links.cyl.friction.static",
        "is 50 N, below `coulomb`, 60 N",
    ),
    ({"static": 50.0}, "links.cyl.friction", "coulomb is missing"),
    ({"coulomb": -1.0}, "links.cyl.friction.coulomb", "at least 0"),
    ({"coulomb": 1.0, "stribeck_velocity": 0.0}, "links.cyl.friction.stribeck_velocity", "above 0"),
    (
        {"coulomb": 1.0, "stribek_velocity": 0.1},
        "links.cyl.friction.stribek_velocity",
        "did you mean",
    ),
    ({"coulomb": "1 m"}, "links.cyl.friction.coulomb", "a force"),
    (3.0, "links.cyl.friction", "is not a table"),
]


@pytest.mark.parametrize(("friction", "place", "text"), FAULTS)
def test_faults_of_friction_are_named(friction, place, text):
    case = fed()
    case["links"]["cyl"]["friction"] = friction
    with pytest.raises(CaseError) as error:
        fvsolve.load(case)
    assert text in str(error.value) and place in str(error.value)


def test_a_cylinder_between_points_in_space_has_no_dry_friction():
    nodes = {
        "world": {"type": "frame", "points": {"foot": [0.0, 0.0, 0.0]}},
        "load": {
            "type": "body",
            "mass": 20.0,
            "points": {"lug": [0.0, 0.0, 0.0]},
            "joint": {"kind": "prismatic", "axis": [1.0, 0.0, 0.0], "travel": JACK.x},
        },
    }
    cylinder = JACK.links()["cyl"] | {"ports": {"rod": "load.lug", "case": "world.foot"}}
    with pytest.raises(
        CaseError, match="friction: dry friction acts between masses on an axis only"
    ):
        fvsolve.load(fed() | {"nodes": nodes, "links": {"cyl": cylinder}})
