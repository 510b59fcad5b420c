"""Schedules: values that may change with time, and the keys that declare them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import value as val
from fvsolve.parts.date_keys import DATE_KEYS, TimeColumns
from fvsolve.parts.table_model import SHEET_KEY, keys_json, read_keys
from fvsolve.parts.value import (
    NEEDED,
    Choice,
    Number,
    Quantity,
    Range,
    ReadContext,
    Rows,
    Text,
    Value,
    ValueFault,
)
from fvsolve.units import (
    DIMENSIONS,
    UNITS,
    begins_as_quantity,
    expected,
    is_number_with_unit,
    may_be_gauge,
    show,
)

if TYPE_CHECKING:
    from fvsolve.parts.formula_program import Program

KINDS = ("linear", "step", "smooth")
AMPLITUDE_DIMENSIONS = {
    "pressure": "pressure_drop"
}  # dimension of an amplitude, if the zero point of the dimension matters

BLOCK_PREFIX = "controls."  # prefix of the name of a block, as in the key `input` of another block
UNKNOWN = ""  # dimension of an input or output of a block, not known because of a fault elsewhere
SIGNS = "*+()^<>="  # of a formula
# dimensions that a control may drive only within `limits`
BOUNDED = ("pressure", "head", "angular_velocity")


def is_formula(given: Any) -> bool:
    """True if a value may be a formula of time: a text with the name t or a call of a function, and no quantity."""
    if not isinstance(given, str) or is_number_with_unit(given):
        return False
    from fvsolve.parts.formula_program import TIME_FORMULA  # only now: most cases have no formula

    return TIME_FORMULA.search(given) is not None


@dataclass(frozen=True, eq=False)
class Schedule:
    """Value over time: constant before the first and after the last entry; at a jump, the value after the jump holds.

    kind : constant | linear | step | smooth (monotone cubic) | ramp | harmonic | formula | control
    time, value : float64[n]  breakpoints [s] and values there [SI, pressures absolute]; a constant has one entry; a
    harmonic schedule or a formula has its minimum and maximum, at infinite times, the output of a control its limits
    exponent : for a ramp, value = v1 + (v0 - v1) (1 - s)^exponent, with v0 and v1 its first and last value, and s from
    0 to 1 between its two times
    wave : (mean, amplitude, period [s], phase [rad]) of a harmonic schedule,
    value = mean + amplitude sin(2 pi t / period + phase)
    program : formula of the time, as steps
    origin : table as in a case file, in SI; None for a constant that is stated as a number
    """

    kind: str
    time: np.ndarray
    value: np.ndarray
    exponent: float = 1.0
    origin: Any = field(default=None, repr=False)
    wave: tuple[float, ...] = ()
    program: Program | None = None

    def __post_init__(self) -> None:
        for name in ("time", "value"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Schedule):
            return NotImplemented
        if self.kind in ("formula", "control"):
            return self.kind == other.kind and self.origin == other.origin
        mine = (self.kind, self.exponent, self.wave)
        theirs = (other.kind, other.exponent, other.wave)
        return (
            mine == theirs
            and np.array_equal(self.time, other.time)
            and np.array_equal(self.value, other.value)
        )

    def __hash__(self) -> int:
        return hash(
            (self.kind, self.exponent, self.wave, self.time.tobytes(), self.value.tobytes())
        )

    @property
    def first(self) -> float:
        """Value before and at the first entry [SI]; of a harmonic schedule its minimum."""
        return float(self.value[0])

    @property
    def constant(self) -> bool:
        """True if the schedule is a constant."""
        return self.kind == "constant"

    def table(self) -> Any:
        """Number or table as in a case file, in SI."""
        return self.first if self.origin is None else self.origin


def constant(value: float) -> Schedule:
    """Schedule of a constant value [SI]."""
    return Schedule("constant", np.zeros(1), np.array([value]))


def signal_fault(given: Any) -> str:
    """Text of the fault of a signal that follows a control; "" for other signals."""
    if not (isinstance(given, dict) and "control" in given):
        return ""
    name = given["control"] if isinstance(given["control"], str) else "NAME"
    return f'{show(given)} is not a signal with values; write {{ control = "{name}" }} at the keys that use it'


@dataclass(frozen=True)
class Scheduled(Value):
    """Value of a case file that may change with time: number, text, table, file, ramp, wave or signal."""

    dimension: str
    range: Range = val.anything
    about: str = ""
    usual: val.UsualRange | None = None
    changes: str = val.PROFILE
    moves: bool = False  # True if it moves a body or a wall, so that its slopes are needed
    needs_unit: bool = False  # True if a file must state the unit of the values

    def read(self, given: Any, setting: ReadContext) -> Schedule:
        if isinstance(given, Schedule):
            return given
        if is_formula(given):
            return self._read_formula({"formula": given}, setting, given)
        if not isinstance(given, dict):
            return constant(self._read_number(given, setting))
        if "signal" in given:
            return self._read_signal(given, setting)
        if "sum" in given:
            return self._read_sum(given, setting)
        if "formula" in given:
            return self._read_formula(given, setting, given)
        if "control" in given:
            return self._read_control(given, setting)
        if "file" in given:
            return self._read_file(given, setting)
        if any(key in given for key in ("start", "duration", "exponent")):
            return self._read_ramp(given, setting)
        if any(key in given for key in ("mean", "amplitude", "period", "phase")):
            return self._read_wave(given, setting)
        if given and not given.keys() & self.forms["table"].keys():
            known = list(dict.fromkeys(key for form in self.forms.values() for key in form))
            raise ValueFault(
                [((key,), f"unknown key{val.key_hint(str(key), known)}") for key in given]
            )
        return self._read_table(given, setting)

    @cached_property
    def forms(self) -> dict[str, dict[str, tuple[Value, Any]]]:
        """Forms of a schedule table: name of the form -> key -> (declaration, default)."""
        item, kind = (self.dimension, self.range), (Choice("kind of schedule", KINDS), "linear")
        return {
            "table": {"time": (Rows("time"), NEEDED), "value": (Rows(*item), NEEDED), "kind": kind},
            "ramp": {
                "start": (Quantity("time"), NEEDED),
                "duration": (Quantity("time", val.nonnegative), NEEDED),
                "value": (Rows(*item, length=2), NEEDED),
                "exponent": (Number(val.positive), 1.0),
            },
            "wave": {
                "mean": (Quantity(self.dimension), NEEDED),
                "amplitude": (
                    Quantity(AMPLITUDE_DIMENSIONS.get(self.dimension, self.dimension)),
                    NEEDED,
                ),
                "period": (Quantity("time", val.positive), NEEDED),
                "phase": (Quantity("angle"), 0.0),
            },
            "file": {
                "file": (Text(), NEEDED),
                "time": (TimeColumns(), None),
                "value": (Text(), None),
                "unit": (Text(), ""),
                **SHEET_KEY,
                **DATE_KEYS,
                "kind": kind,
            },
            "signal": {"signal": (Text(), NEEDED), "factor": (Quantity(self.dimension), None)},
            "sum": {"sum": (Summands(replace(self, range=val.anything)), NEEDED)},
            "control": {"control": (Text(), NEEDED)},
            "formula": {"formula": (Text(), NEEDED), "unit": (Text(), "")},
        }

    @property
    def takes(self) -> str:
        return f"{Quantity(self.dimension, self.range).takes}; schedule"

    def json(self) -> dict[str, Any]:
        return {"anyOf": [Quantity(self.dimension).json(), *map(keys_json, self.forms.values())]}

    def _read_number(self, given: Any, setting: ReadContext) -> float:
        try:
            return Quantity(self.dimension, self.range).read(given, setting)
        except ValueError:
            if (
                not isinstance(given, str)
                or begins_as_quantity(given)
                or not any(sign in given for sign in SIGNS)
            ):
                raise
            # raises for a text that is not a formula
            self._read_formula({"formula": given}, setting, given)
            text = f"{show(given)} is neither a number with a unit nor a formula of t"
            raise ValueError(f"{text}; {expected(self.dimension)}") from None

    def _read_table(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        values = read_keys(given, self.forms["table"], setting)
        t = values["time"]
        v = values["value"]
        kind = values["kind"]
        if len(t) != len(v):
            raise ValueFault(
                [
                    (
                        ("value",),
                        f"has length {len(v)}, but `time` has length {len(t)}; expected equal lengths",
                    )
                ]
            )
        try:
            val.check_increasing(t, given["time"], "times")
        except ValueError as error:
            raise ValueFault([(("time",), str(error))]) from None
        if len(v) == 1:
            return constant(v[0])
        return Schedule(kind, t, v, origin={"time": list(t), "value": list(v), "kind": kind})

    def _read_ramp(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        values = read_keys(given, self.forms["ramp"], setting)
        start, duration, v, exponent = (
            values[key] for key in ("start", "duration", "value", "exponent")
        )
        origin = {**values, "value": list(v)}
        if start + duration == start:  # zero duration: a jump
            return Schedule("step", (start - 1.0 - abs(start), start), v, origin=origin)
        return Schedule("ramp", (start, start + duration), v, exponent, origin)

    def _read_wave(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        values = read_keys(given, self.forms["wave"], setting)
        mean, amplitude, period, phase = (
            values[key] for key in ("mean", "amplitude", "period", "phase")
        )
        reach = mean - abs(amplitude), mean + abs(amplitude)
        try:
            for bound in reach:
                self.range.check(bound, bound)
        except ValueError as error:
            raise ValueFault(
                [(("amplitude",), f"gives values from {reach[0]:g} to {reach[1]:g}: {error}")]
            ) from None
        return Schedule(
            "harmonic", (-np.inf, np.inf), reach, 1.0, values, (mean, amplitude, period, phase)
        )

    def _read_file(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        from fvsolve.parts.csv_rows import (
            copy_name,
            find_file,
            read_columns,
            split_header,
            stated_keys,
        )

        values = read_keys(given, self.forms["file"], setting)
        kind = values["kind"]
        try:
            path = find_file(values["file"], setting)
            unit = values["unit"]
            t, v, *headers = read_columns(path, values, self.dimension, setting)
            if self.needs_unit and not unit and not split_header(headers[1])[1]:
                unit = DIMENSIONS[self.dimension].example.split()[-1]
                text = f"{path.name}, column {show(headers[1])} has no unit; expected for example `unit = {show(unit)}`"
                raise ValueError(text)
            val.check_increasing(t, t.tolist(), f"{path.name}: times")
            for x in v.tolist():
                self.range.check(x, x)
        except ValueError as error:
            raise ValueFault([(("file",), str(error))]) from None
        origin = {
            "file": copy_name(path, setting),
            "time": headers[0],
            "value": headers[1],
            "kind": kind,
        }
        origin |= ({"unit": unit} if unit else {}) | stated_keys(values)
        return Schedule(kind if len(v) > 1 else "constant", t, v, origin=origin)

    def _read_signal(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        setting.lookups += 1
        values = read_keys(given, self.forms["signal"], setting)
        name, factor = values["signal"], values["factor"]
        if name not in setting.signals:
            near, names = did_you_mean(name, setting.signals), listing(setting.signals) or "none"
            raise ValueFault(
                [(("signal",), f"no signal named {show(name)}{near}; [signals] has {names}")]
            )
        shared = setting.signals[name]
        if text := signal_fault(shared):
            raise ValueFault([((val.ROOT, "signals", name), text)])
        if isinstance(shared, dict) and ("signal" in shared or "sum" in shared):
            raise ValueFault(
                [
                    (
                        ("signal",),
                        f"signal {show(name)} refers to another signal; expected a signal with values",
                    )
                ]
            )
        try:
            if factor is None:
                schedule = self.read(shared, setting)
            else:  # its numbers, which many parts may scale, are read once
                if name not in setting.scaled:
                    setting.scaled[name] = Scheduled("number").read(shared, setting)
                schedule = setting.scaled[name]
        except ValueError as error:
            raise ValueFault(val.faults_of(error, val.ROOT, "signals", name)) from None
        setting.used[name] = schedule.table()
        if factor is None:
            return replace(schedule, origin={"signal": name})
        return self._scaled(schedule, factor, name)

    def _scaled(self, schedule: Schedule, factor: float, name: str) -> Schedule:
        """Schedule of the numbers of a signal times `factor` [SI]; name : name of the signal"""
        if schedule.kind == "formula":
            text = f"signal {show(name)} is a formula, which takes no factor"
            raise ValueFault([(("factor",), f"{text}; write the factor in the formula")])
        value = factor * schedule.value
        try:
            for bound in (value.min(), value.max()):
                self.range.check(float(bound), float(bound))
        except ValueError as error:
            raise ValueFault(
                [(("factor",), f"gives values from {value.min():g} to {value.max():g}: {error}")]
            ) from None
        if schedule.kind == "harmonic":
            mean, amplitude, *rest = schedule.wave
            schedule = replace(schedule, wave=(factor * mean, factor * amplitude, *rest))
            value = np.sort(value)
        return replace(schedule, value=value, origin={"signal": name, "factor": factor})

    def _read_sum(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        setting.lookups += 1
        base = DIMENSIONS[self.dimension].base or self.dimension
        offsets = any(unit.offset for unit in UNITS.values() if unit.dimension == base)
        if offsets or may_be_gauge(self.dimension):
            text = f"a {self.dimension} takes no sum, because its units count from different zeros"
            raise ValueFault([(("sum",), f"{text}; expected one table of values")])
        try:
            schedule = total(read_keys(given, self.forms["sum"], setting)["sum"])
            for bound in (schedule.value.min(), schedule.value.max()):
                self.range.check(float(bound), float(bound))
        except ValueFault:
            raise
        except ValueError as error:
            raise ValueFault([(("sum",), str(error))]) from None
        return schedule

    def _read_formula(self, given: dict[str, Any], setting: ReadContext, origin: Any) -> Schedule:
        setting.lookups += 1  # its range depends on the times of the run
        values = read_keys(given, self.forms["formula"], setting)
        from fvsolve.parts.formula_program import program_in

        place = ("formula",) if isinstance(origin, dict) else ()
        try:
            program = program_in(
                values["unit"], self.dimension, values["formula"], (), setting.ambient
            )
        except ValueFault as error:
            raise ValueFault(
                [(keys if place else (), text) for keys, text in error.faults]
            ) from None
        if setting.span is None:
            return Schedule(
                "formula", (-np.inf, np.inf), (-np.inf, np.inf), origin=origin, program=program
            )
        times, found = program.samples(*setting.span)
        bad = ~np.isfinite(found)
        bad |= (found < self.range.least) | (found > self.range.greatest)
        bad |= self.range.open & (found == self.range.least)
        if bad.any():
            k = int(np.argmax(bad))
            state = f"is {found[k]:.6g}, out of range; expected a value {self.range}"
            state = "is not a finite number" if not np.isfinite(found[k]) else state
            raise ValueFault(
                [(place, f"{show(values['formula'])} at t = {times[k]:.6g} s {state}")]
            )
        self._check_between(program, times, place)
        reach = float(found.min()), float(found.max())
        return Schedule("formula", (-np.inf, np.inf), reach, origin=origin, program=program)

    def _check_between(self, program: Program, times: np.ndarray, place: tuple[str, ...]) -> None:
        """Raise ValueFault for a pole of a formula, or a value out of range, between samples at the given times.

        place : keys of the formula
        """
        from fvsolve.parts.formula_intervals import find_outside

        if text := program.pole_fault(float(times[0]), float(times[-1])):
            raise ValueFault([(place, text)])
        if (
            t := find_outside(program.bounds, times, self.range.least, self.range.greatest)
        ) is not None:
            text = f"is {program.value(t):.6g}, out of range; expected a value {self.range}"
            raise ValueFault([(place, f"{show(program.text)} at t = {t:.9g} s {text}")])

    def _read_control(self, given: dict[str, Any], setting: ReadContext) -> Schedule:
        setting.lookups += 1
        name = given["control"]
        # known also if the table has further, invalid keys
        if isinstance(name, str) and name in setting.controls:
            setting.driven.setdefault(name, []).append((self.dimension, self.range))
        read_keys(given, self.forms["control"], setting)
        if name not in setting.controls:
            bare = name.removeprefix("controls.")
            near = (
                f"; did you mean {show(bare)}?"
                if bare in setting.controls
                else did_you_mean(name, setting.controls)
            )
            names = listing(setting.controls) or "none"
            raise ValueFault(
                [(("control",), f"no control named {show(name)}{near}; [controls] has {names}")]
            )
        if self.moves:
            text = "cannot follow a control, because the motion needs its slopes; expected a schedule or a formula of t"
            raise ValueFault([((), f"{text}, or a control of the force or torque that moves it")])
        block = setting.controls[name]
        limits = block.get("limits") if isinstance(block, dict) else None
        reach = (self.range.least, self.range.greatest)
        needed = self.dimension in BOUNDED or self.range.open
        if needed and limits is None and isinstance(block, dict) and not np.isfinite(reach).all():
            text = f"{DIMENSIONS[self.dimension].words} needs bounds; give `limits` in [controls.{name}]"
            raise ValueFault([(("control",), text)])
        try:
            reach = Rows(self.dimension, length=2).read(limits, setting)
        except ValueError:  # none, or a fault of the block
            if needed:
                raise ValueFault([]) from None  # the block has the fault
        return Schedule("control", (-np.inf, np.inf), reach, origin={"control": name})


@dataclass(frozen=True)
class Summands(Value):
    """List of schedules whose values are added: constants, and tables or signals of steps or of straight lines."""

    item: Scheduled
    schema: ClassVar[dict[str, Any]] = {
        "type": "array",
        "items": {"type": ["number", "string", "object"]},
        "minItems": 1,
    }

    def read(self, given: Any, setting: ReadContext) -> list[Schedule]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(
                f"{show(given)} is not a list of schedules; expected for example two signals with factors"
            )

        def read(entry: Any) -> Schedule:
            schedule = self.item.read(entry, setting)
            if schedule.kind not in ("constant", "step", "linear"):
                text = f"is a schedule of the kind {schedule.kind}, which takes no sum"
                raise ValueError(
                    f"{text}; expected constants, and tables of steps or of straight lines"
                )
            return schedule

        return list(val.read_each(enumerate(given), read).values())


def total(parts: list[Schedule]) -> Schedule:
    """Sum of constants and of tables, all of steps or all of straight lines. Raises ValueError if there are both."""
    kinds = sorted({part.kind for part in parts} - {"constant"})
    origin = {"sum": [part.table() for part in parts]}
    if len(kinds) > 1:
        raise ValueError("has tables of steps and of straight lines; expected tables of one kind")
    if not kinds:
        return Schedule("constant", (0.0,), (sum(part.first for part in parts),), origin=origin)
    times = np.unique(np.concatenate([part.time for part in parts if not part.constant]))
    value = np.zeros(times.size)
    for part in parts:
        if part.kind == "linear":
            value += np.interp(times, part.time, part.value)
        else:
            value += part.value[np.maximum(np.searchsorted(part.time, times, side="right") - 1, 0)]
    return Schedule(kinds[0], times, value, origin=origin)
