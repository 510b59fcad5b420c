"""Rows of probes in basins: at points, of whole basins, through sections."""

import numpy as np

from fvsolve.core.assembly.features import frames_of
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.probe_tables import cells_at_point
from fvsolve.features.basins.tables import INTERIOR, NO_CLOSURE

WALL_QUANTITIES = ("force", "power", "travel")
# kind of a node -> quantities that are computed from its patch
QUANTITIES_AT_PATCHES = {
    "patch": (*WALL_QUANTITIES, "froude", "flow"),
    "patch-junction": ("froude", "flow"),
}


def lower_probe(draft, own, probe, row) -> bool:
    """Fill the row of a probe in a basin or at a patch; False for other probes. own : the feature"""
    basins = own.meshed
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
        place = draft.case.places.get(probe.name) if probe.part == "nodes" else None
        quantities = QUANTITIES_AT_PATCHES.get(place.kind, ()) if place is not None else ()
        if probe.quantity not in quantities:
            return False
        inside = probe.name if place.kind == "patch" else f"{probe.name}.inside"
        lower_patch_probe(draft, own, inside, probe.quantity, row)
    return True


def lower_patch_probe(draft, own, name: str, quantity: str, row) -> None:
    """Fill the row of a probe at the patch `name`; add a fault for a Froude number that it does not have."""
    node = draft.node_index[name]
    if quantity in WALL_QUANTITIES:
        row["kind"], row["index"] = rec.WALL_VALUE, own.wall_names.index(name)
        row["side"] = WALL_QUANTITIES.index(quantity)
    elif quantity == "froude":
        row["kind"] = rec.PATCH_FROUDE
        row["index"] = k = own.patches["node"].tolist().index(node)
        closure = own.patches["closure"][k]
        if closure in (NO_CLOSURE, INTERIOR):
            reason = "a rigid column joins it, or no part at all"
            reason = reason if closure == NO_CLOSURE else "it lies inside the basin"
            expected = "a patch of the boundary with a closure or another link"
            draft.fault(
                "output.probes", f"{name} has no Froude number: {reason}; expected {expected}"
            )
    else:
        row["kind"], row["index"] = rec.PATCH_FLOW, node
        row["scale"] = 1.0 / draft.fluid.density
        if not draft.case.nodes[draft.case.places[name].basin].physics_type.joined:
            row["kind"] = rec.GIVEN_FLOW
            row["index"] = own.patches["node"].tolist().index(node)


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
