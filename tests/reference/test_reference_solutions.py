"""Comparisons of the reference solutions with each other, with quadrature and with integration."""

import math

import numpy as np
import pytest
from pytest import approx
from scipy.integrate import quad, solve_ivp

from reference import vessels
from reference.characteristics import Line, Network, ValvePipe, darcy, hazen_williams, laminar
from reference.frictionless import Pipe, Rays, held, relative_drop, step
from reference.log_law import LogFluid, Riemann, SimpleWave
from reference.orders import gaussian_averages, observed_order, scattered

RHO, A, D, L = 1000.0, 1000.0, 0.3, 1000.0
AREA = math.pi / 4 * D**2


def closing(t: float) -> float:
    return 0.004 * (1.0 if t < 0 else max(0.0, 1 - t / 5.0) ** 1.5)


def valve_pipe(gradient=lambda m: 0.0 * m) -> ValvePipe:
    return ValvePipe(L, D, A, RHO, gradient, 1.1e6, 1e5, closing)


def test_observed_order_of_a_constructed_error_is_its_order():
    h = np.array([0.4, 0.2, 0.1])
    assert observed_order(3.0 * h**2.5, h) == approx(2.5, abs=1e-12)


def test_characteristics_rays_and_allievi_agree_on_a_closing_valve():
    case = valve_pipe()
    m = case.steady_mass_flow()
    t, p = case.valve_pressure(50, 12.0)
    pipe = Pipe("lake", "gate", L, D, A, m / RHO, 1.1e6)
    rays = Rays(RHO, {"main": pipe}, {"lake": held(1.1e6)}, outlets={"gate": (closing, 1e5)})
    traced = np.array([rays.pressure("gate", s) for s in t])
    assert np.max(np.abs(p - traced)) < 1e-10 * 1e6

    times = 2.0 * np.arange(7)
    drops = relative_drop(A * m / AREA / (2 * 1e6), [closing(s - 1e-12) / 0.004 for s in times])
    assert 1e5 + 1e6 * np.array(drops) == approx(traced[::100], rel=1e-9)


