"""Two runs are compared at their common times; rows of other times are interpolated only if there are none."""

import numpy as np
from reference.scenes import reservoir, scene, tank, valve

import fvsolve
from fvsolve.core.run.verdicts import common_rows, differences


def drained(every):
    """Run of a tank that drains through a valve that closes within 50 ms, which ends between rows."""
    shut = {"start": 1.013, "duration": 0.05, "value": [1.0, 0.0]}
    nodes = {"tower": tank(2.0, 4.0), "town": reservoir(1e5)}
    links = {"outlet": valve("tower", "town", 2e-3, opening=shut)}
    return fvsolve.run(
        scene(nodes, links, 5.0, {"method": "rk4", "step": 0.01}, ["outlet.flow"], every=every)
    )


def test_runs_with_other_rows_differ_by_rounding_at_common_times():
    """Rows every 10 ms and every 70 ms of the same run; interpolation would give differences of a closing flow."""
    fine, coarse = drained(0.01), drained(0.07)
    for a, b in ((fine, coarse), (coarse, fine)):
        found = differences(a, b)
        assert abs(found["probes"]["outlet.flow"]["greatest"]) < 1e-12
        assert found["probes"]["outlet.flow"]["rows"] >= 72  # 0, 0.07, ... 4.97 s
        assert "common times" in found["note"] and "interpolated" not in found["note"]
    assert differences(fine, fine)["note"] == ""


def test_runs_without_common_times_are_interpolated_with_a_note():
    # common are the first and the last time
    found = differences(drained(0.0101), drained(0.07 / 1.000001))
    assert (
        found["probes"]["outlet.flow"]["rows"] > 100
        and abs(found["probes"]["outlet.flow"]["greatest"]) > 1e-4
    )
    assert "interpolated between rows up to 0.07 s apart" in found["note"]


def test_both_rows_of_a_jump_belong_to_both_rows_of_the_other_run():
    t, theirs = np.array([0.0, 1.0, 1.0, 2.0, 3.0]), np.array([0.0, 0.5, 1.0, 1.0, 3.0])
    assert [rows.tolist() for rows in common_rows(t, theirs)] == [[0, 1, 2, 4], [0, 2, 3, 4]]
    assert [rows.tolist() for rows in common_rows(t, theirs + 1e-11)] == [
        [0, 1, 2, 4],
        [0, 2, 3, 4],
    ]
    single = np.array([0.0, 1.0, 3.0])
    assert [rows.tolist() for rows in common_rows(t, single)] == [[0, 2, 4], [0, 1, 2]]
    assert common_rows(t, np.array([0.25]))[0].size == 0 and common_rows(t[:1], t)[0].tolist() == [
        0
    ]
