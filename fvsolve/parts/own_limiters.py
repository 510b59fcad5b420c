"""Slope limiters of users: registration, tests of a function phi(r), and its transfer to other processes."""

import base64
import builtins
import hashlib
import marshal
import math
import os
import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from importlib.util import module_from_spec, spec_from_file_location
from numbers import Real
from types import CellType, FunctionType, ModuleType

import numpy as np

from fvsolve.argument_checks import FUNCTION, TEXT, validated
from fvsolve.core.schemes import LIMITERS, LIMITERS_VARIABLE, Limiter, OwnLimiter
from fvsolve.errors import FvsolveError
from fvsolve.units import show

SEPARATOR = ";"  # of its entries NAME=FILE.py:FUNCTION or NAME=DATA
BUILT_IN = tuple(LIMITERS)
MODULES = {"math": math, "numpy": np}  # modules that a limiter may use
LARGEST = 15  # exponent of the greatest ratio r: kernels bound r by the rounding of a difference
# as from np.unique, which would import numpy.ma at every start
POSITIVE = np.array(sorted({*np.logspace(-LARGEST, LARGEST, 241), *np.linspace(0.0, 4.0, 161)[1:]}))
RATIOS = np.concatenate([-POSITIVE[::-1], [0.0], POSITIVE])  # r at which a limiter is tested
ROUNDING = 1e-9  # tolerance of the tests
STEP = 1e-6  # of one-sided differences for tangents, relative to r
# r of the tangents, each with the side of the difference: both ends, both sides of 1, and between the usual kinks
TANGENTS = (
    (1e-6, 1),
    (0.125, 1),
    (0.75, 1),
    (1.0, -1),
    (1.0, 1),
    (1.25, 1),
    (1.75, 1),
    (3.0, 1),
    (1e6, -1),
)


@validated(name=TEXT, function=FUNCTION)
def register_limiter(name: str, function: Callable[[float], float]) -> None:
    """Register a slope limiter phi(r) for `numerics.limiter`; r is the difference behind a cell over that ahead.

    The slope of a cell is phi(r) times the difference ahead. Kernels with this limiter are compiled at its first use.
    The function may use numbers, `math`, `numpy`, and functions of these; their values are those at this call.
    Child processes register the limiter too. A later call with the same name replaces the limiter; models built before
    keep theirs. A run with a limiter outside the region of Sweby (1984) has a notice.
    Raises FvsolveError for the name of a built-in limiter, and if phi is not a finite number for every r.
    """
    if name in BUILT_IN or not re.fullmatch(r"[\w-]+", name):
        reason = "is built in" if name in BUILT_IN else "is not a name of letters, digits, - and _"
        raise FvsolveError(f"register_limiter: {show(name)} {reason}; expected another name")
    add(name, packed(getattr(function, "py_func", function), name))


def add(name: str, data: str) -> None:
    """Add a limiter to `LIMITERS` and to the environment; data : function as text, see `packed`."""
    phi = unpacked(data, name)
    values = np.array([value_at(phi, name, float(r)) for r in RATIOS])
    LIMITERS[name] = limiter(phi, values, data)
    others = [entry for entry in entries() if not entry.startswith(f"{name}=")]
    os.environ[LIMITERS_VARIABLE] = SEPARATOR.join([*others, f"{name}={data}"])


def entries() -> list[str]:
    """Limiters of the environment variable FVSOLVE_LIMITERS, as NAME=FILE.py:FUNCTION or NAME=DATA."""
    return [
        entry for entry in os.environ.get(LIMITERS_VARIABLE, "").split(SEPARATOR) if entry.strip()
    ]


def read_entry(entry: str) -> None:
    """Register the limiter of an entry of FVSOLVE_LIMITERS. Raises an exception if it cannot be read."""
    name, _, source = entry.strip().partition("=")
    file, colon, function = source.rpartition(":")
    if not colon:
        return add(name, source)
    spec = spec_from_file_location(f"fvsolve_limiter_{name}", file)
    spec.loader.exec_module(module := module_from_spec(spec))
    return register_limiter(name, getattr(module, function))


def value_at(phi: Callable, name: str, r: float) -> float:
    """phi(r). Raises FvsolveError if phi fails, or if phi(r) is not a finite number."""
    try:
        value = phi(r)
    except Exception as error:
        raise FvsolveError(
            f"register_limiter: {name}({r:g}) fails: {error}; expected a number; a limiter may use numbers, math, "
            "numpy, and functions of these"
        ) from error
    if (
        not isinstance(value, Real)
        or isinstance(value, (bool, np.bool_))
        or not math.isfinite(value)
    ):
        raise FvsolveError(
            f"register_limiter: {name}({r:g}) is {value!r}; expected a finite number for every r from "
            f"-1e{LARGEST} to 1e{LARGEST}"
        )
    return float(value)


