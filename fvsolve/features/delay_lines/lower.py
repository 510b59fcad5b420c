"""Tables of delay lines: their stretches, and bounds of the error.

Bounds are relative to the greatest jump of a schedule, and have three causes:
Friction acts in the middle of a stretch only: a quarter of the attenuation of a wave in a stretch.
Interpolation of a change that a schedule smooths over a time T: derivatives of half a cosine of duration T.
A line with a travel time tau shorter than the longest step h: curvature of the wave over it, tau (h - tau) / 2.
"""

import copy
import math

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.schedule_pieces import POWER, WAVE
from fvsolve.core.model.cluster_tables import classify_nodes
from fvsolve.errors import Notice
from fvsolve.features.delay_lines.history import set_rings
from fvsolve.features.delay_lines.kernels.line_rates import drag_and_slope
from fvsolve.features.delay_lines.kernels.tables import DELAY

# pressure [Pa] whose flow is added to that of the start to evaluate friction
FRICTION_PRESSURE = 0.02 * 1e5
# relative to the wave of 1 bar: pressure drop that friction does not balance
UNBALANCED_SHARE = 1e-9
KINK_OVERSHOOT = 0.1  # relative to the change in a step: overshoot of six entries after a kink
MAX_ATTENUATION = 0.5  # greatest attenuation of a wave by friction in a line shorter than a step


def lower_delays(draft, own) -> None:
    """Fill the table of delay lines and, at each node, the list of their ends.

    Adds a fault for each pipe that is stated to be a delay line but cannot be one.
    """
    case, rows = draft.case, []
    own.line_of = np.full(len(draft.pipe_names), -1, dtype=np.int64)
    for k, name in enumerate(draft.pipe_names):
        link, chosen = case.links[name], own.chosen[name]
        stated = link.pipe_model or case.numerics.pipe_model
        if stated == "delay-line" and chosen.pipe_model == "finite-volume":
            key = f"links.{name}.pipe_model" if link.pipe_model else "numerics.pipe_model"
            text = f'"delay-line" is not possible for links.{name}: {chosen.reason}'
            draft.fault(key, f'{text}; expected "finite-volume" or "auto"')
        if chosen.pipe_model == "finite-volume":
            continue
        row = np.zeros((), DELAY)
        pipe = draft.pipe_table[k]
        own.line_of[k], row["pipe"], row["places"] = len(rows), k, link.cells
        row["tau"] = row["hold"] = link.length / pipe["speed"]
        row["stretch"], row["stretches"] = len(rows), 1
        if row["tau"] < chosen.longest * (1.0 - 1e-9):
            row["hold"], beta = chosen.longest, 1.0 - row["tau"] / chosen.longest
            row["now"], row["couple"] = beta, 2.0 * beta * pipe["admittance"] / (1.0 - beta * beta)
            pipe["end_admittance"] = pipe["admittance"] * float((1.0 - beta) / (1.0 + beta))
        rows.append(row)
    own.delays = np.array(rows, DELAY)
    set_rings(own.delays, longest_step(own))
    short = own.delays[own.delays["now"] > 0.0]
    couplings = np.zeros(len(short), rec.COUPLING)
    for row, coupling in zip(short, couplings, strict=True):
        for end in ("from_node", "to_node"):
            coupling[end] = draft.pipe_table[row["pipe"]][end]
        coupling["conductance"] = row["couple"]
    draft.coupling_table = np.concatenate([draft.coupling_table, couplings])
    ends: list[list[int]] = [[] for _ in draft.node_table] if rows else []
    for d, row in enumerate(rows):
        for side, end in enumerate(("from_node", "to_node")):
            ends[draft.pipe_table[row["pipe"]][end]].append(2 * d + side)
    first = len(draft.node_table) + 1 + np.cumsum([0, *map(len, ends)])
    own.node_ends = np.array([*first, *(end for lines in ends for end in lines)], dtype=np.int64)


