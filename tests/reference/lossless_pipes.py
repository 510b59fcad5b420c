"""Frictionless pipe, its Jacobian in the energy norm, and limits of the Courant number by powers of its step."""

import math

import numpy as np

from fvsolve.core.model.energy_norm import energy_weights
from fvsolve.core.steppers import method_named, stability_function
from fvsolve.studies.outcome import study_model
from reference.scenes import junction, lake, pipe, scene

LENGTH, DIAMETER, SPEED = 100.0, 0.3, 1000.0
THRESHOLD = 1e3  # growth that counts as failure


def lossless(cells: int, scheme: str, method: str, h: float, steps: int = 1):
    """Model of a frictionless pipe from a lake to a dead end, for some steps of h [s]."""
    nodes = {"lake": lake(50.0), "end": junction()}
    links = {"main": pipe("lake", "end", LENGTH, DIAMETER, SPEED, cells)}
    numerics = {"scheme": scheme, "method": method, "step": h}
    return study_model(scene(nodes, links, steps * h, numerics, ["end.pressure"], steps * h))


def step_matrix(method: str, matrix: np.ndarray) -> np.ndarray:
    """R(h J) of an explicit method by its tableau: 1 + b^T (1 - z A)^-1 1 z is a polynomial."""
    powers, found = np.eye(len(matrix)), np.zeros_like(matrix)
    for coefficient in stability_function(method_named(method)).numerator.coefficients:
        found += float(coefficient) * powers
        powers = powers @ matrix
    return found


def scaled(model, jacobian: np.ndarray) -> np.ndarray:
    """Jacobian in variables whose Euclidean norm is the energy norm."""
    root = np.sqrt(energy_weights(model))
    return root[:, None] * jacobian / root[None, :]


def growth(method: str, matrix: np.ndarray, steps: int) -> float:
    """Norm ||R(h J)^n|| after n steps."""
    with np.errstate(all="ignore"):
        power = np.linalg.matrix_power(step_matrix(method, matrix), steps)
    return float(np.linalg.norm(power, 2)) if np.all(np.isfinite(power)) else math.inf


def courant_limit(method: str, unit: np.ndarray, steps: int) -> float:
    """Greatest Courant number C with ||R(C J)^n|| <= 1e3, J in travel times of a cell."""
    low, high = 0.0, 8.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if growth(method, middle * unit, steps) <= THRESHOLD else (low, middle)
        )
    return low
