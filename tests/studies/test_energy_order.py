"""The energy remainder falls at the order of scheme and method, for each density law and kind of method."""

import math

import numpy as np
import pytest
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    WATER,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    smooth_ramp,
    tank,
    valve,
)

from fvsolve.steppers import METHODS
from fvsolve.studies.energy_balance import energy

FRICTION = {"model": "steady", "factor": 0.02}


def throttled(scheme: str, method: str, cells: int, law: str) -> dict:
    """Case of a main with friction whose valve closes smoothly to 30 % in 3 s."""
    nodes = {"lake": lake(50.0), "gate": junction(), "out": reservoir(AMBIENT)}
    links = {"main": pipe("lake", "gate", 1000.0, 0.3, 1000.0, cells, friction=FRICTION)}
    links["tap"] = valve("gate", "out", 0.002, smooth_ramp(0.0, 3.0, 1.0, 0.3))
    fluid = {**WATER, "law": law}
    return scene(nodes, links, 4.0, {"scheme": scheme, "method": method, "courant": 0.5}, fluid=fluid)


def orders(remainders: list[float]) -> np.ndarray:
    return np.log2(np.array(remainders[:-1]) / np.array(remainders[1:]))


@pytest.mark.parametrize(
    "scheme, method, order",
    [
        ("upwind", "euler", 1), ("upwind", "rk4", 1), ("central", "rk4", 2), ("linear-upwind", "ssp-rk3", 2),
        ("fromm", "ssp-rk3", 3), ("muscl", "ssp-rk3", 3), ("upwind3", "ssp-rk3", 3), ("upwind3", "rk4", 3),
        ("upwind5", "dormand-prince", 5), ("weno5", "dormand-prince", 5),
    ],
)  # fmt: skip
@pytest.mark.parametrize("law", ["linear", "log"])
def test_with_cells_and_steps_the_remainder_falls_at_the_order_of_the_scheme(scheme, method, order, law):
    """fromm and muscl gain an order: their second-order error moves waves but removes no energy.

    Under the law log, energies are differences of m h, known to 1e-8 J here, which fifth order reaches at 160 cells.
    """
    counts = (40, 80) if law == "log" and order == 5 else (80, 160)
    found = [energy(throttled(scheme, method, cells, law)) for cells in counts]
    assert all(one.ok for one in found)
    (measured,) = orders([float(np.abs(one.remainder).max()) for one in found])
    assert measured == pytest.approx(order, abs=0.16 if counts[0] == 80 else 0.25)


def swinging(method: str, h: float) -> dict:
    """Case of two tanks and a rigid column with friction, without cells and without reversal of the flow."""
    swell = {"time": [0.0, 20.0, 40.0], "value": [0.0, 0.05, 0.02], "kind": "smooth"}
    nodes = {"a": tank(2.0, 5.0), "b": tank(3.0, 3.0), "spring": {"type": "inflow", "flow": swell}}
    links = {"way": {"type": "rigid-column", "from": "a", "to": "b", "length": 50.0, "diameter": 0.5,
                     "friction": FRICTION},
             "sluice": valve("spring", "a", 1.0)}  # fmt: skip
    return scene(nodes, links, 16.0, {"method": method, "step": h, "initial": "rest"})


@pytest.mark.parametrize(
    "method, order",
    [
        ("euler", 1), ("improved-euler", 2), ("ssp-rk3", 3), ("rk4", 4), ("dormand-prince", 5),
        ("implicit-euler", 1), ("trapezoid", 2), ("tr-bdf2", 2), ("alexander-3", 3), ("esdirk-4", 4),
        ("radau-iia-3", 3), ("radau-iia-5", 5), ("lobatto-iiic-4", 4), ("rodas-4", 4), ("rodas-5p", 5),
    ],
)  # fmt: skip
def test_without_cells_the_remainder_falls_at_least_at_the_order_of_the_method(method, order):
    steps = (1.0, 0.5, 0.25) if order > 1 else (0.5, 0.25, 0.125)
    measured = orders([float(np.abs(energy(swinging(method, h)).remainder).max()) for h in steps])
    assert measured[-1] > order - 0.25
    assert measured[-1] < order + 1.4


