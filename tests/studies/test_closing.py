"""The least peak by optimisation is near the lower bound, given by the mean pressure that stops a column."""

import json

import pytest
from reference.scenes import AMBIENT, RHO, area, junction, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.errors import FvsolveError
from fvsolve.studies import optimise

LENGTH, DIAMETER, TIME, SUPPLY = 100.0, 0.3, 4.0, 1.2e5


def column() -> dict:
    """Case of a frictionless rigid column that a valve stops within TIME."""
    nodes = {"lake": reservoir(SUPPLY), "gate": junction(), "air": reservoir(AMBIENT)}
    links = {"main": {"type": "rigid-column", "from": "lake", "to": "gate", "length": LENGTH, "diameter": DIAMETER},
             "tap": valve("gate", "air", 0.5 * area(DIAMETER), ramp(0.5, TIME, 1.0, 0.0))}  # fmt: skip
    return scene(nodes, links, 5.0, {"method": "rk4", "step": 0.01}, ["gate.pressure", "main.flow"])


def test_it_comes_near_the_least_that_can_be() -> None:
    first = fvsolve.run(column())
    speed = first["main.flow"][0] / area(DIAMETER)
    least = RHO * LENGTH * speed / TIME  # mean pressure that stops the column
    found = optimise(column(), "links.tap.opening", "max(gate.pressure)", knots=4, runs=120)
    rise, linear = found.best.peak - SUPPLY, found.linear.peak - SUPPLY
    assert linear == pytest.approx(first.extremes["gate.pressure"].maximum - SUPPLY, rel=1e-9)
    assert least < rise < 0.85 * linear and rise < 1.6 * least
    assert found.best.value[0] == 1.0 and found.best.value[-1] == 0.0
    assert all(a >= b for a, b in zip(found.best.value, found.best.value[1:], strict=False))
    again = fvsolve.run(column(), set={"links.tap.opening": {"time": found.best.time, "value": found.best.value}})
    assert again.extremes["gate.pressure"].maximum == pytest.approx(found.best.peak, rel=1e-9)
    assert found.runs <= 124


def test_the_command_prints_the_law_for_the_case(fvs, tmp_path) -> None:
    (tmp_path / "column.toml").write_text(write(column()))
    ask = ("optimise", str(tmp_path / "column.toml"), "--schedule", "links.tap.opening", "--minimise",
           "max(gate.pressure)", "--knots", "1", "--runs", "12")  # fmt: skip
    status, text, _ = fvs(*ask)
    assert status == 0 and "opening = { time = [0.5, 2.5, 4.5], value = [1.0," in text and "linear" in text
    said = json.loads(fvs(*ask, "--json")[1])
    assert said["best"]["peak"] <= said["linear"]["peak"] and len(said["laws"]) == said["runs"]


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("links.tap.area", "is not a schedule"),
        ("links.tpa.opening", "is not a schedule"),
        ("nodes.air.pressure", "does not change"),
    ],
)
def test_what_is_no_law_is_named(key: str, told: str) -> None:
    with pytest.raises(FvsolveError, match=told):
        optimise(column(), key, "max(gate.pressure)")


def test_what_cannot_be_minimised_is_named() -> None:
    with pytest.raises(fvsolve.CaseError, match='did you mean "gate"'):
        optimise(column(), "links.tap.opening", "max(gaet.pressure)")
    with pytest.raises(FvsolveError, match="Expected 15 or more"):
        optimise(column(), "links.tap.opening", "max(gate.pressure)", runs=4)
