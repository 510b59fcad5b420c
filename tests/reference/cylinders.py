"""Hydraulic cylinder with its load, integrated by SciPy with pressures as states and independent of fvsolve."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import quad, solve_ivp

AMBIENT, RHO, BETA, MU = 101325.0, 870.0, 1.2e9, 0.028


def valve_flow(
    area: float, share: float, p_up: float, p_down: float, rho: float, coefficient: float = 0.61
) -> float:
    """Mass flow [kg/s], q = share Cd A sqrt(2 dp / rho); in transition flow the polynomial of docs/parts/valve.md.

    Transition flow is below Reynolds number 10 of the full area.
    """
    size = 2.0 * rho * (coefficient * area * share) ** 2 * abs(p_up - p_down)
    slow = 10.0 * math.pi / 4.0 * math.sqrt(4.0 * area / math.pi) * MU
    x = size / slow**2
    flow = math.sqrt(size) if x >= 1.0 else slow * x * (45.0 - 18.0 * x**2 + 5.0 * x**4) / 32.0
    return math.copysign(flow, p_up - p_down)


@dataclass
class Jack:
    """Cylinder between a frame at 0 and a mass, with spring, damper, force and leak, in SI units.

    law : `linear` or `log`
    """

    law: str = "log"
    mass: float = 20.0
    areas: tuple[float, float] = (12e-4, 8e-4)
    dead: tuple[float, float] = (6e-5, 5e-5)
    stroke: float = 0.2
    x: float = 0.1
    v: float = 0.0
    pressures: tuple[float, float] = (AMBIENT, AMBIENT)
    leakage: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    free: float = 0.0
    damping: float = 0.0
    extra: dict = field(default_factory=dict)  # further keys of the cylinder

    def volumes(self, x: float) -> tuple[float, float]:
        return self.dead[0] + self.areas[0] * x, self.dead[1] + self.areas[1] * (self.stroke - x)

    def density(self, p: float) -> float:
        return RHO * math.exp((p - AMBIENT) / BETA) if self.law == "log" else RHO

    def hydraulic_spring(self) -> float:
        """Stiffness k_h = A_A^2 beta / V_A + A_B^2 beta / V_B [N/m]."""
        return sum(a**2 * BETA / v for a, v in zip(self.areas, self.volumes(self.x), strict=True))

    def thrust(self, p_a: float, p_b: float) -> float:
        return self.areas[0] * (p_a - AMBIENT) - self.areas[1] * (p_b - AMBIENT)

    def rates(self, t, y, flows, push):
        """Rates of (p_A, p_B, x, v).

        flows(t, p_A, p_B) : mass flows into A and B [kg/s]; push(t, x, v) : further forces [N]
        """
        p_a, p_b, x, v = y
        volumes = self.volumes(x)
        leak = self.leakage * (p_a - p_b) * self.density(max(p_a, p_b))
        into = [m + side * leak for m, side in zip(flows(t, p_a, p_b), (-1, 1), strict=True)]
        squeeze = (
            [1.0, 1.0] if self.law == "log" else [1.0 + (p - AMBIENT) / BETA for p in (p_a, p_b)]
        )
        swept = (self.areas[0] * v, -self.areas[1] * v)
        rise = [
            BETA / volumes[i] * (into[i] / self.density((p_a, p_b)[i]) - squeeze[i] * swept[i])
            for i in (0, 1)
        ]
        force = (
            self.thrust(p_a, p_b)
            - self.friction * v
            - self.stiffness * (x - self.free)
            - self.damping * v
        )
        return [*rise, v, (force + push(t, x, v)) / self.mass]

    def trajectory(
        self, times, flows=lambda t, a, b: (0.0, 0.0), push=lambda t, x, v: 0.0, breaks=()
    ):
        """(p_A, p_B, x, v) at times : float64[4, n], by SciPy's DOP853 with rtol 1e-12, restarted at `breaks`.

        The steps are short, because longer steps jump over the short laminar flow of an edge that opens.
        """
        y = np.array([*self.pressures, self.x, self.v])
        found, edges = np.empty((4, len(times))), [times[0], *breaks, times[-1]]
        for low, high in zip(edges, edges[1:], strict=False):
            run = solve_ivp(
                self.rates,
                (low, high),
                y,
                "DOP853",
                args=(flows, push),
                rtol=1e-12,
                dense_output=True,
                atol=[1e-4, 1e-4, 1e-14, 1e-12],
                max_step=(times[-1] - times[0]) / 3000,
            )
            inside = (times >= low) & (times <= high)
            found[:, inside] = run.sol(times[inside])
            y = run.y[:, -1]
        return found

    def closed_period(self) -> tuple[float, float, float]:
        """Period [s], least and greatest x [m] of free swings with shut ports under the law `log`.

        T = 2 int dx / sqrt(2 (W(x) + E0) / m). W is the integral in closed form of the force of both chambers,
        A_A (p_A0 - beta ln(V_A / V_A0) - p_amb) for chamber A.
        """
        volumes = self.volumes(self.x)

        def work(x: float) -> float:
            total = self.thrust(*self.pressures) * (x - self.x)
            for a, v0, sign in zip(self.areas, volumes, (1, -1), strict=True):
                r = sign * a * (x - self.x) / v0
                total -= BETA * v0 * ((1 + r) * math.log1p(r) - r)
            return total

        energy = 0.5 * self.mass * self.v**2
        low, high = (self._turn(work, energy, side) for side in (-1.0, 1.0))
        middle, half = 0.5 * (low + high), 0.5 * (high - low)

        def speed_part(angle: float) -> float:
            x = middle + half * math.sin(angle)
            return (
                half
                * math.cos(angle)
                / math.sqrt(max(2.0 * (work(x) + energy) / self.mass, 1e-300))
            )

        edge = math.pi / 2
        return 2.0 * quad(speed_part, -edge, edge, epsabs=0, epsrel=1e-12, limit=200)[0], low, high

    def _turn(self, work, energy: float, side: float) -> float:
        from scipy.optimize import brentq

        reach = 1e-7
        while work(self.x + side * reach) + energy > 0.0:
            reach *= 1.5
        return brentq(
            lambda x: work(x) + energy,
            self.x + side * reach / 1.5,
            self.x + side * reach,
            xtol=1e-17,
        )

    def fluid_energy(self, x, p_a, p_b):
        """Energy V (beta (exp(p / beta) - 1) - p) of both chambers, p above ambient [J] (design.md, Ledgers)."""
        total = 0.0
        for v, p in zip(self.volumes(x), (p_a - AMBIENT, p_b - AMBIENT), strict=True):
            total = total + v * (BETA * np.expm1(p / BETA) - p)
        return total

    def nodes(self) -> dict:
        return {
            "ground": {"type": "frame"},
            "load": {
                "type": "mass",
                "mass": self.mass,
                "initial_position": self.x,
                "initial_velocity": self.v,
            },
        }

    def links(self) -> dict:
        found = {
            "cyl": {
                "type": "cylinder",
                "ports": {"rod": "load", "case": "ground"},
                "stroke": self.stroke,
                "area_A": self.areas[0],
                "area_B": self.areas[1],
                "dead_volume_A": self.dead[0],
                "dead_volume_B": self.dead[1],
                "initial_pressure_A": self.pressures[0],
                "initial_pressure_B": self.pressures[1],
                "leakage": self.leakage,
                "viscous_friction": self.friction,
                **self.extra,
            }
        }
        if self.stiffness:
            found["spring"] = {
                "type": "spring",
                "from": "ground",
                "to": "load",
                "stiffness": self.stiffness,
                "free_length": self.free,
            }
        if self.damping:
            found["damper"] = {
                "type": "damper",
                "from": "ground",
                "to": "load",
                "damping": self.damping,
            }
        return found

    def fluid(self) -> dict:
        return {
            "name": "user",
            "density": RHO,
            "bulk_modulus": BETA,
            "viscosity": MU,
            "vapor_pressure": 1.0,
            "law": self.law,
            "pressure": AMBIENT,
        }
