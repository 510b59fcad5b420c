"""Energy balance against closed forms: supplied, stored and dissipated energy, and numerical loss."""

import math

import numpy as np
import pytest
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    NO_FRICTION,
    RHO,
    WATER,
    area,
    chamber,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    tank,
    valve,
)
from scipy.stats import binom

from fvsolve.errors import FvsolveError
from fvsolve.studies.energy_balance import energy

BETA = WATER["bulk_modulus"]
TIGHT = {"method": "dormand-prince", "rtol": 1e-11}
FRICTION = {"model": "steady", "factor": 0.02}


def last(lines: dict) -> float:
    return sum(float(one[-1]) for one in lines.values())


def test_half_of_what_fills_a_chamber_is_lost_in_its_orifice():
    volume, p0, p1 = 0.5, AMBIENT + 2e5, AMBIENT + 5e6
    case = scene({"pump": reservoir(p1), "pot": chamber(volume, p0)}, {"hole": valve("pump", "pot", 1e-6)}, 60.0, TIGHT)
    found = energy(case)
    per = volume / BETA
    assert found.supplied["pump"][-1] == pytest.approx(per * 5e6 * (p1 - p0), rel=1e-8)
    assert found.stored["pot"][-1] == pytest.approx(0.5 * per * (5e6**2 - 2e5**2), rel=1e-8)
    assert found.dissipated["hole"][-1] == pytest.approx(0.5 * per * (p1 - p0) ** 2, rel=1e-8)
    assert found.relative < 1e-9
    assert found.at_start == {"pot": pytest.approx(0.5 * per * 2e5**2)}


def slope_scene(numerics: dict, lift: float = 0.0, **more) -> dict:
    """Case of a sloping main with friction between a lake and a valve, `lift` metres higher."""
    nodes = {"lake": reservoir(AMBIENT + 5e5, elevation=30.0 + lift), "gate": junction(elevation=lift)}
    nodes["out"] = reservoir(AMBIENT, elevation=lift)
    links = {"main": pipe("lake", "gate", 1000.0, 0.3, 1000.0, 40, friction=FRICTION, **more)}
    links["tap"] = valve("gate", "out", 0.002)
    return scene(nodes, links, 3.0, numerics)


@pytest.mark.parametrize("law", ["linear", "log", "table"])
def test_with_no_event_only_the_steady_throughput_is_booked(law):
    """All supplied energy is dissipated, the friction loss follows from the head, and no part stores energy."""
    case = slope_scene({"scheme": "upwind5", "method": "rk4", "courant": 0.8})
    case["fluid"] = {**WATER, "law": law} if law != "table" else {"name": "Water", "temperature": 293.15, "law": law}
    found = energy(case)
    assert not found.stored and not found.step.any()
    assert last(found.supplied) == pytest.approx(last(found.dissipated), rel=1e-13)
    assert np.abs(found.remainder).max() <= 1e-13 * found.throughput
    if law == "linear":
        head = (5e5 + RHO * GRAVITY * 30.0) / (RHO * GRAVITY)
        k = 0.02 * 1000.0 / 0.3 / area(0.3) ** 2 + 1.0 / 0.002**2
        q = math.sqrt(2 * GRAVITY * head / k)
        lost = 3.0 * RHO * q**3 * 0.02 * 1000.0 / 0.3 / (2 * area(0.3) ** 2)
        assert found.dissipated["main friction"][-1] == pytest.approx(lost, rel=1e-9)
        assert found.supplied["lake"][-1] == pytest.approx(3.0 * q * RHO * GRAVITY * head, rel=1e-9)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_heights_count_from_the_lowest_node_and_lifting_a_scene_changes_nothing(law):
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8}
    found = []
    for lift in (0.0, 250.0):
        case = slope_scene(numerics, lift)
        case["fluid"] = {**WATER, "law": law}
        case["links"]["tap"] = valve("gate", "out", 0.002, ramp(0.2, 0.5, 1.0, 0.0))
        found.append(energy(case))
    low, high = found
    assert (low.datum, high.datum) == (0.0, 250.0)
    for what in ("supplied", "stored", "dissipated"):
        for name, one in getattr(low, what).items():
            assert getattr(high, what)[name] == pytest.approx(one, rel=1e-9, abs=1e-9 * low.throughput)
    assert high.remainder == pytest.approx(low.remainder, abs=1e-9 * low.throughput)


