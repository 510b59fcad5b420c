"""Order of convergence fitted to errors, or the reason why no order is found.

A row is a size (of cells, steps or a tolerance) with the error of the run. The floor is an error that finer rows do not
reduce, such as rounding or the error of the reference. The window is a group of successive rows. The fit is the
least-squares slope of log error over log size in the window. The window ends at the last row above the floor. It begins
where the orders between rows come near the slope. Rows before the window are pre-asymptotic, rows after it are at the
floor. Rows off the line are errors at the floor before larger errors, a single error far below the line, and a single
last row that leaves the line. If other rows remain, there is no order, and no number is given.
"""

import math
from dataclasses import dataclass

import numpy as np

from fvsolve.argument_checks import NUMBER, SERIES, Kind, is_array, validated
from fvsolve.core.output.result_table import PlainData
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError

LEAST_ROWS = 3
FLOOR_MARGIN = 10.0  # an error below this multiple of the floor is not used
FLOOR_SPREAD = 10.0  # errors at the floor lie within this factor of each other
ALLOWED_RISE = 1.5  # greatest factor by which errors before the window may rise from row to row
STEEP_RATIO = 3.0  # greatest ratio of the orders before a short window to its slope
CLEAR_SPREAD = 0.03  # greatest spread of a clear line, times 1 + order
LEAST_REDUCTION = 1.8  # factor by which errors must fall over the window
LEAST_ORDER = 0.2
# further drift of orders, least and greatest, as a multiple of their last change
DRIFT_STEPS = 1.5, 3.0
NO_ERROR = "no order: no row has an error above zero"
PRE_ASYMPTOTIC, FLOOR, OFF_LINE, FAILED = "pre-asymptotic", "floor", "off the line", "failed"


@dataclass(frozen=True)
class Fit(PlainData):
    """Fitted order of convergence with its spread, or the reason why no order is found.

    pairwise : order between each row and the next, NaN if an error is zero or unknown
    order : slope of log error over log size for the fitted rows; NaN without an order
    spread : greatest distance from `order` of the orders between fitted rows, and of the order to which they drift
    marks : for each row "", "pre-asymptotic", "floor", "off the line" or "failed"; rows with "" are fitted
    constant : factor C of error = C size^order; reason : "" if there is an order; note : remark on the order
    """

    pairwise: tuple[float, ...]
    order: float
    spread: float
    marks: tuple[str, ...]
    constant: float = math.nan
    reason: str = ""
    note: str = ""

    json = "order spread constant pairwise marks reason note"


ERRORS = Kind(lambda value: is_array(value, "fiu", 1, 1, finite=False), "a row of numbers")


@declared("study")
@validated(sizes=SERIES, errors=ERRORS, floor=NUMBER)
def fit(sizes, errors, floor: float = 0.0) -> Fit:
    """Fit the order p of convergence, errors ~ C sizes^p with a constant C.

    sizes : float64[n]  decreasing sizes of cells or steps; errors : float64[n]  not negative, NaN if a run failed
    floor : error that is not reduced by refinement; errors below ten times the floor are not used
    Raises FvsolveError for sizes that are not positive or do not decrease, for negative errors, for a negative floor,
    and if the number of errors is not that of the sizes.
    """
    h, e = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    if floor < 0.0:
        raise FvsolveError(f"floor = {floor:g} is negative; expected a number of at least 0")
    if h.shape != e.shape:
        raise FvsolveError(f"{h.size} sizes and {e.size} errors; expected one error for each size")
    if np.any(~np.isfinite(h)) or np.any(h <= 0.0) or np.any(np.diff(h) >= 0.0):
        raise FvsolveError("sizes must be positive and fall from row to row")
    if np.any(e < 0.0):
        raise FvsolveError("errors must not be negative; try their absolute values")
    rows = FitRows(h, e, floor)
    if rows.good.size < LEAST_ROWS:
        return rows.no_fit(rows.too_few_reason())
    result = (
        rows.fit_all()
        or rows.fit_without_outlier()
        or rows.fit_all(strict=False)
        or rows.no_fit(rows.failure_reason())
    )
    # False for a fit without an order, whose spread and order are NaN
    return rows.no_fit(rows.drift_reason()) if result.spread >= result.order else result


