"""Implicit given steps are solved at their full length, independent of rounding and of the order of the parts."""

import numpy as np
import pytest
from numba import njit
from reference.scenes import WATER, junction, lake, pipe, ramp, reservoir, scene, step, tank, valve

import fvsolve
from fvsolve.core.steppers import integrate

TABLE = {"name": "Water", "temperature": 293.15, "law": "table"}
MIXTURE = {**WATER, "law": "mixture", "air_fraction": 1e-3}
STEADY, ROUGH = {"model": "steady", "factor": 0.02}, {"model": "quasi-steady", "roughness": 1e-4}


def closing(**numerics) -> dict:
    """Case of two cells before a closing valve, where Newton increments end at the rounding error, about 2e-13."""
    main = pipe("high", "n0", 50.0, 0.2638, 800.0, 2, friction=STEADY, minor_loss=1.5)
    out = valve("n0", "low", 0.00446885, ramp(0.5245, 0.09345, 0.352, 0.2))
    nodes = {
        "high": lake(35.45, elevation=0.0),
        "low": reservoir(283e3, elevation=0.0),
        "n0": junction(elevation=2.631),
    }
    return scene(
        nodes,
        {"p0": main, "out": out},
        1.0,
        numerics,
        ["n0.pressure", "out.flow"],
        0.05,
        fluid=TABLE,
    )


def fork(**numerics) -> dict:
    """Case of a valve, a rigid column, a leak and a tank with two pipes, with a nearly singular Jacobian.

    Newton iterations from the end of the last step fail; along a growing step the stage is found.
    """
    nodes = {
        "high": lake(34.6, elevation=0.0),
        "low": reservoir(262.4e3, elevation=0.0),
        "n0": junction(elevation=3.888),
        "n1": {"type": "accumulator", "volume": 0.8331, "gas_volume": 0.05, "elevation": -4.406},
        "n2": tank(1.194, 15.8, elevation=-1.168),
    }
    smooth = {"model": "hazen-williams", "coefficient": 110.0}
    links = {
        "p0": pipe("high", "n0", 177.7, 0.1062, 1286.0, 6, friction=ROUGH, minor_loss=1.5),
        "p1": pipe("high", "n1", 220.1, 0.2634, 894.0, 2, friction=STEADY, minor_loss=1.5),
        "p2": pipe("n0", "n2", 300.0, 0.4, 1023.0, 8, friction=STEADY, minor_loss=1.5),
        "out": valve("n0", "low", 0.002601639, step(0.4286, 1.0, 0.5678)),
        "x0": pipe("n0", "n2", 62.06, 0.3502, 1210.0, 4, friction=smooth, minor_loss=1.5),
        "x1": {
            "type": "rigid-column",
            "from": "n0",
            "to": "low",
            "length": 68.0,
            "diameter": 0.1,
            "friction": STEADY,
        },
        "hole": {"type": "leak", "from": "n0", "coefficient": 1.929e-6},
    }
    return scene(nodes, links, 1.0, numerics, ["n0.pressure", "out.flow"], 0.05, fluid=MIXTURE)


def to_and_fro(**numerics) -> dict:
    """Case of a main before two valves and a relief valve, where stages solved in turn oscillate under weno5."""
    nodes = {
        "high": lake(53.26, elevation=0.0),
        "low": reservoir(215.7e3, elevation=0.0),
        "n0": junction(elevation=0.05578),
    }
    relief = {
        "type": "relief-valve",
        "from": "high",
        "to": "n0",
        "area": 0.0005761,
        "set_pressure": 392.6e3,
        "overpressure": 2e4,
        "time_constant": 0.2726,
    }
    links = {
        "p0": pipe("high", "n0", 129.9, 0.1003, 1118.0, 8, friction=STEADY, minor_loss=1.5),
        "out": valve("n0", "low", 0.006473770491803279, step(0.5423, 1.0, 0.5)),
        "x0": valve("low", "n0", 0.003122950819672131),
        "x1": relief,
    }
    return scene(nodes, links, 1.0, numerics, ["n0.pressure", "out.flow"], 0.05)


