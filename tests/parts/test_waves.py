"""Waves: sudden closures (dp = rho a v, period 4 L / a), moving valves against Allievi's recursion and ray tracing.

Harmonic schedules: values and both derivatives against the formula, integrals of a flow, and faults.
"""

import math

import numpy as np
import pytest
from reference import frictionless, scenes
from reference.frictionless import relative_drop
from reference.scenes import (
    AMBIENT,
    RHO,
    SHARP,
    WATER,
    junction,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    valve,
)

import fvsolve
from fvsolve import run
from fvsolve.case.load import load
from fvsolve.core.assembly.schedule_tables import Schedules
from fvsolve.core.kernels.schedule_pieces import piece_slopes, piece_value
from fvsolve.errors import CaseError
from fvsolve.exact.solution import value
from fvsolve.parts.schedule import Schedule

LENGTH, DIAMETER, SPEED, CELLS = 914.4, 0.3048, 1219.2, 40
SHUT, END = 0.0411, 4.0
STEP = LENGTH / CELLS / SPEED
PLACES = {"gate.pressure": 1.0, "main.pressure@0.5": 0.5, "main.pressure@0.21": 0.21}


def shut_pipe(
    velocity: float, how: str, every: float = 0.01, turned: bool = False, **numerics
) -> tuple[dict, float]:
    """Return (case, jump rho a v [Pa]) of a flow that stops by `how`: initial_flow, demand or valve."""
    jump = RHO * SPEED * velocity
    supply = 2 * AMBIENT + 2 * jump
    q = velocity * scenes.area(DIAMETER)
    ends = ("gate", "lake") if turned else ("lake", "gate")
    main = pipe(*ends, LENGTH, DIAMETER, SPEED, CELLS)
    nodes = {"lake": reservoir(supply), "gate": junction()}
    links = {"main": main}
    if how == "initial_flow":
        main["initial_flow"] = -q if turned else q
    elif how == "demand":
        nodes["gate"] = junction(step(SHUT, q, 0.0))
    elif how == "valve":
        nodes["air"] = reservoir(AMBIENT)
        flow_area = q / math.sqrt(2 * (supply - AMBIENT) / RHO)
        links["valve"] = valve("gate", "air", flow_area, step(SHUT, 1.0, 0.0))
    places = {name: 1 - x if turned and "@" in name else x for name, x in PLACES.items()}
    probes = ["gate.pressure", *(f"main.pressure@{x}" for n, x in places.items() if "@" in n)]
    case = scene(nodes, links, END, {**SHARP, **numerics}, probes, every)
    return case, jump


