"""Output of `fvsolve chart --models`: errors and computing times of a hierarchy of models."""

from __future__ import annotations

from fvsolve.cli import terminal
from fvsolve.cli.app import print_json
from fvsolve.cli.study_options import progress_line
from fvsolve.studies.result_table import Column, ResultTable

TABLE = (
    Column("name", "model"), Column("law"), Column("states"), Column("error", words=".4g"), Column("of"),
    Column("greatest", words=".4g"), Column("ms", "time [ms]", ".4g"), Column("rhs", "calls of f"),
)  # fmt: skip


def show_models(case, target: float, as_json: bool) -> None:
    """Run the model hierarchy of a case and print the error and cost of each model.

    The cheapest model with an error of at most `target` is printed too.
    """
    from fvsolve.studies import ladder

    with progress_line(resumable=False) as progress:
        hierarchy = ladder(case, target=target, progress=progress)
    if as_json:
        print_json(hierarchy.plain())
        return
    console = terminal.console()
    rows = [
        vars(level) | {"of": level.worst, "ms": 1e3 * level.seconds}
        for level in hierarchy.rungs
        if level.error is not None
    ]
    terminal.print_sheet(ResultTable(TABLE, rows), console)
    richest, cheapest = hierarchy.richest, hierarchy.cheapest
    terminal.line(
        console,
        'error: root mean square over time of the worst probe (column "of"), over its range; '
        "greatest: maximum over time;",
    )
    terminal.line(console, f"reference for both: {richest.name}, {richest.law}")
    for reason in dict.fromkeys(level.reason for level in hierarchy.rungs if level.error is None):
        levels = [level for level in hierarchy.rungs if level.error is None and level.reason == reason]
        terminal.line(
            console, f"{', '.join(dict.fromkeys(f'{level.name} ({level.law})' for level in levels))}: {reason}"
        )
    gain = richest.seconds / cheapest.seconds
    terminal.line(
        console,
        f"cheapest within {target:g}: {cheapest.name}, {cheapest.law}, {cheapest.states} states, "
        f"{gain:.3g} times faster than the most detailed model",
        "bold",
    )
    for text in hierarchy.rules:
        terminal.line(console, text)
