"""Every Runge-Kutta method has the order its source gives it, and not the next; by rooted trees and by running."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from numba import njit

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.steppers.methods import METHODS
from fvsolve.steppers.ode import integrate
from fvsolve.steppers.tableau import tableau

EXPLICIT = [
    "euler", "improved-euler", "modified-euler", "heun", "rk4", "ssp-rk2", "ssp-rk3", "bogacki-shampine",
    "dormand-prince",
]  # fmt: skip


def trees(order: int) -> list[tuple]:
    """All rooted trees with `order` nodes, each the sorted tuple of its branches."""
    if order == 1:
        return [()]
    found = set()

    def split(rest: int, most: int, branches: tuple):
        if rest == 0:
            found.add(tuple(sorted(branches, key=repr)))
            return
        for size in range(min(rest, most), 0, -1):
            for tree in trees(size):
                split(rest - size, size, (*branches, tree))

    split(order - 1, order - 1, ())
    return sorted(found, key=repr)


def size(tree: tuple) -> int:
    return 1 + sum(map(size, tree))


def density(tree: tuple) -> int:
    return size(tree) * math.prod(map(density, tree))


def weights(tree: tuple, a: list[list[Fraction]]) -> list[Fraction]:
    """Product over branches of A times their own weights (Butcher's elementary weights without b)."""
    found = [Fraction(1)] * len(a)
    for branch in tree:
        inner = weights(branch, a)
        found = [f * sum(row[j] * inner[j] for j in range(len(a))) for f, row in zip(found, a, strict=True)]
    return found


def holds(name: str, order: int, which: int = 0) -> bool:
    """Whether all order conditions of exactly this many nodes hold, in exact fractions."""
    a, *rows = METHODS[name].exact
    return all(
        sum(b * w for b, w in zip(rows[which], weights(tree, a), strict=True)) == Fraction(1, density(tree))
        for tree in trees(order)
    )


def test_rooted_trees_are_counted_as_in_the_books():
    assert [len(trees(k)) for k in range(1, 7)] == [1, 1, 2, 4, 9, 20]


@pytest.mark.parametrize("name", EXPLICIT)
def test_order_conditions_hold_up_to_the_order_and_not_beyond(name):
    order = METHODS[name].order
    assert all(holds(name, k) for k in range(1, order + 1))
    assert not holds(name, order + 1)


@pytest.mark.parametrize("name, order", [("bogacki-shampine", 2), ("dormand-prince", 4)])
def test_the_embedded_solution_has_its_order_and_not_the_next(name, order):
    assert METHODS[name].error_order == order
    assert all(holds(name, k, which=1) for k in range(1, order + 1))
    assert not holds(name, order + 1, which=1)


@njit
def pendulum(t, y):
    """A nonlinear, non-autonomous system whose trees all count."""
    return np.array([y[1], -np.sin(y[0]) + 0.3 * np.cos(t)])


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return integrate(pendulum, [1.0, 0.2], [0.0, 2.0], "dormand-prince", step=1e-3)[-1]


@pytest.mark.parametrize("name", EXPLICIT)
def test_the_compiled_stepper_shows_the_order(name, truth):
    steps = np.array([0.1, 0.05, 0.025])
    errors = [np.linalg.norm(integrate(pendulum, [1.0, 0.2], [0.0, 2.0], name, step=h)[-1] - truth) for h in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(METHODS[name].order, abs=0.35)


@pytest.mark.parametrize("name", ["bogacki-shampine", "dormand-prince"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-7])
def test_error_control_keeps_near_its_tolerance(name, rtol, truth):
    error = np.linalg.norm(integrate(pendulum, [1.0, 0.2], [0.0, 2.0], name, rtol=rtol)[-1] - truth)
    assert 1e-4 * rtol < error < 20 * rtol


def test_a_function_that_numba_refuses_gives_the_same_steps():
    def python_only(t, y):
        return [{"a": v}["a"] * complex(-1, 0).real for v in y]

    @njit
    def compiled(t, y):
        return -y

    times = [0.0, 0.5, 2.0]
    assert np.array_equal(
        integrate(python_only, [1.0, 2.0], times, rtol=1e-8), integrate(compiled, [1.0, 2.0], times, rtol=1e-8)
    )


def test_a_users_array_is_a_method_everywhere():
    fvsolve.tableau("ralston-test", order=2, text="""
        0   |
        2/3 | 2/3
        ----+--------
            | 1/4  3/4
    """)  # fmt: skip
    try:
        errors = [abs(integrate(lambda t, y: -y, [1.0], [0.0, 1.0], "ralston-test", step=h)[-1, 0] - math.exp(-1))
                  for h in (0.1, 0.05)]  # fmt: skip
        assert math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    finally:
        del METHODS["ralston-test"]


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("0 |\n1 | 1/2\n--+----\n | 1/2 1/2", "row 2 adds up to 1/2; wanted c = 1"),
        ("0 |\n1 | 1\n--+----\n | 1/2 1/4", "weights must add up to 1"),
        ("1 | 1\n--+----\n | 1", "row 1 is not explicit"),
        ("0 |\n1 | x\n--+----\n | 1/2 1/2", "is not a row of fractions"),
        ("0 |", "wanted rows, a ruled line and weights"),
        ("0\n--+--\n | 1", 'has no "|"'),
        ("0 |\n--+----\n | 1/2 1/2", "rows of 1 weights"),
    ],
)
def test_a_wrong_array_is_refused_with_its_fault(text, wanted):
    with pytest.raises(FvsolveError, match=wanted.replace("|", r"\|")):
        tableau("wrong", text)
    assert "wrong" not in METHODS


@pytest.mark.parametrize(
    "settings, wanted",
    [
        (dict(method="rk5"), 'no method named "rk5"; did you mean "rk4"'),
        (dict(method="rk4"), "rk4 has no error estimate; give step"),
        (dict(rtol=1e-6, step=0.1), "both set the step"),
        (dict(step=-1.0), "not a positive number"),
        (dict(rtol=math.nan), "not a positive number"),
    ],
)
def test_integrate_refuses_what_it_cannot_do(settings, wanted):
    with pytest.raises(FvsolveError, match=wanted):
        integrate(lambda t, y: -y, [1.0], [0.0, 1.0], **settings)


def test_integrate_stops_where_the_solution_ends():
    with pytest.raises(FvsolveError, match="dormand-prince stopped at t = 1"):
        integrate(lambda t, y: y * y, [1.0], [0.0, 2.0])
