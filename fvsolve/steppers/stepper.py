"""Arrays and compiled functions of one run of the time loop, for any method and any number of states."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import numpy as np

from fvsolve.jit import compile_in_parallel, compile_once
from fvsolve.steppers import slots
from fvsolve.steppers.coefficients import bent, coefficients
from fvsolve.steppers.ledger import SUMS
from fvsolve.steppers.march import compiled, compiled_attempt
from fvsolve.steppers.signatures import addresses, compiled_step, no_algebra, no_joint
from fvsolve.steppers.structure import Structure
from fvsolve.steppers.tableau import Method


class Stepper:
    """Arrays of one run and the compiled functions of its method.

    structure() : structure of the Jacobian, called for implicit methods only
    scale : float64[n]  reference size of small deviations; ledgers : number of ledger rates in addition to dydt
    damped : True for semi-implicit stages, see `semi_implicit`
    """

    def __init__(
        self, method: Method, n: int, ledgers: int, structure: Callable[[], Structure], scale: np.ndarray, damped=False
    ) -> None:
        self.structure, self.scale, self.march, self.damped = structure, scale, compiled(), damped
        self.y, self.f_old, self.ledger = np.zeros((4, n)), np.zeros(n), np.zeros(SUMS * ledgers)
        self.memory, self.orders = np.zeros(slots.MEMORY), np.zeros(slots.ORDERS)
        self.flags = np.array([slots.FRESH, 0, 0, 1, 0, 0], dtype=np.int64)
        self.none, self.nobody = np.zeros(0), np.zeros(0, dtype=np.int64)
        self.stored, self.carry, self.times = self.nobody, np.zeros(0), self.none
        self.largest = self.none  # largest allowed states, where growth is checked
        self.out, self.out_row, self.values = np.zeros(5), np.zeros(5), np.zeros(0)
        self.out[slots.ARRIVES] = slots.NEVER
        self.g = self.g_new = self.none
        self.y_out, self.rows = np.zeros(n), np.zeros((1, 1))
        self.within = self.nobody, np.zeros((0, 4))
        self.join, self.spans, self.sums = no_joint(), np.array([[0, n, 0, 1]]), np.zeros(1)
        self.use(method)

    def use(self, method: Method) -> None:
        """Use this method for the following steps."""
        n, ledgers = self.scale.size, self.ledger.size // SUMS
        self.method = method
        self.coefficients, self.dense, s = coefficients(method, self.damped)
        self.algebra = no_algebra()
        self.k, self.supply = np.zeros((s, n)), np.zeros((s, ledgers))
        self.shape, self.work, self.vectors = self.nobody, self.none, np.zeros((0, n))
        self.store, self.store_complex, self.kept = self.none, np.zeros(0, dtype=complex), 0
        self.spare = np.zeros((0, n)), self.supply, self.none, self.store_complex
        if self.damped:
            self.attempt, self.store = attempt_of("damped"), np.zeros(2 * n)
        elif method.explicit:
            self.attempt = attempt_of(method.kind)
        else:
            structure = self.structure()
            self.attempt = attempt_of(method.kind, structure.kind)
            self.solve_by(structure, s, n, ledgers)
        self.orders[slots.ORDER] = method.control_order
        self.orders[slots.LANDS] = self.dense_order + 1 < method.order  # else rows are as accurate as ends of steps
        self.orders[slots.APART] = self.apart
        self.orders[slots.FSAL] = method.explicit and method.first_same_as_last
        self.orders[slots.KIND] = KINDS[method.kind][1]
        self.flags[slots.PHASE], self.flags[slots.BEHIND] = slots.FRESH, 0

    def solve_by(self, structure: Structure, s: int, n: int, ledgers: int) -> None:
        """Allocate arrays and select functions for the linear algebra of Newton iterations."""
        from fvsolve.steppers import newton

        q = pairs = 0
        if self.method.kind == "full":
            from fvsolve.steppers.irk import pairs_of

            q, pairs = s - 1, pairs_of(self.method)
        reals = max(q - 2 * pairs, 1)  # stages that are solved one by one need a real factor, whatever the method
        size, self.shape = structure.store_size, structure.shape
        self.work = np.zeros(slots.HEADER + structure.nnz + n + 2 * ledgers + q * q)
        self.work[slots.STORE] = size
        self.vectors = np.zeros((s + newton.STAGES + 3 * q, n))
        self.kept = slots.HEADER + structure.nnz
        self.store, self.store_complex = np.zeros(reals * size), np.zeros(n + pairs * size, dtype=complex)
        self.algebra = (
            *structure.functions(),
            *(structure.functions(complex=True) if pairs else no_algebra()[2:]),
        )
        newton.forget(self.work)

    @property
    def dense_order(self) -> int:
        """Order of the dense output: of the polynomial of the method, else of the cubic through both ends."""
        extra = self.method.kind == "full" and bent(self.method).size > 0
        return min(self.dense.shape[1] + extra, self.method.order) if self.dense.size else 3

    @property
    def apart(self) -> int:
        """Source of rows within given steps: a value of `SEPARATE_ROWS`.

        The polynomial is not used if its order is too low, or if it contains f(t, y) of a stiff problem: that f
        amplifies the distance of y from the slow solution. Slopes of the last stage do not amplify it, but at a start
        only f is known.
        """
        method = self.method
        if self.dense.shape[1] == 1:  # a straight line
            return slots.NEVER_APART
        if self.dense_order + 1 < method.order:
            return slots.ALWAYS_APART
        if method.explicit:
            return slots.NEVER_APART
        solved = method.kind == "linear" or method.stiffly_accurate and not (self.dense.size and method.c[0] == 0.0)
        return slots.APART_AT_FIRST if solved else slots.ALWAYS_APART

    def forget(self) -> None:
        """Discard at a kink the step size, the last error, the stiffness count and the Jacobian; keep other counts."""
        self.memory[[slots.STEP, slots.ERROR_OLD, slots.CASES, slots.LEFT]] = 0.0
        if self.work.size:
            from fvsolve.steppers.newton import forget

            forget(self.work)

    def memories(self) -> list[np.ndarray]:
        """Views of all arrays that the next step depends on, except t and y."""
        views = [self.memory, self.ledger, self.carry]
        if self.kept:  # header and Jacobian; f at the start of the last step, and its stages
            views += [self.work[: self.kept], self.vectors[self.k.shape[0]], self.k]
        return views

    def remember(self, loop_state: np.ndarray) -> np.ndarray:
        """Restore `restart_arrays` from the beginning of a flat array; returns the rest of it."""
        for view in self.memories():
            view[...] = loop_state[: view.size].reshape(view.shape)
            loop_state = loop_state[view.size :]
        if self.work.size:
            # negative: factor once more, without counting it again
            self.work[slots.SHIFT] = -abs(self.work[slots.SHIFT])
        return loop_state

    def counts(self) -> dict[str, int]:
        """Numbers of steps, rejections, rhs calls, Jacobians, factorisations, Newton iterations and failures."""
        return {name: int(self.memory[index]) for name, index in slots.COUNTS.items()}

    def once(self, rhs, handle, ledger_offset: int, t: float, h: float, y: np.ndarray) -> np.ndarray:
        """State after a single step of h from y at t, independent of earlier steps; NaN if its stages are not solvable.

        Of the stored data a Newton step uses only the Jacobian, a linearly implicit step nothing.
        """
        self.y[0] = y
        self.memory[slots.STEPS] += 1.0
        rhs(t, self.y[0], self.k[0], self.out, handle)
        self.supply[0] = self.out[ledger_offset : ledger_offset + self.supply.shape[1]]
        error = compiled_attempt()(
            addresses((self.attempt, rhs, *self.algebra, self.join)), handle, self.coefficients, self.shape, self.spans,
            self.sums, t, h, self.y, 0, 1, self.k, self.supply, ledger_offset, self.out, self.scale, self.orders,
            self.memory, self.work, self.vectors, self.store, self.store_complex,
        )  # fmt: skip
        return self.y[1].copy() if error != slots.NEWTON_FAILED else np.full(y.size, np.nan)

    def call(self, fused_step, observe, record, events, rhs, handle, ledger_offset: int, armed: np.ndarray) -> int:
        """Continue the time loop; returns a code of `steppers.slots`, from DONE to CHATTERS."""
        if self.orders[slots.APART] and self.orders[slots.CONTROL] != slots.TOLERANCE and not self.spare[0].size:
            flat = np.zeros(self.work.size + self.store.size)
            spare = np.zeros((len(self.k) + len(self.vectors), self.scale.size))
            self.spare = spare, np.zeros_like(self.supply), flat, self.store_complex.copy()
        return self.march(
            addresses((self.attempt, fused_step, observe, record, events, rhs, *self.algebra, self.join)), handle,
            self.coefficients, self.shape, self.spans, self.sums, self.dense, self.orders, self.memory, self.times,
            self.flags, self.y, self.k, self.f_old, self.supply, ledger_offset, self.ledger, self.scale, self.out,
            self.out_row, self.values, self.g, self.g_new, armed, self.stored, self.carry, self.y_out, self.rows,
            *self.within, self.work, self.vectors, self.store, self.store_complex, *self.spare, self.largest,
        )  # fmt: skip


# Kinds of methods: module of their steps, and value of KIND in the time loop.
KINDS = {
    "explicit": ("erk", slots.EXPLICIT),
    "damped": ("semi_implicit", slots.EXPLICIT),
    "diagonal": ("dirk", slots.NEWTON_SOLVED),
    "full": ("irk", slots.NEWTON_SOLVED),
    "linear": ("ros", slots.LINEARLY_IMPLICIT),
}


@compile_once
def attempt_of(kind: str, algebra: str = ""):
    """Compiled step of a kind of methods, compiled on first use.

    A second process compiles the linear algebra at the same time: for real shifts, and complex shifts of full methods.
    """
    module = f"fvsolve.steppers.{KINDS[kind][0]}"
    if not algebra:
        return compiled_step(importlib.import_module(module).attempt)
    shifts = {False, kind == "full"}
    code = f"from fvsolve.steppers.structure import functions; [functions({algebra!r}, of) for of in {shifts}]"
    with compile_in_parallel(code, "factor"):
        return compiled_step(importlib.import_module(module).attempt)
