"""A sheet's frames as a picture or an animation. Knows files of pictures; knows no scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

FRAME = 100  # of an animation [ms]


def write(stage: Any, many: int, out: Path) -> None:
    """One frame as a picture, several as .gif or .mp4; `stage` shows frame k on its sheet."""
    from PIL import Image

    pictures = []
    for k in range(many):
        stage.show(k)
        pictures.append(stage.sheet.picture())
    if many == 1:
        Image.fromarray(pictures[0]).save(out, optimize=True)
    elif out.suffix == ".mp4":
        import imageio

        imageio.mimsave(out, pictures, fps=1000 // FRAME, macro_block_size=1)
    else:
        drawn = [Image.fromarray(one).quantize(255) for one in pictures]
        drawn[0].save(out, save_all=True, append_images=drawn[1:], duration=FRAME, loop=0)
