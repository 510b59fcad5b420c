"""Cases of a main with parts that are placed on it by their chainage."""

import numpy as np

from reference.scenes import area, junction, lake, pipe, reservoir, scene, step, valve

DIAMETER, SPEED, CELLS = 0.4, 1000.0, 60
ROUGH = {"model": "quasi-steady", "roughness": 2e-4}
HILL = {
    "chainage": [1000.0, 1750.0, 2200.0, 2300.0, 4000.0],
    "elevation": [30.0, 42.0, 65.0, 31.0, 20.0],
}
LENGTH = 3000.0


def line(nodes: dict, links: dict, **more) -> dict:
    """Case of a lake, given nodes and links up to a gate, and a valve that closes to 20 %."""
    nodes = {
        "lake": lake(110.0, elevation=30.0),
        "gate": junction(elevation=20.0),
        "sea": reservoir(2e5, elevation=20.0),
    } | nodes
    links = links | {"tap": valve("gate", "sea", 0.02 * area(DIAMETER), step(0.5, 1.0, 0.2))}
    return scene(
        nodes,
        links,
        6.0,
        {"scheme": "weno5", "method": "rk4", "step": 0.02},
        ["gate.pressure", "tap.flow"],
        every=0.1,
        **more,
    )


def main(**more) -> dict:
    return (
        pipe(
            "lake",
            "gate",
            LENGTH,
            DIAMETER,
            SPEED,
            CELLS,
            friction=ROUGH,
            profile=HILL,
            minor_loss=3.0,
        )
        | more
    )


VENT = {"type": "air-valve", "inlet": 0.05, "outlet": 0.05}
HOLE = {"type": "leak", "coefficient": 2e-6}
GATE = {"type": "valve", "loss_coefficient": 5.0, "diameter": DIAMETER}
SAFE = {"type": "relief-valve", "to": "sea", "set_pressure": 12e5, "Kv": 100.0, "overpressure": 1e5}


def placed(turned: bool = False, bends: list | None = None, **more) -> dict:
    at = {"half": 1500.0, "top": "2.2 km", "hole": "2950 m", "safe": 3500}
    one = main() | ({} if bends is None else {"bends": bends})
    if turned:
        mirrored = {
            "chainage": (5000.0 - np.array(HILL["chainage"][::-1])).tolist(),
            "elevation": HILL["elevation"][::-1],
        }
        at = {"half": 3500.0, "top": 2800.0, "hole": 2050.0, "safe": 1500.0}
        one |= {"from": "gate", "to": "lake", "profile": mirrored}
    said = {name: {"on": "main", "at": at[name]} for name in at}
    nodes = {"top": VENT | said["top"]}
    links = {
        "safe": SAFE | said["safe"],
        "hole": HOLE | said["hole"],
        "main": one,
        "half": GATE | said["half"],
    }
    return line(nodes, links, **more)
