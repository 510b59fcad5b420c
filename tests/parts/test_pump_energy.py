"""Electric energy of pumps and its cost: closed forms, EPANET's energy report, restatements, faults."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from reference.level_control import METHODS
from reference.scenes import GRAVITY, RHO, junction, lake, scene, tank

import fvsolve
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.errors import CaseError
from fvsolve.studies import energy

KWH = 3.6e6
SUMS = ("energy", "cost")
MEANS = ("running_share", "efficiency", "specific_energy", "mean_power", "peak_power")
POINTS = {"flow": [0.01, 0.02, 0.04], "efficiency": [0.4, 0.7, 0.6]}
CURVE = {"flow": [0.0, 0.03, 0.05], "head": [50.0, 40.0, 25.0]}


def lift(low=10.0, high=40.0, end=7200.0, numerics=None, charges=None, **keys):
    """Scene of a pump that delivers from a reservoir through a quasi-steady pipe to a higher one."""
    pump = {
        "type": "pump",
        "from": "well",
        "to": "foot",
        "curve": CURVE,
        "check_valve": True,
        **keys,
    }
    pipe = {
        "type": "pipe",
        "from": "foot",
        "to": "hill",
        "length": 500.0,
        "diameter": 0.2,
        "friction": {"model": "hazen-williams", "coefficient": 120.0},
        "pipe_model": "quasi-steady",
    }
    nodes = {
        "well": lake(low, elevation=0.0),
        "foot": junction(elevation=0.0),
        "hill": lake(high, elevation=0.0),
    }
    case = scene(
        nodes,
        {"p": pump, "main": pipe},
        end,
        dict(numerics or {"rtol": 1e-9}),
        ["p.flow", "p.head"],
        10.0,
    )
    return case | {"energy": charges or {}}


def gated(case):
    """Scene with a valve before the higher reservoir that shuts at half of the time."""
    case["nodes"]["top"] = junction(elevation=0.0)
    case["links"]["main"]["to"] = "top"
    opening = {"time": [0.0, 3600.0], "value": [1.0, 0.0], "kind": "step"}
    case["links"]["gate"] = {
        "type": "valve",
        "from": "top",
        "to": "hill",
        "diameter": 0.2,
        "loss_coefficient": 0.2,
        "opening": opening,
    }
    return case


def use(case):
    run = fvsolve.run(fvsolve.load(case))
    assert run.ok, run.reason
    return run.summary["energy_use"], run


def interpolated(x):
    """Efficiency of `POINTS` at a flow, constant beyond them."""
    flows, values = POINTS["flow"], POINTS["efficiency"]
    if x <= flows[0] or x >= flows[-1]:
        return values[0] if x <= flows[0] else values[-1]
    k = next(k for k in range(2) if x <= flows[k + 1])
    return values[k] + (x - flows[k]) / (flows[k + 1] - flows[k]) * (values[k + 1] - values[k])


@pytest.mark.parametrize("speed", [1.0, 0.9])
@pytest.mark.parametrize("method", METHODS)
def test_energy_and_cost_at_a_constant_flow_are_power_times_time(method, speed):
    price = {"time": [0.0, 3000.0], "value": [0.1, 0.25], "kind": "step"}
    numerics = {"method": method} | {"rtol": 1e-9}
    found, run = use(
        lift(numerics=numerics, speed=speed, overall_efficiency=POINTS, charges={"price": price})
    )
    flow, head = run["p.flow"][0], run["p.head"][0]
    e = 1.0 - (1.0 - interpolated(flow / speed)) * speed**-0.1
    power = RHO * GRAVITY * flow * head / e
    known = {
        "running_share": 1.0,
        "efficiency": e,
        "specific_energy": power / flow,
        "mean_power": power,
        "peak_power": power,
        "energy": 7200.0 * power,
        "cost": power / KWH * (3000.0 * 0.1 + 4200.0 * 0.25),
    }
    known["cost_per_day"] = 12.0 * known["cost"]
    assert found["pumps"]["p"] == pytest.approx(known, rel=1e-9)
    assert {key: found["total"][key] for key in SUMS} == pytest.approx(
        {key: known[key] for key in SUMS}, rel=1e-12
    )


def test_a_pump_with_a_shut_route_uses_no_energy():
    """A pump runs half of the time; its valve is shut during the other half, at an event between steps."""
    case = gated(lift())
    found, run = use(case)
    power = RHO * GRAVITY * run["p.flow"][0] * run["p.head"][0] / 0.75
    assert found["pumps"]["p"]["running_share"] == pytest.approx(0.5, abs=1e-12)
    assert found["pumps"]["p"]["energy"] == pytest.approx(3600.0 * power, rel=1e-9)
    assert found["pumps"]["p"]["mean_power"] == pytest.approx(power, rel=1e-9)


def test_the_greatest_power_of_all_pumps_is_that_at_a_common_time():
    """Pumps that run one after the other: the demand charge is for the greater power alone."""
    case = lift(charges={"demand_charge": 3.0})
    case["links"]["q"] = {
        **case["links"]["p"],
        "to": "heel",
        "speed": {"time": [0.0, 2000.0], "value": [0.0, 1.05], "kind": "step"},
    }
    case["links"]["p"]["speed"] = {"time": [0.0, 1000.0], "value": [1.0, 0.0], "kind": "step"}
    case["nodes"]["heel"] = junction(elevation=0.0)
    case["links"]["second"] = {**case["links"]["main"], "from": "heel"}
    found, _ = use(case)
    powers = [found["pumps"][name]["peak_power"] for name in "pq"]
    assert powers[1] > powers[0] > 1e3
    assert found["total"]["peak_power"] == pytest.approx(powers[1], rel=1e-12)
    assert found["total"]["demand_charge"] == pytest.approx(3e-3 * powers[1], rel=1e-12)


def test_the_same_prices_written_in_other_ways_have_the_same_cost():
    steps = {"time": [0.0, 3000.0], "value": [0.1, 0.25], "kind": "step"}
    first, _ = use(lift(charges={"price": steps, "overall_efficiency": 0.6}))
    flat = {"flow": [0.0, 1.0], "efficiency": [0.6, 0.6]}
    others = [
        lift(price=steps, overall_efficiency=0.6, charges={"price": 7.0}),
        lift(price={"signal": "tariff", "factor": 0.1}, overall_efficiency=flat)
        | {"signals": {"tariff": {"time": [0.0, 3000.0], "value": [1.0, 2.5], "kind": "step"}}},
        lift(
            charges={"price": {"formula": "where(t < 3000, 0.1, 0.25)"}, "overall_efficiency": 0.6}
        ),
    ]
    for other in others:
        assert use(other)[0]["pumps"]["p"] == pytest.approx(first["pumps"]["p"], rel=1e-9)


def test_a_case_without_the_table_energy_is_as_before():
    case = lift()
    run = fvsolve.run(case | {"energy": {}})
    del case["energy"]
    plain = fvsolve.run(case)
    assert "energy_use" not in plain.summary
    assert fvsolve.build(fvsolve.load(case)).y_size == 0
    assert plain["p.flow"] == pytest.approx(run["p.flow"], rel=1e-12)


def test_a_price_without_the_table_energy_is_a_fault():
    case = lift(price=0.2)
    del case["energy"]
    with pytest.raises(
        CaseError, match=r"links\.p\.price: has no effect without the table \[energy\]; add it"
    ):
        fvsolve.load(case)


def test_the_study_of_energy_has_the_table_of_the_run():
    """The pump stops when its valve shuts: a stop by a rising level is ill-conditioned, so its time has few digits."""
    case = gated(
        lift(charges={"price": {"time": [0.0, 3000.0], "value": [0.1, 0.25], "kind": "step"}})
    )
    case["nodes"]["hill"] = tank(30.0, 2.0, elevation=38.0)
    found, _ = use(case)
    assert found["pumps"]["p"]["running_share"] == pytest.approx(0.5, abs=1e-12)
    assert energy(fvsolve.load(case)).energy_use["pumps"]["p"] == pytest.approx(
        found["pumps"]["p"], rel=1e-6
    )


# EPANET -------------------------------------------------------------------------------------------------------------

NETWORK = """
[JUNCTIONS]
 foot 0 0
 town 20 15 day
