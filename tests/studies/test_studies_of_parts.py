"""Studies of cases with devices, vessels and cavities."""

from importlib import import_module

import numpy as np
import pytest
from reference import pump_trip
from reference.folders import CASES

import fvsolve
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
from fvsolve.studies.failure_map import NOT_RUN, Measures, run_recorded, verdict
from fvsolve.studies.failure_map_columns import eigenvalues_of
from fvsolve.studies.linearise import linearise
from fvsolve.studies.outcome import GIVEN_UP, outcome
from fvsolve.studies.reference import candidates, find_reference
from fvsolve.studies.result_cache import ResultCache
from fvsolve.studies.stability import stability as room
from fvsolve.studies.stability.growth import TooLarge
from fvsolve.studies.stability.stability import stability


def case(name, **numerics):
    """Shipped case with changed keys, in which double underscores are dots."""
    return fvsolve.load(CASES / f"{name}.toml", {key.replace("__", "."): value for key, value in numerics.items()})


# stability ------------------------------------------------------------------------------------------------------


def test_two_runs_of_a_scene_with_events_keep_apart_what_has_shut_in_each():
    (row,) = stability(case("check-valve-slam", links__main__cells=20), at=3.8, steps=200).rows
    assert abs(row.difference) < 0.01


def test_a_state_that_moves_is_named_where_prediction_and_measurement_differ_and_at_rest_they_do_not():
    (moves,) = stability(case("surge-tank")).rows
    assert abs(moves.difference) > 0.1 and any("the state leaves the linearised state" in note for note in moves.notes)
    (rests,) = stability(case("surge-tank", links__tunnel__initial_flow=0.0, nodes__shaft__level=50.0)).rows
    assert abs(rests.difference) < 1e-3


def test_pipes_with_cavities_are_measured_beside_what_upwind_predicts():
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

    few = case("surge-tank", links__tunnel__type="pipe", links__tunnel__wave_speed=1000.0, links__tunnel__cells=20)
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
    units = dict(zip((state.rsplit(".", 1)[1] for state in found.states), found.state_units, strict=True))
    assert states.items() <= units.items()


# checks before a run --------------------------------------------------------------------------------------------


def test_check_names_the_pipe_that_sets_the_step_and_knows_what_cavities_cost():
    cavities, plain = (fvsolve.build(case(name)).checks for name in ("adelaide", "pump-trip"))
    assert cavities["step_set_by"].startswith("links.main:")
    cost = [one["expected_seconds"] / one["steps"] / one["cells"] for one in (cavities, plain)]
    assert cost[0] > 5.0 * cost[1]


# order ----------------------------------------------------------------------------------------------------------


def test_an_order_that_would_take_long_begins_on_fewer_cells_and_says_so(monkeypatch, tmp_path):
    few = case("relief-on-closed-main", links__main__cells=64)
    whole = affordable_plan(few, None, None, 3, None, "auto", None)
    assert [level.cells for level in whole.levels] == [64, 128, 256] and "begun" not in whole.words
    monkeypatch.setattr(refine, "CPU_BUDGET", 1e-6)
    made = affordable_plan(few, None, None, 3, None, "auto", ResultCache(tmp_path))
    assert [level.cells for level in made.levels] == [8, 16, 32] and "starts with 8 of 64 cells" in made.words
    assert affordable_plan(few, None, None, 3, 50, "auto", None).levels[0].cells == 50
    monkeypatch.undo()
    assert affordable_plan(few, None, None, 3, None, "auto", ResultCache(tmp_path)) == made  # continued study


def test_errors_that_fall_quicker_than_scheme_and_method_can_make_them_are_said_to_show_no_order():
    sizes = [2.0**-k for k in range(5)]
    assert "not the order of the method" in check_order(fit(sizes, [h**8 for h in sizes]), 4.0).note
    assert not check_order(fit(sizes, [h**4 for h in sizes]), 4.0).note


