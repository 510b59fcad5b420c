"""Facts about a model before its run, for `fvsolve check`."""

import math
from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.core.model.step_division import step_at_start
from fvsolve.core.steppers.automatic import first_method
from fvsolve.core.steppers.tableau import AUTO, method_named
from fvsolve.errors import Notice, listing
from fvsolve.parts.pipe.pipe_wall import HEAT_KEYS, Wall, materials, restraint_factor

# relative to a small deviation: states for the timing of rates, as much is skipped at rest
TEST_DEVIATION = 1e-3
LEAST_TIMING = 2e-4  # least duration of a timing [s]
SECONDS_PER_STEP = 5e-7  # in addition to the rates
# relative excess of sound speed at a pressure over that at the reference, for laws that are not linear
LOCAL_EXCESS = 0.05
# least share of the greatest rate by which a valve must exceed all else to be reported as the cause
VALVE_SHARE = 0.1
MAX_VALVES = 100  # greatest number of valves that are tried
# ratio to the rate of waves, and number of steps, above which `check` warns of the cost
COSTLY_RATIO, COSTLY_STEPS = 10.0, 20_000
# of h times the greatest rate: approximate limit of explicit methods with an error estimate
STABILITY_LIMIT = 3.3
# ratio of steps to those that waves need, above which an implicit method is recommended
STIFF_RATIO = 3.0


def node_facts(model) -> dict[str, Any]:
    """Elevation, pressure and head of the nodes at the start; SI."""
    return {
        name: {
            "elevation": row["elevation"].item(),
            "pressure": row["pressure"].item(),
            "head": float(model.head(row["pressure"], row["elevation"])),
        }
        for name, row in zip(model.node_names, model.tables.nodes, strict=True)
        # a node inside a mesh is no part of the case
        if row["kind"] != rec.PATCH or not name.endswith(".inside")
    }


