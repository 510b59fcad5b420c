"""Frames of a basin that ranks write together: a .vtu of its rows each, and the .pvtu that lists them. Knows no loop.

Rank 0 has the frame; the others wait to be told by a broadcast what to call, with what (`solve.ranks`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fvsolve.output import fields

KINDS = {"f": "Float", "i": "Int", "u": "UInt"}


class Shares:
    """Who writes what of the basins whose rows ranks share out.

    comm : MPI's, of all ranks; rows : basin -> int64[ranks + 1]  first rows of all, and how many rows there are
    """

    def __init__(self, comm, rows: dict[str, np.ndarray]) -> None:
        self.comm, self.rows = comm, rows

    def write(self, path: Path, basin, origin: np.ndarray, values: dict[str, np.ndarray], units: dict) -> None:
        """Write the frame of a basin; OSError where a rank cannot."""
        comm, rows = self.comm, self.rows[basin.name]
        told = {key: (one.shape[1:], one.dtype.str) for key, one in values.items()}
        comm.bcast((piece_of, (str(path), basin.name, rows, origin, told, units)))
        for k in range(1, comm.size):
            for one in values.values():
                comm.Send(np.ascontiguousarray(one[cells_of(basin, rows, k)]), k)
        own = {key: one[cells_of(basin, rows, 0)] for key, one in values.items()}
        faults = [one for one in comm.gather(put_piece(path, basin, origin, rows, 0, own, units)) if one]
        if faults:
            raise OSError(*faults[0])
        path.write_text(listed(path, comm.size, values, units), encoding="utf-8")


def piece_of(comm, model, path: str, name: str, rows, origin, told: dict, units: dict) -> None:
    """What a rank does that is told to write its piece: take its cells' values, write, say what failed."""
    basin = next(one for one in model.basins if one.name == name)
    many = rows[comm.rank + 1] - rows[comm.rank]
    values = {key: np.empty((many * basin.mesh.grid.nx, *shape), kind) for key, (shape, kind) in told.items()}
    for one in values.values():
        comm.Recv(one, 0)
    comm.gather(put_piece(Path(path), basin, origin, rows, comm.rank, values, units))


def cells_of(basin, rows: np.ndarray, k: int) -> slice:
    """The cells of rank k."""
    wide = basin.mesh.grid.nx
    return slice(wide * int(rows[k]), wide * int(rows[k + 1]))


def put_piece(path: Path, basin, origin, rows, k: int, values: dict, units: dict) -> tuple:
    """Write the piece of rank k; what OSError is made of where that fails."""
    corners = basin.mesh.cells[cells_of(basin, rows, k)]
    first, last = int(corners.min()), int(corners.max())  # of whole rows of points
    points = fields.placed(basin, origin, basin.mesh.points[first : last + 1])
    found = {key: [one] for key, one in values.items()}
    try:
        fields.write_frame(named(path, k), points, [("quad", corners - first)], found, units)
    except OSError as error:
        return error.errno, error.strerror or str(error), str(error.filename or named(path, k))
    return ()


def named(path: Path, k: int) -> Path:
    """The file of rank k: `pool.1-000012.vtu` of `pool-000012.pvtu`, whose name no part can have."""
    name, _, frame = path.stem.rpartition("-")
    return path.with_name(f"{name}.{k}-{frame}.vtu")


def listed(path: Path, many: int, values: dict[str, np.ndarray], units: dict[str, str]) -> str:
    """The text of a .pvtu."""
    arrays = [
        f'<PDataArray type="{KINDS[one.dtype.kind]}{8 * one.dtype.itemsize}" Name="{key}" '
        f'NumberOfComponents="{one[:1].size}">\n{fields.unit_of(units, key)}</PDataArray>'
        for key, one in values.items()
    ]  # fmt: skip
    pieces = [f'<Piece Source="{named(path, k).name}"/>' for k in range(many)]
    points = '<PPoints>\n<PDataArray type="Float64" Name="Points" NumberOfComponents="3"/>\n</PPoints>'
    lines = [
        '<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">',
        '<PUnstructuredGrid GhostLevel="0">', points, "<PCellData>", *arrays, "</PCellData>", *pieces,
        "</PUnstructuredGrid>", "</VTKFile>",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"
