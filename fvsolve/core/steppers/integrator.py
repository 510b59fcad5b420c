"""Arrays and compiled functions of one run of the time loop, for any method and any number of states."""

import importlib
from collections.abc import Callable
from operator import attrgetter, is_not

import numpy as np

from fvsolve.core.kernels.calls import compile_as
from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers.coefficients import coefficients, start_slope_correction
from fvsolve.core.steppers.event_search import INNER_ROWS
from fvsolve.core.steppers.ledger import LEDGER_ROWS
from fvsolve.core.steppers.run_handle import (
    ATTEMPT,
    RunArrays,
    addresses,
    boxed_run,
    handle_of_run,
    no_algebra,
    no_exchange,
    no_watch,
)
from fvsolve.core.steppers.structure import Structure
from fvsolve.core.steppers.tableau import Method
from fvsolve.core.steppers.time_loop import compiled
from fvsolve.jit import compile_in_parallel, compile_once

IMPLICIT_VECTORS = ("first", "increment", "weights", "moved", "rate", "base", "fallback")
all_arrays = attrgetter(*RunArrays._fields)


class Integrator:
    """Arrays of one run and the compiled functions of its method.

    The arrays of `run_handle.RunArrays` are attributes; each may be replaced by another array between two calls.
    n : number of states
    ledgers : number of rates (such as inflows of nodes) that are integrated in addition to the states
    jacobian_structure : function without arguments that returns the structure of the Jacobian, used for implicit
    methods only
    scale : float64[n]  reference size of small deviations of each state; negative: see `error_scale`
    damped : True for semi-implicit stages, see `erk.damped_attempt`
    """

    def __init__(
        self,
        method: Method,
        n: int,
        ledgers: int,
        jacobian_structure: Callable[[], Structure],
        scale: np.ndarray,
        damped=False,
    ) -> None:
        self.jacobian_structure, self.scale, self.damped = jacobian_structure, scale, damped
        self.run_steps, self.linked, self.run = compiled(), None, None
        self.state, self.control, self.progress, self.newton = (
            np.zeros(1, kind) for kind in (rec.STATE, rec.CONTROL, rec.PROGRESS, rec.NEWTON)
        )
        # Row 0 of y is the present state, row 1 the last one; the third row receives the new state.
        self.progress["old"] = 1
        self.y, self.f_old, self.ledger = (
            np.zeros((4, n)),
            np.zeros(n),
            np.zeros(LEDGER_ROWS * ledgers),
        )
        self.no_floats, self.no_integers = np.zeros(0), np.zeros(0, dtype=np.int64)
        self.stored, self.carry, self.times = self.no_integers, np.zeros(0), self.no_floats
        self.largest = self.no_floats  # largest allowed states, where growth is checked
        self.out, self.out_row, self.values = (
            np.zeros(rec.OUT_HEAD),
            np.zeros(rec.OUT_HEAD),
            np.zeros(0),
        )
        self.out[rec.JUMP_TIME] = self.out[rec.LAST_ROW] = rec.NO_JUMP
        self.armed = self.no_floats
        self.prepare_events(0)
        self.returns = np.zeros((2, 0))
        self.y_out, self.rows = np.zeros(n), np.zeros((1, 1))
        self.bounded_states, self.bounds = self.no_integers, np.zeros((0, 4))
        self.watcher, self.watch = no_watch(), self.no_integers
        self.join, self.row_blocks, self.sums = (
            no_exchange(),
            np.array([[0, n, 0, 1, n]]),
            np.zeros(1),
        )
        self.use(method)

    def use(self, method: Method) -> None:
        """Use `method` for the following steps: allocate its arrays and select its compiled functions."""
        n = self.scale.size
        ledgers = self.ledger.size // LEDGER_ROWS
        control = self.control[0]
        self.method = method
        self.coefficients, self.dense, s = coefficients(method, self.damped)
        self.algebra, self.calls, self.spare = no_algebra(), self.no_integers, self.no_integers
        self.k, self.ledger_rates = np.zeros((s, n)), np.zeros((s, ledgers))
        self.structure = self.no_integers
        self.allocate_newton(0, 0, 0, 0)
        if self.damped:
            self.attempt, self.factors = attempt_of("damped"), np.zeros(2 * n)
        elif method.explicit:
            self.attempt = attempt_of(method.kind)
        else:
            structure = self.jacobian_structure()
            self.attempt = attempt_of(method.kind, structure.kind)
            self.prepare_newton(structure)
        control["order"] = method.control_order
        control["separate_rows"] = self.separate_rows
        control["end_at_rows"] = self.end_at_rows
        control["fsal"] = method.explicit and method.first_same_as_last
        control["kind"] = KINDS[method.kind][1]
        # A last stage at the end of the step gives the slope there without a new call of f.
        ends_at_stage = np.array_equal(
            self.coefficients[s * (s - 1) : s * s], self.coefficients[s * s : s * s + s]
        )
        control["stage_slope"] = (
            control["kind"] == rec.NEWTON_SOLVED and not self.dense.size and ends_at_stage
        )
        self.restart_segment()

    def prepare_events(self, count: int) -> None:
        """Allocate the arrays of `count` event functions."""
        self.g, self.g_new, self.inner = (
            np.zeros(count),
            np.zeros(count),
            np.zeros((INNER_ROWS, count)),
        )
        self.pace = np.full(count, rec.UNKNOWN_PACE)

    def restart_segment(self) -> None:
        """Begin the next call at the present state, without a step before it."""
        self.progress["phase"], self.progress["has_last_step"] = rec.FRESH, 0

    def set_control(self, **values: float) -> None:
        """Set fields of the record `control`, see `loop_records`."""
        for name, value in values.items():
            self.control[name] = value

    def allocate_newton(self, n: int, q: int, reals: int, pairs: int) -> None:
        """Allocate the arrays of Newton iterations.

        n : number of states, 0 for explicit methods; q : number of stages that are solved together
        reals, pairs : numbers of stored factors for real and complex shifts
        """
        ledgers, size = self.ledger_rates.shape[1], int(self.newton["factor_size"][0])
        self.product, self.buffer, self.ledger_slopes = (
            np.zeros(n + ledgers),
            np.zeros(q * q),
            np.zeros(ledgers),
        )
        for name in IMPLICIT_VECTORS:
            setattr(self, name, np.zeros(n))
        self.last_stages, self.transformed = np.zeros((len(self.k), n)), np.zeros((3 * q, n))
        self.jacobian, self.factors = self.no_floats, np.zeros(reals * size)
        self.complex_factors = np.zeros(n + pairs * size, dtype=complex)

    def prepare_newton(self, structure: Structure) -> None:
        """Allocate arrays and select functions for the linear algebra of Newton iterations."""
        from fvsolve.core.steppers import newton

        q = pairs = 0
        if self.method.kind == "full":
            from fvsolve.core.steppers.irk import pairs_of

            q, pairs = len(self.k) - 1, pairs_of(self.method)
        # stages that are solved one by one need a real factor, whatever the method
        reals = max(q - 2 * pairs, 1)
        self.newton["factor_size"], self.structure = structure.store_size, structure.shape
        self.allocate_newton(structure.n, q, reals, pairs)
        self.jacobian = np.zeros(structure.nnz)
        self.algebra = (
            *structure.functions(),
            *(structure.functions(complex=True) if pairs else no_algebra()[2:]),
        )
        newton.reset(self.newton[0])

    @property
    def dense_order(self) -> int:
        """Order of the dense output: of the method's own polynomial, or of the cubic through both ends of a step."""
        extra = self.method.kind == "full" and start_slope_correction(self.method).size > 0
        return min(self.dense.shape[1] + extra, self.method.order) if self.dense.size else 3

    @property
    def separate_rows(self) -> int:
        """Source of output rows within steps of given length, a code of `loop_records`: dense output or separate steps.

        The dense output is not used if its order is too low, or if it contains the rate f(t, y) of a stiff problem,
        which amplifies the distance of y from the slow solution. Slopes of the last stage do not amplify this distance,
        but at the start of a run only f is available.
        """
        method = self.method
        if self.dense.shape[1] == 1:  # a straight line
            return rec.NEVER_SEPARATE
        if self.dense_order + 1 < method.order:
            return rec.ALWAYS_SEPARATE
        if method.explicit:
            return rec.NEVER_SEPARATE
        solved = (
            method.kind == "linear"
            or method.stiffly_accurate
            and not (self.dense.size and method.c[0] == 0.0)
        )
        return rec.SEPARATE_AT_START if solved else rec.ALWAYS_SEPARATE

    @property
    def end_at_rows(self) -> bool:
        """True if steps under error control end at the times of rows: the dense output cannot be used within them.

        Its order is too low, or it contains the rate f(t, y) of a stiff problem, or no real factor of Newton iterations
        exists, with which `row_substeps.defect` estimates its error.
        """
        method, implicit = self.method, not self.method.explicit
        if (
            self.dense_order + 1 < method.order
            or implicit
            and self.separate_rows == rec.ALWAYS_SEPARATE
        ):
            return True
        if method.kind != "full":
            return False
        from fvsolve.core.steppers.irk import pairs_of

        return len(self.k) - 1 == 2 * pairs_of(method)

    def discard_history(self) -> None:
        """Discard the step size, the last error, the stiffness count and the Jacobian, for a start after a kink."""
        kept = ("step",) if self.control["keeps_step"][0] else ()
        for name in {"step", "error_old", "switch_count", "split_remainder", "window"}.difference(
            kept
        ):
            self.state[name] = 0.0
        self.returns[:] = 0.0
        if self.control["kind"] != rec.EXPLICIT:
            from fvsolve.core.steppers.newton import reset

            reset(self.newton[0])

    def restart_arrays(self) -> dict[str, np.ndarray]:
        """All arrays of this object on which the next step depends, by name, except the states y."""
        names = ["state", "ledger", "carry", "pace", "returns"]
        if self.control["kind"] != rec.EXPLICIT:  # f at the start of the last step, and its stages
            names += ["newton", "jacobian", "first", "k"]
        return {name: getattr(self, name) for name in names}

    def after_restore(self) -> None:
        """Complete the data of Newton iterations after `restart_arrays` have been restored."""
        # negative: factor once more, without counting it again
        self.newton["shift"] = -abs(self.newton["shift"])

    def counts(self) -> dict[str, int]:
        """Numbers of steps, rejections, rhs calls, Jacobians, factorisations, Newton iterations, failures, split steps.

        The keys of the dict are those of `loop_records.COUNTS`.
        """
        return {name: int(self.state[0][field]) for name, field in rec.COUNTS.items()}

    def handle(self, separate_rows: bool):
        """Handle of the present arrays, made anew where an array has been replaced.

        separate_rows : True if separate steps for output rows must be possible
        """
        # Compiled code has the addresses of arrays, so that a replaced array needs a new handle.
        if self.linked is None or any(map(is_not, all_arrays(self), self.linked)):
            if separate_rows:
                self.prepare_spare()
            self.linked = RunArrays(*all_arrays(self))
            self.run = handle_of_run(self.linked)
        return self.run

    def prepare_spare(self) -> None:
        """Make the handle `spare`, with other arrays of a step, if rows may need separate steps or substeps."""
        control = self.control[0]
        adaptive = control["mode"] == rec.TOLERANCE
        if control["separate_rows"] == rec.NEVER_SEPARATE and (
            control["kind"] == rec.EXPLICIT or not adaptive
        ):
            return
        # A spare step writes to its own arrays, so that it leaves no trace in those of the run.
        own = (
            "newton",
            "k",
            "ledger_rates",
            "jacobian",
            "product",
            "buffer",
            "ledger_slopes",
            "factors",
        )
        own += ("complex_factors", "last_stages", "transformed", *IMPLICIT_VECTORS)
        if adaptive:
            if control["end_at_rows"] and not control["dense_steps"]:
                return
            own += () if control["end_at_rows"] else ("state", "progress", "y", "f_old")
        arrays = {name: getattr(self, name) for name in own}
        # no memory before use
        empty = {name: np.zeros(array.shape, array.dtype) for name, array in arrays.items()}
        self.spare_arrays = RunArrays(*all_arrays(self))._replace(**empty, out=self.out_row)
        self.spare = boxed_run(self.spare_arrays)

    def single_step(
        self, rhs, handle, ledger_offset: int, t: float, h: float, y: np.ndarray
    ) -> np.ndarray:
        """State after a single step of length h from state y at time t; NaN if its stages cannot be solved.

        Only an object whose time loop (`call`) has not run may be used: then the step depends on earlier single steps
        only through the stored Jacobian of Newton iterations. Changes `y`, `k` and `state`.
        rhs, handle : compiled right-hand side and its argument; ledger_offset : index of the first ledger rate in `out`
        """
        self.y[0] = y
        self.state["steps"] += 1.0
        self.control["ledger_offset"] = ledger_offset
        if not self.calls.size:  # a single step calls no observers
            self.calls = addresses(
                (self.attempt, rhs, rhs, rhs, rhs, rhs, *self.algebra, self.join, self.watcher)
            )
        # The first stage is the rate at the start, which otherwise the time loop provides.
        rhs(t, self.y[0], self.k[0], self.out, handle)
        self.ledger_rates[0] = self.out[ledger_offset : ledger_offset + self.ledger_rates.shape[1]]
        error = self.attempt(handle, self.handle(False), t, h, 0, 1)
        return self.y[1].copy() if error != rec.NEWTON_FAILED else np.full(y.size, np.nan)

    def call(
        self,
        fused_step,
        observe,
        record,
        events,
        rhs,
        handle,
        ledger_offset: int,
        armed: np.ndarray,
    ) -> int:
        """Continue the time loop; returns a code of `loop_records`, from DONE to SWITCHED.

        fused_step : complete step (t, h, y, y_new, out, handle, values) of a one-stage method that ends at t, with
        `out` and the record of its end; used if control["allow_fused"] allows it and no output row is due
        observe, record, events : functions for the probes of an output row, for each accepted state, event functions
        rhs : rates dydt and other results `out` of the model (t, y, dydt, out, handle); with an empty dydt it computes
        only `out`, which is enough for an output row
        handle : their argument, the handle of the model; armed : flags of the events
        ledger_offset : index of the first ledger rate in `out`
        """
        calls = addresses(
            (
                self.attempt,
                fused_step,
                observe,
                record,
                events,
                rhs,
                *self.algebra,
                self.join,
                self.watcher,
            )
        )
        # In place, because the handle contains the address of this array.
        self.calls = self.calls if self.calls.size else calls
        self.calls[:] = calls
        self.control["ledger_offset"], self.armed = ledger_offset, armed
        return self.run_steps(handle, self.handle(True))


