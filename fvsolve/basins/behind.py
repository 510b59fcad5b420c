"""Cells next to a patch, and their weights in the flow through it."""

from fvsolve.jit import njit

SHALLOW = 1e-3  # depth at a patch below which only a fraction of the demanded outflow can leave [m]
HARDLY = 1e-9  # volume at a patch over its area below which its surface tends to the lowest bed [m]


@njit
def to_be_had(depth):
    """Fraction of the demanded outflow that water of a depth supplies."""
    s = min(max(depth, 0.0) / SHALLOW, 1.0)
    return s * s * (3.0 - 2.0 * s)


@njit(forceinline=True)
def area_of(tables, patch):
    """Area of the cells next to a patch [m2]."""
    return tables.plane[patch["sizes"]]


@njit(forceinline=True)
def length_of(tables, patch):
    """Length of the faces of a patch [m]."""
    return tables.plane[patch["sizes"] + 1]


@njit
def depth_behind(plane, basin, i, y):
    """Depth of cell i of a basin of water."""
    return max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)


@njit
def weight_out(depth):
    """Weight of a cell in the outflow: its depth, so that all water has one speed, times the available fraction."""
    return depth * to_be_had(depth)


@njit
def weight(plane, basin, leaves, i, y):
    """Weight of cell i in the flow through a patch [m]; for inflow, a dry cell has the depth of a film."""
    depth = depth_behind(plane, basin, i, y)
    return weight_out(depth) if leaves else max(depth, SHALLOW)


@njit
def counted(tables, patch, leaves, y):
    """Sum of area times `weight` of the cells next to a patch [m3], always positive."""
    basin, plane, total = tables.basins[patch["basin"]], tables.plane, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += plane[basin["area"] + i] * weight(plane, basin, leaves, i, y)
    return max(total, HARDLY * area_of(tables, patch))


@njit(forceinline=True)
def is_given(basin):
    """True if flows through faces are those of a given velocity, in `plane`; computed flows are in `work`."""
    return basin["given"] == 1


@njit
def through_patch(tables, patch):
    """Total inflow through all faces of a patch."""
    basin, total = tables.basins[patch["basin"]], 0.0
    flows = tables.plane if is_given(basin) else tables.work
    for m in range(patch["faces"]):
        total += flows[basin["through"] + tables.integers[patch["ring"] + m]]
    return total
