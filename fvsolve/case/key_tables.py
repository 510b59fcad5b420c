"""Key tables of pages in docs, generated from the declarations of parts.

python -m fvsolve.case.key_tables docs/structures.md    rewrites the tables of a page between their marks
python -m fvsolve.case.key_tables valve                 prints the table of a part
"""

import re
import sys
from pathlib import Path
from typing import Any

from fvsolve.case.load import TOP
from fvsolve.case.pipe_routes import Route
from fvsolve.case.sections import FluidSpec, Numerics, Output, OutputGrid, OutputLine, RunUp
from fvsolve.case.text import inline
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.file_replacement import write_file
from fvsolve.parts import KINDS, Friction, Node, Scalar
from fvsolve.parts.accumulator.part import Compressor
from fvsolve.parts.attitude_keys import Attitude
from fvsolve.parts.basin import BasinMesh, BasinStart, Patch
from fvsolve.parts.body import Joint
from fvsolve.parts.connection import Connection
from fvsolve.parts.control import Control
from fvsolve.parts.culvert.part import inlets
from fvsolve.parts.cylinder import DryFriction
from fvsolve.parts.nodes_and_links import PlaceOnBody, TwoPort
from fvsolve.parts.pipe.pipe_wall import SI, Lining, Wall, materials
from fvsolve.parts.pump.energy_use import EnergyUse
from fvsolve.parts.reaction import Reaction
from fvsolve.parts.self_acting.part import Disc
from fvsolve.parts.table_model import Table, plain_value
from fvsolve.parts.value import NEEDED, Quantity, Text, Value
from fvsolve.parts.valve import Sized
from fvsolve.units import DIMENSIONS, show