def limiter(phi: Callable, values: np.ndarray, data: str) -> Limiter:
    """Properties of a limiter; values : phi at `RATIOS`; data : function as text."""
    high = values[RATIOS > 0.0]
    steepest = float(max(1.0, high.max(), (high / POSITIVE).max()))
    slopes = dict.fromkeys(tangent(phi, r, side) for r, side in TANGENTS)
    digest = hashlib.sha256(data.encode()).hexdigest()[:16]
    costs, value = [], phi(1.0)
    if not abs(value - 1.0) <= ROUNDING:
        costs.append(f"phi(1) = {value:.3g} is not 1, so the order is 1 in smooth flow")
    lost = asymmetry(phi)
    costs += lost
    own = OwnLimiter(
        phi, not lost, digest, tuple(departures(values)), tuple(costs), Fraction(steepest)
    )
    return Limiter(tuple(slopes), min(steepest, 2.0), own)


def tangent(phi: Callable, r: float, side: int) -> tuple[Fraction, Fraction]:
    """(a, b) of the tangent a d + b e of the slope phi(r) e, r = d / e, from a difference on one side of r."""
    near = r * (1.0 + side * STEP)
    rise = (phi(near) - phi(r)) / (near - r)
    a, b = (Fraction(float(x)).limit_denominator(100) for x in (rise, phi(r) - r * rise))
    return a, b


def departures(values: np.ndarray) -> Iterator[str]:
    """Yield where phi leaves the region of Sweby (1984), 0 <= phi <= min(2, 2 r), and 0 for r < 0.

    values : phi at `RATIOS`
    """
    upper = np.minimum(2.0, 2.0 * np.maximum(RATIOS, 0.0))
    for outside, bound in (
        (values > upper + ROUNDING * (1.0 + upper), "above"),
        (values < -ROUNDING, "below"),
    ):
        if outside.any():
            at = int(
                np.argmax(
                    np.where(outside, np.abs(values - (upper if bound == "above" else 0.0)), -1.0)
                )
            )
            span = RATIOS[outside]
            limit = upper[at] if bound == "above" else 0.0
            yield (
                f"phi is {bound} it from r = {span[0]:.3g} to {span[-1]:.3g}; phi({RATIOS[at]:.3g}) = "
                f"{values[at]:.3g}, bound {limit:.3g}"
            )


def asymmetry(phi: Callable) -> list[str]:
    """Text about a limiter without the symmetry phi(r) / r = phi(1 / r); an empty list if it is symmetric."""
    ratios = [r for r in RATIOS if 1e-3 <= abs(r) <= 1.0]
    apart = [abs(phi(r) / r - phi(1.0 / r)) for r in ratios]
    worst = int(np.argmax(apart))
    if apart[worst] <= ROUNDING:
        return []
    r = ratios[worst]
    return [
        f"phi(r) / r = {phi(r) / r:.3g} is not phi(1 / r) = {phi(1.0 / r):.3g} at r = {r:.3g}, so a wave that runs "
        "backward along a grid line has another slope"
    ]


def packed(function: Callable, name: str) -> str:
    """Function with all that it uses, as text, for other processes and as the key of its compiled code."""
    if not isinstance(function, FunctionType):
        raise FvsolveError(
            f"register_limiter: {name} is a {type(function).__name__}; expected a Python function"
        )
    return base64.urlsafe_b64encode(marshal.dumps(_content(function, ()), 2)).decode()


def unpacked(data: str, name: str) -> FunctionType:
    """Function of the text that `packed` returns; name : its new name."""
    return _function(marshal.loads(base64.urlsafe_b64decode(data)), name)


def _content(function: FunctionType, within: tuple) -> tuple:
    code = function.__code__.replace(co_filename="limiter", co_firstlineno=1)
    cells = {
        n: cell.cell_contents
        for n, cell in zip(code.co_freevars, function.__closure__ or (), strict=True)
    }
    used = {
        n: cells.get(n, function.__globals__.get(n))
        for n in sorted({*code.co_names, *code.co_freevars})
    }
    values = {n: _plain(value, (*within, function)) for n, value in used.items()}
    return (
        code,
        tuple(item for item in values.items() if item[1] is not None),
        function.__defaults__,
    )


def _plain(value, within: tuple) -> tuple | None:
    """Value of a global name in a form that `marshal` writes; None for one that a limiter cannot use."""
    value = getattr(value, "py_func", value)
    if isinstance(value, (bool, int, float, np.floating, np.integer)):
        return "number", value.item() if isinstance(value, np.generic) else value
    if isinstance(value, ModuleType):
        return ("module", value.__name__) if value.__name__ in MODULES else None
    if isinstance(value, FunctionType) and value not in within:
        return "function", _content(value, within)
    name = getattr(value, "__name__", "")
    home = next(
        (
            label
            for label, module in MODULES.items()
            if name and getattr(module, name, None) is value
        ),
        None,
    )
    return home and ("member", home, name)


def _function(content: tuple, name: str) -> FunctionType:
    code, values, defaults = content
    found = {"__builtins__": builtins, "__name__": "fvsolve_limiters"}
    for label, (kind, *value) in values:
        if kind == "number":
            found[label] = value[0]
        elif kind == "function":
            found[label] = _function(value[0], label)
        else:
            found[label] = (
                MODULES[value[0]] if kind == "module" else getattr(MODULES[value[0]], value[1])
            )
    cells = tuple(CellType(found[label]) for label in code.co_freevars if label in found)
    return FunctionType(code, found, name, defaults, cells or None)
