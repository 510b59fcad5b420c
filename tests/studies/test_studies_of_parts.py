"""Studies of cases with devices, vessels and cavities."""

import math
import time
from importlib import import_module

import numpy as np
import pytest
from invariance.moving import SCENES, flume, u_tube
from reference import pulses, pump_trip
from reference.bodies import bodies, body
from reference.delays import fork, main, turned
from reference.folders import CASES
from reference.scenes import GRAVITY, RHO, scene, tank
from reference.short_lines import vessel
from scipy.optimize import brentq

import fvsolve
from fvsolve import studies
from fvsolve.case.text import write
from fvsolve.cli import terminal
from fvsolve.cli.accuracy_commands import variable_unit
from fvsolve.errors import FvsolveError
from fvsolve.studies.accuracy import model_hierarchy, refine
from fvsolve.studies.accuracy.chart_settings import (
    CoarseRun,
    chart_settings,
    default_curve,
    run_work,
    unsupported_schemes,
)
from fvsolve.studies.accuracy.fit import fit
from fvsolve.studies.accuracy.model_hierarchy import NotApplicable, change_time, level_keys
from fvsolve.studies.accuracy.order_study import check_order
from fvsolve.studies.accuracy.refine import affordable_plan
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.failure_map import NOT_RUN, Measures, failure_map, run_recorded, verdict
from fvsolve.studies.failure_map_columns import eigenvalues_of
from fvsolve.studies.linearise import linearise
from fvsolve.studies.outcome import GIVEN_UP, outcome
from fvsolve.studies.ports.response import response
from fvsolve.studies.reference import candidates, find_reference
from fvsolve.studies.result_cache import ResultCache
from fvsolve.studies.stability import stability as room
from fvsolve.studies.stability.stability import stability
from fvsolve.studies.work_limit import TooLarge


def case(name, **numerics):
    """Shipped case with changed keys, in which double underscores are dots."""
    return fvsolve.load(
        CASES / f"{name}.toml", {key.replace("__", "."): value for key, value in numerics.items()}
    )


# stability ------------------------------------------------------------------------------------------------------


def test_two_runs_of_a_scene_with_events_have_separate_states_of_valves():
    (row,) = stability(case("check-valve-slam", links__main__cells=20), at=3.8, steps=200).rows
    assert abs(row.difference) < 0.01


def test_a_state_that_moves_is_named_where_prediction_and_measurement_differ_and_at_rest_they_do_not():
    (moves,) = stability(case("surge-tank")).rows
    assert abs(moves.difference) > 0.1 and any(
        "the state leaves the linearised state" in note for note in moves.notes
    )
    (rests,) = stability(
        case("surge-tank", links__tunnel__initial_flow=0.0, nodes__shaft__level=50.0)
    ).rows
    assert abs(rests.difference) < 1e-3


def test_pipes_with_cavities_are_measured_and_compared_with_the_prediction_of_upwind():
    few = case("adelaide", links__main__cells=10)
    (row,) = stability(few, steps=100).rows
    assert row.measured > 0.0 and set(row.frozen) == {"upwind"}
    (plain,) = stability(few, ["upwind"], steps=100).rows
    assert row.frozen["upwind"] == pytest.approx(plain.predicted) and abs(plain.difference) < 0.01
    with pytest.raises(FvsolveError, match="--scheme upwind$"):
        linearise(few)


def test_a_limited_scheme_is_measured_where_its_frozen_weights_take_too_long(monkeypatch):
    def never(one):
        raise TooLarge("too large")

    few = case(
        "surge-tank",
        links__tunnel__type="pipe",
        links__tunnel__wave_speed=1000.0,
        links__tunnel__cells=20,
    )
    known = stability(few, ["muscl"], ["ssp-rk3"], steps=100).rows[0].measured
    monkeypatch.setattr(room, "predicted_limit", never)
    (row,) = stability(few, ["muscl"], ["ssp-rk3"], steps=100).rows
    assert not row.frozen and row.left_out["frozen weights"] == "too large"
    assert row.measured == pytest.approx(known, rel=0.2)


