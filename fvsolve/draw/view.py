"""A field of one frame as a picture, drawn off screen. Knows .vtu files and PyVista; knows no run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from fvsolve.errors import FvsolveError, did_you_mean, listing

SIZE = (1500, 900)  # of the picture [pixels]
UNITS = {"pressure": "Pa", "head": "m", "velocity": "m/s", "flow": "m3/s"}
UNITS |= {"least_pressure": "Pa", "greatest_pressure": "Pa", "depth": "m", "surface": "m", "bed": "m"}
TUBE = 0.006  # radius of a pipe as part of the picture's diagonal
FLAT = 0.08  # a network lower than this part of its width is looked at from above
WET = 1e-4  # depth from which there is water to be seen [m]
SHIFT = 0.12  # of half the height of the picture
REMEDY = (
    "PyVista found no OpenGL to draw with off screen; on Debian or Ubuntu "
    "`apt install libegl1 libgl1-mesa-dri`, or `apt install libosmesa6`"
)


def view(frames: list[Path], field: str, out: Path, caption: str, scalars: dict[str, str] | None = None) -> None:
    """Write the picture `out` of `field` on the pipes and basins of .vtu files, water at its surface over the bed.

    scalars : unit of each field beside those that every run has. Drawn in a process of its own: without an OpenGL
    library VTK ends the process it is in. FvsolveError where the field is unknown or nothing can be drawn.
    """
    units = UNITS | (scalars or {})
    if field not in units:
        raise FvsolveError(f"no field {field!r}{did_you_mean(field, units)}; fields are {listing(units)}")
    package = str(Path(__file__).resolve().parents[2])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([package, *sys.path])}
    if sys.platform.startswith("linux") and not environment.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    command = [
        sys.executable,
        "-m",
        __spec__.name,
        os.pathsep.join(map(str, frames)),
        field,
        str(out),
        caption,
        units[field],
    ]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode < 0 or "OSMesa" in done.stderr or "EGL" in done.stderr:
        raise FvsolveError(REMEDY)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise FvsolveError(f"{out} could not be drawn: {last}")


def draw(frames: str, field: str, out: str, caption: str, unit: str) -> None:
    """Draw in this process."""
    import pyvista

    meshes = [pyvista.read(frame) for frame in frames.split(os.pathsep)]
    pools = [mesh for mesh in meshes if "depth" in mesh.cell_data]
    meshes = [mesh for mesh in meshes if field in mesh.cell_data]
    if not meshes:
        sys.exit(f"nothing here has a {field}")
    plotter = pyvista.Plotter(off_screen=True, window_size=SIZE)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    plotter.enable_parallel_projection()
    least = min(mesh[field].min() for mesh in meshes)
    greatest = max(mesh[field].max() for mesh in meshes)
    for pool in pools:
        plotter.add_mesh(pool.copy(), color="#c9b99a")
    for mesh in meshes:
        shape = raised(mesh) if "depth" in mesh.cell_data else tube(mesh)
        plotter.add_mesh(
            shape, scalars=field, cmap="viridis", clim=[least, greatest], smooth_shading=True,
            scalar_bar_args={"title": f"{field.replace('_', ' ')} [{unit}]", **BAR},
        )  # fmt: skip
    plotter.add_text(caption, font_size=12, color="#1f2933", position="upper_left")
    _look(plotter, plotter.bounds, bool(pools))
    plotter.screenshot(out)


BAR = {
    "color": "#1f2933",
    "fmt": "%.4g",
    "n_labels": 4,  # none below the title
    "title_font_size": 22,
    "label_font_size": 18,
    "width": 0.5,
    "height": 0.09,
    "position_x": 0.25,
    "position_y": 0.03,
}


def tube(mesh):
    """Pipes as tubes."""
    lower(mesh.points)
    return mesh.extract_surface(algorithm=None).tube(radius=TUBE * max(mesh.length, 1e-9))


def raised(mesh):
    """The wet cells of a basin at the surface of their water."""
    found = mesh.cell_data_to_point_data(pass_cell_data=True)
    found.points[:, 2] = found.point_data["surface"]
    return found.threshold(WET, scalars="depth", preference="cell")


def _look(plotter, bounds, aslant: bool = False) -> None:
    """From above where the network is flat, from the side where it is one straight line, else aslant."""
    x, y, z = bounds[1] - bounds[0], bounds[3] - bounds[2], bounds[5] - bounds[4]
    if aslant:
        plotter.view_isometric()
    elif z <= FLAT * max(x, y):
        plotter.view_xy()
    elif y <= FLAT * max(x, z):
        plotter.view_xz()
    else:
        plotter.view_isometric()
    plotter.camera.zoom(1.1)
    lift(plotter.camera)


def lower(points) -> None:
    """Press a network that is taller than wide flat, to be looked at from above: its plan has not the scale of heights.

    points : float[n, 3], changed; a network in one upright plane stays as it is
    """
    x, y, z = points.max(axis=0) - points.min(axis=0)
    if z > max(x, y) and min(x, y) > FLAT * z:
        points[:, 2] *= 0.5 * FLAT * max(x, y) / z


def lift(camera) -> None:
    """Raise what is seen above the bar of colours."""
    up = [SHIFT * camera.parallel_scale * part for part in camera.up]
    camera.position = [a - b for a, b in zip(camera.position, up, strict=True)]
    camera.focal_point = [a - b for a, b in zip(camera.focal_point, up, strict=True)]


if __name__ == "__main__":
    draw(*sys.argv[1:])