# Kinds of methods: module and function of their steps, and value of `kind` in the time loop.
KINDS = {
    "explicit": ("erk.attempt", rec.EXPLICIT),
    "damped": ("erk.damped_attempt", rec.EXPLICIT),
    "diagonal": ("dirk.attempt", rec.NEWTON_SOLVED),
    "full": ("irk.attempt", rec.NEWTON_SOLVED),
    "linear": ("ros.attempt", rec.LINEARLY_IMPLICIT),
}


@compile_once
def attempt_of(kind: str, algebra: str = ""):
    """Function that takes one step of a kind of methods, compiled on first use.

    kind : key of `KINDS`; algebra : kind of linear algebra ("dense", "banded", "sparse"), "" for explicit methods
    A second process compiles the linear algebra at the same time: with real shifts, and with complex shifts too for
    fully implicit methods.
    """
    module, name = KINDS[kind][0].split(".")
    step = getattr(importlib.import_module(f"fvsolve.core.steppers.{module}"), name)
    if not algebra:
        return compile_as(step, ATTEMPT)
    shifts = {False, kind == "full"}
    code = f"from fvsolve.core.steppers.structure import functions; [functions({algebra!r}, of) for of in {shifts}]"
    with compile_in_parallel(code, "factor"):
        return compile_as(step, ATTEMPT)
