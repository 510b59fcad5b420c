"""Structure of a Jacobian: sparsity pattern, column groups for differences, kind of factorisation.

Compiled functions read it as one flat array of integers: a header of lengths and offsets, the pattern by columns, the
columns by colour, and the data of the kind of factorisation.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError, nearest
from fvsolve.jit import compile_once, njit
from fvsolve.steppers.run_handle import FACTOR, FACTOR_COMPLEX, SOLVE, SOLVE_COMPLEX, compiled_as

# The header: lengths, then offsets into the same array.
SIZE, LEDGERS, COLORS = 0, 1, 2  # states n, ledger rows m, colours
STARTS, ROWS, COLOR_STARTS, COLOR_COLUMNS = 3, 4, 5, 6  # pattern by columns; columns by colour
FINE, SOLVER_DATA = 7, 8  # 1 for columns with a fine increment; data of the kind of factorisation
HEADER = 9

KINDS = ("dense", "banded", "sparse")
SMALL = 16  # number of states up to which dense factors are as quick as others (0.2 to 0.6 us), without setup
DENSE_SHARE = 0.2  # fraction of non-zero entries from which factors fill up, so that dense factors are quicker


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
            raise FvsolveError(f"a Jacobian pattern of shape {pattern.shape} has fewer rows than states. Expected a "
                               "column for each state, and at least as many rows as columns")  # fmt: skip
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
        from fvsolve.steppers.colors import colors

        return colors(self.pattern)

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
        parts = [self.pattern.indptr, self.pattern.indices, color_starts, np.argsort(self.colors, kind="stable")]
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
    return importlib.import_module(f"fvsolve.steppers.linear_{kind}")


@compile_once
def functions(kind: str, complex: bool) -> tuple:
    """Functions `factor` and `solve` of a kind of structure, compiled for real or complex shifts."""
    module = kind_module(kind)
    letters = (FACTOR_COMPLEX, SOLVE_COMPLEX) if complex else (FACTOR, SOLVE)
    return tuple(compiled_as(njit(f), kinds) for f, kinds in zip((module.factor, module.solve), letters, strict=True))
