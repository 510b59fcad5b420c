"""Approximate Riemann solver of Harten, Lax and van Leer (1983), of shallow water on grids, meshes and in conduits."""

from fvsolve.jit import inline

TINY = 1e-300  # keeps the width of the fan of waves above zero where nothing moves


@inline
def hll_flux(low, high, a, b, qa, qb, fa, fb, push):
    """(flux of water, flux of momentum minus the push of the water before the face, and minus that after it).

    F = (s_b F_a - s_a F_b + s_a s_b (U_b - U_a)) / (s_b - s_a), with the wave speeds s_a <= 0 <= s_b. The push of the
    water before or after the face is not added to the flux and subtracted again, so that water at rest stays at rest to
    the bit. States before and after the face are a and b.

    low, high : wave speeds s_a and s_b [m/s]; a, b : content per length of the face, or area [m, or m2]
    qa, qb : flows [m2/s, or m3/s]; fa, fb : flows of momentum without push [m3/s2, or m4/s2]
    push : push of the water after the face minus that before it, over the density [m3/s2, or m4/s2]
    """
    per_width = 1.0 / (high - low + TINY)
    wa = high * per_width
    wb = -(low * per_width)
    mix = high * low * per_width
    mass = (wa * qa + wb * qb) + mix * (b - a)
    flow = (wa * fa + wb * fb) + mix * (qb - qa)
    return mass, flow + wb * push, flow - wa * push
