"""Row of a stability study, with conversion to and from JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import numpy as np


@dataclass(frozen=True)
class StabilityRow:
    """Limits of the step [s] for a scheme with a method; inf: no failing step found, nan: unknown, see `left_out`.

    when : state about which deviations grow; states : number of states; steps : number of steps over which they grow
    predicted : greatest step with which the linearised case grows by `threshold` at most
    growth, after : greatest growth with the least step that is found to fail, and its number of steps
    where, share : part with the most energy of the grown deviation, and its share of the energy
    measured : limit of real runs, nan also if no safe step is found
    measured_up_to : a step with which real runs fail, or the longest step of real runs if none fails
    eigenvalues, field_of_values, von_neumann : bounds, the greatest steps with which the eigenvalues, the field of
    values, or the waves of a uniform grid are in the stability region
    greatest_real : greatest real part of an eigenvalue [1/s], 0 if none is positive
    rate : greatest wave rate [1/s]; the Courant number is the step times this rate; 0 without cells
    frozen : for a limited scheme, predicted limits with constant weights, by name of the resulting linear scheme
    lines : True for a case with delay lines, for which there are no bounds
    longer : for a limited scheme with Euler, the measured limit for ten times as many steps
    left_out : reason for each missing column
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
        """True for a limited scheme, whose predictions have fixed weights."""
        return bool(self.frozen) or "frozen weights" in self.left_out

    @property
    def difference(self) -> float:
        """Relative difference of the limits, measured / predicted - 1; nan unless both are finite and positive."""
        known = np.isfinite(self.measured) and np.isfinite(self.predicted) and self.predicted > 0.0
        return self.measured / self.predicted - 1.0 if known else np.nan

    def courant(self, step: float) -> float:
        """Courant number of a step [s]; nan without cells."""
        return step * self.rate if self.rate > 0.0 else np.nan

    def plain(self) -> dict:
        """Data for JSON: steps [s] and Courant numbers; "none" if no failing step was found, null if unknown."""
        data = asdict(self) | {"difference": self.difference}
        for name in ("predicted", "measured", "eigenvalues", "field_of_values", "von_neumann", "longer"):
            data[name] = json_number(getattr(self, name))
            data[f"{name}_courant"] = json_number(self.courant(getattr(self, name)))
        data["frozen"] = {name: json_number(step) for name, step in self.frozen.items()}
        return data


def json_number(x: float):
    """Number for JSON: "none" for infinity, None for NaN."""
    return None if np.isnan(x) else "none" if np.isinf(x) else x


def row_from_json(data: dict) -> StabilityRow:
    """Row of a stability study from the data that `StabilityRow.plain` returned."""
    values = {"none": np.inf, None: np.nan}
    fields = {name: data[name] for name in StabilityRow.__dataclass_fields__}
    for name, value in fields.items():
        if value is None or value == "none":
            fields[name] = values[value]
    fields["frozen"] = {name: values.get(step, step) for name, step in fields["frozen"].items()}
    return StabilityRow(**fields | {"notes": tuple(fields["notes"])})
