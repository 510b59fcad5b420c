"""Fused steps of upwind and Euler give the bits that rates, sum and record give one after the other."""

from importlib import import_module

import numpy as np
import pytest
from invariance.result_comparison import with_frames
from reference.folders import CASES
from reference.scenes import (
    AMBIENT,
    SHARP,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    tank,
    valve,
)

import fvsolve
from fvsolve.case import load
from fvsolve.core.model import RunData, build
from fvsolve.core.steppers.tableau import method_named

LOOP, SOLVE = (
    import_module("fvsolve.core.solve.run_loop"),
    import_module("fvsolve.core.solve.solve"),
)
RUBBED = {"friction": {"model": "steady", "factor": 0.018}}
CLOCK = ("ended", "seconds", "seconds_setup", "seconds_total", "cost")


def fork(end=4.0, every=0.05, fields=3, **numerics) -> dict:
    """Case of three pipes, one of a single cell, and a valve that closes: low pressures, rows between steps."""
    nodes = {
        "lake": lake(60.0),
        "fork": junction(),
        "dead": junction(ramp(0.3, 0.1, 0.0, 0.02)),
        "gate": junction(),
    }
    links = {
        "main": pipe("lake", "fork", 1200.0, 0.5, 1000.0, 1300, **RUBBED),
        "side": pipe("dead", "fork", 270.0, 0.3, 900.0, 1),
        "down": pipe("fork", "gate", 350.0, 0.4, 1100.0, 40, **RUBBED),
        "valve": valve("gate", "out", 0.02, ramp(0.5, 0.2, 1.0, 0.0)),
    }
    nodes["out"] = reservoir(AMBIENT)
    probes = ["gate.pressure", "dead.head", "valve.flow", "main.pressure@0.37", "down.flow@1.0"]
    case = scene(nodes, links, end, {**SHARP, **numerics}, probes, every)
    case["output"]["fields"] = fields
    return case


def step_by_step(monkeypatch) -> None:
    monkeypatch.setattr(LOOP, "fused_step_allowed", lambda model, method: False)


def assert_same(one, other) -> None:
    assert one.reason == other.reason
    assert np.array_equal(one.t, other.t)
    for probe in one.probes:
        assert np.array_equal(one[probe], other[probe], equal_nan=True), probe
    for name, pipe_envelope in one.envelope.items():
        for what, values in pipe_envelope.items():
            assert np.array_equal(values, other.envelope[name][what], equal_nan=True), (name, what)
    assert {**one.summary, **dict.fromkeys(CLOCK)} == {**other.summary, **dict.fromkeys(CLOCK)}


SCENES = {
    "courant": fork(),
    "below one": fork(courant=0.7),
    "fixed step": {
        **fork(),
        "numerics": {"end": 4.0, "scheme": "upwind", "method": "euler", "step": 8.1e-4},
    },
    "rows at every step": fork(every=0.0004, end=1.0),
    "stops below vapour pressure": fork(below_vapor="stop"),
    "unstable": fork(courant=2.3, end=8.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_bits_are_those_of_the_general_path(name, monkeypatch):
    """Fused steps agree with general steps, with field frames and without."""
    alone = fvsolve.run(SCENES[name])
    with with_frames():
        leapt = fvsolve.run(SCENES[name])
    assert_same(alone, leapt)
    step_by_step(monkeypatch)
    with with_frames():
        assert_same(leapt, fvsolve.run(SCENES[name]))


def test_a_run_in_memory_computes_no_frames(monkeypatch):
    def refuse(*arguments):
        raise AssertionError("a frame was computed")

    monkeypatch.setattr(RunData, "fields", refuse)
    assert fvsolve.run(fork(fields=5)).reason == "finished"


def test_a_run_interrupted_and_resumed_equals_the_uninterrupted_run_of_the_general_path(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(SOLVE, "CHECKPOINT_SECONDS", 0.0)
    times = []

    def interrupt(t, seconds, steps):
        times.append(t)
        if len(times) == 3:
            raise KeyboardInterrupt

    case = fork(end=40.0, every=0.5)
    assert not fvsolve.run(case, out=tmp_path / "run", progress=interrupt, pictures=False).ok
    assert 0.0 < times[1] < 40.0
    resumed = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    step_by_step(monkeypatch)
    unbroken = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    files = sorted(p.name for p in (tmp_path / "whole").glob("*.csv"))
    assert files
    for file in files:
        assert (tmp_path / "run" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes(), (
            file
        )
    assert resumed.ledger == unbroken.ledger


@pytest.mark.parametrize(
    ("case", "allowed"),
    [
        (fork(), True),
        (fork(scheme="muscl"), False),
        (fork(method="ssp-rk2"), False),
        ({**fork(), "fluid": {**fork()["fluid"], "law": "log"}}, False),
        ({**fork(), "nodes": {**fork()["nodes"], "out": tank(3.0, 2.0)}}, False),
    ],
    ids=["upwind and euler", "scheme", "method", "law", "tank"],
)
def test_only_upwind_and_euler_take_multiple_steps_and_only_pipes(case, allowed):
    model = build(load(case))
    assert LOOP.fused_step_allowed(model, method_named(model.case.numerics.method)) is allowed


def test_scenes_with_events_are_stepped_singly_and_end():
    """A fused step that an event cut short once repeated without end."""
    plain = {"numerics.scheme": "upwind", "numerics.method": "euler", "numerics.courant": 1.0}
    case = CASES / "relief-on-closed-main.toml"
    result = fvsolve.run(case, set=plain)
    assert result.ok and result.summary["events"]
    assert not LOOP.fused_step_allowed(build(load(case, plain)), method_named("euler"))
