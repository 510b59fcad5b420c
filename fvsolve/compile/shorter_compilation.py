"""Changes to numba that shorten compilation: less machine code, no repeated optimisation, quicker Python.

Large functions are optimised by themselves. Nothing else changes the instructions that a function is compiled to.
Without these changes all functions compile as well, in more time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

LARGE = 800  # instructions; LLVM inlines functions of less than about 50


def shorten_compilation() -> None:
    """Apply all changes, at the first import of numba."""
    from llvmlite.binding import ffi

    generate_code_on_request()
    compare_flags_quickly()
    list_variables_quickly()
    remember_operators()
    ffi.lib._lock._cblist.clear()  # events that only time the lock of LLVM, at each of its calls


def generate_code_on_request() -> None:
    """Let numba generate the machine code of a function when its address is requested, and optimise it once.

    Numba generates it for every function. A function that only compiled code calls does not need it, because its
    optimised intermediate code is linked into its callers. This saves a fifth of the compile time. Numba also optimises
    what is linked again, with each of the callers. Large functions, which LLVM does not inline, are linked into the
    machine code alone, which saves another sixth for basins.
    """
    from numba.core.registry import cpu_target

    codegen, environments = cpu_target.target_context.codegen(), {}
    set_environment_now = codegen.set_env

    def set_environment(name: str, environment: Any) -> None:
        environments[name] = environment
        if codegen._engine.get_global_value_address(name):
            set_environment_now(name, environment)

    codegen.set_env, codegen._library_class = (
        set_environment,
        library_class(environments, set_environment),
    )


def library_class(environments: dict[str, Any], set_environment: Callable) -> type:
    """Code library of numba that generates machine code on request and links large functions into it alone."""
    from llvmlite.binding import parse_bitcode
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler_lock import global_compiler_lock

    class CodeLibrary(LargeFunctions, JITCodeLibrary):
        generated = False

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            if not self.large:
                self._verify_declare_only_symbols()
            self._finalized = True
            # from a cache file
            if self._object_caching_enabled and self._compiled_object is not None:
                self.generate()

        @global_compiler_lock
        def generate(self) -> None:
            """Generate and load the machine code of the functions of this library."""
            if self.generated:
                return
            self.generated, self._dynamic_globals = True, []
            self.link_large()
            super()._finalize_final_module()
            for variable in self._final_module.global_variables:
                if variable.name in environments:
                    set_environment(variable.name, environments[variable.name])

        def get_pointer_to_function(self, name: str) -> int:
            self._ensure_finalized()
            if not self.generated and name in {
                function.name for function in self.get_defined_functions()
            }:
                self.generate()
            return super().get_pointer_to_function(name) if self.generated else 0

        @classmethod
        def _unserialize(cls, codegen: Any, state: tuple) -> Any:
            name, kind, data = state
            if kind == "object":
                return super()._unserialize(codegen, state)
            library = codegen.create_library(name)
            library.enable_object_caching()
            library._final_module = parse_bitcode(data[0])
            library.large = {name: parse_bitcode(code) for name, code in data[1].items()}
            library._finalize_final_module()
            return library

        def serialize_using_object_code(self) -> tuple:  # for cache files
            if self.generated:
                return super().serialize_using_object_code()
            self._ensure_finalized()
            large = {name: module.as_bitcode() for name, module in self.large.items()}
            return self.name, "bitcode", (self._final_module.as_bitcode(), large)

    return CodeLibrary


class LargeFunctions:
    """Part of a code library of numba: large functions are left out while it is optimised.

    large : modules of the large functions that are called, by name, callers last
    """

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.large: dict[str, Any] = {}

    def finalize(self: Any) -> None:
        for library in self._linking_libraries:
            # a library from before this change has none
            self.large |= getattr(library, "large", {})
        linked = []
        for library in dict.fromkeys(self._linking_libraries):
            names = exported_names(library)
            if names and all(is_large(library._final_module.get_function(name)) for name in names):
                self.large[names[0]] = library._get_module_for_linking()
                self._reload_init.update(library._reload_init)
            else:
                linked.append(library)
        self._linking_libraries = linked
        super().finalize()

    def link_large(self: Any) -> None:
        """Link the large functions, before the machine code is generated."""
        if self.large:
            self._get_module_for_linking()  # kept for later callers, without the large functions
            # callers first: LLVM links what is already used
            for module in reversed(self.large.values()):
                self._final_module.link_in(module, preserve=True)


def exported_names(library: Any) -> list[str]:
    """Names of the functions of a code library of numba that others call."""
    library._ensure_finalized()
    functions = library._final_module.functions
    return [
        each.name
        for each in functions
        if each.linkage.name == "external" and not each.is_declaration
    ]


def is_large(function: Any) -> bool:
    """True if LLVM does not inline a function."""
    instructions = (line for block in function.blocks for line in block.instructions)
    return any(k >= LARGE for k, _ in enumerate(instructions)) and b"alwaysinline" not in [
        *function.attributes
    ]


def compare_flags_quickly() -> None:
    """Let numba compare its compiler flags by the options that are set, which saves a tenth of the compile time.

    Numba compares them at each look-up of a function, by a list of all options of both.
    """
    from numba.core.targetconfig import TargetConfig

    in_full = TargetConfig.__eq__

    def equal(flags: TargetConfig, others: Any) -> bool:
        if type(flags) is not type(others):
            return in_full(flags, others)
        own, other = flags._values, others._values
        if own == other:
            return True
        defaults = {name: flags.options[name].default for name in own.keys() | other.keys()}
        return defaults | own == defaults | other

    TargetConfig.__eq__, TargetConfig.__hash__ = equal, lambda flags: hash(type(flags))


def list_variables_quickly() -> None:
    """Let numba find the variables of a statement by the types of its members, which it does ten times a statement."""
    from numba.core.ir import Inst, Var

    kinds: dict[type, int] = {}

    def kind_of(member: Any) -> int:
        kind = type(member)
        if kind not in kinds:
            found = [issubclass(kind, known) for known in (Var, Inst, (list, tuple), dict)]
            kinds[kind] = found.index(True) + 1 if any(found) else 0
        return kinds[kind]

    def variables(statement: Inst, member: Any) -> list:
        kind = kinds[type(member)] if type(member) in kinds else kind_of(member)
        if kind == 1:
            return [member]
        if kind == 2:
            return member.list_vars()
        found: list = []
        if kind:
            for part in member if kind == 3 else member.values():
                found.extend(variables(statement, part))
        return found

    Inst._rec_list_vars = variables


def remember_operators() -> None:
    """Let numba remember the signature of each operator for numbers and arrays, a tenth of the compile time.

    Numba resolves each operation some ten times, and tries all versions of the operator each time.
    """
    from numba import types
    from numba.core.types.functions import BaseFunction, Function

    resolve = BaseFunction.get_call_type

    def is_plain(kind: types.Type) -> bool:
        if isinstance(kind, types.BaseTuple):
            return all(map(is_plain, kind))
        return isinstance(types.unliteral(kind), (types.Number, types.Boolean, types.Array))

    def call_type(function: BaseFunction, context: Any, args: tuple, kws: dict) -> Any:
        if type(function) is not Function or kws or function.typing_key.__module__ != "_operator":
            return resolve(function, context, args, kws)
        known = function.__dict__.setdefault("known_signatures", {})
        key = context, tuple(args)
        if key not in known:
            found = resolve(function, context, args, kws)
            if not all(map(is_plain, args)):
                return found
            known[key] = found
        return known[key]

    BaseFunction.get_call_type = call_type
