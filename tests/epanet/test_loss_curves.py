"""EPANET's general purpose and pressure breaker valves: their losses follow the flow, at the start and over a day."""

import math
import tomllib

import numpy as np
import pytest

pytest.importorskip("epanet", reason="EPANET's toolkit, the extra `epanet`, is not installed")

from fvsolve.case import load  # noqa: E402
from fvsolve.core.model.build import build  # noqa: E402
from fvsolve.exchange.epanet import import_network, network_text, part_tables, self_check  # noqa: E402
from fvsolve.exchange.epanet.network_file import read_network, solution_at  # noqa: E402

SAME = 1e-3  # heads [m]
TOWN = """[TITLE]
A town behind a valve
[JUNCTIONS]
a 5 0
b 8 6 day
c 6 4 night
d 5 3 day
[RESERVOIRS]
lake 70
[TANKS]
tower 25 3 1 6 25 0
[PIPES]
p1 lake a 400 200 110 0 Open
p2 b c 300 150 120 2 Open
p3 c tower 500 150 110 0 Open
p4 c d 350 150 100 0 Open
[VALVES]
v a b 150 {valve}
[CURVES]
{points}
h 1 1
[PATTERNS]
day 0.6 0.8 1.4 1.2 0.3
night 1.5 0.2 0.5
[STATUS]
{status}
[CONTROLS]
{controls}
[TIMES]
DURATION 24:00
HYDRAULIC TIMESTEP 1:00
PATTERN TIMESTEP 1:30
[OPTIONS]
UNITS LPS
HEADLOSS H-W
ACCURACY 0.000001
{options}
[END]
"""
POINTS = "g 0 0\ng 5 2\ng 12 9\ng 20 24"


def town(tmp_path, valve="GPV g 0", points=POINTS, **keys):
    given = {"status": "", "controls": "", "options": ""} | keys
    path = tmp_path / "town.inp"
    path.write_text(TOWN.format(valve=valve, points=points, **given))
    return path


def day_of(path, tmp_path):
    """(imported day, its comparison with EPANET at steps of 10 s)."""
    imported = import_network(path, day=True)
    case = tmp_path / "day.toml"
    case.write_text(imported.text)
    return imported, self_check.check_day(imported, case)


def start_of(path, tmp_path, hour=0.0):
    """(imported start, its comparison with EPANET)."""
    imported = import_network(path, hour)
    case = tmp_path / "start.toml"
    case.write_text(imported.text)
    return imported, self_check.check_start(imported, load(case))


def differences(found):
    return {item.quantity: item.difference for item in found.compared}


NETWORKS = {
    "GPV": {},
    "GPV beyond its last point": {"points": "g 0 0\ng 1 0.5\ng 3 2"},
    "GPV with a loss at no flow": {"points": "g 2 3\ng 20 12"},
    "GPV with constant loss": {"points": "g 0 4\ng 20 4"},
    "PBV": {"valve": "PBV 10 0"},
    "PBV with a smaller minor loss": {"valve": "PBV 10 4"},
    "PBV with a greater minor loss": {"valve": "PBV 2 400"},
    "PBV with a greater minor loss at times": {"valve": "PBV 10 40"},
    "PBV without setting": {"valve": "PBV 0 6"},
    "PBV of a heavy liquid": {"valve": "PBV 10 0", "options": "SPECIFIC GRAVITY 1.2"},
    "PBV in kPa": {"valve": "PBV 100 0", "options": "PRESSURE KPA"},
    "PBV fixed open": {"valve": "PBV 10 5", "status": "v OPEN"},
    "GPV that opens and shuts": {"controls": "LINK v CLOSED AT TIME 5\nLINK v OPEN AT TIME 9"},
}


@pytest.mark.parametrize("name", NETWORKS)
def test_heads_and_levels_are_those_of_epanet_all_day(name, tmp_path):
    path = town(tmp_path, **NETWORKS[name])
    imported, found = day_of(path, tmp_path)
    assert not found.fault and not imported.causes, (found.fault, imported.causes)
    greatest = differences(found)
    assert greatest["heads"] < SAME and greatest["levels"] < SAME, list(found.lines())
    kind = tomllib.loads(imported.text)["links"]["v"]["type"]
    plain = ("without setting", "fixed")
    assert kind == ("valve" if any(word in name for word in plain) else "loss-curve")


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("hour", [0, 4, 10])
def test_heads_at_an_hour_are_those_of_epanet(name, hour, tmp_path):
    imported, found = start_of(town(tmp_path, **NETWORKS[name]), tmp_path, hour)
    assert not found.fault and not imported.causes
    assert differences(found)["heads"] < SAME, list(found.lines())


CURVES = {
    "from no flow": (
        [[0.0, 0.0], [1.0, 2.0], [2.0, 5.0]],
        [(0.0, 0.0), (1.0, 2.0), (2.0, 5.0)],
        False,
    ),
    "first point on the line to no flow": (
        [[1.0, 2.0], [2.0, 4.0]],
        [(0.0, 0.0), (1.0, 2.0), (2.0, 4.0)],
        False,
    ),
    "loss at no flow": ([[1.0, 2.0], [2.0, 3.0]], [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)], False),
    "negative at small flows": (
        [[1.0, 1.0], [2.0, 5.0]],
        [(0.0, 0.0), (0.75, 0.0), (1.0, 1.0), (2.0, 5.0)],
        True,
    ),
    "negative points": (
        [[0.0, -2.0], [1.0, -1.0], [2.0, 3.0]],
        [(0.0, 0.0), (1.25, 0.0), (2.0, 3.0)],
        True,
    ),
    "no loss at first": (
        [[0.0, 0.0], [1.0, 0.0], [2.0, 3.0]],
        [(0.0, 0.0), (1.0, 0.0), (2.0, 3.0)],
        False,
    ),
    "negative flows": ([[-2.0, 0.0], [-1.0, 1.0], [1.0, 2.0]], [(0.0, 1.5), (1.0, 2.0)], False),
    "falling": ([[0.0, 3.0], [1.0, 2.0]], [], False),
    "no loss": ([[0.0, 0.0], [1.0, 0.0]], [], False),
    "one point": ([[1.0, 2.0]], [], False),
}


