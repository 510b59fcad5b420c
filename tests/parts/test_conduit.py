"""Conduits: rest, bores, free and surcharged flow, filling and draining, in other words and by other methods."""

from math import pi

import numpy as np
import pytest
from pytest import approx
from reference import conduits as exact_section
from reference.basins import assert_equal_files, run_in_two_parts
from reference.conduits import DamBreak, backwater, bore, uniform_depth
from reference.jacobians import stray
from reference.scenes import WATER
from scipy.integrate import quad
from scipy.optimize import brentq

import fvsolve
from fvsolve.core.kernels.dtypes import OK, STATUS
from fvsolve.parts.conduit.law_section import (
    depth_of,
    riemann_function,
    section_at_depth,
    section_of,
)
from fvsolve.studies.accuracy.order import order
from fvsolve.studies.energy_balance import energy

TANK = {"type": "tank", "elevation": 0.0}


def sewer(nodes, links, probes, end, rows=20, **numerics):
    numerics = {"end": end, "scheme": "muscl", "limiter": "van-leer", **numerics}
    output = {"every": end / rows, "probes": probes}
    return {
        "fluid": dict(WATER),
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": output,
    }


def pipe(start="a", stop="b", **keys):
    return {
        "type": "conduit",
        "from": start,
        "to": stop,
        "manning": 0.013,
        "diameter": 0.5,
        "length": 20.0,
        "inverts": [0.0, 0.0],
        "cells": 20,
        **keys,
    }


def two_tanks(low, high=1.0, **keys):
    keys = {"inverts": [0.2, 0.1], "initial_flow": 0.0, **keys}
    nodes = {"a": {**TANK, "area": 2.0, "level": high}, "b": {**TANK, "area": 1.0, "level": low}}
    probes = [
        "a.level",
        "b.level",
        "s.flow",
        "s.flow@1",
        "s.depth@0.3",
        "s.head@0.9",
        "s.filling@0.5",
    ]
    return sewer(nodes, {"s": pipe(**keys)}, probes, 20.0)


METHODS = [
    {"method": "ssp-rk2"},
    {"method": "rk4"},
    {"method": "radau-iia-3", "courant": 0.9},
    {"method": "rodas-5p"},
]


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
@pytest.mark.parametrize("numerics", METHODS, ids=lambda keys: keys["method"])
@pytest.mark.parametrize("level", [0.05, 0.45, 0.9, 3.0])
def test_water_at_rest_does_not_change_any_bit(level, numerics, scheme):
    """On a slope through the crown, with a dry end, and full."""
    case = two_tanks(level, level, inverts=[0.8, 0.0])
    case["numerics"] |= {"end": 5.0, "scheme": scheme, **numerics}
    run = fvsolve.run(case)
    assert all(np.ptp(run[probe.text]) == 0.0 for probe in run.case.probes)
    assert not run["s.flow"].any() and not run["s.flow@1"].any()


def test_the_section_is_a_circle():
    """Area, width, thrust and phi by closed forms and quadrature, and the depth of an area, below the slot."""
    section = section_of(9.80665, 0.5, 28.0)
    for h in 0.5 * np.array([1e-3, 0.02, 0.3, 0.4999999, 0.5, 0.51, 0.8, 0.97]):
        area, width, thrust = section_at_depth(section, float(h))
        assert area == approx(exact_section.area(h, 0.5), rel=1e-9) and depth_of(
            section, area
        ) == approx(h, rel=1e-13)
        assert width == approx(exact_section.width(h, 0.5), rel=1e-12)
        assert thrust * 9.80665 == approx(exact_section.thrust(h, 0.5), rel=1e-9, abs=1e-13)
        assert riemann_function(section, float(h)) == approx(
            exact_section.riemann(h, 0.5), rel=1e-9
        )


def shut_gate(cells, celerity=20.0, **numerics):
    """Flow of 5 l/s, 0.08 m deep, whose end is shut at once; probes of depths along the pipe."""
    head, speed = bore(0.08, 0.005, 0.1, celerity)
    nodes = {"a": {"type": "inflow", "flow": 0.005}, "b": {"type": "junction"}}
    link = pipe(
        diameter=0.1,
        length=10.0,
        manning=0.0,
        cells=cells,
        surcharge_celerity=celerity,
        initial_depth=0.08,
        initial_flow=0.005,
    )
    x = (np.arange(cells) + 0.5) / cells
    probes = [f"s.depth@{at:.12g}" for at in x]
    run = fvsolve.run(
        sewer(nodes, {"s": link}, probes, 6.0 / speed, **{"method": "ssp-rk2", **numerics})
    )
    return run, head, speed, np.array([run[text] for text in probes])


def test_a_bore_runs_back_from_a_shut_gate():
    """Head behind it to 0.2 %, speed to 0.5 % by Rankine and Hugoniot, with a slot from the crown; volume 1e-12."""
    run, head, speed, depth = shut_gate(200)
    assert head == approx(0.40404, abs=1e-5) and speed == approx(4.24888, abs=1e-5)
    assert depth[120:, -1].mean() == approx(head, rel=2e-3)
    ways = ((depth - 0.08) / (head - 0.08)).sum(axis=0) * 10.0 / len(depth)
    assert (ways[-1] - ways[5]) / (run.t[-1] - run.t[5]) == approx(speed, rel=5e-3)
    assert run.ledger["mass"]["relative"] < 1e-12


