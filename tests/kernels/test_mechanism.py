"""Trees of bodies compared with pinocchio: accelerations, mass matrix and energies, from fvsolve's own rates."""

import numpy as np
import pytest
from reference.bodies import pinocchio_of, random_tree
from reference.scenes import GRAVITY, scene

import fvsolve
from fvsolve.core.kernels.dtypes import BODY_OUT
from fvsolve.core.kernels.moving_frames import ACCELERATION, ATTITUDE, POSITION, SPIN_RATE
from fvsolve.core.model import RunData
from fvsolve.core.model.energy_accounts import Accounts
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.features.motion.static_forces import mass_factor

pytest.importorskip("pinocchio", reason="pinocchio (pin) is the peer here")
SIZES = [(1, "free"), (3, ""), (6, "free"), (12, ""), (30, "free")]


def model_of(bodies: dict, **numerics):
    return fvsolve.build(
        fvsolve.load(scene(bodies, {}, 1.0, {"method": "rk4", "step": 0.01, **numerics}))
    )


def row(model, out, name: str) -> np.ndarray:
    at = int(model.layout["body"]) + BODY_OUT * motion_of(model).body_names.index(name)
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
        assert here[ATTITUDE : ATTITUDE + 9].reshape(3, 3) == pytest.approx(
            placed.rotation, abs=1e-13
        )
        assert here[POSITION : POSITION + 3] == pytest.approx(placed.translation, abs=1e-13 * many)
        assert here[ACCELERATION : ACCELERATION + 3] == pytest.approx(
            moved.linear, abs=1e-12 * scale
        )
        assert here[SPIN_RATE : SPIN_RATE + 3] == pytest.approx(moved.angular, abs=1e-12 * scale)


def branch(tree: dict, on: str | None = None) -> dict:
    """Bodies of a tree in an order in which those on a body follow directly after it."""
    found = {}
    for name, one in tree.items():
        if one["joint"].get("on") == on:
            found |= {name: one, **branch(tree, name)}
    return found


@pytest.mark.parametrize("seed", range(4))
def test_random_trees_on_springs_balance_where_pinocchio_has_their_gravity(seed):
    """g(q) + k q = 0, with the stiffness k of the spring in each joint."""
    rng = np.random.default_rng([9, seed])
    bodies = branch(random_tree(rng, 8, "revolute", ("revolute", "prismatic")))
    for one in bodies.values():
        joint = one["joint"]
        del joint["rate"]
        joint["stiffness"] = float(rng.uniform(100.0, 400.0))
    model = model_of(bodies, initial="equilibrium")
    pin, peer, data, _, _, rows = pinocchio_of(bodies, GRAVITY)
    q = np.zeros(peer.nq)
    for name, row in zip(motion_of(model).body_names, motion_of(model).body_table, strict=True):
        q[rows[name]] = row["start"][0]
    stiff = np.array([bodies[name]["joint"]["stiffness"] for name in bodies])
    left = pin.computeGeneralizedGravity(peer, data, q) + stiff * q
    assert np.max(np.abs(left)) < 1e-10 * np.max(stiff * np.abs(q))
    assert len(model.case.equilibrium_nodes) == 8 and model.steady["moving"] == []


@pytest.mark.parametrize("seed", range(3))
def test_the_mass_matrix_of_random_trees_is_that_of_pinocchio(seed):
    """M = L'L with L from the kernels; entries between freedoms on different branches are zero."""
    # the matrix of pinocchio has this order
    bodies = branch(random_tree(np.random.default_rng([8, seed]), 8, "ball"))
    model = model_of(bodies)
    pin, peer, data, q, _, rows = pinocchio_of(bodies, GRAVITY)
    truth = pin.crba(peer, data, q)
    truth = np.triu(truth) + np.triu(truth, 1).T
    freedoms, n = motion_of(model).freedom_table, len(motion_of(model).freedom_table)
    factor, entries = np.zeros((n, n)), mass_factor(model, model.start)[8 * n :]
    for j, row in enumerate(freedoms):
        path = model.tables.integers[row["path"] : row["path"] + row["depth"] + 1]
        factor[j, path] = entries[row["row"] : row["row"] + row["depth"] + 1]
    table = dict(zip(motion_of(model).body_names, motion_of(model).body_table, strict=True))
    own = [int(table[name]["freedom"]) + k for name in rows for k in range(table[name]["freedoms"])]
    assert (factor.T @ factor)[np.ix_(own, own)] == pytest.approx(
        truth, abs=1e-13 * np.abs(truth).max()
    )


