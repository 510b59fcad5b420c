"""How high water in modes rises: they are of waves that are small beside its depth. Knows modes; knows no steps."""

from __future__ import annotations

import numpy as np

from fvsolve.case import sloshing
from fvsolve.errors import Notice

SMALL = 0.2  # share of the depth up to which a wave is small


class Swings:
    """The greatest rise of water in modes, tank by tank.

    kept : float64[tanks, 2]  its share of the depth and when that was
    """

    def __init__(self, model) -> None:
        case, self.tanks = model.case, []
        for name, mesh in case.lumped.items():
            basin = case.nodes[name]
            if basin.sloshing != "modes":
                continue
            every = sloshing.made(basin, mesh, case.properties.density, case.gravity)
            rows = [model.tables.bodies[model.body_names.index(sloshing.slider(name, one))] for one in every]
            lifts = np.zeros((2, len(every)))
            lifts[[one.along for one in every], range(len(every))] = [one.rise for one in every]
            lifts /= sloshing.depth_of(basin)
            at, start = [int(row["y"]) for row in rows], np.array([row["start"][0] for row in rows])
            self.tanks.append((name, np.array(at), start, lifts, sloshing.outline_of(mesh).is_round))
        self.kept = np.zeros((len(self.tanks), 2))

    def look(self, t: float, y: np.ndarray) -> None:
        """At a state."""
        for (_, at, start, lifts, is_round), kept in zip(self.tanks, self.kept, strict=True):
            along, across = np.abs(lifts @ (start + y[at]))
            rise = float(np.hypot(along, across)) if is_round else float(along + across)
            if rise > kept[0]:
                kept[:] = rise, t

    def notices(self) -> list[Notice]:
        """Waves that were not small."""
        found = []
        for (name, *_), (rise, t) in zip(self.tanks, self.kept.tolist(), strict=True):
            if rise > SMALL:
                text = f"{name}: at {t:.4g} s its water rises by {rise:.2g} of its depth, and modes are linear; "
                text += 'sloshing = "cells" knows great waves where water is shallow'
                found.append(Notice("sloshing", f"nodes.{name}", text, "sloshing", rise, SMALL))
        return found
