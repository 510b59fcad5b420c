"""Scene of cases/digital-pressure.toml by the method of characteristics, with a sampled PI controller.

The module imports nothing from fvsolve. `python tests/reference/digital_pressure.py` prints values of the case.
"""

from math import pi

import numpy as np

GRAVITY, LAKE = 9.80665, 10.0
LENGTH, BORE, WAVE_SPEED, FACTOR = 1500.0, 0.3, 1000.0, 0.02
SETPOINT, GAIN, INTEGRAL_TIME, PERIOD, LIMITS = 50.0, 0.001, 2.0, 2.0, (0.3, 1.3)
RADIO = 0.9  # time that a reading of the far end takes [s], a whole number of steps
DEMAND = ([20.0, 22.0], [0.03, 0.05])
AREA = pi / 4 * BORE**2
# head of the pump at speed n: n^2 (60 m) - c q^2 through the points of the case, which lie on this parabola
SHUT_OFF, FALL = 60.0, 4000.0


def steady():
    """Speed of the pump at which the head of the town is the setpoint, and head at the station [m]."""
    q = DEMAND[1][0]
    station = SETPOINT + FACTOR * LENGTH / BORE * (q / AREA) ** 2 / (2.0 * GRAVITY)
    return np.sqrt((station - LAKE + FALL * q * q) / SHUT_OFF), station


def main(reaches: int, end: float):
    """Time [s], head of the town and of the station [m], and speed of the pump : float64[n] each."""
    step = LENGTH / WAVE_SPEED / reaches
    wave = WAVE_SPEED / (GRAVITY * AREA)
    drag = FACTOR * LENGTH / reaches / (2.0 * GRAVITY * BORE * AREA**2)
    speed, station = steady()
    head, flow = np.linspace(station, SETPOINT, reaches + 1), np.full(reaches + 1, DEMAND[1][0])
    start, integral, rows, samples = speed, 0.0, [], 0
    for k in range(int(end / step) + 1):
        t = k * step
        if t >= samples * PERIOD - 1e-9:
            samples += 1
            late = k - round(RADIO / step)
            error = SETPOINT - (rows[late][1] if late >= 0 else head[-1])
            integral += GAIN * PERIOD * error / INTEGRAL_TIME
            speed = min(max(start + GAIN * error + integral, LIMITS[0]), LIMITS[1])
        rows.append((t, head[-1], head[0], speed))
        ahead = head + wave * flow - drag * flow * np.abs(flow)
        back = head - wave * flow + drag * flow * np.abs(flow)
        # pump: LAKE + n^2 SHUT_OFF - FALL q^2 = back + wave q
        rest = LAKE + speed * speed * SHUT_OFF - back[1]
        q = 2.0 * rest / (wave + np.sqrt(wave * wave + 4.0 * FALL * rest)) if rest > 0.0 else 0.0
        drawn = np.interp(t + step, *DEMAND)
        inner_head, inner_flow = 0.5 * (ahead[:-2] + back[2:]), 0.5 * (ahead[:-2] - back[2:]) / wave
        head = np.concatenate([[back[1] + wave * q], inner_head, [ahead[-2] - wave * drawn]])
        flow = np.concatenate([[q], inner_flow, [drawn]])
    return np.array(rows).T


if __name__ == "__main__":
    print("steady", steady())
    for reaches in (20, 40, 80):
        t, town, station, speed = main(reaches, 100.0)
        print(reaches, "least", town.min(), "greatest", town.max())
        for at in (19.0, 25.0, 40.0, 60.0, 99.0):
            k = int(round(at / (t[1] - t[0])))
            print("  ", t[k], town[k], station[k], speed[k])
