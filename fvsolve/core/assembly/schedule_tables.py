"""Schedules as pieces (polynomial, power, wave) for kernels, and the times at which steps must end."""

from dataclasses import dataclass, field, replace

import numpy as np

from fvsolve.core.kernels.dtypes import PIECE_COLUMNS, SCHEDULE
from fvsolve.core.kernels.formula_programs import FLAG, STEPS, program_slopes, run_program
from fvsolve.core.kernels.schedule_pieces import (
    BLOCK,
    BLOCK_PART,
    CREST,
    FORMULA,
    POWER,
    WAVE,
    piece_at,
    piece_slopes,
    value_with_limit,
)

STEPS_PER_PERIOD = 8  # least number of steps in a period
SMALL_MOVE = 1e-9  # change of a formula between two samples that is rounding, over its range
# samples that show a wave; divisions of a run in search of short waves
SAMPLES_IN_HALF_WAVE, LEVELS = 4, 6
SAMPLED = 32  # schedules with more entries are samples of a smooth function
# for samples, change of slope, relative to the greatest slope, at which a step must end
SAMPLE_KINK = 0.2


@dataclass
class Schedules:
    """Table of all schedules of a model, filled one by one.

    span : time span in which kinks of periodic schedules are listed [s]; blocks : name of a block -> its number
    """

    span: tuple[float, float] = (0.0, 0.0)

    blocks: dict[str, int] = field(default_factory=dict)
    # those of the model, as for `ModelDraft`
    events: list[tuple[str, str]] = field(default_factory=list)
    stack: int = 1  # size of the work array of formulas
    records: list[tuple[int, int]] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    breaks: dict[float, bool] = field(default_factory=dict)  # time -> True if a value jumps
    spacing: float = np.inf  # greatest step for periods and samples [s]
    known_values: dict[tuple[int, float], float] = field(
        default_factory=dict
    )  # (index, time) -> value, after all are added

    def add_constant(self, value: float) -> int:
        """Add a schedule with a constant value; return its index."""
        self.records.append((len(self.rows), 1))
        self.rows.append([-np.inf, 0.0, 0.0, value, 0.0, 0.0, 0.0])
        return len(self.records) - 1

    def add(self, schedule, scale: float = 1.0, offset: float = 0.0) -> int:
        """Add a schedule with the value scale * value + offset; return its index."""
        if schedule.kind == "constant":
            return self.add_constant(schedule.first * scale + offset)
        if schedule.kind == "control":
            return self.add_block(schedule, BLOCK, scale, offset)
        if schedule.kind == "formula":
            return self.add_formula(schedule, scale, offset)
        table = schedule_pieces(schedule)
        table[:, 3:] = scaled(table, scale, offset)
        pieces = table.tolist()
        self.records.append((len(self.rows), len(pieces)))
        self.rows += pieces
        for time, jump in break_times(schedule):
            self.breaks[time] = self.breaks.get(time, False) or jump
        if schedule.kind == "harmonic":
            self.spacing = min(self.spacing, schedule.wave[2] / STEPS_PER_PERIOD)
        if len(schedule.time) > SAMPLED:
            self.spacing = min(self.spacing, 4.0 * float(np.median(np.diff(schedule.time))))
        return len(self.records) - 1

    def add_part(self, schedule, scale: float, offset: float = 0.0) -> int:
        """Add the positive part of scale * value + offset of a schedule; return its index.

        It has kinks where the value is zero; steps must end there.
        """
        if schedule.kind == "control":
            return self.add_block(schedule, BLOCK_PART, scale, offset)
        if schedule.kind == "formula":
            program = schedule.program.positive_part(scale, offset)
            return self.add_formula(replace(schedule, program=program), 1.0, 0.0)
        index = self.add(schedule, scale, offset)
        first, count = self.records[index]
        if schedule.kind == "harmonic":
            self.rows[first][1] = CREST
            self.breaks |= {
                time: self.breaks.get(time, False)
                for time in wave_roots(self.rows[first], self.span)
            }
            return index
        rows, crossings = positive_part(np.array(self.rows[first : first + count]))
        self.rows[first:], self.records[index] = rows, (first, len(rows))
        for time in crossings:
            self.breaks.setdefault(time, False)
        return index

    def add_block(self, schedule, kind: float, scale: float, offset: float) -> int:
        """Add a schedule that follows a block, kind BLOCK or BLOCK_PART; return its index."""
        self.records.append((len(self.rows), 0))
        number = float(self.blocks[schedule.origin["control"]])
        self.rows.append([-np.inf, kind, number, scale, offset, 0.0, 0.0])
        return len(self.records) - 1

    def add_formula(self, schedule, scale: float, offset: float) -> int:
        """Add a formula of time with the value scale * value + offset; return its index."""
        first = self.add_program(schedule.program, scale, offset)
        self.records.append((first, -1))
        for time, jump in schedule.program.breaks():
            self.breaks[time] = self.breaks.get(time, False) or jump
        for time in schedule.program.pulses(*self.span):
            self.breaks.setdefault(time, False)
        self.spacing = min(self.spacing, period_of(schedule.program, *self.span) / STEPS_PER_PERIOD)
        return len(self.records) - 1

    def add_program(
        self, program, scale: float = 1.0, offset: float = 0.0, located: bool = True
    ) -> int:
        """Add the steps of a formula, and its event functions if its kinks are `located`; return its header row."""
        first, flag = len(self.rows), len(self.events)
        self.rows += program.rows(scale, offset, flag, FORMULA)
        self.events += [(program.text, "")] * 2 * program.kinks * located
        self.stack = max(self.stack, program.stack_size)
        return first

    def tables(self, flags: int) -> tuple[np.ndarray, np.ndarray]:
        """Arrays that kernels read : (first piece and number of pieces of each schedule, float64[pieces, 7]).

        flags : number of event flags before those of `events`
        """
        rows = np.array(self.rows, dtype=np.float64).reshape(-1, PIECE_COLUMNS)
        rows[rows[:, 1] == FORMULA, FLAG] += flags
        return np.array(self.records, dtype=[("first", "i8"), ("pieces", "i8")]).astype(
            SCHEDULE
        ), rows


