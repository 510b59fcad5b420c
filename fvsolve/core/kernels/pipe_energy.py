"""Power and stored energy of pipes, from squares of waves averaged over cells.

A square is averaged over a cell from the values at three Gauss points of a polynomial of the scheme's degree through
neighbouring cells. Stored energies are changes since the initial steady state, a cross term and a square: no small
difference of large numbers. P = p - p_ambient + rho g z is the potential [Pa], z the elevation above datum.

Density law `linear`: a pipe of area A and wave speed c stores A P^2 / (2 rho c^2) + M^2 / (2 rho A) per length, M :
mass flow. Friction dissipates M drag / (rho A) per length.

Density laws `log` and `table`: the energy per length is M^2 / (2 m) + W(m) + m g z, dW/dm = h, W = m h - integral of A
dp, with specific enthalpy h and mass per length m. A jet into a vessel loses M v^2 / 2, v : velocity.

Entries of `power` and `stored` for each pipe : `network_energy.py`.
"""

import numpy as np

from fvsolve.core.kernels.density import enthalpy, pressure_of_mass, thrust
from fvsolve.core.kernels.density.steady_profile import rise_at
from fvsolve.core.kernels.dtypes import JUNCTION, MUSCL, SHORT, UPWIND, WENO5
from fvsolve.core.kernels.pipes import scheme_family
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.jit import njit

GAUSS_POINTS = np.array([-0.5, 0.0, 0.5]) * np.sqrt(0.6)
GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
MAX_WIDTH = 5  # cells of the widest polynomial
MIN_CONTENT = 1e-6  # least mass per length, relative to that of a full pipe


def point_weights():
    """Weights of cell averages in the value of a polynomial at Gauss points : float64[w, i, point, cell].

    The polynomial has the averages of w neighbouring cells; the Gauss points are those of cell i among them.
    """
    weights = np.zeros((MAX_WIDTH + 1, MAX_WIDTH, 3, MAX_WIDTH))
    for w in range(1, MAX_WIDTH + 1):
        for i in range(w):
            # Averages of powers of x over the cells: the weights give the value of each power at the points.
            edges = np.arange(w + 1) - i - 0.5
            powers = np.arange(w)
            means = (edges[1:, None] ** (powers + 1) - edges[:-1, None] ** (powers + 1)) / (
                powers + 1
            )
            weights[w, i, :, :w] = np.linalg.solve(means.T, (GAUSS_POINTS[:, None] ** powers).T).T
    return weights


POINTS = point_weights()


@njit
def polynomial_width(settings, n):
    """Number of cells of the polynomial from which squares are averaged, for a pipe of n cells.

    It is 1 below order three, otherwise the order of the scheme, and at most n.
    """
    family, width = scheme_family(settings, n), 1
    if family == WENO5:
        width = MAX_WIDTH
    elif family == SHORT:
        width = 3
    elif family != UPWIND and family != MUSCL and settings["degree"] > 1:
        width = settings["degree"] + 1
    return min(width, n)


