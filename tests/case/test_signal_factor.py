"""Signals with a factor: the numbers of a pattern times a quantity of the key; sums of such signals."""

import tomllib

import numpy as np
import pytest
from reference.scenes import inflow, scene, tank, valve

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.value import ReadContext, ValueFault

PATTERN = {"time": [0.0, 10.0, 20.0], "value": [1.0, 1.5, 0.5], "kind": "step"}
FORMS = {
    "step": PATTERN,
    "linear": PATTERN | {"kind": "linear"},
    "smooth": PATTERN | {"kind": "smooth"},
    "number": 1.2,
    "ramp": {"start": 5.0, "duration": 10.0, "value": [1.0, 2.0], "exponent": 2.0},
    "wave": {"mean": 1.0, "amplitude": 0.5, "period": 12.0, "phase": 0.3},
}
SCALED = {
    "number": lambda form: 1.2 * 0.02,
    "wave": lambda form: form | {"mean": 0.02, "amplitude": 0.01},
}


def filling(flow, **top):
    nodes = {"spring": inflow(flow), "pond": tank(2.0, 1.0)}
    links = {"gate": valve("spring", "pond", 0.05)}
    return scene(
        nodes,
        links,
        30.0,
        {"method": "dormand-prince", "rtol": 1e-9},
        ["pond.level", "gate.flow"],
        1.0,
        **top,
    )


@pytest.mark.parametrize("name", FORMS)
def test_a_signal_with_a_factor_is_the_scaled_schedule(name):
    form = FORMS[name]
    plain = SCALED.get(name, lambda form: form | {"value": [0.02 * v for v in form["value"]]})(form)
    signal = {"signal": "day", "factor": "20 l/s"}
    found, exact = fvsolve.run(filling(signal, signals={"day": form})), fvsolve.run(filling(plain))
    assert found["gate.flow"] == pytest.approx(exact["gate.flow"], rel=1e-14)
    assert np.ptp(found["pond.level"]) > 0.1


def test_keys_of_several_units_share_a_pattern_and_the_resolved_case_has_it():
    case = filling({"signal": "day", "factor": -0.004}, signals={"day": PATTERN})
    case["nodes"]["well"] = {"type": "reservoir", "head": {"signal": "day", "factor": "4 m"}}
    case["links"]["lift"] = valve("well", "pond", 0.01)
    read = fvsolve.load(case)
    assert read.nodes["well"].head.value.tolist() == [4.0, 6.0, 2.0] and read.signals["day"][
        "value"
    ] == [1.0, 1.5, 0.5]
    assert read.nodes["spring"].flow.table() == {"signal": "day", "factor": -0.004}
    assert "factor = -0.004" in read.resolved()


def test_a_wrong_factor_is_reported_at_its_place():
    faults = []
    for signal, form in (
        ({"signal": "day", "factor": "3 m"}, PATTERN),
        ({"signal": "day", "factor": "1 l/s"}, "sin(t)"),
    ):
        with pytest.raises(CaseError) as caught:
            fvsolve.load(filling(signal, signals={"day": form}))
        faults += [(fault.place, fault.message) for fault in caught.value.faults]
    assert [place for place, _ in faults] == ["nodes.spring.flow.factor"] * 2
    assert "takes no factor" in faults[1][1]
    case = filling(0.01, signals={"day": PATTERN})
    case["links"]["gate"]["opening"] = {"signal": "day", "factor": 1.0}
    with pytest.raises(CaseError, match=r"gives values from 0.5 to 1.5"):
        fvsolve.load(case)


@pytest.mark.parametrize("kind", ["step", "linear"])
def test_a_sum_is_the_table_of_the_added_values(kind):
    night = {"time": [5.0, 10.0, 25.0], "value": [2.0, 4.0, 1.0], "kind": kind}
    day = PATTERN | {"kind": kind}
    parts = [{"signal": "day", "factor": "20 l/s"}, {"signal": "night", "factor": "5 l/s"}, "1 l/s"]
    times = [0.0, 5.0, 10.0, 20.0, 25.0]
    if kind == "step":
        values = [0.031, 0.031, 0.051, 0.031, 0.016]
    else:
        values = [
            0.02 * np.interp(t, day["time"], day["value"])
            + 0.005 * np.interp(t, night["time"], night["value"])
            + 0.001
            for t in times
        ]
    case = filling({"sum": parts}, signals={"day": day, "night": night})
    found, exact = (
        fvsolve.run(case),
        fvsolve.run(filling({"time": times, "value": values, "kind": kind})),
    )
    assert found["gate.flow"] == pytest.approx(exact["gate.flow"], rel=1e-13)
    again = fvsolve.load(tomllib.loads(fvsolve.load(case).resolved()))
    assert again.nodes["spring"].flow == fvsolve.load(case).nodes["spring"].flow


@pytest.mark.parametrize(
    ("given", "place", "message"),
    [
        ({"sum": 3.0}, "sum", "is not a list of schedules"),
        ({"sum": []}, "sum", "is not a list of schedules"),
        ({"sum": [0.01, "3 m"]}, "sum[1]", "expected a flow"),
        ({"sum": [0.01, FORMS["ramp"]]}, "sum[1]", "takes no sum"),
        ({"sum": [PATTERN, FORMS["linear"]]}, "sum", "tables of steps and of straight lines"),
        ({"sum": [{"signal": "loop"}]}, "sum[0].signal", "refers to another signal"),
    ],
)
def test_a_wrong_sum_is_reported_at_its_place(given, place, message):
    with pytest.raises(CaseError) as caught:
        fvsolve.load(
            filling(
                given,
                signals={"loop": {"sum": [{"signal": "loop"}]}} if "loop" in str(given) else {},
            )
        )
    (fault,) = caught.value.faults
    assert fault.place == f"nodes.spring.flow.{place}" and message in fault.message


@pytest.mark.parametrize(("dimension", "one"), [("pressure", "1 barg"), ("temperature", "15 degC")])
def test_values_in_units_with_different_zeros_take_no_sum(dimension, one):
    with pytest.raises(ValueFault) as caught:
        Scheduled(dimension).read({"sum": [one, one]}, ReadContext())
    ((place, message),) = caught.value.faults
    assert place == ("sum",) and "takes no sum" in message


def test_a_sum_out_of_range_is_reported():
    case = filling(0.01, signals={"day": PATTERN})
    case["links"]["gate"]["opening"] = {"sum": [{"signal": "day", "factor": 0.6}, 0.3]}
    with pytest.raises(CaseError, match=r"links.gate.opening.sum"):
        fvsolve.load(case)
