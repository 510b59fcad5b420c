"""Which pipes are followed as delay lines, into how many stretches they are cut, and how far off that may be.

Bounds, in units of the greatest jump that a schedule makes: friction in the middle of stretches, a quarter of what it
takes of a wave there; interpolation of what schedules smooth over a time T, by derivatives of half a cosine; a line
shorter than the longest step h, the curvature of that over its delay, tau (h - tau) / 2.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels import records as rec
from fvsolve.kernels.delay.lines import drag_and_slope
from fvsolve.kernels.schedules import POWER, WAVE
from fvsolve.model.clusters import sort_nodes
from fvsolve.model.past import past_size, rings_of
from fvsolve.steppers import automatic
from fvsolve.steppers.methods import AUTO
from fvsolve.steppers.tableau import method_named

FELT = 0.02 * 1e5  # pressure [Pa] whose flow is added to that of the start where friction is looked at
DRIVEN = 1e-9  # of a bar's wave: what friction leaves of a drop
BEND = 0.1  # of what a step brings: overshoot of six entries behind a kink
ROUGH = 0.5  # of a wave: friction of a line shorter than a step may take no more


@dataclass(frozen=True)
class Followed:
    """How a pipe is followed: "cells" or "delay", why, and what steps go by.

    rate : of lines that ask for steps [1/s]; longest : step that lines are cut for [s]
    """

    line: str
    why: str
    rate: float = 0.0
    longest: float = math.inf


def followed(case, unfit: Collection[str] = ()) -> dict[str, Followed]:
    """Pipe -> how it is followed; unfit : those that `auto` has found to be off by more than `numerics.accuracy`."""
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    found, lines = {}, []
    for name, link in pipes.items():
        line = link.line or case.numerics.line
        lacks = "" if line == "cells" else what_needs_cells(case, name, link)
        if line == "cells" or lacks:
            found[name] = Followed("cells", lacks or f'line = "{line}"')
        elif name in unfit:
            found[name] = Followed("cells", "its bound as a delay line is above numerics.accuracy")
        else:
            lines.append(name)
    if not lines:
        return {name: found[name] for name in pipes}
    travel = {name: link.length / case.wave_speed(name) for name, link in pipes.items()}
    slowest = max(lines, key=travel.get)
    rate = pipes[slowest].cells / travel[slowest]
    cells = max((pipes[name].cells / travel[name] for name in found), default=0.0)
    numerics = case.numerics
    longest = 1.0 / rate  # under error control, see `solve.loop.longest_step`
    if numerics.step is not None or numerics.courant is not None:
        longest = numerics.step or numerics.courant / max(rate, cells)
    kinds = (automatic.EXPLICIT, automatic.IMPLICIT) if numerics.method == AUTO else (numerics.method,)
    longest *= max(
        1.0, *(time for kind in kinds for time in method_named(kind).times)
    )  # nothing is read that is not yet known
    for name in lines:
        why = "waves travel along it unchanged but for friction"
        if travel[name] < longest:
            why += f", and faster than a step of {case.step_amount(longest, 4)}"
        found[name] = Followed("delay", why, rate, longest)
    return {name: found[name] for name in pipes}


def what_needs_cells(case, name: str, link) -> str:
    """Reason why a pipe needs cells; "" for none."""
    if not case.law.linear:
        return f'law = "{case.law.name}" changes waves as they travel'
    if case.scalars:
        return "scalars are carried in cells"
    if link.friction.model == "unsteady":
        return "unsteady friction remembers the flow of every cell"
    if link.yielding:
        return "its wall creeps in every cell"
    if any(getattr(case.places[end], "on", None) for end in link.ports.values()):
        return "a body that it rides on drives its cells"
    if any(
        one.quantity == "force" and (one.part, one.name) == ("links", name) for one in (*case.probes, *case.watched)
    ):
        return "its force is asked for, which is found from cells"
    return ""


def lower_delays(draft) -> None:
    """Rows of delay lines, and the faults of those that cannot be one."""
    case, rows = draft.case, []
    for k, name in enumerate(draft.pipe_names):
        link, chosen = case.links[name], draft.followed[name]
        asked = link.line or case.numerics.line
        if asked == "delay" and chosen.line == "cells":
            key = f"links.{name}.line" if link.line else "numerics.line"
            draft.fault(key, f'"delay" does not fit links.{name}: {chosen.why}; wanted "cells", or "auto"')
        if chosen.line == "cells":
            continue
        row = np.zeros((), rec.DELAY)
        pipe = draft.pipe_table[k]
        pipe["delay"], row["pipe"], row["places"] = len(rows), k, link.cells
        row["tau"] = row["hold"] = link.length / pipe["speed"]
        row["stretch"], row["stretches"] = len(rows), 1
        if row["tau"] < chosen.longest * (1.0 - 1e-9):
            row["hold"], beta = chosen.longest, 1.0 - row["tau"] / chosen.longest
            row["now"], row["couple"] = beta, 2.0 * beta * pipe["admittance"] / (1.0 - beta * beta)
        rows.append(row)
    draft.delay_table = np.array(rows, rec.DELAY)
    rings_of(draft.delay_table, longest_of(draft))
    ends: list[list[int]] = [[] for _ in draft.node_table] if rows else []
    for d, row in enumerate(rows):
        for side, end in enumerate(("from_node", "to_node")):
            ends[draft.pipe_table[row["pipe"]][end]].append(2 * d + side)
    for i, there in enumerate(ends):
        draft.node_table["lines"][i], draft.node_table["line_count"][i] = len(draft.integers), len(there)
        draft.integers += there


def tables_for_jumps(draft) -> dict[str, np.ndarray]:
    """Tables that differ where lines shorter than a step are as all others: what a jump meets. Empty without these."""
    short = draft.delay_table["now"] > 0.0
    if not short.any():
        return {}
    own, tables = copy.copy(draft), draft.tables
    own.node_table, own.valve_table, own.delay_table = (
        one.copy() for one in (draft.node_table, draft.valve_table, draft.delay_table)
    )
    own.integers, own.floats, own.faults = tables.integers.tolist(), tables.floats.tolist(), []
    for pipe in draft.pipe_table[draft.delay_table["pipe"][short]]:
        for end in ("from_node", "to_node"):
            own.node_table["admittance"][pipe[end]] += pipe["admittance"] * (1.0 - at_ends(draft, pipe))
    own.delay_table["now"] = own.delay_table["couple"] = 0.0
    sort_nodes(own)
    return {
        "nodes": own.node_table, "valves": own.valve_table, "delays": own.delay_table, "clusters": own.cluster_table,
        "integers": np.array(own.integers), "floats": np.array(own.floats),
    }  # fmt: skip


def at_ends(draft, pipe) -> float:
    """Admittance of a pipe's ends over that of its waves: less of a line whose ends know each other."""
    beta = draft.delay_table["now"][pipe["delay"]] if pipe["delay"] >= 0 else 0.0
    return float((1.0 - beta) / (1.0 + beta))


