"""Periodic pipe: real runs fail at the limits of linear schemes, and limits of limited schemes are measured."""

import math

import numpy as np
import pytest

from fvsolve.core.assembly.scheme_codes import CODES
from fvsolve.core.kernels.reconstruction import limited
from fvsolve.core.schemes import LIMITERS, branches
from fvsolve.core.step_limits.advection_limit import advection_limit
from fvsolve.core.step_limits.symbol import WEIGHTS, weights_of
from fvsolve.core.steppers import METHODS
from fvsolve.studies.stability.periodic_limits import (
    PeriodicPipe,
    limited_limit,
    measured_courant,
    measured_limit,
    measured_limits,
    monotone_limit,
    start_fields,
)

EXPLICIT = [name for name, one in METHODS.items() if name == one.name and one.explicit]


@pytest.mark.parametrize("scheme", [*WEIGHTS, "weno5"])
def test_a_run_equals_the_same_steps_in_numpy(scheme):
    """SSP-RK3 of Shu and Osher with shifted arrays in NumPy; weno5 by its formula."""
    cells, courant, steps = 24, 0.3, 7
    u = np.sin(2 * np.pi * np.arange(cells) / cells) + np.random.default_rng(3).random(cells)

    def rate(u):
        a, b, c, d, e = (np.roll(u, 2 - k) for k in range(5))
        if scheme != "weno5":
            f = sum(float(w) * x for w, x in zip(weights_of(scheme), (a, b, c, d, e), strict=True))
            return np.roll(f, 1) - f
        p = (2 * a - 7 * b + 11 * c) / 6, (-b + 5 * c + 2 * d) / 6, (2 * c + 5 * d - e) / 6
        s = (
            13 / 12 * (a - 2 * b + c) ** 2 + (a - 4 * b + 3 * c) ** 2 / 4,
            13 / 12 * (b - 2 * c + d) ** 2 + (b - d) ** 2 / 4,
            13 / 12 * (c - 2 * d + e) ** 2 + (3 * c - 4 * d + e) ** 2 / 4,
        )
        w = [
            g * (1 + (np.abs(s[0] - s[2]) / (x + 1e-18)) ** 2)
            for g, x in zip((0.1, 0.6, 0.3), s, strict=True)
        ]
        f = sum(x * y for x, y in zip(w, p, strict=True)) / sum(w)
        return np.roll(f, 1) - f

    wanted = u.copy()
    for _ in range(steps):
        one = wanted + courant * rate(wanted)
        two = 0.75 * wanted + 0.25 * (one + courant * rate(one))
        wanted = wanted / 3 + 2 / 3 * (two + courant * rate(two))
    assert PeriodicPipe(scheme, "ssp-rk3", cells).run(u, courant, steps) == pytest.approx(
        wanted, rel=1e-11, abs=1e-11
    )


@pytest.mark.parametrize("scheme", WEIGHTS)
def test_runs_fail_where_the_waves_predict(scheme):
    """Measured and predicted limits of linear schemes with explicit methods are equal, because matrices are normal."""
    found = measured_limits([scheme])
    assert [one.method for one in found] == EXPLICIT
    assert all(one.ratio == pytest.approx(1.0, abs=1e-6) for one in found)


def test_a_run_fails_where_the_matrix_of_a_step_predicts():
    """At the measured limit, the greatest norm of the powers of the step matrix (NumPy) passes the threshold."""
    cells, steps = 16, 200
    one = measured_limit("upwind3", "rk4", cells, steps)
    face = np.zeros((cells, cells))
    for k, w in enumerate(weights_of("upwind3")):
        face += float(w) * np.roll(np.eye(cells), k - 2, axis=1)
    j = np.roll(face, 1, axis=0) - face
    for courant, fails in ((one.measured * 1.0001, True), (one.measured * 0.9999, False)):
        s = courant * j
        step = sum(np.linalg.matrix_power(s, m) / math.factorial(m) for m in range(5))
        growth = max(
            np.linalg.norm(np.linalg.matrix_power(step, n), 2) for n in range(1, steps + 1)
        )
        assert (growth > 1e3) == fails


