"""What `fvsolve chart --models` says. Knows words and tables; leaves the runs to `studies`."""

from __future__ import annotations

from fvsolve.cli import terminal
from fvsolve.cli.app import print_json
from fvsolve.cli.studying import told


def show_models(case, target: float, as_json: bool) -> None:
    """The ladder of models of a case: what each rung errs and costs, the cheapest within the target, and why."""
    from fvsolve.studies import ladder

    with told(kept=False) as progress:
        found = ladder(case, target=target, progress=progress)
    if as_json:
        print_json(found.plain())
        return
    console = terminal.console()
    heads = ["model", "law", "states", "error", "of", "greatest", "time [ms]", "calls of f"]
    rows = [
        [one.name, one.law, *map(_number, (one.states, one.error)), one.worst,
         *map(_number, (one.greatest, 1e3 * one.seconds, one.rhs))]
        for one in found.rungs if one.error is not None
    ]  # fmt: skip
    terminal.table(heads, rows, console)
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
        f"cheapest within {target:g}: {cheapest.name}, {cheapest.law}, {_number(cheapest.states)} states, "
        f"{gain:.3g} times quicker than the richest",
        "bold",
    )
    for text in found.thumb:
        terminal.line(console, text)


def _number(value) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
