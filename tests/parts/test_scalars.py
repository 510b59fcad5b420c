"""Scalars in networks: transport, division, mixing, diffusion, decay and storage in closed form, with balances."""

import copy
import math
from importlib import import_module

import meshio
import numpy as np
import pytest
from pytest import approx
from reference.dyed_pipes import (
    BORE,
    FLOW,
    HAMMER,
    SPEED,
    at_end,
    case_of,
    given,
    hammer,
    line,
    ogata_banks,
)
from reference.jacobians import random_state, stray
from reference.orders import observed_order
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    RHO,
    chamber,
    junction,
    ramp,
    reservoir,
    scene,
    smooth_ramp,
    smooth_step,
    step,
    tank,
    valve,
)

import fvsolve


def inflow(flow, **dye) -> dict:
    return {"type": "inflow", "flow": flow, **({"scalars": dye} if dye else {})}


def through(cells: int, **numerics) -> float:
    """L1 error of a smooth front after two pipes and the junction between them."""
    nodes = {
        "lake": given(dye=smooth_ramp(0.5, 5.0, 0.0, 1.0)),
        "mid": junction(),
        "tap": junction(FLOW),
    }
    links = {"a": line("lake", "mid", 5.0, cells), "b": line("mid", "tap", 5.0, cells)}
    _, found = at_end(case_of(nodes, links, 7.5, numerics))
    fine, error = 20, 0.0
    for k, name in enumerate("ab"):
        x = 5.0 * k + (np.arange(cells * fine) + 0.5) * 5.0 / (cells * fine)
        exact = np.array([smooth_step(7.5 - one / SPEED, 0.5, 5.0) for one in x])
        error += np.abs(found[name]["dye"] - exact.reshape(cells, fine).mean(axis=1)).mean()
    return error


@pytest.mark.parametrize("scheme, order", [("upwind", 1.0), ("muscl", 2.0), ("weno5", 2.0)])
def test_a_smooth_front_moves_at_the_speed_of_the_flow_and_through_a_junction(scheme, order):
    many = (40, 80, 160)
    errors = [through(cells, scheme=scheme) for cells in many]
    assert errors[-1] < {1.0: 0.014, 2.0: 1.2e-4}[order]  # 1.6e-4 without slopes at ends
    assert -observed_order(errors, many) == approx(order, abs=0.2)


@pytest.mark.parametrize("limiter", ["minmod", "van-leer", "monotonized-central"])
def test_a_sharp_plug_stays_between_the_given_values(limiter):
    plug = {"time": [0.0, 1.0, 3.0], "value": [0.2, 0.9, 0.2], "kind": "step"}
    nodes = {"lake": given(dye=plug), "mid": junction(), "tap": junction(FLOW)}
    links = {"a": line("lake", "mid", 5.0, 50), "b": line("mid", "tap", 5.0, 50)}
    probes = ["mid.dye", "tap.dye", "a.dye@0.5", "b.dye@0.5"]
    case = case_of(nodes, links, 12.0, {"limiter": limiter}, probes, initial=0.2)
    result = fvsolve.run(case)
    for probe in probes:
        low, _, high, _ = result.extremes[probe]
        assert 0.2 - 1e-12 < low and high < 0.9 + 1e-12
    assert result.extremes["tap.dye"].maximum > 0.85  # the plug arrives


def test_a_plug_splits_by_mass():
    plug = {"time": [0.0, 1.0, 3.0], "value": [0.0, 2.0, 0.0], "kind": "step"}
    nodes = {
        "lake": given(dye=plug),
        "fork": junction(),
        "few": junction(0.3 * FLOW),
        "many": junction(0.7 * FLOW),
    }
    links = {
        "trunk": line("lake", "fork", 2.0, 20),
        "left": line("fork", "few", 1.0, 20),
        "right": line("many", "fork", 3.0, 20),  # defined against its flow
    }
    book = fvsolve.run(case_of(nodes, links, 40.0)).ledger["dye"]
    assert book["by_node"]["lake"] == approx(2.0 * 2.0 * RHO * FLOW, rel=1e-12)
    assert -book["by_node"]["few"] / book["by_node"]["lake"] == approx(0.3, rel=1e-9)
    assert -book["by_node"]["many"] / book["by_node"]["lake"] == approx(0.7, rel=1e-9)
    assert book["relative"] < 1e-12


