"""`fvsolve chart` and `fvsolve order`: work-precision charts of methods and models, observed order of convergence."""

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated

from typer import Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present, progress_line
from fvsolve.core.output.result_table import Column, ResultTable, columns
from fvsolve.core.output.summary_file import plain
from fvsolve.errors import FvsolveError
from fvsolve.studies.accuracy.fit import NO_ERROR
from fvsolve.studies.accuracy.order_study import NORMS, SHOWN_VARIABLES, study_title, variable_unit

# set by a chart itself
STEP_KEYS = {f"numerics.{key}" for key in ("courant", "rtol", "step", "cell_time")}
ORDER_FILE = columns(
    scheme="scheme",
    method="method",
    reference="reference",
    variable="variable",
    unit="unit",
    norm="norm",
    cells="cells",
    size="size",
    step="step [s]",
    error="error",
    pairwise="order",
    mark="mark",
    order="fitted order",
    spread="spread",
    steps="steps",
    rhs="rhs",
    updates="cell updates",
    seconds="seconds",
)


@cli.command("chart", order=90)
def chart(
    case: cli.SingleCase,
    scheme: Annotated[
        str | None,
        Option(metavar="A,B", help="schemes to compare (default upwind,muscl,upwind5,weno5)"),
    ] = None,
    method: Annotated[
        str | None,
        Option(metavar="A,B", help="methods to compare (default a selection that suits the case)"),
    ] = None,
    cells: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="numbers of cells to compare, for example 50,100,200, "
            "of the pipe with the longest travel time or of the basin side with most cells (default up to five numbers "
            "that suit the case)",
        ),
    ] = None,
    rtol: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="relative tolerances to compare, for example 1e-3,1e-6, "
            "for a case without pipes and basins (default 1e-2 to 1e-10)",
        ),
    ] = None,
    step: Annotated[
        str | None,
        Option(
            metavar="A,B",
            help="fixed time steps [s] to compare, for example 1e-3,1e-4, "
            "for a case without cells (default seven or eight steps)",
        ),
    ] = None,
    target: Annotated[
        float | None,
        Option(
            metavar="ERROR",
            help="greatest accepted error of a probe, as a fraction "
            "of its range, for which the cheapest settings or model are printed (default none, or 0.01 with "
            "--models)",
        ),
    ] = None,
    models: Annotated[
        bool,
        Option("--models", help="compare models, from lumped volumes to cells, instead of methods"),
    ] = False,
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    set: cli.Set = [],  # noqa: B006
    out: cli.Out = None,
    as_json: cli.Json = False,
) -> None:
    """Chart error against CPU time and work for schemes, methods and resolutions; list the cheapest for each error."""
    from fvsolve.studies.accuracy.chart import chart as study
    from fvsolve.studies.accuracy.work_precision import write_chart

    loaded = cli.load_case(case, set, scheme, method)
    keys_of_the_chart = STEP_KEYS - {"numerics.step"} if models else STEP_KEYS
    for key in sorted({text.partition("=")[0].strip() for text in set} & keys_of_the_chart):
        text = f"--set {key} has no effect, because a chart sets the steps: Courant number 0.9, or --rtol, or --step"
        raise FvsolveError(f"{text}; remove it")
    if target is not None and not 0.0 < target < 1.0:
        text = f"--target: {target:g} is not a valid error"
        raise FvsolveError(f"{text}; expected a fraction of the range, between 0 and 1")
    if models:
        several_jobs = None if jobs == 1 else jobs
        _refuse(
            scheme=scheme,
            method=method,
            cells=cells,
            rtol=rtol,
            step=step,
            jobs=several_jobs,
            dask=dask,
            out=out,
        )
        from fvsolve.studies import ladder
        from fvsolve.studies.accuracy.model_hierarchy import DEFAULT_TARGET

        target = target or DEFAULT_TARGET
        with progress_line(resumable=False) as progress:
            hierarchy = ladder(loaded, target=target, progress=progress)
        return present(as_json, hierarchy.plain(), hierarchy_text(hierarchy, target))
    folder = cli.folder_of(loaded, "chart", out)
    sizes = [
        _numbers(name, text) for name, text in (("cells", cells), ("rtol", rtol), ("step", step))
    ]
    with progress_line() as progress:
        result = study(
            loaded,
            None,
            cli.comma_list(scheme, "--scheme"),
            cli.method_names(method),
            *sizes,
            target,
            folder,
            progress,
            jobs,
            dask,
        )
    paths = write_chart(result, folder)
    present(as_json, result.plain() | {"files": paths}, chart_text(result, paths))


