"""Open loop of a control: the linear system of a case whose loop is cut at the output of the control.

Delays are cut too: what arrives from them is an input, what enters them an output.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fvsolve.core.solve.held_inputs import hold
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.features.controls.feature import blocks_of
from fvsolve.features.controls.rows import small_change
from fvsolve.features.delay_lines.feature import history_of, lines_of, seen_by_jumps
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.parts.schedule import BLOCK_PREFIX
from fvsolve.studies.linearise import Linear, linearise_at
from fvsolve.studies.loops.delay_system import DelaySystem
from fvsolve.studies.operating_point import OperatingPoint, operating_point
from fvsolve.studies.stability.delay_line_limits import reflected_share
from fvsolve.units import DIMENSIONS, show

MAX_STATES = 800  # greatest number of states
# distance of an output from its limit, relative to the range of the output, that is rounding
SAME_OUTPUT = 1e-9
ANOTHER_POINT = (
    "expected an output between its limits: another time (--at), initial output or setpoint"
)


def block_of(case, name: str) -> str:
    """Name of a control of a case without the prefix "controls."; raises FvsolveError if it has no loop to study."""
    name = name.removeprefix(BLOCK_PREFIX)
    if name not in case.controls:
        hint = did_you_mean(name, case.controls) or (
            f"; controls are {listing(case.controls)}"
            if case.controls
            else "; the case has no [controls]"
        )
        raise FvsolveError(f"no control named {show(name)}{hint}")
    if case.controls[name].control.switches:
        kind = case.controls[name].control.kind
        raise FvsolveError(
            f"controls.{name} is a {kind}, whose output has no slope; expected another type of control"
        )
    return name


def delay_blocks(model) -> dict[str, float]:
    """Delay of each control of type delay [s] that acts at all times : name -> delay."""
    controls = blocks_of(model)
    acts = (controls["delay"] > 0.0) & (controls["period"] == 0.0)
    return {model.block_names[k]: float(controls["delay"][k]) for k in np.flatnonzero(acts)}


def open_loop(case, name: str, at: float | None) -> tuple[DelaySystem, OperatingPoint]:
    """(system from the held output of a control to its computed output, operating point).

    Raises FvsolveError for a control at a limit.
    """
    own = f"{BLOCK_PREFIX}{name}.output"
    linear, system = delayed_system(case, None, own, own, at)
    return system, linear.at


def delayed_system(case, set, input: str, output: str, at: float | None, before: bool = False):
    """(`Linear` system with all delays cut, `DelaySystem` from an input to a probe); arguments as for `linearise`.

    Delay lines are exact at the start; at another time they are replaced by cells.
    """
    delays = [key for key, block in case.controls.items() if block.control.kind == "delay"]
    probes = list(dict.fromkeys([output, *(f"{BLOCK_PREFIX}{key}.input" for key in delays)]))
    point = operating_point(case, set, at, before, probes, lines=True)
    cut = input.removeprefix(BLOCK_PREFIX).removesuffix(".output") if input == output else None
    refuse_limits(point, cut)
    inputs = list(dict.fromkeys([input, *(f"{BLOCK_PREFIX}{key}.output" for key in delays)]))
    linear = linear_with_names(point, inputs, len(probes))
    system = with_delays(linear, input, output, delay_blocks(point.model))
    if len(lines_of(point.model)):
        waves = [f"{BLOCK_PREFIX}{key}" for key in delay_blocks(point.model)]
        rows = [output, *(f"{wave}.input" for wave in waves)]
        system = with_lines(linear, system, [input, *(f"{wave}.output" for wave in waves)], rows)
    return linear, system


def outputs_at_limits(point: OperatingPoint) -> dict[str, float]:
    """Controls whose output is at a limit, up to rounding : name -> limit; without those that only switch."""
    result = {}
    for k, (name, row) in enumerate(
        zip(point.model.block_names, blocks_of(point.model), strict=True)
    ):
        block, span = point.model.case.controls[name], row["greatest"] - row["least"]
        for limit in (float(row["least"]), float(row["greatest"])):
            size = span if np.isfinite(span) else max(abs(limit), small_change(block.dimensions[1]))
            near = np.isfinite(limit) and abs(point.outputs[k] - limit) <= SAME_OUTPUT * size
            if near and not block.control.switches:
                result[name] = limit
    return result


def refuse_limits(point: OperatingPoint, cut: str | None) -> None:
    """Raise FvsolveError if the output of the control `cut`, or of a delay, is at one of its limits.

    There the loop is open, and a delay passes only a rise or only a fall.
    """
    for name, limit in outputs_at_limits(point).items():
        block = point.model.case.controls[name]
        if name == cut or block.control.kind == "delay":
            effect = (
                "so its loop is open" if name == cut else "so it passes only a rise or only a fall"
            )
            raise FvsolveError(
                f"the output of controls.{name} is at a limit, {limit_text(block, limit)}, at "
                f"{point.when}, {effect}; {ANOTHER_POINT}"
            )


def linear_with_names(point: OperatingPoint, inputs, outputs: int) -> Linear:
    """Result of `linearise_at`, whose errors name the controls that are at a limit."""
    try:
        return linearise_at(point, inputs, outputs)
    except FvsolveError as error:
        if stopped := outputs_at_limits(point):
            raise FvsolveError(
                f"{error}; at a limit: {at_limits(point, stopped)}; {ANOTHER_POINT}"
            ) from None
        raise


def at_limits(point: OperatingPoint, stopped: dict[str, float]) -> str:
    """Text of controls and their limits; stopped : as from `outputs_at_limits`."""
    return listing(
        f"controls.{key} ({limit_text(point.model.case.controls[key], stopped[key])})"
        for key in stopped
    )


def limit_text(block, limit: float) -> str:
    """Text of a limit of a control, with the SI unit of its output."""
    unit = DIMENSIONS[block.dimensions[1]].si
    return f"{limit:.6g}" + ("" if unit in ("", "-") else f" {unit}")


def open_loop_error(point: OperatingPoint, name: str) -> FvsolveError:
    """Error for a control whose output does not affect its input, with the controls that are at a limit."""
    stopped = outputs_at_limits(point)
    reason = f"; at a limit: {at_limits(point, stopped)}" if stopped else ""
    remedy = ANOTHER_POINT if stopped else "expected a control whose output affects its input"
    text = f"the output of controls.{name} does not affect its input at {point.when}, so its loop is open"
    return FvsolveError(f"{text}{reason}; {remedy}")


def state_limit_error(count: int) -> FvsolveError:
    """Error for a case with too many states."""
    text = f"the case has {count} states; expected {MAX_STATES} or fewer"
    return FvsolveError(f"{text}; give pipes fewer cells: --set links.NAME.cells=...")


def with_delays(system, cut: str, output: str, delays: dict[str, float]) -> DelaySystem:
    """`DelaySystem` with the input `cut`, of a linear system whose delays are cut; delays : as `delay_blocks`.

    The output of a delay is what arrives from it.
    """
    if len(system.states) > MAX_STATES:
        raise state_limit_error(len(system.states))
    a = system.a if isinstance(system.a, np.ndarray) else system.a.toarray()
    waves = [f"{BLOCK_PREFIX}{key}" for key in delays]
    columns = [system.inputs.index(cut), *(system.inputs.index(f"{wave}.output") for wave in waves)]
    rows = [
        system.outputs.index(output),
        *(system.outputs.index(f"{wave}.input") for wave in waves),
    ]
    b = system.b[:, columns].copy()
    c = system.c[rows]
    d = system.d[np.ix_(rows, columns)].copy()
    if cut.removesuffix(".output") in waves:  # the held output acts in place of what arrives
        k = 1 + waves.index(cut.removesuffix(".output"))
        b[:, k], d[:, k] = 0.0, 0.0
    if output.removesuffix(".output") in waves:
        c[0], d[0] = 0.0, 0.0
        d[0, 1 + waves.index(output.removesuffix(".output"))] = 1.0
    return DelaySystem(a, b, c, d, 1, 1, np.array(list(delays.values())))


# delay lines --------------------------------------------------------------------------------------------------

WIDTHS = (2e-3, 1e-3)  # deviations of Richardson's differences, relative to the size of a variable
BAR_PRESSURE = 1e5  # pressure of a wave of unit size [Pa]


def slope(f: Callable[[float], np.ndarray], size: float) -> np.ndarray:
    """Derivative of f at 0 by Richardson's differences; size : of a small deviation of its argument."""
    coarse, fine = ((f(width * size) - f(-width * size)) / (2.0 * width * size) for width in WIDTHS)
    return (4.0 * fine - coarse) / 3.0


