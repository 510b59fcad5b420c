"""Manholes: lids between a street and a shaft."""

from typing import Annotated

from fvsolve.parts.value import Number, Quantity, UsualRange, anything, positive
from fvsolve.parts.weir.part import HydraulicStructure

AREAS = UsualRange(0.01, 4.0, "gullies to shafts")
PERIMETERS = UsualRange(0.3, 10.0, "gullies to shafts")
COEFFICIENTS = UsualRange(0.05, 2.1, "Rubinato et al. 2018, Itzi")


class Manhole(HydraulicStructure, kind="manhole"):
    """Lid through which water falls from a street into a shaft, or rises from a full shaft.

    The street is the end at a patch of a basin; if both ends or none are patches, it is `from`.

    Down: the lesser of a weir, 2/3 Cw P sqrt(2 g) h^1.5, times (1 - r^1.5)^0.385 while the shaft is above the crest,
    and an orifice, Co A sqrt(2 g (z - max(H, crest))). Up: Co A sqrt(2 g (H - max(z, crest))). z is the level of the
    street, H that of the shaft, h = z - crest, r = (H - crest) / h, P the perimeter, A the area. Where the levels
    differ by less than 1 mm the flow is proportional to their difference. Ports: from, to. Stored energy: none.
    Dissipated power: dp q [W].
    """

    crest: Annotated[
        float, Quantity("length", anything, "height of the lid, the street there, above datum [m]")
    ]
    area: Annotated[float, Quantity("area", positive, "area A of the open lid [m2]", AREAS)]
    perimeter: Annotated[
        float, Quantity("length", positive, "perimeter P over which water falls [m]", PERIMETERS)
    ]
    weir_coefficient: Annotated[
        float, Number(positive, "coefficient Cw of the weir", COEFFICIENTS)
    ] = 0.54
    orifice_coefficient: Annotated[
        float, Number(positive, "coefficient Co of the orifice", COEFFICIENTS)
    ] = 0.167
