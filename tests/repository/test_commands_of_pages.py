"""Commands in README, CONTRIBUTING, CHANGELOG and docs: each is parsed by the application, and none is run.

Complete commands stand in code blocks. In sentences and tables, code is a usage text: words in capitals stand for
values, `[--option VALUE]`, `a|b` and `...` have their usual meaning, and options also stand alone.
"""

import re
import shlex
from functools import cache

import pytest
import typer
from reference.folders import DOCS

from fvsolve.cli import COMMANDS, application
from fvsolve.core.schemes import SCHEMES
from fvsolve.core.steppers import METHODS
from fvsolve.studies.accuracy.order import REFERENCE_KINDS
from fvsolve.studies.accuracy.refine import WAYS
from fvsolve.studies.sizing import GOALS

TOP = DOCS.parent
PAGES = [*TOP.glob("*.md"), *DOCS.rglob("*.md")]
BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"(?:^|[\s/!])(fvsolve (?!is |in |runs$|fvsolve )[a-z-]+.*)")
CODE = re.compile(rf"(?<!`)`((?:fvsolve |--|(?:{'|'.join(COMMANDS)}) [^`]*--)[^`]+)`(?!`)")
ENDS = {"|", ">", ">>", "&&", "||", ";", "&"}  # of a command in a shell
CHOICES = {
    "--goal": GOALS,
    "--refine": WAYS,
    "--reference": REFERENCE_KINDS,
    "--scheme": SCHEMES,
    "--method": {*METHODS, "auto"},
}
OTHER_PROGRAMS = {
    "--full",
    "--site",
    "--rest",
    "--quick",
    "--random",
    "--help",
    "--version",
}  # pytest, .ci/run, benchmarks


def complete_commands(text: str) -> list[str]:
    """Commands in code blocks, with continued lines joined."""
    blocks = [
        body
        for kind, body in BLOCK.findall(text)
        if not kind.startswith(("python", "toml", "json"))
    ]
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [
        match[1]
        for line in lines
        if not line.lstrip().startswith("#") and (match := COMMAND.search(line))
    ]


def usage_texts(text: str) -> list[str]:
    """Code outside of blocks that begins with the name of the program or with an option."""
    return [
        code.replace("\\|", "|").replace("\n", " ") for code in CODE.findall(BLOCK.sub("", text))
    ]


@cache
def commands() -> dict:
    return typer.main.get_command(application()).commands


def options(names) -> set[str]:
    parameters = [parameter for name in names for parameter in commands()[name].params]
    return {
        option
        for parameter in parameters
        for option in (*parameter.opts, *parameter.secondary_opts)
    }


def wrong_choices(words: list[str]) -> list[str]:
    """Values that an option does not know; words in capitals and names of files stand for others."""
    pairs = [
        (option, value)
        for option, value in zip(words, words[1:], strict=False)
        if option in CHOICES
    ]
    values = [
        (option, one) for option, value in pairs for one in re.split(r"[,|]", value.strip("`.,;:"))
    ]
    return [
        f"{option} {one}"
        for option, one in values
        if one not in CHOICES[option] and not one.isupper() and "." not in one
    ]


def faults_of_command(line: str) -> list[str]:
    lexer = shlex.shlex(line, posix=True, punctuation_chars="();<>|&")
    lexer.whitespace_split = True
    words = [*lexer]
    words = words[1 : min([words.index(end) for end in ENDS if end in words], default=None)]
    if words[0] not in COMMANDS:
        return [] if words[0] == "--version" else [f"unknown command {words[0]}"]
    if "--help" in words:
        return []
    try:
        commands()[words[0]].make_context(words[0], words[1:])
    except Exception as error:
        # typer has an own copy of click, or uses the package
        if not hasattr(error, "format_message"):
            raise
        return [error.format_message()]
    return wrong_choices(words)


def faults_of_usage(text: str) -> list[str]:
    words = re.sub(r"[\[\]()]|\.\.\.", " ", re.sub(r'"[^"]*"', "X", text)).split()
    name = words[1] if words[0] == "fvsolve" else words[0] if words[0] in COMMANDS else None
    if name is not None and name not in COMMANDS:
        return [] if name in ("COMMAND", "--help", "--version") else [f"unknown command {name}"]
    known = options([name] if name else COMMANDS) | OTHER_PROGRAMS
    given = [re.split("[=,;:]", word)[0] for word in words if re.match("--[a-z]", word)]
    return [f"unknown option {word}" for word in given if word not in known] + wrong_choices(words)


def page_parameters(of, page) -> list:
    name = page.relative_to(TOP).as_posix()
    return [
        pytest.param(text, id=f"{name}: {text[:80]}")
        for text in dict.fromkeys(of(page.read_text(encoding="utf-8")))
    ]


# tests/repository/test_extending_page.py runs those of commands of another package
LINES = [
    one
    for page in PAGES
    if page.stem != "extending"
    for one in page_parameters(complete_commands, page)
]
USAGES = [one for page in PAGES for one in page_parameters(usage_texts, page)]


@pytest.mark.parametrize("line", LINES)
def test_a_command_of_a_page_is_accepted_by_the_program(line):
    assert faults_of_command(line) == []


@pytest.mark.parametrize("text", USAGES)
def test_commands_and_options_in_sentences_are_those_of_the_program(text):
    assert faults_of_usage(text) == []


def test_the_commands_of_the_pages_and_their_faults_are_detected():
    assert len(LINES) > 150 and len(USAGES) > 300
    texts = [one.values[0] for one in USAGES]
    assert any("--goal minimum|maximum" in text for text in texts) and "--goal maximum" in texts
    assert faults_of_usage("--goal greatest") == ["--goal greatest"]
    assert faults_of_usage("fvsolve sensitivity CASE --outcome X") == ["unknown option --outcome"]
    assert (
        faults_of_usage("fvsolve ruin CASE")
        == faults_of_command("fvsolve ruin a")
        == ["unknown command ruin"]
    )
    assert (
        "No such option"
        in faults_of_command('fvsolve sensitivity a --vary b=1,2 --outcome "max(c)"')[0]
    )
    assert "Missing option" in faults_of_command("fvsolve size a > b.txt")[0]
    assert faults_of_command("fvsolve order a --scheme upwind,muscle") == ["--scheme muscle"]
