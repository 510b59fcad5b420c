"""Rigid columns at an air valve against SciPy: one flow while it is shut, two flows while it contains air."""

import math
from importlib import import_module

import numpy as np
import pytest
from reference.air import HEAT, bores
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    NO_FRICTION,
    RHO,
    WATER,
    area,
    junction,
    ramp,
    reservoir,
    scene,
    step,
    tank,
)
from reference.scenes import valve as gate
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.core.model import State
from fvsolve.studies.energy_balance import energy

DIAMETER, FACTOR, HEIGHT, BORE, LOW = 0.2, 0.02, 5.0, 0.05, 1.6e5
AREA = area(DIAMETER)
FALL = {"time": [0.0, 1.0, 1.5, 3.0, 3.5], "value": [3e5, 3e5, 1e5, 1e5, 3e5]}
CLOSE = {"method": "radau-iia-5", "rtol": 1e-8}
PROBES = ["one.flow", "two.flow", "v.pressure", "v.air_mass", "v.air_volume"]
AIR_VALVE = {"type": "air-valve", "elevation": HEIGHT, "inlet": BORE, "outlet": BORE}


def column(start, end, length=50.0, diameter=DIAMETER, **more):
    friction = {"model": "quasi-steady", "factor": FACTOR}
    ends = {"type": "rigid-column", "from": start, "to": end}
    return {**ends, "length": length, "diameter": diameter, "friction": friction, **more}


def low(pressure=LOW):
    return reservoir(pressure, elevation=0.0)


def summit(numerics=CLOSE, end=6.0, law="linear", high=FALL, probes=PROBES, nodes=None, links=None):
    """Return a case of two rigid columns at an air valve; `nodes` adds nodes, `links` replaces the columns."""
    nodes = {"high": low(high), "v": AIR_VALVE, "low": low()} | (nodes or {})
    links = (
        {"one": column("high", "v"), "two": column("v", "low", 80.0)} if links is None else links
    )
    return scene(nodes, links, end, numerics, probes, fluid=WATER | {"law": law})


def times(result, place="v"):
    return [
        (event["what"], event["time"])
        for event in result.summary["events"]
        if event["name"] == place
    ]


class Truth:
    """Reference by SciPy of columns that join at an air valve, from t = 0.

    columns : (length [m], diameter [m], pressure(t) [Pa] at the far end at elevation 0)
    start : initial mass flows into the summit [kg/s]; breaks, end : kinks of the pressures and end [s]
    """

    def __init__(self, columns, start, breaks, end):
        self.columns = columns
        self.yields = np.array([area(d) / length for length, d, _ in columns])
        self.room, self.throat = math.pi / 4 * (3 * BORE) ** 3, 2.0 * RHO * area(30 * BORE) ** 2
        held = AMBIENT * self.room / HEAT
        self.events, self.pieces = [], []
        self.follow(np.array([*start, 0.0, held]), [*breaks, end])

    def drives(self, t, flows):
        """Return for each column the pressure at the summit at which its flow stays constant [Pa]."""
        lost = [
            FACTOR * length / d * m * abs(m) / (2 * RHO * area(d) ** 2)
            for (length, d, _), m in zip(self.columns, flows, strict=True)
        ]
        return np.array([p(t) for *_, p in self.columns]) - RHO * GRAVITY * HEIGHT - lost

    def gas(self, y):
        return y[-1] * HEAT / (self.room - y[-2] / RHO)

    def shut_pressure(self, t, y):
        return self.yields @ self.drives(t, y[:-2]) / self.yields.sum()

    def shut(self, t, y):
        flow, even = bores(self.gas(y), BORE, BORE), AMBIENT * (self.room - y[-2] / RHO) / HEAT
        if abs(flow) * 0.02 >= abs(even - y[-1]):
            flow = (even - y[-1]) / 0.02
        return [*(self.yields * (self.drives(t, y[:-2]) - self.shut_pressure(t, y))), 0.0, flow]

    def open(self, t, y):
        brought = y[:-2].sum()
        p = self.gas(y) + brought * abs(brought) / self.throat
        return [
            *(self.yields * (self.drives(t, y[:-2]) - p)),
            brought,
            bores(self.gas(y), BORE, BORE),
        ]

    def follow(self, y, bounds):
        t, rule = 0.0, self.shut

        def opens(t, y):
            return self.shut_pressure(t, y) - AMBIENT - min(self.gas(y) - AMBIENT, 0.0) + 10.0

        def shuts(t, y):
            return 1e-9 * RHO * self.room - y[-2]

        opens.terminal = shuts.terminal = True
        opens.direction = shuts.direction = -1
        while t < bounds[-1]:
            stop, event = min(b for b in bounds if b > t), opens if rule == self.shut else shuts
            run = solve_ivp(
                rule,
                (t, stop),
                y,
                "Radau",
                rtol=1e-11,
                atol=1e-13,
                events=event,
                dense_output=True,
                max_step=0.05,
            )
            self.pieces.append(run.sol)
            t, y = run.t[-1], run.y[:, -1].copy()
            if run.status == 1:
                self.events.append((event.__name__, t))
                rule = self.open if rule == self.shut else self.shut
            if run.status == 1 and rule == self.shut:
                y[:-2] -= self.yields * y[:-2].sum() / self.yields.sum()

    def at(self, t):
        return np.array([next(one for one in self.pieces if now <= one.t_max)(now) for now in t]).T


