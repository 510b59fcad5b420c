"""A run that stores more energy than it had at the start and than its sources supplied is not ok."""

import math
from pathlib import Path

import numpy as np
import pytest
from reference.scenes import (
    NO_FRICTION,
    area,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    tank,
    valve,
)

import fvsolve
from fvsolve.core.kernels.energy_supply import ERROR, RELEASED, STATES
from fvsolve.core.model import RunData
from fvsolve.core.model.energy_accounts import Accounts
from fvsolve.core.run import model_of
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.energy_watch import EnergyWatch
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.core.solve.solve import Run
from fvsolve.studies.outcome import RowSink

CASES = Path(__file__).parents[2] / "cases"
SPEED, LENGTH, DIAMETER, FLOW = 1000.0, 500.0, 0.2, 0.01
RETURN = 1.1  # time at which the flow of `ringing` is -FLOW, under the pressure of the start [s]


def energy_notices(result) -> list:
    return [one for one in result.warnings if one.kind == "energy"]


def ringing(**numerics) -> dict:
    """Frictionless pipe whose outflow stops at once at 0.1 s; its wave has the kinetic energy of the flow."""
    nodes = {
        "lake": lake(100.0),
        "end": junction({"time": [0.0, 0.1], "value": [FLOW, 0.0], "kind": "step"}),
    }
    links = {"main": pipe("lake", "end", LENGTH, DIAMETER, SPEED, 50, friction=NO_FRICTION)}
    return scene(
        nodes,
        links,
        4.0,
        {"scheme": "upwind", "method": "euler", "courant": 1.0, **numerics},
        ["end.pressure"],
    )


def amplified(monkeypatch, factor: float, time: float) -> None:
    """Multiply the deviations of the next runs by a factor once, after a time [s]: energy without a source."""
    steps = RunLoop.run

    def run(loop, budget):
        code = steps(loop, budget if loop.t >= time else min(budget, 1.0))
        if loop.t >= time and not getattr(loop, "amplified", False):
            loop.now[:] *= factor
            loop.amplified = True
        return code

    monkeypatch.setattr(RunLoop, "run", run)


def test_energy_that_nothing_supplies_is_named_with_its_amount(monkeypatch):
    """The flow that returns is -FLOW, a deviation of -2 FLOW: 1.5 times it is -2 FLOW, with 3 times more energy."""
    # before: steady flow; after: wave with the deviation
    wave = 0.5 * 1000.0 * LENGTH * FLOW**2 / area(DIAMETER)
    amplified(monkeypatch, 1.5, RETURN)
    result = fvsolve.run(ringing())
    (notice,) = energy_notices(result)
    assert (
        not result.ok and not notice.ok and notice.place == "main" and result.reason == "finished"
    )
    assert notice.limit < notice.value == pytest.approx(3.0 * wave, rel=0.05)


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_a_run_that_conserves_or_loses_energy_is_ok(monkeypatch, factor):
    amplified(monkeypatch, factor, RETURN)
    result = fvsolve.run(ringing())
    assert not energy_notices(result) and all(one.kind != "energy" for one in result.warnings)


def watched(case: dict, threads: int = 1) -> EnergyWatch:
    """Watch of a finished run."""
    model = model_of(case)
    run = Run(model, initial_state(model), RowSink(), None, threads)
    assert run.go().ok
    return run.checks.energy


def test_energy_from_reservoirs_is_mass_times_pressure_over_density():
    """A chamber fills from a reservoir: the supplied energy is p - p_ambient times the volume that entered."""
    pressure, volume, stiffness = 6e5, 0.1, 2.2e9
    nodes = {"source": reservoir(pressure), "vessel": chamber(volume, 2e5)}
    links = {"hole": valve("source", "vessel", 1e-6)}
    watch = watched(scene(nodes, links, 3.0, {"method": "rk4", "step": 1e-3}, ["vessel.pressure"]))
    entered = volume * (pressure - 2e5) / stiffness
    assert watch.supplied.sum() == pytest.approx((pressure - 101325.0) * entered, rel=1e-3)
    # error bound: the pressure is constant
    assert watch.record[ERROR] < 1e-9 * watch.supplied.sum()


