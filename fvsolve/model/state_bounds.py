"""Bounds of states: depths are at least 0; amounts of scalars stay within the bounds of the scalar's values."""

from __future__ import annotations

import numpy as np

from fvsolve.model.scalar_tables import STORES

NO_STATE = -1


def state_bounds(model) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of states, arguments of `steppers.output_rows.limit_to_bounds` : (at, by).

    at : int64[3 q]  a bounded state, and up to two states that give the amount of which it is a share, else -1
    by : float64[q, 4]  base and gain of this amount, least share, greatest share
    Bounds of depths come first, because depths bound the amounts of scalars.
    """
    rows = [*depths(model)]
    for q in range(len(model.tables.scalars)):
        rows += [*in_pipes(model, q), *in_nodes(model, q), *in_basins(model, q)]
    if not rows:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 4))
    at, by = (np.concatenate(column) for column in zip(*rows, strict=True))
    return at.ravel(), by


def bound_rows(states, first, second, base, gain, least, most) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of `states` : (int64[q, 3], float64[q, 4]), see `state_bounds`; arguments are arrays or numbers.

    A state lies between `least` and `most` times the amount base + gain (y[first] + y[second]).
    """
    at = np.column_stack(np.broadcast_arrays(states, first, second)).astype(np.int64)
    return at, np.column_stack(np.broadcast_arrays(base, gain, least, most, np.zeros(len(at)))[:4])


def depths(model):
    """Yield `bound_rows` that keep depths of water in basin cells at 0 or above."""
    for basin in model.basins:
        if basin.deep:
            states = int(basin.row["y"]) + np.arange(basin.n)
            yield bound_rows(states, NO_STATE, NO_STATE, basin.depth, 0.0, -1.0, np.inf)


def in_pipes(model, q: int):
    """Yield `bound_rows` of the amounts per length of scalar q in the cells of each pipe.

    The bounds are the least and the greatest value of the scalar, times the mass per length from both waves.
    """
    row, profile = model.tables.scalars[q], model.tables.profile
    for pipe in model.tables.pipes:
        n, k = int(pipe["cells"]), np.arange(pipe["cells"])
        states, wave = row["y"] + pipe["cell"] + k, pipe["y"] + k
        masses = profile[pipe["center"] + k]
        yield bound_rows(states, wave, wave + n, masses, 1.0 / pipe["speed"], row["least"], row["greatest"])


def in_nodes(model, q: int):
    """Yield `bound_rows` of the amount of scalar q in each tank and chamber.

    They are its least and greatest value times the mass there.
    """
    row, nodes = model.tables.scalars[q], model.tables.nodes
    places = model.tables.integers[row["places"] : row["places"] + len(nodes)]
    for node, place in zip(nodes, places, strict=True):
        if node["kind"] in STORES:
            yield bound_rows([place], node["y"], NO_STATE, node["mass"], 1.0, row["least"], row["greatest"])


def in_basins(model, q: int):
    """Yield `bound_rows` of the amounts per area of scalar q in each basin with scalars.

    They are its least and greatest value times the depth, or times 1 in a basin without variable depth (`basin.deep`
    False).
    """
    row = model.tables.scalars[q]
    for basin in model.basins:
        if basin.row["carried"] < 0:
            continue
        states = int(basin.row["carried"]) + q * basin.n + np.arange(basin.n)
        reference = (int(basin.row["y"]) + np.arange(basin.n), basin.depth) if basin.deep else (NO_STATE, 1.0)
        yield bound_rows(states, reference[0], NO_STATE, reference[1], 1.0, row["least"], row["greatest"])
