"""Passivity of methods and schemes: claims from coefficients, and real runs that agree with them."""

import importlib
import math

import numpy as np
import pytest
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    NO_FRICTION,
    RHO,
    WATER,
    area,
    chamber,
    junction,
    pipe,
    reservoir,
    scene,
    tank,
    valve,
)
from reference.scenes import step as stepped

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.studies.energy_balance import energy, measure_pairs
from fvsolve.studies.outcome import outcome, study_model
from fvsolve.studies.passivity import (
    closed_pipe,
    courant_limit,
    method_claim,
    passivity,
    scheme_claim,
)

study = importlib.import_module("fvsolve.studies.passivity")
VOLUME, FLOW = 0.2, 1e-3
BETA = WATER["bulk_modulus"]
ALWAYS = [
    "implicit-euler",
    "implicit-midpoint",
    "gauss-4",
    "gauss-6",
    "radau-iia-3",
    "radau-iia-5",
    "lobatto-iiic-4",
]
NEVER = ["euler", "improved-euler", "rk4", "ssp-rk3", "dormand-prince", "trapezoid", "esdirk-4"]


def pumped(method: str, h: float, half: int) -> dict:
    """Case of a chamber at ambient pressure that is filled for `half` steps and emptied for as many."""
    nodes = {
        "pump": {"type": "inflow", "flow": stepped(half * h, FLOW, -FLOW)},
        "pot": chamber(VOLUME, AMBIENT),
    }
    return scene(
        nodes, {"way": valve("pump", "pot", 10.0)}, 2 * half * h, {"method": method, "step": h}
    )


@pytest.mark.parametrize("name", ALWAYS)
def test_algebraically_stable_methods_are_passive_in_any_network(name):
    claim = method_claim(name)
    assert claim.any_network
    assert claim.chamber >= 0.0
    assert (claim.leak, claim.resonator) == (math.inf, math.inf)


@pytest.mark.parametrize("name", NEVER)
def test_other_methods_create_energy_in_a_chamber_by_some_flow(name):
    """The worst eigenvector is the flow q at the stage times, and the method integrates y' = q(t)."""
    from fvsolve.core.steppers import method_named

    claim, method = method_claim(name), method_named(name)
    assert not claim.any_network
    together = study.stages_by_time(method.c)
    times = sorted(set(np.round(method.c, 12)))
    matrix = together.T @ study.stage_matrix(method.a, method.b) @ together
    q = together @ np.linalg.eigh(matrix)[1][:, 0]
    y = method.a @ q  # stages of y' = q from 0 by h = 1
    after, supplied = method.b @ q, method.b @ (q * y)
    assert len(times) == matrix.shape[0]
    assert 0.5 * after**2 - supplied == pytest.approx(-0.5 * claim.chamber, rel=1e-10)
    assert 0.5 * after**2 > supplied


def test_forward_euler_breaks_condition_2_on_a_single_chamber():
    """Filled and emptied by h q per step, the chamber creates h^2 q^2 beta / V every two steps."""
    h, half = 0.01, 30
    found = energy(pumped("euler", h, half), port="pump")
    made = half * (h * FLOW) ** 2 * BETA / VOLUME
    assert found.port.at_start == 0.0
    assert found.port.margin == pytest.approx(-made, rel=1e-6)
    assert found.port.work == pytest.approx(-made, rel=1e-6)
    assert not found.port.passive
    assert "NOT passive" in found.port.text


@pytest.mark.parametrize("method", [*ALWAYS, "improved-euler", "rk4", "trapezoid"])
def test_others_keep_condition_2_on_it(method):
    """For methods of order two and more, the flow is constant within a step, and they create no energy."""
    found = energy(pumped(method, 0.01, 30), port="pump")
    assert found.port.passive
    assert found.port.margin >= -1e-12 * found.throughput
    if method in ("implicit-euler", "implicit-midpoint", "gauss-4"):
        lost = 60 * 0.5 * (0.01 * FLOW) ** 2 * BETA / VOLUME if method == "implicit-euler" else 0.0
        assert found.remainder[-1] == pytest.approx(lost, abs=1e-9 * found.throughput)


def swinging(method: str, h_omega: float, steps: int = 60) -> dict:
    omega = math.sqrt(GRAVITY * area(0.5) / 50.0 / 2.0)
    nodes = {"sea": reservoir(AMBIENT + RHO * GRAVITY * 3.0), "pond": tank(2.0, 5.0)}
    links = {
        "way": {
            "type": "rigid-column",
            "from": "sea",
            "to": "pond",
            "length": 50.0,
            "diameter": 0.5,
            "friction": NO_FRICTION,
        }
    }
    h = h_omega / omega
    return scene(nodes, links, steps * h, {"method": method, "step": h, "initial": "rest"})


@pytest.mark.parametrize(
    "name", ["euler", "improved-euler", "ssp-rk3", "rk4", "dormand-prince", "trapezoid", "gauss-4"]
)
def test_a_resonator_gains_energy_just_beyond_the_limit_and_not_below(name):
    limit = method_claim(name).resonator

    def swing(h_omega: float) -> np.ndarray:
        """Energy relative to the level of the sea, over its value at the start."""
        found = energy(swinging(name, h_omega))
        held = found.stored["way"] + found.stored["pond"] - found.supplied["sea"]
        return 1.0 + held / (0.5 * RHO * GRAVITY * 2.0 * 2.0**2)

    if limit == math.inf:
        assert swing(5.0).max() <= 1.0 + 1e-9
        return
    if limit > 0.0:
        assert np.diff(swing(0.99 * limit)).max() <= 1e-12
    assert swing(max(1.01 * limit, 0.1))[-1] > 1.0


