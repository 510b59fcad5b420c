"""Valley with manholes, shafts and conduits, into which water is let go."""


def pool(**top) -> dict:
    """Water of 1.2 m that is let go in a sloping valley of 24 m x 12 m."""
    basin = {
        "type": "basin",
        "cells": [24, 12],
        "size": ["24 m", "12 m"],
        "elevation": "0 m",
        "level": "0 m",
        "bed": "0.05*x + 0.02*(y - 6)**2",
        "manning": 0.03,
        "start": {"level": "where(x < 6, 1.2, 0)"},
        "patches": {
            "east": {"side": "east"},
            "gully": {"at": ["15.5 m", "6.5 m"], "area": "1 m2"},
            "second": {"at": ["20.5 m", "6.5 m"], "area": "1 m2"},
        },
    }
    manhole = {"type": "manhole", "crest": "5 m", "area": "0.3 m2", "perimeter": "2 m"}
    shaft = {"type": "tank", "area": "1 m2", "elevation": "-3 m", "level": "0.4 m"}
    conduit = {"type": "conduit", "diameter": "0.4 m", "manning": 0.013, "cells": 4}
    case = {
        "schema": 1,
        "title": "Pool",
        "fluid": {"name": "Water"},
        "nodes": {
            "valley": basin,
            "upper": dict(shaft),
            "lower": dict(shaft),
            "river": {"type": "reservoir", "elevation": "-3 m", "head": "-2.6 m"},
        },
        "links": {
            "lid": {**manhole, "from": "valley.gully", "to": "upper"},
            "cover": {**manhole, "from": "valley.second", "to": "lower"},
            "sewer": {
                **conduit,
                "from": "upper",
                "to": "lower",
                "length": "5 m",
                "inverts": ["-3 m", "-3 m"],
            },
            "outfall": {
                **conduit,
                "from": "lower",
                "to": "river",
                "length": "8 m",
                "inverts": ["-3 m", "-3 m"],
            },
        },
        "numerics": {"end": "4 s"},
        "output": {
            "fields": 5,
            "maxima": ["valley"],
            "probes": ["valley.volume"],
            "gauges": {"middle": {"basin": "valley", "at": ["12.5 m", "6.5 m"]}},
            "sections": {
                "line": {"basin": "valley", "from": ["12 m", "0 m"], "to": ["12 m", "12 m"]}
            },
        },
    }
    return case | top
