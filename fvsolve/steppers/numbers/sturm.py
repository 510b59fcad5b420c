"""Real roots and signs of polynomials in exact arithmetic (Sturm 1829, Routh 1877)."""

from __future__ import annotations

from fractions import Fraction

from fvsolve.steppers.numbers.polynomial import Polynomial, sign

DIGITS = Fraction(1, 1 << 64)  # relative width of the bracket of a root


def chain(p: Polynomial) -> list[Polynomial]:
    """Sturm's chain of p: p, p', then the negative remainders of successive divisions, scaled by positive numbers."""
    polynomials = [p, p.derivative()]
    while polynomials[-1].degree > 0:
        remainder = -(polynomials[-2] % polynomials[-1])
        if remainder.degree < 0:
            break
        top = remainder.coefficients[-1]
        polynomials.append(remainder / (top if sign(top) > 0 else -top))
    return polynomials


def count_roots(p: Polynomial, low=None, high=None) -> int:
    """Number of distinct real roots of p in low < x <= high; None stands for infinity. `p` must not be zero."""
    if p.degree < 1:
        return 0
    polynomials = chain(p)
    return _changes(polynomials, low, -1) - _changes(polynomials, high, 1)


def odd_part(p: Polynomial) -> Polynomial:
    """Polynomial with a single root wherever p changes sign: product of the factors of odd multiplicity (Yun 1976)."""
    product, k = Polynomial([1]), 1
    common = p.gcd(p.derivative())
    w, y = p // common, p.derivative() // common
    while w.degree > 0:
        z = y - w.derivative()
        factor = w.gcd(z) if z.degree >= 0 else w.monic()
        if k % 2:
            product = product * factor
        w, y = w // factor, z // factor
        k += 1
    return product


def first_sign_change(p: Polynomial) -> float | None:
    """Least x > 0 at which p changes sign, accurate to about the last bit; None without sign change there."""
    p = odd_part(p) if p.degree > 0 else p
    while p.degree > 0 and p.coefficients[0] == 0:
        p = Polynomial(p.coefficients[1:])
    if p.degree < 1:
        return None
    polynomials, low, high = chain(p), Fraction(0), Fraction(1)
    at_low, far = _changes(polynomials, low, 1), _changes(polynomials, None, 1)
    if at_low == far:
        return None
    while _changes(polynomials, high, 1) == at_low:
        low, high = high, 2 * high
    while at_low - _changes(polynomials, high, 1) > 1:
        middle = (low + high) / 2
        if _changes(polynomials, middle, 1) == at_low:
            low = middle
        else:
            high = middle
    rising = sign(p(high))
    if rising == 0:
        return float(high)
    while high - low > high * DIGITS:
        middle = (low + high) / 2
        now = sign(p(middle))
        if now == 0:
            return float(middle)
        if now == rising:
            high = middle
        else:
            low = middle
    return float(high)


def nowhere_negative(p: Polynomial) -> bool:
    """True if p(x) >= 0 for all x >= 0."""
    return p.degree < 0 or (sign(p.coefficients[-1]) > 0 and first_sign_change(p) is None)


def roots_right(p: Polynomial) -> bool:
    """True if all roots of p lie in the open right half plane, by Routh's array of p(-x)."""
    up = [x if k % 2 == 0 else -x for k, x in enumerate(p.coefficients)][::-1]
    upper, lower = up[0::2], up[1::2]
    first = sign(upper[0])
    while lower:
        if sign(lower[0]) != first:
            return False
        ratio = upper[0] / lower[0]
        rest = [x - ratio * y for x, y in zip(upper[1:], [*lower[1:], Fraction(0)], strict=False)]
        upper, lower = lower, rest
    return True


def _changes(polynomials: list[Polynomial], x, side: int) -> int:
    """Number of sign changes along a Sturm chain at x, or at side * infinity if x is None."""
    signs = [sign(q(x)) if x is not None else _far(q, side) for q in polynomials]
    signs = [s for s in signs if s != 0]
    return sum(a != b for a, b in zip(signs, signs[1:], strict=False))


def _far(p: Polynomial, side: int) -> int:
    if p.degree < 0:
        return 0
    top = sign(p.coefficients[-1])
    return top if side > 0 or p.degree % 2 == 0 else -top