@pytest.mark.parametrize("numerics", METHODS[2:], ids=lambda keys: keys["method"])
def test_implicit_methods_give_the_same_bore(numerics):
    run, head, _, depth = shut_gate(50, **numerics)
    assert depth[35:, -1].mean() == approx(head, rel=5e-3)
    assert run.ledger["mass"]["relative"] < 1e-12


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("numerics", [METHODS[0], METHODS[3]], ids=lambda keys: keys["method"])
def test_steady_surcharged_flow_follows_manning(turned, numerics):
    """A fall of the head of 10.29 n^2 Q^2 L / D^(16/3); a slot changes it by (V / a)^2."""
    nodes = {"a": {"type": "reservoir", "head": 2.0}, "b": {"type": "reservoir", "head": 1.2}}
    ends = ("b", "a") if turned else ("a", "b")
    case = sewer(
        nodes,
        {"s": pipe(*ends, length=100.0)},
        ["s.flow", "s.head@0.25", "s.head@0.75"],
        400.0,
        **numerics,
    )
    run = fvsolve.run(case)
    flow = abs(run["s.flow"][-1])
    fall = abs(run["s.head@0.25"][-1] - run["s.head@0.75"][-1])
    assert run["s.flow"][-1] * (-1.0 if turned else 1.0) > 0.0
    exact = 0.013**2 * flow**2 * 50.0 / ((pi * 0.5**2 / 4.0) ** 2 * (0.5 / 4.0) ** (4.0 / 3.0))
    assert exact == approx(10.29 * 0.013**2 * flow**2 * 50.0 / 0.5 ** (16.0 / 3.0), rel=1e-3)
    assert fall == approx(exact, rel=1e-2)
    # the water in the slot has no friction, but velocity
    celerity = (0.25 * pi * 9.80665 * 0.5 / 0.01) ** 0.5
    assert fall * (1.0 - (flow / (pi * 0.5**2 / 4.0) / celerity) ** 2) == approx(exact, rel=1e-3)


def test_uniform_flow_has_the_depth_of_manning():
    depth = uniform_depth(0.1, 0.013, 0.005, 0.5)
    nodes = {"a": {"type": "inflow", "flow": 0.1}, "b": {"type": "reservoir", "head": depth}}
    link = pipe(length=200.0, inverts=[1.0, 0.0], cells=50, initial_depth=depth, initial_flow=0.1)
    run = fvsolve.run(sewer(nodes, {"s": link}, ["s.depth@0.2", "s.depth@0.5"], 600.0))
    assert run["s.depth@0.5"][-1] == approx(depth, rel=2e-3) and run["s.depth@0.2"][-1] == approx(
        depth, rel=2e-3
    )


@pytest.mark.parametrize("turned", [False, True])
# without a cap
@pytest.mark.parametrize("numerics", [METHODS[0], *METHODS[2:]], ids=lambda keys: keys["method"])
def test_minor_losses_are_those_of_the_energy_balance(turned, numerics):
    """K v^2 / 2g over the length: of the full pipe with and without Manning's friction, and in a free backwater."""
    ends, inverts = (("b", "a"), [0.0, 0.1]) if turned else (("a", "b"), [0.1, 0.0])
    keys = {"inverts": inverts, "length": 100.0, "minor_loss": 5.0}
    nodes = {"a": {"type": "inflow", "flow": 0.3}, "b": {"type": "reservoir", "head": 1.5}}
    for n in (0.0, 0.013):
        link = pipe(*ends, **{**keys, "inverts": [0.0, 0.0]}, manning=n)
        run = fvsolve.run(
            sewer(nodes, {"s": link}, ["s.head@0.25", "s.head@0.75"], 20.0, **numerics)
        )
        area = pi * 0.5**2 / 4.0
        exact = 2.5 * (0.3 / area) ** 2 / (2.0 * 9.80665) + n**2 * (
            0.3 / area
        ) ** 2 * 50.0 / 0.125 ** (4.0 / 3.0)
        fall = (run["s.head@0.25"] - run["s.head@0.75"]) * (-1.0 if turned else 1.0)
        # of the slot, as above
        share = 1.0 - 0.01 * (0.3 / area) ** 2 / (0.25 * pi * 9.80665 * 0.5)
        assert fall * share == approx(exact, rel=1e-3)
    nodes = {"a": {"type": "inflow", "flow": 0.05}, "b": {"type": "reservoir", "head": 0.4}}
    x = [0.1, 0.5, 0.9]
    case = sewer(
        nodes, {"s": pipe(*ends, **keys, cells=50)}, [f"s.depth@{at}" for at in x], 50.0, **numerics
    )
    run = fvsolve.run(case)
    exact = backwater(0.05, 0.013, 0.001, 0.5, 0.4, 100.0 * np.array(x), loss=0.05)
    found = np.array([run[f"s.depth@{at}"] for at in (x if turned else x[::-1])])
    assert found == approx(np.broadcast_to(exact[:, None], found.shape), abs=2e-5)


def backwater_error(cells: int, **numerics) -> float:
    """Greatest error of the depth over the depth at the end, M1 backwater in a mild sewer."""
    flow, slope, length, d = 0.05, 0.001, 200.0, 0.5
    nodes = {"a": {"type": "inflow", "flow": flow}, "b": {"type": "reservoir", "head": 0.4}}
    link = pipe(
        length=length,
        diameter=d,
        inverts=[length * slope, 0.0],
        cells=cells,
        initial_depth=0.35,
        initial_flow=flow,
    )
    x = (np.arange(cells) + 0.5)[1:-1] / cells
    probes = [f"s.depth@{at:.12g}" for at in x]
    run = fvsolve.run(sewer(nodes, {"s": link}, probes, 3000.0, **numerics))
    exact = backwater(flow, 0.013, slope, d, 0.4, length * (1.0 - x[::-1]))
    found = np.array([run[text][-1] for text in probes])
    return float(abs(found - np.interp(x, x, exact[np.argsort(np.argsort(1.0 - x))])).max() / 0.4)


