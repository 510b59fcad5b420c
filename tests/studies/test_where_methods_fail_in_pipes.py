"""Failures of schemes and methods in pipes: each failure occurs where it is predicted, and its remedy removes it.

The sections of docs/where-methods-fail.md name these tests. All of them run the compiled program.
"""

import math

import numpy as np
import pytest
from reference.lossless_pipes import (
    DIAMETER,
    LENGTH,
    SPEED,
    THRESHOLD,
    courant_limit,
    growth,
    lossless,
    scaled,
    step_matrix,
)
from reference.scenes import (
    AMBIENT,
    RHO,
    SHARP,
    area,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    valve,
)

import fvsolve
from fvsolve.case import load
from fvsolve.core.assembly.scheme_codes import CODES
from fvsolve.core.kernels.reconstruction import limited
from fvsolve.core.model.energy_norm import energy_weights
from fvsolve.core.step_limits.step_notices import step_limits
from fvsolve.core.steppers import analyse
from fvsolve.studies.outcome import outcome, study_model

LINEAR = ("upwind", "linear-upwind", "fromm", "upwind3", "upwind5", "central")
EXPLICIT = (
    "euler",
    "improved-euler",
    "heun",
    "rk4",
    "ssp-rk3",
    "bogacki-shampine",
    "dormand-prince",
)


def energy_norm(model, y: np.ndarray) -> float:
    return float(np.sqrt(np.sum(energy_weights(model) * y**2)))


def worst_start(model, method: str, matrix: np.ndarray, steps: int) -> np.ndarray:
    """State of energy norm 0.001 that grows most in n steps."""
    power = np.linalg.matrix_power(step_matrix(method, matrix), steps)
    vector = np.linalg.svd(power)[2][0]
    return 1e-3 * vector / np.sqrt(energy_weights(model))


def measured_growth(model, y: np.ndarray) -> float:
    found = outcome(model, y=y)
    return energy_norm(model, found.y) / energy_norm(model, y) if found.ok else math.inf


# central differences with Euler ------------------------------------------------------------------------------------


@pytest.mark.parametrize("courant", [0.9, 0.3, 0.1, 0.03])
def test_central_differences_with_euler_grow_at_any_step_and_rk4_does_not(courant):
    cells = 20
    h = courant * LENGTH / cells / SPEED
    rates = lossless(cells, "central", "euler", h).jacobian(0.0, np.zeros(2 * cells))
    largest = np.abs(1.0 + h * np.linalg.eigvals(rates)).max()
    steps = math.ceil(math.log(THRESHOLD) / math.log(largest))
    model = lossless(cells, "central", "euler", h, steps)
    matrix = h * scaled(model, rates)
    assert largest > 1.0
    start = worst_start(model, "euler", matrix, steps)
    found = measured_growth(model, start)
    assert found >= THRESHOLD and found == pytest.approx(growth("euler", matrix, steps), rel=1e-5)
    assert measured_growth(lossless(cells, "central", "rk4", h, steps), start) < 2.0
    assert measured_growth(lossless(cells, "upwind", "euler", h, steps), start) < 2.0


# Courant above the limit -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", EXPLICIT)
@pytest.mark.parametrize("scheme", LINEAR)
def test_the_courant_limit_of_each_pair_agrees_with_real_runs_within_1_percent(scheme, method):
    cells, steps = 16, 1000
    travel = LENGTH / cells / SPEED
    model = lossless(cells, scheme, method, travel)
    unit = travel * scaled(model, model.jacobian(0.0, np.zeros(2 * cells)))
    limit = courant_limit(method, unit, steps)
    assert limit > 0.01
    below, above = (
        measured_growth(
            lossless(cells, scheme, method, c * travel, steps),
            worst_start(model, method, c * unit, steps),
        )
        for c in (0.995 * limit, 1.005 * limit)
    )
    assert below < THRESHOLD < above, (scheme, method, limit, below, above)


def test_euler_takes_upwind_to_courant_1_and_nothing_above_first_order_to_any_step_worth_taking():
    cells, travel = 16, LENGTH / 16 / SPEED
    limits = {}
    for scheme in LINEAR:
        model = lossless(cells, scheme, "euler", travel)
        unit = travel * scaled(model, model.jacobian(0.0, np.zeros(2 * cells)))
        limits[scheme] = courant_limit("euler", unit, 100_000)
    assert limits.pop("upwind") == pytest.approx(1.0, abs=1e-3)
    assert max(limits.values()) < 0.1


