"""Files of time series with dates: the same numbers in any form, zone and separator, and faults with their lines."""

import datetime

import numpy as np
import pandas
import pytest
from reference.dated_cases import FLOWS, STAMPS, START, TIMES, fed, table
from reference.rainfall import OPEN, field
from reference.refusals import refused
from scipy.io import netcdf_file

import fvsolve

LOCAL = [text[:-1].replace("T", " ") for text in STAMPS]
GERMAN = [f"{text[8:10]}.{text[5:7]}.{text[:4]} {text[11:19]}" for text in STAMPS]
ENGLISH = [f"{text[8:10]}/{text[5:7]}/{text[:4]} {text[11:19]}" for text in STAMPS]
AMERICAN = [f"{text[5:7]}/{text[8:10]}/{text[:4]} {text[11:19]}" for text in STAMPS]
INDIAN = [f"2026-03-01T11:{int(text[14:16]) + 30}:{text[17:19]}+05:30" for text in STAMPS]
WORDS = {
    "UTC": (STAMPS, {}, START),
    "another zone": (INDIAN, {}, START),
    "zone of the file": (LOCAL, {"time_zone": "UTC"}, START),
    "local": (LOCAL, {}, START[:-1]),
    "start in another zone": (STAMPS, {}, "2026-03-01T07:00:00+01:00"),
    "days first, dots": (GERMAN, {}, START[:-1]),
    "days first": (ENGLISH, {"date_order": "day-month-year"}, START[:-1]),
    "months first": (AMERICAN, {"date_order": "month-day-year"}, START[:-1]),
}


