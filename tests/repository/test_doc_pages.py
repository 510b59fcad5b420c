"""Pages of the documentation: their files, names, links, commands, Python and output are as they state.

The pages are docs/index.md, docs/start, docs/how-to, CONTRIBUTING.md, docs/developing.md, docs/bodies.md, and
docs/course.md, which covers the course.
"""

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from reference.folders import DOCS, page, printed_otherwise, python_of, section

from fvsolve.parts.attitude_keys import Attitude

TOP = DOCS.parent
TEXTS = "README.md CONTRIBUTING.md pyproject.toml docs/**/*.md cases/*.toml fvsolve/**/*.py tests/**/*.py".split()
# with `tests/` or without
NAMED = re.compile(r"(?<![\w/])(?:tests/)?(\w+/test_\w+\.py|truth/\w+\.py)")


def test_every_file_of_tests_that_is_named_is_there():
    texts = {
        path: path.read_text(encoding="utf-8") for pattern in TEXTS for path in TOP.glob(pattern)
    }
    named = {
        (path.relative_to(TOP).as_posix(), name)
        for path, text in texts.items()
        for name in NAMED.findall(text)
    }
    assert len(named) > 50
    assert (
        sorted((path, name) for path, name in named if not (TOP / "tests" / name).is_file()) == []
    )


HOW_TO_PAGES = sorted(path for path in (DOCS / "how-to").glob("*.md") if path.stem != "index")
START = DOCS / "start"
# tutorials with a section of commands for a new folder; the site runs their cells
MIXED_PAGES = [
    DOCS / f"tutorials/{name}.md"
    for name in ("air-vessel", "column-separation", "epanet-pump-trip")
]
CELL = re.compile(r"^```\{code-cell\}.*?^```\n", re.DOTALL | re.MULTILINE)
RUN_PAGES = [*HOW_TO_PAGES, *MIXED_PAGES, START / "first-questions.md", DOCS / "index.md"]
RUN_PAGES.append(DOCS / "syllabus.md")
BLOCK = re.compile(r"^```(\w*)[ ]?(\S*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
# optional libraries
LIBRARIES = {"epanet-pump-trip": ("wntr", "plotly", "xlsxwriter"), "plastic-main": ("rainflow",)}
FAILS = (0, 1)  # exit status 1: some pages show a limit that fails


def plain(text: str) -> str:
    """Text with single blanks, because columns and the width of the terminal change white space."""
    return re.sub(r"\s+", " ", text)


def test_every_page_is_in_the_index():
    linked = set(
        re.findall(r"\(([\w-]+)\.md\)", (DOCS / "how-to/index.md").read_text(encoding="utf-8"))
    )
    assert linked == {path.stem for path in HOW_TO_PAGES} and len(HOW_TO_PAGES) == 7


TUTORIALS = sorted(path for path in (DOCS / "tutorials").glob("*.md") if path.stem != "index")
# of each tutorial, in this order
SECTIONS = ["The question", "The physics", "The check", "Now change this"]


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_asserts_its_check_and_the_answer_to_its_change(page):
    """The site runs the cells; a row of the index leads to the page."""
    text = page.read_text(encoding="utf-8")
    assert f"({page.name})" in (DOCS / "tutorials/index.md").read_text(encoding="utf-8")
    assert [
        one for one in re.findall(r"^## (.*)$", text, re.MULTILINE) if one in SECTIONS
    ] == SECTIONS
    check, change = text.split("## The check\n")[1].split("## Now change this\n")
    answer = change.split("**Answer.**")[1]
    assert "\nassert " in check and "\nassert " in answer
    assert "!fvsolve " in text.split("## The check")[0] and "!fvsolve " in change


@pytest.mark.parametrize("page", RUN_PAGES, ids=lambda path: path.stem)
def test_a_page_does_as_it_states(page, fvs, tmp_path, monkeypatch):
    """Append blocks with a file name to the file, run the commands in order, and compare their output with the page."""
    for library in LIBRARIES.get(page.stem, ()):
        pytest.importorskip(library)
    monkeypatch.chdir(tmp_path)
    said, shown = "", 0
    for language, name, text in BLOCK.findall(CELL.sub("", page.read_text(encoding="utf-8"))):
        if name:
            with (tmp_path / name).open("a", encoding="utf-8") as file:
                file.write("\n" + text)
        elif language == "sh":
            said = ""
            for line in text.splitlines():
                status, out, problem = fvs(*shlex.split(line)[1:])
                assert status in FAILS, problem
                said += plain(out)
        elif not language:
            shown += 1
            for line in text.splitlines():
                assert plain(line) in said, line
    assert shown


def test_the_first_page_has_the_command_of_the_readme_and_its_output():
    """README's commands run in a fresh clone; the first page of the site shows the first of them."""
    texts = [path.read_text(encoding="utf-8") for path in (START / "index.md", TOP / "README.md")]
    (ours, shown), (readme, output) = [
        [text for *_, text in BLOCK.findall(one)[:2]] for one in texts
    ]
    assert ours == readme and shown == output


CONTRIBUTOR_PAGES = {
    name: (TOP / name).read_text(encoding="utf-8")
    for name in ("CONTRIBUTING.md", "docs/developing.md")
}
# Commands that install, that .ci/run runs, or that have a test of their own.
HEAVY = (
    "python3 -m venv",
    ".ci/run",
    "python tests/",
    "lint-imports",
    "ruff",
    "NUMBA_DISABLE_JIT=1",
    "FVSOLVE_STORE=0",
    "PYTHONS=",
    ".ci/release",
    "pip install",
    "python -m pytest",
)


def commands() -> list[str]:
    """Lines of the shell blocks of both pages, without trailing comments."""
    texts = CONTRIBUTOR_PAGES.values()
    blocks = [block for text in texts for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL)]
    return [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]


