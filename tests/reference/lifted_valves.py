"""Lifted valves by SciPy, independent of fvsolve: discs with waves on a pipe, discs and stems with rigid columns."""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12, "dense_output": True}


def stop_events(push, held: int, k: int) -> list:
    """Terminal events of a lift y[k]: its drive `push` turns while it is held at a stop, or it reaches a stop."""
    if held:
        watch = [lambda s, z: push(s, z)]
        watch[0].direction = -held
    else:
        watch = [lambda s, z: z[k] - 1.0, lambda s, z: z[k]]
        watch[0].direction, watch[1].direction = 1, -1
    for one in watch:
        one.terminal = True
    return watch


def stopped(rates, push, start, kinks, t):
    """States at t of y' = rates(t, y, held) with the lift y[1] between stops at 0 and 1, and the times of events.

    rates(t, y, held) : list, with the rates of the lift zero while held; push(t, y) : drive of the lift. An optional
    speed y[2] becomes zero at a stop. Further states may follow. The solution is computed piece by piece between kinks
    and events.
    """
    y, now, held = np.array(start, float), t[0], 0
    if y[1] <= 0.0 and push(now, y) <= 0.0:
        held = -1
    found, events = np.zeros((len(y), len(t))), []
    while now < t[-1] - 1e-12:
        end = next(k for k in [*kinks, t[-1]] if k > now + 1e-12)
        watch = stop_events(push, held, 1)
        step = solve_ivp(lambda s, z, h=held: rates(s, z, h), (now, end), y, events=watch, **TIGHT)
        here = (t >= now - 1e-12) & (t <= step.t[-1] + 1e-12)
        if here.any():
            found[:, here] = step.sol(t[here])
        now, y = step.t[-1], step.y[:, -1].copy()
        if step.status == 1:
            events.append(now)
            held = 0 if held else 1 if len(step.t_events[0]) else -1
            if held:
                y[1] = max(held, 0)
                y[2:3] = 0.0
    found[1] = np.clip(found[1], 0.0, 1.0)
    return found, events


def slam(source, g, impedance, delay, far, span, time, t_end, kinks):
    """Times, rows [lift, mass flow, downstream pressure] and events of a check valve with a slow disc before a pipe.

    The pipe is frictionless. source(t) : upstream pressure [Pa]; far : pressure at the far end of the pipe [Pa], whose
    waves return after `delay` [s]. The downstream pressure is p_behind = p0 + Z (M - M0) + w with
    w(t) = -(p' + Z M')(t - delay), and M |M| = G x^2 (source - p_behind).
    """
    first = math.sqrt(g * (source(0.0) - far))
    pieces: list = []

    def returned(t):
        if t <= delay:
            return 0.0
        x = next(sol for end, sol in pieces if t - delay <= end + 1e-15)(t - delay)[0]
        m, p = flow(t - delay, min(max(x, 0.0), 1.0))
        return -((p - far) + impedance * (m - first))

    cache: dict = {}

    def flow(t, x):
        if t not in cache:
            cache[t] = returned(t)
        w = cache[t]
        d, open_ = source(t) - far + impedance * first - w, g * x * x
        root = open_ * impedance + math.sqrt((open_ * impedance) ** 2 + 4.0 * open_ * abs(d))
        m = 2.0 * open_ * d / root if open_ > 0.0 else 0.0
        return m, far + impedance * (m - first) + w

    def push(t, y):
        return (source(t) - flow(t, min(max(y[0], 0.0), 1.0))[1]) / span - y[0]

    now, y, held = 0.0, [1.0], 1
    times, rows, events = [], [], []
    while now < t_end - 1e-12:
        end = next(
            k
            for k in [*sorted({*kinks, *np.arange(delay, t_end, delay)}), t_end]
            if k > now + 1e-12
        )
        end = min(end, now + delay)
        watch = stop_events(push, held, 0)
        rate = (lambda s, z: [0.0]) if held else (lambda s, z: [push(s, z) / time])
        step = solve_ivp(
            rate,
            (now, end),
            y,
            events=watch,
            method="DOP853",
            rtol=1e-9,
            atol=1e-10,
            dense_output=True,
            max_step=0.02,
        )
        pieces.append((step.t[-1], step.sol))
        for s in np.linspace(now, step.t[-1], 100)[:-1]:
            x = min(max(step.sol(s)[0], 0.0), 1.0)
            times.append(s)
            rows.append((x, *flow(s, x)))
        now, y = step.t[-1], [float(step.y[0, -1])]
        if step.status == 1:
            events.append((now, held))
            held = 0 if held else 1 if len(step.t_events[0]) else -1
            if held:
                y = [float(max(held, 0))]
    return np.array(times), np.array(rows).T, events