def test_longer_runs_fail_nearer_to_the_exact_limit():
    exact = advection_limit("upwind5", "ssp-rk3").limit
    excess = [
        measured_limit("upwind5", "ssp-rk3", 100, n).measured / exact - 1
        for n in (100, 1000, 10000)
    ]
    assert 0 < excess[2] < 0.12 * excess[1] < 0.02 * excess[0]


@pytest.mark.parametrize(
    "scheme, method, least",
    [("upwind5", "ssp-rk2", 0.5), ("central", "verner-7", 4.0), ("central", "tsitouras", 1.6)],
)
def test_a_short_run_looks_stable_far_beyond_the_exact_limit(scheme, method, least):
    assert (
        advection_limit(scheme, method).limit < 0.5
        and measured_limit(scheme, method).measured > least
    )


# ---- limited schemes


def test_frozen_slopes_are_the_tangents_of_the_limiters():
    """Slopes of the limiters at a = 0, a = b and b = 0 by differences are those of their entries."""
    tiny = 1e-7
    for name, one in LIMITERS.items():
        found = set()
        for a, b in ((tiny, 1.0), (1.0, tiny), (1.0, 0.99), (1.0, 1.01), (1.0, -1.0)):
            by_a = (limited(CODES[name], a * (1 + tiny), b) - limited(CODES[name], a, b)) / (
                a * tiny
            )
            by_b = (limited(CODES[name], a, b * (1 + tiny)) - limited(CODES[name], a, b)) / (
                b * tiny
            )
            found.add((round(2 * by_a + 1e-9, 1) / 2, round(2 * by_b + 1e-9, 1) / 2))
        assert found == {(0.0, 0.0), *((float(a), float(b)) for a, b in one.tangents)}, name
        assert all(sum(weights) == 1 for weights in branches("muscl", name).values())
    assert all(sum(weights) == 1 for weights in branches("weno5", "").values())
    assert list(branches("muscl", "minmod")) == ["upwind", "linear-upwind", "central"]
    assert list(branches("muscl", "van-leer")) == ["upwind", "fromm", "twice behind", "twice ahead"]


def test_weno_stencils_with_their_ideal_weights_are_upwind5():
    parts = branches("weno5", "")
    behind, middle, ahead = (parts[x] for x in ("stencil behind", "upwind3", "stencil ahead"))
    mixed = [(a + 6 * b + 3 * c) / 10 for a, b, c in zip(behind, middle, ahead, strict=True)]
    assert mixed == list(parts["upwind5"])


@pytest.mark.parametrize(
    "limiter, bound", [("minmod", 2 / 3), ("van-leer", 0.5), ("monotonized-central", 0.5)]
)
@pytest.mark.parametrize("method", ["euler", "ssp-rk3"])
def test_total_variation_does_not_grow_up_to_the_bound(limiter, bound, method):
    assert monotone_limit(limiter, method) == pytest.approx(bound)
    circle = PeriodicPipe("muscl", method, 50, limiter)
    for u in start_fields(50).values():
        for _ in range(200):
            before, u = np.abs(np.diff(u, append=u[:1])).sum(), circle.run(u, bound, 1)
            assert np.abs(np.diff(u, append=u[:1])).sum() <= before * (1 + 1e-12)


def test_van_leers_limiter_with_euler_has_no_sharp_limit():
    """Measured limits of one wave on 50 cells fall with 500, 5 000 and 50 000 steps, and stay above the bound 1/2."""
    u = start_fields(50)["wave"]
    found = [measured_courant("muscl", "van-leer", "euler", u, n) for n in (500, 5000, 50000)]
    assert found == pytest.approx([0.67, 0.57, 0.52], abs=0.01) and found[-1] > 0.5


def test_a_limit_that_falls_as_runs_get_longer_is_not_called_sharp():
    euler = limited_limit("muscl", "van-leer", "euler", 30, 100)
    assert (
        euler.sharp is False
        and euler.monotone == 0.5
        and euler.least[0] > 1.1 * euler.least[2] > 0.55
    )
    assert {name: one.limit for name, one in euler.frozen.items()}["fromm"] == 0.0
    third = limited_limit("muscl", "van-leer", "ssp-rk3", 30, 100)
    assert third.sharp and third.least[-1] == pytest.approx(
        advection_limit("upwind", "ssp-rk3").limit, rel=0.01
    )
