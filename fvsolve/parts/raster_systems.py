"""Coordinate systems of rasters: their codes, systems in degrees, numbers that look like degrees, stretched lengths."""

import math
import re
from decimal import Decimal

from fvsolve.errors import visible

# [m] or degrees: pixels of most rasters in degrees are smaller, and of nearly all
SMALL, MIDDLE = 0.01, 0.1
# distance from both axes that suggests degrees: multiple of the extent, and [m] or degrees
FAR, LEAST_FAR = 10.0, 5.0
# least number of digits of a size of pixels that is a fraction of a degree, and compared digits
DIGITS = 5, 9
IN_DEGREES = re.compile(  # text of a CRS: WKT, file .prj of ArcInfo, PROJ
    r"\b(?:GEOGCS|GEOGCRS|GEODCRS|GEOGRAPHICCRS)\[|^[ \t]*(?:Projection[ \t]+GEOGRAPHIC|Units[ \t]+D[DS])\b"
    r"|\+proj=(?:longlat|latlong)",
    re.IGNORECASE | re.MULTILINE,
)
PROJECTED = re.compile(r"\bPROJ(?:CS|CRS|ECTEDCRS)\[", re.IGNORECASE)
WEB_MERCATOR = re.compile("web_?mercator|pseudo-mercator|mercator_auxiliary_sphere", re.IGNORECASE)
# Name and length [m] of a unit
LINEAR_UNIT = re.compile(
    r'\bUNIT\["([^"]{1,80})",[ \t]{0,9}(\d{1,9}(?:\.\d{0,20})?)', re.IGNORECASE
)
# codes of Mercator projections of the world
STRETCHED = (3395, 3785, 3857, 3587, 41001, 54004, 102100, 102113, 900913)
EARTH = 6378137.0  # radius in these projections [m]
# in the text of a CRS; the last is its own
AUTHORITY = re.compile(r'(?:AUTHORITY|ID)\["EPSG",\s*"?(\d{1,9})"?\]')
# Numbers of EPSG up to 9140 for systems in degrees, in ranges without projected and vertical systems (EPSG 12; the
# ranges include geocentric systems and numbers without a system).
NUMBERS_IN_DEGREES = """
    3819-3824 3888-3889 3906 4001-4025 4027-4036 4040-4047 4052-4055 4074-4081 4120-4216 4218-4388 4463-4466 4469-4470
    4472 4475-4483 4490 4555-4558 4600-4646 4657-4765 4801-4811 4813-4821 4823-4824 4883-5013 5132 5228-5233 5245-5246
    5251-5252 5263-5264 5323-5324 5340-5342 5353-5354 5359-5360 5364-5365 5370-5381 5392-5393 5451 5464 5467 5488-5489
    5498-5500 5524-5527 5545-5546 5560-5561 5592-5593 5628 5681 5830 5885-5886 5942 6134-6135 6144 6207 6310-6311
    6318-6325 6349 6364-6365 6649 6667-6668 6696-6700 6705-6706 6782-6783 6881-6883 6892 6894 6917 6979-6983 6986-6990
    7034-7042 7072-7073 7084-7088 7133-7139 7372-7373 7400 7404 7406 7409-7410 7414 7423 7657-7686 7797-7798 7816
    7843-7844 7880-7881 7885-7886 7900-7931 8042-8043 8085-8086 8231-8255 8349-8351 8360 8399-8431 8449 8542-8545
    8684-8685 8694-8699 8817-8818 8860 8888 8899-8902 8906-8907 8916-8949 8972-9019 9053-9075 9139-9140
"""
REFERENCE = "expected a raster with coordinates in metres, for example written by GDAL or QGIS"


def is_in_degrees(crs: str) -> bool:
    """True for a code such as "EPSG:4326" of a system in degrees, by `NUMBERS_IN_DEGREES`."""
    if re.fullmatch(r"EPSG:\d{1,9}", crs) is None:
        return False
    ranges = ([int(end) for end in item.split("-")] for item in NUMBERS_IN_DEGREES.split())
    return any(ends[0] <= int(crs.removeprefix("EPSG:")) <= ends[-1] for ends in ranges)


def epsg_code(text: str) -> str:
    """Code such as "EPSG:32633" of the text of a CRS (WKT or code), "" if none. Raises ValueError for degrees."""
    text = text.strip()
    if (IN_DEGREES.search(text) and not PROJECTED.search(text)) or is_in_degrees(text):
        raise ValueError(f"is in degrees; {REFERENCE}")
    if re.fullmatch(r"EPSG:\d{1,9}", text):
        return text
    if WEB_MERCATOR.search(text):
        return "EPSG:3857"
    codes = AUTHORITY.findall(text)
    return f"EPSG:{codes[-1]}" if codes else ""


def stretch(crs: str, north: float) -> float:
    """Lengths of a CRS over true lengths at a northing [m]: above 1 for the Mercator projections of the world."""
    return math.cosh(north / EARTH) if crs in [f"EPSG:{code}" for code in STRETCHED] else 1.0


def check_metres(text: str) -> None:
    """Raise ValueError if the text of a projected CRS (WKT of ESRI and GDAL) states another unit than the metre."""
    plane = re.split(r"\bVERT_?CS\[", text, maxsplit=1)[0]
    for name, size in LINEAR_UNIT.findall(plane)[-1:] if PROJECTED.search(text) else []:
        if float(size) != 1.0:
            raise ValueError(f"is in {visible(name)}; {REFERENCE}")


def is_fraction_of_degree(size: float) -> bool:
    """True for a multiple of a ninth or a tenth of a second of arc, such as 0.00083333, that is no short decimal."""
    digits, exponent = Decimal(repr(size)).normalize().as_tuple()[1:]
    if len(digits) < DIGITS[0]:
        return False
    # of the compared digits: files round, or cut off
    last = 10.0 ** (exponent + max(len(digits) - DIGITS[1], 0))
    counts = [(3600.0 * parts, round(3600.0 * parts * size)) for parts in (9, 10)]
    return any(count > 0 and abs(count / per - size) <= 1.01 * last for per, count in counts)


def are_probably_degrees(
    low: tuple[float, float], size: tuple[float, float], count: tuple[int, int]
) -> bool:
    """True if the coordinates of pixels look like longitudes and latitudes.

    low : south-west corner; size, count : of the pixels along x and y
    They lie within their ranges, and either the pixels are fractions of a degree that are no short decimals, as 1/1200,
    and the raster lies away from the origin (or around the earth); or the pixels are small, and the raster lies away
    from both axes by many times its extent. A model of a laboratory lies around or near its origin.
    """
    extent = [step * number for step, number in zip(size, count, strict=True)]
    rim, high = max(size), [corner + length for corner, length in zip(low, extent, strict=True)]
    inside = (
        -180.0 - rim <= low[0]
        and high[0] <= 360.0 + rim
        and -90.0 - rim <= low[1]
        and high[1] <= 90.0 + rim
    )
    if not inside or rim >= MIDDLE:
        return False
    gaps = [max(begin, -end, 0.0) for begin, end in zip(low, high, strict=True)]
    if all(map(is_fraction_of_degree, size)):
        return math.hypot(*gaps) > max(extent) or extent[0] > 360.0 - rim
    distant = all(
        gap > max(FAR * length, LEAST_FAR) for gap, length in zip(gaps, extent, strict=True)
    )
    return distant and rim <= SMALL


def utm_code(east: float, north: float) -> str:
    """Code of the zone of UTM at a longitude and latitude [deg]."""
    return f"EPSG:{(32600 if north >= 0.0 else 32700) + int((east + 180.0) % 360.0 // 6.0) + 1}"
