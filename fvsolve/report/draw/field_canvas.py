"""Pictures of basins and bodies from .vtu files, with surfaces drawn by PyVista: canvas, and meshes of frames."""

import math
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.file_replacement import replacing
from fvsolve.report.draw import style
from fvsolve.report.draw.network_picture import draw_parts
from fvsolve.report.draw.scene import (
    WATER_VIEW,
    DrawnScene,
    Projection,
    box_corners,
    draw_box,
    fit_limits,
    round_scale,
)
from fvsolve.report.draw.sheet import (
    COLOUR_MAP,
    HALF_SYMBOL,
    WATER,
    PictureSheet,
    colour_range,
    write_animation,
    write_frames,
)

# height over width below which bodies are drawn in plan, or depth over width for a profile
FLAT_SHARE = 0.08
LOW_SHARE = 0.05  # height over width below which basins are drawn with enlarged heights
DRAWN_SHARE = 0.12  # drawn height over width of such basins
LINE_OFFSET = 2e-3  # distance of contour lines above a surface, as a fraction of its diagonal
PART_MARGIN = 0.04  # margin for parts around a basin, as a fraction of its size
# height of buildings above the scene, as a fraction of the height of the scene
BUILDING_HEIGHT = 0.25
BED_COLOUR, SIDE_COLOUR, BUILDING_COLOUR, BODY_COLOUR = "#c9b99a", "#5b87a6", "#a8705a", "#4b5563"
AMBIENT_LIGHT = 0.35  # ambient light
BOX_MARGINS = (62.0, 44.0, 50.0, 14.0)  # margins of a box: left, low, right, high [points]


