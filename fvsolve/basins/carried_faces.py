"""Rates of scalars in basins on meshes of any cells; other terms are those of `basin_scalars`."""

from fvsolve.basins.advection_faces import advection_rates
from fvsolve.basins.behind import is_given
from fvsolve.basins.carried import deep, made_ready, turned
from fvsolve.basins.stretch import seen_of
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import RATE
from fvsolve.kernels.table_handle import open_tables


@njit
def carry_on_meshes(t, y, dydt, out, handle):
    """Rates of all amounts by advection and diffusion."""
    tables = open_tables(handle)
    plane, work, scalars, integers = tables.plane, tables.work, tables.scalars, tables.integers
    for b in range(tables.basins.size if dydt.size > 0 else 0):
        basin = tables.basins[b]
        if basin["carried"] < 0 or basin["nx"] > 0:
            continue
        n, flows = basin["n"], plane if is_given(basin) else work
        flow = flows[basin["flows"] : basin["flows"] + basin["faces"]]
        made_ready(t, tables, b, y)
        seen = seen_of(basin, tables.seen, y)
        factor, depth = turned(t, basin), work[basin["scalar_work"] : basin["scalar_work"] + deep(basin)]
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
