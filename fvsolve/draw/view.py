"""A field of frames as a picture or an animation, drawn off screen. Knows .vtu files and PyVista; knows no run."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from fvsolve.errors import FvsolveError, did_you_mean, listing, visible

SIZE, SMALL = (1500, 900), (1000, 600)  # of a picture, of an animation [pixels]
TUBE = 0.006  # radius of a pipe as part of the picture's diagonal
FLAT = 0.08  # a network lower than this part of its width is looked at from above
LOW = 0.05  # basins lower than this part of their width are drawn higher than they are,
HIGH = 0.12  # as high as this part
WET = 1e-4  # depth from which there is water to be seen [m]
OVER = 5e-4  # of its diagonal that lines are drawn above a surface
SHIFT = 0.12  # of half the height of the picture
FRAME = 100  # of an animation [ms]
LABELS = 4
EVEN = 1e-9  # a field whose values differ by less, of the greatest, is even
NONE = 1e-3  # an end of the colours nearer to zero, of their range, is zero: labels show no -0.00
SHOWN = {"Pa": ("bar", 1e-5)}  # units of the file that others are drawn for
INK, BED, WATER, DEEP = "#1f2933", "#c9b99a", "#8ab6d6", "#5b87a6"
ASLANT = (0.6, -1.0, 0.75)  # basins are looked at from there, x to the right and y away
REMEDY = (
    "PyVista found no OpenGL to draw with off screen; on Debian or Ubuntu "
    "`apt install libegl1 libgl1-mesa-dri`, or `apt install libosmesa6`"
)
FILMS = ".gif needs nothing more; .mp4 needs imageio with ffmpeg: pip install imageio imageio-ffmpeg"

Frames = list[tuple[str, list[Path]]]  # caption, .vtu files of one time


def view(frames: Frames, field: str, out: Path, contours: int = 0) -> None:
    """Write `out`: `field` on pipes and basins, water at its surface over the bed, vectors by their magnitude.

    One frame is a picture; several are an animation, .gif or .mp4. `contours` lines are drawn at even values between
    the least and the greatest. Drawn in a process of its own: without an OpenGL library VTK ends the process it is in.
    FvsolveError where the field is unknown or nothing can be drawn.
    """
    if len(frames) > 1 and out.suffix not in (".gif", ".mp4"):
        raise FvsolveError(f"{out.name} is no animation; wanted a name that ends in .gif or .mp4")
    if out.suffix == ".mp4" and len(frames) > 1:
        _need_imageio()
    package = str(Path(__file__).resolve().parents[2])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([package, *sys.path])}
    if sys.platform.startswith("linux") and not environment.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    asked = {"frames": frames, "field": field, "out": str(out), "contours": contours}
    done = subprocess.run(
        [sys.executable, "-m", __spec__.name], env=environment, input=json.dumps(asked, default=str),
        capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode < 0 or "OSMesa" in done.stderr or "EGL" in done.stderr:
        raise FvsolveError(REMEDY)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise FvsolveError(last if last.startswith("no field") else f"{out} could not be drawn: {last}")


def _need_imageio() -> None:
    try:
        import imageio  # noqa: F401
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise FvsolveError(f"no .mp4 can be written here; {FILMS}") from None


def draw(frames: Frames, field: str, out: str, contours: int) -> None:
    """Draw in this process."""
    import pyvista

    canvas = Canvas(frames, field, contours)
    film = len(frames) > 1
    plotter = pyvista.Plotter(off_screen=True, window_size=SMALL if film else SIZE)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    plotter.enable_parallel_projection()
    if not film:
        canvas.show(plotter, *frames[0])
        plotter.screenshot(out)
    elif out.endswith(".mp4"):
        plotter.open_movie(out, framerate=1000 // FRAME)
        for frame in frames:
            canvas.show(plotter, *frame)
            plotter.write_frame()
        plotter.close()
    else:
        from PIL import Image

        pictures = []
        for frame in frames:
            canvas.show(plotter, *frame)
            pictures.append(Image.fromarray(plotter.screenshot(return_img=True)).quantize(255))
        pictures[0].save(out, save_all=True, append_images=pictures[1:], duration=FRAME, loop=0)


class Canvas:
    """What frames have in common: the range of their field, its unit, how far they reach and how they are seen."""

    def __init__(self, frames: Frames, field: str, contours: int) -> None:
        self.field, self.contours, self.seen = field, contours, False
        self.unit, known, lows, highs, boxes = "", {}, [], [], []
        for _, files in frames:
            for file in files:
                mesh = read(file, field)
                known |= dict.fromkeys(name for name in mesh.cell_data if name != "pipe")
                if field in mesh.cell_data:
                    self.unit, values = unit_of(mesh, field), mesh[field]
                    if "depth" in mesh.cell_data and field != "bed":
                        values = values[mesh["depth"] > WET]  # which are all that is drawn
                    lows.append(float(values.min(initial=math.inf)))
                    highs.append(float(values.max(initial=-math.inf)))
                boxes.append(box(mesh))
        if not lows:
            sys.exit(f"no field {field!r}{did_you_mean(field, known)}; fields are {listing(known)}")
        self.limits = span(min(lows), max(highs)) if min(lows) <= max(highs) else (0.0, 1.0)  # all dry
        self.box = [(min if k % 2 == 0 else max)(one[k] for one in boxes) for k in range(6)]
        self.water = any("depth" in read(file, field).cell_data for file in frames[0][1])
        wide, tall = max(self.box[1] - self.box[0], self.box[3] - self.box[2]), self.box[5] - self.box[4]
        self.rise = HIGH * wide / tall if self.water and 0.0 < tall < LOW * wide else 1.0

    def show(self, plotter: Any, caption: str, files: list) -> None:
        """Put a frame on the stage."""
        plotter.clear_actors()
        plotter.scalar_bars.clear()
        for file in files:
            mesh = read(file, self.field)
            if "depth" in mesh.cell_data:
                self.basin(plotter, mesh)
            elif "body" in mesh.cell_data and (self.field != "speed" or self.water):
                shape = limbs(mesh, self.box)
                if shape.n_points:  # there are bodies without extent
                    plotter.add_mesh(shape, color=INK)
            elif self.field in mesh.cell_data:
                plane = not are_pipes(mesh)
                mesh.points[:, 2] *= self.rise
                self.coloured(plotter, mesh.cell_data_to_point_data() if plane else tube(mesh), plane)
        if self.rise != 1.0:
            caption += f"; heights drawn {self.rise:.3g} times"
        plotter.add_text(unmarked(caption), font_size=12, color=INK, position="upper_left")
        if not self.seen:  # a camera that is set twice forgets its zoom
            _look(plotter, [*self.box[:4], self.rise * self.box[4], self.rise * self.box[5]], self.water)
            self.seen = True

    def basin(self, plotter: Any, mesh: Any) -> None:
        """The bed of a basin and the water over it."""
        mesh.points[:, 2] *= self.rise
        if self.field == "bed":
            return self.coloured(plotter, mesh.cell_data_to_point_data(), True)
        plotter.add_mesh(mesh, color=BED)
        water = raised(mesh, self.rise)
        if water.n_cells:
            plotter.add_mesh(sides(water, self.rise), color=DEEP, lighting=False)
        if water.n_cells and self.field in mesh.cell_data:
            self.coloured(plotter, water, True)
        elif water.n_cells:
            plotter.add_mesh(water, color=WATER, smooth_shading=True)

    def coloured(self, plotter: Any, shape: Any, plane: bool) -> None:
        """A shape in the colours of its field, with lines of equal values where it is plane."""
        low, high = self.limits
        title = unmarked(f"{self.field.replace('_', ' ')} [{self.unit}]")
        plotter.add_mesh(
            shape, scalars=self.field, cmap="viridis", clim=self.limits, smooth_shading=True,
            scalar_bar_args={"title": title, "fmt": digits(low, high), **BAR},
        )  # fmt: skip
        if plane and self.contours and self.field in shape.point_data:
            levels = [low + (high - low) * (k + 1) / (self.contours + 1) for k in range(self.contours)]
            lines = shape.contour(levels, scalars=self.field)
            lines.points[:, 2] += OVER * shape.length  # or they sink into it here and there
            if lines.n_points:
                plotter.add_mesh(lines, color="white", line_width=2)


BAR = {
    "color": INK, "n_labels": LABELS,  # none below the title
    "title_font_size": 22, "label_font_size": 18, "width": 0.5, "height": 0.09, "position_x": 0.25, "position_y": 0.03,
}  # fmt: skip


def unmarked(text: str) -> str:
    """Text that VTK draws as it stands: `$` begins no formula."""
    return visible(text).replace("$", "\\$")


def read(file: str | Path, field: str) -> Any:
    """A frame's file; vectors of the field by their magnitude, pressures in bar."""
    import numpy as np
    import pyvista

    mesh = pyvista.read(file)
    if Path(file).suffix == ".pvtu":  # whose pieces have points of their own where they meet
        mesh = mesh.clean()
    if field in mesh.cell_data:
        values, unit = mesh.cell_data[field], unit_of(mesh, field)
        unit, scale = SHOWN.get(unit, (unit, 1.0))
        mesh.cell_data[field] = scale * (np.linalg.norm(values, axis=1) if values.ndim == 2 else values)
        mesh.GetCellData().GetArray(field).GetInformation().Set(_key(), unit)
    return mesh


