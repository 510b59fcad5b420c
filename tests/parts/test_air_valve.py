"""Air valves against SciPy, a closed form and a plain junction, with staged outflow; pressure-dependent demand."""

import math

import numpy as np
import pytest
from reference.air import HEAT, SMALL, bores, softened
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    RHO,
    WATER,
    area,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    valve,
)
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.core.model import RunData
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.studies.energy_balance import energy

LENGTH, DIAMETER = 200.0, 0.3
INERTIA = RHO * LENGTH / area(DIAMETER)
TIGHT = {"method": "dormand-prince", "rtol": 1e-10}


def drained(
    inlet=0.05,
    outlet=0.05,
    low=AMBIENT - 0.6e5,
    end=6.0,
    numerics=TIGHT,
    law="linear",
    flow=0.05,
    **more,
):
    """Return a case of a gate that shuts before an air valve, from which a rigid column flows on."""
    nodes = {
        "lake": reservoir(2e5),
        "v": {"type": "air-valve", "inlet": inlet, "outlet": outlet, **more},
    }
    nodes["low"] = reservoir(low)
    column = {
        "type": "rigid-column",
        "from": "v",
        "to": "low",
        "length": LENGTH,
        "diameter": DIAMETER,
    }
    gate = {
        "type": "valve",
        "from": "lake",
        "to": "v",
        "area": 0.01,
        "opening": {"start": 0.1, "duration": 0.4, "value": [1.0, 0.0]},
    }
    probes = ["v.air_pressure", "v.air_volume", "v.air_mass", "c.flow", "v.pressure"]
    links = {"gate": gate, "c": {**column, "initial_flow": flow}}
    return scene(nodes, links, end, numerics, probes, fluid=WATER | {"law": law})


def test_choked_air_comes_in_at_its_closed_rate():
    """dm/dt = Cd A pa sqrt(1.4 / (R T)) (2 / 2.4)^3 while p < 0.528 pa, and p V = m R T at all times."""
    result = fvsolve.run(drained(inlet=0.01, low=AMBIENT - 0.9e5, end=2.0))
    p, volume, mass = (result[f"v.air_{name}"] for name in ("pressure", "volume", "mass"))
    assert p * volume == pytest.approx(mass * HEAT, rel=1e-12)
    choked = (p < 0.52 * AMBIENT) & (np.asarray(result.t) > 0.6)
    t, m = np.asarray(result.t)[choked], mass[choked]
    assert choked.sum() > 100
    rate = 0.6 * area(0.01) * AMBIENT * math.sqrt(1.4 / HEAT) * (2 / 2.4) ** 3
    assert m - m[0] == pytest.approx(rate * (t - t[0]), abs=1e-8)


RETURN = {"time": [0.0, 2.0, 3.0], "value": [0.4e5, 0.4e5, 6e5]}


def test_near_ambient_pressure_alone_its_flow_is_not_the_textbooks():
    """Flow of the textbook for x = 1 - p/pa > SMALL; below, at most 0.18 sqrt(2 SMALL) less than sqrt(2 x)."""
    from fvsolve.parts.air_valve.law import orifice_flow

    for r in (0.2, 0.5283, 0.53, 0.9, 1.0 - 1.01 * SMALL):
        textbook = bores(r * AMBIENT, 0.1, 0.1, lambda x: 1.0) / (
            0.6 * area(0.1) * AMBIENT / math.sqrt(HEAT)
        )
        assert orifice_flow(r) == pytest.approx(textbook, rel=2e-12)
    for x in np.linspace(0.0, SMALL, 50):
        assert (
            0.0
            <= math.sqrt(7 * x / 3.5) - orifice_flow(1.0 - x)
            <= math.sqrt(2.0) * 0.18 * math.sqrt(SMALL) + SMALL
        )


