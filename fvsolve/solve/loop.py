"""The arrays that the compiled time loop works on, and one call of it. Knows no sink and no files."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.kernels.functions import leap_function
from fvsolve.model import Model
from fvsolve.steppers import erk
from fvsolve.steppers.tableau import Method, method_named

ROW_CAPACITY = 512
NO_LIMIT = 1e308


class Loop:
    """Buffers of one run of a model by one method; `run` steps on until there is something to do."""

    def __init__(self, model: Model, method: Method | None = None) -> None:
        numerics = model.case.numerics
        self.model, self.method = model, method or method_named(numerics.method)
        self.rhs, self.observe, self.record, self.events = model.functions()
        self.step = erk.compiled()
        leaps = leap_allowed(model, self.method)
        self.leap = leap_function(leaps)
        n, s, probes = model.y_size, self.method.stages, len(model.probes)
        ledgers = len(model.node_names)
        self.y, self.k, self.f_old = np.zeros((4, n)), np.zeros((s, n)), np.zeros(n)
        self.supply, self.ledger = np.zeros((s, ledgers)), np.zeros(2 * ledgers)
        sums = [*model.tables[rec.I_NODES]["y"], *model.tables[rec.I_BODIES]["y"]]  # travel is part of what is stored
        self.stored = np.array([at for at in sums if at >= 0], dtype=np.int64)
        self.carry = np.zeros(len(self.stored))
        self.out, self.out_row, self.values = model.new_out(), model.new_out(), np.zeros(probes)
        events = model.tables[rec.I_ARMED].size
        self.g, self.g_new = np.zeros(events), np.zeros(events)
        self.y_out = np.zeros(n)
        self.rows = np.zeros((ROW_CAPACITY, 1 + probes))
        self.memory, self.orders = np.zeros(erk.MEMORY), np.zeros(erk.ORDERS)
        self.flags = np.array([erk.FRESH, 0, 0, 1, 0], dtype=np.int64)
        self.orders[erk.STEP_MAX] = model.step_max if numerics.rtol is not None else NO_LIMIT
        self.orders[erk.STOP_AT], self.orders[erk.LEAPS] = NO_LIMIT, leaps
        for control, key in ((erk.COURANT, "courant"), (erk.FIXED_STEP, "step"), (erk.TOLERANCE, "rtol")):
            if getattr(numerics, key) is not None:
                self.orders[erk.CONTROL], self.orders[erk.SIZE] = control, getattr(numerics, key)

    @property
    def now(self) -> np.ndarray:
        """The present state y (a view)."""
        return self.y[self.flags[erk.NOW]]

    @property
    def t(self) -> float:
        """The present time [s]."""
        return float(self.memory[erk.T])

    def begin(self, end: float, stop_at: float) -> None:
        """Start a segment that ends at `end` [s]: no step is remembered across a kink."""
        self.memory[erk.STEP] = self.memory[erk.ERROR_OLD] = 0.0
        self.resume(end, stop_at)

    def resume(self, end: float, stop_at: float) -> None:
        """Go on in a segment that ends at `end` [s]; rows due from `stop_at` on are not written by the loop."""
        self.orders[erk.END], self.orders[erk.STOP_AT] = end, stop_at
        self.flags[erk.PHASE], self.flags[erk.BEHIND] = erk.FRESH, 0
        self.model.tables[rec.I_SETTINGS][0]["limit"] = end

    def run(self, budget: float) -> int:
        """Take at most `budget` steps; returns one of the codes of `steppers.erk`."""
        m = self.method
        self.orders[erk.BUDGET] = budget
        return self.step(
            self.rhs, self.leap, self.observe, self.record, self.events,
            self.model.handle, m.a, m.b, m.c, m.error, m.dense,
            max(m.error_order + 1, 1) if m.adaptive else m.order, m.first_same_as_last, self.orders, self.memory,
            self.flags, self.y, self.k, self.f_old, self.supply, int(self.model.layout["supply"]), self.ledger,
            self.model.scale, self.out, self.out_row, self.values, self.g, self.g_new,
            self.model.tables[rec.I_ARMED], self.stored, self.carry, self.y_out, self.rows,
        )  # fmt: skip

    def take_rows(self) -> np.ndarray:
        """Rows written since the last call, as a copy."""
        count = int(self.flags[erk.ROWS])
        self.flags[erk.ROWS] = 0
        return self.rows[:count].copy()

    def step_back(self) -> None:
        """Return to the state before the last step."""
        if self.flags[erk.BEHIND] == 1:
            self.memory[erk.T] -= self.memory[erk.LAST]
            self.memory[erk.UNBOOKED] = 0.0
            self.flags[erk.NOW], self.flags[erk.OLD] = self.flags[erk.OLD], self.flags[erk.NOW]
            self.flags[erk.BEHIND] = 0


def leap_allowed(model: Model, method: Method) -> bool:
    """Whether steps can be taken whole: upwind and Euler, pipes alone, no friction or a given factor."""
    settings, numerics = model.tables[rec.I_SETTINGS][0], model.case.numerics
    plain = np.isin(model.tables[rec.I_PIPES]["friction"], (rec.FRICTION_NONE, rec.FRICTION_FACTOR)).all()
    return bool(
        settings["law"] == rec.LAW_LINEAR and settings["scheme"] == rec.UPWIND and method.stages == 1
        and numerics.rtol is None and model.y_size == 2 * model.cells and plain
    )  # fmt: skip
