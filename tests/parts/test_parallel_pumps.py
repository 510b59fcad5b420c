"""`count` of a pump: equal to separate pumps between the same nodes, at the start and after a trip."""

import numpy as np
import pytest
from pytest import approx
from reference.refusals import refused

import fvsolve
from fvsolve.cli.printing import check_text
from fvsolve.core.model.build import build
from fvsolve.report.tables import parts
from fvsolve.studies import energy, sweep

N = 3
METHODS = {
    "explicit": {"method": "rk4", "courant": 0.8},
    "implicit": {"method": "radau-iia-5", "step": 0.01},
    "Rosenbrock": {"method": "rodas-4", "step": 0.01},
}
POINTS = {"flow": ["0 l/s", "40 l/s", "60 l/s"], "head": ["60 m", "50 m", "38 m"]}
DRIVE = {"rated_speed": "1480 rpm", "trip": "0.2 s"}
PUMPS = {
    "power law": {"curve": POINTS, **DRIVE, "inertia": "2 kg m2", "check_valve": True},
    "one point": {"curve": {"flow": ["40 l/s"], "head": ["45 m"]}, **DRIVE, "inertia": 1.5},
    "lines": {
        "curve": {"flow": [0.0, 0.02, 0.04, 0.06], "head": [60.0, 57.0, 50.0, 38.0]},
        **DRIVE,
        "efficiency": {"flow": [0.0, 0.03, 0.05], "efficiency": [0.1, 0.7, 0.8]},
        "inertia": "2 kg m2",
    },
    "polynomial": {"curve": {"coefficients": [60.0, -20.0, -6000.0]}, **DRIVE, "inertia": 2.0},
    "shaft power": {
        "curve": POINTS,
        **DRIVE,
        "shaft_power": {"flow": [0.0, 0.03, 0.06], "power": [12e3, 20e3, 30e3]},
        "inertia": "2 kg m2",
        "curve_extrapolation": "parabola",
    },
    "Suter": {
        "suter": {"rated_flow": "40 l/s", "rated_head": "50 m", "table": "radial-25"},
        **DRIVE,
        "inertia": "2 kg m2",
    },
    "estimated inertia": {"curve": POINTS, **DRIVE, "check_valve": True},
    "ramp": {
        "curve": POINTS,
        "speed": {"time": [0.2, 1.0], "value": [1.0, 0.8]},
        "check_valve": True,
    },
    "power": {"power": "20 kW"},
}


def station(pumps, law="linear", numerics=None, end=1.5, **top):
    """Scene of pumps (name -> keys) that deliver from a sump to a tower, and its probes."""
    ends = {"type": "pump", "from": "low", "to": "high"}
    suction = {
        "type": "pipe",
        "from": "sump",
        "to": "low",
        "length": 20.0,
        "diameter": 0.4,
        "wave_speed": 1000.0,
        "cells": 2,
        "friction": {"model": "steady", "factor": 0.02},
    }
    main = {**suction, "from": "high", "to": "tower", "length": 400.0, "cells": 16}
    names = [f"{pump}.{key}" for pump in pumps for key in ("flow", "head", "torque", "power")]
    return {
        "fluid": {"name": "Water", "law": law},
        "nodes": {
            "sump": {"type": "reservoir", "head": 4.0},
            "low": {"type": "junction"},
            "high": {"type": "junction"},
            "tower": {"type": "reservoir", "head": 42.0},
        },
        "links": {
            "suction": suction,
            "main": {**main, "diameter": 0.35},
            **{name: {**ends, **keys} for name, keys in pumps.items()},
        },
        "numerics": {"end": end, **(numerics or METHODS["explicit"])},
        "output": {
            "every": 0.05,
            "probes": [*names, "high.pressure", "low.pressure", "main.flow@0.5"],
        },
        **top,
    }


def single_and_separate(tmp_path, keys, **settings):
    """Runs of a part with `count` and of separate pumps."""
    cases = (
        station({"all": {**keys, "count": N}}, **settings),
        station({f"p{k}": keys for k in range(N)}, **settings),
    )
    return [
        fvsolve.run(case, out=tmp_path / str(k), pictures=False) for k, case in enumerate(cases)
    ]


