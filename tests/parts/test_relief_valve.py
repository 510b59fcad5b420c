"""Relief valves: a plateau in closed form, both kinds of disc against SciPy at 1e-12, reverse flow, starts, faults."""

import math

import numpy as np
import pytest
from reference import lifted_valves
from reference.refusals import refused
from reference.scenes import (
    RHO,
    SMOOTH,
    WATER,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    valve,
)
from scipy.optimize import brentq

import fvsolve
from fvsolve.studies.energy_balance import energy

AMBIENT, BETA = 101325.0, 2e7
SOFT = {**WATER, "bulk_modulus": BETA}
TIGHT = {"method": "dormand-prince", "rtol": 1e-11}
ROUGH = {"model": "steady", "factor": 0.02}
RELIEF, SET, SPAN = 4e-4, 5e5, 1e5
DISCS = {"lag": {"time_constant": 0.05}, "swing": {"natural_frequency": 8.0, "damping_ratio": 0.1}}


def relief(start, end, flow_area, set_pressure=SET, overpressure=SPAN, **more):
    return {
        "type": "relief-valve",
        "from": start,
        "to": end,
        "area": flow_area,
        "discharge_coefficient": 1.0,
        "set_pressure": set_pressure,
        "overpressure": overpressure,
        **more,
    }


def filled(numerics=TIGHT, **disc):
    """Return a case of a chamber with a relief valve, filled through a valve from 0.5 s to 7 s."""
    nodes = {"pump": reservoir(1.2e6), "pot": chamber(2.0, 3e5), "sump": reservoir(1e5)}
    opening = {"time": [0.5, 1.0, 6.0, 7.0], "value": [0.0, 1.0, 1.0, 0.0]}
    links = {
        "in": valve("pump", "pot", 5e-4, opening),
        "out": valve("pot", "sump", 1e-4),
        "relief": relief("pot", "sump", RELIEF, **disc),
    }
    return scene(
        nodes,
        links,
        14.0,
        numerics,
        ["pot.pressure", "relief.opening", "relief.flow"],
        0.05,
        fluid=SOFT,
    )


def through(area, drop):
    return area * math.copysign(math.sqrt(2.0 * abs(drop) / RHO), drop)


def pot(t, p, x):
    """Pressure rate [Pa/s] of the chamber of `filled` at a lift x."""
    opening = np.interp(t, [0.5, 1.0, 6.0, 7.0], [0.0, 1.0, 1.0, 0.0])
    q = (
        through(5e-4 * opening, 1.2e6 - p)
        - through(1e-4, p - 1e5)
        - through(RELIEF * min(max(x, 0), 1), p - 1e5)
    )
    return BETA / 2.0 * q


def lag(t, y, held):
    return [pot(t, y[0], y[1]), 0.0 if held else ((y[0] - SET) / SPAN - y[1]) / 0.05]


def swing(t, y, held):
    w = 2.0 * math.pi * 8.0
    pull = w * w * ((y[0] - SET) / SPAN - y[1]) - 0.2 * w * y[2]
    return [pot(t, y[0], y[1]), 0.0 if held else y[2], 0.0 if held else pull]


@pytest.mark.parametrize("kind, rates", [("lag", lag), ("swing", swing)])
def test_a_disc_follows_scipy_through_its_stops(kind, rates):
    result = fvsolve.run(filled(**DISCS[kind]))
    start = [3e5, 0.0, 0.0][: 3 if kind == "swing" else 2]
    kinks = [0.5, 1, 6, 7]
    exact, events = lifted_valves.stopped(
        rates, lambda t, y: (y[0] - SET) / SPAN - y[1], start, kinks, result.t
    )
    assert result.ok and len(events) >= 2
    assert [e["time"] for e in result.summary["events"]] == pytest.approx(events, abs=1e-7)
    assert result["pot.pressure"] == pytest.approx(exact[0], abs=1e-6 * SPAN)
    assert result["relief.opening"] == pytest.approx(exact[1], abs=1e-6)
    assert result["relief.flow"][result["relief.opening"] == 0.0] == pytest.approx(0.0, abs=0.0)


def test_without_a_disc_it_is_the_pressure_alone_that_lifts_it():
    from scipy.integrate import solve_ivp

    result = fvsolve.run(filled())
    exact, now, p = np.zeros(result.t.size), 0.0, 3e5
    lift = lambda p: (p - SET) / SPAN  # noqa: E731
    for end in (0.5, 1.0, 6.0, 7.0, 14.0):
        step = solve_ivp(
            lambda t, y: [pot(t, y[0], lift(y[0]))],
            (now, end),
            [p],
            max_step=0.02,
            **lifted_valves.TIGHT,
        )
        here = (result.t >= now) & (result.t <= end)
        exact[here], now, p = step.sol(result.t[here])[0], end, step.y[0, -1]
    assert result["pot.pressure"] == pytest.approx(exact, abs=1e-6 * SPAN)
    assert result["relief.opening"] == pytest.approx(np.clip(lift(exact), 0, 1), abs=1e-6)
    assert [e["what"] for e in result.summary["events"]][0::5] == ["opens"] and len(
        result.summary["events"]
    ) <= 4


