"""`fvsolve loop`: return ratio, margins, stability and poles of the loop of a control, with pictures."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Argument

from fvsolve.cli import app as cli
from fvsolve.cli.terminal import present, progress_line
from fvsolve.core.output.result_table import ResultTable, columns, write_csv
from fvsolve.display import save

POLES_SHOWN = 12  # greatest number of poles on the terminal
PICTURES = ("bode", "nyquist", "step", "locus")


@cli.command("loop", order=160)
def loop(
    case: cli.SingleCase,
    name: Annotated[str, Argument(metavar="NAME", help="control at whose output the loop is cut")],
    at: cli.AtTime = None,
    out: cli.Out = None,
    set: cli.Set = [],  # noqa: B006
    as_json: cli.Json = False,
) -> None:
    """Study the loop of a control: margins, stability, range of the gain, poles, and pictures."""
    from fvsolve.studies.loops.loop import loop as ask

    loaded = cli.load_case(case, set)
    with progress_line(resumable=False) as progress:
        result = ask(loaded, name, cli.quantity_of(at, "time", f"--at {at}"), progress=progress)
    folder = cli.folder_of(loaded, "loop", out)
    stem = f"{result.control}.loop"
    cli.warn_replaced(folder, f"{stem}.csv")
    h = result.ratio
    with np.errstate(divide="ignore"):
        table = [
            result.frequency,
            h.real,
            h.imag,
            20.0 * np.log10(np.abs(h)),
            np.degrees(np.unwrap(np.angle(h))),
        ]
    header = ["w [rad/s]", "real", "imaginary", "magnitude [dB]", "phase [deg]"]
    write_csv(folder / f"{stem}.csv", header, np.column_stack(table).tolist())
    draw(result, folder, stem)
    present(as_json, result.plain() | {"directory": str(folder)}, loop_text(result, folder, stem))


def draw(result, folder: Path, stem: str) -> None:
    """Write the pictures of a loop, STEM.bode.png and so on."""
    from fvsolve.report.draw.loop_pictures import (
        bode_figure,
        locus_figure,
        nyquist_figure,
        step_figure,
    )
    from fvsolve.studies.loops.loop import locus, step_response

    title = f"{result.case} at {result.when}: loop of {result.control}"
    cli.clear_files(folder, *(f"{stem}.{kind}.png" for kind in PICTURES))
    figures = {"locus": locus_figure(result, *locus(result), title)}
    if result.frequency.size:
        step = step_figure(*step_response(result), result.period is not None, title)
        figures |= {
            "bode": bode_figure(result, title),
            "nyquist": nyquist_figure(result, title),
            "step": step,
        }
    for kind, figure in figures.items():
        save(figure, folder / f"{stem}.{kind}.png")


def loop_text(result, folder: Path, stem: str) -> Iterator:
    """Verdict, margins, range of the gain and poles of a loop, and the files."""
    margins = result.margins
    yield f"{result.case} at {result.when}: loop of controls.{result.control}"
    if result.moving > 1e-9:
        yield "  not a steady state; schedules are held at their values of that time"
    words = {
        True: "stable",
        False: "not stable",
        None: "undecided, poles are too close to the imaginary axis",
    }
    yield f"closed loop: {words[result.stable]}", "bold"
    if result.delays:
        yield f"  delays: {', '.join(f'{delay:.4g} s' for delay in result.delays)}, exact"
    if result.period is not None:
        yield f"  sampled with a period of {result.period:.6g} s; poles are those of its map, stable below size 1"
    yield ResultTable(
        columns(margin="margin", value="value", at="at [rad/s]"), list(margin_rows(margins))
    )
    low, high = (None if end is None else f"{end:.6g}" for end in result.gain_range)
    if low is None and high is None:
        yield "stable with any gain" if result.stable else "not stable with any gain"
    else:
        ends = [f"above {low}"] * (low is not None) + [f"below {high}"] * (high is not None)
        yield f"stable with factors on the gain {' and '.join(ends)}"
    rows = [
        {"pole": f"{s.real:.6g} {s.imag:+.6g}j" if s.imag else f"{s.real:.6g}"}
        for s in result.poles
        if s.imag >= 0
    ]
    yield ResultTable(
        columns(pole="pole" if result.period is not None else "pole [1/s]"), rows[:POLES_SHOWN]
    )
    if not result.frequency.size:
        yield "no return ratio: the control does not act once in the common period of all samples"
    kinds = PICTURES if result.frequency.size else ("locus",)
    yield f"{folder}: {stem}.csv, {', '.join(f'{stem}.{kind}.png' for kind in kinds)}"


def margin_rows(margins) -> Iterator[dict]:
    """Yield the rows of the table of margins; None stands for a margin that does not exist."""
    gain = margins.gain_margin
    text = None if gain is None else f"{gain:.6g} ({margins.gain_margin_db:.4g} dB)"
    yield {"margin": "gain", "value": text, "at": number(margins.phase_crossover)}
    phase = None if margins.phase_margin is None else f"{margins.phase_margin:.6g} deg"
    yield {"margin": "phase", "value": phase, "at": number(margins.gain_crossover)}
    delay = None if margins.delay_margin is None else f"{margins.delay_margin:.6g} s"
    yield {"margin": "delay", "value": delay, "at": None}
    yield {
        "margin": "least |1 + L|",
        "value": number(margins.stability_margin),
        "at": number(margins.stability_crossover),
    }


def number(value: float | None) -> str | None:
    """Text of a number, None for None."""
    return None if value is None else f"{value:.6g}"
