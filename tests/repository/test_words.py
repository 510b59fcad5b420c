"""Names and texts of the package and of tests: forbidden words do not occur, docstrings begin with a verb or a noun.

No two classes of the package have equal names, so a search finds one definition.
"""

import ast
import functools
import gc
import re
from collections import Counter, defaultdict
from pathlib import Path

import fvsolve

PACKAGE = Path(fvsolve.__file__).parent
# Words without content, and metaphors that only the authors understood.
IN_NAMES = frozenset(
    """told tell tells said say says asked asks ask wanted wants found made brought bring kept keeps met meet meets
    meeting led unfelt felt feel meant errand errands crew slate freight laden rung rungs halves ride rides riding
    ridden hand hands handed bench wiped lean room rooms house door doors misfit misfits lent bent tasted lasting
    patient unsayable sayable unsaid spelt heeded bears borne bearable beside elsewhere nobody swelling mend mends
    mended leap leapt wholes what which whose why whether one many""".split()
)
IN_TEXTS = re.compile(
    r"\b(wanted|wants|is none|(?<!there )is no [a-z]+|are none|told|asked for|heeded|nobody|bears|meant)\b"
)
REMEDIES = "Add|Choose|Give|Install|Keep|Leave|Name|Reduce|Remove|Run|Set|Start|Try|Use"
# a message is "FAULT; expected ..., REMEDY"
FULL_STOP = re.compile(rf"\. (Expected (?!orders)|({REMEDIES}) )")
PUBLIC = frozenset({"what", "found", "told", "rungs", "kept", "why"})  # fields of JSON files
OPENINGS = re.compile(r"(What|Which|Whether|That|As|The same)\b")


TESTS = Path(__file__).parents[1]
DEFINED = re.compile(r"^ *(?:def|class) (\w+)", re.MULTILINE)
PATHS = sorted(PACKAGE.rglob("*.py"))


@functools.cache
def package_words() -> dict[str, list[tuple[str, str]]]:
    """Identifiers, docstrings and other texts of all modules, each with its place."""
    lists: dict[str, list[tuple[str, str]]] = {"names": [], "docstrings": [], "texts": []}
    gc.disable()  # half of the time, with a million nodes
    try:
        for path in PATHS:
            nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
            for kind, listed in (
                ("names", names(nodes)),
                ("docstrings", docstrings(nodes)),
                ("texts", texts(nodes)),
            ):
                lists[kind] += [
                    (f"{path.relative_to(PACKAGE).as_posix()}:{line}", text)
                    for text, line in listed
                ]
    finally:
        gc.enable()
    return lists


def names(nodes: list[ast.AST]):
    """Identifiers that a module defines, with their lines."""
    for node in nodes:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno


@functools.cache
def words(name: str) -> set[str]:
    return set(re.findall(r"[a-z]+", re.sub(r"([A-Z])", r"_\1", name).lower()))


def docstrings(nodes: list[ast.AST]):
    for node in nodes:
        if isinstance(node, (ast.Module, ast.FunctionDef, ast.ClassDef)) and (
            text := ast.get_docstring(node)
        ):
            yield text, getattr(node, "lineno", 1)


def texts(nodes: list[ast.AST]):
    """String constants with a blank except docstrings: messages, help, descriptions."""
    own = {
        id(node.body[0].value)
        for node in nodes
        if isinstance(node, (ast.Module, ast.FunctionDef, ast.ClassDef))
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in nodes:
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and " " in node.value
            and id(node) not in own
        ):
            yield node.value, node.lineno


def test_no_identifier_has_a_forbidden_word():
    wrong = [
        (place, name)
        for place, name in package_words()["names"]
        if words(name) & IN_NAMES and name not in PUBLIC
    ]
    assert wrong == [] and len(package_words()["names"]) > 10000


def test_no_module_has_a_forbidden_word_in_its_name():
    names = [path.relative_to(PACKAGE).as_posix() for path in PATHS]
    assert [name for name in names if words(name) & IN_NAMES] == []


def test_no_test_nor_helper_of_tests_has_a_forbidden_word_in_its_name():
    """The names of test modules, of tests and of the functions and classes that they share."""
    paths = sorted(TESTS.rglob("*.py"))
    defined = [
        (path, name) for path in paths for name in DEFINED.findall(path.read_text(encoding="utf-8"))
    ]
    listed = [
        (path.relative_to(TESTS).as_posix(), name)
        for path, name in defined + [(one, one.stem) for one in paths]
    ]
    assert len(listed) > 5000
    assert [(place, name) for place, name in listed if words(name) & IN_NAMES] == []


def test_no_message_nor_help_has_a_forbidden_word():
    assert [
        (place, text) for place, text in package_words()["texts"] if IN_TEXTS.search(text)
    ] == []


def test_an_expectation_or_a_remedy_follows_its_fault_in_the_same_sentence():
    assert [
        (place, text) for place, text in package_words()["texts"] if FULL_STOP.search(text)
    ] == []


def test_no_docstring_begins_with_a_relative_clause():
    assert [
        (place, text) for place, text in package_words()["docstrings"] if OPENINGS.match(text)
    ] == []


def doubles(sources: dict[str, str]) -> dict[str, list[str]]:
    """Names of classes that several sources define, with these sources.

    Only sources with a name that follows `class` in several of them are parsed.
    """
    named = {home: set(re.findall(r"\bclass\s+(\w+)", text)) for home, text in sources.items()}
    often = Counter(name for names in named.values() for name in names)
    homes = defaultdict(list)
    for home, text in sources.items():
        for one in (
            ast.walk(ast.parse(text)) if any(often[name] > 1 for name in named[home]) else ()
        ):
            if isinstance(one, ast.ClassDef):
                homes[one.name].append(home)
    return {name: repeated for name, repeated in homes.items() if len(set(repeated)) > 1}


def test_a_class_name_is_used_once():
    top = Path(fvsolve.__file__).parent
    repeated = doubles(
        {str(path.relative_to(top)): path.read_text(encoding="utf-8") for path in top.rglob("*.py")}
    )
    assert not repeated


def test_a_double_is_seen():
    assert doubles({"a": "class One: pass", "b": "class Two: pass\nclass One: pass"}) == {
        "One": ["a", "b"]
    }
