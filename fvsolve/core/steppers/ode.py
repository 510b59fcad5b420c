"""Integration of any y' = f(t, y) by the compiled time loop."""

import functools
import inspect
import itertools
import math
from collections.abc import Callable, Sequence
from numbers import Real
from types import CodeType, FunctionType
from typing import Any, overload

import numba
import numpy as np
from numba import objmode
from numpy.typing import ArrayLike

from fvsolve.core.kernels.calls import argument_types
from fvsolve.core.steppers import automatic, loop_records
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.loop_records import LEAST_STEP, LEAST_TOLERANCE
from fvsolve.core.steppers.ode_events import EventSearch, EventSolution, read_events
from fvsolve.core.steppers.run_handle import EVENTS, FUSED_STEP, OBSERVE, RHS
from fvsolve.core.steppers.structure import Structure
from fvsolve.core.steppers.tableau import AUTO, METHODS, Method, method_named
from fvsolve.errors import FvsolveError
from fvsolve.jit import COMPILING, DeclaredFunction, compile_once, compile_signature

NO_LIMIT = 1e308
AFTER_STEP = loop_records.DONE, loop_records.BUDGET_SPENT  # codes after a step whose end is valid


@overload
def integrate(
    f: Callable[..., Any],
    y0: ArrayLike,
    t: ArrayLike,
    method: str | Method = ...,
    rtol: float | None = ...,
    step: float | None = ...,
    atol: ArrayLike | None = ...,
    counts: dict[str, int] | None = ...,
    *,
    max_step: float | None = ...,
    first_step: float | None = ...,
    tcrit: ArrayLike = ...,
    events: None = ...,
) -> np.ndarray: ...


@overload
def integrate(
    f: Callable[..., Any],
    y0: ArrayLike,
    t: ArrayLike,
    method: str | Method = ...,
    rtol: float | None = ...,
    step: float | None = ...,
    atol: ArrayLike | None = ...,
    counts: dict[str, int] | None = ...,
    *,
    max_step: float | None = ...,
    first_step: float | None = ...,
    tcrit: ArrayLike = ...,
    events: Callable[..., Any] | Sequence[Callable[..., Any]],
) -> EventSolution: ...


def integrate(
    f: Callable[..., Any],
    y0: ArrayLike,
    t: ArrayLike,
    method: str | Method = "dormand-prince",
    rtol: float | None = None,
    step: float | None = None,
    atol: ArrayLike | None = None,
    counts: dict[str, int] | None = None,
    *,
    max_step: float | None = None,
    first_step: float | None = None,
    tcrit: ArrayLike = (),
    events: Any = None,
) -> np.ndarray | EventSolution:
    """Integrate y' = f(t, y), y(t[0]) = y0; returns y at the times t : float64[len(t), n].

    f : f(t, y) -> float64[n], or f(t, y, dydt), which fills its last argument; compiled if numba can compile it
    method : a name, a tableau, or "auto": explicit while stability allows it, implicit where that is cheaper
    rtol : relative tolerance for methods with an error estimate; default 1e-6
    atol : absolute tolerance, a number or float64[n]; default: equal to rtol; not used under `step`
    step : fixed step [s], possible with every method except "auto"
    counts : dict that receives the numbers of steps, rejections, rhs calls, Jacobians, factorisations and so on
    max_step, first_step : greatest and first step under error control [s]; default: not limited, from the rates
    tcrit : times at which f jumps or has a kink, at which steps end; f is read before and after each of them
    events : function g(t, y) whose zeros are located, or a list of functions, with the attributes `terminal` (False, or
    the number of zeros that ends the integration) and `direction` (0, or the sign of the slope of g at zeros that
    count). Then the result is an `EventSolution` with t, y, t_events, y_events, status. A zero at t[0] is no event.
    Values at the times t come from dense output if it is accurate enough. Otherwise steps end there under `rtol`, and
    separate steps lead there under `step`.
    Raises FvsolveError for invalid arguments, two step settings, a method without an error estimate and without a step,
    times that do not rise, a solution that does not stay finite, and Newton iterations that do not converge.
    """
    automatic_choice = isinstance(method, str) and method == AUTO
    if automatic_choice and step is not None:
        raise FvsolveError('method "auto" uses error control; give rtol, not step')
    if not isinstance(method, (str, Method)):
        raise FvsolveError(f"method = {method!r} is not a method; expected a name or a tableau")
    if not callable(f):
        raise FvsolveError(f"f = {f!r} cannot be called; expected f(t, y) or f(t, y, dydt)")
    if counts is not None and not isinstance(counts, dict):
        raise FvsolveError(f"counts = {counts!r} is not a dict; expected a dict")
    method = method_named(automatic.first_method(method)) if isinstance(method, str) else method
    t, y0 = _numbers("t", t), np.atleast_1d(_numbers("y0", y0))
    if y0.ndim != 1:
        raise FvsolveError(f"y0 has shape {y0.shape}; expected a single row of numbers")
    _check(method, t, rtol, step)
    _check_steps(t, step, max_step, first_step)
    found = read_events(events) if events is not None else []
    size = step if step is not None else (1e-6 if rtol is None else rtol)
    scale = np.ones(y0.size) if atol is None or step is not None else _scale(atol, size, y0.size)
    stepper = Integrator(method, y0.size, 0, lambda: _full(y0.size), scale)
    stepper.y[0], stepper.state["t"] = y0, t[0]
    mode = loop_records.FIXED_STEP if step is not None else loop_records.TOLERANCE
    stepper.set_control(mode=mode, size=size, step_max=max_step or NO_LIMIT, stop_at=NO_LIMIT)
    stepper.state["step"] = first_step or 0.0
    if automatic_choice:
        automatic.watch(stepper, _full(y0.size))
    key = next(_KEYS)
    functions, _PYTHON[key] = _prepare(f, t[0], y0)
    search = EventSearch(found, stepper, np.array([key]))
    try:
        states = _solve_steps(stepper, functions, key, t, y0, _critical_times(tcrit, t), search)
    finally:
        _PYTHON.pop(key), _EXCEPTIONS.pop(key, None)
    if counts is not None:
        counts |= stepper.counts()
    return states if events is None else search.solution(t, states)


