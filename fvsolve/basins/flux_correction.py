"""Flux-corrected transport: excess fluxes limited so that an Euler step keeps values within bounds (Zalesak 1979).

The result of upwind is within the bounds. Each cell accepts excess fluxes only up to its distance from the bounds. An
excess is the flux of a higher order minus the upwind flux.
"""

from fvsolve.jit import inline, njit


@njit
def accepted_fraction(available, need):
    """Fraction of a need that is available, from 0 to 1."""
    available = available if available > 0.0 else 0.0
    return available / need if need > available else 1.0


@njit
def sum_of_positive(a, b, c, d):
    """Sum of the positive values among a, b, c and d."""
    a, b = a if a > 0.0 else 0.0, b if b > 0.0 else 0.0
    c, d = c if c > 0.0 else 0.0, d if d > 0.0 else 0.0
    return (a + b) + (c + d)


@inline
def row_fractions(step, factor, kx, ky, fw, fe, fs, fn, depth, least, most, s, rate, aw, ae, south, north, up, down):
    """Write the fractions of excess inflow (`up`) and outflow (`down`) with which each cell of a row keeps the bounds.

    The excess fluxes are fluxes of higher order minus upwind fluxes. Fractions are at most 1.
    fw, fe, fs, fn : flows through the western, eastern, southern and northern faces
    aw, ae, south, north : excess fluxes through these faces
    kx, ky : 1 / widths of the cells, 1 / height of the row [1/m]; other arguments as for `limit_excesses`, of the row
    """
    for i in range(s.size):
        scale = step * (factor * (kx[i] * ky))
        then = s[i] + step * rate[i]
        deep = (depth[i] if depth.size > 0 else 1.0) - scale * ((fe[i] - fw[i]) + (fn[i] - fs[i]))
        a, b, c, d = scale * aw[i], -scale * ae[i], scale * south[i], -scale * north[i]
        up[i] = accepted_fraction(most * deep - then, sum_of_positive(a, b, c, d))
        down[i] = accepted_fraction(then - least * deep, sum_of_positive(-a, -b, -c, -d))


@inline
def limit_faces(factor, up, down, up_then, down_then, excess):
    """Multiply the excess fluxes through a row of faces by the fraction that the cells on both sides of a face allow.

    up, down : fractions of the cells before the faces, see `row_fractions`
    up_then, down_then : fractions of the cells behind the faces
    factor : factor on all flows, whose sign gives the direction of an excess flux
    """
    for i in range(excess.size):
        forth = down[i] if down[i] < up_then[i] else up_then[i]
        back = up[i] if up[i] < down_then[i] else down_then[i]
        excess[i] *= forth if factor * excess[i] > 0.0 else back


def limit_excesses_work(nx, ny):
    """Length of the work array of `limit_excesses`."""
    return 2 * (nx + 2) * (ny + 2)


@njit
def limit_excesses(nx, ny, kx, ky, factor, flow_x, flow_y, depth, least, most, step, s, rate, ax, ay, work):
    """Limit the excess fluxes ax, ay so that the values of a scalar after an Euler step are within their bounds.

    After the step, s + step times the corrected rates lies between least and most times the depth.
    ax, ay : fluxes of higher order minus upwind fluxes, through the faces of flow_x and flow_y, see `grid_excesses`
    rate : float64[n]  rates by upwind; step : Euler step [s]; least, most : bounds of the value of the scalar
    nx, ny, kx, ky, factor, flow_x, flow_y, depth, s : as for `advection.grid_advection`
    work : float64[limit_excesses_work(nx, ny)]
    """
    wide = nx + 2
    up, down = work[: wide * (ny + 2)], work[wide * (ny + 2) : 2 * wide * (ny + 2)]
    for i in range(up.size):
        up[i], down[i] = 1.0, 1.0  # beyond the boundary this remains
    for j in range(ny):
        a, z, w, to = j * nx, (j + 1) * nx, j * (nx + 1), (j + 1) * wide + 1
        row_fractions(
            step, factor, kx, ky[j], flow_x[w:], flow_x[w + 1 :], flow_y[a:], flow_y[z:], depth[a:], least, most,
            s[a:z], rate[a:], ax[w:], ax[w + 1 :], ay[a:], ay[z:], up[to:], down[to:],
        )  # fmt: skip
    for j in range(ny):
        at = (j + 1) * wide
        limit_faces(factor, up[at:], down[at:], up[at + 1 :], down[at + 1 :], ax[j * (nx + 1) : (j + 1) * (nx + 1)])
    for j in range(ny + 1):
        at, to = j * wide + 1, (j + 1) * wide + 1
        limit_faces(factor, up[at:], down[at:], up[to:], down[to:], ay[j * nx : (j + 1) * nx])
