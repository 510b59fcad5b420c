"""Public names: at most twenty, documented, present and fast to import.

An older Python is refused with a message that names it, the required version and the remedy.
"""

import math
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from inspect import isfunction
from pathlib import Path

import pytest
from reference import folders

import fvsolve
import fvsolve.studies

DOCS = folders.page("python")


def test_at_most_twenty():
    assert len(fvsolve.__all__) <= 20


@pytest.mark.parametrize("name", fvsolve.__all__)
def test_each_is_there_and_documented(name):
    assert getattr(fvsolve, name) is not None
    assert re.search(rf"^\| `{name}\b", DOCS, re.MULTILINE)


def test_the_page_names_no_other():
    assert set(re.findall(r"^\| `(\w+)", DOCS, re.MULTILINE)) == set(fvsolve.__all__)


def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    shutil.copytree(folders.CASES, tmp_path / "cases")
    monkeypatch.chdir(tmp_path)
    found = {}
    for example in re.findall(r"```python\n(.*?)```", DOCS, re.DOTALL):
        exec(example, found)
    assert (
        found["result"].ok and Path("gate.png").exists() and found["state"].t == pytest.approx(1.0)
    )
    for values in (found["decay"], found["again"]):
        assert values[:, 0] == pytest.approx([1.0, math.exp(-0.5), math.exp(-1.0)], rel=1e-6)


def test_functions_are_not_hidden_by_modules_of_the_same_name():
    for package, name in (("fvsolve", "run"), ("fvsolve", "solve"), ("fvsolve.exact", "solution")):
        import_module(f"fvsolve.core.{name}" if package == "fvsolve" else f"{package}.{name}")
        assert isfunction(getattr(import_module(package), name))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'simulate'"):
        fvsolve.simulate  # noqa: B018


def test_importing_imports_nothing_heavy():
    heavy = [
        "numpy",
        "numba",
        "CoolProp",
        "pint",
        "matplotlib",
        "pyvista",
        "meshio",
        "scipy",
        "rich",
        "pydantic",
    ]
    code = f"import fvsolve, sys; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


PAGES = {
    page.name: page.read_text(encoding="utf-8")
    for page in [*folders.DOCS.glob("*.md"), folders.DOCS.parent / "README.md"]
}


@pytest.mark.parametrize("page", PAGES)
def test_names_of_a_page_can_be_imported_from_the_stated_place(page):
    imports = re.findall(r"from (fvsolve[\w.]*) import \(?([\w, ]+)", PAGES[page])
    named = [
        (room, name.strip()) for room, names in imports for name in names.split(",") if name.strip()
    ]
    named += [
        text.rpartition(".")[::2]
        for text in re.findall(r"`(fvsolve(?:\.[a-zA-Z_]\w*)+)", PAGES[page])
    ]
    lost = [f"{room}.{name}" for room, name in named if not importable(room, name)]
    assert not lost


def importable(room, name):
    """True if a package has this attribute or module."""
    if hasattr(import_module(room), name):
        return True
    return find_spec(f"{room}.{name}") is not None


def test_names_of_studies_are_functions_or_kinds_and_no_modules():
    for name in fvsolve.studies.__all__:
        assert callable(getattr(fvsolve.studies, name)), name


TOP = Path(__file__).parents[2]
PRETEND = "import sys; sys.version_info = (3, 10, 13); import fvsolve"


def test_the_package_refuses_an_older_python():
    found = subprocess.run([sys.executable, "-c", PRETEND], capture_output=True, text=True, cwd=TOP)
    assert found.returncode == 1
    assert "needs Python 3.11 or later" in found.stderr
    assert sys.executable in found.stderr and "-m venv" in found.stderr
    assert "numba" not in found.stderr


NO_CI = pytest.mark.skipif(
    not (TOP / ".ci/run").exists() or os.name == "nt", reason="no .ci/run here"
)


@NO_CI
def test_ci_refuses_an_unknown_option():
    found = subprocess.run([TOP / ".ci/run", "--sites"], capture_output=True, text=True)
    assert found.returncode == 2 and "unknown option --sites; expected --site" in found.stdout


@NO_CI
def test_ci_refuses_an_older_python(tmp_path):
    older = tmp_path / "python3.10"
    older.write_text(
        '#!/bin/sh\nif [ "$1" = --version ]; then echo Python 3.10.13; else exit 1; fi\n'
    )
    older.chmod(0o755)
    found = subprocess.run(
        [TOP / ".ci/run"],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHON": str(older), "TMPDIR": str(tmp_path)},
    )
    assert found.returncode == 1
    assert all(part in found.stdout for part in (str(older), "3.10.13", "3.11 or later", "PYTHON="))
    assert list(tmp_path.iterdir()) == [older]
