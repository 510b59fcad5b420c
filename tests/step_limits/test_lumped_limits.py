"""Notices of steps that are too long for parts other than waves, and of undamped oscillations.

Notices come before the run and after it, and valid runs have none. The references are the closed form of an oscillator,
the exact end of a stability interval, or a run under error control.
"""

import math
from importlib import import_module

import numpy as np
import pytest
from reference.bodies import pendulum
from reference.scenes import (
    AMBIENT,
    WATER,
    chamber,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    tank,
)
from scipy.optimize import brentq

import fvsolve
from fvsolve.core.run import model_of
from fvsolve.core.step_limits.growing_modes import lumped_modes
from fvsolve.core.step_limits.step_notices import step_limits
from fvsolve.core.steppers.analysis.stability_function import stability_function
from fvsolve.core.steppers.tableau import method_named

EXACT = {"method": "rodas-5p", "rtol": 1e-8, "scheme": "upwind"}


def hole(start: str, end: str, diameter: float, opening=1.0) -> dict:
    return {"type": "orifice", "from": start, "to": end, "diameter": diameter, "opening": opening}


def notices_of(notices, kind: str) -> list:
    return [one for one in notices if one.kind == kind]


def swinging(mass: float, stiffness: float, damping: float, end: float, **numerics) -> dict:
    """Case of a displaced mass on a spring with a damper."""
    nodes = {
        "wall": {"type": "frame"},
        "load": {"type": "mass", "mass": mass, "initial_position": 0.01},
    }
    links = {
        "spring": {"type": "spring", "from": "wall", "to": "load", "stiffness": stiffness},
        "damper": {"type": "damper", "from": "wall", "to": "load", "damping": damping},
    }
    return scene(nodes, links, end, numerics, ["load.position"], end / 50)


@pytest.mark.parametrize("method", ["euler", "ssp-rk3", "rk4", "dormand-prince"])
def test_the_limit_of_a_damped_swing_is_that_of_its_eigenvalues(method):
    """The limit of a damped oscillator with s = -60 +- 308.2i 1/s is the step with |R(h s)| = 1.

    At 2 % below the limit oscillations decay; at 6 % above they grow and give a notice.
    """
    s, r = complex(-60.0, math.sqrt(1e5 - 60.0**2)), stability_function(method_named(method))
    tried = np.linspace(1e-6, 0.03, 3000)
    first = int(np.argmax(np.abs(r(tried * s)) > 1.0))
    limit = brentq(lambda h: abs(complex(r(h * s))) - 1.0, tried[first - 1], tried[first])
    for factor, grows in ((0.98, False), (1.06, True)):
        case = swinging(10.0, 1e6, 1200.0, 3000.0 * limit, method=method, step=factor * limit)
        before = step_limits(model_of(case))
        assert [one.ok for one in before] == ([False] if grows else [])
        result = fvsolve.run(case)
        t, w = result.t, s.imag
        right = 0.01 * np.exp(-60.0 * t) * (np.cos(w * t) + 60.0 / w * np.sin(w * t))
        wrong = np.mean(np.abs(result["load.position"] - right)) / 0.01
        # Euler is wrong: nearly no decay at its limit
        assert result.ok is bool(wrong < 0.05 and not grows)
        assert (
            grows
            or np.abs(result["load.position"]).max() == 0.01
            and not notices_of(result.warnings, "step-limit")
        )
        if grows and result.reason == "finished":
            assert np.abs(result["load.position"]).max() > 100.0
        if grows:
            assert before[0].limit == pytest.approx(limit, rel=2e-2) and before[0].place.startswith(
                "load."
            )


@pytest.mark.parametrize(
    "given, rate", [({"decay": 400.0}, 400.0), ({"diffusivity": 1e4}, 4e4 / 100.0)]
)
def test_diffusion_in_a_pipe_has_the_limit_of_the_real_axis(given, rate):
    """The limit of rk4 for decay at 400 1/s is 2.7853 / 400 s = 6.963 ms.

    The rate of the shortest wave under a diffusivity of 1e4 m2/s is equal.
    """
    nodes = {"lake": lake(50.0, scalars={"dye": 1.0}), "gate": junction(0.01)}
    links, limit = {"main": pipe("lake", "gate", 100.0, 0.1, 1000.0, 10)}, 2.785293563 / rate
    for factor, grows in ((0.99, False), (1.06, True)):
        case = scene(
            nodes,
            links,
            4.0,
            {"scheme": "upwind", "method": "rk4", "step": factor * limit},
            ["main.dye@0.5"],
            0.1,
        )
        case["scalars"] = {"dye": given}
        before = step_limits(model_of(case))
        assert [one.ok for one in before] == ([False] if grows else []) and fvsolve.run(
            case
        ).ok is not grows
        if grows:
            assert (
                before[0].limit == pytest.approx(limit, rel=1e-2) and before[0].place == "main.dye"
            )


