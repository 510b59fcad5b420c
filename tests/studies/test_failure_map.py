"""Verdicts of a failure map, on synthetic runs of each kind and on real runs of known kind."""

import csv
import json
import math
import shutil
import sys

import numpy as np
import pytest
from reference.scenes import (
    AMBIENT,
    NO_FRICTION,
    area,
    chamber,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    step,
    tank,
    valve,
)

from fvsolve.case import load
from fvsolve.case.text import write
from fvsolve.compile.cache_folders import PACKAGE, source_hash
from fvsolve.errors import FvsolveError
from fvsolve.studies import result_cache
from fvsolve.studies.failure_map import (
    BLOWN_RANGES,
    WINDOW_STEPS,
    Measures,
    excess_variation,
    failure_map,
    probe_ranges,
    ringing_amplitude,
    run_recorded,
    turn_interval,
    verdict,
)
from fvsolve.studies.result_cache import ResultCache, package_hash

TOLERANCE = 0.02


def never() -> Measures:
    raise AssertionError("nothing shorter is asked for")


def shorter(*errors: float):
    left = list(errors)
    return lambda: Measures("finished", True, error=left.pop(0), farthest=1.0)


def measures_of(error=0.001, farthest=0.1, **more) -> Measures:
    return Measures("finished", True, error=error, farthest=farthest, **more)


# synthetic runs ----------------------------------------------------------------------------------------------------


def test_a_small_error_and_no_swing_is_stable():
    assert verdict(measures_of(), never, TOLERANCE) == "stable"


def test_an_error_that_a_shorter_step_reduces_is_coarse_and_a_constant_error_is_wrong():
    assert verdict(measures_of(0.1), shorter(0.05), TOLERANCE) == "coarse"
    assert verdict(measures_of(0.1), shorter(0.09, 0.03), TOLERANCE) == "coarse"
    # an error within the tolerance suffices
    assert verdict(measures_of(0.021), shorter(0.0199), TOLERANCE) == "coarse"
    assert verdict(measures_of(0.1), shorter(0.099, 0.099), TOLERANCE) == "wrong"
    assert verdict(measures_of(0.1), shorter(math.nan, math.nan), TOLERANCE) == "wrong"


def test_values_that_are_not_finite_or_far_away_have_blown_up():
    stopped = Measures("stopped: a value is not finite at main.r[3] at t = 1 s; ...", False)
    assert verdict(stopped, never, TOLERANCE) == "blown up"
    assert verdict(measures_of(farthest=1.01 * BLOWN_RANGES), never, TOLERANCE) == "blown up"
    assert verdict(measures_of(farthest=math.nan), never, TOLERANCE) == "blown up"


def test_a_refused_case_and_a_run_stopped_by_name_are_refused():
    assert (
        verdict(Measures("refused: no such thing", False, refused=True), never, TOLERANCE)
        == "refused"
    )
    assert (
        verdict(Measures("stopped: Newton did not converge at ...", False), never, TOLERANCE)
        == "refused"
    )


def test_swings_are_ringing_whatever_the_error():
    for error in (0.001, 0.5):
        assert verdict(measures_of(error, ringing=1.01 * TOLERANCE), never, TOLERANCE) == "ringing"
        assert verdict(measures_of(error, variation=0.3), never, TOLERANCE) == "ringing"


@pytest.mark.parametrize("factor", [-0.99, -0.9, -0.5])
def test_the_amplitude_of_ringing_is_that_after_eight_changes(factor):
    n = np.arange(40)
    swings = 0.3 * factor**n
    amplitude = ringing_amplitude([swings[:, None]], np.ones(1))
    assert amplitude == pytest.approx(0.5 * 0.3 * (1 - factor) * abs(factor) ** 7)


def test_a_growing_oscillation_also_on_a_slope_rings_and_waves_noise_free_steps_and_short_oscillations_do_not():
    n = np.arange(60.0)
    assert ringing_amplitude([(-1.05) ** n[:, None]], np.ones(1)) > 1.0
    assert ringing_amplitude([(0.02 * n + 0.1 * (-1) ** n)[:, None]], np.ones(1)) == pytest.approx(
        0.09
    )
    for smooth in (np.sin(0.8 * n), np.minimum(n, 30.0), (n > 30).astype(float), np.sin(2.0 * n)):
        assert ringing_amplitude([smooth[:, None]], np.ones(1)) == 0.0
    assert ringing_amplitude([np.where(n < 7, (-1.0) ** n, 0.0)[:, None]], np.ones(1)) == 0.0
    assert ringing_amplitude([np.ones((WINDOW_STEPS - 2, 1))], np.ones(1)) == 0.0


