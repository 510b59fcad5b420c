"""Leaks and pressure-dependent demands that open and close: the outflow of the mass balance is the integral of the law.

The reference is the law, integrated by SciPy.
"""

import functools
import itertools

import numpy as np
import pytest
from reference.scenes import AMBIENT, RHO, WATER, chamber, inflow, junction, reservoir, scene, valve
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.studies.energy.energy_balance import energy

ADAPTIVE = ("auto", "rodas-5p", "rodas-4", "radau-iia-5", "esdirk-4", "tr-bdf2", "dormand-prince", "bogacki-shampine")
FIXED = ("rk4", "implicit-euler", "trapezoid", "implicit-midpoint")
FOOT = 10.0  # the law is a power above this drop and a cubic polynomial below [Pa]
GAP = 0.01  # Cd A of the valve before a demand [m2]
NEED = {"minimum_pressure": AMBIENT + 2e4, "required_pressure": AMBIENT + 4e4, "demand_exponent": 0.5}


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
    p = brentq(lambda p: GAP * np.sqrt(2 * (gauge - p) / RHO) - law(p), least, gauge, xtol=1e-13, rtol=1e-15)
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
        found = solve_ivp(lambda t, y, fill=fill: [3e5 * (fill - law(y[0])), law(y[0])], (start, end), y,
                          "DOP853", rtol=1e-11, atol=1e-10)  # fmt: skip
        y = found.y[:, -1]
    return RHO * float(y[1])


def ball(outlet: str, numerics: dict, law: str = "linear") -> dict:
    """Return a case of the chamber of `left`."""
    nodes = {
        "mouth": inflow({"time": TURNS[:-1], "value": FILLS, "kind": "step"}),
        "ball": chamber(1.0, AMBIENT + 5e4), "town": junction(0.02, **NEED),
    }  # fmt: skip
    links = {"in": valve("mouth", "ball", 0.05), "way": valve("ball", "town", GAP)}
    if outlet == "leak":
        del nodes["town"], links["way"]
        links["way"] = {"type": "leak", "from": "ball", "coefficient": 1e-4}
    return scene(nodes, links, 40.0, numerics, ["way.flow"], 0.002, fluid=SOFT | {"law": law})


PAIRS = [
    (outlet, method) for outlet in LAWS for method in (*ADAPTIVE, *FIXED)
    if outlet == "leak" or method not in ("dormand-prince", "bogacki-shampine")  # limited by the node behind the valve
]  # fmt: skip


@pytest.mark.parametrize("outlet, method", PAIRS)
def test_a_way_out_of_a_soft_place_takes_nothing_in_and_lets_out_what_its_law_says(outlet, method):
    numerics = {"method": method, "step": 0.005} if method in FIXED else {"method": method}
    result = fvsolve.run(ball(outlet, numerics))
    way = result.ledger["mass"]["nodes"][f"{OUTSIDE[outlet]}.outside"]
    near = 1e-4 if method == "implicit-euler" else 3e-5  # accuracy of the pressure
    assert way["outflow"] == pytest.approx(left(outlet), rel=near)
    assert way.get("inflow", 0.0) == 0.0
    assert abs(result.ledger["mass"]["relative"]) < 1e-10  # bound of Rosenbrock methods, with slopes by differences


@pytest.mark.parametrize("method", ["auto", "radau-iia-5", "rodas-4", "rk4"])
@pytest.mark.parametrize("outlet", LAWS)
def test_so_it_is_with_a_fluid_whose_density_follows_the_pressure(outlet, method):
    numerics = {"method": method, "step": 0.005} if method in FIXED else {"method": method}
    result = fvsolve.run(ball(outlet, numerics, "log"))
    way = result.ledger["mass"]["nodes"][f"{OUTSIDE[outlet]}.outside"]
    assert way["inflow"] == 0.0 and result["way.flow"].min() >= 0.0
    assert abs(result.ledger["mass"]["relative"]) < 1e-10


@pytest.mark.parametrize("method", ["auto", "rodas-4", "radau-iia-5", "dormand-prince"])
def test_its_energy_ledger_closes_over_steps_that_end_at_a_bend(method):
    relative = energy(ball("leak", {"method": method})).relative
    assert relative < 1e-5


SWINGS = [0.0, 10.0, 20.0, 30.0], [1e5, -0.5e5, 0.7e5, -0.2e5]  # of a source: times [s], gauge pressures [Pa]
TINY = 1e-6
STATELESS = {
    "leak": (lambda gauge: leaks(gauge, TINY), 0.0, (0.0, FOOT)), "demand": (takes, 2e4, (2e4, 2e4 + FOOT, 4e4)),
}  # fmt: skip


@functools.cache
def passed(outlet: str) -> float:
    """Outflow [kg] behind a valve from a source of varying pressure, integrated between the kinks of the law."""
    law, least, bends = STATELESS[outlet]
    edges = [p + RHO / 2 * (law(p) / GAP) ** 2 for p in bends]
    total = 0.0
    for a, b, p, r in zip(*(part for row in SWINGS for part in (row, row[1:])), strict=False):
        met = [a + (b - a) * (edge - p) / (r - p) for edge in edges if (edge - p) * (edge - r) < 0.0]
        for start, end in itertools.pairwise(sorted([a, *met, b])):
            total += quad(lambda t, a=a, b=b, p=p, r=r: behind(p + (r - p) * (t - a) / (b - a), law, least), start, end,
                          epsabs=1e-12, epsrel=1e-11, limit=200)[0]  # fmt: skip
    return RHO * total


@pytest.mark.parametrize("method", [*ADAPTIVE, *FIXED])
@pytest.mark.parametrize("outlet", LAWS)
def test_what_leaves_without_a_state_is_what_its_law_says(outlet, method):
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
    way = result.ledger["mass"]["nodes"]["hole.outside" if outlet == "leak" else "town.demand.outside"]
    near = 3e-4 if method == "implicit-euler" else 1e-5 if method in (*FIXED, "tr-bdf2") else 2e-6
    assert way["outflow"] == pytest.approx(passed(outlet), rel=near) and way["inflow"] == 0.0
    assert result.ledger["mass"]["nodes"]["lake"].get("outflow", 0.0) == 0.0
