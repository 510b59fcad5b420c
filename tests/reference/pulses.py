"""Cases with a smooth pulse of demand on frictionless pipes, for order studies."""

import numpy as np

from reference import scenes

LENGTH, SPEED, DIAMETER, CENTRE, WIDTH, END = 100.0, 1000.0, 0.5, 0.11, 0.02, 0.25
FINE, FEW = 6001, 2001  # samples of the pulse: FEW are enough for orders up to 3


def pulse(t):
    """Demand over time [m3/s]: smooth, and below rounding before the start."""
    return 0.05 * np.exp(-(((np.asarray(t) - CENTRE) / WIDTH) ** 2))


def table(points: int) -> dict:
    """Pulse of demand as a sampled schedule, with interpolation errors of 3e-7 (FINE) or 3e-6 (FEW) of the pulse."""
    t = np.linspace(0.0, END, points)
    return {"time": t.tolist(), "value": pulse(t).tolist(), "kind": "smooth"}


def pressure(x: float, t: float) -> float:
    """Exact pressure by images [Pa]: the lake at x = 0 reflects pressure waves with sign -1, the gate with sign 1."""
    z = scenes.RHO * SPEED / scenes.area(DIAMETER)
    total = 0.0
    for k in range(10):
        sign = (-1.0) ** k
        ahead, behind = (
            t - (LENGTH - x + 2 * k * LENGTH) / SPEED,
            t - (LENGTH + x + 2 * k * LENGTH) / SPEED,
        )
        total += sign * (
            (float(pulse(ahead)) if ahead > 0 else 0.0)
            - (float(pulse(behind)) if behind > 0 else 0.0)
        )
    return 3e5 - z * total


def case(cells: int = 20, exact: bool = True, points: int = FINE, **numerics) -> dict:
    """Case of a lake, a pipe and a gate with the pulse of demand."""
    stepping = {} if {"step", "rtol"} & numerics.keys() else {"courant": 0.5}
    given = {"scheme": "upwind5", "method": "verner-7", **stepping, **numerics}
    links = {"main": scenes.pipe("lake", "gate", LENGTH, DIAMETER, SPEED, cells)}
    nodes = {"lake": scenes.reservoir(3e5), "gate": scenes.junction(table(points))}
    more = {"exact": {"name": "rays"}} if exact else {}
    return scenes.scene(
        nodes, links, END, given, ["gate.pressure", "main.pressure@0.37"], every=0.005, **more
    )


def front(cells: int = 50, **numerics) -> dict:
    """Case of a lake, a pipe and a gate with a demand that stops at once."""
    given = {"scheme": "upwind", "method": "verner-7", "courant": 0.5, "end": 0.07, **numerics}
    links = {"main": scenes.pipe("lake", "gate", LENGTH, DIAMETER, SPEED, cells)}
    nodes = {"lake": scenes.reservoir(3e5), "gate": scenes.junction(scenes.step(0.02, 0.05, 0.0))}
    return scenes.scene(
        nodes, links, given["end"], given, ["gate.pressure"], every=0.005, exact={"name": "rays"}
    )
