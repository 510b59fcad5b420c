"""Shallow-water kernels on grids: rest, orders over a bed, steady flows, Thacker's bowls, symmetry, friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pytest import approx

from fvsolve.kernels.plane.friction import DARCY, MANNING, add_friction
from fvsolve.kernels.plane.shallow import PLANS, grid_rates, work_size
from fvsolve.kernels.records import LINEAR, MONOTONIZED_CENTRAL, MUSCL, UPWIND, VAN_LEER, WENO5

G = 9.80665
SCHEMES = {"upwind": UPWIND, "muscl": MUSCL, "upwind5": LINEAR, "weno5": WENO5}
NONE = np.zeros(0)


class Water:
    """A grid between walls over a bed given by cell, with its rates and explicit steps."""

    def __init__(self, x, y, bed, level=0.0, scheme="muscl", limiter=VAN_LEER, reflect=NONE):
        self.nx, self.ny = len(x) - 1, len(y) - 1
        self.kx, self.ky = 1.0 / np.diff(x), 1.0 / np.diff(y)
        self.scheme, self.limiter, self.reflect = SCHEMES[scheme], limiter, reflect
        self.bed = np.broadcast_to(bed, (self.ny, self.nx)) - level
        self.plan = np.empty((PLANS, self.nx * self.ny))
        self.plan[0], self.plan[1] = np.maximum(-self.bed, 0.0).ravel(), np.maximum(self.bed, 0.0).ravel()
        self.work = np.zeros(work_size(self.nx, self.ny))
        self.flow_x, self.flow_y = np.zeros(self.ny * (self.nx + 1)), np.zeros((self.ny + 1) * self.nx)
        self.friction = None

    def state(self, h, qx=0.0, qy=0.0):
        y = np.zeros((3, self.ny, self.nx))
        y[0], y[1], y[2] = h - self.plan[0].reshape(self.ny, self.nx), qx, qy
        return y

    def rates(self, y, out):
        a, b = y.reshape(3, -1), out.reshape(3, -1)
        rate = grid_rates(
            G, self.scheme, self.limiter, self.nx, self.ny, self.kx, self.ky, self.reflect, self.plan,
            a[0], a[1], a[2], self.flow_x, self.flow_y, self.work, b[0], b[1], b[2],
        )  # fmt: skip
        if self.friction is not None:
            law, coefficient = self.friction
            c = np.atleast_1d(coefficient)
            rate += add_friction(law, G, c, 1e3, self.plan[0], a[0], a[1], a[2], b[1], b[2])
        return rate

    def depth(self, y):
        return self.plan[0].reshape(self.ny, self.nx) + y[0]

    def advance(self, y, end, courant=0.45, most=1.0, watch=None):
        """SSP-RK2 for `upwind` and `muscl`, else SSP-RK3, to `end`."""
        y, k, t = y.copy(), np.zeros_like(y), 0.0
        while t < end:
            h = min(courant / self.rates(y, k), most, end - t)
            one = y + h * k
            self.rates(one, k)
            if self.scheme in (UPWIND, MUSCL):
                y = 0.5 * (y + (one + h * k))
            else:
                two = 0.75 * y + 0.25 * (one + h * k)
                self.rates(two, k)
                y = y / 3.0 + 2.0 / 3.0 * (two + h * k)
            t += h
            if watch is not None:
                watch(t, y)
        return y


def graded(n, size, ratio):
    """Faces whose spacing grows from 1 to `ratio` geometrically."""
    steps = ratio ** (np.arange(n) / max(n - 1, 1))
    return size * np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()


def even(n, size):
    return np.linspace(0.0, size, n + 1)


def middles(x):
    return 0.5 * (x[1:] + x[:-1])


def means(function, x):
    """Means of a function over cells, by Gauss's rule of five points."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    return sum(0.5 * w * function(middles(x) + 0.5 * np.diff(x) * s) for s, w in zip(nodes, weights, strict=True))


