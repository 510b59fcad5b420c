"""Cost of an error, interpolated log-log between runs of a solver."""

import numpy as np


def front(runs):
    """Runs that are more accurate than all cheaper ones, cheapest first."""
    runs = sorted(runs)
    return [
        (cost, error) for k, (cost, error) in enumerate(runs) if all(error < e for _, e in runs[:k])
    ]


def price(runs, target):
    """Cost at which runs, (cost, error) each, reach a target error, and a mark of its kind.

    "": log-log between two runs of the front; "<": the cheapest run is already better; "~": beyond the best run,
    along the least-squares line of the logarithms of all runs.
    """
    best = front(runs)
    if best[0][1] <= target:
        return best[0][0], "<"
    for (cost_a, error_a), (cost_b, error_b) in zip(best, best[1:], strict=False):
        if error_b <= target:
            part = np.log(error_a / target) / np.log(error_a / error_b)
            return cost_a * (cost_b / cost_a) ** part, ""
    if len(runs) < 2:
        return np.nan, "~"
    costs, errors = np.log(np.array(sorted(runs))).T
    slope, level = np.polyfit(costs, errors, 1)
    return max(best[-1][0], np.exp((np.log(target) - level) / slope)), "~"
