"""The pattern of a model holds every slope that its rhs has, and differences by colour find them all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from truth.random_networks import random_network

import fvsolve
from fvsolve.model.sparsity import sparsity

CASES = sorted((Path(__file__).parent.parent / "cases").glob("*.toml"))
SCHEMES = ["upwind", "linear-upwind", "fromm", "central", "upwind3", "upwind5", "muscl", "weno5"]


def rates(model, t: float, y: np.ndarray) -> np.ndarray:
    """dydt and the supplies of all nodes : float64[n + nodes]."""
    dydt, out = model.evaluate(t, y)
    at = model.layout["supply"]
    return np.concatenate((dydt, out[at : at + len(model.node_names)]))


def random_state(model, rng) -> np.ndarray:
    return model.scale * rng.normal(scale=rng.choice([0.0, 0.02, 0.2]), size=model.y_size)


def strays(model, t: float, y: np.ndarray) -> float:
    """Greatest change of a rate by a state that its pattern has not, over the greatest by one that it has."""
    pattern, base = sparsity(model).toarray(), rates(model, t, y)
    change = np.empty(pattern.shape)
    for j in range(model.y_size):
        moved = y.copy()
        moved[j] += 1e-2 * model.scale[j]
        change[:, j] = np.abs(rates(model, t, moved) - base)
    most = np.max(change * pattern, axis=1)
    stray = np.max(change * ~pattern, axis=1)
    assert np.all(most[: model.y_size] > 0) or t > 0
    rounding = 1e-10 * np.max(most)  # rates that nothing moves
    return float(np.max(stray / np.maximum(most, rounding)))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("law", ["linear", "log"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(scheme, law):
    for seed in range(4):
        model = fvsolve.build(fvsolve.load(random_network(seed, scheme, law)))
        rng = np.random.default_rng(seed)
        for t in (0.0, 0.7, 2.3, 3.5):
            assert strays(model, t, random_state(model, rng)) < 1e-7


@pytest.mark.parametrize("path", CASES, ids=lambda p: p.stem)
def test_shipped_cases_keep_to_their_pattern(path):
    model = fvsolve.build(fvsolve.load(path))
    if model.y_size > 400:
        pytest.skip("long; random networks have the same parts")
    rng = np.random.default_rng(0)
    for t in (0.0, 0.5 * model.case.numerics.end):
        assert strays(model, t, random_state(model, rng)) < 1e-7
