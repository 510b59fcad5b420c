"""Cost of a step of every shipped case at two commits, and of the rest of a run, as ratios.

    python benchmarks/step_cost.py OLD NEW [--cases a,b] [--rounds 3] [--quick]

Both commits are extracted to a temporary folder (compare_commits.py) and run by a process each, with the user's cache
of compiled code. In every round the processes take turns: each runs the case for about `SPAN` seconds and gives its
least time of the loop over steps, divided by the number of steps, and its least CPU time of `run(model)` outside this
loop. The first run of a case, which may compile, is not counted. Prints the least time per step of each commit, the
ratio NEW / OLD and its range over rounds, then the steps and the rest of each commit.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import measure
from compare_commits import HERE, extract, revision

# time in which a process repeats a run [s], and the greatest number of repeats
SPAN, MOST_RUNS = 0.6, 200
LONGEST = 6.0  # a case whose run takes longer is run once a round [s]

WORKER = f"""
import contextlib, json, os, sys, time
from fvsolve import build, load, run
def loaded(path):
    try:
        return load(path, {{"output.fields": 0, "output.lines": {{}}}})
    except Exception:  # an older commit without lines
        return load(path, {{"output.fields": 0}})
for line in sys.stdin:
    least, whole, spent, steps, runs = float("inf"), float("inf"), 0.0, 1, 0
    try:
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            model = build(loaded(line.strip()))
            summary = run(model).summary
            long = summary["seconds"] > {LONGEST}
            while not runs or (spent < {SPAN} and runs < {MOST_RUNS} and not long):
                begun = time.process_time()
                summary = run(model).summary
                took = time.process_time() - begun
                least, whole, spent = min(least, summary["seconds"]), min(whole, took), spent + took
                steps, runs = max(summary["steps"], 1), runs + 1
        print(json.dumps([least / steps, steps, whole - least]), flush=True)
    except Exception as error:
        print(json.dumps([None, f"{{type(error).__name__}}: {{error}}"[:100]]), flush=True)
"""


def worker(commit: str, folder: Path) -> subprocess.Popen:
    """Process that times the cases of a commit whose paths it reads."""
    extract(commit, folder)
    known = {
        **os.environ,
        "PYTHONPATH": str(folder),
        "MPLBACKEND": "Agg",
        "OPENBLAS_NUM_THREADS": "1",
    }
    return subprocess.Popen(
        [sys.executable, "-P", "-c", WORKER],
        env=known,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=folder,
    )


def timed(process: subprocess.Popen, path: Path) -> list:
    """(time of a step [s], number of steps, CPU time of the rest of a run [s]), or (None, text of the error)."""
    print(path, file=process.stdin, flush=True)
    return json.loads(process.stdout.readline())


def main() -> int:
    parser = measure.parser(__doc__)
    parser.add_argument("old", nargs="?", default="HEAD", help="old commit")
    parser.add_argument("new", nargs="?", default="HEAD", help="new commit")
    parser.add_argument(
        "--cases", default="", help="names of cases, separated by commas (default all)"
    )
    parser.add_argument("--rounds", type=int, default=3, help="turns of each commit")
    asked = parser.parse_args()
    if asked.quick and not (HERE.parent / ".git").exists():
        print(f"there is no git repository: {measure.SKIPPED}")
        return 0
    names = ["two-tanks"] if asked.quick else [name for name in asked.cases.split(",") if name]
    ratios = []
    with tempfile.TemporaryDirectory(prefix="fvsolve-") as made:
        trees = [Path(made) / side for side in ("old", "new")]
        workers = [
            worker(revision(commit), tree)
            for commit, tree in zip((asked.old, asked.new), trees, strict=True)
        ]
        for name in names or sorted(path.stem for path in (trees[0] / "cases").glob("*.toml")):
            rounds = [
                [
                    timed(process, tree / "cases" / f"{name}.toml")
                    for process, tree in zip(workers, trees, strict=True)
                ]
                for _ in range(1 if asked.quick else asked.rounds)
            ]
            failed = [side[1] for pair in rounds for side in pair if side[0] is None]
            if failed:
                print(f"{name:28s} {failed[0]}", flush=True)
                continue
            old, new = (min(pair[k][0] for pair in rounds) for k in (0, 1))
            spread = [pair[1][0] / pair[0][0] for pair in rounds]
            ratios.append(new / old)
            rest, steps = (
                [min(pair[k][2] for pair in rounds) for k in (0, 1)],
                [rounds[0][k][1] for k in (0, 1)],
            )
            print(
                f"{name:28s} {1e9 * old:12.1f} ns {1e9 * new:12.1f} ns   ratio {new / old:.3f}"
                f"   rounds {min(spread):.3f} to {max(spread):.3f}, steps {steps[0]} and {steps[1]}, rest "
                f"{1e3 * rest[0]:.2f} and {1e3 * rest[1]:.2f} ms",
                flush=True,
            )
        for process in workers:
            process.stdin.close()
            process.wait()
    if ratios:
        ratios.sort()
        print(
            f"{len(ratios)} cases: ratio {ratios[0]:.3f} to {ratios[-1]:.3f}, median {ratios[len(ratios) // 2]:.3f}"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