def test_backwater_is_gradually_varied_flow():
    errors = [backwater_error(cells) for cells in (25, 50)]
    assert errors[1] < 5e-5
    assert np.log2(errors[0] / errors[1]) > 1.8


STARTS = {  # head or inflow above, head below, fall, other keys, greatest change of a depth
    "mild": ({"flow": 0.05}, 0.3, 0.1, {}, 2e-4),
    "overfall": ({"flow": 0.05}, -1.0, 0.1, {}, 2e-3),
    "steep": ({"flow": 0.05}, -1.0, 4.0, {}, 2e-3),
    "jump": ({"flow": 0.05}, 0.45, 1.0, {}, 1e-2),
    "full": ({"flow": 0.3}, 1.0, 0.1, {}, 1e-5),
    "between reservoirs": ({"head": 2.0}, 1.0, 0.1, {}, 1e-5),
    "free between reservoirs": ({"head": 0.4}, 0.25, 0.1, {}, 5e-4),
    "critical": ({"head": 4.3}, 0.25, 4.0, {}, 5e-3),
}


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", STARTS)
def test_a_run_starts_in_gradually_varied_flow(name, turned):
    """The flow is that of the inflow, or follows from both heads; no depth changes much, nor does the flow."""
    above, head, fall, keys, change = STARTS[name]
    kind = "inflow" if "flow" in above else "reservoir"
    nodes = {"a": {"type": kind, **above}, "b": {"type": "reservoir", "head": head}}
    ends, inverts = (("b", "a"), [0.0, fall]) if turned else (("a", "b"), [fall, 0.0])
    link = pipe(*ends, length=100.0, inverts=inverts, cells=50, **keys)
    if kind == "inflow":
        nodes["a"]["elevation"] = 0.0
    x = [0.1, 0.3, 0.5, 0.7, 0.9]
    run = fvsolve.run(
        sewer(nodes, {"s": link}, ["s.flow", "s.flow@0.5", *(f"s.depth@{at}" for at in x)], 200.0)
    )
    depths = np.array([run[f"s.depth@{at}"] for at in x])
    assert abs(run["s.flow"]).min() > 0.04 and np.ptp(run["s.flow@0.5"]) < 2.0 * change
    assert np.ptp(depths, axis=1).max() < change
    if name == "mild":
        exact = backwater(0.05, 0.013, 0.001, 0.5, 0.3, 100.0 * np.array(x))
        assert depths[:, 0] == approx(exact if turned else exact[::-1], abs=1e-5)


def chain(cells: int, up: dict, down: dict, turned: bool, branches: tuple = ()) -> dict:
    """Case of three conduits with a slope of 0.001 between two nodes; branches : nodes at the end of further ones."""
    ends = {"a": up, "b": down} | {f"n{i}": node for i, node in enumerate(branches)}
    nodes = {name: {"elevation": 0.0, **node} for name, node in ends.items()}
    nodes |= {name: {"type": "junction", "elevation": 0.0} for name in "mk"}
    keys = {"length": 40.0, "cells": cells}
    links = {
        f"s{i}": pipe(*"amkb"[i : i + 2], inverts=[0.12 - 0.04 * i, 0.08 - 0.04 * i], **keys)
        for i in range(3)
    }
    for i in range(len(branches)):
        links[f"r{i}"] = pipe("m", f"n{i}", inverts=[0.08, 0.1], **keys)
    if turned:
        links["s1"] |= {"from": "k", "to": "m", "inverts": [0.04, 0.08]}
    probes = [f"{name}.depth@{x}" for name in links for x in (0.1, 0.5, 0.9)] + [
        f"{name}.flow@0.5" for name in links
    ]
    return sewer(nodes, links, probes, 100.0)


LAKE = {"type": "reservoir", "head": 0.4}
# nodes at both ends, nodes of branches, flows of the three conduits if they follow from the inflows
CHAINS = {
    "mild": ({"type": "inflow", "flow": 0.05}, LAKE, (), [0.05, 0.05, 0.05]),
    "full": ({"type": "inflow", "flow": 0.3}, {**LAKE, "head": 1.5}, (), [0.3, 0.3, 0.3]),
    "between reservoirs": ({"type": "reservoir", "head": 0.5}, LAKE, (), None),
    "full, back": ({"type": "reservoir", "head": 1.0}, {**LAKE, "head": 2.0}, (), None),
    "two inflows": (
        {"type": "inflow", "flow": 0.05},
        LAKE,
        ({"type": "inflow", "flow": 0.03},),
        [0.05, 0.08, 0.08],
    ),
    "a demand": (
        {"type": "reservoir", "head": 1.5},
        {"type": "inflow", "flow": -0.04},
        ({"type": "junction", "demand": 0.02}, {"type": "junction"}),
        [0.06, 0.04, 0.04],
    ),
    "inflow between reservoirs": (
        {"type": "reservoir", "head": 0.5},
        LAKE,
        ({"type": "inflow", "flow": 0.03},),
        None,
    ),
}


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", CHAINS)
def test_a_chain_starts_in_steady_flow(name, turned):
    """Depths and flows stay to the error of the scheme, at order 1.8 above rounding; flows are sums of inflows."""
    up, down, branches, flows = CHAINS[name]
    changes = []
    for cells in (10, 20):
        run = fvsolve.run(chain(cells, up, down, turned, branches))
        changes.append(max(np.ptp(run[probe.text]) for probe in run.case.probes))
        start = np.array([run[f"s{i}.flow@0.5"][0] for i in range(3)]) * (
            [1.0, -1.0, 1.0] if turned else 1.0
        )
        assert start == approx(
            flows or start[:1] + [0.0, *2 * [sum(n.get("flow", 0.0) for n in branches)]], rel=1e-9
        )
    assert changes[0] < 1e-4 and (changes[1] < 1e-7 or np.log2(changes[0] / changes[1]) > 1.8)


