"""Checks of parts of other packages, of their conversions and laws: some faults would give wrong numbers."""

import ast
import difflib
import inspect
import math
import sys
import textwrap
from collections.abc import Iterator, Mapping
from types import ModuleType
from typing import Any

import numpy as np

from fvsolve.core.kernels.calls import HOOKS, hook_of
from fvsolve.declarations import GROUPS, OUTSIDE_FOLDERS, entry_points
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.jit import COMPILING
from fvsolve.units import DIMENSIONS

# module of the methods that a conversion inherits if it has none of its own
INHERITED = "fvsolve.core.assembly.lowering"
# least likeness of a name to that of a method of fvsolve for which it counts as misspelt: a missing letter, not a word
NEAR = 0.85


def checked(part: type, lowering: Any) -> Any:
    """Conversion of a class of parts, with the quantities of the part if it states none.

    Raises FvsolveError for a fault of the conversion or of its law.
    """
    own = own_quantities(part)
    if lowering.is_device and not lowering.quantities and hasattr(lowering.law, "value"):
        lowering = lowering.varied(quantities=own)
    faults = [*faults_of_kind(part, lowering), *faults_of_methods(type(lowering))]
    if not faults:
        inherits = type(lowering).of.__module__ == INHERITED
        if lowering.is_device and lowering.law is None and inherits:
            faults.append(f"{place_of(type(lowering))}: a device has no law; expected `law = law`")
        faults += _faults_of_quantities(part, lowering, own)
        faults += faults_of_law(lowering.law)
    if faults:
        raise FvsolveError(f"{source_of_part(part)}: {'; '.join(faults)}")
    return lowering


def check_methods(part: type) -> None:
    """Raise FvsolveError for a method of a class of parts or blocks with other arguments than fvsolve gives it."""
    if faults := [*faults_of_methods(part)]:
        raise FvsolveError(f"{source_of_part(part)}: {'; '.join(faults)}")


def faults_of_methods(own: type) -> Iterator[str]:
    """Yield a fault for each method of a class of another package that fvsolve would not call, or not with success.

    Its name is nearly that of a method of fvsolve, or it has other arguments than this method.
    """
    inner = [base for base in own.__mro__ if base.__module__.startswith("fvsolve.")]
    methods = {
        name: found
        for base in reversed(inner)
        for name, found in vars(base).items()
        if not name.startswith("_") and inspect.isfunction(found)
    }
    attributes = {name for base in inner for name in vars(base)}
    for cls in own.__mro__:
        if cls in inner or source_of(cls.__module__) == "":
            continue
        for name, found in vars(cls).items():
            if name.startswith("_") or not inspect.isfunction(found):
                continue
            near = difflib.get_close_matches(name, methods, 1, NEAR)
            if name not in attributes and near:
                text = f'fvsolve calls no method "{name}"; did you mean "{near[0]}"?'
                yield f"{place_of(found)}: {text}"
            expected = inspect.signature(methods[name]) if name in methods else None
            if expected and not _accepts(found, expected):
                given = f"{name}{inspect.signature(found)}"
                yield f"{place_of(found)}: {given}; expected {name}{_bare(expected)}"


def _accepts(method: Any, expected: inspect.Signature) -> bool:
    """True if a method can be called with as many positional arguments as one with the signature `expected`."""
    count = len(expected.parameters)
    if any(item.kind is item.KEYWORD_ONLY for item in expected.parameters.values()):
        return True
    try:
        inspect.signature(method).bind(*range(count))
    except TypeError:
        return False
    return True


def _bare(signature: inspect.Signature) -> str:
    """Text of the names of the arguments of a signature."""
    return f"({', '.join(signature.parameters)})"


def own_quantities(part: Any) -> tuple[str, ...]:
    """Names of the quantities of a class of parts that its base class, such as a two-port, does not have."""
    base = next(parent for parent in part.__mro__ if not getattr(parent, "kind", ""))
    known = getattr(base, "quantities", {})
    return tuple(name for name in getattr(part, "quantities", {}) if name not in known)


def check_dimensions(part: Any) -> None:
    """Raise FvsolveError if a quantity of a class of parts has an unknown dimension."""
    for name, dimension in {
        **getattr(part, "quantities", {}),
        **getattr(part, "along", {}),
    }.items():
        if dimension not in DIMENSIONS:
            expected = f"; expected one of {', '.join(DIMENSIONS)}"
            raise FvsolveError(
                f'{part.__module__}.{part.__name__}: the quantity "{name}" has the unknown dimension '
                f'"{dimension}"{did_you_mean(str(dimension), DIMENSIONS) or expected}'
            )


def faults_of_kind(part: Any, lowering: Any) -> Iterator[str]:
    """Yield a fault if the module `lower` beside a part declares no conversion of its kind."""
    module = f"{part.__module__.rpartition('.')[0]}.lower"
    kinds = type(lowering).kinds
    if part.kind in kinds:
        return
    others = [kind for kind, rows in kinds.items() if type(rows).__module__ == module]
    found = f"declares rows of the kind {_quoted(others)}" if others else "declares no rows"
    yield (
        f"{sys.modules[module].__file__} {found}; expected a class with "
        f'kind="{part.kind}", as the class {part.__name__} has it in part.py'
    )


