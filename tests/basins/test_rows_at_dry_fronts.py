"""Velocities in rows between steps at dry fronts: none above the greatest velocity of the steps."""

import pytest

import fvsolve


@pytest.mark.parametrize("method", ["ssp-rk2", "ssp-rk3"])
@pytest.mark.parametrize(
    "friction", [{"manning": 0.03}, {"manning": 0.1}, {"factor": 0.1}], ids=str
)
def test_no_row_is_faster_than_all_steps(method, friction):
    """A dam breaks over a dry bed. Rows had up to 116 m/s, as the rates of friction at a front exceed 1e3 / s.

    Extremes are over all accepted steps and rows: in a run without rows between start and end, over the steps.
    Probes are at centres of cells: means of two cells may be greatest between steps.
    """
    probes = [f"b.speed@{106.0 + 4.0 * k},2" for k in range(20)]
    case = {
        "fluid": {"name": "Water"},
        "nodes": {
            "b": {
                "type": "basin",
                "size": [200.0, 4.0],
                "cells": [50, 1],
                "level": 10.0,
                "start": {"level": "where(x < 100, 10, 0)"},
                **friction,
            }
        },
        "numerics": {"end": 4.0, "scheme": "muscl", "method": method, "courant": 0.9},
    }
    steps, rows = (
        fvsolve.run(case | {"output": {"every": every, "probes": probes}}) for every in (4.0, 0.005)
    )
    assert len(steps.t) == 2 and len(rows.t) == 801
    fastest = {name: steps.extremes[name].maximum for name in probes}
    assert 5.0 < max(fastest.values()) < 20.0  # 2 sqrt(g h) = 19.8 m/s without friction
    for name in probes:
        assert rows[name].max() <= fastest[name] * (1.0 + 1e-12)