TABLES: dict[str, type[Table]] = {
    "every node": Node,
    "riding": PlaceOnBody,
    "every link": TwoPort,
    "friction": Friction,
    "connection": Connection,
    "compressor": Compressor,
    "dry friction": DryFriction,
    "wall": Wall,
    "lining": Lining,
    "patch": Patch,
    "start": BasinStart,
    "line": OutputLine,
    "run-up": RunUp,
    "grid": OutputGrid,
    "mesh": BasinMesh,
    "scalar": Scalar,
    "reaction": Reaction,
    "fluid": FluidSpec,
    "numerics": Numerics,
    "output": Output,
    "energy": EnergyUse,
    "route": Route,
    "joint": Joint,
    "attitude": Attitude,
}
# base class -> part whose table lists its keys in full
SHARED = {Node: "", PlaceOnBody: "", TwoPort: "", Sized: "valve", Disc: "check-valve"}
LEFT_OUT = " if left out"
HEAD = ("key", "what it may be", "default", "changes", "")
MARK = re.compile(r"(<!-- keys: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """Text of a page with its tables rewritten; each table is between `<!-- keys: NAME -->` and `<!-- end -->`."""
    return MARK.sub(lambda mark: mark[1] + key_table(mark[2]) + mark[3], text)


def key_table(name: str) -> str:
    """Markdown table of the keys of a part or of another table of the case. Raises FvsolveError for unknown names."""
    if name == "materials":
        return materials_table()
    if name == "culvert inlets":
        return inlets_table()
    if name == "case":
        top = {
            "ambient_pressure": (Quantity("pressure", about="absolute ambient pressure"), 101325.0),
            **TOP,
        }
        rows = [row(key, value, default) for key, (value, default) in top.items()]
    else:
        rows = rows_of(name, model_of(name))
    lines = (
        " | ".join(cell.replace("|", "\\|") for cell in cells)
        for cells in (HEAD, ("---",) * len(HEAD), *rows)
    )
    return "".join(f"| {line} |\n" for line in lines)


def materials_table() -> str:
    """Markdown table of materials: range of each property, and the sources."""
    head = (
        "material",
        "modulus [GPa]",
        "Poisson's ratio",
        "roughness [mm]",
        "density [kg/m3]",
        "specific heat [J/kg/K]",
        "read in",
    )
    rows = [head, ("---",) * len(head)]
    for name, material in materials().items():
        figures = [material.figures.get(key) for key in SI]
        spans = ["" if figure is None else figure.span(" to ") for figure in figures]
        read = dict.fromkeys(source for figure in figures if figure for source in figure.sources)
        rows.append((f"`{name}`", *spans, ", ".join(read)))
    return "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def inlets_table() -> str:
    """Markdown table of the inlets of culverts, in the order of HDS-5."""
    head = ("inlet", "chart", "scale", "form", "K", "M", "c", "Y", "ke", "shape and edge")
    rows = [
        head,
        ("---",) * len(head),
        *((f"`{name}`", *map(str, inlet)) for name, inlet in inlets().items()),
    ]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def model_of(name: str) -> type[Table]:
    """Declaration (class) of a type of part, or of another table of the case."""
    known = {**TABLES, **Control.kinds, **KINDS["nodes"], **KINDS["links"]}
    if name not in known:
        raise FvsolveError(
            f"unknown table of keys {show(name)}{did_you_mean(name, known)}; expected a type of part, "
            f"or one of {', '.join(TABLES)}, case"
        )
    return known[name]


def rows_of(name: str, model: type[Table]) -> list[tuple[str, ...]]:
    """Rows of the table of a part, one per key. Keys that are listed in the table of another part share one row.

    Keys of all nodes, of places on bodies and of all links with two ports are left out, except in their own tables.

    name, model : name and class of the part
    """
    rows = [row("type", Text(), NEEDED)] if name in ("every node", "every link") else []
    borrowed: dict[str, str] = {}  # key -> owner
    for base, owner in SHARED.items():
        if issubclass(model, base) and model is not base and name != owner:
            borrowed |= {
                key: owner for key, value in base.values().items() if model.values()[key] is value
            }
    for owner in dict.fromkeys(filter(None, borrowed.values())):
        keys = ", ".join(f"`{key}`" for key, other in borrowed.items() if other == owner)
        rows.append((keys, f"see [{owner.replace('-', ' ')}](#{owner})", "", "", ""))
    fields = {info.alias or key: info for key, info in model.model_fields.items()}
    for key, value in model.values().items():
        if key not in borrowed:
            default = (
                NEEDED
                if fields[key].is_required()
                else fields[key].get_default(call_default_factory=True)
            )
            rows.append(row(key, value, default, model.needs))
    return rows


def row(
    key: str, value: Value, default: Any, needs: tuple[tuple[str, ...], ...] = ()
) -> tuple[str, ...]:
    """Cells of the row of a key: name, accepted values, default, effect of a change, description.

    needs : as for `default_cell`
    """
    words, left_out = about(value)
    return (
        f"`{key}`",
        value.takes,
        left_out or default_cell(key, default, needs),
        value.changes,
        words,
    )


def about(value: Value) -> tuple[str, str]:
    """Description of a key without its unit, and the text of its default : (description, default).

    The default is the part of the description before "if left out", or "".
    """
    unit = (
        DIMENSIONS[value.dimension].si
        if isinstance(getattr(value, "dimension", None), str)
        else "-"
    )
    words = value.about.replace(f" [{unit}]", "").replace(f"[{unit}]", "").strip("; ")
    if not words.endswith(LEFT_OUT):
        return words, ""
    words, _, default = words.removesuffix(LEFT_OUT).rpartition("; ")
    return words, default


def default_cell(key: str, default: Any, needs: tuple[tuple[str, ...], ...]) -> str:
    """Text of the default of a key; needs : groups of keys of which a table needs at least one."""
    for group in needs:
        if key in group:
            return f"*needed*, or {', '.join(f'`{other}`' for other in group if other != key)}"
    if default is NEEDED:
        return "*needed*"
    content = plain_value(default)
    if isinstance(content, dict):
        content = {key: value for key, value in content.items() if value is not None}
    if content in (None, {}, (), ""):
        return "*none*"
    is_number = isinstance(content, (int, float)) and not isinstance(content, bool)
    return f"{content:g}" if is_number else f"`{inline(content)}`"


def main(given: list[str]) -> None:
    """Rewrite the pages (.md) and print the tables that are named in the command line `given`."""
    for argument in given:
        if argument.endswith(".md"):
            write_file(argument, page(Path(argument).read_text(encoding="utf-8")))
        else:
            print(key_table(argument), end="")


if __name__ == "__main__":
    main(sys.argv[1:])