@pytest.mark.parametrize("words", WORDS)
def test_dates_in_any_words_give_the_schedule_of_seconds(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stamps, keys, start = WORDS[words]
    case = fvsolve.load(fed({"file": table(tmp_path / "q.csv", stamps), **keys}, start))
    flow = case.nodes["source"].flow
    assert flow.time.tolist() == list(TIMES)
    assert flow.value.tolist() == [value / 1000.0 for value in FLOWS]


def test_fractions_of_seconds_are_those_of_a_column_of_seconds(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seconds = [0.1, 0.2, 0.3, 3600.7, 86400.1]
    first = datetime.datetime(2026, 3, 1, 6)
    stamps = [(first + datetime.timedelta(seconds=t)).isoformat() for t in seconds]
    values = [1.0] * len(seconds)
    dated = fed({"file": table(tmp_path / "dates.csv", stamps, values)}, START[:-1])
    plain = fed({"file": table(tmp_path / "plain.csv", seconds, values, "t [s];flow [l/s]")}, None)
    found = [fvsolve.load(case).nodes["source"].flow.time.tolist() for case in (dated, plain)]
    assert found[0] == found[1] == seconds


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("coding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_european_file_of_excel_gives_the_schedule(coding, ending, tmp_path, monkeypatch):
    """Its first line states the separator; dates have dots, numbers have decimal commas, and cells have quotes."""
    monkeypatch.chdir(tmp_path)
    rows = [
        f"{stamp};{str(flow).replace('.', ',')}" for stamp, flow in zip(GERMAN, FLOWS, strict=True)
    ]
    text = ending.join(["sep=;", '"Zeit (MEZ)";"Abfluß [l/s]"', *rows, ""])
    (tmp_path / "q.csv").write_bytes(text.encode(coding))
    case = fvsolve.load(fed({"file": "q.csv", "time_zone": "+01:00"}, "2026-03-01T05:00:00Z"))
    assert case.nodes["source"].flow.time.tolist() == list(TIMES)


@pytest.mark.parametrize("form", ["csv", "xlsx"])
def test_a_column_of_dates_and_a_column_of_clock_times_are_dates(form, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    days = [datetime.datetime.fromisoformat(text) for text in STAMPS]
    rows = [(day.date(), day.time(), flow) for day, flow in zip(days, FLOWS, strict=True)]
    frame = pandas.DataFrame(rows, columns=["Datum", "Uhrzeit", "Q [l/s]"])
    if form == "csv":
        frame.to_csv("q.csv", index=False, sep=";", decimal=",", date_format="%d.%m.%Y")
    else:
        frame.to_excel("q.xlsx", index=False)
    given = {"file": f"q.{form}", "time": ["Datum", "Uhrzeit"], "value": "Q"}
    case = fed(given, START[:-1], compare={"main.flow": given})
    fvsolve.run(case, out="run")
    for found in (fvsolve.load(case), fvsolve.load("run/case.toml")):
        assert found.nodes["source"].flow.time.tolist() == list(TIMES)
        assert found.compare["main.flow"].t.tolist() == list(TIMES)
    assert "is not a date; expected a column of dates" in str(
        refused(fed(given | {"time": ["Q", "Uhrzeit"]}, START[:-1]))
    )
    for bad in (["Datum"], 5):
        assert "flow.time: " in str(refused(fed(given | {"time": bad}, START[:-1])))


def test_a_header_may_state_the_zone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    later = [text.replace(" 06", " 08") for text in LOCAL]
    name = table(tmp_path / "q.csv", later, head="Zeit [UTC+2];flow [l/s]")
    assert fvsolve.load(fed({"file": name})).nodes["source"].flow.time.tolist() == list(TIMES)


def test_a_measurement_with_dates_is_compared_at_the_same_times(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flow = table(tmp_path / "q.csv", STAMPS)
    dated = {"main.flow": {"file": flow, "shift": "2 s"}}
    local = {
        "main.flow": {
            "file": table(tmp_path / "rig.csv", LOCAL),
            "time_zone": "UTC",
            "shift": "2 s",
        }
    }
    runs = [fvsolve.run(fed({"file": flow}, compare=compare)) for compare in (dated, local)]
    rows = [run.comparisons[0]._replace(file="") for run in runs]
    assert rows[0] == rows[1] and rows[0].points == 4 and rows[0].rms > 0.0


@pytest.mark.parametrize(
    "since, start, zero",
    [
        ("seconds since 2026-03-01 06:00:00", START, 0.0),
        ("minutes since 2026-03-01T05:00:00", START, -3600.0),
        ("hours since 2026-03-01 07:00:00 +01:00", START, 0.0),
        ("days since 2026-2-28 6:00:0.0", START, -86400.0),
        ("seconds since 2026-03-01 06:00:10", "2026-03-01T06:00:00", 10.0),
        ("seconds since 2026-03-01 06:00:10", None, None),
        ("seconds since start", START, None),
    ],
)
def test_frames_of_rain_stand_at_their_dates(since, start, zero, tmp_path):
    """Without dates or start time the first frame is at t = 0, or times count from the start."""
    unit = {"seconds": 1.0, "minutes": 60.0, "hours": 3600.0, "days": 86400.0}[since.split()[0]]
    times = np.array([3.0, 4.0, 6.0])
    with netcdf_file(tmp_path / "rain.nc", "w") as file:
        for name, at, text in (
            ("time", times, since),
            ("y", [5.0, 15.0], "m"),
            ("x", [5.0, 15.0], "m"),
        ):
            file.createDimension(name, len(at))
            item = file.createVariable(name, "d", (name,))
            item[:], item.units = at, text
        item = file.createVariable("rr", "d", ("time", "y", "x"))
        item[:], item.units = np.ones((3, 2, 2)), "mm/h"
    case = field(40.0, {}, OPEN, rain={"raster": str(tmp_path / "rain.nc")})
    case["numerics"] |= {} if start is None else {"start_time": start}
    found = fvsolve.load(case).nodes["field"].rain.times
    expected = unit * times + zero if zero is not None else unit * times
    if start is None:
        expected = expected - expected[0]
    assert found == pytest.approx(expected, rel=1e-15, abs=1e-9)


FAULTS = {
    "no start time": (
        STAMPS,
        {},
        None,
        'q.csv, line 2: "2026-03-01T06:00:00Z" is a date, and the case has no start time; expected '
        "numerics.start_time, for example 2026-03-01T06:00:00Z",
    ),
    "ambiguous": (
        ENGLISH,
        {},
        START[:-1],
        'q.csv, line 2: "01/03/2026" is ambiguous; expected the key `date_order`',
    ),
    "other order": (
        ["31/03/2026", "01/04/2026", "02/04/2026", "03/04/2026"],
        {"date_order": "month-day-year"},
        START[:-1],
        'q.csv, line 2: "31/03/2026" is not a day of the calendar; date_order is "month-day-year"',
    ),
    "mixed zones": (
        [*STAMPS[:2], *LOCAL[2:]],
        {},
        START,
        'q.csv, line 4: "2026-03-01 06:01:00" and',
    ),
    "zone only in the file": (
        STAMPS,
        {},
        START[:-1],
        "has a zone, and numerics.start_time = 2026-03-01T06:00:00 has none",
    ),
    "zone only in the case": (
        LOCAL,
        {},
        START,
        "has no zone, and numerics.start_time = 2026-03-01T06:00:00Z has a zone",
    ),
    "unordered": (
        [STAMPS[0], STAMPS[2], STAMPS[1], STAMPS[3]],
        {},
        START,
        'q.csv, line 4: "2026-03-01T06:00:30Z" comes after',
    ),
    "repeated": (
        [STAMPS[0], *STAMPS[:3]],
        {},
        START,
        'q.csv, line 3: "2026-03-01T06:00:00Z" is the same time as',
    ),
    "repeated hour": (
        ["2026-10-25 01:30", "2026-10-25 02:00", "2026-10-25 02:30", "2026-10-25 02:00"],
        {},
        START[:-1],
        "repeated at the end of daylight saving time; expected rising times: standard time all year, or an offset",
    ),
    "number among dates": ([*STAMPS[:3], 90.0], {}, START, 'q.csv, line 5: "90.0" is not a date'),
    "date among numbers": (
        [0.0, 30.0, *STAMPS[2:]],
        {},
        START,
        'line 4: "2026-03-01T06:01:00Z" is not a number',
    ),
    "order for numbers": (
        TIMES,
        {"date_order": "day-month-year"},
        START,
        "has numbers, not dates; leave out `date_order`",
    ),
    "name of a zone": (
        LOCAL,
        {"time_zone": "Europe/Berlin"},
        START,
        '"Europe/Berlin" is not an offset from UTC',
    ),
    "two zones": (STAMPS, {"time_zone": "+01:00"}, START, "has another zone than the file, +01:00"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_dates_name_line_and_remedy(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stamps, keys, start, message = FAULTS[name]
    error = str(refused(fed({"file": table(tmp_path / "q.csv", stamps), **keys}, start)))
    assert message in error and error.splitlines()[1].startswith("  nodes.source.flow.")


def test_a_unit_of_time_over_dates_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = table(tmp_path / "q.csv", head="t [s];flow [l/s]")
    assert 'has the unit "s", but "2026-03-01T06:00:00Z" is a date' in str(
        refused(fed({"file": name}))
    )


@pytest.mark.parametrize(
    "start, message",
    [
        ("01/03/2026", 'numerics.start_time: "01/03/2026" is ambiguous'),
        (5, "numerics.start_time: 5 is not a date; expected for example 2026-03-01T06:00:00Z"),
        (datetime.time(6), 'numerics.start_time: "06:00:00" has no date'),
        (
            "9999-12-31T23:59:00",
            "numerics.start_time: 9999-12-31T23:59:00 with a run from 0 s to 100 s leaves the years",
        ),
    ],
)
def test_a_faulty_start_time_is_the_only_fault_of_a_file_with_dates(
    start, message, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    error = refused(fed({"file": table(tmp_path / "q.csv")}, start))
    assert message in str(error) and len(error.faults) == 1


@pytest.mark.parametrize("year, end", [("2025", "before"), ("2027", "after"), ("2026", None)])
def test_a_file_outside_the_run_is_noted_with_its_dates(year, end, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stamps = [text.replace("2026", year) for text in STAMPS]
    case = fvsolve.load(fed({"file": table(tmp_path / "q.csv", stamps)}))
    texts = [notice.text for notice in case.notices if "outside the run" in notice.text]
    assert len(texts) == (end is not None)
    for text in texts:
        assert f"s ({year}-03-01T06:00:00Z) to" in text and "100 s (2026-03-01T06:01:40Z)" in text


def test_a_changed_start_time_moves_the_schedule_of_an_earlier_case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = fvsolve.load(fed({"file": table(tmp_path / "q.csv")}))
    later = fvsolve.load(case, set={"numerics.start_time": "2026-03-01T05:59:00Z"})
    assert later.nodes["source"].flow.time.tolist() == [t + 60.0 for t in TIMES]