def slope(errors):
    """Order between the last two of errors on cells halved each time."""
    return math.log2(errors[-2] / errors[-1])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_lake_lies_at_rest_around_dry_islands_on_a_graded_grid(scheme):
    x, y = graded(40, 10.0, 5.0), graded(30, 8.0, 0.3)
    mx, my = np.meshgrid(middles(x), middles(y))
    bed = 0.2 * np.sin(3.0 * mx) * np.cos(2.0 * my) + 1.4 * np.exp(-((mx - 4.0) ** 2 + (my - 5.0) ** 2)) - 0.7
    bed[5:9, 20:26] = 0.4  # an island with cliffs
    water = Water(x, y, bed, scheme=scheme)
    assert 20 < (water.plan[0] == 0.0).sum() < 500
    still = np.zeros((3, 30, 40))
    k = np.ones_like(still)
    water.rates(still, k)
    assert not k.any() and not water.flow_x.any() and not water.flow_y.any()
    # the same lake described from another level, so that numbers round: 1000 steps
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
    h = np.where(rng.random((ny, nx)) < 0.2, 0.0, 0.2 * rng.random((ny, nx)) + 0.5 * (rng.random((ny, 1)) < 0.5))
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
def test_flows_through_faces_are_what_depth_changes_by_and_none_pass_a_wall(scheme):
    rng = np.random.default_rng(1)
    water = Water(graded(9, 3.0, 2.0), graded(7, 2.0, 0.5), rng.random((7, 9)) - 0.8, scheme=scheme)
    h, q = rng.random((7, 9)), rng.standard_normal((2, 7, 9))
    out = np.empty((3, 7, 9))
    water.rates(water.state(h, *q), out)
    fx, fy = water.flow_x.reshape(7, 10), water.flow_y.reshape(8, 9)
    assert not fx[:, [0, -1]].any() and not fy[[0, -1]].any() and fx.any() and fy.any()
    found = -water.kx * np.diff(fx, axis=1) - water.ky[:, None] * np.diff(fy, axis=0)
    assert found == approx(out[0], abs=1e-13 * abs(out[0]).max())


@pytest.mark.parametrize(("scheme", "courant"), [("upwind", 0.5), ("muscl", 0.5), ("upwind5", 0.16), ("weno5", 0.16)])
def test_no_depth_falls_below_zero_over_a_random_bed(scheme, courant):
    rng = np.random.default_rng(2)
    for limiter in range(MONOTONIZED_CENTRAL + 1):
        water = Water(even(24, 2.0), even(20, 2.0), rng.random((20, 24)), level=0.3, scheme=scheme, limiter=limiter)
        h = np.where(rng.random((20, 24)) < 0.5, 0.0, rng.random((20, 24)) ** 3)
        y, k = water.state(h, *(h * rng.standard_normal((2, 20, 24)))), np.empty((3, 20, 24))
        total = water.depth(y).sum()
        for _ in range(200):
            y = y + courant / water.rates(y, k) * k
            assert water.depth(y).min() > -1e-15
        assert water.depth(y).sum() == approx(total, rel=1e-13)


def bernoulli(q, energy, bed, fast=False):
    """Depth of a frictionless steady flow q [m2/s] of total head `energy` over a bed: the slow or the fast root."""
    head = energy - bed
    shape = np.arccos(np.clip(1.0 - 27.0 * q * q / (4.0 * G * head**3), -1.0, 1.0))
    return (
        head
        / 3.0
        * (1.0 + 2.0 * np.cos((shape + (2.0 * np.pi if fast else 0.0)) / 3.0 + (np.pi * 2.0 / 3.0 if fast else 0.0)))
    )


def bump(x):
    return 0.2 * np.exp(-(((x - 15.0) / 1.5) ** 2))


@pytest.mark.parametrize(("scheme", "low"), [("upwind", 0.9), ("muscl", 1.9), ("upwind5", 4.5), ("weno5", 4.5)])
@pytest.mark.parametrize("way", ["east", "north"])
def test_smooth_flow_over_a_bed_keeps_the_order_of_the_scheme(scheme, low, way):
    """Steady flow by Bernoulli, around the bump, before the waves that the walls send in get there."""
    q, end = 1.0, 1.5
    energy = 1.0 + 0.5 * q * q / G
    errors = []
    for n in (100, 200, 400):
        x, thin = even(n, 30.0), np.array([0.0, 1.0])
        bed, h = means(bump, x), means(lambda x: bernoulli(q, energy, bump(x)), x)
        if way == "east":
            water = Water(x, thin, bed, level=1.0, scheme=scheme)
            y = water.advance(water.state(h, q), end, courant=0.3 * (100 / n) ** 0.67)
        else:
            water = Water(thin, x, bed[:, None], level=1.0, scheme=scheme)
            y = water.advance(water.state(h[:, None], 0.0, q), end, courant=0.3 * (100 / n) ** 0.67)
        inside = abs(middles(x) - 15.0) < 6.0
        errors.append(abs(water.depth(y).ravel() - h)[inside].mean())
    print(errors)
    assert slope(errors) > low
