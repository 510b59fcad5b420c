"""Kernels of pressure waves in a liquid: modes of a box, sides that reflect or move, vortices, Riemann problems."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from pytest import approx
from reference.basins import model_of
from reference.liquid_boxes import RHO, SCHEMES, WALLS, Box, C, noise
from reference.log_law import LogFluid, Riemann, SimpleWave
from reference.orders import mean_error, observed_order
from reference.scenes import NO_FRICTION, junction, reservoir, scene, stiff_pipe
from scipy.integrate import quad_vec
from scipy.interpolate import CubicSpline
from scipy.special import j0

import fvsolve
from fvsolve.features.basins.cell_sides import BLOCK, MEASURES, NX, NY, REACH
from fvsolve.features.basins.liquid.grid_nonlinear import log1p_vector
from fvsolve.features.basins.liquid.liquid_mesh import ROWS, add_side_linear, add_side_linear_moving

ORDERS = {"upwind": 1, "muscl": 2, "upwind5": 5, "weno5": 5}


def mode(box: Box, m: int, n: int, t: float):
    """Standing mode of a box with rigid walls, frequency C/2 sqrt((m/Lx)^2 + (n/Ly)^2)."""
    a, b = m * math.pi / box.size[0], n * math.pi / box.size[1]
    omega = 2 * math.pi * C / 2 * math.hypot(m / box.size[0], n / box.size[1])
    s = math.sin(omega * t) * C**2 / omega

    def field_at(x, y):
        return (
            np.cos(a * x) * np.cos(b * y) * math.cos(omega * t),
            s * a * np.sin(a * x) * np.cos(b * y),
            s * b * np.cos(a * x) * np.sin(b * y),
        )

    return box.averages(field_at)


def order(box: Box, exact, end: float, sizes, courant: float = 0.5) -> float:
    """Observed order against exact(box, end) from exact(box, 0), with nx and ny refined equally and smaller steps."""
    errors = []
    for n in sizes:
        finer = replace(box, nx=n, ny=box.ny * n // box.nx if box.ny > 1 else 1)
        found = finer.run(exact(finer, 0.0), end, courant * (sizes[0] / n) ** 0.25)
        errors.append(mean_error(found, exact(finer, end)))
    return observed_order(errors, [1 / n for n in sizes])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_standing_modes_of_a_box_converge_at_the_order_of_the_scheme(scheme):
    """The modes have periods of 0.12 s and 0.08 s."""
    box = Box(4, 3, scheme, (1.0, 0.75))
    sizes, end, courant = ((16, 32), 0.1, 0.1) if ORDERS[scheme] == 5 else ((64, 128), 0.03, 0.5)
    for m, n in ((1, 1), (2, 1)):
        found = order(
            box, lambda b, t, m=m, n=n: mode(b, m, n, t), end, [m * k for k in sizes], courant
        )
        assert found == approx(ORDERS[scheme], abs=0.1)


@pytest.mark.parametrize("scheme", ["muscl", "upwind5"])
def test_on_graded_cells_every_scheme_is_second_order(scheme):
    """Widths of cells are 0.5 to 1.5 of the mean in both directions."""
    box = Box(4, 3, scheme, (1.0, 0.75), stretch=0.5)
    assert order(box, lambda b, t: mode(b, 1, 1, t), 0.03, (64, 128)) == approx(2, abs=0.1)


def wave(box: Box, at: float, way: float) -> np.ndarray:
    """Pulse at x = `at` that travels east (way 1) or west (-1)."""
    return box.averages(
        lambda x, y: np.exp(-(((x - at) / 6) ** 2)) * np.array([1.0, way * C, 0.0])[:, None, None]
    )


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_plane_wave_is_carried_unchanged(scheme):
    box = Box(4, 1, scheme, (100.0, 1.0))
    sizes, end = (
        {1: (800, 1600), 2: (800, 1600), 5: (200, 400)}[ORDERS[scheme]],
        0.3 if scheme == "upwind" else 3.0,
    )
    assert order(box, lambda b, t: wave(b, 35.0 + C * t, 1.0), end, sizes) == approx(
        ORDERS[scheme], abs=0.1
    )


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_row_of_cells_is_a_pipe(scheme):
    """Rates are equal to rounding inside; after reflections at a reservoir and a dead end, so are errors to 2 %."""
    n, length, diameter = 200, 100.0, 0.5
    section = math.pi / 4 * diameter**2
    fluid = {
        "name": "user",
        "density": RHO,
        "bulk_modulus": RHO * C**2,
        "viscosity": 1e-3,
        "vapor_pressure": 100.0,
    }
    numerics = {"scheme": scheme, "limiter": "monotonized-central", "method": "rk4", "courant": 0.5}
    nodes = {"left": reservoir(101325.0), "right": junction()}
    links = {"main": stiff_pipe("left", "right", length, diameter, n, friction=NO_FRICTION)}
    case = scene(
        nodes, links, 10.0, numerics, ["right.pressure"], 0.1, fluid=fluid | {"law": "linear"}
    )
    model = model_of(case)
    box = Box(n, 1, scheme, (length, 1.0), reflect=np.array([-1.0] + [1.0] * (1 + 2 * n)))

    def of_waves(y):
        return np.array([(y[:n] + y[n:]) / C, y[:n] - y[n:]]) / section

    start = wave(box, 40.0, 1.0) + 0.3 * wave(box, 60.0, -1.0)
    y = section * np.concatenate([C * start[0, 0] + start[1, 0], C * start[0, 0] - start[1, 0]]) / 2
    rates, inside = box.rates(start)[0][:2, 0], slice(3, n - 3)
    assert of_waves(model.rhs(0.0, y))[:, inside] == approx(
        rates[:, inside], abs=1e-14 * np.abs(rates).max()
    )
    state = fvsolve.initial_state(model)
    state.y[:] = y
    exact = (wave(box, 70.0, -1.0) - 0.3 * wave(box, 30.0, 1.0))[:2, 0]
    found = box.run(start, 9.0, 0.5)[:2, 0]
    pipe = of_waves(fvsolve.advance(model, state, 9.0).y)
    errors = [mean_error(waves, exact) for waves in (found, pipe)]
    assert errors[0] == approx(errors[1], rel=0.02) and mean_error(found, pipe) < 0.1 * errors[0]


@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
@pytest.mark.parametrize("share", [1.0, 0.6, 0.0, -0.35, -1.0])
def test_a_side_sends_back_the_stated_share_of_a_wave(share, log):
    """A pulse arrives at the eastern side; `share` of it returns westwards, and nothing else remains."""
    box = Box(
        200, 1, "upwind5", (100.0, 1.0), log=log, reflect=np.array([1.0, share] + [1.0] * 400)
    )
    small = 1e-6 if log else 1.0
    found = box.run(small * wave(box, 60.0, 1.0), 8.0) / small
    assert np.abs(found - share * wave(box, 60.0, -1.0)).max() / C < 1.2e-4 * abs(share) + 1e-9


def share(rng) -> float:
    """Random reflection factor: of a wall, an open side, a given pressure, or between them."""
    return rng.uniform(-1.0, 1.0) if rng.random() < 0.5 else float(rng.integers(-1, 2))


def shares(box: Box, seed: int = 3) -> np.ndarray:
    """Random reflection factors, another one for each side and for a patch in the eastern side."""
    rng = np.random.default_rng(seed)
    counts = (box.ny, box.ny, box.nx, box.nx)
    found = np.repeat([share(rng) for _ in counts], counts)
    first, last = sorted(rng.integers(box.ny, 2 * box.ny + 1, 2))
    found[first:last] = share(rng)
    return found


def holed(box: Box, seed: int) -> np.ndarray:
    """Reflection factors of walls with a patch at a random place."""
    rng = np.random.default_rng(seed)
    found = np.ones(2 * (box.nx + box.ny))
    first, last = sorted(rng.integers(0, found.size + 1, 2))
    found[first:last] = share(rng)
    return found


@pytest.mark.parametrize("scheme", ["upwind", "upwind5"])
def test_no_mode_grows_whatever_the_sides_send_back(scheme):
    """Eigenvalues of linear schemes have no positive real part, to 1e-12 per travel time of a cell."""
    worst = []
    for nx, ny in (
        ((5, 5), (8, 6), (6, 11)) if scheme == "upwind5" else ((1, 1), (1, 4), (3, 2), (8, 6))
    ):
        box = Box(nx, ny, scheme, (nx, ny))
        scale = np.repeat([1.0, C, C], nx * ny)
        units = (np.eye(scale.size) * scale).reshape(-1, 3, ny, nx)
        for sides in (WALLS, *(kind(box, seed) for seed in range(10) for kind in (shares, holed))):
            matrix = [replace(box, reflect=sides).rates(unit)[0].ravel() / scale for unit in units]
            worst.append(np.linalg.eigvals(np.array(matrix)).real.max() / C)
    assert max(worst) < 1e-12


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
def test_noise_between_any_sides_dies_away(scheme, log):
    for nx, ny in ((1, 1), (2, 3), (4, 6), (12, 9)):
        box = Box(nx, ny, scheme, (nx, ny), log=log, limiter="van-leer")
        box = replace(box, reflect=shares(box))
        start = noise(box, 0.02)
        soon = box.run(start, 5.0)
        states = start, soon, box.run(soon, 45.0)
        energy = [((C * s[0]) ** 2 + s[1] ** 2 + s[2] ** 2).sum() for s in states]
        assert energy[2] < energy[1] < 0.1 * energy[0]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_round_pulse_stays_round(scheme):
    """Errors against Hankel's integral, and their difference between axes and diagonals, fall at the order."""

    def height(r, t):
        return quad_vec(
            lambda k: k / 2 * np.exp(-k * k / 4) * np.cos(C * k * t) * j0(k * r),
            0.0,
            16.0,
            epsrel=1e-12,
        )[0]

    radii, end = np.linspace(0.0, 9.0, 500), 0.15
    shape = {t: CubicSpline(radii, height(radii, t)) for t in (0.0, end)}

    def exact(box, t):
        return box.averages(lambda x, y: (shape[t](np.hypot(x - 6, y - 6)), 0 * x, 0 * x))[0]

    parts, errors = [], []
    for n in (96, 192):
        box = Box(n, n, scheme, (12.0, 12.0))
        start = np.zeros((3, n, n))
        start[0] = exact(box, 0.0)
        miss = np.abs(box.run(start, end, 0.2)[0] - exact(box, end))
        x = np.abs(np.arange(n) + 0.5 - n / 2)
        angle = np.degrees(np.arctan2(*np.meshgrid(x, x)))
        axis, diagonal = (angle < 10) | (angle > 80), abs(angle - 45) < 10
        parts.append(abs(miss[axis].mean() - miss[diagonal].mean()))
        errors.append(miss.mean())
    assert np.log2(parts[0] / parts[1]) == approx(ORDERS[scheme], abs=0.3)
    assert np.log2(errors[0] / errors[1]) == approx(ORDERS[scheme], abs=0.2)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