def off_scipy(law, beta=2.2e9) -> tuple[float, int]:
    """Return (greatest relative difference from SciPy of air mass, air pressure and flow, number of steps).

    Air enters at subsonic speed; the returning column compresses it and blows it out, at last choked. The throat
    between fluid and air has 30 times the diameter of the inlet and loss coefficient 1.
    """
    inlet, outlet = 0.04, 0.02
    case = drained(inlet, outlet, RETURN, law=law)
    case["fluid"]["bulk_modulus"] = beta
    result = fvsolve.run(case)
    t = np.asarray(result.t)
    shut = [event["time"] for event in result.summary["events"] if event["what"] == "shuts"]
    rows = (t >= 0.6) & (t < shut[0] - 0.02)
    first = [result[name][rows][0] for name in ("c.flow", "v.air_volume", "v.air_mass")]

    def rates(now, y):
        p, v = y[2] * HEAT / y[1], y[0] / area(30.0 * inlet)
        drop = 0.5 * RHO * v * abs(v)
        return (
            (p - drop - np.interp(now, RETURN["time"], RETURN["value"])) / INERTIA,
            y[0],
            bores(p, inlet, outlet),
        )

    exact = solve_ivp(
        rates,
        (t[rows][0], t[rows][-1]),
        first,
        t_eval=t[rows],
        rtol=1e-11,
        atol=1e-14,
        max_step=0.01,
        method="DOP853",
    )
    p = exact.y[2] * HEAT / exact.y[1]
    assert p.max() > 2.0 * AMBIENT and p.min() < 0.95 * AMBIENT
    off = [(result["v.air_mass"][rows], exact.y[2]), (result["v.air_pressure"][rows], p)]
    flow = np.abs(result["c.flow"][rows] - exact.y[0]).max() / np.abs(exact.y[0]).max()
    return max(flow, *(np.abs(found / true - 1.0).max() for found, true in off)), result.summary[
        "steps"
    ]


def test_subsonic_in_and_out_and_choked_out_follow_scipy():
    """The difference is below the sum of all local errors, rtol times the number of steps."""
    off, steps = off_scipy("linear")
    assert off < TIGHT["rtol"] * steps


def test_under_a_compressible_law_it_differs_by_the_first_order_of_its_compressibility():
    one, two = (off_scipy("log", beta)[0] for beta in (2.2e9, 8.8e9))
    assert one < 6e5 / 2.2e9 and one / two == pytest.approx(4.0, rel=0.05)


def test_it_opens_and_shuts_once_a_swing_and_its_ledger_is_closed():
    result = fvsolve.run(
        drained(0.04, 0.04, RETURN, numerics={"method": "dormand-prince", "rtol": 1e-6})
    )
    texts = [event["what"] for event in result.summary["events"]]
    assert texts[:2] == ["opens", "shuts"] and len(texts) <= 8
    assert texts == (["opens", "shuts"] * 4)[: len(texts)]
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_it_opens_again_from_the_very_volume_at_closure():
    """Beside the shut check valve of a pump, its fluid volume is constant while it is shut."""
    curve = {"flow": [0.0, 0.04, 0.06], "head": [70.0, 60.0, 45.0]}
    friction = {"model": "quasi-steady", "roughness": 1e-4}
    links = {
        "p": {
            "type": "pump",
            "from": "s",
            "to": "a",
            "curve": curve,
            "rated_speed": 150.0,
            "inertia": 0.1,
            "trip": 1.0,
            "check_valve": True,
        },
        "m": pipe("a", "o", 800.0, 0.2, 1000.0, 40, friction=friction),
    }
    nodes = {
        "s": lake(2.0),
        "a": {"type": "air-valve", "elevation": 5.0, "inlet": 0.05, "outlet": 0.005},
    }
    result = fvsolve.run(scene(nodes | {"o": lake(40.0)}, links, 15.0, {}, ["a.air_volume"]))
    texts = [event["what"] for event in result.summary["events"] if event["name"] == "a"]
    assert result.ok and texts == ["opens", "shuts", "opens", "shuts"]
    opens, shuts = (result.summary["events"][k]["time"] for k in (3, 4))
    between = (result.t > opens + 0.01) & (result.t < shuts - 0.01)
    assert between.any() and np.all(result["a.air_volume"][between] > result["a.air_volume"][0])


@pytest.mark.parametrize(
    "numerics", [{"method": "euler", "step": 0.001}, {"method": "rk4", "step": 0.01}]
)
def test_fixed_explicit_steps_open_it_once(numerics):
    """A chamber of the usual size of air valves responds no faster than the steps, so the valve does not chatter."""
    found, true = (fvsolve.run(drained(0.05, 0.05, numerics=own)) for own in (numerics, TIGHT))
    assert found.ok and [event["what"] for event in found.summary["events"]] == ["opens"]
    assert found["v.air_mass"][-1] == pytest.approx(true["v.air_mass"][-1], rel=numerics["step"])


