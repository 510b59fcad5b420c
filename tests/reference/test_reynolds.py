"""Reynolds' transport theorem, equations (71) to (76), term by term; (73) to (75) hold for the material volume.

The terms are integrals over intervals, quadrilaterals and their sides, and derivatives by differences.
"""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(24)
STEP = 1e-3


def rate(of: Callable[[float], np.ndarray], t: float) -> np.ndarray:
    """Derivative by central differences of sixth order."""
    sides = [of(t + k * STEP) - of(t - k * STEP) for k in (1, 2, 3)]
    return (45 * sides[0] - 9 * sides[1] + sides[2]) / (60 * STEP)


def on_interval(of: Callable, a: float, b: float) -> float:
    """Integral of a function of x."""
    x = 0.5 * (b - a) * POINTS + 0.5 * (a + b)
    return 0.5 * (b - a) * float(np.sum(WEIGHTS * of(x)))


def inside(of: Callable, corners: np.ndarray) -> float:
    """Integral of a function of x and y over a quadrilateral; corners : float64[4, 2], counter-clockwise."""
    s, t = np.meshgrid(POINTS, POINTS, indexing="ij")
    shape = (
        np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)]) / 4
    )
    along_s = np.array([-(1 - t), 1 - t, 1 + t, -(1 + t)]) / 4
    along_t = np.array([-(1 - s), -(1 + s), 1 + s, 1 - s]) / 4
    x, y = (np.tensordot(corners[:, k], shape, 1) for k in (0, 1))
    xs, ys, xt, yt = (
        np.tensordot(corners[:, k], slope, 1) for slope in (along_s, along_t) for k in (0, 1)
    )
    return float(np.sum(np.outer(WEIGHTS, WEIGHTS) * (xs * yt - xt * ys) * of(x, y)))


def around(of: Callable, corners: np.ndarray, speeds: np.ndarray | None = None) -> float:
    """Integral of (phi v) . n over the sides of a quadrilateral.

    of(x, y) : phi v as float64[2, ...], or phi if `speeds` gives the velocities of the corners
    """
    total = 0.0
    for k in range(4):
        start, end = corners[k], corners[(k + 1) % 4]
        share = 0.5 * (POINTS + 1)
        x, y = (start[i] + share * (end[i] - start[i]) for i in (0, 1))
        # outward normal with the length of the side
        normal = np.array([end[1] - start[1], start[0] - end[0]])
        carried = of(x, y)
        if speeds is not None:
            carried = carried * (
                np.outer(speeds[k], 1 - share) + np.outer(speeds[(k + 1) % 4], share)
            )
        total += 0.5 * float(np.sum(WEIGHTS * (normal @ carried)))
    return total


T = 0.3
CORNERS = np.array([[0.0, 0.0], [2.0, 0.2], [1.8, 1.5], [-0.3, 1.1]])
SPEEDS = np.array([[0.4, -0.2], [0.7, 0.1], [-0.3, 0.9], [0.2, 0.5]])  # velocities of the corners


def phi(x, y, t):
    return np.sin(x + 0.5 * t) * np.exp(-0.3 * y) + t * x * y


def flow(x, y, t):
    """Velocity field with nonzero divergence."""
    return np.array([0.5 * x - 0.2 * y + 0.1 * t, 0.3 * x * y - 0.4 * np.ones_like(x)])


def divergence(x, y, t):
    return 0.5 + 0.3 * x


def carried(x, y, t):
    return phi(x, y, t) * flow(x, y, t)


def phi_rate(x, y, t):
    return rate(lambda s: phi(x, y, s), t)


def corners(t):
    return CORNERS + t * SPEEDS


