"""Trees of bodies against pinocchio: accelerations, mass matrix, energies, through the program's own rates."""

from __future__ import annotations

import numpy as np
import pytest
from truth.scenes import GRAVITY, scene
from truth.trees import pinocchio_of, random_tree

import fvsolve
from fvsolve.kernels.mechanism.room import ACCELERATION, ATTITUDE, PLACE, TURNING
from fvsolve.kernels.records import BODY_OUT

pytest.importorskip("pinocchio", reason="pinocchio (pin) is the peer here")
SIZES = [(1, "free"), (3, ""), (6, "free"), (12, ""), (30, "free")]


def model_of(bodies: dict, **numerics):
    return fvsolve.build(fvsolve.load(scene(bodies, {}, 1.0, {"method": "rk4", "step": 0.01, **numerics})))


def row(model, out, name: str) -> np.ndarray:
    at = int(model.layout["body"]) + BODY_OUT * model.body_names.index(name)
    return out[at : at + BODY_OUT]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("many, first", SIZES)
def test_forward_dynamics_of_random_trees_are_those_of_pinocchio(many, first, seed):
    bodies = random_tree(np.random.default_rng([many, seed]), many, first)
    model = model_of(bodies)
    pin, peer, data, q, v, rows = pinocchio_of(bodies, GRAVITY)
    pin.aba(peer, data, q, v, np.zeros(peer.nv))
    pin.forwardKinematics(peer, data, q, v, data.ddq)
    out = model.evaluate(0.0, model.start)[1]
    scale = max(np.abs(data.ddq).max(), 10.0)
    for k, name in enumerate(bodies):
        placed, here = data.oMi[k + 1], row(model, out, name)
        moved = pin.getClassicalAcceleration(peer, data, k + 1, pin.LOCAL_WORLD_ALIGNED)
        assert here[ATTITUDE : ATTITUDE + 9].reshape(3, 3) == pytest.approx(placed.rotation, abs=1e-13)
        assert here[PLACE : PLACE + 3] == pytest.approx(placed.translation, abs=1e-13 * many)
        assert here[ACCELERATION : ACCELERATION + 3] == pytest.approx(moved.linear, abs=1e-12 * scale)
        assert here[TURNING : TURNING + 3] == pytest.approx(moved.angular, abs=1e-12 * scale)
