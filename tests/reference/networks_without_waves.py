"""Cases of quasi-steady networks with a reducing valve."""

from reference.scenes import AMBIENT, RHO, WATER
from reference.scenes import GRAVITY as G

FACTOR, DIAMETER, LENGTH = 0.02, 0.2, 500.0
SIZE = {"diameter": DIAMETER, "loss_coefficient": 0.5}


def pipe(start, end):
    friction = {"model": "steady", "factor": FACTOR}
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": LENGTH,
        "diameter": DIAMETER,
        "friction": friction,
    }


def town(valve, demand=0.01, source=80.0, **numerics):
    """Case: lake - pipe - valve - pipe - town with a demand - pipe - tower; heads of the lake as a schedule."""
    return {
        "schema": 1,
        "fluid": WATER,
        "nodes": {
            "lake": {"type": "reservoir", "head": source},
            "a": {"type": "junction", "elevation": 0.0},
            "b": {"type": "junction", "elevation": 0.0},
            "town": {"type": "junction", "elevation": 0.0, "demand": demand},
            "tower": {
                "type": "tank",
                "elevation": 30.0,
                "area": 50.0,
                "level": 3.0,
                "height": 60.0,
            },
        },
        "links": {
            "p1": pipe("lake", "a"),
            "v": {"from": "a", "to": "b", **SIZE, **valve},
            "p2": pipe("b", "town"),
            "p3": pipe("town", "tower"),
        },
        "numerics": {"end": 20000.0, "pipe_model": "quasi-steady", "rtol": 1e-9, **numerics},
        "output": {
            "every": 500.0,
            "probes": ["tower.level", "a.head", "b.head", "v.flow", "v.opening", "p3.flow"],
        },
    }


def reducing(**keys):
    return {
        "type": "pressure-reducing",
        "set_pressure": AMBIENT + 45.0 * RHO * G,
        "time_constant": 0.0,
        **keys,
    }


# lake: falls below the set pressure, then below the tower, then rises: the valve opens fully, shuts, opens, controls
FALLING = {"time": [0, 4000, 8000, 12000, 16000, 20000], "value": [80, 80, 40, 25, 25, 80]}
