"""Advection of scalars over a grid of rectangles by given flows.

s_t + div(F c) = 0, with c the value of a scalar, s = depth c its amount per area, and F the flow per width [m2/s]. The
rate of a uniform c is -c times the divergence of F, to the last bit.

The Courant number is the step times the rate of `grid_fastest`. In flows without divergence, Euler steps keep every
value within the range of its neighbours up to these Courant numbers: upwind 1; muscl 1/2, next to an inlet 1/3; muscl
with minmod 2/3, next to an inlet 1/2. Up to 1/2, weno5 keeps all values between `least` and `most`; upwind5 has no
bounds. SSP methods keep these bounds up to their SSP coefficient times these numbers.

The boundary faces of a grid are ordered west (ny), east (ny), south (nx), north (nx).
"""

from fvsolve.basins.fifth_order import add_excesses, grid_excesses, grid_excesses_work
from fvsolve.basins.flux_correction import limit_excesses, limit_excesses_work
from fvsolve.basins.second_order import second_order_rates, second_order_work
from fvsolve.jit import njit
from fvsolve.kernels.dtypes import MUSCL, UPWIND, WENO5

INFINITE = float("inf")
THIN = 1e-6  # depth below which values fade to zero [m]
WENO_COURANT = 0.5  # Courant number up to which weno5 keeps its bounds


@njit
def put_values(s, depth, c):
    """Write the values c = s / depth of cells, with a depth of at least THIN.

    s : amounts of a scalar per area; depth : depths of the cells [m]
    """
    for i in range(c.size):
        c[i] = s[i] / max(depth[i], THIN)


@njit
def stencil_values(nx, ny, begin, stop, s, depth, c):
    """Write the values c = s / depth of the cells of rows `begin` to `stop` - 1, and of three rows on either side.

    nx, ny : numbers of columns and rows of the grid; s, depth : as for `put_values`
    """
    a, z = nx * max(begin - 3, 0), nx * min(stop + 3, ny)
    put_values(s[a:z], depth[a:z], c[a:z])


@njit
def grid_fastest(nx, ny, kx, ky, flow_x, flow_y, depth, work):
    """Greatest rate |u| kx + |v| ky over the cells of a grid [1/s].

    u, v : velocities along x and y [m/s], each from the greater flow through two opposite faces of the cell
    nx, ny, kx, ky, flow_x, flow_y, depth : as for `grid_advection`; work : float64[nx]  scratch
    """
    top = work[:nx]
    for i in range(nx):
        top[i] = 0.0
    for j in range(ny):
        fw, fe = flow_x[j * (nx + 1) :], flow_x[j * (nx + 1) + 1 :]
        fs, fn, h = flow_y[j * nx :], flow_y[(j + 1) * nx :], depth[j * nx :]
        for i in range(nx):
            rate = kx[i] * ky[j] * (max(abs(fw[i]), abs(fe[i])) + max(abs(fs[i]), abs(fn[i])))
            rate = rate / max(h[i], THIN) if depth.size > 0 else rate
            top[i] = rate if rate > top[i] else top[i]
    most = 0.0
    for i in range(nx):
        most = max(most, top[i])
    return most


def advection_work(scheme, nx, ny):
    """Length of the work array of `grid_advection` and `add_fifth_order` for a scheme."""
    if scheme == UPWIND or scheme == MUSCL:
        return nx * ny + second_order_work(nx, ny)
    most = max(grid_excesses_work(nx, ny), limit_excesses_work(nx, ny), second_order_work(nx, ny))
    return nx * ny + (nx + 1) * ny + nx * (ny + 1) + most


@njit
def grid_advection(scheme, limiter, nx, ny, begin, stop, kx, ky, factor, flow_x, flow_y, depth, outside, s, work, rate):
    """Write the rates of change of the amounts `s` of a scalar by advection, with muscl or (any other scheme) upwind.

    The rates are those of rows `begin` to `stop` - 1, for all flows times `factor`. Two rows on either side are read
    too, and the rates of row `begin` - 1 may be overwritten with wrong values.
    nx, ny : numbers of columns and rows; scheme : MUSCL, else upwind; limiter : limiter of muscl
    kx, ky : float64[nx], float64[ny]  1 / widths of columns, 1 / heights of rows [1/m]; factor : of either sign
    flow_x : float64[ny (nx + 1)], flow_y : float64[(ny + 1) nx]  flows through faces, row by row: velocity [m/s] times
    face length [m2/s], and also times the depth [m3/s] if `depth` is not empty
    depth : float64[nx ny]  depths of cells [m]; empty if s contains the values c themselves
    outside : float64[2 (nx + ny)]  values of the inflow at boundary faces, in the order west, east, south, north
    s, rate : float64[nx ny]  amounts per area, and their rates; work : float64[advection_work(scheme, nx, ny)]
    """
    c, rest, first = s, work[nx * ny :], scheme if scheme == MUSCL else UPWIND
    if depth.size > 0:
        stencil_values(nx, ny, begin, stop, s, depth, work)
        c = work[: nx * ny]
    second_order_rates(
        first, limiter, nx, ny, begin, stop, stop, True, kx, ky, factor, flow_x, flow_y, outside, c, rest, rate
    )


@njit
def add_fifth_order(
    scheme, nx, ny, kx, ky, factor, flow_x, flow_y, depth, outside, least, most, fastest, s, work, rate
):
    """Add the rates by upwind5 or weno5, minus the rates by upwind, to `rate`, which contains the rates by upwind.

    Fluxes of weno5 are limited so that an Euler step of Courant number WENO_COURANT keeps the bounds.
    scheme : LINEAR for upwind5, or WENO5; least, most : bounds that weno5 keeps, infinite for none
    fastest : result of `grid_fastest` for the flows [1/s]; other arguments as for `grid_advection`
    """
    c, rest, mx, my = s, work[nx * ny :], (nx + 1) * ny, nx * (ny + 1)
    if depth.size > 0:
        put_values(s, depth, work[: nx * ny])
        c = work[: nx * ny]
    ax, ay, rest = rest[:mx], rest[mx : mx + my], rest[mx + my :]
    grid_excesses(scheme, nx, ny, factor, flow_x, flow_y, outside, c, rest, ax, ay)
    pace = abs(factor) * fastest
    if scheme == WENO5 and pace > 0.0 and (least > -INFINITE or most < INFINITE):
        limit_excesses(
            nx, ny, kx, ky, factor, flow_x, flow_y, depth, least, most, WENO_COURANT / pace, s, rate, ax, ay, rest
        )
    add_excesses(nx, ny, kx, ky, factor, ax, ay, rate)
