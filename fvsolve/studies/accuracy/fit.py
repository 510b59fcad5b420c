"""How fast errors fall: a fitted order, or a sentence why there is none. Knows sizes and errors; knows no run.

The fit is the least-squares slope of log error over log size over a window of successive rows. The window ends at the
last row that is not at the floor and begins where the orders between rows come near the slope: rows before it are
pre-asymptotic, rows behind it at the floor. What is neither is no order, and then no number is given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fvsolve.doors import NUMBER, SERIES, Kind, door, is_array
from fvsolve.errors import FvsolveError

LEAST_ROWS = 3
ABOVE_FLOOR = 10.0  # times the floor that an error must be to say anything of the order
FLAT = 10.0  # errors at the floor lie within this factor of each other
RISE = 1.5  # factor by which an error before the window may lie below the next
STEEPER = 3.0  # times a slope, which rows before it may fall
CLEAR = 0.03  # spread of a line that shows what lies above it, times 1 + order
LEAST_FALL = 1.8  # factor by which errors must fall over the window
LEAST_ORDER = 0.2
DRIFT = 1.5, 3.0  # last steps by which orders that drift may still go on: where steps get less, and where not
NO_ERROR = "no order: no row has an error above zero"
PRE, FLOOR, ASIDE, FAILED = "pre-asymptotic", "floor", "off the line", "failed"


@dataclass(frozen=True)
class Fit:
    """An order with its spread, or the reason why there is none.

    pairwise : order between each row and the next, NaN where there is none
    order, spread : slope over the window, and how far from it its rows' pairwise orders lie or drift; NaN with a reason
    marks : per row "", "pre-asymptotic", "floor", "off the line" or "failed"; rows without a mark are fitted
    constant : of error = constant size^order; reason : "" where there is a number; note : what is to be said beside it
    """

    pairwise: tuple[float, ...]
    order: float
    spread: float
    marks: tuple[str, ...]
    constant: float = math.nan
    reason: str = ""
    note: str = ""

    def plain(self) -> dict:
        """As plain data."""
        return {
            "order": self.order, "spread": self.spread, "constant": self.constant, "pairwise": list(self.pairwise),
            "marks": list(self.marks), "reason": self.reason, "note": self.note,
        }  # fmt: skip


ERRORS = Kind(lambda given: is_array(given, "fiu", 1, 1, finite=False), "a row of numbers")


@door(sizes=SERIES, errors=ERRORS, floor=NUMBER)
def fit(sizes, errors, floor: float = 0.0) -> Fit:
    """The order p of errors ~ C sizes^p, sizes falling; errors below ten times `floor` mean nothing.

    sizes : float64[n]  of cells or steps; errors : float64[n]  not negative, NaN where a run failed
    Raises FvsolveError for sizes that do not fall, or errors below zero.
    """
    h, e = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    if floor < 0.0:
        raise FvsolveError(f"floor = {floor:g}; wanted a number from 0 on")
    if h.shape != e.shape:
        raise FvsolveError(f"{h.size} sizes and {e.size} errors; wanted one error for each size")
    if np.any(~np.isfinite(h)) or np.any(h <= 0.0) or np.any(np.diff(h) >= 0.0):
        raise FvsolveError("sizes must be positive and fall from row to row")
    if np.any(e < 0.0):
        raise FvsolveError("errors must not be negative; give their absolute values")
    rows = FitRows(h, e, floor)
    if rows.good.size < LEAST_ROWS:
        return rows.none(rows.too_few())
    found = rows.whole() or rows.without_one() or rows.whole(strict=False) or rows.none(rows.why())
    return rows.none(rows.drifting()) if found.spread >= found.order else found


class FitRows:
    """The rows of one fit."""

    def __init__(self, h: np.ndarray, e: np.ndarray, floor: float) -> None:
        self.h, self.e, self.floor = h, e, floor
        self.marks = [FAILED if not math.isfinite(x) else "" for x in e]
        self.pairwise = tuple(float(p) for p in pair_orders(h, e))
        at_floor = [i for i, x in enumerate(e) if math.isfinite(x) and (x == 0.0 or x < ABOVE_FLOOR * floor)]
        last = next((i for i in at_floor if all(k in at_floor or self.marks[k] for k in range(i, len(e)))), len(e))
        for i in at_floor:
            self.marks[i] = FLOOR if i >= last else ASIDE
        self.good = np.array([i for i, mark in enumerate(self.marks) if not mark], dtype=int)

    # answers ---------------------------------------------------------------------------------------------------

    def whole(self, strict: bool = True) -> Fit | None:
        """A window among all rows; not strict: one whose last order steps off, which its spread then covers."""
        found = window(self.h[self.good], self.e[self.good], strict)
        return None if found is None else self.made(self.good, *found)

    def without_one(self) -> Fit | None:
        """A window among all rows but one that lies far below the line of the others: an error that changes sign."""
        best = None
        for i in range(1, len(self.good) - 1):
            rest = np.delete(self.good, i)
            found = window(self.h[rest], self.e[rest])
            if found is None or found[1] - found[0] < LEAST_ROWS + 1 or not found[0] < i < found[1]:
                continue
            made = self.made(rest, *found, aside=int(self.good[i]))
            line = made.constant * self.h[self.good[i]] ** made.order
            if self.e[self.good[i]] < 0.5 * line and (best is None or made.spread < best.spread):
                best = made
        return best

    def made(self, rows: np.ndarray, first: int, stop: int, note: str = "", aside: int | None = None) -> Fit:
        marks = list(self.marks)
        for k, i in enumerate(rows):
            marks[i] = PRE if k < first else FLOOR if k >= stop and not note else ASIDE if k >= stop else ""
        if aside is not None:
            marks[aside] = ASIDE
            note = note or "one error lies far below the line of the others, as where errors change sign"
        h, e = self.h[rows[first:stop]], self.e[rows[first:stop]]
        slope, height = line_of(h, e)
        p, seen = pair_orders(h, e), rows[max(first - 1, 0) : stop]
        still = DRIFT[0] if FLOOR in marks else still_to_go(pair_orders(self.h[seen], self.e[seen]))
        limit = p[-1] + still * (p[-1] - p[-2])
        spread = float(np.max(np.abs([*p, limit] - np.float64(slope))))
        return Fit(self.pairwise, slope, spread, tuple(marks), math.exp(height), "", note)

    def none(self, reason: str) -> Fit:
        return Fit(self.pairwise, math.nan, math.nan, tuple(self.marks), math.nan, reason)

    # reasons ---------------------------------------------------------------------------------------------------

    def too_few(self) -> str:
        """Why fewer than three rows are left."""
        if not np.any(self.e > 0.0):
            return NO_ERROR
        if FLOOR in self.marks or ASIDE in self.marks:
            return f"no order: {len(self.good)} of {len(self.h)} rows are above the floor; wanted {LEAST_ROWS}"
        return f"no order: {len(self.good)} rows; wanted {LEAST_ROWS} at least"

    def why(self) -> str:
        """Why no window was found."""
        e, p = self.e[self.good], pair_orders(self.h[self.good], self.e[self.good])
        if np.any(e[1:] > RISE * e[:-1]) and not e[-1] < e[0] / LEAST_FALL:
            return "no order: the errors do not fall"
        if np.all(p < LEAST_ORDER):
            return f"no order: the errors hardly fall, by orders below {LEAST_ORDER:g}"
        if p[-1] < LEAST_ORDER:
            return "no order: the errors reach a floor before three rows show one order; begin coarser"
        told = ", ".join(f"{x:.2f}" for x in p[-3:])
        return f"no order: the last orders between rows differ ({told}); refine further, or less"

    def drifting(self) -> str:
        """Why a window says nothing whose orders may go on to zero, or to twice what they are."""
        told = ", ".join(f"{x:.2f}" for x in pair_orders(self.h[self.good], self.e[self.good])[-3:])
        rows = self.good.size
        return f"no order: orders between rows still drift ({told}); {rows} rows do not settle, ask for {rows + 2}"


def pair_orders(h: np.ndarray, e: np.ndarray) -> np.ndarray:
    """log(e[i] / e[i+1]) / log(h[i] / h[i+1]) : float64[n-1], NaN where an error is zero or not finite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.log(e[:-1] / e[1:]) / np.log(h[:-1] / h[1:])
    return np.where(np.isfinite(found), found, math.nan)