def capillary(courant: float, scheme: str) -> dict:
    """Case of 10 m of pipe with 1 mm bore and viscous oil.

    Its laminar friction has the rate 32 nu / D^2 = 9600 1/s.
    """
    nodes = {"a": reservoir(step(0.01, 1e6, 2e6)), "b": reservoir(5e5)}
    rough = {"model": "quasi-steady", "roughness": 0.0}
    links = {"line": pipe("a", "b", 10.0, 1e-3, 1000.0, 10, friction=rough)}
    numerics = {"scheme": scheme, "method": "rk4", "courant": courant}
    return scene(
        nodes,
        links,
        2.0,
        numerics,
        ["line.flow"],
        0.02,
        fluid={**WATER, "viscosity": 0.3, "vapor_pressure": 0.0},
    )


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5"])
def test_friction_that_brakes_quicker_than_waves_cross_a_cell_is_foretold(scheme):
    """Friction with a rate above that of waves gives a notice with its own limit, within 10 % of growth in the run."""
    (one,) = step_limits(model_of(capillary(0.9, scheme)))
    assert (
        not one.ok
        and one.key == "courant"
        and one.place == "line"
        and one.limit < 2.785293563 / 9600.0
    )
    bears = 0.9 * one.limit / one.value
    for factor, grows in ((0.98, False), (1.1, True)):
        assert [x.ok for x in step_limits(model_of(capillary(factor * bears, scheme)))] == (
            [False] if grows else []
        )
        result = fvsolve.run(capillary(factor * bears, scheme))
        grown = bool(notices_of(result.warnings, "growth")) or "not finite" in result.reason
        assert result.ok is not grows and grown is grows


def test_friction_that_remembers_has_a_limit_of_its_own():
    """Relaxation terms of unsteady friction have a limit of their own, between 3.9 and 4.1 ms."""
    nodes, links = {"a": reservoir(step(0.01, 1e6, 2e6)), "b": reservoir(5e5)}, {}
    links["line"] = pipe(
        "a", "b", 100.0, 0.01, 1000.0, 10, friction={"model": "unsteady", "roughness": 0.0}
    )
    fluid = {**WATER, "viscosity": 0.03, "vapor_pressure": 0.0}
    found = []
    for h in (9e-3, 3.9e-3, 4.1e-3):
        case = scene(
            nodes,
            links,
            6.0,
            {"scheme": "upwind", "method": "rk4", "step": h},
            ["line.flow"],
            0.1,
            fluid=fluid,
        )
        before, result = step_limits(model_of(case)), fvsolve.run(case)
        found.append(
            (
                [(x.place, x.ok) for x in before],
                result.ok,
                bool(notices_of(result.warnings, "growth")),
            )
        )
    beyond = ([("line.memory", False)], False, True)
    assert found == [beyond, ([], True, False), beyond]


def test_diffusion_in_a_basin_has_the_limit_of_its_shortest_wave():
    """Diffusion in 8 x 8 cells of 1/8 m between walls has the greatest rate 4 D cos^2(pi / 16) (64 + 64) 1/s."""
    spreads, limit = 0.01, 2.785293563 / (4 * 0.01 * 128 * math.cos(math.pi / 16) ** 2)
    dye = "exp(-100*((x-0.3)^2+(y-0.5)^2))"
    pool = {
        "type": "basin",
        "physics": "transport",
        "size": [1.0, 1.0],
        "cells": [8, 8],
        "scalars": {"dye": dye},
    }
    pool["velocity"] = {"u": "0*x", "v": "0*y"}
    for factor, grows in ((0.99, False), (1.06, True)):
        h = factor * limit
        numerics = {"scheme": "upwind", "method": "rk4", "step": h}
        case = scene({"pool": pool}, {}, 2000 * h, numerics, ["pool.dye@0.3,0.5"], 20 * h)
        case["scalars"] = {"dye": {"diffusivity": spreads}}
        before, result = step_limits(model_of(case)), fvsolve.run(case)
        assert [one.ok for one in before] == ([False] if grows else []) and result.ok is not grows
        assert bool(notices_of(result.warnings, "growth")) is grows
        if grows:
            assert (
                before[0].limit == pytest.approx(limit, rel=1e-2) and before[0].place == "pool.dye"
            )


