"""Tables of blocks of `controls`.

A block decides before the nodes are solved if it drives the network. All inputs that it passes on at once must then
follow from states alone.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np

from fvsolve.case.controls import Block
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.probe_tables import fill_probes
from fvsolve.features.controls.kernels.tables import (
    CONTROL,
    DRIVEN,
    DRIVEN_DEVICE,
    DRIVEN_NODE,
    DRIVEN_VALVE,
)
from fvsolve.features.controls.rows import control_rows_of, small_change
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import network_of

STATE_KINDS = (rec.LEVEL, rec.POSITION, rec.VELOCITY, rec.PISTON_POSITION, rec.PISTON_VELOCITY)
STORED = (rec.FIXED, rec.TANK, rec.CHAMBER, rec.MOVING, rec.VESSEL)
LIMIT_EVENTS = (
    "reaches its lower limit",
    "leaves its lower limit",
    "reaches its upper limit",
    "leaves its upper limit",
)


def lower_controls(draft, own) -> None:
    """Fill the tables of blocks, of sensors and of driven rows; add the states of blocks. own : the feature"""
    blocks = draft.schedules.blocks
    probes = {
        item.text: item
        for block in draft.case.controls.values()
        for item in block.inputs
        if not isinstance(item, str)
    }
    own.sensors = list(probes.values())
    own.sensor_table = fill_probes(draft, own.sensors)
    own.table = np.zeros(len(blocks), CONTROL)
    driven = list(driven_rows(draft))
    early = early_blocks(draft, driven)
    own.driven_rows = np.array([(kind, row) for kind, row, _ in driven], DRIVEN)
    for (name, _), row in zip(blocks.items(), own.table, strict=True):
        block = draft.case.controls[name]
        fill_block(draft, own, name, block, list(probes), row)
        row["late"] = name not in early
    lower_delays(draft, own)
    check_order(draft, own, early)


def fill_block(draft, own, name: str, block: Block, sensors: list[str], row) -> None:
    """Fill the row of a block, except what depends on the start; sensors : texts of the probes of all sensors."""
    control, rows = block.control, control_rows_of(type(block.control))
    if not type(control).__module__.startswith("fvsolve."):
        from fvsolve.features.controls.row_checks import check_block

        check_block(name, control, rows)
    filters = len(block.inputs) if control.filter is not None else 0
    small = [small_change(dimension) for dimension in block.dimensions]
    if all(map(math.isfinite, block.limits)):
        small[1] = min(small[1], 0.1 * (block.limits[1] - block.limits[0]))
    names = [f"controls.{name}.filtered{k or ''}" for k in range(filters)]
    if control.period is None:
        names += [f"controls.{name}.{state}" for state in rows.states(control)]
    scales = [small[0]] * filters + (
        rows.scales(control, tuple(small)) if control.period is None else []
    )
    row["y"] = draft.states(names, scales) if names else -1
    row["filters"], row["filter_rate"] = filters, 1.0 / control.filter if filters else 0.0
    row["hooks"], row["data"] = own.law_row(rows), len(draft.floats)
    draft.floats += rows.numbers(draft, name, block)
    row["at_once"] = control.feeds_through
    row["inputs"], row["input_count"] = len(draft.integers), len(block.inputs)
    draft.integers += [
        -1 - draft.schedules.blocks[item] if isinstance(item, str) else sensors.index(item.text)
        for item in block.inputs
    ]
    row["starts"] = len(draft.floats)
    draft.floats += [0.0] * len(block.inputs)
    setpoint = control.setpoint_schedule
    row["setpoint"] = -1 if setpoint is None else draft.schedules.add(setpoint)
    row["least"], row["greatest"], row["held"] = *block.limits, np.nan
    row["period"], row["offset"], row["delay"] = (
        control.period or 0.0,
        control.offset,
        rows.delay(control),
    )
    limited = (
        not control.switches and control.period is None and any(map(math.isfinite, block.limits))
    )
    row["flag"] = draft.flags(f"controls.{name}", LIMIT_EVENTS) if limited else -1
    flag = rows.timed_flag(np.array(draft.floats[row["data"] :]))
    row["memory"] = len(own.discrete) if flag >= 0 or control.period else -1
    if control.period:
        own.discrete += [0.0] * (2 + rows.sampled_numbers(control))
    if flag >= 0:
        own.timed.append((flag, len(own.discrete)))
        own.discrete.append(-np.inf)


def lower_delays(draft, own) -> None:
    """Number the histories of blocks with a delay, and list the blocks on which their inputs depend."""
    table = own.table
    blocks = draft.case.controls
    numbers = draft.schedules.blocks
    table["history"] = np.where(table["delay"] > 0.0, np.cumsum(table["delay"] > 0.0) - 1, -1)
    names, rows = list(numbers), draft.schedules.rows
    drives_scene = {
        names[int(rows[first][2])] for first, pieces in draft.schedules.records if pieces == 0
    }
    for name, row in zip(names, table, strict=True):
        if row["delay"] > 0.0:
            now = {item for item in blocks[name].inputs if isinstance(item, str)}
            while more := {other for item in now for other in blocks[item].blocks_needed} - now:
                now |= more
            found, ahead = set(now), [name, *now]
            while ahead:
                block = blocks[item := ahead.pop()]
                if item == name or control_rows_of(type(block.control)).delay(block.control) == 0.0:
                    reads_scene = any(not isinstance(given, str) for given in block.inputs)
                    more = {*block.blocks_read, *(drives_scene if reads_scene else ())} - found
                    found, ahead = found | more, [*ahead, *more]
            row["sources"], row["source_count"] = len(draft.integers), len(now)
            row["later_count"] = len(found) - len(now)
            draft.integers += [
                numbers[item] for group in (now, found - now) for item in sorted(group)
            ]


def control_rate(draft, own) -> float:
    """Greatest constant rate of filters and states of blocks [1/s]."""
    blocks = draft.case.controls.values()
    rates = [
        control_rows_of(type(block.control)).rate(block.control)
        for block in blocks
        if not block.control.period
    ]
    return max([0.0, *rates, *own.table["filter_rate"]])


def driven_rows(draft) -> Iterator[tuple[int, int, int]]:
    """Yield the rows of tables that blocks drive before the nodes are solved: (kind, row, number of the block)."""
    followers = {
        index: int(draft.schedules.rows[first][2])
        for index, (first, pieces) in enumerate(draft.schedules.records)
        if pieces == 0
    }
    linear = draft.case.law.linear
    for k, row in enumerate(draft.valve_table):
        if row["schedule"] in followers and row["device"] < 0:
            yield DRIVEN_VALVE, k, followers[row["schedule"]]
    for k, row in enumerate(draft.device_table):
        _, part, device = draft.devices[k]
        shaft = device.turns_with(part)
        own = device.schedules_at_once(row, draft.valve_table, draft.floats)
        turned = [] if shaft is None else network_of(draft).schedules_of_node(shaft)
        for block in {followers[index] for index in (*own, *turned) if index in followers}:
            yield DRIVEN_DEVICE, k, block
    for i, row in enumerate(draft.node_table):
        if row["schedule"] in followers:
            if row["kind"] == rec.FIXED or linear:
                yield DRIVEN_NODE, i, followers[row["schedule"]]
            else:
                yield DRIVEN_NODE, -1, followers[row["schedule"]]


def early_blocks(draft, driven: list[tuple[int, int, int]]) -> set[str]:
    """Names of the blocks that decide before the nodes are solved, because they drive the network or such a block."""
    names = list(draft.schedules.blocks)
    early = {names[block] for _, _, block in driven}
    while (
        more := {other for name in early for other in draft.case.controls[name].blocks_needed}
        - early
    ):
        early |= more
    return early


def is_known_early(draft, row, probe) -> bool:
    """True if the value of a sensor follows from states alone, before the nodes are solved."""
    kind = row["kind"]
    if kind == rec.PRESSURE:
        return draft.node_table[row["index"]]["kind"] in STORED
    if kind in (rec.PIPE_PRESSURE, rec.PIPE_FLOW):
        return row["side"] == 0 and draft.pipe_table[row["index"]]["cells"] > 0
    if kind == rec.DEVICE_VALUE:
        name, part, device = draft.devices[row["index"]]
        return probe.quantity in device.states_of(draft, name, part)
    if kind == codes.NETWORK_VALUE:
        return network_of(draft).is_known_early(row)
    return kind in STATE_KINDS or kind == rec.CELL_FIELD


def has_late_sensors(draft, own) -> bool:
    """True if a sensor reads what only the solved nodes determine."""
    return not all(map(functools.partial(is_known_early, draft), own.sensor_table, own.sensors))


def check_order(draft, own, early: set[str]) -> None:
    """Add a fault for each block that drives the network, and passes on at once what only the solved network tells."""
    rows = dict(zip([probe.text for probe in own.sensors], own.sensor_table, strict=True))
    names_of_rows = {name: k for k, name in enumerate(draft.schedules.blocks)}
    for name in draft.schedules.blocks:
        block = draft.case.controls[name]
        if name not in early:
            check_network_order(draft, name, block, rows, names_of_rows)
            continue
        names = list(getattr(block.control, "inputs", ()))
        for k, probe in enumerate(block.inputs if block.control.feeds_through else ()):
            if not isinstance(probe, str) and not is_known_early(draft, rows[probe.text], probe):
                text = f"{probe.text} may follow at once from what the control drives, a loop without a state"
                place = f"inputs.{names[k]}" if names else "input"
                draft.fault(
                    f"controls.{name}.{place}", f"{text}; give [controls.{name}] a `filter`"
                )


def check_network_order(
    draft, name: str, block: Block, rows: dict, numbers: dict[str, int]
) -> None:
    """Add a fault if a block passes on at once what a block drives in a network of rotation, electricity and heat.

    Values of scalars, and heat of the fluid, are known only after these blocks.
    """
    for probe in block.inputs if block.control.feeds_through else ():
        if not isinstance(probe, str) and follows_scalars(draft, rows[probe.text]):
            text = f"{probe.text} is known only after what the control drives"
            draft.fault(f"controls.{name}", f"{text}; give [controls.{name}] a `filter`")
    network = network_of(draft)
    for probe in block.inputs if block.control.feeds_through and network is not None else ():
        if not isinstance(probe, str) and rows[probe.text]["kind"] == codes.NETWORK_VALUE:
            if network.follows_blocks(draft, rows[probe.text]):
                text = f"{probe.text} may follow at once from what a control drives, a loop without a state"
                draft.fault(f"controls.{name}", f"{text}; give [controls.{name}] a `filter`")


def follows_scalars(draft, row) -> bool:
    """True if a sensor reads the value of a scalar, or the heat of a heat exchanger."""
    if row["kind"] in (rec.NODE_SCALAR, rec.PIPE_SCALAR, rec.CELL_SCALAR):
        return True
    network = network_of(draft)
    sources = network.inputs_of(row) if row["kind"] == codes.NETWORK_VALUE else ()
    reads = (network.sources[j].reads for j in sources)
    return any(item is not None and item[0] == codes.FLUID_HEAT for item in reads)