[RESERVOIRS]
 well 10
[TANKS]
 hill 45 3 0 20 20 0
[PIPES]
 main foot town 1500 300 120 0 Open
 rise town hill 800 250 110 0 Open
[PUMPS]
 big well foot HEAD big SPEED 1 PATTERN speed
 small well foot HEAD small
[STATUS]
[CONTROLS]
 LINK small CLOSED AT TIME 9
 LINK small OPEN AT TIME 17
[PATTERNS]
 day 0.5 0.6 1.4 1.2 1.0 0.8
 speed 1.0 0.95 0.9 1.1
 tariff 1 1 2.5 1.5
[CURVES]
 big 40 50
 small 0 58
 small 15 54
 small 30 44
 use 20 55
 use 40 78
 use 60 70
[ENERGY]
 Global Efficiency 65
 Global Price 100
 Global Pattern tariff
 Demand Charge 1
 Pump big Effic use
 Pump big Price 150
[TIMES]
 Duration 24:00
 Hydraulic Timestep 0:00:05
 Pattern Timestep 4:00
[OPTIONS]
 Units LPS
 Headloss H-W
 Accuracy 1e-8
[REPORT]
 ENERGY YES
[END]
"""


def epanet_report(text, tmp_path):
    """Energy report of EPANET 2.2: rows of pumps by name, and the demand charge."""
    toolkit = pytest.importorskip(
        "wntr.epanet.toolkit", reason="WNTR, the extra `epanet`, is not installed"
    )
    files = [str(tmp_path / f"net.{ending}") for ending in ("inp", "rpt", "bin")]
    Path(files[0]).write_text(text)
    epanet = toolkit.ENepanet()
    epanet.ENopen(*files)
    epanet.ENsolveH()
    epanet.ENsaveH()
    epanet.ENreport()
    epanet.ENclose()
    report = Path(files[1]).read_text(encoding="latin-1").partition("Energy Usage:")[2]
    rows = [line.split() for line in report.splitlines() if len(line.split()) == 7]
    charge = re.search(r"Demand Charge:\s+(\S+)", report)
    return {
        row[0]: [float(x) for x in row[1:]] for row in rows if re.match(r"[\d.]+$", row[1])
    }, float(charge[1])


def in_report(row, volume=1.0):
    """Numbers of a pump as in the report: %, %, kWh/m3 (times `volume`), kW, kW, cost per day."""
    return [
        100.0 * row["running_share"],
        100.0 * row["efficiency"],
        row["specific_energy"] / KWH * volume,
        row["mean_power"] / 1e3,
        row["peak_power"] / 1e3,
        row["cost_per_day"],
    ]


def test_energy_and_cost_are_those_of_the_report_of_epanet(tmp_path):
    """Two pumps, a speed pattern with an efficiency curve, a constant efficiency, a price pattern, controls by time."""
    steps = {"kind": "step"}

    def pattern(values):
        return {"time": [4.0 * 3600.0 * k for k in range(6)], "value": values, **steps}

    def pipe(start, end, length, diameter, coefficient):
        return {
            "type": "pipe",
            "from": start,
            "to": end,
            "length": length,
            "diameter": diameter,
            "friction": {"model": "hazen-williams", "coefficient": coefficient},
        }

    tariff = [1.0, 1.0, 2.5, 1.5, 1.0, 1.0]
    speeds = pattern([1.0, 0.95, 0.9, 1.1, 1.0, 0.95])
    openings = {"time": [0.0, 9 * 3600.0, 17 * 3600.0], "value": [1, 0, 1], **steps}
    points = {"flow": [0.02, 0.04, 0.06], "efficiency": [0.55, 0.78, 0.70]}
    demand = pattern([0.015 * x for x in (0.5, 0.6, 1.4, 1.2, 1.0, 0.8)])
    nodes = {
        "well": lake(10.0, elevation=0.0),
        "foot": junction(elevation=0.0),
        "end": junction(elevation=0.0),
        "town": junction(elevation=20.0, demand=demand),
        "hill": tank(math.pi * 100.0, 3.0, elevation=45.0),
    }
    links = {
        "main": pipe("foot", "town", 1500.0, 0.3, 120.0),
        "rise": pipe("town", "hill", 800.0, 0.25, 110.0),
        "big": {
            "type": "pump",
            "from": "well",
            "to": "foot",
            "curve": {"flow": [0.04], "head": [50.0]},
            "speed": speeds,
            "check_valve": True,
            "overall_efficiency": points,
            "price": pattern([150.0 * x for x in tariff]),
        },
        "small": {
            "type": "pump",
            "from": "well",
            "to": "end",
            "check_valve": True,
            "curve": {"flow": [0.0, 0.015, 0.03], "head": [58.0, 54.0, 44.0]},
        },
        "gate": {
            "type": "valve",
            "from": "end",
            "to": "foot",
            "diameter": 0.3,
            "loss_coefficient": 1e-4,
            "opening": openings,
        },
    }
    case = scene(
        nodes, links, 86400.0, {"pipe_model": "quasi-steady", "rtol": 1e-7}, ["hill.level"], 40.0
    )
    case["energy"] = {
        "price": pattern([100.0 * x for x in tariff]),
        "overall_efficiency": 0.65,
        "demand_charge": 1.0,
    }
    case["fluid"] |= {"density": 999.563}
    found, _ = use(case)
    known, charge = epanet_report(NETWORK, tmp_path)
    assert set(known) == {"big", "small"}
    for name, row in known.items():
        assert in_report(found["pumps"][name]) == pytest.approx(row, rel=3e-4, abs=0.006), name
        assert row[5] > 1e4  # the last digit of the cost is small
    assert found["total"]["demand_charge"] == pytest.approx(charge, rel=3e-4)


@pytest.mark.parametrize("name", ["Net1", "Net3"])
def test_the_energy_of_the_networks_of_epanet_is_that_of_its_report(name, tmp_path):
    wntr = pytest.importorskip("wntr", reason="WNTR, the extra `epanet`, is not installed")
    from fvsolve.exchange.epanet import import_network

    path = Path(wntr.__file__).parent / "library" / "networks" / f"{name}.inp"
    text = re.sub(
        r"(?im)^\s*(hydraulic timestep|duration|energy|status|summary)\s.*$", "", path.read_text()
    )
    text = text.replace("[TIMES]", "[TIMES]\n Hydraulic Timestep 0:00:10\n Duration 24:00")
    text = text.replace("[REPORT]", "[REPORT]\n ENERGY YES\n").replace(
        "[END]", "[ENERGY]\n Global Price 100\n[END]"
    )
    known, _ = epanet_report(text, tmp_path)
    case = tmp_path / "day.toml"
    case.write_text(f"{import_network(path, day=True).text}\n[energy]\nprice = 100\n")
    found, _ = use(case)
    gallons = 3785.411784  # the report is per million gallons, in m3
    for pump, row in known.items():
        assert in_report(found["pumps"][pump], gallons) == pytest.approx(
            row, rel=5e-4, abs=0.006
        ), pump


def test_sums_of_energy_act_on_nothing():
    """Neither a rate nor the sparsity pattern of the Jacobian depends on them, so they cost no evaluations."""
    case = lift(charges={"price": 0.2})
    case["nodes"]["hill"] = tank(50.0, 3.0, elevation=35.0)
    model = fvsolve.build(fvsolve.load(case))
    sums = np.array([name.startswith("p.") for name in model.state_names])
    assert sums.sum() == 5 and len(sums) == 6
    pattern = jacobian_pattern(model).toarray()
    assert np.array_equal(pattern[:, sums].sum(axis=0), np.ones(5)) and pattern[:, ~sums].sum() > 5
    jacobian = model.jacobian(0.0, model.start)
    assert not jacobian[:, sums].any() and np.count_nonzero(jacobian[:, ~sums]) > 3
