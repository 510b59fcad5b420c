"""Files that are damaged, or do not fit on the disk, are written again or named in an error of the program."""

import gc
import itertools
import json
import os
import shutil
import subprocess
import sys
import warnings
from importlib import import_module

import numpy as np
import pytest
from reference.checkpoints import write_sealed
from reference.scenes import branched

import fvsolve
from fvsolve.errors import FvsolveError, RunError
from fvsolve.studies import sweep

KEPT = """
import sys, warnings
from pathlib import Path
import numpy as np
from fvsolve.jit import add_sources, cache_folder
folder = Path(cache_folder()) / "sources"
folder.mkdir(exist_ok=True)
(folder / "probe.py").write_text("from fvsolve.jit import njit\\n@njit\\ndef twice(x):\\n    return 2.0 * x\\n")
add_sources(folder)
sys.path.insert(0, str(folder))
if len(sys.argv) > 1:
    import resource
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
from probe import twice
value = twice(21.0)
print(value, sum(twice.numba.stats.cache_hits.values()) if "numba" in sys.modules else "without numba")
"""


def compiled(folder, *arguments):
    """Printed words and standard error of a process that compiles a function or loads it from the cache."""
    done = subprocess.run(
        [sys.executable, "-c", KEPT, *arguments],
        capture_output=True,
        text=True,
        env=os.environ | {"FVSOLVE_CACHE": str(folder)},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split(maxsplit=1), done.stderr


def test_compiled_code_that_is_damaged_is_compiled_anew(tmp_path):
    assert compiled(tmp_path)[0] == ["42.0", "0\n"] and compiled(tmp_path)[0] == [
        "42.0",
        "without numba\n",
    ]
    for ending, harm in itertools.product(
        ("code", "nbi", "nbc"), ("cut to nothing", "cut short", "zeros in the middle")
    ):
        (path,) = tmp_path.rglob(f"*.{ending}")
        data = path.read_bytes()
        half = len(data) // 2
        harmed = {
            "cut to nothing": b"",
            "cut short": data[:half],
            "zeros in the middle": data[:half] + bytes(len(data) - half),
        }
        path.write_bytes(harmed[harm])
        if ending != "code":
            next(tmp_path.rglob("*.code")).unlink()
        assert compiled(tmp_path)[0] == ["42.0", "1\n" if ending == "code" else "0\n"], (
            ending,
            harm,
        )
        assert path.read_bytes() != harmed[harm], (ending, harm)
        if harm == "zeros in the middle":
            assert compiled(tmp_path)[0] == ["42.0", "without numba\n"], ending


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes to play a full disk")
def test_a_full_disk_costs_only_time_and_the_folder_is_named(tmp_path):
    said, err = compiled(tmp_path, "100")
    assert said == ["42.0", "0\n"]
    assert (
        f"{tmp_path}: compiled code cannot be saved: File too large" in err
        and "FVSOLVE_CACHE" in err
    )


FULL = """
import resource, sys
import fvsolve
fvsolve.build(fvsolve.load(sys.argv[1]))
resource.setrlimit(resource.RLIMIT_FSIZE, (30000, 30000))
from fvsolve.cli import main
sys.argv = ["fvsolve", "run", sys.argv[1], "--out", sys.argv[2]]
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes to play a full disk")
def test_a_disk_that_fills_up_is_named_with_the_place_and_the_run_goes_on_later(tmp_path):
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(fvsolve.load(branched(fields=0), {"output.every": "1 ms"}).resolved())
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(case), str(out)], capture_output=True, text=True
    )
    assert done.returncode == 2 and f"\n{out}" in f"\n{done.stderr}"
    assert (
        "cannot be written: File too large. Free disk space, or correct the access rights"
        in done.stderr
    )
    assert fvsolve.run(case, out=out, resume=True).ok
    whole = fvsolve.run(case, out=tmp_path / "whole")
    assert (
        whole.ok
        and (out / "history.csv").read_bytes() == (tmp_path / "whole" / "history.csv").read_bytes()
    )


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """Case and output folder of a run that was interrupted half way."""
    case, out = branched(fields=4), tmp_path_factory.mktemp("run") / "out"
    case["numerics"] |= {"step": "0.02 ms"}
    del case["numerics"]["courant"]

    def half(t, seconds, steps):
        if t > 0.3:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as often:
        often.setattr(import_module("fvsolve.core.solve.solve"), "CHECKPOINT_SECONDS", 0.0)
        assert not fvsolve.run(case, out=out, progress=half).ok
    return case, out


def copied(stopped, tmp_path):
    case, out = stopped
    shutil.copytree(out, tmp_path / "out")
    (tmp_path / "out" / "summary.json").unlink()
    return case, tmp_path / "out"


HARM = {
    "states too few": lambda kept: {"y": kept["y"][:-3]},
    "states of another shape": lambda kept: {"y": kept["y"][None]},
    "states that are no numbers": lambda kept: {"y": np.full(kept["y"].size, np.nan)},
    "time that is none": lambda kept: {"t": np.nan},
    "negative rows": lambda kept: {"counts": -kept["counts"]},
    "two counts": lambda kept: {"counts": kept["counts"][:2]},
    "text": lambda kept: {"y": np.array(["a"] * kept["y"].size)},
    "no identity": lambda kept: {"identity": np.array("[]")},
    "memory cut": lambda kept: {"memory.extremes": kept["memory.extremes"][:, :-1]},
    "memory longer": lambda kept: {"memory.run": np.append(kept["memory.run"], [0.0, 1.0])},
    "memory of one number": lambda kept: {"memory.run": np.zeros(1)},
    "memory of another type": lambda kept: {"memory.ledger": kept["memory.ledger"].astype(str)},
    "memory with numbers in place of a record": lambda kept: {"memory.state": np.zeros(1)},
    "a segment there is not": lambda kept: {"memory.run": np.append(99.0, kept["memory.run"][1:])},
    "a segment that is no number": lambda kept: {
        "memory.run": np.append(np.nan, kept["memory.run"][1:])
    },
    "one array more": lambda kept: {"memory.more": np.zeros(1)},
    "changes without end": lambda kept: {"memory.changes": np.zeros(1)},
    "changes in text": lambda kept: {"memory.changes": np.array([["a"] * 3])},
}


def shorter(key: str):
    """Function that cuts an array of a checkpoint by one element."""
    return lambda kept: {key: np.atleast_1d(kept[key])[:-1]}


@pytest.mark.parametrize("key", ["t", "y", "memory.run", "memory.state", "counts", "identity"])
def test_the_array_that_is_shortened_or_absent_is_named_with_its_file(key, stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    with np.load(out / "restart.npz") as file:
        kept = {key: file[key] for key in file.files}
    name = "states" if key == "y" else key.partition(".")[0]
    for harmed in (
        {**kept, **shorter(key)(kept)},
        {one: array for one, array in kept.items() if one != key},
    ):
        write_sealed(out / "restart.npz", harmed)
        with pytest.raises(RunError) as error:
            fvsolve.run(case, out=out, resume=True)
        said = str(error.value)
        assert (
            said.startswith(str(out / "restart.npz"))
            and (name in said or key in said)
            and "--force" in said
        )
        assert "only 0-dim" not in said and "unpack" not in said


@pytest.mark.parametrize("name", HARM)
def test_a_checkpoint_that_no_run_wrote_is_refused(name, stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    with np.load(out / "restart.npz") as file:
        kept = {key: file[key] for key in file.files}
    for write in (np.savez, lambda path, **arrays: write_sealed(path, arrays)):
        write(out / "restart.npz", **kept | HARM[name](kept))
        with pytest.raises(RunError, match="start (the run )?again with --force"):
            fvsolve.run(case, out=out, resume=True)


def with_entry(key: str, entry: str, value):
    """Function that changes an entry of a record of a checkpoint."""

    def change(kept):
        record = kept[key].copy()
        record[entry] = value
        return {key: record}

    return change


def with_number(key: str, at, value):
    """Function that changes a number of an array of a checkpoint."""

    def change(kept):
        array = kept[key].copy()
        array[at] = value
        return {key: array}

    return change


FORGED = {
    "a value of a state": with_number("y", 3, 1.0),
    "the envelope": with_number("memory.envelope", (0, 0), 1.0),
    "an extreme": with_number("memory.extremes", (0, 0), np.nan),
    "a time": with_entry("memory.state", "step", 1.0),
}
COUNTS = {  # refused even with a right digest
    "fewer rows": with_number("counts", 0, 3),
    "more rows": with_number("counts", 0, 10**6),
    "fewer bytes": with_number("counts", 1, 100),
    "more bytes": with_number("counts", 1, 10**9),
    "fewer frames": with_number("counts", 2, 0),
    "more frames": with_number("counts", 2, 9),
    "rows without end": with_number("counts", 0, 2**62),
    "an early time": lambda kept: {"t": np.float64(-1.0)},
    "another time": lambda kept: {"t": kept["t"] + 0.01},
    "NaN steps": with_entry("memory.state", "steps", np.nan),
    "negative steps": with_entry("memory.state", "steps", -1.0),
    "no end": with_entry("memory.state", "newton", np.inf),
    "outputs": with_entry("memory.state", "next_output", 1e300),
    "frames": with_entry("memory.state", "next_field", 9.0),
    "NaN checks": with_number("memory.step doubling", 0, np.nan),
    "checks": with_number("memory.step doubling", 0, 5.0),
    "a part": with_number("memory.energy", 10, 1e300),
    "NaN part": with_number("memory.energy", 10, np.nan),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_checkpoint_that_was_changed_is_refused_by_its_digest(name, stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    with np.load(out / "restart.npz") as file:
        kept = {key: file[key] for key in file.files}
    np.savez(out / "restart.npz", **kept | FORGED[name](kept))
    with pytest.raises(
        RunError, match=r"restart\.npz was changed after the run wrote it: .*--force"
    ):
        fvsolve.run(case, out=out, resume=True)


@pytest.mark.parametrize("name", COUNTS)
def test_counts_that_no_run_has_are_refused_even_with_a_right_digest(name, stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    with np.load(out / "restart.npz") as file:
        kept = {key: file[key] for key in file.files}
    write_sealed(out / "restart.npz", kept)
    write_sealed(out / "restart.npz", kept | COUNTS[name](kept))
    with pytest.raises(RunError, match="start (the run )?again with --force"):
        fvsolve.run(case, out=out, resume=True)
    write_sealed(out / "restart.npz", kept)
    assert fvsolve.run(case, out=out, resume=True).ok
    whole = stopped[1].parent / "whole"
    if not whole.exists():
        assert fvsolve.run(case, out=whole, pictures=False).ok
    assert (out / "history.csv").read_bytes() == (whole / "history.csv").read_bytes()


@pytest.mark.parametrize("name", ["history.csv", "fields.pvd", "restart.npz"])
def test_a_finished_run_with_files_that_do_not_fit_its_checkpoint_loses_nothing(
    name, stopped, tmp_path
):
    """A later end continues a finished run from its checkpoint; a refusal comes before its results are deleted."""
    case, out = copied(stopped, tmp_path)
    assert fvsolve.run(case, out=out, resume=True).ok
    (out / name).write_bytes((out / name).read_bytes()[:90])
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with pytest.raises(RunError, match=rf"{name}.*--force"):
        fvsolve.run(
            case, {"numerics.end": 1.5, "output.every": case["output"]["every"]}, out, resume=True
        )
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("part", [0.0, 0.3, 0.7, 0.99])
def test_a_checkpoint_cut_short_is_refused(part, stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    data = (out / "restart.npz").read_bytes()
    (out / "restart.npz").write_bytes(data[: int(part * len(data))])
    with pytest.raises(RunError, match=r"restart\.npz cannot be read"):
        fvsolve.run(case, out=out, resume=True)
    with warnings.catch_warnings(record=True) as caught:  # such as of a file that is left open
        warnings.simplefilter("always")
        gc.collect()
    assert not [one for one in caught if "restart.npz" in str(one.message)]


def test_fields_that_are_gone_are_named_and_foreign_files_left_alone(stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    (out / "fields" / "note.vtu").write_text("mine")
    assert fvsolve.run(case, out=out, resume=True).ok and (out / "fields" / "note.vtu").is_file()
    shutil.rmtree(out)
    case, out = copied(stopped, tmp_path)
    shutil.rmtree(out / "fields")
    with pytest.raises(
        RunError, match=r"fields\.pvd: frames are missing; start the run again with --force"
    ):
        fvsolve.run(case, out=out, resume=True)
    assert fvsolve.run(case, {"numerics.end": 0.01, "output.fields": 1}, out, force=True).ok


@pytest.mark.parametrize("text", ["[]", "{}", "3", "null", '{"ok": true}', "", '{"a', "\x00\xff"])
def test_a_summary_that_no_run_wrote_is_refused(text, stopped, tmp_path):
    case, out = copied(stopped, tmp_path)
    (out / "summary.json").write_text(text, encoding="latin-1")
    with pytest.raises(RunError, match=r"summary\.json cannot be read"):
        fvsolve.open_run(out)
    with pytest.raises(RunError, match=r"summary\.json cannot be read"):
        fvsolve.run(case, out=out, resume=True)


@pytest.mark.parametrize("name, text", [
    ("history.csv", "t [s]\n0.0\n"), ("history.csv", "t [s],a\n0.0\n1.0,x\n"), ("history.csv", ""),
    ("envelope.csv", ""), ("envelope.csv", "pipe,a\nmain,x\n"), ("envelope.csv", "pipe,a\n\n"),
    ("fields.pvd", "<VTKFile><DataSet/></VTKFile>"), ("fields.pvd", "<VTK"),
])  # fmt: skip
def test_tables_that_are_damaged_are_refused_when_they_are_read(name, text, stopped, tmp_path):
    shutil.copytree(stopped[1], tmp_path / "out")
    (tmp_path / "out" / name).write_text(text)
    result = fvsolve.open_run(tmp_path / "out")
    ask = {
        "history.csv": lambda: result.t,
        "envelope.csv": lambda: result.envelope["main"]["distance"],
    }
    if (name, text) == ("envelope.csv", ""):
        assert result.envelope == {}
        return
    with pytest.raises(FvsolveError, match=name.replace(".", r"\.")):
        ask.get(name, result.view)()


def test_an_envelope_that_was_written_and_is_gone_is_named(stopped, tmp_path):
    shutil.copytree(stopped[1], tmp_path / "out")
    result = fvsolve.open_run(tmp_path / "out")
    assert "main" in fvsolve.open_run(tmp_path / "out").envelope
    (tmp_path / "out" / "envelope.csv").unlink()
    with pytest.raises(RunError, match=r"envelope\.csv cannot be read: No such file"):
        result.envelope  # noqa: B018


def test_damaged_points_of_a_study_are_computed_again(tmp_path):
    case, vary = json.loads(json.dumps(branched(fields=0))), {"links.valve.area": [0.004, 0.005]}
    case["numerics"] |= {"end": 0.05}
    before = sweep(case, vary, out=tmp_path)
    lines = (tmp_path / "points.jsonl").read_text().splitlines()
    (tmp_path / "points.jsonl").write_bytes(
        f"[]\n3\nnull\n{lines[0]}\n".encode() + b"\xff\xfe\n" + lines[1][:50].encode()
    )
    again = sweep(case, vary, out=tmp_path)
    assert again.reused == 1 and [row["ok"] for row in again.rows] == [
        row["ok"] for row in before.rows
    ]
