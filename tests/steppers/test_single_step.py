"""One step against equations (14), (23) and (8) of the course, by formulas, SciPy's solver and exact Taylor series."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import root

from fvsolve.core.steppers import METHODS, analyse, integrate, method_named
from fvsolve.core.steppers.implicit import Rosenbrock

NAMES = [name for name, method in METHODS.items() if name == method.name]
EXPLICIT = [name for name in NAMES if METHODS[name].explicit]
IMPLICIT = [
    name
    for name in NAMES
    if not METHODS[name].explicit and not isinstance(METHODS[name], Rosenbrock)
]
START, H = np.array([1.0, 0.2]), 0.3


def f(t, y):
    return np.array([y[1] + 0.1 * t, -np.sin(y[0]) * y[1] + np.cos(t)])


@pytest.mark.parametrize("name", EXPLICIT)
def test_an_explicit_step_is_14(name):
    m = method_named(name)
    k = np.zeros((m.stages, 2))
    for i in range(m.stages):
        k[i] = f(0.5 + m.c[i] * H, START + H * (m.a[i] @ k))
    found = integrate(f, START, [0.5, 0.5 + H], name, step=H)[-1]
    assert found == pytest.approx(START + H * (m.b @ k), abs=1e-14)


@pytest.mark.parametrize("name", IMPLICIT)
def test_an_implicit_step_is_23(name):
    m = method_named(name)

    def remainder(flat):
        k = flat.reshape(m.stages, 2)
        stages = [f(0.5 + m.c[i] * H, START + H * (m.a[i] @ k)) for i in range(m.stages)]
        return (k - np.array(stages)).ravel()

    k = root(remainder, np.tile(f(0.5, START), m.stages), tol=1e-14).x.reshape(m.stages, 2)
    found = integrate(f, START, [0.5, 0.5 + H], name, step=H)[-1]
    assert found == pytest.approx(START + H * (m.b @ k), abs=1e-9)  # tolerance of Newton's method


@pytest.mark.parametrize(
    "name", [name for name in EXPLICIT if not METHODS[name].digits and METHODS[name].order < 5]
)
def test_a_step_has_the_terms_of_8_up_to_its_order_and_not_the_next(name):
    """A step has the Taylor terms (8) of y' = y^2 + t y + 1 up to its order, and a different next term.

    The derivatives are polynomials, so powers of h are exact.
    """
    m = method_named(name)
    p, y0, t0 = m.order, Fraction(2, 3), Fraction(1, 2)
    k = []
    for row, c in zip(m.exact.a, m.exact.c, strict=True):
        y = plus([y0], [0, *weighed(row, k)])
        time = [t0, c]
        k.append(cut(plus(times(y, y), times(time, y), [1]), p + 1))
    step = padded(plus([y0], [0, *weighed(m.exact.b, k)]), p + 2)
    taylor = exact(y0, t0, p + 1)
    assert step[: p + 1] == taylor[: p + 1] and step[p + 1] != taylor[p + 1]


def exact(y0: Fraction, t0: Fraction, terms: int) -> list:
    """Coefficients of the Taylor series of the solution in h, by (n + 1) y_n+1 = coefficient n of y^2 + t y + 1."""
    y = [y0]
    for n in range(terms):
        right = padded(plus(times(y, y), times([t0, 1], y), [1]), n + 1)
        y.append(Fraction(right[n], n + 1))
    return y


def plus(*polynomials) -> list:
    size = max(map(len, polynomials))
    return [sum(column) for column in zip(*(padded(one, size) for one in polynomials), strict=True)]


def padded(p: list, size: int) -> list:
    return [*p, *[Fraction(0)] * (size - len(p))]


def cut(p: list, size: int) -> list:
    return padded(p, size)[:size]


def times(p: list, q: list) -> list:
    found = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, x in enumerate(p):
        for j, z in enumerate(q):
            found[i + j] += x * z
    return found


def weighed(weights, k: list) -> list:
    return plus([Fraction(0)], *([w * x for x in one] for w, one in zip(weights, k, strict=False)))


def test_a_modulus_of_1_is_enough_for_13_only_with_all_eigenvectors():
    """With |R| = 1 steps of a defective Jacobian grow linearly, and those of a diagonal Jacobian do not."""

    def apart(t, y):
        return np.array([-2.0 * y[0], -2.0 * y[1]])

    def together(t, y):
        return np.array([-2.0 * y[0] + y[1], -2.0 * y[1]])

    assert abs(analyse("euler").stability_function(-2.0)) == 1.0
    ends = {
        f: integrate(f, [0.0, 1.0], np.arange(101.0), "euler", step=1.0)[-1]
        for f in (apart, together)
    }
    assert ends[apart] == pytest.approx([0.0, 1.0]) and ends[together] == pytest.approx(
        [-100.0, 1.0]
    )


def test_implicit_euler_is_stable_outside_the_circle_about_1_27():
    """Implicit Euler is stable outside the circle |h lambda - 1| = 1 and unstable inside."""
    r = analyse("implicit-euler").stability_function
    s = np.add.outer(np.linspace(-4, 4, 81), 1j * np.linspace(-4, 4, 81))
    off = np.abs(s - 1.0)
    assert np.array_equal(
        np.abs(r(s[off > 1 + 1e-9])) < 1.0, np.ones(np.sum(off > 1 + 1e-9), dtype=bool)
    )
    assert (np.abs(r(s[(off < 1 - 1e-9) & (off > 0)])) > 1.0).all()
