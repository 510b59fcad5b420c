"""Cases of small basins of each physics for runs with threads and ranks."""

from reference.scenes import AMBIENT, reservoir, scene

VALVE = {"type": "valve", "from": "pool.near", "to": "river", "area": 0.05}
PIPE = {
    "type": "pipe",
    "from": "pool.near",
    "to": "river",
    "length": 10.0,
    "diameter": 0.3,
    "cells": 5,
    "wave_speed": 100.0,
    "friction": {"model": "steady", "factor": 0.02},
}
POOL = {
    "type": "basin",
    "size": [4.0, 3.0],
    "cells": [8, 12],
    "level": 0.5,
    "manning": 0.02,
    "bed": "0.6*exp(-((x-2)^2 + (y-1.4)^2))",
    "start": {"level": "0.5 + where(y < 1.2, 0.2, 0) + 0.02*x"},
    "patches": {
        "near": {"side": "west"},
        "far": {"side": "east", "boundary": "open"},
        "top": {"side": "north", "span": [1.0, 2.0], "boundary": "open"},
    },
}
PROBES = ["pool.near.head", "near.flow", "pool.depth@1.1,1.3", "pool.u@3,2.9"]


def water(link=VALVE, basin=None, end=0.2, probes=PROBES, **numerics):
    numerics = {"scheme": "muscl", "method": "ssp-rk2", **numerics}
    numerics |= {} if {"step", "rtol"} & {*numerics} else {"courant": 0.5}
    nodes = {"pool": POOL | (basin or {})} | ({"river": reservoir(AMBIENT + 2e3)} if link else {})
    probes = probes if link else [one for one in probes if "@" in one]
    return scene(nodes, {"near": link} if link else {}, end, numerics, probes, every=0.05)


HOLLOW = {"cells": [48, 60], "holes": [[0.15, 0.2, 0.25, 0.3]]}
MESH = {"cells": [60, 50], "holes": [[1.8, 1.2, 2.6, 1.8]]}  # 2880 cells: twelve blocks


def liquid(law="linear", scheme="muscl", boundary="open", **mesh):
    block = {
        "type": "basin",
        "physics": "liquid",
        "size": [0.4, 0.5],
        "cells": [7, 15],
        "pressure": 1e7,
        "thickness": 0.1,
        "patches": {
            "near": {"side": "west", "span": [0.1, 0.3]},
            "far": {"side": "north", "boundary": boundary},
        },
        **mesh,
    }
    valve = {"type": "valve", "from": "pool.near", "to": "river", "area": 1e-4}
    numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.8, "initial": "rest"}
    probes = ["near.flow", "pool.pressure@0.2,0.3", "pool.near.pressure"]
    fluid = {
        "name": "user",
        "density": 1000.0,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "vapor_pressure": 2300.0,
    }
    return scene(
        {"pool": block, "river": reservoir(2e7)},
        {"near": valve},
        3e-4,
        numerics,
        probes,
        every=1e-4,
        fluid=fluid | {"law": law},
    )


def dyed(scheme="muscl", mesh=None, **dye):
    patches = {"near": {"side": "west", "span": [1.0, 2.0]}}
    pool = {"patches": patches, "scalars": {"dye": "where(y < 1.5, 1, 0.2)"}} | (mesh or {})
    found = water(VALVE, pool, probes=["pool.dye@1.1,1.4", "near.flow"], scheme=scheme)
    return found | {"scalars": {"dye": {"unit": "mg/l", "initial": 0.4, **dye}}}


def carried(scheme="muscl", diffusivity=0.0):
    sheet = {
        "type": "basin",
        "physics": "transport",
        "size": [1.0, 1.0],
        "cells": [11, 12],
        "velocity": {"expression": "swirl", "period": 1.0},
        "scalars": {"dye": "exp(-20*((x-0.3)^2+(y-0.5)^2))"},
    }
    numerics = {"scheme": scheme, "method": "ssp-rk3", "courant": 0.8}
    dye = {"unit": "mg/l", "diffusivity": diffusivity}
    return scene(
        {"sheet": sheet},
        {},
        0.25,
        numerics,
        ["sheet.dye@0.3,0.5"],
        every=0.05,
        scalars={"dye": dye},
    )