# non-normal growth before decay ------------------------------------------------------------------------------------


def matched(cells: int, scheme: str, method: str, h: float, steps: int):
    """Model of a pipe whose valve, at its steady flow, does not reflect waves: d(drop)/d(flow) = rho a / A."""
    velocity = 1.0
    drop = 0.5 * RHO * SPEED * velocity
    flow_area = area(DIAMETER) * velocity / math.sqrt(2 * drop / RHO)
    nodes = {
        "lake": reservoir(AMBIENT + 4 * drop),
        "end": junction(),
        "out": reservoir(AMBIENT + 3 * drop),
    }
    links = {
        "main": pipe("lake", "end", LENGTH, DIAMETER, SPEED, cells),
        "valve": valve("end", "out", flow_area),
    }
    numerics = {"scheme": scheme, "method": method, "step": h}
    return study_model(scene(nodes, links, steps * h, numerics, ["end.pressure"], steps * h))


@pytest.mark.parametrize("courant", [1.3, 1.4, 1.5])
def test_below_the_limit_of_the_eigenvalues_an_inflow_pipe_grows_by_orders_before_it_decays(
    courant,
):
    cells = 8
    h = courant * LENGTH / cells / SPEED
    model = matched(cells, "upwind", "euler", h, 1)
    matrix = h * scaled(model, model.jacobian(0.0, np.zeros(model.y_size)))
    # a cell depends on itself and the last cell
    assert np.max(np.abs(np.tril(matrix[:cells, :cells], -2))) < 1e-9
    spectrum = 1.0 + np.diag(matrix)  # equal eigenvalues, below one up to Courant 2
    assert spectrum == pytest.approx(1.0 - courant) and abs(1.0 - courant) < 1.0
    norms = {n: growth("euler", matrix, n) for n in (5, 10, 15, 20, 30, 40, 60, 400)}
    peak = max(norms, key=norms.get)
    assert norms[peak] > THRESHOLD and norms[400] < 1e-6
    start = 1e-6 * worst_start(model, "euler", matrix, peak)
    found = measured_growth(matched(cells, "upwind", "euler", h, peak), start)
    assert found == pytest.approx(norms[peak], rel=0.01)
    assert measured_growth(matched(cells, "upwind", "euler", h, 400), start) < 1e-6
    travel = LENGTH / cells / SPEED
    assert measured_growth(matched(cells, "upwind", "euler", travel, peak), start) < 1.0 + 1e-6


# a one-sided closure -----------------------------------------------------------------------------------------------


def averages(cell: int, degree: int = 4) -> list[float]:
    """Averages of 1, x, x^2, ... over the unit cell that begins at `cell`."""
    return [((cell + 1) ** (k + 1) - cell ** (k + 1)) / (k + 1) for k in range(degree + 1)]


def explicit_rates(cells: int, left: float, right: float, datum: bool) -> np.ndarray:
    """Rates of upwind5 per travel time of a cell, for waves r and then l, between ends with reflection factors.

    Ghost cells beyond an end continue a polynomial of degree 4. Where a wave leaves, it fits the nearest five cells.
    Where a wave enters, it fits the value of the node and four cells (`datum`), or five cells.
    """
    weights, value = np.array([2, -13, 47, 27, -3]) / 60, [1.0, 0.0, 0.0, 0.0, 0.0]
    alone = np.linalg.inv(np.array([averages(c) for c in range(5)]))
    through = np.linalg.inv(np.array([value, *(averages(c) for c in range(4))]))
    beyond = np.array([averages(c) for c in (-1, -2, -3)])
    leaving, at_end = beyond @ alone, value @ alone
    goes = np.zeros((2, 2 * cells))  # leaving waves: r at the right end, l at the left end
    goes[0, cells - 5 : cells], goes[1, cells : cells + 5] = at_end[::-1], at_end
    comes = (left * goes[1], right * goes[0])
    rates = []
    for wave, node in enumerate(comes):
        # in the direction of the wave
        own = np.eye(2 * cells)[wave * cells : (wave + 1) * cells][:: -1 if wave else 1]
        enters = (beyond @ through) @ np.vstack([node, own[:4]]) if datum else leaving @ own[:5]
        wide = np.vstack([enters[::-1], own, leaving @ own[::-1][:5]])
        faces = np.array([node, *(weights @ wide[j : j + 5] for j in range(1, cells)), goes[wave]])
        rates.append((faces[:-1] - faces[1:])[:: -1 if wave else 1])
    return np.vstack(rates)