def is_test(command: str) -> bool:
    return "pytest" in command.split()[0]


@pytest.fixture
def copied_files(tmp_path) -> Path:
    """Folder with copies of the files that the commands overwrite."""
    for name in ("docs/structures.md", "cases/schema.json", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(TOP / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize(
    "command", [one for one in commands() if not is_test(one) and not one.startswith(HEAVY)]
)
def test_a_command_of_the_pages_does_as_it_states(command, copied_files):
    """Commands that write the schema and the key tables leave both files unchanged."""
    paths = [str(Path(sys.executable).parent), os.environ["PATH"]]
    known = os.environ | {
        "PATH": os.pathsep.join(paths),
        "PYTHONPATH": str(TOP),
        "MPLBACKEND": "Agg",
    }
    done = subprocess.run(
        ["bash", "-c", command], cwd=copied_files, env=known, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("docs/structures.md", "cases/schema.json"):
        assert (copied_files / name).read_text(encoding="utf-8") == (TOP / name).read_text(
            encoding="utf-8"
        )


@pytest.mark.parametrize("command", [one for one in commands() if is_test(one)])
def test_the_tests_that_the_pages_run_are_there(command):
    files = [word for word in shlex.split(command)[1:] if word.startswith("tests")]
    assert all((TOP / file).exists() for file in files)


def test_two_tanks_without_jit_are_the_same_bytes(copied_files):
    """Debugging without JIT writes the bytes of the compiled run, as docs/developing.md states; levels meet at 57 s."""
    short, written = (
        ("nodes.high.level=3.05", "nodes.low.level=2.9", "numerics.end=60", "expect={}"),
        [],
    )
    for off in ("0", "1"):
        command = [sys.executable, "-m", "fvsolve", "run", "two-tanks", "--out", f"runs/{off}"]
        command += [word for one in short for word in ("--set", one)]
        known = os.environ | {"NUMBA_DISABLE_JIT": off, "PYTHONPATH": str(TOP), "MPLBACKEND": "Agg"}
        subprocess.run(command, cwd=copied_files, env=known, check=True, capture_output=True)
        written.append((copied_files / "runs" / off / "history.csv").read_bytes())
    assert written[0] == written[1]


@pytest.mark.parametrize("page", CONTRIBUTOR_PAGES)
def test_files_and_names_of_the_pages_are_there(page):
    """Each `.py` or `.json` file in backquotes is the end of a path, except those of a run or a release."""
    text = re.sub(r"```.*?```", "", CONTRIBUTOR_PAGES[page], flags=re.DOTALL)
    there = [
        f"/{path.as_posix()}"
        for folder in ("fvsolve", "tests", "cases", "docs")
        for path in (TOP / folder).rglob("*.*")
    ]
    said = {*re.findall(r"`([\w/]+\.(?:py|json))`", text)} - {"summary.json", "dist/sbom.json"}
    assert [
        name
        for name in said
        if "NAME" not in name and not any(one.endswith(f"/{name}") for one in there)
    ] == []


def pages() -> list[Path]:
    # of `fvsolve validate`
    docs = [path for path in (TOP / "docs").rglob("*.md") if path.parent.name != "results"]
    return [*TOP.glob("*.md"), *docs, *(TOP / "benchmarks").glob("*.md")]


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_links_of_every_page_lead_to_files_and_headings(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^):\s]+)\)", text):
        name, _, heading = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), link
        if heading:
            titles = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in {
                re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles
            }, link


