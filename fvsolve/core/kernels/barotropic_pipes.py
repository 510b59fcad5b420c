"""Rates and probes of pipes under the density laws `log` and `table`, with the full momentum flux.

m_t + M_x = 0, M_t + (M^2 / m)_x + A p_x = -drag - m g slope, with mass per length m [kg/m], mass flow M [kg/s] and area
A. The waves r = (c m' + M') / 2 and l = (c m' - M') / 2 [kg/s] are each reconstructed from the side from which they
come. m' and M' are changes since the initial steady state, c is the reference wave speed. The flux at a face is that of
the state which both waves form there (a linearised Riemann solution), minus the initial steady flux.
"""

from fvsolve.core.kernels import density as law
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.density.steady_profile import add_slope_force
from fvsolve.core.kernels.pipes import GAUSS, both_faces
from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.core.kernels.tanks import tank_level
from fvsolve.jit import njit


@njit
def momentum_flux(st, floats, pipe, m, flow):
    """Momentum flux M^2 / m + integral of A dp [N] at mass flow M = `flow` [kg/s] and mass per length m [kg/m]."""
    return flow * flow / m + law.force_of_mass(st, floats, pipe, m)


@njit
def wall_force(pipe, reference, m, flow):
    """Friction force per length [kg/s2] of a mass flow [kg/s] in a pipe with the mass per length m [kg/m].

    reference : mass per length at the reference density [kg/m]
    """
    friction = drag(
        pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], pipe["reynolds"], flow
    )
    return friction * (reference / m)


@njit
def pipe_rates_barotropic(st, floats, profile, pipe, r, l, ends, scratch, dr, dl):
    """Write d/dt of both waves of a pipe [kg/s2] to dr and dl; return its greatest wave rate (|v| + c) / dx [1/s].

    v, c : velocity and wave speed; dx : length of a cell; profile : values of the initial steady state
    r, l : float64[cells]  forward and backward wave [kg/s]
    ends : float64[4]  waves at the ends [kg/s]: forward and backward at `from`, then at `to`
    """
    n = r.size
    c = pipe["speed"]
    dx = pipe["dx"]
    flow = pipe["flow"]
    fr, fl = scratch[32 : 33 + n], scratch[40 + n : 41 + 2 * n]
    both_faces(st, pipe, r, l, ends[0], ends[1], ends[2], ends[3], scratch, fr, fl)
    face, cell = pipe["face"], pipe["center"]
    reference = st["rho"] * pipe["area"]
    weight = st["gravity"] * pipe["slope"]
    least, greatest, quickest = 1e300, 0.0, 0.0
    left_flow, left_flux, left_mass = 0.0, 0.0, 0.0
    for i in range(n + 1):
        dm, dflow = (fr[i] + fl[i]) / c, fr[i] - fl[i]
        m, total = profile[face + i] + dm, flow + dflow
        # Without the flux of the profile, so that rounding does not disturb a steady state.
        flux = momentum_flux(st, floats, pipe, m, total) - profile[pipe["flux"] + i]
        least = min(least, m)
        greatest = max(greatest, m)
        quickest = max(quickest, abs(total))
        if i > 0:
            k = i - 1
            m0 = profile[cell + k]
            dm_cell, m_flow = (r[k] + l[k]) / c, flow + (r[k] - l[k])
            # Friction at two Gauss points of the cell, as in `pipes.subtract_friction`.
            a, b = GAUSS * (dflow - left_flow), GAUSS * (dm - left_mass)
            friction = wall_force(pipe, reference, m0 + dm_cell + b, m_flow + a)
            friction += wall_force(pipe, reference, m0 + dm_cell - b, m_flow - a)
            # The profile balances the weight of its own mass.
            force = -weight * dm_cell - (0.5 * friction - pipe["drag"] * (reference / m0))
            # Conservation: dm'/dt = -dM/dx, dM'/dt = -d(flux)/dx + force, for r and l = (c m' +- M') / 2.
            mass_rate = -(dflow - left_flow) / dx
            flow_rate = -(flux - left_flux) / dx + force
            dr[k] = 0.5 * (c * mass_rate + flow_rate)
            dl[k] = 0.5 * (c * mass_rate - flow_rate)
        left_flow = dflow
        left_flux = flux
        left_mass = dm
    # Such a pipe has `slope` 0, so its weight is not counted twice.
    if pipe["rise"] >= 0:
        add_slope_force(st, profile, pipe, r, l, dr, dl)
    # The wave speed is evaluated at two masses only: it is monotone between them.
    low = law.local_speed(st, floats, pipe, law.pressure_of_mass(st, floats, pipe, least))
    high = law.local_speed(st, floats, pipe, law.pressure_of_mass(st, floats, pipe, greatest))
    return (quickest / least + max(low, high)) / dx * pipe["rate_factor"]


