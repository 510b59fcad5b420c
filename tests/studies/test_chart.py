"""Charts of accuracy against speed: errors against closed forms, floors, failed runs, and lines for the case file."""

import csv
import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import frictionless, vessels
from reference.scenes import (
    AMBIENT,
    RHO,
    WATER,
    area,
    chamber,
    junction,
    pipe,
    ramp,
    reservoir,
    scene,
    smooth_ramp,
    smooth_step,
    step,
    valve,
)

import fvsolve
from fvsolve.case.text import write
from fvsolve.errors import FvsolveError
from fvsolve.studies import outcome as timing
from fvsolve.studies.accuracy.chart import chart
from fvsolve.studies.accuracy.work_precision import (
    chart_picture,
    curves_by_name,
    find_crossing,
    pareto_front,
    target_powers,
    write_chart_csv,
)
from fvsolve.studies.distance import Distance, cell_averages, distance
from fvsolve.studies.outcome import Outcome, outcome, study_model
from fvsolve.studies.reference import best_reference, reference_of_refinements, reference_of_run

SUPPLY, HOLE, VOLUME, P0 = 5e6, 1e-6, 0.5, 1e6
LENGTH, DIAMETER, SPEED, OPEN, PRESSURE = 300.0, 0.2, 1000.0, 4e-4, AMBIENT + 4e5
START, DURATION, END = 0.05, 0.4, 1.3


def pot(end=30.0, **numerics) -> dict:
    """Case of a chamber that fills through an orifice; its drop is a parabola in time."""
    nodes = {"pump": reservoir(SUPPLY), "pot": chamber(VOLUME, P0)}
    return scene(
        nodes,
        {"hole": valve("pump", "pot", HOLE)},
        end,
        numerics,
        ["pot.pressure", "hole.flow"],
        end / 200,
    )


def pot_pressure(t):
    slope = WATER["bulk_modulus"] / VOLUME * HOLE * math.sqrt(2 / RHO)
    return SUPPLY - vessels.falling_root(SUPPLY - P0, slope, t)


def line(opening=None, cells=40, end=END, **numerics) -> dict:
    """Case of a reservoir, a frictionless pipe and a closing valve, whose opening is a smooth polynomial by default."""
    nodes = {"lake": reservoir(PRESSURE), "gate": junction(), "out": reservoir(AMBIENT)}
    opening = smooth_ramp(START, DURATION, 1.0, 0.0) if opening is None else opening
    links = {
        "main": pipe("lake", "gate", LENGTH, DIAMETER, SPEED, cells),
        "tap": valve("gate", "out", OPEN, opening),
    }
    return scene(
        nodes, links, end, numerics, ["gate.pressure", "tap.flow", "main.pressure@0.5"], 0.005
    )


def line_rays(opening=lambda t: 1.0 - smooth_step(t, START, DURATION)) -> frictionless.Rays:
    flow = OPEN * math.sqrt(2 * (PRESSURE - AMBIENT) / RHO)
    main = frictionless.Pipe("lake", "gate", LENGTH, DIAMETER, SPEED, flow, PRESSURE)
    outlets = {"gate": (lambda t: OPEN * opening(t), AMBIENT)}
    return frictionless.Rays(
        RHO, {"main": main}, {"lake": frictionless.held(PRESSURE)}, outlets=outlets
    )


def exact_rows(t) -> np.ndarray:
    """Exact pressure at the gate, flow through the valve and pressure half way at times t."""
    truth = line_rays()
    gate = np.array([truth.pressure("gate", x) for x in t])
    opening = np.array([1.0 - smooth_step(x, START, DURATION) for x in t])
    flow = OPEN * opening * np.sign(gate - AMBIENT) * np.sqrt(2 * np.abs(gate - AMBIENT) / RHO)
    return np.column_stack([gate, flow, [truth.inside("main", 0.5, x)[0] for x in t]])


def mean_error(values, exact, t) -> float:
    """Greatest mean over time of |difference| of a column, relative to its range."""
    off = np.abs(values - exact) / np.ptp(exact, axis=0)
    return float(np.trapezoid(off, t, axis=0).max() / (t[-1] - t[0]))


# errors -----------------------------------------------------------------------------------------------------------


