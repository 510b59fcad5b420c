"""A mesh with two groups of cells, named parts of its boundary and elevations of nodes, in several file formats."""

from pathlib import Path

import meshio
import numpy as np

POINTS = np.array(
    [(x, y, 0.1 * x + 0.2 * y) for y in (0.0, 1.0, 2.0) for x in (0.0, 1.0, 2.0, 3.0)]
)
QUADS = [[0, 1, 5, 4], [4, 5, 9, 8], [1, 2, 6, 5]]
TRIANGLES = [[2, 3, 7], [2, 7, 6], [5, 6, 10], [5, 10, 9], [6, 7, 11], [6, 11, 10]]
ROAD, GRASS = [0, 1], [2, 3, 4, 5, 6, 7, 8]  # numbers of cells, quadrilaterals first
INFLOW, OUTFLOW = [8, 4, 0], [3, 7, 11]  # nodes
FORMATS = ("2dm", "2dm, names", "msh 2.2", "msh 4.1")


def sms(names: bool, step: int = 1) -> str:
    """Text of a file .2dm; names : True with names of materials and strings; step : between numbers of nodes"""
    nodes = [step * (k + 1) for k in range(len(POINTS))]
    cells = [("E4Q", cell) for cell in QUADS] + [("E3T", cell) for cell in TRIANGLES]
    lines = ["MESH2D", 'MESHNAME "bend"', "NUM_MATERIALS_PER_ELEM 1"]
    for k, (word, corners) in enumerate(cells):
        numbers = " ".join(str(nodes[corner]) for corner in corners)
        lines.append(f"{word} {k + 1} {numbers} {1 if k in ROAD else 2}")
    lines += [
        f"ND {n} {x:.8e} {y} {z!r}" for n, (x, y, z) in zip(nodes, POINTS.tolist(), strict=True)
    ]
    for name, string in (("inflow", INFLOW), ("outflow", OUTFLOW)):
        *first, last = [nodes[node] for node in string]
        lines += [f"NS {' '.join(map(str, first))}", f"NS -{last} {name if names else ''}".rstrip()]
    return "\n".join(lines + ['MAT 1 "road"', "MAT 2 grass"] * names) + "\n"


def write(path: Path, form: str, flat: bool = False) -> str:
    """Write the mesh in a format of `FORMATS`; flat : True for z = 0; returns the name of the file"""
    if form.startswith("2dm"):
        path = path.with_suffix(".2dm")
        path.write_text(sms("names" in form, 7 if "names" in form else 1), encoding="utf-8")
    elif form == "msh 2.2":
        path = path.with_suffix(".msh")
        write_msh_2(path, flat)
    else:
        path = path.with_suffix(".msh")
        path.write_text(msh_4(flat), encoding="utf-8")
    return str(path)


def write_msh_2(path: Path, flat: bool) -> None:
    """Write the mesh by meshio as MSH 2.2."""
    ends = [[nodes[k : k + 2] for k in range(2)] for nodes in (INFLOW, OUTFLOW)]
    blocks = [
        ("line", np.array(ends).reshape(-1, 2)),
        ("quad", np.array(QUADS)),
        ("triangle", np.array(TRIANGLES)),
    ]
    tags = [np.array([1, 1, 2, 2]), np.array([3, 3, 4]), np.full(len(TRIANGLES), 4)]
    names = {"inflow": (1, 1), "outflow": (2, 1), "road": (3, 2), "grass": (4, 2)}
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    points = POINTS * (1.0, 1.0, 0.0 if flat else 1.0)
    mesh = meshio.Mesh(
        points, blocks, cell_data=data, field_data={k: np.array(v) for k, v in names.items()}
    )
    mesh.write(path, file_format="gmsh22", binary=False)


def msh_4(flat: bool) -> str:
    """Text of the mesh as MSH 4.1, with numbers of physical groups that lines and surfaces share."""
    nodes = "\n".join(map(str, range(1, 13)))
    places = "\n".join(f"{x} {y} {0.0 if flat else z}" for x, y, z in POINTS.tolist())
    rows, number = [], 0
    for head, cells in (
        ("1 1 1", list(zip(INFLOW, INFLOW[1:], strict=False))),
        ("1 2 1", list(zip(OUTFLOW, OUTFLOW[1:], strict=False))),
        ("2 1 3", QUADS[:2]),
        ("2 2 3", QUADS[2:]),
        ("2 2 2", TRIANGLES),
    ):
        rows.append(f"{head} {len(cells)}")
        for cell in cells:
            number += 1
            rows.append(" ".join(str(n) for n in (number, *(node + 1 for node in cell))))
    return f"""$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
4
1 1 "inflow"
1 2 "outflow"
2 1 "road"
2 2 "grass"
$EndPhysicalNames
$Entities
0 2 2 0
1 0 0 0 0 2 0 1 1 0
2 3 0 0 3 2 0 1 2 0
1 0 0 0 1 2 0 1 1 0
2 1 0 0 3 2 0 1 2 0
$EndEntities
$Nodes
1 12 1 12
2 1 0 12
{nodes}
{places}
$EndNodes
$Elements
5 {number} 1 {number}
{chr(10).join(rows)}
$EndElements
"""
