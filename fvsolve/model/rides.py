"""Pipes, columns and tanks on bodies as rows of tables, and what drives them at the start. Knows names; no rhs."""

from __future__ import annotations

import numpy as np

from fvsolve.case import riding_networks
from fvsolve.case.riding import free_joints
from fvsolve.kernels import records as rec

SMALL = 1e-9  # of what drives a stretch [J/kg], below which it is rounding


def lower_rides(draft) -> None:
    """A row for every cell of a pipe, every stretch of a rigid column and every place that rides."""
    found: list[tuple] = []
    links, places = draft.case.conduits, draft.case.places
    for name, row in [*zip(draft.pipe_names, draft.pipe_table, strict=True),
                      *zip(draft.column_names, draft.column_table, strict=True)]:  # fmt: skip
        link = links[name]
        first, last = places[link.from_], places[link.to]
        if getattr(first, "on", None) is None:
            continue
        row["ride"] = len(found)
        ends = np.array(first.place), np.array(last.place)
        if "cells" in row.dtype.names:
            shares = np.linspace(0.0, 1.0, int(row["cells"]) + 1)[:, None]
            points = ends[0] + shares * (ends[1] - ends[0])
            found += [stretch(draft, first.on, points[k : k + 2]) for k in range(len(points) - 1)]
        else:
            points = np.array([ends[0], *link.route, ends[1]])
            row["rides"] = len(points) - 1
            found += [stretch(draft, first.on, points[k : k + 2]) for k in range(len(points) - 1)]
    for node, row in zip(places.values(), draft.node_table, strict=True):
        if getattr(node, "on", None) is None or row["kind"] == rec.PATCH:
            continue
        row["ride"] = len(found)
        foot, high = np.array(node.place), node.level if row["kind"] == rec.TANK else 0.0
        body, start, end, swept, rise, heavy = stretch(draft, node.on, np.array([foot, foot + [0.0, 0.0, high]]))
        found.append((body, start, end, swept, -rise, heavy))
    draft.ride_table = np.array(found, rec.RIDE) if found else np.zeros(0, rec.RIDE)
    if asked(draft):
        for place, text in riding_networks.unfelt(draft.case.nodes, draft.case.links):
            draft.fault(".".join(place), f"{text}, and a probe asks what joints hold")


def asked(draft) -> bool:
    """Whether a probe reads what a joint holds."""
    return any(probe.quantity.startswith("joint_") for probe in draft.case.probes)


def stretch(draft, on: str, points: np.ndarray) -> tuple:
    """A row of `rides`: straight between two points in axes of a body [m]."""
    rise = (draft.case.poses[on].attitude @ (points[1] - points[0]))[2]
    heavy = rec.ASKED if asked(draft) else rec.FELT if any(free_joints(on, draft.case.nodes)) else 0
    return draft.body_names.index(on), *points, np.cross(*points), -draft.case.gravity * rise, heavy


def driven_at_start(draft, start) -> list[str]:
    """What a body that moves drives at the start, in words."""
    if not len(draft.ride_table):
        return []
    from fvsolve.model.statics import DRIVES, MOTION, Statics

    at = Statics(draft, start.t)
    at.run(MOTION, DRIVES)
    first, rho = int(at.layout["ride"]), draft.fluid.density
    drives = at.out[first : first + len(draft.ride_table)]
    found = []
    for kind, names, table in (("pipe", draft.pipe_names, draft.pipe_table),
                               ("rigid column", draft.column_names, draft.column_table)):  # fmt: skip
        for name, row in zip(names, table, strict=True):
            if row["ride"] >= 0:
                many = int(row["cells" if "cells" in row.dtype.names else "rides"])
                push = float(drives[row["ride"] : row["ride"] + many].sum())
                if abs(push) > SMALL:
                    found.append(
                        f"{kind} {name}: its body drives it with {draft.case.amount(rho * push, 'pressure', span=True)}"
                    )
    return found
