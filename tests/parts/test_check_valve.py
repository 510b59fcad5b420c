"""Check valves: closing times in closed form, arrangements that could chatter, slow discs against SciPy.

With a deceleration curve: slams of evenly decelerated columns, and Joukowsky's jump in a main.
"""

import functools
import math

import numpy as np
import pytest
from reference import lifted_valves
from reference.folders import CASES
from reference.pairs import pairs
from reference.refusals import refused
from reference.scenes import (
    GRAVITY,
    RHO,
    SHARP,
    SMOOTH,
    WATER,
    area,
    chamber,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    valve,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.studies.energy_balance import energy

FRICTION = {"model": "steady", "factor": 0.02}


def check(start, end, flow_area=0.02, **more):
    return {
        "type": "check-valve",
        "from": start,
        "to": end,
        "area": flow_area,
        "discharge_coefficient": 1.0,
        **more,
    }


def column(numerics):
    """Return a case of a rigid column behind a check valve, whose reservoir pressure falls at 1 s."""
    nodes = {
        "pump": reservoir({"time": [0.0, 1.0], "value": [3e5, 1e5], "kind": "step"}),
        "a": junction(),
    }
    nodes["town"] = reservoir(2e5)
    links = {
        "check": check("pump", "a"),
        "way": {
            "type": "rigid-column",
            "from": "a",
            "to": "town",
            "length": 20.0,
            "diameter": 0.2,
            "friction": {"model": "none"},
        },
    }
    return scene(nodes, links, 4.0, numerics, ["check.flow"], 0.1)


def column_shuts():
    """Time [s] at which the flow is zero, by dM/dt = (A / L) (dP - M^2 / G), with M^2 = G 1e5 Pa at 1 s."""
    g = 2.0 * RHO * 0.02**2  # drops of 1e5 Pa and -1e5 Pa before and after 1 s
    return 1.0 + math.pi / 4.0 * math.sqrt(g / 1e5) * 20.0 / area(0.2)


@pytest.mark.parametrize("method, order", [("improved-euler", 2), ("rk4", 4)])
def test_the_time_of_shutting_converges_with_the_order_of_the_method(method, order):
    errors = []
    for step in (0.04, 0.02, 0.01):
        result = fvsolve.run(column({"method": method, "step": step}))
        (event,) = result.summary["events"]
        errors.append(abs(event["time"] - column_shuts()))
        after = result["check.flow"][result.t > event["time"]]
        assert event["what"] == "shuts" and not after.any()  # exactly zero
    assert math.log2(errors[0] / errors[2]) / 2.0 == pytest.approx(order, abs=0.4)


def test_under_error_control_it_shuts_on_time():
    result = fvsolve.run(column({"method": "dormand-prince", "rtol": 1e-11}))
    assert [e["time"] for e in result.summary["events"]] == pytest.approx(
        [column_shuts()], abs=1e-8
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_at_a_jump_it_stops_the_flow_at_once(law):
    """The reservoir falls by more than Z M0: the flow stops within the step, and the pressure behind falls by Z M0."""
    nodes = {
        "pump": reservoir({"time": [0.0, 0.1], "value": [6e5, 1e5], "kind": "step"}),
        "a": junction(),
    }
    nodes["town"] = reservoir(5.9e5)
    links = {"check": check("pump", "a", 0.005), "main": pipe("a", "town", 100.0, 0.3, 1000.0, 20)}
    result = fvsolve.run(
        scene(
            nodes,
            links,
            0.25,
            SHARP,
            ["check.flow", "a.pressure"],
            0.01,
            fluid={**WATER, "law": law},
        )
    )
    first = math.sqrt(2.0 * RHO * 0.005**2 * 1e4)
    after = (result.t > 0.1) & (result.t < 0.29)
    assert not result["check.flow"][after].any()
    near = 1e-12 if law == "linear" else 5e-3
    assert result["a.pressure"][after] == pytest.approx(
        5.9e5 - 1000.0 / area(0.3) * first, rel=near
    )


def test_valves_that_a_jump_shuts_and_opens_are_listed_once():
    """Each jump of the lake gives one event of the check valve and one of the check valve of the pump."""
    fall = reservoir({"time": [0.0, 1.0, 2.0], "value": [3e5, 1e5, 3e5], "kind": "step"})
    nodes = {"pump": fall, "a": junction(), "b": junction(), "town": reservoir(2e5)}
    links = {
        "check": check("pump", "a"),
        "tap": valve("a", "town", 0.01),
        "way": valve("b", "town", 0.01),
        "lift": {
            "type": "pump",
            "from": "pump",
            "to": "b",
            "check_valve": True,
            "curve": {"flow": [0.05], "head": [5.0]},
        },
    }
    result = fvsolve.run(
        scene(nodes, links, 3.0, {"method": "rk4", "step": 0.1}, ["check.flow", "lift.flow"], 0.1)
    )
    shuts = [(1.0, "check", "shuts"), (1.0, "lift", "check valve shuts")]
    opens = [(2.0, "check", "opens"), (2.0, "lift", "check valve opens")]
    assert sorted((e["time"], e["name"], e["what"]) for e in result.summary["events"]) == [
        *shuts,
        *opens,
    ]
    stands = (result.t > 1.0) & (result.t < 2.0)
    assert not result["check.flow"][stands].any() and not result["lift.flow"][stands].any()


FALL_AND_RISE = {"time": [0.0, 0.5, 2.0, 2.5], "value": [50.0, 10.0, 10.0, 60.0]}
HARD = {
    "two in series": (
        {"a": junction(), "m": junction(), "b": junction()},
        {"one": check("a", "m"), "two": check("m", "b")},
    ),
    "two in parallel": (
        {"a": junction(), "b": junction()},
        {"one": check("a", "b"), "two": check("a", "b", 0.01)},
    ),
    "against each other": (
        {"a": junction(), "b": junction()},
        {"one": check("a", "b"), "two": check("b", "a", 0.01)},
    ),
    "between chambers": ({"a": chamber(0.01), "b": chamber(0.02)}, {"one": check("a", "b", 0.001)}),
    "spring loaded": (
        {"a": junction(), "b": junction()},
        {"one": check("a", "b", cracking_pressure=2e4)},
    ),
    "on a slope": (
        {"a": junction(elevation=5.0), "b": junction(elevation=9.0)},
        {"one": check("a", "b")},
    ),
}
WAYS = [
    ("linear", SMOOTH),
    ("linear", {"method": "rodas-5p", "rtol": 1e-5}),
    ("log", SMOOTH),
]


def hard(name, law, numerics, head=FALL_AND_RISE, end=3.0):
    nodes, links = HARD[name]
    nodes = {"pump": lake(head), "town": lake(40.0), **nodes}
    if name == "on a slope":
        nodes = {k: {"elevation": 0.0, **node} for k, node in nodes.items()}
    ways = {
        "up": pipe("pump", "a", 60.0, 0.2, 1000.0, 10, friction=FRICTION),
        "down": pipe("b", "town", 90.0, 0.2, 1000.0, 15, friction=FRICTION),
    }
    probes = [f"{link}.flow" for link in links]
    return scene(nodes, {**ways, **links}, end, numerics, probes, 0.01, fluid={**WATER, "law": law})


@pytest.mark.in_turn
@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("law, numerics", WAYS, ids=["explicit", "rosenbrock", "log"])
def test_hard_scenes_end_with_few_events_and_no_flow_backwards(name, law, numerics):
    result = fvsolve.run(hard(name, law, numerics))
    assert result.ok, result.reason
    assert 1 <= len(result.summary["events"]) <= 40
    scale = max(np.ptp(result[probe]) for probe in result.probes)
    for probe in result.probes:
        assert result[probe].min() >= -1e-9 * scale
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_a_stretch_depends_on_its_state_and_on_nothing_that_ran_before():
    """Results of `advance` and `rhs` with an ideal check valve do not depend on earlier calls."""
    nodes = {"lake": reservoir(3e5), "near": junction(), "end": junction(), "sink": reservoir(1e5)}
    links = {
        "one": check("lake", "near", 0.01),
        "main": pipe("near", "end", 100.0, 0.2, 1000.0, 10),
        "tap": valve("end", "sink", 2e-3, ramp(0.05, 0.02, 1.0, 0.0)),
    }
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 2.0, {}, ["main.flow"])))
    halfway = fvsolve.advance(model, fvsolve.initial_state(model), 0.4)
    once, rates = fvsolve.advance(model, halfway, 0.7).y, model.rhs(0.4, halfway.y)
    fvsolve.advance(model, fvsolve.initial_state(model), 1.9)
    assert np.array_equal(fvsolve.advance(model, halfway, 0.7).y, once)
    assert np.array_equal(model.rhs(0.4, halfway.y), rates)
    assert np.array_equal(
        fvsolve.advance(model, fvsolve.advance(model, fvsolve.initial_state(model), 0.4), 0.7).y,
        once,
    )


