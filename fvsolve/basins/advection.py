"""Scalars carried over a grid of rectangles by given flows. Knows amounts and depths; not what makes the flows.

s_t + div(F c) = 0 for amounts s = depth c per area. Rates of a uniform c are c times the divergence of F, to the bit.
In flows without divergence, Euler steps up to these Courant numbers (with the rate of `grid_fastest`) keep every value
between those around it: upwind 1, muscl 1/2 and beside an inlet 1/3, with minmod 2/3 and 1/2. Up to 1/2 weno5 keeps all
between `least` and `most`; upwind5 promises nothing. SSP methods do as Euler within their coefficient.

The ring of a grid is its boundary faces, west (ny), east (ny), south (nx), north (nx).
"""

from fvsolve.basins.bounds import bound, bound_work
from fvsolve.basins.fifth_order import grid_excesses, grid_excesses_work, settle_excesses
from fvsolve.basins.second_order import second_order_rates, second_order_work
from fvsolve.jit import njit
from fvsolve.kernels.records import MUSCL, UPWIND, WENO5

INFINITE = float("inf")
THIN = 1e-6  # depth below which values fade [m]
BOUND = 0.5  # Courant number up to which weno5 keeps its bounds


@njit
def put_values(s, depth, c):
    """Values c = s / depth of cells."""
    for i in range(c.size):
        c[i] = s[i] / max(depth[i], THIN)


@njit
def near_values(nx, ny, begin, stop, s, depth, c):
    """Values of cells of rows `begin` to `stop` and of three beside them."""
    a, z = nx * max(begin - 3, 0), nx * min(stop + 3, ny)
    put_values(s[a:z], depth[a:z], c[a:z])


@njit
def grid_fastest(nx, ny, kx, ky, flow_x, flow_y, depth, work):
    """The greatest rate |u| kx + |v| ky of a grid [1/s], u and v from the greater flows on either side of a cell.

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
    """Floats that rates of a scheme are worked out in."""
    if scheme == UPWIND or scheme == MUSCL:
        return nx * ny + second_order_work(nx, ny)
    both = max(grid_excesses_work(nx, ny), bound_work(nx, ny), second_order_work(nx, ny))
    return nx * ny + (nx + 1) * ny + nx * (ny + 1) + both


@njit
def grid_advection(scheme, limiter, nx, ny, begin, stop, kx, ky, factor, flow_x, flow_y, depth, outside, s, work, rate):
    """Rates of the amounts `s` that factor times the flows carry, by muscl or, any other scheme, by upwind.

    They are those of rows `begin` to `stop`, for which two rows beside these are looked at too.
    kx : float64[nx], ky : float64[ny]  1 / widths and heights [1/m]; factor : on all flows, of either sign
    flow_x : float64[ny (nx + 1)], flow_y : float64[(ny + 1) nx]  through the faces, row by row, per depth [m2/s] or,
    with depths, whole [m3/s]
    depth : float64[nx ny], empty where s is the value; outside : float64[ring]  values that come in with the flow
    work : float64[advection_work(scheme, nx, ny)]; s, rate : float64[nx ny]
    """
    c, rest, first = s, work[nx * ny :], scheme if scheme == MUSCL else UPWIND
    if depth.size > 0:
        near_values(nx, ny, begin, stop, s, depth, work)
        c = work[: nx * ny]
    second_order_rates(
        first, limiter, nx, ny, begin, stop, stop, True, kx, ky, factor, flow_x, flow_y, outside, c, rest, rate
    )


@njit
def add_fifth_order(
    scheme, nx, ny, kx, ky, factor, flow_x, flow_y, depth, outside, least, most, fastest, s, work, rate
):
    """Add to rates by upwind what those by upwind5 or weno5 have beyond them.

    scheme : LINEAR, which is upwind5, or WENO5; least, most : bounds that weno5 keeps, infinite for none
    fastest : what `grid_fastest` says of the flows [1/s]; the others as of `grid_advection`
    """
    c, rest, mx, my = s, work[nx * ny :], (nx + 1) * ny, nx * (ny + 1)
    if depth.size > 0:
        put_values(s, depth, work[: nx * ny])
        c = work[: nx * ny]
    ax, ay, rest = rest[:mx], rest[mx : mx + my], rest[mx + my :]
    grid_excesses(scheme, nx, ny, factor, flow_x, flow_y, outside, c, rest, ax, ay)
    pace = abs(factor) * fastest
    if scheme == WENO5 and pace > 0.0 and (least > -INFINITE or most < INFINITE):
        bound(nx, ny, kx, ky, factor, flow_x, flow_y, depth, least, most, BOUND / pace, s, rate, ax, ay, rest)
    settle_excesses(nx, ny, kx, ky, factor, ax, ay, rate)
