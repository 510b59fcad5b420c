"""Delay lines of a model: choice of their pipes, stretches, bounds of the error, and the history of their waves.

Bounds are relative to the greatest jump of a schedule, and have three causes:
Friction acts in the middle of a stretch only: a quarter of the attenuation of a wave in a stretch.
Interpolation of a change that a schedule smooths over a time T: derivatives of half a cosine of duration T.
A line with a travel time tau shorter than the longest step h: curvature of the wave over it, tau (h - tau) / 2.
The history is a single array: size, ring buffers, and storage in the memory of a state.
"""

import copy
import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.delay_lines import wave_history as at
from fvsolve.kernels.delay_lines.line_rates import drag_and_slope
from fvsolve.kernels.schedule_pieces import POWER, WAVE
from fvsolve.model.cluster_tables import classify_nodes
from fvsolve.steppers import automatic
from fvsolve.steppers.step_control import DIVIDED_FRACTION
from fvsolve.steppers.tableau import AUTO, method_named

# stored jumps: in all lines together, least and most of each wave
TOTAL_JUMPS, LEAST_JUMPS, MOST_JUMPS = 2**16, 32, 1024
# spare entries beyond a delay: in all lines together, least and most of each
TOTAL_SPARE, LEAST_SPARE, MOST_SPARE = 2**14, 32, 256
HISTORY_DELAYS = 1.1  # a history spans this many delays
MARGIN_ENTRIES = 8  # and so many entries before that
LEAST_STEPS = 16  # steps