def test_the_paper_has_the_form_of_the_journal_and_cites_its_bibliography():
    """Sections and length (750 to 1750 words) of the Journal of Open Source Software; every entry is cited."""
    _, head, text = (DOCS / "paper" / "paper.md").read_text(encoding="utf-8").split("---\n", 2)
    entries = re.findall(
        r"^@\w+\{([^,]+),", (DOCS / "paper" / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert {*re.findall(r"@(\w+:\d{4})", text)} == {*entries} and "bibliography: paper.bib" in head
    assert re.findall(r"^# (.*)$", text, re.MULTILINE) == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "Acknowledgements",
        "References",
    ]
    assert (
        750 <= len(text.split()) <= 1750
        and text.count("\\label{fig:") == text.count("\\autoref{fig:") == 2
    )


def test_the_changelog_has_the_form_of_keep_a_changelog():
    """Form of https://keepachangelog.com/en/1.1.0/: unreleased changes first, six kinds of change, a list for each."""
    text = (TOP / "CHANGELOG.md").read_text(encoding="utf-8")
    top, *versions = re.split(r"^## ", text, flags=re.MULTILINE)
    assert (
        top.startswith("# Changelog\n")
        and "keepachangelog.com" in top
        and versions[0].startswith("[Unreleased]\n")
    )
    for version in versions:
        kinds = re.findall(r"^### (.*)\n\n- ", version, re.MULTILINE)
        order = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]
        assert (
            kinds
            and set(kinds) <= {*order}
            and len(kinds) == len(set(kinds)) == version.count("\n### ")
        )


ATTITUDES = section("bodies", "Attitudes")
FORMS = re.findall(r"^attitude = .*$", ATTITUDES, re.MULTILINE)


def test_there_is_an_example_of_every_form():
    assert {key for form in FORMS for key in tomllib.loads(form)["attitude"]} == {*Attitude.keys()}


@pytest.mark.parametrize("form", FORMS)
def test_the_forms_of_the_page_are_read(form):
    read = Attitude.model_validate(tomllib.loads(form)["attitude"])
    assert np.allclose(read.rotation @ read.rotation.T, np.eye(3), atol=1e-15) and not [
        *read.unusual()
    ]


def test_lines_of_python_about_attitudes_print_the_text_below_them():
    assert printed_otherwise(python_of(ATTITUDES)) == ""


def test_lines_that_print_otherwise_are_seen():
    assert "Expected" in printed_otherwise(">>> 1 + 1\n3\n")


COURSE = page("course")
EQUATIONS = range(1, 83)
STATEMENTS = {  # statements without a number, in sections 2 to 5: words of a heading
    "Eigenvalues",
    "Eigenvectors",
    "Derivative of a square",
    "Velocity and angular velocity",
    "Transposes",
    "Inverse of two by two",
    "Modules and connections",
    "Hydraulic",
    "Translational",
    "Rotational",
    "Electrical",
    "Magnetic",
    "Thermal",
    "Chemical",
    "Energy that falls",
    "resistor",
    "Connected stable",
    "Connected passive",
    "Passive is positive real",
    "definition",
    "theorem",
    "Stiff",
    "A-stability",
    "No explicit method",
    "Aliasing",
    "L-stability",
    "Padé",
}
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
        return [
            int(one) for one in re.findall(r"\((\d+)\)", re.match(r"(\(\d+\) )*", self.title)[0])
        ]

    @property
    def modelled(self) -> bool:
        return self.fields["where"].split(" (")[0] != NOT_YET


