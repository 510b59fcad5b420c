"""What a run says of a body's attitude is what the case said, in every form, and where angles fail too."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from truth.scenes import scene

from fvsolve import attitude as at
from fvsolve import build, load

ANGLES, PARAMETERS = ("roll", "pitch", "yaw"), ("eta", "eps_x", "eps_y", "eps_z")
PITCHES = [0.3, -1.2, pi / 2 - 1e-6, pi / 2 - 1e-9, pi / 2 - 1e-14, pi / 2, -pi / 2, -pi / 2 + 1e-10]


def said(given: dict, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """(angles, Euler parameters) that probes of a body read at the start."""
    joint = {"kind": kind, "attitude": given}
    body = {"type": "body", "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "joint": joint}
    probes = [f"one.{name}" for name in ANGLES + PARAMETERS]
    model = build(load(scene({"one": body}, {}, 1.0, {"method": "rk4", "step": 0.1}, probes)))
    read = model.observe(0.0, model.start)
    return read[:3], read[3:]


@pytest.mark.parametrize("kind", ["free", "fixed", "ball"])
@pytest.mark.parametrize("pitch", PITCHES)
def test_angles_and_parameters_say_the_rotation_of_the_case(pitch, kind):
    wanted = at.of_roll_pitch_yaw(0.4, pitch, 1.1)
    angles, e = said({"roll": 0.4, "pitch": pitch, "yaw": 1.1}, kind)
    assert at.of_euler_parameters(e) == pytest.approx(wanted, abs=1e-14)
    assert at.of_roll_pitch_yaw(*angles) == pytest.approx(wanted, abs=1e-13)  # within 1e-12 of the pole yaw is 0
    if abs(pitch) < 1.5:
        assert angles == pytest.approx([0.4, pitch, 1.1], abs=1e-14)


def test_at_the_pole_yaw_is_zero_as_the_page_says():
    angles, _ = said({"roll": 0.4, "pitch": pi / 2, "yaw": 1.1}, "fixed")
    assert angles == pytest.approx([0.4 - 1.1, pi / 2, 0.0], abs=1e-12)


FORMS = {
    "zyz": {"zyz": [0.3, 2.0, -1.0]},
    "axis": {"axis": [0.6, 0.0, 0.8], "angle": 2.5},
    "Euler parameters": {"euler_parameters": [0.5, -0.5, 0.5, 0.5]},
    "matrix": {"matrix": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]},
    "half a turn": {"axis": [0, 1, 0], "angle": "180 deg"},
}
WANTED = {
    "zyz": at.of_zyz(0.3, 2.0, -1.0),
    "axis": at.of_axis([0.6, 0.0, 0.8], 2.5),
    "Euler parameters": at.of_euler_parameters([0.5, -0.5, 0.5, 0.5]),
    "matrix": np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "half a turn": np.diag([-1.0, 1.0, -1.0]),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_the_case_is_the_attitude_of_the_run(form):
    for kind in ("free", "fixed"):
        angles, e = said(FORMS[form], kind)
        assert at.of_euler_parameters(e) == pytest.approx(WANTED[form], abs=1e-14)
        assert at.of_roll_pitch_yaw(*angles) == pytest.approx(WANTED[form], abs=1e-14)
