"""Fields and holes of a basin by polygons of a GIS file, such as land use, soils and buildings."""

import math
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.csv_rows import copy_name, find_file
from fvsolve.parts.raster import CENTRES
from fvsolve.parts.table_model import check_table, read_keys
from fvsolve.parts.value import NEEDED, Quantity, ReadContext, Text, Value, ValueFault, faults_of
from fvsolve.parts.vector_files import Features, read_features, reprojected
from fvsolve.units import show

SIDECARS = (".shx", ".dbf", ".prj", ".cpg")  # files of a shapefile beside it
ATTRIBUTE = re.compile(r"\{([^{}]*)\}")
POINTS = 4  # points along each side of a rectangular cell at which polygons are looked up
POINTS_PER_STRIP = 0.25  # strips over the root of the number of points
MOST_NAMES = 10  # of classes in a message


def read_polygons(given: dict[str, Any], setting: ReadContext) -> tuple[str, Features]:
    """(name of the copy of the file, polygons in the coordinates of the basin that is read).

    given : table with the keys `polygons`, `layer` and `crs`. Raises ValueFault.
    """
    name = given.get("polygons")
    try:
        path = find_file(Text().read(name, setting), setting)
        copy = copy_name(path, setting)
        if path.suffix.lower() == ".shp":
            for suffix in SIDECARS:
                for companion in (path.with_suffix(suffix), path.with_suffix(suffix.upper())):
                    if companion.is_file():
                        find_file(str(companion), setting)
        (east, north), crs = setting.frame
        features = read_features(path, str(given.get("layer", "")))
        features = reprojected(features, crs, str(given.get("crs", "")))
        for k, shape in enumerate(features.shapes):
            if shape.kind != "polygon":
                text = f"{features.place(k)} is a {shape.kind}; expected polygons"
                raise ValueError(text)
    except ValueError as error:
        raise ValueFault(faults_of(error, "polygons")) from None
    shift = np.array([east, north, 0.0])
    shapes = [
        shape._replace(pieces=[piece - shift for piece in shape.pieces])
        for shape in features.shapes
    ]
    return copy, features._replace(shapes=shapes)


