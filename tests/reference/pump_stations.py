"""Cases of a pump station with a check valve, a vessel and a main."""

from reference import scenes
from reference.scenes import junction, lake, pipe, scene


def station(at: float | str = 20.0, **more) -> dict:
    """Case of a check valve behind a pump, a main with a vessel, and a reservoir on a hill."""
    nodes = {
        "sump": lake(5.0, elevation=0.0),
        "out": junction(elevation=0.0),
        "top": lake(60.0, elevation=50.0),
        "vessel": {"type": "accumulator", "volume": 5.0, "gas_volume": 2.0, "on": "main", "at": at},
    }
    rub = {"model": "quasi-steady", "roughness": 1e-4}
    links = {
        "pump": scenes.pump(
            "sump",
            "header",
            curve={"flow": [0.0, 0.2, 0.3], "head": [90.0, 70.0, 50.0]},
            trip=0.5,
            rated_speed=150.0,
            inertia=20.0,
        ),
        "flap": {"type": "check-valve", "from": "header", "to": "out", "area": 0.1},
        "main": pipe("out", "top", 2600.0, 0.5, 1000.0, 60, friction=rub) | more,
    }
    nodes["header"] = {"type": "chamber", "volume": 0.1, "elevation": 0.0}
    return scene(nodes, links, 2.0, {"scheme": "muscl"}, ["vessel.pressure"])
