"""Growth between a store and the far end of a delay line: what a method gives back of a wave. Knows no run.

A store whose pressure follows its inflow, p' = k (2 w - Y p) of an arriving wave w, sends back Y p - w. By a method
with R(z), b, A, c and a = h k Y that is S w, S = 2 a b (I + a A)^-1 exp(i theta c) / (exp(i theta) - R(-a)) - 1 of a
wave that turns by theta a step, exp(i theta c) as the line is read at its stages. |S| <= 1 under the trapezoidal rule
at any step; not under Euler, nor under the implicit midpoint rule, whose end knows less than its middle: what a line
brings back to such a store grows, unless reading it between steps or friction takes as much.
"""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels import records as rec
from fvsolve.kernels.delay.history import four, six, three
from fvsolve.kernels.delay.lines import drag_and_slope
from fvsolve.limits.lumped import GROWS, times
from fvsolve.steppers.tableau import Method

LITTLE = 4.0  # times a: what no method adds to a wave that comes back once
EASY = 1.5  # of a: up to here rk4 gives back no more than came
ANGLES = np.pi * (np.arange(720) + 1.0) / 720.0  # of a step


def wave_growth(model, method: Method, h: float, span: float) -> tuple[float, str, float]:
    """(times that waves of a line grow in a run, the store where they grow most, h k Y); far ends give back all.

    0 where nothing is known to grow.
    """
    candidates = []
    if method.kind == "linear":  # Rosenbrock's, whose stages see what comes by its slope
        return 0.0, "", 0.0
    for name, row, a in stores(model, h):
        for line in lines_at(model, row):
            pipe, steps = model.tables.pipes[line["pipe"]], line["hold"] / h
            round_trip = 2.0 * line["stretches"] * line["hold"]
            if LITTLE * a * span / round_trip < 1.0:
                continue
            damping = line["tau"] * line["stretches"] * float(drag_and_slope(pipe, float(pipe["flow"]))[1])
            once = np.max(np.abs(given_back(method, a, steps)) * np.abs(read(steps))) * np.exp(-damping)
            candidates.append((times(float(once) - 1.0, span / round_trip), name, a))
    return max(candidates, default=(0.0, "", 0.0))


def line_growth(model, method: Method, h: float, span: float) -> list[Notice]:
    """A notice for the store where waves of a line grow most, if they do."""
    grows, name, a = wave_growth(model, method, h, span)
    if grows < GROWS:
        return []
    wrong, other = grows >= GROWS**2, '"rk4" or "trapezoid"' if a < EASY else '"trapezoid"'
    text = (f"{name}: waves that delay lines bring back to it grow {grows:.3g} times in the run with {method.name} and "
            f"steps of {model.case.step_amount(h)}, {a:.3g} of the time in which they fill it (an estimate); "
            f"{'the numbers are not to be trusted' if wrong else 'it may be wrong'}; give method = {other}, "
            "or shorter steps")  # fmt: skip
    return [Notice("step-limit", name, text, "method", a, None, not wrong)]


def stores(model, h: float):
    """(name, number, h k Y) of nodes that store and that delay lines touch."""
    nodes, out = model.tables.nodes, None
    for i, (name, node) in enumerate(zip(model.case.places, nodes, strict=True)):
        if node["line_count"] == 0 or node["kind"] in (rec.FIXED, rec.JUNCTION, rec.PATCH):
            continue
        out = model.evaluate(model.case.numerics.start, model.start)[1] if out is None else out
        moving = node["kind"] >= rec.MOVING or (node["kind"] == rec.CHAMBER and node["row"] >= 0)
        stiffness = out[model.layout["stiffness"] + node["row"]] if moving else node["stiffness"]
        yield f"nodes.{name}", i, float(h * stiffness * node["admittance"])


def lines_at(model, i: int):
    """Rows of the delay lines that touch node i."""
    node = model.tables.nodes[i]
    ends = model.tables.integers[node["lines"] : node["lines"] + node["line_count"]]
    return [model.tables.delays[end // 2] for end in ends]


def given_back(method: Method, a: float, steps: float) -> np.ndarray:
    """S of waves that turn by ANGLES a step, with how they are read so many steps after they were sent."""
    solved = np.linalg.solve((np.eye(method.stages) + a * method.a).T, method.b)
    seen = np.array([read(steps - c) for c in method.c])
    return 2.0 * a * (solved @ seen) / (np.exp(1j * ANGLES) - (1.0 - a * solved.sum())) - read(steps)


def read(steps: float) -> np.ndarray:
    """What is read of waves that turn by ANGLES a step, so many steps after they were sent."""
    steps_up = int(np.ceil(steps - 1e-9))
    x = max(0.0, steps_up - steps)
    weights = six(x) if steps_up >= 3 else four(x) if steps_up >= 2 else three(x)
    if x < 1e-9:
        weights = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    places = np.arange(-2, 4) - steps_up
    return np.exp(1j * np.outer(ANGLES, places)) @ np.array(weights)