def set_rings(delays: np.ndarray, longest: float) -> None:
    """Set the size of the ring buffer of each stretch of delay lines, in entries, and its place among the rings.

    A ring holds HISTORY_DELAYS times the delay in steps of `longest` [s], and spare entries; sizes are powers of two.
    """
    if not len(delays):
        return
    count = int(delays["stretches"].sum())
    spare = min(MOST_SPARE, max(LEAST_SPARE, TOTAL_SPARE // max(1, count)))
    entries = HISTORY_DELAYS * delays["hold"] / longest + MARGIN_ENTRIES + spare
    delays["ring_size"] = 1 << np.ceil(np.log2(entries)).astype(np.int64)
    sizes = delays["ring_size"] * delays["stretches"]
    delays["ring"] = np.cumsum(sizes) - sizes


def history_size(delays: np.ndarray, wider: int = 1) -> int:
    """Size of the history array of these delay lines, with ring buffers `wider` times as long as at first."""
    if not len(delays):
        return 0
    count, entries = int(delays["stretches"].sum()), wider * ring_entries(delays)
    per_wave = at.HEAD_SIZE + at.JUMP_SIZE * jump_capacity(count)
    per_stretch = at.ARRIVALS_SIZE + 2 * per_wave + at.RING_GAP + at.BOUNDS_BEGIN
    times = wider * int(delays["ring_size"].max())
    return at.HEADER_SIZE + times + per_stretch * count + (2 + at.BOUNDS_SIZE) * entries


def ring_entries(delays: np.ndarray) -> int:
    """Capacity of the ring buffers of all stretches together, in entries, before they are lengthened."""
    return int((delays["ring_size"] * delays["stretches"]).sum())


def jump_capacity(count: int) -> int:
    """Number of jumps of each wave that can be stored at the same time, for `count` stretches."""
    return max(LEAST_JUMPS, min(MOST_JUMPS, TOTAL_JUMPS // count))


def reset_history(past: np.ndarray, delays: np.ndarray) -> None:
    """Clear the history array and write its sizes."""
    past[:] = 0.0
    begin_history(past, delays)


def begin_history(past: np.ndarray, delays: np.ndarray) -> None:
    """Write the sizes of a history to an array of zeros."""
    if not len(delays):
        return
    count = int(delays["stretches"].sum())
    sizes = [at.CAPACITY, at.JUMP_CAPACITY, at.STRETCHES, at.RING_FACTOR, at.ARRIVALS_TIME, at.CORRECTED_TIME]
    wider = 1 if past.size == history_size(delays) else ring_factor(past, delays)
    past[sizes] = wider * int(delays["ring_size"].max()), jump_capacity(count), count, wider, math.nan, -math.inf
    past[at.NEXT_ARRIVAL], past[at.RING_ENTRIES] = at.INFINITE, ring_entries(delays)
    past[at.SEGMENT_END], past[at.REFLECTION_RATE] = at.INFINITE, 1.0 / float(delays["tau"].min())


def ring_factor(past: np.ndarray, delays: np.ndarray) -> int:
    """Factor by which ring buffers are longer than at first, from the size of the history array."""
    wider = 1
    while history_size(delays, wider) < past.size:
        wider *= 2
    return wider


def stored_history(memory: dict[str, np.ndarray]) -> np.ndarray:
    """History of delay lines in the memory of a state; raises ValueError if the memory contains no history."""
    if "past" not in memory:
        text = "the memory of the state contains no history of delay lines; expected a State that a run returned"
        raise ValueError(text)
    return memory["past"].copy()


def stored_entries(past: np.ndarray) -> np.ndarray:
    """Numbers of all entries whose times are still stored, without those of the initial steady state."""
    return np.arange(max(at.PROFILE_ENTRIES, int(past[at.COUNT]) - int(past[at.CAPACITY])), int(past[at.COUNT]))


def jump_times(past: np.ndarray, delays: np.ndarray, begin: float, end: float) -> np.ndarray:
    """Times at which jumps reach ends or middles of stretches, between `begin` and `end` [s], increasing."""
    places, queue = at.offsets_of(past), int(past[at.JUMP_CAPACITY])
    heads = past[places[1] : places[2]].reshape(-1, at.HEAD_SIZE)
    line_of, arrivals = np.repeat(np.arange(len(delays)), delays["stretches"]), []
    for head in np.flatnonzero(heads[:, at.JUMP_COUNT]):
        line, first = delays[line_of[head // 2]], places[2] + at.JUMP_SIZE * queue * head
        order = (int(heads[head, at.FIRST_JUMP]) + np.arange(int(heads[head, at.JUMP_COUNT]))) % queue
        sent = past[first + order]
        arrivals += [sent + line["tau"], sent + 0.5 * line["tau"]]
    times, tolerance = np.sort(np.concatenate([[], *arrivals])), at.time_tolerance(past)
    times = times[(times > begin + tolerance) & (times < end - tolerance)]
    return times[np.diff(times, prepend=-np.inf) > tolerance]


def steps_left(past: np.ndarray, delays: np.ndarray) -> int:
    """Number of steps that can be taken before an entry that is still needed is overwritten."""
    count, sizes = int(past[at.COUNT]), int(past[at.RING_FACTOR]) * delays["ring_size"]
    if count == 0:
        return int(sizes.min()) - MARGIN_ENTRIES - LEAST_STEPS
    stored = stored_entries(past)
    times = past[at.HEADER_SIZE + (stored & (int(past[at.CAPACITY]) - 1))]
    oldest = stored[0] + np.maximum(
        0, np.searchsorted(times, times[-1] - HISTORY_DELAYS * delays["hold"]) - MARGIN_ENTRIES
    )
    return int((sizes - (count - oldest)).min())


def with_doubled_rings(past: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Copy of the history with ring buffers twice as long, with the same entries."""
    wider = 2 * int(past[at.RING_FACTOR])
    result = np.zeros(history_size(delays, wider))
    result[: at.HEADER_SIZE] = past[: at.HEADER_SIZE]
    result[[at.CAPACITY, at.RING_FACTOR]] *= 2.0
    stored = stored_entries(past)
    old, new = at.HEADER_SIZE, at.HEADER_SIZE
    result[new + (stored & (int(result[at.CAPACITY]) - 1))] = past[old + (stored & (int(past[at.CAPACITY]) - 1))]
    here, there = at.offsets_of(past), at.offsets_of(result)
    result[there[0] : there[3]] = past[here[0] : here[3]]  # all except rings and bounds
    for row in delays:
        for q in range(row["stretches"]):
            (old, old_mask), (new, new_mask) = at.ring_of(here, row, q), at.ring_of(there, row, q)
            own = stored[max(0, stored.size - old_mask - 1) :]
            for wave in range(2):
                result[new + 2 * (own & new_mask) + wave] = past[old + 2 * (own & old_mask) + wave]
    return result


def jump_overflow_notices(past: np.ndarray) -> list[Notice]:
    """List with a notice if there was no storage for some jumps, which were smoothed; else empty."""
    if not past.size or past[at.GREATEST_UNSTORED_JUMP] == 0.0:
        return []
    share = past[at.GREATEST_UNSTORED_JUMP] / past[at.GREATEST_JUMP]
    text = (
        f"more than {int(past[at.JUMP_CAPACITY])} jumps were travelling in one pipe: some of them, of up to "
        f"{share:.3g} times the greatest jump, were smoothed over a step; raise `numerics.delay_tolerance`, so that "
        'fewer jumps are stored, or set pipe_model = "finite-volume"'
    )
    return [Notice("jumps", "numerics", text, "delay_tolerance", float(share), None)]


FRICTION_PRESSURE = 0.02 * 1e5  # pressure [Pa] whose flow is added to that of the start to evaluate friction
UNBALANCED_SHARE = 1e-9  # relative to the wave of 1 bar: pressure drop that friction does not balance
KINK_OVERSHOOT = 0.1  # relative to the change in a step: overshoot of six entries after a kink
MAX_ATTENUATION = 0.5  # greatest attenuation of a wave by friction in a line shorter than a step


@dataclass(frozen=True)
class LineMethod:
    """Method for a pipe ("finite-volume" or "delay-line"), the reason for it, and the steps that it implies.

    rate : wave rate of all delay lines: key `cells` of the line with the longest travel time, over this time [1/s]
    longest : longest step [s]; stretches have at least this travel time, or the line is shorter than a step
    For "finite-volume" they are 0 and infinite.
    """

    pipe_model: str
    reason: str
    rate: float = 0.0
    longest: float = math.inf


def line_methods(case, unfit: Collection[str] = ()) -> dict[str, LineMethod]:
    """Method for every pipe : name of the pipe -> LineMethod.

    unfit : names of pipes whose estimated error as delay lines exceeds `numerics.delay_tolerance`
    """
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    methods, lines = {}, []
    for name, link in pipes.items():
        line = link.pipe_model or case.numerics.pipe_model
        need = "" if line == "finite-volume" else reason_for_cells(case, name, link)
        if line == "auto" and case.controls:
            need = need or "a control may change values at any rate"
        if line == "finite-volume" or need:
            methods[name] = LineMethod("finite-volume", need or f'pipe_model = "{line}"')
        elif name in unfit:
            methods[name] = LineMethod("finite-volume", "its error as a delay line may exceed numerics.delay_tolerance")
        else:
            lines.append(name)
    if not lines:
        return {name: methods[name] for name in pipes}
    travel = {name: link.length / case.wave_speed(name) for name, link in pipes.items()}
    slowest = slowest_pipe(case, lines)
    rate = pipes[slowest].cells / travel[slowest]
    cells = max((pipes[name].cells / travel[name] for name in methods), default=0.0)
    numerics = case.numerics
    longest = 1.0 / rate  # under error control, see `solve.run_loop.longest_step`
    if numerics.step is not None or numerics.courant is not None:
        longest = numerics.step or numerics.courant / max(rate, cells)
    steppers = (automatic.EXPLICIT, automatic.IMPLICIT) if numerics.method == AUTO else (numerics.method,)
    # no value is read that is not yet known
    longest *= max(1.0, *(time for method in steppers for time in method_named(method).times))
    for name in lines:
        reason = "waves travel along it unchanged except for friction"
        if travel[name] < longest:
            reason += f", and in less than a step of {case.step_amount(longest, 4)}"
        methods[name] = LineMethod("delay-line", reason, rate, longest)
    return {name: methods[name] for name in pipes}


def slowest_pipe(case, names: Collection[str]) -> str:
    """Name of the pipe with the longest travel time of a wave; with most cells if several have the longest."""
    travel = {name: case.links[name].length / case.wave_speed(name) for name in names}
    longest = (1.0 - 1e-9) * max(travel.values())  # travel times that differ by rounding are equal
    return max(names, key=lambda name: (travel[name] > longest, case.links[name].cells, travel[name]))


def reason_for_cells(case, name: str, link) -> str:
    """Reason why a pipe must be computed with cells; "" if it can be a delay line."""
    if not case.law.linear:
        return f'law = "{case.law.name}" changes waves as they travel'
    if case.scalars:
        return "scalars are carried in cells"
    if link.friction.model == "unsteady":
        return "unsteady friction depends on the flow history of every cell"
    if link.creep_elements:
        return "its wall creeps in every cell"
    if any(getattr(case.places[end], "on", None) for end in link.ports.values()):
        return "the acceleration of its body acts on its cells"
    if name in case.links_with_force_probe:
        return "a probe reads its force, which is computed from cells"
    return ""


def lower_delays(draft) -> None:
    """Fill the table of delay lines and, at each node, the list of their ends.

    Adds a fault for each pipe that is stated to be a delay line but cannot be one.
    """
    case, rows = draft.case, []
    for k, name in enumerate(draft.pipe_names):
        link, chosen = case.links[name], draft.followed[name]
        stated = link.pipe_model or case.numerics.pipe_model
        if stated == "delay-line" and chosen.pipe_model == "finite-volume":
            key = f"links.{name}.pipe_model" if link.pipe_model else "numerics.pipe_model"
            text = f'"delay-line" is not possible for links.{name}: {chosen.reason}'
            draft.fault(key, f'{text}; expected "finite-volume" or "auto"')
        if chosen.pipe_model == "finite-volume":
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
    set_rings(draft.delay_table, longest_step(draft))
    ends: list[list[int]] = [[] for _ in draft.node_table] if rows else []
    for d, row in enumerate(rows):
        for side, end in enumerate(("from_node", "to_node")):
            ends[draft.pipe_table[row["pipe"]][end]].append(2 * d + side)
    for i, lines in enumerate(ends):
        draft.node_table["lines"][i], draft.node_table["line_count"][i] = len(draft.integers), len(lines)
        draft.integers += lines


def jump_tables(draft) -> dict[str, np.ndarray]:
    """Tables that replace those of the model while a jump is solved : name -> table; empty if all lines exceed a step.

    In them a line shorter than a step acts like a longer line: its ends are not coupled within the step.
    """
    short = draft.delay_table["now"] > 0.0
    if not short.any():
        return {}
    own, tables = copy.copy(draft), draft.tables
    copied = (draft.node_table, draft.valve_table, draft.delay_table)
    own.node_table, own.valve_table, own.delay_table = (table.copy() for table in copied)
    own.integers, own.floats, own.faults = tables.integers.tolist(), tables.floats.tolist(), []
    for pipe in draft.pipe_table[draft.delay_table["pipe"][short]]:
        for end in ("from_node", "to_node"):
            own.node_table["admittance"][pipe[end]] += pipe["admittance"] * (1.0 - end_admittance_ratio(draft, pipe))
    own.delay_table["now"] = own.delay_table["couple"] = 0.0
    classify_nodes(own)
    return {
        "nodes": own.node_table, "valves": own.valve_table, "delays": own.delay_table, "clusters": own.cluster_table,
        "integers": np.array(own.integers), "floats": np.array(own.floats),
    }  # fmt: skip


def end_admittance_ratio(draft, pipe) -> float:
    """Admittance of a pipe at its end nodes, relative to the admittance of its waves.

    It is 1, and less for a delay line shorter than a step, because its ends are coupled within the step.
    """
    beta = draft.delay_table["now"][pipe["delay"]] if pipe["delay"] >= 0 else 0.0
    return float((1.0 - beta) / (1.0 + beta))


def friction_attenuation(pipe, travel: float, flow: float) -> float:
    """Attenuation of a wave by friction in a pipe; pipe : its row; travel : travel time [s]; flow : [kg/s]."""
    return travel * float(drag_and_slope(pipe, flow)[1])


def friction_notices(model, extremes: np.ndarray) -> list[Notice]:
    """Notices of delay lines in which the flow has grown, so that their friction needs more stretches.

    A line that is at rest at the start has one stretch. The flows of a run are known where they are probed or limited.
    extremes : float64[4, probes] as in `RunData`
    """
    greatest: dict[str, float] = {}
    areas = {pipe.name: float(row["area"]) for pipe, row in zip(model.pipes, model.tables.pipes, strict=True)}
    for k, probe in enumerate([*model.probes, *model.watched]):
        if probe.part == "links" and probe.name in areas and probe.quantity in ("flow", "velocity"):
            per = 1.0 if probe.quantity == "flow" else areas[probe.name]
            flow = float(np.abs(extremes[[0, 2], k]).max()) * per * model.case.properties.density
            greatest[probe.name] = max(greatest.get(probe.name, 0.0), flow)
    notices, tolerance = [], model.case.numerics.delay_tolerance
    for row in model.tables.delays:
        pipe, name = model.tables.pipes[row["pipe"]], model.pipes[row["pipe"]].name
        flow, count = greatest.get(name, 0.0), int(row["stretches"])
        attenuation = friction_attenuation(pipe, float(row["tau"]) * count, flow)
        bound, velocity = 0.25 * attenuation / count, flow / float(pipe["area"]) / model.case.properties.density
        if bound > tolerance and flow > planned_flow(model.case, pipe):
            shown = model.case.amount(velocity, "velocity", 3)
            text = (f"{name}: its flow grew to {shown}, and the friction of so fast a flow may cause an error in its "
                    f"waves of {bound:.2g} times a change; set numerics.delay_velocity to {shown}, with steps that "
                    "are short beside all changes of schedules")  # fmt: skip
            notices.append(Notice("lines", f"links.{name}", text, "pipe_model", bound, tolerance))
    return notices


def planned_flow(case, pipe) -> float:
    """Mass flow for whose friction the stretches of a delay line are made [kg/s]; pipe : its row."""
    planned = case.properties.density * case.numerics.delay_velocity * float(pipe["area"])
    return max(abs(float(pipe["flow"])) + float(pipe["admittance"]) * FRICTION_PRESSURE, planned)


def divide_lines(draft) -> list[str]:
    """Divide all delay lines into stretches by friction at `planned_flow`; write their facts for `fvsolve check`.

    Returns the names of lines that must be computed with cells instead: under `auto` their error bound exceeds the
    tolerance, or friction does not balance their pressure drop at the start. Adds a fault where a pipe is stated to be
    a delay line but cannot be one, and a notice of schedules that are too fast for its steps.
    """
    case, at, unfit = draft.case, 0, []
    facts = draft.steady["lines"] = {}
    for name, chosen in draft.followed.items():
        facts[name] = {"line": chosen.pipe_model, "line_bound": None, "line_why": chosen.reason}
    scale, ramp = time_scales(draft) if len(draft.delay_table) else (0.0, 0.0)
    for row in draft.delay_table:
        name = draft.pipe_names[row["pipe"]]
        pipe, chosen = draft.pipe_table[row["pipe"]], draft.followed[name]
        travel = float(row["tau"] * row["stretches"])
        attenuation = friction_attenuation(pipe, travel, planned_flow(case, pipe))
        limit = max(1, math.floor(travel / chosen.longest * (1.0 + 1e-9)))
        count = min(limit, max(1, math.ceil(0.5 * attenuation / case.numerics.delay_tolerance)))
        if row["now"] > 0.0:
            count = 1
        row["stretches"], row["stretch"], row["tau"] = count, at, travel / count
        row["transmission"] = 1.0 / (1.0 + 0.5 * row["tau"] * drag_and_slope(pipe, float(pipe["flow"]))[1])
        row["hold"] = row["hold"] if row["now"] > 0.0 else row["tau"]
        at += count
        smoothed = interpolation_bound(float(row["tau"]), chosen.longest, scale, ramp)
        bound = 0.25 * attenuation / count + smoothed
        facts[name]["line_bound"] = bound
        force = float(drag_and_slope(pipe, float(pipe["flow"]))[0])
        if abs(float(pipe["drag"]) - force) > UNBALANCED_SHARE * float(pipe["admittance"]) * 1e5 / travel:
            bound = math.inf
            unfit.append(name)
            if (case.links[name].pipe_model or case.numerics.pipe_model) == "delay-line":
                draft.fault(f"links.{name}.pipe_model", '"delay-line" is not possible: at the start friction does not '
                            'balance the drop of pressure along the pipe; expected "finite-volume"')  # fmt: skip
            continue
        if row["now"] > 0.0 and attenuation > MAX_ATTENUATION:
            bound = math.inf
            facts[name]["line_why"] += "; for so short a line friction attenuates a wave too much"
        stated = case.links[name].pipe_model or case.numerics.pipe_model
        if stated == "auto" and bound > case.numerics.delay_tolerance:
            unfit.append(name)
        elif smoothed > case.numerics.delay_tolerance and bound < math.inf:
            draft.warnings.append(fast_schedule_notice(case, name, chosen.longest, min(scale, ramp or scale), smoothed))
        elif bound == math.inf:
            longest = draft.case.step_amount(chosen.longest, 4)
            draft.fault(f"links.{name}.pipe_model", '"delay-line" is not possible: friction attenuates a wave by a '
                        f"fraction of {attenuation:.3g} in this pipe, whose travel time is less than a step of "
                        f'{longest}; expected shorter steps, or "finite-volume"')  # fmt: skip
    set_rings(draft.delay_table, longest_step(draft))
    draft.shapes = draft.shapes._replace(past=history_size(draft.delay_table))
    return unfit


def fast_schedule_notice(case, name: str, step: float, scale: float, bound: float) -> Notice:
    """Notice of a schedule that changes within `scale` [s], too fast for the steps of a delay line."""
    text = (
        f"{name}: a schedule changes its value within {case.step_amount(scale, 3)}, and steps of "
        f"{case.step_amount(step, 3)} may cause an error in the waves of this pipe of {bound:.2g} times the change; "
        f'expected shorter steps, or pipe_model = "finite-volume"'
    )
    return Notice("lines", f"links.{name}", text, "pipe_model", bound, case.numerics.delay_tolerance)


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
        return max(kinks, 0.25 * (math.pi / scale) ** 2 * tau * (step - tau) if scale > 0.0 else 0.0)
    if abs(tau / step - round(tau / step)) < 1e-9:
        return 0.0
    if tau >= 3.0 * step:
        return max(kinks, 0.5 * 0.0049 * bend**6)
    return max(kinks, 0.5 * (0.0234 * bend**4 if tau >= 2.0 * step else 0.0642 * bend**3))


def time_scales(draft) -> tuple[float, float]:
    """Shortest durations of a change of a schedule : (change of any shape, straight ramp) [s].

    A duration is 0 if no schedule has such a change. Jumps do not count, because they are followed exactly.
    """
    shortest, ramp, schedules = math.inf, math.inf, draft.schedules
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


def dividing_rate(model, step: float) -> float:
    """Rate above which explicit steps of given length are divided [1/s]; 0 for steps that are never divided.

    Steps are divided beside delay lines, whose own waves do not limit a step: without cells, the parts at the ends of
    lines are all that a given step can be too long for. The rate is that of the step, and at least that of waves in the
    cells of other pipes. step : given step [s]
    """
    if model.basins or not (model.tables.pipes["delay"] >= 0).any():
        return 0.0
    return max(1.0 / step, float(model.tables.settings["rate"][0]) * (1.0 + 1e-9))


def step_at_start(model) -> float:
    """Given step of a run, or the part of it into which an explicit method divides it at the start [s]."""
    numerics, step = model.case.numerics, model.case.numerics.step
    explicit = method_named(automatic.first_method(numerics.method)).explicit
    least = dividing_rate(model, step) if explicit else 0.0
    rate = float(model.evaluate(numerics.start, model.start, numerics.start)[1][rec.RATE]) if least > 0.0 else 0.0
    return DIVIDED_FRACTION / rate if rate > least > 0.0 else step


def longest_step(draft) -> float:
    """Longest step, for which delay lines are divided into stretches [s]; infinite without delay lines."""
    lines = [method for method in draft.followed.values() if method.pipe_model == "delay-line"]
    return min((method.longest for method in lines), default=math.inf)
