"""Cells of basins next to a patch, with their weights in the flow through the patch, and cells of bands of rows.

A band is a range of rows of cells that one thread steps.
"""

from fvsolve.jit import njit

SHALLOW = 1e-3  # depth at a patch below which only a fraction of the demanded outflow can leave [m]
# volume at a patch over its area below which its surface tends to the lowest bed [m]
LEAST_DEPTH = 1e-9
# rows beyond a band that its rates read: three, or the five of the boundary closure of a liquid
BAND_MARGIN = 5


@njit
def available_fraction(depth):
    """Fraction of the demanded outflow that water of a depth [m] supplies: 0 at depth 0 to 1 at the depth SHALLOW."""
    s = min(max(depth, 0.0) / SHALLOW, 1.0)
    return s * s * (3.0 - 2.0 * s)


@njit(forceinline=True)
def patch_area(tables, patch):
    """Area of the cells next to a patch [m2]."""
    return tables.plane[patch["sizes"]]


@njit(forceinline=True)
def patch_length(tables, patch):
    """Length of the faces of a patch [m]."""
    return tables.plane[patch["sizes"] + 1]


@njit
def depth_at_patch(plane, basin, i, y):
    """Depth of cell i of a basin with a free surface [m]."""
    return max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)


@njit
def outflow_weight(depth):
    """Weight [m] of a cell of a depth [m] in the outflow through a patch: its depth times `available_fraction`.

    With the depth as factor, the water of all cells leaves at one speed.
    """
    return depth * available_fraction(depth)


@njit
def flow_weight(plane, basin, leaves, i, y):
    """Weight of cell i in the flow through a patch [m].

    It is `outflow_weight` for outflow (`leaves` is True). For inflow it is the depth, but at least SHALLOW.
    """
    depth = depth_at_patch(plane, basin, i, y)
    return outflow_weight(depth) if leaves else max(depth, SHALLOW)


@njit
def weighted_volume(tables, patch, leaves, y):
    """Sum of area times `flow_weight` over the cells at a patch [m3], at least LEAST_DEPTH times their area.

    leaves : True for outflow
    """
    basin = tables.basins[patch["basin"]]
    plane = tables.plane
    total = 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += plane[basin["area"] + i] * flow_weight(plane, basin, leaves, i, y)
    return max(total, LEAST_DEPTH * patch_area(tables, patch))


@njit(forceinline=True)
def has_given_flows(basin):
    """True if the flows through faces follow from a given velocity.

    Such flows are stored in `tables.plane`, computed flows in `tables.work`.
    """
    return basin["given"] == 1


@njit
def patch_inflow(tables, patch):
    """Inflow through all faces of an open patch: [m3/s] of water, [m2/s] by a given velocity, [kg/(m s)] of a liquid.

    The inflow by a given velocity is that at full speed, without `flow_factor`.
    """
    basin, total = tables.basins[patch["basin"]], 0.0
    flows = tables.plane if has_given_flows(basin) else tables.work
    for m in range(patch["faces"]):
        total += flows[basin["through"] + tables.integers[patch["ring"] + m]]
    return total


@njit(forceinline=True)
def band_cells(tables, b):
    """(first, last + 1) of the cells of basin b in the band of this thread."""
    wide = max(tables.basins[b]["nx"], 1)
    return wide * tables.bands[2 * b], wide * tables.bands[2 * b + 1]


@njit(forceinline=True)
def stencil_cells(tables, b):
    """(first, last + 1) of the cells of basin b whose values the rates in the band of this thread read."""
    basin = tables.basins[b]
    begin = max(tables.bands[2 * b] - BAND_MARGIN, 0)
    stop = min(tables.bands[2 * b + 1] + BAND_MARGIN, basin["ny"])
    return (basin["nx"] * begin, basin["nx"] * stop) if basin["nx"] > 0 else (0, basin["n"])
