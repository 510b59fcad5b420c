"""Operating points for linearisation (states with schedules held at their values), and matrices A and C there.

The matrices are found by finite differences that are checked.

Arguments of several functions : at, operating point; outputs, number of outputs; f, function of a vector x;
base : float64[m]  f(x); direction, change of x, for the states the small deviations `width` : float64[n] (scale of a
state, or its absolute value if that is greater); steps, factors on `direction`, largest first;
sides : float64[steps, p]  forward minus backward quotients of the matrix entries, column after column;
starts : int64[columns]  first entry of each column; size : float64[p]  size of the row of each entry
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fvsolve.core.assembly.schedule_tables import slope_at, value_at
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.ghost_cells import difference_rows
from fvsolve.core.kernels.schedule_pieces import POLYNOMIAL
from fvsolve.core.schemes import LIMITED, SCHEMES
from fvsolve.core.step_limits.symbol import symbol
from fvsolve.errors import FvsolveError
from fvsolve.features.controls.feature import blocks_of, numbers_of, with_blocks
from fvsolve.studies.outcome import outcome, study_model
from fvsolve.studies.resolution import as_cells, delay_lines

# relative error of a wave in cells that replace a delay line, for the frequency in the note
DELAY_ERROR = 0.01


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """State of a case about which it is linearised, and model with schedules held at their values.

    t : time at which schedules are held [s]; y : float64[n]  state, as deviations from the initial steady state
    when : description of this time, with the side of a kink or jump of a schedule
    armed : flags of events at this time, see `model.run_data.RunData`
    outputs : float64[blocks]  outputs of all controls at this time; those of delays and of sampled controls are held
    discrete : numbers of controls that change at events and samples only, at this time
    """

    model: object
    t: float
    y: np.ndarray
    when: str
    armed: np.ndarray | None = None
    outputs: np.ndarray | None = None
    discrete: np.ndarray | None = None

    @property
    def rate(self) -> np.ndarray:
        """Rate of change dy/dt of the state : float64[n]; zero at a steady state."""
        return self.model.evaluate(self.t, self.y)[0]


def operating_point(
    case, set=None, at: float | None = None, before: bool = False, probes=(), lines: bool = False
) -> OperatingPoint:
    """Operating point of a case at its start, or at the time `at` [s], to which the case is run.

    set : changed keys of the case; before : True to hold schedules at the values just before a kink or jump at this
    time, otherwise just after it
    probes : names of probes that are added before the probes of the case
    Delay lines are replaced by cells, unless `lines` is True and the point is the start. If the case gives no scheme
    and the default scheme is limited, it is replaced by the linear scheme that it equals in smooth solutions, or by
    `upwind` in a case with meshes. Raises CaseError for a case or probe that cannot be read, and FvsolveError for a
    case without states, for a time `at` before the start, and for a run that does not reach `at`.
    """
    from fvsolve.case import load

    case = load(case, dict(set or {}))
    delayed = [] if lines and at is None else delay_lines(case)
    if delayed:
        case = load(case, as_cells(delayed))
    if "scheme" not in case.raw["numerics"] and case.numerics.scheme in LIMITED:
        linear = "upwind" if case.meshes else SCHEMES[case.numerics.scheme].twin
        case = load(case, {"numerics.scheme": linear})
    names = list(dict.fromkeys([*probes, *(probe.text for probe in case.probes)]))
    end = case.numerics.end if at is None else max(case.numerics.end, float(at))
    model = study_model(case, {"output.probes": names, "numerics.end": end})
    if model.y_size == 0:
        remedy = "every pressure in it is given; add a pipe, tank or chamber"
        if not case.nodes:
            remedy = "add a control with a state, such as a transfer-function"
        raise FvsolveError(f"{case.name} has no state: {remedy}")
    t, y, armed, outputs, discrete = _state_at(model, at)
    sides = {time: jump for time, jump in model.breaks if time == t}
    side = "before" if before else "after"
    when = "the start" if at is None else f"t = {case.moment(t)}"
    when += f", just {side} a {'jump' if sides[t] else 'kink'} of a schedule" if t in sides else ""
    when += frequency_limit_note(model, delayed) if delayed else ""
    model = with_held_schedules(model, t, before)
    if len(controls := blocks_of(model)):
        controls = controls.copy()
        waits = (controls["delay"] > 0.0) | (controls["period"] > 0.0)
        controls["held"][waits] = outputs[waits]
        model = with_blocks(model, controls)
    return OperatingPoint(model, t, y, when, armed, outputs, discrete)


def frequency_limit_note(model, lines: list[str]) -> str:
    """Note with the frequency up to which cells in place of the delay lines `lines` are accurate.

    Up to this frequency, the error of a wave at the end of a line, relative to an exact delay, is at most 0.01.
    """
    theta = np.linspace(0.0, np.pi, 20001)[1:]
    error = np.abs(symbol(SCHEMES[model.case.numerics.scheme].weights, theta) + 1j * theta)
    rates = []
    for pipe, row in zip(model.pipes, model.tables.pipes, strict=True):
        if pipe.name in lines:
            accurate = theta[pipe.cells * error <= DELAY_ERROR]
            rates.append(
                (accurate.max() if accurate.size else 0.0)
                * row["speed"]
                / row["dx"]
                / (2.0 * np.pi)
            )
    return (
        f", delay lines as cells (error of waves at most {DELAY_ERROR:g} up to {min(rates):.3g} Hz)"
    )


def _state_at(
    model, at: float | None
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], state, event flags, outputs and discrete numbers of controls of a run at the time `at` [s].

    They are those of the start if `at` is None.
    """
    start, blocks = model.case.numerics.start, len(blocks_of(model))
    if at is None or at == start:
        with model.run_data() as data:
            data.evaluate(start, model.start, np.inf)
            applied, numbers = data.written.applied[:blocks].copy(), numbers_of(data).copy()
        return start, model.start.copy(), model.flags.copy(), applied, numbers
    if not start < at < np.inf:
        raise FvsolveError(
            f"at = {at:g} s is not a finite time after the start of the case, {start:g} s"
        )
    numerics = model.case.numerics.model_copy(update={"end": float(at)})
    run = outcome(replace(model, case=replace(model.case, numerics=numerics)))
    if not run.ok:
        raise FvsolveError(
            f"the run to t = {at:g} s, where the case is to be linearised, failed: {run.reason}"
        )
    data = run.run_data
    return (
        float(at),
        run.y,
        data.armed,
        data.written.applied[:blocks].copy(),
        numbers_of(data).copy(),
    )