def with_lines(linear, system: DelaySystem, inputs: list[str], probes: list[str]) -> DelaySystem:
    """Add the delay lines of a model at its start to a system, as two delays for each stretch of a line.

    A wave travels through a stretch in its time tau; friction in the middle reflects a part of it. The states of lines,
    their masses, are left out. inputs, probes : names of the columns of B and of the rows of C in `system`
    """
    at, rows = linear.at, lines_of(linear.at.model)
    model = seen_by_jumps(at.model)  # short lines need their travel time
    keep = np.setdiff1d(np.arange(len(system.a)), model.tables.pipes["y"][rows["pipe"]])
    evaluate = line_function(
        replace(at, model=model), keep, [linear.outputs.index(probe) for probe in probes]
    )
    y = at.y
    none = np.zeros(2 * len(rows))
    n = keep.size
    p = len(probes)
    sizes = np.repeat(model.tables.pipes["admittance"][rows["pipe"]], 2) * BAR_PRESSURE
    states, waves = np.eye(y.size)[keep], np.eye(none.size)
    by_state = [
        slope(lambda h, e=e: evaluate(y + h * e, none, {}), model.scale @ e) for e in states
    ]
    by_wave = np.array([slope(lambda h, e=e: evaluate(y, h * e, {}), sizes @ e) for e in waves]).T
    values = zip(
        inputs, (linear.input_values[linear.inputs.index(name)] for name in inputs), strict=True
    )
    by_input = [
        slope(
            lambda h, name=name, value=value: evaluate(y, none, {name: value + h}),
            max(0.01, abs(value)),
        )
        for name, value in values
    ]
    sent_by_state = np.array(by_state).reshape(n, -1).T[n + p :]
    sent_by_input = np.array(by_input).T[n + p :]
    read = by_wave[n : n + p]
    for k, probe in enumerate(probes):  # the output of a delay does not depend on present waves
        read[k] *= not (
            probe.endswith(".output") and f"{probe.removesuffix('.output')}.input" in probes
        )
    arriving, sent, chain = stretches(
        rows, [reflected_share(model.tables.pipes[row["pipe"]], row["tau"]) for row in rows]
    )
    return DelaySystem(
        system.a[np.ix_(keep, keep)],
        np.hstack([system.b[keep], by_wave[:n] @ arriving]),
        np.vstack([system.c[:, keep], sent @ sent_by_state]),
        np.block(
            [
                [system.d, read @ arriving],
                [sent @ sent_by_input, sent @ by_wave[n + p :] @ arriving + chain],
            ]
        ),
        1,
        1,
        np.concatenate([system.delays, np.repeat(rows["tau"], 2 * rows["stretches"])]),
    )


