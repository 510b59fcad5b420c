"""Real runs of servo axes in `stability`: rounding and the end of a case are not taken as failed steps."""

from pathlib import Path

import numpy as np
import pytest
from reference.scenes import area, chamber, reservoir, scene, valve

import fvsolve
from fvsolve.studies.operating_point import operating_point
from fvsolve.studies.stability.real_runs import RealRuns
from fvsolve.studies.stability.stability import LinearSystem, stability

ARM = Path(__file__).parents[1] / "reference" / "servo-arm.toml"
IMPLICIT = {"numerics.method": "radau-iia-5"}
OIL = {"name": "user", "density": 870.0, "bulk_modulus": 1.4e9, "viscosity": 46e-6, "law": "linear"}
THETA = "0 | 0 0\n 1 | 3/5 2/5\n ---\n | 3/5 2/5"  # |R| = 1.5 at infinity, |R| > 1 beyond |h lambda| = 10


@pytest.fixture(scope="module")
def arm():
    """Linear system of the moving arm; hoses near zero drop have laws that are linear over 1e-11 of the pressures."""
    return LinearSystem(operating_point(ARM, IMPLICIT, 0.7))


def runs(side, method):
    """Real runs of a method without an end in time."""
    found = RealRuns(side.at, method, side.form, a=side.linear.a)
    found.latest = np.inf
    return found


@pytest.mark.parametrize("method", ["rodas-5p", "radau-iia-5", "tr-bdf2"])
def test_what_newton_and_rounding_leave_is_no_growth(arm, method):
    """Deviations start at 1e-14 here; runs at 0.2 ms are right to five digits, as the next test shows."""
    assert not any(runs(arm, method).fails(h) for h in (4e-5, 2e-4))


@pytest.fixture(scope="module")
def truth():
    return swing("radau-iia-5")


def swing(method, step=None):
    """Angle [deg] and pressure [bar] of the arm every 2 ms until 1.9 s, in motion until 1.2 s : float64[2, n]."""
    steps = {} if step is None else {"numerics.step": step}
    case = fvsolve.load(ARM)
    raw = {**case.raw, "numerics": {"end": "1.9 s"} | ({"rtol": 1e-8} if step is None else {})}
    run = fvsolve.run(raw, {"numerics.method": method, **steps})
    return np.array([run["arm.angle"], run["lift.A.gauge_pressure"]])


def test_steps_that_are_said_to_be_safe_are_right(truth):
    at = round(1.2 / 2e-3)
    assert swing("rodas-5p", 2e-4)[:, at] == pytest.approx(truth[:, at], rel=1e-5)


@pytest.mark.parametrize("method, step", [("rk4", 2e-4), ("rodas-5p", 4e-2)])
def test_steps_that_fail_are_found(arm, truth, method, step):
    """Explicit steps fail in motion; linearly implicit steps fail where the arm stops, with pressures 18 bar off."""
    assert runs(arm, method).fails(step)
    if method == "rodas-5p":
        assert np.abs(swing(method, step) - truth)[1].max() > 10.0


def test_an_implicit_method_that_fails_is_found_where_it_is_predicted_to():
    """Chambers and flowing valves: |R| of this method exceeds 1 beyond h = 10 / |lambda|."""
    fvsolve.tableau("theta-4-10", THETA)
    nodes = {"in": reservoir(2e6), "a": chamber(1e-3), "b": chamber(2e-3), "out": reservoir(1e6)}
    links = {f"v{k}": valve(*pair, 1e-5) for k, pair in enumerate((("in", "a"), ("a", "b"), ("b", "out")))}
    (row,) = stability(scene(nodes, links, 1.0, {"method": "theta-4-10", "step": 1e-6})).rows
    assert row.measured == pytest.approx(row.predicted, rel=1e-3)
    assert row.eigenvalues < row.predicted < 1.1 * row.eigenvalues


def pushed():
    """Case of a cylinder that a spool valve moves to its end in 1.5 s, where its model ends."""
    nodes = {"P": reservoir(2e7), "T": reservoir(3e5), "A": chamber(4e-4), "B": chamber(4e-4),
             "post": {"type": "frame"}, "load": {"type": "mass", "mass": 350.0, "initial_position": 1.0}}  # fmt: skip
    links = {
        "spool": {"type": "spool-valve", "ports": {port: port for port in "PTAB"}, "area": 2e-5, "position": 0.4},
        "hoseA": valve("A", "lift.A", area(9e-3)), "hoseB": valve("B", "lift.B", area(9e-3)),
        "lift": {"type": "cylinder", "ports": {"rod": "load", "case": "post"}, "closed_length": 0.8, "stroke": 0.6,
                 "piston_diameter": 63e-3, "rod_diameter": 36e-3, "dead_volume_A": 60e-6, "dead_volume_B": 60e-6,
                 "initial_pressure_B": 4e6},
    }  # fmt: skip
    return scene(nodes, links, 1.0, {"method": "radau-iia-5", "rtol": 1e-6}, fluid=OIL)


def test_a_scene_that_ends_is_no_step_that_fails():
    """1000 steps of 1.4 ms or more reach the end of the cylinder with any method."""
    (row,) = stability(pushed(), methods=["radau-iia-5"], at=0.1).rows
    assert row.measured == np.inf and row.steps * row.measured_up_to > 2.0
    (quick,) = stability(pushed(), methods=["rk4"], at=0.1).rows
    assert quick.measured == pytest.approx(quick.predicted, rel=0.1)