def test_errors_of_a_filling_chamber_are_those_against_its_parabola():
    found = chart(
        pot(), methods=["rk4", "dormand-prince"], rtol=[1e-2, 1e-4, 1e-6], step=[2.0, 0.5]
    )
    checked = 0
    for point in found.points:
        run = fvsolve.run(pot(), {**point.setting.keys})
        p = pot_pressure(run.t)
        flow = HOLE * np.sqrt(2 * np.maximum(SUPPLY - p, 0) / RHO)
        values = np.column_stack([run["pot.pressure"], run["hole.flow"]])
        own = mean_error(values, np.column_stack([p, flow]), run.t)
        laminar = 1e-5  # effect of the laminar law near zero drop, which the closed form lacks
        assert point.trajectory == pytest.approx(own, abs=laminar + 2 * found.floor["trajectory"])
        last = max(
            abs(run["pot.pressure"][-1] - p[-1]) / np.ptp(p),
            abs(run["hole.flow"][-1] - flow[-1]) / np.ptp(flow),
        )
        assert point.end == pytest.approx(last.max(), abs=10 * laminar)
        checked += own > 10 * laminar
    assert checked >= 2


@pytest.fixture(scope="module")
def closing():
    """Chart of a smooth closure for several tests."""
    return chart(line(), schemes=["upwind", "upwind5"], methods=["rk4"], cells=[10, 20, 40])


def test_errors_of_a_closing_valve_are_those_against_exact_rays(closing):
    checked = 0
    for point in closing.points:
        run = fvsolve.run(line(), {**point.setting.keys})
        values = np.column_stack(
            [run[name] for name in ("gate.pressure", "tap.flow", "main.pressure@0.5")]
        )
        own = mean_error(values, exact_rows(run.t), run.t)
        assert point.trajectory == pytest.approx(own, abs=2 * closing.floor["trajectory"] + 1e-7)
        checked += own > 10 * closing.floor["trajectory"]
    assert checked >= 6


def test_the_error_at_the_end_is_that_of_the_fields_too(closing):
    """Exact cell averages by Gauss points; pressure errors relative to the range of pressure in the pipe over time."""
    point = next(
        p for p in closing.points if p.setting.name == "upwind rk4" and p.setting.cells == 20
    )
    ended = outcome(line(), point.setting.keys)
    frame = ended.model.fields(ended.y, ended.model.evaluate(END, ended.y)[1])["main"]
    truth, nodes = line_rays(), np.polynomial.legendre.leggauss(4)
    exact = np.zeros((2, 20))
    for i in range(20):
        for x, w in zip(*nodes, strict=True):
            exact[:, i] += 0.5 * w * np.array(truth.inside("main", (i + 0.5 + 0.5 * x) / 20, END))
    times = np.linspace(0.0, END, 400)
    seen = [truth.inside("main", x, t)[0] for x in np.linspace(0.0, 1.0, 41) for t in times]
    span = max(seen) - min(seen)
    p, q = frame["pressure"], frame["flow"]
    worst = max(
        np.mean(np.abs(p - exact[0])) / span,
        np.mean(np.abs(q - exact[1])) / (span * area(DIAMETER) / (RHO * SPEED)),
    )
    assert point.end >= 0.98 * worst - 2 * closing.floor["end"]
    rows = fvsolve.run(line(), point.setting.keys)
    last = exact_rows(np.array([END]))[0]
    ranges = np.ptp(exact_rows(times), axis=0)
    at_end = np.array(
        [rows[name][-1] for name in ("gate.pressure", "tap.flow", "main.pressure@0.5")]
    )
    worst = max(worst, *(np.abs(at_end - last) / ranges))
    assert point.end == pytest.approx(worst, rel=0.02, abs=2 * closing.floor["end"])


def finished_outcome(rows, *probes) -> Outcome:
    """Outcome of a finished run with these rows."""
    return Outcome("finished", ok=True, rows=rows, probes=probes, model=study_model(pot()))


def test_rows_before_and_after_a_jump_are_both_compared_and_weigh_nothing_twice():
    t = np.array([0.0, 1.0, 1.0, 2.0])
    exact = np.column_stack([t, [0.0, 0.0, 10.0, 10.0]])
    off = exact.copy()
    off[1, 1] += 1.0  # only before the jump
    found = distance(finished_outcome(off, "p"), reference_of_run(finished_outcome(exact, "p")))
    assert found.trajectory == pytest.approx(0.5 * 0.1 / 2.0)
    assert found.greatest == pytest.approx(0.1)
    assert found.end == 0.0


