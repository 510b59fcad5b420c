"""The JSON schema of a case file, for editors. Knows the parts' own schemas; adds nothing to them."""

from __future__ import annotations

import re
from collections import Counter
from json import dumps, loads
from typing import Any

from fvsolve.case.load import GROUPS, KEYS, TOP
from fvsolve.case.sections import ExactSpec, FluidSpec, Numerics, Output
from fvsolve.parts import KINDS, Scalar
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table import keys_json
from fvsolve.parts.value import Quantity


def schema() -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of a case file; what is said twice stands once under `$defs`."""
    return shared(whole())


def printed(made: dict[str, Any]) -> str:
    """A schema as text, lists of words or numbers in a line."""
    return re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", dumps(made, indent=2))


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


def shared(made: dict[str, Any]) -> dict[str, Any]:
    """The same schema with schedules and forms of them that are said twice said once, under `$defs`."""
    times: Counter[str] = Counter()

    def count(part: Any) -> None:
        if isinstance(part, dict) and _name(part):
            times[dumps(part)] += 1
        for inner in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
            count(inner)

    count(made)
    texts = [text for text, many in times.items() if many > 1]
    names: dict[str, str] = {}
    for text in texts:
        name = _name(loads(text))
        alike = sum(_name(loads(known)) == name for known in names)
        names[text] = f"{name}-{alike + 1}" if alike else name

    def replaced(part: Any, whole: bool = False) -> Any:
        if isinstance(part, dict):
            if not whole and (name := names.get(dumps(part))):
                return {"$ref": f"#/$defs/{name}"}
            return {key: replaced(inner) for key, inner in part.items()}
        return [replaced(inner) for inner in part] if isinstance(part, list) else part

    found = replaced(made)
    found["$defs"] |= {name: replaced(loads(text), whole=True) for text, name in names.items()}
    return found


def _name(part: dict[str, Any]) -> str:
    """What a part that may be shared is called: a schedule or its forms, by what they are of; none for others."""
    first = next(iter(part.get("anyOf", [])), part)
    if set(part) == {"anyOf"} and isinstance(first, dict) and set(first) <= {"type", "examples", "x-dimension"}:
        return f"schedule-of-{first.get('x-dimension', 'number')}"
    keys = part.get("properties")
    if isinstance(keys, dict) and set(part) <= {"type", "properties", "required", "additionalProperties"}:
        return "-".join(keys)
    return ""


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
