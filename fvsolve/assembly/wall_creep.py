"""Kelvin-Voigt elements of creeping pipe walls: coefficients, states, and the limit that they set to steps."""

from __future__ import annotations

import numpy as np


def add_creep(draft, name: str, link, row) -> None:
    """Add coefficients and states of a pipe's Kelvin-Voigt elements; add faults where creep is not supported."""
    if not link.creep_elements:
        return
    place = f"links.{name}.wall.creep"
    if draft.case.scalars:
        draft.fault(place, "takes up liquid, whose scalars are not computed; remove either the scalars or the creep")
    if any(getattr(draft.case.places[end], "on", None) for end in link.ports.values()):
        draft.fault(place, "is not supported for a pipe on a body; remove the creep")
    numbers = np.column_stack(gains(link, draft.fluid.density, float(row["speed"])))
    row["elements"], row["element"] = len(numbers), len(draft.floats)
    draft.floats += numbers.ravel().tolist()
    names = [f"{name}.creep{k}[{i}]" for k in range(len(numbers)) for i in range(link.cells)]
    row["strain"] = draft.states(names, 1e5 * row["admittance"])


def gains(link, density: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of every Kelvin-Voigt element of a pipe : (gain G / tau [1/s], rate 1 / tau [1/s]).

    tau : retardation time [s]. G is the final volume that the element takes up, relative to the volume that wall and
    liquid take up elastically: G = c D K J / e, with restraint factor c, diameter D, effective bulk modulus K = rho
    a^2, creep compliance J, wall thickness e.
    """
    growth, time = np.array(link.creep_elements).T
    return growth * density * speed**2 / time, 1.0 / time


def elements(floats: np.ndarray, row) -> np.ndarray:
    """Gain and rate of every Kelvin-Voigt element of a pipe [1/s] : float64[elements, 2]."""
    return floats[row["element"] : row["element"] + 2 * row["elements"]].reshape(-1, 2)


def mass_in_creep(floats: np.ndarray, row, y: np.ndarray) -> float:
    """Mass in the volume that a wall has gained by creep since the start [kg]."""
    total, n = 0.0, int(row["cells"])
    for k, (gain, rate) in enumerate(elements(floats, row)):
        at = row["strain"] + k * n
        total += gain / rate * float(np.sum(y[at : at + n]))
    return total * float(row["dx"] / row["speed"])


def limit_creep_step(draft, unsteady: dict) -> dict[str, dict]:
    """Increase the rate that limits explicit steps to the greatest rate of a pipe with creep; return facts for `check`.

    unsteady : result of `add_terms`
    The result is name of a pipe -> facts, with the wave speed after complete creep as `slow_speed` [m/s].
    """
    result, settings = {}, draft.tables.settings[0]
    for name, row in zip(draft.pipe_names, draft.pipe_table, strict=True):
        if row["elements"] == 0:
            continue
        gain, rate = elements(draft.tables.floats, row).T
        waves = unsteady.get(name, {}).get("rate", row["speed"] / row["dx"] * row["rate_factor"])
        fastest = float(max(waves, 0.5 * rate.max()) + 0.5 * gain.sum())
        settings["rate"] = max(settings["rate"], fastest)
        slow = float(row["speed"]) / float(np.sqrt(1.0 + (gain / rate).sum()))
        result[name] = {"elements": len(gain), "slow_speed": slow, "rate": fastest}
    return result
