"""Rates and cavity records of pipes under the density law `mixture`, where cavities open and close.

m_t + M_x = 0, M_t + (M^2 / m + F)_x = -drag - m g slope, with mass per length m [kg/m], mass flow M [kg/s], area A and
F the integral of A dp [N]. Pressure and velocity are reconstructed from both sides of a face. The flux is that of the
Riemann problem there (`riemann.py`), minus the initial steady flux. So each front moves at its own speed: sound in the
liquid, or the edge of a cavity a thousand times slower.

Arguments common to these functions: r, l : float64[cells]  forward and backward wave [kg/s]; profile : values of the
initial steady state; p, v : float64[n + 2]  pressure [Pa] and velocity [m/s] of n cells and of an extrapolated cell
beyond each end; dp, dv : their changes since the initial steady state.
"""

from fvsolve.core.kernels.barotropic_pipes import wall_force
from fvsolve.core.kernels.density import (
    force_of_mass,
    local_speed,
    mass_of_pressure,
    pressure_of_mass,
)
from fvsolve.core.kernels.density.mixture_law import relative_volume
from fvsolve.core.kernels.density.steady_profile import add_slope_force
from fvsolve.core.kernels.dtypes import RATE, UPWIND
from fvsolve.core.kernels.isolated_nodes import marks_of_islands
from fvsolve.core.kernels.reconstruction import value_muscl
from fvsolve.core.kernels.riemann import face_flux
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit

# Fractions of the content of a pipe at the reference pressure:
GAS_LIMIT = 0.99  # a cell with less contains gas
DRY = 1e-8  # below it the velocity of a cell goes to zero with its content


@njit
def cell_state(st, floats, profile, pipe, i, r, l):
    """(pressure [Pa], velocity [m/s] of cell i, pressure [Pa], velocity [m/s] of its initial steady state)."""
    m0, flow = profile[pipe["center"] + i], pipe["flow"]
    m, dry = m0 + (r[i] + l[i]) / pipe["speed"], DRY * st["rho"] * pipe["area"]
    p0, v0 = pressure_of_mass(st, floats, pipe, m0), flow / m0
    v = (flow + (r[i] - l[i])) / m
    # Below DRY the velocity falls linearly to zero with the content, so that the quotient stays bounded.
    if m < dry:
        v, m = (flow + (r[i] - l[i])) * max(m, 0.0) / (dry * dry), dry
    return pressure_of_mass(st, floats, pipe, m), v, p0, v0


@njit(forceinline=True)
def extrapolate_ends(a, n):
    """Extrapolate values of n cells to a cell beyond each end of the pipe: write a[0] and a[n + 1].

    The difference used is that between the second and the third cell from the end. The limiter of the scheme later
    compares it with the difference between the first and the second cell.
    a : float64[n + 2]  values of the cells in a[1] .. a[n]
    """
    near, far = min(2, n), min(3, n)
    a[0] = a[1] - (a[far] - a[near] if n > 2 else a[near] - a[1])
    a[n + 1] = a[n] + (a[n + 1 - near] - a[n + 1 - far] if n > 2 else a[n] - a[n + 1 - near])


@njit
def fill_cells(st, floats, profile, pipe, first, r, l, p, v, dp, dv):
    """Write pressures and velocities of the cells from number `first` on, and of an extrapolated cell past each end."""
    n = p.size - 2
    for i in range(n):
        p[i + 1], v[i + 1], p0, v0 = cell_state(st, floats, profile, pipe, first + i, r, l)
        dp[i + 1], dv[i + 1] = p[i + 1] - p0, v[i + 1] - v0
    for a in (p, v, dp, dv):
        extrapolate_ends(a, n)


@njit(forceinline=True)
def face_value(st, a, k, ahead):
    """Value at a face of cell k, reconstructed from the values a of cells.

    ahead : 1 for the face after the cell, -1 for the face before it
    """
    if st["scheme"] == UPWIND:
        return a[k]
    return value_muscl(st["limiter"], a[k - ahead], a[k], a[k + ahead])


