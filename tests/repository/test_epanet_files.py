"""The table of EPANET files (benchmarks/epanet_files.py): planted differences, hangs and crashes have their names."""

import os
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
HEADS = {"a": 50.0, "b": 48.0, "c": 47.0, "behind": -3.0}
FLOWS = {"p1": 0.020, "p2": -0.005}
CAUSE = [
    [
        "Darcy factor by Colebrook, in EPANET by Swamee and Jain: both factors agree within 3 %",
        ["D-W"],
    ]
]


@pytest.fixture
def files(monkeypatch):
    """Module epanet_files, which is removed after the test with the modules that it imports."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    before = set(sys.modules)
    import epanet_files

    yield epanet_files
    for name in set(sys.modules) - before:
        if (BENCHMARKS / f"{name}.py").is_file():
            del sys.modules[name]


def row(files, heads=None, flows=None, notes=(), warnings=(), dead=("behind",)):
    """Row of a file whose values in fvsolve differ from EPANET's by the given entries."""
    flow = files.worst(FLOWS | (flows or {}), FLOWS)
    flow["share"] = flow["difference"] / max(map(abs, FLOWS.values()))
    return {
        "epanet": "ok",
        "import": "ok",
        "nodes": len(HEADS),
        "seconds": {},
        "warnings": list(warnings),
        "head": files.worst(HEADS | (heads or {}), HEADS, dead),
        "flow": flow,
        "dead": list(dead),
        "causes": [text for text, _ in notes],
    }


@pytest.mark.parametrize(
    "change, word", [(0.0, "1 mm"), (9e-4, "1 mm"), (-9e-3, "1 cm"), (0.011, "silent")]
)
def test_a_wrong_head_is_reported_with_its_name(change, word, files):
    found = row(files, heads={"b": HEADS["b"] + change})
    assert files.verdict(found) == word
    if change:
        assert found["head"]["name"] == "b" and found["head"]["difference"] == pytest.approx(
            abs(change)
        )
    line = files.line("town.inp", found)
    assert word in line and (word != "silent" or " b " in line)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_head_that_is_missing_or_no_number_is_the_worst(value, files):
    assert files.worst({"a": 50.0, "b": value}, HEADS, ["c", "behind"])["difference"] == np.inf
    assert files.worst({"a": 50.0}, {"a": 50.0, "b": 48.0})["name"] == "b"


def test_a_wrong_flow_is_reported_where_no_head_shows_it(files):
    found = row(files, flows={"p2": -0.0053})
    assert files.verdict(found) == "silent" and found["flow"]["name"] == "p2"
    assert files.verdict(row(files, flows={"p2": -0.0051})) == "1 mm"


def test_a_dead_node_is_left_out_and_counted(files):
    found = row(files, heads={"behind": 900.0})
    assert files.verdict(found) == "1 mm" and files.line("x.inp", found).split()[-1] == "1"
    assert files.verdict(row(files, heads={"behind": 900.0}, dead=())) == "silent"


def test_a_difference_is_named_only_by_a_cause_that_the_import_names(files):
    wrong = {"c": 40.0}
    assert files.verdict(row(files, wrong)) == "silent"
    named = row(files, wrong, notes=CAUSE)
    assert files.verdict(named) == "named" and files.reason(named).startswith("Darcy factor")
    assert "unbalanced" in files.reason(row(files, wrong, warnings=["unbalanced"]))
    assert files.verdict(row(files, wrong, warnings=["negative pressures"])) == "silent"


def test_the_counts_add_up(files):
    refused = {
        "epanet": "ok",
        "import": "refused",
        "error": "import: no",
        "warnings": ["demand cut off"],
        "seconds": {},
    }
    theirs = {"epanet": "undefined node x", "seconds": {}}
    rows = [
        row(files),
        row(files, {"a": 50.005}),
        row(files, {"a": 60.0}),
        row(files, {"a": 60.0}, notes=CAUSE),
        refused,
        theirs,
        theirs | {"epanet": "ok", "warnings": [], "left_out": "more than 3 nodes"},
    ]
    expected = {
        "files found": 9,
        "distinct files": 7,
        "EPANET runs": 6,
        "left out": 1,
        "imported": 4,
        "imported, its case refused": 0,
        "within 1 mm": 1,
        "within 1 cm": 2,
        "above, with named cause": 1,
        "silent": 1,
        "refused by us": 1,
        "of these, without a solution of EPANET": 1,
        "refused by EPANET": 1,
        "refused by EPANET, imported": 0,
    }
    assert files.counts(rows, 9) == expected


