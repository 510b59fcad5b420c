"""Pictures of bodies and moving basins over time, for a slider of the page of a report."""

import base64
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.fields import read_series
from fvsolve.core.run.plot_scene import scene_of
from fvsolve.errors import FvsolveError
from fvsolve.report.draw.view import frame_pictures

MAX_FRAMES = 30  # of a scene
MAX_BYTES = 4_000_000  # of all pictures of a scene in base 64


class MovingScene(NamedTuple):
    """Pictures of a scene over time.

    times : of the pictures [s]; pictures : their addresses `data:`; stored : number of frames of the run
    fault : sentence on the reason for which there are no pictures, or ""
    """

    times: list[float]
    pictures: list[str]
    stored: int
    fault: str = ""


def moving_scene(result: Any) -> MovingScene | None:
    """Scene of the bodies and moving basins of a run; None if the case has none, or if no frames were stored."""
    case = result.case
    bodies = any(node.kind == "body" for node in case.nodes.values())
    basins = [case.nodes[name] for name in case.meshes if name not in case.links]
    if not bodies and not any(basin.on is not None for basin in basins):
        return None
    index = None if result.directory is None else result.directory / "fields.pvd"
    files: dict[float, list[Path]] = {}
    for t, path in read_series(index) if index is not None and index.is_file() else []:
        files.setdefault(t, []).append(path)
    if len(files) < 2:
        return None
    chosen = np.unique(np.linspace(0, len(files) - 1, MAX_FRAMES).round().astype(int)).tolist()
    times = [list(files)[k] for k in chosen]
    field = next(iter(basins[0].physics_type.fields)) if basins else "speed"
    title = result.summary["title"]
    try:
        scene = scene_of(case, title, field, [(t, files[t]) for t in times], 0)
        drawn = frame_pictures(scene)
    except FvsolveError as error:
        return MovingScene([], [], len(files), f"The scene is not drawn: {error}")
    packed = [base64.b64encode(picture).decode() for picture in drawn]
    while sum(map(len, packed)) > MAX_BYTES and len(packed) > 2:
        packed, times = packed[::2], times[::2]
    return MovingScene(times, [f"data:image/png;base64,{text}" for text in packed], len(files))