def slowly(**numerics) -> dict:
    """Case of three pipes, whose last long step gains at most a fifth per turn of stages that are solved in turn."""
    nodes = {
        "high": lake(48.17, elevation=0.0),
        "low": reservoir(150e3, elevation=0.0),
        "n0": junction(elevation=4.0),
        "n1": junction(0.002195, elevation=-0.4073),
        "n2": {"type": "inflow", "flow": 0.002244, "elevation": 4.195},
    }
    smooth, rough = (
        {"model": "hazen-williams", "coefficient": 110.0},
        {"model": "chezy-manning", "coefficient": 0.012},
    )
    links = {
        "p0": pipe("high", "n0", 224.2, 0.3333, 823.6, 8, friction=smooth, minor_loss=1.5),
        "p1": pipe("high", "n1", 75.24, 0.1909, 858.5, 7, friction=rough),
        "p2": pipe("n1", "n2", 290.6, 0.2065, 1185.0, 8, friction=STEADY, minor_loss=1.5),
        "out": valve("n2", "low", 0.003960655737704918, step(0.3355, 1.0, 0.5568)),
        "hole": {"type": "leak", "from": "n1", "coefficient": 2.838e-06},
    }
    return scene(nodes, links, 0.385, numerics, ["n0.pressure", "out.flow"], 0.05, fluid=MIXTURE)


SCENES = [
    (
        closing,
        {"method": "implicit-euler", "scheme": "muscl", "limiter": "minmod", "courant": 3.471},
    ),
    (closing, {"method": "trapezoid", "scheme": "muscl", "limiter": "minmod", "courant": 3.471}),
    (closing, {"method": "radau-iia-3", "scheme": "weno5", "courant": 0.8596}),
    (fork, {"method": "implicit-euler", "scheme": "weno5", "courant": 1.044}),
    (to_and_fro, {"method": "radau-iia-3", "scheme": "weno5", "courant": 1.009}),
    (slowly, {"method": "lobatto-iiic-4", "scheme": "weno5", "courant": 3.979}),
]


def settings_text(given) -> str:
    return given.__name__ if callable(given) else " ".join(str(one) for one in given.values())


@pytest.mark.parametrize(
    "at", range(len(SCENES)), ids=["-".join(map(settings_text, one)) for one in SCENES]
)
def test_newton_finds_every_stage_and_parts_listed_the_other_way_round_take_the_same_steps(at):
    build, numerics = SCENES[at]
    case = build(**numerics)
    turned = {
        **case,
        "nodes": dict(reversed(case["nodes"].items())),
        "links": dict(reversed(case["links"].items())),
    }
    one, other = fvsolve.run(case), fvsolve.run(turned)
    assert one.reason == "finished"
    assert one.summary["newton_failures"] == 0
    assert one.summary["steps"] == other.summary["steps"]
    for probe in ("n0.pressure", "out.flow"):
        assert np.max(np.abs(one[probe] - other[probe])) < 1e-9 * np.max(np.abs(one[probe]))


@njit
def flares(t, y):
    """Rates y' = y^2 until 0.31 s, then y' = -y."""
    return y * y if t < 0.31 else -y


def test_a_step_without_a_solution_is_taken_in_parts_that_end_on_its_grid():
    """A step without a solution is divided into parts that end at the end of the step.

    z = y + h z^2 has no real solution for 4 h y > 1. From y = 1 a step of 0.3 s has none, and steps of 0.075 s and
    0.225 s have solutions.
    """
    counts: dict = {}
    found = integrate(
        flares, [1.0], [0.0, 0.3, 0.6, 1.2], "implicit-euler", step=0.3, counts=counts
    )

    def end(y, h):
        return (1.0 - np.sqrt(1.0 - 4.0 * h * y)) / (2.0 * h)

    top = end(end(1.0, 0.075), 0.225)
    assert found[:, 0] == pytest.approx([1.0, top, top / 1.3, top / 1.3**3], rel=1e-12)
    assert (counts["steps"], counts["parted"]) == (5, 1)
    plain: dict = {}
    integrate(flares, [0.1], [0.0, 1.2], "implicit-euler", step=0.3, counts=plain)
    assert (plain["steps"], plain["parted"]) == (4, 0)
