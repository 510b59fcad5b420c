"""Comparison of the shipped cases of two commits to the bit, as a proof that a change of names changed no result.

    python benchmarks/compare_commits.py OLD NEW [--map names.tsv] [--cases a,b] [--quick]

Both commits are extracted to a temporary folder; uncommitted changes are ignored. Each commit runs its own cases in a
separate process, without `--quick` with an empty cache of compiled code. dump_cases.py dumps for each case:

- the right-hand side (`dydt` and all other output) by time and state vector, the rates of the stored state, and all
  probes: at the start, after a quarter of the run and at its end as computed by `advance`, and again at the start;
- the right-hand side at the mean of the states at the start and at the end;
- the files of the run: history, envelope, routes, fields and lines of all frames, the summary, the resolved case;
  cases in `dump_cases.ENDS` end earlier than shipped.

A case is also run in its VARIANTS, in which keys have other values, so that features work together.

Wall times, costs, versions and hashes in the summary, the checkpoint and pictures are not compared. Texts for people
(titles, notices, reasons after the colon) are compared by number and kind, not by their words.

A line of the map is KIND, OLD and NEW name, separated by tabs (compare_dumps.py). Kind `public` renames words of keys,
columns and texts: `extremes.least` is `least` below `extremes`. Other kinds (`module`, `name`, `member`, `column`,
`arg`) are names of Python, by which dump_cases.py finds functions of either commit.

Prints a line for each case. Exit status: 0 if all are equal, 1 if any differs, 2 if they cannot be compared.
"""

from __future__ import annotations

import io
import json
import os
import pickle
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

import measure
from compare_dumps import Dump, Names, compare, count

HERE = Path(__file__).resolve().parent
# Variants that wake features which no shipped case has, or which meet others there : case -> new values of keys
VARIANTS: dict[str, list[dict]] = {
    "valve-closure": [{"numerics.pipe_model": "delay-line"}, {"numerics.method": "rk4"}],
    "streeter-nine-pipes": [{"numerics.pipe_model": "auto"}],
    "pump-trip": [
        {"numerics.pipe_model": "auto"},
        {"numerics.pipe_model": "auto", "numerics.method": "trapezoid"},
    ],
    "check-valve-slam": [{"numerics.pipe_model": "delay-line"}],
    "digital-pressure": [{"numerics.pipe_model": "delay-line"}],
    "three-way-junction": [{"numerics.pipe_model": "delay-line"}],
    "net3-pump-trip": [{"numerics.pipe_model": "auto"}],
    "relief-on-closed-main": [{"numerics.pipe_model": "delay-line"}],
    "surge-tank": [{"numerics.pipe_model": "auto"}],
    "pump-trip-air-vessel": [{"numerics.pipe_model": "delay-line"}],
    "tank-relay": [{"numerics.method": "rodas-5p"}],
    "chlorine": [{"numerics.scheme": "upwind"}],
    "cylinder-servo": [{"numerics.method": "tr-bdf2"}],
    "clutch": [{"numerics.method": "rodas-5p"}],
}
PARTS = ("fvsolve", "cases")  # folders of a commit that are extracted
TINY = "accumulator"  # the case of --quick
SHOWN = 3  # number of printed differences of a case


class Side:
    """Commit with its files and the process that dumps its cases."""

    def __init__(self, commit: str, folder: Path, written: Path, fresh: bool) -> None:
        self.commit, self.folder, self.tree = commit, folder, folder / "tree"
        extract(commit, self.tree)
        cache = {"FVSOLVE_CACHE": str(folder / "cache")} if fresh else {}
        known = {key: value for key, value in os.environ.items() if key != "FVSOLVE_PARTS"}
        known |= {
            "PYTHONPATH": str(self.tree),
            "MPLBACKEND": "Agg",
            "OPENBLAS_NUM_THREADS": "1",
        } | cache
        start = f"import sys; sys.path.append({str(HERE)!r}); import dump_cases; dump_cases.main()"
        self.command = [sys.executable, "-P", "-c", start, str(self.tree), str(written)]
        self.known, self.process, self.seconds = known, None, 0.0

    @property
    def cases(self) -> dict[str, Path]:
        """Shipped cases of the commit : name -> path."""
        return {path.stem: path for path in sorted((self.tree / "cases").glob("*.toml"))}

    def dump(self, name: str, changed: dict) -> Dump | str:
        """Dump of a case with new values of keys, or a text with the exit status if the process ended."""
        begun, out = time.perf_counter(), self.folder / "dump"
        if self.process is None:
            self.process = subprocess.Popen(
                self.command,
                env=self.known,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                stderr=open(self.folder / "errors", "w", encoding="utf-8"),
            )
        try:
            print(
                self.cases[name],
                out,
                json.dumps(changed),
                sep="\t",
                file=self.process.stdin,
                flush=True,
            )
            answer = self.process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        self.seconds = time.perf_counter() - begun
        if answer:
            return pickle.loads(out.read_bytes())
        code, self.process = self.process.wait(), None
        last = (
            (self.folder / "errors")
            .read_text(encoding="utf-8", errors="replace")
            .strip()
            .splitlines()[-1:]
        )
        return f"the process of {self.commit} ended with {code}: {' '.join(last)}"

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()


