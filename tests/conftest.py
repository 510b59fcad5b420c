"""Fixtures of all tests, the choice between quick tests and all tests, and the surroundings that a test must restore.

`pytest` without paths runs the quick tests: all but those that `tests/durations.json` lists as slow. `pytest --full`
and `pytest PATH` run every test. `tests/choose_quick_tests.py` writes the list from a recording.
"""

import gc
import json
import os
import signal
import sys
import zlib
from pathlib import Path

import hypothesis
import pytest
from hypothesis_profiles import NEW, fix_constants
from reference.pairs import is_in_turn
from reference.small_package import package  # noqa: F401  (a fixture)
from tally import Tally, unknown_names

from fvsolve.core.steppers.tableau import METHODS

os.environ.setdefault("MPLBACKEND", "Agg")
# background jobs of a shell ignore the signal
signal.signal(signal.SIGINT, signal.default_int_handler)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: more threads are slower
SLOW = json.loads((Path(__file__).parent / "durations.json").read_text(encoding="utf-8"))["slow"]
TIER, TALLY, UNCOVERED = pytest.StashKey[str](), pytest.StashKey[Tally](), pytest.StashKey[list]()
# options that leave out tests
SELECTIONS = ("quick", "keyword", "markexpr", "lf", "deselect", "collectonly")
fix_constants()


def pytest_addoption(parser):
    parser.addoption("--full", action="store_true", help="run all tests, not only the quick tests")
    parser.addoption(
        "--quick", action="store_true", help="run only the quick tests of the paths given"
    )
    parser.addoption("--rest", action="store_true", help="run all tests but the quick tests")


def pytest_configure(config):
    text = "quick_in_turn: the quick tests run each value of each parameter list at least once, the others the rest"
    config.addinivalue_line("markers", text)
    worker = getattr(config, "workerinput", None)
    config.stash[TIER] = worker["tier"] if worker else tier(config)
    hypothesis.settings.load_profile("quick" if config.stash[TIER] == "quick" else "full")
    config.stash[TALLY] = Tally()
    config.stash[UNCOVERED] = []


def tier(config) -> str:
    """Tests to run: "quick", "rest" (all others, and those that draw more inputs than the quick tests) or "full"."""
    for name in ("quick", "rest", "full"):
        if config.getoption(name):
            return name
    return "quick" if config.args_source is config.ArgsSource.TESTPATHS else "full"


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node):
    node.workerinput["tier"] = node.config.stash[TIER]


def pytest_collection_modifyitems(config, items):
    drawing = {
        item for item in items if getattr(getattr(item, "function", None), "hypothesis", None)
    }
    for item in drawing if not NEW else ():
        hypothesis.seed(zlib.crc32(item.originalname.encode()))(item.function)
    quick = {
        item for item in items if item.nodeid not in SLOW and is_in_turn(item, "quick_in_turn")
    }
    if config.stash[TIER] != "full":
        config.stash[TALLY].names["unknown"] = unknown_names(SLOW, [item.nodeid for item in items])
    chosen = {"quick": quick, "rest": {*items} - quick | drawing, "full": {*items}}[
        config.stash[TIER]
    ]
    if config.stash[TIER] != "full":
        chosen = {item for item in chosen if is_in_turn(item)}
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    items[:] = [item for item in items if item in chosen]


def pytest_collection_finish(session):
    """Search new objects alone for unused objects, and seldom: modules and tests stay to the end."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def pytest_sessionstart(session):
    session.config.stash[TALLY].start()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    node.config.stash[TALLY].add(getattr(node, "workeroutput", {}).get("tally", {}))


def pytest_sessionfinish(session, exitstatus):
    config = session.config
    if hasattr(config, "workeroutput"):
        config.workeroutput["tally"] = config.stash[TALLY].plain()
    elif (
        config.stash[TIER] == "quick"
        and not exitstatus
        and not any(config.getoption(name, None) for name in SELECTIONS)
    ):
        config.stash[UNCOVERED] = config.stash[TALLY].missing()
        if config.stash[UNCOVERED]:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    if config.stash[UNCOVERED]:
        terminalreporter.section("not covered by the quick tests", red=True)
        for line in config.stash[UNCOVERED]:
            terminalreporter.line(line)


@pytest.fixture
def fvs(monkeypatch, capsys):
    """The command line in this process: fvs("run", "two-tanks") -> (exit code, standard output, standard error)."""
    from fvsolve import jit
    from fvsolve.cli import main

    # else the first test of a cold cache would see a notice
    monkeypatch.setattr(jit, "is_cold", lambda: False)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["fvsolve", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        printed = capsys.readouterr()
        assert "Traceback" not in printed.err + printed.out
        return left.value.code or 0, printed.out, printed.err

    return call


@pytest.fixture(scope="module")
def cluster():
    """Cluster of two processes of Dask, which takes a seventh of a processor even while it waits."""
    distributed = pytest.importorskip("distributed", reason="Dask is an extra")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0"
    ) as local:
        yield local


@pytest.fixture
def own_limiters_removed(monkeypatch):
    """Limiters that a test registers are removed at its end."""
    from fvsolve.core.schemes import LIMITERS
    from fvsolve.parts import own_limiters

    before = dict(LIMITERS)
    monkeypatch.setenv(own_limiters.LIMITERS_VARIABLE, "")
    yield
    LIMITERS.clear()
    LIMITERS.update(before)


@pytest.fixture(autouse=True)
def alone(request):
    """Remove methods that a test adds; fail a test that changes folder, environment or tables of its module."""
    methods, before = dict(METHODS), surroundings(request.module)
    yield
    METHODS.clear()
    METHODS.update(methods)
    assert surroundings(request.module) == before


def surroundings(module) -> tuple:
    """State outside a test that another test may read."""
    tables = {
        name: repr(value)
        for name, value in vars(module).items()
        if isinstance(value, (dict, list, set)) and name[0] != "_"
    }
    variables = {  # the first import of rasterio, by WNTR too, sets bundles of certificates
        name: value
        for name, value in os.environ.items()
        if name != "PYTEST_CURRENT_TEST" and not name.endswith("_CURL_CA_BUNDLE")
    }
    return os.getcwd(), variables, tables
