"""Reactions of scalars: closed forms, SciPy, equilibrium, kept sums, places, the chemical port, faults."""

import copy

import numpy as np
import pytest
from pytest import approx
from reference.basins import alone
from reference.jacobians import random_state, stray
from reference.orders import observed_order
from reference.reacting_scalars import MOLES, moles
from reference.refusals import refused
from reference.resumed_runs import killed_and_resumed, same_files
from reference.scenes import AMBIENT, area, chamber, junction, pipe, reservoir, scene, tank, valve
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.case.changes import changes
from fvsolve.core.step_limits.step_notices import step_limits
from fvsolve.features.scalars.own_tables import scalar_tables

METHODS = ("dormand-prince", "radau-iia-5", "rodas-5p", "auto")
GAS = 8.31446261815324  # [J/mol/K]


def stirred(scalars, reactions, end=10.0, probes=(), every=None, other=None, **numerics) -> dict:
    """Case of two tanks of 3 m3 and 1.5 m3 at rest; other : values at the start in the second tank."""
    second = tank(1.0, 1.5, **({"scalars": other} if other else {}))
    probes = [*(f"one.{name}" for name in scalars), *(f"two.{name}" for name in scalars), *probes]
    numerics = {"method": "dormand-prince", "rtol": 1e-12, **numerics}
    links = {"gate": valve("one", "two", 1e-3, opening=0.0)}
    nodes = {"one": tank(2.0, 1.5), "two": second}
    return scene(
        nodes, links, end, numerics, probes, every or end / 10, scalars=scalars, reactions=reactions
    )


@pytest.mark.parametrize("method", METHODS)
def test_two_equal_amounts_react_as_their_closed_form(method):
    """A + B -> P has c0 / (1 + k c0 t); 2 A -> P consumes twice its rate, c0 / (1 + 2 k c0 t)."""
    k, c = 0.3, 2.0
    reactions = {
        "pair": {"equation": "A + B -> P", "forward": k},
        "twin": {"equation": "2 C -> Q", "forward": k},
    }
    scalars = moles(A=c, B=c, C=c, P=0.0, Q=0.0)
    result = fvsolve.run(
        stirred(scalars, reactions, other={"A": 1.0, "B": 1.0, "C": 3.0}, method=method)
    )
    t = result.t
    for place, a, twin in (("one", c, c), ("two", 1.0, 3.0)):
        assert result[f"{place}.A"] == approx(a / (1.0 + k * a * t), rel=1e-9)
        assert result[f"{place}.C"] == approx(twin / (1.0 + 2.0 * k * twin * t), rel=1e-9)
        assert result[f"{place}.A"] == approx(result[f"{place}.B"], rel=1e-14)
        assert result[f"{place}.A"] + result[f"{place}.P"] == approx(a, rel=4e-16)
        assert result[f"{place}.C"] + 2.0 * result[f"{place}.Q"] == approx(twin, rel=4e-16)


@pytest.mark.parametrize("method", METHODS)
def test_unequal_amounts_and_a_reversible_reaction(method):
    """A + B -> P: A / B = (a / b) exp((a - b) k t). C -> D and back relaxes to D / C = forward / reverse."""
    k, a, b, ahead, back = 0.2, 3.0, 1.0, 0.9, 0.3
    reactions = {
        "pair": {"equation": "A + B -> P", "forward": k},
        "swap": {"equation": "C -> D", "forward": ahead, "reverse": back},
    }
    port = [f"reactions.swap.{key}" for key in ("rate", "affinity", "power", "affinity@one")]
    case = stirred(
        moles(A=a, B=b, P=0.0, C=1.0, D=0.5), reactions, 40.0, port, every=0.5, method=method
    )
    result = fvsolve.run(case)
    t, d = result.t, result["one.D"]
    early = t < 8.0
    ratio = result["one.A"] / result["one.B"]
    assert ratio[early] == approx((a / b * np.exp((a - b) * k * t))[early], rel=1e-8)
    assert result["one.A"] - result["one.B"] == approx(a - b, rel=1e-14)
    balanced = 1.5 * ahead / (ahead + back)
    assert d == approx(balanced + (0.5 - balanced) * np.exp(-(ahead + back) * t), rel=1e-9)
    assert (d / result["one.C"])[-1] == approx(ahead / back, rel=1e-9)
    rate, affinity, power, local = (result[probe] for probe in port)
    volume, thermal = 4.5, GAS * fvsolve.load(case).properties.temperature
    assert rate == approx(volume * (ahead * (1.5 - d) - back * d), abs=1e-11)
    assert affinity == approx(thermal * np.log(ahead * (1.5 - d) / (back * d)), abs=1e-6)
    assert abs(affinity[-1]) < 1e-6 and power.min() >= 0.0
    assert power == approx(rate * affinity, rel=1e-12, abs=1e-12) and local == approx(
        affinity, abs=1e-9
    )


