"""`positive_real` on textbook functions, boundary cases, narrow bands, hidden modes and random passive networks."""

import math
from decimal import Decimal
from fractions import Fraction as F

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from pytest import approx

from fvsolve.core.steppers.numbers.polynomial import Polynomial
from fvsolve.errors import FvsolveError
from fvsolve.studies import positive_real
from fvsolve.studies.ports.positive_real import locate_roots

S = [1, 0]  # the polynomial s


def times(*factors):
    """Exact product of polynomials, highest power first."""
    found = Polynomial([1])
    for factor in factors:
        found = found * Polynomial([F(x) for x in factor][::-1])
    return list(found.coefficients[::-1])


YES = {
    "resistor": ([3], [1]),
    "zero": ([0], [1]),
    "capacitor 1/s": ([1], S),
    "inductor s": (S, [1]),
    "s + 1/s": ([1, 0, 1], S),
    "(s+2)/(s+1)": ([1, 2], [1, 1]),
    "(s+1)/(s+2)": ([1, 1], [1, 2]),
    "1/(s+1)": ([1], [1, 1]),
    "tank circuit s/(s^2+1)": (S, [1, 0, 1]),
    "Foster (s^2+1)/(s(s^2+4))": ([1, 0, 1], [1, 0, 4, 0]),
    "Foster of poles and zeros by turns": ([1, 0, 4, 0, 3], [1, 0, 2, 0]),
    "PI (s+1)/s": ([1, 1], S),
    "Brune, touches at sqrt 2": ([1, 1, 1], [1, 1, 4]),
    "touches at 0": ([1, 0], [1, 1]),
    "touches at infinity": ([1, 1], [1, 1, 1]),
    "Khalil (s+3)/(s+1)(s+2)": ([1, 3], [1, 3, 2]),
    "improper s + 1/(s+1)": ([1, 1, 1], [1, 1]),
}
NO = {
    "negative resistor": ([-1], [1], "Re H"),
    "1/s^2": ([1], [1, 0, 0], "order 2"),
    "s^2": ([1, 0, 0], [1], "infinity has order 2"),
    "-s": ([-1, 0], [1], "infinity has the negative residue -1"),
    "-1/s": ([-1], S, "s = 0 has the negative residue -1"),
    "two lags 1/(s+1)^2": ([1], [1, 2, 1], "w > 1 rad/s"),
    "1/(s-1)": ([1], [1, -1], "right half plane, near s = 1"),
    "(s-1)/(s+1)": ([1, -1], [1, 1], "0 < w < 1"),
    "oscillator 1/(s^2+1)": ([1], [1, 0, 1], "not real"),
    "negative tank": ([-1, 0], [1, 0, 1], "w = 1 rad/s has the negative residue -0.5"),
    "double tank": ([1, 0], [1, 0, 2, 0, 1], "w = 1 rad/s has order 2"),
    "Khalil 1/(s^2+s+1)": ([1], [1, 1, 1], "w > 1 rad/s"),
    "(s+4)/(s+1)(s+2)": ([1, 4], [1, 3, 2], "w > 2.82842712475 rad/s"),
    "pole on the axis and a right one": ([1], [1, -1, 1, -1], "near s = 1"),
    "two zeros side by side": (
        [1, 0, 4, 0, 3, 0],
        [1, 0, 6, 0, 8],
        "w = 1.41421356237 rad/s has the negative residue",
    ),
    "one residue of two negative": (
        [0, -1, 0, 2, 0],
        [1, 0, 5, 0, 4],
        "w = 2 rad/s has the negative residue",
    ),
}


@pytest.mark.parametrize("name", YES)
def test_textbook_functions_that_are_positive_real(name):
    found = positive_real(*YES[name])
    assert found.positive_real and found and not found.bands, found.reason


@pytest.mark.parametrize("name", NO)
def test_textbook_functions_that_are_not_with_reasons(name):
    n, d, why = NO[name]
    found = positive_real(n, d)
    assert not found.positive_real and not found and why in found.reason, found.reason


def test_the_inverse_is_positive_real_exactly_for_a_positive_real_function():
    for n, d in YES.values():
        if any(n):
            assert positive_real(d, n)
    for n, d, _ in NO.values():
        assert not positive_real(d, n)


def test_connected_passive_systems_parallel_yes_series_product_no():
    assert positive_real(*YES["s + 1/s"])
    assert not positive_real(times([1], [1]), times(S, S))  # 1/s times 1/s


def closed(h, g):
    """Feedback h / (1 + h g), highest power first."""
    (n, d), (m, e) = h, g
    return times(n, e) or [0], total(times(d, e), times(n, m))


