"""Results with dates: files, tables and pictures have the clock times of numpy; without start time nothing changes."""

import csv
import json

import numpy as np
import pandas
import pytest
from reference.browser import browser
from reference.dated_cases import FLOWS, START, TIMES, fed, table
from reference.resumed_runs import killed_and_resumed
from reference.scenes import scene

import fvsolve
from fvsolve.core.output.fields import read_series

STEADY = {"time": list(TIMES), "value": [f"{flow} l/s" for flow in FLOWS]}
LIMIT = {"high": {"on": "main", "quantity": "pressure", "maximum": "1 bar"}}


def read_seconds(folder) -> list[float]:
    """Times of the frames of a run [s]."""
    return [t for t, _ in read_series(folder / "fields.pvd")]


def clock(t) -> np.ndarray:
    return np.datetime64("2026-03-01T06:00:00") + np.round(np.asarray(t) * 1e6).astype(
        "timedelta64[us]"
    )


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same case without and with a start time, run into folders."""
    folder = tmp_path_factory.mktemp("runs")
    cases = {"plain": fed(STEADY, None, limits=LIMIT), "dated": fed(STEADY, limits=LIMIT)}
    return {
        name: fvsolve.run(case, out=folder / name, pictures=True) for name, case in cases.items()
    }


def test_dates_are_the_only_difference_of_the_files(runs):
    plain, dated = (runs[name].directory for name in ("plain", "dated"))
    rows = [list(csv.reader((folder / "history.csv").open())) for folder in (plain, dated)]
    assert [row[1] for row in rows[1]][0] == "time"
    assert [row[:1] + row[2:] for row in rows[1]] == rows[0]
    rows = [list(csv.reader((folder / "envelope.csv").open())) for folder in (plain, dated)]
    assert rows[1][0][-2:] == ["time_min", "time_max"]
    assert [row[:-2] for row in rows[1]] == rows[0]
    for name in sorted(path.name for path in (plain / "fields").iterdir()):
        assert (plain / "fields" / name).read_bytes() == (dated / "fields" / name).read_bytes()
    summaries = [json.loads((folder / "summary.json").read_text()) for folder in (plain, dated)]
    assert summaries[1].pop("start_time") == START and "start_time" not in summaries[0]
    changing = ("seconds", "seconds_setup", "seconds_total", "cost", "versions")
    left, right = ({k: v for k, v in item.items() if k not in changing} for item in summaries)
    assert left == right


def test_pandas_reads_the_dates_of_the_history_and_of_the_envelope(runs):
    result = runs["dated"]
    history = pandas.read_csv(result.directory / "history.csv", parse_dates=["time"])
    assert (history["time"].dt.tz_localize(None).to_numpy() == clock(history["t [s]"])).all()
    envelope = pandas.read_csv(
        result.directory / "envelope.csv", parse_dates=["time_min", "time_max"]
    )
    for side in ("min", "max"):
        dates = envelope[f"time_{side}"].dt.tz_localize(None).to_numpy()
        assert (dates == clock(envelope[f"t_{side} [s]"])).all()


def test_results_in_memory_and_from_a_folder_have_the_same_dates(runs, tmp_path):
    opened = fvsolve.open_run(runs["dated"].directory)
    kept = fvsolve.run(fed(STEADY, limits=LIMIT))
    for result in (opened, kept):
        assert result.times.dtype == "datetime64[us]"
        assert (result.times == clock(result.seconds)).all()
    assert np.array_equal(opened.envelope["main"]["t_max"], kept.envelope["main"]["t_max"])
    with pytest.raises(fvsolve.FvsolveError, match="the case has no start time"):
        _ = runs["plain"].times


def test_times_in_another_unit_and_start_have_the_same_dates(tmp_path):
    case = fed(STEADY)
    case["output"]["units"] = {"time": "min"}
    case["numerics"]["start"] = 20.0
    result = fvsolve.run(case, out=tmp_path / "run")
    history = pandas.read_csv(tmp_path / "run" / "history.csv", parse_dates=["time"])
    assert history["t [min]"].iloc[0] == pytest.approx(1.0 / 3.0)
    assert result.times[0] == np.datetime64("2026-03-01T06:00:20")
    assert (history["time"].dt.tz_localize(None).to_numpy() == result.times).all()


def test_a_resumed_run_continues_the_dates(tmp_path):
    fvsolve.run(fed(STEADY), out=tmp_path / "whole")
    broken = killed_and_resumed(tmp_path / "whole", 40.0)
    assert (broken / "history.csv").read_bytes() == (
        tmp_path / "whole" / "history.csv"
    ).read_bytes()
    assert (broken / "envelope.csv").read_bytes() == (
        tmp_path / "whole" / "envelope.csv"
    ).read_bytes()


def test_a_resumed_run_refuses_another_start_time(tmp_path):
    fvsolve.run(fed(STEADY), out=tmp_path / "run")
    with pytest.raises(fvsolve.RunError, match="numerics.start_time"):
        fvsolve.run(fed(STEADY, "2027-03-01T06:00:00Z"), out=tmp_path / "run", resume=True)


def test_the_resolved_case_runs_again_to_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flow = {"file": table(tmp_path / "q.csv")}
    fvsolve.run(fed(flow), out=tmp_path / "first")
    fvsolve.run(tmp_path / "first" / "case.toml", out=tmp_path / "again")
    for name in ("history.csv", "case.toml", "q.csv"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_printed_results_name_the_dates(runs, fvs, tmp_path):
    text = fvs("run", runs["dated"].directory / "case.toml", "--out", tmp_path / "again")[1]
    for line in ("finished at t = 100 s (2026-03-01T06:01:40Z)", " (2026-03-01T06:0"):
        assert line in text
    [verdict] = [line for line in text.splitlines() if "high: pressure" in line]
    assert f"s ({START[:14]}" in verdict
    note = fvs("check", runs["dated"].directory / "case.toml", "--set", "numerics.end=70")[1]
    assert "90 s (2026-03-01T06:01:30Z), after the end of the run at 70 s (2026" in note
    plain = fvs("run", runs["plain"].directory / "case.toml", "--out", tmp_path / "plain")[1]
    assert "2026" not in plain


def test_pictures_and_report_have_axes_of_dates(runs, fvs):
    [*axes] = runs["dated"].plot().axes
    assert axes[-1].get_xlabel() == "time [UTC]"
    low, high = axes[-1].get_xlim()
    assert (high - low) * 86400.0 == pytest.approx(100.0, abs=1e-3)
    assert runs["plain"].plot().axes[-1].get_xlabel() == "time [s]"
    folder = runs["dated"].directory
    assert fvs("report", folder)[0] == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert fvs("report", runs["plain"].directory)[0] == 0
    plain = (runs["plain"].directory / "report.html").read_text(encoding="utf-8")
    axis = '"range":["2026-03-01 06:00:00.000000","2026-03-01 06:01:40.000000"],"type":"date"'
    assert axis in page and "2026-03-01T06:01:" in page
    assert axis not in plain and "2026-03-01" not in plain


def test_a_browser_in_another_zone_shows_the_dates_of_the_case(runs, fvs):
    folder = runs["dated"].directory
    assert fvs("report", folder)[0] == 0
    with browser() as started:
        page = started.new_page(timezone_id="America/New_York")
        page.goto((folder / "report.html").as_uri())
        page.wait_for_selector(".xtick text")
        ticks = page.eval_on_selector_all(".xtick text", "all => all.map(one => one.textContent)")
    first = [text for text in ticks if "Mar 1, 2026" in text]
    assert first and all(text.startswith("06:00") for text in first), ticks


@pytest.mark.parametrize("start", [START, "2026-03-01T07:00:00+01:00", "2026-03-01T06:00:00"])
def test_xarray_reads_the_clock_times_of_a_grid(start, tmp_path):
    pool = {"type": "basin", "size": [4.0, 2.0], "cells": [4, 2], "level": 1.0, "elevation": 0.0}
    case = scene({"pool": pool}, {}, 10.0, {"scheme": "muscl", "start_time": start})
    grid = {"basin": "pool", "fields": ["depth"], "format": "netcdf", "cell": "1 m"}
    case["output"] |= {"fields": 3, "grids": {"flood": grid}}
    fvsolve.run(case, out=tmp_path / "run")
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(tmp_path / "run" / "grids" / "flood.nc", engine="scipy") as data:
        times = data["time"].values.astype("datetime64[us]")
    gap = times - clock(read_seconds(tmp_path / "run"))
    assert len(times) > 2 and (np.abs(gap) <= np.timedelta64(1, "us")).all()
