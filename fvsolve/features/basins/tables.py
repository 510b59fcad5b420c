"""Tables of basins, their patches and moving walls, behind the same handle as those of the model.

Scalars that basins carry are a feature of their own, which many cases do not have. Their tables stand here too, without
rows in such a case.
"""

import functools
from collections import namedtuple

import numpy as np

from fvsolve.core.kernels import table_handle
from fvsolve.core.kernels.dtypes import f8, i8, record
from fvsolve.features.scalars.kernels import tables as carried
from fvsolve.jit import COMPILING, Intrinsic

SLOT = 4

BASIN = record(
    kind=i8,  # code of its physics, see `basins.basin_patches`
    deep=i8,  # 1: its first quantity is a depth above that in `plan`, which carries scalars
    # 1: flows through its faces follow a given velocity, in `plane`; others are in `work`
    given=i8,
    scheme=i8,  # family of its scheme, as in SETTINGS
    limiter=i8,  # on rectangles
    # offset in `plane` of depths of kerbs: of rows of a grid, or of cells, see `free_surface.surface_mesh`
    kerbs=i8,
    wide=f8,  # limiter of meshes: how far values at sides of cells may exceed those of neighbours
    steepest=f8,  # bound of gradients in cells of meshes, see `basins.cell_sides.gradient_share`
    n=i8,  # number of cells
    nx=i8,  # columns and rows of a rectangle; 0 for other meshes
    ny=i8,  # see `nx`
    faces=i8,  # number of faces of a mesh, the last ones on the boundary
    outer=i8,  # number of faces on the boundary
    y=i8,  # first state; quantities follow each other, a row of cells each
    spacing=i8,  # offset in `plane` of 1 / widths of columns, then of rows [1/m]
    plan=i8,  # offset in `plane` of constant data, rows of cells
    area=i8,  # offset in `plane` of areas of cells [m2]
    # offset in `plane` of reflected fractions of waves, a value for each face of the boundary
    reflect=i8,
    outer_given=i8,  # number of these values: 0 if the whole boundary is wall
    through=i8,  # offset in `work` of inflows through faces of the boundary; -1 if none is open
    # offset in `work` of rates that are computed only for flows through the boundary
    boundary_rates=i8,
    mesh=i8,  # offset in `plane` of numbers of a mesh
    links=i8,  # offset in `integers` of numbers of a mesh
    work=i8,  # offset of its part of `work`
    thickness=f8,  # [m]
    speed=f8,  # wave speed in a liquid at rest [m/s]
    density=f8,  # of a liquid at rest [kg/m3]
    table=i8,  # offset in `plane` of the table of its waves under law table
    small=f8,  # square of a negligible value
    carried=i8,  # first state of scalars, depth times value, scalar after scalar; -1 for none
    lost=i8,  # offset of its cells among the losses of a scalar
    # offset of flows through faces: of columns, then of rows, or of a mesh; -1 if not needed
    flows=i8,
    outside=i8,  # offset in `work` of values of each scalar beyond the boundary
    scalar_work=i8,  # offset in `work` of work arrays for scalars
    fastest=f8,  # rate of a given velocity [1/s]
    period=f8,  # period of the reversal of a given velocity [s]; 0 for none
    friction=i8,  # NO_DRAG, MANNING or DARCY
    roughness=i8,  # offset in `plane` of Manning's n or the friction factor of cells
    held=f8,  # bound of the rate of friction [1/s]; infinity if it does not limit steps
    damped=i8,  # 1 if rates are divided by 1 + h r of friction, which then does not limit steps
    unsplit=f8,  # rate of its cells for the step limit over the rate from the kernels
    rest=f8,  # p - p_ambient + rho g z of the profile, the same in all cells [Pa]
    wall=i8,  # first of its moving walls
    # number of its moving walls; with any, its states are contents, see `basins.moving_walls`
    walls=i8,
    drawn=i8,  # offset in `plane` of areas of cells as drawn; `area` is that of present areas
    stretch=i8,  # offset in `plane` of present over drawn areas; of a grid for its columns or rows
    lines=i8,  # offset in `plane` of speeds of grid lines, or of corners of a mesh [m/s]
    thrust=i8,  # offset in `work` of forces on boundary faces, see `free_surface.surface_grid`
    turn=i8,  # 0 if grid lines move along x, 1 if along y
    body=i8,  # body that carries it; -1 for none
    # 1 if its load acts on that body: forces move the body, or the joint load is an output
    loads_body=i8,
    frame=i8,  # offset in `plane` of the position and motion of its axes; see `basins.basin_frames`
    corners=i8,  # number of corners of a mesh
    # offset in `plane` of positions of corners, then of centres of cells, see `moving_meshes`
    places=i8,
    sides=i8,  # offset in `plane` of normal speeds of sides, by block, side of four and cell [m/s]
    ends=i8,  # offset in `integers` of corners of sides and cells, see `moving_meshes`
    # offset in `work` of flows at faces of driven patches, see `free_surface.patch_closures`; -1 for none
    driven=i8,
    rain=i8,  # schedule of the mean rate of rain; -1 for none
    frames=i8,  # number of frames of rates of rain in cells; 0 for uniform rain
    frame_rates=i8,  # offset in `plane` of these rates, a row of cells for each frame [m/s]
    frame_position=i8,  # schedule of the position among frames, from 0 for the first
    # offset in `work` of the present numbers of rain and soil, see `free_surface.water_sources`
    present=i8,
    rained=i8,  # state: height of rain since the start [m]
    soil=i8,  # NO_SOIL, CONSTANT_RATE, HORTON, GREEN_AMPT or CURVE_NUMBER
    # offset in `plane` of numbers of the soil in cells, see `free_surface.water_sources`
    soil_numbers=i8,
    # length of each row of these numbers: the number of cells, or less for a uniform soil
    soil_row=i8,
    soil_work=i8,  # offset in `work` of rates of infiltration in cells, for probes
    # first state of infiltrated heights of cells [m]; those of condensed times follow
    infiltrated=i8,
    source=i8,  # first of its rows in the ledger of rain and infiltration
    total_area=f8,  # of all cells [m2]
    # offset in `maxima` of greatest values of its cells, see `free_surface.surface_maxima`; -1 for none
    maxima=i8,
    maxima_row=i8,  # number of these for each row of cells; a mesh is one row
    wet_depth=f8,  # depth above which a cell counts as wet there [m]
    # offset in `integers` of faces with walls or in sections, see `free_surface.marked_faces`; -1 for none
    marked=i8,
    mark_rows=i8,  # number of rows of faces there
    marks=i8,  # number of marks; on a mesh each face has two
    marked_faces=i8,  # number of marked faces
    # offset of their crests, heights and sizes, in `work` if a crest moves, else in `plane`
    crests=i8,
    moving_crests=i8,  # number of walls if a crest moves, else 0, see `free_surface.moving_crests`
    # offset in `integers` of their schedules, then of the first candidate of each marked face, then of the walls
    # of the candidates
    candidates=i8,
    candidate_numbers=i8,  # offset in `plane` of beds of marked faces, then of sizes and normals of candidates
    present_crests=i8,  # offset in `work` of the present crests of walls
    marked_work=i8,  # offset in `work` of flows through marked faces
    sections=i8,  # 1 if there are sections, whose flows rows need
)
GN = 14  # index of g_n among the numbers of a frame, see `basin_frames`
NO_SOIL, CONSTANT_RATE, HORTON, GREEN_AMPT, CURVE_NUMBER = range(5)
NO_DRAG, MANNING, DARCY = 0, 1, 2
PATCHES = record(
    basin=i8,  # row of its basin
    node=i8,  # row of the node that it gives its pressure
    first=i8,  # offset of its cells in `integers`
    count=i8,  # number of its cells
    sizes=i8,  # offset in `plane` of the present area of these [m2] and length of its faces [m]
    # offset in `integers` of its face numbers on the boundary, then of the cells behind the faces
    ring=i8,
    faces=i8,  # number of its faces
    # Offset in `plane` of outward normals along x, along y, and length over area of cells, for each face; with
    # moving walls also those as drawn.
    normals=i8,
    open=i8,  # 1 if it is not a wall and joins no link: its flow is that of the boundary
    moves=i8,  # 1 if it is a moving wall
    # offset in `integers` of schedules of inflow values, for each scalar; -1: its initial value
    values=i8,
    # Offset in `integers` of the cells next inside those behind its faces, a cell itself if there is none; of an
    # interior patch, its own cells at the faces around it. On a mesh the nearest cells around each cell behind.
    second=i8,
    stencil=i8,  # number of cells of `second` for each face
    # on a mesh: offset in `plane` of their weights, see `free_surface.patch_closures.read_around`
    weights=i8,
    # Offset in `integers` of the faces before and after each face along a driven patch of a mesh; -1 if not needed.
    neighbours=i8,
    closure=i8,  # NO_CLOSURE, or the closure of a driven patch
    drive=i8,  # schedule of its stage or discharge
    depth=i8,  # schedule of the depth of supercritical inflow; -1 for none
    numbers=i8,  # offset in `plane` of the levels of a rating, then of its flows
    points=i8,  # number of these levels
    conveyance=i8,  # offset in `plane` of sqrt(slope) / n of uniform flow at its faces [m^(1/3)/s]
    valve=i8,  # restriction from the junction of its links to its cells
    # offset in `work` of the states inside its faces, see `free_surface.patch_closures.faces_of`
    inside=i8,
    rest=f8,  # level at rest above the elevation of the basin [m]
    lowest=f8,  # lowest bed of its cells above the level at rest, at least 0 [m]
)
NO_CLOSURE, STAGE, DISCHARGE, RATING, CRITICAL, NORMAL_SLOPE, LINKED, INTERIOR = range(8)

