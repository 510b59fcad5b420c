"""Times to read a raster and to form means over cells, and to read a CSV file of points on a grid.

    python benchmarks/rasters.py [--quick]

Goals: 4 million pixels on 250 000 cells in 3 s, 90 000 points in 0.5 s, as CPU time.
"""

import dataclasses
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from measure import agree, machine, parser

from fvsolve.core.mesh import rectangle
from fvsolve.parts.formula import Samples, read_points
from fvsolve.parts.raster import Raster
from fvsolve.parts.raster_files import read_pixels


def timed(what: str, call: Callable) -> object:
    """Result of a call, whose CPU time is printed."""
    start = time.process_time()
    result = call()
    print(f"{what:48} {time.process_time() - start:6.3f} s", flush=True)
    return result


def main() -> None:
    """Print the times."""
    side = 200 if parser(__doc__).parse_args().quick else 2000
    print(machine("fvsolve", "numpy"))
    values = np.random.default_rng(1).uniform(0.0, 100.0, (side, side)).round(2)
    mesh = rectangle((side, side), (side // 4, side // 4))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "dem.asc")
        head = f"ncols {side}\nnrows {side}\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
        path.write_text(
            head + "\n".join(" ".join(map(repr, row)) for row in values[::-1].tolist()) + "\n"
        )
        pixels = timed(f"ASCII grid of {side**2:.3g} pixels", lambda: read_pixels(path))
        for what, form in (
            ("rectangles", mesh),
            ("quadrilaterals of a file", dataclasses.replace(mesh, grid=None)),
        ):
            mean = timed(
                f"means over {len(mesh.cells):.3g} {what}",
                lambda form=form: Raster("dem", pixels).over(form),
            )
            agree(
                "volume",
                abs(mean @ mesh.area / values.sum() - 1.0),
                1e-12 if form is mesh else 1e-3,
            )
        x, y = (line.ravel() for line in np.meshgrid(*[np.arange(0.0, 0.15 * side)] * 2))
        path = Path(folder, "points.csv")
        rows = zip(x.tolist(), y.tolist(), (0.1 * x + np.sin(y)).tolist(), strict=True)
        path.write_text("x [m],y [m],z [m]\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
        timed(
            f"CSV file of {x.size} points, 5400 values",
            lambda: Samples(read_points(path, "length"))(x[:5400], y[:5400]),
        )


if __name__ == "__main__":
    main()
