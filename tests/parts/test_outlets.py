"""Leaks and pressure-dependent demands that open and close: the outflow of the mass balance is the integral of the law.

The reference is the law, integrated by SciPy.

Leaks: drainage by any power of the pressure, no reverse flow. Rupture discs: time of bursting and outflow, balances.
"""

import functools
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    WATER,
    area,
    chamber,
    inflow,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    tank,
    valve,
)
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.parts.outlet.law_outlet import (
    FREE,
    LEAST_DROP,
    emitter_drop,
    emitter_flow,
    emitter_slope,
    emitter_step,
)
from fvsolve.studies import sweep
from fvsolve.studies.energy_balance import energy

ADAPTIVE = (
    "auto",
    "rodas-5p",
    "rodas-4",
    "radau-iia-5",
    "esdirk-4",
    "tr-bdf2",
    "dormand-prince",
    "bogacki-shampine",
)
FIXED = ("rk4", "implicit-euler", "trapezoid", "implicit-midpoint")
FOOT = 10.0  # the law is a power above this drop and a cubic polynomial below [Pa]
GAP = 0.01  # Cd A of the valve before a demand [m2]
NEED = {
    "minimum_pressure": AMBIENT + 2e4,
    "required_pressure": AMBIENT + 4e4,
    "demand_exponent": 0.5,
}


def power(x: float, n: float, span: float) -> float:
    """(x / span)^n, with a cubic polynomial below FOOT."""
    if x >= FOOT:
        return (x / span) ** n
    s = max(x, 0.0) / FOOT
    return (FOOT / span) ** n * s * s * ((3 - n) + (n - 2) * s)


def behind(gauge: float, law, least: float) -> float:
    """Flow [m3/s] from a place at `gauge` [Pa] through a valve to an outlet that opens at `least` [Pa]."""
    if gauge <= least:
        return 0.0
    p = brentq(
        lambda p: GAP * np.sqrt(2 * (gauge - p) / RHO) - law(p),
        least,
        gauge,
        xtol=1e-13,
        rtol=1e-15,
    )
    return law(p)


def leaks(gauge: float, coefficient: float = 1e-4) -> float:
    """Flow of the leak [m3/s]."""
    return coefficient * power(gauge, 0.5, 1.0)


def takes(gauge: float) -> float:
    """Flow of the demand [m3/s]."""
    return 0.02 * min(1.0, power(gauge - 2e4, 0.5, 2e4))


def demands(gauge: float) -> float:
    return behind(gauge, takes, 2e4)


LAWS = {"leak": leaks, "demand": demands}
TURNS = [0.0, 6.0, 14.0, 25.0, 40.0]
FILLS = [0.03, -0.02, 0.025, -0.015]  # [m3/s]
OUTSIDE = {"leak": "way", "demand": "town.demand"}
SOFT = WATER | {"bulk_modulus": 3e5}


@functools.cache
def left(outlet: str) -> float:
    """Outflow [kg] of a soft chamber of 1 m3 with the inflow FILLS: dp/dt = K / V (inflow - outflow)."""
    law, y = LAWS[outlet], [5e4, 0.0]
    for start, end, fill in zip(TURNS, TURNS[1:], FILLS, strict=False):
        found = solve_ivp(
            lambda t, y, fill=fill: [3e5 * (fill - law(y[0])), law(y[0])],
            (start, end),
            y,
            "DOP853",
            rtol=1e-11,
            atol=1e-10,
        )
        y = found.y[:, -1]
    return RHO * float(y[1])


def ball(outlet: str, numerics: dict, law: str = "linear") -> dict:
    """Return a case of the chamber of `left`."""
    nodes = {
        "mouth": inflow({"time": TURNS[:-1], "value": FILLS, "kind": "step"}),
        "ball": chamber(1.0, AMBIENT + 5e4),
        "town": junction(0.02, **NEED),
    }
    links = {"in": valve("mouth", "ball", 0.05), "way": valve("ball", "town", GAP)}
    if outlet == "leak":
        del nodes["town"], links["way"]
        links["way"] = {"type": "leak", "from": "ball", "coefficient": 1e-4}
    return scene(nodes, links, 40.0, numerics, ["way.flow"], 0.002, fluid=SOFT | {"law": law})


