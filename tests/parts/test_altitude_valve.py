"""Altitude valves: a full tank takes no more, an empty one gives no more, at the times of hand-written equations."""

import math

import numpy as np
import pytest
from reference.level_control import METHODS
from reference.scenes import GRAVITY, RHO, WATER, area, junction, lake, scene, step, tank, valve

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.studies import energy

HOLE = 0.01
SUPPLY = {"time": [0.0, 400.0], "value": [12.0, 12.0]}


def altitude(start="town", end="tower", **more):
    return {
        "type": "altitude-valve",
        "from": start,
        "to": end,
        "area": HOLE / 0.61,
        "discharge_coefficient": 0.61,
        **more,
    }


def filling(numerics, head=12.0, level=2.0, end=400.0, **levels):
    nodes = {"lake": lake(head, elevation=0.0), "tower": tank(5.0, level, elevation=0.0)}
    links = {"gate": altitude("lake", "tower", **levels)}
    return scene(
        nodes,
        links,
        end,
        {"rtol": 1e-10, **numerics},
        ["tower.level", "gate.flow", "gate.opening"],
        5.0,
    )


def time_to_fill(supply, start, full):
    """Time from level `start` to `full` [s]: the root of the remaining head falls at a constant rate."""
    rate = HOLE * math.sqrt(2.0 * GRAVITY) / 5.0 / 2.0
    return (math.sqrt(supply - start) - math.sqrt(supply - full)) / rate


def times_of(run):
    return [(event["name"], event["what"]) for event in run.summary["events"]], [
        event["time"] for event in run.summary["events"]
    ]


@pytest.mark.parametrize("method", METHODS)
def test_a_full_tank_takes_no_more(method):
    run = fvsolve.run(filling({"method": method}, full_level=4.0))
    names, times = times_of(run)
    assert run.ok and names == [("gate", "shuts: the tank is full")]
    assert times == pytest.approx([time_to_fill(12.0, 2.0, 4.0)], abs=1e-7)
    assert run["tower.level"][-1] == pytest.approx(4.0, abs=1e-9) and run["gate.flow"][-1] == 0.0
    assert list(np.unique(run["gate.opening"])) == [0.0, 1.0]


@pytest.mark.parametrize("method", METHODS)
def test_an_empty_tank_gives_no_more(method):
    run = fvsolve.run(
        filling({"method": method}, head=0.5, level=4.0, empty_level=1.5, full_level=9.0)
    )
    names, times = times_of(run)
    assert names == [("gate", "shuts: the tank is empty")]
    rate = HOLE * math.sqrt(2.0 * GRAVITY) / 5.0 / 2.0
    assert times == pytest.approx([(math.sqrt(3.5) - 1.0) / rate], abs=1e-7)
    assert run["tower.level"][-1] == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_it_opens_as_soon_as_the_pressure_outside_allows(law):
    """Full at once; from 300 s on the lake is below the tank, which empties by Torricelli, and full again never."""
    case = filling({"method": "dormand-prince"}, step(300.0, 12.0, 1.0), 3.9, 900.0, full_level=4.0)
    case["fluid"]["law"] = law
    run = fvsolve.run(case)
    names, times = times_of(run)
    assert [what for _, what in names] == ["shuts: the tank is full", "opens"]
    close = 1e-6 if law == "linear" else 1e-2
    assert times == pytest.approx([time_to_fill(12.0, 3.9, 4.0), 300.0], abs=close)
    rate = HOLE * math.sqrt(2.0 * GRAVITY) / 5.0 / 2.0
    root = np.maximum(math.sqrt(3.0) - rate * np.maximum(run.t - 300.0, 0.0), 0.0)
    late = run.t > 310.0
    assert run["tower.level"][late] == pytest.approx(1.0 + root[late] ** 2, abs=2e-4)


def test_a_town_between_a_full_tower_and_a_pumped_main_is_supplied_past_the_tower():
    """While the tower is full the town draws from the main alone; when it draws more, the tower gives the rest."""
    nodes = {
        "lake": lake(12.0, elevation=0.0),
        "town": junction(step(200.0, 0.01, 0.15), elevation=0.0),
        "tower": tank(5.0, 3.99, elevation=0.0),
    }
    links = {"main": valve("lake", "town", HOLE), "gate": altitude(full_level=4.0, empty_level=3.0)}
    probes = ["tower.level", "gate.flow", "main.flow", "town.head", "gate.opening"]
    case = scene(nodes, links, 400.0, {"method": "dormand-prince", "rtol": 1e-10}, probes, 5.0)
    run = fvsolve.run(case)
    shut = (run.t > 20.0) & (run.t < 199.0)
    assert run["gate.flow"][shut] == pytest.approx(0.0, abs=0.0) and run["main.flow"][
        shut
    ] == pytest.approx(0.01)
    assert run["town.head"][shut] == pytest.approx(
        12.0 - (0.01 / HOLE) ** 2 / (2.0 * GRAVITY), rel=1e-9
    )
    drawn = (run.t > 201.0) & (run["gate.opening"] == 1.0)
    assert run["gate.flow"][drawn] + 0.15 == pytest.approx(run["main.flow"][drawn], abs=1e-9)
    assert np.all(run["gate.flow"][drawn] < 0.0) and drawn.any()
    ledger = energy(case)
    assert abs(ledger.remainder[-1]) < 1e-9 * ledger.throughput


def test_a_tank_that_starts_full_starts_shut():
    run = fvsolve.run(filling({"method": "dormand-prince"}, 12.0, 4.0, full_level=4.0))
    assert np.ptp(run["tower.level"]) == 0.0 and np.all(run["gate.flow"] == 0.0)
    run = fvsolve.run(filling({"method": "dormand-prince"}, 3.0, 4.0, full_level=4.0))
    assert run["gate.flow"][0] == pytest.approx(-HOLE * math.sqrt(2.0 * GRAVITY), rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_at_rest_no_bit_changes(method):
    run = fvsolve.run(filling({"method": method}, 3.0, 3.0, full_level=4.0, empty_level=1.0))
    assert np.ptp(run["tower.level"]) == 0.0 and not run.summary["events"]


FAULTS = {
    "no level": (altitude("lake", "tower"), "links.gate", "level is missing"),
    "no tank": (altitude("tower", "lake", full_level=4.0), "links.gate.to", "not a tank"),
    "crossed": (
        altitude("lake", "tower", full_level=1.0, empty_level=1.5),
        "links.gate.full_level",
        "not above",
    ),
    "too full": (
        altitude("lake", "tower", full_level=1.5),
        "links.gate.full_level",
        "above `full_level`",
    ),
    "too empty": (
        altitude("lake", "tower", empty_level=2.5),
        "links.gate.empty_level",
        "below `empty_level`",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_names_its_key_and_its_remedy(name):
    link, place, text = FAULTS[name]
    with pytest.raises(CaseError) as caught:
        fvsolve.load({**filling({}, full_level=4.0), "links": {"gate": link}})
    assert (caught.value.faults[0].place, text in caught.value.faults[0].message) == (place, True)


def test_the_loss_of_an_open_valve_is_its_size():
    size = {"diameter": 0.2, "loss_coefficient": 2.0}
    case = filling({}, full_level=9.0)
    case["links"]["gate"] = {
        "type": "altitude-valve",
        "from": "lake",
        "to": "tower",
        "full_level": 9.0,
        **size,
    }
    run = fvsolve.run(case)
    assert run["gate.flow"][0] == pytest.approx(
        area(0.2) * math.sqrt(2.0 * GRAVITY * 10.0 / 2.0), rel=1e-9
    )
    assert RHO == WATER["density"]
