"""Any y' = f(t, y) through the same compiled steps. Knows no model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import objmode

from fvsolve.errors import FvsolveError
from fvsolve.steppers import erk
from fvsolve.steppers.tableau import Method, method_named


def integrate(
    f: Callable, y0, t, method: str | Method = "dormand-prince", rtol: float | None = None,
    step: float | None = None, atol: float | None = None,
) -> np.ndarray:  # fmt: skip
    """Values of y at the times t : float64[len(t), n], for y' = f(t, y), y(t[0]) = y0.

    f : f(t, y) -> float64[n]; it is compiled where numba can, else called as Python.
    rtol : relative tolerance of methods with an error estimate (default 1e-6), atol its absolute share, default rtol
    step : fixed step [s], for every method. Raises FvsolveError for two step settings, a method without an error
    estimate and no step, times out of order, and where the solution does not stay finite.
    """
    method = method_named(method) if isinstance(method, str) else method
    t, y0 = np.asarray(t, dtype=np.float64), np.atleast_1d(np.asarray(y0, dtype=np.float64))
    _check(method, t, rtol, step)
    functions, loop = _functions(f, t[0], y0)
    n, s = y0.size, method.stages
    found = np.empty((t.size, n))
    found[0] = y0
    y = np.zeros((4, n))
    y[0] = y0
    memory, orders = np.zeros(erk.MEMORY), np.zeros(erk.ORDERS)
    memory[erk.T] = t[0]
    orders[[erk.END, erk.STEP_MAX, erk.STOP_AT, erk.BUDGET]] = t[-1], 1e308, 1e308, 1e308
    orders[erk.CONTROL] = erk.FIXED_STEP if step is not None else erk.TOLERANCE
    orders[erk.SIZE] = step if step is not None else (1e-6 if rtol is None else rtol)
    share = 1.0 if atol is None or step is not None else atol / orders[erk.SIZE]
    flags = np.array([erk.FRESH, 0, 0, 1, 0], dtype=np.int64)
    work = _work(method, n, s)
    key = work["handle"][0] = id(f)
    _PYTHON[int(key)] = f
    for i in range(1, t.size):
        orders[erk.END] = t[i]
        orders[erk.BUDGET] = 1e308
        flags[erk.PHASE], flags[erk.BEHIND] = erk.FRESH, 0
        kept = memory[erk.STEP]
        code = loop(*functions, work["handle"], method.a, method.b, method.c, method.error, method.dense,
                    method.error_order + 1 if method.adaptive else method.order, method.first_same_as_last, orders,
                    memory, flags, y, work["k"], work["f_old"], work["supply"], 3, work["none"], np.full(n, share),
                    work["out"], work["out_row"], work["none"], work["none"], work["none"], work["none"],
                    work["nobody"], work["none"], work["y_out"], work["rows"])  # fmt: skip
        if code != erk.DONE:
            raise FvsolveError(f"{method.name} stopped at t = {memory[erk.T]:.6g}: the solution is not finite or the "
                               "step shrank to nothing; try a smaller step or a larger rtol")  # fmt: skip
        found[i] = y[flags[erk.NOW]]
        if step is None and memory[erk.STEP] == 0.0:
            memory[erk.STEP] = kept
        if step is not None:
            memory[erk.STEP] = 0.0
    return found


def _check(method, t, rtol, step) -> None:
    if rtol is not None and step is not None:
        raise FvsolveError("rtol and step both set the step; keep one")
    if step is None and not method.adaptive:
        raise FvsolveError(f"{method.name} has no error estimate; give step")
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise FvsolveError("t must be at least two times, rising")
    for name, value in (("rtol", rtol), ("step", step)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise FvsolveError(f"{name} = {value!r} is not a positive number")


def _work(method, n, s):
    sizes = {"f_old": n, "y_out": n, "out": 4, "out_row": 4, "none": 0}
    work = {name: np.zeros(size) for name, size in sizes.items()}
    return work | {"k": np.zeros((s, n)), "supply": np.zeros((s, 0)), "rows": np.zeros((1, 1)),
                   "handle": np.zeros(1, dtype=np.int64), "nobody": np.zeros(0, dtype=np.int64)}  # fmt: skip


_PYTHON: dict[int, Callable] = {}  # functions that numba cannot compile, by the number in their handle


def _call_python(t, y, dydt, out, handle):
    out[:] = (0.0, 0.0, -1.0, 0.0)
    with objmode():
        dydt[:] = _PYTHON[int(handle[0])](t, y)


def _nothing(t, y, out, handle, values):
    pass


def _no_leap(t, h, y, y_new, out, handle, values):
    pass


def _no_events(t, y, handle, g):
    pass


def _functions(f, t0, y0):
    """(rhs, leap, observe, record, events) around f, and the loop that takes them; f compiled where numba can."""
    if not hasattr(erk.run_erk, "compile"):

        def plain(t, y, dydt, out, handle):
            out[:] = (0.0, 0.0, -1.0, 0.0)
            dydt[:] = f(t, y)

        return (plain, _no_leap, _nothing, _nothing, _no_events), erk.run_erk
    from numba import types

    v, handle = types.float64[::1], types.int64[::1]
    functions = (
        (_rhs(f, t0, y0), (types.float64, v, v, v, handle)),
        (_no_leap, (types.float64, types.float64, v, v, v, handle, v)),
        (_nothing, (types.float64, v, v, handle, v)),
        (_nothing, (types.float64, v, v, handle, v)),
        (_no_events, (types.float64, v, handle, v)),
    )
    return tuple(_compiled(function, signature) for function, signature in functions), erk.compiled()


def _compiled(function, signature):
    import numba

    found = numba.njit(function)
    found.compile(signature)
    found.disable_compile()
    return found


def _rhs(f, t0, y0):
    """f in the loop's own form; a function that numba refuses is called as Python."""
    import numba
    from numba.core.errors import NumbaError

    inner = f if hasattr(f, "py_func") else numba.njit(f)
    try:
        inner(t0, y0)
    except (NumbaError, TypeError, NotImplementedError):
        return _call_python

    def rhs(t, y, dydt, out, handle):
        out[0], out[1], out[2] = 0.0, 0.0, -1.0
        d = inner(t, y)
        for i in range(dydt.size):
            dydt[i] = d[i]

    return rhs
