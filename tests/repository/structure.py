"""Measures of the structure of the package: size of a simple run, features in hubs, density of code, import circles.

python tests/repository/structure.py             measures, each with its value, limit and goal
python tests/repository/structure.py --matrix    words of each feature in each hub
python tests/repository/structure.py --circles   modules of each circle of imports
"""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import grimp
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

TOP = Path(__file__).parents[2]
PACKAGE = TOP / "fvsolve"


class Limit(NamedTuple):
    """Worst value of a measure that is allowed, its goal, and the greatest distance of a value from its limit.

    more_is_better : whether the measure shall rise
    """

    limit: float
    goal: float
    slack: float
    more_is_better: bool = False

    def improvement(self, value: float) -> float:
        """Distance of a value from the limit, positive on the better side."""
        return value - self.limit if self.more_is_better else self.limit - value


# A commit may only make a limit stricter. A weaker limit needs a line in docs/decisions.md.
# Goals are those of issue 61. Its values are those of 07b0f210: 215 files, 48 811 lines, 223 cells, 96 functions,
# 53 characters, 1 circle.
LIMITS = {
    "files imported by run valve-closure": Limit(limit=180, goal=130, slack=7),
    "lines of these files": Limit(limit=45_110, goal=35_000, slack=1500),
    "files of features among them": Limit(limit=0, goal=0, slack=0),
    "cells of the hub matrix": Limit(limit=155, goal=70, slack=6),
    "cells of the hub matrix, code alone": Limit(limit=115, goal=70, slack=6),
    "functions per 1000 code lines": Limit(limit=77.4, goal=75, slack=2),
    "characters of the mean code line": Limit(limit=43.5, goal=46, slack=1),
    "comment lines per 100 code lines of kernels and steppers": Limit(
        limit=5.7, goal=4, slack=0.2, more_is_better=True
    ),
    "circles of imports": Limit(limit=0, goal=0, slack=0),
}

# Files of the core that each stage of a run needs. A hub that moved or was divided is stated by its new paths.
HUBS = """
core/model/build.py core/model/model.py core/model/compiled_case.py core/model/jacobian_pattern.py
core/model/run_data.py core/model/energy_accounts.py core/model/energy_norm.py core/model/probe_tables.py
core/model/model_facts.py core/model/start_notices.py core/model/state_bounds.py core/assembly/model_draft.py
core/solve/run_loop.py core/solve/run_summary.py core/solve/run_checks.py core/solve/solve.py
core/solve/partition.py case/case.py case/load.py case/checks.py case/connections.py case/part_reading.py
case/probe.py core/output/fields.py core/kernels/rhs_assembly.py core/kernels/dtypes.py core/kernels/energy_rows.py
core/kernels/observation.py core/step_limits/growing_modes.py studies/resolution.py studies/linearise.py
studies/operating_point.py report/draw/scene.py core/run/plot_scene.py cli/printing.py
""".split()
# Feature -> regular expression for the names of its tables
FEATURES = {
    "bodies and mechanisms": r"bodies|freedoms|points|pins|bushings|lines|moving_segments",
    "masses on an axis": r"masses|braces|stops|pistons",
    "basins": r"basins|patches|walls",
    "delay lines": r"delays|past|jumps",
    "controls": r"controls|driven|discrete",
    "networks of other domains": r"network(?:_inputs|_switches|_elements|_rates)?",
    "scalars and reactions": r"scalars|reactions|exchangers",
    "columns": r"columns",
    "devices": r"devices",
    "pipes": r"pipes",
}
DECISION = re.compile(r"^- \d{4}-\d\d-\d\d, (.+), [\d.]+ to ([\d.]+): \S+ .+$", re.MULTILINE)
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
RUN = """
import json, os, sys
from fvsolve.cli import main
sys.argv = ["fvsolve", "run", "valve-closure", "--out", sys.argv[1]]
try:
    status = main()
except SystemExit as end:
    status = end.code
names = [name for name in sys.modules if name.split(".")[0] == "fvsolve"]
files = [file for name in names if (file := getattr(sys.modules[name], "__file__", None))]
print(json.dumps([status or 0, "numba" in sys.modules, sorted(files)]))
"""


class Density(NamedTuple):
    """Counts of a text of Python: functions, code lines with their characters, comments on lines of their own.

    A code line is not blank, not in a docstring, and contains more than a comment. Its characters include its leading
    blanks.
    """

    functions: int
    lines: int
    characters: int
    comments: int


