"""Rates of scalars in basins on meshes of any cells; `basin_scalars` adds terms other than advection and diffusion."""

from fvsolve.basins.advection_faces import advection_rates
from fvsolve.basins.basin_scalars import depth_count, flow_factor, prepare_scalars
from fvsolve.basins.boundary_cells import has_given_flows
from fvsolve.basins.cell_stretching import deviations_of
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import RATE
from fvsolve.kernels.table_handle import open_tables


@njit
def advect_on_meshes(t, y, dydt, out, handle):
    """Write the rates of all scalars in basins on meshes other than grids, by advection and diffusion.

    out[RATE], which limits the step, is raised.
    """
    tables = open_tables(handle)
    plane, work, scalars, integers = tables.plane, tables.work, tables.scalars, tables.integers
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["carried"] < 0 or basin["nx"] > 0:
            continue
        n, flows = basin["n"], plane if has_given_flows(basin) else work
        flow = flows[basin["flows"] : basin["flows"] + basin["faces"]]
        prepare_scalars(t, tables, b, y)
        seen = deviations_of(basin, tables.seen, y)
        factor, depth = flow_factor(t, basin), work[basin["scalar_work"] : basin["scalar_work"] + depth_count(basin)]
        for q in range(scalars.size):
            o, ring = basin["carried"] + q * n, basin["outside"] + q * basin["outer"]
            quickest = advection_rates(
                basin["scheme"], basin["wide"], scalars[q]["diffusivity"], factor, plane[basin["mesh"] :],
                integers[basin["links"] :],
                flow, depth, work[ring : ring + basin["outer"]], scalars[q]["least"], scalars[q]["greatest"],
                seen[o : o + n], work[basin["scalar_work"] + n :], dydt[o : o + n],
            )  # fmt: skip
            full_rate = (
                (1.0 - abs(factor)) * basin["unsplit"] * basin["fastest"]
            )  # a periodic velocity returns to full speed
            out[RATE] = max(out[RATE], quickest + full_rate + scalars[q]["decay"])
