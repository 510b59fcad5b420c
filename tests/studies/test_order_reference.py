"""References of errors: their accuracy, the estimate of it, and cases in which a reference is not accurate enough."""

import json

import numpy as np
import pytest
from pytest import approx
from reference import pulses, scenes
from reference.order_json import call

from fvsolve.case import load
from fvsolve.errors import FvsolveError
from fvsolve.studies import order
from fvsolve.studies.distance import cell_averages, end_probes, error_norms, recording_keys
from fvsolve.studies.outcome import outcome
from fvsolve.studies.reference import find_reference


@pytest.mark.parametrize("cells", [1, 3, 10, 20, 30, 60, 7, 13, 47])
def test_averages_over_other_cells_are_those_of_the_same_function(cells):
    def mean(edges):
        return -np.diff(np.cos(3.0 * edges)) / (3.0 * np.diff(edges))

    fine, coarse = mean(np.linspace(0.0, 1.0, 61)), mean(np.linspace(0.0, 1.0, cells + 1))
    found = cell_averages(fine, cells)
    assert found == approx(coarse, abs=1e-13 if 60 % cells == 0 else 1e-8)
    assert found.mean() == approx(fine.mean(), rel=1e-14)


def test_the_finer_run_and_the_exact_solution_find_the_same_errors():
    case = pulses.case(30, points=pulses.FEW)
    exact, finer = (order(case, schemes="upwind3", levels=3, against=one) for one in ("exact", "finer"))
    assert (exact.kind, finer.kind) == ("exact", "finer") and "upwind5" in finer.words
    for a, b in zip(exact.rows, finer.rows, strict=True):
        for variable in ("pressure", "flow", "gate.pressure", "main.pressure@0.37"):
            for norm in ("L1", "L2", "max"):
                assert a.errors[variable][norm] == approx(b.errors[variable][norm], rel=0.02)


@pytest.mark.parametrize(("case", "scheme"), [(pulses.case(20), "upwind3"), (pulses.front(40), "upwind")])
def test_the_error_that_a_reference_states_of_itself_is_about_its_true_one(case, scheme):
    case = load(case, {"numerics.scheme": scheme})
    keys = {"links.main.cells": 4 * case.links["main"].cells}
    made = find_reference(case, recording_keys(case, keys), opinions=1, exclude_own=True, exact=False)
    exact = find_reference(case, recording_keys(case, keys), opinions=1)
    [cells] = [int(word) for word in made.words.split() if word.isdigit()]
    keys = {"numerics.scheme": "upwind5", "numerics.method": "dormand-prince", "links.main.cells": cells}
    run = outcome(case, recording_keys(case, {**keys, "numerics.step": 0.5 * 100.0 / 1000.0 / cells}))
    true = error_norms(run, exact)
    for variable in ("pressure", "flow"):
        for norm in ("L1", "L2"):
            assert 0.3 < made.own_error[variable][norm] / true[variable][norm] < 6.0, (variable, norm)


def test_rows_that_the_reference_cannot_judge_are_marked_and_said():
    """Rows and reference have a front, which finer grids hardly sharpen: the last rows are as good as the reference."""
    found = order(pulses.front(), schemes="fromm", against="finer", levels=4)
    assert found.kind == "finer" and "reference" in found.fits["pressure"]["L1"].marks
    assert any("they are not reliable" in note and "[exact]" in note for note in found.notes)
    exact = order(pulses.front(), schemes="fromm", levels=4).fits["pressure"]["L1"]
    assert set(exact.marks) == {""} and exact.order == approx(2 / 3, abs=0.05)


def test_a_reference_that_is_no_better_than_the_runs_is_refused_with_a_way_out():
    """Upwind with Euler at Courant number 1 is exact, fronts included, so finer runs cannot judge it."""
    case = pulses.front(50, method="euler", courant=1.0)
    with pytest.raises(FvsolveError, match=r"not more accurate than the rows.*\[exact\].*richardson"):
        order(case, against="finer", levels=3)
    exact = order(case, levels=3)
    assert all(row.errors["pressure"]["max"] < 1e-4 for row in exact.rows)


