"""Any y' = f(t, y) through the same compiled steps. Knows no model."""

from __future__ import annotations

import functools
import inspect
import itertools
from collections.abc import Callable
from numbers import Real

import numba
import numpy as np
from numba import objmode

from fvsolve.errors import FvsolveError
from fvsolve.jit import COMPILING, Declared, code_of, once
from fvsolve.steppers import automatic, slots
from fvsolve.steppers.methods import AUTO
from fvsolve.steppers.signatures import EVENTS, LEAP, OBSERVE, RHS, kinds_of
from fvsolve.steppers.stepper import Stepper
from fvsolve.steppers.structure import Structure
from fvsolve.steppers.tableau import METHODS, Method, method_named
from fvsolve.steppers.tolerances import LEAST_STEP, LEAST_TOLERANCE

NO_LIMIT = 1e308


def integrate(
    f: Callable, y0, t, method: str | Method = "dormand-prince", rtol: float | None = None,
    step: float | None = None, atol=None, counts: dict | None = None,
) -> np.ndarray:  # fmt: skip
    """Values of y at the times t : float64[len(t), n], for y' = f(t, y), y(t[0]) = y0.

    f : f(t, y) -> float64[n], or f(t, y, dydt), which fills its last argument; compiled where numba can
    method : a name, a tableau, or "auto": explicit while the spectrum allows it, implicit where that is cheaper
    rtol : relative tolerance of methods with an error estimate (default 1e-6); atol : absolute one, a number or
    float64[n], default rtol; step : fixed step [s], for every method
    counts : a dict to be filled with the numbers of steps, rejections, rhs, jacobians, factorisations, newton, ...
    Times are met by dense output; else by steps that end there (`rtol`) or separate steps to them (`step`).
    Raises FvsolveError for two step settings, a method without an error estimate and no step, times out of order,
    and where the solution does not stay finite or Newton fails.
    """
    watched = isinstance(method, str) and method == AUTO
    if watched and step is not None:
        raise FvsolveError('method "auto" goes by the error of its steps; give rtol, not step')
    if not isinstance(method, (str, Method)):
        raise FvsolveError(f"method = {method!r} is none; wanted a name or a tableau")
    if not callable(f):
        raise FvsolveError(f"f = {f!r} cannot be called; wanted f(t, y) or f(t, y, dydt)")
    if counts is not None and not isinstance(counts, dict):
        raise FvsolveError(f"counts = {counts!r} cannot be filled; wanted a dict")
    method = method_named(automatic.first_method(method)) if isinstance(method, str) else method
    t, y0 = _numbers("t", t), np.atleast_1d(_numbers("y0", y0))
    if y0.ndim != 1:
        raise FvsolveError(f"y0 has shape {y0.shape}; wanted one row of numbers")
    _check(method, t, rtol, step)
    size = step if step is not None else (1e-6 if rtol is None else rtol)
    scale = np.ones(y0.size) if atol is None or step is not None else _scale(atol, size, y0.size)
    stepper = Stepper(method, y0.size, 0, lambda: _full(y0.size), scale)
    controls, loop_state = stepper.orders, stepper.memory
    stepper.y[0], loop_state[slots.T] = y0, t[0]
    controls[slots.CONTROL] = slots.FIXED_STEP if step is not None else slots.TOLERANCE
    controls[[slots.SIZE, slots.STEP_MAX, slots.STOP_AT]] = size, NO_LIMIT, NO_LIMIT
    if watched:
        automatic.watch(stepper, _full(y0.size))
    key = next(_KEYS)
    functions, _PYTHON[key] = _prepared(f, t[0], y0)
    try:
        found = _stepped(stepper, functions, key, t, y0)
    finally:
        _PYTHON.pop(key), _RAISED.pop(key, None)
    if counts is not None:
        counts |= stepper.counts()
    return found


def _stepped(stepper: Stepper, functions: tuple, key: int, t, y0) -> np.ndarray:
    """States at t : float64[len(t), n]."""
    controls, loop_state, progress = stepper.orders, stepper.memory, stepper.flags
    stepper.times, stepper.rows = np.ascontiguousarray(t[1:]), np.zeros((t.size, y0.size + 1))
    found = np.empty((t.size, y0.size))
    found[0] = y0
    controls[slots.END] = t[-1]
    progress[slots.PHASE], progress[slots.BEHIND] = slots.FRESH, 0
    code = slots.CHUNK
    while code == slots.CHUNK:
        if automatic.wants_change(stepper):
            automatic.change(stepper)
        controls[slots.BUDGET] = NO_LIMIT
        code = stepper.call(*functions, np.array([key]), WHERE, stepper.none)
    if code != slots.DONE:
        raise FvsolveError(_failure(stepper.method, code, loop_state)) from _RAISED.get(key)
    found[1:-1], found[-1] = stepper.rows[: t.size - 2, 1:], stepper.y[progress[slots.NOW]]
    return found


def _prepared(f, t0, y0) -> tuple:
    """(the loop's functions around f, f(t, y, dydt) as Python), kept where f is compiled already.

    What a plain function reads from outside may change between two calls, and compiled code would not see it.
    """
    if f not in _COMPILED:
        _try_out(f, t0, y0)
        made = _functions(f, t0, y0), f if in_place(f) else lambda t, y, dydt: np.copyto(dydt, f(t, y))
        if not hasattr(f, "py_func"):
            return made
        _COMPILED[f] = made
    return _COMPILED[f]


@functools.cache
def _full(n):
    return Structure.full(n)


def _failure(method, code, loop_state) -> str:
    when = f"{method.name} stopped at t = {loop_state[slots.T]:.6g}: "
    if code == slots.NEWTON_STUCK:
        return when + f"Newton did not converge, worst in y[{int(loop_state[slots.WORST])}]; try another rtol or method"
    return when + "the solution is not finite or the step shrank to nothing; try a smaller step or a larger rtol"


