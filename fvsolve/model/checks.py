"""What was understood of a case, before it runs. Knows the model; computes no flow of its own."""

from __future__ import annotations

import math
from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np

from fvsolve.attitude import roll_pitch_yaw
from fvsolve.case.basins import behind, patch_names
from fvsolve.errors import Notice, listing
from fvsolve.kernels import records as rec
from fvsolve.kernels.friction import drag
from fvsolve.parts.pipe.materials import materials
from fvsolve.parts.pipe.wall import Wall, restraint_factor
from fvsolve.steppers.automatic import first_method
from fvsolve.steppers.methods import AUTO
from fvsolve.steppers.tableau import method_named

TRIED = 1e-3  # of what counts as a small deviation: the states whose rates are timed, for at rest much is skipped
LONG = 1e-3  # [s] that a timing takes at least
SECONDS_PER_STEP = 5e-7  # beside the rates
LOCAL = 0.05  # by which sound at a pressure may be quicker than at the reference, where the law is not linear
QUICKER = 0.1  # share of the greatest rate that a valve must make to be what sets the step
MOST_TRIED = 100  # valves
DEAR, MANY = 10.0, 20_000  # times the waves' rate, and steps, from which on `check` warns of the cost
BOUNDARY = 3.3  # of h times the greatest rate: what explicit methods with an error estimate bear, about
STIFF = 3.0  # times as many steps as waves ask for: from there on an implicit method is worth a try


