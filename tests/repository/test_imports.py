"""Import rules: no cycle, and compiled files of parts and basins import compiled code only."""

import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

import fvsolve


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


def is_compiled(module: str) -> bool:
    """True for a law of a part, and for a file of a basin that is neither a declaration nor a lowering."""
    _, folder, *names = module.split(".")
    if folder == "parts":
        return len(names) == 2 and names[1].startswith("law")
    return folder == "basins" and len(names) > 0 and not names[-1].startswith(("part", "lower"))


def test_compiled_files_of_parts_and_basins_import_compiled_code_only():
    """The cache of compiled code is keyed by these sources, so nothing else may influence them."""
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    compiled = [module for module in sorted(graph.modules) if module.count(".") > 1 and is_compiled(module)]
    assert {module.split(".")[1] for module in compiled} == {"parts", "basins"}
    for module in compiled:
        for other in graph.find_modules_directly_imported_by(module):
            assert is_compiled(other) or other.split(".")[1] in ("kernels", "jit"), f"{module} imports {other}"


@pytest.mark.parametrize("folder", ["parts", "features/basins"])
def test_declarations_import_no_lowering(folder):
    """A `part.py` beside a compiled law states keys only, so that a schema needs no tables and no compiled law."""
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    declared = [
        module for module in graph.modules if module.startswith(f"fvsolve.{folder}.") and module.endswith(".part")
    ]
    assert declared
    for module in declared:
        for other in graph.find_modules_directly_imported_by(module):
            assert not is_compiled(other) and ".lower" not in other, f"{module} imports {other}"


def test_parts_are_declared_without_numba():
    code = "import sys, fvsolve.parts; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize("folder", ["parts", "features/basins"])
def test_every_folder_of_parts_and_basins_has_a_declaration(folder):
    folders = [path for path in (Path(fvsolve.__file__).parent / folder).iterdir() if (path / "__init__.py").is_file()]
    from fvsolve.parts.conduit.part import ConduitFlow

    assert ConduitFlow.package == "fvsolve.features.basins.conduit"  # whose declaration is that of a link
    folders = [path for path in folders if (folder, path.name) != ("features/basins", "conduit")]
    assert folders and all((path / "part.py").is_file() for path in folders)