def test_every_probe_is_measured_by_its_own_range_and_a_constant_probe_by_none():
    t = np.linspace(0.0, 1.0, 5)
    exact = np.column_stack([t, 1e6 + 10.0 * t, 1e-3 * t, np.full(5, 7.0)])
    off = exact + np.array([0.0, 0.1, 2e-5, 3.0])
    found = distance(
        finished_outcome(off, "a", "b", "c"),
        reference_of_run(finished_outcome(exact, "a", "b", "c")),
    )
    assert found.worst == "b"
    assert found.trajectory == pytest.approx(0.02)
    assert found.overshoot == pytest.approx(0.02)


def test_a_run_that_stopped_early_has_no_error():
    t = np.linspace(0.0, 1.0, 5)
    exact = np.column_stack([t, t])
    early = Outcome("stopped", rows=exact[:3], probes=("a",))
    assert math.isnan(distance(early, reference_of_run(finished_outcome(exact, "a"))).trajectory)


@pytest.mark.parametrize("fine, coarse", [(40, 10), (47, 10), (64, 48)])
def test_averages_over_fewer_cells_are_those_of_the_field(fine, coarse):
    """Cell averages of a cosine, exact on both grids; a spline interpolates their sums between edges."""

    def cells(n):
        edges = np.linspace(0.0, 1.0, n + 1)
        return np.diff(np.sin(2 * edges) / 2) * n

    assert cell_averages(cells(fine), coarse) == pytest.approx(
        cells(coarse), abs=1e-12 if fine == 40 else 1e-5
    )


# floor ------------------------------------------------------------------------------------------------------------


def opinion(name: str, shift: float, own: float):
    t = np.linspace(0.0, 1.0, 11)
    found = reference_of_run(finished_outcome(np.column_stack([t, t + shift]), "a"), name)
    return replace(found, uncertainty=Distance(own, own, own))


def test_two_references_that_disagree_give_a_floor():
    found = best_reference([opinion("rough", 0.01, 1e-4), opinion("fine", 0.0, 1e-6)])
    assert (found.words, found.second) == ("fine", "rough")
    assert found.uncertainty.trajectory == pytest.approx(0.01)


def test_references_that_agree_by_chance_have_the_floor_of_their_own_error():
    found = best_reference([opinion("one", 1e-9, 3e-3), opinion("other", 0.0, 2e-3)])
    assert found.uncertainty.trajectory == pytest.approx(2e-3)


@pytest.mark.parametrize("order", [1.0, 2.0, 5.0])
def test_halved_steps_give_the_error_of_a_reference(order):
    t = np.linspace(0.0, 1.0, 11)
    runs = [
        finished_outcome(np.column_stack([t, t * (1 + 0.1 * 2.0 ** (-order * k))]), "a")
        for k in range(3)
    ]
    exact = reference_of_run(finished_outcome(np.column_stack([t, t]), "a"))
    own = reference_of_refinements("", runs).uncertainty.trajectory
    # safety factor 1.5
    assert own == pytest.approx(1.5 * distance(runs[2], exact).trajectory, rel=0.05)


def test_the_floor_of_a_sudden_closure_covers_the_true_error_of_its_reference():
    """At jumps, fifth-order references converge slowly and agree; rays give their true error."""
    jump = 0.0837
    case = line(step(jump, 1.0, 0.0))
    found = chart(case, schemes=["muscl"], methods=["ssp-rk3"], cells=[20, 40])
    truth = line_rays(frictionless.step(jump, 1.0, 0.0))
    run = fvsolve.run(
        case, {"numerics.scheme": "muscl", "numerics.method": "ssp-rk3", "links.main.cells": 40}
    )
    gate = np.array([truth.pressure("gate", t) for t in run.t])
    twice = np.flatnonzero(np.diff(run.t) == 0)
    gate[twice] = truth.pressure("gate", jump - 1e-9)
    own = mean_error(run["gate.pressure"][:, None], gate[:, None], run.t)
    [point] = [
        one for one in found.points if (one.setting.scheme, one.setting.cells) == ("muscl", 40)
    ]
    assert point.trajectory >= own - found.floor["trajectory"]
    assert found.floor["trajectory"] < 0.5 * own


