"""Scalars in basins on meshes of any cells as a room of a scene. Knows the tables; the rest is as in `carried`."""

from math import cos, pi

from fvsolve.jit import njit
from fvsolve.kernels.handle import open_tables
from fvsolve.kernels.plane.advection_faces import advection_rates
from fvsolve.kernels.plane.carried import put_outside, settle
from fvsolve.kernels.records import (
    CARRIED_FACES,
    I_BASINS,
    I_INTEGERS,
    I_PATCHES,
    I_PLANE,
    I_SCALARS,
    I_SETTINGS,
    RATE,
    SHALLOW_FACES,
)


@njit
def carried_rates(t, y, dydt, out, handle):
    """Rates of all amounts in basins on meshes."""
    tables = open_tables(handle)
    plane, patches, scalars, integers = tables[I_PLANE], tables[I_PATCHES], tables[I_SCALARS], tables[I_INTEGERS]
    for b in range(tables[I_BASINS].size if dydt.size > 0 else 0):
        basin = tables[I_BASINS][b]
        if basin["carried"] < 0 or (basin["kind"] != SHALLOW_FACES and basin["kind"] != CARRIED_FACES):
            continue
        n, outer, flow = basin["n"], basin["outer"], plane[basin["flows"] : basin["flows"] + basin["faces"]]
        depth, work = plane[basin["toil"] : basin["toil"]], plane[basin["toil"] + n :]
        factor, per = 1.0, tables[I_SETTINGS][0]["rho"]
        if basin["period"] > 0.0:
            factor = cos(pi * t / basin["period"])
        if basin["kind"] == CARRIED_FACES:
            per = basin["density"] * basin["thickness"]
        else:
            depth = plane[basin["toil"] : basin["toil"] + n]
            for i in range(n):
                depth[i] = max(plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)
        for q in range(scalars.size):
            o, ring = basin["carried"] + q * n, basin["outside"] + q * outer
            s, rate, outside = y[o : o + n], dydt[o : o + n], plane[ring : ring + outer]
            for p in range(patches.size):
                if patches[p]["basin"] == b:
                    put_outside(t, tables, patches[p], basin, q, outer)
            quickest = advection_rates(
                basin["scheme"], scalars[q]["diffusivity"], factor, plane[basin["mesh"] :], integers[basin["links"] :],
                flow, depth, outside, s, work, rate,
            )  # fmt: skip
            out[RATE] = max(out[RATE], quickest)
            settle(tables, b, basin, q, factor, per, depth, outside, y, s, rate, out)
