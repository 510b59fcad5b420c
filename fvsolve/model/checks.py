"""What was understood of a case, before it runs. Knows the model; computes no flow of its own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.kernels.friction import drag
from fvsolve.steppers.tableau import method_named

SECONDS_PER_CELL_STEP = 5e-9  # of a method with three stages; benchmarks/kernels.py
SECONDS_PER_STEP = 1.5e-6
STIFF = 3.0  # times as many steps as waves ask for: from there on an implicit method is worth a try


def checks(model) -> dict[str, Any]:
    """Pipes, nodes, the step and what sets it, the number of steps and the expected run time; SI."""
    rho, viscosity = model.case.properties.density, model.case.properties.viscosity
    nodes = {
        name: {"elevation": row["elevation"].item(), "pressure": row["pressure"].item(),
               "head": float(model.head(row["pressure"], row["elevation"]))}
        for name, row in zip(model.node_names, model.tables[rec.I_NODES], strict=True)
    }  # fmt: skip
    bodies = {
        name: {"position": row["position"].item(), "velocity": row["velocity"].item(), "force": row["force"].item()}
        for name, row in zip(model.body_names, model.tables[rec.I_BODIES], strict=False)
    }
    pipes, remembered = {}, model.steady["unsteady"]
    for mesh, row in zip(model.pipes, model.tables[rec.I_PIPES], strict=True):
        velocity = row["flow"] / (rho * row["area"])
        dynamic = row["area"] * mesh.length / (mesh.diameter * row["area"]) * rho * velocity**2 / 2.0
        law = (row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds", "flow"))
        loss = drag(*law) / row["area"] * mesh.length
        pipes[mesh.name] = {
            "length": mesh.length, "cells": mesh.cells, "wave_speed": mesh.wave_speed,
            "travel_time": mesh.length / mesh.wave_speed, "velocity": float(velocity),
            "reynolds": float(rho * abs(velocity) * mesh.diameter / viscosity) if viscosity else None,
            "friction_factor": float(abs(loss) / dynamic) if dynamic > 0 else None,
            "from_head": nodes[mesh.from_]["head"], "to_head": nodes[mesh.to]["head"],
            **({"unsteady": remembered[mesh.name]} if mesh.name in remembered else {}),
        }  # fmt: skip
    step, set_by = step_and_reason(model)
    numerics = model.case.numerics
    span = numerics.end - numerics.start
    steps = math.ceil(span / step) if step else None
    cost = SECONDS_PER_STEP + SECONDS_PER_CELL_STEP * model.cells
    return {
        "nodes": nodes, "bodies": bodies, "pipes": pipes, "states": model.y_size, "cells": model.cells, "step": step,
        "step_set_by": set_by, "steps": steps, "expected_seconds": steps * cost if steps else None,
        "moving": model.steady["moving"], "warnings": model.warnings,
    }  # fmt: skip


def step_and_reason(model) -> tuple[float | None, str]:
    """The step at the start [s] and the part that sets it; None where error control chooses."""
    numerics = model.case.numerics
    if numerics.step is not None:
        return numerics.step, "numerics.step"
    if numerics.rtol is not None:
        return None, f"error control, rtol = {numerics.rtol:g}"
    if method_named(numerics.method).explicit:
        own = model.wave_rates * model.tables[rec.I_PIPES]["quicker"]
        own = np.maximum(own, [model.steady["unsteady"].get(pipe.name, {"rate": 0.0})["rate"] for pipe in model.pipes])
        rate = float(model.evaluate(numerics.start, np.zeros(model.y_size), numerics.start)[1][rec.RATE])
    else:  # waves alone: implicit steps cope with the rest
        own, rate = model.wave_rates, float(model.wave_rates.max(initial=0.0))
    if not rate > 0.0:
        return None, "nothing limits it"
    if len(own) and own.max() >= rate * (1 - 1e-12):
        name = model.pipes[int(np.argmax(own))].name
        return numerics.courant / rate, f"links.{name}: its cells have the shortest travel time"
    part = "a chamber, tank, rigid column or mass, quicker than every pipe cell"
    if len(own) and rate > STIFF * own.max():
        part += f', {rate / own.max():.3g} times; rtol with method = "rodas-5p" does not follow it'
    return numerics.courant / rate, part