@pytest.mark.parametrize("name", ["two in series", "between chambers"])
def test_at_rest_it_rests(name):
    result = fvsolve.run(hard(name, "linear", SMOOTH, 40.0, 1.0))
    assert (
        all(not np.ptp(result[probe]) for probe in result.probes) and result.summary["events"] == []
    )


@pytest.mark.parametrize("head, shut", [(58.0, False), (30.0, True)])
def test_steady_states_find_the_shut_valves(head, shut):
    """The check valve of the lower lake is shut at a head of 30 m and open at 58 m; that of the higher lake is open."""
    nodes = {
        "low": lake(head),
        "high": lake(60.0),
        "a": junction(),
        "b": junction(),
        "town": junction(0.02),
    }
    nodes["lake"] = lake(45.0)
    links = {"one": check("low", "a"), "two": check("high", "b")}
    for k, (i, j) in enumerate([("a", "town"), ("b", "town"), ("town", "lake")]):
        links[f"p{k}"] = pipe(
            i, j, 200.0, 0.2, 1000.0, 5, friction={"model": "steady", "factor": 0.02}
        )
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, SMOOTH)))
    heads = {name: node["head"] for name, node in model.checks["nodes"].items()}
    assert (heads["a"] > head) == shut and heads["b"] < 60.0
    assert not model.rhs(0.0, np.zeros(model.y_size)).any()


