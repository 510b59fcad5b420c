"""Runs whose start, sources and exact solution are functions of x and t. Knows waves in pipes; judges no order."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.exact.solution import Solution, averages
from fvsolve.model import Slate
from fvsolve.studies.accuracy.cells import pipes
from fvsolve.studies.accuracy.judge import Judge
from fvsolve.studies.accuracy.rows import Order
from fvsolve.studies.distance import recorded
from fvsolve.studies.errands import Errands
from fvsolve.studies.outcome import Outcome, outcome, prepared
from fvsolve.studies.truth import Truth, of_solution


class Manufactured(Judge):
    """The rows of a study with a start, a source or an exact solution given as functions.

    Without a source it runs as every case does, from another state; with one it steps by `steppers.ode.integrate`.
    """

    def __init__(
        self, case, made, against: str, initial: Callable | None, source: Callable | None, exact: Callable | None
    ) -> None:
        super().__init__(case, made, "auto", Errands(case), {})
        self.against = against
        if against == "exact" and exact is None:
            raise FvsolveError('against = "exact" wants the function exact(pipe, x, t); wanted that, or "finer"')
        if not pipes(case):
            raise FvsolveError("initial, source and exact are functions along pipes, and this case has none")
        if not case.law.linear:
            raise FvsolveError(f'initial, source and exact want the law "linear"; this case has "{case.fluid.law}"')
        t0 = case.numerics.start
        self.source, self.exact = source and Given("source", source), exact and Given("exact", exact)
        self.initial = initial and Given("initial", initial)
        if initial is None and exact is not None:
            self.initial = lambda pipe, x: self.exact(pipe, x, t0)

    def study(self, points, progress) -> Order:
        """As of every case, but nothing is kept on disk: functions have no name to know them by."""
        return super().study(None, progress)

    @cached_property
    def truth(self) -> Truth:
        """The exact function, or a finer run from the same start and with the same source."""
        grid = self.plan.way == "time" and self.against == "auto"  # whose own error would hide that of the step
        known = self.exact is not None and self.against != "finer" and not grid
        return self.of_function() if known else self.finer(self.plan.way, False, run=self.outcome)

    def of_function(self) -> Truth:
        """The exact function; nodes show what it says at the ends of their pipes."""
        laws = {}
        for name, pipe in pipes(self.case).items():
            for node, x in ((pipe.from_, 0.0), (pipe.to, pipe.length)):
                laws[node] = lambda t, name=name, x=x: self.exact(name, np.full(np.shape(t), x), t)[0]
        known = Solution(self.case, pressure=laws, pipe=self.exact)
        return of_solution(known, "function", "exact solution given as a function")

    def run(self, level) -> Outcome:
        """The run of a row."""
        return self.outcome(self.case, recorded(self.case, level.set))

    def outcome(self, case, keys) -> Outcome:
        """A run of the case with keys changed, from the given start and with the given source."""
        model = prepared(case, keys)
        y = self.first(model)
        return outcome(model, y=y) if self.source is None else Sourced(model, self.source).run(y)

    def first(self, model) -> np.ndarray:
        """Deviations of both waves, averaged over cells, from the given start [kg/s]."""
        y = np.zeros(model.y_size)
        for k, pipe in enumerate(model.pipes if self.initial else []):
            row, n = model.tables.pipes[k], pipe.cells
            p, q = averages(lambda x, name=pipe.name: self.initial(name, x), pipe.edges)
            total = (p - model.profiles[k]) * row["admittance"]
            change = q * model.case.properties.density - row["flow"]
            o = int(row["y"])
            y[o : o + n], y[o + n : o + 2 * n] = 0.5 * (total + change), 0.5 * (total - change)
        return y


class Given:
    """A function that was given, called along pipes; a FvsolveError names it where it raises or gives nonsense."""

    def __init__(self, name: str, function: Callable) -> None:
        self.name, self.function = name, function
        self.fault: FvsolveError | None = None

    def __call__(self, pipe: str, x, *t) -> tuple[np.ndarray, np.ndarray]:
        shape = np.broadcast_shapes(np.shape(x), *map(np.shape, t))
        try:
            found = self.function(pipe, x, *t)
        except Exception as error:
            raise self.wrong(pipe, f"raised {type(error).__name__}: {error}") from error
        try:
            first, second = (np.broadcast_to(np.asarray(one, dtype=float), shape) for one in found)
        except (TypeError, ValueError) as error:
            size = "x ".join(map(str, shape))
            raise self.wrong(pipe, f"must return two numbers or arrays of {size} values, one for each x") from error
        for one in (first, second):
            if not np.all(np.isfinite(one)):
                where = float(np.broadcast_to(x, shape)[~np.isfinite(one)].flat[0])
                raise self.wrong(pipe, f"gives what is not finite, at x = {where:g} m first")
        return first, second

    def wrong(self, pipe: str, what: str) -> FvsolveError:
        """The fault, kept: compiled steps that call this cannot pass it on."""
        self.fault = FvsolveError(f'{self.name}(pipe, x{", t" if self.name != "initial" else ""}) on "{pipe}" {what}')
        return self.fault


class Sourced:
    """One run with a source, segment by segment between kinks of the case."""

    def __init__(self, model, source: Given) -> None:
        self.model, self.slate, self.source, self.limit = model, Slate(model), source, np.inf

    def rates(self, t: float, y: np.ndarray, dydt: np.ndarray) -> None:
        """The model's rates and what the source brings."""
        dydt[:] = self.slate.evaluate(t, y, self.limit)[0]
        for row, pipe in zip(self.model.tables.pipes, self.model.pipes, strict=True):
            mass, momentum = averages(lambda x, name=pipe.name: self.source(name, x, t), pipe.edges)
            o, n = int(row["y"]), pipe.cells
            dydt[o : o + n] += 0.5 * (row["speed"] * mass + momentum)
            dydt[o + n : o + 2 * n] += 0.5 * (row["speed"] * mass - momentum)

    def run(self, y: np.ndarray) -> Outcome:
        """From the start of the case to its end; a run that fails has its reason."""
        from fvsolve.steppers.ode import integrate

        model, numerics, every = self.model, self.model.case.numerics, self.model.case.output.every
        bounds = [numerics.start, *(t for t, _ in model.breaks if numerics.start < t < numerics.end), numerics.end]
        count = int(np.floor((numerics.end - numerics.start) / every * (1.0 + 1e-12)))
        due = numerics.start + every * np.arange(count + 1)
        stepping = {"rtol": numerics.rtol} if numerics.rtol is not None else {"step": self.step()}
        rows, counts, began = [self.row(numerics.start, y)], {}, time.perf_counter()
        for low, high in zip(bounds[:-1], bounds[1:], strict=True):
            self.limit, told = high, {}
            inner = due[(due > low * (1 + 1e-14)) & (due < high * (1 - 1e-14))]
            times = np.concatenate([[low], inner, [high]])
            try:
                found = integrate(self.rates, y, times, numerics.method, atol=None, counts=told, **stepping)
            except FvsolveError as error:
                if self.source.fault is not None:
                    raise self.source.fault from self.source.fault.__cause__
                return Outcome(str(error), t=low, y=y, model=model, counts=counts)
            rows += [self.row(t, one) for t, one in zip(times[1:], found[1:], strict=True)]
            counts = {key: counts.get(key, 0) + n for key, n in told.items()}
            y = found[-1].copy()
        probes = tuple(probe.text for probe in model.case.probes)
        seconds = time.perf_counter() - began
        return Outcome(
            "finished", ok=True, t=numerics.end, y=y, rows=np.array(rows), probes=probes, counts=counts,
            seconds=seconds, model=model,
        )  # fmt: skip

    def row(self, t: float, y: np.ndarray) -> np.ndarray:
        """Time and probes."""
        out = self.slate.evaluate(t, y, self.limit)[1]
        return np.concatenate([[t], self.slate.observe(t, y, out)])

    def step(self) -> float:
        """The fixed step that the case asks for [s]."""
        numerics = self.model.case.numerics
        return numerics.step or numerics.courant / float(self.model.wave_rates.max())
