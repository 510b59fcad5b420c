"""Tanks with a connection: extremes of a mass oscillation with friction and throttle against the closed form."""

import math

import numpy as np
import pytest
from reference.scenes import GRAVITY, WATER, area, lake, pipe, scene, valve
from scipy.optimize import brentq

import fvsolve
from fvsolve.model.jacobian_pattern import jacobian_pattern
from fvsolve.studies.energy.energy_balance import energy

LENGTH, DIAMETER, FACTOR, SHAFT, THROAT = 2000.0, 3.0, 0.015, 80.0, 2.0
TIGHT = {"method": "dormand-prince", "rtol": 1e-11}


def turns(z: float, flow: float, losses: tuple[float, float], count: int) -> list[float]:
    """Levels above the lake at which the flow reverses: d(q^2)/dz = -k (z + c q |q|) (Forchheimer 1913).

    q^2 = 1 / (k c^2) -+ z / c + C exp(-+ k c z), with the upper sign while the tank fills.
    losses : loss coefficients K into the tank and out of it
    """
    bore, throat = area(DIAMETER), area(THROAT)
    k = 2 * GRAVITY * bore * SHAFT / LENGTH
    square, found = flow**2, []
    for turn in range(count):
        side = 1 if turn % 2 == 0 else -1
        c = FACTOR * LENGTH / DIAMETER / (2 * GRAVITY * bore**2) + losses[turn % 2] / (2 * GRAVITY * throat**2)

        def left(x, z=z, square=square, side=side, c=c):
            plain = (1 / (k * c * c) - side * z / c, 1 / (k * c * c) - side * x / c)
            return plain[1] + (square - plain[0]) * math.exp(-side * k * c * (x - z))

        far = z + side * 0.05
        while left(far) > 0.0:
            far += side * 0.05
        z, square = brentq(left, far - side * 0.05, far, xtol=1e-13), 0.0
        found.append(z)
    return found


def swing(losses: tuple[float, float], numerics: dict = TIGHT, law: str = "linear") -> dict:
    connection = {"diameter": THROAT, "loss_in": losses[0], "loss_out": losses[1]}
    nodes = {"lake": lake(50.0), "t": {"type": "tank", "area": SHAFT, "level": 45.9, "connection": connection}}
    tunnel = {"type": "rigid-column", "from": "lake", "to": "t", "length": LENGTH, "diameter": DIAMETER,
              "friction": {"model": "steady", "factor": FACTOR}, "initial_flow": 20.0}  # fmt: skip
    probes = ["t.level", "t.head", "c.flow"]
    return scene(nodes, {"c": tunnel}, 400.0, numerics, probes, 0.1, fluid=WATER | {"law": law})


@pytest.mark.parametrize("losses", [(1.0, 1.5), (4.0, 0.5)])
def test_the_turns_of_a_mass_oscillation_are_the_closed_ones(losses):
    """The extremes agree to the transition flow of the throttle and the interval of rows."""
    result = fvsolve.run(swing(losses))
    level = result["t.level"]
    slope = np.diff(level)
    found = level[1:-1][slope[:-1] * slope[1:] <= 0.0]
    assert found[:3] == pytest.approx([50.0 + z for z in turns(-4.1, 20.0, losses, 3)], abs=3e-6)
    assert abs(result.ledger["mass"]["relative"]) < 1e-14


def test_the_head_beside_the_tank_is_its_level_and_the_loss():
    result = fvsolve.run(swing((1.0, 1.5)))
    flow = result["c.flow"]
    loss = np.where(flow > 0, 1.0, -1.5) * flow**2 / (2 * GRAVITY * area(THROAT) ** 2)
    assert result["t.head"] == pytest.approx(result["t.level"] + loss, abs=1e-5)


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_throttle_dissipates_and_the_ledger_closes(law):
    one = energy(swing((1.0, 1.5), {"method": "gauss-6", "step": 0.25}, law), port="lake")
    column = sum(loss[-1] for loss in one.law.values())
    assert abs(one.numerical_remainder[-1] - column) < 1e-7 * one.throughput and one.port.passive
    assert one.dissipated["t.connection"][-1] > 0.0 and "t.inside" in one.stored


def test_a_tank_behind_a_pipe_starts_at_rest_and_stays():
    connection = {"area": 0.5, "loss_in": 1.0, "loss_out": 2.0}
    nodes = {"lake": lake(20.0), "t": {"type": "tank", "area": 9.0, "level": 20.0, "connection": connection}}
    links = {"main": pipe("lake", "t", 100.0, 0.5, 1000.0, 10)}
    for law in ("linear", "log"):
        model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {}, fluid=WATER | {"law": law})))
        assert not model.rhs(0.0, np.zeros(model.y_size)).any()
        pattern = jacobian_pattern(model).toarray()[: model.y_size]
        assert not np.any((np.abs(model.jacobian(0.0, np.zeros(model.y_size))) > 1e-6) & ~pattern)


def test_marks_and_what_moves_name_the_tank_itself():
    """Marks, notices and moving parts name the tank, without its inner node; an outlet below its bottom drains it."""
    nodes = {"t": {"type": "tank", "area": 1.0, "level": 0.5,
                   "connection": {"diameter": 0.2, "loss_in": 1.0, "loss_out": 1.0}}, "air": lake(-0.5)}  # fmt: skip
    result = fvsolve.run(scene(nodes, {"hole": valve("t", "air", 0.02)}, 40.0, {}, ["t.level"]))
    assert [mark.place for mark in result.marks] == ["nodes.t"] and result["t.level"][-1] == pytest.approx(
        0.0, abs=1e-6
    )
    full = {"t": nodes["t"] | {"height": 0.6}, "spring": {"type": "inflow", "flow": 0.02}}
    spilt = fvsolve.run(scene(full, {"way": valve("spring", "t", 0.02)}, 40.0, {}, ["t.level"]))
    (note,) = [one for one in spilt.warnings if one.kind == "spilling"]
    assert (note.place, note.value) == ("nodes.t", pytest.approx(5.0, abs=1e-6)) and "inside" not in note.text
    moving = fvsolve.build(fvsolve.load(scene(nodes, {"hole": valve("t", "air", 0.02)}, 1.0, {}))).steady["moving"]
    assert moving[0].startswith("tank t falls at")