def vessel(end: float, first=1.0, second=1.0, pressure=None, volume=0.01, **numerics) -> dict:
    """Case of a chamber between two orifices of 20 mm."""
    nodes = {"high": reservoir(5e5), "c": chamber(volume, pressure), "low": reservoir(2e5)}
    links = {"in": hole("high", "c", 0.02, first), "out": hole("c", "low", 0.02, second)}
    return scene(nodes, links, end, numerics, ["c.pressure"], end / 100)


def chamber_on_main(end: float, **numerics) -> dict:
    """Case of a chamber of 1 l behind an orifice at the end of a main."""
    nodes = {"lake": lake(50.0), "t": junction(), "c": chamber(0.001), "low": reservoir(2e5)}
    links = {
        "main": pipe("lake", "t", 300.0, 0.1, 1000.0, 20),
        "in": hole("t", "c", 0.02),
        "out": hole("c", "low", 0.02, ramp(0.2 * end, 0.2 * end, 1.0, 0.5)),
    }
    return scene(nodes, links, end, {"scheme": "upwind", **numerics}, ["c.pressure"], end / 100)


SWINGS = {
    "moved at the start": lambda **n: vessel(2.0, pressure=5e5, **n),
    "narrowed slowly": lambda **n: vessel(2.0, second=ramp(0.5, 1.0, 1.0, 0.8), **n),
    "opened at once": lambda **n: vessel(2.0, first=step(1.0, 0.0, 1.0), **n),
    "behind a pipe": lambda **n: chamber_on_main(1.5, **n),
}


@pytest.mark.parametrize("how", SWINGS)
@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_a_vessel_that_swings_between_wrong_pressures_is_not_ok(how, method):
    """A chamber that oscillates by more than 100 bar at a long step fails the run.

    The square-root law of orifices bounds the amplitude, so the growth check does not stop the run.
    """
    result = fvsolve.run(SWINGS[how](method=method, step=7.5e-3))
    assert result.reason == "finished" and np.ptp(result["c.pressure"]) > 1e7 and not result.ok
    assert [one.ok for one in notices_of(result.warnings, "step-error")] == [False]
    (before,) = step_limits(model_of(SWINGS[how](method=method, step=7.5e-3)))
    assert not before.ok and before.place == "c.mass" and "or less" in before.text


@pytest.mark.parametrize("how", ["narrowed slowly", "opened at once"])
def test_at_a_stable_step_the_same_vessel_is_right_without_a_notice(how):
    result = fvsolve.run(SWINGS[how](method="rk4", step=2e-5))
    assert (
        result.ok
        and not notices_of(result.warnings, "step-error")
        and not notices_of(result.warnings, "step-limit")
    )
    right = fvsolve.run(SWINGS[how](**{k: v for k, v in EXACT.items() if k != "scheme"}))
    at = np.searchsorted(result.t, right.t[-1])
    assert result["c.pressure"][at] == pytest.approx(right["c.pressure"][-1], rel=1e-6)


def draining(method: str, parts: float) -> tuple:
    """Result of a tank that drains along 3 (1 - t / end)^2 m, and its mean error over its range."""
    end = math.sqrt(3.0) * 2.0 / (0.61 * math.pi / 4 * 0.05**2 * math.sqrt(9.80665 / 2.0))
    nodes = {"tank": tank(2.0, 3.0), "below": reservoir(AMBIENT)}
    numerics = {"method": method, "step": end / parts}
    result = fvsolve.run(
        scene(
            nodes, {"hole": hole("tank", "below", 0.05)}, end, numerics, ["tank.level"], end / 100
        )
    )
    return result, float(np.mean(np.abs(result["tank.level"] / 3.0 - (1.0 - result.t / end) ** 2)))