@pytest.mark.parametrize("numerics", METHODS, ids=lambda keys: keys["method"])
def test_a_chain_starts_in_a_continuous_backwater(numerics):
    """Depths of all three conduits are those of gradually varied flow in one pipe, for each method."""
    up, down, branches, _ = CHAINS["mild"]
    case = chain(20, up, down, False, branches)
    case["numerics"] |= {"end": 20.0, **numerics}
    run = fvsolve.run(case)
    x = np.array([40.0 * i + 40.0 * at for i in range(3) for at in (0.1, 0.5, 0.9)])
    exact = backwater(0.05, 0.013, 0.001, 0.5, 0.4, 120.0 - x[::-1])[::-1]
    found = np.array([run[f"s{i}.depth@{at}"] for i in range(3) for at in (0.1, 0.5, 0.9)])
    assert found[:, 0] == approx(exact, abs=1e-5) and found[:, -1] == approx(exact, abs=1e-5)


def test_water_in_a_dead_end_of_a_chain_is_level():
    """A conduit without flow that rises above the head of its junction has a level surface and a dry end."""
    up, down, _, _ = CHAINS["mild"]
    case = chain(40, up, down, False, ({"type": "junction"},))
    case["links"]["r0"] |= {"inverts": [0.08, 0.6]}
    run = fvsolve.run(case)
    depths = [probe.text for probe in run.case.probes if "depth" in probe.text]
    assert max(np.ptp(run[text]) for text in depths) < 1e-3
    assert run["r0.depth@0.9"].max() == 0.0 and run["r0.depth@0.1"][0] > 0.2


def dam_break_error(cells: int, right: float) -> float:
    """Mean error of the depth after a dam break over the difference of depths, 1 m wide pipe."""
    exact, time = DamBreak(0.7, right, 1.0), 2.0
    nodes = {"a": {"type": "junction"}, "m": {"type": "junction"}, "b": {"type": "junction"}}
    own = {"diameter": 1.0, "length": 10.0, "manning": 0.0, "cells": cells}
    links = {
        "p": pipe("a", "m", **own, initial_depth=0.7),
        "q": pipe("m", "b", **own, initial_depth=right),
    }
    x = (np.arange(cells) + 0.5) / cells
    probes = [f"{name}.depth@{at:.12g}" for name in "pq" for at in x]
    run = fvsolve.run(sewer(nodes, links, probes, time, method="ssp-rk2"))
    found = np.array([run[text][-1] for text in probes])
    true = [exact.depth(at / time) for at in np.concatenate([10.0 * x - 10.0, 10.0 * x])]
    assert run.ledger["mass"]["relative"] < 1e-12
    return float(abs(found - true).mean() / (0.7 - right))


def test_a_dam_break_is_exact_to_first_order():
    errors = [dam_break_error(cells, 0.2) for cells in (50, 100)]
    assert errors[1] < 6e-3 and np.log2(errors[0] / errors[1]) > 0.75


def test_it_fills_from_dry_and_drains():
    """No depth below zero, the volume of both tanks and the pipe constant to 1e-12, at rest at the end."""
    case = two_tanks(0.0, 1.2, manning=0.05)
    case["numerics"]["end"] = 900.0
    case["output"]["probes"] += ["s.depth@0", "s.depth@1"]
    run = fvsolve.run(case)
    assert run.ledger["mass"]["relative"] < 1e-12 and run.ok
    assert min(run[f"s.depth@{at}"].min() for at in ("0", "0.3", "1")) >= 0.0
    assert run["s.depth@0.3"].max() > 0.5
    assert run["a.level"][-1] == approx(run["b.level"][-1], abs=2e-3)


@pytest.mark.parametrize(
    "numerics", [*METHODS, {"method": "dormand-prince"}], ids=lambda keys: keys["method"]
)
@pytest.mark.parametrize("other", [0.0, 1.0])
def test_a_dry_conduit_fills_from_heads_above_its_crown(other, numerics):
    """From one end and from both: inflow of Torricelli at the start, volume to 1e-12, one result for all methods."""
    case = two_tanks(other, 1.0, initial_depth=0.0)
    case["numerics"] |= {"end": 3.0, **numerics}
    run = fvsolve.run(case)
    assert run.ok and run.ledger["mass"]["relative"] < 1e-12
    # of the slot
    assert run["s.flow"][0] == approx(0.25 * pi * 0.5**2 * (2.0 * 9.80665 * 0.8) ** 0.5, rel=0.01)
    assert run["a.level"][-1] == approx(0.4307, abs=2e-3) and run["b.level"][-1] == approx(
        0.2445 * other, abs=2e-3
    )
    assert max(run["a.level"].max(), run["b.level"].max()) <= 1.0 and np.all(
        np.diff(run["a.level"]) < 0.0
    )


def junction_of_conduits(rng) -> dict:
    """Junction between one to four conduits of random diameters, inverts and directions."""
    nodes, links = (
        {"m": {"type": "junction", "elevation": 0.0, "demand": -rng.choice([0.0, 0.05])}},
        {},
    )
    for i in range(rng.integers(1, 5)):
        nodes[f"t{i}"] = {**TANK, "area": 100.0, "level": 0.0}
        ends, inverts = ("m", f"t{i}"), [rng.choice([0.0, rng.uniform(0.0, 1.0)]), 0.0]
        turn = int(rng.choice([1, -1]))
        keys = {"diameter": float(rng.choice([0.2, 0.5, 1.0, 1.5])), "length": 10.0, "cells": 3}
        links[f"s{i}"] = pipe(*ends[::turn], inverts=[float(z) for z in inverts[::turn]], **keys)
    return sewer(nodes, links, ["t0.level"], 1.0, initial="rest")


