"""The page of a study says which protection holds, lays runs over one another, and takes words as words."""

import json

import numpy as np
from report.test_page import WICKED, Read
from studies.test_design import STUDY, throttled

import fvsolve
from fvsolve.case.text import write
from fvsolve.report.report import write_report
from fvsolve.studies import design


def test_a_study_is_reported_with_all_its_runs(tmp_path, fvs) -> None:
    (tmp_path / "main.toml").write_text(write(throttled()))
    (tmp_path / "taps.toml").write_text(STUDY.replace('"Two taps"', json.dumps(WICKED)))
    found = design.study(tmp_path / "taps.toml", tmp_path / "out")
    status, text, _ = fvs("report", str(tmp_path / "out"), "--xlsx")
    assert status == 0 and "report.xlsx" in text
    said = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    page = Read(said)
    assert "All limits hold in all events with vessel." in page.text and "fast with none" in page.text
    assert WICKED[:20] in page.text and "<script>alert" not in said
    assert len(said) < 6e6
    figures = page.figures
    assert {"section-0-0", "history-0-0", "section-1-0", "history-1-0"} <= set(figures)
    lines = [one["name"] for one in figures["history-0-0"]["data"]]
    assert lines == ["none", "vessel"]
    top = max(row["extremes"]["gate.pressure"]["greatest"] for row in found.rows)
    result = fvsolve.open_run(tmp_path / "out" / "fast.none")
    assert top == result.extremes["gate.pressure"].greatest >= np.max(result["gate.pressure"])


def test_a_study_without_limits_says_so(tmp_path) -> None:
    (tmp_path / "main.toml").write_text(write(throttled() | {"limits": {}}))
    (tmp_path / "taps.toml").write_text(STUDY)
    design.study(tmp_path / "taps.toml", tmp_path / "out")
    write_report(tmp_path / "out")
    assert "No limits were stated" in Read((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).text