@pytest.mark.parametrize("parts, verdict", [(0.5, [False]), (2, [False]), (8, [True]), (60, [])])
def test_implicit_steps_that_are_too_long_are_reported_though_nothing_grows(parts, verdict):
    """Steps of implicit Euler that are too long for a draining tank give a notice and fail the run."""
    result, wrong = draining("implicit-euler", parts)
    assert (
        result.reason == "finished"
        and [one.ok for one in notices_of(result.warnings, "step-error")] == verdict
    )
    assert (
        result.ok is (False not in verdict)
        and (wrong > 0.1 or result.ok)
        and (wrong < 0.05 or not result.ok)
    )


@pytest.mark.parametrize("method", ["trapezoid", "radau-iia-3"])
def test_a_parabola_is_right_by_two_steps_of_second_order_without_a_notice(method):
    result, wrong = draining(method, 2)
    assert wrong < 1e-9 and result.ok and not notices_of(result.warnings, "step-error")


WASHED = [
    ("implicit-euler", 32.0, [False]),
    ("implicit-euler", 8.0, [False]),
    ("tr-bdf2", 32.0, [False]),
    ("tr-bdf2", 0.5, []),
]


@pytest.mark.parametrize("method, courant, verdict", WASHED)
def test_waves_damped_by_implicit_steps_are_reported(method, courant, verdict):
    """A frictionless wave of amplitude rho a u that long implicit steps damp gives a notice."""
    nodes = {"lake": lake(100.0), "end": junction(step(0.1, 0.05, 0.0))}
    links = {"main": pipe("lake", "end", 1000.0, 0.3, 1000.0, 50)}
    numerics = {"scheme": "muscl", "method": method, "courant": courant}
    result = fvsolve.run(scene(nodes, links, 8.1, numerics, ["end.pressure"], 0.05))
    swing, still = 1e6 * 0.05 / (math.pi / 4 * 0.3**2), result["end.pressure"][0]
    right = np.where(result.t < 0.1, 0.0, np.where((result.t - 0.1) % 4.0 < 2.0, swing, -swing))
    wrong = np.mean(np.abs(result["end.pressure"] - still - right)) / (2.0 * swing)
    notice = notices_of(result.warnings, "step-error")
    assert [one.ok for one in notice] == verdict and {one.place for one in notice} <= {
        "main.forward",
        "main.backward",
    }
    assert wrong < 0.03 if not verdict else wrong > 0.1
    assert result.ok is (False not in verdict) and all(one.key == "courant" for one in notice)


def test_waves_of_a_hundred_times_joukowskys_pressure_below_the_threshold_of_growth_are_reported():
    """Spurious waves of 120 MPa by weno5 with rodas-4 give a notice, although they stay below the growth check.

    The linearised scheme grows until its weights change.
    """
    nodes = {"lake": lake(100.0), "end": junction(step(0.1, 0.05, 0.0))}
    links = {
        "main": pipe(
            "lake",
            "end",
            1000.0,
            0.3,
            1000.0,
            50,
            friction={"model": "quasi-steady", "factor": 0.02},
        )
    }
    numerics = {"scheme": "weno5", "method": "rodas-4", "step": 0.6}
    result = fvsolve.run(scene(nodes, links, 8.1, numerics, ["end.pressure"], 0.05))
    (notice,) = notices_of(result.warnings, "step-error")
    assert (
        np.ptp(result["end.pressure"]) > 1e7
        and not result.ok
        and not notice.ok
        and notice.value > 1.0
    )


def test_a_constant_state_is_ok_with_a_notice_of_the_limit():
    result = fvsolve.run(vessel(1.0, method="euler", step=0.01))
    (one,) = notices_of(result.warnings, "step-limit")
    assert (
        result.ok
        and one.ok
        and "this run shows no growth" in one.text
        and np.ptp(result["c.pressure"]) < 1.0
    )


def test_chatter_about_a_drop_of_zero_that_is_too_small_to_matter_is_left_in_peace():
    """Two levels that become equal in finite time and then alternate by 1e-7 m under Euler steps give no notice."""
    nodes = {"one": tank(1.0, 3.0), "two": tank(1.0, 2.0)}
    result = fvsolve.run(
        scene(
            nodes,
            {"way": hole("one", "two", 0.03)},
            4000.0,
            {"method": "euler", "step": 1.0},
            ["one.level"],
            40.0,
        )
    )
    assert (
        result.ok
        and not notices_of(result.warnings, "step-error")
        and not notices_of(result.warnings, "step-limit")
    )
    assert result["one.level"][-1] == pytest.approx(2.5, abs=1e-5)


