"""Balance of blocks at the start: outputs with which loops of blocks and the case are at rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fvsolve.case.case_notices import unread_text
from fvsolve.core.assembly.features import with_slot
from fvsolve.core.assembly.schedule_tables import value_at
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import Notice, listing
from fvsolve.features.controls.kernels.tables import SLOT
from fvsolve.features.controls.rows import BlockStart, StaticRows, control_rows_of, small_change
from fvsolve.units import show

TURNS = 30  # Newton iterations of the balance
DIFFERENCE = 1e-6  # change of an output for differences, relative to its range
MOST_STATES = 32  # a sensor of more states has no rate
RANK = 1e-9  # singular values below this share of the greatest are zero
# change of an output below which it is rounding if it no longer falls, relative to its range
ROUNDING = 1e-8
BESIDE = 1e-7  # distance of the residuals of the last step, relative to the range
# residual of an integrating block at its limit that stops it, over its change with the outputs
STOPPED = 1e-6
# error of the output of a block without states above which its start is refused, relative to its range
UNBALANCED = 1e-6
BALANCED = 4e-16  # change of an output in the last iteration, relative to its range: rounding


class Balance:
    """Outputs of all blocks at the start, such that loops without `initial` are at rest.

    Each evaluation of the start solves the steady state again. So only blocks in a loop with the scene are sought by
    Newton's method; other outputs follow from stated outputs, levels and time, or have no effect on the scene.
    make : function of a `ModelDraft` -> draft with the steady start, and its model
    unstated : numbers of the blocks without `initial`; free : those of them that Newton's method seeks
    """

    def __init__(self, case, packed, make) -> None:
        self.case, self.packed, self.make, own = (
            case,
            packed,
            make,
            with_slot(packed.features, SLOT),
        )
        self.own = own
        self.blocks = {name: case.controls[name] for name in packed.schedules.blocks}
        self.unstated = [
            k
            for k, block in enumerate(self.blocks.values())
            if block.control.initial_output is None
        ]
        self.free = self.sought()
        low, high = own.table["least"], own.table["greatest"]
        small = [small_change(block.dimensions[1]) for block in self.blocks.values()]
        finite = np.isfinite(low) & np.isfinite(high)
        self.range = np.where(finite, high - low, small)
        self.low, self.high = low, high
        self.stated: set[int] = set()  # as `stated_inputs`

    def sought(self) -> list[int]:
        """Numbers of the blocks without `initial` whose outputs affect the scene and depend on it.

        A block that integrates counts as affecting it, and so do all blocks before it: its output is found by the rate
        of its input, which blocks with `initial` pass on. The levels of tanks at the start do not depend on blocks.
        """
        blocks = list(self.blocks.values())
        numbers = {name: k for k, name in enumerate(self.blocks)}
        static = [control_rows_of(type(block.control)).is_static(block.control) for block in blocks]
        rows = dict(
            zip([probe.text for probe in self.own.sensors], self.own.sensor_table, strict=True)
        )
        tables = self.packed.tables
        ahead = {
            int(tables.pieces[first, 2]) for first, count in tables.schedules.tolist() if count == 0
        }
        static = [own and not block.followed for own, block in zip(static, blocks, strict=True)]
        ahead = (ahead | {k for k in self.unstated if not static[k]}) & {*self.unstated}
        acting: set[int] = set()
        while ahead:
            acting |= ahead
            ahead = {numbers[name] for k in ahead for name in blocks[k].blocks_read} & {
                *self.unstated
            } - acting
        before = {k for k in self.unstated if blocks[k].control.integrates}
        while before:
            acting |= before
            before = {numbers[name] for k in before for name in blocks[k].blocks_read} - acting
        acting &= {*self.unstated}
        known = {*range(len(blocks))} - {*self.unstated}
        for k in self.unstated * static.count(True):
            own = (
                item in numbers and numbers[item] in known
                if isinstance(item, str)
                else rows[item.text]["kind"] == rec.LEVEL
                for item in blocks[k].inputs
            )
            if k not in known and static[k] and all(own):
                known.add(k)
        return sorted(acting - known)

    def guess(self) -> np.ndarray:
        """First outputs: as stated, or in the middle of the limits, or 0; 1 for integrals without a unit."""
        usual = [
            float(block.control.integrates and block.dimensions[1] == "number")
            for block in self.blocks.values()
        ]
        middle = [
            0.5 * (a + b) if math.isfinite(a) and math.isfinite(b) else min(max(value, a), b)
            for a, b, value in zip(self.low, self.high, usual, strict=True)
        ]
        stated = [block.control.initial_output for block in self.blocks.values()]
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
        table = with_slot(draft.features, SLOT).table
        table["start"] = table["held"] = outputs
        return draft

    def starts(
        self, outputs: np.ndarray, by_rates: bool = False
    ) -> tuple[list[BlockStart], np.ndarray]:
        """(values of each block, rates of change of its first input) at the start with these outputs.

        by_rates : False for rates of zero
        """
        model = self.make(self.draft_with(outputs))
        t, codes = self.case.numerics.start, []
        values, slopes = sensor_values(model, t, by_rates)
        starts = []
        for block, row, output in zip(self.blocks.values(), blocks_of(model), outputs, strict=True):
            codes.append(model.tables.integers[row["inputs"] :][: row["input_count"]].tolist())
            inputs = tuple(
                float(values[code] if code >= 0 else outputs[-1 - code]) for code in codes[-1]
            )
            setpoint = (
                value_at(model.tables, row["setpoint"], t, t) if row["setpoint"] >= 0 else 0.0
            )
            starts.append(BlockStart(self.case, block, t, inputs, float(setpoint), float(output)))
        rates: dict[int, float] = {}

        def input_rates(k: int) -> list[float]:
            return [
                float(slopes[code]) if code >= 0 else output_rate(-1 - code) for code in codes[k]
            ]

        def output_rate(k: int) -> float:
            if k not in rates:
                control, rates[k] = starts[k].block.control, 0.0  # of a cycle of blocks
                rates[k] = control_rows_of(type(control)).output_rate(
                    control, starts[k], input_rates(k)
                )
            return rates[k]

        first = np.array([input_rates(k)[0] if codes[k] else 0.0 for k in range(len(starts))])
        return starts, first

    def residuals(self, outputs: np.ndarray, by_rates: bool) -> np.ndarray:
        """Residuals of all blocks without `initial`, each zero for a block at rest : float64[n].

        by_rates : True to append the rate of the first input of each block that integrates. It decides where the input
        is stated, such as the level of a tank, and agrees with the setpoint.
        """
        starts, slopes = self.starts(outputs, by_rates)
        controls = [block.control for block in self.blocks.values()]
        own = [
            control_rows_of(type(controls[k])).residual(controls[k], starts[k]) for k in self.free
        ]
        return np.array(
            own + ([slopes[k] for k in self.free if controls[k].integrates] if by_rates else [])
        )

    def residual(self, start: BlockStart) -> float:
        """Residual of a block by its own law."""
        control = start.block.control
        return control_rows_of(type(control)).residual(control, start)

    def find(self) -> tuple[np.ndarray, list[BlockStart]]:
        """Balanced outputs, and the values of all blocks. Adds a fault if there is no balance."""
        outputs = self.guess()
        starts = self.settled(outputs, self.starts(outputs)[0])
        if self.infinite(starts):
            outputs = self.passed_on(starts)
            starts = self.settled(outputs, self.starts(outputs)[0])
        if self.free and not self.infinite(starts):
            lost = self.iterate(outputs)
            starts = self.settled(outputs, self.starts(outputs)[0])
            lost = lost or self.unbalanced(starts)
            if lost and not self.infinite(starts):
                self.refuse(lost, starts)
        self.refuse_infinite(starts)
        self.note_limited(starts)
        return outputs, starts

    def settled(self, outputs: np.ndarray, starts: list[BlockStart]) -> list[BlockStart]:
        """Values of all blocks after the outputs of blocks that are not sought follow their inputs, in `outputs`.

        Where such outputs change the scene, the start is evaluated once more: the levels that they read stay.
        """
        numbers, before = {name: k for k, name in enumerate(self.blocks)}, outputs.copy()
        given = [k for k in self.unstated if k not in self.free]
        for _ in given:
            earlier = outputs.copy()
            for k in given:
                starts[k] = self.with_inputs(starts[k], outputs, numbers)
                value = self.residual(starts[k]) + starts[k].output
                if math.isfinite(value):
                    outputs[k] = min(max(value, self.low[k]), self.high[k])
                    starts[k] = starts[k]._replace(output=float(outputs[k]))
            if np.array_equal(earlier, outputs):
                break
        # also of blocks with `initial`
        starts = [self.with_inputs(start, outputs, numbers) for start in starts]
        pieces, schedules = self.packed.tables.pieces, self.packed.tables.schedules.tolist()
        driving = [int(pieces[first, 2]) for first, count in schedules if count == 0]
        return self.starts(outputs)[0] if np.any(before[driving] != outputs[driving]) else starts

    def with_inputs(
        self, start: BlockStart, outputs: np.ndarray, numbers: dict[str, int]
    ) -> BlockStart:
        """Values of a block with the outputs of others as inputs; numbers : name of a block -> its number"""
        inputs = (
            outputs[numbers[item]] if isinstance(item, str) else known
            for item, known in zip(start.block.inputs, start.inputs, strict=True)
        )
        return start._replace(inputs=tuple(map(float, inputs)))

    def polish(
        self, outputs: np.ndarray, matrix: np.ndarray, acts: np.ndarray, by_rates: bool
    ) -> None:
        """Take a last step from residuals on both sides: beside its root a rate of a tank is set to zero as rounding.

        matrix : rows of the slopes of the residuals that outputs change, times the ranges; acts : True for these
        """
        around = np.zeros(acts.sum())
        for side in (1.0, -1.0):
            moved = outputs.copy()
            moved[self.free] += side * BESIDE * self.range[self.free]
            if np.any(moved < self.low) or np.any(moved > self.high):
                return
            around += 0.5 * self.residuals(moved, by_rates)[acts]
        step = (
            np.linalg.lstsq(matrix, -around, RANK)[0]
            if np.isfinite(around).all()
            else np.zeros(len(self.free))
        )
        if np.all(np.abs(step) < ROUNDING):
            outputs[self.free] += step * self.range[self.free]

    def stopped(self, outputs: np.ndarray, residual: np.ndarray) -> list[int]:
        """Numbers of the blocks whose integral a limit stops; residual : relative to its change with the outputs."""
        rows = np.abs(residual) > STOPPED
        found = (k for k in self.blocks_of_rows(rows) if outputs[k] in (self.low[k], self.high[k]))
        return [k for k in found if list(self.blocks.values())[k].control.integrates]

    def iterate(self, outputs: np.ndarray) -> list[int]:
        """Iterate the outputs to their balance; returns the numbers of blocks that no output balances."""
        by_rates, size_before = False, math.inf
        for _ in range(TURNS if self.free else 0):
            residual = self.residuals(outputs, by_rates)
            matrix = np.array([self.slope(outputs, k, residual, by_rates) for k in self.free]).T
            size = np.max(np.abs(matrix), axis=1)
            acts = size > 0.0
            if not np.isfinite(matrix).all():
                return self.free
            if residual[~acts].any():  # no output changes it
                return self.blocks_of_rows((residual != 0.0) & ~acts)
            before = outputs.copy()
            rank = self.step(
                outputs, matrix[acts] / size[acts, None], residual[acts] / size[acts], acts
            )
            moved = float(np.max(np.abs(outputs - before) / self.range))
            rounding, size_before = 0.5 * size_before < moved < ROUNDING, moved
            if moved <= BALANCED or rounding:
                size_before = math.inf
                if rank == len(self.free):
                    self.polish(outputs, matrix[acts], acts, by_rates)
                    return self.stopped(
                        outputs, np.divide(residual, size, where=acts, out=np.zeros(size.size))
                    )
                if by_rates:
                    return self.free
                by_rates = True
        return self.free

    def step(
        self, outputs: np.ndarray, matrix: np.ndarray, residual: np.ndarray, acts: np.ndarray
    ) -> int:
        """Take a Newton step in `outputs`, in which blocks stop at their limits; returns the rank of the matrix.

        The residual of a block at its limit need not be zero. The step of the other blocks counts with this limit, not
        with the output beyond it.
        matrix, residual : slopes times the ranges, and residuals, of the rows `acts`
        """
        rows = np.flatnonzero(acts)
        at_limit = np.zeros(len(self.free), bool)
        change = np.zeros(len(self.free))
        first_rank = -1
        while True:
            # The first rows are those of the blocks themselves, in their order.
            own = np.append(at_limit, np.zeros(acts.size - at_limit.size, bool))
            kept = ~own[rows]
            right = -residual - matrix[:, at_limit] @ change[at_limit]
            change[~at_limit], _, rank, _ = np.linalg.lstsq(
                matrix[kept][:, ~at_limit], right[kept], RANK
            )
            first_rank = rank if first_rank < 0 else first_rank
            moved = outputs[self.free] + change * self.range[self.free]
            limited = np.clip(moved, self.low[self.free], self.high[self.free])
            beyond = (limited != moved) & ~at_limit
            if not beyond.any():
                outputs[self.free] = limited
                return first_rank
            change[beyond] = ((limited - outputs[self.free]) / self.range[self.free])[beyond]
            at_limit |= beyond

    def unbalanced(self, starts: list[BlockStart]) -> list[int]:
        """Numbers of the blocks without states whose output is not the one that their inputs give within its limits."""
        found = []
        for k in self.free:
            control = starts[k].block.control
            if control_rows_of(type(control)).is_static(control):
                value = self.residual(starts[k]) + starts[k].output
                error = abs(min(max(value, self.low[k]), self.high[k]) - starts[k].output)
                if error > UNBALANCED * (self.range[k] + abs(starts[k].output)):
                    found.append(k)
        return found

    def blocks_of_rows(self, chosen: np.ndarray) -> list[int]:
        """Numbers of the blocks of chosen rows of the residuals : bool[rows]."""
        blocks = list(self.blocks.values())
        rows = [*self.free, *(k for k in self.free if blocks[k].control.integrates)]
        return sorted({k for k, is_chosen in zip(rows, chosen, strict=False) if is_chosen})

    def passed_on(self, starts: list[BlockStart]) -> np.ndarray:
        """Outputs in which each block that does not integrate has the value that its inputs give."""
        outputs = np.array([start.output for start in starts])
        numbers = {name: k for k, name in enumerate(self.blocks)}
        for k in self.unstated:
            start, block = starts[k], starts[k].block
            if not block.control.integrates:
                inputs = (
                    outputs[numbers[item]] if isinstance(item, str) else known
                    for item, known in zip(block.inputs, start.inputs, strict=True)
                )
                value = (
                    self.residual(start._replace(inputs=tuple(map(float, inputs)))) + start.output
                )
                outputs[k] = (
                    min(max(value, self.low[k]), self.high[k])
                    if math.isfinite(value)
                    else outputs[k]
                )
        return outputs

    def slope(
        self, outputs: np.ndarray, k: int, residual: np.ndarray, by_rates: bool
    ) -> np.ndarray:
        """Derivative of all residuals by the output of block k, times its range."""
        change = (
            -DIFFERENCE if outputs[k] + DIFFERENCE * self.range[k] > self.high[k] else DIFFERENCE
        )
        moved = outputs.copy()
        moved[k] += change * self.range[k]
        return (self.residuals(moved, by_rates) - residual) / change

    def refuse(self, numbers: list[int], starts: list[BlockStart]) -> None:
        """Add a fault for each block that no output balances; first for blocks whose state at the start is unknown.

        numbers : blocks that may lack a balance; if no input tells which, they have one fault
        """
        names, left = list(self.blocks), []
        for k in range(len(names)):
            control = starts[k].block.control
            if text := control_rows_of(type(control)).fault(control, starts[k]):
                self.packed.fault(f"controls.{names[k]}", text)
            elif k in numbers and names[k] in self.case.unread_blocks:
                self.packed.fault(f"controls.{names[k]}", unread_text(names[k]))
            elif k in numbers:
                left.append(k)
        states = {k: state for k in left if (state := self.unbalanced_state(starts[k]))}
        groups = [([k], state) for k, state in states.items()] or [(left, "")] * bool(left)
        for group, state in groups:
            text = f"no output of {listing([names[k] for k in group])} balances the start{state}"
            self.packed.fault(
                f"controls.{names[group[0]]}",
                f"{text}; give the key `initial`, the output at the start",
            )

    def unbalanced_state(self, start: BlockStart) -> str:
        """Text of the input and setpoint of an integrating block that differ; "" for another block."""
        block = start.block
        if not block.control.integrates or self.residual(start) == 0.0:
            return ""
        unit, setpoint = block.dimensions[0], block.control.setpoint_schedule
        found, set_value = (
            self.case.amount(x, unit).removesuffix(" -") for x in (start.inputs[0], start.setpoint)
        )
        if setpoint is not None and found == set_value:
            return ""
        return f": the input is {found}, but {'not 0' if setpoint is None else f'the setpoint {set_value}'}"

    def note_limited(self, starts: list[BlockStart]) -> None:
        """Add a notice of each block without `limits` whose inputs give an output beyond those of the driven keys."""
        for k in self.unstated:
            control = starts[k].block.control
            start = starts[k]
            name = list(self.blocks)[k]
            if isinstance(control_rows_of(type(control)), StaticRows) and control.limits is None:
                given = self.residual(start) + start.output
                if not self.low[k] <= given <= self.high[k]:
                    unit = start.block.dimensions[1]
                    given, output = (
                        self.case.amount(x, unit).removesuffix(" -") for x in (given, start.output)
                    )
                    text = f"its output at the start, {given}, is beyond its limits, those of the driven keys"
                    text = f"controls.{name}: {text}; it is limited to {output}"
                    self.packed.warnings.append(Notice("start", f"controls.{name}", text))

    def infinite(self, starts: list[BlockStart]) -> list[int]:
        """Numbers of the blocks whose output at the start is not finite."""
        return [k for k, start in enumerate(starts) if not math.isfinite(self.residual(start))]

    def refuse_infinite(self, starts: list[BlockStart]) -> None:
        """Add a fault for each block whose output at the start is not finite."""
        for k in self.infinite(starts):
            name, start = list(self.blocks)[k], starts[k]
            control = start.block.control
            known = {
                "t": start.time,
                **dict(zip(getattr(control, "inputs", ("input",)), start.inputs, strict=True)),
            }
            formula = getattr(control, "formula", None)
            text = "the output" if formula is None else show(formula)
            text = f"{text} is not a finite number at the start, with {listing_of(known)}; expected finite values"
            self.packed.fault(f"controls.{name}{'.formula' * (formula is not None)}", text)


def listing_of(values: dict[str, float]) -> str:
    """Text of names and their values, such as "t = 0, h = 4"."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


