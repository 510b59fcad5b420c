"""Error bands of `fvsolve run --estimate-error`, compared with finer runs of all shipped cases or of random mains.

python benchmarks/peak_bands.py [--quick] [CASE]...
python benchmarks/peak_bands.py --random 160 [--seed 0]

The band of every peak and expectation is compared with the difference from a run of four times the resolution (twice
for basins with cells, for which the finest run of the estimate has that resolution). Random mains are compared with
runs of eight times the resolution. They have limits at 0.9 to 1.1 of each peak, whose verdicts the finer run may
change. Prints the values outside their band, the number without a band, and the ratio of band to difference, for
differences above 5e-6 of the value, which is the least band.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from measure import agree, parser
from random_mains import limits_near, random_main

from fvsolve.case import load, shipped
from fvsolve.core.run import run
from fvsolve.errors import FvsolveError
from fvsolve.studies.peak_error import RELATIVE_FLOOR, SIDES, peak_errors
from fvsolve.studies.resolution import refined_keys

QUIET = {"output.fields": 0, "output.lines": {}}


class Row(NamedTuple):
    """Peak or expectation: its band, its value, and the value of a finer run."""

    name: str
    band: float | None
    value: float
    fine: float

    @property
    def off(self) -> float:
        return abs(self.fine - self.value)


def rows_of(name: str, said: dict, fine: dict) -> list[Row]:
    """Rows of the peaks and expectations of a case and of a finer run."""
    rows = [
        Row(
            f"{name} {side} {probe}",
            peak[side]["error"],
            peak[side]["value"],
            fine["extremes"][probe][side],
        )
        for probe, peak in said["peaks"].items()
        for side in SIDES
    ]
    return rows + [
        Row(f"{name} {one['text']}", one["error"], one["found"], other["found"])
        for one, other in zip(said["expectations"], fine["expectations"], strict=True)
    ]


def of_shipped(name: str) -> list[Row]:
    case = load(name)
    times = 2.0 if case.meshes else 4.0
    said = peak_errors(run(case, set=QUIET), case)
    fine = run(
        case, set=refined_keys(case, times) | QUIET | {"output.every": case.output.every / times}
    ).summary
    return rows_of(name, said, fine)


def of_main(seed: int) -> tuple[list[Row], list[Row], list[str]]:
    """Rows of peaks and of limits of one random main, and the verdicts that the finer run changes."""
    case = load(random_main(seed))
    parts = {name: whole(run(case, pictures=False), name) for name in ("end", "j", "a", "b")}
    case = load(random_main(seed) | {"limits": limits_near(parts, seed)})
    said = peak_errors(run(case, pictures=False), case)
    fine = run(
        case,
        set=refined_keys(case, 8.0) | {"output.every": case.output.every / 8.0},
        pictures=False,
    ).summary
    limits = list(zip(said["verdicts"], fine["verdicts"], strict=True))
    rows = [
        Row(f"{seed} {one['name']}", one["error"], one["value"], other["value"])
        for one, other in limits
    ]
    turned = [
        f"{seed} {one['name']}: {one['state']}, margin {one['margin']:.4g} within {one['error']}, "
        f"by the finer run {other['margin']:.4g}"
        for one, other in limits
        if one["state"] == "holds" and other["margin"] < 0.0
    ]
    return rows_of(str(seed), said, fine), rows, turned


def whole(result, name: str) -> tuple[float, float]:
    """Least and greatest pressure of a part [Pa]."""
    if name in result.envelope:
        one = result.envelope[name]
        return float(one["min_pressure"].min()), float(one["max_pressure"].max())
    peak = result.extremes[f"{name}.pressure"]
    return peak.minimum, peak.maximum


def tell(rows: list[Row], what: str) -> int:
    """Print a table, and return the number of rows outside their band."""
    known = [row for row in rows if row.band is not None]
    misses = [row for row in known if row.off > row.band]
    for row in misses:
        print(f"outside: {row.name}: off by {row.off:.3g}, band {row.band:.3g} of {row.value:.4g}")
    wide = [row.band / row.off for row in known if row.off > RELATIVE_FLOOR * abs(row.value)]
    quarters = (
        " ".join(f"{one:.3g}" for one in np.quantile(wide, [0.25, 0.5, 0.75])) if wide else "-"
    )
    share = 100.0 * len(misses) / max(len(known), 1)
    print(
        f"{what}: {len(rows)}, {len(rows) - len(known)} without a band, {len(misses)} outside ({share:.2g} %)"
    )
    print(f"  band over difference, quarters and median: {quarters}")
    return len(misses)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("cases", nargs="*", metavar="CASE", help="shipped cases (default all)")
    options.add_argument(
        "--random",
        type=int,
        default=0,
        metavar="N",
        help="number of random mains in place of the cases (default 0)",
    )
    options.add_argument("--seed", type=int, default=0, help="seed of the first main (default 0)")
    asked, began, outside = options.parse_args(), time.process_time(), 0
    if asked.quick and not asked.random:
        asked.random, asked.cases = 1, asked.cases or ["two-tanks"]
    if asked.random:
        made = []
        for seed in range(asked.seed, asked.seed + asked.random):
            try:
                made.append(of_main(seed))
            except FvsolveError as error:
                print(f"{seed}: {error}")
        peaks, places, turned = (sum(parts, []) for parts in zip(*made, strict=True))
        outside = tell(peaks, "peaks") + tell(places, "limits") + len(turned)
        print(f"verdicts turned: {len(turned)}", *turned, sep="\n  ")
    if asked.cases or not asked.random:
        names = asked.cases or list(shipped.names())
        outside += tell(
            [row for name in names for row in of_shipped(name)],
            f"peaks and claims of {len(names)} cases",
        )
    print(f"{time.process_time() - began:.0f} s of processor time")
    if asked.quick:
        agree("peaks, limits and claims outside their band", outside, 0)


if __name__ == "__main__":
    main()