def test_where_no_reference_will_do_each_row_is_judged_by_the_next():
    case = pulses.front(50, method="euler", courant=1.0)
    del case["exact"]
    found = order(case, levels=4)
    assert found.kind == "richardson" and "not more accurate than the rows" in found.notes[0]
    assert all(row.errors["pressure"]["max"] < 1e-4 for row in found.rows[:-1])


def test_richardson_finds_the_errors_and_the_order_without_a_reference():
    case = pulses.case(30, points=pulses.FEW)
    exact = order(case, schemes="upwind3", levels=5)
    found = order(case, schemes="upwind3", levels=5, against="richardson")
    assert found.kind == "richardson" and found.fits["pressure"]["L1"].order == approx(3.0, abs=0.1)
    for a, b in list(zip(exact.rows, found.rows, strict=True))[1:-1]:
        assert b.errors["pressure"]["L1"] == approx(a.errors["pressure"]["L1"], rel=0.1)
    assert found.rows[-1].errors == {} and found.fits["pressure"]["L1"].marks[-1] == "finest"


def test_refining_space_alone_shows_the_error_of_the_step_as_a_floor():
    case = pulses.case(20, courant=0.9)
    found = order(case, schemes="upwind5", methods="euler", refine="space", levels=5)
    assert len({row.level.step for row in found.rows}) == 1
    fit = found.fits["pressure"]["L1"]
    assert fit.reason or "floor" in fit.marks or fit.order < 2.0
    sharp = order(case, schemes="upwind3", methods="verner-7", refine="space", levels=4, cells=40)
    assert sharp.fits["pressure"]["L1"].order == approx(3.0, abs=0.15)


def test_the_exact_solution_judges_time_alone_only_if_asked_to():
    case = pulses.case(20, method="ssp-rk3", points=pulses.FEW)
    asked = order(case, refine="time", levels=4, against="exact")
    assert (asked.kind, order(case, refine="time", levels=2).kind) == ("exact", "finer")
    fit = asked.fits["pressure"]["L1"]
    assert fit.reason or "floor" in fit.marks  # the error of the grid


def test_a_tolerance_is_refined_where_a_case_steps_by_error():
    found = order("cases/two-tanks.toml")
    assert found.plan.measure == "rtol" and found.kind == "exact"
    fit = found.fits["high.level"]["L1"]
    assert fit.order == approx(1.0, abs=0.2)  # proportional to the tolerance
    assert [row.level.size for row in found.rows][:2] == approx([1e-4, 1e-5])


def test_a_lumped_case_shows_the_order_of_a_method_against_its_exact_solution():
    nodes = {"a": scenes.tank(2.0, 3.0), "b": scenes.tank(5.0, 2.5)}
    links = {"column": {"type": "rigid-column", "from": "a", "to": "b", "length": 30.0, "diameter": 0.3,
                        "friction": scenes.NO_FRICTION}}  # fmt: skip
    case = scenes.scene(nodes, links, 100.0, {"step": 2.0, "method": "rk4"}, ["a.level"], every=10.0,
                        exact={"name": "oscillation"})  # fmt: skip
    for method, p in (("euler", 1), ("ssp-rk2", 2), ("heun", 3), ("rk4", 4), ("trapezoid", 2), ("radau-iia-5", 5)):
        found = order(case, methods=method, refine="time", levels=7 if p < 2 else 5)
        fit = found.fits["a.level"]["L2"]
        assert found.kind == "exact" and abs(fit.order - p) <= max(fit.spread, 0.1) < 0.5, (method, fit)


def test_the_ends_of_nodes_and_links_are_compared_too():
    case = load("cases/tank-draining.toml", {"numerics.end": 600.0})
    assert end_probes(case) == ["nodes.tank.pressure", "nodes.tank.level", "links.hole.flow"]
    found = order(case, levels=3)
    assert {"nodes at the end: level", "nodes at the end: pressure", "links at the end: flow"} <= set(found.variables)
    last = found.rows[0].errors
    run = outcome(case, {"numerics.rtol": found.rows[0].level.size})
    area = 0.61 * np.pi / 4 * 0.05**2
    level = (np.sqrt(3.0) - area * np.sqrt(9.80665 / 2) / 2.0 * 600.0) ** 2
    assert last["nodes at the end: level"]["max"] == approx(abs(run.rows[-1, 1] - level), rel=1e-6, abs=1e-15)