def blocks_of(model) -> np.ndarray:
    """Blocks of a model : CONTROL[blocks]."""
    return with_slot(model.features, SLOT).table


def sensor_values(model, t: float, with_rates: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Values of all sensors at the start, and their rates : float64[sensors] each [SI, SI/s].

    The rate is the sum over the states that a sensor reads of slope times rate, so that it is exactly zero at rest. It
    is left at zero for a sensor of many states, which the steady start determines, and without `with_rates`.
    """
    from fvsolve.core.model.jacobian_pattern import (
        Couplings,  # it imports SciPy, which a run without controls does not need
    )

    sensors = with_slot(model.features, SLOT).sensor_table
    with model.run_data() as data:
        y = model.start.copy()
        rates, out = data.evaluate(t, y, t)
        value, slopes = read_sensors(model, data, t, y, out), np.zeros(len(sensors))
        pattern = with_slot(Couplings(model).features, SLOT) if with_rates else None
        for k, row in enumerate(sensors if with_rates else ()):
            for j in states if (states := pattern.sensor(row)).size <= MOST_STATES else ():
                high, low = y.copy(), y.copy()
                high[j] += DIFFERENCE * model.scale[j]
                low[j] -= DIFFERENCE * model.scale[j]
                ends = [
                    read_sensors(model, data, t, moved, data.evaluate(t, moved, t)[1])[k]
                    for moved in (high, low)
                    if rates[j] != 0.0
                ]
                slopes[k] += (ends[0] - ends[1]) / (high[j] - low[j]) * rates[j] if ends else 0.0
        return value, slopes


def read_sensors(model, data, t: float, y: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Values of all sensors at (t, y) : float64[sensors]."""
    data.handle  # noqa: B018, it fills the handle of the view
    own = with_slot(data.features, SLOT)
    values = np.zeros(own.readings.size)
    if values.size:
        model.functions.observe(t, y, out, own.sensing, values)
    return values


def before_limits(own, control, start: BlockStart, row) -> BlockStart:
    """Values of a block at the start, with its output before its limits if these limit it.

    own : conversion of its type; row : row of the block
    """
    if (
        control.initial_output is not None
        or control.integrates
        or start.output not in (row["least"], row["greatest"])
    ):
        return start
    beyond = own.residual(control, start)
    rounding = ROUNDING * (abs(start.output) + abs(row["greatest"] - row["least"]))
    return start if abs(beyond) <= rounding else start._replace(output=start.output + beyond)


def set_starts(draft, outputs: np.ndarray, starts: list[BlockStart]) -> None:
    """Write the values of all blocks at the start to the tables of a draft."""
    tables, feature = draft.tables, with_slot(draft.features, SLOT)
    for (name, k), start in zip(draft.schedules.blocks.items(), starts, strict=True):
        control, row = draft.case.controls[name].control, feature.table[k]
        row["start"], row["setpoint_start"], row["held"] = outputs[k], start.setpoint, np.nan
        tables.floats[row["starts"] :][: len(start.inputs)] = start.inputs
        own, numbers = control_rows_of(type(control)), tables.floats[row["data"] :]
        own.begin(control, before_limits(own, control, start, row), numbers)
        if row["period"] > 0.0:
            feature.discrete[row["memory"]] = outputs[k]
        draft.start_flags |= own.flags_at_start(control, start, numbers)
        if text := own.fault(control, start):
            draft.fault(f"controls.{name}", text)
