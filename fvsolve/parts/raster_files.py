"""Files of pixels on a regular grid: ESRI ASCII grid, NetCDF and GeoTIFF."""

import re
import warnings
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve import units
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.csv_rows import read_text
from fvsolve.parts.raster_systems import (
    REFERENCE,
    SMALL,
    are_probably_degrees,
    check_metres,
    epsg_code,
    utm_code,
)
from fvsolve.parts.value import check_increasing
from fvsolve.units import show

MOST_CELLS = 1e8  # of a grid
HEAD = (
    "ncols",
    "nrows",
    "xllcorner",
    "yllcorner",
    "xllcenter",
    "yllcenter",
    "cellsize",
    "dx",
    "dy",
    "nodata_value",
)
HEAD_LINE = re.compile(r"[ \t]*([A-Za-z_]+)[ \t]+(\S+)[ \t]*\r?\n")
EVEN = 1e-4  # of the spacing: greatest distance of a coordinate from an even grid
# after CF
SINCE = re.compile(
    r"\s*(s|min|h|d|sec|hr|second|minute|hour|day)s?\s+since\s+(\S.*)", re.IGNORECASE
)
CALENDARS = ("standard", "gregorian", "proleptic_gregorian")  # of dates as ours
# along y, after CF
NORTH = re.compile("y|northing|lat(itude)?|projection_y_coordinate", re.IGNORECASE)


class Pixels(NamedTuple):
    """Values of pixels on a regular grid in the coordinates of its file.

    values : float64[ny, nx]  rows from south to north, NaN without data
    x, y : south-west corner [m]; dx, dy : size of a pixel [m]; unit, crs : as stated, "" if unknown
    metric : True if the file states that its coordinates are lengths
    clock : (text of the reference date of the times, time of the first frame after it [s]); None without a date
    times : float64[frames]  of a series of frames since the start of the run [s], with values : float64[frames, ny, nx]
    """

    values: np.ndarray
    x: float
    y: float
    dx: float
    dy: float
    unit: str = ""
    crs: str = ""
    times: np.ndarray | None = None
    metric: bool = False
    clock: tuple[str, float] | None = None

    @property
    def hint(self) -> str:
        """Remark on pixels whose numbers look like degrees; "" for others."""
        near = max(abs(self.x), abs(self.y)) <= 180.0 and self.dx < SMALL and not self.metric
        return "; are its coordinates in degrees?" if near else ""

    def to_basin(self, name: str, origin: tuple[float, float] | None, crs: str | None) -> "Pixels":
        """Pixels in the coordinates of a basin. Raises ValueError if the file `name` states another CRS.

        origin : easting and northing of the basin [m]; crs : CRS of the basin, if it is stated
        """
        if crs and self.crs and self.crs != crs:
            text = f"{name} has the CRS {self.crs}, and the basin {crs}"
            raise ValueError(
                f"{text}; expected a raster in {crs}, for example by gdalwarp -t_srs {crs}"
            )
        east, north = origin or (0.0, 0.0)
        return self._replace(x=self.x - east, y=self.y - north)


def import_library(name: str, what: str) -> Any:
    """Import a module of the extra `gis`. Raises ValueError with the command to install it if it is missing.

    what : subject of the message
    """
    try:
        return import_module(name)
    except ImportError:
        raise ValueError(
            f'{what} needs {name.partition(".")[0]}: pip install "fvsolve[gis]"'
        ) from None


def read_pixels(path: Path, band: int = 1, variable: str = "", series: bool = False) -> Pixels:
    """Pixels of a file, whose format follows from its first bytes. The last two files are kept.

    band : number of the band of a GeoTIFF; variable : name in a NetCDF file, "" for the only one
    series : True if a variable of a NetCDF file may have several frames
    Raises ValueError if the file is not a raster with metric coordinates and data.
    """
    try:
        stat = path.stat()
        return _read(path, stat.st_mtime_ns, stat.st_size, band, variable, series)
    except OSError as error:
        raise ValueError(f"{path.name}: {error.strerror or error}") from None


@lru_cache(maxsize=2)
def _read(path: Path, changed: int, size: int, band: int, variable: str, series: bool) -> Pixels:
    """Pixels of a file; changed, size : of the file, which differ for an edited file"""
    with open(path, "rb") as file:
        head = file.read(4)
    if head[:3] == b"CDF" or head == b"\x89HDF":
        check_unused(path, "band", band != 1, "a GeoTIFF")
        result = read_netcdf(path, variable, head[:3] == b"CDF", series)
    elif head[:2] in (b"II", b"MM"):
        check_unused(path, "variable", variable != "", "a NetCDF file")
        result = read_geotiff(path, band)
    else:
        check_unused(path, "variable", variable != "", "a NetCDF file")
        check_unused(path, "band", band != 1, "a GeoTIFF")
        result = read_ascii_grid(path)
    if not result.metric:
        check_lengths(path, result)
    result.values[~np.isfinite(result.values)] = np.nan
    if np.isnan(result.values).all():
        raise ValueError(f"{path.name} has no data in any pixel; expected a raster with data")
    result.values.flags.writeable = False
    return result


