"""Exact waves in frictionless pipes by ray tracing: density law `linear`, reservoirs, junctions and valves.

At each pipe end a characteristic arrives, P + Z M at `to` and P - Z M at `from`, with P = p + rho g z, Z = a / A (wave
speed over area) and mass flow M. It left the other end one travel time before, where it was 2 P minus the
characteristic that arrived there. The state at times t depends only on the states at times t - s, with s a sum of
travel times. These paths form a finite list, evaluated for all times together (d'Alembert; with one pipe and a valve,
Allievi 1902).
"""

import numpy as np

from fvsolve.exact.solution import (
    Exact,
    ExactStart,
    Solution,
    fault,
    kinks,
    reservoirs,
    value,
    valve_faults,
)

MAX_PATHS = 20000
BLOCK = 400_000  # values traced together: number of times x number of paths
# sums of travel times closer than this are merged, relative to the duration of the run
MERGE = 1e-11


def find_faults(case):
    """Yield a fault (keys, message) for everything in a case that ray tracing does not cover."""
    valves: dict[str, list[str]] = {}
    for name, link in case.links.items():
        if link.kind != "pipe":
            yield from valve_faults(case, name)
            for end in (link.from_, link.to):
                valves.setdefault(end, []).append(name)
            continue
        if link.friction.model != "none":
            yield fault(
                case,
                ("links", name, "friction"),
                'holds only without friction; expected model = "none"',
            )
        if link.creep_elements:
            yield fault(
                case, ("links", name, "wall", "creep"), "holds only for walls without creep"
            )
        if link.minor_loss != 0.0:
            yield fault(
                case, ("links", name, "minor_loss"), "holds only without losses; expected 0"
            )
    for node, names in valves.items():
        if case.nodes[node].kind != "reservoir" and len(names) > 1:
            text = f"supports a single valve at {node}; the case has {len(names)} there"
            yield fault(case, ("links", names[1]), text)
    piped = {
        end for link in case.links.values() if link.kind == "pipe" for end in (link.from_, link.to)
    }
    for node in valves:
        if case.nodes[node].kind in ("junction", "inflow") and node not in piped:
            yield fault(case, ("nodes", node), "needs a pipe at every junction")


def solution(case, start: ExactStart) -> Solution:
    """Pressures of nodes [Pa], flows of valves [m3/s] and fields of pipes, as functions of time.

    The case must be one for which `find_faults` yields nothing. Raises OverflowError as `RayPaths`.
    """
    rays = RayPaths(case, start)
    nodes = {name: (lambda t, n=name: rays.pressure(n, t)) for name in case.nodes}
    valves = {name: (lambda t, n=name: rays.valve_flow(n, t)) for name in rays.valves}
    return Solution(case, pressure=nodes, flow=valves, pipe=rays.inside, kinks=rays.kinks)


