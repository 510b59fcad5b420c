"""How a wall brakes the flow. Knows the models and their numbers; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.table import Table, at_least_one
from fvsolve.parts.value import Choice, Number, Quantity, between, nonnegative, positive

MODELS = ("none", "steady", "quasi-steady", "unsteady", "hazen-williams", "chezy-manning")
WEIGHTINGS = ("zielke", "vardy-brown")
DARCY = ("roughness", "factor")
KEYS = {  # of each model; at least one of the Darcy pair, or the coefficient
    "none": (),
    "steady": DARCY,
    "quasi-steady": DARCY,
    "unsteady": (*DARCY, "weighting", "accuracy"),
    "hazen-williams": ("coefficient",),
    "chezy-manning": ("coefficient",),
}


class Friction(Table):
    """none; steady (Darcy factor of the starting flow); quasi-steady (of the present flow); unsteady; two others.

    unsteady: quasi-steady, and the past of the flow by a weighting function, a sum of exponentials; each term is a
    state of every cell and stores energy. Dissipated power: pressure drop times flow [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("roughness", "factor"),)

    model: Annotated[str, Choice("friction model", MODELS, "how the wall brakes the flow")]
    roughness: Annotated[float | None, Quantity("length", nonnegative, "of the wall [m]")] = None
    factor: Annotated[float | None, Number(nonnegative, "Darcy's factor, four times Fanning's [-]")] = None
    coefficient: Annotated[float | None, Number(positive, "C of Hazen-Williams, or n of Manning")] = None

    weighting: Annotated[
        str | None, Choice("weighting function", WEIGHTINGS, "of the past; by the Reynolds number of the start")
    ] = None
    accuracy: Annotated[float | None, Number(between(1e-6, 0.1), "of the sum of exponentials, relative; 1e-4")] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        model = given.get("model")
        allowed = KEYS.get(model if isinstance(model, str) else "")
        faults = super().key_faults(given)
        if allowed is None:
            return faults
        stray = [key for key in given if key in cls.model_fields and key not in ("model", *allowed)]
        faults += [((key,), f'friction model "{model}" has no {key}') for key in stray]
        return faults + (at_least_one(given, allowed[:2]) if allowed else [])


NONE = Friction(model="none")
