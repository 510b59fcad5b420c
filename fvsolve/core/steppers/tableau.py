"""Runge-Kutta methods: Butcher array as printed in its source, with name and derived properties."""

from __future__ import annotations

import functools
import importlib
import warnings
from collections import UserDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.argument_checks import COUNT, ROW, TABLE, TEXT, is_number, validated
from fvsolve.core.steppers.analysis.trees import ORDER_MOST, Conditions, stage_order
from fvsolve.core.steppers.numbers.algebraic import MIXED_ROOTS, Algebraic, digits, root, value_of
from fvsolve.core.steppers.numbers.polynomial import collocation, extrapolated
from fvsolve.errors import FvsolveError, nearest
from fvsolve.units import show

AUTO = "auto"  # in place of a method name: `automatic.py` chooses the method
LARGEST = 10**30  # greatest size of an entry
BUILT_IN: set[str] = set()  # names of built-in methods, not available for user methods
EXACT_DECIMALS = 6  # decimals with at most this many digits are exact
FEW_DECIMALS = 3  # decimals with fewer digits, such as 0.25, are not taken for rounded numbers
DENSE_ERROR = 1e-12  # relative difference of the new state from the dense output at its end
# greatest number of digits that count, below the precision of intermediate results
DIGITS_MOST = 75
# greatest number of stages, and of characters in the text of a tableau
STAGES_MOST, LETTERS_MOST = 100, 10**6
# greatest number of faults in a message, and length of a line of the text in it
FAULTS_SHOWN, LINE_SHOWN = 20, 120


class Methods(UserDict):
    """Methods by name, in the order of their declarations; some have two names: `gauss-2` is `implicit-midpoint`.

    further : module that declares further built-in methods, imported when a name is not known yet, and before all
    methods are asked for: most runs have an explicit method
    """

    further = ""

    def complete(self) -> None:
        """Declare all built-in methods."""
        if self.further:
            # another thread waits here until all are declared
            importlib.import_module(self.further)
            self.further = ""

    def __contains__(self, name: object) -> bool:
        if name not in self.data:
            self.complete()
        return name in self.data

    def __getitem__(self, name: str) -> Method:
        if name not in self.data:
            self.complete()
        return self.data[name]

    def __iter__(self) -> Iterator[str]:
        self.complete()
        return iter(self.data)

    def __len__(self) -> int:
        self.complete()
        return len(self.data)


METHODS = Methods()


class Array(NamedTuple):
    """Exact coefficients of a tableau: fractions, or algebraic numbers with a common root.

    a, b, c : Butcher array; embedded : weights of the embedded solution, empty without one
    start : weight of f(t, y) in the embedded solution; dense : coefficients of the dense output, see `Method`
    """

    a: tuple[tuple, ...]
    b: tuple
    c: tuple
    embedded: tuple  # empty without an embedded solution
    start: object  # weight of f(t, y) in the embedded solution
    dense: tuple[tuple, ...]