@njit
def rates_barotropic(t, y, dydt, out, handle):
    """Write d/dt of the waves in all pipe cells to `dydt`, and raise out[RATE] to the greatest wave rate [1/s].

    Nothing is done if `dydt` is empty.
    """
    tables = open_tables(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    pipes = tables.pipes
    for i in range(pipes.size if dydt.size > 0 else 0):
        n = pipes[i]["cells"]
        o = pipes[i]["y"]
        at = layout["ends"] + 4 * i
        own = pipe_rates_barotropic(
            st,
            tables.floats,
            tables.profile,
            pipes[i],
            y[o : o + n],
            y[o + n : o + 2 * n],
            out[at : at + 4],
            tables.scratch,
            dydt[o : o + n],
            dydt[o + n : o + 2 * n],
        )
        out[rec.RATE] = max(out[rec.RATE], own)


@njit
def pipe_state_at(probe, index, y, out, tables):
    """(mass per length [kg/m], mass flow [kg/s]) at the position of a probe in pipe number `index`."""
    pipe, at = tables.pipes[index], tables.layout[0]["ends"] + 4 * index
    r, l = out[at], out[at + 1]
    if probe["side"] > 0:
        r, l = out[at + 2], out[at + 3]
    if probe["side"] == 0:
        r, l = 0.0, 0.0
        for k in range(probe["count"]):
            cell, weight = pipe["y"] + probe["cell"] + k, tables.floats[probe["weights"] + k]
            r += weight * y[cell]
            l += weight * y[cell + pipe["cells"]]
    return probe["mass"] + (r + l) / pipe["speed"], pipe["flow"] + (r - l)


@njit
def pressure_or_head(st, floats, probe, p):
    """Value of a probe at the pressure p: a pressure, absolute or gauge [Pa], or a head [m].

    The head is (h(p) - h(ambient)) / g plus elevation, h : specific enthalpy.
    """
    if probe["head"] == 1:
        return (law.enthalpy(st, floats, p) - law.enthalpy(st, floats, st["ambient"])) / st[
            "gravity"
        ] + probe["offset"]
    return p + probe["offset"]


@njit
def valve_volume_flow(st, floats, tables, out, k):
    """Volume flow of valve k [m3/s] at the upstream density."""
    layout = tables.layout[0]
    nodes = tables.nodes
    valve = tables.valves[k]
    flow = out[layout["valve"] + k]
    up = valve["from_node"] if flow >= 0.0 else valve["to_node"]
    return flow / law.density(st, floats, nodes[up]["pressure"] + out[layout["pressure"] + up])


@njit
def observe_barotropic(t, y, out, handle, values):
    """Write the values of all probes of nodes, pipes, valves and rigid columns, in SI units, to `values`.

    Volume flows [m3/s] are computed with the local density in pipes, the upstream density in valves, and the reference
    density in columns.
    """
    tables = open_tables(handle)
    st = tables.settings[0]
    floats = tables.floats
    layout = tables.layout[0]
    nodes = tables.nodes
    probes = tables.probes
    for k in range(probes.size):
        probe = probes[k]
        kind, i = probe["kind"], probe["index"]
        value = 0.0
        if kind == rec.PRESSURE:
            value = pressure_or_head(
                st, floats, probe, nodes[i]["pressure"] + out[layout["pressure"] + i]
            )
        elif kind == rec.LEVEL:
            value = tank_level(nodes[i], floats, nodes[i]["density"], y[nodes[i]["y"]])
        elif kind == rec.PIPE_PRESSURE or kind == rec.PIPE_FLOW:
            m, flow = pipe_state_at(probe, i, y, out, tables)
            p = law.pressure_of_mass(st, floats, tables.pipes[i], m)
            if kind == rec.PIPE_PRESSURE:
                value = pressure_or_head(st, floats, probe, p)
            else:
                # Velocity M / m, or volume flow at the local density.
                value = flow / m if probe["head"] == 2 else flow / law.density(st, floats, p)
        elif kind == rec.VALVE_FLOW:
            value = valve_volume_flow(st, floats, tables, out, i)
            if probe["head"] == 2:
                value /= floats[probe["weights"]]
        elif kind == rec.PRESSURE_BETWEEN:
            x, j = floats[probe["weights"]], probe["cell"]
            p = floats[probe["weights"] + 2] + (1.0 - x) * (
                nodes[i]["pressure"] + out[layout["pressure"] + i]
            )
            p += x * (nodes[j]["pressure"] + out[layout["pressure"] + j])
            value = pressure_or_head(st, floats, probe, p)
        elif kind == rec.SPOOL_FLOW:
            for e in range(probe["count"]):
                value += floats[probe["weights"] + e] * valve_volume_flow(
                    st, floats, tables, out, i + e
                )
        elif kind == rec.SCHEDULE_VALUE:
            value = schedule_value(tables, i, t)
        elif kind == rec.COLUMN_FLOW:
            value = out[layout["column"] + i] / st["rho"]
        values[k] = value
