"""Which rule a tank follows at its bottom and at its rim, as event functions. Knows one tank; knows no links.

Free, it fills and empties. Held, it stays as it is whatever flows, and what is short or too much is supply. Left, it is
free again, though still at its end. Held and left are flags, so that the rule is one and smooth throughout a step.
"""

from fvsolve.jit import njit

EVENTS = 4  # of a tank: held at its bottom, left again; held at its rim, left again
BOTTOM, RIM = 0, 2
NEAR = 1e-10  # within this of its end [m]
SLIGHT = 1e-11  # of what flows back: less does not leave it, as rounding must not [m/s]
FLAT = 1e-4  # area below which none counts [m2]
LEAST = 1e-300


@njit(forceinline=True)
def base_mass(node):
    """Mass of a metre of a tank [kg/m], by its least area."""
    return node["density"] * max(node["area"], FLAT)


@njit(forceinline=True)
def near(node, room):
    """Whether a tank is at an end from which it is `room` [kg] away."""
    return room <= NEAR * base_mass(node)


@njit
def limit_events(node, armed, g, k, room, away):
    """g[k], g[k + 1]: until it is held at an end, until it is left; room [kg] to that end, `away` from it [kg/s]."""
    if not near(node, room):
        g[k] = g[k + 1] = room
    elif armed[k] > 0.0:
        over = away - SLIGHT * base_mass(node)
        over = LEAST if over == 0.0 else over
        g[k], g[k + 1] = over, -over
    elif armed[k + 1] > 0.0 and room <= 0.0:
        g[k], g[k + 1] = away, -1.0
    else:
        g[k], g[k + 1] = room, 1.0


def overshot(node, armed, stored: float) -> float:
    """What brings a tank back to an end that holds it, from where location has left it [kg]."""
    k = EVENTS * int(node["row"])
    if armed[k + BOTTOM] > 0.0 and stored < 0.0 and near(node, -stored):
        return -stored
    room = float(node["full"]) - stored
    return room if armed[k + RIM] > 0.0 and room < 0.0 and near(node, -room) else 0.0
