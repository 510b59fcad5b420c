"""Bands of `fvsolve run --error` held against finer runs of all shipped cases.

python benchmarks/peak_bands.py [CASE]...

Of every peak and claim the band, and how far it is from the run of four times the resolution (twice where there are
basins, whose finest run then is one of the three). Prints those outside their band, and how wide bands are beside the
difference.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from fvsolve.case import load, shipped
from fvsolve.run import run
from fvsolve.studies.levels import finer
from fvsolve.studies.peaks import SIDES, peak_errors


def held(name: str) -> list[tuple[str, float, float]]:
    """(peak or claim, band, difference to the finer run) of a case."""
    case = load(name)
    times = 2.0 if case.meshes else 4.0
    quiet = {"output.fields": 0, "output.lines": {}}
    said = peak_errors(run(case, set=quiet), case)
    fine = run(case, set=finer(case, times) | quiet | {"output.every": case.output.every / times}).summary
    rows = [(f"{name} {side} {probe}", peak[side]["error"], peak[side]["value"], fine["extremes"][probe][side])
            for probe, peak in said["peaks"].items() for side in SIDES]  # fmt: skip
    rows += [(f"{name} {one['text']}", one["error"], one["found"], other["found"])
             for one, other in zip(said["expectations"], fine["expectations"], strict=True)]  # fmt: skip
    return [(what, band, abs(there - here)) for what, band, here, there in rows if band is not None]


def main(names: list[str]) -> None:
    rows, began = [], time.perf_counter()
    for name in names:
        rows += held(name)
    misses = [row for row in rows if row[2] > row[1]]
    for what, band, off in misses:
        print(f"outside: {what}: off by {off:.3g}, band {band:.3g}")
    wide = sorted(band / off for _, band, off in rows if off > 1e-6 * band)
    print(f"{len(rows)} peaks and claims of {len(names)} cases, {len(misses)} outside their band; band over "
          f"difference: median {np.median(wide):.3g}, quarters {np.quantile(wide, 0.25):.3g} and "
          f"{np.quantile(wide, 0.75):.3g}; {time.perf_counter() - began:.0f} s")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:] or list(shipped.names()))
