"""Parallel writing of basin frames: each rank writes a .vtu of its rows, rank 0 also the .pvtu index.

Rank 0 has the frame. The other ranks wait for a broadcast of a function to call and its arguments (`solve.mpi_ranks`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fvsolve.output import fields

KINDS = {"f": "Float", "i": "Int", "u": "UInt"}


class Shares:
    """Writer of the frames of basins whose rows are distributed over ranks.

    comm : MPI communicator of all ranks
    rows : basin -> int64[ranks + 1]  first row of each rank, then the number of rows
    """

    def __init__(self, comm, rows: dict[str, np.ndarray]) -> None:
        self.comm, self.rows = comm, rows

    def write(self, path: Path, basin, origin: np.ndarray, values: dict[str, np.ndarray], units: dict) -> None:
        """Write the frame of a basin; raises OSError if a rank cannot write its piece."""
        comm, rows = self.comm, self.rows[basin.name]
        layouts = {key: (item.shape[1:], item.dtype.str) for key, item in values.items()}
        comm.bcast((piece_of, (str(path), basin.name, rows, origin, layouts, units)))
        for k in range(1, comm.size):
            for item in values.values():
                comm.Send(np.ascontiguousarray(item[cells_of(basin, rows, k)]), k)
        own = {key: item[cells_of(basin, rows, 0)] for key, item in values.items()}
        faults = [item for item in comm.gather(put_piece(path, basin, origin, rows, 0, own, units)) if item]
        if faults:
            raise OSError(*faults[0])
        path.write_text(listed(path, comm.size, values, units), encoding="utf-8")


def piece_of(comm, model, path: str, name: str, rows, origin, layouts: dict, units: dict) -> None:
    """Receive the values of the cells of this rank, write its piece and send the fault, if any, to rank 0.

    layouts : quantity -> (shape of the value of a cell, dtype)
    """
    basin = next(item for item in model.basins if item.name == name)
    n = rows[comm.rank + 1] - rows[comm.rank]
    values = {key: np.empty((n * basin.mesh.grid.nx, *shape), kind) for key, (shape, kind) in layouts.items()}
    for item in values.values():
        comm.Recv(item, 0)
    comm.gather(put_piece(Path(path), basin, origin, rows, comm.rank, values, units))


def cells_of(basin, rows: np.ndarray, k: int) -> slice:
    """Cells of rank k."""
    wide = basin.mesh.grid.nx
    return slice(wide * int(rows[k]), wide * int(rows[k + 1]))


def put_piece(path: Path, basin, origin, rows, k: int, values: dict, units: dict) -> tuple:
    """Write the piece of rank k; returns the arguments of an OSError if that fails, else ()."""
    corners = basin.mesh.cells[cells_of(basin, rows, k)]
    first, last = int(corners.min()), int(corners.max())  # a piece has complete rows of points
    points = fields.placed(basin, origin, basin.mesh.points[first : last + 1])
    blocks = {key: [array] for key, array in values.items()}
    try:
        fields.write_frame(named(path, k), points, [("quad", corners - first)], blocks, units)
    except OSError as error:
        return error.errno, error.strerror or str(error), str(error.filename or named(path, k))
    return ()


def named(path: Path, k: int) -> Path:
    """File of rank k: `pool.1-000012.vtu` of `pool-000012.pvtu`; no part can have a name with a dot."""
    name, _, frame = path.stem.rpartition("-")
    return path.with_name(f"{name}.{k}-{frame}.vtu")


def listed(path: Path, n: int, values: dict[str, np.ndarray], units: dict[str, str]) -> str:
    """Text of a .pvtu file."""
    arrays = [
        f'<PDataArray type="{KINDS[array.dtype.kind]}{8 * array.dtype.itemsize}" Name="{key}" '
        f'NumberOfComponents="{array[:1].size}">\n{fields.unit_of(units, key)}</PDataArray>'
        for key, array in values.items()
    ]  # fmt: skip
    pieces = [f'<Piece Source="{named(path, k).name}"/>' for k in range(n)]
    points = '<PPoints>\n<PDataArray type="Float64" Name="Points" NumberOfComponents="3"/>\n</PPoints>'
    lines = [
        '<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">',
        '<PUnstructuredGrid GhostLevel="0">', points, "<PCellData>", *arrays, "</PCellData>", *pieces,
        "</PUnstructuredGrid>", "</VTKFile>",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"
