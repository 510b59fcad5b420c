"""Cases with bodies in space, in SI units."""

from __future__ import annotations

import math
from typing import Any

from reference.scenes import AMBIENT, GRAVITY, scene
from reference.trees import body

OIL = {"name": "user", "density": 870.0, "bulk_modulus": 1.2e9, "viscosity": 0.028, "vapor_pressure": 100.0}
CLOSE = {"method": "dormand-prince", "rtol": 1e-10}


def bodies(nodes: dict, end: float, probes=(), links: dict | None = None, every: float = 0.01, **more: Any) -> dict:
    """Case of bodies; `more` are keys of `numerics`."""
    return scene(nodes, links or {}, end, more or CLOSE, probes, every)


def pendulum(angle: float = 1.0, length: float = 0.7, mass: float = 2.0, **joint: Any) -> dict:
    """Point mass on a massless rod that turns about y; the rod hangs vertically at angle 0."""
    hinge = {"kind": "revolute", "axis": [0, 1, 0], "angle": angle, **joint}
    return body(mass, [0, 0, 0], hinge, centre_of_mass=[0, 0, -length], points={"bob": [0, 0, -length]})


class Crane:
    """Boom of mass m and length L, supported near its pivot by a cylinder from below.

    The boom is horizontal at angle 0, and a positive angle lifts it.
    """

    mass, length, gyration = 120.0, 1.0, 10.0
    areas, dead, stroke, x = (1e-3, 6e-4), (1e-4, 1e-4), 0.3, 0.1
    low, eye = -0.25, 0.25
    p_b = AMBIENT + 5e5

    @property
    def distance(self) -> float:
        return math.hypot(self.low, self.eye)

    @property
    def lever(self) -> float:
        return self.eye * -self.low / self.distance

    @property
    def inertia(self) -> float:
        return self.gyration + self.mass * self.length**2 / 4.0

    @property
    def p_a(self) -> float:
        """Pressure in chamber A that supports the boom [Pa]."""
        force = self.mass * GRAVITY * self.length / 2.0 / self.lever
        return AMBIENT + (force + self.areas[1] * (self.p_b - AMBIENT)) / self.areas[0]

    def spring(self, law: str = "log") -> float:
        """Stiffness of the fluid in both chambers [N/m].

        Under the law `linear`, dp = -(beta + p') dV / V in a closed volume, with p' the gauge pressure.
        """
        volumes = self.dead[0] + self.areas[0] * self.x, self.dead[1] + self.areas[1] * (self.stroke - self.x)
        beta, total = OIL["bulk_modulus"], 0.0
        for area, volume, pressure in zip(self.areas, volumes, (self.p_a, self.p_b), strict=True):
            total += area**2 / volume * (beta + (pressure - AMBIENT if law == "linear" else 0.0))
        return total

    def nodes(self, **joint: Any) -> dict:
        hinge = {"kind": "revolute", "axis": [0, -1, 0], **joint}
        boom = body(self.mass, [1.0, self.gyration, self.gyration], hinge, centre_of_mass=[self.length / 2, 0, 0],
                    points={"eye": [self.eye, 0, 0], "tip": [self.length, 0, 0]})  # fmt: skip
        return {"boom": boom, "ground": {"type": "frame", "points": {"lug": [0, 0, self.low]}}}

    def links(self, **more: Any) -> dict:
        cylinder = {
            "type": "cylinder", "ports": {"case": "ground.lug", "rod": "boom.eye"}, "stroke": self.stroke,
            "closed_length": self.distance - self.x, "area_A": self.areas[0], "area_B": self.areas[1],
            "dead_volume_A": self.dead[0], "dead_volume_B": self.dead[1],
            "initial_pressure_A": self.p_a, "initial_pressure_B": self.p_b,
        }  # fmt: skip
        return {"lift": {**cylinder, **more}}

    def case(self, end: float, probes=(), law: str = "linear", every: float = 0.01, joint=None, cylinder=None, **more):
        return scene(self.nodes(**(joint or {})), self.links(**(cylinder or {})), end, more or CLOSE, probes, every,
                     fluid={**OIL, "law": law})  # fmt: skip
