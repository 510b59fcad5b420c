"""Links by a curve of losses: closed forms, restatements, waves by characteristics, clusters, energy, faults."""

import math

import numpy as np
import pytest
from reference.jacobians import stray
from reference.quasi_steady import HAZEN, loss_of
from reference.quasi_steady import pipe as quick
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    SHARP,
    WATER,
    area,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    step,
    tank,
)
from scipy.optimize import brentq

import fvsolve
from fvsolve.studies import energy

POINTS = {"flow": [0.0, 0.005, 0.01, 0.02], "head": [0.0, 1.0, 3.0, 10.0]}
METHODS = ["dormand-prince", "radau-iia-5", "rodas-5p"]
FLAT = {"flow": [0.0, 0.01], "head": [2.0, 2.0]}


def curve(start, end, loss=POINTS, **more):
    return {"type": "loss-curve", "from": start, "to": end, "loss": loss, **more}


def loss_at(flow, points=POINTS):
    """Loss [m] at a flow [m3/s] by the points, odd in the flow."""
    flows, heads = np.array(points["flow"]), np.array(points["head"])
    if flows[0] > 0.0:
        flows, heads = np.concatenate(([0.0], flows)), np.concatenate(([0.0], heads))
    beyond = (heads[-1] - heads[-2]) / (flows[-1] - flows[-2]) * max(abs(flow) - flows[-1], 0.0)
    return math.copysign(np.interp(abs(flow), flows, heads) + beyond, flow)


def flow_at(head, points=POINTS):
    return brentq(lambda flow: loss_at(flow, points) - head, -1.0, 1.0, xtol=1e-16)


def flow_between(low, high, link):
    case = scene(
        {"a": lake(high), "b": lake(low)}, {"part": link}, 1.0, {"rtol": 1e-6}, ["part.flow"], 1.0
    )
    return fvsolve.run(case)["part.flow"][0]


# its law ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("head", [0.0, 0.4, 1.0, 2.0, 3.0, 6.5, 10.0, 24.0])
def test_the_flow_between_two_lakes_has_the_loss_of_the_curve_both_ways(head):
    exact = flow_at(head)
    assert flow_between(20.0, 20.0 + head, curve("a", "b")) == pytest.approx(
        exact, rel=1e-12, abs=1e-15
    )
    assert flow_between(20.0 + head, 20.0, curve("a", "b")) == pytest.approx(
        -exact, rel=1e-12, abs=1e-15
    )


METRE = RHO * GRAVITY * 1e-5  # [bar]
RESTATED = {
    "l/s and m": {
        "flow": ["0 l/s", "5 l/s", "10 l/s", "20 l/s"],
        "head": ["0 m", "1 m", "3 m", "10 m"],
    },
    "m3/h and bar": {
        "flow": ["0 m3/h", "18 m3/h", "36 m3/h", "72 m3/h"],
        "drop": ["0 bar", f"{METRE!r} bar", f"{3.0 * METRE!r} bar", f"{10.0 * METRE!r} bar"],
    },
    "Pa": {"flow": POINTS["flow"], "drop": [RHO * GRAVITY * head for head in POINTS["head"]]},
    "without the origin": {"flow": POINTS["flow"][1:], "head": POINTS["head"][1:]},
    "points doubled": {
        "flow": [0.0, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02],
        "head": [0.0, 0.5, 1.0, 2.0, 3.0, 6.5, 10.0],
    },
}


@pytest.mark.parametrize("words", RESTATED)
@pytest.mark.parametrize("head", [0.4, 2.0, 24.0])
def test_the_words_do_not_matter(words, head):
    exact = flow_between(20.0, 20.0 + head, curve("a", "b"))
    assert flow_between(20.0, 20.0 + head, curve("a", "b", RESTATED[words])) == pytest.approx(
        exact, rel=1e-12
    )
    assert flow_between(20.0, 20.0 + head, curve("b", "a", RESTATED[words])) == pytest.approx(
        -exact, rel=1e-12
    )


def test_a_single_point_is_a_line_from_no_flow():
    assert flow_between(
        20.0, 23.0, curve("a", "b", {"flow": [0.01], "head": [2.0]})
    ) == pytest.approx(0.015, rel=1e-12)