def lined(**numerics):
    """Case of delay lines between a basin, a chamber and a demand that stops, with jumps within steps."""
    case = water(
        PIPE | {"pipe_model": "delay-line", "to": "air"},
        end=0.3,
        probes=["pool.near.head", "air.pressure"],
        **numerics,
    )
    del case["nodes"]["river"]
    case["nodes"] |= {
        "air": {"type": "chamber", "volume": 50.0},
        "gate": {
            "type": "junction",
            "demand": {"time": [0.0, 0.0503], "value": [0.02, 0.0], "kind": "step"},
        },
    }
    case["links"]["far"] = PIPE | {
        "from": "air",
        "to": "gate",
        "length": 7.0,
        "pipe_model": "delay-line",
    }
    return case


def with_maxima(case, *basins):
    """Case that records the greatest values in cells of the basins."""
    return case | {"output": case["output"] | {"maxima": [*basins], "wet_depth": 0.02}}


RAIN = {"rain": {"time": ["0 s", "0.1 s", "0.3 s"], "value": ["0 mm/h", "9 m/h", "1 m/h"]}}
HORTON = {"model": "horton", "initial": "(6 + x)/3600", "final": "1 m/h", "decay": "5 1/s"}
GREEN_AMPT = {"model": "green-ampt", "conductivity": "1 m/h", "suction": "9 cm", "deficit": 0.4}
SCENES = {
    "upwind, euler": water(scheme="upwind", method="euler"),
    "muscl, ssp-rk2": water(),
    "muscl, a limiter of its own, rk4": water(limiter="minmod", method="rk4"),
    "upwind5, ssp-rk3": water(scheme="upwind5", method="ssp-rk3"),
    "weno5, ssp-rk3": water(scheme="weno5", method="ssp-rk3"),
    "walls all around": water(basin={"patches": {"near": {"side": "west"}}}),
    "given steps": water(step=2e-3),
    "a tolerance": water(rtol=1e-3, method="bogacki-shampine", probes=()),
    "a tolerance, first same as last": water(rtol=1e-4, method="dormand-prince"),
    "a pipe": water(PIPE, end=0.1, probes=["pool.near.head", "pool.depth@1.1,1.3"]),
    "delay lines": lined(),
    "delay lines, given steps": lined(step=2e-3, method="rk4"),
    "dense output of its own": water(method="rk4"),
    "a liquid": liquid(),
    "a liquid between walls": liquid(boundary="wall"),
    "a liquid, upwind5": liquid(scheme="upwind5"),
    "a liquid, weno5, log": liquid("log", "weno5"),
    "a liquid, log": liquid("log"),
    "a dye in water": dyed(),
    "a dye in water that spreads, upwind": dyed("upwind", diffusivity=1e-3),
    "greatest values": with_maxima(water(), "pool"),
    "rain and Horton": water(basin=RAIN | {"infiltration": HORTON}),
    "rain and Green-Ampt, rk4": water(basin=RAIN | {"infiltration": GREEN_AMPT}, method="rk4"),
    "a mesh, rain and Green-Ampt": water(basin=MESH | RAIN | {"infiltration": GREEN_AMPT}),
    "a dye": carried(),
    "a dye that spreads, upwind": carried("upwind", 1e-3),
    "a mesh": with_maxima(water(basin=MESH), "pool"),
    "a mesh, upwind, euler": water(basin=MESH, scheme="upwind", method="euler"),
    "a mesh, a tolerance": water(basin=MESH, rtol=1e-3, method="bogacki-shampine", probes=()),
    "a mesh, a pipe": water(PIPE, MESH, end=0.1, probes=["pool.near.head", "pool.depth@1.1,1.3"]),
    "a liquid on a mesh": liquid(**HOLLOW),
    "a liquid on a mesh, log": liquid("log", **HOLLOW),
}
