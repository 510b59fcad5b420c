"""Loop of a control: return ratio, margins, stability, poles, and range of the gain in which it is stable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from fvsolve.argument_checks import FUNCTION, NUMBER, TABLE, TEXT, validated
from fvsolve.core.output.result_table import PlainData, plain
from fvsolve.declarations import declared
from fvsolve.studies.loops.delay_system import EIGENVALUE_OPERATIONS, DelaySystem, sorted_poles
from fvsolve.studies.loops.margins import Margins, find_margins
from fvsolve.studies.loops.open_loop import block_of, open_loop, open_loop_error
from fvsolve.studies.loops.sampled import STABLE, SampledLoop, gain_within, nearest_range
from fvsolve.studies.outcome import Progress
from fvsolve.studies.work_limit import DENSE_RATE

PER_DECADE = 200  # frequencies of the table
DECADES = 3.0  # below the slowest and above the fastest rate
PER_TURN = 40  # frequencies in each turn of the phase by the longest delay
MOST_TURNS = 500  # of a delay
SMALL = 1e-4  # of |L|: turns of a delay end where |L| stays below
MOST_POLES = 24  # of a loop with delays
MOST_DECADES = 9  # added at both ends, where |L| is 1 beyond the rates
# of the table of a sampled loop: lowest frequency, relative to that of half a period; logarithmic and linear points
LOWEST, LOW_POINTS, LINEAR_POINTS = 1e-9, 1800, 800


@declared("study")
@dataclass(frozen=True, eq=False)
class Loop(PlainData):
    """Result of `loop`; arrays in SI.

    case, control, when : case, control at whose output the loop is cut, state about which it is linearised
    stable : True if the closed loop is stable; margins : see `Margins`
    gain_range : least and greatest factor on L between which the closed loop is stable, None for an open end
    delays : delays of controls and of delay lines [s]; period : time between samples [s], None for a continuous loop
    poles : poles of the closed loop, of a sampled loop the eigenvalues z over a period
    frequency : float64[k] [rad/s]; ratio : complex128[k]  return ratio L; 1 + L = 0 is the closed loop
    system : open loop, a `DelaySystem` or a `SampledLoop`; moving : greatest rate of a state over its scale [1/s]
    """

    case: str
    control: str
    when: str
    stable: bool | None
    margins: Margins
    gain_range: tuple[float | None, float | None]
    delays: tuple[float, ...]
    period: float | None
    poles: np.ndarray
    frequency: np.ndarray
    ratio: np.ndarray
    system: DelaySystem | SampledLoop
    moving: float

    def plain(self) -> dict:
        """Values for JSON; poles as [re, im]."""
        own = {name: plain(getattr(self, name)) for name in ("case", "control", "when", "stable")}
        own |= {field.name: plain(getattr(self.margins, field.name)) for field in fields(Margins)}
        return own | {
            "gain_range": list(self.gain_range),
            "delays": list(self.delays),
            "period": self.period,
            "poles": [[float(s.real), float(s.imag)] for s in self.poles],
            "frequency": plain(self.frequency),
            "real": plain(self.ratio.real),
            "imaginary": plain(self.ratio.imag),
            "moving": self.moving,
        }


STAGES = 4  # of a study, for `progress`


@declared("study")
@validated(name=TEXT, at=NUMBER, set=TABLE, progress=FUNCTION)
def loop(
    case,
    name: str,
    at: float | None = None,
    set: Mapping | None = None,
    progress: Progress | None = None,
) -> Loop:
    """Study the loop of a control of a case, linearised at its start or at the time `at` [s].

    The loop is cut at the output of the control; L(s) is its return ratio, and 1 + L(s) = 0 the closed loop.
    set : changed keys of the case; progress : function of (stages done, stages in total, next stage)
    Raises CaseError, and FvsolveError for an unknown control, a control without slope or at a limit, a loop that is
    open, a state that cannot be linearised, more than 800 states, and a study that takes too long.
    """
    from fvsolve.case import load

    case, report = load(case, dict(set or {})), progress or (lambda *_: None)
    name = block_of(case, name)
    report(0, STAGES, "state and linear system")
    if any(block.control.period is not None for block in case.controls.values()):
        return sampled_loop(case, name, at, report)
    system, point = open_loop(case, name, at)
    ratio = ReturnRatio(system)
    report(1, STAGES, f"return ratio of {len(system.a)} states and {system.delays.size} delays")
    w = frequencies(system, ratio)
    at_zero = value_at_zero(system)
    margins, gains = find_margins(ratio, w, {} if at_zero is None else {0.0: complex(at_zero)})
    if not np.any(ratio(w)):
        raise open_loop_error(point, name)
    gain_range, stable = stable_gains(system, gains, report)
    report(3, STAGES, "poles")
    closed = system.closed()
    return Loop(
        case.name,
        name,
        point.when,
        stable,
        margins,
        gain_range,
        tuple(system.delays.tolist()),
        None,
        closed.poles(MOST_POLES),
        w,
        ratio(w),
        system,
        float(np.max(np.abs(point.rate) / point.model.scale)),
    )


def sampled_loop(case, name: str, at: float | None, report: Progress) -> Loop:
    """Study as `loop` for a case with sampled controls, by the map over their common period.

    There are margins if the control is sampled once in this period; the range of the gain is found in every case.
    """
    sampled = SampledLoop(case, name, at)
    report(1, STAGES, f"return ratio of {sampled.size} numbers and {len(sampled.events)} events")
    w = np.zeros(0)
    values = np.zeros(0, complex)
    gains = np.zeros(0)
    margins = Margins(*[None] * len(fields(Margins)))
    if sampled.acts_once:
        fastest = np.pi / sampled.period
        parts = [
            np.geomspace(LOWEST * fastest, fastest, LOW_POINTS),
            np.linspace(0.0, fastest, LINEAR_POINTS),
        ]
        w = np.unique(np.concatenate(parts))[1:-1]  # without both ends
        ends = {
            at: value
            for at, value in zip((0.0, fastest), sampled.real_ends(), strict=True)
            if value is not None
        }
        margins, gains = find_margins(sampled.ratio, w, ends)
        values = sampled.ratio(w)
        if not np.any(values):
            raise open_loop_error(sampled.point, name)
    elif np.array_equal(sampled.matrix(1.0), sampled.matrix(2.0)):
        raise open_loop_error(sampled.point, name)
    report(2, STAGES, "range of the gain")
    poles = sorted_poles(np.linalg.eigvals(sampled.closed_matrix(1.0)).astype(complex))
    poles = poles[np.argsort(-np.abs(poles), kind="stable")]
    point = sampled.point
    return Loop(
        case.name,
        name,
        point.when,
        sampled.radius(1.0) < 1.0 - STABLE,
        margins,
        sampled.gain_range(gains),
        tuple(sampled.delays.values()),
        sampled.period,
        poles,
        w,
        values,
        sampled,
        float(np.max(np.abs(point.rate) / point.model.scale)),
    )


@dataclass(frozen=True)
class ReturnRatio:
    """Return ratio L(j w) = -v / u of an open loop from the held output u to the computed output v."""

    system: DelaySystem

    def __call__(self, w: np.ndarray) -> np.ndarray:
        return -self.system.response(1j * np.asarray(w, float))[:, 0, 0]


def frequencies(system: DelaySystem, ratio: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Frequencies of the table [rad/s]: logarithmic, at resonances, and dense where a delay turns the phase."""
    low, high = system.slowest * 10.0**-DECADES, system.fastest * 10.0**DECADES
    size = lambda w: float(np.abs(ratio(np.array([w])))[0])  # noqa: E731
    for _ in range(MOST_DECADES):  # until |L| is 1 on the way
        low /= 10.0 if size(low) < 1.0 < size(low * 10.0**-MOST_DECADES) else 1.0
        high *= 10.0 if size(high) > 1.0 > size(high * 10.0**MOST_DECADES) else 1.0
    grid = np.geomspace(low, high, int(PER_DECADE * np.log10(high / low)) + 1)
    resonances = np.abs(system.rates.imag)
    parts = [grid, resonances[(low < resonances) & (resonances < high)]]
    if system.delays.size:
        longest = float(system.delays.sum())
        large = grid[np.abs(ratio(grid)) > SMALL]
        last = min(float(large.max(initial=low)), MOST_TURNS * 2.0 * np.pi / longest)
        parts.append(
            np.arange(1, int(PER_TURN * last * longest / (2.0 * np.pi)) + 2)
            * 2.0
            * np.pi
            / longest
            / PER_TURN
        )
    return np.unique(np.concatenate(parts))


