"""Scenarios per second and core, with errors: fresh, varied in place, rows of sweeps alone and in batches, on Dask.

python benchmarks/many_runs.py [--quick]  valve-closure, 10 s, results at 20 places; CPU time, mean of the faster half
python benchmarks/many_runs.py --dask     rows of a sweep in this process and on one process of a LocalCluster
"""

from __future__ import annotations

import time

import numpy as np
from measure import agree, parser, peer_module

from fvsolve import build, load, run, vary
from fvsolve.studies.parallel import TaskPool
from fvsolve.studies.sweep_batches import BatchedRows
from fvsolve.studies.sweep_row import RowMaker

CASE, KEY, GOAL, SHARE = "valve-closure", "links.valve.area", 500.0, 0.9
CELLS = {
    "links.main.cells": 20,
    "numerics.scheme": "upwind5",
    "numerics.method": "rk4",
    "output.fields": 0,
}
LINE = {
    "links.main.cells": 20,
    "numerics.pipe_model": "delay-line",
    "numerics.method": "euler",
    "output.fields": 0,
}
# steps of delay lines [s]; the errors of the second are near those of 20 cells
DELAYS = (0.01, 0.05)
LIMITS = {  # of closures
    "limits.high": {"on": "pipes", "maximum": "16 barg"},
    "limits.low": {"on": "pipes", "minimum": "vacuum"},
    "limits.gate": {"on": "gate", "quantity": "head", "maximum": "90 m"},
}
FINE, PROBE = 2000, "gate.pressure"  # cells of the reference run, and probe of the errors
TIMES, RUNS, REPEATS = 200, 2000, 20


def area(k: float) -> dict[str, float]:
    """Override with an area of the valve that no earlier run used."""
    return {KEY: 0.0017 + 1e-7 * k}


def closure(k: float) -> dict[str, dict]:
    """Override with a closure of the valve in two strokes that no earlier run used."""
    return {"links.valve.opening": {"time": [1.0, 1.5, 2.0], "value": [1.0, 0.1 + 1e-4 * k, 0.0]}}


def cost(one, values=area) -> float:
    """CPU time of one call [s], mean of the faster half of TIMES calls, because other processes use the machine too."""
    spent = []
    for k in range(TIMES + 5):
        began = time.process_time()
        one(values(k))
        spent.append(time.process_time() - began)
    quick = sorted(spent[5:])[: TIMES // 2]
    return sum(quick) / len(quick)


def cost_in_batches(base: dict, values=area) -> float:
    """CPU time of a row in a sweep of TIMES rows [s], least of REPEATS sweeps after the first."""
    spent, rows = [], BatchedRows(RowMaker(CASE, base))
    for repeat in range(REPEATS + 1):
        began = time.process_time()
        for _ in rows.results([values(k + 0.1 * repeat) for k in range(TIMES)]):
            pass
        spent.append((time.process_time() - began) / TIMES)
    return min(spent[1:])


def told(name: str, seconds: float, goal: float | None = None) -> None:
    """Print a line of the table."""
    wanted = "" if goal is None else f"  (goal {goal:.0f})"
    print(
        f"{name:44} {1e3 * seconds:8.2f} ms {1.0 / seconds:8.0f} a second and core{wanted}",
        flush=True,
    )


def errors(result, fine) -> tuple[float, float]:
    """Errors of the probe relative to a fine run, rms over all rows and of the peak, in units of the jump."""
    times, found = fine.t, np.interp(fine.t, result.t, result.si(PROBE)) - fine.si(PROBE)
    jump, peak = np.ptp(fine.si(PROBE)[times < 1.5]), result.si(PROBE).max() - fine.si(PROBE).max()
    return float(np.sqrt(np.mean(found**2)) / jump), float(abs(peak) / jump)


def by(base: dict, name: str, goal: float | None, fine) -> None:
    """Print the cost of each way to run a scenario with these overrides."""
    model, rows = build(load(CASE, base)), RowMaker(CASE, base)
    result = min((run(model) for _ in range(REPEATS)), key=lambda one: one.summary["seconds"])
    fresh, varied = (
        one.si(PROBE) for one in (run(CASE, base | area(0)), run(vary(model, area(0))))
    )
    agree("a fresh run beside one in place [Pa]", np.abs(fresh - varied).max(), 1e-3)
    steps, seconds = result.summary["steps"], result.summary["seconds"]
    off = " and ".join(f"{one:.1e}" for one in errors(result, fine))
    print(
        f"{name}: {steps} steps, {1e3 * seconds:.2f} ms in them; error of the jump, rms and of the peak: {off}"
    )
    told("  fresh: run(case, set)", cost(lambda values: run(CASE, base | values)))
    told("  in place: run(vary(model, set))", cost(lambda values: run(vary(model, values))))
    told("  of which vary(model, set)", cost(lambda values: vary(model, values)))
    told("  a row of a sweep, alone", cost(rows))
    told("  a row of a sweep, in batches", cost_in_batches(base), goal)


def closures(step: float) -> None:
    """Print the cost of rows of closures with limits, on a delay line with this step [s]."""
    base = LINE | LIMITS | {"numerics.step": step}
    print(f"closures with three limits, delay line, steps of {1e3 * step:.0f} ms")
    told("  a row of a sweep, alone", cost(RowMaker(CASE, base), closure))
    told("  a row of a sweep, in batches", cost_in_batches(base, closure), 2 * GOAL)


def dask() -> None:
    """Print the CPU time of rows in this process and on a worker of Dask."""
    if not (distributed := peer_module("distributed", "distributed")):
        return
    rows, points = RowMaker(CASE, CELLS), [area(k) for k in range(RUNS)]
    rows(points[0])
    began = time.process_time()
    for _ in TaskPool(rows).run(points):
        pass
    here = (time.process_time() - began) / RUNS
    made = distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0")
    with made as cluster, distributed.Client(cluster) as client:
        with TaskPool(RowMaker(CASE, CELLS), dask=cluster.scheduler_address) as pool:
            for _ in pool.run(points[:50]):
                pass  # compiles on the worker
        before, began = sum(client.run(time.process_time).values()), time.process_time()
        with TaskPool(RowMaker(CASE, CELLS), dask=cluster.scheduler_address) as pool:
            for _ in pool.run(points):
                pass
        there = (sum(client.run(time.process_time).values()) - before) / RUNS
        beside = (time.process_time() - began) / RUNS
    told(f"{RUNS} rows in this process", here)
    told(f"{RUNS} rows on a worker of Dask", there)
    print(f"{'share of the rate':44} {here / there:8.2f}  (goal {SHARE})")
    print(f"{'scheduler and parent':44} {1e3 * beside:8.2f} ms a run")


def main() -> None:
    """Print all tables, or only that of Dask."""
    global FINE, TIMES, RUNS, REPEATS
    options = parser(__doc__)
    options.add_argument("--dask", action="store_true", help="only the rows on a worker of Dask")
    given = options.parse_args()
    if given.quick:
        FINE, TIMES, RUNS, REPEATS = 100, 2, 50, 1
    if given.dask:
        return dask()
    fine = run(build(load(CASE, CELLS | {"links.main.cells": FINE})))
    by(CELLS, "20 cells, upwind5 and rk4", GOAL, fine)
    for step in DELAYS:
        by(
            LINE | {"numerics.step": step},
            f"delay line, steps of {1e3 * step:.0f} ms",
            2 * GOAL,
            fine,
        )
        closures(step)


if __name__ == "__main__":
    main()
