"""Rate of the feedback loop of a valve whose opening follows a pressure."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import JUNCTION
from fvsolve.kernels.network_balance import stiffness_of
from fvsolve.kernels.restrictions import head_drop, restriction_slope


@njit
def node_impedance(tables, i):
    """Pressure rise at junction i per flow into it [Pa s/kg], 1 / admittance of its pipes; 0 for other nodes."""
    node = tables.nodes[i]
    return 1.0 / node["admittance"] if node["kind"] == JUNCTION and node["admittance"] > 0.0 else 0.0


@njit
def loop_rate(out, tables, k, i, speed):
    """Rate of the feedback loop [1/s] of restriction k, whose opening x follows the pressure at node i.

    speed : rate dx/dt per fall of the pressure, dx/dt = -speed p' [1/s/Pa], p' : pressure change
    The pressure follows the flow M: dM/dx = sqrt(G dP), with conductance G and drop dP, reduced because the drop falls
    as the flow rises. The pressure of the node responds by its pipes or by its stored mass.
    """
    layout, valve = tables.layout[0], tables.valves[k]
    drop = head_drop(tables, out, k)[1]
    soft = node_impedance(tables, valve["from_node"]) + node_impedance(tables, valve["to_node"])
    gain = speed * sqrt(valve["conductance"] * abs(drop)) / (1.0 + soft * restriction_slope(tables, out, k, drop))
    stiff = stiffness_of(tables.nodes, layout, out, i) if tables.nodes[i]["kind"] != JUNCTION else 0.0
    return max(gain * node_impedance(tables, i), sqrt(gain * stiff))
