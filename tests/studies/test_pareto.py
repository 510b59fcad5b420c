"""Pareto fronts, crossings and targets of synthetic sets with known answers."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fvsolve.studies.accuracy.work_precision import find_crossing, pareto_front, target_powers

COSTS = [1.0, 4.0, 16.0, 64.0]
sizes = st.floats(1e-12, 1e3)


@given(st.lists(st.tuples(sizes, sizes), max_size=30))
def test_no_point_of_a_front_is_beaten_and_every_other_point_is(points):
    errors, costs = [one[0] for one in points], [one[1] for one in points]
    found = pareto_front(errors, costs)
    for k, (error, cost) in enumerate(points):
        better = [j for j in range(len(points)) if errors[j] <= error and costs[j] <= cost]
        strictly = [j for j in better if errors[j] < error or costs[j] < cost]
        assert (not strictly) if k in found else any(j in found for j in better)
    assert [costs[k] for k in found] == sorted(costs[k] for k in found)
    assert [errors[k] for k in found] == sorted((errors[k] for k in found), reverse=True)


def test_a_failed_point_is_on_no_front():
    assert pareto_front([math.inf, 0.1, 0.01], [1.0, 2.0, 3.0]) == [1, 2]


@given(st.floats(0.3, 6.0), st.floats(1.001, 900.0))
def test_a_crossing_on_a_power_law_is_exact(order, ratio):
    """Error 8 h^p at cost h^-2, h = 1, 1/2, 1/4, 1/8: a target between has the cost (8 / target)^(2 / p)."""
    errors = [8.0 * 2.0 ** (-order * k) for k in range(4)]
    target = 8.0 / min(ratio, 2.0 ** (3.0 * order) * 0.999)
    where = find_crossing(errors, COSTS, target)
    assert where.cost == pytest.approx((8.0 / target) ** (2.0 / order), rel=1e-9)
    assert COSTS[where.coarser] <= where.cost * (1 + 1e-12) and where.cost <= COSTS[where.finer] * (1 + 1e-12)


def test_a_crossing_counts_only_from_where_all_finer_points_hold():
    """A single coarse point below the target does not count."""
    where = find_crossing([1e-3, 1e-1, 1e-2, 1e-4], COSTS, 1e-3)
    assert (where.coarser, where.finer) == (2, 3)
    assert where.cost == pytest.approx(32.0)


def test_a_curve_that_ends_above_the_target_or_fails_at_its_end_has_no_crossing():
    assert find_crossing([1e-1, 1e-2], COSTS[:2], 1e-3) is None
    assert find_crossing([1e-4, math.inf], COSTS[:2], 1e-3) is None


def test_nothing_is_interpolated_towards_a_failed_point_nor_before_the_coarsest():
    after = find_crossing([math.inf, 1e-4], COSTS[:2], 1e-3)
    assert (after.cost, after.within) == (4.0, False)
    first = find_crossing([1e-4, 1e-5], COSTS[:2], 1e-3)
    assert (first.cost, first.within) == (1.0, False)


def test_targets_end_at_the_floor_and_at_the_best_run():
    assert target_powers([0.5, 2e-4, math.inf], 1e-9) == pytest.approx([1e-1, 1e-2, 1e-3])
    assert target_powers([0.5, 2e-7], 3e-3) == pytest.approx([1e-1, 1e-2])
    assert target_powers([], 0.0) == []