def _refuse(**options) -> None:
    """Raise FvsolveError if options are given that have no effect with --models.

    options : name of an option -> its value, None if it is not given
    """
    names = [f"--{name}" for name, value in options.items() if value is not None]
    if names:
        raise FvsolveError(
            f"{', '.join(names)}: not valid with --models, which compares models of the case with the settings of "
            f"[numerics] and writes no files; remove {'these options' if len(names) > 1 else 'this option'}; "
            "keys of [numerics] can be changed with --set"
        )


def _numbers(name: str, text: str | None) -> list | None:
    """Numbers of a list such as `50,100`; None without a list.

    name : name of the option that gives the list
    Raises FvsolveError for a word that is not a positive number, or for `cells` not a positive whole number.
    """
    numbers = []
    for word in cli.comma_list(text) or ():
        try:
            value = int(word) if name == "cells" else float(word)
        except ValueError:
            value = 0
        if not 0 < value < float("inf"):
            expected = "a whole number above 0" if name == "cells" else "a number above 0"
            raise FvsolveError(f"--{name}: {word} is not {expected}")
        numbers.append(value)
    return numbers or None


def chart_text(result, paths) -> Iterator:
    """Cheapest settings for each error, default setting, references, failed points and files of a chart."""
    floor = result.floor["trajectory"]
    yield f"{result.case}: error over the trajectory (mean over time, of the probe with the largest relative error)"
    yield ResultTable(FRONT, [vars(row) for row in result.front])
    own = result.stands
    yield (
        f"default: {result.default}; times and cell updates are interpolated between the runs of each pair of scheme "
        "and method"
    )
    if own is not None:
        outcome = (
            f"error {own.trajectory:.2g} in {own.seconds * 1e3:.3g} ms" if own.ok else own.reason
        )
        yield f"default at its own resolution, {own.setting.fineness}: {outcome}"
    yield (
        f"errors against {result.reference}; {result.second} differs from it by {floor:.2g}: "
        "smaller errors have no meaning"
    )
    if result.left_out:
        yield f"left out, because they cannot model cavities in pipes: {', '.join(result.left_out)}"
    for text in result.told:
        yield f"no reference: {text}"
    for point in result.failed:
        yield f"failed: {point.setting.name}, {point.setting.fineness}: {point.reason}"
    yield (
        f"compiling or loading took {result.compile_seconds:.2g} s, not included in the times above"
        + (f"; points reused from earlier runs: {result.reused}" if result.reused else "")
    )
    yield "wrote " + ", ".join(str(path) for path in paths)
    if result.aim is not None:
        point = result.aim.point
        yield f"\n# error {point.trajectory:.2g} (target {result.aim.target:g}), {point.seconds * 1e3:.3g} ms; use in"
        yield "# [numerics] in place of scheme, method, courant, step, rtol and cell_time"
        yield from result.aim.toml_lines()


def _ms(key: str) -> Callable[[Mapping], str]:
    """Function that formats the time [s] in the column `key` of a row in milliseconds."""
    return lambda row: "-" if row[key] is None else f"{row[key] * 1e3:.3g}"


def _times(row: Mapping) -> str:
    """Text of the ratio of CPU times, default setting over cheapest setting, at the error of a row.

    It is "-" if the default setting does not reach this error.
    """
    default = row["default_seconds"]
    return "-" if default is None else f"{default / row['seconds']:.2g}"


FRONT = (
    Column("target", "error", ".0e"),
    Column(
        "name",
        "cheapest by CPU time",
        lambda row: f"{row['name']}, {row['fineness']}" if row["name"] else "none",
    ),
    Column("seconds", "ms", _ms("seconds")),
    Column("by_updates", "cheapest by updates", lambda row: row["by_updates"] or "none"),
    Column("updates", words=".2e"),
    Column(
        "default",
        words=lambda row: (
            "not reached" if row["default_seconds"] is None else row["default_fineness"]
        ),
    ),
    Column("default_seconds", "ms", _ms("default_seconds")),
    Column("times", words=_times),
    Column("default_updates", "updates", ".2e"),
)


