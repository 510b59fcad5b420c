"""Density law `table`: ln(rho / rho_ref) and enthalpy by cubic Hermite polynomials over pressure.

Beyond both ends of the table ln(rho / rho_ref) is linear in pressure, and the enthalpy is its exact integral.
"""

from math import exp, expm1

from fvsolve.core.kernels.calls import law_njit, prevent_inlining
from fvsolve.jit import njit


@njit(forceinline=True)
def hermite(floats, values, slopes, k, s, step):
    """Cubic Hermite polynomial at s in [0, 1] of interval k of a table, through two values with two slopes.

    values, slopes : offsets of the table's values and slopes in `floats`; step : width of the interval
    """
    r = 1.0 - s
    v0, v1 = floats[values + k], floats[values + k + 1]
    d0, d1 = floats[slopes + k] * step, floats[slopes + k + 1] * step
    return v0 + s * s * (3.0 - 2.0 * s) * (v1 - v0) + s * r * (r * d0 - s * d1)


@njit
def log_density(st, floats, p):
    """(ln(rho / rho_ref), d ln rho / dp [1/Pa]) at the pressure p [Pa], with density rho."""
    n = st["table_size"]
    o = st["table"]
    step = st["table_step"]
    x = (p - st["table_start"]) / step
    if x <= 0.0:
        return floats[o] + floats[o + n] * x * step, floats[o + n]
    # The end belongs to the line beyond it: there is no interval number n - 1.
    if x >= n - 1.0:
        return floats[o + n - 1] + floats[o + 2 * n - 1] * (x - (n - 1.0)) * step, floats[
            o + 2 * n - 1
        ]
    k = int(x)
    s = x - k
    value = hermite(floats, o, o + n, k, s, step)
    v0 = floats[o + k]
    v1 = floats[o + k + 1]
    d0 = floats[o + n + k]
    d1 = floats[o + n + k + 1]
    slope = (
        6.0 * s * (1.0 - s) * (v1 - v0) / step
        + (1.0 - s) * (1.0 - 3.0 * s) * d0
        + s * (3.0 * s - 2.0) * d1
    )
    return value, slope


@njit
def enthalpy(st, floats, p):
    """Specific enthalpy h at the pressure p: integral of dp / rho from the reference pressure [J/kg]."""
    n = st["table_size"]
    o = st["table"]
    step = st["table_step"]
    x = (p - st["table_start"]) / step
    k = 0 if x <= 0.0 else (n - 1 if x >= n - 1.0 else -1)
    if k >= 0:
        slope, rho = floats[o + n + k], st["rho"] * exp(floats[o + k])
        return floats[o + 2 * n + k] - expm1(-slope * (x - k) * step) / (slope * rho)
    k = int(x)
    return hermite(floats, o + 2 * n, o + 3 * n, k, x - k, step)


@law_njit
def pressure_of_enthalpy(st, floats, h):
    """Pressure [Pa] at which the specific enthalpy is h [J/kg], by Newton."""
    prevent_inlining()
    # Newton starts at constant density.
    p = st["reference"] + st["rho"] * h
    for _ in range(30):
        # dh/dp = 1 / rho
        step = (enthalpy(st, floats, p) - h) * (st["rho"] * exp(log_density(st, floats, p)[0]))
        p -= step
        if abs(step) <= 1e-15 * abs(p):
            break
    return p


@law_njit
def pressure_of_log(st, floats, compliance, q):
    """Pressure p [Pa] at which ln(rho / rho_ref) + compliance (p - p_ref) is q, by Newton, with density rho.

    compliance : relative area change of the wall per pressure [1/Pa]
    """
    prevent_inlining()
    # Newton starts at constant bulk modulus.
    p = st["reference"] + q / (1.0 / st["beta"] + compliance)
    for _ in range(30):
        value, slope = log_density(st, floats, p)
        step = (value + compliance * (p - st["reference"]) - q) / (slope + compliance)
        p -= step
        if abs(step) <= 1e-13 * (abs(p) + 1.0):
            break
    return p
