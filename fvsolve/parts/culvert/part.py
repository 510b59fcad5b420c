"""Culverts, and their inlets by HDS-5."""

import functools
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

from fvsolve.data import read_table
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import (
    PROFILE,
    Choice,
    Number,
    Quantity,
    Rows,
    UsualRange,
    Whole,
    between,
    nonnegative,
    positive,
)
from fvsolve.parts.weir.part import HydraulicStructure

SIZES = UsualRange(0.1, 15.0, "drains of fields to bridges over streams")
LENGTHS = UsualRange(0.5, 1000.0, "drives of farms to embankments")
LOSSES = UsualRange(0.05, 3.0, "rounded inlets to grids")
ROUGHNESSES = UsualRange(0.008, 0.06, "smooth plastic to large corrugations")
# begins of the names of inlets of these shapes
CIRCLES, BOXES = ("circular-",), ("box-", "rectangular-")
INVERT_DROP = 0.5  # slope above which the formulas of inlets no longer hold


class Inlet(NamedTuple):
    """Inlet of a culvert: its place in HDS-5, the numbers of its formulas, and its entrance loss.

    form, K, M, c, Y : as printed in table A.1 of HDS-5; entrance_loss : ke of its table C.2
    """

    chart: str
    scale: str
    form: float
    K: float
    M: float
    c: float
    Y: float
    entrance_loss: float
    edge: str

    @property
    def slope_factor(self) -> float:
        """Factor Ks of the slope in the formulas of inlet control: 0.7 for mitred inlets."""
        return 0.7 if "itered" in self.edge else -0.5


@functools.cache
def inlets() -> dict[str, Inlet]:
    """Inlets of HDS-5 by name, in its order."""
    return {name: Inlet(*row) for name, row in read_table("culvert_inlets")["inlets"].items()}


class InletNames(Mapping):
    """Names of inlets, read from their table on first use."""

    def __getitem__(self, name: str) -> Inlet:
        return inlets()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(inlets())

    def __len__(self) -> int:
        return len(inlets())


class Culvert(HydraulicStructure, kind="culvert"):
    """Culvert, the lesser of inlet control and outlet control of HDS-5; see docs/structures.md.

    The barrels are circles, with `diameter`, or boxes, with `width` and `height`. Both ends have the same inlet. Where
    the levels differ by less than 1 mm the flow is proportional to their difference. Ports: from, to. Stored energy:
    none. Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {**HydraulicStructure.quantities, "control": "number"}
    on_request: ClassVar[tuple[str, ...]] = ("regime", "control")

    diameter: Annotated[
        float | None, Quantity("length", positive, "diameter of a circular barrel [m]", SIZES)
    ] = None
    width: Annotated[
        float | None, Quantity("length", positive, "width of a box, with `height` [m]", SIZES)
    ] = None
    height: Annotated[
        float | None, Quantity("length", positive, "height of a box, with `width` [m]", SIZES)
    ] = None
    length: Annotated[float, Quantity("length", positive, "length of the barrels [m]", LENGTHS)]
    inverts: Annotated[
        tuple[float, float],
        Rows("length", length=2, about="heights of the inverts at `from` and `to` above datum [m]"),
    ]
    manning: Annotated[
        float, Number(positive, "Manning's n of the barrels [s/m^(1/3)]", ROUGHNESSES)
    ]
    inlet: Annotated[
        str,
        Choice(
            "inlet",
            InletNames(),
            "[inlet](structures.md#inlets-of-culverts) by HDS-5",
            changes=PROFILE,
        ),
    ]
    entrance_loss: Annotated[
        float | None,
        Number(nonnegative, "loss coefficient of the inlet; that of `inlet` if left out", LOSSES),
    ] = None
    exit_loss: Annotated[float, Number(nonnegative, "loss coefficient of the outlet", LOSSES)] = 1.0
    barrels: Annotated[int, Whole(between(1, 1000), "number of equal barrels", PROFILE)] = 1
    blockage: Annotated[
        float, Number(between(0, 1), "share of the flow that debris blocks, below 1")
    ] = 0.0

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults, box = super().key_faults(given), {"width", "height"} & given.keys()
        if "diameter" in given:
            faults += [
                ((key,), f"`diameter` already gives the size; leave the key `{key}` out")
                for key in sorted(box)
            ]
        elif len(box) < 2:
            faults.append(((), "size is missing; expected `diameter`, or `width` and `height`"))
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.blockage >= 1.0:
            yield ("blockage",), "1 blocks all of the flow; expected a value below 1, or no culvert"
        if abs(self.inverts[0] - self.inverts[1]) >= INVERT_DROP * self.length:
            text = f"fall by {abs(self.inverts[0] - self.inverts[1]):g} m over a length of {self.length:g} m"
            yield (
                ("inverts",),
                f"{text}; expected a slope below {INVERT_DROP:g}, for which the formulas of inlets hold",
            )

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        shape, others = ("circular barrels", BOXES) if self.width is None else ("boxes", CIRCLES)
        if self.inlet.startswith(others):
            text = f'"{self.inlet}" has formulas for {"boxes" if others is BOXES else "circular barrels"}'
            yield (
                ("inlet",),
                0.0,
                0.0,
                f"{text}, but the culvert has {shape}; give an inlet of this shape",
            )

    @property
    def losses(self) -> float:
        """Sum of the loss coefficients of inlet and outlet."""
        entrance = (
            inlets()[self.inlet].entrance_loss if self.entrance_loss is None else self.entrance_loss
        )
        return entrance + self.exit_loss
