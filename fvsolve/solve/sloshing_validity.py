"""Validity of the sloshing model: wave height of linear modes, and vertical acceleration of the carrying body."""

from __future__ import annotations

import numpy as np

from fvsolve.case import sloshing
from fvsolve.case.bodies import free_joints
from fvsolve.errors import Notice

SMALL_WAVE = 0.2  # wave height up to which a wave is small, as a fraction of the depth
WEIGHT_CHANGE = (
    0.1  # change of the water's weight by the motion of its body that may be neglected in its waves, as a fraction
)
WEIGHTLESS = "the water in {name} has no weight left at t = {when}; reduce the downward acceleration of its body"
ROUNDING = 1e-6  # fraction of the weight that counts as rounding
RISE, LOSS = slice(0, 2), slice(2, 4)


class SloshingCheck:
    """Record of the wave height of sloshing modes and of the change of the water's weight by moving bodies.

    Sloshing modes are computed under gravity, sloshing in cells under gravity and the motion of driven joints. Neither
    includes the acceleration of a body that moves freely.
    restart_data : float64[tanks, 4]  greatest rise as a fraction of the depth and its time [s], greatest change of
    weight as a fraction of the weight and its time [s]
    """

    def __init__(self, model) -> None:
        self.model, self.tanks = model, []
        case = model.case
        for name, mesh in {**case.meshes, **case.lumped}.items():
            basin = case.nodes[name]
            modal = basin.on is not None and basin.sloshing == "modes"
            free = basin.on is not None and basin.physics_type.has_modes and any(free_joints(basin.on, case.nodes))
            if modal or (free and not basin.lumped):
                place = np.array(basin.place) + basin.rotation[:, :2] @ mesh.centroid
                about = model.body_names.index(basin.on), place, basin.rotation[:, 2]
                self.tanks.append((name, modal, about, *(rises(model, name) if modal else ())))
        self.restart_data = np.zeros((len(self.tanks), 4))

    def check(self, t: float, y: np.ndarray) -> str:
        """Check state y at time t [s], and update the record; returns the reason to stop the run, or ""."""
        if not self.tanks:
            return ""
        out = self.model.evaluate(t, y)[1]
        for (name, modal, about, *lifting), record in zip(self.tanks, self.restart_data, strict=True):
            if modal:
                keep_greatest(record[RISE], rise(y, *lifting), t)
            weight, reference = self.weight(out, *about, modal)
            if weight <= ROUNDING * reference:
                return f"stopped: {WEIGHTLESS.format(name=name, when=self.model.case.amount(t, 'time', 6))}"
            keep_greatest(record[LOSS], abs(weight / reference - 1.0), t)
        return ""

    def weight(
        self, out: np.ndarray, i: int, place: np.ndarray, normal: np.ndarray, modal: bool
    ) -> tuple[float, float]:
        """(effective gravity along the normal of a basin's bed, gravity that its waves use) [m/s2].

        out : output array of the right-hand side; i : number of the body; place, normal : centre of the basin [m] and
        unit normal of its bed in the axes of the body; modal : True for sloshing modes
        """
        from fvsolve.kernels.dtypes import BODY_OUT
        from fvsolve.kernels.mechanism import body_layout

        row = out[int(self.model.layout["body"]) + BODY_OUT * i :][:BODY_OUT]
        turn, gravity = row[body_layout.ATTITUDE :][:9].reshape(3, 3), self.model.case.gravity
        spin, arm, up = row[body_layout.SPIN :][:3], turn @ place, turn @ normal
        down = np.cross(spin, np.cross(spin, arm)) + (0.0, 0.0, gravity)
        weight, reference = (
            up @ (row[a:][:3] + np.cross(row[b:][:3], arm) + down)
            for a, b in ((body_layout.ACCELERATION, body_layout.SPIN_RATE), (body_layout.BIAS, body_layout.SPIN_BIAS))
        )
        return float(weight), gravity if modal else float(reference)

    def notices(self) -> list[Notice]:
        """Notices for waves that were not small, and for changes of weight that the waves neglect."""
        notices, amount = [], self.model.case.amount
        for (name, *_), (height, rise_time, change, change_time) in zip(
            self.tanks, self.restart_data.tolist(), strict=True
        ):
            if height > SMALL_WAVE:
                text = f"{name}: at {amount(rise_time, 'time')} its water rises by {height:.2g} of its depth, but "
                text += 'modes are linear; sloshing = "cells" computes high waves of shallow water'
                notices.append(Notice("sloshing", f"nodes.{name}", text, "sloshing", height, SMALL_WAVE))
            if change > WEIGHT_CHANGE:
                text = f"{name}: at {amount(change_time, 'time')} the vertical acceleration of its body changes the "
                text += f"weight of its water by a fraction of {change:.2g}; the waves do not include this change"
                notices.append(Notice("weight", f"nodes.{name}", text, None, change, WEIGHT_CHANGE))
        return notices


def rises(model, name: str) -> tuple:
    """Arguments `at`, `start`, `lifts` and `is_round` of the function `rise` for the basin `name`."""
    case = model.case
    basin, mesh = case.nodes[name], case.lumped[name]
    modes = sloshing.modes_of(basin, mesh, case.properties.density, case.gravity)
    rows = [model.tables.bodies[model.body_names.index(sloshing.mode_body_name(name, mode))] for mode in modes]
    lifts = np.zeros((2, len(modes)))
    lifts[[mode.along for mode in modes], range(len(modes))] = [mode.rise for mode in modes]
    at, start = [int(row["y"]) for row in rows], np.array([row["start"][0] for row in rows])
    return np.array(at), start, lifts / sloshing.depth_of(basin, mesh), sloshing.outline_of(mesh).is_round


def rise(y: np.ndarray, at: np.ndarray, start: np.ndarray, lifts: np.ndarray, is_round: bool) -> float:
    """Greatest rise of the water at the wall of a basin, as a fraction of its depth.

    at : int64[modes]  indices of the amplitudes of the sloshing modes in the state y
    start : float64[modes]  initial amplitudes
    lifts : float64[2, modes]  rise per amplitude over the depth, of modes along and across the basin
    is_round : True for a round basin, where the rises in both directions add up as a vector
    """
    along, across = np.abs(lifts @ (start + y[at]))
    return float(np.hypot(along, across)) if is_round else float(along + across)


def keep_greatest(record: np.ndarray, value: float, t: float) -> None:
    """Store `value` and its time t [s] in `record` if it is greater than the value there."""
    if value > record[0]:
        record[:] = value, t