@dataclass(frozen=True, eq=False)
class Method:
    """A Runge-Kutta method with step h and s stages k_i: equations (14) and (23) of docs/course.md.

    k_i = f(y + h sum_j a_ij k_j, t + c_i h), y+ = y + h sum_i b_i k_i.
    All properties except the fields, which are arguments of `tableau`, are derived on first use:
    a, b, c : float64[s, s], float64[s], float64[s]  Butcher array
    error : float64[s] or empty  weights of the stages in the difference of y+ and the embedded solution
    start_error : weight of f(t, y) at the start of the step in this difference
    dense : float64[s, d] or empty  dense output y(theta) = y + h sum_i k_i sum_j dense_ij theta^(j+1), 0 <= theta <= 1
    """

    name: str
    source: str
    text: str = field(repr=False)
    numbers: Mapping[str, tuple[str, float]] = field(default_factory=dict, repr=False)
    given_dense: Sequence = field(default=(), repr=False)
    start_weight: str | None = field(default=None, repr=False)
    given_digits: int | None = field(default=None, repr=False)

    @functools.cached_property
    def exact(self) -> Array:
        """Butcher array in exact numbers; raises FvsolveError with all faults of the text."""
        return _exact(self)

    @functools.cached_property
    def digits(self) -> int | None:
        """Number of significant digits in the published coefficients; None if at most six: they are then exact."""
        count = min(self.given_digits or digits(self.text), DIGITS_MOST)
        return count if count > EXACT_DECIMALS else None

    @functools.cached_property
    def rounded_order(self) -> int | None:
        """Order if decimals of few digits are not exact but rounded numbers; None if it is not above `order`."""
        order = _rounded_order(self.text, self.exact.a, self.exact.b, self.given_digits)
        return order if order is not None and order > self.order else None

    @property
    def rounding(self) -> Fraction:
        """Relative error of a coefficient; 0 for exact coefficients."""
        return Fraction(5, 10**self.digits) if self.digits else Fraction(0)

    @functools.cached_property
    def a(self) -> np.ndarray:
        return _floats(self.exact.a)

    @functools.cached_property
    def b(self) -> np.ndarray:
        return _floats(self.exact.b)

    @functools.cached_property
    def c(self) -> np.ndarray:
        return _floats(self.exact.c)

    @functools.cached_property
    def error(self) -> np.ndarray:
        pairs = zip(self.exact.b, self.exact.embedded, strict=True) if self.adaptive else ()
        return _floats([x - y for x, y in pairs])

    @functools.cached_property
    def start_error(self) -> float:
        return 0.0 - float(self.exact.start)

    @functools.cached_property
    def dense(self) -> np.ndarray:
        return _floats(self.exact.dense) if self.exact.dense else np.zeros((0, 0))

    @property
    def stages(self) -> int:
        return len(self.exact.b)

    @property
    def adaptive(self) -> bool:
        """True if the method has an error estimate."""
        return len(self.exact.embedded) > 0

    @functools.cached_property
    def order(self) -> int:
        return self._conditions.order(self.exact.b)

    @functools.cached_property
    def error_order(self) -> int:
        """Order of the embedded solution, 0 without one."""
        if not self.adaptive:
            return 0
        conditions, _, embedded = self._pair
        return conditions.order(embedded)

    @property
    def control_order(self) -> int:
        """Power of the step h in the error estimate; for a method without an error estimate its order."""
        return min(self.order, self.error_order) + 1 if self.adaptive else self.order

    @functools.cached_property
    def stage_order(self) -> int:
        return stage_order(self.exact.a, self.exact.b, self.exact.c, self.rounding)

    @property
    def times(self) -> tuple[float, ...]:
        """Times of the stages after the start of a step, in units of the step."""
        return tuple(map(float, self.exact.c))

    @functools.cached_property
    def explicit(self) -> bool:
        """True if each stage depends only on earlier stages."""
        return not np.any(np.triu(self.a))

    @functools.cached_property
    def diagonally_implicit(self) -> bool:
        """True if the stages can be solved one after another and at least one of them is implicit."""
        return not self.explicit and not np.any(np.triu(self.a, 1))

    @property
    def kind(self) -> str:
        """Kind of the equations of a step: "explicit" (none), "diagonal" (stage by stage), "full" (all together)."""
        return "explicit" if self.explicit else "diagonal" if self.diagonally_implicit else "full"

    @functools.cached_property
    def stiffly_accurate(self) -> bool:
        """True if the last stage is the new state."""
        return self.exact.a[-1] == self.exact.b

    @functools.cached_property
    def first_same_as_last(self) -> bool:
        """True if the rate at the last stage of a step is that at the first stage of the next step."""
        return self.stiffly_accurate and self.exact.c[-1] == 1 and not np.any(self.a[0])

    @functools.cached_property
    def _conditions(self) -> Conditions:
        return Conditions(self.exact.a, self.rounding)

    @functools.cached_property
    def _pair(self) -> tuple[Conditions, Sequence, Sequence]:
        """(conditions, weights of the new state, weights of the embedded solution) with a common Butcher matrix.

        If f(t, y) has a weight in the embedded solution, a stage for it comes first.
        """
        if self.exact.start == 0:
            return self._conditions, self.exact.b, self.exact.embedded
        a = [[Fraction(0)] * (self.stages + 1), *([Fraction(0), *row] for row in self.exact.a)]
        return (
            Conditions(a, self.rounding),
            [Fraction(0), *self.exact.b],
            [self.exact.start, *self.exact.embedded],
        )


