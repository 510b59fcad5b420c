"""Writing of a picture or animation file from the frames of a picture sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

FRAME_TIME = 100  # duration of a frame [ms]


def write_animation(stage: Any, count: int, out: Path) -> None:
    """Write a single frame as a picture, several frames as an animation (.gif or .mp4), to the file `out`.

    stage : object whose `show(k)` draws frame k on its `sheet`; count : number of frames
    """
    from PIL import Image

    pictures = []
    for k in range(count):
        stage.show(k)
        pictures.append(stage.sheet.picture())
    if count == 1:
        Image.fromarray(pictures[0]).save(out, optimize=True)
    elif out.suffix == ".mp4":
        import imageio

        imageio.mimsave(out, pictures, fps=1000 // FRAME_TIME, macro_block_size=1)
    else:
        drawn = [Image.fromarray(picture).quantize(255) for picture in pictures]
        drawn[0].save(out, save_all=True, append_images=drawn[1:], duration=FRAME_TIME, loop=0)
