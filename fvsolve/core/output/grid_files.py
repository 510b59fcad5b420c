"""Grids of square pixels written at the end of a run: grids/NAME-FIELD.tif, or grids/NAME.nc with all fields."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case.output_grids import pixel_counts
from fvsolve.core.output.csv_files import VELOCITY_AXES
from fvsolve.core.output.fields import FILE_ATTRIBUTE, read_series
from fvsolve.file_replacement import replacing
from fvsolve.parts.raster_files import import_library
from fvsolve.units import DIMENSIONS

SOURCE = FILE_ATTRIBUTE.pattern.replace("file", "Source")
NEAR = 1e-12  # of the size of a cell squared: twice the area by which a point may lie outside
MERCATOR = {  # parameter of Transverse_Mercator in the text of a CRS -> its name in CF-1.8
    "latitude_of_origin": "latitude_of_projection_origin",
    "central_meridian": "longitude_of_central_meridian",
    "scale_factor": "scale_factor_at_central_meridian",
    "false_easting": "false_easting",
    "false_northing": "false_northing",
}
BLOCK = 4096  # cells at once: limits the memory of pairs of cells and pixels


def write_grids(folder: Path, model: Any, summary: Any) -> None:
    """Write all grids of a case. summary : `Summary` of the run, with its end and the greatest values of basins"""
    t, maxima = summary.t, summary.maxima
    basins = {basin.name: basin for basin in model.meshed}
    for name, spec in model.case.output.grids.items():
        (folder / "grids").mkdir(exist_ok=True)
        grid = PixelGrid(basins[spec.basin], spec, end_text(summary))
        if spec.format == "netcdf":
            grid.write_netcdf(
                folder / f"grids/{name}.nc", *grid.series(folder, t, maxima.get(spec.basin, {}))
            )
        else:
            (values,) = grid.series(folder, t, maxima.get(spec.basin, {}))[1]
            for key in spec.fields:
                grid.write_geotiff(folder / f"grids/{name}-{key}.tif", key, values[key])


def end_text(summary: Any) -> str:
    """Sentence on the end of a run, for readers of a file without the run directory."""
    text = f"The run finished at t = {summary.t:.6g} s."
    if summary.reason != "finished":
        text = f"The run stopped early at t = {summary.t:.6g} s: {summary.reason}."
    if np.isfinite(summary.invalid_from):
        text += f" Values are not valid from t = {summary.invalid_from:.6g} s on."
    return text


class PixelGrid:
    """Square pixels over a basin, each with the cell in which its centre lies.

    x : float64[nx], y : float64[ny]  centres of pixels, from west and from south [m]
    cell : int64[ny, nx]  number of the cell, -1 outside the mesh
    end : sentence on the end of the run
    """

    def __init__(self, basin: Any, spec: Any, end: str) -> None:
        self.basin, self.spec, self.end = basin, spec, end
        low, (nx, ny) = basin.mesh.points.min(axis=0), pixel_counts(basin.mesh, spec.cell)
        self.x, self.y = (
            at + spec.cell * (np.arange(count) + 0.5)
            for at, count in zip(low, (nx, ny), strict=True)
        )
        self.cell = cells_of_pixels(basin.mesh, self.x, self.y)
        self.east, self.north = basin.part.origin or (0.0, 0.0)

    def values(self, cells: np.ndarray) -> np.ndarray:
        """Values of the pixels, NaN outside the mesh : float64[ny, nx]; cells : float64[n]"""
        return np.where(self.cell >= 0, cells[self.cell], np.nan)

    def series(
        self, folder: Path, t: float, maxima: dict
    ) -> tuple[list[float], Iterator[dict[str, np.ndarray]]]:
        """Times [s], and the values of the fields in cells at each time; greatest values belong to the last time.

        Times are those of the frames if a field is not a greatest value (for a GeoTIFF only the last), else the end t
        of the run.
        """
        recorded = {key: maxima[key] for key in self.spec.fields if key in maxima}
        if len(recorded) == len(self.spec.fields):
            return [t], iter([recorded])
        files = [
            (time, path)
            for time, path in read_series(folder / "fields.pvd")
            if path.stem.rpartition("-")[0] == self.basin.name
        ]
        files = files[-1:] if self.spec.format == "geotiff" else files
        own = [key for key in self.spec.fields if key not in maxima]
        void = {key: np.full(self.basin.n, np.nan) for key in recorded}
        frames = (
            {key: frame_field(path, key) for key in own}
            | (recorded if path is files[-1][1] else void)
            for _, path in files
        )
        return [time for time, _ in files], frames

    @property
    def zero_time(self) -> str:
        """Date of t = 0 in UTC, or in local time without zone, after CF; 1970-01-01 without a start time."""
        start = self.basin.case.numerics.start_time
        return "1970-01-01 00:00:00" if start is None else start.stamp.reference

    def unit(self, key: str) -> str:
        """SI unit of a field."""
        own = self.basin.part.physics_type
        dimension = (own.fields | own.maxima).get(key)
        return self.basin.case.scalars[key].unit if dimension is None else DIMENSIONS[dimension].si

    def write_geotiff(self, path: Path, key: str, cells: np.ndarray) -> None:
        """Write a field as a GeoTIFF with one band. cells : float64[n]"""
        rasterio = import_library("rasterio", "a GeoTIFF")
        step = self.spec.cell
        corner = (
            self.east + self.x[0] - 0.5 * step,
            self.north + self.y[0] + step * (self.y.size - 0.5),
        )
        keys = {
            "driver": "GTiff",
            "width": self.x.size,
            "height": self.y.size,
            "count": 1,
            "dtype": "float64",
            "transform": rasterio.Affine(step, 0.0, corner[0], 0.0, -step, corner[1]),
            "nodata": np.nan,
            "crs": self.basin.part.crs,
            "compress": "deflate",
        }
        with replacing(path) as fresh, rasterio.open(fresh, "w", **keys) as file:
            file.write(self.values(cells)[::-1], 1)
            file.update_tags(TITLE=self.basin.case.title or self.basin.case.name, RUN=self.end)
            file.set_band_description(1, key)
            file.set_band_unit(1, self.unit(key))

    def write_netcdf(
        self, path: Path, times: list[float], frames: Iterator[dict[str, np.ndarray]]
    ) -> None:
        """Write the fields as NetCDF-3, after CF-1.8. frames : field -> float64[n] at each of the times [s]"""
        from scipy.io import netcdf_file

        with replacing(path) as fresh, netcdf_file(fresh, "w", version=2) as file:
            file.Conventions, file.title = "CF-1.8", self.basin.case.title or self.basin.name
            file.comment = self.end
            for axis, unit, word, at in (
                ("time", f"seconds since {self.zero_time}", "time", np.array(times)),
                ("y", "m", "projection_y_coordinate", self.north + self.y),
                ("x", "m", "projection_x_coordinate", self.east + self.x),
            ):
                file.createDimension(axis, at.size)
                item = file.createVariable(axis, "d", (axis,))
                item.units, item.standard_name, item.axis = unit, word, axis[0].upper()
                item[:] = at
            if self.basin.part.crs:
                item = file.createVariable("crs", "i", ())
                for key, value in grid_mapping(self.basin.part.crs).items():
                    setattr(
                        item, key, value if isinstance(value, (str, bytes)) else np.float64(value)
                    )
            for key in self.spec.fields:
                item = file.createVariable(key, "d", ("time", "y", "x"))
                item.units, item._FillValue = self.unit(key).replace("-", "1"), np.nan
                if self.basin.part.crs:
                    item.grid_mapping = "crs"
            for k, frame in enumerate(frames):
                for key in self.spec.fields:
                    file.variables[key][k] = self.values(frame[key])


def grid_mapping(crs: str) -> dict[str, Any]:
    """Attributes of the variable of a grid mapping (CF-1.8) for a CRS such as "EPSG:32633".

    GDAL reads the CRS from its text (WKT), which is written if rasterio is installed and knows the code.
    """
    import re

    try:
        rasterio = import_library("rasterio", "the text of a CRS")
        text = rasterio.crs.CRS.from_user_input(crs).to_wkt()
    except ValueError:  # a CRSError is one too
        return {"epsg_code": crs, "spatial_ref": crs}
    result = {"epsg_code": crs, "spatial_ref": text.encode(), "crs_wkt": text.encode()}
    if 'PROJECTION["Transverse_Mercator"]' in text:
        result["grid_mapping_name"] = "transverse_mercator"
        result |= {
            to: float(re.search(rf'PARAMETER\["{key}",([^]]+)\]', text)[1])
            for key, to in MERCATOR.items()
        }
        axis, flattening = re.search(r'SPHEROID\["[^"]*",([^,]+),([^],]+)', text).groups()
        result |= {"semi_major_axis": float(axis), "inverse_flattening": float(flattening)}
    return result


def frame_field(path: Path, key: str) -> np.ndarray:
    """Values of a field in the cells of a frame of a basin, from its .vtu file or those of all ranks : float64[n]."""
    import re

    from meshio import vtu

    if path.suffix == ".pvtu":
        pieces = re.findall(SOURCE, path.read_text(encoding="utf-8"))
        return np.concatenate([frame_field(path.parent / name, key) for name in pieces])
    data = vtu.read(str(path)).cell_data
    if key == "speed":
        return np.hypot(*np.concatenate(data["velocity"])[:, :2].T)
    if key in VELOCITY_AXES:
        return np.concatenate(data["velocity"])[:, VELOCITY_AXES[key]]
    return np.concatenate(data[key])


def cells_of_pixels(mesh: Any, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Number of the cell that contains each point of a grid, the lowest on a side, -1 outside : int64[ny, nx].

    x : float64[nx], y : float64[ny]  evenly spaced coordinates [m]
    """
    if mesh.grid is not None:
        (i, across), (j, along) = (
            (
                np.clip(np.searchsorted(lines, at, "right") - 1, 0, lines.size - 2),
                (at >= lines[0]) & (at <= lines[-1]),
            )
            for lines, at in ((mesh.grid.x, x), (mesh.grid.y, y))
        )
        return np.where(along[:, None] & across, mesh.grid.index[j[:, None], i], -1)
    found = np.full((y.size, x.size), -1)
    # lower numbers replace higher ones
    for first in range(len(mesh.cells) - len(mesh.cells) % BLOCK, -1, -BLOCK):
        cells = np.arange(first, min(first + BLOCK, len(mesh.cells)))[::-1]
        corners = mesh.points[
            np.where(mesh.cells[cells] < 0, mesh.cells[cells][:, :1], mesh.cells[cells])
        ]
        low, high = corners.min(axis=1), corners.max(axis=1)
        (i, wide), (j, tall) = (
            (a, np.maximum(b - a, 0))
            for at, k in ((x, 0), (y, 1))
            for a in [np.searchsorted(at, low[:, k])]
            for b in [np.searchsorted(at, high[:, k], "right")]
        )
        own = np.repeat(np.arange(cells.size), wide * tall)
        rest = np.arange(own.size) - np.repeat(np.cumsum(wide * tall) - wide * tall, wide * tall)
        i, j = i[own] + rest % wide[own], j[own] + rest // wide[own]
        a, b = corners[own], np.roll(corners[own], -1, axis=1)
        left = (b - a)[..., 0] * (y[j, None] - a[..., 1]) - (b - a)[..., 1] * (
            x[i, None] - a[..., 0]
        )
        inside = (left >= -NEAR * np.ptp(corners, axis=1).max(axis=1)[own, None] ** 2).all(axis=1)
        found[j[inside], i[inside]] = cells[own[inside]]
    return found