@validated(name=TEXT, dense=ROW, start_weight=TEXT, numbers=TABLE, digits=COUNT, source=TEXT)
def tableau(
    name: str,
    text: str | Sequence | None = None,
    b: Sequence | None = None,
    c: Sequence | None = None,
    *,
    A: Sequence | None = None,
    source: str = "user",
    dense: Sequence = (),
    start_weight: str | None = None,
    numbers: Mapping[str, tuple[str, float]] | None = None,
    digits: int | None = None,
) -> Method:
    """Define a method by its Butcher array, as text or as A, b, c; afterwards it can be used by its name.

    text : rows `c | a1 a2 ...`, a ruled line, `| b1 b2 ...` and, for an embedded solution, a second row of weights.
    Entries have no blanks: `1/3`, `0.161`, `(88-7sqrt(6))/360`, or expressions with the names in `numbers`.
    In its place, or as A: the matrix A, s x s, with b and c as numbers
    b : s weights, or two rows of weights, the second for the embedded solution
    c : s times of the stages; default: the sums of the rows of A. Integers and fractions are exact; floating-point
    numbers count as their shortest decimals, see `digits`
    source : origin of the coefficients; dense : coefficients of the dense output, see `Method`
    start_weight : weight of f(t, y) at the start of the step in an embedded solution that integrates polynomials
    numbers : names for irrational numbers, such as `{"g": ("x^3-3x^2+3x/2-1/6", 0.4358665215)}`: the root of the
    polynomial that is nearest to the given value
    digits : significant digits of the entries, by default the greatest number in any decimal; up to six digits all
    entries count as exact, above as rounded in the last digit
    Raises FvsolveError for an empty or built-in name, and with all faults of the array: rows of wrong length, rows that
    do not add up to c, invalid entries, an error estimate that is zero for all problems, for y' = lambda y or for
    y' = f(t). Warns of decimals of few digits with which the order is lower than with exact numbers.
    """
    METHODS.complete()  # their names are not free
    if name in BUILT_IN or name == "auto" or not name.strip() or name != name.strip():
        raise FvsolveError(
            f'method name "{name}" is not free: it is empty, has blanks at an end or names a built-in '
            "method; choose another name"
        )
    if (text is None) == (A is None):
        raise FvsolveError(
            f'method "{name}": expected either text or A, as in tableau(name, A=A, b=b)'
        )
    text = A if text is None else text
    if digits is not None and not 1 <= digits <= DIGITS_MOST:
        raise FvsolveError(f"digits = {digits} is out of range; expected 1 to {DIGITS_MOST}")
    if b is not None:
        if isinstance(text, str):
            raise FvsolveError(
                "b is given twice: as an argument and in the text; expected A, b, c in numbers, or only "
                "the text"
            )
        text = printed(text, b, c)
    elif not isinstance(text, str):
        raise FvsolveError(
            f'method "{name}": b is missing; expected tableau(name, A, b) or tableau(name, A, b, c)'
        )
    method = Method(name, source, text, numbers or {}, dense, start_weight, digits)
    if method.exact and (faults := estimate_faults(method)):
        raise FvsolveError(_message(name, faults))
    if method.rounded_order is not None:
        warnings.warn(
            f"{name}: order {method.order}; {rounding_text(text, method.rounded_order)}",
            RuntimeWarning,
            stacklevel=3,
        )
    METHODS[name] = method
    return method


