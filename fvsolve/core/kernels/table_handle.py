"""Handle of a model: a small array with the memory addresses of its tables.

To pass twenty arrays from function to function costs half a microsecond of copying at each step and seconds of
compilation. A handle costs nothing: compiled code loads a table where it uses it. The owner of a handle must keep its
tables alive, at their addresses and with their sizes.
"""

from ctypes import addressof, c_char, c_double
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels.dtypes import HandleTables, table_types
from fvsolve.jit import COMPILING, Intrinsic

NO_DATA = np.zeros(1)
EMPTY = NO_DATA.ctypes.data  # address of empty arrays

if COMPILING:

    def addresses_of(tables: tuple) -> tuple:
        """Memory address, number of rows and number of columns of each table, one after another in a flat tuple."""
        return tuple(x for a in tables for x in (address_of_table(a), a.shape[0], a.shape[-1]))

    def address_of_table(a: np.ndarray) -> int:
        """Memory address of an array; of a byte that nobody reads for an empty array.

        The attribute `ctypes` of an array takes some microseconds, but other ways refuse read-only arrays.
        """
        if a.size == 0:
            return EMPTY
        return addressof(c_char.from_buffer(a)) if a.flags.writeable else a.ctypes.data

    def handle_of(places: tuple) -> np.ndarray:
        """Handle of the tables at these addresses (results of `addresses_of`): int64[3 n] for n tables."""
        return np.array(places, dtype=np.int64)

    def empty_handle() -> np.ndarray:
        """Empty array for a handle that is itself a table."""
        return np.zeros(3 * len(HandleTables._fields), dtype=np.int64)

    @Intrinsic
    def open_tables(typingctx, handle):
        """Tables behind a handle, without reference counts; an attribute such as `tables.nodes` loads a table."""
        from fvsolve.compile.code_generation import Tables, handle_address

        return Tables("Tables", table_types)(handle), handle_address

    def open_with(name: str, own, slot: int, handle):
        """Signature and code of an intrinsic like `open_tables` that also loads the tables of a feature.

        name : of the kind of tables; own : function that returns the numba types of the tables of the feature
        slot : number of the feature, see `assembly.features`
        """
        from fvsolve.compile.code_generation import Tables, handle_address

        return Tables(name, table_types, own, slot)(handle), handle_address

    @Intrinsic
    def floats_at(typingctx, address, size):
        """View of the memory at an address as an array float64[size], without a copy."""
        from fvsolve.compile.code_generation import floats_at_address

        return floats_at_address()
else:

    def addresses_of(tables: tuple) -> tuple:
        """Tables themselves, as a tuple: without compilation nothing is replaced with addresses."""
        return tuple(tables)

    def handle_of(places: tuple) -> HandleTables:
        """Handle of these tables, with None for tables that are missing."""
        return HandleTables(*places, *[None] * (len(HandleTables._fields) - len(places)))

    def empty_handle() -> np.ndarray:
        """Empty array for a handle that is itself a table."""
        return np.empty(1, dtype=object)

    def open_tables(handle):
        """Tables of a handle, given as `HandleTables` or as an array that contains it."""
        return handle[0] if isinstance(handle, np.ndarray) else handle

    def floats_at(address, size):
        """View of the memory at an address as an array float64[size], without a copy."""
        return np.ctypeslib.as_array((c_double * int(size)).from_address(int(address)))

    class BothTables:
        """Tables of the core and of a feature."""

        def __init__(self, core, own) -> None:
            self.core, self.own = core, own

        def __getattr__(self, name: str):
            return getattr(self.own if name in self.own._fields else self.core, name)


def make_handle(tables: tuple):
    """Handle of a tuple of tables, in the order of `HandleTables`."""
    return handle_of(addresses_of(tables))


class View(NamedTuple):
    """Another handle of the same model, which compiled functions open: some tables of the model are replaced.

    array : array that receives the handle; tables : addresses of the tables of the model with the replacements
    features : tables of each feature by slot, None for none
    """

    array: np.ndarray
    tables: tuple
    features: list


def linked_handles(
    shared: tuple, views: list[View], written: tuple, called: tuple, features: list, kept: list
):
    """Handle of the tables of a model, the arrays of a run, the addresses of functions, and the handles of features.

    shared : addresses of the tables of the model; written, called : arrays that the run writes, addresses of functions
    features : tables of each feature by slot, None for none; kept : receives the arrays behind the handles
    """
    for view in views:
        within = handle_of(
            (*view.tables, *addresses_of((*with_features(written, view.features, kept), *called)))
        )
        # In place, because tables of the model refer to this array.
        view.array[:] = within if COMPILING else boxed(within)
    return handle_of((*shared, *addresses_of((*with_features(written, features, kept), *called))))


def boxed(content) -> np.ndarray:
    """Array that contains an object."""
    box = np.empty(1, dtype=object)
    box[0] = content
    return box


def with_features(written: tuple, features: list, kept: list) -> tuple:
    """Arrays of a run with the addresses of the handles of features; without compilation with their tables themselves.

    features : tables of each feature by slot, None for none; kept : receives the arrays behind the handles
    """
    slots = np.zeros(len(features), dtype=np.int64 if COMPILING else object)
    kept.append(slots)
    for k, tables in enumerate(features):
        if tables is not None and COMPILING:
            handle = handle_of(addresses_of(tables))
            slots[k] = handle.ctypes.data
            # An address keeps no array alive.
            kept += [handle, tables]
        elif tables is not None:
            slots[k] = tables
    return written._replace(features=slots)


def places_in_memory(arrays: list[np.ndarray]) -> np.ndarray:
    """Address and size of each array of float64, one after another : int64[2 n]."""
    return np.array(
        [number for array in arrays for number in (array.ctypes.data, array.size)], dtype=np.int64
    )
