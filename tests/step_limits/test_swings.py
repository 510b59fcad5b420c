"""Notices of undamped oscillations under a Courant number, against runs and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.bodies import pendulum
from reference.scenes import scene

import fvsolve

MASS, STIFF, END = 2.0, 32.0, 200.0  # mass [kg] and stiffness [N/m] of an oscillator with 4 rad/s; end [s]


def beside_a_pond(nodes, links, probes, method="ssp-rk2", **numerics):
    """Case of oscillating parts and a basin at rest, whose waves determine the step."""
    pond = {"type": "basin", "size": [4.0, 1.0], "cells": [16, 1], "level": 1.0}
    more = numerics or {"courant": 0.8}
    return scene({**nodes, "pond": pond}, links, END, {"scheme": "muscl", "method": method, **more}, probes, 0.1)


def sprung(damping=0.0, **more):
    nodes = {"m": {"type": "mass", "mass": MASS, "initial_velocity": 0.1}, "ground": {"type": "frame"}}
    links = {"s": {"type": "spring", "from": "ground", "to": "m", "stiffness": STIFF}}
    if damping:
        links["d"] = {"type": "damper", "from": "ground", "to": "m", "damping": damping}
    return beside_a_pond(nodes, links, ["m.velocity", "m.position"], **more)


def grown(result) -> float:
    """Amplitude at the end over that at the start."""
    return math.hypot(result["m.velocity"][-1], math.sqrt(STIFF / MASS) * result["m.position"][-1]) / 0.1


def told(case):
    """Notices of oscillations, and result of the run."""
    result = fvsolve.run(case)
    return [one for one in result.warnings if one.kind == "swing"], result


def test_a_swing_that_ssp_rk2_feeds_is_told_with_by_how_much_it_grows():
    """A notice states the growth of an oscillator under ssp-rk2, sqrt(1 + (w h)^4 / 4) per step."""
    (one,), result = told(sprung())
    h = END / result.summary["steps"]
    wanted = (1.0 + (math.sqrt(STIFF / MASS) * h) ** 4 / 4.0) ** (0.5 * END / h)
    assert 1.05 < wanted < 1.2
    assert grown(result) == pytest.approx(wanted, rel=1e-4) and one.value == pytest.approx(wanted, rel=1e-3)
    assert (
        one.place in ("m.position", "m.velocity")
        and one.ok
        and "0.6366 Hz" in one.text
        and 'method = "ssp-rk3"' in one.text
    )


def test_what_it_asks_for_helps():
    (one,), _ = told(sprung())
    courant = float(one.text.partition("numerics.courant = ")[2].partition(",")[0])
    _, result = told(sprung(courant=courant))
    assert grown(result) == pytest.approx(1.01, abs=1e-4)
    assert not told(sprung(method="ssp-rk3"))[0] and not told(sprung(method="rk4"))[0]


def test_what_is_damped_and_what_is_wrong_by_far():
    assert not told(sprung(damping=0.05))[0]
    (one,), _ = told(sprung(method="euler", courant=0.05))
    assert not one.ok and one.value > 10.0


def test_a_body_that_swings_is_one_and_check_says_so_too(tmp_path, fvs):
    from fvsolve.case.text import write

    case = beside_a_pond({"arm": pendulum(0.1)}, {}, ["arm.angle"])
    (one,), result = told(case)
    late = np.abs(result["arm.angle"][result.t > END - 4.0]).max() / 0.1
    assert one.place.startswith("arm.") and late == pytest.approx(one.value, rel=5e-3)
    (tmp_path / "arm.toml").write_text(write(case))
    code, said, _ = fvs("check", tmp_path / "arm.toml")
    assert code == 0 and "an oscillation at 0.59" in said
