"""Typer application, arguments and options common to several commands, and the reading of a case."""

import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from fvsolve.declarations import Declaration, unreadable
from fvsolve.errors import CaseError, Fault, FvsolveError

app = typer.Typer(
    help="Hydraulic transients by finite volumes: a TOML file in; pressures, flows and fields out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Cases = Annotated[
    list[str], Argument(metavar="CASE", help="a case file, or the name of a shipped case")
]
SingleCase = Annotated[
    str, Argument(metavar="CASE", help="a case file, or the name of a shipped case")
]
RunDirectory = Annotated[Path, Argument(metavar="RUN", help="a run directory")]
Set = Annotated[
    list[str],
    Option(
        "--set",
        metavar="KEY=VALUE",
        help="new value of a key of the case, for example links.main.cells=400; repeat the option for more keys",
    ),
]
Json = Annotated[
    bool, Option("--json", help="print one JSON object on standard output instead of text")
]
Out = Annotated[
    Path | None,
    Option(
        metavar="DIR",
        help="folder of tables and pictures (default runs/NAME.COMMAND, such as runs/main.sweep)",
    ),
]
Jobs = Annotated[int, Option(metavar="N", help="number of runs at a time, each in its own process")]
Dask = Annotated[
    str | None,
    Option(
        metavar="ADDRESS",
        help="address of a Dask scheduler whose workers make the runs, for example tcp://10.0.0.1:8786",
    ),
]
Seed = Annotated[int, Option(metavar="N", help="seed of the random samples")]
AtTime = Annotated[
    str | None,
    Option(
        metavar="T",
        help='time of the state about which the case is linearised: seconds, or "20 ms" (default start of the run)',
    ),
]
BeforeJump = Annotated[
    bool,
    Option(
        "--left-limit",
        help="if a schedule has a kink or jump at the time --at, use its values just before",
    ),
]
LinearScheme = Annotated[
    str | None,
    Option(
        metavar="NAME",
        help="linear scheme, for example upwind5 (default scheme of the case, if it is linear)",
    ),
]


def _version(requested: bool) -> None:
    if requested:
        import fvsolve

        print(f"fvsolve {fvsolve.__version__}")
        raise typer.Exit


@app.callback()
def all_commands(
    version: Annotated[
        bool,
        Option("--version", callback=_version, is_eager=True, help="print the version and exit"),
    ] = False,
) -> None:
    """Hydraulic transients by finite volumes: a TOML file in; pressures, flows and fields out."""


def command(name: str, order: int = 0) -> Callable:
    """Decorator that adds a command to the application. It is a header: fvsolve.cli reads its text.

    order : number by which the help sorts the commands of fvsolve; those of others follow by name
    """
    return app.command(name)


def add_command(found: Declaration) -> None:
    """Import the module of a command, whose header adds it to the application; add that of another package.

    Raises FvsolveError if a command of another package cannot be imported, or is no function for typer.
    """
    function = found.load()
    if not found.source:
        return
    try:
        trial = typer.Typer(add_completion=False)
        trial.command(found.name)(function)
        typer.main.get_command(trial)
    except Exception as error:  # of typer, about the arguments of the function
        raise FvsolveError(unreadable(found.source, found.place, error)) from error
    app.command(found.name)(function)


def load_case(
    name: str, overrides: list[str], scheme: str | None = None, method: str | None = None
):
    """Read a case and apply the overrides. Raises CaseError with all faults of the case and of the overrides.

    Raises FvsolveError if there is neither a file nor a shipped case `name`.
    scheme, method : names for a study, separated by commas, or None. If the case is invalid with its own scheme and
        method, it is read with the first of these names: the overrides may be valid only with these.
    """
    from fvsolve.case import load, shipped

    path = shipped.find(name)
    announce_compilation()
    settings, faults = _overrides(overrides)
    try:
        case = load(path, settings)
    except CaseError as error:
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
def announce_compilation() -> None:
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
            faults.append(
                Fault(text, "expected KEY=VALUE, for example links.main.cells=400", override=True)
            )
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


def quantity_of(text: str | None, dimension: str, label: str) -> float | None:
    """Value [SI] of a text in the format of a case file, such as "20 ms"; None for None.

    label : option with the text, for the message. Raises FvsolveError for any other text.
    """
    from fvsolve.units import parse

    try:
        return None if text is None else parse(value_of(text), dimension)
    except ValueError as error:
        raise FvsolveError(f"{label}: {error}") from None


def comma_list(text: str | None, option: str = "") -> list[str] | None:
    """Words of a list `a,b,c`, without duplicates; None for None. Raises FvsolveError for a list without words.

    option : name of the option, for the message
    """
    if text is None:
        return None
    words = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if not words:
        raise FvsolveError(
            f'{option} "{text}" is an empty list; expected names or numbers separated by commas'
        )
    return words


def method_names(text: str | None) -> list[str] | None:
    """Names of the methods in a list `A,B`; None for None.

    A word may also be the path of a tableau file, see `method_name`.
    """
    names = comma_list(text, "--method")
    return None if names is None else [method_name(name) for name in names]


def method_name(word: str) -> str:
    """Name of a method. If the word is the path of a tableau file, register it as a method named after the file."""
    from fvsolve.core.steppers.tableau import METHODS, method_of_file

    path = Path(word)
    return word if word in METHODS or not path.is_file() else method_of_file(path).name


def folder_of(case, study: str, out: Path | None) -> Path:
    """Create and return the folder for the files of a study: `out`, or runs/NAME.STUDY if `out` is None."""
    return writable_folder(out or Path("runs") / f"{case.name}.{study}")


def warn_replaced(folder: Path, name: str) -> None:
    """Print a notice that an earlier result will be replaced, if the folder contains the file `name`."""
    if (folder / name).exists():
        print(
            f"{folder}: the results of an earlier command are replaced; to keep them, use --out DIR",
            file=sys.stderr,
        )


def clear_files(folder: Path, *patterns: str) -> Path:
    """Delete the files in a folder that match glob patterns, left by an earlier command; returns the folder."""
    for path in [file for pattern in patterns for file in folder.glob(pattern)]:
        path.unlink()
    return folder


def writable_folder(folder: Path) -> Path:
    """Create the folder and return it. Raises FvsolveError if it is not writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = f"{folder}: cannot be written: {error.strerror or error}"
        raise FvsolveError(f"{text}; use another directory with --out DIR") from None
    if not os.access(folder, os.W_OK):
        raise FvsolveError(
            f"{folder}: cannot be written: permission denied; use another directory with --out DIR"
        )
    return folder
