"""Days of networks whose tanks run dry or full: heads as in EPANET, demands and leaks without supply."""

import numpy as np
import pytest
from reference.level_control import METHODS
from reference.quasi_steady import altitude, main, restated
from reference.scenes import junction, lake, scene, tank

import fvsolve
from fvsolve.studies import energy

HOUR, DAY = 3600.0, 86400.0
SECTION = 28.27433388  # of a tank of 6 m of diameter [m2]
PATTERN = (1.0, 1.0, 0.5, 0.5, 0.2, 1.5)  # of each hour, again and again
STARTS = [hour * HOUR for hour in range(24)]
# head at b by EPANET 2.2 where the lake alone supplies it, for each value of the pattern [m]
LAKE_ALONE = {1.0: 35.8806, 0.5: 42.4738, 0.2: 44.5371, 1.5: 25.6764}


def demand(flow: float) -> dict:
    """Demand of a day by the pattern; flow : mean demand [m3/s]"""
    return {
        "time": STARTS,
        "value": [flow * PATTERN[hour % 6] for hour in range(24)],
        "kind": "step",
    }


def check(start: str, end: str) -> dict:
    return {
        "type": "check-valve",
        "from": start,
        "to": end,
        "diameter": 0.2,
        "loss_coefficient": 1e-4,
    }


def day(nodes: dict, links: dict, numerics: dict | None = None) -> dict:
    probes = [f"{name}.level" for name, node in nodes.items() if node["type"] == "tank"] + [
        "b.head"
    ]
    return scene(
        nodes,
        links,
        DAY,
        numerics if "step" in (numerics or {}) else {"rtol": 1e-7, **(numerics or {})},
        probes,
        600.0,
    )


def behind_a_check_valve(numerics: dict | None = None) -> dict:
    """Town b beside a lake, and a tower that only gives: its pipe has a check valve at b."""
    nodes = {
        "a": junction(elevation=5.0),
        "b": junction(demand(6e-3), elevation=8.0),
        "lake": lake(45.0),
        "tower-inlet": junction(elevation=8.0),
        "tower": tank(SECTION, 3.0, elevation=40.0),
        "end": junction(elevation=8.0),
    }
    links = {
        "p1": main("lake", "a", 400.0, 0.25),
        "p2": main("a", "b", 900.0, 0.1),
        "p3-check": check("end", "b"),
        "p3": main("tower-inlet", "end", 300.0, 0.2, 120.0),
        "gate": altitude("tower", full_level=6.0, empty_level=2.0),
    }
    return day(nodes, links, numerics)


