"""Curves with a joined Suter table, estimated inertia and starting pumps, against SciPy at 1e-12."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.pump_columns import BORE, FACTOR, LENGTH, TIGHT, column, column_truth, operating_flow
from reference.scenes import GRAVITY, RHO, area
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.parts.pump.head_curve import NAMES, quadrants, suter_tables

FLOW, HEAD, OMEGA, INERTIA, EFFICIENCY = 0.1, 50.0, 150.0, 2.0, 0.8
TORQUE = RHO * GRAVITY * FLOW * HEAD / EFFICIENCY / OMEGA
SPECIFIC = OMEGA * 30.0 / math.pi * math.sqrt(FLOW) / HEAD**0.75
CURVE = {"flow": [FLOW], "head": [HEAD]}
SHAFT = {"curve": CURVE, "rated_speed": OMEGA, "inertia": INERTIA, "efficiency": EFFICIENCY}
RADIAL, EDGE = [np.array(row) for row in suter_tables()["radial-25"]], math.atan(2.0)
STEP = 2.0 * math.pi / 88


def suter(table, n, v):
    return np.interp(math.pi + math.atan2(v, n), np.linspace(0.0, 2.0 * math.pi, len(table)), table)


def turned_back():
    """WH of the table, joined to the shut-off head of the curve.

    At rated speed the head does not fall as the reverse flow rises.
    """
    values, lack = RADIAL[0].copy(), 4.0 / 3.0 - RADIAL[0][44]
    for k in range(44, 21, -1):
        values[k] += lack * (1.0 - (44 - k) / 22)
        if 22 < k < 44:
            least = values[k + 1] * (1.0 + STEP**2 / 2.0 - 2.0 * STEP * math.tan((43 - k) * STEP))
            values[k] = max(values[k], least)
    return values


BACK = turned_back()


def head(n, q):
    """Head [m]: HEAD / 3 (4 n^2 - v^2) from zero to twice the rated flow, elsewhere by the table `radial-25`."""
    v = q / FLOW
    if n > 0.0 and 0.0 <= v <= 2.0 * n:
        return HEAD / 3.0 * (4.0 * n * n - v * v)
    angle, more = math.atan2(v, n), 0.0
    if EDGE <= angle < math.pi / 2:
        more = -suter(RADIAL[0], 1.0, 2.0) * (math.pi / 2 - angle) / (math.pi / 2 - EDGE)
    return HEAD * (n * n + v * v) * (suter(BACK, n, v) + more)


FLOWS = np.unique([*np.tan(np.linspace(0.0, EDGE, 65))[:-1], *np.linspace(0.0, 2.0, 65)])
POWERS = np.maximum(
    (1.0 + FLOWS**2) * [suter(RADIAL[1], 1.0, v) for v in FLOWS], FLOWS * (4.0 - FLOWS**2) / 3.0
)


def torque(n, q):
    """Torque [N m] by the table; on the curve at least that of the rated efficiency, with linear interpolation."""
    v = q / FLOW
    if n > 0.0 and 0.0 <= v <= 2.0 * n:
        return TORQUE * n * n * np.interp(v / n, FLOWS, POWERS)
    return TORQUE * (n * n + v * v) * suter(RADIAL[1], n, v)


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_periodic_equals_1_at_the_rated_point_and_resists_at_standstill(name):
    wh, wb = (np.array(row) for row in suter_tables()[name])
    assert len(wh) == len(wb) == 89 and wh[0] == wh[-1] and wb[0] == wb[-1]
    assert 2.0 * wh[55] == 2.0 * wb[55] == approx(1.0)
    # head and torque of a pump are positive
    assert (wh[44:56] > 0.0).all() and (wb[44:56] > 0.0).all()
    # at rest it resists both flows and is driven by them
    assert wh[22] > 0.0 > wh[66] and wb[22] > 0.0 > wb[66]
    steps = np.abs(np.diff(wh)).max(), np.abs(np.diff(wb)).max()
    assert max(steps) < 0.4


def test_between_two_tables_it_is_the_logarithm_that_counts_and_beyond_them_the_nearest():
    middle = quadrants(math.sqrt(25.0 * 35.0))
    assert middle.words == "radial-25 and radial-35"
    assert middle.head == approx(
        0.5 * sum(np.array(suter_tables()[one][0]) for one in ("radial-25", "radial-35"))
    )
    assert quadrants(10.0).words == "radial-25" and quadrants(400.0).words == "axial-260"
    assert quadrants(94.0).head == approx(suter_tables()["mixed-94"][0])
    assert SPECIFIC < 25.0


METHODS = {
    "explicit": (TIGHT, 1e-6),
    "implicit": ({"method": "radau-iia-5", "rtol": 1e-10}, 1e-6),
    "rosenbrock": ({"method": "rodas-5p", "rtol": 1e-9}, 1e-6),
}


@pytest.mark.parametrize("numerics, near", METHODS.values(), ids=METHODS)
def test_a_curve_joined_to_its_table_follows_scipy_into_turbining(numerics, near):
    """The steady state equals that of the curve to the bit; kinks of the table limit the accuracy of all methods."""
    lift, end = 30.0, 10.0
    result = fvsolve.run(
        column(lift, end, ["pump.speed", "pump.flow", "pump.head"], numerics, **SHAFT, trip=1.0)
    )
    alone = fvsolve.run(column(lift, 0.5, ["pump.flow", "pump.head"], numerics, curve=CURVE))
    q0 = operating_flow(lift)
    assert (
        result["pump.flow"][0] == alone["pump.flow"][0]
        and result["pump.head"][0] == alone["pump.head"][0]
    )
    truth = column_truth(lift, 1.0, q0, 1.0, end, head, torque)
    n, q = truth.sol(result.t[result.t > 1.0])
    assert n[-1] < -0.5 and q[-1] < -0.02
    assert result["pump.speed"][result.t > 1.0] == approx(n, abs=near)
    assert result["pump.flow"][result.t > 1.0] == approx(q, abs=near)
    (said,) = [one for one in result.warnings if one.kind == "range"]
    assert (
        result.marks == []
        and "radial-25" in said.text
        and "specific speed of the pump, 24.09" in said.text
    )


def test_drawn_the_other_way_it_is_the_same():
    case = column(30.0, 6.0, ["pump.speed", "main.flow"], **SHAFT, trip=1.0)
    back = column(30.0, 6.0, ["pump.speed", "main.flow"], **SHAFT, trip=1.0)
    back["links"]["main"].update({"from": "top", "to": "out"})
    one, other = fvsolve.run(case), fvsolve.run(back)
    assert other["pump.speed"] == approx(one["pump.speed"], abs=1e-9)
    assert other["main.flow"] == approx(-one["main.flow"], abs=1e-9)


@pytest.mark.parametrize(
    "given",
    [
        {"efficiency": {"flow": [0.05, 0.1, 0.2], "efficiency": [0.6, 0.8, 0.1]}},
        {"shaft_power": {"flow": [0.0, 0.1, 0.2], "power": [3e4, 6e4, 5e4]}},
        {"curve": {"flow": [0.0, 0.05, 0.1, 0.15], "head": [60.0, 57.0, 50.0, 35.0]}},
        {"curve": {"coefficients": [60.0, 0.0, -1000.0]}},
    ],
    ids=["efficiency", "power", "points", "polynomial"],
)
def test_head_and_torque_are_continuous_at_both_ends_of_every_curve(given):
    keys = {**SHAFT, **given}
    if "shaft_power" in given:
        keys.pop("efficiency")
    model = fvsolve.build(fvsolve.load(column(30.0, 1.0, ["pump.flow"], **keys, trip=0.5)))
    from fvsolve.parts.pump import law

    floats, row = model.tables.floats, model.tables.devices[0]
    curve, at = int(model.tables.valves[row["valve"]]["data"]), int(row["data"])
    last = floats[curve + law.LAST]
    for n in (1.0, 0.3):
        for q, side in ((0.0, -1.0), (n * last, 1.0)):
            inside, out = q - side * 1e-10, q + side * 1e-10
            heads = [law.curve_head(floats, curve, n, one)[0] for one in (inside, out)]
            torques = [law.fluid_torque(floats, at, curve, n, one, 1.0) for one in (inside, out)]
            assert heads[0] == approx(heads[1], abs=1e-5) and torques[0] == approx(
                torques[1], abs=1e-4
            )
            assert law.is_off_curve(floats, curve, n, out) and not law.is_off_curve(
                floats, curve, n, inside
            )


def test_energy_is_never_created_in_a_run_down_and_back():
    from fvsolve.studies.energy_balance import energy

    found = energy(column(30.0, 8.0, ["pump.flow"], **SHAFT, trip=1.0))
    assert found.relative < 1e-7 and min(np.diff(found.dissipated["pump"])) > 0.0


def test_without_an_inertia_it_is_estimated_with_a_notice():
    """The estimate from 61.3 kW at 1432 rpm gives a notice; a given inertia gives none."""
    keys = {key: value for key, value in SHAFT.items() if key != "inertia"}
    power, speed = TORQUE * OMEGA / 1e3, OMEGA * 30.0 / math.pi / 1e3
    expected = 0.03768 * (power / speed**3) ** 0.9556 + 0.0043 * (power / speed) ** 1.48
    result = fvsolve.run(column(30.0, 2.0, ["pump.speed"], **keys, trip=1.0))
    given = fvsolve.run(column(30.0, 2.0, ["pump.speed"], **keys, trip=1.0, inertia=expected))
    assert result["pump.speed"] == approx(given["pump.speed"], rel=1e-12)
    (said,) = [one for one in result.warnings if one.key == "inertia"]
    assert f"{expected:.4g} kg m2" in said.text and said.value == approx(expected)
    assert not [one for one in given.warnings if one.key == "inertia"]


@pytest.mark.parametrize("numerics", [one for one, _ in METHODS.values()], ids=METHODS)
def test_a_pump_starts_against_a_rigid_column_behind_its_check_valve(numerics):
    """Zero flow until n^2 66.7 m exceeds the lift; then the equation of the column, integrated by SciPy."""
    lift, end = 30.0, 8.0
    schedule = {"start": 1.0, "duration": 2.0, "value": [0.0, 1.0]}
    keys = {"curve": CURVE, "rated_speed": OMEGA, "speed": schedule, "check_valve": True}
    result = fvsolve.run(column(lift, end, ["pump.flow", "pump.speed"], numerics, **keys))
    opens = 1.0 + 2.0 * math.sqrt(lift / (4.0 / 3.0 * HEAD))
    event = result.summary["events"][-1]
    assert event["what"] == "check valve opens" and event["time"] == approx(opens, abs=1e-5)
    assert not result["pump.flow"][result.t < opens].any() and result.marks == []
    section = area(BORE)
    loss = FACTOR * LENGTH / BORE / (2.0 * GRAVITY * section**2)
    ramp = lambda t: min((t - 1.0) / 2.0, 1.0)  # noqa: E731

    def rate(t, y):
        return [GRAVITY * section / LENGTH * (head(ramp(t), y[0]) - lift - loss * y[0] ** 2)]

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "dense_output": True}
    first = solve_ivp(rate, (opens, 3.0), [0.0], **options)
    then = solve_ivp(rate, (3.0, end), first.y[:, -1], **options)
    rising, up = (result.t > opens) & (result.t <= 3.0), result.t > 3.0
    assert result["pump.flow"][rising] == approx(first.sol(result.t[rising])[0], abs=1e-6)
    assert result["pump.flow"][up] == approx(then.sol(result.t[up])[0], abs=1e-6)


def test_its_efficiency_is_nowhere_above_that_at_the_rated_point():
    full = {"flow": [0.0, 0.1, 0.2], "head": [52.0, 50.0, 45.0]}
    for lift in (0.0, 20.0, 40.0, 50.0):
        case = column(
            lift, 0.1, ["pump.flow", "pump.head", "pump.power"], **{**SHAFT, "curve": full}
        )
        case["links"]["main"]["diameter"] = 0.5
        result = fvsolve.run(case)
        efficiency = (
            RHO * GRAVITY * result["pump.flow"] * result["pump.head"] / result["pump.power"]
        )
        assert 0.3 < efficiency[0] <= EFFICIENCY * 1.002
