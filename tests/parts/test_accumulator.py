"""Accumulators and air vessels against closed forms, energy integrals and SciPy, with losses by direction."""

import math

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import AMBIENT, RHO, WATER, area, lake, reservoir, scene
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run
from fvsolve.studies.energy_balance import energy

TIGHT = {"method": "dormand-prince", "rtol": 1e-11}
LENGTH, DIAMETER, BORE = 20.0, 0.1, area(0.1)
P0, GAS, N = 6e5, 0.05, 1.3
INERTIA = RHO * LENGTH / BORE  # inertance of the column, dp = INERTIA dq/dt


def vessel(**more) -> dict:
    return {"type": "accumulator", "volume": 0.1, "gas_volume": GAS, "exponent": N, **more}


def swing(
    flow: float,
    end: float,
    numerics=TIGHT,
    law="linear",
    probes=("a.gas_pressure", "c.flow"),
    **more,
) -> dict:
    """Return a case of a rigid column between a reservoir and an accumulator, with the initial flow `flow` [m3/s]."""
    links = {
        "c": {
            "type": "rigid-column",
            "from": "lake",
            "to": "a",
            "length": LENGTH,
            "diameter": DIAMETER,
            "initial_flow": flow,
        }
    }
    nodes = {"lake": reservoir(P0), "a": vessel(**more)}
    return scene(nodes, links, end, numerics, probes, fluid=WATER | {"law": law})


def model_of(case):
    return fvsolve.build(fvsolve.load(case))


@pytest.mark.parametrize("law, near", [("linear", 1e-7), ("log", 1e-3)])
def test_a_small_oscillation_has_its_closed_period(law, near):
    """omega^2 = n p0 A / (rho L V0); under `log` the compressible fluid changes omega by less than 1e-3."""
    model = model_of(swing(0.0, 1.0, law=law))
    found = np.linalg.eigvals(model.jacobian(0.0, np.zeros(2))).imag.max()
    assert found == pytest.approx(math.sqrt(N * P0 / (INERTIA * GAS)), rel=near)


@pytest.mark.parametrize("n", [1.0, 1.2, 1.4])
def test_a_large_oscillation_turns_where_its_energy_is_gas_energy(n):
    """At both extremes INERTIA q0^2 / 2 equals the work on the gas minus the work of the reservoir."""
    q0 = 0.05
    result = fvsolve.run(
        swing(q0, 5.0, exponent=n) | {"output": {"every": 0.001, "probes": ["a.gas_pressure"]}}
    )

    def left(volume):
        gas = (
            math.log(GAS / volume) if n == 1.0 else ((GAS / volume) ** (n - 1.0) - 1.0) / (n - 1.0)
        )
        return P0 * GAS * gas + P0 * (volume - GAS) - 0.5 * INERTIA * q0**2

    turns = [brentq(left, 1e-3, GAS, xtol=1e-15), brentq(left, GAS, 1.0, xtol=1e-15)]
    extremes = [P0 * (GAS / volume) ** n for volume in turns]
    greatest, least = result["a.gas_pressure"].max(), result["a.gas_pressure"].min()
    assert (greatest, least) == pytest.approx(extremes, rel=2e-6)  # error of rows every millisecond


def test_losses_by_direction_follow_scipy():
    """The throat loses dp = K rho v |v| / 2 with K_in or K_out, as in SciPy without transition flow."""
    k_in, k_out, throat = 2.0, 9.0, area(0.05)
    connection = {"diameter": 0.05, "loss_in": k_in, "loss_out": k_out}
    result = fvsolve.run(swing(0.04, 6.0, connection=connection))
    first = result["a.gas_pressure"][0]

    def rates(t, y):
        q, v = y
        loss = (k_in if q > 0 else k_out) * RHO * q * abs(q) / (2 * throat**2)
        return (P0 - first * (GAS / v) ** N - loss) / INERTIA, -q

    exact = solve_ivp(rates, (0, 6.0), [0.04, GAS], t_eval=result.t, rtol=1e-12, atol=1e-14)
    assert result["c.flow"] == pytest.approx(exact.y[0], abs=1e-8)
    assert result["a.gas_pressure"] == pytest.approx(first * (GAS / exact.y[1]) ** N, rel=1e-7)


