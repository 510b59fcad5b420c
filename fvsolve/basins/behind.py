"""Cells behind a patch: what each counts by in what passes it. Knows cells and faces; knows no network."""

from fvsolve.jit import njit

SHALLOW = 1e-3  # depth behind a patch below which no more than a share of what is asked can leave [m]
HARDLY = 1e-9  # volume behind a patch, over its area, below which its surface turns to the lowest one's [m]


@njit
def to_be_had(depth):
    """Share of the outflow that is asked for that water so deep gives."""
    s = min(max(depth, 0.0) / SHALLOW, 1.0)
    return s * s * (3.0 - 2.0 * s)


@njit(forceinline=True)
def area_of(tables, patch):
    """Area of the cells behind a patch [m2]."""
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
    """What a cell counts by in what leaves: its depth, so that all leaves at one speed, but for what it has not."""
    return depth * to_be_had(depth)


@njit
def weight(plane, basin, leaves, i, y):
    """What cell i counts by in what leaves or enters by a patch [m]; of what enters a dry cell gets that of a film."""
    depth = depth_behind(plane, basin, i, y)
    return weight_out(depth) if leaves else max(depth, SHALLOW)


@njit
def counted(tables, patch, leaves, y):
    """Sum of area times `weight` of the cells behind a patch [m3], never nothing."""
    basin, plane, total = tables.basins[patch["basin"]], tables.plane, 0.0
    for m in range(patch["count"]):
        i = tables.integers[patch["first"] + m]
        total += plane[basin["area"] + i] * weight(plane, basin, leaves, i, y)
    return max(total, HARDLY * area_of(tables, patch))


@njit(forceinline=True)
def is_given(basin):
    """Whether flows through faces are those of a given velocity, in `plane`; others are found in a run, in `work`."""
    return basin["given"] == 1


@njit
def through_patch(tables, patch):
    """What flows in through all faces of a patch."""
    basin, total = tables.basins[patch["basin"]], 0.0
    flows = tables.plane if is_given(basin) else tables.work
    for m in range(patch["faces"]):
        total += flows[basin["through"] + tables.integers[patch["ring"] + m]]
    return total
