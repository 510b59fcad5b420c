"""What is asked to be drawn of a run. Knows numbers and names; draws nothing."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass
class DrawnPart:
    """A part: its kind and those it is made of, nearest first; where it is [m], and between which parts a link goes.

    key : "nodes.NAME" or "links.NAME"; joint : it is but a joint of links; held : pipes or positions keep it where
    it is; own_place : of a link that does not stand between its ends
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
    """A quantity as a reader wants it: shown = factor * SI + shift."""

    name: str
    unit: str
    factor: float = 1.0
    shift: float = 0.0

    @property
    def label(self) -> str:
        return f"{self.name.replace('_', ' ')} [{self.unit}]"


@dataclass
class DrawnScene:
    """Frames of a field and what stands about it.

    frames : (caption, files) of each time; pipes : the same as (points float64[p, 3] [m], lines int[c, 2],
    values float64[c] in SI, pipe int[c]), of networks that need no files; plan : "given", "laid out", "own scale" or
    "schematic"
    """

    title: str
    quantity: DrawnUnit
    length: DrawnUnit
    height: DrawnUnit
    frames: list[tuple[str, list[Path]]]
    pipes: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # of pipes
    bodies: list[str] = field(default_factory=list)  # by their numbers
    parts: list[DrawnPart] = field(default_factory=list)
    anchors: dict[str, tuple[float, float, float]] = field(default_factory=dict)  # patches, that links go to [m]
    plan: str = "given"
    contours: int = 0

    def shown(self, points) -> np.ndarray:
        """Points float64[n, 3] in the reader's units of lengths and heights."""
        plan = self.length.factor
        return np.asarray(points, float).reshape(-1, 3) * (plan, plan, self.height.factor)

    @property
    def slant(self) -> float:
        """What heights in their unit are multiplied by, that one is drawn as long as the same length."""
        return self.length.factor / self.height.factor