PAIRS = [
    (outlet, method)
    for outlet in LAWS
    for method in (*ADAPTIVE, *FIXED)
    if outlet == "leak"
    or method not in ("dormand-prince", "bogacki-shampine")  # limited by the node behind the valve
]


@pytest.mark.parametrize("outlet, method", PAIRS)
def test_an_outlet_at_a_compliant_node_lets_nothing_in_and_discharges_by_its_law(outlet, method):
    numerics = {"method": method, "step": 0.005} if method in FIXED else {"method": method}
    result = fvsolve.run(ball(outlet, numerics))
    way = result.ledger["mass"]["nodes"][f"{OUTSIDE[outlet]}.outside"]
    near = 1e-4 if method == "implicit-euler" else 3e-5  # accuracy of the pressure
    assert way["outflow"] == pytest.approx(left(outlet), rel=near)
    assert way.get("inflow", 0.0) == 0.0
    # bound of Rosenbrock methods, with slopes by differences
    assert abs(result.ledger["mass"]["relative"]) < 1e-10


@pytest.mark.in_turn
@pytest.mark.parametrize("method", ["auto", "radau-iia-5", "rodas-4", "rk4"])
@pytest.mark.parametrize("outlet", LAWS)
def test_the_same_holds_with_a_fluid_of_variable_density(outlet, method):
    numerics = {"method": method, "step": 0.005} if method in FIXED else {"method": method}
    result = fvsolve.run(ball(outlet, numerics, "log"))
    way = result.ledger["mass"]["nodes"][f"{OUTSIDE[outlet]}.outside"]
    assert way["inflow"] == 0.0 and result["way.flow"].min() >= 0.0
    assert abs(result.ledger["mass"]["relative"]) < 1e-10


@pytest.mark.parametrize("method", ["auto", "rodas-4", "radau-iia-5", "dormand-prince"])
def test_its_energy_ledger_closes_over_steps_that_end_at_a_bend(method):
    relative = energy(ball("leak", {"method": method})).relative
    assert relative < 1e-5


# of a source: times [s], gauge pressures [Pa]
SWINGS = [0.0, 10.0, 20.0, 30.0], [1e5, -0.5e5, 0.7e5, -0.2e5]
TINY = 1e-6
STATELESS = {
    "leak": (lambda gauge: leaks(gauge, TINY), 0.0, (0.0, FOOT)),
    "demand": (takes, 2e4, (2e4, 2e4 + FOOT, 4e4)),
}


@functools.cache
def passed(outlet: str) -> float:
    """Outflow [kg] behind a valve from a source of varying pressure, integrated between the kinks of the law."""
    law, least, bends = STATELESS[outlet]
    edges = [p + RHO / 2 * (law(p) / GAP) ** 2 for p in bends]
    total = 0.0
    for a, b, p, r in zip(*(part for row in SWINGS for part in (row, row[1:])), strict=False):
        met = [
            a + (b - a) * (edge - p) / (r - p) for edge in edges if (edge - p) * (edge - r) < 0.0
        ]
        for start, end in itertools.pairwise(sorted([a, *met, b])):
            total += quad(
                lambda t, a=a, b=b, p=p, r=r: behind(p + (r - p) * (t - a) / (b - a), law, least),
                start,
                end,
                epsabs=1e-12,
                epsrel=1e-11,
                limit=200,
            )[0]
    return RHO * total


@pytest.mark.parametrize("method", [*ADAPTIVE, *FIXED])
@pytest.mark.parametrize("outlet", LAWS)
def test_outflow_without_a_state_follows_its_law(outlet, method):
    nodes = {
        "lake": reservoir({"time": SWINGS[0], "value": [AMBIENT + p for p in SWINGS[1]]}),
        "town": junction(0.02, **NEED),
    }
    links = {"in": valve("lake", "town", GAP)}
    if outlet == "leak":
        nodes["town"] = junction()
        links |= {"hole": {"type": "leak", "from": "town", "coefficient": TINY}}
    numerics = {"method": method, "step": 0.005} if method in FIXED else {"method": method}
    result = fvsolve.run(scene(nodes, links, 30.0, numerics, ["in.flow"], 1.0))
    way = result.ledger["mass"]["nodes"][
        "hole.outside" if outlet == "leak" else "town.demand.outside"
    ]
    near = 3e-4 if method == "implicit-euler" else 1e-5 if method in (*FIXED, "tr-bdf2") else 2e-6
    assert way["outflow"] == pytest.approx(passed(outlet), rel=near) and way["inflow"] == 0.0
    assert result.ledger["mass"]["nodes"]["lake"].get("outflow", 0.0) == 0.0