def _numbers(name, given) -> np.ndarray:
    try:
        if np.asarray(given).dtype.kind == "c":
            raise TypeError
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise FvsolveError(f"{name} = {given!r} is not made of numbers") from None


def _scale(atol, rtol: float, n: int) -> np.ndarray:
    """What a deviation of each state is measured against, beside its own size."""
    atol = _numbers("atol", atol)
    if atol.shape not in ((), (n,)) or not np.all(np.isfinite(atol) & (atol > 0)):
        raise FvsolveError(f"atol must be a positive number, or {n} of them, one a state")
    return np.broadcast_to(atol / rtol, n).copy()


def _try_out(f, t, y0) -> None:
    """Compiled code cannot see how many values f gives, so it is asked once before."""
    if not in_place(f):
        given = f(t, y0.copy())
        count = 0 if given is None else np.size(given)
        if count != y0.size:
            raise FvsolveError(f"f(t, y) gives {count} rates for {y0.size} states")


def _check(method, t, rtol, step) -> None:
    if rtol is not None and step is not None:
        raise FvsolveError("rtol and step both set the step; keep one")
    if step is None and not method.adaptive:
        able = ", ".join(dict.fromkeys(other.name for other in METHODS.values() if other.adaptive))
        raise FvsolveError(f"{method.name} has no error estimate; give step, or one of {able}")
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise FvsolveError("t must be at least two times, rising")
    for name, value in (("rtol", rtol), ("step", step)):
        if value is not None and not (isinstance(value, Real) and np.isfinite(value) and value > 0):
            raise FvsolveError(f"{name} = {value!r} is not a positive number")
    least = LEAST_STEP * np.abs(t).max(initial=0.0)
    if step is not None and 0 < step <= least:
        raise FvsolveError(f"step = {step:g} would not move the time; wanted more than {least:.2g}")
    if rtol is not None and 0 < rtol < LEAST_TOLERANCE:
        raise FvsolveError(f"rtol = {rtol:g} is below rounding; wanted {LEAST_TOLERANCE:g} or more")


_COMPILED: dict[Callable, tuple] = {}  # what was prepared for functions that are compiled already
_KEYS = itertools.count()  # of what follows, one a call: threads may step one function at a time
_PYTHON: dict[int, Callable] = {}  # functions that numba cannot compile, by the number in their handle
_RAISED: dict[int, BaseException] = {}  # what they raised
WHERE = 3  # no ledger behind it in `out`


def _call_python(t, y, dydt, out, handle):
    out[:4] = (0.0, 0.0, -1.0, 0.0)
    if dydt.size > 0:
        with objmode():
            _python(t, y, dydt, int(handle[0]))


def _python(t, y, dydt, key):
    """f called as Python; compiled code cannot pass on what it raises, so that waits until the loop is back."""
    try:
        _PYTHON[key](t, y, dydt)
    except BaseException as error:
        _RAISED[key] = error
        dydt[:] = np.nan


def _row(t, y, out, handle, values):
    for i in range(values.size):
        values[i] = y[i]


def _nothing(t, y, out, handle, values):
    pass


def _no_leap(t, h, y, y_new, out, handle, values):
    pass


def _no_events(t, y, handle, g):
    pass


def in_place(f) -> bool:
    """Whether f(t, y, dydt) fills its last argument; one with a default is a constant of f's own."""
    parameters = inspect.signature(getattr(f, "py_func", f)).parameters.values()
    return sum(one.default is inspect.Parameter.empty for one in parameters) == 3


def _functions(f, t0, y0):
    """(leap, observe, record, events, rhs) around f, compiled where numba can."""
    if not COMPILING:

        def plain(t, y, dydt, out, handle):
            out[:4] = (0.0, 0.0, -1.0, 0.0)
            if dydt.size > 0:
                _python(t, y, dydt, int(handle[0]))

        return _no_leap, _row, _nothing, _no_events, plain
    return *watchers(), _taken(numba.njit(_rhs(f, t0, y0)), RHS)


def _taken(function, letters: str) -> Declared:
    """What numba is to compile for arguments of these kinds, as the loop takes it."""
    kinds = kinds_of(letters)
    function.compile(kinds)
    return Declared(function, letters, code_of(function.overloads[kinds]))


@once
def watchers() -> tuple:
    """(leap, observe, record, events) of a system that has none of them but its states."""
    functions = (_no_leap, LEAP), (_row, OBSERVE), (_nothing, OBSERVE), (_no_events, EVENTS)
    return tuple(_taken(numba.njit(function), letters) for function, letters in functions)


def _rhs(f, t0, y0):
    """f in the loop's own form, NaN where it raises; a function that numba refuses is called as Python."""
    from numba.core.errors import NumbaError, UnsupportedBytecodeError

    fills = in_place(f)
    try:
        inner = f if hasattr(f, "py_func") else numba.njit(f)
        inner(t0, y0, np.empty_like(y0)) if fills else inner(t0, y0)
    except (NumbaError, UnsupportedBytecodeError, TypeError, NotImplementedError):
        return _call_python

    def rhs(t, y, dydt, out, handle):
        out[0], out[1], out[2] = 0.0, 0.0, -1.0
        if dydt.size > 0:
            try:
                d = inner(t, y)
                for i in range(dydt.size):
                    dydt[i] = d[i]
            except Exception:
                dydt[:] = np.nan

    def rhs_in_place(t, y, dydt, out, handle):
        out[0], out[1], out[2] = 0.0, 0.0, -1.0
        if dydt.size > 0:
            try:
                inner(t, y, dydt)
            except Exception:
                dydt[:] = np.nan

    return rhs_in_place if fills else rhs
