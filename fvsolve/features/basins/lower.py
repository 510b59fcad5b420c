"""Tables of a model for basins; loaded for models that contain a basin."""

from importlib import import_module

import numpy as np

from fvsolve.core.assembly.features import frames_of
from fvsolve.core.kernels import dtypes as rec
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.energy_rows import BASIN_ROWS, WALL_ROWS

# closures of patches whose outflow is held at critical flow
HELD = (records.DISCHARGE, records.LINKED, records.INTERIOR)


def lower_basins(draft, own) -> None:
    """Fill the tables of basins, moving walls and patches in a draft, and add the states of basins to it.

    own : the feature, which receives `BasinRows` of all basins
    """
    case = draft.case
    own.meshed = [rows_class(case.nodes[name].physics_type)(case, name) for name in case.meshes]
    own.basins = np.zeros(len(own.meshed), records.BASIN)
    for k, (basin, row) in enumerate(zip(own.meshed, own.basins, strict=True)):
        basin.number = k
        basin.lower_common(draft, row)
    if any(basin.moves for basin in own.meshed):
        from fvsolve.features.basins.lower_motion import lower_walls

        lower_walls(draft, own)
    patches = [(name, place) for name, place in case.places.items() if place.kind == "patch"]
    own.patches, names = np.zeros(len(patches), records.PATCHES), list(case.meshes)
    for basin in own.meshed:
        basin.all_patches = own.patches
    for row, (name, place) in zip(own.patches, patches, strict=True):
        row["basin"], row["node"] = names.index(place.basin), draft.node_index[name]
        own.meshed[row["basin"]].lower_patch(draft, place.patch, row)


def reserve_basins(draft, own) -> None:
    """Reserve the arrays of basins and moving walls; rows of the ledger: rain, and negative infiltration."""
    sizes = draft.sizes
    basins = len(own.basins)
    walls = len(own.walls)
    sizes.ledger("source", len(own.sources))
    sizes.last_power += WALL_ROWS * walls + BASIN_ROWS * basins
    sizes.last_stored += basins
    sizes.out("wall", walls)
    sizes.out("tank", rec.TANK_OUT * basins if frames_of(draft) else 0)
    sizes.run_array("seen", draft.size if walls else 0)
    sizes.run_array("bands", 2 * basins)
    sizes.run_array("maxima", draft.maxima_size)


def rows_class(physics: type) -> type:
    """Subclass of `BasinRows` that fills the tables of a type of basin.

    It is in the module `lower` of the package that declares the type. physics : class with the keys of the type
    """
    home = physics.package or physics.__module__.rpartition(".")[0]
    import_module(f"{home}.lower")
    return import_module("fvsolve.features.basins.lower_basin").BasinRows.physics[home]


def start_basins(
    basins: list, y: np.ndarray, attitudes: dict[str, np.ndarray] | None = None
) -> None:
    """Write the states of basins at the start, as deviations from the initial steady state, to the states of a model.

    basins : `BasinRows` of all basins, with their stated start and values of scalars
    attitudes : rotation matrices of bodies by name, in place of those at the start
    """
    for basin in basins:
        on = basin.part.on if attitudes else None
        basin.states_of(y)[:] = basin.start() if on is None else basin.start(attitudes[on])
        if basin.scalars:
            basin.start_scalars(y)
