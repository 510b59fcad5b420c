"""Valves and orifices, and the keys for the size of all restrictions."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from fvsolve.core.assembly.lowering import LAMINAR_REYNOLDS, Restriction, opening_input
from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import ListTable, Table, keys_json, read_lists
from fvsolve.parts.value import (
    NEEDED,
    Choice,
    Number,
    Quantity,
    ReadContext,
    Rows,
    UsualRange,
    Value,
    between,
    positive,
)

DISCHARGE_COEFFICIENT = 0.61  # sharp edge
GALLON, PSI, MINUTE = 3.785411784e-3, 6894.757293168361, 60.0
COEFFICIENTS = UsualRange(1e-6, 1e6, "metering valves to butterfly valves of dams")
WATER_15, WATER_60F = 1000.0, 999.016  # densities for which Kv and Cv are defined [kg/m3]


@dataclass(frozen=True, eq=False)
class Characteristic(ListTable):
    """Relative flow area over the opening of the stem, linear between entries.

    opening : float64[n]  ascending from 0 to 1; flow_area : float64[n]  over the flow area at full opening, from 0
    """

    opening: np.ndarray
    flow_area: np.ndarray


class CharacteristicValue(Value):
    """Value of a case file for the characteristic of a valve: a name or a table."""

    about = "relative flow area over opening"
    takes = '`"linear"`, `"equal-percentage"`, `{ opening = [0, ..., 1], flow_area = [0, ...] }`'
    names = Choice("characteristic", ("linear", "equal-percentage"))
    keys = {
        "opening": (Rows("number", between(0, 1)), NEEDED),
        "flow_area": (Rows("number", between(0, 1)), NEEDED),
    }

    def read(self, given: Any, setting: ReadContext) -> str | Characteristic:
        if isinstance(given, Characteristic):
            return given
        if not isinstance(given, dict):
            return self.names.read(given, setting)
        lists = read_lists(given, self.keys, setting, "openings", self.end_faults)
        return Characteristic(*map(np.array, lists))

    def end_faults(self, opening: tuple[float, ...], flow_area: tuple[float, ...]) -> list:
        """Faults of the first and last entries of both lists."""
        faults = []
        if opening[0] != 0 or opening[-1] != 1:
            faults.append((("opening",), "openings must begin at 0 and end at 1"))
        if flow_area[0] != 0:
            faults.append((("flow_area",), "opening 0 is shut: the first flow area must be 0"))
        return faults

    def json(self) -> dict[str, Any]:
        return {"anyOf": [self.names.json(), keys_json(self.keys)]}


class Sized(Table):
    """Base of restrictions: size by discharge coefficient Cd, loss coefficient K, Kv or Cv.

    sizes : keys that give a size, for messages
    """

    sizes: ClassVar[str] = "area, diameter, Kv or Cv"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("discharge_coefficient", "loss_coefficient", "Kv", "Cv"),
        ("area", "diameter"),
    )

    discharge_coefficient: Annotated[
        float | None,
        Number(
            between(0, 1, open=True),
            f"discharge coefficient Cd, with `area` or `diameter`; {DISCHARGE_COEFFICIENT} if left out",
        ),
    ] = None
    loss_coefficient: Annotated[
        float | None,
        Number(positive, "loss coefficient K, referred to the velocity in `area` or `diameter`"),
    ] = None
    Kv: Annotated[
        float | None,
        Number(positive, "flow coefficient Kv, m3/h of water of 1000 kg/m3 at 1 bar", COEFFICIENTS),
    ] = None
    Cv: Annotated[
        float | None,
        Number(
            positive,
            "flow coefficient Cv, US gpm of water of 999.016 kg/m3 (60 degF) at 1 psi",
            COEFFICIENTS,
        ),
    ] = None
    area: Annotated[
        float | None,
        Quantity(
            "area",
            positive,
            "area of the opening [m2]; needed unless `diameter`, `Kv` or `Cv` is given",
            UsualRange(1e-12, 200.0, "leaks to sluices"),
        ),
    ] = None
    diameter: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "diameter of the opening [m]",
            UsualRange(1e-6, 14.0, "leaks to sluices"),
        ),
    ] = None
    laminar_reynolds: Annotated[
        float | None, Number(positive, "Reynolds number below which the flow is laminar")
    ] = None

    def model_post_init(self, _: Any) -> None:
        if self.Kv is self.Cv is self.loss_coefficient is self.discharge_coefficient is None:
            object.__setattr__(self, "discharge_coefficient", DISCHARGE_COEFFICIENT)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        bare = next((key for key in ("Kv", "Cv") if key in given), None)
        if bare:
            stray = [key for key in ("area", "diameter") if key in given]
            return faults + [
                ((key,), f"{bare} already gives the size; leave the key `{key}` out")
                for key in stray
            ]
        if "area" in given or "diameter" in given:
            return faults
        alone = next(
            (key for key in ("discharge_coefficient", "loss_coefficient") if key in given), None
        )
        text = (
            f"{alone} needs area or diameter" if alone else f"size is missing; expected {cls.sizes}"
        )
        return faults + [((), text)]

    def flow_area(self, density: float = 1000.0) -> float:
        """Product Cd A [m2] of discharge coefficient and area at full opening, such that q = Cd A sqrt(2 dp / rho).

        density : density of the fluid [kg/m3], which only a rated flow needs

        A loss coefficient K gives A / sqrt(K). Kv gives Kv / 3600 / sqrt(2e5 / 1000); Cv is converted in the same way
        from US gallons per minute and psi, with the density of water at 60 degF.
        """
        if self.Kv is not None:
            return self.Kv / 3600.0 / math.sqrt(2.0 * 1e5 / WATER_15)
        if self.Cv is not None:
            return self.Cv * GALLON / MINUTE / math.sqrt(2.0 * PSI / WATER_60F)
        area = self.area if self.area is not None else math.pi / 4.0 * self.diameter**2
        if self.loss_coefficient is not None:
            return area / math.sqrt(self.loss_coefficient)
        return self.discharge_coefficient * area


CLOSURE = 'opening = { start = "1 s", duration = "2 s", value = [1, 0] }'


class Valve(Sized, TwoPort, kind="valve"):
    """Turbulent restriction, q = f(opening) Cd A sqrt(2 |dp| / rho) sign(dp), equal in both directions.

    q is the flow, f the characteristic, Cd A the size at full opening, dp the drop (docs/course.md, 79). Ports: from,
    to; no flow at opening 0. Stored energy: none. Dissipated power: dp q [W].
    """

    synonyms: ClassVar[dict[str, str]] = dict.fromkeys(
        (
            "closing_time",
            "closure_time",
            "close_time",
            "closing",
            "opening_time",
            "stroke_time",
            "schedule",
        ),
        CLOSURE,
    )

    opening: Annotated[
        Schedule, Scheduled("number", between(0, 1), "stem position, 0 shut to 1 open")
    ] = Field(default_factory=lambda: constant(1.0))
    characteristic: Annotated[Any, CharacteristicValue()] = "linear"


class ValveRows(Restriction, kind="valve"):
    """Conversion to table rows of valves: a square-root law, whose conductance follows a schedule of the opening."""

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.opening)
        super().restriction(draft, name, link, row)
        if link.characteristic == "equal-percentage":
            row["characteristic"] = 1
        elif link.characteristic != "linear":
            row["characteristic"], row["table"] = 2, len(draft.floats)
            row["table_size"] = len(link.characteristic.opening)
            draft.floats += [*link.characteristic.opening, *link.characteristic.flow_area]

    def resize(self, draft, name, before, part, row) -> bool:
        others = part.opening != before.opening or part.characteristic != before.characteristic
        if (
            others
            or row["hooks"] >= 0
            or (part.laminar_reynolds is None) != (before.laminar_reynolds is None)
        ):
            return False
        softened = part.laminar_reynolds is None and row["transition"] > 0.0
        draft.restriction(name, part, row)
        if softened:
            row["transition"] = draft.hydraulics.transition_flow(
                name, part, LAMINAR_REYNOLDS, draft.fault
            )
        return True

    def inputs(self, model, name, part):
        return opening_input(model, name)


class Orifice(Valve, kind="orifice"):
    """A restriction with the law of a valve, whose opening is usually fixed.

    q = f(opening) Cd A sqrt(2 |dp| / rho) sign(dp), with flow q, characteristic f, size Cd A and drop dp
    (docs/course.md, 79). Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """


class OrificeRows(ValveRows, kind="orifice"):
    """Conversion to table rows of orifices: the same rows as those of valves."""
