"""Initial steady state of a pipe with friction under a barotropic density law, and the weight along its slope."""

from fvsolve.core.kernels.density import density, enthalpy, mass_of_pressure, pressure_of_enthalpy
from fvsolve.jit import inline, njit


@inline
def rise_at(profile, pipe, x):
    """Rise [m] of a pipe from its `from` end over a distance x [m] along it, linear between faces and cell centres.

    profile : data of the initial steady state of all pipes
    """
    if pipe["rise"] < 0:
        return pipe["slope"] * x
    share = x / (0.5 * pipe["dx"])
    j = min(int(share), 2 * pipe["cells"] - 1)
    before, after = profile[pipe["rise"] + j], profile[pipe["rise"] + j + 1]
    return before + (after - before) * (share - j)


@njit
def add_slope_force(st, profile, pipe, r, l, dr, dl):
    """Add the weight along a pipe with an elevation profile, - m' g dz/dx [kg/s2], to d/dt of the waves of its cells.

    Half is added to the rate of the forward wave, and half is subtracted from that of the backward wave.
    m' : change of the mass per length since the initial steady state [kg/m]; z : elevation
    r, l, dr, dl : float64[cells]  forward and backward wave [kg/s] and their rates
    """
    at, weight = pipe["rise"], st["gravity"] / (pipe["dx"] * pipe["speed"])
    for i in range(r.size):
        force = -weight * (profile[at + 2 * i + 2] - profile[at + 2 * i]) * (r[i] + l[i])
        dr[i] += 0.5 * force
        dl[i] -= 0.5 * force


@njit
def mass_of_bernoulli(st, floats, pipe, bernoulli, flow):
    """Mass per length m [kg/m] in a pipe at which h(p) + v^2 / 2 is `bernoulli` [J/kg]; the subsonic solution.

    h : specific enthalpy; v = flow / m : velocity, with the mass flow [kg/s]
    """
    # Newton starts from the fluid at rest, on the subsonic side of the root.
    p = pressure_of_enthalpy(st, floats, bernoulli)
    m, dm = mass_of_pressure(st, floats, pipe, p)
    for _ in range(50):
        v = flow / m
        # d/dp of h + v^2 / 2 is 1 / rho - v^2 (dm/dp) / m.
        step = (enthalpy(st, floats, p) + 0.5 * v * v - bernoulli) / (
            1.0 / density(st, floats, p) - v * v * dm / m
        )
        p -= step
        m, dm = mass_of_pressure(st, floats, pipe, p)
        if abs(step) <= 1e-15 * abs(p):
            break
    return m


@njit
def profile_along(st, floats, profile, pipe, start, z, flow, faces, centers):
    """Write the initial steady state along a pipe with friction: d(h + v^2/2 + g z)/dx = -drag m_ref / m^2.

    The equation is integrated by the classical Runge-Kutta method in steps of half a cell.
    h : specific enthalpy, v : velocity, m : mass per length, m_ref : its reference value
    drag : drag of the initial steady state in the row of the pipe, constant along it
    start : h + v^2/2 + g z at the `from` end [J/kg]; z : elevation there [m]; flow : mass flow [kg/s]
    faces, centers : receive the mass per length at faces and cell centres [kg/m]
    Returns h + v^2/2 + g z at the `to` end [J/kg].
    """
    pull = pipe["drag"] * st["rho"] * pipe["area"]
    g = st["gravity"]
    half = 0.5 * pipe["dx"]
    b = start
    m = mass_of_bernoulli(st, floats, pipe, b - g * z, flow)
    faces[0] = m
    for i in range(2 * centers.size):
        x = i * half
        k1 = -pull / (m * m)
        middle = g * (z + rise_at(profile, pipe, x + 0.5 * half))
        m = mass_of_bernoulli(st, floats, pipe, b + 0.5 * half * k1 - middle, flow)
        k2 = -pull / (m * m)
        m = mass_of_bernoulli(st, floats, pipe, b + 0.5 * half * k2 - middle, flow)
        k3 = -pull / (m * m)
        end = g * (z + rise_at(profile, pipe, x + half))
        m = mass_of_bernoulli(st, floats, pipe, b + half * k3 - end, flow)
        b += half * (k1 + 2.0 * k2 + 2.0 * k3 - pull / (m * m)) / 6.0
        m = mass_of_bernoulli(st, floats, pipe, b - end, flow)
        # Steps of half a cell end at the centre and at the face of a cell in turn.
        if i % 2 == 0:
            centers[i // 2] = m
        else:
            faces[i // 2 + 1] = m
    return b