def events_of(run, name: str) -> list[tuple[float, str]]:
    return [
        (event["time"] / HOUR, event["what"])
        for event in run.summary["events"]
        if event["name"] == name
    ]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_a_dry_tower_behind_a_check_valve_gives_nothing_and_the_day_goes_on(method, turned):
    """At 8 h both valves shut and opened without end, by a pressure between them that no flow determines."""
    case = behind_a_check_valve({"method": method})
    run = fvsolve.run(restated(case) if turned else case)
    assert run.ok and run.reason == "finished"
    # EPANET: 5.2994
    assert events_of(run, "gate")[0] == (
        pytest.approx(5.3003, abs=1e-3),
        "shuts: the tank is empty",
    )
    assert len(run.summary["events"]) < 30
    dry = run.t > 5.31 * HOUR
    assert run["tower.level"][dry] == pytest.approx(2.0, abs=1e-7)
    within = dry & (run.t % HOUR > 0.0)
    heads = [LAKE_ALONE[PATTERN[int(t // HOUR) % 6]] for t in run.t[within]]
    assert run["b.head"][within] == pytest.approx(heads, abs=1e-3)
    assert not [note for note in run.warnings if note.kind == "unsupplied"]
    assert abs(run.ledger["mass"]["relative"]) < 1e-12


def test_the_same_day_with_given_steps():
    run = fvsolve.run(behind_a_check_valve({"method": "rk4", "step": 60.0}))
    assert run.ok and run["tower.level"][-1] == pytest.approx(2.0, abs=1e-7)


def test_a_full_tower_behind_a_check_valve_gives_nothing_back_and_takes_no_more():
    """It fills until 4.50 h; at 5 h the town draws so much that the tower could only give, which the check valve stops.

    Levels and heads of EPANET 2.2 at steps of 5 min.
    """
    nodes = {
        "a": junction(1e-3, elevation=5.0),
        "b": junction(demand(3e-3), elevation=8.0),
        "lake": lake(50.0),
        "end": junction(elevation=3.0),
        "tower-inlet": junction(elevation=3.0),
        "tower": tank(SECTION, 3.0, elevation=40.0),
    }
    links = {
        "p1": main("lake", "a", 400.0, 0.1),
        "p2": main("a", "b", 900.0, 0.1),
        "p3-check": check("b", "end"),
        "p3": main("end", "tower-inlet", 600.0, 0.2, 120.0),
        "gate": altitude("tower", full_level=4.0),
    }
    run = fvsolve.run(day(nodes, links))
    assert run.ok and len(run.summary["events"]) < 20
    assert events_of(run, "gate")[0] == (pytest.approx(4.503, abs=2e-3), "shuts: the tank is full")
    assert run["tower.level"][run.t > 4.6 * HOUR] == pytest.approx(4.0, abs=1e-7)


def supplied_by_tanks(numerics: dict | None = None, **levels: float) -> tuple[dict, float]:
    """(case of a town that only tanks supply, their usable volume [m3]); levels : name of a tank -> its level [m]"""
    nodes, links = {"b": junction(demand(6e-3), elevation=8.0)}, {}
    for k, (name, level) in enumerate(levels.items()):
        nodes |= {
            f"{name}-inlet": junction(elevation=30.0),
            name: tank(SECTION, level, elevation=40.0 - 2.0 * k),
        }
        links |= {
            f"{name}-main": main(f"{name}-inlet", "b", 300.0, 0.2),
            f"{name}-gate": altitude(name, empty_level=0),
        }
    return day(nodes, links, numerics), SECTION * sum(levels.values())


@pytest.mark.parametrize(
    "levels", [{"tower": 3.0}, {"tower": 3.0, "pond": 4.0}], ids=["one tank", "two tanks"]
)
@pytest.mark.parametrize("method", METHODS)
def test_a_town_with_dry_tanks_alone_is_not_supplied_and_the_run_names_the_tanks_and_the_volume(
    method, levels
):
    """The volume that lacks is the demand of the day less the water of the tanks."""
    case, stored = supplied_by_tanks({"method": method}, **levels)
    asked = 6e-3 * HOUR * 4.0 * sum(PATTERN)
    for told in (case, restated(case)):
        run = fvsolve.run(told)
        (note,) = [note for note in run.warnings if note.kind == "unsupplied"]
        (lost,) = events_of(run, "b")
        assert run.ok and run.reason == "finished" and lost[1] == "loses its supply"
        assert note.place == "nodes.b" and note.value == pytest.approx(asked - stored, rel=1e-6)
        assert all(f"{name}-gate (the tank is empty)" in note.text for name in levels)
        late = run.t > lost[0] * HOUR + 1.0
        assert all(run[f"{name}.level"][late] == pytest.approx(0.0, abs=1e-7) for name in levels)
        assert run["b.head"][late] == pytest.approx(8.0, abs=1e-9)  # ambient pressure at the town
        assert abs(run.ledger["mass"]["relative"]) < 1e-12 and run.ledger["mass"]["made_up"] < 1e-6
    ledger = energy(case)
    assert abs(ledger.remainder[-1]) < 1e-6 * ledger.throughput


def test_the_volume_of_a_town_in_other_units_and_a_demand_that_stops_by_itself():
    """The town draws 2 l/s for 10 h, its tank is dry after 20/36 of them: 16/36 of the demand lack, until 10 h."""
    case, _ = supplied_by_tanks(tower=1.0)
    case["nodes"]["tower"] = {"type": "tank", "area": "40 m2", "level": "1 m", "elevation": "40 m"}
    case["nodes"]["b"]["demand"] = {
        "time": ["0 h", "10 h"],
        "value": ["2 l/s", "0 l/s"],
        "kind": "step",
    }
    run = fvsolve.run(case)
    (note,) = [note for note in run.warnings if note.kind == "unsupplied"]
    assert note.value == pytest.approx(72.0 - 40.0, rel=1e-7)
    assert run.ok and "20000 s and 36000 s" in note.text.replace("5.55556 h", "20000 s").replace(
        "10 h", "36000 s"
    )


@pytest.mark.parametrize("turned", [False, True])
def test_a_lower_lake_behind_a_check_valve_takes_over_when_the_tower_is_dry(turned):
    """Between the dry tower and the lake the town has no pressure of its own: it falls until the check valve opens."""
    nodes = {
        "b": junction(6e-3, elevation=8.0),
        "lake": lake(35.0),
        "end": junction(elevation=8.0),
        "tower-inlet": junction(elevation=8.0),
        "tower": tank(SECTION, 3.0, elevation=40.0),
    }
    links = {
        "p1": main("lake", "end", 400.0, 0.25),
        "p1-check": check("end", "b"),
        "p3": main("tower-inlet", "b", 300.0, 0.2),
        "gate": altitude("tower", empty_level=0.0),
    }
    case = day(nodes, links)
    run = fvsolve.run(restated(case) if turned else case)
    assert run.ok and not [note for note in run.warnings if note.kind == "unsupplied"]
    empty = SECTION * 3.0 / 6e-3
    assert [time * HOUR for time, _ in events_of(run, "p1-check")] == [
        pytest.approx(empty, rel=1e-6)
    ]
    late = run.t > empty
    assert run["tower.level"][late] == pytest.approx(0.0, abs=1e-7)
    assert np.all((run["b.head"][late] > 34.0) & (run["b.head"][late] < 35.0))


def test_an_inflow_that_finds_no_way_out_still_stops_the_run():
    nodes = {
        "b": junction(-1e-3, elevation=8.0),
        "tower-inlet": junction(elevation=8.0),
        "tower": tank(SECTION, 3.0, elevation=40.0),
    }
    links = {"p3": main("tower-inlet", "b", 300.0, 0.2), "gate": altitude("tower", full_level=3.5)}
    run = fvsolve.run(day(nodes, links))
    assert not run.ok and run.reason.startswith(
        "stopped: the inflow at b finds no way out at t = 14137"
    )


# demand of the town while its tower is dry [m3]
LACKING = 3600.0 * (6e-3 * 6.736782 + 2e-3 * 8.673568)
# (level of the tower, head at b) by EPANET 2.2 at steps of 10 s, at hours [m]
BY_EPANET = {
    3.0: (0.3262, 40.2525),
    6.5: (0.0, 8.0),
    9.5: (0.0, 8.0),
    10.5: (2.0706, 44.3713),
    15.5: (5.0, 79.2521),
    16.5: (4.7963, 44.7640),
    20.5: (0.8365, 40.7628),
    23.5: (0.0, 8.0),
}


def supplied_by_a_tower(numerics: dict | None = None, pumped: bool = False) -> dict:
    """Town b, c of demands by pressure, and a tower that runs dry; pumped : a lake fills it from 10 h to 16 h"""
    nodes = {
        "b": junction(demand(6e-3), elevation=8.0, required_pressure="2 barg"),
        "c": junction(2e-3, elevation=12.0, required_pressure="2 barg"),
        "tower-inlet": junction(elevation=30.0),
        "tower": tank(SECTION, 3.0, elevation=40.0),
    }
    links = {
        "tower-main": main("tower-inlet", "b", 300.0, 0.2),
        "b-c": main("b", "c", 300.0, 0.15),
        "gate": altitude("tower", empty_level=0.0, full_level=5.0),
    }
    if pumped:
        nodes |= {"lake": lake(5.0), "delivery": junction(elevation=8.0)}
        links["rising"] = main("delivery", "b", 500.0, 0.2)
        links["pump"] = {
            "type": "pump",
            "from": "lake",
            "to": "delivery",
            "check_valve": True,
            "curve": {"flow": [0.0, 0.02, 0.04], "head": [75.0, 65.0, 35.0]},
            "speed": {"time": ["0 h", "10 h", "16 h"], "value": [0.0, 1.0, 0.0], "kind": "step"},
        }
    return day(nodes, links, numerics)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_demands_by_pressure_cease_with_the_water_of_their_tower_and_return_with_the_pump(
    method, turned
):
    """Outlets without flow do not determine a pressure: no Newton step was found, and the run stopped at 3.51 h."""
    case = supplied_by_a_tower({"method": method}, pumped=True)
    run = fvsolve.run(restated(case) if turned else case)
    (note,) = [note for note in run.warnings if note.kind == "unsupplied"]
    assert run.ok and run.reason == "finished" and len(run.summary["events"]) < 12
    assert [what for _, what in events_of(run, "gate")] == [
        "shuts: the tank is empty",
        "opens",
        "shuts: the tank is full",
        "opens",
        "shuts: the tank is empty",
    ]
    for hour, (level, head) in BY_EPANET.items():
        k = np.searchsorted(run.t, hour * HOUR)
        assert (run["tower.level"][k], run["b.head"][k]) == pytest.approx((level, head), abs=1e-3)
    assert (
        "gate (the tank is empty)" in note.text
        and "b, c" in note.text
        and "demand" not in note.place
    )
    assert note.value == pytest.approx(LACKING, rel=1e-5)
    assert abs(run.ledger["mass"]["relative"]) < 1e-11 and run.ledger["mass"]["made_up"] < 1e-6
    ledger = energy(case)
    assert abs(ledger.remainder[-1]) < 1e-6 * ledger.throughput


def with_leaks(case: dict) -> dict:
    """The same town with leaks in place of its demands."""
    for name, elevation in (("b", 8.0), ("c", 12.0)):
        case["nodes"][name] = junction(elevation=elevation)
        case["links"][f"leak-{name}"] = {"type": "leak", "from": name, "coefficient": 1e-5}
    return case


def with_a_hydrant(case: dict) -> dict:
    """The same town with a hydrant at b in place of its demands."""
    case["nodes"] |= {"b": junction(elevation=8.0), "c": junction(elevation=12.0)}
    case["links"]["hydrant"] = {
        "type": "hydrant",
        "from": "b",
        "flow": 5e-3,
        "residual_pressure": "1 barg",
    }
    return case


def with_fixed_demand(case: dict) -> dict:
    """The same town with a demand at c that does not depend on pressure, at a lower place than b."""
    case["nodes"]["c"] = junction(2e-3, elevation=6.0)
    return case


def under_the_law_log(case: dict) -> dict:
    return {**case, "fluid": {**case["fluid"], "law": "log"}}


@pytest.mark.parametrize(
    ("change", "head", "unsupplied"),
    [(with_leaks, 8.0, []), (with_a_hydrant, 8.0 + 1e5 / 9806.65, []), (with_fixed_demand, 6.0, ["b, c"]),
     (under_the_law_log, 8.0, ["b, c"])],
)  # fmt: skip
def test_outflow_from_a_dry_tower_drains_the_town_to_the_lowest_level_of_outflow(
    change, head, unsupplied
):
    case = change(supplied_by_a_tower())
    for told in (case, restated(case)):
        run = fvsolve.run(told)
        dry, _ = events_of(run, "gate")[0]
        late = run.t > dry * HOUR
        assert run.ok and len(run.summary["events"]) < 5
        assert run["tower.level"][late] == pytest.approx(0.0, abs=1e-7)
        assert run["b.head"][late] == pytest.approx(head, abs=1e-3)
        texts = [note.text for note in run.warnings if note.kind == "unsupplied"]
        assert [text.partition(":")[0] for text in texts] == unsupplied


def test_a_spring_behind_a_dry_tower_leaves_through_the_demands():
    """From 10 to 12 h a spring brings 1 l/s, which the demands take; before and after, nothing supplies them."""
    case = supplied_by_a_tower()
    spring = {"time": ["0 h", "10 h", "12 h"], "value": [0.0, 1e-3, 0.0], "kind": "step"}
    case["nodes"]["spring"] = {"type": "inflow", "flow": spring, "elevation": 8.0}
    case["links"]["spring-main"] = main("spring", "c", 50.0, 0.1)
    run = fvsolve.run(case)
    supplied = (run.t > 10.0 * HOUR) & (run.t < 12.0 * HOUR)
    dry = (run.t > 4.0 * HOUR) & ~supplied & (run.t != 10.0 * HOUR) & (run.t != 12.0 * HOUR)
    (note,) = [note for note in run.warnings if note.kind == "unsupplied"]
    assert run.ok and np.all(run["b.head"][supplied] > 8.1)
    assert run["b.head"][dry] == pytest.approx(8.0, abs=1e-9)
    asked = HOUR * (6e-3 * 4.0 * sum(PATTERN) + 2e-3 * 24.0)
    assert note.value == pytest.approx(asked - 3.0 * SECTION - 7.2, rel=1e-7)
