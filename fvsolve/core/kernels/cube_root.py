"""Reciprocal of a cube root, in loops that vectorise."""

from fvsolve.jit import COMPILING, Intrinsic, njit

if COMPILING:

    @Intrinsic
    def estimate(typingctx, x):
        """Estimate of x^(-1/3) for x > 0, within 4 %."""
        from fvsolve.compile.code_generation import estimated_cube_root_reciprocal

        return estimated_cube_root_reciprocal()

else:

    def estimate(x):
        """x^(-1/3) for x > 0."""
        return x ** (-1.0 / 3.0)


@njit(forceinline=True)
def cube_root_reciprocal(x):
    """x^(-1/3) to round-off for x > 0.

    An estimate r is multiplied twice by terms of the series of (1 - e)^(-1/3) with e = 1 - x r^3. Loops with this
    function vectorise, unlike loops with a power function.
    """
    r = estimate(x)
    e = 1.0 - x * r * r * r
    r *= 1.0 + e * (1.0 / 3.0 + e * (2.0 / 9.0 + e * (14.0 / 81.0 + e * (35.0 / 243.0))))
    # The error left is so small that two terms of the series reach round-off.
    e = 1.0 - x * r * r * r
    return r * (1.0 + e * (1.0 / 3.0 + e * (2.0 / 9.0)))
