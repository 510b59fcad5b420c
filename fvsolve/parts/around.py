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
    """

    nodes: dict[str, Any]
    links: dict[str, Any]
    ambient: float
    gravity: float | None
    fluid: Any
    vacuum: Callable[[str, str, str, list[float]], Faults]

    def starts(self, link: Any) -> list[float] | None:
        """Where the bodies that a link joins stand at the start [m], by port; None unless all are known."""
        ports = [port for port, domain in link.joins.items() if domain == "translational"]
        bodies = [self.nodes.get(link.ports.get(port)) for port in ports]
        if not bodies or any(getattr(body, "domain", "") != "translational" for body in bodies):
            return None
        return [body.initial_position for body in bodies]
