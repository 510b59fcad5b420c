"""The line of a pipe over its chainage. Knows points; knows no fluid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.parts.csv_rows import read_rows
from fvsolve.parts.series import copy_name, find_file
from fvsolve.parts.value import Misfit, Rows, Setting, Value, check_rising
from fvsolve.units import show

FORMS = (("chainage", "elevation"), ("x", "y", "z"))
AXES = "x, y, z"


@dataclass(frozen=True, eq=False)
class Profile:
    """Elevation over chainage, straight between its points.

    chainage : float64[n]  counted along the axis, rising [m]; elevation : float64[n]  of the axis above datum [m];
    plan : float64[n, 2]  x and y, of one that has them [m]; said : as the file has it, in SI
    """

    chainage: np.ndarray
    elevation: np.ndarray
    said: dict[str, Any]
    plan: np.ndarray | None = None

    @property
    def length(self) -> float:
        """Along its axis [m]."""
        return float(self.chainage[-1] - self.chainage[0])

    @property
    def distance(self) -> np.ndarray:
        """Of its points from its begin [m] : float64[n]."""
        return self.chainage - self.chainage[0]

    def at(self, distance: Any) -> Any:
        """Elevation at distances from its begin [m]."""
        return np.interp(distance, self.distance, self.elevation)

    def seen(self, distance: np.ndarray) -> np.ndarray:
        """x and y at distances from its begin : float64[m, 2] [m]."""
        return np.column_stack([np.interp(distance, self.distance, one) for one in self.plan.T])

    def part(self, begin: float, end: float) -> Profile:
        """The profile between two distances from its begin [m], in the same chainage."""
        d = self.distance
        inside = (d > begin) & (d < end)
        cut = np.concatenate([[begin], d[inside], [end]])
        chainage, elevation = cut + self.chainage[0], self.at(cut)
        said = {"chainage": chainage.tolist(), "elevation": elevation.tolist()}
        return Profile(chainage, elevation, said, None if self.plan is None else self.seen(cut))

    def table(self) -> dict[str, Any]:
        """What the file would say."""
        return self.said

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Profile) and self.said == other.said

    __hash__ = None


class ProfileValue(Value):
    """Points of a pipe's axis: chainage and elevation, or x, y and z, as lists or columns of a CSV file."""

    about = "elevation along it, straight between points; straight from end to end if left out"
    takes = "`{ chainage, elevation }` or `{ x, y, z }`, lists of m, or `{ file }` with such columns"

    def read(self, given: Any, setting: Setting) -> Profile:
        if isinstance(given, Profile):
            return given
        if not isinstance(given, dict):
            wanted = '{ chainage = [0, 900], elevation = [12, 31] }, or { file = "profile.csv" }'
            raise ValueError(f"{show(given)} is no table; wanted one such as {wanted}")
        columns, said = from_file(given, setting) if "file" in given else from_lists(given, setting)
        if len(columns) == 3:
            steps = np.sqrt(sum(np.diff(one) ** 2 for one in columns.values()))
            still = np.flatnonzero(steps <= 0.0)
            if still.size:
                raise ValueError(
                    f"points {still[0] + 1} and {still[0] + 2} are one; wanted a way from each to the next"
                )
            plan = np.column_stack([columns["x"], columns["y"]])
            found = Profile(np.concatenate([[0.0], np.cumsum(steps)]), columns["z"], said, plan)
        else:
            found = Profile(columns["chainage"], columns["elevation"], said)
            steep(found)
        return found

    def json(self) -> dict[str, Any]:
        return {"type": "object"}


def steep(profile: Profile) -> None:
    """ValueError where a way rises more than it is long."""
    ways, rises = np.diff(profile.chainage), np.abs(np.diff(profile.elevation))
    if (rises > ways * (1.0 + 1e-9)).any():
        k = int(np.argmax(rises - ways))
        text = f"{ways[k]:g} m from chainage {profile.chainage[k]:g} m are too short to rise or fall by {rises[k]:g} m"
        raise ValueError(f"{text}; chainage counts along the axis")


def from_lists(given: dict[str, Any], setting: Setting) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Columns [m] of lists, as many values in each."""
    keys = form_of(list(given), "keys")
    found, faults = {}, [((key,), f"unknown key; wanted {' and '.join(keys)}") for key in given if key not in keys]
    for key in keys:
        try:
            found[key] = Rows("length", rising=key == "chainage").read(given[key], setting)
        except Misfit as error:
            faults += [((key, *below), text) for below, text in error.faults]
        except ValueError as error:
            faults.append(((key,), str(error)))
    if not faults and len({len(one) for one in found.values()}) > 1:
        counts = ", ".join(f"{len(one)} of {key}" for key, one in found.items())
        faults.append(((), f"values are not as many in each list: {counts}"))
    if not faults and len(found[keys[0]]) < 2:
        faults.append(((), "has one point; wanted two at least"))
    if faults:
        raise Misfit(faults)
    return {key: np.array(one) for key, one in found.items()}, {key: list(one) for key, one in found.items()}


def from_file(given: dict[str, Any], setting: Setting) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Columns [m] of a CSV file, by their headers."""
    unknown = [((key,), "unknown key; beside file there is none") for key in given if key != "file"]
    if unknown:
        raise Misfit(unknown)
    if not isinstance(given["file"], str):
        raise Misfit([(("file",), f"{show(given['file'])} is no text")])
    try:
        path = find_file(given["file"], setting)
        rows = read_rows(path)
        keys = form_of([name.casefold() for name in rows.names], f"columns of {path.name}")
        names = {name.casefold(): name for name in rows.names}
        found = {key: rows.numbers(rows.column(names[key], 0), "length") for key in keys}
        if len(found[keys[0]]) < 2:
            raise ValueError(f"{path.name} has one point; wanted two at least")
        if "chainage" in found:
            check_rising(found["chainage"].tolist(), [f"{one:g}" for one in found["chainage"]],
                         f"{path.name}: chainages")  # fmt: skip
    except ValueError as error:
        raise Misfit([(("file",), str(error))]) from None
    return found, {"file": copy_name(path, setting)}


def form_of(names: list[str], what: str) -> tuple[str, ...]:
    """Which of the two forms the names make; ValueError where neither."""
    for keys in FORMS:
        if set(keys) <= set(names):
            return keys
    raise ValueError(f"{what} are {', '.join(names) or 'none'}; wanted chainage and elevation, or {AXES}")
