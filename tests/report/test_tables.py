"""Pressure cycles are counted as in ASTM E1049, and the used share of the fatigue strength follows from them.

Sections, tables and the workbook of a report are complete.
"""

import json
import re
import zipfile

import numpy as np
import pytest
from reference.scenes import junction, lake, pipe, reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.core.output.result_table import ResultTable
from fvsolve.errors import FvsolveError
from fvsolve.report.cycles import FatigueStrength, count_cycles, cycles
from fvsolve.report.long_section import section_of, section_paths
from fvsolve.report.report_files import write_report
from fvsolve.report.tables import aligned_texts, numeric_columns, value_text, walls

ASTM = np.array([-2, 1, -3, 5, -1, 3, -4, 4, -2], float)  # ASTM E1049-85, figure 6
RANGES = {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}  # its table


def test_the_standards_example_is_counted_as_its_table_has_it() -> None:
    assert dict(count_cycles(ASTM, bins=9)) == RANGES
    assert dict(count_cycles(np.repeat(ASTM, 3), bins=9)) == RANGES
    assert count_cycles(np.full(10, 3.0)) == [] and count_cycles(np.zeros(1)) == []


def swung() -> dict:
    """Case of a valve between two reservoirs, one of which oscillates 20 times by 2 bar."""
    swing = {"mean": 5e5, "amplitude": 1e5, "period": 0.5}
    nodes = {"swung": reservoir(swing), "still": reservoir(4e5)}
    return scene(
        nodes,
        {"tap": valve("swung", "still", 1e-4)},
        10.0,
        {"method": "rk4", "step": 0.01},
        ["swung.pressure", "still.pressure", "tap.flow"],
        every=0.0125,
    )


def test_a_swing_uses_its_share() -> None:
    found = {
        one["probe"]: one
        for one in cycles(fvsolve.run(swung()), None, FatigueStrength(4e5, 1e6, 3.0))
    }
    assert set(found) == {"swung.pressure", "still.pressure"}
    (size, count), *small = found["swung.pressure"]["cycles"]
    assert size == pytest.approx(2e5, rel=1e-3) and count == pytest.approx(20.0, abs=0.6)
    assert sum(many for _, many in small) <= 1.0
    assert found["swung.pressure"]["share"] == pytest.approx(20.0 / 8e6, rel=0.05)
    assert found["still.pressure"] == {
        "probe": "still.pressure",
        "unit": "Pa",
        "cycles": [],
        "share": 0.0,
    }


def test_rows_too_coarse_for_the_waves_are_refused() -> None:
    """Rows every 0.5 s of a wave of 0.5 s are all alike: no cycle would be counted, and the life would be unlimited."""
    case = swung() | {
        "output": {"every": 0.5, "fields": 0, "probes": ["swung.pressure", "still.pressure"]}
    }
    result = fvsolve.run(case)
    with pytest.raises(FvsolveError) as caught:
        cycles(result, None, FatigueStrength(4e5, 1e6, 3.0))
    assert "swung.pressure: the rows have a range of" in str(
        caught.value
    ) and "output.every" in str(caught.value)
    assert cycles(result, ["still.pressure"])[0]["cycles"] == []


def test_the_command_states_the_duration(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "swung.toml").write_text(write(swung()))
    fvs("run", "swung.toml", "--no-pictures")
    ask = (
        "fatigue",
        "runs/swung",
        "--probes",
        "swung.pressure",
        "--range",
        "4e5",
        "--allowable-range",
        "1e6",
        "--slope",
        "3",
    )
    status, text, _ = fvs(*ask, "--per-day", "100")
    assert status == 0 and "years" in text and "range up to" in text
    assert json.loads(fvs(*ask, "--json")[1])["probes"][0]["share"] == pytest.approx(
        20.0 / 8e6, rel=0.05
    )
    assert fvs("fatigue", "runs/swung", "--range", "4e5")[0] == 2
    assert fvs("fatigue", "runs/nowhere")[0] == 2


def test_series_without_cycles_are_named() -> None:
    with pytest.raises(FvsolveError, match='did you mean "swung.pressure"'):
        cycles(fvsolve.run(swung()), ["swung.presure"])


def test_endured_cycles_are_those_of_basquins_law() -> None:
    assert FatigueStrength(4e5, 1e6, 3.0).allowed(4e5) == 1e6
    assert FatigueStrength(4e5, 1e6, 3.0).allowed(2e5) == 8e6


