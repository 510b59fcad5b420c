"""Study of the order of convergence of a case, also with the start, a source or the exact solution as functions."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from fvsolve.argument_checks import COUNT, FUNCTION, NAMES, TEXT, validated
from fvsolve.core.model import RunData
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.exact.solution import Solution, averages
from fvsolve.studies.accuracy.order_study import Order, OrderStudy
from fvsolve.studies.accuracy.refine import affordable_plan
from fvsolve.studies.distance import recording_keys
from fvsolve.studies.outcome import (
    STUDY_ARGUMENTS,
    Outcome,
    Progress,
    name_list,
    outcome,
    refuse_basins,
    study_model,
)
from fvsolve.studies.parallel import RunQueue
from fvsolve.studies.reference import Reference, reference_of_solution
from fvsolve.studies.resolution import delay_lines, fixed_choices, pipes
from fvsolve.studies.result_cache import OUT, ResultCache, cache_in

REFERENCE_KINDS = ("auto", "exact", "finer", "richardson")


@declared("study")
@validated(
    refine=TEXT, key=TEXT, levels=COUNT, cells=COUNT, schemes=NAMES, methods=NAMES, reference=TEXT, initial=FUNCTION,
    source=FUNCTION, exact=FUNCTION, out=OUT, **STUDY_ARGUMENTS,
)  # fmt: skip
def order(
    case,
    set: Mapping | None = None,
    *,
    refine: str | None = None,
    key: str | None = None,
    levels: int | None = None,
    cells: int | None = None,
    schemes: str | Sequence[str] | None = None,
    methods: str | Sequence[str] | None = None,
    reference: str = "auto",
    initial: Callable | None = None,
    source: Callable | None = None,
    exact: Callable | None = None,
    out: str | Path | ResultCache | None = None,
    progress: Progress | None = None,
    jobs: int = 1,
    dask: str | None = None,
) -> Order | list[Order]:
    """Run a case over a refinement; returns errors and the order with which they decrease.

    With several schemes or methods, the result is a list with an `Order` for each pair of scheme and method.
    case, set : as in `run`; refine, key, levels, cells : as in `studies.accuracy.refine.refinement_plan`
    schemes, methods : name or list of names that replace the scheme and method of the case
    reference : "auto", "exact", "finer" (two levels finer, by another scheme and method) or "richardson" (each
    row against the next). "auto" is "exact" if the case names an exact solution, otherwise "richardson" with basins and
    "finer" without; if a finer run fails or is too inaccurate, it is "richardson".
    initial : initial(pipe, x) -> pressure [Pa], flow [m3/s] at the start, x float64[k] [m]
    source : source(pipe, x, t) -> mass [kg/s/m] and momentum [kg/s2] fed per length and time
    exact : exact(pipe, x, t) -> pressure [Pa], flow [m3/s]; the reference, and the start if `initial` is left out
    Fields of these functions are averaged over cells.
    out : folder in which finished rows are stored and found again; progress : progress(done, total, next)
    jobs, dask : processes that make the runs, as in `sweep`; functions of x and t need this process alone
    Raises CaseError, FvsolveError.
    """
    if reference not in REFERENCE_KINDS:
        hint = (
            did_you_mean(reference, REFERENCE_KINDS) or f"; expected {', '.join(REFERENCE_KINDS)}"
        )
        raise FvsolveError(f'reference = "{reference}" is unknown{hint}')
    given = initial, source, exact
    if any(given) and (jobs != 1 or dask is not None):
        raise FvsolveError(
            "initial, source and exact are functions of this process; expected jobs = 1 and no dask"
        )
    report, studies = progress or (lambda *_: None), []
    pairs = [
        (scheme, method)
        for scheme in name_list(schemes) or [None]
        for method in name_list(methods) or [None]
    ]
    with cache_in(out) as points, RunQueue(case, jobs, dask) as queue:
        for scheme, method in pairs:
            pair_settings = {"numerics.scheme": scheme, "numerics.method": method}
            settings = {
                **(set or {}),
                **{name: value for name, value in pair_settings.items() if value is not None},
            }
            rows = refine, key, levels, cells
            studies.append(
                _order_of_pair(case, settings, rows, reference, given, points, report, queue)
            )
    return studies[0] if len(studies) == 1 else studies


def _order_of_pair(
    case, settings: Mapping, rows: tuple, against, given, points, progress, queue: RunQueue
) -> Order:
    """Order study of one scheme and method; against : reference as for `order`; progress as there.

    settings : overrides of the case; rows : (refine, key, levels, cells) as for `order`; given : (initial, source,
    exact) as for `order`; points : cache of earlier rows; queue : makes the runs
    """
    from fvsolve.case import load

    case = load(case, settings)
    if fixed := fixed_choices(case):
        settings = settings | fixed
        case = load(case, fixed)
    refinement = affordable_plan(case, *rows, against, points)
    if given == (None, None, None):
        return OrderStudy(case, refinement, against, queue, settings).study(points, progress)
    refuse_basins(case, "order by functions of pipes")
    if delayed := delay_lines(case):
        raise FvsolveError(
            f"functions along pipes need cells, but {listing(delayed)} would be delay lines; set "
            'numerics.pipe_model = "finite-volume", and remove `pipe_model` from all pipes'
        )
    return ManufacturedStudy(case, refinement, against, *given).study(points, progress)


class ManufacturedStudy(OrderStudy):
    """Order study with an initial state, a source or an exact solution as functions along the pipes.

    initial, source, exact : functions as in `order`, or None. Without a source, runs differ from usual runs by their
    initial state only; with a source they are integrated by `steppers.ode.integrate`.
    Raises FvsolveError for a case without pipes, for density laws other than `linear`, and for the reference "exact"
    without the function `exact`.
    """

    def __init__(
        self,
        case,
        plan,
        against: str,
        initial: Callable | None,
        source: Callable | None,
        exact: Callable | None,
    ) -> None:
        super().__init__(case, plan, "auto", RunQueue(case), {})
        self.against = against
        if against == "exact" and exact is None:
            raise FvsolveError(
                'reference = "exact" needs the function exact(pipe, x, t); expected that function, or "finer"'
            )
        if not pipes(case):
            raise FvsolveError(
                "initial, source and exact are functions along pipes, but this case has no pipes"
            )
        if not case.law.linear:
            raise FvsolveError(
                f'initial, source and exact need the law "linear", but this case has "{case.fluid.law}"; '
                'set fluid.law = "linear", without cavitation'
            )
        t0 = case.numerics.start
        self.source, self.exact = (
            source and UserFunction("source", source),
            exact and UserFunction("exact", exact),
        )
        self.initial = initial and UserFunction("initial", initial)
        if initial is None and exact is not None:
            self.initial = lambda pipe, x: self.exact(pipe, x, t0)

    def study(self, points, progress) -> Order:
        """Run and fit all rows; nothing is stored in the cache, since functions cannot be identified there."""
        return super().study(None, progress)

    @cached_property
    def reference(self) -> Reference:
        """Reference: the exact function, or a finer run from the same start and with the same source.

        The pressure of a node by the exact function is that at the pipe end that joins the node.
        """
        # the space error would hide the time error
        time_only = self.plan.way == "time" and self.against == "auto"
        use_exact = self.exact is not None and self.against != "finer" and not time_only
        if not use_exact:
            return self.find_reference(self.plan.way, False, run=self.outcome)
        laws = {}
        for name, pipe in pipes(self.case).items():
            for node, x in ((pipe.from_, 0.0), (pipe.to, pipe.length)):
                laws[node] = lambda t, name=name, x=x: self.exact(name, np.full(np.shape(t), x), t)[
                    0
                ]
        solution = Solution(self.case, pressure=laws, pipe=self.exact)
        return reference_of_solution(solution, "function", "exact solution given as a function")

    def run(self, level) -> Outcome:
        """Outcome of the run of a refinement level."""
        return self.outcome(self.case, recording_keys(self.case, level.set))

    def outcome(self, case, keys) -> Outcome:
        """Outcome of the case with changed keys, from the given initial state and with the given source."""
        model = study_model(case, keys)
        y = self.initial_state(model)
        return (
            outcome(model, y=y) if self.source is None else RunWithSource(model, self.source).run(y)
        )

    def initial_state(self, model) -> np.ndarray:
        """Initial state vector: forward and backward waves of the given initial state, averaged over cells [kg/s].

        They are deviations from the initial steady state; zero if no initial state is given.
        """
        y = np.zeros(model.y_size)
        for k, pipe in enumerate(model.pipes if self.initial else []):
            row, n = model.tables.pipes[k], pipe.cells
            p, q = averages(lambda x, name=pipe.name: self.initial(name, x), pipe.edges)
            total = (p - model.profiles[k]) * row["admittance"]
            change = q * model.case.properties.density - row["flow"]
            o = int(row["y"])
            y[o : o + n], y[o + n : o + 2 * n] = 0.5 * (total + change), 0.5 * (total - change)
        return y


class UserFunction:
    """Function of the user along pipes, called as function(pipe, x, t), or as function(pipe, x) for the initial state.

    Returns two arrays: pressure [Pa] and flow [m3/s], or the mass [kg/s/m] and momentum [kg/s2] of a source.
    Raises FvsolveError if the function fails or returns unusable values.
    """

    def __init__(self, name: str, function: Callable) -> None:
        self.name, self.function = name, function
        self.fault: FvsolveError | None = None

    def __call__(self, pipe: str, x, *t) -> tuple[np.ndarray, np.ndarray]:
        shape = np.broadcast_shapes(np.shape(x), *map(np.shape, t))
        try:
            values = self.function(pipe, x, *t)
        except Exception as error:
            raise self.fault_for(pipe, f"raised {type(error).__name__}: {error}") from error
        try:
            first, second = (
                np.broadcast_to(np.asarray(field, dtype=float), shape) for field in values
            )
        except (TypeError, ValueError) as error:
            size = " x ".join(map(str, shape))
            raise self.fault_for(
                pipe, f"must return two numbers or arrays of {size} values, one for each x"
            ) from error
        for field in (first, second):
            if not np.all(np.isfinite(field)):
                place = float(np.broadcast_to(x, shape)[~np.isfinite(field)].flat[0])
                raise self.fault_for(
                    pipe, f"returns values that are not finite, first at x = {place:g} m"
                )
        return first, second

    def fault_for(self, pipe: str, problem: str) -> FvsolveError:
        """FvsolveError on a problem on a pipe; it is also stored, because compiled steps cannot pass it on."""
        arguments = "pipe, x" if self.name == "initial" else "pipe, x, t"
        self.fault = FvsolveError(f'{self.name}({arguments}) on "{pipe}" {problem}')
        return self.fault


class RunWithSource:
    """Run of a model with a source along the pipes, integrated between the kinks and jumps of its schedules."""

    def __init__(self, model, source: UserFunction) -> None:
        self.model, self.run_data, self.source, self.limit = model, RunData(model), source, np.inf

    def rates(self, t: float, y: np.ndarray, dydt: np.ndarray) -> None:
        """Write the rates of the model plus the source at the state (t, y) to `dydt`."""
        dydt[:] = self.run_data.evaluate(t, y, self.limit)[0]
        for row, pipe in zip(self.model.tables.pipes, self.model.pipes, strict=True):
            mass, momentum = averages(lambda x, name=pipe.name: self.source(name, x, t), pipe.edges)
            o, n = int(row["y"]), pipe.cells
            dydt[o : o + n] += 0.5 * (row["speed"] * mass + momentum)
            dydt[o + n : o + 2 * n] += 0.5 * (row["speed"] * mass - momentum)

    def run(self, y: np.ndarray) -> Outcome:
        """Run from the initial state y to the end of the case; the outcome of a failed run gives the reason.

        Raises FvsolveError if the source function fails or returns unusable values.
        """
        from fvsolve.core.steppers.ode import integrate

        model = self.model
        numerics = self.model.case.numerics
        every = self.model.case.output.every
        bounds = [
            numerics.start,
            *(t for t, _ in model.breaks if numerics.start < t < numerics.end),
            numerics.end,
        ]
        count = int(np.floor((numerics.end - numerics.start) / every * (1.0 + 1e-12)))
        due = numerics.start + every * np.arange(count + 1)
        stepping = {"rtol": numerics.rtol} if numerics.rtol is not None else {"step": self.step()}
        rows = [self.row(numerics.start, y)]
        counts = {}
        began = time.perf_counter()
        for low, high in zip(bounds[:-1], bounds[1:], strict=True):
            self.limit, segment_counts = high, {}
            inner = due[(due > low * (1 + 1e-14)) & (due < high * (1 - 1e-14))]
            times = np.concatenate([[low], inner, [high]])
            try:
                states = integrate(
                    self.rates,
                    y,
                    times,
                    numerics.method,
                    atol=None,
                    counts=segment_counts,
                    **stepping,
                )
            except FvsolveError as error:
                if self.source.fault is not None:
                    raise self.source.fault from self.source.fault.__cause__
                return Outcome(str(error), t=low, y=y, model=model, counts=counts)
            rows += [self.row(t, state) for t, state in zip(times[1:], states[1:], strict=True)]
            counts = {key: counts.get(key, 0) + n for key, n in segment_counts.items()}
            y = states[-1].copy()
        probes = tuple(probe.text for probe in model.case.probes)
        seconds = time.perf_counter() - began
        return Outcome(
            "finished",
            ok=True,
            t=numerics.end,
            y=y,
            rows=np.array(rows),
            probes=probes,
            counts=counts,
            seconds=seconds,
            model=model,
        )

    def row(self, t: float, y: np.ndarray) -> np.ndarray:
        """Row of output at the state (t, y): time [s], then the values of the probes [SI]."""
        out = self.run_data.evaluate(t, y, self.limit)[1]
        return np.concatenate([[t], self.run_data.observe(t, y, out)])

    def step(self) -> float:
        """Time step [s]: that of the case, or the step for its Courant number."""
        numerics = self.model.case.numerics
        return numerics.step or numerics.courant / float(self.model.wave_rates.max())
