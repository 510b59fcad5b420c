"""Generated contents of the pages of parts: index, symbol, names of practice, example and keys of a type."""

import re
from functools import cache
from pathlib import Path

from fvsolve.case import key_tables, part_names
from fvsolve.parts import KINDS

FOLDER = Path(__file__).parent / "parts"
OWN = re.compile(r"^<!-- generated: part (\S+) -->$", re.MULTILINE)
FILLS = {"white": "none", "ink": "currentColor", "water": "#4a90d9"}


@cache
def page_of_types() -> dict[str, str]:
    """Place of each type of part in the folder of parts : type -> FILE.md, or FILE.md#TYPE on the page of a family.

    Raises ValueError for a type of the package without a page, and for a type on two pages.
    """
    places: dict[str, str] = {}
    for path in sorted(FOLDER.glob("*.md")):
        kinds = OWN.findall(path.read_text(encoding="utf-8"))
        for kind in kinds:
            if kind in places:
                raise ValueError(f"docs/parts/{path.name}: {kind} has a second page; expected one")
            places[kind] = path.name if len(kinds) == 1 else f"{path.name}#{kind}"
    if lost := sorted(part_names.part_types().keys() - places.keys()):
        mark = f"<!-- generated: part {lost[0]} -->"
        raise ValueError(f"docs/parts: no page has {', '.join(lost)}; expected a line {mark}")
    return places


def part(kind: str) -> str:
    """Sentence on a type of part, its symbol, its names of practice, and an example in TOML."""
    entry = part_names.part_types()[kind]
    names = [
        name
        for one in part_names.names_of_practice()
        if one.parts[0] == kind and not one.composed
        for name in one.names
    ]
    also = f"Names of practice: {', '.join(names)}.\n\n" if names else ""
    return f"{entry.about}\n\n{symbol(kind)}{also}```toml\n{entry.example}\n```\n"


def symbol(kind: str) -> str:
    """Symbol of a type of part in pictures, as SVG; "" for blocks of controls and for pipes, which are lines."""
    from fvsolve.report.draw.sheet import strokes, symbol_of

    link = kind in KINDS["links"]
    model = KINDS["links" if link else "nodes"].get(kind)
    if model is None or kind == "pipe":
        return ""
    kinds = [one.kind for one in model.__mro__ if getattr(one, "kind", "")]
    shapes = "".join(
        f'<{"polygon" if closed else "polyline"} fill="{FILLS[fill] if closed else "none"}" points="'
        + " ".join(f"{x:g},{-y:g}" for x, y in points)
        + '"/>'
        for fill, points, closed in strokes(symbol_of(kinds, link))
    )
    return (
        f'```{{raw}} html\n<svg class="symbol" role="img" aria-label="symbol of {kind}" viewBox="-1.1 -1.1 2.2 2.2">'
        f"{shapes}</svg>\n```\n\n"
    )


def keys(*words: str) -> str:
    """Table of the keys of a type of part or of another table of the case, with links from the folder of parts."""
    text = key_tables.key_table(" ".join(words))
    text = re.sub(r"(?<=\]\()(?=[\w-]+\.md)", "../", text)
    return re.sub(r"\]\(#([\w-]+)\)", r"](\1.md)", text)


def part_index() -> str:
    """Sections of the types of parts by group: type with its page, and a sentence."""
    types = part_names.part_types()
    text = ""
    for group in dict.fromkeys(entry.group for entry in types.values()):
        rows = [
            f"| [{kind}]({page_of_types()[kind].partition('#')[0]}) | {entry.about} |\n"
            for kind, entry in types.items()
            if entry.group == group
        ]
        text += f"## {group.capitalize()}\n\n| type | meaning |\n|---|---|\n{''.join(rows)}\n"
    return text
