"""Method `auto`: explicit steps while stability allows them, implicit steps where stiffness makes those cheaper."""

import numpy as np

from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.structure import Structure
from fvsolve.core.steppers.tableau import AUTO, method_named

EXPLICIT, IMPLICIT, TIGHT_IMPLICIT = "dormand-prince", "rodas-5p", "radau-iia-5"
TIGHT_BELOW = 1e-6  # rtol below which TIGHT_IMPLICIT costs less: `benchmarks/stiff.py auto`
# Cost of factorisation and solves of a step, in rhs calls: DENSE times the number of states squared; SPARSE in total.
DENSE_COST, SPARSE_COST = 0.05, 40.0


def first_method(name: str) -> str:
    """Name of the method with which a run by method `name` begins."""
    return EXPLICIT if name == AUTO else name


def implicit_method(rtol: float) -> str:
    """Name of the implicit method of `auto` for the relative tolerance `rtol`.

    Below TIGHT_BELOW it is a method with Newton iterations: near zero pressure drop linearly implicit steps oscillate.
    """
    return IMPLICIT if rtol >= TIGHT_BELOW else TIGHT_IMPLICIT


def step_cost_ratio(structure: Structure, work: float = 1.0) -> float:
    """Cost of an implicit step as a multiple of an explicit step, both counted in calls of the right-hand side.

    work : cost of a call relative to that of a right-hand side that computes each rate from few states
    """
    implicit, explicit = method_named(IMPLICIT), method_named(EXPLICIT)
    algebra = DENSE_COST * structure.n**2 if structure.kind == "dense" else SPARSE_COST
    # An explicit step takes its first rate from the step before, so that one stage costs nothing.
    return (structure.color_count + implicit.stages + 1 + algebra / work) / (explicit.stages - 1)


def watch(stepper: Integrator, structure: Structure, work: float = 1.0) -> None:
    """Switch on the stiffness test of the time loop, by which the method `auto` chooses between its two methods.

    work : as for `step_cost_ratio`
    """
    stepper.set_control(watch=1, price=step_cost_ratio(structure, work))
    # without waves: the rates may bend at levels of tanks, see `hidden_stiffness`
    if stepper.control[0]["keeps_step"]:
        stepper.returns = np.zeros((2, structure.n))


def is_change_due(stepper: Integrator) -> bool:
    """True if the time loop has returned because the other kind of method (explicit or implicit) would be cheaper."""
    return bool(stepper.state[0]["switch_count"] < 0.0)


def change(stepper: Integrator) -> tuple[float, float, float]:
    """Switch from the explicit to the implicit method of `auto`, or back.

    Returns (time [s], spectral radius [1/s], last step [s]) at the switch.
    """
    state = stepper.state[0]
    implicit = implicit_method(stepper.control[0]["size"])
    stepper.use(method_named(implicit if stepper.method.explicit else EXPLICIT))
    state["switches"] += 1.0
    state["switch_count"] = 0.0
    return float(state["t"]), float(state["radius"]), float(state["last"])


def method_history(
    start: float, changes: list[tuple[float, float, float]], price: float, rtol: float
) -> list[dict]:
    """List of the methods used in a run with the method `auto`, each a dict with start time, method and reason.

    start : start time of the run; changes : results of `change`
    price : cost of an implicit step in explicit steps; rtol : tolerance of the run
    """
    entries = [
        {"time": start, "method": EXPLICIT, "why": "until stability limits the explicit steps"}
    ]
    for k, (t, radius, h) in enumerate(changes):
        if k % 2 == 0:
            reason = (
                f"stability limited explicit steps to {h:.3g} s"
                + (f", at rates of about {radius:.3g} 1/s" if radius > 0 else "")
                + f"; an implicit step costs about {price:.2g} explicit steps"
            )
        else:
            reason = f"rates of about {radius:.3g} 1/s allow explicit steps near {h:.3g} s again"
        entries.append(
            {"time": t, "method": EXPLICIT if k % 2 else implicit_method(rtol), "why": reason}
        )
    return entries