@pytest.fixture(scope="module")
def fork(tmp_path_factory):
    """Run of three pipes in a row, the middle one reversed, with a branch and a parallel pipe."""
    nodes = {
        "high": lake("50 m", elevation=0.0),
        "a": junction(elevation=10.0),
        "b": junction(elevation=20.0),
        "low": lake("30 m", elevation=5.0),
        "end": junction(1e-3, elevation=0.0),
    }
    links = {
        "first": pipe("high", "a", 400.0, 0.3, 1000.0, 8),
        "second": pipe("b", "a", 300.0, 0.3, 1000.0, 6),
        "third": pipe("b", "low", 500.0, 0.3, 1000.0, 10),
        "branch": pipe("a", "end", 100.0, 0.2, 1000.0, 2),
        "beside": pipe("a", "b", 350.0, 0.3, 1000.0, 7),
    }
    friction = {"friction": {"model": "steady", "factor": 0.02}}
    links = {name: one | friction for name, one in links.items()}
    case = scene(nodes, links, 0.5, {}, ["a.head"], title="=1+1")
    return fvsolve.run(case, out=tmp_path_factory.mktemp("runs") / "fork", pictures=False)


def test_sections_are_the_longest_ways_and_run_down_the_head(fork):
    found = section_paths(fork)
    assert [[leg.pipe for leg in way.legs] for way in found] == [
        ["first", "second", "third"],
        ["branch", "beside"],
    ]
    longest = found[0]
    assert [(leg.begin, leg.backwards) for leg in longest.legs] == [
        (0.0, False),
        (400.0, True),
        (700.0, False),
    ]
    assert longest.places == [("high", 0.0), ("a", 400.0), ("b", 700.0), ("low", 1200.0)]


def test_a_section_is_a_single_line_along_its_chainage(fork):
    one = section_of(fork, section_paths(fork)[0])
    assert one.chainage == pytest.approx(25.0 + 50.0 * np.arange(24))  # all cells are 50 m long
    points = [0.0, 400.0, 700.0, 1200.0], [0.0, 10.0, 20.0, 5.0]
    assert one.along["elevation"] == pytest.approx(np.interp(one.chainage, *points))
    assert (np.diff(one.along["initial_head"]) < 0).all() and one.cavity_spans == []
    assert [device.parts for device in one.devices] == [
        ("high (reservoir)",),
        (),
        (),
        ("low (reservoir)",),
    ]


def test_numbers_of_a_column_are_aligned_on_their_points():
    plain = [
        text.replace("\u2007", "0").replace("\u2008", ".")
        for text in aligned_texts([1.5, 22.25, 333.0, None])
    ]
    assert plain[:3] == ["1.50", "22.25", "333.00"]
    assert len({len(text.partition(".")[2]) for text in aligned_texts([0.001, 12.0, 5.5])}) == 1
    assert (
        value_text(12345.678) == "12\u202f346"
        and value_text(-0.0) == "0"
        and value_text(1e-12) == "1e\u221212"
    )
    assert value_text(float("nan")) == value_text(None) == "\u2013" and value_text(True) == "yes"
    assert numeric_columns(ResultTable.of("", ("name", "length"), [["a", 1.0], ["b", None]])) == [
        False,
        True,
    ]


def test_rated_pressures_of_pipes_and_their_sources_are_a_table_of_their_own(tmp_path):
    units = {
        "output.units": {"pressure": "barg", "length": "mm"},
        "numerics.end": 0.1,
        "expect": {},
    }
    found = walls(fvsolve.run("plastic-main", set=units, out=tmp_path / "run", pictures=False))
    assert [column.unit for column in found.columns[:3]] == ["", "bar", "mm"]
    assert [row[0] for row in found.rows] == ["upper", "lower"]
    assert [row[1] for row in found.rows] == pytest.approx([16.0, 16.0])  # PE100, SDR 11, C = 1.25
    assert [row[2] for row in found.rows] == pytest.approx([200.0 / 11.0, 160.0 / 11.0])
    assert "ISO 4427" in found.rows[0][4]


def test_the_workbook_holds_every_row_and_no_formula(fork, tmp_path):
    page, book = write_report(fork.directory, tmp_path / "handed.html", xlsx=True)
    assert (page.name, book.name) == ("handed.html", "handed.xlsx")
    with zipfile.ZipFile(book) as found:
        sheets = {
            name: found.read(name).decode()
            for name in found.namelist()
            if name.startswith("xl/worksheets/")
        }
        names = re.findall(r'<sheet name="([^"]+)"', found.read("xl/workbook.xml").decode())
    assert not any("<f>" in text for text in sheets.values()) and {
        "Summary",
        "Pipes",
        "Ledgers",
    } <= set(names)
    which = 1 + next(k for k, name in enumerate(names) if name.startswith("Section first"))
    along = sheets[f"xl/worksheets/sheet{which}.xml"]
    assert along.count("<row ") == 1 + 24
    values = [float(text) for text in re.findall("<v>([^<]+)</v>", along)]
    assert float(fork.envelope["first"]["max_pressure"].max()) == pytest.approx(
        max(values), rel=1e-14
    )
