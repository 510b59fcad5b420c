"""A long section as an engineer draws it: arrays along one chainage, in the units of [output]. Draws nothing."""

from __future__ import annotations

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
HEADS = ("elevation", "initial_head", "least_head", "greatest_head")
APART = 0.035  # of the length: names nearer to each other than this would cover each other
HIGH = 2.0  # times what heads and pipe span, how far above them a line is still shown
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

    def cap(self) -> tuple[float, float] | None:
        """Ends of the axis of heads where a line, such as that of a class, lies so far above them that it would flatten
        them; None as a rule."""
        values = np.concatenate([self.along[name] for name in HEADS] + [*self.lines.values()])
        heads = values[: len(HEADS) * len(self.chainage)]
        low, high = float(np.nanmin(heads)), float(np.nanmax(heads))
        far = high + HIGH * max(high - low, 1.0)
        if not any(lowest_of(line) > far for line in self.lines.values()):
            return None
        margin = 0.05 * max(high - low, 1.0)
        return float(np.nanmin(values)) - margin, high + 2.0 * margin

    def told(self, name: str) -> str:
        """A line's name, and from where on it runs if that is above the picture."""
        cap, lowest = self.cap(), lowest_of(self.lines[name])
        return name if cap is None or not lowest > cap[1] else f"{name} (above, from {lowest:.4g})"

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


def lowest_of(line: np.ndarray) -> float:
    """The least value of a line, nan of one that is nowhere."""
    return float(np.nanmin(line)) if np.isfinite(line).any() else np.nan


def section(result, way: SectionWay) -> Section:
    """The section of a way through a run."""
    distances = in_units(result, "distance")
    strung_up = strung(result.envelope, way.legs, distances)
    chainage, pipe = distances.to_si(strung_up["chainage"]), strung_up["pipe"]
    along = {name: strung_up[name] for name in ALONG}
    lines, boils = {}, result.summary["fluid"]["vapor_pressure"]
    if boils is not None:  # at that pressure itself a gas would fill all, so a law with cavities has no head there
        left = 1.0 + NEAR * result.case.law.cavitates
        lines["vapour line"] = head_of(result, boils * left, along["elevation"])
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