def check_lengths(path: Path, pixels: Pixels) -> None:
    """Raise ValueError for pixels whose coordinates look like degrees, in a file without a coordinate system."""
    low = (pixels.x, pixels.y)
    size = (pixels.dx, pixels.dy)
    count = pixels.values.shape[:-3:-1]
    if not are_probably_degrees(low, size, count):
        return
    utm = utm_code(
        *(
            corner + 0.5 * step * number
            for corner, step, number in zip(low, size, count, strict=True)
        )
    )
    text = f"{path.name} states no coordinate system, and its numbers look like degrees: pixels of {size[0]:.6g} by "
    text += f"{size[1]:.6g} at {low[0]:.6g}, {low[1]:.6g}; expected metres, for example by gdalwarp -s_srs EPSG:4326 "
    place = "the file" if path.suffix.lower() in (".tif", ".tiff", ".nc") else f"{path.stem}.prj"
    local = 'LOCAL_CS["local",UNIT["metre",1]]'
    raise ValueError(
        f"{text}-t_srs {utm}; if they are metres, state a system in {place}, for example {local}"
    )


def check_count(name: str, nx: float, ny: float) -> None:
    """Raise ValueError for a grid of too many cells; name : subject of the message"""
    if nx * ny > MOST_CELLS:
        text = f"{name} has {nx:.0f} x {ny:.0f} cells, more than {MOST_CELLS:.0e}"
        raise ValueError(f"{text}; expected larger cells, or a part of it")


def read_head(text: str) -> tuple[dict[str, str], int]:
    """Lines "key value" at the beginning of an ESRI ASCII grid, by key, and the place behind them."""
    keys = {}
    at = 0
    while (match := HEAD_LINE.match(text, at)) is not None and match[1].lower() in HEAD:
        keys[match[1].lower()] = match[2]
        at = match.end()
    return keys, at


def read_ascii_grid(path: Path) -> Pixels:
    """Pixels of an ESRI ASCII grid; a file .prj beside it may state its CRS."""
    text = read_text(path)
    keys, at = read_head(text)
    if "ncols" not in keys:
        raise ValueError(
            f"{path.name} is neither a GeoTIFF, NetCDF nor ESRI ASCII grid; {REFERENCE}"
        )
    for key in ("ncols", "nrows", "cellsize" if "dx" not in keys else "dy"):
        if key not in keys:
            raise ValueError(
                f"{path.name} has no line `{key}`; expected an ESRI ASCII grid with this line"
            )
    corner = [
        next((key for key in (f"{axis}llcorner", f"{axis}llcenter") if key in keys), "")
        for axis in "xy"
    ]
    if "" in corner:
        raise ValueError(
            f"{path.name} has no georeference: no lines `xllcorner` and `yllcorner`; {REFERENCE}"
        )
    sizes = [keys.get(key, keys.get("cellsize")) for key in ("dx", "dy")]
    try:
        nx, ny, x, y, dx, dy, missing = (
            float(units.plain_numbers(value)[0])
            for value in (
                keys["ncols"],
                keys["nrows"],
                *(keys[key] for key in corner),
                *sizes,
                keys.get("nodata_value", "-9999"),
            )
        )
    except ValueError as error:
        text = str(error).removeprefix("line 1: ")
        raise ValueError(
            f"{path.name}: {text}; expected numbers with decimal points in its first lines"
        ) from None
    if not (
        np.isfinite([x, y, dx, dy]).all()
        and min(dx, dy) > 0.0
        and nx == nx // 1 >= 1.0
        and ny == ny // 1 >= 1.0
    ):
        text = f"{path.name} has {nx:g} x {ny:g} pixels of {dx:g} x {dy:g} at {x:g}, {y:g}"
        raise ValueError(
            f"{text}; expected whole numbers of pixels above 0, sizes above 0, and finite numbers"
        )
    nx, ny = int(nx), int(ny)
    check_count(path.name, nx, ny)
    try:
        values = units.plain_numbers(text[at:], 1 + text.count("\n", 0, at))
    except ValueError as error:
        raise ValueError(f"{path.name}, {error}; expected numbers with decimal points") from None
    if values.size != nx * ny:
        raise ValueError(f"{path.name} has {values.size} numbers; expected {nx} x {ny}")
    values[values == missing] = np.nan
    x, y = (
        low - 0.5 * wide * key.endswith("center")
        for low, wide, key in zip((x, y), (dx, dy), corner, strict=True)
    )
    projection = path.with_suffix(".prj")
    stated = read_text(projection) if projection.is_file() else ""
    try:
        crs = epsg_code(stated)
        check_metres(stated)
    except ValueError as error:
        raise ValueError(f"{path.name} {error}") from None
    return Pixels(
        values.reshape(ny, nx)[::-1].copy(), x, y, dx, dy, crs=crs, metric=bool(stated.strip())
    )


