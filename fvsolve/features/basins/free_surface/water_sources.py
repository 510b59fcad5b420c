"""Rain on water with a free surface, and infiltration into the soil below.

The depth h grows at R - f, with the rate of rain R and the infiltration f = min(f_p, R + h / DRAIN_TIME), so that no
depth falls below zero in steps up to DRAIN_TIME. R is uniform, or linear in time between frames of rates in cells. The
infiltration capacity f_p [m/s] of a soil is a constant, Horton's (1933) f_1 + (f_0 - f_1) exp(-k T), or Green and
Ampt's (1911) K (1 + S / F) with conductivity K, S the product of suction and moisture deficit, and the infiltrated
height F.

T is the condensed time of a cell: in this time the height F would infiltrate at capacity (Reeves and Miller 1975). It
is a state with the rate f / f_p, so that the capacity falls with the infiltrated height; under light rain it falls
little. Green and Ampt's F(T) is the root of q(F) = F - S ln(1 + F / S) = K T. Its slope is infinite at T = 0, where no
step could follow f_p(F). While T is below EARLY, the rate is therefore multiplied by 1 + (T - q(F) / K) g, with g from
1 / s at first to 1 / DRAIN_TIME: F returns to F(T) from any error of the first steps. This rate is at most twice what
the next DRAIN_TIME needs, by the bound F(T) <= sqrt(2 S K T) + K T. A supply s, above this bound, limits the
infiltration in the first instant only, until F = K S / s: time then lags by K S / (2 s^2). From EARLY on F alone gives
the capacity, and T stays as it is.

A curve number gives F = P S / (P + S) of the rain P, with the potential storage S. So f = R (1 - F / S)^2, without P.
The rain fills an initial loss first. Water that stands does not infiltrate by this law.
"""

from math import exp, log1p, sqrt

from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.features.basins.tables import CONSTANT_RATE, CURVE_NUMBER, GREEN_AMPT, HORTON, NO_SOIL
from fvsolve.jit import njit

DRAIN_TIME = 10.0  # [s]
EARLY = 20.0 * DRAIN_TIME  # condensed time in which errors of the first steps vanish [s]
FIRST = 2.0  # condensed time in which a lag of the first instant is spread [s]
TINY = 1e-300
UNKNOWN = -1.0  # in place of the rate of a condensed time
# Numbers in `work`: mean rate of rain [m/s]; position among the frames of rain
RATE_OF_RAIN, POSITION = range(2)
PRESENT_NUMBERS = 2
# cells for which all loops run in turn, so that their arrays stay in the first-level cache
CHUNK = 512


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
    present = tables.work[basin["present"] :]
    present[RATE_OF_RAIN] = rain_rate(tables, basin, t)
    if basin["frames"] > 0:
        present[POSITION] = schedule_value(tables, basin["frame_position"], t)


@njit
def begin_sources(tables, basin, t, dydt, out):
    """Write the numbers of rain and soil to `work`, the mass flow of rain to the ledger, and the rate of its height."""
    if has_sources(basin):
        write_present_sources(tables, basin, t)
    if basin["rain"] >= 0:
        rate = tables.work[basin["present"] + RATE_OF_RAIN]
        out[tables.layout[0]["source"] + basin["source"]] = (
            tables.settings[0]["rho"] * rate * basin["total_area"]
        )
        if dydt.size > 0:
            dydt[basin["rained"]] = rate


@njit
def uniform_rate(tables, basin):
    """Rate of rain that is the same in all cells [m/s], after `write_present_sources`; 0 for frames."""
    return (
        tables.work[basin["present"] + RATE_OF_RAIN]
        if basin["rain"] >= 0 and basin["frames"] == 0
        else 0.0
    )


@njit
def add_frames(tables, basin, first, rates):
    """Add the rate of rain between two frames to rates [m/s] of cells from number `first` on."""
    n = basin["n"]
    count = rates.size
    position = tables.work[basin["present"] + POSITION]
    k = int(position)
    share, at = min(position - k, 1.0), basin["frame_rates"] + first
    before = tables.plane[at + k * n : at + k * n + count]
    k = min(k + 1, basin["frames"] - 1)
    after, rest = tables.plane[at + k * n : at + k * n + count], 1.0 - share
    for i in range(count):
        rates[i] += rest * before[i] + share * after[i]