def total(p, q):
    found = Polynomial(p[::-1]) - Polynomial([-1]) * Polynomial(q[::-1])
    return list(found.coefficients[::-1])


@pytest.mark.parametrize("name", YES)
@pytest.mark.parametrize(
    "back", ["resistor", "capacitor 1/s", "inductor s", "1/(s+1)", "PI (s+1)/s"]
)
def test_passive_systems_in_feedback_are_passive(name, back):
    assert positive_real(*closed(YES[name], YES[back]))


def test_stable_systems_in_feedback_need_not_be_stable():
    # 1 / (s + 1)^3 is not passive, and its feedback is unstable above a gain of 8
    three = ([1], [1, 3, 3, 1])
    assert not positive_real(*three)
    assert max(np.roots([float(x) for x in closed(three, ([9], [1]))[1]]).real) > 0.0
    assert max(np.roots([float(x) for x in closed(three, ([7], [1]))[1]]).real) < 0.0


def in_the_right_half_plane(n, d):
    """Least Re H / |H| right of the axis, near poles and zeros and far from them; greatest |Im H| on the real axis."""
    poles, zeros = (np.roots([float(x) for x in p]) for p in (d, n))
    about = np.concatenate([poles, zeros, [0.0]])
    rings = about[:, None, None] + np.geomspace(1e-4, 1e4, 65)[:, None] * np.exp(
        1j * np.linspace(-np.pi, np.pi, 181)
    )
    s, real = rings[rings.real > 0], np.geomspace(1.1e-4, 1.1e4, 99) + 0j

    def h(s):
        below = np.polyval([float(x) for x in d], s)
        return np.polyval([float(x) for x in n], s[below != 0]) / below[below != 0]

    size = np.abs(h(s))
    return np.min(h(s).real / np.where(size > 0, size, 1.0)), np.max(np.abs(h(real).imag))


@pytest.mark.parametrize("name", YES)
def test_the_theorem_agrees_with_the_definition(name):
    """Definition of section 4.1, sampled: H is real for positive s, and Re H >= 0 right of the axis."""
    least, imaginary = in_the_right_half_plane(*YES[name])
    assert least > -1e-9 and imaginary == 0.0


@pytest.mark.parametrize("name", NO)
def test_functions_refused_by_the_theorem_fail_the_definition(name):
    assert in_the_right_half_plane(*NO[name][:2])[0] < -1e-3


def test_residues_of_a_foster_form():
    # (s^2 + 1) / (s (s^2 + 4)) = (1/4)/s + (3/4) s/(s^2 + 4): residues 1/4 at 0 and 3/8 at 2j
    poles = positive_real(*YES["Foster (s^2+1)/(s(s^2+4))"]).axis_poles
    assert [(p.frequency, p.order, p.residue) for p in poles] == [(0.0, 1, 0.25), (2.0, 1, 0.375)]
    at_infinity = positive_real([3, 0, 1], [2, 0]).axis_poles[0]
    assert (at_infinity.frequency, at_infinity.residue) == (math.inf, 1.5)


def test_a_residue_that_is_not_real():
    # 1 / (s^2 + 1) at s = j: 1 / 2j
    (pole,) = positive_real([1], [1, 0, 1]).axis_poles
    assert pole.residue == approx(-0.5j)
    # (s + 3) / (s^2 + 4) at 2j: (2j + 3) / 4j
    (pole,) = positive_real([1, 3], [1, 0, 4]).axis_poles
    assert pole.residue == approx((3 + 2j) / 4j)


def test_strictly_positive_real_as_khalil_defines_it():
    strictly = {name: positive_real(*pair).strictly for name, pair in YES.items()}
    assert {name for name, holds in strictly.items() if holds} == {
        "resistor",
        "(s+2)/(s+1)",
        "(s+1)/(s+2)",
        "1/(s+1)",
    }
    assert positive_real([1, 2], [1, 3, 2]).strictly  # (s + 2) / (s + 1)(s + 2) = 1 / (s + 1)
    assert positive_real([2, 3, 1], [2, 1]).strictly  # s + 1
    # Khalil, example 6.4 kind: (s + 3)/((s + 1)(s + 2)) has w^2 Re H -> 0
    assert (
        not positive_real([1, 3], [1, 3, 2]).strictly
        and positive_real([1, 2.5], [1, 3, 2]).strictly
    )


def test_lossless_functions_are_reported():
    assert {name for name, pair in YES.items() if positive_real(*pair).lossless} == {
        "capacitor 1/s",
        "inductor s",
        "s + 1/s",
        "tank circuit s/(s^2+1)",
        "Foster (s^2+1)/(s(s^2+4))",
        "Foster of poles and zeros by turns",
    }


