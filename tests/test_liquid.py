"""Pressure waves of a liquid in the plane, kernels alone: modes of a box, sides, a vortex, exact Riemann problems."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from pytest import approx
from scipy.integrate import quad_vec
from scipy.interpolate import CubicSpline
from scipy.special import j0
from truth.log_law import LogFluid, Riemann, SimpleWave
from truth.orders import mean_error, observed_order
from truth.scenes import NO_FRICTION, junction, reservoir, scene, stiff_pipe

import fvsolve
from fvsolve.kernels.plane import liquid, liquid_log
from fvsolve.kernels.records import LINEAR, MINMOD, MONOTONIZED_CENTRAL, MUSCL, UPWIND, VAN_LEER, WENO5

SCHEMES = {"upwind": UPWIND, "muscl": MUSCL, "upwind5": LINEAR, "weno5": WENO5}
LIMITERS = {"minmod": MINMOD, "van-leer": VAN_LEER, "monotonized-central": MONOTONIZED_CENTRAL}
ORDERS = {"upwind": 1, "muscl": 2, "upwind5": 5, "weno5": 5}
C, RHO = 10.0, 1000.0
WALLS = np.zeros(0)


@dataclass(frozen=True)
class Box:
    """A rectangle of cells; states are arrays [3, ny, nx]: deviation of density, mass-flow densities."""

    nx: int
    ny: int
    scheme: str
    size: tuple[float, float] = (1.0, 1.0)
    log: bool = False
    limiter: str = "monotonized-central"
    reflect: np.ndarray = field(default_factory=lambda: WALLS)
    stretch: float = 0.0  # cell edges at s + stretch sin(2 pi s) / (2 pi) of the size

    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges of columns and of rows."""
        shares = (np.linspace(0.0, 1.0, n + 1) for n in (self.nx, self.ny))
        bent = (s + self.stretch * np.sin(2 * math.pi * s) / (2 * math.pi) for s in shares)
        x, y = (s * size for s, size in zip(bent, self.size, strict=True))
        return x, y

    def rates(self, state: np.ndarray) -> tuple[np.ndarray, float]:
        """(rates, greatest rate); work starts as NaN, so that what is read before it is written shows."""
        kernel = liquid_log if self.log else liquid
        given = (C, RHO, 1e-18 * C**2) if self.log else (C, 1e-18 * (RHO * C) ** 2)
        kx, ky = (1.0 / np.diff(e) for e in self.edges())
        work, found = np.full(kernel.work_size(self.nx, self.ny), np.nan), np.full((3, self.nx * self.ny), np.nan)
        flat = np.ascontiguousarray(state).reshape(3, -1)
        codes = SCHEMES[self.scheme], LIMITERS[self.limiter]
        rate = kernel.grid_rates(*given, *codes, self.nx, self.ny, kx, ky, self.reflect, *flat, work, *found)
        return found.reshape(state.shape), rate

    def run(self, state: np.ndarray, end: float, courant: float = 0.8) -> np.ndarray:
        """The state at `end` by RK4, in even steps."""
        steps = math.ceil(end * self.rates(state)[1] / courant)
        h = end / steps
        for _ in range(steps):
            k1 = self.rates(state)[0]
            k2 = self.rates(state + 0.5 * h * k1)[0]
            k3 = self.rates(state + 0.5 * h * k2)[0]
            state = state + h / 6.0 * (k1 + 2.0 * (k2 + k3) + self.rates(state + h * k3)[0])
        return state

    def averages(self, function, points: int = 5) -> np.ndarray:
        """Cell averages of function(x, y) -> (r, m, n) by Gauss points."""
        nodes, weights = np.polynomial.legendre.leggauss(points)
        (x, wx), (y, wy) = (
            ((e[:-1, None] + np.diff(e)[:, None] * (nodes + 1) / 2).ravel(), np.tile(weights / 2, len(e) - 1))
            for e in self.edges()
        )
        values = np.array(np.broadcast_arrays(*function(*np.meshgrid(x, y)))) * np.outer(wy, wx)
        return values.reshape(3, self.ny, points, self.nx, points).sum(axis=(2, 4))


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
    """Order at which exact(box, end) is met from exact(box, 0), nx and ny scaled alike, steps finer still."""
    errors = []
    for n in sizes:
        finer = replace(box, nx=n, ny=max(1, box.ny * n // box.nx))
        found = finer.run(exact(finer, 0.0), end, courant * (sizes[0] / n) ** 0.25)
        errors.append(mean_error(found, exact(finer, end)))
    print("ORDER", box.scheme, errors, observed_order(errors, [1 / n for n in sizes]))
    return observed_order(errors, [1 / n for n in sizes])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_standing_modes_of_a_box_are_met_at_the_order_of_the_scheme(scheme):
    """Period 0.12 s: a frequency off by one per cent would be an error of six."""
    box = Box(4, 3, scheme, (1.0, 0.75))
    sizes, end, courant = ((16, 32), 0.12, 0.1) if ORDERS[scheme] == 5 else ((64, 128), 0.03, 0.5)
    for m, n in ((1, 1), (2, 1)):
        found = order(box, lambda b, t, m=m, n=n: mode(b, m, n, t), end, [m * k for k in sizes], courant)
        assert found == approx(ORDERS[scheme], abs=0.1)


@pytest.mark.parametrize("scheme", ["muscl", "upwind5"])
def test_on_graded_cells_every_scheme_is_second_order(scheme):
    """Widths from half to one and a half of the mean, in both directions."""
    box = Box(4, 3, scheme, (1.0, 0.75), stretch=0.5)
    assert order(box, lambda b, t: mode(b, 1, 1, t), 0.03, (64, 128)) == approx(2, abs=0.1)


def wave(box: Box, at: float, way: float) -> np.ndarray:
    """A pulse at x = `at` that runs east (way 1) or west (-1)."""
    return box.averages(lambda x, y: np.exp(-(((x - at) / 6) ** 2)) * np.array([1.0, way * C, 0.0])[:, None, None])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_plane_wave_is_carried_unchanged(scheme):
    box = Box(4, 1, scheme, (100.0, 1.0))
    sizes, end = {1: (800, 1600), 2: (400, 800), 5: (200, 400)}[ORDERS[scheme]], 0.3 if scheme == "upwind" else 3.0
    assert order(box, lambda b, t: wave(b, 35.0 + C * t, 1.0), end, sizes) == approx(ORDERS[scheme], abs=0.1)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_row_of_cells_is_a_pipe(scheme):
    """Rates to round-off inside; after reflections at a reservoir and a dead end, both are as near to the exact waves."""
    n, length, diameter = 200, 100.0, 0.5
    section = math.pi / 4 * diameter**2
    fluid = {"name": "user", "density": RHO, "bulk_modulus": RHO * C**2, "viscosity": 1e-3, "vapor_pressure": 100.0}
    numerics = {"scheme": scheme, "limiter": "monotonized-central", "method": "rk4", "courant": 0.5}
    nodes = {"left": reservoir(101325.0), "right": junction()}
    links = {"main": stiff_pipe("left", "right", length, diameter, n, friction=NO_FRICTION)}
    case = scene(nodes, links, 10.0, numerics, ["right.pressure"], 0.1, fluid=fluid | {"law": "linear"})
    model = fvsolve.build(fvsolve.load(case))
    box = Box(n, 1, scheme, (length, 1.0), reflect=np.array([-1.0] + [1.0] * (1 + 2 * n)))

    def of_waves(y):
        return np.array([(y[:n] + y[n:]) / C, y[:n] - y[n:]]) / section

    start = wave(box, 40.0, 1.0) + 0.3 * wave(box, 60.0, -1.0)
    y = section * np.concatenate([C * start[0, 0] + start[1, 0], C * start[0, 0] - start[1, 0]]) / 2
    rates, inside = box.rates(start)[0][:2, 0], slice(3, n - 3)
    assert of_waves(model.rhs(0.0, y))[:, inside] == approx(rates[:, inside], abs=1e-14 * np.abs(rates).max())
    state = fvsolve.initial_state(model)
    state.y[:] = y
    exact = (wave(box, 70.0, -1.0) - 0.3 * wave(box, 30.0, 1.0))[:2, 0]
    found = box.run(start, 9.0, 0.5)[:2, 0]
    pipe = of_waves(fvsolve.advance(model, state, 9.0).y)
    print("PIPE", scheme, mean_error(found, exact), mean_error(pipe, exact), mean_error(found, pipe))


@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
@pytest.mark.parametrize("share", [1.0, 0.6, 0.0, -0.35, -1.0])
def test_a_side_sends_back_the_stated_share_of_a_wave(share, log):
    """A pulse leaves through the eastern side: what is left is `share` of it, running west; nothing else at all."""
    box = Box(200, 1, "upwind5", (100.0, 1.0), log=log, reflect=np.array([1.0, share] + [1.0] * 400))
    small = 1e-6 if log else 1.0
    found = box.run(small * wave(box, 60.0, 1.0), 8.0) / small
    print("SHARE", log, share, np.abs(found[0] - share * wave(box, 60.0, -1.0)[0]).max())


def noise(box: Box, size: float = 1.0) -> np.ndarray:
    """Cells that have nothing to do with each other, density and speeds up to `size` of their scales."""
    numbers = np.random.default_rng(7).uniform(-size, size, (3, box.ny, box.nx))
    return numbers * (RHO * np.array([1.0, C, C])[:, None, None])


def shares(box: Box) -> np.ndarray:
    """Walls, open sides, given pressures and what lies between them, at random."""
    rng = np.random.default_rng(3)
    count = 2 * (box.nx + box.ny)
    return np.where(rng.random(count) < 0.5, rng.uniform(-1.0, 1.0, count), rng.integers(-1, 2, count))


@pytest.mark.parametrize("scheme", ["upwind", "upwind5"])
def test_no_mode_grows_whatever_the_sides_send_back(scheme):
    worst = 0
    for nx, ny in itertools.product((1, 2, 5, 6, 8) if scheme == "upwind" else (5, 6, 8), repeat=2):
        box = Box(nx, ny, scheme, (nx, ny))
        for sides in (WALLS, shares(box), -np.ones(2 * (nx + ny)), np.zeros(2 * (nx + ny))):
            box = replace(box, reflect=sides)
            unit = np.eye(3 * nx * ny) * np.repeat([1.0, C, C], nx * ny)
            matrix = np.array([(box.rates(row.reshape(3, ny, nx))[0]).ravel() for row in unit]) / np.repeat(
                [1.0, C, C], nx * ny
            )
            worst = max(worst, np.linalg.eigvals(matrix).real.max() / C)
            if worst > 1e-9:
                print(nx, ny, sides, worst)
    print("GROW", scheme, worst)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
def test_noise_between_any_sides_dies_away(scheme, log):
    worst = 0
    for nx, ny in ((1, 1), (2, 3), (4, 6), (12, 9)):
        box = Box(nx, ny, scheme, (nx, ny), log=log)
        box = replace(box, reflect=shares(box))
        start = noise(box, 0.02)
        energy = [((C * s[0]) ** 2 + s[1] ** 2 + s[2] ** 2).sum() for s in (start, box.run(start, 50.0))]
        worst = max(worst, energy[1] / energy[0])
    print("NOISE", scheme, log, worst)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_round_pulse_stays_round(scheme):
    """Against Hankel's integral; the errors along axes and along diagonals part at the order of the scheme."""

    def height(r, t):
        return quad_vec(lambda k: k / 2 * np.exp(-k * k / 4) * np.cos(C * k * t) * j0(k * r), 0.0, 16.0, epsrel=1e-12)[
            0
        ]

    radii, end = np.linspace(0.0, 9.0, 400), 0.3
    shape = {t: CubicSpline(radii, height(radii, t)) for t in (0.0, end)}

    def exact(box, t):
        return box.averages(lambda x, y: (shape[t](np.hypot(x - 6, y - 6)), 0 * x, 0 * x))[0]

    parts, errors = [], []
    for n in (64, 128):
        box = Box(n, n, scheme, (12.0, 12.0))
        start = np.zeros((3, n, n))
        start[0] = exact(box, 0.0)
        miss = np.abs(box.run(start, end, 0.2)[0] - exact(box, end))
        x = np.abs(np.arange(n) + 0.5 - n / 2)
        angle = np.degrees(np.arctan2(*np.meshgrid(x, x)))
        axis, diagonal = (angle < 10) | (angle > 80), abs(angle - 45) < 10
        parts.append(abs(miss[axis].mean() - miss[diagonal].mean()))
        errors.append(miss.mean())
    print("ROUND", scheme, parts, errors, np.log2(parts[0] / parts[1]), np.log2(errors[0] / errors[1]))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("log", [False, True], ids=["linear", "log"])
def test_what_is_mirrored_or_turned_stays_so_to_the_bit_and_mass_stays(scheme, log):
    box = Box(7, 9, scheme, (7.0, 5.0), log=log)
    for sides in (WALLS, shares(box)):
        box = replace(box, reflect=sides)
        state = noise(box, 0.1)
        west, east, south, north = np.split(sides, np.cumsum([9, 9, 7])) if sides.size else (WALLS,) * 4
        turned = replace(box, nx=9, ny=7, size=(5.0, 7.0), reflect=np.concatenate([south, north, west, east]))
        mirrored = replace(box, reflect=np.concatenate([east, west, south[::-1], north[::-1]]))
        rates, rate = box.rates(state)
        found, same = turned.rates(state.transpose(0, 2, 1)[[0, 2, 1]])
        assert np.array_equal(found, rates.transpose(0, 2, 1)[[0, 2, 1]]) and same == rate
        sign = np.array([1.0, -1.0, 1.0])[:, None, None]
        found, same = mirrored.rates(sign * state[:, :, ::-1])
        assert np.array_equal(found, sign * rates[:, :, ::-1]) and same == rate
        if not sides.size:
            assert abs(rates[0].sum()) < 1e-15 * np.abs(rates[0]).sum()
