"""Cases for the tests as dicts with the structure of a case file, in SI units.

Shared constants are read-only, and every case is a separate copy that a test may change.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

AMBIENT = 101325.0
GRAVITY = 9.80665
RHO = 1000.0
WATER = MappingProxyType(
    {
        "name": "user",
        "density": RHO,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "vapor_pressure": 2300.0,
        "law": "linear",
    }
)
# exact: one cell per step
SHARP = MappingProxyType({"scheme": "upwind", "method": "euler", "courant": 1.0})
SMOOTH = MappingProxyType({"scheme": "upwind5", "method": "rk4", "courant": 0.8})
NO_FRICTION = MappingProxyType({"model": "none"})


def area(diameter: float) -> float:
    return math.pi / 4 * diameter**2


def scene(
    nodes: dict,
    links: dict,
    end: float,
    numerics: dict,
    probes: Any = (),
    every: float = 0.01,
    **top: Any,
) -> dict:
    """Complete case that shares no object with its arguments; `top` adds or replaces top-level tables."""
    case = {
        "schema": 1,
        "ambient_pressure": AMBIENT,
        "gravity": GRAVITY,
        "fluid": WATER,
        "nodes": nodes,
        "links": links,
        "numerics": {"end": end, **numerics},
        "output": {"every": every, "probes": list(probes)} if probes else {"every": every},
    }
    return copied({**case, **top})


def copied(value: Any) -> Any:
    """Deep copy of tables and lists."""
    if isinstance(value, Mapping):
        return {key: copied(one) for key, one in value.items()}
    return [copied(one) for one in value] if isinstance(value, list) else value


def reservoir(pressure: Any, **more: Any) -> dict:
    return {"type": "reservoir", "pressure": pressure, **more}


def lake(head: Any, **more: Any) -> dict:
    return {"type": "reservoir", "head": head, **more}


def junction(demand: Any = None, **more: Any) -> dict:
    return {"type": "junction", **({} if demand is None else {"demand": demand}), **more}


def tank(section: Any, level: float, **more: Any) -> dict:
    return {"type": "tank", "area": section, "level": level, **more}


def chamber(volume: float, pressure: float | None = None, **more: Any) -> dict:
    given = {} if pressure is None else {"initial_pressure": pressure}
    return {"type": "chamber", "volume": volume, **given, **more}


def pipe(
    start: str, end: str, length: float, diameter: float, wave_speed: float, cells: int, **more: Any
) -> dict:
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": length,
        "diameter": diameter,
        "wave_speed": wave_speed,
        "cells": cells,
        "friction": NO_FRICTION,
        **more,
    }


def stiff_pipe(
    start: str, end: str, length: float, diameter: float, cells: int, **more: Any
) -> dict:
    """Pipe with a rigid wall, whose wave speed is the speed of sound of the fluid."""
    found = pipe(start, end, length, diameter, 0.0, cells, wall="rigid", **more)
    del found["wave_speed"]
    return found


def valve(start: str, end: str, flow_area: float, opening: Any = 1.0, **more: Any) -> dict:
    """Valve with the effective area Cd A [m2]."""
    return {
        "type": "valve",
        "from": start,
        "to": end,
        "area": flow_area / 0.61,
        "discharge_coefficient": 0.61,
        "opening": opening,
        **more,
    }


def step(time: float, before: float, after: float) -> dict:
    return {"time": [time - 1.0, time], "value": [before, after], "kind": "step"}


def ramp(start: float, duration: float, before: float, after: float, exponent: float = 1.0) -> dict:
    return {"start": start, "duration": duration, "value": [before, after], "exponent": exponent}


def smooth_step(t: float, start: float, duration: float) -> float:
    """Polynomial from 0 to 1 whose first four derivatives vanish at both ends."""
    s = min(max((t - start) / duration, 0.0), 1.0)
    return s**5 * (126 + s * (-420 + s * (540 + s * (-315 + 70 * s))))


def smooth_ramp(
    start: float, duration: float, before: float, after: float, points: int = 1201
) -> dict:
    """Table of `smooth_step` with an interpolation error of about 1e-8."""
    times = [start + duration * i / (points - 1) for i in range(points)]
    values = [before + (after - before) * smooth_step(t, start, duration) for t in times]
    return {"time": times, "value": values, "kind": "smooth"}


def pump(start: str, end: str, **more: Any) -> dict:
    return {"type": "pump", "from": start, "to": end, **more}


def inflow(flow: Any, **more: Any) -> dict:
    return {"type": "inflow", "flow": flow, **more}


def still(**top) -> dict:
    """Case of a tank that fills from a reservoir: the smallest run, without pipes and fields."""
    nodes = {"lake": reservoir(1.5e5), "pond": tank(1.0, 1.0)}
    return scene(
        nodes,
        {"gate": valve("lake", "pond", 0.001)},
        1.0,
        {"rtol": 1e-6},
        ["pond.level"],
        0.1,
        **top,
    )


BRANCHED_PROBES = ["gate.pressure", "gate.head", "valve.flow", "main.velocity@0.5"]


def branched(fields: int = 5, **top) -> dict:
    """Case of a main that forks into a dead end and a valve that shuts between 0.1 and 0.2 s."""
    nodes = {
        "lake": lake(60.0, elevation=40.0),
        "fork": junction(elevation=10.0),
        "end": junction(elevation=20.0),
        "gate": junction(elevation=0.0),
        "air": reservoir(AMBIENT, elevation=0.0),
    }
    sizes = {
        "main": ("lake", "fork", 600.0, 30),
        "branch": ("fork", "end", 200.0, 10),
        "last": ("fork", "gate", 300.0, 15),
    }
    links = {
        name: pipe(
            start, end, length, 0.3, 1200.0, cells, friction={"model": "steady", "factor": 0.02}
        )
        for name, (start, end, length, cells) in sizes.items()
    }
    links["valve"] = {
        "type": "valve",
        "from": "gate",
        "to": "air",
        "area": 0.005,
        "opening": {"time": [0.1, 0.2], "value": [1.0, 0.0]},
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8}
    case = scene(nodes, links, 1.0, numerics, BRANCHED_PROBES, 0.01, title="A fork", **top)
    case["output"]["fields"] = fields
    return case
