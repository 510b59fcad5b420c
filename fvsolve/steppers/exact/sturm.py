"""Real roots of polynomials with exact coefficients, counted and bracketed (Sturm 1829). Knows no method."""

from __future__ import annotations

from fvsolve.steppers.exact.polynomial import Polynomial, sign


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