def _faults_of_quantities(part: Any, lowering: Any, own: tuple[str, ...]) -> Iterator[str]:
    """Yield a fault for each quantity of a part that its law does not compute, and for each other of its conversion."""
    if type(lowering).probe.__module__ != INHERITED:
        return
    place = place_of(type(lowering))
    known = {**part.quantities, **getattr(part, "along", {})}
    computed = getattr(lowering, "quantities", ())
    if computed and not hasattr(lowering.law, "value"):
        yield f'{place}: the law has no function "value", which gives the quantities {_quoted(computed)}'
    for name in computed:
        if name not in known:
            hint = did_you_mean(name, known) or f"; expected one of {_quoted(known)}"
            yield f'{place}: unknown quantity "{name}", which part.py does not declare{hint}'
    for name in own:
        if name not in computed:
            yield (
                f'{place}: the quantity "{name}" of part.py has no value; expected a class derived from '
                f'Device, a function "value" of its law, and "{name}" in `quantities` if lower.py states them'
            )


def faults_of_law(law: ModuleType | None, hooks: Mapping[str, Any] = HOOKS) -> Iterator[str]:
    """Yield a fault for each unknown public function of the law of another package, and for each that is not compiled.

    Under another name a function would never be called, and a state would keep its value; without a result it would
    give 0. hooks : functions of such a law -> types of their arguments, type of their result, empty for none
    """
    if law is None or law.__name__.startswith("fvsolve."):
        return
    for name, found in vars(law).items():
        own = callable(found) and getattr(found, "__module__", "") == law.__name__
        if own and not (name.startswith("_") or name in hooks or isinstance(found, type)):
            yield (
                f'{place_of(found)}: unknown function "{name}" of a law; expected one of {", ".join(hooks)}, '
                f'or a name that begins with "_"{did_you_mean(name, hooks)}'
            )
    for name in hooks:
        found = getattr(law, name, None)
        if callable(found) and COMPILING and not hasattr(found, "address"):
            decorator = "numba.njit" if hasattr(found, "py_func") else "no decorator"
            yield (
                f'{place_of(found)}: the function "{name}" has {decorator}; '
                "expected the decorator `njit` of `fvsolve.jit`"
            )
        elif callable(found) and hooks[name][1] and not _has_result(found):
            yield f'{place_of(found)}: the function "{name}" returns nothing; expected its result'


def _has_result(found: Any) -> bool:
    """True if a function has a statement that returns something, or if its source is unknown."""
    found = inspect.unwrap(getattr(found, "py_func", found))
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(found)))
    except (OSError, TypeError, SyntaxError):
        return True
    returned = [node.value for node in ast.walk(tree) if isinstance(node, ast.Return)]
    return any(
        value is not None and not (isinstance(value, ast.Constant) and value.value is None)
        for value in returned
    )


def check_states(name: str, part: Any, device: Any, states: tuple[str, ...], scales) -> None:
    """Raise FvsolveError unless each state of a device has a scale above 0, and a function for its rate."""
    moves = hook_of(device.law, "move") is not None
    outside = device.law is not None and not device.law.__name__.startswith("fvsolve.")
    valid = len(scales) == len(states) and all(
        isinstance(scale, (int, float, np.number)) and 0.0 < scale < math.inf for scale in scales
    )
    if outside and (faults := [*faults_of_law(device.law)]):
        raise FvsolveError(f"{source_of_part(type(part))}: {'; '.join(faults)}")
    if not valid or (states and outside and not moves):
        raise FvsolveError(fault_of_states(name, part, device, states, scales))


def fault_of_states(name: str, part: Any, device: Any, states: tuple[str, ...], scales: Any) -> str:
    """Text about states of a device without a rate, or without a scale above 0 for each of them."""
    head = f"{source_of_part(type(part))}, in {name}: {place_of(type(device))}"
    if len(scales) != len(states):
        given = (
            f"`scales` gives {len(scales)} numbers for the states {_quoted(states) or 'of none'}"
        )
        return f"{head}: {given}; expected a number above 0 for each state, its small deviation in its own unit"
    for state, scale in zip(states, scales, strict=True):
        if not (isinstance(scale, (int, float, np.number)) and 0.0 < scale < math.inf):
            return (
                f'{head}: `scales` gives {scale!r} for the state "{state}"; expected a number above 0, '
                "a small deviation of the state in its own unit"
            )
    return (
        f'{head}: it has the states {_quoted(states)}, but its law {law_file(device.law)} has no function "move", '
        "which writes their rates"
    )


def law_file(law: ModuleType | None) -> str:
    """File of a law."""
    return str(getattr(law, "__file__", None) or law)


def place_of(found: Any) -> str:
    """File and line of a class or function."""
    found = inspect.unwrap(getattr(found, "py_func", found))
    try:
        lines, first = inspect.getsourcelines(found)
        heads = [k for k, line in enumerate(lines) if line.startswith(("class ", "def "))]
        return f"{inspect.getsourcefile(found)}, line {first + (heads or [0])[0]}"
    except (OSError, TypeError):
        return f"{found.__module__}.{found.__qualname__}"


def source_of_part(part: type) -> str:
    return source_of(part.__module__) or f"the part {part.__module__}"


def _quoted(names: Any) -> str:
    return ", ".join(f'"{name}"' for name in names)


def source_of(module: str) -> str:
    """Package of others that contains a module, for messages: "the part tube of the package outkit".

    module : name of the module. The text is "" for a module of fvsolve, of Python, and of a package without an entry
    point.
    """
    first, _, below = module.partition(".")
    if first == "fvsolve":
        return ""
    if first == OUTSIDE_FOLDERS and below:
        (folder, *_) = sys.modules[f"{first}.{below.partition('.')[0]}"].__path__
        return f"the part in the folder {folder}"
    found = ""
    for entry in entry_points():
        place = entry.place.partition(":")[0].strip()
        if f"{module}.".startswith(f"{place}."):
            return f"the {GROUPS.get(entry.group, 'object')} {entry.name} of the package {entry.package}"
        if place.partition(".")[0] == first:
            found = f"the package {entry.package}"
    return found
