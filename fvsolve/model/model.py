"""A model and a state: what `solve` and every study hold in their hands. Knows indices and names."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.errors import FvsolveError, Notice
from fvsolve.kernels import records as rec
from fvsolve.model.creep import held_by_wall
from fvsolve.model.past import without_past
from fvsolve.model.scalars import node_values, pipe_values
from fvsolve.model.slate import Slate
from fvsolve.shown import Shown
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.basins.lower_basin import BasinRows
    from fvsolve.case import Case
    from fvsolve.case.probe import Probe
    from fvsolve.model.state_names import StateNames
    from fvsolve.parts.pipe.profile import Profile


@dataclass(frozen=True)
class PipeMesh:
    """Cells of one pipe, from its `from` end: x centres, edges [m], elevation of centres [m]; its profile, if any."""

    name: str
    from_: str
    to: str
    length: float
    diameter: float
    cells: int
    wave_speed: float
    x: np.ndarray
    edges: np.ndarray
    elevation: np.ndarray
    profile: Profile | None
    ends: tuple[float, float]  # elevations of its ends [m]

    def height(self, distance: Any) -> Any:
        """Elevation at distances from its `from` end [m]."""
        if self.profile is None:
            return self.ends[0] + (self.ends[1] - self.ends[0]) * (distance / self.length)
        return self.profile.at(distance)


@dataclass(repr=False)
class State(Shown):
    """Time [s], the flat vector y, and the integrator's memory in one flat array (empty: a fresh start)."""

    t: float
    y: np.ndarray
    memory: np.ndarray = field(default_factory=lambda: np.zeros(0))

    picture = "fvsolve.draw.objects:state_figure"

    def __post_init__(self) -> None:
        self.t = given_time(self.t)
        self.y, self.memory = given_numbers("y", self.y), given_numbers("memory", self.memory)
        for name, array in (("y", self.y), ("memory", self.memory)):
            if array.ndim != 1:
                raise FvsolveError(f"{name} has shape {array.shape}; wanted one row of numbers")

    def said(self) -> str:
        return f"at t = {self.t:g} s: {self.y.size} numbers"

    def listed(self) -> dict[str, np.ndarray]:
        return {"y": self.y}


def flags_of(state: State, model: Model) -> np.ndarray | float:
    """Flags of devices that a state remembers, if `advance` gave it; 0 of others."""
    memory = state.memory
    if len(model.tables.delays) and memory.size:
        memory = without_past(memory)[0]
    return memory[2:] if memory.size == 2 + model.shapes.armed else 0.0


def given_numbers(name: str, given: Any) -> np.ndarray:
    """What is given as float64[...] that can be written, itself where it is that; FvsolveError if not real numbers."""
    if type(given) is float:
        return np.float64(given)
    if type(given) is np.ndarray and given.dtype == np.float64 and given.flags.carray and given.ndim:
        return given
    try:
        found = np.asarray(given)
        if found.dtype.kind not in "fiu":
            raise TypeError
        return np.require(found, np.float64, ("C", "W")) if found.ndim else found.astype(np.float64)
    except (TypeError, ValueError):
        raise FvsolveError(f"{name} = {show(given)} is not made of real numbers") from None


def given_limit(limit: Any) -> float:
    """Where a segment ends [s], or infinity; FvsolveError where it is no time."""
    found = given_numbers("limit", limit)
    if found.ndim or np.isnan(found):
        raise FvsolveError(f"limit = {show(found)} is no time; wanted a number of seconds, or infinity")
    return float(found)


def given_time(t: Any) -> float:
    """A time [s]; FvsolveError where it is no finite number."""
    found = given_numbers("t", t)
    if found.ndim or not np.isfinite(found):
        raise FvsolveError(f"t = {show(t)} is no time; wanted a finite number of seconds")
    return float(found)


