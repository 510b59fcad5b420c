"""Notices for the pipes, meshes and modes of a model whose step exceeds the limit of scheme and method.

For linear schemes with a constant wave speed the limit is proved: von Neumann's limit. Other limits are estimates: a
limited scheme is treated as its linear scheme in smooth flow, and a variable wave speed as the fastest wave. The limit
of a pipe of few cells, which its ends reduce, is an estimate too; there the notice depends on the growth in the run,
computed with the reflection factors of the pipe's ends.
"""

import math
from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.run_data import RunData
from fvsolve.core.model.step_division import step_at_start
from fvsolve.core.schemes import LEAST_CELLS, SCHEMES
from fvsolve.core.step_limits.greatest_step import growth_factor
from fvsolve.core.step_limits.grid_limits import (
    GROWTH,
    LONG,
    is_stable_with_margin,
    pipe_growth,
    pipe_limit,
    plane_limit,
)
from fvsolve.core.step_limits.growing_modes import (
    LEAST_GROWTH,
    Mode,
    lumped_modes,
    undamped_notices,
)
from fvsolve.core.step_limits.symbol import weights_of
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.tableau import method_named
from fvsolve.errors import FvsolveError, Notice

SLACK = 1e-9  # relative excess over the limit that rounding may cause
# relative excess over an estimated limit up to which a step is doubtful, and above which it is wrong
EXCESS = 0.05
# Growth in a run from which waves that grow at every Courant number give a notice: Euler's errors are 2 % there.
ALWAYS_GROWING = 5.0
SINGLE_GROWTH = 0.1  # growth in a single step, minus 1, from which few steps are checked too
# growth of cells from which numbers are wrong if no schedule jumps: then deviations are small at first
SMOOTH_GROWTH = 1e6
# Mean error of a state outside cells, relative to its range: no error, doubtful, wrong.
NO_ERROR, DOUBTFUL, WRONG = 1e-9, 0.005, 0.05
# WRONG of steps that exceed a limit, whose errors grow from check to check
WRONG_BEYOND_LIMIT = 0.02
# Quotient of the limits of a pipe without ends and of a pipe of 40 cells, at most, for all schemes and methods.
END_MARGIN = 1.08
# cells of a longer pipe for which modes are computed; its ends reduce the limit less
MOST_CELLS = 160
# EXCESS for limiters between few cells, which are stable up to this excess (tests/step_limits/test_ends.py)
LIMITED_EXCESS = 0.3


class CourantCheck(NamedTuple):
    """Comparison of the Courant number of a pipe or a mesh with its limit, both defined as in `numerics.courant`.

    place : key path of the part; proved : True if the limit is proved; location : kind of grid, for the text
    courant : Courant number of the longest step that the run takes; share : that step over the given step, which may be
    longer than the run or than the time to the next break of a schedule
    """

    place: str
    courant: float
    limit: float
    scheme: str  # scheme of the limit
    proved: bool
    location: str
    # relative excess over an estimate above which the numbers are wrong
    allowed_excess: float = EXCESS
    growth: float = math.inf  # growth factor in the run, where growth decides
    share: float = 1.0
    # growth factor with the worst reflections at the ends of a short pipe
    worst_growth: float = math.inf


class Steps(NamedTuple):
    """Steps of a run between the breaks of its schedules, for a given length.

    given : given step, or the first step under a given Courant number [s]; 0 if it is unknown
    longest : longest step that the run takes [s]; count : number of steps
    """

    given: float
    longest: float
    count: float

    @property
    def share(self) -> float:
        """Longest step over the given step."""
        return self.longest / self.given if self.given > 0.0 else 1.0


def steps_of(model, given: float) -> Steps:
    """Steps of a run with a given step [s], each at most as long as the time to the next break."""
    numerics = model.case.numerics
    inside = [t for t, _ in model.breaks if numerics.start < t < numerics.end]
    lengths = np.diff([numerics.start, *inside, numerics.end])
    if not given > 0.0:
        return Steps(0.0, 0.0, 1.0)
    count = np.ceil(lengths / given * (1.0 - SLACK)).sum()
    return Steps(given, min(given, float(lengths.max())), max(1.0, float(count)))


