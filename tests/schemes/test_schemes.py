"""Schemes: properties derived from their entries, and observed order of every scheme and explicit method."""

import math
from fractions import Fraction

import numpy as np
import pytest
from reference.orders import gaussian_averages, mean_error, observed_order
from reference.scenes import (
    NO_FRICTION,
    RHO,
    WATER,
    chamber,
    junction,
    pipe,
    ramp,
    reservoir,
    scene,
    valve,
)
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.core.assembly.scheme_codes import CODES, FAMILIES, family
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.reconstruction import limited
from fvsolve.core.schemes import LEAST_CELLS, LIMITED, LINEAR, SCHEMES, Scheme

KNOWN = {  # order, reach, scheme on grids of basins, True if it computes cavities
    "upwind": (1, (1, 0, 0, 1), "upwind", True),
    "linear-upwind": (2, (2, 0, 1, 2), "muscl", False),
    "fromm": (2, (2, 1, 1, 2), "muscl", False),
    "central": (2, (1, 1, 1, 2), "muscl", False),
    "upwind3": (3, (2, 1, 2, 3), "muscl", False),
    "upwind5": (5, (3, 2, 4, 5), "upwind5", False),
    "muscl": (2, (2, 1, 1, 3), "muscl", True),
    "weno5": (5, (3, 2, 4, 5), "weno5", False),
}


def test_every_scheme_is_known():
    assert set(KNOWN) == set(SCHEMES) == {*LINEAR, *LIMITED}


@pytest.mark.parametrize("name", KNOWN)
def test_facts_of_a_scheme_are_those_of_its_weights(name):
    one = SCHEMES[name]
    assert (one.order, tuple(one.reach), one.for_basin(True).name, one.cavities) == KNOWN[name]
    assert one.for_basin(False).name == ("upwind" if name == "upwind" else "muscl")
    assert one.smooth is (SCHEMES[one.twin] if one.limited else one)
    assert family(name) == (
        rec.UPWIND if name == "upwind" else rec.LINEAR if name in LINEAR else FAMILIES[name]
    )


@pytest.mark.parametrize("name", LINEAR)
def test_weights_are_exact_for_their_degree_and_no_more(name):
    """Averages of (x - 0.3)^d over the cells [k, k + 1], k = -2 to 2, give the value at the face x = 1."""
    one = LINEAR[name]
    for degree in range(one.degree + 2):
        averages = [
            ((k + 0.7) ** (degree + 1) - (k - 0.3) ** (degree + 1)) / (degree + 1)
            for k in range(-2, 3)
        ]
        apart = abs(float(np.dot([float(w) for w in one.weights], averages)) - 0.7**degree)
        assert apart < 1e-12 if degree <= one.degree else apart > 1e-3


def test_a_scheme_is_a_single_entry():
    """The weights of a new scheme, kappa = 1/2 of van Leer's family, give all its properties."""
    one = Scheme("quick-like", weights=tuple(Fraction(w, 8) for w in (0, -1, 6, 3, 0)))
    assert (one.order, tuple(one.reach), one.limited, one.plane) == (
        2,
        (2, 1, 1, 2),
        False,
        "muscl",
    )


def test_shorter_schemes_have_space():
    """Schemes that read five cells have a scheme of lower order for pipes with fewer cells; others have none."""
    for one in SCHEMES.values():
        assert bool(one.shorter) == (one.degree + 1 >= LEAST_CELLS)
        assert not one.shorter or SCHEMES[one.shorter].order < one.order


def test_codes_of_limiters_are_those_of_their_functions():
    assert [CODES[name] for name in ("minmod", "van-leer", "monotonized-central")] == [
        rec.MINMOD,
        rec.VAN_LEER,
        rec.MONOTONIZED_CENTRAL,
    ]
    assert limited(CODES["minmod"], 1.0, 3.0) == 1.0
    assert limited(CODES["van-leer"], 1.0, 3.0) == 1.5
    assert limited(CODES["monotonized-central"], 1.0, 3.0) == 2.0


LENGTH, DIAMETER, SPEED = 100.0, 0.3, 1000.0
FINE = {"method": "dormand-prince", "courant": 0.5}


def single(cells: int, numerics: dict, demand=None, friction=NO_FRICTION) -> fvsolve.Model:
    nodes = {"lake": reservoir(1e6), "gate": junction(demand)}
    links = {"main": pipe("lake", "gate", LENGTH, DIAMETER, SPEED, cells, friction=friction)}
    return fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, numerics, ["gate.pressure"])))