@pytest.mark.parametrize("shape", ["smooth", "kinked"])
def test_an_exact_solution_judges_where_the_case_names_it(shape):
    """Errors against rays and against finer runs agree within the floor of the finer runs."""
    opening = {"smooth": None, "kinked": {"time": [0.1, 0.3], "value": [1.0, 0.0]}}[shape]
    given = {"schemes": ["upwind5"], "methods": ["rk4"], "cells": [10, 20]}
    runs = chart(line(opening), **given)
    exact = chart({**line(opening), "exact": {"name": "rays"}}, **given)
    assert exact.reference == 'exact solution "rays"'
    assert "exact" not in runs.reference
    assert exact.floor["trajectory"] <= runs.floor["trajectory"]
    for one, other in zip(exact.points, runs.points, strict=True):
        assert one.trajectory == pytest.approx(other.trajectory, abs=runs.floor["trajectory"])
        assert one.end == pytest.approx(other.end, abs=2 * runs.floor["end"])


def test_a_chart_with_references_no_better_than_its_runs_is_refused():
    with pytest.raises(FvsolveError, match="two references .* disagree by .* larger --rtol"):
        chart(pot(), methods=["dormand-prince"], rtol=[1e-12, 1e-13])


def test_no_overshoot_is_claimed_below_the_error_of_the_references(tmp_path):
    """Upwind at Courant 1 is exact in equal cells: it leaves the range of the smeared reference, not that of rays."""
    nodes = {"lake": reservoir(AMBIENT + 1e6), "gate": junction(), "out": reservoir(AMBIENT)}
    links = {
        "main": pipe("lake", "gate", 600.0, 0.3, 1200.0, 25),
        "tap": valve("gate", "out", 1.2e-3, ramp(0.25, 1.7, 1.0, 0.0)),
    }
    case = scene(nodes, links, 6.0, {}, ["gate.pressure", "tap.flow", "main.pressure@0.5"], 0.005)
    given = {"schemes": ["upwind", "upwind5"], "methods": ["euler", "rk4"], "cells": [25, 50]}
    found = chart(case, **given, out=tmp_path)
    points = [json.loads(text) for text in (tmp_path / "points.jsonl").read_text().splitlines()]
    raw = [one["found"]["overshoot"] for one in points if "overshoot" in one["found"]]
    floor, *blur = raw[:3]  # upwind with euler
    assert (
        "exact" not in found.reference
        and min(blur) > 1e-3
        and found.floor["overshoot"] == floor > max(blur)
    )
    assert [one.overshoot for one in found.curves()["upwind euler"]] == [0.0, 0.0]
    exact = chart(case | {"exact": {"name": "rays"}}, **given, out=tmp_path / "exact")
    points = [
        json.loads(text) for text in (tmp_path / "exact" / "points.jsonl").read_text().splitlines()
    ]
    true = [
        one["found"]["overshoot"]
        for one in points
        if "upwind" == one["of"].get("keys", {}).get("numerics.scheme")
    ]
    assert len(true) == 4 and max(true) < 1e-6 and exact.reference == 'exact solution "rays"'


def test_nothing_is_claimed_below_the_floor(closing):
    assert all(row.target >= closing.floor["trajectory"] for row in closing.front)
    with pytest.raises(FvsolveError, match="below the floor"):
        chart(line(), schemes=["upwind5"], methods=["rk4"], cells=[10, 20], target=1e-9)


# failed runs ------------------------------------------------------------------------------------------------------


def stiff() -> dict:
    """Case of a chamber of 1 ml between two orifices; its rate is far above 1 / step."""
    nodes = {"pump": reservoir(SUPPLY), "pot": chamber(1e-6, P0), "sump": reservoir(AMBIENT)}
    links = {"in": valve("pump", "pot", HOLE), "out": valve("pot", "sump", HOLE)}
    return scene(nodes, links, 1e-2, {}, ["pot.pressure"], 1e-4)