def cut_lines(draft) -> list[str]:
    """Stretches of all lines, by friction at the start; names of those whose bound is above the accuracy under auto."""
    case, at, unfit = draft.case, 0, []
    found = draft.steady["lines"] = {}
    for name, chosen in draft.followed.items():
        found[name] = {"line": chosen.line, "line_bound": None, "line_why": chosen.why}
    scale, ramp = time_scales(draft) if len(draft.delay_table) else (0.0, 0.0)
    for row in draft.delay_table:
        name = draft.pipe_names[row["pipe"]]
        pipe, chosen = draft.pipe_table[row["pipe"]], draft.followed[name]
        travel = float(row["tau"] * row["stretches"])
        flow = abs(float(pipe["flow"])) + float(pipe["admittance"]) * FELT
        takes = travel * float(drag_and_slope(pipe, flow)[1])
        most = max(1, math.floor(travel / chosen.longest * (1.0 + 1e-9)))
        many = min(most, max(1, math.ceil(0.5 * takes / case.numerics.accuracy)))
        if row["now"] > 0.0:
            many = 1
        row["stretches"], row["stretch"], row["tau"] = many, at, travel / many
        row["passes"] = 1.0 / (1.0 + 0.5 * row["tau"] * drag_and_slope(pipe, float(pipe["flow"]))[1])
        row["hold"] = row["hold"] if row["now"] > 0.0 else row["tau"]
        at += many
        smoothed = by_interpolation(float(row["tau"]), chosen.longest, scale, ramp)
        off = 0.25 * takes / many + smoothed
        found[name]["line_bound"] = off
        force = float(drag_and_slope(pipe, float(pipe["flow"]))[0])
        if abs(float(pipe["drag"]) - force) > DRIVEN * float(pipe["admittance"]) * 1e5 / travel:
            off = math.inf
            unfit.append(name)
            if (case.links[name].line or case.numerics.line) == "delay":
                draft.fault(f"links.{name}.line", '"delay" does not fit: at the start friction does not hold the drop '
                            'of pressure along it, which drives every part of it; wanted "cells"')  # fmt: skip
            continue
        if row["now"] > 0.0 and takes > ROUGH:
            off = math.inf
            found[name]["line_why"] += ", where friction takes too much of a wave"
        asked = case.links[name].line or case.numerics.line
        if asked == "auto" and off > case.numerics.accuracy:
            unfit.append(name)
        elif smoothed > case.numerics.accuracy and off < math.inf:
            draft.warnings.append(too_quick(case, name, chosen.longest, min(scale, ramp or scale), smoothed))
        elif off == math.inf:
            longest = draft.case.step_amount(chosen.longest, 4)
            draft.fault(f"links.{name}.line", f'"delay" does not fit: friction takes {takes:.3g} of a wave in a line '
                        f'shorter than a step of {longest}; wanted shorter steps, or "cells"')  # fmt: skip
    shape_past(draft)
    return unfit