def main(numerics, law="linear", **more):
    """Return a case of a frictionless main with a gate that shuts and a relief valve at its end."""
    nodes = {"lake": reservoir(6e5), "end": junction(), "out": reservoir(1e5)}
    gate = {"start": 0.1, "duration": 0.2, "value": [1.0, 0.0]}
    links = {
        "main": pipe("lake", "end", 1000.0, 0.3, 1000.0, 50),
        "gate": valve("end", "out", 0.004, gate),
        "relief": relief("end", "out", **{"flow_area": 0.006, "set_pressure": 9e5, **more}),
    }
    fluid = {**WATER, "law": law}
    return scene(
        nodes,
        links,
        1.5,
        numerics,
        ["end.pressure", "relief.flow", "relief.opening"],
        0.05,
        fluid=fluid,
    )


@pytest.mark.parametrize("set_pressure, opening", [(9e5, "lifting"), (3e6, "shut"), (7e5, "full")])
def test_the_surge_ends_at_the_intersection_of_characteristic_and_valve(set_pressure, opening):
    more = {"set_pressure": set_pressure} | ({"flow_area": 1e-3} if opening == "full" else {})
    result = fvsolve.run(main(SMOOTH, **more))
    gate, first = 2.0 * RHO * 0.004**2, math.sqrt(2.0 * RHO * 0.004**2 * 5e5)
    wide, z = 2.0 * RHO * more.get("flow_area", 0.006) ** 2, 1000.0 / (math.pi / 4 * 0.3**2)
    lift = lambda p: min(max((p - set_pressure) / SPAN, 0.0), 1.0)  # noqa: E731
    balance = lambda p: first - (p - 6e5) / z - lift(p) * math.sqrt(wide * max(p - 1e5, 0.0))  # noqa: E731
    plateau = brentq(balance, 1e5, 1e7, xtol=1e-6)
    assert gate > 0 and result["end.pressure"][result.t > 0.4] == pytest.approx(plateau, rel=1e-9)
    assert result["relief.opening"][-1] == pytest.approx(lift(plateau), abs=1e-9)
    assert (result["relief.flow"][-1] == 0.0) == (opening == "shut")
    assert abs(result.ledger["mass"]["relative"]) < 1e-14 and len(result.summary["events"]) <= 2


def test_a_gate_that_shuts_at_once_lifts_it_to_where_it_stays():
    """Neither the closed nor the fully open valve is in balance; it reaches a lift between, in few events."""
    case = main(SMOOTH, flow_area=0.02)
    case["links"]["gate"]["opening"] = {"time": [0.0, 0.1], "value": [1.0, 0.0], "kind": "step"}
    result = fvsolve.run(case)
    assert (
        result.ok
        and 0.0 < result["relief.opening"][-1] < 1.0
        and len(result.summary["events"]) <= 4
    )


@pytest.mark.parametrize("law, near", [("log", 1e-3)])
def test_other_laws_lift_it_alike(law, near):
    ours, plain = (
        fvsolve.run(main(SMOOTH, law=one))["relief.opening"][-1] for one in (law, "linear")
    )
    assert ours == pytest.approx(plain, rel=near) and ours != plain


Z = 1000.0 / (math.pi / 4 * 0.1**2)  # impedance of a main [Pa s/kg]
TURN, SLOPE = 4.0, 5e4  # the upper lake falls by SLOPE [Pa/s] until TURN [s], then rises


def backwards(flow_area, law="linear"):
    """Return a case of a relief valve between long mains; the upper lake falls below the lower lake and rises again."""
    falls = {"time": [0.0, 1.0, TURN, 7.0], "value": [3e5, 3e5, 3e5 - SLOPE * (TURN - 1.0), 3e5]}
    nodes = {"up": reservoir(falls), "a": junction(), "b": junction(), "down": reservoir(2.4e5)}
    links = {
        "to-a": pipe("up", "a", 5000.0, 0.1, 1000.0, 100),
        "from-b": pipe("b", "down", 5000.0, 0.1, 1000.0, 100),
        "relief": relief("a", "b", flow_area, 1.5e5, 2e4),
    }
    numerics = {"method": "rk4", "scheme": "upwind5", "courant": 0.5}
    return scene(
        nodes,
        links,
        12.5,
        numerics,
        ["a.pressure", "relief.flow"],
        0.05,
        fluid={**WATER, "law": law},
    )


