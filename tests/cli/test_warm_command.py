"""`fvsolve precompile` compiles everything that a run needs, or states the reason why it cannot."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from reference.folders import CASES

from fvsolve import jit


def warm(*words: str, **environment: str):
    """Finished process of `fvsolve precompile`."""
    command = [sys.executable, "-m", "fvsolve", "precompile", *words]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True)


@pytest.mark.skipif(not jit.COMPILING, reason="JIT is off")
def test_warmed_cases_are_not_compiled_again(tmp_path, fvs):
    """The second time, the code is in a copy of the cache, because other tests may add code to the first one."""
    first = json.loads(fvs("precompile", "--for", "two-tanks", "--json")[1])
    for source in Path(first["directory"]).rglob("*"):
        copy = tmp_path / source.relative_to(jit.cache_folder())
        if source.suffix in (".code", ".json") and not source.name.startswith("."):
            copy.parent.mkdir(parents=True, exist_ok=True)
            os.link(
                source, copy
            ) if source.stat().st_dev == tmp_path.stat().st_dev else shutil.copy(source, copy)
    second = json.loads(warm("--for", "two-tanks", "--json", FVSOLVE_CACHE=str(tmp_path)).stdout)
    assert second["compiled"] == 0 and second["functions"] >= first["functions"] > 20
    assert second["directory"].endswith(second["target"]) and second["bytes"] > 1e5
    assert (
        json.loads((Path(second["directory"]) / "target.json").read_text())["name"]
        == second["target"]
    )
    code = "import sys, fvsolve; fvsolve.run('two-tanks.toml', {'output.fields': 0}); print('numba' in sys.modules)"
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=CASES, capture_output=True, text=True, check=True
    )
    assert told.stdout == "False\n"  # without numba nothing is compiled


@pytest.mark.parametrize(
    "environment, named",
    [
        (
            {"FVSOLVE_CACHE": os.devnull + "/code"},
            "FVSOLVE_CACHE = /dev/null/code: cannot be written; expected a writable folder",
        ),
        ({"NUMBA_DISABLE_JIT": "1"}, "NUMBA_DISABLE_JIT is set"),
    ],
)
def test_without_a_writable_cache_a_message_comes_and_nothing_is_compiled(environment, named):
    done = warm("--for", "two-tanks", **environment)
    assert done.returncode == 2 and named in done.stderr and done.stdout == ""


def test_all_cases_are_read_before_any_is_compiled(tmp_path, fvs):
    (tmp_path / "bad.toml").write_text("schema = 1\nnonsense = 2\n")
    code, _, err = fvs("precompile", "--for", "two-tanks", "--for", str(tmp_path / "bad.toml"))
    assert code == 2 and "nonsense" in err
    code, _, err = fvs("precompile", "--for", "two-tankz")
    assert code == 2 and "two-tanks" in err