def test_streams_mix_by_mass():
    nodes = {
        "hot": inflow(0.25 * FLOW, dye=60.0),
        "cold": inflow(0.75 * FLOW, dye=20.0),
        "join": junction(),
    }
    links = {
        "a": line("hot", "join", 1.0, 10),
        "b": line("cold", "join", 1.0, 10),
        "c": line("join", "sea", 1.0, 10),
    }
    case = case_of(
        {**nodes, "sea": given()},
        links,
        30.0,
        probes=["join.dye", "c.dye@1", "sea.dye"],
        initial=20.0,
    )
    result = fvsolve.run(case)
    assert result["join.dye"][-1] == approx(30.0, rel=1e-12)
    assert result["c.dye@1"][-1] == approx(30.0, rel=1e-9)
    assert result["sea.dye"][-1] == 20.0  # the value of flow from it


def test_nodes_without_volume_pass_on_at_once_in_the_order_of_the_flow():
    """Values follow the flow, although parts are listed against it and a second stream joins."""
    nodes = {
        "lake": reservoir(AMBIENT + 3e4, scalars={"dye": 1.0}),
        "d": junction(),
        "c": junction(),
        "b": inflow(0.5 * FLOW, dye=3.0),
        "sea": given(),
    }
    links = {
        "v4": valve("d", "sea", 0.01),
        "v3": valve("c", "d", 0.01),
        "v2": valve("d", "b", 0.01),
        "v1": valve("lake", "c", 0.01),
    }
    links["v2"] = valve("b", "c", 0.01)
    numerics = {"courant": None, "method": "dormand-prince", "rtol": 1e-8}
    case = case_of(nodes, links, 1.0, numerics, ["c.dye", "d.dye", "v1.flow", "v4.flow"])
    case["numerics"].pop("courant")
    result = fvsolve.run(case)
    q = result["v1.flow"][-1]
    mixed = (1.0 * q + 3.0 * 0.5 * FLOW) / (q + 0.5 * FLOW)
    assert result["c.dye"][0] == approx(mixed, rel=1e-9) and result["d.dye"][0] == approx(
        mixed, rel=1e-9
    )


def test_flow_reversed_by_a_pump_without_volume_is_mixed_too():
    """Two streams, and a pump that circulates between two nodes: values solve two balances by mass."""
    nodes = {"one": inflow(0.002, dye=1.0), "two": inflow(0.001, dye=4.0), "sea": given()}
    curve = {"flow": [0.0, 0.01, 0.02], "head": [10.0, 8.0, 3.0]}
    links = {
        "back": {"type": "pump", "from": "two", "to": "one", "curve": curve},
        "v": valve("one", "two", 0.002),
        "out": valve("two", "pool", 0.001),
        "shut": valve("pool", "sea", 0.001, opening=0.0),
    }
    nodes["pool"] = tank(1.0, 1.0)
    case = case_of(nodes, links, 1.0, probes=["one.dye", "two.dye", "back.flow"])
    case["numerics"] = {"end": 1.0, "method": "dormand-prince", "rtol": 1e-6}
    result = fvsolve.run(case)
    back = result["back.flow"][0]
    mixed = np.linalg.solve(
        [[0.002 + back, -back], [-0.002 - back, 0.003 + back]], [0.002 * 1.0, 0.001 * 4.0]
    )
    assert back > 0.01
    assert [result["one.dye"][0], result["two.dye"][0]] == approx(mixed, rel=1e-11)


def test_diffusion_behind_a_held_inlet_is_that_of_ogata_and_banks():
    errors = []
    for cells in (50, 100, 200):
        nodes = {"lake": given(dye=1.0), "tap": junction(FLOW)}
        _, found = at_end(
            case_of(nodes, {"a": line("lake", "tap", 10.0, cells)}, 4.0, diffusivity=0.25)
        )
        x = (np.arange(cells) + 0.5) * 10.0 / cells
        errors.append(np.abs(found["a"]["dye"] - ogata_banks(x, 4.0, 0.25)).mean())
    assert errors[-1] < 2e-4
    assert -observed_order(errors, (50, 100, 200)) == approx(2.0, abs=0.25)


