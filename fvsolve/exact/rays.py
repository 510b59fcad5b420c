"""Exact waves in frictionless pipes by ray tracing. Knows the linear law, reservoirs, junctions and valves.

Each pipe end brings its node an incoming characteristic, P + Z M at `to`, P - Z M at `from` (P = p + rho g z,
Z = a / A, M the mass flow); it is what the other end sent out one travel time before, 2 P - incoming. Backwards from
times t all that matters happened at t - s, s a sum of travel times; these paths are one finite list, gone through once
for all times together (d'Alembert; with one pipe and a valve, Allievi 1902).
"""

from __future__ import annotations

import numpy as np

from fvsolve.exact.schedule import kinks, value
from fvsolve.exact.solution import ExactStart, Solution, reservoirs

NODES, LINKS = ("reservoir", "junction", "inflow"), ("pipe", "valve", "orifice")
MOST_PATHS = 20000
BLOCK = 400_000  # values traced at once, times and sums of travel times together
MERGE = 1e-11  # sums of travel times that lie closer are one, relative to the run


def misfits(case):
    """What makes a case none of plain waves."""
    valves: dict[str, list[str]] = {}
    for name, link in case.links.items():
        if link.kind == "pipe":
            if link.friction.model != "none":
                yield ("links", name, "friction"), 'the exact solution "rays" holds without friction; wanted "none"'
            if link.yielding:
                yield ("links", name, "wall", "creep"), 'the exact solution "rays" holds for walls that do not creep'
            if link.minor_loss != 0.0:
                yield ("links", name, "minor_loss"), 'the exact solution "rays" holds without losses; wanted 0'
        else:
            if link.characteristic != "linear":
                yield ("links", name, "characteristic"), 'the exact solution "rays" knows "linear" alone'
            if link.laminar_reynolds is not None:
                yield ("links", name, "laminar_reynolds"), 'the exact solution "rays" knows the turbulent law alone'
            for end in (link.from_, link.to):
                valves.setdefault(end, []).append(name)
    for node, found in valves.items():
        if case.nodes[node].kind != "reservoir" and len(found) > 1:
            yield ("links", found[1]), f'the exact solution "rays" knows one valve at {node}, and here are {len(found)}'
    piped = {end for link in case.links.values() if link.kind == "pipe" for end in (link.from_, link.to)}
    for node in valves:
        if case.nodes[node].kind in ("junction", "inflow") and node not in piped:
            yield ("nodes", node), 'the exact solution "rays" wants a pipe at every junction'


def solution(case, start: ExactStart) -> Solution:
    """Pressures, flows and fields of a case that `misfits` finds nothing in."""
    rays = Rays(case, start)
    nodes = {name: (lambda t, n=name: rays.pressure(n, t)) for name in case.nodes}
    valves = {name: (lambda t, n=name: rays.valve_flow(n, t)) for name in rays.valves}
    return Solution(case, pressure=nodes, flow=valves, pipe=rays.inside, kinks=rays.kinks)


