"""Weirs, and the base of structures between two water levels."""

from typing import Annotated, ClassVar

from pydantic import Field

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import PROFILE, Choice, Number, Quantity, UsualRange, anything, positive

WIDTHS = UsualRange(0.05, 1000.0, "notches of flumes to spillways of dams")
WEIR_COEFFICIENTS = UsualRange(0.3, 0.85, "rough broad crests to rounded crests of spillways")
COEFFICIENTS = {"sharp": 0.62, "broad": 0.577}  # kind of the crest -> coefficient


class HydraulicStructure(TwoPort):
    """Base of structures, whose flow follows the water levels at both ends: their heads, without velocity head."""

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "regime": "number"}
    on_request: ClassVar[tuple[str, ...]] = ("regime",)


class Weir(HydraulicStructure, kind="weir"):
    """Weir, q = 2/3 C sqrt(2 g) b h^1.5, times (1 - r^1.5)^0.385 while the lower level is above the crest.

    h is the height of the higher level above the crest, r that of the lower level over h, b the width, C the
    coefficient (Villemonte 1947). Where the levels differ by less than 1 mm the flow is proportional to their
    difference. Ports: from, to, alike. Stored energy: none. Dissipated power: dp q [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("coefficient", "kind"),)

    width: Annotated[
        float, Quantity("length", positive, "width of the crest across the flow [m]", WIDTHS)
    ]
    crest: Annotated[Schedule, Scheduled("length", anything, "height of the crest above datum [m]")]
    coefficient: Annotated[
        float | None,
        Number(positive, "coefficient C; that of `kind` if left out", WEIR_COEFFICIENTS),
    ] = None
    crest_kind: Annotated[
        str,
        Choice(
            "kind of crest",
            tuple(COEFFICIENTS),
            "kind of the crest, C = 0.62 sharp, 0.577 broad",
            changes=PROFILE,
        ),
        Field(alias="kind"),
    ] = "sharp"

    @property
    def discharge_coefficient(self) -> float:
        """Coefficient C of the weir."""
        return COEFFICIENTS[self.crest_kind] if self.coefficient is None else self.coefficient
