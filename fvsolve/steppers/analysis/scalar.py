"""What a method makes of the test system y' = lambda y (11): local and global error, aliasing. Knows no time loop."""

from __future__ import annotations

import numpy as np

from fvsolve.doors import AMOUNT, NAME, NUMBER, POINT, POSITIVE, door
from fvsolve.steppers.analysis.facts import analyse
from fvsolve.steppers.tableau import Method


@door(method=NAME, lam=POINT, h=NUMBER, y=POINT)
def local_error(method: str | Method, lam: complex, h: float, y: complex = 1.0) -> complex:
    """e = R(h lambda) y - exp(h lambda) y, the error of one step from y (5), (28), (29): of order h^(p+1)."""
    r = analyse(method).stability_function
    return complex((r(h * lam) - np.exp(h * lam)) * y)


@door(method=NAME, lam=POINT, h=NUMBER, steps=AMOUNT, y=POINT)
def global_error(method: str | Method, lam: complex, h: float, steps: int, y: complex = 1.0) -> complex:
    """E = R(h lambda)^n y - exp(n h lambda) y, the error after n steps from y (6): of order h^p at a fixed n h.

    It is the sum of the local errors, each carried on by the method: sum_k R^(n-1-k) e_k+1.
    """
    r = analyse(method).stability_function
    return complex((r(h * lam) ** steps - np.exp(steps * h * lam)) * y)


@door(method=NAME, omega=NUMBER, h=POSITIVE)
def seen_frequency(method: str | Method, omega: float, h: float) -> float:
    """Frequency [rad/s] at which an oscillation of omega [rad/s] shows up in steps of h [s]: |arg R(i omega h)| / h.

    It is never above pi / h: an A-stable method shows what is faster as something slower (5.8).
    """
    r = analyse(method).stability_function
    return float(abs(np.angle(r(1j * omega * h))) / h)
