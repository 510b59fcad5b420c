"""The rising main of cases/pump-trip.toml by the method of characteristics. Knows no line of fvsolve.

H at the pump is C- : H = CM + B q with the friction of the reach by the trapezoid; its shaft too is stepped by the
trapezoid, both iterated, its torque that of a table of Suter form. The check valve lets no q below 0 pass, and opens
where the pump at no flow could lift more.
"""

from __future__ import annotations

import math

import numpy as np

GRAVITY, RHO = 9.80665, 998.207
SUMP, TOP = 2.0, 70.0
LENGTH, BORE, SPEED, FACTOR = 1500.0, 0.3, 1000.0, 0.018
SHUT_OFF, FLOWS, HEADS = 90.0, (0.04, 0.06), (75.0, 58.0)
OMEGA, INERTIA, EFFICIENCY, TRIP = 1480.0 * math.pi / 30.0, 1.2, 0.78, 1.0
AMBIENT, GAS, POLYTROPIC = 101325.0, 1.0, 1.2  # of the twin with an air vessel
SECTION = math.pi / 4 * BORE**2
C = math.log((SHUT_OFF - HEADS[1]) / (SHUT_OFF - HEADS[0])) / math.log(FLOWS[1] / FLOWS[0])
B = (SHUT_OFF - HEADS[0]) / FLOWS[0] ** C
LAST = (SHUT_OFF / B) ** (1.0 / C)
TAIL = C * B * LAST ** (C - 1.0) / (2.0 * LAST)
# WB of a radial pump of specific speed 25 from no flow to no speed, every pi / 44; fvsolve/parts/pump/suter_tables.py
# says where from. The pump's own is 11.6.
WB = """
 0.471  0.513  0.555  0.597  0.610  0.621  0.631  0.632  0.618  0.583  0.541  0.500
 0.437  0.373  0.300  0.216  0.131  0.043 -0.033 -0.096 -0.189 -0.319 -0.437
"""
WB = [float(one) for one in WB.split()]
RATED = RHO * GRAVITY * FLOWS[0] * HEADS[0] / EFFICIENCY / OMEGA


def head(n: float, q: float) -> float:
    """Between no flow and that of no head the power law, beyond both the parabola."""
    if n <= 0.0 or q >= n * LAST:
        return TAIL * (n * n * LAST**2 - q * q)
    return n * n * SHUT_OFF - B * n ** (2.0 - C) * max(q, 0.0) ** C + TAIL * min(q, 0.0) ** 2


def torque(n: float, q: float) -> float:
    """Of a pump that turns forward and delivers; of no efficiency above that at its rated point."""
    v = q / FLOWS[0]
    by_table = (n * n + v * v) * float(np.interp(math.atan2(v, n), np.linspace(0.0, math.pi / 2, len(WB)), WB))
    return RATED * max(by_table, v * head(n, q) / HEADS[0] / n)


def steady() -> float:
    """Flow at which pump and main meet, by bisection."""
    low, high = 0.0, LAST
    for _ in range(200):
        q = 0.5 * (low + high)
        drop = FACTOR * LENGTH / BORE * (q / SECTION) ** 2 / (2 * GRAVITY)
        low, high = (q, high) if SUMP + head(1.0, q) > TOP + drop else (low, q)
    return low


def at_pump(n: float, meet: float, impedance: float) -> tuple[float, float]:
    """(flow, head) at the pump's outlet where H = meet + impedance q."""
    if SUMP + head(n, 0.0) < meet:
        return 0.0, meet
    low, high = 0.0, 2.0 * LAST
    for _ in range(100):
        q = 0.5 * (low + high)
        low, high = (q, high) if SUMP + head(n, q) > meet + impedance * q else (low, q)
    return low, meet + impedance * low


def pump_flow(n: float, lift: float) -> float:
    """Flow at which the pump lifts so much, 0 where it cannot."""
    low, high = 0.0, 2.0 * LAST
    if head(n, 0.0) <= lift:
        return 0.0
    for _ in range(60):
        q = 0.5 * (low + high)
        low, high = (q, high) if head(n, q) > lift else (low, q)
    return low


def gas_head(volume: float, first: float) -> float:
    """Head over the air in the vessel, GAS at first."""
    return ((AMBIENT + RHO * GRAVITY * first) * (GAS / volume) ** POLYTROPIC - AMBIENT) / (RHO * GRAVITY)


def at_vessel(n: float, meet: float, impedance: float, known: float, first: float, dt: float) -> tuple[float, float]:
    """(flow into the main, head) at a vessel behind the pump; its air is `known` less dt / 2 of what enters."""
    low, high = 1e-3 * GAS, 1e3 * GAS
    for _ in range(60):
        volume = math.sqrt(low * high)
        h = gas_head(volume, first)
        enters = pump_flow(n, h - SUMP) - (h - meet) / impedance
        low, high = (volume, high) if known - 0.5 * dt * enters > volume else (low, volume)
    h = gas_head(volume, first)
    return (h - meet) / impedance, h


def run(reaches: int, end: float, vessel: bool = False) -> dict[str, np.ndarray]:
    """t [s], flow of the main, head and relative speed at the pump at every step, with an air vessel there or not."""
    dt, impedance = LENGTH / reaches / SPEED, SPEED / (GRAVITY * SECTION)
    drag = FACTOR * dt / (2.0 * BORE * SECTION)  # dq = -drag q |q|
    q = np.full(reaches + 1, steady())
    h = np.linspace(SUMP + head(1.0, q[0]), TOP, reaches + 1)
    n, rows = 1.0, [(0.0, q[0], h[0], 1.0)]
    air, enters, first, pumped = GAS, 0.0, h[0], q[0]
    for k in range(1, round(end / dt) + 1):
        t = k * dt
        plus, minus = h + impedance * q, h - impedance * q
        loss, new_q, new_h, new_n = q * np.abs(q), q.copy(), h.copy(), n
        for _ in range(6):  # friction by the trapezoid
            now = new_q * np.abs(new_q)
            cp = plus[:-1] - 0.5 * impedance * drag * (loss[:-1] + now[1:])
            cm = minus[1:] + 0.5 * impedance * drag * (loss[1:] + now[:-1])
            new_h[1:-1], new_q[1:-1] = 0.5 * (cp[:-1] + cm[1:]), 0.5 * (cp[:-1] - cm[1:]) / impedance
            new_h[-1], new_q[-1] = TOP, (cp[-1] - TOP) / impedance
            if t > TRIP + 0.5 * dt:
                now_pumped = pump_flow(new_n, new_h[0] - SUMP)
                new_n = n - 0.5 * dt / (INERTIA * OMEGA) * (torque(n, pumped) + torque(new_n, now_pumped))
            if vessel:
                new_q[0], new_h[0] = at_vessel(new_n, cm[0], impedance, air - 0.5 * dt * enters, first, dt)
            else:
                new_q[0], new_h[0] = at_pump(new_n, cm[0], impedance)
        q, h, n, pumped = new_q, new_h, new_n, pump_flow(new_n, new_h[0] - SUMP)
        if vessel:
            air, enters = air - 0.5 * dt * (enters + pumped - q[0]), pumped - q[0]
        rows.append((t, q[0], h[0], n))
    return dict(zip(("t", "flow", "head", "speed"), np.array(rows).T, strict=True))