def test_friction_characteristics_are_second_order():
    case = valve_pipe(darcy(0.02, D, RHO))
    _, best = case.richardson(800, 4.0)
    errors = [
        np.max(np.abs(case.valve_pressure(n, 4.0)[1][:: n // 50] - best[::16])) for n in (100, 200)
    ]
    assert observed_order(errors, [2.0, 1.0]) == approx(2.0, abs=0.25)
    assert errors[-1] < 1e-4 * 1e6


def test_steady_flow_of_the_characteristics_balances_the_drops():
    case = valve_pipe(darcy(0.02, D, RHO))
    m = case.steady_mass_flow()
    v = m / RHO / AREA
    lost = 0.02 * L / D * RHO * v**2 / 2
    through = RHO / 2 * (m / RHO / 0.004) ** 2
    assert lost + through == approx(1e6, rel=1e-12)


def test_gradients_are_the_textbook_ones():
    v = 1.3
    m = RHO * AREA * v
    assert darcy(0.02, D, RHO)(m) == approx(0.02 / D * RHO * v**2 / 2)
    assert laminar(1e-3, D, RHO)(m) == approx(64 / (RHO * v * D / 1e-3) / D * RHO * v**2 / 2)
    q, c = AREA * v, 110.0
    per_metre = 10.67 * q**1.852 / (c**1.852 * D**4.8704)
    assert hazen_williams(c, D, RHO)(m) / (RHO * 9.80665) == approx(per_metre, rel=5e-3)


def test_rays_through_a_junction_scatter_by_impedances():
    pipes = {
        "one": Pipe("a", "mid", 100.0, 0.3, 1000.0),
        "two": Pipe("mid", "b", 300.0, 0.2, 1100.0),
        "three": Pipe("mid", "c", 300.0, 0.25, 900.0),
    }
    rays = Rays(RHO, pipes, {"a": step(0.01, 0.0, 1.0), "b": held(0.0), "c": held(0.0)})
    back, passed = scattered([p.impedance for p in pipes.values()])
    assert rays.pressure("mid", 0.15) == approx(1 + back)
    assert rays.inside("one", 0.5, 0.18)[0] == approx(1 + back)
    assert [rays.inside(n, 0.1, 0.2)[0] for n in ("two", "three")] == approx(passed)


def test_rays_keep_the_mass_of_a_pipe():
    pipes = {"one": Pipe("a", "b", 100.0, 0.3, 1000.0)}
    rays = Rays(
        RHO,
        pipes,
        {"a": held(0.0)},
        demands={"b": lambda t: 0.01 * math.sin(20 * t) ** 2 if t > 0 else 0.0},
    )

    def stored(t: float) -> float:
        return (
            quad(lambda s: rays.inside("one", s, t)[0], 0, 1, limit=200)[0]
            * 100.0
            * pipes["one"].impedance ** -1
            / 1000.0
        )

    assert pipes["one"].impedance == approx(1000.0 / (math.pi / 4 * 0.09))
    net = quad(
        lambda t: RHO * (rays.inside("one", 0, t)[1] - rays.inside("one", 1, t)[1]),
        0,
        0.35,
        limit=400,
    )[0]
    assert stored(0.35) == approx(net, rel=1e-6)


def test_gaussian_averages_are_those_of_quadrature():
    edges = np.linspace(0, 10, 12)
    by_quad = [
        quad(lambda x: math.exp(-((x - 4) ** 2)), a, b)[0] / (b - a)
        for a, b in zip(edges, edges[1:], strict=False)
    ]
    assert gaussian_averages(edges, 4.0, 1.0) == approx(by_quad, rel=1e-10)


SOFT = LogFluid(1000.0, 1e5, 1e5)


@pytest.mark.parametrize(
    "left, right",
    [
        ((1.3e5, 0.0), (1e5, 0.0)),
        ((1e5, 1.0), (1e5, -1.0)),
        ((1e5, -1.0), (1.1e5, 1.0)),
        ((0.9e5, 0.5), (1.2e5, -0.3)),
    ],
    ids=["dam", "clash", "parting", "mixed"],
)
def test_exact_riemann_solution_conserves_mass_and_momentum(left, right):
    riemann, span = Riemann(SOFT, left, right), 20.0
    p, u = riemann.middle()
    breaks = sorted([u] + [s * 1.0 for s in _wave_edges(riemann)])

    def total(field) -> float:
        cuts = [-span, *breaks, span]
        return sum(
            quad(lambda x: field(*riemann.at(x)), a, b, epsrel=1e-12)[0]
            for a, b in zip(cuts, cuts[1:], strict=False)
        )

    rho_l, rho_r = SOFT.rho(left[0]), SOFT.rho(right[0])
    mass = span * (rho_l + rho_r) - (rho_r * right[1] - rho_l * left[1])
    momentum = span * (rho_l * left[1] + rho_r * right[1]) - (
        rho_r * right[1] ** 2 + right[0] - rho_l * left[1] ** 2 - left[0]
    )
    assert total(lambda q, v: SOFT.rho(q)) == approx(mass, rel=1e-10)
    assert total(lambda q, v: SOFT.rho(q) * v) == approx(momentum, abs=1e-7 * rho_l * 10 * span)


def _wave_edges(riemann: Riemann) -> list[float]:
    p, u = riemann.middle()
    edges = []
    for sign, (p0, u0) in ((-1, riemann.left), (1, riemann.right)):
        if p > p0:
            edges.append(u0 + sign * SOFT.shock_speed(p, p0))
        else:
            edges += [u0 + sign * SOFT.c(p0), u + sign * SOFT.c(p)]
    return edges


def test_a_stopped_stream_exceeds_joukowsky_by_a_quarter_of_its_mach_number():
    for mach in (0.01, 0.05):
        c = float(SOFT.c(1e5))
        jump = SOFT.stopped(1e5, mach * c) - 1e5
        assert jump / (1000.0 * c * mach * c) - 1 == approx(mach / 4, rel=2 * mach)


def test_a_simple_wave_satisfies_the_balance_laws():
    wave = SimpleWave(
        SOFT,
        1e5,
        lambda x: 0.5 * np.exp(-((x - 20) ** 2) / 9),
        lambda x: -(x - 20) / 9 * np.exp(-((x - 20) ** 2) / 9),
    )
    edges, dt = np.linspace(0, 160, 8001), 1e-3
    t = 0.5 * wave.breaks(edges)
    (rho0, m0), (rho, m), (rho1, m1) = (wave.averages(edges, s) for s in (t - dt, t, t + dt))
    dx = edges[1] - edges[0]
    pressure = SOFT.p(rho)
    mass = (rho1 - rho0) / (2 * dt) + np.gradient(m, dx)
    momentum = (m1 - m0) / (2 * dt) + np.gradient(m**2 / rho + pressure, dx)
    assert np.max(np.abs(mass)) < 1e-3 * np.max(np.abs(np.gradient(m, dx)))
    assert np.max(np.abs(momentum)) < 1e-3 * np.max(np.abs(np.gradient(pressure, dx)))


@pytest.mark.parametrize("area, growth", [(2.0, 0.0), (0.5, 1.5)], ids=["prism", "tapered"])
def test_draining_forms_agree_with_integration(area, growth):
    k = 0.01 * math.sqrt(2 * vessels.GRAVITY)
    end = 0.95 * (2 * area * math.sqrt(2) + 2 / 3 * growth * 2**1.5) / k
    run = solve_ivp(
        lambda t, h: -k * np.sqrt(h) / (area + growth * h),
        (0, end),
        [2.0],
        "DOP853",
        rtol=1e-12,
        atol=1e-14,
    )
    assert vessels.tapered(area, growth, 0.01, 2.0, [end])[0] == approx(run.y[0, -1], rel=1e-9)
    if growth == 0:
        assert vessels.prism(area, 0.01, 2.0, [end])[0] == approx(run.y[0, -1], rel=1e-9)


def test_filling_form_agrees_with_integration():
    k = 1e9 / 0.2 * 1e-5 * math.sqrt(2 / RHO)
    run = solve_ivp(lambda t, d: -k * np.sqrt(d), (0, 0.5), [1e6], "DOP853", rtol=1e-12, atol=1e-9)
    assert vessels.filling(0.2, 1e9, 1e-5, RHO, 1e6, [0.5])[0] == approx(run.y[0, -1], rel=1e-9)


def test_network_characteristics_are_those_of_a_single_pipe():
    case = valve_pipe(darcy(0.02, D, RHO))
    m, k = case.steady_mass_flow(), float(darcy(0.02, D, RHO)(np.float64(1.0)))
    line = Line("lake", "gate", L, D, k)
    net = Network([line], 2.0, A, RHO, "lake", 1.1e6, "gate", 1e5)
    pressures, flows = net.steady(m)
    assert pressures["gate"] == approx(1e5 + (m / 0.004) ** 2 / (2 * RHO), rel=1e-10)
    t, p = net.gate_pressure(m, lambda s: closing(s) / 0.004, 20.0, 6.0)
    assert p == approx(case.valve_pressure(50, 6.0)[1], abs=0.1)


def test_steady_flows_of_a_loop_balance_at_every_node_and_around_it():
    rows = [
        ("r", "a", 300.0, 0.4),
        ("a", "b", 500.0, 0.3),
        ("a", "g", 400.0, 0.2),
        ("b", "g", 300.0, 0.25),
    ]
    lines = [Line(*row, 0.5 / row[3] ** 5) for row in rows]
    p, m = Network(lines, 1.852, A, RHO, "r", 1e6, "g", 1e5).steady(50.0)
    assert [m[0], m[1] + m[2], m[3] + m[2]] == approx([50.0, 50.0, 50.0], rel=1e-12)
    assert m[1] == approx(m[3], rel=1e-12)
    for (a, b, length, _), line, flow in zip(rows, lines, m, strict=True):
        drop = line.friction * length * abs(flow) ** 0.852 * flow
        assert {**p, "r": 1e6}[a] - p[b] == approx(drop, rel=1e-9)


def rusanov(
    rho: np.ndarray, flux: np.ndarray, dx: float, end: float
) -> tuple[np.ndarray, np.ndarray]:
    """Density and mass flux of the balance laws by the scheme of Rusanov, without wave curves or invariants."""
    u, t = np.array([rho, flux]), 0.0
    while t < end:
        speed = np.abs(u[1] / u[0]) + np.sqrt(SOFT.bulk_modulus / u[0])
        dt = min(0.9 * dx / speed.max(), end - t)
        f = np.array([u[1], u[1] ** 2 / u[0] + SOFT.p(u[0])])
        most = np.maximum(speed[1:], speed[:-1])
        face = (f[:, 1:] + f[:, :-1]) / 2 - most * (u[:, 1:] - u[:, :-1]) / 2
        u[:, 1:-1] -= dt / dx * np.diff(face, axis=1)
        t += dt
    return u[0], u[1]


@pytest.mark.parametrize("left, right", [((1.3e5, 0.0), (1e5, 0.0)), ((1e5, -1.0), (1.1e5, 1.0))])
def test_the_exact_riemann_solution_is_the_limit_of_a_crude_scheme(left, right):
    riemann, errors = Riemann(SOFT, left, right), []
    for cells in (800, 1600):
        x = (np.arange(cells) + 0.5) / cells * 40 - 20
        rho = np.where(x < 0, SOFT.rho(left[0]), SOFT.rho(right[0]))
        found = rusanov(rho, rho * np.where(x < 0, left[1], right[1]), 40 / cells, 1.2)
        exact = np.array(
            [(SOFT.rho(p), SOFT.rho(p) * u) for p, u in (riemann.at(s / 1.2) for s in x)]
        ).T
        errors.append(np.mean(np.abs(found[1] - exact[1])) / np.ptp(exact[1]))
    assert errors[1] < 0.02
    assert observed_order(errors, [2.0, 1.0]) > 0.4


def test_the_simple_wave_is_the_limit_of_a_crude_scheme():
    def velocity(x):
        return 2.0 * np.exp(-(((x - 15) / 3) ** 2))

    wave, errors = SimpleWave(SOFT, 1e5, velocity, lambda x: -2 * (x - 15) / 9 * velocity(x)), []
    for cells in (1600, 3200):
        edges = np.linspace(0, 50, cells + 1)
        found = rusanov(*wave.averages(edges, 0.0), 50 / cells, 1.0)
        exact = wave.averages(edges, 1.0)
        errors.append(np.mean(np.abs(found[0] - exact[0])) / np.ptp(exact[0]))
    assert errors[1] < 0.02
    assert observed_order(errors, [2.0, 1.0]) == approx(1.0, abs=0.2)
