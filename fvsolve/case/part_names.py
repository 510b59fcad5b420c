"""Types of parts with their examples, names of practice for them, and the completion of an example to a case."""

import functools
import tomllib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from fvsolve.data import read_table
from fvsolve.errors import FvsolveError, did_you_mean, listing, nearest
from fvsolve.parts import KINDS
from fvsolve.units import show

HEADER = 'schema = 1\ntitle = "Example"\n\n[fluid]\nname = "Water"\n'
FOOTER = '\n[numerics]\nend = "END"\n'
END = "1 s"  # of a scene with an example
MOST_COMPARED = (
    50  # unknown types in a file that are compared with all names, which takes 7 ms each
)
UNLINKED = ("basin", "body", "terminal")  # nodes without a link of the completed scene
PLACE_KEYS = ("from", "to", "pilot")  # keys of links that name a place


@dataclass(frozen=True)
class PartName:
    """Type of part, or names of practice for parts.

    names : names of practice, or the type alone; parts : types of parts; about : sentence; example : TOML
    group : group of a type; "" for names of practice; end : time at which the scene of the example ends
    composed : True if the example composes all of `parts`
    """

    names: tuple[str, ...]
    parts: tuple[str, ...]
    about: str
    example: str
    group: str = ""
    end: str = END
    composed: bool = False

    def plain(self) -> dict[str, Any]:
        """Values for JSON, with the complete case `scene`."""
        return asdict(self) | {"scene": scene_of(self.example, self.end)}


@functools.cache
def part_types() -> dict[str, PartName]:
    """Types of parts of the package, in the order of their groups : type -> entry."""
    return {
        kind: PartName(
            (kind,),
            (kind,),
            item["about"],
            item["example"].strip(),
            item["group"],
            item.get("end", END),
        )
        for kind, item in read_table("part_examples")["types"].items()
    }


@functools.cache
def names_of_practice() -> list[PartName]:
    """Names of practice, in the order of their file; without an example of its own, an entry has that of its type."""
    return [entry_of(item) for item in read_table("names_of_practice")["entries"]]


def entry_of(item: dict[str, Any]) -> PartName:
    """Entry of names of practice; item : its keys in the file"""
    parts = item["parts"]
    given = item if "example" in item else vars(part_types()[parts[0]])
    example = given["example"].strip()
    return PartName(
        tuple(item["names"]),
        tuple(parts),
        item["about"],
        example,
        end=given.get("end", END),
        composed=len(parts) > 1 and types_of(example) >= {*parts},
    )


def types_of(example: str) -> set[str]:
    """Types of the parts of an example."""
    table = tomllib.loads(example)
    return {part["type"] for group in KINDS for part in table.get(group, {}).values()}


def folded(word: str) -> str:
    """Name without case, in which a blank and "_" are "-"."""
    return "-".join(word.casefold().replace("_", " ").replace("-", " ").split())


@functools.cache
def index() -> dict[str, list[PartName]]:
    """Entries by folded name; a type comes before names of practice."""
    found: dict[str, list[PartName]] = {}
    for entry in (*part_types().values(), *names_of_practice()):
        for name in entry.names:
            entries = found.setdefault(folded(name), [])
            entries += [] if entry in entries else [entry]
    return found


def find_parts(word: str) -> list[PartName]:
    """Entries of a name; without such a name, entries of which a name contains the word; none for an unknown word."""
    key = folded(word)
    if key in part_types():
        return [part_types()[key]]
    if exact := index().get(key) or index().get(key.removesuffix("s")):
        return exact
    inside = [entries for name, entries in index().items() if f"-{key}-" in f"-{name}-"]
    return list(dict.fromkeys(entry for entries in inside for entry in entries))


def unknown_part(word: str) -> FvsolveError:
    """Error for a word that is no name of a part, with the nearest name."""
    entries = (*part_types().values(), *names_of_practice())
    names = {folded(name): name for entry in entries for name in entry.names}
    near = nearest(folded(word), names)
    hint = f'; did you mean "{names[near]}"?' if near else "; fvsolve parts lists all types"
    return FvsolveError(f"unknown part {show(word)}{hint}")