def square_wave(t: np.ndarray, fraction: float, shut: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (square wave over its jump [-], time to the nearest front [s])."""
    period = 2 * LENGTH / SPEED
    value, distance = np.zeros_like(t), np.full_like(t, np.inf)
    for k in range(math.ceil(END / period) + 1):
        for sign, path in ((1, 1 - fraction), (-1, 1 + fraction)):
            front = shut + path * LENGTH / SPEED + k * period
            value += sign * (-1) ** k * (t >= front)
            distance = np.minimum(distance, np.abs(t - front))
    return value, distance


def worst(result, jump: float, shut: float, turned: bool = False) -> float:
    """Greatest difference from the square wave over the jump, three steps away from fronts (probes interpolate)."""
    t, errors = np.asarray(result.t), []
    for name in result.probes:
        fraction = 1.0 if "@" not in str(name) else float(str(name).split("@")[1])
        fraction = 1 - fraction if turned and "@" in str(name) else fraction
        exact, distance = square_wave(t, fraction, shut)
        clear = distance > 3.01 * STEP
        assert clear.mean() > 0.6
        supply = 2 * AMBIENT + 2 * jump
        errors.append(np.max(np.abs(result[str(name)] - supply - jump * exact)[clear]) / jump)
    return max(errors)


@pytest.mark.parametrize("velocity", [1e-4, 1e-2, 0.3, 2.0])
@pytest.mark.parametrize("how", ["initial_flow", "demand", "valve"])
def test_upwind_with_euler_at_courant_1_is_exact(velocity, how):
    case, jump = shut_pipe(velocity, how)
    shut = 0.0 if how == "initial_flow" else SHUT
    assert worst(fvsolve.run(case), jump, shut) < 1e-10


@pytest.mark.parametrize("every", [STEP / 3, 0.00731, 0.1, 0.25])
def test_exactness_does_not_depend_on_how_often_it_is_written(every):
    case, jump = shut_pipe(1.0, "demand", every)
    result = fvsolve.run(case)
    assert worst(result, jump, SHUT) < 1e-10
    often = fvsolve.run(shut_pipe(1.0, "demand", 0.003)[0])
    assert dict(result.extremes) == dict(often.extremes)


def test_a_pipe_laid_the_other_way_round_gives_the_same_wave():
    case, jump = shut_pipe(0.5, "valve", turned=True)
    assert worst(fvsolve.run(case), jump, SHUT, turned=True) < 1e-10


def test_extremes_are_the_jump_up_and_down():
    case, jump = shut_pipe(1.0, "demand")
    supply = 2 * AMBIENT + 2 * jump
    least, t_least, greatest, t_greatest = fvsolve.run(case).extremes["gate.pressure"]
    assert [least, greatest] == pytest.approx([supply - jump, supply + jump], abs=1e-10 * jump)
    for time, side in ((t_least, -1.0), (t_greatest, 1.0)):  # on a plateau of this sign
        assert square_wave(np.array([time + 1e-9]), 1.0, SHUT)[0][0] == side


def test_history_has_two_rows_at_the_jump():
    case, jump = shut_pipe(1.0, "demand")
    result = fvsolve.run(case)
    rows = np.flatnonzero(np.abs(np.asarray(result.t) - SHUT) < 1e-12)
    assert len(rows) == 2
    before, after = result["gate.pressure"][rows]
    assert after - before == pytest.approx(jump, rel=1e-9)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
def test_every_scheme_retains_the_plateau(scheme):
    case, jump = shut_pipe(1.0, "demand", scheme=scheme, method="ssp-rk3", courant=0.8)
    case["links"]["main"]["cells"] = 400
    result = fvsolve.run(case)
    mean = np.mean(result["gate.pressure"][(result.t > SHUT + 0.3) & (result.t < SHUT + 1.2)])
    assert mean - (2 * AMBIENT + 2 * jump) == pytest.approx(jump, rel=1e-3)


def test_the_mass_ledger_closes():
    case, _ = shut_pipe(2.0, "valve")
    assert abs(fvsolve.run(case).ledger["mass"]["relative"]) < 1e-12


LINE_LENGTH, LINE_DIAMETER, LINE_SPEED, LINE_CELLS = 1000.0, 0.4, 1000.0, 20
PERIOD, LINE_STEP = 2 * LINE_LENGTH / LINE_SPEED, LINE_LENGTH / LINE_SPEED / LINE_CELLS
DROP = 1.5e6

SCHEDULES = {
    "slow closure": ramp(0.0, 3 * PERIOD, 1.0, 0.0),
    "fast closure": ramp(0.0, 0.4 * PERIOD, 1.0, 0.0),
    "partial closure": ramp(0.0, 2.5 * PERIOD, 1.0, 0.3),
    "curved closure": ramp(0.0, 2.05 * PERIOD, 1.0, 0.0, 1.5),
    "opening": ramp(0.0, 1.5 * PERIOD, 0.2, 1.0),
    "late closure": ramp(7 * LINE_STEP, PERIOD, 1.0, 0.1),
    "there and back": {
        "time": [0.0, PERIOD, 2 * PERIOD, 4 * PERIOD],
        "value": [1.0, 0.4, 0.4, 0.9],
        "kind": "linear",
    },
}


def opening(schedule: dict, t: float) -> float:
    """Value of a schedule at time t [s]: a linear table, or a ramp with an exponent."""
    if "time" in schedule:
        return float(np.interp(t, schedule["time"], schedule["value"]))
    s = min(max((t - schedule["start"]) / schedule["duration"], 0.0), 1.0)
    v0, v1 = schedule["value"]
    return v1 + (v0 - v1) * (1 - s) ** schedule["exponent"]


def flow_area(velocity: float, schedule: dict) -> float:
    """Product Cd A of the fully open valve, which passes `velocity` [m/s] at its initial opening [m2]."""
    return (
        velocity * scenes.area(LINE_DIAMETER) / math.sqrt(2 * DROP / RHO) / opening(schedule, -1.0)
    )


def closure(velocity: float, schedule: dict, every: float, turned: bool = False) -> dict:
    ends = ("gate", "lake") if turned else ("lake", "gate")
    across = ("air", "gate") if turned else ("gate", "air")
    nodes = {"lake": reservoir(AMBIENT + DROP), "gate": junction(), "air": reservoir(AMBIENT)}
    links = {
        "main": pipe(*ends, LINE_LENGTH, LINE_DIAMETER, LINE_SPEED, LINE_CELLS),
        "valve": valve(*across, flow_area(velocity, schedule), schedule),
    }
    return scene(nodes, links, 6 * PERIOD, SHARP, ["gate.pressure", "valve.flow"], every)


@pytest.mark.parametrize("name", SCHEDULES)
@pytest.mark.parametrize("velocity", [0.1, 1.0, 4.0])
def test_valve_pressure_follows_the_recursion(name, velocity):
    schedule = SCHEDULES[name]
    result = fvsolve.run(closure(velocity, schedule, PERIOD))
    times = np.unique(np.asarray(result.t))
    on = np.flatnonzero(np.abs(times / PERIOD - np.round(times / PERIOD)) < 1e-9)
    assert len(on) == 7
    tau = [opening(schedule, PERIOD * k) / opening(schedule, -1.0) for k in range(7)]
    drops = relative_drop(RHO * LINE_SPEED * velocity / (2 * DROP), tau)
    found = np.interp(times[on], result.t, result["gate.pressure"])
    assert found == pytest.approx(AMBIENT + DROP * np.array(drops), abs=1e-10 * DROP)


@pytest.mark.parametrize("name", SCHEDULES)
def test_valve_pressure_and_flow_are_exact_at_every_step(name):
    schedule, velocity = SCHEDULES[name], 1.0
    result = fvsolve.run(closure(velocity, schedule, LINE_STEP))
    area = flow_area(velocity, schedule)
    main = frictionless.Pipe(
        "lake",
        "gate",
        LINE_LENGTH,
        LINE_DIAMETER,
        LINE_SPEED,
        velocity * scenes.area(LINE_DIAMETER),
        AMBIENT + DROP,
    )
    exact = frictionless.Rays(
        RHO,
        {"main": main},
        {"lake": frictionless.held(AMBIENT + DROP)},
        outlets={"gate": (lambda t: area * opening(schedule, t), AMBIENT)},
    )
    pressure = np.array([exact.pressure("gate", float(t)) for t in result.t])
    opened = np.array([opening(schedule, float(t)) for t in result.t])
    flow = area * opened * np.sqrt(2 * (pressure - AMBIENT) / RHO)
    assert result["gate.pressure"] == pytest.approx(pressure, abs=1e-10 * DROP)
    assert result["valve.flow"] == pytest.approx(flow, abs=1e-10 * velocity)


def test_pipe_and_valve_turned_round_give_the_same_pressure_and_the_opposite_flow():
    schedule = SCHEDULES["curved closure"]
    one, two = (fvsolve.run(closure(2.0, schedule, LINE_STEP, turned)) for turned in (False, True))
    assert two["gate.pressure"] == pytest.approx(one["gate.pressure"], abs=1e-10 * DROP)
    assert two["valve.flow"] == pytest.approx(-one["valve.flow"], abs=1e-12)
    assert one["valve.flow"][0] > 0


def test_a_shut_valve_passes_exactly_nothing():
    schedule = SCHEDULES["fast closure"]
    result = fvsolve.run(closure(1.0, schedule, 0.1))
    assert np.all(result["valve.flow"][result.t > 0.4 * PERIOD] == 0.0)


def test_mass_ledger_closes_over_the_closure():
    result = fvsolve.run(closure(4.0, SCHEDULES["slow closure"], 0.5))
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


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
def test_the_volume_of_a_wave_is_its_integral(method):
    case = chamber(WAVE, rtol=1e-8, method=method)
    result = run(case)
    w, phase = 2 * math.pi / 0.4, math.pi / 6
    volume = 0.01 * result.t + 0.005 / w * (math.cos(phase) - np.cos(w * result.t + phase))
    assert result["tank.pressure"] == pytest.approx(AMBIENT + BULK * volume / 2.0, rel=1e-6)


def test_a_wave_stated_by_a_signal_in_other_units_is_the_same_to_the_bit():
    said = chamber({"signal": "swing"}, rtol=1e-8)
    said["signals"] = {
        "swing": {
            "phase": math.pi / 6,
            "period": "400 ms",
            "amplitude": "18 m3/h",
            "mean": "36 m3/h",
        }
    }
    assert np.array_equal(
        run(said)["tank.pressure"], run(chamber(WAVE, rtol=1e-8))["tank.pressure"]
    )


@pytest.mark.parametrize("kind", ["harmonic", "ramp", "smooth", "linear"])
def test_slopes_of_schedules_are_those_of_their_values(kind):
    times, values = [0.0, 0.7, 1.5], [1.0, -2.0, 3.0]
    one = {
        "harmonic": Schedule("harmonic", (-np.inf, np.inf), (-3.0, 5.0), wave=(1.0, 4.0, 0.8, 0.3)),
        "ramp": Schedule("ramp", (0.0, 1.5), (1.0, 3.0), 2.5),
    }.get(kind, Schedule(kind, times, values))
    table = Schedules()
    table.add(one, 2.0, 0.5)
    _, pieces = table.tables(0)
    for t in (0.2, 0.6, 0.9, 1.3):
        row = np.flatnonzero(pieces[:, 0] <= t)[-1]
        at = lambda s, row=row: piece_value(pieces, row, s)  # noqa: E731
        assert at(t) == pytest.approx(2.0 * value(one, t) + 0.5)
        h = 1e-4
        first, second = (
            (at(t + h) - at(t - h)) / (2 * h),
            (at(t + h) - 2 * at(t) + at(t - h)) / h**2,
        )
        assert piece_slopes(pieces, row, t) == pytest.approx((first, second), rel=1e-5, abs=1e-5)


def test_a_spool_that_swings_opens_each_way_by_the_positive_part_and_steps_end_where_it_is_centred():
    nodes = {
        "P": reservoir(AMBIENT + 2e6),
        "T": reservoir(AMBIENT),
        "A": reservoir(AMBIENT + 1e6),
        "B": reservoir(AMBIENT + 1e6),
    }
    spool = {
        "type": "spool-valve",
        "ports": {one: one for one in "PTAB"},
        "discharge_coefficient": 0.6,
        "area": 1e-5,
        "position": {"mean": 0.1, "amplitude": 0.4, "period": 0.5},
    }
    case = scene(nodes, {"spool": spool}, 1.0, {"step": 0.01}, ["spool.flow_A"], every=0.01)
    result = run(case)
    x = 0.1 + 0.4 * np.sin(2 * np.pi * result.t / 0.5)
    full = 0.6 * 1e-5 * math.sqrt(2 * 1e6 / 1000.0)
    wanted = np.where(x > 0, x, 0) * full - np.where(x < 0, -x, 0) * full
    found = result["spool.flow_A"]
    assert np.abs(np.abs(found) - np.abs(wanted)).max() < 1e-9 * full
    up = math.asin(0.25)
    zeros = [
        (angle + 2 * math.pi * k) * 0.5 / (2 * math.pi)
        for k in (0, 1)
        for angle in (math.pi + up, 2 * math.pi - up)
    ]
    assert [t for t, jump in breaks_of(case) if not jump] == pytest.approx(sorted(zeros))


def breaks_of(case):
    from fvsolve.core.model.build import build

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
        {"v": {"type": "valve", "from": "a", "to": "b", "area": 1e-4, "opening": FAULTS[text]}},
        1.0,
        {},
    )
    with pytest.raises(CaseError, match=text):
        load(case)
