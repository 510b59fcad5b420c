"""Exact solutions of the shallow-water equations: balances at jumps, and the equations themselves by differences."""

import numpy as np
import pytest

from fvsolve.exact.shallow_water import GRAVITY, SOLUTIONS, data_of

CASES = [("bump", {}), ("bump", {"flow": 1.53, "level": 0.66, "transcritical": 1.0}),
         ("bump", {"flow": 0.18, "level": 0.33, "transcritical": 2.0}), ("macdonald", {"manning": 0.033}),
         ("macdonald", {"factor": 0.093}),
         ("macdonald", {"flow": 2.5, "manning": 0.04, "supercritical": 1.0})]  # fmt: skip


@pytest.mark.parametrize("name, data", CASES)
def test_steady_flows_balance_gravity_friction_and_momentum(name, data):
    """d/dx (q^2 / h + g h^2 / 2) = -g h dz/dx - friction, by central differences away from jumps and kinks."""
    x = np.linspace(8.2, 11.1, 2901) if name == "bump" else np.linspace(50.0, 950.0, 9001)
    flow, step = SOLUTIONS[name](x, 0.0, **data), x[1] - x[0]
    h, q = flow.depth, flow.discharge
    assert q == pytest.approx(np.full_like(x, data.get("flow", data_of(name)["flow"])))
    friction = (
        GRAVITY * data.get("manning", 0.0) ** 2 * q**2 / h ** (7 / 3)
        + data.get("factor", 0.0) * q**2 / 8 / h**2
    )
    left = np.gradient(q**2 / h + GRAVITY * h**2 / 2, step)
    right = -GRAVITY * h * np.gradient(flow.bed, step) - friction
    smooth = np.abs(np.diff(h, append=h[-1])) < 0.01
    smooth &= np.roll(smooth, 1) & np.roll(smooth, -1)
    assert left[smooth][2:-2] == pytest.approx(right[smooth][2:-2], rel=2e-3, abs=2e-3)


def test_the_jump_conserves_momentum_and_loses_head():
    x = np.linspace(10.5, 12.5, 200001)
    flow = SOLUTIONS["bump"](x, 0.0, 0.18, 0.33, 2.0)
    k = int(np.argmax(np.diff(flow.depth)))
    force = flow.discharge**2 / flow.depth + GRAVITY * flow.depth**2 / 2
    head = flow.u**2 / (2 * GRAVITY) + flow.surface
    assert force[k + 1] == pytest.approx(force[k], rel=1e-3) and head[k + 1] < head[k] - 1e-3


@pytest.mark.parametrize("right", [0.001, 0.0])
def test_a_dam_break_conserves_mass_and_momentum(right):
    """Mass grows by nothing, momentum by g (hl^2 - hr^2) / 2 t, on a span that no wave has left."""
    x, t = np.linspace(0.0, 10.0, 200001), 6.0
    flow, mean = SOLUTIONS["dam-break"](x, t, 0.005, right, 5.0), lambda v: np.trapezoid(v, x)
    assert mean(flow.depth) == pytest.approx(5.0 * (0.005 + right), rel=1e-5)
    assert mean(flow.discharge) == pytest.approx(GRAVITY * (0.005**2 - right**2) / 2 * t, rel=1e-4)


def test_the_fan_of_dressler_without_friction_is_ritters():
    x = np.linspace(600.0, 1100.0, 501)
    rough, smooth = (
        SOLUTIONS["dressler"](x, 40.0, chezy=1e6),
        SOLUTIONS["dam-break"](x, 40.0, 6.0, 0.0, 1000.0),
    )
    assert rough.depth == pytest.approx(smooth.depth, rel=1e-6) and rough.u == pytest.approx(
        smooth.u, abs=1e-6
    )
    slower = SOLUTIONS["dressler"](x, 40.0)
    known = np.isfinite(slower.u) & (x > 1000.0)
    assert known.sum() > 50 and (slower.u < smooth.u)[known].all()


def test_the_swinging_parabola_conserves_its_water_and_obeys_newton():
    """All water has one acceleration, -g d(surface)/dx; its volume is constant."""
    x, dt = np.linspace(0.0, 4.0, 40001), 1e-5
    volumes = []
    for t in (0.3, 1.1, 1.7):
        now, before, after = (SOLUTIONS["parabola"](x, t + shift) for shift in (0.0, -dt, dt))
        wet = now.depth > 1e-3
        slope = np.gradient(now.surface, x)[wet]
        assert (after.u - before.u)[wet] / (2 * dt) == pytest.approx(
            -GRAVITY * slope, rel=1e-6, abs=1e-6
        )
        assert np.ptp(now.u[wet]) == 0.0
        volumes.append(np.trapezoid(now.depth, x))
    # of h0 (1 - s^2) over a width of 2 a
    assert volumes == pytest.approx([2.0 / 3.0] * 3, rel=1e-6)