def checks(model) -> dict[str, Any]:
    """Pipes, basins, nodes, the step and what sets it, the number of steps and the expected run time; SI."""
    rho, viscosity = model.case.properties.density, model.case.properties.viscosity
    nodes = {
        name: {"elevation": row["elevation"].item(), "pressure": row["pressure"].item(),
               "head": float(model.head(row["pressure"], row["elevation"]))}
        for name, row in zip(model.node_names, model.tables.nodes, strict=True)
    }  # fmt: skip
    masses = {
        name: {"position": row["position"].item(), "velocity": row["velocity"].item(), "force": row["force"].item()}
        for name, row in zip(model.mass_names, model.tables.masses, strict=False)
    }
    bodies = {name: stands(pose) for name, pose in model.case.poses.items()}
    pipes, remembered, creeps = {}, model.steady["unsteady"], model.steady["creep"]
    for k, (mesh, row) in enumerate(zip(model.pipes, model.tables.pipes, strict=True)):
        velocity = row["flow"] / (rho * row["area"])
        dynamic = row["area"] * mesh.length / (mesh.diameter * row["area"]) * rho * velocity**2 / 2.0
        law = (row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds", "flow"))
        loss, link = drag(*law) / row["area"] * mesh.length, model.case.links[mesh.name]
        rubs = dynamic > 0 and link.friction.model != "none"
        pipes[mesh.name] = {
            "length": mesh.length, "cells": mesh.cells, "wave_speed": (speed := start_speed(model, k)),
            "travel_time": mesh.length / speed, "velocity": float(velocity),
            "reynolds": float(rho * abs(velocity) * mesh.diameter / viscosity) if viscosity else None,
            "friction_factor": float(rubbed(loss, link, rho, velocity) / dynamic) if rubs else None,
            "from_head": nodes[mesh.from_]["head"], "to_head": nodes[mesh.to]["head"],
            **model.steady["lines"][mesh.name],
            **({"unsteady": remembered[mesh.name]} if mesh.name in remembered else {}),
            **({"creep": creeps[mesh.name]} if mesh.name in creeps else {}), **wall_facts(link),
        }  # fmt: skip
    step, set_by = step_and_reason(model)
    numerics = model.case.numerics
    span = numerics.end - numerics.start
    steps = math.ceil(span / step) if step else None
    method = method_named(first_method(numerics.method))
    timed = steps is not None and method.explicit
    expected = steps * (SECONDS_PER_STEP + method.stages * rhs_seconds(model)) if timed else None
    return {
        "fluid": model.case.properties.plain(), "nodes": nodes, "masses": masses, "bodies": bodies,
        "pipes": pipes,
        "basins": {one.name: basin_facts(one) for one in model.basins},
        "states": model.y_size, "cells": model.all_cells, "step": step,
        "step_set_by": set_by, "steps": steps, "expected_seconds": expected,
        "moving": model.steady["moving"],
        "warnings": [one.plain() for one in (*model.warnings, *dear(model, steps, set_by))],
    }  # fmt: skip


def wall_facts(link) -> dict[str, Any]:
    """What a pipe's wall is and whose figures these are; nothing of one that says wall or wave_speed alone."""
    found = {
        key: one for key in ("material", "allowable_pressure", "source") if (one := getattr(link, key)) is not None
    }
    if link.material is not None:
        known = vars(link.wall) | {"roughness": link.friction.roughness} if isinstance(link.wall, Wall) else {}
        unread = materials()[link.material].unread
        found["unread"] = [key for key in unread if key != "density" and known.get(key) is None]
    if link.restraint is not None and isinstance(link.wall, Wall):
        found["restraint_factor"] = restraint_factor(link.restraint, link.diameter, link.wall)
    return found


def stands(pose) -> dict[str, float]:
    """Where a body stands at the start, and how fast it moves and turns."""
    place = dict(zip("xyz", pose.place.tolist(), strict=True))
    angles = dict(zip(("roll", "pitch", "yaw"), roll_pitch_yaw(pose.attitude), strict=True))
    return place | angles | {"speed": float(np.linalg.norm(pose.velocity)), "spin": float(np.linalg.norm(pose.spin))}


def rubbed(loss: float, link, rho: float, velocity: float) -> float:
    """Pressure that a pipe's wall takes of all that it loses [Pa]: the rest is its minor loss."""
    return abs(loss) - link.minor_loss * rho * velocity**2 / 2.0


def dear(model, steps: int | None, set_by: str) -> list[Notice]:
    """A notice where explicit steps follow something far quicker than waves, and many of them."""
    numerics, start = model.case.numerics, model.case.numerics.start
    explicit = numerics.method != AUTO and method_named(numerics.method).explicit
    waves = max([*model.wave_rates, *(basin.pace(model.start)[0] for basin in model.basins)], default=0.0)
    if not explicit or numerics.step is not None or not waves > 0.0:
        return []
    rate = float(model.evaluate(start, model.start, start)[1][rec.RATE])
    ratio, most = rate / waves, steps or math.ceil((numerics.end - start) * rate / BOUNDARY)
    if ratio <= DEAR or most <= MANY:
        return []
    why = set_by if numerics.rtol is None else "it"
    text = (
        f"{numerics.method}: some {most} steps, {ratio:.3g} times what waves ask for ({why}); "
        'method = "auto" or "rodas-5p" with rtol = 1e-6 does not follow it'
    )
    return [Notice("cost", "numerics", text, "method", float(most), float(most / ratio))]


def basin_facts(basin) -> dict[str, Any]:
    """Mesh, waves at the start and patches of a basin; lengths of faces, areas of the cells behind them."""
    mesh, patches = basin.mesh, {}
    for name in patch_names(mesh):
        faces, part = mesh.patch(name), basin.part.patches.get(name)
        patches[name] = {
            "faces": faces.stop - faces.start, "length": float(mesh.length[faces].sum()),
            "area": float(mesh.area[behind(mesh, name)].sum()),
            "reflects": 1.0 if part is None else basin.reflection(part),
        }  # fmt: skip
    return {
        "physics": basin.part.physics, "cells": basin.n, "path": "grid" if basin.is_grid else "faces",
        "area": float(mesh.area.sum()), "least_width": float(np.sqrt(mesh.area.min())),
        **{key: list(found) for key, found in basin.ranges().items()}, "memory": basin.memory, "patches": patches,
    }  # fmt: skip


def start_speed(model, k: int) -> float:
    """Wave speed of pipe k [m/s]: that of liquid and wall, or under `mixture` its mean along the pipe at the start."""
    mesh = model.pipes[k]
    return model.case.law.wave_speed(model.tables.pipes[k], model.cell_pressure(k, np.zeros(mesh.cells)))


def rhs_seconds(model) -> float:
    """CPU time of one call of the compiled rates, waves running [s]."""
    y = TRIED * model.scale * np.random.default_rng(1).choice([-1.0, 1.0], model.y_size)
    dydt, out = np.zeros(model.y_size), model.new_out()
    rhs, t, found, calls = model.functions.rhs, float(model.case.numerics.start), math.inf, 1
    with model.slate() as slate:
        for _ in range(5):
            spent = 0.0
            while spent < LONG:
                began = process_time()
                for _ in range(calls):
                    rhs(t, y, dydt, out, slate.handle)
                spent, calls = process_time() - began, 2 * calls
            calls //= 2
            found = min(found, spent / calls)
    return found


def step_and_reason(model) -> tuple[float | None, str]:
    """The step at the start [s] and the part that sets it; None where error control chooses."""
    numerics = model.case.numerics
    if numerics.step is not None:
        return numerics.step, "numerics.step"
    if numerics.rtol is not None:
        return None, f"error control, rtol = {numerics.rtol:g}"
    if method_named(numerics.method).explicit:
        own = model.wave_rates * model.tables.pipes["quicker"]
        for found in (model.steady["unsteady"], model.steady["creep"]):
            own = np.maximum(own, [found.get(pipe.name, {"rate": 0.0})["rate"] for pipe in model.pipes])
        rate = float(model.evaluate(numerics.start, model.start, numerics.start)[1][rec.RATE])
    else:  # waves alone: implicit steps cope with the rest
        own, rate = model.wave_rates, model.wave_rate
    if not rate > 0.0:
        return None, "nothing limits it"
    if not model.case.law.linear and len(own):
        own = own * (1.0 + LOCAL) + velocities(model) / model.tables.pipes["dx"]
    if len(own) and own.max() >= rate * (1 - 1e-12):
        name = model.pipes[int(np.argmax(own))].name
        return numerics.courant / rate, f"links.{name}: its cells have the shortest travel time"
    valve, least = quick_valve(model, rate) if method_named(numerics.method).explicit else ("", rate)
    if valve:
        others = f", {rate / least:.3g} times quicker than all else" if least > 0.0 else ""
        return numerics.courant / rate, f"links.{valve}: its flow answers at once to what it joins{others}"
    part = quick_parts(model) + (", quicker than every pipe cell" if len(own) else "")
    if len(own) and rate > STIFF * own.max():
        part += f', {rate / own.max():.3g} times; rtol with method = "rodas-5p" does not follow it'
    return numerics.courant / rate, part


def quick_valve(model, rate: float) -> tuple[str, float]:
    """The valve between two places that store without which the greatest rate is least, and that rate [1/s]."""
    valves, found, least = model.tables.valves, "", rate * (1 - QUICKER)
    start = model.case.numerics.start
    for k in np.flatnonzero((valves["solve"] == rec.ALONE) & (valves["device"] < 0))[:MOST_TRIED]:
        shut = valves.copy()
        shut["conductance"][k] = 0.0
        other = replace(model, tables=model.tables._replace(valves=shut))
        without = float(other.evaluate(start, model.start, start)[1][rec.RATE])
        if without < least:
            found, least = model.valve_names[k], without
    return found, least


def velocities(model) -> np.ndarray:
    """Of the flow in all pipes at the start, without sign : float64[pipes] [m/s]."""
    pipes = model.tables.pipes
    return np.abs(pipes["flow"] / (model.case.properties.density * pipes["area"]))


def quick_parts(model) -> str:
    """What may have a rate of its own beside the pipes: what stores, rigid columns, masses."""
    stores = [name for name, row in zip(model.node_names, model.tables.nodes, strict=True)
              if row["kind"] not in (rec.FIXED, rec.JUNCTION, rec.PATCH)]  # fmt: skip
    found = [
        *(basin.name for basin in model.basins),
        *stores,
        *model.column_names,
        *model.mass_names,
        *model.body_names,
    ]
    return found[0] if len(found) == 1 else f"one of {listing(found)}"