def jump_tables(draft, feature) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Tables that replace those of the model while a jump is solved (name -> table), and the table of lines there.

    In them a line shorter than a step acts like a longer line: its ends are not coupled within the step. Nothing is
    replaced if all lines exceed a step.
    """
    short = feature.delays["now"] > 0.0
    if not short.any():
        return {}, feature.delays
    own = copy.copy(draft)
    tables = draft.tables
    line = copy.copy(feature)
    own.node_table, own.valve_table = draft.node_table.copy(), draft.valve_table.copy()
    own.coupling_table, line.delays = draft.coupling_table[:0], feature.delays.copy()
    own.features = [line if other is feature else other for other in draft.features]
    own.integers, own.floats, own.faults = tables.integers.tolist(), tables.floats.tolist(), []
    for row in feature.delays[short]:
        pipe = draft.pipe_table[row["pipe"]]
        share = float((1.0 - row["now"]) / (1.0 + row["now"]))
        for end in ("from_node", "to_node"):
            own.node_table["admittance"][pipe[end]] += pipe["admittance"] * (1.0 - share)
    line.delays["now"] = line.delays["couple"] = 0.0
    classify_nodes(own)
    replaced = {
        "nodes": own.node_table,
        "valves": own.valve_table,
        "couplings": own.coupling_table,
        "clusters": own.cluster_table,
        "integers": np.array(own.integers),
        "floats": np.array(own.floats),
    }
    return replaced, line.delays


def friction_attenuation(pipe, travel: float, flow: float) -> float:
    """Attenuation of a wave by friction in a pipe; pipe : its row; travel : travel time [s]; flow : [kg/s]."""
    return travel * float(drag_and_slope(pipe, flow)[1])


def friction_notices(model, delays, extremes: np.ndarray) -> list[Notice]:
    """Notices of delay lines in which the flow has grown, so that their friction needs more stretches.

    A line that is at rest at the start has one stretch. The flows of a run are known where they are probed or limited.
    delays : its delay lines; extremes : float64[4, probes] as in `RunData`
    """
    greatest: dict[str, float] = {}
    areas = {
        pipe.name: float(row["area"])
        for pipe, row in zip(model.pipes, model.tables.pipes, strict=True)
    }
    for k, probe in enumerate([*model.probes, *model.watched]):
        if probe.part == "links" and probe.name in areas and probe.quantity in ("flow", "velocity"):
            per = 1.0 if probe.quantity == "flow" else areas[probe.name]
            flow = float(np.abs(extremes[[0, 2], k]).max()) * per * model.case.properties.density
            greatest[probe.name] = max(greatest.get(probe.name, 0.0), flow)
    notices, tolerance = [], model.case.numerics.delay_tolerance
    for row in delays:
        pipe, name = model.tables.pipes[row["pipe"]], model.pipes[row["pipe"]].name
        flow, count = greatest.get(name, 0.0), int(row["stretches"])
        attenuation = friction_attenuation(pipe, float(row["tau"]) * count, flow)
        bound = 0.25 * attenuation / count
        velocity = flow / float(pipe["area"]) / model.case.properties.density
        if bound > tolerance and flow > planned_flow(model.case, pipe):
            shown = model.case.amount(velocity, "velocity", 3)
            text = (
                f"{name}: its flow grew to {shown}, and the friction of so fast a flow may cause an error in its "
                f"waves of {bound:.2g} times a change; set numerics.delay_velocity to {shown}, with steps that "
                "are short beside all changes of schedules"
            )
            notices.append(Notice("lines", f"links.{name}", text, "pipe_model", bound, tolerance))
    return notices


def planned_flow(case, pipe) -> float:
    """Mass flow for whose friction the stretches of a delay line are made [kg/s]; pipe : its row."""
    planned = case.properties.density * case.numerics.delay_velocity * float(pipe["area"])
    return max(abs(float(pipe["flow"])) + float(pipe["admittance"]) * FRICTION_PRESSURE, planned)


def divide_lines(draft, own) -> list[str]:
    """Divide all delay lines into stretches by friction at `planned_flow`; write their facts for `fvsolve check`.

    Returns the names of lines that must be computed with cells instead: under `auto` their error bound exceeds the
    tolerance, or friction does not balance their pressure drop at the start. Adds a fault where a pipe is stated to be
    a delay line but cannot be one, and a notice of schedules that are too fast for its steps.
    """
    case = draft.case
    at = 0
    unfit = []
    facts = draft.steady["lines"]
    for name, chosen in own.chosen.items():
        facts[name] = {"line": chosen.pipe_model, "line_bound": None, "line_why": chosen.reason}
    scale, ramp = time_scales(draft) if len(own.delays) else (0.0, 0.0)
    for row in own.delays:
        name = draft.pipe_names[row["pipe"]]
        pipe, chosen = draft.pipe_table[row["pipe"]], own.chosen[name]
        travel = float(row["tau"] * row["stretches"])
        attenuation = friction_attenuation(pipe, travel, planned_flow(case, pipe))
        limit = max(1, math.floor(travel / chosen.longest * (1.0 + 1e-9)))
        count = min(limit, max(1, math.ceil(0.5 * attenuation / case.numerics.delay_tolerance)))
        if row["now"] > 0.0:
            count = 1
        row["stretches"], row["stretch"], row["tau"] = count, at, travel / count
        row["transmission"] = 1.0 / (
            1.0 + 0.5 * row["tau"] * drag_and_slope(pipe, float(pipe["flow"]))[1]
        )
        row["hold"] = row["hold"] if row["now"] > 0.0 else row["tau"]
        at += count
        smoothed = interpolation_bound(float(row["tau"]), chosen.longest, scale, ramp)
        bound = 0.25 * attenuation / count + smoothed
        facts[name]["line_bound"] = bound
        force = float(drag_and_slope(pipe, float(pipe["flow"]))[0])
        if (
            abs(float(pipe["drag"]) - force)
            > UNBALANCED_SHARE * float(pipe["admittance"]) * 1e5 / travel
        ):
            bound = math.inf
            unfit.append(name)
            if (case.links[name].pipe_model or case.numerics.pipe_model) == "delay-line":
                draft.fault(
                    f"links.{name}.pipe_model",
                    '"delay-line" is not possible: at the start friction does not '
                    'balance the drop of pressure along the pipe; expected "finite-volume"',
                )
            continue
        if row["now"] > 0.0 and attenuation > MAX_ATTENUATION:
            bound = math.inf
            facts[name]["line_why"] += "; for so short a line friction attenuates a wave too much"
        stated = case.links[name].pipe_model or case.numerics.pipe_model
        if stated == "auto" and bound > case.numerics.delay_tolerance:
            unfit.append(name)
        elif smoothed > case.numerics.delay_tolerance and bound < math.inf:
            draft.warnings.append(
                fast_schedule_notice(
                    case, name, chosen.longest, min(scale, ramp or scale), smoothed
                )
            )
        elif bound == math.inf:
            longest = draft.case.step_amount(chosen.longest, 4)
            draft.fault(
                f"links.{name}.pipe_model",
                '"delay-line" is not possible: friction attenuates a wave by a '
                f"fraction of {attenuation:.3g} in this pipe, whose travel time is less than a step of "
                f'{longest}; expected shorter steps, or "finite-volume"',
            )
    set_rings(own.delays, longest_step(own))
    return unfit


def fast_schedule_notice(case, name: str, step: float, scale: float, bound: float) -> Notice:
    """Notice of a schedule that changes within `scale` [s], too fast for the steps of a delay line."""
    text = (
        f"{name}: a schedule changes its value within {case.step_amount(scale, 3)}, and steps of "
        f"{case.step_amount(step, 3)} may cause an error in the waves of this pipe of {bound:.2g} times the change; "
        f'expected shorter steps, or pipe_model = "finite-volume"'
    )
    return Notice(
        "lines", f"links.{name}", text, "pipe_model", bound, case.numerics.delay_tolerance
    )


def interpolation_bound(tau: float, step: float, scale: float, ramp: float) -> float:
    """Bound of the error of interpolation between steps, relative to the change of a schedule.

    tau : travel time of a stretch [s]; step : longest step [s]
    scale : duration of the fastest smooth change, half a cosine [s]; 0 for none
    ramp : duration of the fastest straight ramp [s]; 0 for none. At its kinks a polynomial through six entries
    overshoots by up to a tenth of the change in a step.
    """
    kinks = KINK_OVERSHOOT * step / ramp if ramp > 0.0 else 0.0
    bend = math.pi * step / scale if scale > 0.0 else 0.0
    if tau < step:
        kinks = tau * (step - tau) / (step * ramp) if ramp > 0.0 else 0.0
        return max(
            kinks, 0.25 * (math.pi / scale) ** 2 * tau * (step - tau) if scale > 0.0 else 0.0
        )
    if abs(tau / step - round(tau / step)) < 1e-9:
        return 0.0
    if tau >= 3.0 * step:
        return max(kinks, 0.5 * 0.0049 * bend**6)
    return max(kinks, 0.5 * (0.0234 * bend**4 if tau >= 2.0 * step else 0.0642 * bend**3))


def time_scales(draft) -> tuple[float, float]:
    """Shortest durations of a change of a schedule : (change of any shape, straight ramp) [s].

    A duration is 0 if no schedule has such a change. Jumps do not count, because they are followed exactly.
    """
    shortest = math.inf
    ramp = math.inf
    schedules = draft.schedules
    for first, count in schedules.records:
        rows = schedules.rows[first : first + count]
        for k, row in enumerate(rows):
            if row[1] == WAVE:
                shortest = min(shortest, math.pi / row[5]) if row[4] != 0.0 else shortest
            elif 0 < k < count - 1 and (row[1] != 0 or any(row[4:7])):
                shortest = min(shortest, rows[k + 1][0] - row[0])
                if row[1] == POWER or not any(row[5:7]):
                    ramp = min(ramp, rows[k + 1][0] - row[0])
    return tuple(duration if math.isfinite(duration) else 0.0 for duration in (shortest, ramp))


def longest_step(own) -> float:
    """Longest step, for which delay lines are divided into stretches [s]; infinite without delay lines."""
    lines = [method for method in own.chosen.values() if method.pipe_model == "delay-line"]
    return min((method.longest for method in lines), default=math.inf)


def mark_event_ends(delays, draft, group) -> None:
    """Mark in column `acts` the ends of delay lines at junctions that respond instantly: 1 `from`, 2 `to`, 3 both.

    Their group contains a device with events, or an end of a restriction with a flow law of its own.
    group : label of the group of each node; valves or couplings join the junctions of a group
    """
    inner = draft.node_table["kind"] == rec.JUNCTION
    valves = draft.valve_table
    acting = set()
    for v in valves:
        if v["hooks"] >= 0 or (v["device"] >= 0 and draft.devices[v["device"]][2].events):
            acting |= {int(v["from_node"]), int(v["to_node"])}
    acting |= {
        int(row[column])
        for row, (_, _, device) in zip(draft.device_table, draft.devices, strict=True)
        for column in ("node", "second")
        if device.events
    }
    roots = {group[i] for i in acting if i >= 0 and inner[i]}
    for row in delays:
        pipe = draft.pipe_table[row["pipe"]]
        ends = [int(pipe[end]) for end in ("from_node", "to_node")]
        row["acts"] = sum(
            side for side, i in zip((1, 2), ends, strict=True) if inner[i] and group[i] in roots
        )
