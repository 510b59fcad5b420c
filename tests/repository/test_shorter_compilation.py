"""What is changed in numba to compile in less time gives what numba itself gives."""

import operator
from itertools import product

import numba
import numpy as np
import pytest
from numba.core.compiler import Flags, run_frontend
from numba.core.ir import Inst, Var
from numba.core.registry import cpu_target
from numba.core.targetconfig import TargetConfig
from reference.small_package import python

from fvsolve.compile.numba_internals import numba_module
from fvsolve.core.kernels import network_balance, schedule_pieces
from fvsolve.core.steppers import erk

CHAIN = """
from fvsolve.compile import shorter_compilation
from fvsolve.compile.numba_internals import numba_module
numba_module()
shorter_compilation.LARGE = {large}
from fvsolve.core.kernels.chain import above, both, top
import numpy as np
values, counts = np.array([1.0, 2.0, 4.0]), np.array([1, 2])
found = above(values, 3), both(values), top(values, counts)
try:
    top(-values, counts)
    fault = "none"
except ValueError as error:
    fault = str(error)
print(*found, fault)
if {compiled}:
    print(sum(sum(one.numba.stats.cache_misses.values()) for one in (above, both, top)))
    library = [*top.numba.overloads.values()][0].library
    print(len(library.large), *(name for name in ("above", "below", "both") if name in str(library.large.keys())))
"""
FUNCTIONS = """from fvsolve.jit import njit

@njit
def below(values):
    total = 0.0
    for one in values:
        if one < 0.0:
            raise ValueError("negative")
        total += one * one
    return total

@njit
def above(values, k):
    total = below(values)
    for _ in range(k):
        total += below(values) / 2.0
    return total

@njit
def both(values):
    return above(values, 1) - below(values)

@njit
def top(values, counts):
    return both(values) + below(values) + above(values, 2) + below(counts)
"""


@pytest.mark.parametrize("large", [0, 10**9])
def test_functions_that_are_optimised_alone_give_the_same(package, large):  # noqa: F811
    """Also where one calls another directly and through a third, for two types, from the cache and from the store."""
    (package / "core" / "kernels" / "chain.py").write_text(FUNCTIONS)
    total = 1.0 + 4.0 + 16.0
    wanted = [
        str(2.5 * total),
        str(0.5 * total),
        str(0.5 * total + total + 2.0 * total + 5.0),
        "negative",
    ]
    code = CHAIN.format(large=large, compiled=True)
    first, second = [python(package, code, FVSOLVE_STORE="0") for _ in range(2)]
    assert first[:5] == [*wanted, "3"] and second[:5] == [*wanted, "0"]
    assert first[5] == "0" if large else {"above", "below", "both"} <= {*first[6:]}
    for _ in range(2):  # the first process fills the store
        assert python(package, CHAIN.format(large=large, compiled=False)) == wanted


def test_functions_that_were_compiled_before_are_called(package):  # noqa: F811
    code = """
import numba
first = numba.njit(lambda x: x + 1.0)
first(1.0)
from fvsolve.jit import njit
print(njit(lambda x: 2.0 * first(x))(1.0))
"""
    assert python(package, code) == ["4.0"]


def test_variables_of_statements_are_those_that_numba_lists():
    def listed(member) -> list:
        if isinstance(member, Var):
            return [member]
        if isinstance(member, Inst):
            return member.list_vars()
        members = (
            member.values()
            if isinstance(member, dict)
            else member
            if isinstance(member, list | tuple)
            else ()
        )
        return [one for each in members for one in listed(each)]

    numba_module()
    statements = 0
    for function in (network_balance.valve_rate_limit, schedule_pieces.piece_value, erk.attempt):
        for block in run_frontend(function.py_func).blocks.values():
            for one in block.body:
                statements += 1
                assert one.list_vars() == listed(one.__dict__)
                value = getattr(one, "value", None)
                if isinstance(value, Inst) and hasattr(value, "_kws"):
                    assert value.list_vars() == listed(value._kws)
    assert statements > 300


def test_flags_are_equal_where_all_options_are():
    numba_module()
    sets = [
        {},
        {"nrt": True},
        {"nrt": False},
        {"fastmath": True},
        {"nrt": True, "fastmath": True},
        {"no_cpython_wrapper": False},
        {"error_model": "numpy"},
    ]
    all_flags = []
    for options in sets:
        all_flags.append(Flags())
        for name, value in options.items():
            setattr(all_flags[-1], name, value)
    found = [(one == other) for one, other in product(all_flags, all_flags)]
    assert found == [one.values() == other.values() for one, other in product(all_flags, all_flags)]
    assert len(sets) < sum(found) < len(found)
    assert all(
        hash(one) == hash(other) for one, other in product(all_flags, all_flags) if one == other
    )
    assert Flags() != TargetConfig() and Flags() != 1


def test_a_remembered_operator_has_the_signature_that_numba_resolves():
    numba_module()
    context, types = cpu_target.typing_context, numba.types
    context.refresh()
    kinds = [
        types.int64,
        types.int32,
        types.uint8,
        types.float64,
        types.complex128,
        types.boolean,
        types.literal(2),
        types.float64[::1],
        types.int64[:, ::1],
    ]
    resolved = 0
    for name, one, other in product(
        ("add", "truediv", "lt", "pow", "getitem", "and_", "sub"), kinds, kinds
    ):
        function = context.resolve_value_type(getattr(operator, name))
        fresh = types.Function(function.templates)
        try:
            wanted = fresh.get_call_type(context, (one, other), {})
        except numba.core.errors.TypingError:
            with pytest.raises(numba.core.errors.TypingError):
                function.get_call_type(context, (one, other), {})
            continue
        resolved += 1
        for _ in range(2):
            assert function.get_call_type(context, (one, other), {}) == wanted
        assert function.get_impl_key(wanted) == fresh.get_impl_key(wanted)
    assert resolved > 200
    assert np.all(numba.njit(lambda x, y: x / y)(np.arange(1, 4), 2) == [0.5, 1.0, 1.5])
