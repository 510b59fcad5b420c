"""The right-hand side of scenes without a pipe, so that nothing of the pipes' room is compiled. Knows the tables."""

from fvsolve.jit import njit
from fvsolve.kernels.calls import BRAKE, MOVE, run
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.network import clear_net, net_flows, quickest_node, stored_rates
from fvsolve.kernels.nodes import close_nodes
from fvsolve.kernels.records import OK, RATE, STATUS, WHERE
from fvsolve.kernels.restrictions import open_scheduled


@njit
def rhs_lumped_linear(t, y, dydt, out, handle):
    """`rhs_linear` of a scene without pipes."""
    tables = open_tables(handle)
    out[STATUS], out[WHERE] = OK, -1.0
    open_scheduled(t, out, tables)
    clear_net(out, tables)
    close_nodes(t, y, dydt, out, handle)
    net_flows(out, tables)
    stored_rates(y, dydt, out, tables)
    out[RATE] = quickest_node(out, tables)
    run(BRAKE, t, y, dydt, out, handle)
    if dydt.size > 0:
        run(MOVE, t, y, dydt, out, handle)


@njit
def rhs_alone(t, y, dydt, out, handle):
    """Of a scene of basins that no link joins: nothing flows between nodes."""
    tables = open_tables(handle)
    clear_net(out, tables)
    out[STATUS], out[WHERE], out[RATE] = OK, -1.0, tables.settings[0]["rate"]
