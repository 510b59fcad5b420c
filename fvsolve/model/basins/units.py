"""Units of what the states of basins are. Knows names alone."""

from __future__ import annotations

UNITS = {  # by physics and quantity; what is carried has nobody's
    "free-surface": {"depth": "m", "flow_x": "m2/s", "flow_y": "m2/s"},
    "liquid": {"density": "kg/m3", "flow_x": "kg/(m2 s)", "flow_y": "kg/(m2 s)"},
}


def unit_of(physics: str, quantity: str) -> str:
    """SI unit of a quantity of cells."""
    return UNITS.get(physics, {}).get(quantity, "-")