WALL = record(
    basin=i8,  # row of its basin
    node=i8,  # node of its patch
    y=i8,  # offset of its travel since the start [m]
    mass=i8,  # row of the force on what moves with it, among the net forces in `out`; -1 for none
    body=i8,  # frame on which it pushes; -1 for none
    rate=i8,  # offset in y of its speed; -1 for none
    speed=f8,  # at the start [m/s]
    toward=f8,  # 1 if this speed is in the direction of the wall, -1 if in the opposite
    inertia=f8,  # of what moves with it [kg]
    lightness=f8,  # 1 / inertia, 0 for a fixed wall [1/kg]
    schedule=i8,  # schedule of its travel; -1 for none
    # offset in `plane`: travel of lines over its travel, then stretch of cells per travel [1/m]
    weights=i8,
    faces=i8,  # offset in `integers` of its face numbers on the boundary
    count=i8,  # number of its faces
    lengths=i8,  # offset in `plane` of lengths of its faces [m]
    outward=f8,  # 1 if its travel is positive outward, -1 inward
    rest=f8,  # force of the profile on it [N]
)

RECORDS = {
    "basins": BASIN,
    "patches": PATCHES,
    "walls": WALL,
    "scalars": carried.SCALAR,
    "reactions": carried.REACTION,
}
BasinTables = namedtuple("BasinTables", tuple(RECORDS))
EMPTY = BasinTables(*(np.zeros(0, kind) for kind in RECORDS.values()))


@functools.cache
def basin_types() -> BasinTables:
    """Numba types of these tables."""
    from numba import from_dtype, types

    return BasinTables(*(types.Array(from_dtype(kind), 1, "C") for kind in RECORDS.values()))


if COMPILING:

    @Intrinsic
    def open_basins(typingctx, handle):
        """Tables behind a handle as `open_tables`, and those of basins."""
        return table_handle.open_with("BasinTables", basin_types, SLOT, handle)
else:

    def open_basins(handle):
        """Tables of a handle as `open_tables`, and those of basins."""
        core = table_handle.open_tables(handle)
        return table_handle.BothTables(core, core.features[SLOT])