@pytest.mark.parametrize("law", ["log", "table"])
def test_a_chamber_under_a_curved_law_stores_what_its_law_says(law):
    """Energy of the chamber: V (beta (exp(p / beta) - 1) - p) stored under log; integral of h dm under table."""
    fluid = {**WATER, "law": "log"} if law == "log" else {"name": "Water", "temperature": 293.15, "law": "table"}
    volume, p0, p1 = 0.5, AMBIENT, AMBIENT + 4e7
    nodes = {"pump": reservoir(p1), "pot": chamber(volume, p0)}
    case = scene(nodes, {"hole": valve("pump", "pot", 2e-6)}, 36.0, {"method": "dormand-prince", "rtol": 1e-8},
                 fluid=fluid)  # fmt: skip
    found = energy(case)
    if law == "log":
        beta, p = WATER["bulk_modulus"], p1 - AMBIENT
        grown = math.expm1(p / beta)
        assert found.stored["pot"][-1] == pytest.approx(volume * (beta * grown - p), rel=1e-7)
        assert found.supplied["pump"][-1] == pytest.approx(
            volume * beta * grown * (1.0 - math.exp(-p / beta)), rel=1e-7
        )
    else:
        from CoolProp.CoolProp import PropsSI

        s = PropsSI("S", "T", 293.15, "P", AMBIENT, "Water")
        grid = np.linspace(p0, p1, 2001)
        rho = np.array([PropsSI("D", "S", s, "P", float(p), "Water") for p in grid])
        h = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(grid) * (1 / rho[1:] + 1 / rho[:-1]))])
        stored = volume * (rho[-1] * h[-1] - (p1 - p0))
        assert found.stored["pot"][-1] == pytest.approx(stored, rel=1e-5)
        assert found.supplied["pump"][-1] == pytest.approx(volume * (rho[-1] - rho[0]) * h[-1], rel=1e-5)
    assert found.relative < 1e-7


def test_the_linear_law_makes_energy_where_a_piston_moves_and_the_ledger_says_so():
    """A piston under the linear law creates energy of order p / beta of the work; under log it creates none."""
    nodes = {"ground": {"type": "frame"}, "load": {"type": "mass", "mass": 50.0, "initial_position": 0.1},
             "pump": reservoir(AMBIENT + 2e7), "sump": reservoir(AMBIENT)}  # fmt: skip
    links = {
        "cyl": {"type": "cylinder", "ports": {"case": "ground", "rod": "load"}, "stroke": 0.5, "area_A": 1e-3,
                "area_B": 1e-3, "dead_volume_A": 1e-5, "dead_volume_B": 1e-5, "leakage": 1e-12},
        "in": valve("pump", "cyl.A", 1e-6), "away": valve("cyl.B", "sump", 1e-6),
        "damper": {"type": "damper", "from": "ground", "to": "load", "damping": 2e5},
    }  # fmt: skip
    found = {}
    for law in ("linear", "log"):
        case = scene(nodes, links, 1.0, {"method": "radau-iia-5", "rtol": 1e-9}, fluid={**WATER, "law": law})
        found[law] = energy(case)
    work = found["log"].dissipated["damper"][-1]
    assert not found["log"].law
    assert found["log"].relative < 1e-7
    law = abs(found["linear"].law["cyl"][-1])
    assert 1e-4 < law / work < 2e7 / WATER["bulk_modulus"]
    assert found["linear"].remainder[-1] == pytest.approx(found["linear"].law["cyl"][-1], rel=1e-4)
    assert found["log"].dissipated["cyl leak"][-1] > 0.0


def test_at_a_head_of_water_power_is_rho_g_h_q():
    nodes = {"lake": lake(50.0), "out": reservoir(AMBIENT)}
    case = scene(nodes, {"tap": valve("lake", "out", 0.01), "pot": valve("lake", "box", 1e-9)}, 1.0,
                 {"method": "rk4", "step": 0.1})  # fmt: skip
    case["nodes"]["box"] = chamber(0.1)
    found = energy(case)
    q = 0.01 * math.sqrt(2 * GRAVITY * 50.0)
    assert found.supplied["lake"][-1] == pytest.approx(RHO * GRAVITY * 50.0 * q, rel=1e-6)


@pytest.mark.parametrize(
    "method, end",
    [(name, 150.0) for name in (*(method.name for method in METHODS.values() if method.adaptive), "auto")]
    + [(name, 400.0) for name in ("dormand-prince", "rodas-4", "tr-bdf2", "auto")],
)
def test_what_a_draining_tank_loses_is_what_it_had(method, end):
    """The level is a parabola in time, which methods of order two integrate exactly; the power in the drain is not."""
    nodes, links = {"up": tank(2.0, 10.0), "out": reservoir(AMBIENT)}, {"drain": valve("up", "out", 0.01)}
    found = energy(scene(nodes, links, end, {"method": method, "rtol": 1e-6}, ["up.level"]))
    speed = 0.01 / 2.0 * math.sqrt(2.0 * GRAVITY)  # speed of the surface over the root of the level [m^0.5/s]
    left = max(0.0, math.sqrt(10.0) - 0.5 * speed * end) ** 2
    lost = RHO * GRAVITY * 2.0 * (10.0**2 - left**2) / 2.0
    assert found.dissipated["drain"][-1] == pytest.approx(lost, rel=1e-2)
