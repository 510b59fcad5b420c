"""Error bands of peaks contain the known error, and state no order where none is observed."""

import csv
import json

import numpy as np
import pytest
from reference.pump_stations import station
from reference.scenes import area, junction, lake, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.report.report_files import write_report
from fvsolve.studies import scenarios
from fvsolve.studies.peak_error import (
    between_rows,
    differing_events,
    greatest_error,
    peak_errors,
    troughs,
)
from fvsolve.studies.resolution import refined_keys
from fvsolve.studies.sizing import size


@pytest.mark.parametrize(
    "name", ["accumulator", "gradual-closure", "closed-cylinder", "three-way-junction", "four-bar"]
)
def test_bands_of_shipped_cases_contain_the_result_of_four_times_the_resolution(name: str) -> None:
    case = fvsolve.load(name)
    said = peak_errors(fvsolve.run(case), case)
    peaks = said["peaks"]
    fine = fvsolve.run(
        case, set=refined_keys(case, 4.0) | {"output.every": case.output.every / 4.0}
    )
    for probe, one in peaks.items():
        for side, value in (
            ("minimum", fine.extremes[probe].minimum),
            ("maximum", fine.extremes[probe].maximum),
        ):
            assert abs(value - one[side]["value"]) <= one[side]["error"], (probe, side)
    for claim, one in zip(said["expectations"], fine.expectations, strict=True):
        assert abs(claim["found"] - one.found) <= claim["error"], claim["text"]


def test_where_liquid_parts_no_order_is_believed() -> None:
    """Pumping main after a trip: three grids show order two, but four times the resolution is outside its band."""
    trip = {"links.pump.trip": 1.0, "links.main.cells": 60, "numerics.end": 14.0, "expect": {}}
    way = {
        "fluid.law": "mixture",
        "fluid.cavitation": True,
        "numerics.scheme": "muscl",
        "numerics.courant": 0.9,
    }
    case = fvsolve.load("pumping-main", set=trip | way)
    said = peak_errors(fvsolve.run(case), case)
    fine = fvsolve.run(case, set={"links.main.cells": 240})
    assert said["cavities"] and "column separation" in said["resolution"]["words"]
    for probe, one in said["peaks"].items():
        assert one["maximum"]["order"] is one["minimum"]["order"] is None
        assert (
            abs(fine.extremes[probe].maximum - one["maximum"]["value"]) <= one["maximum"]["error"]
        ), probe


def throttled(**more) -> dict:
    nodes = {
        "lake": lake(100.0, elevation=0.0),
        "gate": junction(elevation=0.0),
        "air": reservoir(1e5, elevation=0.0),
    }
    links = {
        "main": pipe("lake", "gate", 900.0, 0.4, 1000.0, 30),
        "tap": valve("gate", "air", 0.02 * area(0.4), ramp(0.5, 1.0, 1.0, 0.0)),
    }
    return scene(nodes, links, 4.0, {"scheme": "muscl", "courant": 0.8}, ["gate.pressure"], **more)


