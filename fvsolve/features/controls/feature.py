"""Blocks of `controls` of a case: they read values of the case, and set schedules."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from importlib import import_module

import numpy as np

from fvsolve.case.controls import decision_order
from fvsolve.core.assembly.features import Feature, FeatureRun, with_slot
from fvsolve.core.assembly.lowering import Input, InputKind
from fvsolve.core.kernels import calls
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.features.controls import histories, lower
from fvsolve.features.controls.kernels import input_histories, tables
from fvsolve.features.controls.kernels.tables import (
    BLOCK_SETTINGS,
    BLOCK_VALUE,
    CONTROL,
    DRIVEN,
    HOOKS,
    SLOT,
)
from fvsolve.features.controls.rows import small_change
from fvsolve.parts.network_elements import network_of
from fvsolve.parts.schedule import BLOCK_PREFIX
from fvsolve.units import DIMENSIONS

PACKAGE = "fvsolve.features.controls.kernels"
QUANTITIES = ("output", "input", "error")  # in the order of `kernels.blocks`
FIRST = RhsTerms(
    prepare="blocks: begin_controls",
    move="blocks: decide_late",
    control_rates="blocks: control_rates",
    observe="blocks: restore_outputs",
    record="blocks: take_samples",
    package=PACKAGE,
)
FOR_EVENTS = RhsTerms(events="blocks: outputs_for_events", package=PACKAGE)
EVENTS = RhsTerms(events="blocks: control_events", package=PACKAGE)
LAST = RhsTerms(
    observe="blocks: observe_controls", record="blocks: record_controls", package=PACKAGE
)


class Controls(Feature, slot=1, wakes="section controls"):
    """Blocks of a case.

    table : blocks, in an order in which each comes after those that it reads at once; laws : modules of their laws
    sensors, sensor_table : probes that blocks read
    driven_rows : rows of tables that blocks drive before nodes are solved
    discrete : numbers that change at events and samples only, at the start
    timed : (flag, place in `discrete` of its last change)
    """

    single_thread_reason = "controls read the whole state"
    step_histories = ("histories",)

    def __init__(self, case, given_up=()) -> None:
        super().__init__(case, given_up)
        self.table, self.sensor_table = np.zeros(0, CONTROL), np.zeros(0, rec.PROBE)
        self.driven_rows, self.settings = np.zeros(0, DRIVEN), np.zeros(1, BLOCK_SETTINGS)
        self.sensors: list = []
        self.laws: list[str] = []
        self.discrete: list[float] = []
        self.timed: list[tuple[int, int]] = []
        self.hooks: list[np.ndarray] = []  # table of addresses, once it is compiled

    # build ----------

    def begin(self, draft) -> None:
        draft.schedules.blocks = {
            name: k for k, name in enumerate(decision_order(draft.case.controls))
        }

    def lower_last(self, draft) -> None:
        lower.lower_controls(draft, self)
        self.settings[0]["late"] = bool(self.table["late"].any())
        self.settings[0]["late_sensors"] = lower.has_late_sensors(draft, self)

    def law_row(self, rows) -> int:
        """Row of a law in the table of functions of blocks; added on first use."""
        name = rows.law.__name__
        self.laws += [] if name in self.laws else [name]
        return self.laws.index(name)

    @property
    def reads_solved(self) -> bool:
        return self.settings[0]["late_sensors"] == 1

    def rate(self, draft) -> float:
        return lower.control_rate(draft, self)

    def reserve(self, draft) -> None:
        blocks, sizes = len(self.table), draft.sizes
        sizes.out("control", 2 * blocks)
        sizes.run_array("applied", 2 * blocks + 2)

    def placed(self, draft) -> None:
        self.settings[0]["outputs"] = draft.sizes.offsets["control"]

    def balanced(self, draft, start):
        from fvsolve.features.controls.balance import Balance, set_starts

        balance = Balance(draft.case, draft, start)
        outputs, starts = balance.find()
        draft.check()
        found = balance.draft_with(outputs)
        set_starts(found, outputs, starts)
        found.check()
        return found

    def probe(self, draft, probe, row) -> bool:
        if probe.part != "controls":
            return False
        row["kind"], row["index"] = (
            BLOCK_VALUE,
            draft.schedules.blocks[probe.name.removeprefix(BLOCK_PREFIX)],
        )
        row["side"] = QUANTITIES.index(probe.quantity)
        return True

    def probe_rows(self) -> tuple[np.ndarray, list]:
        return self.sensor_table, self.sensors

    def copy_for(self, case) -> Controls:
        own = copy.copy(self)
        own.case, own.table, own.sensor_table = case, self.table.copy(), self.sensor_table.copy()
        own.discrete = list(self.discrete)
        return own

    def close(self, draft) -> None:
        for array in (self.table, self.sensor_table, self.driven_rows, self.settings):
            array.flags.writeable = False

    # model ----------

    def terms(self, model, cast) -> list[tuple[str, RhsTerms]]:
        decide = "blocks: decide_linear" if cast.family == "linear" else "blocks: decide_barotropic"
        found = [("first", FIRST._replace(decide=decide)), ("events", EVENTS), ("last", LAST)]
        return found + ([("sources", FOR_EVENTS)] if network_of(model) is not None else [])

    @property
    def packages(self) -> list[str]:
        return self.laws

    def block_hooks(self) -> np.ndarray:
        """Addresses of the functions of the laws of blocks : int64[laws, functions]; compiled at the first use."""
        if not self.hooks:
            table = calls.empty_calls(len(self.laws), len(HOOKS))
            for row, law in zip(table, map(import_module, self.laws), strict=True):
                for k, (hook, (letters, _)) in enumerate(HOOKS.items()):
                    if (function := calls.hook_of(law, hook, HOOKS)) is not None:
                        row[k] = calls.function_address(function, letters)
            self.hooks.append(table)
        return self.hooks[0]

    @property
    def delays(self) -> np.ndarray:
        """Delays of blocks with a delay [s], in the order of their histories."""
        return histories.delays_of(self.table)

    @property
    def shortest_delay(self) -> float:
        return float(self.delays.min(initial=np.inf))

    def refusal(self, function: str) -> str:
        if not self.delays.size:
            return ""
        text = f"{function}(t, y) is not defined for a case with a control of type delay: y has no earlier inputs"
        return f"{text}; expected a case without it, or rhs(State) instead of rhs(t, y)"

    def facts(self, model) -> dict:
        from fvsolve.features.controls.facts import block_facts

        return {"controls": block_facts(self, model)}

    def check_texts(self, model, facts: dict) -> list[str]:
        from fvsolve.features.controls.facts import block_text

        return [block_text(model.case, name, item) for name, item in facts["controls"].items()]

    def run(self, run_data) -> ControlRun:
        return ControlRun(self, run_data)

    def pattern(self, couplings):
        from fvsolve.features.controls.pattern import BlockCouplings

        return BlockCouplings(self, couplings)

    def inputs(self, model) -> dict[str, Input]:
        """Outputs of all blocks, at which they can be cut, and setpoints : name `controls.NAME.KEY` -> input."""
        inputs: dict[str, Input] = {}
        for k, (row, name) in enumerate(zip(self.table, model.block_names, strict=True)):
            first, output = model.case.controls[name].dimensions
            least, greatest = float(row["least"]), float(row["greatest"])
            unit, small = DIMENSIONS[output].si, small_change(output)
            span = (
                f", {least:g} to {greatest:g}"
                if math.isfinite(least) and math.isfinite(greatest)
                else ""
            )
            sort = InputKind(unit, f"a number [{unit}]{span}", least, greatest, small)
            inputs[f"{BLOCK_PREFIX}{name}.output"] = Input(sort, -1, held=(SLOT, k))
            if row["setpoint"] >= 0:
                sort = InputKind(
                    DIMENSIONS[first].si,
                    f"a number [{DIMENSIONS[first].si}]",
                    small=small_change(first),
                )
                inputs[f"{BLOCK_PREFIX}{name}.setpoint"] = Input(sort, int(row["setpoint"]))
        return inputs

    def to_hold(self) -> tuple[Controls, np.ndarray]:
        own = self.with_table(self.table.copy())
        values = own.table["held"]  # this view stays writable
        own.table.flags.writeable = False
        return own, values

    def with_table(self, table: np.ndarray) -> Controls:
        """Copy of the feature with other blocks."""
        own = copy.copy(self)
        own.table = table
        return own

    def remedy(self, event: str) -> str:
        if event.startswith(BLOCK_PREFIX):
            return "set the thresholds of the block farther apart, or give it a `filter`"
        return ""


class ControlRun(FeatureRun):
    """Numbers of blocks that change at events and samples, and histories of the inputs of blocks with a delay."""

    def __init__(self, feature: Controls, run_data) -> None:
        super().__init__(feature, run_data)
        self.discrete = np.array(feature.discrete, dtype=float)
        self.histories = np.zeros(histories.histories_size(feature.table))
        self.readings, self.sensing = (
            np.zeros(len(feature.sensor_table)),
            np.zeros(0, dtype=np.int64),
        )
        if self.readings.size:
            from fvsolve.core.kernels.table_handle import empty_handle

            self.sensing = empty_handle()
        histories.reset_histories(self.histories, feature.table)

    def tables(self, view: str = "") -> tables.BlockTables:
        own = self.feature
        # sensors do not read probes of blocks
        blocks = own.table[:0] if view == "sensing" else own.table
        return tables.BlockTables(
            blocks,
            own.sensor_table,
            own.driven_rows,
            own.settings,
            own.block_hooks(),
            self.discrete,
            self.histories,
            self.readings,
            self.sensing,
        )

    def views(self):
        return (
            {"sensing": (self.sensing, {"probes": self.feature.sensor_table})}
            if self.readings.size
            else {}
        )

    def arrays(self):
        return {"discrete": self.discrete, "histories": self.histories}

    def store(self, name: str, values: np.ndarray) -> bool:
        array = getattr(self, name)
        if array.size == values.size:
            array[:] = values
            return False
        setattr(self, name, values)
        return True

    def reset(self) -> None:
        self.discrete[:] = self.feature.discrete
        histories.reset_histories(self.histories, self.feature.table)

    def restore(self, memory) -> None:
        if self.discrete.size:
            self.discrete[:] = memory.get("discrete", self.discrete)
        if self.histories.size:
            self.run_data.set_array("histories", histories.stored_histories(memory))

    def capacity(self) -> float:
        if not self.histories.size:
            return np.inf
        longer = histories.with_space(self.histories, self.feature.table)
        if longer is not self.histories:
            self.run_data.set_array("histories", longer)
        return float(histories.steps_left(self.histories, self.feature.delays))

    def begin_at_break(self) -> None:
        if self.histories.size:
            self.histories[input_histories.BEGINS] = 1.0

    def flags_changed(self, t: float, before: np.ndarray) -> None:
        for flag, place in self.feature.timed:
            if self.run_data.armed[flag] != before[flag]:
                self.discrete[place] = t

    def failure(self, earliest: float) -> str:
        number, time = self.run_data.written.applied[-2:]
        if not number > 0.0 or not time >= earliest:
            return ""
        name = self.run_data.model.block_names[int(number) - 1]
        return f"the output of {BLOCK_PREFIX}{name} is not a finite number"


def blocks_of(model) -> np.ndarray:
    """Blocks of a model : CONTROL[blocks]."""
    own = with_slot(model.features, SLOT)
    return np.zeros(0, CONTROL) if own is None else own.table


def with_blocks(model, table: np.ndarray):
    """Copy of a model with other blocks."""
    own = with_slot(model.features, SLOT)
    return replace(
        model,
        features=[own.with_table(table) if other is own else other for other in model.features],
    )


def numbers_of(run_data) -> np.ndarray:
    """Numbers of blocks that change at events and samples only, in a run; empty without blocks."""
    own = with_slot(run_data.features, SLOT)
    return np.zeros(0) if own is None else own.discrete
