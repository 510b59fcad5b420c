"""Amounts of scalars in a state, and their balances over a run."""

from typing import Any

import numpy as np

from fvsolve.features.scalars.kernels.tables import CHANGE
from fvsolve.features.scalars.lower import STORES, wall_masses
from fvsolve.features.scalars.own_tables import scalar_tables
from fvsolve.features.scalars.reactions import reacting
from fvsolve.parts.heat import exchanger_names


def amount_indices(model) -> np.ndarray:
    """Indices of the states that are scalar amounts in pipes and nodes : int64[m]."""
    scalars = scalar_tables(model).scalars
    if not len(scalars):
        return np.zeros(0, dtype=int)
    count = model.cells + int(np.isin(model.tables.nodes["kind"], STORES).sum())
    return np.concatenate([row["y"] + np.arange(count) for row in scalars])


def pipe_values(model, k: int, y: np.ndarray) -> dict[str, np.ndarray]:
    """Values of all scalars in the cells of pipe k : name -> float64[cells]."""
    pipe, values = model.tables.pipes[k], {}
    n, o = int(pipe["cells"]), int(pipe["y"])
    for row, name in zip(scalar_tables(model).scalars, model.case.scalars, strict=True):
        base, at = int(pipe["center"]), int(row["y"] + pipe["cell"])
        mass = (
            model.tables.profile[base : base + n]
            + (y[o : o + n] + y[o + n : o + 2 * n]) / pipe["speed"]
        )
        values[name] = y[at : at + n] / (mass + wall_masses(model.tables, row)[k])
    return values


def node_values(model, i: int, out: np.ndarray) -> dict[str, float]:
    """Values of all scalars at node i : name -> value; out : array that the right-hand side writes."""
    at, nodes = int(model.layout["value"]), len(model.node_names)
    return {name: float(out[at + q * nodes + i]) for q, name in enumerate(model.case.scalars)}


def total_amount(model, q: int, y: np.ndarray) -> float:
    """Amount of scalar q in all pipes, nodes and basins [kg times the unit of the scalar]."""
    pipes = model.tables.pipes
    nodes = model.tables.nodes
    row = scalar_tables(model).scalars[q]
    total = 0.0
    for pipe in pipes:
        at = int(row["y"] + pipe["cell"])
        total += float(np.sum(y[at : at + int(pipe["cells"])])) * pipe["dx"]
    total += sum(
        float(np.sum(basin.mass_per_depth() * basin.amounts(y)[q])) for basin in model.meshed
    )
    places = model.tables.integers[row["places"] : row["places"] + len(nodes)]
    return total + float(
        sum(y[place] for place, kind in zip(places, nodes["kind"], strict=True) if kind in STORES)
    )


def wall_amount(model, q: int, y: np.ndarray) -> float:
    """Amount of scalar q in the walls of all pipes [kg times the unit of the scalar]; `total_amount` includes it."""
    name, total = list(model.case.scalars)[q], 0.0
    for k, wall in enumerate(wall_masses(model.tables, scalar_tables(model).scalars[q])):
        if wall > 0.0:
            total += (
                wall * model.tables.pipes[k]["dx"] * float(np.sum(pipe_values(model, k, y)[name]))
            )
    return float(total)


