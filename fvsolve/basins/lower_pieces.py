"""Terms of the right-hand side and probes common to basins of all physics (`kernels.rhs_assembly`)."""

from __future__ import annotations

from collections.abc import Iterator

from fvsolve.kernels.rhs_assembly import MIXED, RhsTerms

HOME = "fvsolve.basins"
ALL = RhsTerms(package=HOME, observe="observe: observe_flows", power="energy: patch_power")
DENSE = RhsTerms(package=HOME, observe="observe: observe_dense_flows")  # all laws but linear
MARKED = RhsTerms(package=HOME, record="patches: record_patches")
WALLS = RhsTerms(
    package=HOME, derive_state="walls: see", prepare="walls: drive_lines", boundary_inflow="walls: push_bodies", stretching="walls: swell",
    observe="walls: observe_walls", power="walls: wall_power",
)  # fmt: skip
SIDES = RhsTerms(package=HOME, derive_state="moving_meshes: see_meshes", prepare="moving_meshes: drive_sides")
FRAMES = RhsTerms(package=HOME, prepare="frames: set_frames")  # before patches
TURNING = RhsTerms(
    package=HOME, boundary_inflow="frames_flow: turn_fluid", fluid_response="frames_flow: follow_bodies",
    power="frames_energy: add_power", stored="frames_energy: add_stored",
)  # fmt: skip
VALUES = RhsTerms(package=HOME, outlet_values="carried: patch_values", observe="carried: observe_values")
GRIDS = RhsTerms(package=HOME, scalar_rates="carried_grids: carry_on_grids")
FIFTH = RhsTerms(package=HOME, scalar_rates="carried_grids: add_on_grids")
SPREAD = RhsTerms(package=HOME, scalar_rates="carried_grids: spread_on_grids")
MESHES = RhsTerms(package=HOME, scalar_rates="carried_faces: carry_on_meshes")
SETTLED = RhsTerms(package=HOME, scalar_rates="carried: settle_amounts")
CARRIED = (VALUES, MIXED, GRIDS, FIFTH, SPREAD, MESHES, SETTLED)  # in the order in which they run within a phase


def of_basins(basins: list, valves: bool) -> tuple[RhsTerms, ...]:
    """Terms of basins without scalars. valves : True if there are valves in the network"""
    shared = [ALL] if basins and basins[0].case.law.linear else [ALL, DENSE] if basins else []
    shared += [FRAMES] if any(basin.part.on is not None for basin in basins) else []
    moving = [WALLS] if any(basin.moves for basin in basins) else []
    moving += [SIDES] if any(basin.moves and not basin.is_grid for basin in basins) else []
    return tuple(dict.fromkeys([*shared, *(terms for basin in basins for terms in basin.pieces(valves)), *moving]))


def of_scalars(basins: list) -> tuple[RhsTerms, ...]:
    """Terms of scalars in basins; each term selects its basins itself."""
    needed = {piece for basin in basins for piece in carrying(basin)}
    return tuple(terms for terms in CARRIED if terms in needed)


def carrying(basin) -> Iterator[RhsTerms]:
    """Terms of the scalars of a basin, if it has scalars."""
    if not basin.scalars:
        return
    yield from (VALUES, SETTLED)
    if not basin.given:
        yield MIXED
    if not basin.is_grid:
        yield MESHES
        return
    yield GRIDS
    if basin.fifth:
        yield FIFTH
    if any(basin.case.scalars[name].diffusivity > 0.0 for name in basin.scalars):
        yield SPREAD