def test_excess_counts_oscillation_beyond_the_reference_and_nothing_else():
    t = np.linspace(0, 1, 101)[:, None]
    square = np.floor(4 * t) % 2
    assert excess_variation(square, square, np.ones(1)) == 0.0
    # smaller variation is no ringing
    assert excess_variation(0.5 * square, square, np.ones(1)) == 0.0
    assert (
        excess_variation(square + 5.0 * (np.arange(101) == 40)[:, None], square, np.ones(1)) == 0.0
    )  # a single row is no ringing
    assert (
        excess_variation(square + 0.1 * (-1.0) ** np.arange(101)[:, None], square, np.ones(1)) > 4.0
    )


def test_a_probe_that_stands_still_is_not_judged():
    rows = np.array([[1.0, 5.0], [3.0, 5.0], [2.0, 5.0]])
    assert list(probe_ranges(rows)) == [2.0, math.inf]


# real runs ---------------------------------------------------------------------------------------------------------


def closing(**numerics) -> dict:
    """Case of a frictionless pipe whose valve shuts within a tenth of 2 L / a."""
    nodes = {"lake": lake(60.0), "gate": junction(), "out": reservoir(AMBIENT)}
    links = {
        "main": pipe("lake", "gate", 600.0, 0.3, 1200.0, 60),
        "valve": valve("gate", "out", 0.002, {"start": 0.1, "duration": 0.1, "value": [1.0, 0.0]}),
    }
    settings = {"scheme": "upwind5", "method": "rk4", "courant": 0.8, **numerics}
    return scene(nodes, links, 3.0, settings, ["gate.pressure", "main.pressure@0.5"], 0.01)


def verdicts(case: dict, **asked) -> dict[str, list[str]]:
    (scheme,) = asked["schemes"]
    made = failure_map(load(case), **asked)
    return {method: [one.verdict for one in made.row(scheme, method)] for method in made.methods}


def test_a_map_of_upwind_shows_the_exact_square_the_smeared_ones_and_the_limit():
    said = verdicts(
        closing(), schemes=["upwind"], methods=["euler"], courants=[0.25, 0.5, 1.0, 1.1, 2.0]
    )
    assert said["euler"] == ["wrong", "wrong", "stable", "blown up", "blown up"]


def test_a_map_goes_by_the_exact_solution_of_a_case_and_without_it_knows_how_far_off_it_may_be():
    case = closing()
    case["links"]["valve"]["opening"] = step(0.1, 1.0, 0.0)  # all finer runs smear this front alike
    asked = {"schemes": ["upwind5"], "methods": ["rk4"], "courants": [0.5], "tolerance": 0.1}
    measured, exact = (
        failure_map(load(case | more), **asked) for more in ({}, {"exact": {"name": "rays"}})
    )
    assert (
        exact.reference.startswith('exact solution "rays", checked by ')
        and "exact" not in measured.reference
    )
    apart = abs(measured.squares[0].measures.error - exact.squares[0].measures.error)
    assert 0.0 < apart <= measured.doubt


def test_a_linear_fifth_order_scheme_is_stable_to_its_limit_and_implicit_euler_is_coarse():
    methods = ["rk4", "implicit-euler", "radau-iia-5"]
    made = failure_map(load(closing()), ["upwind5"], methods, courants=[0.5, 1.0, 2.5])
    said = {method: [one.verdict for one in made.row("upwind5", method)] for method in methods}
    assert said["rk4"] == ["stable", "stable", "blown up"]
    assert said["implicit-euler"] == ["coarse"] * 3 and said["radau-iia-5"] == ["stable"] * 3
    limit = made.row("upwind5", "rk4")[0].limit * made.wave_rate
    assert 1.0 < limit < 2.5
    assert math.isinf(made.row("upwind5", "radau-iia-5")[0].limit)