def test_shut_it_is_a_junction_to_the_last_bit_but_rounding():
    fall = {"time": [0.0, 0.5, 0.6], "value": [3e5, 3e5, 5e5]}
    found = []
    for place in (junction(), {"type": "air-valve", "inlet": 0.1, "outlet": 0.01}):
        nodes = {"lake": reservoir(fall), "v": place, "low": reservoir(2e5)}
        links = {
            "one": pipe("lake", "v", 100.0, 0.3, 1000.0, 10),
            "two": pipe("v", "low", 100.0, 0.3, 1000.0, 10),
        }
        for link in links.values():
            link["friction"] = {"model": "steady", "factor": 0.02}
        found.append(
            fvsolve.run(scene(nodes, links, 2.0, {"method": "rk4"}, ["v.pressure", "two.flow"]))
        )
    assert not found[1].summary["events"]
    for name in ("v.pressure", "two.flow"):
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-12)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_its_energy_closes_and_its_bores_only_dissipate(law):
    case = drained(
        0.04, 0.02, RETURN, numerics={"method": "dormand-prince", "rtol": 1e-8}, end=4.0, law=law
    )
    one = energy(case, port="low")
    column = sum(loss[-1] for loss in one.law.values())
    assert abs(one.numerical_remainder[-1] - column) < 1e-5 * one.throughput and one.port.passive
    assert (np.diff(one.dissipated["v.inside air valve"]) >= -1e-9 * one.throughput).all()


def test_its_norm_is_its_energy_to_second_order_and_its_pattern_holds():
    from fvsolve.core.model.energy_accounts import Accounts

    model = fvsolve.build(fvsolve.load(drained(flow=0.0, low=2e5)))
    accounts, y = Accounts(RunData(model)), np.zeros(model.y_size)
    i, j = (model.state_names.index(f"v.inside.{name}") for name in ("mass", "air"))
    y[i], y[j] = -0.01 * 0.1, 2e-4 * 0.1
    place = [one.place for one in accounts.stored_accounts].index("v.inside")
    device = next(one for name, _, one in model.devices if name == "v.inside")
    row = model.tables.devices[0]
    square = device.energy_rows(model, None, row, np.zeros(model.y_size), None)[0]
    small = sum(factor * y[k] for k, factor in square.items()) ** 2
    assert accounts.stored_at(0.0, y)[place] == pytest.approx(small, rel=0.2)
    pattern = jacobian_pattern(model).toarray()[: model.y_size]
    assert not np.any((np.abs(model.jacobian(0.0, y)) > 1e-9) & ~pattern)


def test_open_at_the_start_it_is_reported():
    links = {
        "m": pipe("lake", "v", 100.0, 0.1, 1000.0, 4),
        "n": pipe("v", "low", 100.0, 0.1, 1000.0, 4),
    }
    nodes = {
        "lake": lake(0.0),
        "v": {"type": "air-valve", "elevation": 2.0, "inlet": 0.05, "outlet": 0.05},
    }
    model = fvsolve.build(fvsolve.load(scene(nodes | {"low": lake(0.0)}, links, 1.0, {})))
    (said,) = [
        one.text
        for one in model.warnings
        if one.text.startswith("v: the air valve is open at the start")
    ]
    assert f"{RHO * 9.80665 * 2.0:.4g} Pa below ambient" in said


@pytest.mark.parametrize(
    "wrong, said",
    [
        ({"inlet": 0.0}, "out of range"),
        ({"inlet": 50}, 'above 0, 1 at most, in m; did you mean "50 mm"?'),
        ({"outlet": None}, "outlet is missing"),
        ({"volume": -1.0}, "out of range"),
        ({"discharge_coefficient": 1.5}, "out of range"),
    ],
)
def test_faults_of_an_air_valve_are_reported(wrong, said):
    case = drained()
    given = case["nodes"]["v"] | wrong
    case["nodes"]["v"] = {key: value for key, value in given.items() if value is not None}
    assert said in str(refused(case))