def closing(courant: float, cells: int, end: float) -> dict:
    """Case of a lossless main whose valve shuts at once at 0.1 s."""
    nodes = {"lake": lake(50.0), "gate": junction(), "out": reservoir(AMBIENT)}
    links = {"main": pipe("lake", "gate", 1000.0, 0.3, 1000.0, cells)}
    links["tap"] = valve("gate", "out", 0.002, step(0.1, 1.0, 0.0))
    return scene(nodes, links, end, {"scheme": "upwind", "method": "euler", "courant": courant})


def test_a_sudden_closure_at_courant_one_loses_nothing():
    found = energy(closing(1.0, 20, 4.0))
    assert np.abs(found.remainder).max() < 1e-12 * found.throughput
    assert found.scheme["main"][-1] > 0.01 * found.throughput  # steps create what cells dissipate
    assert found.verdict == "rounding"


def test_the_dissipation_of_upwind_at_a_front_is_the_binomial_one():
    """Each step dissipates C (1 - C) sum of (u_i - u_i-1)^2 dx / (rho A); behind a jump, differences are binomial."""
    courant, cells, steps = 0.5, 100, 100
    h = courant * 10.0 / 1000.0
    found = energy(closing(courant, cells, 0.1 + steps * h))
    flow = RHO * 0.002 * math.sqrt(2 * GRAVITY * 50.0)
    squares = sum(float(np.sum(binom.pmf(np.arange(n + 1), n, courant) ** 2)) for n in range(steps))
    exact = courant * (1 - courant) * flow**2 * squares * 10.0 / (RHO * area(0.3))
    assert found.remainder[-1] == pytest.approx(exact, rel=1e-9)


def swing(numerics: dict, friction: dict, end: float) -> dict:
    """Case of two tanks joined by a rigid column, with levels 2 m apart."""
    nodes = {"a": tank(2.0, 5.0), "b": tank(3.0, 3.0)}
    links = {"way": {"type": "rigid-column", "from": "a", "to": "b", "length": 50.0, "diameter": 0.5,
                     "friction": friction}}  # fmt: skip
    return scene(nodes, links, end, {**numerics, "initial": "rest"})


def test_a_column_between_tanks_trades_height_for_speed():
    omega = math.sqrt(GRAVITY * area(0.5) / 50.0 * (1 / 2.0 + 1 / 3.0))
    found = energy(swing(TIGHT, NO_FRICTION, 0.5 * math.pi / omega))
    spent = 0.5 * RHO * GRAVITY * 2.0**2 * 2.0 * 3.0 / 5.0
    assert found.stored["way"][-1] == pytest.approx(spent, rel=1e-8)
    assert found.stored["a"][-1] + found.stored["b"][-1] == pytest.approx(-spent, rel=1e-8)
    assert found.at_start["a"] == pytest.approx(0.5 * RHO * GRAVITY * 2.0 * 5.0**2)


@pytest.mark.parametrize("method", ["gauss-2", "gauss-4", "gauss-6"])
@pytest.mark.parametrize("friction", [NO_FRICTION, FRICTION], ids=["free", "rough"])
def test_gauss_methods_leave_no_remainder(method, friction):
    found = energy(swing({"method": method, "step": 3.0}, friction, 90.0))
    assert found.stored["way"].max() > 1e3
    assert np.abs(found.remainder).max() < 1e-12 * found.stored["way"].max()


def test_euler_creates_half_the_square_of_what_a_step_moves():
    """Euler uses the level before a step: a tank of area A with inflow M gains rho g (M h / rho)^2 / (2 A) per step."""
    flow, section, h, steps = 0.02, 1.5, 0.5, 40
    nodes = {"spring": {"type": "inflow", "flow": flow}, "pond": tank(section, 1.0)}
    case = scene(nodes, {"sluice": valve("spring", "pond", 0.05)}, h * steps, {"method": "euler", "step": h})
    found = energy(case)
    made = steps * RHO * GRAVITY * (flow * h) ** 2 / (2 * section)
    assert found.remainder[-1] == pytest.approx(-made, rel=1e-9)
    assert found.step[-1] == pytest.approx(-made, rel=1e-9)
    assert found.verdict == "the numbers create energy"


