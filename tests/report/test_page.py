"""Page of a run: peaks are exact, texts are escaped, nothing is fetched, and unreliable results are stated first.

Page of a study: it names the protections that hold, overlays runs and escapes texts.
"""

import base64
import copy
import json
import re
import shlex
import shutil
import tomllib
import zipfile
from html.parser import HTMLParser
from urllib.parse import unquote

import numpy as np
import pytest
from reference.design_studies import STUDY, throttled
from reference.folders import DOCS
from reference.scenes import junction, lake, pipe, ramp, scene, tank, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.core.output.summary_shape import Expectation, LimitVerdict
from fvsolve.core.run.result import Result
from fvsolve.errors import Notice
from fvsolve.report.figures import escape_markup
from fvsolve.report.long_section import section_paths
from fvsolve.report.page import page, script_json
from fvsolve.report.report_files import write_report
from fvsolve.studies import scenarios

WICKED = (
    "</script><script>alert('x')</script> & \"quoted\" $5 {{ 7 * 7 }} <!-- \u2028 </style><b>bold"
)

VERDICT = {
    "name": "class",
    "ok": False,
    "place": "main",
    "chainage": 480.0,
    "elevation": 0.0,
    "time": 1.25,
    "bound": "maximum",
    "state": "fails",
    "value": 13.5,
    "limit": 10.0,
    "margin": -3.5,
    "unit": "bar",
    "quantity": "gauge_pressure",
    "until": 3.0,
    "error": None,
    "reason": None,
    "worst": [],
}


