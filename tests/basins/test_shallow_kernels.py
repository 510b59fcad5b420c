"""Kernels of shallow water on grids: rest, orders over a bed, steady flows, Thacker's bowls, symmetry, friction."""

import math

import numpy as np
import pytest
from pytest import approx
from scipy.optimize import brentq

from fvsolve.core.kernels.cube_root import cube_root_reciprocal, estimate
from fvsolve.core.kernels.dtypes import (
    LINEAR,
    MINMOD,
    MONOTONIZED_CENTRAL,
    MUSCL,
    UPWIND,
    VAN_LEER,
    WENO5,
)
from fvsolve.features.basins.free_surface.bed_friction import add_capped_friction
from fvsolve.features.basins.free_surface.surface_grid import (
    PLANS,
    WORK,
    FaceFlows,
    WaterGrid,
    grid_rates,
    kerbs_of,
)
from fvsolve.features.basins.free_surface.surface_rows import SURFACE, put_push
from fvsolve.features.basins.tables import DARCY, MANNING
from fvsolve.jit import njit

G = 9.80665
SCHEMES = {"upwind": UPWIND, "muscl": MUSCL, "upwind5": LINEAR, "weno5": WENO5}
NONE = np.zeros(0)


class Water:
    """Grid between walls over a bed given by cell, with its rates and explicit steps."""

    def __init__(self, x, y, bed, level=0.0, scheme="muscl", limiter=VAN_LEER, reflect=NONE):
        self.nx, self.ny = len(x) - 1, len(y) - 1
        self.kx, self.ky = 1.0 / np.diff(x), 1.0 / np.diff(y)
        self.scheme, self.limiter, self.reflect = SCHEMES[scheme], limiter, reflect
        self.bed = np.broadcast_to(bed, (self.ny, self.nx)) - level
        self.plan = np.empty((PLANS, self.nx * self.ny))
        self.plan[0], self.plan[1] = (
            np.maximum(-self.bed, 0.0).ravel(),
            np.maximum(self.bed, 0.0).ravel(),
        )
        self.work = np.zeros(WORK)
        self.flow_x, self.flow_y = (
            np.zeros(self.ny * (self.nx + 1)),
            np.zeros((self.ny + 1) * self.nx),
        )
        self.friction, self.hold = None, lambda y: None

    def state(self, h, qx=0.0, qy=0.0):
        y = np.zeros((3, self.ny, self.nx))
        y[0], y[1], y[2] = h - self.plan[0].reshape(self.ny, self.nx), qx, qy
        return y

    def rates(self, y, out):
        a, b = y.reshape(3, -1), out.reshape(3, -1)
        spacing = self.kx, self.ky
        kerbs = kerbs_of(self.bed)
        grid = WaterGrid(
            G, self.scheme, self.limiter, self.nx, self.ny, *spacing, self.reflect, self.plan, kerbs
        )
        flows = FaceFlows(self.flow_x, self.flow_y, NONE)
        rate = grid_rates(
            grid, 0, self.ny, (a[0], a[1], a[2]), flows, self.work, (b[0], b[1], b[2]), None, None
        )
        if self.friction is not None:
            law, c = self.friction
            c = np.full(self.plan[0].size, c)
            rate += add_capped_friction(
                law, G, c, 1e3, self.plan[0], a[0], (a[1], a[2]), (a[1], a[2]), (b[1], b[2])
            )
        return rate

    def depth(self, y):
        return self.plan[0].reshape(self.ny, self.nx) + y[0]

    def advance(self, y, end, courant=0.45, most=1.0, watch=None):
        """Return the state at `end` by SSP-RK2 for `upwind` and `muscl`, else by SSP-RK3."""
        y, k, t = y.copy(), np.zeros_like(y), 0.0
        while t < end:
            h = min(courant / self.rates(y, k), most, end - t)
            one = y + h * k
            self.hold(one)
            self.rates(one, k)
            if self.scheme in (UPWIND, MUSCL):
                y = 0.5 * (y + (one + h * k))
            else:
                two = 0.75 * y + 0.25 * (one + h * k)
                self.rates(two, k)
                y = y / 3.0 + 2.0 / 3.0 * (two + h * k)
            self.hold(y)
            t += h
            if watch is not None:
                watch(t, y)
        return y


def graded(n, size, ratio):
    """Faces with a spacing that grows geometrically from 1 to `ratio`."""
    steps = ratio ** (np.arange(n) / max(n - 1, 1))
    return size * np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()


def even(n, size):
    return np.linspace(0.0, size, n + 1)


def middles(x):
    return 0.5 * (x[1:] + x[:-1])