def test_a_wall_at_a_tree_leaves_its_mass_matrix_at_the_given_state():
    """A slider that moves a wall, and a pendulum on it: M_12 = -m l cos(a)."""
    slider = {
        "type": "body",
        "mass": 5.0,
        "inertia": [1, 1, 1],
        "joint": {"kind": "prismatic", "axis": [1, 0, 0]},
    }
    hinge = {"kind": "revolute", "axis": [0, 1, 0], "on": "slider"}
    bob = {
        "type": "body",
        "mass": 2.0,
        "inertia": [0, 0, 0],
        "centre_of_mass": [0, 0, -0.7],
        "joint": hinge,
    }
    flume = {
        "type": "basin",
        "size": [2.0, 1.0],
        "cells": [8, 1],
        "level": 0.5,
        "patches": {"lid": {"side": "west", "body": "slider"}},
    }
    model = model_of({"flume": flume, "slider": slider, "bob": bob})
    y = model.start.copy()
    y[model.state_names.index("bob.angle")] = 1.1
    factor = np.zeros((2, 2))
    factor[np.tril_indices(2)] = mass_factor(model, y)[16:19]
    wanted = [[7.0, -1.4 * np.cos(1.1)], [-1.4 * np.cos(1.1), 2.0 * 0.49]]
    assert factor.T @ factor == pytest.approx(np.array(wanted), rel=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_energies_and_momenta_of_random_trees_are_those_of_pinocchio(seed):
    bodies = random_tree(np.random.default_rng([6, seed]), 6, "free")
    sums = (
        "kinetic_energy",
        *(f"{what}momentum_{axis}" for what in ("", "angular_") for axis in "xyz"),
    )
    probes = [f"{name}.{one}" for name in bodies for one in sums]
    case = scene(bodies, {}, 1.0, {"method": "rk4", "step": 0.01}, probes)
    model = fvsolve.build(fvsolve.load(case))
    found = model.observe(0.0, model.start).reshape(len(bodies), len(sums)).sum(axis=0)
    pin, peer, data, q, v, _ = pinocchio_of(bodies, GRAVITY)
    momentum = pin.computeCentroidalMomentum(peer, data, q, v)
    centre = pin.centerOfMass(peer, data, q, v)
    about = momentum.angular + np.cross(centre, momentum.linear)
    truth = [pin.computeKineticEnergy(peer, data, q, v), *momentum.linear, *about]
    assert found == pytest.approx(truth, rel=1e-12, abs=1e-12)


def test_power_of_a_tree_is_that_of_its_weight():
    """d/dt of v' M v / 2 = v . weight: Coriolis' terms have no power (M' - 2 C is skew)."""
    bodies = random_tree(np.random.default_rng(9), 10, "free")
    model = model_of(bodies)
    accounts = Accounts(RunData(model))
    dydt, out = np.zeros(model.y_size), model.new_out()
    power = accounts.power_at(0.0, model.start.copy(), dydt, out)
    kinetic = max(abs(one) for one in power)
    assert abs(power.sum()) < 1e-12 * max(kinetic, 100.0)


def test_a_new_mechanism_compiles_nothing():
    one = model_of(random_tree(np.random.default_rng(1), 3, "free"))
    other = model_of(random_tree(np.random.default_rng(2), 9, "ball"))
    assert one.functions is other.functions
