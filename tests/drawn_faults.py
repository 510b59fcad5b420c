"""Faults at places of the package that are drawn by a seed: a sign, a factor, a comparison, or an index.

`python tests/planted_faults.py --draw 40 --seed 1` plants them. A place is an operator or an index within a function of
a kernel, a law, a lowering or a study. Equal seeds draw equal faults from equal sources.
"""

from __future__ import annotations

import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle, islice, product
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "fvsolve"
GROUPS = ("kernels", "laws", "lowerings", "studies")
SIGNS = {ast.Add: ("+", "-"), ast.Sub: ("-", "+")}
COMPARISONS = {ast.Lt: ("<", ">"), ast.Gt: (">", "<"), ast.LtE: ("<=", ">="), ast.GtE: (">=", "<=")}


@dataclass(frozen=True)
class DrawnFault:
    """Replacement of a text at a place of a file of the package.

    path : below fvsolve; start : number of characters before the place
    """

    path: str
    start: int
    old: str
    new: str

    def planted(self, text: str) -> str:
        """Text of the file with the fault; raises ValueError if the old text does not stand at the place."""
        if not text.startswith(self.old, self.start):
            raise ValueError(
                f"fvsolve/{self.path}: {self.old!r} does not stand at character {self.start}"
            )
        return text[: self.start] + self.new + text[self.start + len(self.old) :]

    def shown(self, text: str) -> str:
        """Line number and line of the file with the fault."""
        return (
            f"{text.count(chr(10), 0, self.start) + 1}: "
            f"{self.planted(text)[self.start :].partition(chr(10))[0][:60]}"
        )


class Places:
    """Places of a source and their offsets."""

    def __init__(self, text: str) -> None:
        self.text, self.lines = text, [0]
        functions = [
            node
            for node in ast.parse(text).body
            if isinstance(node, (ast.FunctionDef, ast.ClassDef))
        ]
        self.nodes = [node for function in functions for node in ast.walk(function)]
        for line in text.splitlines(keepends=True):
            self.lines.append(self.lines[-1] + len(line))

    def offset(self, line: int, column: int) -> int:
        """Offset of a place; column : in bytes of UTF-8."""
        begin = self.lines[line - 1]
        return begin + len(self.text[begin : self.lines[line]].encode()[:column].decode())

    def start(self, node: ast.AST) -> int:
        return self.offset(node.lineno, node.col_offset)

    def end(self, node: ast.AST) -> int:
        return self.offset(node.end_lineno, node.end_col_offset)

    def of_kind(self, kind: str) -> Iterator[tuple[int, str, str]]:
        """Yield (offset, old text, new text) of each place within a function at which a fault of a kind is possible."""
        for node in self.nodes:
            if kind == "sign" and isinstance(node, ast.BinOp) and type(node.op) in SIGNS:
                yield from self.operator(node.left, node.right, *SIGNS[type(node.op)])
            elif (
                kind == "comparison"
                and isinstance(node, ast.Compare)
                and type(node.ops[0]) in COMPARISONS
            ):
                yield from self.operator(
                    node.left, node.comparators[0], *COMPARISONS[type(node.ops[0])]
                )
            elif kind == "factor" and isinstance(node, ast.BinOp) and is_product_of_floats(node):
                yield self.start(node), "", "1.01 * "
            elif kind == "index" and isinstance(node, ast.Subscript) and is_index(node.slice):
                begin, end = self.start(node.slice), self.end(node.slice)
                old = self.text[begin:end]
                yield (
                    begin,
                    old,
                    old.split()[0] if isinstance(node.slice, ast.BinOp) else f"{old} - 1",
                )

    def operator(
        self, left: ast.AST, right: ast.AST, old: str, new: str
    ) -> Iterator[tuple[int, str, str]]:
        """Yield the operator between two operands, unless a text or a comment is between them."""
        begin, end = self.end(left), self.start(right)
        between = self.text[begin:end]
        if not is_text(left) and not is_text(right) and between.strip(" ()\n\\") == old:
            yield begin + between.index(old), old, new


def is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.JoinedStr)
        or isinstance(node, ast.Constant)
        and isinstance(node.value, str)
    )


def is_product_of_floats(node: ast.BinOp) -> bool:
    """True for a product or quotient with a number that has a point."""
    numbers = [one.value for one in (node.left, node.right) if isinstance(one, ast.Constant)]
    return isinstance(node.op, (ast.Mult, ast.Div)) and any(
        isinstance(number, float) for number in numbers
    )


def is_index(node: ast.AST) -> bool:
    """True for a name such as `k`, and for a name plus or minus 1."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
        return (
            isinstance(node.left, ast.Name)
            and isinstance(node.right, ast.Constant)
            and node.right.value == 1
        )
    return isinstance(node, ast.Name) and len(node.id) == 1


KINDS = ("sign", "factor", "comparison", "index")


def group_of(path: Path) -> str:
    """Group of a file below fvsolve, or an empty text."""
    if path.parts[0] == "studies":
        return "studies"
    if path.name.startswith("lower") or path.stem.endswith("tables"):
        return "lowerings"
    if path.name.startswith("law"):
        return "laws"
    if "kernels" in path.parts or "steppers" in path.parts:
        return "kernels"
    compiled = "basins" in path.parts[:-1] and not path.name.startswith(("part", "feature", "__"))
    return "laws" if compiled else ""


def candidates() -> dict[tuple[str, str], list[DrawnFault]]:
    """Faults at all places, by kind and group."""
    lists: dict[tuple[str, str], list[DrawnFault]] = {turn: [] for turn in product(KINDS, GROUPS)}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE)
        if group := group_of(name):
            places = Places(path.read_text(encoding="utf-8"))
            for kind in KINDS:
                lists[kind, group] += [
                    DrawnFault(name.as_posix(), *place) for place in places.of_kind(kind)
                ]
    return lists


def drawn(seed: int, count: int) -> list[DrawnFault]:
    """Faults of each kind and each group in turn, no two in the same file."""
    chance, listed, files, lists = random.Random(seed), [], set(), candidates()
    for turn in islice(cycle(lists), count):
        listed.append(chance.choice([fault for fault in lists[turn] if fault.path not in files]))
        files.add(listed[-1].path)
    return listed
