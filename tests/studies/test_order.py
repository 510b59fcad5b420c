"""Manufactured solutions: start, source and exact solution as functions of x and t, and values inside pipes."""

import json
import math

import numpy as np
import pytest
from pytest import approx
from reference import pulses, scenes

from fvsolve.case import load
from fvsolve.core.output.summary_file import plain
from fvsolve.errors import FvsolveError
from fvsolve.studies import fit, order
from fvsolve.studies.distance import cell_averages, end_probes, error_norms, recording_keys
from fvsolve.studies.outcome import outcome
from fvsolve.studies.reference import find_reference
from fvsolve.studies.result_cache import ResultCache

LENGTH, SPEED, DIAMETER = 100.0, 1000.0, 0.5
AREA, K, W = scenes.area(DIAMETER), 1.5 * np.pi / LENGTH, 300.0


def case(cells: int = 20, friction=scenes.NO_FRICTION, **numerics) -> dict:
    """Case of a pipe between a reservoir and a dead end."""
    nodes = {"lake": scenes.reservoir(3e5), "end": scenes.junction()}
    links = {"main": scenes.pipe("lake", "end", LENGTH, DIAMETER, SPEED, cells, friction=friction)}
    given = {"scheme": "upwind5", "method": "verner-7", "courant": 0.5, **numerics}
    probes = ["end.pressure", "main.pressure@0.37", "main.flow@0.61", "main.flow@0"]
    return scenes.scene(nodes, links, 0.15, given, probes, every=0.01)


def free(pipe, x, t):
    """Pressure and flow of a standing wave without source."""
    swing = 1e5 * AREA / (scenes.RHO * SPEED)
    return 3e5 + 1e5 * np.sin(K * x) * np.cos(K * SPEED * t), -swing * np.cos(K * x) * np.sin(
        K * SPEED * t
    )


def driven(pipe, x, t):
    """Pressure and flow of waves that need a source."""
    return 3e5 + 1e5 * np.sin(K * x) * np.cos(W * t), 0.3 * np.cos(K * x) * np.sin(2 * W * t)


def drive(pipe, x, t):
    """Source of `driven`: p_t A / a^2 + rho q_x, and rho q_t + A p_x."""
    p_t, p_x = -W * 1e5 * np.sin(K * x) * np.sin(W * t), K * 1e5 * np.cos(K * x) * np.cos(W * t)
    q_t, q_x = (
        0.6 * W * np.cos(K * x) * np.cos(2 * W * t),
        -0.3 * K * np.sin(K * x) * np.sin(2 * W * t),
    )
    return AREA / SPEED**2 * p_t + scenes.RHO * q_x, scenes.RHO * q_t + AREA * p_x


@pytest.mark.parametrize(
    ("scheme", "p"), [("upwind", 1), ("fromm", 2), ("upwind3", 3), ("upwind5", 5)]
)
def test_a_standing_wave_shows_the_order_of_the_scheme(scheme, p):
    cells = {1: 80, 5: 15}.get(p, 40)
    found = order(case(cells), schemes=scheme, exact=free, levels=5)
    assert found.kind == "function"
    fit = found.fits["pressure"]["L2"]
    assert fit.order == approx(p, abs=0.15), fit


@pytest.mark.parametrize(("scheme", "p"), [("upwind3", 3), ("upwind5", 5)])
@pytest.mark.parametrize(
    "probe", ["main.pressure@0.37", "main.flow@0.61", "end.pressure", "main.flow@0"]
)
def test_reading_at_a_point_does_not_cap_the_order(scheme, p, probe):
    """0.37 is at another place of its cell at each level."""
    found = order(case(20), schemes=scheme, exact=free, levels=4)
    fit = found.fits[probe]["L2"]
    assert fit.order > p - 0.2, fit
    slow = [e.errors[probe]["L2"] for e in found.rows]
    assert slow[0] / slow[-1] > 2.0 ** (3 * (p - 0.3))


@pytest.mark.parametrize(("scheme", "p"), [("upwind3", 3), ("upwind5", 5)])
def test_a_source_is_fed_in_at_the_order_of_the_scheme(scheme, p):
    """Maximum norm: the error is largest at the ends, and inside it falls by one order more at first."""
    found = order(case(30), schemes=scheme, exact=driven, source=drive, levels=4)
    assert found.fits["pressure"]["max"].order == approx(p, abs=0.25)
    slow = [row.errors["flow"]["max"] for row in found.rows]
    assert slow[0] / slow[-1] > 2.0 ** (3 * (p - 0.2))


