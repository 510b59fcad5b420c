"""EPANET over a day: levels of tanks and switches agree with EPANET 2.2 at a hydraulic step of 2 s."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import fvsolve

wntr = pytest.importorskip("wntr", reason="WNTR, the extra `epanet`, is not installed")

from fvsolve.exchange.epanet import import_network, toolkit_run  # noqa: E402
from fvsolve.exchange.epanet.self_check import check_start  # noqa: E402

SHIPPED = Path(wntr.__file__).parent / "library" / "networks"
SAME, SOON = 1e-3, 2.0  # levels [m] and times of switches [s] agree to within these
SI = {"output.units": {}}
SWITCHED = {"Net1": ["9"], "Net2": [], "Net3": ["10", "330", "335"]}


def ours(imported, tmp_path, **settings):
    path = tmp_path / "day.toml"
    path.write_text(imported.text)
    run = fvsolve.run(fvsolve.load(path, {**SI, **settings}))
    assert run.ok
    return run


def blocks_of(run):
    """Switches of relays and latches of a run : list of (time [s], name, True if on)."""
    return sorted(
        (event["time"], event["name"].removeprefix("controls."), event["what"] == "turns on")
        for event in run.summary["events"]
        if event["name"].startswith("controls.") and event["what"].startswith("turns")
    )


def in_order(switches):
    """Switches in the order of time; those of about one time in the order of names."""
    return sorted(switches, key=lambda item: (round(item[0] / 60.0), item[1]))


def agree(path, imported, run, links, step=2, scheduled=()):
    """Assert that levels and switches agree with EPANET; scheduled : links that switch by the time alone"""
    network = wntr.network.WaterNetworkModel(str(path))
    day = toolkit_run.run(path, list(network.tank_name_list), list(links), step, round(run.t[-1]))
    for tank in network.tank_name_list:
        place = imported.nodes[tank]
        level = run[f"nodes.{place}.level"]
        assert level == pytest.approx(day.level(tank, run.t), abs=SAME), tank
        assert np.ptp(level) > 0.1  # it moves
    found = in_order(
        item for item in blocks_of(run) if item[1] in [imported.links[link] for link in links]
    )
    known = in_order(item for item in day.switches if item[1] not in scheduled)
    assert [item[1:] for item in found] == [(imported.links[link], on) for _, link, on in known]
    assert [item[0] for item in found] == pytest.approx([item[0] for item in known], abs=SOON)
    return day


@pytest.mark.parametrize("name", SWITCHED)
def test_the_networks_of_epanet_have_its_levels_and_switches_all_day(name, tmp_path):
    path = SHIPPED / f"{name}.inp"
    imported = import_network(path, day=True)
    run = ours(imported, tmp_path)
    known = (
        "opens and shuts",
        "no elevation of a reservoir",
        "the chemical",
        "water age",
        "water trace",
    )
    assert run.t[-1] == 86400.0 and all(
        any(one in text for one in known) for text, _ in imported.notes
    )
    day = agree(path, imported, run, SWITCHED[name], scheduled=("10", "335"))
    # the pump and its bypass switch at one time, the pump by the negation of the relay
    if name == "Net3":
        both = [[time for time, link, _ in day.switches if link == own] for own in ("330", "335")]
        assert both[0] == both[1]
    assert len(day.switches) == {"Net1": 2, "Net2": 0, "Net3": 6}[name]


def test_the_method_does_not_matter(tmp_path):
    imported = import_network(SHIPPED / "Net1.inp", day=True)
    found = [
        ours(
            imported,
            tmp_path,
            **{"numerics.method": method, "numerics.rtol": 1e-9, "numerics.end": "13 h"},
        )
        for method in ("dormand-prince", "radau-iia-5", "rodas-5p")
    ]
    for run in found[1:]:
        assert run["nodes.2.level"] == pytest.approx(found[0]["nodes.2.level"], abs=1e-6)
        assert blocks_of(run)[0][0] == pytest.approx(blocks_of(found[0])[0][0], abs=1e-4)


# a network of its own for every control and rule ---------------------------------------------------------------------

TOWN = """[TITLE]
A pump, a tower, a town and a pond
[JUNCTIONS]
a 5 0
b 8 6 day
c 6 {drawn} night
[RESERVOIRS]
lake 10
[TANKS]
tower 40 3 1 6 24 0 {curve}
pond 30 2 0.5 4 {width} 0
[PIPES]
p1 a b 400 250 110 0 Open
p2 b tower 300 200 120 2 Open
p3 b c 350 150 100 0 {status}
p4 c pond 200 150 115 0 Open
p5 a c 600 120 100 5 {valve}
[PUMPS]
lift lake a HEAD 1 {speed}
[CURVES]
1 30 45
{points}
[PATTERNS]
day 0.6 0.8 1.4 1.2
night 1.5 0.2 0.5
slow 1.0 0.95 1.05
pauses 1.0 0.0 0.9
[CONTROLS]
{controls}
[RULES]
{rules}
{stated}
[TIMES]
DURATION 24:00
HYDRAULIC TIMESTEP 1:00
PATTERN TIMESTEP 1:30
PATTERN START 0:30
START CLOCKTIME 5 AM
[OPTIONS]
UNITS LPS
HEADLOSS H-W
[END]
"""


def town(tmp_path, **keys):
    path = tmp_path / "town.inp"
    keys["points"] = "v 0 0\nv 3 1200\nv 6 2900" if "curve" in keys else ""
    given = {
        "curve": "",
        "status": "Open",
        "valve": "Open",
        "speed": "",
        "controls": "",
        "rules": "",
        "stated": "",
        "width": 12,
        "drawn": 4,
    }
    path.write_text(TOWN.format(**given | keys))
    return path, import_network(path, day=True)


LEVELS = "LINK lift CLOSED IF NODE tower ABOVE 4.5\nLINK lift OPEN IF NODE tower BELOW 2.5"
RULES = """RULE 1
IF TANK tower LEVEL >= 4.2
OR TANK pond LEVEL >= 3.9
THEN PUMP lift STATUS IS CLOSED
RULE 2
IF TANK tower LEVEL <= 2.6
AND SYSTEM CLOCKTIME >= 6:00 AM
THEN PUMP lift STATUS IS OPEN
RULE 3
IF SYSTEM TIME > 12
AND SYSTEM TIME < 15
THEN PIPE p3 STATUS IS CLOSED
ELSE PIPE p3 STATUS IS OPEN"""
# Levels in windows of two hours of the clock; the last is until 24:00, which EPANET's clock never reaches
WINDOWS = "".join(
    f"RULE {name}-{hour}\nIF SYSTEM CLOCKTIME >= {hour}\nAND SYSTEM CLOCKTIME < {hour + 2}\n"
    f"AND TANK tower LEVEL {relation} {level + 0.05 * (hour % 6):.2f}\nTHEN PUMP lift STATUS IS {action}\n"
    f"PRIORITY {priority}\n"
    for hour in range(0, 24, 2)
    for name, relation, level, action, priority in (
        ("on", "BELOW", 2.6, "OPEN", 1),
        ("off", "ABOVE", 3.4, "CLOSED", 5),
    )
)
CASES = {
    "levels": ({"controls": LEVELS}, ["lift"], ["relay"]),
    "times": (
        {
            "controls": "LINK p3 CLOSED AT TIME 2:15\nLINK p3 OPEN AT TIME 7.5\n"
            "LINK p5 CLOSED AT CLOCKTIME 1 PM\nLINK p5 OPEN AT CLOCKTIME 9:30 PM"
        },
        ["p3", "p5"],
        [],
    ),
    "mixed": (
        {"controls": "LINK lift CLOSED IF NODE tower ABOVE 4.2\nLINK lift OPEN AT TIME 9"},
        ["lift"],
        ["latch", "function", "function"],
    ),
    "rules": ({"rules": RULES}, ["lift", "p3"], ["latch", "function", "function"]),
    "windows": (
        {"rules": WINDOWS, "drawn": 10},
        ["lift"],
        ["latch", "function", "function", "pi", "pi"],
    ),
    "alternating windows": (
        {"rules": re.sub("PRIORITY.*\n", "", WINDOWS), "drawn": 10},
        ["lift"],
        ["latch", "function", "function", "pi", "pi"],
    ),
    "until 24:00": (
        {
            "rules": "RULE 1\nIF SYSTEM CLOCKTIME >= 22\nAND SYSTEM CLOCKTIME < 24\n"
            "THEN PUMP lift STATUS IS CLOSED\nELSE PUMP lift STATUS IS OPEN"
        },
        ["lift"],
        [],
    ),
    "speed": (
        {
            "controls": LEVELS.replace("CLOSED", "0.8").replace("OPEN", "1.05"),
            "speed": "SPEED 1.05",
        },
        [],
        ["relay"],
    ),
    "shut": ({"status": "Closed", "controls": LEVELS}, ["lift"], ["relay"]),
    "check valve": ({"valve": "CV", "controls": LEVELS}, ["lift"], ["relay"]),
    "pattern of speed": ({"speed": "PATTERN slow"}, [], []),
    "pattern with pauses": ({"speed": "PATTERN pauses"}, [], []),
    "pattern and status": ({"speed": "PATTERN pauses", "stated": "[STATUS]\nlift Closed"}, [], []),
    "pattern and a rule": ({"speed": "PATTERN slow", "rules": RULES}, ["p3"], []),
    "volume curve": ({"curve": "v", "controls": LEVELS}, ["lift"], ["relay"]),
    "full and empty": ({"width": 4, "drawn": 30}, [], []),
}


@pytest.mark.parametrize("name", CASES)
def test_controls_rules_and_tanks_act_as_in_epanet(name, tmp_path):
    keys, links, kinds = CASES[name]
    path, imported = town(tmp_path, **keys)
    blocks = tomllib.loads(imported.text).get("controls", {})
    assert sorted(block["type"] for block in blocks.values()) == sorted(kinds)
    run = ours(imported, tmp_path)
    scheduled = [link for link in links if imported.links[link] not in blocks]
    day = agree(path, imported, run, links, scheduled=scheduled)
    assert len(day.switches) >= len(links)
    if name == "full and empty":
        shut = [
            event["what"] for event in run.summary["events"] if event["name"] == "pond-altitude"
        ]
        assert "shuts: the tank is full" in shut and "opens" in shut


BOTH_SIDES = """RULE 1
IF TANK tower LEVEL ABOVE 3.5
THEN PUMP lift STATUS IS CLOSED
RULE 2
IF TANK tower LEVEL BELOW 3.5
THEN PUMP lift STATUS IS OPEN"""


@pytest.mark.parametrize(
    "rules", [BOTH_SIDES, BOTH_SIDES.partition("\nRULE 2")[0] + "\nELSE PUMP lift STATUS IS OPEN"]
)
def test_a_link_rests_between_actions_that_hold_on_both_sides_of_a_common_level(rules, tmp_path):
    """The pump would switch without end at 3.5 m; in EPANET at a step of 10 s it switches at almost each step."""
    path, imported = town(tmp_path, rules=rules)
    blocks = tomllib.loads(imported.text)["controls"]
    assert sorted(block["type"] for block in blocks.values()) == [
        "function",
        "function",
        "latch",
        "timer",
    ]
    assert any(
        "the link rests after each switch" in cause and "lift" in cause for cause in imported.causes
    )
    run = ours(imported, tmp_path, **{"numerics.end": "6 h"})
    switches = [time for time, name, _ in blocks_of(run) if name == imported.links["lift"]]
    assert len(switches) > 20 and np.diff(switches).min() >= 60.0 - 1e-6
    day = toolkit_run.run(path, ["tower"], ["lift"], 10, 21600)
    level = run[f"nodes.{imported.nodes['tower']}.level"]
    assert level == pytest.approx(day.level("tower", run.t), abs=0.01)
    assert level[0] < 3.4 and level[-1] == pytest.approx(3.5, abs=0.01)


def test_a_pump_rests_between_speeds_on_both_sides_of_a_common_level(tmp_path):
    """The level stays where the two speeds alternate, as in EPANET at a step of 10 s."""
    controls = "LINK lift 0.7 IF NODE tower ABOVE 3.5\nLINK lift 1.05 IF NODE tower BELOW 3.5"
    path, imported = town(tmp_path, controls=controls, speed="SPEED 1.05")
    assert any(
        "the link rests after each switch" in cause and "lift" in cause for cause in imported.causes
    )
    run = ours(imported, tmp_path, **{"numerics.end": "6 h"})
    times = [time for time, name, _ in blocks_of(run) if name.endswith("-state")]
    assert len(times) > 20 and np.diff(times).min() >= 60.0 - 1e-6
    day = toolkit_run.run(path, ["tower"], [], 10, 21600)
    assert run[f"nodes.{imported.nodes['tower']}.level"] == pytest.approx(
        day.level("tower", run.t), abs=0.01
    )


def test_features_without_a_key_are_listed_with_their_number(tmp_path):
    rules = (
        "RULE 7\nIF SYSTEM DEMAND ABOVE 20\nTHEN PUMP lift STATUS IS OPEN\n"
        "RULE 8\nIF TANK tower FILLTIME ABOVE 5\nTHEN PIPE p5 STATUS IS CLOSED"
    )
    _, imported = town(tmp_path, rules=rules)
    found = {
        name: text
        for text, names in imported.notes
        for name in names
        if text.startswith("not imported")
    }
    assert set(found) == {"rule 7", "rule 8"}
    assert (
        "demand of the whole system" in found["rule 7"] and "filltime of a tank" in found["rule 8"]
    )
    assert "# - not imported, because it acts by the" in imported.text and "rule 7" in imported.text
    assert len(imported.causes) == 2


def test_patterns_are_signals_and_the_command_writes_the_case(tmp_path, fvs):
    path, imported = town(tmp_path)
    case = tomllib.loads(imported.text)
    assert case["nodes"]["b"]["demand"] == {"signal": "pattern-day", "factor": "6 l/s"}
    assert (
        case["signals"]["pattern-day"]["time"][:3] == [0, 3600, 9000]
        and case["signals"]["pattern-day"]["kind"] == "step"
    )
    assert case["numerics"]["pipe_model"] == "quasi-steady" and case["numerics"]["end"] == "24 h"
    assert all("wave_speed" not in link for link in case["links"].values())
    code, *_ = fvs("import", path, tmp_path / "town.toml", "--day")
    assert code == 0 and (tmp_path / "town.toml").read_text() == imported.text


def test_a_rule_that_holds_at_the_start_explains_the_start_alone(tmp_path):
    rules = "RULE 1\nIF TANK tower LEVEL BELOW 4\nTHEN PUMP lift STATUS IS CLOSED"
    path, imported = town(tmp_path, rules=rules)
    start = check_start(imported, fvsolve.load(tomllib.loads(imported.text)))
    assert start.agrees and any(item.above for item in start.compared)
    assert "a rule that holds at the start" in start.causes[0] and "lift" in start.causes[0]
    assert imported.causes == []  # the day must agree
    agree(path, imported, ours(imported, tmp_path, **{"numerics.end": "3 h"}), [])


def test_demands_of_several_patterns_are_sums_of_signals(tmp_path):
    path, _ = town(tmp_path)
    text = path.read_text().replace(
        "[RESERVOIRS]", "[DEMANDS]\nb 4 day\nb 2 night\nb 1 night\nc 3 night\n[RESERVOIRS]"
    )
    path.write_text(text)
    imported = import_network(path, day=True)
    factors = [
        {"signal": "pattern-day", "factor": "4 l/s"},
        {"signal": "pattern-night", "factor": "3 l/s"},
    ]
    assert tomllib.loads(imported.text)["nodes"]["b"]["demand"] == {"sum": factors}
    agree(path, imported, ours(imported, tmp_path), [])