def filled(law: str, q: float = 1e-3, end: float = 40.0, **more) -> dict:
    """Return a case of a constant inflow `q` [m3/s] into an accumulator."""
    nodes = {"in": {"type": "inflow", "flow": q}, "a": vessel(initial_pressure=P0, **more)}
    links = {"gap": {"type": "valve", "from": "in", "to": "a", "area": 1e-3}}
    return scene(
        nodes, links, end, TIGHT, ("a.pressure", "a.gas_volume"), 1.0, fluid=WATER | {"law": law}
    )


@pytest.mark.parametrize("n", [1.0, 1.4])
def test_filling_squeezes_the_gas_by_its_law(n):
    result = fvsolve.run(filled("linear", exponent=n))
    assert result["a.pressure"] == pytest.approx(
        P0 * (GAS / (GAS - 1e-3 * result.t)) ** n, rel=1e-9
    )
    assert abs(result.ledger["mass"]["relative"]) < 1e-14


def test_under_log_the_fluid_in_the_vessel_is_squeezed_too():
    """Fluid mass: rho(p) (vessel volume - gas volume) equals the initial mass plus the inflow."""
    result = fvsolve.run(filled("log"))
    beta = WATER["bulk_modulus"]

    def rho(p):
        return RHO * math.exp((p - AMBIENT) / beta)

    def volume(t):
        mass = rho(P0) * (0.1 - GAS) + RHO * 1e-3 * t
        return brentq(lambda v: rho(P0 * (GAS / v) ** N) * (0.1 - v) - mass, 1e-4, 0.1, xtol=1e-16)

    exact = np.array([volume(t) for t in result.t])
    assert result["a.gas_volume"] == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_bladder_empties_and_fills_again_at_its_precharge(law):
    """Below the precharge the neck takes up the pressure; both switches are events, and the flow follows SciPy."""
    case = swing(
        -0.04,
        2.5,
        law=law,
        gas_volume=None,
        precharge=5e5,
        probes=["a.pressure", "c.flow", "a.gas_volume"],
    )
    del case["nodes"]["a"]["gas_volume"]
    result = fvsolve.run(case)
    stiff, whole = WATER["bulk_modulus"] / (0.01 * 0.1), 0.1
    gas = whole * (5e5 / P0) ** (1 / N)

    def pressure(v):
        return P0 * (gas / v) ** N if v < whole else 5e5 - stiff * (v - whole)

    def rates(t, y):
        return (P0 - pressure(y[1])) / INERTIA, -y[0]

    exact = solve_ivp(
        rates, (0, 2.5), [-0.04, gas], t_eval=result.t, rtol=1e-10, atol=1e-14, max_step=1e-4
    )
    texts = [event["what"] for event in result.summary["events"]]
    assert texts[:2] == ["is empty", "holds fluid again"] and len(texts) in (2, 3)
    first, last = (event["time"] for event in result.summary["events"][:2])
    # the bounce of 5 ms depends on the law
    away = (law == "linear") | (result.t < first) | (result.t > last)
    assert result["c.flow"][away] == pytest.approx(
        exact.y[0][away], abs=0.04 * (1e-6 if law == "linear" else 3e-3)
    )


def test_nothing_moves_while_nothing_changes():
    connection = {"diameter": 0.05, "loss_in": 2.0, "loss_out": 9.0}
    for law in ("linear", "log"):
        for more in ({}, {"connection": connection}):
            model = model_of(swing(0.0, 1.0, law=law, **more))
            assert not model.rhs(0.0, np.zeros(model.y_size)).any()


@pytest.mark.parametrize("law", ["linear", "log"])
def test_its_energy_closes_and_it_gives_no_more_than_it_had(law):
    """The energy balance closes, dissipation never decreases, and the network is passive at its port."""
    connection = {"diameter": 0.05, "loss_in": 2.0, "loss_out": 9.0}
    for more in ({"exponent": 1.0}, {"connection": connection}):
        one = energy(
            swing(0.04, 1.6, {"method": "gauss-6", "step": 1e-3}, law, **more), port="lake"
        )
        column = sum(loss[-1] for loss in one.law.values())  # law loss of the rigid column
        assert (
            abs(one.numerical_remainder[-1] - column) < 1e-9 * one.throughput and one.port.passive
        )
        at_start = one.at_start.get("a", one.at_start.get("a.inside"))
        assert at_start > 0.0
        assert all((np.diff(loss) >= -1e-9).all() for loss in one.dissipated.values())