def fallen(t):
    return np.interp(t, FALL["time"], FALL["value"])


def flow_through(lengths, drop):
    """Steady mass flow through columns in series at a pressure drop [kg/s]."""
    return math.sqrt(drop * 2 * RHO * AREA**2 * DIAMETER / (FACTOR * sum(lengths)))


def truth(second=80.0, end=6.0):
    start = flow_through((50.0, second), 3e5 - LOW)
    columns = [(50.0, DIAMETER, fallen), (second, DIAMETER, lambda t: LOW)]
    return Truth(columns, [start, -start], FALL["time"][1:], end)


def apart(result, exact, names=("one.flow", "two.flow"), signs=(1, -1)):
    """Return the greatest relative differences from SciPy of flows and of air mass, at rows away from events."""
    t = np.asarray(result.t)
    rows = np.all([np.abs(t - when) > 0.011 for _, when in exact.events], axis=0)
    found = exact.at(t[rows])
    off = [
        np.abs(sign * RHO * result[name][rows] - found[k]).max()
        for k, (name, sign) in enumerate(zip(names, signs, strict=True))
    ]
    mass = np.abs(result["v.air_mass"][rows] / found[-1] - 1.0).max()
    return max(off) / np.abs(found[: len(names)]).max(), mass


@pytest.mark.parametrize("method", ["auto", "dormand-prince", "radau-iia-5", "rodas-5p"])
def test_it_opens_where_the_joined_columns_would_part_and_joins_them_again(method):
    """Constant to the bit until 1 s; then event times, flows and air mass follow SciPy, with impact."""
    exact, result = truth(), fvsolve.run(summit({"method": method, "rtol": 1e-8}))
    assert result.ok and [what for what, _ in times(result)] == ["opens", "shuts"] == [
        what for what, _ in exact.events
    ]
    for (_, found), (_, true) in zip(times(result), exact.events, strict=True):
        assert found == pytest.approx(true, abs=1e-8)
    flows, mass = apart(result, exact)
    assert flows < 1e-8 and mass < 1e-6
    before = np.asarray(result.t) < 1.0
    for name in PROBES:
        assert np.ptp(result[name][before]) == 0.0
    joined = (np.asarray(result.t) < times(result)[0][1]) | (
        np.asarray(result.t) > times(result)[1][1]
    )
    assert result["one.flow"][joined] == pytest.approx(result["two.flow"][joined], abs=1e-15)
    assert abs(result.ledger["mass"]["relative"]) < 1e-14
    assert [mark["place"] for mark in result.summary["marks"]] == ["links.one", "links.two"]


@pytest.mark.parametrize("method, near", [("rk4", 1e-3), ("implicit-euler", 2e-3)])
def test_given_steps_of_a_millisecond_follow_it_too(method, near):
    exact, result = truth(), fvsolve.run(summit({"method": method, "step": 1e-3}))
    assert result.ok and [what for what, _ in times(result)] == ["opens", "shuts"]
    assert times(result)[0][1] == pytest.approx(exact.events[0][1], abs=1e-12)
    assert times(result)[1][1] == pytest.approx(exact.events[1][1], abs=near)
    assert apart(result, exact)[0] < near
    assert abs(result.ledger["mass"]["relative"]) < 1e-13


