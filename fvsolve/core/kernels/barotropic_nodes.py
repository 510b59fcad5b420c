"""Pressures and flows at nodes under the density laws `log` and `table`.

Stagnation enthalpy is conserved from pipe ends to nodes, and flows through valves have the upstream density. A simple
wave leads from the state extrapolated from the cells to the state at the pipe end, where h(p_end) + v^2 / 2 =
h(p_node), with specific enthalpy h and velocity v. A jet into any node except a junction loses its v^2 / 2.
"""

import numpy as np

from fvsolve.core.kernels import density as law
from fvsolve.core.kernels import node_clusters as clusters
from fvsolve.core.kernels.dtypes import CHAMBER, CLUSTER, FIXED, JUNCTION, TANK
from fvsolve.core.kernels.ghost_cells import end_value
from fvsolve.core.kernels.linear_nodes import junction_flows
from fvsolve.core.kernels.pipes import scheme_family
from fvsolve.core.kernels.restrictions import conductance, valve_target
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.jit import njit


@njit
def head_pressure(st, floats, head):
    """Pressure [Pa] under a column of `head` [m] open to ambient: h(p) = h(ambient) + g head, h : specific enthalpy."""
    return law.pressure_of_enthalpy(
        st, floats, law.enthalpy(st, floats, st["ambient"]) + st["gravity"] * head
    )


