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
# folder -> (lines, files), with its subfolders
FOLDERS: dict[str, tuple[int, int]] = {
    "fvsolve": (2014, 11),
    "tests": (915, 7),
    "benchmarks": (6146, 47),
    "fvsolve/assembly": (1562, 11),
    "fvsolve/basins": (9705, 69),
    "fvsolve/case": (6475, 35),
    "fvsolve/cli": (3978, 25),
    "fvsolve/draw": (2988, 27),
    "fvsolve/epanet": (798, 6),
    "fvsolve/exact": (1260, 10),
    "fvsolve/fluid": (1026, 7),
    "fvsolve/kernels": (15164, 92),
    "fvsolve/mesh": (1236, 11),
    "fvsolve/model": (6120, 23),
    "fvsolve/output": (1688, 15),
    "fvsolve/parts": (12370, 94),
    "fvsolve/report": (2381, 20),
    "fvsolve/run": (1784, 12),
    "fvsolve/solve": (2378, 13),
    "fvsolve/step_limits": (1684, 12),
    "fvsolve/steppers": (7043, 49),
    "fvsolve/studies": (14539, 83),
    "fvsolve/units": (525, 3),
    "tests/attitude": (468, 4),
    "tests/basins": (6824, 24),
    "tests/case": (3746, 16),
    "tests/cli": (1073, 7),
    "tests/draw": (231, 3),
    "tests/epanet": (439, 1),
    "tests/exact": (411, 1),
    "tests/fluid": (1085, 5),
    "tests/invariance": (2040, 12),
    "tests/kernels": (1298, 11),
    "tests/mesh": (431, 3),
    "tests/model": (2854, 14),
    "tests/output": (549, 4),
    "tests/parts": (11035, 44),
    "tests/reference": (3286, 42),
    "tests/report": (888, 7),
    "tests/repository": (2609, 25),
    "tests/schemes": (264, 2),
    "tests/solve": (1840, 10),
    "tests/step_limits": (1038, 5),
    "tests/steppers": (2076, 13),
    "tests/studies": (7763, 42),
    "tests/units": (242, 1),
}
# functions that exceed a limit: "path: function" -> (arguments, lines). Commands and studies are excepted by rule.
LONG: dict[str, tuple[int, int]] = {
    "fvsolve/basins/advection.py: grid_advection": (16, 20),
    "fvsolve/basins/advection.py: add_fifth_order": (16, 21),
    "fvsolve/basins/advection_faces.py: advection_rates": (14, 83),
    "fvsolve/basins/diffusion.py: grid_diffusion": (15, 44),
    "fvsolve/basins/flux_correction.py: row_fractions": (19, 15),
    "fvsolve/basins/flux_correction.py: limit_excesses": (16, 25),
    "fvsolve/basins/frame_reaction.py: row_sums": (13, 22),
    "fvsolve/basins/free_surface/bed_friction.py: damp_flows": (14, 23),
    "fvsolve/basins/free_surface/surface_cell_rates.py: by_blocks": (15, 29),
    "fvsolve/basins/free_surface/surface_fifth_order.py: put_push": (16, 11),
    "fvsolve/basins/free_surface/surface_grid.py: put_row": (17, 42),
    "fvsolve/basins/free_surface/surface_grid.py: grid_rates": (22, 33),
    "fvsolve/basins/free_surface/surface_grid.py: column_rates": (25, 121),
    "fvsolve/basins/free_surface/surface_mesh.py: shallow_rates": (17, 103),
    "fvsolve/basins/grid_scalars.py: by_blocks": (15, 23),
    "fvsolve/basins/liquid/grid_linear.py: grid_rates": (20, 50),
    "fvsolve/basins/liquid/grid_linear.py: row_rates": (23, 127),
    "fvsolve/basins/liquid/grid_nonlinear.py: grid_rates": (23, 153),
    "fvsolve/basins/liquid/liquid_cell_rates.py: by_blocks": (14, 28),
    "fvsolve/basins/liquid/liquid_mesh.py: put_ghosts": (17, 21),
    "fvsolve/basins/liquid/liquid_mesh.py: put_reflections": (14, 15),
    "fvsolve/basins/liquid/liquid_mesh.py: add_side_nonlinear": (13, 36),
    "fvsolve/basins/liquid/liquid_mesh.py: liquid_rates": (19, 111),
    "fvsolve/basins/liquid/moving_wall_waves.py: add_column_rates": (13, 11),
    "fvsolve/basins/second_order.py: north_values_and_rates_limited": (15, 7),
    "fvsolve/basins/second_order.py: north_values_and_rates": (16, 17),
    "fvsolve/basins/second_order.py: second_order_rates": (17, 33),
    "fvsolve/case/check.py: network": (1, 63),
    "fvsolve/case/load.py: case": (1, 106),
    "fvsolve/kernels/barotropic_nodes.py: assemble_barotropic": (14, 25),
    "fvsolve/kernels/node_clusters.py: assemble": (13, 32),
    "fvsolve/solve/run_loop.py: __init__": (5, 74),
    "fvsolve/steppers/differences.py: differences": (13, 34),
    "fvsolve/steppers/dirk.py: solve_stage": (18, 31),
    "fvsolve/steppers/dirk.py: try_stages": (21, 48),
    "fvsolve/steppers/dirk.py: attempt": (27, 42),
    "fvsolve/steppers/erk.py: attempt": (27, 50),
    "fvsolve/steppers/event_location.py: locate": (31, 46),
    "fvsolve/steppers/irk.py: iterate": (20, 63),
    "fvsolve/steppers/irk.py: filtered_error": (18, 50),
    "fvsolve/steppers/irk.py: defect_before_end": (17, 55),
    "fvsolve/steppers/irk.py: attempt": (27, 83),
    "fvsolve/steppers/newton.py: renew": (14, 12),
    "fvsolve/steppers/newton.py: damped_newton": (20, 69),
    "fvsolve/steppers/newton.py: solve_stage_from_start": (21, 37),
    "fvsolve/steppers/newton.py: smoothed_error": (21, 45),
    "fvsolve/steppers/output_rows.py: separate_step": (27, 33),
    "fvsolve/steppers/output_rows.py: emit": (38, 51),
    "fvsolve/steppers/ros.py: attempt": (27, 61),
    "fvsolve/steppers/semi_implicit.py: attempt": (27, 29),
    "fvsolve/steppers/stage_sweeps.py: sweep": (23, 57),
    "fvsolve/steppers/time_loop.py: run_steps": (49, 237),
    "fvsolve/steppers/time_loop.py: run_steps_at": (39, 18),
    "fvsolve/steppers/time_loop.py: attempt_with": (22, 14),
}
# folders whose functions may be longer: commands, with an argument for each option, and studies
EXCEPTED = ("fvsolve/cli/", "fvsolve/studies/")


