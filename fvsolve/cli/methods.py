"""What `fvsolve methods` says. Knows words and tables; leaves what is to be known of a method to `steppers`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fvsolve.cli import terminal
from fvsolve.cli.studying import method_from
from fvsolve.errors import FvsolveError
from fvsolve.steppers import METHODS, Facts, Method, analyse, method_named
from fvsolve.steppers.numbers.polynomial import Polynomial, sign

PICTURES = (".png", ".svg", ".pdf")
LONG = 28  # characters of an entry that is shown whole
SHORT = 14  # digits that stand for a longer one
TERM = 40  # characters of a coefficient of R that is shown exactly


@dataclass(frozen=True)
class Said:
    """The same for programs and for people."""

    plain: dict
    show: Callable[[], None]


def table() -> Said:
    """All methods, explicit ones first."""
    found = {name: analyse(method) for name, method in METHODS.items()}
    return Said({name: one.plain() for name, one in found.items()}, lambda: _table(found))


def one(name: str, out: Path | None) -> Said:
    """One method: its tableau, R(s), facts and a picture of its stability region, which is written."""
    from fvsolve.draw.region import region_figure

    name = method_from(name)
    method = method_named(name)
    facts = analyse(method)
    path = out or Path(f"{name}.png")
    if path.suffix.lower() not in PICTURES:
        raise FvsolveError(f"{path}: pictures end in {' or '.join(PICTURES)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    region_figure(facts.stability_function, f"{method.name}: |R(hλ)| ≤ 1").savefig(path)
    array = {"a": method.a, "b": method.b, "c": method.c, "error": method.error, "start_error": method.start_error}
    return Said(facts.plain() | array | {"picture": str(path)}, lambda: _show(method, facts, path))


def _table(found: dict[str, Facts]) -> None:
    console = terminal.console()
    first = {name: one for name, one in found.items() if name == one.name}
    heads = ["method", "order", "error", "stage", "stages", "kind", "A", "L", "real", "imaginary", "SSP", "Padé"]
    rows = [
        [
            name, str(one.order), str(one.error_order) if one.adaptive else "-", str(one.stage_order),
            str(one.stages), one.kind, _yes(one.a_stable), _yes(one.l_stable), _length(one.real_interval),
            _length(one.imaginary_interval), _length(one.ssp_radius), _pade(one),
        ]
        for name, one in first.items()
    ]  # fmt: skip
    terminal.table(heads, rows, console)
    terminal.line(console, "")
    for name, one in found.items():
        if name != one.name:
            terminal.line(console, f"{name} is {one.name}")
    terminal.line(
        console, "error: order of the embedded solution; stage: stage order; real, imaginary: greatest stable"
    )
    terminal.line(console, "|h lambda| on these axes; SSP: greatest step in Euler steps; Padé (k, m): R is that entry")


def _show(method: Method, facts: Facts, path: Path) -> None:
    console = terminal.console()
    terminal.line(console, f"{method.name} ({method.source})", "bold")
    terminal.line(console, "")
    for text in [*_array(method), *_given(method)]:
        terminal.line(console, text)
    terminal.line(console, "")
    terminal.line(console, f"R(s) = {_quotient(facts)}")
    for text in _sentences(facts):
        terminal.line(console, text)
    terminal.line(console, f"stability region: {path}")


def _sentences(one: Facts) -> list[str]:
    estimate = f"error estimate of order {one.error_order}" if one.adaptive else "no error estimate"
    kind = [f"{one.stages} stages", one.kind]
    kind += ["stiffly accurate"] if one.stiffly_accurate else []
    kind += ["first rate same as last"] if one.first_same_as_last else []
    sector = "no sector" if one.angle is None else f"A(alpha) with alpha = {one.angle:.8g} degrees"
    found = [
        f"order {one.order}, {estimate}; stage order {one.stage_order}",
        ", ".join(kind),
        f"A-stable: {_yes(one.a_stable)}; L-stable: {_yes(one.l_stable)}; I-stable: {_yes(one.i_stable)}; {sector}",
        f"stable on the real axis {_reach(one.real_interval, '-', '')}, on the imaginary axis "
        f"{_reach(one.imaginary_interval, '', 'i')}; SSP radius {_length(one.ssp_radius, 13)}",
        f"R(s) - e^s = {one.error_constant:.6g} s^{one.stability_function.error_constant[0] + 1} + ...",
    ]
    if one.pade:
        found.append(f"R is the Padé approximation of e^s of degrees {one.pade[0]} over {one.pade[1]}")
    if one.digits:
        found.append(f"decided with the numbers as published, to {one.digits} digits")
    return found


def _reach(value: float, before: str, after: str) -> str:
    return "without end" if math.isinf(value) else "nowhere" if value == 0 else f"to {before}{value:.13g}{after}"


def _array(method: Method) -> list[str]:
    """The tableau as its source prints it, in columns; long decimals cut."""
    rows, width = [], method.stages
    for text in method.text.strip().splitlines():
        left, bar, right = text.partition("|")
        if bar:
            rows.append([left.strip(), *right.split()])
        else:
            rows.append([])
    rows = [[_entry(x) for x in row] + [""] * (width + 1 - len(row)) if row else [] for row in rows]
    wide = [max(len(row[i]) for row in rows if row) for i in range(width + 1)]
    lines = []
    for row in rows:
        cells = [x.ljust(w) for x, w in zip(row, wide, strict=True)] if row else ["-" * w for w in wide]
        lines.append(f"{cells[0]} | {'  '.join(cells[1:])}".rstrip() if row else f"{cells[0]}-+-{'--'.join(cells[1:])}")
    return lines


def _given(method: Method) -> list[str]:
    """What the entries of the tableau refer to."""
    found = [f"{name} = {near:.10g}, a root of {polynomial}" for name, (polynomial, near) in method.numbers.items()]
    if method.start_weight is not None:
        found.append(f"embedded solution: f(t, y) weighs {method.start_weight}, the rest follows by quadrature")
    return found


def _entry(text: str) -> str:
    if len(text) > LONG and re.fullmatch(r"-?[\d.]+", text):
        return text[: SHORT + 2] + "..."
    return text


def _quotient(one: Facts) -> str:
    r = one.stability_function
    up, down = _polynomial(r.numerator), _polynomial(r.denominator)
    return up if r.denominator.degree == 0 else f"({up}) / ({down})"


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
    if len(text) > TERM:
        return f"{float(x):.15g}"
    return f"({text})" if re.search(r".[-+]", text) else text


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _length(value: float, digits: int = 6) -> str:
    return "infinite" if math.isinf(value) else f"{value:.{digits}g}"


def _pade(one: Facts) -> str:
    return f"({one.pade[0]}, {one.pade[1]})" if one.pade else "-"
