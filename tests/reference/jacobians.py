"""Rates of a model, random states, and changes of rates outside the pattern of the Jacobian."""

import numpy as np

from fvsolve.core.model.jacobian_pattern import jacobian_pattern


def rates(model, t: float, y: np.ndarray) -> np.ndarray:
    """Rates of all states and of the mass ledger : float64[n + ledger]."""
    dydt, out = model.evaluate(t, y)
    at = model.layout["supply"]
    return np.concatenate((dydt, out[at : at + model.ledgers]))


def random_state(model, rng) -> np.ndarray:
    return model.scale * rng.normal(scale=rng.choice([0.0, 0.02, 0.2]), size=model.y_size)


def stray(model, t: float, y: np.ndarray) -> float:
    """Greatest change of a rate by a state outside the pattern, over the greatest change by a state inside it."""
    states = np.arange(model.y_size)
    if states.size > 2000:  # sample of the states of a basin
        states = np.random.default_rng(states.size).choice(states, 100, replace=False)
    pattern, base = jacobian_pattern(model)[:, states].toarray(), rates(model, t, y)
    change = np.empty(pattern.shape)
    for k, j in enumerate(states):
        moved = y.copy()
        moved[j] += 1e-2 * model.scale[j]
        change[:, k] = np.abs(rates(model, t, moved) - base)
    known = np.max(change * pattern, axis=1)
    rounding = max(1e-10 * np.max(known), 1e-300)  # for rates that do not change
    return float(np.max(np.max(change * ~pattern, axis=1) / np.maximum(known, rounding)))
