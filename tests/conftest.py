"""What the tests share: pictures stay off screen, and no test leaves anything that the next one meets."""

from __future__ import annotations

import os
import signal
import sys

import pytest

from fvsolve.steppers.tableau import METHODS

os.environ.setdefault("MPLBACKEND", "Agg")
signal.signal(signal.SIGINT, signal.default_int_handler)  # which jobs in the background of a shell do not heed
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


@pytest.fixture(scope="session")
def cluster():
    """Two processes of Dask's."""
    distributed = pytest.importorskip("distributed", reason="Dask is an extra")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as made:
        yield made


@pytest.fixture(autouse=True)
def alone(request):
    """In any order: a test's methods go with it; folder, environment and its module's tables stay as they were."""
    methods, before = dict(METHODS), surroundings(request.module)
    yield
    METHODS.clear()
    METHODS.update(methods)
    assert surroundings(request.module) == before


def surroundings(module) -> tuple:
    """What a test may read and a test before it could have written."""
    tables = {
        name: repr(one) for name, one in vars(module).items() if isinstance(one, (dict, list, set)) and name[0] != "_"
    }
    return os.getcwd(), {name: one for name, one in os.environ.items() if name != "PYTEST_CURRENT_TEST"}, tables