class Read(HTMLParser):
    """HTML reader: tags with attributes, words outside scripts and styles, and text of each script."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.scripts, self.words, self.inside = [], [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag):
        self.inside = ""

    def handle_data(self, data):
        if self.inside == "script":
            self.scripts[-1] += data
        elif self.inside != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))

    @property
    def figures(self) -> dict:
        return json.loads(self.scripts[0])


def values(packed: dict) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed["bdata"]), "<" + packed["dtype"])


def changed(result, table=None, **summary) -> Result:
    """Copy of a result with another table or other keys of its summary."""
    return Result(
        result.summary | summary,
        lambda: result._table.copy() if table is None else table,
        lambda: result.envelope,
        result.directory,
    )


def line(end: float, **more) -> dict:
    """Case of a valve that shuts at the end of a main, with markup in title, description and source."""
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {
        "main": pipe("top", "gate", 900.0, 0.3, 1200.0, 40),
        "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0)),
    }
    case = scene(
        nodes,
        links,
        end,
        {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9},
        ["gate.head", "valve.flow", "main.pressure@0.5"],
        0.01,
    )
    case["output"] |= {"fields": 12} | more
    return case | {"title": WICKED, "description": WICKED, "source": WICKED}


@pytest.fixture(scope="module")
def closure(tmp_path_factory):
    return fvsolve.run(line(3.0), out=tmp_path_factory.mktemp("runs") / "closure", pictures=False)


def read(result) -> Read:
    return Read(page(result, section_paths(result)))


def test_the_peak_of_a_million_rows_is_in_the_page_to_the_last_bit(closure):
    rng = np.random.default_rng(17)
    table = np.column_stack(
        [np.linspace(0.0, 3.0, 10**6), rng.normal(size=(10**6, len(closure.probes)))]
    )
    table[271_828, 1], table[314_159, 1] = np.pi * 1e3, -np.e * 1e3
    found = page(changed(closure, table), section_paths(closure))
    traces = [
        one
        for id, figure in Read(found).figures.items()
        if id.startswith("history")
        for one in figure["data"]
    ]
    assert len(found) < 6e6 and len(traces) == len(closure.probes)
    for k, name in enumerate(closure.probes, 1):
        t, v = next((values(one["x"]), values(one["y"])) for one in traces if one["name"] == name)
        assert (v.max(), v.min()) == (table[:, k].max(), table[:, k].min())
        assert (
            t[v.argmax()] == table[table[:, k].argmax(), 0]
            and t[v.argmin()] == table[table[:, k].argmin(), 0]
        )


def test_a_report_of_dozens_of_long_sections_probes_and_frames_stays_below_six_megabytes(tmp_path):
    case = line(0.02, fields=100)
    case["links"]["main"]["cells"] = 4000
    case["output"] |= {"every": 1e-5, "probes": [f"main.head@{k / 200}" for k in range(200)]}
    found = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    (way,) = section_paths(found)
    text = page(found, [way] * 40)
    assert 5e6 < len(text.encode()) < 6e6 and "152 probes with smaller ranges are not drawn" in text


def test_words_of_a_case_are_data_and_never_markup(closure):
    verdict = VERDICT | {"name": WICKED}
    warning = {
        "kind": "range",
        "place": "x",
        "key": None,
        "value": None,
        "limit": None,
        "ok": True,
        "text": WICKED,
    }
    found = read(changed(closure, verdicts=[verdict], warnings=[warning]))
    assert [attributes.get("type") for tag, attributes in found.tags if tag == "script"] == [
        "application/json",
        None,
        None,
    ]
    assert not [tag for tag, _ in found.tags if tag in ("b", "img", "iframe", "object", "link")]
    shown = re.sub(r"\s+", " ", WICKED.replace("\u2028", "\\u2028"))
    assert found.text.count(shown) >= 5  # title, heading, description, source, verdict, warning
    assert escape_markup("<b>a</b> & $x$") == "&lt;b&gt;a&lt;/b&gt; &amp; &#36;x&#36;"


def test_the_page_names_no_host(closure):
    found = read(closure)
    links = [
        value
        for _, attributes in found.tags
        for key, value in attributes.items()
        if key in ("href", "src")
    ]
    assert links and all(link.startswith("#") for link in links)
    policy = next(
        one["content"] for tag, one in found.tags if tag == "meta" and "http-equiv" in one
    )
    assert "default-src 'none'" in policy and "http" not in policy


def test_lines_of_a_section_are_those_of_the_envelope(closure):
    figure = read(closure).figures["section-0"]
    lines = {one["name"]: values(one["y"]) for one in figure["data"] if isinstance(one["y"], dict)}
    envelope, fluid = closure.envelope["main"], closure.summary["fluid"]
    for name in ("max_head", "min_head", "initial_head"):
        assert lines[
            name.replace("min_", "minimum ").replace("max_", "maximum ").replace("_", " ")
        ] == pytest.approx(envelope[name], rel=1e-6)
    below = (fluid["vapor_pressure"] - closure.summary["ambient_pressure"]) / (
        fluid["density"] * closure.case.gravity
    )
    assert lines["vapour line"] == pytest.approx(envelope["elevation"] + below, rel=1e-6)
    assert len(figure["moving"]["times"]) == 13 and np.shape(figure["moving"]["heads"]) == (13, 40)
    assert figure["moving"]["heads"][0] == pytest.approx(envelope["initial_head"], rel=1e-5)


def test_a_run_that_stopped_states_it_before_anything_else(tmp_path):
    def enough(t, seconds, steps):
        raise KeyboardInterrupt

    links = {"hole": valve("high", "low", 1e-3)}
    case = scene(
        {"high": tank(3.0, 4.0), "low": tank(3.0, 1.0)},
        links,
        1e6,
        {"method": "heun", "step": 1e-3},
    )
    result = fvsolve.run(case, out=tmp_path / "run", progress=enough, pictures=False)
    text = read(result).text
    assert result.reason.startswith("interrupted")
    first, after = text.index("This run stopped early."), text.index("No limits were stated.")
    assert first < after < text.index("Histories") and "of 1e+06 s" in text[first:after]
    assert "Long sections" not in text  # the case has no pipes


def test_marks_and_warnings_that_spoil_numbers_stand_at_the_top(closure):
    mark = {
        "what": "below vapour pressure",
        "place": "main",
        "time": 1.25,
        "text": "main: pressure falls",
    }
    bad = {
        "kind": "growth",
        "place": "links.main",
        "key": None,
        "value": None,
        "limit": None,
        "ok": False,
        "text": "it grows",
    }
    text = read(changed(closure, marks=[mark], warnings=[bad], ok=False)).text
    places = [
        text.index(one)
        for one in (
            "it grows",
            "from 1.25 s on are not to be trusted",
            "No limits were stated",
            "Long",
        )
    ]
    assert places == sorted(places)


def test_verdicts_stand_first_those_that_fail_before_others(closure):
    holds = {
        "name": "vacuum",
        "ok": True,
        "state": "holds",
        "value": 0.5,
        "limit": 0.2,
        "margin": 0.3,
        "bound": "minimum",
    }
    verdicts = [VERDICT | holds, VERDICT]
    text = read(changed(closure, verdicts=verdicts)).text
    assert (
        "1 of 2 limits does not hold. class" in text
        and "class gauge pressure at most 10 bar FAILS 13.5" in text
    )
    assert text.index("FAILS") < text.index("vacuum") < text.index("Worst of all pipes")
    early = read(
        changed(closure, verdicts=[VERDICT | holds | {"ok": False, "state": "open"}], ok=False)
    ).text
    assert (
        "The verdict of a limit is open. vacuum: the run stopped early or its numbers are wrong."
        in early
        and "FAILS" not in early
    )
    mark = {
        "what": "below vapor pressure",
        "place": "links.main",
        "time": 1.0,
        "text": "main: below",
    }
    later = read(
        changed(closure, verdicts=[VERDICT | holds | {"ok": False, "state": "open"}], marks=[mark])
    ).text
    assert "vacuum: from some time on the results are not to be trusted." in later
    unsure = read(
        changed(closure, verdicts=[VERDICT | holds | {"ok": False, "state": "open", "error": 0.4}])
    ).text
    assert (
        "open. vacuum: margins are smaller than the numerical errors" in unsure
        and "open 0.5 0.4" in unsure
    )
    passed = read(changed(closure, verdicts=[VERDICT | {"error": 4.0}])).text
    assert "The limit does not hold. class" in passed and "FAILS 13.5 4" in passed


def test_values_that_are_no_numbers_are_none_in_the_page():
    assert script_json({"a": [1.0, float("nan")], "b": "<"}) == '{"a":[1.0,null],"b":"\\u003c"}'


def test_without_stored_fields_the_page_gives_the_reason_for_no_motion(tmp_path):
    found = read(fvsolve.run(line(0.2, fields=0), out=tmp_path / "run", pictures=False))
    assert "No fields were stored" in found.text and "moving" not in found.figures["section-0"]


def test_a_report_of_no_run_lists_the_contents_of_the_folder(closure, tmp_path, monkeypatch):
    with pytest.raises(fvsolve.RunError, match=r"nowhere does not exist; expected a run directory"):
        write_report(tmp_path / "nowhere")
    with pytest.raises(fvsolve.RunError, match="does not hold a finished run"):
        write_report(tmp_path)
    (tmp_path / "restart.npz").touch()
    with pytest.raises(
        fvsolve.RunError, match="holds an unfinished run: continue it with .* --resume"
    ):
        write_report(tmp_path)
    for name in ("summary.json", "history.csv", "envelope.csv", "fields/000003.vtu"):
        path = closure.directory / name
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2].rsplit(b"\n", 1)[0] + b"\n1,2\n")
        try:
            with pytest.raises(fvsolve.RunError, match=re.escape(path.name)):
                write_report(closure.directory, tmp_path / "report.html")
        finally:
            path.write_bytes(whole)
    with pytest.raises(fvsolve.FvsolveError, match="cannot be written: .*--out"):
        write_report(closure.directory, tmp_path / "no" / "report.html")
    monkeypatch.setitem(__import__("sys").modules, "xlsxwriter", None)
    with pytest.raises(
        fvsolve.FvsolveError, match=r'needs xlsxwriter: pip install "fvsolve\[report\]"'
    ):
        write_report(closure.directory, tmp_path / "report.html", xlsx=True)


def test_a_directory_of_another_version_is_named_with_its_missing_files(closure, tmp_path):
    """Each required field is removed in turn, and the error names it."""
    out = tmp_path / "old"
    shutil.copytree(closure.directory, out)
    said, tried = json.loads((out / "summary.json").read_text()) | {"verdicts": [VERDICT]}, 0
    for key, row in {
        "expectations": Expectation,
        "verdicts": LimitVerdict,
        "warnings": Notice,
    }.items():
        for name in row.__annotations__ if said[key] else ():
            old = copy.deepcopy(said)
            old[key][0].pop(name)
            (out / "summary.json").write_text(json.dumps(old))
            with pytest.raises(
                fvsolve.RunError,
                match=rf"summary\.json: {key}\.0\.{name} is missing.* run the case again with --force",
            ):
                write_report(out)
            tried += 1
    old = copy.deepcopy(said)
    old["verdicts"][0] = {**old["verdicts"][0], "colour": 1}
    (out / "summary.json").write_text(json.dumps(old))
    with pytest.raises(fvsolve.RunError, match=r"verdicts\.0\.colour is unknown to this version"):
        fvsolve.open_run(out)
    assert tried > 15


def test_the_commands_of_its_page_run(fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "report.md").read_text(encoding="utf-8")
    lines = [
        line for block in re.findall(r"```sh\n(.*?)```", text, re.S) for line in block.splitlines()
    ]
    assert all(fvs(*shlex.split(line)[1:])[0] == 0 for line in lines)
    made = {"report.html", "report.xlsx", "section.png", "probes.png", "phase.png"}
    assert made <= {path.name for path in (tmp_path / "runs/pump-trip-air-vessel").iterdir()}
    again = fvs(
        "run",
        "pump-trip-air-vessel",
        "--force",
        "--no-pictures",
        "--set",
        "numerics.end=1",
        "--set",
        "expect={}",
    )
    assert again[0] == 0 and not made & {
        path.name for path in (tmp_path / "runs/pump-trip-air-vessel").iterdir()
    }


def test_a_study_is_reported_with_all_its_runs(tmp_path, fvs) -> None:
    (tmp_path / "main.toml").write_text(write(throttled()))
    (tmp_path / "taps.toml").write_text(STUDY.replace('"Two taps"', json.dumps(WICKED)))
    found = scenarios.study(tmp_path / "taps.toml", tmp_path / "out")
    status, text, _ = fvs("report", str(tmp_path / "out"), "--xlsx")
    assert status == 0 and "report.xlsx" in text
    said = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    page = Read(said)
    assert (
        "All limits hold in all events with vessel." in page.text and "fast with none" in page.text
    )
    assert "Numerical errors were not estimated" in page.text
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


def test_a_run_is_under_a_single_head_and_leads_to_its_own_page(taps) -> None:
    """A run that fails a limit is not listed as open, even if another of its limits is open."""
    said = (taps / "report.html").read_text(encoding="utf-8")
    states = {
        path.name: {one.state for one in fvsolve.open_run(path).verdicts}
        for path in taps.iterdir()
        if path.is_dir()
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
        assert (
            href == f"{name.replace(' with ', '.')}/report.html" and "Model as understood" in text
        )


def test_changed_keys_are_shown_as_written(taps) -> None:
    text = Read((taps / "report.html").read_text(encoding="utf-8")).text
    shut = 'fast links.tap.opening { start = "0.5 s", duration = "0.1 s", value = [1.0, 0.0] }'
    assert shut in text and "{'" not in text
    key, _, value = shut.removeprefix("fast ").partition(" ")
    assert tomllib.loads(f"{key} = {value}")["links"]["tap"]["opening"]["value"] == [1.0, 0.0]


def test_the_workbook_of_a_study_has_the_envelope_of_each_run(taps) -> None:
    with zipfile.ZipFile(taps / "report.xlsx") as book:
        names = re.findall(r'<sheet name="([^"]+)"', book.read("xl/workbook.xml").decode())
        along = {f"{event}.{kept}" for event in ("fast", "slow") for kept in ("none", "vessel")}
        assert {
            name.partition(" ")[0] for name in names if name.startswith(("fast", "slow"))
        } == along
        sheet = book.read(f"xl/worksheets/sheet{1 + names.index('fast.none main')}.xml").decode()
    values = [float(one) for one in re.findall("<v>([^<]+)</v>", sheet)]
    envelope = fvsolve.open_run(taps / "fast.none").envelope["main"]
    assert min(abs(one - envelope["max_pressure"].max()) for one in values) < 1e-6
    assert sheet.count("<row ") == 1 + len(envelope["distance"])


def test_a_study_without_limits_states_their_absence(tmp_path) -> None:
    (tmp_path / "main.toml").write_text(write(throttled() | {"limits": {}}))
    (tmp_path / "taps.toml").write_text(STUDY)
    scenarios.study(tmp_path / "taps.toml", tmp_path / "out")
    write_report(tmp_path / "out")
    assert (
        "No limits were stated"
        in Read((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).text
    )