class FieldCanvas:
    """Picture of basins and bodies. All frames have the same colour range, bounding box and projection.

    film : True for frames of an animation, which have a lower resolution
    """

    def __init__(self, scene: DrawnScene, film: bool) -> None:
        import pyvista

        self.scene, self.half, self.texts, self.colours = scene, HALF_SYMBOL, [], None
        self._measure()
        self.sheet = PictureSheet(film, ruled=self.aspect.kind != "aslant")
        self.axes = axes = self.sheet.axes
        self._widen()
        low, high = self.box[::2], self.box[1::2]
        others = scene.shown([part.at for part in scene.parts]) * (1.0, 1.0, 0.0) + (
            0.0,
            0.0,
            low[2],
        )
        fit_limits(
            axes, self.aspect.on_sheet(np.vstack([box_corners(low, high), others])), BOX_MARGINS
        )
        unit, rises = scene.length.unit, scene.height.unit
        if self.aspect.kind == "aslant":
            axes.set_axis_off()
            self.texts = draw_box(
                axes, self.aspect, low, high, (f"x [{unit}]", f"y [{unit}]", f"z [{rises}]")
            )
        else:
            style.style_axes(axes)
            axes.ticklabel_format(axis="both", style="plain", useOffset=False)
            style.name_axes(
                axes, f"x [{unit}]", f"y [{unit}]" if self.aspect.kind == "plan" else f"z [{rises}]"
            )
        self.sheet.figure.canvas.draw()
        size = (round(axes.bbox.width), round(axes.bbox.height))
        self.plotter = pyvista.Plotter(off_screen=True, window_size=size)
        self.plotter.enable_anti_aliasing("ssaa")
        self.plotter.enable_parallel_projection()
        self._camera()
        self.image = axes.imshow(
            np.zeros((2, 2, 4)),
            extent=(*axes.get_xlim(), *axes.get_ylim()),
            aspect="auto",
            zorder=1,
            interpolation="antialiased",
        )
        draw_parts(self, scene, self._lines())
        self.sheet.bar(self.limits, scene.quantity.label)
        self.sheet.legend(scene.parts)

    def show(self, k: int) -> None:
        """Draw frame `k` of the scene."""
        caption, files = self.scene.frames[k]
        self.plotter.clear_actors()
        for file in files:
            self._add(read_frame(file, self.scene))
        self._walls()
        self.image.set_data(self.plotter.screenshot(transparent_background=True, return_img=True))
        rise = self.aspect.rise / self.scene.height_ratio
        notes = [] if abs(rise - 1.0) < 1e-9 else [f"heights drawn {rise:.3g} times"]
        self.sheet.caption(self.scene.title, "; ".join([caption, *notes]))

    def write_page(self, out: str) -> None:
        """Write the first frame as an HTML page without network, in which the scene can be turned (PyVista, trame)."""
        self.show(0)
        if self.colours is not None:
            self.plotter.add_scalar_bar(
                self.scene.quantity.label, color=style.INK, mapper=self.colours
            )
        self.plotter.set_background("white")
        self.plotter.disable_parallel_projection()
        self.plotter.reset_camera()
        with replacing(out) as fresh:
            self.plotter.export_html(str(fresh))

    def _measure(self) -> None:
        """Find the range of the field and the bounding box, and choose the projection."""
        self.limits, self.box, self.wet = field_extent(self.scene)
        x, y, z = (self.box[1::2] - self.box[::2]).tolist()
        if self.wet:
            slant, wide = self.scene.height_ratio, max(x, y)
            rise = (
                round_scale(DRAWN_SHARE * wide / (slant * z))
                if 0.0 < slant * z < LOW_SHARE * wide
                else 1.0
            )
            self.aspect = Projection("aslant", rise * slant, seen=WATER_VIEW)
        elif z <= FLAT_SHARE * max(x, y):
            self.aspect = Projection("plan")
        elif y <= FLAT_SHARE * max(x, z):
            self.aspect = Projection("profile")
        else:
            self.aspect = Projection("aslant", seen=WATER_VIEW)

    def _widen(self) -> None:
        """Widen the bounding box so that symbols of parts at the edges of basins fit."""
        for axis in (0, 1) if self.wet else ():
            at = self.scene.shown([part.at for part in self.scene.parts])[:, axis]
            low, high = self.box[2 * axis : 2 * axis + 2]
            margin = PART_MARGIN * float(np.ptp(self.box[:4].reshape(2, 2), axis=1).max())
            self.box[2 * axis] = min([low, *(x - margin for x in at if x <= low)])
            self.box[2 * axis + 1] = max([high, *(x + margin for x in at if x >= high)])

    def _camera(self) -> None:
        (left, right), (low, high) = self.axes.get_xlim(), self.axes.get_ylim()
        middle = 0.5 * (left + right) * self.aspect.right + 0.5 * (low + high) * self.aspect.up
        far = 2.0 * (right - left + high - low) + float(np.abs(self.box).max() * self.aspect.rise)
        camera = self.plotter.camera
        camera.focal_point, camera.up = middle, self.aspect.up
        camera.position = middle + far * self.aspect.back
        camera.parallel_scale = 0.5 * (high - low)
        camera.clipping_range = (0.1 * far, 2.5 * far)

    def _lines(self) -> np.ndarray:
        """Line segments of pipes and bodies of the first frame in picture coordinates : float64[c, 2, 2].

        Also sets `cover`, the points that names should not cover, `labels`, the names of bodies if there is only one
        frame, and the pipes of the scene, in output units.
        """
        self.cover, self.labels, segments = np.zeros((0, 2)), [], [np.zeros((0, 2, 2))]
        for file in self.scene.frames[0][1]:
            mesh = read_frame(file, self.scene)
            points = self.aspect.on_sheet(mesh.points)
            if 3 not in mesh.celltypes:
                self.cover = np.vstack(
                    [self.cover, self.aspect.on_sheet(mesh.cell_centers().points)]
                )
                continue
            lines = mesh.cells_dict[3]
            segments.append(points[lines])
            if "pipe" in mesh.cell_data:
                self.scene.pipes = [
                    (np.asarray(mesh.points), lines, np.zeros(0), np.asarray(mesh["pipe"]))
                ]
            elif len(self.scene.frames) == 1:  # bodies move
                self.labels = self._bodies(segments[-1], np.asarray(mesh["body"]))
        return np.concatenate(segments)

    def _bodies(self, lines: np.ndarray, line_body: np.ndarray) -> list[tuple[str, np.ndarray]]:
        """List of (name, midpoint of the longest line) of each body that is not a single point.

        lines : float64[c, 2, 2]  lines of bodies in picture coordinates
        line_body : int[c]  index of the body of each line
        """
        long, names = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1), []
        for k, name in enumerate(self.scene.bodies):
            own = np.flatnonzero(line_body == k)
            if len(own) and long[own].max() > 0.0:
                names.append((name, lines[own[long[own].argmax()]].mean(axis=0)))
        return names

    def _add(self, mesh: Any) -> None:
        field = self.scene.quantity.name
        if "depth" in mesh.cell_data:
            return self._basin(mesh)
        mesh.points[:, 2] *= self.aspect.rise
        if "body" in mesh.cell_data and (field != "speed" or self.wet):
            shape = tubes(mesh, self.box)
            if shape.n_points:  # bodies without extent have no points
                self.plotter.add_mesh(shape, color=BODY_COLOUR, ambient=AMBIENT_LIGHT)
        elif field in mesh.cell_data:
            plane = 3 not in mesh.celltypes
            self._coloured(
                mesh.cell_data_to_point_data() if plane else tubes(mesh, self.box), plane
            )
            if plane:
                rim = boundary_edges(mesh)
                self.plotter.add_mesh(rim, color=style.INK, line_width=2)

    def _basin(self, mesh: Any) -> None:
        """Draw the bed of a basin, its buildings and the water."""
        rise, field = self.aspect.rise, self.scene.quantity.name
        if field != "bed":
            least = WET_DEPTH * self.scene.height.factor
            surface = water_mesh(mesh, rise, (field,), least)
        block = raised_cells(mesh)
        top = self.box[5] + BUILDING_HEIGHT * (self.box[5] - self.box[4])
        mesh.points[:, 2] *= rise
        for wall in buildings(mesh, rise * top):
            self.plotter.add_mesh(wall, color=BUILDING_COLOUR, ambient=AMBIENT_LIGHT)
        if field == "bed":
            return self._coloured(mesh.cell_data_to_point_data(), True)
        bed = mesh.extract_cells(~block) if block.any() else mesh
        self.plotter.add_mesh(bed, color=BED_COLOUR, smooth_shading=False)
        if block.any():
            self.plotter.add_mesh(
                mesh.extract_cells(block), color=BUILDING_COLOUR, ambient=AMBIENT_LIGHT
            )
        if not surface.n_cells:
            return None
        sides = water_sides(surface, depth_direction(mesh) * (1.0, 1.0, rise))
        self.plotter.add_mesh(sides, color=SIDE_COLOUR, lighting=False)
        if field in surface.point_data:
            self._coloured(surface, True)
        else:
            self.plotter.add_mesh(surface, color=WATER, smooth_shading=True)
        return None

    def _walls(self) -> None:
        """Draw the walls of basins as lines along their crests."""
        import pyvista

        for wall in self.scene.walls:
            shape = pyvista.line_segments_from_points(
                self.scene.shown(wall) * (1.0, 1.0, self.aspect.rise)
            )
            for colour, width in (("white", 6), (style.INK, 2)):
                # the water beside the wall would hide parts of the lines, and the white line the other
                shape.points[:] += WALL_OFFSET * shape.length * self.aspect.back
                self.plotter.add_mesh(shape.copy(), color=colour, line_width=width, lighting=False)

    def _coloured(self, shape: Any, plane: bool) -> None:
        """Draw a shape in the colours of the field; plane : True for a surface, which then also has contour lines."""
        (low, high), field, count = self.limits, self.scene.quantity.name, self.scene.contours
        actor = self.plotter.add_mesh(
            shape,
            scalars=field,
            cmap=COLOUR_MAP,
            clim=self.limits,
            smooth_shading=True,
            show_scalar_bar=False,
            lighting=not plane or self.wet,
            ambient=0.0 if plane else AMBIENT_LIGHT,
        )
        self.colours = actor.mapper
        if plane and count and field in shape.point_data:
            levels = [low + (high - low) * (k + 1) / (count + 1) for k in range(count)]
            lines = shape.contour(levels, scalars=field)
            # the surface would hide parts of the lines
            lines.points[:] += LINE_OFFSET * shape.length * self.aspect.back
            if lines.n_points:
                self.plotter.add_mesh(lines, color="white", line_width=2)


