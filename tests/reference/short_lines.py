"""Cases of delay lines with short pipes, and with a chamber."""

import numpy as np

from reference.delays import FLOW, pipe
from reference.scenes import scene

S = np.linspace(0.0, 1.0, 41)
SLOW = {
    "time": (0.2 + 0.4 * S).tolist(),
    "value": (FLOW * (1.0 - S**3 * (10.0 - 15.0 * S + 6.0 * S * S))).tolist(),
    "kind": "smooth",
}


def short(line: str, **numerics) -> dict:
    """Case with stubs of 3 m and 5 m between longer pipes, a valve at a stub, and a demand that stops within 0.4 s."""
    nodes = {
        "lake": {"type": "reservoir", "pressure": 6e5},
        "a": {"type": "junction"},
        "b": {"type": "junction"},
        "c": {"type": "junction"},
        "sink": {"type": "reservoir", "pressure": 1e5},
        "gate": {"type": "junction", "demand": SLOW},
    }
    links = {
        "up": pipe("lake", "a", 300.0, cells=50),
        "stub": pipe("a", "b", 3.0, cells=1),
        "down": pipe("b", "gate", 240.0, cells=40),
        "spur": pipe("b", "c", 5.0, cells=1),
        "tap": {"type": "valve", "from": "c", "to": "sink", "area": 2e-4},
    }
    return scene(
        nodes,
        links,
        3.0,
        {"pipe_model": line, **numerics},
        ["gate.pressure", "b.pressure", "c.pressure", "tap.flow"],
        0.05,
    )


def vessel(
    method: str, step: float, end: float = 3.0, volume: float = 20.0, cells: int = 2
) -> dict:
    """Case of a demand that stops at once between a lake and a chamber, at a time within a step."""
    stop = {"time": [0.0, 0.0503], "value": [FLOW, 0.0], "kind": "step"}
    nodes = {
        "lake": {"type": "reservoir", "pressure": 6e6},
        "v": {"type": "chamber", "volume": volume},
        "a": {"type": "junction", "demand": stop},
    }
    links = {
        "up": pipe("lake", "a", 317.0, cells=cells),
        "neck": pipe("a", "v", 123.0, cells=cells, diameter=0.1),
    }
    return scene(
        nodes,
        links,
        end,
        {"pipe_model": "delay-line", "method": method, "step": step},
        ["v.pressure"],
        0.1,
    )
