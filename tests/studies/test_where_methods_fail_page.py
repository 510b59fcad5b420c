"""docs/where-methods-fail.md: its tests exist, its commands run as described, and its table is the computed one."""

import re
import shlex
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from reference import folders
from studies.test_where_methods_fail_in_pipes import LENGTH, SPEED, courant_limit, lossless, scaled

from fvsolve.cli import main
from fvsolve.cli.app import load_case
from fvsolve.errors import FvsolveError

TESTS = Path(__file__).parent
PAGE = folders.page("where-methods-fail")
WORDS = {"What happens", "Why", "Predicted", "Remedy"}


def sections() -> dict[str, str]:
    parts = re.split(r"^## (.+)$", PAGE, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_section_says_what_why_where_and_what_helps_and_names_tests_that_exist():
    written = "".join(path.read_text(encoding="utf-8") for path in TESTS.glob("test_*fail*.py"))
    found = {name: text for name, text in sections().items() if name != "The map"}
    assert len(found) == 14
    for name, text in found.items():
        assert set(re.findall(r"\*\*(.+?)\.\*\*", text)) == WORDS, name
        named = re.findall(r"`(test_\w+)`", text)
        assert named, name
        for test in named:
            assert f"def {test}(" in written, (name, test)


def commands() -> list[list[str]]:
    lines = [line.split("#")[0] for line in PAGE.splitlines() if re.match(r"(    )?fvsolve ", line)]
    return [shlex.split(line) for line in lines]


@pytest.mark.parametrize("words", commands(), ids=lambda words: " ".join(words[1:3]))
def test_every_command_of_the_page_names_a_case_and_settings_that_it_takes(words):
    settings = [value for option, value in zip(words, words[1:], strict=False) if option == "--set"]
    assert load_case(words[2], settings).name == words[2]


@pytest.mark.parametrize(
    "words", [words for words in commands() if words[1] == "failure-map"], ids=lambda words: words[2]
)
def test_every_map_of_the_page_takes_its_options(words, monkeypatch, tmp_path, capsys):
    asked = []

    def noted(case, *given, **more):
        asked.append(case.name)
        raise FvsolveError("far enough: nothing is run")

    monkeypatch.setattr(import_module("fvsolve.studies.failure_map"), "failure_map", noted)
    monkeypatch.setattr(sys, "argv", [*words, "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2 and "far enough" in capsys.readouterr().err and asked == [words[2]]


def test_the_table_of_courant_limits_is_what_is_computed():
    rows = re.findall(r"^\| (`.+?`) \|((?: [\d.]+ \|){6})$", PAGE, flags=re.MULTILINE)
    schemes = ("upwind", "linear-upwind", "fromm", "upwind3", "upwind5", "central")
    assert len(rows) == 5
    cells, travel = 16, LENGTH / 16 / SPEED
    for methods, numbers in rows:
        for method in re.findall(r"`(.+?)`", methods):
            for scheme, number in zip(schemes, numbers.strip(" |").split("|"), strict=True):
                model = lossless(cells, scheme, method, travel)
                unit = travel * scaled(model, model.jacobian(0.0, np.zeros(2 * cells)))
                assert courant_limit(method, unit, 1000) == pytest.approx(float(number), abs=6e-4), (method, scheme)
