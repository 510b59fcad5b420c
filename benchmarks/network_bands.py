"""Error bands and verdicts of `fvsolve run --estimate-error` for random networks, beside an independent solution.

python benchmarks/network_bands.py [--quick] [--random 20] [--seed 1 2] [--models finite-volume delay-line auto]

The networks and their solution by characteristics on exact grids are those of exact_networks.py, which shares no code
with fvsolve. Each network runs with each pipe model, with random cells, schemes, methods and steps that do not fit the
grid, and with limits at 0.9 to 1.1 of its true peaks. Prints for each pipe model the bands that miss the true peak by
more than its uncertainty, the verdicts that the true peak contradicts, the share of bands that are not known (no band,
or a band wider than the range of the signal), and the median of band over true error. Expected: at most 0.5 % missed,
no contradicted verdict, at most 8 % not known, a median of at most 4.
"""

from __future__ import annotations

import time
import traceback
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from exact_networks import (
    Network,
    Solution,
    case_of,
    node_name,
    probes_of,
    random_network,
    solution,
)
from measure import agree, parser

from fvsolve.case import load
from fvsolve.core.run import run
from fvsolve.errors import FvsolveError
from fvsolve.studies.peak_error import RELATIVE_FLOOR, SIDES, peak_errors

MODELS = ("finite-volume", "delay-line", "auto")
MOST_MISSED, MOST_UNKNOWN, MOST_MEDIAN = 0.005, 0.08, 4.0
# relative to the range of a signal: differences from the solution of linear systems
ROUNDING = 1e-9
SCHEMES = ("weno5", "muscl", "upwind", "upwind3", "upwind5", "fromm", "weno5", "weno5")


@dataclass
class Count:
    """Numbers of bands and verdicts, and ratios of bands to true errors, of one pipe model."""

    bands: int = 0
    unknown: int = 0
    missed: list[str] = field(default_factory=list)
    verdicts: int = 0
    open: int = 0
    wrong: list[str] = field(default_factory=list)
    ratios: list[float] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    seconds: float = 0.0


def numerics(network: Network, model: str, rng: np.random.Generator) -> dict[str, Any]:
    """Random numerical settings for a network with a pipe model."""
    longest = max(pipe.units for pipe in network.pipes) * network.unit
    keys: dict[str, Any] = {"end": network.end * network.unit, "pipe_model": model}
    keys["cell_time"] = longest / rng.uniform(10.0, 80.0)
    if model == "delay-line":
        control = rng.choice(["step", "courant", "rtol"])
        keys["method"] = str(rng.choice(["euler", "rk4"]))
    else:
        control = rng.choice(["courant", "courant", "rtol"])
        keys["scheme"] = str(rng.choice(SCHEMES))
        keys["method"] = str(rng.choice(["rk4", "rk4", "ssp-rk3"]))
    if model == "auto":
        keys["delay_tolerance"] = float(rng.choice([0.1, 0.01, 0.01, 0.001]))
    if control == "rtol":
        keys["rtol"] = float(10.0 ** rng.uniform(-6.0, -3.5))
        keys["method"] = str(rng.choice(["bogacki-shampine", "dormand-prince", "auto"]))
    elif control == "step":
        keys["step"] = longest / rng.uniform(5.0, 60.0)
    else:
        keys["courant"] = (
            float(rng.uniform(0.4, 0.9)) if model != "delay-line" else float(rng.uniform(0.4, 2.0))
        )
    return keys


def limits_near(network: Network, truth: Solution, rng: np.random.Generator) -> dict[str, Any]:
    """Upper and lower limit on the head of each node, at 0.9 to 1.1 of its true peak's distance from the lake."""
    limits = {}
    for k in range(1, len(network.elevations)):
        for side, bound in enumerate(SIDES):
            peak = float(truth.extremes[k - 1, side])
            value = network.head + (peak - network.head) * rng.uniform(0.9, 1.1)
            limits[f"{node_name(k)}-{bound}"] = {
                "on": f"nodes.{node_name(k)}",
                "quantity": "head",
                bound: value,
            }
    return limits


def case_with(network: Network, truth: Solution, model: str, seed: Any) -> dict[str, Any]:
    """Case of a network with random settings and limits."""
    rng = np.random.default_rng([*seed, MODELS.index(model), 7])
    every = network.end * network.unit / 300.0
    output = {"every": every, "fields": 0, "probes": probes_of(network)}
    limits = limits_near(network, truth, rng)
    return case_of(network) | {
        "limits": limits,
        "numerics": numerics(network, model, rng),
        "output": output,
    }