def test_failed_runs_are_in_list_table_and_picture(tmp_path):
    found = chart(
        stiff(), methods=["rk4", "dormand-prince"], rtol=[1e-3, 1e-6], step=[2e-3, 1e-30, 1e-6]
    )
    by_step = {point.setting.size: point for point in found.points if point.setting.method == "rk4"}
    assert not by_step[2e-3].ok and (
        "not finite" in by_step[2e-3].reason or "wrong" in by_step[2e-3].reason
    )
    assert not by_step[1e-30].ok and by_step[1e-30].reason.startswith("refused: ")
    assert by_step[1e-6].ok
    assert [point.setting.size for point in found.failed] == [2e-3, 1e-30]
    write_chart_csv(found, tmp_path / "chart.csv")
    lines = list(csv.DictReader((tmp_path / "chart.csv").open()))
    assert len(lines) == len(found.points)
    assert [line["reason"].split(":")[0] for line in lines if line["ok"] == "0"][1:] == ["refused"]
    drawn = [
        one for one in chart_picture(found).axes[0].lines if one.get_markerfacecolor() == "none"
    ]
    assert sum(len(one.get_xdata()) for one in drawn) == 1  # the refused run has no cost
    assert not any(
        row.name == "rk4" and row.target < 1e-2 for row in found.front if row.by_updates is None
    )


def test_a_run_that_costs_too_much_is_given_up_and_so_are_the_finer_ones_of_its_curve(
    monkeypatch, capsys
):
    """A chamber of 1 microlitre needs millions of explicit steps in 10 s, at any tolerance."""
    monkeypatch.setattr(timing, "CPU_LIMIT", 0.3)
    case = stiff()
    case["nodes"]["pot"] = chamber(1e-9, P0)
    case["numerics"]["end"], case["output"]["every"] = 10.0, 0.1
    case["nodes"]["pump"] = reservoir(smooth_ramp(1.0, 5.0, SUPPLY, 0.8 * SUPPLY))
    found = chart(case, methods=["dormand-prince", "rodas-5p"], rtol=[1e-2, 1e-4, 1e-6])
    first, *finer = found.curves()["dormand-prince"]
    assert not first.ok and first.reason.startswith("given up after 0.") and first.steps > 1000
    assert 0.3 < first.seconds < 2.0
    assert all(
        not one.ok and "rtol 0.01 was already given up" in one.reason and one.steps == 0
        for one in finer
    )
    assert all(one.ok for one in found.curves()["rodas-5p"])


def test_a_failed_point_is_no_proof_for_finer_targets():
    found = chart(stiff(), methods=["rk4", "dormand-prince"], rtol=[1e-3, 1e-6], step=[2e-3])
    assert found.front and "rk4" not in {row.name for row in found.front}


# Pareto front -----------------------------------------------------------------------------------------------------


def test_the_front_names_the_cheapest_curve_by_updates_and_the_default(closing):
    assert closing.default == "weno5 rk4"
    assert "weno5 rk4" in closing.curves()
    row = next(row for row in closing.front if row.target == pytest.approx(1e-3))
    fine = {
        name: [p for p in points if p.trajectory <= 1e-3]
        for name, points in curves_by_name(closing.points).items()
    }
    assert row.by_updates == "upwind5 rk4"
    assert row.updates <= min(point.updates for points in fine.values() for point in points)
    if fine["weno5 rk4"]:
        assert row.default_updates <= fine["weno5 rk4"][0].updates


def test_work_and_errors_of_a_chart_are_the_same_every_time(closing):
    again = chart(line(), schemes=["upwind", "upwind5"], methods=["rk4"], cells=[10, 20, 40])
    keys = ("trajectory", "greatest", "end", "rhs", "updates", "steps")
    assert [[getattr(p, key) for key in keys] for p in again.points] == [
        [getattr(p, key) for key in keys] for p in closing.points
    ]
    assert all(point.updates == point.rhs * point.setting.cells for point in again.points)


