"""Parts of a network that shut links separate: faults of a steady start, and parts isolated during a whole run."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.steady import union
from fvsolve.errors import listing

NAMES_SHOWN = 6  # names of nodes or links in a fault


def shut_off_faults(start: Any) -> Iterator[tuple[str, str]]:
    """Yield a fault (place, text) for each group of nodes whose demands no open link can balance.

    start : `SteadyStart` with its latest solution; `no_solution` there has the nodes of these groups
    """
    lost = start.answer.no_solution
    if not lost:
        return
    names = [name.removesuffix(".inside") for name in start.case.places]
    group = union(
        len(names),
        [(edge.i, edge.j) for edge in start.edges if edge.row is not None and not edge.shut],
    )
    for label in dict.fromkeys(group[i] for i in sorted(lost)):
        own = [i for i in range(len(names)) if group[i] == label]
        given = [i for i in own if start.demand[i] != 0.0]
        if given:
            yield f"nodes.{names[given[0]]}", _text(start, names, own, given)


def _text(start: Any, names: list[str], own: list[int], given: list[int]) -> str:
    """Text of the fault of a group; own : its nodes; given : those with a demand or an inflow"""
    drawn = float(np.sum(start.demand[given])) / start.draft.fluid.density
    word, path = ("demand", "every path to it") if drawn > 0.0 else ("inflow", "every path out")
    total = start.case.amount(abs(drawn), "flow")
    amount = f"the {word} here is {total}"
    if len(given) > 1:
        amount = (
            f"the {word} of {listing([names[i] for i in given], NAMES_SHOWN)} is {total} in all"
        )
    if len(own) > 1:
        path = f"every path {'to' if drawn > 0.0 else 'out of'} their part of the network, {len(own)} nodes,"
    shut = sorted(
        {
            _name_of(start, e)
            for e, edge in enumerate(start.edges)
            if edge.shut and ((edge.i in own) != (edge.j in own))
        }
    )
    causes = f": {listing(shut, NAMES_SHOWN)}" if shut else ""
    opening = "open a valve"
    if drawn > 0.0:
        opening += (
            ", give junctions with a demand the key `required_pressure`, by which it falls with the pressure "
            "(fvsolve import --pressure-dependent)"
        )
    return (
        f'no steady state: {amount}, but {path} is shut{causes}; {opening}, or use initial = "rest"'
    )


def _name_of(start: Any, e: int) -> str:
    """Name of the link of edge e, with the reason why its device holds it shut."""
    draft, k = start.draft, e - len(start.pipes) - len(start.columns)
    if not 0 <= k < len(start.valves):
        leaks = [name for feature in draft.features for name in feature.leak_names]
        return (
            [*draft.pipe_names, *draft.column_names][e] if k < 0 else leaks[k - len(start.valves)]
        )
    name, row = draft.valve_names[k].removesuffix(".inside"), start.valves[k]
    reason = draft.devices[row["device"]][2].shut_reason(start, k) if row["device"] >= 0 else ""
    return f"{name} ({reason})" if reason else name


def isolated_parts(model: Any) -> frozenset[str]:
    """Key paths of the nodes and links that valves with a constant opening of 0 isolate, where nothing draws or feeds.

    No flow determines the pressure there during a run.
    """
    tables, case = model.tables, model.case
    shut = [
        row["device"] < 0 and _is_always_zero(getattr(case.conduits[name], "opening", None))
        for name, row in zip(model.valve_names, tables.valves, strict=True)
    ]
    if not any(shut):
        return frozenset()
    rows = [
        *tables.pipes,
        *tables.columns,
        *(row for row, is_shut in zip(tables.valves, shut, strict=True) if not is_shut),
    ]
    group = union(len(model.node_names), [(row["from_node"], row["to_node"]) for row in rows])
    joined = {
        group[i]
        for i, (node, row) in enumerate(zip(case.places.values(), tables.nodes, strict=True))
        if row["kind"] != rec.JUNCTION or not _is_always_zero(getattr(node, "demand", None))
    }
    isolated = {i for i in range(len(group)) if group[i] not in joined}
    parts = {f"nodes.{model.node_names[i].removesuffix('.inside')}" for i in isolated}
    names = (*(pipe.name for pipe in model.pipes), *model.column_names)
    ends = zip(names, [*tables.pipes["from_node"], *tables.columns["from_node"]], strict=True)
    parts |= {f"links.{name}" for name, i in ends if i in isolated}
    return frozenset(parts)


def _is_always_zero(schedule: Any) -> bool:
    """True if a schedule is the constant 0."""
    return schedule is not None and schedule.constant and schedule.first == 0.0
