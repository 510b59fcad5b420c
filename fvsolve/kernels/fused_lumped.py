"""Several network functions in a single call, for models of few states in which each call costs noticeable time."""

from fvsolve.jit import njit
from fvsolve.kernels.linear_nodes import junction_flows, stored_pressures
from fvsolve.kernels.network_balance import clear_outputs
from fvsolve.kernels.restrictions import open_scheduled
from fvsolve.kernels.table_handle import open_tables


@njit
def begin_lumped(t, y, dydt, out, handle):
    """Do the work of `begin_network` and `known_pressures_linear` in a single call, for models without pipes.

    It clears outputs, writes conductances of restrictions and known pressures, and adds given flows into junctions.
    """
    tables = open_tables(handle)
    clear_outputs(out, tables)
    open_scheduled(t, out, tables)
    stored_pressures(t, y, out, tables)
    junction_flows(t, out, tables)
