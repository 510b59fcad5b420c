"""Rates of places without storage, solved by Newton's method, depend only on the parts that join them."""

from __future__ import annotations

import numpy as np
import pytest
from reference.scenes import WATER, junction, lake, pipe, pump, scene, valve

import fvsolve

FLUIDS = {
    "linear": dict(WATER),
    "log": {**WATER, "law": "log"},
    "mixture": {**WATER, "law": "mixture", "air_fraction": 1e-4},
}
STEADY = {"model": "steady", "factor": 0.02}


def town(name: str, size: float) -> tuple[dict, dict]:
    """Nodes and links from a common lake: two places joined by a valve, and a third behind a pipe.

    All flows are zero at the start, because a steady state is solved for the whole scene.
    """
    a, b, c, d, e = "lake", *(f"{name}-{one}" for one in "bcde")
    nodes = {a: lake(40.0), b: junction(), c: junction(), d: junction(), e: lake(40.0)}
    links = {
        f"{name}-1": pipe(a, b, 100.0, size, 1000.0, 3, friction=STEADY),
        f"{name}-2": valve(b, c, 0.1 * size**2),
        f"{name}-3": pipe(c, d, 70.0, size, 900.0, 2, friction=STEADY),
        f"{name}-4": valve(d, e, 0.05 * size**2),
        f"{name}-5": valve(b, d, 0.02 * size**2),
    }
    return nodes, links


@pytest.mark.parametrize("law", FLUIDS)
def test_rates_of_one_town_do_not_hang_on_another_by_one_bit(law):
    """States of the second town deviate up to three times as much, so Newton's method needs more iterations there."""

    def built(*towns):
        nodes = {name: node for one in towns for name, node in one[0].items()}
        links = {name: link for one in towns for name, link in one[1].items()}
        return fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, {}, [], 0.1, fluid=FLUIDS[law])))

    one, two = town("x", 0.3), town("y", 0.05)
    alone, both = built(one), built(one, two)
    at = [both.state_names.index(name) for name in alone.state_names]
    rng = np.random.default_rng(5)
    for _ in range(50):
        y = both.scale * rng.uniform(-1.0, 1.0, both.y_size) * rng.choice([0.0, 1.0, 3.0])
        y[at] = alone.scale * rng.uniform(-1.0, 1.0, alone.y_size)
        assert np.array_equal(both.rhs(0.0, y)[at], alone.rhs(0.0, y[at]))


@pytest.mark.parametrize("law", FLUIDS)
def test_more_pumps_than_places_all_pump(law):
    """H(q) = 4/3 H_r s^2 - 1/3 H_r (q / q_r)^2 between two lakes, at full and at 0.6 of the speed."""
    places = {"low": lake(10.0), "high": lake(15.0)}
    rated = [0.01, 0.02, 0.03, 0.04]
    slowing = {"time": [0.0, 0.5], "value": [1.0, 0.6]}
    links = {
        f"p{k}": pump("low", "high", curve={"flow": [flow], "head": [30.0]}, speed=slowing)
        for k, flow in enumerate(rated)
    }
    links["main"] = pipe("low", "high", 100.0, 0.2, 1000.0, 4, friction=STEADY)
    case = scene(places, links, 1.0, {}, [f"{name}.flow" for name in links], 0.5, fluid=FLUIDS[law])
    result = fvsolve.run(case)
    for k, flow in enumerate(rated):
        for row, speed in ((0, 1.0), (-1, 0.6)):
            wanted = flow * np.sqrt((40.0 * speed**2 - 5.0) / 10.0)
            assert result[f"p{k}.flow"][row] == pytest.approx(wanted, rel=1e-9 if law == "linear" else 1e-3)
