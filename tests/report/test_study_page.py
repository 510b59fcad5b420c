"""Page of a study: it names the protections that hold, overlays runs and escapes texts."""

import json
import re
import tomllib
import zipfile
from urllib.parse import unquote

import numpy as np
import pytest
from report.test_page import WICKED, Read
from studies.test_design import STUDY, throttled

import fvsolve
from fvsolve.case.text import write
from fvsolve.report.report_files import write_report
from fvsolve.studies import scenarios


def test_a_study_is_reported_with_all_its_runs(tmp_path, fvs) -> None:
    (tmp_path / "main.toml").write_text(write(throttled()))
    (tmp_path / "taps.toml").write_text(STUDY.replace('"Two taps"', json.dumps(WICKED)))
    found = scenarios.study(tmp_path / "taps.toml", tmp_path / "out")
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
    top = max(row["extremes"]["gate.pressure"]["maximum"] for row in found.rows)
    result = fvsolve.open_run(tmp_path / "out" / "fast.none")
    assert top == result.extremes["gate.pressure"].maximum >= np.max(result["gate.pressure"])


@pytest.fixture(scope="module")
def taps(tmp_path_factory):
    """Folder of a study with page and workbook: a quick closure fails some limits and leaves others open.

    A slow closure continues after the end of the run.
    """
    folder, case = tmp_path_factory.mktemp("study"), throttled()
    case["limits"]["deep"] = {"on": "main", "quantity": "head", "minimum": -1e3}
    (folder / "main.toml").write_text(write(case))
    (folder / "taps.toml").write_text(STUDY.replace('duration = "3 s"', 'duration = "30 s"'))
    scenarios.study(folder / "taps.toml", folder / "out")
    write_report(folder / "out", xlsx=True)
    return folder / "out"


def boxes(said: str) -> dict[str, str]:
    """Sentences at the top of a page by their bold heads, without tags."""
    found = re.findall(r'<div class="word \w+"><strong>(.*?)</strong>(.*?)</div>', said, re.S)
    return {head: re.sub("<[^>]*>", "", rest) for head, rest in found}


def test_a_run_stands_under_one_head_and_leads_to_its_own_page(taps) -> None:
    """A run that fails a limit is not listed as open, even if another of its limits is open."""
    said = (taps / "report.html").read_text(encoding="utf-8")
    states = {
        path.name: {one.state for one in fvsolve.open_run(path).verdicts} for path in taps.iterdir() if path.is_dir()
    }
    assert {"fails", "open"} <= states["fast.none"], states
    found = boxes(said)
    assert "fast with none" in found["Fails:"] and "fast with none" not in found["Open:"]
    assert "slow with none" in found["Open:"] and "slow with none" not in found["Fails:"]
    assert "tank" not in " ".join(found.values())
    pages = re.findall(r'<a href="([^"#]+)">([^<]+)</a>', said)
    assert {name for _, name in pages} == {
        f"{event} with {kept}" for event in ("fast", "slow") for kept in ("none", "vessel")
    }
    for href, name in pages:
        text = (taps / unquote(href)).read_text(encoding="utf-8")
        assert href == f"{name.replace(' with ', '.')}/report.html" and "Model as understood" in text


def test_what_is_changed_stands_there_as_it_is_written(taps) -> None:
    text = Read((taps / "report.html").read_text(encoding="utf-8")).text
    shut = 'fast links.tap.opening { start = "0.5 s", duration = "0.1 s", value = [1.0, 0.0] }'
    assert shut in text and "{'" not in text
    key, _, value = shut.removeprefix("fast ").partition(" ")
    assert tomllib.loads(f"{key} = {value}")["links"]["tap"]["opening"]["value"] == [1.0, 0.0]


def test_the_workbook_of_a_study_has_the_envelope_of_each_run(taps) -> None:
    with zipfile.ZipFile(taps / "report.xlsx") as book:
        names = re.findall(r'<sheet name="([^"]+)"', book.read("xl/workbook.xml").decode())
        along = {f"{event}.{kept}" for event in ("fast", "slow") for kept in ("none", "vessel")}
        assert {name.partition(" ")[0] for name in names if name.startswith(("fast", "slow"))} == along
        sheet = book.read(f"xl/worksheets/sheet{1 + names.index('fast.none main')}.xml").decode()
    values = [float(one) for one in re.findall("<v>([^<]+)</v>", sheet)]
    envelope = fvsolve.open_run(taps / "fast.none").envelope["main"]
    assert min(abs(one - envelope["max_pressure"].max()) for one in values) < 1e-6
    assert sheet.count("<row ") == 1 + len(envelope["distance"])


def test_a_study_without_limits_says_so(tmp_path) -> None:
    (tmp_path / "main.toml").write_text(write(throttled() | {"limits": {}}))
    (tmp_path / "taps.toml").write_text(STUDY)
    scenarios.study(tmp_path / "taps.toml", tmp_path / "out")
    write_report(tmp_path / "out")
    assert "No limits were stated" in Read((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).text
