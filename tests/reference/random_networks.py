"""Random networks with many kinds of parts, for claims that hold for any network."""

from __future__ import annotations

import numpy as np

from reference.scenes import chamber, junction, lake, pipe, scene, tank, valve

ROUGH = {"model": "quasi-steady", "roughness": 1e-4}
FACTOR = {"model": "steady", "factor": 0.02}
CLOSING = {"time": [0.0, 1.0, 2.0, 3.0], "value": [1.0, 0.3, 2e-4, 0.0]}


def random_network(seed: int, scheme: str = "upwind", law: str = "linear", size: int = 7) -> dict:
    """Connected network of pipes, valves that shut from 0 to 3 s, rigid columns, vessels and two lakes.

    Networks with `seed` mod 3 equal to 2 are frictionless and start from rest.
    """
    rng, smooth = np.random.default_rng(seed), seed % 3 == 2
    nodes = {"L0": lake(40.0), "L1": lake(35.0)}
    links = {}
    for k in range(size):
        kind = rng.choice(["junction", "junction", "junction", "chamber", "tank"])
        made = {"junction": junction, "chamber": lambda: chamber(0.2), "tank": lambda: tank(2.0, 30.0)}[kind]()
        other = f"L{k}" if k < 2 else str(rng.choice(list(nodes)))
        nodes[f"N{k}"] = made
        links[f"p{k}"] = random_pipe(rng, other, f"N{k}", smooth)
    names = list(nodes)
    for k in range(size):
        a, b = (str(name) for name in rng.choice(names, 2, replace=False))
        if k % 3 == 0:
            links[f"q{k}"] = random_pipe(rng, a, b, smooth)
        else:
            links[f"v{k}"] = valve(a, b, 1e-3, CLOSING if rng.random() < 0.7 else 1.0)
    nodes["X"], nodes["Y"] = junction(), junction()  # at X valves can control a column, at Y they cannot
    a, d = (str(name) for name in rng.choice(names, 2, replace=False))
    b, c = (str(name) for name in rng.choice(names, 2))
    column = {"type": "rigid-column", "length": 20.0, "diameter": 0.1, "friction": FACTOR}
    links["c0"] = column | {"from": a, "to": "X"}
    links["w0"], links["w1"] = valve("X", b, 1e-3, CLOSING), valve(c, "X", 1e-3, CLOSING)
    links["c1"] = column | {"from": "Y", "to": d}
    links["y"] = random_pipe(rng, a, "Y", smooth)
    numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.8, "initial": "rest" if smooth else "steady"}
    made = scene(nodes, links, 4.0, numerics)
    return made | {"fluid": {**made["fluid"], "law": law}}


def random_pipe(rng, start: str, end: str, smooth: bool) -> dict:
    """Pipe of one to twelve cells, frictionless if `smooth`, otherwise with one of two friction models."""
    friction = {"model": "none"} if smooth else (FACTOR, ROUGH)[rng.integers(2)]
    return pipe(start, end, 100.0, 0.2, 1000.0, int(rng.integers(1, 13)), friction=friction)