def docstrings(nodes: list[ast.AST]) -> set[int]:
    """Numbers of the lines of all docstrings."""
    found: set[int] = set()
    for node in nodes:
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            found |= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return found


def density_of(source: str) -> Density:
    """Counts of a text."""
    nodes = [*ast.walk(ast.parse(source))]
    documented = docstrings(nodes)
    texts: set[int] = set()  # lines that continue a text, where # begins no comment
    functions = 0
    for node in nodes:
        if isinstance(node, (ast.Constant, ast.JoinedStr)) and node.end_lineno > node.lineno:
            texts |= set(range(node.lineno + 1, node.end_lineno + 1))
        functions += isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    lines = characters = comments = 0
    for number, line in enumerate(source.split("\n"), 1):
        if not line.strip() or number in documented:
            continue
        if line.lstrip().startswith("#") and number not in texts:
            comments += 1
        else:
            lines += 1
            characters += len(line)
    return Density(functions, lines, characters, comments)


@cache
def density_of_file(path: Path) -> Density:
    """Counts of a file."""
    return density_of(path.read_text(encoding="utf8"))


def density(*folders: Path) -> Density:
    """Sums of the counts of all files below folders."""
    files = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    return Density(*map(sum, zip(*map(density_of_file, files), strict=True)))


def functions_per_1000_lines(*folders: Path) -> float:
    """Functions, methods and inner functions per 1000 code lines."""
    counts = density(*folders)
    return 1000.0 * counts.functions / counts.lines


def mean_line(*folders: Path) -> float:
    """Characters of the mean code line, with its leading blanks and without its end."""
    counts = density(*folders)
    return counts.characters / counts.lines


def comments_per_100_lines(*folders: Path) -> float:
    """Comments on lines of their own per 100 code lines.

    0.6 in issue 61 is the value of the whole package; kernels and steppers had 1.0.
    """
    counts = density(*folders)
    return 100.0 * counts.comments / counts.lines


@cache
def imported_files() -> tuple[str, ...]:
    """Paths below the package of the files that `fvsolve run valve-closure` imports, where its code is compiled.

    Imports of the process of the command are counted, without those of the processes that compile and draw.
    """
    for _ in range(2):  # the first run compiles where the cache is cold, which imports more
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", RUN, f"{folder}/run"]
            done = subprocess.run(command, cwd=TOP, capture_output=True, text=True, check=True)
        status, compiled, files = json.loads(done.stdout.splitlines()[-1])
        if status:
            raise RuntimeError(
                f"fvsolve run valve-closure ended with exit status {status}: {done.stderr}"
            )
        if not compiled:
            break
    return tuple(sorted(Path(file).relative_to(PACKAGE).as_posix() for file in files))


def lines_of(root: Path, files: tuple[str, ...]) -> int:
    """Lines of files below a folder."""
    return sum((root / file).read_text(encoding="utf8").count("\n") for file in files)


def in_features(files: tuple[str, ...]) -> int:
    """Number of files in the folder `features`."""
    return sum(file.startswith("features/") for file in files)


def without_comments(source: str) -> str:
    """Text of Python without comments and docstrings."""
    lines = source.split("\n")
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column]
    for number in docstrings([*ast.walk(ast.parse(source))]):
        lines[number - 1] = ""
    return "\n".join(lines)


def words_in(source: str) -> dict[str, Counter[str]]:
    """Words of each feature in a text, with their numbers; features without a word are left out."""
    found = {
        name: Counter(re.findall(rf"\b(?:{words})\b", source)) for name, words in FEATURES.items()
    }
    return {name: words for name, words in found.items() if words}


def hub_matrix(
    root: Path, hubs: list[str], code_alone: bool = False
) -> dict[tuple[str, str], Counter[str]]:
    """Cells of the hub matrix that are not empty: (hub, feature) -> words with their numbers.

    Words are counted in the whole text, as in the count of issue 61, or without comments and docstrings.
    """
    missing = [hub for hub in hubs if not (root / hub).is_file()]
    if missing:
        raise FileNotFoundError(
            f"{', '.join(missing)}: unknown hub. If it moved, update HUBS in {Path(__file__).name}"
        )
    matrix = {}
    for hub in hubs:
        source = (root / hub).read_text(encoding="utf8")
        found = words_in(without_comments(source) if code_alone else source)
        matrix |= {(hub, feature): words for feature, words in found.items()}
    return matrix