@dataclass(frozen=True, eq=False, repr=False)
class Model(Shown):
    """A case made ready; frozen, so that runs may share it: what a run writes is on a `Slate` of its own.

    tables : the arrays that kernels read, by name; shapes : of those that a run writes, see `Slate`
    scale : float64[n]  what counts as a small deviation of each state is measured against
    breaks : (time [s], whether a value jumps), rising, inside the run
    """

    case: Case
    tables: rec.Tables
    shapes: rec.Written
    state_names: StateNames
    scale: np.ndarray
    breaks: list[tuple[float, bool]]
    step_max: float
    pipes: list[PipeMesh]
    node_names: list[str]
    link_names: list[str]
    valve_names: list[str]
    column_names: list[str]
    piston_names: list[str]
    mass_names: list[str]
    body_names: list[str]
    bushing_names: list[str]
    elevation: dict[str, float]
    probes: list[Any]
    warnings: list[Notice]
    steady: dict[str, Any]  # what the start looks like, for `check`
    profiles: dict[int, np.ndarray]  # pipe -> pressure of the profile at cell centres [Pa]
    devices: list[tuple]  # (name, part, what it is lowered by), as their table has them
    laws: list[str]  # modules of compiled laws of parts, as rows of `hooks` lie
    start: np.ndarray  # the state at the start: nothing moves but what a basin's dam holds back
    events: list[tuple[str, str]]  # of devices: whose, and what it means that its function falls to zero
    basins: list[BasinRows]  # as their table has them
    watched: list[Probe]  # beside the probes, for their extremes alone
    watched_start: np.ndarray  # what those of pressure along pipes are in the profile [Pa], nan of others
    sharp: dict[str, np.ndarray]  # tables that a jump meets in place of these, see `model.delay`
    slates: deque[Slate] = field(default_factory=deque, init=False)  # that wait for what looks at single states
    packed: list = field(default_factory=list, init=False)  # its draft before the start, where others are made of it

    picture = "fvsolve.draw.objects:model_figure"

    def __post_init__(self) -> None:
        for array in (*self.tables, self.scale, self.start, *self.profiles.values(), *self.sharp.values()):
            array.flags.writeable = False

    def said(self) -> str:
        cells = f", {self.all_cells} cells" if self.all_cells else ""
        return f"of {self.case.name!r}: {self.y_size} states{cells}, {len(self.probes)} probes"

    def listed(self) -> dict[str, Any]:
        return {"state": self.state_names, "start": self.start, "scale": self.scale}

    @property
    def y_size(self) -> int:
        """Number of states."""
        return len(self.state_names)

    @property
    def ledgers(self) -> int:
        """Rows of the stepper's ledger: supply of every node, and of scalars what enters there and what decays."""
        return int(self.layout["net"] - self.layout["supply"])

    @property
    def cells(self) -> int:
        """Number of cells of all pipes."""
        return sum(pipe.cells for pipe in self.pipes)

    @property
    def all_cells(self) -> int:
        """Number of cells of all pipes and basins."""
        return self.cells + sum(basin.n for basin in self.basins)

    @cached_property
    def wave_rates(self) -> np.ndarray:
        """Cells that a wave crosses in a second, for every pipe [1/s]."""
        pipes = self.tables.pipes
        found = pipes["speed"] / pipes["dx"] * np.where(pipes["delay"] >= 0, pipes["quicker"], 1.0)
        found.flags.writeable = False
        return found

    @property
    def wave_rate(self) -> float:
        """Cells that the quickest wave crosses in a second, in basins as they count them at the start [1/s]."""
        found = float(self.wave_rates.max(initial=0.0))
        if not self.basins:
            return found
        return max(found, float(self.evaluate(self.case.numerics.start, self.start)[1][rec.RATE]))

    @property
    def unsteady(self) -> bool:
        """Whether the friction of a pipe remembers the past of its flow."""
        return bool(self.tables.pipes["terms"].any())

    @property
    def creeps(self) -> bool:
        """Whether the wall of a pipe gives way in time."""
        return bool(self.tables.pipes["elements"].any())

    @cached_property
    def places(self) -> tuple:
        """Where its tables lie, as handles say it."""
        from fvsolve.kernels.handle import places_of

        return places_of(self.tables)

    @cached_property
    def functions(self):
        """Its compiled functions (`kernels.functions.Functions`): of the case's law, with what the scene has."""
        from fvsolve.basins.lower_pieces import of_basins, of_scalars
        from fvsolve.kernels.functions import functions
        from fvsolve.kernels.phases import Cast

        many = rec.Tables(*(len(table) > 0 for table in self.tables))
        there = [many.clusters, many.columns, many.masses, many.bodies, many.lines, many.pins, many.bushings]
        there.append(many.rides)
        basins, carried, valves = of_basins(self.basins, many.valves), of_scalars(self.basins), many.valves
        alone = bool(self.basins) and not (self.pipes or valves or many.devices or any(there))
        alone = alone and bool((self.tables.nodes["kind"] == rec.PATCH).all())
        cells = bool((self.tables.pipes["cells"] > 0).any())
        cast = Cast(self.case.law.family, cells, *there, self.unsteady, self.creeps, many.devices, tuple(self.laws),
                    basins, carried, many.scalars, valves, many.delays, alone,
                    forces=bool(self.layout["forces"] >= 0))  # fmt: skip
        return functions(cast)

    @property
    def damped(self) -> bool:
        """True if stages of explicit steps are divided by friction, see `steppers.semi_implicit`."""
        return bool(self.tables.basins["damped"].any())

    @property
    def layout(self):
        """Offsets of what the rhs writes beside dydt."""
        return self.tables.layout[0]

    @cached_property
    def structure(self):
        """Pattern of the Jacobian and the linear algebra that fits it, or that `numerics.linear_algebra` names."""
        from fvsolve.model.dependence import lumped, sparsity
        from fvsolve.steppers.structure import Structure

        return Structure(sparsity(self), self.case.numerics.linear_algebra, lumped(self))

    def new_out(self) -> np.ndarray:
        """An array for what the rhs writes beside dydt."""
        found = np.zeros(int(self.layout["size"]))
        found[rec.ARRIVES] = rec.NEVER
        return found

    def given(self, t: Any, y: Any) -> tuple[float, np.ndarray]:
        """A time and a state as kernels take them; FvsolveError where they are none of this model, or not finite."""
        found = self.sized(y)
        if not np.isfinite(found).all():
            k = int(np.argmax(~np.isfinite(found)))
            raise FvsolveError(f"y[{k}] = {found[k]}, {self.state_names[k]}; wanted a finite number for every state")
        return given_time(t), found

    def sized(self, y: Any) -> np.ndarray:
        """A state as float64[n]; FvsolveError where it is none of this model."""
        found = given_numbers("y", y)
        if found.shape != (self.y_size,):
            raise FvsolveError(f"y has shape {found.shape}; wanted a number for each of the {self.y_size} states that "
                               "Model.state_names lists")  # fmt: skip
        return found

    def rhs(self, t: float | State, y: np.ndarray | None = None) -> np.ndarray:
        """dy/dt = f(t, y) : float64[n]; right-hand values of schedules, devices as at a start from there.

        With delay lines it wants a `State`, whose memory holds their past; FvsolveError where it gets a y alone.
        """
        if isinstance(t, State) and y is None:
            with self.slate() as slate:
                slate.recall(t)
                return slate.evaluate(t.t, t.y, np.inf)[0]
        self.refuse_lines("rhs")
        return self.evaluate(t, y)[0]

    def refuse_lines(self, what: str) -> None:
        """FvsolveError where delay lines have a past that no y tells."""
        if len(self.tables.delays):
            raise FvsolveError(f"{what}(t, y) of a model with delay lines is not all there is to say: what was sent "
                               'into them counts too; wanted rhs(State), or line = "cells"')  # fmt: skip

    def evaluate(self, t: float, y: np.ndarray, limit: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """(dydt, out) at t, as `rhs`; from `limit` [s] on schedules take their left limit there."""
        limit = given_limit(limit)
        with self.slate() as slate:
            return slate.evaluate(t, y, limit)

    @contextmanager
    def slate(self, armed: np.ndarray | float = 0.0) -> Iterator[Slate]:
        """A slate for a look at single states, with flags as given, 0 for those of a start; the next look takes it.

        Its marks and extremes say nothing.
        """
        try:
            slate = self.slates.pop()  # which no other thread then has
        except IndexError:
            slate = Slate(self)
        slate.blank(armed)
        yield slate
        self.slates.append(slate)

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """df/dy : float64[n, n] by central differences of the scaled states."""
        self.refuse_lines("jacobian")
        return self.held_jacobian(t, y)

    def held_jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """The same where what arrives from delay lines stands still."""
        (t, y), n = self.given(t, y), self.y_size
        found = np.empty((n, n))
        for j in range(n):
            step = 1e-6 * (self.scale[j] + abs(y[j]))
            high, low = y.copy(), y.copy()
            high[j] += step
            low[j] -= step
            found[:, j] = (self.evaluate(t, high)[0] - self.evaluate(t, low)[0]) / (high[j] - low[j])
        return found

    def observe(self, t: float | State, y: np.ndarray | None = None, limit: float = np.inf) -> np.ndarray:
        """Values of all probes, in the order of `.probes`, at a `State` or at (t, y) : float64[probes] [SI].

        Devices stand as at a start from there, or as a state that `advance` gave remembers.
        """
        armed, limit, past = 0.0, given_limit(limit), None
        if isinstance(t, State) and y is None:
            t, y, armed, past = t.t, t.y, flags_of(t, self), t
        t, y = self.given(t, y)
        with self.slate(armed) as slate:
            slate.recall(past)
            return slate.observe(t, y, slate.evaluate(t, y, limit)[1])

    # what the numbers mean ----------------------------------------------------------------------------------

    def cell_pressure(self, k: int, waves: np.ndarray) -> np.ndarray:
        """Pressure [Pa] in the cells of pipe k from the sum of both waves [kg/s]."""
        waves = given_numbers("waves", waves)
        if (
            not isinstance(k, (int, np.integer))
            or not 0 <= k < len(self.pipes)
            or waves.shape != (self.pipes[k].cells,)
        ):
            raise FvsolveError(f"waves has shape {waves.shape} for pipe {k}; wanted a number for each cell of one of "
                               f"{len(self.pipes)} pipes, counted from 0")  # fmt: skip
        return self.case.law.cell_pressure(self.tables.pipes[k], self.profiles[k], self.tables.profile, waves)

    def head(self, pressure: np.ndarray, elevation) -> np.ndarray:
        """Head [m] of the case's fluid above datum, measured from ambient."""
        pressure, elevation = given_numbers("pressure", pressure), given_numbers("elevation", elevation)
        return self.case.law.head(pressure, elevation)

    @property
    def cavitates(self) -> bool:
        """Whether the density law knows cavities: it has a floor."""
        return self.case.law.cavitates

    def fields(self, y: np.ndarray, out: np.ndarray, lines: dict[int, tuple] | None = None) -> dict[str, Any]:
        """Fields of all pipes and pressures of all nodes at a state, SI; `out` as `evaluate` gives it.

        lines : pipe -> both waves of those that are delay lines, as `Slate.along` gives them
        """
        y = self.sized(y)
        if np.shape(out) != (int(self.layout["size"]),):
            raise FvsolveError(f"out has shape {np.shape(out)}; wanted what Model.evaluate gives beside the rates")
        found, law = {}, self.case.law
        for k, pipe in enumerate(self.pipes):
            row = self.tables.pipes[k]
            n, o = pipe.cells, row["y"]
            r, l = y[o : o + n], y[o + n : o + 2 * n]  # noqa: E741
            if row["delay"] >= 0:
                r, l = (lines or {}).get(k, (np.zeros(n), np.zeros(n)))  # noqa: E741
            pressure, mass_flow = self.cell_pressure(k, r + l), row["flow"] + (r - l)
            flow = mass_flow / law.density(pressure)
            found[pipe.name] = {
                "pressure": pressure, "head": self.head(pressure, pipe.elevation),
                "velocity": flow / law.area(row, pressure), "flow": flow,
                "least_pressure": pressure, "greatest_pressure": pressure, **pipe_values(self, k, y),
            }  # fmt: skip
        nodes = self.tables.nodes
        at = int(self.layout["pressure"])
        for basin in self.basins:
            found[basin.name] = basin.fields(basin.of(y)) | (basin.values(y) if basin.scalars else {})
        found["points"] = {basin.name: basin.points_at(y, out, self.layout) for basin in self.basins
                           if basin.moves or basin.part.on is not None}  # fmt: skip
        found["nodes"] = {}
        for i, name in enumerate(self.node_names):
            pressure = float(nodes[i]["pressure"] + out[at + i])
            found["nodes"][name] = {
                "pressure": pressure,
                "head": float(self.head(pressure, self.elevation[name])), **node_values(self, i, out),
            }  # fmt: skip
        return found

    def contents(self, y: np.ndarray) -> tuple[float, float]:
        """Mass stored in the profile and by how much the state deviates from it [kg]."""
        y = self.sized(y)
        initial, change = 0.0, 0.0
        for k, row in enumerate(self.tables.pipes):
            o, n = row["y"], int(row["cells"])
            initial += self.case.law.held_in_pipe(row, self.profiles[k], self.tables.profile)
            change += float(np.sum(y[o : o + 2 * n])) * row["dx"] / row["speed"]
            change += float(y[o]) if row["delay"] >= 0 else 0.0
            change += held_by_wall(self.tables.floats, row, y)
        for row in self.tables.nodes:
            if row["y"] >= 0:
                initial += float(row["mass"])
                change += float(y[row["y"]])
        for basin in self.basins:
            rest, per = basin.mass()
            for own, start in zip(basin.own(y)[:1], basin.own(self.start)[:1], strict=True):
                initial += rest + float(np.sum(per * start))
                change += float(np.sum(per * (own - start)))
        for row in self.tables.pistons:  # what chambers on the axis hold is their excess and what was swept
            if row["line"] >= 0:
                continue
            places = self.tables.masses[[row["case"], row["rod"]]]["y"]
            back, forth = (float(y[place]) if place >= 0 else 0.0 for place in places)
            change += float(row["sweep_a"] + row["sweep_b"]) * (forth - back)
        return initial, change

    @property
    def checks(self) -> dict[str, Any]:
        """What was understood, for `fvsolve check`."""
        from fvsolve.model.checks import checks

        return checks(self)
