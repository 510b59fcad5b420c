"""Stability functions R(s) of all methods; A-, L-, I-stability, intervals and SSP radii against published values."""

import cmath
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples

from fvsolve.core.steppers import (
    METHODS,
    analyse,
    global_error,
    local_error,
    pade,
    seen_frequency,
    stability_function,
)
from fvsolve.core.steppers.analysis.stability_function import by_determinants, by_resolvent
from fvsolve.core.steppers.numbers.polynomial import (
    Polynomial,
    count_roots,
    first_sign_change,
    odd_part,
    roots_right,
)
from fvsolve.core.steppers.tableau import Method
from fvsolve.errors import FvsolveError

NAMES = [name for name, method in METHODS.items() if name == method.name]
L_STABLE = {
    "implicit-euler",
    "lobatto-iiic-2",
    "lobatto-iiic-4",
    "radau-ia-3",
    "radau-ia-5",
    "radau-iia-3",
    "radau-iia-5",
    "radau-iia-9",
    "alexander-2",
    "alexander-3",
    "tr-bdf2",
    "esdirk-3",
    "esdirk-4",
    "esdirk-5",
    "rodas-4",
    "rodas-5p",
}
A_STABLE = L_STABLE | {
    "implicit-midpoint",
    "gauss-4",
    "gauss-6",
    "trapezoid",
    "lobatto-iiia-4",
    "lobatto-iiia-6",
    "crouzeix-3",
    "crouzeix-4",
}
SIXTH = (4.0 + math.sqrt(17.0)) ** (1 / 3)
REAL = {  # greatest stable |h lambda| on the negative real axis
    "euler": 2.0,
    "improved-euler": 2.0,
    "modified-euler": 2.0,
    "ralston": 2.0,
    "ssp-rk2": 2.0,
    "heun": 1.0 + SIXTH - 1.0 / SIXTH,
    "kutta-3": 1.0 + SIXTH - 1.0 / SIXTH,
    "ssp-rk3": 1.0 + SIXTH - 1.0 / SIXTH,
    "bogacki-shampine": 1.0 + SIXTH - 1.0 / SIXTH,
    "rk4": 2.785293563405282,
    "three-eighths": 2.785293563405282,
}
IMAGINARY = {
    **dict.fromkeys(
        ["euler", "improved-euler", "modified-euler", "ralston", "ssp-rk2", "verner-7"], 0.0
    ),
    **dict.fromkeys(["heun", "kutta-3", "ssp-rk3", "bogacki-shampine"], math.sqrt(3.0)),
    **dict.fromkeys(["rk4", "three-eighths"], 2.0 * math.sqrt(2.0)),
}
SSP = {  # Kraaijevanger 1991, Ketcheson 2008, Ferracina and Spijker 2008
    "euler": 1.0,
    "improved-euler": 1.0,
    "ssp-rk2": 1.0,
    "ssp-rk3": 1.0,
    "ssp-rk10-4": 6.0,
    "ralston": 0.5,
    "implicit-euler": math.inf,
    "implicit-midpoint": 2.0,
    "trapezoid": 2.0,
    "alexander-2": 1.0 + math.sqrt(2.0),
    "tr-bdf2": 1.0 + math.sqrt(2.0),
}


def user(text: str, **more) -> Method:
    """Method that is not registered, with a tableau given as text."""
    return Method("user", "test", text, **more)


@pytest.mark.parametrize("name", NAMES)
def test_a_and_l_stability_are_those_of_the_books(name):
    found = analyse(name)
    assert (found.a_stable, found.l_stable) == (name in A_STABLE, name in L_STABLE)
    assert found.i_stable == found.a_stable
    assert found.angle == (90.0 if found.a_stable else None)


@pytest.mark.parametrize("name", NAMES)
def test_intervals_are_infinite_for_a_stable_methods_and_finite_for_explicit_ones(name):
    found = analyse(name)
    for end in (found.real_interval, found.imaginary_interval):
        assert math.isinf(end) == found.a_stable


@pytest.mark.parametrize("name", REAL)
def test_real_intervals_in_closed_form(name):
    assert analyse(name).real_interval == pytest.approx(REAL[name], rel=1e-13)


@pytest.mark.parametrize("name", IMAGINARY)
def test_imaginary_intervals_in_closed_form(name):
    assert analyse(name).imaginary_interval == pytest.approx(IMAGINARY[name], rel=1e-13, abs=0.0)


