"""Method of characteristics with friction at Courant number 1, for the linear density law.

Along `dx/dt = +-a`, `d(P +- Z M)/dt = -+ a F(M)` with the friction gradient `F` [Pa/m]. The trapezoidal rule
integrates F and the new value is iterated, which gives second order. `richardson` extrapolates two solutions.
A network has a reservoir, junctions and a valve to a fixed pressure; its lengths are multiples of a reach. Its friction
is `k |M|^(n-1) M` [Pa/m]. The steady start is computed by the gradient method of Todini and Pilati (1988).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
GRAVITY = 9.80665


def darcy(factor: float, diameter: float, density: float) -> Callable[[Array], Array]:
    """Pressure gradient of a Darcy factor, `f rho v |v| / (2 D)` [Pa/m], from the mass flow [kg/s]."""
    area = math.pi / 4 * diameter**2
    k = factor / (2 * diameter * density * area**2)
    return lambda m: k * np.abs(m) * m


def laminar(viscosity: float, diameter: float, density: float) -> Callable[[Array], Array]:
    """Pressure gradient of Poiseuille's law, `32 mu v / D^2` [Pa/m], from the mass flow [kg/s]."""
    area = math.pi / 4 * diameter**2
    k = 32 * viscosity / (diameter**2 * density * area)
    return lambda m: k * np.asarray(m)


def hazen_williams(coefficient: float, diameter: float, density: float) -> Callable[[Array], Array]:
    """Pressure gradient of `v = 0.849 C R^0.63 S^0.54` [Pa/m], from the mass flow [kg/s]."""
    area = math.pi / 4 * diameter**2
    scale = 0.849 * coefficient * (diameter / 4) ** 0.63 * density * area
    return lambda m: density * GRAVITY * np.sign(m) * (np.abs(m) / scale) ** (1 / 0.54)


@dataclass(frozen=True)
class ValvePipe:
    """Reservoir, pipe and valve to a fixed pressure; `flow_area` is Cd A [m2] as a function of time."""

    length: float
    diameter: float
    wave_speed: float
    density: float
    gradient: Callable[[Array], Array]
    upstream: float
    outside: float
    flow_area: Callable[[float], float]

    def steady_mass_flow(self) -> float:
        """Mass flow at the start [kg/s], by bisection on the balance of the drops."""
        low, high = (
            0.0,
            self.flow_area(-1.0) * math.sqrt(2 * self.density * (self.upstream - self.outside)),
        )
        for _ in range(200):
            m = (low + high) / 2
            at_valve = self.upstream - self.length * float(self.gradient(np.float64(m)))
            most = self.flow_area(-1.0) * math.sqrt(
                2 * self.density * max(at_valve - self.outside, 0.0)
            )
            low, high = (m, high) if most > m else (low, m)
        return (low + high) / 2

    def valve_pressure(self, reaches: int, end: float) -> tuple[Array, Array]:
        """Times of the steps [s] and pressure before the valve at these times [Pa]."""
        z = self.wave_speed / (math.pi / 4 * self.diameter**2)
        dx = self.length / reaches
        dt, steps = dx / self.wave_speed, round(end * self.wave_speed / dx)
        m = np.full(reaches + 1, self.steady_mass_flow())
        p = self.upstream - self.gradient(m) * dx * np.arange(reaches + 1)
        m_new, p_new, found = m.copy(), p.copy(), np.empty(steps + 1)
        found[0] = p[-1]
        for n in range(1, steps + 1):
            force = self.gradient(m)
            plus = p[:-1] + z * m[:-1] - dx / 2 * force[:-1]  # arrives at points 1 ..
            minus = p[1:] - z * m[1:] + dx / 2 * force[1:]  # arrives at points 0 ..
            m_new[:] = m
            for _ in range(4):
                half = dx / 2 * self.gradient(m_new)
                m_new[1:-1] = (plus[:-1] - minus[1:] - 2 * half[1:-1]) / (2 * z)
                m_new[0] = (self.upstream - minus[0] - half[0]) / z
                m_new[-1], p_new[-1] = self._valve(plus[-1] - half[-1], z, n * dt)
            p_new[1:-1] = (plus[:-1] + minus[1:]) / 2
            p_new[0] = self.upstream
            m, m_new, p, p_new = m_new, m, p_new, p
            found[n] = p[-1]
        return dt * np.arange(steps + 1), found

    def _valve(self, incoming: float, z: float, t: float) -> tuple[float, float]:
        b = z * self.flow_area(t) * math.sqrt(2 * self.density)
        closed = incoming - self.outside
        root = (-b + math.sqrt(b * b + 4 * abs(closed))) / 2
        p = self.outside + math.copysign(root * root, closed)
        return (incoming - p) / z, p

    def richardson(self, reaches: int, end: float) -> tuple[Array, Array]:
        """Times and Richardson extrapolation from `reaches` and 2 `reaches`, at the steps of the coarser solution."""
        t, coarse = self.valve_pressure(reaches, end)
        _, fine = self.valve_pressure(2 * reaches, end)
        return t, (4 * fine[::2][: len(t)] - coarse) / 3