def test_with_cavities_a_reference_is_finer_by_the_scheme_that_follows_them():
    (_, trials), *_ = candidates(case("adelaide", links__main__cells=10), True, "both", False)
    assert trials[-1]["numerics.scheme"] == "muscl" and trials[-1]["links.main.cells"] == 40


# chart ----------------------------------------------------------------------------------------------------------


def test_a_chart_leaves_out_what_does_not_follow_cavities():
    found, coarse = case("adelaide"), CoarseRun(25, 800.0, 800, [1e6], 0.0)
    made = chart_settings(found, coarse, None, None, [50], None, None)
    assert {one.scheme for one in made} == {"upwind", "muscl"} and default_curve(found) == "muscl rk4"
    assert unsupported_schemes(found, None) == ["upwind5", "weno5"] and not unsupported_schemes(found, ["weno5"])
    assert not unsupported_schemes(case("pump-trip"), None)


def test_with_cavities_both_references_of_a_chart_can_be_run():
    few = case("adelaide", links__main__cells=8)
    found = [outcome(few, keys[0]).ok for _, keys in candidates(few, False, "both", False)]
    assert found == [True, True]


def test_the_work_of_a_chart_counts_pipes_of_one_cell_once():
    found = case("pump-trip")
    assert run_work(found, 400) == pytest.approx(4 * run_work(found, 200))
    assert run_work(case("net3-pump-trip"), 400) < 3 * run_work(case("net3-pump-trip"), 200)


def test_a_chart_of_dear_rates_has_fewer_cells():
    cheap, dear = (CoarseRun(25, 800.0, 800, [8e6, 2e6, 5e5, 1e5], 0.0, dearness).levels for dearness in (1.0, 30.0))
    assert max(dear) < max(cheap) and len(dear) == len(cheap)


# models ---------------------------------------------------------------------------------------------------------


def test_what_acts_on_a_pump_that_trips_is_its_run_down():
    model = fvsolve.build(case("pump-trip", links__main__cells=10))
    pump = model.case.links["pump"]
    torque = pump_trip.torque(1.0, 46.658e-3)
    assert change_time(model) == pytest.approx(pump.inertia * pump.rated_speed / torque, rel=0.05)


def test_a_vessel_is_not_said_by_a_volume():
    with pytest.raises(NotApplicable, match="a volume at top would replace the air-valve"):
        level_keys(case("air-valve"), "lumped volume")
    with pytest.raises(NotApplicable, match="all ends of the pipes are reservoirs"):
        level_keys(case("pump-trip-air-vessel"), "column and volume")


def test_a_law_that_takes_long_is_not_tried_on_more_cells(monkeypatch):
    monkeypatch.setattr(model_hierarchy, "LEVEL_CPU_LIMIT", 0.0)
    with pytest.raises(
        FvsolveError, match="the case itself does not run: not run: the run with 1 cell was already given up"
    ):
        model_hierarchy.ladder(case("relief-on-closed-main", links__main__cells=4, numerics__courant=0.001))


# map ------------------------------------------------------------------------------------------------------------


def test_a_map_of_cavities_has_a_reference_and_a_limit():
    few = case("adelaide", links__main__cells=8)
    found = find_reference(few)
    assert found.words.startswith("muscl van-leer on 32 cells") and 0.0 < found.uncertainty.trajectory < 1.0
    assert np.array_equal(eigenvalues_of(few, {}), eigenvalues_of(few, {"numerics.scheme": "upwind"}))


def test_a_square_that_takes_too_long_is_given_up_and_called_neither_wrong_nor_blown_up(monkeypatch):
    late, off = Measures(f"{GIVEN_UP} 10 s", False), Measures("finished", True, error=0.5, farthest=0.0)
    assert verdict(late, lambda: off, 0.02) == verdict(off, lambda: late, 0.02) == NOT_RUN
    monkeypatch.setattr(import_module("fvsolve.studies.failure_map"), "CPU_LIMIT", 0.0)
    found, _ = run_recorded(case("relief-on-closed-main", links__main__cells=4))
    assert found.reason.startswith(GIVEN_UP) and not found.ok