def with_held_schedules(model, t: float, before: bool = False):
    """Model with all schedules of time, and values of features that vary by themselves, held at those at t [s].

    before : True for the values just before a kink or jump at t, otherwise just after it
    Schedules that drive motions continue with their rate of change at this time. Kinks and jumps are removed.
    In a model without a limited scheme, limited slopes and bounds of values that the flow carries are removed too.
    """
    tables = model.tables
    schedules, limit = tables.schedules.copy(), t if before else np.inf
    values = [value_at(tables, k, t, limit) for k in range(len(schedules))]
    rows = [[-np.inf, POLYNOMIAL, t, value, 0.0, 0.0, 0.0] for value in values]
    for k, record in enumerate(tables.schedules):
        if record["pieces"] != 0:  # it does not follow a block
            schedules[k] = (len(tables.pieces) + k, 1)
    for k in {k for feature in model.features for k in feature.driven()} - {-1}:
        rows[k][4] = slope_at(tables, k, t, limit)
    # the first ones contain formulas of blocks
    pieces = np.vstack([tables.pieces, np.array(rows).reshape(-1, 7)])
    tables = tables._replace(schedules=schedules, pieces=pieces)
    # limited slopes and bounds of values are kinks of the right-hand side, which has no derivative there
    smooth = not has_limiter(model)
    if smooth:
        settings = tables.settings.copy()
        settings["limiter"] = rec.FLAT
        tables = tables._replace(settings=settings)
    features = []
    for feature in model.features:
        own, replaced = feature.held(tables, t, smooth)
        features.append(own)
        tables = tables._replace(**replaced)
    return replace(model, tables=tables, features=features, breaks=[])


