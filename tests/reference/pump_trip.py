"""Rising main of cases/pump-trip.toml by the method of characteristics, independent of fvsolve.

At the pump H = CM + B q on the characteristic C-. The trapezoidal rule integrates the friction of a reach and the speed
of the shaft, with iteration of both. The torque is that of a Suter table. The check valve prevents reverse flow, and
opens if the pump at zero flow exceeds the head behind the valve.
"""

import math

import numpy as np

GRAVITY, RHO = 9.80665, 998.207
SUMP, TOP = 2.0, 70.0
LENGTH, BORE, SPEED, FACTOR = 1500.0, 0.3, 1000.0, 0.018
SHUT_OFF, FLOWS, HEADS = 90.0, (0.04, 0.06), (75.0, 58.0)
OMEGA, INERTIA, EFFICIENCY, TRIP = 1480.0 * math.pi / 30.0, 1.2, 0.78, 1.0
AMBIENT, GAS, POLYTROPIC = 101325.0, 1.0, 1.2  # variant with an air vessel
SECTION = math.pi / 4 * BORE**2
C = math.log((SHUT_OFF - HEADS[1]) / (SHUT_OFF - HEADS[0])) / math.log(FLOWS[1] / FLOWS[0])
B = (SHUT_OFF - HEADS[0]) / FLOWS[0] ** C
LAST = (SHUT_OFF / B) ** (1.0 / C)
TAIL = C * B * LAST ** (C - 1.0) / (2.0 * LAST)
# WB of a radial pump of specific speed 25 from zero flow to zero speed, at intervals of pi / 44, with its source in
# fvsolve/data/suter_tables.toml. The specific speed of this pump is 11.6.
WB = """
 0.471  0.513  0.555  0.597  0.610  0.621  0.631  0.632  0.618  0.583  0.541  0.500
 0.437  0.373  0.300  0.216  0.131  0.043 -0.033 -0.096 -0.189 -0.319 -0.437
"""
WB = [float(one) for one in WB.split()]
RATED = RHO * GRAVITY * FLOWS[0] * HEADS[0] / EFFICIENCY / OMEGA


def head(n: float, q: float) -> float:
    """Head of the pump [m]: power law between zero flow and zero head, parabolas outside."""
    if n <= 0.0 or q >= n * LAST:
        return TAIL * (n * n * LAST**2 - q * q)
    return n * n * SHUT_OFF - B * n ** (2.0 - C) * max(q, 0.0) ** C + TAIL * min(q, 0.0) ** 2


def torque(n: float, q: float) -> float:
    """Torque at positive speed and flow [N m], large enough that the efficiency is at most that of the rated point."""
    v = q / FLOWS[0]
    by_table = (n * n + v * v) * float(
        np.interp(math.atan2(v, n), np.linspace(0.0, math.pi / 2, len(WB)), WB)
    )
    return RATED * max(by_table, v * head(n, q) / HEADS[0] / n)


def steady() -> float:
    """Flow at the intersection of the curves of pump and main [m3/s], by bisection."""
    low, high = 0.0, LAST
    for _ in range(200):
        q = 0.5 * (low + high)
        drop = FACTOR * LENGTH / BORE * (q / SECTION) ** 2 / (2 * GRAVITY)
        low, high = (q, high) if SUMP + head(1.0, q) > TOP + drop else (low, q)
    return low


def at_pump(n: float, meet: float, impedance: float) -> tuple[float, float]:
    """Flow [m3/s] and head [m] at the outlet of the pump with H = meet + impedance q."""
    if SUMP + head(n, 0.0) < meet:
        return 0.0, meet
    low, high = 0.0, 2.0 * LAST
    for _ in range(100):
        q = 0.5 * (low + high)
        low, high = (q, high) if SUMP + head(n, q) > meet + impedance * q else (low, q)
    return low, meet + impedance * low


def pump_flow(n: float, lift: float) -> float:
    """Flow at which the head of the pump is `lift` [m3/s]; 0 if the pump does not reach this head."""
    low, high = 0.0, 2.0 * LAST
    if head(n, 0.0) <= lift:
        return 0.0
    for _ in range(60):
        q = 0.5 * (low + high)
        low, high = (q, high) if head(n, q) > lift else (low, q)
    return low


def gas_head(volume: float, first: float) -> float:
    """Gauge head of the air in the vessel [m], which is `first` at the volume GAS."""
    return ((AMBIENT + RHO * GRAVITY * first) * (GAS / volume) ** POLYTROPIC - AMBIENT) / (
        RHO * GRAVITY
    )


def at_vessel(
    n: float, meet: float, impedance: float, known: float, first: float, dt: float
) -> tuple[float, float]:
    """Flow into the main [m3/s] and head [m] at a vessel behind the pump.

    The new air volume is `known` minus dt / 2 times the inflow of the vessel.
    """
    low, high = 1e-3 * GAS, 1e3 * GAS
    for _ in range(60):
        volume = math.sqrt(low * high)
        h = gas_head(volume, first)
        enters = pump_flow(n, h - SUMP) - (h - meet) / impedance
        low, high = (volume, high) if known - 0.5 * dt * enters > volume else (low, volume)
    h = gas_head(volume, first)
    return (h - meet) / impedance, h


def run(reaches: int, end: float, vessel: bool = False) -> dict[str, np.ndarray]:
    """Time [s], flow of the main [m3/s], head [m] and relative speed of the pump at every step.

    With `vessel` an air vessel is behind the pump.
    """
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
            new_h[1:-1], new_q[1:-1] = (
                0.5 * (cp[:-1] + cm[1:]),
                0.5 * (cp[:-1] - cm[1:]) / impedance,
            )
            new_h[-1], new_q[-1] = TOP, (cp[-1] - TOP) / impedance
            if t > TRIP + 0.5 * dt:
                now_pumped = pump_flow(new_n, new_h[0] - SUMP)
                new_n = n - 0.5 * dt / (INERTIA * OMEGA) * (
                    torque(n, pumped) + torque(new_n, now_pumped)
                )
            if vessel:
                new_q[0], new_h[0] = at_vessel(
                    new_n, cm[0], impedance, air - 0.5 * dt * enters, first, dt
                )
            else:
                new_q[0], new_h[0] = at_pump(new_n, cm[0], impedance)
        q, h, n, pumped = new_q, new_h, new_n, pump_flow(new_n, new_h[0] - SUMP)
        if vessel:
            air, enters = air - 0.5 * dt * (enters + pumped - q[0]), pumped - q[0]
        rows.append((t, q[0], h[0], n))
    return dict(zip(("t", "flow", "head", "speed"), np.array(rows).T, strict=True))