@cache
def imports(package: str) -> dict[str, set[str]]:
    """Modules that each module of a package imports.

    Imports for type checks and imports in functions are included: without those for type checks 07b0f210 has no
    circle, with them the one of issue 61.
    """
    graph = grimp.build_graph(package, exclude_type_checking_imports=False, cache_dir=None)
    return {
        module: graph.find_modules_directly_imported_by(module) for module in sorted(graph.modules)
    }


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Circles of imports: strongly connected sets of more than one module."""
    modules = list(arrows)
    number = {module: k for k, module in enumerate(modules)}
    pairs = [
        (number[module], number[other]) for module, others in arrows.items() for other in others
    ]
    begin, end = np.array(pairs, dtype=int).reshape(-1, 2).T
    graph = csr_array((np.ones(len(pairs)), (begin, end)), shape=(len(modules), len(modules)))
    _, labels = connected_components(graph, directed=True, connection="strong")
    sets = [
        [module for module in modules if labels[number[module]] == k]
        for k in range(labels.max() + 1)
    ]
    return [members for members in sets if len(members) > 1]


MEASURES: dict[str, Callable[[], float]] = {
    "files imported by run valve-closure": lambda: len(imported_files()),
    "lines of these files": lambda: lines_of(PACKAGE, imported_files()),
    "files of features among them": lambda: in_features(imported_files()),
    "cells of the hub matrix": lambda: len(hub_matrix(PACKAGE, HUBS)),
    "cells of the hub matrix, code alone": lambda: len(hub_matrix(PACKAGE, HUBS, code_alone=True)),
    "functions per 1000 code lines": lambda: functions_per_1000_lines(PACKAGE),
    "characters of the mean code line": lambda: mean_line(PACKAGE),
    "comment lines per 100 code lines of kernels and steppers": lambda: comments_per_100_lines(
        PACKAGE / "core" / "kernels", PACKAGE / "core" / "steppers"
    ),
    "circles of imports": lambda: len(circles(imports("fvsolve"))),
}


def fault_of(value: float, limit: Limit) -> str:
    """Fault of a value that passes its limit, or that is far better than its limit; "" without a fault."""
    better = limit.improvement(value)
    if better < 0:
        return f"{value:.5g} is worse than the limit {limit.limit:g}. Improve it, or see docs/decisions.md"
    if better > limit.slack:
        return f"{value:.5g} is better than the limit {limit.limit:g}. Move the limit to it"
    return ""


def limits_in(source: str) -> dict[str, Limit]:
    """Limits that a text of this module states."""
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == "LIMITS":
            return {
                key.value: Limit(
                    **{word.arg: ast.literal_eval(word.value) for word in call.keywords}
                )
                for key, call in zip(node.value.keys, node.value.values, strict=True)
            }
    return {}


def weakened(before: dict[str, Limit], now: dict[str, Limit]) -> dict[str, float]:
    """Limits that were made weaker: measure -> present limit."""
    return {
        name: limit.limit
        for name, limit in now.items()
        if name in before and limit.improvement(before[name].limit) > 0
    }


def decisions_in(page: str) -> dict[str, float]:
    """Limits in the lines of docs/decisions.md: measure -> its last limit."""
    return {name: float(limit) for name, limit in DECISION.findall(page)}


def shown(value: float) -> str:
    """Number of a table: counts as integers, others with one digit after the point."""
    return f"{value:.0f}" if value == int(value) else f"{value:.1f}"


def table() -> str:
    """Table of all measures with value, limit and goal."""
    rows = [("measure", "value", "limit", "goal")]
    for name, measure in MEASURES.items():
        rows.append((name, shown(measure()), shown(LIMITS[name].limit), shown(LIMITS[name].goal)))
    width = max(len(row[0]) for row in rows)
    return "\n".join(
        f"{name:{width}}" + "".join(f"{text:>8}" for text in texts) for name, *texts in rows
    )


def matrix_text() -> str:
    """Words of each feature in each hub, with their numbers in the text and in its code alone."""
    lines = []
    code = hub_matrix(PACKAGE, HUBS, code_alone=True)
    for (hub, feature), words in hub_matrix(PACKAGE, HUBS).items():
        own = code.get((hub, feature), Counter())
        texts = [f"{word} {count} ({own[word]} in code)" for word, count in sorted(words.items())]
        lines.append(f"{hub:30}{feature:27}{', '.join(texts)}")
    return "\n".join(lines)


if __name__ == "__main__":
    if "--matrix" in sys.argv:
        print(matrix_text())
    elif "--circles" in sys.argv:
        print("\n".join(" -> ".join(members) for members in circles(imports("fvsolve"))))
    else:
        print(table())
