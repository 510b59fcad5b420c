"""Advection of scalars over a grid of rectangles by given flows.

s_t + div(F c) = 0, with c the value of a scalar, s = depth c its amount per area, and F the flow per width [m2/s]. The
rate of a uniform c is c times the divergence of F, to the last bit.

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
    """Write the values c = s / depth of cells; s : amounts per area, depth [m]."""
    for i in range(c.size):
        c[i] = s[i] / max(depth[i], THIN)


@njit
def stencil_values(nx, ny, begin, stop, s, depth, c):
    """Write the values c = s / depth of the cells of rows `begin` to `stop` - 1, and of three rows on either side."""
    a, z = nx * max(begin - 3, 0), nx * min(stop + 3, ny)
    put_values(s[a:z], depth[a:z], c[a:z])


@njit
def grid_fastest(nx, ny, kx, ky, flow_x, flow_y, depth, work):
    """Greatest rate |u| kx + |v| ky of the cells of a grid [1/s], with the greater flow of opposite faces of a cell.

    u, v : velocities along x and y [m/s]; kx, ky and flows as for `grid_advection`
    work : float64[nx]
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
    """Write the rates of the amounts `s` by muscl or, for any other scheme, by upwind, in flows times `factor`.

    The rates are those of rows `begin` to `stop` - 1; two rows on either side are read too.
    kx : float64[nx], ky : float64[ny]  1 / widths and heights of cells [1/m]
    factor : factor of either sign on all flows
    flow_x : float64[ny (nx + 1)], flow_y : float64[(ny + 1) nx]  flows through faces, row by row: velocity [m/s] times
        face length, [m2/s], if `depth` is empty; else with depth [m3/s]
    depth : float64[nx ny]  depths of cells [m]; empty if s is the value c
    outside : float64[2 (nx + ny)]  values of inflow at boundary faces
    work : float64[advection_work(scheme, nx, ny)]; s, rate : float64[nx ny]
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
    """Add to rates by upwind their difference from the rates by upwind5 or weno5.

    scheme : LINEAR for upwind5, or WENO5; least, most : bounds that weno5 keeps, infinite for none
    fastest : rate of `grid_fastest` for the flows [1/s]; other arguments as for `grid_advection`
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
