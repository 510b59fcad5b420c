"""Time of a run of two tanks compared with two states stepped by hand, with one method and one step.

python benchmarks/absent.py [--quick]
"""

from __future__ import annotations

import math
import time

import numba
import numpy as np
from measure import agree, parser

from fvsolve import build, load
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.core.steppers import integrate

STEP = 1e-3  # [s]
HIGH, LOW, AREA, GRAVITY, CD = 3.0, 1.5, 50e-4, 9.80665, 0.61
CASE = {
    "fluid": {
        "name": "user",
        "density": 1000.0,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "vapor_pressure": 2300.0,
    },
    "nodes": {
        "high": {"type": "tank", "area": HIGH, "level": 4.0},
        "low": {"type": "tank", "area": LOW, "level": 1.0},
    },
    "links": {
        "hole": {
            "type": "orifice",
            "from": "high",
            "to": "low",
            "area": AREA,
            "discharge_coefficient": CD,
        }
    },
    "numerics": {"end": STEP, "method": "rk4", "step": STEP},
    "output": {"probes": ["high.level"], "every": STEP},
}
K = CD * AREA * math.sqrt(2.0 * GRAVITY)


@numba.njit(error_model="numpy")
def by_hand(t, y, dydt):
    drop = y[0] - y[1]
    flow = K * math.copysign(math.sqrt(abs(drop)), drop)
    dydt[0], dydt[1] = -flow / HIGH, flow / LOW


def scene(steps: int) -> tuple[float, float]:
    """Wall time of the case [s] and level of the high tank at the end [m]."""
    model = build(load(CASE, {"numerics.end": steps * STEP, "output.every": steps * STEP}))
    loop = RunLoop(model)
    loop.begin(steps * STEP, NO_LIMIT)
    begun = time.perf_counter()
    loop.run(NO_LIMIT)
    seconds = time.perf_counter() - begun
    return seconds, float(model.observe(loop.t, loop.now)[0])


def hand(steps: int) -> tuple[float, float]:
    """Wall time of the function `by_hand` [s] and level of the high tank at the end [m]."""
    begun = time.perf_counter()
    found = integrate(by_hand, [4.0, 1.0], [0.0, steps * STEP], "rk4", step=STEP)
    return time.perf_counter() - begun, float(found[-1, 0])


def main() -> None:
    """Print the least times of several runs after compilation."""
    steps, times = (2_000, 2) if parser(__doc__).parse_args().quick else (200_000, 7)
    scene(steps), hand(steps)
    a, b = (min(f(steps) for _ in range(times)) for f in (scene, hand))
    print(
        f"two tanks, {steps} steps of rk4, four rates each; the states agree to {abs(a[1] - b[1]):.1e} m"
    )
    for name, (seconds, _) in (
        ("two-tank case, marks and extremes at every step", a),
        ("two states by hand", b),
    ):
        print(f"{name:48s} {1e9 * seconds / steps:6.0f} ns a step")
    agree("difference of levels at the end [m]", abs(a[1] - b[1]), 1e-9)
    print(f"ratio {a[0] / b[0]:.2f}; states of the case: {np.size(build(load(CASE)).scale)}")


if __name__ == "__main__":
    main()