TIGHT = {"method": "dormand-prince", "rtol": 1e-11}


def leak(start: str, coefficient: float, exponent: float = 0.5, **more) -> dict:
    return {"type": "leak", "from": start, "coefficient": coefficient, "exponent": exponent, **more}


@pytest.mark.parametrize("n", [0.5, 1.0, 1.5])
def test_a_tank_drains_by_the_power_of_its_level(n):
    """A dz/dt = -C (rho g z)^n: z^(1 - n) falls linearly, and for n = 1 z falls exponentially."""
    section, level, end = 2.0, 3.0, 60.0
    c = 0.02 / (RHO * GRAVITY * level) ** n
    nodes = {"t": tank(section, level)}
    result = fvsolve.run(
        scene(nodes, {"hole": leak("t", c, n)}, end, TIGHT, ["t.level", "hole.flow"], 1.0)
    )
    k, t = c * (RHO * GRAVITY) ** n / section, np.asarray(result.t)
    exact = (
        level * np.exp(-k * t)
        if n == 1.0
        else (level ** (1 - n) - (1 - n) * k * t) ** (1 / (1 - n))
    )
    assert result["t.level"] == pytest.approx(exact, rel=1e-9)
    assert result["hole.flow"] == pytest.approx(c * (RHO * GRAVITY * exact) ** n, rel=1e-8)
    assert abs(result.ledger["mass"]["relative"]) < 1e-13


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_steady_state_in_a_line_is_that_of_both_laws(law):
    """The flow of a valve into a dead end equals the leakage there, with the elevation of the place."""
    nodes = {"lake": lake(60.0), "a": junction(elevation=10.0), "b": junction(elevation=12.0)}
    nodes["lake"]["elevation"] = 10.0
    links = {
        "gap": valve("lake", "a", 1e-3),
        "line": pipe("a", "b", 100.0, 0.1, 1000.0, 10),
        "hole": leak("b", 2e-6),
    }
    case = scene(
        nodes,
        links,
        0.5,
        {"scheme": "muscl"},
        ["hole.flow", "gap.flow"],
        fluid=WATER | {"law": law},
    )
    model = fvsolve.build(fvsolve.load(case))
    assert not model.rhs(0.0, np.zeros(model.y_size)).any()

    def drop(q):
        return RHO * GRAVITY * (60.0 - 12.0) - RHO * (q / 1e-3) ** 2 / 2 - (q / 2e-6) ** 2

    q = brentq(drop, 0.0, 1.0, xtol=1e-16)
    assert model.observe(0.0, np.zeros(model.y_size)) == pytest.approx(
        [q, q], rel=1e-8 if law == "linear" else 1e-3
    )


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
    rise = [
        (emitter_flow(law, 0, 1e-4, b, FREE) - emitter_flow(law, 0, 1e-4, a, FREE)) / 2e-4
        for a, b in ends
    ]
    assert slope == pytest.approx(rise, rel=1e-4, abs=1e-3 * slope.max())
    assert (slope >= 0.0).all() and slope[drops <= 0.0].max() == 0.0
    assert np.abs(np.diff(slope[:1001])).max() < 0.02 * slope.max()


@pytest.mark.parametrize("n", [0.3, 0.5, 1.0, 1.18, 2.0, 3.0])
def test_newton_finds_its_balance_with_a_line_from_anywhere(n):
    """Newton's method finds the known root of c - Y p = M(p) from any start, and `emitter_drop` inverts the flow."""
    law, rng = np.array([n, 0.0, 1e5, 1e300]), np.random.default_rng(0)
    for _ in range(300):
        g, y, root = (
            10.0 ** rng.uniform(-9, -2),
            10.0 ** rng.uniform(-7, -2),
            rng.choice([-3.0, 0.5, 7.0, 12.0, 4e4]),
        )
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
            assert emitter_drop(
                law, 0, g, emitter_flow(law, 0, g, root, FREE), FREE
            ) == pytest.approx(root, rel=1e-9)


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


