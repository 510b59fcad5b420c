"""Curves of histories in pictures: none twice, none constant, each named; long series thinned without loss of peaks."""

import numpy as np
import pytest

from fvsolve.report.draw.plot import select_curves, thin_series


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_thinned_series_retains_both_extremes_of_each_bin(sign):
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


T = np.linspace(0.0, 1.0, 200)
WAVE, OTHER = np.sin(7.0 * T), np.cos(5.0 * T)


def labels(columns: dict, measured=()) -> tuple[dict, list]:
    panels, still = select_curves(
        np.column_stack(list(columns.values())), [(name, "x") for name in columns], measured
    )
    return {panel.quantity: [line.label for line in panel.lines] for panel in panels}, still


def test_pressure_and_head_of_a_place_are_a_single_curve():
    both = {"gate.pressure": 1e5 + 9.8e3 * WAVE, "gate.head": 3.0 + WAVE, "top.head": OTHER}
    assert labels(both)[0] == {"pressure": ["gate (head alike)"], "head": ["top"]}
    assert labels(both, ["gate.head"])[0]["head"] == ["gate", "top"]  # compared with a measurement
    moved = both | {"gate.head": 3.0 + WAVE + 1e-3 * OTHER}  # at a place that moves
    assert labels(moved)[0] == {"pressure": ["gate"], "head": ["gate", "top"]}


def test_constant_series_are_named_and_drawn_only_in_a_picture_of_rest():
    lake = np.full(T.size, 45.0) + 1e-12 * WAVE
    assert labels({"lake.head": lake, "a.flow": WAVE}) == (
        {"flow": ["a"]},
        [("lake.head", "x", lake[0])],
    )
    assert labels({"lake.head": lake}) == ({"head": ["lake"]}, [])


def test_a_curve_that_would_cover_another_is_named_with_it():
    flows = {"main.flow@0": WAVE, "valve.flow": WAVE + 1e-4 * OTHER, "leak.flow": 0.9 * WAVE}
    assert labels(flows)[0] == {"flow": ["main at 0, valve", "leak"]}