@njit(forceinline=True)
def at_point(c, width, i, point):
    """Value at a Gauss point of cell i, from the polynomial through the averages c of `width` cells around it."""
    # Near an end of the pipe the polynomial is one-sided.
    first = min(max(i - width // 2, 0), c.size - width)
    total = 0.0
    for k in range(width):
        total += POINTS[width, i - first, point, k] * c[first + k]
    return total


@njit(forceinline=True)
def height_pressure(st, node):
    """Hydrostatic pressure rho g z of a node at the elevation z above datum [Pa]."""
    return st["rho"] * st["gravity"] * (node["elevation"] - st["datum"])


@njit(forceinline=True)
def steady_potential(st, node):
    """Potential P = p - p_ambient + rho g z of a node in the initial steady state [Pa]."""
    return (node["pressure"] - st["ambient"]) + height_pressure(st, node)


@njit
def pipe_power(t, y, dydt, out, tables, k, rows):
    """Write the powers of pipe k except the inflow [W] to its entries in `power`, under the density law `linear`."""
    st, pipe = tables.settings[0], tables.pipes[k]
    if pipe["cells"] == 0:  # a feature writes its rows
        return
    n = pipe["cells"]
    o = pipe["y"]
    start = steady_potential(st, tables.nodes[pipe["from_node"]])
    r = y[o : o + n]
    l = y[o + n : o + 2 * n]
    dr = dydt[o : o + n]
    dl = dydt[o + n : o + 2 * n]
    width, per = polynomial_width(st, n), 1.0 / (st["rho"] * pipe["area"])
    fall, flow = pipe["drag"] / pipe["area"], pipe["flow"]
    present = pipe["present"]
    friction, rate = 0.0, 0.0
    for i in range(n):
        # A feature may have written the number of each cell.
        reynolds = pipe["reynolds"] if present < 0 else tables.work[present + i]
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            da, db = at_point(dr, width, i, g), at_point(dl, width, i, g)
            total = flow + (a - b)
            # The drag of the profile is constant along the pipe, so its potential falls linearly.
            p = pipe["admittance"] * (start - fall * (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"])
            force = drag(
                pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], reynolds, total
            )
            friction += GAUSS_WEIGHTS[g] * (total * force)
            # The derivative of a cross term with the profile and of a square, as for `pipe_energy`.
            rate += GAUSS_WEIGHTS[g] * (
                (p * (da + db) + flow * (da - db)) + 2.0 * (a * da + b * db)
            )
    rows[1], rows[2], rows[3] = per * pipe["dx"] * friction, 0.0, per * pipe["dx"] * rate


@njit
def pipe_energy(t, y, out, tables, k, rows):
    """Write the energy changes of pipe k since the start [J] to its entries in `stored`, under the law `linear`."""
    st, pipe = tables.settings[0], tables.pipes[k]
    if pipe["cells"] == 0:
        return
    n = pipe["cells"]
    o = pipe["y"]
    start = steady_potential(st, tables.nodes[pipe["from_node"]])
    r = y[o : o + n]
    l = y[o + n : o + 2 * n]
    width = polynomial_width(st, n)
    per = 0.5 / (st["rho"] * pipe["area"])
    fall, flow = pipe["drag"] / pipe["area"], pipe["flow"]
    kinetic, elastic = 0.0, 0.0
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            p = pipe["admittance"] * (start - fall * (i + 0.5 + GAUSS_POINTS[g]) * pipe["dx"])
            # Products of sum and change: no difference of large squares.
            kinetic += GAUSS_WEIGHTS[g] * ((2.0 * flow + (a - b)) * (a - b))
            elastic += GAUSS_WEIGHTS[g] * ((2.0 * p + (a + b)) * (a + b))
    rows[0], rows[1] = per * pipe["dx"] * kinetic, per * pipe["dx"] * elastic


@njit(forceinline=True)
def profile_mass(profile, pipe, i, point):
    """Mass per length of the initial steady state [kg/m] at Gauss point number `point` of cell i.

    It is the value of a parabola through the values in `profile` at both faces and at the centre of the cell.
    """
    left = profile[pipe["face"] + i]
    right = profile[pipe["face"] + i + 1]
    middle = profile[pipe["center"] + i]
    s = GAUSS_POINTS[point]
    return middle + s * ((right - left) + 2.0 * s * ((left - middle) + (right - middle)))


@njit(forceinline=True)
def mass_at_point(st, profile, pipe, i, point, change):
    """Mass per length [kg/m] at Gauss point number `point` of cell i: initial steady value plus `change`.

    It is at least the fraction MIN_CONTENT of the mass per length of a full pipe. profile : initial steady values
    """
    return max(
        profile_mass(profile, pipe, i, point) + change, MIN_CONTENT * st["rho"] * pipe["area"]
    )


@njit
def pipe_power_barotropic(t, y, dydt, out, tables, k, rows):
    """Write the powers of pipe k except the inflow [W] to its entries in `power`, under the laws `log` and `table`."""
    st = tables.settings[0]
    floats = tables.floats
    profile = tables.profile
    pipe = tables.pipes[k]
    n = pipe["cells"]
    o = pipe["y"]
    z = tables.nodes[pipe["from_node"]]["elevation"] - st["datum"]
    r = y[o : o + n]
    l = y[o + n : o + 2 * n]
    dr = dydt[o : o + n]
    dl = dydt[o + n : o + 2 * n]
    c = pipe["speed"]
    width = polynomial_width(st, n)
    dx = pipe["dx"]
    base, reference = enthalpy(st, floats, st["ambient"]), st["rho"] * pipe["area"]
    present = pipe["present"]
    friction, rate = 0.0, 0.0
    for i in range(n):
        # A feature may have written the number of each cell.
        reynolds = pipe["reynolds"] if present < 0 else tables.work[present + i]
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            da, db = at_point(dr, width, i, g), at_point(dl, width, i, g)
            m, flow = mass_at_point(st, profile, pipe, i, g, (a + b) / c), pipe["flow"] + (a - b)
            v = flow / m
            h = enthalpy(st, floats, pressure_of_mass(st, floats, pipe, m)) - base
            h += st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * dx))
            force = drag(
                pipe["friction"], pipe["loss"], pipe["rough"], pipe["roughness"], reynolds, flow
            )
            friction += GAUSS_WEIGHTS[g] * v * force * (reference / m)
            # Derivative of M^2 / (2 m) + W(m) + m g z: h + g z - v^2 / 2 per dm/dt, and v per dM/dt.
            rate += GAUSS_WEIGHTS[g] * ((h - 0.5 * v * v) * (da + db) / c + v * (da - db))
    rows[1], rows[2], rows[3] = dx * friction, jet_losses(out, tables, k), dx * rate


@njit
def pipe_energy_barotropic(t, y, out, tables, k, rows):
    """Write the energy changes of pipe k since the start to its entries in `stored`, under `log` and `table` [J]."""
    st = tables.settings[0]
    floats = tables.floats
    profile = tables.profile
    pipe = tables.pipes[k]
    n = pipe["cells"]
    o = pipe["y"]
    z = tables.nodes[pipe["from_node"]]["elevation"] - st["datum"]
    r = y[o : o + n]
    l = y[o + n : o + 2 * n]
    c = pipe["speed"]
    width = polynomial_width(st, n)
    dx = pipe["dx"]
    base = enthalpy(st, floats, st["ambient"])
    kinetic, elastic = 0.0, 0.0
    for i in range(n):
        for g in range(3):
            a, b = at_point(r, width, i, g), at_point(l, width, i, g)
            m0 = profile_mass(profile, pipe, i, g)
            m, flow = mass_at_point(st, profile, pipe, i, g, (a + b) / c), pipe["flow"] + (a - b)
            p0, p = pressure_of_mass(st, floats, pipe, m0), pressure_of_mass(st, floats, pipe, m)
            h0, h = enthalpy(st, floats, p0) - base, enthalpy(st, floats, p) - base
            height = st["gravity"] * (z + rise_at(profile, pipe, (i + 0.5 + GAUSS_POINTS[g]) * dx))
            kinetic += GAUSS_WEIGHTS[g] * (
                0.5 * flow * flow / m - 0.5 * pipe["flow"] * pipe["flow"] / m0
            )
            squeezed = (m * h - m0 * h0) - (
                thrust(st, floats, pipe, p) - thrust(st, floats, pipe, p0)
            )
            elastic += GAUSS_WEIGHTS[g] * (squeezed + height * (m - m0))
    rows[0], rows[1] = dx * kinetic, dx * elastic


@njit
def jet_losses(out, tables, k):
    """Power lost by the jets from both ends of pipe k into all nodes except junctions, M v^2 / 2 [W].

    M, v : mass flow and velocity of a jet
    """
    lost = 0.0
    pipe = tables.pipes[k]
    nodes = tables.nodes
    end = tables.layout[0]["ends"] + 4 * k
    for side in range(2):
        i = pipe["to_node"] if side == 1 else pipe["from_node"]
        r, l = out[end + 2 * side], out[end + 2 * side + 1]
        m = tables.profile[pipe["face"] + side * pipe["cells"]] + (r + l) / pipe["speed"]
        flow = (2.0 * side - 1.0) * (pipe["flow"] + (r - l))
        if nodes[i]["kind"] != JUNCTION and flow > 0.0:
            lost += 0.5 * flow * (flow / m) * (flow / m)
    return lost


# Gauss points of a cell or interval, in widths from its centre
