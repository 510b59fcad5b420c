"""Notice of too few cells to resolve cavities, for density laws that model cavitation."""

from __future__ import annotations

from fvsolve.errors import Notice

# relative error of the duration of a first cavity: DURATION cells^-RATE (docs/cavitation.md)
DURATION, RATE = 1.03, 0.7
ENOUGH = 200  # number of cells from which on there is no notice


def coarse_for_cavities(draft) -> list[Notice]:
    """List with a notice if cavities can form, but the pipe with the longest travel time has few cells; else empty.

    The notice states the error of the duration of a first cavity. It is made below ENOUGH cells.
    """
    pipes = draft.meshes
    if not draft.case.law.cavitates or not pipes:
        return []
    longest = max(pipes, key=lambda pipe: (pipe.length / pipe.wave_speed, -pipe.cells))
    if longest.cells >= ENOUGH:
        return []
    error = DURATION * longest.cells**-RATE
    better = DURATION * ENOUGH**-RATE
    text = (f"{longest.name}: with {longest.cells} cell{'s' if longest.cells > 1 else ''} the duration of a first "
            f"cavity is about {100.0 * error:.2g} % too short if damping is low; "
            f"{ENOUGH} cells reduce this error to {100.0 * better:.2g} %")  # fmt: skip
    return [Notice("cells", f"links.{longest.name}", text, "cells", float(longest.cells), float(ENOUGH))]
