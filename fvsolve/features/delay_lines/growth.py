"""Growth of waves between a storing node and the far end of a delay line: reflection factor of a time method.

The pressure p of a storing node with stiffness k [Pa/kg] follows dp/dt = k (2 w - Y p), with an arriving wave w [kg/s]
and the admittance Y of the line; the node reflects the wave Y p - w. Let a = h k Y with the step h, let A, b, c be the
coefficients of the Runge-Kutta method and R its stability function. A wave with the phase theta per step is then
reflected with the factor S = 2 a b (I + a A)^-1 exp(i theta c) / (exp(i theta) - R(-a)) - 1. |S| <= 1 under the
trapezoidal rule at any step, but not under Euler, nor under the implicit midpoint rule, which has no stage at the end
of the step: there waves grow, unless friction or the interpolation between steps damps them as much.
"""

import numpy as np

from fvsolve.core.assembly.features import with_slot
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.step_limits.greatest_step import growth_factor
from fvsolve.core.step_limits.growing_modes import LEAST_GROWTH
from fvsolve.core.steppers.tableau import Method
from fvsolve.errors import Notice
from fvsolve.features.delay_lines.kernels.line_rates import drag_and_slope
from fvsolve.features.delay_lines.kernels.tables import SLOT
from fvsolve.features.delay_lines.kernels.wave_history import (
    lagrange_four,
    lagrange_six,
    lagrange_three,
)

# times a: upper bound of what a method adds to a wave in a single reflection
REFLECTION_BOUND = 4.0
RK4_BOUND = 1.5  # value of a up to which rk4 does not amplify reflected waves
ANGLES = np.pi * (np.arange(720) + 1.0) / 720.0  # phases theta per step


def wave_growth(model, method: Method, h: float, span: float) -> tuple[float, str, float]:
    """(growth factor of waves in a run, name of the storing node, h k Y of the node).

    The waves are those between a storing node and the far end of a delay line, which reflects fully. The node is the
    one with the greatest growth.
    h : step [s]; k : stiffness of the node [Pa/kg]; Y : admittance of its lines [kg/s per Pa]
    span : duration of the run [s]
    The factor is 0 without storing nodes at delay lines, where waves cannot grow noticeably, and for Rosenbrock
    methods, for which it is not computed.
    """
    candidates = []
    if method.kind == "linear":  # Rosenbrock: stages use the time slope of arriving waves
        return 0.0, "", 0.0
    for name, row, a in storing_nodes(model, h):
        for line in lines_at(model, row):
            pipe, steps = model.tables.pipes[line["pipe"]], line["hold"] / h
            round_trip = 2.0 * line["stretches"] * line["hold"]
            if REFLECTION_BOUND * a * span / round_trip < 1.0:
                continue
            damping = (
                line["tau"]
                * line["stretches"]
                * float(drag_and_slope(pipe, float(pipe["flow"]))[1])
            )
            once = np.max(
                np.abs(reflection_factor(method, a, steps)) * np.abs(interpolation_factor(steps))
            ) * np.exp(-damping)
            candidates.append((growth_factor(float(once) - 1.0, span / round_trip), name, a))
    return max(candidates, default=(0.0, "", 0.0))


def line_growth_notices(model, method: Method, h: float, span: float) -> list[Notice]:
    """List with a notice for the storing node where waves of a delay line grow most.

    It is empty if they grow less than 10 times. h : step [s]; span : duration of the run [s]
    """
    grows, name, a = wave_growth(model, method, h, span)
    if grows < LEAST_GROWTH:
        return []
    wrong = grows >= LEAST_GROWTH**2
    other = '"rk4" or "trapezoid"' if a < RK4_BOUND else '"trapezoid"'
    text = (
        f"{name}: waves between this part and the delay lines grow by a factor of {grows:.3g} in the run (an "
        f"estimate), with {method.name} and steps of {model.case.step_amount(h)}, {a:.3g} times "
        "the time constant with which the lines fill the part; "
        f"{'the numbers are not to be trusted' if wrong else 'the results may be wrong'}; "
        f"give method = {other}, or shorter steps"
    )
    return [Notice("step-limit", name, text, "method", a, None, not wrong)]


def storing_nodes(model, h: float):
    """Yield (name, number, h k Y) of each storing node that is connected to delay lines.

    h : step [s]; k : stiffness of the node [Pa/kg]; Y : admittance of its lines [kg/s per Pa]
    """
    nodes = model.tables.nodes
    out = None
    ends = with_slot(model.features, SLOT).node_ends
    for i, (name, node) in enumerate(zip(model.case.places, nodes, strict=True)):
        if ends[i] == ends[i + 1] or node["kind"] in (rec.FIXED, rec.JUNCTION, rec.PATCH):
            continue
        out = model.evaluate(model.case.numerics.start, model.start)[1] if out is None else out
        moving = node["kind"] >= rec.MOVING or (node["kind"] == rec.CHAMBER and node["row"] >= 0)
        stiffness = out[model.layout["stiffness"] + node["row"]] if moving else node["stiffness"]
        yield f"nodes.{name}", i, float(h * stiffness * node["admittance"])


def lines_at(model, i: int):
    """Delay lines connected to node number i, as rows of the table of delay lines."""
    own = with_slot(model.features, SLOT)
    return [own.delays[end // 2] for end in own.node_ends[own.node_ends[i] : own.node_ends[i + 1]]]


def reflection_factor(method: Method, a: float, steps: float) -> np.ndarray:
    """Complex reflection factor of a storing node for waves with the phases ANGLES (0 to pi) per step : complex[720].

    It is the ratio of the wave that the node sends to the wave sent at the far end at the same time; it includes the
    delay and the interpolation of the line once.
    a : h k Y of the node, see `storing_nodes`; steps : delay of the line in steps
    """
    solved = np.linalg.solve((np.eye(method.stages) + a * method.a).T, method.b)
    seen = np.array([interpolation_factor(steps - c) for c in method.c])
    return 2.0 * a * (solved @ seen) / (
        np.exp(1j * ANGLES) - (1.0 - a * solved.sum())
    ) - interpolation_factor(steps)


def interpolation_factor(steps: float) -> np.ndarray:
    """Complex ratio of the waves read `steps` steps after they were sent to the waves that are sent now : complex[720].

    The waves have the phases ANGLES per step. The ratio includes the delay and the interpolation between steps.
    """
    steps_up = int(np.ceil(steps - 1e-9))
    x = max(0.0, steps_up - steps)
    weights = (
        lagrange_six(x)
        if steps_up >= 3
        else lagrange_four(x)
        if steps_up >= 2
        else lagrange_three(x)
    )
    if x < 1e-9:
        weights = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    places = np.arange(-2, 4) - steps_up
    return np.exp(1j * np.outer(ANGLES, places)) @ np.array(weights)