def _solve_steps(
    stepper: Integrator, functions: tuple, key: int, t, y0, critical, search
) -> np.ndarray:
    """Take all steps, and return the states at the times t : float64[len(t), n], or up to a terminal event.

    stepper : `Integrator` of the call; y0 : state at t[0]; functions : result of `_functions`
    key : number of the call, with which compiled code finds the Python function
    critical : result of `_critical_times`; search : `EventSearch` of the call
    """
    stepper.times, stepper.rows = np.ascontiguousarray(t[1:]), np.zeros((t.size, y0.size + 1))
    states = np.empty((t.size, y0.size))
    states[0] = y0
    for end, start in (*critical, (t[-1], t[-1])):
        stepper.set_control(end=end)
        stepper.restart_segment()
        code = _solve_segment(stepper, functions, key, search)
        if code == loop_records.STOPPED:
            states[1:] = stepper.rows[: t.size - 1, 1:]
            return states
        if code != loop_records.DONE:
            raise FvsolveError(
                _failure(stepper.method, code, stepper.state[0])
            ) from _EXCEPTIONS.get(key)
        if end < t[-1]:
            # f may jump there, so that step size, errors and Jacobian of the time before are useless.
            stepper.discard_history()
            stepper.state["t"] = start
    states[1:-1], states[-1] = stepper.rows[: t.size - 2, 1:], stepper.y[stepper.progress[0]["now"]]
    return states


def _solve_segment(stepper: Integrator, functions: tuple, key: int, search) -> int:
    """Take all steps of a segment; returns a code of `loop_records`, STOPPED for a terminal event.

    Arguments as for `_solve_steps`
    """
    code = loop_records.BUDGET_SPENT
    handle = np.array([key])
    steps = stepper.state[0]["steps"]
    while code == loop_records.BUDGET_SPENT:
        if automatic.is_change_due(stepper):
            automatic.change(stepper)
        # With events the loop returns after each step, in which Python then searches for zeros.
        stepper.set_control(budget=1.0 if search.events else NO_LIMIT)
        code = stepper.call(*functions, handle, WHERE, stepper.no_floats)
        if search.events and stepper.state[0]["steps"] > steps and code in AFTER_STEP:
            steps = stepper.state[0]["steps"]
            if search.search_step():
                return loop_records.STOPPED
    return code


def _critical_times(tcrit, t) -> list[tuple[float, float]]:
    """(end of steps just before, start just after) each critical time within the times t, increasing [s].

    The distance is a few units of rounding, so that f is evaluated on the right side of a jump of either convention.
    Raises FvsolveError for values that are not finite numbers.
    """
    times = np.unique(_numbers("tcrit", tcrit))
    if not np.isfinite(times).all():
        raise FvsolveError(f"tcrit = {tcrit!r} is not valid; expected finite times")
    gap = 4.0 * np.finfo(float).eps * np.abs(t).max()
    return [
        (time - gap, time + gap)
        for time in times.tolist()
        if t[0] + 4.0 * gap < time < t[-1] - 4.0 * gap
    ]


