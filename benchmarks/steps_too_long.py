"""Runs with steps from 0.5 to 10 000 times the limit: each is within 2 % of a fine run, or is not `ok`.

    python benchmarks/steps_too_long.py [CASE ...] [--methods euler,rk4] [--factors 0.5,2,30]

Fifteen shipped cases of every physics run with explicit methods, with `numerics.step` and `numerics.courant`. The limit
is that of von Neumann for cells, and the step up to which no mode of other states grows at the start. The fine run has
the same cells and scheme and steps of a quarter of the limit of rk4.

The difference is that of the extremes of a probe, and the mean difference of its rows, over the range of the probe in
the fine run (at least 2 % of the greatest range of its dimension; the magnitude of a quantity that is conserved).
"""

import math
import sys

import numpy as np
from measure import parser

import fvsolve
from fvsolve.core.run import model_of
from fvsolve.core.step_limits.greatest_step import excess_growth
from fvsolve.core.step_limits.growing_modes import modes_outside_cells
from fvsolve.core.step_limits.step_notices import exceeded_checks, first_step, steps_of
from fvsolve.core.steppers.analysis.stability_function import stability_function
from fvsolve.errors import FvsolveError

CASES = {  # case -> changes that make it short and keep its physics
    "valve-closure": {"links.main.cells": 40, "numerics.end": 4.0},
    "three-way-junction": {},
    "streeter-nine-pipes": {"numerics.end": 6.0},
    "plastic-main": {"numerics.end": 8.0},
    "laminar-line": {},
    "check-valve-slam": {},
    "pump-trip-air-vessel": {"numerics.end": 10.0},
    "two-tanks": {},
    "chamber-and-orifice": {},
    "surge-tank": {},
    "tumbling-body": {"numerics.end": 5.0},
    "dc-motor-pump": {"numerics.end": 0.3},
    "dam-break": {},
    "bowl": {"numerics.end": 2.0},
    "flooding": {"numerics.end": 10.0},
    "swirl": {"numerics.end": 0.3},
    "storm-sewer": {"numerics.end": 300.0},
}
FACTORS = (0.5, 0.9, 1.1, 1.3, 2.0, 4.0, 10.0, 30.0, 100.0, 1e3, 1e4)
METHODS = ("euler", "ssp-rk2", "ssp-rk3", "rk4")
WITHIN = 0.02
LEAST_RANGE = 0.02
# range over magnitude below which a probe counts as constant; its magnitude is its range
CONSERVED = 1e-3
LOWEST = 1e-9


def model_with(case: str, method: str, changes: dict, **steps):
    return model_of(
        case,
        {"expect": {}, **changes, "numerics.method": method}
        | {f"numerics.{key}": value for key, value in steps.items()},
    )


def limit_of(case: str, method: str, changes: dict) -> float:
    """Greatest step [s] with which no wave in cells and no other mode grows at the start; 0 if there is none."""
    model = model_with(case, method, changes, step=LOWEST)
    r = stability_function(method)
    modes = [values for _, values in modes_outside_cells(model)]

    def holds(h: float) -> bool:
        own = model_with(case, method, changes, step=h) if model.pipes or model.meshed else model
        if (model.pipes or model.meshed) and exceeded_checks(own, method, {}, steps_of(own, h)):
            return False
        return all(excess_growth(r, s, h).max() <= 1e-9 for s in modes)

    low, high = LOWEST, LOWEST
    if not holds(low):
        return 0.0
    end = model.case.numerics.end - model.case.numerics.start
    while high < end and holds(high):
        low, high = high, 2.0 * high
    for _ in range(12):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def difference(result, fine) -> tuple[float, str]:
    """Greatest difference of a probe over its range, and the name of the probe."""
    spans, worst = {}, (0.0, "")
    for name in fine.extremes:
        values = fine[name]
        spans.setdefault(fine.units[name], []).append(float(np.ptp(values)))
    for name in fine.extremes:
        right, found = fine[name], result[name]
        size = float(np.abs(right).max())
        span = max(float(np.ptp(right)), LEAST_RANGE * max(spans[fine.units[name]]))
        span = size if span < CONSERVED * size else span
        if span == 0.0:
            continue
        ends = max(abs(float(found.min() - right.min())), abs(float(found.max() - right.max())))
        rows = np.abs(np.interp(fine.t, result.t, found) - right)
        off = max(ends, float(np.trapezoid(rows, fine.t) / np.ptp(fine.t))) / span
        worst = max(worst, (off if math.isfinite(off) else math.inf, name))
    return worst


def main() -> int:
    options = parser(__doc__)
    options.add_argument("cases", nargs="*", default=list(CASES))
    options.add_argument("--methods", default=",".join(METHODS))
    options.add_argument("--factors", default=",".join(map(str, FACTORS)))
    given = options.parse_args()
    if given.quick:
        given.cases, given.factors, given.methods = ["two-tanks"], "0.5,10", "rk4"
    factors = [float(x) for x in given.factors.split(",")]
    wrong = lost = count = silent = 0
    for case in given.cases:
        changes = CASES[case]
        finest = limit_of(case, "rk4", changes)
        fine = fvsolve.run(model_with(case, "rk4", changes, step=0.25 * finest))
        for method in given.methods.split(","):
            limit = limit_of(case, method, changes)
            if limit == 0.0:
                print(f"{case:22} {method:8} no stable step")
                continue
            model = model_with(case, method, changes, step=limit)
            if model.meshed and first_step(model_with(case, method, changes, courant=1.0)) == 0.0:
                print(f"{case:22} {method:8} starts dry: no wave limits the first step")
                continue
            ways = ["step"] + (["courant"] if model.cells or model.meshed else [])
            for key in ways:
                line = f"{case:22} {method:8} {key:8} limit {limit:9.3g} s:"
                for factor in factors:
                    if key == "step":
                        value = factor * limit
                    else:
                        one = model_with(case, method, changes, courant=1.0)
                        value = factor * limit / first_step(one)
                    try:
                        result = fvsolve.run(model_with(case, method, changes, **{key: value}))
                    except FvsolveError as error:
                        line += f" {factor:g}: refused ({error});"
                        continue
                    count += 1
                    off, name = difference(result, fine)
                    good = result.ok
                    if (
                        factor > 1.0
                        and not good
                        and not any("or less" in one.text for one in result.warnings)
                    ):
                        silent += 1
                    if good and off > WITHIN:
                        wrong += 1
                        line += f" {factor:g}: WRONG {off:.2g} at {name};"
                    elif not good and factor < 1.0 and off <= WITHIN:
                        lost += 1
                        line += f" {factor:g}: LOST {off:.2g};"
                    else:
                        line += f" {factor:g}: {'ok' if good else 'no'} {off:.1g};"
                print(line, flush=True)
    print(f"{count} runs: {wrong} ok and more than {WITHIN:g} from the fine run (goal 0)")
    print(
        f"{lost} within the limit, right and not ok (goal 0); {silent} not ok without a step that is short enough"
    )
    return 1 if wrong or lost else 0


if __name__ == "__main__":
    sys.exit(main())
