"""A basin with a free surface in the plane. Knows its sides, its bed and who may join where; computes nothing."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.parts.node import Node
from fvsolve.parts.table import Table, misfits
from fvsolve.parts.value import Choice, Misfit, Quantity, Rows, Setting, Value, nonnegative, positive
from fvsolve.units import show

SIDES = ("west", "east", "south", "north")


class Patch(Table):
    """A stretch of a side that links may join as `BASIN.PATCH`."""

    side: Annotated[str, Choice("side", SIDES, "of the basin")]
    span: Annotated[
        tuple[float, float] | None,
        Rows("length", nonnegative, length=2, about="along the side, all of it if left out [m]"),
    ] = None


class Dam(Table):
    """A wall across the basin that is gone at the start."""

    x: Annotated[float, Quantity("length", positive, "where it stood [m]")]
    level: Annotated[float, Quantity("level", nonnegative, "of the water beyond it, above the elevation [m]")]


class Broken(Value):
    """The table of a dam."""

    about = "a dam that is gone at the start: { x, level beyond it }"

    def read(self, given: Any, setting: Setting) -> Dam:
        return given if isinstance(given, Dam) else Dam.model_validate(given, context=setting)


class Patches(Value):
    """Patches by name."""

    about = "patches by name: { outlet = { side, span } }"

    def read(self, given: Any, setting: Setting) -> dict[str, Patch]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table of patches; wanted {{ NAME = {{ side, span }} }}")
        found, faults = {}, []
        for name, one in given.items():
            try:
                found[name] = one if isinstance(one, Patch) else Patch.model_validate(one, context=setting)
            except Misfit as error:
                faults += [((name, *below), message) for below, message in error.faults]
            except ValueError as error:
                faults += [((name, *below), message) for below, message in misfits(error, Patch.keys())]
        if faults:
            raise Misfit(faults)
        return found


class Cells(Value):
    """Numbers of cells along both sides."""

    about = "[along x, along y]"

    def read(self, given: Any, setting: Setting) -> tuple[int, int]:
        whole = (
            isinstance(given, (list, tuple)) and len(given) == 2 and all(type(one) is int and one > 0 for one in given)
        )
        if not whole:
            raise ValueError(f"{show(given)} is no pair of numbers of cells; wanted for example [64, 32]")
        return tuple(given)


class Place(Node):
    """A patch as a place: pressure of the water over its bed, flow into the cells behind it."""

    fixes_pressure: ClassVar[bool] = True
    kind: ClassVar[str] = "patch"

    basin: str
    patch: str
    level: float


class Basin(Node, kind="basin"):
    """Water over a bed between walls, h_t + div q = 0, q_t + div(q q / h + g h^2 / 2) = -g h grad(bed).

    Places: its patches (pressure over the bed there, flow). Stored energy: rho times the integral of g h^2 / 2 + g h
    bed + q^2 / (2 h) over the area [J].
    """

    fixes_pressure: ClassVar[bool] = True
    quantities: ClassVar[dict[str, str]] = {}

    size: Annotated[tuple[float, float], Rows("length", positive, length=2, about="along x and y [m]")]
    cells: Annotated[Any, Cells()]
    level: Annotated[float, Quantity("level", nonnegative, "of the water at the start, above the elevation [m]")]
    bed_slope: Annotated[
        tuple[float, float],
        Rows("number", length=2, about="rise of the bed along x and y, from 0 in the south-west [-]"),
    ] = (0.0, 0.0)
    dam: Annotated[Dam | None, Broken()] = None
    patches: Annotated[Any, Patches()] = {}

    @classmethod
    def own_places(cls, given: dict[str, Any]) -> tuple[str, ...] | None:
        patches = given.get("patches")
        return tuple(patches) if isinstance(patches, dict) else ()

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        return {
            f"{name}.{patch}": Place.model_construct(
                elevation=(self.elevation or 0.0) + bed if self.elevation is not None or bed else None, position=None,
                basin=name, patch=patch, level=self.level - bed,
            )
            for patch, bed in ((patch, float(self.bed_at(self.span_of(patch)).mean())) for patch in self.patches)
        }, {}  # fmt: skip

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """x and y of all cells, row by row [m]."""
        (nx, ny), (wide, deep) = self.cells, self.size
        x, y = np.meshgrid((np.arange(nx) + 0.5) * wide / nx, (np.arange(ny) + 0.5) * deep / ny)
        return x.ravel(), y.ravel()

    def bed_at(self, cells: np.ndarray) -> np.ndarray:
        """Height of the bed of cells above the elevation [m]."""
        x, y = self.centres()
        return (self.bed_slope[0] * x + self.bed_slope[1] * y)[cells]

    def span_of(self, patch: str) -> np.ndarray:
        """Numbers of the cells behind a patch."""
        (nx, ny), one = self.cells, self.patches[patch]
        along, count = (self.size[1], ny) if one.side in ("west", "east") else (self.size[0], nx)
        low, high = one.span or (0.0, along)
        at = np.arange(round(low / along * count), max(round(high / along * count), round(low / along * count) + 1))
        at = at[(at >= 0) & (at < count)]
        return {"west": at * nx, "east": at * nx + nx - 1, "south": at, "north": (ny - 1) * nx + at}[one.side]
