"""Shipped cases as tables, cases with all other keys, and other values of each key."""

import re
import tomllib

from fvsolve.parts.value import SHAPE, Choice
from reference.folders import CASES
from reference.scenes import pipe, reservoir, scene

# Cases that take long to build, which come last; others that take tenths of a second, which come before them.
LARGE = ("net3-day", "net3-pump-trip", "adelaide", "bowl", "swirl", "accumulator")
SLOW = (
    "governor",
    "load-sensing",
    "digital-pressure",
    "tank-relay",
    "solenoid-valve",
    "dam-break",
    "excavator",
)
NAMES = sorted(
    (path.stem for path in CASES.glob("*.toml")),
    key=lambda name: (name in LARGE, name in SLOW, name),
)
NUMBER = re.compile(r"\s*([+-]?[\d._]+(?:[eE][+-]?\d+)?)(\s*\S.*|)")
HAIR = 1e-4


def raw_case(name: str) -> dict:
    """Table of a shipped case without expectations and comparisons."""
    table = tomllib.loads((CASES / f"{name}.toml").read_text(encoding="utf-8"))
    return {key: one for key, one in table.items() if key not in ("expect", "compare")}


def leaves(table, keys=()):
    """(keys, value) of every value of a case, also of the entries of lists."""
    inner = (
        table.items()
        if isinstance(table, dict)
        else enumerate(table)
        if isinstance(table, list)
        else ()
    )
    for key, one in inner:
        yield from leaves(one, (*keys, key))
    if not isinstance(table, (dict, list)):
        yield keys, table


def others(table: dict, keys: tuple, value, far: bool) -> list:
    """Other values of a key: slightly greater numbers, for shapes (or if `far`) much greater; other words, places."""
    inner = table
    for key in keys[:-1]:
        inner = inner[key]
    given, places = inner[keys[-1]], [*table["nodes"]]
    if isinstance(given, bool):
        return [not given]
    if isinstance(value, Choice):
        return [word for word in value.words if word != given][
            : None if value.changes == SHAPE else 2
        ]
    if isinstance(given, str) and not NUMBER.fullmatch(given):
        return [name for name in places if name != given][:2] if given in places else []
    if isinstance(given, int) and value.changes == SHAPE:
        return [given + 1, given - 1, 2 * given, given + 1e-9]
    number, unit = NUMBER.fullmatch(given).groups() if isinstance(given, str) else (given, None)
    near = [float(number) * factor for factor in ((1 + HAIR, 4 / 3) if far else (1 + HAIR,))]
    if value.changes == SHAPE:
        near += [4 / 3 * float(number), 1e-9, -1e-9, 10 * float(number), 1000 * float(number)]
        near += [
            one
            for one in (inner.values() if isinstance(inner, dict) else ())
            if isinstance(one, float)
        ]
    return [f"{one!r}{unit}" for one in near] if unit is not None else near


def spoken(keys: tuple) -> str:
    """Path of a key as in a setting, without places in lists."""
    return ".".join(
        f'"{key}"' if re.search(r"\W", key) else key for key in keys if isinstance(key, str)
    )


