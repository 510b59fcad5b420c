"""Case of a network in a steady state, and movement of its probes."""

import numpy as np

from reference import scenes
from reference.scenes import AMBIENT, junction, lake, pipe, reservoir, scene, tank, valve

ROUGH = {"model": "steady", "roughness": 2.6e-4}


def town(
    friction: dict, numerics: dict, end: float = 60.0, demand=0.02, law: str = "linear"
) -> dict:
    """Case of a loop with slopes, a demand, valves, a rigid column, still tanks and a tank with balanced flows."""
    nodes = {
        "hill": lake(60.0),
        "low": lake(40.0),
        "a": junction(elevation=12.3),
        "b": junction(demand, elevation=31.7),
        "c": junction(elevation=-4.1),
        "middle": tank(100.0, 10.0, elevation=40.0),  # the lakes are 10 m above and below its level
        "out": reservoir(AMBIENT, elevation=5.0),
        "still": tank(20.0, 3.0, elevation=20.0),
        "one": tank(3.0, 5.0, elevation=30.1),
        "two": tank(7.0, 2.0, elevation=33.1),
    }
    rough = {"friction": friction}
    links = {
        "in": pipe("hill", "middle", 400.0, 0.3, 1000.0, 20, **rough),
        "on": pipe("middle", "low", 400.0, 0.3, 1000.0, 20, **rough),
        "ha": pipe("hill", "a", 330.0, 0.35, 1100.0, 17, **rough),
        "ab": pipe("a", "b", 271.3, 0.25, 1000.0, 11, **rough),
        "bc": pipe("c", "b", 315.7, 0.2, 1200.0, 13, **rough),
        "ac": pipe("a", "c", 402.0, 0.25, 900.0, 19, **rough),
        "cl": pipe("c", "low", 150.0, 0.3, 1150.0, 7, **rough),
        "column": {
            "type": "rigid-column",
            "from": "hill",
            "to": "low",
            "length": 500.0,
            "diameter": 0.2,
            **rough,
        },
        "tap": valve("c", "out", 0.002),
        "shut": valve("still", "a", 0.01, 0.0),
        "gap": valve("one", "two", 1e-4),
        "bar": valve("two", "b", 0.01, 0.0),
    }
    settings = {"courant": 0.9, "method": "ssp-rk3", **numerics}
    probes = [f"{n}.pressure" for n in "abc"] + [
        "middle.level",
        "still.level",
        "one.level",
        "two.level",
    ]
    probes += ["tap.flow", "shut.flow", "gap.flow", "column.flow"]
    for name in ("in", "on", "ha", "ab", "bc", "ac", "cl"):
        probes += [f"{name}.{what}@{x}" for what in ("pressure", "flow") for x in (0.0, 0.31, 1.0)]
    fluid = {**scenes.WATER, "law": law}
    return scene(nodes, links, end, settings, probes, 1.0, fluid=fluid)


def moved(result, name: str) -> float:
    return float(np.ptp(result[name]))


def still_probes(result) -> tuple[list[str], list[str]]:
    """Names of the probes of pipes and junctions, and names of all others."""
    names = [str(p) for p in result.probes]
    pipes = [n for n in names if "@" in n or n.split(".")[0] in "abc"]
    return pipes, [n for n in names if n not in pipes]
