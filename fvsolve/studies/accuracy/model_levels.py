"""Overrides of a case that turn it into a simpler or richer model (a level of the model hierarchy).

Levels of pipes are rigid columns, lumped volumes, delay lines, and few or many cells. Levels of tanks on moving bodies
are frozen water (a rigid mass), sloshing modes and cells.
"""

import math
from typing import Any

import numpy as np

from fvsolve.case.raw import raw_link
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.steady_friction import drag
from fvsolve.model.delay_lines import reason_for_cells
from fvsolve.studies.outcome import study_model

SLOSHING = ("frozen", "modes", "cells")
MIN_REFINED_CELLS = 4  # sides of a tank with at most so many cells are not refined
CELL_NUMERICS = {"numerics.method": "ssp-rk3", "numerics.courant": 0.7}
LUMPED_NUMERICS = {"numerics.method": "auto", "numerics.rtol": 1e-7}


class NotApplicable(Exception):
    """Raised, with the reason, if a case cannot be turned into a model level."""


def level_names(case) -> list[str]:
    """Names of the model levels of a case, such as "rigid column", simplest first."""
    pipes = [link for link in case.links.values() if link.kind == "pipe"]
    if sloshing_basins(case):
        return list(SLOSHING)
    if not pipes:
        return ["as it is"]
    greatest = max(pipe.cells for pipe in pipes)
    counts = [2**k for k in range(20) if 2 ** (k + 1) <= greatest]
    cells = [f"{count} cell{'s' * (count > 1)}" for count in counts]
    return ["rigid column", "lumped volume", "column and volume", "delay lines", *cells, "full line"]


def sloshing_basins(case) -> dict[str, Any]:
    """Basins with a free surface that are mounted on bodies: name -> node."""
    basins = {name: node for name, node in case.nodes.items() if node.kind == "basin"}
    return {name: node for name, node in basins.items() if node.on and node.physics_type.has_modes}


def finer_levels(case, doublings: int) -> list[str]:
    """Names of model levels finer than the case itself, each with twice the cells of the level before.

    doublings : number of levels. The list is empty if the case has neither pipes nor tanks on bodies, or if a tank on a
    body does not state its cells.
    """
    refinable = any(link.kind == "pipe" for link in case.links.values())
    if basins := sloshing_basins(case):
        refinable = all(basin.cells for basin in basins.values())
    return [f"{2**k} times the cells" for k in range(1, doublings + 1)] if refinable else []


def level_keys(case, level: str) -> dict[str, Any]:
    """Overrides that turn a case into the model level with this name. Raises NotApplicable if this is impossible."""
    if level in ("full line", "as it is"):
        return {}
    if sloshing_basins(case):
        return sloshing_keys(case, level)
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    if level.endswith("times the cells"):
        factor, step = int(level.split()[0]), case.numerics.step
        keys = {f"links.{name}.cells": factor * pipe.cells for name, pipe in pipes.items()}
        return keys if step is None else keys | {"numerics.step": step / factor}
    if level == "delay lines":
        return delay_line_keys_of(case, pipes)
    if level.endswith(("cell", "cells")):
        count, greatest = int(level.split()[0]), max(pipe.cells for pipe in pipes.values())
        return {f"links.{name}.cells": max(1, round(pipe.cells * count / greatest)) for name, pipe in pipes.items()}
    keys = {"expect": {}, "compare": {}, "routes": {}, "limits": {}, **LUMPED_NUMERICS}
    keys["output.probes"] = [probe.text for probe in case.output.probes if probe.part != "links"
                             or probe.name not in pipes or probe.text == f"{probe.name}.flow"]  # fmt: skip
    if level != "lumped volume":
        keys |= {f"links.{name}": rigid_column(case, name) for name in pipes}
    else:
        model = study_model(case)
        keys |= {f"links.{name}": orifice_of(case, model, name) for name in pipes}
    if level != "rigid column":
        keys |= junction_chambers(case, pipes)
    return keys


def sloshing_keys(case, level: str) -> dict[str, Any]:
    """Overrides that turn a case with tanks on bodies into the model level with this name.

    All tanks have frozen water, sloshing modes or cells. The cells are those of the case, or a multiple of them along
    sides with more than `MIN_REFINED_CELLS` cells.
    """
    basins, keys = sloshing_basins(case), {"expect": {}, "compare": {}, "routes": {}, "limits": {}}
    if level in ("frozen", "modes"):
        quantities = {"frozen": (), "modes": ("depth",)}[level]
        probes = [entry for entry in case.output.probes if entry.name not in basins or entry.quantity in quantities]
        keys["output.probes"] = [entry.text for entry in probes]
        return keys | {f"nodes.{name}.sloshing": level for name in basins} | LUMPED_NUMERICS
    keys |= {f"nodes.{name}.sloshing": "cells" for name in basins}
    if any(basin.lumped for basin in basins.values()):
        keys |= CELL_NUMERICS
    if level == "cells":
        return keys
    factor, step = int(level.split()[0]), case.numerics.step
    keys |= {f"nodes.{name}.cells": [factor * entry if entry > MIN_REFINED_CELLS else entry for entry in basin.cells]
              for name, basin in basins.items()}  # fmt: skip
    return keys if step is None else keys | {"numerics.step": step / factor}


