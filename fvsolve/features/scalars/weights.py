"""Weights of scalar amounts in the norm of deviations of a model."""

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.energy_norm import SCALAR_WEIGHT
from fvsolve.features.scalars.lower import typical_value
from fvsolve.features.scalars.own_tables import scalar_tables


def weigh_scalars(model, weights: np.ndarray) -> None:
    """Write the weights of scalar amounts in basins, pipes, tanks and chambers, from the weights of the mass there."""
    tables, rho = model.tables, model.case.properties.density
    for basin in model.meshed:
        for q, amount in enumerate(basin.amounts(weights) if basin.scalars else ()):
            amount[:] = SCALAR_WEIGHT * 0.5 * basin.mesh.area / greatest_value(model, q) ** 2
    for q, scalar in enumerate(scalar_tables(model).scalars):
        share = SCALAR_WEIGHT / greatest_value(model, q) ** 2
        for row in tables.pipes:
            cells = slice(scalar["y"] + row["cell"], scalar["y"] + row["cell"] + row["cells"])
            weights[cells] = share * row["dx"] * row["speed"] ** 2 / (rho * row["area"])
        places = tables.integers[scalar["places"] :]
        for place, node in zip(places, tables.nodes, strict=False):
            if node["kind"] in (rec.TANK, rec.CHAMBER):
                weights[place] = share * weights[node["y"]]


def greatest_value(model, q: int) -> float:
    """Greatest possible magnitude of the value of scalar q; 1 if all values are 0."""
    return typical_value(model.case, list(model.case.scalars)[q])
