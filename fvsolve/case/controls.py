"""Reading of `[controls]`: types, inputs, units, limits and order of blocks.

The unit of the first input of a block is that of the probe or block that it reads, the unit of its output that of the
keys that it drives. A block without `limits` has the range of these keys.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from fvsolve.case.probe import Probe, read_probe
from fvsolve.case.reading import Reading, driven_keys
from fvsolve.case.resource_checks import name_faults
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.control import PREFIX, Control
from fvsolve.parts.value import Range
from fvsolve.units import DIMENSIONS, show

DIFFERENCES = {"pressure": "pressure_drop", "gauge_pressure": "pressure_drop"}  # dimension of an error
WANT_SLOPES = ("joint", "travel")  # keys that move bodies and walls


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
        setpoint = self.control.setpoint_schedule
        by_setpoint = [setpoint.origin["control"]] if setpoint is not None and setpoint.kind == "control" else []
        return [*(item for item in self.inputs if isinstance(item, str)), *by_setpoint]

    @property
    def blocks_passed(self) -> list[str]:
        """Names of the blocks on whose present outputs its own output depends."""
        return [name for name in self.blocks_read if self.control.passes_at_once or name not in self.inputs]


@dataclass(frozen=True)
class BlockQuantities:
    """Quantities of a block that a probe may read: name -> dimension."""

    kind: str
    quantities: dict[str, str]
    along: dict[str, str] = field(default_factory=dict)


class Blocks:
    """Blocks of a case while they are read. kinds : as for `read_probe`"""

    def __init__(self, reading: Reading, kinds: dict[str, Any]) -> None:
        self.reading, self.kinds, self.setting = reading, kinds, reading.setting
        self.given = {name: item for name, item in reading.group("controls").items() if self.types(name, item)}
        self.inputs: dict[str, dict[tuple[str, ...], Probe | str | None]] = {
            name: dict(self.read_inputs(name, item)) for name, item in self.given.items()
        }
        self.outputs = dict.fromkeys(self.given, "number")

    def types(self, name: str, given: Any) -> type[Control] | None:
        """Class of a block; None, with a fault, if its type is missing or unknown."""
        reading, known = self.reading, Control.kinds
        reading.add((("controls", name), text) for text in name_faults(name))
        if not isinstance(given, dict):
            return reading.fault(("controls", name), f"{show(given)} is not a table; expected a table with a type")
        if "type" not in given:
            return reading.fault(("controls", name), f"type is missing; expected one of {listing(sorted(known))}")
        if given["type"] in known:
            return known[given["type"]]
        near = did_you_mean(str(given["type"]), known) or f"; types are {listing(sorted(known))}"
        return reading.fault(("controls", name, "type"), f"unknown type {show(given['type'])}{near}")

    def kind(self, name: str) -> type[Control]:
        return Control.kinds[self.given[name]["type"]]

    def read_inputs(self, name: str, given: dict[str, Any]) -> Iterator[tuple[tuple[str, ...], Probe | str | None]]:
        """Yield the inputs of a block: (key path in the block, probe or name of a block, None if it is faulty)."""
        for keys, text in self.kind(name).inputs_of(given).items():
            value, known = None, self.reading.raw.table["controls"]
            with self.reading.catch("controls", name, *keys):
                if isinstance(text, str) and text.startswith(PREFIX) and "." not in text.removeprefix(PREFIX):
                    value = text.removeprefix(PREFIX)
                    if value not in known:
                        near = did_you_mean(value, known)
                        raise ValueError(f"no control named {show(value)}{near}; [controls] has {listing(known)}")
                else:
                    value = self.probe(text)
            yield keys, value

    def probe(self, text: Any) -> Probe | None:
        """Probe of a part. Raises ValueError, also for a name that is neither a probe nor a block."""
        try:
            return read_probe(text, self.kinds)
        except ValueError as error:
            names = self.reading.raw.table["controls"]
            near = did_you_mean(str(text), [f"{PREFIX}{name}" for name in names])
            hint = near or f"; a block is named {PREFIX}NAME"
            raise ValueError(f"{error}{hint}") from None

    def dimension_of(self, item: Probe | str | None) -> str:
        """Dimension of an input."""
        return "number" if item is None else self.outputs[item] if isinstance(item, str) else item.dimension

    def dimensions(self, name: str) -> tuple[str, str]:
        """Dimensions of the first input and of the output of a block."""
        first = next(iter(self.inputs[name].values()), None)
        if isinstance(first, str) and first not in self.outputs:
            first = None
        return self.dimension_of(first), self.outputs[name]

    def find_dimensions(self) -> None:
        """Find the dimensions of all outputs from the keys that they drive."""
        for _ in range(len(self.given) + 1):
            for name in self.given:
                known = [dimension for dimension, _ in self.setting.driven.get(name, ())]
                own = self.kind(name).own_dimension(self.given[name], *self.dimensions(name))
                self.outputs[name] = own or (known[0] if known else self.outputs[name])
            for name, item in self.given.items():  # setpoints that follow other blocks
                setpoint = item.get("setpoint")
                if isinstance(setpoint, dict) and setpoint.get("control") in self.given:
                    other = setpoint["control"]
                    if other not in self.setting.driven and self.dimensions(name)[0] != "number":
                        self.setting.driven.setdefault(other, []).append((self.dimensions(name)[0], Range()))

    def read(self) -> dict[str, Block | None]:
        """Blocks by name, in the order of the file; None for a faulty block."""
        self.find_dimensions()
        blocks: dict[str, Block | None] = {}
        for name, item in self.given.items():
            blocks[name], before = None, len(self.reading.faults)
            self.setting.block_units = self.dimensions(name)
            with self.reading.catch("controls", name):
                rest = {key: value for key, value in item.items() if key != "type"}
                control = self.kind(name).model_validate(rest, context=self.setting)
                limits = control.limits or self.driven_range(name)
                self.reading.add((("controls", name, *keys), text) for keys, text in self.faults(name, control, limits))
                if before == len(self.reading.faults) and None not in self.inputs[name].values():
                    inputs = tuple(self.inputs[name].values())
                    blocks[name] = Block(control, inputs, limits, self.setting.block_units)
        self.reading.add(slope_faults(self.reading.raw.table))
        self.reading.add(cycle_faults(blocks))
        return blocks

    def driven_range(self, name: str) -> tuple[float, float]:
        """Range of values that all keys driven by a block may have."""
        ranges = [limits for _, limits in self.setting.driven.get(name, ())]
        return max([-float("inf"), *(r.least for r in ranges)]), min([float("inf"), *(r.greatest for r in ranges)])

    def faults(self, name: str, control: Control, limits: tuple[float, float]) -> Iterator[tuple[tuple, str]]:
        """Yield faults (keys in the block, text) of limits, of the initial output and of unlike driven keys."""
        dimensions = [DIMENSIONS[item].base or item for item, _ in self.setting.driven.get(name, ())]
        unlike = [item for item in dimensions if item != dimensions[0]]
        if unlike:
            words = [DIMENSIONS[item].words for item in (dimensions[0], unlike[0])]
            yield (), f"drives {words[0]} and {words[1]}; expected keys of one unit, or a block for each"
        low, high = self.driven_range(name)
        if control.limits is not None and not limits[0] < limits[1]:
            yield ("limits",), f"{list(limits)} has no values between; expected the least value, then the greatest"
        elif control.limits is not None and (limits[0] < low or limits[1] > high):
            yield ("limits",), f"{list(limits)} goes beyond what the driven key may be, {Range(low, high)}"
        if control.initial is not None and not limits[0] <= control.initial <= limits[1]:
            text = f"{control.initial:g} is outside the limits {list(limits)}; expected a value within them"
            yield ("initial",), text


def read_controls(reading: Reading, kinds: dict[str, Any]) -> dict[str, Block | None]:
    """Blocks of a case by name; None for a faulty block. Adds their quantities to `kinds`, as for `read_probe`."""
    if "controls" not in reading.raw.table:
        return {}
    for group in ("nodes", "links"):
        if "controls" in reading.raw.table.get(group, {}):
            reading.fault((group, "controls"), '"controls" is the name of the blocks; expected another name')
    blocks = Blocks(reading, kinds)
    result = blocks.read()
    kinds["controls"] = {f"{PREFIX}{name}": None for name in reading.raw.table["controls"]}
    for name, block in result.items():
        if block is not None:
            first, output = block.dimensions
            own = {"output": output} | ({"input": first} if block.inputs else {})
            if block.control.setpoint_schedule is not None:
                own["error"] = DIFFERENCES.get(first, first)
            kinds["controls"][f"{PREFIX}{name}"] = BlockQuantities(block.control.kind, own)
    return result


def slope_faults(table: dict[str, Any]) -> Iterator[tuple[tuple, str]]:
    """Yield faults of keys that follow a block although their slopes are needed: driven joints and walls."""
    for keys in driven_keys(table, "control"):
        if keys[0] == "nodes" and any(word in keys for word in WANT_SLOPES):
            yield keys, "cannot follow a control, because the motion needs its slopes; drive a torque or a force"


def cycle_faults(blocks: dict[str, Block | None]) -> Iterator[tuple[tuple, str]]:
    """Yield a fault for a cycle of blocks each of which passes its input on at once."""
    sound = {name: block for name, block in blocks.items() if block is not None}
    order = decision_order(sound)
    left = [name for name in sound if name not in order]
    if left:
        text = f"{listing(left)} read each other at once, so none can decide first; give one of them a `filter`"
        yield ("controls", left[0]), text


def decision_order(blocks: dict[str, Block]) -> list[str]:
    """Names of blocks, each after those whose present outputs it needs; blocks of a cycle are left out."""
    order: list[str] = []
    while ready := [name for name, block in blocks.items() if name not in order
                    and all(other in order or other not in blocks for other in block.blocks_passed)]:  # fmt: skip
        order += ready
    return order