def step_limits(
    model,
    rates: dict[str, float] | None = None,
    step_error: float | None = None,
    run_data: RunData | None = None,
    cell_error: float | None = None,
) -> list[Notice]:
    """Notices for the worst pipe, the meshes, delay lines and other modes for which the step exceeds the limit.

    rates : greatest wave rate of each part in the run so far, by name [1/s]; default: the initial rates
    step_error : greatest mean error of a state outside cells, relative to its range (`solve.run_checks`); None before a
    run; cell_error : the same of a state in cells, measured if the step exceeds a limit of cells
    run_data : data of a run, used for the initial rates as in `first_step`
    The list is empty under error control. For implicit methods it contains only the notice on delay lines.
    """
    numerics = model.case.numerics
    method = method_named(automatic.first_method(numerics.method))
    if numerics.rtol is not None:
        return []
    lines: list[Notice] = []
    for feature in model.features:
        lines += feature.step_notices(model, method)
    if not method.explicit:
        return lines
    try:
        steps = steps_of(model, first_step(model, run_data))
        exceeded = exceeded_checks(model, method.name, rates or {}, steps)
        h = steps.longest
        modes = lumped_modes(model, method.name, h, steps.count) if h > 0.0 else []
        growing = undamped_notices(model, method.name, h, span(model)) if h > 0.0 else []
    except FvsolveError:  # a method without a stability function
        return lines
    wrong = cell_error is not None and cell_error >= WRONG_BEYOND_LIMIT
    noticed = [
        check
        for check in exceeded
        if wrong or check.worst_growth >= LEAST_GROWTH or check.limit == 0.0
    ]
    notices = [courant_notice(model, check, method.name, wrong) for check in noticed]
    jumps = any(jump for _, jump in model.breaks)
    for mode in modes:
        # modes of cells that come with waves have a notice already
        if mode.outside_cells or not exceeded:
            notices.append(mode_notice(model.case, h, mode, method.name, step_error, jumps))
    return notices + growing + lines


def exceeded_checks(
    model, method: str, rates: dict[str, float], steps: Steps
) -> list[CourantCheck]:
    """Checks of pipes and meshes in which the longest step of a run exceeds the limit, whether or not waves grow much.

    method : name of an explicit method; rates : as for `step_limits`; steps : steps of the run
    """
    checks = [*pipe_checks(model, method, steps), *mesh_checks(model, method, rates, steps)]
    return [check for check in checks if check.courant > check.limit * (1.0 + SLACK)]


def exceeds_limit_of_cells(model) -> bool:
    """True if the steps of a run, without error control, exceed a limit of pipes or meshes at the start."""
    method = method_named(automatic.first_method(model.case.numerics.method))
    numerics = model.case.numerics
    if numerics.rtol is not None or not method.explicit:
        return False
    key = exceeds_limit_of_cells
    if key not in model.computed:
        try:
            model.computed[key] = bool(
                exceeded_checks(model, method.name, {}, steps_of(model, first_step(model)))
            )
        except FvsolveError:  # a method without a stability function
            model.computed[key] = False
    return model.computed[key]


def initial_step_limits(model, run_data: RunData) -> list[Notice]:
    """Notices of `step_limits` before a run, which a model keeps for its next runs."""
    key = initial_step_limits
    if key not in model.computed:
        model.computed[key] = step_limits(model, run_data=run_data)
    return model.computed[key]


def first_step(model, run_data: RunData | None = None) -> float:
    """Given step of a run, or its first step under a given Courant number [s]; 0 if the step is unknown.

    run_data : data of a run, or None. In a model without meshes they are used to compute the initial rates, and reset
    afterwards; otherwise new data are used.
    """
    numerics = model.case.numerics
    if numerics.step is not None:
        return given_step(model)
    if run_data is None or model.meshed:  # meshes change more of the run data than flags
        rate = float(model.evaluate(numerics.start, model.start)[1][rec.RATE])
    else:
        rate = float(run_data.evaluate(numerics.start, model.start, math.inf)[1][rec.RATE])
        run_data.reset()
    return numerics.courant / rate if rate > 0.0 else 0.0


