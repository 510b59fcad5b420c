"""Loops with sampled controls: their linear map over the common period of all samples, exact between samples.

The state z of the map contains the states x, the numbers of all sampled controls (outputs that they hold, and memory),
and numbers of delays: the value w that leaves a delay now, and registers of values on their way. Between samples
x' = A x + B h, with held outputs and delayed values h, has the solution of the exponential. Two kinds of delays are
exact: those whose input is held (w changes at known times), and those that only samples read (w is needed at known
times).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.solve.held_inputs import hold
from fvsolve.errors import FvsolveError, listing
from fvsolve.features.controls.feature import blocks_of, numbers_of, with_blocks
from fvsolve.features.controls.rows import control_rows_of
from fvsolve.parts.schedule import BLOCK_PREFIX
from fvsolve.studies.loops.delay_system import EIGENVALUE_OPERATIONS, DelaySystem
from fvsolve.studies.loops.open_loop import (
    ANOTHER_POINT,
    MAX_STATES,
    WIDTHS,
    at_limits,
    delay_blocks,
    linear_with_names,
    outputs_at_limits,
    refuse_limits,
    state_limit_error,
)
from fvsolve.studies.operating_point import OperatingPoint, operating_point
from fvsolve.studies.work_limit import DENSE_RATE, WorkLimit

MOST_TICKS = 10_000  # samples in the common period
RATIONAL = 10**6  # greatest denominator of a ratio of two periods
SAME = 1e-9  # of the common period: times closer than this are the same
ARRIVE, TICK, SEND = range(3)  # events, in their order at one time
SINGULAR = 1e12  # condition number of z - M above which L has a pole at z
STABLE = 1e-13  # a spectral radius below 1 minus this is stable
# a kink: sides that differ by this part of the quotient, alike at both widths, and by more than rounding of the value
KINK, ALIKE, KINK_ROUNDING, LEAST_KINK = 1e-2, 0.25, 1e-6, 1e-12
REMEDY = "use fewer cells, --set links.NAME.cells=..., or periods of the controls with a shorter common period"
EXPONENTIAL_OPERATIONS = 40.0  # over n^3


@dataclass(frozen=True)
class LoopEvent:
    """LoopEvent in the common period: at a time since its start [s], of a kind, of a control.

    age : for ARRIVE, the register that has the arriving value, counted from the newest
    """

    time: float
    kind: int
    control: str
    age: int = 0


class SampledLoop:
    """Loop of a control in a case with sampled controls; name : control at whose output the loop is cut.

    Raises FvsolveError for a case that has no common period, for delays of neither kind in the module docstring, and
    TooLarge if the estimated time of its maps exceeds a limit.
    """

    def __init__(self, case, name: str, at: float | None) -> None:
        self.case, self.name = case, name
        blocks = case.controls
        self.sampled = {
            key: block.control for key, block in blocks.items() if block.control.period is not None
        }
        if late := [key for key in self.sampled if blocks[key].control.kind == "delay"]:
            raise FvsolveError(
                f"controls.{late[0]} is a delay with `period`; expected a delay that acts at all times"
            )
        delays = [key for key, block in blocks.items() if block.control.kind == "delay"]
        self.period, self.ticks = common_period(self.sampled)
        own = f"{BLOCK_PREFIX}{name}.output"
        probes = list(dict.fromkeys([own, *(f"{BLOCK_PREFIX}{key}.input" for key in delays)]))
        self.point = operating_point(case, None, at, False, probes)
        refuse_limits(self.point, name)
        self.delays, self.flows, self.flows_gain = delay_blocks(self.point.model), {}, np.nan
        inputs = list(
            dict.fromkeys(
                [own, *(f"{BLOCK_PREFIX}{key}.output" for key in (*self.sampled, *self.delays))]
            )
        )
        system = linear_with_names(self.point, inputs, len(probes))
        if len(system.states) > MAX_STATES:
            raise state_limit_error(len(system.states))
        self.a = system.a if isinstance(system.a, np.ndarray) else system.a.toarray()
        # input of each delay, and output of the control : (row of C, entries of D by control)
        controls = [name_of(text) for text in system.inputs]
        self.signal = {
            name_of(text): (row, dict(zip(controls, direct.tolist(), strict=True)))
            for text, row, direct in zip(system.outputs, system.c, system.d, strict=False)
        }
        self.column = dict(zip(controls, system.b.T, strict=True))
        held = [
            *self.delays,
            *([name] if name not in self.sampled and name not in self.delays else []),
        ]
        if held and name in held and name not in self.delays:
            self.point = replace(
                self.point,
                model=hold(
                    self.point.model,
                    {own: float(self.point.outputs[self.point.model.block_names.index(name)])},
                ),
            )
        self.differences = without_idle_numbers(
            tick_differences(self.point, list(self.sampled), held)
        )
        self.events, self.registers = self.all_events()
        n, self.places = len(self.a), {}
        for key in self.sampled:
            count = self.differences[key][0].shape[0]
            self.places[key], n = n + np.arange(count), n + count
        for key in self.delays:  # w, then registers from the newest
            self.places[key], n = (
                n + np.arange(1 + self.registers[key]),
                n + 1 + self.registers[key],
            )
        self.size = n
        self.work = WorkLimit(f"maps of {n} numbers with {len(self.events)} events", REMEDY)

    def feeds_states(self, key: str) -> bool:
        """True if the output of a delay drives states, or another delay, between samples."""
        others = any(abs(self.signal[other][1].get(key, 0.0)) > 0.0 for other in self.signal)
        return bool(np.any(self.column[key])) or others

    def is_held(self, key: str) -> bool:
        """True if the input of a delay only changes at samples."""
        row, direct = self.signal[key]
        return not np.any(row) and not any(direct.get(other, 0.0) for other in self.delays)

    def all_events(self) -> tuple[list[LoopEvent], dict[str, int]]:
        """(events of the common period in their order, number of registers of each delay)."""
        events = [LoopEvent(time, TICK, key) for key, times in self.ticks.items() for time in times]
        registers = {}
        instants = sorted({self.within(time) for times in self.ticks.values() for time in times})
        for key, tau in self.delays.items():
            if self.is_held(key):
                sends, arrivals = instants, [time + tau for time in instants]
            elif not self.feeds_states(key):
                sends, arrivals = [time - tau for time in instants], instants
            else:
                raise FvsolveError(
                    f"controls.{key} delays what changes between samples, and drives what moves between "
                    "samples: such a loop has no finite map; expected a delay at a sampled control, or "
                    "loops without samples"
                )
            ages = [
                1 + sum(count_within(send, arrival - tau, arrival, self.period) for send in sends)
                for arrival in arrivals
            ]
            events += [
                LoopEvent(time, ARRIVE, key, age) for time, age in zip(arrivals, ages, strict=True)
            ]
            events += [LoopEvent(time, SEND, key) for time in sends]
            registers[key] = max(ages)
        return sorted(
            (replace(event, time=self.place(event)) for event in events), key=self.rank
        ), registers

    def rank(self, event: LoopEvent) -> tuple:
        """Order of an event: time, kind, then order in which controls decide."""
        names = self.point.model.block_names
        return round(event.time / (SAME * self.period)), event.kind, names.index(event.control)

    def within(self, time: float) -> float:
        """Time in the common period [s]."""
        time %= self.period
        return 0.0 if time > self.period * (1.0 - SAME) else time

    def place(self, event: LoopEvent) -> float:
        """Time of an event since the sample of the control [s]: this sample ends the period, with what comes before it.

        What comes at the same time after it, as it depends on the new output, begins the next period.
        """
        if self.name not in self.sampled:
            return self.within(event.time)
        time = self.within(event.time - self.ticks[self.name][0])
        names = self.point.model.block_names
        later = event.kind == TICK and names.index(event.control) > names.index(self.name)
        return time if time > SAME * self.period or event.kind == SEND or later else self.period

    # the map ------------------------------------------------------------------------------------------------

    def factor(self, key: str, gain: float) -> float:
        """Factor on the output of a control."""
        return gain if key == self.name else 1.0

    def flow(self, gain: float, length: float) -> np.ndarray:
        """Map of z over a length of time without events [s], with a factor `gain` on the output of the control."""
        from scipy.linalg import expm

        if gain != self.flows_gain:  # those of other gains are not needed again
            self.flows, self.flows_gain = {}, gain
        if length not in self.flows:
            n, rates = len(self.a), np.zeros((self.size, self.size))
            rates[:n, :n] = self.a
            for key in (*self.sampled, *self.delays):
                rates[:n, self.places[key][0]] += self.factor(key, gain) * self.column[key]
            if self.name not in self.places:
                rates[:n] += gain * np.outer(
                    self.column[self.name], self.signal_row(self.name, gain)
                )
            self.work.spend(EXPONENTIAL_OPERATIONS * self.size**3 / DENSE_RATE)
            self.flows[length] = expm(rates * length)
        return self.flows[length]

    def signal_row(self, key: str, gain: float) -> np.ndarray:
        """Row of a signal, the input of a delay or the output of the control, as a function of z."""
        row, (states, direct) = np.zeros(self.size), self.signal[key]
        row[: len(self.a)] = states
        for other, value in direct.items():
            if other in self.places:
                row[self.places[other][0]] += self.factor(other, gain) * value
            elif other == self.name and key != self.name:
                row += gain * value * self.signal_row(self.name, gain)
        return row

    def apply_jump(self, event: LoopEvent, gain: float, z: np.ndarray) -> None:
        """Multiply z : float64[size, m] by the map at an event, in place; gain : factor on the output."""
        places, before = self.places[event.control], z[self.places[event.control]]
        if event.kind == ARRIVE:
            z[places[0]] = before[event.age]
        elif event.kind == SEND:
            sent = self.signal_row(event.control, gain) @ z
            z[places[2:]] = before[1:-1]
            z[places[1]] = sent
        else:
            by_state, by_number = self.differences[event.control]
            after = by_state @ z[: len(self.a)]
            for key, columns in by_number.items():
                if key in self.places:
                    scaled = columns.copy()
                    scaled[:, 0] *= self.factor(key, gain)
                    after += scaled @ z[self.places[key][: columns.shape[1]]]
                else:  # the output of the control, which is continuous
                    after += gain * np.outer(columns[:, 0], self.signal_row(self.name, gain) @ z)
            z[places] = after

    def matrix(self, gain: float = 1.0) -> np.ndarray:
        """Map of z over the common period, with a factor `gain` on the output of the control."""
        result, now = np.eye(self.size), 0.0
        for event in self.events:
            if event.time - now > SAME * self.period:
                result, now = self.flow(gain, event.time - now) @ result, event.time
                self.work.spend(2.0 * self.size**3 / DENSE_RATE)
            self.apply_jump(event, gain, result)
        if self.period - now > SAME * self.period:
            result = self.flow(gain, self.period - now) @ result
        return result

    @property
    def acts_once(self) -> bool:
        """True if the control is sampled once in the common period, so that its loop has a return ratio."""
        return self.name in self.sampled and len(self.ticks[self.name]) == 1

    @cached_property
    def open_matrix(self) -> np.ndarray:
        """Map of z with the loop open."""
        return self.matrix(0.0)

    @cached_property
    def drive(self) -> np.ndarray:
        """Change of z in a period by a held output of 1, of a control that is sampled once."""
        place = self.places[self.name][0]
        return (self.matrix(1.0) - self.open_matrix)[:, place]

    def closed_matrix(self, gain: float) -> np.ndarray:
        """Map of z as `matrix`; of a control that is sampled once it is linear in the gain."""
        if not self.acts_once:
            return self.matrix(gain)
        result = self.open_matrix.copy()
        result[:, self.places[self.name][0]] += gain * self.drive
        return result

    def ratio(self, w: np.ndarray) -> np.ndarray:
        """Return ratio L(exp(j w h)) of a control that is sampled once in a period h; w : frequencies [rad/s]."""
        return -self.open_system.response(np.exp(1j * np.asarray(w, float) * self.period))[:, 0, 0]

    @cached_property
    def open_system(self) -> DelaySystem:
        """System with the transfer function -L(z) of a control that is sampled once."""
        row = np.eye(1, self.size, self.places[self.name][0])
        return DelaySystem(
            self.open_matrix, self.drive[:, None], row, np.zeros((1, 1)), 1, 1, np.zeros(0)
        )

    def radius(self, gain: float) -> float:
        """Spectral radius of the map."""
        self.work.spend(EIGENVALUE_OPERATIONS * self.size**3 / DENSE_RATE)
        return float(np.max(np.abs(np.linalg.eigvals(self.closed_matrix(gain)))))

    def real_ends(self) -> tuple[complex | None, complex | None]:
        """L at z = 1 and at z = -1, of a control that is sampled once; None for a pole there."""
        place, result = self.places[self.name][0], []
        for z in (1.0, -1.0):
            matrix = z * np.eye(self.size) - self.open_matrix
            singular = np.linalg.cond(matrix) > SINGULAR
            result.append(
                None if singular else complex(-np.linalg.solve(matrix, self.drive)[place])
            )
        return result[0], result[1]

    def gain_range(self, limits: np.ndarray) -> tuple[float | None, float | None]:
        """Least and greatest factor on the loop between which it is stable; None for an open end.

        limits : gains at which a pole may cross the unit circle, of a control that is sampled once. For another control
        they are found by bisection between 1e-6 and 1e6. If the loop is not stable, the range is the nearest one that
        is; both are None without one.
        """
        if not self.acts_once:
            gains = np.concatenate([np.geomspace(1e-6, 1.0, 241), np.geomspace(1.0, 1e6, 241)[1:]])
            stable = [self.radius(gain) < 1.0 - STABLE for gain in gains]
            limits = [
                self.limit(*gains[k : k + 2])
                for k in range(gains.size - 1)
                if stable[k] != stable[k + 1]
            ]
        bounds = [0.0, *sorted({float(limit) for limit in limits}), np.inf]
        return nearest_range(
            bounds,
            lambda low, high: self.radius(gain_within(low, high)) < 1.0 - STABLE,
            distance_of,
        )

    def limit(self, low: float, high: float) -> float:
        """Gain between two others at which the spectral radius is 1."""
        from scipy.optimize import brentq

        return float(
            brentq(lambda gain: self.radius(gain) - 1.0, low, high, xtol=1e-15, rtol=1e-14)
        )

    def step_response(self, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """(times [s], response of L / (1 + L) at samples to a step of 1) of a control that is sampled once."""
        place = self.places[self.name][0]
        z = np.zeros(self.size)
        values = []
        for _ in range(periods):
            values.append(-z[place])
            z = self.open_matrix @ z + self.drive * (1.0 + z[place])
        return self.period * np.arange(periods), np.array(values)


def nearest_range(
    bounds: list[float],
    stable: Callable[[float, float], bool],
    distance: Callable[[float, float], float],
) -> tuple[float | None, float | None]:
    """Ends of the range of gains around 1 that is stable, or of the nearest one that is; None for an open end.

    bounds : rising gains from 0 to infinity, at which stability may change; stable : of an interval between two of them
    distance : of an interval from the gain 1, where those at equal distances are searched from below
    """
    count = len(bounds) - 1
    known = functools.cache(lambda k: stable(bounds[k], bounds[k + 1]))
    here = next(k for k in range(count) if bounds[k] <= 1.0 < bounds[k + 1])
    order = sorted(range(count), key=lambda k: (k != here, distance(bounds[k], bounds[k + 1])))
    first = last = next((k for k in order if known(k)), None)
    if first is None:
        return None, None
    while first > 0 and known(first - 1):
        first -= 1
    while last + 1 < count and known(last + 1):
        last += 1
    low, high = bounds[first], bounds[last + 1]
    return low if low > 0.0 else None, high if high < np.inf else None


def distance_of(low: float, high: float) -> float:
    """Distance of a gain within an interval from 1, in logarithms."""
    return abs(float(np.log(gain_within(low, high))))


def gain_within(low: float, high: float) -> float:
    """Gain between two limits, 0 and infinity included."""
    if high == np.inf:
        return 2.0 * low or 1.0
    return float(np.sqrt(low * high)) if low > 0.0 else 0.5 * high


def name_of(text: str) -> str:
    """Name of a control in the name of one of its quantities, "controls.NAME.output"."""
    return text.removeprefix(BLOCK_PREFIX).rpartition(".")[0]


def common_period(sampled: dict) -> tuple[float, dict[str, list[float]]]:
    """(common period of all sampled controls [s], times of the samples of each in it).

    Raises FvsolveError for periods without a ratio of whole numbers, and for too many samples.
    """
    names = list(sampled)
    first = sampled[names[0]].period
    ratios = {
        name: Fraction(sampled[name].period / first).limit_denominator(RATIONAL) for name in names
    }
    if odd := [
        name
        for name in names
        if abs(float(ratios[name]) * first / sampled[name].period - 1.0) > 1e-12
    ]:
        raise FvsolveError(
            f"the periods of {listing([names[0], odd[0]])} have no common period; expected whole ratios"
        )
    whole = Fraction(1)
    for ratio in ratios.values():
        whole = Fraction(
            np.lcm(whole.numerator * ratio.denominator, ratio.numerator * whole.denominator),
            whole.denominator * ratio.denominator,
        )
    counts = {name: int(whole / ratio) for name, ratio in ratios.items()}
    if sum(counts.values()) > MOST_TICKS:
        raise FvsolveError(
            f"the common period of {listing(names)} has {sum(counts.values())} samples; expected "
            f"{MOST_TICKS} or fewer"
        )
    ticks = {
        name: [sampled[name].offset + k * sampled[name].period for k in range(counts[name])]
        for name in names
    }
    return float(whole) * first, ticks


def count_within(time: float, begin: float, end: float, period: float) -> int:
    """Number of the times `time` + k `period`, k whole, between two times, without these [s]."""
    slack = SAME * period
    return (
        int(np.ceil((end - slack - time) / period) - np.floor((begin + slack - time) / period)) - 1
    )


def without_idle_numbers(differences: dict[str, tuple]) -> dict[str, tuple]:
    """Result of `tick_differences` without numbers that affect only themselves, or that nothing else affects.

    Such as the filter of a derivative in a PI, or the integral of a P. The output of a control stays.
    """
    used = {}
    for key, (states, own) in differences.items():
        others = [by_number[key] for other, (_, by_number) in differences.items() if other != key]
        inner = own[key] - np.diag(np.diag(own[key]))
        effect = np.any(np.vstack([inner, *others]) != 0.0, axis=0)
        cause = np.any(
            np.hstack([states, inner, *(own[other] for other in own if other != key)]) != 0.0,
            axis=1,
        )
        used[key] = [j for j in range(states.shape[0]) if j == 0 or (effect[j] and cause[j])]
    return {
        key: (
            states[used[key]],
            {
                other: columns[np.ix_(used[key], used.get(other, range(columns.shape[1])))]
                for other, columns in by_number.items()
            },
        )
        for key, (states, by_number) in differences.items()
    }


def tick_differences(
    point: OperatingPoint, sampled: list[str], others: list[str]
) -> dict[str, tuple]:
    """Derivatives of the numbers of each sampled control at one of its samples.

    Result: name -> (matrix by the states, {name of a control: matrix by its numbers, or by its held output}). The
    compiled functions that take samples are evaluated at deviations of two sizes (Richardson).
    others : controls whose held outputs count too, such as delays
    """
    model = point.model
    names, controls = model.block_names, blocks_of(model).copy()
    rows = {name: controls[names.index(name)] for name in (*sampled, *others)}
    for name in sampled:
        controls["held"][names.index(name)] = np.nan
    model = with_blocks(model, controls)
    sizes = {
        name: control_rows_of(type(model.case.controls[name].control)).sampled_numbers(
            model.case.controls[name].control
        )
        for name in sampled
    }
    numbers = {
        name: int(rows[name]["memory"]) + np.r_[0, 2 + np.arange(sizes[name])] for name in sampled
    }

    def after(due: str, y: np.ndarray, discrete: np.ndarray, held: dict[str, float]) -> np.ndarray:
        table = controls.copy()
        for other, value in held.items():
            table["held"][names.index(other)] += value
        own = with_blocks(model, table)
        with own.run_data(point.armed) as data:
            own_numbers = numbers_of(data)
            own_numbers[:] = discrete
            for name in sampled:
                row = rows[name]
                count = (point.t - model.case.numerics.start - row["offset"]) / row["period"]
                own_numbers[int(row["memory"]) + 1] = count if name == due else count + 1e6
            _, out = data.evaluate(point.t, y, np.inf)
            out[rec.STATUS] = rec.ARRIVED
            own.functions.record(point.t, y, out, data.handle, np.zeros(len(model.tables.probes)))
            return own_numbers[numbers[due]].copy()

    y, base = point.y, point.discrete
    result = {}
    for due in sampled:
        quotients = partial(checked_slope, point, due)
        by_state = [
            quotients(partial(after_state, after, due, y, base, j), scale)
            for j, scale in enumerate(model.scale)
        ]
        state = np.array(by_state).reshape(-1, len(numbers[due])).T
        by_number = {}
        for name in sampled:
            columns = [
                quotients(
                    partial(after_number, after, due, y, base, place),
                    max(1.0, abs(float(base[place]))),
                )
                for place in numbers[name]
            ]
            by_number[name] = np.array(columns).T
        for name in others:
            size = max(1.0, abs(float(controls["held"][names.index(name)])))
            by_number[name] = quotients(partial(after_output, after, due, y, base, name), size)[
                :, None
            ]
        result[due] = state, by_number
    return result


def checked_slope(
    point: OperatingPoint, name: str, f: Callable[[float], np.ndarray], size: float
) -> np.ndarray:
    """Derivative at 0 of the numbers of a sampled control after a sample, by Richardson's differences.

    size : of a small deviation of the argument of f. Raises FvsolveError if the slopes for a rise and a fall differ.
    """
    widths, base = np.array(WIDTHS)[:, None] * size, f(0.0)
    rise, fall = (
        np.array([side * (f(side * w) - base) / w for w in widths[:, 0]]) for side in (1.0, -1.0)
    )
    sides, greatest = rise - fall, np.maximum(np.abs(rise), np.abs(fall))[1]
    kink = (np.abs(sides[1]) > KINK * greatest) & (
        np.abs(sides[1] - sides[0]) <= ALIKE * np.abs(sides[1])
    )
    if np.any(kink & (greatest * widths[1] > KINK_ROUNDING * np.abs(base) + LEAST_KINK)):
        stopped = outputs_at_limits(point)
        reason = f"; at a limit: {at_limits(point, stopped)}" if stopped else ""
        before = point.model.case.controls[name].blocks_passed
        kinks = f", its own or those of {listing(before)}, which it reads" if before else ""
        raise FvsolveError(
            f"controls.{name} cannot be linearised at {point.when}: the slopes of its sample for a rise "
            f"and a fall differ{kinks}{reason}; {ANOTHER_POINT}"
        )
    coarse, fine = 0.5 * (rise + fall)
    return (4.0 * fine - coarse) / 3.0


def after_state(
    after, due: str, y: np.ndarray, discrete: np.ndarray, j: int, h: float
) -> np.ndarray:
    """Result of `after` with a deviation h of state j."""
    return after(due, y + h * np.eye(1, y.size, j)[0], discrete, {})


def after_number(
    after, due: str, y: np.ndarray, discrete: np.ndarray, place: int, h: float
) -> np.ndarray:
    """Result of `after` with a deviation h of a number of a control."""
    return after(due, y, discrete + h * np.eye(1, discrete.size, place)[0], {})


def after_output(
    after, due: str, y: np.ndarray, discrete: np.ndarray, name: str, h: float
) -> np.ndarray:
    """Result of `after` with a deviation h of a held output."""
    return after(due, y, discrete, {name: h})
