"""The JSON schema of a case file, for editors. Knows the parts' own schemas; adds nothing to them."""

from __future__ import annotations

import re
from collections import Counter
from json import dumps, loads
from typing import Any

from fvsolve.case import defaults
from fvsolve.case.limits import limit_keys
from fvsolve.case.load import ALONE, GROUPS, KEYS, TOP
from fvsolve.case.routes import Route
from fvsolve.case.sections import ExactSpec, FluidSpec, Numerics, Output
from fvsolve.parts import KINDS, Scalar
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table import keys_json
from fvsolve.parts.value import Quantity

BESIDE = ("description", "default")  # words that may stand beside a reference
WORDS = ("properties", "items", "anyOf", "additionalProperties", "$defs")
SHORT = 60  # letters: what is shorter is said again


def schema() -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of a case file; what is said twice stands once under `$defs`."""
    return shared(whole())


def printed(made: dict[str, Any]) -> str:
    """A schema as text, lists of words or numbers in a line, and bare references."""
    text = re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", dumps(made, indent=2))
    return re.sub(r'\{\s+("\$ref": "[^"]*")\s+\}', r"{ \1 }", text)


def whole() -> dict[str, Any]:
    """The schema with everything said where it holds."""
    definitions: dict[str, Any] = {}
    properties: dict[str, Any] = dict.fromkeys(KEYS, {})
    properties |= keys_json(TOP)["properties"]
    properties["ambient_pressure"] = Quantity("pressure").json()
    for name, model in (("fluid", FluidSpec), ("numerics", Numerics), ("output", Output), ("exact", ExactSpec)):
        properties[name] = _hoisted(model, definitions)
    for group, kinds in KINDS.items():
        any_kind = [_typed(kind, made, definitions) for kind, made in sorted(kinds.items())]
        properties[group] = {"type": "object", "additionalProperties": {"anyOf": any_kind}}
    properties["defaults"] = _defaults(definitions)
    scalar = _hoisted(Scalar, definitions)
    properties["scalars"] = {"type": "object", "additionalProperties": scalar}
    properties["signals"] = {"type": "object", "additionalProperties": Scheduled("number").json()}
    properties["routes"] = {"type": "object", "additionalProperties": _hoisted(Route, definitions)}
    limit = keys_json(limit_keys("pressure", "pressure"))
    properties["limits"] = {"type": "object", "additionalProperties": limit}
    properties["expect"] = properties["compare"] = {
        "type": "object",
        "additionalProperties": {"type": "object"},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fvsolve case",
        "type": "object",
        "properties": properties,
        "required": [group for group in GROUPS if group != "links"],
        "if": {
            "properties": {"nodes": {"additionalProperties": {"properties": {"type": {"not": {"enum": list(ALONE)}}}}}}
        },
        "then": {"required": ["links"]},  # without a basin or a body
        "additionalProperties": False,
        "$defs": definitions,
    }


def shared(made: dict[str, Any]) -> dict[str, Any]:
    """The same schema with what is said twice said once, under `$defs`; words and defaults stand beside references."""
    times: Counter[str] = Counter()
    names: dict[str, str] = {}

    def count(part: Any, key: str) -> None:
        if isinstance(part, dict) and _schema(part):
            text = dumps(_bare(part), sort_keys=True)
            times[text] += 1
            if times[text] > 1:  # all below it is said where this is
                return
            names[text] = _name(part) or key
        for word, inner in part.items() if isinstance(part, dict) else [(key, inner) for inner in part]:
            if isinstance(inner, (dict, list)):
                count(inner, key if word in WORDS else word)

    count(made, "case")
    names = _apart({text: names[text] for text, many in times.items() if many > 1 and len(text) > SHORT})

    def replaced(part: Any, whole: bool = False) -> Any:
        if isinstance(part, dict):
            if not whole and (name := names.get(dumps(_bare(part), sort_keys=True))):
                return {"$ref": f"#/$defs/{name}", **{key: part[key] for key in BESIDE if key in part}}
            return {key: replaced(inner) for key, inner in part.items()}
        return [replaced(inner) for inner in part] if isinstance(part, list) else part

    found = replaced(made)
    found["$defs"] |= {name: replaced(loads(text), whole=True) for text, name in names.items()}
    return found


def _bare(part: dict[str, Any]) -> dict[str, Any]:
    return {key: one for key, one in part.items() if key not in BESIDE}


def _schema(part: dict[str, Any]) -> bool:
    """Whether it says what a value may be, and is no table of such by key."""
    return any(isinstance(part.get(word), (str, list)) for word in ("type", "anyOf", "enum"))


def _apart(names: dict[str, str]) -> dict[str, str]:
    """Names numbered where they are alike."""
    many: Counter[str] = Counter()
    for text, name in names.items():
        many[name] += 1
        names[text] = f"{name}-{many[name]}" if many[name] > 1 else name
    return names


def _name(part: dict[str, Any]) -> str:
    """What a part that may be shared is called: its dimension, of a schedule its values', of a table its keys."""
    first = next(iter(part.get("anyOf", [])), part)
    if isinstance(first, dict) and set(first) <= {"type", "examples", "x-dimension", *BESIDE} and "anyOf" in part:
        return f"schedule-of-{first.get('x-dimension', 'number')}"
    if part.get("type") == "array" and "enum" not in part["items"]:
        least = part.get("minItems", 1)
        return f"{least if least > 1 else 'list'}-of-{part['items'].get('x-dimension', 'number')}"
    keys = part.get("properties")
    if isinstance(keys, dict) and "title" not in part:
        return "-".join(keys)
    return part.get("x-dimension", "")


def _without_titles(part: Any) -> Any:
    """The same without what pydantic adds to every key: its name again, and that nothing is the default."""
    if isinstance(part, list):
        return [_without_titles(one) for one in part]
    if not isinstance(part, dict):
        return part
    made = {key: _without_titles(one) for key, one in part.items() if (key, one) != ("default", None)}
    if isinstance(made.get("properties"), dict):
        made["properties"] = {key: {word: said for word, said in one.items() if word != "title"}
                              for key, one in made["properties"].items()}  # fmt: skip
    return made


def _hoisted(model: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """A model's schema with its definitions moved to the top."""
    made = _without_titles(model.model_json_schema(by_alias=True))
    definitions |= made.pop("$defs", {})
    return made


def _defaults(definitions: dict[str, Any]) -> dict[str, Any]:
    """Keys of `[defaults.KIND]`: those of the parts, none of them needed."""
    made = {}
    for kind, model in defaults.KINDS.items():
        keys = _hoisted(model, definitions)["properties"]
        own = {key: _bare(one) for key, one in keys.items() if key not in defaults.OWN}
        made[kind] = {"type": "object", "properties": own, "additionalProperties": False}
    return {"type": "object", "properties": made, "additionalProperties": False}


def _typed(kind: str, model: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    made = _hoisted(model, definitions)
    made["properties"] = {"type": {"const": kind}, **made["properties"]}
    made["required"] = ["type", *made.get("required", [])]
    return made