TUBE_RADIUS = 0.008  # radius of a pipe as a fraction of the diagonal of the scene
# distance of the lines of walls towards the observer, over the extent of the wall
WALL_OFFSET = 0.01
WET_DEPTH = 1e-4  # least depth of water that is drawn [m]
WALL_SLOPE = 1.0  # least slope of the bed that counts as a wall
# relative reduction of a building, so that its walls do not coincide with those of the water
BUILDING_INSET = 1e-3


def field_extent(scene: DrawnScene) -> tuple[tuple[float, float], np.ndarray, bool]:
    """Extent of all frames : (colour range (low, high), bounding box float64[6], True if a frame has depths of water).

    The colour range covers the values of the field in all frames, in basins only in wet cells; see `colour_range`.
    It is (0, 1) if all cells are dry. The bounding box is in output units: least and greatest x, then y, then z.
    The process exits with a message if no frame has the field, since the function runs in a process of its own.
    """
    known = {}
    lows = []
    highs = []
    boxes = []
    wet = False
    field = scene.quantity.name
    for file in (file for _, files in scene.frames for file in files):
        mesh = read_frame(file, scene)
        known |= dict.fromkeys(name for name in mesh.cell_data if name not in ("pipe", "normal"))
        if field in mesh.cell_data:
            values = mesh[field]
            if "depth" in mesh.cell_data and field != "bed":
                # only wet cells are drawn
                values = values[mesh["depth"] > WET_DEPTH * scene.height.factor]
            lows.append(float(values.min(initial=math.inf)))
            highs.append(float(values.max(initial=-math.inf)))
        box = list(mesh.bounds)
        if "surface" in mesh.cell_data:  # water may stand above the mesh
            tops = (
                mesh["depth"] + mesh.points[:, 2].max()
                if "normal" in mesh.cell_data
                else mesh["surface"]
            )
            box[5] = max(box[5], float(tops.max()))
        boxes.append(box)
        wet |= "depth" in mesh.cell_data
    if not lows:
        sys.exit(
            f"unknown field {field!r}{did_you_mean(field, known)}; fields are {listing(known)}"
        )
    # all dry
    limits = colour_range(min(lows), max(highs)) if min(lows) <= max(highs) else (0.0, 1.0)
    return (
        limits,
        np.array([(min if k % 2 == 0 else max)(bounds[k] for bounds in boxes) for k in range(6)]),
        wet,
    )