def test_its_energy_at_the_start_is_its_available_energy():
    """Available energy of isothermal gas: p0 V0 ln(p0 / pa) minus the work against ambient pressure."""
    from fvsolve.core.model.energy_accounts import available_energy

    model = model_of(swing(0.0, 1.0, exponent=1.0, volume=1.0))
    volume = GAS * P0 / AMBIENT
    exact = P0 * GAS * math.log(P0 / AMBIENT) - AMBIENT * (volume - GAS)
    assert available_energy(model)["a"] == pytest.approx(exact, rel=1e-9)


def test_the_pattern_holds_every_coupling():
    connection = {"diameter": 0.05, "loss_in": 2.0, "loss_out": 9.0}
    model = model_of(swing(0.01, 1.0, connection=connection))
    pattern = jacobian_pattern(model).toarray()[: model.y_size]
    assert not np.any((np.abs(model.jacobian(0.0, np.array([0.1, 0.3]))) > 1e-9) & ~pattern)


def test_an_empty_start_is_reported():
    case = swing(0.0, 1.0, probes=["a.pressure"])
    case["nodes"]["a"] = {"type": "accumulator", "volume": 0.1, "precharge": 9e5}
    assert "a: empty at the start" in " ".join(one.text for one in model_of(case).warnings)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_precharge_above_the_line_stays_until_the_line_exceeds_it(law):
    """A full bladder leaves the neck, as stiff as its fluid, until the line exceeds the precharge, as in SciPy."""
    case = swing(
        0.0, 2.0, law=law, probes=["a.pressure", "c.flow", "a.gas_volume", "a.gas_pressure"]
    )
    case["nodes"]["a"] = {"type": "accumulator", "volume": 0.1, "precharge": 9e5, "exponent": N}
    case["nodes"]["lake"] = reservoir({"time": [0.0, 0.5, 1.0], "value": [P0, P0, 12e5]})
    result, stiff = fvsolve.run(case), WATER["bulk_modulus"] / (0.01 * 0.1)
    shed = (9e5 - P0) / stiff

    def rates(t, y):
        p = P0 + stiff * y[1] if y[1] < shed else 9e5 * (1.0 - (y[1] - shed) / 0.1) ** -N
        return (np.interp(t, [0.5, 1.0], [P0, 12e5]) - p) / INERTIA, y[0]

    def lifts(t, y):
        return y[1] - shed

    exact = solve_ivp(
        rates,
        (0, 2.0),
        [0.0, 0.0],
        t_eval=result.t,
        events=lifts,
        rtol=1e-10,
        atol=1e-15,
        max_step=2e-4,
    )
    (event,) = result.summary["events"]
    assert event["what"] == "holds fluid again" and [event["time"]] == pytest.approx(
        exact.t_events[0], rel=1e-4
    )
    stands = result.t < event["time"]
    assert (result["a.gas_volume"][stands] == 0.1).all() and result["a.pressure"][
        stands
    ].max() < 9e5
    assert result["a.gas_pressure"] == pytest.approx(
        9e5 * (0.1 / result["a.gas_volume"]) ** N, rel=1e-12
    )
    if law == "linear":  # under `log` the fluid in the vessel is compressed too
        assert result["c.flow"] == pytest.approx(exact.y[0], abs=1e-6 * exact.y[0].max())


@pytest.mark.parametrize(
    "wrong, said",
    [
        ({"gas_volume": None}, "no gas; expected one of precharge, gas_volume"),
        ({"precharge": 1e5}, "precharge and gas_volume are given; keep one"),
        ({"gas_volume": 0.2}, "0.2 m3 is greater than `volume`, 0.1 m3"),
        ({"gas_volume": 0.0}, "out of range"),
        ({"exponent": 0.9}, "out of range; expected a value of at least 1"),
        ({"initial_pressure": 1000.0}, "vapour pressure"),
        ({"connection": {"loss_in": 1.0}}, "loss_out is missing"),
        ({"connection": 3.0}, "is not a connection; expected { diameter, loss_in, loss_out }"),
    ],
)
def test_faults_of_an_accumulator_are_reported(wrong, said):
    case = swing(0.0, 1.0)
    given = case["nodes"]["a"] | wrong
    case["nodes"]["a"] = {key: value for key, value in given.items() if value is not None}
    assert said in str(refused(case))