def test_mirrored_and_rotated_liquids_stay_so_to_the_bit_and_conserve_mass(scheme, log):
    box = Box(7, 9, scheme, (7.0, 4.5), log=log)
    for sides in (WALLS, shares(box)):
        box = replace(box, reflect=sides)
        state = noise(box, 0.1)
        west, east, south, north = (
            np.split(sides, np.cumsum([9, 9, 7])) if sides.size else (WALLS,) * 4
        )
        turned = replace(
            box, nx=9, ny=7, size=(4.5, 7.0), reflect=np.concatenate([south, north, west, east])
        )
        mirrored = replace(box, reflect=np.concatenate([east, west, south[::-1], north[::-1]]))
        rates, rate = box.rates(state)
        found, same = turned.rates(state.transpose(0, 2, 1)[[0, 2, 1]])
        assert np.array_equal(found, rates.transpose(0, 2, 1)[[0, 2, 1]]) and same == rate
        sign = np.array([1.0, -1.0, 1.0])[:, None, None]
        found, same = mirrored.rates(sign * state[:, :, ::-1])
        assert np.array_equal(found, sign * rates[:, :, ::-1]) and same == rate
        if not sides.size:
            assert abs(rates[0].sum()) < 1e-15 * np.abs(rates[0]).sum()


