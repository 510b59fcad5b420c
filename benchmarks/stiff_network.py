"""Cost of a step of Newton's method in networks of pipes, compared with SuperLU and with figures of developing.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from measure import best
from networks import WATER
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

import fvsolve
from fvsolve.case import load
from fvsolve.core.model import RunData, build
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.run_handle import RHS_CALL, addresses, call_rhs, evaluate, open_run
from fvsolve.core.steppers.structure import Structure, differences
from fvsolve.core.steppers.tableau import method_named
from fvsolve.jit import njit

SIZES = ((10, 100), (50, 200))  # (pipes, cells of each)
SCHEMES = ("upwind", "upwind5")
# two stages, solved one after the other with one factorisation
COURANT, METHOD = 20.0, "alexander-2"
# [us] for 10 pipes of 100 cells, 2 000 unknowns, first order (developing.md)
STUDY = {"factor": 71.0, "solve": 18.0}
GOAL = 1.5  # greatest ratio to the time of the study
BUDGET = 0.2  # time of a measurement [s]


def network(pipes: int, cells: int, scheme: str, **numerics) -> dict:
    """Case of pipes between two lakes and junctions, a ring with chords; the demand of one junction stops."""
    nodes = {f"n{i}": {"type": "junction"} for i in range(pipes // 2 + 1)}
    count = len(nodes)
    nodes |= {
        name: {"type": "reservoir", "head": head} for name, head in (("high", 60.0), ("low", 50.0))
    }
    nodes[f"n{count // 2}"]["demand"] = {"start": 0.2, "duration": 0.5, "value": [0.02, 0.0]}
    ends = [("high", "n0"), ("low", f"n{count - 1}")] + [
        (f"n{i}", f"n{(i + 1) % count}") for i in range(count)
    ]
    ends += [(f"n{i}", f"n{(i + 3) % count}") for i in range(pipes - len(ends))]
    links = {
        f"p{k}": {
            "type": "pipe",
            "from": a,
            "to": b,
            "length": 400.0 + 10.0 * k,
            "diameter": 0.3,
            "wave_speed": 1000.0,
            "friction": {"model": "steady", "factor": 0.02},
            "cells": cells,
        }
        for k, (a, b) in enumerate(ends)
    }
    made = {
        "schema": 1,
        "title": f"{pipes} pipes",
        "fluid": dict(WATER),
        "nodes": nodes,
        "links": links,
    }
    made["numerics"] = {
        "end": 5.0,
        "scheme": scheme,
        "method": METHOD,
        "courant": COURANT,
        **numerics,
    }
    return made | {"output": {"every": 0.05, "fields": 0, "probes": ["n0.pressure"]}}


@dataclass(frozen=True)
class Costs:
    """Wall times of the parts of a step of Newton's method [us]."""

    rhs: float
    jacobian: float
    factor: float
    solve: float


def network_table(quick: bool) -> None:
    """Print the times of the parts of a Newton step, and of whole runs."""
    title = f"{'factor':>9} {'study':>6} {'SuperLU':>8} {'solve':>8} {'study':>6} {'SuperLU':>8} {'f':>7} {'df/dy':>8}"
    print(
        f"\nNetworks at Courant {COURANT:g} [us]; study: times the figures of developing.md, scaled by the unknowns"
    )
    print(f"  {'pipes':>5} {'unknowns':>8} {'scheme':8} {'kind':7} {title}")
    global BUDGET
    sizes, schemes, BUDGET = (SIZES[:1], SCHEMES[:1], 0.0) if quick else (SIZES, SCHEMES, BUDGET)
    for pipes, cells in sizes:
        for scheme in schemes:
            model = build(load(network(pipes, cells, scheme)))
            structure, costs, matrix = parts(model)
            peer = superlu(matrix)  # factor, solve
            scaled = {name: cost * model.y_size / 2000 for name, cost in STUDY.items()}
            row = f"{pipes:5d} {model.y_size:8d} {scheme:8} {structure.kind:7}"
            row += f" {costs.factor:9.1f} {costs.factor / scaled['factor']:6.2f} {peer[0]:8.0f}"
            row += f" {costs.solve:8.1f} {costs.solve / scaled['solve']:6.2f} {peer[1]:8.0f}"
            print(f"  {row} {costs.rhs:7.2f} {costs.jacobian:8.1f}", flush=True)
            whole(pipes, cells, scheme, costs, scaled)


