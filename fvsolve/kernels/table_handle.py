"""Handle of a model: a small array with the memory addresses of its tables.

To pass twenty arrays from function to function costs half a microsecond of copying at each step and seconds of
compilation. A handle costs nothing: compiled code loads a table where it uses it. The owner of a handle must keep its
tables alive, at their addresses and with their sizes.
"""

from ctypes import addressof, c_char

import numpy as np

from fvsolve.jit import COMPILING, Intrinsic
from fvsolve.kernels.dtypes import HandleTables, table_types

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


def make_handle(tables: tuple):
    """Handle of a tuple of tables, in the order of `HandleTables`."""
    return handle_of(addresses_of(tables))


def linked_handles(shared: tuple, replaced: dict[str, tuple], written: tuple, called: tuple):
    """Handle of the tables of a model, the arrays of a run and the addresses of functions.

    The arrays `sharp` and `sensing` of the run each receive another handle, in which some tables of the model are
    replaced: for the time at which a jump of a delay line arrives, and to read sensors in place of probes.
    shared : addresses of the tables of the model; replaced : "sharp" or "sensing" -> addresses with these replacements
    written, called : arrays that the run writes, and tables of function addresses
    """
    own = addresses_of((*written, *called))
    for name, tables in replaced.items():
        within, array = handle_of((*tables, *own)), getattr(written, name)
        if COMPILING:
            array[:] = within
        else:
            array[0] = within
    return handle_of((*shared, *own))
