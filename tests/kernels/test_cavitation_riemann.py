"""Cavities in one pipe compared with exact Riemann problems of the mixture law, in which c falls from 97 to 0.6 m/s."""

from __future__ import annotations

import numpy as np
import pytest
from reference import scenes
from reference.mixture import Mixture, Riemann
from reference.orders import observed_order
from reference.scenes import AMBIENT, junction, reservoir, scene, stiff_pipe

import fvsolve
from fvsolve.kernels.riemann import face_flux, star_state, state_at

AIR, FLOOR = 1.2e-3, 2000.0
LENGTH, DIAMETER, START = 100.0, 0.5, 3e5
SOFT = {
    "name": "user", "density": 1000.0, "bulk_modulus": 1e7, "viscosity": 1e-3, "vapor_pressure": FLOOR,
    "pressure": AMBIENT, "law": "mixture", "air_fraction": AIR, "cavitation": True,
}  # fmt: skip
EXACT = Mixture(1000.0, 1e7, AMBIENT, FLOOR, AIR / (1 - AIR) * (AMBIENT - FLOOR), 0.0, scenes.area(DIAMETER))
FOAM = EXACT.floor + EXACT.gas  # about half gas
STATES = {  # pressure [Pa] and velocity [m/s] on the left and on the right
    "two liquids part and a cavity opens": ((START, -5.0), (START, 5.0)),
    "a cavity is shut from both sides": ((FOAM, 5.0), (FOAM, -5.0)),
    "liquid runs into foam": ((START, 3.0), (FOAM, 0.0)),
    "its mirror image": ((FOAM, 0.0), (START, -3.0)),
    "a weak wave in liquid": ((START, 1.0), (START, 0.9)),
}


def resting_pipe(cells: int, fluid: dict = SOFT, speed: float | None = None, **numerics) -> fvsolve.Model:
    nodes = {"left": reservoir(START), "right": junction()}
    main = stiff_pipe("left", "right", LENGTH, DIAMETER, cells)
    if speed is not None:
        main = scenes.pipe("left", "right", LENGTH, DIAMETER, speed, cells)
    case = scene(nodes, {"main": main}, 10.0, numerics, ["right.pressure"], 0.1, fluid=fluid)
    return fvsolve.build(fvsolve.load(case))


@pytest.mark.parametrize("compliance", [0.0, 2e-10, 1e-8])
def test_the_law_is_convex_so_that_waves_are_shocks_or_fans_and_nothing_else(compliance):
    """d^2(1/m)/dF^2 > 0: m c rises with pressure from near vacuum to liquid."""
    law = Mixture(1000.0, 2e9, AMBIENT, FLOOR, 1e-2, compliance)
    p = FLOOR + np.geomspace(1e-6, 1e8, 4000)
    assert np.all(np.diff(law.m(p) * law.c(p)) > 0.0)
    assert np.max(law.c(p)) / np.min(law.c(p)) > 1e4


def random_states(rng, law: Mixture, n: int):
    for _ in range(n):
        p = law.floor + 10.0 ** rng.uniform(-1.0, 6.0, 2)
        yield (p[0], rng.normal(0.0, 1.0)), (p[1], rng.normal(0.0, 1.0))


WATER = {**SOFT, "density": 998.2, "bulk_modulus": 2.18e9, "air_fraction": 1e-3}


@pytest.mark.parametrize("fluid, speed, near", [(SOFT, None, 1e-9), (WATER, None, 1e-9), (WATER, 1319.0, 2e-5)])
def test_the_state_between_the_waves_is_the_exact_one(fluid, speed, near):
    """Velocities between 200 pairs of liquid and foam: to 1e-9, in an elastic wall (nearly closed form) to 2e-5."""
    tables = resting_pipe(4, fluid, speed, scheme="upwind", method="euler").tables
    st, floats, pipe = tables.settings[0], tables.floats, tables.pipes[0]
    gas = fluid["air_fraction"] / (1 - fluid["air_fraction"]) * (AMBIENT - FLOOR)
    assert (pipe["compliance"] > 1e-10) == (speed is not None)
    law = Mixture(fluid["density"], fluid["bulk_modulus"], AMBIENT, FLOOR, gas, float(pipe["compliance"]), EXACT.area)
    for left, right in random_states(np.random.default_rng(5), law, 200):
        p, v = Riemann(law, left, right).middle()
        sides = state_at(st, floats, pipe, left[0]), state_at(st, floats, pipe, right[0])
        middle, after, ahead = star_state(st, floats, pipe, sides[0], left[1], sides[1], right[1])
        assert middle[0] - FLOOR == pytest.approx(p - FLOOR, rel=10.0 * near)
        assert [after, ahead] == pytest.approx([v, v], abs=near * (1.0 + abs(v)))


def test_the_flux_at_a_face_is_that_of_the_exact_solution_on_its_ray():
    tables = resting_pipe(4, scheme="upwind", method="euler").tables
    st, floats, pipe = tables.settings[0], tables.floats, tables.pipes[0]
    for left, right in random_states(np.random.default_rng(6), EXACT, 60):
        p, v = (float(x) for x in Riemann(EXACT, left, right).solution()(np.array(0.0)))
        m = EXACT.m(p)
        scale = max(EXACT.m(q) * (abs(u) + EXACT.c(q)) for q, u in (left, right))
        found = face_flux(st, floats, pipe, left[0], left[1], right[0], right[1])
        assert found[0] == pytest.approx(m * v, abs=2e-5 * scale)
        assert found[1] == pytest.approx(m * v * v + EXACT.force(p), abs=1e-4 * scale * (1.0 + abs(v)))


def riemann_run(name: str, cells: int, scheme: str, end: float):
    """Places, computed and exact masses of the inner pipe at the end, where no wave from its ends arrived."""
    left, right = STATES[name]
    model = resting_pipe(cells, scheme=scheme, limiter="minmod", method="ssp-rk3", courant=0.5)
    state = fvsolve.initial_state(model)
    row, profile = model.tables.pipes[0], model.tables.profile
    base = profile[row["center"] : row["center"] + cells]
    half = np.arange(cells) < cells // 2
    m = np.where(half, EXACT.m(left[0]), EXACT.m(right[0]))
    dense, flow = row["speed"] * (m - base), m * np.where(half, left[1], right[1])
    state.y[:cells], state.y[cells:] = (dense + flow) / 2, (dense - flow) / 2
    state = fvsolve.advance(model, state, end)
    found = base + (state.y[:cells] + state.y[cells:]) / row["speed"]
    x = (np.arange(cells) + 0.5) * LENGTH / cells - LENGTH / 2
    at, exact = Riemann(EXACT, left, right).solution(), np.zeros(cells)
    for s in (np.arange(16) + 0.5) / 16 - 0.5:
        exact += EXACT.m(at((x + s * LENGTH / cells) / end)[0]) / 16
    inner = np.abs(x) < 25
    return x[inner], found[inner], exact[inner]


@pytest.mark.parametrize("name", STATES)
def test_a_riemann_problem_converges_to_the_exact_profile(name):
    """L1 error of the mass over its spread; shocks and edges of fans allow order one at most."""
    errors = []
    for cells in (200, 400, 800):
        _, found, exact = riemann_run(name, cells, "muscl", 0.2)
        errors.append(np.mean(np.abs(found - exact)) / np.ptp(exact))
    assert errors[-1] < (2e-2 if "weak" in name else 6e-3)
    assert observed_order(errors, [4.0, 2.0, 1.0]) > 0.6
