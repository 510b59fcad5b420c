"""The JSON schema of a case file, for editors. Knows the parts' own schemas; adds nothing to them."""

from __future__ import annotations

from typing import Any

from fvsolve.case.load import GROUPS, KEYS, TOP
from fvsolve.case.sections import ExactSpec, FluidSpec, Numerics, Output
from fvsolve.parts import KINDS, Scalar
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table import keys_json
from fvsolve.parts.value import Quantity


def schema() -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of a case file."""
    definitions: dict[str, Any] = {}
    properties: dict[str, Any] = dict.fromkeys(KEYS, {})
    properties |= keys_json(TOP)["properties"]
    properties["ambient_pressure"] = Quantity("pressure").json()
    for name, model in (("fluid", FluidSpec), ("numerics", Numerics), ("output", Output), ("exact", ExactSpec)):
        properties[name] = _hoisted(model, definitions)
    for group, kinds in KINDS.items():
        any_kind = [_typed(kind, made, definitions) for kind, made in kinds.items()]
        properties[group] = {"type": "object", "additionalProperties": {"anyOf": any_kind}}
    scalar = _hoisted(Scalar, definitions)
    properties["scalars"] = {"type": "object", "additionalProperties": scalar}
    properties["signals"] = {"type": "object", "additionalProperties": Scheduled("number").json()}
    properties["expect"] = properties["compare"] = {
        "type": "object",
        "additionalProperties": {"type": "object"},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fvsolve case",
        "type": "object",
        "properties": properties,
        "required": list(GROUPS),
        "additionalProperties": False,
        "$defs": definitions,
    }


def _hoisted(model: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """A model's schema with its definitions moved to the top."""
    made = model.model_json_schema(by_alias=True)
    definitions |= made.pop("$defs", {})
    return made


def _typed(kind: str, model: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    made = _hoisted(model, definitions)
    made["properties"] = {"type": {"const": kind}, **made["properties"]}
    made["required"] = ["type", *made.get("required", [])]
    return made
