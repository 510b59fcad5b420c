"""Scenes without a pipe under the density laws log and table. Knows the tables."""

from fvsolve.jit import njit
from fvsolve.kernels.barotropic_nodes import (
    close_nodes_barotropic,
    stored_pressures_barotropic,
)
from fvsolve.kernels.calls import BRAKE, HOLD, INFLOWS, MOVE, run
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.network import clear_net, net_flows, quickest_node, stored_rates
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
    run(INFLOWS, t, y, dydt, out, handle)
    close_nodes_barotropic(t, y, out, tables)
    run(HOLD, t, y, dydt, out, handle)
    net_flows(out, tables)
    stored_rates(y, dydt, out, tables)
    out[RATE] = quickest_node(out, tables)
    run(BRAKE, t, y, dydt, out, handle)
    if dydt.size > 0:
        run(MOVE, t, y, dydt, out, handle)