def pushed(numerics: dict, end: float, more: dict, **mass) -> dict:
    """Case of a mass of 2 kg and a frame, with given links."""
    nodes = {"ground": {"type": "frame"}, "load": {"type": "mass", "mass": 2.0, **mass}}
    return scene(nodes, more, end, numerics)


def test_a_constant_force_on_a_spring_loses_half_its_work_to_the_damper():
    k, push = 800.0, 40.0
    links = {
        "spring": {"type": "spring", "from": "ground", "to": "load", "stiffness": k, "free_length": 0.0},
        "damper": {"type": "damper", "from": "ground", "to": "load", "damping": 20.0},
        "pull": {"type": "force", "to": "load", "force": push},
    }
    found = energy(pushed(TIGHT, 8.0, links))
    assert found.supplied["pull"][-1] == pytest.approx(push**2 / k, rel=1e-8)
    assert found.stored["spring"][-1] == pytest.approx(0.5 * push**2 / k, rel=1e-8)
    assert found.dissipated["damper"][-1] == pytest.approx(0.5 * push**2 / k, rel=1e-8)
    assert found.relative < 1e-9


def test_an_end_stop_takes_what_a_mass_leaves_behind():
    links = {"stop": {"type": "end-stop", "from": "ground", "to": "load", "maximum": 1.0, "stiffness": 1e5,
                      "damping": 100.0}}  # fmt: skip
    found = energy(pushed({"method": "dormand-prince", "rtol": 1e-10}, 2.0, links, initial_velocity=1.0))
    kinetic = 1.0 + found.stored["load"][-1]
    assert 0.1 < kinetic < 0.95
    assert found.dissipated["stop end-stop"][-1] == pytest.approx(1.0 - kinetic, rel=1e-7)
    assert found.at_start["load"] == 1.0


def test_what_runs_over_the_rim_carries_its_height_away():
    flow, rim, end = 0.05, 2.0, 60.0
    nodes = {"spring": {"type": "inflow", "flow": flow, "elevation": 10.0},
             "pond": tank(1.0, 1.5, height=rim, elevation=10.0)}  # fmt: skip
    found = energy(scene(nodes, {"sluice": valve("spring", "pond", 0.05)}, end, TIGHT))
    assert found.datum == 10.0
    assert found.supplied["pond over the rim"][-1] == pytest.approx(-RHO * GRAVITY * rim * (flow * end - 0.5), rel=1e-7)
    assert found.stored["pond"][-1] == pytest.approx(0.5 * RHO * GRAVITY * (rim**2 - 1.5**2), rel=1e-7)
    assert found.relative < 1e-9


def test_a_shaped_tank_stores_the_moment_of_its_areas():
    """Cone with areas from 1 to 3 m2 over 2 m: integral of z A dz from 0.5 m to the final level."""
    shape = {"level": [0.0, 2.0], "area": [1.0, 3.0]}
    nodes = {"spring": {"type": "inflow", "flow": 0.05}, "pond": tank(shape, 0.5)}
    found = energy(scene(nodes, {"sluice": valve("spring", "pond", 0.05)}, 40.0, TIGHT))
    volume = 0.5 + 0.5 * 0.5**2 + 2.0
    top = -1.0 + math.sqrt(1.0 + 2.0 * volume)
    moment = (0.5 * top**2 + top**3 / 3.0) - (0.5 * 0.5**2 + 0.5**3 / 3.0)
    assert found.stored["pond"][-1] == pytest.approx(RHO * GRAVITY * moment, rel=1e-9)