def compare(
    count: Count, label: str, given: dict[str, Any], network: Network, truth: Solution
) -> None:
    """Add the bands and verdicts of a case to the counts."""
    case = load(given)
    said = peak_errors(run(case, pictures=False), case)
    for k, probe in enumerate(probes_of(network)):
        for side, bound in enumerate(SIDES):
            peak, right, unsure = (
                said["peaks"][probe][bound],
                truth.extremes[k, side],
                truth.uncertainty[k, side],
            )
            span = float(np.ptp(truth.extremes[k]))
            unsure += ROUNDING * abs(right)
            off, band = abs(peak["value"] - right), peak["error"]
            count.bands += 1
            if band is None or band > max(span, RELATIVE_FLOOR * abs(right)) * (1.0 + 1e-3) + 1e-12:
                count.unknown += 1
            if band is None:
                continue
            if off > band + unsure:
                count.missed.append(
                    f"{label} {bound} {probe}: {peak['value']:.7g} +- {band:.3g}, "
                    f"right {right:.7g} +- {unsure:.2g}, off by {off:.3g} of {span:.3g}"
                )
            if off > RELATIVE_FLOOR * abs(right) and off > 4.0 * unsure:
                count.ratios.append(band / off)
    rows = {probe: k for k, probe in enumerate(probes_of(network))}
    for verdict in said["verdicts"]:
        bound, k = verdict["bound"], rows[f"{verdict['place']}.head"]
        side = SIDES.index(bound)
        unsure = truth.uncertainty[k, side] + ROUNDING * abs(truth.extremes[k, side])
        margin = (truth.extremes[k, side] - verdict["limit"]) * (
            1.0 if bound == "minimum" else -1.0
        )
        count.verdicts += 1
        count.open += verdict["state"] == "open"
        if (verdict["state"] == "holds" and margin < -unsure) or (
            verdict["state"] == "fails" and margin > unsure
        ):
            count.wrong.append(
                f"{label} {verdict['name']}: {verdict['state']}, margin {verdict['margin']:.4g} "
                f"+- {verdict['error']}, right {margin:.4g} +- {unsure:.2g}"
            )


def report(model: str, count: Count) -> bool:
    """Print the counts of a pipe model; True if they are as expected."""
    for kind, texts in (
        ("missed", count.missed),
        ("wrong verdict", count.wrong),
        ("no run", count.failed),
    ):
        for text in texts:
            print(f"  {kind}: {text}")
    bands, median = max(count.bands, 1), float(np.median(count.ratios)) if count.ratios else 0.0
    quarters = np.quantile(count.ratios, [0.25, 0.75]) if count.ratios else [0.0, 0.0]
    print(
        f"{model}: {count.bands} bands, {len(count.missed)} missed ({100.0 * len(count.missed) / bands:.2f} %), "
        f"{count.unknown} not known ({100.0 * count.unknown / bands:.1f} %), median of band over true error "
        f"{median:.3g} (quarters {quarters[0]:.3g}, {quarters[1]:.3g}); {count.verdicts} verdicts, "
        f"{count.open} open, {len(count.wrong)} contradicted; {count.seconds:.0f} s",
        flush=True,
    )
    few = len(count.missed) <= MOST_MISSED * bands and not count.wrong and not count.failed
    return few and count.unknown <= MOST_UNKNOWN * bands and median <= MOST_MEDIAN


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "--random", type=int, metavar="N", help="number of networks of each seed (default 20)"
    )
    options.add_argument(
        "--first", type=int, default=0, help="number of the first network (default 0)"
    )
    options.add_argument("--seed", type=int, nargs="*", default=[1, 2], help="seeds (default 1 2)")
    options.add_argument(
        "--models", nargs="*", default=list(MODELS), help="pipe models (default all three)"
    )
    given = options.parse_args()
    many = given.random or (1 if given.quick else 20)
    seeds = given.seed[:1] if given.quick else given.seed
    counts = {model: Count() for model in given.models}
    for seed in [(first, k) for first in seeds for k in range(given.first, given.first + many)]:
        network = random_network(seed)
        truth = solution(network)
        for model, count in counts.items():
            began, label = time.process_time(), f"{seed[0]}/{seed[1]} {model}"
            try:
                compare(count, label, case_with(network, truth, model, seed), network, truth)
            except FvsolveError as error:
                count.failed.append(f"{label}: {' '.join(str(error).split())}")
            except Exception:
                count.failed.append(f"{label}: {traceback.format_exc()}")
            count.seconds += time.process_time() - began
    good = [report(model, count) for model, count in counts.items()]
    if given.quick:
        agree(
            "pipe models with bands or verdicts that are not as expected", len(good) - sum(good), 0
        )


if __name__ == "__main__":
    main()