def test_diffusion_alone_through_a_junction_is_a_straight_line():
    """Without flow the final profile between two given values is linear across pipes with different cells."""
    nodes = {"left": given(dye=1.0), "mid": junction(), "right": given(dye=0.0)}
    links = {"a": line("left", "mid", 1.0, 5), "b": line("mid", "right", 1.0, 20)}
    _, found = at_end(case_of(nodes, links, 60.0, diffusivity=0.2))
    assert found["a"]["dye"] == approx(1.0 - 0.5 * (np.arange(5) + 0.5) / 5, abs=1e-10)
    assert found["b"]["dye"] == approx(0.5 - 0.5 * (np.arange(20) + 0.5) / 20, abs=1e-10)


def test_stagnant_water_decays_exponentially_towards_ambient():
    nodes = {
        "left": given(),
        "stop": junction(),
        "box": chamber(0.5, AMBIENT, scalars={"dye": 80.0}),
    }
    links = {"a": line("left", "stop", 1.0, 10), "shut": valve("stop", "box", 0.01, opening=0.0)}
    numerics = {"method": "rk4"}
    model, found = at_end(
        case_of(nodes, links, 10.0, numerics, initial=50.0, decay=0.2, ambient=20.0)
    )
    assert found["a"]["dye"] == approx(20.0 + 30.0 * math.exp(-2.0), rel=1e-9)
    assert found["nodes"]["box"]["dye"] == approx(20.0 + 60.0 * math.exp(-2.0), rel=1e-9)


def test_decay_on_the_way_is_that_of_the_time_it_takes():
    """Heat loss of a pipe: c(x) = ambient + (c0 - ambient) exp(-decay x / v)."""
    nodes = {"lake": given(dye=60.0), "tap": junction(FLOW)}
    errors = []
    for cells in (50, 100):
        links = {"a": line("lake", "tap", 10.0, cells)}
        _, found = at_end(case_of(nodes, links, 30.0, initial=60.0, decay=0.1, ambient=10.0))
        errors.append(abs(found["nodes"]["tap"]["dye"] - (10.0 + 50.0 * math.exp(-1.0))))
    assert errors[1] < 2e-3 and errors[0] / errors[1] > 3.0


def test_a_stirred_chamber_follows_the_inflow():
    """c' = q / V (c_in - c) in a stirred chamber without pipes."""
    nodes = {
        "feed": inflow(1e-3, dye=4.0),
        "box": chamber(0.02, scalars={"dye": 1.0}),
        "sea": given(),
    }
    links = {"in": valve("feed", "box", 1e-4), "out": valve("box", "sea", 1e-4)}
    case = case_of(nodes, links, 60.0, {"method": "dormand-prince"}, ["box.dye", "box.pressure"])
    case["numerics"] = {key: x for key, x in case["numerics"].items() if key != "courant"} | {
        "rtol": 1e-9
    }
    result = fvsolve.run(case)
    held = 0.02 * (1.0 + (result["box.pressure"] - AMBIENT) / 2.2e9)
    assert result["box.dye"] == approx(4.0 - 3.0 * np.exp(-1e-3 * result.t / held), rel=1e-7)
    assert result.ledger["dye"]["relative"] < 1e-12


def test_a_tank_that_fills_contains_the_mean_of_the_inflow_and_spills_its_content():
    nodes = {
        "feed": inflow(0.01, dye=2.0),
        "pool": tank(0.5, 1.0, scalars={"dye": 1.0}, height=1.4),
    }
    case = case_of(
        nodes,
        {"in": line("feed", "pool", 1.0, 10, scalars={"dye": 2.0})},
        30.0,
        {"method": "rk4"},
        ["pool.dye", "pool.level"],
    )
    result = fvsolve.run(case)
    filling = result["pool.level"] < 1.4 - 1e-9
    filled = 0.5 * result["pool.level"]
    mean = (0.5 * 1.0 + (filled - 0.5) * 2.0) / filled
    assert filling.sum() > 20 and result["pool.dye"][filling] == approx(mean[filling], rel=1e-9)
    late = result.t > 20.5  # full and stirred from 20 s on
    since = result.t[late] - 20.0
    full = (0.5 + 0.2 * 2.0) / 0.7
    assert result["pool.dye"][late] == approx(
        2.0 - (2.0 - full) * np.exp(-0.01 / 0.7 * since), rel=1e-3
    )
    assert (
        result.ledger["dye"]["by_node"]["pool"] < 0.0 and result.ledger["dye"]["relative"] < 1e-12
    )


