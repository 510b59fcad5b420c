"""Exact solution as values of probes over time and fields of pipes; faults of cases without such a solution.

Values of schedules are computed independently of the compiled functions, so that tests can compare both.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fvsolve.errors import article

Law = Callable[[np.ndarray], np.ndarray]  # values at times
PLACES, WEIGHTS = np.polynomial.legendre.leggauss(5)  # Gauss points on -1 to 1, see `averages`


class Exact(NamedTuple):
    """Exact solution: its name in a case file, types of nodes and links that it supports, and two functions.

    `NAME = Exact("name", ...)` is a header, which fvsolve.exact finds in the text of its module.
    find_faults(case) yields a fault (keys, message) for each difference of a case from those that it covers
    solution(case, start) computes the `Solution` of a case for which `find_faults` yields nothing
    """

    name: str
    nodes: tuple[str, ...]
    links: tuple[str, ...]
    find_faults: Callable
    solution: Callable


@dataclass(frozen=True)
class ExactStart:
    """State at the start of a case: pressures of nodes [Pa] and volume flows of links [m3/s], by name."""

    pressure: dict[str, float]
    flow: dict[str, float]


@dataclass(frozen=True)
class Solution:
    """Exact solution of a case: functions of time [s] by the name of a part, and fields of pipes.

    pressure : of nodes [Pa]; level : of tanks [m]; flow : of links [m3/s]; position, velocity : of masses [m], [m/s]
    pipe : pipe(name, x, t) -> (pressure [Pa], flow [m3/s]) at distances x from the `from` end [m] and times t; x and t
    are broadcast
    kinks : kinks(name, t) -> distances from the `from` end [m] at which the field of a pipe at time t is not smooth
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
        """Values of a probe at times t : float64[k], in SI units; NaN if the solution does not include the probe."""
        t = np.asarray(t, dtype=float)
        name, quantity = probe.name, probe.quantity
        if probe.fraction is not None and self.pipe is not None:
            return self._along(probe, t)
        if quantity == "force" and self.pipe is not None:
            return self._force(self.case.links[name], t)
        laws = getattr(
            self, quantity if quantity in ("level", "flow", "position", "velocity") else "pressure"
        )
        if name not in laws and quantity in ("pressure", "gauge_pressure", "head"):
            laws = reservoirs(self.case)
        if name not in laws:
            return np.full(t.shape, np.nan)
        values = laws[name](t)
        return self._converted(
            values, quantity, self.case.elevation(name) if quantity == "head" else 0.0
        )

    def averages(self, name: str, edges: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Averages of pressure [Pa] and flow [m3/s] over the cells of a pipe between `edges` [m] at time t.

        They are computed by Gauss points between kinks. name : of the pipe
        """
        inner = self.kinks(name, t) if self.kinks is not None else np.zeros(0)
        cuts = np.unique(np.concatenate([edges, inner[(inner > edges[0]) & (inner < edges[-1])]]))
        return averages(lambda x: self.pipe(name, x, t), edges, cuts)

    def _force(self, pipe, t):
        """Unbalanced axial force on a frictionless pipe [N]: area times change of p(to) - p(from) since the start."""
        start = np.array([self.case.numerics.start])
        rise, first = (
            self.pressure[pipe.to](at) - self.pressure[pipe.from_](at) for at in (t, start)
        )
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
        return self._converted(p, probe.quantity, here)

    def _converted(self, pressure, quantity: str, z: float):
        """Convert a pressure [Pa] at elevation z [m] to gauge pressure [Pa] or head [m], as `quantity` requests.

        For any other quantity the given values are returned unchanged.
        """
        case = self.case
        if quantity == "gauge_pressure":
            return pressure - case.ambient_pressure
        if quantity == "head":
            return (pressure - case.ambient_pressure) / (case.properties.density * case.gravity) + z
        return pressure


def averages(
    f: Callable, edges: np.ndarray, cuts: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Averages over each interval of `edges` of the quantities whose values f(x) returns : tuple of float64[intervals].

    They are computed with five Gauss points between `cuts`.
    cuts : positions where f is not smooth, including the edges; None for the edges alone
    """
    cuts = edges if cuts is None else cuts
    width, middle = np.diff(cuts), 0.5 * (cuts[1:] + cuts[:-1])
    x = middle[:, None] + 0.5 * width[:, None] * PLACES
    cell = np.clip(np.searchsorted(edges, middle) - 1, 0, len(edges) - 2)
    result = []
    for values in f(x.ravel()):
        parts = np.broadcast_to(values, x.size).reshape(x.shape) @ (0.5 * WEIGHTS) * width
        result.append(np.bincount(cell, parts, len(edges) - 1) / np.diff(edges))
    return tuple(result)


def reservoirs(case) -> dict[str, Law]:
    """Pressures of the reservoirs of a case [Pa] : name -> function of time."""
    weight = case.properties.density * case.gravity

    def law(name, node):
        if node.head is None:
            return lambda t: value(node.pressure, t)
        z = case.elevation(name)
        return lambda t: case.ambient_pressure + weight * (value(node.head, t) - z)

    return {name: law(name, node) for name, node in case.nodes.items() if node.kind == "reservoir"}


def value(schedule, t: np.ndarray, left: bool = False) -> np.ndarray:
    """Values of a schedule at times t in SI units; at jumps the right limit, or the left limit if `left` is True."""
    t = np.asarray(t, dtype=float)
    times, values = schedule.time, schedule.value
    if schedule.kind == "constant":
        return np.full(t.shape, values[0])
    if schedule.kind == "step":
        side = "left" if left else "right"
        return values[np.clip(np.searchsorted(times, t, side=side) - 1, 0, len(times) - 1)]
    if schedule.kind == "harmonic":
        mean, amplitude, period, phase = schedule.wave
        return mean + amplitude * np.sin(2.0 * np.pi * t / period + phase)
    if schedule.kind == "formula":
        found = [
            schedule.program.value(time, time if left else np.inf) for time in t.ravel().tolist()
        ]
        return np.array(found).reshape(t.shape)
    if schedule.kind == "control":
        return np.full(t.shape, np.nan)  # known only in a run
    inside = np.clip(t, times[0], times[-1])
    if schedule.kind == "ramp":
        s = (inside - times[0]) / (times[1] - times[0])
        return values[1] + (values[0] - values[1]) * (1.0 - s) ** schedule.exponent
    if schedule.kind == "linear":
        return np.interp(inside, times, values)
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(times, values)(inside)


def kinks(schedule) -> list[float]:
    """Times at which a schedule or its slope jumps; for a smooth schedule only its two ends."""
    if schedule.kind in ("constant", "harmonic"):
        return []
    if schedule.kind == "formula":
        return schedule.program.break_times
    return [
        float(t) for t in (schedule.time[[0, -1]] if schedule.kind == "smooth" else schedule.time)
    ]


def constant_from(schedule, t: float) -> bool:
    """True if a schedule is constant from time t on."""
    later = schedule.time > t
    return (
        schedule.constant
        or not np.any(later)
        or bool(np.all(schedule.value[later] == value(schedule, t)))
    )


def fault(case, keys: tuple, text: str) -> tuple[tuple, str]:
    """Fault (keys, message) of a case; the message is the name of its exact solution and `text`, a predicate."""
    return keys, f'the exact solution "{case.exact.name}" {text}'


def law_faults(case):
    """Yield a fault (keys, message) if the density law of a case is not `linear`."""
    if not case.law.linear:
        yield fault(case, ("fluid", "law"), 'holds only with the law "linear"')


def type_faults(case, nodes: tuple[str, ...], links: tuple[str, ...]):
    """Yield a fault (keys, message) for each node and link of a type that an exact solution does not support.

    nodes, links : types that it supports
    """
    for group, parts, known in (("nodes", case.nodes, nodes), ("links", case.links, links)):
        for part, item in parts.items():
            if item.kind not in known:
                text = f"does not support {article(item.kind)}; it supports {', '.join(known)}"
                yield fault(case, (group, part), text)


def count_faults(case, items: list, noun: str):
    """Yield a fault (keys, message) if `items`, parts of a case, does not have exactly one entry.

    noun : name of such a part in the message
    """
    if len(items) != 1:
        yield (
            ("exact", "name"),
            f'"{case.exact.name}" needs exactly one {noun}; the case has {len(items)}',
        )


def valve_faults(case, name: str):
    """Yield a fault (keys, message) if a valve or orifice of a case has a law other than the turbulent one."""
    part = case.links[name]
    if part.characteristic != "linear":
        yield fault(
            case, ("links", name, "characteristic"), 'supports only characteristic = "linear"'
        )
    if part.laminar_reynolds is not None:
        yield fault(
            case, ("links", name, "laminar_reynolds"), "supports no laminar flow; remove this key"
        )


def level_faults(exact: Solution):
    """Yield a fault (keys, message) for each tank that runs dry or overflows before the end of the run.

    After that time the solution is not valid.
    """
    numerics = exact.case.numerics
    t = np.linspace(numerics.start, numerics.end, 2001)
    for name, level in exact.level.items():
        low, high = float(np.min(level(t))), float(np.max(level(t)))
        rim = exact.case.nodes[name].height
        if low < -1e-9 or (rim is not None and high > rim + 1e-9):
            event = "runs dry" if low < -1e-9 else "overflows"
            text = f"is not valid after the tank {event}; expected an earlier end of the run"
            yield fault(exact.case, ("nodes", name), text)
