"""Growth of waves between a delay line and a storing node: predictions against reflection factors and runs."""

import numpy as np
import pytest
from reference.short_lines import vessel

import fvsolve
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run
from fvsolve.core.steppers.tableau import method_named
from fvsolve.features.delay_lines.feature import lines_of
from fvsolve.features.delay_lines.growth import ANGLES, interpolation_factor, reflection_factor


def test_the_trapezoidal_rule_reflects_the_incoming_wave():
    """S = (a cos(theta / 2) - 2 i sin(theta / 2)) / (a cos(theta / 2) + 2 i sin(theta / 2)), of modulus 1."""
    for a in (0.1, 1.0, 7.0):
        found = reflection_factor(method_named("trapezoid"), a, 5.0) / interpolation_factor(5.0)
        c, s = a * np.cos(0.5 * ANGLES), 2j * np.sin(0.5 * ANGLES)
        assert found == pytest.approx((c - s) / (c + s), abs=1e-12)


def test_euler_gives_back_more_at_every_angle():
    """|S|^2 = ((a - u)^2 + v^2) / ((a + u)^2 + v^2) > 1 with u + i v = exp(i theta) - 1."""
    for a in (0.1, 0.7):
        z = np.exp(1j * ANGLES) - 1.0
        right = np.abs((a - z) / (a + z))
        assert np.abs(reflection_factor(method_named("euler"), a, 4.0)) == pytest.approx(
            right, rel=1e-12
        )
        assert (right > 1.0).all()


def test_reading_between_steps_magnifies_nothing():
    for steps in (1.2, 1.5, 2.5, 2.9, 3.1, 7.5):
        assert np.abs(interpolation_factor(steps)).max() <= 1.0 + 1e-12


def energy(case: dict) -> tuple[float, list]:
    """Energy of waves, flow and chamber at the end of a run [J m3/kg], and its notices of growing waves.

    Pressures count from that of the lake.
    """
    model = fvsolve.build(fvsolve.load(case))
    run = Run(model, fvsolve.initial_state(model), MemorySink(model), None)
    warnings = run.go().warnings
    out = run.run_data.evaluate(run.loop.t, run.loop.now, np.inf)[1]
    total = 0.5 * float(model.tables.nodes["stiffness"].max()) * float(run.loop.now[-1]) ** 2
    waves = run.run_data.along(run.loop.t, out).values()
    for line, (r, l) in zip(lines_of(model), waves, strict=True):  # noqa: E741
        pipe = model.tables.pipes[line["pipe"]]
        r, l = r + 0.5 * pipe["flow"], l - 0.5 * pipe["flow"]  # noqa: E741
        total += float(
            np.mean(r**2 + l**2) * line["tau"] * line["stretches"] * pipe["speed"] / pipe["area"]
        )
    return total, [
        one for one in warnings if "waves between this part and the delay lines grow" in one.text
    ]


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "method", ["euler", "implicit-midpoint", "rk4", "ssp-rk2", "trapezoid", "ssp-rk3"]
)
@pytest.mark.parametrize("volume", [0.6, 0.15])
def test_stores_with_a_notice_of_growth_grow(method, volume):
    """The energy after 30 s is 1000 times that after 1 s if a notice predicts growth, otherwise at most 1.2 times.

    The step is 0.24 or 0.96 of the filling time of the chamber. Jumps within steps add some energy, up to a seventh at
    the longer step.
    """
    (early, _), (late, told) = (
        energy(vessel(method, 0.01, end, volume, 200)) for end in (1.0, 30.0)
    )
    assert all(not one.ok for one in told)
    if told:
        assert late > 1e3 * early
    else:
        assert late < 1.2 * early
