"""A study runs each event with each protection, and a size search finds the value at which a limit is reached."""

import json
import re
import shlex
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from reference.design_studies import STUDY, throttled
from reference.folders import CASES, DOCS, section
from reference.scenes import AMBIENT, GRAVITY, RHO, area, junction, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.core.output.summary_shape import HOLDS, OPEN, LimitVerdict
from fvsolve.errors import CaseError, FvsolveError, RunError
from fvsolve.studies import optimise, scenarios
from fvsolve.studies.sizing import SizeRun, SizeSearch, parse_range, parse_ties, size, size_run

# with one event
FAST = STUDY.replace(STUDY[STUDY.index("[events.slow]") : STUDY.index("[protections.none]")], "")


@pytest.fixture
def study(tmp_path):
    (tmp_path / "main.toml").write_text(write(throttled()))
    (tmp_path / "taps.toml").write_text(STUDY)
    return tmp_path / "taps.toml"


def test_every_event_with_every_protection_equals_a_run_of_its_own(study, tmp_path) -> None:
    found = scenarios.study(study, tmp_path / "out")
    assert [(row["event"], row["protection"]) for row in found.rows] == [
        ("fast", "none"),
        ("fast", "vessel"),
        ("slow", "none"),
        ("slow", "vessel"),
    ]
    alone = fvsolve.run(
        tmp_path / "main.toml",
        {"links.tap.opening": {"start": 0.5, "duration": 0.1, "value": [1.0, 0.0]}},
    )
    assert found.rows[0]["verdicts"][0]["value"] == alone.verdicts[0].value
    assert not found.rows[0]["verdicts"][0]["ok"] and found.rows[1]["verdicts"][0]["ok"]
    assert found.holds == ["vessel"] and found.ok
    said = json.loads((tmp_path / "out" / "study.json").read_text())
    assert said["holds"] == ["vessel"] and said["runs"][1]["directory"] == "fast.vessel"
    assert fvsolve.open_run(tmp_path / "out" / "fast.vessel").verdicts[0].ok
    assert len((tmp_path / "out" / "study.csv").read_text().splitlines()) == 5
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*/summary.json")}
    again = scenarios.study(study, tmp_path / "out")
    assert again.rows == found.rows
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps  # nothing was run again
    assert scenarios.open_study(tmp_path / "out")["title"] == "Two taps"
    (tmp_path / "out" / "report.html").touch()  # report of the runs before
    scenarios.study(study, tmp_path / "out")
    assert not (tmp_path / "out" / "report.html").exists()


def test_runs_of_a_study_have_the_same_steps(study, tmp_path) -> None:
    study.write_text(FAST)
    scenarios.study(study, tmp_path / "out")
    for summary in (tmp_path / "out").glob("*/summary.json"):
        summary.unlink()  # as if each run had been interrupted
    assert scenarios.study(study, tmp_path / "out").ok
    case = tmp_path / "main.toml"
    case.write_text(re.sub(r"courant = [\d.]+", "courant = 0.4", case.read_text()))
    with pytest.raises(RunError, match="holds a run with other time steps.*--force"):
        scenarios.study(study, tmp_path / "out")
    assert scenarios.study(study, tmp_path / "out", force=True).ok


def test_processes_and_errors_change_no_verdict(study, tmp_path) -> None:
    study.write_text(FAST)
    one = scenarios.study(study, tmp_path / "one")
    study.write_text(FAST.replace("case =", "estimate_error = true\ncase ="))
    banded = scenarios.study(study, tmp_path / "two", jobs=2)
    for row, beside in zip(one.rows, banded.rows, strict=True):
        assert row["extremes"] == beside["extremes"]
        # open places come first
        for verdict, other in zip(row["verdicts"], beside["verdicts"], strict=True):
            assert other["value"] == verdict["value"] or (
                other["error"] is None and other["state"] == "open"
            )
        # unknown beside a piece of one cell
        errors = [verdict["error"] for verdict in beside["verdicts"]]
        assert all(error is None or error > 0.0 for error in errors)
        assert any(errors) or row["protection"] == "vessel"


