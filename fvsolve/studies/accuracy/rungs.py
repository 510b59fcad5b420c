"""A scene said with less: rigid columns, lumped volumes, few cells, water in tanks as ice or as modes, as keys of a
case. Knows parts; runs nothing.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fvsolve.case.defaults import link_said
from fvsolve.kernels import records as rec
from fvsolve.kernels.friction import drag
from fvsolve.model.delay import what_needs_cells
from fvsolve.studies.outcome import prepared

SLOSHING = ("frozen", "modes", "cells")
THIN = 4  # cells across a tank up to which nothing is followed there
WITH_CELLS = {"numerics.method": "ssp-rk3", "numerics.courant": 0.7}
WITHOUT_CELLS = {"numerics.method": "auto", "numerics.rtol": 1e-7}


class Unsayable(Exception):
    """Why a case cannot be said by a rung."""


def structures(case) -> list[str]:
    """Names of the rungs of a case, poorest first."""
    pipes = [link for link in case.links.values() if link.kind == "pipe"]
    if tanks(case):
        return list(SLOSHING)
    if not pipes:
        return ["as it is"]
    most = max(pipe.cells for pipe in pipes)
    counts = [2**k for k in range(20) if 2 ** (k + 1) <= most]
    cells = [f"{count} cell{'s' * (count > 1)}" for count in counts]
    return ["rigid column", "lumped volume", "column and volume", "delay lines", *cells, "full line"]


def tanks(case) -> dict[str, Any]:
    """Basins with a free surface that ride on bodies."""
    return {name: one for name, one in case.nodes.items() if one.kind == "basin" and one.on and one.own.sloshes}


def finer(case, doublings: int) -> list[str]:
    """Names of rungs above the case's own, each with twice the cells of the one before; none without any to say so."""
    able = any(link.kind == "pipe" for link in case.links.values())
    if riding := tanks(case):
        able = all(basin.cells for basin in riding.values())
    return [f"{2**k} times the cells" for k in range(1, doublings + 1)] if able else []


def restated(case, rung: str) -> dict[str, Any]:
    """The keys that say a case by a rung; raises Unsayable where it cannot be."""
    if rung in ("full line", "as it is"):
        return {}
    if tanks(case):
        return sloshing(case, rung)
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    if rung.endswith("times the cells"):
        times, step = int(rung.split()[0]), case.numerics.step
        found = {f"links.{name}.cells": times * pipe.cells for name, pipe in pipes.items()}
        return found if step is None else found | {"numerics.step": step / times}
    if rung == "delay lines":
        return delayed(case, pipes)
    if rung.endswith(("cell", "cells")):
        count, most = int(rung.split()[0]), max(pipe.cells for pipe in pipes.values())
        return {f"links.{name}.cells": max(1, round(pipe.cells * count / most)) for name, pipe in pipes.items()}
    found = {"expect": {}, "compare": {}, "routes": {}, "limits": {}, **WITHOUT_CELLS}
    found["output.probes"] = [probe.text for probe in case.output.probes if _survives(probe, pipes)]
    if rung != "lumped volume":
        found |= {f"links.{name}": column(case, name) for name in pipes}
    else:
        model = prepared(case)
        found |= {f"links.{name}": resistance(case, model, name) for name in pipes}
    if rung != "rigid column":
        found |= volumes(case, pipes)
    return found


def sloshing(case, rung: str) -> dict[str, Any]:
    """Water of all tanks that ride as ice, by its modes, or by cells, those of the case or so many times as many."""
    riding, found = tanks(case), {"expect": {}, "compare": {}, "routes": {}, "limits": {}}
    if rung in ("frozen", "modes"):
        left = {"frozen": (), "modes": ("depth",)}[rung]
        found["output.probes"] = [
            one.text for one in case.output.probes if one.name not in riding or one.quantity in left
        ]
        return found | {f"nodes.{name}.sloshing": rung for name in riding} | WITHOUT_CELLS
    found |= {f"nodes.{name}.sloshing": "cells" for name in riding}
    if any(basin.lumped for basin in riding.values()):
        found |= WITH_CELLS
    if rung == "cells":
        return found
    times, step = int(rung.split()[0]), case.numerics.step
    found |= {f"nodes.{name}.cells": [times * one if one > THIN else one for one in basin.cells]
              for name, basin in riding.items()}  # fmt: skip
    return found if step is None else found | {"numerics.step": step / times}


