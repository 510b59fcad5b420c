"""Structure of a Jacobian: sparsity pattern, column colours, finite differences, kind of factorisation and its pivots.

Compiled functions read it as one flat array of integers: a header of lengths and offsets, the pattern by columns, the
columns by colour, and the data of the kind of factorisation. Columns of one colour have no row in common, so that one
call of the right-hand side gives the differences of all of them.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fvsolve.core.kernels.calls import compile_as
from fvsolve.core.steppers.run_handle import FACTOR, FACTOR_COMPLEX, SOLVE, SOLVE_COMPLEX
from fvsolve.errors import FvsolveError, nearest
from fvsolve.jit import compile_once, njit

# The header: lengths, then offsets into the same array.
SIZE, LEDGERS, COLORS = 0, 1, 2  # states n, ledger rows m, colours
STARTS, ROWS, COLOR_STARTS, COLOR_COLUMNS = 3, 4, 5, 6  # pattern by columns; columns by colour
FINE, SOLVER_DATA = 7, 8  # 1 for columns with a fine increment; data of the kind of factorisation
HEADER = 9

KINDS = ("dense", "banded", "sparse")
# number of states up to which dense factors are as quick as others (0.2 to 0.6 us), without setup
SMALL = 16
# fraction of non-zero entries from which factors fill up, so that dense factors are quicker
DENSE_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class Structure:
    """Pattern of a Jacobian and the linear algebra chosen for it.

    pattern : bool[n + m, n]  sparse by columns: rows of n states, then of m ledger rates, which are not factored
    kind : "dense", "banded" or "sparse"; default: chosen by the size and the density of the pattern
    fine : numbers of the states whose increments in finite differences are smaller than usual.
    Raises FvsolveError for another kind and for a pattern with fewer rows than columns.
    """

    pattern: Any
    kind: str | None = None
    fine: Any = ()

    def __post_init__(self) -> None:
        from scipy.sparse import csc_array

        pattern = csc_array(self.pattern, dtype=bool)
        pattern.sum_duplicates()
        pattern.eliminate_zeros()
        pattern.sort_indices()
        if pattern.shape[0] < pattern.shape[1]:
            raise FvsolveError(
                f"a Jacobian pattern of shape {pattern.shape} has fewer rows than states; expected a "
                "column for each state, and at least as many rows as columns"
            )
        if self.kind is not None and self.kind not in KINDS:
            near = nearest(str(self.kind), KINDS)
            hint = f'did you mean "{near}"?' if near else f"expected one of {', '.join(KINDS)}"
            raise FvsolveError(f'unknown kind of structure "{self.kind}"; {hint}')
        object.__setattr__(self, "pattern", pattern)
        if self.kind is None:
            object.__setattr__(self, "kind", choose(pattern))

    @classmethod
    def full(cls, n: int, m: int = 0) -> Structure:
        """Structure for n states and m ledger rates with unknown pattern: dense, with a colour for each column."""
        return cls(np.ones((n + m, n), dtype=bool), "dense")

    @property
    def n(self) -> int:
        """Number of states."""
        return self.pattern.shape[1]

    @property
    def m(self) -> int:
        """Number of ledger rows below the states."""
        return self.pattern.shape[0] - self.pattern.shape[1]

    @property
    def nnz(self) -> int:
        """Number of entries of the pattern, ledger rows included."""
        return int(self.pattern.indptr[-1])

    @cached_property
    def colors(self) -> np.ndarray:
        """Colour of each column : int64[n]; columns of equal colour have no row in common, ledger rows included."""
        return column_colors(self.pattern)

    @property
    def color_count(self) -> int:
        """Number of colours, which is the number of rhs calls for a Jacobian."""
        return int(self.colors.max(initial=-1)) + 1

    @cached_property
    def _own(self) -> tuple[np.ndarray, int]:
        """(data for the compiled functions of this kind : int64[:], length of the array for the factors)."""
        return kind_module(self.kind).prepare(self.pattern)

    @cached_property
    def shape(self) -> np.ndarray:
        """Structure as one flat array for compiled functions : int64[:], laid out as at the top of this file."""
        counts = np.bincount(self.colors, minlength=self.color_count)
        color_starts = np.concatenate(([0], np.cumsum(counts)))
        parts = [
            self.pattern.indptr,
            self.pattern.indices,
            color_starts,
            np.argsort(self.colors, kind="stable"),
        ]
        parts += [np.isin(np.arange(self.n), self.fine), self._own[0]]
        offsets = HEADER + np.cumsum([0] + [part.size for part in parts[:-1]])
        header = [self.n, self.m, self.color_count, *offsets]
        return np.concatenate([np.asarray(part, dtype=np.int64) for part in (header, *parts)])

    @property
    def store_size(self) -> int:
        """Length of the array for the factors."""
        return self._own[1]

    def functions(self, complex: bool = False) -> tuple:
        """Functions `factor` and `solve` of this kind, compiled on first use, for real or for complex shifts.

        factor(structure, jacobian, shift, factors) -> 0, or 1 + the state at which shift I - J has no good pivot
        solve(structure, factors, x) -> None, in place
        """
        return functions(self.kind, complex)


def choose(pattern) -> str:
    """Quickest kind of factorisation for a pattern, by its size and density: "dense" or "sparse".

    Sparse factors of a line of cells are banded, and quicker than the kind "banded" (1000 cells of two waves, upwind:
    19 us a factor and 7 a solution, against 24 and 18). Banded factors exchange rows, so they can be used where sparse
    factors find no pivot.
    """
    n = pattern.shape[1]
    return "dense" if n <= SMALL or pattern[:n].nnz >= DENSE_SHARE * n * n else "sparse"


def kind_module(kind: str):
    """Module with the linear algebra of a kind of structure."""
    return importlib.import_module(f"fvsolve.core.steppers.linear_{kind}")


@compile_once
def functions(kind: str, complex: bool) -> tuple:
    """Functions `factor` and `solve` of a kind of structure, compiled for real or complex shifts."""
    module = kind_module(kind)
    letters = (FACTOR_COMPLEX, SOLVE_COMPLEX) if complex else (FACTOR, SOLVE)
    return tuple(
        compile_as(njit(f), kinds)
        for f, kinds in zip((module.factor, module.solve), letters, strict=True)
    )


# number of entries below which plain Python is quicker than loading compiled code
PYTHON_ENTRIES = 200


def column_colors(pattern) -> np.ndarray:
    """Colours of the columns of a sparse pattern : int64[n], by the greedy rule, columns with many neighbours first.

    pattern : sparse array stored by columns. Columns with a row in common get different colours (Curtis, Powell and
    Reid 1974; order of Welsh and Powell 1967).
    """
    rows, n = pattern.shape
    result = np.full(n, -1, dtype=np.int64)
    # In a full pattern all columns share all rows.
    if pattern.indptr[-1] == rows * n:
        return np.arange(n, dtype=np.int64)
    by_rows = pattern.tocsr()
    per_row = np.diff(by_rows.indptr)
    degree = np.add.reduceat(np.append(per_row[pattern.indices], 0), pattern.indptr[:-1])
    # For an empty column `reduceat` returns the entry of the next one instead of 0.
    degree[np.diff(pattern.indptr) == 0] = 0
    order = np.argsort(-degree, kind="stable")
    tables = (pattern.indptr, pattern.indices, by_rows.indptr, by_rows.indices, order)
    function = (
        greedy.py_func if pattern.nnz < PYTHON_ENTRIES and hasattr(greedy, "py_func") else greedy
    )
    function(
        *(np.asarray(table, dtype=np.int64) for table in tables),
        np.full(n + 1, -1, dtype=np.int64),
        result,
    )
    return result


@njit
def greedy(starts, rows, row_starts, columns, order, seen, result):
    """Give each column in `order` the lowest colour that no other column with a common row has.

    starts, rows : pattern by columns; row_starts, columns : pattern by rows
    seen : int64[n + 1]  work array, initially -1; result : int64[n]  receives the colours, initially -1
    """
    for at in range(order.size):
        j = order[at]
        # The colours of all columns that share a row with this one are taken.
        for p in range(starts[j], starts[j + 1]):
            for q in range(row_starts[rows[p]], row_starts[rows[p] + 1]):
                color = result[columns[q]]
                if color >= 0:
                    seen[color] = j
        color = 0
        while seen[color] == j:
            color += 1
        result[j] = color


ROOT = 2.0**-26  # square root of the rounding error of a float64
# Relative increment of states whose laws are curved over few pascals: 1e-3 Pa at 150 bar, whose rounding is 2e-9 Pa.
LEAST_ROOT = 2.0**-34


@njit(forceinline=True)
def differences(evaluate, handle, r, t, y, f, ledger_rates, f_work):
    """Write the Jacobian of f and of the ledger rates to `r.jacobian`, column by column; returns the number of calls.

    evaluate : function `run_handle.stage_rates`, which is called once for each colour, for one-sided differences
    handle, r : handle of the model, open handle of the run; f_work : float64[n]  work array for rates
    f, ledger_rates : float64[n], float64[m]  rates at (t, y), evaluated there and not taken from a stage
    The increment of a state is 2^-26 max(|y|, scale), with 2^-34 |y| in place of 2^-26 |y| for states marked fine in
    the structure, and 2^-26 |scale| for a negative scale.
    """
    structure = r.structure
    scale = r.scale
    y_work = r.moved
    out = r.out
    jacobian = r.jacobian
    n, offset = structure[SIZE], r.control[0]["ledger_offset"]
    starts, rows = structure[structure[STARTS] :], structure[structure[ROWS] :]
    color_starts = structure[structure[COLOR_STARTS] :]
    columns = structure[structure[COLOR_COLUMNS] :]
    fine = structure[structure[FINE] :]
    for j in range(n):
        y_work[j] = y[j]
    for color in range(structure[COLORS]):
        for e in range(color_starts[color], color_starts[color + 1]):
            j = columns[e]
            if scale[j] < 0.0:
                y_work[j] = y[j] - ROOT * scale[j]
            else:
                y_work[j] = y[j] + max(
                    (LEAST_ROOT if fine[j] == 1 else ROOT) * abs(y[j]), ROOT * scale[j]
                )
        # Columns of a colour share no row, so that one call gives the differences of all of them.
        evaluate(handle, r, t, y_work, f_work)
        for e in range(color_starts[color], color_starts[color + 1]):
            j = columns[e]
            per = 1.0 / (y_work[j] - y[j])  # the increment as rounded in the sum
            for p in range(starts[j], starts[j + 1]):
                i = rows[p]
                change = f_work[i] - f[i] if i < n else out[offset + i - n] - ledger_rates[i - n]
                jacobian[p] = change * per
            y_work[j] = y[j]
    return structure[COLORS]


@njit
def multiply(structure, jacobian, x, product):
    """Write the product J x of the Jacobian J and a vector x to `product`.

    product : float64[n + m]  entries of n states, then of m ledger rates; x : float64[n]
    jacobian : float64[nnz]  entries of J, in the order of the pattern; structure : flat array of `Structure.shape`
    """
    n = structure[SIZE]
    starts, rows = structure[structure[STARTS] :], structure[structure[ROWS] :]
    for i in range(n + structure[LEDGERS]):
        product[i] = 0.0
    for j in range(n):
        for p in range(starts[j], starts[j + 1]):
            product[rows[p]] += jacobian[p] * x[j]


# least size of a pivot: its square and the square of its reciprocal are still in range
LEAST_PIVOT = 1e-150


@njit(forceinline=True)
def size_of(x):
    """Size |Re x| + |Im x| of a number, which is quicker to compute than its modulus."""
    return abs(x.real) + abs(x.imag)


@njit(forceinline=True)
def reciprocal(x):
    """Reciprocal 1 / x of a real or complex number whose square neither overflows nor underflows."""
    return x.conjugate() / (x.real * x.real + x.imag * x.imag)


@njit
def bad_row(structure, jacobian):
    """1 + number of a state whose row contains an invalid Jacobian entry; 0 if all entries are valid.

    An entry is invalid if it is not finite or its size is 1e150 or more. Ledger rows are not tested.
    """
    n = structure[SIZE]
    last = structure[structure[STARTS] + n]
    rows = structure[structure[ROWS] :]
    good = True
    # Without a branch this loop is vectorised; the row is sought only if an entry is bad.
    for p in range(last):
        good &= abs(jacobian[p]) < 1.0 / LEAST_PIVOT
    if not good:
        for p in range(last):
            if not abs(jacobian[p]) < 1.0 / LEAST_PIVOT and rows[p] < n:
                return rows[p] + 1
    return 0
