"""Texts of users are never markup: not on pictures, on the terminal or in the files of a run."""

import csv
import json
import re
import subprocess
import sys
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread
from reference.scenes import branched, scene, still

import fvsolve
from fvsolve.core.output.fields import read_series
from fvsolve.report.draw.plot import history_figure

TITLE = r"a $\nothing_{$ b, $5 and $6 [bold] [/red] <image> & 100 % \o/"
STEERS = "a\x1b[31mb\u202ec\x07"


@pytest.mark.parametrize(
    "title", [TITLE, "$x$", "$\\foo$", "a$b", STEERS, "ü 水 \U0001f30a", "[/]", "x" * 10**5]
)
@pytest.mark.filterwarnings("ignore:Glyph")
def test_any_title_is_drawn_and_printed_as_it_stands(title, tmp_path, fvs, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(
        fvsolve.load(still(title=title)).resolved(), encoding="utf-8"
    )
    code, out, err = fvs("run", "case.toml")
    assert code == 0 and "could not be drawn" not in err  # a first run reports compilation
    assert title in out or title == STEERS
    assert "\x1b" not in out and "\x07" not in out and "\u202e" not in out
    said = json.loads((tmp_path / "runs" / "case" / "summary.json").read_text())
    assert said["title"] == title and imread(tmp_path / "runs" / "case" / "history.png").size > 0


def test_dollars_are_drawn_as_dollars():
    t = np.linspace(0.0, 1.0, 5)
    made = [
        history_figure(t, t[:, None], [("a.level", "m")], title=title) for title in ("x", "$x$")
    ]
    sizes = [one.get_suptitle() and one._suptitle.get_window_extent().width for one in made]
    dollar = (
        history_figure(t, t[:, None], [("a.level", "m")], title="$")
        ._suptitle.get_window_extent()
        .width
    )
    assert sizes[1] == pytest.approx(sizes[0] + 2.0 * dollar, rel=0.1)


def test_powers_of_ten_stay_powers():
    from matplotlib.text import Text

    from fvsolve.report.draw.accuracy_pictures import order_figure
    from fvsolve.studies.accuracy.fit import Fit

    none = Fit((1.0, 1.0), 1.0, 0.1, ("", "", ""), 1.0)
    figure = order_figure(
        [1.0, 10.0, 100.0], {"h": {"a": ([1.0, 0.1, 1e-7], none)}}, "cells", title="$a$"
    )
    figure.canvas.draw()
    texts = {one.get_text(): one for one in figure.findobj(Text)}
    powers = [one.get_parse_math() for text, one in texts.items() if "mathdefault" in text]
    assert powers and all(powers) and not texts["$a$"].get_parse_math()


def test_units_of_scalars_stand_in_the_files_as_they_are(tmp_path):
    unit = 'mg/l, "dry" <&> [x]'
    pool = {
        "type": "basin",
        "physics": "transport",
        "size": [1.0, 1.0],
        "cells": [4, 4],
        "velocity": {"u": 0, "v": 0},
        "scalars": {"dye": 1.0},
    }
    lines = {"across": {"basin": "pool", "from": [0.1, 0.1], "to": [0.9, 0.9], "points": 3}}
    case = scene(
        {"pool": pool},
        {},
        1.0,
        {"courant": 0.5},
        ["pool.dye@0.5,0.5"],
        0.5,
        scalars={"dye": {"unit": unit}},
    )
    case["output"] |= {"fields": 1, "lines": lines}
    fvsolve.run(case, out=tmp_path / "run")
    for _, path in read_series(tmp_path / "run" / "fields.pvd"):
        assert unit in [one.text for one in ElementTree.parse(path).iter("InformationKey")]
    for path in (
        tmp_path / "run" / "lines" / "across-000000.csv",
        tmp_path / "run" / "history.csv",
    ):
        with open(path, encoding="utf-8", newline="") as file:
            header, row, *_ = csv.reader(file)
        assert header[-1].endswith(f" [{unit}]") and len(row) == len(header)


LIMITED = """
import resource, sys, fvsolve
fvsolve.run("case.toml", pictures=False)
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
from fvsolve.cli import main
sys.argv = ["fvsolve", "run", "case.toml", "--out", "out"]
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes to play a full disk")
def test_the_summary_is_there_though_a_picture_fails(tmp_path, fvs, monkeypatch):
    """Files of the process may have 10 kB at most: the picture has more."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(fvsolve.load(still(title="A")).resolved())
    done = subprocess.run([sys.executable, "-c", LIMITED], capture_output=True, text=True)
    assert done.returncode == 0 and re.fullmatch(
        r"\S+history.png could not be drawn: .*\n", done.stderr
    )
    said = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert said["ok"] and said["files"] == [
        "case.toml",
        "history.csv",
        "restart.npz",
        "summary.json",
    ]
    assert fvs("run", "case.toml", "--out", "out", "--resume")[0] == 0  # draws missing pictures
    assert imread(tmp_path / "out" / "history.png").size > 0


def test_pictures_are_whole_when_the_run_returns(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = fvsolve.run(branched(fields=1), out=tmp_path / "run")
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"history.png", "envelope.png"} < names and not any(".tmp" in name for name in names)
    assert ".lock" not in names and "history.png" not in result.summary["files"]
    for name in ("history.png", "envelope.png"):
        assert imread(tmp_path / "run" / name).size > 0