def test_a_closure_from_cells_alone_grows_and_the_closure_with_the_value_of_the_node_does_not():
    cells = 8
    travel = LENGTH / cells / SPEED
    matrix = explicit_rates(cells, -1.0, 1.0, datum=False)
    found, vectors = np.linalg.eig(matrix)
    rate = found.real.max()
    assert 1e-4 < rate < 0.1
    until = math.log(THRESHOLD) / rate
    start = np.ascontiguousarray(vectors[:, np.argmax(found.real)].real)
    states = fvsolve.integrate(lambda t, y: matrix @ y, start, [0.0, until], "rk4", step=0.1)
    assert np.linalg.norm(states[-1]) > 0.3 * THRESHOLD * np.linalg.norm(start)
    model = lossless(cells, "upwind5", "rk4", travel)
    ours = travel * model.jacobian(0.0, np.zeros(2 * cells))
    assert ours == pytest.approx(explicit_rates(cells, -1.0, 1.0, datum=True), abs=1e-6)
    assert np.linalg.eigvals(ours).real.max() < 1e-9
    steps = round(until / 0.1)
    start = worst_start(model, "rk4", 0.1 * scaled(model, ours), steps)
    assert measured_growth(lossless(cells, "upwind5", "rk4", 0.1 * travel, steps), start) < 2.0


def test_the_closure_from_a_single_side_grows_in_every_short_pipe_and_ours_in_none():
    for cells in range(5, 25):
        for left, right in ((-1.0, 1.0), (-1.0, -1.0), (1.0, 1.0)):
            assert (
                np.linalg.eigvals(explicit_rates(cells, left, right, datum=True)).real.max() < 1e-9
            ), (
                cells,
                left,
                right,
            )
    assert all(
        np.linalg.eigvals(explicit_rates(n, -1.0, 1.0, datum=False)).real.max() > 1e-6
        for n in range(5, 25)
    )


# fronts ------------------------------------------------------------------------------------------------------------


def tvd_courant(limiter: str) -> float:
    """Courant number 2 / (2 + phi) up to which Euler keeps the variation (Harten), phi the greatest slope ratio."""
    steepest = max(limited(CODES[limiter], 1.0, r) for r in np.geomspace(1.0, 1e9, 91))
    return 2.0 / (2.0 + steepest)


def crossed(heights, steps: int, method: str, courant: float, scheme: str, limiter: str) -> float:
    """Relative increase of total variation of a forward wave that crosses part of a pipe."""
    cells = 60
    h = courant * LENGTH / cells / SPEED
    nodes = {"one": lake(50.0), "two": lake(50.0)}
    links = {"main": pipe("one", "two", LENGTH, DIAMETER, SPEED, cells)}
    numerics = {"scheme": scheme, "limiter": limiter, "method": method, "step": h}
    model = study_model(scene(nodes, links, steps * h, numerics, ["main.flow"], steps * h))
    y = np.zeros(model.y_size)
    y[18 : 18 + len(heights)] = heights
    before, after = (
        np.abs(np.diff(np.pad(v[:cells], 1))).sum() for v in (y, outcome(model, y=y).y)
    )
    return float(after / before - 1.0)


def more_variation(
    method: str, courant: float, scheme: str = "muscl", limiter: str = "minmod"
) -> float:
    """Greatest increase of total variation of fronts of several heights."""
    draws = [
        np.random.default_rng(seed).choice([0.0, 0.25, 0.5, 1.0, 2.0], 16) for seed in range(1, 6)
    ]
    fronts = zip([np.ones(16), *draws], (12, 1, 1, 5, 5, 12), strict=True)
    return max(
        crossed(heights, steps, method, courant, scheme, limiter) for heights, steps in fronts
    )


@pytest.mark.parametrize("limiter", CODES)
def test_euler_with_a_limiter_overshoots_just_above_the_courant_number_that_its_steepness_predicts(
    limiter,
):
    limit = tvd_courant(limiter)
    assert more_variation("euler", 0.99 * limit, limiter=limiter) < 1e-12
    assert more_variation("euler", 1.15 * limit, limiter=limiter) > 1e-3
    assert (
        more_variation("ssp-rk3", 0.99 * limit * analyse("ssp-rk3").ssp_radius, limiter=limiter)
        < 1e-12
    )


