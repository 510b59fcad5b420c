"""Groups of cells in a mesh file: physical surfaces of Gmsh, materials of SMS, and sets of other formats."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.core.mesh.gmsh_files import GmshMesh
from fvsolve.core.mesh.sms_files import SmsMesh


def surface_groups(
    file_mesh: Any, plane: dict[str, int], tags: tuple[str, ...]
) -> dict[str, np.ndarray]:
    """Groups of cells : name -> numbers of its cells, counted over all blocks of triangles and quadrilaterals.

    A group without a name has its number as name. file_mesh : content of a file, from meshio or our own readers
    plane : types of cells; tags : names of group numbers in the formats
    """
    if isinstance(file_mesh, SmsMesh):
        return dict(file_mesh.materials)
    if isinstance(file_mesh, GmshMesh):
        names = file_mesh.surface_names
        return {names.get(tag, str(tag)): cells for tag, cells in file_mesh.surfaces.items()}
    members: dict[str, list[np.ndarray]] = {}
    for name, cells in sets_and_tags(file_mesh, plane, tags):
        members.setdefault(name, []).append(cells)
    return {name: np.unique(np.concatenate(cells)) for name, cells in members.items()}


def sets_and_tags(
    file_mesh: Any, plane: dict[str, int], tags: tuple[str, ...]
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield (name of a group, numbers of some of its cells) of a mesh of meshio; the number 0 stands for no group."""
    names = getattr(file_mesh, "surface_names", {})
    first = 0
    for k, block in enumerate(file_mesh.cells):
        if block.type not in plane:
            continue
        for name, sets in (getattr(file_mesh, "cell_sets", None) or {}).items():
            if not name.startswith("gmsh:") and sets[k] is not None and len(sets[k]):
                yield name, first + np.asarray(sets[k], np.int64)
        for key in tags:
            if key in file_mesh.cell_data:
                numbers = np.abs(np.asarray(file_mesh.cell_data[key][k]).astype(np.int64))
                for tag in np.unique(numbers[numbers != 0]).tolist():
                    yield names.get(tag, str(tag)), first + np.flatnonzero(numbers == tag)
        first += len(block.data)
