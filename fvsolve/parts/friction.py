"""How a wall brakes the flow. Knows the models and their numbers; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.table import Table, at_least_one
from fvsolve.parts.value import Choice, Number, Quantity, nonnegative, positive

MODELS = ("none", "steady", "quasi-steady", "hazen-williams")


class Friction(Table):
    """none; steady (Darcy factor of the starting flow); quasi-steady (of the present flow); hazen-williams.

    Dissipated power: pressure drop times flow [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("roughness", "factor"),)

    model: Annotated[str, Choice("friction model", MODELS, "how the wall brakes the flow")]
    roughness: Annotated[float | None, Quantity("length", nonnegative, "of the wall [m]")] = None
    factor: Annotated[float | None, Number(nonnegative, "Darcy's factor, four times Fanning's [-]")] = None
    coefficient: Annotated[float | None, Number(positive, "Hazen-Williams C, SI form [-]")] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        model = given.get("model")
        allowed = {
            "none": (),
            "steady": ("roughness", "factor"),
            "quasi-steady": ("roughness", "factor"),
            "hazen-williams": ("coefficient",),
        }.get(model if isinstance(model, str) else "")
        faults = super().key_faults(given)
        if allowed is None:
            return faults
        stray = [key for key in ("roughness", "factor", "coefficient") if key in given and key not in allowed]
        faults += [((key,), f'friction model "{model}" has no {key}') for key in stray]
        return faults + (at_least_one(given, allowed) if allowed else [])


NONE = Friction(model="none")
