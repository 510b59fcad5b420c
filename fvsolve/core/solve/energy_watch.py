"""Check of the energy balance during a run: no network stores more than it had at the start and than it was supplied.

A wave that the step, the mesh or the coupling of a device amplifies gains energy that nothing supplies. The watch adds
up the supplied energy between a few states of the run. At a node it is the exact amount of mass from the ledger, times
the energy per mass, averaged over both states; for other sources it is the trapezoidal rule of their power. Between two
states a source may have any value of its range so far: this range bounds the error of the sum. It is zero for a
reservoir at constant pressure.

The intervals between two states are irregular, so that no oscillation has the same phase at all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fvsolve.core.kernels import energy_supply
from fvsolve.core.kernels.calls import POWER, compile_as
from fvsolve.core.kernels.energy_supply import (
    EXCESS,
    HEADER,
    INTERVAL,
    NEXT,
    PLACE,
    RATIO,
    TIME,
    T,
    WatchArrays,
)
from fvsolve.core.kernels.table_handle import boxed
from fvsolve.core.model import RunData
from fvsolve.core.model.compiled_case import once_per_model
from fvsolve.core.model.energy_accounts import Accounts, available_energy, terms_of
from fvsolve.core.model.model import Model
from fvsolve.core.steppers.run_handle import WATCH
from fvsolve.errors import FvsolveError, Notice
from fvsolve.jit import COMPILING, compile_once

FIRST_INTERVAL = 64.0  # steps between the first states; it doubles from time to time
# the same with sources other than nodes, whose powers have an unknown range at first
FIRST_BY_POWER = 8.0
# jumps of schedules, at each of which two states are needed, above which nothing is watched
MOST_JUMPS = 100
# Energy that may appear, as a fraction of the energy exchanged so far; times this plus a multiple of `rtol`.
ALLOWED = 0.05
TOLERANCES = 10.0
# rounding of states, relative to their scales, and of the available energy at the start
ROUNDING = 1e-10


class EnergyTerms(NamedTuple):
    """Constant data of the watch on a model, see also `kernels.energy_supply.WATCH_KINDS`.

    places : names of the parts of the accounts of stored energy; rows : numbers of rows of power and of stored energy
    exchanged : energy of the waves at the start [J]; rounding : energy of rounding errors [J]
    calls : as `kernels.compiled_functions.Functions.calls`, without the powers of pipes if no source needs them: they
    cost several right-hand sides
    """

    places: list[str]
    rows: tuple[int, int]
    sources: np.ndarray
    signs: np.ndarray
    nodes: np.ndarray
    spreads: np.ndarray
    holders: np.ndarray
    holding_signs: np.ndarray
    exchanged: float
    rounding: float
    calls: np.ndarray


@once_per_model
def energy_terms(model: Model) -> EnergyTerms | None:
    """Terms of the energy balance of a model; None if its energy is not computed (see `Accounts`)."""
    run_data = RunData(model)
    try:
        accounts = Accounts(run_data)
        available = sum(available_energy(model).values())
    except FvsolveError:
        return None
    supplying = [accounts.accounts[number] for number in accounts.of("supplied")]
    source, power_rows, signs = terms_of(supplying)
    count = len(model.tables.nodes)
    first = [account.rows[0] for account in supplying]
    nodes = np.array([row // 2 if row < 2 * count else -1 for row in first], dtype=np.int64)
    held, stored_rows, holding_signs = accounts.stored_terms
    rounding = ROUNDING * available + energy_of_rounding(run_data, accounts)
    return EnergyTerms(
        [account.place for account in accounts.stored_accounts],
        (accounts.power_count, accounts.stores),
        np.column_stack([source, power_rows]).reshape(-1),
        signs,
        nodes,
        np.array([spread(model, int(i)) for i in nodes], dtype=np.float64),
        np.column_stack([held, stored_rows]).reshape(-1),
        holding_signs,
        sum(part.energy_of_waves(part.deviations(model.start)) for part in model.meshed),
        rounding,
        calls_without_network(model)
        if (power_rows[nodes[source] < 0] >= accounts.network_rows).all()
        else model.functions.calls,
    )


def calls_without_network(model: Model) -> np.ndarray:
    """Addresses of the functions of a model, without those that fill the powers of pipes, valves and columns."""
    table = model.functions.calls.copy()
    first = len(model.functions.cast.functions("network_power"))
    row = table[POWER, first:].copy()
    table[POWER] = 0
    table[POWER, : row.size] = row
    return table


def energy_of_rounding(run_data: RunData, accounts: Accounts) -> float:
    """Energy that a change of all states of the start by rounding stores [J]."""
    model = run_data.model
    t = run_data.model.case.numerics.start
    out = run_data.model.new_out()
    none, rows = np.zeros(0), np.zeros((2, accounts.stores))
    for y, stored in zip(
        (model.start.copy(), model.start + ROUNDING * model.scale), rows, strict=True
    ):
        model.functions.rhs(t, y, none, out, run_data.handle)
        accounts.stored(t, y, none, out, run_data.handle, stored)
    return float(np.abs(rows[1] - rows[0]).sum())


def spread(model: Model, i: int) -> float:
    """Range of the energy per mass that the schedule of node number i gives [J/kg]; 0 without one."""
    if i < 0:
        return 0.0
    node = model.case.places[model.node_names[i].removesuffix(".inside")]
    head = schedule_range(getattr(node, "head", None)) * model.case.gravity
    pressure = schedule_range(getattr(node, "pressure", None)) / model.case.properties.density
    return max(head, pressure)


@compile_once
def watch_state():
    """Compiled `kernels.energy_supply.watch_state`."""
    return compile_as(energy_supply.watch_state, WATCH)


class EnergyWatch:
    """Sum of supplied energy at some states of a run, and the greatest energy that appeared without supply.

    It is empty for a case whose energy is not computed (see `Accounts`), for more than 100 jumps of schedules, and for
    ranks of MPI.
    restart_data : float64[...]  see `kernels.energy_supply`
    """

    def __init__(self, run_data: RunData, has_ranks: bool) -> None:
        model = self.model = run_data.model
        self.restart_data = np.zeros(0)
        numerics = model.case.numerics
        if has_ranks or sum(jump for _, jump in model.breaks) > MOST_JUMPS or not model.y_size:
            return
        self.terms = terms = energy_terms(model)
        if terms is None:
            return
        self.run_data = RunData(model)
        for own in self.run_data.features:
            own.for_energy()
        count, masses, (powers, stores) = terms.nodes.size, len(model.tables.nodes), terms.rows
        self.restart_data = np.zeros(HEADER + 4 * count + 2 * masses + stores)
        parts = np.split(
            self.restart_data, np.cumsum([HEADER, count, count, count, count, masses, masses])
        )
        self.record, self.supplied, _, least, greatest, self.entered, self.left, _ = parts
        least[:], greatest[:] = np.inf, -np.inf
        self.record[NEXT] = self.record[INTERVAL] = (
            FIRST_INTERVAL if (terms.nodes >= 0).all() else FIRST_BY_POWER
        )
        self.record[T] = np.nan
        allowed = ALLOWED + TOLERANCES * (numerics.rtol or 0.0)
        limits = np.array([allowed, terms.exchanged, terms.rounding])
        self.arrays = WatchArrays(
            np.zeros(0, dtype=np.int64),
            np.zeros(model.y_size),
            model.new_out(),
            np.zeros(powers),
            np.zeros(stores),
            np.zeros(len(terms.places)),
            np.zeros(count),
            terms.sources,
            terms.signs,
            terms.nodes,
            terms.spreads,
            terms.holders,
            terms.holding_signs,
            limits,
            self.restart_data,
        )
        self.watch_state = watch_state()
        self.link()

    def link(self) -> None:
        """Make the handle of the watch from the present arrays of its run data."""
        own = self.run_data.linked_handle(
            self.run_data.written, (self.terms.calls, self.model.functions.hooks)
        )
        self.arrays = self.arrays._replace(own=own if COMPILING else boxed(own))
        self.handle = energy_supply.handle_of_watch(self.arrays)

    @property
    def empty(self) -> bool:
        """True if the run is not watched."""
        return self.restart_data.size == 0

    @property
    def has_valid_place(self) -> bool:
        """True if the restart data name a part that stores energy."""
        return self.empty or 0.0 <= self.record[PLACE] < max(1, len(self.terms.places))

    def prepare(self, loop) -> float:
        """Let the time loop of a `RunLoop` watch the next state, or return the number of steps up to it.

        Threads and ranks do not watch states: their loop has to stop there for `check`.
        """
        if self.empty:
            return np.inf
        self.follow(loop)
        if loop.team is not None:
            return max(1.0, self.record[NEXT] - loop.state["steps"])
        loop.stepper.watcher, loop.stepper.watch, loop.control["watch_at"] = (
            self.watch_state,
            self.handle,
            self.record[NEXT],
        )
        return np.inf

    def follow(self, loop) -> None:
        """Give arrays that have grown in a `RunLoop` the same size here."""
        own = self.run_data.arrays()
        for name, array in loop.run_data.arrays().items():
            if array.size != own[name].size:
                self.run_data.set_array(name, array.copy())
                self.link()

    def begin(self, loop) -> None:
        """Start from the present state of a `RunLoop`, at the start of the run or after a jump of a schedule."""
        if not self.empty:
            self.add_state(loop, True)

    def check(self, loop) -> None:
        """Add the energy supplied since the last state if a state is due, and compare it with the stored energy."""
        if self.empty or not loop.t > self.record[T]:  # false before the first state
            return
        ends = loop.t >= min(float(loop.control["stop_at"]), self.model.case.numerics.end)
        if (ends or loop.state["steps"] >= self.record[NEXT]) and np.isfinite(loop.now).all():
            self.add_state(loop, False)

    def add_state(self, loop, begins: bool) -> None:
        """Pass the present state of a `RunLoop` to `watch_state`; begins : see there."""
        self.follow(loop)
        state, stepper = loop.state, loop.stepper
        self.watch_state(
            float(state["t"]),
            float(state["steps"]),
            loop.now.copy(),
            stepper.ledger,
            loop.run_data.handle,
            self.handle,
            begins,
        )

    def notice(self) -> Notice | None:
        """Notice if more energy appeared than the method's own error explains, otherwise None."""
        if self.empty or not self.record[RATIO] > 1.0:
            return None
        amount = self.model.case.amount
        place = self.terms.places[int(self.record[PLACE])]
        excess, when = float(self.record[EXCESS]), self.model.case.moment(float(self.record[TIME]))
        limit = excess / float(self.record[RATIO])
        text = (
            f"{place}: at {when} the case stores {amount(excess, 'energy', 4)} more than it had at the "
            f"start and than its sources supplied, most of it here; {amount(limit, 'energy', 4)} at most are "
            "errors of steps; the numbers are not to be trusted; halve the step or try another method"
        )
        return Notice("energy", place, text, None, excess, limit, False)


def schedule_range(schedule) -> float:
    """Range of the values of a schedule in its own unit; 0 for a constant, and where no table of values exists."""
    values = getattr(schedule, "value", None)
    return float(np.ptp(values)) if isinstance(values, np.ndarray) and values.size else 0.0
