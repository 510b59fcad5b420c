"""A stated wave speed beside that of the wall which the same pipe names. Knows pipes and a fluid; knows no waves."""

from __future__ import annotations

import math
from typing import Any

from fvsolve.case import defaults
from fvsolve.parts import Pipe
from fvsolve.parts.pipe.wall import softness

APART = 1.2  # anchoring makes 12 % of a plastic pipe's, the spread of moduli as much; walls alone no more
NAMED = ("diameter", "nominal", "schedule", "class", "material", "lining")  # keys that say a wall


def at_odds(case: Any, name: str) -> tuple[float, float, str] | None:
    """(value, limit, text) of a wave speed that is stated and far from that of the wall that is named beside it."""
    pipe, said = case.links[name], defaults.link_said(case.raw, name)
    try:
        named = Pipe.model_validate({"from": "a", "to": "b", "length": 1.0, **{k: said[k] for k in NAMED if k in said}})
    except ValueError:  # a material alone, whose thickness is not known
        return None
    speed = math.sqrt(1.0 / (1.0 / case.properties.bulk_modulus + softness(named)) / case.properties.density)
    if speed / APART <= pipe.wave_speed <= speed * APART:
        return None
    size = " ".join(str(said[key]) for key in ("material", "class", "nominal") if key in said)
    text = (f"{case.amount(pipe.wave_speed, 'velocity')} is stated, and the wall of {size} has "
            f"{case.amount(speed, 'velocity')}; leave wave_speed out, or material and class")  # fmt: skip
    return pipe.wave_speed, speed, text
