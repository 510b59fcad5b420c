"""A sheet has equal rows in a file, on a terminal, as JSON and in a frame; unknown values are empty."""

import csv
import json
import math
from dataclasses import dataclass

import numpy as np

from fvsolve.core.output.result_table import Column, PlainData, ResultTable, cell_text, columns
from fvsolve.core.output.summary_file import plain

COLUMNS = (
    Column("name"),
    Column("step", "step [s]", ".3g"),
    Column("whole", words=lambda row: f"<{row['name']}>"),
)
ROWS = [
    {"name": "a, b", "step": np.float64(1.0 / 3.0), "whole": 1},
    {"name": "c", "step": math.nan, "whole": None},
]


def test_a_file_reads_back_to_the_last_bit_and_has_nothing_for_unknown_values(tmp_path):
    with open(
        ResultTable(COLUMNS, ROWS).write(tmp_path / "sheet.csv"), encoding="utf-8", newline=""
    ) as file:
        header, first, second = csv.reader(file)
    assert header == ["name", "step [s]", "whole"]
    assert first[0] == "a, b" and float(first[1]) == 1.0 / 3.0
    assert second == ["c", "", ""]


def test_json_and_frame_have_the_keys_and_the_terminal_the_words():
    made = ResultTable(COLUMNS, [ROWS[0], {"name": "c"}])
    assert json.loads(json.dumps(made.plain(), allow_nan=False))[1] == {
        "name": "c",
        "step": None,
        "whole": None,
    }
    assert made.table_columns() == {
        "name": ["a, b", "c"],
        "step": [1.0 / 3.0, None],
        "whole": [1, None],
    }
    assert made.words() == (
        ["name", "step [s]", "whole"],
        [["a, b", "0.333", "<a, b>"], ["c", "-", "<c>"]],
    )
    assert [one.title for one in columns(step="step [s]", mark="mark")] == ["step [s]", "mark"]


def test_values_in_words():
    assert [cell_text(one, ".2g") for one in (None, True, False, "none", 0.123, 7)] == [
        "-",
        "yes",
        "no",
        "none",
        "0.12",
        "7",
    ]


@dataclass(frozen=True)
class Pole(PlainData):
    at: complex
    limit: float

    also = ("size",)

    @property
    def size(self) -> float:
        return abs(self.at)


def test_plain_data_of_an_object_are_its_fields_and_the_requested_names():
    assert Pole(3.0 + 4.0j, math.inf).plain() == {"at": [3.0, 4.0], "limit": None, "size": 5.0}
    assert plain({"poles": (Pole(1j, 2.0),)}) == {
        "poles": [{"at": [0.0, 1.0], "limit": 2.0, "size": 1.0}]
    }
