"""Small copy of the package in a folder, and processes that use it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fvsolve import errors, jit
from fvsolve.compile import store

LAW = """from fvsolve.jit import njit

@njit
def law(x):
    return {factor} * x
"""
LOOP = """from fvsolve.jit import njit
from fvsolve.core.kernels.law import law

@njit
def loop(n):
    total = 0.0
    for i in range(n):
        total += law(float(i))
    return total
"""


@pytest.fixture
def package(tmp_path):
    """Small copy of the package: what compiles, and two compiled functions; the second calls the first."""
    folder = tmp_path / "fvsolve"
    core = folder / "core"
    for room in (folder, core, core / "kernels", core / "steppers"):
        room.mkdir()
        (room / "__init__.py").touch()
    for module in (jit, errors):
        shutil.copy(module.__file__, folder)
    shutil.copytree(
        Path(store.__file__).parent,
        folder / "compile",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    (core / "kernels" / "law.py").write_text(LAW.format(factor=2.0))
    (core / "steppers" / "loop.py").write_text(LOOP)
    return folder


def python(package: Path, code: str, told: str = "", **environment: str) -> list[str]:
    """Words that `code` prints in a process with this copy and its own cache; only warnings like `told` are allowed."""
    stated = {"FVSOLVE_CACHE": str(package.parent / "cache"), "PYTHONPATH": str(package.parent)}
    stated["PYTHONDONTWRITEBYTECODE"] = "1"  # bytecode files do not show an edit within a second
    inherited = {k: v for k, v in os.environ.items() if k != "NUMBA_DISABLE_JIT"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=inherited | stated | environment,
        cwd=package.parent,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and (re.search(told, done.stderr) if told else done.stderr == ""), (
        done.stderr
    )
    return done.stdout.split()
