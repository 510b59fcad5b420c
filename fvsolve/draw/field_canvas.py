"""Pictures of basins and bodies from .vtu files, with surfaces drawn by PyVista."""

import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.draw import frame_meshes, style
from fvsolve.draw.network_picture import draw_parts
from fvsolve.draw.scene import WATER_VIEW, DrawnScene, Projection, box_corners, draw_box, fit_limits, round_scale
from fvsolve.draw.sheet import COLOUR_MAP, HALF_SYMBOL, WATER, PictureSheet, write_animation

FLAT_SHARE = 0.08  # height over width below which bodies are drawn in plan, or depth over width for a profile
LOW_SHARE = 0.05  # height over width below which basins are drawn with enlarged heights
DRAWN_SHARE = 0.12  # drawn height over width of such basins
LINE_OFFSET = 2e-3  # distance of contour lines above a surface, as a fraction of its diagonal
PART_MARGIN = 0.04  # margin for parts around a basin, as a fraction of its size
BUILDING_HEIGHT = 0.25  # height of buildings above the scene, as a fraction of the height of the scene
BED_COLOUR, SIDE_COLOUR, BUILDING_COLOUR, BODY_COLOUR = "#c9b99a", "#5b87a6", "#a8705a", "#4b5563"
AMBIENT_LIGHT = 0.35  # ambient light
BOX_MARGINS = (62.0, 44.0, 50.0, 14.0)  # margins of a box: left, low, right, high [points]


