"""What states may not leave: depths zero, amounts of scalars the bounds of all values. Knows tables; knows no step."""

from __future__ import annotations

import numpy as np

from fvsolve.model.scalars import STORES

NOBODY = -1


def within(model) -> tuple[np.ndarray, np.ndarray]:
    """(at, by) as `steppers.rows.keep_within` takes them; depths come before what they are the whole of."""
    rows = [*depths(model)]
    for q in range(len(model.tables.scalars)):
        rows += [*in_pipes(model, q), *in_nodes(model, q), *in_basins(model, q)]
    if not rows:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 4))
    at, by = (np.concatenate(one) for one in zip(*rows, strict=True))
    return at.ravel(), by


def table(states, first, second, base, gain, least, most) -> tuple[np.ndarray, np.ndarray]:
    """Rows of states, as arrays or what is the same for all of them."""
    at = np.column_stack(np.broadcast_arrays(states, first, second)).astype(np.int64)
    return at, np.column_stack(np.broadcast_arrays(base, gain, least, most, np.zeros(len(at)))[:4])


def depths(model):
    """The depth of water in cells is no less than none."""
    for basin in model.basins:
        if basin.deep:
            states = int(basin.row["y"]) + np.arange(basin.n)
            yield table(states, NOBODY, NOBODY, basin.depth, 0.0, -1.0, np.inf)


def in_pipes(model, q: int):
    """Amounts per length, of the mass per length that both waves make."""
    row, profile = model.tables.scalars[q], model.tables.profile
    for pipe in model.tables.pipes:
        n, k = int(pipe["cells"]), np.arange(pipe["cells"])
        states, wave = row["y"] + pipe["cell"] + k, pipe["y"] + k
        masses = profile[pipe["center"] + k]
        yield table(states, wave, wave + n, masses, 1.0 / pipe["speed"], row["least"], row["greatest"])


def in_nodes(model, q: int):
    """Amounts in tanks and chambers, of the mass there."""
    row, nodes = model.tables.scalars[q], model.tables.nodes
    places = model.tables.integers[row["places"] : row["places"] + len(nodes)]
    for node, place in zip(nodes, places, strict=True):
        if node["kind"] in STORES:
            yield table([place], node["y"], NOBODY, node["mass"], 1.0, row["least"], row["greatest"])


def in_basins(model, q: int):
    """Amounts per area, of the depth."""
    row = model.tables.scalars[q]
    for basin in model.basins:
        if basin.row["carried"] < 0:
            continue
        states = int(basin.row["carried"]) + q * basin.n + np.arange(basin.n)
        of = (int(basin.row["y"]) + np.arange(basin.n), basin.depth) if basin.deep else (NOBODY, 1.0)
        yield table(states, of[0], NOBODY, of[1], 1.0, row["least"], row["greatest"])