SIZE = {"diameter": 0.05, "loss_coefficient": 2.0}
TRIM = {"opening": [0.0, 0.5, 1.0], "flow_area": [0.0, 0.2, 1.0]}
OTHERS = scene(  # keys of no shipped case
    {
        "lake": {"type": "reservoir", "head": 40.0},
        "a": {
            "type": "junction",
            "demand": 2e-3,
            "required_pressure": 4e5,
            "minimum_pressure": 1.5e5,
            "demand_exponent": 0.6,
        },
        "b": {"type": "junction"},
        "c": {"type": "junction"},
        "gas": {
            "type": "accumulator",
            "volume": 0.1,
            "precharge": 2e5,
            "exponent": 1.3,
            "connection": {"area": 2e-3, "loss_in": 1.0, "loss_out": 1.5},
        },
        "vessel": {
            "type": "accumulator",
            "volume": 0.5,
            "level": 0.4,
            "diameter": 0.6,
            "slope": 0.5,
            "bottom": 0.3,
            "compressor": {"start": 0.5, "stop": 0.45, "flow": 1e-3},
        },
        "urn": {
            "type": "accumulator",
            "volume": 0.5,
            "level": 0.4,
            "area": {"level": [0.0, 0.5], "area": [0.3, 0.5]},
        },
        "air": {
            "type": "air-valve",
            "inlet": 0.05,
            "outlet": 0.01,
            "discharge_coefficient": 0.5,
            "volume": 1e-3,
            "temperature": 290.0,
            "switch_velocity": 0.5,
            "throttled_outlet": 5e-3,
        },
        "pond": {"type": "tank", "area": {"level": [0.0, 5.0], "area": [2.0, 3.0]}, "level": 1.0},
    },
    {
        "main": {
            "type": "pipe",
            "from": "lake",
            "to": "a",
            "length": 200.0,
            "diameter": 0.2,
            "cells": 9,
            "wall": {"youngs_modulus": 2e11, "thickness": 5e-3},
            "fittings": ["bend-90"],
            "minor_loss": 1.0,
            "friction": {"model": "quasi-steady", "factor": 0.02},
        },
        "hole": {"type": "leak", "from": "a", "coefficient": 1e-6, "exponent": 0.7, "opening": 0.5},
        "on": {
            "type": "pipe",
            "from": "a",
            "to": "b",
            "length": 100.0,
            "nominal": "DN100",
            "wave_speed": 1000.0,
        },
        "check": {
            "type": "check-valve",
            "from": "b",
            "to": "gas",
            "cracking_pressure": 100.0,
            "overpressure": 1e4,
            "natural_frequency": 5.0,
            "damping_ratio": 0.5,
            **SIZE,
        },
        "trim": {
            "type": "valve",
            "from": "b",
            "to": "air",
            "characteristic": TRIM,
            "laminar_reynolds": 20.0,
            **SIZE,
        },
        "down": {
            "type": "pipe",
            "from": "air",
            "to": "c",
            "length": 50.0,
            "diameter": 0.1,
            "wave_speed": 1000.0,
            "friction": {"model": "steady", "roughness": 1e-4},
            "cells": 4,
        },
        "keep": {
            "type": "pressure-sustaining",
            "from": "c",
            "to": "pond",
            "set_pressure": 3e5,
            "band": 2e5,
            "time_constant": 1.0,
            **SIZE,
        },
        "limit": {
            "type": "flow-control",
            "from": "b",
            "to": "pond",
            "set_flow": 5e-3,
            "time_constant": 2.0,
            **SIZE,
        },
        "rest": {
            "type": "rigid-column",
            "from": "c",
            "to": "pond",
            "length": 10.0,
            "diameter": 0.1,
            "friction": {"model": "chezy-manning", "coefficient": 0.01},
        },
        "lift": {
            "type": "pump",
            "from": "pond",
            "to": "c",
            "power": 500.0,
            "efficiency": 0.7,
            "rated_speed": 150.0,
            "inertia": 1.0,
            "speed": 1.0,
        },
        "first": {"type": "valve", "from": "b", "to": "vessel", "area": 1e-3},
        "second": {"type": "valve", "from": "b", "to": "urn", "area": 1e-3},
        "turn": {"type": "torque", "to": "lift.shaft", "torque": 20.0},
    },
    1.0,
    {"cell_time": 0.02},
)
DYED = scene(
    {
        "lake": reservoir(2e5, scalars={"dye": 1.0}),
        "tank": {"type": "tank", "area": 2.0, "level": 3.0},
    },
    {"main": pipe("lake", "tank", 100.0, 0.1, 1000.0, 4, scalars={"dye": 0.5}, minor_loss=1.0)},
    1.0,
    {},
    scalars={
        "dye": {"unit": "g/l", "initial": 0.1, "diffusivity": 1e-3, "decay": 0.1, "ambient": 0.2}
    },
)
