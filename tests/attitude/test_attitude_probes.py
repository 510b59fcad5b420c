"""Attitude probes return the attitude of the case in every form, also where angles fail."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from reference.scenes import scene

from fvsolve import attitude as at
from fvsolve import build, load

ANGLES, PARAMETERS = ("roll", "pitch", "yaw"), ("eta", "eps_x", "eps_y", "eps_z")
KINDS = ("free", "fixed", "ball")
PITCHES = [0.3, -1.2, pi / 2 - 1e-6, pi / 2 - 1e-9, pi / 2 - 1e-14, pi / 2, -pi / 2, -pi / 2 + 1e-10]


def said(*attitudes: dict) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Name, angles and Euler parameters that probes of bodies read at the start, for each attitude and joint kind."""
    bodies = {
        f"b{k}_{kind}": {
            "type": "body", "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "joint": {"kind": kind, "attitude": given}
        }
        for k, given in enumerate(attitudes) for kind in KINDS
    }  # fmt: skip
    probes = [f"{name}.{one}" for name in bodies for one in ANGLES + PARAMETERS]
    model = build(load(scene(bodies, {}, 1.0, {"method": "rk4", "step": 0.1}, probes)))
    read = model.observe(0.0, model.start).reshape(len(bodies), 7)
    return [(name, row[:3], row[3:]) for name, row in zip(bodies, read, strict=True)]


def test_angles_and_parameters_say_the_rotation_of_the_case():
    found = said(*({"roll": 0.4, "pitch": pitch, "yaw": 1.1} for pitch in PITCHES))
    for pitch, (name, angles, e) in zip(np.repeat(PITCHES, len(KINDS)), found, strict=True):
        wanted = at.of_roll_pitch_yaw(0.4, pitch, 1.1)
        assert at.of_euler_parameters(e) == pytest.approx(wanted, abs=1e-14), name
        assert at.of_roll_pitch_yaw(*angles) == pytest.approx(wanted, abs=1e-13), (
            name
        )  # within 1e-12 of 90 deg yaw is 0
        if abs(pitch) < 1.5:
            assert angles == pytest.approx([0.4, pitch, 1.1], abs=1e-14)


def test_at_the_pole_yaw_is_zero_as_the_page_says():
    for _, angles, _ in said({"roll": 0.4, "pitch": pi / 2, "yaw": 1.1}):
        assert angles == pytest.approx([0.4 - 1.1, pi / 2, 0.0], abs=1e-12)


FORMS = [
    {"zyz": [0.3, 2.0, -1.0]},
    {"axis": [0.6, 0.0, 0.8], "angle": 2.5},
    {"euler_parameters": [0.5, -0.5, 0.5, 0.5]},
    {"matrix": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]},
    {"axis": [0, 1, 0], "angle": "180 deg"},
]
WANTED = [
    at.of_zyz(0.3, 2.0, -1.0),
    at.of_axis([0.6, 0.0, 0.8], 2.5),
    at.of_euler_parameters([0.5, -0.5, 0.5, 0.5]),
    np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    np.diag([-1.0, 1.0, -1.0]),
]


def test_every_form_of_the_case_is_the_attitude_of_the_run():
    for (name, angles, e), wanted in zip(said(*FORMS), np.repeat(WANTED, len(KINDS), axis=0), strict=True):
        assert at.of_euler_parameters(e) == pytest.approx(wanted, abs=1e-14), name
        assert at.of_roll_pitch_yaw(*angles) == pytest.approx(wanted, abs=1e-14), name