def test_a_dry_tank_passes_on_inflow_and_make_up_and_stores_none():
    feed, draw = 1e-3, 2e-3
    nodes = {
        "feed": inflow(feed, dye=3.0),
        "pool": tank(0.1, 0.2, scalars={"dye": 1.0}),
        "drain": junction(draw),
    }
    links = {"in": valve("feed", "pool", 1e-3), "out": valve("pool", "drain", 1e-2)}
    for method in ("dormand-prince", "auto"):
        case = case_of(nodes, links, 40.0, probes=["drain.dye", "pool.level"], initial=9.0)
        case["numerics"] = {"end": 40.0, "method": method, "rtol": 1e-7}
        result = fvsolve.run(case)
        emptied = result.t[result["pool.level"] > 0.01][-1]
        assert result["drain.dye"][result.t <= emptied] == approx(
            3.0 - 2.0 * (result["pool.level"][result.t <= emptied] / 0.2) ** (feed / (draw - feed)),
            rel=1e-5,
        )
        assert result["drain.dye"][-1] == approx(
            (feed * 3.0 + (draw - feed) * 9.0) / draw, rel=1e-12
        )
        # of 20 kg: amount and mass have errors of steps
        assert abs(result.ledger["dye"]["final"]) < 1e-3
        assert result.ledger["dye"]["relative"] < 1e-12


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5", "upwind5", "central"])
@pytest.mark.parametrize("model", ["quasi-steady", "unsteady"])
def test_a_uniform_value_stays_uniform_through_water_hammer(scheme, model):
    """Masses of cells vary by 5e-4 and flows reverse, but a uniform value stays uniform to rounding."""
    # 0.7 is inside the bounds
    case = copy.deepcopy(hammer(scheme, {"model": model, "roughness": 1e-4}, initial=0.0))
    case["scalars"]["other"] = {"initial": 0.0}
    for part in (
        *(case["nodes"][name] for name in ("lake", "box")),
        *(case["links"][name] for name in ("a", "b", "side")),
    ):
        part["scalars"] = {"dye": 0.7}
    case["nodes"]["sea"]["scalars"] = {"dye": 2.0}
    found = at_end(case)[1]
    for name in ("a", "b", "side"):
        assert np.abs(found[name]["dye"] / 0.7 - 1.0).max() < 1e-12
        assert not found[name]["other"].any()
    assert found["nodes"]["box"]["dye"] == approx(0.7, rel=1e-13)


def test_flow_that_reverses_returns_the_same_values_and_the_ledger_closes():
    case = hammer("muscl", {"model": "none"}, initial=0.0, diffusivity=0.01, decay=0.3, ambient=0.1)
    case["nodes"] = {
        **HAMMER,
        "lake": reservoir(ramp(0.3, 0.2, 5e5, 1e5), scalars={"dye": ramp(0.0, 0.3, 1.0, 2.0)}),
        "sea": reservoir(ramp(0.3, 0.2, 1e5, 5e5), scalars={"dye": 3.0}),
    }
    case["links"]["v"]["opening"], case["numerics"]["end"] = 1.0, 8.0
    result = fvsolve.run(case)
    book = result.ledger["dye"]
    assert result["gate.dye"][-1] == approx(3.0, rel=1e-4) and result["gate.dye"][1] < 1.0
    assert book["decayed"] != 0.0 and book["by_node"]["sea"] > 0.0
    assert book["relative"] < 1e-12


@pytest.mark.parametrize("order", [("dye", "salt", "ink"), ("salt", "ink", "dye")])
def test_the_books_of_scalars_that_decay_do_not_depend_on_others(order):
    case = hammer("muscl", {"model": "none"}, initial=0.7, diffusivity=0.01, decay=0.3, ambient=0.1)
    case["numerics"]["end"] = 4.0
    every = case["scalars"] | {"salt": {"initial": 2.0}, "ink": {"initial": 1.0, "decay": 0.2}}
    alone = {}
    for name in ("dye", "ink"):
        single = case | {"scalars": {"dye": every[name]}}
        alone[name] = fvsolve.run(single).ledger["dye"]
    case["scalars"] = {name: every[name] for name in order}
    for name in ("salt", "ink"):  # as for the dye, which the wall of a pipe holds back
        case["links"]["b"]["retardation"][name] = case["links"]["b"]["retardation"]["dye"]
    found = fvsolve.run(case).ledger
    for name, expected in alone.items():
        assert found[name] == expected and expected["decayed"] != 0.0
    assert all(found[name]["relative"] < 1e-12 for name in order)


