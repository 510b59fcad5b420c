"""Pipe between a reservoir and a changing demand, by its Laplace transform: laminar, or with wall creep.

With the Laplace variable s and x = R sqrt(s / nu), radius R and kinematic viscosity nu, the momentum of the laminar
profile is s M I0(x) / I2(x) = -A dp/dx (Zielke 1968): mass flow M, area A, modified Bessel functions I0 and I2. Waves
propagate over a distance d as exp(-G d), G = (s / a) sqrt(I0 / I2), wave speed a, with the impedance
Z = (a / A) sqrt(I0 / I2). If liquid and wall store C times their instantaneous storage, the roots are sqrt(C I0 / I2)
and sqrt(I0 / (C I2)). For a demand with jumps the response is the series of all reflections; each is inverted after its
pure delay exp(-s d / a) is split off (Talbot's contour). For a smooth demand the sum of all reflections is inverted
along a Bromwich line.

The storage of a wall of Kelvin-Voigt elements with compliance J [1/Pa] and retardation time tau [s], relative to the
instantaneous storage, is C(s) = 1 + sum of g / (1 + tau s), g = c D rho a^2 J / e (Covas et al. 2005): density rho,
diameter D, wall thickness e, restraint factor c.
"""

import math

import numpy as np

from fvsolve.exact.solution import (
    Exact,
    ExactStart,
    Solution,
    count_faults,
    fault,
    reservoirs,
    value,
)

LAMINAR = 2000.0  # largest Reynolds number that is certainly laminar
TALBOT = 24  # points of the contour: twelve digits for smooth functions
# of the Bromwich line: period / time span, and damping exponent of the next period
PERIOD, DAMPING = 2.5, 18.0
TAIL = 1e-10  # relative size at which the transform of a smooth demand is cut off


def laminar_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one laminar pipe with a demand at its end."""
    name, pipes = case.exact.name, list(case.links.items())
    yield from count_faults(case, pipes, "pipe")
    for node, part in case.nodes.items():
        if part.kind == "reservoir" and not (part.pressure or part.head).constant:
            yield fault(case, ("nodes", node), "needs a constant pressure")
        if part.kind == "junction" and part.demand.kind not in ("constant", "step", "smooth"):
            text = 'needs a demand that is constant, jumps or is "smooth"'
            yield fault(case, ("nodes", node, "demand"), text)
    for link, pipe in pipes:
        kinds = sorted(case.nodes[end].kind for end in (pipe.from_, pipe.to))
        if kinds != ["junction", "reservoir"]:
            text = "needs a reservoir at one end and a junction at the other end"
            yield fault(case, ("links", link), text)
            continue
        if pipe.creep_elements and name == "laminar-line":
            yield fault(
                case, ("links", link, "wall", "creep"), "holds only for walls without creep"
            )
        law = pipe.friction
        if (
            law.model != "unsteady"
            or law.weighting == "vardy-brown"
            or law.roughness is None
            or pipe.minor_loss
        ):
            other = ' (or model = "none")' if name == "creeping-line" else ""
            text = 'needs friction with model = "unsteady", `roughness` instead of `factor`, and `weighting` "zielke" '
            yield fault(
                case, ("links", link, "friction"), f"{text}or left out{other}, and no `minor_loss`"
            )
        elif case.properties.viscosity is None:
            yield ("fluid",), f'viscosity is missing; the exact solution "{name}" needs it'
        elif reynolds(case, pipe) >= LAMINAR:
            text = (
                f"is laminar, but the demand reaches the Reynolds number {reynolds(case, pipe):.0f}"
            )
            yield fault(case, ("links", link, "friction"), f"{text}; expected below {LAMINAR:g}")


def creep_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one pipe with wall creep and a demand."""
    for keys, text in laminar_faults(case):
        link = case.links[keys[1]] if keys[0] == "links" and len(keys) > 2 else None
        if (
            link is None
            or keys[2] != "friction"
            or link.friction.model != "none"
            or link.minor_loss
        ):
            yield keys, text
    for link, pipe in case.links.items():
        if not pipe.creep_elements:
            yield fault(case, ("links", link, "wall"), "needs a wall with creep")


def reynolds(case, pipe) -> float:
    """Reynolds number of the greatest possible flow: the greatest demand plus its range, which reflections may add."""
    demand = next(
        case.nodes[end].demand
        for end in (pipe.from_, pipe.to)
        if case.nodes[end].kind == "junction"
    )
    flow = float(np.max(np.abs(demand.value)) + np.ptp(demand.value))
    return (
        4.0 * flow * case.properties.density / (math.pi * pipe.diameter * case.properties.viscosity)
    )


