"""Tables of blocks of `controls`, and their balance at the start.

A block decides before the nodes are solved if it drives the network. All inputs that it passes on at once must then
follow from states alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from fvsolve.assembly.control_rows import BlockStart, control_rows_of, small_change
from fvsolve.assembly.schedule_tables import value_at
from fvsolve.case.controls import Block, decision_order
from fvsolve.errors import listing
from fvsolve.kernels import dtypes as rec
from fvsolve.model.probe_tables import fill_probes
from fvsolve.units import show

STATE_KINDS = (rec.LEVEL, rec.POSITION, rec.VELOCITY, rec.PISTON_POSITION, rec.PISTON_VELOCITY)
STORED = (rec.FIXED, rec.TANK, rec.CHAMBER, rec.MOVING, rec.VESSEL)
TURNS = 30  # Newton iterations of the balance
DIFFERENCE = 1e-6  # change of an output for differences, relative to its range
ROUNDING = 1e-11  # relative change of an input by rounding
SETTLED = 1e-9  # greatest last change of an output that is balanced, relative to its range
BALANCED = 1e-12  # change of an output in the last iteration, relative to its range


def number_blocks(draft) -> None:
    """Number the blocks, so that schedules can refer to them: each after those that it needs at once."""
    draft.schedules.blocks = {name: k for k, name in enumerate(decision_order(draft.case.controls))}


def lower_controls(draft) -> None:
    """Fill the tables of blocks, of sensors and of driven rows; add the states of blocks."""
    blocks = draft.schedules.blocks
    if not blocks:
        return
    probes = {item.text: item for block in draft.case.controls.values() for item in block.inputs
              if not isinstance(item, str)}  # fmt: skip
    draft.sensors = list(probes.values())
    draft.sensor_table = fill_probes(draft, draft.sensors)
    table = draft.control_table = np.zeros(len(blocks), rec.CONTROL)
    driven = list(driven_rows(draft))
    early = early_blocks(draft, driven)
    draft.driven_table = np.array([(kind, row) for kind, row, _ in driven], rec.DRIVEN)
    for (name, _), row in zip(blocks.items(), table, strict=True):
        block = draft.case.controls[name]
        fill_block(draft, name, block, list(probes), row)
        row["late"] = name not in early
    check_order(draft, early)


def fill_block(draft, name: str, block: Block, sensors: list[str], row) -> None:
    """Fill the row of a block, except what depends on the start; sensors : texts of the probes of all sensors."""
    control, rows = block.control, control_rows_of(type(block.control))
    filters = len(block.inputs) if control.filter is not None else 0
    small = [small_change(dimension) for dimension in block.dimensions]
    if all(map(math.isfinite, block.limits)):
        small[1] = min(small[1], 0.1 * (block.limits[1] - block.limits[0]))
    names = [f"controls.{name}.filtered{k or ''}" for k in range(filters)]
    names += [f"controls.{name}.{state}" for state in rows.states(control)]
    scales = [small[0]] * filters + rows.scales(control, tuple(small))
    row["y"] = draft.states(names, scales) if names else -1
    row["filters"], row["filter_rate"] = filters, 1.0 / control.filter if filters else 0.0
    row["hooks"], row["data"] = draft.hooks(rows), len(draft.floats)
    draft.floats += rows.numbers(draft, name, block)
    row["at_once"] = control.passes_at_once
    row["inputs"], row["input_count"] = len(draft.integers), len(block.inputs)
    draft.integers += [-1 - draft.schedules.blocks[item] if isinstance(item, str) else sensors.index(item.text)
                       for item in block.inputs]  # fmt: skip
    row["starts"] = len(draft.floats)
    draft.floats += [0.0] * len(block.inputs)
    setpoint = control.setpoint_schedule
    row["setpoint"] = -1 if setpoint is None else draft.schedules.add(setpoint)
    row["least"], row["greatest"], row["held"] = *block.limits, np.nan


def control_rate(draft) -> float:
    """Greatest constant rate of filters and states of blocks [1/s]."""
    blocks = draft.case.controls.values()
    own = [control_rows_of(type(block.control)).rate(block.control) for block in blocks]
    return max([0.0, *own, *draft.control_table["filter_rate"]])


def driven_rows(draft) -> Iterator[tuple[int, int, int]]:
    """Yield the rows of tables that blocks drive before the nodes are solved: (kind, row, number of the block)."""
    followers = {index: int(draft.schedules.rows[first][2])
                 for index, (first, pieces) in enumerate(draft.schedules.records) if pieces == 0}  # fmt: skip
    linear = draft.case.law.linear
    for k, row in enumerate(draft.valve_table):
        if row["schedule"] in followers and row["device"] < 0:
            yield rec.DRIVEN_VALVE, k, followers[row["schedule"]]
    for k, row in enumerate(draft.device_table):
        valve = draft.valve_table[row["valve"]]["schedule"] if row["valve"] >= 0 else -1
        for block in {followers[index] for index in (row["schedule"], valve) if index in followers}:
            yield rec.DRIVEN_DEVICE, k, block
    for i, row in enumerate(draft.node_table):
        if row["schedule"] in followers:
            if row["kind"] == rec.FIXED or linear:
                yield rec.DRIVEN_NODE, i, followers[row["schedule"]]
            else:
                yield rec.DRIVEN_NODE, -1, followers[row["schedule"]]


def early_blocks(draft, driven: list[tuple[int, int, int]]) -> set[str]:
    """Names of the blocks that decide before the nodes are solved, because they drive the network or such a block."""
    names = list(draft.schedules.blocks)
    early = {names[block] for _, _, block in driven}
    while more := {other for name in early for other in draft.case.controls[name].blocks_passed} - early:
        early |= more
    return early


def is_known_early(draft, row, probe) -> bool:
    """True if the value of a sensor follows from states alone, before the nodes are solved."""
    kind = row["kind"]
    if kind == rec.PRESSURE:
        return draft.node_table[row["index"]]["kind"] in STORED
    if kind in (rec.PIPE_PRESSURE, rec.PIPE_FLOW):
        return row["side"] == 0 and draft.pipe_table[row["index"]]["delay"] < 0
    if kind == rec.DEVICE_VALUE:
        name, part, device = draft.devices[row["index"]]
        return probe.quantity in device.states_of(draft, name, part)
    return kind in STATE_KINDS or kind == rec.CELL_FIELD


def check_order(draft, early: set[str]) -> None:
    """Add a fault for each block that drives the network, and passes on at once what only the solved network tells."""
    rows = dict(zip([probe.text for probe in draft.sensors], draft.sensor_table, strict=True))
    for name in early:
        block = draft.case.controls[name]
        names = list(getattr(block.control, "inputs", ()))
        for k, probe in enumerate(block.inputs if block.control.passes_at_once else ()):
            if not isinstance(probe, str) and not is_known_early(draft, rows[probe.text], probe):
                text = f"{probe.text} may follow at once from what the control drives, a loop without a state"
                place = f"inputs.{names[k]}" if names else "input"
                draft.fault(f"controls.{name}.{place}", f"{text}; give [controls.{name}] a `filter`")


# start --------------------------------------------------------------------------------------------------------------


class Balance:
    """Outputs of all blocks at the start, such that loops without `initial` are at rest.

    make : function of a `ModelDraft` -> draft with the steady start, and its model
    """

    def __init__(self, case, packed, make) -> None:
        self.case, self.packed, self.make = case, packed, make
        self.blocks = {name: case.controls[name] for name in packed.schedules.blocks}
        self.free = [k for k, block in enumerate(self.blocks.values()) if block.control.initial is None]
        low, high = packed.control_table["least"], packed.control_table["greatest"]
        small = [small_change(block.dimensions[1]) for block in self.blocks.values()]
        finite = np.isfinite(low) & np.isfinite(high)
        self.range = np.where(finite, high - low, small)
        self.low, self.high = low, high
        self.stated: set[int] = set()  # as `stated_inputs`

    def guess(self) -> np.ndarray:
        """First outputs: as stated, or in the middle of the limits, or zero."""
        middle = [0.5 * (a + b) if math.isfinite(a) and math.isfinite(b) else min(max(0.0, a), b)
                  for a, b in zip(self.low, self.high, strict=True)]  # fmt: skip
        stated = [block.control.initial for block in self.blocks.values()]
        return np.array([m if s is None else s for m, s in zip(middle, stated, strict=True)])

    def draft_with(self, outputs: np.ndarray):
        """Copy of the tables before the start with these outputs of blocks."""
        draft = self.packed.copy_for(self.case)
        schedules, pieces = draft.tables.schedules, draft.tables.pieces.copy()
        for first, count in schedules.tolist():
            if count == 0:
                pieces[first, 5] = outputs[int(pieces[first, 2])]
        pieces.flags.writeable = False
        draft.schedules = replace(draft.schedules, known_values={})
        draft.tables = draft.tables._replace(pieces=pieces)
        draft.tables.controls["start"] = draft.tables.controls["held"] = outputs
        return draft

    def starts(self, outputs: np.ndarray) -> tuple[Any, list[BlockStart], np.ndarray]:
        """(model, values of each block, rates of its first input) at the start with these outputs."""
        model = self.make(self.draft_with(outputs))
        t = self.case.numerics.start
        values, rates = sensor_values(model, t)
        starts, slopes = [], []
        for block, row, output in zip(self.blocks.values(), model.tables.controls, outputs, strict=True):
            codes = model.tables.integers[row["inputs"] :][: row["input_count"]]
            inputs = tuple(float(values[code] if code >= 0 else outputs[-1 - code]) for code in codes)
            setpoint = value_at(model.tables, row["setpoint"], t, np.inf) if row["setpoint"] >= 0 else 0.0
            starts.append(BlockStart(self.case, block, t, inputs, float(setpoint), float(output)))
            slopes.append(float(rates[codes[0]]) if len(codes) and codes[0] >= 0 else 0.0)
        return model, starts, np.array(slopes)

    def residual(self, start: BlockStart) -> float:
        """Residual of a block by its own law."""
        control = start.block.control
        return control_rows_of(type(control)).residual(control, start)

    def residuals(self, starts: list[BlockStart], slopes: np.ndarray) -> np.ndarray:
        """Residual of each block without `initial`; of a block in `stated` it is the rate of its input."""
        return np.array([slopes[k] if k in self.stated else self.residual(starts[k]) for k in self.free])

    def stated_inputs(self, outputs: np.ndarray, starts: list[BlockStart]) -> set[int]:
        """Numbers of integrating blocks without `initial` whose first input at the start depends on no output."""
        found = {k for k in self.free if starts[k].block.control.integrates}
        for other in self.free if found else ():
            moved = self.starts(self.moved(outputs, other)[0])[1]
            for k in list(found):
                before, after = starts[k].inputs[0], moved[k].inputs[0]
                if abs(after - before) > ROUNDING * abs(before):
                    found.discard(k)
        return found

    def find(self) -> tuple[np.ndarray, list[BlockStart]]:
        """Balanced outputs, and the values of all blocks. Adds a fault if there is no balance."""
        outputs = self.guess()
        starts = self.starts(outputs)[1]
        if self.infinite(starts):
            outputs = self.passed_on(starts)
            starts = self.starts(outputs)[1]
        if not self.infinite(starts):
            self.stated = self.stated_inputs(outputs, starts)
            lost = self.iterate(outputs)
            starts = self.starts(outputs)[1]
            lost += [k for k in self.stated if k not in lost and self.residual(starts[k]) != 0.0]
            if lost and not self.infinite(starts):
                self.refuse(sorted(lost), starts)
        self.refuse_infinite(starts)
        return outputs, starts

    def iterate(self, outputs: np.ndarray) -> list[int]:
        """Iterate the outputs to their balance; returns the numbers of blocks that no output balances."""
        step = np.zeros(len(self.free))
        for _ in range(TURNS if self.free else 0):
            _, starts, slopes = self.starts(outputs)
            residual = self.residuals(starts, slopes)
            matrix = np.array([self.slope(outputs, k, residual) for k in self.free]).T
            if not residual.any():
                return []
            lost = [k for k, column in zip(self.free, matrix.T, strict=True) if not column.any()]
            if lost or not np.isfinite(matrix).all() or np.linalg.matrix_rank(matrix) < len(self.free):
                return lost or self.free
            step, before = -np.linalg.solve(matrix, residual), outputs.copy()
            outputs[self.free] = np.clip(outputs[self.free] + step, self.low[self.free], self.high[self.free])
            if np.all(np.abs(outputs - before) <= BALANCED * self.range):
                break
        far = [k for k, change in zip(self.free, step, strict=True) if abs(change) > SETTLED * self.range[k]]
        at_limits = np.isin(outputs, (self.low, self.high))  # an integral that its limits stop is not at rest
        return [k for k in far if not at_limits[k] or list(self.blocks.values())[k].control.integrates]

    def passed_on(self, starts: list[BlockStart]) -> np.ndarray:
        """Outputs in which each block that does not integrate has the value that its inputs give."""
        outputs, numbers = np.array([start.output for start in starts]), {name: k for k, name in enumerate(self.blocks)}
        for k in self.free:
            start, block = starts[k], starts[k].block
            if not block.control.integrates:
                inputs = (outputs[numbers[item]] if isinstance(item, str) else known
                          for item, known in zip(block.inputs, start.inputs, strict=True))  # fmt: skip
                value = self.residual(start._replace(inputs=tuple(map(float, inputs)))) + start.output
                outputs[k] = min(max(value, self.low[k]), self.high[k]) if math.isfinite(value) else outputs[k]
        return outputs

    def moved(self, outputs: np.ndarray, k: int) -> tuple[np.ndarray, float]:
        """Copy of the outputs with a small change of that of block k, and this change."""
        change, moved = DIFFERENCE * self.range[k], outputs.copy()
        change = -change if outputs[k] + change > self.high[k] else change
        moved[k] += change
        return moved, change

    def slope(self, outputs: np.ndarray, k: int, residual: np.ndarray) -> np.ndarray:
        """Derivative of all residuals by the output of block k."""
        moved, change = self.moved(outputs, k)
        return (self.residuals(*self.starts(moved)[1:]) - residual) / change

    def refuse(self, numbers: list[int], starts: list[BlockStart]) -> None:
        """Add a fault for blocks that no output balances."""
        names = [list(self.blocks)[k] for k in numbers]
        block, start, state = starts[numbers[0]].block, starts[numbers[0]], ""
        if block.control.integrates and self.residual(start) != 0.0:
            unit, setpoint = block.dimensions[0], block.control.setpoint_schedule
            found, set_value = (self.case.amount(x, unit).removesuffix(" -") for x in (start.inputs[0], start.setpoint))
            state = f": the input is {found}, but {'not 0' if setpoint is None else f'the setpoint {set_value}'}"
        text = f"no output of {listing(names)} balances the start{state}"
        self.packed.fault(f"controls.{names[0]}", f"{text}; give the key `initial`, the output at the start")

    def infinite(self, starts: list[BlockStart]) -> list[int]:
        """Numbers of the blocks whose output at the start is not finite."""
        return [k for k, start in enumerate(starts) if not math.isfinite(self.residual(start))]

    def refuse_infinite(self, starts: list[BlockStart]) -> None:
        """Add a fault for each block whose output at the start is not finite."""
        for k in self.infinite(starts):
            name, start = list(self.blocks)[k], starts[k]
            control = start.block.control
            known = {"t": start.time, **dict(zip(getattr(control, "inputs", ("input",)), start.inputs, strict=True))}
            formula = getattr(control, "formula", None)
            text = "the output" if formula is None else show(formula)
            text = f"{text} is not a finite number at the start, with {listing_of(known)}; expected finite values"
            self.packed.fault(f"controls.{name}{'.formula' * (formula is not None)}", text)


def listing_of(values: dict[str, float]) -> str:
    """Text of names and their values, such as "t = 0, h = 4"."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