class Rays:
    """The pipes of a case with what their nodes do to waves; nodes that a valve joins are one group."""

    def __init__(self, case, start: ExactStart) -> None:
        self.case, self.rho, self.t0 = case, case.properties.density, case.numerics.start
        self.weight = self.rho * case.gravity
        self.z = {name: case.elevation(name) for name in case.nodes}
        self.pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
        self.valves = {name: link for name, link in case.links.items() if link.kind in ("valve", "orifice")}
        self.speed = {name: case.wave_speed(name) for name in self.pipes}
        self.travel = {name: link.length / self.speed[name] for name, link in self.pipes.items()}
        self.impedance = {k: self.speed[k] / (0.25 * np.pi * link.diameter**2) for k, link in self.pipes.items()}
        self.start, self.reservoirs = start, reservoirs(case)
        self.span = case.numerics.end - self.t0
        self.near = MERGE * self.span
        self.group = {name: name for name in case.nodes}
        for valve in self.valves.values():
            old, new = self.group[valve.from_], self.group[valve.to]
            self.group = {name: new if one == old else one for name, one in self.group.items()}
        self.ends: dict[str, list[tuple[str, int]]] = {name: [] for name in self.group.values()}
        for name, link in self.pipes.items():
            self.ends[self.group[link.from_]].append((name, 0))
            self.ends[self.group[link.to]].append((name, 1))
        self.paths = {group: self._paths(group) for group in self.ends}

    def node(self, pipe: str, end: int) -> str:
        """The node at an end of a pipe, 0 `from` and 1 `to`."""
        return self.pipes[pipe].to if end else self.pipes[pipe].from_

    def _paths(self, group: str) -> list[tuple[float, str, dict]]:
        """All that groups did which a group can feel: (how long ago, group, end -> place of what it brought).

        Longest ago first; the last is the group itself, now.
        """
        found, place = [(0.0, group, {})], {(0, group): 0}
        for s, one, brought in found:
            for pipe, end in self.ends[one]:
                when, other = s + self.travel[pipe], self.group[self.node(pipe, 1 - end)]
                if when > self.span + self.near:
                    continue
                key = round(when / self.near)
                known = next((place[k, other] for k in (key - 1, key, key + 1) if (k, other) in place), None)
                if known is None:
                    known = place[key, other] = len(found)
                    found.append((when, other, {}))
                brought[pipe, end] = known
            if len(found) > MOST_PATHS:
                raise OverflowError("too many reflections to trace; wanted a shorter run, or fewer pipes")
        order = sorted(range(len(found)), key=lambda k: -found[k][0])
        rank = {old: new for new, old in enumerate(order)}
        return [(found[k][0], found[k][1], {end: rank[old] for end, old in found[k][2].items()}) for k in order]

    # what arrives, and what nodes answer -------------------------------------------------------------------------

    def first(self, pipe: str, end: int, age: np.ndarray) -> np.ndarray:
        """The characteristic that arrives at an end at a time `age` after the start, from the pipe's own start."""
        p = [
            self.start.pressure[node] + self.weight * self.z[node] for node in (self.node(pipe, 0), self.node(pipe, 1))
        ]
        share = np.clip(age / self.travel[pipe], 0.0, 1.0)  # of the length, from this end
        sign = 1.0 if end == 1 else -1.0
        return p[end] + share * (p[1 - end] - p[end]) + sign * self.impedance[pipe] * self.rho * self.start.flow[pipe]

    def trace(self, group: str, t: np.ndarray) -> dict:
        """At times t: potentials of a group's nodes, flows of its valves and what its ends send out."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        span = max(float(t.max()) - self.t0, 0.0) + self.near
        size = max(256, BLOCK // len(self.paths[group]))
        blocks = [self._trace(group, t[i : i + size], span) for i in range(0, t.size, size)]
        return {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}

    def _trace(self, group: str, t: np.ndarray, span: float) -> dict:
        paths = self.paths[group]
        known: list[dict] = [{}] * len(paths)
        for k, (s, one, brought) in enumerate(paths):
            if s > span:
                continue
            now, arrived = t - s, {}
            for end in self.ends[one]:
                age = now - self.t0
                arrived[end] = self.first(*end, age)
                if end in brought and known[brought[end]]:
                    sent = known[brought[end]]["sent", end[0], 1 - end[1]]
                    arrived[end] = np.where(age < self.travel[end[0]], arrived[end], sent)
            known[k] = self._answer(one, now, arrived)
        return known[-1]

    def _answer(self, group: str, now, arrived) -> dict:
        """Potentials of a group's nodes for what arrives, and with them what leaves."""
        found, admittance, level = {}, {}, {}
        for node in (name for name, one in self.group.items() if one == group):
            ends = [end for end in arrived if self.node(*end) == node]
            if node in self.reservoirs:
                level[node], admittance[node] = self.reservoirs[node](now) + self.weight * self.z[node], np.inf
                continue
            admittance[node] = sum(1.0 / self.impedance[pipe] for pipe, _ in ends)
            brought = sum(arrived[end] / self.impedance[end[0]] for end in ends) - self.rho * self._demand(node, now)
            level[node] = brought / admittance[node]
        for name, valve in self.valves.items():
            if self.group[valve.to] != group:
                continue
            i, j = valve.from_, valve.to
            slack = 1.0 / admittance[i] + 1.0 / admittance[j]  # potential that a flow takes off the closed drop
            flow = flow_through(self._conductance(valve, now), slack, level[i] - level[j])
            found["valve", name, 0] = flow / self.rho
            level[i], level[j] = level[i] - flow / admittance[i], level[j] + flow / admittance[j]
        found |= {("node", node, 0): values for node, values in level.items()}
        found |= {("sent", *end): 2.0 * level[self.node(*end)] - brought for end, brought in arrived.items()}
        return found

    def _demand(self, node, now):
        part = self.case.nodes[node]
        return value(part.demand, now) if part.kind == "junction" else -value(part.flow, now)

    def _conductance(self, valve, now):
        return 2.0 * self.rho * (valve.flow_area() * value(valve.opening, now)) ** 2

    # what is asked for -------------------------------------------------------------------------------------------

    def pressure(self, node: str, t) -> np.ndarray:
        """Pressure of a node [Pa]."""
        return self.trace(self.group[node], t)["node", node, 0] - self.weight * self.z[node]

    def valve_flow(self, name: str, t) -> np.ndarray:
        """Flow through a valve [m3/s]."""
        return self.trace(self.group[self.valves[name].to], t)["valve", name, 0]

    def inside(self, pipe: str, x, t) -> tuple[np.ndarray, np.ndarray]:
        """Pressure [Pa] and flow [m3/s] in a pipe, x from its start."""
        x, t = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(t, dtype=float))
        link = self.pipes[pipe]
        forward = self._sent(pipe, 0, t - x / self.speed[pipe], x)
        backward = self._sent(pipe, 1, t - (link.length - x) / self.speed[pipe], link.length - x)
        z = self.z[link.from_] + x / link.length * (self.z[link.to] - self.z[link.from_])
        p = 0.5 * (forward + backward) - self.weight * z
        return p, 0.5 * (forward - backward) / (self.impedance[pipe] * self.rho)

    def _sent(self, pipe: str, end: int, when, x):
        """The characteristic a distance x away from the end that sent it at a time; before the start, that start's."""
        age = when + x / self.speed[pipe] - self.t0
        early = self.first(pipe, 1 - end, age + self.travel[pipe] - x / self.speed[pipe])
        sent = when >= self.t0
        if not np.any(sent):
            return early
        found = early.copy()
        found[sent] = self.trace(self.group[self.node(pipe, end)], when[sent])["sent", pipe, end]
        return found

    def kinks(self, pipe: str, t: float) -> np.ndarray:
        """Where rays of any kink of a schedule, or of a start that is none of equilibrium, are at time t [m]."""
        found, length = [np.zeros(0)], self.pipes[pipe].length
        for group, times in self._acting().items():
            for end in (0, 1):
                here = self.group[self.node(pipe, end)]
                after = np.array([s for s, one, _ in self.paths[group] if one == here])
                run = self.speed[pipe] * (t - np.add.outer(times, after).ravel())
                run = np.unique(np.round(run[(run > 0.0) & (run < length)], 9))
                found.append(run if end == 0 else length - run)
        return np.sort(np.concatenate(found))

    def _acting(self) -> dict[str, np.ndarray]:
        """Group -> times at which something has a kink there."""
        parts = [(self.group[name], node) for name, node in self.case.nodes.items()]
        parts += [(self.group[valve.to], valve) for valve in self.valves.values()]
        found: dict[str, set[float]] = {}
        for group, part in parts:
            for key in ("pressure", "head", "demand", "flow", "opening"):
                if hasattr(getattr(part, key, None), "kind"):
                    found.setdefault(group, set()).update(t for t in kinks(getattr(part, key)) if t >= self.t0)
            if not self._rests(group):
                found.setdefault(group, set()).add(self.t0)
        return {group: np.array(sorted(times)) for group, times in found.items() if times}

    def _rests(self, group: str) -> bool:
        """Whether what a group does right after the start is what it did before."""
        after = self.trace(group, np.array([self.t0 + self.near]))
        return all(
            abs(float(after["node", node, 0][0]) - self.start.pressure[node] - self.weight * self.z[node])
            <= 1e-9 * abs(self.start.pressure[node])
            for node, one in self.group.items() if one == group
        )  # fmt: skip


def flow_through(conductance, slack, drop) -> np.ndarray:
    """M with M |M| = G (drop - slack M) : the valve equation between pipe ends, closed."""
    b = conductance * slack
    size = np.abs(drop)
    root = np.sqrt(b * b + 4.0 * conductance * size)
    flow = np.where(size > 0.0, 2.0 * conductance * size / np.where(b + root > 0.0, b + root, 1.0), 0.0)
    return np.copysign(flow, drop)