def test_a_pipe_stated_from_its_opposite_end_carries_the_same():
    def dye_at_end(back: bool) -> np.ndarray:
        ends = ("tap", "lake") if back else ("lake", "tap")
        nodes = {
            "lake": given(dye=step(1.0, 0.0, 1.0)),
            "tap": junction(ramp(2.0, 2.0, FLOW, -0.5 * FLOW)),
        }
        found = at_end(case_of(nodes, {"a": line(*ends, 4.0, 40)}, 6.0, diffusivity=1e-3))[1]["a"][
            "dye"
        ]
        return found[::-1] if back else found

    assert dye_at_end(False).max() > 0.5
    assert dye_at_end(True) == approx(dye_at_end(False), abs=1e-12)


def test_where_nothing_flows_values_are_defined():
    nodes = {
        "lake": given(),
        "mid": junction(),
        "stop": junction(),
        "lone": junction(),
        "sea": given(),
    }
    links = {
        "a": line("lake", "mid", 1.0, 4, scalars={"dye": 1.0}),
        "b": line("mid", "stop", 1.0, 4, scalars={"dye": 2.0}),
        "v": valve("stop", "lone", 0.01),
        "w": valve("lone", "sea", 0.01, opening=0.0),
    }
    found = at_end(case_of(nodes, links, 1.0, initial=7.0))[1]
    assert found["nodes"]["mid"]["dye"] == 1.5 and found["nodes"]["stop"]["dye"] == 2.0
    assert found["nodes"]["lone"]["dye"] == 7.0
    assert np.array_equal(found["a"]["dye"], np.ones(4)) and np.array_equal(
        found["b"]["dye"], np.full(4, 2.0)
    )


def test_results_name_it_and_the_written_case_states_it_again(tmp_path):
    nodes = {"lake": given(dye=step(1.0, 0.0, 1.0)), "tap": junction(FLOW)}
    case = case_of(nodes, {"a": line("lake", "tap", 4.0, 40)}, 4.0, unit="mg/l")
    case["output"]["fields"] = 4
    result = fvsolve.run(case, out=tmp_path / "run")
    header = (tmp_path / "run" / "history.csv").read_text().splitlines()[0]
    assert "tap.dye [mg/l]" in header.split(",")
    frame = meshio.read(tmp_path / "run" / "fields" / "000004.vtu")
    assert frame.cell_data["dye"][0].max() == approx(1.0, abs=1e-3)
    assert result.ledger["dye"]["inflow"] == approx(3.0 * RHO * FLOW, rel=1e-12)
    again = fvsolve.run(tmp_path / "run" / "case.toml")
    assert np.array_equal(again["tap.dye"], result["tap.dye"])


def test_a_run_interrupted_and_resumed_is_the_uninterrupted_run_with_its_ledger(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), "CHUNK_SECONDS", 0.0)
    nodes = {"lake": given(dye=step(1.0, 0.0, 1.0)), "tap": junction(FLOW)}
    case = case_of(nodes, {"a": line("lake", "tap", 4.0, 200)}, 4.0, decay=0.1)

    def interrupt(t, seconds, steps):
        if t > 1.5:
            raise KeyboardInterrupt

    assert not fvsolve.run(case, out=tmp_path / "run", progress=interrupt, pictures=False).ok
    again = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert again.ledger["dye"] == whole.ledger["dye"]
    assert (tmp_path / "run" / "history.csv").read_bytes() == (
        tmp_path / "whole" / "history.csv"
    ).read_bytes()