@pytest.mark.parametrize("seed", range(6))
def test_the_flows_of_any_junction_balance(seed):
    """Dry, free and full cells beside each other, flows up to 8 m/s in both directions: Newton converges."""
    rng = np.random.default_rng(seed)
    for _ in range(10):
        model = fvsolve.build(fvsolve.load(junction_of_conduits(rng)))
        demand = float(model.case.nodes["m"].demand.value[0])
        for _ in range(100):
            y = model.start.copy()
            for basin in model.meshed:
                at, n, full = int(basin.row["y"]), basin.n, basin.section.area
                kind = rng.choice(4, size=n, p=[0.1, 0.5, 0.2, 0.2])
                area = full * np.choose(
                    kind,
                    [
                        np.zeros(n),
                        *(
                            rng.uniform(low, high, n)
                            for low, high in ((0.0, 1.0), (0.97, 1.003), (1.0, 1.03))
                        ),
                    ],
                )
                y[at : at + n], y[at + n : at + 2 * n] = (
                    area - basin.area,
                    area * rng.uniform(-8.0, 8.0, n),
                )
            out = model.evaluate(0.0, y)[1]
            flows = (
                out[model.layout["valve"] : model.layout["valve"] + len(model.valve_names)] / 1000.0
            )
            own = [
                k
                for k, name in enumerate(model.valve_names)
                if model.case.conduits[name].from_ == "m"
            ]
            assert out[STATUS] == OK
            assert flows[own].sum() == approx(-demand, abs=1e-9 * max(abs(flows).max(), 1.0))


def test_it_drains_over_a_free_overfall():
    """Into a low reservoir: what leaves is booked, the water in the pipe falls to a film, never below zero."""
    nodes = {"a": {"type": "junction"}, "b": {"type": "reservoir", "head": -1.0}}
    case = sewer(
        nodes,
        {"s": pipe(inverts=[0.4, 0.2], initial_depth=0.7)},
        ["s.depth@0.1", "s.flow@1"],
        300.0,
    )
    run = fvsolve.run(case)
    assert 0.0 <= run["s.depth@0.1"][-1] < 0.01 and run["s.flow@1"].min() >= 0.0
    assert run.ledger["mass"]["relative"] < 1e-12 and run.ledger["mass"]["outflow"] > 3.5e3


