"""The same table as CSV with commas, as CSV with semicolons and decimal commas, and as a sheet of a workbook."""

import datetime
from pathlib import Path
from typing import Any

from openpyxl import Workbook

FORMS = ("comma", "semicolon", "workbook", "sheet")


def text_of(value: Any, mark: str) -> str:
    """Text of a cell of a CSV file; mark : decimal sign"""
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    return repr(value).replace(".", mark) if isinstance(value, float) else str(value)


def table_file(folder: Path, form: str, header: list[str], rows: list[tuple]) -> dict[str, str]:
    """Write a table in a form of `FORMS`; returns the table { file, sheet } of a case file."""
    if form in ("workbook", "sheet"):
        book = Workbook()
        if form == "sheet":
            book.active.append(["another table"])
            book.create_sheet("Daten 1")
        for row in [header, *rows]:
            book.worksheets[-1].append(row)
        book.save(folder / "table.xlsx")
        return {"file": "table.xlsx"} | ({"sheet": "Daten 1"} if form == "sheet" else {})
    separator, mark = (",", ".") if form == "comma" else (";", ",")
    lines = [separator.join(text_of(value, mark) for value in row) for row in [header, *rows]]
    (folder / "table.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return {"file": "table.csv"}