def solution(case, start: ExactStart) -> Solution:
    """Pressures [Pa] and flows [m3/s] along the only pipe of a case, as functions of time."""
    [(name, pipe)] = case.links.items()
    line = LineDeviation(case, pipe)
    drop = start.pressure[pipe.to] - start.pressure[pipe.from_]
    flow = start.flow[name]

    def along(_, x, t):
        x, t = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(t, dtype=float))
        p, m = line.waves(pipe.length - x if line.reversed else x, t)
        m = -m if line.reversed else m
        return start.pressure[
            pipe.from_
        ] + drop * x / pipe.length + p, flow + m / case.properties.density

    end = 0.0 if line.reversed else pipe.length
    pressures = reservoirs(case) | {line.gate: lambda t: along(name, end, t)[0]}
    return Solution(case, pressure=pressures, pipe=along, kinks=lambda _, t: line.fronts(t))


class LineDeviation:
    """Deviations of pressure and flow from the start along a pipe. Distances x are from the reservoir [m]."""

    def __init__(self, case, pipe) -> None:
        self.reversed = case.nodes[pipe.to].kind == "reservoir"
        self.gate = pipe.from_ if self.reversed else pipe.to
        self.demand, self.rho, self.t0 = (
            case.nodes[self.gate].demand,
            case.properties.density,
            case.numerics.start,
        )
        self.end, self.length, self.a = (
            case.numerics.end,
            pipe.length,
            case.wave_speed(next(iter(case.links))),
        )
        self.area, self.viscosity = math.pi / 4.0 * pipe.diameter**2, case.properties.viscosity
        self.scale = 0.25 * pipe.diameter**2 * self.rho / (self.viscosity or 1.0)  # R^2 / nu [s]
        self.plug_flow = pipe.friction.model == "none"
        self.elements = [
            (growth * self.rho * self.a**2, time) for growth, time in pipe.creep_elements
        ]

    def waves(self, x, t):
        """Deviations of pressure [Pa] and mass flow [kg/s] at distances x [m] and times t [s].

        x, t and both results are arrays of one shape.
        """
        t = np.minimum(t, self.end)
        if self.demand.kind == "smooth":
            return self._smooth_response(x, t)
        return self._jump_response(x, t)

    def fronts(self, t: float) -> np.ndarray:
        """Distances [m] from the `from` end of the pipe to the wave fronts of all demand jumps, at time t [s]."""
        if self.demand.kind != "step":
            return np.zeros(0)
        places = []
        for when, _ in self._demand_jumps():
            place = (t - when) * self.a % (4.0 * self.length)
            back = [
                self.length - place,
                place - self.length,
                3.0 * self.length - place,
                place - 3.0 * self.length,
            ]
            places += [x for x in back if t > when and 0.0 <= x <= self.length]
        places = np.array(places)
        return self.length - places if self.reversed else places

    def _demand_jumps(self):
        """Yield (time [s], change of the mass flow [kg/s]) for each jump of the demand from the start on."""
        times, values = self.demand.time, self.demand.value
        for k in range(1, len(times)):
            if times[k] >= self.t0:
                yield float(times[k]), self.rho * float(values[k] - values[k - 1])

    def storage_ratio(self, s):
        """Storage C(s) of liquid and wall relative to their instantaneous storage [-]: 1 for an elastic wall.

        s : Laplace variable [1/s]
        """
        if not self.elements:
            return 1.0
        total = np.ones(np.shape(s), dtype=complex)
        for share, time in self.elements:
            total = total + share / (1.0 + time * s)
        return total

    def ratio(self, s):
        """Inertia of the laminar profile relative to plug flow, I0(x) / I2(x) with x = R sqrt(s / nu) [-].

        It is 1 for a pipe without friction.
        s : Laplace variable [1/s]; R : radius of the pipe; nu : kinematic viscosity; I0, I2 : modified Bessel functions
        """
        if self.plug_flow:
            return np.ones(np.shape(s), dtype=complex)
        from scipy.special import ive

        x = np.sqrt(s * self.scale)
        return ive(0, x) / ive(2, x)

    # jumps: sum of reflections ---------------------------------------------------------------------------------------

    def _jump_response(self, x, t):
        p, m = np.zeros(x.shape), np.zeros(x.shape)
        for when, change in self._demand_jumps() if self.demand.kind == "step" else ():
            age = t - when
            for k in range(
                1 + int(max(0.0, np.max(age, initial=0.0)) * self.a / (2.0 * self.length))
            ):
                for sign, d in (
                    (1.0, (2 * k + 1) * self.length - x),
                    (-1.0, (2 * k + 1) * self.length + x),
                ):
                    wave_p, wave_m = self._unit_jump(d, age - d / self.a)
                    p -= (-1) ** k * sign * change * wave_p
                    m += (-1) ** k * change * wave_m
        return p, m

    def _unit_jump(self, d, after):
        """(pressure [Pa], mass flow [kg/s]) of a single wave from a jump of 1 kg/s, at the travelled distance d [m].

        after : time since the front of the wave passed [s]. The Laplace transform is inverted along a fixed Talbot
        contour.
        """
        here = after > 0.0
        p, m = np.zeros(d.shape), np.zeros(d.shape)
        if not here.any():
            return p, m
        d, tau = d[here], after[here]
        theta = np.arange(1, TALBOT) * (math.pi / TALBOT)
        cot = 1.0 / np.tan(theta)
        node = np.concatenate([[1.0 + 0.0j], theta * (cot + 1j)]) * (0.4 * TALBOT)  # s tau
        weight = (
            np.concatenate([[0.5 + 0.0j], 1.0 + 1j * (theta + (theta * cot - 1.0) * cot)])
            * np.exp(node)
            * 0.4
        )
        for s, w in zip(node, weight, strict=True):
            inertia, storage = self.ratio(s / tau), self.storage_ratio(s / tau)
            ratio = inertia * storage
            root = np.sqrt(ratio)
            # without the pure delay
            slow = np.exp(-(s / tau) * (d / self.a) * (ratio - 1.0) / (root + 1.0))
            m[here] += (w / s * slow).real
            p[here] += (w / s * slow * root / storage).real * (self.a / self.area)
        return p, m

    # smooth: Bromwich integral ---------------------------------------------------------------------------------------

    def _smooth_response(self, x, t):
        s, input_, step = self._input()
        storage = self.storage_ratio(s)
        root = np.sqrt(self.ratio(s) * storage)
        gamma, far = s / self.a * root, np.exp(-2.0 * s / self.a * root * self.length)
        p, m = np.empty(x.size), np.empty(x.size)
        for k, (place, age) in enumerate(zip(np.ravel(x), np.ravel(t) - self.t0, strict=True)):
            first = np.exp(-gamma * (self.length - place))
            second = np.exp(-gamma * (self.length + place))
            turn = np.exp(s * age) * input_ / (1.0 + far)
            p[k] = (
                -(step / math.pi)
                * np.sum((turn * (first - second) * root / storage).real)
                * self.a
                / self.area
            )
            m[k] = (step / math.pi) * np.sum((turn * (first + second)).real)
        return p.reshape(x.shape), m.reshape(x.shape)

    def _input(self):
        """(points s of the Bromwich line, Laplace transform of the change of mass flow there, step of Im s)."""
        if not hasattr(self, "_bromwich_line"):
            span = self.end - self.t0
            step = 2.0 * math.pi / (PERIOD * span)
            count = 512
            while True:
                s = DAMPING / (PERIOD * span) + 1j * step * np.arange(count)
                transform = self._transform(s)
                if (
                    np.max(np.abs(transform[-count // 4 :])) <= TAIL * np.abs(transform[0])
                    or count >= 65536
                ):
                    break
                count *= 2
            transform[0] *= 0.5
            self._bromwich_line = s, transform, step
        return self._bromwich_line

    def _transform(self, s):
        """Laplace transform of the change of mass flow: integral of its slope times exp(-s t) dt, divided by s."""
        times = self.demand.time
        places, weights = np.polynomial.legendre.leggauss(4)
        width, middle = np.diff(times), 0.5 * (times[1:] + times[:-1])
        t = (middle[:, None] + 0.5 * width[:, None] * places).ravel()
        w = (0.5 * width[:, None] * weights).ravel()
        hair = 0.05 * np.repeat(width, places.size)  # four values give the exact slope of a cubic
        slope = (
            8.0 * (self._flow(t + 0.5 * hair) - self._flow(t - 0.5 * hair))
            - (self._flow(t + hair) - self._flow(t - hair))
        ) / (6.0 * hair)
        nonzero = np.flatnonzero(slope)
        result = np.zeros(s.size, dtype=complex)
        for i in nonzero:
            result += (w[i] * slope[i]) * np.exp(-s * (t[i] - self.t0))
        return result / s

    def _flow(self, t):
        return self.rho * value(self.demand, t)


LAMINAR_LINE = Exact("laminar-line", ("reservoir", "junction"), ("pipe",), laminar_faults, solution)
CREEPING_LINE = Exact("creeping-line", ("reservoir", "junction"), ("pipe",), creep_faults, solution)
