"""Slope limiters of users in the loops of all kernels, compiled when a case names one.

`by_limiter` compiles each loop with each built-in limiter inside. Loops with the limiter of a user are compiled apart
and called by address, once for a row of cells. The code of such a limiter is the address of the table of these
addresses. Numba caches no function that is passed as an argument. So only whole loops are stored, in a folder named by
the hash of the function.
"""

import re
from collections.abc import Callable
from importlib import import_module
from math import copysign
from types import CellType, FunctionType

import numpy as np

from fvsolve.core.kernels import calls
from fvsolve.jit import COMPILING, Intrinsic, compile_once, njit

# least difference ahead relative to the difference behind: rounding; bounds the ratio r
CLOSEST = 1e-15
LEAST = 1e-300  # least difference ahead, so that equal values have the ratio 0
FIRST_ADDRESS = 4096  # codes from here on are addresses of tables
RECONSTRUCTION = "fvsolve.core.kernels.reconstruction"
# Loops that `by_limiter` calls : module, types of the arguments after the limiter (see `kernels.calls`), of the result.
# A number follows the type of the items of a tuple; F is the function `limited_value` of the module.
LOOPS = {
    "slope": (RECONSTRUCTION, "tt", "t"),
    "muscl_forward": (RECONSTRUCTION, "VV", ""),
    "muscl_backward": (RECONSTRUCTION, "VV", ""),
    "inner_slopes": (RECONSTRUCTION, "VV", ""),
}
# package of a feature; its own loops follow in its tables
FEATURE = re.compile(r"fvsolve\.features\.\w+")
PLAIN: list[Callable] = []  # limiter functions without JIT; code FIRST_ADDRESS + k is entry k
RATIO = None  # of the template: phi(r) of the user


def loops_of(module: str) -> dict[str, tuple[str, str, str]]:
    """Loops in the tables of a module, in their order: LOOPS, then those in `limited_loops.LOOPS` of its feature."""
    home = FEATURE.match(module)
    return LOOPS | import_module(f"{home.group()}.limited_loops").LOOPS if home else LOOPS


def symmetric_limiter(a, b):
    """Limiter of a user with phi(r) / r = phi(1 / r) as (numerator, denominator), for two differences.

    It is phi(r) times the larger difference, r the ratio of the smaller to it, so that it is symmetric to the last bit.
    """
    larger, smaller = (a, b) if abs(a) > abs(b) else (b, a)
    # Two zero differences have no ratio; with any ratio their slope is zero.
    return RATIO(smaller / (larger if larger != 0.0 else 1.0)) * larger, 1.0


def ordered_limiter(a, b):
    """Limiter of a user as (numerator, denominator): phi(r) b with r = a / b, for differences a behind and b ahead."""
    # Bounds the ratio a / b where the difference ahead nearly vanishes.
    least = CLOSEST * abs(a) + LEAST
    base = b if abs(b) > least else copysign(least, a)
    return RATIO(a / base) * base if a != 0.0 or b != 0.0 else 0.0, 1.0


def argument_kinds(letters: str) -> tuple:
    """Numba types of the arguments of a loop after the limiter, without functions."""
    from numba import types

    found = []
    for letter, count in re.findall(r"([a-zA-Z])(\d?)", letters.replace("F", "")):
        (kind,) = calls.argument_types(letter)
        found.append(types.UniTuple(kind, int(count)) if count else kind)
    return tuple(found)


def uncached(function, **constants):
    """Compiled copy of a function, which numba does not cache, with such copies of functions that it calls.

    These are plain functions, and compiled ones whose first argument is a limiter.
    constants : values of global names, as in `jit.specialise`
    """
    plain = getattr(function, "py_func", function)
    seen = plain.__globals__
    inner = {
        name: copied(seen[name]) for name in plain.__code__.co_names if name in seen
    } | constants
    cells = tuple(CellType(copied(cell.cell_contents)) for cell in plain.__closure__ or ())
    copy = njit(
        FunctionType(
            plain.__code__, seen | inner, plain.__name__, plain.__defaults__, cells or None
        )
    )
    # Not stored by itself: the loop that contains this copy is stored as a whole.
    copy.folder = None
    return copy


def copied(value):
    """Result of `uncached` for a function that it copies, else the value itself."""
    limited = hasattr(value, "py_func") and value.__code__.co_varnames[:1] == ("limiter",)
    return uncached(value) if limited or isinstance(value, FunctionType) else value


def loop_address(name: str, module: str, letters: str, limiter, folder: str) -> tuple:
    """(address, function) of a loop compiled with a limiter function; folder : subfolder of its code."""
    home = import_module(module)
    names = ", ".join(f"x{k}" for k in range(len(re.findall("[a-zA-EG-Z]", letters))))
    head = "value, " if letters.startswith("F") else ""
    known = {"loop": uncached(getattr(home, name)), "limiter": limiter}
    known |= {"value": uncached(home.limited_value)} if head else {}
    # A function of its own for each limiter, which numba compiles as a whole, with the limiter inside.
    plain = eval(f"lambda {names}: loop(limiter, {head}{names})", known)
    plain.__name__ = plain.__qualname__ = name
    compiled = calls.law_njit(plain)
    compiled.folder, compiled.numba_caches = folder, False
    return compiled.address(letters, argument_kinds), compiled


@compile_once
def limiter_table(phi: Callable, symmetric: bool, digest: str, user: str) -> tuple:
    """Table of the addresses of loops with the limiter phi(r) : (int64[loops], functions that own the code).

    symmetric : True if phi(r) / r = phi(1 / r); digest : hash of the function; user : module that
    calls the loops, see `loops_of`
    """
    limiter = uncached(symmetric_limiter if symmetric else ordered_limiter, RATIO=uncached(phi))
    loops, owners = loops_of(user), []
    table = np.zeros(len(loops), dtype=np.int64)
    for k, (name, (module, letters, _)) in enumerate(loops.items()):
        table[k], owner = loop_address(name, module, letters, limiter, f"outside/{digest}")
        owners.append(owner)
    return table, owners


def limiter_code(phi: Callable, symmetric: bool, digest: str, user: str) -> int:
    """Code of the limiter of a user, for `by_limiter`; arguments as for `limiter_table`."""
    if COMPILING:
        return limiter_table(phi, symmetric, digest, user)[0].ctypes.data
    template = symmetric_limiter if symmetric else ordered_limiter
    PLAIN.append(FunctionType(template.__code__, globals() | {"RATIO": phi}))
    return FIRST_ADDRESS + len(PLAIN) - 1


if COMPILING:

    @Intrinsic
    def call_own(typingctx, loop, code, given):
        """Call the loop with the limiter of a user; given : its other arguments."""
        from numba import errors

        from fvsolve.compile.code_generation import call_in_table

        function = loop.dispatcher.py_func
        name, loops = function.__name__, loops_of(function.__module__)
        if name not in loops:
            raise errors.TypingError(
                f"{name} has no entry in LOOPS of kernels.own_limiters or of its feature"
            )
        _, letters, returned = loops[name]
        result = calls.argument_types(returned)
        return call_in_table(loop, given, list(loops).index(name), argument_kinds(letters), result)

else:

    def call_own(loop, code, given):
        """Call the loop with the limiter of a user; given : its other arguments."""
        return loop(PLAIN[code - FIRST_ADDRESS], *given)
