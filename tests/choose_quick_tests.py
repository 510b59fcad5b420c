"""Choose the quick tests: record the cost of each test, and write the other tests to `tests/durations.json`.

    python tests/choose_quick_tests.py [--seconds 480] [--recording FOLDER]

The cost of a test is its own processor time and its share of compilation: the time to compile a function, divided by
the number of quick tests that call it. The most expensive tests are removed until the others take the given time. A
test stays if no other test runs a part, scheme, method, density law, command or shipped case.
"""

import argparse
import functools
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

import pytest
from reference.pairs import is_in_turn

LIST = Path(__file__).parent / "durations.json"
FOLDER = "FVSOLVE_RECORDING"  # variable that names the folder in which worker processes record


@dataclass
class Cost:
    """Cost of a test: its own seconds, functions that it calls, and names that it covers as `kind name`."""

    own: float
    functions: frozenset[str]
    names: frozenset[str]


CALLED: set[str] = set()  # functions that the present test calls


def recording(cache):
    """Decorator like `cache`, except that a cached result counts as calls of the functions that computed it."""

    def decorator(function):
        calls: dict = {}

        def watched(*arguments):
            outer = set(CALLED)
            CALLED.clear()
            result = function(*arguments)
            calls[arguments] = set(CALLED)
            CALLED.update(outer)
            return result

        cached = cache(functools.wraps(function)(watched))

        @functools.wraps(function)
        def called(*arguments):
            result = cached(*arguments)
            CALLED.update(calls.get(arguments, ()))
            return result

        def cache_clear():
            calls.clear()
            cached.cache_clear()

        called.cache_clear = cache_clear
        return called if function.__module__.startswith("fvsolve.") else cache(function)

    return decorator


class Recorder:
    """Pytest plugin that writes a line for each test of a worker process."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("a", buffering=1, encoding="utf-8")
        self.seconds: dict[str, float] = {}
        self.nested: list[float] = []
        self._watch()

    def _watch(self) -> None:
        from fvsolve.compile.functions import Function

        code, call, compiled = Function.code, Function.__call__, Function._compiled

        def watched_code(function, letters, *more, **options):
            CALLED.add(f"{function.__module__}.{function.__qualname__}({letters})")
            return code(function, letters, *more, **options)

        def watched_call(function, *values):
            CALLED.add(f"{function.__module__}.{function.__qualname__}")
            return call(function, *values)

        def watched_compiled(function, key, *more):
            start = processor_seconds()
            self.nested.append(0.0)
            try:
                return compiled(function, key, *more)
            finally:
                spent, inner = processor_seconds() - start, self.nested.pop()
                self.seconds[
                    f"{function.__module__}.{function.__qualname__}({key.lstrip('.')})"
                ] = spent - inner
                if self.nested:
                    self.nested[-1] += spent

        Function.code, Function.__call__, Function._compiled = (
            watched_code,
            watched_call,
            watched_compiled,
        )

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item, nextitem):
        from conftest import TALLY

        tally = item.config.stash[TALLY]
        before, tally.names = tally.names, defaultdict(set)
        CALLED.clear()
        self.seconds.clear()
        start = processor_seconds()
        try:
            return (yield)
        finally:
            names = [f"{kind} {name}" for kind, some in tally.names.items() for name in some]
            row = {
                "test": item.nodeid,
                "seconds": processor_seconds() - start,
                "compiled": self.seconds,
                "called": sorted(CALLED),
                "names": sorted(names),
            }
            self.file.write(json.dumps(row) + "\n")
            tally.names = before


def processor_seconds() -> float:
    """Processor time of this process and of its finished children [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


if FOLDER in os.environ:  # before fvsolve is imported
    import fvsolve.jit

    fvsolve.jit.compile_once = recording(fvsolve.jit.compile_once)
    functools.cache = recording(functools.cache)


def pytest_configure(config) -> None:
    worker = getattr(config, "workerinput", {}).get("workerid", "main")
    config.pluginmanager.register(Recorder(Path(os.environ[FOLDER]) / f"{worker}.json"))


def pytest_collection_modifyitems(items) -> None:
    items[:] = [item for item in items if is_in_turn(item) and is_in_turn(item, "quick_in_turn")]


def record(folder: Path) -> None:
    """Run all tests with an empty cache, and record each."""
    with tempfile.TemporaryDirectory(prefix="fvsolve-cache-") as cache:
        environment = os.environ | {
            FOLDER: str(folder),
            "FVSOLVE_CACHE": cache,
            "PYTHONPATH": os.pathsep.join(map(str, LIST.parents[:2])),
        }
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-n",
            "2",
            "--dist",
            "worksteal",
            "--full",
            "-p",
            "choose_quick_tests",
        ]
        subprocess.run(command, cwd=LIST.parents[1], env=environment, check=False)


