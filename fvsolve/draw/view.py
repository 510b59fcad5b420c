"""A field of frames as a picture or an animation, drawn off screen. Knows who draws what; draws nothing itself."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

from fvsolve.draw.scene import DrawnScene
from fvsolve.errors import FvsolveError

REMEDY = (
    "PyVista found no OpenGL to draw with off screen; on Debian or Ubuntu "
    "`apt install libegl1 libgl1-mesa-dri`, or `apt install libosmesa6`"
)
FILMS = ".gif needs nothing more; .mp4 needs imageio with ffmpeg: pip install imageio imageio-ffmpeg"


def view(scene: DrawnScene, out: Path) -> None:
    """Write `out`: one frame as a picture, several as an animation, .gif or .mp4.

    Networks are drawn here by matplotlib. Basins and bodies are drawn by PyVista in a process of its own: without an
    OpenGL library VTK ends the process it is in. FvsolveError where the field is unknown or nothing can be drawn.
    """
    film = len(scene.frames) > 1
    if film and out.suffix not in (".gif", ".mp4"):
        raise FvsolveError(f"{out.name} is no animation; wanted a name that ends in .gif or .mp4")
    if out.suffix == ".mp4" and film:
        _need_imageio()
    if scene.pipes:
        from fvsolve.draw.film import write
        from fvsolve.draw.network import Network

        try:
            return write(Network(scene, film), len(scene.frames), out)
        except (OSError, ValueError) as error:
            raise FvsolveError(f"{out} could not be drawn: {error}") from None
    return _beside(scene, out)


def _beside(scene: DrawnScene, out: Path) -> None:
    package = str(Path(__file__).resolve().parents[2])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([package, *sys.path])}
    if sys.platform.startswith("linux") and not environment.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    asked = pickle.dumps((scene, str(out)))
    done = subprocess.run([sys.executable, "-m", "fvsolve.draw.stage"], env=environment, input=asked,
                          capture_output=True)  # fmt: skip
    said = done.stderr.decode(errors="replace")
    if done.returncode < 0 or "OSMesa" in said or "EGL" in said:
        raise FvsolveError(REMEDY)
    if done.returncode:
        last = (said.strip().splitlines() or ["no message"])[-1]
        raise FvsolveError(last if last.startswith("no field") else f"{out} could not be drawn: {last}")


def _need_imageio() -> None:
    try:
        import imageio  # noqa: F401
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise FvsolveError(f"no .mp4 can be written here; {FILMS}") from None
