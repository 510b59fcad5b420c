"""`fvsolve stability`: greatest stable step of a case, predicted and measured, and bounds on it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Argument, Option

from fvsolve.cli import app as cli
from fvsolve.cli.progress import progress_line
from fvsolve.cli.terminal import present
from fvsolve.errors import FvsolveError
from fvsolve.studies.result_table import Column, ResultTable, columns

PICTURES = 12  # greatest number of pairs of scheme and method for which pictures are drawn
STABILITY_FILE = columns(
    scheme="scheme", method="method", steps="steps", threshold="threshold", states="states",
    predicted="predicted [s]", predicted_courant="predicted Courant", after="after steps",
    measured="measured [s]", measured_courant="measured Courant", difference="difference",
    eigenvalues="eigenvalues [s]", field_of_values="field of values [s]", von_neumann="von Neumann [s]",
    longer="measured, ten times the steps [s]", where="grows in", share="share of energy", notes="notes",
)  # fmt: skip


@cli.app.command()
def stability(
    case: Annotated[
        str | None,
        Argument(metavar="CASE", help="case file or shipped case (default none: advection on a periodic grid)"),
    ] = None,
    scheme: Annotated[
        str | None,
        Option(
            metavar="A,B", help="schemes to study (default scheme of the case, or without a case all linear schemes)"
        ),
    ] = None,
    method: Annotated[
        str | None,
        Option(metavar="A,B", help="methods to study (default method of the case, or without a case all methods)"),
    ] = None,
    steps: Annotated[
        int | None,
        Option(
            help="number of steps over which growth is measured; without a case it adds measured limits of linear "
            "schemes (default 1000)"
        ),
    ] = None,
    cells: Annotated[
        int | None,
        Option(
            help="number of cells of the periodic grid on which growth is measured, only without a case (default 100)"
        ),
    ] = None,
    courant: Annotated[
        float | None,
        Option(
            help="Courant number at which growth is computed, only without a case (default 1 % above the stability "
            "limit, or 0.5 if the limit is 0)"
        ),
    ] = None,
    at: cli.AtTime = None,
    before: cli.BeforeJump = False,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    out: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="folder of tables and pictures (default runs/NAME.stability, or no files without a case)",
        ),
    ] = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Compute the greatest stable step of a case, predicted and measured, and bounds on it."""
    of_a_case = {"--set": set, "--at": at, "--left-limit": before, "--jobs": None if jobs == 1 else jobs}
    of_a_case |= {"--dask": dask}
    refuse_options(case, of_a_case, {"--cells": cells, "--courant": courant})
    if case is None:
        from fvsolve.cli.periodic_grid import without_case

        return present(as_json, *without_case(scheme, method, cells, steps, out, courant))
    from fvsolve.studies.stability.growth import STEPS
    from fvsolve.studies.stability.stability import stability as ask

    loaded = cli.load_case(case, set, scheme, method)
    folder = cli.folder_of(loaded, "stability", out)
    with progress_line() as progress:
        result = ask(
            loaded, cli.comma_list(scheme, "--scheme"), cli.method_names(method),
            cli.quantity_of(at, "time", f"--at {at}"), before, steps or STEPS, out=folder, progress=progress,
            jobs=jobs, dask=dask,
        )  # fmt: skip
    table = ResultTable(STABILITY_FILE, [row.plain() | {"notes": "; ".join(row.notes)} for row in result.rows])
    files = [table.write(cli.clear_files(folder, "stability.csv", "spectrum-*.png") / "stability.csv").name]
    if len(result.rows) <= PICTURES:
        files += pictures(result, folder)
    present(as_json, result.plain() | {"directory": str(folder), "files": files}, stability_text(result, folder, files))


def refuse_options(case: str | None, of_a_case: dict, of_a_grid: dict) -> None:
    """Raise FvsolveError if options are given that have no effect with a case, or have no effect without a case.

    case : name of the case, or None
    of_a_case : name -> value of the options that need a case; of_a_grid : name -> value of the options for no case
    """
    useless = [name for name, value in (of_a_grid if case else of_a_case).items() if value not in (None, False, [])]
    if useless:
        reason = "not valid with a case, only without" if case else "needs a case: fvsolve stability CASE"
        raise FvsolveError(f"{', '.join(useless)}: {reason}")


