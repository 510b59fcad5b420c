"""Scenes of few states, which would feel a call more: several pieces of the network as one. Knows the tables."""

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.network import begin
from fvsolve.kernels.nodes import junction_flows, stored_pressures
from fvsolve.kernels.restrictions import open_scheduled


@njit
def open_lumped(t, y, dydt, out, handle):
    """`open_network` and `store_linear`, between which only pipes would add something."""
    tables = open_tables(handle)
    begin(out, tables)
    open_scheduled(t, out, tables)
    stored_pressures(t, y, out, tables)
    junction_flows(t, out, tables)
