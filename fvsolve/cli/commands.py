"""Commands for runs, cases and methods."""

import math
import os
import re
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fvsolve.cli.app import Cases, Json, RunDirectory, Set, SingleCase, app, load_case, method_name, quantity_of
from fvsolve.cli.terminal import TextTable, present, print_json, show
from fvsolve.errors import FvsolveError, visible
from fvsolve.steppers import METHODS, Facts, Method, analyse, method_named
from fvsolve.steppers.numbers.polynomial import Polynomial, sign

PICTURES = (".png", ".svg", ".pdf")
MAX_ENTRY = 28  # greatest length of a tableau entry that is printed in full, in characters
SHORT_DIGITS = 14  # digits printed of a longer entry
MAX_COEFFICIENT = 40  # greatest length of a coefficient of R that is printed exactly, in characters


def single_method(name: str, out: Path | None) -> tuple[dict, Iterator]:
    """Tableau, stability function R(s) and properties of a method : (values for JSON, text).

    It writes a picture of the stability region to the file `out`, by default NAME.png.
    """
    from fvsolve.draw.stability_pictures import region_figure

    name = method_name(name)
    method = method_named(name)
    facts = analyse(method)
    path = out or Path(f"{name}.png")
    if path.suffix.lower() not in PICTURES:
        raise FvsolveError(f"{path}: unknown type of picture. Expected a name that ends in {' or '.join(PICTURES)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    region_figure(facts.stability_function, f"{method.name}: |R(hλ)| ≤ 1").savefig(path)
    array = {"a": method.a, "b": method.b, "c": method.c, "error": method.error, "start_error": method.start_error}
    return facts.plain() | array | {"picture": str(path)}, _method_text(method, facts, path)


def _table_text(all_facts: dict[str, Facts]) -> Iterator:
    first = {name: facts for name, facts in all_facts.items() if name == facts.name}
    heads = ["method", "order", "error", "stage", "stages", "kind", "A", "L", "real", "imaginary", "SSP", "Padé"]
    rows = [
        [
            name, str(facts.order), str(facts.error_order) if facts.adaptive else "-", str(facts.stage_order),
            str(facts.stages), facts.kind, _yes(facts.a_stable), _yes(facts.l_stable), _length(facts.real_interval),
            _length(facts.imaginary_interval), _length(facts.ssp_radius),
            f"({facts.pade[0]}, {facts.pade[1]})" if facts.pade else "-",
        ]
        for name, facts in first.items()
    ]  # fmt: skip
    yield TextTable(heads, rows)
    yield ""
    for name, facts in all_facts.items():
        if name != facts.name:
            yield f"{name} is {facts.name}"
    yield "error: order of the embedded solution; stage: stage order; A, L: A-stable, L-stable; real, imaginary:"
    yield (
        "greatest stable |h lambda| on the axis; SSP: SSP radius, in Euler steps; "
        "Padé: degrees of numerator and denominator of R"
    )


def _method_text(method: Method, facts: Facts, path: Path) -> Iterator:
    yield f"{method.name} ({method.source})", "bold"
    yield ""
    yield from _tableau_lines(method)
    for name, (polynomial, near) in method.numbers.items():
        yield f"{name} = {near:.10g}, a root of {polynomial}"
    if method.start_weight is not None:
        yield f"embedded solution: f(t, y) has weight {method.start_weight}; other weights follow by quadrature"
    yield ""
    r = facts.stability_function
    up, down = _polynomial(r.numerator), _polynomial(r.denominator)
    yield f"R(s) = {up if r.denominator.degree == 0 else f'({up}) / ({down})'}"
    yield from _sentences(facts)
    yield f"stability region: {path}"


def _sentences(facts: Facts) -> list[str]:
    estimate = f"error estimate of order {facts.error_order}" if facts.adaptive else "no error estimate"
    kind = [f"{facts.stages} stages", facts.kind]
    kind += ["stiffly accurate"] if facts.stiffly_accurate else []
    kind += ["first rate same as last"] if facts.first_same_as_last else []
    sector = "no sector" if facts.angle is None else f"A(alpha) with alpha = {facts.angle:.8g} degrees"
    sentences = [
        f"order {facts.order}, {estimate}; stage order {facts.stage_order}",
        ", ".join(kind),
        f"A-stable: {_yes(facts.a_stable)}; L-stable: {_yes(facts.l_stable)}; "
        f"I-stable: {_yes(facts.i_stable)}; {sector}",
        f"stable on the real axis {_interval_text(facts.real_interval, '-', '')}, on the imaginary axis "
        f"{_interval_text(facts.imaginary_interval, '', 'i')}; SSP radius {_length(facts.ssp_radius, 13)}",
        f"R(s) - e^s = {facts.error_constant:.6g} s^{facts.stability_function.error_constant[0] + 1} + ...",
    ]
    if facts.pade:
        sentences.append(f"R is the Padé approximation of e^s of degrees {facts.pade[0]} over {facts.pade[1]}")
    if facts.digits:
        sentences.append(f"coefficients are used as published, with {facts.digits} digits")
    return sentences


def _interval_text(value: float, before: str, after: str) -> str:
    return "everywhere" if math.isinf(value) else "nowhere" if value == 0 else f"to {before}{value:.13g}{after}"


def _tableau_lines(method: Method) -> list[str]:
    """Lines of the tableau of a method in the notation of its source, in aligned columns; long decimals are cut off."""
    rows, width = [], method.stages
    for text in method.text.strip().splitlines():
        left, bar, right = text.partition("|")
        rows.append([left.strip(), *right.split()] if bar else [])
    rows = [[_entry(x) for x in row] + [""] * (width + 1 - len(row)) if row else [] for row in rows]
    wide = [max(len(row[i]) for row in rows if row) for i in range(width + 1)]
    lines = []
    for row in rows:
        cells = [x.ljust(w) for x, w in zip(row, wide, strict=True)] if row else ["-" * w for w in wide]
        lines.append(f"{cells[0]} | {'  '.join(cells[1:])}".rstrip() if row else f"{cells[0]}-+-{'--'.join(cells[1:])}")
    return lines


def _entry(text: str) -> str:
    if len(text) > MAX_ENTRY and re.fullmatch(r"-?[\d.]+", text):
        return text[: SHORT_DIGITS + 2] + "..."
    return text


def _polynomial(p: Polynomial) -> str:
    terms = []
    for k, x in enumerate(p.coefficients):
        if x == 0:
            continue
        power = "" if k == 0 else "s" if k == 1 else f"s^{k}"
        size = _number(abs(x))
        size = "" if size == "1" and power else size
        terms.append((" - " if sign(x) < 0 else " + ") + " ".join(word for word in (size, power) if word))
    text = "".join(terms)
    return text[3:] if text.startswith(" + ") else text.strip()


def _number(x) -> str:
    text = str(x)
    if len(text) > MAX_COEFFICIENT:
        return f"{float(x):.15g}"
    return f"({text})" if re.search(r".[-+]", text) else text


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _length(value: float, digits: int = 6) -> str:
    return "infinite" if math.isinf(value) else f"{value:.{digits}g}"


@app.command()
def run(
    cases: Cases,
    out: Annotated[Path | None, Option(metavar="DIR", help="run directory, or for several cases the folder of their "
        "run directories DIR/NAME (default runs/NAME)")] = None,
    set: Set = [],  # noqa: B006
    resume: Annotated[bool, Option("--resume", help="continue an interrupted run from its last checkpoint")] = False,
    force: Annotated[bool, Option("--force", help="replace an earlier run in the run directory")] = False,
    threads: Annotated[int, Option(metavar="N", help="number of threads that share the rows of basin cells")] = 1,
    no_pictures: Annotated[bool, Option("--no-pictures", help="write no pictures")] = False,
    estimate_error: Annotated[bool, Option("--estimate-error", help="estimate the errors of peaks, from further runs "
        "at half, one and twice the resolution")] = False,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Solve cases and write their run directories."""
    from fvsolve.draw.plot_process import PlotProcess

    results = []
    with PlotProcess(second_process=not no_pictures) as painter:  # its process starts before other modules are imported
        from fvsolve.cli import printing
        from fvsolve.run import model_of, mpi_run

        if mpi_run.is_other_rank():
            painter.end()
            for name in dict.fromkeys(cases):
                mpi_run.serve_rank(lambda name=name: model_of(load_case(name, set)))
            sys.exit(0)
        with mpi_run.rank_zero_first(mpi_run.world()):
            places = _places(cases, out)
        for name, place in places.items():
            with mpi_run.rank_zero_first(mpi_run.world()):
                model = model_of(load_case(name, set))
            results.append(
                _run(model, place, force, resume, threads, None if no_pictures else painter, as_json, estimate_error)
            )
            if results[-1].reason.startswith("interrupted"):
                break
    if as_json:
        summaries = [result.summary | {"directory": str(result.directory)} for result in results]
        print_json(summaries[0] if len(cases) == 1 else {"runs": summaries})
    sys.exit(max(printing.exit_code(result) for result in results))


def _run(model, place: Path, force: bool, resume: bool, threads: int, painter, quiet: bool, error: bool):
    """Solve a case, print its results, draw them, and return its `Result`.

    place : run directory; painter : `PlotProcess`, or None for no pictures; quiet : True to print no results
    error : True to estimate the errors of peaks; force, resume, threads : as for the command `run`
    """
    from fvsolve.cli import printing
    from fvsolve.cli.terminal import run_progress
    from fvsolve.run import draw, sink_of, solved

    if text := printing.cost_estimate(model):
        print(visible(text), file=sys.stderr, flush=True)
    with closing(sink_of(model, place, force, resume, threads)) as sink:
        with run_progress(model.case) as progress:
            result = solved(model, sink, progress, threads)
        if error:
            from fvsolve.output.summary_file import write_summary
            from fvsolve.studies.peak_error import peak_errors

            name = model.case.name
            peak_errors(result, model.case, lambda text: print(f"{name} again: {text}", file=sys.stderr, flush=True))
            write_summary(result.directory / "summary.json", result.summary)
        if not quiet:
            show(printing.result_text(result))
            sys.stdout.flush()
        if painter is not None:
            draw(result, painter)
    if not quiet:
        show(printing.files_text(result))
    return result


@app.command()
def check(
    case: SingleCase, set: Set = [],  # noqa: B006
    every: Annotated[bool, Option("--all", help="print all rows of long tables")] = False,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Print the contents of a case as read, its initial state and its expected cost."""
    from fvsolve.cli import printing
    from fvsolve.run import model_of
    from fvsolve.solve.partition import divisible_rows
    from fvsolve.step_limits.step_notices import step_limits

    model = model_of(load_case(case, set))
    report_data = model.checks
    report_data["warnings"] += [notice.plain() for notice in step_limits(model)]
    report_data["threads"] = divisible_rows(model)
    present(as_json, report_data, printing.check_text(model.case, report_data, every))


@app.command("list")
def list_cases(as_json: Json = False) -> None:
    """List the shipped cases."""
    from fvsolve.case import shipped

    titles = shipped.titles()
    present(as_json, titles, [TextTable(["case", "title"], [*titles.items()])])


@app.command()
def new(
    name: Annotated[str, Argument(metavar="NAME", help="a shipped case, see `fvsolve list`")],
    file: Annotated[Path | None, Argument(metavar="FILE", help="file to write (default NAME.toml)")] = None,
) -> None:
    """Copy a shipped case and the files it uses."""
    from fvsolve.case import load, shipped

    for path in shipped.copy(name, file or Path(f"{name}.toml"), load):
        print(path)


@app.command()
def schema() -> None:
    """Print the JSON schema of a case file."""
    from fvsolve.case.schema import schema as made
    from fvsolve.case.schema import schema_text

    print(schema_text(made()))


@app.command()
def methods(
    name: Annotated[str | None, Argument(metavar="NAME", help="name of a method, or file of its tableau (default all "
        "methods)")] = None,
    out: Annotated[Path | None, Option(metavar="FILE", help="picture file of the stability region of NAME: .png, "
        ".svg or .pdf (default NAME.png)")] = None,
    as_json: Json = False,
) -> None:  # fmt: skip
    """List Runge-Kutta methods: order, stability, cost. With NAME show its tableau, R(s) and stability region."""
    if name is None and out is not None:
        raise FvsolveError("--out is valid for a single method only. Add the NAME of the method")
    if name is not None:
        return present(as_json, *single_method(name, out))
    all_facts = {name: analyse(method) for name, method in METHODS.items()}
    present(as_json, {name: facts.plain() for name, facts in all_facts.items()}, _table_text(all_facts))


@app.command()
def compare(
    run_a: Annotated[Path, Argument(metavar="RUN_A", help="run directory, as written by fvsolve run --out")],
    run_b: Annotated[Path, Argument(metavar="RUN_B", help="run directory that is compared with RUN_A")],
    as_json: Json = False,
) -> None:
    """Compare two runs: greatest and rms difference (RUN_B minus RUN_A) of each common probe."""
    from fvsolve.cli import printing
    from fvsolve.run import open_run
    from fvsolve.run.verdicts import differences

    first = open_run(run_a)
    result = differences(first, open_run(run_b))
    present(as_json, result, printing.difference_text(result, first.summary))


@app.command()
def view(
    directory: RunDirectory,
    time: Annotated[str | None, Option(metavar="T", help='time whose nearest frame is drawn: seconds, or "20 ms" '
        "(default the last frame)")] = None,
    field: Annotated[str | None, Option(help="quantity to draw, such as pressure, head, flow, velocity or depth "
        "(default pressure, or for a case without pipes the first field of its basins or the speed of its "
        "bodies)")] = None,
    contours: Annotated[int, Option(metavar="N", min=0, max=100, help="number of contour lines on the surfaces of "
        "basins")] = 0,
    animate: Annotated[Path | None, Option(metavar="FILE", help="animation of all frames, a .gif or .mp4 file")] = None,
    out: Annotated[Path | None, Option(metavar="FILE", help="picture file, or a page .html in which the scene can be "
        "turned (default RUN/view-FIELD.png, with the name of the field)")] = None,
) -> None:  # fmt: skip
    """Draw a quantity in all parts at one time, or an animation of all stored times, into a file."""
    from fvsolve.run import open_run

    when = quantity_of(time, "time", "--time")
    if animate is not None and not time is out is None:
        raise FvsolveError("--animate draws all times into its own file. Remove --time and --out")
    run = open_run(directory)
    print(run.view(when, field, out, contours) if animate is None else run.animate(animate, field, contours))


def _places(cases: list[str], out: Path | None) -> dict[str, Path]:
    """Map each case to its run directory : case -> directory.

    cases : case files or names of shipped cases; out : as the option --out of the command `run`
    Raises FvsolveError if a case is named twice, or if two cases would have the same directory.
    """
    from fvsolve.case import shipped

    paths, taken = {}, {}
    for name in cases:
        stem = shipped.find(name).stem
        place = out if out and len(cases) == 1 else (out or Path("runs")) / stem
        other = taken.setdefault(os.path.normcase(place), name)
        if name in paths or other != name:
            if other == name:
                raise FvsolveError(f"{name} is named twice. Name each case once")
            raise FvsolveError(
                f"{other} and {name} would both write {place}. Run each case in a command of its own with its own "
                "--out DIR, or rename a case"
            )
        paths[name] = place
    return paths