def test_two_leaks_on_a_junction_share_the_flow_of_a_valve():
    """Pressure of a junction at which only a valve and two leaks balance."""
    nodes = {"lake": reservoir(AMBIENT + 4e5), "a": junction()}
    links = {"gap": valve("lake", "a", 1e-4), "one": leak("a", 1e-6), "two": leak("a", 1e-9, 1.2)}
    model = fvsolve.build(
        fvsolve.load(scene(nodes, links, 1.0, {"step": 0.1}, ["a.pressure", "gap.flow"]))
    )

    def short(p):
        return 1e-4 * math.sqrt(2 * (4e5 - p) / RHO) - 1e-6 * math.sqrt(p) - 1e-9 * p**1.2

    p = brentq(short, 1.0, 4e5, xtol=1e-9)
    assert model.observe(0.0, np.zeros(0))[0] - AMBIENT == pytest.approx(p, rel=1e-9)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_leakage_is_dissipated_and_the_ledger_closes(law):
    nodes = {"t": tank(0.5, 4.0), "g": junction()}
    links = {"line": pipe("t", "g", 10.0, 0.05, 1000.0, 10), "hole": leak("g", 1e-6)}
    one = energy(
        scene(nodes, links, 0.3, {"method": "rk4", "scheme": "upwind5"}, fluid=WATER | {"law": law})
    )
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
def test_faults_of_a_leak_are_reported(wrong, said):
    nodes = {"t": tank(0.5, 4.0), "lake": reservoir(2e5)}
    links = {"gap": valve("lake", "t", 1e-3), "hole": leak("t", 1e-6) | wrong}
    assert said in str(refused(scene(nodes, links, 1.0, {})))


@pytest.mark.parametrize("stated", [{}, {"position": [0.0, 0.0]}])
def test_a_leak_is_drawn_where_it_drains(stated, tmp_path):
    """Fields are written although no other part names the outlet of the leak."""
    nodes = {"a": lake(40.0, **stated), "j": junction(**stated)}
    links = {"main": pipe("a", "j", 100.0, 0.1, 1000.0, 5), "hole": leak("j", 1e-6)}
    result = fvsolve.run(
        scene(nodes, links, 0.5, {}, ["hole.flow"], 0.1, output={"every": 0.1, "fields": 2}),
        out=tmp_path / "run",
    )
    assert result.ok and (tmp_path / "run" / "fields.pvd").is_file()


CDA, BURST, SECTION, FILL = 2e-3, 3.5e4, 0.5, 0.05


def disc(start: str, burst: float = BURST, **more) -> dict:
    return {
        "type": "rupture-disc",
        "from": start,
        "area": CDA,
        "discharge_coefficient": 1.0,
        "burst_pressure": burst,
        **more,
    }


def filled(numerics: dict, law: str = "linear", **more) -> dict:
    """Return a case of a tank with a rupture disc, which a constant inflow fills from 3 m."""
    nodes = {"in": {"type": "inflow", "flow": FILL}, "t": tank(SECTION, 3.0)}
    links = {"throat": valve("in", "t", 0.05), "disc": disc("t", **more)}
    if "to" in more:
        nodes[more["to"]] = reservoir(AMBIENT)
    return scene(
        nodes,
        links,
        20.0,
        numerics,
        ["t.level", "disc.flow", "disc.opening"],
        0.5,
        fluid=WATER | {"law": law},
    )


def emptied(level: float) -> float:
    """Time since the burst [s]: A dz/dt = Q - c sqrt(z), so with s = sqrt(z), dt = 2 A s ds / (Q - c s)."""
    c = CDA * math.sqrt(2.0 * GRAVITY)

    def past(s):
        return -2.0 * SECTION / c * (s + FILL / c * math.log(abs(FILL - c * s)))

    return past(math.sqrt(level)) - past(math.sqrt(BURST / (RHO * GRAVITY)))


METHODS = [
    {"method": "dormand-prince", "rtol": 1e-10},
    {"method": "radau-iia-5", "rtol": 1e-10},
    {"method": "rodas-5p", "rtol": 1e-9},
    {"method": "rk4", "step": 0.1},
]