@pytest.mark.parametrize("name", CURVES)
def test_the_points_of_a_curve_are_those_of_epanets_lines(name):
    curve, points, negative = CURVES[name]
    assert part_tables.general_losses(curve) == (points, negative)


@pytest.mark.parametrize(
    "setting, loss, most", [(2.0, 400.0, 60.0), (20.0, 3.0, 60.0), (20.0, 3.0, 10.0)]
)
def test_points_of_a_pressure_breaker_lie_near_its_greater_loss(setting, loss, most):
    points = part_tables.breaker_losses(setting, loss, 0.15, most)
    square = part_tables.MINOR_LOSS * loss / 0.15**4
    assert points[0] == (0.0, setting) and len(points) <= part_tables.MOST_POINTS + 2
    assert points[1] == pytest.approx((math.sqrt(setting / square), setting))
    assert points[-1][1] >= max(most, setting)
    flows, losses = zip(*points, strict=True)
    between = np.linspace(0.0, math.sqrt(max(most, setting) / square), 10001)
    exact = np.maximum(setting, square * between**2)
    assert np.interp(between, flows, losses) == pytest.approx(
        exact, abs=1.01 * part_tables.LINE_ERROR
    )


def import_notes(imported):
    return {text: names for text, names in imported.notes if "elevation of a reservoir" not in text}


def test_losses_that_a_link_cannot_have_are_named(tmp_path):
    imported, found = start_of(town(tmp_path, points="g 5 1\ng 20 24"), tmp_path)
    (note,) = import_notes(imported)
    assert "negative loss at small flows" in note and note in imported.causes[0]
    assert differences(found)["heads"] < SAME  # at the present flow
    imported, found = start_of(town(tmp_path, points="g 0 9\ng 20 4"), tmp_path)
    (note,) = import_notes(imported)
    assert "falls as the flow rises" in note and imported.causes
    assert tomllib.loads(imported.text)["links"]["v"]["type"] == "valve"


def test_a_negative_flow_through_a_pressure_breaker_during_the_day_is_named(tmp_path):
    """The tower feeds the junction before the valve once its demand exceeds what the lake supplies."""
    path = town(tmp_path, "PBV 10 0")
    path.write_text(
        path.read_text().replace("a 5 0", "a 5 25 late").replace("day 0.6", "late 0 0 9 9\nday 0.6")
    )
    imported, found = day_of(path, tmp_path)
    assert not imported.causes and found.agrees
    assert found.causes == ["PBV raises the head along a negative flow, which a loss cannot do (v)"]
    assert differences(found)["heads"] > 1.0


def test_settings_by_controls_are_listed(tmp_path):
    path = town(tmp_path, "PBV 10 0", controls="LINK v 12 IF NODE tower BELOW 2.5")
    imported = import_network(path, day=True)
    assert import_notes(imported) == {
        "not imported, because it sets a valve of this kind": ["control 1"]
    }


def test_a_general_valve_has_its_points_and_no_note(tmp_path):
    for day in (False, True):
        imported = import_network(town(tmp_path), day=day)
        loss = tomllib.loads(imported.text)["links"]["v"]["loss"]
        assert loss == {
            "flow": ["0 l/s", "5 l/s", "12 l/s", "20 l/s"],
            "head": ["0 m", "2 m", "9 m", "24 m"],
        }
        assert not import_notes(imported)


@pytest.mark.parametrize(
    "name", ["GPV", "GPV with a loss at no flow", "PBV", "PBV with a greater minor loss"]
)
def test_a_loss_curve_is_exported_as_a_general_valve(name, tmp_path):
    imported = import_network(town(tmp_path, **NETWORKS[name]))
    case = load(tomllib.loads(imported.text))
    text, notes = network_text(case)
    back = tmp_path / "back.inp"
    back.write_text(text)
    network = read_network(back)
    assert not notes and network.links["v"].kind == "GPV"
    nodes, solution = build(case).checks["nodes"], solution_at(network, 0.0).solutions[0]
    for place, head in solution.head.items():
        assert nodes[place]["head"] == pytest.approx(head, abs=SAME), place


def test_drops_are_exported_as_heads(tmp_path):
    table = tomllib.loads(import_network(town(tmp_path)).text)
    head = [0.0, 2.0, 9.0, 24.0]
    weight = load(table).properties.density * load(table).gravity
    table["links"]["v"]["loss"] = {
        "flow": [0.0, 0.005, 0.012, 0.02],
        "drop": [weight * item for item in head],
    }
    back = tmp_path / "back.inp"
    back.write_text(network_text(load(table))[0])
    assert [loss for _, loss in read_network(back).links["v"].curve] == pytest.approx(head)


def test_a_setting_that_no_control_changes_back_stays(tmp_path):
    path = town(tmp_path, "PRV 12 0", controls="LINK v 35 IF NODE tower BELOW 2.5")
    imported, found = day_of(path, tmp_path)
    assert not found.fault and not imported.causes
    blocks = tomllib.loads(imported.text)["controls"]
    assert [block["type"] for block in blocks.values()].count("latch") == 1
    assert found.agrees and differences(found)["levels"] < SAME, list(found.lines())
