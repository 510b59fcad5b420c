"""Crests of walls that move: each marked face has the highest crest of its walls, or the bed without a wall.

A candidate is a wall on a marked face whose crest is above both beds at some time. Its numbers are written to `work`
for each evaluation of the rates, in the order of `marked_faces.MarkedFaces`. A crest at or below the bed is no wall.
"""

from fvsolve.core.kernels.schedule_pieces import schedule_value
from fvsolve.jit import njit


@njit
def write_crests(tables, basin, t):
    """Write crests [m], heights [m], sizes and normals of the walls on the marked faces of a basin at time t [s].

    All bands of cells write equal numbers, each in a single store, so that no band reads a number that is not final.
    """
    faces = basin["marked_faces"]
    walls = basin["moving_crests"]
    rest = tables.plane[basin["candidate_numbers"]]
    schedules = tables.integers[basin["candidates"] :]
    first = schedules[walls:]
    wall_of = schedules[walls + faces + 1 :]
    beds = tables.plane[basin["candidate_numbers"] + 1 :]
    count = first[faces]
    sizes = beds[faces:]
    cosines = beds[faces + count :]
    sines = beds[faces + 2 * count :]
    now = tables.work[basin["present_crests"] :]
    numbers = tables.work[basin["crests"] :]
    for k in range(walls):
        now[k] = schedule_value(tables, schedules[k], t)
    for i in range(faces):
        highest = beds[i]
        candidate = -1
        for k in range(first[i], first[i + 1]):
            crest = now[wall_of[k]]
            if crest > highest:
                highest = crest
                candidate = k
        numbers[i] = highest - rest
        numbers[faces + i] = highest - beds[i]
        if candidate >= 0:  # without a wall they are not read
            numbers[2 * faces + i] = sizes[candidate]
            numbers[3 * faces + i] = cosines[candidate]
            numbers[4 * faces + i] = sines[candidate]
