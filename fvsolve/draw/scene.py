"""Scene of a field picture: frames, parts, names and units."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass
class DrawnPart:
    """Part of a network and its position.

    key : "nodes.NAME" or "links.NAME"
    kinds : kind of the part and the kinds from which it is derived, nearest first
    at : position [m]; between : keys of the parts that a link connects
    link : True for a link, False for a node
    joint : True for a plain junction; held : True if pipes or a stated position fix its position
    own_place : True for a link that is not drawn at the middle of its ends
    """

    key: str
    name: str
    kinds: tuple[str, ...]
    at: tuple[float, float, float]
    between: tuple[str, ...] = ()
    link: bool = False
    joint: bool = False
    held: bool = False
    own_place: bool = False


@dataclass
class DrawnUnit:
    """Quantity and its output unit: shown value = factor * SI value + shift."""

    name: str
    unit: str
    factor: float = 1.0
    shift: float = 0.0

    @property
    def label(self) -> str:
        return f"{self.name.replace('_', ' ')} [{self.unit}]"


@dataclass
class DrawnScene:
    """Frames of a field with the parts, names and units of the picture.

    quantity, length, height : units of the field, of lengths and of heights
    frames : (caption, files) of each time
    pipes : for networks, (points float64[p, 3] [m], lines int[c, 2], values float64[c] in SI, pipe int[c]) of each time
    plan : source of plan positions: "given", "laid out" (by lengths), "own scale" or "schematic" (both not to scale)
    contours : number of contour lines
    """

    title: str
    quantity: DrawnUnit
    length: DrawnUnit
    height: DrawnUnit
    frames: list[tuple[str, list[Path]]]
    pipes: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # names of pipes
    bodies: list[str] = field(default_factory=list)  # names of bodies by index
    parts: list[DrawnPart] = field(default_factory=list)
    anchors: dict[str, tuple[float, float, float]] = field(default_factory=dict)  # positions of linked patches [m]
    plan: str = "given"
    contours: int = 0

    def shown(self, points) -> np.ndarray:
        """Convert points float64[n, 3] [m] to the output units of lengths and heights."""
        plan = self.length.factor
        return np.asarray(points, float).reshape(-1, 3) * (plan, plan, self.height.factor)

    @property
    def height_ratio(self) -> float:
        """Factor on heights in their output unit that gives equal scales of heights and lengths."""
        return self.length.factor / self.height.factor