MODELS = (
    Column("name", "model"),
    Column("law"),
    Column("states"),
    Column("error", words=".4g"),
    Column("of"),
    Column("greatest", words=".4g"),
    Column("ms", "time [ms]", ".4g"),
    Column("rhs", "calls of f"),
)


def hierarchy_text(hierarchy, target: float) -> Iterator:
    """Error and cost of each model of a hierarchy, and the cheapest model with an error of at most `target`."""
    known = [level for level in hierarchy.rungs if level.error is not None]
    yield ResultTable(
        MODELS, [vars(level) | {"of": level.worst, "ms": 1e3 * level.seconds} for level in known]
    )
    richest, cheapest = hierarchy.richest, hierarchy.cheapest
    yield (
        'error: root mean square over time of the worst probe (column "of"), over its range; '
        "greatest: maximum over time;"
    )
    yield f"reference for both: {richest.name}, {richest.law}"
    for reason in dict.fromkeys(level.reason for level in hierarchy.rungs if level.error is None):
        levels = [
            level for level in hierarchy.rungs if level.error is None and level.reason == reason
        ]
        yield f"{', '.join(dict.fromkeys(f'{level.name} ({level.law})' for level in levels))}: {reason}"
    gain = richest.seconds / cheapest.seconds
    model = f"{cheapest.name}, {cheapest.law}, {cheapest.states} states"
    yield (
        f"cheapest within {target:g}: {model}, {gain:.3g} times faster than the most detailed model",
        "bold",
    )
    yield from hierarchy.rules


ORDER_COLUMNS = (
    Column("cells"),
    Column("step", "step [s]", ".4g"),
    *(
        column
        for norm in NORMS
        for column in (Column(norm, words=".4g"), Column(f"order {norm}", "order", ".2f"))
    ),
    Column("rhs"),
    Column("seconds", words=".4g"),
    Column("mark"),
)


@cli.command("order", order=180)
def order(
    case: cli.SingleCase,
    overrides: cli.Set = [],  # noqa: B006
    refine: Annotated[
        str | None,
        Option(
            help="resolution to refine: both (cells and time steps), space or time "
            "(default both, or time for a case without pipes and basins)"
        ),
    ] = None,
    key: Annotated[
        str | None,
        Option(
            metavar="KEY",
            help="single key to refine, for example links.main.cells or "
            "numerics.step (default all keys that --refine selects)",
        ),
    ] = None,
    levels: Annotated[
        int | None,
        Option(
            help="number of refinement levels, 2 or more (default 4, or 6 if only time is refined)"
        ),
    ] = None,
    cells: Annotated[
        int | None,
        Option(
            help="number of cells, at the coarsest level, of the pipe or basin side with "
            "most cells, or of the part of --key (default as in the case, or fewer to shorten the study)"
        ),
    ] = None,
    scheme: Annotated[
        str | None, Option(metavar="A,B", help="schemes to study (default scheme of the case)")
    ] = None,
    method: Annotated[
        str | None, Option(metavar="A,B", help="methods to study (default method of the case)")
    ] = None,
    reference: Annotated[
        str,
        Option(
            help="reference solution: exact (named in the case), finer (a run at a finer "
            "level), richardson (the next level) or auto (the first of these that suits the case)"
        ),
    ] = "auto",
    jobs: cli.Jobs = 1,
    dask: cli.Dask = None,
    out: cli.Out = None,
    as_json: cli.Json = False,
) -> None:
    """Measure the order of convergence of a case under refinement: a table, order.csv and order.png."""
    from fvsolve.studies.accuracy.order import order as study
    from fvsolve.studies.result_cache import ResultCache

    loaded = cli.load_case(case, overrides, scheme, method)
    folder = cli.folder_of(loaded, "order", out)
    with progress_line() as progress, ResultCache(folder) as points:
        studies = study(
            loaded,
            refine=refine,
            key=key,
            levels=levels,
            cells=cells,
            schemes=cli.comma_list(scheme, "--scheme"),
            methods=cli.method_names(method),
            reference=reference,
            out=points,
            progress=progress,
            jobs=jobs,
            dask=dask,
        )
    studies = studies if isinstance(studies, list) else [studies]
    cli.clear_files(folder, "order.csv", "order.png", "order-*.png")
    files = [ResultTable(ORDER_FILE, [*file_rows(studies)]).write(folder / "order.csv")]
    for result in studies:
        files.append(
            folder
            / ("order.png" if len(studies) == 1 else f"order-{result.scheme}-{result.method}.png")
        )
        result.plot(files[-1])
    facts = {
        "studies": [result.plain() for result in studies],
        "files": [str(file) for file in files],
    }
    text = [line for result in studies for line in study_text(result)]
    present(
        as_json, facts | {"reused": points.reused}, [*text, f"files: {', '.join(facts['files'])}"]
    )


