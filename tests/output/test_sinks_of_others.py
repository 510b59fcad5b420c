"""Sinks of other packages receive what the run directory receives; their faults end a run in order."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from reference.folders import CASES
from reference.outside_packages import install, python

import fvsolve
from fvsolve.errors import CaseError, FvsolveError, RunError

SINKS = '''
import json

calls = []


class JsonLines:
    """Writes a line of JSON for each row."""

    def open(self, model, folder, kept):
        self.names = [probe.text for probe in model.probes]
        path = folder / "history.jsonl"
        lines = path.read_text().splitlines(keepends=True) if kept else []
        self.file = path.open("w")
        self.file.writelines(lines[:kept])

    def rows(self, t, values):
        for time, row in zip(t, values):
            self.file.write(json.dumps([float(time), *row.tolist()]) + "\\n")

    def close(self):
        self.file.close()


class Recorder:
    """Records all calls."""

    def open(self, model, folder, kept):
        calls.append(("open", folder, model.case.name, kept))

    def rows(self, t, values):
        calls.append(("rows", t.copy(), values.copy()))
        values[:] = t[:] = -1.0

    def field(self, t, frame):
        calls.append(("field", t, set(frame)))

    def end(self, summary):
        calls.append(("end", summary.reason))

    def close(self):
        calls.append(("close",))


class Full:
    def open(self, model, folder, kept):
        if folder is not None and folder.name == "locked":
            raise OSError("no connection")

    def rows(self, t, values):
        if t[-1] > 5.0:
            raise ValueError("memory is full")

    def close(self):
        calls.append(("close",))


class Leaky(Full):
    def close(self):
        raise ValueError("lost connection")


class Half:
    def open(self, model, folder, kept):
        pass
'''
TANK = {
    "fluid": {"name": "water", "temperature": 288.15},
    "nodes": {
        "tank": {"type": "tank", "area": 1.0, "level": 2.0},
        "low": {"type": "reservoir", "head": 0.0},
    },
    "links": {"hole": {"type": "orifice", "from": "tank", "to": "low", "area": 1e-3}},
    "numerics": {"end": 10.0, "method": "rk4", "step": 1.0},
    "output": {"probes": ["tank.level"], "every": 1.0},
}
GROUP = "fvsolve.sinks"
PLACES = {
    "json-lines": "store:JsonLines",
    "recorder": "store:Recorder",
    "full": "store:Full",
    "half": "store:Half",
    "leaky": "store:Leaky",
    "lost": "store.lost:Sink",
}


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(
        install(tmp_path, "store", {"store/__init__.py": SINKS}, {GROUP: PLACES})
    )
    yield tmp_path
    sys.modules.pop("store", None)


def tank(*sinks: str, **numerics) -> dict:
    return TANK | {
        "output": TANK["output"] | {"sinks": [*sinks]},
        "numerics": TANK["numerics"] | numerics,
    }


def calls() -> list:
    return sys.modules["store"].calls


def test_a_run_of_the_command_line_writes_to_the_sink_of_its_case(tmp_path):
    home = install(tmp_path, "store", {"store/__init__.py": SINKS}, {GROUP: PLACES})
    words = (
        "run",
        str(CASES / "two-tanks.toml"),
        "--out",
        "out",
        "--no-pictures",
        "--set",
        "numerics.end=20",
    )
    words += "--set", "expect={}", "--set", 'output.sinks=["json-lines"]'
    python(home, "-m", "fvsolve", *words)
    rows = [json.loads(line) for line in (home / "out" / "history.jsonl").read_text().splitlines()]
    found = fvsolve.open_run(home / "out")
    assert len(rows) == 21
    assert np.array(rows)[:, 1] == pytest.approx(found["high.level"], rel=1e-15)


def test_a_sink_receives_all_output_of_a_run_directory(home):
    result = fvsolve.run(tank("recorder"), out="run", pictures=False)
    names = [name for name, *_ in calls()]
    assert (
        names[0] == "open"
        and names[-2:] == ["end", "close"]
        and {*names[1:-2]} == {"rows", "field"}
    )
    assert calls()[0][1:] == (Path("run"), result.case.name, 0) and calls()[-2] == (
        "end",
        result.reason,
    )
    values = np.concatenate([rest[1][:, 0] for name, *rest in calls() if name == "rows"])
    assert np.array_equal(values, result["tank.level"])


def test_a_run_in_memory_uses_no_sink(home):
    assert np.array_equal(
        fvsolve.run(tank("recorder"))["tank.level"], fvsolve.run(tank())["tank.level"]
    )
    assert "store" not in sys.modules


def test_a_run_directory_is_read_where_the_sink_is_not_installed(home, monkeypatch):
    fvsolve.run(tank("recorder"), out="run", pictures=False)
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place != str(home)])
    assert fvsolve.load("run/case.toml").output.sinks == ()
    with pytest.raises(CaseError, match="no sink named"):
        fvsolve.load(tank("recorder"))


def test_two_sinks_receive_the_same_and_a_run_directory_is_as_without_sinks(home):
    for name, sinks in (("bare", ()), ("both", ("recorder", "json-lines"))):
        fvsolve.run(tank(*sinks), out=name, pictures=False)
    assert (home / "bare" / "history.csv").read_bytes() == (
        home / "both" / "history.csv"
    ).read_bytes()
    rows = [json.loads(line) for line in (home / "both" / "history.jsonl").read_text().splitlines()]
    assert [t for t, _ in rows] == [float(t) for t in range(11)]  # that of the recorder is a copy
    texts = [(home / name / "case.toml").read_text() for name in ("bare", "both")]
    assert texts[0] == texts[1]
    assert sum(len(rest[0]) for name, *rest in calls() if name == "rows") == 11


def test_a_run_continues_with_other_sinks_than_it_began_with(home):
    fvsolve.run(tank(), out="run", pictures=False)
    fvsolve.run(tank("recorder", end=12.0), out="run", resume=True, pictures=False)
    assert str(calls()[0][1]) == "run"
    times = [t for name, *rest in calls() if name == "rows" for t in rest[0]]
    assert len(times) == 13 - calls()[0][3]
    assert [t for name, *rest in calls() if name == "rows" for t in rest[0]][-2:] == [11.0, 12.0]


def test_a_continued_run_repeats_no_row_in_its_sink(home, monkeypatch):
    """The rows after the last checkpoint come again, and the sink has removed them."""
    fvsolve.run(tank("json-lines"), out="whole", pictures=False)
    fvsolve.run(tank("json-lines", end=6.0), out="run", pictures=False)
    with (home / "run" / "history.jsonl").open("a") as file:
        file.write("[6.5, 0.0]\n")
    fvsolve.run(tank("json-lines"), out="run", resume=True, pictures=False)
    texts = [(home / name / "history.jsonl").read_text() for name in ("whole", "run")]
    assert texts[0] == texts[1] and len(texts[0].splitlines()) == 11
    fvsolve.run(tank("json-lines", end=3.0), out="run", force=True, pictures=False)
    assert len((home / "run" / "history.jsonl").read_text().splitlines()) == 4


def test_a_sink_that_fails_ends_the_run_and_all_sinks_are_closed(home):
    with pytest.raises(
        RunError,
        match=r'sink "full" \(store:Full\): rows\(\) failed: ValueError: memory is full; corr',
    ):
        fvsolve.run(tank("full", "recorder"), out="run", pictures=False)
    assert [name for name, *_ in calls()].count("close") == 2
    with pytest.raises(RunError, match=r"rows\(\) failed"):  # and not about close()
        fvsolve.run(tank("leaky"), out="run", force=True, pictures=False)
    with pytest.raises(RunError, match=r"close\(\) failed: ValueError: lost connection"):
        fvsolve.run(tank("leaky", end=4.0), out="run", force=True, pictures=False)
    fvsolve.run(tank(), out="run", force=True, pictures=False)  # the lock is released


def test_a_sink_that_does_not_open_leaves_an_earlier_run_as_it_is(home):
    before = fvsolve.run(tank(), out="locked", pictures=False)
    with pytest.raises(RunError, match=r"open\(\) failed: OSError: no connection"):
        fvsolve.run(tank("recorder", "full", "leaky"), out="locked", force=True, pictures=False)
    assert [name for name, *_ in calls()] == ["open", "close"]
    assert np.array_equal(fvsolve.open_run("locked")["tank.level"], before["tank.level"])


@pytest.mark.parametrize(
    "name, error, message",
    [
        ("recordr", CaseError, 'output.sinks: no sink named "recordr"; did you mean "recorder"?'),
        ("zz", CaseError, 'no sink named "zz"; expected full, half, json-lines, leaky, lost'),
        (
            "lost",
            FvsolveError,
            "lost of the entry points fvsolve.sinks of store: .* No module named 'store.lost'; cor",
        ),
        (
            "half",
            FvsolveError,
            "half of .* store:Half cannot be read: its object has no method rows, close; expected",
        ),
    ],
)
def test_a_name_that_cannot_be_used_is_explained_before_the_run(name, error, message, home):
    with pytest.raises(error, match=message):
        fvsolve.run(tank(name), out="run", pictures=False)
    assert not (home / "run").exists()


def test_without_installed_sinks_the_message_states_their_origin():
    with pytest.raises(CaseError, match="expected a package with entry points fvsolve.sinks"):
        fvsolve.load(tank("influx"))
    with pytest.raises(CaseError, match="no sink named 3"):
        fvsolve.load(tank(3))
