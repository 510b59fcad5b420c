"""Sluice gates."""

from typing import Annotated

from pydantic import Field

from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import (
    PROFILE,
    Choice,
    Number,
    Quantity,
    anything,
    between,
    nonnegative,
    positive,
)
from fvsolve.parts.weir.part import COEFFICIENTS, WIDTHS, HydraulicStructure


class SluiceGate(HydraulicStructure, kind="sluice-gate"):
    """Gate above a sill, with energy up to its jet of depth y = Cc a, Cc the contraction, a the opening.

    Free: q = y h sqrt(2 g / (h + y)), per width, h the depth of the higher level above the sill. Drowned: energy to the
    depth above the jet, momentum behind it. Never more than over a weir of the same width and sill. Where the levels
    differ by less than 1 mm the flow is proportional to their difference. Ports: from, to, alike. Stored energy: none.
    Dissipated power: dp q [W].
    """

    width: Annotated[
        float, Quantity("length", positive, "width of the opening across the flow [m]", WIDTHS)
    ]
    sill: Annotated[float, Quantity("length", anything, "height of the sill above datum [m]")]
    opening: Annotated[
        Schedule, Scheduled("length", nonnegative, "height of the opening above the sill [m]")
    ]
    contraction: Annotated[
        float, Number(between(0, 1, open=True), "depth of the jet over the opening, Cc")
    ] = 0.61
    weir_kind: Annotated[
        str,
        Choice(
            "kind of crest",
            tuple(COEFFICIENTS),
            "kind of the weir that limits the flow of a raised gate",
            changes=PROFILE,
        ),
        Field(alias="kind"),
    ] = "broad"
