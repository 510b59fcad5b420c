"""Collision and separation of rigid water columns at nodes without other flow: pressure impulses, admission of air."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels.column_junctions import gate_inflow
from fvsolve.model import Model, RunData

ROUNDING = 1e-9  # relative to a small flow: columns that separate more slowly separate by rounding


def shut_places(model: Model, out: np.ndarray) -> list[int]:
    """Numbers of the nodes that join only rigid columns and shut valves; out : output array of the right-hand side."""
    places, nodes, at = [], model.tables.nodes, model.layout["conductance"]
    for i in np.flatnonzero(nodes["gates"] >= 0):
        if not out[at + gates_of(model, i)].any():
            places.append(int(i))
    return places


def gates_of(model: Model, i: int) -> np.ndarray:
    """Numbers of the valves at node i, a junction of rigid columns and valves."""
    row = model.tables.nodes[i]
    return model.tables.integers[row["gates"] : row["gates"] + row["gate_count"]]


def air_valve_of(model: Model, i: int) -> int | None:
    """Number of the opening event of the air valve at node i; None without an air valve."""
    valves, devices = model.tables.valves, model.tables.devices
    for device in valves["device"][gates_of(model, i)]:
        if device >= 0 and devices[device]["row"] >= 0:
            return int(devices[device]["event"])
    return None


def flow_before(run_data: RunData, t: float, y: np.ndarray) -> np.ndarray:
    """Mass flow of each rigid column just before t, minus its initial steady flow : float64[columns] [kg/s].

    At the start time of the run it is the state of each column.
    """
    model = run_data.model
    before, columns = model.new_out(), model.tables.columns
    if t <= model.case.numerics.start:
        return y[columns["y"]]
    limit, run_data.clock["limit"] = float(run_data.clock["limit"]), t
    model.functions.rhs(t, y, np.zeros(0), before, run_data.handle)
    run_data.clock["limit"] = limit
    return before[model.layout["column"] :][: len(columns)] - columns["flow"]


def impact_impulses(model: Model, carried: np.ndarray, out: np.ndarray, places: list[int]) -> np.ndarray:
    """Mass flow that the pressure impulse J [Pa s] at each node stops [kg/s]; negative where columns separate.

    J follows from the momentum: at each node, the sum over its columns of A / L (J - J_far) is the sum of their
    inflows, with area A [m2] and length L [m] of a column and the impulse J_far at its far end. Columns whose flow a
    valve controls keep their flow. The result is J times the sum of A / L.
    carried : float64[columns]  result of `flow_before`; out : output array of the right-hand side
    places : nodes from `shut_places`
    """
    sums = np.array([model.tables.nodes["inflow"][i] - gate_inflow(model.tables, i) for i in places])
    matrix = np.zeros((len(places), len(places)))
    row = {i: r for r, i in enumerate(places)}
    for k, column in enumerate(model.tables.columns):
        ends = [(row.get(int(column["from_node"]), -1), -1.0), (row.get(int(column["to_node"]), -1), 1.0)]
        at = model.layout["column"] + k
        valve_controlled = out[model.layout["valve_controlled"] + k] != 0.0 and out[at] != 0.0
        change = out[at] - column["flow"] if valve_controlled else carried[k]
        for r, sign in ends:
            if r >= 0:
                sums[r] += sign * change
            for other, other_sign in ends if r >= 0 and not valve_controlled else ():
                if other >= 0:
                    matrix[r, other] += sign * other_sign * column["area"] / column["length"]
    return np.diag(matrix) * np.linalg.lstsq(matrix, sums)[0]


def separate(run_data: RunData, t: float, y: np.ndarray, out: np.ndarray) -> int | None:
    """Number of the opening event of the air valve where columns separate fastest; None if no columns separate.

    run_data : data of the run; y : state at time t [s]; out : output array of the right-hand side there
    """
    model = run_data.model
    places = shut_places(model, out)
    events = [air_valve_of(model, i) for i in places]
    if all(event is None for event in events):
        return None
    small = ROUNDING * model.scale[model.tables.columns["y"]].max()
    all_impulses = impact_impulses(model, flow_before(run_data, t, y), out, places)
    separating = [
        (impulse, event)
        for impulse, event in zip(all_impulses, events, strict=True)
        if event is not None and impulse < -small
    ]
    return min(separating)[1] if separating else None