def period_of(program, start: float, end: float) -> float:
    """Period of the waves of a formula of time [s]: twice the median time between its turns; inf without waves.

    The samples of a run are too few for short waves: then it is that of the first hundredth of the run, and so on.
    """
    gap = np.inf
    for _ in range(LEVELS):
        times, values = program.samples(start, end)
        change = np.diff(values)
        # the ends of plateaus are no turns
        moves = np.flatnonzero(np.abs(change) > SMALL_MOVE * np.ptp(values))
        turns = times[moves[1:][np.diff(np.sign(change[moves])) != 0.0]]
        if turns.size < 2:
            break
        gap = float(np.median(np.diff(turns)))
        if gap > SAMPLES_IN_HALF_WAVE * (end - start) / len(times):
            break
        end = start + 0.01 * (end - start)
    return 2.0 * gap


def value_at(tables, index: int, t: float, limit: float) -> float:
    """Value of schedule `index` at time t [s], continuous from the right; from `limit` [s] on, its left limit there.

    A schedule that follows a block has its value at the start. tables : tables of a model, or its draft
    """
    record = tables.schedules[index]
    if record["pieces"] >= 0:
        return float(value_with_limit(tables.schedules, tables.pieces, index, t, limit))
    first, none = int(record["first"]), np.zeros(0)
    stack = np.zeros(int(tables.pieces[first, STEPS]) + 1)
    return float(run_program(tables.pieces, first, t, limit, 0, stack, none, none))


def slope_at(tables, index: int, t: float, limit: float) -> float:
    """Rate of change of schedule `index` at time t [1/s]; from `limit` [s] on, its left limit there."""
    record = tables.schedules[index]
    if record["pieces"] >= 0:
        piece = piece_at(tables.pieces, record["first"], record["pieces"], t, limit)
        return float(piece_slopes(tables.pieces, piece, t)[0])
    first = int(record["first"])
    stack = np.zeros(3 * int(tables.pieces[first, STEPS]) + 3)
    return float(program_slopes(tables.pieces, first, t, limit, stack)[0])


def schedule_pieces(schedule) -> np.ndarray:
    """Pieces of a schedule : float64[pieces, 7].

    Columns: start time [s], kind, origin [s], then four numbers. Polynomial (kind 0): a, b, c, d of a + b s + c s^2 + d
    s^3, s the time since the origin. Power (1): v0, v1, duration, exponent. Wave (2): mean, amplitude, angular
    frequency, phase.
    """
    t, v = schedule.time, schedule.value
    if schedule.kind == "harmonic":
        mean, amplitude, period, phase = schedule.wave
        return np.array([[-np.inf, WAVE, 0.0, mean, amplitude, 2.0 * np.pi / period, phase]])
    hold = [[-np.inf, 0, 0.0, v[0], 0, 0, 0]]
    last = [[t[-1], 0, t[-1], v[-1], 0, 0, 0]]
    if schedule.kind == "constant":
        return np.array(hold)
    if schedule.kind == "ramp":
        span = t[1] - t[0]
        return np.array([*hold, [t[0], 1, t[0], v[0], v[1], span, schedule.exponent], *last])
    if schedule.kind == "step":
        none = np.zeros(len(t) - 1)
        return np.concatenate(
            [hold, np.column_stack([t[1:], none, t[1:], v[1:], none, none, none])]
        )
    if schedule.kind == "linear":
        slope, none = np.diff(v) / np.diff(t), np.zeros(len(t) - 1)
        inner = np.column_stack([t[:-1], none, t[:-1], v[:-1], slope, none, none])
        return np.concatenate([hold, inner, last])
    from scipy.interpolate import PchipInterpolator

    c = PchipInterpolator(t, v).c
    inner = np.column_stack([t[:-1], np.zeros(len(t) - 1), t[:-1], *c[::-1]])
    return np.concatenate([hold, inner, last])