def test_unlimited_slopes_overshoot_at_any_step_and_limited_ones_below_their_courant_number_do_not():
    for courant in (0.1, 0.3, 0.5):
        assert more_variation("ssp-rk3", courant, scheme="fromm") > 0.02
        assert more_variation("ssp-rk3", courant, limiter="van-leer") < 1e-12


def minmod_rate(u: np.ndarray) -> np.ndarray:
    """h du/dt of a forward wave at Courant 1 with minmod slopes."""
    d = np.diff(u, prepend=u[0], append=u[-1])
    a, b = d[:-1], d[1:]
    slope = np.where(a * b > 0, np.where(np.abs(a) < np.abs(b), a, b), 0.0)
    return -np.diff(u + 0.5 * slope, prepend=0.0)


def test_a_method_without_ssp_radius_overshoots_where_its_ssp_twin_of_the_same_stability_function_does_not():
    array = "0 | 0 0\n1/10 | 1/10 0\n--\n| -4 5"
    fvsolve.tableau("short-midpoint", array, source="order 2 for any c, negative weight below 1/2")
    mine, good = analyse("short-midpoint"), analyse("ssp-rk2")
    assert mine.order == good.order == 2 and (mine.ssp_radius, good.ssp_radius) == (0.0, 1.0)
    assert mine.stability_function.numerator == good.stability_function.numerator
    heights, courant = np.array([0.9, 0.9, 1.0, 0.1, 0.1]), 0.9 * tvd_courant("minmod")
    u = np.pad(heights, 6)
    k = minmod_rate(u)
    new = u + courant * (-4 * k + 5 * minmod_rate(u + 0.1 * courant * k))
    predicted = np.abs(np.diff(new)).sum() / np.abs(np.diff(u)).sum() - 1.0
    found = crossed(heights, 1, "short-midpoint", courant, "muscl", "minmod")
    assert found == pytest.approx(predicted, abs=1e-12) and found > 0.05
    assert crossed(heights, 1, "ssp-rk2", courant, "muscl", "minmod") < 1e-12
    assert more_variation("ssp-rk2", courant) < 1e-12


def test_no_ssp_radius_is_no_sentence():
    fvsolve.tableau(
        "gottlieb-shu", "0 | 0 0\n-20 | -20 0\n--\n| 41/40 -1/40", source="Gottlieb and Shu 1998"
    )
    assert analyse("gottlieb-shu").ssp_radius == 0.0
    assert more_variation("gottlieb-shu", 0.9 * tvd_courant("minmod")) < 1e-12


# landing on output times -------------------------------------------------------------------------------------------


def struck(velocity: float = 1.0, every: float = 0.01, shut: float = 0.0411, **changed) -> dict:
    """Case of a frictionless pipe whose flow stops at once; upwind and Euler at Courant 1."""
    supply = 2 * AMBIENT + 2 * RHO * SPEED * velocity
    nodes = {
        "lake": reservoir(supply),
        "gate": junction(step(shut, velocity * area(DIAMETER), 0.0)),
    }
    links = {"main": pipe("lake", "gate", 400.0, DIAMETER, SPEED, 40)}
    return scene(nodes, links, 3.0, SHARP, ["gate.pressure"], every, **changed)


def square_wave(t: np.ndarray, shut: float) -> np.ndarray:
    """Pressure at the gate relative to the lake, over rho a v."""
    return np.where(t < shut, 0.0, 1.0 - 2.0 * (np.floor((t - shut) / 0.8) % 2))


def clear(t: np.ndarray, shut: float) -> np.ndarray:
    """True for times at least three steps away from each front."""
    return np.abs((t - shut + 0.4) % 0.8 - 0.4) > 0.03


def upwind_pressure(steps: np.ndarray, cells: int = 40) -> np.ndarray:
    """Gate pressure over rho a v after steps of given Courant numbers, in the closed pipe with its whole flow.

    r enters with -l at the lake, l with r at the gate; in units where rho a v is 1, r - l = 1 at the start.
    """
    r, l, found = np.full(cells, 0.5), np.full(cells, -0.5), []  # noqa: E741
    for c in steps:
        r, l = r - c * np.diff(np.r_[-l[0], r]), l + c * np.diff(np.r_[l, r[-1]])  # noqa: E741
        found.append(2.0 * r[-1])
    return np.array(found)