class RayPaths:
    """Wave paths of a case between groups of nodes.

    Nodes joined by a valve form a group; any other node is a group by itself.
    Raises OverflowError if the state of a group depends on more than MAX_PATHS earlier states.
    """

    def __init__(self, case, start: ExactStart) -> None:
        self.case, self.rho, self.t0 = case, case.properties.density, case.numerics.start
        self.weight = self.rho * case.gravity
        self.z = {name: case.elevation(name) for name in case.nodes}
        self.pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
        self.valves = {
            name: link for name, link in case.links.items() if link.kind in ("valve", "orifice")
        }
        self.speed = {name: case.wave_speed(name) for name in self.pipes}
        self.travel = {name: link.length / self.speed[name] for name, link in self.pipes.items()}
        self.impedance = {
            k: self.speed[k] / (0.25 * np.pi * link.diameter**2) for k, link in self.pipes.items()
        }
        self.start, self.reservoirs = start, reservoirs(case)
        self.span = case.numerics.end - self.t0
        self.near = MERGE * self.span
        self.group = {name: name for name in case.nodes}
        for valve in self.valves.values():
            old, new = self.group[valve.from_], self.group[valve.to]
            self.group = {
                name: new if member == old else member for name, member in self.group.items()
            }
        self.ends: dict[str, list[tuple[str, int]]] = {name: [] for name in self.group.values()}
        for name, link in self.pipes.items():
            self.ends[self.group[link.from_]].append((name, 0))
            self.ends[self.group[link.to]].append((name, 1))
        self.paths = {group: self._paths(group) for group in self.ends}

    def node(self, pipe: str, end: int) -> str:
        """Node at an end of a pipe. end : 0 for `from`, 1 for `to`"""
        return self.pipes[pipe].to if end else self.pipes[pipe].from_

    def _paths(self, group: str) -> list[tuple[float, str, dict]]:
        """Earlier states of groups of nodes on which the state of a group depends : list of (age [s], group, sources).

        sources : (pipe, end) -> index in the list of the state from which the characteristic at this end comes
        The oldest state is first; the last is the state of the group itself at age 0.
        """
        paths, place = [(0.0, group, {})], {(0, group): 0}
        for s, here, sources in paths:
            for pipe, end in self.ends[here]:
                when, other = s + self.travel[pipe], self.group[self.node(pipe, 1 - end)]
                if when > self.span + self.near:
                    continue
                key = round(when / self.near)
                known = next(
                    (place[k, other] for k in (key - 1, key, key + 1) if (k, other) in place), None
                )
                if known is None:
                    known = place[key, other] = len(paths)
                    paths.append((when, other, {}))
                sources[pipe, end] = known
            if len(paths) > MAX_PATHS:
                raise OverflowError(
                    "too many reflections to trace; expected a shorter run, or fewer pipes"
                )
        order = sorted(range(len(paths)), key=lambda k: -paths[k][0])
        rank = {old: new for new, old in enumerate(order)}
        return [
            (paths[k][0], paths[k][1], {end: rank[old] for end, old in paths[k][2].items()})
            for k in order
        ]

    # characteristics and nodes ---------------------------------------------------------------------------------------

    def first(self, pipe: str, end: int, age: np.ndarray) -> np.ndarray:
        """Characteristic [Pa] that arrives at an end of a pipe `age` seconds after the start, by the initial state.

        It is P + Z M at `to` (end 1) and P - Z M at `from` (end 0), with P = p + rho g z, impedance Z and mass flow M.
        """
        p = [
            self.start.pressure[node] + self.weight * self.z[node]
            for node in (self.node(pipe, 0), self.node(pipe, 1))
        ]
        share = np.clip(age / self.travel[pipe], 0.0, 1.0)  # fraction of the length, from this end
        sign = 1.0 if end == 1 else -1.0
        return (
            p[end]
            + share * (p[1 - end] - p[end])
            + sign * self.impedance[pipe] * self.rho * self.start.flow[pipe]
        )

    def trace(self, group: str, t: np.ndarray) -> dict:
        """State of a group of nodes at times t, as a dict of arrays over t.

        It contains P = p + rho g z of the nodes [Pa] under ("node", name, 0), flows of the valves [m3/s] under
        ("valve", name, 0), and outgoing characteristics [Pa] under ("sent", pipe, end).
        """
        t = np.atleast_1d(np.asarray(t, dtype=float))
        span = max(float(t.max()) - self.t0, 0.0) + self.near
        size = max(256, BLOCK // len(self.paths[group]))
        blocks = [self._trace(group, t[i : i + size], span) for i in range(0, t.size, size)]
        return {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}

    def _trace(self, group: str, t: np.ndarray, span: float) -> dict:
        paths = self.paths[group]
        known: list[dict] = [{}] * len(paths)
        for k, (s, here, sources) in enumerate(paths):
            if s > span:
                continue
            now, arrived = t - s, {}
            for end in self.ends[here]:
                age = now - self.t0
                arrived[end] = self.first(*end, age)
                if end in sources and known[sources[end]]:
                    sent = known[sources[end]]["sent", end[0], 1 - end[1]]
                    arrived[end] = np.where(age < self.travel[end[0]], arrived[end], sent)
            known[k] = self._node_state(here, now, arrived)
        return known[-1]

    def _node_state(self, group: str, now, arrived) -> dict:
        """State of a group of nodes at times `now`, as in `trace`, from the characteristics `arrived` there.

        arrived : (pipe, end) -> arriving characteristic [Pa] at these times, see `first`
        """
        result = {}
        admittance = {}
        level = {}
        for node in (name for name, own in self.group.items() if own == group):
            ends = [end for end in arrived if self.node(*end) == node]
            if node in self.reservoirs:
                level[node], admittance[node] = (
                    self.reservoirs[node](now) + self.weight * self.z[node],
                    np.inf,
                )
                continue
            admittance[node] = sum(1.0 / self.impedance[pipe] for pipe, _ in ends)
            part = self.case.nodes[node]
            demand = value(part.demand, now) if part.kind == "junction" else -value(part.flow, now)
            incoming = (
                sum(arrived[end] / self.impedance[end[0]] for end in ends) - self.rho * demand
            )
            level[node] = incoming / admittance[node]
        for name, valve in self.valves.items():
            if self.group[valve.to] != group:
                continue
            i, j = valve.from_, valve.to
            # decrease of the potential drop per flow
            slack = 1.0 / admittance[i] + 1.0 / admittance[j]
            conductance = 2.0 * self.rho * (valve.flow_area() * value(valve.opening, now)) ** 2
            flow = valve_equation_flow(conductance, slack, level[i] - level[j])
            result["valve", name, 0] = flow / self.rho
            level[i], level[j] = level[i] - flow / admittance[i], level[j] + flow / admittance[j]
        result |= {("node", node, 0): values for node, values in level.items()}
        result |= {
            ("sent", *end): 2.0 * level[self.node(*end)] - incoming
            for end, incoming in arrived.items()
        }
        return result

    # results ---------------------------------------------------------------------------------------------------------

    def pressure(self, node: str, t) -> np.ndarray:
        """Pressure of a node at times t [Pa]."""
        return self.trace(self.group[node], t)["node", node, 0] - self.weight * self.z[node]

    def valve_flow(self, name: str, t) -> np.ndarray:
        """Flow through a valve at times t [m3/s]."""
        return self.trace(self.group[self.valves[name].to], t)["valve", name, 0]

    def inside(self, pipe: str, x, t) -> tuple[np.ndarray, np.ndarray]:
        """Pressure [Pa] and flow [m3/s] in a pipe at distances x from its `from` end [m] and times t [s]."""
        x, t = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(t, dtype=float))
        link = self.pipes[pipe]
        forward = self._outgoing(pipe, 0, t - x / self.speed[pipe], x)
        backward = self._outgoing(
            pipe, 1, t - (link.length - x) / self.speed[pipe], link.length - x
        )
        z = self.z[link.from_] + x / link.length * (self.z[link.to] - self.z[link.from_])
        p = 0.5 * (forward + backward) - self.weight * z
        return p, 0.5 * (forward - backward) / (self.impedance[pipe] * self.rho)

    def _outgoing(self, pipe: str, end: int, when, x):
        """Characteristic [Pa] that left an end of a pipe at the times `when` [s], at the distance x [m] from this end.

        If it left before the start, it follows from the initial state. For the characteristic see `first`.
        """
        age = when + x / self.speed[pipe] - self.t0
        early = self.first(pipe, 1 - end, age + self.travel[pipe] - x / self.speed[pipe])
        sent = when >= self.t0
        if not np.any(sent):
            return early
        result = early.copy()
        result[sent] = self.trace(self.group[self.node(pipe, end)], when[sent])["sent", pipe, end]
        return result

    def kinks(self, pipe: str, t: float) -> np.ndarray:
        """Distances [m] from the `from` end of a pipe to the kinks of its fields at time t [s].

        They are on rays that start at kinks of schedules, or at an initial state that is not steady.
        """
        places, length = [np.zeros(0)], self.pipes[pipe].length
        for group, times in self._kink_times().items():
            for end in (0, 1):
                here = self.group[self.node(pipe, end)]
                after = np.array([s for s, own, _ in self.paths[group] if own == here])
                run = self.speed[pipe] * (t - np.add.outer(times, after).ravel())
                run = np.unique(np.round(run[(run > 0.0) & (run < length)], 9))
                places.append(run if end == 0 else length - run)
        return np.sort(np.concatenate(places))

    def _kink_times(self) -> dict[str, np.ndarray]:
        """Group of nodes -> times of kinks of its schedules [s], with the start if its initial state is not steady."""
        parts = [(self.group[name], node) for name, node in self.case.nodes.items()]
        parts += [(self.group[valve.to], valve) for valve in self.valves.values()]
        result: dict[str, set[float]] = {}
        for group, part in parts:
            for key in ("pressure", "head", "demand", "flow", "opening"):
                if hasattr(getattr(part, key, None), "kind"):
                    result.setdefault(group, set()).update(
                        t for t in kinks(getattr(part, key)) if t >= self.t0
                    )
            if not self._is_steady(group):
                result.setdefault(group, set()).add(self.t0)
        return {group: np.array(sorted(times)) for group, times in result.items() if times}

    def _is_steady(self, group: str) -> bool:
        """True if the pressures of a group of nodes do not change just after the start."""
        after = self.trace(group, np.array([self.t0 + self.near]))
        return all(
            abs(
                float(after["node", node, 0][0])
                - self.start.pressure[node]
                - self.weight * self.z[node]
            )
            <= 1e-9 * abs(self.start.pressure[node])
            for node, own in self.group.items()
            if own == group
        )


def valve_equation_flow(conductance, slack, drop) -> np.ndarray:
    """Mass flow M [kg/s] through a valve between two pipe ends, from M |M| = conductance (drop - slack M).

    conductance : 2 rho (Cd A)^2 [kg m]; drop : pressure drop without flow [Pa]; slack : its decrease per mass flow
    """
    b = conductance * slack
    size = np.abs(drop)
    root = np.sqrt(b * b + 4.0 * conductance * size)
    flow = np.where(
        size > 0.0, 2.0 * conductance * size / np.where(b + root > 0.0, b + root, 1.0), 0.0
    )
    return np.copysign(flow, drop)


RAYS = Exact(
    "rays", ("reservoir", "junction", "inflow"), ("pipe", "valve", "orifice"), find_faults, solution
)