@pytest.mark.parametrize("name", [name for name in NAMES if METHODS[name].explicit])
def test_intervals_end_where_the_modulus_crosses_1(name):
    """Stability intervals end at a root of |R|^2 - 1, found by NumPy instead of Sturm sequences."""
    found = analyse(name)
    up = np.array([float(x) for x in found.stability_function.numerator.coefficients])[::-1]
    for direction, end in ((-1.0, found.real_interval), (1j, found.imaginary_interval)):
        p = up * direction ** np.arange(len(up))[::-1]
        edge = np.polymul(p, p.conj())
        edge[-1] -= 1.0
        roots = np.roots(edge)
        if end == 0.0:
            assert abs(found.stability_function(direction * 0.5)) > 1.0
            continue
        assert np.min(np.abs(roots - end)) < 1e-6
        inside = np.abs(found.stability_function(direction * np.linspace(0.0, end, 400)))
        assert (
            np.all(inside <= 1.0 + 1e-14)
            and abs(found.stability_function(direction * end * 1.001)) > 1.0
        )


@pytest.mark.parametrize(
    "name, real", [("dormand-prince", 3.3066), ("tsitouras", 3.5068), ("ssp-rk10-4", 13.917)]
)
def test_intervals_of_larger_methods_are_those_published(name, real):
    assert analyse(name).real_interval == pytest.approx(real, abs=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_ssp_radii_are_those_published(name):
    assert analyse(name).ssp_radius == pytest.approx(SSP.get(name, 0.0), rel=1e-13, abs=0.0)


@pytest.mark.parametrize(
    "text, radius",
    [
        ("0 |\n1/2 | 1/2\n1 | 1/2 1/2\n-\n| 1/3 1/3 1/3", 2.0),  # SSPRK(3,2)
        ("0 |\n1/2 | 1/2\n1 | 1/2 1/2\n1/2 | 1/6 1/6 1/6\n-\n| 1/6 1/6 1/6 1/2", 2.0),  # SSPRK(4,3)
        ("1/4 | 1/4\n3/4 | 1/2 1/4\n-\n| 1/2 1/2", 4.0),  # optimal SDIRK, two stages, order 2
    ],
)
def test_ssp_radii_of_optimal_methods(text, radius):
    assert analyse(user(text)).ssp_radius == pytest.approx(radius, rel=1e-13)


ALEXANDER = "g | g\n(1+g)/2 | (1-g)/2 g\n1 | (-6g^2+16g-1)/4 (6g^2-20g+5)/4 g\n-\n| (-6g^2+16g-1)/4 (6g^2-20g+5)/4 g"


@pytest.mark.parametrize("near", [0.158984, 2.40515])
def test_the_other_roots_of_alexanders_polynomial_vanish_at_infinity_but_are_not_a_stable(near):
    found = analyse(user(ALEXANDER, numbers={"g": ("x^3-3x^2+3x/2-1/6", near)}))
    assert found.order == 3 and not found.a_stable and not found.l_stable
    r = found.stability_function
    assert r.numerator.degree < r.denominator.degree
    x = np.geomspace(1e-4, 1e6, 4001)
    largest = 90.0
    for degrees in np.arange(90.0, 0.0, -0.05):
        largest = degrees
        if np.max(np.abs(r(-x * np.exp(1j * np.radians(degrees))))) <= 1.0:
            break
    assert found.angle == pytest.approx(largest, abs=0.06)


def test_the_sdirk_of_order_three_is_a_stable_for_a_single_sign_of_the_root():
    small = (
        METHODS["crouzeix-3"]
        .text.replace("(3+sqrt(3))/6", "y")
        .replace("(3-sqrt(3))/6", "(3+sqrt(3))/6")
    )
    found = analyse(user(small.replace("y", "(3-sqrt(3))/6").replace("-sqrt(3)/3", "sqrt(3)/3")))
    assert found.order == 3 and not found.a_stable and found.angle is None


def test_common_factors_do_not_count():
    """An unused stage with a pole on the left does not change the stability of the implicit midpoint method."""
    found = analyse(user("1/2 | 1/2 0\n-1 | 0 -1\n-\n| 1 0"))
    assert found.pade == (1, 1) and found.a_stable and found.ssp_radius == 2.0


def test_a_pole_on_the_left_is_no_a_stability_even_where_the_imaginary_axis_is_stable():
    """R(s) = (1 + s) (1 - s/2) / ((1 - s) (1 + s/2)) has modulus 1 on the imaginary axis and a pole at -2."""
    found = analyse(user("1 | 1 0\n-1/2 | 0 -1/2\n-\n| 2/3 1/3"))
    assert found.i_stable and math.isinf(found.imaginary_interval)
    assert not found.a_stable and found.real_interval < 2.0


def test_a_rounded_tableau_is_decided_as_its_source_means_it():
    gauss = (
        "0.21132486540518711775 | 0.25 -0.03867513459481288225\n0.78867513459481288225 | "
        "0.53867513459481288225 0.25\n-\n| 0.5 0.5"
    )
    found = analyse(user(gauss))
    assert (found.order, found.stage_order, found.pade, found.digits) == (4, 2, (2, 2), 20)
    assert (
        found.a_stable
        and found.i_stable
        and not found.l_stable
        and math.isinf(found.imaginary_interval)
    )


def in_decimals(name: str, digits: int) -> Method:
    """Method with a tableau in decimals of `digits` digits."""
    m = METHODS[name]
    rows = [(c, *row) for c, row in zip(m.exact.c, m.exact.a, strict=True)]
    said = [[f"{float(x):.{digits}g}" for x in row] for row in (*rows, m.exact.b)]
    text = "\n".join(f"{row[0]} | {' '.join(row[1:])}" for row in said[:-1])
    return user(f"{text}\n-\n| {' '.join(said[-1])}")


@pytest.mark.in_turn
@pytest.mark.parametrize("name", [name for name in NAMES if METHODS[name].kind != "linear"])
@pytest.mark.parametrize("digits", [16, 10])
def test_decimals_lead_to_the_same_decisions(name, digits):
    exact, found = analyse(name), analyse(in_decimals(name, digits))
    for fact in ("a_stable", "l_stable", "i_stable", "angle", "pade", "stiffly_accurate"):
        assert getattr(found, fact) == getattr(exact, fact), fact
    for fact in ("real_interval", "imaginary_interval", "ssp_radius"):
        assert getattr(found, fact) == pytest.approx(
            getattr(exact, fact), rel=10.0 ** (5 - digits)
        ), fact
    if digits == 16:
        assert (found.order, found.stage_order) == (exact.order, exact.stage_order)


def test_json_has_none_for_infinity():
    plain = analyse("implicit-euler").plain()
    assert plain["real_interval"] is plain["imaginary_interval"] is plain["ssp_radius"] is None
    assert (
        plain["numerator"] == [1.0]
        and plain["denominator"] == [1.0, -1.0]
        and plain["pade"] == (0, 1)
    )


number = st.fractions(min_value=-1, max_value=2, max_denominator=6)


@examples(80)
@given(st.lists(number, min_size=4, max_size=4), number)
def test_decisions_agree_with_samples_for_any_two_stage_method(a, b):
    rows = "\n".join(f"{sum(row)} | {row[0]} {row[1]}" for row in (a[:2], a[2:]))
    found = analyse(user(f"{rows}\n-\n| {b} {1 - b}"))
    r = found.stability_function
    y = np.concatenate([np.geomspace(1e-3, 1e5, 4001), [1e9]])
    with np.errstate(divide="ignore", invalid="ignore"):
        above = float(np.nanmax(np.abs(r(1j * y)))) - 1.0
    if above > 1e-9:
        assert not found.i_stable and not found.a_stable
    elif above < -1e-9:
        assert found.i_stable
    poles = np.roots([float(x) for x in r.denominator.coefficients][::-1])
    if np.any(poles.real < -1e-9):
        assert not found.a_stable
    if found.a_stable:
        far = -y[:, None] * np.exp(1j * np.linspace(-1.5, 1.5, 7))
        assert np.max(np.abs(r(far))) <= 1.0 + 1e-9 and math.isinf(found.real_interval)


def test_sturm_counts_different_real_roots():
    p = Polynomial([-2, 0, 1]) * Polynomial([-1, 1]) ** 3 * Polynomial([1, 0, 1])
    assert count_roots(p) == 3
    assert count_roots(p, Fraction(0), Fraction(7, 5)) == 1
    assert odd_part(p * Polynomial([5, 1]) ** 2).monic() == odd_part(p).monic()


def test_a_touching_root_is_no_change_of_sign():
    touching = Polynomial([-1, 1]) ** 2 * Polynomial([3, -1])
    assert first_sign_change(touching) == 3.0
    assert first_sign_change(Polynomial([-1, 1]) ** 2) is None


def test_routh_decides_the_side_of_roots():
    assert roots_right(Polynomial([2, -3, 1])) and roots_right(Polynomial([1, -1]) ** 4)
    assert not roots_right(Polynomial([-2, 1, 1])) and not roots_right(Polynomial([1, 0, 1]))


def test_routh_agrees_with_roots_of_numpy():
    """Products of random factors with roots a + b i, a - b i and c; coefficients alone do not decide all of them."""
    random, found = np.random.default_rng(11), []
    for _ in range(60):
        p = Polynomial([1])
        for a, b, c in random.choice([-1, 1, 2, 3, 5, 8, 9], (3, 3), p=[0.1] + [0.15] * 6).tolist():
            p = p * Polynomial([a * a + b * b, -2 * a, 1]) * Polynomial([-abs(c), 1])
        found.append(roots_right(p))
        assert found[-1] == bool(
            np.all(np.roots([float(x) for x in p.coefficients][::-1]).real > 0.0)
        )
    assert 10 < sum(found) < 50


@pytest.mark.parametrize("root", [1, 2, 3, Fraction(1, 2), Fraction(5, 7), 1024])
def test_a_change_of_sign_is_located_where_bisection_hits_it_exactly(root):
    for sign in (1, -1):
        assert first_sign_change(Polynomial([-root, 1]) * sign) == float(root)
        assert first_sign_change(Polynomial([0, -root, 1]) * sign) == float(root)


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
def test_r_is_the_result_of_the_tableau_for_y_prime_is_lambda_y(name):
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
def test_the_entry_of_the_pade_table_is_identified(name):
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
def test_an_entry_agrees_with_the_exponential_in_exactly_k_plus_m_plus_1_powers(k, m):
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


@pytest.mark.parametrize(
    "name", ["euler", "heun", "rk4", "implicit-euler", "gauss-4", "radau-iia-3", "esdirk-3"]
)
def test_local_error_is_a_single_order_above_global_error(name):
    p, lam, end = analyse(name).order, -1.0 + 2.0j, 2.0
    steps = [80, 160, 320]
    local = [abs(local_error(name, lam, end / n)) for n in steps]
    whole = [abs(global_error(name, lam, end / n, n)) for n in steps]
    for errors, order in ((local, p + 1), (whole, p)):
        assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.1)