def test_three_columns_equal_a_single_column_at_two_joints():
    far = [fallen, lambda t: LOW, lambda t: 1.5e5]
    columns = [(50.0, DIAMETER), (80.0, DIAMETER), (30.0, 0.1)]
    loss = [FACTOR * length / d / (2 * RHO * area(d) ** 2) for length, d in columns]

    def flows(p):
        drops = [one(0.0) - p for one in far]
        return [
            math.copysign(math.sqrt(abs(drop) / k), drop)
            for drop, k in zip(drops, loss, strict=True)
        ]

    p = brentq(lambda p: sum(flows(p)), LOW, 3e5, xtol=1e-6)
    exact = Truth(
        [(*one, p) for one, p in zip(columns, far, strict=True)], flows(p), FALL["time"][1:], 6.0
    )
    links = {
        "a": column("high", "v"),
        "b": column("v", "low", 80.0),
        "c": column("third", "v", 30.0, 0.1),
    }
    names = ["a.flow", "b.flow", "c.flow"]
    result = fvsolve.run(
        summit(nodes={"third": low(1.5e5)}, links=links, probes=[*names, "v.air_mass"])
    )
    assert [what for what, _ in times(result)] == ["opens", "shuts"]
    for (_, found), (_, true) in zip(times(result), exact.events, strict=True):
        assert found == pytest.approx(true, abs=1e-7)
    assert apart(result, exact, names, (1, -1, 1))[0] < 1e-7


def test_a_second_air_valve_that_stays_shut_is_but_a_joint():
    """Columns of 80 m and 30 m at a shut air valve are equivalent to a column of 110 m."""
    nodes = {"w": {**AIR_VALVE, "elevation": 4.0}}
    links = {
        "one": column("high", "v"),
        "two": column("v", "w", 80.0),
        "three": column("w", "low", 30.0),
    }
    result, exact = fvsolve.run(summit(nodes=nodes, links=links)), truth(110.0)
    assert [what for what, _ in times(result)] == ["opens", "shuts"] and not times(result, "w")
    for (_, found), (_, true) in zip(times(result), exact.events, strict=True):
        assert found == pytest.approx(true, abs=1e-7)


@pytest.mark.parametrize("law", ["log", "table", "mixture"])
def test_under_other_laws_it_differs_by_their_compressibility(law):
    case = summit(law=law)
    if law == "table":
        case["fluid"] = {"name": "Water", "law": law}
    if law == "mixture":
        case["fluid"] |= {"air_fraction": 1e-5}
    result, exact = fvsolve.run(case), truth()
    assert [what for what, _ in times(result)] == ["opens", "shuts"]
    for (_, found), (_, true) in zip(times(result), exact.events, strict=True):
        assert found == pytest.approx(true, rel=2e-3)
    before = np.asarray(result.t) < 1.0
    assert np.ptp(result["one.flow"][before]) == np.ptp(result["v.pressure"][before]) == 0.0
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_drawn_the_other_way_it_is_the_same_to_rounding():
    plain, turned = summit(), summit()
    for link in turned["links"].values():
        link["from"], link["to"] = link["to"], link["from"]
    turned["links"] = dict(reversed(turned["links"].items()))
    turned["nodes"] = dict(reversed(turned["nodes"].items()))
    one, two = fvsolve.run(plain), fvsolve.run(turned)
    for (_, found), (_, true) in zip(times(two), times(one), strict=True):
        assert found == pytest.approx(true, abs=1e-9)
    rows = np.all([np.abs(np.asarray(one.t) - when) > 0.011 for _, when in times(one)], axis=0)
    for name in ("one.flow", "two.flow"):
        assert np.interp(one.t, two.t, two[name])[rows] == pytest.approx(-one[name][rows], abs=1e-9)