def test_friction_is_averaged_to_fourth_order_where_the_flow_retains_its_direction():
    """The flow between two reservoirs does not reverse; where it does, |q| q has a kink and the order is three."""
    factor, loss, k = 0.5, 0.5 * scenes.RHO / (2 * DIAMETER * AREA), 2 * np.pi / LENGTH

    def exact(pipe, x, t):
        return 3e5 + 1e5 * np.sin(k * x) * np.cos(W * t), 0.6 + 0.3 * np.cos(k * x) * np.cos(
            2 * W * t
        )

    def source(pipe, x, t):
        p_t, p_x = -W * 1e5 * np.sin(k * x) * np.sin(W * t), k * 1e5 * np.cos(k * x) * np.cos(W * t)
        q_t, q_x = (
            -0.6 * W * np.cos(k * x) * np.sin(2 * W * t),
            -0.3 * k * np.sin(k * x) * np.cos(2 * W * t),
        )
        q = exact(pipe, x, t)[1]
        return AREA / SPEED**2 * p_t + scenes.RHO * q_x, scenes.RHO * q_t + AREA * p_x + loss * q**2

    between = case(20, {"model": "steady", "factor": factor})
    between["nodes"]["end"] = scenes.reservoir(3e5)
    found = order(between, exact=exact, source=source, levels=4)
    for variable in ("pressure", "flow"):
        errors = [row.errors[variable]["L2"] for row in found.rows]
        assert errors[0] / errors[-1] > 2.0 ** (3 * 3.8), errors


def test_a_wrong_exact_solution_is_detected():
    wrong = lambda pipe, x, t: (free(pipe, x, 1.001 * t)[0], free(pipe, x, t)[1])  # noqa: E731
    found = order(case(20), exact=wrong, levels=4)
    assert found.fits["pressure"]["L2"].reason and not found.fits["flow"]["L2"].reason


def test_a_start_alone_is_judged_by_a_finer_run():
    found = order(case(20), schemes="upwind3", initial=lambda pipe, x: free(pipe, x, 0.0), levels=4)
    assert found.kind == "finer" and found.fits["pressure"]["L1"].order == approx(3.0, abs=0.2)


def test_time_alone_is_judged_on_the_grid_unless_the_exact_solution_is_requested():
    grid = order(case(10), methods="ssp-rk3", exact=driven, source=drive, refine="time", levels=4)
    assert grid.kind == "finer" and grid.fits["pressure"]["L2"].order == approx(3.0, abs=0.1)
    asked = order(
        case(10), methods="ssp-rk3", exact=free, refine="time", levels=4, reference="exact"
    )
    # the error of the grid
    assert asked.kind == "function" and asked.rows[-1].errors["pressure"]["L2"] > 1.0
    with pytest.raises(FvsolveError, match="needs the function"):
        order(case(20), initial=lambda pipe, x: free(pipe, x, 0.0), reference="exact")


def test_functions_want_pipes_and_the_linear_law():
    with pytest.raises(FvsolveError, match="has no pipes"):
        order("cases/two-tanks.toml", exact=free)
    with pytest.raises(FvsolveError, match='need the law "linear"'):
        order({**case(), "fluid": {"name": "Water", "law": "log"}}, exact=free)


def raises(pipe, x, t):
    raise ZeroDivisionError("no mass at noon")


@pytest.mark.parametrize("numerics", [{}, {"courant": None, "rtol": 1e-6}], ids=["courant", "rtol"])
def test_exceptions_of_a_source_are_the_stated_cause(numerics):
    given = {
        key: value for key, value in case(10, **numerics)["numerics"].items() if value is not None
    }
    with pytest.raises(
        FvsolveError, match=r'source.*"main" raised ZeroDivisionError: no mass at noon'
    ) as error:
        order({**case(10), "numerics": given}, exact=driven, source=raises, levels=3)
    assert isinstance(error.value.__cause__, ZeroDivisionError)


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "wrong",
    [lambda *_: None, lambda *_: 1.0, lambda *_: (1.0, 2.0, 3.0), lambda *_: (np.zeros(3), 0.0), lambda *_: "ab"],
    ids=["nothing", "one", "three", "another shape", "text"],
)  # fmt: skip
@pytest.mark.parametrize("name", ["initial", "source", "exact"])
def test_wrong_results_of_a_function_are_named(name, wrong):
    given = {"exact": driven, "source": drive, name: wrong}
    with pytest.raises(
        FvsolveError, match=rf'{name}\(pipe, x.*"main" must return two numbers or arrays of'
    ):
        order(case(10), levels=3, **given)


