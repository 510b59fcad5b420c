"""Elevation of the axis of a pipe over its chainage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.parts.tolerances import ROUNDING
from fvsolve.parts.value import ReadContext, Rows, Value, ValueFault, check_increasing, faults_of
from fvsolve.units import show

COLUMN_SETS = (("chainage", "elevation"), ("x", "y", "z"))
AXES = "x, y, z"


@dataclass(frozen=True, eq=False)
class Profile:
    """Elevation over chainage, linear between points.

    chainage : float64[n]  distance along the axis, ascending [m]; elevation : float64[n]  of the axis above datum [m]
    given : table of the case file, in SI; plan : float64[n, 2]  x and y of the points [m], or None
    """

    chainage: np.ndarray
    elevation: np.ndarray
    given: dict[str, Any]
    plan: np.ndarray | None = None

    @property
    def length(self) -> float:
        """Length of the pipe axis [m]."""
        return float(self.chainage[-1] - self.chainage[0])

    @property
    def distance(self) -> np.ndarray:
        """Distances of the points from the first point [m] : float64[n]."""
        return self.chainage - self.chainage[0]

    def at(self, distance: Any) -> Any:
        """Elevation [m] at given distances from the first point [m]."""
        return np.interp(distance, self.distance, self.elevation)

    def plan_at(self, distance: Any) -> np.ndarray:
        """x and y at given distances from the first point, of a profile in space : float64[m, 2] [m]."""
        return np.column_stack([np.interp(distance, self.distance, axis) for axis in self.plan.T])

    def part(self, begin: float, end: float) -> Profile:
        """Part of the profile between two distances from the first point [m]; its chainages are unchanged."""
        d = self.distance
        inside = (d > begin) & (d < end)
        cut = np.concatenate([[begin], d[inside], [end]])
        chainage, elevation = cut + self.chainage[0], self.at(cut)
        table = {"chainage": chainage.tolist(), "elevation": elevation.tolist()}
        plan = None if self.plan is None else self.plan_at(cut)
        return Profile(chainage, elevation, table, plan)

    def table(self) -> dict[str, Any]:
        """Profile as a table of a case file."""
        return self.given

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Profile) and self.given == other.given

    __hash__ = None


class ProfileValue(Value):
    """Value of a case file for the points of a pipe axis: chainage and elevation, or x, y and z.

    They are lists, or columns of a CSV file.
    """

    about = "elevation along the axis, linear between points; a straight line between the end nodes if left out"
    takes = "`{ chainage, elevation }` or `{ x, y, z }`, lists in m, or `{ file, sheet }` with these columns"

    def read(self, given: Any, setting: ReadContext) -> Profile:
        if isinstance(given, Profile):
            return given
        if not isinstance(given, dict):
            example = '{ chainage = [0, 900], elevation = [12, 31] }, or { file = "profile.csv" }'
            raise ValueError(f"{show(given)} is not a table; expected for example {example}")
        columns, table = (
            from_file(given, setting) if "file" in given else from_lists(given, setting)
        )
        if len(columns) == 3:
            steps = np.sqrt(sum(np.diff(values) ** 2 for values in columns.values()))
            repeated = np.flatnonzero(steps <= 0.0)
            if repeated.size:
                raise ValueError(
                    f"points {repeated[0] + 1} and {repeated[0] + 2} coincide; expected different points"
                )
            plan = np.column_stack([columns["x"], columns["y"]])
            profile = Profile(np.concatenate([[0.0], np.cumsum(steps)]), columns["z"], table, plan)
        else:
            profile = Profile(columns["chainage"], columns["elevation"], table)
            check_slope(profile)
        return profile

    def json(self) -> dict[str, Any]:
        return {"type": "object"}


def check_slope(profile: Profile) -> None:
    """Raise ValueError where the elevation between two points changes by more than the chainage."""
    lengths, rises = np.diff(profile.chainage), np.abs(np.diff(profile.elevation))
    if (rises > lengths * (1.0 + ROUNDING)).any():
        k = int(np.argmax(rises - lengths))
        text = (
            f"a length of {lengths[k]:g} m from chainage {profile.chainage[k]:g} m is too short to rise or fall by "
            f"{rises[k]:g} m"
        )
        raise ValueError(f"{text}; expected chainages along the axis, not in plan")


def from_lists(
    given: dict[str, Any], setting: ReadContext
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """(columns, table): arrays of the points by key [m], read from lists of equal length, and the same lists in SI.

    setting : context for reading
    Raises ValueError if a list is missing (see `columns_among`), otherwise ValueFault with all faults.
    """
    keys = columns_among(list(given), "keys")
    columns = {}
    faults = [
        ((key,), f"unknown key; expected {' and '.join(keys)}") for key in given if key not in keys
    ]
    for key in keys:
        try:
            columns[key] = Rows("length", rising=key == "chainage").read(given[key], setting)
        except ValueError as error:
            faults += faults_of(error, key)
    if not faults and len({len(values) for values in columns.values()}) > 1:
        counts = ", ".join(f"{len(values)} of {key}" for key, values in columns.items())
        faults.append(((), f"lists have different lengths: {counts}; expected equal lengths"))
    if not faults and len(columns[keys[0]]) < 2:
        faults.append(((), "has one point; expected at least two"))
    if faults:
        raise ValueFault(faults)
    return {key: np.array(values) for key, values in columns.items()}, {
        key: list(values) for key, values in columns.items()
    }


def from_file(
    given: dict[str, Any], setting: ReadContext
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """(columns, table): arrays of the points by key [m], from a table file by its header; table { file, sheet }.

    setting : context for reading. Raises ValueFault with the fault.
    """
    from fvsolve.parts.csv_rows import read_table_file

    path, rows, stated = read_table_file(given, setting)
    try:
        keys = columns_among([name.casefold() for name in rows.names], f"columns of {path.name}")
        names = {name.casefold(): name for name in rows.names}
        columns = {key: rows.numbers(rows.column(names[key], 0), "length") for key in keys}
        if len(columns[keys[0]]) < 2:
            raise ValueError(f"{path.name} has one point; expected at least two")
        if "chainage" in columns:
            check_increasing(
                columns["chainage"].tolist(),
                [f"{value:g}" for value in columns["chainage"]],
                f"{path.name}: chainages",
            )
    except ValueError as error:
        raise ValueFault([(("file",), str(error))]) from None
    return columns, stated


def columns_among(names: list[str], source: str) -> tuple[str, ...]:
    """Names of the columns of a profile that are among `names`: chainage and elevation, or x, y and z.

    Raises ValueError if neither set is complete; source : noun for the message
    """
    for keys in COLUMN_SETS:
        if set(keys) <= set(names):
            return keys
    raise ValueError(
        f"{source} are {show(', '.join(names))}; expected chainage and elevation, or {AXES}"
    )
