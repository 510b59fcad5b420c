"""Heat that friction and throttling add to the fluid, as sources of the scalar that is its temperature.

The fluid temperature T of a mass m has the amount m T [kg K], which the heat rate Q [W] changes by Q / cp, with the
specific heat cp [J/kg/K]. The drop of a restriction heats the node to which its flow leaves: drop times flow, and what
its device dissipates beside. Friction heats the cells of its pipe. The rows `heat` of the ledger contain Q / cp.
"""

from fvsolve.core.kernels import calls
from fvsolve.core.kernels.devices import HEAT, POWER
from fvsolve.core.kernels.network_energy import total_head, total_pressure
from fvsolve.core.kernels.pipe_energy import (
    GAUSS_WEIGHTS,
    at_point,
    mass_at_point,
    polynomial_width,
)
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.features.scalars.kernels.scalar_transport import heated_scalar
from fvsolve.features.scalars.kernels.tables import open_scalars
from fvsolve.features.scalars.kernels.viscosity import cell_reynolds
from fvsolve.jit import specialise

POTENTIAL = BAROTROPIC = RESTRICTIONS = None  # constants of the templates


def _heat_of_restrictions(t, y, dydt, out, handle):
    """Write the heat of restrictions over the specific heat [kg K/s] to `out`."""
    tables, core = open_scalars(handle), open_tables(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    sources = tables.heat_sources
    specific_heat = tables.scalars[heated_scalar(tables)]["specific_heat"]
    per = 1.0 if BAROTROPIC else 1.0 / st["rho"]
    for j in range(sources.size):
        k = sources[j]["valve"]
        drop = POTENTIAL(tables, out, tables.valves[k]["from_node"])
        drop -= POTENTIAL(tables, out, tables.valves[k]["to_node"])
        heat = per * drop * out[layout["valve"] + k]
        if sources[j]["device"] >= 0:
            device = tables.devices[sources[j]["device"]]
            hook, own = tables.hooks[device["hooks"], POWER], tables.hooks[device["hooks"], HEAT]
            # A device may state its heat; else all power that it dissipates is heat.
            if own != 0:
                heat += calls.call_heat(own, t, y, out, core, device)
            elif hook != 0:  # `y` in place of rates, which the dissipation does not read
                heat += calls.call_power(hook, t, y, y, out, core, device)[2]
        out[layout["heat"] + j] = heat / specific_heat


def _heat_of_pipes(t, y, dydt, out, handle):
    """Add the heat of friction in pipe cells to the rates of their amounts of heat, unless `dydt` is empty.

    The power of friction is averaged over a cell as in `pipe_energy.pipe_power`. Unsteady friction adds the part that
    its relaxation variables dissipate.
    """
    tables = open_scalars(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    q = heated_scalar(tables)
    scalar = tables.scalars[q]
    for p in range(tables.pipes.size if dydt.size > 0 else 0):
        pipe = tables.pipes[p]
        if pipe["heat"] < 0:
            continue
        n = pipe["cells"]
        o = pipe["y"]
        at = scalar["y"] + pipe["cell"]
        row = layout["heat"] + pipe["heat"]
        r = y[o : o + n]
        l = y[o + n : o + 2 * n]
        width = polynomial_width(st, n)
        total = 0.0
        full = st["rho"] * pipe["area"]
        for i in range(n):
            power, reynolds = 0.0, cell_reynolds(y, tables, q, p, i)
            for g in range(3):
                a, b = at_point(r, width, i, g), at_point(l, width, i, g)
                flow = pipe["flow"] + (a - b)
                force = drag(
                    pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], reynolds, flow
                )
                if BAROTROPIC:
                    # Velocity and wall force per length both go with 1 / m.
                    ratio = full / mass_at_point(
                        st, tables.profile, pipe, i, g, (a + b) / pipe["speed"]
                    )
                    power += GAUSS_WEIGHTS[g] * flow * force * ratio * ratio
                else:
                    power += GAUSS_WEIGHTS[g] * flow * force
                # Only what the variables dissipate is heat: what they store returns to the flow.
                for k in range(pipe["terms"]):
                    memory = pipe["memory"] + k * n
                    lag = (a - b) - at_point(y[memory : memory + n], width, i, g)
                    power += GAUSS_WEIGHTS[g] * tables.floats[pipe["term"] + 2 * k] * lag * lag
            heat = power / (full * scalar["specific_heat"])
            dydt[at + i] += heat
            total += heat
            # The ledger has an entry for each cell, or one for the pipe.
            if scalar["by_cell"] == 1:
                out[row + i] = pipe["dx"] * heat
        if scalar["by_cell"] == 0:
            out[row] = pipe["dx"] * total


def _heat_for_events(t, y, out, handle, g):
    """Write the heat of restrictions to `out`, which scalars at nodes follow, before event functions."""
    RESTRICTIONS(t, y, g[:0], out, handle)


LINEAR = {"POTENTIAL": total_pressure, "BAROTROPIC": False}
OTHERS = {"POTENTIAL": total_head, "BAROTROPIC": True}
heat_of_restrictions = specialise(_heat_of_restrictions, "heat_of_restrictions", **LINEAR)
heat_of_restrictions_barotropic = specialise(
    _heat_of_restrictions, "heat_of_restrictions_barotropic", **OTHERS
)
heat_of_pipes = specialise(_heat_of_pipes, "heat_of_pipes", **LINEAR)
heat_of_pipes_barotropic = specialise(_heat_of_pipes, "heat_of_pipes_barotropic", **OTHERS)
heat_for_events = specialise(_heat_for_events, "heat_for_events", RESTRICTIONS=heat_of_restrictions)
heat_for_events_barotropic = specialise(
    _heat_for_events, "heat_for_events_barotropic", RESTRICTIONS=heat_of_restrictions_barotropic
)
