"""Design study of a main with a tap: its case and its file."""

from reference.scenes import area, junction, lake, pipe, reservoir, scene, valve


def throttled() -> dict:
    """Case of a lake, a main and an open tap, with limits on the pressure in the main."""
    nodes = {
        "lake": lake(50.0, elevation=0.0),
        "gate": junction(elevation=10.0),
        "air": reservoir(1e5, elevation=10.0),
    }
    rough = {"model": "quasi-steady", "roughness": 1e-4}
    links = {
        "main": pipe("lake", "gate", 500.0, 0.2, 1000.0, 10, friction=rough),
        "tap": valve("gate", "air", 0.02 * area(0.2)),
    }
    limits = {
        "top": {"on": "main", "quantity": "gauge_pressure", "maximum": "8 bar"},
        "dry": {"on": "main", "minimum": "vacuum"},
    }
    return scene(
        nodes, links, 4.0, {"scheme": "muscl", "courant": 0.8}, ["gate.pressure"], limits=limits
    )


STUDY = """
title = "Two taps"
case = "main.toml"

[events.fast.links.tap]
opening = { start = "0.5 s", duration = "0.1 s", value = [1.0, 0.0] }

[events.slow]
"links.tap.opening" = { start = "0.5 s", duration = "3 s", value = [1.0, 0.0] }

[protections.none]

[protections.vessel.nodes.vessel]
type = "accumulator"
volume = 1.0
gas_volume = 0.3
on = "main"
at = 450.0
"""
