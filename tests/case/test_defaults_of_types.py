"""`[defaults.TYPE]` of all types of parts: equal to keys in the parts, to the bit; faults name the defaults."""

import copy

import numpy as np
import pytest
from reference.refusals import refused
from reference.specimens import SPECIMENS

from fvsolve import load, run
from fvsolve.case.changes import changes
from fvsolve.case.reading import NOT_DEFAULT
from fvsolve.errors import CaseError
from fvsolve.parts import KINDS
from fvsolve.studies import sweep

TYPES = [*KINDS["nodes"], *KINDS["links"]]
WITHOUT_KEYS = {"terminal"}  # types that have no keys of their own
# keys of types whose specimens state none
ADDED = {"ground": {"voltage": 2.0}, "housing": {"speed": 3.0}}
METHODS = {
    "explicit": {"method": "rk4", "courant": 0.8},
    "implicit": {"method": "radau-iia-5", "rtol": 1e-6},
    "Rosenbrock": {"method": "rodas-4", "rtol": 1e-6},
}

STATION = {
    "fluid": {"name": "Water"},
    "nodes": {
        "sump": {"type": "reservoir", "head": 2.0},
        "low": {"type": "junction"},
        "high": {"type": "junction"},
        "vessel": {"type": "accumulator", "volume": "2 m3", "gas_volume": "1 m3"},
        "tower": {"type": "tank", "area": "20 m2", "level": 40.0},
    },
    "links": {
        "pump": {
            "type": "pump",
            "from": "sump",
            "to": "low",
            "curve": {"flow": ["0 l/s", "50 l/s", "80 l/s"], "head": ["60 m", "50 m", "35 m"]},
            "rated_speed": "1480 rpm",
            "inertia": "3 kg m2",
            "trip": "0.1 s",
        },
        "check": {
            "type": "check-valve",
            "from": "low",
            "to": "high",
            "diameter": "200 mm",
            "loss_coefficient": 2.0,
        },
        "neck": {"type": "orifice", "from": "vessel", "to": "high", "diameter": "100 mm"},
        "main": {
            "type": "pipe",
            "from": "high",
            "to": "tower",
            "length": 300,
            "diameter": 0.25,
            "wave_speed": 1000,
            "cells": 10,
            "friction": {"model": "steady", "factor": 0.02},
        },
    },
    "numerics": {"end": 1.0},
    "output": {"every": 0.05},
}


def with_defaults(case, *types):
    """Copy of a case in which the keys of the first part of each type are defaults."""
    case = copy.deepcopy(case)
    for group in ("nodes", "links"):
        for part in case.get(group, {}).values():
            kind = part["type"]
            if kind in types and kind not in case.get("defaults", {}):
                keys = [key for key in part if key not in (*NOT_DEFAULT, "type")]
                case.setdefault("defaults", {})[kind] = {key: part.pop(key) for key in keys}
    return case


def specimen_of(kind):
    """First specimen with a part of a type that has keys, and the group and the name of this part."""
    for specimen in SPECIMENS.values():
        case = copy.deepcopy(specimen.case)
        for group in ("nodes", "links"):
            for name, part in case.get(group, {}).items():
                if part["type"] == kind:
                    part |= ADDED.get(kind, {})
                    if {*part} - {*NOT_DEFAULT, "type"}:
                        return case, group, name
    raise LookupError(kind)


@pytest.mark.parametrize("kind", TYPES)
def test_defaults_of_a_type_equal_keys_in_its_parts(kind):
    if kind in WITHOUT_KEYS:
        return
    given, group, name = specimen_of(kind)
    changed = with_defaults(given, kind)
    assert changed["defaults"][kind] and changed[group][name] != given[group][name]
    part, other = (getattr(load(case), group)[name] for case in (changed, given))
    assert part.table() == other.table()


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_run_with_defaults_equals_a_run_with_keys_to_the_bit(name, law, tmp_path):
    given = copy.deepcopy(STATION)
    given["fluid"]["law"] = law
    given["numerics"] |= METHODS[name]
    changed = with_defaults(given, "pump", "check-valve", "orifice", "accumulator", "tank", "pipe")
    assert [*changed["links"]["pump"]] == ["type", "from", "to"]
    first, second = (
        run(case, out=tmp_path / str(k), pictures=False) for k, case in enumerate((given, changed))
    )
    assert first.summary["steps"] == second.summary["steps"] > 3
    for probe in first.summary["probes"]:
        assert np.array_equal(first[probe], second[probe]), probe
    again = run(tmp_path / "1" / "case.toml", out=tmp_path / "again", pictures=False)
    for probe in first.summary["probes"]:
        assert np.array_equal(first[probe], again[probe]), probe
    assert "defaults" not in load(changed).table()