def file_rows(studies) -> Iterator[dict]:
    """Rows of order.csv: a row for each level of each study, variable and norm, in SI."""
    for result in studies:
        head = {"scheme": result.scheme, "method": result.method, "reference": result.kind}
        for variable, fits in result.fits.items():
            for norm in NORMS:
                labels = {
                    "variable": variable,
                    "unit": variable_unit(variable, result.units),
                    "norm": norm,
                }
                pairs = zip(
                    result.rows, [None, *fits[norm].pairwise], fits[norm].marks, strict=True
                )
                for row, pairwise, mark in pairs:
                    yield (
                        head
                        | labels
                        | vars(fits[norm])
                        | vars(row)
                        | vars(row.level)
                        | {
                            "error": row.errors.get(variable, {}).get(norm),
                            "pairwise": pairwise,
                            "mark": mark,
                            "updates": row.cell_updates,
                        }
                    )


def study_text(result) -> Iterator:
    """Tables, fitted orders and notes of a study."""
    yield f"{result.case}: {study_title(result)}", "bold"
    yield f"errors against: {result.words}"
    for variable in result.variables[:SHOWN_VARIABLES]:
        yield ""
        place = " at the end, all pipes" if variable in ("pressure", "flow") else ""
        yield f"{variable} [{result.error_unit(variable)[1]}]{place}"
        yield rows_of(result, variable)
    yield ""
    orders = [
        [f"{name}", *(fit_text(fits[norm]) for norm in NORMS)] for name, fits in result.fits.items()
    ]
    yield ResultTable.of("", ["fitted order of", "L1", "L2", "max"], orders)
    yield from dict.fromkeys([*reason_lines(result), *result.notes])
    yield ""


def rows_of(result, variable: str) -> ResultTable:
    """Table of a variable of an order study: errors and pairwise orders of all levels."""
    fits = result.fits[variable]
    rows = []
    size = result.error_unit(variable)[0]
    for k, row in enumerate(result.rows):
        step = f"rtol {row.level.size:g}" if result.plan.measure == "rtol" else row.level.step
        cells = {
            "cells": row.level.cells or None,
            "step": step,
            "rhs": row.rhs,
            "seconds": row.seconds,
        }
        cells |= {norm: size * error for norm, error in row.errors.get(variable, {}).items()}
        cells |= {f"order {norm}": fits[norm].pairwise[k - 1] if k else None for norm in NORMS}
        marks = {norm: fits[norm].marks[k] for norm in NORMS}
        same = len(set(marks.values())) == 1
        mark_text = (
            marks["L1"]
            if same
            else ", ".join(f"{text} ({norm})" for norm, text in marks.items() if text)
        )
        rows.append(plain(cells | {"mark": mark_text}))
    return ResultTable(ORDER_COLUMNS, rows)


def fit_text(fit) -> str:
    """Text of a fitted order with its spread; "none" without an order, "no error" if all errors are 0."""
    if fit.reason:
        return "no error" if fit.reason == NO_ERROR else "none"
    return f"{fit.order:.2f} ± {fit.spread:.2f}"


def reason_lines(result):
    """Lines with reasons for missing orders and notes on orders, of the variables that are printed."""
    for name in result.variables[:SHOWN_VARIABLES]:
        notes: dict[str, list[str]] = {}
        for norm, fit in result.fits[name].items():
            if (fit.reason or fit.note) and fit.reason != NO_ERROR:
                notes.setdefault(fit.reason or fit.note, []).append(norm)
        for text, norms in notes.items():
            yield f"{name} ({', '.join(norms)}): {text}"
    others = [
        fit.reason
        for name in result.variables[SHOWN_VARIABLES:]
        for fit in result.fits[name].values()
    ]
    if any(reason and reason != NO_ERROR for reason in others):
        yield "of the other variables some have no order; --json gives the reasons"