class FieldCanvas:
    """Picture of basins and bodies. All frames have the same colour range, bounding box and projection.

    film : True for frames of an animation, which have a lower resolution
    """

    def __init__(self, scene: DrawnScene, film: bool) -> None:
        import pyvista

        self.scene, self.half, self.texts = scene, HALF_SYMBOL, []
        self._measure()
        self.sheet = PictureSheet(film, ruled=self.aspect.kind != "aslant")
        self.axes = axes = self.sheet.axes
        self._widen()
        low, high = self.box[::2], self.box[1::2]
        others = scene.shown([part.at for part in scene.parts]) * (1.0, 1.0, 0.0) + (0.0, 0.0, low[2])
        fit_limits(axes, self.aspect.on_sheet(np.vstack([box_corners(low, high), others])), BOX_MARGINS)
        unit, rises = scene.length.unit, scene.height.unit
        if self.aspect.kind == "aslant":
            axes.set_axis_off()
            self.texts = draw_box(axes, self.aspect, low, high, (f"x [{unit}]", f"y [{unit}]", f"z [{rises}]"))
        else:
            style.style_axes(axes)
            axes.ticklabel_format(axis="both", style="plain", useOffset=False)
            style.name_axes(axes, f"x [{unit}]", f"y [{unit}]" if self.aspect.kind == "plan" else f"z [{rises}]")
        self.sheet.figure.canvas.draw()
        size = (round(axes.bbox.width), round(axes.bbox.height))
        self.plotter = pyvista.Plotter(off_screen=True, window_size=size)
        self.plotter.enable_anti_aliasing("ssaa")
        self.plotter.enable_parallel_projection()
        self._camera()
        self.image = axes.imshow(np.zeros((2, 2, 4)), extent=(*axes.get_xlim(), *axes.get_ylim()), aspect="auto",
                                 zorder=1, interpolation="antialiased")  # fmt: skip
        draw_parts(self, scene, self._lines())
        self.sheet.bar(self.limits, scene.quantity.label)
        self.sheet.legend(scene.parts)

    def show(self, k: int) -> None:
        """Draw frame `k` of the scene."""
        caption, files = self.scene.frames[k]
        self.plotter.clear_actors()
        for file in files:
            self._add(frame_meshes.read_frame(file, self.scene))
        self.image.set_data(self.plotter.screenshot(transparent_background=True, return_img=True))
        rise = self.aspect.rise / self.scene.height_ratio
        notes = [] if abs(rise - 1.0) < 1e-9 else [f"heights drawn {rise:.3g} times"]
        self.sheet.caption(self.scene.title, "; ".join([caption, *notes]))

    def _measure(self) -> None:
        """Find the range of the field and the bounding box, and choose the projection."""
        self.limits, self.box, self.wet = frame_meshes.field_extent(self.scene)
        x, y, z = (self.box[1::2] - self.box[::2]).tolist()
        if self.wet:
            slant, wide = self.scene.height_ratio, max(x, y)
            rise = round_scale(DRAWN_SHARE * wide / (slant * z)) if 0.0 < slant * z < LOW_SHARE * wide else 1.0
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
            mesh = frame_meshes.read_frame(file, self.scene)
            points = self.aspect.on_sheet(mesh.points)
            if 3 not in mesh.celltypes:
                self.cover = np.vstack([self.cover, self.aspect.on_sheet(mesh.cell_centers().points)])
                continue
            lines = mesh.cells_dict[3]
            segments.append(points[lines])
            if "pipe" in mesh.cell_data:
                self.scene.pipes = [(np.asarray(mesh.points), lines, np.zeros(0), np.asarray(mesh["pipe"]))]
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
            shape = frame_meshes.tubes(mesh, self.box)
            if shape.n_points:  # bodies without extent have no points
                self.plotter.add_mesh(shape, color=BODY_COLOUR, ambient=AMBIENT_LIGHT)
        elif field in mesh.cell_data:
            plane = 3 not in mesh.celltypes
            self._coloured(mesh.cell_data_to_point_data() if plane else frame_meshes.tubes(mesh, self.box), plane)
            if plane:
                rim = frame_meshes.boundary_edges(mesh)
                self.plotter.add_mesh(rim, color=style.INK, line_width=2)

    def _basin(self, mesh: Any) -> None:
        """Draw the bed of a basin, its buildings and the water."""
        rise, field = self.aspect.rise, self.scene.quantity.name
        if field != "bed":
            least = frame_meshes.WET_DEPTH * self.scene.height.factor
            surface = frame_meshes.water_mesh(mesh, rise, (field,), least)
        block = frame_meshes.raised_cells(mesh)
        top = self.box[5] + BUILDING_HEIGHT * (self.box[5] - self.box[4])
        mesh.points[:, 2] *= rise
        for wall in frame_meshes.buildings(mesh, rise * top):
            self.plotter.add_mesh(wall, color=BUILDING_COLOUR, ambient=AMBIENT_LIGHT)
        if field == "bed":
            return self._coloured(mesh.cell_data_to_point_data(), True)
        bed = mesh.extract_cells(~block) if block.any() else mesh
        self.plotter.add_mesh(bed, color=BED_COLOUR, smooth_shading=False)
        if block.any():
            self.plotter.add_mesh(mesh.extract_cells(block), color=BUILDING_COLOUR, ambient=AMBIENT_LIGHT)
        if not surface.n_cells:
            return None
        sides = frame_meshes.water_sides(surface, frame_meshes.depth_direction(mesh) * (1.0, 1.0, rise))
        self.plotter.add_mesh(sides, color=SIDE_COLOUR, lighting=False)
        if field in surface.point_data:
            self._coloured(surface, True)
        else:
            self.plotter.add_mesh(surface, color=WATER, smooth_shading=True)
        return None

    def _coloured(self, shape: Any, plane: bool) -> None:
        """Draw a shape in the colours of the field; plane : True for a surface, which then also has contour lines."""
        (low, high), field, count = self.limits, self.scene.quantity.name, self.scene.contours
        self.plotter.add_mesh(shape, scalars=field, cmap=COLOUR_MAP, clim=self.limits, smooth_shading=True,
                              show_scalar_bar=False, lighting=not plane or self.wet,
                              ambient=0.0 if plane else AMBIENT_LIGHT)  # fmt: skip
        if plane and count and field in shape.point_data:
            levels = [low + (high - low) * (k + 1) / (count + 1) for k in range(count)]
            lines = shape.contour(levels, scalars=field)
            lines.points[:] += (
                LINE_OFFSET * shape.length * self.aspect.back
            )  # the surface would hide parts of the lines
            if lines.n_points:
                self.plotter.add_mesh(lines, color="white", line_width=2)


def main() -> None:
    """Read a pickled (scene, path) from standard input and write its picture or animation."""
    scene, out = pickle.load(sys.stdin.buffer)
    write_animation(FieldCanvas(scene, len(scene.frames) > 1), len(scene.frames), Path(out))


if __name__ == "__main__":
    main()
