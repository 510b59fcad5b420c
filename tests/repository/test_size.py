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
# 60 until 2026-11-30: the same functions have up to a fifth more lines since code is broken at 100 characters
MAX_LINES = 72
# fields of statements that hold statements
BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")
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
# Raised for issue 61 (let it breathe): code is broken at 100 characters, and each assignment has a line of its own.
# Blocks of controls of other packages: their faults, a page with its test, and lines of blocks in `check`.
# Density laws of other packages; messages about faults in parts of other packages, and a page of a part with a state;
# tables of basins and scalars in their features; tests of the Riemann solver.
# folders whose subfolders have limits of their own
DIVIDED = "fvsolve", "fvsolve/core", "fvsolve/exchange", "tests"
FOLDERS: dict[str, tuple[int, int]] = {
    "fvsolve": (1823, 12),
    "tests": (1524, 9),
    "benchmarks": (11696, 64),
    "fvsolve/case": (10809, 33),
    "fvsolve/cli": (5339, 21),
    "fvsolve/compile": (1760, 9),
    "fvsolve/core": (874, 3),
    "fvsolve/data": (12, 1),
    "fvsolve/exact": (1736, 7),
    "fvsolve/exchange": (1, 1),
    "fvsolve/features": (35969, 181),
    "fvsolve/parts": (25885, 141),
    "fvsolve/report": (9251, 37),
    "fvsolve/studies": (20732, 67),
    "fvsolve/core/assembly": (2929, 11),
    "fvsolve/core/fluid": (1338, 6),
    "fvsolve/core/kernels": (11595, 49),
    "fvsolve/core/mesh": (2082, 8),
    "fvsolve/core/model": (4803, 19),
    "fvsolve/core/output": (3634, 17),
    "fvsolve/core/run": (1977, 7),
    "fvsolve/core/solve": (3588, 12),
    "fvsolve/core/step_limits": (1907, 7),
    "fvsolve/core/steppers": (9339, 35),
    "fvsolve/exchange/epanet": (4535, 12),
    "fvsolve/exchange/fmi": (510, 5),
    "tests/attitude": (480, 2),
    "tests/basins": (14218, 41),
    "tests/case": (6042, 18),
    "tests/cli": (1820, 12),
    "tests/draw": (287, 2),
    "tests/epanet": (2269, 6),
    "tests/exact": (721, 3),
    "tests/features": (1418, 4),
    "tests/fluid": (1544, 5),
    "tests/fmi": (453, 2),
    "tests/invariance": (3037, 13),
    "tests/kernels": (1775, 9),
    "tests/mesh": (828, 3),
    "tests/model": (3130, 11),
    "tests/output": (1328, 5),
    "tests/parts": (27481, 61),
    "tests/reference": (7926, 72),
    "tests/report": (2212, 12),
    "tests/repository": (7426, 34),
    "tests/schemes": (669, 2),
    "tests/solve": (3772, 14),
    "tests/step_limits": (1314, 4),
    "tests/steppers": (3387, 17),
    "tests/studies": (11298, 27),
    "tests/units": (453, 1),
    "tests/validation": (376, 1),
    "fvsolve/exchange/gis": (731, 4),
    "tests/gis": (790, 3),
}
# functions that exceed a limit: "path: function" -> (arguments, lines). Commands and studies are excepted by rule.
LONG: dict[str, tuple[int, int]] = {
    # one row a step: the order in which tables of a case are read; arrays of a run
    "fvsolve/case/load.py: _read_all": (2, 87),
    "fvsolve/core/solve/run_loop.py: __init__": (5, 80),
    # one search with twelve numbers that change in each turn
    "fvsolve/core/steppers/time_loop.py: locate": (7, 86),
    # kernels whose rows are not to be passed once more
    "fvsolve/features/basins/free_surface/surface_grid.py: put_fluxes_along": (8, 75),
    "fvsolve/features/delay_lines/kernels/line_envelopes.py: update_stretch_extremes": (9, 75),
}
# folders whose functions may be longer: commands, with an argument for each option, and studies
EXCEPTED = ("fvsolve/cli/", "fvsolve/studies/")


def folders() -> list[str]:
    """Folders of the package and of the tests, and modules of the package beside its folders as "fvsolve"."""
    inside = [
        f"{top}/{path.name}"
        for top in DIVIDED
        for path in sorted((TOP / top).iterdir())
        if path.is_dir() and any(path.rglob("*.py"))
    ]
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
    # statements, which grow in the loop; expressions contain no function with a name
    for node in nodes:
        nodes += [one for part in BLOCKS for one in getattr(node, part, ())]
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            own = node.args
            size = (
                len(own.posonlyargs) + len(own.args) + len(own.kwonlyargs),
                node.end_lineno - node.lineno + 1,
            )
            if size[0] > MAX_ARGUMENTS or size[1] > MAX_LINES:
                found[node.name] = size
    return found


@pytest.mark.parametrize("folder", folders())
def test_a_folder_is_within_its_limits(folder):
    assert folder in FOLDERS, f"{folder} has no limits; expected an entry in FOLDERS"
    for size, limit, what in zip(
        size_of(files_of(folder)), FOLDERS[folder], ("lines", "files"), strict=True
    ):
        assert size <= limit, (
            f"{folder} has {size} {what}, more than {limit}. Delete or unify code, or raise the limit"
        )
        assert size >= limit - max(1, SLACK * limit), (
            f"{folder} has {size} {what}; lower the limit from {limit}"
        )


def test_limits_are_for_folders_that_exist():
    assert set(FOLDERS) == set(folders())


def test_functions_are_short_and_have_few_arguments():
    found = {}
    for path in sorted((TOP / "fvsolve").rglob("*.py")):
        place = path.relative_to(TOP).as_posix()
        if not place.startswith(EXCEPTED):
            found |= {
                f"{place}: {name}": size
                for name, size in long_functions(path.read_text("utf8")).items()
            }
    new = {
        place: size
        for place, size in found.items()
        if place not in LONG
        or max(own - limit for own, limit in zip(size, LONG[place], strict=True)) > 0
    }
    assert not new, f"more than {MAX_ARGUMENTS} arguments or {MAX_LINES} lines: {new}"
    assert not (LONG.keys() - found.keys()), "these functions are short now; remove their entries"


@pytest.mark.parametrize(
    "source, found",
    [
        ("def f(a, b):\n    pass\n", {}),
        (f"def f({', '.join(f'a{i}' for i in range(13))}):\n    pass\n", {"f": (13, 2)}),
        (
            f"class A:\n    def g(self, *, {', '.join(f'a{i}' for i in range(12))}):\n        pass\n",
            {"g": (13, 2)},
        ),
        ("def h():\n" + "    x = 1\n" * MAX_LINES, {"h": (0, MAX_LINES + 1)}),
    ],
)
def test_a_long_function_is_detected(source, found):
    assert long_functions(source) == found


if __name__ == "__main__":
    for entry in folders():
        print(f'    "{entry}": {size_of(files_of(entry))},')