def test_a_volume_that_moves_on_an_interval_71():
    def ends(t):
        return 0.2 - 0.5 * t + t * t, 1.5 + 0.8 * t

    def field(x, t):
        return np.sin(3 * x) + t * x

    whole = rate(lambda t: on_interval(lambda x: field(x, t), *ends(t)), T)
    (a, b), (va, vb) = ends(T), (-0.5 + 2 * T, 0.8)
    within = on_interval(lambda x: rate(lambda s: field(x, s), T), a, b)
    assert_allclose(whole, within + vb * field(b, T) - va * field(a, T), rtol=1e-10)


def test_a_volume_that_moves_in_the_plane_71():
    whole = rate(lambda t: inside(lambda x, y: phi(x, y, t), corners(t)), T)
    within = inside(lambda x, y: phi_rate(x, y, T), corners(T))
    through = around(lambda x, y: phi(x, y, T), corners(T), SPEEDS)
    assert_allclose(whole, within + through, rtol=1e-10)
    assert abs(through) > 0.1 * abs(whole)


@pytest.fixture(scope="module")
def material() -> float:
    """Rate of the integral of phi over the material volume that is the quadrilateral at time T."""

    def moved(x, y, t):
        """Positions at time t of points at (x, y) at time T, and the area ratio there."""
        n = x.size

        def along(s, z):
            u, v = flow(z[:n], z[n : 2 * n], s)
            return np.concatenate([u, v, divergence(z[:n], z[n : 2 * n], s) * z[2 * n :]])

        start = np.concatenate([x.ravel(), y.ravel(), np.ones(n)])
        end = solve_ivp(along, (T, t), start, rtol=1e-12, atol=1e-13).y[:, -1] if t != T else start
        return [one.reshape(x.shape) for one in np.split(end, 3)]

    def content(t):
        def weighed(x, y):
            at_x, at_y, larger = moved(x, y, t)
            return phi(at_x, at_y, t) * larger

        return inside(weighed, corners(T))

    return rate(content, T)


def test_a_volume_of_matter_72_to_75(material):
    """The rate of a material volume is that of (72) to (75).

    The integrand is the divergence of phi v, or the substantial derivative of phi plus phi times the divergence of v.
    """
    within = inside(lambda x, y: phi_rate(x, y, T), corners(T))
    # (72), (73)
    assert_allclose(material, within + around(lambda x, y: carried(x, y, T), corners(T)), rtol=1e-8)
    together = inside(lambda x, y: phi_rate(x, y, T) + spread(x, y), corners(T))
    assert_allclose(material, together, rtol=1e-8)  # (75)
    substantial = inside(
        lambda x, y: followed(x, y) + phi(x, y, T) * divergence(x, y, T), corners(T)
    )
    assert_allclose(material, substantial, rtol=1e-8)  # (74)


def spread(x, y):
    """Divergence of phi v by differences."""
    return rate(lambda h: carried(x + h, y, T)[0] + carried(x, y + h, T)[1], 0.0)


def followed(x, y):
    """Substantial derivative D phi / Dt, by differences of phi along the path of a point."""
    u, v = flow(x, y, T)
    return rate(lambda h: phi(x + h * u, y + h * v, T + h), 0.0)


def test_a_control_volume_that_moves_differs_from_a_material_volume_73_to_75(material):
    """The rate of a volume V_c with arbitrary motion, printed in (73) to (75), is not that of the material volume."""
    whole = rate(lambda t: inside(lambda x, y: phi(x, y, t), corners(t)), T)
    assert abs(whole - material) > 0.05 * abs(material)


def test_a_volume_that_stands_76(material):
    fixed = rate(lambda t: inside(lambda x, y: phi(x, y, t), corners(T)), T)
    assert_allclose(fixed, material - around(lambda x, y: carried(x, y, T), corners(T)), rtol=1e-8)


def test_areas_of_a_quadrilateral_grow_by_the_sweep_of_its_sides():
    """Geometric conservation law: (71) with phi = 1."""
    whole = rate(lambda t: inside(lambda x, y: np.ones_like(x), corners(t)), T)
    assert_allclose(whole, around(lambda x, y: np.ones_like(x), corners(T), SPEEDS), rtol=1e-11)
