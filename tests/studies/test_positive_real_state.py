"""State spaces in floats agree with the exact verdict where they decide, and sweeps of lines have a valid bound."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from pytest import approx

from fvsolve.errors import FvsolveError
from fvsolve.studies import (
    LineImpedance,
    Transfer,
    line_positive_real,
    positive_real,
    state_positive_real,
    sweep_positive_real,
)


def companion(n, d):
    """State space A, b, c, d of a proper rational function, highest power first, without SciPy's scaling."""
    n, d = np.trim_zeros(np.asarray(n, float), "f"), np.asarray(d, float)
    order = len(d) - 1
    n = np.concatenate([np.zeros(order + 1 - len(n)), n]) / d[0]
    d = d / d[0]
    a = np.zeros((order, order))
    if order:
        a[0], a[1:, :-1] = -d[1:], np.eye(order - 1)
    b = np.zeros(order)
    b[:1] = 1.0
    return Transfer(a, b, n[1:] - n[0] * d[1:], n[0])


def verdict(n, d):
    return state_positive_real(companion(n, d))


def test_a_transfer_function_is_what_a_direct_solve_gives():
    rng = np.random.default_rng(3)
    a, b, c = rng.normal(size=(9, 9)) * 10.0 ** rng.integers(-3, 3, (9, 1)), rng.normal(size=9), rng.normal(size=9)
    h = Transfer(a, b, c, 0.7)
    for s in (0.3, 2j, -1 + 5j, 1e3j):
        assert h(s)[0] == approx(0.7 + c @ np.linalg.solve(s * np.eye(9) - a, b.astype(complex)), rel=1e-9)
    parts = 0.7 + np.sum(h.residues / (2j - h.poles))
    assert h(2j)[0] == approx(parts, rel=1e-9)


@pytest.mark.parametrize(
    "n, d",
    [
        ([1, 2], [1, 1]),
        ([3], [1]),
        ([1, 3], [1, 3, 2]),
        ([1, 0], [1, 1]),
        ([1, 1], [1, 0]),
        ([1, 1.000001, 1], [1, 1, 1]),
    ],
)
def test_what_is_positive_real_beyond_doubt_is_said_to_be(n, d):
    assert verdict(n, d).answer == "yes"


@pytest.mark.parametrize(
    "n, d",
    [
        ([1], [1, 2, 1]), ([1], [1, 0, 0]), ([-1, 0], [1, 0, 1]), ([1], [1, 0, 1]), ([1, 0], [1, 0, 2, 0, 1]),
        ([-1], [1]), ([-1], [1, 0, 0]), ([-2], [1, -1, 0]), ([1], [1, -1]), ([-1], [1, 0]), ([1, 4], [1, 3, 2]),
        ([1, 1], [1, 0, -1]), ([1, 1], [1, 0, 0]),
    ],
)  # fmt: skip
def test_what_is_not_is_said_not_to_be(n, d):
    assert verdict(n, d).answer == "no"


@pytest.mark.parametrize(
    "n, d", [([1], [1, 0]), ([1, 0], [1, 0, 1]), ([1, 0, 1], [1, 0, 4, 0]), ([1, 1, 1], [1, 1, 4])]
)
def test_the_boundary_is_called_undecided(n, d):
    found = verdict(n, d)
    assert (
        found.answer == "undecided within 1e-09"
        and abs(found.margin) < 1e-9
        and "at the limit of positive realness" in found.reason
    )


def test_a_narrow_band_is_found_without_a_grid():
    # roots of E(x) = x^2 - (b0 + 3) x + 4 b0 with b0 = 1 - 1e-6
    b0 = 1.0 - 1e-6
    found = verdict([1, 1, b0], [1, 1, 4])
    x = np.sort(np.roots([1, -(b0 + 3), 4 * b0]))
    (dip,) = found.dips
    assert (dip.low, dip.high) == (approx(math.sqrt(x[0]), rel=1e-9), approx(math.sqrt(x[1]), rel=1e-9))
    assert found.positive_real is False and verdict([1, 1, 2 - b0], [1, 1, 4]).positive_real is True


def test_a_narrow_band_of_a_stiff_system_with_a_quick_pole_beside_it():
    # plus a lag of 1e7 1/s with real part 1e-9, which is less than the dip of 5e-7
    n = np.polyadd(np.polymul([1, 1, 1 - 1e-6], [1e-7, 1]), np.polymul([1e-9], [1, 1, 4]))
    found = verdict(n, np.polymul([1, 1, 4], [1e-7, 1]))
    assert found.positive_real is False and found.dips[0].low < math.sqrt(2) < found.dips[0].high


