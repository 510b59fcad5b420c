"""One laminar pipe between a reservoir and a changing demand, friction and all. Knows the exact profile of velocity.

With the Laplace variable s and x = R sqrt(s / nu), momentum over the laminar profile is s M (I0(x) / I2(x)) = -A dp/dx
(Zielke 1968), so waves run as exp(-G d), G = (s / a) sqrt(I0 / I2), with impedance Z = (a / A) sqrt(I0 / I2); where
liquid and wall take up C times what they do at once, sqrt(C I0 / I2) and sqrt(I0 / (C I2)) stand for these. A demand
that jumps is answered by the series of all reflections, each inverted by itself once its pure delay exp(-s d / a) is
split off (Talbot's contour); one that is smooth, by the whole tanh along a Bromwich line.
"""

from __future__ import annotations

import math

import numpy as np

from fvsolve.exact.schedule import value
from fvsolve.exact.solution import ExactStart, Solution, only_one, reservoirs

NODES, LINKS = ("reservoir", "junction"), ("pipe",)
LAMINAR = 2000.0  # greatest Reynolds number that is laminar for sure
TALBOT = 24  # points of the contour: twelve digits of smooth functions
PERIOD, DAMPING = 2.5, 18.0  # of the Bromwich line: period over the last time, and what it damps the next one by
TAIL = 1e-10  # of the transform of a smooth demand, relative, behind which it is cut off


def misfits(case):
    """What makes a case none of one laminar line with a demand at its end."""
    name, pipes = case.exact.name, list(case.links.items())
    yield from only_one(case, pipes, "pipe")
    for node, part in case.nodes.items():
        if part.kind == "reservoir" and not (part.pressure or part.head).constant:
            yield ("nodes", node), f'the exact solution "{name}" wants a constant pressure'
        if part.kind == "junction" and part.demand.kind not in ("constant", "step", "smooth"):
            yield ("nodes", node, "demand"), f'the exact solution "{name}" wants a demand that jumps or is "smooth"'
    for link, pipe in pipes:
        kinds = sorted(case.nodes[end].kind for end in (pipe.from_, pipe.to))
        if kinds != ["junction", "reservoir"]:
            yield (
                ("links", link),
                f'the exact solution "{name}" wants a reservoir at one end and a junction at the other',
            )
            continue
        if pipe.yielding and name == "laminar-line":
            yield ("links", link, "wall", "creep"), f'the exact solution "{name}" holds for walls that do not creep'
        law = pipe.friction
        if law.model != "unsteady" or law.weighting == "vardy-brown" or law.roughness is None or pipe.minor_loss:
            message = f'the exact solution "{name}" wants "unsteady" friction by roughness, laminar, and no minor loss'
            yield ("links", link, "friction"), message
        elif case.properties.viscosity is None:
            yield ("fluid",), f'viscosity is missing, which the exact solution "{name}" hangs on'
        elif reynolds(case, pipe) >= LAMINAR:
            message = f'the exact solution "{name}" is laminar; the demand asks for Reynolds {reynolds(case, pipe):.0f}'
            yield ("links", link, "friction"), message


def reynolds(case, pipe) -> float:
    """Greatest Reynolds number of the demand, and of what comes back from the reservoir."""
    demand = next(case.nodes[end].demand for end in (pipe.from_, pipe.to) if case.nodes[end].kind == "junction")
    flow = float(np.max(np.abs(demand.value)) + np.ptp(demand.value))
    return 4.0 * flow * case.properties.density / (math.pi * pipe.diameter * case.properties.viscosity)


def solution(case, start: ExactStart) -> Solution:
    """Pressures and flows along the line of a case that `misfits` finds nothing in."""
    [(name, pipe)] = case.links.items()
    return of_line(case, start, LineDeviation(case, pipe))


def of_line(case, start: ExactStart, line: LineDeviation) -> Solution:
    """Pressures and flows of a case of one line, from its deviations."""
    [(name, pipe)] = case.links.items()
    drop = start.pressure[pipe.to] - start.pressure[pipe.from_]
    flow = start.flow[name]

    def along(_, x, t):
        x, t = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(t, dtype=float))
        p, m = line.waves(pipe.length - x if line.reversed else x, t)
        m = -m if line.reversed else m
        return start.pressure[pipe.from_] + drop * x / pipe.length + p, flow + m / case.properties.density

    end = 0.0 if line.reversed else pipe.length
    pressures = reservoirs(case) | {line.gate: lambda t: along(name, end, t)[0]}
    return Solution(case, pressure=pressures, pipe=along, kinks=lambda _, t: line.fronts(t))