@njit
def face_state(st, floats, profile, pipe, i, k, ahead, p, v, dp, dv):
    """(pressure [Pa], velocity [m/s], True if both are initial steady values) at face i, from the cell on one side.

    k : index of this cell in p, v, dp, dv, see `fill_cells`
    ahead : 1 if the face is after the cell, -1 if it is before it
    The reconstructed change is added to the steady pressure, except in two cases, in which the pressure itself is
    reconstructed. First, if the sum would bring the gas pressure below half its value in the cell. Second, if the cell
    contains gas and the face is an end of the pipe, because there no weight or friction of liquid compresses the
    cavity.
    A face has at most twice the mass per length of a cell with gas, so that no more flows out than there is.
    """
    dp_face, dv_face = face_value(st, dp, k, ahead), face_value(st, dv, k, ahead)
    undisturbed = dp_face == 0.0 and dv_face == 0.0
    m0 = profile[pipe["face"] + i]
    q, gas = pressure_of_mass(st, floats, pipe, m0) + dp_face, 0.5 * (p[k] - st["floor"])
    content = mass_of_pressure(st, floats, pipe, p[k])[0]
    has_gas = content < GAS_LIMIT * st["rho"] * pipe["area"]
    if q - st["floor"] < gas or (has_gas and (i == 0 or i == pipe["cells"])):
        q = max(face_value(st, p, k, ahead), st["floor"] + gas)
    if has_gas:
        q = min(q, pressure_of_mass(st, floats, pipe, 2.0 * content))
    return q, pipe["flow"] / m0 + dv_face, undisturbed


@njit
def end_states(st, floats, profile, pipe, r, l, ends, scratch):
    """Extrapolate pressure and velocity from the cells to both ends of a pipe.

    ends : float64[4]  receives pressure and velocity at the `from` end, then at the `to` end [Pa, m/s]
    """
    n = r.size
    # The limiter and the extrapolation at an end need three cells; the others are not evaluated.
    n_near = min(n, 3)
    p = scratch[: n_near + 2]
    v = scratch[5 : n_near + 7]
    dp = scratch[10 : n_near + 12]
    dv = scratch[15 : n_near + 17]
    for side in range(2):
        fill_cells(st, floats, profile, pipe, (n - n_near) * side, r, l, p, v, dp, dv)
        k, ahead = (n_near, 1) if side == 1 else (1, -1)
        state = face_state(st, floats, profile, pipe, n * side, k, ahead, p, v, dp, dv)
        ends[2 * side], ends[2 * side + 1] = state[0], state[1]


@njit
def pipe_rates_cavitating(st, floats, profile, pipe, r, l, ends, scratch, dr, dl):
    """Write d/dt of both waves of a pipe [kg/s2] to dr and dl; return its greatest wave rate (|v| + c) / dx [1/s].

    v, c : velocity and wave speed; dx : length of a cell
    ends : float64[4]  waves at the ends [kg/s]: forward and backward at `from`, then at `to`
    """
    n = r.size
    c = pipe["speed"]
    dx = pipe["dx"]
    flow = pipe["flow"]
    p, v = scratch[: n + 2], scratch[n + 2 : 2 * n + 4]
    dp, dv = scratch[2 * n + 4 : 3 * n + 6], scratch[3 * n + 6 : 4 * n + 8]
    fill_cells(st, floats, profile, pipe, 0, r, l, p, v, dp, dv)
    reference, weight = st["rho"] * pipe["area"], st["gravity"] * pipe["slope"]
    left_flow = 0.0
    left_flux = 0.0
    highest = p[1]
    quickest = 0.0
    for i in range(n + 1):
        if i == 0 or i == n:
            dflow, flux = end_flux(
                st, floats, profile, pipe, i, ends[0 if i == 0 else 2], ends[1 if i == 0 else 3]
            )
        else:
            p_l, v_l, still_l = face_state(st, floats, profile, pipe, i, i, 1, p, v, dp, dv)
            p_r, v_r, still_r = face_state(st, floats, profile, pipe, i, i + 1, -1, p, v, dp, dv)
            # Undisturbed faces need no Riemann problem, and keep the flux of the profile to the bit.
            dflow, flux = 0.0, 0.0
            if not (still_l and still_r):
                total, flux = face_flux(st, floats, pipe, p_l, v_l, p_r, v_r)
                dflow, flux = total - flow, flux - profile[pipe["flux"] + i]
        if i > 0:
            k = i - 1
            m0 = profile[pipe["center"] + k]
            dm = (r[k] + l[k]) / c
            friction = wall_force(
                pipe, reference, max(m0 + dm, DRY * reference), flow + (r[k] - l[k])
            )
            # The profile balances the weight of its own mass.
            force = -weight * dm - (friction - pipe["drag"] * (reference / m0))
            mass_rate, flow_rate = -(dflow - left_flow) / dx, -(flux - left_flux) / dx + force
            dr[k], dl[k] = 0.5 * (c * mass_rate + flow_rate), 0.5 * (c * mass_rate - flow_rate)
            highest, quickest = max(highest, p[i]), max(quickest, abs(v[i]))
        left_flow, left_flux = dflow, flux
    # Such a pipe has `slope` 0, so its weight is not counted twice.
    if pipe["rise"] >= 0:
        add_slope_force(st, profile, pipe, r, l, dr, dl)
    # The wave speed of a mixture rises with pressure.
    return (quickest + local_speed(st, floats, pipe, highest)) / dx * pipe["rate_factor"]


