"""Regulating valves: motion through both stops against SciPy, steady states of random networks, rigid columns."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from reference import lifted_valves
from reference.scenes import (
    AMBIENT,
    GRAVITY,
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

import fvsolve
from fvsolve.steady import union
from fvsolve.studies.energy.energy_balance import energy

BETA, TIME, BAND, SET = 2e7, 0.5, 1e5, 5e5
FRICTION = {"model": "steady", "factor": 0.02}


def regulating(kind, start, end, given, **more):
    what = "set_flow" if kind == "flow-control" else "set_pressure"
    return {"type": kind, "from": start, "to": end, what: given, "time_constant": TIME, **more}


def filled(rest, numerics):
    """Return a case of a chamber behind a pressure-reducing valve, whose outlet opens and then closes to `rest`."""
    nodes = {"lake": reservoir(1e6), "pot": chamber(2.0), "end": reservoir(1e5)}
    opening = {"time": [1.0, 2.0, 4.0, 5.0], "value": [0.6, 1.0, 1.0, rest]}
    links = {"prv": regulating("pressure-reducing", "lake", "pot", SET, area=6e-4, discharge_coefficient=1.0),
             "tap": valve("pot", "end", 8e-4, opening)}  # fmt: skip
    fluid = {**WATER, "bulk_modulus": BETA}
    return scene(nodes, links, 12.0, numerics, ["pot.pressure", "prv.opening", "prv.flow"], 0.05, fluid=fluid)


def through(area, drop):
    return area * math.copysign(math.sqrt(2.0 * abs(drop) / RHO), drop)


@pytest.mark.parametrize("method", ["dormand-prince", "rodas-5p"])
def test_it_follows_scipy_through_both_stops(method):
    tight = 1e-11 if method == "dormand-prince" else 1e-8
    result = fvsolve.run(filled(0.05, {"method": method, "rtol": tight}))

    def rates(t, y, held):
        opening = np.interp(t, [1.0, 2.0, 4.0, 5.0], [0.6, 1.0, 1.0, 0.05])
        inward = through(6e-4 * min(max(y[1], 0.0), 1.0), 1e6 - y[0])
        return [
            BETA / 2.0 * (inward - through(8e-4 * opening, y[0] - 1e5)),
            0.0 if held else (SET - y[0]) / BAND / TIME,
        ]

    start = [SET, through(8e-4 * 0.6, 4e5) / through(6e-4, 5e5)]
    exact, events = lifted_valves.stopped(rates, lambda t, y: SET - y[0], start, [1.0, 2.0, 4.0, 5.0], result.t)
    near = 1e-6 if method == "dormand-prince" else 1e-4
    assert [e["time"] for e in result.summary["events"]] == pytest.approx(events, abs=near)
    assert result["pot.pressure"] == pytest.approx(exact[0], abs=near * BAND)
    assert result["prv.opening"] == pytest.approx(exact[1], abs=near)
    shut = result["prv.opening"] == 0.0
    assert shut.any() and (result["prv.opening"] == 1.0).any() and not result["prv.flow"][shut].any()


def network(seed: int, count: int) -> dict:
    """Return a case of a random network of two lakes with `count` regulating valves of random kinds."""
    rng, n = np.random.default_rng(seed), 12
    demands = (0.0, 0.0, 0.005, 0.01)
    nodes = {f"n{i}": junction(float(rng.choice(demands)), elevation=float(rng.uniform(0, 20))) for i in range(n)}
    nodes |= {"high": lake(90.0), "mid": lake(60.0)}
    ends = [("high", "n0"), ("mid", f"n{n - 1}"), *((f"n{rng.integers(0, i)}", f"n{i}") for i in range(1, n))]
    ends += [tuple(f"n{i}" for i in rng.choice(n, 2, replace=False)) for _ in range(4)]
    links = {f"p{k}": pipe(i, j, float(rng.uniform(100, 500)), 0.2, 1000.0, 1, friction=FRICTION)
             for k, (i, j) in enumerate(ends)}  # fmt: skip
    for j, k in enumerate(rng.choice(len(ends) - 2, count, replace=False) + 2):
        way = links[f"p{k}"]
        kind = str(rng.choice(["pressure-reducing", "pressure-sustaining", "flow-control"], p=[0.6, 0.25, 0.15]))
        given = float(rng.uniform(0.002, 0.03)) if kind == "flow-control" else AMBIENT + float(rng.uniform(1e5, 6e5))
        nodes[f"v{j}-in"] = junction(elevation=nodes[way["from"]]["elevation"])
        size = {"diameter": 0.2, "loss_coefficient": 1.0}
        links[f"v{j}"] = regulating(kind, f"v{j}-in", way["to"], given, **size)
        way["to"] = f"v{j}-in"
    return scene(nodes, links, 1.0, SMOOTH)


def standing(case, model, name) -> str:
    """Mode of a valve in a solved network: active, open or shut; an empty text if its law does not hold."""
    link, row = case["links"][name], model.tables.valves[model.valve_names.index(name)]
    nodes = model.checks["nodes"]
    m, g = float(row["flow"]), float(row["conductance"])
    p_i, p_j = (nodes[link[end]]["pressure"] for end in ("from", "to"))
    drop = RHO * GRAVITY * (nodes[link["from"]]["head"] - nodes[link["to"]]["head"])
    full, within = abs(abs(m) * m - g * drop) < 1e-3 * g + 1e-6 * m * m, m * m <= g * drop + 1e-3 * g
    if link["type"] == "flow-control":
        given = RHO * link["set_flow"]
        return "active" if abs(m - given) < 1e-6 and within else "open" if full and m < given else ""
    reducing, given = link["type"] == "pressure-reducing", link["set_pressure"]
    beyond = (given - p_j) if reducing else (p_i - given)
    if abs(beyond) < 1.0 and m >= -1e-6 and within:
        return "active"
    if m > 1e-6:
        return "open" if full and beyond > -1.0 else ""
    return "shut" if m > -1e-6 and (beyond < 1.0 or drop < 1.0) else ""


def hangs_on_valves(case) -> float:
    """Demand at nodes that only regulating valves join to a lake [m3/s]."""
    names, links = list(case["nodes"]), case["links"].values()
    pairs = [(names.index(x["from"]), names.index(x["to"])) for x in links if x["type"] == "pipe"]
    label = union(len(names), pairs)
    fed = {label[names.index(name)] for name in ("high", "mid")}
    drawn = [(case["nodes"][name].get("demand", 0.0), at) for name, at in zip(names, label, strict=True)]
    return sum(demand for demand, at in drawn if at not in fed)


@pytest.mark.parametrize("count, refused", [(1, [27]), (3, []), (6, [38])])
def test_every_valve_of_a_random_net_obeys_its_law(count, refused):
    """The mode of every valve obeys its law, except in two networks, which are refused.

    The first demands 0.04 m3/s through a valve set to 0.0194 m3/s, the second through closed valves. Of all 3^6
    combinations of modes in the networks of seeds 17 and 30, one or two are steady states, and the solver finds them.
    """
    seen = set()
    for seed in range(40):
        case = network(seed, count)
        try:
            model = fvsolve.build(fvsolve.load(case))
        except fvsolve.CaseError as error:
            said = "the states of v0 keep changing" if count == 1 else "m3/s, but every path to it is shut"
            assert seed in refused and said in str(error) and hangs_on_valves(case) > 0.0
            continue
        assert seed not in refused
        found = [standing(case, model, f"v{j}") for j in range(count)]
        assert "" not in found, (seed, found)
        assert not model.rhs(0.0, np.zeros(model.y_size)).any(), seed
        seen |= set(found)
    assert seen >= {"active", "shut"}


def line(kind, given, **more):
    nodes = {"lake": lake(80.0), "a": junction(), "b": junction(), "end": lake(20.0)}
    links = {"p1": pipe("lake", "a", 100.0, 0.3, 1000.0, 10, friction=FRICTION),
             "v": regulating(kind, "a", "b", given, diameter=0.3, loss_coefficient=2.0, **more),
             "p2": pipe("b", "end", 100.0, 0.3, 1000.0, 10, friction=FRICTION)}  # fmt: skip
    return scene(nodes, links, 0.5, SMOOTH, ["v.flow", "v.opening"])


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize(
    "kind, given", [("pressure-reducing", 4e5), ("pressure-sustaining", 7e5), ("flow-control", 0.1)]
)
def test_at_the_start_nothing_moves_by_one_bit(kind, given, law):
    case = line(kind, given)
    case["fluid"] = {**WATER, "law": law}
    model = fvsolve.build(fvsolve.load(case))
    assert not model.rhs(0.0, np.zeros(model.y_size)).any()
    sensed = {"pressure-reducing": "b", "pressure-sustaining": "a"}.get(kind)
    if sensed:
        assert model.checks["nodes"][sensed]["pressure"] == pytest.approx(given, rel=1e-12)


def test_one_that_throttles_dissipates():
    found = energy(filled(0.05, {"method": "dormand-prince", "rtol": 1e-10}))
    assert found.relative < 1e-8 and np.all(np.diff(found.dissipated["prv pressure reducing"]) > -1e-6)


@pytest.mark.parametrize(
    "kind, given, more, text",
    [
        ("pressure-reducing", "9 barg", {}, "above every source: lake has 80 m"),
        ("pressure-sustaining", "9 barg", {}, "never open"),
        ("pressure-reducing", "3 barg", {"time_constant": 0.0}, "above 0"),
        ("pressure-reducing", "3 barg", {"band": -1.0}, "above 0"),
        ("flow-control", 0.0, {}, "above 0"),
    ],
)
def test_bad_set_points_are_refused(kind, given, more, text):
    with pytest.raises(fvsolve.CaseError, match=text):
        fvsolve.build(fvsolve.load(line(kind, given, **more)))


def test_a_set_pressure_is_an_input():
    model = fvsolve.build(fvsolve.load(line("pressure-reducing", 4e5)))
    after = fvsolve.advance(model, fvsolve.initial_state(model), 0.2, {"v.set_pressure": 4.5e5})
    assert after.y[model.state_names.index("v.opening")] > 0.0


COLUMN = {"type": "rigid-column", "length": 50.0, "diameter": 0.1,
          "friction": {"model": "quasi-steady", "factor": 0.02}}  # fmt: skip


def lag_of(kind, after):
    """Time constant [s]: large if the valve senses the pressure of a reservoir, which its flow does not change."""
    return 0.3 if after == (kind == "pressure-sustaining") else 30.0


def far_ends(kind, start, end):
    """Return (upstream, downstream) pressure of the reservoirs, one of them a ramp from `start` to `end` in 2 s."""
    moves = {"time": [2.0, 4.0], "value": [start, end]}
    return (8e5, moves) if kind == "pressure-reducing" else (moves, 1e5)


def held_column(kind, after, ends, law, numerics):
    """Return (case, name of the valve) of a valve set to 5 bar before a rigid column, or `after` it."""
    part = {"type": kind, "area": 0.01, "discharge_coefficient": 0.61, "set_pressure": 5e5}
    part["time_constant"] = lag_of(kind, after)
    first, second = (COLUMN, part) if after else (part, COLUMN)
    links = {"one": {**first, "from": "up", "to": "m"}, "two": {**second, "from": "m", "to": "down"}}
    nodes, name = {"up": reservoir(ends[0]), "m": junction(), "down": reservoir(ends[1])}, "two" if after else "one"
    probes = [f"{name}.opening", f"{name}.flow"]
    return scene(nodes, links, 6.0, numerics, probes, 0.1, fluid={**WATER, "law": law}), name


def equations(kind, after, ends):
    """Return (source, lifted, G, stroke, inertia, friction) for `reference.lifted_valves`."""
    bore = math.pi * 0.05**2
    up, down = (lambda t, p=p: np.interp(t, p["time"], p["value"]) if isinstance(p, dict) else p for p in ends)

    def lifted(t, drop):
        before, behind = (down(t) + drop, down(t)) if after else (up(t), up(t) - drop)
        return SET - behind if kind == "pressure-reducing" else before - SET

    return (lambda t: up(t) - down(t), lifted, 2.0 * RHO * 0.0061**2, 1e5 * lag_of(kind, after), 50.0 / bore,
            0.02 * 50.0 / (0.1 * 2.0 * RHO * bore**2))  # fmt: skip


def opening_ends(kind):
    return far_ends(kind, *((6e5, 3e5) if kind == "pressure-reducing" else (4e5, 7e5)))


@functools.cache
def leaving(kind, after, at):
    """Lift and mass flow at the times `at` while the valve opens, by SciPy."""
    return lifted_valves.stem_leaves_with_column(*equations(kind, after, opening_ends(kind)), 8.0 / 3.0, [4.0], at)


@functools.cache
def shutting(kind, after):
    """Time at which the valve shuts, by SciPy [s]."""
    return lifted_valves.shuts_with_column(*equations(kind, after, shutting_ends(kind)), 2.0)


def shutting_ends(kind):
    return far_ends(kind, *((6e5, 2e5) if kind == "pressure-sustaining" else (3e5, 7e5)))


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("numerics", [{"rtol": 1e-6}, {"method": "dormand-prince", "rtol": 1e-6},
                                      {"method": "rodas-5p", "rtol": 1e-9}, {"method": "radau-iia-5", "rtol": 1e-6},
                                      {"method": "rk4", "step": 1e-3}])  # fmt: skip
@pytest.mark.parametrize("kind", ["pressure-reducing", "pressure-sustaining"])
@pytest.mark.parametrize("after", [False, True])
def test_it_leaves_its_seat_with_the_column_that_it_holds_as_their_equations_say(kind, after, law, numerics):
    """Lift and flow start as the square of time, and the rate of their coupling is infinite at first."""
    case, name = held_column(kind, after, opening_ends(kind), law, numerics)
    result, at = fvsolve.run(case), (2.8, 3.0, 3.2, 4.0, 6.0)
    lift, flow = leaving(kind, after, at)
    (leaves,) = result.summary["events"]
    assert result.ok and (leaves["what"], leaves["time"]) == ("leaves its seat", pytest.approx(8.0 / 3.0, abs=1e-9))
    rows = [int(np.argmin(abs(result.t - t))) for t in at]
    near = (1e-4 if law == "linear" else 4e-4) * (2.0 if "step" in numerics else 1.0)
    assert result[f"{name}.opening"][rows] == pytest.approx(lift, rel=near)
    assert result[f"{name}.flow"][rows] * RHO == pytest.approx(flow, rel=near)


@pytest.mark.parametrize("numerics", [{"rtol": 1e-6}, {"method": "dormand-prince", "rtol": 1e-6},
                                      {"method": "rodas-5p", "rtol": 1e-9}, {"method": "radau-iia-5", "rtol": 1e-6},
                                      {"method": "rk4", "step": 1e-3}])  # fmt: skip
@pytest.mark.parametrize("kind", ["pressure-reducing", "pressure-sustaining"])
def test_it_comes_to_its_seat_with_the_column_that_it_holds(kind, numerics):
    """Lift and flow reach zero together, so no flow remains when the valve shuts."""
    after = kind == "pressure-sustaining"
    case, name = held_column(kind, after, shutting_ends(kind), "linear", numerics)
    result = fvsolve.run(case)
    (shuts,) = result.summary["events"]
    assert result.ok and shuts["what"] == "is shut" and result.summary["marks"] == []
    assert shuts["time"] == pytest.approx(shutting(kind, after), rel=1e-6)
    assert not result[f"{name}.flow"][result.t > shuts["time"]].any()
