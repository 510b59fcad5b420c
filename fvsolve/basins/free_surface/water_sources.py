"""Rain on water with a free surface, and infiltration into the soil below.

The depth h grows at R - f, with the rate of rain R(t) and the infiltration f = min(f_p, R + h / DRAIN_TIME), so that no
depth falls below zero in steps up to DRAIN_TIME. The infiltration capacity f_p [m/s] of a soil is a constant, Horton's
(1933) f_1 + (f_0 - f_1) exp(-k t) with the time t since the start of the run, or Green and Ampt's (1911)
K (1 + psi d / F) with conductivity K, suction psi, moisture deficit d and infiltrated height F.
"""

from math import exp

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import GREEN_AMPT, HORTON
from fvsolve.kernels.schedule_pieces import schedule_value

DRAIN_TIME = 10.0  # [s]
SOIL_ROWS = 3  # rows of the numbers of a soil in `plane`
TINY = 1e-300


@njit
def rain_rate(tables, basin, t):
    """Rate of rain on a basin at time t [m/s]."""
    return schedule_value(tables, basin["rain"], t) if basin["rain"] >= 0 else 0.0


@njit
def begin_rain(tables, basin, t, dydt, out):
    """Write the rate of rain to `work`, its mass flow to the ledger, and the rate of the height of rain to `dydt`."""
    if basin["rain"] >= 0:
        rate = rain_rate(tables, basin, t)
        tables.work[basin["present_rain"]] = rate
        out[tables.layout[0]["source"] + basin["source"]] = tables.settings[0]["rho"] * rate * basin["total_area"]
        if dydt.size > 0:
            dydt[basin["rained"]] = rate


@njit
def add_rain(tables, basin, rates):
    """Add the rate of rain to rates of depth."""
    if basin["rain"] >= 0:
        rate = tables.work[basin["present_rain"]]
        for i in range(rates.size):
            rates[i] += rate


@njit
def put_infiltration(kind, soil, time, rain, depth0, dh, heights, rates):
    """Write the rates of infiltration in cells [m/s].

    kind : CONSTANT_RATE, HORTON or GREEN_AMPT; time : since the start of the run [s]; rain : rate of rain [m/s]
    soil : float64[SOIL_ROWS, n]  rate; first rate, last rate and decay; or conductivity, suction and moisture deficit
    depth0, dh, heights : depth at rest, deviation from it, and infiltrated heights [m]
    """
    n = rates.size
    a, b, c = soil[:n], soil[n : 2 * n], soil[2 * n : 3 * n]
    if kind == GREEN_AMPT:
        for i in range(n):
            rates[i] = a[i] * (1.0 + b[i] * c[i] / (max(heights[i], 0.0) + TINY))
    elif kind == HORTON:
        decay, decayed = 0.0, 1.0
        for i in range(n):
            if c[i] != decay:  # an exponential costs ten times as much
                decay, decayed = c[i], exp(-c[i] * time)
            rates[i] = b[i] + (a[i] - b[i]) * decayed
    else:
        for i in range(n):
            rates[i] = a[i]
    for i in range(n):
        rates[i] = min(rates[i], rain + max(depth0[i] + dh[i], 0.0) * (1.0 / DRAIN_TIME))


@njit
def infiltrate(tables, basin, t, y, rates):
    """Write the rates of infiltration in the cells of a basin to `rates` [m/s]; return their sum [m3/s]."""
    n, at = basin["n"], basin["soil_numbers"]
    soil, depth0 = tables.plane[at : at + SOIL_ROWS * n], tables.plane[basin["plan"] : basin["plan"] + n]
    dh, heights = y[basin["y"] : basin["y"] + n], y[basin["infiltrated"] : basin["infiltrated"] + n]
    time, area = t - tables.settings[0]["start"], tables.plane[basin["area"] : basin["area"] + n]
    put_infiltration(basin["soil"], soil, time, rain_rate(tables, basin, t), depth0, dh, heights, rates)
    return sum_of_products(rates, area)


@njit
def sum_of_products(a, b):
    """Sum of the products of the entries of two arrays, in four partial sums, which the processor adds side by side."""
    sums, last = (0.0, 0.0, 0.0, 0.0), a.size // 4 * 4
    for i in range(0, last, 4):
        sums = (sums[0] + a[i] * b[i], sums[1] + a[i + 1] * b[i + 1], sums[2] + a[i + 2] * b[i + 2],
                sums[3] + a[i + 3] * b[i + 3])  # fmt: skip
    total = (sums[0] + sums[1]) + (sums[2] + sums[3])
    for i in range(last, a.size):
        total += a[i] * b[i]
    return total


@njit
def add_infiltration(tables, basin, t, y, dydt, out):
    """Subtract the infiltration from the rates of depth, and write the rates of infiltrated heights.

    The mass flow into the soil is written to the ledger.
    """
    if dydt.size > 0:
        n, o = basin["n"], basin["y"]
        rates, to_depth = dydt[basin["infiltrated"] : basin["infiltrated"] + n], dydt[o : o + n]
        total = infiltrate(tables, basin, t, y, rates)
        for i in range(n):
            to_depth[i] -= rates[i]
        at = tables.layout[0]["source"] + basin["source"] + (basin["rain"] >= 0)
        out[at] = -tables.settings[0]["rho"] * total