def type_hint(word: str, group: str) -> str:
    """Hint for an unknown type in a case file, from the types of its table and the names of practice.

    group : "nodes" or "links", the table in which the type stands; its types come first
    """
    key, known = folded(word), [*KINDS[group]]
    compared = index() if FvsolveError.compared < MOST_COMPARED else ()
    near = key if key in index() else nearest(key, [*known, *compared])
    if near is None or near in known or near in part_types():
        return f"; types are {listing(known)}{did_you_mean(word, known)}"
    entries = index()[near]
    types = dict.fromkeys(kind for entry in entries for kind in entry.parts)
    conjunction = " and " if len(entries) == 1 and entries[0].composed else " or "
    quoted = [f'"{kind}"' for kind in types]
    text = conjunction.join(filter(None, [", ".join(quoted[:-1]), quoted[-1]]))
    place = f", under [{group_of(next(iter(types)))}]" if not {*types} & {*known} else ""
    name = near.replace("-", " ")
    return f"; did you mean {text} ({full_name(entries, near)}){place}? For an example: fvsolve parts {show(name)}"


def group_of(kind: str) -> str:
    """Table of the case file in which a type stands: "nodes", "links" or "controls"."""
    return next((group for group, kinds in KINDS.items() if kind in kinds), "controls")


def full_name(entries: list[PartName], key: str) -> str:
    """Name with the folded name `key`; in place of an abbreviation of a single entry, its first long name."""
    names = [name for entry in entries for name in entry.names]
    name = next(name for name in names if folded(name) == key)
    if len(entries) > 1 or not name.isupper():
        return name
    return next((other for other in names if not other.isupper()), name)


def scene_of(example: str, end: str = END) -> str:
    """Complete case of an example, as TOML: with a fluid, the nodes that it does not define, and an end time.

    end : end time. Raises FvsolveError if the example names a node that is neither its own nor a neighbour.
    """
    text = example
    for _ in range(len(neighbours()) + 1):
        table = tomllib.loads(text)
        added = missing_nodes(table)
        if not added and (alone := unjoined_nodes(table)):
            text += "".join("\n" + joined_links(table["nodes"][name], name) for name in alone)
        elif not added:
            break
        text += "".join("\n" + neighbours()[name] for name in added)
    return f"{HEADER}\n{text.strip()}\n{FOOTER.replace('END', end)}"


def neighbours() -> dict[str, str]:
    """TOML of the nodes that examples may name without a definition."""
    return read_table("part_examples")["neighbours"]


def places_of(link: dict[str, Any]) -> Iterator[str]:
    """Yield the nodes and parts that a link names."""
    places = [link[key] for key in PLACE_KEYS if key in link]
    places += [*link.get("ports", {}).values(), *link.get("senses", ())]
    for place in places:
        yield place.partition(".")[0]


def missing_nodes(table: dict[str, Any]) -> list[str]:
    """Nodes that the links and controls of an example name and that it does not define.

    Raises FvsolveError for a name that is not a neighbour.
    """
    named = [place for link in table.get("links", {}).values() for place in places_of(link)]
    named += [
        block["input"].partition(".")[0]
        for block in table.get("controls", {}).values()
        if "input" in block
    ]
    own = {*table.get("nodes", {}), *table.get("links", {}), "controls"}
    missing = [name for name in dict.fromkeys(named) if name not in own]
    if strange := [name for name in missing if name not in neighbours()]:
        raise FvsolveError(
            f"the example names {show(strange[0])}{did_you_mean(strange[0], neighbours())}; "
            f"expected a node of its own, or one of {', '.join(neighbours())}"
        )
    return missing


def unjoined_nodes(table: dict[str, Any]) -> list[str]:
    """Nodes without a link, except nodes that need no link."""
    joined = {place for link in table.get("links", {}).values() for place in places_of(link)}
    return [
        name
        for name, node in table.get("nodes", {}).items()
        if name not in joined and node["type"] not in UNLINKED
    ]


def joined_links(node: dict[str, Any], name: str) -> str:
    """TOML of links that join a node to neighbours; node : its keys."""
    texts = read_table("part_examples")["joined"]
    kind = node["type"]
    return texts.get(kind, texts.get(KINDS["nodes"][kind].domain, "")).replace("NAME", name)