@pytest.mark.parametrize("name", ["initial", "source", "exact"])
def test_places_where_a_function_is_not_finite_are_stated(name):
    given = {
        "exact": driven,
        "source": drive,
        name: lambda pipe, x, *t: (np.where(x > 55.0, np.nan, 3e5), 0.0),
    }
    with pytest.raises(
        FvsolveError,
        match=rf'{name}\(pipe, x.*"main" returns values that are not finite, first at x = 5',
    ):
        order(case(10), levels=3, **given)


def test_a_source_that_is_two_numbers_is_spread_along_the_pipe():
    found = order(
        case(10), initial=lambda pipe, x: (3e5, 0.0), source=lambda *_: (0.0, 0.0), levels=3
    )
    assert all(not row.reason for row in found.rows)


# ----------------------------------------------------------------------------------------------------------------------
# References of errors: their accuracy, the estimate of it, and cases in which a reference is not accurate enough.


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
    exact, finer = (
        order(case, schemes="upwind3", levels=3, reference=one) for one in ("exact", "finer")
    )
    assert (exact.kind, finer.kind) == ("exact", "finer") and "upwind5" in finer.words
    for a, b in zip(exact.rows, finer.rows, strict=True):
        for variable in ("pressure", "flow", "gate.pressure", "main.pressure@0.37"):
            for norm in ("L1", "L2", "max"):
                assert a.errors[variable][norm] == approx(b.errors[variable][norm], rel=0.02)


@pytest.mark.parametrize(
    ("case", "scheme"), [(pulses.case(20), "upwind3"), (pulses.front(40), "upwind")]
)
def test_the_stated_error_of_a_reference_is_about_its_true_error(case, scheme):
    case = load(case, {"numerics.scheme": scheme})
    keys = {"links.main.cells": 4 * case.links["main"].cells}
    made = find_reference(
        case, recording_keys(case, keys), opinions=1, exclude_own=True, exact=False
    )
    exact = find_reference(case, recording_keys(case, keys), opinions=1)
    [cells] = [int(word) for word in made.words.split() if word.isdigit()]
    keys = {
        "numerics.scheme": "upwind5",
        "numerics.method": "dormand-prince",
        "links.main.cells": cells,
    }
    run = outcome(
        case, recording_keys(case, {**keys, "numerics.step": 0.5 * 100.0 / 1000.0 / cells})
    )
    true = error_norms(run, exact)
    for variable in ("pressure", "flow"):
        for norm in ("L1", "L2"):
            assert 0.3 < made.own_error[variable][norm] / true[variable][norm] < 6.0, (
                variable,
                norm,
            )


def test_rows_that_the_reference_cannot_judge_are_marked_and_reported():
    """Rows and reference have a front, which finer grids hardly sharpen: the last rows are as good as the reference."""
    found = order(pulses.front(), schemes="fromm", reference="finer", levels=4)
    assert found.kind == "finer" and "reference" in found.fits["pressure"]["L1"].marks
    assert any("they are not reliable" in note and "[exact]" in note for note in found.notes)
    exact = order(pulses.front(), schemes="fromm", levels=4).fits["pressure"]["L1"]
    assert set(exact.marks) == {""} and exact.order == approx(2 / 3, abs=0.05)


def test_a_reference_that_is_no_better_than_the_runs_is_refused_with_a_way_out():
    """Upwind with Euler at Courant number 1 is exact, fronts included, so finer runs cannot judge it."""
    case = pulses.front(50, method="euler", courant=1.0)
    with pytest.raises(
        FvsolveError, match=r"not more accurate than the rows.*\[exact\].*richardson"
    ):
        order(case, reference="finer", levels=3)
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
    found = order(case, schemes="upwind3", levels=5, reference="richardson")
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


