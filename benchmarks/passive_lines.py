"""Growth of waves in random networks of delay lines: `python benchmarks/passive_lines.py [N]`, 1 000 of each kind.

The networks are trees of 3 to 6 junctions with one loop and pipes of 2 to 200 m, about a third of them shorter than a
step; a demand stops at once or in 50 ms. The script prints the energy of all waves and of a chamber at 12 s over that
at 1 s. Without losses the ratio is 1, less the loss of the shortest waves by interpolation between steps; with friction
or a valve it is below 1. Networks with a chamber run by rk4, ssp-rk2 or the trapezoidal rule, and again by Euler, with
which they grow. Runs that fvsolve itself reports as unreliable are counted separately.
"""

from time import perf_counter

import numpy as np
from measure import agree, machine, parser

import fvsolve
from fvsolve.case import load
from fvsolve.core.model.build import build
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run
from fvsolve.features.delay_lines.feature import lines_of

LAKE, FLOW, BEGIN, END = 6e6, 0.05, 1.0, 12.0
METHODS = ("euler", "rk4", "ssp-rk2", "trapezoid")


def network(random, kind):
    """Case with random numbers and the parts of a kind."""
    many = int(random.integers(3, 7))

    def pipe(a, b, shortest=2.0):
        part = {
            "type": "pipe",
            "from": a,
            "to": b,
            "diameter": float(random.uniform(0.1, 0.5)),
            "wave_speed": 1200.0,
            "length": float(np.exp(random.uniform(np.log(shortest), np.log(200.0)))),
            "cells": 40,
        }
        if kind == "friction":
            part["friction"] = {"model": "steady", "factor": float(random.uniform(0.01, 0.05))}
        return part

    nodes = {f"n{i}": {"type": "junction"} for i in range(many)} | {
        "lake": {"type": "reservoir", "pressure": LAKE}
    }
    last = float(random.choice([0.0, 0.05]))
    stop = {"start": 0.1, "duration": last, "value": [FLOW, 0.0]}
    nodes["n0"]["demand"] = (
        stop if last else {"time": [0.0, 0.1], "value": [FLOW, 0.0], "kind": "step"}
    )
    links = {"l0": pipe("lake", f"n{many - 1}", 20.0)}
    links |= {f"p{i}": pipe(f"n{i}", f"n{i + 1}") for i in range(many - 1)}
    a, b = random.choice(many, 2, replace=False)
    links["loop"] = pipe(f"n{a}", f"n{b}")
    if kind == "valve":
        nodes["sink"] = {"type": "reservoir", "pressure": LAKE}
        links["tap"] = {
            "type": "valve",
            "from": f"n{random.integers(many)}",
            "to": "sink",
            "area": 1e-4,
        }
    if kind == "chamber":
        nodes["vessel"] = {"type": "chamber", "volume": float(random.uniform(0.5, 5.0))}
        links["neck"] = pipe(f"n{random.integers(many)}", "vessel")
    numerics = {
        "pipe_model": "delay-line",
        "end": END,
        "step": float(random.choice([0.004, 0.01, 0.025])),
    }
    numerics["method"] = str(random.choice(METHODS))
    return {
        "schema": 1,
        "title": kind,
        "fluid": {"name": "Water", "law": "linear", "temperature": "20 degC"},
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": {"every": END, "fields": 0, "probes": []},
    }


def energy(case, end):
    """Energy of waves, flow and chamber at the end of a run, relative to the lake's pressure [J], and its `ok`."""
    model = build(load(case, {"numerics.end": end}))
    run = Run(model, fvsolve.initial_state(model), MemorySink(model), None)
    ended = run.go()
    out = run.run_data.evaluate(run.loop.t, run.loop.now, np.inf)[1]
    pipes, nodes, total = model.tables.pipes, model.tables.nodes, 0.0
    for line, (ahead, back) in zip(
        lines_of(model), run.run_data.along(run.loop.t, out).values(), strict=True
    ):
        pipe = pipes[line["pipe"]]
        ahead, back = ahead + 0.5 * pipe["flow"], back - 0.5 * pipe["flow"]
        length = float(pipe["speed"] * line["tau"] * line["stretches"])
        total += float(np.mean(ahead**2 + back**2)) * length / float(pipe["area"])
    stores = nodes[(nodes["y"] >= 0) & (nodes["stiffness"] > 0.0)]
    total += 0.5 * float(np.sum(stores["stiffness"] * run.loop.now[stores["y"]] ** 2))
    return total / 1000.0, ended.ok


def main():
    """Print the median and the worst ratio of each kind."""
    global END
    options = parser(__doc__)
    options.add_argument(
        "many",
        nargs="?",
        type=int,
        metavar="N",
        help="number of networks of each kind (default 1000, with --quick 1)",
    )
    given = options.parse_args()
    many = given.many or (1 if given.quick else 1000)
    if given.quick:
        END = 3.0
    print(machine("numpy", "numba"))
    for kind in ("lossless", "friction", "valve", "chamber", "chamber by Euler")[
        :: 2 if given.quick else 1
    ]:
        random, begun, ratios, told = np.random.default_rng(11), perf_counter(), np.zeros(many), 0
        for k in range(many):
            case = network(random, kind.split()[0])
            if kind.startswith("chamber"):
                case["numerics"]["method"] = (
                    "euler" if "Euler" in kind else str(random.choice(METHODS[1:]))
                )
            early, (late, ok) = energy(case, BEGIN)[0], energy(case, END)
            ratios[k] = late / early if ok else 0.0
            told += not ok
        print(
            f"{kind:18} {many} networks: {np.median(ratios):.4f} (median), {ratios.max():.4f} (worst, network "
            f"{np.argmax(ratios)}); {told} unreliable; {perf_counter() - begun:.0f} s",
            flush=True,
        )
        agree(
            f"energy at the end over that at {BEGIN:g} s, {kind}",
            ratios.max() if given.quick else 0.0,
            1.05,
        )


if __name__ == "__main__":
    main()
