"""Plant of cases/governor.toml by the method of characteristics: PI governor with transient droop, load rejection.

The module imports nothing from fvsolve. `python tests/reference/governor.py` prints the reference values of the case.
"""

import sys
from math import pi
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
from reference.hydropower import (
    BORE,
    FACTOR,
    GRAVITY,
    INERTIA,
    LAKE,
    LENGTH,
    SHAFT,
    SPEED_OF_SOUND,
    TAIL,
    TUNNEL,
    TUNNEL_BORE,
    TUNNEL_FACTOR,
    TURNS,
    head_of,
    net_flow,
    torque_of,
)

GAIN, INTEGRAL_TIME, SERVO, DROOP, DROOP_TIME = 2.5, 10.0, 0.3, 0.4, 8.0
LOAD = ([5.0, 5.2], [600e3, 480e3])  # torque of the generator [N m]
AREA, PENSTOCK = pi / 4 * TUNNEL_BORE**2, pi / 4 * BORE**2
TUNNEL_LOSS = TUNNEL_FACTOR * TUNNEL / TUNNEL_BORE / (2 * GRAVITY * AREA**2)
LOSS = TUNNEL_LOSS + FACTOR * LENGTH / BORE / (2 * GRAVITY * PENSTOCK**2)


def steady():
    """Opening, flow [m3/s] and level of the shaft [m] at which the turbine carries the first load at rated speed."""
    low, high = 0.05, 1.0
    for _ in range(200):
        x, least, most = 0.5 * (low + high), 0.0, 100.0
        for _ in range(200):
            q = 0.5 * (least + most)
            left = LAKE - TAIL - LOSS * q * q - head_of(x, q, TURNS)
            least, most = (q, most) if left > 0 else (least, q)
        torque = torque_of(x, q, TURNS, LAKE - TAIL - LOSS * q * q)
        low, high = (x, high) if torque < LOAD[1][0] else (low, x)
    return x, q, LAKE - TUNNEL_LOSS * q * q


def governor(states, turns):
    """Rates of integral, servomotor and droop filter at this speed [rpm] : float64[3]."""
    integral, servo, filtered = states
    error = 1.0 - turns / TURNS - DROOP * (servo - filtered)
    v = GAIN * error + integral
    u = min(max(v, 0.0), 1.0)
    rate = GAIN * error / INTEGRAL_TIME + (u - v) / INTEGRAL_TIME
    return np.array([rate, (u - servo) / SERVO, (servo - filtered) / DROOP_TIME])


def plant(reaches: int, end: float):
    """Time [s], head before the turbine [m], speed [rpm], opening and level of the shaft [m] : float64[n] each."""
    x, q0, level = steady()
    step = LENGTH / SPEED_OF_SOUND / reaches
    wave, drag = (
        SPEED_OF_SOUND / (GRAVITY * PENSTOCK),
        FACTOR * LENGTH / reaches / (2 * GRAVITY * BORE * PENSTOCK**2),
    )
    head, flow = np.linspace(level, LAKE - LOSS * q0 * q0, reaches + 1), np.full(reaches + 1, q0)
    tunnel, turns, rows, states = q0, TURNS, [], np.array([x, x, x])

    def masses(level, tunnel, q):
        loss = TUNNEL_LOSS * tunnel * abs(tunnel)
        return (tunnel - q) / SHAFT, GRAVITY * AREA / TUNNEL * (LAKE - level - loss)

    for k in range(int(end / step) + 1):
        t = k * step
        rows.append((t, head[-1], turns, states[1], level))
        back = head - wave * flow + drag * flow * np.abs(flow)
        ahead = head + wave * flow - drag * flow * np.abs(flow)
        first = masses(level, tunnel, flow[0])
        new_level = level + step * first[0]
        second = masses(new_level, tunnel + step * first[1], (new_level - back[1]) / wave)
        level, tunnel = (
            level + step * 0.5 * (first[0] + second[0]),
            tunnel + step * 0.5 * (first[1] + second[1]),
        )
        load = np.interp([t, t + step], *LOAD)
        push = (torque_of(states[1], flow[-1], turns, head[-1] - TAIL) - load[0]) / INERTIA
        moved = governor(states, turns)
        guess, later_states = turns + step * push * 30 / pi, states + step * moved
        q = net_flow(later_states[1], guess, ahead[-2] - TAIL, wave)
        later = (
            torque_of(later_states[1], q, guess, ahead[-2] - wave * q - TAIL) - load[1]
        ) / INERTIA
        states = states + step * 0.5 * (moved + governor(later_states, guess))
        turns += step * 0.5 * (push + later) * 30 / pi
        q = net_flow(states[1], turns, ahead[-2] - TAIL, wave)
        inner_head, inner_flow = 0.5 * (ahead[:-2] + back[2:]), 0.5 * (ahead[:-2] - back[2:]) / wave
        head = np.concatenate([[level], inner_head, [ahead[-2] - wave * q]])
        flow = np.concatenate([[(level - back[1]) / wave], inner_flow, [q]])
    return np.array(rows).T


if __name__ == "__main__":
    print("steady", steady())
    for reaches in (30, 60, 120):
        t, head, turns, opening, level = plant(reaches, 100.0)
        print(
            reaches,
            "head",
            head.max(),
            t[head.argmax()],
            head.min(),
            "speed",
            turns.max(),
            t[turns.argmax()],
        )
        print(
            "  least speed",
            turns.min(),
            t[turns.argmin()],
            "least opening",
            opening.min(),
            "level",
            level.max(),
        )
        for at in (4.0, 7.0, 10.0, 20.0, 60.0, 99.0):
            k = int(round(at / (t[1] - t[0])))
            print("  ", t[k], head[k], turns[k], opening[k], level[k])