# units ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("variable", "said"), [
    ("top.air_volume", "m3"), ("top.air_mass", "kg"), ("links at the end: opening", "-"), ("spool.flow_P", "m3/s"),
    ("main.gauge_pressure@0.5", "Pa"), ("pump.speed", "-"),
])  # fmt: skip
def test_every_probe_has_the_unit_of_its_part(variable, said):
    assert variable_unit(variable) == said


@pytest.mark.parametrize(("name", "states"), [
    ("air-valve", {"air": "kg", "mass": "kg"}), ("pump-trip", {"speed": "-", "forward[0]": "kg/s"}),
    ("pressure-reducing", {"opening": "-"}), ("hydraulic-drive", {"position": "m", "velocity": "m/s", "excess": "kg"}),
])  # fmt: skip
def test_every_state_has_its_unit(name, states):
    found = linearise(case(name), outputs=(), scheme="upwind")
    units = dict(
        zip((state.rsplit(".", 1)[1] for state in found.states), found.state_units, strict=True)
    )
    assert states.items() <= units.items()


# checks before a run --------------------------------------------------------------------------------------------


def test_check_names_the_pipe_that_limits_the_step_and_states_the_cost_of_cavities():
    cavities, plain = (fvsolve.build(case(name)).checks for name in ("adelaide", "pump-trip"))
    assert cavities["step_set_by"].startswith("links.main:")
    cost = [one["expected_seconds"] / one["steps"] / one["cells"] for one in (cavities, plain)]
    assert cost[0] > 5.0 * cost[1]


# order ----------------------------------------------------------------------------------------------------------


def test_an_order_that_would_take_long_begins_on_fewer_cells_with_a_notice(monkeypatch, tmp_path):
    few = case("relief-on-closed-main", links__main__cells=64)
    whole = affordable_plan(few, None, None, 3, None, "auto", None)
    assert [level.cells for level in whole.levels] == [64, 128, 256] and "begun" not in whole.words
    monkeypatch.setattr(refine, "CPU_BUDGET", 1e-6)
    made = affordable_plan(few, None, None, 3, None, "auto", ResultCache(tmp_path))
    assert [level.cells for level in made.levels] == [
        8,
        16,
        32,
    ] and "starts with 8 of 64 cells" in made.words
    assert affordable_plan(few, None, None, 3, 50, "auto", None).levels[0].cells == 50
    monkeypatch.undo()
    # continued study
    assert affordable_plan(few, None, None, 3, None, "auto", ResultCache(tmp_path)) == made


def test_errors_that_fall_quicker_than_scheme_and_method_allow_show_no_order():
    sizes = [2.0**-k for k in range(5)]
    assert "not the order of the method" in check_order(fit(sizes, [h**8 for h in sizes]), 4.0).note
    assert not check_order(fit(sizes, [h**4 for h in sizes]), 4.0).note


def test_with_cavities_a_reference_is_finer_by_the_scheme_that_follows_them():
    (_, trials), *_ = candidates(case("adelaide", links__main__cells=10), True, "both", False)
    assert trials[-1]["numerics.scheme"] == "muscl" and trials[-1]["links.main.cells"] == 40


# chart ----------------------------------------------------------------------------------------------------------


def test_a_chart_leaves_out_schemes_that_do_not_follow_cavities():
    found, coarse = case("adelaide"), CoarseRun(25, 800.0, 800, [1e6], 0.0)
    made = chart_settings(found, coarse, None, None, [50], None, None)
    assert {one.scheme for one in made} == {"upwind", "muscl"} and default_curve(
        found
    ) == "muscl rk4"
    assert unsupported_schemes(found, None) == ["upwind5", "weno5"] and not unsupported_schemes(
        found, ["weno5"]
    )
    assert not unsupported_schemes(case("pump-trip"), None)


def test_with_cavities_both_references_of_a_chart_can_be_run():
    few = case("adelaide", links__main__cells=8)
    found = [outcome(few, keys[0]).ok for _, keys in candidates(few, False, "both", False)]
    assert found == [True, True]