def test_the_command_prints_a_table_and_leaves_with_1_where_no_protection_holds(
    fvs, study, tmp_path
) -> None:
    study.write_text(FAST)
    status, text, _ = fvs("study", str(study), "--out", str(tmp_path / "out"))
    assert (
        status == 0
        and "all limits hold in all events with: vessel" in text
        and "fast with none" in text
    )
    study.write_text(FAST[: FAST.index("[protections.vessel")])
    status, text, _ = fvs("study", str(study), "--out", str(tmp_path / "other"))
    assert status == 1 and "no protection satisfies all limits in all events" in text


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("[protections.none]", "[protections.none.links.tap]\nopening = 0.5"),
         "links.tap.opening is set here, and links.tap.opening in protections.none"),
        (("[protections.none]", "[protections.none]\n'links.tap' = {}"),
         "links.tap.opening is set here, and links.tap"),
        (("[events.slow]", "[events.slow]\n'links.tpa.area' = 2"), 'no link named "tpa"; did you mean "tap"?'),
        (("at = 450.0", "at = 550.0"), "is outside: main runs from 0 m to 500 m"),
        (('case = "main.toml"', 'case = "mian.toml"'), "there is no such file"),
        (('case = "main.toml"', ""), "case is missing"),
        (("[events.slow]", "[event.slow]"), 'unknown key; did you mean "events"?'),
        (('title = "Two taps"', "title = 3"), "3 is not text"),
        (("[protections.none]", "[protections]\nnone = 3\n[protections.x]"), "3 is not a table"),
        (("[events.slow]", "[nodes.slow]"), "is a case, not a study"),
        (("[events.slow]", "[events.slow"), "line 8: TOML"),
    ],
)  # fmt: skip
def test_faults_are_named(study, change, told: str) -> None:
    study.write_text(STUDY.replace(*change))
    with pytest.raises(CaseError) as error:
        scenarios.study(study, study.parent / "out")
    assert told in str(error.value)
    assert not (study.parent / "out").exists()


def test_all_that_is_wrong_of_a_study_comes_at_once_by_line(study) -> None:
    text = STUDY.replace('title = "Two taps"', "title = 3").replace(
        'duration = "3 s"', 'duration = "3 kg"'
    )
    text = text.replace("[protections.none]", "[protections.none]\nlinks.tap.aera = 2").replace(
        '"main"', '"mian"'
    )
    study.write_text(
        text + "[events.cut]\nlinks.main.cells = 20\n[protections.fine]\nlinks.main.cells = 10\n"
    )
    with pytest.raises(CaseError) as error:
        scenarios.study(study, study.parent / "out")
    assert [str(one).partition(": ")[0] for one in error.value.faults] == [
        f"line {n}" for n in (2, 9, 12, 18, 21)
    ]
    assert [one.place for one in error.value.faults] == [
        "title",
        "events.slow.links.tap.opening.duration",
        "protections.none.links.tap.aera",
        "protections.vessel.nodes.vessel.on",
        "events.cut.links.main.cells",
    ]