def with_weights(at: OperatingPoint, weights: tuple[float, ...], degree: int) -> OperatingPoint:
    """Operating point with another linear scheme.

    weights : weights of the cells around a face in the value at the face; degree : degree of the polynomials at pipe
    ends
    The stencil must not be wider than that of the scheme of `at`, whose Jacobian pattern is reused.
    """
    tables = at.model.tables._replace(settings=at.model.tables.settings.copy())
    settings = tables.settings[0]
    settings["scheme"], settings["degree"], settings["from_arriving"] = rec.LINEAR, degree, 0
    for k, weight in enumerate(weights):
        settings[f"w{k}"] = weight
    settings["inside"], settings["enter"], settings["leave"] = difference_rows(weights, degree)
    model = replace(at.model, tables=tables)
    model.__dict__["structure"] = at.model.structure
    return replace(at, model=model)


def has_limiter(model) -> bool:
    """True if a model uses a limited scheme, in pipes with cells or in meshes."""
    scheme = model.case.numerics.scheme
    for part in model.meshed:
        # meshes limit their slopes with all schemes except `upwind`, grids not with `upwind5` either
        if scheme != "upwind" and not (scheme == "upwind5" and part.is_grid):
            return True
    return model.cells > 0 and scheme in LIMITED


STEPS = 2.0 ** -np.arange(8.0, 25.0, 4.0)  # in units of the small deviation: 1/256 to 6e-8
# if those give no slope: down to 1.5e-11, for the laminar range of a valve
FINER_STEPS = 2.0 ** -np.arange(8.0, 37.0, 4.0)
# before STEPS, for an input with a range: laminar ranges end below
COARSE_STEPS = 2.0 ** -np.arange(2.0, 8.0, 2.0)
SLOPE_TOLERANCE = 1e-3  # relative difference of steps or sides above which there is no derivative
# of the size of a row, over the step: round-off of its slopes, with a safety factor of 1000
ROUNDING_SHARE = 1e-12
# of a row: least constant difference of both sides that is a kink; friction factors have 3e-6
HIDDEN_KINK = 1e-4
# change of a constant difference of both sides with the step; a smooth one loses 15/16
CONSTANT_SHARE = 0.25
# kink: sides differ by more than this times their change with the step; smooth ones by less
BEND_FACTOR = 4.0
DENSE = 1000  # greatest number of states for which A is a full array
C_TIME, MAX_ENTRIES = 20.0, 10_000_000  # time limit of C [s], greatest number of its entries
RATE_FLOOR = 1e-10  # of the greatest rate per deviation: smaller rows are round-off of sums
TRIAL_DIRECTIONS = 3  # random directions along which A is checked

Function = Callable[[np.ndarray], np.ndarray]


