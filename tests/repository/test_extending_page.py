"""Package, cases and commands of docs/extending.md, installed and run as they stand."""

import re
import tomllib
from pathlib import Path

import pytest
from reference.folders import page
from reference.outside_packages import files_of, install_page, lines_not_printed, runs_of

from fvsolve import exact, studies
from fvsolve.case.sections import SINKS
from fvsolve.cli import COMMANDS
from fvsolve.core.fluid import LAWS

TEXT = page("extending").split("\n## A feature in one folder\n")[0]
FILES, RUNS = files_of(TEXT), runs_of(TEXT)


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """Folder with the cases of the page and its installed package."""
    return install_page(tmp_path_factory.mktemp("home"), FILES, "fieldkit")


@pytest.mark.parametrize(
    "commands, output", RUNS, ids=[commands.splitlines()[0] for commands, _ in RUNS]
)
def test_the_commands_of_the_page_print_its_text(commands, output, home):
    assert lines_not_printed(home, commands, output) == []


def test_each_entry_point_of_the_page_is_used_by_it():
    entries = tomllib.loads(FILES["pyproject.toml"])["project"]["entry-points"]
    text = "\n".join(
        [
            *(commands for commands, _ in RUNS),
            *(FILES[name] for name in FILES if name.endswith(".toml")),
        ]
    )
    assert [name for group in entries.values() for name in group if text.count(name) < 2] == []
    assert len(FILES) >= 4 and len(RUNS) >= 2


HEADERS = '''
@declared("study")
def maxima(case):
    pass


@declared("sink", "json-lines")
class JsonLines:
    pass


FREE_MASS = Exact("free-mass", (), (), None, None)


@command("areas")
def print_areas(case: str) -> None:
    """Print areas."""


class Tait(SampledLaw, name="tait"):
    pass
'''


def test_headers_in_a_file_of_a_user_are_those_of_the_page(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(HEADERS, encoding="utf-8")
    indices = {
        "STUDIES": studies.STUDIES,
        "SINKS": SINKS,
        "EXACT_SOLUTIONS": exact.NAMES,
        "COMMANDS": COMMANDS,
        "DENSITY_LAWS": LAWS,
    }
    for variable, index in indices.items():
        monkeypatch.setenv(f"FVSOLVE_{variable}", str(tmp_path))
        assert f"`FVSOLVE_{variable}`" in TEXT and index.variable == f"FVSOLVE_{variable}"
    attributes = [
        (name, found.attribute)
        for index in indices.values()
        for name, found in index.others().items()
    ]
    assert attributes == [
        ("maxima", "maxima"),
        ("json-lines", "JsonLines"),
        ("free-mass", "FREE_MASS"),
        ("areas", "print_areas"),
        ("tait", "Tait"),
    ]
    for header in re.findall(r"header is\s`([^`]+)`", TEXT):
        known = header.replace("NAME =", "FREE_MASS =").replace('"name", ...)', '"free-mass"')
        assert known.replace("NAME(", "Tait(").replace('"..."', '"tait"') in HEADERS
    assert len(re.findall(r"header is\s", TEXT)) == 5
