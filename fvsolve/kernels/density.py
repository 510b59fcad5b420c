"""Density laws and what follows from them: enthalpy, mass per length, the momentum that pressure carries.

log: p = p_ref + beta ln(rho / rho_ref), the integral of (80). table: ln rho by cubic Hermite over pressure,
straight beyond its ends. The wall swells by d ln(area) = compliance dp. mixture: see there, its wall too. Knows one
place; knows no cells.
"""

from math import exp, expm1, log, log1p, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.mixture import (
    mixture_enthalpy,
    mixture_impedance,
    mixture_mass,
    mixture_pressure,
    mixture_pressure_of_enthalpy,
    mixture_velocity_change,
    mixture_volume,
    wall_stretch,
)
from fvsolve.kernels.records import LAW_LOG, LAW_MIXTURE


@njit(forceinline=True)
def hermite(floats, values, slopes, k, s, step):
    """Cubic through two values with two slopes, at s in [0, 1] of interval k."""
    r = 1.0 - s
    v0, v1 = floats[values + k], floats[values + k + 1]
    d0, d1 = floats[slopes + k] * step, floats[slopes + k + 1] * step
    return v0 + s * s * (3.0 - 2.0 * s) * (v1 - v0) + s * r * (r * d0 - s * d1)


@njit
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at a pressure."""
    if st["law"] == LAW_LOG:
        return (p - st["reference"]) / st["beta"], 1.0 / st["beta"]
    if st["law"] == LAW_MIXTURE:
        size, fall = mixture_volume(st, p)
        return -log(size), fall / size
    n, o, step = st["table_size"], st["table"], st["table_step"]
    x = (p - st["table_start"]) / step
    if x <= 0.0:
        return floats[o] + floats[o + n] * x * step, floats[o + n]
    if x >= n - 1.0:
        return floats[o + n - 1] + floats[o + 2 * n - 1] * (x - (n - 1.0)) * step, floats[o + 2 * n - 1]
    k = int(x)
    s = x - k
    value = hermite(floats, o, o + n, k, s, step)
    v0, v1, d0, d1 = floats[o + k], floats[o + k + 1], floats[o + n + k], floats[o + n + k + 1]
    slope = 6.0 * s * (1.0 - s) * (v1 - v0) / step + (1.0 - s) * (1.0 - 3.0 * s) * d0 + s * (3.0 * s - 2.0) * d1
    return value, slope


@njit
def density(st, floats, p):
    """rho [kg/m3] at a pressure."""
    if st["law"] == LAW_MIXTURE:
        return st["rho"] / mixture_volume(st, p)[0]
    return st["rho"] * exp(log_density(st, floats, p)[0])


@njit
def enthalpy(st, floats, p):
    """h = integral of dp / rho from the reference pressure [J/kg]."""
    if st["law"] == LAW_LOG:
        return -st["beta"] / st["rho"] * expm1(-(p - st["reference"]) / st["beta"])
    if st["law"] == LAW_MIXTURE:
        return mixture_enthalpy(st, p)
    n, o, step = st["table_size"], st["table"], st["table_step"]
    x = (p - st["table_start"]) / step
    k = 0 if x <= 0.0 else (n - 1 if x >= n - 1.0 else -1)
    if k >= 0:
        slope, rho = floats[o + n + k], st["rho"] * exp(floats[o + k])
        return floats[o + 2 * n + k] - expm1(-slope * (x - k) * step) / (slope * rho)
    k = int(x)
    return hermite(floats, o + 2 * n, o + 3 * n, k, x - k, step)


@njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which `enthalpy` is h."""
    if st["law"] == LAW_LOG:
        return st["reference"] - st["beta"] * log1p(-h * st["rho"] / st["beta"])
    if st["law"] == LAW_MIXTURE:
        return mixture_pressure_of_enthalpy(st, h)
    p = st["reference"] + st["rho"] * h
    for _ in range(30):
        step = (enthalpy(st, floats, p) - h) * density(st, floats, p)
        p -= step
        if abs(step) <= 1e-15 * abs(p):
            break
    return p


@njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure [Pa] at which ln(rho / rho_ref) + compliance (p - p_ref) is q."""
    if st["law"] == LAW_MIXTURE:
        return mixture_pressure(st, compliance, exp(q))
    p = st["reference"] + q / (1.0 / st["beta"] + compliance)
    if st["law"] == LAW_LOG:
        return p
    for _ in range(30):
        value, slope = log_density(st, floats, p)
        step = (value + compliance * (p - st["reference"]) - q) / (slope + compliance)
        p -= step
        if abs(step) <= 1e-13 * (abs(p) + 1.0):
            break
    return p


@njit
def pressure_of_mass(st, floats, pipe, m):
    """Pressure [Pa] of a pipe that holds m [kg/m]."""
    if st["law"] == LAW_MIXTURE:
        return mixture_pressure(st, pipe["compliance"], m / (st["rho"] * pipe["area"]))
    return pressure_of_log(st, floats, pipe["compliance"], log(m / (st["rho"] * pipe["area"])))


@njit
def mass_of_pressure(st, floats, pipe, p):
    """Mass per length m = rho A [kg/m] and dm/dp of a pipe at a pressure."""
    if st["law"] == LAW_MIXTURE:
        return mixture_mass(st, pipe, p)
    value, slope = log_density(st, floats, p)
    m = st["rho"] * pipe["area"] * exp(value + pipe["compliance"] * (p - st["reference"]))
    return m, m * (slope + pipe["compliance"])


@njit
def wall_area(st, pipe, p):
    """Area of a pipe at a pressure [m2]."""
    if st["law"] == LAW_MIXTURE:
        return pipe["area"] * wall_stretch(st, pipe["compliance"], p)
    return pipe["area"] * exp(pipe["compliance"] * (p - st["reference"]))


@njit
def thrust(st, pipe, p):
    """Integral of A dp from the reference pressure [N]."""
    x = pipe["compliance"] * (p - st["reference"])
    if st["law"] == LAW_MIXTURE:
        return pipe["area"] * (p - st["reference"]) * (1.0 + 0.5 * x)
    if abs(x) < 1e-14:
        return pipe["area"] * (p - st["reference"])
    return pipe["area"] * expm1(x) / pipe["compliance"]


@njit
def impedance(st, floats, pipe, p):
    """rho c = sqrt(K rho) of a pipe at a pressure [kg/m2/s]."""
    if st["law"] == LAW_MIXTURE:
        return mixture_impedance(st, pipe["compliance"], p)
    value, slope = log_density(st, floats, p)
    return sqrt(st["rho"] * exp(value) / (slope + pipe["compliance"]))


@njit
def velocity_change(st, floats, pipe, p_from, p_to):
    """Integral of dp / (rho c) [m/s]: what a simple wave takes off the velocity; by three Gauss points."""
    if st["law"] == LAW_MIXTURE:
        return mixture_velocity_change(st, pipe["compliance"], p_from, p_to)
    middle, half = 0.5 * (p_from + p_to), 0.5 * (p_to - p_from)
    far = 0.7745966692414834 * half  # sqrt(3/5)
    total = 8.0 / impedance(st, floats, pipe, middle)
    total += 5.0 / impedance(st, floats, pipe, middle - far) + 5.0 / impedance(st, floats, pipe, middle + far)
    return half * total / 9.0


@njit
def local_speed(st, floats, pipe, p):
    """Wave speed sqrt(K / rho), 1/K = d ln rho / dp + compliance [m/s]."""
    if st["law"] == LAW_MIXTURE:
        return mixture_impedance(st, pipe["compliance"], p) * mixture_volume(st, p)[0] / st["rho"]
    value, slope = log_density(st, floats, p)
    return sqrt(1.0 / ((slope + pipe["compliance"]) * st["rho"] * exp(value)))


@njit
def mass_of_head(st, floats, pipe, bernoulli, flow):
    """Mass per length [kg/m] where h(p) + v^2 / 2 is `bernoulli` [J/kg], v = flow / m, below the speed of sound."""
    p = pressure_of_enthalpy(st, floats, bernoulli)
    m, dm = mass_of_pressure(st, floats, pipe, p)
    for _ in range(50):
        v = flow / m
        step = (enthalpy(st, floats, p) + 0.5 * v * v - bernoulli) / (1.0 / density(st, floats, p) - v * v * dm / m)
        p -= step
        m, dm = mass_of_pressure(st, floats, pipe, p)
        if abs(step) <= 1e-15 * abs(p):
            break
    return m


@njit
def profile_along(st, floats, pipe, start, z, flow, faces, centers):
    """Profile of a pipe that its drag holds: d(h + v^2/2 + g z)/dx = -drag m_ref / m^2, by RK4 over half cells.

    start : h + v^2/2 + g z at the `from` end [J/kg]; z : elevation there. Fills mass per length at faces and
    centres [kg/m]; returns h + v^2/2 + g z at the other end.
    """
    pull = pipe["drag"] * st["rho"] * pipe["area"]
    g, half, b = st["gravity"], 0.5 * pipe["dx"], start
    m = mass_of_head(st, floats, pipe, b - g * z, flow)
    faces[0] = m
    for i in range(2 * centers.size):
        x = i * half
        k1 = -pull / (m * m)
        middle = g * (z + pipe["slope"] * (x + 0.5 * half))
        m = mass_of_head(st, floats, pipe, b + 0.5 * half * k1 - middle, flow)
        k2 = -pull / (m * m)
        m = mass_of_head(st, floats, pipe, b + 0.5 * half * k2 - middle, flow)
        k3 = -pull / (m * m)
        end = g * (z + pipe["slope"] * (x + half))
        m = mass_of_head(st, floats, pipe, b + half * k3 - end, flow)
        b += half * (k1 + 2.0 * k2 + 2.0 * k3 - pull / (m * m)) / 6.0
        m = mass_of_head(st, floats, pipe, b - end, flow)
        if i % 2 == 0:
            centers[i // 2] = m
        else:
            faces[i // 2 + 1] = m
    return b