def line_function(at: OperatingPoint, keep: np.ndarray, probes: list[int]):
    """Function of states, waves that arrive at both ends of each line, and held inputs, at an operating point.

    Its values are the rates of the states `keep`, the probes with these numbers, and the waves that nodes send.
    """
    model = at.model
    t = float(at.t)
    rows = lines_of(at.model)
    ends = int(model.layout["ends"]) + 4 * rows["pipe"][:, None] + np.array([0, 3])
    first = np.cumsum(rows["stretches"]) - rows["stretches"]
    both = np.stack([first, first + rows["stretches"] - 1], axis=1)

    def evaluate(y: np.ndarray, waves: np.ndarray, held: dict[str, float]) -> np.ndarray:
        own = hold(model, held)
        with own.run_data(at.armed) as data:
            past = history_of(data)
            places = history.offsets_of(past)[0] + history.ARRIVALS_SIZE * both + np.array([0, 1])
            past[places.ravel()] = waves
            past[history.COUNT] = past[history.ARRIVALS_COUNT] = history.PROFILE_ENTRIES + 1.0
            past[history.ARRIVALS_TIME] = t
            dydt, out = data.evaluate(t, y, np.inf)
            return np.concatenate([dydt[keep], data.observe(t, y, out)[probes], out[ends.ravel()]])

    return evaluate


def stretches(rows: np.ndarray, shares: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices of the stretches of delay lines, which have two delays each: forward, then backward wave.

    rows : table of lines; shares : reflected share of a wave in a stretch of each line
    Results: waves that arrive at both ends of each line over delayed waves; waves that enter delays over waves that
    nodes send; waves that enter delays over delayed waves, at joints of stretches.
    """
    count, channels = len(rows), 2 * int(rows["stretches"].sum())
    arriving = np.zeros((2 * count, channels))
    sent = np.zeros((channels, 2 * count))
    chain = np.zeros((channels,) * 2)
    k = 0
    for i, (number, share) in enumerate(zip(rows["stretches"].tolist(), shares, strict=True)):
        forward, backward = k + 2 * np.arange(number), k + 2 * np.arange(number) + 1
        passed, reflected = 1.0 - share, share
        arriving[2 * i, [backward[0], forward[0]]] = passed, reflected
        arriving[2 * i + 1, [forward[-1], backward[-1]]] = passed, reflected
        sent[forward[0], 2 * i] = sent[backward[-1], 2 * i + 1] = 1.0
        for q in range(number - 1):
            chain[forward[q + 1], [forward[q], backward[q]]] = passed, reflected
            chain[backward[q], [backward[q + 1], forward[q + 1]]] = passed, reflected
        k += 2 * number
    return arriving, sent, chain
