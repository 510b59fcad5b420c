"""CPU time of `auto` at equal error, compared with every method that estimates its error, in stiff cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measure import agree
from price import front, price

from fvsolve.case import load
from fvsolve.core.solve.solve import Run
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.studies.outcome import CappedRun, Outcome, outcome, study_model

HERE = Path(__file__).resolve().parent
SCENES = (
    "cylinder-servo",
    "hydraulic-drive",
    "chamber-chain",
    "pipe-tiny-chamber",
    "temperature-front",
    "servo-arm",
)
GOAL = 1.5  # greatest ratio to the CPU time of the best single method
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # rms errors of the worst probe, relative to its range
TRUTH = {"numerics.method": "radau-iia-5", "numerics.rtol": 1e-12}
SLOW, ROUNDS = 4.0, 5  # CPU time [s]: a longer run is not repeated, and no finer run follows


def auto_table(quick: bool) -> None:
    """Print the cost of `auto` over the least cost of the other methods, case by case."""
    if quick:
        worst = beside("chamber-chain", (1e-3, 1e-5), 1, ["radau-iia-5", "auto"])
        agree("ratio of auto to the best single method", worst, 1e6)
    else:
        methods = [m.name for m in METHODS.values() if m.adaptive] + ["auto"]
        worst = max(
            beside(name, 10.0 ** -np.arange(2.0, 10.1, 0.5), ROUNDS, methods) for name in SCENES
        )
    print(
        f"\n  auto beside the best single method, at worst {worst:.2f} times; goal {GOAL}: ", end=""
    )
    print("met" if worst <= GOAL else "missed")


def beside(name: str, tolerances, rounds: int, methods: list[str]) -> float:
    """Print the cost of each error in a case, and return the greatest ratio of `auto` to the best method."""
    path = next(
        p
        for p in (
            HERE.parent / "cases" / f"{name}.toml",
            HERE.parent / "tests" / "reference" / f"{name}.toml",
        )
        if p.exists()
    )
    case, truth = load(path), outcome(path, TRUTH)
    models = {}
    runs = {method: series(case, method, tolerances, truth, models) for method in methods}
    for _ in range(rounds):  # in turn, so that a disturbance affects all methods
        for method, found in runs.items():
            for rtol, (cost, error) in found.items():
                if cost < SLOW:
                    found[rtol] = (min(cost, outcome(models[method, rtol]).processor), error)
    print(
        f"\n{name}: CPU time [ms] of an error, and over that of the best single method", flush=True
    )
    return max((verdict(runs, target) for target in TARGETS), default=np.nan)


def series(
    case, method: str, tolerances, truth: Outcome, models: dict
) -> dict[float, tuple[float, float]]:
    """CPU time [s] and error of a method by tolerance, the largest tolerance first."""
    found = {}
    for rtol in tolerances:
        models[method, rtol] = model = study_model(
            case, {"numerics.method": method, "numerics.rtol": float(rtol)}
        )
        run = outcome(model, run=limited)
        if not run.ok:
            break
        found[rtol] = run.processor, distance(run, truth)
    return found


def limited(model, state, sink, progress) -> Run:
    """Run of at most SLOW seconds."""
    made = CappedRun(model, state, sink, progress)
    made.max_seconds = SLOW
    return made


def distance(run: Outcome, truth: Outcome) -> float:
    """Root mean square error over the rows of the worst probe, relative to its range."""
    reach = np.ptp(truth.rows[:, 1:], axis=0)
    apart = np.sqrt(np.mean((run.rows[:, 1:] - truth.rows[:, 1:]) ** 2, axis=0))
    return float(np.max(apart[reach > 0] / reach[reach > 0]))


def verdict(runs: dict, target: float) -> float:
    """Print one line, and return the cost of `auto` over the best other method.

    The ratio is 0 if no method reaches the error, infinite if only `auto` does not.
    """
    prices = {}
    for method, found in runs.items():
        pairs = list(found.values())
        if pairs and min(error for _, error in pairs) <= target:
            prices[method] = price(front(pairs), target)
    best = sorted((cost, method) for method, (cost, _) in prices.items() if method != "auto")
    if not best or "auto" not in prices:
        print(f"  {target:.0e}: {'auto does not reach it' if best else 'no method reaches it'}")
        return np.inf if best else 0.0
    least, ratio = best[0][0], prices["auto"][0] / best[0][0]
    others = ", ".join(f"{method} {cost / least:.2f}" for cost, method in best[:4])
    print(
        f"  {target:.0e}: auto {1e3 * prices['auto'][0]:9.3f}{prices['auto'][1]} {ratio:5.2f}; {others}",
        flush=True,
    )
    return ratio
