"""Arrays and compiled functions of one run of the time loop, for any method and any number of states."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import numpy as np

from fvsolve.jit import compile_in_parallel, compile_once
from fvsolve.steppers import loop_indices
from fvsolve.steppers.coefficients import coefficients, start_slope_correction
from fvsolve.steppers.ledger import LEDGER_ROWS
from fvsolve.steppers.signatures import addresses, compiled_step, no_algebra, no_exchange
from fvsolve.steppers.structure import Structure
from fvsolve.steppers.tableau import Method
from fvsolve.steppers.time_loop import compiled, compiled_attempt


class Integrator:
    """Arrays of one run and the compiled functions of its method.

    n : number of states
    ledgers : number of rates (such as inflows of nodes) that are integrated in addition to the states
    structure : function without arguments that returns the structure of the Jacobian, used for implicit methods only
    scale : float64[n]  reference size of small deviations of each state; negative: see `error_scale`
    damped : True for semi-implicit stages, see `semi_implicit`
    """

    def __init__(
        self, method: Method, n: int, ledgers: int, structure: Callable[[], Structure], scale: np.ndarray, damped=False
    ) -> None:
        self.structure, self.scale, self.run_steps, self.damped = structure, scale, compiled(), damped
        self.y, self.f_old, self.ledger = np.zeros((4, n)), np.zeros(n), np.zeros(LEDGER_ROWS * ledgers)
        self.loop_state, self.controls = np.zeros(loop_indices.LOOP_STATE_SIZE), np.zeros(loop_indices.CONTROLS_SIZE)
        self.progress = np.array([loop_indices.FRESH, 0, 0, 1, 0, 0], dtype=np.int64)
        self.no_floats, self.no_integers = np.zeros(0), np.zeros(0, dtype=np.int64)
        self.stored, self.carry, self.times = self.no_integers, np.zeros(0), self.no_floats
        self.largest = self.no_floats  # largest allowed states, where growth is checked
        self.out, self.out_row, self.values = np.zeros(5), np.zeros(5), np.zeros(0)
        self.out[loop_indices.JUMP_TIME] = loop_indices.NO_JUMP
        self.g = self.g_new = self.no_floats
        self.y_out, self.rows = np.zeros(n), np.zeros((1, 1))
        self.bounds = self.no_integers, np.zeros((0, 4))
        self.join, self.row_blocks, self.sums = no_exchange(), np.array([[0, n, 0, 1]]), np.zeros(1)
        self.use(method)

    def use(self, method: Method) -> None:
        """Use `method` for the following steps: allocate its arrays and select its compiled functions."""
        n, ledgers = self.scale.size, self.ledger.size // LEDGER_ROWS
        self.method = method
        self.coefficients, self.dense, s = coefficients(method, self.damped)
        self.algebra = no_algebra()
        self.k, self.ledger_rates = np.zeros((s, n)), np.zeros((s, ledgers))
        self.shape, self.work, self.vectors = self.no_integers, self.no_floats, np.zeros((0, n))
        self.factors, self.complex_factors, self.restart_size = self.no_floats, np.zeros(0, dtype=complex), 0
        self.spare = np.zeros((0, n)), self.ledger_rates, self.no_floats, self.complex_factors
        if self.damped:
            self.attempt, self.factors = attempt_of("damped"), np.zeros(2 * n)
        elif method.explicit:
            self.attempt = attempt_of(method.kind)
        else:
            structure = self.structure()
            self.attempt = attempt_of(method.kind, structure.kind)
            self.prepare_newton(structure, s, n, ledgers)
        self.controls[loop_indices.ORDER] = method.control_order
        self.controls[loop_indices.END_AT_ROWS] = (
            self.dense_order + 1 < method.order
        )  # else rows are as accurate as ends of steps
        self.controls[loop_indices.SEPARATE_ROWS] = self.separate_rows
        self.controls[loop_indices.FSAL] = method.explicit and method.first_same_as_last
        self.controls[loop_indices.KIND] = KINDS[method.kind][1]
        self.progress[loop_indices.PHASE], self.progress[loop_indices.HAS_LAST_STEP] = loop_indices.FRESH, 0

    def prepare_newton(self, structure: Structure, s: int, n: int, ledgers: int) -> None:
        """Allocate arrays and select functions for the linear algebra of Newton iterations.

        s : number of stages; n : number of states; ledgers : number of ledger rates
        """
        from fvsolve.steppers import newton

        q = pairs = 0
        if self.method.kind == "full":
            from fvsolve.steppers.irk import pairs_of

            q, pairs = s - 1, pairs_of(self.method)
        reals = max(q - 2 * pairs, 1)  # stages that are solved one by one need a real factor, whatever the method
        size, self.shape = structure.store_size, structure.shape
        self.work = np.zeros(loop_indices.HEADER + structure.nnz + n + 2 * ledgers + q * q)
        self.work[loop_indices.FACTOR_SIZE] = size
        self.vectors = np.zeros((s + newton.STAGES + 3 * q, n))
        self.restart_size = loop_indices.HEADER + structure.nnz
        self.factors, self.complex_factors = np.zeros(reals * size), np.zeros(n + pairs * size, dtype=complex)
        self.algebra = (
            *structure.functions(),
            *(structure.functions(complex=True) if pairs else no_algebra()[2:]),
        )
        newton.reset(self.work)

    @property
    def dense_order(self) -> int:
        """Order of the dense output: of the method's own polynomial, or of the cubic through both ends of a step."""
        extra = self.method.kind == "full" and start_slope_correction(self.method).size > 0
        return min(self.dense.shape[1] + extra, self.method.order) if self.dense.size else 3

    @property
    def separate_rows(self) -> int:
        """Source of output rows within steps of given length, a code of `loop_indices`: dense output or separate steps.

        The dense output is not used if its order is too low, or if it contains the rate f(t, y) of a stiff problem,
        which amplifies the distance of y from the slow solution. Slopes of the last stage do not amplify this distance,
        but at the start of a run only f is available.
        """
        method = self.method
        if self.dense.shape[1] == 1:  # a straight line
            return loop_indices.NEVER_SEPARATE
        if self.dense_order + 1 < method.order:
            return loop_indices.ALWAYS_SEPARATE
        if method.explicit:
            return loop_indices.NEVER_SEPARATE
        solved = method.kind == "linear" or method.stiffly_accurate and not (self.dense.size and method.c[0] == 0.0)
        return loop_indices.SEPARATE_AT_START if solved else loop_indices.ALWAYS_SEPARATE

    def discard_history(self) -> None:
        """Discard the step size, the last error, the stiffness count and the Jacobian, for a start after a kink."""
        self.loop_state[
            [loop_indices.STEP, loop_indices.ERROR_OLD, loop_indices.SWITCH_COUNT, loop_indices.SPLIT_REMAINDER]
        ] = 0.0
        if self.work.size:
            from fvsolve.steppers.newton import reset

            reset(self.work)

    def restart_arrays(self) -> list[np.ndarray]:
        """Views of all arrays of this object on which the next step depends, except the states y."""
        views = [self.loop_state, self.ledger, self.carry]
        if self.restart_size:  # header and Jacobian; f at the start of the last step, and its stages
            views += [self.work[: self.restart_size], self.vectors[self.k.shape[0]], self.k]
        return views

    def restore(self, loop_state: np.ndarray) -> np.ndarray:
        """Restore `restart_arrays` from the beginning of the flat array `loop_state`; returns the remaining entries."""
        for view in self.restart_arrays():
            view[...] = loop_state[: view.size].reshape(view.shape)
            loop_state = loop_state[view.size :]
        if self.work.size:
            # negative: factor once more, without counting it again
            self.work[loop_indices.SHIFT] = -abs(self.work[loop_indices.SHIFT])
        return loop_state

    def counts(self) -> dict[str, int]:
        """Numbers of steps, rejections, rhs calls, Jacobians, factorisations, Newton iterations, failures, split steps.

        The keys of the dict are those of `loop_indices.COUNTS`.
        """
        return {name: int(self.loop_state[index]) for name, index in loop_indices.COUNTS.items()}

    def single_step(self, rhs, handle, ledger_offset: int, t: float, h: float, y: np.ndarray) -> np.ndarray:
        """State after a single step of length h from state y at time t; NaN if its stages cannot be solved.

        Only an object whose time loop (`call`) has not run may be used: then the step depends on earlier single steps
        only
        through the stored Jacobian of Newton iterations. Changes `y`, `k` and `loop_state`.
        rhs, handle : compiled right-hand side and its argument; ledger_offset : index of the first ledger rate in `out`
        """
        self.y[0] = y
        self.loop_state[loop_indices.STEPS] += 1.0
        rhs(t, self.y[0], self.k[0], self.out, handle)
        self.ledger_rates[0] = self.out[ledger_offset : ledger_offset + self.ledger_rates.shape[1]]
        error = compiled_attempt()(
            addresses((self.attempt, rhs, *self.algebra, self.join)),
            handle,
            self.coefficients,
            self.shape,
            self.row_blocks,
            self.sums,
            t,
            h,
            self.y,
            0,
            1,
            self.k,
            self.ledger_rates,
            ledger_offset,
            self.out,
            self.scale,
            self.controls,
            self.loop_state,
            self.work,
            self.vectors,
            self.factors,
            self.complex_factors,
        )
        return self.y[1].copy() if error != loop_indices.NEWTON_FAILED else np.full(y.size, np.nan)

    def call(self, fused_step, observe, record, events, rhs, handle, ledger_offset: int, armed: np.ndarray) -> int:
        """Continue the time loop; returns a code of `loop_indices`, from DONE to SWITCHED.

        fused_step, observe, record, events, rhs : compiled functions of `time_loop.run_steps`; handle : their argument
        ledger_offset : index of the first ledger rate in `out`; armed : flags of the events
        """
        if (
            self.controls[loop_indices.SEPARATE_ROWS]
            and self.controls[loop_indices.CONTROL] != loop_indices.TOLERANCE
            and not self.spare[0].size
        ):
            flat = np.zeros(self.work.size + self.factors.size)
            spare = np.zeros((len(self.k) + len(self.vectors), self.scale.size))
            self.spare = spare, np.zeros_like(self.ledger_rates), flat, self.complex_factors.copy()
        return self.run_steps(
            addresses((self.attempt, fused_step, observe, record, events, rhs, *self.algebra, self.join)),
            handle,
            self.coefficients,
            self.shape,
            self.row_blocks,
            self.sums,
            self.dense,
            self.controls,
            self.loop_state,
            self.times,
            self.progress,
            self.y,
            self.k,
            self.f_old,
            self.ledger_rates,
            ledger_offset,
            self.ledger,
            self.scale,
            self.out,
            self.out_row,
            self.values,
            self.g,
            self.g_new,
            armed,
            self.stored,
            self.carry,
            self.y_out,
            self.rows,
            *self.bounds,
            self.work,
            self.vectors,
            self.factors,
            self.complex_factors,
            *self.spare,
            self.largest,
        )


# Kinds of methods: module of their steps, and value of KIND in the time loop.
KINDS = {
    "explicit": ("erk", loop_indices.EXPLICIT),
    "damped": ("semi_implicit", loop_indices.EXPLICIT),
    "diagonal": ("dirk", loop_indices.NEWTON_SOLVED),
    "full": ("irk", loop_indices.NEWTON_SOLVED),
    "linear": ("ros", loop_indices.LINEARLY_IMPLICIT),
}


@compile_once
def attempt_of(kind: str, algebra: str = ""):
    """Function that takes one step of a kind of methods, compiled on first use.

    kind : key of `KINDS`; algebra : kind of linear algebra ("dense", "banded", "sparse"), "" for explicit methods
    A second process compiles the linear algebra at the same time: with real shifts, and with complex shifts too for
    fully implicit methods.
    """
    module = f"fvsolve.steppers.{KINDS[kind][0]}"
    if not algebra:
        return compiled_step(importlib.import_module(module).attempt)
    shifts = {False, kind == "full"}
    code = f"from fvsolve.steppers.structure import functions; [functions({algebra!r}, of) for of in {shifts}]"
    with compile_in_parallel(code, "factor"):
        return compiled_step(importlib.import_module(module).attempt)