def test_the_exact_solution_judges_time_alone_only_on_request():
    case = pulses.case(20, method="ssp-rk3", points=pulses.FEW)
    asked = order(case, refine="time", levels=4, reference="exact")
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
    links = {
        "column": {
            "type": "rigid-column",
            "from": "a",
            "to": "b",
            "length": 30.0,
            "diameter": 0.3,
            "friction": scenes.NO_FRICTION,
        }
    }
    case = scenes.scene(
        nodes,
        links,
        100.0,
        {"step": 2.0, "method": "rk4"},
        ["a.level"],
        every=10.0,
        exact={"name": "oscillation"},
    )
    for method, p in (
        ("euler", 1),
        ("ssp-rk2", 2),
        ("heun", 3),
        ("rk4", 4),
        ("trapezoid", 2),
        ("radau-iia-5", 5),
    ):
        found = order(case, methods=method, refine="time", levels=7 if p < 2 else 5)
        fit = found.fits["a.level"]["L2"]
        assert found.kind == "exact" and abs(fit.order - p) <= max(fit.spread, 0.1) < 0.5, (
            method,
            fit,
        )


def test_the_ends_of_nodes_and_links_are_compared_too():
    case = load("cases/tank-draining.toml", {"numerics.end": 600.0})
    assert end_probes(case) == ["nodes.tank.pressure", "nodes.tank.level", "links.hole.flow"]
    found = order(case, levels=3)
    assert {
        "nodes at the end: level",
        "nodes at the end: pressure",
        "links at the end: flow",
    } <= set(found.variables)
    last = found.rows[0].errors
    run = outcome(case, {"numerics.rtol": found.rows[0].level.size})
    area = 0.61 * np.pi / 4 * 0.05**2
    level = (np.sqrt(3.0) - area * np.sqrt(9.80665 / 2) / 2.0 * 600.0) ** 2
    assert last["nodes at the end: level"]["max"] == approx(
        abs(run.rows[-1, 1] - level), rel=1e-6, abs=1e-15
    )


def test_rows_that_are_finished_are_reused_and_give_the_same(tmp_path):
    def study(**keys) -> tuple[int, str]:
        """Number of rows that are reused, and the study as JSON."""
        with ResultCache(tmp_path) as points:
            found = order("gradual-closure", keys, levels=3, cells=10, out=points)
        return points.reused, json.dumps(plain(found.plain()))

    (first, made), (again, found) = study(), study()
    assert (first, again) == (0, 4) and made == found
    assert study(**{"numerics.courant": 0.5})[0] == 0


def test_a_reference_that_fails_is_reported():
    case = pulses.case(20, exact=False)
    case["numerics"]["end"] = 1e9
    case["numerics"]["below_vapor"], case["output"]["every"] = "stop", 1e6
    case["nodes"]["gate"] = scenes.junction(scenes.step(0.01, 0.0, 5.0))
    with pytest.raises(FvsolveError, match="reference run failed.*vapour"):
        order(case, levels=2, cells=4, reference="finer")
    # nor with the next row as reference
    with pytest.raises(FvsolveError, match="no row could be run.*vapour"):
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
    exact, found = (
        order(pulses.case(cells, points=pulses.FEW), schemes="upwind", levels=levels, reference=way)
        for way in ("exact", "richardson")
    )
    for norm, own in found.fits["pressure"].items():
        assert own.reason or abs(own.order - 1.0) <= own.spread + 0.1, (norm, own)
        shown = [row.errors["pressure"][norm] for row in found.rows[:-1]]
        true = [row.errors["pressure"][norm] for row in exact.rows[:-1]]
        told = any(
            "nothing is extrapolated" in note and f"pressure ({norm}" in note
            for note in found.notes
        )
        assert told or shown == approx(true, rel=0.25) or norm != "L1"
    if cells == 24:
        assert "three differences" in found.fits["pressure"]["L1"].reason


def test_errors_by_richardson_are_the_true_ones_where_the_order_is_sure():
    case = pulses.case(80, points=pulses.FEW)
    exact, found = (
        order(case, schemes="upwind", levels=5, reference=way) for way in ("exact", "richardson")
    )
    assert abs(found.fits["pressure"]["L1"].order - 1.0) <= found.fits["pressure"]["L1"].spread
    for a, b in zip(exact.rows[:-1], found.rows[:-1], strict=True):
        assert b.errors["pressure"]["L1"] == approx(a.errors["pressure"]["L1"], rel=0.15)