def test_pasted_lines_reach_the_target(tmp_path):
    """Lines are pasted as text into the file, run, and compared with exact rays."""
    target = 3e-3
    case = line(cells=37)
    found = chart(
        case, schemes=["upwind", "upwind5"], methods=["rk4"], cells=[10, 20, 40], target=target
    )
    numerics, _, others = "\n".join(found.aim.toml_lines()).partition("\n\n")
    case["numerics"] = {"end": END}
    ((name, table),) = tomllib.loads(others)["links"].items()
    case["links"][name] |= table
    file = tmp_path / "pasted.toml"
    file.write_text(write(case).replace("[numerics]\n", f"[numerics]\n{numerics}\n"))
    run = fvsolve.run(file)
    values = np.column_stack(
        [run[name] for name in ("gate.pressure", "tap.flow", "main.pressure@0.5")]
    )
    own = mean_error(values, exact_rows(run.t), run.t)
    assert own <= target
    assert own == pytest.approx(
        found.aim.point.trajectory, abs=2 * found.floor["trajectory"] + 1e-7
    )
    assert own > target / 30  # not far more accurate than needed


def test_pipes_that_state_no_cells_are_given_a_cell_time(tmp_path):
    case = line()
    del case["links"]["main"]["cells"]
    found = chart(case, schemes=["upwind5"], methods=["rk4"], cells=[10, 40], target=1e-2)
    case["numerics"] = {"end": END, **tomllib.loads("\n".join(found.aim.toml_lines()))}
    run = fvsolve.run(case)
    assert run.case.links["main"].cells == found.aim.point.setting.cells
    values = np.column_stack(
        [run[name] for name in ("gate.pressure", "tap.flow", "main.pressure@0.5")]
    )
    assert mean_error(values, exact_rows(run.t), run.t) <= 1e-2


# continued charts, and invalid input ------------------------------------------------------------------------------


def test_a_chart_that_was_broken_off_goes_on_from_its_points(tmp_path):
    def stop(done, total, what):
        if done == 5:
            raise KeyboardInterrupt

    given = {"methods": ["auto"], "rtol": [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7], "out": tmp_path}
    with pytest.raises(KeyboardInterrupt):
        chart(pot(), progress=stop, **given)
    found = chart(pot(), **given)
    assert found.reused == 5  # floor and four points
    again = chart(pot(), **given)
    assert again.reused == 7 and again.compile_seconds == 0.0
    assert again.points == found.points  # with their stored times


def test_a_case_without_motion_has_no_chart():
    with pytest.raises(FvsolveError, match="all probes are constant"):
        chart(line(end=0.04), schemes=["upwind5"], methods=["rk4"], cells=[10, 20])


def test_where_a_chamber_holds_explicit_steps_back_references_are_implicit():
    """Errors against implicit references equal errors against an explicit run of similar accuracy."""
    case = line(smooth_ramp(0.02, 0.2, 1.0, 0.5, 101), end=0.4)
    case["nodes"]["gate"] = chamber(1e-2)
    found = chart(case, schemes=["upwind5"], methods=["rodas-5p"], cells=[10, 20])
    assert (
        "rodas-5p" in found.reference + found.second
        and "radau-iia-5" in found.reference + found.second
    )
    names = ("gate.pressure", "tap.flow", "main.pressure@0.5")
    fine = {"numerics.scheme": "upwind5", "numerics.method": "rk4", "links.main.cells": 80}
    explicit = fvsolve.run(case, fine)
    for point in found.points:
        run = fvsolve.run(case, point.setting.keys)
        off = mean_error(
            np.column_stack([run[name] for name in names]),
            np.column_stack([explicit[name] for name in names]),
            run.t,
        )
        assert point.trajectory == pytest.approx(off, rel=0.1, abs=2 * found.floor["trajectory"])


@pytest.mark.parametrize(
    "case, given, said",
    [
        (line, {"schemes": ["upwnd"]}, 'unknown scheme upwnd; did you mean "upwind"'),
        (line, {"methods": ["rk5"]}, "unknown method rk5"),
        (line, {"rtol": [1e-3]}, "has cells.*--cells"),
        (pot, {"cells": [10]}, "no pipe.*rtol or step"),
        (pot, {"schemes": ["muscl"]}, "no pipe.*rtol or step"),
    ],
)
def test_a_resolution_that_the_case_has_not_is_named(case, given, said):
    with pytest.raises(FvsolveError, match=said):
        chart(case(), **given)


