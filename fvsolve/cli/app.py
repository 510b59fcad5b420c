"""What all commands share: the application, their common options, how a case is read. Knows no command."""

from __future__ import annotations

import functools
import json
import sys
from typing import Annotated

import typer

from fvsolve.errors import CaseError, Fault

app = typer.Typer(
    help="Hydraulic transients by finite volumes: a TOML file in; pressures, flows and fields out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(asked: bool) -> None:
    if asked:
        import fvsolve

        print(f"fvsolve {fvsolve.__version__}")
        raise typer.Exit


@app.callback()
def all_commands(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version and leave")
    ] = False,
) -> None:
    """Hydraulic transients by finite volumes: a TOML file in; pressures, flows and fields out."""


Cases = Annotated[list[str], typer.Argument(metavar="CASE", help="a case file, or the name of a shipped case")]
One = Annotated[str, typer.Argument(metavar="CASE", help="a case file, or the name of a shipped case")]
Set = Annotated[list[str], typer.Option("--set", metavar="KEY=VALUE", help="override a key: links.main.cells=400")]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on standard output, nothing else there")]


def load_case(name: str, overrides: list[str], scheme: str | None = None, method: str | None = None):
    """The case, overridden; an override that is none is one more fault of it.

    scheme, method : lists that a study takes in place of the case's; what is no case with its own is read with their
    first, to which the overrides may belong
    """
    from fvsolve.case import load, shipped

    path = shipped.find(name)
    _tell_of_compiling()
    settings, faults = _overrides(overrides)
    try:
        case = load(path, settings)
    except CaseError as error:
        from fvsolve.cli.studying import listed, methods_of

        given = {"scheme": listed(scheme), "method": methods_of(method)}
        first = {f"numerics.{key}": names[0] for key, names in given.items() if names}
        if first and not faults:
            try:
                return load(path, first | settings)
            except CaseError:
                pass
        raise CaseError([*error.faults, *faults], error.file) if faults else error from None
    if faults:
        raise CaseError(faults, path.name)
    return case


@functools.cache
def _tell_of_compiling() -> None:
    from fvsolve.jit import cold, elsewhere

    if cold():
        said = "the first run on this machine compiles the solver, some 10 to 30 s; once, it is kept for all later runs"
        other = elsewhere()
        print(f"fvsolve: {said}{f'; {other}' if other else ''}", file=sys.stderr)


def _overrides(texts: list[str]) -> tuple[dict, list[Fault]]:
    found, faults = {}, []
    for text in texts:
        key, equals, value = text.partition("=")
        if not (equals and key.strip()):
            faults.append(Fault(text, "wanted KEY=VALUE, for example links.main.cells=400", override=True))
        else:
            found[key.strip()] = value_of(value)
    return found, faults


def value_of(text: str):
    """`400`, `true`, `[1, 2]` and `{ a = 1 }` as TOML reads them; everything else is text."""
    import tomllib

    try:
        read = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return read["value"] if read.keys() == {"value"} else text.strip()


def print_json(data) -> None:
    """One object on standard output, numbers unrounded."""
    from fvsolve.output.summary import plain

    print(json.dumps(plain(data), allow_nan=False))
