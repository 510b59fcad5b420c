"""Electric energy of a pump: power by its overall efficiency, and rates of the states that add it up.

P = rho g |q H| / e, with flow q, head H and overall efficiency e, the hydraulic power over the electric power. A number
e holds at every flow. Points (flow, e) hold at relative speed n = 1: e is linear between them and constant beyond, at
the flow q / n. At other speeds 1 - e is that of the points times n^-0.1 (Sarbu and Borza 1998), as in EPANET.

Numbers, from `at` on: schedule of the price [1/kWh], flow regarded as zero [m3/s], device of the next pump or -1, count
of points, then their flows and efficiencies; without points a single efficiency.
States, in the order of `energy_use.STATES`: time of operation [s], integrals of e [s] and of P / q [J s/m3] over it,
electric energy [J], cost [-].
"""

from fvsolve.jit import njit

PRICE, REST, NEXT, COUNT, POINTS = range(5)
LEAST_EFFICIENCY = 0.01  # as in EPANET
SPEED_EXPONENT = 0.1
KWH = 3.6e6  # [J]


@njit
def overall_efficiency(floats, at, speed, flow):
    """Overall efficiency of a pump at a relative speed above 0 and a flow [m3/s]."""
    count, flows = int(floats[at + COUNT]), at + POINTS
    if count == 0:
        return floats[flows]
    x, values = abs(flow) / speed, flows + count
    k = 0
    while k < count and x > floats[flows + k]:
        k += 1
    if k == 0 or k == count:
        value = floats[values + min(k, count - 1)]
    else:
        share = (x - floats[flows + k - 1]) / (floats[flows + k] - floats[flows + k - 1])
        value = floats[values + k - 1] + share * (floats[values + k] - floats[values + k - 1])
    return max(LEAST_EFFICIENCY, min(1.0, 1.0 - (1.0 - value) * speed**-SPEED_EXPONENT))


@njit
def energy_per_volume(floats, at, speed, flow, head, weight):
    """(electric energy per volume [J/m3], overall efficiency); both are 0 for a pump that does not run.

    speed : relative; flow [m3/s]; head [m]; weight : rho g [N/m3]
    """
    if speed <= 0.0 or abs(flow) <= floats[at + REST]:
        return 0.0, 0.0
    e = overall_efficiency(floats, at, speed, flow)
    return weight * abs(head) / e, e


@njit
def rates(per, e, flow, price, dydt, first):
    """Write the rates of the five states to `dydt` from `first` on.

    per, e : results of `energy_per_volume`; flow : size of the flow [m3/s]; price : [1/kWh]
    """
    dydt[first] = 1.0 if e > 0.0 else 0.0
    dydt[first + 1] = e
    dydt[first + 2] = per
    dydt[first + 3] = per * flow
    dydt[first + 4] = price * per * flow / KWH