def test_the_work_of_a_chart_counts_pipes_of_1_cell_once():
    found = case("pump-trip")
    assert run_work(found, 400) == pytest.approx(4 * run_work(found, 200))
    assert run_work(case("net3-pump-trip"), 400) < 3 * run_work(case("net3-pump-trip"), 200)


def test_a_chart_of_dear_rates_has_fewer_cells():
    cheap, dear = (
        CoarseRun(25, 800.0, 800, [8e6, 2e6, 5e5, 1e5], 0.0, dearness).levels
        for dearness in (1.0, 30.0)
    )
    assert max(dear) < max(cheap) and len(dear) == len(cheap)


# models ---------------------------------------------------------------------------------------------------------


def test_the_schedule_of_a_pump_that_trips_is_its_run_down():
    model = fvsolve.build(case("pump-trip", links__main__cells=10))
    pump = model.case.links["pump"]
    torque = pump_trip.torque(1.0, 46.658e-3)
    assert change_time(model) == pytest.approx(pump.inertia * pump.rated_speed / torque, rel=0.05)


def test_a_vessel_is_not_described_by_a_volume():
    with pytest.raises(NotApplicable, match="a volume at top would replace the air-valve"):
        level_keys(case("air-valve"), "lumped volume")
    with pytest.raises(NotApplicable, match="all ends of the pipes are reservoirs"):
        level_keys(case("pump-trip-air-vessel"), "column and volume")


def test_a_law_that_takes_long_is_not_tried_on_more_cells(monkeypatch):
    monkeypatch.setattr(model_hierarchy, "LEVEL_CPU_LIMIT", 0.0)
    with pytest.raises(
        FvsolveError,
        match="the case itself does not run: not run: the run with 1 cell was already given up",
    ):
        model_hierarchy.ladder(
            case("relief-on-closed-main", links__main__cells=4, numerics__courant=0.001)
        )


# map ------------------------------------------------------------------------------------------------------------


def test_a_map_of_cavities_has_a_reference_and_a_limit():
    few = case("adelaide", links__main__cells=8)
    found = find_reference(few)
    assert (
        found.words.startswith("muscl van-leer on 32 cells")
        and 0.0 < found.uncertainty.trajectory < 1.0
    )
    assert np.array_equal(
        eigenvalues_of(few, {}), eigenvalues_of(few, {"numerics.scheme": "upwind"})
    )


def test_a_square_that_takes_too_long_is_given_up_and_called_neither_wrong_nor_blown_up(
    monkeypatch,
):
    late, off = (
        Measures(f"{GIVEN_UP} 10 s", False),
        Measures("finished", True, error=0.5, farthest=0.0),
    )
    assert verdict(late, lambda: off, 0.02) == verdict(off, lambda: late, 0.02) == NOT_RUN
    monkeypatch.setattr(import_module("fvsolve.studies.failure_map"), "CPU_LIMIT", 0.0)
    found, _ = run_recorded(case("relief-on-closed-main", links__main__cells=4))
    assert found.reason.startswith(GIVEN_UP) and not found.ok


# ----------------------------------------------------------------------------------------------------------------------
# Studies of cases with delay lines: orders, against cells and rays, and exact results.


def rough(**numerics) -> dict:
    """Case of a pulse of demand in one delay line with large friction."""
    case = pulses.case(exact=False, points=pulses.FEW)
    case["links"]["main"]["friction"] = {"model": "steady", "factor": 0.5}
    demand = case["nodes"]["gate"]["demand"]
    demand["value"] = [one + 0.2 for one in demand["value"]]
    given = {
        "pipe_model": "delay-line",
        "method": "euler",
        "step": 0.00125,
        "delay_tolerance": 0.01,
        **numerics,
    }
    return case | {"numerics": {"end": pulses.END, **given}}