@pytest.mark.parametrize(
    "precharge, switches, law", [(4.01e5, 3, "linear"), (4.01e5, 3, "log"), (7e5, 2, "linear")]
)
def test_a_check_valve_next_to_an_empty_bladder_opens_once(precharge, switches, law):
    """The check valve opens where n^2 70 m reaches the lift of 28 m; afterwards its flow equals the outflow."""
    curve = {"flow": [0.0, 0.04, 0.06], "head": [70.0, 60.0, 45.0]}
    speed = {"time": [1.0, 1.5, 5.0, 6.0], "value": [1.0, 0.3, 0.3, 1.0]}
    links = {
        "p": {
            "type": "pump",
            "from": "s",
            "to": "a",
            "curve": curve,
            "speed": speed,
            "check_valve": True,
        },
        "g": {"type": "valve", "from": "a", "to": "o", "area": 0.003},
    }
    nodes = {
        "s": lake(2.0),
        "a": {"type": "accumulator", "volume": 0.2, "precharge": precharge},
        "o": lake(30.0),
    }
    case = scene(
        nodes, links, 5.485, {}, ["p.flow", "g.flow"], every=1e-3, fluid=WATER | {"law": law}
    )
    result = fvsolve.run(case)
    events = result.summary["events"]
    times = [event["time"] for event in events if event["what"] == "check valve opens"]
    # it opens at a drop of 1 Pa
    assert times == pytest.approx([5.0 + (math.sqrt(0.4) - 0.3) / 0.7], abs=1e-5)
    assert len(events) == switches
    late = result.t > times[0] + 5e-4
    assert np.count_nonzero(late) > 5
    np.testing.assert_allclose(result["p.flow"][late], result["g.flow"][late], rtol=1e-3)


def crowding() -> dict:
    """Return a case of Euler steps of 1 s on bladders that empty every millisecond, so that events cut each step."""
    nodes = {
        name: {
            "type": "accumulator",
            "volume": volume,
            "precharge": 487697.8989862603,
            "initial_pressure": pressure,
        }
        for name, volume, pressure in (
            ("a", 0.004987588103931503, 1199485.5612143674),
            ("b", 0.9755041114238246, 257221.7644945206),
        )
    }
    way = {
        "type": "rigid-column",
        "from": "a",
        "to": "b",
        "length": 31.862243811623756,
        "diameter": 0.02,
    }
    way["friction"] = {"model": "quasi-steady", "factor": 0.02}
    numerics = {"method": "euler", "step": 1.0, "initial": "rest"}
    return scene(nodes, {"way": way}, 3.0, numerics, ["way.flow"], 0.1)


def test_events_that_crowd_within_a_step_are_bounded_and_named():
    result = fvsolve.run(crowding())
    ended = [
        said in result.reason
        for said in ("a changes its state without end", "way.flow has grown to")
    ]
    assert not result.ok and any(ended)  # either reason: the step also exceeds Euler's limit
    events = [event["time"] for event in result.summary["events"]]
    assert len(events) < 5000 and 1.0 < events[-1] < 3.0


def test_events_that_crowd_are_counted_on_in_a_run_that_is_resumed():
    model = fvsolve.build(fvsolve.load(crowding()))

    def late(t, seconds, steps):
        run.budget = 2.0  # steps until the next call
        if len(run.loop.recent_events) > 10:
            raise KeyboardInterrupt

    run = Run(model, fvsolve.initial_state(model), MemorySink(model), late)
    run.left = 2.0
    assert run.go().reason.startswith("interrupted")
    again = Run(model, run.state(), MemorySink(model), None)
    for name in ("recent_events", "last_switch", "at_once", "switched"):
        assert getattr(again.loop, name) == getattr(run.loop, name)
