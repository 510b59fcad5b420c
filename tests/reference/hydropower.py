"""Plant of cases/hydropower.toml by the method of characteristics, and the formula of its hill chart.

The module imports nothing from fvsolve. `python tests/reference/hydropower.py chart` writes the points of the chart;
without an argument it prints the reference values of the case.
"""

import sys
from math import pi, sqrt

import numpy as np

GRAVITY, RHO = 9.80665, 1000.0
LAKE, TAIL = 112.0, 4.0
TUNNEL, TUNNEL_BORE, TUNNEL_FACTOR, SHAFT = 2000.0, 4.0, 0.014, 150.0
LENGTH, BORE, SPEED_OF_SOUND, FACTOR = 330.0, 3.0, 1100.0, 0.012
RUNNER, INERTIA, TURNS, TRIP = 2.0, 200e3, 1000.0 / 3.0, 2.0
VANES = ([2.2, 7.2, 15.2], [0.8, 0.3, 0.0])
BEST, FULL = 70.0, 0.9  # n11 at the best efficiency, and Q11 at this n11 with open vanes
TORQUE = RHO * GRAVITY * 30.0 / (pi * BEST)  # T11 at efficiency 1, the best n11 and Q11 = 1


def unit_flow(x, n11):
    """Unit flow Q11 = 0.9 x sqrt(1.3 - 0.3 (n11 / 70)^2) [m^(1/2)/s]."""
    return FULL * x * np.sqrt(1.3 - 0.3 * (n11 / BEST) ** 2)


def unit_torque(q11, n11):
    """Unit torque T11 [N/m3]: torque of the guided flow minus disc friction and swirl losses away from Q11 = 0.7."""
    nu = n11 / BEST
    return TORQUE * (q11 * (1.84 - 0.88 * nu) - 0.02 * nu**2 - 0.12 * (q11 - 0.7) ** 2 * q11)


def chart() -> str:
    """Points of the formula in the format of the CSV file of the case."""
    rows = ["opening,unit_speed [rpm m^(1/2)],unit_flow [m^(1/2)/s],unit_torque [N/m3]"]
    rows.append(f"0,{BEST:g},0,{unit_torque(0.0, BEST):.6g}")
    for x in np.arange(1, 11) / 10:
        for n11 in np.arange(28.0, 141.0, 7.0):
            q11 = unit_flow(x, n11)
            rows.append(f"{x:g},{n11:g},{q11:.6g},{unit_torque(q11, n11):.6g}")
    return "\n".join(rows) + "\n"


def head_of(x, q, turns):
    """Net head of a positive flow q [m3/s] by the formula solved for the head [m]."""
    return ((q / (FULL * x * RUNNER**2)) ** 2 + 0.3 * (turns * RUNNER / BEST) ** 2) / 1.3


def torque_of(x, q, turns, head):
    """Torque on the shaft [N m]."""
    if x <= 0.0:
        return RUNNER**3 * -0.02 * TORQUE * (turns * RUNNER / BEST) ** 2
    root = sqrt(head)
    return RUNNER**3 * head * unit_torque(q / (RUNNER**2 * root), turns * RUNNER / root)


def net_flow(x, turns, arriving, wave):
    """Flow at which the head of the formula is `arriving` - wave q [m3/s]; 0 with shut vanes."""
    if x <= 0.0:
        return 0.0
    a = 1.0 / (1.3 * (FULL * x * RUNNER**2) ** 2)
    c = 0.3 / 1.3 * (turns * RUNNER / BEST) ** 2 - arriving
    return 2.0 * -c / (wave + sqrt(wave * wave - 4.0 * a * c))


