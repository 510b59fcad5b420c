"""Faults of turbines and hill charts, and the extension of a chart beyond its points."""

import copy
import math
import random
from types import SimpleNamespace

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import GRAVITY, RHO, lake, scene

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.parts.turbine import law as turbine_law
from fvsolve.parts.turbine.hill_chart import HillChartValue
from fvsolve.parts.turbine.lower import chart_numbers
from fvsolve.parts.value import ReadContext

HALF = {"opening": 0.5, "unit_speed": [40, 60, 90], "unit_flow": [0.52, 0.5, 0.41], "efficiency": [0.7, 0.85, 0.6]}
FULL = {"opening": 1.0, "unit_speed": [45, 95], "unit_flow": [0.95, 0.8], "unit_torque": [1500, 700]}
WEIGHT = RHO * GRAVITY


def case(chart=(HALF, FULL), **keys) -> dict:
    unit = {"type": "turbine", "from": "up", "to": "low", "diameter": 1.5, "speed": "300 rpm", "hill_chart": chart}
    if isinstance(chart, tuple):
        unit["hill_chart"] = list(chart)
    numerics = {"method": "rk4", "step": 0.1}
    return scene({"up": lake(80.0), "low": lake(0.0)}, {"unit": {**unit, **keys}}, 1.0, numerics)


def faults(*given, **keys) -> str:
    with pytest.raises(CaseError) as caught:
        fvsolve.build(fvsolve.load(case(*given, **keys)))
    return str(caught.value)


def half(**keys) -> tuple:
    return ({k: v for k, v in {**HALF, **keys}.items() if v is not None}, FULL)


STILL = {"opening": 0, "unit_speed": [70], "unit_flow": [0], "unit_torque": [-30]}
FOUND = [
    (half(opening=None), "hill_chart[0]: opening is missing"),
    (half(opening=1.0), "hill_chart[1].opening: 1 is already the opening of hill_chart[0]"),
    (half(opening=1.2), "hill_chart[0].opening: 1.2 is out of range"),
    (half(efficiency=None), "hill_chart[0]: efficiency or unit_torque is missing"),
    (half(unit_torque=[1, 2, 3]), "hill_chart[0].unit_torque: efficiency and unit_torque are given; keep one"),
    (half(efficiency=[0.7, 85, 0.6]), "hill_chart[0].efficiency[1]: 85 is out of range; expected a value between"),
    (half(efficiency=[0.7, 0.8]), "3 of unit_speed, 3 of unit_flow, 2 of efficiency; expected equal numbers"),
    (half(unit_speed=[40], unit_flow=[0.5], efficiency=[0.7]), "hill_chart[0]: has one point; expected at least two"),
    (half(unit_speed=[60, 40, 90]), "hill_chart[0]: turns back at point 2, (40, 0.5); a curve may fold in unit_speed"),
    (half(unit_speed=[40, 40, 90], unit_flow=[0.5, 0.5, 0.4]), "points 1 and 2, (40, 0.5) and (40, 0.5), are in line"),
    (half(unit_speed=[-40, 60, 90]), "gives no torque at point 1, (-40, 0.52); expected unit_torque instead for"),
    (half(unit_flow=[-0.5, -0.4, -0.3], efficiency=None, unit_torque=[-9e3] * 3), "unit_flow: has no value of 0.001"),
    (half(unit_speed=[-90, -60], unit_flow=[0.4, 0.5], efficiency=None, unit_torque=[1, 1]),
     "unit_speed: is below 0.001 at the end of the curve with the least angle"),
    (half(unit_speed=[60, 20, -9], unit_flow=[0.4, -0.4, -0.5], efficiency=None, unit_torque=[1, -9e3, 9e3]),
     "passes from (20, -0.4) to (-9, -0.5) across reverse flow through a runner at rest"),
    (half(efficiency=None, unit_torque=[1, 9e3, 1]),
     "opening 0.5: torque at unit_speed 60, unit_flow 0.5 means an efficiency of 11.53"),
    (half(efficiency=[0.99, 0.99, 0.2]), "the efficiency would exceed 1; give more points there"),
    ((HALF, {**STILL, "unit_flow": [0.01]}), "hill_chart[1].unit_flow: 0.01 is a flow through shut vanes; expected 0"),
    ((HALF, {**STILL, "unit_torque": [3]}), "3 drives the runner behind shut vanes; expected 0 or less"),
    ((HALF, {**HALF, "opening": 0}), "vanes at opening 0 are shut; expected no curve, or a single point"),
    ((STILL,), "hill_chart: has no curve of an opening above 0"),
    ([], "is not a list of curves"),
    ([3], "hill_chart[0]: 3 is not a table"),
    ({"file": "nowhere.csv"}, "there is no such file"),
    ({"file": "a.csv", "of": 1}, "hill_chart.of: unknown key; expected only `file`"),
]  # fmt: skip


@pytest.mark.parametrize("chart, message", FOUND, ids=[message[-40:] for _, message in FOUND])
def test_a_fault_of_a_hill_chart(chart, message):
    assert message in faults(chart)