@njit
def known_pressures_barotropic(t, y, dydt, out, handle):
    """Write the pressure changes since the start [Pa] of fixed nodes, tanks and chambers to `out`.

    For chambers that contain gas, also write their stiffness dp/dm [Pa/kg], the pressure rise per stored mass.
    """
    tables = open_tables(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    nodes = tables.nodes
    floats = tables.floats
    for i in range(nodes.size):
        node = nodes[i]
        at, kind = layout["pressure"] + i, node["kind"]
        if kind == FIXED:
            value = schedule_value(tables, node["schedule"], t)
            p = (
                head_pressure(st, floats, value - node["elevation"])
                if node["head_given"] == 1
                else value
            )
            out[at] = p - node["pressure"]
        elif kind == TANK:
            level = tank_level(node, floats, node["density"], y[node["y"]])
            # Both pressures follow from the same function, so an undisturbed tank has a change of exactly zero.
            out[at] = head_pressure(st, floats, level) - head_pressure(st, floats, node["level"])
        elif kind == CHAMBER:
            mass = node["mass"] + y[node["y"]]
            p = law.pressure_of_log(st, floats, 0.0, np.log(mass / (st["rho"] * node["volume"])))
            # The pressure of the profile by the same function: an undisturbed chamber has a change of exactly zero.
            q0 = np.log(node["mass"] / (st["rho"] * node["volume"]))
            out[at] = p - law.pressure_of_log(st, floats, 0.0, q0)
            if node["row"] >= 0:
                out[layout["stiffness"] + node["row"]] = 1.0 / (
                    law.log_density(st, floats, p)[1] * mass
                )


@njit
def end_flow(st, floats, pipe, m_inside, into_inside, p_node, still):
    """Flow from a pipe end into its node under the density laws `log` and `table`, by Newton.

    Returns the flow into the node [kg/s], its derivative with respect to p_node [kg/s per Pa], and the mass per length
    at the end [kg/m]. A simple wave leads from the extrapolated state to the end: v + integral of dp / (rho c) is
    constant, with velocity v, density rho and wave speed c.

    m_inside, into_inside : mass per length [kg/m] and mass flow towards the node [kg/s], extrapolated from the cells
    p_node : pressure of the node [Pa]
    still : True for any node except a junction, because a jet into such a node loses its v^2 / 2
    """
    p_inside = law.pressure_of_mass(st, floats, pipe, m_inside)
    v_inside = into_inside / m_inside
    target = law.enthalpy(st, floats, p_node)
    p = p_node
    m, dm = law.mass_of_pressure(st, floats, pipe, p)
    v = v_inside - law.velocity_change(st, floats, pipe, p_inside, p)
    slope = v * dm - m / law.impedance(st, floats, pipe, p)
    # The jet loses its v^2 / 2, so the end has the pressure of the node and nothing is iterated.
    if still and v >= 0.0:
        return m * v, slope, m
    rise = 1.0
    for _ in range(30):
        # Derivative of h + v^2 / 2: dh = dp / rho, and dv = -dp / (rho c) along the wave.
        rise = 1.0 / law.density(st, floats, p) - v / law.impedance(st, floats, pipe, p)
        step = (law.enthalpy(st, floats, p) + 0.5 * v * v - target) / rise
        p -= step
        m, dm = law.mass_of_pressure(st, floats, pipe, p)
        v = v_inside - law.velocity_change(st, floats, pipe, p_inside, p)
        if abs(step) <= 1e-15 * abs(p) + 1e-12:
            break
    slope = v * dm - m / law.impedance(st, floats, pipe, p)
    # By the chain rule: h(p_node) changes by dp_node / rho(p_node), h(p) + v^2 / 2 by `rise` dp.
    return m * v, slope / (rise * law.density(st, floats, p_node)), m


@njit(forceinline=True)
def clear_inflows(out, tables, slope):
    """Set out[net] of all nodes and the derivatives `slope` to zero, see `end_inflows_barotropic`."""
    net = tables.layout[0]["net"]
    for i in range(tables.nodes.size):
        out[net + i], slope[i] = 0.0, 0.0


@njit(forceinline=True)
def node_beyond(out, tables, pipe, side):
    """(present pressure [Pa] of the node at an end of a pipe, True unless it is a junction).

    side : 0 for the `from` end, 1 for the `to` end
    """
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    return tables.nodes[i]["pressure"] + out[tables.layout[0]["pressure"] + i], tables.nodes[i][
        "kind"
    ] != JUNCTION


@njit(forceinline=True)
def add_end_inflow(out, tables, slope, k, side, into, rise):
    """Add the change since the start of the flow `into` the node at an end of pipe k to out[net], `rise` to `slope`."""
    pipe = tables.pipes[k]
    i = pipe["to_node"] if side == 1 else pipe["from_node"]
    out[tables.layout[0]["net"] + i] += into - (pipe["to_base"] if side == 1 else pipe["from_base"])
    slope[i] += rise


@njit(forceinline=True)
def write_end_waves(out, tables, k, side, into, m):
    """Write the waves at an end of pipe k [kg/s] to out[ends], from the flow `into` its node and the mass per length m.

    side : 0 for the `from` end, 1 for the `to` end
    """
    pipe, at = tables.pipes[k], tables.layout[0]["ends"] + 4 * k + 2 * side
    # A flow into the node runs along the pipe at its `to` end, against it at its `from` end.
    change = (2.0 * side - 1.0) * (into - (pipe["to_base"] if side == 1 else pipe["from_base"]))
    dm = pipe["speed"] * (m - (pipe["to_mass"] if side == 1 else pipe["from_mass"]))
    out[at] = 0.5 * (dm + change)
    out[at + 1] = 0.5 * (dm - change)


@njit
def end_inflows_barotropic(out, tables, slope, final):
    """Write for every node the change of the flow from its pipes since the start [kg/s] to out[net].

    The flows are those at the present pressures.
    slope : float64[nodes]  receives the derivative of this flow with respect to the pressure of the node [kg/s per Pa]
    On entry out[ends] holds the forward and the backward wave at each pipe end, extrapolated from the cells [kg/s]. If
    `final` is True, they are replaced with the waves of the solved end states.
    """
    layout = tables.layout[0]
    pipes = tables.pipes
    profile = tables.profile
    clear_inflows(out, tables, slope)
    for k in range(pipes.size):
        pipe = pipes[k]
        for side in range(2):
            at, sign = layout["ends"] + 4 * k + 2 * side, 2.0 * side - 1.0
            p, still = node_beyond(out, tables, pipe, side)
            inside = (
                profile[pipe["face"] + pipe["cells"] * side]
                + (out[at] + out[at + 1]) / pipe["speed"]
            )
            flow = sign * (pipe["flow"] + (out[at] - out[at + 1]))
            into, rise, m = end_flow(
                tables.settings[0], tables.floats, pipe, inside, flow, p, still
            )
            add_end_inflow(out, tables, slope, k, side, into, rise)
            if final:
                write_end_waves(out, tables, k, side, into, m)


@njit
def outgoing_waves_barotropic(t, y, dydt, out, handle):
    """Extrapolate forward and backward wave [kg/s] from the cells to both ends of every pipe, into out[ends]."""
    tables = open_tables(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    pipes = tables.pipes
    work = tables.scratch
    for i in range(pipes.size):
        pipe = pipes[i]
        n, o = pipe["cells"], pipe["y"]
        family = scheme_family(st, n)
        for side in range(2):
            for wave in range(2):
                cells = y[o + n * wave : o + n * (wave + 1)]
                value = end_value(
                    cells, side, family, st["degree"], st["limiter"], pipe["noise"], work
                )
                out[layout["ends"] + 4 * i + 2 * side + wave] = value


@njit
def given_flows(t, y, out, tables):
    """Write given flows of junctions (`junction_flows`), and flows of valves between nodes of known pressure, to `out`.

    Pressures of junctions are reset to the initial steady state.
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    junction_flows(t, out, tables)
    # Newton starts from the profile, so that its result depends on (t, y) alone.
    for i in range(nodes.size):
        if nodes[i]["kind"] == JUNCTION:
            out[layout["pressure"] + i] = 0.0
    for k in range(valves.size):
        i, j = valves[k]["from_node"], valves[k]["to_node"]
        if (
            nodes[i]["kind"] != JUNCTION
            and nodes[j]["kind"] != JUNCTION
            and valves[k]["solve"] != CLUSTER
        ):
            g = conductance(tables, out, k)
            out[layout["valve"] + k] = valve_target(tables, out, k, g)[0] if g > 0.0 else 0.0


@njit
def solve_nodes_barotropic(t, y, dydt, out, handle):
    """Solve all nodes under the density laws `log` and `table`: node pressures, valve flows, waves at every pipe end.

    In each Newton sweep, every cluster (`node_clusters.py`) that has not converged makes a step; then all pipe ends are
    evaluated again. An undisturbed cluster is left as it is.
    """
    tables = open_tables(handle)
    space = clusters.node_work(tables)
    given_flows(t, y, out, tables)
    clusters.begin_clusters(out, tables, space)
    for sweep in range(1, clusters.MAX_SWEEPS + 1):
        end_inflows_barotropic(out, tables, space[0], False)
        clusters.step_clusters(sweep, out, tables, space)
        if not clusters.check_clusters(out, tables, space):
            break
    clusters.write_clusters(out, tables, space)
    # Once more at the solved pressures, now with the waves that the cells read.
    end_inflows_barotropic(out, tables, space[0], True)
