"""Scenes without a pipe under the density laws log and table. Knows the tables."""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic import column_rates_barotropic
from fvsolve.kernels.barotropic_nodes import (
    close_nodes_barotropic,
    hold_columns_barotropic,
    stored_pressures_barotropic,
)
from fvsolve.kernels.columns import column_inflows
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.network import clear_net, greatest_rate, net_flows, stored_rates
from fvsolve.kernels.records import OK, RATE, STATUS, WHERE
from fvsolve.kernels.restrictions import open_scheduled


@njit
def rhs_lumped_barotropic(t, y, dydt, out, handle):
    """`rhs_barotropic` of a scene without pipes."""
    tables = open_tables(handle)
    out[STATUS], out[WHERE] = OK, -1.0
    open_scheduled(t, out, tables)
    clear_net(out, tables)
    stored_pressures_barotropic(t, y, out, tables)
    column_inflows(t, y, out, tables)
    close_nodes_barotropic(t, y, out, tables)
    hold_columns_barotropic(t, out, tables)
    net_flows(out, tables)
    stored_rates(y, dydt, out, tables)
    out[RATE] = greatest_rate(t, out, tables)
    if dydt.size > 0:
        column_rates_barotropic(t, dydt, out, tables)
