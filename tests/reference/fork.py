"""Small case of a branched network, for tests of output, of damaged files and of refused cases."""

from __future__ import annotations

from reference.scenes import AMBIENT, scene

NUMERICS = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.8}
PROBES = ["gate.pressure", "gate.head", "valve.flow", "main.velocity@0.5"]
PIPE = {
    "type": "pipe",
    "diameter": 0.3,
    "wave_speed": 1200.0,
    "friction": {"model": "steady", "factor": 0.02},
}


def branched(fields: int = 5, **top) -> dict:
    """Case of a main that forks into a dead end and a valve that shuts between 0.1 and 0.2 s."""
    nodes = {
        "lake": {"type": "reservoir", "head": 60.0, "elevation": 40.0},
        "fork": {"type": "junction", "elevation": 10.0},
        "end": {"type": "junction", "elevation": 20.0},
        "gate": {"type": "junction", "elevation": 0.0},
        "air": {"type": "reservoir", "pressure": AMBIENT, "elevation": 0.0},
    }
    links = {
        "main": {**PIPE, "from": "lake", "to": "fork", "length": 600.0, "cells": 30},
        "branch": {**PIPE, "from": "fork", "to": "end", "length": 200.0, "cells": 10},
        "last": {**PIPE, "from": "fork", "to": "gate", "length": 300.0, "cells": 15},
        "valve": {
            "type": "valve",
            "from": "gate",
            "to": "air",
            "area": 0.005,
            "opening": {"time": [0.1, 0.2], "value": [1.0, 0.0]},
        },
    }
    case = scene(nodes, links, 1.0, NUMERICS, PROBES, 0.01, title="A fork", **top)
    case["output"]["fields"] = fields
    return case