def test_its_energy_closes_and_the_loss_of_the_impact_is_accounted():
    """Impact loss (Carnot): M^2 / (2 rho sum(A / L)), with M the net mass flow into the summit before the impact."""
    exact, found = truth(), energy(summit({"method": "dormand-prince", "rtol": 1e-8}), port="low")
    assert abs(found.relative) < 1e-10 and found.port.passive
    met = exact.pieces[
        next(k for k, one in enumerate(exact.pieces) if one.t_max >= exact.events[1][1])
    ]
    brought = met(exact.events[1][1])[:2].sum()
    lost = sum(found.dissipated[f"{name} stopped dead"][-1] for name in ("one", "two"))
    assert lost == pytest.approx(0.5 * brought**2 / (RHO * exact.yields.sum()), rel=1e-6)


class LastRowSink:
    """Sink that keeps checkpoints, the last row and the summary."""

    def __init__(self):
        self.states, self.last, self.summary = [], None, None

    def rows(self, t, values):
        self.last = values[-1]

    def field(self, t, fields):
        pass

    def checkpoint(self, state):
        self.states.append(state)

    def end(self, summary):
        self.summary = summary


def test_resumed_while_it_is_open_it_is_the_unbroken_run_bit_for_bit(monkeypatch):
    at = import_module("fvsolve.core.solve.solve")
    monkeypatch.setattr(at, "CHECKPOINT_SECONDS", 0.0)
    case = fvsolve.load(summit({"method": "dormand-prince", "rtol": 1e-7}))
    whole, rest, model = LastRowSink(), LastRowSink(), fvsolve.build(case)
    at.solve(model, at.initial_state(model), whole)
    opened, shut = (event.time for event in whole.summary.events)
    state = next(one for one in whole.states if opened < one.t < shut)
    at.solve(fvsolve.build(case), state, rest)
    assert np.array_equal(rest.last, whole.last) and rest.summary.events == whole.summary.events
    assert rest.summary.ledgers == whole.summary.ledgers


def test_advance_in_a_loop_is_the_run():
    numerics = {"method": "dormand-prince", "rtol": 1e-7}
    whole = fvsolve.run(summit(numerics))
    model = fvsolve.build(fvsolve.load(summit(numerics)))
    state = State(0.0, model.start.copy())
    for until in (1.2, 2.0, 4.0, 5.0, 6.0):
        state = fvsolve.advance(model, state, until)
    assert model.observe(state)[:2] == pytest.approx(
        [whole[name][-1] for name in PROBES[:2]], rel=1e-6
    )


@pytest.mark.parametrize("opening", [step(1.0, 1, 0), ramp(1.0, 0.5, 1, 0)])
def test_a_valve_beyond_it_that_shuts_stops_both_columns_and_lets_no_air_in(opening):
    """The valve stops two columns as it stops a single column of their total length."""
    nodes = {"g": junction(elevation=0.0)}
    links = {
        "one": column("high", "v"),
        "two": column("v", "g", 80.0),
        "k": gate("g", "low", 0.01, opening),
    }
    probes = ["one.flow", "two.flow", "g.pressure", "v.pressure"]
    result = fvsolve.run(summit(end=2.0, high=3e5, nodes=nodes, links=links, probes=probes))
    single = {"one": column("high", "g", 130.0), "k": links["k"]}
    joined = {"high": low(3e5), "g": junction(elevation=0.0), "low": low()}
    plain = fvsolve.run(scene(joined, single, 2.0, CLOSE, ["one.flow", "g.pressure"], fluid=WATER))
    assert result.ok and not times(result)
    off = result["two.flow"] - np.interp(result.t, plain.t, plain["one.flow"])
    assert np.abs(off[np.asarray(result.t) != 1.0]).max() < 1e-7
    assert result["one.flow"] == pytest.approx(result["two.flow"], abs=1e-12)
    assert result["g.pressure"].max() == pytest.approx(plain["g.pressure"].max(), rel=1e-6)
    assert result["one.flow"][-1] == 0.0 and result["g.pressure"][-1] == pytest.approx(
        3e5, rel=1e-12
    )
    assert result["v.pressure"][-1] == pytest.approx(3e5 - RHO * GRAVITY * HEIGHT, rel=1e-12)


@pytest.mark.parametrize("opening", [step(1.0, 1, 0), ramp(1.0, 0.3, 1, 0)])
def test_a_valve_before_it_that_shuts_lets_the_column_beyond_run_on_over_air(opening):
    nodes = {"g": junction(elevation=0.0)}
    links = {
        "k": gate("high", "g", 0.01, opening),
        "one": column("g", "v"),
        "two": column("v", "low", 80.0),
    }
    result = fvsolve.run(summit(end=2.0, high=3e5, nodes=nodes, links=links))
    assert result.ok and [what for what, _ in times(result)] == ["opens"]
    assert (
        times(result)[0][1] <= 1.3 and result["one.flow"][-1] == 0.0 < 0.05 < result["two.flow"][-1]
    )