def pictures(result, folder: Path) -> list[str]:
    """Draw a picture for each pair of a linear scheme and a method; returns the file names.

    It shows the spectrum, multiplied by a step, over the stability region. The step is the predicted limit. If this is
    not positive and finite, the step is 1 / (greatest magnitude of an eigenvalue). Pairs on a case with delay lines
    have no picture. result : as from `stability`
    """
    from fvsolve.draw.stability_pictures import spectrum_figure
    from fvsolve.steppers import analyse

    names = []
    for row in result.rows:
        if row.limited or row.lines:
            continue
        side = result.system(row.scheme)
        is_known = np.isfinite(row.predicted) and row.predicted > 0.0
        h = row.predicted if is_known else 1.0 / max(np.abs(side.spectrum.values).max(), 1e-300)
        field = None if "field_of_values" in row.left_out else h * side.field
        title = f"{result.case}, {row.scheme} with {row.method}: spectrum times h = {h:.4g} s"
        if row.rate == 0.0:
            title = f"{result.case}, {row.method}: spectrum times h = {h:.4g} s"
        figure = spectrum_figure(analyse(row.method).stability_function, h * side.spectrum.values, field, title)
        names.append(f"spectrum-{row.scheme}-{row.method}.png" if row.rate > 0.0 else f"spectrum-{row.method}.png")
        figure.savefig(folder / names[-1])
    return names


def stability_text(result, folder: Path, files: list[str]) -> Iterator:
    """Table of stable steps of a case, and its notes."""
    rows, first_row = result.rows, result.rows[0]
    cells = first_row.rate > 0.0
    yield (
        f"{result.case} at {first_row.when}: {first_row.states} states; a step fails if a deviation grows "
        f"{first_row.threshold:g} times (energy norm) within {first_row.steps} steps"
    )
    if cells:
        yield f"Courant number: step times {first_row.rate:.6g} 1/s; bounds as Courant numbers"
    yield ResultTable(terminal_columns(cells), [line for row in rows for line in table_lines(row)])
    for row in rows:
        for note in row.notes:
            yield f"  {row_label(row)}: {note}"
        for bound, reason in row.left_out.items():
            yield f"  {row_label(row)}: {bound.replace('_', ' ')}: {reason}"
    for text in result.notes:
        yield f"  {text}"
    yield f"{folder}: {', '.join(files)}"


def terminal_columns(cells: bool) -> list[Column]:
    """Columns of the printed table of stable steps.

    cells : True if the case has cells: steps are then also given as Courant numbers, and bounds only as Courant numbers
    """
    heads = {"scheme": "scheme", "method": "method"}
    for quantity in ("predicted", "measured"):
        heads |= {quantity: f"{quantity} [s]", f"{quantity}_courant": "Courant"}
    heads["percent"] = "difference"
    for bound in ("eigenvalues", "field_of_values", "von_neumann"):
        heads[f"{bound}_courant" if cells else bound] = bound.replace("_", " ").replace("von n", "von N")
    heads["part"] = "grows in"
    omitted = () if cells else ("scheme", "predicted_courant", "measured_courant", "von_neumann")
    return [Column(key, head, ".5g") for key, head in heads.items() if key not in omitted]


def table_lines(row) -> list[dict]:
    """Lines of the printed table of stable steps for one pair of scheme and method.

    A limited scheme has a further line for each of its linear schemes with frozen weights.
    """
    from fvsolve.studies.stability.stability_row import json_number

    frozen_lines = [{"scheme": f"{row.scheme}: {name}", "method": row.method, "predicted": json_number(h),
              "predicted_courant": json_number(row.courant(h))} for name, h in row.frozen.items()]  # fmt: skip
    percent = f"{100 * row.difference:+.2f} %" if np.isfinite(row.difference) else None
    part = f"{row.where} ({100 * row.share:.0f} %)" if row.where else None
    return [*frozen_lines, row.plain() | {"percent": percent, "part": part}]


def row_label(row) -> str:
    """Label of a pair of scheme and method in notes; the method alone for a case without cells."""
    return f"{row.scheme}, {row.method}" if row.rate > 0.0 else row.method