def read_frame(file: str | Path, scene: DrawnScene) -> Any:
    """Read a frame, and convert its lengths and the drawn field to output units; a vector becomes its magnitude.

    If the quantity of the scene has no unit, its unit is set to that in the file.
    """
    import pyvista
    from vtkmodules.vtkCommonCore import vtkDataArray

    mesh, quantity = pyvista.read(file), scene.quantity
    if scene.over_run and "max_depth" in mesh.cell_data:  # NaN in cells that were never wet
        mesh.cell_data["depth"] = np.nan_to_num(mesh.cell_data["max_depth"])
        mesh.cell_data["surface"] = mesh.cell_data["bed"] + mesh.cell_data["depth"]
    if Path(file).suffix == ".pvtu":  # its pieces have duplicate points at common edges
        mesh = mesh.clean()
    if quantity.name in mesh.cell_data:
        values = np.asarray(mesh.cell_data[quantity.name])
        if not quantity.unit:  # the file stores the unit with the array
            information = mesh.GetCellData().GetArray(quantity.name).GetInformation()
            quantity.unit = information.Get(vtkDataArray.UNITS_LABEL()) or "-"
        size = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        mesh.cell_data[quantity.name] = quantity.factor * size + quantity.shift
    if scene.length.factor != 1.0 or scene.height.factor != 1.0:
        mesh.points = scene.shown(mesh.points)
        for name in {"depth", "surface"} & set(mesh.cell_data) - {quantity.name}:
            mesh.cell_data[name] = scene.height.factor * mesh.cell_data[name]
    return mesh


def tubes(mesh: Any, box) -> Any:
    """Tubes around the lines of a mesh, with a radius proportional to the diagonal of `box`.

    box : bounding box of the scene, as from `field_extent`
    """
    reach = math.dist(box[::2], box[1::2])
    return mesh.extract_surface(algorithm=None).tube(radius=TUBE_RADIUS * max(reach, 1e-9))