def test_hidden_unstable_poles_are_told():
    a = np.diag([-1.0, 2.0])
    found = state_positive_real(Transfer(a, np.array([1.0, 0.0]), np.array([1.0, 1.0]), 0.0))
    assert found.positive_real and found.hidden == (approx(2.0),) and "hidden" in found.reason
    seen = state_positive_real(Transfer(a, np.array([1.0, 0.1]), np.array([1.0, 1.0]), 0.0))
    assert seen.positive_real is False and seen.unstable == (approx(2.0),)


@examples(150)
@given(
    st.lists(st.integers(-4, 6), min_size=1, max_size=5),
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=2, unique=True),
)
def test_where_floats_decide_they_agree_with_exact_arithmetic(n, pairs):
    d = np.array([1])
    for a, b in pairs:
        d = np.polymul(d, [1, 2 * a, a * a + b * b])
    n = n[-len(d) :]
    found, exact = verdict(n, d), positive_real([int(x) for x in n], [int(x) for x in d])
    assert found.positive_real in (None, exact.positive_real), (found.reason, exact.reason)


# lines ----------------------------------------------------------------------------------------------------------

Z0, T = 2.0e6, 0.75


@pytest.mark.parametrize("reflection", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_lossless_line_is_positive_real_whatever_passive_end_it_has(reflection):
    found = line_positive_real(LineImpedance(Z0, T, reflection))
    u = abs(reflection) * math.exp(-2e-3)
    exact = Z0 * (1.0 - u) / (1.0 + u)  # the least of Z0 (1 - u^2) / |1 - g e|^2
    assert found.positive_real is True and found.least == approx(exact, rel=1e-9) and 0.0 <= found.floor <= exact


def test_the_closed_forms_of_open_and_closed_ends():
    s = np.array([0.1 + 1j, 2.0, 0.01 + 7j])
    assert np.allclose(LineImpedance(Z0, T, -1.0)(s), Z0 * np.tanh(s * T), rtol=1e-12)
    assert np.allclose(LineImpedance(Z0, T, 1.0)(s), Z0 / np.tanh(s * T), rtol=1e-12)
    resistance = 5.0e6
    ended = Z0 * (resistance + Z0 * np.tanh(s * T)) / (Z0 + resistance * np.tanh(s * T))
    assert np.allclose(LineImpedance(Z0, T, (resistance - Z0) / (resistance + Z0))(s), ended, rtol=1e-12)


def test_a_line_that_ends_in_a_negative_resistance_is_not_positive_real():
    for resistance in (-0.5 * Z0, -3.0 * Z0):
        found = line_positive_real(LineImpedance(Z0, T, (resistance - Z0) / (resistance + Z0)))
        assert found.positive_real is False and "a pole with Re s" in found.reason


def test_a_line_on_its_lossless_axis_wants_to_be_taken_right_of_its_poles():
    for reflection in (-1.0, 1.0):
        with pytest.raises(FvsolveError, match="greater shift|right of its poles"):
            line_positive_real(LineImpedance(Z0, T, reflection), shift=0.0)


@examples(60)
@given(st.floats(-1, 1), st.floats(1e-3, 1), st.floats(0, 10), st.floats(1e-3, 3))
def test_the_bound_of_the_slope_holds_between_any_two_frequencies(g, shift, low, width):
    line = LineImpedance(1.0, 1.0, g)
    w = np.linspace(low, low + width, 50)
    steepest = np.max(np.abs(np.diff(line(shift + 1j * w))) / np.diff(w))
    assert steepest <= float(line.slope(shift, low, low + width)) * (1 + 1e-9) + 1e-10


def test_a_delayed_element_is_not_positive_real_and_the_frequency_is_said():
    found = sweep_positive_real(lambda s: np.exp(-0.3 * s), 0.3, 2.0 * math.pi / 0.3)
    assert found.positive_real is False and np.cos(0.3 * found.worst) < 0.0 and found.least == approx(-1.0, abs=1e-3)


def test_a_delay_under_a_resistance_is_decided_a_millionth_from_the_boundary():
    period = 2.0 * math.pi / 0.3
    for excess, holds in ((1e-3, True), (-1e-6, False)):
        found = sweep_positive_real(lambda s, r=1.0 + excess: r + np.exp(-0.3 * s), 0.3, period)
        assert found.positive_real is holds, found.reason
    touching = sweep_positive_real(lambda s: 1.0 + np.exp(-0.3 * s), 0.3, period)
    assert touching.positive_real is None and "undecided" in touching.reason


def test_a_negative_resistance_is_not_positive_real():
    assert sweep_positive_real(lambda s: -1.0 + 0.0 * s, 0.0, 1.0).positive_real is False


@pytest.mark.parametrize("slope, high, shift", [(math.nan, 1, 0), (math.inf, 1, 0), (-1, 1, 0), (1, 0, 0), (1, 1, -1)])
def test_a_sweep_without_a_bound_or_a_range_is_refused(slope, high, shift):
    with pytest.raises(FvsolveError, match="expected|bounded"):
        sweep_positive_real(lambda s: s, slope, high, shift)
