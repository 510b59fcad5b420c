"""Rates of a liquid on a rectangular grid of cells, under all density laws: the loop over rows.

A row of cells is read once: for its own faces, then for those towards the rows before it. The waves across rows are
stored in a ring buffer. `grid_linear` and `grid_nonlinear` contain the functions of a row for both forms of the
momentum flux. Their arguments, and those of the functions here, are

liquid, grid : `LiquidScheme` and `LiquidGrid`; j : row
states : deviation of density r [kg/m3] and mass-flow densities mx, my [kg/(m2 s)] of all cells, three arrays
rates : arrays for the rates of the states
work, aside : `LiquidWork`, and the velocities along row j in its ring buffer
flux, before, after : values at a row of faces, three arrays: waves, then fluxes
through : float64[2 (nx + ny)]  inward flows through boundary faces [kg/(m s)], in the order of `reflect`, or empty
scratch : float64[work_size(nx)], the array that contains `work`
moves : None, or the `GridMotion` of moving walls
phi : None, or the `Potentials` of the frame of a basin on a body (full momentum flux)
"""

from fvsolve.features.basins.cell_sides import fill, stretch_row_rates
from fvsolve.features.basins.liquid import grid_linear, grid_nonlinear
from fvsolve.features.basins.liquid import liquid_sides as sides
from fvsolve.features.basins.liquid.liquid_sides import CLOSURE_CELLS, GHOSTS, ring_offset
from fvsolve.jit import njit, specialise

# of the templates: module `grid_linear` or `grid_nonlinear`, and `_ghost_rows` for it
EQUATION = GHOST_ROWS = None


@njit
def max_spacing_rate(kx, ky):
    """Greatest sum 1 / width + 1 / height over the cells [1/m]. kx, ky : 1 / widths of columns, 1 / heights of rows"""
    x, y = 0.0, 0.0
    for i in range(kx.size):
        x = max(x, kx[i])
    for j in range(ky.size):
        y = max(y, ky[j])
    return x + y


@njit
def row_needed(j, ny):
    """Number of rows of cells, from row 0, that must be read before the faces between rows j - 1 and j are computed."""
    return min(max(j + GHOSTS, CLOSURE_CELLS), ny)


def _ghost_rows(liquid, grid, north, states, work, moves, phi):
    """Fill the three rows of ghost cells beyond the southern or northern side in the ring buffer."""
    nx, ny = grid.nx, grid.ny
    for k in range(GHOSTS):
        j = ny + k if north else -1 - k
        at, turned = ring_offset(j, nx), sides.is_reversed(j, ny)
        up, down = work.up[at : at + nx], work.down[at : at + nx]
        ahead, back = (down, up) if turned else (up, down)
        EQUATION.put_row(
            liquid,
            grid,
            sides.mirrored_cell(j, ny),
            states,
            work,
            phi,
            ahead,
            back,
            work.aside[at : at + nx],
        )
        if moves is not None and moves.speed_y.size > 0 and turned:
            speed = moves.speed_y[ny] if north else -moves.speed_y[0]
            entering, leaving = (down, up) if north else (up, down)
            sides.correct_mirror_row(
                liquid.full, liquid.c, liquid.rho, speed, entering, leaving, nx
            )
    if grid.sides[3 if north else 2] != sides.WALLS:
        sides.close_rows(liquid, grid, north, work)


def _rows(liquid, grid, first, last, states, through, scratch, rates, moves, phi):
    """Write the rates of rows `first` to `last` - 1 of the band; calls must follow in the order of rows, without gaps.

    Up to three rows beyond the band are read too, and more next to open sides. Rates of rows from `last` on may be
    written incompletely; the next call completes them.
    """
    nx = grid.nx
    ny = grid.ny
    begin = grid.begin
    work = sides.open_work(scratch, grid.nx)
    read = max(min(begin - GHOSTS, ny - CLOSURE_CELLS), 0)
    if first > begin:
        read = max(read, row_needed(first, ny))
    # faces between rows j - 1 and j
    for j in range(first if first == begin else first + 1, last + 1):
        while read < row_needed(j, ny):
            at = ring_offset(read, nx)
            up = work.up[at : at + nx]
            down = work.down[at : at + nx]
            aside = work.aside[at : at + nx]
            EQUATION.put_row(liquid, grid, read, states, work, phi, up, down, aside)
            if begin <= read < grid.stop:
                EQUATION.put_rates_along(
                    liquid, grid, read, states, work, aside, through, rates, moves, phi
                )
            read += 1
        if j == begin and begin < GHOSTS:
            GHOST_ROWS(liquid, grid, False, states, work, moves, phi)
        if j == max(ny - GHOSTS + 1, begin):
            GHOST_ROWS(liquid, grid, True, states, work, moves, phi)
        before, after = sides.face_values(work, j - 1, nx), sides.face_values(work, j, nx)
        sides.put_faces_across(liquid, grid, j, work, after[0], after[1], moves)
        EQUATION.put_fluxes_across(liquid, grid, j, states, work, after, through, moves, phi)
        if j > begin:
            EQUATION.add_rates_across(liquid, grid, j - 1, states, before, after, rates, moves, phi)
        if moves is not None and j > begin:
            a, z, (rate_r, rate_x, rate_y) = (j - 1) * nx, j * nx, rates
            stretch_row_rates(
                moves.speed_x.size > 0, moves.wide, 0, j - 1, rate_r[a:z], rate_x[a:z], rate_y[a:z]
            )


linear_ghost_rows = specialise(_ghost_rows, "linear_ghost_rows", EQUATION=grid_linear)
linear_rows = specialise(_rows, "linear_rows", EQUATION=grid_linear, GHOST_ROWS=linear_ghost_rows)
nonlinear_ghost_rows = specialise(_ghost_rows, "nonlinear_ghost_rows", EQUATION=grid_nonlinear)
nonlinear_rows = specialise(
    _rows, "nonlinear_rows", EQUATION=grid_nonlinear, GHOST_ROWS=nonlinear_ghost_rows
)


@njit
def linear_grid_rates(liquid, grid, states, through, scratch, rates, moves, phi):
    """Write the rates of the band under the law `linear`; return the greatest c (kx + ky) of all cells [1/s]."""
    linear_rows(liquid, grid, grid.begin, grid.stop, states, through, scratch, rates, moves, phi)
    return liquid.c * max_spacing_rate(grid.kx, grid.ky)


@njit
def nonlinear_grid_rates(liquid, grid, states, through, scratch, rates, moves, phi):
    """Write the rates of the band with the full momentum flux; return the greatest (|u| + c) kx + (|v| + c) ky [1/s].

    The greatest value is that over all rows read.
    """
    top, most = sides.open_work(scratch, grid.nx).top, 0.0
    fill(0.0, top)
    nonlinear_rows(liquid, grid, grid.begin, grid.stop, states, through, scratch, rates, moves, phi)
    for i in range(top.size):
        most = max(most, top[i])
    return most
