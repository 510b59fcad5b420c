"""Command `fvsolve methods`: properties of Runge-Kutta methods, and the tableau of a single method."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fvsolve.cli.app import Json, command, method_name
from fvsolve.cli.terminal import present
from fvsolve.core.output.result_table import ResultTable
from fvsolve.core.steppers import METHODS, Facts, Method, analyse, method_named
from fvsolve.core.steppers.numbers.polynomial import Polynomial, sign
from fvsolve.core.steppers.tableau import rounding_text
from fvsolve.display import save
from fvsolve.errors import FvsolveError

PICTURES = (".png", ".svg", ".pdf")
MAX_ENTRY = 28  # greatest length of a tableau entry that is printed in full, in characters
SHORT_DIGITS = 14  # digits printed of a longer entry
MAX_COEFFICIENT = 40  # greatest length of a coefficient of R that is printed exactly, in characters


def single_method(name: str, out: Path | None) -> tuple[dict, Iterator]:
    """Tableau, stability function R(s) and properties of a method : (values for JSON, text).

    It writes a picture of the stability region to the file `out`, by default NAME.png.
    """
    from fvsolve.report.draw.stability_pictures import region_figure

    name = method_name(name)
    method = method_named(name)
    facts = analyse(method)
    path = out or Path(f"{name}.png")
    if path.suffix.lower() not in PICTURES:
        raise FvsolveError(
            f"{path}: unknown type of picture; expected a name that ends in {' or '.join(PICTURES)}"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    save(region_figure(facts.stability_function, f"{method.name}: |R(hλ)| ≤ 1"), path)
    array = {
        "a": method.a,
        "b": method.b,
        "c": method.c,
        "error": method.error,
        "start_error": method.start_error,
    }
    return facts.plain() | array | {"picture": str(path)}, _method_text(method, facts, path)


def _table_text(all_facts: dict[str, Facts]) -> Iterator:
    first = {name: facts for name, facts in all_facts.items() if name == facts.name}
    heads = [
        "method",
        "order",
        "error",
        "stage",
        "stages",
        "kind",
        "A",
        "L",
        "real",
        "imaginary",
        "SSP",
        "Padé",
    ]
    rows = [
        [
            name,
            str(facts.order),
            str(facts.error_order) if facts.adaptive else "-",
            str(facts.stage_order),
            str(facts.stages),
            facts.kind,
            _yes(facts.a_stable),
            _yes(facts.l_stable),
            _length(facts.real_interval),
            _length(facts.imaginary_interval),
            _length(facts.ssp_radius),
            f"({facts.pade[0]}, {facts.pade[1]})" if facts.pade else "-",
        ]
        for name, facts in first.items()
    ]
    yield ResultTable.of("", heads, rows)
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
    yield from _sentences(method, facts)
    yield f"stability region: {path}"


def _sentences(method: Method, facts: Facts) -> list[str]:
    estimate = (
        f"error estimate of order {facts.error_order}" if facts.adaptive else "no error estimate"
    )
    kind = [f"{facts.stages} stages", facts.kind]
    kind += ["stiffly accurate"] if facts.stiffly_accurate else []
    kind += ["first rate same as last"] if facts.first_same_as_last else []
    sector = (
        "no sector" if facts.angle is None else f"A(alpha) with alpha = {facts.angle:.8g} degrees"
    )
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
        sentences.append(
            f"R is the Padé approximation of e^s of degrees {facts.pade[0]} over {facts.pade[1]}"
        )
    if facts.rounded_order:
        sentences.append(rounding_text(method.text, facts.rounded_order))
    if facts.digits:
        sentences.append(f"coefficients are used as published, with {facts.digits} digits")
    return sentences


def _interval_text(value: float, before: str, after: str) -> str:
    return (
        "everywhere"
        if math.isinf(value)
        else "nowhere"
        if value == 0
        else f"to {before}{value:.13g}{after}"
    )


def _tableau_lines(method: Method) -> list[str]:
    """Lines of the tableau of a method in the notation of its source, in aligned columns; long decimals are cut off."""
    rows, width = [], method.stages
    for text in method.text.strip().splitlines():
        left, bar, right = text.partition("|")
        row = [left.strip(), *right.split()] if bar else []
        for k, entry in enumerate(row):
            if len(entry) > MAX_ENTRY and re.fullmatch(r"-?[\d.]+", entry):
                row[k] = entry[: SHORT_DIGITS + 2] + "..."
        rows.append(row + [""] * (width + 1 - len(row)) if row else [])
    wide = [max(len(row[i]) for row in rows if row) for i in range(width + 1)]
    lines = []
    for row in rows:
        cells = (
            [x.ljust(w) for x, w in zip(row, wide, strict=True)] if row else ["-" * w for w in wide]
        )
        lines.append(
            f"{cells[0]} | {'  '.join(cells[1:])}".rstrip()
            if row
            else f"{cells[0]}-+-{'--'.join(cells[1:])}"
        )
    return lines


def _polynomial(p: Polynomial) -> str:
    terms = []
    for k, x in enumerate(p.coefficients):
        if x == 0:
            continue
        power = "" if k == 0 else "s" if k == 1 else f"s^{k}"
        size = str(abs(x))
        if len(size) > MAX_COEFFICIENT:
            size = f"{float(abs(x)):.15g}"
        elif re.search(r".[-+]", size):
            size = f"({size})"
        size = "" if size == "1" and power else size
        terms.append(
            (" - " if sign(x) < 0 else " + ") + " ".join(word for word in (size, power) if word)
        )
    text = "".join(terms)
    return text[3:] if text.startswith(" + ") else text.strip()


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _length(value: float, digits: int = 6) -> str:
    return "infinite" if math.isinf(value) else f"{value:.{digits}g}"


@command("methods", order=60)
def methods(
    name: Annotated[
        str | None,
        Argument(
            metavar="NAME", help="name of a method, or file of its tableau (default all methods)"
        ),
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="picture file of the stability region of NAME: .png, "
            ".svg or .pdf (default NAME.png)",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List Runge-Kutta methods: order, stability, cost. With NAME show its tableau, R(s) and stability region."""
    if name is None and out is not None:
        raise FvsolveError("--out is valid for a single method only; add the NAME of the method")
    if name is not None:
        return present(as_json, *single_method(name, out))
    all_facts = {name: analyse(method) for name, method in METHODS.items()}
    present(
        as_json, {name: facts.plain() for name, facts in all_facts.items()}, _table_text(all_facts)
    )