def estimate_faults(method: Method) -> list[str]:
    """Faults of the error estimate of a method: it is zero, or smaller than the error by a power of the step."""
    if not method.adaptive:
        return []
    (conditions, b, embedded), p = method._pair, method.order
    zero = None
    if method.error_order == p < ORDER_MOST and not conditions.differ(
        b, embedded, p + 1, conditions.all_trees(p + 1)
    ):
        zero = f"has the error of order h^{p + 1} of the new state, so the error estimate is zero or too small"
    elif not conditions.differ(b, embedded, len(b), conditions.tall_trees()):
        zero = "equals the new state for y' = lambda y, so the error estimate is zero there"
    elif not conditions.differ(b, embedded, len(b), conditions.bushy_trees()):
        zero = "equals the new state for y' = f(t), so the error estimate is zero there"
    text = "expected an embedded solution of another order, or a single row of weights"
    return [f"the embedded solution {zero}; {text}"] if zero else []


def _rounded_order(text: str, a: Sequence, b: Sequence, given_digits: int | None) -> int | None:
    """Order of a method whose text has decimals of few digits, if they are rounded; None if they are not few."""
    count = digits(text)
    if given_digits or not FEW_DECIMALS <= count <= EXACT_DECIMALS:
        return None
    return Conditions(a, Fraction(5, 10**count)).order(b)


def rounding_text(text: str, order: int) -> str:
    """Text on the order with exact numbers of a tableau whose text has decimals of few digits."""
    expected = (
        f"expected fractions, or decimals of {EXACT_DECIMALS + 1} digits or "
        "more: shorter decimals count as exact"
    )
    return f"with exact numbers in place of decimals of {digits(text)} digits it has order {order}; {expected}"


