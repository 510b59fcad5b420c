"""Size limits of the repository: lines and files of each folder, arguments and lines of functions.

Limits only fall. A test fails if a folder grows beyond its limit, and also if it has shrunk far below: then lower the
limit. `python tests/repository/test_size.py` prints the present sizes in the form of `FOLDERS`.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
SLACK = 0.03  # greatest unused share of a limit
MAX_ARGUMENTS = 12
MAX_LINES = 60
BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")  # fields of statements that hold statements
# folder -> (lines, files), with its subfolders. Raised for issue 60 (real network files): reader by EPANET's toolkit,
# comparison after the import, export, valves that act at once and sparse clusters, parts without supply, causes of
# starts without solution, energy of pumps, hydrants, tables of air valves, water age and tracing, the table of files,
# links by a curve of losses (GPV and PBV of EPANET over a day), search for events beside jumps, hidden stiffness,
# rules in windows of time, sums of schedules, pumps that follow a pattern, leaks behind empty tanks, links that rest
# between switches, events located by secants, one Newton step for each difference of the Jacobian. Raised for issue 61:
# the protocol of features and their folder (assembly, features, compile), variants in comparisons of commits.
# Raised for issue 61 (features in folders): measures of the structure and their tests, bounds of formulas without a
# circle of imports.
# Index of declarations; commands, exact solutions, sinks and studies of other packages, with the page that shows them.
# Comments that say why in kernels and steppers.
DIVIDED = "fvsolve", "fvsolve/core", "fvsolve/exchange", "tests"  # folders whose subfolders have limits of their own
FOLDERS: dict[str, tuple[int, int]] = {
    "fvsolve": (1605, 12),
    "tests": (1269, 9),
    "benchmarks": (9597, 64),
    "fvsolve/case": (8414, 30),
    "fvsolve/cli": (3753, 19),
    "fvsolve/compile": (1593, 9),
    "fvsolve/core": (752, 3),
    "fvsolve/data": (12, 1),
    "fvsolve/exact": (1482, 7),
    "fvsolve/exchange": (1, 1),
    "fvsolve/features": (30063, 172),
    "fvsolve/parts": (19944, 134),
    "fvsolve/report": (4973, 21),
    "fvsolve/studies": (17428, 67),
    "fvsolve/core/assembly": (2484, 10),
    "fvsolve/core/fluid": (1087, 4),
    "fvsolve/core/kernels": (10429, 49),
    "fvsolve/core/mesh": (1512, 6),
    "fvsolve/core/model": (4071, 18),
    "fvsolve/core/output": (2874, 15),
    "fvsolve/core/run": (1634, 7),
    "fvsolve/core/solve": (3052, 12),
    "fvsolve/core/step_limits": (1690, 7),
    "fvsolve/core/steppers": (8221, 35),
    "fvsolve/exchange/epanet": (3775, 12),
    "fvsolve/exchange/fmi": (440, 5),
    "tests/attitude": (449, 2),
    "tests/basins": (10481, 37),
    "tests/case": (4424, 16),
    "tests/cli": (1351, 10),
    "tests/draw": (232, 2),
    "tests/epanet": (1877, 6),
    "tests/exact": (571, 3),
    "tests/features": (1057, 4),
    "tests/fluid": (1063, 4),
    "tests/fmi": (396, 2),
    "tests/invariance": (2283, 13),
    "tests/kernels": (1356, 8),
    "tests/mesh": (560, 2),
    "tests/model": (2412, 11),
    "tests/output": (898, 4),
    "tests/parts": (19415, 52),
    "tests/reference": (5646, 66),
    "tests/report": (865, 4),
    "tests/repository": (5809, 32),
    "tests/schemes": (570, 2),
    "tests/solve": (2816, 14),
    "tests/step_limits": (1039, 4),
    "tests/steppers": (2905, 17),
    "tests/studies": (9031, 27),
    "tests/units": (359, 1),
    "tests/validation": (319, 1),
}
# functions that exceed a limit: "path: function" -> (arguments, lines). Commands and studies are excepted by rule.
LONG: dict[str, tuple[int, int]] = {}
# folders whose functions may be longer: commands, with an argument for each option, and studies
EXCEPTED = ("fvsolve/cli/", "fvsolve/studies/")


def folders() -> list[str]:
    """Folders of the package and of the tests, and modules of the package beside its folders as "fvsolve"."""
    inside = [f"{top}/{path.name}" for top in DIVIDED for path in sorted((TOP / top).iterdir())
              if path.is_dir() and any(path.rglob("*.py"))]  # fmt: skip
    return list(dict.fromkeys(["fvsolve", "tests", "benchmarks", *inside]))


def files_of(folder: str) -> list[Path]:
    """Python files of a folder of `folders`; of a divided folder only those in no subfolder."""
    alone = folder in DIVIDED
    return sorted((TOP / folder).glob("*.py") if alone else (TOP / folder).rglob("*.py"))


def size_of(paths: list[Path]) -> tuple[int, int]:
    """Number of lines and of files."""
    return sum(path.read_text(encoding="utf8").count("\n") for path in paths), len(paths)


def long_functions(source: str) -> dict[str, tuple[int, int]]:
    """Functions of a text of Python that exceed a limit : name -> (arguments, lines with docstring)."""
    found = {}
    nodes: list[ast.AST] = [ast.parse(source)]
    for node in nodes:  # statements, which grow in the loop; expressions contain no function with a name
        nodes += [one for part in BLOCKS for one in getattr(node, part, ())]
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            own = node.args
            size = len(own.posonlyargs) + len(own.args) + len(own.kwonlyargs), node.end_lineno - node.lineno + 1
            if size[0] > MAX_ARGUMENTS or size[1] > MAX_LINES:
                found[node.name] = size
    return found


@pytest.mark.parametrize("folder", folders())
def test_a_folder_is_within_its_limits(folder):
    assert folder in FOLDERS, f"{folder} has no limits; expected an entry in FOLDERS"
    for size, limit, what in zip(size_of(files_of(folder)), FOLDERS[folder], ("lines", "files"), strict=True):
        assert size <= limit, f"{folder} has {size} {what}, more than {limit}. Delete or unify code, or raise the limit"
        assert size >= limit - max(1, SLACK * limit), f"{folder} has {size} {what}; lower the limit from {limit}"


def test_limits_are_for_folders_that_exist():
    assert set(FOLDERS) == set(folders())


def test_functions_are_short_and_have_few_arguments():
    found = {}
    for path in sorted((TOP / "fvsolve").rglob("*.py")):
        place = path.relative_to(TOP).as_posix()
        if not place.startswith(EXCEPTED):
            found |= {f"{place}: {name}": size for name, size in long_functions(path.read_text("utf8")).items()}
    new = {place: size for place, size in found.items() if place not in LONG or max(
        own - limit for own, limit in zip(size, LONG[place], strict=True)) > 0}  # fmt: skip
    assert not new, f"more than {MAX_ARGUMENTS} arguments or {MAX_LINES} lines: {new}"
    assert not (LONG.keys() - found.keys()), "these functions are short now; remove their entries"


@pytest.mark.parametrize(
    "source, found",
    [
        ("def f(a, b):\n    pass\n", {}),
        (f"def f({', '.join(f'a{i}' for i in range(13))}):\n    pass\n", {"f": (13, 2)}),
        (f"class A:\n    def g(self, *, {', '.join(f'a{i}' for i in range(12))}):\n        pass\n", {"g": (13, 2)}),
        ("def h():\n" + "    x = 1\n" * 60, {"h": (0, 61)}),
    ],
)
def test_a_long_function_is_detected(source, found):
    assert long_functions(source) == found


if __name__ == "__main__":
    for entry in folders():
        print(f'    "{entry}": {size_of(files_of(entry))},')
