"""Fields over a plane that change with time, linearly between frames, and the key that declares them."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.parts.formula import SpatialField, SpatialFieldKey, means, samples
from fvsolve.parts.raster import Raster, open_raster, raster_keys
from fvsolve.parts.raster_files import Pixels
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.table_model import keys_json, read_keys
from fvsolve.parts.time_stamps import StampError, read_stamp
from fvsolve.parts.value import UNREAD, ReadContext, ValueFault
from fvsolve.units import DIMENSIONS, show

SINGLE_DIGIT = re.compile(r"(?<!\d)(?=\d(?!\d))(?<![.,])")  # before a number of a single digit
OF_PLACE = re.compile(r"\b[xy]\b")  # in a formula


@dataclass(frozen=True, eq=False)
class SpatialSeries:
    """Field over a plane at several times [SI]; it is constant before the first and after the last.

    given : value as in the case file; times : float64[frames]  since the start of the run [s]
    frames : field at each time; least : field of the least values, without data where a frame has none
    value : greatest value of all frames, 0 if unknown
    """

    given: Any
    times: np.ndarray
    frames: tuple[SpatialField, ...]
    least: SpatialField
    value: float = 0.0

    def over(self, mesh: Any) -> np.ndarray:
        """Means over the cells of a mesh : float64[frames, n]."""
        return np.array([means(samples(frame, mesh)) for frame in self.frames])

    def table(self) -> Any:
        """Value of the field as in a case file."""
        return self.given

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SpatialSeries) and self.given == other.given

    def __hash__(self) -> int:
        return hash(str(self.given))


def read_series(given: dict[str, Any], dimension: str, setting: ReadContext) -> SpatialSeries:
    """Series of the frames of a raster, or a single frame; given : table of a case file

    Raises ValueError, or ValueFault with all faults of the table.
    """
    keys = read_keys(given, raster_keys(), setting)
    stated, name, pixels = open_raster(given, keys, setting, series=True)
    if not (unit := keys["unit"] or pixels.unit):
        example = DIMENSIONS[dimension].example.split()[-1]
        raise ValueError(
            f"{name} states no unit of its values; expected for example `unit = {show(example)}`"
        )
    values = units.find(unit, dimension).si(pixels.values)
    frames, holes = values.reshape(-1, *values.shape[-2:]), keys["outside"] == "hole"
    least, *fields = (
        SpatialField(stated, Raster(name, pixels._replace(values=plane), holes))
        for plane in (frames.min(axis=0), *frames)
    )
    return SpatialSeries(
        stated,
        np.zeros(1) if pixels.times is None else frame_times(name, pixels, setting.start_time),
        tuple(fields),
        least,
        float(np.nanmax(frames)),
    )


def frame_times(name: str, pixels: Pixels, start: Any) -> np.ndarray:
    """Times t of the frames of a raster [s], from their dates if there are dates and a start time.

    start : instant of t = 0 (`StartTime`), None without one, UNREAD if it is faulty
    A reference date without a zone is in UTC, after CF; in a case in local time it is local too.
    Raises ValueError for a reference that is not a date of our calendar.
    """
    if pixels.clock is None or start is None or start is UNREAD:
        return pixels.times
    reference, first = pixels.clock
    padded = SINGLE_DIGIT.sub("0", reference)
    try:
        zero = start.seconds(read_stamp(padded, offset=None))
    except StampError:
        try:
            zero = start.seconds(read_stamp(f"{padded}Z"))
        except StampError as error:
            raise ValueError(f"{name}, times since {reference}: {error}") from None
    return zero + first + pixels.times


class ScheduledField(Scheduled):
    """Value of a case file that may change with time, as `Scheduled`; or a formula of x and y, or a raster."""

    def read(self, given: Any, setting: ReadContext) -> Schedule | SpatialSeries:
        if isinstance(given, SpatialSeries):
            return given
        if isinstance(given, str) and OF_PLACE.search(given):
            field = SpatialFieldKey(self.dimension).read(given, setting)
            return SpatialSeries(given, np.zeros(1), (field,), field)
        if not (isinstance(given, dict) and "raster" in given):
            return super().read(given, setting)
        try:
            return read_series(given, self.dimension, setting)
        except ValueFault:
            raise
        except ValueError as error:
            raise ValueFault([(("raster",), str(error))]) from None

    @property
    def takes(self) -> str:
        return f"{super().takes}; formula; raster"

    def json(self) -> dict[str, Any]:
        return {"anyOf": [*super().json()["anyOf"], keys_json(raster_keys())]}