def scalar_ledgers(model, y: np.ndarray, ledger: np.ndarray) -> dict[str, dict[str, Any]]:
    """Balance of each scalar in a run : name -> initial, final, inflow, outflow, decayed, remainder [kg x its unit].

    `initial` and `final` are the sums over fluid and walls; if walls store the scalar, `fluid` and `wall` have both.
    Further entries: net inflow (`by_node`), and inflow and outflow (`nodes`), of each node through which it flows; if
    reactions change it, what they form less what they consume (`reacted`). The temperature that heat changes also has
    `heated`, the sum of heat over specific heat, and `heat` [J] by part.
    relative : |remainder| over the greatest of |initial|, |final| and inflow + outflow + |decayed| + |heated| +
    |reacted|
    ledger : float64[2, m]  integrals of positive rates, and of negative rates, of each row of the stepper's ledger
    """
    ledgers, n = {}, len(model.node_names)
    for q, (name, row) in enumerate(
        zip(model.case.scalars, scalar_tables(model).scalars, strict=True)
    ):
        flows = ledger[:, n + q * n : n + (q + 1) * n]
        decay = ledger[:, n * (1 + len(model.case.scalars)) + row["loss"] :]
        decayed = -float(np.sum(decay[:, : row["losses"]]))
        heat = heat_by_part(model, ledger, q)
        heated = sum(heat.values()) / row["specific_heat"] if heat else 0.0
        initial, final = total_amount(model, q, model.start), total_amount(model, q, y)
        formed = formed_amount(model, q, ledger)
        remainder = final - initial - (float(np.sum(flows)) - decayed + heated + formed)
        by_place: dict[str, np.ndarray] = {}
        for place, flow in zip(model.ledger_names, flows.T, strict=True):
            by_place[place] = by_place.get(place, 0.0) + flow
        turnover = float(np.sum(np.abs(flows))) + abs(decayed) + abs(heated) + abs(formed)
        turnover = max(abs(initial), abs(final), turnover)
        in_wall = {
            key: wall_amount(model, q, state)
            for key, state in (("initial", model.start), ("final", y))
        }
        in_fluid = {"initial": initial - in_wall["initial"], "final": final - in_wall["final"]}
        ledgers[name] = {
            "initial": initial,
            "final": final,
            "inflow": float(flows[0].sum()),
            "outflow": float(0.0 - flows[1].sum()),
            "decayed": decayed,
            **(
                {"fluid": in_fluid, "wall": in_wall} if wall_masses(model.tables, row).any() else {}
            ),
            **({"reacted": formed} if name in reacting(model.case) else {}),
            "by_node": {
                place: float(flow.sum()) for place, flow in by_place.items() if flow.sum() != 0.0
            },
            "nodes": {
                place: {"inflow": float(x), "outflow": float(0.0 - y)}
                for place, (x, y) in by_place.items()
                if x != 0.0 or y != 0.0
            },
            **({"heated": float(heated), "heat": heat} if row["specific_heat"] > 0.0 else {}),
            "remainder": remainder,
            "relative": abs(remainder) / turnover if turnover > 0.0 else 0.0,
        }
    return ledgers


def formed_amount(model, q: int, ledger: np.ndarray) -> float:
    """Amount of scalar q that reactions have formed [kg times its unit]; ledger : as for `scalar_ledgers`."""
    tables, formed = model.tables, 0.0
    first = int(model.layout["extent"] - model.layout["supply"])
    for row in scalar_tables(model).reactions:
        members = tables.integers[row["scalars"] : row["scalars"] + row["count"]].tolist()
        if q in members:
            at = first + int(row["extent"])
            change = tables.floats[row["data"] + 3 * members.index(q) + CHANGE]
            formed += change * float(np.sum(ledger[:, at : at + int(row["extents"])]))
    return formed


def heat_by_part(model, ledger: np.ndarray, q: int) -> dict[str, float]:
    """Heat into the fluid in a run from each part [J] by name, and from each heat exchanger (negative if it cools).

    It is empty for a scalar q that heat does not change; ledger : as for `scalar_ledgers`
    """
    tables = scalar_tables(model)
    scalar = tables.scalars[q]
    scale = float(scalar["specific_heat"])
    if scale == 0.0:
        return {}
    first, last = (int(model.layout[name] - model.layout["supply"]) for name in ("heat", "extent"))
    rows = scale * ledger[:, first:last].sum(axis=0)
    heat: dict[str, float] = {}
    for row, value in zip(tables.heat_sources, rows, strict=False):
        name = model.valve_names[row["valve"]]
        heat[name] = heat.get(name, 0.0) + float(value)
    for pipe, row in zip(model.pipes, model.tables.pipes, strict=True):
        if row["heat"] >= 0:
            count = int(row["cells"]) if scalar["by_cell"] else 1
            heat[pipe.name] = float(rows[row["heat"] :][:count].sum())
    exchangers = rows[rows.size - len(tables.exchangers) :]
    return heat | {
        name: float(value)
        for name, value in zip(exchanger_names(model.case), exchangers, strict=True)
    }