def test_a_late_switch_is_no_difference_of_heads_and_a_permanent_difference_is(files):
    times, names = 150.0 + 300.0 * np.arange(6), ["a", "b"]
    apart = np.zeros((6, 2))
    apart[2, 0] = 8.0  # one row, at a switch
    assert files.worst_in_rows(times, files.lasting(apart), names)["difference"] == 0.0
    apart[3:5, 1] = 3.0, 2.0
    assert files.worst_in_rows(times, files.lasting(apart), names) == {
        "difference": 2.0,
        "name": "b",
        "time": 1050.0,
    }
    apart[0, 1] = np.nan
    assert files.worst_in_rows(times, apart, names)["difference"] == np.inf


@pytest.mark.parametrize(
    "change, word",
    [
        ({}, "1 mm"), ({"level": {"difference": 0.02}}, "silent"), ({"head": {"difference": 0.02}}, "silent"),
        ({"head": {"difference": 0.02}, "causes": ["not imported: rule 1"]}, "named"),
        ({"head": {"difference": 0.02}, "epanet_warnings": {"unbalanced": 3600.0}}, "named"),
        ({"ok": False}, "stopped"),
    ],
)  # fmt: skip
def test_a_day_has_a_word_of_its_own(change, word, files):
    near = {"difference": 0.0, "name": "t", "time": 0.0}
    day = {
        "ok": True,
        "level": near,
        "head": near,
        "causes": [],
        "cpu": 1.0,
        "epanet_cpu": 0.2,
        "steps": 3,
        "step": 10,
    }
    day |= {
        key: near | value if isinstance(value, dict) and key in day else value
        for key, value in change.items()
    }
    assert files.day_verdict(day) == word and word in files.day_line(day)
    found = files.counts([row(files) | {"day": day}, row(files) | {"day": day | {"cpu": 0.1}}], 2)
    assert found["days"] == 2 and found["days within 3 times EPANET's CPU"] == (word != "stopped")


def test_equal_files_are_examined_once_and_equal_names_get_their_folder(files, tmp_path):
    for folder, text in (("one", "x"), ("two", "x"), ("three", "longer")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "net.INP").write_text(text)
    found = files.files_of([tmp_path])
    assert len(found) == 3 and [name for name, _ in files.distinct(found)] == [
        "one/net.INP",
        "three/net.INP",
    ]


FATES = {
    "hang": ("import: no end within 1 s", lambda record: time.sleep(60.0)),
    "crash": ("import: crash, exit status -9", lambda record: os.kill(os.getpid(), signal.SIGKILL)),
    "raise": ("import: KeyError: 'x'", lambda record: {}["x"]),
}


def test_files_that_hang_crash_or_raise_do_not_stop_the_table(files, tmp_path, monkeypatch):
    def examine(path, options, record):
        record.row |= {"epanet": "ok", "nodes": 2, "warnings": [], "causes": []}
        record.stage("import")
        if path.name in FATES:
            FATES[path.name][1](record)
        record.row |= {key: value for key, value in row(files).items() if key != "seconds"}

    monkeypatch.setattr(files, "examine", examine)
    options = SimpleNamespace(jobs=2, limit=1.0, day_limit=1.0)
    paths, found = [tmp_path / name for name in (*FATES, "good")], {}
    files.examined(paths, options, lambda path, row: found.setdefault(path.name, row))
    assert files.verdict(found["good"]) == "1 mm"
    for name, (text, _) in FATES.items():
        assert files.verdict(found[name]) == "refused by us" and found[name]["error"].startswith(
            text
        )