def extract(commit: str, tree: Path) -> None:
    """Extract the package and the cases of a commit."""
    packed = subprocess.run(
        ["git", "archive", commit, *PARTS], cwd=HERE.parent, capture_output=True, check=True
    )
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        archive.extractall(tree, filter="data")


def revision(name: str) -> str:
    """Short hash of a commit; raises ValueError if it is unknown."""
    command = ["git", "rev-parse", "--verify", "--quiet", "--short", f"{name}^{{commit}}"]
    found = subprocess.run(command, cwd=HERE.parent, capture_output=True, text=True)
    if found.returncode:
        raise ValueError(f"{name}: unknown commit")
    return found.stdout.strip()


def pairs(
    old: Side, new: Side, names: Names, asked: list[str]
) -> list[tuple[str | None, str | None]]:
    """Names of each case in both commits, None where a commit lacks the case.

    Raises ValueError if a given name is unknown.
    """
    unknown = [name for name in asked if name not in old.cases]
    if unknown:
        raise ValueError(
            f"{old.commit} has no case {', '.join(unknown)}; expected some of {', '.join(old.cases)}"
        )
    found = []
    for name in asked or old.cases:
        found.append(
            (name, next((one for (one,) in names.places((name,)) if one in new.cases), None))
        )
    left = set(new.cases) - {other for _, other in found}
    return found + ([] if asked else [(None, name) for name in sorted(left)])


def compared(old: Side, new: Side, names: Names, run: tuple) -> tuple[bool, str]:
    """True if a run is equal in both commits, and the line that reports the result.

    run : names of the case in both commits, None for a missing case, and new values of keys
    """
    name, other, changed = run
    for side, missing in ((old, name is None), (new, other is None)):
        if missing:
            return False, f"{name or other}: differs: {side.commit} has no such case"
    dumps = [old.dump(name, changed), new.dump(other, changed)]
    said = f"{name}" if name == other else f"{name} ({other})"
    said += "".join(f" {key} = {value}" for key, value in changed.items())
    ended = [one for one in dumps if isinstance(one, str)]
    if ended:
        return False, f"{said}: differs: {'; '.join(ended)}"
    found, took = compare(*dumps, names), f"{old.seconds:.1f} s and {new.seconds:.1f} s"
    if not found:
        fault = f", both {dumps[0]['fault',]}" if ("fault",) in dumps[0] else ""
        return (
            True,
            f"{said}: equal{fault}, {count(dumps[0])} values in {len(dumps[0])} places, {took}",
        )
    places = f"differs in {len(found)} of {len(dumps[0])} places, {took}: "
    return False, f"{said}: {places}{'; '.join(map(str, found[:SHOWN]))}"


def main() -> int:
    parser = measure.parser(__doc__)
    parser.add_argument("old", nargs="?", default="HEAD", help="old commit (default HEAD)")
    parser.add_argument("new", nargs="?", default="HEAD", help="new commit (default HEAD)")
    parser.add_argument(
        "--map", type=Path, help="file of renamed words: KIND, OLD and NEW name, separated by tabs"
    )
    parser.add_argument(
        "--cases", default="", help="names of cases of OLD, separated by commas (default all)"
    )
    given, begun = parser.parse_args(), time.perf_counter()
    if given.quick and not (HERE.parent / ".git").exists():
        print(f"there is no git repository: {measure.SKIPPED}")
        return 0
    asked = [name for name in given.cases.split(",") if name] or ([TINY] if given.quick else [])
    sides: list[Side] = []
    with tempfile.TemporaryDirectory(prefix="fvsolve-compare-") as folder:
        try:
            lines = given.map.read_text(encoding="utf-8").splitlines() if given.map else []
            names, written = Names(lines), Path(folder) / "names.tsv"
            written.write_text("\n".join(lines), encoding="utf-8")
            for commit, label in ((given.old, "old"), (given.new, "new")):
                (Path(folder) / label).mkdir()
                sides.append(Side(revision(commit), Path(folder) / label, written, not given.quick))
            cases = pairs(*sides, names, asked)
        except (ValueError, OSError) as error:
            print(error, file=sys.stderr)
            return 2
        runs = [
            (*pair, changed) for pair in cases for changed in ({}, *VARIANTS.get(pair[0] or "", []))
        ]
        print(
            f"{sides[0].commit} and {sides[1].commit}, {len(cases)} cases, {len(runs)} runs",
            flush=True,
        )
        equal = 0
        try:
            for run in runs:
                same, line = compared(*sides, names, run)
                equal += same
                print(line, flush=True)
        finally:
            for side in sides:
                side.close()
    if unused := names.unused():
        print(f"public names of the map that no case has: {', '.join(unused)}")
    print(f"{equal} of {len(runs)} runs are equal; {time.perf_counter() - begun:.0f} s")
    return 0 if equal == len(runs) else 1


if __name__ == "__main__":
    sys.exit(main())
