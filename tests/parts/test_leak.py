"""Leaks against closed forms: drainage by any power of the pressure, no reverse flow, at pipes and in networks."""

import math

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, junction, lake, pipe, reservoir, scene, tank, valve
from scipy.optimize import brentq

import fvsolve
from fvsolve.parts.outlet.law_outlet import FREE, LEAST_DROP, emitter_drop, emitter_flow, emitter_slope, emitter_step
from fvsolve.studies.energy.energy_balance import energy

TIGHT = {"method": "dormand-prince", "rtol": 1e-11}


def leak(start: str, coefficient: float, exponent: float = 0.5, **more) -> dict:
    return {"type": "leak", "from": start, "coefficient": coefficient, "exponent": exponent, **more}


@pytest.mark.parametrize("n", [0.5, 1.0, 1.5])
def test_a_tank_drains_by_the_power_of_its_level(n):
    """A dz/dt = -C (rho g z)^n: z^(1 - n) falls linearly, and for n = 1 z falls exponentially."""
    section, level, end = 2.0, 3.0, 60.0
    c = 0.02 / (RHO * GRAVITY * level) ** n
    nodes = {"t": tank(section, level)}
    result = fvsolve.run(scene(nodes, {"hole": leak("t", c, n)}, end, TIGHT, ["t.level", "hole.flow"], 1.0))
    k, t = c * (RHO * GRAVITY) ** n / section, np.asarray(result.t)
    exact = level * np.exp(-k * t) if n == 1.0 else (level ** (1 - n) - (1 - n) * k * t) ** (1 / (1 - n))
    assert result["t.level"] == pytest.approx(exact, rel=1e-9)
    assert result["hole.flow"] == pytest.approx(c * (RHO * GRAVITY * exact) ** n, rel=1e-8)
    assert abs(result.ledger["mass"]["relative"]) < 1e-13


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_steady_state_in_a_line_is_that_of_both_laws(law):
    """The flow of a valve into a dead end equals the leakage there, with the elevation of the place."""
    nodes = {"lake": lake(60.0), "a": junction(elevation=10.0), "b": junction(elevation=12.0)}
    nodes["lake"]["elevation"] = 10.0
    links = {"gap": valve("lake", "a", 1e-3), "line": pipe("a", "b", 100.0, 0.1, 1000.0, 10), "hole": leak("b", 2e-6)}
    case = scene(nodes, links, 0.5, {"scheme": "muscl"}, ["hole.flow", "gap.flow"], fluid=WATER | {"law": law})
    model = fvsolve.build(fvsolve.load(case))
    assert not model.rhs(0.0, np.zeros(model.y_size)).any()

    def drop(q):
        return RHO * GRAVITY * (60.0 - 12.0) - RHO * (q / 1e-3) ** 2 / 2 - (q / 2e-6) ** 2

    q = brentq(drop, 0.0, 1.0, xtol=1e-16)
    assert model.observe(0.0, np.zeros(model.y_size)) == pytest.approx([q, q], rel=1e-8 if law == "linear" else 1e-3)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_nothing_comes_back_through_a_leak(law):
    """Leakage is exactly zero below ambient pressure and follows its law above; the mass balance closes."""
    fall = {"time": [0.0, 1.0, 2.0, 3.0], "value": [2e5, 0.5e5, 0.5e5, 2e5]}
    nodes = {"lake": reservoir(fall), "b": junction()}
    links = {"line": pipe("lake", "b", 10.0, 0.1, 1000.0, 10), "hole": leak("b", 1e-6)}
    probes = ["hole.flow", "b.pressure"]
    result = fvsolve.run(scene(nodes, links, 4.0, {}, probes, 0.01, fluid=WATER | {"law": law}))
    flow, gauge = result["hole.flow"], result["b.pressure"] - AMBIENT
    below, above = gauge <= 0.0, gauge > LEAST_DROP
    assert below.sum() > 50 and (flow[below] == 0.0).all()
    assert flow[above] == pytest.approx(1e-6 * np.sqrt(gauge[above]), rel=1e-6)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("n", [0.3, 0.5, 1.0, 1.8, 2.5])
def test_its_slope_is_bounded_without_a_jump_and_that_of_its_flow(n):
    law = np.array([n, 0.0, 1e5, np.inf])
    drops = np.concatenate([np.linspace(-5.0, 3 * LEAST_DROP, 1001), np.geomspace(50.0, 1e6, 50)])
    slope = np.array([emitter_slope(law, 0, 1e-4, d, FREE) for d in drops])
    ends = ((d - 1e-4, d + 1e-4) for d in drops)
    rise = [(emitter_flow(law, 0, 1e-4, b, FREE) - emitter_flow(law, 0, 1e-4, a, FREE)) / 2e-4 for a, b in ends]
    assert slope == pytest.approx(rise, rel=1e-4, abs=1e-3 * slope.max())
    assert (slope >= 0.0).all() and slope[drops <= 0.0].max() == 0.0
    assert np.abs(np.diff(slope[:1001])).max() < 0.02 * slope.max()


