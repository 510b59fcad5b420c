"""Real roots and signs of polynomials with exact coefficients, decided (Sturm 1829, Routh 1877). Knows no method."""

from __future__ import annotations

from fractions import Fraction

from fvsolve.steppers.numbers.polynomial import Polynomial, sign

DIGITS = Fraction(1, 1 << 64)  # a root is bracketed this closely, relative to itself


def chain(p: Polynomial) -> list[Polynomial]:
    """Sturm's chain p, p', -rem, ...; each scaled by a positive number."""
    found = [p, p.derivative()]
    while found[-1].degree > 0:
        rest = -(found[-2] % found[-1])
        if rest.degree < 0:
            break
        top = rest.coefficients[-1]
        found.append(rest / (top if sign(top) > 0 else -top))
    return found


def count_roots(p: Polynomial, low=None, high=None) -> int:
    """How many different real roots lie in (low, high]; None is infinity. `p` is not zero."""
    if p.degree < 1:
        return 0
    found = chain(p)
    return _changes(found, low, -1) - _changes(found, high, 1)


def odd_part(p: Polynomial) -> Polynomial:
    """The product of the factors of odd multiplicity: where p changes its sign, all roots single (Yun 1976)."""
    found, k = Polynomial([1]), 1
    common = p.gcd(p.derivative())
    w, y = p // common, p.derivative() // common
    while w.degree > 0:
        z = y - w.derivative()
        factor = w.gcd(z) if z.degree >= 0 else w.monic()
        if k % 2:
            found = found * factor
        w, y = w // factor, z // factor
        k += 1
    return found


def first_sign_change(p: Polynomial) -> float | None:
    """The least x > 0 at which p changes its sign, to the last bit or nearly; None where it never does."""
    p = odd_part(p) if p.degree > 0 else p
    while p.degree > 0 and p.coefficients[0] == 0:
        p = Polynomial(p.coefficients[1:])
    if p.degree < 1:
        return None
    found, low, high = chain(p), Fraction(0), Fraction(1)
    at_low, far = _changes(found, low, 1), _changes(found, None, 1)
    if at_low == far:
        return None
    while _changes(found, high, 1) == at_low:
        low, high = high, 2 * high
    while at_low - _changes(found, high, 1) > 1:
        middle = (low + high) / 2
        if _changes(found, middle, 1) == at_low:
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
    """Whether p(x) >= 0 for all x >= 0."""
    return p.degree < 0 or (sign(p.coefficients[-1]) > 0 and first_sign_change(p) is None)


def roots_right(p: Polynomial) -> bool:
    """Whether all roots lie in the open right half plane, by Routh's array of p(-x)."""
    up = [x if k % 2 == 0 else -x for k, x in enumerate(p.coefficients)][::-1]
    one, two = up[0::2], up[1::2]
    first = sign(one[0])
    while two:
        if sign(two[0]) != first:
            return False
        ratio = one[0] / two[0]
        rest = [x - ratio * y for x, y in zip(one[1:], [*two[1:], Fraction(0)], strict=False)]
        one, two = two, rest
    return True


def _changes(found: list[Polynomial], x, side: int) -> int:
    """Changes of sign along the chain at x, or at side * infinity."""
    signs = [sign(q(x)) if x is not None else _far(q, side) for q in found]
    signs = [s for s in signs if s != 0]
    return sum(one != two for one, two in zip(signs, signs[1:], strict=False))


def _far(p: Polynomial, side: int) -> int:
    if p.degree < 0:
        return 0
    top = sign(p.coefficients[-1])
    return top if side > 0 or p.degree % 2 == 0 else -top