@functools.cache
def slam():
    """Return (t, (lift, mass flow, pressure behind), events) of the shipped case until 4.5 s, by `discs.slam`."""
    weight, z = RHO * GRAVITY, 1200.0 / area(0.3)
    head = lambda t: 101325.0 + weight * np.interp(t, [0.5, 1.0], [30.3, 10.0])  # noqa: E731
    g, far = 2.0 * RHO * (0.61 * 0.05) ** 2, 101325.0 + weight * 30.0
    return lifted_valves.slam(head, g, z, 1.0, far, 2e3, 0.2, 4.5, [0.5, 1.0])


def test_a_disc_that_shuts_late_slams_by_waves_and_its_own_equation():
    t, (x, m, _), events = slam()
    result = fvsolve.run(CASES / "check-valve-slam.toml", set={"links.main.cells": 240})
    found, slammed = [e["time"] for e in result.summary["events"]], events[1][0]
    assert found[: len(events)] == pytest.approx([e[0] for e in events], abs=1e-4)
    before, after = result.t < slammed - 0.05, (result.t > slammed + 1e-3) & (result.t < 5.0)
    assert result["check.opening"][before] == pytest.approx(
        np.interp(result.t, t, x)[before], abs=5e-4
    )
    # [l/s]
    assert result["check.flow"][before] == pytest.approx(np.interp(result.t, t, m)[before], abs=0.1)
    assert result["check.flow"].min() < -1.0 and not result["check.flow"][after].any()


@pytest.mark.parametrize("method, courant, near", [("implicit-euler", 1.0, 0.05), ("implicit-euler", 2.0, 0.1),
                                                   ("trapezoid", 1.0, 7e-3), ("alexander-2", 2.0, 7e-3),
                                                   ("gauss-4", 2.0, 2e-3)])  # fmt: skip
def test_a_disc_that_slams_within_a_given_implicit_step_is_placed_on_its_seat(
    method, courant, near
):
    """A long implicit step in which the disc shuts ends with the lift 0.

    The equation of the lift has a solution near zero and one far below it, and in longer steps only the latter.
    Newton's method failed in the step that ends at the closing, or left the lift at -0.08.
    """
    numerics = {"numerics.method": method, "numerics.courant": courant, "links.main.cells": 60}
    model = fvsolve.build(fvsolve.load(CASES / "check-valve-slam.toml", set=numerics))
    result = fvsolve.run(model)
    assert result.reason == "finished"
    found, wanted = result.summary["events"], slam()[2]
    assert [e["time"] for e in found[:2]] == pytest.approx([e[0] for e in wanted[:2]], abs=near)
    end, lift = fvsolve.advance(model, fvsolve.State(0.0, model.start.copy()), 4.0), 1.0
    assert lift + end.y[model.state_names.index("check.opening")] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_a_disc_that_slams_on_a_rigid_column_stops_it_dead_and_opens_again(rtol):
    """The disc shuts on a flowing column, and leaves its seat at a head of 20 m plus the cracking pressure."""
    head = {"time": [1.0, 3.0, 8.0, 10.0], "value": [22.0, 5.0, 5.0, 30.0]}
    links = {
        "cv": check("up", "a", 0.0122, cracking_pressure=2e3, overpressure=4e4, time_constant=0.4),
        "c": {
            "type": "rigid-column",
            "from": "a",
            "to": "o",
            "length": 300.0,
            "diameter": 0.2,
            "friction": FRICTION,
        },
    }
    case = scene(
        {"up": lake(head), "a": junction(), "o": lake(20.0)},
        links,
        15.0,
        {"rtol": rtol},
        ["c.flow"],
    )
    result = fvsolve.run(case)
    assert result.ok and [mark["what"] for mark in result.summary["marks"]] == ["stopped dead"]
    shuts, opens = result.summary["events"]
    assert (shuts["what"], opens["what"]) == ("is shut", "leaves its seat")
    lift = 20.0 + 2e3 / (RHO * GRAVITY)
    assert opens["time"] == pytest.approx(8.0 + 2.0 * (lift - 5.0) / 25.0, rel=1e-9)
    stands = (result.t > shuts["time"]) & (result.t < opens["time"])
    assert np.all(result["c.flow"][stands] == 0.0) and result["c.flow"][-1] > 0.0
    assert result.summary["warnings"] == []


