"""One pipe whose wall creeps, between a reservoir and a changing demand. Knows its Laplace transform; knows no cells.

A wall that gives way by elements of compliance J and time tau takes up C(s) = 1 + sum of G / (1 + tau s) times what
liquid and elastic wall do at once, G = c D rho a^2 J / e (Covas et al. 2005): waves run as exp(-G d) with
G = (s / a) sqrt(C), with impedance (a / A) / sqrt(C). With laminar friction that remembers, that of `laminar_line` too.
"""

from __future__ import annotations

import numpy as np

from fvsolve.exact import laminar_line
from fvsolve.exact.laminar_line import LINKS, NODES, LineDeviation, of_line
from fvsolve.exact.solution import ExactStart, Solution

__all__ = ["LINKS", "NODES", "misfits", "solution"]


def misfits(case):
    """What makes a case none of one line with a creeping wall and a demand at its end."""
    name = case.exact.name
    for keys, text in laminar_line.misfits(case):
        link = case.links[keys[1]] if keys[0] == "links" and len(keys) > 2 else None
        if link is None or keys[2] != "friction" or link.friction.model != "none" or link.minor_loss:
            yield keys, text
    for link, pipe in case.links.items():
        if not pipe.yielding:
            yield ("links", link, "wall"), f'the exact solution "{name}" wants a wall with creep'


def solution(case, start: ExactStart) -> Solution:
    """Pressures and flows along the line of a case that `misfits` finds nothing in."""
    [pipe] = case.links.values()
    return of_line(case, start, Creeping(case, pipe))


class Creeping(LineDeviation):
    """Deviations from the start along a pipe whose wall creeps."""

    def __init__(self, case, pipe) -> None:
        super().__init__(case, pipe)
        self.plug = pipe.friction.model == "none"
        self.elements = [(growth * self.rho * self.a**2, time) for growth, time in pipe.yielding]

    def swelling(self, s):
        total = np.ones(np.shape(s), dtype=complex)
        for share, time in self.elements:
            total = total + share / (1.0 + time * s)
        return total

    def ratio(self, s):
        return np.ones(np.shape(s), dtype=complex) if self.plug else super().ratio(s)