def given_step(model) -> float:
    """Given step of a run [s], or the step that follows from the Courant number and the initial wave rate.

    An explicit method may divide a given step, see `dividing_rate`.
    """
    numerics = model.case.numerics
    return step_at_start(model) if numerics.step is not None else numerics.courant / model.wave_rate


def mode_notice(
    case, h: float, mode: Mode, method: str, step_error: float | None, jumps: bool
) -> Notice:
    """Notice for a mode that grows with steps of h [s].

    mode : from `lumped_modes`; method : name of the method
    step_error : measured mean error of a state after a run, relative to its range; None before a run
    jumps : True if a schedule has a jump
    """
    numerics = case.numerics
    seen = step_error is None or not mode.outside_cells or step_error >= WRONG
    seen = seen or (mode.resolved and step_error > NO_ERROR)
    enough = LEAST_GROWTH**2
    if mode.outside_cells and mode.resolved:
        enough = LEAST_GROWTH
    elif not mode.outside_cells and not jumps:
        enough = SMOOTH_GROWTH
    wrong = seen and mode.growth >= enough
    doubt = (
        "the results may be wrong" if seen or step_error >= DOUBTFUL else "this run shows no growth"
    )
    ends = "the numbers are not to be trusted" if wrong else doubt
    key, remedy = shorter_step(numerics, mode.limit, h)
    text = (
        f"{mode.place}: deviations grow by a factor of {mode.growth:.3g} in the run with {method} and steps of "
        f"{case.step_amount(h)}; the limit is {case.step_amount(mode.limit)} (estimated at the start); "
        f"{ends}; {remedy}"
    )
    return Notice("step-limit", mode.place, text, key, h, mode.limit, not wrong)


def shorter_step(numerics, limit: float, used: float) -> tuple[str, str]:
    """(key that gives the step, text that proposes a value of it); the step is too long by the factor used / limit."""
    key, unit = ("step", " s") if numerics.step is not None else ("courant", "")
    return (
        key,
        f"give numerics.{key} = {rounded_down(getattr(numerics, key) * limit / used):.4g}{unit} or less",
    )


def pipe_checks(model, method: str, steps: Steps) -> list[CourantCheck]:
    """List with the check of the pipe whose step is the worst; empty if waves do not grow enough in any checked pipe.

    steps : steps of the run
    A check that is not `only_doubtful` is worse than others; then the ratio of Courant number to limit decides. All
    pipes of few cells are checked by `short_pipe`, and of the longer pipes the one with the greatest Courant number by
    both `long_pipe` and, near the limit, `short_pipe`. The Courant number of the check may be below its limit.
    """
    own = model.tables.pipes["cells"] > 0  # pipes divided into cells
    if not own.any():
        return []
    numerics, waves = model.case.numerics, model.wave_rates
    if numerics.step is not None:
        courant = numerics.step * waves
    else:
        courant = numerics.courant * waves / (waves * model.tables.pipes["rate_factor"]).max()
    courant = courant * steps.share
    cells, scheme = np.array([pipe.cells for pipe in model.pipes]), SCHEMES[numerics.scheme]
    # at the ends of short pipes the order of limited schemes is lower
    long = cells >= (LEAST_CELLS if scheme.limited and scheme.shorter else LONG)
    short = np.flatnonzero(own & ~long)
    checks = [
        check
        for k in short
        if (check := short_pipe(model, method, int(k), float(courant[k]), steps))
    ]
    # waves of a long pipe grow in few cells, too
    inner = own & (cells >= LEAST_CELLS if proved(model) else long)
    if inner.any():
        k = int(np.argmax(np.where(inner, courant, -1.0)))
        checks += long_pipe(model, method, k, float(courant[k]), steps)
    # the ends of a long pipe reduce the limit less; a scheme whose order is lower at ends is left out as above
    not_few = own & (cells >= LONG)
    if not_few.any() and not (scheme.limited and scheme.shorter):
        k = int(np.argmax(np.where(not_few, courant, -1.0)))
        if not is_stable_with_margin(scheme.smooth.name, method, END_MARGIN * float(courant[k])):
            checks += (
                [check] if (check := short_pipe(model, method, k, float(courant[k]), steps)) else []
            )
    return sorted(
        checks,
        key=lambda check: (not only_doubtful(check), check.courant / max(check.limit, 1e-300)),
    )[-1:]