def still_to_go(p: np.ndarray) -> float:
    """How many of its last steps a drift of orders may still go on: a geometric series, where three orders show one."""
    least, most = DRIFT
    if len(p) < LEAST_ROWS:
        return most
    before, last = p[-2] - p[-3], p[-1] - p[-2]
    if before * last <= 0.0:
        return least
    share = last / before
    return most if share >= 1.0 else min(max(share / (1.0 - share), least), most)


def line_of(h: np.ndarray, e: np.ndarray) -> tuple[float, float]:
    """Slope and height of the least-squares line of log e over log h."""
    slope, height = np.polyfit(np.log(h), np.log(e), 1)
    return float(slope), float(height)


def near(order: float) -> float:
    """How far orders between rows may lie from the slope that they share."""
    return 0.12 + 0.04 * order


def window(h: np.ndarray, e: np.ndarray, strict: bool = True) -> tuple[int, int, str] | None:
    """(first, stop, note) of the rows that show one order, all others explained; None where there are none.

    The latest window wins. Behind it the errors must be flat, or a single row leaves a line of four rows at least.
    """
    p = pair_orders(h, e)
    for stop in range(len(h), LEAST_ROWS - 1, -1):
        first = stop - LEAST_ROWS
        if not agrees(h, e, first, stop) or (strict and leaves(p[: stop - 1])):
            continue
        first, stop = widened(h, e, p, first, stop)
        note = behind(h, e, first, stop)
        if e[first] < LEAST_FALL * e[stop - 1] or hides(h, e, first, stop):
            continue
        if note is not None and np.all(e[1 : first + 1] < RISE * e[:first]):
            return first, stop, note
    return None


