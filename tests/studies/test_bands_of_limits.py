"""Each bound and each place of a limit has its own error: a certain bound does not hide an uncertain bound."""

import csv
import json

import pytest
from reference.scenes import area, junction, lake, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.report.report_files import write_report
from fvsolve.studies import scenarios
from fvsolve.studies.peak_error import peak_errors
from fvsolve.studies.sizing import size

SURE = 49.5  # [m], below the head at the start everywhere: its margin is the least, and does not depend on cells
NEAR = 166.3  # [m], above the peak that the cells of the short pipe show, by less than its error


def short_pipe(on: object = "gate", **bounds: float) -> dict:
    """Case of a quick closure behind a short pipe, whose cells miss most of the peak."""
    nodes = {"lake": lake(50.0), "j": junction(elevation=0.0), "gate": junction(elevation=0.0),
             "out": reservoir(101325.0, elevation=0.0)}  # fmt: skip
    links = {"main": pipe("lake", "j", 1000.0, 0.3, 1000.0, 100), "short": pipe("j", "gate", 25.0, 0.15, 1000.0, 2),
             "tap": valve("gate", "out", 0.61e-3, ramp(0.5, 0.03, 1.0, 0.0))}  # fmt: skip
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
    assert rows["minimum"]["state"] == "holds" and rows["minimum"]["error"] < rows["minimum"]["margin"]
    assert both["bound"] == "maximum" and both["error"] == alone["error"] == rows["maximum"]["error"]
    sure = judged(short_pipe(minimum=SURE))
    assert sure["state"] == "holds" and sure["error"] == rows["minimum"]["error"]


def with_still_water(case: dict, many: int = 1) -> dict:
    """Case with dead ends at the lake, so deep that their pressure head is nearer to the limit than the peak."""
    for k in range(many):
        case["nodes"][f"deep{k}"] = junction(elevation=-115.9)
        case["links"][f"still{k}"] = pipe("lake", f"deep{k}", 200.0, 0.3, 1000.0, 20)
    case["limits"]["heads"] = {"on": ["gate", *(f"deep{k}" for k in range(many))], "quantity": "pressure_head",
                               "maximum": NEAR}  # fmt: skip
    return case


def test_still_water_hides_no_place_whose_cells_miss_the_peak() -> None:
    found = judged(with_still_water(short_pipe()))
    rows = {row["place"]: row for row in found["worst"]}
    assert rows["deep0"]["margin"] < rows["gate"]["margin"] and rows["deep0"]["state"] == "holds"
    assert (found["state"], found["place"], rows["gate"]["state"]) == ("open", "gate", "open")


def test_a_limit_passed_fails_whatever_another_place_may_do() -> None:
    found = judged(short_pipe(maximum=NEAR, minimum=50.5))
    assert (found["state"], found["bound"]) == ("fails", "minimum")


def test_a_run_read_back_is_judged_as_one_in_memory(tmp_path) -> None:
    """The run directory keeps ten places of a limit; here only an eleventh place is open."""
    case = with_still_water(short_pipe(), 12)
    fvsolve.run(case, out=tmp_path / "run", pictures=False)
    back = fvsolve.open_run(tmp_path / "run")
    assert "gate" not in {row["place"] for row in back.summary["verdicts"][0]["worst"]}
    found = peak_errors(back, fvsolve.load(case))["verdicts"][0]
    assert (found["state"], found["place"]) == ("open", "gate")


def test_run_report_and_study_say_the_same_state(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(write(short_pipe(maximum=NEAR, minimum=SURE)))
    status, text, _ = fvs("run", "short.toml", "--estimate-error", "--no-pictures", "--out", "run")
    assert status == 1 and "OPEN, because its margin is smaller than its error: heads" in text
    said = json.loads((tmp_path / "run" / "summary.json").read_text())["verdicts"][0]
    assert (said["state"], said["ok"], said["bound"]) == ("open", False, "maximum")
    page = write_report(tmp_path / "run", tmp_path / "run.html", False)[0].read_text()
    assert "The verdict of a limit is open" in page
    (tmp_path / "two.toml").write_text('case = "short.toml"\nestimate_error = true\n[events.close]\n')
    found = scenarios.study(tmp_path / "two.toml", tmp_path / "out")
    row = json.loads((tmp_path / "out" / "study.json").read_text())["runs"][0]["verdicts"][0]
    assert row["state"] == "open" and not found.ok and found.holds == []
    (line,) = csv.DictReader((tmp_path / "out" / "study.csv").open())
    assert line["heads state"] == "open"


def test_a_study_says_why_errors_are_not_known_and_what_helps(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = short_pipe(maximum=NEAR)
    case["links"]["short"]["cells"] = 1
    (tmp_path / "short.toml").write_text(write(case))
    (tmp_path / "two.toml").write_text('case = "short.toml"\nestimate_error = true\n[events.close]\n')
    _, text, _ = fvs("study", "two.toml", "--out", "out")
    assert "close: error of gate.head, heads at gate: " in text and "links.short.cells = 4" in text
    row = json.loads((tmp_path / "out" / "study.json").read_text())["runs"][0]
    assert "links.short.cells = 4" in row["verdicts"][0]["reason"] and row["verdicts"][0]["state"] == "open"
    assert row["peaks"]["gate.head"]["maximum"]["reason"] in row["resolution"]["reasons"][0]
    page = write_report(tmp_path / "out" / "close", tmp_path / "close.html", False)[0].read_text()
    assert "links.short.cells = 4" in page


def test_a_size_holds_its_limits_by_more_than_their_errors() -> None:
    """With errors, the least closing time is longer: quick closures are open before they fail."""
    case = short_pipe(maximum=NEAR, minimum=SURE)
    case["nodes"]["lake"]["head"] = 50.0
    span = "links.tap.opening.duration", "0.02 s", "0.3 s"
    case["numerics"]["end"] = 0.9
    plain, sure = (size(case, *span, rtol=0.1, error=error) for error in (False, True))
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
    nodes = {"lake": lake(100.0), "air": reservoir(101325.0), "gate1": junction(), "gate2": junction()}
    links = {}
    for k, share in ((1, 1.0), (2, factor)):
        links[f"main{k}"] = pipe("lake", f"gate{k}", 900.0, 0.4, 1000.0, 30)
        links[f"tap{k}"] = valve(f"gate{k}", "air", 0.02 * share * area(0.4), ramp(0.5, 0.2, 1.0, 0.0))
    limits = {"top": {"on": ["gate1", "gate2"], "quantity": "head", "maximum": 400.0}}
    case = scene(nodes, links, 4.0, {"scheme": "muscl", "courant": 0.8}, ["gate1.head", "gate2.head"], limits=limits)
    result = fvsolve.run(case)
    said = peak_errors(result, fvsolve.load(case))
    rows = {row["place"]: row for row in said["verdicts"][0]["worst"]}
    for k in (1, 2):
        peak = said["peaks"][f"gate{k}.head"]["maximum"]
        assert rows[f"gate{k}"]["error"] == pytest.approx(peak["error"], rel=0.2)
