"""Run all scripts of this folder with `--quick`, two at a time, and print a line for each.

python benchmarks/quick.py [NAME]...

Fails if a script fails, has no `--quick`, or takes longer than LIMIT. Reports a script that takes more CPU time than
EACH, and a total time above ALL; both occur if the cache does not contain all kernels.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Timer
from time import perf_counter

from measure import QUICK, SKIPPED

HERE = Path(__file__).resolve().parent
ALONE = os.environ | {"OPENBLAS_NUM_THREADS": "1"}  # two scripts share the cores
# CPU time of a script, wall time of all, wall time of a script [s]
EACH, ALL, LIMIT = 5.0, 180.0, 600.0


def scripts() -> list[Path]:
    """Paths of the scripts of this folder, except this one."""
    found = sorted(HERE.glob("*.py"))
    return [
        path
        for path in found
        if '__name__ == "__main__"' in path.read_text() and path.name != "quick.py"
    ]


def run(path: Path) -> bool:
    """Run a script and print its line, with its output if it failed; True if it passed."""
    began = perf_counter()
    process = subprocess.Popen(
        [sys.executable, path, "--quick"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        env=ALONE,
    )
    # kills also the processes that it started
    stop = Timer(LIMIT, os.killpg, (process.pid, signal.SIGKILL))
    stop.start()
    said = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    stop.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    wall, busy = perf_counter() - began, used.ru_utime + used.ru_stime
    passed = process.returncode == 0 and QUICK in said
    words = ["ok" if passed else f"FAILED, exit status {process.returncode}"]
    words += ["no --quick"] * (QUICK not in said) + [f"more than {EACH:g} s of CPU"] * (busy > EACH)
    words += [line for line in dict.fromkeys(said.splitlines()) if line.endswith(SKIPPED)]
    print(f"{path.name:24}{wall:6.1f} s,{busy:6.1f} s of CPU: {'; '.join(words)}", flush=True)
    if not passed:
        print(said, flush=True)
    return passed


def main() -> None:
    """Run all scripts, or the given ones."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument(
        "names", nargs="*", metavar="NAME", help="names of scripts, without .py (default all)"
    )
    names, began = options.parse_args().names, perf_counter()
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(run, [HERE / f"{name}.py" for name in names] or scripts()))
    seconds, failed = perf_counter() - began, found.count(False)
    late = f", more than {ALL:g} s" if seconds > ALL else ""
    print(f"{len(found)} scripts in {seconds:.0f} s{late}, {failed} failed")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
