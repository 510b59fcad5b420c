"""Commands of other packages: found by entry points or a variable, imported at their use, without harm to others."""

import re

import pytest
from reference.outside_packages import install, python

from fvsolve import cli
from fvsolve.declarations import headers

FLUSH = '''"""Command of another package."""

print("imported")


def flush(case: str, times: int = 1) -> None:
    """Flush the pipes of a case."""
    print("flushed", case, times)


def fails(case: str) -> None:
    raise IndexError(f"no pipe in {case}")


def unread(case: int | str) -> None:
    """Argument of a type that typer does not read."""
'''
PLACES = {
    "flush": "mill.flush:flush",
    "fails": "mill.flush:fails",
    "unread": "mill.flush:unread",
    "lost": "mill.lost:lost",
    "run": "mill.flush:flush",
}


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    files = {"mill/__init__.py": "", "mill/flush.py": FLUSH}
    return install(tmp_path_factory.mktemp("mill"), "mill", files, {"fvsolve.commands": PLACES})


def fvsolve(home, *words: str, code: int = 0, **environment: str) -> tuple[str, str]:
    done = python(home, "-m", "fvsolve", *words, code=code, **environment)
    return done.stdout, done.stderr


def test_the_help_lists_a_command_of_another_package_without_its_import(home):
    text, warning = fvsolve(home, "--help")
    assert re.search(
        r"\n  validate .*\n(.*\n)*  fails *\n  flush +Flush the pipes of a case.\n  lost", text
    )
    assert "imported" not in text and text.count("\n  run ") == 1
    source = "run of the entry points fvsolve.commands of mill: mill.flush:flush"
    fault = 'a declaration of the command "run" exists already; expected another name'
    assert warning == f"{source} cannot be read: {fault}; correct or remove it\n"


def test_a_command_of_another_package_runs(home):
    assert (
        fvsolve(home, "flush", "two-tanks", "--times", "3")[0] == "imported\nflushed two-tanks 3\n"
    )
    assert "Flush the pipes of a case." in fvsolve(home, "flush", "--help")[0]


def test_a_command_that_cannot_be_read_names_its_package(home):
    for name, fault in (("lost", "No module named 'mill.lost'"), ("unread", ".*Union.*")):
        _, problem = fvsolve(home, name, "a", code=2)
        place = re.escape(PLACES[name])
        pattern = f"{name} of the entry points fvsolve.commands of mill: {place} cannot be read: {fault}; correct or"
        assert re.search(pattern, problem.splitlines()[-1])


def test_a_defect_of_another_package_is_reported_to_its_authors(home):
    _, problem = fvsolve(home, "fails", "a", code=1)
    assert problem.splitlines()[-1].startswith(
        "fails of the entry points fvsolve.commands of mill: internal error in "
    )
    assert problem.endswith("IndexError: no pipe in a; please report it to its authors\n")


def test_an_unknown_command_is_compared_with_those_of_other_packages(home):
    _, problem = fvsolve(home, "flsh", code=2)
    assert "Did you mean 'flush'" in problem and problem.count("mill.lost:lost cannot be read") == 1


def test_a_built_in_command_reads_no_other_package(home):
    assert "imported" not in "".join(fvsolve(home, "list"))
    assert fvsolve(home, "list")[1] == ""


def test_files_of_a_user_declare_commands(home):
    text = (
        'from fvsolve.cli.app import command\n@command("drain")\ndef empty(case: '
        'str) -> None:\n    print("drained")\n'
    )
    (home / "drain.py").write_text(text, encoding="utf-8")
    assert fvsolve(home, "drain", "a", FVSOLVE_COMMANDS="drain.py")[0] == "drained\n"
    assert "\n  drain\n" in fvsolve(home, "--help", FVSOLVE_COMMANDS="drain.py")[0]


def test_every_command_of_the_package_has_its_own_name_order_and_help():
    names = [match["name"] for _, match in headers(("cli/*.py",), cli.HEADER)]
    declared = [*cli.COMMANDS.own().values()]
    assert sorted(names) == sorted(info.name for info in cli.application().registered_commands)
    assert len({*names}) == len(names) == len({found.options["order"] for found in declared})
    assert all(found.options["help"] for found in declared)
    assert [*cli.COMMANDS][:3] == ["run", "check", "list"]
