"""Commands import only what they use, and print the same as the libraries that they do without."""

import contextlib
import gc
import io
import subprocess
import sys

import pytest
from rich.console import Console

from fvsolve import cli
from fvsolve.cli import terminal
from fvsolve.core.output.result_table import ResultTable


def imported(*words: str) -> set[str]:
    """Names of the modules that a command imports."""
    code = (
        "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr)); "
        f"sys.argv = ['fvsolve', *{words!r}]; from fvsolve.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8")
    return set(done.stderr.splitlines()[-1].split())


@pytest.mark.parametrize("words", [["--version"], ["--help"]], ids=" ".join)
def test_version_and_help_need_no_arrays_and_no_parts(words):
    assert not imported(*words) & {
        "numpy",
        "pydantic",
        "rich",
        "fvsolve.case",
        "fvsolve.parts",
        "fvsolve.core.steppers",
    }


def test_a_run_imports_only_the_kinds_of_its_case(tmp_path):
    words = "run", "two-tanks", "--no-pictures", "--out", str(tmp_path / "run")
    imported(*words)  # compiles what no test before has compiled
    modules = imported(*words)
    assert {"fvsolve.parts.tank", "llvmlite.binding"} <= modules
    others = (
        "parts.basin",
        "parts.body",
        "parts.rotation",
        "parts.control",
        "parts.reaction",
        "parts.outlet.part",
        "case.schema",
        "output.several_sinks",
        "studies",
    )
    assert not modules & {f"fvsolve.{name}" for name in others}
    assert not modules & {"numba", "CoolProp", "meshio", "rich", "matplotlib", "numpy.random"}


@pytest.mark.parametrize(
    "words", [["run", "two-tanks", "--no-pictures"], ["run", "--nonsense"], ["run", "nowhere"]]
)
def test_unused_objects_are_collected_after_the_start(words, fvs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fvs(*words)
    assert gc.isenabled()


def test_the_overview_is_the_help_of_all_commands(monkeypatch):
    texts = []
    for application in (cli.overview(), cli.application()):
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
            application(["--help"], prog_name="fvsolve")
        texts.append(out.getvalue())
    assert texts[0] == texts[1] and all(f"\n  {command} " in texts[0] for command in cli.COMMANDS)


def by_rich(table: ResultTable) -> str:
    """Lines of a table as rich prints them."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        Console(width=terminal.WIDTH, no_color=True).print(terminal._grid(table))
    return out.getvalue()


@pytest.mark.parametrize(
    "headers, rows",
    [
        (
            ["probe", "unit", "maximum"],
            [["gate.pressure", "Pa", "1.07e+06"], ["[b]valve[/b]", "m3/s", "-"]],
        ),
        (["a", ""], [["1", ""], ["", "x"]]),
        (["one"], []),
        (["a", "b"], [["two words", ":smile:"], ["nan", "5"]]),
        (["w" * 79, "w" * 79], [["1", "2"]]),
    ],
)
def test_lines_of_a_table_are_those_of_rich(headers, rows):
    table = ResultTable.of("", headers, rows)
    assert "\n".join(terminal.table_lines(table)) + "\n" == by_rich(table)


@pytest.mark.parametrize("cell", ["w" * 160, "Padé", "a\tb"])
def test_rich_prints_tables_that_are_too_wide_or_not_of_printable_ascii(cell, capsys):
    table = ResultTable.of("", ["a", "b"], [[cell, "1"]])
    assert terminal.table_lines(table) is None
    terminal.show([table])
    assert capsys.readouterr().out == by_rich(table)