def agrees(h, e, first: int, stop: int) -> bool:
    """Whether rows lie on one falling line."""
    slope, _ = line_of(h[first:stop], e[first:stop])
    spread = np.max(np.abs(pair_orders(h[first:stop], e[first:stop]) - slope))
    return slope >= LEAST_ORDER and spread <= near(slope)


def leaves(p: np.ndarray) -> bool:
    """Whether the last of some orders steps off from the others: what converges steps less and less."""
    if len(p) < LEAST_ROWS:
        return False
    before, last = np.abs(np.diff(p[-3:]))
    return bool(last > 2.0 * before + 0.03 * (1.0 + max(p[-2], 0.0)))


def hides(h, e, first: int, stop: int) -> bool:
    """Whether a short or rough window follows rows that fell much faster: it may be nothing but their floor."""
    slope, _ = line_of(h[first:stop], e[first:stop])
    before = np.max(pair_orders(h[: first + 1], e[: first + 1]), initial=0.0)
    return bool(before > STEEPER * slope + 0.3) and not (stop - first > LEAST_ROWS and clear(h, e, first, stop))


def clear(h, e, first: int, stop: int) -> bool:
    """Whether rows lie so well on a line that what lies above it behind them can be seen."""
    slope, _ = line_of(h[first:stop], e[first:stop])
    spread = np.max(np.abs(pair_orders(h[first:stop], e[first:stop]) - slope))
    return bool(spread < CLEAR * (1.0 + slope))


def widened(h, e, p, first: int, stop: int) -> tuple[int, int]:
    """The window with the rows before it that lie on its line, and without a last one that begins to leave it."""
    while first > 0 and agrees(h, e, first - 1, stop) and abs(p[first - 1] - line_of(h[first:stop], e[first:stop])[0]) \
            <= near(0.5 * (p[first - 1] + p[first])):  # fmt: skip
        first -= 1
    whole = np.max(np.abs(np.diff(p[first : stop - 1])), initial=0.0)
    inner = np.max(np.abs(np.diff(p[first : stop - 2])), initial=0.0)
    leaving = p[stop - 2] < np.min(p[first : stop - 2], initial=math.inf)
    if stop < len(h) and stop - first > LEAST_ROWS and leaving and inner < whole / 3.0:
        return first, stop - 1
    return first, stop


def behind(h, e, first: int, stop: int) -> str | None:
    """What the rows behind a window are: "" a floor, a note for one that leaves the line, None for neither."""
    rest = e[stop:]
    if rest.size == 0:
        return ""
    slope, height = line_of(h[first:stop], e[first:stop])
    over = rest - np.exp(height) * h[stop:] ** slope  # what the line does not explain
    last = e[stop - 1]
    if rest.size >= 2 and np.all(over > 0.0) and over.max() < FLAT * over.min() and rest.max() < FLAT * last:
        falls = math.log(over[0] / over[-1]) / math.log(h[stop] / h[-1])
        settled = pair_orders(h[-2:], e[-2:])[0] < 0.5 * slope
        if falls < min(0.3 * slope, 0.4) and (settled or clear(h, e, first, stop)):
            return ""
    if rest.size == 1 and stop - first > LEAST_ROWS:
        if 0.0 < over[0] and rest[0] < RISE * last and abs(rest[0] / last - 1.0) < 0.1 * slope:
            return ""  # no longer falls at all
        return "the last row leaves the line: a floor, or another order, begins there"
    return None
