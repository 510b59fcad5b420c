"""Cost of the watch on the energy balance, as the ratio of the time of the loop over steps with it to that without.

    python benchmarks/energy_watch.py [--cases a,b] [--seconds 4] [--quick]

Each case runs with and without the watch by turns in one process, for the given time. The least time of each counts.
The bar is 1.01: the watch reads a few states of a run, most of them early.
"""

import contextlib
import os
import time
from pathlib import Path
from unittest import mock

import measure

from fvsolve import build, load, run
from fvsolve.core.solve.energy_watch import EnergyWatch

CASES = Path(__file__).parents[1] / "cases"
NAMES = (
    "valve-closure",
    "two-tanks",
    "accumulator",
    "check-valve-slam",
    "air-valve",
    "pump-trip-air-vessel",
    "surge-tank",
    "chamber-chain",
    "cylinder-servo",
    "crane",
    "net3-day",
    "street-and-sewer",
    "bowl",
    "flooding",
    "clutch",
)
BEGIN = EnergyWatch.__init__


def unwatched(watch, run_data, has_ranks) -> None:
    """Begin a watch that is empty, as in runs on several ranks."""
    BEGIN(watch, run_data, True)


def main() -> None:
    parser = measure.parser(__doc__)
    parser.add_argument(
        "--cases", default=",".join(NAMES), help="names of cases, separated by commas"
    )
    parser.add_argument("--seconds", type=float, default=4.0, help="time for each case [s]")
    asked = parser.parse_args()
    for name in ["two-tanks"] if asked.quick else asked.cases.split(","):
        model = build(load(CASES / f"{name}.toml", {"output.fields": 0, "output.lines": {}}))
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            steps, begun, least = (
                run(model).summary["steps"],
                time.perf_counter(),
                [float("inf")] * 2,
            )
            while least[1] == float("inf") or time.perf_counter() - begun < (
                0.2 if asked.quick else asked.seconds
            ):
                for k, begin in enumerate((BEGIN, unwatched)):
                    with mock.patch.object(EnergyWatch, "__init__", begin):
                        least[k] = min(least[k], run(model).summary["seconds"])
        print(
            f"{name:24s} {steps:6d} steps   {1e3 * least[0]:9.3f} ms with, {1e3 * least[1]:9.3f} ms without"
            f"   ratio {least[0] / least[1]:.4f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