def owners(features: Features, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Index of the last polygon that contains each point, -1 where none does : int64[n]; x, y : float64[n] [m]"""
    found = np.full(x.size, -1)
    if not x.size:
        return found
    # Points sorted by strips of equal height, and by x in each strip: a polygon then looks at few of them.
    count = max(int(POINTS_PER_STRIP * math.sqrt(x.size)), 1)
    south, north = y.min(), y.max()
    height = max((north - south) / count, np.finfo(float).tiny)
    strip = np.minimum(((y - south) / height).astype(int), count - 1)
    width = float(x.max() - x.min()) + 1.0
    order = np.argsort(strip * width + (x - x.min()), kind="stable")
    starts = np.searchsorted(strip[order], np.arange(count + 1))
    sorted_x = x[order]
    for k, shape in enumerate(features.shapes):
        points = np.concatenate(shape.pieces)[:, :2]
        low, high = points.min(axis=0), points.max(axis=0)
        first, last = np.clip((np.array([low[1], high[1]]) - south) / height, 0, count - 1)
        rows = []
        for number in range(int(first), int(last) + 1):
            own = sorted_x[starts[number] : starts[number + 1]]
            begin, end = np.searchsorted(own, low[0]), np.searchsorted(own, high[0], "right")
            rows.append(order[starts[number] + begin : starts[number] + end])
        near = np.concatenate(rows)
        near = near[(y[near] >= low[1]) & (y[near] <= high[1])]
        near = near[np.argsort(y[near], kind="stable")]
        found[near[_inside(shape.pieces, x[near], y[near])]] = k
    return found


def _inside(rings: list[np.ndarray], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """True for points inside an odd number of rings : bool[n]; y rises."""
    inside = np.zeros(x.size, bool)
    for ring in rings:
        # between both heights of a side lie points in succession
        first, last = ring[:, :2], np.roll(ring[:, :2], -1, axis=0)
        low, high = np.minimum(first[:, 1], last[:, 1]), np.maximum(first[:, 1], last[:, 1])
        begin, end = np.searchsorted(y, low), np.searchsorted(y, high)
        for k in np.flatnonzero(end > begin):
            part = slice(begin[k], end[k])
            (x0, y0), (x1, y1) = first[k], last[k]
            inside[part] ^= x[part] < x0 + (y[part] - y0) * ((x1 - x0) / (y1 - y0))
    return inside


@dataclass(frozen=True, eq=False)
class PolygonValues:
    """Values by polygons, and those of another field outside of them.

    features : polygons; values : float64[polygons], in SI; adds : True if they are added to the other field
    outside : field outside of the polygons, a `SpatialField`, or None
    last : mesh, and means over its cells
    """

    features: Features
    values: np.ndarray
    adds: bool
    outside: Any
    last: list = field(default_factory=list, repr=False)

    def over(self, mesh: Any) -> np.ndarray:
        """Means over the cells of a mesh, by points in each cell : float64[n]. Raises ValueError for a gap."""
        if self.last and self.last[0] is mesh:
            return self.last[1]
        x, y = points_in_cells(mesh)
        own = owners(self.features, x.ravel(), y.ravel()).reshape(x.shape)
        weights = 1.0 / len(x)
        covered = np.where(own >= 0, weights, 0.0).sum(axis=0)
        total = np.where(own >= 0, self.values[own] * weights, 0.0).sum(axis=0)
        # A cell within polygons of a single value has exactly this value.
        least = np.where(own >= 0, self.values[own], np.inf).min(axis=0)
        greatest = np.where(own >= 0, self.values[own], -np.inf).max(axis=0)
        total = np.where((least == greatest) & (own >= 0).all(axis=0), greatest, total)
        if self.adds or (own < 0).any():
            others = self._outside(mesh, np.flatnonzero((own < 0).any(axis=0)))
            share = 1.0 if self.adds else 1.0 - covered
            mixed = total + share * np.where(share > 0.0, others, 0.0)
            # without a polygon the cell has exactly the value of the other field
            total = np.where((own >= 0).any(axis=0), mixed, others)
        self.last[:] = [mesh, total]
        return total

    def _outside(self, mesh: Any, cells: np.ndarray) -> np.ndarray:
        """Means of the field outside of the polygons : float64[n]; cells : numbers of cells that need it"""
        from fvsolve.parts.formula import means, samples

        if self.outside is None:
            x, y = mesh.centre[cells[0]]
            text = f"{self.features.name} does not cover {cells.size}"
            text = f"{text} of {len(mesh.cells)} cells, first at {x:.6g}, {y:.6g} m"
            raise ValueError(
                f"{text}; expected polygons over the whole basin, or the key `outside`"
            )
        return means(samples(self.outside, mesh))

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points. Raises ValueError for a point without value."""
        own = owners(self.features, x, y)
        values = np.where(own >= 0, self.values[own], 0.0)
        others = (own < 0) | self.adds
        if not others.any():
            return values
        if self.outside is None:
            k = int(np.argmax(others))
            text = f"{self.features.name} does not cover x = {x[k]:.6g} m, y = {y[k]:.6g} m"
            text = f"{text}; expected polygons there, or the key `outside`"
            raise ValueError(text)
        values[others] += self.outside.at(x[others], y[others])
        return values


def points_in_cells(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Points that represent equal areas of each cell of a mesh : two float64[points, n] [m].

    On full or cut rectangles they are 4 by 4 in each cell; a triangle has nine, a quadrilateral nine of each half.
    """
    if mesh.grid is not None:
        at = (np.arange(POINTS) + 0.5) / POINTS
        j, i = np.nonzero(mesh.grid.index >= 0)
        order = np.argsort(mesh.grid.index[j, i])
        j, i = j[order], i[order]
        x = mesh.grid.x[i] + np.repeat(at, POINTS)[:, None] * np.diff(mesh.grid.x)[i]
        y = mesh.grid.y[j] + np.tile(at, POINTS)[:, None] * np.diff(mesh.grid.y)[j]
        return x, y
    corners = mesh.points[mesh.cells[:, :3]]
    first = np.einsum("pk,nkd->dpn", CENTRES, corners)
    with_four = mesh.cells[:, 3] >= 0
    if not with_four.any():
        return first[0], first[1]
    second = first.copy()
    second[..., with_four] = np.einsum(
        "pk,nkd->dpn", CENTRES, mesh.points[mesh.cells[with_four][:, [0, 2, 3]]]
    )
    both = np.concatenate([first, second], axis=1)
    return both[0], both[1]


@dataclass(frozen=True)
class PolygonClasses(Value):
    """Value of a case file: class of polygons -> quantity."""

    value: Quantity

    def read(self, given: Any, setting: ReadContext) -> dict[str, float]:
        check_table(given, "classes, for example { forest = 0.1, road = 0.02 }")
        faults, values = [], {}
        for key, item in given.items():
            try:
                values[str(key)] = self.value.read(item, setting)
            except ValueError as error:
                faults += faults_of(error, key)
        if faults:
            raise ValueFault(faults)
        return values


class Template(Value):
    """Value of a case file: a quantity, or text with an attribute in braces."""

    def read(self, given: Any, setting: ReadContext) -> Any:
        return given


def read_polygon_values(
    given: dict[str, Any], value: Quantity, setting: ReadContext
) -> tuple[dict[str, Any], PolygonValues]:
    """(table for the resolved case, values by polygons) from a table of a case file; value : declaration of a value

    Raises ValueFault with all faults.
    """
    from fvsolve.parts.formula import SpatialFieldKey

    keys = read_keys(
        given,
        {
            "polygons": (Text(), NEEDED),
            "layer": (Text(), ""),
            "crs": (Text(), ""),
            "value": (Template(), None),
            "add": (Template(), None),
            "classes": (PolygonClasses(value), None),
            "outside": (SpatialFieldKey(value.dimension, "", value.range), None),
        },
        setting,
    )
    stated = [key for key in ("value", "add") if keys[key] is not None]
    if len(stated) != 1:
        text = "expected `value`, or `add` for values that are added to those of `outside`"
        raise ValueFault([((), text)])
    adds = stated == ["add"]
    if adds and keys["outside"] is None:
        raise ValueFault([((), "outside is missing, to which `add` is added")])
    name, features = read_polygons(given, setting)
    key = stated[0]
    values = polygon_numbers(keys[key], features, keys["classes"], value, key, setting)
    table = {**given, "polygons": name}
    if keys["outside"] is not None:
        table["outside"] = keys["outside"].table()
    return table, PolygonValues(features, values, adds, keys["outside"])


def polygon_numbers(
    template: Any,
    features: Features,
    classes: dict[str, float] | None,
    value: Quantity,
    key: str,
    setting: ReadContext,
) -> np.ndarray:
    """Value of each polygon : float64[polygons], in SI. Raises ValueFault at the key.

    template : quantity, or text with an attribute in braces; classes : values of the texts, None for numbers
    """
    known = features.attributes[0]
    names = ATTRIBUTE.findall(template) if isinstance(template, str) else []
    for name in names:
        if name not in known:
            near = did_you_mean(name, known) or f"; attributes are {listing([*known] or ['none'])}"
            raise ValueFault([((key,), f"{features.name} has no attribute {show(name)}{near}")])
    result = np.zeros(len(features.shapes))
    read: dict[Any, float] = {}
    for k, attributes in enumerate(features.attributes):
        if any(attributes[name] in (None, "") for name in names):
            text = f"{features.place(k)} has no {listing(names)}"
            text = f"{text}; expected a value for each polygon"
            raise ValueFault([((key,), text)])
        item = template
        if names and template == f"{{{names[0]}}}":
            item = attributes[names[0]]
        elif names:
            item = ATTRIBUTE.sub(lambda match, own=attributes: str(own[match[1]]), template)
        if item not in read:
            read[item] = _number(item, features, classes, value, key, k, setting)
        result[k] = read[item]
    return result


def _number(
    item: Any,
    features: Features,
    classes: dict[str, float] | None,
    value: Quantity,
    key: str,
    k: int,
    setting: ReadContext,
) -> float:
    if classes is not None:
        if str(item) not in classes:
            text = f"{features.place(k)} has the class {show(str(item))}"
            text = f"{text}, which `classes` does not have"
            known = (
                did_you_mean(str(item), classes)
                or f"; classes are {listing([*classes], MOST_NAMES)}"
            )
            raise ValueFault([(("classes",), f"{text}{known}")])
        return classes[str(item)]
    try:
        return value.read(item, setting)
    except ValueError as error:
        raise ValueFault([((key,), f"{features.place(k)}: {error}")]) from None


@dataclass(frozen=True, eq=False)
class PolygonHoles:
    """Cells of a rectangle that are cut out, because their centres lie in polygons.

    given : table for the resolved case; notes : texts on the last mesh
    """

    given: dict[str, Any]
    features: Features
    notes: list[str] = field(default_factory=list)

    def lacks(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """True for cells in polygons, and for courtyards : bool[ny, nx]; x, y : grid lines [m]

        A courtyard is a part of the remaining cells that polygons enclose, away from the sides of the rectangle.
        """
        from scipy.ndimage import label

        across, along = np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
        inside = owners(self.features, across.ravel(), along.ravel()) >= 0
        inside = inside.reshape(across.shape)
        piece, count = label(~inside)
        if count > 1:
            sizes = np.bincount(piece.ravel(), minlength=count + 1)
            sizes[0] = 0
            at_sides = np.concatenate([piece[0], piece[-1], piece[:, 0], piece[:, -1]])
            kept = np.union1d(at_sides, [int(np.argmax(sizes))])
            courtyards = ~inside & ~np.isin(piece, kept)
            area = np.outer(np.diff(y), np.diff(x))[courtyards].sum()
            if courtyards.any():
                number = count - np.setdiff1d(kept, [0]).size
                text = f"holes enclose {area:.6g} m2 in {number} courtyards"
                if number == 1:
                    text = f"holes enclose a courtyard of {area:.6g} m2"
                self.notes[:] = [f"{text}, cut out too: no water reaches it, and its rain is lost"]
            inside |= courtyards
        return inside

    def table(self) -> dict[str, Any]:
        """Table of a case file."""
        return self.given


def read_polygon_holes(given: dict[str, Any], setting: ReadContext) -> PolygonHoles:
    """Holes by polygons from a table of a case file. Raises ValueFault with all faults."""
    keys = {"polygons": (Text(), NEEDED), "layer": (Text(), ""), "crs": (Text(), "")}
    read_keys(given, keys, setting)
    name, features = read_polygons(given, setting)
    return PolygonHoles({**given, "polygons": name}, features)