def unit_of(mesh: Any, field: str) -> str:
    """The unit that an array carries."""
    return mesh.GetCellData().GetArray(field).GetInformation().Get(_key()) or "-"


def _key() -> Any:
    from vtkmodules.vtkCommonCore import vtkDataArray

    return vtkDataArray.UNITS_LABEL()


def span(low: float, high: float) -> tuple[float, float]:
    """Ends of the colours of a field: its own, or some way about an even one."""
    most = max(abs(low), abs(high))
    if high - low > EVEN * most:
        return tuple(0.0 if abs(end) < NONE * (high - low) else end for end in (low, high))
    middle, half = 0.5 * (low + high), 0.05 * most or 0.5
    return middle - half, middle + half


def digits(low: float, high: float) -> str:
    """A format in which the labels between two values differ: two digits of the step between them are shown."""
    most, step = max(abs(low), abs(high)), (high - low) / (LABELS - 1)
    if 1e-3 <= most < 1e7:
        return f"%.{max(0, 1 - math.floor(math.log10(step)))}f"
    return f"%.{max(1, 1 + math.floor(math.log10(most / step)))}e"


def are_pipes(mesh: Any) -> bool:
    """Whether its cells are lines."""
    return 3 in mesh.celltypes  # VTK's number of a line


def box(mesh: Any) -> list[float]:
    """How far a frame reaches, water included: x, y, z, least and greatest of each."""
    if are_pipes(mesh) and "body" not in mesh.cell_data:
        lower(mesh.points)
    found = list(mesh.bounds)
    if "surface" in mesh.cell_data:
        found[5] = max(found[5], float((mesh["depth"] + mesh.points[:, 2].max() if "normal" in mesh.cell_data
                                        else mesh["surface"]).max()))  # fmt: skip
    return found


