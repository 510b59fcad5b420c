"""Stiff and non-stiff initial value problems: error of the end state over CPU time, beside SciPy.

A row names PROBLEM.METHOD; its value is the greatest relative error of the end state at the tolerance of the problem.
"""

import csv
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
from scipy.integrate import solve_ivp

from fvsolve.case.validation_table import Validation
from fvsolve.core.steppers.ode import integrate
from fvsolve.studies.validation import valve_controlled_cylinder as cylinder
from fvsolve.studies.validation.library import Computed

REPEATS = 3  # runs of which the fastest counts
LONG = 0.2  # CPU time of a run that is not repeated [s]


class Problem(NamedTuple):
    """Initial value problem: right-hand side f(t, y), methods, method of SciPy, tolerance of its row.

    atol : absolute tolerance over the relative one
    """

    rhs: Callable
    methods: tuple[str, ...]
    peer: str
    rtol: float
    atol: float


def van_der_pol(t, y):
    """Van der Pol's oscillator with mu = 1000, in scaled time."""
    return np.array([y[1], ((1.0 - y[0] ** 2) * y[1] - y[0]) / 1e-6])


def robertson(t, y):
    """Robertson's reactions."""
    a, c = -0.04 * y[0] + 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return np.array([a, -a - c, c])


def hires(t, y):
    """High irradiance response of plants, eight reactions (Schafer 1975)."""
    return np.array(
        [
            -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
            1.71 * y[0] - 8.75 * y[1],
            -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
            8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
            -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
            -280.0 * y[5] * y[7] + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
            280.0 * y[5] * y[7] - 1.81 * y[6],
            -280.0 * y[5] * y[7] + 1.81 * y[6],
        ]
    )


def pleiades(t, y):
    """Seven stars in a plane under gravity."""
    out = np.empty(28)
    out[:14] = y[14:]
    for i in range(7):
        ax, ay = 0.0, 0.0
        for j in range(7):
            if j != i:
                dx, dy = y[j] - y[i], y[j + 7] - y[i + 7]
                r = (dx * dx + dy * dy) ** 1.5
                ax += (j + 1.0) * dx / r
                ay += (j + 1.0) * dy / r
        out[14 + i], out[21 + i] = ax, ay
    return out


def stiff_cylinder(t, y):
    """Valve-controlled cylinder on two short hoses, see `valve_controlled_cylinder`."""
    out = np.empty(6)
    cylinder.rhs(t, y, out)
    return out


STIFF, SMOOTH = ("radau-iia-5", "rodas-5p"), ("dormand-prince", "verner-7")
PROBLEMS = {
    "van-der-pol": Problem(van_der_pol, STIFF, "Radau", 1e-8, 1.0),
    "robertson": Problem(robertson, STIFF, "Radau", 1e-8, 1e-8),
    "hires": Problem(hires, STIFF, "Radau", 1e-8, 1e-2),
    "pleiades": Problem(pleiades, SMOOTH, "DOP853", 1e-9, 1.0),
    "stiff-cylinder": Problem(stiff_cylinder, STIFF, "Radau", 1e-8, 1.0),
}
REFERENCE_TOLERANCE = 1e-12  # of SciPy's Radau, where no end state is published


def compute(validation: Validation, folder: Path) -> dict[str, Computed]:
    """Errors of all problems whose end states are in the file ode/reference.csv : PROBLEM.METHOD -> `Computed`."""
    result: dict[str, Computed] = {}
    for name, (start, end, times) in read_states(folder / "ode/reference.csv").items():
        result |= compared(name, PROBLEMS[name], start, end, times)
    start, times = cylinder.start(), (0.0, cylinder.END)
    tight = {"method": "Radau", "rtol": REFERENCE_TOLERANCE, "atol": REFERENCE_TOLERANCE}
    end = solve_ivp(numba.jit(stiff_cylinder), times, start, **tight).y[:, -1]
    return result | compared("stiff-cylinder", PROBLEMS["stiff-cylinder"], start, end, times)


def read_states(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray, tuple[float, float]]]:
    """Start, end state and times of each problem from the columns problem, t0, t1, component, start, end."""
    lines = [
        line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    rows: dict[str, list[list[float]]] = {}
    for row in csv.reader(lines[1:]):
        rows.setdefault(row[0], []).append([float(cell) for cell in row[1:]])
    tables = {name: np.array(entries) for name, entries in rows.items()}
    return {name: (t[:, 3], t[:, 4], (t[0, 0], t[0, 1])) for name, t in tables.items()}


def compared(
    name: str, problem: Problem, start: np.ndarray, end: np.ndarray, times: tuple[float, float]
) -> dict[str, Computed]:
    """Errors of the methods of a problem at several tolerances, with the peer's; start, end : states at `times` [s]"""
    rhs = numba.jit(problem.rhs)
    rhs(times[0], start)  # compiled before the clock starts
    points = {f"SciPy {problem.peer}": [], **{method: [] for method in problem.methods}}
    for rtol in (1e2 * problem.rtol, 1e1 * problem.rtol, problem.rtol, 0.1 * problem.rtol):
        for code in points:

            def solve(code=code, rtol=rtol):
                if code in problem.methods:
                    return integrate(rhs, start, times, code, rtol, atol=problem.atol * rtol)[-1]
                peer = {"method": problem.peer, "rtol": rtol, "atol": problem.atol * rtol}
                return solve_ivp(rhs, times, start, t_eval=times[1:], **peer).y[:, -1]

            seconds, found = least_time(solve)
            points[code].append((seconds, float(np.max(np.abs(found / end - 1.0)))))
    result = {}
    peer = f"SciPy {problem.peer}"
    peer_time, peer_error = points[peer][2]
    for method in problem.methods:
        (_, coarser), (seconds, error) = points[method][1:3]
        text = f"{1e3 * seconds:.3g} ms of CPU time, {peer} {1e3 * peer_time:.3g} ms at rtol {problem.rtol:g}"
        text += f"; at its error {ratio(points[method], points[peer]):.3g} times less"
        series = {code: np.array(pairs) for code, pairs in points.items()}
        result[f"{name}.{method}"] = Computed(error, coarser, ((peer, peer_error),), text, series)
    return result


def least_time(solve: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    """Least CPU time of some calls [s] after one for compilation, or that of the first above `LONG`; and the result."""
    solve()
    times: list[float] = []
    while len(times) < REPEATS and not (times and times[-1] > LONG):
        begun = time.process_time()
        found = solve()
        times.append(time.process_time() - begun)
    return min(times), found


def ratio(own: list[tuple[float, float]], peer: list[tuple[float, float]]) -> float:
    """CPU time of the peer over that of a method, at the error of the peer's third tolerance.

    own, peer : (CPU time [s], error) by falling tolerance; times are interpolated along the line of errors
    """
    seconds, error = peer[2]
    order = sorted(own, key=lambda point: -point[1])
    found = np.interp(
        -np.log(error),
        [-np.log(point[1]) for point in order],
        np.log([point[0] for point in order]),
    )
    return float(seconds / np.exp(found))