def biquad(b0):
    """Function (s^2 + s + b0) / (s^2 + s + 4): Re H touches zero at b0 = 1, w = sqrt 2."""
    return [1, 1, b0], [1, 1, 4]


def test_the_boundary_is_decided_on_both_sides():
    # E(x) = x^2 - (b0 + 3) x + 4 b0; its discriminant (b0 + 3)^2 - 16 b0 = (b0 - 1)(b0 - 9)
    assert positive_real(*biquad(1)).zeros == (approx(math.sqrt(2), rel=1e-15),)
    tiny = F(1, 10**40)
    assert positive_real(*biquad(1 + tiny)) and not positive_real(*biquad(1 - tiny))
    assert (
        positive_real(*biquad(9))
        and positive_real(*biquad(9 - tiny))
        and not positive_real(*biquad(9 + tiny))
    )
    assert positive_real(*biquad(9)).zeros == (approx(math.sqrt(6), rel=1e-15),)


def test_a_band_of_width_1e_9_is_detected_and_located():
    # roots of E: x = 2 +- d, with E = (b0 - 1)(b0 - 9) = 4 d^2, exact in both
    tiny = F(1, 10**18)
    (band,) = positive_real(*biquad(1 - tiny)).bands
    b0 = 1 - tiny
    x = [float(b0 + 3) / 2 - s * math.sqrt(float((b0 - 1) * (b0 - 9))) / 2 for s in (1, -1)]
    assert (band.low, band.high) == (
        approx(math.sqrt(x[0]), rel=1e-15),
        approx(math.sqrt(x[1]), rel=1e-15),
    )
    assert (
        band.width == approx(math.sqrt(8e-18) / math.sqrt(2) / 2, rel=1e-6) and band.width < 1.01e-9
    )
    assert band.low < band.worst < band.high
    # least of Re H: E / P at x = 2, E = x^2 - (b0 + 3) x + 4 b0 -> -2 tiny, P = (4 - x)^2 + x = 6
    assert band.least == approx(-2e-18 / 6, rel=1e-6)


def test_a_band_narrower_than_floats_resolve_is_detected():
    (band,) = positive_real(*biquad(1 - F(1, 10**80))).bands
    assert band.low == band.high == approx(math.sqrt(2)) and band.width == approx(1e-40, rel=1e-6)
    assert band.least == approx(-2e-80 / 6, rel=1e-6)


def test_two_adjacent_bands():
    # Re H = (x - 1)(x - 4)(x - 9)(x - 16) / |D|^2 with D Hurwitz: N from Re N(jw) D(-jw) = E, all even
    d = times([1, 1], [1, 2], [1, 3], [1, 5])
    found = positive_real(*with_real_part([F(1), F(4), F(9), F(16)], d))
    assert [(b.low, b.high) for b in found.bands] == [
        (approx(1), approx(2)),
        (approx(3), approx(4)),
    ]
    double = positive_real(*with_real_part([F(1), F(1), F(9), F(9)], d))
    assert double and double.zeros == (approx(1), approx(3))


def with_real_part(roots, d):
    """N and D with E(x) = prod (x - root), from exact linear equations for the coefficients of N."""
    degree = len(d) - 1
    e = times(*([1, -root] for root in roots))
    down = [F(x) for x in d][::-1]
    matrix = [[F(0)] * (degree + 1) for _ in range(degree + 1)]
    for i in range(degree + 1):
        for k in range(degree + 1):
            if (i + k) % 2 == 0:  # n_i (jw)^i d_k (-jw)^k
                matrix[(i + k) // 2][i] += (-1) ** ((i + k) // 2 + k) * down[k]
    return solved(matrix, [F(x) for x in e][::-1])[::-1], d


def solved(matrix, right):
    rows = [[*row, b] for row, b in zip(matrix, right, strict=True)]
    for i in range(len(rows)):
        pivot = next(k for k in range(i, len(rows)) if rows[k][i] != 0)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in range(len(rows)):
            if k != i:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[-1] for row in rows]


def test_hidden_cancellations_are_reported_and_do_not_change_the_function():
    for factor, side in (
        ([1, -1], "right"),
        ([1, 0], "axis"),
        ([1, 0, 7], "axis"),
        ([1, 5], "left"),
    ):
        found = positive_real(times([1, 2], factor), times([1, 1], factor))
        assert found.positive_real and {mode.side for mode in found.hidden} == {side}
        assert found.hidden_unstable == (side != "left") and "hidden" in found.reason
        assert (found.numerator, found.denominator) == ((1, 2), (1, 1))
    assert positive_real(times([1, 2], [1, -1]), times([1, 1], [1, -1])).hidden[0].near == approx(1)


