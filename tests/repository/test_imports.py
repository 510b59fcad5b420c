"""Import rules: no module imports itself through others, and files of parts and basins import only allowed folders."""

from __future__ import annotations

import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

import fvsolve

FLOORS = {  # folder -> role -> folders that a file of this role may import besides files of its own role
    "parts": {
        "part": {"parts", "units", "errors", "names", "data", "steppers", "attitude"},
        "law": {"kernels", "jit"},
        "lower": {"parts", "model", "steady", "kernels", "errors", "units", "fluid", "schemes", "attitude"},
    },
    "basins": {
        "part": {"parts", "units", "errors"},
        "law": {"kernels", "jit"},
        "lower": {"basins", "parts", "case", "model", "kernels", "errors", "fluid", "mesh", "schemes", "steppers"},
    },
}


def circle(arrows: dict[str, set[str]]) -> list[str]:
    """Modules of a circle of imports, or an empty list."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_imports_run_in_no_circle():
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    found = circle({module: graph.find_modules_directly_imported_by(module) for module in graph.modules})
    assert not found, " -> ".join(found)


@pytest.mark.parametrize(
    "arrows, found", [({"a": {"b"}, "b": {"c"}, "c": {"a"}}, 4), ({"a": {"b", "c"}, "b": {"c"}}, 0)]
)
def test_a_circle_is_seen(arrows, found):
    assert len(circle(arrows)) == found


def role(module: str) -> tuple[str, str] | None:
    """Folder and role of a file of a part or a basin; None for other files.

    Without a prefix of a role, a file of a part declares it and a file of a basin is compiled.
    """
    _, room, *names = module.split(".") + [""]
    if room not in FLOORS or len(names) < (3 if room == "parts" else 2):
        return None
    file = names[-2]
    other = "part" if room == "parts" else "law"
    return room, next((one for one in ("part", "law", "lower") if file.startswith(one)), other)


def test_each_file_of_a_part_or_a_basin_imports_what_its_floor_may():
    """A declaration imports no compiled function, a law no declaration, and neither of them a lowering."""
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    seen = set()
    for module in sorted(graph.modules):
        if (own := role(module)) is None:
            continue
        seen.add(own)
        for other in graph.find_modules_directly_imported_by(module):
            theirs = role(other)
            assert theirs == own or other.split(".")[1] in FLOORS[own[0]][own[1]], f"{module} imports {other}"
            if own[1] != "lower":
                assert theirs is None or theirs[1] == own[1], f"{module} imports {other}"
    assert seen == {(room, one) for room, roles in FLOORS.items() for one in roles}


def test_parts_are_declared_without_numba():
    code = "import sys, fvsolve.parts; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize("room", FLOORS)
def test_every_folder_of_parts_and_basins_has_a_declaration(room):
    folders = [path for path in (Path(fvsolve.__file__).parent / room).iterdir() if (path / "__init__.py").is_file()]
    assert folders and all((folder / "part.py").is_file() for folder in folders)
