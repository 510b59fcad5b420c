"""Volume, free surface and first moment of a vessel below a level: prisms, cylinders at any slope, tables of areas.

For a cylinder with flat ends, radius R and length L, whose axis has the angle `slope` to the horizontal, the water
level z above the lowest point is the depth d = z / (R cos(slope)) at the lower end and d' = d - (L / R) tan(slope) at
the upper end, both in radii. S(d) is the area of the unit circle below depth d; T and U are its first and second
integral over d. Then the volume is V = R^3 cot(slope) (T(d) - T(d')), and dV/dz = R^2 (S(d) - S(d')) / sin(slope).
"""

from math import acos, cos, pi, sin, sqrt

from fvsolve.jit import njit
from fvsolve.kernels.network_energy import level_moment
from fvsolve.kernels.tanks import level_of_volume

KIND, FULL_LEVEL, FIRST_SIZE, SECOND_SIZE, THIRD_SIZE = 0, 1, 2, 3, 4
"""Numbers of a shape: its kind; the level at which it is full [m]; then an area [m2], or the radius [m], length [m] and
slope [rad] of a cylinder, or the number of levels, areas and volumes that follow."""
PRISM, HORIZONTAL_CYLINDER, INCLINED_CYLINDER, AREA_TABLE = 0, 1, 2, 3
NUMBER_COUNT = 5
LEAST_SURFACE = 1e-6  # of the mean surface: least slope dV/dz in the search for a level


@njit
def segment(d):
    """Area S(d) of the part of the unit circle that is filled to the depth d, from 0 (d <= 0) to pi (d >= 2)."""
    if d <= 0.0:
        return 0.0
    if d >= 2.0:
        return pi
    x = 1.0 - d
    return acos(x) - x * sqrt(d * (2.0 - d))


@njit
def segment_integral(d):
    """Integral T(d) of the area S (see `segment`) from depth 0 to d."""
    if d <= 0.0:
        return 0.0
    if d >= 2.0:
        return pi * (d - 1.0)
    x, s = 1.0 - d, sqrt(d * (2.0 - d))
    return s - s * s * s / 3.0 - x * acos(x)


@njit
def segment_double_integral(d):
    """Integral U(d) of T (see `segment_integral`) from depth 0 to d."""
    if d <= 0.0:
        return 0.0
    if d >= 2.0:
        return pi * (0.625 + 0.5 * d * (d - 2.0))
    x, s = 1.0 - d, sqrt(d * (2.0 - d))
    return (0.5 * x * x + 0.125) * acos(x) - 0.625 * x * s + x * s * s * s / 12.0


@njit
def cylinder_depths(floats, at, z):
    """(depth at the lower end, depth at the upper end, tangent of the slope) of an inclined cylinder filled to level z.

    Depths are in radii, relative to the lowest points of the ends; the upper depth may be negative.
    z : level above the lowest point [m]; floats[at:] : parameters of the shape, see `shape_numbers`
    """
    radius, length, slope = floats[at + FIRST_SIZE], floats[at + SECOND_SIZE], floats[at + THIRD_SIZE]
    tangent = sin(slope) / cos(slope)
    d = z / (radius * cos(slope))
    return d, d - length / radius * tangent, tangent


@njit
def volume_below(floats, at, z):
    """Volume of a vessel [m3] from its bottom to level z [m] above it; z must be within the vessel.

    floats[at:] : parameters of the shape, see `shape_numbers`
    """
    kind, first = int(floats[at + KIND]), floats[at + FIRST_SIZE]
    if kind == PRISM:
        return first * z
    if kind == HORIZONTAL_CYLINDER:
        return first * first * floats[at + SECOND_SIZE] * segment(z / first)
    if kind == INCLINED_CYLINDER:
        d, upper, tangent = cylinder_depths(floats, at, z)
        return first * first * first / tangent * (segment_integral(d) - segment_integral(upper))
    rows, o, k = int(first), at + NUMBER_COUNT, 0
    while k < rows - 2 and z >= floats[o + k + 1]:
        k += 1
    low, high = floats[o + rows + k], floats[o + rows + k + 1]
    s, span = z - floats[o + k], floats[o + k + 1] - floats[o + k]
    if s > span:
        return floats[o + 3 * rows - 1] + (s - span) * high
    return floats[o + 2 * rows + k] + s * (low + 0.5 * s * (high - low) / span)


@njit
def surface_at(floats, at, z):
    """Area of the free surface of a vessel [m2] at level z [m] above its bottom; arguments as for `volume_below`."""
    kind, first = int(floats[at + KIND]), floats[at + FIRST_SIZE]
    if kind == PRISM:
        return first
    if kind == HORIZONTAL_CYLINDER:
        d = z / first
        return 2.0 * first * floats[at + SECOND_SIZE] * sqrt(max(0.0, d * (2.0 - d)))
    if kind == INCLINED_CYLINDER:
        d, upper, _ = cylinder_depths(floats, at, z)
        return first * first * (segment(d) - segment(upper)) / sin(floats[at + THIRD_SIZE])
    rows, o, k = int(first), at + NUMBER_COUNT, 0
    while k < rows - 2 and z >= floats[o + k + 1]:
        k += 1
    low, high = floats[o + rows + k], floats[o + rows + k + 1]
    s = (z - floats[o + k]) / (floats[o + k + 1] - floats[o + k])
    return low + min(s, 1.0) * (high - low)


@njit
def moment_below(floats, at, z):
    """Integral of z dV in a vessel [m4] from its bottom to level z [m] above it; arguments as for `volume_below`."""
    kind, first = int(floats[at + KIND]), floats[at + FIRST_SIZE]
    if kind == PRISM:
        return 0.5 * first * z * z
    if kind == HORIZONTAL_CYLINDER:
        return z * volume_below(floats, at, z) - first * first * first * floats[at + SECOND_SIZE] * segment_integral(
            z / first
        )
    if kind == INCLINED_CYLINDER:
        d, upper, tangent = cylinder_depths(floats, at, z)
        difference = segment_double_integral(d) - segment_double_integral(upper)
        return z * volume_below(floats, at, z) - first**4 * cos(floats[at + THIRD_SIZE]) / tangent * difference
    return level_moment(floats, at + NUMBER_COUNT, int(first), z)


@njit
def level_at(floats, at, volume):
    """Level [m] above the bottom to which a fluid of a given volume [m3] fills a vessel.

    For cylinders it is found by Newton's method with bounds. floats, at : as for `volume_below`
    """
    kind = int(floats[at + KIND])
    if volume <= 0.0:
        return 0.0
    if kind == PRISM:
        return volume / floats[at + FIRST_SIZE]
    if kind == AREA_TABLE:
        return level_of_volume(floats, at + NUMBER_COUNT, int(floats[at + FIRST_SIZE]), volume)
    low, high = 0.0, floats[at + FULL_LEVEL]
    total = pi * floats[at + FIRST_SIZE] ** 2 * floats[at + SECOND_SIZE]
    z, least = high * min(volume / total, 1.0), LEAST_SURFACE * total / high
    for _ in range(100):
        excess = volume_below(floats, at, z) - volume
        if excess > 0.0:
            high = z
        else:
            low = z
        next_z = z - excess / max(surface_at(floats, at, z), least)
        if not low <= next_z <= high:
            next_z = 0.5 * (low + high)
        if abs(next_z - z) <= 2e-16 * floats[at + FULL_LEVEL]:
            return next_z
        z = next_z
    return z