def test_a_gate_that_shuts_at_once_leaves_the_column_to_the_air():
    """A column that flows away from the gate runs on over air; a column that flows towards it stops at once."""
    away = {"k": gate("high", "v", 0.01, step(1.0, 1, 0)), "one": column("v", "low", 80.0)}
    result = fvsolve.run(summit(end=3.0, high=3e5, links=away, probes=["one.flow", "v.pressure"]))
    assert result.ok and times(result) == [("opens", 1.0)] and result["one.flow"][-1] > 0.05
    toward = {"one": column("high", "v"), "k": gate("v", "low", 0.01, step(1.0, 1, 0))}
    result = fvsolve.run(summit(end=3.0, high=3e5, links=toward, probes=["one.flow", "v.pressure"]))
    assert result.ok and not times(result) and result["one.flow"][-1] == 0.0
    assert result["v.pressure"][-1] == pytest.approx(3e5 - RHO * GRAVITY * HEIGHT, rel=1e-12)


def test_at_the_end_of_a_single_column_it_fills_and_drains_it():
    """The flow is zero until the pressure at the valve is below ambient; then the column drains from it."""
    drop = {"time": [0.0, 1.0, 2.0], "value": [2e5, 2e5, 0.9e5]}
    case = summit(
        end=4.0, high=drop, links={"one": column("high", "v")}, probes=["one.flow", "v.pressure"]
    )
    del case["nodes"]["low"]
    result = fvsolve.run(case)
    true = 1.0 + (2e5 - RHO * GRAVITY * HEIGHT - AMBIENT + 10.0) / 1.1e5
    assert result.ok and times(result)[0] == ("opens", pytest.approx(true, abs=1e-12))
    shut = np.asarray(result.t) <= true
    assert np.all(result["one.flow"][shut] == 0.0) and result["one.flow"][-1] < -0.01


def test_a_column_that_a_valve_shuts_against_higher_pressure_runs_on_to_the_end():
    """Of two flows that a closing valve permits, the run keeps the flow of before, given by SciPy from the momentum."""
    shut, opening = 2.5, {"time": [0.0, 2.0, 2.5], "value": [1.0, 1.0, 0.0]}
    nodes = {"high": low(FALL), "v": junction(elevation=HEIGHT), "t": tank(1.0, 6.0, elevation=0.0)}
    links = {"one": column("high", "v"), "k": gate("v", "t", 0.01, opening)}
    case = scene(nodes, links, shut, CLOSE, ["one.flow", "v.pressure", "t.level"], every=1e-3)
    result = fvsolve.run(case)

    def rates(t, y):
        drop = (y[0] / (0.01 * (1.0 - (t - 2.0) / 0.5))) ** 2 / (2.0 * RHO)
        lost = FACTOR * 50.0 / DIAMETER * y[0] * abs(y[0]) / (2 * RHO * AREA**2)
        return [AREA / 50.0 * (fallen(t) - lost - drop - AMBIENT - GRAVITY * y[1]), y[0]]

    at = np.searchsorted(result.t, 2.0)
    start = [RHO * result["one.flow"][at], RHO * result["t.level"][at]]
    exact = solve_ivp(
        rates,
        (result.t[at], shut - 9e-4),
        start,
        "Radau",
        rtol=1e-10,
        atol=1e-12,
        dense_output=True,
    )
    for ahead in (0.1, 0.01, 1e-3):
        k = np.argmin(np.abs(np.asarray(result.t) - (shut - ahead)))
        assert RHO * result["one.flow"][k] == pytest.approx(exact.sol(result.t[k])[0], rel=2e-5)
    assert np.all(result["one.flow"] >= 0.0) and result.ok and not result.summary["marks"]
    seen = result.summary["extremes"]["v.pressure"]
    assert (
        seen["minimum"] == pytest.approx(1e5 - RHO * GRAVITY * HEIGHT, rel=1e-12)
        and seen["maximum"] > 1.9e6
    )
    assert result.summary["steps"] < 1000


