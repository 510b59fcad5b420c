"""Exact waves without friction under the linear density law: ray tracing in networks, and Allievi's recursion.

Every pipe end receives an incoming characteristic `P + Z M` (at `to`) or `P - Z M` (at `from`), with
`Z = a / A`. It equals `2 P_opposite - incoming_opposite` at the opposite end, one travel time earlier.
The recursion in time ends at the uniform start, so values are exact at all times and for all lengths.
`P` is the pressure [Pa] at a common elevation, `M` the mass flow [kg/s].

Allievi's interlocking recursion is for a reservoir, a pipe and a closing valve:
`d_k + d_(k-1) - 2 = 2 A (tau_(k-1) z_(k-1) - tau_k z_k)` at the times `t_k = 2 L k / a`, with
`A = rho a v / (2 dp)` from the velocity v and the drop dp of the valve in the steady start. `tau` is the opening
relative to that start, `d` the drop of the valve relative to dp, and `z |z| = d` (Allievi 1902; Wylie and
Streeter 1993). The recursion is also valid for reverse flow through the valve.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

Schedule = Callable[[float], float]


def held(value: float) -> Schedule:
    """Constant schedule."""
    return lambda t: value


def step(time: float, before: float, after: float) -> Schedule:
    """Schedule that jumps at `time` and is continuous from the right."""
    return lambda t: after if t >= time else before


@dataclass(frozen=True)
class Pipe:
    """Frictionless pipe with its volume flow [m3/s] and pressure [Pa] at the start."""

    start: str
    end: str
    length: float
    diameter: float
    wave_speed: float
    flow: float = 0.0
    pressure: float = 0.0

    @property
    def travel_time(self) -> float:
        return self.length / self.wave_speed

    @property
    def impedance(self) -> float:
        return self.wave_speed / (math.pi / 4 * self.diameter**2)


@dataclass
class Rays:
    """Network of pipes, fixed pressures, demands and orifices to a fixed pressure."""

    density: float
    pipes: dict[str, Pipe]
    reservoirs: dict[str, Schedule] = field(default_factory=dict)
    demands: dict[str, Schedule] = field(default_factory=dict)
    # flow area Cd A [m2], pressure
    outlets: dict[str, tuple[Schedule, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._known: dict[tuple, float] = {}

    def pressure(self, node: str, t: float) -> float:
        """Pressure of a node at time t [Pa]."""
        if node in self.reservoirs:
            return self.reservoirs[node](t)
        key = (node, round(t, 11))
        if key not in self._known:
            self._known[key] = self._closed_node(node, t)
        return self._known[key]

    def inside(self, pipe: str, fraction: float, t: float) -> tuple[float, float]:
        """Pressure [Pa] and volume flow [m3/s] in a pipe at a fraction of its length from its start."""
        p = self.pipes[pipe]
        forward = self._sent(pipe, "start", t - fraction * p.travel_time)
        backward = self._sent(pipe, "end", t - (1 - fraction) * p.travel_time)
        return (forward + backward) / 2, (forward - backward) / (2 * p.impedance * self.density)

    def _closed_node(self, node: str, t: float) -> float:
        ends = [
            (n, e) for n, p in self.pipes.items() for e in ("start", "end") if getattr(p, e) == node
        ]
        admittance = sum(1 / self.pipes[n].impedance for n, _ in ends)
        brought = sum(self._incoming(n, e, t) / self.pipes[n].impedance for n, e in ends)
        brought -= self.density * self.demands.get(node, held(0.0))(t)
        if node not in self.outlets:
            return brought / admittance
        area, outside = self.outlets[node][0](t), self.outlets[node][1]
        closed = brought / admittance - outside  # drop over a closed orifice
        b = area * math.sqrt(2 * self.density) / admittance
        root = (-b + math.sqrt(b * b + 4 * abs(closed))) / 2  # sqrt of the drop
        return outside + math.copysign(root * root, closed)

    def _incoming(self, pipe: str, end: str, t: float) -> float:
        other = "start" if end == "end" else "end"
        return self._sent(pipe, other, t - self.pipes[pipe].travel_time)

    def _sent(self, pipe: str, end: str, t: float) -> float:
        """Characteristic that enters a pipe from an end at time t; before t = 0 that of the uniform start."""
        p = self.pipes[pipe]
        if t < 0:
            sign = 1 if end == "start" else -1
            return p.pressure + sign * p.impedance * self.density * p.flow
        key = (pipe, end, round(t, 11))
        if key not in self._known:
            self._known[key] = 2 * self.pressure(getattr(p, end), t) - self._incoming(pipe, end, t)
        return self._known[key]


def relative_drop(parameter: float, opening: Sequence[float]) -> list[float]:
    """Drop of the valve at `t = 2 L k / a` over that at the start, for relative openings at these times."""
    z, drops = 1.0, [1.0]
    for before, now in zip(opening[:-1], opening[1:], strict=True):
        known = 2 + 2 * parameter * before * z - drops[-1]
        size = -parameter * now + math.sqrt((parameter * now) ** 2 + abs(known))
        z = math.copysign(size, known)
        drops.append(z * abs(z))
    return drops
