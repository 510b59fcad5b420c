"""Moving segments of water: conservative values carried by plug flow in pipes and mixed at nodes and in tanks.

In each time step, water leaves a pipe at one end and enters at the other by segments, each with its volume and values,
so that a front keeps its shape at any flow (Liou and Kroon 1987; EPANET, Rossman 2020). Nodes are treated in the order
of the flow, so that water may pass several short pipes in a step. A junction mixes the water of the step, a tank all
its water.
"""

from collections import deque

import numpy as np

SAME = 1e-12  # difference of values of two segments regarded as equal, over the span of the values
ROUNDING = 1e-9  # share of the flow at a node regarded as rounding of its balance
EMPTY = 1e-12  # share of the volume of a step regarded as none


class Segments:
    """Values in all pipes, tanks and at nodes of a network, as arrays of one or more conservative values.

    ends : int[links, 2]  nodes of each link; volume : float[links]  volume of water [m3], 0 for links without length
    store : node -> volume of water in this tank at the start [m3]; count : number of nodes
    source : reservoirs; given : node -> (column, value) that its water has behind it; start : values at the start
    """

    def __init__(
        self, ends, volume, store: dict[int, float], source: set[int], given, start, count: int
    ) -> None:
        self.ends, self.volume, self.source, self.given, self.count = (
            ends,
            volume,
            source,
            given,
            count,
        )
        self.pipes = [deque([[v, start.copy()]]) if v > 0.0 else None for v in volume]
        self.store = {node: [v, v * start] for node, v in store.items()}
        self.values = np.tile(start, (count, 1))
        self.orders: dict[bytes, tuple] = {}

    def contents(self) -> np.ndarray:
        """Sum of volume times values over pipes and tanks."""
        inside = [v * c for pipe in self.pipes if pipe for v, c in pipe]
        return np.sum([*inside, *(mass for _, mass in self.store.values())], axis=0)

    def order(self, flow) -> tuple:
        """(nodes in the order of the flow, links that flow into each, links that flow out of each).

        Nodes on a circle of flow come last.
        """
        signs = np.sign(flow).astype(np.int8)
        if (known := self.orders.get(signs.tobytes())) is not None:
            return known
        into: list[list[int]] = [[] for _ in range(self.count)]
        outof: list[list[int]] = [[] for _ in range(self.count)]
        for k, sign in enumerate(signs):
            if sign:
                first, last = self.ends[k] if sign > 0 else self.ends[k][::-1]
                outof[first].append(k)
                into[last].append(k)
        waits = [len(links) for links in into]
        ready, nodes = deque(i for i in range(self.count) if not waits[i]), []
        while ready:
            nodes.append(i := ready.popleft())
            for k in outof[i]:
                other = self.ends[k][1] if self.ends[k][0] == i else self.ends[k][0]
                waits[other] -= 1
                if not waits[other]:
                    ready.append(other)
        nodes += sorted(set(range(self.count)) - set(nodes))
        self.orders[signs.tobytes()] = nodes, into, outof
        return self.orders[signs.tobytes()]

    def advance(self, flow, step: float, supply: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move the water by the mean flows of a time step; returns (values that entered, values that left), times m3.

        flow : float[links]  mean flow of each link, positive from its first end [m3/s]; step : [s]
        supply : values of water that comes from outside, at reservoirs and inflows
        """
        nodes, into, outof = self.order(flow)
        moved = np.abs(flow) * step
        entered, left = np.zeros(self.values.shape[1]), np.zeros(self.values.shape[1])
        for i in nodes:
            came, mass = 0.0, np.zeros(self.values.shape[1])
            for k in into[i]:
                came += moved[k]
                mass += self.taken(k, flow[k], moved[k])
            goes = sum(moved[k] for k in outof[i])
            if i in self.source:
                self.values[i] = supply
                entered += goes * supply
                left += mass
            elif i in self.store:
                held = self.store[i]
                held[0] += came
                held[1] += mass
                self.values[i] = held[1] / held[0] if held[0] > 0.0 else self.values[i]
                held[0] -= goes
                held[1] = held[1] - goes * self.values[i]
            else:
                extra = goes - came if goes - came > ROUNDING * goes else 0.0  # from outside
                if came + extra > 0.0:
                    self.values[i] = (mass + extra * supply) / (came + extra)
                entered += extra * supply
                left += (came + extra - goes) * self.values[i]
            if i in self.given:
                column, value = self.given[i]
                entered[column] += goes * (value - self.values[i, column])
                self.values[i, column] = value
            for k in outof[i]:
                self.release(k, flow[k], moved[k], self.values[i])
        return entered, left

    def taken(self, k: int, flow: float, volume: float) -> np.ndarray:
        """Volume times values of the water that leaves link k in a step; `volume` of it [m3]."""
        pipe = self.pipes[k]
        total = np.zeros(self.values.shape[1])
        rest = volume
        if pipe is None:
            return volume * self.values[self.ends[k][0] if flow > 0.0 else self.ends[k][1]]
        while rest > EMPTY * volume and pipe:
            segment = pipe[-1] if flow > 0.0 else pipe[0]
            part = min(rest, segment[0])
            total += part * segment[1]
            segment[0] -= part
            rest -= part
            if segment[0] <= EMPTY * volume:
                pipe.pop() if flow > 0.0 else pipe.popleft()
        return total

    def release(self, k: int, flow: float, volume: float, values: np.ndarray) -> None:
        """Let a volume [m3] with these values enter link k."""
        pipe = self.pipes[k]
        if pipe is None or volume == 0.0:
            return
        near = (pipe[0] if flow > 0.0 else pipe[-1]) if pipe else None
        if near is not None and np.all(np.abs(near[1] - values) <= SAME * (1.0 + np.abs(values))):
            near[0] += volume
        elif flow > 0.0:
            pipe.appendleft([volume, values.copy()])
        else:
            pipe.append([volume, values.copy()])