@pytest.mark.parametrize(
    ("scheme", "method", "p"), [("upwind5", "rk4", 5), ("upwind3", "ssp-rk3", 3)]
)
def test_refining_space_alone_shows_the_order_of_the_scheme_by_default(scheme, method, p):
    """At the Courant number 0.9 of the case, the error of the step would hide the order."""
    found = order(
        pulses.case(20, courant=0.9),
        schemes=scheme,
        methods=method,
        refine="space",
        levels=4,
        cells=30,
    )
    assert len({row.level.step for row in found.rows}) == 1
    assert f"Courant number {0.19 if p == 5 else 0.22}" in found.plan.words
    assert found.fits["pressure"]["L1"].order == approx(p, abs=0.3)


def test_where_the_step_hides_the_order_of_the_cells_a_smaller_step_is_named():
    case = pulses.case(20, courant=0.9)
    found = order(case, schemes="upwind5", methods="euler", refine="space", levels=4, cells=30)
    assert any("--set numerics.courant=0.005" in note for note in found.notes), found.notes


# ----------------------------------------------------------------------------------------------------------------------
# Fit of the order on errors of known order: it gives order and spread, or the reason why there is no order.


H = 0.1 / 2.0 ** np.arange(7)
ORDERS = [0.5, 0.83, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("p", ORDERS)
@pytest.mark.parametrize("rows", [3, 4, 7])
def test_a_pure_power_is_identified_exactly(p, rows):
    found = fit(H[:rows], 3.7e5 * H[:rows] ** p)
    assert found.order == approx(p, abs=1e-10) and found.spread == approx(0.0, abs=1e-8)
    assert found.constant == approx(3.7e5) and set(found.marks) == {""} and not found.reason


@pytest.mark.parametrize("ratio", [1.5, 2.0, 10.0])
def test_the_ratio_of_sizes_does_not_matter(ratio):
    h = ratio ** -np.arange(5.0)
    assert fit(h, 2.0 * h**3).order == approx(3.0, abs=1e-10)


@pytest.mark.parametrize("p", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("floor", [1e-8, 1e-10, 1e-12])
def test_rows_at_an_additive_floor_are_marked_and_do_not_bend_the_order(p, floor):
    e = H**p + floor
    found = fit(H, e)
    if np.sum(H**p > 100.0 * floor) >= 3:  # rows that the floor changes by less than 1 %
        assert not found.reason
    if not found.reason:
        assert abs(found.order - p) <= max(found.spread, 0.01) <= 1.0
    if np.sum(H**p > 100.0 * floor) >= 4:
        assert found.order == approx(p, abs=0.05)
    hidden = H**p < 0.3 * floor
    if not found.reason:
        assert all(found.marks[i] != "" for i in np.flatnonzero(hidden))


def test_rows_at_the_floor_before_failed_rows_are_at_the_floor():
    """Failed rows decide nothing: what is at the floor up to the last finite row stays there."""
    e = 5.0 * H**2
    e[4], e[5:] = e[4] / 50.0, np.nan
    found = fit(H, e, floor=e[4])
    assert found.marks == ("", "", "", "", "floor", "failed", "failed")


@pytest.mark.parametrize("p", [1, 2, 4])
def test_a_stated_floor_takes_rows_out(p):
    e = 5.0 * H**p
    found = fit(H, e, floor=e[4] / 9.0)
    assert found.marks == ("", "", "", "", "floor", "floor", "floor") and found.order == approx(p)
    assert "above the floor" in fit(H, e, floor=e[2] / 9.0).reason


def test_a_noisy_floor_is_a_floor():
    rng = np.random.default_rng(3)
    for _ in range(50):
        found = fit(H, H**4 + 1e-8 * rng.uniform(0.5, 1.0, 7))
        assert found.reason or found.order == approx(4, abs=0.3)


def test_an_order_of_a_quarter_is_identified_with_enough_rows():
    assert fit(H, H**0.25).order == approx(0.25)


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_a_head_where_errors_hardly_fall_is_pre_asymptotic(p):
    found = fit(H, H**p / (1.0 + (H / 0.02) ** p))
    assert found.marks[0] == "pre-asymptotic" and found.marks[-1] == ""
    assert abs(found.order - p) <= found.spread <= 0.25


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_a_head_that_falls_too_fast_is_pre_asymptotic(p):
    found = fit(H, H**p * (1.0 + (H / 0.02) ** 2))
    assert found.marks[0] == "pre-asymptotic" and found.marks[-1] == ""
    assert abs(found.order - p) <= found.spread <= 0.25


@pytest.mark.parametrize("p", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("share", [0.5, 5.0, -2.0])
def test_a_mixture_of_orders_lies_within_the_spread(p, share):
    found = fit(H, H**p * (1.0 + share * H))
    assert abs(found.order - p) <= found.spread <= 0.25


def test_an_order_that_reduces_is_not_taken_for_a_floor():
    found = fit(H, H**4 + 1e-4 * H**2)
    assert "floor" not in found.marks
    assert found.reason or abs(found.order - 2.0) <= found.spread + 0.05


def test_a_row_where_the_error_changes_sign_lies_off_the_line():
    e = H**2
    e[3] *= 0.02
    found = fit(H, e)
    assert found.order == approx(2.0) and found.marks[3] == "off the line" and "sign" in found.note


def test_a_last_row_that_leaves_the_line_is_reported():
    e = H[:6] ** 4
    e[-1] *= 4.0
    found = fit(H[:6], e)
    assert (
        found.order == approx(4.0)
        and found.marks[-1] == "off the line"
        and "leaves the line" in found.note
    )


@pytest.mark.parametrize("sigma", [0.3, 1.0, 3.0])
def test_noise_has_no_order(sigma):
    rng = np.random.default_rng(7)
    told = [not fit(H, np.exp(sigma * rng.standard_normal(7))).reason for _ in range(400)]
    assert np.mean(told) < 0.03


@pytest.mark.parametrize("p", [1, 2, 4])
def test_scatter_of_ten_percent_still_shows_the_order_within_its_spread(p):
    rng = np.random.default_rng(11)
    found = [fit(H, H**p * rng.uniform(0.95, 1.05, 7)) for _ in range(200)]
    told = [one for one in found if not one.reason]
    assert len(told) > 150 and np.mean([abs(one.order - p) <= one.spread for one in told]) > 0.95


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ([1e-2, 1e-3], "rows with a known error is 2; expected at least 3"),
        ([1e-2, math.nan, 1e-4], "rows with a known error is 2; expected at least 3"),
        ([0.0, 0.0, 0.0, 0.0], "above zero"),
        ([1.0, 1.0, 1.0, 1.0], "hardly fall"),
        ([1.0, 2.0, 3.0, 4.0], "do not fall"),
        ([1.0, 0.5, 0.3, 0.29, 0.1], "differ"),
        ([1.0, 1e-3, 1.02e-3, 1e-3], "floor"),
    ],
)
def test_an_absent_order_has_a_reason(errors, words):
    found = fit(H[: len(errors)], errors)
    assert words in found.reason and math.isnan(found.order) and math.isnan(found.spread)


def test_a_failed_row_is_left_out():
    e = H**3
    e[0] = math.nan
    found = fit(H, e)
    assert found.order == approx(3.0) and found.marks[0] == "failed"


@pytest.mark.parametrize(
    ("h", "e", "words"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], "fall from row to row"),
        ([1.0, 0.5], [1.0, 0.5, 0.2], "one error for each size"),
        ([1.0, 0.5, 0.25], [1.0, -0.5, 0.2], "negative"),
    ],
)
def test_invalid_errors_are_refused(h, e, words):
    with pytest.raises(FvsolveError, match=words):
        fit(h, e)


@pytest.mark.parametrize("c", [4.0, 8.0, 16.0])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_orders_that_climb_slowly_leave_the_limit_within_the_spread(c, first):
    """Errors saturate like those of smeared waves: orders climb to 1, at first by growing increments."""
    h = 0.5 / 2.0 ** np.arange(7)
    found = fit(h[first : first + 4], 1.0 - np.exp(-c * h[first : first + 4]))
    assert found.reason or abs(found.order - 1.0) <= found.spread + 0.05, found
