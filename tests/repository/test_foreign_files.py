"""Python files of the present folder, and caches that other users can write, are never executed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import fvsolve
from fvsolve import jit
from fvsolve.compile import file_access

ROOT = Path(__file__).resolve().parents[2]
POSIX = pytest.mark.skipif(
    not file_access.CHECKED, reason="folders of a user are closed to other users on Windows"
)
TRAP = """import os
with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "EXECUTED"), "a") as file:
    file.write(__name__ + " ")
raise ImportError("a file of the present folder")
"""
SMALL = """
[fluid]
name = "user"
density = 1000
bulk_modulus = 2e9
viscosity = 1e-3
[nodes.pool]
type = "basin"
size = [4, 2]
cells = [4, 2]
level = 1.0
[numerics]
end = 0.1
[output]
fields = 1
"""
FAULTY_NETWORK = (
    "[JUNCTIONS]\n a 0 0\n[RESERVOIRS]\n r 10\n[PIPES]\n p r nowhere 100 300 100 0 Open\n[END]\n"
)


@pytest.fixture(scope="module")
def trapped(tmp_path_factory):
    """Folder with a file named as each module that a run imports, and a case; each file records its execution."""
    code = (
        "import sys, fvsolve, multiprocessing.spawn, multiprocessing.resource_tracker, multiprocessing.context, runpy;"
        "fvsolve.run('two-tanks'); import fvsolve.report.draw.plot, fvsolve.report.draw.field_canvas, pyvista;"
        "print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    loaded = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True
    ).stdout
    folder = tmp_path_factory.mktemp("traps")
    for name in {*loaded.split(), "sitecustomize", "usercustomize", "pint", "numba", "dask"} - {
        "__main__"
    }:
        (folder / f"{name}.py").write_text(TRAP)
    (folder / "pool.toml").write_text(SMALL)
    (folder / "faulty.inp").write_text(FAULTY_NETWORK)
    (folder / ".numba_config.yaml").write_text("cpu_name: pentium\nopt: 0\n")
    return folder


def started(folder, *words, **environment):
    """Result of the command `fvsolve` in a folder, by a script in another folder, as the installed command is."""
    script = folder.parent / f"{folder.name}-script" / "fvsolve"
    script.parent.mkdir(exist_ok=True)
    script.write_text('from fvsolve.cli import main\nif __name__ == "__main__":\n    main()\n')
    call = [sys.executable, str(script), *words]
    return subprocess.run(
        call, cwd=folder, capture_output=True, text=True, env=os.environ | environment
    )


@pytest.mark.parametrize("words, files", [
    (["run", "pool.toml", "--out", "a", "--force"], ["a/summary.json"]),
    (["sweep", "pool.toml", "--set", "nodes.pool.level=1,2,3", "--jobs", "2", "--out", "s"], ["s/points.jsonl"]),
    (["precompile", "--for", "two-tanks"], []),
])  # fmt: skip
def test_commands_execute_no_file_of_the_present_folder(words, files, trapped):
    done = started(trapped, *words)
    assert done.returncode == 0, done.stderr
    assert not (trapped / "EXECUTED").exists(), (trapped / "EXECUTED").read_text()
    assert all((trapped / file).is_file() for file in files)


def test_pictures_and_the_reading_of_networks_execute_no_file_of_the_present_folder(trapped):
    assert (
        started(trapped, "run", "pool.toml", "--out", "b", "--no-pictures", "--force").returncode
        == 0
    )
    seen = started(trapped, "view", "b", "--out", "b.png")
    assert seen.returncode == 0 and (trapped / "b.png").is_file() or "OpenGL" in seen.stderr, (
        seen.stderr
    )
    assert started(trapped, "import", "faulty.inp").returncode == 2
    assert not (trapped / "EXECUTED").exists(), (trapped / "EXECUTED").read_text()


def test_a_second_process_compiles_without_files_of_the_present_folder(trapped):
    code = (
        "import sys; from fvsolve.compile.functions import compile_in_parallel\n"
        "with compile_in_parallel('import fvsolve, json, numba', 'nothing'): pass"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=trapped, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not (trapped / "EXECUTED").exists(), (trapped / "EXECUTED").read_text()


def test_the_module_on_the_command_line_imports_nothing_from_the_present_folder_after_its_start(
    trapped, tmp_path
):
    own = {
        "fvsolve.py",
        "runpy.py",
        "pkgutil.py",
        "os.py",
        "sys.py",
        "contextlib.py",
        "collections.py",
        "pathlib.py",
    }
    for path in trapped.glob("*.py"):
        if path.name in ("json.py", "numpy.py", "typer.py", "multiprocessing.py", "tomllib.py"):
            (tmp_path / path.name).write_text(TRAP)
    # Python imports these before it runs the module
    assert not own & {path.name for path in tmp_path.iterdir()}
    done = subprocess.run(
        [sys.executable, "-m", "fvsolve", "list"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "EXECUTED").exists(), (tmp_path / "EXECUTED").read_text()


def test_settings_of_numba_in_the_present_folder_are_ignored(trapped):
    code = (
        "from fvsolve.compile.numba_internals import numba_module as n; c = "
        "n().config; print(c.CPU_NAME, c.OPT == 3)"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=trapped, capture_output=True, text=True
    )
    assert done.stdout.split() == ["None", "True"], (done.stdout, done.stderr)


def test_the_traps_would_show_an_import(trapped, tmp_path):
    (tmp_path / "json.py").write_text(TRAP)
    subprocess.run([sys.executable, "-c", "import json"], cwd=tmp_path, capture_output=True)
    assert (tmp_path / "EXECUTED").read_text().split() == ["json"]


FOLDER = "from fvsolve.compile.cache_folders import code_folders; print(*code_folders())"


def python(code, **environment):
    return subprocess.run(
        [sys.executable, "-P", "-c", code],
        capture_output=True,
        text=True,
        env=os.environ | environment,
    )


def opened(path, how):
    """Open a file or folder to other users: by its mode, or by its owner."""
    if how == "owner":
        os.chown(path, 65534, 65534)
    elif how == "group":
        os.chown(path, -1, 65534 if ROOT_USER else os.getgroups()[-1])
        path.chmod(0o775)
    else:
        path.chmod(0o777)


ROOT_USER = hasattr(os, "geteuid") and os.geteuid() == 0
OWNER = pytest.param(
    "owner", marks=pytest.mark.skipif(not ROOT_USER, reason="only root can give a folder away")
)


@POSIX
@pytest.mark.parametrize("how", ["all", "group", OWNER])
@pytest.mark.parametrize("below", ["", "code", "code/{hash}", "code/{hash}/{machine}"])
def test_a_cache_that_others_can_write_is_refused_in_a_single_line(how, below, tmp_path):
    cache = tmp_path / "cache"
    assert python(FOLDER, FVSOLVE_CACHE=str(cache)).returncode == 0
    machine = jit.code_folder()
    folder = cache / below.format(hash=machine.parent.name, machine=machine.name)
    assert folder.is_dir()
    opened(folder, how)
    done = started(tmp_path, "run", "two-tanks", "--no-pictures", FVSOLVE_CACHE=str(cache))
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr
    reason = {
        "owner": "is owned by",
        "group": "can be written by the group",
        "all": "can be written by all users",
    }[how]
    assert (
        f"{folder}: {reason}" in done.stderr
        and "chmod -R go-w" in done.stderr
        and "FVSOLVE_CACHE" in done.stderr
    )
    assert not list((tmp_path / "runs").glob("*/summary.json"))


PROBE = """
import sys
from pathlib import Path
from fvsolve.jit import add_sources
add_sources(Path("own"))
sys.path.insert(0, "own")
import probe
print(probe.twice(21.0), "numba" in sys.modules)
"""


@POSIX
def test_a_file_of_code_that_others_can_write_is_compiled_again(tmp_path):
    (tmp_path / "own").mkdir()
    source = "from fvsolve.jit import njit\n@njit\ndef twice(x):\n    return 2.0 * x\n"
    (tmp_path / "own" / "probe.py").write_text(source)
    environment = os.environ | {"FVSOLVE_CACHE": str(tmp_path / "cache")}

    def twice():
        call = [sys.executable, "-P", "-c", PROBE]
        done = subprocess.run(
            call, capture_output=True, text=True, cwd=tmp_path, env=environment, umask=0
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    def code_files():
        return [
            path
            for path in (tmp_path / "cache").rglob("*")
            if path.suffix in (".code", ".nbi", ".nbc")
        ]

    assert twice() == ["42.0", "True"] and twice() == ["42.0", "False"]
    assert len(code_files()) == 3 and not [
        path for path in code_files() if path.stat().st_mode & 0o022
    ]
    for path in code_files():
        path.chmod(0o666)
    assert twice() == ["42.0", "True"] and twice() == ["42.0", "False"]


@POSIX
def test_the_folder_below_the_temporary_folder_is_private(tmp_path):
    code = "from fvsolve.jit import cache_folder; folder = cache_folder(); print(folder, folder.is_dir())"
    stated = {"FVSOLVE_CACHE": os.devnull + "/cache", "TMPDIR": str(tmp_path)}
    first = python(code, **stated).stdout.split()
    assert first == python(code, **stated).stdout.split()
    folder = Path(first[0])
    assert folder.parent == tmp_path and folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)  # as if another user had made it
    other = Path(python(code, **stated).stdout.split()[0])
    # deleted at the end of the process
    assert other != folder and other.parent == tmp_path and not other.exists()
    folder.rmdir()
    (tmp_path / "elsewhere").mkdir()
    folder.symlink_to(tmp_path / "elsewhere")
    assert Path(python(code, **stated).stdout.split()[0]) not in (folder, tmp_path / "elsewhere")


@POSIX
def test_a_read_only_cache_of_the_same_user_or_of_root_is_read(tmp_path):
    code = (
        "import sys; from pathlib import Path; from fvsolve.compile import cache_folders as c\n"
        "writable = c._writable; c._writable = lambda folder: 'shared' not in folder.name and writable(folder)\n"
        "{}from fvsolve.core.steppers.run_handle import no_algebra; no_algebra()\n"
        "print('numba' in sys.modules, c.cache_folder().name, len(c.code_folders()), c.is_cold())"
    )
    stated = {"FVSOLVE_CACHE": str(tmp_path / "shared"), "TMPDIR": str(tmp_path)}
    # stores its code
    assert python(code.format("c._writable = writable; "), **stated).stdout.split()[0] == "True"
    before = sorted((tmp_path / "shared").rglob("*"))
    done = python(code.format(""), **stated)
    assert done.returncode == 0, done.stderr
    numba, folder, count, cold = done.stdout.split()
    assert (numba, count, cold) == ("False", "2", "False") and folder.startswith("fvsolve-cache-")
    assert sorted((tmp_path / "shared").rglob("*")) == before
    (tmp_path / "shared").chmod(0o777)
    done = python(code.format(""), **stated)
    assert done.returncode and "can be written by all users" in done.stderr


def test_cases_execute_nothing(trapped):
    with pytest.raises(fvsolve.CaseError, match="unknown|not"):
        fvsolve.load(
            {
                "fluid": {"name": "Water"},
                "nodes": {
                    "pool": {
                        "type": "basin",
                        "size": [4, 2],
                        "cells": [4, 2],
                        "bed": "__import__('os').system('touch EXECUTED')",
                    }
                },
                "numerics": {"end": 1.0},
            }
        )
    assert not Path("EXECUTED").exists()
