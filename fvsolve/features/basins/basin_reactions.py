"""Reactions of scalars in the cells of basins, see `features.scalars.kernels.reactions`."""

from fvsolve.core.kernels.dtypes import (
    CELL_SCALAR,
    LOCAL_AFFINITY,
    RATE,
    RATE_UNWANTED,
    REACTION_VALUE,
)
from fvsolve.features.basins.advection import THIN
from fvsolve.features.basins.basin_scalars import cell_value
from fvsolve.features.basins.cell_sides import deviations_of
from fvsolve.features.basins.tables import open_basins
from fvsolve.features.scalars.kernels.reactions import (
    add_observed,
    affinity_of,
    chosen,
    greatest_rate,
    rates_both_ways,
    react,
    read_amounts,
    sums_of_network,
)
from fvsolve.jit import njit


@njit(forceinline=True)
def cell_depth(tables, basin, y, i):
    """Depth of water in cell i of a basin [m]; 1 in a basin with a given velocity."""
    if basin["deep"] == 0:
        return 1.0
    return max(tables.plane[basin["plan"] + i] + y[basin["y"] + i], 0.0)


@njit(forceinline=True)
def mass_per_depth(tables, basin, i):
    """Mass of cell i per unit of `cell_depth`."""
    per = tables.settings[0]["rho"] if basin["deep"] == 1 else basin["density"] * basin["thickness"]
    return per * tables.plane[basin["area"] + i]


@njit
def add_reactions(t, y, dydt, out, handle):
    """Add changes by reactions to the rates of scalars in all basins; write rates of reactions to the ledger."""
    tables = open_basins(handle)
    for b in range(tables.basins.size):
        basin = tables.basins[b]
        seen, n = deviations_of(basin, tables.seen, y), basin["n"]
        for i in range(n if basin["carried"] >= 0 else 0):
            depth, weight = cell_depth(tables, basin, seen, i), mass_per_depth(tables, basin, i)
            first, entry = basin["carried"] + i, basin["lost"] + i
            react(
                seen,
                dydt,
                out,
                tables,
                first,
                n,
                max(depth, THIN),
                tables.pipes.size,
                depth,
                weight,
                entry,
            )


@njit
def limit_rates_in_basins(t, y, dydt, out, handle):
    """Raise the greatest rate of change by reactions in `out` to that in basins, if it limits steps [1/s]."""
    tables = open_basins(handle)
    at = tables.layout[0]["quickest"]
    for b in range(
        tables.basins.size
        if out[RATE] != RATE_UNWANTED and tables.reactions[0]["limits"] == 1
        else 0
    ):
        basin = tables.basins[b]
        seen, n = deviations_of(basin, tables.seen, y), basin["n"]
        for i in range(n if basin["carried"] >= 0 else 0):
            depth = max(cell_depth(tables, basin, seen, i), THIN)
            read_amounts(tables, seen, basin["carried"] + i, n, depth, tables.pipes.size)
            out[at] = max(out[at], greatest_rate(tables))


@njit
def observe_reactions_in_basins(t, y, out, handle, values):
    """Write the values of probes of reactions to `values`, with places in basins."""
    tables = open_basins(handle)
    for j in range(tables.probes.size):
        probe, sums = tables.probes[j], tables.scratch[:4]
        k = probe["index"]
        if probe["kind"] == REACTION_VALUE:
            sums_of_network(y, tables, k, sums)
            for b in range(tables.basins.size):
                basin = tables.basins[b]
                for i in range(basin["n"] if basin["carried"] >= 0 else 0):
                    depth = cell_depth(tables, basin, y, i)
                    weight = mass_per_depth(tables, basin, i)
                    read_amounts(
                        tables,
                        y,
                        basin["carried"] + i,
                        basin["n"],
                        max(depth, THIN),
                        tables.pipes.size,
                    )
                    add_observed(tables, k, depth * weight / tables.settings[0]["rho"], sums)
            values[j] = chosen(probe["side"], sums)
        elif probe["kind"] == LOCAL_AFFINITY and probe["head"] == CELL_SCALAR:
            for q in range(tables.scalars.size):
                value = 0.0
                for m in range(probe["count"]):
                    i = tables.integers[probe["cell"] + m]
                    weight = tables.floats[probe["weights"] + m]
                    value += weight * cell_value(tables, tables.basins[probe["scalar"]], q, y, i)
                tables.stack[q] = value * tables.scalars[q]["molar"]
            ahead, back = rates_both_ways(tables, k)
            values[j] = affinity_of(tables.reactions[k], ahead, back)
