"""Generated reference pages: they contain every command with its options, every unit and every public name."""

import ast
import re
import sys

import numpy as np
import pytest
from reference.folders import DOCS

import fvsolve
from fvsolve.cli import COMMANDS
from fvsolve.core.kernels import dtypes
from fvsolve.core.kernels.calls import HOOKS
from fvsolve.units import UNITS, parse

sys.path.append(str(DOCS))
import generated_pages  # noqa: E402


@pytest.fixture(scope="module")
def sections() -> dict[str, str]:
    """Sections of the page of commands, by name of the command."""
    parts = re.split(r"^## fvsolve (\S+)$", generated_pages.commands(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("command", COMMANDS)
def test_the_section_of_a_command_has_the_options_of_its_help(command, sections, fvs):
    code, text, _ = fvs(command, "--help")
    said = {*re.findall(r"(?<![\w`-])--[a-z][\w-]*", text)} - {"--help"}
    assert code == 0 and said <= {*re.findall(r"--[a-z][\w-]*", sections[command])}
    assert sections.keys() == COMMANDS.keys()


def test_each_unit_has_the_size_that_the_case_file_reads():
    rows = [
        line.split(" | ") for line in generated_pages.units().splitlines() if line.startswith("| a")
    ]
    sizes = [
        found
        for row in rows
        for found in re.findall(r"`([^`]+)` ([\d.e+-]+)( gauge)?(?:,| \|$)", row[-1])
    ]
    assert {unit for unit, *_ in sizes} == {unit for unit, one in UNITS.items() if not one.offset}
    for unit, size, gauge in sizes:
        read = parse(f"1 {unit}", UNITS[unit].dimension)
        value, is_gauge = read if isinstance(read, tuple) else (read, False)
        assert value == pytest.approx(float(size), rel=1e-9) and is_gauge == bool(gauge)


def test_all_public_names_are_there_with_the_first_line_of_their_docstrings():
    text = generated_pages.names()
    listed = re.findall(r"\{py:(?:function|class|exception)\} ([\w.]+)", text)
    assert {f"fvsolve.{name}" for name in fvsolve.__all__} <= {*listed} and len(listed) == len(
        {*listed}
    )
    assert {"fvsolve.studies.order", "fvsolve.studies.sweep", "fvsolve.steppers.analyse"} <= {
        *listed
    }
    for name in fvsolve.__all__:
        assert generated_pages.escaped(getattr(fvsolve, name).__doc__.splitlines()[0]) in text
    assert "{py:method} rhs(t, y=None)" in text and "{py:property} envelope" in text


def test_a_public_name_without_docstring_is_refused(monkeypatch):
    monkeypatch.setattr(fvsolve.run, "__doc__", None)
    with pytest.raises(ValueError, match=r"fvsolve\.run has no docstring"):
        generated_pages.names()


def test_all_tables_of_the_core_and_of_features_are_there_with_each_column():
    text = generated_pages.tables()
    sections = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", text, re.MULTILINE | re.DOTALL))
    assert {"## Tables of the core", "## Tables of delay lines", "## Tables of controls"} <= {
        *text.splitlines()
    }
    for name, kind in (
        (name, kind) for name, kind in vars(dtypes).items() if isinstance(kind, np.dtype)
    ):
        assert re.findall(r"^\| `(\w+)` \|", sections[name], re.MULTILINE) == list(kind.names)
    assert "| `tau` | number | travel time of a stretch [s] |" in sections["DELAY"]
    for name, table in (
        ("VALVE", "valves"),
        ("CLOCK", "clock"),
        ("BODY", "bodies"),
        ("CONTROL", "controls"),
    ):
        assert f"`tables.{table}[i]`" in sections[name]
    assert "| `tables.floats` | numbers of laws" in text


def test_each_column_has_a_meaning():
    rows = re.findall(r"^\| `(.+?)` \|.*\| (.*) \|$", generated_pages.tables(), re.MULTILINE)
    assert len(rows) > 500 and [name for name, about in rows if not about.strip()] == []


def test_the_page_of_devices_has_the_table_of_all_functions_of_a_law():
    """The table is that of `python docs/generated_pages.py hooks`; a law of the package names its arguments so."""
    assert generated_pages.hooks() in (DOCS / "own-parts.md").read_text("utf-8")
    for path in generated_pages.PACKAGE.glob("parts/**/law*.py"):
        for found in ast.parse(path.read_text("utf-8")).body:
            if isinstance(found, ast.FunctionDef) and (hook := HOOKS.get(found.name)):
                names = [one.arg for one in found.args.args]
                assert ", ".join(names) == hook.names, f"{path}: {found.name}"


@pytest.mark.parametrize("name", HOOKS)
def test_a_function_of_a_law_has_a_letter_for_each_argument(name):
    hook = HOOKS[name]
    letters = {"t": "t", "y": "V", "dydt": "V", "out": "V", "tables": "T", "device": "D", "k": "i"}
    letters |= {"m": "t", "drop": "t", "denser": "t", "wide": "b", "quantity": "i", "before": "t"}
    letters |= {"behind": "t", "ahead": "b", "g": "V" if name in ("events", "bends") else "t"}
    assert "".join(letters[argument] for argument in hook.names.split(", ")) == hook.letters
    assert (
        hook.when and (hook.about or hook.results) and (hook.results != "") == (hook.returned != "")
    )


def test_lines_about_arguments_are_items_of_a_list():
    text = (
        "Sum of a and b.\n\na, b : numbers < 1, with\ncontinuation\nc : `a*b`\nRaises ValueError."
    )
    expected = "Sum of a and b.\n\n\n- a, b: numbers \\< 1, with\n  continuation\n- c: `a*b`\n\nRaises ValueError."
    assert generated_pages.prose(text) == expected
