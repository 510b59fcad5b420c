"""What the runs of a failure map are measured against: finer cells, an able method, and a second opinion. Runs them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.studies.failure.verdict import ranges_of
from fvsolve.studies.outcome import outcome, prepared

FINER = 3  # times the cells of the case
# Settings of the reference and of its check, by what the scene is.
WAVES = (
    {"scheme": "weno5", "method": "rk4", "courant": 0.6},
    {"scheme": "upwind5", "method": "ssp-rk3", "courant": 0.5},
)
CAVITIES = (
    {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk3", "courant": 0.5},
    {"scheme": "muscl", "limiter": "minmod", "method": "rk4", "courant": 0.5},
)
STIFF_WAVES = (
    {"scheme": "weno5", "method": "radau-iia-5", "rtol": 1e-6},
    {"scheme": "upwind5", "method": "rodas-5p", "rtol": 1e-6},
)
NO_PIPES = ({"method": "radau-iia-9", "rtol": 1e-9}, {"method": "dormand-prince", "rtol": 1e-9})
STIFF_NO_PIPES = ({"method": "radau-iia-9", "rtol": 1e-9}, {"method": "rodas-5p", "rtol": 1e-8})


@dataclass(frozen=True)
class Converged:
    """What runs are measured against.

    rows : float64[k, 1 + probes]  time [s], probes [SI]; doubt : mean distance of the check in ranges, worst probe
    """

    rows: np.ndarray
    probes: tuple[str, ...]
    doubt: float
    words: str


def converged(case, set: dict, stiff: bool) -> Converged:
    """Reference and check of a case with keys changed; `stiff`: its fastest rate is far above that of its waves.

    Raises FvsolveError where either does not finish.
    """
    model = prepared(case, set)
    if model.cells and model.cavitates:
        settings = CAVITIES
    elif model.cells:
        settings = STIFF_WAVES if stiff else WAVES
    else:
        settings = STIFF_NO_PIPES if stiff else NO_PIPES
    finer = {f"links.{pipe.name}.cells": FINER * pipe.cells for pipe in model.pipes}
    found = [_finished(case, {**set, **finer, **_numerics(one)}) for one in settings]
    rows = found[0].rows
    away = np.abs(found[1].rows[:, 1:] - rows[:, 1:]) / ranges_of(rows[:, 1:])
    words = [_words(one, model.cells) for one in settings]
    return Converged(rows, found[0].probes, float(away.mean(axis=0).max()), f"{words[0]}, checked by {words[1]}")


def _numerics(settings: dict) -> dict:
    return {f"numerics.{name}": value for name, value in settings.items()}


def _words(settings: dict, cells: int) -> str:
    control = next(f"{name} {settings[name]:g}" for name in ("courant", "rtol") if name in settings)
    scheme = " ".join(settings[name] for name in ("scheme", "limiter") if name in settings)
    where = f"{scheme} on {FINER * cells} cells with " if cells else ""
    return f"{where}{settings['method']} at {control}"


def _finished(case, set: dict):
    found = outcome(case, set)
    if not found.ok:
        raise FvsolveError(f"no reference to measure against: {found.reason}; shorten the run with --set numerics.end")
    return found