@pytest.mark.parametrize("method", METHODS[1:])
def test_robertsons_kinetics_are_those_of_scipy(method):
    """Three reactions with rates from 0.04 to 3e7: a stiff problem; amounts are kept to rounding."""
    reactions = {
        "slow": {"equation": "A -> B", "forward": 0.04},
        "fast": {"equation": "2 B -> B + C", "forward": 3e7},
        "medium": {"equation": "B + C -> A + C", "forward": 1e4},
    }

    def rates(t, y):
        a, b, c = y
        one, two, three = 0.04 * a, 3e7 * b * b, 1e4 * b * c
        return [three - one, one - two - three, two]

    def slopes(t, y):
        _, b, c = y
        return [
            [-0.04, 1e4 * c, 1e4 * b],
            [0.04, -6e7 * b - 1e4 * c, -1e4 * b],
            [0.0, 6e7 * b, 0.0],
        ]

    result = fvsolve.run(
        stirred(moles(A=1.0, B=0.0, C=0.0), reactions, 40.0, method=method, rtol=1e-12)
    )
    exact = solve_ivp(
        rates, (0.0, 40.0), [1.0, 0.0, 0.0], "Radau", result.t, rtol=1e-11, atol=1e-15, jac=slopes
    ).y
    for name, values in zip("ABC", exact, strict=True):
        assert result[f"one.{name}"] == approx(values, rel=1e-8, abs=1e-13)
    assert sum(result[f"one.{name}"] for name in "ABC") == approx(1.0, rel=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_sums_conserved_by_equations_are_conserved_in_any_units(method):
    """Atoms of two coupled reactions in mg/l, mmol/l and mol/m3, with decay of none, stay to rounding."""
    scalars = {
        "N": {
            "unit": "mg/l",
            "molar_mass": "14.007 g/mol",
            "initial": 28.0,
            "composition": {"N": 1},
        },
        "H": {"unit": "mmol/l", "initial": 7.0, "composition": {"H": 1}},
        "NH3": {"unit": "mg/l", "molar_mass": 0.017031, "composition": {"N": 1, "H": 3}},
        "N2H6": {**MOLES, "composition": {"N": 2, "H": 6}},
    }
    reactions = {
        "make": {"equation": "N + 3 H -> NH3", "forward": 0.02, "reverse": 0.01},
        "pair": {"equation": "2 NH3 -> N2H6", "rate": "0.4*NH3^2/(1 + NH3)"},
    }
    result = fvsolve.run(stirred(scalars, reactions, method=method, rtol=1e-10))
    n, h, nh3, pair = (result[f"one.{name}"] for name in scalars)
    nh3 = nh3 / 17.031
    assert n / 14.007 + nh3 + 2.0 * pair == approx(28.0 / 14.007, rel=1e-14)
    assert h + 3.0 * nh3 + 6.0 * pair == approx(7.0, rel=1e-14)
    for name in scalars:
        assert result.ledger[name]["relative"] < 1e-14 and result.ledger[name]["reacted"] != 0.0


def test_units_and_constants_with_units_change_nothing():
    def run(scalars, forward, divisor=1.0):
        reactions = {"r": {"equation": "A + 2 B -> P", **forward}}
        return fvsolve.run(stirred(scalars, reactions))["one.A"] / divisor

    plain = run(moles(A=2.0, B=3.0, P=0.0), {"forward": 0.01})
    grams = {
        name: {"unit": "mg/l", "molar_mass": f"{mass} g/mol", "initial": mass * start}
        for name, mass, start in (("A", 35.0, 2.0), ("B", 10.0, 3.0), ("P", 55.0, 0.0))
    }
    assert run(grams, {"forward": "0.6 m6/mol2/min"}, 35.0) == approx(plain, rel=1e-11)
    assert run({**grams, "P": MOLES}, {"forward": "1e4 l2/mol2/s"}, 35.0) == approx(
        plain, rel=1e-11
    )
    assert run(grams, {"rate": "0.01*A*B^2"}, 35.0) == approx(plain, rel=1e-11)
    assert run(moles(P=0.0, B=3.0, A=2.0), {"forward": 0.01}) == approx(plain, rel=1e-11)


def line(scalars, reactions, end, cells=20, speed=0.5, numerics=None, probes=()) -> dict:
    """Case of a steady flow through 10 m of pipe, from a reservoir to a demand."""
    bore = 0.1
    nodes = {"lake": reservoir(AMBIENT, scalars={"A": 2.0}), "tap": junction(speed * area(bore))}
    links = {"a": pipe("lake", "tap", 10.0, bore, 20.0, cells)}
    numerics = {
        "scheme": "muscl",
        "limiter": "van-leer",
        "method": "ssp-rk2",
        "courant": 0.9,
        **(numerics or {}),
    }
    return scene(
        nodes, links, end, numerics, probes, end / 20, scalars=scalars, reactions=reactions
    )


def test_a_reaction_of_first_order_in_a_pipe_is_the_decay():
    def run(scalar, reactions):
        return fvsolve.run(
            line({"A": {**MOLES, **scalar}}, reactions, 40.0, probes=["tap.A", "a.A@0.5"])
        )

    decay = run({"decay": 0.1}, {})
    own = run({}, {"fade": {"equation": "A ->", "forward": 0.1}})
    shared = run({"decay": 0.04}, {"fade": {"equation": "A ->", "rate": "0.06*A"}})
    for probe in ("tap.A", "a.A@0.5"):
        assert decay[probe].max() > 0.1
        assert own[probe] == approx(decay[probe], rel=1e-12, abs=1e-15)
        assert shared[probe] == approx(decay[probe], rel=1e-12, abs=1e-15)
    assert -own.ledger["A"]["reacted"] == approx(decay.ledger["A"]["decayed"], rel=1e-12)
    assert own.ledger["A"]["relative"] < 1e-12 and shared.ledger["A"]["relative"] < 1e-12


@pytest.mark.parametrize("scheme, order", [("upwind", 1.0), ("muscl", 2.0)])
def test_a_steady_pipe_of_second_order(scheme, order):
    """2 A -> P along a pipe: c0 / (1 + 2 k c0 x / u) at the centres of cells."""
    k, c, u, errors, many = 0.05, 2.0, 0.5, [], (20, 40, 80)
    for cells in many:
        case = line(
            moles(A=0.0, P=0.0),
            {"r": {"equation": "2 A -> P", "forward": k}},
            60.0,
            cells,
            u,
            {"scheme": scheme},
        )
        model = fvsolve.build(fvsolve.load(case))
        state = fvsolve.advance(model, fvsolve.initial_state(model), 60.0)
        found = model.fields(state.y, model.evaluate(state.t, state.y)[1])["a"]
        x = (np.arange(cells) + 0.5) * 10.0 / cells
        errors.append(np.abs(found["A"] - c / (1.0 + 2.0 * k * c * x / u)).mean())
        assert found["A"] + 2.0 * found["P"] == approx(c, rel=1e-6)
    assert -observed_order(errors, many) == approx(order, abs=0.25)


def test_a_chamber_and_pipes_react_under_implicit_methods_too():
    lake = reservoir(2e5, scalars={"A": 2.0, "B": 1.0})
    nodes, friction = (
        {"lake": lake, "box": chamber(0.05), "sea": reservoir(AMBIENT)},
        {"model": "steady", "factor": 0.02},
    )
    links = {
        "a": pipe("lake", "box", 5.0, 0.1, 50.0, 5, friction=friction),
        "b": valve("box", "sea", 2e-4),
    }
    reactions = {"r": {"equation": "A + B -> P", "forward": 2.0, "reverse": 0.1}}
    ends = []
    for numerics in (
        {"method": "ssp-rk3", "courant": 0.5},
        {"method": "radau-iia-5", "rtol": 1e-9},
        {"method": "rodas-5p", "rtol": 1e-8},
        {"method": "auto", "rtol": 1e-8},
    ):
        case = scene(
            nodes,
            links,
            2.0,
            {"scheme": "upwind", **numerics},
            ["box.A", "box.P", "reactions.r.power"],
            scalars=moles(A=0.5, B=0.5, P=0.0),
            reactions=reactions,
        )
        result = fvsolve.run(case)
        assert all(result.ledger[name]["relative"] < 1e-12 for name in "ABP")
        assert result["reactions.r.power"].min() >= 0.0
        ends.append([result["box.A"][-1], result["box.P"][-1], result["reactions.r.power"][-1]])
    assert ends[1:] == [approx(ends[0], rel=2e-5)] * 3
    model, rng = fvsolve.build(fvsolve.load(case)), np.random.default_rng(1)
    assert max(stray(model, t, random_state(model, rng)) for t in (0.0, 0.1)) < 1e-9


def test_an_explicit_step_is_short_enough_for_the_reaction():
    """Under a Courant number of waves of 4 steps per second, a rate of 400 1/s needs more steps, and is stable."""
    case = line(
        moles(A=2.0, P=0.0),
        {"r": {"equation": "A -> P", "forward": 400.0}},
        1.0,
        probes=["a.A@0.5"],
    )
    result = fvsolve.run(case)
    assert result["a.A@0.5"][-1] == approx(0.0, abs=1e-6) and result.summary["steps"] >= 200


def test_cells_of_a_basin_react():
    k = 0.3
    pool = {
        "level": 1.0,
        "size": ["4 m", "4 m"],
        "cells": [4, 4],
        "bed": "0.1*x",
        "scalars": {"A": "1 + 0.2*x"},
    }
    case = alone(
        {"type": "basin", "physics": "free-surface", **pool}, 5.0, method="ssp-rk3", courant=0.2
    )
    case["output"]["probes"] = ["pool.A@0.5,0.5", "reactions.r.rate"]
    case |= {
        "scalars": moles(A=0.0, P=0.0),
        "reactions": {"r": {"equation": "2 A -> P", "forward": k}},
    }
    result = fvsolve.run(case)
    start = 1.0 + 0.2 * 0.5
    assert result["pool.A@0.5,0.5"] == approx(start / (1.0 + 2.0 * k * start * result.t), rel=1e-5)
    assert result.ledger["A"]["relative"] < 1e-13
    assert result.ledger["A"]["reacted"] == approx(-2.0 * result.ledger["P"]["reacted"], rel=1e-14)


def test_a_given_velocity_carries_reacting_scalars_and_no_coupling_is_missing():
    patches = {"inlet": {"side": "west", "scalars": {"A": 2.0}}, "outlet": {"side": "east"}}
    sheet = {
        "type": "basin",
        "physics": "transport",
        "size": ["1 m", "1 m"],
        "cells": [6, 4],
        "velocity": {"u": "0.5"},
        "scalars": {"A": "1 + x"},
        "patches": patches,
    }
    reactions = {
        "r": {"equation": "2 A -> B", "forward": 0.3, "reverse": 0.2},
        "q": {"equation": "B ->", "rate": "1e-3*T*B"},
    }
    scalars = {**moles(A=0.0, B=0.0), "T": {"unit": "degC", "initial": 20.0}}
    probes = ["reactions.r.power", "reactions.r.affinity", "reactions.r.affinity@sheet@0.5,0.5"]
    case = scene(
        {"sheet": sheet},
        {},
        2.0,
        {"scheme": "upwind", "method": "rodas-5p", "rtol": 1e-6},
        probes,
        0.2,
        scalars=scalars,
        reactions=reactions,
    )
    del case["links"]
    result = fvsolve.run(case)
    assert all(result.ledger[name]["relative"] < 1e-13 for name in scalars)
    assert result["reactions.r.power"].min() >= 0.0
    assert (
        0.0 < result["reactions.r.affinity@sheet@0.5,0.5"][-1] < result["reactions.r.affinity"][-1]
    )
    model, rng = fvsolve.build(fvsolve.load(case)), np.random.default_rng(1)
    assert max(stray(model, t, random_state(model, rng)) for t in (0.0, 0.1)) < 1e-9


def test_two_reactions_of_parts_of_a_constant_are_a_single_reaction():
    def run(scalars, **constants):
        reactions = {
            name: {"equation": "A + B -> P", "forward": k} for name, k in constants.items()
        }
        return fvsolve.run(stirred(scalars, reactions))["one.A"]

    whole = run(moles(A=2.0, B=3.0, P=0.0), r=0.3)
    assert run(moles(P=0.0, B=3.0, A=2.0), p=0.1, q=0.2) == approx(whole, rel=1e-11)


def test_a_catalyst_counts_in_the_rate_and_stays():
    """A + E -> P + E: A falls as exp(-k e t), and E does not change by a bit."""
    case = stirred(
        moles(A=2.0, E=0.5, P=0.0), {"r": {"equation": "A + E -> P + E", "forward": 0.4}}
    )
    result = fvsolve.run(case)
    assert result["one.A"] == approx(2.0 * np.exp(-0.2 * result.t), rel=1e-9)
    assert np.all(result["one.E"] == 0.5)


@pytest.mark.parametrize("method", METHODS[:3])
def test_a_control_reads_the_rate_of_a_reaction(method):
    """Dosing by the filtered rate: amount and level of a tank compared with SciPy."""
    reactions = {"r": {"equation": "A ->", "forward": 0.2}}
    dose = {
        "type": "function",
        "inputs": {"r": "reactions.r.rate"},
        "formula": "1e-2*r",
        "unit": "m3/s",
        "filter": 0.5,
    }
    nodes = {
        "feed": {"type": "inflow", "flow": {"control": "dose"}, "scalars": {"A": 5.0}},
        "pond": tank(1.0, 1.0, scalars={"A": 1.0}),
    }
    case = scene(
        nodes,
        {"v": valve("feed", "pond", 1e-2)},
        5.0,
        {"method": method, "rtol": 1e-11},
        ["pond.A"],
        0.5,
        scalars=moles(A=0.0),
        reactions=reactions,
        controls={"dose": dose},
    )
    result = fvsolve.run(case)

    def rates(t, y):
        level, amount, seen = y
        flow = 1e-2 * seen
        return [flow, 5.0 * flow - 0.2 * amount, (0.2 * amount - seen) / 0.5]

    exact = solve_ivp(
        rates, (0.0, 5.0), [1.0, 1.0, 0.2], "DOP853", result.t, rtol=1e-12, atol=1e-14
    ).y
    assert result["pond.A"] == approx(exact[1] / exact[0], rel=1e-8)


def test_a_killed_and_resumed_run_is_the_unbroken_run(tmp_path):
    reactions = {"r": {"equation": "A + B -> P", "forward": 0.3, "reverse": 0.1}}
    case = stirred(
        moles(A=2.0, B=1.0, P=0.0),
        reactions,
        probes=["reactions.r.power"],
        method="rodas-5p",
        step=1e-3,
    )
    del case["numerics"]["rtol"]
    fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 4.0))


