"""Pipe with wall creep between a reservoir and a changing demand, by its Laplace transform.

The storage of a wall of Kelvin-Voigt elements with compliance J [1/Pa] and retardation time tau [s], relative to the
instantaneous storage of liquid and elastic wall, is C(s) = 1 + sum of g / (1 + tau s), g = c D rho a^2 J / e (Covas et
al. 2005): Laplace variable s, wave speed a, density rho, diameter D, wall thickness e, restraint factor c. Waves
propagate over a distance d as exp(-G d) with G = (s / a) sqrt(C), and with the impedance (a / A) / sqrt(C), A the area
of the pipe. Unsteady laminar friction adds the factor of `laminar_line`.
"""

from __future__ import annotations

import numpy as np

from fvsolve.exact import laminar_line
from fvsolve.exact.laminar_line import LINKS, NODES, LineDeviation, line_solution
from fvsolve.exact.solution import ExactStart, Solution

__all__ = ["LINKS", "NODES", "find_faults", "solution"]


def find_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one pipe with wall creep and a demand."""
    name = case.exact.name
    for keys, text in laminar_line.find_faults(case):
        link = case.links[keys[1]] if keys[0] == "links" and len(keys) > 2 else None
        if link is None or keys[2] != "friction" or link.friction.model != "none" or link.minor_loss:
            yield keys, text
    for link, pipe in case.links.items():
        if not pipe.creep_elements:
            yield ("links", link, "wall"), f'the exact solution "{name}" needs a wall with creep'


def solution(case, start: ExactStart) -> Solution:
    """Pressures [Pa] and flows [m3/s] along the pipe of a case, as functions of time.

    The case must be one for which `find_faults` yields nothing.
    """
    [pipe] = case.links.values()
    return line_solution(case, start, CreepDeviation(case, pipe))


class CreepDeviation(LineDeviation):
    """Deviations of pressure and flow from the start along a pipe with wall creep."""

    def __init__(self, case, pipe) -> None:
        super().__init__(case, pipe)
        self.plug_flow = pipe.friction.model == "none"
        self.elements = [(growth * self.rho * self.a**2, time) for growth, time in pipe.creep_elements]

    def storage_ratio(self, s):
        total = np.ones(np.shape(s), dtype=complex)
        for share, time in self.elements:
            total = total + share / (1.0 + time * s)
        return total

    def ratio(self, s):
        return np.ones(np.shape(s), dtype=complex) if self.plug_flow else super().ratio(s)
