"""A long section as an engineer draws it: arrays along one chainage, in the units of [output]. Draws nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fvsolve.output.column import UnitColumn
from fvsolve.report.legs import Way

ALONG = ("elevation", "initial_head", "least_head", "greatest_head", "least_pressure", "greatest_pressure",
         "t_least", "t_greatest")  # fmt: skip
APART = 0.035  # of the length: names nearer to each other than this would cover each other
BINS = 250  # of a long line: of each the greatest and the least head stand, and where


class Device(NamedTuple):
    """What stands at a place of a section."""

    chainage: float
    place: str
    parts: tuple[str, ...]  # "pump (pump)"


@dataclass(frozen=True)
class Section:
    """One way with what was met along it.

    chainage : float64[n] [m]; along : quantity -> float64[n]; vapour, allowed : head at which liquid boils, and that
    the class allows, or None; parted : spans of chainage where the vapour pressure was reached
    """

    way: Way
    chainage: np.ndarray
    along: dict[str, np.ndarray]
    vapour: np.ndarray | None
    allowed: np.ndarray | None
    parted: list[tuple[float, float]]
    devices: list[Device]

    @property
    def picked(self) -> np.ndarray:
        """Numbers of the points to be drawn: all, or of a long line the extremes of each bin."""
        n = len(self.chainage)
        if n <= 2 * BINS:
            return np.arange(n)
        edges = np.linspace(0, n, BINS + 1).astype(int)
        lines = [(self.along["greatest_head"], np.argmax), (self.along["least_head"], np.argmin)]
        kept = [a + most(line[a:b]) for line, most in lines for a, b in zip(edges[:-1], edges[1:], strict=True)]
        return np.unique([0, *kept, n - 1])

    def labels(self) -> list[tuple[float, str, bool]]:
        """Chainages with names, and whether more than a joint stands there; none would cover another.

        Devices and ends go before joints; devices that are near share a label.
        """
        length = self.way.places[-1][1]
        order = sorted(self.devices, key=lambda device: (not device.parts, device.chainage not in (0.0, length)))
        shown: list[tuple[float, list[str], bool]] = []
        for device in order:
            names = [part.rpartition(" (")[0] for part in device.parts] or [device.place]
            near = [one for one in shown if abs(device.chainage - one[0]) < APART * length]
            if not near:
                shown.append((device.chainage, names, bool(device.parts)))
            elif device.parts:
                near[0][1].extend(names)
        return [(chainage, ", ".join(names), stands) for chainage, names, stands in shown]


def section(result, way: Way) -> Section:
    """The section of a way through a run."""
    pieces: dict[str, list] = {name: [] for name in ("chainage", *ALONG, "width")}
    for leg in way.legs:
        arrays = result.envelope[leg.pipe]
        order = slice(None, None, -1 if leg.backwards else 1)
        x = arrays["distance"][order]
        pieces["chainage"].append(leg.begins + (leg.length - x if leg.backwards else x))
        pieces["width"].append(np.full(len(x), leg.length / len(x)))
        for name in ALONG:
            pieces[name].append(arrays[name][order])
    joined = {name: np.concatenate(found) for name, found in pieces.items()}
    chainage, width = joined.pop("chainage"), joined.pop("width")
    along = {name: joined[name] for name in ALONG}
    boils = result.summary["fluid"]["vapor_pressure"]
    vapour = None if boils is None else _head(result, boils, along["elevation"])
    return Section(way, chainage, along, vapour, _allowed(result, way, along["elevation"]),
                   _parted(result, along["least_pressure"], chainage, width), _devices(result, way))  # fmt: skip


def in_units(result, name: str) -> UnitColumn:
    """The column of a quantity of the envelope."""
    from fvsolve.output.envelope import QUANTITIES

    unit, ambient = result.summary["envelope_units"][name], result.summary["ambient_pressure"]
    return UnitColumn(name, QUANTITIES[name], unit, ambient)


def boiling(result) -> float | None:
    """The pressure [Pa] at which a pipe counts as parted: the vapour pressure, twice it where cavities are followed."""
    boils = result.summary["fluid"]["vapor_pressure"]
    return None if boils is None else boils * (2.0 if result.case.law.cavitates else 1.0)


def _head(result, pressure: float | np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """The head of a pressure [Pa] at elevations, both in the unit of heads."""
    height = in_units(result, "elevation")
    law: Callable[..., Any] = result.case.law.head
    return in_units(result, "greatest_head").from_si(law(pressure, height.to_si(elevation)))


def _allowed(result, way: Way, elevation: np.ndarray) -> np.ndarray | None:
    """The head of the pressure that the class of each pipe allows; None where no pipe of the way has one."""
    pipes = [result.case.links[leg.pipe] for leg in way.legs]
    allowed = [getattr(pipe, "allowable_pressure", None) for pipe in pipes]
    if all(one is None for one in allowed):
        return None
    counts = [len(result.envelope[leg.pipe]["distance"]) for leg in way.legs]
    return _head(result, np.repeat([np.nan if one is None else one for one in allowed], counts), elevation)


def _parted(result, least, chainage, width) -> list[tuple[float, float]]:
    """Spans of cells whose pressure fell to that of vapour."""
    limit = boiling(result)
    if limit is None:
        return []
    low = in_units(result, "least_pressure").to_si(least) <= limit * (1.0 + 1e-9)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low.astype(int), [0]])))
    return [(float(chainage[a] - 0.5 * width[a]), float(chainage[b - 1] + 0.5 * width[b - 1]))
            for a, b in zip(edges[::2], edges[1::2], strict=True)]  # fmt: skip


def _devices(result, way: Way) -> list[Device]:
    """What stands at the places of a way: nodes that are more than joints, and links that are no pipes."""
    case, found = result.case, []
    for place, chainage in way.places:
        owner = place.partition(".")[0]
        kind = case.nodes[place].kind if place in case.nodes else case.nodes[owner].kind if owner in case.nodes else ""
        parts = [] if kind in ("junction", "") else [f"{place} ({kind})"]
        parts += [f"{name} ({link.kind})" for name, link in case.links.items()
                  if link.kind != "pipe" and place in link.ports.values()]  # fmt: skip
        found.append(Device(chainage, place, tuple(parts)))
    return found