def test_the_written_case_and_changed_keys_read_back(tmp_path):
    reactions = {
        "r": {"equation": "A + 2 B -> P", "forward": "0.5 m6/mol2/min"},
        "s": {"equation": "P ->", "rate": "0.1*P"},
    }
    case = fvsolve.load(stirred(moles(A=2.0, B=1.0, P=0.0), reactions))
    assert case.reactions["r"].forward == approx(0.5 / 60.0, rel=1e-15)
    (tmp_path / "again.toml").write_text(case.resolved())
    assert fvsolve.load(tmp_path / "again.toml") == case
    changed = fvsolve.load(case, {"reactions.r.forward": 0.2})
    assert changed.reactions["r"].forward == 0.2 and changed.reactions["s"] == case.reactions["s"]
    model = fvsolve.build(case)
    varied = fvsolve.vary(model, {"reactions.r.forward": 0.2})
    assert scalar_tables(varied).reactions["forward"][0] == 0.2
    assert [changes(case, f"reactions.r.{key}") for key in ("forward", "equation")] == [
        "value",
        "shape",
    ]
    law = {"equation": "A + 2 B -> P", "law": "0.00833333 A B^2"}
    assert model.checks["reactions"]["r"] == {**law, "rate": approx(4.5 / 60.0)}