@njit(forceinline=True)
def has_condensed_times(basin):
    """True if cells of a basin have condensed times, which follow their infiltrated heights."""
    return basin["soil"] == HORTON or basin["soil"] == GREEN_AMPT


@njit
def limit_by_horton(soil, supply, times, rates, aging):
    """Write rates of infiltration [m/s] and of condensed times by Horton's law; arguments as for `limit_infiltration`.

    soil : final rate f_1, its difference from the first f_0 - f_1, decay k
    """
    final, more, decay = soil
    for i in range(rates.size):
        capacity = final[i] + more[i] * exp(-decay[i] * times[i])
        rates[i] = min(capacity, supply[i])
        aging[i] = rates[i] / max(capacity, TINY)


@njit
def limit_by_curve_number(soil, rain, heights, rates):
    """Write rates of infiltration [m/s] by the curve number of the SCS.

    soil : potential storage S, initial loss, both [m]; rain : rates of rain [m/s]; heights : infiltrated [m]
    """
    storage, loss, _ = soil
    for i in range(rates.size):
        height = heights[i] - loss[i]  # above the initial loss
        if storage[i] > 0.0:
            free = min(max(1.0 - height / storage[i], 0.0), 1.0)
        else:
            free = 1.0 if height < 0.0 else 0.0
        rates[i] = rain[i] * free * free


@njit
def limit_by_green_ampt(soil, supply, heights, times, rates, aging):
    """Write rates of infiltration [m/s] and of condensed times by Green and Ampt's law.

    soil : K, S, and the height that infiltrates in EARLY; other arguments as for `limit_infiltration`
    """
    k, s, early = soil
    least = 1e300
    for i in range(rates.size):
        rates[i] = min(k[i] + k[i] * s[i] / max(heights[i], TINY), supply[i])
        aging[i] = 0.0
        least = min(least, heights[i] - early[i])
    if least < 0.0:
        limit_early(soil, supply, heights, times, rates, aging)


@njit
def limit_early(soil, supply, heights, times, rates, aging):
    """Replace the rates of `limit_by_green_ampt` in cells whose condensed time is below EARLY."""
    k, s, early = soil
    for i in range(rates.size):
        # A lower bound of the capacity, as 2 x / (2 + x) is one of the logarithm: most cells take the whole supply.
        height, time = max(heights[i], TINY), max(times[i], 0.0)
        ratio, steeper = height / max(s[i], TINY), 1.0 + s[i] / height
        lag = k[i] * times[i] - height * (ratio / (2.0 + ratio))
        least = min(steeper * (k[i] + lag * gain(time)), most_early(k[i], s[i], time, height))
        takes_all, is_early = least > supply[i], heights[i] < early[i]
        rates[i] = supply[i] if is_early and takes_all else rates[i]
        slow = min(supply[i] / max(steeper * k[i], TINY), 1.0)
        aging[i] = (slow if takes_all else UNKNOWN) if is_early else 0.0
    for i in range(rates.size):
        if aging[i] == UNKNOWN:
            height = max(heights[i], TINY)
            store = max(s[i], TINY)
            time = max(times[i], 0.0)
            steeper = 1.0 + s[i] / height
            # by the lag of the height behind its condensed time
            lag = k[i] * times[i] - (height - store * log1p(height / store))
            capacity = min(
                steeper * (k[i] + lag * gain(time)), most_early(k[i], s[i], time, height)
            )
            rates[i] = min(max(capacity, 0.0), supply[i])
            if capacity <= supply[i]:  # at capacity time passes, less the lag of the first instant
                lost = min(0.5 * k[i] * store / max(supply[i] * supply[i], TINY), FIRST)
                aging[i] = 1.0 - lost * (1.0 / FIRST) * exp(-times[i] * (1.0 / FIRST))
            else:
                aging[i] = min(supply[i] / max(steeper * k[i], TINY), 1.0)


@njit(forceinline=True)
def gain(time):
    """Rate at which a height returns to that of its condensed time [1/s]."""
    return max(1.0 / DRAIN_TIME, 3.0 / (3.0 + time))


@njit(forceinline=True)
def most_early(k, s, time, height):
    """Greatest rate of infiltration [m/s]: twice what the next DRAIN_TIME needs."""
    ahead = k * (time + DRAIN_TIME)
    return (sqrt(2.0 * max(s, TINY) * ahead) + ahead - height) * (2.0 / DRAIN_TIME)