def folders() -> list[str]:
    """Folders of the package and of the tests, and modules of the package beside its folders as "fvsolve"."""
    inside = [f"{top}/{path.name}" for top in ("fvsolve", "tests") for path in sorted((TOP / top).iterdir())
              if path.is_dir() and any(path.rglob("*.py"))]  # fmt: skip
    return ["fvsolve", "tests", "benchmarks", *inside]


def files_of(folder: str) -> list[Path]:
    """Python files of a folder of `folders`; of the package and the tests only those in no subfolder."""
    alone = folder in ("fvsolve", "tests")
    return sorted((TOP / folder).glob("*.py") if alone else (TOP / folder).rglob("*.py"))


def size_of(paths: list[Path]) -> tuple[int, int]:
    """Number of lines and of files."""
    return sum(path.read_text(encoding="utf8").count("\n") for path in paths), len(paths)


def long_functions(source: str) -> dict[str, tuple[int, int]]:
    """Functions of a text of Python that exceed a limit : name -> (arguments, lines with docstring)."""
    found = {}
    for node in ast.walk(ast.parse(source)):
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
def test_a_long_function_is_found(source, found):
    assert long_functions(source) == found


if __name__ == "__main__":
    for entry in folders():
        print(f'    "{entry}": {size_of(files_of(entry))},')
