"""Formulas of time, and of inputs of blocks: text, steps for the stack machine, breaks, range of values in a run."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.core.kernels import formula_programs as code
from fvsolve.parts.formula import FUNCTIONS, TIME_NAMES, Arithmetic
from fvsolve.parts.formula_intervals import Enclosure, enclose, find_pole, find_pulses, in_unit
from fvsolve.parts.value import ValueFault
from fvsolve.units import show

CODES = {
    np.add: code.ADD,
    np.subtract: code.SUBTRACT,
    np.multiply: code.MULTIPLY,
    np.divide: code.DIVIDE,
    np.power: code.POWER_OF,
    np.negative: code.NEGATE,
    np.sin: code.SINE,
    np.cos: code.COSINE,
    np.tan: code.TANGENT,
    np.arctan2: code.ARCTANGENT,
    np.exp: code.EXPONENTIAL,
    np.log: code.LOGARITHM,
    np.sqrt: code.ROOT,
    np.tanh: code.TANH,
    np.hypot: code.HYPOTENUSE,
    np.where: code.WHERE,
    np.abs: code.ABSOLUTE,
    np.minimum: code.LEAST,
    np.maximum: code.GREATEST,
    np.less: code.LESS,
    np.less_equal: code.LESS,
    np.greater: code.MORE,
    np.greater_equal: code.MORE,
}
# values of a formula at equal distances in a run, from which its range and its periods are found
SAMPLES = 4001
NO_FLAGS = np.zeros(0)
TIME_FORMULA = re.compile(r"(?<![\w.])t(?![\w.])|" + "|".join(rf"\b{name}\(" for name in FUNCTIONS))


@dataclass(frozen=True, eq=False)
class Program:
    """Formula as steps of the stack machine.

    text : formula; names : its inputs; scale, offset : SI value = scale * value of the formula + offset
    clock : False for a formula without the time t
    """

    text: str
    names: tuple[str, ...] = ()
    scale: float = 1.0
    offset: float = 0.0
    clock: bool = True

    @cached_property
    def steps(self) -> list[tuple[int, float]]:
        """(code, number) of each step. Raises ValueError for a text that is not a formula."""
        result: list[tuple[int, float]] = []
        widths: list[list[int]] = []  # steps that compute each value on the stack
        for step in Arithmetic(self.text, names=(*TIME_NAMES[not self.clock :], *self.names)).steps:
            if step.count == 0:
                self.push(result, widths, step.rule)
            elif step.rule is not np.positive:
                self.apply(result, widths, step)
        return result

    def push(self, result: list, widths: list, rule: Any) -> None:
        """Add the step for a number or a name."""
        widths.append([len(result)])
        if rule == "t" and self.clock:
            result.append((code.TIME, 0.0))
        elif isinstance(rule, str) and rule != "pi":
            result.append((code.INPUT, float(self.names.index(rule))))
        else:
            result.append((code.CONSTANT, math.pi if rule == "pi" else rule))

    def apply(self, result: list, widths: list, step: Any) -> None:
        """Add the steps for a function of the last `step.count` values; functions of numbers are computed here."""
        if step.rule not in CODES:
            raise ValueError(
                f"{show(self.text)}: {step.part} compares for equality; expected < or >"
            )
        operands = widths[len(widths) - step.count :]
        del widths[len(widths) - step.count :]
        first = operands[0][0]
        own = [result[operand[0]] for operand in operands]
        if all(
            len(operand) == 1 and item[0] == code.CONSTANT
            for operand, item in zip(operands, own, strict=True)
        ):
            values = [item[1] for item in own]
            del result[first:]
            with np.errstate(all="ignore"):
                value = float(
                    step.rule(*values)
                    if len(values) < 3 or step.rule is np.where
                    else step.rule.reduce(values)
                )
            if not math.isfinite(value):
                raise ValueError(f"{show(self.text)}: {step.part} is not a number")
            result.append((code.CONSTANT, value))
        elif (past := self.compared_time(operands, own, CODES[step.rule])) is not None:
            del result[first:]
            result.append(past)
        else:
            result += [(CODES[step.rule], 0.0)] * (
                1 if step.rule is np.where else max(1, step.count - 1)
            )
        widths.append(list(range(first, len(result))))

    def compared_time(self, operands: list, own: list, kind: int) -> tuple[int, float] | None:
        """Step for a comparison of the time with a number; None for other steps."""
        if kind not in (code.LESS, code.MORE) or any(len(operand) > 1 for operand in operands):
            return None
        (left, a), (right, b) = own
        if (left, right) == (code.TIME, code.CONSTANT):
            return (code.BEFORE if kind == code.LESS else code.AFTER, b)
        if (left, right) == (code.CONSTANT, code.TIME):
            return (code.AFTER if kind == code.LESS else code.BEFORE, a)
        return None

    @property
    def kinks(self) -> int:
        """Number of steps whose result has a kink or a jump where two values are equal."""
        return sum(kind >= code.FIRST_KINK for kind, _ in self.steps)

    def rows(
        self, scale: float = 1.0, offset: float = 0.0, flag: int = 0, kind: float = 0.0
    ) -> list[list[float]]:
        """Rows of `pieces`: header and steps, for the value scale * SI value + offset; flag : first event flag."""
        header = [
            -np.inf,
            kind,
            len(self.steps),
            scale * self.scale,
            scale * self.offset + offset,
            flag,
            0.0,
        ]
        result, number = [header], 0
        for step, value in self.steps:
            if step >= code.FIRST_KINK:
                value, number = 2.0 * number, number + 1
            result.append([0.0, float(step), value, 0.0, 0.0, 0.0, 0.0])
        return result

    @cached_property
    def table(self) -> np.ndarray:
        """Rows of `pieces` of the program alone : float64[1 + steps, 7]."""
        return np.array(self.rows())

    @property
    def stack_size(self) -> int:
        """Size of the work array that the program needs."""
        return 3 * (len(self.steps) + len(self.names)) + 1

    def value(self, t: float, limit: float = np.inf, inputs: tuple[float, ...] = ()) -> float:
        """SI value at time t [s] with these inputs; from time `limit` on, its left limit there."""
        stack = np.zeros(self.stack_size)
        stack[: len(inputs)] = inputs
        return float(
            code.run_program(self.table, 0, t, limit, len(inputs), stack, NO_FLAGS, NO_FLAGS)
        )

    def breaks(self) -> list[tuple[float, bool]]:
        """Times at which a comparison with the time changes: (time [s], True if the value jumps), increasing."""
        return [(time, self.jumps(time)) for time in self.break_times]

    @property
    def break_times(self) -> list[float]:
        """Times at which a comparison with the time changes [s], increasing."""
        return sorted({value for step, value in self.steps if step in (code.BEFORE, code.AFTER)})

    def jumps(self, time: float) -> bool:
        """True if the value of a formula of time jumps at a break."""
        before, after = self.value(time, time), self.value(time)
        return not abs(after - before) <= 1e-12 * (abs(before) + abs(after))

    def samples(self, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """(times, values) of a formula of time in a run, with both sides of each break : float64[n] each."""
        times = np.linspace(start, end, SAMPLES)
        # no period falls on all samples
        places = np.arange(1, SAMPLES - 1) * 0.6180339887498949 % 1.0 - 0.5
        times[1:-1] += places * (times[1] - times[0])
        for t, _ in self.breaks():  # only both sides of a break, not its value once more
            times = times[np.abs(times - t) > 1e-6 * (end - start) / SAMPLES]
        pairs = [(t, self.value(t)) for t in times.tolist()]
        for t, _ in self.breaks():
            pairs += [(t, self.value(t, t)), (t, self.value(t))] if start <= t <= end else []
        pairs.sort(key=lambda pair: pair[0])
        return tuple(np.array(pairs).T)

    def bounds(self, begin: np.ndarray, end: np.ndarray) -> Enclosure:
        """Bounds of the SI value of a formula of time in the intervals from `begin` to `end` [s]."""
        return in_unit(enclose(self.steps, begin, end), self.scale, self.offset)

    def pole_fault(self, start: float, end: float) -> str:
        """Text of the fault of a formula of time that has a pole, or is no number, at a time in a run; "" without."""
        times, found = self.samples(start, end)
        bad = ~np.isfinite(found)
        t = float(times[int(np.argmax(bad))]) if bad.any() else find_pole(self.bounds, times, found)
        if t is None:
            return ""
        with np.errstate(all="ignore"):
            value = self.value(t)
        at = f"{show(self.text)} at t = {t:.6g} s"
        if not math.isfinite(value):
            return f"{at} is not a finite number"
        return f"{at} has a pole: it is {value:.3g}, beside values up to {np.abs(found).max():.3g}"

    def pulses(self, start: float, end: float) -> list[float]:
        """Times in a run at which steps end, so that none passes over a pulse of a formula of time, increasing [s]."""
        times, values = self.samples(start, end)
        return find_pulses(self.bounds, times, values) if np.isfinite(values).all() else []

    def has_jump(self, start: float, end: float) -> bool:
        """True if the value of a formula of time jumps in a run, at a break or at the steepest place of its samples."""
        if any(jump for time, jump in self.breaks() if start < time <= end):
            return True
        times, values = self.samples(start, end)
        k = int(np.argmax(np.abs(np.diff(values))))
        a = times[k]
        b = times[k + 1]
        change = abs(values[k + 1] - values[k])
        for _ in range(30 if self.kinks else 0):
            middle = 0.5 * (a + b)
            ahead = abs(self.value(middle) - self.value(a)) > 0.5 * abs(
                self.value(b) - self.value(a)
            )
            a, b = (a, middle) if ahead else (middle, b)
        return bool(
            self.kinks and change > 0.0 and abs(self.value(b) - self.value(a)) > 0.1 * change
        )

    def positive_part(self, scale: float, offset: float) -> Program:
        """Formula of the positive part of scale * value + offset."""
        value = f"{self.scale!r}*({self.text}) + {self.offset!r}"
        return Program(f"max(0, {scale!r}*({value}) + {offset!r})", self.names)


@lru_cache(maxsize=256)
def program_in(
    unit: str, dimension: str, text: str, names: tuple[str, ...], ambient: float
) -> Program:
    """Formula whose value has a unit; "" for SI. ambient : ambient pressure [Pa]

    Raises ValueFault with the faults of the keys `formula` and `unit`.
    """
    program, faults = Program(text, names), []
    try:
        if unit:
            entry = units.find(unit, dimension)
            shift, zero = ambient if entry.gauge and dimension == "pressure" else 0.0, entry.si(0.0)
            program = Program(text, names, entry.si(1.0) - zero, zero + shift)
    except ValueError as error:
        faults.append((("unit",), str(error)))
    try:
        program.steps  # noqa: B018
    except ValueError as error:
        hint = (
            "; numbers in a formula are in SI, without units"
            if str(error).endswith("invalid syntax")
            else ""
        )
        faults.append((("formula",), f"{error}{hint}"))
    if faults:
        raise ValueFault(faults)
    return program