@pytest.mark.parametrize("method", ["ssp-rk2", "tr-bdf2", "rodas-4"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_demand_above_critical_outflow_is_named_with_the_available_flow(method, turned):
    """Half full at rest: critical outflow has phi(h) + c(h) = phi(D / 2), phi by quadrature of sqrt(g T / A)."""
    d, g = 0.4, 9.80665
    wave = lambda h: np.sqrt(g * exact_section.width(h, d) / exact_section.area(h, d))  # noqa: E731
    celerity = lambda h: g / wave(h)  # noqa: E731
    depth = brentq(lambda h: quad(wave, h, d / 2)[0] - celerity(h), 1e-3, d / 2)
    outflow = exact_section.area(depth, d) * celerity(depth)
    ends = {"from": "j", "to": "a"} if turned else {"from": "a", "to": "j"}
    link = {
        "type": "conduit",
        **ends,
        "length": 50.0,
        "diameter": d,
        "manning": 0.0,
        "inverts": [1.0, 1.0],
        "cells": 20,
    }
    nodes = {
        "a": {"type": "reservoir", "head": 1.2},
        "j": {"type": "junction", "demand": "300 l/s"},
    }
    result = fvsolve.run(sewer(nodes, {"p": link}, ["p.flow"], 5.0, initial="rest", method=method))
    assert not result.ok and "the demand of 0.3 m3/s at j cannot be met at t = 0 s" in result.reason
    assert f"at most {outflow:.4g} m3/s leave the conduits there" in result.reason


def test_drawn_the_other_way_it_is_the_same():
    one, other = two_tanks(0.3), two_tanks(0.3, inverts=[0.1, 0.2])
    other["links"]["s"] |= {"from": "b", "to": "a"}
    one, other = fvsolve.run(one), fvsolve.run(other)
    assert other["a.level"] == approx(one["a.level"], abs=1e-11)
    assert other["s.flow@1"] == approx(-one["s.flow"], abs=1e-10)


def series_error(cells: int) -> float:
    """Greatest difference of a level [m] between a pipe and the pipe cut in the middle by a junction."""
    one, two = two_tanks(0.3, cells=cells), two_tanks(0.3)
    two["nodes"]["m"] = {"type": "junction", "elevation": 0.15}
    half = {"length": 10.0, "cells": cells // 2, "initial_flow": 0.0}
    two["links"] = {
        "s": pipe("a", "m", inverts=[0.2, 0.15], **half),
        "r": pipe("m", "b", inverts=[0.15, 0.1], **half),
    }
    two["output"]["probes"] = ["a.level", "b.level", "s.flow", "r.flow@1"]
    one, two = fvsolve.run(one), fvsolve.run(two)
    return max(abs(two[level] - one[level]).max() for level in ("a.level", "b.level"))


def test_two_in_series_equal_a_single_conduit():
    errors = [series_error(cells) for cells in (20, 80)]
    assert errors[0] < 4e-3 and errors[1] < 1e-3


def test_in_other_units_it_is_the_same():
    one, other = two_tanks(0.3), two_tanks(0.3)
    other["links"]["s"] |= {
        "diameter": "500 mm",
        "length": "2000 cm",
        "inverts": ["20 cm", "100 mm"],
    }
    one, other = fvsolve.run(one), fvsolve.run(other)
    assert other["a.level"] == approx(one["a.level"], abs=1e-11)


def test_methods_agree():
    case = two_tanks(0.3)
    runs = []
    for numerics in METHODS:
        case["numerics"] = {"end": 20.0, "scheme": "muscl", **numerics}
        runs.append(fvsolve.run(case))
    for run in runs:
        assert run["a.level"] == approx(runs[0]["a.level"], abs=2e-3)
        assert run.ledger["mass"]["relative"] < 1e-12


def pond(level: float) -> dict:
    """Basin whose water runs through a conduit from its patch into a tank."""
    pool = {
        "type": "basin",
        "size": [6.0, 4.0],
        "cells": [12, 4],
        "level": 1.0,
        "elevation": 0.0,
        "patches": {"out": {"side": "east", "span": [1.0, 3.0]}},
    }
    nodes = {"pool": pool, "b": {**TANK, "area": 4.0, "level": level}}
    links = {"s": pipe("pool.out", "b", inverts=[0.2, 0.1])}
    return sewer(
        nodes, links, ["b.level", "s.flow", "pool.depth@3,2", "pool.out.flow", "s.depth@0.5"], 30.0
    )


def test_a_basin_runs_through_a_conduit_into_a_tank():
    """At rest with equal levels; otherwise the volume is constant to 1e-12, by each method, and levels meet."""
    rest = fvsolve.run(pond(1.0))
    assert all(np.ptp(rest[probe.text]) == 0.0 for probe in rest.case.probes)
    runs = [
        fvsolve.run({**(case := pond(0.3)), "numerics": case["numerics"] | keys})
        for keys in (METHODS[0], METHODS[3])
    ]
    for run in runs:
        assert run.ledger["mass"]["relative"] < 1e-12 and run["b.level"][-1] > 0.5
        assert run["s.flow"] == approx(-run["pool.out.flow"], abs=1e-9)
    assert runs[1]["b.level"] == approx(runs[0]["b.level"], abs=5e-3)


def test_a_resumed_run_is_the_whole_run(tmp_path):
    case = two_tanks(0.0, 1.2, cells=200)
    case["output"]["every"] = 0.05
    run_in_two_parts(case, tmp_path, 8.0)
    assert_equal_files(tmp_path, ["history.csv"])


def test_rates_depend_on_the_states_of_the_pattern_only():
    """Between tanks, and through a junction, free and full."""
    case = two_tanks(0.3)
    case["nodes"]["m"] = {"type": "junction", "elevation": 0.0}
    case["links"] = {"s": pipe("a", "m", inverts=[0.2, 0.0], cells=7), "r": pipe("m", "b", cells=6)}
    case["output"]["probes"] = ["a.level"]
    model = fvsolve.build(fvsolve.load(case))
    assert stray(model, 0.0, model.start) < 1e-9


def test_energy_is_refused_by_name():
    with pytest.raises(
        fvsolve.FvsolveError, match=r"the energy of conduits \(s\) is not supported"
    ):
        energy(two_tanks(0.3))


FAULTS = {
    "diameter": (-1.0, "-1"),
    "inverts": ([30.0, 0.0], "expected a slope below 1"),
    "manning": (-0.01, "manning"),
    "cells": (0, "cells"),
    "surcharge_celerity": (2.0, "expected at least 6.21 m/s"),
    "initial_depth": (-0.1, "initial_depth"),
}


@pytest.mark.parametrize("key", FAULTS)
def test_bad_keys_are_named(key):
    value, text = FAULTS[key]
    with pytest.raises(fvsolve.CaseError, match="links.s") as error:
        fvsolve.load(two_tanks(0.3, **{key: value}))
    assert text in str(error.value)


def test_an_invert_below_the_bottom_of_a_tank_is_named():
    with pytest.raises(
        fvsolve.CaseError, match=r"links.s.inverts\[?.?0\]?: -0.1 m is below the bottom of a at 0 m"
    ):
        fvsolve.load(two_tanks(0.3, inverts=[-0.1, 0.0]))


def filling(**numerics) -> dict:
    """Case of a dry conduit between a reservoir whose head rises above its invert and a low reservoir."""
    nodes = {
        "a": {"type": "reservoir", "head": {"time": [0.0, 10.0], "value": [-0.4, 3.0]}},
        "b": {"type": "reservoir", "head": -1.0},
    }
    numerics = {"courant": 0.5, "method": "ssp-rk3", **numerics}
    return sewer(
        nodes, {"s": pipe(inverts=[0.1, 0.0])}, ["s.flow", "s.flow@1"], 10.0, 40, **numerics
    )


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
@pytest.mark.parametrize("method", ["euler", "ssp-rk2", "ssp-rk3"])
def test_a_dry_conduit_below_a_rising_head_takes_no_step_over_the_rise(method, scheme):
    """Without a wave that limits it, the first step was the whole run, and `ok` was true."""
    fine = fvsolve.run(filling(scheme=scheme, courant=0.1))
    last = slice(10, None)
    scale = np.ptp(fine["s.flow"])
    for courant in (0.9, 0.4):
        run = fvsolve.run(filling(scheme=scheme, method=method, courant=courant))
        assert run.ok and abs(run.ledger["mass"]["relative"]) < 1e-12
        for probe in ("s.flow", "s.flow@1"):
            assert run[probe].min() > -1e-4 * scale and run.extremes[probe].maximum < 1.1 * scale
            assert np.abs(run[probe] - fine[probe])[last].mean() < 0.03 * scale


def test_check_foresees_the_steps_of_full_conduits():
    """Within 15 % (their speed is |u| + a) for a sewer that a flood fills; none for a conduit full at the start."""
    flood = {"time": [0.0, 1.0], "value": [0.02, 0.35]}
    nodes = {
        "a": {"type": "inflow", "flow": flood, "elevation": 0.0},
        "b": {"type": "reservoir", "head": 0.3},
    }
    case = sewer(nodes, {"s": pipe(inverts=[0.02, 0.0], manning=0.02)}, ["s.depth@0.5"], 60.0)
    facts, run = fvsolve.build(fvsolve.load(case)).checks, fvsolve.run(case)
    assert facts["steps"] < 0.5 * run.summary["steps"]
    assert facts["steps_if_full"] == approx(run.summary["steps"], rel=0.15)
    assert fvsolve.build(fvsolve.load(two_tanks(2.0, 2.0))).checks["steps_if_full"] is None


def test_check_states_how_fast_tanks_move_at_the_start():
    case = two_tanks(0.3)
    del case["links"]["s"]["initial_flow"]
    model = fvsolve.build(fvsolve.load(case))
    rates = dict(
        zip(
            ("a", "b"), model.rhs(0.0, model.start)[:2] / 1000.0 / np.array([2.0, 1.0]), strict=True
        )
    )
    falls, rises = model.checks["moving"]
    assert "tank a falls" in falls and float(falls.split()[-2]) == approx(
        -1e3 * rates["a"], rel=0.02
    )
    assert "tank b rises" in rises and float(rises.split()[-2]) == approx(
        1e3 * rates["b"], rel=0.02
    )


def test_a_study_of_order_refines_a_conduit():
    case = two_tanks(0.9, cells=8)
    case["numerics"]["end"] = 1.0
    assert len(order(case, levels=3).rows) == 3


def test_the_cap_of_friction_gives_a_notice():
    """With rk4 a film at the decay rate r is too fast by sqrt(1 + r / 20) - 1; methods without cap give none."""
    nodes = {
        "a": {"type": "inflow", "flow": 2e-4, "elevation": 0.0},
        "b": {"type": "reservoir", "head": -1.0},
    }
    texts = []
    for method in ("rk4", "ssp-rk2"):
        case = sewer(
            nodes, {"s": pipe(inverts=[4.0, 0.0], length=100.0, cells=50)}, ["s.depth@0.5"], 20.0
        )
        case["numerics"]["method"] = method
        texts.append([notice for notice in fvsolve.run(case).warnings if notice.kind == "friction"])
    depth = uniform_depth(2e-4, 0.013, 0.04, 0.5)
    decay = 9.80665 * 0.04 * exact_section.area(depth, 0.5) / 2e-4  # of uniform flow
    ((notice,), none) = texts
    assert notice.place == "links.s" and not none
    assert notice.value == approx((1.0 + decay / 20.0) ** 0.5 - 1.0, rel=0.03)


def with_dye(case: dict, **start) -> dict:
    """The case with the scalar `dye` in all tanks and conduits; start : values by name of the part, else 0."""
    for group in ("nodes", "links"):
        for name, part in case[group].items():
            if part["type"] in ("tank", "conduit", "inflow", "reservoir"):
                part["scalars"] = {"dye": start.get(name, 0.0)}
    case["scalars"] = {"dye": {}}
    return case


def pulse_error(cells: int) -> float:
    """Mean error of a pulse of dye in uniform flow after 50 s, over its height."""
    depth, times = uniform_depth(0.1, 0.013, 0.005, 0.5), np.linspace(0.0, 30.0, 301)
    speed = 0.1 / exact_section.area(depth, 0.5)
    height = np.exp(-(((times - 15.0) / 4.0) ** 2))
    inflow = {"type": "inflow", "flow": 0.1}
    nodes = {"a": inflow, "b": {"type": "reservoir", "head": depth}}
    link = pipe(
        length=100.0, inverts=[0.5, 0.0], cells=cells, initial_depth=depth, initial_flow=0.1
    )
    x = (np.arange(cells) + 0.5) / cells
    case = with_dye(sewer(nodes, {"s": link}, [f"s.dye@{at:.12g}" for at in x], 50.0))
    inflow["scalars"] = {"dye": {"time": times.tolist(), "value": height.tolist()}}
    run = fvsolve.run(case)
    found = np.array([run[probe.text][-1] for probe in run.case.probes])
    assert run.ledger["dye"]["relative"] < 1e-12 and found.min() > -1e-14
    return float(abs(found - np.interp(50.0 - 100.0 * x / speed, times, height)).mean())


def test_a_pulse_of_dye_moves_with_the_water():
    errors = [pulse_error(cells) for cells in (100, 200)]
    assert errors[1] < 5e-3 and np.log2(errors[0] / errors[1]) > 1.7


@pytest.mark.parametrize(
    "numerics", [{"method": "ssp-rk3"}, *METHODS[2:]], ids=lambda keys: keys["method"]
)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_dye_stays_between_its_bounds_while_conduits_fill_and_drain(scheme, numerics):
    """Through a manhole, a junction and a dry conduit: ledger to 1e-12, each method."""
    nodes = {
        "a": {**TANK, "area": 2.0, "level": 1.2},
        "h": {**TANK, "area": 0.5, "level": 0.1},
        "m": {"type": "junction"},
        "b": {**TANK, "area": 1.0, "level": 0.0},
    }
    links = {
        "p": pipe("a", "h", inverts=[0.2, 0.1]),
        "q": pipe("m", "h", inverts=[0.05, 0.1]),
        "r": pipe("m", "b", inverts=[0.05, 0.0]),
    }
    for link in links.values():
        link |= {"length": 10.0, "cells": 10}
    probes = [f"{name}.dye@{at}" for name in "pqr" for at in (0.05, 0.5, 0.95)] + [
        "h.dye",
        "b.dye",
        "b.level",
    ]
    case = with_dye(sewer(nodes, links, probes, 30.0, scheme=scheme, **numerics), a=1.0)
    for node in nodes.values():
        node.setdefault("elevation", 0.0)
    run = fvsolve.run(case)
    values = np.array([run[probe.text] for probe in run.case.probes[:-1]])
    assert run.ledger["dye"]["relative"] < 1e-12 and run.ledger["mass"]["relative"] < 1e-12
    # of the tolerance; a notice says so
    rounding = 1e-5 if numerics["method"] == "rodas-5p" else 1e-13
    assert values.min() > -rounding and values.max() < 1.0 + rounding
    assert run["p.dye@0.05"][-1] > 0.9 and run["b.level"][-1] > 0.3


def test_uniform_dye_remains_uniform():
    """In waves, free and full, to rounding; at rest no amount moves by one bit."""
    case = with_dye(two_tanks(0.3, 1.0), a=0.7, b=0.7, s=0.7)
    case["output"]["probes"] = ["a.dye", "b.dye", *(f"s.dye@{at}" for at in (0.0, 0.3, 0.7, 1.0))]
    case["numerics"]["method"] = "ssp-rk3"
    run = fvsolve.run(case)
    assert all(run[probe.text] == approx(0.7, rel=1e-13) for probe in run.case.probes)
    case = with_dye(two_tanks(0.6, 0.6), a=0.7, b=0.2, s=0.4)
    case["output"]["probes"] = ["a.dye", "b.dye", "s.dye@0.3", "s.flow"]
    rest = fvsolve.run(case)
    assert all(np.ptp(rest[probe.text]) == 0.0 for probe in rest.case.probes)


def test_dye_in_a_conduit_drawn_the_other_way_and_resumed_is_the_same(tmp_path):
    cases = [
        with_dye(two_tanks(0.3), a=1.0, b=0.0, s=0.25),
        with_dye(two_tanks(0.3), a=1.0, b=0.0, s=0.25),
    ]
    cases[1]["links"]["s"] |= {"from": "b", "to": "a", "inverts": [0.1, 0.2]}
    for case, at in zip(cases, (0.25, 0.75), strict=True):
        case["output"]["probes"] = ["a.dye", "b.dye", f"s.dye@{at}"]
    one, other = (fvsolve.run(case) for case in cases)
    for mine, its in zip(one.case.probes, other.case.probes, strict=True):
        assert other[its.text] == approx(one[mine.text], abs=1e-10)
    cases[0]["links"]["s"]["cells"], cases[0]["output"]["every"] = 200, 0.05
    run_in_two_parts(cases[0], tmp_path, 8.0)
    assert_equal_files(tmp_path, ["history.csv"])


def test_dye_runs_from_a_basin_through_a_conduit_into_a_tank():
    case = pond(0.3)
    case["nodes"]["pool"]["scalars"] = {"dye": 1.0}
    case["nodes"]["b"]["scalars"] = case["links"]["s"]["scalars"] = {"dye": 0.0}
    case["scalars"], case["output"]["probes"] = {"dye": {}}, ["b.dye", "s.dye@0.1"]
    run = fvsolve.run(case)
    assert run.ledger["dye"]["relative"] < 1e-12
    # then the flow turns
    assert run["s.dye@0.1"].max() == approx(1.0, abs=1e-3) and run["b.dye"].max() < 0.2


def test_rates_of_dye_depend_on_the_states_of_the_pattern_only():
    case = with_dye(two_tanks(0.3), a=1.0, s=0.5)
    case["nodes"]["m"] = {"type": "junction", "elevation": 0.0}
    ends = {"s": ("a", "m", [0.2, 0.0]), "r": ("m", "b", [0.0, 0.0])}
    case["links"] = {
        name: pipe(*pair, inverts=z, cells=6, scalars={"dye": 0.5})
        for name, (*pair, z) in ends.items()
    }
    case["output"]["probes"] = ["a.level"]
    model = fvsolve.build(fvsolve.load(case))
    assert stray(model, 0.0, model.start) < 1e-9


def test_an_unusual_manning_gives_a_notice():
    case = fvsolve.load(two_tanks(0.3, manning=0.5))
    assert any("manning" in str(notice.text) or notice.key == "manning" for notice in case.notices)


def test_probes_of_a_conduit_by_distance_are_those_by_its_fraction_of_the_length():
    """They read the first cell, and any distance was accepted."""
    from fvsolve.case import load
    from fvsolve.errors import FvsolveError

    def case(*probes):
        tanks = {
            "a": {"type": "tank", "area": 1.0, "level": 0.2},
            "b": {"type": "tank", "area": 1.0, "level": 0.1},
        }
        own = {
            "type": "conduit",
            "from": "a",
            "to": "b",
            "diameter": 0.3,
            "length": 20.0,
            "inverts": [0.0, 0.0],
            "manning": 0.012,
        }
        fluid = {"name": "user", "density": 1000.0, "bulk_modulus": 2.2e9, "viscosity": 1e-3}
        return {
            "fluid": fluid,
            "nodes": tanks,
            "links": {"c": own},
            "numerics": {"end": 1.0},
            "output": {"every": 1.0, "probes": list(probes)},
        }

    assert [
        probe.fraction for probe in load(case("c.head@5 m", "c.flow@0.02 km")).output.probes
    ] == [0.25, 1.0]
    with pytest.raises(FvsolveError, match="is outside 0 m to 20 m"):
        load(case("c.head@99 km"))
