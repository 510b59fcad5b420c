"""`auto` beside every method that estimates its error: CPU time at equal error, in stiff cases with their own cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measure import agree
from price import front, price

from fvsolve.case import load
from fvsolve.solve.solve import Run
from fvsolve.steppers.built_in_methods import METHODS
from fvsolve.studies.accuracy.timing import CappedRun
from fvsolve.studies.outcome import Outcome, outcome, study_model

HERE = Path(__file__).resolve().parent
SCENES = ("cylinder-servo", "hydraulic-drive", "chamber-chain", "pipe-tiny-chamber", "temperature-front", "servo-arm")
GOAL = 1.5  # times the CPU time of the best single method, at most
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # mean errors of the worst probe, in its range
TRUTH = {"numerics.method": "radau-iia-5", "numerics.rtol": 1e-12}
SLOW, ROUNDS = 4.0, 5  # [s] of CPU time: a longer run is not timed again, and no finer one is tried


def auto_table(quick: bool) -> None:
    """Price of `auto` over the least price of the others, case by case."""
    if quick:
        worst = beside("chamber-chain", (1e-3, 1e-5), 1, ["radau-iia-5", "auto"])
        agree("auto beside the best single method, which comes to a truth", worst, 1e6)
    else:
        methods = [m.name for m in METHODS.values() if m.adaptive] + ["auto"]
        worst = max(beside(name, 10.0 ** -np.arange(2.0, 10.1, 0.5), ROUNDS, methods) for name in SCENES)
    print(f"\n  auto beside the best single method, at worst {worst:.2f} times; goal {GOAL}: ", end="")
    print("met" if worst <= GOAL else "missed")


def beside(name: str, tolerances, rounds: int, methods: list[str]) -> float:
    """Print what each error costs in a case; returns what `auto` costs beside the best, at worst."""
    path = next(
        p
        for p in (HERE.parent / "cases" / f"{name}.toml", HERE.parent / "tests" / "reference" / f"{name}.toml")
        if p.exists()
    )
    case, truth = load(path), outcome(path, TRUTH)
    models = {}
    runs = {method: series(case, method, tolerances, truth, models) for method in methods}
    for _ in range(rounds):  # in turns, so that one noisy moment spoils no single method
        for method, found in runs.items():
            for rtol, (cost, error) in found.items():
                if cost < SLOW:
                    found[rtol] = (min(cost, outcome(models[method, rtol]).processor), error)
    print(f"\n{name}: CPU time [ms] of an error, and over that of the best single method", flush=True)
    return max((verdict(runs, target) for target in TARGETS), default=np.nan)


def series(case, method: str, tolerances, truth: Outcome, models: dict) -> dict[float, tuple[float, float]]:
    """(CPU time [s], error) of a method by tolerance, the widest first."""
    found = {}
    for rtol in tolerances:
        models[method, rtol] = model = study_model(case, {"numerics.method": method, "numerics.rtol": float(rtol)})
        run = outcome(model, run=limited)
        if not run.ok:
            break
        found[rtol] = run.processor, distance(run, truth)
    return found


def limited(model, state, sink, progress) -> Run:
    """A run of SLOW seconds at most."""
    made = CappedRun(model, state, sink, progress)
    made.max_seconds = SLOW
    return made


def distance(run: Outcome, truth: Outcome) -> float:
    """Root mean square over the rows of a probe in its range, of the worst probe."""
    reach = np.ptp(truth.rows[:, 1:], axis=0)
    apart = np.sqrt(np.mean((run.rows[:, 1:] - truth.rows[:, 1:]) ** 2, axis=0))
    return float(np.max(apart[reach > 0] / reach[reach > 0]))


def verdict(runs: dict, target: float) -> float:
    """Print one line; returns the price of `auto` over the best of the others, zero where none gets there."""
    prices = {}
    for method, found in runs.items():
        pairs = list(found.values())
        if pairs and min(error for _, error in pairs) <= target:
            prices[method] = price(front(pairs), target)
    best = sorted((cost, method) for method, (cost, _) in prices.items() if method != "auto")
    if not best or "auto" not in prices:
        print(f"  {target:.0e}: {'auto does not get there' if best else 'no method gets there'}")
        return np.inf if best else 0.0
    least, ratio = best[0][0], prices["auto"][0] / best[0][0]
    others = ", ".join(f"{method} {cost / least:.2f}" for cost, method in best[:4])
    print(f"  {target:.0e}: auto {1e3 * prices['auto'][0]:9.3f}{prices['auto'][1]} {ratio:5.2f}; {others}", flush=True)
    return ratio
