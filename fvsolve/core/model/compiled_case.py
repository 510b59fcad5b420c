"""Compiled case: its tables, names, sizes and masses, and the meaning of its states."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.core.assembly.pipe_terms import mass_in_creep
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import FvsolveError, Notice, listing
from fvsolve.units import show

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from fvsolve.case import Case
    from fvsolve.case.probe import Probe
    from fvsolve.core.assembly.meshed_parts import MeshedPart
    from fvsolve.core.assembly.model_draft import PipeMesh
    from fvsolve.core.assembly.state_names import StateNames
    from fvsolve.core.kernels.compiled_functions import Functions
    from fvsolve.core.steppers.structure import Structure


def as_numbers(name: str, values: Any) -> np.ndarray:
    """Convert to a writable, C-contiguous float64[...], without a copy where possible; a number gets the shape ().

    Raises FvsolveError if the values are not real numbers. name : name of the values in its message
    """
    if type(values) is float:
        return np.float64(values)
    if (
        type(values) is np.ndarray
        and values.dtype == np.float64
        and values.flags.carray
        and values.ndim
    ):
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiu":
            raise TypeError
        return np.require(array, np.float64, ("C", "W")) if array.ndim else array.astype(np.float64)
    except (TypeError, ValueError):
        text = f"{name} = {show(values)} does not consist of real numbers"
        raise FvsolveError(f"{text}; expected a number or an array of numbers") from None


def as_time(t: Any) -> float:
    """Time as a float [s]. Raises FvsolveError if the argument is not a finite number."""
    value = as_numbers("t", t)
    if value.ndim or not np.isfinite(value):
        raise FvsolveError(f"t = {show(t)} is not a time; expected a finite number of seconds")
    return float(value)


def once_per_model(function: Callable) -> Callable:
    """Decorate a function of a model and further arguments, so that a model keeps its results.

    The results depend on the model only and must not be changed; arrays become read-only.
    """

    @functools.wraps(function)
    def once(model: CompiledCase, *arguments: Any) -> Any:
        key = function, arguments
        if key not in model.computed:
            result = model.computed[key] = function(model, *arguments)
            if isinstance(result, np.ndarray):
                result.flags.writeable = False
        return model.computed[key]

    return once


@dataclass(frozen=True, eq=False, repr=False)
class CompiledCase:
    """Tables of a compiled case, and what follows from them without evaluating the right-hand side.

    It is frozen, so that several runs can share it: each run writes to its own `RunData`.

    tables : arrays that kernels read, by name; shapes : shapes of the arrays that a run writes, see `RunData`
    scale : float64[n]  size of a small deviation of each state, for relative measures
    breaks : times within the run at which steps must end, increasing : (time [s], True if a schedule's value jumps)
    step_max : greatest step under error control, which resolves periods and samples of schedules [s]
    """

    case: Case
    tables: rec.Tables
    shapes: rec.RunArrays
    state_names: StateNames
    scale: np.ndarray
    breaks: list[tuple[float, bool]]
    step_max: float
    pipes: list[PipeMesh]
    node_names: list[str]
    link_names: list[str]
    valve_names: list[str]
    column_names: list[str]
    elevation: dict[str, float]
    probes: list[Any]
    warnings: list[Notice]
    steady: dict[str, Any]  # facts about the start, for `fvsolve check`
    profiles: dict[int, np.ndarray]  # pipe -> pressure of the profile at cell centres [Pa]
    devices: list[tuple]  # (name, part, lowering), in the order of their table
    laws: list[str]  # modules of compiled laws of parts, in the order of the rows of `hooks`
    start: np.ndarray  # state at the start: zero except what features write
    # of devices and valves: (name, meaning of a zero of its event function)
    events: list[tuple[str, str]]
    watched: list[Probe]  # read in addition to the probes, for their extremes only
    # pressures of `watched` along pipes in the profile [Pa], nan for others
    watched_start: np.ndarray
    features: list[Any]  # see `assembly.features`
    flags: np.ndarray  # event flags before a run
    # tables before the start is solved, reused by `vary`
    tables_before_start: list = field(default_factory=list, init=False)
    # results of functions, see `once_per_model`
    computed: dict = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        for array in (*self.tables, self.scale, self.start, *self.profiles.values()):
            array.flags.writeable = False

    @property
    def block_names(self) -> list[str]:
        """Names of blocks of `controls`, in the order of their table."""
        if not self.case.controls:
            return []
        from fvsolve.case.controls import decision_order

        return decision_order(self.case.controls)

    def schedule_of(self, name: str) -> int:
        """Number of the schedule of a link of a feature; raises FvsolveError if there is none."""
        numbers = {
            link: k
            for feature in self.features
            for link, k in feature.link_schedules.items()
            if k >= 0
        }
        if not isinstance(name, str) or name not in numbers:
            raise FvsolveError(
                f"{show(name)} has no schedule; expected {listing([*numbers]) or 'a link of a feature'}"
            )
        return numbers[name]

    @property
    def y_size(self) -> int:
        """Number of states."""
        return len(self.state_names)

    @property
    def sources(self) -> list[str]:
        """Names of the rows of the ledger of mass that does not pass nodes, such as rain : "street.rain"."""
        return [name for feature in self.features for name in feature.sources]

    @property
    def meshed(self) -> list[MeshedPart]:
        """Parts with a mesh of cells, in the order of their tables."""
        return [part for feature in self.features for part in feature.meshed]

    @property
    def ledger_names(self) -> list[str]:
        """Names of nodes in the ledger; the cells at a patch have the name of the patch."""
        kinds = zip(self.node_names, self.tables.nodes["kind"], strict=True)
        return [name.removesuffix(".inside") if kind == rec.PATCH else name for name, kind in kinds]

    @property
    def ledgers(self) -> int:
        """Number of rows of the ledger: supply of nodes, then those of features."""
        return int(self.layout["net"] - self.layout["supply"])

    @property
    def cells(self) -> int:
        """Number of cells of all pipes, see `PipeMesh`."""
        return sum(pipe.cells for pipe in self.pipes)

    @property
    def all_cells(self) -> int:
        """Number of cells of all pipes (see `PipeMesh`) and meshes."""
        return self.cells + sum(part.n for part in self.meshed)

    @functools.cached_property
    def wave_rates(self) -> np.ndarray:
        """Cells that a wave crosses per second in each pipe : float64[pipes] [1/s].

        For each delay line it is the value of the delay line with the longest travel time.
        """
        pipes = self.tables.pipes
        rates = (
            pipes["speed"] / pipes["dx"] * np.where(pipes["cells"] == 0, pipes["rate_factor"], 1.0)
        )
        rates.flags.writeable = False
        return rates

    @property
    def unsteady(self) -> bool:
        """True if any pipe has unsteady friction."""
        return bool(self.tables.pipes["terms"].any())

    @property
    def creeps(self) -> bool:
        """True if the wall of any pipe creeps."""
        return bool(self.tables.pipes["elements"].any())

    @functools.cached_property
    def isolated(self) -> frozenset[str]:
        """Key paths of nodes and links whose pressure no flow determines during a run, see `shut_off`."""
        from fvsolve.core.model.shut_off import isolated_parts

        return isolated_parts(self)

    @functools.cached_property
    def places(self) -> tuple:
        """Memory addresses of the tables, by which compiled functions read them."""
        from fvsolve.core.kernels.table_handle import addresses_of

        return addresses_of(self.tables)

    @functools.cached_property
    def functions(self) -> Functions:
        """Compiled functions (`kernels.compiled_functions.Functions`) for the density law and parts of this model."""
        from fvsolve.core.kernels.compiled_functions import functions
        from fvsolve.core.kernels.rhs_assembly import ModelFeatures

        has = rec.Tables(*(len(table) > 0 for table in self.tables))
        alone = bool(self.meshed) and not (
            self.pipes or has.valves or has.devices or has.clusters or has.columns
        )
        alone = alone and not any(feature.reads_nodes for feature in self.features)
        alone = alone and bool((self.tables.nodes["kind"] == rec.PATCH).all())
        cells = bool((self.tables.pipes["cells"] > 0).any())
        cast = ModelFeatures(
            self.case.law.family,
            cells,
            has.clusters,
            has.columns,
            self.unsteady,
            self.creeps,
            has.devices,
            tuple(self.laws),
            has.valves,
            (),
            (),
            has.couplings,
            alone,
            forces=bool(self.layout["forces"] >= 0),
            formulas=bool((self.tables.schedules["pieces"] < 0).any()),
        )
        terms = tuple(pair for feature in self.features for pair in feature.terms(self, cast))
        packages = tuple(name for feature in self.features for name in feature.packages)
        hooks = tuple(name for feature in self.features for name in feature.device_hooks)
        cast = cast._replace(features=terms, further_packages=packages, device_hooks=hooks)
        return functions(cast)

    @property
    def damped(self) -> bool:
        """True if explicit steps divide rates by a factor for friction, see `steppers.erk`."""
        return any(feature.damped for feature in self.features)

    @property
    def layout(self) -> np.void:
        """Record of offsets in `out`, the array that the right-hand side writes in addition to dydt."""
        return self.tables.layout[0]

    @functools.cached_property
    def structure(self) -> Structure:
        """Sparsity pattern of the Jacobian, with the linear algebra chosen for it or by `numerics.linear_algebra`."""
        from fvsolve.core.model.jacobian_pattern import jacobian_pattern, lumped_states
        from fvsolve.core.steppers.structure import Structure

        return Structure(
            jacobian_pattern(self), self.case.numerics.linear_algebra, lumped_states(self)
        )

    def new_out(self) -> np.ndarray:
        """New array for the values that the right-hand side writes in addition to dydt."""
        out = np.zeros(int(self.layout["size"]))
        out[rec.ARRIVES] = out[rec.LAST_ROW] = rec.NEVER
        return out

    def checked(self, t: Any, y: Any) -> tuple[float, np.ndarray]:
        """Time and state in the form that kernels read : (t [s], y : float64[n]).

        Raises FvsolveError if the state does not fit this model, or if the time or a state is not a finite number.
        """
        state = self.checked_size(y)
        if not np.isfinite(state).all():
            k = int(np.argmax(~np.isfinite(state)))
            raise FvsolveError(
                f"y[{k}] = {state[k]}, {self.state_names[k]}; expected a finite number for every state"
            )
        return as_time(t), state

    def checked_size(self, y: Any) -> np.ndarray:
        """State as float64[n]. Raises FvsolveError if its size does not fit this model."""
        state = as_numbers("y", y)
        if state.shape != (self.y_size,):
            raise FvsolveError(
                f"y has shape {state.shape}; expected a number for each of the {self.y_size} states "
                "that Model.state_names lists"
            )
        return state

    # physical meaning of states --------------------------------------------------------------------------------

    def cell_pressure(self, k: int, waves: np.ndarray) -> np.ndarray:
        """Pressure [Pa] in the cells of pipe k from the sum of both waves [kg/s] : float64[cells].

        Raises FvsolveError if there is no such pipe, or if `waves` does not have a number for each of its cells.
        """
        waves = as_numbers("waves", waves)
        known = isinstance(k, (int, np.integer)) and 0 <= k < len(self.pipes)
        if not known or waves.shape != (self.pipes[k].cells,):
            raise FvsolveError(
                f"waves has shape {waves.shape} for pipe {k}; expected a number for each cell of "
                f"the pipe, and a pipe number less than {len(self.pipes)}"
            )
        return self.case.law.cell_pressure(
            self.tables.pipes[k], self.profiles[k], self.tables.profile, waves
        )

    def cell_pressures(self, waves: np.ndarray) -> np.ndarray:
        """Pressure [Pa] in the cells of all pipes from the sum of both waves [kg/s] : float64[cells].

        Raises FvsolveError if `waves` does not have a number for each cell.
        """
        waves = as_numbers("waves", waves)
        if waves.shape != (self.cells,):
            raise FvsolveError(
                f"waves has shape {waves.shape}; expected a number for each of the {self.cells} cells"
            )
        starts = list(self.profiles.values())
        return self.case.law.cell_pressures(self.tables.pipes, starts, self.tables.profile, waves)

    @functools.cached_property
    def cell_elevations(self) -> np.ndarray:
        """Elevation of the centres of the cells of all pipes : float64[cells] [m]."""
        elevations = np.concatenate([np.zeros(0), *(pipe.elevation for pipe in self.pipes)])
        elevations.flags.writeable = False
        return elevations

    def head(self, pressure: ArrayLike, elevation: ArrayLike) -> np.ndarray:
        """Head [m] of the case's fluid above datum: 0 at ambient pressure and datum level."""
        pressure, elevation = as_numbers("pressure", pressure), as_numbers("elevation", elevation)
        return self.case.law.head(pressure, elevation)

    @property
    def cavitates(self) -> bool:
        """True if the density law includes cavities."""
        return self.case.law.cavitates

    def fields(
        self, y: np.ndarray, out: np.ndarray, lines: dict[int, tuple] | None = None
    ) -> dict[str, Any]:
        """Values along pipes, in meshes and at nodes in a state [SI] : part -> quantity -> values of cells.

        Further keys: "nodes" : node -> quantity -> float; "points" : part whose mesh moves -> corners of its cells.
        out : array that `evaluate` returns; lines : pipe -> both waves of a delay line, as returned by `RunData.along`,
        zero if left out
        """
        y = self.checked_size(y)
        if np.shape(out) != (int(self.layout["size"]),):
            raise FvsolveError(
                f"out has shape {np.shape(out)}; expected the second array that Model.evaluate returns"
            )
        fields, law = {}, self.case.law
        for k, pipe in enumerate(self.pipes):
            row = self.tables.pipes[k]
            n, o = pipe.cells, row["y"]
            r, l = y[o : o + n], y[o + n : o + 2 * n]  # noqa: E741
            if row["cells"] == 0:
                r, l = (lines or {}).get(k, (np.zeros(n), np.zeros(n)))  # noqa: E741
            pressure, mass_flow = self.cell_pressure(k, r + l), row["flow"] + (r - l)
            flow = mass_flow / law.density(pressure)
            fields[pipe.name] = {
                "pressure": pressure,
                "head": self.head(pressure, pipe.elevation),
                "velocity": flow / law.area(row, pressure),
                "flow": flow,
                "min_pressure": pressure,
                "max_pressure": pressure,
            }
        nodes, at = self.tables.nodes, int(self.layout["pressure"])
        fields["points"], fields["nodes"] = {}, {}
        for i, name in enumerate(self.node_names):
            pressure = float(nodes[i]["pressure"] + out[at + i])
            head = float(self.head(pressure, self.elevation[name]))
            fields["nodes"][name] = {"pressure": pressure, "head": head}
        for feature in self.features:
            feature.add_fields(fields, self, y, out)
        return fields

    def contents(self, y: np.ndarray) -> tuple[float, float]:
        """Mass stored at the start, and its change from the start to state y [kg]."""
        y = self.checked_size(y)
        initial, change = self.initial_mass, 0.0
        pipes = self.tables.pipes
        columns = (pipes[name].tolist() for name in ("y", "cells", "dx", "speed", "elements"))
        for row, o, n, dx, speed, elements in zip(pipes, *columns, strict=True):
            change += float(np.sum(y[o : o + 2 * n])) * dx / speed if n else float(y[o])
            change += mass_in_creep(self.tables.floats, row, y) if elements else 0.0
        for at in self.tables.nodes["y"].tolist():
            change += float(y[at]) if at >= 0 else 0.0
        for feature in self.features:
            for at_start, gained in feature.masses(self, y):
                initial, change = initial + at_start, change + gained
        return initial, change

    @functools.cached_property
    def initial_mass(self) -> float:
        """Mass stored in pipes and nodes at the start [kg], without that of features."""
        mass, nodes = 0.0, self.tables.nodes
        for k, row in enumerate(self.tables.pipes):
            mass += self.case.law.mass_in_pipe(row, self.profiles[k], self.tables.profile)
        for stored in nodes["mass"][nodes["y"] >= 0].tolist():
            mass += stored
        return mass
