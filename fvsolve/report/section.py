"""A long section as an engineer draws it: arrays along one chainage, in the units of [output]. Draws nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fvsolve.case.extent import OF_PRESSURE
from fvsolve.output.routes import strung
from fvsolve.report.heads import head_of, in_units
from fvsolve.report.legs import SectionWay
from fvsolve.report.limits import limit_lines
from fvsolve.run.result import FAILS
from fvsolve.run.verdicts import NEAR, Chainages

ALONG = ("elevation", "initial_head", "least_head", "greatest_head", "least_pressure", "greatest_pressure",
         "t_least", "t_greatest")  # fmt: skip
HEADS = ("initial_head", "least_head", "greatest_head")
VAPOUR = "vapour line"
APART = 0.035  # of the length: names nearer to each other than this would cover each other
NEAREST = 0.5  # of the range of heads: limits further away than this are named at the edge of a picture
EDGE, NAME = 0.05, 0.07  # of the axis of heads: free at its ends, and for each limit that is named there
BINS = 150  # of a long line at most: of each the greatest and the least head and elevation stand, and where


class Standing(NamedTuple):
    """What stands at a place of a section."""

    chainage: float
    place: str
    parts: tuple[str, ...]  # "pump (pump)"


@dataclass(frozen=True)
class Section:
    """One way with what was met along it.

    chainage : float64[n]; pipe : str[n]; along : quantity -> float64[n]; lines : name -> float64[n], heads at which
    liquid boils, that a class allows, that limits state, nan where there is none; ends : chainages of both ends;
    parted : spans of chainage where the vapour pressure was reached; beyond : (chainage, head, name) of what passes a
    limit
    """

    way: SectionWay
    chainage: np.ndarray
    pipe: np.ndarray
    along: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    ends: tuple[float, float]
    parted: list[tuple[float, float]]
    beyond: list[tuple[float, float, str]]
    devices: list[Standing]

    def picked(self, bins: int = BINS) -> np.ndarray:
        """Numbers of the points to be drawn: all, or of a long line the extremes of each bin."""
        n = len(self.chainage)
        if n <= 4 * bins:
            return np.arange(n)
        edges = np.linspace(0, n, bins + 1).astype(int)
        most = [
            ("greatest_head", np.argmax),
            ("least_head", np.argmin),
            ("elevation", np.argmax),
            ("elevation", np.argmin),
        ]
        lines = [(self.along[name], end) for name, end in most]
        kept = [a + end(line[a:b]) for line, end in lines for a, b in zip(edges[:-1], edges[1:], strict=True)]
        return np.unique([0, *kept, n - 1])

    def labels(self) -> list[tuple[float, str, bool]]:
        """Chainages with names, and whether more than a joint stands there; none would cover another.

        Devices and ends go before joints; devices that are near share a label.
        """
        length = self.ends[1] - self.ends[0]
        order = sorted(self.devices, key=lambda device: (not device.parts, device.chainage not in self.ends))
        shown: list[tuple[float, list[str], bool]] = []
        for device in order:
            names = [part.rpartition(" (")[0] for part in device.parts] or [device.place]
            near = [one for one in shown if abs(device.chainage - one[0]) < APART * length]
            if not near:
                shown.append((device.chainage, names, bool(device.parts)))
            elif device.parts:
                near[0][1].extend(name for name in names if name not in near[0][1])
        return [(chainage, ", ".join(names), stands) for chainage, names, stands in shown]


class Window(NamedTuple):
    """Ends of the axis of heads, and the limits that lie beyond each, with where they begin."""

    low: float
    high: float
    above: list[str]
    below: list[str]


def window(sections: Sequence[Section], unit: str) -> Window:
    """What a picture of sections shows: heads, profile and vapour line, and limits that are near, so that a class far
    away flattens nothing."""
    heads = ends_of([one.along[name] for one in sections for name in HEADS]) or (0.0, 1.0)
    shown = [one.along["elevation"] for one in sections]
    shown += [line for one in sections for name, line in one.lines.items() if name == VAPOUR]
    followed = ends_of([*map(np.array, heads), *shown]) or heads
    reach, (low, high), above, below = NEAREST * (heads[1] - heads[0]), followed, [], []
    for name in dict.fromkeys(name for one in sections for name in one.lines if name != VAPOUR):
        line = ends_of([one.lines[name] for one in sections if name in one.lines])
        if line and line[0] > followed[1] + reach:
            above.append(f"{name}: from {line[0]:.4g} {unit}")
        elif line and line[1] < followed[0] - reach:
            below.append(f"{name}: from {line[1]:.4g} {unit}")
        elif line:
            low = min(low, max(line[0], followed[0] - reach))
            high = max(high, min(line[1], followed[1] + reach))
    span = high - low or 1.0
    return Window(low - (EDGE + NAME * len(below)) * span, high + (EDGE + NAME * len(above)) * span, above, below)


def ends_of(lines: list[np.ndarray]) -> tuple[float, float] | None:
    """Least and greatest of all values; None of lines that are nowhere."""
    values = np.concatenate([np.ravel(line) for line in lines] or [np.empty(0)])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else None


def section(result, way: SectionWay) -> Section:
    """The section of a way through a run."""
    distances = in_units(result, "distance")
    strung_up = strung(result.envelope, way.legs, distances)
    chainage, pipe = distances.to_si(strung_up["chainage"]), strung_up["pipe"]
    along = {name: strung_up[name] for name in ALONG}
    lines, boils = {}, result.summary["fluid"]["vapor_pressure"]
    if boils is not None:  # at that pressure itself a gas would fill all, so a law with cavities has no head there
        left = 1.0 + NEAR * result.case.law.cavitates
        lines[VAPOUR] = head_of(result, boils * left, along["elevation"])
    lines |= limit_lines(result, pipe, along["elevation"])
    parted = _parted(result, along["least_pressure"], chainage, way)
    beyond = _beyond(result, way, chainage, along)
    told = distances.from_si
    return Section(
        way, strung_up["chainage"], pipe, along, lines, (float(told(way.begin)), float(told(way.end))),
        [(float(told(a)), float(told(b))) for a, b in parted],
        [(float(told(at)), head, name) for at, head, name in beyond],
        [one._replace(chainage=float(told(one.chainage))) for one in _devices(result, way)],
    )  # fmt: skip


def boiling(result) -> float | None:
    """The pressure [Pa] at which a pipe counts as parted: the vapour pressure, twice it where cavities are followed."""
    return None if result.summary["fluid"]["vapor_pressure"] is None else result.case.law.cavity_pressure


def _parted(result, least: np.ndarray, chainage: np.ndarray, way: SectionWay) -> list[tuple[float, float]]:
    """Spans of chainage [m] about places whose pressure fell to that of vapour."""
    limit = boiling(result)
    if limit is None:
        return []
    low = in_units(result, "least_pressure").to_si(least) <= limit * (1.0 + 1e-9)
    middles = np.concatenate([[way.begin], 0.5 * (chainage[1:] + chainage[:-1]), [way.end]])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low.astype(int), [0]])))
    return [(float(middles[a]), float(middles[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _beyond(result, way: SectionWay, chainage: np.ndarray, along: dict) -> list[tuple[float, float, str]]:
    """Places of a way where a limit on pressure or head is passed: chainage [m], head there, name of the limit."""
    found, told = [], Chainages(result.case)
    for one in result.summary["verdicts"]:
        limit = result.case.limits.get(one["name"])
        on = limit.extent.on if limit is not None else ()
        for worst in one["worst"] if one["quantity"] in OF_PRESSURE else []:
            leg = next((leg for leg in way.legs if leg.pipe == worst["place"]), None)
            if leg is None or worst["state"] != FAILS:
                continue
            at = float(leg.chainage(told.leg(leg.pipe, on).distance(worst["chainage"])))
            if leg.begin <= at <= leg.end:
                line = along["least_head" if worst["bound"] == "least" else "greatest_head"]
                found.append((at, float(line[np.argmin(np.abs(chainage - at))]), one["name"]))
    return found


def _devices(result, way: SectionWay) -> list[Standing]:
    """What stands at the places of a way, chainages in m: nodes that are more than joints, and links but pipes."""
    case, found = result.case, []
    for place, chainage in way.places:
        owner = place.partition(".")[0]
        kind = case.nodes[place].kind if place in case.nodes else case.nodes[owner].kind if owner in case.nodes else ""
        parts = [] if kind in ("junction", "") else [f"{place} ({kind})"]
        parts += [f"{name} ({link.kind})" for name, link in case.links.items()
                  if link.kind != "pipe" and place in link.ports.values()]  # fmt: skip
        found.append(Standing(chainage, place, tuple(parts)))
    return found