def pipe_model(scheme: str, method: str, courant: float, steps: int = 1):
    """Model of the closed pipe of the study, for some steps at a Courant number."""
    h = courant * 50.0 / 1000.0
    nodes = {"a": junction(), "b": junction(), "tap": reservoir(1e6)}
    links = {
        "pipe": pipe("a", "b", 1000.0, 0.3, 1000.0, study.CELLS),
        "shut": valve("b", "tap", 1e-4, 0.0),
    }
    return study_model(
        scene(
            nodes,
            links,
            steps * h,
            {"scheme": scheme, "method": method, "step": h, "initial": "rest"},
        )
    )


def worst_state(scheme: str, method: str, courant: float) -> np.ndarray:
    """State whose energy a step increases most."""
    from fvsolve.core.steppers import method_named, stability_function

    a, s = closed_pipe(scheme)
    b = courant * study.pipe_operator(scheme)
    r = stability_function(method_named(method))
    up, down = (
        study.matrix_polynomial([float(x) for x in p.coefficients], b)
        for p in (r.numerator, r.denominator)
    )
    assert a.shape == s.shape
    return np.linalg.solve(s, np.linalg.svd(np.linalg.solve(down, up))[2][0])


def gain(scheme: str, method: str, courant: float) -> float:
    """Energy after a real step over that before, from the worst state."""
    start, s = worst_state(scheme, method, courant), closed_pipe(scheme)[1]
    run = outcome(pipe_model(scheme, method, courant), y=start)
    assert run.ok
    assert run.counts["steps"] == 1
    return float(np.sum((s @ run.y) ** 2) / np.sum((s @ start) ** 2))


@pytest.mark.parametrize("scheme", ["upwind", "fromm"])
@pytest.mark.parametrize("method", ["euler", "improved-euler", "ssp-rk3", "rk4", "dormand-prince"])
def test_real_steps_gain_energy_just_beyond_the_courant_limit_and_not_below(scheme, method):
    limit = courant_limit(scheme, method)
    if limit > 0.0:
        assert gain(scheme, method, 0.99 * limit) <= 1.0 + 1e-9
    assert gain(scheme, method, max(1.01 * limit, 0.1)) > 1.0 + 1e-5


def test_upwind_and_euler_are_passive_up_to_courant_1():
    assert courant_limit("upwind", "euler") == pytest.approx(1.0, abs=1e-8)
    assert courant_limit("fromm", "euler") == 0.0


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "fromm"])
@pytest.mark.parametrize("method", ["implicit-euler", "gauss-4", "radau-iia-3", "trapezoid"])
def test_a_stable_methods_with_a_passive_scheme_never_gain_energy(scheme, method):
    assert courant_limit(scheme, method) == math.inf
    assert gain(scheme, method, 7.3) <= 1.0 + 1e-9


@pytest.mark.parametrize("scheme", ["central", "linear-upwind", "upwind3", "upwind5"])
def test_other_schemes_create_energy_at_pipe_ends_and_no_more_than_stated(scheme):
    """The method does not matter: gauss-4 itself creates no energy."""
    claim = scheme_claim(scheme)
    assert not claim.passive
    assert gain(scheme, "gauss-4", 0.1) > 1.0 + 0.02 * claim.rate
    start, s = worst_state(scheme, "gauss-4", 0.1), closed_pipe(scheme)[1]
    most = 1.0
    for steps in (1, 3, 10, 30, 100):
        run = outcome(pipe_model(scheme, "gauss-4", 0.1, steps), y=start)
        most = max(most, float(np.sum((s @ run.y) ** 2) / np.sum((s @ start) ** 2)))
    assert 1.0 < most <= claim.gain + 1e-3 * (claim.gain - 1.0)


def test_the_tool_names_the_pairs_that_break_passivity():
    found = passivity(["upwind", "fromm", "upwind5"], ["euler", "rk4", "gauss-4"])
    assert set(found.breaking) == {
        ("fromm", "euler"),
        ("upwind5", "euler"),
        ("upwind5", "rk4"),
        ("upwind5", "gauss-4"),
    }
    said = found.plain()
    assert [one["method"] for one in said["methods"]] == ["euler", "rk4", "gauss-4"]
    assert {"scheme": "upwind", "method": "gauss-4", "courant": None, "any_step": True} in said[
        "pairs"
    ]
    with pytest.raises(FvsolveError, match='did you mean "upwind5"'):
        passivity(["upwnd5"])


def test_a_case_is_tried_by_pairs_and_those_that_create_energy_are_named():
    case = fvsolve.load(swinging("rk4", 0.5))
    rows = {
        row["method"]: row
        for row in measure_pairs(
            case, None, ["euler", "implicit-midpoint", "implicit-euler"], "sea"
        )
    }
    assert rows["euler"]["creates"]
    assert not rows["implicit-euler"]["creates"]
    assert not rows["implicit-midpoint"]["creates"]
    assert rows["implicit-euler"]["remainder"] > 0.0 > rows["euler"]["remainder"]
    assert rows["euler"]["margin"] is not None