def test_a_demand_follows_the_pressure_between_none_and_all():
    """Demand by Wagner's formula behind a valve, in all three ranges of pressure."""
    from scipy.optimize import brentq

    for given, want in ((5e5, 0.002), (2e5, 0.002), (1.2e5, 0.002)):
        nodes = {"lake": reservoir(given)}
        nodes["j"] = junction(
            want, required_pressure=AMBIENT + 2e5, minimum_pressure=AMBIENT + 0.2e5
        )
        case = scene(
            nodes, {"gap": valve("lake", "j", 2e-4)}, 1.0, {"step": 0.1}, ["gap.flow", "j.pressure"]
        )
        model = fvsolve.build(fvsolve.load(case))

        def drawn(p, want=want):
            return want * min(1.0, max(0.0, (p - AMBIENT - 0.2e5) / 1.8e5)) ** 0.5

        def short(p, given=given):
            return 2e-4 * math.sqrt(2 * (given - p) / RHO) - drawn(p)

        p = brentq(short, -5e5, given) if short(given - 1e-9) < 0.0 else given
        flow, found = model.observe(0.0, np.zeros(0))
        assert (flow, found) == pytest.approx((drawn(p), p), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    "wrong, said",
    [
        ({"required_pressure": 1e5}, "at which no demand is supplied"),
        ({"required_pressure": 3e5, "minimum_pressure": 0.9e5}, "is below ambient"),
        ({"required_pressure": 3e5, "demand": -1.0}, "is negative at some time"),
        ({"minimum_pressure": 2e5}, "has no effect without `required_pressure`"),
    ],
)
def test_faults_of_such_a_demand_are_reported(wrong, said):
    nodes = {"lake": reservoir(5e5), "j": {"type": "junction", "demand": 0.001, **wrong}}
    assert said in str(refused(scene(nodes, {"gap": valve("lake", "j", 2e-4)}, 1.0, {"step": 0.1})))


STAGES = {"switch": 4e3, "throttled_outlet": 0.008, "automatic": 0.003}


def staged(law="linear", beta=2.2e9, numerics=TIGHT, **more):
    stages = {key: value for key, value in (STAGES | more).items() if value is not None}
    case = drained(0.04, 0.02, RETURN, law=law, numerics=numerics, **stages)
    case["fluid"]["bulk_modulus"] = beta
    return case


def by_stages(case, speed: float | None = None):
    """Return (greatest relative difference from SciPy, (time of throttling, SciPy's time), result); see `off_scipy`.

    Air leaves through the outlet and the automatic bore until its gauge pressure is 4 kPa. With `speed` [m/s] given,
    this phase ends when the column arrives at that speed, with the air 10 Pa above ambient. Then air leaves through the
    throttled outlet and the automatic bore.
    """
    result = fvsolve.run(case)
    t, times = (
        np.asarray(result.t),
        {e["what"]: e["time"] for e in reversed(result.summary["events"])},
    )
    rows = (t >= 0.6) & (t < times.get("shuts", np.inf) - 0.02)
    y = [result[name][rows][0] for name in ("c.flow", "v.air_volume", "v.air_mass")]
    at = t[rows][0]
    off = []
    parted = 0.0
    for wide, end in ((0.02, t[rows][-1]), (0.008, t[rows][-1])):
        out = math.hypot(wide, 0.003)

        def rates(now, y, out=out):
            p, v = y[2] * HEAT / y[1], y[0] / area(30.0 * 0.04)
            low = np.interp(now, RETURN["time"], RETURN["value"])
            return (p - 0.5 * RHO * v * abs(v) - low) / INERTIA, y[0], bores(p, 0.04, out)

        def switches(now, y):
            gauge = y[2] * HEAT / y[1] - AMBIENT
            return (
                gauge - 4e3 if speed is None else min(-y[0] / area(DIAMETER) - speed, gauge - 10.0)
            )

        switches.terminal, switches.direction = wide == 0.02, 1.0
        exact = solve_ivp(
            rates,
            (at, end),
            y,
            rtol=1e-11,
            atol=1e-14,
            max_step=0.01,
            method="DOP853",
            dense_output=True,
            events=switches,
        )
        here = rows & (t >= at) & (t <= exact.t[-1])
        flow, volume, mass = exact.sol(t[here])
        off += [
            np.abs(result["v.air_mass"][here] / mass - 1.0).max(),
            np.abs(result["v.air_pressure"][here] * volume / (mass * HEAT) - 1.0).max(),
            np.abs(result["c.flow"][here] - flow).max() / np.abs(flow).max(),
        ]
        y, at, parted = exact.y[:, -1], exact.t[-1], parted or exact.t[-1]
    return max(off), (times["throttles"], parted), result


