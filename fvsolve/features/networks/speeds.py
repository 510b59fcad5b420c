"""Speeds of shafts at the start, where the flow through displacement machines sets their torque."""

from __future__ import annotations

import numpy as np

from fvsolve.core.assembly.features import with_slot
from fvsolve.core.model.build import flags_at_start
from fvsolve.core.model.steady_start import SteadyStart
from fvsolve.features.networks.start import unknown_speeds

# Newton iterations for speeds at the start; change of a speed for differences [rad/s]
TURNS, DIFFERENCE = 40, 1e-6


def balanced_speeds(own, draft, trial) -> dict[int, float]:
    """Speeds of shafts with displacement machines at which all torques balance : column of the network -> speed.

    Standstill comes first. Adds a fault if no speeds are found.
    own : feature of the draft; trial : function that fills the steady start into a draft, with these speeds
    """
    columns = unknown_speeds(own, draft, SteadyStart(draft))
    if not columns:
        return own.start_speeds

    def rates(speeds: np.ndarray) -> np.ndarray:
        copy = draft.copy_for(draft.case)
        feature = with_slot(copy.features, own.slot)
        feature.start_speeds = dict(zip(columns, map(float, speeds), strict=True))
        trial(copy)
        network = feature.network
        starts = network.arrays(network.mode_of(flags_at_start(copy)))[1]
        return np.array([starts[list(network.states).index(column)] for column in columns])

    speeds = np.zeros(len(columns))
    found = rates(speeds)
    for _ in range(TURNS):
        if not found.any():
            return dict(zip(columns, map(float, speeds), strict=True))
        size = np.where(found != 0.0, np.sign(found), 1.0) * DIFFERENCE * (1.0 + np.abs(speeds))
        slopes = np.array(
            [(rates(speeds + change) - found) / change.sum() for change in np.diag(size)]
        ).T
        step = np.linalg.lstsq(slopes, -found, rcond=None)[0]
        for halvings in range(30):
            trial_speeds = speeds + 0.5**halvings * step
            after = rates(trial_speeds)
            if np.max(np.abs(after)) <= np.max(np.abs(found)):
                break
        if np.all(np.abs(trial_speeds - speeds) <= 1e-15 * np.abs(speeds)):
            return dict(zip(columns, map(float, speeds), strict=True))
        speeds, found = trial_speeds, after
    store = own.network.stores[columns[0]]
    draft.fault(
        store.part, "no speed balances the torques on it at the start; give the key `initial_speed`"
    )
    draft.check()
    return {}