def long_pipe(model, method: str, k: int, courant: float, steps: Steps) -> list[CourantCheck]:
    """Check of pipe number k as a grid without ends, as a list.

    method : name of the method; courant : Courant number of the pipe; steps : steps of the run
    The list is empty if no wave grows at the Courant number nor 1 % above it. If waves grow at every Courant number, it
    is also empty if they grow less than 5 times in the run.
    """
    scheme = smooth_scheme(model.case.numerics.scheme)[0]
    if is_stable_with_margin(scheme, method, courant):
        return []
    from fvsolve.core.step_limits.advection_limit import advection_limit  # loaded only near a limit

    result = advection_limit(scheme, method)
    grows = math.inf if result.limit > 0.0 else growth(scheme, method, courant, steps.count)
    sure = result.proved and proved(model)
    check = CourantCheck(
        f"links.{model.pipes[k].name}",
        courant,
        result.limit,
        scheme,
        sure,
        "on a long pipe",
        growth=grows,
        share=steps.share,
    )
    return [check] if grows >= ALWAYS_GROWING else []


def proved(model) -> bool:
    """True if von Neumann's limit is exact for the pipes: linear scheme, wave speed independent of the state."""
    return not smooth_scheme(model.case.numerics.scheme)[1] and model.case.law.linear


def short_pipe(model, method: str, k: int, courant: float, steps: Steps) -> CourantCheck | None:
    """Check of pipe number k, of few cells; None if no wave grows much with the worst reflections.

    Much is 10 times in the run (5 times if waves grow at every Courant number), or 10 % in a step.
    method : name of the method; courant : Courant number of the pipe; steps : steps of the run
    The growth of the check is that with the reflections at the ends of this pipe, if the scheme has no limiter.
    """
    cells, own_scheme = min(model.pipes[k].cells, MOST_CELLS), SCHEMES[model.case.numerics.scheme]
    scheme, limited = smooth_scheme(
        own_scheme.shorter if own_scheme.limited and own_scheme.shorter else own_scheme.name
    )
    excess = pipe_growth(scheme, method, cells, courant)
    if excess <= GROWTH:
        return None
    grows, limit = growth_factor(excess, steps.count), pipe_limit(scheme, method, cells)
    if grows < (LEAST_GROWTH if limit > 0.0 else ALWAYS_GROWING) and excess < SINGLE_GROWTH:
        return None
    worst_growth = grows
    if not limited:
        excess = pipe_growth(scheme, method, cells, courant, reflection_products(model, k))
        grows = growth_factor(excess, steps.count)
    count = model.pipes[k].cells
    where = f"with reflections at the ends of this pipe of {count} cell{'s' if count > 1 else ''}"
    allowed = (LIMITED_EXCESS if count < LONG else EXCESS) if limited else 0.0
    return CourantCheck(
        f"links.{model.pipes[k].name}",
        courant,
        limit,
        scheme,
        False,
        where,
        allowed,
        grows,
        steps.share,
        worst_growth,
    )


def reflection_products(model, k: int) -> tuple[float, ...]:
    """Possible products of the pressure reflection factors of both ends of pipe number k.

    A junction joined to valves too has two possible factors: that of the pipes alone and -1 (open end). Any node other
    than a junction has -1.
    """
    row = model.tables.pipes[k]
    nodes = model.tables.nodes
    valves = model.tables.valves
    ends = []
    for i in (row["from_node"], row["to_node"]):
        plain = nodes[i]["kind"] == rec.JUNCTION
        alone = plain and not np.any((valves["from_node"] == i) | (valves["to_node"] == i))
        of_pipes = 2.0 * row["admittance"] / nodes[i]["admittance"] - 1.0 if plain else -1.0
        ends.append({round(float(of_pipes), 3)} | (set() if alone else {-1.0}))
    return tuple(sorted({p * q for p in ends[0] for q in ends[1]}))


