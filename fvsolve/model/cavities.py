"""Whether a scene has cells enough for the cavities that its law follows. Knows pipes; knows no flow."""

from __future__ import annotations

from fvsolve.errors import Notice

DURATION, RATE = 1.03, 0.7  # a first cavity is too short by the one times cells to minus the other (docs/cavitation.md)
ENOUGH = 200  # cells from which on nothing is said of it


def coarse_for_cavities(draft) -> list[Notice]:
    """A note where the pipe that waves take longest to pass has few cells for the cavities that the law follows."""
    pipes = draft.meshes
    if not draft.case.law.cavitates or not pipes:
        return []
    longest = max(pipes, key=lambda pipe: pipe.length / pipe.wave_speed)
    if longest.cells >= ENOUGH:
        return []
    found = DURATION * longest.cells**-RATE
    better = DURATION * ENOUGH**-RATE
    text = (f"{longest.name}: with {longest.cells} cells a first cavity lasts some {100.0 * found:.2g} % too short "
            f"where little dampens it; {ENOUGH} cells bring that to {100.0 * better:.2g} %")  # fmt: skip
    return [Notice("cells", f"links.{longest.name}", text, "cells", float(longest.cells), float(ENOUGH))]