def test_friction_of_lines_is_of_second_order_next_to_cells():
    found = studies.order(rough())
    assert found.kind == "finer" and found.words.startswith("upwind5 on 2560 cells")
    for probe in ("gate.pressure", "main.pressure@0.37"):
        assert found.fits[probe]["L1"].order == pytest.approx(2.0, abs=0.1)
    stretched = studies.order(rough(step=0.0002), refine="space")
    assert stretched.fits["gate.pressure"]["L1"].order == pytest.approx(2.0, abs=0.2)
    assert [row.level.size for row in stretched.rows] == pytest.approx(
        [0.1 / n for n in (6, 11, 21, 41)]
    )


def test_drawn_the_other_way_or_by_two_the_study_is_the_same():
    one, other = studies.order(rough(), levels=2), studies.order(turned(rough()), levels=2)
    two = studies.order(rough(), levels=2, jobs=2)
    for row, same, as_well in zip(one.rows, two.rows, other.rows, strict=True):
        assert same.errors == row.errors
        for name in ("pressure", "flow", "gate.pressure"):
            assert as_well.errors[name] == pytest.approx(row.errors[name], rel=1e-8)


def test_smooth_waves_between_steps_are_of_sixth_order():
    """Against rays in the middle of a pipe; at the gate, waves return after whole steps and are exact."""
    case = pulses.case(pipe_model="delay-line", method="euler", courant=0.9)
    found = studies.order(case, levels=3)
    errors = [row.errors["main.pressure@0.37"]["L1"] for row in found.rows]
    assert found.kind == "exact" and errors[0] > 30.0 * errors[1] > 30.0**2 * errors[2]
    assert max(row.errors["gate.pressure"]["max"] for row in found.rows) < 1e-6


def test_a_run_exact_at_any_step_is_reported_as_exact():
    found = studies.order(main(4.0), levels=3)
    assert found.words.startswith("upwind on") and any(
        "exact here, at any step" in note for note in found.notes
    )
    with pytest.raises(
        FvsolveError, match="no delay line of this case into more stretches: there is no friction"
    ):
        studies.order(main(4.0), refine="space")
    with pytest.raises(FvsolveError, match="functions along pipes need cells, but main would be"):
        studies.order(main(4.0), source=lambda pipe, x, t: (0.0 * x, 0.0 * x))


def test_lines_next_to_cells_are_refined_with_them():
    case = fork(
        {"scheme": "upwind5", "method": "rk4", "courant": 0.9},
        every=0.0499,
        friction={"model": "steady", "factor": 0.05},
    )
    case["links"]["up"]["pipe_model"] = "auto"
    case["nodes"]["gate"]["demand"] |= {
        "time": [0.0, 0.5, 1.5],
        "value": [0.03, 0.03, 0.0],
        "kind": "smooth",
    }
    found = studies.order(case, levels=3)
    assert [row.level.cells for row in found.rows] == [5, 10, 20]
    errors = [row.errors["gate.pressure"]["L1"] for row in found.rows]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]


def test_a_chart_of_lines_is_judged_by_cells():
    """Shorter steps help until the error of friction remains; four times the stretches divide it by fourteen."""
    steps, methods = [0.013, 0.0031, 0.00078], ["euler"]
    found = studies.chart(rough(delay_tolerance=0.005), methods=methods, step=steps)
    assert (
        found.reference.startswith("upwind5 on")
        and found.floor["trajectory"] < 1e-6
        and found.default == "rk4"
    )
    errors = [point.trajectory for point in found.curves()["euler"]]
    assert errors[0] > 20.0 * errors[1] > 20.0 * errors[2]
    finer = studies.chart(rough(delay_tolerance=0.00125), methods=methods, step=[0.00078])
    assert finer.curves()["euler"][0].trajectory == pytest.approx(
        errors[2] * (11.0 / 41.0) ** 2, rel=0.2
    )
    other = turned(rough(delay_tolerance=0.005))
    other["output"]["probes"] = ["gate.pressure", "main.pressure@0.63"]
    two = studies.chart(other, methods=methods, step=steps[:2], jobs=2)
    shown = [point.trajectory for point in two.curves()["euler"]]
    assert shown == pytest.approx(errors[:2], rel=1e-8)


