"""`fvsolve quality`: water age and source tracing over a run of a network without waves."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from typer import Option

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present, run_progress
from fvsolve.core.output.result_table import ResultTable

NODES_SHOWN = 40  # greatest number of nodes on a terminal; the files have all


@cli.command("quality", order=200)
def quality(
    case: cli.SingleCase,
    trace: Annotated[
        str | None, Option(metavar="A,B", help="nodes whose water is traced (default none)")
    ] = None,
    step: Annotated[
        str, Option(metavar="TIME", help="longest time step of the transport")
    ] = "60 s",
    out: cli.Out = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Compute the age of the water at all nodes of a network without waves, and its shares by source, over a run."""
    from fvsolve.studies.water_quality.water_quality import water_quality

    loaded = cli.load_case(case, set)
    sources = cli.comma_list(trace, "--trace") or []
    seconds = cli.quantity_of(step, "time", f"--step {step}")
    folder = cli.folder_of(loaded, "quality", out)
    cli.warn_replaced(folder, "age.csv")
    with run_progress(loaded) as progress:
        result = water_quality(loaded, sources, seconds, progress=progress)
    cli.clear_files(folder, "age.csv", "trace-*.csv")
    paths = result.write(folder)
    facts = result.plain() | {"directory": str(folder), "files": [path.name for path in paths]}
    present(as_json, facts, quality_text(result, folder, paths))


def quality_text(result, folder: Path, paths: list[Path]) -> Iterator:
    """Age and shares at the end of a run, by node, the error of the balance, and the files."""
    heads = [
        "node",
        "age at the end [h]",
        "greatest age [h]",
        *(f"from {name} [%]" for name in result.trace),
    ]
    rows = [
        [
            node,
            f"{result.age[-1, k] / 3600.0:.4g}",
            f"{result.age[:, k].max() / 3600.0:.4g}",
            *(f"{100.0 * values[-1, k]:.4g}" for values in result.trace.values()),
        ]
        for k, node in enumerate(result.nodes[:NODES_SHOWN])
    ]
    yield ResultTable.of("", heads, rows)
    if len(result.nodes) > NODES_SHOWN:
        yield f"... {len(result.nodes) - NODES_SHOWN} more nodes in the files"
    yield f"balance of the carried values: remainder {result.error:.3g} of their contents"
    yield f"{folder}: {', '.join(path.name for path in paths)}"