def means(function, x):
    """Averages of a function over cells, by Gauss's rule with five points."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    return sum(
        0.5 * w * function(middles(x) + 0.5 * np.diff(x) * s)
        for s, w in zip(nodes, weights, strict=True)
    )


def slope(errors):
    """Observed order of the last two errors, with cells halved each time."""
    return math.log2(errors[-2] / errors[-1])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_lake_lies_at_rest_around_dry_islands_on_a_graded_grid(scheme):
    x, y = graded(40, 10.0, 5.0), graded(30, 8.0, 0.3)
    mx, my = np.meshgrid(middles(x), middles(y))
    bed = (
        0.2 * np.sin(3.0 * mx) * np.cos(2.0 * my)
        + 1.4 * np.exp(-((mx - 4.0) ** 2 + (my - 5.0) ** 2))
        - 0.7
    )
    bed[5:9, 20:26] = 0.4  # an island with cliffs
    water = Water(x, y, bed, scheme=scheme)
    assert 20 < (water.plan[0] == 0.0).sum() < 500
    k = np.ones((3, 30, 40))
    water.rates(np.zeros_like(k), k)
    assert not k.any() and not water.flow_x.any() and not water.flow_y.any()
    # the lake with another datum, so that numbers are rounded: 1000 steps
    other = Water(x, y, bed, level=-0.1, scheme=scheme)
    state = other.state(np.maximum(0.0 - bed, 0.0))
    h = 0.4 / other.rates(state, k)
    state = other.advance(state, 1000 * h, courant=1e9, most=h)
    wet = other.depth(state) > 0.0
    speed = np.hypot(state[1], state[2])[wet] / other.depth(state)[wet]
    assert speed.max() < 1e-13 * math.sqrt(G * 0.9)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_mirrored_and_turned_water_has_the_same_bits(scheme):
    rng = np.random.default_rng(5)
    nx, ny = 17, 12
    x, y = graded(nx, 5.0, 3.0), graded(ny, 4.0, 2.0)
    bed = rng.random((ny, nx)) * 0.5 - np.where(rng.random((ny, nx)) < 0.7, 1.0, 0.3)
    h = np.where(
        rng.random((ny, nx)) < 0.2,
        0.0,
        0.2 * rng.random((ny, nx)) + 0.5 * (rng.random((ny, 1)) < 0.5),
    )
    u, v = rng.standard_normal((2, ny, nx))
    out = np.empty((3, ny, nx))
    water = Water(x, y, bed, scheme=scheme)
    rate = water.rates(water.state(h, h * u, h * v), out)
    mirror = Water(x[-1] - x[::-1], y, bed[:, ::-1], scheme=scheme)
    mirror.kx = water.kx[::-1].copy()
    back = np.empty_like(out)
    assert mirror.rates(mirror.state(h[:, ::-1], -(h * u)[:, ::-1], (h * v)[:, ::-1]), back) == rate
    assert np.array_equal(back[:, :, ::-1] * np.array([1.0, -1.0, 1.0])[:, None, None], out)
    turned = Water(y, x, bed.T, scheme=scheme)
    turn = np.empty((3, nx, ny))
    assert turned.rates(turned.state(h.T, (h * v).T, (h * u).T), turn) == approx(rate, rel=1e-15)
    assert np.array_equal(turn[[0, 2, 1]].transpose(0, 2, 1), out)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_flows_through_faces_sum_to_the_change_of_depth_and_none_pass_a_wall(scheme):
    rng = np.random.default_rng(1)
    water = Water(graded(9, 3.0, 2.0), graded(7, 2.0, 0.5), rng.random((7, 9)) - 0.8, scheme=scheme)
    h, q = rng.random((7, 9)), rng.standard_normal((2, 7, 9))
    out = np.empty((3, 7, 9))
    water.rates(water.state(h, *q), out)
    fx, fy = water.flow_x.reshape(7, 10), water.flow_y.reshape(8, 9)
    assert not fx[:, [0, -1]].any() and not fy[[0, -1]].any() and fx.any() and fy.any()
    found = -water.kx * np.diff(fx, axis=1) - water.ky[:, None] * np.diff(fy, axis=0)
    assert found == approx(out[0], abs=1e-13 * abs(out[0]).max())


@pytest.mark.parametrize(
    ("scheme", "courant"), [("upwind", 0.5), ("muscl", 0.45), ("upwind5", 0.16), ("weno5", 0.16)]
)
@pytest.mark.parametrize("seed", range(1, 5))
def test_no_depth_falls_below_zero_over_a_random_bed(scheme, courant, seed):
    """With `muscl` and the limit itself, 0.5, a quarter of all random fields reach -5e-6 m: bounds mix two cells."""
    rng = np.random.default_rng(seed)
    for limiter in range(MONOTONIZED_CENTRAL + 1):
        water = Water(
            even(24, 2.0),
            even(20, 2.0),
            rng.random((20, 24)),
            level=0.3,
            scheme=scheme,
            limiter=limiter,
        )
        h = np.where(rng.random((20, 24)) < 0.5, 0.0, rng.random((20, 24)) ** 3)
        y, k = water.state(h, *(h * rng.standard_normal((2, 20, 24)))), np.empty((3, 20, 24))
        total = water.depth(y).sum()
        for _ in range(200):
            y = y + courant / water.rates(y, k) * k
            assert water.depth(y).min() > -1e-15
        assert water.depth(y).sum() == approx(total, rel=1e-13)


def bernoulli(q, energy, bed, fast=False):
    """Depth of steady frictionless flow q [m2/s] of total head `energy` [m]; supercritical if `fast` is True."""
    head = energy - bed
    shape = np.arccos(np.clip(1.0 - 27.0 * q * q / (4.0 * G * head**3), -1.0, 1.0))
    return head / 3.0 * (1.0 + 2.0 * np.cos((shape + (4.0 * np.pi if fast else 0.0)) / 3.0))


def bump(x):
    return 0.2 * np.exp(-(((x - 15.0) / 1.5) ** 2))


@pytest.mark.in_turn
@pytest.mark.parametrize(
    ("scheme", "low"), [("upwind", 0.9), ("muscl", 1.9), ("upwind5", 4.5), ("weno5", 4.5)]
)
@pytest.mark.parametrize("way", ["east", "north"])
def test_smooth_flow_over_a_bed_has_the_order_of_the_scheme(scheme, low, way):
    """Steady flow by Bernoulli around the bump, before waves from the walls arrive."""
    q, end = 1.0, 1.5
    energy = 1.0 + 0.5 * q * q / G
    errors = []
    for n in (100, 200, 400):
        x, thin, courant = even(n, 30.0), np.array([0.0, 1.0]), 0.3 * (100 / n) ** 0.67
        bed, h = means(bump, x), means(lambda x: bernoulli(q, energy, bump(x)), x)
        if way == "east":
            water = Water(x, thin, bed, level=1.0, scheme=scheme)
            y = water.advance(water.state(h, q), end, courant)
        else:
            water = Water(thin, x, bed[:, None], level=1.0, scheme=scheme)
            y = water.advance(water.state(h[:, None], 0.0, q), end, courant)
        inside = abs(middles(x) - 15.0) < 6.0
        errors.append(abs(water.depth(y).ravel() - h)[inside].mean())
    assert slope(errors) > low


def test_the_push_of_cubic_depth_and_surface_is_exact():
    rng = np.random.default_rng(4)
    h, e = (np.polynomial.Polynomial(c) for c in rng.standard_normal((2, 4)))
    edges = np.arange(-2.5, 3.0)
    deep, push = np.ones(1), np.zeros(1)
    blocks = np.zeros((7, SURFACE + 1))  # five cells, and both faces of the third
    for place, f in ((0, h), (SURFACE, e)):
        blocks[:5, place], blocks[5:, place] = np.diff(f.integ()(edges)), f(np.array([-0.5, 0.5]))
    put_push(*blocks, deep, push)
    whole = (h * e.deriv()).integ()
    assert push[0] == approx(whole(0.5) - whole(-0.5), rel=1e-13)


def parabola(x):
    return np.maximum(0.2 - 0.05 * (x - 10.0) ** 2, 0.0)


def channel(q, out, jump, x):
    """Depth of steady flow q over the bump to the depth `out`, by Bernoulli; with a hydraulic jump if `jump`.

    Source: Goutal and Maurel (1997). The depths on both sides of the jump obey the Rankine-Hugoniot condition.
    """
    down = out + 0.5 * (q / out) ** 2 / G
    if not jump:
        return bernoulli(q, down, parabola(x))
    up = 1.5 * (q * q / G) ** (1.0 / 3.0) + 0.2

    def surplus(at):
        a, b = bernoulli(q, up, parabola(at), fast=True), bernoulli(q, down, parabola(at))
        return q * q / a + 0.5 * G * a * a - q * q / b - 0.5 * G * b * b

    at = brentq(surplus, 11.3, 12.0)
    fast = np.where(
        x < at, bernoulli(q, up, parabola(x), fast=True), bernoulli(q, down, parabola(x))
    )
    return np.where(x < 10.0, bernoulli(q, up, parabola(x)), fast)


@pytest.mark.parametrize(
    ("q", "out", "jump", "low"), [(4.42, 2.0, False, 1.9), (0.18, 0.33, True, 1.0)]
)
def test_flow_over_a_bump_settles_to_bernoulli_and_its_jump(q, out, jump, low):
    """L1 error for given flow at the west and depth at the east; limiters steeper than minmod ring at a jump."""
    errors = []
    for n in (100, 200):
        x = even(n, 25.0)
        water = Water(x, np.array([0.0, 1.0]), means(parabola, x), level=out, limiter=MINMOD)
        rest = water.plan[0].reshape(1, n)

        def hold(y, rest=rest):
            y[1, 0, :2], y[0, 0, :2] = q, y[0, 0, 2]
            y[0, 0, -2:], y[1, 0, -2:] = out - rest[0, -2:], y[1, 0, -3]

        water.hold = hold
        y = water.advance(water.state(rest, 0.0 if jump else q), 200.0)
        error = abs(water.depth(y)[0] - channel(q, out, jump, middles(x)))
        errors.append(error[5:-5].mean())
        assert water.flow_x[5:-5] == approx(q, rel=2e-3)
    assert slope(errors) > low


def thacker(kind, x, y, t):
    """Return (depth, unit flow x, unit flow y, period) in the bowl -H (1 - r^2), H = 0.1 m (Thacker 1981)."""
    deep = 0.1
    r2 = x * x + y * y
    if kind == "planar":
        w, eta = math.sqrt(2.0 * G * deep), 0.5
        surface = eta * deep * (2.0 * x * math.cos(w * t) + 2.0 * y * math.sin(w * t) - eta)
        u, v = -eta * w * math.sin(w * t) + 0.0 * x, eta * w * math.cos(w * t) + 0.0 * x
    else:
        w, a = math.sqrt(8.0 * G * deep), (1.0 - 0.64) / (1.0 + 0.64)
        part = 1.0 - a * math.cos(w * t)
        surface = deep * (
            math.sqrt(1.0 - a * a) / part - 1.0 - r2 * ((1.0 - a * a) / part**2 - 1.0)
        )
        u, v = (
            (0.5 * w * a * math.sin(w * t) / part) * x,
            (0.5 * w * a * math.sin(w * t) / part) * y,
        )
    h = np.maximum(surface + deep * (1.0 - r2), 0.0)
    return h, h * u, h * v, 2.0 * math.pi / w


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["muscl", "weno5"])
@pytest.mark.parametrize("kind", ["planar", "curved"])
def test_water_swings_in_thackers_bowls_for_three_periods(kind, scheme):
    errors = []
    for n in (40, 80):
        x = np.linspace(-2.0, 2.0, n + 1)
        mx, my = np.meshgrid(middles(x), middles(x))
        water = Water(x, x, -0.1 * (1.0 - mx * mx - my * my), scheme=scheme)
        *start, period = thacker(kind, mx, my, 0.0)
        least = [0.0]

        def watch(t, y, water=water, least=least):
            least[0] = min(least[0], water.depth(y).min())

        y = water.advance(water.state(*start), 3.0 * period, watch=watch)
        assert least[0] > -1e-15
        assert water.depth(y).sum() == approx(start[0].sum(), rel=1e-12)
        errors.append(
            abs(water.depth(y) - thacker(kind, mx, my, 3.0 * period)[0]).sum() / start[0].sum()
        )
    assert slope(errors) > 1.7


@pytest.mark.parametrize(("law", "coefficient"), [(MANNING, 0.03), (DARCY, 0.05)])
def test_flow_down_a_slope_approaches_the_normal_flow(law, coefficient):
    """U tanh(g S t / U) in the middle of a long channel, with U = h^(2/3) sqrt(S) / n or sqrt(8 g h S / f)."""
    tilt, h, end = 0.01, 1.0, 60.0
    x = even(240, 1200.0)
    water = Water(x, np.array([0.0, 1.0]), -tilt * middles(x), level=-20.0)
    water.friction = law, coefficient
    y = water.advance(water.state(h), end)
    normal = (
        math.sqrt(tilt) / coefficient if law == MANNING else math.sqrt(8.0 * G * tilt / coefficient)
    )
    middle = slice(110, 130)
    assert water.depth(y)[0, middle] == approx(h, rel=1e-10)
    assert y[1, 0, middle] == approx(normal * math.tanh(G * tilt * end / normal), rel=1e-4)


def test_friction_of_films_is_bounded_and_takes_no_more_than_there_is():
    h = np.array([0.0, 1e-12, 1e-6, 1e-4, 1e-2, 1.0])
    q, none, out = h * 2.0, np.zeros(6), np.zeros((2, 6))
    rate = add_capped_friction(
        MANNING, G, np.full(6, 0.03), 50.0, none, h, (q, -q), (q, -q), (out[0], out[1])
    )
    assert 90.0 < rate <= 100.0 and np.array_equal(out[0], -out[1]) and not out[:, 0].any()
    assert np.all(-out[0] <= 50.0 * q)
    assert -out[0, 5] == approx(G * 0.03**2 * math.hypot(2.0, 2.0) * 2.0, rel=1e-3)


def test_a_wave_leaves_by_an_open_side_and_comes_back_from_a_wall():
    left = {}
    for name, reflect in (
        ("wall", NONE),
        ("ones", np.ones(2 * 103)),
        ("open", np.r_[np.zeros(6), np.ones(200)]),
    ):
        x = even(100, 20.0)
        water = Water(x, even(3, 1.0), np.full((3, 100), -1.0), reflect=reflect)
        y = water.advance(
            water.state(1.0 + 0.01 * np.exp(-(((middles(x) - 10.0) / 1.0) ** 2))[None]), 6.0
        )
        left[name] = y
    assert np.array_equal(left["wall"], left["ones"])
    assert abs(left["wall"][0]).max() > 4e-3
    assert abs(left["open"][0]).max() < 2e-5


def test_the_cube_root_of_friction_is_exact_to_rounding_for_films_and_oceans():
    @njit
    def of_all(x, roughly, exactly):
        for i in range(x.size):
            roughly[i], exactly[i] = estimate(x[i]), cube_root_reciprocal(x[i])

    depths = np.logspace(-8, 5, 40001)
    roughly, exactly = np.zeros_like(depths), np.zeros_like(depths)
    of_all(depths, roughly, exactly)
    assert np.abs(roughly * np.cbrt(depths) - 1.0).max() < 0.04
    assert np.abs(exactly * np.cbrt(depths) - 1.0).max() < 1e-15


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_no_water_flows_through_a_wall_to_the_last_bit(scheme):
    rng = np.random.default_rng(4)
    water = Water(even(9, 3.0), even(7, 2.0), rng.uniform(-1.0, -0.5, (7, 9)), scheme=scheme)
    y = water.state(rng.uniform(0.5, 1.0, (7, 9)), *rng.uniform(-0.7, 0.7, (2, 7, 9)))
    water.rates(y, np.zeros_like(y))
    along, across = water.flow_x.reshape(7, 10), water.flow_y.reshape(8, 9)
    assert not along[:, [0, -1]].any() and not across[[0, -1]].any()
    assert np.abs(along[:, 1:-1]).min() > 0.0


@pytest.mark.parametrize("limiter", [MINMOD, VAN_LEER, MONOTONIZED_CENTRAL])
@pytest.mark.parametrize("reflect", [NONE, np.zeros(2 * (9 + 7))], ids=["walls", "open"])
def test_rows_without_kerbs_or_films_have_the_rates_of_all_rows_treated_as_kerbs(
    limiter, reflect, monkeypatch
):
    """`kerbs_of` only saves work: with every row treated, all bits of the rates are the same."""
    random = np.random.default_rng(4)
    bed = np.where(random.random((7, 9)) < 0.3, 0.05, 0.0) * (np.arange(7) % 3 == 0)[
        :, None
    ] + 0.02 * np.arange(9)
    water = Water(np.arange(10.0), np.arange(8.0), bed, -1.0, limiter=limiter, reflect=reflect)
    water.plan[0] = 0.0
    water.plan[1] = bed.ravel() - bed.min()
    y, saved, treated = np.zeros((3, 7, 9)), np.zeros((3, 7, 9)), np.zeros((3, 7, 9))
    y[0] = 10.0 ** random.uniform(-5.0, 0.0, (7, 9)) * (random.random((7, 9)) > 0.1)
    y[1:] = 0.1 * y[0] * random.standard_normal((2, 7, 9))
    water.rates(y, saved)
    monkeypatch.setitem(globals(), "kerbs_of", lambda bed: np.full(2 * len(bed), 1e9))
    water.rates(y, treated)
    assert np.array_equal(saved, treated) and np.abs(saved).max() > 0.0
    monkeypatch.setitem(globals(), "kerbs_of", lambda bed: np.zeros(2 * len(bed)))
    water.rates(y, treated)
    assert not np.array_equal(saved, treated)