def water_mesh(mesh: Any, rise: float, fields: tuple[str, ...], least: float = WET_DEPTH) -> Any:
    """Mesh of the water surface of a basin, cut at the shore, with `height` above the bed at its points.

    Cells deeper than `least` are wet; heights and `least` are in the unit of the depths of `mesh`. The surface of wet
    cells is extrapolated over adjacent dry cells. If it lies above their bed, as at a front on level ground, the shore
    is drawn at the middle of the dry cells.
    fields : names of fields whose values at points are means over wet cells; rise : factor on heights
    """
    cells, wet = _cells(mesh), mesh.cell_data["depth"] > least
    up = depth_direction(mesh)
    bed = mesh.points @ up
    if "normal" in mesh.cell_data:  # levels of a basin on a body are in the axes of the body
        bed += np.mean(mesh.cell_data["bed"] - mesh.cell_centers().points @ up)
    at = _at_points(cells, wet, mesh.cell_data["surface"], mesh.n_points)
    known = np.isfinite(at)
    beyond = _extended(cells, ~wet, at, mesh.n_points)
    height = np.where(known, at, beyond) - bed
    height = np.where(known, height, -np.abs(height))
    height = np.where(np.isfinite(height), height, -1.0)
    surface = mesh.copy()
    surface.clear_data()
    surface.point_data["height"] = height
    for name in fields:
        if name in mesh.cell_data:
            values = _at_points(cells, wet, mesh.cell_data[name], mesh.n_points)
            surface.point_data[name] = np.nan_to_num(
                np.where(known, values, _extended(cells, ~wet, values, mesh.n_points))
            )
    lift = np.where(known, at, np.where(np.isfinite(beyond), beyond, bed)) - bed
    surface.points = (mesh.points + lift[:, None] * up) * (1.0, 1.0, rise)
    return surface.clip_scalar(scalars="height", value=0.0, invert=False)


def water_sides(surface: Any, up: np.ndarray) -> Any:
    """Mesh of the vertical sides of the water, from the rim of its surface down to the bed.

    up : float64[3]  direction of depth, with the factor on heights
    """
    import pyvista

    rim = boundary_edges(surface)
    low = rim.points - np.maximum(rim.point_data["height"], 0.0)[:, None] * up
    ends = rim.lines.reshape(-1, 3)[:, 1:]
    faces = np.column_stack([np.full(len(ends), 4), ends, ends[:, ::-1] + rim.n_points])
    return pyvista.PolyData(np.vstack([rim.points, low]), faces.ravel())


def depth_direction(mesh: Any) -> np.ndarray:
    """Direction of depth in a basin : float64[3], vertical, or normal to the bed of a basin on a body."""
    return (
        mesh.cell_data["normal"].mean(axis=0)
        if "normal" in mesh.cell_data
        else np.array([0.0, 0.0, 1.0])
    )


