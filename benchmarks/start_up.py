"""Time of the process `fvsolve run` on the main case, to the answer and to finished pictures: cold, with a store, warm.

    python benchmarks/start_up.py [--quick] [--times 5] [--beside CHECKOUT] [CASE]

`cold` has a new cache folder: kernels are compiled and CoolProp is called. `store` is the first run with a copy of the
files that `fvsolve precompile` writes, code and fluid properties, without numba's own cache; `store without fluids`
copies the code only, so CoolProp is called. `warm` is every later run. `--beside` alternates with another checkout, of
an earlier version, and prints ratios. The answer is complete when the terminal shows how the run ended, the pictures
when the process ends. With `--quick` the case is two-tanks, and the user's own cache replaces the new one, so code
that was compiled before is not compiled again.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import agree, parser

HERE = Path(__file__).resolve().parent.parent
CASE = HERE / "cases" / "valve-closure.toml"
# times of the whole process on an idle machine [s]
GOALS = {"cold": 15.0, "store": 3.0, "warm": 0.7}
RATIO = 0.5  # ratio to the time of an earlier version, warm
IMPORTS = "import numpy, numba"  # least time of a process that imports numba
ENDS = b"finished at "


def seconds(command: list[str], cache: Path, package: Path = HERE) -> float:
    """Wall time of one process [s]; raises CalledProcessError if it fails."""
    return measured(command, cache, package)[1]


def measured(command: list[str], cache: Path, package: Path = HERE) -> tuple[float, float, float]:
    """Wall time to the answer, wall time to the end of the process, and CPU time of all its processes [s]."""
    environment = os.environ | {
        "FVSOLVE_CACHE": str(cache),
        "PYTHONPATH": str(package),
        "PYTHONUNBUFFERED": "1",
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # byte code is written, as on a user's machine
    before, start, answer = busy(), time.perf_counter(), float("nan")
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL
    ) as process:
        for line in process.stdout:
            if line.startswith(ENDS):
                answer = time.perf_counter() - start
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return answer, time.perf_counter() - start, busy() - before


def busy() -> float:
    """CPU time of all finished child processes [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cache(folder: Path, quick: bool) -> Path:
    """New cache folder, or with `quick` the user's own, which may contain compiled code."""
    if not quick:
        return folder
    from fvsolve.jit import cache_folder

    return cache_folder()


def measure(
    case: Path, times: int, packages: dict[str, Path], quick: bool
) -> dict[tuple[str, str], list[tuple]]:
    """Times of each run by (version, start), with the versions in turn."""
    found: dict[tuple[str, str], list[tuple]] = {}
    with tempfile.TemporaryDirectory(prefix="fvsolve-start-up-") as folder:
        top = Path(folder)

        def go(version: str, start: str, cache: Path) -> None:
            run = [
                sys.executable,
                "-P",
                "-m",
                "fvsolve",
                "run",
                str(case),
                "--out",
                str(top / version),
                "--force",
            ]
            found.setdefault((version, start), []).append(measured(run, cache, packages[version]))

        for i in range(max(1, times // 3)):
            for version in packages:
                go(version, "cold", cache(top / f"{version}-{i}", quick))
        for i in range(max(1, times // 3)):
            for start, part in (("store", ""), ("store without fluids", "code"))[
                : 1 if quick else None
            ]:
                copied = top / f"{start}-{i}"
                shutil.copytree(
                    cache(top / "this-0", quick) / part,
                    copied / part,
                    ignore=shutil.ignore_patterns("*.nb?"),
                )
                go("this", start, copied)
        for _ in range(times):
            for version in packages:
                go(version, "warm", cache(top / f"{version}-0", quick))
        for _ in range(times):
            floor = measured([sys.executable, "-c", IMPORTS], cache(top / "this-0", quick))
            found.setdefault(("this", "imports of numpy and numba alone"), []).append(floor)
    return found


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "case",
        nargs="?",
        type=Path,
        help="case to run (default valve-closure, with --quick two-tanks)",
    )
    options.add_argument(
        "--times", type=int, help="number of warm runs (default 5, with --quick 1)"
    )
    options.add_argument("--beside", type=Path, help="checkout of another version")
    arguments = options.parse_args()
    arguments.case = arguments.case or (CASE.with_stem("two-tanks") if arguments.quick else CASE)
    arguments.times = arguments.times or (1 if arguments.quick else 5)
    packages = {"this": HERE} | ({"other": arguments.beside.resolve()} if arguments.beside else {})
    print(f"fvsolve run {arguments.case.name}, whole process, least of the runs [s]\n")
    print(
        "| version | start | answer | whole | CPU | runs | goal | |\n|---|---|---|---|---|---|---|---|"
    )
    found = measure(arguments.case, arguments.times, packages, arguments.quick)
    least = {
        key: [min(column) for column in zip(*runs, strict=True)] for key, runs in found.items()
    }
    for (version, start), (answer, whole, cpu) in least.items():
        goal = GOALS.get(start) if version == "this" else None
        verdict = (
            ""
            if goal is None
            else "met"
            if whole <= goal
            else f"missed by {whole / goal:.2f} times"
        )
        stated = "" if goal is None else f"{goal:g}"
        runs = found[version, start]
        agree(
            "runs that give no answer",
            sum(one[0] != one[0] for one in runs) if "imports" not in start else 0,
            0,
        )
        print(
            f"| {version} | {start} | {answer:.2f} | {whole:.2f} | {cpu:.2f} | {len(runs)} | {stated} | {verdict} |"
        )
    if arguments.beside:
        parts = [a / b for a, b in zip(least["this", "warm"], least["other", "warm"], strict=True)]
        verdict = "met" if parts[1] <= RATIO else f"missed by {parts[1] / RATIO:.2f} times"
        told = ", ".join(
            f"{part:.2f} of its {what}"
            for part, what in zip(parts, ("answer", "whole", "CPU"), strict=True)
        )
        print(f"\nwarm, beside the other version: {told}; goal {RATIO:g} of the whole: {verdict}")


if __name__ == "__main__":
    main()