@pytest.mark.parametrize("law", ["linear", "log"])
def test_where_a_valve_all_but_shuts_its_ledger_closes_under_linearly_implicit_steps(law):
    """The mass balance closes, because Newton's method starts from the flow that the valve would pass.

    From the initial flow it stopped early, with an error of 2e-6 of the contents under `log`, or did not converge.
    """
    opening = {"time": [0.0, 1.0, 1.5, 3.0, 3.5], "value": [1.0, 1.0, 0.0, 0.0, 1.0]}
    nodes = {"g": junction(elevation=0.0)}
    links = {
        "k": gate("high", "g", 0.01, opening),
        "one": column("g", "v"),
        "two": column("v", "low", 80.0),
    }
    numerics = {"method": "rodas-5p", "rtol": 1e-6}
    result = fvsolve.run(summit(numerics, end=4.0, high=3e5, nodes=nodes, links=links, law=law))
    assert result.ok and abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("opening", [step(1.0, 1, 0), ramp(1.0, 0.5, 1, 0)])
def test_two_columns_at_a_junction_flow_on_together_when_its_last_valve_shuts(opening):
    """The columns reach the steady flow of one column, without the fault "the demand cannot be supplied"."""
    nodes = {"j": junction(elevation=HEIGHT), "side": low(2e5)}
    links = {
        "one": column("high", "j"),
        "two": column("j", "low", 80.0),
        "k": gate("j", "side", 0.01, opening),
    }
    case = summit(end=20.0, high=3.2e5, nodes=nodes, links=links, probes=["one.flow", "two.flow"])
    del case["nodes"]["v"]
    result = fvsolve.run(case)
    assert result.ok and result["one.flow"][-1] == pytest.approx(result["two.flow"][-1], abs=1e-15)
    assert RHO * result["one.flow"][-1] == pytest.approx(
        flow_through((50.0, 80.0), 3.2e5 - LOW), rel=1e-5
    )


def test_columns_that_separate_at_the_start_do_so_over_air_and_joined_columns_move_together():
    for flows, what in (((0.05, 0.1), ["opens", "shuts"]), ((0.1, 0.05), [])):
        links = {"one": column("high", "v", initial_flow=flows[0])}
        links["two"] = column("v", "low", 80.0, initial_flow=flows[1])
        result = fvsolve.run(summit(end=4.0, high=2e5, nodes={"low": low(1.8e5)}, links=links))
        assert result.ok and [said for said, _ in times(result)] == what
        if not what:
            assert result["one.flow"][0] == pytest.approx(
                (0.1 * 50.0 + 0.05 * 80.0) / 130.0, rel=1e-12
            )


def test_without_friction_it_stays_at_rest():
    links = {"one": column("high", "v"), "two": column("v", "low")}
    for link in links.values():
        link["friction"] = NO_FRICTION
    result = fvsolve.run(summit(end=1.0, high=LOW, links=links))
    assert result.ok and all(np.ptp(result[name]) == 0.0 for name in PROBES)


def test_a_valve_from_it_to_where_columns_alone_lead_on_is_refused_by_name():
    links = {"one": column("high", "v"), "k": gate("v", "j", 0.05), "two": column("j", "low")}
    with pytest.raises(fvsolve.CaseError, match="nodes.v: a valve joins this air valve to j"):
        fvsolve.build(fvsolve.load(summit(nodes={"j": junction(elevation=HEIGHT)}, links=links)))


def test_a_valve_or_pump_between_columns_that_nothing_holds_is_refused_by_name():
    """Without this fault the columns flow through a nearly closed valve, and all balances close."""
    lifts = {"type": "pump", "from": "v", "to": "j", "curve": {"flow": [0.1], "head": [10.0]}}
    for part in (gate("v", "j", 0.05), lifts):
        links = {"one": column("high", "v"), "k": part, "two": column("j", "low")}
        nodes = {name: junction(elevation=HEIGHT) for name in ("v", "j")}
        with pytest.raises(
            fvsolve.CaseError,
            match="nodes.[vj]: k joins this node to [jv], and otherwise only rigid",
        ):
            fvsolve.build(fvsolve.load(summit(probes=(), nodes=nodes, links=links)))
