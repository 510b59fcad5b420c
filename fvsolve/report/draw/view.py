"""Pictures and animations of a field, drawn off screen by matplotlib or PyVista."""

import pickle
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from fvsolve.compile.child_process import python_command, python_environment
from fvsolve.errors import FvsolveError
from fvsolve.report.draw.scene import DrawnScene

REMEDY = (
    "PyVista found no OpenGL library to draw without a screen; on Debian or Ubuntu "
    "run `apt install libegl1 libgl1-mesa-dri`, or `apt install libosmesa6`"
)
NO_PYVISTA = (
    "PyVista draws basins and bodies, and it cannot be imported ({}); install it: pip install pyvista. "
    "The run directory is complete without it; ParaView opens its fields.pvd"
)
ANIMATION_FORMATS = "a .gif needs no extra package; .mp4 needs imageio with ffmpeg: pip install imageio imageio-ffmpeg"


def view(scene: DrawnScene, out: Path) -> None:
    """Write a single frame as a picture or a page (.html), several as an animation (.gif or .mp4), to the file `out`.

    Matplotlib draws networks in this process. PyVista draws basins and bodies in a second process, because VTK ends its
    process without an OpenGL library.
    Raises FvsolveError for an unknown field, for an animation in a file that is not a .gif or .mp4, for an .mp4 without
    the packages that write it, without PyVista if it is needed, for a page of a network, and for a picture that cannot
    be drawn.
    """
    animated = len(scene.frames) > 1
    if animated and out.suffix not in (".gif", ".mp4"):
        raise FvsolveError(
            f"{out.name} is not an animation; expected a file name that ends in .gif or .mp4"
        )
    if out.suffix == ".html" and scene.pipes:
        raise FvsolveError(
            f"{out.name}: only basins and bodies are drawn as a page; expected .png, .svg or .pdf"
        )
    if out.suffix == ".mp4" and animated:
        try:
            import imageio  # noqa: F401
            import imageio_ffmpeg  # noqa: F401
        except ImportError:
            raise FvsolveError(
                f"an .mp4 cannot be written: a package is missing; {ANIMATION_FORMATS}"
            ) from None
    if scene.pipes:
        from fvsolve.report.draw.network_picture import NetworkPicture
        from fvsolve.report.draw.sheet import write_animation

        try:
            return write_animation(NetworkPicture(scene, animated), len(scene.frames), out)
        except (OSError, ValueError) as error:
            raise FvsolveError(f"{out} could not be drawn: {error}") from None
    return _draw_in_process(scene, out)


def frame_pictures(scene: DrawnScene) -> list[bytes]:
    """Pictures of all frames of a scene of basins or bodies, as the contents of .png files.

    Raises FvsolveError as `view` does.
    """
    with tempfile.TemporaryDirectory() as folder:
        _draw_in_process(scene, Path(folder))
        return [path.read_bytes() for path in sorted(Path(folder).glob("*.png"))]


def _draw_in_process(scene: DrawnScene, out: Path) -> None:
    environment = python_environment()
    if sys.platform.startswith("linux") and not environment.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    request = pickle.dumps((scene, str(out)))
    done = subprocess.run(
        python_command("-m", "fvsolve.report.draw.field_canvas"),
        env=environment,
        input=request,
        capture_output=True,
    )
    output = done.stderr.decode(errors="replace")
    if lost := re.search(r"No module named '(?:pyvista|vtk).*'", output):
        raise FvsolveError(NO_PYVISTA.format(lost[0]))
    if done.returncode < 0 or "OSMesa" in output or "EGL" in output:
        raise FvsolveError(REMEDY)
    if done.returncode:
        last = (output.strip().splitlines() or ["no message"])[-1]
        raise FvsolveError(
            last if last.startswith("unknown field") else f"{out} could not be drawn: {last}"
        )
