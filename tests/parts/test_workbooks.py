"""Sheets of Excel workbooks: dates and numbers as they are, and faults that name sheet, cell and remedy."""

import datetime
import subprocess
import sys

import numpy as np
import openpyxl
import pandas
import pytest
from openpyxl import Workbook
from reference.dated_cases import fed
from reference.refusals import refused

import fvsolve
from fvsolve.parts.csv_rows import read_rows

FIRST = datetime.datetime(2026, 3, 1, 6)
HEADER = ["Datum", "Q [l/s]"]


def save(path, rows, name="Q", change=lambda sheet: None) -> dict[str, str]:
    """Write a workbook with a sheet; returns the table { file } of a case file."""
    book = Workbook()
    book.active.title = name
    for row in rows:
        book.active.append(row)
    change(book.active)
    book.save(path)
    return {"file": str(path)}


def rows_each(step: datetime.timedelta, count: int) -> list:
    return [HEADER, *([FIRST + k * step, k / 10] for k in range(count))]


@pytest.mark.parametrize("step", [datetime.timedelta(minutes=10), datetime.timedelta(seconds=1)])
def test_dates_of_excel_are_exact_seconds(step, tmp_path):
    """Excel stores a date as a fraction of a day, in which ten minutes are not exact."""
    given = save(tmp_path / "q.xlsx", rows_each(step, 500))
    flow = fvsolve.load(fed(given, FIRST.isoformat())).nodes["source"].flow
    assert (flow.time == step.total_seconds() * np.arange(500)).all()
    assert (flow.value == np.array([k / 10 for k in range(500)]) / 1000.0).all()


def test_a_workbook_of_pandas_with_the_calendar_of_1904_has_the_same_dates(tmp_path):
    frame = pandas.DataFrame(rows_each(datetime.timedelta(minutes=7), 20)[1:], columns=HEADER)
    frame.to_excel(tmp_path / "a.xlsx", index=False)
    book = openpyxl.load_workbook(tmp_path / "a.xlsx")
    book.epoch = openpyxl.utils.datetime.CALENDAR_MAC_1904
    book.save(tmp_path / "b.xlsx")
    found = [read_rows(tmp_path / name).cells for name in ("a.xlsx", "b.xlsx")]
    assert found[0] == found[1] and found[0][1][0] == "2026-03-01 06:07:00"


def test_empty_rows_columns_and_comments_are_left_out(tmp_path):
    dates = [FIRST, FIRST.replace(hour=7)]
    rows = [
        [],
        ["# station 12"],
        [None, *HEADER],
        [],
        [None, dates[0], 1.5],
        [],
        [None, dates[1], 2],
    ]
    save(tmp_path / "q.xlsx", rows)
    found = read_rows(tmp_path / "q.xlsx")
    assert found.header == HEADER and found.lines == [5, 7]
    assert found.cells == [["2026-03-01 06:00:00", "1.5"], ["2026-03-01 07:00:00", "2"]]


def test_hidden_rows_and_columns_are_read(tmp_path):
    def hide(sheet):
        sheet.row_dimensions[3].hidden = True
        sheet.column_dimensions["B"].hidden = True

    rows = rows_each(datetime.timedelta(seconds=20), 4)
    save(tmp_path / "shown.xlsx", rows)
    save(tmp_path / "hidden.xlsx", rows, change=hide)
    assert read_rows(tmp_path / "hidden.xlsx").cells == read_rows(tmp_path / "shown.xlsx").cells


def test_a_changed_workbook_is_read_again(tmp_path):
    for value in (1.5, 2.5):
        save(tmp_path / "q.xlsx", [["t [s]", "Q"], [0, value], [1, 2.0]])
        assert read_rows(tmp_path / "q.xlsx").cells[0][1] == str(value)


def formula(sheet):
    sheet["B3"] = "=B2*2"


def percent(sheet):
    sheet["B1"] = "opening [%]"
    sheet["B3"].number_format = "0.0%"


def second(sheet):
    sheet.parent.create_sheet("H")


def put(cell, value):
    return lambda sheet: sheet.__setitem__(cell, value)