@pytest.mark.parametrize("n", [0.3, 0.5, 1.0, 1.18, 2.0, 3.0])
def test_newton_finds_its_balance_with_a_line_from_anywhere(n):
    """Newton's method finds the known root of c - Y p = M(p) from any start, and `emitter_drop` inverts the flow."""
    law, rng = np.array([n, 0.0, 1e5, 1e300]), np.random.default_rng(0)
    for _ in range(300):
        g, y, root = 10.0 ** rng.uniform(-9, -2), 10.0 ** rng.uniform(-7, -2), rng.choice([-3.0, 0.5, 7.0, 12.0, 4e4])
        c = y * root + emitter_flow(law, 0, g, root, FREE)
        p, m, moved = rng.choice([-500.0, 3.0, 300.0, 1e6]), rng.choice([0.0, 1e-4, 1.0]), np.inf
        for _ in range(60):
            a, s = emitter_step(law, 0, g, m, p, FREE)
            dp = (c - y * p - m - a) / (y + s)
            p, m, moved = p + dp, m + a + s * dp, abs(dp)
            if moved <= 1e-13 * (1e5 + abs(p)):
                break
        assert p == pytest.approx(root, rel=1e-9, abs=1e-7)
        if root > 0.0:
            assert emitter_drop(law, 0, g, emitter_flow(law, 0, g, root, FREE), FREE) == pytest.approx(root, rel=1e-9)


def test_a_line_sucks_at_a_leak_and_the_run_goes_on():
    """A sudden closure takes the pressure below ambient and back; leakage follows its law, or is zero."""
    shut = {"time": [0.0, 0.5], "value": [1.0, 0.0], "kind": "step"}
    nodes = {"lake": reservoir(6e5), "gate": junction(), "low": reservoir(AMBIENT)}
    links = {"line": pipe("lake", "gate", 600.0, 0.1, 1000.0, 60), "hole": leak("gate", 6e-6)}
    for share in (1.0, 1.5, 2.0):
        links["shut"] = valve("gate", "low", 6e-4 * share, shut)
        result = fvsolve.run(scene(nodes, links, 6.0, {}, ["hole.flow", "gate.pressure"]))
        drop = result["gate.pressure"] - AMBIENT
        wide, asked = np.abs(drop) > LEAST_DROP, 6e-6 * np.sqrt(np.maximum(drop, 0.0))
        assert result.reason == "finished"
        assert np.any(drop < 0.0)
        assert result["hole.flow"][wide] == pytest.approx(asked[wide], rel=1e-6, abs=1e-12)
        assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_two_leaks_on_one_junction_share_what_a_valve_brings():
    """Pressure of a junction at which only a valve and two leaks balance."""
    nodes = {"lake": reservoir(AMBIENT + 4e5), "a": junction()}
    links = {"gap": valve("lake", "a", 1e-4), "one": leak("a", 1e-6), "two": leak("a", 1e-9, 1.2)}
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {"step": 0.1}, ["a.pressure", "gap.flow"])))

    def short(p):
        return 1e-4 * math.sqrt(2 * (4e5 - p) / RHO) - 1e-6 * math.sqrt(p) - 1e-9 * p**1.2

    p = brentq(short, 1.0, 4e5, xtol=1e-9)
    assert model.observe(0.0, np.zeros(0))[0] - AMBIENT == pytest.approx(p, rel=1e-9)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_what_leaks_is_dissipated_and_the_ledger_closes(law):
    nodes = {"t": tank(0.5, 4.0), "g": junction()}
    links = {"line": pipe("t", "g", 10.0, 0.05, 1000.0, 10), "hole": leak("g", 1e-6)}
    one = energy(scene(nodes, links, 0.3, {"method": "rk4", "scheme": "upwind5"}, fluid=WATER | {"law": law}))
    assert set(one.dissipated) >= {"hole"} and one.dissipated["hole"][-1] > 0.0 and not one.supplied
    assert one.relative < 1e-6


@pytest.mark.parametrize(
    "wrong, said",
    [
        ({"coefficient": -1e-6}, "out of range; expected a value above 0"),
        ({"exponent": -0.5}, "out of range"),
        ({"from": "nowhere"}, 'no place named "nowhere"'),
        ({"to": "t"}, "unknown key"),
        ({"from": "lake"}, "lake is a reservoir"),
    ],
)
def test_what_is_wrong_with_a_leak_is_said(wrong, said):
    nodes = {"t": tank(0.5, 4.0), "lake": reservoir(2e5)}
    links = {"gap": valve("lake", "t", 1e-3), "hole": leak("t", 1e-6) | wrong}
    assert said in str(refused(scene(nodes, links, 1.0, {})))


@pytest.mark.parametrize("stated", [{}, {"position": [0.0, 0.0]}])
def test_a_leak_is_drawn_where_it_drains(stated, tmp_path):
    """Fields are written although no other part names the outlet of the leak."""
    nodes = {"a": lake(40.0, **stated), "j": junction(**stated)}
    links = {"main": pipe("a", "j", 100.0, 0.1, 1000.0, 5), "hole": leak("j", 1e-6)}
    result = fvsolve.run(scene(nodes, links, 0.5, {}, ["hole.flow"], 0.1, output={"every": 0.1, "fields": 2}),
                         out=tmp_path / "run")  # fmt: skip
    assert result.ok and (tmp_path / "run" / "fields.pvd").is_file()
