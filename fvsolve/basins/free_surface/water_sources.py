"""Rain on water with a free surface, and infiltration into the soil below.

The depth h grows at R - f, with the rate of rain R and the infiltration f = min(f_p, R + h / DRAIN_TIME), so that no
depth falls below zero in steps up to DRAIN_TIME. R is uniform, or linear in time between frames of rates in cells. The
infiltration capacity f_p [m/s] of a soil is a constant, Horton's (1933) f_1 + (f_0 - f_1) exp(-k t) with the time t
since the start of the run, or Green and Ampt's (1911) K (1 + psi d / F) with conductivity K, suction psi, moisture
deficit d and infiltrated height F.
"""

from math import exp

from fvsolve.jit import njit
from fvsolve.kernels.dtypes import CONSTANT_RATE, GREEN_AMPT, HORTON, HORTON_FIELDS, NO_SOIL
from fvsolve.kernels.schedule_pieces import schedule_value

DRAIN_TIME = 10.0  # [s]
TINY = 1e-300
# Numbers in `work`: mean rate of rain [m/s]; position among the frames of rain; factor exp(-k t) of Horton, or the time
# since the start of the run [s]
RATE_OF_RAIN, POSITION, FACTOR = range(3)
PRESENT_NUMBERS = 3
CHUNK = 512  # cells for which all loops run in turn, so that their arrays stay in the first-level cache


@njit(forceinline=True)
def has_sources(basin):
    """True if rain falls on a basin, or a soil takes its water."""
    return basin["rain"] >= 0 or basin["soil"] != NO_SOIL


@njit
def rain_rate(tables, basin, t):
    """Mean rate of rain on a basin at time t [m/s]."""
    return schedule_value(tables, basin["rain"], t) if basin["rain"] >= 0 else 0.0


@njit
def write_present_sources(tables, basin, t):
    """Write the numbers of rain and soil at time t to `work`."""
    present, numbers, time = tables.work[basin["present"] :], basin["soil_numbers"], t - tables.settings[0]["start"]
    present[RATE_OF_RAIN] = rain_rate(tables, basin, t)
    if basin["frames"] > 0:
        present[POSITION] = schedule_value(tables, basin["frame_position"], t)
    if basin["soil"] == HORTON:
        present[FACTOR] = exp(-tables.plane[numbers + 2 * basin["soil_row"]] * time)
    elif basin["soil"] == HORTON_FIELDS:
        present[FACTOR] = time


@njit
def begin_sources(tables, basin, t, dydt, out):
    """Write the numbers of rain and soil to `work`, the mass flow of rain to the ledger, and the rate of its height."""
    if has_sources(basin):
        write_present_sources(tables, basin, t)
    if basin["rain"] >= 0:
        rate = tables.work[basin["present"] + RATE_OF_RAIN]
        out[tables.layout[0]["source"] + basin["source"]] = tables.settings[0]["rho"] * rate * basin["total_area"]
        if dydt.size > 0:
            dydt[basin["rained"]] = rate


@njit
def uniform_rate(tables, basin):
    """Rate of rain that is the same in all cells [m/s], after `write_present_sources`; 0 for frames."""
    return tables.work[basin["present"] + RATE_OF_RAIN] if basin["rain"] >= 0 and basin["frames"] == 0 else 0.0


@njit
def add_frames(tables, basin, first, rates):
    """Add the rate of rain between two frames to rates [m/s] of cells from number `first` on."""
    n, count, position = basin["n"], rates.size, tables.work[basin["present"] + POSITION]
    k = int(position)
    share, at = min(position - k, 1.0), basin["frame_rates"] + first
    before = tables.plane[at + k * n : at + k * n + count]
    k = min(k + 1, basin["frames"] - 1)
    after, rest = tables.plane[at + k * n : at + k * n + count], 1.0 - share
    for i in range(count):
        rates[i] += rest * before[i] + share * after[i]


