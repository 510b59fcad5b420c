"""Errors of a method on the test equation y' = lambda y: local and global error, aliasing.

Numbers in brackets are equations and sections of docs/course.md.
"""

from __future__ import annotations

import numpy as np

from fvsolve.steppers.analysis.method_facts import analyse
from fvsolve.steppers.tableau import Method
from fvsolve.validation import COUNT_FROM_ZERO, NAME, NUMBER, POINT, POSITIVE, validated


@validated(method=NAME, lam=POINT, h=NUMBER, y=POINT)
def local_error(method: str | Method, lam: complex, h: float, y: complex = 1.0) -> complex:
    """Error R(h lambda) y - exp(h lambda) y of one step from y, of order h^(p+1).

    It is given by equations (5), (28), (29) of docs/course.md.
    R : stability function; p : order of the method; lam : lambda [1/s]; h : step [s]
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) - np.exp(h * lam)) * y)


@validated(method=NAME, lam=POINT, h=NUMBER, steps=COUNT_FROM_ZERO, y=POINT)
def global_error(method: str | Method, lam: complex, h: float, steps: int, y: complex = 1.0) -> complex:
    """Error R(h lambda)^n y - exp(n h lambda) y after n = `steps` steps from y, of order h^p at a fixed time n h.

    It is the sum of the propagated local errors e_k: sum_k R^(n-1-k) e_k+1 (docs/course.md, (6)).
    R : stability function; p : order of the method; lam : lambda [1/s]; h : step [s]
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) ** steps - np.exp(steps * h * lam)) * y)


@validated(method=NAME, omega=NUMBER, h=POSITIVE)
def seen_frequency(method: str | Method, omega: float, h: float) -> float:
    """Frequency of the numerical solution [rad/s] for an oscillation with the frequency `omega` [rad/s].

    It is |arg R(i omega h)| / h with the stability function R and the step h [s]. It never exceeds pi / h: an A-stable
    method aliases faster oscillations to slower oscillations (docs/course.md, 5.8).
    """
    r = analyse(method).stability_function
    return float(abs(np.angle(r(1j * omega * h))) / h)
