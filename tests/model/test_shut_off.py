"""Starts without solution: faults with the group of nodes, its demand, the links that shut it off, and the remedy."""

import pytest
from reference.quasi_steady import altitude, main, restated
from reference.scenes import junction, lake, reservoir, scene, tank, valve

import fvsolve
from fvsolve.errors import CaseError

WEIGHT = 9806.65  # of water [N/m3]


def sustained(demand: float = 0.02, head: float = 250.0) -> dict:
    """Lake at 250 m, and a valve that must sustain `head` before it; demands j3 and j4 behind."""
    nodes = {
        "lake": lake(250.0),
        "j1": junction(elevation=180.0),
        "j2": junction(elevation=180.0),
        "j3": junction(0.5 * demand, elevation=180.0),
        "j4": junction(demand, elevation=180.0),
        "j5": junction(elevation=170.0),
    }
    holding = {
        "type": "pressure-sustaining",
        "from": "j2",
        "to": "j3",
        "time_constant": 5.0,
        "diameter": 0.25,
        "set_pressure": 101325.0 + WEIGHT * (head - 180),
        "loss_coefficient": 0.1,
    }
    links = {
        "p1": main("lake", "j1", 200.0, 0.25),
        "p2": main("j1", "j2", 200.0, 0.25),
        "holding": holding,
        "p3": main("j3", "j4", 200.0, 0.25),
        "p4": main("j4", "j5", 200.0, 0.25),
    }
    return scene(nodes, links, 10.0, {"rtol": 1e-6}, ["j4.head"], 1.0)


def faults_of(case: dict) -> list[tuple[str, str]]:
    with pytest.raises(CaseError) as caught:
        fvsolve.run(case)
    return [(fault.place, fault.message) for fault in caught.value.faults]


@pytest.mark.parametrize(
    "told", [sustained, lambda: restated(sustained())], ids=["as it is", "restated"]
)
def test_a_valve_that_cannot_sustain_its_pressure_is_named_with_the_isolated_nodes(told):
    """It was a fault for each junction, without the name of the valve."""
    ((place, text),) = faults_of(told())
    assert place in ("nodes.j3", "nodes.j4")
    assert "the demand of j3, j4 is 30 l/s in all" in text.replace("0.03 m3/s", "30 l/s")
    assert (
        "their part of the network, 3 nodes, is shut: holding (cannot sustain" in text
        and "at j2)" in text
    )
    assert "`required_pressure`" in text and "--pressure-dependent" in text


def test_the_remedy_works_the_demand_falls_to_zero_with_the_pressure():
    case = sustained()
    for name in ("j3", "j4"):
        case["nodes"][name] |= {"required_pressure": 101325.0 + 2e5, "minimum_pressure": 101325.0}
    run = fvsolve.run(case)
    assert run.ok and run["j4.head"][0] <= 180.0 + 1e-6


def test_a_set_pressure_equal_to_the_head_of_the_source_is_valid_and_a_higher_pressure_is_not():
    case = sustained(demand=0.0)
    assert fvsolve.run(case).ok  # without flow j2 has the head of the lake
    assert "above every source: lake has 250 m" in faults_of(sustained(0.0, 250.01))[0][1]


def test_two_groups_have_a_fault_each_with_their_own_links():
    nodes = {
        "lake": lake(50.0),
        "a": junction(elevation=0.0),
        "b": junction(1e-3, elevation=0.0),
        "c": junction(2e-3, elevation=0.0),
        "d": junction(elevation=0.0),
    }
    back = {"type": "check-valve", "from": "b", "to": "a", "diameter": 0.1, "loss_coefficient": 1.0}
    links = {
        "p": main("lake", "a", 100.0, 0.2),
        "v1": valve("a", "b", 1e-3, 0.0),
        "v2": valve("a", "c", 1e-3, 0.0),
        "q": main("c", "d", 10.0, 0.2),
        "v3": valve("a", "d", 1e-3, 0.0),
        "back": back,
    }
    found = dict(faults_of(scene(nodes, links, 1.0, {"rtol": 1e-6})))
    assert set(found) == {"nodes.b", "nodes.c"}
    assert "every path to it is shut: back (passes no reversed flow), v1;" in found["nodes.b"]
    assert "2 nodes, is shut: v2, v3;" in found["nodes.c"]


def test_an_empty_tank_is_a_reason():
    nodes = {
        "b": junction(1e-3, elevation=0.0),
        "tower-inlet": junction(elevation=0.0),
        "tower": tank(10.0, 1.0, elevation=20.0),
    }
    links = {"p": main("tower-inlet", "b", 100.0, 0.2), "gate": altitude("tower", empty_level=1.0)}
    ((place, text),) = faults_of(scene(nodes, links, 1.0, {"rtol": 1e-6}))
    assert place == "nodes.b" and "is shut: gate (the tank is empty); open a valve" in text


def test_an_inflow_is_offered_no_required_pressure():
    nodes = {"lake": reservoir(2e5, elevation=0.0), "b": junction(-1e-3, elevation=0.0)}
    ((_, text),) = faults_of(
        scene(nodes, {"v": valve("lake", "b", 1e-3, 0.0)}, 1.0, {"rtol": 1e-6})
    )
    assert (
        "the inflow here is 0.001 m3/s, but every path out is shut: v; open a valve, or use" in text
    )


def riser(length: float, low: float = 29.2608) -> dict:
    """Riser in whole feet: 4 ft between 100 and 96 ft, so that rise and length differ by rounding."""
    nodes = {
        "lake": lake(275.0),
        "a": junction(elevation=30.48),
        "b": junction(0.01, elevation=low),
    }
    return scene(
        nodes,
        {"p1": main("lake", "a", 152.4, 0.2), "p2": main("a", "b", length, 0.2)},
        1.0,
        {"rtol": 1e-6},
    )


@pytest.mark.parametrize("turned", [False, True])
def test_a_pipe_as_long_as_its_rise_is_vertical(turned):
    case = riser(1.2192)
    assert 30.48 - 29.2608 > 1.2192  # by rounding
    run = fvsolve.run(restated(case) if turned else case)
    assert run.ok
    for model in ("auto", "finite-volume"):
        text = {"links.p1.pipe_model": model, "links.p2.pipe_model": model}
        assert fvsolve.run(
            case, {**text, "links.p1.wave_speed": 1000.0, "links.p2.wave_speed": 1000.0}
        ).ok


def test_a_pipe_shorter_than_its_rise_by_more_than_rounding_is_refused():
    ((place, text),) = faults_of(riser(1.21919))
    assert (
        place == "links.p2.length" and "1.21919 m is too short: the ends differ by 1.2192 m" in text
    )
    assert text.endswith("expected at least that")