def test_a_chart_of_lines_has_steps_and_no_more():
    for asked in ({"schemes": ["upwind"]}, {"cells": [10]}, {"rtol": [1e-3]}):
        with pytest.raises(FvsolveError, match="; use step for their resolution"):
            studies.chart(rough(), **asked)
    with pytest.raises(FvsolveError, match="if delay lines are exact, any step is accurate"):
        studies.chart(main(2.0, every=0.0499), methods=["euler"], step=[0.05])


def test_a_chart_of_lines_next_to_cells_refines_the_cells():
    case = fork({"scheme": "upwind5", "method": "rk4", "courant": 0.9}, 2.0, every=0.0499)
    case["links"]["up"]["pipe_model"] = "delay-line"
    case["nodes"]["gate"]["demand"] |= {
        "time": [0.0, 0.5, 1.5],
        "value": [0.03, 0.03, 0.0],
        "kind": "smooth",
    }
    found = studies.chart(case, schemes=["upwind5"], methods=["rk4"], cells=[6, 12, 24])
    errors = [one.trajectory for one in found.curves()["upwind5 rk4"]]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2] and math.isfinite(
        found.floor["trajectory"]
    )
    assert "links.up.cells" not in found.points[0].setting.keys and found.default == "weno5 rk4"


def test_a_map_of_lines_states_the_least_step_of_growth_at_a_store():
    """A chamber that fills within 10 ms at a line of 0.1 s: the limit, and runs on both sides of it."""
    case = vessel("rk4", 0.01, 6.0, 0.15, 60)
    found = studies.failure_map(
        case, methods=["rk4", "implicit-midpoint", "rodas-5p"], steps=[0.0034, 0.0207, 0.068]
    )
    assert found.wave_rate is None and found.reference.startswith("upwind5")
    row = found.row("weno5", "implicit-midpoint")
    assert [one.step <= one.limit for one in row] == [True, False, False]
    assert [one.verdict == "blown up" for one in row] == [False, True, True]
    row = found.row("weno5", "rk4")  # explicit steps are divided beside lines
    assert [one.limit for one in row] == [math.inf] * 3 and [one.verdict for one in row] == [
        "stable"
    ] * 3
    assert found.row("weno5", "rodas-5p")[0].limit is None
    with pytest.raises(FvsolveError, match="Courant numbers need pipes with cells"):
        studies.failure_map(case, courants=[0.5])


def test_a_map_of_lines_without_stores_predicts_no_limit():
    case = main(2.0, every=0.0499)
    case["output"]["probes"] = ["gate.pressure"]
    found = studies.failure_map(case, methods=["euler"], steps=[0.03, 0.11])
    assert [one.verdict for one in found.squares] == ["stable", "stable"]
    assert all(math.isinf(one.limit) for one in found.squares)
    two = studies.failure_map(turned(case), methods=["euler"], steps=[0.03, 0.11], jobs=2)
    assert [one.measures.error for one in two.squares] == [
        one.measures.error for one in found.squares
    ]


# ----------------------------------------------------------------------------------------------------------------------
# Studies of moving cases: poles, impedances and energy balances against closed forms, and messages.


def poles(case) -> np.ndarray:
    return np.linalg.eigvals(np.asarray(linearise(case).a))


def test_a_free_body_about_its_middle_axis_has_the_poles_of_eulers_equations():
    """Poles +-w sqrt((I2 - I1) (I3 - I2) / (I1 I3)), one of them unstable; rows of A may be rounding alone."""
    stone = body(5.0, [0.3, 0.5, 0.7], {"kind": "free", "rate": [0.0, 2.0, 0.0]})
    found = poles(
        bodies({"stone": stone}, 1.0, ["stone.wy"], method="gauss-4", step=0.01) | {"gravity": 0.0}
    )
    wanted = 2.0 * math.sqrt(0.2 * 0.2 / (0.3 * 0.7))
    assert max(found.real) == pytest.approx(wanted, rel=1e-9) and min(found.real) == pytest.approx(
        -wanted, rel=1e-9
    )
    stone["joint"]["rate"] = [0.01, 2.0, 0.02]  # near the equilibrium; it can still be linearised
    found = poles(
        bodies({"stone": stone}, 1.0, ["stone.wy"], method="gauss-4", step=0.01) | {"gravity": 0.0}
    )
    assert max(found.real) == pytest.approx(wanted, rel=1e-3)