def _check_steps(t, step, max_step, first_step) -> None:
    """Raise FvsolveError for invalid limits of steps."""
    for name, value in (("max_step", max_step), ("first_step", first_step)):
        if value is None:
            continue
        if step is not None:
            raise FvsolveError(f"step and {name} both set the step; give only one of them")
        if not isinstance(value, Real) or not value > 0:
            raise FvsolveError(f"{name} = {value!r} is not a positive number")
        if value <= LEAST_STEP * np.abs(t).max():
            raise FvsolveError(f"{name} = {value:g} is too small to change the time")
    if first_step is not None and first_step > t[-1] - t[0]:
        raise FvsolveError(
            f"first_step = {first_step:g} is longer than the integration, {t[-1] - t[0]:g}"
        )


def _prepare(f, t0, y0) -> tuple:
    """(functions of the time loop for f, f as a Python function of (t, y, dydt)).

    The functions are compiled once for a compiled function, and once for all plain functions of the same code and
    values. t0, y0 : arguments of a trial call
    """
    python, key = f if in_place(f) else lambda t, y, dydt: np.copyto(dydt, f(t, y)), f
    if not hasattr(f, "py_func"):
        key = frozen_values(f)
    _check_rates(f, t0, y0)
    if key is None or key not in _COMPILED:
        functions = _functions(f, t0, y0)
        if key is None:
            return functions, python
        # A dict keeps the order of insertion, so its first key is the oldest.
        if len(_COMPILED) == MOST_COMPILED:
            del _COMPILED[next(iter(_COMPILED))]
        _COMPILED[key] = functions
    return _COMPILED[key], python


def frozen_values(f: Callable) -> tuple | None:
    """Code of a plain function and all values from outside that its compiled form contains, as a dictionary key.

    None if one of these values may change in place, such as a list, or is not known, such as an object.
    """
    if not isinstance(f, FunctionType) or f.__kwdefaults__:
        return None
    # A function within f may read other variables, which are not listed with those of f.
    if any(isinstance(constant, CodeType) for constant in f.__code__.co_consts):
        return None
    try:
        outer = inspect.getclosurevars(f)
    except ValueError:  # a variable from outside has no value yet
        return None
    values = [
        (name, frozen_value(value))
        for name, value in (*outer.nonlocals.items(), *outer.globals.items())
    ]
    values.append(("", frozen_value(f.__defaults__ or ())))
    return None if any(value is None for _, value in values) else (f.__code__, *values)


def frozen_value(value: Any) -> tuple | None:
    """A value of a variable from outside a function as part of a dictionary key; None if it may change in place."""
    if isinstance(value, tuple):
        parts = tuple(map(frozen_value, value))
        return None if None in parts else ("tuple", *parts)
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
        return "array", value.dtype.str, value.shape, value.strides, value.tobytes()
    if isinstance(value, (bool, int, float, complex, str, np.number)):
        return type(value), repr(value)
    known = value is None or value is np or value is math or hasattr(value, "py_func")
    if not known and callable(value):
        known = str(getattr(value, "__module__", "")).partition(".")[0] in (
            "builtins",
            "math",
            "numpy",
        )
    return ("object", value) if known else None


@functools.cache
def _full(n):
    return Structure.full(n)


def _failure(method, code, state) -> str:
    when = f"{method.name} stopped at t = {state['t']:.6g}: "
    if code == loop_records.NEWTON_STUCK:
        return (
            when
            + f"Newton did not converge, worst in y[{int(state['worst'])}]; try another rtol, step or method"
        )
    return (
        when
        + "the solution is not finite or the step became too small; set a smaller step, or rtol without step"
    )


def _numbers(name, given) -> np.ndarray:
    try:
        if np.asarray(given).dtype.kind == "c":
            raise TypeError
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise FvsolveError(f"{name} = {given!r} is not valid; expected real numbers") from None


def _scale(atol, rtol: float, n: int) -> np.ndarray:
    """Size that is added to the size of each state in its error tolerance, atol / rtol : float64[n].

    Raises FvsolveError for a wrong shape and for numbers that are not positive.
    n : number of states
    """
    atol = _numbers("atol", atol)
    if atol.shape not in ((), (n,)) or not np.all(np.isfinite(atol) & (atol > 0)):
        raise FvsolveError(
            f"atol = {atol.tolist()} is not valid; expected a positive number, or a row of positive "
            f"numbers with the length of y0, {n}"
        )
    return np.broadcast_to(atol / rtol, n).copy()


def _check_rates(f, t, y0) -> None:
    """Call f(t, y) once and check the number of its values, because compiled code does not check it.

    A function f(t, y, dydt) is not called. Raises FvsolveError for a wrong number.
    """
    if not in_place(f):
        given = f(t, y0.copy())
        count = 0 if given is None else np.size(given)
        if count != y0.size:
            raise FvsolveError(f"f(t, y) gives {count} rates for {y0.size} states")