def seen(flow_area):
    """Times at which the valve leaves full opening, shuts, opens and is fully open, by the characteristics.

    Reverse flow M(x) raises p_a. Of two lifts with x = (p_a(x) - set) / span the valve keeps the greater. It shuts
    where this lift ceases to exist, and opens where the pressure without flow has returned.
    """
    g = 2.0 * RHO * flow_area**2
    first = math.sqrt(g * 6e4)

    def flow(x, fall):  # M |M| = x^2 G (drop - 2 Z (M - first)) for M < 0
        free, gx = 2.0 * fall - 6e4 - 2.0 * Z * first, 2.0 * Z * g * x * x
        return (
            -2.0 * x * x * g * free / (gx + math.sqrt(gx * gx + 4.0 * x * x * g * free))
            if x > 0.0
            else 0.0
        )

    over = lambda x, fall: (3e5 - 2.0 * fall + Z * (first - flow(x, fall)) - 1.5e5) / 2e4 - x  # noqa: E731
    x = np.linspace(0.0, 1.0, 2001)
    least = 3e4 + Z * first  # zero driving pressure
    greatest = lambda fall: max(over(one, fall) for one in x)  # noqa: E731
    full = brentq(lambda fall: over(1.0, fall), least, 1.5e5, xtol=1e-3)
    empty = brentq(lambda fall: over(0.0, fall), least, 1.5e5, xtol=1e-3)
    shut = brentq(greatest, least, 1.5e5, xtol=1e-2)
    falling, rising = (
        (lambda fall: 6.0 + fall / SLOPE),
        (lambda fall: 5.0 + 2.0 * TURN - 1.0 - fall / SLOPE),
    )
    return [falling(full), falling(max(shut, full)), rising(empty), rising(min(empty, full))]


@pytest.mark.in_turn
@pytest.mark.parametrize("law, near", [("linear", 1e-3), ("log", 3e-3), ("mixture", 3e-3)])
@pytest.mark.parametrize("flow_area", [1e-5, 2e-5, 4e-5])
def test_flow_that_comes_back_holds_it_open_until_it_falls_shut(flow_area, law, near):
    """A small valve follows the pressure both ways; a larger valve, which its reverse flow lifts, shuts suddenly."""
    result = fvsolve.run(backwards(flow_area, law))
    events = result.summary["events"]
    assert result.ok
    assert [e["what"] for e in events] == [
        "leaves full opening",
        "is shut",
        "opens",
        "is fully open",
    ]
    assert [e["time"] for e in events] == pytest.approx(seen(flow_area), abs=near)
    assert abs(result.ledger["mass"]["relative"]) < 1e-13


@pytest.mark.parametrize("scheme", ["upwind3", "linear-upwind", "muscl"])
def test_steps_of_a_lake_drive_it_both_ways_to_the_end(scheme):
    """Sudden changes of the head reverse the flow, and Newton's method converges throughout."""
    heads = {"time": [0.0, 0.3, 0.7], "value": [30.0, 12.0, 35.0], "kind": "step"}
    nodes = {"up": lake(heads), "down": lake(20.0), "a": junction(), "b": junction()}
    main = lambda start, end: pipe(start, end, 60.0, 0.1, 1000.0, 4, friction=ROUGH)  # noqa: E731
    links = {
        "to-a": main("up", "a"),
        "to-b": main("down", "b"),
        "relief": relief("a", "b", 6.1e-5, 1.5e5, 2e4),
    }
    numerics = {"method": "rk4", "scheme": scheme, "courant": 0.5}
    result = fvsolve.run(scene(nodes, links, 1.0, numerics, ["relief.opening"], 0.05))
    assert result.ok and len(result.summary["events"]) <= 8


def test_order_is_not_lost_at_a_located_switch():
    """With the kinks of the gate at steps, rk4 has order 4 through the event of the opening."""
    case = filled({"method": "rk4", "step": 0.1})
    fine = fvsolve.run(case, set={"numerics.step": 0.1 / 32})
    errors = [
        abs(
            fvsolve.run(case, set={"numerics.step": h})["pot.pressure"][-1]
            - fine["pot.pressure"][-1]
        )
        for h in (0.1, 0.05, 0.025)
    ]
    assert len(fine.summary["events"]) >= 2
    assert np.log2(errors[0] / errors[2]) / 2.0 == pytest.approx(4.0, abs=0.5)