def test_two_bladders_and_a_column_are_reported_by_check_as_unstable_with_euler():
    nodes = {
        name: {
            "type": "accumulator",
            "volume": volume,
            "precharge": 4.877e5,
            "initial_pressure": pressure,
        }
        for name, volume, pressure in (("a", 0.00499, 1.2e6), ("b", 0.9755, 2.57e5))
    }
    way = {"type": "rigid-column", "from": "a", "to": "b", "length": 31.86, "diameter": 0.02}
    way["friction"] = {"model": "quasi-steady", "factor": 0.02}
    numerics = {"method": "euler", "step": 1.0, "initial": "rest"}
    (one,) = step_limits(model_of(scene(nodes, {"way": way}, 3.0, numerics, ["way.flow"], 0.1)))
    assert not one.ok and one.value == 1.0 and one.limit < 1e-3


def test_growth_that_a_run_is_too_short_to_show_is_no_growth():
    """An undamped oscillator grows by 1 + (h w)^2 / 2 per Euler step: a hundred steps at h w = 0.01 give no notice."""
    case = swinging(10.0, 1e5, 1e-9, 100 * 1e-4, method="euler", step=1e-4)
    assert not lumped_modes(model_of(case), "euler", 1e-4) and fvsolve.run(case).ok
    case["numerics"]["end"] = 1e6 * 1e-4
    (mode,) = lumped_modes(model_of(case), "euler", 1e-4)
    assert (
        math.log(mode.growth) == pytest.approx(1e6 * 0.01**2 / 2, rel=1e-2)
        and mode.outside_cells
        and mode.resolved
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("implicit", [False, True])
@pytest.mark.parametrize("seeds", [range(0, 12), range(12, 24), range(24, 36)])
def test_the_verdict_is_that_of_the_truth_in_scenes_at_random(seeds, implicit):
    """Random cases of chambers and tanks are ok if their error is below 0.01 of the range, and not ok above 0.1."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        case, spread = drawn(rng)
        if implicit:
            case["numerics"]["method"] = str(
                rng.choice(["implicit-euler", "trapezoid", "rodas-4", "tr-bdf2"])
            )
            case["numerics"]["step"] *= float(np.exp(rng.uniform(0.0, 4.0)))
        result, right = (
            fvsolve.run(case),
            fvsolve.run(case | {"numerics": {"end": case["numerics"]["end"], **EXACT}}),
        )
        wrong = 0.0
        for name, range_ in spread.items():
            found = np.interp(right.t, result.t, result[name])
            wrong = max(
                wrong,
                float(np.mean(np.abs(found - right[name]))) / max(range_, np.ptp(right[name])),
            )
        assert result.ok or wrong > 0.01, (seed, wrong, result.warnings)
        assert not result.ok or wrong < 0.1, (seed, wrong)


def drawn(rng) -> tuple[dict, dict[str, float]]:
    """Random case with a step near its limit, and the driving range of each probe [Pa] or [m]."""
    h, steps = float(np.exp(rng.uniform(np.log(1e-6), np.log(3e-3)))), 300
    late = {"start": 50 * h, "duration": 100 * h, "value": [1.0, 0.3]}
    numerics = {"method": str(rng.choice(["euler", "improved-euler", "ssp-rk3", "rk4"]))}
    if rng.random() < 0.3:
        h *= 1e4
        nodes = {
            "a": tank(float(rng.uniform(0.01, 0.3)), 4.0),
            "b": tank(float(rng.uniform(0.01, 0.3)), 2.0),
        }
        links, spread = {"way": hole("a", "b", 0.05)}, {"a.level": 2.0, "b.level": 2.0}
    else:
        names = ["a", "b", "c"][: rng.integers(1, 4)]
        nodes = {"high": reservoir(6e5), "low": reservoir(2 * AMBIENT)}
        nodes |= {name: chamber(float(np.exp(rng.uniform(-8.0, -3.0)))) for name in names}
        ends = ["high", *names, "low"]
        links = {
            f"{i}": hole(*pair, float(rng.uniform(0.004, 0.03)))
            for i, pair in enumerate(zip(ends[:-1], ends[1:], strict=True))
        }
        links[f"{len(names)}"]["opening"] = late
        spread = {f"{name}.pressure": 6e5 - 2 * AMBIENT for name in names}
    return scene(nodes, links, steps * h, numerics | {"step": h}, list(spread), 3 * h), spread


def test_a_resumed_run_retains_its_observations(tmp_path, monkeypatch):
    case = SWINGS["moved at the start"](method="rk4", step=2.0 / 20000, volume=0.002)
    unbroken = fvsolve.run(case)
    monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), "CHECKPOINT_SECONDS", 0.0)

    def enough(t, seconds, steps):
        if steps > 1000:  # after the first checkpoint
            raise KeyboardInterrupt

    assert fvsolve.run(case, out=tmp_path / "run", progress=enough).reason.startswith("interrupted")
    resumed = fvsolve.run(case, out=tmp_path / "run", resume=True)
    assert resumed.reason == "finished" and resumed.warnings == unbroken.warnings
    assert notices_of(resumed.warnings, "step-error")


# mass [kg] and stiffness [N/m] of an oscillator with 4 rad/s; end [s]
MASS, STIFF, END = 2.0, 32.0, 200.0


def with_pond(nodes, links, probes, method="ssp-rk2", **numerics):
    """Case of oscillating parts and a basin at rest, whose waves determine the step."""
    pond = {"type": "basin", "size": [4.0, 1.0], "cells": [16, 1], "level": 1.0}
    more = numerics or {"courant": 0.8}
    return scene(
        {**nodes, "pond": pond},
        links,
        END,
        {"scheme": "muscl", "method": method, **more},
        probes,
        0.1,
    )


def sprung(damping=0.0, **more):
    nodes = {
        "m": {"type": "mass", "mass": MASS, "initial_velocity": 0.1},
        "ground": {"type": "frame"},
    }
    links = {"s": {"type": "spring", "from": "ground", "to": "m", "stiffness": STIFF}}
    if damping:
        links["d"] = {"type": "damper", "from": "ground", "to": "m", "damping": damping}
    return with_pond(nodes, links, ["m.velocity", "m.position"], **more)


def grown(result) -> float:
    """Amplitude at the end over that at the start."""
    return (
        math.hypot(result["m.velocity"][-1], math.sqrt(STIFF / MASS) * result["m.position"][-1])
        / 0.1
    )


def swings_and_result(case):
    """Notices of oscillations, and result of the run."""
    result = fvsolve.run(case)
    return [one for one in result.warnings if one.kind == "swing"], result


def test_an_oscillation_amplified_by_ssp_rk2_is_reported_with_its_growth():
    """A notice states the growth of an oscillator under ssp-rk2, sqrt(1 + (w h)^4 / 4) per step."""
    (one,), result = swings_and_result(sprung())
    h = END / result.summary["steps"]
    wanted = (1.0 + (math.sqrt(STIFF / MASS) * h) ** 4 / 4.0) ** (0.5 * END / h)
    assert 1.05 < wanted < 1.2
    assert grown(result) == pytest.approx(wanted, rel=1e-4) and one.value == pytest.approx(
        wanted, rel=1e-3
    )
    assert (
        one.place in ("m.position", "m.velocity")
        and one.ok
        and "0.6366 Hz" in one.text
        and 'method = "ssp-rk3"' in one.text
    )


def test_the_recommended_step_helps():
    (one,), _ = swings_and_result(sprung())
    courant = float(one.text.partition("numerics.courant = ")[2].partition(",")[0])
    _, result = swings_and_result(sprung(courant=courant))
    assert grown(result) == pytest.approx(1.01, abs=1e-4)
    assert (
        not swings_and_result(sprung(method="ssp-rk3"))[0]
        and not swings_and_result(sprung(method="rk4"))[0]
    )


def test_damped_and_far_too_wrong_runs():
    assert not swings_and_result(sprung(damping=0.05))[0]
    (one,), _ = swings_and_result(sprung(method="euler", courant=0.05))
    assert not one.ok and one.value > 10.0


def test_an_oscillating_body_is_reported_also_by_check(tmp_path, fvs):
    from fvsolve.case.text import write

    case = with_pond({"arm": pendulum(0.1)}, {}, ["arm.angle"])
    (one,), result = swings_and_result(case)
    late = np.abs(result["arm.angle"][result.t > END - 4.0]).max() / 0.1
    assert one.place.startswith("arm.") and late == pytest.approx(one.value, rel=5e-3)
    (tmp_path / "arm.toml").write_text(write(case))
    code, printed, _ = fvs("check", tmp_path / "arm.toml")
    assert code == 0 and "an oscillation at 0.59" in printed