def pipe_facts(model, nodes: dict[str, Any]) -> dict[str, Any]:
    """Cells, waves, flow and friction of the pipes at the start; SI. nodes : facts of the nodes"""
    rho = model.case.properties.density
    viscosity = model.case.properties.viscosity
    pipes: dict[str, Any] = {}
    unsteady = model.steady["unsteady"]
    creeps = model.steady["creep"]
    for k, (mesh, row) in enumerate(zip(model.pipes, model.tables.pipes, strict=True)):
        velocity = row["flow"] / (rho * row["area"])
        dynamic = (
            row["area"] * mesh.length / (mesh.diameter * row["area"]) * rho * velocity**2 / 2.0
        )
        law = (row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds", "flow"))
        loss, link = drag(*law) / row["area"] * mesh.length, model.case.conduits[mesh.name]
        # without the minor loss [Pa]
        wall_loss = abs(loss) - link.minor_loss * rho * velocity**2 / 2.0
        # in its liquid and wall; under the density law `mixture` the harmonic mean along the pipe at the start [m/s]
        speed = model.case.law.wave_speed(row, model.cell_pressure(k, np.zeros(mesh.cells)))
        has_friction = dynamic > 0 and link.friction.model != "none"
        pipes[mesh.name] = {
            "length": mesh.length,
            "cells": mesh.cells,
            "wave_speed": speed,
            "travel_time": mesh.length / speed,
            "flow": float(row["flow"] / rho),
            "velocity": float(velocity),
            "reynolds": float(rho * abs(velocity) * mesh.diameter / viscosity)
            if viscosity
            else None,
            "friction_factor": float(wall_loss / dynamic) if has_friction else None,
            "from_head": nodes[mesh.from_]["head"],
            "to_head": nodes[mesh.to]["head"],
            **model.steady["lines"][mesh.name],
            **({"unsteady": unsteady[mesh.name]} if mesh.name in unsteady else {}),
            **({"creep": creeps[mesh.name]} if mesh.name in creeps else {}),
            **wall_facts(link),
        }
        if link.retardation:
            factors = {key: model.case.retardation(mesh.name, key) for key in link.retardation}
            pipes[mesh.name]["retardation"] = factors
    return pipes


def checks(model) -> dict[str, Any]:
    """Facts about pipes, nodes, the step and its cause, the number of steps and the expected run time; SI."""
    nodes = node_facts(model)
    pipes = pipe_facts(model, nodes)
    step, set_by = step_and_reason(model)
    numerics = model.case.numerics
    steps = math.ceil((numerics.end - numerics.start) / step) if step else None
    full = max((part.full_rate for part in model.meshed), default=0.0) * (
        numerics.end - numerics.start
    )
    steps_if_full = (
        math.ceil(full / numerics.courant) if steps and numerics.courant is not None else 0
    )
    method = method_named(first_method(numerics.method))
    timed = steps is not None and method.explicit
    expected = steps * (SECONDS_PER_STEP + method.stages * rhs_seconds(model)) if timed else None
    facts: dict[str, Any] = {}
    texts: list[str] = []
    for feature in model.features:
        own = feature.facts(model)
        facts |= own
        texts += feature.check_texts(model, own)
    return {
        "fluid": model.case.properties.plain(),
        "nodes": nodes,
        "masses": {},
        "bodies": {},
        "pipes": pipes,
        "states": model.y_size,
        "cells": model.all_cells,
        "step": step,
        "step_set_by": set_by,
        "steps": steps,
        "steps_if_full": steps_if_full if steps_if_full > (steps or 0) else None,
        "network": None,
        "reactions": {},
        **facts,
        "texts": texts,
        "expected_seconds": expected,
        "moving": model.steady["moving"],
        "warnings": [
            item.plain() for item in (*model.warnings, *cost_notices(model, steps, set_by))
        ],
    }


def wall_facts(link) -> dict[str, Any]:
    """Facts about a pipe's wall, as far as known: material, source of its data, allowable pressure, restraint factor.

    The entry "unread" lists properties of the material without a source that the case does not state either.
    """
    keys = ("material", "allowable_pressure", "source")
    facts = {key: getattr(link, key) for key in keys if getattr(link, key) is not None}
    if link.material is not None:
        stated = (
            vars(link.wall) | {"roughness": link.friction.roughness}
            if isinstance(link.wall, Wall)
            else {}
        )
        unread = materials()[link.material].missing_keys
        facts["unread"] = [
            key for key in unread if key not in HEAT_KEYS and stated.get(key) is None
        ]
    if link.restraint is not None and isinstance(link.wall, Wall):
        facts["restraint_factor"] = restraint_factor(link.restraint, link.diameter, link.wall)
    return facts


def cost_notices(model, steps: int | None, set_by: str) -> list[Notice]:
    """List with a notice if an explicit method needs very many steps because a part is much faster than waves.

    It is empty otherwise, and for given steps (`numerics.step`) that are not divided.
    steps, set_by : number of steps and reason as in `checks`
    """
    numerics, start = model.case.numerics, model.case.numerics.start
    explicit = numerics.method != AUTO and method_named(numerics.method).explicit
    waves = max(
        [*model.wave_rates, *(part.max_rate(model.start)[0] for part in model.meshed)], default=0.0
    )
    if numerics.step is not None:
        waves = 1.0 / numerics.step
    if (
        not explicit
        or not waves > 0.0
        or (numerics.step is not None and step_at_start(model) == numerics.step)
    ):
        return []
    rate = float(model.evaluate(start, model.start, start)[1][rec.RATE])
    ratio, count = rate / waves, steps or math.ceil((numerics.end - start) * rate / STABILITY_LIMIT)
    if ratio <= COSTLY_RATIO or count <= COSTLY_STEPS:
        return []
    reason = set_by if numerics.rtol is None else "a part that is faster than waves"
    need = "waves need" if numerics.step is None else "numerics.step would need alone"
    text = (
        f"{numerics.method}: about {count} steps, {ratio:.3g} times as many as {need} ({reason}); "
        'method = "auto" or "rodas-5p" with rtol = 1e-6 needs fewer steps'
    )
    return [Notice("cost", "numerics", text, "method", float(count), float(count / ratio))]


def rhs_seconds(model) -> float:
    """CPU time of one call of the compiled right-hand side [s], at a state with small waves."""
    # irregular, without numpy.random
    signs = np.where(np.sin(np.arange(model.y_size) ** 2) < 0.0, -1.0, 1.0)
    y = TEST_DEVIATION * model.scale * signs
    dydt, out = np.zeros(model.y_size), model.new_out()
    rhs = model.functions.rhs
    t = float(model.case.numerics.start)
    shortest = math.inf
    calls = 1
    with model.run_data() as run_data:
        for _ in range(5):
            elapsed = 0.0
            while elapsed < LEAST_TIMING:
                began = process_time()
                for _ in range(calls):
                    rhs(t, y, dydt, out, run_data.handle)
                elapsed, calls = process_time() - began, 2 * calls
            calls //= 2
            shortest = min(shortest, elapsed / calls)
    return shortest


def step_and_reason(model) -> tuple[float | None, str]:
    """Time step at the start, and the part that limits it : (step [s], text).

    The step is None if error control chooses it, or if nothing limits it.
    """
    numerics = model.case.numerics
    if numerics.step is not None:
        part = step_at_start(model)
        divided = f"numerics.step, {model.case.step_amount(numerics.step)}, divided for {fastest_parts(model)}"
        return part, "numerics.step" if part == numerics.step else divided
    if numerics.rtol is not None:
        return None, f"error control, rtol = {numerics.rtol:g}"
    if method_named(numerics.method).explicit:
        own = model.wave_rates * model.tables.pipes["rate_factor"]
        for facts in (model.steady["unsteady"], model.steady["creep"]):
            own = np.maximum(
                own, [facts.get(pipe.name, {"rate": 0.0})["rate"] for pipe in model.pipes]
            )
        rate = float(model.evaluate(numerics.start, model.start, numerics.start)[1][rec.RATE])
    else:  # waves only: implicit steps are not limited by other parts
        own, rate = model.wave_rates, model.wave_rate
    filling = {part.name: part.filling_step() for part in model.meshed}
    if not rate > 0.0 and min(filling.values(), default=np.inf) < np.inf:
        name = min(filling, key=filling.get)
        group = "links" if name in model.case.links else "nodes"
        return numerics.courant * filling[
            name
        ], f"{group}.{name}: it is almost dry; waves will limit later steps"
    if not rate > 0.0:
        return None, "no part limits the step"
    if not model.case.law.linear and len(own):
        own = own * (1.0 + LOCAL_EXCESS) + velocities(model) / model.tables.pipes["dx"]
    if len(own) and own.max() >= rate * (1 - 1e-12):
        name = model.pipes[int(np.argmax(own))].name
        return numerics.courant / rate, f"links.{name}: its cells have the shortest travel time"
    valve, without = (
        fastest_valve(model, rate) if method_named(numerics.method).explicit else ("", rate)
    )
    if valve:
        others = (
            f", {rate / without:.3g} times faster than all other parts" if without > 0.0 else ""
        )
        return (
            numerics.courant / rate,
            f"links.{valve}: its flow responds at once to the nodes it joins{others}",
        )
    part = fastest_parts(model) + (", faster than every pipe cell" if len(own) else "")
    if len(own) and rate > STIFF_RATIO * own.max():
        part += f', by a factor of {rate / own.max():.3g}; rtol with method = "rodas-5p" avoids this limit'
    return numerics.courant / rate, part


def fastest_valve(model, rate: float) -> tuple[str, float]:
    """Valve between storing or fixed nodes whose closing lowers the greatest rate most : (name, remaining rate [1/s]).

    rate : greatest rate [1/s]. The name is "" if no valve lowers it by VALVE_SHARE. At most MAX_VALVES valves without
    devices are tried.
    """
    valves = model.tables.valves
    name = ""
    least = rate * (1 - VALVE_SHARE)
    start = model.case.numerics.start
    for k in np.flatnonzero((valves["solve"] == rec.ALONE) & (valves["device"] < 0))[:MAX_VALVES]:
        shut = valves.copy()
        shut["conductance"][k] = 0.0
        other = replace(model, tables=model.tables._replace(valves=shut))
        without = float(other.evaluate(start, model.start, start)[1][rec.RATE])
        if without < least:
            name, least = model.valve_names[k], without
    return name, least


def velocities(model) -> np.ndarray:
    """Speed of the flow in all pipes at the start : float64[pipes] [m/s]."""
    pipes = model.tables.pipes
    return np.abs(pipes["flow"] / (model.case.properties.density * pipes["area"]))


def fastest_parts(model) -> str:
    """Names of all parts other than pipes that can limit the step, as text."""
    stores = [
        name
        for name, row in zip(model.node_names, model.tables.nodes, strict=True)
        if row["kind"] not in (rec.FIXED, rec.JUNCTION, rec.PATCH)
    ]
    moving = [
        name
        for name, row in zip(model.valve_names, model.tables.valves, strict=True)
        if row["device"] >= 0 and model.tables.devices[row["device"]]["y"] >= 0
    ]
    names = [*(part.name for part in model.meshed), *stores, *moving]
    names += [
        *model.column_names,
        *(name for feature in model.features for name in feature.fast_parts),
    ]
    return names[0] if len(names) == 1 else f"one of {listing(names)}"
