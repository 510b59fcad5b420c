"""Command `fvsolve parts`: types of parts, names of practice, keys and examples."""

from collections.abc import Iterator
from typing import Annotated

from typer import Argument

from fvsolve.cli.app import Json, command
from fvsolve.cli.terminal import present
from fvsolve.core.output.result_table import ResultTable

HEADS = ("key", "values", "default", "meaning")


def overview() -> Iterator:
    """Lines on all types of parts, by group."""
    from fvsolve.case.part_names import names_of_practice, part_types

    types = part_types()
    width = max(map(len, types))
    for group in dict.fromkeys(entry.group for entry in types.values()):
        yield group, "bold"
        for kind, entry in types.items():
            if entry.group == group:
                yield f"  {kind.ljust(width)}  {entry.about}"
        yield ""
    number = sum(len(entry.names) for entry in names_of_practice())
    yield "fvsolve parts TYPE explains a type: its keys with units and defaults, and an example."
    yield f'fvsolve parts NAME explains one of {number} names of practice, such as "one-way tank", NRV or standpipe.'


def list_of(word: str, entries: list) -> Iterator:
    """Lines on the entries of a word with several meanings."""
    yield f"{word} has {len(entries)} meanings:"
    for entry in entries:
        name = next((name for name in entry.names if name.casefold() != word.casefold()), word)
        yield f"  {name} ({', '.join(entry.parts)}): {entry.about}"
    yield 'fvsolve parts "NAME" or fvsolve parts TYPE explains a meaning.'


def explanation(word: str, entry) -> Iterator:
    """Lines on an entry: its meaning, the keys of its parts, an example, and the nodes that the example needs."""
    from fvsolve.case.part_names import group_of

    title = name_of_word(entry, word)
    yield title, "bold"
    if not entry.group:
        joined = " and " if entry.composed else " or "
        yield joined.join(f"{kind} (under [{group_of(kind)}])" for kind in entry.parts)
        others = [name for name in entry.names if name != title]
        yield f"also named {', '.join(others)}" if others else "no other names"
    yield entry.about
    for kind in entry.parts if len(entry.parts) == 1 else ():
        yield ""
        yield ResultTable.of("", HEADS, [list(row.values()) for row in key_rows(kind)])
    if len(entry.parts) > 1:
        yield f"keys: {', '.join(f'fvsolve parts {kind}' for kind in entry.parts)}"
    yield ""
    yield "example", "bold"
    yield from entry.example.splitlines()
    if text := needed_nodes(entry.example):
        yield ""
        yield text


def name_of_word(entry, word: str) -> str:
    """Name of an entry that equals `word`, otherwise its first name with the word, otherwise the first."""
    from fvsolve.case.part_names import folded

    names = {folded(name): name for name in entry.names}
    key = folded(word)
    return names.get(key) or next((names[name] for name in names if key in name), entry.names[0])


def needed_nodes(example: str) -> str:
    """Sentence on the nodes that an example names and does not define; "" without such nodes."""
    import tomllib

    from fvsolve.case.part_names import missing_nodes, neighbours

    missing = missing_nodes(tomllib.loads(example))
    kinds = {name: tomllib.loads(neighbours()[name])["nodes"][name]["type"] for name in missing}
    words = ", ".join(f"{name} ({kind})" for name, kind in kinds.items())
    return f"nodes of the case that the example joins: {words}" if words else ""


def key_rows(kind: str) -> list[dict[str, str]]:
    """Keys of a type with their values and units, default and meaning, required keys first."""
    from fvsolve.case.key_tables import model_of, row
    from fvsolve.parts.value import NEEDED

    model = model_of(kind)
    fields = {info.alias or key: info for key, info in model.model_fields.items()}
    rows = []
    for key, value in model.values().items():
        field = fields[key]
        default = NEEDED if field.is_required() else field.get_default(call_default_factory=True)
        _, values, text, _, meaning = row(key, value, default, model.needs)
        text = text.replace("*needed*", "required").replace("*none*", "none")
        cells = (key, values, text, meaning)
        rows.append({head: cell.replace("`", "") for head, cell in zip(HEADS, cells, strict=True)})
    return sorted(rows, key=lambda cells: not cells["default"].startswith("required"))


@command("parts", order=35)
def parts(
    word: Annotated[
        str | None,
        Argument(
            metavar="WORD",
            help='type of a part, or a name of practice such as "one-way tank" (default all types)',
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the types of parts. With WORD explain a type or a name of practice: keys, units, defaults, an example."""
    from fvsolve.case.part_names import find_parts, part_types, unknown_part

    if word is None:
        types = part_types()
        return present(as_json, {kind: entry.plain() for kind, entry in types.items()}, overview())
    entries = find_parts(word)
    if not entries:
        raise unknown_part(word)
    lines = explanation(word, entries[0]) if len(entries) == 1 else list_of(word, entries)
    keys = [{kind: key_rows(kind) for kind in entry.parts} for entry in entries if as_json]
    data = [entry.plain() | {"keys": own} for entry, own in zip(entries, keys, strict=False)]
    present(as_json, {"entries": data}, lines)
