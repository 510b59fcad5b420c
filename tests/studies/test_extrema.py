"""Estimated errors of extremes contain the known error, whichever local maximum becomes the greatest."""

import numpy as np
import pytest

from fvsolve.studies.peak_error import greatest_error, troughs


def triple(order: float, coefficient: float = 0.1, exact: float = 3.0) -> tuple[float, float, float]:
    return tuple(exact + coefficient * h**order for h in (2.0, 1.0, 0.5))


@pytest.mark.parametrize("order", [0.5, 0.7, 1.0, 1.3, 2.0, 3.0, 5.0])
@pytest.mark.parametrize("coefficient", [0.1, -0.02])
def test_it_holds_the_error_of_any_order(order: float, coefficient: float) -> None:
    found = greatest_error([], triple(order, coefficient))
    assert found >= abs(coefficient) * (1.0 - 1e-9)
    if 0.75 <= order <= 2.0:
        assert found == pytest.approx(2.15 * abs(coefficient), rel=1e-2)


def test_where_no_order_is_believed_it_is_that_of_three_quarters() -> None:
    """Without an order: 2.15 / (1 - 0.6) times the later difference, or times 0.6 of the earlier if that is greater."""
    assert greatest_error([], triple(2.0), believed=False) == pytest.approx(2.15 / 0.4 * 0.6 * 0.3)
    assert greatest_error([], (1.0, 1.2, 1.1)) == pytest.approx(2.15 / 0.4 * 0.1)  # differences alternate
    assert greatest_error([], (1.0, 1.1, 1.3)) == pytest.approx(2.0 * 2.15 / 0.4 * 0.2)  # differences grow
    assert greatest_error([], (1.1, 1.2)) == pytest.approx(2.15 / 0.4 * 0.1)  # two resolutions
    assert greatest_error([], (1.0, 1.0, 1.0)) == 0.0


def crests(heights: tuple[float, ...], width: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a signal with a crest at each whole second."""
    t = np.linspace(0.0, len(heights) + 1.0, 2001)
    return t, sum(h * np.exp(-(((t - k - 1.0) / width) ** 2)) for k, h in enumerate(heights))


def test_a_crest_that_finer_cells_raise_above_the_greatest_is_in_the_error() -> None:
    """The first crest stays at 1, and the second rises to 1.1 at order one: 1.1 minus 0.8, 0.4 and 0.2."""
    signals = [crests((1.0, h)) for h in (0.3, 0.7, 0.9)]
    assert greatest_error([], (1.0, 1.0, 1.0)) == 0.0
    assert 0.1 <= greatest_error([signals], (1.0, 1.0, 1.0)) <= 0.6
    settled = [crests((1.0, h)) for h in (0.3, 0.31, 0.311)]
    assert greatest_error([settled], (1.0, 1.0, 1.0)) < 0.01


def test_of_places_the_greatest_counts_that_any_may_reach() -> None:
    still, rising = [crests((1.0,))] * 3, [crests((h,)) for h in (0.3, 0.7, 0.9)]
    assert 0.1 <= greatest_error([still, rising], (1.0, 1.0, 1.0)) <= 0.6


def test_a_crest_that_is_lower_on_finer_cells_does_not_rise_above() -> None:
    signals = [crests((1.0, h)) for h in (0.99, 0.9, 0.8)]
    assert greatest_error([signals], (1.0, 1.0, 1.0)) < 0.03


def test_a_crest_that_moves_has_not_come_to_its_height() -> None:
    """The greatest value hardly changes, but the signals differ more where each of them is greatest."""
    t = np.linspace(0.0, 3.0, 3001)
    signals = [(t, np.exp(-((t - at) ** 2))) for at in (1.0, 1.2, 1.3)]
    found = greatest_error([signals], (1.0, 1.002, 1.004))
    assert found >= 1.0 - np.exp(-(0.1**2)) > 0.002 * 2.0


def test_troughs_part_maxima_that_rise_enough() -> None:
    t, v = crests((1.0, 0.5, 0.7))
    assert t[troughs(v, 0.1)] == pytest.approx([1.5, 2.5], abs=0.1)
    assert troughs(v, 0.8) == [] and troughs(np.ones(5), 0.0) == []
    assert troughs(np.array([0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 1.0]), 0.5) == [3]  # start of a flat trough