@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
def test_rest_is_rest_and_the_rate_is_the_greatest_sum(log):
    box = Box(6, 5, "weno5", (3.0, 1.0), log=log, stretch=0.5)
    for sides in (WALLS, shares(box)):
        assert not replace(box, reflect=sides).rates(np.zeros((3, 5, 6)))[0].any()
    state = noise(box, 0.1)
    kx, ky = (1.0 / np.diff(e) for e in box.edges())
    c, u, v = C, 0.0, 0.0
    if log:
        c = C / np.sqrt(1 + state[0] / RHO)
        u, v = np.abs(state[1:]) / (RHO + state[0])
    assert box.rates(state)[1] == approx(((u + c) * kx + (v + c) * ky[:, None]).max(), rel=1e-14)


@pytest.mark.parametrize("nx, ny", list(itertools.product((1, 2, 3), (1, 2, 4))))
@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
def test_few_cells_between_walls_are_a_corner_of_their_mirror_images(nx, ny, log):
    box = Box(nx, ny, "upwind5", (nx, ny), log=log)
    state = noise(box, 0.1)
    images = state
    for axis, sign in ((2, [1.0, -1.0, 1.0]), (1, [1.0, 1.0, -1.0])):
        turned = np.array(sign)[:, None, None] * np.flip(images, axis)
        images = np.concatenate([images, turned, images, turned], axis)
    whole = replace(box, nx=4 * nx, ny=4 * ny, size=(4 * nx, 4 * ny)).rates(images)[0]
    assert np.array_equal(whole[:, :ny, :nx], box.rates(state)[0])


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5"])
def test_the_log_law_is_the_linear_law_for_small_waves(scheme):
    """The difference of the laws is of second order in the size of the waves."""
    box = Box(12, 9, scheme, (12, 9))
    apart = []
    for size in (1e-4, 1e-5):
        state = noise(box, size)
        apart.append(
            np.abs(replace(box, log=True).rates(state)[0] - box.rates(state)[0]).max(axis=(1, 2))
        )
    assert apart[0] / apart[1] == approx(100.0, rel=1e-3)