def steady():
    """Flow [m3/s], level of the shaft [m] and head before the turbine [m] at the start."""
    area, bore = pi / 4 * TUNNEL_BORE**2, pi / 4 * BORE**2
    tunnel = TUNNEL_FACTOR * TUNNEL / TUNNEL_BORE / (2 * GRAVITY * area**2)
    penstock = FACTOR * LENGTH / BORE / (2 * GRAVITY * bore**2)
    low, high = 0.0, 100.0
    for _ in range(200):
        q = 0.5 * (low + high)
        left = LAKE - TAIL - (tunnel + penstock) * q * q - head_of(VANES[1][0], q, TURNS)
        low, high = (q, high) if left > 0 else (low, q)
    return q, LAKE - tunnel * q * q, LAKE - (tunnel + penstock) * q * q


def plant(reaches: int, end: float):
    """Time [s], head before the turbine [m], flow [m3/s], speed [rpm] and level of the shaft [m] : float64[n] each."""
    area, bore = pi / 4 * TUNNEL_BORE**2, pi / 4 * BORE**2
    q0, level, before = steady()
    step = LENGTH / SPEED_OF_SOUND / reaches
    wave, drag = (
        SPEED_OF_SOUND / (GRAVITY * bore),
        FACTOR * LENGTH / reaches / (2 * GRAVITY * BORE * bore**2),
    )
    head, flow = np.linspace(level, before, reaches + 1), np.full(reaches + 1, q0)
    tunnel, omega, t, rows = q0, TURNS * pi / 30, 0.0, []
    for k in range(int(end / step) + 1):
        t, x = k * step, float(np.interp(k * step, *VANES))
        rows.append((t, head[-1], flow[-1], omega * 30 / pi, level))
        back = head - wave * flow + drag * flow * np.abs(flow)
        ahead = head + wave * flow - drag * flow * np.abs(flow)

        def masses(level, tunnel, q):
            loss = (
                TUNNEL_FACTOR
                * TUNNEL
                / TUNNEL_BORE
                / (2 * GRAVITY * area**2)
                * tunnel
                * abs(tunnel)
            )
            return (tunnel - q) / SHAFT, GRAVITY * area / TUNNEL * (LAKE - level - loss)

        first = masses(level, tunnel, flow[0])
        new_level = level + step * first[0]
        second = masses(new_level, tunnel + step * first[1], (new_level - back[1]) / wave)
        level, tunnel = (
            level + step * 0.5 * (first[0] + second[0]),
            tunnel + step * 0.5 * (first[1] + second[1]),
        )
        x_new, turns = float(np.interp(t + step, *VANES)), omega * 30 / pi
        push = torque_of(x, flow[-1], turns, head[-1] - TAIL) / INERTIA if t >= TRIP else 0.0
        guess = turns + step * push * 30 / pi
        q = net_flow(x_new, guess, ahead[-2] - TAIL, wave)
        later = (
            torque_of(x_new, q, guess, ahead[-2] - wave * q - TAIL) / INERTIA if t >= TRIP else 0.0
        )
        omega += step * 0.5 * (push + later)
        q = net_flow(x_new, omega * 30 / pi, ahead[-2] - TAIL, wave)
        inner_head, inner_flow = 0.5 * (ahead[:-2] + back[2:]), 0.5 * (ahead[:-2] - back[2:]) / wave
        head = np.concatenate([[level], inner_head, [ahead[-2] - wave * q]])
        flow = np.concatenate([[(level - back[1]) / wave], inner_flow, [q]])
    return np.array(rows).T


if __name__ == "__main__":
    if sys.argv[1:] == ["chart"]:
        print(chart(), end="")
    else:
        print("steady", steady())
        for reaches in (60, 120, 240):
            t, head, flow, turns, level = plant(reaches, 120.0)
            print(
                reaches,
                "head",
                head.max(),
                t[head.argmax()],
                "speed",
                turns.max(),
                t[turns.argmax()],
            )
            print("  level", level.max(), t[level.argmax()], level.min(), "least head", head.min())
            for at in (4.0, 7.2, 10.0, 15.0, 60.0, 119.0):
                k = int(round(at / (t[1] - t[0])))
                print("  ", t[k], head[k], flow[k], turns[k], level[k])