LAG, SWING = {"time_constant": 0.4}, {"natural_frequency": 0.6, "damping_ratio": 0.5}
METHODS = {
    "auto": {"rtol": 1e-6},
    "rodas-5p": {"method": "rodas-5p", "rtol": 1e-6},
    "rodas-4": {"method": "rodas-4", "rtol": 1e-6},
    "radau": {"method": "radau-iia-5", "rtol": 1e-6},
    "explicit": {"method": "dormand-prince", "rtol": 1e-6},
    "sharp": {"method": "rodas-5p", "rtol": 1e-9},
    "given": {"method": "rk4", "step": 1e-3},
}


def held_column(kind, after, disc, numerics):
    """Return (case, name of the valve) with a drop that rises by 24 kPa/s until 9 s.

    The valve of type `kind` is before a rigid column, or behind it if `after` is True.
    """
    drop = {"time": [4.0, 9.0, 9.5], "value": [1.9e5, 3.1e5, 3.1e5]}
    part = {"type": kind, "area": 0.01, "discharge_coefficient": 0.61, "overpressure": 1e4, **disc}
    part |= {"cracking_pressure": 2e3} if kind == "check-valve" else {"set_pressure": 3.02e5}
    column = {
        "type": "rigid-column",
        "length": 50.0,
        "diameter": 0.1,
        "friction": {"model": "quasi-steady", "factor": 0.02},
    }
    first, second = (column, part) if after else (part, column)
    links = {
        "one": {**first, "from": "up", "to": "m"},
        "two": {**second, "from": "m", "to": "down"},
    }
    nodes = {"up": reservoir(drop), "m": junction(), "down": reservoir(3e5)}
    name = "two" if after else "one"
    return scene(nodes, links, 10.0, numerics, [f"{name}.opening", f"{name}.flow"], 0.1), name


def leaving(disc, felt):
    return leaving_of(tuple(disc.items()), felt)


@functools.cache
def leaving_of(disc, felt):
    disc = dict(disc)
    inertia = 50.0 / area(0.1)
    friction = 0.02 * 50.0 / (0.1 * 2.0 * RHO * area(0.1) ** 2)
    source = lambda t: np.interp(t, [4.0, 9.0], [-1.1e5, 1e4])  # noqa: E731
    g = 2.0 * RHO * (0.61 * 0.01) ** 2
    return lifted_valves.leaves_with_column(
        source, 9.0, g, 2e3, 1e4, disc, inertia, friction, felt, (8.8, 9.0, 10.0)
    )


def assert_leaves(case, name, disc, felt):
    result = fvsolve.run(case)
    start, (lift, flow) = leaving(disc, felt)
    assert result.ok and not [
        w for w in result.summary["warnings"] if w["place"].startswith("links")
    ]
    assert [(e["what"], e["time"]) for e in result.summary["events"]] == [
        ("leaves its seat", pytest.approx(start, abs=1e-8))
    ]
    at = [int(np.argmin(abs(result.t - t))) for t in (8.8, 9.0, 10.0)]
    assert result[f"{name}.opening"][at] == pytest.approx(lift, rel=1e-3)
    assert result[f"{name}.flow"][at] * RHO == pytest.approx(flow, rel=1e-3)


@pytest.mark.in_turn
@pytest.mark.parametrize("disc", [LAG, SWING])
@pytest.mark.parametrize("method", METHODS)
def test_a_disc_and_its_supported_column_leave_its_seat_by_their_equations(method, disc):
    """Lift and flow start as powers of time, and the rate of their coupling is infinite at first."""
    assert_leaves(*held_column("check-valve", False, disc, METHODS[method]), disc, "drop")


@pytest.mark.in_turn
@pytest.mark.parametrize("disc", [LAG, SWING])
@pytest.mark.parametrize("kind, after, felt", [("check-valve", True, "drop"), ("relief-valve", True, "drop"),
                                               ("relief-valve", False, "source")])  # fmt: skip
def test_so_do_a_disc_behind_its_column_and_a_relief_valve(kind, after, felt, disc):
    assert_leaves(*held_column(kind, after, disc, METHODS["auto"]), disc, felt)


