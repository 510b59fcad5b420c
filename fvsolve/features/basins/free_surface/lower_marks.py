"""Rows of the tables of a model for walls on faces, and for faces of sections."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fvsolve.core.assembly.lowering import lowering_of
from fvsolve.errors import Notice
from fvsolve.features.basins.cell_sides import BLOCK
from fvsolve.features.basins.free_surface.marked_faces import SUM_COUNT
from fvsolve.features.basins.lower_motion import sides_of_cells

# greatest factor on the flow over a wall by which its faces pass that over its line
MOST_STRETCH = 2.0
# numbers of each marked face that change with crests: crest, height, size and normal
MARK_NUMBERS = 5


class Marks(NamedTuple):
    """Marked faces of a basin, see `marked_faces`.

    faces : int64[k]  faces; crest : float64[k]  greatest crests in time above the elevation [m]
    height : float64[k]  of these above both beds, 0 without a wall [m]; coefficient : float64[k]  C of the weir
    cosine, sine : float64[k]  normal of the wall in the frame of the face, see `FaceChain`
    """

    faces: np.ndarray
    crest: np.ndarray
    height: np.ndarray
    coefficient: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray

    @property
    def walls(self) -> np.ndarray:
        """Faces with a wall at some time : int64[:]."""
        return self.faces[self.height > 0.0]


def beds_of(basin) -> np.ndarray:
    """Higher bed of the cells on both sides of each face between cells above the elevation : float64[inner] [m]."""
    mesh = basin.mesh
    return np.maximum(*(basin.bed[cells[: mesh.inner]] for cells in (mesh.left, mesh.right)))


def coefficient_of(wall, chain) -> float:
    """Coefficient C of the weir on the faces of a wall, which may be longer than its line."""
    return wall.coefficient * min(max(chain.stretch, 1.0 / MOST_STRETCH), MOST_STRETCH)


def marks_of(basin) -> Marks:
    """Marked faces of a basin: those of its sections, and those of walls above both beds; the highest wall counts."""
    mesh, beds = basin.mesh, beds_of(basin)
    crest, marked, (factor, cosine, sine) = (
        beds.copy(),
        np.zeros(mesh.inner, bool),
        np.zeros((3, mesh.inner)),
    )
    for wall in (basin.part.walls or {}).values():
        chain = wall.chain(mesh)
        greatest = float(wall.crest.value.max())
        highest = greatest > crest[chain.faces]
        faces = chain.faces[highest]
        crest[faces], marked[faces] = greatest, True
        factor[faces] = coefficient_of(wall, chain)
        cosine[faces], sine[faces] = chain.cosine[highest], chain.sine[highest]
    for chain in basin.sections.values():
        marked[chain.faces] = True
    faces = np.flatnonzero(marked)
    return Marks(faces, *(values[faces] for values in (crest, crest - beds, factor, cosine, sine)))


def lower_marks(draft, basin, row) -> None:
    """Fill the columns of the row of a basin for marked faces; add notices for walls below the bed."""
    for name, wall in (basin.part.walls or {}).items():
        faces = wall.chain(basin.mesh).faces
        if not np.isin(faces, basin.marks.walls).any():
            text = f"basin {basin.name}: wall {name} has no effect, its crest is nowhere above the bed or another wall"
            greatest = float(wall.crest.value.max())
            draft.warnings.append(Notice("range", f"nodes.{basin.name}", text, "walls", greatest))
    marks = basin.marks
    if not marks.faces.size:
        return
    rows, place, number, count = rows_of_grid(basin) if basin.is_grid else rows_of_mesh(basin)
    order = np.argsort(rows, kind="stable")
    row["marked"], row["mark_rows"], row["marks"] = len(draft.integers), count, rows.size
    row["marked_faces"], row["sections"] = marks.faces.size, bool(basin.sections)
    first = np.searchsorted(rows[order], np.arange(count + 1))
    draft.integers += [*first.tolist(), *place[order].tolist(), *number[order].tolist()]
    row["marked_work"] = draft.to_work(marks.faces.size + max(marks.faces.size, SUM_COUNT * BLOCK))
    if any(not wall.crest.constant for wall in (basin.part.walls or {}).values()):
        lower_moving_crests(draft, basin, row)
        return
    size = weir_size(basin, marks.coefficient)
    numbers = marks.crest - basin.part.level, marks.height, size, marks.cosine, marks.sine
    row["crests"] = draft.to_plane(np.array(numbers))


def weir_size(basin, coefficient: np.ndarray) -> np.ndarray:
    """2/3 C sqrt(2 g) of weirs with the coefficients C [m^0.5/s]."""
    return 2.0 / 3.0 * math.sqrt(2.0 * basin.case.gravity) * coefficient


def lower_moving_crests(draft, basin, row) -> None:
    """Fill the columns of the row of a basin for walls with crests that move, see `moving_crests`."""
    marks = basin.marks
    beds = beds_of(basin)
    schedules = []
    candidates = []
    for k, wall in enumerate(basin.part.walls.values()):
        schedules.append(draft.schedules.add(wall.crest))
        chain = wall.chain(basin.mesh)
        above = float(wall.crest.value.max()) > beds[chain.faces]
        columns = [
            np.searchsorted(marks.faces, chain.faces[above]),
            np.full(above.sum(), k),
            np.full(above.sum(), coefficient_of(wall, chain)),
            chain.cosine[above],
            chain.sine[above],
        ]
        candidates.append(np.array(columns, float))
    face, wall_of, coefficient, cosine, sine = np.concatenate(candidates, axis=1)
    order = np.argsort(face, kind="stable")
    first = np.searchsorted(face[order], np.arange(marks.faces.size + 1))
    row["moving_crests"] = len(schedules)
    row["candidates"] = len(draft.integers)
    draft.integers += schedules
    draft.integers += first.tolist()
    draft.integers += wall_of[order].astype(int).tolist()
    size = weir_size(basin, coefficient)
    numbers = [np.array([basin.part.level]), beds[marks.faces]]
    numbers += [values[order] for values in (size, cosine, sine)]
    row["candidate_numbers"] = draft.to_plane(np.concatenate(numbers))
    row["present_crests"] = draft.to_work(len(schedules))
    row["crests"] = draft.to_work(MARK_NUMBERS * marks.faces.size)


def rows_of_grid(basin) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """(row of each marked face, its column, its number, number of rows) on a grid, see `marked_faces.MarkedFaces`."""
    mesh = basin.mesh
    faces = basin.marks.faces
    ny = basin.mesh.grid.ny
    row, column = np.divmod(mesh.left[faces], mesh.grid.nx)
    east = np.abs(mesh.normal[faces, 0]) > 0.5
    return np.where(east, ny + 1 + row, row + 1), column + east, np.arange(faces.size), 2 * ny + 1


def rows_of_mesh(basin) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """(row of each marked side, cell in its block, number of its face, number of rows) on a mesh, as `rows_of_grid`."""
    _, face, own, side = sides_of_cells(basin.mesh)
    number = np.searchsorted(basin.marks.faces, np.where(face >= 0, face, ~face))
    marked = np.isin(np.where(face >= 0, face, ~face), basin.marks.faces)
    number = np.where(face >= 0, number, ~number)
    return (
        (4 * (own // BLOCK) + side)[marked],
        (own % BLOCK)[marked],
        number[marked],
        4 * -(-basin.n // BLOCK),
    )


def chain_texts(basin) -> Iterator[str]:
    """Yield a text on each wall and each section of a basin: its faces, and heights of a crest above the bed."""
    amount, marks = basin.case.amount, basin.marks
    for name, wall in (basin.part.walls or {}).items():
        faces, _, cosine, _, stretch = wall.chain(basin.mesh)
        length = amount(stretch * float(basin.mesh.length[faces] @ cosine), "length", 3)
        height = (
            marks.height[np.isin(marks.faces, faces)]
            if np.isin(faces, marks.faces).any()
            else np.zeros(1)
        )
        if not np.isfinite(height).all():
            yield f"wall {name}: {faces.size} faces, {length} long, crest by a control without `limits`"
            continue
        low, high = (amount(value, "length", 3) for value in (height.min(), height.max()))
        text = "" if wall.crest.constant else " at its highest in time"
        yield f"wall {name}: {faces.size} faces, {length} long, crest {low} to {high} above the bed{text}"
    for name, chain in basin.sections.items():
        yield f"section {name}: {chain.faces.size} faces"
    yield from crest_texts(basin)


def crest_texts(basin) -> Iterator[str]:
    """Yield a text on each structure at a patch: its crest above datum, the bed there, and the surface around it."""
    amount, datum = basin.case.amount, basin.part.elevation or 0.0
    surface = basin.bed + np.maximum(basin.depth + basin.start()[0], 0.0)
    for name, link in basin.case.links.items():
        rows = lowering_of(type(link))
        for end, place in enumerate(link.ports.values() if hasattr(rows, "bottoms") else ()):
            of, _, patch = place.partition(".")
            if of != basin.name:
                continue
            _, around, own, _ = basin.mesh.faces(patch)
            crest, bed = rows.bottoms(link)[end], datum + float(basin.bed[own].min())
            low, high = (
                amount(datum + float(value), "length", 6)
                for value in (surface[around].min(), surface[around].max())
            )
            text = f"{name}: {rows.bottom_key} {amount(crest, 'length', 6)}, {amount(abs(crest - bed), 'length', 3)} "
            text += (
                f"{'above' if crest > bed else 'below'} the lowest bed of {place}"
                if crest != bed
                else ""
            )
            yield f"{text}; surface around it at the start {low} to {high}"
