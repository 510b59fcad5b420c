"""Mass on linear springs and dampers between frames, under a constant force.

m u'' = F - k u - c u': mass m, displacement u from the start, force F at the start without damping, stiffness k of all
springs, damping c of all dampers.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from fvsolve.exact.schedule_values import constant_from
from fvsolve.exact.solution import ExactStart, Solution, count_faults

NODES, LINKS = ("mass", "frame", "reservoir"), ("spring", "damper", "force")


def find_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one mass on springs and dampers."""
    yield from count_faults(case, [node for node in case.nodes.values() if node.kind == "mass"], "mass")
    if not any(link.kind == "spring" for link in case.links.values()):
        yield ("links",), f'the exact solution "{case.exact.name}" needs a spring'
    for name, link in case.links.items():
        if not any(end is not None and case.nodes[end].kind == "mass" for end in (link.from_, link.to)):
            yield ("links", name), f'the exact solution "{case.exact.name}" supports only links that join the mass'
        if link.kind == "force" and not constant_from(link.force, -math.inf):
            yield ("links", name, "force"), f'the exact solution "{case.exact.name}" needs a constant force'


def solution(case, start: ExactStart) -> Solution:
    """Position [m] and velocity [m/s] of the only mass of a case, as functions of time.

    The case must be one for which `find_faults` yields nothing.
    """
    name, mass = next(item for item in case.nodes.items() if item[1].kind == "mass")
    at = {body: part.initial_position for body, part in case.nodes.items() if part.domain == "translational"}
    stiffness = damping = force = 0.0
    for link in case.links.values():
        sign = 1.0 if link.to == name else -1.0
        if link.kind == "spring":
            stiffness += link.stiffness
            length = at[link.to] - at[link.from_]
            push = link.preload if link.preload is not None else -link.stiffness * (length - link.free_length)
            force += sign * push
        elif link.kind == "damper":
            damping += link.damping
        else:
            force += sign * link.force.first
    decay, v0, t0 = damping / (2.0 * mass.mass), mass.initial_velocity, case.numerics.start
    kappa = cmath.sqrt(decay**2 - stiffness / mass.mass)
    end, place = force / stiffness, mass.initial_position
    if case.numerics.initial == "equilibrium":  # the mass then starts at the equilibrium
        place, end, force = place + end, 0.0, 0.0

    def parts(t):
        """exp(-decay s) cosh(kappa s) and exp(-decay s) sinh(kappa s) / kappa, with the time s since the start.

        decay = c / (2 m), kappa^2 = decay^2 - k / m, with mass m, stiffness k and damping c
        """
        s = np.asarray(t, dtype=float) - t0
        if abs(kappa) < 1e-12 * math.sqrt(stiffness / mass.mass):
            return np.exp(-decay * s), np.exp(-decay * s) * s
        up, down = np.exp((kappa - decay) * s), np.exp(-(kappa + decay) * s)
        return (0.5 * (up + down)).real, (0.5 * (up - down) / kappa).real

    def position(t):
        c, s = parts(t)
        return place + end * (1.0 - c - decay * s) + v0 * s

    def velocity(t):
        c, s = parts(t)
        return v0 * (c - decay * s) + (force / mass.mass) * s

    return Solution(case, position={name: position}, velocity={name: velocity})
