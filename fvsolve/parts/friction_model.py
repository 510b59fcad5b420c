"""Friction models of pipes and their parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from fvsolve.parts.table_model import Table, missing_key_faults
from fvsolve.parts.value import SHAPE, Choice, Number, Quantity, UsualRange, between, nonnegative, positive

MODELS = ("none", "steady", "quasi-steady", "unsteady", "hazen-williams", "chezy-manning")
WEIGHTINGS = ("zielke", "vardy-brown")
DARCY = ("roughness", "factor")
DARCY_WEISBACH = '"quasi-steady" or "steady" with a roughness, whose factor is Colebrook\'s'
SYNONYMS = dict.fromkeys(
    ("colebrook", "colebrook-white", "swamee-jain", "moody", "haaland", "darcy", "darcy-weisbach", "d-w", "dw"),
    DARCY_WEISBACH,
) | {"h-w": '"hazen-williams"', "hw": '"hazen-williams"', "manning": '"chezy-manning"', "c-m": '"chezy-manning"'}
KEYS_OF_MODEL = {  # keys of each model; at least one of the Darcy pair, or the coefficient, is needed
    "none": (),
    "steady": DARCY,
    "quasi-steady": DARCY,
    "unsteady": (*DARCY, "weighting", "accuracy"),
    "hazen-williams": ("coefficient",),
    "chezy-manning": ("coefficient",),
}


FACTORS = UsualRange(0.004, 0.5, "Moody's chart and slow laminar flow")  # the chart spans 0.008 to 0.1
COEFFICIENTS = {  # usual coefficients by model, from textbooks and the EPANET manual
    # plastic has 155; more if an import lengthened a pipe
    "hazen-williams": UsualRange(40.0, 500.0, "C of tuberculated iron to plastic"),
    "chezy-manning": UsualRange(0.006, 0.06, "n of glass to unlined rock"),
}


class Friction(Table):
    """Friction model of a pipe.

    steady : Darcy factor of the initial flow; quasi-steady : Darcy factor of the present flow
    unsteady : quasi-steady, plus the effect of past flow changes by a weighting function, a sum of exponentials; each
    term of the sum is a state of every cell and stores energy
    hazen-williams, chezy-manning : empirical formulas with a `coefficient`. Dissipated power: pressure drop times flow
    [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("roughness", "factor"),)

    model: Annotated[str, Choice("friction model", MODELS, "model of the wall friction", SYNONYMS)]
    roughness: Annotated[
        float | None,
        Quantity("length", nonnegative, "roughness of the wall for the models steady, quasi-steady and unsteady [m]"),
    ] = None
    factor: Annotated[
        float | None,
        Number(nonnegative, "Darcy friction factor, four times Fanning's, instead of `roughness` [-]", FACTORS),
    ] = None
    coefficient: Annotated[
        float | None, Number(positive, "coefficient C of hazen-williams [-], or n of chezy-manning [s/m^(1/3)]")
    ] = None

    weighting: Annotated[
        str | None,
        Choice(
            "weighting function",
            WEIGHTINGS,
            "weighting function of past flow changes, model unsteady; "
            "chosen by the initial Reynolds number if left out",
        ),
    ] = None
    accuracy: Annotated[
        float | None,
        Number(
            between(1e-6, 0.1),
            "relative accuracy of the sum of exponentials, model unsteady; 1e-4 if left out",
            changes=SHAPE,
        ),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        model = given.get("model")
        allowed = KEYS_OF_MODEL.get(model if isinstance(model, str) else "")
        faults = super().key_faults(given)
        if allowed is None:
            return faults
        stray = [key for key in given if key in cls.model_fields and key not in ("model", *allowed)]
        faults += [((key,), f'friction model "{model}" has no key {key}; remove this key') for key in stray]
        return faults + (missing_key_faults(given, allowed[:2]) if allowed else [])

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        usual, c = COEFFICIENTS.get(self.model), self.coefficient
        if usual is None or usual.least <= c <= usual.greatest:
            return
        text = f"{c:g} is outside {usual.least:g} to {usual.greatest:g}, {usual.source}"
        other = next((m for m, span in COEFFICIENTS.items() if span.least <= c <= span.greatest), None)
        text += f'; did you mean model = "{other}"?' if other else ""
        yield ("coefficient",), c, usual.least if c < usual.least else usual.greatest, text


NONE = Friction(model="none")