def tube(mesh: Any) -> Any:
    """Pipes as tubes, or bodies."""
    if "body" not in mesh.cell_data:
        lower(mesh.points)
    return mesh.extract_surface(algorithm=None).tube(radius=TUBE * max(mesh.length, 1e-9))


def limbs(mesh: Any, box: list[float]) -> Any:
    """Bodies and what pushes between them as tubes."""
    reach = math.dist(box[::2], box[1::2])
    return mesh.extract_surface(algorithm=None).tube(radius=TUBE * max(reach, 1e-9))


def raised(mesh: Any, rise: float) -> Any:
    """The wet cells of a basin at the surface of their water."""
    wet = mesh.threshold(WET, scalars="depth", preference="cell")
    if wet.n_cells:  # of these alone: the bed of a dry bank is no surface
        wet = wet.cell_data_to_point_data(pass_cell_data=True)
        if "normal" in wet.point_data:  # it rides on a body
            wet.points += wet.point_data["depth"][:, None] * wet.point_data["normal"]
        else:
            wet.points[:, 2] = rise * wet.point_data["surface"]
    return wet


def sides(water: Any, rise: float) -> Any:
    """What upright walls see of water: from its rim down to the bed."""
    import numpy as np
    import pyvista

    rim = water.extract_surface(algorithm=None).extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )  # fmt: skip
    low = rim.points.copy()
    if "normal" in rim.point_data:
        low -= rim.point_data["depth"][:, None] * rim.point_data["normal"]
    else:
        low[:, 2] = rise * rim.point_data["bed"]
    ends = rim.lines.reshape(-1, 3)[:, 1:]
    faces = np.column_stack([np.full(len(ends), 4), ends, ends[:, ::-1] + rim.n_points])
    return pyvista.PolyData(np.vstack([rim.points, low]), faces.ravel())


def _look(plotter: Any, bounds: list[float], aslant: bool = False) -> None:
    """From above where the network is flat, from the side where it is one straight line, else aslant."""
    x, y, z = bounds[1] - bounds[0], bounds[3] - bounds[2], bounds[5] - bounds[4]
    if aslant:
        plotter.view_vector(ASLANT, viewup=(0.0, 0.0, 1.0))
    elif z <= FLAT * max(x, y):
        plotter.view_xy()
    elif y <= FLAT * max(x, z):
        plotter.view_xz()
    else:
        plotter.view_isometric()
    plotter.reset_camera(bounds=bounds)
    plotter.camera.zoom(1.35 if aslant else 1.1)
    lift(plotter.camera)


def lower(points: Any) -> None:
    """Press a network that is taller than wide flat, to be looked at from above: its plan has not the scale of heights.

    points : float[n, 3], changed; a network in one upright plane stays as it is
    """
    x, y, z = points.max(axis=0) - points.min(axis=0)
    if z > max(x, y) and min(x, y) > FLAT * z:
        points[:, 2] *= 0.5 * FLAT * max(x, y) / z


def lift(camera: Any) -> None:
    """Raise what is seen above the bar of colours."""
    up = [SHIFT * camera.parallel_scale * part for part in camera.up]
    camera.position = [a - b for a, b in zip(camera.position, up, strict=True)]
    camera.focal_point = [a - b for a, b in zip(camera.focal_point, up, strict=True)]


if __name__ == "__main__":
    draw(**json.load(sys.stdin))
