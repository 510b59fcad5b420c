"""Level of a tank from its stored mass."""

from math import sqrt

from fvsolve.jit import njit


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
    if rest <= 0.0:
        return z0 + rest / a0 if a0 > 0.0 else z0
    top = floats[shape + 3 * rows - 1]
    if volume > top:
        last = floats[shape + 2 * rows - 1]
        return floats[shape + rows - 1] + (volume - top) / last
    growth = (a1 - a0) / (z1 - z0)
    return z0 + 2.0 * rest / (a0 + sqrt(max(a0 * a0 + 2.0 * growth * rest, 0.0)))


@njit(forceinline=True)
def tank_level(node, floats, rho, stored):
    """Level [m] of a tank whose mass differs by `stored` [kg] from its initial steady mass.

    node : row of the tank in the table of nodes; rho : density of its fluid [kg/m3]
    """
    if node["shape"] < 0:
        return node["level"] + stored / (rho * node["area"])
    return level_of_volume(floats, node["shape"], node["shapes"], (node["mass"] + stored) / rho)