def parts(model) -> tuple[Structure, Costs, csc_array]:
    """Structure of the model's Jacobian, costs of the parts of a step at the start, and the matrix factored there."""
    structure, rhs = Structure(jacobian_pattern(model)), model.functions.rhs
    factor, solve = structure.functions()
    slate = RunData(model)
    shape, n, m, handle = structure.shape, structure.n, structure.m, slate.handle
    where, out, y = int(model.layout["supply"]), model.new_out(), np.zeros(n)
    stepper = Integrator(method_named(METHOD), n, m, lambda: structure, model.scale.copy())
    stepper.out, stepper.calls, stepper.control["ledger_offset"] = (
        out,
        addresses((rhs,) * (RHS_CALL + 1)),
        where,
    )
    jacobian, store = stepper.jacobian, np.zeros(structure.store_size)
    f, f_work, x = np.zeros((3, n))
    step = COURANT * min(p.length / p.cells / p.wave_speed for p in model.pipes)
    shift = 1.0 / (step * (1.0 - np.sqrt(0.5)))
    rhs(0.0, y, f, out, handle)
    supply = out[where : where + m].copy()
    at = int(addresses((rhs,))[0])
    given = (handle, stepper.handle(False), 0.0, y, f, supply, f_work)
    change(*given)
    if factor(shape, jacobian, shift, store) != 0:
        raise SystemExit("no pivot")

    def fresh():
        x[:] = f
        solve(shape, store, x)

    many(at, 1, y, f_work, out, handle)
    calls = 1000.0 * best(lambda: many(at, 1000, y, f_work, out, handle), 0.5 * BUDGET)
    costs = Costs(
        rhs=calls,
        jacobian=1e6 * best(lambda: change(*given), 0.5 * BUDGET),
        factor=1e6 * best(lambda: factor(shape, jacobian, shift, store), BUDGET),
        solve=1e6 * best(fresh, BUDGET),
    )
    square = csc_array(
        (jacobian, structure.pattern.indices, structure.pattern.indptr), shape=(n + m, n)
    )[:n]
    matrix = (shift * eye_array(n) - square).tocsc()
    wanted = splu(matrix).solve(f)
    fresh()
    if np.abs(x - wanted).max() > 1e-8 * np.abs(wanted).max():
        raise SystemExit("the solution is not SuperLU's")
    return structure, costs, matrix


@njit
def many(at, times, y, dydt, out, handle):
    """Evaluate the right-hand side at an address `times` times."""
    for _ in range(times):
        call_rhs(at, 0.0, y, dydt, out, handle)


@njit
def change(handle, run, t, y, f, supply, f_work):
    """Compute the Jacobian by differences of the right-hand side of a run."""
    differences(evaluate, handle, open_run(run), t, y, f, supply, f_work)


def superlu(matrix: csc_array) -> tuple[float, float]:
    """Times to factor and to solve by SciPy's SuperLU, ordered for symmetric patterns [us]."""
    options = {
        "permc_spec": "MMD_AT_PLUS_A",
        "options": {"SymmetricMode": True},
        "diag_pivot_thresh": 0.0,
    }
    made, b = splu(matrix, **options), np.ones(matrix.shape[0])
    return 1e6 * best(lambda: splu(matrix, **options), BUDGET), 1e6 * best(
        lambda: made.solve(b), 0.5 * BUDGET
    )


def whole(pipes: int, cells: int, scheme: str, costs: Costs, scaled: dict) -> None:
    """Print the time of a Newton iteration in a run, and the ratio of the run to the figures of the study."""
    runs = [fvsolve.run(network(pipes, cells, scheme)) for _ in range(3)]
    if not runs[0].ok:
        raise SystemExit(runs[0].reason)
    found = min(runs, key=lambda r: r.summary["seconds"]).summary
    counts = {
        name: found[name] for name in ("steps", "rhs", "jacobians", "factorisations", "newton")
    }
    wall = 1e6 * found["seconds"]
    asked = (
        counts["newton"] * scaled["solve"]
        + counts["factorisations"] * scaled["factor"]
        + counts["rhs"] * costs.rhs
    )
    said = ", ".join(f"{count} {name}" for name, count in counts.items())
    print(f"    {METHOD}, {said}: {wall / counts['newton']:.1f} us an iteration in all; ", end="")
    print(f"{wall / asked:.2f} times the study's figures for these, goal {GOAL}: ", end="")
    print("met" if wall <= GOAL * asked else "missed", flush=True)
