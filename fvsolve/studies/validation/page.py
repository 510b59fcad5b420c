"""Page of validations: a table, and for each case its source, rows and figure, in Markdown for the site."""

import math
from pathlib import Path

import numpy as np

from fvsolve.display import save
from fvsolve.file_replacement import write_file
from fvsolve.report.draw.validation_pictures import LinePanel, ValueRow, validation_figure
from fvsolve.studies.validation.library import RowResult, ValidationResult
from fvsolve.studies.validation.row_texts import amounts, is_error, limits_of
from fvsolve.studies.validation.row_verdicts import WITHIN, known_values

THEMES = ("light", "dark")
PAGE = "index.md"
INTRODUCTION = """# Validation

Each row compares a computed value with a measurement, with published results of other programs, or with an exact
solution. The gate of a row says with which; the limits are the least and the greatest value that pass. `within` means
that the value passes its gate. `equations solved, model differs` means that the value agrees with other programs of the
same equations, or with a converged solution, but not with the measurement; the reason stands beside it. `outside` means
that the value fails. The error is the numerical error, from a run at half the resolution, or at a finer one. This page
is made by

```sh
fvsolve validate --data DIR --page FOLDER
```
"""


def write_page(folder: Path, results: list[ValidationResult]) -> None:
    """Write index.md and the figures NAME-light.png and NAME-dark.png of each case into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [INTRODUCTION, summary_table(results)]
    for result in results:
        names = write_figures(folder, result)
        parts.append(section(result, names))
    write_file(folder / PAGE, "\n".join(parts))


def summary_table(results: list[ValidationResult]) -> str:
    """Table with a line for each case."""
    lines = ["| case | what | rows | verdict | seconds |", "|---|---|---|---|---|"]
    for result in results:
        cells = [
            f"[{result.name}](#{result.name})",
            result.title,
            str(len(result.rows)),
            result.verdict,
        ]
        lines.append(f"| {' | '.join(map(cell, cells))} | {result.seconds:.2g} |")
    return "\n".join([*lines, ""])


def section(result: ValidationResult, figures: list[str]) -> str:
    """Section of a case: source, figure, rows and reasons."""
    about = result.validation
    lines = [
        f"({result.name})=",
        f"## {result.title or result.name}",
        "",
        f"Source: {about.source}.",
    ]
    lines += [f"Data: {about.licence}."] if about.licence else []
    lines += [about.note] if about.note else []
    if not result.rows:
        return "\n".join(
            [*lines, "", f"Not run: {result.fault or '; '.join(result.lacking)}. {about.get}", ""]
        )
    lines += [
        "",
        *(
            f"![{result.title}, {theme}]({name}){{.only-{theme}}}\n"
            for theme, name in zip(THEMES, figures, strict=False)
        ),
    ]
    lines += [
        "| quantity | measured | computed | half resolution | error | other programs | limits | unit | verdict |",
        "|" + "---|" * 9,
    ]
    for row in result.rows:
        texts = amounts(row)
        cells = [
            row.row.what,
            texts.reference,
            texts.value,
            texts.coarser,
            texts.error,
            texts.others,
            texts.limits,
            row.unit,
            row.verdict,
        ]
        lines.append(f"| {' | '.join(map(cell, cells))} |")
    notes = [f"- {row.row.what}: {row.text}" for row in result.rows if row.text]
    notes += [
        f"- {row.row.what}: gate: {row.row.gate['reason']}"
        for row in result.rows
        if row.row.gate["reason"]
    ]
    lines += ["", *notes, "", f"`fvsolve validate {result.name}`", ""]
    return "\n".join(lines)


def cell(text: str) -> str:
    """Text for a cell of a table in Markdown."""
    return text.replace("|", "\\|")


def write_figures(folder: Path, result: ValidationResult) -> list[str]:
    """Write the figures of a case for a light and a dark page; returns their names."""
    panels, rows = panels_of(result), [value_row(row) for row in result.rows]
    if not rows:
        return []
    names = []
    for theme in THEMES:
        names.append(f"{result.name}-{theme}.png")
        save(validation_figure(panels, rows, theme), folder / names[-1])
    return names


def panels_of(result: ValidationResult) -> list[LinePanel]:
    """Panels of lines of a case; rows with equal lines share a panel."""
    panels: dict[str, LinePanel] = {}
    for row in result.rows:
        if not row.lines:
            continue
        measure = row.row.measure
        if measure is None:
            title = row.row.computed
            label = "x [m]"
            logarithmic = "exact" not in row.lines
            if logarithmic:
                title, label = f"{title.rpartition('.')[0]}: error of the end state", "CPU time [s]"
        elif measure.run_up is not None:
            title = f"run-up {measure.run_up.name} [m]"
            label = "angle [deg] or distance [m]"
            logarithmic = False
        elif measure.field is not None:
            title = f"{'.'.join(measure.field)} [{row.unit_of_lines}]"
            label = "x [m]"
            logarithmic = False
        else:
            title = f"{measure.probe.text} [{row.unit_of_lines}]"
            label = "t [s]"
            logarithmic = False
        key = title + repr(row.row.set)
        panels.setdefault(key, LinePanel(title, label, row.lines, logarithmic))
    return list(panels.values())


def value_row(row: RowResult) -> ValueRow:
    """Row of the panel of values."""
    known = known_values(row.row, [value for _, value in row.others], row.converged)
    gate, shown = limits_of(row), row.in_unit
    codes = [*(item["value"] for item in row.row.others), *(value for _, value in row.others)]
    error = (
        row.error
        if row.error is not None and math.isfinite(row.error) and not is_error(row)
        else 0.0
    )
    measured = (
        None if is_error(row) or known.measured is None else tuple(map(shown, known.measured))
    )
    value = shown(row.value) if np.isfinite(row.value) else gate[0]
    unit = "" if row.unit == "-" else row.unit
    passes = row.verdict == WITHIN
    return ValueRow(
        row.row.what,
        unit,
        value,
        row.shown.span_from_si(error),
        measured,
        tuple(map(shown, codes)),
        gate,
        passes,
    )