R = ("reactions", "r")
FAULTS = [
    ((*R, "equation"), "A + B = P", 'expected one ->, for example "Cl + 2 B -> P"; a reversible reaction has'),
    ((*R, "equation"), "A + 0 B -> P", '"0 B" is not a coefficient above 0 and the name of a scalar'),
    ((*R, "equation"), "A + Bb -> P", 'unknown scalar "Bb"'),
    ((*R, "equation"), " -> ", "has no scalars"),
    ((*R, "rate"), "0.1*A*B", "rate and forward are given; keep one"),
    ((*R,), {"equation": "A -> P", "rate": "A", "reverse": 1.0}, "rate and reverse are given; keep one"),
    ((*R,), {"equation": "A -> P"}, "expected one of rate, forward"),
    ((*R,), {"equation": "A -> P", "reverse": 1.0}, "has no effect without `forward`"),
    ((*R,), {"equation": "A -> P", "rate": "A*x"}, "x is unknown"),
    ((*R,), {"equation": "A -> P", "rate": "A*t"}, "t is unknown"),
    ((*R,), {"equation": "A -> P", "rate": "max(A, 1)"}, "has kinks"),
    ((*R, "forward"), -1.0, "out of range"),
    ((*R, "forward"), "0.3 1/s", 'expected a constant of order 2 in m3/mol/s'),
    ((*R, "forwards"), 1.0, "did you mean"),
    # none of the unit, of unknown order
    ((*R,), {"equation": "A + B = P", "forward": "0.3 m3/mol/s"}, "1 fault"),
    ((*R,), {"equation": "0.5 A -> P", "forward": "1"}, '"1" is text, and the order is 0.5; expected a number'),
    ((*R,), {"equation": "0.5 A -> P", "forward": "1 1/s"}, '"1 1/s" has a unit, and the order is 0.5'),
    ((*R,), {"equation": "A -> P", "rate": "A*x"}, "known are A, B, P, arctan2, cos, exp, hypot, log, pi, sin, "),
    (("scalars", "A", "initial"), -1.0, "scalars.A.initial: -1 is negative, and reaction r follows mass action"),
    (("nodes", "one", "scalars"), {"A": -2.0}, "nodes.one.scalars.A: -2 is negative"),
    (("scalars", "A", "unit"), "degC", '"degC" is not an amount, which reaction r needs; expected unit'),
    (("scalars", "A", "unit"), "mg/l", "molar_mass is missing"),
    (("scalars", "A", "composition"), {"Cl": 2}, "Cl does not balance: 2 on the left, 1 on the right"),
    (("scalars", "A", "composition"), {"Cl": 0}, "out of range"),
    (("scalars", "A", "molar_mass"), "3 kg", "a molar mass"),
    (("nodes", "reactions"), tank(1.0, 1.0), '"reactions" is the name of the reactions'),
    (("output", "probes"), ["reactions.r.affinity"], "its affinity is infinite without a rate in both directions"),
    (("output", "probes"), ["reactions.r.flow"], 'has no "flow"'),
    (("output", "probes"), ["reactions.q.rate"], "reactions.r"),
    (("output", "probes"), ["reactions.r.rate@one"], "is the sum over all places; leave @one out"),
]  # fmt: skip


