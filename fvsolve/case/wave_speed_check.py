"""Comparison of a stated wave speed with the wave speed that the stated pipe wall gives."""

from __future__ import annotations

import math
from typing import Any

from fvsolve.case import defaults
from fvsolve.parts import Pipe
from fvsolve.parts.pipe.pipe_wall import elastic_compliance

# Allowed ratio. Anchoring changes the wave speed of a plastic pipe by 12 %, the spread of moduli by as much.
ALLOWED_RATIO = 1.2
WALL_KEYS = ("diameter", "nominal", "schedule", "class", "material", "lining")  # keys that define a wall


def wave_speed_mismatch(case: Any, name: str) -> tuple[float, float, str] | None:
    """Stated wave speed [m/s], wave speed from the wall [m/s] and message, as a tuple; None if they agree.

    A ratio of up to `ALLOWED_RATIO` is allowed. The result is also None if the keys of the wall are incomplete.
    name : name of a pipe
    """
    pipe, keys = case.links[name], defaults.raw_link(case.raw, name)
    try:
        wall = Pipe.model_validate(
            {"from": "a", "to": "b", "length": 1.0, **{k: keys[k] for k in WALL_KEYS if k in keys}}
        )
    except ValueError:  # a material without a wall thickness
        return None
    speed = math.sqrt(1.0 / (1.0 / case.properties.bulk_modulus + elastic_compliance(wall)) / case.properties.density)
    if speed / ALLOWED_RATIO <= pipe.wave_speed <= speed * ALLOWED_RATIO:
        return None
    size = " ".join(str(keys[key]) for key in ("material", "class", "nominal") if key in keys)
    text = (f"{case.amount(pipe.wave_speed, 'velocity')} is stated, but the wall of {size} gives "
            f"{case.amount(speed, 'velocity')}; leave out `wave_speed`, or `material` and `class`")  # fmt: skip
    return pipe.wave_speed, speed, text
