"""An older Python is refused with a message that names it, the required version and the remedy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
PRETEND = "import sys; sys.version_info = (3, 10, 13); import fvsolve"


def test_the_package_refuses_an_older_python():
    found = subprocess.run([sys.executable, "-c", PRETEND], capture_output=True, text=True, cwd=TOP)
    assert found.returncode == 1
    assert "needs Python 3.11 or later" in found.stderr
    assert sys.executable in found.stderr and "-m venv" in found.stderr
    assert "numba" not in found.stderr


@pytest.mark.skipif(not (TOP / ".ci/run").exists() or os.name == "nt", reason="no .ci/run here")
def test_ci_refuses_an_older_python(tmp_path):
    older = tmp_path / "python3.10"
    older.write_text('#!/bin/sh\nif [ "$1" = --version ]; then echo Python 3.10.13; else exit 1; fi\n')
    older.chmod(0o755)
    found = subprocess.run(
        [TOP / ".ci/run"],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHON": str(older), "TMPDIR": str(tmp_path)},
    )
    assert found.returncode == 1
    assert all(part in found.stdout for part in (str(older), "3.10.13", "3.11 or later", "PYTHON="))
    assert list(tmp_path.iterdir()) == [older]
