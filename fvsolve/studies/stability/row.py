"""One row of a study of stability, and the way to JSON and back. Knows numbers; computes none."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import numpy as np


@dataclass(frozen=True)
class StabilityRow:
    """One scheme with one method. Steps in s; inf: no failing step was found, nan: not known (`left_out` says why).

    predicted : greatest step with growth <= threshold in `steps` steps; growth, after : of a step just beyond, the
    greatest growth and after how many steps; where, share : the part that holds most energy of what has grown, and its
    share; measured : the same limit on real runs, measured_up_to : the longest step that was run
    eigenvalues, field_of_values, von_neumann : greatest step that keeps these in the method's region
    rate : greatest wave rate [1/s], a step times it is the Courant number; 0 without cells
    frozen : of a limited scheme, the predictions with its weights standing still at their extremes
    lines : whether it is of delay lines, whose steps are followed themselves: there are no bounds
    longer : of a limited scheme with Euler, the measured step for ten times as many steps
    """

    scheme: str
    method: str
    when: str
    states: int
    steps: int
    threshold: float
    rate: float
    predicted: float = np.nan
    growth: float = np.nan
    after: int = 0
    where: str = ""
    share: float = np.nan
    measured: float = np.nan
    measured_up_to: float = np.nan
    eigenvalues: float = np.nan
    field_of_values: float = np.nan
    von_neumann: float = np.nan
    greatest_real: float = np.nan
    frozen: dict[str, float] = field(default_factory=dict)
    longer: float = np.nan
    lines: bool = False
    left_out: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def limited(self) -> bool:
        """Whether it is of a limited scheme: of that nothing is predicted but with weights that stand still."""
        return bool(self.frozen) or "frozen weights" in self.left_out

    @property
    def difference(self) -> float:
        """measured / predicted - 1; nan where there is none."""
        known = np.isfinite(self.measured) and np.isfinite(self.predicted) and self.predicted > 0.0
        return self.measured / self.predicted - 1.0 if known else np.nan

    def courant(self, step: float) -> float:
        """A step [s] as a Courant number; nan without cells."""
        return step * self.rate if self.rate > 0.0 else np.nan

    def plain(self) -> dict:
        """As JSON says it: steps [s] and Courant numbers; "none" where no failing step was found, null: not known."""
        found = asdict(self) | {"difference": self.difference}
        for name in ("predicted", "measured", "eigenvalues", "field_of_values", "von_neumann", "longer"):
            found[name] = said(getattr(self, name))
            found[f"{name}_courant"] = said(self.courant(getattr(self, name)))
        found["frozen"] = {name: said(step) for name, step in self.frozen.items()}
        return found


def said(x: float):
    """A number, "none" for infinity, None for what is not known."""
    return None if np.isnan(x) else "none" if np.isinf(x) else x


def read(found: dict) -> StabilityRow:
    """A row from what `Row.plain` said."""
    heard = {"none": np.inf, None: np.nan}
    kept = {name: found[name] for name in StabilityRow.__dataclass_fields__}
    for name, value in kept.items():
        if value is None or value == "none":
            kept[name] = heard[value]
    kept["frozen"] = {name: heard.get(step, step) for name, step in kept["frozen"].items()}
    return StabilityRow(**kept | {"notes": tuple(kept["notes"])})