@njit
def limit_infiltration(kind, soil, factor, depth0, dh, heights, rates):
    """Replace rates of rain in cells by rates of infiltration [m/s].

    kind : CONSTANT_RATE, HORTON, HORTON_FIELDS or GREEN_AMPT; factor : exp(-k t), for HORTON_FIELDS the time [s]
    soil : three arrays: the rate; final rate, its difference from the first, and decay; or K and K psi d
    depth0, dh, heights : depth at rest, deviation from it, and infiltrated heights [m]
    """
    a, b, c = soil
    n = rates.size
    if kind == GREEN_AMPT:
        for i in range(n):
            capacity = a[i] + b[i] / max(heights[i], TINY)
            rates[i] = min(capacity, rates[i] + max(depth0[i] + dh[i], 0.0) * (1.0 / DRAIN_TIME))
    elif kind == HORTON:
        for i in range(n):
            capacity = a[i] + b[i] * factor
            rates[i] = min(capacity, rates[i] + max(depth0[i] + dh[i], 0.0) * (1.0 / DRAIN_TIME))
    elif kind == HORTON_FIELDS:
        for i in range(n):
            capacity = a[i] + b[i] * exp(-c[i] * factor)
            rates[i] = min(capacity, rates[i] + max(depth0[i] + dh[i], 0.0) * (1.0 / DRAIN_TIME))
    elif kind == CONSTANT_RATE:
        for i in range(n):
            rates[i] = min(a[i], rates[i] + max(depth0[i] + dh[i], 0.0) * (1.0 / DRAIN_TIME))


@njit
def put_infiltration(tables, basin, first, y, rates):
    """Write the rates of infiltration in at most CHUNK cells from number `first` on [m/s].

    `write_present_sources` must run before. Numbers of a uniform soil are those of CHUNK cells.
    """
    plane, row, count, present = tables.plane, basin["soil_row"], rates.size, tables.work[basin["present"] :]
    at = basin["soil_numbers"] + (first if row == basin["n"] else 0)
    soil = plane[at : at + count], plane[at + row : at + row + count], plane[at + 2 * row : at + 2 * row + count]
    depth0, dh = plane[basin["plan"] + first :][:count], y[basin["y"] + first :][:count]
    rate, heights = uniform_rate(tables, basin), y[basin["infiltrated"] + first :][:count]
    for i in range(count):
        rates[i] = rate
    if basin["frames"] > 0:
        add_frames(tables, basin, first, rates)
    limit_infiltration(basin["soil"], soil, present[FACTOR], depth0, dh, heights, rates)


@njit
def add_sources(tables, b, a, z, y, rates):
    """Add rain to the rates of depth of cells `a` to `z` - 1 of basin b, subtract infiltration, and write its rates.

    rates : of depth, of both unit flows, and of infiltrated heights (empty without a soil) in all cells, four arrays
    """
    basin = tables.basins[b]
    rate = uniform_rate(tables, basin)
    for first in range(a, z, CHUNK):
        last = min(first + CHUNK, z)
        to_depth, taken = rates[0][first:last], rates[3][first:last]
        if basin["frames"] > 0:
            add_frames(tables, basin, first, to_depth)
        if taken.size > 0:
            put_infiltration(tables, basin, first, y, taken)
            for i in range(taken.size):
                to_depth[i] += rate - taken[i]
        else:
            for i in range(to_depth.size):
                to_depth[i] += rate


@njit
def infiltration(tables, basin, t, y):
    """Flow into the soil of a basin at time t [m3/s]."""
    n = basin["n"]
    rates = tables.work[basin["soil_work"] :][:n]
    write_present_sources(tables, basin, t)
    for first in range(0, n, CHUNK):
        put_infiltration(tables, basin, first, y, rates[first : min(first + CHUNK, n)])
    return sum_of_products(rates, tables.plane[basin["area"] : basin["area"] + n])


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