def sensor_values(model, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Values of all sensors at the start, and their rates : float64[sensors] each [SI, SI/s]."""
    with model.run_data() as data:
        y = model.start.copy()
        rates, out = data.evaluate(t, y, np.inf)
        value = read_sensors(model, data, t, y, out)
        step = 1e-6 / max(1e-300, float(np.max(np.abs(rates) / model.scale, initial=0.0)))
        moved = y + step * rates
        change = read_sensors(model, data, t, moved, data.evaluate(t, moved, np.inf)[1]) - value
        return value, change / step if np.any(rates) else np.zeros_like(value)


def read_sensors(model, data, t: float, y: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Values of all sensors at (t, y) : float64[sensors]."""
    values = np.zeros(len(model.tables.sensors))
    if values.size:
        model.functions.observe(t, y, out, data.written.sensing, values)
    return values


def set_starts(draft, outputs: np.ndarray, starts: list[BlockStart]) -> None:
    """Write the values of all blocks at the start to the tables of a draft."""
    tables = draft.tables
    for (name, k), start in zip(draft.schedules.blocks.items(), starts, strict=True):
        control, row = draft.case.controls[name].control, tables.controls[k]
        row["start"], row["setpoint_start"], row["held"] = outputs[k], start.setpoint, np.nan
        tables.floats[row["starts"] :][: len(start.inputs)] = start.inputs
        control_rows_of(type(control)).begin(control, start, tables.floats[row["data"] :])