def test_its_three_stages_follow_scipy_and_it_throttles_at_the_time_of_scipy():
    off, (found, true), result = by_stages(staged())
    near = TIGHT["rtol"] * result.summary["steps"]
    assert off < near and found == pytest.approx(true, abs=near)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_by_velocity_it_throttles_at_scipys_velocity_of_the_fluid():
    """At 0.35 m/s the velocity triggers throttling; at 0.01 m/s the air pressure does, because it rises later."""
    for speed in (0.35, 0.01):
        off, (found, true), result = by_stages(staged(switch=None, switch_velocity=speed), speed)
        near = TIGHT["rtol"] * result.summary["steps"]
        assert off < near and found == pytest.approx(true, abs=near)
        at = np.searchsorted(result.t, found)
        assert (abs(-result["c.flow"][at] / area(DIAMETER) - speed) < 0.01) == (speed == 0.35)


def test_throttled_it_stops_less_and_is_wide_again_once_air_comes_in():
    twice = {"time": [0.0, 2.0, 3.0, 6.0, 7.0], "value": [0.4e5, 0.4e5, 6e5, 6e5, 0.4e5]}
    result = fvsolve.run(drained(0.04, 0.02, twice, end=12.0, **STAGES))
    assert [event["what"] for event in result.summary["events"]][:5] == [
        "opens",
        "throttles",
        "shuts",
        "opens",
        "stops throttling",
    ]
    stopped = []
    for more in ({}, STAGES):
        one = fvsolve.run(drained(0.04, 0.04, RETURN, **more))
        (shuts,) = [event["time"] for event in one.summary["events"] if event["what"] == "shuts"]
        stopped.append(-one["c.flow"][np.searchsorted(one.t, shuts) - 1])
    assert 0.0 < stopped[1] < 0.7 * stopped[0]


@pytest.mark.parametrize(
    "law, method", [("linear", "rodas-5p"), ("linear", "radau-iia-5"), ("log", "dormand-prince")]
)
def test_staged_its_energy_closes_and_its_bores_only_dissipate(law, method):
    one = energy(staged(law, numerics={"method": method, "rtol": 1e-7}))
    column = sum(loss[-1] for loss in one.law.values())
    assert abs(one.numerical_remainder[-1] - column) < 2e-5 * one.throughput
    assert (np.diff(one.dissipated["v.inside air valve"]) >= -1e-9 * one.throughput).all()


@pytest.mark.parametrize("end", [2.4, 3.05])
def test_staged_and_resumed_it_is_the_unbroken_run(tmp_path, end):
    case = staged(numerics={"method": "rk4", "step": 0.005})
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run", pictures=False)
    result = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    whole = fvsolve.run(case)
    assert np.array_equal(result["v.air_mass"], whole["v.air_mass"])
    assert result.summary["events"] == whole.summary["events"]


@pytest.mark.parametrize(
    "more, said",
    [({"throttled_outlet": None}, "switch: has no effect without `throttled_outlet`"),
     ({"switch": None}, "throttled_outlet: has no effect without `switch` or `switch_velocity`"),
     ({"switch_velocity": 0.5}, "switch and switch_velocity are given; keep one"),
     ({"switch": None, "switch_velocity": -1.0}, "out of range"),
     ({"switch": None, "switch_velocity": 0.5, "throttled_outlet": None}, "switch_velocity: has no effect without"),
     ({"throttled_outlet": 0.03}, "does not throttle; expected less than `outlet`")],
)  # fmt: skip
def test_faults_of_its_stages_are_reported(more, said):
    case = staged(**more)
    assert said in str(refused(case))


# tables of makers -----------------------------------------------------------------------------------------------------

INTO = {"pressure": [0.02e5, 0.1e5, 0.35e5], "flow": [0.03, 0.06, 0.1]}
OUT = {"pressure": [0.05e5, 0.3e5, 1.0e5], "flow": [0.01, 0.03, 0.045]}


def by_table(p: float) -> float:
    """Mass flow of air into a chamber at p by the tables `INTO` and `OUT` [kg/s], softened near ambient as a bore."""
    table, sign, high = (INTO, 1.0, AMBIENT) if p <= AMBIENT else (OUT, -1.0, p)
    drop, x, y = abs(p - AMBIENT), [0.0, *table["pressure"]], [0.0, *(q * q for q in table["flow"])]
    k = min(int(np.searchsorted(x, drop, side="left")), len(x) - 1) or 1
    square = y[k] + (y[k] - y[k - 1]) / (x[k] - x[k - 1]) * (drop - x[k])
    return (
        sign
        * AMBIENT
        / HEAT
        * math.sqrt(square)
        * (softened(drop / high) if drop / high < SMALL else 1.0)
    )