def test_a_cancellation_that_fails_by_1e_30_leaves_a_pole_on_the_right():
    near = F(1) + F(1, 10**30)
    assert positive_real([1, -1], [1, -1])
    found = positive_real([1, -1], [1, -near])
    assert not found and [mode.side for mode in found.poles] == ["right"] and not found.hidden


def test_a_pole_that_misses_the_axis_by_1e_30_is_distinguished_from_a_pole_on_it():
    tiny = F(1, 10**30)
    n = [2, 0]  # s / (s^2 + 2 a s + 1) is positive real for a >= 0
    assert positive_real(n, [1, 2 * tiny, 1]) and not positive_real(n, [1, 2 * tiny, 1]).axis_poles
    assert positive_real(n, [1, 0, 1]).axis_poles[0].residue == 1
    assert [mode.side for mode in positive_real(n, [1, -2 * tiny, 1]).poles] == ["right", "right"]


ROUTH = {  # rows of Routh's array begin with zero or are zero
    "s^4+s^3+2s^2+2s+3": ([1, 1, 2, 2, 3], (2, 0, 2)),
    "s^5+2s^4+3s^3+6s^2+5s+3": ([1, 2, 3, 6, 5, 3], (2, 0, 3)),
    "s^6+s^5-6s^4-s^2-s+6": ([1, 1, -6, 0, -1, -1, 6], (2, 2, 2)),
    "(s^2+1)^2(s+1)": (times([1, 0, 1], [1, 0, 1], [1, 1]), (0, 4, 1)),
    "s^4-1": ([1, 0, 0, 0, -1], (1, 2, 1)),
    "s^4+4": ([1, 0, 0, 0, 4], (2, 0, 2)),
    "s^3": ([1, 0, 0, 0], (0, 3, 0)),
    "(s-1)^3(s+1)^2 s": (times([1, -1], [1, -1], [1, -1], [1, 1], [1, 1], S), (3, 1, 2)),
}


@pytest.mark.parametrize("name", ROUTH)
def test_half_planes_are_counted_where_rows_of_routh_degenerate(name):
    p, wanted = ROUTH[name]
    found = locate_roots(Polynomial(p[::-1]))
    assert (found.right, found.axis, found.left) == wanted


@examples(60)
@given(
    st.lists(st.integers(-3, 3), max_size=3),
    st.lists(st.tuples(st.integers(-2, 2), st.integers(1, 4)), max_size=3),
)
def test_half_planes_of_products_of_known_roots(real, pairs):
    p = times([1], *([1, -r] for r in real), *([1, -2 * a, a * a + b * b] for a, b in pairs))
    where = [*real, *(a for a, _ in pairs for _ in range(2))]
    found = locate_roots(Polynomial(p[::-1]))
    assert (found.right, found.axis, found.left) == (
        sum(x > 0 for x in where),
        sum(x == 0 for x in where),
        sum(x < 0 for x in where),
    )


# random passive networks ----------------------------------------------------------------------------------------

values = st.fractions(min_value=F(1, 20), max_value=20, max_denominator=20)
elements = st.tuples(st.sampled_from("RLC"), values)


def element(kind, value):
    return {"R": ([value], [1]), "L": ([value, 0], [1]), "C": ([1], [value, 0])}[kind]


def added(one, two):
    (a, b), (c, d) = one, two
    n = Polynomial(times(a, d)[::-1]) + Polynomial(times(c, b)[::-1])
    return list(n.coefficients[::-1]) or [0], times(b, d)


def network(steps):
    """Impedance of elements in series and in parallel by turns (a ladder: a continued fraction)."""
    found = element(*steps[0])
    for k, step in enumerate(steps[1:]):
        one = element(*step)
        found = added(found, one) if k % 2 else added(found[::-1], one[::-1])[::-1]
    return found


@examples(80)
@given(st.lists(elements, min_size=1, max_size=7))
def test_every_ladder_of_passive_elements_is_positive_real(steps):
    found = positive_real(*network(steps))
    assert found, found.reason


@examples(60)
@given(
    st.lists(st.tuples(values, st.fractions(0, 9, max_denominator=9)), min_size=1, max_size=4),
    values,
)
def test_a_lossless_foster_form_less_a_grain_of_resistance_is_not(tanks, inductance):
    found = ([inductance, 0], [1])
    for k, x in tanks:
        found = added(found, ([k, 0], [1, 0, x]) if x else ([k], [1, 0]))
    assert positive_real(*found).lossless
    lower = positive_real(*added(found, ([F(-1, 10**25)], [1])))
    assert not lower and lower.bands[0].least == approx(-1e-25)


