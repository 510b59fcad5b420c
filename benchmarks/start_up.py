"""Whole-process time of `fvsolve run` on the main case: to the answer, and to whole pictures; cold, by a store, warm.

    python benchmarks/start_up.py [--times 5] [--beside CHECKOUT] [CASE]

Cold is a new cache folder: kernels are compiled and CoolProp is asked. With a store is the first run from a copy of
what `fvsolve warm` leaves, code and fluid properties, without numba's own cache; `without fluids` of its code alone, so
that CoolProp is asked. Warm is every run after that. `--beside` takes turns with another
checkout, of an earlier version, and prints ratios. The answer is there when the terminal says how the run ended, the
pictures when the process has.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
CASE = HERE / "cases" / "valve-closure.toml"
GOALS = {"cold": 15.0, "store": 3.0, "warm": 0.7}  # [s] of the whole on a quiet machine
RATIO = 0.5  # of an earlier version's, warm
IMPORTS = "import numpy, numba"  # the floor of what loads numba
ENDS = b"finished at "


def seconds(command: list[str], cache: Path, package: Path = HERE) -> float:
    """Wall time of one process [s]; raises where it fails."""
    return measured(command, cache, package)[1]


def measured(command: list[str], cache: Path, package: Path = HERE) -> tuple[float, float, float]:
    """(wall time to the answer, to the end of the process, CPU time of all its processes) [s]."""
    environment = os.environ | {"FVSOLVE_CACHE": str(cache), "PYTHONPATH": str(package), "PYTHONUNBUFFERED": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # byte code is kept, as it is on a user's machine
    before, start, answer = busy(), time.perf_counter(), float("nan")
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL) as process:
        for line in process.stdout:
            if line.startswith(ENDS):
                answer = time.perf_counter() - start
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return answer, time.perf_counter() - start, busy() - before


def busy() -> float:
    """CPU time of all processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(case: Path, times: int, packages: dict[str, Path]) -> dict[tuple[str, str], list[tuple]]:
    """(version, start) -> what was measured of each run, versions in turn."""
    found: dict[tuple[str, str], list[tuple]] = {}
    with tempfile.TemporaryDirectory(prefix="fvsolve-start-up-") as folder:
        top = Path(folder)

        def go(version: str, start: str, cache: Path) -> None:
            run = [sys.executable, "-P", "-m", "fvsolve", "run", str(case), "--out", str(top / version), "--force"]
            found.setdefault((version, start), []).append(measured(run, cache, packages[version]))

        for i in range(max(1, times // 3)):
            for version in packages:
                go(version, "cold", top / f"{version}-{i}")
        for i in range(max(1, times // 3)):
            for start, part in (("store", ""), ("store without fluids", "code")):
                copied = top / f"{start}-{i}"
                shutil.copytree(top / "this-0" / part, copied / part, ignore=shutil.ignore_patterns("*.nb?"))
                go("this", start, copied)
        for _ in range(times):
            for version in packages:
                go(version, "warm", top / f"{version}-0")
        for _ in range(times):
            floor = measured([sys.executable, "-c", IMPORTS], top / "this-0")
            found.setdefault(("this", "imports of numpy and numba alone"), []).append(floor)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", nargs="?", type=Path, default=CASE)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--beside", type=Path, help="a checkout of another version")
    arguments = parser.parse_args()
    packages = {"this": HERE} | ({"other": arguments.beside.resolve()} if arguments.beside else {})
    print(f"fvsolve run {arguments.case.name}, whole process, least of the runs [s]\n")
    print("| version | start | answer | whole | CPU | runs | goal | |\n|---|---|---|---|---|---|---|---|")
    found = measure(arguments.case, arguments.times, packages)
    least = {key: [min(column) for column in zip(*runs, strict=True)] for key, runs in found.items()}
    for (version, start), (answer, whole, cpu) in least.items():
        goal = GOALS.get(start) if version == "this" else None
        verdict = "" if goal is None else "met" if whole <= goal else f"missed by {whole / goal:.2f} times"
        stated = "" if goal is None else f"{goal:g}"
        runs = len(found[version, start])
        print(f"| {version} | {start} | {answer:.2f} | {whole:.2f} | {cpu:.2f} | {runs} | {stated} | {verdict} |")
    if arguments.beside:
        parts = [a / b for a, b in zip(least["this", "warm"], least["other", "warm"], strict=True)]
        verdict = "met" if parts[1] <= RATIO else f"missed by {parts[1] / RATIO:.2f} times"
        told = ", ".join(
            f"{part:.2f} of its {what}" for part, what in zip(parts, ("answer", "whole", "CPU"), strict=True)
        )
        print(f"\nwarm, beside the other version: {told}; goal {RATIO:g} of the whole: {verdict}")


if __name__ == "__main__":
    main()