def mesh_checks(model, method: str, rates: dict[str, float], steps: Steps) -> list[CourantCheck]:
    """Checks of all meshes whose waves grow, as a list.

    If waves grow at every Courant number, a mesh is left out in which they grow less than 5 times in the run.
    rates : greatest wave rate of each part in the run so far, by name [1/s]; steps : steps of the run
    Courant numbers and limits refer to the rate that limits the steps of a part. This rate is the wave rate times the
    factor `courant_factor`.
    """
    numerics, checks = model.case.numerics, []
    for part in model.meshed:
        rate, share = part.max_rate(model.start)
        factor = part.courant_factor
        rate = max(rate, rates.get(part.name, 0.0))
        courant = numerics.step * rate * factor if numerics.step is not None else numerics.courant
        courant *= steps.share
        scheme, limited = smooth_scheme(part.scheme)
        share = round(share, 2) if part.is_grid else 1.0
        if is_stable_with_margin(
            scheme, method, courant / factor, share, part.is_grid and part.has_waves
        ):
            continue
        if part.is_grid:
            limit = plane_limit(scheme, method, share, part.has_waves)
        else:
            from fvsolve.core.step_limits.advection_limit import advection_limit

            limit = advection_limit(scheme, method).limit
        fixed = part.is_grid and part.has_constant_speed
        grows = math.inf if limit > 0.0 else growth(scheme, method, courant / factor, steps.count)
        if grows >= ALWAYS_GROWING:
            checks.append(
                CourantCheck(
                    f"nodes.{part.name}",
                    courant,
                    limit * factor,
                    scheme,
                    fixed and not limited,
                    "in a wide basin",
                    growth=grows,
                    share=steps.share,
                )
            )
    return checks


def span(model) -> float:
    """Duration of the run [s]."""
    return model.case.numerics.end - model.case.numerics.start


def smooth_scheme(scheme: str) -> tuple[str, bool]:
    """Name of the linear scheme that a scheme equals in smooth flow, and True if the scheme has a limiter."""
    return SCHEMES[scheme].smooth.name, SCHEMES[scheme].limited


def only_doubtful(check: CourantCheck) -> bool:
    """True if a Courant number beyond its limit makes results doubtful, but not certainly wrong.

    Reasons are a small excess over an estimated limit, or small growth in the run.
    """
    enough = LEAST_GROWTH**2 if check.limit > 0.0 else ALWAYS_GROWING
    return not check.proved and (
        check.courant <= check.limit * (1.0 + check.allowed_excess) or check.growth < enough
    )


def courant_notice(model, check: CourantCheck, method: str, wrong: bool) -> Notice:
    """Notice for a pipe or a mesh whose Courant number is above its limit.

    check : its Courant number and limit; method : name of the method; wrong : True if a run has shown errors in cells
    """
    doubtful = only_doubtful(check) and not wrong
    numerics = model.case.numerics
    scheme = model.case.numerics.scheme
    about = f", which equals {check.scheme} here," if check.scheme != scheme else ""
    known = "proved" if check.proved else "an estimate"
    key = "step" if numerics.step is not None else "courant"
    if check.limit > 0.0:
        limit = f"the limit is {check.limit:.6g} {check.location} ({known})"
        remedy = shorter_step(numerics, check.limit, check.courant / check.share)[1]
    else:
        limit = f"waves grow at every Courant number {check.location} ({known})"
        remedy = f"{check.scheme} needs another method, for example ssp-rk3"
    text = (
        f"{check.place}: Courant number {check.courant:.6g}, but with {scheme}{about} and {method} {limit}; "
        f"{'the results may be wrong' if doubtful else 'the numbers are not to be trusted'}; {remedy}"
    )
    return Notice("step-limit", check.place, text, key, check.courant, check.limit, doubtful)


def growth(scheme: str, method: str, courant: float, count: float) -> float:
    """Growth factor of the fastest growing wave on a uniform grid in `count` steps with a Courant number."""
    from fvsolve.core.step_limits.advection_limit import growth_of

    return growth_factor(growth_of(weights_of(scheme), method, courant)[0], count)


def rounded_down(x: float) -> float:
    """Round a positive number down to four significant digits."""
    scale = 10.0 ** (3 - math.floor(math.log10(x)))
    return math.floor(x * scale * (1.0 + 1e-12)) / scale
