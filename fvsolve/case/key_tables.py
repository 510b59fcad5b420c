"""The key tables of docs/parts.md, from the declarations. Knows Markdown; knows no law.

python -m fvsolve.case.key_tables docs/parts.md    writes the tables of a page anew, between their marks
python -m fvsolve.case.key_tables valve            prints one, of any part, of others too
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from fvsolve.case.load import TOP
from fvsolve.case.routes import Route
from fvsolve.case.sections import FluidSpec, Line, Numerics, Output
from fvsolve.case.text import inline
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.parts import KINDS, Friction, Node, Scalar
from fvsolve.parts.accumulator.shape import Compressor
from fvsolve.parts.attitude import Attitude
from fvsolve.parts.basin.part import Patch, StartOfFields
from fvsolve.parts.body.part import Joint
from fvsolve.parts.connection.part import Connection
from fvsolve.parts.disc.part import Disc
from fvsolve.parts.link import TwoPort
from fvsolve.parts.node import Rider
from fvsolve.parts.pipe.materials import SI, materials
from fvsolve.parts.pipe.wall import Lining, Wall
from fvsolve.parts.table import Table, plain
from fvsolve.parts.value import NEEDED, Quantity, Text, Value
from fvsolve.parts.valve.part import Sized
from fvsolve.units import DIMENSIONS, show

TABLES: dict[str, type[Table]] = {
    "every node": Node, "riding": Rider, "every link": TwoPort, "friction": Friction, "connection": Connection,
    "compressor": Compressor,
    "wall": Wall, "lining": Lining, "patch": Patch, "start": StartOfFields, "line": Line, "scalar": Scalar,
    "fluid": FluidSpec, "numerics": Numerics, "output": Output, "route": Route, "joint": Joint, "attitude": Attitude,
}  # fmt: skip
# whose keys -> the part that has them in full
SHARED = {Node: "", Rider: "", TwoPort: "", Sized: "valve", Disc: "check-valve"}
LEFT_OUT = " if left out"
HEAD = ("key", "what it may be", "default", "changes", "")
MARK = re.compile(r"(<!-- keys: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """A page with its tables written anew, each between `<!-- keys: NAME -->` and `<!-- end -->`."""
    return MARK.sub(lambda mark: mark[1] + key_table(mark[2]) + mark[3], text)


def key_table(name: str) -> str:
    """The Markdown table of the keys of a part or another table of the case; FvsolveError where there is none such."""
    if name == "materials":
        return materials_table()
    if name == "case":
        found = {"ambient_pressure": (Quantity("pressure", about="absolute"), 101325.0), **TOP}
        rows = [row(key, value, default) for key, (value, default) in found.items()]
    else:
        rows = rows_of(name, model_of(name))
    lines = (" | ".join(cell.replace("|", "\\|") for cell in cells) for cells in (HEAD, ("---",) * len(HEAD), *rows))
    return "".join(f"| {line} |\n" for line in lines)


def materials_table() -> str:
    """What is known of materials: least to greatest of each figure, and where it was read."""
    head = ("material", "modulus [GPa]", "Poisson's ratio", "roughness [mm]", "density [kg/m3]", "read in")
    rows = [head, ("---",) * len(head)]
    for name, one in materials().items():
        found = [one.figures.get(key) for key in SI]
        spans = ["" if it is None else it.span(" to ") for it in found]
        read = dict.fromkeys(source for it in found if it for source in it.sources)
        rows.append((f"`{name}`", *spans, ", ".join(read)))
    return "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def model_of(name: str) -> type[Table]:
    """The declaration of a part's kind, or of another table."""
    known = {**TABLES, **KINDS["nodes"], **KINDS["links"]}
    if name not in known:
        raise FvsolveError(f"no keys of {show(name)}{did_you_mean(name, known)}; wanted the type of a part, or one of "
                           f"{', '.join(TABLES)}, case")  # fmt: skip
    return known[name]


def rows_of(name: str, model: type[Table]) -> list[tuple[str, ...]]:
    """A row a key; keys that another part has in full in one."""
    rows = [row("type", Text(), NEEDED)] if name in ("every node", "every link") else []
    theirs: dict[str, str] = {}  # key -> whose
    for base, owner in SHARED.items():
        if issubclass(model, base) and model is not base and name != owner:
            theirs |= {key: owner for key, value in base.values().items() if model.values()[key] is value}
    for owner in dict.fromkeys(filter(None, theirs.values())):
        keys = ", ".join(f"`{key}`" for key, one in theirs.items() if one == owner)
        rows.append((keys, f"as of a [{owner.replace('-', ' ')}](#{owner})", "", "", ""))
    fields = {info.alias or key: info for key, info in model.model_fields.items()}
    for key, value in model.values().items():
        if key not in theirs:
            default = NEEDED if fields[key].is_required() else fields[key].get_default(call_default_factory=True)
            rows.append(row(key, value, default, model.needs))
    return rows


def row(key: str, value: Value, default: Any, needs: tuple[tuple[str, ...], ...] = ()) -> tuple[str, ...]:
    """The cells of a key."""
    words, left_out = about(value)
    return f"`{key}`", value.takes, left_out or default_cell(key, default, needs), value.changes, words


def about(value: Value) -> tuple[str, str]:
    """(words without the unit, which has a column of its own, what holds if the key is left out)."""
    unit = DIMENSIONS[value.dimension].si if isinstance(getattr(value, "dimension", None), str) else "-"
    words = value.about.replace(f" [{unit}]", "").replace(f"[{unit}]", "").strip("; ")
    if not words.endswith(LEFT_OUT):
        return words, ""
    words, _, what = words.removesuffix(LEFT_OUT).rpartition("; ")
    return words, what


def default_cell(key: str, default: Any, needs: tuple[tuple[str, ...], ...]) -> str:
    """What a key is where the file does not say it."""
    for group in needs:
        if key in group:
            return f"*needed*, or {', '.join(f'`{other}`' for other in group if other != key)}"
    if default is NEEDED:
        return "*needed*"
    said = plain(default)
    if isinstance(said, dict):
        said = {key: one for key, one in said.items() if one is not None}
    if said in (None, {}, (), ""):
        return "*none*"
    return f"{said:g}" if isinstance(said, (int, float)) and not isinstance(said, bool) else f"`{inline(said)}`"


def main(given: list[str]) -> None:
    """Write the pages and print the tables that are named."""
    for one in given:
        if one.endswith(".md"):
            Path(one).write_text(page(Path(one).read_text(encoding="utf-8")), encoding="utf-8")
        else:
            print(key_table(one), end="")


if __name__ == "__main__":
    main(sys.argv[1:])