def test_epanets_own_values_come_from_the_original_file_in_si(files, tmp_path):
    """A main in US units: heads from the Hazen-Williams loss by hand, flows by their units; a closed branch is dead."""
    engine = files.epanet_engine
    version = next((version for version in engine.LIBRARIES if engine.library(version)), None)
    if version is None:
        pytest.skip("EPANET is not installed")
    text = "[JUNCTIONS]\na 0 300\nb 0 0\n[RESERVOIRS]\nlake 100\n[PIPES]\np lake a 1000 12 100 0 Open\n"
    path = tmp_path / "main.inp"
    path.write_text(text + "q a b 50 12 100 0 Closed\n[OPTIONS]\nUNITS GPM\nHEADLOSS H-W\n[END]\n")
    start = engine.start(path, version)
    flow = 300.0 * 231.0 / 1728.0 / 60.0  # [ft3/s]
    loss = 4.727 * 1000.0 * 100.0**-1.852 * flow**1.852  # [ft], diameter 1 ft
    assert start.heads["a"] == pytest.approx(0.3048 * (100.0 - loss), abs=2e-4)
    assert start.flows["p"] == pytest.approx(flow * 0.3048**3, rel=1e-4)
    assert start.dead == ["b"] and start.warnings == []
    path.write_text(text.replace("q a b", "").replace("lake a", "lake nowhere"))
    with pytest.raises(engine.EpanetError, match="undefined node nowhere"):
        engine.start(path, version)


def test_epanets_day_follows_a_tank_to_its_end_and_states_the_time_of_an_interrupted_demand(
    files, tmp_path
):
    """A tank of 4 m with 100 m2 loses 10 l/s, so it is empty at 40 000 s; the demand behind it then has no source."""
    engine = files.epanet_engine
    version = next((version for version in engine.LIBRARIES if engine.library(version)), None)
    if version is None:
        pytest.skip("EPANET is not installed")
    path, width = tmp_path / "tank.inp", (400.0 / np.pi) ** 0.5
    text = (
        f"[JUNCTIONS]\na 0 10\n[RESERVOIRS]\nfar 60\n[TANKS]\ntower 50 4 0 9 {width} 0\n[PIPES]\n"
    )
    path.write_text(
        text
        + "p tower a 100 300 120\nq far a 100 300 120 0 Closed\n[OPTIONS]\nUNITS LPS\nHEADLOSS H-W\n[END]\n"
    )
    day = engine.day(path, version)
    level, full = day.heads[:, day.names.index("tower")] - 50.0, day.times < 39900.0
    assert day.tanks == ["tower"] and day.end == 86400.0 and day.steps > 8640
    # 28.317 l in a ft3
    assert level[full] == pytest.approx(4.0 - 0.01 * day.times[full] / 100.0, abs=5e-5)
    assert day.warnings[engine.CUT_OFF] == day.times[day.dead.all(axis=1)][0]
    assert 40000.0 <= day.warnings[engine.CUT_OFF] <= 40350.0 and not day.dead[full].any()


ONE_WAY = """[JUNCTIONS]
behind 10 0
town 5 4
[RESERVOIRS]
lake 60
[PIPES]
p1 lake town 400 250 110 0 Open
p2 behind town 300 200 110 0 {status}
[OPTIONS]
UNITS LPS
[END]
"""


@pytest.mark.parametrize("status, dead", [("CV", ["behind"]), ("Open", [])])
def test_water_reaches_no_node_against_a_check_valve(status, dead, files, tmp_path):
    path = tmp_path / "town.inp"
    path.write_text(ONE_WAY.format(status=status))
    engine = files.epanet_engine
    version = next((version for version in engine.LIBRARIES if engine.library(version)), None)
    if version is None:
        pytest.skip("no library of EPANET")
    assert engine.start(path, version).dead == dead


def test_a_day_that_epanet_stops_before_its_first_row_is_refused(files, tmp_path):
    path = tmp_path / "town.inp"
    path.write_text(ONE_WAY.format(status="Open"))
    engine = files.epanet_engine
    version = next((version for version in engine.LIBRARIES if engine.library(version)), None)
    if version is None:
        pytest.skip("no library of EPANET")
    with pytest.raises(engine.EpanetError, match="before the first row"):
        engine.day(path, version, end=60)
