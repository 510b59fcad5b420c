"""Stability functions R(s) of all methods: agreement of all forms, Pade entries of the books, and errors."""

from __future__ import annotations

import cmath
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples

from fvsolve.errors import FvsolveError
from fvsolve.steppers import METHODS, analyse, global_error, local_error, pade, seen_frequency, stability_function
from fvsolve.steppers.analysis.stability_function import by_determinants, by_resolvent
from fvsolve.steppers.numbers.polynomial import Polynomial

NAMES = [name for name, method in METHODS.items() if name == method.name]
PADE = {  # Hairer and Wanner 1996, IV.3 and IV.5
    "euler": (1, 0),
    "improved-euler": (2, 0),
    "modified-euler": (2, 0),
    "ralston": (2, 0),
    "ssp-rk2": (2, 0),
    "heun": (3, 0),
    "kutta-3": (3, 0),
    "ssp-rk3": (3, 0),
    "bogacki-shampine": (3, 0),
    "rk4": (4, 0),
    "three-eighths": (4, 0),
    "implicit-euler": (0, 1),
    "implicit-midpoint": (1, 1),
    "gauss-4": (2, 2),
    "gauss-6": (3, 3),
    "trapezoid": (1, 1),
    "lobatto-iiia-4": (2, 2),
    "lobatto-iiia-6": (3, 3),
    "lobatto-iiic-2": (0, 2),
    "lobatto-iiic-4": (1, 3),
    "radau-ia-3": (1, 2),
    "radau-ia-5": (2, 3),
    "radau-iia-3": (1, 2),
    "radau-iia-5": (2, 3),
    "radau-iia-9": (4, 5),
}


@pytest.mark.parametrize("name", NAMES)
def test_determinant_and_resolvent_forms_agree_exactly(name):
    exact = METHODS[name].exact
    assert by_determinants(exact.a, exact.b) == by_resolvent(exact.a, exact.b)


@pytest.mark.parametrize("name", NAMES)
def test_r_is_what_the_tableau_makes_of_y_prime_is_lambda_y(name):
    m, r = METHODS[name], stability_function(METHODS[name])
    for s in (0.3, -1.7, 0.4 + 1.1j, -2.0 + 0.6j, 2.3j):
        k = np.linalg.solve(np.eye(m.stages) - s * m.a, np.ones(m.stages))
        assert r(s) == pytest.approx(1.0 + s * (m.b @ k), abs=1e-12)


@pytest.mark.parametrize("name", [name for name in NAMES if METHODS[name].explicit])
def test_r_of_explicit_methods_is_a_polynomial_that_starts_as_the_exponential(name):
    r, p = stability_function(METHODS[name]), METHODS[name].order
    assert r.denominator == Polynomial([1])
    found = [float(x) for x in r.numerator.coefficients]
    assert found[: p + 1] == pytest.approx([1 / math.factorial(k) for k in range(p + 1)], abs=1e-16)
    if p == METHODS[name].stages:  # (17)
        assert r.numerator == Polynomial(Fraction(1, math.factorial(k)) for k in range(p + 1))


@pytest.mark.parametrize("name", NAMES)
def test_which_entry_of_the_pade_table_it_is(name):
    assert analyse(name).pade == PADE.get(name)


def test_the_pade_table_is_that_of_the_books():
    third = Fraction(1, 3)
    assert pade(1, 1) == (Polynomial([1, Fraction(1, 2)]), Polynomial([1, Fraction(-1, 2)]))
    assert pade(1, 2) == (Polynomial([1, third]), Polynomial([1, -2 * third, Fraction(1, 6)]))
    up, down = pade(2, 3)
    assert up.coefficients == (1, Fraction(2, 5), Fraction(1, 20))
    assert down.coefficients == (1, Fraction(-3, 5), Fraction(3, 20), Fraction(-1, 60))


@pytest.mark.parametrize("k", range(5))
@pytest.mark.parametrize("m", range(5))
def test_an_entry_agrees_with_the_exponential_in_exactly_k_plus_m_plus_one_powers(k, m):
    up, down = pade(k, m)
    series = Polynomial(Fraction(1, math.factorial(j)) for j in range(k + m + 3))
    rest = (up - down * series).coefficients
    assert not any(rest[: k + m + 1]) and rest[k + m + 1] != 0


@pytest.mark.parametrize("name", NAMES)
def test_the_test_system_sees_at_least_the_order(name):
    found = analyse(name)
    q, constant = found.stability_function.error_constant
    assert q >= found.order and constant != 0
    s = 0.02
    if q <= 3:
        error = found.stability_function(s) - cmath.exp(s)
        assert error == pytest.approx(found.error_constant * s ** (q + 1), rel=0.2)


@pytest.mark.parametrize("name", ["euler", "heun", "rk4", "implicit-euler", "gauss-4", "radau-iia-3", "esdirk-3"])
def test_local_error_is_one_order_above_global_error(name):
    p, lam, end = analyse(name).order, -1.0 + 2.0j, 2.0
    steps = [80, 160, 320]
    local = [abs(local_error(name, lam, end / n)) for n in steps]
    whole = [abs(global_error(name, lam, end / n, n)) for n in steps]
    for errors, order in ((local, p + 1), (whole, p)):
        assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.1)


def test_global_error_is_the_sum_of_local_errors_carried_on():
    name, lam, h, n = "rk4", -0.4 + 1.5j, 0.3, 12
    r = analyse(name).stability_function(h * lam)
    carried = sum(r ** (n - 1 - k) * local_error(name, lam, h, cmath.exp(k * h * lam)) for k in range(n))
    assert global_error(name, lam, h, n) == pytest.approx(carried, abs=1e-15)


@pytest.mark.parametrize("omega", [0.5, 3.0, 40.0, 1e4])
def test_an_a_stable_method_slows_what_is_too_fast(omega):
    h = 0.1
    for name in ("implicit-midpoint", "trapezoid"):
        assert seen_frequency(name, omega, h) == pytest.approx(2.0 / h * math.atan(omega * h / 2.0), rel=1e-12)
    for name in ("gauss-4", "gauss-6", "radau-iia-5", "lobatto-iiic-4"):
        seen = seen_frequency(name, omega, h)
        assert seen <= math.pi / h * (1 + 1e-15)
        assert seen == pytest.approx(omega, rel=1e-4) if omega < 4.0 else seen < omega


def test_an_unknown_name_suggests_the_nearest():
    with pytest.raises(FvsolveError, match='did you mean "radau-iia-5"'):
        analyse("radau-iia-55")


number = st.fractions(min_value=-2, max_value=2, max_denominator=12)


@examples(60)
@given(
    st.integers(1, 4).flatmap(
        lambda s: st.lists(st.lists(number, min_size=s, max_size=s), min_size=s + 1, max_size=s + 1)
    )
)
def test_the_forms_agree_for_any_array(rows):
    *a, b = rows
    assert by_determinants(a, b) == by_resolvent(a, b)
    up, down = by_resolvent(a, b)
    exact = np.array(a, dtype=float), np.array(b, dtype=float)
    s = 0.31 - 0.47j
    if abs(down(s)) > 1e-3:
        k = np.linalg.solve(np.eye(len(b)) - s * exact[0], np.ones(len(b)))
        assert complex(up(s)) / complex(down(s)) == pytest.approx(1.0 + s * (exact[1] @ k), rel=1e-9, abs=1e-9)
