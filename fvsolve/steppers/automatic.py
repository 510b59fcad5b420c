"""`auto`: explicit steps while the spectrum allows them, implicit ones where stiffness makes those cheaper.

Knows which two methods, what their steps cost and how to say why one gave way to the other.
"""

from __future__ import annotations

from fvsolve.steppers import slots
from fvsolve.steppers.methods import AUTO
from fvsolve.steppers.stepper import Stepper
from fvsolve.steppers.structure import Structure
from fvsolve.steppers.tableau import method_named

EXPLICIT, IMPLICIT, TIGHT = "dormand-prince", "rodas-5p", "radau-iia-5"
TIGHT_BELOW = 1e-6  # rtol from which on TIGHT costs less: `benchmarks/stiff.py auto`
DENSE, SPARSE = 0.05, 40.0  # factors and solves of a step in calls of rhs: per state squared; whatever the size


def first_method(name: str) -> str:
    """The method that a run by `name` begins with."""
    return EXPLICIT if name == AUTO else name


def implicit_method(rtol: float) -> str:
    """Name of the implicit method of a run: near zero drop a linearised step goes to and fro, Newton does not."""
    return IMPLICIT if rtol >= TIGHT_BELOW else TIGHT


def price(structure: Structure) -> float:
    """What an implicit step costs in explicit ones: Jacobian, stages, factor and solves, counted in calls of rhs."""
    implicit, explicit = method_named(IMPLICIT), method_named(EXPLICIT)
    algebra = DENSE * structure.n**2 if structure.kind == "dense" else SPARSE
    return (structure.color_count + implicit.stages + 1 + algebra) / (explicit.stages - 1)


def watch(stepper: Stepper, structure: Structure) -> None:
    """Have the loop watch stiffness."""
    stepper.orders[slots.WATCH], stepper.orders[slots.PRICE] = 1.0, price(structure)


def wants_change(stepper: Stepper) -> bool:
    """Whether the loop came back because the other kind of step would be cheaper."""
    return stepper.memory[slots.CASES] < 0.0


def change(stepper: Stepper) -> tuple[float, float, float]:
    """Go on by the other method; returns when, with which spectral radius [1/s] and after which step [s]."""
    memory = stepper.memory
    implicit = implicit_method(stepper.orders[slots.SIZE])
    stepper.use(method_named(implicit if stepper.method.explicit else EXPLICIT))
    memory[slots.SWITCHES] += 1.0
    memory[slots.CASES] = 0.0
    return float(memory[slots.T]), float(memory[slots.RADIUS]), float(memory[slots.LAST])


def account(start: float, changes: list[tuple[float, float, float]], price: float, rtol: float) -> list[dict]:
    """Which method from when on, and why."""
    found = [{"time": start, "method": EXPLICIT, "why": "until the spectrum forbids it"}]
    for k, (t, radius, h) in enumerate(changes):
        if k % 2 == 0:
            why = (f"stability held explicit steps to {h:.3g} s"
                   + (f", at rates of about {radius:.3g} 1/s" if radius > 0 else "")
                   + f"; an implicit step costs about {price:.2g} of them")  # fmt: skip
        else:
            why = f"rates of about {radius:.3g} 1/s allow explicit steps near {h:.3g} s again"
        found.append({"time": t, "method": EXPLICIT if k % 2 else implicit_method(rtol), "why": why})
    return found