def test_a_study_without_limits_holds_none(fvs, study, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    study.write_text(FAST)
    (tmp_path / "main.toml").write_text(write(throttled() | {"limits": {}}))
    status, text, _ = fvs("study", "taps.toml", "--out", "out")
    assert (
        status == 0
        and "no limits" in text
        and "hold in all events" not in text
        and "holds" not in text
    )
    said = json.loads((tmp_path / "out" / "study.json").read_text())
    assert (said["holds"], said["ok"]) == ([], True) and all(
        row["verdicts"] == [] for row in said["runs"]
    )
    status, text, _ = fvs("report", "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert status == 0 and "No limits were stated" in page and "All limits hold" not in page


def test_a_protection_holds_by_limits_alone(tmp_path) -> None:
    """Limits may come from one event only; a protection whose runs have no limits does not hold."""
    rows = [
        {
            "event": event,
            "protection": protection,
            "ok": True,
            "verdicts": [{"ok": True}] if protection == "vessel" and event == "fast" else [],
        }
        for event in ("fast", "slow")
        for protection in ("none", "vessel")
    ]
    found = scenarios.ScenarioResults(None, tmp_path, rows)
    assert found.limited and found.holds == ["vessel"] and found.ok


def test_the_commands_of_the_page_print_its_text(fvs, tmp_path, monkeypatch) -> None:
    """Each command of docs/studies.md prints the results on the page; the study is coarser and shorter here."""
    text = section("studies", "Designs")
    lines = [
        line for block in re.findall(r"```sh\n(.*?)```", text, re.S) for line in block.splitlines()
    ]
    assert [line.split()[1] for line in lines] == ["study", "size", "optimise"]
    shutil.copytree(DOCS.parent / "cases", tmp_path / "cases")
    # of the study alone: the other commands use the shipped case
    copied = tmp_path / "cases" / "pumping-main.toml"
    shorter = (
        copied.read_text(encoding="utf-8")
        .replace("cells = 120", "cells = 30")
        .replace('"60 s"', '"30 s"')
    )
    copied.write_text(shorter, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    said = [fvs(*shlex.split(line.replace("--jobs 2", "--jobs 1"))[1:]) for line in lines]
    assert [status for status, _, _ in said] == [0, 0, 0]
    assert (
        "all limits hold in all events with: vessel" in said[0][1]
        and said[0][1].count("FAILS") == 4
    )
    assert "minimum value that satisfies all limits: 25.1" in said[1][1]
    assert re.search(r"^opening = { time.*$", text, re.M)[0] in said[2][1]


# sizes ------------------------------------------------------------------------------------------------------------


def still(minimum: float | None = None, maximum: float | None = None) -> dict:
    """Case of a lake above a shut main: the gauge pressure at the gate is rho g (head - 10 m)."""
    case = throttled()
    case["links"]["tap"]["opening"] = 0.0
    bounds = {
        key: one for key, one in (("minimum", minimum), ("maximum", maximum)) if one is not None
    }
    return case | {"limits": {"gate": {"on": "gate", "quantity": "gauge_pressure", **bounds}}}


@pytest.mark.parametrize(
    ("low", "high", "scale"), [(20.0, 80.0, 1.0), ("20 m", "80 m", 1.0), ("20 m", "262 ft", 0.3048)]
)
def test_a_size_is_where_the_limit_is_reached(low, high, scale: float) -> None:
    exact = 10.0 + 3e5 / (RHO * GRAVITY)
    found = size(still(minimum=3e5), "nodes.lake.head", low, high, rtol=1e-4)
    assert found.value * scale == pytest.approx(exact, rel=2e-4)
    fails, holds = found.bracket
    assert fails * scale < exact <= holds * scale
    assert all(one.ok == (one.value * scale >= exact) for one in found.runs)
    most = size(still(maximum=3e5), "nodes.lake.head", low, high, "maximum", rtol=1e-4)
    assert most.value * scale == pytest.approx(exact, rel=2e-4) and most.value <= most.bracket[0]


def test_ends_that_hold_or_fail_are_reported() -> None:
    assert size(still(minimum=1e5), "nodes.lake.head", 40.0, 80.0).value == 40.0
    assert len(size(still(minimum=1e5), "nodes.lake.head", 40.0, 80.0).runs) == 1
    lost = size(still(minimum=9e5), "nodes.lake.head", 20.0, 80.0)
    assert lost.value is None and lost.nearest.value == 80.0
    island = size(still(minimum=3e5, maximum=4.5e5), "nodes.lake.head", 20.0, 100.0, rtol=1e-3)
    assert island.value == pytest.approx(10.0 + 3e5 / (RHO * GRAVITY), rel=2e-3)


def margins(rule):
    """`SizeSearch` whose margin is a function of the value, without runs."""

    class Trials(SizeSearch):
        def __init__(self):
            self.runs = []

        def __call__(self, value):
            known = next((one for one in self.runs if one.value == value), None)
            if known is None:
                known = SizeRun(value, rule(value) >= 0.0, rule(value), "", "")
                self.runs.append(known)
            return known

    return Trials()


@pytest.mark.parametrize("goal", ["minimum", "maximum"])
@pytest.mark.parametrize(
    "low, high",
    [
        (3.8, 4.2),
        (3.99, 4.01),
        (11.7, 11.71),
        (17.0, 17.05),
        (0.6, 0.62),
        (19.3, 19.31),
        (5.0, 5.001),
    ],
)
def test_a_narrow_window_with_known_margins_is_located(goal, low, high) -> None:
    """Windows of 0.005 % to 2 % of the range 0 to 20, with margins relative to the limits as those of a tank."""
    found = margins(lambda x: min((x - low) / low, (high - x) / high)).search(
        0.0, 20.0, goal, 1e-3
    )[0]
    assert found is not None and low <= found <= high
    bent = margins(lambda x: 1e-4 - abs(x - 0.5 * (low + high)) ** 1.5 / 20.0).search(
        0.0, 20.0, goal, 1e-3
    )[0]
    assert bent is not None and abs(bent - 0.5 * (low + high)) ** 1.5 <= 2e-3


def test_a_margin_that_fails_everywhere_ends_the_search() -> None:
    search = margins(lambda x: -0.1 - abs(x - 3.0))
    assert search.search(0.0, 20.0, "minimum", 0.01) == (None, None) and len(search.runs) <= 10


@pytest.mark.parametrize("unit", ["ft", "feet", "international_foot"])  # the last by pint only
def test_ties_follow_in_si(unit) -> None:
    found = size(
        still(minimum=3e5),
        "nodes.lake.head",
        f"80 {unit}",
        f"250 {unit}",
        ties=parse_ties(["links.main.length = 10 * x"]),
        rtol=0.01,
    )
    assert found.ties == ("links.main.length = 10 * x",)
    assert found.unit == unit and found.value * 0.3048 == pytest.approx(
        10.0 + 3e5 / (RHO * GRAVITY), rel=0.02
    )


def test_the_command_shows_its_runs(fvs, tmp_path) -> None:
    (tmp_path / "still.toml").write_text(write(still(minimum=3e5)))
    status, text, _ = fvs(
        "size", str(tmp_path / "still.toml"), "--vary", "nodes.lake.head=20 m,80 m"
    )
    assert (
        status == 0
        and "minimum value that satisfies all limits" in text
        and text.count("holds") > 1
    )
    status, text, _ = fvs(
        "size", str(tmp_path / "still.toml"), "--vary", "nodes.lake.head=20,30", "--json"
    )
    said = json.loads(text)
    assert status == 1 and said["value"] is None and said["nearest"]["value"] == 30.0
    status, text, _ = fvs("size", str(tmp_path / "still.toml"), "--vary", "nodes.lake.head=20,30")
    assert (
        status == 1
        and "the nearest to the limits is 30" in text
        and "; try values above it" in text
    )
    assert {"value", "bracket", "runs"} <= set(said)


def test_parameters_that_cannot_be_sized_are_reported() -> None:
    with pytest.raises(FvsolveError, match="has no limits"):
        size(throttled() | {"limits": {}}, "nodes.lake.head", 20.0, 80.0)
    with pytest.raises(FvsolveError, match="words or whole numbers"):
        size(still(minimum=3e5), "links.main.cells", 10, 20)
    with pytest.raises(FvsolveError, match="is not below"):
        parse_range("80 m", "20 m")
    with pytest.raises(FvsolveError, match="have different kinds of units"):
        parse_range("80 m", "90 bar")
    with pytest.raises(FvsolveError, match="is not a number"):
        parse_range("wide", 3)
    with pytest.raises(FvsolveError, match="expected"):
        parse_ties(["links.main.length"])
    with pytest.raises(CaseError, match='did you mean "lake"'):
        size(still(minimum=3e5), "nodes.lkae.head", 20.0, 80.0)
    assert np.isclose(parse_range("1 km", "2000 m")[0], 1000.0) and AMBIENT > 0.0


def test_all_that_is_wrong_of_a_search_comes_at_once(fvs, tmp_path) -> None:
    (tmp_path / "still.toml").write_text(write(still(minimum=3e5)))
    case = str(tmp_path / "still.toml")
    status, _, told = fvs(
        "size",
        case,
        "--vary",
        "nodes.lake.head=80,20",
        "--goal",
        "minimim",
        "--rtol",
        "3",
        "--dependent",
        "links.main.length",
        "--set",
        "links.mian.cells=3",
    )
    assert (
        status == 2
        and "5 faults" in told
        and 'did you mean "minimum"' in told
        and 'did you mean "main"' in told
    )
    status, _, told = fvs(
        "size", case, "--vary", "nodes.lake.haed=20,80", "--dependent", "links.main.lenght=x"
    )
    assert status == 2 and "2 faults" in told
    assert '--vary nodes.lake.haed: unknown key; did you mean "head"' in told
    assert "--dependent links.main.lenght" in told
    status, _, told = fvs(
        "optimise",
        case,
        "--schedule",
        "links.tap.openning",
        "--minimise",
        "max(gaet.head)",
        "--knots",
        "0",
    )
    assert status == 2 and "3 faults" in told and 'did you mean "links.tap.opening"' in told


@pytest.mark.parametrize("margin, what", [(0.2, "error"), (None, "value")])
def test_an_open_limit_states_if_its_value_or_its_error_is_not_known(margin, what):
    """The second limit is open, and the first has a smaller margin."""
    row = {"margin": 0.1, "error": 0.05, "unit": "m", "limit": 10.0, "value": 9.9}
    rows = [row, row | {"margin": margin, "error": None}]
    blank = dict.fromkeys(LimitVerdict._fields)
    verdicts = [
        LimitVerdict(
            **blank
            | {"name": name, "ok": ok, "state": state, "quantity": "head", "worst": [row]}
            | given
        )
        for name, ok, state, row, given in zip(
            ("first", "second"),
            (True, False),
            (HOLDS, OPEN),
            rows,
            ({}, {"margin": margin}),
            strict=True,
        )
    ]
    result = SimpleNamespace(verdicts=verdicts, marks=[], warnings=[], ok=True, reason="finished")
    assert size_run(1.0, result).open == f"second: its {what} is not known"


# ----------------------------------------------------------------------------------------------------------------------
# The least peak by optimisation is near the lower bound, given by the mean pressure that stops a column.


LENGTH, DIAMETER, TIME, SUPPLY = 100.0, 0.3, 4.0, 1.2e5


def column() -> dict:
    """Case of a frictionless rigid column that a valve stops within TIME."""
    nodes = {"lake": reservoir(SUPPLY), "gate": junction(), "air": reservoir(AMBIENT)}
    links = {
        "main": {
            "type": "rigid-column",
            "from": "lake",
            "to": "gate",
            "length": LENGTH,
            "diameter": DIAMETER,
        },
        "tap": valve("gate", "air", 0.5 * area(DIAMETER), ramp(0.5, TIME, 1.0, 0.0)),
    }
    return scene(nodes, links, 5.0, {"method": "rk4", "step": 0.01}, ["gate.pressure", "main.flow"])


def test_it_comes_near_the_least_that_can_be() -> None:
    first = fvsolve.run(column())
    speed = first["main.flow"][0] / area(DIAMETER)
    least = RHO * LENGTH * speed / TIME  # mean pressure that stops the column
    found = optimise(column(), "links.tap.opening", "max(gate.pressure)", knots=4, runs=120)
    rise, linear = found.best.peak - SUPPLY, found.linear.peak - SUPPLY
    assert linear == pytest.approx(first.extremes["gate.pressure"].maximum - SUPPLY, rel=1e-9)
    assert least < rise < 0.85 * linear and rise < 1.6 * least
    assert found.best.value[0] == 1.0 and found.best.value[-1] == 0.0
    assert all(a >= b for a, b in zip(found.best.value, found.best.value[1:], strict=False))
    again = fvsolve.run(
        column(), set={"links.tap.opening": {"time": found.best.time, "value": found.best.value}}
    )
    assert again.extremes["gate.pressure"].maximum == pytest.approx(found.best.peak, rel=1e-9)
    assert found.runs <= 124


def test_the_command_prints_the_law_for_the_case(fvs, tmp_path) -> None:
    (tmp_path / "column.toml").write_text(write(column()))
    ask = (
        "optimise",
        str(tmp_path / "column.toml"),
        "--schedule",
        "links.tap.opening",
        "--minimise",
        "max(gate.pressure)",
        "--knots",
        "1",
        "--runs",
        "12",
    )
    status, text, _ = fvs(*ask)
    assert (
        status == 0
        and "opening = { time = [0.5, 2.5, 4.5], value = [1.0," in text
        and "linear" in text
    )
    said = json.loads(fvs(*ask, "--json")[1])
    assert said["best"]["peak"] <= said["linear"]["peak"] and len(said["laws"]) == said["runs"]


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("links.tap.area", "is not a schedule"),
        ("links.tpa.opening", "is not a schedule"),
        ("nodes.air.pressure", "does not change"),
    ],
)
def test_an_invalid_law_is_named(key: str, told: str) -> None:
    with pytest.raises(FvsolveError, match=told):
        optimise(column(), key, "max(gate.pressure)")


def test_objectives_that_cannot_be_minimised_are_named() -> None:
    with pytest.raises(fvsolve.CaseError, match='did you mean "gate"'):
        optimise(column(), "links.tap.opening", "max(gaet.pressure)")
    with pytest.raises(FvsolveError, match="expected 15 or more"):
        optimise(column(), "links.tap.opening", "max(gate.pressure)", runs=4)


def test_a_shipped_study_is_located_by_its_name():
    assert (
        scenarios.read_scenarios("pumping-main-design").path
        == CASES / "studies" / "pumping-main-design.toml"
    )
    with pytest.raises(CaseError, match="no-such-study"):
        scenarios.read_scenarios("no-such-study")