Array = np.ndarray


@dataclass(frozen=True)
class Line:
    """Pipe with start and end node, length [m], diameter [m] and friction coefficient k for the mass flow [kg/s]."""

    start: str
    end: str
    length: float
    diameter: float
    friction: float


@dataclass(frozen=True)
class Network:
    """Network with the pressure `supply` [Pa] at `reservoir`, and a valve to the pressure `outside` [Pa] at `gate`.

    All nodes have the same elevation.
    """

    lines: list[Line]
    exponent: float
    wave_speed: float
    density: float
    reservoir: str
    supply: float
    gate: str
    outside: float

    def steady(self, demand: float) -> tuple[dict[str, float], Array]:
        """Pressures of the nodes [Pa] and mass flows of the pipes [kg/s] for an outflow `demand` [kg/s] at the gate."""
        names = sorted({n for a in self.lines for n in (a.start, a.end)} - {self.reservoir})
        to = np.zeros((len(self.lines), len(names)))
        fixed = np.zeros(len(self.lines))
        for i, line in enumerate(self.lines):
            for sign, place in ((1.0, line.start), (-1.0, line.end)):
                if place == self.reservoir:
                    fixed[i] += sign * self.supply
                else:
                    to[i, names.index(place)] += sign
        k = np.array([a.friction * a.length for a in self.lines])
        taken = np.array([demand if n == self.gate else 0.0 for n in names])
        m = np.full(len(k), demand / 2)
        for _ in range(200):  # dp = k |m|^(n-1) m linearised about m; balance to' m = -taken
            slope = np.maximum(self.exponent * k * np.abs(m) ** (self.exponent - 1), 1e-12)
            rest = m - k * np.abs(m) ** (self.exponent - 1) * m / slope + fixed / slope
            p = np.linalg.solve((to.T / slope) @ to, -taken - to.T @ rest)
            new = rest + (to @ p) / slope
            done, m = np.max(np.abs(new - m)) < 1e-13 * demand, new
            if done:
                break
        return dict(zip(names, p, strict=True)), m

    def gate_pressure(
        self, demand: float, opening: Callable[[float], float], reach: float, end: float
    ):
        """Times [s] and pressure at the gate [Pa] for a valve that follows `opening` from t = 0.

        The start is steady with the outflow `demand` [kg/s].
        """
        pressures, flows = self.steady(demand)
        pressures[self.reservoir] = self.supply
        counts = [round(a.length / reach) for a in self.lines]
        first = np.concatenate([[0], np.cumsum([n + 1 for n in counts])])
        z, k, p, m = (np.empty(first[-1]) for _ in range(4))
        for i, a in enumerate(self.lines):
            here = slice(first[i], first[i + 1])
            z[here], k[here] = self.wave_speed / (math.pi / 4 * a.diameter**2), a.friction
            p[here] = np.linspace(pressures[a.start], pressures[a.end], counts[i] + 1)
            m[here] = flows[i]
        meets = {n: self._ends(n, first) for n in pressures}
        conductance = demand / math.sqrt(pressures[self.gate] - self.outside)
        steps, dt = round(end * self.wave_speed / reach), reach / self.wave_speed
        found, power = np.empty(steps + 1), self.exponent - 1
        found[0] = pressures[self.gate]
        half, plus, minus = k * reach / 2, np.empty_like(p), np.empty_like(p)
        for n in range(1, steps + 1):
            loss = half * np.abs(m) ** power * m
            plus[1:] = (p + z * m - loss)[:-1]  # characteristics from the left and from the right
            minus[:-1] = (p - z * m + loss)[1:]
            guess = m
            for _ in range(3):
                loss = half * np.abs(guess) ** power * guess
                m_new = (plus - minus - 2 * loss) / (2 * z)
                p_new = (plus + minus) / 2
                for place, (ins, outs) in meets.items():
                    brought = np.concatenate([plus[ins] - loss[ins], minus[outs] + loss[outs]])
                    admittance = 1 / np.concatenate([z[ins], z[outs]])
                    total = admittance.sum()
                    level = (admittance @ brought) / total
                    if place == self.reservoir:
                        level = self.supply
                    elif place == self.gate:
                        b = conductance * opening(n * dt) / total
                        closed = level - self.outside
                        root = (-b + math.sqrt(b * b + 4 * abs(closed))) / 2
                        level = self.outside + math.copysign(root * root, closed)
                    p_new[ins], p_new[outs] = level, level
                    m_new[ins] = (plus[ins] - loss[ins] - level) / z[ins]
                    m_new[outs] = (level - minus[outs] - loss[outs]) / z[outs]
                guess = m_new
            p, m = p_new, m_new
            found[n] = p[meets[self.gate][0][0]]
        return dt * np.arange(steps + 1), found

    def _ends(self, node: str, first: Array) -> tuple[list[int], list[int]]:
        """Indices of the points at which pipes end at a node, and at which pipes start there."""
        ins = [first[i + 1] - 1 for i, a in enumerate(self.lines) if a.end == node]
        return ins, [first[i] for i, a in enumerate(self.lines) if a.start == node]
