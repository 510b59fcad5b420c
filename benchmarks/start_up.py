"""Whole-process time of `fvsolve run` on the main case, from a cold cache and from a warm one.

    python benchmarks/start_up.py [--times 5] [CASE]

Cold is a new cache folder: kernels are compiled and CoolProp is asked. Warm is every run after that.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CASE = Path(__file__).resolve().parent.parent / "cases" / "valve-closure.toml"
GOALS = {"cold": 15.0, "warm": 1.5}  # [s]
IMPORTS = "import numpy, numba"  # the floor: what no program on numba can do without


def seconds(command: list[str], cache: Path) -> float:
    """Wall time of one process [s]; raises where it fails."""
    environment = os.environ | {"FVSOLVE_CACHE": str(cache)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # byte code is kept, as it is on a user's machine
    start = time.perf_counter()
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
    return time.perf_counter() - start


def measure(case: Path, times: int) -> dict[str, list[float]]:
    """Wall times [s] of cold runs (each with a cache of its own), warm runs and the imports alone."""
    with tempfile.TemporaryDirectory(prefix="fvsolve-start-up-") as folder:
        out = Path(folder) / "run"
        run = [sys.executable, "-m", "fvsolve", "run", str(case), "--out", str(out), "--force"]
        colds = [seconds(run, Path(folder) / f"cache-{i}") for i in range(max(1, times // 3))]
        warms = [seconds(run, Path(folder) / "cache-0") for _ in range(times)]
        floors = [seconds([sys.executable, "-c", IMPORTS], Path(folder) / "cache-0") for _ in range(times)]
    return {"cold": colds, "warm": warms, "imports alone": floors}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", nargs="?", type=Path, default=CASE)
    parser.add_argument("--times", type=int, default=5)
    arguments = parser.parse_args()
    print(f"fvsolve run {arguments.case.name}, whole process\n")
    print("| start | best [s] | worst [s] | runs | goal [s] | |\n|---|---|---|---|---|---|")
    for start, walls in measure(arguments.case, arguments.times).items():
        goal = GOALS.get(start)
        verdict = "" if goal is None else "met" if min(walls) <= goal else f"missed by {min(walls) / goal:.2f} times"
        stated = "" if goal is None else f"{goal:g}"
        print(f"| {start} | {min(walls):.2f} | {max(walls):.2f} | {len(walls)} | {stated} | {verdict} |")


if __name__ == "__main__":
    main()