class LineDeviation:
    """Deviations from the start along a pipe, x counted from the reservoir."""

    def __init__(self, case, pipe) -> None:
        self.reversed = case.nodes[pipe.to].kind == "reservoir"
        self.gate = pipe.from_ if self.reversed else pipe.to
        self.demand, self.rho, self.t0 = case.nodes[self.gate].demand, case.properties.density, case.numerics.start
        self.end, self.length, self.a = case.numerics.end, pipe.length, case.wave_speed(case_name(case))
        self.area, self.viscosity = math.pi / 4.0 * pipe.diameter**2, case.properties.viscosity
        self.scale = 0.25 * pipe.diameter**2 * self.rho / (self.viscosity or 1.0)  # R^2 / nu [s]

    def waves(self, x, t):
        """(pressure [Pa], mass flow [kg/s]) at distances x and times t, one array each."""
        t = np.minimum(t, self.end)
        if self.demand.kind == "smooth":
            return self._smooth(x, t)
        return self._jumps(x, t)

    def fronts(self, t: float) -> np.ndarray:
        """Distances from `from` of the fronts of all jumps at time t [m]."""
        if self.demand.kind != "step":
            return np.zeros(0)
        found = []
        for when, _ in self._steps():
            place = (t - when) * self.a % (4.0 * self.length)
            back = [self.length - place, place - self.length, 3.0 * self.length - place, place - 3.0 * self.length]
            found += [one for one in back if t > when and 0.0 <= one <= self.length]
        found = np.array(found)
        return self.length - found if self.reversed else found

    def _steps(self):
        """(time, change of mass flow into the demand) of every jump after the start."""
        times, values = self.demand.time, self.demand.value
        for k in range(1, len(times)):
            if times[k] >= self.t0:
                yield float(times[k]), self.rho * float(values[k] - values[k - 1])

    def swelling(self, s):
        """What liquid and wall take up with pressure over what they do at once."""
        return 1.0

    def ratio(self, s):
        """Inertia of the flow over that of a plug: I0(x) / I2(x), x = R sqrt(s / nu)."""
        from scipy.special import ive

        x = np.sqrt(s * self.scale)
        return ive(0, x) / ive(2, x)

    # jumps: reflection by reflection -----------------------------------------------------------------------------

    def _jumps(self, x, t):
        p, m = np.zeros(x.shape), np.zeros(x.shape)
        for when, change in self._steps() if self.demand.kind == "step" else ():
            age = t - when
            for k in range(1 + int(max(0.0, np.max(age, initial=0.0)) * self.a / (2.0 * self.length))):
                for sign, d in ((1.0, (2 * k + 1) * self.length - x), (-1.0, (2 * k + 1) * self.length + x)):
                    wave_p, wave_m = self._arrived(d, age - d / self.a)
                    p -= (-1) ** k * sign * change * wave_p
                    m += (-1) ** k * change * wave_m
        return p, m

    def _arrived(self, d, after):
        """(pressure, flow) of a unit jump that has run d, a time `after` its front, by a fixed Talbot contour."""
        here = after > 0.0
        p, m = np.zeros(d.shape), np.zeros(d.shape)
        if not here.any():
            return p, m
        d, tau = d[here], after[here]
        theta = np.arange(1, TALBOT) * (math.pi / TALBOT)
        cot = 1.0 / np.tan(theta)
        node = np.concatenate([[1.0 + 0.0j], theta * (cot + 1j)]) * (0.4 * TALBOT)  # s tau
        weight = np.concatenate([[0.5 + 0.0j], 1.0 + 1j * (theta + (theta * cot - 1.0) * cot)]) * np.exp(node) * 0.4
        for s, w in zip(node, weight, strict=True):
            inertia, swelling = self.ratio(s / tau), self.swelling(s / tau)
            ratio = inertia * swelling
            root = np.sqrt(ratio)
            slow = np.exp(-(s / tau) * (d / self.a) * (ratio - 1.0) / (root + 1.0))  # without the pure delay
            m[here] += (w / s * slow).real
            p[here] += (w / s * slow * root / swelling).real * (self.a / self.area)
        return p, m

    # smooth: all at once -------------------------------------------------------------------------------------------

    def _smooth(self, x, t):
        s, input_, step = self._input()
        swelling = self.swelling(s)
        root = np.sqrt(self.ratio(s) * swelling)
        gamma, far = s / self.a * root, np.exp(-2.0 * s / self.a * root * self.length)
        p, m = np.empty(x.size), np.empty(x.size)
        for k, (place, age) in enumerate(zip(np.ravel(x), np.ravel(t) - self.t0, strict=True)):
            first, second = np.exp(-gamma * (self.length - place)), np.exp(-gamma * (self.length + place))
            turn = np.exp(s * age) * input_ / (1.0 + far)
            p[k] = -(step / math.pi) * np.sum((turn * (first - second) * root / swelling).real) * self.a / self.area
            m[k] = (step / math.pi) * np.sum((turn * (first + second)).real)
        return p.reshape(x.shape), m.reshape(x.shape)

    def _input(self):
        """(s, transform of the change of mass flow there, step of s) along the Bromwich line."""
        if not hasattr(self, "_line"):
            span = self.end - self.t0
            step = 2.0 * math.pi / (PERIOD * span)
            count = 512
            while True:
                s = DAMPING / (PERIOD * span) + 1j * step * np.arange(count)
                found = self._transform(s)
                if np.max(np.abs(found[-count // 4 :])) <= TAIL * np.abs(found[0]) or count >= 65536:
                    break
                count *= 2
            found[0] *= 0.5
            self._line = s, found, step
        return self._line

    def _transform(self, s):
        """Integral of the demand's slope times exp(-s t), over s, by Gauss points between its entries."""
        times = self.demand.time
        places, weights = np.polynomial.legendre.leggauss(4)
        width, middle = np.diff(times), 0.5 * (times[1:] + times[:-1])
        t = (middle[:, None] + 0.5 * width[:, None] * places).ravel()
        w = (0.5 * width[:, None] * weights).ravel()
        hair = 0.05 * np.repeat(width, places.size)  # a cubic's slope by four values of it
        slope = (8.0 * (self._flow(t + 0.5 * hair) - self._flow(t - 0.5 * hair))
                 - (self._flow(t + hair) - self._flow(t - hair))) / (6.0 * hair)  # fmt: skip
        kept = np.flatnonzero(slope)
        found = np.zeros(s.size, dtype=complex)
        for i in kept:
            found += (w[i] * slope[i]) * np.exp(-s * (t[i] - self.t0))
        return found / s

    def _flow(self, t):
        return self.rho * value(self.demand, t)


def case_name(case) -> str:
    """The one link of a case."""
    return next(iter(case.links))