def two_sided_differences(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forward and backward difference quotients of f at x along `direction` : float64[steps, m] each."""
    forward = [(f(x + h * direction) - base) / h for h in steps]
    return np.array(forward), np.array([(base - f(x - h * direction)) / h for h in steps])


def central_differences(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray = STEPS
) -> tuple[np.ndarray, np.ndarray]:
    """Central difference quotient of f at x, and forward minus backward quotient : float64[steps, m] each."""
    forward, backward = two_sided_differences(f, x, direction, base, steps)
    return 0.5 * (forward + backward), forward - backward


def single_sided_differences(
    f: Function, x: np.ndarray, direction: np.ndarray, base: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """One-sided difference quotient of f at x along `direction`, returned twice: as forward and as backward quotient.

    It is (-3 f(x) + 4 f(x + h) - f(x + 2 h)) / 2 h, second order in the step h : float64[steps, m].
    """
    slopes = [
        (4.0 * (f(x + h * direction) - base) - (f(x + 2.0 * h * direction) - base)) / (2.0 * h)
        for h in steps
    ]
    return np.array(slopes), np.array(slopes)


def longest_step_slopes(
    forward: np.ndarray, backward: np.ndarray, size: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivative, error and kink of each entry of f : float64[m] each, from the longest steps with a clear result.

    size : float64[m]  size of each entry of f, from which the round-off of its quotients is estimated
    The derivative is taken at the longest steps at which forward and backward quotients agree and change little with
    the step. The error is the change with the step, relative to the quotient. If there are no such steps, the error is
    relative to the greatest quotient, so that a quotient that falls to zero with the step counts as zero.
    The kink is the difference of forward and backward quotients where it does not fall with the step, relative to the
    greatest quotient; 0 if they agree at some step. Laws smooth such a kink over a range below these steps.
    """
    slopes, magnitude = 0.5 * (forward + backward), np.maximum(np.abs(forward), np.abs(backward))
    clear = magnitude[1:] > ROUNDING_SHARE * size / steps[1:, None]
    change, sides = np.abs(np.diff(slopes, axis=0)), np.abs(forward - backward)[1:]
    peak = above_zero(magnitude.max(axis=0))
    good = clear & (np.maximum(change, sides) <= SLOPE_TOLERANCE * magnitude[1:])
    started = np.maximum.accumulate(good, axis=0)
    stretch = good & ~np.maximum.accumulate(started & ~good, axis=0)
    none = ~started[-1]
    errors = np.where(
        none, change / peak, np.where(stretch, change / above_zero(magnitude[1:]), np.inf)
    )
    errors = np.nan_to_num(errors, nan=np.inf)
    best, entries = np.argmin(errors, axis=0), np.arange(size.size)
    side_change = np.maximum(np.abs(np.diff(forward, axis=0)), np.abs(np.diff(backward, axis=0)))
    kink = np.where(clear & none, sides - BEND_FACTOR * side_change, 0.0)
    return slopes[best + 1, entries], errors[best, entries], np.max(kink, axis=0) / peak


def above_zero(x: np.ndarray) -> np.ndarray:
    """Array x with 1 in place of values that are not positive."""
    return np.where(x > 0.0, x, 1.0)


def best_slopes(
    slopes: np.ndarray, size: np.ndarray, starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivative of each matrix entry : float64[p], and error of each column : float64[columns], relative to `size`.

    They come from the two consecutive steps that agree best for the column.
    slopes : float64[steps, p]  difference quotients of the entries, column after column
    """
    if slopes.shape[1] == 0:
        return slopes[0], np.zeros(0)
    changes = np.nan_to_num(np.abs(np.diff(slopes, axis=0)) / size, nan=np.inf)
    worst = np.maximum.reduceat(changes, starts, axis=1)
    best = np.argmin(worst, axis=0)
    lengths = np.diff(np.append(starts, slopes.shape[1]))
    values = slopes[np.repeat(best, lengths) + 1, np.arange(slopes.shape[1])]
    return values, worst[best, np.arange(starts.size)]


def side_differences(sides: np.ndarray, size: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Difference of forward and backward quotients of each column, relative to `size` : float64[columns].

    It is the greatest difference over the entries of a column, at the step where this is least.
    """
    if sides.shape[1] == 0:
        return np.zeros(0)
    return np.min(np.maximum.reduceat(np.abs(sides) / size, starts, axis=1), axis=0)


def hidden_kinks(
    sides: np.ndarray, size: np.ndarray, rounding: np.ndarray, starts: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """True for each column with a kink : bool[columns].

    A column has a kink if the difference of forward and backward quotients of an entry is constant over three steps and
    above 1e-4 of the size of its row. The difference of a smooth function falls with the step.
    size : float64[p]  size of the row over the longest step, which does not resolve the steep laminar range of a valve
    at zero pressure drop; rounding : float64[p]  size of the row, from which the round-off of the entry is estimated
    """
    if sides.shape[1] == 0:
        return np.zeros(0, dtype=bool)
    constant = np.abs(np.diff(sides, axis=0)) <= CONSTANT_SHARE * np.abs(sides[1:])
    clear = np.abs(sides[2:]) > np.maximum(
        HIDDEN_KINK * size, ROUNDING_SHARE * rounding / steps[2:, None]
    )
    return np.logical_or.reduceat(np.any(constant[:-1] & constant[1:] & clear, axis=0), starts)


def responses(at: OperatingPoint, y: np.ndarray, outputs: int) -> np.ndarray:
    """Rates dy/dt and the values of the first `outputs` probes at the state y : float64[n + outputs].

    Raises FvsolveError if the rates cannot be computed.
    """
    model, t = at.model, float(at.t)
    with model.run_data(at.armed) as data:
        dydt, out = data.evaluate(t, y, np.inf)
        values = data.observe(t, y, out)[:outputs] if outputs else np.zeros(0)
    if out[rec.STATUS] != rec.OK or not np.all(np.isfinite(dydt)):
        place = f" at {model.node_names[int(out[rec.WHERE])]}" if out[rec.WHERE] >= 0 else ""
        raise FvsolveError(
            f"the state cannot be linearised: its rates cannot be computed{place}, for example because every path to "
            "a demand is closed; choose another time with --at"
        )
    return np.concatenate([dydt, values])


def state_matrix(at: OperatingPoint) -> tuple[Any, np.ndarray, float, np.ndarray]:
    """(A, size of each of its rows : float64[n], error, steps), where steps are the factors on the small deviations.

    The size of row i is the sum over j of |A_ij| times the small deviation of state j; the error is relative to it.
    A is a full array, or a sparse scipy array for more than 1000 states. States whose columns have no row in common
    (equal colours) are changed together. Raises FvsolveError for a state without a derivative.
    """
    from scipy.sparse import csc_array

    model = at.model
    n = at.model.y_size
    width = np.maximum(at.model.scale, np.abs(at.y))
    pattern = model.structure.pattern[:n].tocsc()
    pattern.sort_indices()
    rows, starts = pattern.indices, pattern.indptr[:-1]
    columns = np.repeat(np.arange(n), np.diff(pattern.indptr))
    meshed = tuple(f"{part.name}." for part in model.meshed)
    in_meshes = np.array([name.startswith(meshed) for name in model.state_names])
    for steps in (STEPS, FINER_STEPS):
        slopes, sides = matrix_entries(at, width, rows, columns, steps)
        size = np.bincount(rows, np.abs(slopes[len(steps) // 2]), n)
        size = np.maximum(size, RATE_FLOOR * width * np.max(size / width, initial=0.0))
        row_size = np.where(size > 0.0, size, 1.0)[rows]
        values, errors = best_slopes(slopes, row_size, starts)
        coarse = np.bincount(rows, np.abs(slopes[0]), n)[rows]
        hidden = hidden_kinks(sides, coarse, row_size, starts, steps)
        hidden &= ~in_meshes  # fluxes of water at rest have kinks of about 1e-4 of a row
        kink = side_differences(sides, row_size, starts) + hidden
        if max(np.max(errors), np.max(kink)) <= SLOPE_TOLERANCE:
            break
    else:
        cause = "slope" if np.max(errors) > SLOPE_TOLERANCE else "kink"
        refuse_state(model, int(np.argmax(errors if cause == "slope" else kink)), cause)
    a = csc_array((values / width[columns], rows, pattern.indptr), shape=(n, n))
    check_directions(at, a, width, size, steps)
    return (a if n > DENSE else a.toarray()), size, float(np.max(errors)), steps


def matrix_entries(
    at: OperatingPoint, width, rows, columns, steps
) -> tuple[np.ndarray, np.ndarray]:
    """Central difference quotients of matrix entries, and forward minus backward ones : float64[steps, entries] each.

    They are changes of a rate per small deviation of a state.
    rows, columns : int64[entries]  rows and columns of the entries in A
    """
    structure = at.model.structure
    slopes = []
    sides = []
    base = responses(at, at.y, 0)
    for color in range(structure.color_count):
        direction = np.where(structure.colors == color, width, 0.0)
        slope, side = central_differences(
            lambda y: responses(at, y, 0), at.y, direction, base, steps
        )
        slopes.append(slope)
        sides.append(side)
    picked = (slice(None), structure.colors[columns], rows)
    return np.array(slopes).transpose(1, 0, 2)[picked], np.array(sides).transpose(1, 0, 2)[picked]


def refuse_state(model, j: int, cause: str) -> None:
    """Raise FvsolveError, as the rates have no derivative along state number j.

    cause : "slope" if difference quotients do not converge, "kink" if they differ from side to side
    """
    basin = next(
        (part for part in model.meshed if model.state_names[j].startswith(f"{part.name}.")), None
    )
    if basin is not None:
        cause = "basin"
    reason = {
        "basin": "fluxes of this basin have a kink near its state (equal wave speeds from both sides, or cells that "
        "run dry); choose another time with --at",
        "slope": "the slopes there do not converge, as for a valve with a pressure drop of zero: give the valve the "
        "key `laminar_reynolds`, or linearise at a time with flow (--at)",
        "kink": "the slopes for a rise and a fall of this state differ (a tank dry or full, an end stop or seat just "
        "touched); choose another time with --at",
    }[cause]
    raise FvsolveError(f"the state cannot be linearised along {model.state_names[j]}: {reason}")


def check_directions(
    at: OperatingPoint, a, width: np.ndarray, size: np.ndarray, steps: np.ndarray
) -> None:
    """Check A (size : sizes of its rows) along random directions; raises FvsolveError if rates are not linear there."""
    model, rng = at.model, np.random.default_rng(1)
    base = responses(at, at.y, 0)
    for _ in range(TRIAL_DIRECTIONS):
        direction = width * rng.choice([-1.0, 1.0], width.size)
        slope, _ = central_differences(lambda y: responses(at, y, 0), at.y, direction, base, steps)
        error = np.abs(slope - a @ direction) / np.where(size > 0.0, size, 1.0)
        worst = np.min(error, axis=0)
        if np.max(worst) > SLOPE_TOLERANCE:
            where = model.state_names[int(np.argmax(worst))]
            raise FvsolveError(
                f"the state cannot be linearised: the rate of {where} is not a linear function of "
                "combined small deviations; choose another time with --at"
            )


def output_matrix(at: OperatingPoint, outputs: int, steps: np.ndarray) -> tuple[np.ndarray, float]:
    """Matrix C : float64[outputs, n], and its error, by differences along each state on which an output depends.

    Raises FvsolveError for an output without a derivative, and if C is too large or takes too long.
    """
    n, width = at.model.y_size, np.maximum(at.model.scale, np.abs(at.y))
    if outputs == 0:
        return np.zeros((0, n)), 0.0
    if n * outputs > MAX_ENTRIES:
        raise too_large(n, outputs)
    latest, base = time.monotonic() + C_TIME, responses(at, at.y, outputs)
    slopes, sides = np.zeros((2, len(steps), n, outputs))
    for j in visible_states(at, outputs, base[n:], width):
        if time.monotonic() > latest:
            raise too_large(n, outputs)
        direction = np.zeros(n)
        direction[j] = width[j]
        differences = central_differences(
            lambda y: responses(at, y, outputs), at.y, direction, base, steps
        )
        slopes[:, j], sides[:, j] = (part[:, n:] for part in differences)
    size = np.sum(np.abs(slopes[len(steps) // 2]), axis=0)
    size = np.maximum(size, ROUNDING_SHARE / steps[0] * np.abs(base[n:]))
    row_size = np.tile(np.where(size > 0.0, size, 1.0), n)
    # Each entry has its own step: for a valve, the step of a hose has too much round-off.
    starts = np.arange(n * outputs)
    values, errors = best_slopes(slopes.reshape(len(steps), -1), row_size, starts)
    kink = np.maximum(side_differences(sides.reshape(len(steps), -1), row_size, starts), errors)
    if np.max(kink) > SLOPE_TOLERANCE:
        j, k = divmod(int(np.argmax(kink)), outputs)
        raise FvsolveError(
            f"{at.model.case.probes[k].text} cannot be linearised along {at.model.state_names[j]}: its "
            "slopes for a rise and a fall of this state differ, or depend on the size of the small "
            "deviation; leave this probe out of --outputs, or choose another time with "
            "--at"
        )
    return values.reshape(n, outputs).T / width, float(np.max(errors))


def too_large(n: int, outputs: int) -> FvsolveError:
    """Error for a matrix C that is too large or takes too long."""
    return FvsolveError(
        f"C of {n} states and {outputs} outputs is too large, or takes longer than {C_TIME:g} s: use "
        "fewer --outputs, or give pipes or basins fewer cells, --set links.NAME.cells=100 or "
        "nodes.NAME.cells=[20,20]"
    )


def visible_states(
    at: OperatingPoint, outputs: int, base: np.ndarray, width: np.ndarray
) -> Iterator[int]:
    """Yield the numbers of the states that change an output, by bisection; base : float64[outputs]  their values."""
    rng, n = np.random.default_rng(2), width.size
    direction = rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n) * width * STEPS[0]
    ranges = [(0, n)]
    while ranges:
        low, high = ranges.pop()
        deviation = np.zeros(n)
        deviation[low:high] = direction[low:high]
        ends = (responses(at, at.y + sign * deviation, outputs)[n:] for sign in (1.0, -1.0))
        if all(np.array_equal(end, base) for end in ends):
            continue
        if high - low == 1:
            yield low
        else:
            middle = (low + high) // 2
            ranges += [(middle, high), (low, middle)]
