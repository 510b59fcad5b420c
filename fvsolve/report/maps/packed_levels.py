"""Values of maps as levels of one byte, packed for the page of a report, with the data to unpack them."""

import base64
import zlib
from typing import Any

import numpy as np

from fvsolve.report.maps.map_classes import Classes

LEVELS = 252  # number of levels of a packed value, divided among the classes


def legend_data(classes: Classes) -> dict[str, Any]:
    """Texts, colours and unit of classes, for the legend."""
    return {"texts": classes.texts, "colours": list(classes.colours), "unit": classes.unit}


def scale_data(classes: Classes, greatest: float) -> dict[str, Any]:
    """Limits of the classes and the number of levels of each class, from which the script computes values."""
    return {
        "limits": [*classes.limits, max(greatest, classes.limits[-1])],
        "each": LEVELS // len(classes.limits),
    }


def levels_of(values: np.ndarray, classes: Classes, greatest: float) -> np.ndarray:
    """Levels of values : uint8, same shape; 0 for none, else 1 + k each + j for part j of class k.

    Each class is divided into `each` = LEVELS // classes equal parts; the last one ends at `greatest`.
    """
    numbers = classes.of(values)
    each = LEVELS // len(classes.limits)
    low = np.array(classes.limits)
    high = np.array([*classes.limits[1:], max(greatest, classes.limits[-1])])
    width = np.maximum(high - low, 1e-300)
    k = np.maximum(numbers, 0)
    share = (np.nan_to_num(values) - low[k]) / width[k]
    part = np.clip(np.floor(share * each), 0, each - 1)
    return np.where(numbers >= 0, 1 + k * each + part, 0).astype(np.uint8)


def packed_series(rasters: list[np.ndarray]) -> list[str]:
    """Packed rasters, each but the first as its difference from the raster before (exclusive or)."""
    pairs = zip([np.zeros_like(rasters[0]), *rasters[:-1]], rasters, strict=True)
    return [packed(before ^ own) for before, own in pairs]


def packed(levels: np.ndarray) -> str:
    """Bytes of levels compressed by zlib, in base 64."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(levels).tobytes(), 9)).decode()


def greatest_of(values: np.ndarray) -> float:
    """Greatest value that is not NaN; 0 if there is none."""
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else 0.0