class FitRows:
    """Rows of a fit: sizes h, errors e, and marks as in `Fit`; `good` are the indices of rows without a mark.

    floor : as for `fit`
    """

    def __init__(self, h: np.ndarray, e: np.ndarray, floor: float) -> None:
        self.h, self.e, self.floor = h, e, floor
        self.marks = [FAILED if not math.isfinite(x) else "" for x in e]
        self.pairwise = tuple(float(p) for p in pair_orders(h, e))
        at_floor = [
            i
            for i, x in enumerate(e)
            if math.isfinite(x) and (x == 0.0 or x < FLOOR_MARGIN * floor)
        ]
        last = next(
            (i for i in at_floor if all(k in at_floor or self.marks[k] for k in range(i, len(e)))),
            len(e),
        )
        for i in at_floor:
            self.marks[i] = FLOOR if i >= last else OFF_LINE
        self.good = np.array([i for i, mark in enumerate(self.marks) if not mark], dtype=int)

    # fits ---------------------------------------------------------------------------------------------------

    def fit_all(self, strict: bool = True) -> Fit | None:
        """Fit in the window of good rows (see `find_window`), or None; strict : False if the last order may deviate."""
        limits = find_window(self.h[self.good], self.e[self.good], strict)
        return None if limits is None else self.fit_window(self.good, *limits)

    def fit_without_outlier(self) -> Fit | None:
        """Fit without a row whose error lies far below the line, as where it changes sign; None without such a row."""
        best = None
        for i in range(1, len(self.good) - 1):
            rest = np.delete(self.good, i)
            limits = find_window(self.h[rest], self.e[rest])
            if (
                limits is None
                or limits[1] - limits[0] < LEAST_ROWS + 1
                or not limits[0] < i < limits[1]
            ):
                continue
            candidate = self.fit_window(rest, *limits, outlier=int(self.good[i]))
            line = candidate.constant * self.h[self.good[i]] ** candidate.order
            if self.e[self.good[i]] < 0.5 * line and (
                best is None or candidate.spread < best.spread
            ):
                best = candidate
        return best

    def fit_window(
        self, rows: np.ndarray, first: int, stop: int, note: str = "", outlier: int | None = None
    ) -> Fit:
        """`Fit` of the rows with the indices rows[first] to rows[stop - 1].

        note : remark on a later row that leaves the line of these rows; outlier : index of a row that lies off the line
        """
        marks = list(self.marks)
        for k, i in enumerate(rows):
            after = OFF_LINE if note else FLOOR
            marks[i] = PRE_ASYMPTOTIC if k < first else after if k >= stop else ""
        if outlier is not None:
            marks[outlier] = OFF_LINE
            note = (
                note
                or "one error lies far below the line of the other errors, as if the error changed sign there"
            )
        h, e = self.h[rows[first:stop]], self.e[rows[first:stop]]
        slope, intercept = line_of(h, e)
        p, recent = pair_orders(h, e), rows[max(first - 1, 0) : stop]
        drift = (
            DRIFT_STEPS[0]
            if FLOOR in marks
            else remaining_drift(pair_orders(self.h[recent], self.e[recent]))
        )
        limit = p[-1] + drift * (p[-1] - p[-2])
        spread = float(np.max(np.abs([*p, limit] - np.float64(slope))))
        return Fit(self.pairwise, slope, spread, tuple(marks), math.exp(intercept), "", note)

    def no_fit(self, reason: str) -> Fit:
        """Fit without an order, with the reason."""
        return Fit(self.pairwise, math.nan, math.nan, tuple(self.marks), math.nan, reason)

    # reasons ---------------------------------------------------------------------------------------------------

    def too_few_reason(self) -> str:
        """Reason why there is no order, for fewer than three rows without a mark."""
        if not np.any(self.e > 0.0):
            return NO_ERROR
        if FLOOR in self.marks or OFF_LINE in self.marks:
            verb = "is" if len(self.good) == 1 else "are"
            return (
                f"no order: only {len(self.good)} of {len(self.h)} rows {verb} above the floor and on the line of the "
                f"fit; expected at least {LEAST_ROWS} such rows"
            )
        return f"no order: the number of rows with a known error is {len(self.good)}; expected at least {LEAST_ROWS}"

    def failure_reason(self) -> str:
        """Reason why no successive rows show an order."""
        e, p = self.e[self.good], pair_orders(self.h[self.good], self.e[self.good])
        if np.any(e[1:] > ALLOWED_RISE * e[:-1]) and not e[-1] < e[0] / LEAST_REDUCTION:
            return "no order: the errors do not fall"
        if np.all(p < LEAST_ORDER):
            return (
                f"no order: the errors hardly fall; orders between rows are below {LEAST_ORDER:g}"
            )
        if p[-1] < LEAST_ORDER:
            return "no order: the errors reach a floor before three rows show one order; try a coarser first row"
        last_orders = ", ".join(f"{x:.2f}" for x in p[-3:])
        return f"no order: the last orders between rows differ ({last_orders}); try more levels, or fewer"

    def drift_reason(self) -> str:
        """Reason why there is no order if the spread is as large as the order, which may drift to zero or double."""
        last_orders = ", ".join(
            f"{x:.2f}" for x in pair_orders(self.h[self.good], self.e[self.good])[-3:]
        )
        rows = self.good.size
        return f"no order: orders between rows still drift ({last_orders}) after {rows} rows; try {rows + 2} rows"


