"""CONTRIBUTING.md and docs/developing.md: their commands run, and the files that they name exist."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from reference.folders import DOCS

TOP = DOCS.parent
PAGES = {name: (TOP / name).read_text(encoding="utf-8") for name in ("CONTRIBUTING.md", "docs/developing.md")}
HEAVY = ("python3 -m venv", ".ci/run", "python tests/")  # installs, or runs many tests


def commands() -> list[str]:
    """Lines of the shell blocks of both pages, without trailing comments."""
    blocks = [block for page in PAGES.values() for block in re.findall(r"```sh\n(.*?)```", page, re.DOTALL)]
    return [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]


def is_test(command: str) -> bool:
    return "pytest" in command.split()[0]


@pytest.fixture
def beside(tmp_path) -> Path:
    """Folder with copies of the files that the commands overwrite."""
    for name in ("docs/parts.md", "cases/schema.json", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(TOP / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize("command", [one for one in commands() if not is_test(one) and not one.startswith(HEAVY)])
def test_a_command_of_the_pages_does_what_it_says(command, beside):
    """Commands that write the schema and the key tables leave both files unchanged."""
    paths = [str(Path(sys.executable).parent), os.environ["PATH"]]
    known = os.environ | {"PATH": os.pathsep.join(paths), "PYTHONPATH": str(TOP), "MPLBACKEND": "Agg"}
    where = TOP if command.startswith(("lint-imports", "ruff")) else beside
    done = subprocess.run(["bash", "-c", command], cwd=where, env=known, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("docs/parts.md", "cases/schema.json"):
        assert (beside / name).read_text(encoding="utf-8") == (TOP / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("command", [one for one in commands() if is_test(one)])
def test_the_tests_that_the_pages_run_are_there(command):
    files = [word for word in shlex.split(command)[1:] if word.startswith("tests")]
    assert all((TOP / file).exists() for file in files)


def test_two_tanks_without_jit_are_the_same_bytes(beside):
    """Debugging without JIT writes the bytes of the compiled run, as docs/developing.md states."""
    written = []
    for off in ("0", "1"):
        command = [sys.executable, "-m", "fvsolve", "run", "two-tanks", "--out", f"runs/{off}"]
        known = os.environ | {"NUMBA_DISABLE_JIT": off, "PYTHONPATH": str(TOP), "MPLBACKEND": "Agg"}
        subprocess.run(command, cwd=beside, env=known, check=True, capture_output=True)
        written.append((beside / "runs" / off / "history.csv").read_bytes())
    assert written[0] == written[1]


@pytest.mark.parametrize("page", PAGES)
def test_files_and_names_of_the_pages_are_there(page):
    """Each `.py` or `.json` file in backquotes is the end of a path, except summary.json, which a run writes."""
    text = re.sub(r"```.*?```", "", PAGES[page], flags=re.DOTALL)
    there = [f"/{path.as_posix()}" for folder in ("fvsolve", "tests", "cases") for path in (TOP / folder).rglob("*.*")]
    said = {*re.findall(r"`([\w/]+\.(?:py|json))`", text)} - {"summary.json"}
    assert [name for name in said if "NAME" not in name and not any(one.endswith(f"/{name}") for one in there)] == []


def pages() -> list[Path]:
    return [*TOP.glob("*.md"), *(TOP / "docs").rglob("*.md"), *(TOP / "benchmarks").glob("*.md")]


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_links_of_every_page_lead_to_files_and_headings(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^):\s]+)\)", text):
        name, _, heading = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), link
        if heading:
            titles = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}, link


def test_the_changelog_has_the_form_of_keep_a_changelog():
    """Form of https://keepachangelog.com/en/1.1.0/: unreleased changes first, six kinds of change, a list for each."""
    text = (TOP / "CHANGELOG.md").read_text(encoding="utf-8")
    top, *versions = re.split(r"^## ", text, flags=re.MULTILINE)
    assert top.startswith("# Changelog\n") and "keepachangelog.com" in top and versions[0].startswith("[Unreleased]\n")
    for version in versions:
        kinds = re.findall(r"^### (.*)\n\n- ", version, re.MULTILINE)
        order = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]
        assert kinds and set(kinds) <= {*order} and len(kinds) == len(set(kinds)) == version.count("\n### ")
