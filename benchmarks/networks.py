"""Networks and closures of the water-hammer benchmark, and their cases for fvsolve."""

from dataclasses import dataclass, replace

import numpy as np
from exact import Closure, Network, Pipe

GRAVITY = 32.2 * 0.3048  # fixed value of rthym-moc [m/s2]

THREE = Network(
    name="three",
    pipes=(
        Pipe("up", "lake", "fork", 500.0, 1230.0, 0.5),
        Pipe("down", "fork", "gate", 347.1, 1111.0, 0.4),
        Pipe("side", "fork", "dead", 271.9, 1017.0, 0.3),
    ),
    reservoirs=("lake",),
    gate="gate",
    probes=("gate", "fork"),
    head=200.0,
    flow=0.02,
    gravity=GRAVITY,
    end=7.3,
)

# Loops, diameters and approximate lengths of Streeter and Wylie's network, with incommensurate lengths and speeds.
NINE = replace(
    THREE,
    name="nine",
    pipes=(
        Pipe("1", "lake", "n3", 611.3, 1187.0, 0.90),
        Pipe("2", "n3", "n4", 913.7, 1213.0, 0.75),
        Pipe("3", "n3", "n2", 607.9, 1151.0, 0.60),
        Pipe("4", "n6", "n4", 458.3, 1109.0, 0.45),
        Pipe("5", "n4", "n2", 547.1, 1129.0, 0.45),
        Pipe("6", "n5", "n2", 672.7, 1193.0, 0.75),
        Pipe("7", "n5", "gate", 608.3, 1181.0, 0.90),
        Pipe("8", "n6", "n5", 455.9, 1163.0, 0.60),
        Pipe("9", "n2", "n6", 489.1, 1093.0, 0.45),
    ),
    probes=("gate", "n2"),
    flow=0.1,
)

CLOSURES = {
    "smooth": Closure("erf", 0.5, 0.06),
    "ramp": Closure("ramp", 0.1, 0.3),
    "instant": Closure("instant", 0.1),
}


def demand(network, closure):
    """Demand of the closing gate as a schedule of fvsolve."""
    if closure.kind == "ramp":
        return {"start": closure.start, "duration": closure.width, "value": [network.flow, 0.0]}
    if closure.kind == "instant":
        return {"time": [0.0, closure.start], "value": [network.flow, 0.0], "kind": "step"}
    times = np.linspace(closure.begin, closure.finish, 513)  # interpolation error 3e-7 of the flow
    return {
        "time": times.tolist(),
        "value": (network.flow * closure.open(times)).tolist(),
        "kind": "smooth",
    }


def case(
    network, closure, cell_time, every, scheme="upwind5", method="rk4", courant=0.9, **numerics
):
    """Case of a network with cells of about `cell_time` [s] of travel and rows each `every` [s]."""
    nodes = {p: {"type": "junction"} for pipe in network.pipes for p in (pipe.from_, pipe.to)}
    nodes |= {name: {"type": "reservoir", "head": network.head} for name in network.reservoirs}
    nodes[network.gate]["demand"] = demand(network, closure)
    links = {
        f"p{p.name}": {
            "type": "pipe",
            "from": p.from_,
            "to": p.to,
            "length": p.length,
            "diameter": p.diameter,
            "wave_speed": p.wave_speed,
            "friction": {"model": "none"},
            "cells": max(1, round(p.travel / cell_time)),
        }
        for p in network.pipes
    }
    return {
        "schema": 1,
        "title": f"{network.name} pipes",
        "gravity": network.gravity,
        "fluid": dict(WATER),
        "nodes": nodes,
        "links": links,
        "numerics": {
            "end": network.end,
            "scheme": scheme,
            "method": method,
            "courant": courant,
            **numerics,
        },
        "output": {"every": every, "fields": 0, "probes": [f"{p}.head" for p in network.probes]},
    }


WATER = {
    "name": "user",
    "law": "linear",
    "density": 1000.0,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2339.0,
}


@dataclass(frozen=True)
class UniformPipe:
    """Pipe with the Darcy factor `factor` between a lake and a gate that closes within `duration` [s]."""

    length: float = 1000.0
    wave_speed: float = 1000.0
    diameter: float = 0.5
    factor: float = 0.018
    head: float = 200.0
    flow: float = 0.1
    duration: float = 0.5
    gravity: float = GRAVITY

    @property
    def jump(self):
        """Joukowsky jump of the head, a v / g [m]."""
        return self.wave_speed * self.flow / (np.pi / 4 * self.diameter**2) / self.gravity


UNIFORM = UniformPipe()


def uniform_case(pipe, cells, steps, rows=500):
    """Case of the uniform pipe: upwind and Euler at Courant 1, which equal the method of characteristics."""
    end = pipe.length / pipe.wave_speed / cells * steps
    return {
        "schema": 1,
        "title": "one pipe",
        "gravity": pipe.gravity,
        "fluid": dict(WATER),
        "nodes": {
            "lake": {"type": "reservoir", "head": pipe.head},
            "gate": {
                "type": "junction",
                "demand": {"start": 0.0, "duration": pipe.duration, "value": [pipe.flow, 0.0]},
            },
        },
        "links": {
            "main": {
                "type": "pipe",
                "from": "lake",
                "to": "gate",
                "length": pipe.length,
                "diameter": pipe.diameter,
                "wave_speed": pipe.wave_speed,
                "friction": {"model": "steady", "factor": pipe.factor},
                "cells": cells,
            }
        },
        "numerics": {"end": end, "scheme": "upwind", "method": "euler", "courant": 1.0},
        "output": {"every": end / rows, "fields": 0, "probes": ["gate.head"]},
    }