def test_the_logarithm_is_exact_to_round_off():
    y = np.concatenate([np.linspace(-0.5, 1.0, 1001), [1e-3, -1e-9, 3e-17]])
    assert [log1p_vector(v) for v in y] == approx(np.log1p(y), rel=1e-15, abs=0.0)


def vortex(box: Box, t: float, speed: float = 3.0, drift=(2.0, 1.0)) -> np.ndarray:
    """Gaussian vortex in a stream: 1 / rho rises by speed^2 exp(1 - r^2) / (2 K), so that dp/dr = rho u^2 / r."""
    x0, y0 = (size / 2 + d * t for size, d in zip(box.size, drift, strict=True))

    def field_at(x, y):
        x, y = x - x0, y - y0
        bell = np.exp(1 - x * x - y * y)
        rho = RHO / (1 + 0.5 * (speed / C) ** 2 * bell)
        return (
            rho - RHO,
            rho * (drift[0] - speed * np.sqrt(bell) * y),
            rho * (drift[1] + speed * np.sqrt(bell) * x),
        )

    return box.averages(field_at)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_vortex_is_carried_unchanged(scheme):
    """At Mach number 0.3 averages of products are not products of averages, so fifth order falls to second."""
    found = order(Box(4, 4, scheme, (10.0, 10.0), log=True, reflect=-1.0), vortex, 0.2, (96, 192))
    assert found == approx(min(ORDERS[scheme], 2), abs=0.15)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_an_advected_value_has_the_order_of_the_scheme(scheme):
    """Tangential velocity in a stream that enters and leaves at given pressure."""

    def exact(box, t):
        return box.averages(
            lambda x, y: (
                0 * x,
                RHO * 2.0 + 0 * x,
                RHO * np.exp(-(((x - 40.0 - 2.0 * t) / 6) ** 2)),
            )
        )

    box = Box(4, 1, scheme, (100.0, 1.0), log=True, reflect=-1.0)
    sizes = {1: (800, 1600), 2: (400, 800), 5: (100, 200)}[ORDERS[scheme]]
    assert order(box, exact, 2.0, sizes) == approx(ORDERS[scheme], abs=0.1)


