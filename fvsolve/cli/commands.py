"""Commands for runs, cases and methods. Knows what is asked; leaves the work to `run` and the words to `report`."""

from __future__ import annotations

import os
import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.cli.app import Cases, Json, One, Set, app, load_case, print_json, value_of
from fvsolve.errors import FvsolveError, visible


@app.command()
def run(
    cases: Cases,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="run directory (default runs/NAME)")] = None,
    set: Set = [],  # noqa: B006
    resume: Annotated[bool, typer.Option("--resume", help="go on from the last checkpoint")] = False,
    force: Annotated[bool, typer.Option("--force", help="replace an earlier run")] = False,
    threads: Annotated[int, typer.Option(metavar="N", help="that share out rows of basins")] = 1,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="numbers alone")] = False,
    error: Annotated[
        bool, typer.Option("--error", help="how far peaks are off, by runs of half and twice the resolution")
    ] = False,
    as_json: Json = False,
) -> None:
    """Solve cases and write their run directories."""
    from fvsolve.draw.beside import Painter

    results = []
    with Painter(beside=not no_pictures) as painter:  # before anything else is fetched
        from fvsolve.cli import report
        from fvsolve.run import model_of, ranks

        if ranks.follows():
            painter.end()
            for name in dict.fromkeys(cases):
                ranks.follow(lambda name=name: model_of(load_case(name, set)))
            sys.exit(0)
        with ranks.leading(ranks.world()):
            places = _places(cases, out)
        for name, place in places.items():
            with ranks.leading(ranks.world()):
                model = model_of(load_case(name, set))
            results.append(_run(model, place, force, resume, threads, None if no_pictures else painter, as_json, error))
            if results[-1].reason.startswith("interrupted"):
                break
    if as_json:
        said = [one.summary | {"directory": str(one.directory)} for one in results]
        print_json(said[0] if len(cases) == 1 else {"runs": said})
    sys.exit(max(report.exit_code(one) for one in results))


def _run(model, place: Path, force: bool, resume: bool, threads: int, painter, quiet: bool, error: bool):
    """Solve one case and say what came out, then draw it."""
    from fvsolve.cli import report
    from fvsolve.cli.progress import watched
    from fvsolve.run import draw, sink_of, solved
    from fvsolve.run.expected import expected

    if said := expected(model):
        print(visible(said), file=sys.stderr, flush=True)
    with closing(sink_of(model, place, force, resume, threads)) as sink:
        with watched(model.case) as progress:
            result = solved(model, sink, progress, threads)
        if error:
            _judge(result, model.case)
        if not quiet:
            report.result(result)
            sys.stdout.flush()
        if painter is not None:
            draw(result, painter)
    if not quiet:
        report.files(result)
    return result


def _judge(result, case) -> None:
    """How far the peaks of a run are off, into its summary."""
    from fvsolve.output.summary import write_summary
    from fvsolve.studies.peaks import peak_errors

    peak_errors(result, case, lambda what: print(f"{case.name} again: {what}", file=sys.stderr, flush=True))
    write_summary(result.directory / "summary.json", result.summary)


@app.command()
def check(
    case: One,
    set: Set = [],  # noqa: B006
    every: Annotated[bool, typer.Option("--all", help="all rows of long tables")] = False,
    as_json: Json = False,
) -> None:
    """What was understood of a case, how it starts, what it will cost."""
    from fvsolve.cli import report
    from fvsolve.limits.step import step_limits
    from fvsolve.run import model_of
    from fvsolve.solve.bands import shared

    model = model_of(load_case(case, set))
    found = model.checks
    found["warnings"] += [one.plain() for one in step_limits(model)]
    found["threads"] = shared(model)
    if as_json:
        print_json(found)
    else:
        report.checks(model.case, found, every)


@app.command("list")
def list_cases(as_json: Json = False) -> None:
    """List the shipped cases."""
    from fvsolve.case import shipped
    from fvsolve.cli import report

    titles = shipped.titles()
    if as_json:
        print_json(titles)
    else:
        report.titles(titles)


@app.command()
def new(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="a shipped case, see `fvsolve list`")] = None,
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="default NAME.toml")] = None,
    source: Annotated[Path | None, typer.Option("--from", metavar="NET.inp", help="an EPANET network")] = None,
    hour: Annotated[float | None, typer.Option(metavar="H", help="of EPANET's run (default 0)")] = None,
    wave_speed: Annotated[str | None, typer.Option(metavar="A", help='of all pipes (default "1200 m/s")')] = None,
    shortest: Annotated[str | None, typer.Option(metavar="L", help="make shorter pipes as long, as cells want")] = None,
) -> None:
    """Copy a shipped case and the files it uses; or with --from write the case NAME of an EPANET network."""
    from fvsolve.case import copying
    from fvsolve.cli import imported

    if source is not None:
        imported.write(source, name, file, hour, wave_speed, shortest)
        return
    if name is None or hour is not None or wave_speed is not None or shortest is not None:
        raise FvsolveError("fvsolve new NAME copies a shipped case, fvsolve new --from NET.inp [--hour H] imports one")
    for path in copying.copy(name, file or Path(f"{name}.toml")):
        print(path)


@app.command()
def schema() -> None:
    """Print the JSON schema of a case file."""
    from fvsolve.case.schema import printed
    from fvsolve.case.schema import schema as made

    print(printed(made()))


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
        print_json(said.plain)
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

    one = open_run(run_a)
    found = differences(one, open_run(run_b))
    if as_json:
        print_json(found)
    else:
        report.differences(found, one.summary)


@app.command()
def view(
    directory: Annotated[Path, typer.Argument(metavar="RUN", help="a run directory")],
    time: Annotated[str | None, typer.Option(metavar="T", help='"1.2 s"; the last frame by default')] = None,
    field: Annotated[str | None, typer.Option(help="pressure, head, velocity, flow, depth, a scalar, ...")] = None,
    contours: Annotated[int, typer.Option(metavar="N", min=0, max=100, help="lines of equal values")] = 0,
    animate: Annotated[Path | None, typer.Option(metavar="FILE", help="all frames, as .gif or .mp4")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="default RUN/view-FIELD.png")] = None,
) -> None:
    """Draw a field at a time, or all times, off screen, with PyVista."""
    from fvsolve.run import open_run
    from fvsolve.units import parse

    try:
        when = None if time is None else parse(value_of(time), "time")
    except ValueError as error:
        raise FvsolveError(f"--time: {error}") from None
    if animate is not None and not time is out is None:
        raise FvsolveError("--animate draws all times into its own file; leave --time and --out out")
    run = open_run(directory)
    print(run.view(when, field, out, contours) if animate is None else run.animate(animate, field, contours))


def _places(cases: list[str], out: Path | None) -> dict[str, Path]:
    """Case -> its run directory; FvsolveError where two would have the same one."""
    from fvsolve.case import shipped

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