def scaled(pieces: np.ndarray, scale: float, offset: float) -> np.ndarray:
    """Last four columns of pieces (see `schedule_pieces`) for the value scale * value + offset."""
    values, nonpolynomial = pieces[:, 3:] * scale, pieces[:, 1] != 0
    values[:, 0] += offset
    if not nonpolynomial.any():
        return values
    power = pieces[:, 1] == POWER
    values[power, 1] += offset
    values[nonpolynomial, 2:] = pieces[nonpolynomial, 5:]
    return values


def break_times(schedule) -> list[tuple[float, bool]]:
    """Times of kinks and jumps of a schedule, at which steps must end : (time [s], True if the value jumps)."""
    t, v = schedule.time, schedule.value
    if schedule.kind in ("constant", "harmonic"):
        return []
    if schedule.kind == "formula":
        return schedule.program.breaks()
    if schedule.kind == "ramp":
        return [(float(t[0]), False), (float(t[1]), False)]
    if schedule.kind == "step":
        return [(float(t[k]), True) for k in range(1, len(t)) if v[k] != v[k - 1]]
    slope = np.diff(v) / np.diff(t)
    if schedule.kind == "smooth":
        pieces = schedule_pieces(schedule)[1:-1]
        ends = pieces[0, 4], piece_slope(pieces[-1], t[-1])
        change = np.zeros(len(t))
        change[0], change[-1] = ends
    else:
        change = np.diff(np.concatenate(([0.0], slope, [0.0])))
    least = (SAMPLE_KINK if len(t) > SAMPLED else 1e-9) * np.max(np.abs(slope), initial=0.0)
    return [
        (float(time), False)
        for time, slope_change in zip(t, change, strict=True)
        if abs(slope_change) > least
    ]


def piece_slope(piece: np.ndarray, t: float) -> float:
    """Derivative of a polynomial piece at time t."""
    s = t - piece[2]
    return piece[4] + s * (2.0 * piece[5] + s * 3.0 * piece[6])


def positive_part(pieces: np.ndarray) -> tuple[list[list[float]], list[float]]:
    """Positive part of a schedule : (pieces of max(0, value), times at which the value crosses zero inside a piece)."""
    rows, crossings = [], []
    for k, piece in enumerate(pieces):
        start, end = piece[0], pieces[k + 1, 0] if k + 1 < len(pieces) else np.inf
        tolerance = (
            1e-12 * max(abs(start), abs(end), end - start)
            if np.isfinite([start, end]).all()
            else 0.0
        )
        inside = [t for t in piece_roots(piece) if start + tolerance < t < end - tolerance]
        crossings += inside
        for low, high in zip([start, *inside], [*inside, end], strict=True):
            middle = 0.5 * (low + high) if np.isfinite([low, high]).all() else piece[2]
            positive = piece_value(piece, middle) > 0.0
            rows.append([low, *piece[1:]] if positive else [low, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return rows, crossings


def wave_roots(piece: list[float], span: tuple[float, float]) -> list[float]:
    """Times within `span` at which the value of a wave piece is zero, increasing."""
    mean, amplitude, frequency, phase = piece[3:]
    if abs(mean) >= abs(amplitude):
        return []
    up = np.arcsin(-mean / amplitude)
    roots = []
    for angle in (up, np.pi - up):
        first, last = ((frequency * t + phase - angle) / (2.0 * np.pi) for t in span)
        roots += [
            (angle - phase + 2.0 * np.pi * k) / frequency
            for k in range(int(np.ceil(first)), int(np.floor(last)) + 1)
        ]
    return sorted(roots)


def piece_value(piece: np.ndarray, t: float) -> float:
    """Value of a polynomial or power piece at a time within it."""
    s = t - piece[2]
    if piece[1] == 0:
        return piece[3] + s * (piece[4] + s * (piece[5] + s * piece[6]))
    return piece[4] + (piece[3] - piece[4]) * max(0.0, 1.0 - s / piece[5]) ** piece[6]


def piece_roots(piece: np.ndarray) -> list[float]:
    """Times at which a polynomial or power piece is zero, increasing; none for a constant piece.

    Roots of a polynomial may be outside the interval of the piece.
    """
    if piece[1] == 1:
        v0, v1, duration, exponent = piece[3:]
        return (
            [piece[2] + duration * (1.0 - (v1 / (v1 - v0)) ** (1.0 / exponent))]
            if v0 * v1 < 0.0
            else []
        )
    roots = np.roots(piece[:2:-1]) if np.any(piece[4:]) else np.zeros(0)
    return sorted(piece[2] + float(s.real) for s in roots if abs(s.imag) <= 1e-9 * abs(s))
