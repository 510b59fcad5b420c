"""Hydraulic axis with servo valve and PI controller (`servo-axis`), by hand, independent of fvsolve.

States: position and velocity of the load, masses in chambers A and B, position and speed of the spool, integral of the
controller. The functions use numbers alone, so that numba can compile them.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

AMBIENT, RHO, BETA, NU = 101325.0, 870.0, 1.2e9, 32e-6
MASS, FRICTION, STROKE = 120.0, 3000.0, 0.4
AREA_A, AREA_B, DEAD = 12e-4, 8e-4, 1e-4
SUPPLY, SUMP = AMBIENT + 140e5, AMBIENT
EDGE = 40e-3 / 60.0 / math.sqrt(2.0 * 35e5 / RHO)  # Cd A of an edge [m2]
FREQUENCY, FASTEST, UNDERLAP = 2.0 * math.pi * 60.0, 1.0 / 15e-3, 0.02
GAIN, INTEGRAL, TRACKING = 20.0, 0.3, 0.05
# flow below which an edge is laminar [kg/s]
SLOW = 10.0 * math.pi / 4.0 * math.sqrt(4.0 * EDGE / math.pi) * RHO * NU
STEP, LOADED, END = 0.2, 1.2, 2.0
SCALE = np.array([1e-2, 0.1, 1e-3, 1e-3, 0.1, 10.0, 0.1])


def axis(compiled=lambda function: function, damping=0.8, fastest=FASTEST):
    """Function (t, y, d, at_stop) that writes the rates of the axis to d, before LOADED and STEP by t.

    compiled : decorator of its functions; at_stop : True while the spool rests at its upper stop
    """

    @compiled
    def edge(opening, p_up, p_down):
        """Mass flow of an edge [kg/s]."""
        if opening <= 0.0:
            return 0.0
        size = 2.0 * RHO * (EDGE * opening) ** 2 * abs(p_up - p_down)
        x = size / SLOW**2
        flow = math.sqrt(size) if x >= 1.0 else SLOW * x * (45.0 - 18.0 * x**2 + 5.0 * x**4) / 32.0
        return flow if p_up > p_down else -flow

    @compiled
    def rates(t, y, d, at_stop):
        x, v, s, speed = y[0], y[1], y[4], y[5]
        target, load = 0.05 if t < STEP else 0.15, 2800.0 if t < LOADED else 4800.0
        e = target - x
        wished = GAIN * e + y[6]
        out = min(max(wished, -1.0), 1.0)
        d[6] = GAIN / INTEGRAL * e + (out - wished) / TRACKING
        push = FREQUENCY * (FREQUENCY * (out - s) - 2.0 * damping * speed)
        limited = (speed >= fastest and push > 0.0) or (speed <= -fastest and push < 0.0)
        d[4] = 0.0 if at_stop else speed
        d[5] = 0.0 if at_stop or limited else push
        volume_a, volume_b = DEAD + AREA_A * x, DEAD + AREA_B * (STROKE - x)
        p_a = AMBIENT + BETA * (y[2] / (RHO * volume_a) - 1.0)
        p_b = AMBIENT + BETA * (y[3] / (RHO * volume_b) - 1.0)
        out_side, in_side = (s + UNDERLAP) / (1.0 + UNDERLAP), (UNDERLAP - s) / (1.0 + UNDERLAP)
        d[2] = edge(out_side, SUPPLY, p_a) - edge(in_side, p_a, SUMP)
        d[3] = edge(in_side, SUPPLY, p_b) - edge(out_side, p_b, SUMP)
        d[0] = v
        d[1] = (AREA_A * (p_a - AMBIENT) - AREA_B * (p_b - AMBIENT) - FRICTION * v - load) / MASS

    return rates


def start() -> np.ndarray:
    """State at rest, with 70 bar above ambient in both chambers."""
    full = RHO * (1.0 + 70e5 / BETA)
    return np.array(
        [
            0.05,
            0.0,
            full * (DEAD + AREA_A * 0.05),
            full * (DEAD + AREA_B * (STROKE - 0.05)),
            0,
            0,
            0.0,
        ]
    )


def trajectory(times: np.ndarray, rtol: float = 1e-12) -> np.ndarray:
    """States at increasing times : float64[7, times], by SciPy's DOP853 with the stop of the spool as an event."""
    rates, y, t, at_stop, found = axis(), start(), 0.0, False, []

    def follow(t, y):
        d = np.empty(7)
        rates(min(t, last), y, d, at_stop)
        return d

    def reaches(t, y):
        return 1.0 - y[4]

    def leaves(t, y):
        return GAIN * ((0.05 if t < STEP else 0.15) - y[0]) + y[6] - 1.0

    reaches.terminal, leaves.terminal, reaches.direction, leaves.direction = True, True, -1.0, -1.0
    for end in sorted({STEP, LOADED, times[-1]}):
        last = np.nextafter(end, 0.0)
        while t < end:
            part = solve_ivp(
                follow,
                (t, end),
                y,
                method="DOP853",
                rtol=rtol,
                atol=rtol * SCALE,
                max_step=2e-3,
                events=leaves if at_stop else reaches,
                dense_output=True,
            )
            inside = times[(times >= t) & (times < part.t[-1])]
            found += [part.sol(inside)] if inside.size else []
            t, y = part.t[-1], part.y[:, -1].copy()
            if part.status == 1:
                at_stop = not at_stop
                y[4:6] = 1.0, 0.0
    return np.column_stack([*found, y[:, None]])
