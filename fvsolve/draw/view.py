"""Pictures and animations of a field: the scene that they show, drawn off screen by matplotlib or PyVista."""

import os
import pickle
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fvsolve.errors import FvsolveError

REMEDY = (
    "PyVista found no OpenGL library to draw without a screen; on Debian or Ubuntu "
    "run `apt install libegl1 libgl1-mesa-dri`, or `apt install libosmesa6`"
)
ANIMATION_FORMATS = "a .gif needs no extra package; .mp4 needs imageio with ffmpeg: pip install imageio imageio-ffmpeg"


@dataclass
class DrawnPart:
    """Part of a network and its position.

    key : "nodes.NAME" or "links.NAME"
    kinds : kind of the part and the kinds from which it is derived, nearest first
    at : position [m]; between : keys of the parts that a link connects
    link : True for a link, False for a node
    joint : True for a plain junction; held : True if pipes or a stated position fix its position
    own_place : True for a link that is not drawn at the middle of its ends
    """

    key: str
    name: str
    kinds: tuple[str, ...]
    at: tuple[float, float, float]
    between: tuple[str, ...] = ()
    link: bool = False
    joint: bool = False
    held: bool = False
    own_place: bool = False


@dataclass
class DrawnUnit:
    """Quantity and its output unit: shown value = factor * SI value + shift."""

    name: str
    unit: str
    factor: float = 1.0
    shift: float = 0.0

    @property
    def label(self) -> str:
        return f"{self.name.replace('_', ' ')} [{self.unit}]"


@dataclass
class DrawnScene:
    """Frames of a field with the parts, names and units of the picture.

    quantity, length, height : units of the field, of lengths and of heights
    frames : (caption, files) of each time
    pipes : for networks, (points float64[p, 3] [m], lines int[c, 2], values float64[c] in SI, pipe int[c]) of each time
    plan : source of plan positions: "given", "laid out" (by lengths), "own scale" or "schematic" (both not to scale)
    contours : number of contour lines
    """

    title: str
    quantity: DrawnUnit
    length: DrawnUnit
    height: DrawnUnit
    frames: list[tuple[str, list[Path]]]
    pipes: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # names of pipes
    bodies: list[str] = field(default_factory=list)  # names of bodies by index
    parts: list[DrawnPart] = field(default_factory=list)
    anchors: dict[str, tuple[float, float, float]] = field(default_factory=dict)  # positions of linked patches [m]
    plan: str = "given"
    contours: int = 0

    def shown(self, points) -> np.ndarray:
        """Convert points float64[n, 3] [m] to the output units of lengths and heights."""
        plan = self.length.factor
        return np.asarray(points, float).reshape(-1, 3) * (plan, plan, self.height.factor)

    @property
    def height_ratio(self) -> float:
        """Factor on heights in their output unit that gives equal scales of heights and lengths."""
        return self.length.factor / self.height.factor


def view(scene: DrawnScene, out: Path) -> None:
    """Write a single frame as a picture, several as an animation (.gif or .mp4), to the file `out`.

    Matplotlib draws networks in this process. PyVista draws basins and bodies in a second process, because VTK ends its
    process without an OpenGL library.
    Raises FvsolveError for an unknown field, for an animation in a file that is not a .gif or .mp4, for an .mp4 without
    the packages that write it, and for a picture that cannot be drawn.
    """
    animated = len(scene.frames) > 1
    if animated and out.suffix not in (".gif", ".mp4"):
        raise FvsolveError(f"{out.name} is not an animation. Expected a file name that ends in .gif or .mp4")
    if out.suffix == ".mp4" and animated:
        _need_imageio()
    if scene.pipes:
        from fvsolve.draw.network_picture import NetworkPicture
        from fvsolve.draw.sheet import write_animation

        try:
            return write_animation(NetworkPicture(scene, animated), len(scene.frames), out)
        except (OSError, ValueError) as error:
            raise FvsolveError(f"{out} could not be drawn: {error}") from None
    return _draw_in_process(scene, out)


def _draw_in_process(scene: DrawnScene, out: Path) -> None:
    package = str(Path(__file__).resolve().parents[2])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([package, *sys.path])}
    if sys.platform.startswith("linux") and not environment.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    request = pickle.dumps((scene, str(out)))
    done = subprocess.run([sys.executable, "-m", "fvsolve.draw.field_canvas"], env=environment, input=request,
                          capture_output=True)  # fmt: skip
    output = done.stderr.decode(errors="replace")
    if done.returncode < 0 or "OSMesa" in output or "EGL" in output:
        raise FvsolveError(REMEDY)
    if done.returncode:
        last = (output.strip().splitlines() or ["no message"])[-1]
        raise FvsolveError(last if last.startswith("unknown field") else f"{out} could not be drawn: {last}")


def _need_imageio() -> None:
    try:
        import imageio  # noqa: F401
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise FvsolveError(f"an .mp4 cannot be written: a package is missing; {ANIMATION_FORMATS}") from None