def leaves_with_column(source, kink, g, beyond, span, disc, inertia, friction, felt, at):
    """Start time, and [lift, mass flow] at times `at`, of a disc that opens for the rigid column that it blocks.

    inertia dM/dt = source(t) - M |M| / (G x^2) - friction M |M|. The lifting pressure minus `beyond` drives the disc.
    It
    is the drop or, with felt == "source", the source.
    disc : {"time_constant"} or {"natural_frequency", "damping_ratio"}
    Lift and flow start as powers of the time s since the start: x = a s^n, M = a s^n sqrt(G beyond), at s = 1e-4.
    """
    start, s = brentq(lambda t: source(t) - beyond, kink - 1.0, kink, xtol=1e-15), 1e-4
    rise, root = (source(start + 1e-3) - source(start)) / 1e-3, math.sqrt(g * beyond)
    lag, w, zeta = (
        disc.get(k, 0.0) for k in ("time_constant", "natural_frequency", "damping_ratio")
    )
    w *= 2.0 * math.pi

    def rates(t, y):
        x, flow, speed = y
        drop = flow * abs(flow) / (g * x * x)
        drive = ((source(t) if felt == "source" else drop) - beyond) / span - x
        braked = (source(t) - drop - friction * flow * abs(flow)) / inertia
        return (
            [drive / lag, braked, 0.0]
            if lag
            else [speed, braked, w * (w * drive - 2.0 * zeta * speed)]
        )

    if lag:
        x = 0.5 * rise * s**2 / (span * lag + (0.0 if felt == "source" else inertia * root))
        y = [x, x * root, 0.0]
    else:
        x = w * w * rise * s**3 / (6.0 * span)
        y = [x, x * root, 3.0 * x / s]
    found, now = [], start + s
    for end in (kink, at[-1]):
        wanted = [t for t in at if now < t <= end]
        step = solve_ivp(rates, (now, end), y, method="Radau", t_eval=wanted, rtol=1e-9, atol=1e-14)
        found, now, y = [*found, *step.y[:2].T], end, step.y[:, -1]
    return start, np.array(found).T


def rates_of(source, lifted, g, stroke, inertia, friction):
    """Function that returns the rates of [lift, mass flow]."""

    def rates(t, y):
        drop = (y[1] / y[0]) ** 2 / g
        return [
            lifted(t, drop) / stroke,
            (source(t) - drop - friction * y[1] * abs(y[1])) / inertia,
        ]

    return rates


def stem_leaves_with_column(source, lifted, g, stroke, inertia, friction, start, kinks, at):
    """[lift, mass flow] at times `at` of a stem that opens at `start` for the rigid column that it blocks.

    inertia dM/dt = source(t) - M^2 / (G x^2) - friction M |M|, stroke dx/dt = lifted(t, drop). Lift and flow start as
    powers of the time s since `start`: x = a s^2, M = a s^2 sqrt(G source), at s = 1e-5.
    """
    s = 1e-5
    drop = source(start + s)
    steep = (lifted(start + s, drop) - lifted(start, source(start))) / s
    felt = lifted(start, 1.0) - lifted(start, 0.0)  # slope over the drop
    root = math.sqrt(g * drop)
    # stroke x' = steep s - felt inertia root x'
    x = 0.5 * steep * s**2 / (stroke + felt * inertia * root)

    rates = rates_of(source, lifted, g, stroke, inertia, friction)
    y, now, found = [x, root * x], start + s, {}
    for end in [*(k for k in kinks if k > now), max(at)]:
        step = solve_ivp(
            rates, (now, end), y, method="Radau", rtol=1e-10, atol=1e-14, dense_output=True
        )
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