def too_quick(case, name: str, step: float, scale: float, off: float) -> Notice:
    """Notice that a schedule changes too quickly for the steps of a delay line."""
    text = (
        f"{name}: a schedule changes something within {case.step_amount(scale, 3)}, and steps of "
        f"{case.step_amount(step, 3)} may put its waves off by {off:.2g} of the change; "
        f'wanted shorter steps, or line = "cells"'
    )
    return Notice("lines", f"links.{name}", text, "line", off, case.numerics.accuracy)


def by_interpolation(tau: float, step: float, scale: float, ramp: float) -> float:
    """Bound of what reading between steps is off by, as a share of what a schedule changes.

    scale : duration of half a cosine [s], 0 for none; ramp : of a straight ramp, whose kinks the polynomial through
    six entries overshoots by up to a tenth of what a step brings
    """
    kinks = BEND * step / ramp if ramp > 0.0 else 0.0
    bend = math.pi * step / scale if scale > 0.0 else 0.0
    if tau < step:
        kinks = tau * (step - tau) / (step * ramp) if ramp > 0.0 else 0.0
        return max(kinks, 0.25 * (math.pi / scale) ** 2 * tau * (step - tau) if scale > 0.0 else 0.0)
    if abs(tau / step - round(tau / step)) < 1e-9:
        return 0.0
    if tau >= 3.0 * step:
        return max(kinks, 0.5 * 0.0049 * bend**6)
    return max(kinks, 0.5 * (0.0234 * bend**4 if tau >= 2.0 * step else 0.0642 * bend**3))


def time_scales(draft) -> tuple[float, float]:
    """The shortest time in which a schedule changes its value, and of these that of a straight ramp [s].

    0 where none does but by jumps, which are kept.
    """
    found, ramp, schedules = math.inf, math.inf, draft.schedules
    for first, count in schedules.records:
        rows = schedules.rows[first : first + count]
        for k, row in enumerate(rows):
            if row[1] == WAVE:
                found = min(found, math.pi / row[5]) if row[4] != 0.0 else found
            elif 0 < k < count - 1 and (row[1] != 0 or any(row[4:7])):
                found = min(found, rows[k + 1][0] - row[0])
                if row[1] == POWER or not any(row[5:7]):
                    ramp = min(ramp, rows[k + 1][0] - row[0])
    return tuple(one if math.isfinite(one) else 0.0 for one in (found, ramp))


def shape_past(draft) -> None:
    """Rings of all lines, and the size of what a run keeps of them."""
    rings_of(draft.delay_table, longest_of(draft))
    draft.shapes = draft.shapes._replace(past=past_size(draft.delay_table))


def longest_of(draft) -> float:
    """Step that lines are cut for [s]."""
    return min((one.longest for one in draft.followed.values() if one.line == "delay"), default=math.inf)