def delay_line_keys_of(case, pipes: dict[str, Any]) -> dict[str, Any]:
    """Overrides that make all pipes delay lines. Raises NotApplicable if a pipe cannot be a delay line."""
    for name, pipe in pipes.items():
        if reason := reason_for_cells(case, name, pipe):
            raise NotApplicable(f"{name} cannot be a delay line: {reason}")
    return {f"links.{name}.pipe_model": "delay-line" for name in pipes}


def rigid_column(case, name: str) -> dict[str, Any]:
    """Table of the case (key -> value) that describes a pipe as a rigid column."""
    names = ("from", "to", "length", "diameter", "friction", "minor_loss", "initial_flow")
    raw = {"diameter": case.links[name].diameter, **raw_link(case.raw, name)}
    table = {"type": "rigid-column", **{key: raw[key] for key in names if key in raw}}
    if table.get("friction", {}).get("model") == "unsteady":  # a rigid column has no unsteady friction
        friction = {key: value for key, value in table["friction"].items() if key in ("roughness", "factor")}
        table["friction"] = {"model": "quasi-steady", **friction}
    return table


def orifice_of(case, model, name: str) -> dict[str, Any]:
    """Table of the case (key -> value) for an orifice with the friction loss of a pipe at its initial flow.

    The loss is dp = zeta rho v^2 / 2, with loss coefficient zeta, density rho and velocity v. Raises NotApplicable if
    zeta is not known or not positive.
    """
    row = model.tables.pipes[[pipe.name for pipe in model.pipes].index(name)]
    law = [row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds")]
    flow, scale = float(row["flow"]), 2.0 * model.case.properties.density * row["area"] * case.links[name].length
    if law[0] not in (rec.FRICTION_NONE, rec.FRICTION_FACTOR) and flow == 0.0:
        raise NotApplicable(f"{name} is at rest at the start, so its friction loss is not known")
    zeta = float(scale * (drag(*law, flow) / (abs(flow) * flow) if flow else row["loss"]))
    if not zeta > 0.0:
        raise NotApplicable(f"{name} has no friction, so there is no resistance between two volumes")
    raw = {"diameter": case.links[name].diameter, **raw_link(case.raw, name)}
    return {"type": "orifice", "from": raw["from"], "to": raw["to"], "diameter": raw["diameter"],
            "loss_coefficient": zeta}  # fmt: skip


def junction_chambers(case, pipes: dict) -> dict[str, Any]:
    """Overrides that turn junctions into chambers, each with half the volume of every adjacent pipe.

    Reservoirs, tanks and accumulators are kept. The volume of a chamber of the case is increased. Volumes of pipes are
    multiplied by beta / (rho a^2), so that the chambers, in which the bulk modulus of the fluid is beta, are as elastic
    as fluid and pipe wall together (density rho, wave speed a). Raises NotApplicable if a node cannot be
    a chamber, or if no node becomes one.
    """
    volume_of: dict[str, float] = {}
    fluid = case.properties
    for name, pipe in pipes.items():
        stiffness = fluid.density * case.wave_speed(name) ** 2
        half_volume = 0.125 * math.pi * pipe.diameter**2 * pipe.length * fluid.bulk_modulus / stiffness
        for end in pipe.ports.values():
            volume_of[end] = volume_of.get(end, 0.0) + half_volume
    chambers = {}
    for name, volume in volume_of.items():
        node = case.nodes.get(name, case.places[name])
        if node.kind in ("reservoir", "tank", "accumulator"):
            continue
        if node.kind not in ("junction", "inflow", "chamber"):
            raise NotApplicable(f"a volume at {name} would replace the {node.kind}")
        if name not in case.nodes:
            raise NotApplicable(f"{name} is a chamber of a cylinder, to which no other volume can be added")
        raw = case.raw["nodes"][name]
        if node.kind == "inflow" or (node.kind == "junction" and np.any(node.demand.value != 0.0)):
            raise NotApplicable(f"flow enters or leaves at {name}, which a volume cannot represent")
        start_keys = {key: raw[key] for key in ("elevation", "position", "initial_pressure") if key in raw}
        own_volume = node.volume if node.kind == "chamber" else 0.0
        chambers[f"nodes.{name}"] = {"type": "chamber", "volume": own_volume + volume, **start_keys}
    if not chambers:
        raise NotApplicable(
            "all ends of the pipes are reservoirs, tanks or accumulators, so no node can take the pipes' volumes"
        )
    return chambers
