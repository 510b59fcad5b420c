"""Rows of probes in basins: at points, of whole basins, through sections."""

import numpy as np

from fvsolve.core.assembly.features import frames_of
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.probe_tables import cells_at_point


def lower_probe(draft, basins: list, probe, row) -> bool:
    """Fill the row of a probe in a basin; False for other probes. basins : `BasinRows` of all basins"""
    if probe.part == "sections":
        lower_section(draft, basins, row, probe)
    elif probe.point is not None and probe.quantity in draft.case.scalars:
        return False
    elif probe.point is not None and probe.name in draft.case.lumped:
        lower_surface(draft, row, probe)
    elif probe.point is not None:
        row["kind"] = rec.CELL_FIELD
        cells, weights = cells_at_point(draft, row, probe)
        basins[row["index"]].lower_probe(row, probe.quantity, cells, weights)
    elif probe.part == "nodes" and probe.name in draft.case.meshes:
        row["kind"], row["index"] = rec.CELL_FIELD, list(draft.case.meshes).index(probe.name)
        basins[row["index"]].lower_probe(row, probe.quantity, np.zeros(0, int), np.zeros(0))
    else:
        return False
    return True


def lower_section(draft, basins: list, row, probe) -> None:
    """Fill the row of a probe of the flow through a section: its marked faces, and their lengths with signs."""
    name = draft.case.output.sections[probe.name].basin
    k = list(draft.case.meshes).index(name)
    basin = basins[k]
    chain = basin.sections[probe.name]
    row["kind"], row["index"], row["count"] = rec.SECTION_FLOW, k, chain.faces.size
    row["cell"], row["weights"] = len(draft.integers), len(draft.floats)
    draft.integers += np.searchsorted(basin.marks.faces, chain.faces).tolist()
    draft.floats += (chain.turn * basin.mesh.length[chain.faces]).tolist()


def lower_surface(draft, row, probe) -> None:
    """Fill the row of a probe of depth at a point of a basin with sloshing modes."""
    from fvsolve.case import sloshing

    case, basin = draft.case, draft.case.nodes[probe.name]
    arguments = basin, case.lumped[probe.name]
    modes, shares = sloshing.surface_factors(
        *arguments, *probe.point, case.properties.density, case.gravity
    )
    row["kind"], row["offset"] = rec.SURFACE_VALUE, sloshing.depth_of(*arguments)
    row["cell"], row["count"], row["weights"] = len(draft.integers), len(modes), len(draft.floats)
    draft.integers += [
        frames_of(draft).index(sloshing.mode_body_name(probe.name, mode)) for mode in modes
    ]
    draft.floats += shares