def test_a_leak_planted_in_the_ledger_is_found(monkeypatch):
    """The energy of a valve that is missing in the accounts is the remainder."""
    from fvsolve.model import energy_accounts

    case = slope_scene({"scheme": "upwind5", "method": "rk4", "courant": 0.8})
    honest = energy(case).dissipated["tap"][-1]
    plain = energy_accounts.Accounts.valves

    def forgetful(self):
        plain(self)
        self.accounts = [one for one in self.accounts if one.place != "tap"]

    monkeypatch.setattr(energy_accounts.Accounts, "valves", forgetful)
    found = energy(case)
    assert found.remainder[-1] == pytest.approx(honest, rel=1e-12)
    assert found.verdict != "rounding"


@pytest.mark.parametrize(
    "name, near",
    [("tank-draining", 1e-8), ("two-tanks", 1e-8), ("chamber-and-orifice", 1e-8), ("closed-cylinder", 1e-8),
     ("cylinder-servo", 1e-7), ("valve-closure", 6e-3), ("gradual-closure", 6e-3)],
)  # fmt: skip
def test_the_ledgers_of_shipped_cases_close(name, near):
    """Remainders are within the tolerance of error control, or below 0.6 % where fronts are smeared."""
    from fvsolve.case import shipped

    found = energy(shipped.find(name))
    assert found.ok
    assert found.relative < near
    parts = [*found.scheme.values(), *found.law.values(), found.step, found.newton]
    assert np.sum(parts, axis=0) == pytest.approx(found.remainder, abs=1e-12 * found.throughput)


def test_a_column_that_stops_dead_loses_its_kinetic_energy():
    nodes = {"lake": lake(20.0), "gate": junction(), "out": reservoir(AMBIENT)}
    column = {"type": "rigid-column", "from": "lake", "to": "gate", "length": 100.0, "diameter": 0.3,
              "friction": NO_FRICTION}  # fmt: skip
    links = {"way": column, "tap": valve("gate", "out", 0.01, step(1.0, 1.0, 0.0))}
    found = energy(scene(nodes, links, 2.0, {"method": "dormand-prince", "rtol": 1e-10}))
    q = 0.01 * math.sqrt(2 * GRAVITY * 20.0)
    assert found.dissipated["way stopped dead"][-1] == pytest.approx(0.5 * RHO * q**2 * 100.0 / area(0.3), rel=1e-9)
    assert found.relative < 1e-12


@pytest.mark.parametrize(
    "rim, held", [({}, 0.5 * 3.0**2), ({"height": 4.0}, 0.5 * (3.0**2 - 1.0))], ids=["open", "with a rim"]
)
def test_what_a_tank_below_the_port_could_give_is_what_filling_it_to_the_port_sets_free(rim, held):
    """Bottom at -5 m, level 2 m: integral of the fall 5 m - z of the water that fills the tank to the port or rim."""
    nodes = {"sea": reservoir(AMBIENT, elevation=0.0), "pit": tank(1.5, 2.0, elevation=-5.0, **rim)}
    case = scene(nodes, {"gap": valve("sea", "pit", 0.05)}, 10.0, TIGHT)
    found = energy(case, port="sea")
    assert found.at_start["pit"] == pytest.approx(RHO * GRAVITY * 1.5 * held, rel=1e-9)
    assert found.port.work == pytest.approx(0.0, abs=1e-9)
    assert found.port.passive


@pytest.mark.parametrize(
    "name, law", [("valve-closure", "linear"), ("valve-closure", "log"), ("three-way-junction", "linear"),
                  ("rigid-column", "log"), ("cylinder-servo", "log"), ("two-tanks", "linear")],
)  # fmt: skip
def test_no_part_ever_holds_less_than_nothing(name, law):
    """For each part, available energy at the start plus stored energy since then is not negative."""
    from fvsolve.case import shipped

    found = energy(shipped.find(name), {"fluid.law": law})
    for part, change in found.stored.items():
        assert np.min(found.at_start[part] + change) >= -1e-6 * found.throughput, part


def test_a_port_that_is_none_is_named():
    case = scene({"pump": reservoir(5e6), "pot": chamber(0.5, 1e6)}, {"hole": valve("pump", "pot", 1e-6)}, 1.0, TIGHT)
    with pytest.raises(FvsolveError, match='did you mean "pump"'):
        energy(case, port="pumpp")
    with pytest.raises(FvsolveError, match="Expected a reservoir"):
        energy(case, port="pot")
