"""Table of segments of pipes and rigid columns, and of nodes, on moving bodies; their inertial forces at the start."""

from __future__ import annotations

import numpy as np

from fvsolve.case import nodes_on_bodies
from fvsolve.case.bodies import free_joints
from fvsolve.kernels import dtypes as rec

ROUNDING = 1e-9  # specific force times length [J/kg] below which it counts as rounding


def lower_moving_segments(draft) -> None:
    """Fill a row for every pipe cell, every segment of a rigid column and every node (except patches) on a body.

    Adds faults if a probe reads forces of joints, but the force of a part on its body is not modelled.
    """
    rows: list[tuple] = []
    links, places = draft.case.conduits, draft.case.places
    for name, row in [*zip(draft.pipe_names, draft.pipe_table, strict=True),
                      *zip(draft.column_names, draft.column_table, strict=True)]:  # fmt: skip
        link = links[name]
        first, last = places[link.from_], places[link.to]
        if getattr(first, "on", None) is None:
            continue
        row["moving_segment"] = len(rows)
        ends = np.array(first.place), np.array(last.place)
        if "cells" in row.dtype.names:
            shares = np.linspace(0.0, 1.0, int(row["cells"]) + 1)[:, None]
            points = ends[0] + shares * (ends[1] - ends[0])
            rows += [moving_segment_row(draft, first.on, points[k : k + 2]) for k in range(len(points) - 1)]
        else:
            points = np.array([ends[0], *link.route, ends[1]])
            row["moving_segments"] = len(points) - 1
            rows += [moving_segment_row(draft, first.on, points[k : k + 2]) for k in range(len(points) - 1)]
    for node, row in zip(places.values(), draft.node_table, strict=True):
        if getattr(node, "on", None) is None or row["kind"] == rec.PATCH:
            continue
        row["moving_segment"] = len(rows)
        foot, high = np.array(node.place), node.level if row["kind"] == rec.TANK else 0.0
        body, start, end, swept, rise, heavy = moving_segment_row(
            draft, node.on, np.array([foot, foot + [0.0, 0.0, high]])
        )
        rows.append((body, start, end, swept, -rise, heavy))
    draft.moving_segment_table = np.array(rows, rec.MOVING_SEGMENT) if rows else np.zeros(0, rec.MOVING_SEGMENT)
    if reads_joint_forces(draft):
        for place, text in nodes_on_bodies.missing_reactions(draft.case.nodes, draft.case.links):
            draft.fault(".".join(place), f"a probe reads forces of joints, but {text}")


def reads_joint_forces(draft) -> bool:
    """True if a probe reads forces of a joint."""
    return any(probe.quantity.startswith("joint_") for probe in draft.case.probes)


def moving_segment_row(draft, on: str, points: np.ndarray) -> tuple:
    """Row of the table `moving_segments` for a straight line between two points, given in axes of the body `on` [m]."""
    rise = (draft.case.poses[on].attitude @ (points[1] - points[0]))[2]
    heavy = (
        rec.JOINT_LOAD_READ
        if reads_joint_forces(draft)
        else rec.MOVED_BY_FORCES
        if any(free_joints(on, draft.case.nodes))
        else 0
    )
    return draft.body_names.index(on), *points, np.cross(*points), -draft.case.gravity * rise, heavy


def driven_at_start(draft, start) -> list[str]:
    """Texts of pipes and rigid columns whose flow is driven by the motion of their body at the start."""
    if not len(draft.moving_segment_table):
        return []
    from fvsolve.model.static_forces import DRIVES, MOTION, StaticForces

    at = StaticForces(draft, start.t)
    at.run(MOTION, DRIVES)
    first, rho = int(at.layout["moving_segment"]), draft.fluid.density
    drives = at.out[first : first + len(draft.moving_segment_table)]
    texts = []
    for kind, names, table in (("pipe", draft.pipe_names, draft.pipe_table),
                               ("rigid column", draft.column_names, draft.column_table)):  # fmt: skip
        for name, row in zip(names, table, strict=True):
            if row["moving_segment"] >= 0:
                count = int(row["cells" if "cells" in row.dtype.names else "moving_segments"])
                push = float(drives[row["moving_segment"] : row["moving_segment"] + count].sum())
                if abs(push) > ROUNDING:
                    texts.append(
                        f"{kind} {name}: the motion of its body drives its flow with "
                        f"{draft.case.amount(rho * push, 'pressure', span=True)}"
                    )
    return texts
