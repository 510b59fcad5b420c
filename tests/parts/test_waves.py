"""Harmonic schedules: values and both derivatives against the formula, integrals of a flow, and faults."""

import math

import numpy as np
import pytest
from reference.scenes import AMBIENT, WATER, reservoir, scene

from fvsolve import run
from fvsolve.assembly.schedule_tables import Schedules
from fvsolve.case.load import load
from fvsolve.errors import CaseError
from fvsolve.exact.solution import value
from fvsolve.kernels.schedule_pieces import piece_slopes, piece_value
from fvsolve.parts.schedule import Schedule

WAVE = {"mean": 0.01, "amplitude": "5 l/s", "period": "0.4 s", "phase": "30 deg"}
BULK = WATER["bulk_modulus"]


def chamber(flow, **numerics):
    nodes = {
        "tank": {"type": "chamber", "volume": 2.0, "initial_pressure": AMBIENT},
        "in": {"type": "inflow", "flow": flow},
    }
    links = {"pipe": {"type": "valve", "from": "in", "to": "tank", "area": 0.01}}
    return scene(nodes, links, 1.0, numerics or {"rtol": 1e-9}, ["tank.pressure"])


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-4"])
def test_what_a_wave_brings_is_its_integral(method):
    case = chamber(WAVE, rtol=1e-8, method=method)
    result = run(case)
    w, phase = 2 * math.pi / 0.4, math.pi / 6
    volume = 0.01 * result.t + 0.005 / w * (math.cos(phase) - np.cos(w * result.t + phase))
    assert result["tank.pressure"] == pytest.approx(AMBIENT + BULK * volume / 2.0, rel=1e-6)


def test_a_wave_said_by_a_signal_in_other_units_is_the_same_to_the_bit():
    said = chamber({"signal": "swing"}, rtol=1e-8)
    said["signals"] = {"swing": {"phase": math.pi / 6, "period": "400 ms", "amplitude": "18 m3/h", "mean": "36 m3/h"}}
    assert np.array_equal(run(said)["tank.pressure"], run(chamber(WAVE, rtol=1e-8))["tank.pressure"])


@pytest.mark.parametrize("kind", ["harmonic", "ramp", "smooth", "linear"])
def test_slopes_of_schedules_are_those_of_their_values(kind):
    times, values = [0.0, 0.7, 1.5], [1.0, -2.0, 3.0]
    one = {
        "harmonic": Schedule("harmonic", (-np.inf, np.inf), (-3.0, 5.0), wave=(1.0, 4.0, 0.8, 0.3)),
        "ramp": Schedule("ramp", (0.0, 1.5), (1.0, 3.0), 2.5),
    }.get(kind, Schedule(kind, times, values))
    table = Schedules()
    table.add(one, 2.0, 0.5)
    _, pieces = table.tables()
    for t in (0.2, 0.6, 0.9, 1.3):
        row = np.flatnonzero(pieces[:, 0] <= t)[-1]
        at = lambda s, row=row: piece_value(pieces, row, s)  # noqa: E731
        assert at(t) == pytest.approx(2.0 * value(one, t) + 0.5)
        h = 1e-4
        first, second = (at(t + h) - at(t - h)) / (2 * h), (at(t + h) - 2 * at(t) + at(t - h)) / h**2
        assert piece_slopes(pieces, row, t) == pytest.approx((first, second), rel=1e-5, abs=1e-5)


def test_a_spool_that_swings_opens_each_way_by_the_positive_part_and_steps_end_where_it_is_centred():
    nodes = {
        "P": reservoir(AMBIENT + 2e6), "T": reservoir(AMBIENT),
        "A": reservoir(AMBIENT + 1e6), "B": reservoir(AMBIENT + 1e6),
    }  # fmt: skip
    spool = {
        "type": "spool-valve", "ports": {one: one for one in "PTAB"}, "discharge_coefficient": 0.6, "area": 1e-5,
        "position": {"mean": 0.1, "amplitude": 0.4, "period": 0.5},
    }  # fmt: skip
    case = scene(nodes, {"spool": spool}, 1.0, {"step": 0.01}, ["spool.flow_A"], every=0.01)
    result = run(case)
    x = 0.1 + 0.4 * np.sin(2 * np.pi * result.t / 0.5)
    full = 0.6 * 1e-5 * math.sqrt(2 * 1e6 / 1000.0)
    wanted = np.where(x > 0, x, 0) * full - np.where(x < 0, -x, 0) * full
    found = result["spool.flow_A"]
    assert np.abs(np.abs(found) - np.abs(wanted)).max() < 1e-9 * full
    up = math.asin(0.25)
    zeros = [
        (angle + 2 * math.pi * k) * 0.5 / (2 * math.pi) for k in (0, 1) for angle in (math.pi + up, 2 * math.pi - up)
    ]
    assert [t for t, jump in breaks_of(case) if not jump] == pytest.approx(sorted(zeros))


def breaks_of(case):
    from fvsolve.model.build import build

    return build(load(case)).breaks


FAULTS = {
    "period is missing": {"mean": 1.0, "amplitude": 1.0},
    "period": {"mean": 1.0, "amplitude": 1.0, "period": 0},
    "amplitude": {"mean": 0.9, "amplitude": 0.2, "period": 1.0},
    "did you mean": {"mean": 0.5, "amplitude": 0.2, "period": 1.0, "phse": 0},
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_wave_that_is_none_is_refused_by_name(text):
    case = scene(
        {"a": reservoir(2e5), "b": reservoir(1e5)},
        {"v": {"type": "valve", "from": "a", "to": "b", "area": 1e-4, "opening": FAULTS[text]}}, 1.0, {},
    )  # fmt: skip
    with pytest.raises(CaseError, match=text):
        load(case)
