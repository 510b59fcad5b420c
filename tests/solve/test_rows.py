"""Rows between steps do not change the steps, and are inside the printed extremes.

Kinks and jumps within few rounding errors of a boundary of a run or advance do not cause extremely short steps.
"""

import math

import numpy as np
import pytest
from reference.folders import CASES
from reference.scenes import (
    AMBIENT,
    RHO,
    SHARP,
    chamber,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    tank,
    valve,
)

import fvsolve

EVERY = [10e-3, 3e-3, 1e-3, 0.7e-3]
NO_ROWS = 50.0  # later than the end of every case [s]
FRICTION = {"model": "quasi-steady", "factor": 0.02}
FIXED = {
    "courant": {"courant": 0.9},
    "courant at its limit, leaping": dict(SHARP),
    "fixed rk4": {"method": "rk4", "step": 2e-3},
    "fixed euler": {"scheme": "upwind", "method": "euler", "step": 3.3e-3},
    "fixed implicit-euler": {"method": "implicit-euler", "step": 11e-3},
    "courant of implicit-midpoint": {"method": "implicit-midpoint", "courant": 4.0},
}
SETTINGS = {
    **FIXED,
    **{
        name: {"method": name, "rtol": 1e-4}
        for name in ("dormand-prince", "rodas-5p", "radau-iia-5", "auto")
    },
}
SETTINGS["given"] = {"method": "radau-iia-5", "courant": 20.0}


def slam(numerics: dict) -> dict:
    """Case of a main with a check valve that slams after a pressure drop, and of a tank on a rigid column."""
    nodes = {
        "source": reservoir(step(0.2, 8e5, 3e5)),
        "in": junction(),
        "out": junction(),
        "gate": junction(),
        "lake": lake(45.0),
        "shaft": tank(0.02, 44.0),
    }
    links = {
        "feed": pipe("source", "in", 60.0, 0.3, 1000.0, 6),
        "check": {
            "type": "check-valve",
            "from": "in",
            "to": "out",
            "area": 0.05,
            "discharge_coefficient": 0.6,
        },
        "main": pipe(
            "out", "gate", 300.0, 0.3, 1000.0, 24, friction={"model": "steady", "factor": 0.02}
        ),
        "valve": valve("gate", "lake", 0.01, ramp(0.5, 0.3, 1.0, 0.3)),
        "column": {
            "type": "rigid-column",
            "from": "lake",
            "to": "shaft",
            "length": 5.0,
            "diameter": 0.1,
            "friction": FRICTION,
        },
    }
    probes = [
        "in.pressure",
        "out.pressure",
        "check.flow",
        "gate.head",
        "valve.flow",
        "main.pressure@0.37",
        "main.velocity@1.0",
        "shaft.level",
        "column.flow",
    ]
    return scene(nodes, links, 1.2, numerics, probes)


def surging(numerics: dict) -> dict:
    """Case of two pipes and a closing valve, suitable for fused steps."""
    nodes = {
        "lake": lake(60.0),
        "fork": junction(ramp(0.3, 0.1, 0.0, 0.02)),
        "gate": junction(),
        "out": reservoir(AMBIENT),
    }
    links = {
        "main": pipe(
            "lake", "fork", 1200.0, 0.5, 1000.0, 60, friction={"model": "steady", "factor": 0.018}
        ),
        "down": pipe("fork", "gate", 350.0, 0.4, 1100.0, 20),
        "valve": valve("gate", "out", 0.02, ramp(0.5, 0.2, 1.0, 0.0)),
    }
    return scene(
        nodes,
        links,
        2.0,
        numerics,
        ["gate.pressure", "main.pressure@0.37", "valve.flow", "down.flow@0.5"],
    )


SCENES = {"slam": slam, "surging": surging}


def with_rows(case: dict, every: float):
    return fvsolve.run({**case, "output": {**case["output"], "every": every}})


def excess(result) -> float:
    """Greatest distance of a row outside the printed extremes."""
    found = [
        (result[p].max() - e.maximum, e.minimum - result[p].min())
        for p, e in result.extremes.items()
    ]
    return float(np.max(found))


