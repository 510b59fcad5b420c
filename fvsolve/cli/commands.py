"""The commands and their options. Knows what is asked; leaves the work to `run` and the words to `report`."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.errors import CaseError, Fault, FvsolveError
from fvsolve.output.summary import plain

app = typer.Typer(
    help="Hydraulic transients by finite volumes: a TOML file in; pressures, flows and fields out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Cases = Annotated[list[str], typer.Argument(metavar="CASE", help="a case file, or the name of a shipped case")]
One = Annotated[str, typer.Argument(metavar="CASE", help="a case file, or the name of a shipped case")]
Set = Annotated[list[str], typer.Option("--set", metavar="KEY=VALUE", help="override a key: links.main.cells=400")]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on standard output, nothing else there")]


@app.command()
def run(
    cases: Cases,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="run directory (default runs/NAME)")] = None,
    set: Set = [],  # noqa: B006
    resume: Annotated[bool, typer.Option("--resume", help="go on from the last checkpoint")] = False,
    force: Annotated[bool, typer.Option("--force", help="replace an earlier run")] = False,
    as_json: Json = False,
) -> None:
    """Solve cases and write their run directories."""
    from fvsolve.cli import report
    from fvsolve.cli.progress import watched
    from fvsolve.run import run as solve

    results = []
    for name, place in _places(cases, out).items():
        case = _load(name, set)
        with watched(case) as progress:
            results.append(solve(case, out=place, force=force, resume=resume, progress=progress))
        if not as_json:
            report.result(results[-1])
        if results[-1].reason.startswith("interrupted"):
            break
    if as_json:
        said = [one.summary | {"directory": str(one.directory)} for one in results]
        _json(said[0] if len(cases) == 1 else {"runs": said})
    sys.exit(max(report.exit_code(one) for one in results))


@app.command()
def check(case: One, set: Set = [], as_json: Json = False) -> None:  # noqa: B006
    """What was understood of a case, how it starts, what it will cost."""
    from fvsolve.cli import report
    from fvsolve.run import model_of

    model = model_of(_load(case, set))
    if as_json:
        _json(model.checks)
    else:
        report.checks(model)


@app.command("list")
def list_cases(as_json: Json = False) -> None:
    """List the shipped cases."""
    from fvsolve.cli import report, shipped

    titles = shipped.titles()
    if as_json:
        _json(titles)
    else:
        report.titles(titles)


@app.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="a shipped case, see `fvsolve list`")],
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="default NAME.toml")] = None,
) -> None:
    """Copy a shipped case and the files it uses."""
    from fvsolve.cli import shipped

    for path in shipped.copy(name, file or Path(f"{name}.toml")):
        print(path)


@app.command()
def schema() -> None:
    """Print the JSON schema of a case file."""
    from fvsolve.case import schema

    print(json.dumps(schema(), indent=2))


@app.command()
def methods(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="all methods by default")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="of NAME's picture (default NAME.png)")] = None,
    as_json: Json = False,
) -> None:
    """Runge-Kutta methods: order, stability, cost; of one NAME its tableau, R(s) and stability region too."""
    from fvsolve.cli import methods

    if name is None and out is not None:
        raise FvsolveError("--out is for the picture of one method; give its NAME")
    said = methods.table() if name is None else methods.one(name, out)
    if as_json:
        _json(said.plain)
    else:
        said.show()


@app.command()
def compare(
    run_a: Annotated[Path, typer.Argument(metavar="RUN_A")],
    run_b: Annotated[Path, typer.Argument(metavar="RUN_B")],
    as_json: Json = False,
) -> None:
    """Differences of two runs, per shared probe."""
    from fvsolve.cli import report
    from fvsolve.run import open_run
    from fvsolve.run.comparison import differences

    found = differences(open_run(run_a), open_run(run_b))
    if as_json:
        _json(found)
    else:
        report.differences(found)


@app.command()
def view(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    time: Annotated[str | None, typer.Option(metavar="T", help='"1.2 s"; the last frame by default')] = None,
    field: Annotated[str, typer.Option(help="pressure, head, velocity, flow, ...")] = "pressure",
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="default RUN/FIELD.png")] = None,
) -> None:
    """Draw a field at a time, off screen, with PyVista."""
    from fvsolve.run import open_run
    from fvsolve.units import parse

    try:
        when = None if time is None else parse(_value(time), "time")
    except ValueError as error:
        raise FvsolveError(f"--time: {error}") from None
    print(open_run(directory).view(when, field, out))


def _places(cases: list[str], out: Path | None) -> dict[str, Path]:
    """Case -> its run directory; FvsolveError where two would have the same one."""
    from fvsolve.cli import shipped

    found, taken = {}, {}
    for name in cases:
        stem = shipped.find(name).stem
        place = out if out and len(cases) == 1 else (out or Path("runs")) / stem
        other = taken.setdefault(os.path.normcase(place), name)
        if name in found or other != name:
            twice = f"{name} is named twice" if other == name else f"{other} and {name} would both write {place}"
            raise FvsolveError(f"{twice}; run one at a time, each with an --out DIR of its own, or rename one")
        found[name] = place
    return found


def _load(name: str, overrides: list[str]):
    """The case, overridden; an override that is none is one more fault of it."""
    from fvsolve.case import load
    from fvsolve.cli import shipped

    path = shipped.find(name)
    settings, faults = _overrides(overrides)
    try:
        case = load(path, settings)
    except CaseError as error:
        raise CaseError([*error.faults, *faults], error.file) if faults else error from None
    if faults:
        raise CaseError(faults, path.name)
    return case


def _overrides(texts: list[str]) -> tuple[dict, list[Fault]]:
    found, faults = {}, []
    for text in texts:
        key, equals, value = text.partition("=")
        if equals and key.strip():
            found[key.strip()] = _value(value)
        else:
            faults.append(Fault(text, "wanted KEY=VALUE, for example links.main.cells=400", override=True))
    return found, faults


def _value(text: str):
    """`400`, `true`, `[1, 2]` and `{ a = 1 }` as TOML reads them; everything else is text."""
    import tomllib

    try:
        read = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return read["value"] if read.keys() == {"value"} else text.strip()


def _json(data) -> None:
    print(json.dumps(plain(data), allow_nan=False))