def test_the_command_states_the_errors_of_peaks_and_verdicts(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = throttled(
        limits={"top": {"on": "main", "quantity": "gauge_pressure", "maximum": "13 bar"}}
    )
    (tmp_path / "scene.toml").write_text(fvsolve.load(case).resolved())
    status, text, _ = fvs("run", "scene.toml", "--estimate-error", "--no-pictures")
    assert status in (0, 1) and "+-" in text and "times the resolution" in text and "within" in text
    said = json.loads((tmp_path / "runs" / "scene" / "summary.json").read_text())
    peak, verdict = said["peaks"]["gate.pressure"]["maximum"], said["verdicts"][0]
    assert peak["value"] == said["extremes"]["gate.pressure"]["maximum"]
    # of the whole pipe, which errs more
    assert peak["error"] <= verdict["error"] <= 0.01 * verdict["value"]
    fine = fvsolve.run(case, set=refined_keys(fvsolve.load(case), 8.0))
    assert abs(fine.extremes["gate.pressure"].maximum - peak["value"]) <= peak["error"]
    assert abs(fine.verdicts[0].value - verdict["value"]) <= verdict["error"]
    assert fvsolve.open_run(tmp_path / "runs" / "scene").verdicts[0].error == verdict["error"]
    assert "+-" not in fvs("run", "scene.toml", "--out", "plain", "--no-pictures")[1]
    # margin over error
    shares = ((0.5, "open", 1), (2.0, "holds", 0), (-0.5, "open", 1), (-2.0, "fails", 1))
    for k, (share, state, wanted) in enumerate(shares):
        limit = f"limits.top.maximum={verdict['value'] + share * verdict['error']!r} Pag"
        status, text, _ = fvs(
            "run",
            "scene.toml",
            "--estimate-error",
            "--no-pictures",
            "--set",
            limit,
            "--out",
            f"{k}",
        )
        (one,) = fvsolve.open_run(tmp_path / f"{k}").verdicts
        assert (one.state, status) == (state, wanted) and ("its margin is smaller" in text) == (
            state == "open"
        )


def test_a_finer_case_is_finer_in_all_that_has_a_resolution() -> None:
    case = fvsolve.load(throttled())
    assert refined_keys(case, 2.0) == {"links.main.cells": 60}
    stepped = fvsolve.load(case, {"numerics.step": "2 ms"})
    assert refined_keys(stepped, 2.0) == {"links.main.cells": 60, "numerics.step": 0.001}
    line = fvsolve.load(case, {"numerics.pipe_model": "delay-line", "numerics.rtol": 1e-5})
    assert refined_keys(line, 0.5) == {
        "numerics.rtol": 4e-5,
        "numerics.delay_tolerance": 0.02,
        "links.main.cells": 15,
    }
    line = fvsolve.load(case, {"numerics.pipe_model": "delay-line", "numerics.courant": 0.9})
    assert refined_keys(line, 2.0) == {
        "numerics.courant": 0.45,
        "numerics.delay_tolerance": 0.005,
    }  # its steps follow courant


def two_pipes(limits: dict) -> dict:
    """Case of a line that closes by 70 % behind an air vessel; its late trough is deeper on finer cells."""
    nodes = {
        "lake": lake(87.473, elevation=0.0),
        "end": junction(elevation=0.0),
        "j": {
            "type": "accumulator",
            "volume": 0.116436,
            "gas_volume": 0.0103807,
            "elevation": 0.0,
            "connection": {"diameter": 0.1, "loss_in": 2.0, "loss_out": 2.0},
        },
        "out": reservoir(101325.0, elevation=0.0),
    }
    factors = ({"model": "quasi-steady", "factor": one} for one in (0.0153954, 0.0200779))
    links = {
        "a": pipe("lake", "j", 429.123, 0.15, 1127.6, 88, friction=next(factors)),
        "b": pipe("j", "end", 852.191, 0.4, 1176.878, 50, friction=next(factors)),
        "v": valve("end", "out", 0.61 * 0.003315159, ramp(0.2, 0.02, 1.0, 0.3)),
    }
    return scene(nodes, links, 5.505426, {}, ["end.pressure"], 0.02, limits=limits)


def test_a_trough_that_finer_cells_deepen_leaves_a_limit_open() -> None:
    """On three resolutions the start is the minimum; on eight times the cells a later trough is 31 kPa lower."""
    case = two_pipes({"low": {"on": "end", "quantity": "pressure", "minimum": "6.3 bar"}})
    said = peak_errors(fvsolve.run(case), fvsolve.load(case))
    peak, (verdict,) = said["peaks"]["end.pressure"]["minimum"], said["verdicts"]
    fine = (
        fvsolve.run(case, set=refined_keys(fvsolve.load(case), 8.0))
        .extremes["end.pressure"]
        .minimum
    )
    assert (
        said["extremes"]["end.pressure"]["t_min"] == 0.0
        and fine < 6.2e5 < verdict["limit"] < peak["value"]
    )
    assert peak["value"] - fine < peak["error"] and verdict["state"] == "open"


def stub(cells: int, opening: dict, beside: int = 100, **more) -> dict:
    """Case of a valve behind a short pipe of few cells at the end of a long pipe."""
    nodes = {"lake": lake(50.0), "j": junction(), "gate": junction(), "out": reservoir(101325.0)}
    links = {
        "main": pipe("lake", "j", 1000.0, 0.3, 1000.0, beside),
        "short": pipe("j", "gate", 8.0, 0.15, 1000.0, cells),
        "v": valve("gate", "out", 0.61e-3, opening),
    }
    return scene(
        nodes, links, 4.0, {"pipe_model": "finite-volume"}, ["gate.head", "main.head@0.5"], **more
    )


def test_a_single_cell_cannot_be_halved() -> None:
    case = stub(
        1,
        ramp(0.5, 0.0, 1.0, 0.0),
        limits={"low": {"on": "gate", "quantity": "head", "minimum": 0.0}},
    )
    said = peak_errors(fvsolve.run(case), fvsolve.load(case))
    assert (
        said["peaks"]["gate.head"]["minimum"]["error"] is None
        and said["verdicts"][0]["state"] == "open"
    )
    assert said["peaks"]["main.head@0.5"]["minimum"]["error"] > 0.0
    assert any("links.short.cells = 4" in text for text in said["resolution"]["reasons"])


def test_a_pipe_shorter_than_an_adjacent_cell_is_not_known() -> None:
    """The long pipe smears the wave over more than the short pipe, for any cells of it: 22.3 m instead of -63.54 m."""
    case = stub(8, ramp(0.5, 0.0, 1.0, 0.0))
    said = peak_errors(fvsolve.run(case), fvsolve.load(case))
    assert said["peaks"]["gate.head"]["minimum"]["error"] is None
    assert any("links.main.cells = 500" in text for text in said["resolution"]["reasons"])
    case["links"]["main"]["cells"], case["links"]["short"]["cells"] = 500, 4
    said = peak_errors(fvsolve.run(case), fvsolve.load(case))
    peak = said["peaks"]["gate.head"]["minimum"]
    assert abs(peak["value"] + 63.54) <= peak["error"] and "differences of" in peak["reason"]
    assert not any("faster than a cell" in text for text in said["resolution"]["reasons"])


def slamming(at: float) -> dict:
    """Case of a pump trip with a check valve that slams before a vessel at chainage `at` [m] of the main."""
    case = station(at)
    case["nodes"]["header"] = junction(elevation=0.0)
    del case["links"]["flap"]["area"]
    case["links"]["flap"] |= {
        "diameter": 0.4,
        "loss_coefficient": 1.5,
        "deceleration": {"rate": [0, 5, 15], "reverse_velocity": [0, 0.3, 1.0]},
    }
    case["numerics"]["end"] = 4.0
    case["output"]["probes"] = ["out.pressure", "main.pressure@0.5", "flap.flow"]
    return case | {"limits": {"high": {"on": "main", "quantity": "pressure", "maximum": 8.5e5}}}


def test_every_peak_with_a_wide_or_unknown_error_has_a_reason() -> None:
    """Law log has no delay lines as a reference."""
    case = slamming(20.0)
    case["fluid"] = dict(case["fluid"], law="log")
    said = peak_errors(fvsolve.run(case), fvsolve.load(case))
    found = said["peaks"]
    assert found["out.pressure"]["maximum"]["error"] is None
    assert "links.main-1.cells = 4" in found["out.pressure"]["maximum"]["reason"]
    wide = found["flap.flow"]["minimum"]
    assert wide["error"] > 0.05 * (found["flap.flow"]["maximum"]["value"] - wide["value"])
    assert wide["reason"].startswith("this estimate exceeds the range of the signal")
    assert (
        "flap (2, 2, " in wide["reason"]
        and "main-1 has 1 cell beside flap, vessel" in wide["reason"]
    )
    assert found["main.pressure@0.5"]["maximum"]["reason"] is None
    row = said["verdicts"][0]
    assert row["state"] == "open" and row["reason"] == next(one["reason"] for one in row["worst"])
    assert any("high at main-1" in text for text in said["resolution"]["reasons"])


def test_wide_errors_of_few_cells_name_the_differences_that_make_them() -> None:
    case = stub(6, ramp(0.5, 0.02, 1.0, 0.0), beside=600)
    said = peak_errors(fvsolve.run(case), fvsolve.load(case))["peaks"]["gate.head"]
    assert any(
        "m between resolutions" in (said[side]["reason"] or "")
        and "more cells" in said[side]["reason"]
        for side in ("minimum", "maximum")
    )


def test_a_pulse_that_no_cell_shows_is_not_known() -> None:
    opening = {"time": [0.5, 0.502, 0.506], "value": [1.0, 0.1, 0.8], "kind": "linear"}
    opening["time"] = [0.5, 0.501, 0.5015]
    said = peak_errors(fvsolve.run(stub(4, opening, 500)), fvsolve.load(stub(4, opening, 500)))
    assert said["peaks"]["gate.head"]["maximum"]["error"] is None
    assert "links.v.opening" in said["resolution"]["reasons"][0]
    opening["time"] = [0.5, 0.54, 0.6]
    said = peak_errors(fvsolve.run(stub(4, opening, 500)), fvsolve.load(stub(4, opening, 500)))
    assert said["peaks"]["gate.head"]["maximum"]["error"] > 0.0


def test_events_that_differ_between_resolutions_are_named() -> None:
    runs = {
        times: Finished([{"name": "nrv"}] * many + [{"name": "pump"}])
        for times, many in ((0.5, 2), (1.0, 2), (2.0, 150))
    }
    assert differing_events(runs) == [
        "numbers of events differ between resolutions: nrv (2, 2, 150)"
    ]


class Finished:
    """Result of a finished run with events."""

    reason = "finished"

    def __init__(self, events: list) -> None:
        self.summary = {"events": events}


class Rows(dict):
    """Rows of probes at the times t, like those of a Result."""

    t = np.arange(8.0)


@pytest.mark.parametrize("side, sign", [("minimum", 1.0), ("maximum", -1.0)])
def test_a_parabola_passes_its_rows_by_at_most_an_eighth_of_the_second_difference(side, sign):
    """Its vertex is 0; halfway between two rows it is farthest from them, by the whole bound."""
    for vertex in (3.5, 3.2, 4.0):
        rows = Rows(p=sign * (Rows.t - vertex) ** 2)
        bound = between_rows(rows, "p", side)
        assert bound == pytest.approx(0.25)
        assert np.abs(rows["p"]).min() <= bound * (1.0 + 1e-12)
    assert between_rows(Rows(p=sign * Rows.t), "p", side) == 0.0  # the first or last row


# ----------------------------------------------------------------------------------------------------------------------
# Estimated errors of extremes contain the known error, whichever local maximum becomes the greatest.


def triple(
    order: float, coefficient: float = 0.1, exact: float = 3.0
) -> tuple[float, float, float]:
    return tuple(exact + coefficient * h**order for h in (2.0, 1.0, 0.5))


@pytest.mark.parametrize("order", [0.5, 0.7, 1.0, 1.3, 2.0, 3.0, 5.0])
@pytest.mark.parametrize("coefficient", [0.1, -0.02])
def test_it_holds_the_error_of_any_order(order: float, coefficient: float) -> None:
    found = greatest_error([], triple(order, coefficient))
    assert found >= abs(coefficient) * (1.0 - 1e-9)
    if 0.75 <= order <= 2.0:
        assert found == pytest.approx(2.15 * abs(coefficient), rel=1e-2)


def test_where_no_order_is_believed_it_is_that_of_three_quarters() -> None:
    """Without an order: 2.15 / (1 - 0.6) times the later difference, or times 0.6 of the earlier if that is greater."""
    assert greatest_error([], triple(2.0), believed=False) == pytest.approx(2.15 / 0.4 * 0.6 * 0.3)
    # differences alternate
    assert greatest_error([], (1.0, 1.2, 1.1)) == pytest.approx(2.15 / 0.4 * 0.1)
    # differences grow
    assert greatest_error([], (1.0, 1.1, 1.3)) == pytest.approx(2.0 * 2.15 / 0.4 * 0.2)
    assert greatest_error([], (1.1, 1.2)) == pytest.approx(2.15 / 0.4 * 0.1)  # two resolutions
    assert greatest_error([], (1.0, 1.0, 1.0)) == 0.0


def crests(heights: tuple[float, ...], width: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a signal with a crest at each whole second."""
    t = np.linspace(0.0, len(heights) + 1.0, 2001)
    return t, sum(h * np.exp(-(((t - k - 1.0) / width) ** 2)) for k, h in enumerate(heights))


def test_a_crest_that_finer_cells_raise_above_the_greatest_is_in_the_error() -> None:
    """The first crest stays at 1, and the second rises to 1.1 at order one: 1.1 minus 0.8, 0.4 and 0.2."""
    signals = [crests((1.0, h)) for h in (0.3, 0.7, 0.9)]
    assert greatest_error([], (1.0, 1.0, 1.0)) == 0.0
    assert 0.1 <= greatest_error([signals], (1.0, 1.0, 1.0)) <= 0.6
    settled = [crests((1.0, h)) for h in (0.3, 0.31, 0.311)]
    assert greatest_error([settled], (1.0, 1.0, 1.0)) < 0.01


def test_of_places_the_greatest_counts_that_any_may_reach() -> None:
    still, rising = [crests((1.0,))] * 3, [crests((h,)) for h in (0.3, 0.7, 0.9)]
    assert 0.1 <= greatest_error([still, rising], (1.0, 1.0, 1.0)) <= 0.6


def test_a_crest_that_is_lower_on_finer_cells_does_not_rise_above() -> None:
    signals = [crests((1.0, h)) for h in (0.99, 0.9, 0.8)]
    assert greatest_error([signals], (1.0, 1.0, 1.0)) < 0.03


def test_a_crest_that_moves_has_not_come_to_its_height() -> None:
    """The greatest value hardly changes, but the signals differ more where each of them is greatest."""
    t = np.linspace(0.0, 3.0, 3001)
    signals = [(t, np.exp(-((t - at) ** 2))) for at in (1.0, 1.2, 1.3)]
    found = greatest_error([signals], (1.0, 1.002, 1.004))
    assert found >= 1.0 - np.exp(-(0.1**2)) > 0.002 * 2.0


def test_troughs_part_maxima_that_rise_enough() -> None:
    t, v = crests((1.0, 0.5, 0.7))
    assert t[troughs(v, 0.1)] == pytest.approx([1.5, 2.5], abs=0.1)
    assert troughs(v, 0.8) == [] and troughs(np.ones(5), 0.0) == []
    # start of a flat trough
    assert troughs(np.array([0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 1.0]), 0.5) == [3]


# ----------------------------------------------------------------------------------------------------------------------
# Each bound and each place of a limit has its own error: a certain bound does not hide an uncertain bound.


# [m], below the head at the start everywhere: its margin is the least, and does not depend on cells
SURE = 49.5
NEAR = 166.3  # [m], above the peak that the cells of the short pipe show, by less than its error


def short_pipe(on: object = "gate", **bounds: float) -> dict:
    """Case of a quick closure behind a short pipe, whose cells miss most of the peak."""
    nodes = {
        "lake": lake(50.0),
        "j": junction(elevation=0.0),
        "gate": junction(elevation=0.0),
        "out": reservoir(101325.0, elevation=0.0),
    }
    links = {
        "main": pipe("lake", "j", 1000.0, 0.3, 1000.0, 100),
        "short": pipe("j", "gate", 25.0, 0.15, 1000.0, 2),
        "tap": valve("gate", "out", 0.61e-3, ramp(0.5, 0.03, 1.0, 0.0)),
    }
    limits = {"heads": {"on": on, "quantity": "head", **bounds}}
    return scene(nodes, links, 0.56, {"pipe_model": "finite-volume"}, ["gate.head"], limits=limits)


def judged(case: dict) -> dict:
    """First verdict of a run with estimated errors."""
    return peak_errors(fvsolve.run(case), fvsolve.load(case))["verdicts"][0]


def test_a_sure_bound_that_is_nearer_hides_none_that_is_open() -> None:
    alone, both = judged(short_pipe(maximum=NEAR)), judged(short_pipe(maximum=NEAR, minimum=SURE))
    assert alone["state"] == both["state"] == "open" and not both["ok"]
    rows = {row["bound"]: row for row in both["worst"]}
    assert rows["minimum"]["margin"] < rows["maximum"]["margin"] < rows["maximum"]["error"]
    assert (
        rows["minimum"]["state"] == "holds" and rows["minimum"]["error"] < rows["minimum"]["margin"]
    )
    assert (
        both["bound"] == "maximum" and both["error"] == alone["error"] == rows["maximum"]["error"]
    )
    sure = judged(short_pipe(minimum=SURE))
    assert sure["state"] == "holds" and sure["error"] == rows["minimum"]["error"]


def with_still_water(case: dict, many: int = 1) -> dict:
    """Case with dead ends at the lake, so deep that their pressure head is nearer to the limit than the peak."""
    for k in range(many):
        case["nodes"][f"deep{k}"] = junction(elevation=-115.9)
        case["links"][f"still{k}"] = pipe("lake", f"deep{k}", 200.0, 0.3, 1000.0, 20)
    case["limits"]["heads"] = {
        "on": ["gate", *(f"deep{k}" for k in range(many))],
        "quantity": "pressure_head",
        "maximum": NEAR,
    }
    return case


def test_still_water_hides_no_place_with_cells_that_miss_the_peak() -> None:
    found = judged(with_still_water(short_pipe()))
    rows = {row["place"]: row for row in found["worst"]}
    assert rows["deep0"]["margin"] < rows["gate"]["margin"] and rows["deep0"]["state"] == "holds"
    assert (found["state"], found["place"], rows["gate"]["state"]) == ("open", "gate", "open")


def test_a_limit_passed_fails_whatever_another_place_may_do() -> None:
    found = judged(short_pipe(maximum=NEAR, minimum=50.5))
    assert (found["state"], found["bound"]) == ("fails", "minimum")


def test_a_run_read_back_is_judged_as_a_run_in_memory(tmp_path) -> None:
    """The run directory keeps ten places of a limit; here only an eleventh place is open."""
    case = with_still_water(short_pipe(), 12)
    fvsolve.run(case, out=tmp_path / "run", pictures=False)
    back = fvsolve.open_run(tmp_path / "run")
    assert "gate" not in {row["place"] for row in back.summary["verdicts"][0]["worst"]}
    found = peak_errors(back, fvsolve.load(case))["verdicts"][0]
    assert (found["state"], found["place"]) == ("open", "gate")


def test_run_report_and_study_state_the_same(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(write(short_pipe(maximum=NEAR, minimum=SURE)))
    status, text, _ = fvs("run", "short.toml", "--estimate-error", "--no-pictures", "--out", "run")
    assert status == 1 and "OPEN, because its margin is smaller than its error: heads" in text
    said = json.loads((tmp_path / "run" / "summary.json").read_text())["verdicts"][0]
    assert (said["state"], said["ok"], said["bound"]) == ("open", False, "maximum")
    page = write_report(tmp_path / "run", tmp_path / "run.html", False)[0].read_text()
    assert "The verdict of a limit is open" in page
    (tmp_path / "two.toml").write_text(
        'case = "short.toml"\nestimate_error = true\n[events.close]\n'
    )
    found = scenarios.study(tmp_path / "two.toml", tmp_path / "out")
    row = json.loads((tmp_path / "out" / "study.json").read_text())["runs"][0]["verdicts"][0]
    assert row["state"] == "open" and not found.ok and found.holds == []
    (line,) = csv.DictReader((tmp_path / "out" / "study.csv").open())
    assert line["heads state"] == "open"


def test_a_study_gives_the_reason_of_unknown_errors_and_the_remedy(
    fvs, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    case = short_pipe(maximum=NEAR)
    case["links"]["short"]["cells"] = 1
    (tmp_path / "short.toml").write_text(write(case))
    (tmp_path / "two.toml").write_text(
        'case = "short.toml"\nestimate_error = true\n[events.close]\n'
    )
    _, text, _ = fvs("study", "two.toml", "--out", "out")
    assert "close: error of gate.head, heads at gate: " in text and "links.short.cells = 4" in text
    row = json.loads((tmp_path / "out" / "study.json").read_text())["runs"][0]
    assert (
        "links.short.cells = 4" in row["verdicts"][0]["reason"]
        and row["verdicts"][0]["state"] == "open"
    )
    assert row["peaks"]["gate.head"]["maximum"]["reason"] in row["resolution"]["reasons"][0]
    page = write_report(tmp_path / "out" / "close", tmp_path / "close.html", False)[0].read_text()
    assert "links.short.cells = 4" in page


def test_a_size_holds_its_limits_by_more_than_their_errors() -> None:
    """With errors, the least closing time is longer: quick closures are open before they fail."""
    case = short_pipe(maximum=NEAR, minimum=SURE)
    case["nodes"]["lake"]["head"] = 50.0
    span = "links.tap.opening.duration", "0.02 s", "0.3 s"
    case["numerics"]["end"] = 0.9
    plain, sure = (size(case, *span, rtol=0.1, estimate_error=error) for error in (False, True))
    assert sure.value > 1.05 * plain.value
    said = [one for one in sure.runs if one.open]
    assert said and all("heads" in one.open and not one.ok and one.margin < 0.0 for one in said)
    again = fvsolve.load(case, {span[0]: sure.value})
    assert peak_errors(fvsolve.run(again), again)["verdicts"][0]["state"] == "holds"


def test_a_place_without_a_known_error_is_open(monkeypatch) -> None:
    """The run at twice the resolution stops early, so the error is unknown."""
    from fvsolve.studies import peak_error

    case, real = short_pipe(minimum=SURE), peak_error.run

    def stopped(case, set=None, **more):
        made = real(case, set=set, **more)
        if any("cells" in key for key in set):
            made.summary["reason"] = "interrupted"
        return made

    monkeypatch.setattr(peak_error, "run", stopped)
    found = judged(case)
    assert found["error"] is None and found["state"] == "open" and not found["ok"]


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_band_of_each_part_is_that_of_its_own_cells(factor: float) -> None:
    """The error of each gate is about the error of its own peak, for valves of different area."""
    nodes = {
        "lake": lake(100.0),
        "air": reservoir(101325.0),
        "gate1": junction(),
        "gate2": junction(),
    }
    links = {}
    for k, share in ((1, 1.0), (2, factor)):
        links[f"main{k}"] = pipe("lake", f"gate{k}", 900.0, 0.4, 1000.0, 30)
        links[f"tap{k}"] = valve(
            f"gate{k}", "air", 0.02 * share * area(0.4), ramp(0.5, 2.5, 1.0, 0.0)
        )
    limits = {"top": {"on": ["gate1", "gate2"], "quantity": "head", "maximum": 400.0}}
    case = scene(
        nodes,
        links,
        4.0,
        {"scheme": "muscl", "courant": 0.8},
        ["gate1.head", "gate2.head"],
        limits=limits,
    )
    result = fvsolve.run(case)
    said = peak_errors(result, fvsolve.load(case))
    rows = {row["place"]: row for row in said["verdicts"][0]["worst"]}
    for k in (1, 2):
        peak = said["peaks"][f"gate{k}.head"]["maximum"]
        assert rows[f"gate{k}"]["error"] == pytest.approx(peak["error"], rel=0.2)