def test_central_differences_swing_behind_a_front():
    assert verdicts(closing(), schemes=["central"], methods=["rk4"], courants=[0.5])["rk4"] == [
        "ringing"
    ]


def stiff() -> dict:
    """Case of oil pressed into a small chamber through a pipe; the chamber responds within microseconds."""
    nodes = {"pump": reservoir(2.0e6), "body": chamber(1e-6), "sump": reservoir(AMBIENT)}
    opening = step(0.01, 1.0, 0.3)
    links = {
        "line": pipe("pump", "body", 50.0, 0.03, 1250.0, 20, friction=NO_FRICTION),
        "pilot": valve("body", "sump", 1.2e-5, opening),
    }
    numerics = {"scheme": "upwind", "method": "rk4", "courant": 0.8}
    return scene(nodes, links, 0.1, numerics, ["body.pressure"], 0.001)


def test_the_trapezoidal_rule_rings_after_a_stiff_step_and_an_l_stable_method_does_not():
    asked = {"schemes": ["muscl"], "methods": ["trapezoid", "radau-iia-5"], "steps": [5e-4]}
    case = stiff()
    made = failure_map(load(case), tolerance=0.05, **asked)
    trapezoid, radau = made.squares
    assert (trapezoid.verdict, radau.verdict) == ("ringing", "stable")
    assert trapezoid.measures.ringing > 0.1 and radau.measures.ringing < 1e-6


def test_a_key_of_the_case_may_be_the_columns_and_predicts_where_the_step_is_too_long():
    volumes = [1e-6, 1e-4, 1e-2]
    made = failure_map(
        load(stiff()),
        ["upwind"],
        ["euler"],
        steps=[1e-3],
        key=("nodes.body.volume", volumes),
        tolerance=0.2,
    )
    blown = [one.verdict == "blown up" for one in made.squares]
    assert blown == [one.step > one.limit for one in made.squares] and any(blown) and not all(blown)


def test_a_method_that_cannot_go_by_the_case_is_refused_with_its_reason():
    case = closing()
    case["numerics"] = {"end": 3.0, "scheme": "upwind5", "method": "dormand-prince", "rtol": 1e-4}
    made = failure_map(load(case), ["upwind5"], ["euler"], key=("links.main.diameter", [0.3]))
    assert (
        made.squares[0].verdict == "refused"
        and "estimates no error" in made.squares[0].measures.reason
    )


def test_finished_squares_are_stored_and_reused(tmp_path):
    asked = {"schemes": ["upwind"], "methods": ["euler"], "courants": [0.5, 1.0]}
    first = failure_map(load(closing()), out=tmp_path, **asked)
    again = ResultCache(tmp_path)
    assert failure_map(load(closing()), out=again, **asked) == first
    assert again.reused == len((tmp_path / "points.jsonl").read_text().splitlines()) > 2


def test_points_of_other_sources_are_not_taken_up(tmp_path, monkeypatch):
    """Sources of studies count too, although they compile nothing."""
    source_hash()  # hash of the tested sources
    made, package = (
        [],
        shutil.copytree(PACKAGE, tmp_path / "fvsolve", ignore=shutil.ignore_patterns("*.pyc")),
    )
    study = package / "studies" / "stability" / "stability.py"
    for words in ("", "", "# another"):
        study.write_text(study.read_text(encoding="utf-8") + words, encoding="utf-8")
        monkeypatch.setattr(result_cache, "PACKAGE", package)
        package_hash.cache_clear()
        with ResultCache(tmp_path) as points:
            points.get(load(closing()), {}, lambda said=words: made.append(said) or {"value": 1.0})
    package_hash.cache_clear()
    assert made == ["", "# another"]


