"""Mesh files .2dm of SMS, BASEMENT and TUFLOW FV: nodes, triangles, quadrilaterals, materials and node strings.

Lines begin with a word: ND number x y z; E3T number, three nodes, material; E4Q number, four nodes, material;
NS nodes of a string, the last of them negative, then its number or name; MAT number name. Other lines are left out.
Format: XMS Wiki, "2D Mesh Files *.2dm".
"""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.mesh.gmsh_files import ElementBlock
from fvsolve.units import show

CELLS = {"E3T": ("triangle", 3), "E4Q": ("quad", 4)}
CURVED = ("E2L", "E3L", "E6T", "E8Q", "E9Q")  # elements that are not read
MOST_BYTES = 2_000_000_000


class SmsMesh(NamedTuple):
    """Content of a file.

    points : float64[p, 3]; cells : triangles, quadrilaterals and the lines of strings
    strings : name of a node string -> numbers of its lines; materials : name of a material -> numbers of its cells, as
    counted over triangles, then quadrilaterals
    """

    points: np.ndarray
    cells: list[ElementBlock]
    strings: dict[str, np.ndarray]
    materials: dict[str, np.ndarray]


class SmsLines:
    """Lines of a file while they are read; a method for each kind of line raises ValueError for a faulty line."""

    def __init__(self) -> None:
        self.nodes: dict[int, list[float]] = {}
        self.cells: dict[str, list[tuple[list[int], str]]] = {word: [] for word in CELLS}
        self.names: dict[str, str] = {}
        self.strings: dict[str, list[int]] = {}
        self.open: list[int] = []  # nodes of a string that continues in the next line

    def read(self, word: str, rest: list[str]) -> None:
        """Read a line; word : its first word, rest : its other words"""
        if word == "ND":
            self.node(rest)
        elif word in CELLS:
            self.cell(word, rest)
        elif word == "NS":
            self.string(rest)
        elif word == "MAT" and len(rest) > 1:
            self.names[rest[0]] = rest[1]
        elif word in CURVED:
            raise ValueError(
                f"{word} is not read; expected E3T and E4Q, triangles and quadrilaterals with straight sides"
            )

    def node(self, rest: list[str]) -> None:
        """Read a node: number, x, y, z."""
        number, place = int(rest[0]), [float(text) for text in rest[1:4]]
        if len(place) != 3:
            raise ValueError("a node has fewer than three coordinates; expected number, x, y, z")
        if number in self.nodes:
            raise ValueError(f"two nodes have the number {number}; expected a number for each")
        self.nodes[number] = place

    def cell(self, word: str, rest: list[str]) -> None:
        """Read a cell: number, nodes, material."""
        count = CELLS[word][1]
        corners = [int(text) for text in rest[1 : 1 + count]]
        if len(corners) != count:
            raise ValueError(f"a cell has {len(corners)} nodes; expected {count}")
        self.cells[word].append((corners, rest[1 + count] if len(rest) > 1 + count else ""))

    def string(self, rest: list[str]) -> None:
        """Read a line of a node string, which ends at a negative number, after which its name may follow."""
        for k, text in enumerate(rest):
            number = int(text)
            self.open.append(abs(number))
            if number < 0:
                name = rest[k + 1] if len(rest) > k + 1 else str(len(self.strings) + 1)
                if name in self.strings:
                    raise ValueError(
                        f"two node strings have the name {show(name)}; expected a name for each"
                    )
                self.strings[name] = self.open
                self.open = []
                return

    def mesh(self) -> SmsMesh:
        """Mesh of all lines. Raises ValueError for a string without end and for an unknown node."""
        if self.open:
            raise ValueError(
                "the last node string has no end; expected a negative number of its last node"
            )
        index = {number: k for k, number in enumerate(self.nodes)}
        blocks = [
            ElementBlock(
                kind, self.rows([corners for corners, _ in self.cells[word]], index, count)
            )
            for word, (kind, count) in CELLS.items()
        ]
        strings = {}
        first = 0
        lines: list[list[int]] = []
        for name, nodes in self.strings.items():
            lines += [[a, b] for a, b in zip(nodes, nodes[1:], strict=False)]
            strings[name] = np.arange(first, len(lines))
            first = len(lines)
        blocks.append(ElementBlock("line", self.rows(lines, index, 2)))
        labels = [label for word in CELLS for _, label in self.cells[word]]
        materials = {
            self.names.get(label, label): np.flatnonzero([other == label for other in labels])
            for label in dict.fromkeys(labels)
            if label
        }
        points = np.array(list(self.nodes.values()), float).reshape(-1, 3)
        return SmsMesh(points, [block for block in blocks if len(block.data)], strings, materials)

    def rows(self, rows: list[list[int]], index: dict[int, int], count: int) -> np.ndarray:
        """Indices of nodes : int64[n, count]; rows : their numbers. Raises ValueError for an unknown node."""
        unknown = next((number for row in rows for number in row if number not in index), None)
        if unknown is not None:
            raise ValueError(f"there is no node {unknown}; expected a line ND for each node")
        return np.array([[index[number] for number in row] for row in rows], np.int64).reshape(
            -1, count
        )


def read_sms(path: Path) -> SmsMesh:
    """Content of a file .2dm. Raises ValueError with the line of a fault, OSError for a file that cannot be read."""
    if path.stat().st_size > MOST_BYTES:
        raise ValueError(f"the file has more than {MOST_BYTES:g} bytes")
    lines = SmsLines()
    for number, words in words_of(path):
        try:
            lines.read(words[0].upper(), words[1:])
        except (ValueError, IndexError) as error:
            text = str(error) if "expected" in str(error) else "a number is missing or is not valid"
            raise ValueError(f"line {number}: {text}") from None
    return lines.mesh()


def words_of(path: Path) -> Iterator[tuple[int, list[Any]]]:
    """Yield number and words of each line that is not empty and not a comment; words in quotes may contain blanks."""
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            text = line.strip()
            if not text or text.startswith("#"):
                continue
            try:
                words = shlex.split(text, posix=True) if '"' in text else text.split()
            except ValueError:
                words = text.replace('"', "").split()
            yield number, words