def test_air_by_the_tables_of_a_maker_follows_scipy():
    """Air enters and leaves beyond the last points of both tables; the throat is that of the first point."""
    case = drained(INTO, OUT, RETURN)
    result = fvsolve.run(case)
    t = np.asarray(result.t)
    shut = [event["time"] for event in result.summary["events"] if event["what"] == "shuts"]
    rows = (t >= 0.6) & (t < shut[0] - 0.02)
    first = [result[name][rows][0] for name in ("c.flow", "v.air_volume", "v.air_mass")]
    throat = 30.0**2 * INTO["flow"][0] / (0.6 * math.sqrt(2.0 * INTO["pressure"][0] / 1.2))

    def rates(now, y):
        p, v = y[2] * HEAT / y[1], y[0] / throat
        drop = 0.5 * RHO * v * abs(v)
        return (
            (p - drop - np.interp(now, RETURN["time"], RETURN["value"])) / INERTIA,
            y[0],
            by_table(p),
        )

    exact = solve_ivp(
        rates,
        (t[rows][0], t[rows][-1]),
        first,
        t_eval=t[rows],
        rtol=1e-11,
        atol=1e-14,
        max_step=0.01,
        method="DOP853",
    )
    p = exact.y[2] * HEAT / exact.y[1]
    assert p.min() < AMBIENT - 0.05e5 and p.max() > AMBIENT + 1e5
    assert result["v.air_mass"][rows] == pytest.approx(exact.y[2], rel=1e-6)
    assert result["v.air_pressure"][rows] == pytest.approx(p, rel=1e-6)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def orifice_table(bore: float, drops, outward: bool) -> dict:
    """Table of a maker with the flow of an orifice at the given pressure differences."""
    flows = [
        abs(bores(AMBIENT + drop if outward else AMBIENT - drop, bore, bore, lambda x: 1.0))
        for drop in drops
    ]
    return {"pressure": list(drops), "flow": [flow * HEAT / AMBIENT for flow in flows]}


def test_a_table_of_the_orifice_formula_gives_the_run_of_the_orifice():
    drops = np.geomspace(200.0, 3e5, 600)
    tables = {
        "inlet": orifice_table(0.04, drops[drops < 0.99 * AMBIENT], False),
        "outlet": orifice_table(0.02, drops, True),
        "throttled_outlet": orifice_table(0.005, drops, True),
    }
    plain = {"inlet": 0.04, "outlet": 0.02, "throttled_outlet": 0.005}
    size = {"volume": 1e-3, "switch": 0.1e5}
    runs = [fvsolve.run(drained(**keys, **size, low=RETURN, end=4.0)) for keys in (plain, tables)]
    for name in ("v.air_mass", "v.air_pressure", "c.flow"):
        a, b = (run[name] for run in runs)
        assert np.abs(a - b).max() < 2e-4 * np.abs(a).max(), name
    names = [[(event["name"], event["what"]) for event in run.summary["events"]] for run in runs]
    assert names[0] == names[1] and ("v", "throttles") in names[0]


@pytest.mark.parametrize(
    "key, given, text",
    [
        ("inlet", {"pressure": [0.1e5, 1.1e5], "flow": [0.1, 0.2]},
         "nodes.v.inlet.pressure: 110000 Pa is not below ambient pressure, 101325 Pa"),
        ("outlet", {"pressure": [0.1e5, 0.2e5], "flow": [0.2, 0.1]},
         "nodes.v.outlet.flow[1]: 0.1 comes after 0.2; the flow must not fall as the pressure rises"),
        ("outlet", {"pressure": [0.1e5], "flow": [0.2, 0.1]},
         "nodes.v.outlet.flow: has length 2, but `pressure` has length 1; expected equal lengths"),
        ("outlet", "wide", "nodes.v.outlet"),
        ("throttled_outlet", {"pressure": [0.1e5], "flow": [0.2]}, "does not throttle; expected less than `outlet`"),
    ],
)  # fmt: skip
def test_faults_of_a_table_of_a_manufacturer_are_reported(key, given, text):
    more = {"switch": 0.1e5} if key == "throttled_outlet" else {}
    assert text in str(refused(drained(**{"inlet": 0.05, "outlet": 0.05, key: given, **more})))