def test_a_value_in_the_part_wins_and_excludes_alternatives():
    case = with_defaults(STATION, "pump", "check-valve")
    case["links"]["pump"]["inertia"] = "7 kg m2"
    case["links"]["check"]["Kv"] = 500.0
    del case["defaults"]["check-valve"]["diameter"]
    case["defaults"]["check-valve"] |= {"discharge_coefficient": 0.6}
    del case["defaults"]["check-valve"]["loss_coefficient"]
    read = load(case)
    assert read.links["pump"].inertia == 7.0 and read.links["pump"].trip == 0.1
    assert read.links["check"].Kv == 500.0 and read.links["check"].discharge_coefficient is None


def test_settings_sweeps_and_reloads_reach_defaults_of_any_type():
    case = load(with_defaults(STATION, "pump"))
    moved = load(case, {"defaults.pump.inertia": "9 kg m2", "links.main.length": 310})
    assert moved.links["pump"].inertia == 9.0 and moved.links["main"].length == 310
    own = load(case, {"links.pump.inertia": 5.0})
    assert own.links["pump"].inertia == 5.0 and own.links["pump"].trip == 0.1
    assert load(own, {"defaults.pump.inertia": 8.0}).links["pump"].inertia == 5.0
    assert changes(case, "defaults.pump.inertia") == changes(case, "links.pump.inertia")
    rows = sweep(case, {"defaults.pump.inertia": [1.0, 30.0]}).rows
    assert [row["ok"] for row in rows] == [True, True]


def test_schedules_signals_and_controls_may_be_defaults():
    case = copy.deepcopy(STATION)
    case["signals"] = {"shut": {"time": [0.0, 0.5], "value": [1.0, 0.2]}}
    case["defaults"] = {"orifice": {"opening": {"signal": "shut"}}}
    assert load(case).links["neck"].opening.value.tolist() == [1.0, 0.2]
    case["controls"] = {
        "level": {
            "type": "table",
            "input": "tower.level",
            "table": {"input": [30, 50], "output": [1, 0]},
        }
    }
    del case["signals"]
    case["defaults"]["orifice"]["opening"] = {"control": "level"}
    read, own = load(case), copy.deepcopy(case)
    own["links"]["neck"] |= own.pop("defaults")["orifice"]
    assert repr(read.links["neck"]) == repr(load(own).links["neck"])
    assert repr(read.controls["level"]) == repr(load(own).controls["level"])


@pytest.mark.parametrize(("kind", "keys", "place", "text"), [
    ("pmup", {"inertia": 3}, "defaults.pmup", 'is not a type of part; did you mean "pump"?'),
    ("pump", {"inertai": 3}, "defaults.pump.inertai", 'unknown key; did you mean "inertia"?'),
    ("pump", {"inertia": "3 kg"}, "defaults.pump.inertia", "is a mass"),
    ("pump", {"inertia": -3}, "defaults.pump.inertia", "out of range"),
    ("tank", {"level": "2 s"}, "defaults.tank.level", "is a time"),
    ("tank", {"on": "main"}, "defaults.tank.on", "each tank states its own"),
    ("spool-valve", {"ports": {}}, "defaults.spool-valve.ports", "each spool-valve states its own"),
    ("check-valve", {"to": "low"}, "defaults.check-valve.to", "each check-valve states its own"),
    ("accumulator", 3, "defaults.accumulator", "is not a table; expected keys of an accumulator"),
])  # fmt: skip
def test_a_fault_of_defaults_is_reported_at_the_defaults(kind, keys, place, text):
    case = copy.deepcopy(STATION)
    case["defaults"] = {kind: keys}
    found = [one for one in refused(case).faults if one.place == place and text in one.message]
    assert len(found) == 1


def test_a_faulty_default_of_two_parts_is_a_single_fault():
    case = with_defaults(STATION, "pump")
    case["links"]["second"] = {"type": "pump", "from": "sump", "to": "low"}
    case["defaults"]["pump"]["curve"] = {"flow": [1.0], "head": ["3 kg"]}
    with pytest.raises(CaseError) as error:
        load(case)
    assert len(error.value.faults) == 1
    assert error.value.faults[0].place.startswith("defaults.pump.curve")
