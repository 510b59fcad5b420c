"""Approximate Riemann solver of Harten, Lax and van Leer: exact fractions, equal states, mirror images, fast flow."""

from fractions import Fraction

import numpy as np
import pytest

from fvsolve.features.basins.hll_flux import hll_flux

G = 9.81


def arguments(low, high, a, b, u, v):
    """Arguments for depths a and b with velocities u and v, at wave speeds low and high."""
    push = 0.5 * G * ((b - a) * (b + a))
    return low, high, a, b, a * u, b * v, a * u * u, b * v * v, push


def states(count: int = 200):
    """Draw depths, velocities and wave speeds low <= 0 <= high that enclose those of both states."""
    draw = np.random.default_rng(7)
    for _ in range(count):
        a, b = draw.uniform(0.0, 3.0, 2)
        u, v = draw.normal(0.0, 4.0, 2)
        c = (G * max(a, b)) ** 0.5
        yield min(u - c, v - c, 0.0), max(u + c, v + c, 0.0), a, b, u, v


def test_the_flux_is_the_formula_in_exact_fractions():
    for state in states():
        low, high, a, b, qa, qb, fa, fb, push = map(Fraction, arguments(*state))
        wide = high - low
        mass = (high * qa - low * qb + low * high * (b - a)) / wide
        flow = (high * fa - low * fb + low * high * (qb - qa)) / wide
        exact = mass, flow - low / wide * push, flow - high / wide * push
        size = float(sum(map(abs, (qa, qb, fa, fb, push, low * high * (b - a), high * qb))))
        for found, value in zip(hll_flux(*arguments(*state)), exact, strict=True):
            assert abs(found - float(value)) < 4e-15 * size


def test_a_mirror_image_has_the_opposite_flux_to_the_bit():
    for low, high, a, b, u, v in states():
        mass, before, after = hll_flux(*arguments(low, high, a, b, u, v))
        other = hll_flux(*arguments(-high, -low, b, a, -v, -u))
        assert other == (-mass, after, before)


@pytest.mark.parametrize("depth", [0.0, 1e-9, 0.7, 12.3])
def test_water_at_rest_stays_at_rest_to_the_bit(depth):
    c = (G * depth) ** 0.5
    assert hll_flux(*arguments(-c, c, depth, depth, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_equal_states_have_their_own_flux():
    for low, high, a, _, u, _ in states():
        mass, before, after = hll_flux(*arguments(low, high, a, a, u, u))
        scale = a * max(high, -low) * (1.0 + abs(u))
        assert abs(mass - a * u) < 4e-15 * scale and before == after
        assert abs(before - a * u * u) < 4e-15 * scale * (1.0 + abs(u))


def test_flow_faster_than_its_waves_passes_unchanged():
    low, high, a, b, u, v = 0.0, 9.0, 1.2, 0.4, 6.0, 5.0
    mass, before, _ = hll_flux(*arguments(low, high, a, b, u, v))
    assert (mass, before) == pytest.approx((a * u, a * u * u), rel=1e-15)
