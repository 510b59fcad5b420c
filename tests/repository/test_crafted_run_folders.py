"""Files of run and study folders that no run wrote: every command refuses them in one message, or uses them."""

import json
import random
import resource
import shutil
import time
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference.scenes import branched

import fvsolve
from fvsolve.core.output.json_files import read_json
from fvsolve.core.output.restart import digest_of, read_arrays
from fvsolve.core.output.summary_file import read_summary
from fvsolve.core.output.summary_shape import SummaryShape
from fvsolve.errors import RunError
from fvsolve.studies import scenarios, sweep
from fvsolve.studies.peak_error import peak_errors

MISSING, INFINITY = "missing", "infinity"
VALUES = (
    MISSING, INFINITY, None, "words", "", 1.5, 3, -2.0, 1e308, 10**400, True, [], [1], {}, {"a": 1}, float("nan"),
    "x" * 10**5,
)  # fmt: skip
COMMANDS = ("report", "plot", "view", "fatigue", "compare", "compared with", "resume")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Case file and folder of a run with limits, claims, a measured series, errors of peaks, and invented rows."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "measured.csv").write_text("t,p\n0,4e5\n0.5,6e5\n")
    case = branched(fields=2)
    case |= {
        "routes": {"line": {"pipes": ["main", "last"]}},
        "expect": {"max(gate.head)": {"value": 100.0, "rtol": 0.9}},
        "limits": {"high": {"on": "line", "quantity": "gauge_pressure", "maximum": 8e5}},
        "compare": {"gate.pressure": {"file": str(folder / "measured.csv")}},
    }
    path = folder / "case.toml"
    path.write_text(fvsolve.load(case).resolved())
    result = fvsolve.run(path, out=folder / "run", pictures=False)
    summary = peak_errors(result, result.case)
    cavity = {
        "time": 0.1,
        "distance": 3.0,
        "volume": 1e-3,
        "t_volume": 0.2,
        "text": "main: a cavity",
    }
    warning = {"key": None, "value": 1.0, "limit": 2.0, "ok": False, "text": "few cells"}
    run_up = {
        "greatest": 1.0,
        "greatest_angle": 2.0,
        "angle": [1.0],
        "run_up": [1.0],
        "x": [0.0],
        "y": [None],
    }
    summary |= {
        "marks": [
            {"what": "dry", "place": "nodes.fork", "time": 0.2, "text": "fork: dry", "volume": None}
        ],
        "cavities": [{"place": "links.main", **cavity}],
        "events": [{"time": 0.1, "name": "valve", "what": "shuts"}],
        "warnings": [{"kind": "cells", "place": "links.main", **warning}],
        "run_up": {"shore": run_up},
    }
    (folder / "run" / "summary.json").write_text(json.dumps(summary))
    read_summary(folder / "run" / "summary.json")
    return path, folder / "run"


def places(data, at=()):
    """Key paths of all entries; of lists and of long tables only the first ones."""
    items = (
        list(data.items())
        if isinstance(data, dict)
        else list(enumerate(data))[:1]
        if isinstance(data, list)
        else []
    )
    for key, value in items if len(at) < 1 else items[:12]:
        yield (*at, key)
        yield from places(value, (*at, key))


def changed(data: dict, at: tuple, value) -> str:
    """JSON text of `data` with another value at a key path."""
    data = json.loads(json.dumps(data))
    inner = data
    for key in at[:-1]:
        inner = inner[key]
    if value == MISSING:
        del inner[at[-1]]
    else:
        inner[at[-1]] = value
    return json.dumps(data).replace(f'"{INFINITY}"', "1e999")


def arguments(command: str, case: Path, run: Path, other: Path) -> tuple:
    return {
        "report": ("report", run),
        "plot": ("plot", run, "--probes", "gate.pressure"),
        "fatigue": ("fatigue", run),
        "view": ("view", run, "--out", run / "view.png"),
        "compare": ("compare", run, other),
        "compared with": ("compare", other, run),
        "resume": ("run", case, "--out", run, "--resume", "--no-pictures"),
    }[command]


