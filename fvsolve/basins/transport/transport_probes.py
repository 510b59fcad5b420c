"""Probes of the flow in basins with a given velocity."""

from fvsolve.basins.basin_scalars import flow_factor
from fvsolve.basins.boundary_cells import patch_inflow
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import GIVEN_FLOW
from fvsolve.kernels.table_handle import open_tables


@njit
def observe_given_flows(t, y, out, handle, values):
    """Write the values of probes of the inflow through patches [m3/s], in basins with a given velocity.

    It is 0 at patches without flow.
    """
    tables = open_tables(handle)
    for k in range(tables.probes.size):
        if tables.probes[k]["kind"] == GIVEN_FLOW:
            patch = tables.patches[tables.probes[k]["index"]]
            basin, values[k] = tables.basins[patch["basin"]], 0.0
            if patch["open"] == 1:
                values[k] = flow_factor(t, basin) * basin["thickness"] * patch_inflow(tables, patch)