def method_of_file(path: Path) -> Method:
    """Define the method whose tableau a text file contains; its name is the file name without its ending.

    Raises FvsolveError for a file that is not a tableau, and for a name that a different method has.
    """
    try:
        with path.open(encoding="utf-8") as file:
            # One character more than allowed, by which a longer file is recognised without reading it all.
            text = file.read(LETTERS_MOST + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise FvsolveError(f"{path} cannot be read as a tableau: {error}") from None
    source, existing = str(path.resolve()), METHODS.get(path.stem)
    if (
        existing is not None
        and path.stem not in BUILT_IN
        and existing.source != source
        and existing.text != text
    ):
        raise FvsolveError(
            f'{path}: "{path.stem}" is another method already, from {existing.source}; rename the file'
        )
    try:
        return tableau(path.stem, text, source=source)
    except FvsolveError as error:
        raise FvsolveError(f"{path}: {error}") from None


def printed(a: Sequence, b: Sequence, c: Sequence | None = None) -> str:
    """Text of a tableau from the Butcher array as numbers, see `tableau`; raises FvsolveError for wrong shapes."""
    a, b = _numbers("A", a, 2), _numbers("b", b, 2)
    s = a.shape[0]
    if a.shape != (s, s) or b.ndim != 2 or b.shape[0] > 2 or b.shape[1] != s:
        raise FvsolveError(
            f"A has shape {a.shape}, b {b.shape}; expected s x s numbers in A and s in b, or two rows "
            "of s in b for an embedded solution (s: number of stages)"
        )
    if c is None:
        c = [sum(map(_number, row), Fraction(0)) for row in a]
    c = _numbers("c", c, 1)
    if c.shape != (s,):
        raise FvsolveError(f"c has shape {c.shape}; expected {s} numbers")
    rows = [
        f"{_entry(left)} | {' '.join(map(_entry, row))}" for left, row in zip(c, a, strict=True)
    ]
    return "\n".join([*rows, "---", *(f"| {' '.join(map(_entry, row))}" for row in b)])


def _numbers(name: str, value: Sequence, axes: int) -> np.ndarray:
    """Array of the numbers in nested lists, with at least `axes` axes. Raises FvsolveError for other content."""
    if isinstance(value, np.ndarray):
        # keeps the precision of float32
        value = np.fromiter(value.flat, dtype=object).reshape(value.shape)
    array = np.array(value, dtype=object, ndmin=axes) if not _is_ragged(value) else None
    if array is None or any(
        isinstance(x, (Sequence, np.ndarray)) and not isinstance(x, str) for x in array.flat
    ):
        raise FvsolveError(
            f"{name} has rows of different lengths; expected the same number of entries in all rows"
        )
    wrong = {place: x for place, x in np.ndenumerate(array) if not is_number(x)}
    faults = [
        f"{name}{[*at]} = {show(x.item() if isinstance(x, np.generic) else x)}"
        for at, x in wrong.items()
    ]
    if faults:
        more = f" and {len(faults) - FAULTS_SHOWN} more" if len(faults) > FAULTS_SHOWN else ""
        verb = "is not a finite number" if len(faults) == 1 else "are not finite numbers"
        text = 'expected numbers or fractions, and texts such as "1/3" only in a tableau that is a text as a whole'
        raise FvsolveError(f"{', '.join(faults[:FAULTS_SHOWN])}{more} {verb}; {text}")
    return array


def _is_ragged(value) -> bool:
    try:
        np.array(value, dtype=object)
    except ValueError:  # lists that agree in their first entries only
        return True
    return False


def _number(x) -> Fraction:
    return Fraction(x) if isinstance(x, (int, Fraction, np.integer)) else Fraction(str(x))


def _entry(x) -> str:
    if isinstance(x, (float, np.floating)):
        return f"{Decimal(str(x)):f}"  # the shortest decimals of its own precision
    return str(_number(x))


def declare(
    name: str,
    text: str,
    source: str,
    dense: Sequence = (),
    start_weight: str | None = None,
    numbers: Mapping[str, tuple[str, float]] | None = None,
    digits: int | None = None,
    also: str | None = None,
) -> Method:
    """Declare a built-in method, with arguments as for `tableau`; its text is read on first use.

    also : second name of the method, within a family of methods
    """
    method = METHODS[name] = Method(name, source, text, numbers or {}, dense, start_weight, digits)
    BUILT_IN.add(name)
    if also:
        METHODS[also] = method
        BUILT_IN.add(also)
    return method


def declare_each(texts: dict[str, str], also: Mapping[str, str] | None = None) -> None:
    """Declare built-in methods by name; the first line of each text is the source, the other lines are the tableau.

    also : second names of some methods, see `declare`
    """
    for name, text in texts.items():
        source, rows = text.split("\n", 1)
        declare(name, f"\n{rows.rstrip()}\n", source, also=(also or {}).get(name))


def method_named(name: str | Method) -> Method:
    """Method with the given name, or the given `Method`; raises FvsolveError with the nearest name if it is unknown."""
    if isinstance(name, Method):
        return name
    if not isinstance(name, str):
        raise FvsolveError(f"method = {show(name)} is not a name; expected the name of a method")
    if name in METHODS:
        return METHODS[name]
    near = nearest(name, METHODS)
    if Path(name).suffix:
        raise FvsolveError(
            f'no method named "{name}". For a file: fvsolve.tableau(NAME, Path("{name}").read_text())'
        )
    hint = f'; did you mean "{near}"?' if near else f"; methods are {', '.join(METHODS)}"
    raise FvsolveError(f'no method named "{name}"{hint}')


def _exact(method: Method) -> Array:
    faults: list[str] = []
    numbers = _named_numbers(method.numbers, faults)
    if len(method.text) > LETTERS_MOST:
        faults.append(f"the text has more than {LETTERS_MOST} characters; expected a tableau")
    if faults:
        raise FvsolveError(_message(method.name, faults))
    # Not before the named numbers are valid: each entry with a wrong one would be a further fault.
    head, weights = _rows(method.text, numbers, faults)
    if len(head) > STAGES_MOST:
        faults = [f"the text has more than {STAGES_MOST} stages; expected at most {STAGES_MOST}"]
    if not faults:
        faults += _mixed_roots([*head, *weights]) or _faults(head, weights, method)
    if not faults and method.start_weight is not None and len(weights) == 2:
        faults.append(
            "a second row of weights and start_weight both define the embedded solution; keep one of them"
        )
    if faults:
        raise FvsolveError(_message(method.name, faults))
    s = len(head)
    c, b = tuple(row[0] for row in head), tuple(weights[0])
    a = _square(head)
    embedded, start = tuple(weights[1]) if len(weights) == 2 else (), Fraction(0)
    try:
        if method.start_weight is not None:
            start = _entry_of(method.start_weight, numbers)
            if len(set(c)) < s:
                raise ValueError(
                    "expected stages at different times for an embedded solution that integrates polynomials"
                )
            embedded = extrapolated(c, start)
    except ValueError as error:
        faults.append(f"start_weight: {error}")
    dense = _dense(method.given_dense, b, numbers, faults)
    if faults:
        raise FvsolveError(_message(method.name, faults))
    return Array(a, b, c, embedded, start, dense or collocation(a, b, c, method.rounding))


def _named_numbers(given: Mapping, faults: list[str]) -> dict:
    """Exact values of the argument `numbers` of `tableau`, by name; faults are added to the list `faults`."""
    numbers = {}
    for name, pair in given.items():
        valid = (
            isinstance(name, str)
            and name.isidentifier()
            and isinstance(pair, Sequence)
            and len(pair) == 2
        )
        if not valid or not isinstance(pair[0], str) or not is_number(pair[1]):
            expected = (
                'a name, with a polynomial and the value near its root: {"g": ("x^2-2x+1/2", 0.29)}'
            )
            faults.append(f"numbers: {show(name)} = {show(pair)}; expected {expected}")
            continue
        try:
            numbers[name] = root(name, *pair)
        except ValueError as error:
            faults.append(f"{name}: {error}")
    return numbers


def _dense(given: Sequence, b: tuple, numbers: Mapping, faults: list[str]) -> tuple[tuple, ...]:
    """Exact coefficients of the dense output, which must give the new state at theta = 1; faults are added to `faults`.

    given : argument `dense` of `tableau`; b : weights; numbers : see `_rows`
    """
    lengths = {
        len(row) if isinstance(row, (Sequence, np.ndarray)) and not isinstance(row, str) else 0
        for row in given
    }
    if len(given) and (len(given) != len(b) or len(lengths) != 1 or lengths == {0}):
        faults.append(
            f"dense: expected {len(b)} rows, one for each stage, with equal numbers of coefficients"
        )
        return ()
    rows = []
    for i, (row, weight) in enumerate(zip(given, b, strict=False), start=1):
        try:
            rows.append(tuple(_entry_of(str(x), numbers) for x in row))
            if abs(float(sum(rows[-1], Fraction(0)) - weight)) > DENSE_ERROR * (
                1.0 + sum(abs(float(x)) for x in rows[-1])
            ):
                raise ValueError(
                    f"it adds up to {_show(sum(rows[-1], Fraction(0)))}; expected the weight {_show(weight)}"
                )
        except ValueError as error:
            faults.append(f"dense, row {i}: {error}")
    return tuple(rows)


def _entry_of(text: str, numbers: Mapping):
    """Exact value of an entry; raises ValueError for any other text, and for a value beyond `LARGEST`."""
    value = value_of(text, numbers)
    if abs(value) > LARGEST:
        raise ValueError(f'"{text}" is beyond {LARGEST:.0e}')
    return value


def _square(head: list) -> tuple[tuple, ...]:
    """Butcher matrix from rows [c, a1, ...], with zeros after the entries of each row."""
    return tuple(tuple(row[1:] + [Fraction(0)] * (len(head) - len(row) + 1)) for row in head)


def _rows(text: str, numbers: Mapping, faults: list[str]) -> tuple[list, list]:
    """(rows [c, a1, ...] above the ruled line of a tableau, rows [b1, ...] below it), in exact numbers.

    numbers : names of irrational numbers and their values; faults are added to the list `faults`
    """
    head = []
    weights = []
    below = False
    for line in text.strip().splitlines():
        line = line.strip()
        shown = line if len(line) <= LINE_SHOWN else f"{line[:LINE_SHOWN]}..."
        # So many stages are a fault anyway, and each further entry would cost exact arithmetic.
        if len(head) > STAGES_MOST:
            break
        if set(line) <= set("-+ "):
            below = True
            continue
        left, bar, right = line.partition("|")
        if not bar:
            faults.append(f'"{shown}" has no "|"')
        row = []
        for word in right.split() if below else [left.strip(), *right.split()]:
            try:
                row.append(_entry_of(word, numbers))
            except ValueError as error:
                faults.append(f'row "{shown}": {error}')
        (weights if below else head).append(row)
    if not head or not below:
        faults.append("incomplete tableau; expected rows, a line of dashes and weights")
    return head, weights


def _mixed_roots(rows: list) -> list[str]:
    fields = {x.field.name for row in rows for x in row if isinstance(x, Algebraic)}
    return [MIXED_ROOTS.format(" and ".join(sorted(fields)))] if len(fields) > 1 else []


def _faults(head: list, weights: list, method: Method) -> list[str]:
    """Texts of the faults of a tableau: rows of wrong length or wrong sum, a wrong number of rows of weights.

    head, weights : results of `_rows`
    """
    s = len(head)
    rounding = method.rounding
    faults = []
    wrong_sums = []

    def differs(row, expected) -> bool:
        total = sum(row, Fraction(0))
        return (
            abs(total - expected) > 2 * rounding * sum((abs(x) for x in row), Fraction(1))
            if rounding
            else total != expected
        )

    for i, (c, *row) in enumerate(head, start=1):
        if len(row) > s:
            faults.append(f"row {i} has {len(row)} entries; expected at most {s}")
        elif differs(row, c):
            wrong_sums.append(
                f"row {i} adds up to {_show(sum(row, Fraction(0)))}; expected c = {_show(c)}"
            )
    if not 1 <= len(weights) <= 2 or any(len(row) != s for row in weights):
        text = f"wrong rows of weights below the line; expected one or two rows of {s} numbers"
        longer = [len(row) for row in weights] == [s + 1]
        faults.append(f"{text}; is the first row `0 |` missing?" if longer else text)
    else:
        for row in weights:
            if differs(row, 1):
                wrong_sums.append(f"weights add up to {_show(sum(row, Fraction(0)))}; expected 1")
        # If the sums hold for rounded decimals, the message says so.
        if wrong_sums and not faults:
            order = _rounded_order(method.text, _square(head), weights[0], method.given_digits)
            wrong_sums[-1] += f"; {rounding_text(method.text, order)}" if order else ""
        faults += wrong_sums
        if len(weights) == 2 and not faults and not _estimates(head, weights, rounding):
            faults.append(
                "both rows of weights give the same solution, so the error estimate is zero; expected an "
                "embedded solution of another order, or a single row of weights"
            )
    return faults or wrong_sums


def _estimates(head: list, weights: list, rounding: Fraction) -> bool:
    """True if the embedded solution differs from the new state: stages with equal rows count as a single stage."""
    totals: dict[tuple, Any] = {}
    for stage, x, y in zip(_square(head), *weights, strict=True):
        totals[stage] = totals.get(stage, Fraction(0)) + x - y
    size = max(abs(x) for row in weights for x in row)
    return any(abs(total) > 2 * rounding * size for total in totals.values())


def _show(value) -> str:
    text = str(value)
    return text if len(text) <= 24 else f"{float(value):.17g}"


def _message(name: str, faults: list[str]) -> str:
    more = [f"and {len(faults) - FAULTS_SHOWN} more"] if len(faults) > FAULTS_SHOWN else []
    lines = [f"{name}: {len(faults)} faults", *faults[:FAULTS_SHOWN], *more]
    return f"{name}: {faults[0]}" if len(faults) == 1 else "\n  ".join(lines)


def _floats(rows) -> np.ndarray:
    return np.array(
        [[float(x) for x in row] if isinstance(row, tuple) else float(row) for row in rows],
        dtype=np.float64,
    )