def test_faults_of_its_keys_come_with_those_of_its_chart():
    said = faults(half(efficiency=[0.7, 0.85]), trip=1.0, diameter=-1.0, opening=1.5)
    for one in (
        "trip: needs the key `inertia`",
        "diameter: -1.0 is out of range",
        "opening: 1.5 is out",
        "2 of efficiency",
    ):
        assert one in said
    assert "-1 s lies before the start" in faults(trip=-1.0, inertia=1e4)
    assert "give the turbine `inertia`" in torque_on({})
    assert "until the trip" in torque_on({"inertia": 1e4, "trip": 0.5})


def torque_on(keys) -> str:
    made = case(**keys)
    made["links"]["motor"] = {"type": "torque", "to": "unit.shaft", "torque": 10.0}
    return str(refused(made))


@pytest.mark.parametrize("header, message", [
    ("opening,unit_speed,unit_flow", "expected a column efficiency or unit_torque; the file has neither"),
    ("opening,unit_speed [rad/s],unit_flow,efficiency", 'unit_speed in rpm m^(1/2)'),
    ("opening,n11,unit_flow,efficiency", 'has no column "unit_speed"'),
    ("opening,unit_speed,unit_flow,efficiency", "chart.csv, opening 0.5: efficiency: 85.0 is out of range"),
    ("efficiency,unit_speed,unit_flow,opening", "opening 85: opening: 85.0 is out of range"),
])  # fmt: skip
def test_a_fault_of_a_file(header, message, tmp_path):
    row = ["0.5,60,0.5,85", "0.5,80,0.4,0.7"]
    cells = [one.split(",")[: header.count(",") + 1] for one in row]
    (tmp_path / "chart.csv").write_text("\n".join([header, *map(",".join, cells)]))
    assert message in faults({"file": str(tmp_path / "chart.csv")})


@pytest.mark.parametrize("seed", range(3))
def test_spoiled_charts_are_refused_or_run(seed):
    """A chart with random invalid entries gives a named fault, or a run that fails or has finite flows."""
    draw = random.Random(seed)
    odd = [0, -1, 1e-300, 1e300, math.nan, math.inf, "x", None, [], {}, True, 1, 60.0, [0.5, 0.4], "50 %"]
    for _ in range(60):
        chart = [{k: list(v) if isinstance(v, list) else v for k, v in one.items()} for one in (HALF, FULL, STILL)]
        for _ in range(draw.randint(1, 3)):
            one, key = draw.choice(chart), draw.choice([*HALF, "unit_torque"])
            if isinstance(one.get(key), list) and one[key] and draw.random() < 0.7:
                one[key][draw.randrange(len(one[key]))] = copy.deepcopy(draw.choice(odd))
            else:
                one[key] = copy.deepcopy(draw.choice(odd))
        try:
            found = fvsolve.run(case(chart, opening={"time": [0, 1], "value": [1, 0]}))
        except CaseError:
            continue
        assert np.isfinite(found["unit.flow"]).all() or not found.ok


def random_chart(draw) -> list[dict]:
    """Return random curves of one to three openings through any quadrants, some of them folded."""
    low, high, chart = draw.uniform(-1.4, 0.9), draw.uniform(1.2, 4.4), []
    for opening in sorted(draw.uniform(0.05, 1.0, draw.integers(1, 4))):
        angle = np.linspace(low, high, draw.integers(7, 16)) + draw.uniform(-0.05, 0.05)
        far = 1.0 + 0.3 * np.sin(angle * draw.uniform(0.5, 3.0) + draw.uniform(0, 6))
        n, q = 80.0 * far * np.cos(angle), opening * far * np.sin(angle)
        most = WEIGHT * q * 30.0 / math.pi / n
        torque = np.where(
            q > 0.0, np.where(n > 0.0, np.minimum(0.6 * most, 4e3 * opening), 500.0 * opening), 2.5 * most
        )
        chart.append({"opening": float(opening), "unit_speed": n.tolist(), "unit_flow": q.tolist(),
                      "unit_torque": torque.tolist()})  # fmt: skip
    return chart


def test_at_any_speed_flow_and_opening_it_loses_power_and_nothing_jumps():
    """rho g Q H is never less than torque omega; head and torque are continuous in speed, flow and opening."""
    draw, tried = np.random.default_rng(5), 0
    for _ in range(80):
        try:
            chart = HillChartValue().read(random_chart(draw), ReadContext())
            fvsolve.load(case(chart.table()))
        except (CaseError, ValueError):
            continue
        tried += 1
        numbers = np.array(chart_numbers(SimpleNamespace(hill_chart=chart, diameter=1.3), WEIGHT))
        for _ in range(100):
            x, omega = draw.uniform(1e-3, 1.0), draw.uniform(-60.0, 60.0)
            q = draw.uniform(-2.0, 2.0) * turbine_law.capacity(numbers, 0, x) * numbers[turbine_law.FLOW]
            root, _, _, torque, _ = turbine_law.chart_at(numbers, 0, x, omega, q)
            given, taken = WEIGHT * q * root * abs(root), torque * omega
            assert given - taken >= -1e-9 * (abs(given) + abs(taken))
            for more in ((x * (1 - 1e-9), omega, q), (x, omega + 1e-9, q), (x, omega, q * (1 + 1e-9))):
                near = turbine_law.chart_at(numbers, 0, *more)
                assert abs(near[0] - root) < 1e-5 * (1.0 + abs(root)) and abs(near[3] - torque) < 1e-5 * (
                    1e3 + abs(torque)
                )
    assert tried > 20
