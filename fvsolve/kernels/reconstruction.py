"""Values at faces from cell averages, biased to the side from which a wave comes.

Every loop reads a window P of cell averages and writes face values F: face j lies between P[j+2] and P[j+3]. A forward
wave uses P[j] .. P[j+4], a backward wave P[j+5] .. P[j+1].
"""

from fvsolve.jit import inline, njit
from fvsolve.kernels.dtypes import LINEAR, MUSCL, SHORT, UPWIND
from fvsolve.kernels.limiters import by_limiter, limited, slope


@njit
def value_weno5(a, b, c, d, e, small):
    """Fifth-order WENO-Z value at the face after cell c (Borges et al. 2008), from the averages of five cells a .. e.

    small : square of a negligible value, which prevents a division by zero
    """
    p0 = (2.0 * a - 7.0 * b + 11.0 * c) / 6.0
    p1 = (-b + 5.0 * c + 2.0 * d) / 6.0
    p2 = (2.0 * c + 5.0 * d - e) / 6.0
    s0 = 13.0 / 12.0 * (a - 2.0 * b + c) ** 2 + 0.25 * (a - 4.0 * b + 3.0 * c) ** 2
    s1 = 13.0 / 12.0 * (b - 2.0 * c + d) ** 2 + 0.25 * (b - d) ** 2
    s2 = 13.0 / 12.0 * (c - 2.0 * d + e) ** 2 + 0.25 * (3.0 * c - 4.0 * d + e) ** 2
    tau = abs(s0 - s2)
    r0 = tau / (s0 + small)
    r1 = tau / (s1 + small)
    r2 = tau / (s2 + small)
    w0 = 0.1 * (1.0 + r0 * r0)
    w1 = 0.6 * (1.0 + r1 * r1)
    w2 = 0.3 * (1.0 + r2 * r2)
    return (w0 * p0 + w1 * p1 + w2 * p2) / (w0 + w1 + w2)


@njit
def value_muscl(limiter, b, c, d):
    """Second-order value at the face after cell c with a limited slope, from the averages of cells b, c, d."""
    return c + 0.5 * limited(limiter, c - b, d - c)


@njit
def faces_linear(w0, w1, w2, w3, w4, w5, p, f):
    """Write face values of a linear scheme: f[j] = sum of w_k p[j+k]."""
    for j in range(f.size):
        f[j] = (w0 * p[j] + w1 * p[j + 1]) + (w2 * p[j + 2] + w3 * p[j + 3]) + (w4 * p[j + 4] + w5 * p[j + 5])


@inline
def muscl_forward(limiter, p, f):
    """Write limited second-order face values of a forward wave to f; face j lies between p[j+2] and p[j+3]."""
    for j in range(f.size):
        f[j] = p[j + 2] + 0.5 * slope(limiter, p[j + 2] - p[j + 1], p[j + 3] - p[j + 2])


@inline
def muscl_backward(limiter, p, f):
    """Write limited second-order face values of a backward wave to f; face j lies between p[j+2] and p[j+3]."""
    for j in range(f.size):
        f[j] = p[j + 3] - 0.5 * slope(limiter, p[j + 4] - p[j + 3], p[j + 3] - p[j + 2])


@njit
def faces_weno5(small, backward, p, f):
    """Write fifth-order WENO-Z face values to f; face j lies between p[j+2] and p[j+3].

    backward : 1 for a backward wave; small : square of a negligible value
    """
    if backward == 1:
        for j in range(f.size):
            f[j] = value_weno5(p[j + 5], p[j + 4], p[j + 3], p[j + 2], p[j + 1], small)
    else:
        for j in range(f.size):
            f[j] = value_weno5(p[j], p[j + 1], p[j + 2], p[j + 3], p[j + 4], small)


@njit
def faces(settings, scheme, small, backward, p, f):
    """Write face values to f by a scheme family; face j lies between the cell averages p[j+2] and p[j+3].

    backward : 1 for a backward wave; small : square of a negligible value
    """
    if scheme == UPWIND:
        for j in range(f.size):
            f[j] = p[j + 3] if backward == 1 else p[j + 2]
    elif scheme == LINEAR:
        s = settings
        if backward == 1:
            faces_linear(s["w5"], s["w4"], s["w3"], s["w2"], s["w1"], s["w0"], p, f)
        else:
            faces_linear(s["w0"], s["w1"], s["w2"], s["w3"], s["w4"], s["w5"], p, f)
    elif scheme == SHORT:
        b, c, d = -1.0 / 6.0, 5.0 / 6.0, 1.0 / 3.0
        if backward == 1:
            faces_linear(0.0, 0.0, d, c, b, 0.0, p, f)
        else:
            faces_linear(0.0, b, c, d, 0.0, 0.0, p, f)
    elif scheme == MUSCL:
        if backward == 1:
            by_limiter(muscl_backward, settings["limiter"], p, f)
        else:
            by_limiter(muscl_forward, settings["limiter"], p, f)
    else:
        faces_weno5(small, backward, p, f)
