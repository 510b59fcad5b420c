"""The functions that a density law offers to the stepper, compiled on first use."""

import functools

from fvsolve.jit import beside, njit
from fvsolve.kernels import compose


@functools.cache
def functions(law: str, pipes: bool = True, rooms: tuple[str, ...] = (), kinds: tuple[int, ...] = ()) -> tuple:
    """(rhs, observe, record, events) of a density law, in scenes with or without pipes and with these rooms.

    rooms : of "bodies", "devices", "memory", "cavities", in this order; "cavities" wants pipes
    kinds : codes of the devices that there are
    """
    made = module_of(law, pipes, rooms, kinds)
    watching = "devices" not in rooms  # whose events close the nodes: they wait for the rhs
    code = f"from fvsolve.kernels.functions import watch; watch({law!r}, {pipes}, {rooms!r}); " * watching
    with beside(code + "from fvsolve.steppers.march import compiled; compiled()", "march.march-*.nbi"):
        compile_as(made.rhs, "tvvvh")
    watch(law, pipes, rooms, kinds)
    return made.rhs, made.observe, made.record, made.events


def module_of(law: str, pipes: bool, rooms: tuple[str, ...], kinds: tuple[int, ...]):
    """Where these functions stand, not yet compiled; modules that a scene does not need are not even loaded."""
    family = "cavitating" if "cavities" in rooms else kind_of(law)
    return compose.functions(family, pipes, rooms_of(law, rooms), kinds)


def kind_of(law: str) -> str:
    """The family of a density law."""
    return "linear" if law == "linear" else "barotropic"


def rooms_of(law: str, rooms: tuple[str, ...]) -> tuple[str, ...]:
    """Rooms as `compose` names them: some differ from law to law."""
    named = {room: f"{room}, {kind_of(law)}" for room in rooms}
    return tuple(other if other in compose.ROOMS else room for room, other in named.items())


def watch(law: str, pipes: bool, rooms: tuple[str, ...], kinds: tuple[int, ...] = ()) -> None:
    """Compile what reads a state."""
    made = module_of(law, pipes, rooms, kinds)
    compile_as(made.record, "tvvhv")
    compile_as(made.observe, "tvvhv")
    compile_as(made.events, "tvhv")


@functools.cache
def leap_function(wanted: bool):
    """A whole step of upwind and Euler under the linear law; not wanted, something of its type to pass on."""
    found = stay
    if wanted:
        from fvsolve.kernels.leap import leap_linear as found
    compile_as(found, "ttvvvhv")
    return found


@njit
def stay(t, h, y, y_new, out, handle, values):
    """Never called."""


def compile_as(function, letters: str) -> None:
    """Compile for arguments that are times (t), vectors (v) and a handle (h), and for no others."""
    if not hasattr(function, "compile") or function.overloads:
        return
    from numba import types

    kinds = {"t": types.float64, "v": types.float64[::1], "h": types.int64[::1]}
    function.compile(tuple(kinds[letter] for letter in letters))
    function.disable_compile()
