"""Long series are thinned for pictures without loss of their extremes."""

import numpy as np
import pytest

from fvsolve.draw.plot import thin_series


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_thinned_series_keeps_both_extremes_of_each_bin(sign):
    t = np.linspace(0.0, 1.0, 9000)
    values = np.sin(40.0 * t)
    values[1234] = sign * 7.0  # a single row
    times, kept = thin_series(t, values, 300)
    assert len(times) <= 302 and times[0] == 0.0 and times[-1] == 1.0
    assert sign * np.max(sign * kept) == sign * 7.0
    assert {np.min(part) for part in np.split(values, 150)} <= set(kept)
    assert {np.max(part) for part in np.split(values, 150)} <= set(kept)
    assert np.array_equal(kept, values[np.searchsorted(t, times)])


def test_a_short_series_is_drawn_as_it_is():
    t = np.arange(5.0)
    times, kept = thin_series(t, t**2, 5)
    assert times is t and np.array_equal(kept, t**2)
