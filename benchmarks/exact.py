"""Exact heads of lossless pipe networks by counting wave paths, without cells or time steps."""

from dataclasses import dataclass
from math import erfc, pi

import numba
import numpy as np


@dataclass(frozen=True)
class Pipe:
    """Lossless pipe with length [m], wave speed [m/s] and diameter [m]."""

    name: str
    from_: str
    to: str
    length: float
    wave_speed: float
    diameter: float

    @property
    def travel(self):
        """Travel time L/a [s]."""
        return self.length / self.wave_speed

    @property
    def area(self):
        """Flow area [m2]."""
        return pi / 4 * self.diameter**2


@dataclass(frozen=True)
class Network:
    """Lossless pipes, reservoirs with one head [m], and a node `gate` with the demand `flow` [m3/s] until it closes."""

    name: str
    pipes: tuple
    reservoirs: tuple
    gate: str
    probes: tuple
    head: float
    flow: float
    gravity: float
    end: float

    def admittance(self, node):
        """Sum of g A/a of the pipe ends at a node [m2/s]."""
        return sum(
            self.gravity * p.area / p.wave_speed
            for p in self.pipes
            for end in (p.from_, p.to)
            if end == node
        )

    @property
    def jump(self):
        """Head rise of an instantaneous closure of the gate, Q / sum(g A/a) [m] (Joukowsky)."""
        return self.flow / self.admittance(self.gate)


@dataclass(frozen=True)
class Closure:
    """Fraction of the flow that is shut off at time t [s].

    erf:     1 - erfc((t - start)/width)/2, within [start - 6.5 width, start + 6.5 width] (erfc there 4e-20)
    ramp:    (t - start)/width within [start, start + width]
    instant: 0 before start, 1 from start on
    """

    kind: str
    start: float
    width: float = 0.0

    @property
    def begin(self):
        """Time at which the closure begins [s]."""
        return self.start - 6.5 * self.width if self.kind == "erf" else self.start

    @property
    def finish(self):
        """Time from which the gate is closed [s]."""
        return self.start + (6.5 if self.kind == "erf" else 1.0) * self.width

    def open(self, times):
        """Fraction of the flow that remains : float64[n]."""
        code = KINDS.index(self.kind)
        times = np.asarray(times, float)
        return np.array([1.0 - shut(code, t, self.start, self.width) for t in times])


KINDS = ("erf", "ramp", "instant")


@numba.njit(error_model="numpy")
def shut(code, t, start, width):
    """Fraction of the flow that is shut off at t, by the formulas of `Closure`; code : index in KINDS."""
    if code == 0:
        return 1.0 - 0.5 * erfc((t - start) / width)
    if code == 1:
        return min(max((t - start) / width, 0.0), 1.0)
    return 1.0 if t >= start else 0.0


def impulse_response(network):
    """Delays [s] and weights [m per m3/s] of the pulses that arrive at each probe after a pulse at the gate.

    The delay of a pulse is sum(m_i T_i), where m_i is the number of its passages through pipe i. The counts m (seven
    bits each) identify a pulse, so pulses that arrive together on different paths are added exactly. One round is one
    passage. Returns dict probe -> (float64[k] delays ascending, float64[k] weights).
    """
    pipes = network.pipes
    if len(pipes) > 9:
        raise ValueError("at most nine pipes: the counts of passages share 63 bits")
    travel = np.array([p.travel for p in pipes])
    admittance = [network.gravity * p.area / p.wave_speed for p in pipes]
    ends = {}  # node -> its pipe ends (pipe, 0 at from, 1 at to)
    for i, p in enumerate(pipes):
        ends.setdefault(p.from_, []).append((i, 0))
        ends.setdefault(p.to, []).append((i, 1))
    pulses = {probe: [] for probe in network.probes}
    first = 1.0 / network.admittance(network.gate)
    zero = np.zeros(1, np.int64)
    if network.gate in pulses:
        pulses[network.gate].append((np.zeros(1), np.full(1, first)))
    waves = {
        (i, 1 - side): (zero + (1 << 7 * i), np.full(1, first)) for i, side in ends[network.gate]
    }
    while waves:
        onward = {}
        for node, here in ends.items():
            arriving = [(end, *waves[end]) for end in here if end in waves]
            if not arriving:
                continue
            names, place = np.unique(np.concatenate([a[1] for a in arriving]), return_inverse=True)
            delay = ((names[:, None] >> (7 * np.arange(len(pipes)))) & 127) @ travel
            amplitude = {end: np.zeros(len(names)) for end in here}
            offset = 0
            for end, own, value in arriving:
                amplitude[end][place[offset : offset + len(own)]] = value
                offset += len(own)
            head = np.zeros(len(names))
            if node not in network.reservoirs:
                for i, side in here:
                    head += 2.0 * admittance[i] / network.admittance(node) * amplitude[i, side]
            if node in pulses:
                pulses[node].append((delay, head))
            for i, side in here:
                keep = delay + travel[i] <= network.end
                if keep.any():
                    onward[i, 1 - side] = (
                        names[keep] + (1 << 7 * i),
                        (head - amplitude[i, side])[keep],
                    )
        waves = onward
    return {probe: _ascending(parts) for probe, parts in pulses.items()}


def _ascending(parts):
    delay = np.concatenate([p[0] for p in parts] or [np.zeros(0)])
    weight = np.concatenate([p[1] for p in parts] or [np.zeros(0)])
    order = np.argsort(delay, kind="stable")
    return delay[order], weight[order]


def exact_heads(network, closure, times, response=None):
    """Heads [m] at the probes of `network` during the closure of its gate: dict probe -> float64[n].

    h(t) = head + flow sum_k w_k shut(t - delay_k), exact to rounding for any lengths, with kinks and jumps.
    `response`: result of impulse_response(network), computed if None.
    """
    response = response or impulse_response(network)
    times = np.ascontiguousarray(times, float)
    code = KINDS.index(closure.kind)
    heads = {}
    for probe, (delay, weight) in response.items():
        total = np.concatenate([[0.0], np.cumsum(weight)])
        whole = np.searchsorted(delay, times - closure.finish, side="right")
        some = np.searchsorted(delay, times - closure.begin, side="right")
        rise = _superpose(
            code, closure.start, closure.width, times, delay, weight, total, whole, some
        )
        heads[probe] = network.head + network.flow * rise
    return heads


@numba.njit(error_model="numpy")
def _superpose(code, start, width, times, delay, weight, total, whole, some):
    rise = np.empty_like(times)
    for n in range(len(times)):
        s = total[whole[n]]
        for k in range(whole[n], some[n]):
            s += weight[k] * shut(code, times[n] - delay[k], start, width)
        rise[n] = s
    return rise
