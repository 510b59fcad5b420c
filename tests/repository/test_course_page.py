"""docs/course.md covers the course: its names exist, its commands run and its Python prints the output."""

from __future__ import annotations

import ast
import re
import shlex
from dataclasses import dataclass
from functools import cache

import pytest
from reference import folders
from reference.folders import printed_otherwise, python_of

TOP = folders.DOCS.parent
PAGE = folders.page("course")
EQUATIONS = range(1, 83)
STATEMENTS = {  # statements without a number, in sections 2 to 5: words of a heading
    "Eigenvalues", "Eigenvectors", "Derivative of a square", "Velocity and angular velocity", "Transposes",
    "Inverse of two by two", "Modules and connections", "Hydraulic", "Translational", "Rotational", "Electrical",
    "Magnetic", "Thermal", "Chemical", "Energy that falls", "resistor", "Connected stable", "Connected passive",
    "Passive is positive real", "definition", "theorem", "Stiff", "A-stability", "No explicit method", "Aliasing",
    "L-stability", "Padé",
}  # fmt: skip
NOT_YET = "not modelled yet"


@dataclass(frozen=True)
class Entry:
    """Entry of the page for one statement: fields of its list, and its lines of Python."""

    section: str
    title: str
    fields: dict[str, str]
    python: str

    @property
    def numbers(self) -> list[int]:
        """Numbers of equations at the start of the heading."""
        return [int(one) for one in re.findall(r"\((\d+)\)", re.match(r"(\(\d+\) )*", self.title)[0])]

    @property
    def modelled(self) -> bool:
        return self.fields["where"].split(" (")[0] != NOT_YET


def entries() -> list[Entry]:
    found = []
    for part in re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]:
        section, *rest = re.split(r"^### ", part, flags=re.MULTILINE)
        for one in rest:
            title, text = one.split("\n", 1)
            fields = dict(re.findall(r"^- (\w+): (.*)$", text, re.MULTILINE))
            found.append(Entry(section.splitlines()[0], title, fields, python_of(text)))
    return found


ENTRIES = entries()


def of(*keys: str) -> list:
    """Test parameters: entries with at least one of these fields, or with Python."""
    some = [one for one in ENTRIES if any(key in one.fields or (key == "python" and one.python) for key in keys)]
    return [pytest.param(one, id=one.title) for one in some]


def test_every_equation_has_one_entry_in_their_order():
    assert [number for one in ENTRIES for number in one.numbers] == [*EQUATIONS]


def test_every_statement_of_sections_2_to_5_has_one():
    titles = [one.title for one in ENTRIES if one.section[0] in "2345" and not one.numbers]
    assert len({word: [title for title in titles if word in title] for word in STATEMENTS}) == len(titles)
    assert all(any(word in title for title in titles) for word in STATEMENTS)


@pytest.mark.parametrize("entry", of("where"))
def test_an_entry_says_where_it_lives_and_what_proves_it_or_that_it_is_not_modelled(entry):
    assert {*entry.fields} <= {"where", "run", "test"}
    if entry.modelled:
        assert "test" in entry.fields


def test_every_entry_is_of_that_form():
    assert [one.title for one in ENTRIES if "where" not in one.fields] == []
    assert {one.title for one in ENTRIES if not one.modelled and one.section[0] == "3"} == {
        f"{domain} ports" for domain in ("Electrical", "Magnetic", "Thermal", "Chemical")
    }


@cache
def names_in(path: str) -> set[str]:
    """Functions, classes, methods and names assigned at the top level of a file."""
    tree, found = ast.parse((TOP / path).read_text(encoding="utf-8")), set()
    for one in tree.body:
        found |= {one.name} if isinstance(one, (ast.FunctionDef, ast.ClassDef)) else set()
        if isinstance(one, ast.ClassDef):
            found |= {f"{one.name}.{inner.name}" for inner in one.body if isinstance(inner, ast.FunctionDef)}
        for target in getattr(one, "targets", []):
            found |= {target.id} if isinstance(target, ast.Name) else set()
    return found


@cache
def words_in(path: str) -> set[str]:
    """String constants of a file."""
    tree = ast.parse((TOP / path).read_text(encoding="utf-8"))
    return {one.value for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, str)}


@pytest.mark.parametrize("entry", [one for one in of("where") if one.values[0].modelled])
def test_files_and_names_are_there(entry):
    for part in entry.fields["where"].split(";"):
        path, *names = re.findall(r"`(.+?)`", part)
        assert (TOP / path).is_file(), path
        assert {*names} <= names_in(path), (path, names)
        assert {*re.findall(r'"(.+?)"', part)} <= words_in(path), part
        assert names or '"' in part, path


def named() -> list[tuple[str, str]]:
    return re.findall(r"`([\w/]+\.py)::(\w+)`", PAGE)


def test_tests_that_are_named_are_there():
    assert len(named()) > 100
    for path, name in named():
        assert name in names_in(f"tests/{path}"), f"{path}::{name}"


@pytest.mark.parametrize("entry", of("run"))
def test_a_command_of_the_page_runs(entry, fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command, *words = shlex.split(entry.fields["run"].strip("`"))
    assert command == "fvsolve"
    code, _, error = fvs(*words)
    assert code == 0, error


@pytest.mark.parametrize("entry", of("python"))
def test_lines_of_python_print_what_stands_below_them(entry):
    assert entry.python.startswith(">>>")
    assert printed_otherwise(entry.python) == ""


def test_whatever_is_modelled_can_be_seen_to_run():
    """Each modelled statement has a command or lines of Python that a reader may run."""
    assert [one.title for one in ENTRIES if one.modelled and not one.python and "run" not in one.fields] == []