def entries() -> list[Entry]:
    found = []
    for part in re.split(r"^## ", COURSE, flags=re.MULTILINE)[1:]:
        section, *rest = re.split(r"^### ", part, flags=re.MULTILINE)
        for one in rest:
            title, text = one.split("\n", 1)
            fields = dict(re.findall(r"^- (\w+): (.*)$", text, re.MULTILINE))
            found.append(Entry(section.splitlines()[0], title, fields, python_of(text)))
    return found


ENTRIES = entries()


def of(*keys: str) -> list:
    """Test parameters: entries with at least one of these fields, or with Python."""
    some = [
        one
        for one in ENTRIES
        if any(key in one.fields or (key == "python" and one.python) for key in keys)
    ]
    return [pytest.param(one, id=one.title) for one in some]


def test_every_equation_has_an_entry_in_their_order():
    assert [number for one in ENTRIES for number in one.numbers] == [*EQUATIONS]


def test_every_statement_of_sections_2_to_5_has_an_entry():
    titles = [one.title for one in ENTRIES if one.section[0] in "2345" and not one.numbers]
    assert len({word: [title for title in titles if word in title] for word in STATEMENTS}) == len(
        titles
    )
    assert all(any(word in title for title in titles) for word in STATEMENTS)


@pytest.mark.parametrize("entry", of("where"))
def test_an_entry_states_its_place_and_its_proof_or_that_it_is_not_modelled(entry):
    assert {*entry.fields} <= {"where", "run", "test"}
    if entry.modelled:
        assert "test" in entry.fields


def test_every_entry_is_of_that_form():
    assert [one.title for one in ENTRIES if "where" not in one.fields] == []
    assert [one.title for one in ENTRIES if not one.modelled and one.section[0] == "3"] == []


@cache
def names_in(path: str) -> set[str]:
    """Functions, classes, methods and names assigned at the top level of a file."""
    tree, found = ast.parse((TOP / path).read_text(encoding="utf-8")), set()
    for one in tree.body:
        found |= {one.name} if isinstance(one, (ast.FunctionDef, ast.ClassDef)) else set()
        if isinstance(one, ast.ClassDef):
            found |= {
                f"{one.name}.{inner.name}"
                for inner in one.body
                if isinstance(inner, ast.FunctionDef)
            }
        for target in getattr(one, "targets", []):
            found |= {target.id} if isinstance(target, ast.Name) else set()
    return found


@cache
def words_in(path: str) -> set[str]:
    """String constants of a file."""
    tree = ast.parse((TOP / path).read_text(encoding="utf-8"))
    return {
        one.value
        for one in ast.walk(tree)
        if isinstance(one, ast.Constant) and isinstance(one.value, str)
    }


@pytest.mark.parametrize("entry", [one for one in of("where") if one.values[0].modelled])
def test_files_and_names_are_there(entry):
    for part in entry.fields["where"].split(";"):
        path, *names = re.findall(r"`(.+?)`", part)
        assert (TOP / path).is_file(), path
        assert {*names} <= names_in(path), (path, names)
        assert {*re.findall(r'"(.+?)"', part)} <= words_in(path), part
        assert names or '"' in part, path


def named() -> list[tuple[str, str]]:
    return re.findall(r"`([\w/]+\.py)::(\w+)`", COURSE)


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
def test_lines_of_python_print_the_text_below_them(entry):
    assert entry.python.startswith(">>>")
    assert printed_otherwise(entry.python) == ""


def test_whatever_is_modelled_can_be_seen_to_run():
    """Each modelled statement has a command or lines of Python that a reader may run."""
    assert [
        one.title for one in ENTRIES if one.modelled and not one.python and "run" not in one.fields
    ] == []
