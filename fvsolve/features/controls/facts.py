"""Blocks of `controls` in the output of `fvsolve check`."""

from __future__ import annotations

import math
from typing import Any

from fvsolve.parts.schedule import BLOCK_PREFIX

KEYS = ("filter", "period", "offset")  # of all blocks, in SI
MOST_INPUTS = 8  # in a line on a block


def block_facts(feature, model) -> dict[str, dict[str, Any]]:
    """Facts about blocks: type, inputs, setpoint and output at the start, limits, times of filter and samples; SI.

    A setpoint, limit or time that a block does not have is None.
    """
    facts = {}
    for row, name in zip(feature.table, model.block_names, strict=True):
        block = model.case.controls[name]
        limits = [float(row[key]) for key in ("least", "greatest")]
        inputs = [
            BLOCK_PREFIX + item if isinstance(item, str) else item.text for item in block.inputs
        ]
        facts[name] = {
            "type": block.control.kind,
            "inputs": inputs,
            "setpoint": float(row["setpoint_start"]) if row["setpoint"] >= 0 else None,
            "output": float(row["start"]),
            "limits": [x if math.isfinite(x) else None for x in limits],
            **{key: getattr(block.control, key) for key in KEYS},
        }
    return facts


def block_text(case, name: str, facts: dict[str, Any]) -> str:
    """Line on a block in the units of `[output]`; facts : as in `block_facts`"""
    first, output = case.controls[name].dimensions

    def amount(value: float, dimension: str) -> str:
        return case.amount(value, dimension).removesuffix(" -")

    # in the order of the keys, which is that of the inputs of the law
    inputs = facts["inputs"]
    more = f", ... ({len(inputs)} in all)" if len(inputs) > MOST_INPUTS else ""
    reads = f" of {', '.join(inputs[:MOST_INPUTS])}{more}" if inputs else ""
    words = [f"{facts['type']}{reads}"]
    if facts["filter"] is not None:
        words.append(f"filter {amount(facts['filter'], 'time')}")
    if facts["period"] is not None:
        offset = f" from {amount(facts['offset'], 'time')} on" if facts["offset"] else ""
        words.append(f"samples every {amount(facts['period'], 'time')}{offset}")
    if facts["setpoint"] is not None:
        words.append(f"setpoint {amount(facts['setpoint'], first)}")
    least, greatest = facts["limits"]
    words += [] if least is None else [f"at least {amount(least, output)}"]
    words += [] if greatest is None else [f"at most {amount(greatest, output)}"]
    return (
        f"control {name}: {', '.join(words)}; output {amount(facts['output'], output)} at the start"
    )