def test_rows_that_are_finished_are_reused_and_give_the_same(capsys, tmp_path):
    words = ("gradual-closure", "--levels", "3", "--cells", "10", "--json", "--out", str(tmp_path))
    first, again = (json.loads(call(capsys, *words)[1]) for _ in range(2))
    assert (first["reused"], again["reused"]) == (0, 4) and first["studies"] == again["studies"]
    other = json.loads(call(capsys, *words, "--set", "numerics.courant=0.5")[1])
    assert other["reused"] == 0


def test_a_reference_that_fails_says_so():
    case = pulses.case(20, exact=False)
    case["numerics"]["end"] = 1e9
    case["numerics"]["below_vapor"], case["output"]["every"] = "stop", 1e6
    case["nodes"]["gate"] = scenes.junction(scenes.step(0.01, 0.0, 5.0))
    with pytest.raises(FvsolveError, match="reference run failed.*vapour"):
        order(case, levels=2, cells=4, against="finer")
    with pytest.raises(FvsolveError, match="no row could be run.*vapour"):  # nor with the next row as reference
        order(case, levels=2, cells=4)


LAWS = ("log", "table")


@pytest.mark.parametrize("law", LAWS)
def test_other_density_laws_are_compared_by_cell_averages_as_well(law):
    """A smooth pulse under a law without exact solution: a finer run shows the order."""
    case = pulses.case(20, exact=False, points=pulses.FEW)
    case["fluid"] = {"name": "Water", "law": law}
    found = order(case, schemes="upwind3", levels=3, cells=40)
    assert found.kind == "finer" and found.fits["flow"]["L1"].order == approx(3.0, abs=0.25)


@pytest.mark.parametrize(("cells", "levels"), [(24, 4), (28, 4), (20, 5)])
def test_richardson_gives_no_number_that_its_differences_cannot_show(cells, levels):
    """Upwind smears the pulse: orders of differences stay near 0.42 between coarse rows and approach 1 late."""
    exact, found = (order(pulses.case(cells, points=pulses.FEW), schemes="upwind", levels=levels, against=way)
                    for way in ("exact", "richardson"))  # fmt: skip
    for norm, fit in found.fits["pressure"].items():
        assert fit.reason or abs(fit.order - 1.0) <= fit.spread + 0.1, (norm, fit)
        shown = [row.errors["pressure"][norm] for row in found.rows[:-1]]
        true = [row.errors["pressure"][norm] for row in exact.rows[:-1]]
        told = any("nothing is extrapolated" in note and f"pressure ({norm}" in note for note in found.notes)
        assert told or shown == approx(true, rel=0.25) or norm != "L1"
    if cells == 24:
        assert "three differences" in found.fits["pressure"]["L1"].reason


def test_errors_by_richardson_are_the_true_ones_where_the_order_is_sure():
    case = pulses.case(160, points=pulses.FEW)
    exact, found = (order(case, schemes="upwind", levels=5, against=way) for way in ("exact", "richardson"))
    assert abs(found.fits["pressure"]["L1"].order - 1.0) <= found.fits["pressure"]["L1"].spread
    for a, b in zip(exact.rows[:-1], found.rows[:-1], strict=True):
        assert b.errors["pressure"]["L1"] == approx(a.errors["pressure"]["L1"], rel=0.15)


@pytest.mark.parametrize(("scheme", "method", "p"), [("upwind5", "rk4", 5), ("upwind3", "ssp-rk3", 3)])
def test_refining_space_alone_shows_the_order_of_the_scheme_by_default(scheme, method, p):
    """At the Courant number 0.9 of the case, the error of the step would hide the order."""
    found = order(pulses.case(20, courant=0.9), schemes=scheme, methods=method, refine="space", levels=4, cells=30)
    assert len({row.level.step for row in found.rows}) == 1
    assert f"Courant number {0.19 if p == 5 else 0.22}" in found.plan.words
    assert found.fits["pressure"]["L1"].order == approx(p, abs=0.3)


def test_where_the_step_hides_the_order_of_the_cells_a_smaller_one_is_named():
    case = pulses.case(20, courant=0.9)
    found = order(case, schemes="upwind5", methods="euler", refine="space", levels=4, cells=30)
    assert any("--set numerics.courant=0.005" in note for note in found.notes), found.notes
