"""Find the tests that run a module of the package.

    python tests/find_tests.py fvsolve/core/steady.py              tests, and how many lines of the module each runs
    python tests/find_tests.py fvsolve/core/steady.py --line 120   tests that run a line
    python tests/find_tests.py --record                       make a new recording: ten minutes on two cores

The recording by coverage.py has two parts: the quick tests, for Python, and the quick tests of `UNCOMPILED` without
compilation, for kernels. Tests of the second part that need a compiler, or more than LIMIT, fail as expected.
"""

import argparse
import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
UNCOMPILED = (
    "tests/kernels",
    "tests/fluid",
    "tests/basins/test_basin.py",
    "tests/basins/test_faces.py",
    "tests/parts/test_outlets.py",
    "tests/parts/test_outlets.py",
    "tests/parts/test_pump.py",
)
LIMIT = 8  # time of a test without compilation [s]
RECORDINGS = {  # name -> environment and paths of its tests
    "python": ({}, ()),
    "compiled": (
        {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(Path(__file__).parent)},
        ("--quick", "-p", "find_tests", *UNCOMPILED),
    ),
}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Fail a test that takes longer than LIMIT; a hook for the tests without compilation."""

    def stop(*_):
        raise TimeoutError(f"longer than {LIMIT} s")

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def path_of(name: str) -> Path:
    return TOP / ".pytest_cache" / f"coverage-{name}"


def record() -> None:
    """Run the tests of both parts with a context for each test."""
    options = [
        "-q",
        "-n",
        "2",
        "--dist",
        "worksteal",
        "--cov=fvsolve",
        "--cov-context=test",
        "--cov-report=",
    ]
    for name, (environment, paths) in RECORDINGS.items():
        path_of(name).parent.mkdir(exist_ok=True)
        environment = os.environ | environment | {"COVERAGE_FILE": str(path_of(name))}
        subprocess.run(
            [sys.executable, "-m", "pytest", *options, *paths],
            cwd=TOP,
            env=environment,
            check=False,
        )


def tests_of(module: Path, line: int | None) -> Counter:
    """Number of lines of a module that each test runs, beyond those of its import."""
    from coverage import CoverageData

    count: Counter = Counter()
    for name in RECORDINGS:
        if path_of(name).exists():
            data = CoverageData(str(path_of(name)))
            data.read()
            for number, contexts in data.contexts_by_lineno(str(module)).items():
                if line in (None, number):
                    count.update({context.split("|")[0] for context in contexts} - {""})
    return count


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("module", nargs="?", help="path of a module")
    parser.add_argument("--line", type=int, metavar="N", help="number of a line of the module")
    parser.add_argument("--record", action="store_true", help="run the tests and record")
    options = parser.parse_args()
    if options.record:
        record()
    if options.module is None:
        return
    if not any(path_of(name).exists() for name in RECORDINGS):
        sys.exit("no recording. Try: python tests/find_tests.py --record")
    for test, lines in tests_of(Path(options.module).resolve(), options.line).most_common():
        print(f"{lines:5d}  {test}")


if __name__ == "__main__":
    main()