@pytest.mark.parametrize(
    "keys, value, said", FAULTS, ids=[f"{k[-1]}-{i}" for i, (k, *_) in enumerate(FAULTS)]
)
def test_impossible_reactions_are_refused(keys, value, said):
    scalars = {
        "A": {**MOLES, "composition": {"Cl": 1}},
        "B": {**MOLES, "composition": {"Na": 1}},
        "P": {**MOLES, "composition": {"Na": 1, "Cl": 1}},
    }
    case = stirred(scalars, {"r": {"equation": "A + B -> P", "forward": 1.0}})
    fvsolve.load(case)
    table = case = copy.deepcopy(case)
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    assert said in str(refused(case))


def test_a_molar_mass_without_unit_is_noticed():
    """A bare number is in kg/mol; 70.9 is legal but not plausible."""
    scalars = {"A": {"unit": "mg/l", "molar_mass": 70.9}, "P": MOLES}
    notices = [
        item.text
        for item in fvsolve.load(
            stirred(scalars, {"r": {"equation": "A -> P", "forward": 1}})
        ).notices
    ]
    assert (
        len(notices) == 1
        and "hydrogen to large organic molecules" in notices[0]
        and "70.9 g/mol" in notices[0]
    )


def test_a_rate_that_divides_by_nothing_at_the_start_is_refused_with_its_place():
    case = stirred(
        moles(A=1.0, B=0.0), {"r": {"equation": "A -> B", "rate": "A/B"}}, other={"B": 1.0}
    )
    with pytest.raises(
        fvsolve.CaseError, match="A/B is not finite at the start in one, where A = 1, B = 0"
    ):
        fvsolve.build(fvsolve.load(case))


def test_a_step_too_long_for_a_reaction_is_reported():
    case = stirred(
        moles(A=1.0, B=0.0), {"r": {"equation": "A -> B", "forward": 50.0}}, method="rk4", step=0.5
    )
    del case["numerics"]["rtol"]
    notices = [notice.plain() for notice in step_limits(fvsolve.build(fvsolve.load(case)))]
    assert any("one.r" in notice["text"] for notice in notices), notices
