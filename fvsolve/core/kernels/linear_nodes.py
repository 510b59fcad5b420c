"""Pressures and flows at nodes under the linear density law, from the waves that arrive.

p' is the pressure change of a node since the initial steady state. A pipe end with the outgoing wave w and the
admittance Y = area / speed [kg/s per Pa] brings the flow 2 w - Y p' [kg/s] into its node, in addition to its initial
flow. At a node without storage the flows of pipe ends and other links add up to zero.
"""

from fvsolve.core.kernels.dtypes import ALONE, CHAMBER, CLUSTER, FIXED, JUNCTION, TANK
from fvsolve.core.kernels.network_balance import clear_outputs
from fvsolve.core.kernels.restrictions import (
    conductance,
    flow_at_drop,
    flow_change,
    flow_change_laminar,
    open_scheduled,
    transition_of,
)
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.jit import njit


@njit(forceinline=True)
def stored_pressures(t, y, out, tables):
    """Write the pressure changes since the start [Pa] of fixed nodes, tanks and chambers to `out`."""
    settings = tables.settings[0]
    layout = tables.layout[0]
    nodes = tables.nodes
    # Moving chambers, vessels and patches have no branch: other functions write their pressures.
    for i in range(nodes.size):
        node = nodes[i]
        at = layout["pressure"] + i
        if node["kind"] == FIXED:
            out[at] = schedule_value(tables, node["schedule"], t) - node["pressure"]
        elif node["kind"] == TANK:
            # Levels are subtracted, not pressures: an undisturbed tank has a change of exactly zero.
            level = tank_level(node, tables.floats, settings["rho"], y[node["y"]])
            out[at] = settings["rho"] * settings["gravity"] * (level - node["level"])
        elif node["kind"] == CHAMBER:
            out[at] = node["stiffness"] * y[node["y"]]


@njit(forceinline=True)
def junction_flows(t, out, tables):
    """Add the change since the start of the given flow into each junction to out[net]; write its demand to out[supply].

    The demand is written as a negative supply. out[net] then holds the change of inflow at unchanged pressure of the
    junction [kg/s].
    """
    layout, nodes = tables.layout[0], tables.nodes
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION:
            demand = schedule_value(tables, nodes[i]["schedule"], t)
            out[layout["supply"] + i] = -demand
            # `inflow` already contains the demand of the profile, so only its change is subtracted.
            out[layout["net"] + i] += nodes[i]["inflow"] - (demand - nodes[i]["demand"])


@njit
def known_pressures_linear(t, y, dydt, out, handle):
    """Write pressure changes since the start [Pa] of nodes with storage or given pressure, and demands of junctions.

    The change of given flow into each junction [kg/s] is added to out[net], see `junction_flows`.
    """
    tables = open_tables(handle)
    stored_pressures(t, y, out, tables)
    junction_flows(t, out, tables)


@njit
def begin_lumped(t, y, dydt, out, handle):
    """Do the work of `begin_network` and `known_pressures_linear` at once, for models without pipes.

    It clears outputs, writes conductances of restrictions and known pressures, and adds given flows into junctions.
    """
    tables = open_tables(handle)
    # First, because junctions add their given flows to out[net].
    clear_outputs(out, tables)
    open_scheduled(t, out, tables)
    stored_pressures(t, y, out, tables)
    junction_flows(t, out, tables)


@njit(forceinline=True)
def solve_free_nodes(out, tables):
    """Write the pressure changes of junctions without valves [Pa]: change of inflow over admittance of the pipes."""
    layout, nodes = tables.layout[0], tables.nodes
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION and nodes[i]["solve"] == ALONE:
            out[layout["pressure"] + i] = out[layout["net"] + i] / nodes[i]["admittance"]


@njit(forceinline=True)
def valve_side(out, layout, nodes, i):
    """(pressure change of node i at unchanged valve flow [Pa], its fall per outflow through the valve [Pa s/kg])."""
    # Storage or a schedule determines this pressure, so the flow of the valve does not change it at once.
    if nodes[i]["kind"] != JUNCTION:
        return out[layout["pressure"] + i], 0.0
    return out[layout["net"] + i] / nodes[i]["admittance"], 1.0 / nodes[i]["admittance"]


@njit(forceinline=True)
def solve_single_valves(out, tables):
    """Solve the flow of every valve outside clusters, and the pressures of its end nodes without storage.

    These nodes join no other valve. The root has a closed form, or bounded Newton finds it if the law of the valve has
    a laminar part.
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    for k in range(valves.size):
        valve = valves[k]
        if valve["solve"] == CLUSTER:
            continue
        i, j = valve["from_node"], valve["to_node"]
        pi, zi = valve_side(out, layout, nodes, i)
        pj, zj = valve_side(out, layout, nodes, j)
        g = conductance(tables, out, k)
        if valve["transition"] > 0.0:
            # The law may differ from the flow of the profile, at least by rounding: `base` keeps the steady state.
            base = (
                flow_at_drop(valve["open"], transition_of(valve, valve["open"]), valve["drop"])
                - valve["flow"]
            )
            x = flow_change_laminar(
                g, transition_of(valve, g), zi + zj, valve["flow"], base, valve["drop"] + (pi - pj)
            )
        else:
            # The change of the target is summed from changes, so it is exactly zero in the steady state.
            surplus = (g - valve["open"]) * valve["drop"] + g * (pi - pj)
            x = flow_change(g, zi + zj, valve["flow"], surplus, g * (valve["drop"] + (pi - pj)))
        out[layout["valve"] + k] = valve["flow"] + x
        if nodes[i]["kind"] == JUNCTION:
            out[layout["pressure"] + i] = pi - zi * x
        if nodes[j]["kind"] == JUNCTION:
            out[layout["pressure"] + j] = pj + zj * x


@njit
def solve_nodes_linear(t, y, dydt, out, handle):
    """Solve pressures of junctions and flows of valves, except where several valves join (see `node_clusters`)."""
    tables = open_tables(handle)
    solve_free_nodes(out, tables)
    solve_single_valves(out, tables)