def test_advance_stops_a_column_dead_as_a_run_does():
    """The slam removes the remaining flow also in `advance`: the flow after the next opening is that of a run."""
    case, name = held_column("check-valve", False, LAG, METHODS["sharp"])
    case["nodes"]["up"]["pressure"] = {
        "time": [0.5, 2.0, 4.0, 9.0],
        "value": [3.1e5, 1.9e5, 1.9e5, 3.1e5],
    }
    model = fvsolve.build(fvsolve.load(case))
    state, result = fvsolve.initial_state(model), fvsolve.run(case)
    assert [mark["what"] for mark in result.summary["marks"]] == ["stopped dead"]
    for until in (3.0, 9.0, 10.0):
        state = fvsolve.advance(model, state, until)
    read = model.evaluate(state.t, state.y)[1][model.layout["column"]]
    assert read == pytest.approx(result[f"{name}.flow"][-1] * RHO, rel=1e-5)


@pytest.mark.parametrize("after", [False, True])
def test_so_they_do_in_a_fluid_that_is_all_but_stiff(after):
    """The density law `log` with 1000 times the bulk modulus of water gives the results of the linear law."""
    case, name = held_column("check-valve", after, LAG, METHODS["explicit"])
    case["fluid"] = {**case["fluid"], "law": "log", "bulk_modulus": 2.2e12}
    assert_leaves(case, name, LAG, "drop")


def slamming(disc, rho=RHO) -> float:
    """Time [s] at which the disc of `slammed` shuts, by SciPy under the linear law."""
    return slamming_of(tuple(disc.items()), rho)


@functools.cache
def slamming_of(disc, rho):
    disc = dict(disc)
    far, k = (lambda t: np.interp(t, [1.0, 4.0, 9.0], [3e5, 4.4e5, 3.2e5])), area(0.1) / 50.0
    g, friction = 2.0 * rho * (0.61 * 0.01) ** 2, 0.02 * 50.0 / (0.1 * 2.0 * rho * area(0.1) ** 2)
    lag, w, zeta = (
        disc.get(key, 0.0) for key in ("time_constant", "natural_frequency", "damping_ratio")
    )
    w *= 2.0 * math.pi
    drop = lambda x, m: m * abs(m) / (g * x * x)  # noqa: E731
    lift = lambda x, m: (drop(x, m) - 2e3) / 1e4 - x  # noqa: E731

    def rates(t, y):
        x, m, v = y
        drive, braked = lift(x, m), k * (3.3e5 - far(t) - drop(x, m) - friction * m * abs(m))
        held = x >= 1.0 and (drive if lag else max(v, drive)) >= 0.0
        return [
            0.0 if held else drive / lag if lag else v,
            braked,
            0.0 if lag or held else w * (w * drive - 2 * zeta * v),
        ]

    seat = lambda t, y: y[0] - 1e-5  # noqa: E731
    seat.terminal = True
    x = brentq(lambda x: lift(x, math.sqrt(3e4 / (friction + 1.0 / (g * x * x)))), 1e-3, 2.0)
    x = min(x, 1.0)
    y = [x, math.sqrt(3e4 / (friction + 1.0 / (g * x * x))), 0.0]
    found = solve_ivp(
        rates, (0.0, 4.0), y, method="Radau", rtol=1e-9, atol=1e-12, events=seat, max_step=0.01
    )
    return found.t_events[0][0] + 1e-5 / abs(rates(found.t[-1], found.y[:, -1])[0])


def slammed(disc, law, numerics, end):
    """Return (result, name of the valve) for the valve of `held_column` under a rising downstream pressure."""
    case, name = held_column("check-valve", False, disc, numerics)
    case["nodes"] |= {
        "up": reservoir(3.3e5),
        "down": reservoir({"time": [1.0, 4.0, 9.0], "value": [3e5, 4.4e5, 3.2e5]}),
    }
    case["numerics"]["end"] = end
    water = {"name": "Water", "temperature": 293.15, "pressure": 101325.0, "law": "table"}
    case["fluid"] = water if law == "table" else {**case["fluid"], "law": law}
    return fvsolve.run(case), name


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["log", "table"])
@pytest.mark.parametrize("disc", [LAG, SWING])
@pytest.mark.parametrize("numerics", [METHODS["auto"], METHODS["radau"], METHODS["explicit"],
                                      {"method": "rk4", "step": 2e-4}])  # fmt: skip
def test_a_column_that_slams_its_disc_shut_is_followed_under_every_law(numerics, disc, law):
    """At drops of 1000 bar density is exponential in pressure; before, it differs by p / K from the linear law."""
    result, name = slammed(disc, law, numerics, 10.0)
    shuts, leaves = result.summary["events"]
    start, (_, flow) = leaving(disc, "drop")
    assert result.reason == "finished" and (shuts["what"], leaves["what"]) == (
        "is shut",
        "leaves its seat",
    )
    assert shuts["time"] == pytest.approx(slamming(disc), abs=2e-3)
    assert leaves["time"] == pytest.approx(start, abs=1e-6)
    assert result[f"{name}.flow"][-1] * RHO == pytest.approx(flow[-1], rel=5e-3)