@examples(40)
@given(st.lists(elements, min_size=2, max_size=6), values)
def test_a_network_less_a_little_more_than_its_least_real_part_is_not(steps, shift):
    n, d = network(steps)
    found = added((n, d), ([-shift], [1]))
    w = np.concatenate([np.logspace(-4, 4, 4001), [1e-7, 1e7]])
    with np.errstate(divide="ignore", invalid="ignore"):
        re = np.nan_to_num(
            (np.polyval(np.array(n, float), 1j * w) / np.polyval(np.array(d, float), 1j * w)).real
        )
    if re.min() < shift - 1e-6:
        assert not positive_real(*found)
    elif re.min() > shift + 1e-2 * (1 + shift):
        assert positive_real(*found)


@examples(120)
@given(
    st.lists(st.integers(-4, 6), min_size=1, max_size=5),
    st.lists(st.tuples(st.integers(1, 5), st.integers(0, 5)), min_size=1, max_size=2),
)
def test_bands_agree_with_dense_sampling_of_stable_functions(n, pairs):
    d = times(*([1, 2 * a, a * a + b * b] for a, b in pairs))
    n = n[-len(d) :]
    found = positive_real(n, d)
    w = np.linspace(0.0, 30.0, 30_011)[1:]
    re = (np.polyval(np.array(n, float), 1j * w) / np.polyval(np.array(d, float), 1j * w)).real
    inside = np.zeros(len(w), bool)
    for band in found.bands:
        inside |= (band.low < w) & (w < band.high)
        assert band.least <= re[(band.low < w) & (w < band.high)].min(initial=np.inf) + 1e-12
    sure = np.abs(re) > 1e-12 * (1 + np.abs(re).max())
    assert np.array_equal(re[sure] < 0, inside[sure]) and found.positive_real == (not found.bands)


# input ----------------------------------------------------------------------------------------------------------


def test_floats_are_the_binary_fractions_they_are_and_text_is_decimal():
    # 0.1 + 0.2 is not 0.3 in floats, so the factor is not shared; as text it is shared
    assert positive_real(["0.3"], ["0.3"]).hidden == ()
    assert positive_real([1, "-0.3"], [1, "-0.3"]).hidden and not positive_real(
        [1, -0.1 - 0.2], [1, -0.3]
    )
    found = positive_real([1, 0.1], [1, Decimal("0.1")])
    assert found.numerator[1] == F(3602879701896397, 2**55) and found.denominator[1] == F(1, 10)
    assert positive_real(np.array([1.0, 2.0]), np.array([1, 1])) and positive_real("1/3", 2)


def test_leading_zeros_are_no_degree():
    assert positive_real([0, 0, 1], [0, 1, 0]) and not positive_real([0, 1, 0, 0], [0, 0, 1])


@pytest.mark.parametrize(
    "bad", [[], [1, "x"], [1j], [math.nan], [math.inf, 1], None, [True], [[1, 2]], ["1/0"]]
)
def test_coefficients_that_are_not_real_are_refused(bad):
    with pytest.raises(FvsolveError, match="numerator.*expected"):
        positive_real(bad, [1])
    with pytest.raises(FvsolveError, match="denominator"):
        positive_real([1], bad)


def test_a_denominator_of_zeros_is_refused():
    with pytest.raises(FvsolveError, match="denominator is zero"):
        positive_real([1], [0, 0])


def test_a_verdict_is_plain_for_json():
    import json

    said = json.loads(json.dumps(positive_real([1, -1], [1, 0, 4, 0]).plain(), allow_nan=False))
    assert said["positive_real"] is False and said["axis_poles"][1]["frequency"] == 2.0
    assert said["numerator"] == ["1", "-1"] and isinstance(said["reason"], str)
    assert positive_real([1, 0], [1]).plain()["axis_poles"][0]["frequency"] is None


def test_coefficients_of_too_large_a_number_of_digits_are_refused():
    """Floats of degree 30 took more than three minutes; whole numbers of this degree take a second."""
    roots = np.random.default_rng(0).uniform(0.1, 10.0, (2, 30))
    with pytest.raises(
        FvsolveError, match="degree 30 with up to .* binary digits take too long.*rounded"
    ):
        positive_real(*map(list, map(np.poly, -roots)))
    assert positive_real([1] * 31, [1] * 31).positive_real