FLUID = LogFluid(RHO, RHO * C**2, 0.0)
STATES = {
    "two shocks": ((0.0, 0.5), (0.0, -0.5)),
    "two rarefactions": ((0.0, -0.5), (0.0, 0.5)),
    "shock and rarefaction": ((1e4, 0.0), (0.0, 0.0)),
    "the mirror image": ((0.0, 0.0), (1e4, 0.0)),
    "moving, unequal": ((5e3, 1.0), (-5e3, 0.3)),
    "strong": ((4e4, 0.0), (-4e4, 0.0)),
}


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["muscl", "weno5"])
@pytest.mark.parametrize("name", STATES)
def test_exact_riemann_problems_of_the_log_law(name, scheme):
    """L1 errors of density and flow fall at the order that shocks and kinks permit."""
    left, right = STATES[name]
    exact, errors, end = Riemann(FLUID, left, right), [], 1.8

    def at(xi):
        p, u = exact.at(xi)
        return FLUID.rho(p) - RHO, FLUID.rho(p) * u, 0.0

    for n in (100, 200, 400):
        box = Box(n, 1, scheme, (100.0, 1.0), log=True, limiter="van-leer")
        x = (np.arange(n) + 0.5) * 100.0 / n - 50.0
        start = np.array([at(math.copysign(1e9, place)) for place in x]).T[:, None, :]
        found, inner = box.run(start, end, 0.5)[:, 0], abs(x) < 27.0
        rays = (x[inner, None] + 100.0 / n * ((np.arange(8) + 0.5) / 8 - 0.5)) / end
        averages = np.array([np.mean([at(xi) for xi in row], axis=0) for row in rays]).T
        errors.append(
            np.abs(found[:, inner] - averages).mean(axis=1)[:2] / RHO / np.array([1.0, C])
        )
    assert (errors[0] / errors[2] > 4**0.6).all() and (errors[2] < 4e-3).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_stream_is_stopped_by_a_wall_at_the_exact_pressure(scheme):
    """At 0.3 of the speed of sound the pressure is 8 % above Joukowsky's."""
    box, u = Box(200, 1, scheme, (100.0, 1.0), log=True), 3.0
    start = np.zeros((3, 1, 200))
    start[1] = RHO * u
    found = FLUID.p(RHO + box.run(start, 4.0)[0, 0, -20:])
    assert found.mean() == approx(FLUID.stopped(0.0, u), rel=2e-3 if scheme == "upwind" else 2e-5)


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("size", [0.05, 0.5])
def test_a_simple_wave_steepens_as_the_exact_solution(size, scheme):
    """At Mach number 0.005 the order is that of linear waves; at 0.05 products reduce fifth order to second."""

    def velocity(x):
        return size * np.exp(-(((x - 30) / 5) ** 2))

    flow = SimpleWave(FLUID, 0.0, velocity, lambda x: -2 * (x - 30) / 25 * velocity(x))

    def exact(box, t):
        rho, flux = flow.averages(box.edges()[0], t)
        return np.array([rho - RHO, flux, 0 * rho])[:, None, :]

    wanted = ORDERS[scheme] if size < 0.1 else min(ORDERS[scheme], 2)
    sizes, end = (
        ((100, 200), 3.0) if wanted == 5 else ((800, 1600), 0.3 if scheme == "upwind" else 3.0)
    )
    assert order(Box(4, 1, scheme, (100.0, 1.0), log=True), exact, end, sizes) == approx(
        wanted, abs=0.3
    )


SOUND, DENSITY = 1200.0, 998.0
# rows of the scratch of a block
RATE_MASS, RATE_X, RATE_Y = (slice(k * BLOCK, (k + 1) * BLOCK) for k in (3, 4, 5))


def block(random) -> tuple[np.ndarray, ...]:
    """Directions, reach, deviation of pressure over wave speed, and both flows of the cells of a block."""
    angle = random.uniform(0.0, 2.0 * np.pi, BLOCK)
    return (
        np.cos(angle),
        np.sin(angle),
        random.uniform(0.5, 2.0, BLOCK),
        *random.normal(0.0, 50.0, (3, BLOCK)),
    )


def measures(nx, ny, reach) -> np.ndarray:
    geometry = np.zeros(MEASURES * BLOCK)
    for k, values in ((NX, nx), (NY, ny), (REACH, reach)):
        geometry[k * BLOCK : (k + 1) * BLOCK] = values
    return geometry


def test_a_uniform_liquid_passes_a_moving_side_by_its_flux_less_the_swept_amount():
    """Flux of mass m - speed rho, and of momentum p n - speed (mx, my), with p = c^2 (rho - rho_0) and m along n."""
    random = np.random.default_rng(3)
    nx, ny, reach, w, mx, my = block(random)
    speed, scratch = random.uniform(-3.0, 3.0, BLOCK), np.zeros(ROWS * BLOCK)
    scratch[: 3 * BLOCK] = np.concatenate([w, mx, my])
    add_side_linear_moving.py_func(
        SOUND, DENSITY, w, mx, my, measures(nx, ny, reach), scratch, speed
    )
    mass = mx * nx + my * ny - speed * (DENSITY + w / SOUND)
    pressure = SOUND * w
    assert scratch[RATE_MASS] == pytest.approx(-reach * mass, rel=1e-12)
    assert scratch[RATE_X] == pytest.approx(-reach * (pressure * nx - speed * mx), rel=1e-10)
    assert scratch[RATE_Y] == pytest.approx(-reach * (pressure * ny - speed * my), rel=1e-10)


def test_a_moving_side_of_no_speed_is_a_fixed_side():
    random = np.random.default_rng(4)
    nx, ny, reach, *inside = block(random)
    beyond, found = random.normal(0.0, 50.0, 3 * BLOCK), []
    for add, own, more in (
        (add_side_linear, (), ()),
        (add_side_linear_moving, (DENSITY,), (np.zeros(BLOCK),)),
    ):
        scratch = np.zeros(ROWS * BLOCK)
        scratch[: 3 * BLOCK] = beyond
        add.py_func(SOUND, *own, *inside, measures(nx, ny, reach), scratch, *more)
        found.append(np.concatenate([scratch[rows] for rows in (RATE_MASS, RATE_X, RATE_Y)]))
    assert found[1] == pytest.approx(found[0], rel=1e-12)
