"""EPANET's general purpose and pressure breaker valves: their losses follow the flow, at the start and over a day."""

import tomllib

import pytest

import fvsolve

pytest.importorskip("epanet", reason="EPANET's toolkit, the extra `epanet`, is not installed")

from fvsolve.case import load  # noqa: E402
from fvsolve.epanet import import_network, network_text, self_check  # noqa: E402
from fvsolve.epanet.network_file import read_network, solution_at  # noqa: E402
from fvsolve.model.build import build  # noqa: E402

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
tower 25 3 1 6 12 0
[PIPES]
p1 lake a 400 200 110 0 Open
p2 b c 300 150 120 2 Open
p3 c tower 500 150 110 0 Open
p4 c d 350 150 100 0 Open
[VALVES]
v a b 150 {valve}
[CURVES]
{points}
g 500 900
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
UNITS {units}
HEADLOSS H-W
ACCURACY 0.000001
{options}
[END]
"""
POINTS = "g 0 0\ng 5 2\ng 12 9\ng 20 24"


def town(tmp_path, valve="GPV g 0", points=POINTS, **keys):
    given = {"status": "", "controls": "", "units": "LPS", "options": ""} | keys
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
    "PBV with a smaller minor loss": {"valve": "PBV 10 40"},
    "PBV with a greater minor loss": {"valve": "PBV 2 400"},
    "PBV with a greater minor loss at times": {"valve": "PBV 4 300"},
    "PBV without setting": {"valve": "PBV 0 60"},
    "PBV of a heavy liquid": {"valve": "PBV 10 0", "options": "SPECIFIC GRAVITY 1.2"},
    "PBV in psi": {"valve": "PBV 5 0", "units": "GPM"},
    "PBV fixed open": {"valve": "PBV 10 50", "status": "v OPEN"},
    "PBV fixed closed": {"valve": "PBV 10 0", "status": "v CLOSED"},
    "GPV that opens and shuts": {"controls": "LINK v CLOSED AT TIME 5\nLINK v OPEN AT TIME 9"},
}  # fmt: skip


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