@pytest.mark.in_turn
@pytest.mark.parametrize("scene_name", SCENES)
@pytest.mark.parametrize("how", SETTINGS)
def test_steps_do_not_hang_on_rows_and_no_row_lies_beyond_the_extremes(how, scene_name):
    case = SCENES[scene_name](SETTINGS[how])
    alone = with_rows(case, NO_ROWS)
    assert alone.reason == "finished" and len(alone.t) <= 12  # only start, jumps and end
    for every in EVERY[:1] if how == "given" else EVERY:  # rows within divided steps are costly
        result = with_rows(case, every)
        for probe, extremes in result.extremes.items():
            assert result[probe][-1] == alone[probe][-1], (probe, every)
            assert (
                extremes.minimum <= alone.extremes[probe].minimum
                and extremes.maximum >= alone.extremes[probe].maximum
            )
        assert result.ledger["mass"]["remainder"] == alone.ledger["mass"]["remainder"]
        assert excess(result) <= 0.0


def test_rows_between_steps_keep_their_order_at_peaks():
    """Rows of a damped oscillator by rk4 converge with order 4 to its closed form.

    x = e^(-z w t) (cos w' t + z w / w' sin w' t)
    """
    nodes = {
        "wall": {"type": "frame"},
        "body": {"type": "mass", "mass": 4.0, "initial_position": 1.0},
    }
    links = {
        "spring": {
            "type": "spring",
            "from": "wall",
            "to": "body",
            "stiffness": 400.0,
            "free_length": 0.0,
        },
        "oil": {"type": "damper", "from": "wall", "to": "body", "damping": 8.0},
    }
    far, decay, swing = [], 1.0, math.sqrt(99.0)
    for size in (0.02, 0.01):
        case = scene(
            nodes, links, 3.0, {"method": "rk4", "step": size}, ["body.position"], every=0.0013
        )
        result = fvsolve.run(case)
        t = np.asarray(result.t)
        x = np.exp(-decay * t) * (np.cos(swing * t) + decay / swing * np.sin(swing * t))
        far.append(np.abs(result["body.position"] - x)[t > 0.7].max())
        assert excess(result) <= 0.0
    assert far[0] / far[1] == pytest.approx(16.0, rel=0.2)


WAYS = [
    {"method": name, "step": 2e-4}
    for name in ("rk4", "trapezoid", "rodas-5p", "radau-iia-5", "implicit-euler")
]
WAYS += [
    {"method": name, "rtol": 1e-8} for name in ("dormand-prince", "rodas-5p", "radau-iia-5", "auto")
]
ROUNDINGS = (-5, -2, -1, 0, 1, 2, 5)


def rounded_time(t: float, roundings: int) -> float:
    for _ in range(abs(roundings)):
        t = float(np.nextafter(t, math.copysign(math.inf, roundings)))
    return t


def filling(at: float, kind: str, numerics: dict) -> dict:
    """Case of a chamber between two valves, with one kink or jump of the supply pressure."""
    fed = {"time": [0.0, at], "value": [3e5, 3.1e5], "kind": "step"}
    if kind == "kink":
        fed = {"time": [0.0, at, at + 0.1], "value": [3e5, 3e5, 3.2e5]}
    nodes = {"fed": reservoir(fed), "c": chamber(0.05, 2.2e5), "sink": reservoir(AMBIENT)}
    links = {"in": valve("fed", "c", 1e-5), "out": valve("c", "sink", 1e-5)}
    return scene(nodes, links, 0.02, numerics, ["c.pressure"], 0.005)


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", ["kink", "jump"])
@pytest.mark.parametrize("numerics", WAYS, ids=lambda way: " ".join(map(str, way.values())))
def test_a_break_near_a_boundary_is_as_good_as_on_it(kind, numerics):
    ends = []
    for roundings in ROUNDINGS:
        for boundary in (0.01, 0.02):
            case = filling(rounded_time(boundary, roundings), kind, numerics)
            result = fvsolve.run(case)
            assert result.ok, result.reason
            model = fvsolve.build(fvsolve.load(case))
            state = fvsolve.initial_state(model)
            for until in (0.01, 0.02):
                state = fvsolve.advance(model, state, until)
                assert state.t == until
            if boundary == 0.01:
                ends += [result["c.pressure"][-1], 2.2e5 + state.y[0] * 2.2e9 / (RHO * 0.05)]
    assert np.ptp(ends) <= 1e-6 * ends[0]


def test_the_loop_of_the_manual_goes_through_a_shipped_drive():
    """A loop of advances by 1 ms passes the corners of the spool's schedule, one rounding error away from its sums."""
    model = fvsolve.build(fvsolve.load(CASES / "hydraulic-drive.toml"))
    state = fvsolve.initial_state(model)
    while state.t < 0.2:
        state = fvsolve.advance(model, state, state.t + 1e-3)
    assert state.t == pytest.approx(0.2, abs=1e-3)
