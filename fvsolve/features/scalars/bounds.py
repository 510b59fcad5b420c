"""Bounds of the amounts of scalars."""

import numpy as np

from fvsolve.core.model.state_bounds import NO_STATE, bound_rows
from fvsolve.features.scalars.lower import STORES, wall_masses
from fvsolve.features.scalars.own_tables import scalar_tables


def scalar_bounds(model, q: int):
    """Yield `bound_rows` of the amounts of scalar q: its least and greatest value, times the mass or depth there.

    The mass per length in the cells of a pipe follows from both waves, plus the wall mass. The mass in a tank or
    chamber follows from its state. In a basin it is the depth, or 1 without variable depth (`basin.deep` False).
    """
    row, tables = scalar_tables(model).scalars[q], model.tables
    if np.isinf(row["least"]):
        return
    limits = row["least"], row["greatest"]
    for pipe, wall in zip(tables.pipes, wall_masses(tables, row), strict=True):
        n, k = int(pipe["cells"]), np.arange(pipe["cells"])
        states = row["y"] + pipe["cell"] + k
        wave = pipe["y"] + k
        masses = tables.profile[pipe["center"] + k] + wall
        yield bound_rows(states, wave, wave + n, masses, 1.0 / pipe["speed"], *limits)
    places = tables.integers[row["places"] : row["places"] + len(tables.nodes)]
    for node, place in zip(tables.nodes, places, strict=True):
        if node["kind"] in STORES:
            yield bound_rows([place], node["y"], NO_STATE, node["mass"], 1.0, *limits)
    for basin in model.meshed:
        if basin.row["carried"] < 0:
            continue
        states = int(basin.row["carried"]) + q * basin.n + np.arange(basin.n)
        depth = (
            (int(basin.row["y"]) + np.arange(basin.n), basin.at_rest())
            if basin.deep
            else (NO_STATE, 1.0)
        )
        yield bound_rows(states, depth[0], NO_STATE, depth[1], 1.0, *limits)
