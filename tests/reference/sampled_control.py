"""Cases of a sampled PI controller on a plant with two lags."""

import numpy as np
from scipy.linalg import expm

from reference.scenes import WATER

# gain from which the sampled PI on two lags is unstable, by the spectral radius of its map
LIMIT = 10.809425555853


def two_lags(gain, end, period=0.1, method="dormand-prince", **more):
    """Case of a PI with samples on the plant 1 / ((0.5 s + 1)(0.1 s + 1)), whose setpoint steps at 0.05 s."""
    setpoint = {"time": [0.0, 0.05], "value": [0.0, 1.0], "kind": "step"}
    loop = {
        "type": "pi",
        "input": "controls.plant",
        "setpoint": setpoint,
        "gain": gain,
        "integral_time": 0.4,
        **more,
    }
    plant = {
        "type": "transfer-function",
        "input": "controls.loop",
        "numerator": [1.0],
        "denominator": [0.05, 0.6, 1.0],
    }
    loop |= {"period": period} if period else {}
    return {
        "schema": 1,
        "fluid": WATER,
        "controls": {"plant": plant, "loop": loop},
        "numerics": {"end": end, "rtol": 1e-10, "method": method},
        "output": {"every": 0.05, "probes": ["controls.plant.output", "controls.loop.output"]},
    }


def sampled_plant(period):
    """Matrices of the plant over one period with a held input."""
    a, b = np.array([[0.0, 1.0], [-20.0, -12.0]]), np.array([[0.0], [20.0]])
    exponential = expm(np.block([[a, b], [np.zeros((1, 3))]]) * period)
    return exponential[:2, :2], exponential[:2, 2]


def value_at(run, probe, time):
    return run[probe][np.flatnonzero(np.abs(np.array(run.t) - time) < 1e-9)[-1]]