def _check(method, t, rtol, step) -> None:
    if rtol is not None and step is not None:
        raise FvsolveError("rtol and step both set the step; give only one of them")
    if step is None and not method.adaptive:
        adaptive = ", ".join(
            dict.fromkeys(other.name for other in METHODS.values() if other.adaptive)
        )
        raise FvsolveError(
            f"{method.name} has no error estimate; give step, or one of the methods {adaptive}"
        )
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise FvsolveError("t is not valid; expected at least two times in rising order")
    for name, value in (("rtol", rtol), ("step", step)):
        if value is not None and not (isinstance(value, Real) and np.isfinite(value) and value > 0):
            raise FvsolveError(f"{name} = {value!r} is not a positive number")
    least = LEAST_STEP * np.abs(t).max(initial=0.0)
    if step is not None and 0 < step <= least:
        raise FvsolveError(
            f"step = {step:g} is too small to change the time; expected more than {least:.2g}"
        )
    if rtol is not None and 0 < rtol < LEAST_TOLERANCE:
        raise FvsolveError(
            f"rtol = {rtol:g} is below rounding errors; expected {LEAST_TOLERANCE:g} or more"
        )


# functions of the time loop, by compiled function or by `frozen_values`
_COMPILED: dict[Any, tuple] = {}
MOST_COMPILED = 100  # number of systems whose functions are kept; then the oldest is dropped
# keys of the next two dicts, one for each call: threads may integrate at the same time
_KEYS = itertools.count()
_PYTHON: dict[int, Callable] = {}  # Python functions, by the number in their handle
_EXCEPTIONS: dict[int, BaseException] = {}  # exceptions that they raised
WHERE = 3  # ledger offset in `out`: no ledger follows


def _call_python(t, y, dydt, out, handle):
    out[:4] = (0.0, 0.0, -1.0, 0.0)
    if dydt.size > 0:
        with objmode():
            _python(t, y, dydt, int(handle[0]))


def _python(t, y, dydt, key):
    """Call f as a Python function; store its exception until the loop returns: compiled code cannot raise it."""
    try:
        _PYTHON[key](t, y, dydt)
    except BaseException as error:
        # NaN ends the time loop; then the stored exception is raised.
        _EXCEPTIONS[key] = error
        dydt[:] = np.nan


def _row(t, y, out, handle, values):
    for i in range(values.size):
        values[i] = y[i]


def _nothing(t, y, out, handle, values):
    pass


def _no_fused_step(t, h, y, y_new, out, handle, values):
    pass


def _no_events(t, y, handle, g):
    pass


def in_place(f) -> bool:
    """True if f has exactly three parameters without default; then it is f(t, y, dydt), which fills dydt."""
    parameters = inspect.signature(getattr(f, "py_func", f)).parameters.values()
    return sum(parameter.default is inspect.Parameter.empty for parameter in parameters) == 3


def _functions(f, t0, y0):
    """(fused step, observe, record, events, rhs), functions of the time loop for f; compiled if numba can compile f.

    t0, y0 : arguments of a trial call
    """
    if not COMPILING:

        def plain(t, y, dydt, out, handle):
            out[:4] = (0.0, 0.0, -1.0, 0.0)
            if dydt.size > 0:
                _python(t, y, dydt, int(handle[0]))

        return _no_fused_step, _row, _nothing, _no_events, plain
    rates = _rhs(f, t0, y0)
    return *observers(), _compile(numba.njit(rates), RHS) if rates else python_rates()


def _compile(function, letters: str) -> DeclaredFunction:
    """Compile a numba function for the time loop, with arguments of the types `letters`, see `run_handle`."""
    return compile_signature(function, letters, argument_types(letters))


@compile_once
def observers() -> tuple:
    """(fused step, observe, record, events) for the time loop of a system without events; rows are its states."""
    functions = (
        (_no_fused_step, FUSED_STEP),
        (_row, OBSERVE),
        (_nothing, OBSERVE),
        (_no_events, EVENTS),
    )
    return tuple(_compile(numba.njit(function), letters) for function, letters in functions)


@compile_once
def python_rates() -> DeclaredFunction:
    """Rates in the time loop of a system whose f is called as a Python function."""
    return _compile(numba.njit(_call_python), RHS)


def _rhs(f, t0, y0) -> Callable | None:
    """Function for the rates in the time loop, made from f; it sets NaN where f raises an exception.

    None if numba cannot compile f. t0, y0 : arguments of a trial call
    """
    fills = in_place(f)
    try:
        inner = f if hasattr(f, "py_func") else numba.njit(f)
        inner(t0, y0, np.empty_like(y0)) if fills else inner(t0, y0)
    except (numba.NumbaError, numba.UnsupportedBytecodeError, TypeError, NotImplementedError):
        return None

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