def check_unused(path: Path, key: str, given: bool, owner: str) -> None:
    """Raise ValueError if a key is given that files of this format do not have; owner : the format that has it"""
    if given:
        raise ValueError(f"{path.name} has no {key}, which only {owner} has; remove it")


def read_geotiff(path: Path, band: int) -> Pixels:
    """Pixels of a band of a GeoTIFF, through rasterio."""
    rasterio = import_library("rasterio", f"{path.name} is a GeoTIFF, and a GeoTIFF")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            file = rasterio.open(path)
    except rasterio.errors.RasterioError as error:
        raise ValueError(f"{path.name} cannot be read: {error}") from None
    with file:
        to, crs = file.transform, file.crs
        if to.is_identity:
            raise ValueError(f"{path.name} has no georeference; {REFERENCE}")
        if not (to.a > 0.0 > to.e and to.b == to.d == 0.0):
            raise ValueError(
                f"{path.name} is turned or mirrored; expected rows along x, and north up"
            )
        if crs is not None and (crs.is_geographic or crs.linear_units_factor[1] != 1.0):
            unit = "degrees" if crs.is_geographic else crs.linear_units
            raise ValueError(f"{path.name} is in {unit}; {REFERENCE}")
        if not 1 <= band <= file.count:
            raise ValueError(
                f"{path.name} has {file.count} bands; expected `band` from 1 to {file.count}"
            )
        check_count(path.name, file.width, file.height)
        data = file.read(band, masked=True).astype(float).filled(np.nan)
        data = data * file.scales[band - 1] + file.offsets[band - 1]
        code = crs.to_epsg() if crs is not None else None
        return Pixels(
            data[::-1].copy(),
            to.c,
            to.f + file.height * to.e,
            to.a,
            -to.e,
            file.units[band - 1] or "",
            f"EPSG:{code}" if code else "",
            metric=crs is not None,
        )


class NetcdfVariable(NamedTuple):
    """Variable of a NetCDF file: names of its dimensions, shape, attributes, and function that reads its values."""

    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    attributes: dict[str, Any]
    read: Callable[[], np.ndarray]


def read_netcdf(path: Path, name: str, classic: bool, series: bool) -> Pixels:
    """Pixels of a variable over x and y, or over time too for a `series`.

    classic : True for NetCDF-3, which needs no extra package
    """
    try:
        if classic:
            from scipy.io import netcdf_file

            try:
                opened = netcdf_file(path, "r", mmap=False, maskandscale=True)
            except ValueError as error:  # a file that was cut off
                raise OSError(error) from None
            with opened as file:
                known = {
                    key: NetcdfVariable(
                        item.dimensions,
                        item.shape,
                        _texts(item._attributes),
                        lambda item=item: np.ma.filled(np.ma.asarray(item[:], float), np.nan),
                    )
                    for key, item in file.variables.items()
                }
                return _pixels_of(path.name, known, name, series)
        import_library("h5netcdf", f"{path.name} is a NetCDF-4 file, and NetCDF-4")
        xarray = import_library("xarray", f"{path.name} is a NetCDF-4 file, and NetCDF-4")
        with xarray.open_dataset(path, engine="h5netcdf", decode_times=False) as file:
            known = {
                str(key): NetcdfVariable(
                    item.dims,
                    item.shape,
                    dict(item.attrs),
                    lambda item=item: np.asarray(item.values, float),
                )
                for key, item in file.variables.items()
            }
            return _pixels_of(path.name, known, name, series)
    except (OSError, TypeError, KeyError, IndexError) as error:
        raise ValueError(f"{path.name} cannot be read as NetCDF: {error}") from None


