"""Regulating valves in series with a rigid column, by SciPy and independent of fvsolve."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def rates_of(source, lifted, g, stroke, inertia, friction):
    """Function that returns the rates of [lift, mass flow]."""

    def rates(t, y):
        drop = (y[1] / y[0]) ** 2 / g
        return [lifted(t, drop) / stroke, (source(t) - drop - friction * y[1] * abs(y[1])) / inertia]

    return rates


def leaves_with_column(source, lifted, g, stroke, inertia, friction, start, kinks, at):
    """[lift, mass flow] at times `at` of a stem that opens at `start` for the rigid column that it blocks.

    inertia dM/dt = source(t) - M^2 / (G x^2) - friction M |M|, stroke dx/dt = lifted(t, drop). Lift and flow start as
    powers of the time s since `start`: x = a s^2, M = a s^2 sqrt(G source), at s = 1e-5.
    """
    s = 1e-5
    drop = source(start + s)
    steep = (lifted(start + s, drop) - lifted(start, source(start))) / s
    felt = lifted(start, 1.0) - lifted(start, 0.0)  # slope over the drop
    root = math.sqrt(g * drop)
    x = 0.5 * steep * s**2 / (stroke + felt * inertia * root)  # stroke x' = steep s - felt inertia root x'

    rates = rates_of(source, lifted, g, stroke, inertia, friction)
    y, now, found = [x, root * x], start + s, {}
    for end in [*(k for k in kinks if k > now), max(at)]:
        step = solve_ivp(rates, (now, end), y, method="Radau", rtol=1e-10, atol=1e-14, dense_output=True)
        found |= {t: step.sol(t) for t in at if now <= t <= end}
        now, y = end, step.y[:, -1]
    return np.array([found[t] for t in at]).T


def shuts_with_column(source, lifted, g, stroke, inertia, friction, start):
    """Closing time of a stem whose sensed value is the set value until `start` [s].

    The last part of the stroke, from a lift of 1e-5, is extrapolated at constant speed.
    """
    drop = brentq(lambda drop: lifted(0.0, drop), 1.0, 1e6)
    flow = math.sqrt((source(0.0) - drop) / friction)
    seat = lambda t, y: y[0] - 1e-5  # noqa: E731
    seat.terminal = True
    rates = rates_of(source, lifted, g, stroke, inertia, friction)
    now, y = start, [flow / math.sqrt(g * drop), flow]
    for end in (start + 2.0, start + 6.0):
        step = solve_ivp(rates, (now, end), y, method="Radau", rtol=1e-9, atol=1e-13, events=seat)
        now, y = step.t[-1], step.y[:, -1]
        if step.status == 1:
            break
    return now - y[0] / rates(now, y)[0]
