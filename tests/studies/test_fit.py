"""Fit of the order on errors of known order: it gives order and spread, or the reason why there is no order."""

import math

import numpy as np
import pytest
from pytest import approx

from fvsolve.errors import FvsolveError
from fvsolve.studies import fit

H = 0.1 / 2.0 ** np.arange(7)
ORDERS = [0.5, 0.83, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("p", ORDERS)
@pytest.mark.parametrize("rows", [3, 4, 7])
def test_a_pure_power_is_found_exactly(p, rows):
    found = fit(H[:rows], 3.7e5 * H[:rows] ** p)
    assert found.order == approx(p, abs=1e-10) and found.spread == approx(0.0, abs=1e-8)
    assert found.constant == approx(3.7e5) and set(found.marks) == {""} and not found.reason


@pytest.mark.parametrize("ratio", [1.5, 2.0, 10.0])
def test_the_ratio_of_sizes_does_not_matter(ratio):
    h = ratio ** -np.arange(5.0)
    assert fit(h, 2.0 * h**3).order == approx(3.0, abs=1e-10)


@pytest.mark.parametrize("p", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("floor", [1e-8, 1e-10, 1e-12])
def test_rows_at_an_additive_floor_are_marked_and_do_not_bend_the_order(p, floor):
    e = H**p + floor
    found = fit(H, e)
    if np.sum(H**p > 100.0 * floor) >= 3:  # rows that the floor changes by less than 1 %
        assert not found.reason
    if not found.reason:
        assert abs(found.order - p) <= max(found.spread, 0.01) <= 1.0
    if np.sum(H**p > 100.0 * floor) >= 4:
        assert found.order == approx(p, abs=0.05)
    hidden = H**p < 0.3 * floor
    if not found.reason:
        assert all(found.marks[i] != "" for i in np.flatnonzero(hidden))


@pytest.mark.parametrize("p", [1, 2, 4])
def test_a_stated_floor_takes_rows_out(p):
    e = 5.0 * H**p
    found = fit(H, e, floor=e[4] / 9.0)
    assert found.marks == ("", "", "", "", "floor", "floor", "floor") and found.order == approx(p)
    assert "above the floor" in fit(H, e, floor=e[2] / 9.0).reason


def test_a_noisy_floor_is_a_floor():
    rng = np.random.default_rng(3)
    for _ in range(50):
        found = fit(H, H**4 + 1e-8 * rng.uniform(0.5, 1.0, 7))
        assert found.reason or found.order == approx(4, abs=0.3)


def test_an_order_of_a_quarter_is_found_where_rows_are_many():
    assert fit(H, H**0.25).order == approx(0.25)


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_a_head_where_errors_hardly_fall_is_pre_asymptotic(p):
    found = fit(H, H**p / (1.0 + (H / 0.02) ** p))
    assert found.marks[0] == "pre-asymptotic" and found.marks[-1] == ""
    assert abs(found.order - p) <= found.spread <= 0.25


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_a_head_that_falls_too_fast_is_pre_asymptotic(p):
    found = fit(H, H**p * (1.0 + (H / 0.02) ** 2))
    assert found.marks[0] == "pre-asymptotic" and found.marks[-1] == ""
    assert abs(found.order - p) <= found.spread <= 0.25


@pytest.mark.parametrize("p", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("share", [0.5, 5.0, -2.0])
def test_a_mixture_of_orders_lies_within_the_spread(p, share):
    found = fit(H, H**p * (1.0 + share * H))
    assert abs(found.order - p) <= found.spread <= 0.25


def test_an_order_that_reduces_is_not_taken_for_a_floor():
    found = fit(H, H**4 + 1e-4 * H**2)
    assert "floor" not in found.marks
    assert found.reason or abs(found.order - 2.0) <= found.spread + 0.05


def test_a_row_where_the_error_changes_sign_lies_off_the_line():
    e = H**2
    e[3] *= 0.02
    found = fit(H, e)
    assert found.order == approx(2.0) and found.marks[3] == "off the line" and "sign" in found.note


def test_a_last_row_that_leaves_the_line_is_said():
    e = H[:6] ** 4
    e[-1] *= 4.0
    found = fit(H[:6], e)
    assert found.order == approx(4.0) and found.marks[-1] == "off the line" and "leaves the line" in found.note


@pytest.mark.parametrize("sigma", [0.3, 1.0, 3.0])
def test_noise_has_no_order(sigma):
    rng = np.random.default_rng(7)
    told = [not fit(H, np.exp(sigma * rng.standard_normal(7))).reason for _ in range(400)]
    assert np.mean(told) < 0.03


@pytest.mark.parametrize("p", [1, 2, 4])
def test_scatter_of_ten_percent_still_shows_the_order_within_its_spread(p):
    rng = np.random.default_rng(11)
    found = [fit(H, H**p * rng.uniform(0.95, 1.05, 7)) for _ in range(200)]
    told = [one for one in found if not one.reason]
    assert len(told) > 150 and np.mean([abs(one.order - p) <= one.spread for one in told]) > 0.95


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ([1e-2, 1e-3], "rows with a known error is 2. Expected at least 3"),
        ([1e-2, math.nan, 1e-4], "rows with a known error is 2. Expected at least 3"),
        ([0.0, 0.0, 0.0, 0.0], "above zero"),
        ([1.0, 1.0, 1.0, 1.0], "hardly fall"),
        ([1.0, 2.0, 3.0, 4.0], "do not fall"),
        ([1.0, 0.5, 0.3, 0.29, 0.1], "differ"),
        ([1.0, 1e-3, 1.02e-3, 1e-3], "floor"),
    ],
)
def test_where_there_is_no_order_it_says_why(errors, words):
    found = fit(H[: len(errors)], errors)
    assert words in found.reason and math.isnan(found.order) and math.isnan(found.spread)


def test_a_failed_row_is_left_out():
    e = H**3
    e[0] = math.nan
    found = fit(H, e)
    assert found.order == approx(3.0) and found.marks[0] == "failed"


@pytest.mark.parametrize(
    ("h", "e", "words"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], "fall from row to row"),
        ([1.0, 0.5], [1.0, 0.5, 0.2], "one error for each size"),
        ([1.0, 0.5, 0.25], [1.0, -0.5, 0.2], "negative"),
    ],
)
def test_what_are_no_errors_are_refused(h, e, words):
    with pytest.raises(FvsolveError, match=words):
        fit(h, e)


@pytest.mark.parametrize("c", [4.0, 8.0, 16.0])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_orders_that_climb_slowly_leave_the_limit_within_the_spread(c, first):
    """Errors saturate like those of smeared waves: orders climb to 1, at first by growing increments."""
    h = 0.5 / 2.0 ** np.arange(7)
    found = fit(h[first : first + 4], 1.0 - np.exp(-c * h[first : first + 4]))
    assert found.reason or abs(found.order - 1.0) <= found.spread + 0.05, found
