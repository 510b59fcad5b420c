"""JSON schema of a case file, for editors."""

import re
from collections import Counter
from json import dumps, loads
from typing import Any

from fvsolve.case import validation_table
from fvsolve.case.claims import limit_keys
from fvsolve.case.declared_tables import DECLARED
from fvsolve.case.load import KEYS, TOP
from fvsolve.case.part_reading import LINKLESS
from fvsolve.case.pipe_routes import Route
from fvsolve.case.reading import NOT_DEFAULT
from fvsolve.case.sections import ExactSpec, FluidSpec, Numerics, Output
from fvsolve.parts import KINDS, Scalar
from fvsolve.parts.control import Control
from fvsolve.parts.nodes_and_links import NETWORK_DOMAINS
from fvsolve.parts.pump.energy_use import EnergyUse
from fvsolve.parts.reaction import Reaction
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table_model import keys_json
from fvsolve.parts.value import Quantity

SIBLING_WORDS = ("description", "default")  # words allowed beside a $ref
SCHEMA_WORDS = ("properties", "items", "anyOf", "additionalProperties", "$defs")
SHARED_LENGTH = 60  # letters of JSON; shorter schemas are repeated, not shared


def schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a case file, with repeated subschemas under `$defs`."""
    return share_definitions(full_schema())


def schema_text(content: dict[str, Any]) -> str:
    """JSON text of a schema; flat lists and bare references are written on one line."""
    text = re.sub(
        r"\[\s+([^][{}]*?)\s+\]",
        lambda match: f"[{' '.join(match[1].split())}]",
        dumps(content, indent=2),
    )
    return re.sub(r'\{\s+("\$ref": "[^"]*")\s+\}', r"{ \1 }", text)


def full_schema() -> dict[str, Any]:
    """JSON schema of a case file before `share_definitions`: a subschema is repeated at each place that uses it."""
    definitions: dict[str, Any] = {}
    properties: dict[str, Any] = dict.fromkeys(KEYS, {})
    properties |= keys_json(TOP)["properties"]
    properties["ambient_pressure"] = Quantity("pressure").json()
    tables = {
        "fluid": FluidSpec,
        "numerics": Numerics,
        "output": Output,
        "energy": EnergyUse,
        "exact": ExactSpec,
    }
    for name, model in tables.items():
        properties[name] = _with_shared_definitions(model, definitions)
    for group, kinds in KINDS.items():
        any_kind = [_typed(kind, part, definitions) for kind, part in sorted(kinds.items())]
        properties[group] = {"type": "object", "additionalProperties": {"anyOf": any_kind}}
    any_block = [_typed(kind, block, definitions) for kind, block in sorted(Control.kinds.items())]
    properties["controls"] = {"type": "object", "additionalProperties": {"anyOf": any_block}}
    properties["defaults"] = _defaults()
    for name, model in (("scalars", Scalar), ("reactions", Reaction), ("routes", Route)):
        content = _with_shared_definitions(model, definitions)
        properties[name] = {"type": "object", "additionalProperties": content}
    properties["signals"] = {"type": "object", "additionalProperties": Scheduled("number").json()}
    limit = keys_json(limit_keys("pressure", "pressure"))
    properties["limits"] = {"type": "object", "additionalProperties": limit}
    properties["validation"] = validation_table.schema()
    for name in DECLARED:
        properties[name] = _with_shared_definitions(DECLARED.load(name), definitions)
    properties["expect"] = properties["compare"] = {
        "type": "object",
        "additionalProperties": {"type": "object"},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fvsolve case",
        "type": "object",
        "properties": properties,
        "anyOf": [
            {"required": ["numerics", "fluid", "nodes"]},
            {
                "required": ["numerics", "nodes", "links"],
                "properties": {
                    "nodes": {
                        "additionalProperties": {
                            "properties": {"type": {"enum": nodes_without_fluid()}}
                        }
                    }
                },
            },
            {
                "required": ["numerics", "controls"],
                "not": {"anyOf": [{"required": ["nodes"]}, {"required": ["links"]}]},
            },
            {"required": ["validation"]},  # the rest is that of another case, or of a program
        ],
        "if": {
            "required": ["nodes"],
            "not": {"required": ["controls"]},
            "properties": {
                "nodes": {
                    "additionalProperties": {
                        "properties": {"type": {"not": {"enum": list(LINKLESS)}}}
                    }
                }
            },
        },
        "then": {"required": ["links"]},  # without a basin, a body or a control
        "additionalProperties": False,
        "$defs": definitions,
    }


def nodes_without_fluid() -> list[str]:
    """Types of nodes of cases that need no fluid: of rotation, electricity and heat, and of masses on an axis."""
    return sorted(
        name
        for name, kind in KINDS["nodes"].items()
        if kind.domain in (*NETWORK_DOMAINS, "translational")
    )


def share_definitions(full: dict[str, Any]) -> dict[str, Any]:
    """Copy of a schema with repeated subschemas moved to `$defs`; descriptions and defaults stay by the references."""
    times: Counter[str] = Counter()
    names: dict[str, str] = {}

    def count(part: Any, key: str) -> None:
        if isinstance(part, dict) and _is_schema(part):
            text = dumps(_without_siblings(part), sort_keys=True)
            times[text] += 1
            if times[text] > 1:  # its inner parts are counted already
                return
            names[text] = _name(part) or key
        for word, inner in (
            part.items() if isinstance(part, dict) else [(key, inner) for inner in part]
        ):
            if isinstance(inner, (dict, list)):
                count(inner, key if word in SCHEMA_WORDS else word)

    count(full, "case")
    names = _numbered(
        {
            text: names[text]
            for text, times_used in times.items()
            if times_used > 1 and len(text) > SHARED_LENGTH
        }
    )

    def replaced(part: Any, whole: bool = False) -> Any:
        if isinstance(part, dict):
            if not whole and (name := names.get(dumps(_without_siblings(part), sort_keys=True))):
                return {
                    "$ref": f"#/$defs/{name}",
                    **{key: part[key] for key in SIBLING_WORDS if key in part},
                }
            return {key: replaced(inner) for key, inner in part.items()}
        return [replaced(inner) for inner in part] if isinstance(part, list) else part

    result = replaced(full)
    result["$defs"] |= {name: replaced(loads(text), whole=True) for text, name in names.items()}
    return result


def _without_siblings(part: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in part.items() if key not in SIBLING_WORDS}


def _is_schema(part: dict[str, Any]) -> bool:
    """True if a dict is the schema of a value; False if it is a table of schemas by key."""
    return any(isinstance(part.get(word), (str, list)) for word in ("type", "anyOf", "enum"))


def _numbered(names: dict[str, str]) -> dict[str, str]:
    """Add numbers to names that occur several times, so that each is unique; names : schema text -> name."""
    counts: Counter[str] = Counter()
    for text, name in names.items():
        counts[name] += 1
        names[text] = f"{name}-{counts[name]}" if counts[name] > 1 else name
    return names


def _name(part: dict[str, Any]) -> str:
    """Name for a shared schema: its dimension, that of its entries for a schedule or list, or the keys of a table.

    It is "" if a schema has neither a dimension nor keys.
    """
    first = next(iter(part.get("anyOf", [])), part)
    if (
        isinstance(first, dict)
        and set(first) <= {"type", "examples", "x-dimension", *SIBLING_WORDS}
        and "anyOf" in part
    ):
        return f"schedule-of-{first.get('x-dimension', 'number')}"
    if part.get("type") == "array" and "enum" not in part["items"]:
        least = part.get("minItems", 1)
        return f"{least if least > 1 else 'list'}-of-{part['items'].get('x-dimension', 'number')}"
    keys = part.get("properties")
    if isinstance(keys, dict) and "title" not in part:
        return "-".join(keys)
    return part.get("x-dimension", "")


def _without_titles(part: Any) -> Any:
    """Copy of a schema without the titles and the null defaults that pydantic adds to every key."""
    if isinstance(part, list):
        return [_without_titles(item) for item in part]
    if not isinstance(part, dict):
        return part
    result = {
        key: _without_titles(item) for key, item in part.items() if (key, item) != ("default", None)
    }
    if isinstance(result.get("properties"), dict):
        result["properties"] = {
            key: {word: value for word, value in item.items() if word != "title"}
            for key, item in result["properties"].items()
        }
    return result


def _with_shared_definitions(model: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """Schema of a pydantic model; its shared definitions are moved into the dict `definitions`."""
    result = _without_titles(model.model_json_schema(by_alias=True))
    definitions |= result.pop("$defs", {})
    return result


def _defaults() -> dict[str, Any]:
    """Schema of the tables `[defaults.TYPE]`: keys of the parts, all optional, by reference to the parts."""
    result = {}
    for group, kinds in KINDS.items():
        for number, (kind, model) in enumerate(sorted(kinds.items())):
            place = f"#/properties/{group}/additionalProperties/anyOf/{number}/properties"
            own = {
                key: {"$ref": f"{place}/{key}"} for key in model.values() if key not in NOT_DEFAULT
            }
            result[kind] = {"type": "object", "properties": own, "additionalProperties": False}
    return {"type": "object", "properties": result, "additionalProperties": False}


def _typed(kind: str, model: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    result = _with_shared_definitions(model, definitions)
    result["properties"] = {"type": {"const": kind}, **result["properties"]}
    result["required"] = ["type", *result.get("required", [])]
    return result