@pytest.mark.in_turn
@pytest.mark.parametrize("more", [{}, {"to": "sump"}], ids=["ambient", "place"])
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("numerics", METHODS, ids=lambda one: one["method"])
def test_it_bursts_at_the_computed_level_and_discharges_by_the_square_root(numerics, law, more):
    result = fvsolve.run(filled(numerics, law, **more))
    ((event),) = result.summary["events"]
    when = SECTION / FILL * (BURST / (RHO * GRAVITY) - 3.0)
    assert (event["name"], event["what"]) == ("disc", "bursts")
    assert event["time"] == pytest.approx(when, rel=1e-12 if law == "linear" else 1e-4)
    t, level, flow = np.asarray(result.t), result["t.level"], result["disc.flow"]
    before, after = t < event["time"], t > event["time"]
    assert not flow[before].any() and np.array_equal(result["disc.opening"], after.astype(float))
    assert flow[after] == pytest.approx(
        CDA * np.sqrt(2.0 * GRAVITY * level[after]), rel=1e-9 if law == "linear" else 1e-4
    )
    past = [when + emptied(z) for z in level[after]]
    assert t[after] == pytest.approx(past, rel=2e-7 if law == "linear" else 1e-3)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "mixture"])
@pytest.mark.parametrize("turned", [False, True], ids=["along", "against"])
def test_a_wave_bursts_it_on_arrival_and_the_line_supplies_by_its_impedance(law, turned):
    """The jump rho a v arrives after L / a; then p = 5e5 + rho a v - Z q / 2 = ambient + rho / 2 (q / CdA)^2."""
    v, speed, bore = 1.0, 1000.0, 0.2
    ends = ("gate", "far") if turned else ("far", "gate")
    nodes = {
        "lake": reservoir(5e5),
        "far": junction(),
        "gate": junction({"time": [0.0, 0.1], "value": [v * area(bore), 0.0], "kind": "step"}),
    }
    links = {
        "up": pipe("lake", "far", 1000.0, bore, speed, 200),
        "main": pipe(*ends, 100.0, bore, speed, 20),
        "disc": disc("far", 8e5),
    }
    fluid = WATER | {"law": law} | ({"air_fraction": 0.0} if law == "mixture" else {})
    result = fvsolve.run(
        scene(
            nodes,
            links,
            0.4,
            {"scheme": "upwind", "method": "euler", "courant": 1.0},
            ["far.pressure", "disc.flow"],
            0.01,
            fluid=fluid,
        )
    )
    (event,) = result.summary["events"]
    assert event["time"] == pytest.approx(0.2, abs=6e-3)
    jump, z = RHO * speed * v, RHO * speed / area(bore)
    # pipes on both sides: p = 5e5 + jump - Z q / 2
    k, head = RHO / (2.0 * CDA**2), 5e5 + jump - AMBIENT
    q = (-0.5 * z + math.sqrt(0.25 * z**2 + 4.0 * k * head)) / (2.0 * k)
    near = 1e-9 if law == "linear" else 0.03
    after = (np.asarray(result.t) > 0.22) & (np.asarray(result.t) < 0.36)
    assert result["disc.flow"][after] == pytest.approx(q, rel=near)
    assert result["far.pressure"][after] == pytest.approx(AMBIENT + k * q**2, rel=near)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


def test_nothing_comes_back_from_ambient_and_its_energy_closes():
    """The pressure of a lake bursts the disc and then falls below ambient."""
    nodes = {
        "lake": reservoir({"time": [0.0, 1.0, 3.0, 4.0], "value": [1.2e5, 2e5, 0.6e5, 1.5e5]}),
        "b": junction(),
    }
    links = {"line": pipe("lake", "b", 10.0, 0.1, 1000.0, 10), "disc": disc("b", 5e4)}
    case = scene(
        nodes, links, 4.0, {"method": "dormand-prince", "rtol": 1e-7}, ["disc.flow", "b.pressure"]
    )
    result = fvsolve.run(case)
    flow, gauge = result["disc.flow"], result["b.pressure"] - AMBIENT
    assert [event["what"] for event in result.summary["events"]] == ["bursts"]
    assert (gauge < -1e3).any() and not flow[gauge < 0.0].any() and flow[-1] > 0.0
    found = energy(case)
    scheme = sum(taken[-1] for taken in found.scheme.values())
    assert abs(found.numerical_remainder[-1] - scheme) < 1e-8 * found.throughput
    assert (np.diff(found.dissipated["disc rupture disc"]) >= 0.0).all()


