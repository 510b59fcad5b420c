"""Typer application, options common to all commands, and the reading of a case."""

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


def _version(requested: bool) -> None:
    if requested:
        import fvsolve

        print(f"fvsolve {fvsolve.__version__}")
        raise typer.Exit


@app.callback()
def all_commands(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Hydraulic transients by finite volumes: a TOML file in; pressures, flows and fields out."""


Cases = Annotated[list[str], typer.Argument(metavar="CASE", help="a case file, or the name of a shipped case")]
SingleCase = Annotated[str, typer.Argument(metavar="CASE", help="a case file, or the name of a shipped case")]
Set = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="new value of a key of the case, for example links.main.cells=400; repeat the option for more keys",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output instead of text")]


def load_case(name: str, overrides: list[str], scheme: str | None = None, method: str | None = None):
    """Read a case and apply the overrides. Raises CaseError with all faults of the case and of the overrides.

    Raises FvsolveError if there is neither a file nor a shipped case `name`.
    scheme, method : names for a study, separated by commas, or None. If the case is invalid with its own scheme and
        method, it is read with the first of these names: the overrides may be valid only with these.
    """
    from fvsolve.case import load, shipped

    path = shipped.find(name)
    _announce_compilation()
    settings, faults = _overrides(overrides)
    try:
        case = load(path, settings)
    except CaseError as error:
        from fvsolve.cli.study_options import comma_list, method_names

        given = {"scheme": comma_list(scheme), "method": method_names(method)}
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
def _announce_compilation() -> None:
    from fvsolve.jit import is_cold, other_caches

    if is_cold():
        text = "the first run on this machine compiles the solver (about 10 to 30 s); later runs reuse the result"
        other = other_caches()
        print(f"fvsolve: {text}{f'; {other}' if other else ''}", file=sys.stderr)


def _overrides(texts: list[str]) -> tuple[dict, list[Fault]]:
    settings, faults = {}, []
    for text in texts:
        key, equals, value = text.partition("=")
        if not (equals and key.strip()):
            faults.append(Fault(text, "expected KEY=VALUE, for example links.main.cells=400", override=True))
        else:
            settings[key.strip()] = value_of(value)
    return settings, faults


def value_of(text: str):
    """Parse `400`, `true`, `[1, 2]` and `{ a = 1 }` as TOML values; any other text is returned as text."""
    import tomllib

    try:
        parsed = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return parsed["value"] if parsed.keys() == {"value"} else text.strip()


def print_json(data) -> None:
    """Print one JSON object on standard output, with unrounded numbers."""
    from fvsolve.output.summary_file import plain

    print(json.dumps(plain(data), allow_nan=False))