def delayed(case, pipes: dict[str, Any]) -> dict[str, Any]:
    """All pipes as delay lines."""
    for name, pipe in pipes.items():
        if lacks := what_needs_cells(case, name, pipe):
            raise Unsayable(f"{name} is no delay line: {lacks}")
    return {f"links.{name}.line": "delay" for name in pipes}


def _survives(probe, pipes: dict) -> bool:
    return probe.part != "links" or probe.name not in pipes or probe.text == f"{probe.name}.flow"


def column(case, name: str) -> dict[str, Any]:
    """A pipe as a rigid column."""
    keys = ("from", "to", "length", "diameter", "friction", "minor_loss", "initial_flow")
    said = {"diameter": case.links[name].diameter, **link_said(case.raw, name)}
    found = {"type": "rigid-column", **{key: said[key] for key in keys if key in said}}
    if found.get("friction", {}).get("model") == "unsteady":  # a column has no memory
        kept = {key: value for key, value in found["friction"].items() if key in ("roughness", "factor")}
        found["friction"] = {"model": "quasi-steady", **kept}
    return found


def resistance(case, model, name: str) -> dict[str, Any]:
    """A pipe as the drop that its friction takes from the flow of the start, dp = zeta rho v^2 / 2."""
    row = model.tables.pipes[[pipe.name for pipe in model.pipes].index(name)]
    law = [row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds")]
    flow, per = float(row["flow"]), 2.0 * model.case.properties.density * row["area"] * case.links[name].length
    if law[0] not in (rec.FRICTION_NONE, rec.FRICTION_FACTOR) and flow == 0.0:
        raise Unsayable(f"{name} is at rest at the start, so what its friction takes is not known")
    zeta = float(per * (drag(*law, flow) / (abs(flow) * flow) if flow else row["loss"]))
    if not zeta > 0.0:
        raise Unsayable(f"{name} has no friction, so nothing is left of it between two volumes")
    said = {"diameter": case.links[name].diameter, **link_said(case.raw, name)}
    return {"type": "orifice", "from": said["from"], "to": said["to"], "diameter": said["diameter"],
            "loss_coefficient": zeta}  # fmt: skip


def volumes(case, pipes: dict) -> dict[str, Any]:
    """The junctions that pipes touch as chambers that hold half of each, wall and all: V beta / K."""
    held: dict[str, float] = {}
    fluid = case.properties
    for name, pipe in pipes.items():
        stiff = fluid.density * case.wave_speed(name) ** 2
        half = 0.125 * math.pi * pipe.diameter**2 * pipe.length * fluid.bulk_modulus / stiff
        for end in pipe.ports.values():
            held[end] = held.get(end, 0.0) + half
    found = {}
    for name, volume in held.items():
        node = case.nodes.get(name, case.places[name])
        if node.kind in ("reservoir", "tank", "accumulator"):
            continue
        if node.kind not in ("junction", "inflow", "chamber"):
            raise Unsayable(f"a volume at {name} would take the place of the {node.kind}")
        if name not in case.nodes:
            raise Unsayable(f"{name} belongs to a cylinder and holds no more than its own volume")
        said = case.raw["nodes"][name]
        if node.kind == "inflow" or (node.kind == "junction" and np.any(node.demand.value != 0.0)):
            raise Unsayable(f"flow enters or leaves at {name}, which a volume does not do by itself")
        keys = {key: said[key] for key in ("elevation", "position", "initial_pressure") if key in said}
        own = node.volume if node.kind == "chamber" else 0.0
        found[f"nodes.{name}"] = {"type": "chamber", "volume": own + volume, **keys}
    if not found:
        raise Unsayable("all ends hold their pressure, so there is no volume between them")
    return found
