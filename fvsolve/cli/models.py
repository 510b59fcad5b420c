"""What `fvsolve chart --models` says. Knows words and tables; leaves the runs to `studies`."""

from __future__ import annotations

from fvsolve.cli import terminal
from fvsolve.cli.app import print_json
from fvsolve.cli.studying import told
from fvsolve.studies.sheet import Column, Sheet

TABLE = (
    Column("name", "model"), Column("law"), Column("states"), Column("error", words=".4g"), Column("of"),
    Column("greatest", words=".4g"), Column("ms", "time [ms]", ".4g"), Column("rhs", "calls of f"),
)  # fmt: skip


def show_models(case, target: float, as_json: bool) -> None:
    """The ladder of models of a case: what each rung errs and costs, the cheapest within the target, and why."""
    from fvsolve.studies import ladder

    with told(kept=False) as progress:
        found = ladder(case, target=target, progress=progress)
    if as_json:
        print_json(found.plain())
        return
    console = terminal.console()
    rows = [vars(one) | {"of": one.worst, "ms": 1e3 * one.seconds} for one in found.rungs if one.error is not None]
    terminal.sheet(Sheet(TABLE, rows), console)
    richest, cheapest = found.richest, found.cheapest
    terminal.line(
        console, "error: root mean square over time, of the worst probe, over its range; greatest: at any time;"
    )
    terminal.line(console, f"both from {richest.name}, {richest.law}")
    for reason in dict.fromkeys(one.reason for one in found.rungs if one.error is None):
        rungs = [one for one in found.rungs if one.error is None and one.reason == reason]
        terminal.line(console, f"{', '.join(dict.fromkeys(f'{one.name} ({one.law})' for one in rungs))}: {reason}")
    gain = richest.seconds / cheapest.seconds
    terminal.line(
        console,
        f"cheapest within {target:g}: {cheapest.name}, {cheapest.law}, {cheapest.states} states, "
        f"{gain:.3g} times quicker than the richest",
        "bold",
    )
    for text in found.thumb:
        terminal.line(console, text)
