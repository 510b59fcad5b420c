"""Functions that basins of all types add to the right-hand side and to the probes (`kernels.rhs_assembly`)."""

from collections.abc import Iterator

from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.features.scalars.kernels.terms import MIXED

PACKAGE = "fvsolve.features.basins"
COMMON = RhsTerms(
    package=PACKAGE,
    boundary_exchange="basin_patches: put_boundary_flows",
    observe="basin_output: observe_flows",
    power="basin_output: patch_power",
)
# all laws but linear
DENSITY_LAWS = RhsTerms(package=PACKAGE, observe="basin_output: observe_dense_flows")
SHORTAGES = RhsTerms(package=PACKAGE, record="basin_patches: record_patches")
WALLS = RhsTerms(
    package=PACKAGE,
    derive_state="moving_walls: update_geometry",
    prepare="moving_walls: set_line_speeds",
    boundary_inflow="moving_walls: add_wall_forces",
    stretching="moving_walls: stretch_scalar_rates",
    observe="moving_walls: observe_walls",
    power="moving_walls: wall_power",
)
MOVING_SIDES = RhsTerms(
    package=PACKAGE,
    derive_state="moving_meshes: update_meshes",
    prepare="moving_meshes: set_side_speeds",
)
FRAMES = RhsTerms(package=PACKAGE, prepare="basin_frames: set_frames")  # before patches
FRAME_FORCES = RhsTerms(
    package=PACKAGE,
    boundary_inflow="frame_forces: add_frame_forces",
    fluid_response="frame_forces: correct_for_bodies",
    power="frame_forces: add_power",
    stored="frame_forces: add_stored",
)
PATCH_VALUES = RhsTerms(
    package=PACKAGE,
    outlet_values="basin_scalars: patch_values",
    observe="basin_scalars: observe_values",
)
GRIDS = RhsTerms(package=PACKAGE, scalar_rates="basin_scalars: advect_on_grids")
FIFTH = RhsTerms(package=PACKAGE, scalar_rates="basin_scalars: add_fifth_order_on_grids")
DIFFUSION = RhsTerms(package=PACKAGE, scalar_rates="basin_scalars: diffuse_on_grids")
MESHES = RhsTerms(package=PACKAGE, scalar_rates="basin_scalars: advect_on_meshes")
SOURCES = RhsTerms(package=PACKAGE, scalar_rates="basin_scalars: add_sources")
PATCH_FACES = RhsTerms(  # of links at patches of water
    package="fvsolve.features.basins.free_surface",
    outlet_values="patch_scalars: values_at_faces",
    scalar_rates="patch_scalars: add_face_flows",
)
CONDUIT_ENDS = RhsTerms(
    package="fvsolve.features.basins.conduit", scalar_rates="conduit_rates: add_end_scalars"
)
REACTIONS = RhsTerms(
    package=PACKAGE,
    prepare="basin_reactions: limit_rates_in_basins",
    scalar_rates="basin_reactions: add_reactions",
    observe="basin_reactions: observe_reactions_in_basins",
)
# in the order in which they run within a phase
SCALAR_TERMS = (
    PATCH_VALUES,
    MIXED,
    GRIDS,
    FIFTH,
    DIFFUSION,
    MESHES,
    SOURCES,
    PATCH_FACES,
    CONDUIT_ENDS,
    REACTIONS,
)


def terms_of_basins(basins: list, valves: bool) -> tuple[RhsTerms, ...]:
    """`RhsTerms` of all basins without those of scalars, each once; valves : True if the network contains valves."""
    shared = (
        [COMMON]
        if basins and basins[0].case.law.linear
        else [COMMON, DENSITY_LAWS]
        if basins
        else []
    )
    shared += [FRAMES] if any(basin.part.on is not None for basin in basins) else []
    moving = [WALLS] if any(basin.moves for basin in basins) else []
    moving += [MOVING_SIDES] if any(basin.moves and not basin.is_grid for basin in basins) else []
    return tuple(
        dict.fromkeys(
            [*shared, *(terms for basin in basins for terms in basin.pieces(valves)), *moving]
        )
    )


def terms_of_scalars(basins: list) -> tuple[RhsTerms, ...]:
    """`RhsTerms` of the scalars in all basins, each once; their functions select the basins for which they compute."""
    needed = {piece for basin in basins for piece in scalar_terms(basin)}
    return tuple(terms for terms in SCALAR_TERMS if terms in needed)


def scalar_terms(basin) -> Iterator[RhsTerms]:
    """Yield the `RhsTerms` of the scalars of one basin; none for a basin without scalars."""
    if not basin.scalars:
        return
    yield from (PATCH_VALUES, SOURCES)
    if basin.case.reactions:
        yield REACTIONS
    if not basin.given:
        yield MIXED
    if any(place.startswith(f"{basin.name}.") for place in basin.case.patches_with_faces):
        yield CONDUIT_ENDS if basin.part.added else PATCH_FACES
    if not basin.is_grid:
        yield MESHES
        return
    yield GRIDS
    if basin.is_fifth_order:
        yield FIFTH
    if any(basin.case.scalars[name].diffusivity > 0.0 for name in basin.scalars):
        yield DIFFUSION
