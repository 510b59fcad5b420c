"""Signals with a factor: the numbers of a pattern times a quantity of the key."""

import numpy as np
import pytest
from reference.scenes import inflow, scene, tank, valve

import fvsolve
from fvsolve.errors import CaseError

PATTERN = {"time": [0.0, 10.0, 20.0], "value": [1.0, 1.5, 0.5], "kind": "step"}
FORMS = {
    "step": PATTERN, "linear": PATTERN | {"kind": "linear"}, "smooth": PATTERN | {"kind": "smooth"}, "number": 1.2,
    "ramp": {"start": 5.0, "duration": 10.0, "value": [1.0, 2.0], "exponent": 2.0},
    "wave": {"mean": 1.0, "amplitude": 0.5, "period": 12.0, "phase": 0.3},
}  # fmt: skip
SCALED = {
    "number": lambda form: 1.2 * 0.02,
    "wave": lambda form: form | {"mean": 0.02, "amplitude": 0.01},
}


def filling(flow, **top):
    nodes = {"spring": inflow(flow), "pond": tank(2.0, 1.0)}
    links = {"gate": valve("spring", "pond", 0.05)}
    return scene(
        nodes, links, 30.0, {"method": "dormand-prince", "rtol": 1e-9}, ["pond.level", "gate.flow"], 1.0, **top
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
    assert read.nodes["well"].head.value.tolist() == [4.0, 6.0, 2.0] and read.signals["day"]["value"] == [1.0, 1.5, 0.5]
    assert read.nodes["spring"].flow.table() == {"signal": "day", "factor": -0.004}
    assert "factor = -0.004" in read.resolved()


def test_a_wrong_factor_is_told_at_its_place():
    faults = []
    for signal, form in (
        ({"signal": "day", "factor": "3 m"}, PATTERN), ({"signal": "day", "factor": "1 l/s"}, "sin(t)"),
    ):  # fmt: skip
        with pytest.raises(CaseError) as caught:
            fvsolve.load(filling(signal, signals={"day": form}))
        faults += [(fault.place, fault.message) for fault in caught.value.faults]
    assert [place for place, _ in faults] == ["nodes.spring.flow.factor"] * 2
    assert "takes no factor" in faults[1][1]
    case = filling(0.01, signals={"day": PATTERN})
    case["links"]["gate"]["opening"] = {"signal": "day", "factor": 1.0}
    with pytest.raises(CaseError, match=r"gives values from 0.5 to 1.5"):
        fvsolve.load(case)