def assert_equal(together, separate, near=1e-8):
    """Assert that the runs have equal heads, and that flows, torques and powers of separate pumps add up."""
    assert together.summary["ok"] and separate.summary["ok"]
    assert together.t == approx(separate.t, abs=1e-9)
    for probe in ("high.pressure", "low.pressure", "main.flow@0.5"):
        scale = np.max(np.abs(separate[probe]))
        assert together[probe] == approx(separate[probe], abs=near * scale), probe
    for key in ("flow", "torque", "power"):
        total = sum(separate[f"p{k}.{key}"] for k in range(N))
        scale = max(np.max(np.abs(total)), 1e-3)
        assert together[f"all.{key}"] == approx(total, abs=near * scale), key
    head = separate["p1.head"]
    assert together["all.head"] == approx(head, abs=near * np.max(np.abs(head)))


@pytest.mark.parametrize("name", PUMPS)
def test_a_part_with_a_count_equals_separate_pumps_for_each_law_of_the_pump(name, tmp_path):
    runs = single_and_separate(tmp_path, PUMPS[name])
    assert runs[0]["main.flow@0.5"][0] > 0.05
    assert_equal(*runs)


@pytest.mark.parametrize(("method", "law"), [
    ("explicit", "linear"), ("explicit", "log"), ("implicit", "linear"), ("implicit", "log"),
    ("Rosenbrock", "linear"),
])  # fmt: skip
def test_a_part_with_a_count_equals_separate_pumps_under_each_method(method, law, tmp_path):
    runs = single_and_separate(
        tmp_path, PUMPS["power law"], law=law, numerics=METHODS[method], end=0.8
    )
    assert_equal(*runs)


def test_a_rosenbrock_method_under_a_law_without_exact_jacobian_differs_by_less_than_its_error(
    tmp_path,
):
    """Its result depends on differences of rates in its Jacobian, which are over other states for separate pumps."""
    settings = {"law": "log", "end": 0.4}
    gaps = []
    for step in (0.01, 0.0025):
        numerics = {"method": "rodas-4", "step": step}
        together, separate = single_and_separate(
            tmp_path / str(step), PUMPS["power law"], numerics=numerics, **settings
        )
        gaps.append(np.max(np.abs(together["high.pressure"] - separate["high.pressure"])))
        exact = {"method": "radau-iia-5", "step": 0.002}
        case = station({"all": PUMPS["power law"] | {"count": N}}, numerics=exact, **settings)
        fine = fvsolve.run(case, out=tmp_path / f"fine-{step}", pictures=False)
        error = np.max(np.abs(separate["high.pressure"] - fine["high.pressure"]))
        assert gaps[-1] < 0.5 * error
    assert gaps[1] < 0.3 * gaps[0]


def test_events_of_the_check_valve_are_those_of_each_pump(tmp_path):
    together, separate = single_and_separate(tmp_path, PUMPS["power law"], end=4.0)
    first = [(e["what"], e["time"]) for e in together.summary["events"]]
    each = [(e["what"], e["time"]) for e in separate.summary["events"] if e["name"] == "p0"]
    assert first and [what for what, _ in first] == [what for what, _ in each]
    assert [t for _, t in first] == approx([t for _, t in each], abs=1e-9)


def test_energy_use_and_cost_are_the_sums_of_separate_pumps(tmp_path):
    keys = {"curve": POINTS, "overall_efficiency": PUMPS["lines"]["efficiency"]}
    top = {"energy": {"price": 0.2, "demand_charge": 5.0}}
    first, second = (
        one.summary["energy_use"] for one in single_and_separate(tmp_path, keys, **top)
    )
    for key in ("energy", "cost", "peak_power", "demand_charge"):
        assert first["total"][key] == approx(second["total"][key], rel=1e-9) != 0.0
    for key in ("running_share", "efficiency", "specific_energy"):
        assert first["pumps"]["all"][key] == approx(second["pumps"]["p0"][key], rel=1e-9)


def test_a_count_of_1_is_the_pump_itself_to_the_bit(tmp_path):
    keys = PUMPS["power law"]
    one, plain = (
        fvsolve.run(station({"all": pump}), out=tmp_path / str(k), pictures=False)
        for k, pump in enumerate((keys | {"count": 1}, keys))
    )
    for probe in plain.summary["probes"]:
        assert np.array_equal(one[probe], plain[probe])