@pytest.mark.parametrize(
    ("case", "given"),
    [
        (line(), {"schemes": ["upwind5"], "methods": ["rk4"], "cells": [40, 80]}),
        (pot(), {"methods": ["rk4"], "step": [0.02, 0.01], "rtol": [1e-8]}),
        (pot(), {"methods": ["dormand-prince"], "rtol": [1e-7, 1e-8]}),
    ],
)
def test_a_target_is_followed_down_to_settings_that_were_not_named(case, given):
    found = chart(case, target=0.05, **given)
    for name, curve in found.curves().items():
        errors = [one.trajectory if one.ok else math.inf for one in curve]
        widest = curve[0].setting
        last = {"rtol": widest.size == 0.1, "step": 2 * widest.size > case["numerics"]["end"]}
        assert errors[0] > 0.05 or last.get(widest.control, widest.cells == 1), name
    updates = [one.updates for one in found.points if one.ok and one.trajectory <= 0.05]
    assert found.aim.point.ok and found.aim.point.trajectory <= 0.05
    asked = [
        one.updates
        for one in found.points
        if one.setting.cells in given.get("cells", ())
        or one.setting.size in given.get("step", given.get("rtol", ()))
    ]
    assert min(updates) < 0.5 * min(asked)


# ----------------------------------------------------------------------------------------------------------------------
# Pareto fronts, crossings and targets of synthetic sets with known answers.


COSTS = [1.0, 4.0, 16.0, 64.0]
sizes = st.floats(1e-12, 1e3)


@given(st.lists(st.tuples(sizes, sizes), max_size=30))
def test_no_point_of_a_front_is_beaten_and_every_other_point_is(points):
    errors, costs = [one[0] for one in points], [one[1] for one in points]
    found = pareto_front(errors, costs)
    for k, (error, cost) in enumerate(points):
        better = [j for j in range(len(points)) if errors[j] <= error and costs[j] <= cost]
        strictly = [j for j in better if errors[j] < error or costs[j] < cost]
        assert (not strictly) if k in found else any(j in found for j in better)
    assert [costs[k] for k in found] == sorted(costs[k] for k in found)
    assert [errors[k] for k in found] == sorted((errors[k] for k in found), reverse=True)


def test_a_failed_point_is_on_no_front():
    assert pareto_front([math.inf, 0.1, 0.01], [1.0, 2.0, 3.0]) == [1, 2]


@given(st.floats(0.3, 6.0), st.floats(1.001, 900.0))
def test_a_crossing_on_a_power_law_is_exact(order, ratio):
    """Error 8 h^p at cost h^-2, h = 1, 1/2, 1/4, 1/8: a target between has the cost (8 / target)^(2 / p)."""
    errors = [8.0 * 2.0 ** (-order * k) for k in range(4)]
    target = 8.0 / min(ratio, 2.0 ** (3.0 * order) * 0.999)
    where = find_crossing(errors, COSTS, target)
    assert where.cost == pytest.approx((8.0 / target) ** (2.0 / order), rel=1e-9)
    assert COSTS[where.coarser] <= where.cost * (1 + 1e-12) and where.cost <= COSTS[where.finer] * (
        1 + 1e-12
    )


def test_a_crossing_counts_only_from_where_all_finer_points_hold():
    """A single coarse point below the target does not count."""
    where = find_crossing([1e-3, 1e-1, 1e-2, 1e-4], COSTS, 1e-3)
    assert (where.coarser, where.finer) == (2, 3)
    assert where.cost == pytest.approx(32.0)


def test_a_curve_that_ends_above_the_target_or_fails_at_its_end_has_no_crossing():
    assert find_crossing([1e-1, 1e-2], COSTS[:2], 1e-3) is None
    assert find_crossing([1e-4, math.inf], COSTS[:2], 1e-3) is None


def test_nothing_is_interpolated_towards_a_failed_point_nor_before_the_coarsest():
    after = find_crossing([math.inf, 1e-4], COSTS[:2], 1e-3)
    assert (after.cost, after.within) == (4.0, False)
    first = find_crossing([1e-4, 1e-5], COSTS[:2], 1e-3)
    assert (first.cost, first.within) == (1.0, False)


def test_targets_end_at_the_floor_and_at_the_best_run():
    assert target_powers([0.5, 2e-4, math.inf], 1e-9) == pytest.approx([1e-1, 1e-2, 1e-3])
    assert target_powers([0.5, 2e-7], 3e-3) == pytest.approx([1e-1, 1e-2])
    assert target_powers([], 0.0) == []
