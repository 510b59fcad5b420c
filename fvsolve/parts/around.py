"""What lies around a part in its case, as far as it asks for its faults. Knows no kind of part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

Faults = Iterator[tuple[tuple[Any, ...], str]]  # keys below the part, and what is wrong with them


@dataclass(frozen=True)
class Around:
    """A case whose parts are read, and what of it is known.

    ambient : [Pa]; gravity : [m/s2], None where it is at fault; fluid : its properties, None where they are at fault
    vacuum : (part's group, its name, key, pressures [Pa]) -> faults of those at which the fluid boils
    between : (place, place) -> how far the second lies ahead of the first at the start [m], None where that is unknown
    """

    nodes: dict[str, Any]
    links: dict[str, Any]
    ambient: float
    gravity: float | None
    fluid: Any
    vacuum: Callable[[str, str, str, list[float]], Faults]
    between: Callable[[str, str], float | None]

    def spatial(self, place: str | None) -> bool:
        """Whether a place is a body, or a point of one or of the world."""
        name, _, point = (place or "").partition(".")
        node = self.nodes.get(name)
        return getattr(node, "domain", "") == "spatial" or bool(point) and point in getattr(node, "points", {})

    def ahead(self, link: Any, first: str, second: str) -> float | None:
        """How far the place at port `second` lies ahead of that at `first` at the start [m]; None unless known.

        Of masses on the axis the difference of their positions, of points in space their distance.
        """
        ends = [link.ports.get(port) for port in (first, second)]
        return None if None in ends else self.between(*ends)
