"""What an exact solution has to say, whatever it is of: probes over time, fields of pipes. Knows no closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fvsolve.exact.schedule import value

Law = Callable[[np.ndarray], np.ndarray]  # values at times
GAUSS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True)
class ExactStart:
    """What a case starts from: pressures of nodes [Pa] and volume flows of links [m3/s], by name."""

    pressure: dict[str, float]
    flow: dict[str, float]


@dataclass(frozen=True)
class Solution:
    """Laws in time by name: `pressure` of nodes [Pa], `level` [m], `flow` of links [m3/s], bodies; fields of pipes.

    pipe : pipe(name, x, t) -> (pressure [Pa], flow [m3/s]) at places x [m from `from`] and times t, broadcast
    kinks : kinks(name, t) -> places at which the field at time t is not smooth [m]
    """

    case: object
    pressure: dict[str, Law] = field(default_factory=dict)
    level: dict[str, Law] = field(default_factory=dict)
    flow: dict[str, Law] = field(default_factory=dict)
    position: dict[str, Law] = field(default_factory=dict)
    velocity: dict[str, Law] = field(default_factory=dict)
    pipe: Callable | None = None
    kinks: Callable[[str, float], np.ndarray] | None = None

    def probe(self, probe, t: np.ndarray) -> np.ndarray:
        """Values of a probe at times t : float64[k] [SI]; NaN where the solution says nothing of it."""
        t = np.asarray(t, dtype=float)
        name, quantity = probe.name, probe.quantity
        if probe.fraction is not None and self.pipe is not None:
            return self._along(probe, t)
        if quantity == "force" and self.pipe is not None:
            return self._force(self.case.links[name], t)
        laws = getattr(self, quantity if quantity in ("level", "flow", "position", "velocity") else "pressure")
        if name not in laws and quantity in ("pressure", "gauge_pressure", "head"):
            laws = reservoirs(self.case)
        if name not in laws:
            return np.full(t.shape, np.nan)
        found = laws[name](t)
        return self._counted(found, quantity, self.case.elevation(name) if quantity == "head" else 0.0)

    def averages(self, name: str, edges: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Pressure [Pa] and flow [m3/s] averaged between edges [m] of a pipe, by Gauss points between all kinks."""
        inner = self.kinks(name, t) if self.kinks is not None else np.zeros(0)
        cuts = np.unique(np.concatenate([edges, inner[(inner > edges[0]) & (inner < edges[-1])]]))
        return averages(lambda x: self.pipe(name, x, t), edges, cuts)

    def _force(self, pipe, t):
        """Unbalanced force on a pipe without friction [N]: what its ends bear beyond what they do at the start."""
        start = np.array([self.case.numerics.start])
        rise, first = (self.pressure[pipe.to](at) - self.pressure[pipe.from_](at) for at in (t, start))
        return 0.25 * np.pi * pipe.diameter**2 * (rise - first)

    def _along(self, probe, t):
        link = self.case.links[probe.name]
        p, q = self.pipe(probe.name, np.full(t.shape, probe.fraction * link.length), t)
        if probe.quantity in ("flow", "velocity"):
            return q if probe.quantity == "flow" else q / (0.25 * np.pi * link.diameter**2)
        z = [self.case.elevation(end) for end in (link.from_, link.to)]
        here = z[0] + probe.fraction * (z[1] - z[0])
        if link.profile is not None:
            here = float(link.profile.at(probe.fraction * link.length))
        return self._counted(p, probe.quantity, here)

    def _counted(self, pressure, quantity: str, z: float):
        """A pressure as gauge pressure or head; everything else as it is."""
        case = self.case
        if quantity == "gauge_pressure":
            return pressure - case.ambient_pressure
        if quantity == "head":
            return (pressure - case.ambient_pressure) / (case.properties.density * case.gravity) + z
        return pressure


def averages(f: Callable, edges: np.ndarray, cuts: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
    """Averages between edges of all that f(x) returns, by five Gauss points between cuts (the edges among them)."""
    cuts = edges if cuts is None else cuts
    width, middle = np.diff(cuts), 0.5 * (cuts[1:] + cuts[:-1])
    x = middle[:, None] + 0.5 * width[:, None] * GAUSS[0]
    cell = np.clip(np.searchsorted(edges, middle) - 1, 0, len(edges) - 2)
    found = []
    for values in f(x.ravel()):
        parts = np.broadcast_to(values, x.size).reshape(x.shape) @ (0.5 * GAUSS[1]) * width
        found.append(np.bincount(cell, parts, len(edges) - 1) / np.diff(edges))
    return tuple(found)


def reservoirs(case) -> dict[str, Law]:
    """Pressures of the reservoirs of a case [Pa]."""
    weight = case.properties.density * case.gravity

    def law(name, node):
        if node.head is None:
            return lambda t: value(node.pressure, t)
        z = case.elevation(name)
        return lambda t: case.ambient_pressure + weight * (value(node.head, t) - z)

    return {name: law(name, node) for name, node in case.nodes.items() if node.kind == "reservoir"}


def law_holds(case):
    """(keys, message) of a density law that changes."""
    if not case.law.linear:
        yield ("fluid", "law"), f'the exact solution "{case.exact.name}" holds under the law "linear"'


def kinds_only(case, nodes: tuple[str, ...], links: tuple[str, ...]):
    """(keys, message) of parts of other kinds than these."""
    name = case.exact.name
    for group, parts, known in (("nodes", case.nodes, nodes), ("links", case.links, links)):
        for part, one in parts.items():
            if one.kind not in known:
                yield (group, part), f'the exact solution "{name}" knows no {one.kind}; it knows {", ".join(known)}'


def only_one(case, found: list, what: str):
    """A misfit unless there is exactly one of something."""
    if len(found) != 1:
        yield ("exact", "name"), f'"{case.exact.name}" wants exactly one {what}, and here are {len(found)}'


def levels_hold(made: Solution):
    """(keys, message) of tanks that would run dry or spill before the end, where the solution ends too."""
    numerics = made.case.numerics
    t = np.linspace(numerics.start, numerics.end, 2001)
    for name, level in made.level.items():
        low, high = float(np.min(level(t))), float(np.max(level(t)))
        rim = made.case.nodes[name].height
        if low < -1e-9 or (rim is not None and high > rim + 1e-9):
            what = "runs dry" if low < -1e-9 else "spills"
            yield ("nodes", name), f'the exact solution "{made.case.exact.name}" ends where the tank {what}'