def is_refused_or_used(
    fvs, name: str, text: str | bytes, command: str, whole, folder: Path
) -> bool:
    """Check that a command refuses the file `name` with this text in a message, or uses it; True if it is refused."""
    case, run = whole
    own = folder / "run"
    shutil.rmtree(own, ignore_errors=True)
    shutil.copytree(run, own)
    (own / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    begun = time.process_time()
    code, out, err = fvs(*arguments(command, case, own, run))
    assert code in (0, 1, 2) and "internal error" not in err, (command, err[-500:])
    assert time.process_time() - begun < 5.0
    return code == 2


@pytest.fixture(scope="module")
def own_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("own")


@given(seed=st.integers(0, 2**32))
@examples(150)
def test_a_summary_with_any_other_value_is_refused_or_used(whole, fvs, own_folder, seed):
    summary, draw = json.loads((whole[1] / "summary.json").read_text()), random.Random(seed)
    at, value = draw.choice(list(places(summary))), draw.choice(VALUES)
    is_refused_or_used(
        fvs, "summary.json", changed(summary, at, value), draw.choice(COMMANDS), whole, own_folder
    )


@pytest.mark.parametrize("key", SummaryShape.__annotations__)
def test_each_entry_of_a_summary_has_a_declared_type(key, whole, tmp_path):
    """The entry is named with what is found, what is expected, and the remedy."""
    summary = json.loads((whole[1] / "summary.json").read_text())
    # absent here
    simple = isinstance(summary.get(key), (str, int, float, type(None))) and key != "energy_use"
    wrong = {"a": 1} if simple else "words"
    (tmp_path / "summary.json").write_text(changed(summary, (key,), wrong))
    with pytest.raises(RunError) as error:
        fvsolve.open_run(tmp_path)
    said = str(error.value)
    assert (
        said.startswith(f"{tmp_path / 'summary.json'}: {key}: ")
        and "run the case again with --force" in said
    )
    found = "it is a table" if wrong == {"a": 1} else '"words" is a text'
    assert f"{key}: {found}; expected " in said


def test_all_faults_of_a_summary_are_listed_up_to_five_and_the_rest_is_counted(whole, tmp_path):
    summary = json.loads((whole[1] / "summary.json").read_text())
    for name in summary["extremes"]:
        summary["extremes"][name] |= {"minimum": "a", "maximum": [1]}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(RunError) as error:
        fvsolve.open_run(tmp_path)
    assert str(error.value).count("expected a number or null") == 5 and "; and 3 more. " in str(
        error.value
    )


@pytest.mark.parametrize("change, told", [
    ({"time_unit": "m"}, "time_unit: .* is a length"), ({"time_unit": "x" * 10**6}, "unknown unit of 1000000 letters"),
    ({"probes": {"a": {"dimension": "colour", "unit": "m"}}}, "dimension: \"colour\" is unknown"),
    ({"extremes": {}}, "extremes: its names differ from those of probes"),
])  # fmt: skip
def test_entries_that_contradict_each_other_are_named(change, told, whole, tmp_path):
    summary = json.loads((whole[1] / "summary.json").read_text()) | change
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(RunError, match=told):
        fvsolve.open_run(tmp_path)


BOMBS = {
    "nested lists": "[" * 10**6,
    "nested tables": '{"a":' * 10**6,
    "many lists": "[[]," * 2_000_000,
    "a long text": '"' + "\U0001f30a" * 20_000_000 + '"',
    "a long number": "9" * 10**7,
    "half a letter": '{"a": "\\ud800"}',
}


@pytest.mark.parametrize("text", BOMBS.values(), ids=BOMBS)
def test_a_json_file_takes_bounded_time_and_memory(text, tmp_path):
    (tmp_path / "a.json").write_text(text, encoding="utf-8")
    begun, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        read_json(tmp_path / "a.json", "try again")
    except RunError as error:
        assert str(error).endswith("; try again") and len(str(error)) < 500
    assert time.process_time() - begun < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000  # kB


@pytest.mark.parametrize("name, text", [
    ("history.csv", "header"), ("history.csv", "x" * 10**6), ("history.csv", b"\x00\xff" * 99),
    ("history.csv", "times nan"), ("history.csv", "times 1e308"), ("history.csv", "reversed"),
    ("envelope.csv", "header"), ("envelope.csv", "x" * 10**6), ("envelope.csv", "distances nan"),
])  # fmt: skip
def test_tables_that_no_run_wrote_are_refused_or_used(name, text, whole, fvs, tmp_path):
    head, *rows = (whole[1] / name).read_text().splitlines()
    column = name == "envelope.csv"
    if text == "header":
        text = f"{head}\n"
    elif text == "reversed":
        text = "\n".join([head, *rows[::-1]])
    elif " " in str(text):
        cells = [row.split(",") for row in rows]
        cells = [[*row[:column], text.split()[1], *row[column + 1 :]] for row in cells]
        text = "\n".join([head, *map(",".join, cells)])
    refused = {
        command: is_refused_or_used(fvs, name, text, command, whole, tmp_path)
        for command in COMMANDS
    }
    is_empty = (name, text) == ("history.csv", f"{head}\n")  # as of a run that stops at its start
    assert refused["report"] != is_empty


def npz(path: Path, members, kind=zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", kind) as archive:
        for name, data in members:
            archive.writestr(name, data)
    return path


def header(shape: tuple, dtype: str = "<f8") -> bytes:
    file = BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": dtype, "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


@pytest.mark.parametrize("members, kind, told", [
    ([("y.npy", header((10**12,)) + bytes(8))], zipfile.ZIP_STORED, "does not fit its data"),
    ([("y.npy", header((2**62, 4)))], zipfile.ZIP_STORED, "does not fit its data"),
    ([("y.npy", header((1,), "|O") + bytes(8))], zipfile.ZIP_STORED, "does not fit its data"),
    ([("y.npy", header((10**8,), "|u1") + bytes(10**8))], zipfile.ZIP_DEFLATED, "compressed"),
    ([(f"{k}.npy", b"") for k in range(10_000)], zipfile.ZIP_STORED, "not a checkpoint"),
    ([("y.npy", header((1,)) + bytes(8))] * 2, zipfile.ZIP_STORED, "the same name"),
], ids=["1e12 elements", "overflow", "objects", "compressed", "many names", "twice"])  # fmt: skip
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_checkpoint_larger_than_its_data_is_refused_before_memory_is_taken(
    members, kind, told, tmp_path
):
    path = npz(tmp_path / "restart.npz", members, kind)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match=told):
        read_arrays(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # kB


def test_a_checkpoint_never_unpickles(tmp_path):
    class Wicked:
        def __reduce__(self):
            return (Path.write_text, (tmp_path / "executed", "yes"))

    np.savez(tmp_path / "restart.npz", y=np.array([Wicked()], dtype=object))
    with pytest.raises(ValueError):
        read_arrays(tmp_path / "restart.npz")
    assert not (tmp_path / "executed").exists()


def test_the_digest_covers_names_types_shapes_and_values():
    arrays = {
        "a": np.arange(6.0),
        "b": np.array("text"),
        "c": np.zeros(1, [("x", "f8")]),
        "d": np.zeros((0, 4)),
    }
    others = [
        {"a": np.nextafter(arrays["a"], 9.0)},
        {"a": arrays["a"].reshape(2, 3)},
        {"e": arrays["a"]},
        {"a": arrays["a"].view(np.int64)},
        {"d": np.zeros((4, 0))},
        {"b": np.array("texts")},
        {"c": np.zeros(1, [("y", "f8")])},
    ]
    others = [arrays, *({**arrays, **other} for other in others)]
    others.append({"z" if key == "a" else key: array for key, array in arrays.items()})
    assert len({digest_of(row) for row in others}) == len(others) and digest_of(
        {**arrays}
    ) == digest_of(arrays)


@pytest.mark.parametrize("change, told", [
    (lambda data: data["runs"][0].update(directory="../elsewhere"), "outside of the folder"),
    (lambda data: data["runs"][0].update(directory="/tmp"), "outside of the folder"),
    (lambda data: data["runs"][0].update(directory=3), "directory: 3 is a number"),
    (lambda data: data.update(runs=[]), "runs: an empty list"), (lambda data: data.pop("holds"), "holds is missing"),
    (lambda data: data.update(changes=[1]), "changes: it is a list"),
    (lambda data: data.update(title=None), "title: it is null"),
])  # fmt: skip
def test_a_study_that_no_study_wrote_is_refused(change, told, tmp_path, fvs):
    data = {
        "title": "A",
        "study": "s",
        "case": "c",
        "ok": True,
        "events": [],
        "protections": [],
        "holds": [],
        "changes": {"events": {}, "protections": {}},
        "error": False,
        "runs": [{"event": None, "protection": None, "directory": "run"}],
    }
    (tmp_path / "study.json").write_text(json.dumps(data))
    assert scenarios.open_study(tmp_path)["runs"][0]["directory"] == str(tmp_path / "run")
    change(data)
    (tmp_path / "study.json").write_text(json.dumps(data))
    code, _, err = fvs("report", tmp_path)
    assert code == 2 and told in err and "study.json" in err and "repeat the study" in err


def test_a_stored_point_that_was_changed_is_run_again(tmp_path):
    case, vary = branched(fields=0), {"links.valve.area": [0.004, 0.005]}
    case["numerics"] |= {"end": 0.05}
    before = sweep(case, vary, out=tmp_path)
    lines = (tmp_path / "points.jsonl").read_text().splitlines()
    forged = lines[0].replace('"ok": true', '"ok": false')
    assert forged != lines[0]
    deep = '{"key": ' + "[" * 100_000
    (tmp_path / "points.jsonl").write_text("\n".join([forged, deep, lines[1]]) + "\n")
    again = sweep(case, vary, out=tmp_path)
    assert again.reused == 1 and [row["ok"] for row in again.rows] == [
        row["ok"] for row in before.rows
    ] == [True, True]