@njit
def end_flux(st, floats, profile, pipe, i, r, l):
    """(mass flow [kg/s], momentum flux [N]) at end face i, as changes since the initial steady state.

    r, l : waves at this face
    """
    # The formula below would leave rounding, which would disturb a steady state.
    if r == 0.0 and l == 0.0:
        return 0.0, 0.0
    m, total = profile[pipe["face"] + i] + (r + l) / pipe["speed"], pipe["flow"] + (r - l)
    force = force_of_mass(st, floats, pipe, m)
    return r - l, total * total / m + force - profile[pipe["flux"] + i]


@njit
def outgoing_states_cavitating(t, y, dydt, out, handle):
    """Extrapolate pressure [Pa] and velocity [m/s] from the cells to both ends of every pipe, into out[ends]."""
    tables = open_tables(handle)
    st = tables.settings[0]
    layout = tables.layout[0]
    pipes = tables.pipes
    floats = tables.floats
    profile = tables.profile
    scratch = tables.scratch
    for i in range(pipes.size):
        n = pipes[i]["cells"]
        o = pipes[i]["y"]
        at = layout["ends"] + 4 * i
        end_states(
            st,
            floats,
            profile,
            pipes[i],
            y[o : o + n],
            y[o + n : o + 2 * n],
            out[at : at + 4],
            scratch,
        )


@njit
def rates_cavitating(t, y, dydt, out, handle):
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
        own = pipe_rates_cavitating(
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
        out[RATE] = max(out[RATE], own)


@njit
def record_cavity(t, pipe, r, l, at, tables):
    """Record the cavities of a pipe in three entries of `marks`, from index `at` on.

    The entries are: position of the first cavity (fraction of the length), greatest volume [m3], time of this volume
    [s].
    """
    st = tables.settings[0]
    floats = tables.floats
    profile = tables.profile
    marks = tables.marks
    volume, first = 0.0, -1
    for i in range(r.size):
        if r[i] + l[i] < profile[pipe["cell"] + i]:
            first = i if first < 0 else first
            m = profile[pipe["center"] + i] + (r[i] + l[i]) / pipe["speed"]
            p = pressure_of_mass(st, floats, pipe, max(m, DRY * st["rho"] * pipe["area"]))
            liquid = 1.0 - (p - st["reference"]) / st["beta"]
            volume += pipe["area"] * pipe["dx"] * (1.0 - liquid / relative_volume(st, p)[0])
    if first >= 0:
        # Marks are NaN until something is recorded.
        if marks[at] != marks[at]:
            marks[at], marks[at + 1] = (first + 0.5) / r.size, 0.0
        if volume > marks[at + 1]:
            marks[at + 1], marks[at + 2] = volume, t


@njit
def record_cavities(t, y, out, handle, values):
    """Record the cavities of all pipes in `marks` after an accepted step, see `record_cavity`."""
    tables = open_tables(handle)
    pipes, at = tables.pipes, marks_of_islands(tables) - 3 * tables.pipes.size
    for i in range(pipes.size):
        n, o = pipes[i]["cells"], pipes[i]["y"]
        record_cavity(t, pipes[i], y[o : o + n], y[o + n : o + 2 * n], at + 3 * i, tables)
