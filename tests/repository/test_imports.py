"""Import rules: no cycle, and compiled files of parts and basins import compiled code only.

No file of tests imports a test module.
"""

import ast
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

import fvsolve
from fvsolve.features.basins import COMPILED


def circle(arrows: dict[str, set[str]]) -> list[str]:
    """Modules of a circle of imports, or an empty list."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_imports_run_in_no_circle():
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    found = circle(
        {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    )
    assert not found, " -> ".join(found)


@pytest.mark.parametrize(
    "arrows, found", [({"a": {"b"}, "b": {"c"}, "c": {"a"}}, 4), ({"a": {"b", "c"}, "b": {"c"}}, 0)]
)
def test_a_circle_is_seen(arrows, found):
    assert len(circle(arrows)) == found


def below_core(module: str) -> list[str]:
    """Names of a module below `fvsolve`, or below `fvsolve.core` if it is there."""
    return module.removeprefix("fvsolve.").removeprefix("core.").split(".")


def is_compiled(module: str) -> bool:
    """True for a law of a part, and for a file of a basin that is neither a declaration nor a lowering."""
    folder, *names = below_core(module)
    if folder == "parts":
        return len(names) == 2 and names[1].startswith("law")
    if folder == "features" and names[:2] == ["scalars", "kernels"]:
        return True
    if folder != "features" or names[:1] != ["basins"] or len(names) == 1:
        return False
    path = Path(fvsolve.__file__).parent.joinpath("features", *names).with_suffix(".py")
    return path in COMPILED


def test_compiled_files_of_parts_and_basins_import_compiled_code_only():
    """The cache of compiled code is keyed by these sources, so nothing else may influence them."""
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    compiled = [module for module in sorted(graph.modules) if is_compiled(module)]
    assert {below_core(module)[0] for module in compiled} == {"parts", "features"}
    for module in compiled:
        for other in graph.find_modules_directly_imported_by(module):
            assert is_compiled(other) or below_core(other)[0] in ("kernels", "jit"), (
                f"{module} imports {other}"
            )


@pytest.mark.parametrize("folder", ["parts", "features/basins"])
def test_declarations_import_no_lowering(folder):
    """A `part.py` beside a compiled law states keys only, so that a schema needs no tables and no compiled law."""
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    place = f"fvsolve.{folder.replace('/', '.')}."
    declared = [
        module for module in graph.modules if module.startswith(place) and module.endswith(".part")
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
    folders = [
        path
        for path in (Path(fvsolve.__file__).parent / folder).iterdir()
        if (path / "__init__.py").is_file()
    ]
    from fvsolve.parts.conduit.part import ConduitFlow

    # whose declaration is that of a link
    assert ConduitFlow.package == "fvsolve.features.basins.conduit"
    folders = [path for path in folders if (folder, path.name) != ("features/basins", "conduit")]
    assert folders and all((path / "part.py").is_file() for path in folders)


TESTS = Path(__file__).parents[1]


def imported_tests(text: str) -> list[str]:
    """Modules of tests that a file imports, at its head or within a function."""
    names = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module or ''}.{alias.name}" for alias in node.names]
    places = [TESTS / name.replace(".", "/") for name in names]
    files = {path.with_suffix(".py") for place in places for path in (place, place.parent)}
    return sorted(path.stem for path in files if path.name.startswith("test_") and path.is_file())


def test_no_file_of_tests_imports_a_test_module():
    """What several files of tests need is in `tests/reference`, so each of them can be read and changed alone."""
    files = {
        path.relative_to(TESTS): path.read_text(encoding="utf-8")
        for path in sorted(TESTS.rglob("*.py"))
    }
    assert len(files) > 300
    assert {path: found for path, text in files.items() if (found := imported_tests(text))} == {}


@pytest.mark.parametrize(
    "text",
    [
        "from repository.test_imports import circle",
        "from repository import test_imports",
        "import repository.test_imports as rules",
        "def f():\n    from repository.test_imports import circle",
    ],
)
def test_an_import_of_a_test_module_is_detected(text):
    assert imported_tests(text) == ["test_imports"]