def pair_orders(h: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Orders between rows, log(e[i] / e[i+1]) / log(h[i] / h[i+1]) : float64[n-1]; NaN if one is 0 or not finite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        orders = np.log(e[:-1] / e[1:]) / np.log(h[:-1] / h[1:])
    return np.where(np.isfinite(orders), orders, math.nan)


def remaining_drift(p: np.ndarray) -> float:
    """Expected further drift of the orders p between successive rows, as a multiple of their last change.

    With ratio r < 1 of the last two changes it is the sum of a geometric series, r / (1 - r), within the limits of
    DRIFT_STEPS. It is the upper limit for r >= 1 or fewer than three orders, the lower limit for changes of opposite
    sign.
    """
    least, greatest = DRIFT_STEPS
    if len(p) < LEAST_ROWS:
        return greatest
    before, last = p[-2] - p[-3], p[-1] - p[-2]
    if before * last <= 0.0:
        return least
    ratio = last / before
    return greatest if ratio >= 1.0 else min(max(ratio / (1.0 - ratio), least), greatest)


def line_of(h: np.ndarray, e: np.ndarray) -> tuple[float, float]:
    """Slope and intercept of the least-squares line of log e over log h."""
    slope, intercept = np.polyfit(np.log(h), np.log(e), 1)
    return float(slope), float(intercept)


def order_tolerance(order: float) -> float:
    """Greatest allowed distance of orders between rows from the slope `order` of their line."""
    return 0.12 + 0.04 * order


def find_window(h: np.ndarray, e: np.ndarray, strict: bool = True) -> tuple[int, int, str] | None:
    """Find the last successive rows (the window) that show one order: (first, stop, note), or None.

    The window has the rows first to stop - 1 of the sizes h and errors e; note : remark on a row after it, or "".
    strict : False if the last order between rows of the window may deviate from the orders before it
    Errors after the window must be flat, or a single row after at least four rows may leave their line. Errors before
    the window must not rise by a factor of ALLOWED_RISE.
    """
    p = pair_orders(h, e)
    for stop in range(len(h), LEAST_ROWS - 1, -1):
        first = stop - LEAST_ROWS
        if not is_line(h, e, first, stop) or (strict and last_deviates(p[: stop - 1])):
            continue
        first, stop = extend_window(h, e, p, first, stop)
        note = classify_tail(h, e, first, stop)
        if e[first] < LEAST_REDUCTION * e[stop - 1] or may_be_floor(h, e, first, stop):
            continue
        if note is not None and np.all(e[1 : first + 1] < ALLOWED_RISE * e[:first]):
            return first, stop, note
    return None


def is_line(h, e, first: int, stop: int) -> bool:
    """True if log error over log size of the rows first to stop - 1 lies on a line, and the errors decrease."""
    slope, _ = line_of(h[first:stop], e[first:stop])
    spread = np.max(np.abs(pair_orders(h[first:stop], e[first:stop]) - slope))
    return slope >= LEAST_ORDER and spread <= order_tolerance(slope)


def last_deviates(p: np.ndarray) -> bool:
    """True if the last of the orders p between rows changed by more than about twice the previous change."""
    if len(p) < LEAST_ROWS:
        return False
    before, last = np.abs(np.diff(p[-3:]))
    return bool(last > 2.0 * before + 0.03 * (1.0 + max(p[-2], 0.0)))


def may_be_floor(h, e, first: int, stop: int) -> bool:
    """True if the errors of rows first to stop - 1 may be a floor, which finer rows do not reduce.

    This is so if the errors before them decrease much faster, and if the rows are few or do not lie close to a line.
    """
    slope, _ = line_of(h[first:stop], e[first:stop])
    before = np.max(pair_orders(h[: first + 1], e[: first + 1]), initial=0.0)
    clear = stop - first > LEAST_ROWS and is_clear_line(h, e, first, stop)
    return bool(before > STEEP_RATIO * slope + 0.3) and not clear


def is_clear_line(h, e, first: int, stop: int) -> bool:
    """True if the rows first to stop - 1 lie so close to a line that later rows above the line can be recognised."""
    slope, _ = line_of(h[first:stop], e[first:stop])
    spread = np.max(np.abs(pair_orders(h[first:stop], e[first:stop]) - slope))
    return bool(spread < CLEAR_SPREAD * (1.0 + slope))


def extend_window(h, e, p, first: int, stop: int) -> tuple[int, int]:
    """(first, stop) of a window, extended by earlier rows on its line, and without a last row that begins to leave it.

    h, e : sizes and errors of all rows; p : orders between rows
    first, stop : the window has the rows first to stop - 1
    """
    while (
        first > 0
        and is_line(h, e, first - 1, stop)
        and abs(p[first - 1] - line_of(h[first:stop], e[first:stop])[0])
        <= order_tolerance(0.5 * (p[first - 1] + p[first]))
    ):
        first -= 1
    all_changes = np.max(np.abs(np.diff(p[first : stop - 1])), initial=0.0)
    inner_changes = np.max(np.abs(np.diff(p[first : stop - 2])), initial=0.0)
    leaving = p[stop - 2] < np.min(p[first : stop - 2], initial=math.inf)
    if (
        stop < len(h)
        and stop - first > LEAST_ROWS
        and leaving
        and inner_changes < all_changes / 3.0
    ):
        return first, stop - 1
    return first, stop


def classify_tail(h, e, first: int, stop: int) -> str | None:
    """Judge the rows of a convergence table after the rows first to stop - 1, whose errors lie on a line.

    The result is "" if there are no rows after them or their errors are a floor, a note if a single row leaves the
    line, and None if the rows first to stop - 1 cannot be taken. h, e : steps or cell sizes, and errors, of all rows
    """
    rest = e[stop:]
    if rest.size == 0:
        return ""
    slope, intercept = line_of(h[first:stop], e[first:stop])
    excess = rest - np.exp(intercept) * h[stop:] ** slope  # above the line
    last = e[stop - 1]
    if (
        rest.size >= 2
        and np.all(excess > 0.0)
        and excess.max() < FLOOR_SPREAD * excess.min()
        and rest.max() < FLOOR_SPREAD * last
    ):
        falls = math.log(excess[0] / excess[-1]) / math.log(h[stop] / h[-1])
        settled = pair_orders(h[-2:], e[-2:])[0] < 0.5 * slope
        if falls < min(0.3 * slope, 0.4) and (settled or is_clear_line(h, e, first, stop)):
            return ""
    if rest.size == 1 and stop - first > LEAST_ROWS:
        if (
            0.0 < excess[0]
            and rest[0] < ALLOWED_RISE * last
            and abs(rest[0] / last - 1.0) < 0.1 * slope
        ):
            return ""  # the error no longer falls
        leaves = "the error of the last row leaves the line of the other rows"
        return f"{leaves}: an error floor or another order begins there"
    return None
