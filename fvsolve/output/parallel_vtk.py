"""Parallel writing of basin fields: each MPI rank writes a .vtu file of its rows, rank 0 also the .pvtu index.

Rank 0 has the values of all cells. The other ranks wait for a broadcast of a function to call and its arguments
(`solve.mpi_ranks`).
"""

from pathlib import Path

import numpy as np

from fvsolve.output import fields

VTK_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}


class ParallelBasinWriter:
    """Writer of the fields of basins whose rows are distributed over MPI ranks.

    comm : MPI communicator of all ranks
    rows : basin -> int64[ranks + 1]  first row of each rank, then the number of rows
    """

    def __init__(self, comm, rows: dict[str, np.ndarray]) -> None:
        self.comm, self.rows = comm, rows

    def write(self, path: Path, basin, origin: np.ndarray, values: dict[str, np.ndarray], units: dict) -> None:
        """Write the fields of a basin at one time; raises OSError if a rank cannot write its file.

        origin : plan shift of the basin [m]; values : quantity -> values of all cells; units : quantity -> unit
        """
        comm, rows = self.comm, self.rows[basin.name]
        layouts = {key: (item.shape[1:], item.dtype.str) for key, item in values.items()}
        comm.bcast((write_piece_of_rank, (str(path), basin.name, rows, origin, layouts, units)))
        for k in range(1, comm.size):
            for item in values.values():
                comm.Send(np.ascontiguousarray(item[rank_cells(basin, rows, k)]), k)
        own = {key: item[rank_cells(basin, rows, 0)] for key, item in values.items()}
        faults = [item for item in comm.gather(write_piece(path, basin, origin, rows, 0, own, units)) if item]
        if faults:
            raise OSError(*faults[0])
        path.write_text(pvtu_text(path, comm.size, values, units), encoding="utf-8")


def write_piece_of_rank(comm, model, path: str, name: str, rows, origin, layouts: dict, units: dict) -> None:
    """Receive the values of the cells of this rank, write its file, and send an error, if any, to rank 0.

    layouts : quantity -> (shape of the value of a cell, dtype); other arguments as in `write_piece`
    """
    basin = next(item for item in model.basins if item.name == name)
    n = rows[comm.rank + 1] - rows[comm.rank]
    values = {key: np.empty((n * basin.mesh.grid.nx, *shape), kind) for key, (shape, kind) in layouts.items()}
    for item in values.values():
        comm.Recv(item, 0)
    comm.gather(write_piece(Path(path), basin, origin, rows, comm.rank, values, units))


def rank_cells(basin, rows: np.ndarray, k: int) -> slice:
    """Range of the cells of rank k in a basin. rows : first row of each rank, then the number of rows"""
    wide = basin.mesh.grid.nx
    return slice(wide * int(rows[k]), wide * int(rows[k + 1]))


def write_piece(path: Path, basin, origin, rows, k: int, values: dict, units: dict) -> tuple:
    """Write the .vtu file of rank k; returns the arguments of an OSError if that fails, else ().

    path : .pvtu file; origin : plan shift of the basin [m]; rows : as in `rank_cells`; values : quantity -> values of
    the cells of the rank; units : quantity -> unit
    """
    corners = basin.mesh.cells[rank_cells(basin, rows, k)]
    first, last = int(corners.min()), int(corners.max())  # a piece has complete rows of points
    points = fields.drawn_points(basin, origin, basin.mesh.points[first : last + 1])
    blocks = {key: [array] for key, array in values.items()}
    try:
        fields.write_frame(piece_path(path, k), points, [("quad", corners - first)], blocks, units)
    except OSError as error:
        return error.errno, error.strerror or str(error), str(error.filename or piece_path(path, k))
    return ()


def piece_path(path: Path, k: int) -> Path:
    """Path of the file of rank k: `pool.1-000012.vtu` for `pool-000012.pvtu`; no part can have a name with a dot."""
    name, _, frame = path.stem.rpartition("-")
    return path.with_name(f"{name}.{k}-{frame}.vtu")


def pvtu_text(path: Path, n: int, values: dict[str, np.ndarray], units: dict[str, str]) -> str:
    """Text of the .pvtu index of the files of n ranks."""
    arrays = [
        f'<PDataArray type="{VTK_TYPES[array.dtype.kind]}{8 * array.dtype.itemsize}" Name="{key}" '
        f'NumberOfComponents="{array[:1].size}">\n{fields.unit_xml(units, key)}</PDataArray>'
        for key, array in values.items()
    ]  # fmt: skip
    pieces = [f'<Piece Source="{piece_path(path, k).name}"/>' for k in range(n)]
    points = '<PPoints>\n<PDataArray type="Float64" Name="Points" NumberOfComponents="3"/>\n</PPoints>'
    lines = [
        '<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">',
        '<PUnstructuredGrid GhostLevel="0">', points, "<PCellData>", *arrays, "</PCellData>", *pieces,
        "</PUnstructuredGrid>", "</VTKFile>",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"