@njit
def limit_infiltration(kind, soil, states, supply, rates, aging):
    """Write rates of infiltration [m/s] in cells, and the rates of their condensed times.

    kind : CONSTANT_RATE, HORTON, GREEN_AMPT or CURVE_NUMBER; soil : three arrays, the constant rate in the first
    states : infiltrated heights [m], condensed times [s]; supply : rain plus the water that can drain
    [m/s], the rain alone for CURVE_NUMBER
    """
    heights, times = states
    if kind == GREEN_AMPT:
        limit_by_green_ampt(soil, supply, heights, times, rates, aging)
    elif kind == HORTON:
        limit_by_horton(soil, supply, times, rates, aging)
    elif kind == CURVE_NUMBER:
        limit_by_curve_number(soil, supply, heights, rates)
    elif kind == CONSTANT_RATE:
        for i in range(rates.size):
            rates[i] = min(soil[0][i], supply[i])


@njit
def put_infiltration(tables, basin, first, y, rates, aging):
    """Write rates in at most CHUNK cells from number `first` on: of infiltration [m/s], of condensed times.

    `write_present_sources` must run before. Numbers of a uniform soil are those of CHUNK cells.
    """
    plane = tables.plane
    row = basin["soil_row"]
    count = rates.size
    n = basin["n"]
    at = basin["soil_numbers"] + (first if row == n else 0)
    soil = (
        plane[at : at + count],
        plane[at + row : at + row + count],
        plane[at + 2 * row : at + 2 * row + count],
    )
    depth0, dh = plane[basin["plan"] + first :][:count], y[basin["y"] + first :][:count]
    rate, heights = uniform_rate(tables, basin), y[basin["infiltrated"] + first :][:count]
    times = y[basin["infiltrated"] + n + first :][: count if has_condensed_times(basin) else 0]
    supply = tables.work[basin["soil_work"] + 2 * n :][:count]
    for i in range(count):
        supply[i] = rate
    if basin["frames"] > 0:
        add_frames(tables, basin, first, supply)
    if basin["soil"] != CURVE_NUMBER:
        for i in range(count):
            supply[i] += max(depth0[i] + dh[i], 0.0) * (1.0 / DRAIN_TIME)
    limit_infiltration(basin["soil"], soil, (heights, times), supply, rates, aging)


@njit
def add_sources(tables, b, a, z, y, rates):
    """Add rain to the rates of depth of cells `a` to `z` - 1 of basin b, subtract infiltration, and write its rates.

    rates : of depth, of both unit flows, of infiltrated heights (empty without a soil), and of condensed times (empty
    if the soil has none) in all cells, five arrays
    """
    basin = tables.basins[b]
    rate = uniform_rate(tables, basin)
    for first in range(a, z, CHUNK):
        last = min(first + CHUNK, z)
        to_depth, taken = rates[0][first:last], rates[3][first:last]
        if basin["frames"] > 0:
            add_frames(tables, basin, first, to_depth)
        if taken.size > 0:
            put_infiltration(tables, basin, first, y, taken, rates[4][first:last])
            for i in range(taken.size):
                to_depth[i] += rate - taken[i]
        else:
            for i in range(to_depth.size):
                to_depth[i] += rate


@njit
def infiltration(tables, basin, t, y):
    """Flow into the soil of a basin at time t [m3/s]."""
    n = basin["n"]
    rates, aging = tables.work[basin["soil_work"] :][:n], tables.work[basin["soil_work"] + n :][:n]
    write_present_sources(tables, basin, t)
    for first in range(0, n, CHUNK):
        last = min(first + CHUNK, n)
        put_infiltration(tables, basin, first, y, rates[first:last], aging[first:last])
    return sum_of_products(rates, tables.plane[basin["area"] : basin["area"] + n])


@njit
def sum_of_products(a, b):
    """Sum of the products of the entries of two arrays, in four partial sums, which the processor adds side by side."""
    sums, last = (0.0, 0.0, 0.0, 0.0), a.size // 4 * 4
    for i in range(0, last, 4):
        sums = (
            sums[0] + a[i] * b[i],
            sums[1] + a[i + 1] * b[i + 1],
            sums[2] + a[i + 2] * b[i + 2],
            sums[3] + a[i + 3] * b[i + 3],
        )
    total = (sums[0] + sums[1]) + (sums[2] + sums[3])
    for i in range(last, a.size):
        total += a[i] * b[i]
    return total