@pytest.mark.parametrize("end", [4.0, 8.0], ids=["whole", "burst"])
def test_resumed_before_and_after_it_burst_it_is_the_unbroken_run(tmp_path, end):
    case = filled({"method": "rk4", "step": 0.1})
    fvsolve.run(case, set={"numerics.end": end}, out=tmp_path / "run", pictures=False)
    result = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    whole = fvsolve.run(case)
    assert (
        np.array_equal(result["t.level"], whole["t.level"])
        and result.summary["events"] == whole.summary["events"]
    )


def test_placed_by_chainage_it_stands_off_the_pipe():
    nodes, links = (
        {"a": reservoir(2e5), "b": junction()},
        {"main": pipe("a", "b", 100.0, 0.2, 1000.0, 10)},
    )
    links["disc"] = {key: value for key, value in disc("", 2e5).items() if key != "from"} | {
        "on": "main",
        "at": 50.0,
    }
    model = fvsolve.build(fvsolve.load(scene(nodes, links, 0.1, {"scheme": "upwind"})))
    assert (
        model.valve_names == ["disc"]
        and "disc.outside" in model.node_names
        and len(model.tables.pipes) == 2
    )


@pytest.mark.parametrize(
    "wrong, said",
    [({"burst_pressure": -1.0}, "out of range"), ({"burst_pressure": 2e4}, "would burst the disc; raise `burst_"),
     ({"from": "nowhere"}, "nowhere"), ({"area": None}, "needs area or diameter")],
)  # fmt: skip
def test_faults_of_a_disc_are_reported(wrong, said):
    case = filled({"rtol": 1e-6})
    given = case["links"]["disc"] | wrong
    case["links"]["disc"] = {key: value for key, value in given.items() if value is not None}
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert said in str(error.value)


# hydrants -----------------------------------------------------------------------------------------------------------

QUASI = {"numerics.pipe_model": "quasi-steady", "numerics.end": 1.0}


def street(**keys):
    """Scene of a hydrant at the end of a quasi-steady pipe from a lake at 50 m, with a demand of 5 l/s there."""
    nodes = {"lake": lake(50.0, elevation=40.0), "end": junction(5e-3, elevation=10.0)}
    main = {
        "type": "pipe",
        "from": "lake",
        "to": "end",
        "length": 800.0,
        "diameter": 0.15,
        "friction": {"model": "steady", "factor": 0.02},
        "pipe_model": "quasi-steady",
    }
    fire = {"type": "hydrant", "from": "end", **keys}
    return scene(
        nodes,
        {"main": main, "fire": fire},
        1.0,
        {"rtol": 1e-9},
        ["fire.flow", "fire.gauge_pressure"],
        0.5,
    )


def gauge_with(flow: float) -> float:
    """Gauge pressure [Pa] at the end of `street` with a flow of the hydrant [m3/s]."""
    velocity = (flow + 5e-3) / area(0.15)
    return RHO * GRAVITY * 40.0 - 0.02 * 800.0 / 0.15 * RHO * velocity**2 / 2.0


def test_a_hydrant_draws_its_flow_or_the_flow_at_its_residual_pressure():
    run = fvsolve.run(street(flow=0.02, residual_pressure=AMBIENT + 1.4e5))
    assert run["fire.flow"] == pytest.approx(0.02, rel=1e-12)
    assert run["fire.gauge_pressure"] == pytest.approx(gauge_with(0.02), rel=1e-9)
    for least in (1.4e5, 0.0):
        run = fvsolve.run(street(flow=0.5, residual_pressure=AMBIENT + least))
        q = brentq(
            lambda q, least=least: gauge_with(q) - least - 100.0 * (q / 0.5) ** 2,
            0.0,
            0.1,
            xtol=1e-15,
        )
        assert run["fire.flow"] == pytest.approx(q, rel=1e-4)  # a cubic below 10 Pa
        assert least < run["fire.gauge_pressure"][-1] < least + 100.0
    # above that without the hydrant
    run = fvsolve.run(street(flow=0.02, residual_pressure=AMBIENT + 5e5))
    assert run["fire.flow"] == pytest.approx(0.0, abs=1e-12)
    assert run["fire.gauge_pressure"] == pytest.approx(gauge_with(0.0), rel=1e-9)


