"""Given steps beside delay lines are divided where a storing part is faster: no explicit method amplifies its waves."""

import numpy as np
import pytest
from reference.lines_with_jumps import line
from reference.scenes import WATER, junction, lake, scene

import fvsolve

# method -> allowed error over the range; in this scene `euler` and `ssp-rk3` have the errors of a jump that ends a step
EXPLICIT = {"rk4": 0.05, "heun": 0.05, "dormand-prince": 0.05, "euler": 0.12, "ssp-rk3": 0.12}


def between_lines(node: dict, h: float, method: str, end: float = 2.0) -> dict:
    """Case of a node between two delay lines of 200 and 100 m; a valve at their end opens further at once."""
    nodes = {"lake": lake(80.0), "n": node, "gate": junction(), "out": lake(0.0)}
    opening = {"start": 0.5, "duration": 0.0, "value": [0.4, 0.7]}
    links = {
        "p0": line("lake", "n", 200.0, 0.8),
        "p1": line("n", "gate", 100.0, 0.8),
        "v": {"type": "valve", "from": "gate", "to": "out", "area": 0.04, "opening": opening},
    }
    numerics = {"pipe_model": "delay-line", "step": h, "method": method}
    made = scene(
        nodes,
        links,
        end,
        numerics,
        ["n.head", "gate.head"],
        0.01,
        fluid={**WATER, "vapor_pressure": 0.0},
    )
    return made | {"ambient_pressure": 5e7}


@pytest.mark.in_turn
@pytest.mark.parametrize("method", EXPLICIT)
@pytest.mark.parametrize("node", [
    {"type": "accumulator", "volume": 1000.0, "gas_volume": 0.0368, "exponent": 1.0},
    {"type": "chamber", "volume": 0.4},
])  # fmt: skip
def test_a_vessel_between_delay_lines_does_not_grow(method, node):
    """The step is 7 and 17 times the time constant of the node; the truth are steps of a hundredth."""
    found = fvsolve.run(between_lines(node, 0.005, method))
    truth = fvsolve.run(between_lines(node, 5e-5, "rk4"))
    share = EXPLICIT[method]
    assert found.ok or method == "euler"  # for which a notice predicts growth
    assert any("beside delay lines" in notice.text for notice in found.warnings)
    for probe in ("n.head", "gate.head"):
        one, exact = found.extremes[probe], truth.extremes[probe]
        assert one.minimum == pytest.approx(
            exact.minimum, abs=share * (exact.maximum - exact.minimum)
        )
        assert one.maximum == pytest.approx(
            exact.maximum, abs=share * (exact.maximum - exact.minimum)
        )


def air_valve(h: float) -> dict:
    """Case of an air valve between two delay lines, behind a valve that shuts."""
    friction = {"model": "steady", "factor": 0.02}
    nodes = {
        "src": lake(55.0, elevation=0.0),
        "a": junction(elevation=0.0),
        "end": lake(40.0, elevation=0.0),
        "b": {"type": "air-valve", "inlet": 0.03, "outlet": 0.04, "elevation": 30.0},
    }
    gate = {"type": "valve", "from": "src", "to": "a", "area": 0.05, "discharge_coefficient": 0.8}
    links = {
        "gate": gate | {"opening": {"start": 0.5, "duration": 1.0, "value": [1.0, 0.0]}},
        "p1": line("a", "b", 450.0, 0.4, friction=friction),
        "p2": line("b", "end", 300.0, 0.4, friction=friction),
    }
    numerics = {"pipe_model": "delay-line", "step": h, "method": "rk4"}
    return scene(nodes, links, 12.0, numerics, ["b.pressure", "b.air_volume"], 0.02)


@pytest.mark.parametrize("h", [0.005, 0.015])
def test_an_air_valve_between_delay_lines(h):
    """Greatest volume of air 0.7287 m3: own characteristics at Courant number 1, with a chamber of air at the node."""
    found = fvsolve.run(air_valve(h))
    assert found.extremes["b.air_volume"].maximum == pytest.approx(0.7287, rel=0.01)
    assert np.all(found["b.pressure"] < 1.9e6)


def test_check_states_the_steps_of_a_small_chamber():
    """`check` gives the number of parts, and the methods that do not need them."""
    case = between_lines({"type": "chamber", "volume": 1e-3}, 0.005, "rk4", end=20.0)
    facts = fvsolve.build(fvsolve.load(case)).checks
    notice = next(one for one in facts["warnings"] if one["kind"] == "cost")
    assert facts["steps"] > 1e6
    assert "rodas-5p" in notice["text"] and "auto" in notice["text"]
    assert "divided for n" in facts["step_set_by"]
