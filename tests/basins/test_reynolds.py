"""Reynolds' transport theorem (docs/course.md, 71, 76 and 77) in a basin with a moving wall, term by term."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.scenes import scene
from scipy.interpolate import CubicSpline

from fvsolve import advance, build, load
from fvsolve.model.model import State

LENGTH, RATE, T, D = 2.0, 0.3, 0.4, 2e-3


def run_up(cells: int):
    """Return (model, states just before, at and after T) of a wave in a flume with an oscillating east wall."""
    travel = {"mean": 0.0, "amplitude": RATE, "period": 2.0}
    basin = {
        "type": "basin", "size": [LENGTH, 1.0], "cells": [cells, 1], "level": 1.0,
        "start": {"level": f"1 + 0.02 * cos({math.pi / LENGTH} * x)", "u": f"{RATE * math.pi / LENGTH} * x"},
        "patches": {"lid": {"side": "east", "travel": travel}},
    }  # fmt: skip
    model = build(load(scene({"b": basin}, {}, 1.0, {"scheme": "upwind5", "method": "rk4", "step": 2e-4})))
    states = [State(0.0, model.start.copy())]
    for until in (T - D, T, T + D):
        states.append(advance(model, states[-1], until))
    return model, states[1:]


def held(model, state) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (grid lines, volume of water west of each line, depth and velocity at inner lines)."""
    depth, flow, _ = model.basins[0].deviations(state.y)[:3]
    depth, n = 1.0 + depth, len(depth)
    lines = np.linspace(0.0, LENGTH + RATE * math.sin(math.pi * state.t), n + 1)
    contents = np.concatenate([[0.0], np.cumsum(depth * np.diff(lines))])

    def at_lines(mean):
        return (7 * (mean[1:-2] + mean[2:-1]) - mean[:-3] - mean[3:]) / 12  # fourth order, lines 2 to n - 2

    return lines, contents, at_lines(depth), at_lines(flow) / at_lines(depth)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_the_terms_of_a_volume_up_to_a_line_that_moves(share):
    errors = []
    for cells in (20, 40):
        model, states = run_up(cells)
        before, now, after = (held(model, state) for state in states)
        m = round(share * cells)
        lines, _, depth, velocity = now
        speed = RATE * math.pi * math.cos(math.pi * T) * m / cells
        whole = (after[1][m] - before[1][m]) / (2 * D)
        inside = sum(sign * CubicSpline(*one[:2])(lines[m]) for sign, one in ((1, after), (-1, before))) / (2 * D)
        swept = depth[m - 2] * speed
        flux = depth[m - 2] * velocity[m - 2]
        assert abs(swept) > 0.05 and abs(inside) > 0.05  # not negligible
        errors.append([abs(whole - inside - swept), abs(inside + flux), abs(whole + flux - swept)])  # (71), (76), (77)
    assert max(errors[1]) < 1e-5
    assert errors[1][2] < 0.2 * errors[0][2]
