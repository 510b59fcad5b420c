"""What the tests share: warm kernels are timed apart, and pictures stay off screen."""

from __future__ import annotations

import os
import sys

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: its threads only get in each other's way


@pytest.fixture
def fvs(monkeypatch, capsys):
    """The command line in this process: fvs("run", "two-tanks") -> (exit code, standard output, standard error)."""
    from fvsolve.cli import main

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["fvsolve", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        said = capsys.readouterr()
        assert "Traceback" not in said.err + said.out
        return left.value.code or 0, said.out, said.err

    return call