def test_landing_on_output_times_spoils_the_exact_wave_as_predicted_and_dense_output_does_not():
    travel, every, jump = 0.01, 0.013, RHO * SPEED
    model = fvsolve.build(load(struck(shut=0.0)))
    state, landed = fvsolve.initial_state(model), []
    times = np.arange(1, 200) * every
    for t in times:  # advance ends at t, like a program that shortens steps for its rows
        state = fvsolve.advance(model, state, t)
        landed.append(model.observe(t, state.y)[0])
    supply = 2 * AMBIENT + 2 * jump
    landed = (np.array(landed) - supply) / jump
    fractions = np.tile([1.0, every / travel - 1.0], len(times))
    predicted = upwind_pressure(fractions)[1::2]
    assert np.max(np.abs(landed - predicted)) < 1e-9
    wrong = np.max(np.abs(landed - square_wave(times, 0.0))[clear(times, 0.0)])
    assert wrong > 0.4
    for interval in (every, 0.1, 0.0031):
        kept = fvsolve.run(struck(every=interval))
        t = np.asarray(kept.t)
        error = np.abs((kept["gate.pressure"] - supply) / jump - square_wave(t, 0.0411))
        assert np.max(error[clear(t, 0.0411)]) < 1e-9


# below vapour pressure ---------------------------------------------------------------------------------------------


def falling(velocity: float, closure: float = 0.0, **numerics) -> dict:
    """Case of water stopped in a pipe at 3 bar; the wave returns to the gate with rho a v below this pressure."""
    flow, shut = velocity * area(DIAMETER), 0.1
    demand = step(shut, flow, 0.0) if closure == 0.0 else ramp(shut, closure, flow, 0.0)
    nodes = {"lake": reservoir(3e5), "gate": junction(demand)}
    links = {"main": pipe("lake", "gate", 400.0, DIAMETER, SPEED, 40)}
    return scene(nodes, links, 2.0, {**SHARP, **numerics}, ["gate.pressure"], 0.01)


# [Pa], and velocity whose rho a v reaches it [m/s]
VAPOUR, LIMIT = 2300.0, (3e5 - 2300.0) / (RHO * SPEED)


def test_pressure_below_vapour_pressure_is_marked_at_the_gate_when_the_wave_is_back():
    assert not fvsolve.run(falling(0.999 * LIMIT)).marks
    marks = fvsolve.run(falling(1.001 * LIMIT)).marks
    first = min(marks, key=lambda mark: mark.time)
    back, travel = 0.1 + 2 * 400.0 / SPEED, 400.0 / SPEED / 40
    assert first.what == "below vapor pressure" and first.place in ("nodes.gate", "links.main")
    assert abs(first.time - back) <= 1.01 * travel
    assert "nodes.gate" in [mark.place for mark in marks] and "nodes.lake" not in [
        mark.place for mark in marks
    ]


def test_below_vapour_the_run_can_be_stopped_and_a_slow_closure_needs_no_mark():
    stopped = fvsolve.run(falling(1.001 * LIMIT, below_vapor="stop"))
    back = 0.1 + 2 * 400.0 / SPEED
    assert (
        not stopped.ok
        and "vapour" in stopped.reason
        and stopped.t[-1] == pytest.approx(back, abs=0.03)
    )
    assert not fvsolve.run(falling(1.001 * LIMIT, closure=4 * 2 * 400.0 / SPEED)).marks


@pytest.mark.parametrize(
    "factor, courant, grows", [(0.05, 1.0, False), (0.05, 0.9, False), (400.0, 1.0, True)]
)
def test_upwind_with_euler_at_courant_1_takes_friction_up_to_twice_the_flow_in_a_step(
    factor, courant, grows
):
    """Friction of the waves that enter a cell multiplies the flow by 1 - h g in a step: no growth up to h g = 2.

    With g = f v / D of steady friction; friction of the cell's own waves grew at Courant number 1 however small.
    """
    nodes = {"lake": lake(50.0), "gate": junction(step(1.0, 0.2, 0.19))}
    friction = {"model": "steady", "factor": factor}
    links = {"main": pipe("lake", "gate", 300.0, 0.3, 1000.0, 20, friction=friction)}
    numerics = {"scheme": "upwind", "method": "euler", "courant": courant}
    case = scene(nodes, links, 60.0, numerics, ["main.flow@0.5"], 0.5)
    h, g = 15.0 / 1000.0 * courant, factor * (0.2 / (math.pi / 4 * 0.3**2)) / 0.3
    before, result = step_limits(study_model(case)), fvsolve.run(case)
    assert (h * g > 2.0) is grows and bool(before) is grows
    assert result.ok is not grows