def stable_gains(
    system: DelaySystem, gains: np.ndarray, report: Progress
) -> tuple[tuple[float | None, float | None], bool | None]:
    """((least, greatest factor on L of a stable closed loop), True if it is stable with the factor 1).

    The number of unstable poles changes only at the gains 1 / |L| where L is real and negative, at any frequency. If
    the loop is not stable, the range is the nearest one that is; both ends are None without one.
    gains : these factors at frequencies above 0
    """
    limits = [0.0, *sorted({*map(float, gains), *ends(system)}), np.inf]
    own = False if 1.0 in limits else is_stable_at(system, 1.0)

    def stable(low: float, high: float) -> bool:
        gain = gain_within(low, high)
        report(
            2,
            STAGES,
            f"stability with {gain:.4g} times the gain, one of up to {len(limits) - 1} ranges",
        )
        return bool(is_stable_at(system, gain))

    return nearest_range(limits, stable, distance), own


def distance(low: float, high: float) -> float:
    """Distance of an interval of gains from 1, as a factor, in logarithms."""
    return min(abs(np.log(max(low, 1e-300))), abs(np.log(max(min(high, 1e300), 1e-300))))


def ends(system: DelaySystem) -> list[float]:
    """Gains 1 / |L| at the frequency 0 and at infinity, where L is real and negative and finite."""
    values = [value_at_zero(system) or 0.0]
    if not system.delays.size:
        values.append(-system.d[0, 0])
    return [float(-1.0 / value) for value in values if value < 0.0]