def test_a_tank_that_drains_releases_its_stored_energy():
    """From 3 m to the level h a tank of 1 m2 releases rho g (9 - h^2) / 2, and nothing is supplied to it."""
    nodes = {"high": tank(1.0, 3.0), "out": reservoir(101325.0)}
    links = {"way": valve("high", "out", 0.01)}
    watch = watched(scene(nodes, links, 20.0, {"method": "rk4", "step": 0.05}, ["high.level"]))
    level = 3.0 + (watch.entered.sum() + watch.left.sum()) / 1000.0
    assert watch.record[RELEASED] == pytest.approx(
        0.5 * 1000.0 * 9.80665 * (9.0 - level**2), rel=1e-6
    )
    assert watch.supplied.sum() == pytest.approx(0.0, abs=1e-6) and level < 2.9


@pytest.mark.parametrize("method", ["euler", "rk4", "radau-iia-3", "rodas-4"])
def test_levels_that_oscillate_are_no_gain_of_energy(method):
    """Two tanks joined by a rigid column without friction exchange their energy for many periods."""
    nodes = {"one": tank(1.0, 2.0), "two": tank(1.0, 1.0)}
    links = {
        "way": {
            "type": "rigid-column",
            "from": "one",
            "to": "two",
            "length": 100.0,
            "diameter": 0.5,
            "friction": NO_FRICTION,
        }
    }
    period = 2.0 * math.pi * math.sqrt(0.5 * 100.0 / (9.80665 * area(0.5)))
    step = period / (2e4 if method == "euler" else 400.0)
    case = scene(
        nodes,
        links,
        3.0 * period,
        {"method": method, "step": step, "initial": "rest"},
        ["one.level"],
        period,
    )
    result = fvsolve.run(case)
    assert result.ok and not energy_notices(result)


def test_the_watch_takes_few_states_of_a_long_run():
    case = ringing()
    case["numerics"]["end"] = 40.0  # 4000 steps
    assert 6 <= watched(case).record[STATES] <= 15


def test_sources_of_variable_energy_are_watched_more_often():
    """A chamber behind a reservoir that oscillates: its energy per mass varies, so the interval doubles later."""
    pressure = {"mean": 2e5, "amplitude": 1e4, "period": 1.0}
    nodes = {"source": reservoir(pressure), "vessel": chamber(0.1, 2e5)}
    links = {"hole": valve("source", "vessel", 1e-6)}
    watch = watched(scene(nodes, links, 4.0, {"method": "rk4", "step": 1e-3}, ["vessel.pressure"]))
    assert 12 <= watch.record[STATES] <= 30 and watch.record[ERROR] > 0.0


@pytest.mark.parametrize("method", ["heun", "radau-iia-3"])
def test_two_threads_watch_the_same_states(method):
    """The loop of one thread passes its states itself; that of several threads stops at them."""
    alone, team = (watched(ringing(method=method, courant=0.5), threads) for threads in (1, 2))
    same = np.isfinite(alone.restart_data)
    assert alone.record[STATES] == team.record[STATES] > 6
    assert alone.restart_data[same] == pytest.approx(team.restart_data[same], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "name", ["check-valve-slam", "hydraulic-drive", "pump-trip", "anti-roll-free", "clutch"]
)
def test_values_of_sources_are_those_of_the_energy_accounts(name):
    """The watch leaves out functions of powers that no source needs, and takes the energy per mass of a node."""
    model = fvsolve.build(fvsolve.load(CASES / f"{name}.toml"))
    run = Run(model, initial_state(model), RowSink(), None)
    run.go()
    watch, loop, data = run.checks.energy, run.loop, RunData(model)
    for name, array in loop.run_data.arrays().items():
        data.set_array(name, array.copy())
    data.use_flags(loop.run_data.armed)
    data.clock["limit"] = loop.run_data.clock["limit"]
    accounts, dydt, out = Accounts(data), np.zeros(model.y_size), model.new_out()
    power = accounts.power_at(loop.t, loop.now.copy(), dydt, out)[accounts.of("supplied")]
    supply = out[int(model.layout["supply"]) :][watch.arrays.nodes]
    by_node = watch.arrays.nodes >= 0
    watch.add_state(loop, False)
    values = np.where(by_node, watch.arrays.values * supply, watch.arrays.values)
    assert values == pytest.approx(power, rel=1e-12, abs=1e-9 * np.abs(power).max())
