"""Inertial and gravity forces on fluid of moving bodies under the density laws `log`, `table` and `mixture`."""

from fvsolve.jit import njit
from fvsolve.kernels.density import enthalpy, pressure_of_enthalpy
from fvsolve.kernels.dtypes import TANK
from fvsolve.kernels.mechanism.noninertial_forces import bottom_pressure_per_density, mark_weightless
from fvsolve.kernels.table_handle import open_tables
from fvsolve.kernels.tanks import tank_level


@njit
def moving_tank_pressures_barotropic(t, y, dydt, out, handle):
    """Write the pressures at the bottoms of tanks on bodies, as deviations from the initial steady state.

    The pressure p follows from the enthalpy, h(p) = h(ambient pressure) + `bottom_pressure_per_density`. A tank whose
    fluid has no weight ends the run (`mark_weightless`).
    """
    tables = open_tables(handle)
    st, nodes, floats = tables.settings[0], tables.nodes, tables.floats
    for i in range(nodes.size):
        node = nodes[i]
        if node["kind"] == TANK and node["moving_segment"] >= 0:
            segment, level = (
                tables.moving_segments[node["moving_segment"]],
                tank_level(node, floats, node["density"], y[node["y"]]),
            )
            h = enthalpy(st, floats, st["ambient"])
            now = pressure_of_enthalpy(st, floats, h + bottom_pressure_per_density(tables, out, segment, level))
            out[tables.layout[0]["pressure"] + i] = now - pressure_of_enthalpy(st, floats, h + segment["rest"])
            mark_weightless(tables, out, i, segment, level)


@njit
def add_cell_drives_barotropic(t, y, dydt, out, handle):
    """Add the drive of the cells of pipes on bodies to the rates of their waves, under barotropic density laws.

    The drive is that of `add_cell_drives`. It changes dM/dt by m / dx times the drive. M : mass flow, m : mass per
    length, dx : length of a cell
    """
    tables = open_tables(handle)
    pipes, profile, at = tables.pipes, tables.profile, tables.layout[0]["moving_segment"]
    for i in range(pipes.size if dydt.size > 0 else 0):
        pipe = pipes[i]
        n, o, first = pipe["cells"], pipe["y"], pipe["moving_segment"]
        for k in range(n if first >= 0 else 0):
            m = profile[pipe["center"] + k] + (y[o + k] + y[o + n + k]) / pipe["speed"]
            push = 0.5 * m / pipe["dx"] * out[at + first + k]
            dydt[o + k] += push
            dydt[o + n + k] -= push