@pytest.mark.parametrize(
    "method, step, law, disc",
    pairs(
        ["rk4", "ssp-rk3", "heun", "rodas-5p", "radau-iia-5"],
        [2e-4, 5e-4, 1e-3, 2e-3],
        ["linear", "log", "table"],
        [LAG, SWING],
    ),
)
def test_steps_of_given_length_do_not_pass_over_a_slam(method, step, law, disc):
    """The lift ends as the power 1/3 or 2/3 of the time left, so the step that contains the slam is divided."""
    result, _ = slammed(disc, law, {"method": method, "step": step}, 3.6)
    (shuts,) = result.summary["events"]
    assert result.ok and shuts["what"] == "is shut"
    assert shuts["time"] == pytest.approx(
        slamming(disc, result.summary["fluid"]["density"]), rel=3e-5
    )
    # schedules continue after the end
    (limit,) = [row for row in result.summary["warnings"] if row["kind"] != "end"]
    assert (limit["kind"], limit["ok"]) == ("step-limit", True) and "rigid column" in limit["text"]


@pytest.mark.parametrize(
    "disc", [{"time_constant": 0.1}, {"natural_frequency": 2.0, "damping_ratio": 0.2}]
)
def test_a_disc_half_open_at_the_start_does_not_move(disc):
    case = hard("spring loaded", "linear", SMOOTH, 50.0, 0.5)
    case["links"]["one"] = {**case["links"]["one"], **disc, "overpressure": 2e5}
    result = fvsolve.run(case)
    assert (
        np.ptp(result["one.flow"]) == 0.0
        and result["one.flow"][0] > 0.0
        and result.summary["events"] == []
    )


def test_shut_or_open_it_gives_nothing_out():
    found = energy(hard("two in series", "linear", {"method": "rodas-5p", "rtol": 1e-7}))
    for name in ("one", "two"):
        assert found.dissipated[f"{name} check valve"][-1] > 0.0 and np.all(
            np.diff(found.dissipated[f"{name} check valve"]) >= -1e-6
        )


@pytest.mark.parametrize(
    "more, text",
    [
        ({"cracking_pressure": -1.0}, "at least 0"),
        ({"time_constant": 0.1}, "overpressure is missing"),
        ({"overpressure": 1e4}, "needs the key `time_constant`"),
        ({"time_constant": 0.0, "overpressure": 1e4}, "above 0"),
    ],
)
def test_bad_check_valves_are_refused(more, text):
    case = hard("two in series", "linear", {})
    case["links"]["one"] = {**case["links"]["one"], **more}
    refused(case, text)


DEAD_ENDS = {
    "check valve": check("x", "m"),
    "spring loaded": check("x", "m", cracking_pressure=2e3),
    "pump": {
        "type": "pump",
        "from": "x",
        "to": "m",
        "check_valve": True,
        "curve": {"flow": [0.05], "head": [20.0]},
    },
}


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("twice", [False, True])
@pytest.mark.parametrize("name", DEAD_ENDS)
def test_before_a_valve_that_shuts_it_comes_to_rest(name, twice, turned, law):
    """Between check valves and a closed valve at a plain junction the flow stops and events end."""
    tap = valve("m", "sink", 0.01, ramp(0.1, 0.1, 1.0, 0.0))
    nodes = {"lake": reservoir(3e5), "x": junction(), "m": junction(), "sink": reservoir(2e5)}
    links = {"one": DEAD_ENDS[name], "tap": tap}
    if twice:
        links["two"] = DEAD_ENDS[name]
    ends = ("lake", "x")
    if turned:  # the pipe is behind the check valve, and the valve that shuts before it
        links = {k: {**link, "from": "m", "to": "x"} for k, link in links.items() if k != "tap"}
        links["tap"], ends = valve("lake", "m", 0.01, ramp(0.1, 0.1, 1.0, 0.0)), ("x", "sink")
    links["way"] = pipe(*ends, 50.0, 0.2, 1000.0, 10, friction=FRICTION)
    for numerics in ({**SHARP, "courant": 0.7}, {"method": "rodas-5p", "rtol": 1e-6}):
        case = scene(
            nodes, links, 1.0, numerics, ["one.flow", "tap.flow"], 0.05, fluid={**WATER, "law": law}
        )
        result = fvsolve.run(case)
        assert result.ok and len(result.summary["events"]) <= 6, result.reason
        assert abs(result["one.flow"][-1]) < 1e-12
        assert not result["tap.flow"][result.t > 0.2 + 1e-9].any()