def value_at_zero(system: DelaySystem) -> float | None:
    """L at the frequency 0; None with a pole there."""
    slow = 1e-6 * system.slowest
    near, nearer, zero = -system.response(np.array([slow + 0j, 0.5 * slow + 0j, 0j]))[:, 0, 0].real
    return None if abs(nearer) > 1.5 * abs(near) or not np.isfinite(zero) else float(zero)


def is_stable_at(system: DelaySystem, gain: float) -> bool | None:
    """True if the closed loop is stable with a factor `gain` on L; None if it is undecided."""
    count = system.closed(gain).unstable_count()
    return None if count is None else count == 0


LOCUS_GAINS, LEAST_GAINS = 161, 9  # gains of the root locus, and least number of a locus
LOCUS_TIME = 2.0  # estimated CPU time of a locus, which has fewer gains if it takes longer [s]
LOCUS_RANGE = 30.0  # least and greatest gain of the root locus, as factors on 1
STEP_POINTS, STEP_PERIODS = 1500, 60  # of a step response, continuous and sampled


def locus(result: Loop) -> tuple[np.ndarray, list[np.ndarray]]:
    """(factors on L, poles of the closed loop for each) for a root locus; no poles with too many delays."""
    system = result.system
    sampled = result.period is not None
    size = system.size if sampled else system.collocated_size
    each = EIGENVALUE_OPERATIONS * max(size, 1) ** 3 / DENSE_RATE
    count = int(np.clip(LOCUS_TIME / each, LEAST_GAINS, LOCUS_GAINS))
    gains = np.geomspace(1.0 / LOCUS_RANGE, LOCUS_RANGE, count)
    if sampled:
        return gains, [np.linalg.eigvals(system.closed_matrix(float(gain))) for gain in gains]
    return gains, [system.closed(float(gain)).collocated_poles() for gain in gains]


def step_response(result: Loop) -> tuple[np.ndarray, np.ndarray]:
    """(times [s], response of L / (1 + L) to a step of 1 at the time 0) of a loop with a return ratio."""
    system = result.system
    if result.period is not None:
        return system.step_response(STEP_PERIODS)
    slow = np.abs(result.poles.real)
    rates = slow[slow > 1e-9 * system.fastest]
    span = 6.0 / float(rates.min(initial=np.inf)) if rates.size else 100.0 / system.slowest
    if result.margins.gain_crossover is not None:
        span = min(span, 60.0 / result.margins.gain_crossover)
    # u = e = r - y, y = L e = -v, so u = (r + v of the states and delays) / (1 - D)
    m, n = system.inputs, system.a.shape[0]
    share = 1.0 / (1.0 - float(system.d[0, 0]))
    back = share * np.hstack([system.c[:1], system.d[:1, m:]])
    a, b = system.a + system.b[:, :1] @ back[:, :n], system.b.copy()
    b[:, m:] += system.b[:, :1] @ back[:, n:]
    b[:, :1] *= share
    c, d = system.c + system.d[:, :1] @ back[:, :n], system.d.copy()
    d[:, m:] += system.d[:, :1] @ back[:, n:]
    d[:, :1] *= share
    times = np.linspace(0.0, span, STEP_POINTS)
    return times, -replace(system, a=a, b=b, c=c, d=d).step_response(times)[:, 0]
