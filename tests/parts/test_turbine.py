"""Turbines with hill charts: steady points, load rejection, runaway, folded curves, energy; against SciPy.

LINE has Q11 = x (1.2 - 0.008 n11) and T11 = x (1800 - 18 n11), which linear interpolation reproduces exactly.
Faults of hill charts, and the extension of a chart beyond its points.
"""

import copy
import math
import random
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pytest import approx
from reference.hydropower import chart, steady
from reference.refusals import refused
from reference.scenes import (
    GRAVITY,
    NO_FRICTION,
    RHO,
    SHARP,
    WATER,
    area,
    junction,
    lake,
    pipe,
    scene,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.errors import CaseError
from fvsolve.parts.turbine import law as turbine_law
from fvsolve.parts.turbine.hill_chart import HillChartValue
from fvsolve.parts.turbine.lower import chart_numbers
from fvsolve.parts.value import ReadContext
from fvsolve.studies.energy_balance import energy

ALPHA, BETA, PUSH, BRAKE = 1.2, 0.008, 1800.0, 18.0
D, INERTIA, HEAD, LENGTH, BORE = 1.5, 60e3, 80.0, 300.0, 2.25
RPM = 30.0 / math.pi
OMEGA = 375.0 / RPM
TIGHT = {"method": "dormand-prince", "rtol": 1e-10}
VANES = {"time": [2.0, 5.0, 8.0], "value": [0.8, 0.3, 0.1]}
PROBES = ["unit.flow", "unit.head", "unit.speed", "unit.torque"]


def line(x: float, speeds=(0.0, 60.0, 150.0)) -> dict:
    flows, torques = (
        [x * (ALPHA - BETA * n) for n in speeds],
        [x * (PUSH - BRAKE * n) for n in speeds],
    )
    return {"opening": x, "unit_speed": list(speeds), "unit_flow": flows, "unit_torque": torques}


LINE = [line(0.4), line(1.0)]


def turbine(**more) -> dict:
    return {
        "type": "turbine",
        "from": "mid",
        "to": "low",
        "diameter": D,
        "speed": OMEGA,
        "hill_chart": LINE,
        **more,
    }


def plant(numerics, end=20.0, conduit=None, every=0.5, **keys) -> dict:
    """Return a case of lake, conduit, turbine and lake; the conduit is a rigid column unless given."""
    column = {
        "type": "rigid-column",
        "length": LENGTH,
        "diameter": BORE,
        "friction": dict(NO_FRICTION),
    }
    nodes = {"up": lake(HEAD), "mid": junction(), "low": lake(0.0)}
    links = {"way": {**(conduit or column), "from": "up", "to": "mid"}, "unit": turbine(**keys)}
    return scene(nodes, links, end, numerics, PROBES, every)


def direct(head: float, **keys) -> dict:
    """Return a case of a turbine between two lakes."""
    unit = {**turbine(**keys), "from": "up"}
    probes = [*PROBES, "unit.power", "unit.opening"]
    return scene(
        {"up": lake(head), "low": lake(0.0)},
        {"unit": unit},
        1.0,
        {"method": "rk4", "step": 0.1},
        probes,
        0.5,
    )


def head_of(x, q, omega):
    root = (q / (x * D * D) + BETA * omega * RPM * D) / ALPHA
    return root * abs(root)


def rejection(times):
    """Return (flow, speed) of column and shaft at `times` after a load rejection at 1 s, by SciPy."""

    def rate(t, y):
        q, omega = y
        x = np.interp(t, VANES["time"], VANES["value"])
        h = head_of(x, q, omega)
        torque = D**3 * x * (PUSH * h - BRAKE * omega * RPM * D * math.sqrt(h))
        return [GRAVITY * area(BORE) / LENGTH * (HEAD - h), torque / INERTIA]

    y, found = [0.8 * D * D * (ALPHA * math.sqrt(HEAD) - BETA * 375.0 * D), OMEGA], []
    for begin, end in ((1.0, 2.0), (2.0, 5.0), (5.0, 8.0), (8.0, 20.0)):
        inside = [t for t in times if begin < t <= end]
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
        one = solve_ivp(
            rate, (begin, end), y, t_eval=[*inside, end] if inside[-1] < end else inside, **options
        )
        y = one.y[:, -1]
        found.append(one.y[:, : len(inside)])
    return np.concatenate(found, axis=1)


@pytest.mark.parametrize(
    "method", [TIGHT, {"method": "radau-iia-5", "rtol": 1e-9}, {"method": "rodas-5p", "rtol": 1e-9}]
)
def test_a_rejected_load_with_a_column_is_its_two_equations(method):
    result = fvsolve.run(plant(method, inertia=INERTIA, trip=1.0, opening=VANES))
    after = result.t > 1.0
    q, omega = rejection(result.t[after])
    assert result["unit.flow"][after] == approx(q, rel=1e-8)
    assert result["unit.speed"][after] == approx(omega, rel=1e-9)
    heads = head_of(np.interp(result.t[after], VANES["time"], VANES["value"]), q, omega)
    assert result["unit.head"][after] == approx(heads, rel=1e-7)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_the_ledger_of_energy_closes_with_the_step():
    """The energy balance closes; energy of the shaft and work at the generator equal their formulas."""
    found = energy(plant(TIGHT, inertia=INERTIA, trip=1.0, opening=VANES))
    assert found.ok and found.relative < 1e-10
    assert min(np.diff(found.dissipated["unit turbine"])) > 0.0
    speed = rejection([2.0, 5.0, 8.0, 20.0])[1, -1]
    assert found.stored["unit"][-1] == approx(0.5 * INERTIA * (speed**2 - OMEGA**2), rel=1e-8)
    torque = D**3 * 0.8 * (PUSH * HEAD - BRAKE * 375.0 * D * math.sqrt(HEAD))
    assert found.supplied["unit"][-1] == approx(-torque * OMEGA, rel=1e-9)  # during 1 s


CHART = [
    {
        "opening": 0.5,
        "unit_speed": [40, 60, 90],
        "unit_flow": [0.52, 0.5, 0.41],
        "efficiency": [0.7, 0.85, 0.6],
    },
    {
        "opening": 0.9,
        "unit_speed": [45, 65, 95],
        "unit_flow": [0.95, 0.92, 0.8],
        "efficiency": [0.75, 0.91, 0.7],
    },
]


@pytest.mark.parametrize("curve, point", [(0, 1), (0, 2), (1, 0), (1, 1)])
def test_a_point_of_the_chart_is_the_operation_of_the_turbine(curve, point):
    one = CHART[curve]
    n11, q11, eta = (one[key][point] for key in ("unit_speed", "unit_flow", "efficiency"))
    head = (300.0 * D / n11) ** 2
    result = fvsolve.run(direct(head, hill_chart=CHART, speed="300 rpm", opening=one["opening"]))
    flow = q11 * D * D * math.sqrt(head)
    assert result["unit.flow"] == approx(np.full(len(result.t), flow), rel=1e-12)
    assert result["unit.head"][-1] == approx(head)
    assert result["unit.power"][-1] == approx(eta * RHO * GRAVITY * flow * head, rel=1e-12)
    assert result["unit.torque"][-1] == approx(result["unit.power"][-1] / (300.0 / RPM), rel=1e-12)


def test_between_openings_flow_at_an_angle_is_straight_in_the_opening():
    """Q11 / x of LINE is one function of n11 at every opening, down to closed vanes."""
    for x in (1.0, 0.7, 0.4, 0.1, 1e-3):
        flow = fvsolve.run(direct(HEAD, opening=x))["unit.flow"][-1]
        assert flow == approx(x * D * D * (ALPHA * math.sqrt(HEAD) - BETA * 375.0 * D), rel=1e-12)
    shut = fvsolve.run(direct(HEAD, opening=0.0))
    assert not shut["unit.flow"].any() and shut["unit.head"][-1] == approx(HEAD)


def test_it_runs_away_to_where_it_has_no_torque():
    """Runaway at zero torque: n11 = PUSH / BRAKE = 100."""
    case = direct(HEAD, inertia=200.0, trip=0.0, opening=0.7)
    case["numerics"] = {"end": 30.0, **TIGHT}
    found = fvsolve.run(case)
    assert found["unit.speed"][-1] == approx(100.0 * math.sqrt(HEAD) / D / RPM, rel=1e-9)
    assert abs(found["unit.torque"][-1]) < 1e-6 * found["unit.torque"][0]


def test_faster_than_that_it_brakes_and_torques_turn_it():
    """A torque on the shaft keeps n11 = 110, where T11 = -180 x."""
    omega = 110.0 * math.sqrt(HEAD) / D / RPM
    torque = D**3 * HEAD * 0.7 * 180.0
    case = direct(HEAD, inertia=200.0, speed=omega, opening=0.7)
    case["links"]["motor"] = {"type": "torque", "to": "unit.shaft", "torque": torque}
    found = fvsolve.run(case)
    assert found["unit.speed"] == approx(np.full(len(found.t), omega), rel=1e-10)
    assert found["unit.torque"] == approx(np.full(len(found.t), -torque), rel=1e-9)


def test_vanes_that_shut_at_once_are_joukowsky():
    conduit = {
        k: v for k, v in pipe("up", "mid", 600.0, BORE, 1000.0, 30, friction=NO_FRICTION).items()
    }
    shut = {"time": [0.1, 0.2], "value": [0.8, 0.0], "kind": "step"}
    case = plant(dict(SHARP), 0.9, conduit, 0.02, opening=shut)
    case["output"]["probes"] = ["unit.flow", "mid.pressure"]
    found = fvsolve.run(case)
    rise = found["mid.pressure"][found.t > 0.25] - found["mid.pressure"][0]
    assert rise == approx(
        np.full(len(rise), RHO * 1000.0 * found["unit.flow"][0] / area(BORE)), rel=1e-12
    )


# Pump-turbine with a folded curve: distance and T11 over the angle of Q11 / 0.8 and n11 / 85.
FOLD = {"diameter": 3.0, "speed": 264.0 / RPM, "inertia": 3e5, "trip": 1.0}


def distance(angle):
    return 1.0 + 0.22 * np.sin(5.0 * (angle - 0.62)) * np.exp(-(((angle - 0.35) / 0.5) ** 2))


def folded(points: int) -> dict:
    angle = np.linspace(-0.6, 1.5, points)
    n, q = 85.0 * distance(angle) * np.cos(angle), 0.8 * distance(angle) * np.sin(angle)
    torque = 1600.0 * (angle - 0.45)
    return {
        "opening": 1.0,
        "unit_speed": n.tolist(),
        "unit_flow": q.tolist(),
        "unit_torque": torque.tolist(),
    }


def folds(points: int, numerics, conduit=None) -> fvsolve.Result:
    way = {
        "type": "rigid-column",
        "length": 500.0,
        "diameter": math.sqrt(48.0 / math.pi),
        "friction": dict(NO_FRICTION),
    }
    case = plant(numerics, 40.0, conduit or way, hill_chart=[folded(points)], **FOLD)
    case["nodes"]["up"] = lake(200.0)
    return fvsolve.run(case)


def test_through_its_folds_a_pump_turbine_is_its_equations_to_second_order_in_its_points():
    """The oscillation between branches is permanent, because runaway lies where n11 falls with Q11."""

    def state(q, omega):
        n, u = omega * RPM * 3.0 / 85.0, q / 9.0 / 0.8
        angle = math.atan2(u, n)
        return (n * n + u * u) / distance(angle) ** 2, angle

    def rate(t, y):
        h, angle = state(*y)
        return [GRAVITY * 12.0 / 500.0 * (200.0 - h), 27.0 * h * 1600.0 * (angle - 0.45) / 3e5]

    n = np.array(folded(200)["unit_speed"])
    assert np.count_nonzero(np.diff(np.sign(np.diff(n)))) == 3
    q0 = brentq(lambda q: state(q, FOLD["speed"])[0] - 200.0, 60.0, 200.0)
    errors = []
    for points in (40, 80, 160):
        found = folds(points, {"method": "dormand-prince", "rtol": 1e-9})
        after = found.t > 1.0
        y = solve_ivp(
            rate, (1.0, 40.0), [q0, FOLD["speed"]], "DOP853", found.t[after], rtol=1e-11, atol=1e-12
        ).y
        errors.append(np.max(np.abs(found["unit.speed"][after] / y[1] - 1.0)))
        assert np.ptp(y[0]) > 60.0
    assert errors[2] < 1e-3 and errors[0] > 3.0 * errors[1] > 9.0 * errors[2]


FLUIDS = {
    "linear": dict(WATER),
    "log": {**WATER, "law": "log"},
    "table": {"name": "Water", "temperature": "15 degC", "law": "table"},
    "mixture": {**WATER, "law": "mixture", "air_fraction": 1e-5},
}


@pytest.mark.parametrize("law", FLUIDS)
def test_behind_a_pipe_it_swings_through_them_under_every_law(law):
    """Half the step changes the flow of the first oscillations by less than 2e-3."""
    way = pipe("up", "mid", 500.0, math.sqrt(48.0 / math.pi), 1000.0, 20, friction=NO_FRICTION)

    def run(courant):
        case = plant(
            {"scheme": "muscl", "method": "rk4", "courant": courant},
            12.0,
            way,
            hill_chart=[folded(160)],
            **FOLD,
        )
        case["nodes"]["up"] = lake(200.0)
        case["fluid"] = FLUIDS[law]
        return fvsolve.run(case)

    coarse, fine = run(0.8), run(0.4)
    assert coarse["unit.flow"] == approx(fine["unit.flow"], rel=2e-3)
    assert np.ptp(coarse["unit.flow"]) > 60.0
    assert abs(coarse.ledger["mass"]["relative"]) < 1e-12


def test_an_s_between_given_pressures_starts_at_the_greatest_flow_and_is_noted():
    case = direct(200.0, hill_chart=[folded(160)], diameter=3.0, speed=FOLD["speed"])
    found = fvsolve.run(case)
    assert found["unit.flow"][0] == approx(85.06, rel=1e-4)
    assert [one.key for one in found.warnings] == [
        "hill_chart"
    ] and "its hill chart is folded" in found.warnings[0].text
    assert not fvsolve.run(direct(HEAD, hill_chart=CHART, speed="300 rpm")).warnings


def test_stated_otherwise_it_is_the_same(tmp_path):
    """Equivalent input: other orders of curves and points, other units, and a file."""
    numerics = {"method": "rk4", "step": 0.05}
    first = fvsolve.run(
        plant(numerics, 4.0, inertia=INERTIA, trip=1.0, opening=VANES, hill_chart=CHART)
    )
    turned = [
        {k: v[::-1] if isinstance(v, list) else v for k, v in one.items()} for one in CHART[::-1]
    ]
    other = {"diameter": "1500 mm", "speed": "375 rpm", "inertia": "60 t m2", "trip": "1000 ms"}
    again = fvsolve.run(plant(numerics, 4.0, opening=VANES, hill_chart=turned, **other))
    rows = ["opening [%];unit_flow [m^(1/2)/s];efficiency [%];unit_speed [rpm m^(1/2)]"]
    rows += [
        f"{100 * one['opening']};{q};{100 * e};{n}"
        for one in CHART
        for q, e, n in zip(one["unit_flow"], one["efficiency"], one["unit_speed"], strict=True)
    ]
    (tmp_path / "chart.csv").write_text("\n".join(rows))
    case = plant(
        numerics,
        4.0,
        inertia=INERTIA,
        trip=1.0,
        opening=VANES,
        hill_chart={"file": str(tmp_path / "chart.csv")},
    )
    third = fvsolve.run(case)
    for probe in PROBES:
        assert again[probe] == approx(first[probe], rel=1e-11)
        assert third[probe] == approx(first[probe], rel=1e-11)


def test_it_starts_from_rest_and_leaves_its_chart_once():
    """At rest, and later without flow, the turbine is outside its chart; a single notice reports it."""
    keys = {
        "hill_chart": CHART,
        "opening": {"time": [0.0, 5.0], "value": [0.0, 0.9]},
        "speed": 0.0,
        "inertia": INERTIA,
    }
    found = fvsolve.run(plant({"method": "radau-iia-5", "rtol": 1e-7}, 60.0, trip=0.0, **keys))
    (said,) = [one for one in found.warnings if one.kind == "range"]
    assert (said.place, said.key) == (
        "links.unit",
        "hill_chart",
    ) and "unit: leaves its hill chart at" in said.text
    assert found["unit.speed"][0] == 0.0 and not found.marks
    assert found["unit.head"][-1] == approx(HEAD, rel=1e-3)
    assert abs(found["unit.torque"][-1]) < 1e-3 * max(found["unit.torque"])


def test_behind_shut_vanes_its_water_brakes_it():
    """T = T11 D^3 (N D / n11)^2, so 1 / omega rises linearly."""
    chart = [*LINE, {"opening": 0, "unit_speed": [70], "unit_flow": [0], "unit_torque": [-30]}]
    case = direct(HEAD, inertia=200.0, trip=0.0, opening=0.0, hill_chart=chart)
    case["numerics"] = {"end": 30.0, **TIGHT}
    found = fvsolve.run(case)
    rate = 30.0 * D**5 * (RPM / 70.0) ** 2 / 200.0
    assert found["unit.speed"] == approx(OMEGA / (1.0 + rate * OMEGA * found.t), rel=1e-8)


def test_the_shipped_plant_has_the_points_of_its_formula():
    assert (Path(__file__).parents[2] / "cases/hydropower.csv").read_text() == chart()
    case = fvsolve.load("hydropower", {"numerics.end": 0.1, "expect": {}, "limits": {}})
    assert fvsolve.run(case)["unit.flow"][0] == approx(steady()[0], rel=5e-4)


@pytest.mark.parametrize(("inertia", "far"), [(INERTIA, False), (60.0, True), (60e6, True)])
def test_an_inertia_far_from_that_of_machines_of_its_power_is_noted(
    inertia: float, far: bool
) -> None:
    for opening in (0.0, 0.8):
        made = fvsolve.build(fvsolve.load(plant(TIGHT, inertia=inertia, trip=1.0, opening=opening)))
        assert [one.key for one in made.warnings if one.kind == "range"] == ["inertia"] * far


HALF = {
    "opening": 0.5,
    "unit_speed": [40, 60, 90],
    "unit_flow": [0.52, 0.5, 0.41],
    "efficiency": [0.7, 0.85, 0.6],
}
FULL = {
    "opening": 1.0,
    "unit_speed": [45, 95],
    "unit_flow": [0.95, 0.8],
    "unit_torque": [1500, 700],
}
WEIGHT = RHO * GRAVITY


def case(chart=(HALF, FULL), **keys) -> dict:
    unit = {
        "type": "turbine",
        "from": "up",
        "to": "low",
        "diameter": 1.5,
        "speed": "300 rpm",
        "hill_chart": chart,
    }
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
    ({"file": "a.csv", "of": 1}, "hill_chart.of: unknown key; keys are file, sheet"),
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
    odd = [
        0,
        -1,
        1e-300,
        1e300,
        math.nan,
        math.inf,
        "x",
        None,
        [],
        {},
        True,
        1,
        60.0,
        [0.5, 0.4],
        "50 %",
    ]
    for _ in range(60):
        chart = [
            {k: list(v) if isinstance(v, list) else v for k, v in one.items()}
            for one in (HALF, FULL, STILL)
        ]
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
            q > 0.0,
            np.where(n > 0.0, np.minimum(0.6 * most, 4e3 * opening), 500.0 * opening),
            2.5 * most,
        )
        chart.append(
            {
                "opening": float(opening),
                "unit_speed": n.tolist(),
                "unit_flow": q.tolist(),
                "unit_torque": torque.tolist(),
            }
        )
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
            q = (
                draw.uniform(-2.0, 2.0)
                * turbine_law.capacity(numbers, 0, x)
                * numbers[turbine_law.FLOW]
            )
            root, _, _, torque, _ = turbine_law.chart_at(numbers, 0, x, omega, q)
            given, taken = WEIGHT * q * root * abs(root), torque * omega
            assert given - taken >= -1e-9 * (abs(given) + abs(taken))
            for more in (
                (x * (1 - 1e-9), omega, q),
                (x, omega + 1e-9, q),
                (x, omega, q * (1 + 1e-9)),
            ):
                near = turbine_law.chart_at(numbers, 0, *more)
                assert abs(near[0] - root) < 1e-5 * (1.0 + abs(root)) and abs(
                    near[3] - torque
                ) < 1e-5 * (1e3 + abs(torque))
    assert tried > 20