def test_implicit_steps_carry_it_to_the_same_place_and_close_the_book():
    """Implicit steps beyond the limit of waves give the values of explicit steps, with reversing flow and decay."""
    case = hammer(
        "upwind",
        {"model": "quasi-steady", "roughness": 1e-4},
        initial=0.2,
        decay=0.1,
        diffusivity=0.01,
    )
    case["nodes"] = {**HAMMER, "lake": reservoir(5e5, scalars={"dye": 1.0})}
    ends = []
    for numerics in (
        {"method": "ssp-rk3", "courant": 0.5},
        {"method": "radau-iia-5", "rtol": 1e-8},
        {"method": "rodas-5p", "rtol": 1e-7},
        {"method": "auto", "rtol": 1e-7},
    ):
        case["numerics"] = {"end": 0.6, "scheme": "upwind", **numerics}
        result = fvsolve.run(case)
        assert result.ledger["dye"]["relative"] < 1e-12 and result.ledger["dye"]["decayed"] > 0.0
        ends.append(result["gate.dye"][-1])
    assert ends[1:] == approx([ends[0]] * 3, rel=1e-5)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5", "upwind5", "central"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(scheme):
    for law in ({"model": "none"}, {"model": "unsteady", "roughness": 1e-4}):
        case = hammer(scheme, law, initial=0.7, decay=0.1, diffusivity=0.1)
        model, rng = fvsolve.build(fvsolve.load(case)), np.random.default_rng(1)
        assert max(stray(model, t, random_state(model, rng)) for t in (0.0, 0.1, 0.2)) < 1e-9


def test_a_controller_sets_the_inflow_also_beyond_the_range_of_the_case():
    nodes = {"lake": given(dye=1.0), "tap": junction(FLOW)}
    model = fvsolve.build(fvsolve.load(case_of(nodes, {"a": line("lake", "tap", 1.0, 20)}, 9.0)))
    state = fvsolve.advance(model, fvsolve.initial_state(model), 3.0)
    state = fvsolve.advance(model, state, 8.0, {"lake.dye": 5.0})
    assert model.fields(state.y, model.evaluate(state.t, state.y)[1])["a"]["dye"] == approx(
        5.0, rel=1e-6
    )


FAULTS = [
    (("scalars", "pressure"), {}, '"pressure" is a reserved name'),
    (("nodes", "lake", "scalars"), {"dya": 1.0}, 'no scalar named "dya"; did you mean "dye"?'),
    (("nodes", "tap", "scalars"), {"dye": 1.0}, "a junction has no scalar values"),
    (("nodes", "pool", "scalars"), {"dye": {"time": [0, 1], "value": [0, 1]}}, "not a schedule"),
    (("links", "a", "scalars"), {"dye": "much"}, '"much" is not a number'),
    (
        ("links", "a"),
        {"type": "rigid-column", "from": "lake", "to": "tap", "length": 10.0, "diameter": BORE},
        "links.a: is a rigid-column; it has no cells to carry scalars; use a pipe",
    ),
    (
        ("nodes", "pool"),
        {"type": "accumulator", "volume": 1.0, "precharge": 5e4},
        "its contents carry no scalars yet",
    ),
    (("scalars", "dye", "decay"), -1.0, "out of range"),
    (("scalars", "dye", "diffusivity"), "3 m", "a diffusivity"),
    (
        ("output", "probes"),
        ["lake.dye", "a.dye@0.5", "a.dye"],
        'this probe needs a place, for example "a.dye@0.5"',
    ),
    (("output", "probes"), ["v.dye"], "v is a valve"),
]


@pytest.mark.parametrize("keys, value, said", FAULTS, ids=[".".join(keys) for keys, *_ in FAULTS])
def test_impossible_settings_are_refused(keys, value, said):
    nodes = {"lake": given(dye=1.0), "tap": junction(), "pool": tank(1.0, 0.1)}
    case = case_of(nodes, {"a": line("lake", "tap"), "v": valve("tap", "pool", 1e-3)}, 1.0)
    fvsolve.load(case)
    table = case = copy.deepcopy(case)
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    assert said in str(refused(case))


@pytest.mark.parametrize("method", ["bogacki-shampine", "radau-iia-5", "rodas-4"])
@pytest.mark.parametrize(
    "given", [{"courant": 0.5}, {"step": 0.25}, {"rtol": 1e-4}], ids=["courant", "step", "rtol"]
)
def test_still_water_with_a_scalar_retains_it(given, method):
    """Nothing moves, so no wave sets a step: the rate of waves is zero, and no feature may divide by it."""
    pool = {
        "type": "basin",
        "physics": "transport",
        "size": [1.0, 1.0],
        "cells": [4, 4],
        "velocity": {"u": 0, "v": 0},
        "scalars": {"dye": 1.0},
    }
    case = scene(
        {"pool": pool},
        {},
        1.0,
        given | {"method": method},
        ["pool.dye@0.5,0.5"],
        0.5,
        scalars={"dye": {}},
    )
    result = fvsolve.run(case)
    assert result.ok
    assert np.abs(result["pool.dye@0.5,0.5"] - 1.0).max() < 1e-14