def _texts(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes of a variable with texts in place of bytes."""
    return {
        key: item.decode(errors="replace") if isinstance(item, bytes) else item
        for key, item in attributes.items()
    }


def _pixels_of(file: str, known: dict[str, NetcdfVariable], name: str, series: bool) -> Pixels:
    """Pixels of the variable `name` of a NetCDF file, "" for the only one; known : its variables by name

    series : True if the variable may have several frames
    """
    planes = [key for key, item in known.items() if len(item.dimensions) > 1]
    if name not in known and (name or len(planes) != 1):
        text = (
            f"has no variable {show(name)}{did_you_mean(name, planes)}"
            if name
            else f"has {len(planes)} variables"
        )
        raise ValueError(
            f"{file} {text}; expected `variable`, of {listing(planes) or 'a file with a plane of values'}"
        )
    item = known[name or planes[0]]
    turned = len(item.dimensions) > 1 and _is_northward(item.dimensions[-1], known)
    across, along = item.dimensions[-2:] if not turned else item.dimensions[:-3:-1]
    if not {across, along} <= known.keys():
        raise ValueError(
            f"{file} has no georeference: no variables {across} and {along} with coordinates; {REFERENCE}"
        )
    check_count(file, *item.shape[-2:])
    (x, dx), (y, dy) = (_even(file, key, known[key]) for key in (along, across))
    (*outer, _, _), times, clock = item.shape, None, None
    if np.prod(outer) != 1 and not (series and len(outer) == 1 and outer[0]):
        raise ValueError(
            f"{file}: {name or planes[0]} has {np.prod(outer):.0f} planes; expected one at a single time"
        )
    if np.prod(outer) != 1:
        times, clock = _frame_times(file, item.dimensions[0], known)
    values = item.read().reshape((*outer, *item.shape[-2:])[-3 if times is not None else -2 :])
    values = values.swapaxes(-1, -2) if turned else values
    values = values[..., :: -1 if dy < 0.0 else 1, :: -1 if dx < 0.0 else 1].copy()
    holder = known.get(str(item.attributes.get("grid_mapping", "")))
    text = (
        ""
        if holder is None
        else str(holder.attributes.get("crs_wkt") or holder.attributes.get("spatial_ref", ""))
    )
    try:
        crs = epsg_code(text)
    except ValueError as error:
        raise ValueError(f"{file} {error}") from None
    metric = text.strip() != "" or "units" in known[along].attributes
    return Pixels(
        values,
        x,
        y,
        abs(dx),
        abs(dy),
        str(item.attributes.get("units", "")),
        crs,
        times,
        metric,
        clock,
    )


def _is_northward(dimension: str, known: dict[str, NetcdfVariable]) -> bool:
    """True for a dimension along y, by its name or the attributes of CF of its coordinates."""
    attributes = known[dimension].attributes if dimension in known else {}
    texts = dimension, attributes.get("axis"), attributes.get("standard_name")
    return any(NORTH.fullmatch(str(text)) for text in texts)


def _frame_times(
    file: str, name: str, known: dict[str, NetcdfVariable]
) -> tuple[np.ndarray, tuple[str, float] | None]:
    """(times of frames [s], `clock` of `Pixels`): as stated "since start", otherwise since the first frame.

    name : of the dimension of time; known : variables of the NetCDF file
    """
    if name not in known:
        raise ValueError(
            f"{file} has no variable {name}; expected the times of its frames, in seconds since start"
        )
    unit = str(known[name].attributes.get("units", ""))
    if (match := SINCE.fullmatch(unit)) is None:
        text = (
            f'{file}: {name} has the unit {show(unit)}; expected for example "seconds since start"'
        )
        raise ValueError(f'{text} or "minutes since 2026-01-01"')
    times = known[name].read()
    try:
        check_increasing(times, times.tolist(), "times")
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    unit = units.find({"s": "s", "m": "min", "h": "h", "d": "d"}[match[1][0].lower()], "time")
    if match[2].strip().lower() == "start":
        return unit.si(times), None
    calendar = str(known[name].attributes.get("calendar", "standard")).lower()
    reference = match[2].strip() if calendar in CALENDARS else f"{calendar} calendar"
    return unit.si(times - times[0]), (reference, float(unit.si(float(times[0]))))


def _even(file: str, name: str, item: NetcdfVariable) -> tuple[float, float]:
    """(lower edge, signed spacing) [m] of the pixels along a coordinate, whose values are their centres."""
    unit, at = str(item.attributes.get("units", "m")), item.read()
    if unit.startswith("degree") or item.attributes.get("standard_name") in (
        "longitude",
        "latitude",
    ):
        raise ValueError(f"{file} is in degrees; {REFERENCE}")
    try:
        at = at if unit in ("m", "") else units.find(unit, "length").si(at)
    except ValueError as error:
        raise ValueError(f"{file}, {name}: {error}") from None
    wide = (at[-1] - at[0]) / (at.size - 1) if at.size > 1 else 0.0
    if not wide or np.abs(at - (at[0] + wide * np.arange(at.size))).max() > EVEN * abs(wide):
        raise ValueError(
            f"{file}: {name} is not evenly spaced; expected two or more centres of equal pixels"
        )
    return float(min(at[0], at[-1]) - 0.5 * abs(wide)), float(wide)
