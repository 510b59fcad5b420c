"""Mesh files of Gmsh, MSH 4.0 and 4.1: points, elements, and physical groups of lines by the entities of the elements.

A negative number of a physical group marks a reversed entity, whose elements belong to the group too. Format: manual of
Gmsh, "MSH file format".
"""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fvsolve.units import plain_numbers, show

KINDS = {  # number of an element type -> (name as in meshio, points)
    1: ("line", 2),
    2: ("triangle", 3),
    3: ("quad", 4),
    4: ("tetra", 4),
    5: ("hexahedron", 8),
    6: ("wedge", 6),
    7: ("pyramid", 5),
    8: ("line3", 3),
    9: ("triangle6", 6),
    10: ("quad9", 9),
    11: ("tetra10", 10),
    12: ("hexahedron27", 27),
    13: ("wedge18", 18),
    14: ("pyramid14", 14),
    15: ("vertex", 1),
    16: ("quad8", 8),
    17: ("hexahedron20", 20),
    18: ("wedge15", 15),
    19: ("pyramid13", 13),
    21: ("triangle10", 10),
    26: ("line4", 4),
    27: ("line5", 5),
    36: ("quad16", 16),
    37: ("quad25", 25),
    23: ("triangle15", 15),
}
LONGEST = 40  # greatest length of the name of a section [characters]
MOST = 2.0**53  # greatest whole number of a text
HEADER = re.compile(rb"\$MeshFormat\s+(4(?:\.\d+)?)\s+([01])\s+(\d)\s")
# dimension, number and name of a group
NAME = re.compile(r'^[ \t]*(\d)[ \t]+(\d+)[ \t]+"(.*)"', re.MULTILINE)


class ElementBlock(NamedTuple):
    """Elements of one type: name of the type as in meshio, and int64[n, points] their points."""

    type: str
    data: np.ndarray


class GmshMesh(NamedTuple):
    """Content of a file.

    points : float64[p, 3]; cells : elements, in the order of the file
    groups : number of a physical group of lines -> numbers of its lines, counted over all blocks of lines
    field_data : name of a physical group of lines -> (its number, 1), as in meshio
    surfaces : number of a physical group of surfaces -> numbers of its cells, over all triangles and quadrilaterals
    surface_names : number of a physical group of surfaces -> its name
    """

    points: np.ndarray
    cells: list[ElementBlock]
    groups: dict[int, np.ndarray]
    field_data: dict[str, tuple[int, int]]
    surfaces: dict[int, np.ndarray]
    surface_names: dict[int, str]


class Numbers:
    """Numbers of a section in the order of the file, from text or binary data.

    name : of the section; size : width of counts in binary data [bytes], 0 for text
    """

    def __init__(self, name: str, data: bytes, size: int):
        self.name, self.size, self.at = name, size, 0
        self.data: Any = data
        if not size:
            try:
                self.data = plain_numbers(data.decode(errors="replace"))
            except ValueError as error:
                raise ValueError(f"section ${name}, {error}") from None

    def take(self, kind: str, count: int) -> np.ndarray:
        """Next numbers. kind : "i" for int, "u" for a count or the number of a point or element, "f" for a double

        Raises ValueError if the section has fewer.
        """
        width = {"i": 4, "u": self.size, "f": 8}[kind] if self.size else 1
        begin, self.at = self.at, self.at + width * count
        if self.at > len(self.data):
            raise ValueError(
                f"section ${self.name} ends before its last number; is the file complete?"
            )
        if self.size:
            return np.frombuffer(self.data, f"<{kind}{width}", count, begin)
        return self.data[begin : self.at]

    def whole(self, kind: str) -> int:
        """Next number, a whole number. Raises ValueError for another number, and for a negative count."""
        value = self.take(kind, 1)[0]
        if not (abs(value) < MOST and value == int(value) and (kind == "i" or value >= 0)):
            text = "a whole number" if kind == "i" else "a count"
            raise ValueError(f"section ${self.name}: {value:g} is not {text}")
        return int(value)

    def numbers(self, count: int) -> np.ndarray:
        """Numbers of points and elements : int64[count]. Raises ValueError for other numbers."""
        values = self.take("u", count)
        if not ((values < MOST) & (values == np.floor(values))).all():
            raise ValueError(
                f"section ${self.name} has numbers of points or elements that are not whole numbers"
            )
        return values.astype(np.int64)

    def counted(self, kind: str) -> list[int]:
        """Next count, and as many whole numbers."""
        return [self.whole(kind) for _ in range(self.whole("u"))]