def test_a_residual_pressure_below_ambient_is_a_fault():
    text = refused(street(flow=0.02, residual_pressure=0.9 * AMBIENT))
    assert (
        "links.fire.residual_pressure: 91192.5 Pa is below ambient pressure, at which nothing can flow out"
        in str(text)
    )


def test_a_name_of_digits_is_a_name_where_it_replaces_a_name():
    case = street(flow=0.02)
    case["nodes"] = {name.replace("end", "22"): node for name, node in case["nodes"].items()} | {
        "31": junction(elevation=20.0)
    }
    case["links"]["main"]["to"] = case["links"]["fire"]["from"] = "22"
    case["links"]["rest"] = {**case["links"]["main"], "from": "22", "to": "31", "length": 31.0}
    rows = sweep(case, {"links.fire.from": [22, "31"]}, {"links.rest.length": 22}).rows
    assert [row["ok"] for row in rows] == [True, True]
    assert fvsolve.load(case, {"links.fire.from": "31"}).links["fire"].from_ == "31"
    assert fvsolve.load(case, {"links.rest.length": "22"}).links["rest"].length == 22.0


def epanet_heads(path, folder, node, flow):
    """Head [m] at a node of an EPANET network at hour 0 with a flow [m3/s] drawn there in addition."""
    toolkit = pytest.importorskip("wntr.epanet.toolkit")
    gallons, foot = flow / 6.30901964e-5, 0.3048
    epanet = toolkit.ENepanet()
    epanet.ENopen(str(path), str(folder / "net.rpt"), str(folder / "net.bin"))
    index = epanet.ENgetnodeindex(node)
    epanet.ENsetnodevalue(index, 1, epanet.ENgetnodevalue(index, 1) + gallons)
    epanet.ENopenH()
    epanet.ENinitH(0)
    epanet.ENrunH()
    head = epanet.ENgetnodevalue(index, 10) * foot
    epanet.ENcloseH()
    epanet.ENclose()
    return head


def test_fire_flows_of_net1_are_those_of_epanet(tmp_path):
    """Residual heads with 50 l/s within 1 mm, and flows that leave 14 m within 0.01 %, for five nodes."""
    wntr = pytest.importorskip("wntr", reason="WNTR, the extra `epanet`, is not installed")
    from fvsolve.exchange.epanet import import_network

    source = Path(wntr.__file__).parent / "library" / "networks" / "Net1.inp"
    text = (
        source.read_text()
        .replace("[OPTIONS]", "[OPTIONS]\n Demand Multiplier 1.0")
        .replace("0.001", "1e-6")
    )
    (tmp_path / "net.inp").write_text(text)
    (tmp_path / "net.toml").write_text(
        import_network(tmp_path / "net.inp").text
        + """
[links.fire]
type = "hydrant"
from = "22"
flow = "50 l/s"
"""
    )
    nodes, case = (
        ["22", "23", "31", "32", "13"],
        fvsolve.load(tmp_path / "net.toml", {"output.units": {}}),
    )
    elevations = {name: case.nodes[name].elevation for name in nodes}
    weight = case.properties.density * case.gravity
    keys = QUASI | {"output.probes": ["fire.gauge_pressure", "fire.flow"], "output.units": {}}
    rows = sweep(case, {"links.fire.from": nodes}, keys).rows
    for row in rows:
        node = row["links.fire.from"]
        head = row["min(fire.gauge_pressure) [Pa]"] / weight + elevations[node]
        assert head == pytest.approx(
            epanet_heads(tmp_path / "net.inp", tmp_path, node, 0.05), abs=1e-3
        ), node
    least = AMBIENT + 14.0 * weight
    rows = sweep(
        case,
        {"links.fire.from": nodes},
        keys | {"links.fire.flow": 1.0, "links.fire.residual_pressure": least},
    ).rows
    for row in rows:
        node, q = row["links.fire.from"], row["min(fire.flow) [m3/s]"]
        gauge = row["min(fire.gauge_pressure) [Pa]"]
        assert 0.0 < gauge - 14.0 * weight < 100.0

        def excess(q, node=node):
            return epanet_heads(tmp_path / "net.inp", tmp_path, node, q) - elevations[node] - 14.0

        assert q == pytest.approx(brentq(excess, 1e-3, 0.8, xtol=1e-9), rel=2e-4), node