def buildings(mesh: Any, top: float) -> list[Any]:
    """Meshes of buildings: the holes within the outer boundary of a basin, from the bed up to `top`."""
    import pyvista

    meshes = []
    for loop in boundary_loops(mesh)[1:]:
        middle = loop.mean(axis=0)
        foot = middle + (1.0 - BUILDING_INSET) * (loop - middle)
        n = len(foot)
        head = np.column_stack([foot[:, :2], np.full(n, max(top, foot[:, 2].max()))])
        walls = [[4, k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
        meshes.append(pyvista.PolyData(np.vstack([foot, head]), np.hstack(walls)))
        meshes.append(pyvista.PolyData(head, [n, *range(n)]).triangulate())
    return meshes


def boundary_loops(mesh: Any) -> list[np.ndarray]:
    """Closed boundary lines of a basin, each float64[k, 3], largest first."""
    rim = boundary_edges(mesh)
    follow: dict[int, list[int]] = {}
    for a, b in rim.lines.reshape(-1, 3)[:, 1:]:
        follow.setdefault(int(a), []).append(int(b))
        follow.setdefault(int(b), []).append(int(a))
    result, unvisited = [], set(follow)
    while unvisited:
        walk = [unvisited.pop()]
        while candidates := [point for point in follow[walk[-1]] if point in unvisited]:
            walk.append(candidates[0])
            unvisited.discard(candidates[0])
        result.append(np.asarray(rim.points)[walk])
    return sorted(result, key=lambda line: -float(np.linalg.norm(np.ptp(line, axis=0))))


def raised_cells(mesh: Any) -> np.ndarray:
    """Mask of the cells of raised blocks of the bed, such as buildings : bool[n].

    These are cells steeper than WALL_SLOPE, and the higher cells that they enclose.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    cells, z = _cells(mesh), mesh.points[:, 2]
    low, high, size = (np.full(mesh.n_cells, np.nan) for _ in range(3))
    for rows, corners in cells:
        low[rows], high[rows] = z[corners].min(axis=1), z[corners].max(axis=1)
        size[rows] = np.linalg.norm(
            mesh.points[corners[:, 0], :2] - mesh.points[corners[:, 2], :2], axis=1
        )
    steep = high - low > WALL_SLOPE * size
    if not steep.any():
        return steep
    rows = np.concatenate([np.repeat(rows, corners.shape[1]) for rows, corners in cells])
    columns = np.concatenate([corners.ravel() for _, corners in cells])
    touch = coo_matrix((np.ones(len(rows)), (rows, columns)), (mesh.n_cells, mesh.n_points)).tocsr()
    flat = np.flatnonzero(~steep)
    adjacent = (touch[flat] @ touch[flat].T) >= 2  # cells that share a face
    _, piece = connected_components(adjacent, directed=False)
    main = np.bincount(piece).argmax()
    result = steep.copy()
    for k in set(piece) - {main}:
        inner = flat[piece == k]
        if low[inner].min() > low[steep].min() + 0.5 * (high[steep] - low[steep]).min():
            result[inner] = True
    return result


def _cells(mesh: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Cells of a mesh, by their shape : list of (indices int[k], points of the corners int[k, 3 or 4])."""
    return [
        (np.flatnonzero(mesh.celltypes == kind), corners)
        for kind, corners in mesh.cells_dict.items()
    ]


def _at_points(cells, chosen: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Mean of cell values over the chosen cells around each of n points, NaN for a point without such cells.

    cells : as from `_cells`; chosen : bool[cells]; values : float64[cells]
    """
    total, count = np.zeros(n), np.zeros(n)
    for rows, corners in cells:
        mask = chosen[rows]
        np.add.at(total, corners[mask], values[rows[mask], None])
        np.add.at(count, corners[mask], 1.0)
    return np.where(count > 0.0, total / np.where(count > 0.0, count, 1.0), np.nan)


def _extended(cells, chosen: np.ndarray, at: np.ndarray, n: int) -> np.ndarray:
    """Values extrapolated to n points : float64[n], NaN for a point without known values nearby.

    The value at a point is the mean over the chosen cells around it; the value of a cell is the mean of those values at
    its corners that are not NaN.
    cells : as from `_cells`; at : float64[n]  values at points, NaN if not known; chosen : bool[cells]
    """
    total, count = np.zeros(n), np.zeros(n)
    for rows, corners in cells:
        corners_chosen = corners[chosen[rows]]
        known = np.isfinite(at[corners_chosen])
        has = known.any(axis=1)
        mean = np.where(known, at[corners_chosen], 0.0)[has].sum(axis=1) / known[has].sum(axis=1)
        np.add.at(total, corners_chosen[has], mean[:, None])
        np.add.at(count, corners_chosen[has], 1.0)
    return np.where(count > 0.0, total / np.where(count > 0.0, count, 1.0), np.nan)


def boundary_edges(mesh: Any) -> Any:
    return mesh.extract_surface(algorithm=None).extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )


def main() -> None:
    """Read a pickled (scene, path) from standard input and write its picture, animation, or frames into a folder."""
    scene, out = pickle.load(sys.stdin.buffer)
    canvas = FieldCanvas(scene, len(scene.frames) > 1)
    if Path(out).suffix == ".html":
        return canvas.write_page(out)
    if Path(out).is_dir():
        return write_frames(canvas, len(scene.frames), Path(out))
    return write_animation(canvas, len(scene.frames), Path(out))


if __name__ == "__main__":
    main()