def read_gmsh_4(data: bytes) -> GmshMesh | None:
    """Content of a file of MSH 4.0 or 4.1; None for another format. Raises ValueError for an unreadable file."""
    match = HEADER.search(data[:1000])
    if match is None:
        return None
    version = match[1].decode()
    binary = match[2] == b"1"
    size = int(match[3])
    parts = dict(sections(data))
    if missing := [name for name in ("Nodes", "Elements") if name not in parts]:
        raise ValueError(f"the file has no section ${missing[0]}")
    # Gmsh writes 4.0 as "4", others write 4.1 so: the first line of 4.1 has four numbers
    old = version == "4.0" or (
        version == "4" and not binary and len(parts["Nodes"].split(b"\n", 1)[0].split()) == 2
    )
    if (old and binary) or (
        binary and (size not in (4, 8) or b"\1\0\0\0" not in parts["MeshFormat"])
    ):
        raise ValueError("MSH 4.0 in binary form, or of another processor, is not read")
    read = {
        name: Numbers(name, content, size if binary else 0)
        for name, content in parts.items()
        if name in ("Entities", "PartitionedEntities", "Nodes", "Elements")
    }
    physical = entities(read.get("Entities"), old) | entities(
        read.get("PartitionedEntities"), old, partitioned=True
    )
    numbers, points = nodes(read["Nodes"], old)
    order = np.argsort(numbers, kind="stable")
    cells = []
    groups: dict[str, dict[int, list[np.ndarray]]] = {"line": {}, "cell": {}}
    first = {"line": 0, "cell": 0}
    for dimension, entity, kind, rows in elements(read["Elements"], old):
        spot = order[
            np.minimum(np.searchsorted(numbers, rows, sorter=order), max(numbers.size - 1, 0))
        ]
        cells.append(ElementBlock(kind, np.where(numbers[spot] == rows, spot, -1)))
        shape = {"line": "line", "triangle": "cell", "quad": "cell"}.get(kind)
        if shape is None:
            continue
        for group in {abs(number) for number in physical.get((dimension, entity), ())}:
            own = first[shape] + np.arange(len(rows))
            groups[shape].setdefault(group, []).append(own)
        first[shape] += len(rows)
    lines, surfaces = (
        {group: np.concatenate(blocks) for group, blocks in groups[shape].items()}
        for shape in ("line", "cell")
    )
    names = parts.get("PhysicalNames", b"")
    return GmshMesh(points, cells, lines, line_names(names), surfaces, surface_names(names))


def sections(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of each section. Raises ValueError for a section without end."""
    at = 0
    while (at := data.find(b"$", at)) >= 0:
        name = data[at + 1 : at + LONGEST].split(b"\n")[0].strip()
        begin = data.find(b"\n", at) + 1
        end = data.find(b"$End" + name, begin)
        if not name or not begin or end < 0:
            text = show("$" + name.decode(errors="replace"))
            raise ValueError(f"the section {text} has no end; is the file complete?")
        yield name.decode(errors="replace"), data[begin:end]
        at = end + len(name) + 4


def entities(
    section: Numbers | None, old: bool, partitioned: bool = False
) -> dict[tuple[int, int], list[int]]:
    """Physical groups of entities : (dimension, number of the entity) -> numbers of its groups, negative if reversed.

    old : True for MSH 4.0; partitioned : True for the section of entities that are cut by partitions
    """
    if section is None:
        return {}
    if partitioned:
        section.whole("u")
        section.take("i", 2 * section.whole("u"))  # ghost entities and their partitions
    groups = {}
    for dimension, count in enumerate([section.whole("u") for _ in range(4)]):
        for _ in range(count):
            number = section.whole("i")
            if partitioned:
                section.take("i", 2)  # dimension and number of the whole entity
                section.take("i", section.whole("u"))
            section.take("f", 6 if dimension or old else 3)  # its box, or its coordinates
            groups[dimension, number] = section.counted("i")
            if dimension:
                section.take("i", section.whole("u"))  # entities around it
    return groups


def nodes(section: Numbers, old: bool) -> tuple[np.ndarray, np.ndarray]:
    """(numbers of points, their coordinates float64[p, 3]); old : True for MSH 4.0"""
    numbers, points = [np.empty(0)], [np.empty((0, 3))]
    blocks = section.whole("u")
    section.take("u", 1 if old else 3)
    for _ in range(blocks):
        first, second, parametric = (section.whole("i") for _ in range(3))
        dimension = second if old else first
        width = 3 + (dimension if parametric else 0)
        count = section.whole("u")
        if old:
            rows = section.take("f", count * (1 + width)).reshape(count, 1 + width)
            numbers.append(np.where(np.abs(rows[:, 0]) < MOST, rows[:, 0], -1.0))
            points.append(rows[:, 1:4])
        else:
            numbers.append(section.numbers(count))
            points.append(section.take("f", count * width).reshape(count, width)[:, :3])
    return np.concatenate(numbers).astype(np.int64), np.concatenate(points).astype(float)


def elements(section: Numbers, old: bool) -> Iterator[tuple[int, int, str, np.ndarray]]:
    """Yield (dimension, number of the entity, type, int64[n, points] numbers of points) of each block of elements.

    old : True for MSH 4.0
    """
    blocks = section.whole("u")
    section.take("u", 1 if old else 3)
    for _ in range(blocks):
        first, second, code = (section.whole("i") for _ in range(3))
        if code not in KINDS:
            raise ValueError(
                f"elements of the type {code} are not read; expected triangles and quadrilaterals"
            )
        kind, points = KINDS[code]
        count = section.whole("u")
        rows = section.numbers(count * (1 + points)).reshape(count, 1 + points)[:, 1:]
        dimension, entity = (second, first) if old else (first, second)
        yield dimension, entity, kind, rows


def surface_names(content: bytes) -> dict[int, str]:
    """Names of the physical groups of surfaces : number -> name; content : of the section PhysicalNames"""
    found = NAME.findall(content.decode(errors="replace"))
    return {int(number): name for dimension, number, name in found if dimension == "2"}


def line_names(content: bytes) -> dict[str, tuple[int, int]]:
    """Names of the physical groups of lines : name -> (number, 1); content : of the section PhysicalNames"""
    found = NAME.findall(content.decode(errors="replace"))
    return {name: (int(number), 1) for dimension, number, name in found if dimension == "1"}