def test_a_tank_on_a_spring_has_the_pole_of_the_tangent_law():
    mass, stiff, length, depth = 100.0, 3e3, 2.0, 0.1
    c, water = math.sqrt(GRAVITY * depth), RHO * depth * length

    def law(w):
        s = 0.5 * w * length / c
        return stiff - mass * w * w - water * w * w * math.tan(s) / s

    w = brentq(law, 0.2, math.pi * c / length * 0.999)
    off = []
    for n in (20, 40):
        nodes = {
            "cart": body(mass, [1, 1, 1], {"kind": "prismatic", "axis": [1, 0, 0]}),
            "world": {"type": "frame", "points": {"far": [5.0, 0, 0]}},
            "b": {
                "type": "basin",
                "on": "cart",
                "size": [length, 1.0],
                "cells": [n, 1],
                "level": depth,
            },
        }
        spring = {
            "type": "spring",
            "from": "cart",
            "to": "world.far",
            "stiffness": stiff,
            "preload": 0.0,
        }
        found = poles(
            scene(
                nodes,
                {"spring": spring},
                1.0,
                {"scheme": "upwind5", "method": "rk4", "step": 0.01},
                ["cart.rate"],
            )
        )
        off.append(np.abs(found - 1j * w).min() / w)
    assert off[1] < 5e-5 and off[0] / off[1] > 3.5


def test_the_impedance_of_a_u_tube_on_its_hull_is_that_of_two_tanks_and_their_connection():
    """Impedance rho g / (A s) (s^2 + w^2) / (s^2 + 2 w^2), w^2 = g a / (A L)."""
    case = u_tube("dormand-prince", free=False)
    case["nodes"]["hull"]["joint"]["angle"] = {"mean": 0.0, "amplitude": 0.0, "period": 5.0}
    case["links"]["duct"]["minor_loss"] = 0.0
    found = response(case, "port")
    s = 1j * np.array([0.1, 0.3, 1.0, 2.0])
    square = GRAVITY * math.pi / 4 * 0.6**2 / (1.2 * 8.0)
    wanted = RHO * GRAVITY / (1.2 * s) * (s**2 + square) / (s**2 + 2.0 * square)
    assert found(s) == pytest.approx(wanted, rel=1e-6)


def test_the_ledger_of_energy_of_a_basin_with_a_wall_and_of_a_device_closes():
    """Rows of devices come after those of basins; a valve joins a basin with a moving wall to a tank."""
    parts = []
    for step in (8e-3, 4e-3):
        found = energy(flume("ssp-rk3"), {"numerics.step": step})
        parts.append(float(np.abs(found.step).max()))
    assert (
        {"b.paddle"} <= {*found.supplied}
        and {"tap"} <= {*found.dissipated}
        and {"t"} <= {*found.stored}
    )
    passed = max(
        np.abs(one).max() for one in [*found.supplied.values(), *found.dissipated.values()]
    )
    assert found.dissipated["tap"][-1] > 1e-4 * passed
    assert parts[1] < parts[0] / 5.0 and parts[1] < 1e-3 * passed


def test_a_map_names_the_probe_that_its_reference_does_not_know():
    case = SCENES["loop"]("rk4")
    case["output"]["probes"] = ["one.angle", "loop.gap"]
    with pytest.raises(
        FvsolveError, match="of the range of loop.gap.*remove this probe from output.probes"
    ):
        failure_map(case, methods=["rk4"], steps=[4e-3])