def costs(rows: list[dict]) -> tuple[dict[str, Cost], dict[str, float]]:
    """Cost of each test, and seconds to compile each function."""
    compiled: dict[str, float] = defaultdict(float)
    for row in rows:
        for name, seconds in row["compiled"].items():
            compiled[name] = max(compiled[name], seconds)
    by_name = defaultdict(list)
    for name in compiled:
        by_name[name.split("(")[0]].append(name)
    return {
        row["test"]: Cost(
            max(0.0, row["seconds"] - sum(row["compiled"].values())),
            frozenset(
                name
                for called in row["called"]
                for name in by_name[called.split("(")[0]]
                if called in name
            )
            | frozenset(row["compiled"]),
            frozenset(row["names"]),
        )
        for row in rows
    }, dict(compiled)


def needed(tests: dict[str, Cost]) -> set[str]:
    """Cheapest tests that cover each name, chosen for the rarest name first."""
    covers: dict[str, list[str]] = defaultdict(list)
    for test, cost in tests.items():
        for name in cost.names:
            covers[name].append(test)
    chosen: set[str] = set()
    for name in sorted(covers, key=lambda name: (len(covers[name]), name)):
        if not chosen.intersection(covers[name]):
            chosen.add(min(covers[name], key=lambda test: (tests[test].own, test)))
    return chosen


def quick(tests: dict[str, Cost], compiled: dict[str, float], seconds: float) -> dict[str, float]:
    """Tests to leave out, with the cost for which each was left out [s]."""
    kept, out, fixed = dict(tests), {}, needed(tests)
    while True:
        users = Counter(name for cost in kept.values() for name in cost.functions)
        if (
            sum(cost.own for cost in kept.values()) + sum(compiled[name] for name in users)
            <= seconds
        ):
            return out
        share = {name: compiled[name] / count for name, count in users.items()}
        whole = {
            test: cost.own + sum(share[name] for name in cost.functions)
            for test, cost in kept.items()
        }
        free = [test for test in kept if test not in fixed]
        if not free:
            return out
        for test in sorted(free, key=whole.get, reverse=True)[: max(1, len(free) // 200)]:
            out[test] = whole[test]
            del kept[test]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=480.0,
        help="processor time of the quick tests (default 480)",
    )
    parser.add_argument(
        "--recording", type=Path, metavar="FOLDER", help="read a recording, or write one here"
    )
    options = parser.parse_args()
    folder = options.recording or Path(tempfile.mkdtemp(prefix="fvsolve-recording-"))
    folder.mkdir(parents=True, exist_ok=True)
    if not any(folder.glob("*.json")):
        record(folder)
    lines = [
        line
        for path in sorted(folder.glob("*.json"))
        for line in path.read_text(encoding="utf-8").splitlines()
    ]
    tests, compiled = costs([json.loads(line) for line in lines])
    out = quick(tests, compiled, options.seconds)
    slow = {test: round(cost, 2) for test, cost in sorted(out.items())}
    LIST.write_text(
        json.dumps({"seconds": options.seconds, "slow": slow}, indent=1) + "\n", encoding="utf-8"
    )
    own = sum(cost.own for cost in tests.values())
    print(
        f"{len(tests)} tests take {own:.0f} s and {sum(compiled.values()):.0f} s of compiling {len(compiled)} functions"
    )
    print(f"{len(tests) - len(out)} are quick; {len(out)} are in {LIST.name}; recording: {folder}")


if __name__ == "__main__":
    main()