def test_a_watched_run_steps_as_any_run_does():
    from fvsolve.studies.outcome import outcome

    case = closing()
    seen, bursts = run_recorded(case)
    plain = outcome(case)
    assert np.array_equal(seen.rows, plain.rows) and np.array_equal(seen.y, plain.y)
    assert sum(map(len, bursts)) > 100


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"schemes": ["upwnd"]}, 'did you mean "upwind"'),
        ({"methods": ["rk5"]}, 'no method named "rk5"'),
        ({"courants": [0.5], "steps": [0.1]}, "keep one"),
        ({"courants": [-1.0]}, "positive"),
        ({"courants": [0.5, 1.0], "key": ("links.main.diameter", [0.3])}, "columns"),
        ({"tolerance": 1e-6, "methods": ["rk4"]}, "the reference is not accurate enough"),
        ({"tolerance": -1.0}, "positive"),
        ({"key": ("numerics.step", [0.1])}, "the map sets it"),
    ],
)
def test_impossible_requests_are_refused(asked, said):
    with pytest.raises(FvsolveError, match=said):
        failure_map(load(closing()), **asked)


def test_the_command_writes_table_and_pictures_and_speaks_json(tmp_path, fvs):
    path = tmp_path / "scene.toml"
    path.write_text(write(closing()))
    asked = ("--scheme", "upwind", "--method", "euler,rk4", "--step", "8 ms,0.02")
    code, out, _ = fvs("failure-map", path, *asked, "--out", tmp_path / "out", "--json")
    assert code == 0
    said = json.loads(out)
    assert (
        said["values"] == [0.008, 0.02]
        and [one["method"] for one in said["squares"]] == ["euler"] * 2 + ["rk4"] * 2
    )
    assert all(one["courant"] == pytest.approx(120 * one["step"]) for one in said["squares"])
    with open(tmp_path / "out" / "map.csv") as file:
        assert [row["verdict"] for row in csv.DictReader(file)] == [
            one["verdict"] for one in said["squares"]
        ]
    assert (tmp_path / "out" / "map.png").stat().st_size > 10_000 and (
        tmp_path / "out" / "map.svg"
    ).is_file()


def test_no_old_picture_stays_with_a_new_table(tmp_path, fvs, monkeypatch):
    """Pictures of an earlier map are deleted, even if the new picture cannot be drawn."""
    path, out = tmp_path / "scene.toml", tmp_path / "out"
    path.write_text(write(closing()))
    asked = (
        "failure-map",
        str(path),
        "--scheme",
        "upwind",
        "--method",
        "euler",
        "--step",
        "8 ms",
        "--out",
        str(out),
    )
    assert fvs(*asked)[0] == 0 and (out / "map.png").is_file() and (out / "map.svg").is_file()
    monkeypatch.setitem(sys.modules, "matplotlib.patches", None)
    assert fvs(*asked)[0] != 0
    assert [one.name for one in sorted(out.iterdir())] == ["map.csv", "points.jsonl"]


def test_a_swing_of_the_scene_that_euler_amplifies_is_no_ringing():
    """A column between two tanks oscillates at omega; Euler multiplies it by sqrt(1 + (omega h)^2) in each step."""
    omega = math.sqrt(2 * 9.80665 * area(0.5) / (50.0 * 1.0))
    nodes = {"a": tank(1.0, 5.0), "b": tank(1.0, 4.0)}
    column = {"type": "rigid-column", "from": "a", "to": "b", "length": 50.0, "diameter": 0.5}
    end = 6 * 2 * math.pi / omega
    grown = 2.0  # growth over the run: end omega^2 h / 2 = log 2
    long = 2 * math.log(grown) / (omega**2 * end)
    case = scene(nodes, {"c": column}, end, {"method": "rk4", "step": long}, ["a.level"], end / 200)
    (euler,) = failure_map(case, methods=["euler"], steps=[long]).squares
    assert (
        euler.measures.error > TOLERANCE
        and euler.verdict == "coarse"
        and euler.measures.variation == 0.0
    )


def test_the_pace_of_swings_is_the_rows_of_half_a_period():
    n = np.arange(400.0)
    assert turn_interval(np.sin(2 * np.pi * n / 40), 0.02) == 20.0
    assert turn_interval(np.exp(-n / 60) * np.sin(2 * np.pi * n / 40), 1e-3) == pytest.approx(
        20.0, abs=1.0
    )
    assert turn_interval(n / 400, 1e-3) == turn_interval(np.minimum(n, 100.0), 1e-3) == math.inf
    assert turn_interval(n / 400 + 1e-4 * (-1.0) ** n, 1e-3) == math.inf