@pytest.mark.parametrize("disc", [{}, *DISCS.values()], ids=["none", *DISCS])
def test_open_at_the_start_it_is_reported_and_nothing_moves(disc):
    case = main(SMOOTH, set_pressure=3e5, flow_area=2e-3, **disc)
    case["links"]["gate"]["opening"] = 1.0
    model = fvsolve.build(fvsolve.load(case))
    assert any(
        "the relief valve is open at the start" in warning.text for warning in model.warnings
    )
    rates = model.rhs(0.0, np.zeros(model.y_size))
    assert not rates.any()
    held = fvsolve.run(case)
    assert np.ptp(held["end.pressure"]) == 0.0 and held.summary["events"] == []


def pocket(back, law="linear", **disc):
    """Return a case of a chamber at 5 MPa behind a valve with set pressure 4.8 MPa, and a reservoir at `back`."""
    fluid = {"name": "user", "density": 900.0, "bulk_modulus": 1.5e9, "viscosity": 0.03, "law": law}
    nodes = {"c": chamber(1e-3, 5e6), "r": reservoir(back)}
    links = {"v": relief("c", "r", 1e-5, 4.8e6, 4e5, **disc)}
    return scene(
        nodes,
        links,
        2e-3,
        {"method": "dormand-prince", "rtol": 1e-9},
        ["c.pressure", "v.opening", "v.flow"],
        1e-4,
        fluid=fluid,
    )


@pytest.mark.parametrize("back", [8e6, 5.05e6, 5e6, 1e6])
@pytest.mark.parametrize("disc", [{}, *DISCS.values()], ids=["none", *DISCS])
def test_lifted_at_the_start_it_has_its_lift_whatever_the_pressure_behind_it(disc, back):
    """At the start the lift is (p - set) / span = 0.5 for a reversed flow too, and without flow; then against SciPy."""
    from scipy.integrate import solve_ivp

    def rates(t, y):
        lift = (y[0] - 4.8e6) / 4e5
        x = y[1] if disc else lift  # without disc dynamics the pressure is the only state
        q = (
            1e-5
            * min(max(x, 0.0), 1.0)
            * math.copysign(math.sqrt(2.0 * abs(y[0] - back) / 900.0), y[0] - back)
        )
        if not disc:
            return [-1.5e12 * q]
        if "time_constant" in disc:
            return [-1.5e12 * q, (lift - y[1]) / disc["time_constant"]]
        w = 2.0 * math.pi * disc["natural_frequency"]
        return [-1.5e12 * q, y[2], w * w * (lift - y[1]) - 2.0 * disc["damping_ratio"] * w * y[2]]

    result = fvsolve.run(pocket(back, **disc))
    start = [5e6, 0.5, 0.0][: 1 + len(disc)]
    exact = solve_ivp(
        rates, (0.0, 2e-3), start, t_eval=result.t, rtol=1e-9, atol=1e-9, max_step=1e-5
    )
    assert result.ok and result["v.opening"][0] == pytest.approx(0.5, abs=1e-12)
    assert result["c.pressure"] == pytest.approx(exact.y[0], abs=1e-6 * 5e6)
    lift = exact.y[1] if disc else (exact.y[0] - 4.8e6) / 4e5
    assert result["v.opening"] == pytest.approx(np.clip(lift, 0.0, 1.0), abs=1e-5)


def test_a_reversed_flow_through_a_lifted_valve_is_the_same_under_other_laws():
    peaks = [
        fvsolve.run(pocket(8e6, law, discharge_coefficient=0.61))["c.pressure"][-1]
        for law in ("linear", "log")
    ]
    assert peaks[0] == pytest.approx(6249029.0, rel=3e-6)  # closed form by separation of variables
    assert peaks[1] == pytest.approx(peaks[0], rel=3e-3)


def test_it_dissipates_and_the_ledger_closes():
    found = energy(filled(**DISCS["lag"]))
    assert found.relative < 1e-9
    assert found.dissipated["relief relief valve"][-1] > 0.0 and np.all(
        np.diff(found.dissipated["relief relief valve"]) > -1e-6
    )


@pytest.mark.parametrize(
    "more, text",
    [
        ({"overpressure": -1e5}, "expected a value above 0"),
        ({"time_constant": 0.0}, "expected a value above 0"),
        ({"set_pressure": "0 bar"}, "barg"),
        ({"time_constant": 1.0, "natural_frequency": 3.0, "damping_ratio": 0.1}, "keep one"),
        ({"natural_frequency": 3.0}, "damping_ratio"),
        ({"damping_ratio": 0.3}, "natural_frequency"),
    ],
)
def test_bad_discs_are_refused(more, text):
    case = main({})
    case["links"]["relief"].update(more)
    refused(case, text)