def bump(cells: int, centre: float = 30.0, width: float = 5.0) -> np.ndarray:
    return gaussian_averages(np.linspace(0, LENGTH, cells + 1), centre, width)


def advected_bump(cells: int, scheme: str, backward: bool = False, **numerics) -> float:
    """L1 error of a bump that has travelled 40 m, to the right or to the left."""
    model = single(cells, {"scheme": scheme, **FINE, **numerics})
    state = fvsolve.initial_state(model)
    start, end = (70.0, 30.0) if backward else (30.0, 70.0)
    half = slice(cells, 2 * cells) if backward else slice(0, cells)
    state.y[half] = bump(cells, start)
    state = fvsolve.advance(model, state, 40.0 / SPEED)
    exact = np.zeros(2 * cells)
    exact[half] = bump(cells, end)
    return mean_error(state.y, exact)


ORDERS = {
    "upwind": (1, 1600),
    "linear-upwind": (2, 200),
    "fromm": (2, 200),
    "central": (2, 200),
    "upwind3": (3, 400),
    "upwind5": (5, 100),
    "weno5": (5, 200),
}


@pytest.mark.parametrize("scheme", ORDERS)
def test_every_linear_scheme_and_weno_shows_its_order(scheme):
    order, cells = ORDERS[scheme]
    errors = [advected_bump(n, scheme) for n in (cells, 2 * cells)]
    assert observed_order(errors, [2.0, 1.0]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("limiter", ["minmod", "van-leer", "monotonized-central"])
def test_muscl_is_second_order_in_the_mean_with_every_limiter(limiter):
    errors = [advected_bump(n, "muscl", limiter=limiter, method="ssp-rk3") for n in (400, 800)]
    assert observed_order(errors, [2.0, 1.0]) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
def test_waves_to_the_left_and_to_the_right_are_treated_alike(scheme):
    right, left = (advected_bump(50, scheme, backward=b) for b in (False, True))
    assert left == pytest.approx(right, rel=1e-9)


METHODS = {
    "euler": 1,
    "improved-euler": 2,
    "modified-euler": 2,
    "ssp-rk2": 2,
    "heun": 3,
    "ssp-rk3": 3,
    "bogacki-shampine": 3,
    "rk4": 4,
    "dormand-prince": 5,
}


@pytest.mark.parametrize("method", METHODS)
def test_every_method_shows_its_order_on_a_pipe_with_a_demand_that_moves(method):
    """The reference is SciPy's DOP853 on the same cells, so that only time is discretised."""
    # Euler is unstable with schemes above first order
    scheme = "upwind" if method == "euler" else "upwind5"
    cells, end = 40, 0.08
    demand = ramp(0.0, 0.2, 0.0, 0.01, 4.0)
    errors, steps = [], (5e-4, 2.5e-4)
    for size in steps:
        model = single(cells, {"scheme": scheme, "method": method, "step": size}, demand)
        state = fvsolve.initial_state(model)
        state.y[:cells] = bump(cells, 40.0, 12.0)
        run = solve_ivp(model.rhs, (0.0, end), state.y.copy(), "DOP853", rtol=1e-13, atol=1e-14)
        state = fvsolve.advance(model, state, end)
        errors.append(np.max(np.abs(state.y - run.y[:, -1])))
    assert observed_order(errors, steps) == pytest.approx(METHODS[method], abs=0.25)


def with_friction(cells: int, scheme: str, through: float, reversing: bool) -> np.ndarray:
    """Waves after 20 ms in a pipe with strong Darcy friction and a steady flow of `through` [m3/s]."""
    friction = {"model": "quasi-steady", "factor": 0.5}
    model = single(cells, {"scheme": scheme, **FINE}, through, friction)
    state = fvsolve.initial_state(model)
    size = 100.0  # kg/s
    state.y[:cells] += size * bump(cells, 45.0, 6.0)
    if reversing:
        state.y[:cells] -= size * bump(cells, 52.0, 6.0)
    return fvsolve.advance(model, state, 0.02).y[: 2 * cells]


def friction_order(scheme: str, cells: int, through: float, reversing: bool) -> float:
    """Order from the differences of three nested grids, each averaged onto the coarser."""
    grids = [with_friction(cells * 2**k, scheme, through, reversing) for k in range(3)]
    gaps = [
        np.mean(np.abs(c - f.reshape(-1, 2).mean(axis=1)))
        for c, f in zip(grids, grids[1:], strict=False)
    ]
    return math.log2(gaps[0] / gaps[1])


@pytest.mark.parametrize("scheme, order", [("fromm", 2), ("upwind3", 3)])
def test_friction_retains_the_order_where_the_flow_retains_its_sign(scheme, order):
    assert friction_order(scheme, 100, 0.2, reversing=False) == pytest.approx(order, abs=0.3)


def test_friction_retains_order_four_at_least_under_the_fifth_order_scheme():
    assert friction_order("upwind5", 50, 0.2, reversing=False) > 3.8


def test_the_kink_of_the_friction_law_costs_the_fifth_order_scheme_no_more_than_to_order_two_and_a_half():
    assert friction_order("upwind5", 100, 0.0, reversing=True) > 2.5


def test_an_error_controlled_run_satisfies_its_tolerance_in_proportion():
    """A tolerance 100 times smaller makes the error on the cells of the bump at least 20 times smaller."""
    cells, errors = 60, []
    for rtol in (1e-5, 1e-7):
        model = single(cells, {"scheme": "upwind5", "method": "dormand-prince", "rtol": rtol})
        state = fvsolve.initial_state(model)
        state.y[:cells] = bump(cells, 40.0, 10.0)
        run = solve_ivp(model.rhs, (0.0, 0.03), state.y.copy(), "DOP853", rtol=1e-13, atol=1e-14)
        errors.append(np.max(np.abs(fvsolve.advance(model, state, 0.03).y - run.y[:, -1])))
    assert errors[0] < 1e-3 and errors[1] < 1e-5
    assert errors[1] < errors[0] / 20


def pots(step_size: float, every: float, method: str, kink: float) -> fvsolve.Result:
    """Run of two chambers in a row, with an outlet of the second that starts to close linearly at `kink` [s]."""
    nodes = {
        "pump": reservoir(8e6),
        "a": chamber(0.02, 5e6),
        "b": chamber(0.05, 3e6),
        "out": reservoir(5e5),
    }
    links = {
        "in": valve("pump", "a", 2e-7),
        "mid": valve("a", "b", 4e-7),
        "tap": valve("b", "out", 2e-7, ramp(kink, 0.6, 1.0, 0.3)),
    }
    numerics = {"method": method, "step": step_size}
    return fvsolve.run(scene(nodes, links, 1.0, numerics, ["a.pressure", "b.pressure"], every))


def pots_exact(t: np.ndarray, kink: float) -> np.ndarray:
    beta, k = WATER["bulk_modulus"], math.sqrt(2 / RHO)

    def rate(now, p):
        closing = min(max((now - kink) / 0.6, 0.0), 1.0)
        mid = 4e-7 * k * math.sqrt(p[0] - p[1])
        out = 2e-7 * (1 - 0.7 * closing) * k * math.sqrt(p[1] - 5e5)
        return [beta / 0.02 * (2e-7 * k * math.sqrt(8e6 - p[0]) - mid), beta / 0.05 * (mid - out)]

    found, y, start = [], [5e6, 3e6], 0.0
    for end in (kink, kink + 0.6, 1.0):
        inside = t[(t >= start) & (t < end)]
        stops = np.append(inside, end)
        run = solve_ivp(
            rate, (start, end), y, "DOP853", rtol=1e-13, atol=1e-6, t_eval=stops, max_step=0.02
        )
        found.append(run.y[1][: len(inside)])
        y, start = run.y[:, -1], end
    found.append(np.full(np.sum(t >= 1.0), y[1]))
    return np.concatenate(found)


@pytest.mark.parametrize("method, order", [("heun", 3), ("rk4", 4), ("dormand-prince", 5)])
def test_a_kink_that_no_step_falls_on_costs_no_order(method, order):
    errors, kink, steps = [], 0.123456789, (0.04, 0.02)
    for size in steps:
        result = pots(size, 1.0, method, kink)
        errors.append(abs(result["b.pressure"][-1] - pots_exact(np.array([1.0]), kink)[0]))
    assert observed_order(errors, steps) > order - 0.4


@pytest.mark.parametrize(
    "method, order", [("improved-euler", 2), ("rk4", 4), ("dormand-prince", 4)]
)
def test_values_between_steps_are_as_good_as_the_steps_up_to_the_dense_output_s_order(
    method, order
):
    errors, kink, steps = [], 0.2, (0.08, 0.04)
    for size in steps:
        result = pots(size, 0.0137, method, kink)
        t = np.asarray(result.t)
        errors.append(np.max(np.abs(result["b.pressure"] - pots_exact(t, kink))))
    assert observed_order(errors, steps) > order - 0.4
