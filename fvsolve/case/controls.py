"""Reading of `[controls]`: types, inputs, units, limits and order of blocks.

The unit of the first input of a block is that of the probe or block that it reads, the unit of its output that of the
keys that it drives. A block without `limits` has the range of these keys.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from fvsolve.case.probe import Probe, read_probe
from fvsolve.case.reading import Reading, followers
from fvsolve.case.resource_checks import name_faults
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.schedule import BLOCK_PREFIX, UNKNOWN
from fvsolve.parts.value import Range
from fvsolve.units import DIMENSIONS, show

if TYPE_CHECKING:
    from fvsolve.parts.control import Control

# dimension of an error
DIFFERENCES = {"pressure": "pressure_drop", "gauge_pressure": "pressure_drop"}


@dataclass(frozen=True)
class Block:
    """Block of a case: its keys, what it reads, its limits, and the dimensions of its first input and of its output.

    inputs : probes, and names of other blocks, in the order of its inputs
    """

    control: Control
    inputs: tuple[Probe | str, ...]
    limits: tuple[float, float]
    dimensions: tuple[str, str]

    @property
    def blocks_read(self) -> list[str]:
        """Names of the blocks whose outputs it reads, in its inputs or as its setpoint."""
        return [*(item for item in self.inputs if isinstance(item, str)), *self.followed]

    @property
    def followed(self) -> list[str]:
        """Name of the block that its setpoint follows, in a list; empty if there is none."""
        setpoint = self.control.setpoint_schedule
        return (
            [setpoint.origin["control"]]
            if setpoint is not None and setpoint.kind == "control"
            else []
        )

    @property
    def blocks_passed(self) -> list[str]:
        """Names of the blocks on whose present outputs its own output depends."""
        return self.blocks_read if self.control.passes_at_once else self.followed

    @property
    def blocks_needed(self) -> list[str]:
        """Names of the blocks that must decide before this block; none for a block that holds its output."""
        return self.blocks_passed if self.control.period is None else []


@dataclass(frozen=True)
class BlockQuantities:
    """Quantities of a block that a probe may read: name -> dimension."""

    kind: str
    quantities: dict[str, str]
    along: dict[str, str] = field(default_factory=dict)


class Blocks:
    """Blocks of a case while they are read. kinds : as for `read_probe`"""

    def __init__(self, reading: Reading, kinds: dict[str, Any]) -> None:
        from fvsolve.parts.control import Control

        self.known_types = Control.kinds
        self.reading, self.kinds, self.setting = reading, kinds, reading.setting
        self.given = {
            name: item for name, item in reading.group("controls").items() if self.types(name, item)
        }
        self.inputs: dict[str, dict[tuple[str, ...], Probe | str | None]] = {
            name: dict(self.read_inputs(name, item)) for name, item in self.given.items()
        }
        self.outputs = dict.fromkeys(self.given, "number")

    def types(self, name: str, given: Any) -> type[Control] | None:
        """Class of a block; None, with a fault, if its type is missing or unknown."""
        reading, known = self.reading, self.known_types
        reading.add((("controls", name), text) for text in name_faults(name))
        if not isinstance(given, dict):
            return reading.fault(
                ("controls", name), f"{show(given)} is not a table; expected a table with a type"
            )
        if "type" not in given:
            return reading.fault(
                ("controls", name), f"type is missing; expected one of {listing(sorted(known))}"
            )
        word = given["type"]
        if isinstance(word, str) and word in known:
            return known[word]
        near = did_you_mean(str(word), known) or f"; types are {listing(sorted(known))}"
        return reading.fault(("controls", name, "type"), f"unknown type {show(word)}{near}")

    def kind(self, name: str) -> type[Control]:
        return self.known_types[self.given[name]["type"]]

    def read_inputs(
        self, name: str, given: dict[str, Any]
    ) -> Iterator[tuple[tuple[str, ...], Probe | str | None]]:
        """Yield the inputs of a block: (key path in the block, probe or name of a block, None if it is faulty)."""
        for keys, text in self.kind(name).inputs_of(given).items():
            value = None
            if isinstance(text, str):  # else a fault of the key
                with self.reading.catch("controls", name, *keys):
                    value = self.read_input(text)
            yield keys, value

    def read_input(self, text: str) -> Probe | str | None:
        """Probe or name of a block; None for a probe of a faulty part. Raises ValueError."""
        known = self.reading.raw.table["controls"]
        name = text.removeprefix(BLOCK_PREFIX)
        if name != text and "." not in name:
            if name not in known:
                near = did_you_mean(name, known)
                raise ValueError(
                    f"no control named {show(name)}{near}; [controls] has {listing(known)}"
                )
            return name
        try:
            return read_probe(text, self.kinds)
        except ValueError as error:
            block = name.partition(".")[0]
            if block in known and (name != text or block == text):
                raise ValueError(
                    f'{show(text)} is not a block; did you mean "{BLOCK_PREFIX}{block}"?'
                ) from None
            hint = "" if "did you mean" in str(error) else f"; a block is named {BLOCK_PREFIX}NAME"
            raise ValueError(f"{error}{hint}") from None

    def first_dimension(self, name: str) -> str:
        """Dimension of the first input of a block; UNKNOWN if this input is missing or faulty."""
        inputs = self.inputs[name]
        if not inputs:
            return UNKNOWN if "input" in self.kind(name).keys() else "number"
        first = next(iter(inputs.values()))
        return first.dimension if isinstance(first, Probe) else self.outputs.get(first, UNKNOWN)

    def known_dimensions(self, name: str, passed: tuple[str, ...] = ()) -> list[str]:
        """Known dimensions of the keys that a block drives and of the setpoints that follow it.

        Those that it drives through blocks of the same unit count too. passed : blocks between these and the block
        """
        found = [dimension for dimension, _ in self.setting.driven.get(name, ())]
        for other, item in self.given.items():
            setpoint = item.get("setpoint")
            if isinstance(setpoint, dict) and setpoint.get("control") == name:
                found.append(self.first_dimension(other))
            if (
                self.kind(other).same_unit
                and name in self.inputs[other].values()
                and other not in passed
            ):
                found += self.known_dimensions(other, (*passed, name))
        return list(dict.fromkeys(dimension for dimension in found if dimension != UNKNOWN))

    def output_dimension(self, name: str) -> str:
        """Dimension of the output of a block; UNKNOWN if it drives only faulty keys."""
        if known := self.known_dimensions(name):
            return UNKNOWN if unlike(known) else known[0]
        if self.kind(name).same_unit:
            return self.first_dimension(name)
        if own := self.kind(name).own_dimension(self.given[name]):
            return own
        return UNKNOWN if name in self.followed else "number"

    @cached_property
    def followed(self) -> set[str]:
        """Names of the blocks that a key outside `[controls]` follows."""
        found = followers(self.reading.filled, "control")
        return {name for name, keys in found if keys[0] != "controls"}

    def read(self) -> dict[str, Block | None]:
        """Blocks by name, in the order of the file; None for a faulty block."""
        # dimensions of outputs follow from the keys that they drive
        for _ in range(len(self.given) + 1):
            outputs = {name: self.output_dimension(name) for name in self.given}
            if outputs == self.outputs:
                break
            self.outputs = outputs
        blocks: dict[str, Block | None] = dict.fromkeys(self.given)
        for name, item in self.given.items():
            before = len(self.reading.faults)
            self.setting.block_units = self.first_dimension(name), self.outputs[name]
            self.reading.add((("controls", name, *keys), text) for keys, text in self.faults(name))
            with self.reading.catch("controls", name):
                rest = {key: value for key, value in item.items() if key != "type"}
                control = self.kind(name).model_validate(rest, context=self.setting)
                if before == len(self.reading.faults) and None not in self.inputs[name].values():
                    limits = control.limits or self.driven_range(name)
                    inputs = tuple(self.inputs[name].values())
                    blocks[name] = Block(control, inputs, limits, self.setting.block_units)
        self.reading.add(cycle_faults(blocks))
        return blocks

    def driven_range(self, name: str) -> tuple[float, float]:
        """Range of values that all keys driven by a block may have."""
        ranges = [limits for _, limits in self.setting.driven.get(name, ())]
        return max([-float("inf"), *(r.least for r in ranges)]), min(
            [float("inf"), *(r.greatest for r in ranges)]
        )

    def valid_key(self, name: str, key: str) -> Any:
        """Value of a key of a block; None if it is left out or faulty."""
        with suppress(KeyError, ValueError):
            return self.kind(name).values()[key].read(self.given[name][key], self.setting)
        return None

    def faults(self, name: str) -> Iterator[tuple[tuple, str]]:
        """Yield faults (keys in the block, text) of unlike driven keys, limits and the initial output."""
        if pair := unlike(self.known_dimensions(name)):
            first, other = (DIMENSIONS[item].words for item in pair)
            yield (), f"drives {first} and {other}; expected keys of one unit, or a block for each"
        ends = [
            item for item in (self.first_dimension(name), self.outputs[name]) if item != UNKNOWN
        ]
        if self.kind(name).same_unit and (pair := unlike(ends)):
            first, other = (DIMENSIONS[item].words for item in pair)
            yield (
                (),
                f"passes on {first}, but drives {other}; expected keys of the unit of its input",
            )
        if self.kind(name).same_unit:
            yield from self.unlike_inputs(name)
        stated, initial = self.valid_key(name, "limits"), self.valid_key(name, "initial")
        low, high = self.driven_range(name)
        least_open = any(r.open and r.least == low for _, r in self.setting.driven.get(name, ()))
        limits, given = stated or (low, high), show(self.given[name].get("limits"))
        if not limits[0] < limits[1]:
            if stated:
                yield (
                    ("limits",),
                    f"{given} has no values between; expected the least, then the greatest",
                )
        elif stated and (limits[0] < low or limits[1] > high or (least_open and limits[0] == low)):
            text = f"{given} goes beyond what the driven keys may be"
            yield (
                ("limits",),
                f"{text}; expected values {str(Range(low, high, least_open)).removeprefix('of ')}",
            )
        elif outputs := self.valid_key(name, "output"):
            for k, output in enumerate(outputs):
                if not low <= output <= high:
                    text = f"{show(self.given[name]['output'][k])} is not a value that the driven keys may have"
                    yield (
                        ("output", k),
                        f"{text}; expected values {str(Range(low, high)).removeprefix('of ')}",
                    )
        elif (
            not stated
            and (table := self.valid_key(name, "table"))
            and not all(low <= x <= high for x in table.output)
        ):
            text = f"{show(list(table.output))} goes beyond what the driven keys may be; expected values"
            yield (
                ("table", "output"),
                f"{text} {str(Range(low, high)).removeprefix('of ')}, or `limits`",
            )
        elif initial is not None and not limits[0] <= initial <= limits[1]:
            text = f"{show(self.given[name]['initial'])} is outside the limits {show(list(limits))}"
            yield ("initial",), f"{text}; expected a value within them"

    def unlike_inputs(self, name: str) -> Iterator[tuple[tuple, str]]:
        """Yield a fault (keys in the block, text) for each input that has another unit than the first one."""
        known = {
            keys: item.dimension if isinstance(item, Probe) else self.outputs.get(item, UNKNOWN)
            for keys, item in self.inputs[name].items()
            if item is not None
        }
        known = {keys: dimension for keys, dimension in known.items() if dimension != UNKNOWN}
        for keys, dimension in known.items():
            if pair := unlike([next(iter(known.values())), dimension]):
                first, other = (DIMENSIONS[item].words for item in pair)
                yield keys, f"is {other}, but the first input is {first}; expected one unit"


def unlike(dimensions: list[str]) -> tuple[str, str] | None:
    """First two dimensions with different units; None if all have the same unit."""
    for item in dimensions[1:]:
        if (DIMENSIONS[item].base or item) != (DIMENSIONS[dimensions[0]].base or dimensions[0]):
            return dimensions[0], item
    return None


def read_controls(reading: Reading, kinds: dict[str, Any]) -> dict[str, Block | None]:
    """Blocks of a case by name; None for a faulty block. Adds their quantities to `kinds`, as for `read_probe`."""
    for group in ("nodes", "links"):
        if "controls" in reading.raw.table.get(group, {}):
            reading.fault(
                (group, "controls"), '"controls" is the name of the blocks; expected another name'
            )
    blocks = Blocks(reading, kinds)
    result = blocks.read()
    kinds["controls"] = {f"{BLOCK_PREFIX}{name}": None for name in reading.raw.table["controls"]}
    for name, block in result.items():
        if block is not None:
            first, output = block.dimensions
            own = {"output": output} | ({"input": first} if block.inputs else {})
            if block.control.setpoint_schedule is not None:
                own["error"] = DIFFERENCES.get(first, first)
            kinds["controls"][f"{BLOCK_PREFIX}{name}"] = BlockQuantities(block.control.kind, own)
    return result


def cycle_faults(blocks: dict[str, Block | None]) -> Iterator[tuple[tuple, str]]:
    """Yield a fault for each cycle of blocks that pass their inputs or setpoints on at once."""
    sound = {name: block for name, block in blocks.items() if block is not None}
    needs = {name: needed_at_once(sound, name) for name in sound}
    done: set[str] = set()
    for name in sound:
        cycle = [other for other in sound if other in needs[name] and name in needs[other]]
        if not cycle or name in done:
            continue
        done.update(cycle)
        text = f"{listing(cycle)} read each other at once, so none can decide first"
        text = f"{name} reads its own output at once" if len(cycle) == 1 else text
        curable = (item for item in cycle if not {*cycle} & {*sound[item].followed})
        remedy = next((f"give [controls.{item}] a `filter`" for item in curable), "")
        remedy = (
            remedy
            or "a `filter` does not act on setpoints; expected a setpoint from outside of the cycle"
        )
        yield ("controls", name), f"{text}; {remedy}"


def needed_at_once(blocks: dict[str, Block], name: str) -> set[str]:
    """Names of the blocks on whose present outputs the output of a block depends, also through other blocks."""
    found: set[str] = set()
    ahead = [name]
    while ahead:
        more = [
            other
            for other in blocks[ahead.pop()].blocks_passed
            if other in blocks and other not in found
        ]
        found.update(more)
        ahead += more
    return found


def decision_order(blocks: dict[str, Block]) -> list[str]:
    """Names of blocks, each after those whose present outputs it needs; blocks of a cycle are left out."""
    order: list[str] = []
    while ready := [
        name
        for name, block in blocks.items()
        if name not in order
        and all(other in order or other not in blocks for other in block.blocks_passed)
    ]:
        order += ready
    return order
