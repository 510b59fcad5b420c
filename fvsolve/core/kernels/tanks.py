"""Level of a tank from its stored mass, and event functions at its bottom and its rim.

A free tank fills and empties. A held tank keeps its level, and the deficit or surplus of flow is a supply. A tank that
leaves its limit is free again, though still there. Held and left are flags, so that each rule is smooth during a step.
"""

from math import sqrt

from fvsolve.jit import njit

EVENTS = 4  # events of a tank: held at its bottom, left again; held at its rim, left again
BOTTOM, RIM = 0, 2  # offsets of these events
NEAR = 1e-10  # distance at which a tank is at its limit [m]
# speed of the level below which a tank does not leave its limit; above rounding [m/s]
RETURN_SPEED = 1e-11
MIN_AREA = 1e-4  # least area [m2]
LEAST = 1e-300


@njit
def level_of_volume(floats, shape, rows, volume):
    """Level [m] of a shaped tank that contains `volume` [m3].

    The surface area is linear between levels, so the volume is a quadratic there; beyond the table the tank is a prism.
    floats[shape:] holds `rows` levels [m], areas [m2] and volumes below them [m3].
    """
    k = 0
    while k < rows - 2 and volume >= floats[shape + 2 * rows + k + 1]:
        k += 1
    z0, z1 = floats[shape + k], floats[shape + k + 1]
    a0, a1 = floats[shape + rows + k], floats[shape + rows + k + 1]
    rest = volume - floats[shape + 2 * rows + k]
    # Below the lowest level the tank is a prism, or has no area at all.
    if rest <= 0.0:
        return z0 + rest / a0 if a0 > 0.0 else z0
    top = floats[shape + 3 * rows - 1]
    if volume > top:
        last = floats[shape + 2 * rows - 1]
        return floats[shape + rows - 1] + (volume - top) / last
    growth = (a1 - a0) / (z1 - z0)
    # This form of the root also holds for a constant area and for an area of zero at the lower level.
    return z0 + 2.0 * rest / (a0 + sqrt(max(a0 * a0 + 2.0 * growth * rest, 0.0)))


@njit(forceinline=True)
def tank_level(node, floats, rho, stored):
    """Level [m] of a tank whose mass differs by `stored` [kg] from its initial steady mass.

    node : row of the tank in the table of nodes; rho : density of its fluid [kg/m3]
    """
    if node["shape"] < 0:
        return node["level"] + stored / (rho * node["area"])
    return level_of_volume(floats, node["shape"], node["shapes"], (node["mass"] + stored) / rho)


@njit(forceinline=True)
def mass_per_metre(node):
    """Mass per metre of water level of a tank [kg/m], with an area of at least MIN_AREA."""
    return node["density"] * max(node["area"], MIN_AREA)


@njit(forceinline=True)
def is_near(node, distance):
    """True if a tank is at its bottom or its rim, to within the tolerance NEAR of its level.

    distance : stored mass between the tank and this limit [kg]
    """
    return distance <= NEAR * mass_per_metre(node)


@njit
def limit_events(node, armed, g, k, distance, away):
    """Write two event functions of a tank: g[k] for being held at a limit (bottom or rim), g[k + 1] for leaving it.

    distance : stored mass between the tank and the limit [kg]; away : net flow away from the limit [kg/s]
    armed : flags; armed[k] > 0 while the tank is held, armed[k + 1] > 0 after it has left the limit
    """
    if not is_near(node, distance):
        g[k] = g[k + 1] = distance
    elif armed[k] > 0.0:
        over = away - RETURN_SPEED * mass_per_metre(node)
        # With a zero both functions would count as crossed, and the tank would be held and free at once.
        over = LEAST if over == 0.0 else over
        g[k], g[k + 1] = over, -over
    elif armed[k + 1] > 0.0 and distance <= 0.0:
        g[k], g[k + 1] = away, -1.0
    else:
        g[k], g[k + 1] = distance, 1.0


def overshoot_correction(node, armed, stored: float) -> float:
    """Mass [kg] to add to a held tank that event location has left below its bottom or above its rim; else 0.

    armed : event flags, which are positive while a tank is held; stored : present mass of the tank [kg]
    """
    k = EVENTS * int(node["row"])
    if armed[k + BOTTOM] > 0.0 and stored < 0.0 and is_near(node, -stored):
        return -stored
    distance = float(node["full"]) - stored
    return distance if armed[k + RIM] > 0.0 and distance < 0.0 and is_near(node, -distance) else 0.0