def test_global_error_is_the_sum_of_local_errors_carried_on():
    name, lam, h, n = "rk4", -0.4 + 1.5j, 0.3, 12
    r = analyse(name).stability_function(h * lam)
    carried = sum(
        r ** (n - 1 - k) * local_error(name, lam, h, cmath.exp(k * h * lam)) for k in range(n)
    )
    assert global_error(name, lam, h, n) == pytest.approx(carried, abs=1e-15)


@pytest.mark.parametrize("omega", [0.5, 3.0, 40.0, 1e4])
def test_an_a_stable_method_slows_modes_that_are_too_fast(omega):
    h = 0.1
    for name in ("implicit-midpoint", "trapezoid"):
        assert seen_frequency(name, omega, h) == pytest.approx(
            2.0 / h * math.atan(omega * h / 2.0), rel=1e-12
        )
    for name in ("gauss-4", "gauss-6", "radau-iia-5", "lobatto-iiic-4"):
        seen = seen_frequency(name, omega, h)
        assert seen <= math.pi / h * (1 + 1e-15)
        assert seen == pytest.approx(omega, rel=1e-4) if omega < 4.0 else seen < omega


def test_an_unknown_name_suggests_the_nearest():
    with pytest.raises(FvsolveError, match='did you mean "radau-iia-5"'):
        analyse("radau-iia-55")


wide_number = st.fractions(min_value=-2, max_value=2, max_denominator=12)


@examples(60)
@given(
    st.integers(1, 4).flatmap(
        lambda s: st.lists(
            st.lists(wide_number, min_size=s, max_size=s), min_size=s + 1, max_size=s + 1
        )
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
        assert complex(up(s)) / complex(down(s)) == pytest.approx(
            1.0 + s * (exact[1] @ k), rel=1e-9, abs=1e-9
        )