def test_a_basin_too_large_to_be_predicted_is_measured_and_drawn_no_spectrum(
    tmp_path, fvs, monkeypatch
):
    monkeypatch.setattr(import_module("fvsolve.studies.work_limit"), "TIME_LIMIT", 0.0)
    pool = {
        "type": "basin",
        "size": [1.0, 1.0],
        "cells": [20, 20],
        "level": 0.3,
        "start": {"level": "0.3 + 0.001 * x"},
    }
    case = scene(
        {"b": pool},
        {},
        1.0,
        {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.5},
        ["b.depth@0.1,0.1"],
    )
    (tmp_path / "pool.toml").write_text(write(case))
    code, said, error = fvs(
        "stability", tmp_path / "pool.toml", "--steps", 20, "--out", tmp_path / "out"
    )
    assert code == 0 and "give pipes or basins fewer cells" in said + error
    assert "1e4 / ||J||" not in said + error


# ----------------------------------------------------------------------------------------------------------------------
# Common features of studies: a path as case, progress without a terminal, and `--set` with `--method`.


def levels() -> dict:
    """Case of two tanks that an orifice joins."""
    nodes = {"a": tank(1.0, 3.0), "b": tank(1.0, 2.0)}
    hole = {"type": "orifice", "from": "a", "to": "b", "diameter": 0.1, "loss_coefficient": 2.0}
    return scene(nodes, {"hole": hole}, 20.0, {"method": "euler", "step": 0.1}, ["a.level"], 0.5)


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "levels.toml"
    file.write_text(write(levels()))
    return file


def test_a_map_takes_a_path(path):
    found = failure_map(str(path), methods=["rk4"], steps=[0.1])
    assert [one.verdict for one in found.squares] == ["stable"]


def test_without_a_terminal_a_study_prints_its_place_at_intervals(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "PROGRESS_INTERVAL", 1e-3)
    with terminal.progress_line() as progress:
        progress(3, 9, "upwind with rk4")
        latest = time.monotonic() + 5.0
        said = ""
        while not said and time.monotonic() < latest:
            time.sleep(2e-3)
            said = capsys.readouterr().err
    assert said.splitlines()[0] == "3 of 9: upwind with rk4"


def test_without_a_terminal_a_run_prints_its_place_and_the_remaining_time_at_intervals(
    path, capsys
):
    with terminal.run_progress(fvsolve.load(path)) as progress:
        for t, seconds, steps in (
            (0.0, 0.0, 0),
            (1.0, 9.0, 40),
            (2.0, 20.0, 80),
            (2.5, 31.0, 700),
            (2.5, 50.0, 900),
        ):
            progress(t, seconds, steps)
    lines = [line.partition(" of ")[0::2] for line in capsys.readouterr().err.splitlines()]
    end = fvsolve.load(path).numerics.end
    left = [(end - 2.0) * 10.0, (end - 2.5) * 22.0, math.inf]
    assert [at for at, _ in lines] == ["t = 2 s", "t = 2.5 s", "t = 2.5 s"]
    assert [rest.partition("; ")[2] for _, rest in lines] == [
        f"about {one:.2g} s left at this pace" for one in left
    ]


def test_a_line_of_progress_is_not_repeated_unchanged(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "PROGRESS_INTERVAL", 1e-3)
    with terminal.progress_line() as progress:
        for done in (3, 4):
            progress(done, 9, "rk4")
            time.sleep(0.1)
    assert capsys.readouterr().err.splitlines() == ["3 of 9: rk4", "4 of 9: rk4"]


@pytest.mark.parametrize("study", ["order", "failure-map", "stability"])
def test_a_setting_that_belongs_to_the_requested_method_is_read_with_it(fvs, path, study):
    own = ["--set", "numerics.rtol=1e-5", "--method", "dormand-prince"]
    columns = ["--step", "0.1"] if study == "failure-map" else []
    code, _, said = fvs(study, path, *own, *columns)
    assert "rtol" not in said and code == 0, said


def test_a_setting_that_belongs_to_no_requested_method_is_refused(fvs, path):
    code, _, said = fvs("stability", path, "--set", "numerics.rtol=1e-5", "--method", "rk4")
    assert code == 2 and "rtol" in said