FAULTS = {
    "merged": (lambda sheet: sheet.merge_cells("A1:B1"), 'sheet "Q": cells A1:B1 are merged; expected a header'),
    "title": (lambda sheet: sheet.insert_rows(1), ""),
    "formula": (formula, 'sheet "Q": cell B3 holds a formula without a stored value; expected a workbook that'),
    "text": (put("B3", "1,5"), 'line 3: "1,5" is stored as text in column "Q [l/s]"; expected a number'),
    "word": (put("B3", "none"), 'line 3: "none" is not a number in column "Q [l/s]"'),
    "error": (put("B3", "#DIV/0!"), 'line 3: "#DIV/0!" is not a number'),
    "truth": (put("B3", True), 'line 3: "TRUE" is not a number'),
    "gap": (put("B3", None), 'line 3: "" is not a number'),
    "no header": (put("B1", None), 'line 2: "0" has no header'),
    "clock": (put("A2", datetime.time(6)), 'line 2: "06:00:00" is not a date'),
    "percent": (percent, 'line 3: 0.1 is shown as a percentage below the header "opening [%]"'),
    "two sheets": (second, 'has 2 sheets: "H", "Q"; expected the key `sheet`'),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_a_sheet_name_cell_and_remedy(name, tmp_path):
    change, message = FAULTS[name]
    given = save(tmp_path / "q.xlsx", rows_each(datetime.timedelta(seconds=20), 4), change=change)
    case = fed(given, FIRST.isoformat())
    if not message:
        assert fvsolve.load(case).nodes["source"].flow.time[-1] == 60.0
        return
    error = str(refused(case))
    assert message in error and error.splitlines()[1].startswith("  nodes.source.flow.file: q.xlsx")


def test_other_files_are_refused_with_a_remedy(tmp_path):
    rows = rows_each(datetime.timedelta(seconds=20), 4)
    good = save(tmp_path / "q.xlsx", rows)
    (tmp_path / "old.xls").write_bytes(b"\xd0\xcf\x11\xe0")
    (tmp_path / "bad.xlsx").write_bytes(b"\xd0\xcf\x11\xe0")
    (tmp_path / "cut.xlsx").write_bytes((tmp_path / "q.xlsx").read_bytes()[:900])
    (tmp_path / "q.csv").write_text("t [s],Q\n0,1\n1,2\n")
    for given, message in (
        (
            {"file": str(tmp_path / "old.xls")},
            "old.xls is a spreadsheet of the format .xls; expected it saved as .xlsx",
        ),
        (
            {"file": str(tmp_path / "bad.xlsx")},
            "bad.xlsx is not an Excel workbook, or a password protects it",
        ),
        ({"file": str(tmp_path / "cut.xlsx")}, "cut.xlsx is not an Excel workbook"),
        (
            {"file": str(tmp_path / "q.csv"), "sheet": "Q"},
            "q.csv is not an Excel workbook and has no sheets; leave out `sheet`",
        ),
        ({**good, "sheet": "q"}, 'q.xlsx has no sheet "q"; did you mean "Q"?'),
        ({**good, "value": "H"}, 'q.xlsx has no column "H"'),
    ):
        assert message in str(refused(fed(given, FIRST.isoformat())))


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    given = save(tmp_path / "q.xlsx", rows_each(datetime.timedelta(seconds=20), 4))
    for name in [name for name in sys.modules if name.partition(".")[0] == "openpyxl"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    error = str(refused(fed(given, FIRST.isoformat())))
    assert (
        'q.xlsx is an Excel workbook, which needs openpyxl: pip install "fvsolve[excel]"' in error
    )


def test_a_run_without_a_workbook_imports_no_library_for_it(tmp_path):
    code = "import fvsolve, sys; fvsolve.run('two-tanks'); assert 'openpyxl' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


def test_a_workbook_that_unpacks_to_much_more_is_refused(tmp_path, monkeypatch):
    from fvsolve.parts import excel_files

    given = save(tmp_path / "q.xlsx", rows_each(datetime.timedelta(seconds=20), 4))
    monkeypatch.setattr(excel_files, "MOST_BYTES", 1000)
    assert "bytes when unpacked; expected at most 1000" in str(
        refused(fed(given, FIRST.isoformat()))
    )
