"""Forcing of a case: ranges of pressures and flows, and the size of states that follows from them."""

from __future__ import annotations

import numpy as np

OTHER_STATES = 1e3  # further factor for states driven by more than waves: contents, bodies, scalars
FORCING_KEYS = {"pressure": "pressure", "head": "head", "demand": "flow", "flow": "flow"}  # scheduled keys of nodes


def forcing_sizes(model) -> np.ndarray:
    """Largest size that schedules and initial values can give to each state : float64[n].

    It is computed for cells of pipes and basins; for delay lines and other states it is 1000 times their scale or more.
    """
    largest, linear = OTHER_STATES * model.scale, model.case.properties
    pressure, flow = pressure_and_flow_range(model)
    pipes = model.tables.pipes
    flow = max([flow, *np.abs(pipes["flow"])])
    if len(pipes):
        pressure = max(pressure, flow / float(pipes["admittance"].min()))
    for mesh, row in zip(model.pipes, pipes, strict=True):
        if row["delay"] >= 0:  # amount in a delay line, less that of the profile
            waves = pressure * float(row["admittance"]) * mesh.length / float(row["speed"])
            largest[row["y"]] = OTHER_STATES * max(largest[row["y"]], waves)
            continue
        own = slice(row["y"], row["y"] + 2 * mesh.cells)
        largest[own] = np.maximum(max(pressure * float(row["admittance"]), flow), model.scale[own])
    for basin in model.basins:
        states, scales = basin.states_of(largest), basin.states_of(model.scale)
        ratio = 1.0 + pressure / (linear.density * model.case.gravity)
        for own, scale, start in zip(states, scales, basin.states_of(model.start), strict=True):
            own[:] = np.maximum(ratio * scale, np.ptp(start))
    return largest


def pressure_and_flow_range(model) -> tuple[float, float]:
    """Greatest range of pressures [Pa] and greatest magnitude of mass flow [kg/s] that the forcing of nodes gives.

    The range is that of the initial pressures of all nodes, or of a single schedule if it is greater. The flow is that
    of schedules only.
    """
    rho, gravity = model.case.properties.density, model.case.gravity
    at_start = model.tables.nodes["pressure"]
    pressures, flow = [float(np.ptp(at_start)) if len(at_start) else 0.0], 0.0
    for node in model.case.nodes.values():
        for key, kind in FORCING_KEYS.items():
            values = getattr(vars(node).get(key), "value", None)
            if not isinstance(values, np.ndarray) or not values.size:
                continue
            if kind == "flow":
                flow = max(flow, rho * float(np.abs(values).max()))
            else:
                pressures.append(float(np.ptp(values)) * (rho * gravity if kind == "head" else 1.0))
    return max(pressures), flow


def states_outside_cells(model) -> np.ndarray:
    """Numbers of the states outside cells and delay lines: storing nodes, columns, bodies, devices : int64[k]."""
    pipes = model.tables.pipes
    lines = set(pipes["y"][pipes["delay"] >= 0].tolist())
    names = model.state_names.single()
    return np.array([i for i, name in names if "[" not in name and i not in lines], dtype=np.int64)


def state_ranges(model, share: float = 1.0) -> np.ndarray:
    """Range of each state : float64[n].

    For a storing node it is the change of mass over the range of pressures of `pressure_and_flow_range`, for other
    states `share` times their scale.
    """
    ranges, spread = share * model.scale, pressure_and_flow_range(model)[0]
    for row in model.tables.nodes:
        if row["y"] >= 0 and row["stiffness"] > 0.0 and spread > 0.0:
            ranges[row["y"]] = spread / row["stiffness"]
    return ranges