@pytest.mark.parametrize("beside", ["tank", "reservoir"])
def test_liquid_that_does_not_part_shuts_it_when_the_law_without_cavities_does(beside):
    """Without cavities, `cavitation = true` changes event times by less than the travel time of a cell."""
    ground = {"elevation": 0.0}
    ends = {
        "tank": {"type": "tank", "area": 0.5, "level": 15.0},
        "reservoir": {"type": "reservoir", "head": 15.0},
    }
    nodes = {
        "lake": {"type": "reservoir", "head": 20.0, **ground},
        "a": junction(**ground),
        "j": junction(**ground),
    }
    nodes["far"] = ends[beside] | ground
    times = [0.5, 0.6, 1.1, 1.2, 1.6, 1.7, 3.0, 3.3, 4.0, 4.1]
    opening = {"time": times, "value": [1.0, 0.05, 0.05, 1.0, 1.0, 0.1, 0.1, 0.8, 0.8, 0.0]}
    disc = {
        "type": "check-valve",
        "from": "j",
        "to": "far",
        "diameter": 0.3,
        "loss_coefficient": 1.0,
    }
    links = {
        "tap": valve("lake", "a", 0.001, opening),
        "check": disc,
        "main": pipe("a", "j", 200.0, 0.3, 1200.0, 160, friction=FRICTION),
    }
    numerics, found = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.5}, []
    for fluid in ({"law": "log"}, {"law": "mixture", "cavitation": True}):
        result = fvsolve.run(
            scene(nodes, links, 2.6, numerics, ["check.flow"], 0.05, fluid={**WATER, **fluid})
        )
        assert result.ok and not result.summary["cavities"]
        found.append([(one["what"], one["time"]) for one in result.summary["events"]])
    without, among = found
    assert [what for what, _ in without] == [what for what, _ in among] and len(without) >= 8
    assert [t for _, t in among] == pytest.approx(
        [t for _, t in without], abs=200.0 / 1200.0 / 160.0
    )


BORE, LENGTH = 0.2, 50.0
RATES, VELOCITIES = [0.5, 2.0, 6.0], [0.02, 0.1, 0.5]
TIGHT = {"method": "dormand-prince", "rtol": 1e-10}


def slam_curve_case(start: str, end: str, **more) -> dict:
    """Return a check valve with a deceleration curve and a negligible loss."""
    return {
        "type": "check-valve",
        "from": start,
        "to": end,
        "diameter": BORE,
        "loss_coefficient": 1e-7,
        "deceleration": {"rate": RATES, "reverse_velocity": VELOCITIES},
        **more,
    }


def slam_curve_column(
    rate: float, numerics: dict, law: str = "linear", against: bool = False, first: float = 1.5
) -> dict:
    """Return a case of a rigid column with the velocity `first` [m/s], which its ends decelerate by `rate` [m/s2]."""
    nodes = {"up": reservoir(3e5), "mid": junction(), "town": reservoir(3e5 + rate * RHO * LENGTH)}
    way = {
        "type": "rigid-column",
        "from": "mid",
        "to": "town",
        "length": LENGTH,
        "diameter": BORE,
        "friction": {"model": "none"},
        "initial_flow": first * area(BORE),
    }
    if against:
        way |= {"from": "town", "to": "mid", "initial_flow": -first * area(BORE)}
    links = {"check": slam_curve_case("up", "mid"), "way": way}
    fluid = WATER | {"law": law} | ({"air_fraction": 0.0} if law == "mixture" else {})
    return scene(nodes, links, 6.0, numerics, ["check.flow", "check.opening"], 0.05, fluid=fluid)


def times(result) -> dict[str, float]:
    return {event["what"]: event["time"] for event in result.summary["events"]}


@pytest.mark.parametrize("rate", [0.3, 0.5, 1.1, 2.0, 4.0, 6.0, 9.0])
def test_on_a_column_that_slows_down_evenly_it_returns_its_curve(rate):
    """The flow reverses after v0 / d; the valve shuts v / d later, with v of the curve, constant beyond its ends."""
    result = fvsolve.run(slam_curve_column(rate, TIGHT))
    at = times(result)
    slam = rate * (at["shuts"] - at["flow reverses"])
    assert at["flow reverses"] == pytest.approx(1.5 / rate, rel=1e-6)
    assert slam == pytest.approx(np.interp(rate, RATES, VELOCITIES), rel=1e-6)
    assert ("flow reverses faster than its curve covers" in at) == (rate > 6.0)
    after = result.t > at["shuts"]
    assert not result["check.flow"][after].any() and not result["check.opening"][after].any()


CURVE_WAYS = [
    ("linear", {"method": "radau-iia-5", "rtol": 1e-8}),
    ("linear", {"method": "rodas-5p", "rtol": 1e-8}),
    ("linear", {"method": "rk4", "step": 0.01}),
    ("log", TIGHT),
    ("mixture", TIGHT),
]


