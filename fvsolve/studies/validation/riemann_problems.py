"""Riemann problems of a pipe with liquid and cavities: mean error of the mass along the pipe, beside exact solutions.

A row names a problem; its value is the mean error of the mass over its range at the end, in the part of the pipe that
no wave from the ends has reached.
"""

from pathlib import Path

import numpy as np

from fvsolve.case import load
from fvsolve.case.validation_table import Validation
from fvsolve.core.model.build import build
from fvsolve.core.solve import advance, initial_state
from fvsolve.exact.mixture_riemann import Mixture, RiemannProblem
from fvsolve.studies.validation.library import Computed

AMBIENT, HIGH, VAPOR = 101325.0, 3e5, 2000.0  # [Pa]
DENSITY, BULK_MODULUS, AIR = 1000.0, 1e7, 1.2e-3  # [kg/m3], [Pa], [-]
LENGTH, DIAMETER, CELLS, END = 100.0, 0.5, 800, 0.2  # [m], [m], [-], [s]
SAMPLES = 16  # places of a cell at which the exact mass is evaluated
GAS = AIR / (1.0 - AIR) * (AMBIENT - VAPOR)
EXACT = Mixture(DENSITY, BULK_MODULUS, AMBIENT, VAPOR, GAS, 0.0, np.pi / 4.0 * DIAMETER**2)
FOAM = EXACT.floor + EXACT.gas  # about half gas
PROBLEMS = {  # pressure [Pa] and velocity [m/s] on the left and on the right
    "cavity-opens": ((HIGH, -5.0), (HIGH, 5.0)),
    "cavity-shuts": ((FOAM, 5.0), (FOAM, -5.0)),
    "liquid-into-foam": ((HIGH, 3.0), (FOAM, 0.0)),
    "foam-into-liquid": ((FOAM, 0.0), (HIGH, -3.0)),
    "liquid": ((2.0 * HIGH, 1.0), (HIGH, 0.0)),
}


def compute(validation: Validation, folder: Path) -> dict[str, Computed]:
    """Errors of all problems, and those on half as many cells."""
    result = {}
    for name, states in PROBLEMS.items():
        (error, line), (coarser, _) = (compared(*states, cells) for cells in (CELLS, CELLS // 2))
        result[name] = Computed(
            error, coarser, text=f"on {CELLS // 2} cells {coarser:.2e}", lines=line
        )
    return result


def pipe(cells: int) -> dict:
    """Case of a stiff pipe at rest between a reservoir and a closed end."""
    fluid = {
        "name": "user",
        "density": DENSITY,
        "bulk_modulus": BULK_MODULUS,
        "viscosity": 1e-3,
        "law": "mixture",
        "vapor_pressure": VAPOR,
        "pressure": AMBIENT,
        "air_fraction": AIR,
        "cavitation": True,
    }
    main = {
        "type": "pipe",
        "from": "left",
        "to": "right",
        "length": LENGTH,
        "diameter": DIAMETER,
        "wall": "rigid",
        "friction": {"model": "none"},
        "cells": cells,
    }
    numerics = {
        "end": 10.0,
        "scheme": "muscl",
        "limiter": "minmod",
        "method": "ssp-rk3",
        "courant": 0.5,
    }
    nodes = {"left": {"type": "reservoir", "pressure": HIGH}, "right": {"type": "junction"}}
    return {"fluid": fluid, "nodes": nodes, "links": {"main": main}, "numerics": numerics}


def compared(
    left: tuple[float, float], right: tuple[float, float], cells: int
) -> tuple[float, dict[str, np.ndarray]]:
    """(mean error of the mass over its range, lines of the mass per length) of a problem; left, right : states"""
    model = build(load(pipe(cells)))
    state, row = initial_state(model), model.tables.pipes[0]
    base = model.tables.profile[row["center"] : row["center"] + cells]
    half = np.arange(cells) < cells // 2
    mass = np.where(half, EXACT.m(left[0]), EXACT.m(right[0]))
    excess, flow = row["speed"] * (mass - base), mass * np.where(half, left[1], right[1])
    # the two waves of each cell
    state.y[:cells], state.y[cells:] = (excess + flow) / 2, (excess - flow) / 2
    state = advance(model, state, END)
    found = base + (state.y[:cells] + state.y[cells:]) / row["speed"]
    x = (np.arange(cells) + 0.5) * LENGTH / cells - LENGTH / 2
    at, exact = RiemannProblem(EXACT, left, right).solution(), np.zeros(cells)
    for share in (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5:
        exact += EXACT.m(at((x + share * LENGTH / cells) / END)[0]) / SAMPLES
    inner = np.abs(x) < LENGTH / 4
    lines = {
        name: np.column_stack([x, values])[inner]
        for name, values in (("exact", exact), ("computed", found))
    }
    return float(np.mean(np.abs(found - exact)[inner]) / np.ptp(exact[inner])), lines
