"""Frames in plan of cells along links, such as the water of conduits: they lie between the ends of their links."""

from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.network_layout import place, plan_positions
from fvsolve.core.output.node_places import end_place, node_places


class PlanFrame(NamedTuple):
    """Frame of a mesh in plan.

    origin : float64[2]  place of x = 0, y = 0 [m]; along, across : float64[2]  steps in plan for a unit of x and of y
    """

    origin: np.ndarray
    along: np.ndarray
    across: np.ndarray

    def points(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Points of the mesh in plan : float64[n, 2] [m]; x, y : float64[n]"""
        return self.origin + np.outer(x, self.along) + np.outer(y, self.across)


def link_frames(case: Any, lines: list[Any]) -> dict[str, PlanFrame]:
    """Frames of the meshes of links, whose x runs from one end to the other : name of a link -> frame.

    lines : basins of the model along links; the middle of their width lies on the line between both ends
    The ends have their places beside a basin, else those of the layout of the network.
    """
    names = [line.name for line in lines]
    ends = _ends_near_a_basin(case, names)
    if not ends:
        ends = _ends_of_layout(case, names)
    found = {}
    for line in lines:
        name = line.name
        width = float(np.ptp(line.mesh.points[:, 1]))
        start, stop = ends[name]
        length = float(case.links[name].length)
        along = (stop - start) / length
        drawn = float(np.hypot(*along))
        if drawn == 0.0:  # both ends at one place
            along, drawn = np.array([1.0, 0.0]), 1.0
        across = np.array([-along[1], along[0]]) / drawn
        found[name] = PlanFrame(start - 0.5 * width * across, along, across)
    return found


def _ends_near_a_basin(case: Any, names: list[str]) -> dict[str, tuple]:
    """Both ends of each link in the plane of a basin; {} if an end of a link has no place in any such plane."""
    for basin in (name for name, node in case.nodes.items() if node.kind == "basin"):
        places = node_places(case, basin)
        ends = {}
        for name in names:
            ports = case.links[name].ports.values()
            ends[name] = tuple(end_place(case, places, port) for port in ports)
        spots = [spot for pair in ends.values() for spot in pair]
        if all(spot is not None for spot in spots):
            return ends
    return {}


def _ends_of_layout(case: Any, names: list[str]) -> dict[str, tuple]:
    """Both ends of each link in the layout of the network."""
    lengths = {}
    for name, link in case.links.items():
        length = getattr(link, "length", None)
        if length:
            lengths[name] = length
    plan = plan_positions(case, lengths)
    ends = {}
    for name in names:
        ports = case.links[name].ports.values()
        ends[name] = tuple(np.array(plan[place(port)]) for port in ports)
    return ends
