"""Elements of walls that creep: their numbers, states and what they ask of a step. Knows drafts; steps nothing."""

from __future__ import annotations

import numpy as np


def add_creep(draft, name: str, link, row) -> None:
    """Numbers and states of a pipe's Kelvin-Voigt elements; faults where its walls may not creep."""
    if not link.yielding:
        return
    place = f"links.{name}.wall.creep"
    if draft.case.scalars:
        draft.fault(place, "takes up liquid, and scalars are not followed into it; keep one of scalars and creep")
    if any(getattr(draft.case.places[end], "on", None) for end in link.ports.values()):
        draft.fault(place, "of a pipe that rides on a body is not known")
    numbers = np.column_stack(gains(link, draft.fluid.density, float(row["speed"])))
    row["elements"], row["element"] = len(numbers), len(draft.floats)
    draft.floats += numbers.ravel().tolist()
    names = [f"{name}.creep{k}[{i}]" for k in range(len(numbers)) for i in range(link.cells)]
    row["strain"] = draft.states(names, 1e5 * row["admittance"])


def gains(link, density: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """(G / tau, 1 / tau) of every element [1/s]; G = c D K J / e is what it takes over what the elastic wall and the
    liquid take together."""
    growth, time = np.array(link.yielding).T
    return growth * density * speed**2 / time, 1.0 / time


def elements(floats: np.ndarray, row) -> np.ndarray:
    """Pairs of gain and rate of a pipe : float64[elements, 2]."""
    return floats[row["element"] : row["element"] + 2 * row["elements"]].reshape(-1, 2)


def held_by_wall(floats: np.ndarray, row, y: np.ndarray) -> float:
    """Mass that a wall has taken up by creep since the profile [kg]."""
    total, n = 0.0, int(row["cells"])
    for k, (gain, rate) in enumerate(elements(floats, row)):
        at = row["strain"] + k * n
        total += gain / rate * float(np.sum(y[at : at + n]))
    return total * float(row["dx"] / row["speed"])


def pace_creep(draft, remembered: dict) -> dict[str, dict]:
    """What `check` shows of creep; explicit steps follow the quickest element beside waves and unsteady friction."""
    found, settings = {}, draft.tables.settings[0]
    for name, row in zip(draft.pipe_names, draft.pipe_table, strict=True):
        if row["elements"] == 0:
            continue
        gain, rate = elements(draft.tables.floats, row).T
        waves = remembered.get(name, {}).get("rate", row["speed"] / row["dx"] * row["quicker"])
        quickest = float(max(waves, 0.5 * rate.max()) + 0.5 * gain.sum())
        settings["rate"] = max(settings["rate"], quickest)
        slow = float(row["speed"]) / float(np.sqrt(1.0 + (gain / rate).sum()))
        found[name] = {"elements": len(gain), "slow_speed": slow, "rate": quickest}
    return found
