"""Context of a part in its case, for checks of the part."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

Faults = Iterator[tuple[tuple[Any, ...], str]]  # (keys below the part, text of the fault)


@dataclass(frozen=True)
class CaseContext:
    """Parts and properties of a case, for checks after its parts are read.

    nodes, links : parts by name; ambient : ambient pressure [Pa]
    gravity : acceleration of gravity [m/s2], None if faulty; fluid : properties of the fluid, None if faulty
    boiling_faults : function of (group, name, key, pressures [Pa]) of a part, which yields a fault if the fluid boils
    at one of the pressures
    place_distance : function of two places: distance [m] from the first to the second at the start, None if unknown
    """

    nodes: dict[str, Any]
    links: dict[str, Any]
    ambient: float
    gravity: float | None
    fluid: Any
    boiling_faults: Callable[[str, str, str, list[float]], Faults]
    place_distance: Callable[[str, str], float | None]

    def spatial(self, place: str | None) -> bool:
        """True if a place is a body, or a point of a body or of the world."""
        name, _, point = (place or "").partition(".")
        node = self.nodes.get(name)
        return getattr(node, "domain", "") == "spatial" or bool(point) and point in getattr(node, "points", {})

    def separation(self, link: Any, first: str, second: str) -> float | None:
        """Distance [m] from the place at port `first` of a link to that at port `second` at the start; None if unknown.

        It is a signed difference of positions for masses on the axis, and a distance for points in space.
        """
        ends = [link.ports.get(port) for port in (first, second)]
        return None if None in ends else self.place_distance(*ends)