def test_supplied_stored_and_dissipated_energy_are_the_sums_of_separate_pumps():
    keys = PUMPS["power law"]
    together, separate = (
        energy(fvsolve.load(station(pumps)))
        for pumps in ({"all": keys | {"count": N}}, {f"p{k}": keys for k in range(N)})
    )
    for group in ("stored", "dissipated"):
        first, second = getattr(together, group), getattr(separate, group)
        total = sum(second[f"p{k}"] for k in range(N))
        assert first["all"] == approx(total, abs=1e-7 * np.max(np.abs(total))), group
    assert np.max(np.abs(together.remainder)) < 1e-4 * np.max(np.abs(together.stored["all"]))


def test_notices_are_about_each_pump_except_the_velocity_of_all():
    def texts(keys, count):
        return [
            w["text"] for w in checks_of(station({"all": {**keys, "count": count}}))["warnings"]
        ]

    estimated = [text for text in texts(PUMPS["estimated inertia"], N) if "estimated" in text]
    alone = [text for text in texts(PUMPS["estimated inertia"], 1) if "estimated" in text]
    value = alone[0].split("speed: ")[1].split(" kg")[0]
    assert f"speed: {value} kg m2" in estimated[0] and "of each of 3 pumps" in estimated[0]
    large = PUMPS["power law"] | {"inertia": "200 kg m2"}
    assert (
        [text for text in texts(large, N) if "is usual" in text]
        == [text for text in texts(large, 1) if "is usual" in text]
        != []
    )
    fast = [text for text in texts(PUMPS["power law"], 60) if "in the widest adjacent pipe" in text]
    assert len(fast) == 1 and "2400" in fast[0].replace(" ", "") or "2.4 m3/s" in fast[0]


def checks_of(case):
    return build(fvsolve.load(case)).checks


def test_check_and_report_show_the_number_of_pumps(tmp_path):
    case = fvsolve.load(station({"all": PUMPS["ramp"] | {"count": N}}, end=0.1))
    facts = checks_of(station({"all": PUMPS["ramp"] | {"count": N}})) | {"threads": {}}
    lines = [str(line) for line in check_text(case, facts)]
    assert any("all: 3 x pump in parallel" in line for line in lines)
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    assert ["all", "3 x pump"] in [row[:2] for row in parts(result).rows]


@pytest.mark.parametrize(("given", "text"), [
    (0, "is out of range"), (2.5, "is not a whole number"), ("3 x", "is not a whole number"),
])  # fmt: skip
def test_a_count_is_a_whole_number_from_1_on(given, text):
    error = refused(station({"all": PUMPS["ramp"] | {"count": given}}))
    assert [f.place for f in error.faults] == ["links.all.count"] and text in str(error)


def test_several_pumps_have_no_common_shaft():
    case = station({"all": {"curve": POINTS, "rated_speed": 150.0, "inertia": 2.0, "count": N}})
    case["links"]["motor"] = {"type": "torque", "to": "all.shaft", "torque": "100 N m"}
    error = refused(case)
    assert "links.all.count: 3 pumps have no common shaft, but motor joins all.shaft" in str(error)


def test_a_sweep_over_the_count_adds_pumps():
    case = station({"all": {"curve": POINTS}}, end=0.1)
    rows = sweep(case, {"links.all.count": [1, 2, 3]}).rows
    flows = [row["max(all.flow) [m3/s]"] for row in rows]
    assert flows[0] < flows[1] < flows[2] < 3 * flows[0]


def test_an_epanet_file_has_the_heads_of_all_pumps(tmp_path):
    pytest.importorskip("epanet", reason="EPANET's toolkit, the extra `epanet`, is not installed")
    from fvsolve.exchange.epanet import network_text
    from fvsolve.exchange.epanet.network_file import read_network, solution_at

    keys = {"curve": PUMPS["lines"]["curve"], "check_valve": True, "count": N}
    case = station({"all": keys})
    for link in ("suction", "main"):
        case["links"][link]["friction"] = {"model": "steady", "roughness": "0.1 mm"}
    text, notes = network_text(fvsolve.load(case))
    assert "links.all.count: 3 pumps are written as one pump with the flow of all" in notes
    path = tmp_path / "all.inp"
    path.write_text(text, encoding="utf-8")
    heads = solution_at(read_network(path), 0.0).solutions[0].head
    start = build(fvsolve.load(case)).checks["nodes"]
    assert heads["high"] == approx(start["high"]["head"], abs=0.05)
    assert heads["low"] == approx(start["low"]["head"], abs=0.05)