def behind_pipe(head, loss=FLAT):
    """(flow through a link and a pipe in series [m3/s], drop over the link [m])."""
    nodes = {"a": lake(20.0 + head), "mid": junction(), "b": lake(20.0)}
    links = {"part": curve("a", "mid", loss), "main": quick("mid", "b")}
    run = fvsolve.run(scene(nodes, links, 1.0, {"rtol": 1e-6}, ["part.flow", "mid.head"], 1.0))
    return run["part.flow"][0], 20.0 + head - run["mid.head"][0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_constant_loss_is_constant_and_stops_the_flow_below_it(sign):
    """Its least slope changes the loss by less than 1e-6; below the loss hardly any flow passes."""
    for head in (2.5, 5.0, 30.0):
        flow, drop = behind_pipe(sign * head)
        assert drop == pytest.approx(sign * 2.0, rel=1e-6)
        assert loss_of(FACTOR, abs(flow), minor=0.0) == pytest.approx(abs(head - 2.0), rel=1e-5)
    flow, drop = behind_pipe(sign * 1.5)
    assert abs(flow) < 1e-8 and drop == pytest.approx(sign * 1.5, rel=1e-6)


FACTOR = {"model": "steady", "factor": 0.02}


def test_a_section_without_loss_passes_its_flow_freely():
    free = {"flow": [0.0, 0.005, 0.02], "head": [0.0, 0.0, 6.0]}
    flow, drop = behind_pipe(1.0, free)
    assert flow < 0.005 and abs(drop) < 1e-5
    flow, drop = behind_pipe(30.0, free)
    assert drop == pytest.approx(loss_at(flow, free), rel=1e-6)


# in time ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method", METHODS)
def test_a_tank_empties_through_a_linear_curve_exponentially(method, law):
    nodes, links = (
        {"a": tank(2.0, 5.0), "b": lake(0.0)},
        {"part": curve("a", "b", {"flow": [0.01], "head": [2.0]})},
    )
    fluid = {**WATER, "law": law}
    run = fvsolve.run(
        scene(
            nodes, links, 800.0, {"method": method, "rtol": 1e-10}, ["a.level"], 40.0, fluid=fluid
        )
    )
    assert run.ok
    assert run["a.level"] == pytest.approx(
        5.0 * np.exp(-0.005 / 2.0 * run.t), rel=1e-8 if law == "linear" else 1e-4
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_tank_empties_past_a_point_by_two_exponentials_in_turn(method):
    """Above 4 m the loss is 1 m and 300 s/m2 of flow beyond 10 l/s, below it 100 s/m2."""
    points = {"flow": [0.0, 0.01, 0.03], "head": [0.0, 1.0, 7.0]}
    nodes, links = {"a": tank(2.0, 4.0), "b": lake(0.0)}, {"part": curve("a", "b", points)}
    run = fvsolve.run(
        scene(nodes, links, 400.0, {"method": method, "rtol": 1e-10}, ["a.level"], 20.0)
    )
    rest = 1.0 - 0.01 * 300.0  # level at which the first section would have no flow
    turn = 600.0 * math.log((4.0 - rest) / (1.0 - rest))
    first = rest + (4.0 - rest) * np.exp(-run.t / 600.0)
    exact = np.where(run.t < turn, first, np.exp(-(run.t - turn) / 200.0))
    assert run.ok and run["a.level"] == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_chambers_equalise_exponentially(method):
    nodes = {"a": chamber(0.5, AMBIENT + 2e5), "b": chamber(1.5, AMBIENT + 1e5)}
    links = {"part": curve("a", "b", {"flow": [0.01], "drop": [1e5]})}
    run = fvsolve.run(
        scene(
            nodes,
            links,
            4e-3,
            {"method": method, "rtol": 1e-10},
            ["a.pressure", "b.pressure"],
            4e-4,
        )
    )
    rate = 1e-7 * WATER["bulk_modulus"] * (1.0 / 0.5 + 1.0 / 1.5)
    assert run.ok and run["a.pressure"] - run["b.pressure"] == pytest.approx(
        1e5 * np.exp(-rate * run.t), rel=1e-6
    )


@pytest.mark.parametrize("sudden", [-5e4, 4e5])
def test_a_step_wave_passes_as_by_characteristics(sudden):
    """A step of pressure D at the right end: p - B q is p0 + 2 D behind the wave, p + B q is p0 before the link."""
    bore, speed, length = 0.1, 1000.0, 100.0
    nodes = {
        "a": reservoir(6e5),
        "l": junction(),
        "r": junction(),
        "b": reservoir(step(0.05, 6e5, 6e5 + sudden)),
    }
    links = {
        "one": pipe("a", "l", length, bore, speed, 10),
        "part": curve("l", "r"),
        "two": pipe("r", "b", length, bore, speed, 10),
    }
    probes = ["part.flow", "l.pressure", "r.pressure"]
    run = fvsolve.run(scene(nodes, links, 0.24, dict(SHARP), probes, 0.01))
    impedance, weight = RHO * speed / area(bore), RHO * GRAVITY
    exact = brentq(
        lambda q: -2.0 * sudden - 2.0 * impedance * q - weight * loss_at(q), -1.0, 1.0, xtol=1e-16
    )
    before, behind = run.t < 0.145, (run.t > 0.165) & (run.t < 0.24)
    assert run.ok and np.all(run["part.flow"][before] == 0.0)
    assert run["part.flow"][behind] == pytest.approx(exact, rel=1e-9)
    assert run["l.pressure"][behind] == pytest.approx(6e5 - impedance * exact, rel=1e-9)
    assert run["r.pressure"][behind] == pytest.approx(
        6e5 + 2.0 * sudden + impedance * exact, rel=1e-9
    )


# clusters -----------------------------------------------------------------------------------------------------------

CURVES = [POINTS, FLAT, {"flow": [0.0, 0.002, 0.004], "head": [0.0, 0.0, 3.0]}, {"flow": [0.004], "head": [1.0]},
          {"flow": [0.0, 0.001, 0.003, 0.01], "head": [0.5, 1.0, 1.0, 8.0]}]  # fmt: skip


def grid(size, seed, **top):
    """Case of a grid of pipes and curves between a lake and a tank, with demands."""
    rng = np.random.default_rng(seed)
    places = [(i, j) for i in range(size) for j in range(size)]
    nodes = {
        f"n{i}{j}": junction(float(rng.uniform(0.0, 1e-3)), elevation=float(rng.uniform(0.0, 5.0)))
        for i, j in places
    }
    nodes |= {"west": lake(50.0, elevation=0.0), "east": tank(30.0, 20.0, elevation=20.0)}
    joins = [
        (f"n{i}{j}", f"n{k}{m}")
        for i, j in places
        for k, m in ((i + 1, j), (i, j + 1))
        if max(k, m) < size
    ]
    links = {
        f"p{k}": curve(*ends, CURVES[rng.integers(len(CURVES))])
        if rng.uniform() < 0.3
        else quick(*ends, float(rng.uniform(50.0, 300.0)), float(rng.uniform(0.05, 0.2)), HAZEN)
        for k, ends in enumerate(joins)
    }
    links |= {
        "in": quick("west", "n00", friction=HAZEN),
        "out": quick(f"n{size - 1}{size - 1}", "east", friction=HAZEN),
    }
    probes = [*(f"{name}.flow" for name in links), *(f"{name}.head" for name in nodes)]
    return scene(nodes, links, 1800.0, {"rtol": 1e-10}, probes, 900.0, **top)


@pytest.mark.parametrize("size, seed", [(4, 1), (4, 2), (4, 3), (9, 4), (16, 5)])
def test_a_grid_of_pipes_and_curves_balances_at_every_node(size, seed):
    case = grid(size, seed)
    run = fvsolve.run(case)
    assert run.ok
    inflow = {name: -node.get("demand", 0.0) for name, node in case["nodes"].items()}
    for name, link in case["links"].items():
        for row in (0, -1):
            flow, drop = (
                run[f"{name}.flow"][row],
                run[f"{link['from']}.head"][row] - run[f"{link['to']}.head"][row],
            )
            if link["type"] == "pipe":
                loss = math.copysign(
                    loss_of(HAZEN, abs(flow), link["length"], link["diameter"], 0.0), flow
                )
                assert loss == pytest.approx(drop, rel=1e-7, abs=1e-8)
            elif link["loss"]["head"][0] == 0.0 or abs(flow) > 1e-8:
                assert loss_at(flow, link["loss"]) == pytest.approx(drop, rel=1e-6, abs=2e-6)
        inflow[link["from"]] -= run[f"{name}.flow"][-1]
        inflow[link["to"]] += run[f"{name}.flow"][-1]
    balances = [inflow[name] for name, node in case["nodes"].items() if node["type"] == "junction"]
    assert balances == pytest.approx([0.0] * len(balances), abs=1e-12)


@pytest.mark.parametrize("law", ["log", "table", "mixture"])
def test_every_density_law_has_the_flows_of_a_liquid_that_hardly_yields(law):
    fluids = {
        "log": {**WATER, "law": "log"},
        "table": {"name": "Water", "temperature": 293.15, "law": "table"},
        "mixture": {**WATER, "law": "mixture", "air_fraction": 1e-6},
    }
    plain, other = (fvsolve.run(grid(4, 2, **top)) for top in ({}, {"fluid": fluids[law]}))
    assert plain.ok and other.ok
    assert other["east.head"] == pytest.approx(plain["east.head"], abs=3e-3)
    for name in ("in.flow", "out.flow"):
        assert other[name] == pytest.approx(plain[name], rel=3e-3)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_no_rate_depends_on_a_state_outside_its_pattern(law):
    model = fvsolve.build(fvsolve.load(grid(4, 1, fluid={**WATER, "law": law})))
    rng = np.random.default_rng(1)
    assert (
        max(stray(model, t, model.scale * rng.normal(size=model.y_size)) for t in (0.0, 400.0))
        < 1e-7
    )


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("loss", [POINTS, FLAT], ids=["points", "constant"])
def test_at_rest_no_bit_changes(loss, law):
    nodes = {"a": tank(2.0, 5.0), "mid": junction(), "b": tank(3.0, 5.0)}
    links = {"part": curve("a", "mid", loss), "main": quick("mid", "b")}
    fluid = {**WATER, "law": law}
    run = fvsolve.run(
        scene(nodes, links, 100.0, {"rtol": 1e-8}, ["a.level", "part.flow"], 10.0, fluid=fluid)
    )
    assert run.ok and np.ptp(run["a.level"]) == 0.0 and np.all(run["part.flow"] == 0.0)


# energy and faults --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loss", [POINTS, FLAT], ids=["points", "constant"])
def test_the_ledger_closes_and_the_link_dissipates_drop_times_flow(loss):
    nodes = {"a": tank(2.0, 9.0), "mid": junction(), "b": tank(3.0, 1.0)}
    links = {"part": curve("a", "mid", loss), "main": quick("mid", "b")}
    case = scene(nodes, links, 200.0, {"rtol": 1e-10}, ["a.level", "b.level"], 10.0)
    run, ledger = fvsolve.run(case), energy(case)
    assert abs(ledger.remainder[-1]) < 1e-12 * ledger.throughput
    stored = [
        0.5 * RHO * GRAVITY * (2.0 * run["a.level"][k] ** 2 + 3.0 * run["b.level"][k] ** 2)
        for k in (0, -1)
    ]
    dissipated = ledger.dissipated["part"][-1]
    assert dissipated + ledger.dissipated["main"][-1] == pytest.approx(
        stored[0] - stored[1], rel=1e-9
    )
    if loss is FLAT:
        volume = 2.0 * (9.0 - run["a.level"][-1])
        assert dissipated == pytest.approx(2.0 * RHO * GRAVITY * volume, rel=1e-6)


FAULTS = {
    "no table": ("1 m", "links.part.loss", "expected"),
    "no losses": ({"flow": [0.0, 1.0]}, "links.part.loss", "head is missing"),
    "both losses": (
        {"flow": [1.0], "head": [1.0], "drop": [1.0]},
        "links.part.loss",
        "one of these keys",
    ),
    "lengths": (
        {"flow": [0.0, 1.0, 2.0], "head": [0.0, 1.0]},
        "links.part.loss.head",
        "expected equal lengths",
    ),
    "order": (
        {"flow": [0.0, 2.0, 1.0], "head": [0.0, 1.0, 2.0]},
        "links.part.loss.flow",
        "expected rising flows",
    ),
    "negative flow": (
        {"flow": [-1.0, 1.0], "head": [0.0, 1.0]},
        "links.part.loss.flow[0]",
        "out of range",
    ),
    "negative loss": (
        {"flow": [0.0, 1.0], "drop": [-1.0, 1.0]},
        "links.part.loss.drop[0]",
        "out of range",
    ),
    "falling": (
        {"flow": [0.0, 1.0], "head": ["2 m", "1 m"]},
        "links.part.loss.head[1]",
        "must not fall",
    ),
    "no loss": (
        {"flow": [0.0, 1.0], "head": [0.0, 0.0]},
        "links.part.loss.head",
        "no loss above 0",
    ),
    "no flow": ({"flow": [0.0], "head": [1.0]}, "links.part.loss.flow", "no flow above 0"),
    "unit": (
        {"flow": [0.0, 1.0], "head": ["0 m", "1 bar"]},
        "links.part.loss.head[1]",
        "expected a head",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_names_its_key_and_its_remedy(name):
    loss, place, text = FAULTS[name]
    error = refused(
        scene({"a": lake(20.0), "b": lake(10.0)}, {"part": curve("a", "b", loss)}, 1.0, {})
    )
    (fault,) = error.faults
    assert (fault.place, text in fault.message) == (place, True), fault


def test_a_head_without_gravity_is_refused():
    case = scene(
        {"a": reservoir(2e5), "b": reservoir(1e5)}, {"part": curve("a", "b")}, 1.0, {}, gravity=0.0
    )
    refused(case, "no pressure without gravity; expected `drop`")
    case["links"]["part"]["loss"] = {"flow": [0.01], "drop": ["1 bar"]}
    assert fvsolve.run(case, {"output.probes": ["part.flow"]})["part.flow"][0] == pytest.approx(
        0.01, rel=1e-12
    )
