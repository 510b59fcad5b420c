"""Poles, values out of range and narrow pulses of formulas of time, against values on fine grids and closed forms."""

import math

import numpy as np
import pytest
from reference.scenes import scene, tank

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.parts.formula_intervals import find_pole, find_pulses
from fvsolve.parts.formula_program import Program

POLES = {
    "0.01/(t-4)": 4.0,
    "1/(t-pi)": math.pi,
    "1/(t-4)^2": 4.0,
    "tan(t/2)": math.pi,
    "log(abs(t-4))": 4.0,
    "(t-4)^-3": 4.0,
    "1/(sin(t)-0.5)": math.pi / 6,
    "exp(t)/(exp(t)-20)": math.log(20),
    "2 - 3/(t^2-2*t+1)": 1.0,
    "where(t < 3, 0, 1/(t-7.123))": 7.123,
    "1/min(t-4, 5)": 4.0,
    "1/(tanh(t-2.7))": 2.7,
}
REGULAR = [
    "where(t < 5, 1/(10-t), 0)",
    "where(abs(t-4) > 0.1, 1/(t-4), 10)",
    "sqrt(t^2-8*t+16)",
    "0.5+0.5*sin(2*pi*t/11)",
    "1/(t^2-2*t+1.0001)",
    "t^0.5",
    "1/(1.5+sin(40*t))",
    "arctan2(t-5, t-4)",
    "sin(t)/(1+t)",
    "tanh((t-5)/1e-4)",
    "exp(-t)*t^3",
    "hypot(t-3, t)",
    "max(t-3, 1)^-2",
    "abs(t-5)",
    "1/(where(t < 5, 1, 2))",
]


def sampled(text):
    program = Program(text)
    return program.bounds, *program.samples(0.0, 10.0)


@pytest.mark.parametrize("text", POLES)
def test_a_pole_between_samples_is_located_at_its_time(text):
    with np.errstate(all="ignore"):
        found = find_pole(*sampled(text))
    places = [POLES[text] + 2 * math.pi * k for k in range(3)] + [math.pi - POLES[text]]
    assert min(
        abs(found - place) for place in [POLES[text], *(places if "(t" in text else [])]
    ) < 1e-5 or (text == "1/(sin(t)-0.5)" and abs(math.sin(found) - 0.5) < 1e-5)


@pytest.mark.parametrize("text", REGULAR)
def test_formulas_without_poles_pass(text):
    assert find_pole(*sampled(text)) is None
    assert find_pulses(*sampled(text)) == []


@pytest.mark.parametrize(
    "text", [*POLES, *REGULAR, "t^(t-1)", "(t-5)^2", "cos(3*t)*tan(t)", "min(t, 3, 10-t)"]
)
def test_values_lie_within_their_bounds(text):
    """Random intervals of all widths contain the values at random times within them."""
    random = np.random.default_rng(5)
    begin = random.uniform(0.01, 9.0, 400)
    width = 10.0 ** random.uniform(-6, 0, 400)
    program = Program(text)
    breaks = np.array(program.break_times)
    found = program.bounds(begin, begin + width)
    for share in random.uniform(0.0, 1.0, 5):
        with np.errstate(all="ignore"):
            values = np.array([program.value(t) for t in (begin + share * width).tolist()])
        slack = 1e-9 * (1.0 + np.abs(values))
        inside = (values >= found.low - slack) & (values <= found.high + slack)
        cut = np.array(
            [any((a <= t <= b) for t in breaks) for a, b in zip(begin, begin + width, strict=True)]
        )
        assert np.all(inside | found.doubt | cut)


@pytest.mark.parametrize(
    "text, place",
    [
        ("exp(-((t-5.0003)/1e-4)^2)", 5.0003),
        ("2 + max(0, 1-abs(t-5.00031)/1e-5)", 5.00031),
        ("where(abs(t-3.3331)<1e-5, 3, 0)", 3.3331),
        ("sin(t) + 7/(1+((t-2.00017)/1e-5)^2)", 2.00017),
    ],
)
def test_a_narrow_pulse_gets_ends_of_steps_on_both_sides(text, place):
    times = find_pulses(*sampled(text))
    assert len(times) == 17 and times[0] < place < times[-1] and times[-1] - times[0] < 4e-3


def filled(flow, numerics):
    """Level of a tank of 2 m2 that is filled from 1 m by a flow, after 10 s."""
    nodes = {"feed": {"type": "inflow", "flow": flow}, "tank": tank(2.0, 1.0)}
    pipe = {
        "type": "orifice",
        "from": "feed",
        "to": "tank",
        "area": 0.02,
        "discharge_coefficient": 1.0,
    }
    return scene(nodes, {"pipe": pipe}, 10.0, numerics, ["tank.level"], every=10.0)


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-4", "auto"])
def test_a_narrow_pulse_is_not_stepped_over(method):
    """A Gaussian pulse of 1 ms holds 0.5 m3, whichever steps the method would take without it."""
    width, volume = 1e-4, 0.05
    flow = f"{volume / (width * math.sqrt(math.pi))!r}*exp(-((t-5.0003)/{width})^2)"
    run = fvsolve.run(filled(flow, {"method": method, "rtol": 1e-6}))
    assert run.ok and run.si("tank.level")[-1] == pytest.approx(1.0 + volume / 2.0, abs=1e-5)


def test_a_narrow_pulse_is_not_stepped_over_by_given_steps():
    flow = f"{0.05 / (1e-4 * math.sqrt(math.pi))!r}*exp(-((t-5.0003)/1e-4)^2)"
    run = fvsolve.run(filled(flow, {"method": "rk4", "step": 0.1}))
    assert run.si("tank.level")[-1] == pytest.approx(1.025, abs=1e-3)


@pytest.mark.parametrize(
    "flow, wanted",
    [
        ("0.01/(t - 4)", "at t = 4 s"),
        ("0.01/(t - pi)", "at t = 3.14159 s"),
        ("1e-3*tan(t/2.7)", "at t = 4.24115 s"),
    ],
)
def test_a_formula_with_a_pole_is_a_fault_with_its_time(flow, wanted):
    with pytest.raises(FvsolveError) as caught:
        fvsolve.load(filled(flow, {"method": "dormand-prince", "rtol": 1e-6}))
    assert wanted in str(caught.value) and "nodes.feed.flow" in str(caught.value)


def test_a_pole_in_a_block_is_a_fault_with_its_time():
    case = filled({"control": "wave"}, {"method": "dormand-prince", "rtol": 1e-6})
    block = {"type": "function", "formula": "0.01/(t - 7)", "limits": [-1.0, 1.0]}
    with pytest.raises(FvsolveError) as caught:
        fvsolve.load(case | {"controls": {"wave": block}})
    assert "at t = 7 s" in str(caught.value) and "controls.wave.formula" in str(caught.value)


def test_a_narrow_excess_of_a_range_is_a_fault_with_its_time():
    case = filled(0.0, {"method": "dormand-prince", "rtol": 1e-6})
    valve = {
        "type": "valve",
        "from": "feed",
        "to": "tank",
        "area": 1e-3,
        "opening": "0.5 + exp(-((t-5.0003)/1e-4)^2)",
    }
    with pytest.raises(FvsolveError) as caught:
        fvsolve.load(case | {"links": {"pipe": valve}})
    assert "out of range" in str(caught.value) and "at t = 5.000" in str(caught.value)