@pytest.mark.in_turn
@pytest.mark.parametrize("against", [False, True], ids=["along", "against"])
@pytest.mark.parametrize("law, numerics", CURVE_WAYS)
def test_so_it_does_by_every_method_and_law_however_the_column_is_drawn(law, numerics, against):
    at = times(fvsolve.run(slam_curve_column(3.0, numerics, law, against)))
    near = 1e-6 if law == "linear" else 1e-3  # compressibility
    assert 3.0 * (at["shuts"] - at["flow reverses"]) == pytest.approx(
        np.interp(3.0, RATES, VELOCITIES), rel=near
    )


@pytest.mark.parametrize("law", ["linear", "log"])
def test_in_a_main_joukowskys_jump_follows_its_slam(law):
    """The pressure falls by rho a d per second, so the velocity by d, until reflections return from the far end."""
    v, d, speed = 0.3, 1.5, 1000.0
    fall = {"time": [0.0, 0.1, 0.6], "value": [9e5, 9e5, 9e5 - 0.5 * RHO * speed * d]}
    nodes = {"up": reservoir(fall), "mid": junction(), "town": junction(v * area(BORE))}
    links = {
        "check": slam_curve_case("up", "mid"),
        "main": pipe("mid", "town", 500.0, BORE, speed, 500),
    }
    numerics = {"scheme": "upwind", "method": "euler", "courant": 1.0}
    case = scene(
        nodes,
        links,
        0.5,
        numerics,
        ["check.flow", "mid.pressure"],
        1e-3,
        fluid=WATER | {"law": law},
    )
    result = fvsolve.run(case)
    at, wanted = times(result), float(np.interp(d, RATES, VELOCITIES))
    assert at["flow reverses"] == pytest.approx(0.1 + v / d, abs=2e-3)
    near = 1e-3 if law == "linear" else 0.02
    assert d * (at["shuts"] - at["flow reverses"]) == pytest.approx(wanted, rel=near, abs=2e-3 * d)
    after = (result.t > at["shuts"] + 2e-3) & (result.t < 0.48)
    before = result["mid.pressure"][result.t < at["shuts"]]
    jump = result["mid.pressure"][after] - before[-1]
    assert jump == pytest.approx(RHO * speed * wanted, rel=0.05)
    assert not result["check.flow"][after].any() and abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("end", [0.45, 0.6, 1.0], ids=["open", "turned", "shut"])
def test_resumed_it_is_the_unbroken_run_to_the_bit(tmp_path, end):
    case = slam_curve_column(3.0, {"method": "rk4", "step": 0.05})
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run", pictures=False)
    result = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    whole = fvsolve.run(case)
    assert np.array_equal(result["check.flow"], whole["check.flow"])
    assert result.summary["events"] == whole.summary["events"]


@pytest.mark.parametrize(
    "wrong, said",
    [({"time_constant": 0.1, "overpressure": 1e3}, "define how the valve shuts"),
     ({"deceleration": {"rate": [1.0, 2.0], "reverse_velocity": [0.1]}}, "has length 1, but `rate` has length 2"),
     ({"deceleration": {"rate": [2.0, 1.0], "reverse_velocity": [0.1, 0.2]}}, "rates"),
     ({"deceleration": {"rate": [1.0]}}, "reverse_velocity is missing"),
     ({"deceleration": 3.0}, "is not a table"),
     ({"diameter": None, "loss_coefficient": None, "Kv": 100.0}, "the velocities of this curve refer to a bore")],
)  # fmt: skip
def test_faults_of_its_curve_are_reported(wrong, said):
    case = slam_curve_column(3.0, TIGHT)
    given = case["links"]["check"] | wrong
    case["links"]["check"] = {key: value for key, value in given.items() if value is not None}
    assert said in str(refused(case))


def test_its_energy_closes_through_a_slam_and_it_only_dissipates():
    nodes = {
        "up": reservoir({"time": [0.0, 0.05, 0.35], "value": [9e5, 9e5, 3e5]}),
        "mid": junction(),
    }
    nodes["town"] = junction(0.3 * area(BORE))
    links = {
        "check": slam_curve_case("up", "mid"),
        "main": pipe("mid", "town", 200.0, BORE, 1000.0, 20),
    }
    case = scene(
        nodes,
        links,
        0.6,
        {"scheme": "upwind3", "method": "dormand-prince", "rtol": 1e-8},
        ["check.flow"],
    )
    assert "shuts" in times(fvsolve.run(case))
    found = energy(case)
    scheme = sum(taken[-1] for taken in found.scheme.values())
    assert abs(found.numerical_remainder[-1] - scheme) < 1e-6 * found.throughput
    assert (np.diff(found.dissipated["check check valve"]) >= 0.0).all()
