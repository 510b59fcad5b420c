"""Random networks on exact grids, and their solution by the method of characteristics.

All travel times, and all times at which inputs begin, turn and end, are whole multiples of a time unit. So
characteristics at Courant 1 carry kinks and jumps exactly. The error of the solution is that of friction, of
accumulators, and of peaks of sines, of second order in the step. The code is independent of fvsolve: it has its own
steady state (SciPy), pipes, valves, check valves and gas.

Heads satisfy dH/dt = -a^2 / (g A) dQ/dx and dQ/dt = -g A (dH/dx + drop), with drop = r Q |Q|^(n - 1) per length
(Wylie and Streeter, Fluid Transients, 1993).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
from scipy.optimize import root

GRAVITY, AMBIENT, DENSITY = 9.80665, 50e6, 1000.0  # no pressure comes near the vapour pressure
MOST_PIPES = 7
LARGEST = 64  # greatest division of the time unit
# relative to the range of a signal: uncertainty below which the grid is not refined again
ACCURATE = 2e-4
CV_CONSTANT = 0.61  # discharge coefficient of valves
DEMAND, VALVE = 0, 1


@dataclass
class Schedule:
    """Input over time units: `at(t)` and, at a jump, its left limit `at(t, left=True)`; `keys` for fvsolve."""

    kind: str
    numbers: tuple[float, ...]

    def at(self, t: float, left: bool = False) -> float:
        if self.kind == "constant":
            return self.numbers[0]
        if self.kind == "sine":
            mean, amplitude, period = self.numbers
            return mean + amplitude * math.sin(2.0 * math.pi * t / period)
        if self.kind == "ramp":
            start, duration, first, last, exponent = self.numbers
            if t < start or (t == start and (left or duration > 0.0)):
                return first
            if t >= start + duration:
                return last
            return last + (first - last) * (1.0 - (t - start) / duration) ** exponent
        times, values = self.numbers[:3], self.numbers[3:]
        return float(np.interp(t, times, values))

    def keys(self, unit: float) -> Any:
        """Value of the key in the case file; unit : time unit [s]."""
        if self.kind == "constant":
            return self.numbers[0]
        if self.kind == "sine":
            mean, amplitude, period = self.numbers
            return {"mean": mean, "amplitude": amplitude, "period": period * unit}
        if self.kind == "ramp":
            start, duration, first, last, exponent = self.numbers
            ramp = {"start": start * unit, "duration": duration * unit, "value": [first, last]}
            return ramp if exponent == 1.0 else ramp | {"exponent": exponent}
        times, values = self.numbers[:3], self.numbers[3:]
        return {"time": [t * unit for t in times], "value": list(values), "kind": "linear"}


@dataclass
class Pipe:
    """Pipe between two nodes; units : its travel time in time units; friction : (model, number) as in the case file."""

    start: int
    end: int
    units: int
    diameter: float
    speed: float
    friction: tuple[str, float]

    def length(self, unit: float) -> float:
        return self.units * unit * self.speed

    @property
    def area(self) -> float:
        return 0.25 * math.pi * self.diameter**2

    @property
    def resistance(self) -> tuple[float, float]:
        """Factor r and exponent n of the head drop per length, r Q |Q|^(n - 1)."""
        model, number = self.friction
        if model == "none":
            return 0.0, 2.0
        if model == "hazen-williams":
            return 10.667 / (number**1.852 * self.diameter**4.871), 1.852
        if model == "chezy-manning":
            return number**2 * (4.0 / self.diameter) ** (4.0 / 3.0) / self.area**2, 2.0
        return number / (2.0 * GRAVITY * self.diameter * self.area**2), 2.0

    def friction_keys(self) -> dict[str, Any]:
        model, number = self.friction
        if model == "none":
            return {"model": "none"}
        return {
            "model": model,
            "coefficient" if model in ("hazen-williams", "chezy-manning") else "factor": number,
        }


@dataclass
class Network:
    """Network on an exact grid: node 0 is a lake.

    demands : node -> schedule [m3/s]; valves : node -> (area, schedule of opening, head beyond)
    checks : pairs of nodes (before, after) -> area; vessels : node -> (gas volume, area of the throat, loss in, out)
    unit : time unit [s]; end : duration in time units
    """

    unit: float
    end: int
    head: float
    elevations: list[float]
    pipes: list[Pipe]
    demands: dict[int, Schedule] = field(default_factory=dict)
    valves: dict[int, tuple[float, Schedule, float]] = field(default_factory=dict)
    checks: dict[tuple[int, int], float] = field(default_factory=dict)
    vessels: dict[int, tuple[float, float, float, float]] = field(default_factory=dict)
    # (pipe, time units from `start`): head there
    places: list[tuple[int, int]] = field(default_factory=list)


# generator -----------------------------------------------------------------------------------------------------------


def random_network(seed: Any) -> Network:
    """Random network of 1 to 7 pipes with a steady state; draws again until there is one."""
    rng = np.random.default_rng(seed)
    while True:
        network = draw(rng)
        try:
            steady_state(network)
        except ValueError:
            continue
        return network


def draw(rng: np.random.Generator) -> Network:
    """Random tree of pipes, sometimes with a loop, with inputs at its ends and devices between its pipes."""
    count = int(rng.integers(1, MOST_PIPES + 1))
    unit = float(f"{10.0 ** rng.uniform(-2.3, -1.2):.2g}")
    lossless = rng.random() < 0.2
    network = Network(
        unit, 0, float(rng.uniform(30.0, 120.0)), [0.0, *rng.uniform(-20.0, 20.0, count)], []
    )
    size = float(rng.uniform(0.1, 0.5))
    wall = int(rng.choice([6, 15, 40]))  # greatest number of time units of a pipe
    ends = [0]
    for k in range(count):
        before = int(rng.choice(ends)) if k else 0
        joined = network.vessels or any(before in pair for pair in network.checks)
        if rng.random() < 0.12 and k and before and not joined:
            network.elevations.append(network.elevations[before])
            behind = len(network.elevations) - 1
            network.checks[before, behind] = float(rng.uniform(0.1, 0.6) * 0.25 * math.pi * size**2)
            before = behind
        friction = ("none", 0.0) if lossless else random_friction(rng)
        diameter = size * float(rng.choice([0.6, 0.8, 1.0, 1.3]))
        a, b = before, k + 1
        if rng.random() < 0.4:
            a, b = b, a
        network.pipes.append(
            Pipe(
                a,
                b,
                int(rng.integers(2, wall + 1)),
                diameter,
                float(rng.integers(30, 140) * 10),
                friction,
            )
        )
        ends.append(k + 1)
    if not lossless and count > 2 and rng.random() < 0.2:
        a, b = rng.choice(np.arange(1, count + 1), 2, replace=False)
        network.pipes.append(
            Pipe(int(a), int(b), int(rng.integers(2, wall + 1)), size, 1000.0, random_friction(rng))
        )
    longest = max(pipe.units for pipe in network.pipes)
    network.end = int(rng.uniform(3.0, 10.0) * longest) + 10
    add_inputs(rng, network, size)
    pipe = int(rng.integers(len(network.pipes)))
    network.places.append((pipe, int(rng.integers(0, network.pipes[pipe].units + 1))))
    return network


def random_friction(rng: np.random.Generator) -> tuple[str, float]:
    model = str(rng.choice(["none", "steady", "quasi-steady", "hazen-williams", "chezy-manning"]))
    ranges = {"none": (0.0, 0.0), "hazen-williams": (80.0, 150.0), "chezy-manning": (0.008, 0.016)}
    return model, float(rng.uniform(*ranges.get(model, (0.01, 0.04))))


def add_inputs(rng: np.random.Generator, network: Network, size: float) -> None:
    """Add valves and demands at the ends of the network and at some nodes between, and accumulators."""
    joined = [node for pipe in network.pipes for node in (pipe.start, pipe.end)]
    inner = [
        node
        for node in range(1, len(network.elevations))
        if not any(node in pair for pair in network.checks)
    ]
    area = 0.25 * math.pi * size**2
    for node in inner:
        leaf = joined.count(node) == 1
        draw_one = rng.random()
        if draw_one < (0.45 if leaf else 0.05):
            share = float(rng.uniform(0.02, 0.4))
            network.valves[node] = (
                area * share,
                opening(rng, network.end),
                float(rng.uniform(0.0, network.head)),
            )
        elif draw_one < (0.85 if leaf else 0.3):
            network.demands[node] = demand(rng, network.end, area)
        elif not leaf and draw_one < 0.4 and not network.vessels:
            gas = area * 10.0 ** float(rng.uniform(1.0, 3.5))
            network.vessels[node] = (
                gas,
                0.2 * area,
                float(rng.uniform(0.5, 4.0)),
                float(rng.uniform(0.5, 4.0)),
            )
    if not any(schedule.kind != "constant" for schedule in inputs(network)):
        node = network.pipes[-1].end or network.pipes[-1].start
        network.demands.pop(node, None)
        network.vessels.pop(node, None)
        if any(node in pair for pair in network.checks):
            network.demands[node] = demand(rng, network.end, area)
        else:
            network.valves[node] = 0.2 * area, opening(rng, network.end), 0.0


def inputs(network: Network) -> list[Schedule]:
    return [*network.demands.values(), *(schedule for _, schedule, _ in network.valves.values())]


def opening(rng: np.random.Generator, end: int) -> Schedule:
    """Random opening of a valve: ramp, pulse, sine, jump."""
    return change(rng, end, lambda: float(rng.choice([0.0, 1.0, rng.uniform(0.0, 1.0)])), 1.0)


def demand(rng: np.random.Generator, end: int, area: float) -> Schedule:
    """Random demand [m3/s]: ramp, pulse, sine, jump."""
    return change(rng, end, lambda: float(rng.choice([0.0, 1.0]) * rng.uniform(0.0, 1.0)), area)


def change(rng: np.random.Generator, end: int, value: Any, scale: float) -> Schedule:
    start, duration = int(rng.integers(1, max(2, end // 2))), int(10.0 ** rng.uniform(0.0, 1.5))
    first, last = value(), value()
    while abs(first - last) < 0.05:
        first, last = value(), value()
    kind = rng.random()
    if kind < 0.4:
        exponent = float(rng.choice([1.0, 1.0, 1.5, 2.0]))
        return Schedule("ramp", (start, duration, scale * first, scale * last, exponent))
    if kind < 0.5:
        return Schedule("ramp", (start, 0, scale * first, scale * last, 1.0))
    if kind < 0.8:
        back = start + duration + int(10.0 ** rng.uniform(0.0, 1.5))
        third = first if rng.random() < 0.6 else value()
        values = [scale * one for one in (first, last, third)]
        return Schedule("pulse", (start, start + duration, back, *values))
    amplitude = abs(first - last) / 2.0
    return Schedule(
        "sine",
        (scale * (min(first, last) + amplitude), scale * amplitude, 10.0 ** rng.uniform(0.8, 2.0)),
    )


def case_of(network: Network) -> dict[str, Any]:
    """Nodes, links and fluid of the case file of a network, without `numerics` and `output`."""
    unit, names = network.unit, [node_name(k) for k in range(len(network.elevations))]
    nodes: dict[str, Any] = {
        name: {"type": "junction", "elevation": float(z)}
        for name, z in zip(names, network.elevations, strict=True)
    }
    nodes["lake"] = {"type": "reservoir", "head": network.head, "elevation": 0.0}
    links: dict[str, Any] = {}
    for k, pipe in enumerate(network.pipes):
        links[f"p{k}"] = {
            "type": "pipe",
            "from": names[pipe.start],
            "to": names[pipe.end],
            "length": pipe.length(unit),
            "diameter": pipe.diameter,
            "wave_speed": pipe.speed,
            "friction": pipe.friction_keys(),
        }
    for node, schedule in network.demands.items():
        nodes[names[node]]["demand"] = schedule.keys(unit)
    for node, (area, schedule, head) in network.valves.items():
        nodes[f"out{node}"] = {
            "type": "reservoir",
            "head": head,
            "elevation": network.elevations[node],
        }
        links[f"v{node}"] = {
            "type": "valve",
            "from": names[node],
            "to": f"out{node}",
            "area": area,
            "discharge_coefficient": CV_CONSTANT,
            "opening": schedule.keys(unit),
        }
    for (before, behind), area in network.checks.items():
        links[f"c{before}"] = {
            "type": "check-valve",
            "from": names[before],
            "to": names[behind],
            "area": area,
            "discharge_coefficient": CV_CONSTANT,
        }
    for node, (gas, area, loss_in, loss_out) in network.vessels.items():
        connection = {"area": area, "loss_in": loss_in, "loss_out": loss_out}
        nodes[names[node]] |= {
            "type": "accumulator",
            "volume": 3.0 * gas,
            "gas_volume": gas,
            "connection": connection,
        }
    fluid = {
        "name": "user",
        "density": DENSITY,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "vapor_pressure": 0.0,
    }
    return {
        "schema": 1,
        "ambient_pressure": AMBIENT,
        "fluid": fluid,
        "nodes": nodes,
        "links": links,
    }


def node_name(node: int) -> str:
    return f"n{node}" if node else "lake"


def probes_of(network: Network) -> list[str]:
    """Probes in the order of `Solution.extremes`: heads of nodes, flows into pipes, heads at places."""
    heads = [f"{node_name(k)}.head" for k in range(1, len(network.elevations))]
    flows = [f"p{k}.flow@0" for k in range(len(network.pipes))]
    return [
        *heads,
        *flows,
        *(f"p{k}.head@{at / network.pipes[k].units!r}" for k, at in network.places),
    ]


# steady state --------------------------------------------------------------------------------------------------------


def steady_state(network: Network) -> tuple[np.ndarray, np.ndarray]:
    """Heads of nodes and flows of pipes at the start; raises ValueError if there is none, or a check valve is shut."""
    pipes, many, unit = network.pipes, len(network.elevations), network.unit
    checks, valves = list(network.checks.items()), list(network.valves.items())
    losses = [(*pipe.resistance, pipe.length(unit)) for pipe in pipes]
    area = max(pipe.area for pipe in pipes)

    def residual(x: np.ndarray) -> np.ndarray:
        heads, flows = network.head + x[:many], area * x[many : many + len(pipes)]
        through = area * x[many + len(pipes) :]
        balance = np.zeros(many)
        rows = []
        for (r, n, length), pipe, q in zip(losses, pipes, flows, strict=True):
            rows.append(heads[pipe.start] - heads[pipe.end] - r * length * q * abs(q) ** (n - 1.0))
            balance[pipe.start] -= q
            balance[pipe.end] += q
        for ((before, behind), size), q in zip(checks, through[: len(checks)], strict=True):
            rows.append(
                heads[before]
                - heads[behind]
                - q * abs(q) / (2.0 * GRAVITY * (CV_CONSTANT * size) ** 2)
            )
            balance[before] -= q
            balance[behind] += q
        for (node, (size, schedule, beyond)), q in zip(valves, through[len(checks) :], strict=True):
            capacity = 2.0 * GRAVITY * (CV_CONSTANT * size * schedule.at(0.0, left=True)) ** 2
            drop = heads[node] - beyond
            rows.append((q - np.sign(drop) * math.sqrt(capacity * abs(drop))) / area)
            balance[node] -= q
        for node, schedule in network.demands.items():
            balance[node] -= schedule.at(0.0, left=True)
        balance /= area
        balance[0] = heads[0] - network.head
        return np.array([*rows, *balance])

    start = np.concatenate(
        [-np.arange(many) * 0.3, np.full(len(pipes) + len(checks) + len(valves), 0.3)]
    )
    found = root(residual, start, method="hybr", options={"maxfev": 4000})
    found = root(residual, found.x, method="lm", options={"xtol": 1e-15, "ftol": 1e-15})
    if np.max(np.abs(residual(found.x))) > 1e-8:
        raise ValueError("no steady state")
    flows = area * found.x[many : many + len(pipes)]
    if np.any(found.x[many + len(pipes) :][: len(checks)] < 1e-3):
        raise ValueError("a check valve is shut")
    if np.any(np.abs(flows / area) > 4.0):
        raise ValueError("flows are too fast")
    rises = [abs(network.elevations[pipe.start] - network.elevations[pipe.end]) for pipe in pipes]
    if any(rise >= pipe.length(unit) for rise, pipe in zip(rises, pipes, strict=True)):
        raise ValueError("a pipe is shorter than its rise")
    return network.head + found.x[:many], flows


# characteristics -----------------------------------------------------------------------------------------------------


@dataclass
class Solution:
    """Extremes of the probes of `probes_of` : float64[probes, 2] (least, greatest), and their uncertainty."""

    extremes: np.ndarray
    uncertainty: np.ndarray
    division: int
    shut: int = 0  # number of closures of check valves


def solution(network: Network, largest: int = LARGEST) -> Solution:
    """Extremes of a network by characteristics on three grids, each with half the step of the last; see `ACCURATE`.

    The uncertainty is the greater of the last two differences, because a check valve shuts at a point of each grid, and
    two grids may have the same one; or it is the height of a smooth peak between two points of the finest grid: its
    points include those of the others, so all may miss a peak by the same amount.
    """
    heads, flows = steady_state(network)
    division, last = 4, np.inf
    coarse, _, _ = march(network, heads, flows, division)
    while True:
        division *= 2
        fine, shut, bends = march(network, heads, flows, division)
        off, span = np.abs(fine - coarse), np.ptp(fine, axis=1, keepdims=True)
        uncertain = np.maximum(off, last)
        if division >= largest or np.all(uncertain <= ACCURATE * span + 1e-9):
            return Solution(
                fine,
                np.maximum(uncertain, np.minimum(0.125 * bends, ACCURATE * span)),
                division,
                shut,
            )
        coarse, last = fine, off


def march(
    network: Network, heads: np.ndarray, flows: np.ndarray, division: int
) -> tuple[np.ndarray, int, np.ndarray]:
    """Extremes of all probes with steps of the time unit over `division`, number of closures, and second differences.

    The second differences are those of the values in time around each extreme.
    """
    pipes, dt, many = network.pipes, network.unit / division, len(network.elevations)
    steps = network.end * division
    cells = np.array([pipe.units * division for pipe in pipes])
    first = np.concatenate([[0], np.cumsum(cells + 1)])
    rows = np.zeros((len(pipes), 3))
    H, Q = np.zeros(first[-1]), np.zeros(first[-1])
    for k, pipe in enumerate(pipes):
        r, n = pipe.resistance
        rows[k] = pipe.speed / (GRAVITY * pipe.area), r * pipe.speed * dt, n
        drop = r * pipe.length(network.unit) * flows[k] * abs(flows[k]) ** (n - 1.0)
        H[first[k] : first[k + 1]] = heads[pipe.start] - drop * np.linspace(0.0, 1.0, cells[k] + 1)
        Q[first[k] : first[k + 1]] = flows[k]
    ends = np.array([(pipe.start, pipe.end) for pipe in pipes])
    times = np.arange(steps + 1) / division
    drawn, opened = np.zeros((2, steps + 1, many)), np.zeros((2, steps + 1, many))
    for side, left in enumerate((True, False)):
        for node, schedule in network.demands.items():
            drawn[side, :, node] = [schedule.at(t, left) for t in times]
        for node, (area, schedule, _) in network.valves.items():
            size = CV_CONSTANT * area * math.sqrt(2.0 * GRAVITY)
            opened[side, :, node] = [size * schedule.at(t, left) for t in times]
    jumps = np.any(drawn[0] != drawn[1], axis=1) | np.any(opened[0] != opened[1], axis=1)
    beyond = np.zeros(many)
    for node, (_, _, head) in network.valves.items():
        beyond[node] = head
    pairs = np.array(
        [
            [*pair, CV_CONSTANT * area * math.sqrt(2.0 * GRAVITY)]
            for pair, area in network.checks.items()
        ]
    ).reshape(-1, 3)
    vessels = np.zeros((many, 5))
    for node, (gas, area, loss_in, loss_out) in network.vessels.items():
        pressure = AMBIENT + DENSITY * GRAVITY * (heads[node] - network.elevations[node])
        losses = [loss / (2.0 * GRAVITY * area**2) for loss in (loss_in, loss_out)]
        vessels[node] = pressure, gas, *losses, network.elevations[node]
    places = np.array([first[k] + at * division for k, at in network.places], int)
    return characteristics(
        H,
        Q,
        first,
        rows,
        ends,
        dt,
        steps,
        network.head,
        drawn,
        opened,
        jumps,
        beyond,
        pairs,
        vessels,
        places,
    )


@numba.njit(cache=False, error_model="numpy")
def characteristics(
    H, Q, first, rows, ends, dt, steps, lake, drawn, opened, jumps, beyond, pairs, vessels, places
):
    """Extremes of heads of nodes (without the lake), flows into pipes, heads at places; closures; bends of `march`.

    H, Q : heads [m] and flows [m3/s] at all points of all pipes at the start; rows : impedance a / (g A), loss
    coefficient of a step and exponent, of each pipe; opened : Cd A sqrt(2 g) of valves at the nodes
    """
    count, many = len(rows), len(beyond)
    new_H, new_Q = H.copy(), Q.copy()
    total = many - 1 + count + len(places)
    found = np.empty((total, 2))
    found[:, 0], found[:, 1] = np.inf, -np.inf
    past, fresh, bends = np.zeros((total, 2)), np.zeros((total, 2), np.bool_), np.zeros((total, 2))
    effort, admittance, heads = np.zeros(many), np.zeros(many), np.zeros(many)
    through, volume, inflow = np.zeros(many), vessels[:, 1].copy(), np.zeros(many)
    is_open = np.ones(len(pairs), np.bool_)
    closures = 0
    for k in range(count):
        heads[ends[k, 0]], heads[ends[k, 1]] = H[first[k]], H[first[k + 1] - 1]
    record(found, past, fresh, bends, heads, H, Q, first, places, many, count)
    for step in range(1, steps + 1):
        effort[:], admittance[:] = 0.0, 0.0
        for k in range(count):
            B, R, n = rows[k]
            for i in range(first[k], first[k + 1] - 1):  # forward wave from i to i + 1
                new_H[i + 1] = H[i] + B * Q[i]
                new_Q[i + 1] = B + R * abs(Q[i]) ** (n - 1.0) if R > 0.0 else B
            for i in range(first[k] + 1, first[k + 1] - 1):
                back, slope = (
                    H[i + 1] - B * Q[i + 1],
                    B + (R * abs(Q[i + 1]) ** (n - 1.0) if R > 0.0 else 0.0),
                )
                flow = (new_H[i] - back) / (new_Q[i] + slope)
                new_H[i] = new_H[i] - new_Q[i] * flow
                new_Q[i] = flow
            i = first[k]
            back, slope = (
                H[i + 1] - B * Q[i + 1],
                B + (R * abs(Q[i + 1]) ** (n - 1.0) if R > 0.0 else 0.0),
            )
            new_H[i], new_Q[i] = back, slope  # of the end at `start`, until its node is known
            last = first[k + 1] - 1
            effort[ends[k, 0]] += back / slope
            admittance[ends[k, 0]] += 1.0 / slope
            effort[ends[k, 1]] += new_H[last] / new_Q[last]
            admittance[ends[k, 1]] += 1.0 / new_Q[last]
        for side in range(0 if jumps[step] else 1, 2):
            for node in range(1, many):
                Z = 1.0 / admittance[node]
                heads[node] = (effort[node] - drawn[side, step, node]) * Z
                flow = 0.0
                if opened[side, step, node] > 0.0:
                    flow = orifice(heads[node] - beyond[node], Z, opened[side, step, node])
                elif vessels[node, 1] > 0.0:
                    flow = vessel_flow(
                        heads[node], Z, vessels[node], volume[node], inflow[node], dt
                    )
                through[node] = flow
                heads[node] -= Z * flow
            heads[0] = lake
            for k in range(len(pairs)):
                before, behind = int(pairs[k, 0]), int(pairs[k, 1])
                drop = heads[before] - heads[behind]
                if is_open[k] and drop < 0.0:
                    closures += 1
                is_open[k] = drop > 0.0
                if is_open[k]:
                    flow = orifice(
                        drop, 1.0 / admittance[before] + 1.0 / admittance[behind], pairs[k, 2]
                    )
                    heads[before] -= flow / admittance[before]
                    heads[behind] += flow / admittance[behind]
            if side == 0:  # values before a jump
                for node in range(1, many):
                    found[node - 1, 0] = min(found[node - 1, 0], heads[node])
                    found[node - 1, 1] = max(found[node - 1, 1], heads[node])
        for node in range(1, many):
            if vessels[node, 1] > 0.0:
                volume[node] -= 0.5 * dt * (inflow[node] + through[node])
                inflow[node] = through[node]
        for k in range(count):
            i, last = first[k], first[k + 1] - 1
            new_Q[i] = (heads[ends[k, 0]] - new_H[i]) / new_Q[i]
            new_Q[last] = (new_H[last] - heads[ends[k, 1]]) / new_Q[last]
            new_H[i], new_H[last] = heads[ends[k, 0]], heads[ends[k, 1]]
        H, new_H = new_H, H
        Q, new_Q = new_Q, Q
        record(found, past, fresh, bends, heads, H, Q, first, places, many, count)
    return found, closures, bends


@numba.njit(cache=False, error_model="numpy")
def record(found, past, fresh, bends, heads, H, Q, first, places, many, count):
    """Update the extremes of all probes.

    past : last two values; fresh : True if the last value was a new extreme; bends : second difference around extremes
    """
    for j in range(many - 1 + count + len(places)):
        if j < many - 1:
            value = heads[j + 1]
        elif j < many - 1 + count:
            value = Q[first[j - many + 1]]
        else:
            value = H[places[j - many + 1 - count]]
        for side in range(2):
            if fresh[j, side]:
                bends[j, side] = abs(past[j, 1] - 2.0 * past[j, 0] + value)
            fresh[j, side] = value < found[j, side] if side == 0 else value > found[j, side]
            if fresh[j, side]:
                found[j, side], bends[j, side] = value, 0.0
        past[j, 1], past[j, 0] = past[j, 0], value


@numba.njit(cache=False, error_model="numpy")
def orifice(drop, Z, capacity):
    """Flow q with q |q| = capacity^2 (drop - Z q)."""
    c = capacity * capacity
    size = 2.0 * c * abs(drop) / (c * Z + math.sqrt(c * c * Z * Z + 4.0 * c * abs(drop)))
    return size if drop > 0.0 else -size


@numba.njit(cache=False, error_model="numpy")
def vessel_flow(head, Z, vessel, volume, before, dt):
    """Flow into a vessel of polytropic gas (exponent 1.2), by the trapezoidal rule for its volume."""
    pressure, start, loss_in, loss_out, elevation = vessel
    flow = before
    for _ in range(60):
        gas = volume - 0.5 * dt * (before + flow)
        p = pressure * (start / gas) ** 1.2
        loss = loss_in if flow > 0.0 else loss_out
        inside = (p - AMBIENT) / (DENSITY * GRAVITY) + elevation
        off = head - Z * flow - loss * flow * abs(flow) - inside
        slope = -Z - 2.0 * loss * abs(flow) - 0.6 * dt * p / gas / (DENSITY * GRAVITY)
        change = off / slope
        flow -= change
        if abs(change) < 1e-15 + 1e-13 * abs(flow):
            break
    return flow
