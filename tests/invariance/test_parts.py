"""Any part between any neighbours starts or is refused with its name, closes its ledger, and stays at rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference.scenes import junction, lake, pipe, ramp, scene, valve

from fvsolve.parts import KINDS
from fvsolve.steppers import METHODS
from invariance.parts import LINKS, NODES
from invariance.random_scenes import numerics, probes
from invariance.result_comparison import told

EXPERIMENTAL = "ignore:First-class function type feature is experimental"  # warning of numba while it compiles
pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)  # other warnings fail, such as of NaN values
ELSEWHERE = {
    "basin", "mass", "frame", "body", "cylinder", "damper", "end-stop", "force", "spring", "spool-valve", "torque",
    "pin", "bushing",
}  # fmt: skip
HEAD = 20.0
NEIGHBOURS = [
    junction(),
    {"type": "tank", "area": 1.0, "level": HEAD},
    {"type": "chamber", "volume": 0.05},
    {"type": "accumulator", "volume": 0.5, "gas_volume": 0.05},
]


def test_every_kind_of_part_is_here_or_in_a_scene_of_its_own():
    assert set(NODES) | set(LINKS) | ELSEWHERE == set(KINDS["nodes"]) | set(KINDS["links"])


@st.composite
def neighbours(draw, stiff: bool) -> tuple[dict, dict]:
    """Strategy for a lake on each side of the part, each with a neighbour behind a pipe or a valve.

    stiff : neighbours may be chambers and accumulators, and a valve may replace a pipe
    """
    places, links = {"up": lake(HEAD), "down": lake(HEAD)}, {}
    for side, end in (("up", "a"), ("down", "b")):
        places[end] = draw(st.sampled_from(NEIGHBOURS if stiff else NEIGHBOURS[:2]))
        by_valve = stiff and end == "b" and places[end]["type"] != "junction" and draw(st.booleans())
        links[f"to-{end}"] = valve(side, end, 2e-3) if by_valve else main(side, end)
    return places, links


def main(start: str, end: str) -> dict:
    return pipe(start, end, 60.0, 0.1, 1000.0, 4, friction={"model": "steady", "factor": 0.02})


def made(places: dict, links: dict, settings: dict, end: float = 1.0) -> dict:
    case = scene(places, links, end, settings, probes(places, links), 0.05)
    case["output"]["fields"] = 0
    return case


@st.composite
def joined(draw, table: str, part: dict, settings: dict) -> tuple[dict, dict]:
    """Strategy for a part between its neighbours, as (nodes, links).

    A link joins nodes a and b; a node is joined to them by a pipe and by a pipe or a valve. A vessel at rest behind a
    valve is stiff and would need short explicit steps (docs/where-methods-fail.md), so explicit methods get pipes only.
    """
    stiff = settings["method"] not in METHODS or not METHODS[settings["method"]].explicit
    places, links = draw(neighbours(stiff))
    if part["type"] == "leak":
        return places, {**links, "on": valve("a", "b", 1e-3), "part": part | {"from": "a"}}
    if table == "links":
        return places, {**links, "part": part | {"from": "a", "to": "b"}}
    return {**places, "part": part}, {
        **links,
        "in": main("a", "part"),
        "off": valve("part", "b", 1e-3) if stiff else main("part", "b"),
    }


PARTS = [("links", kind) for kind in LINKS] + [("nodes", kind) for kind in NODES]


@pytest.mark.parametrize("table, kind", PARTS)
@examples(4)
@given(data=st.data(), settings=numerics())
def test_driven_one_way_then_the_other_the_ledger_closes(table, kind, data, settings):
    """The mass ledger closes and the run finishes while the upper lake falls below the lower lake and rises again."""
    part = data.draw((LINKS if table == "links" else NODES)[kind])
    places, links = data.draw(joined(table, part, settings))
    places["up"] = lake(data.draw(st.sampled_from([
        {"time": [0.0, 0.3, 0.5, 0.8], "value": [HEAD + 10.0, HEAD + 10.0, HEAD - 8.0, HEAD + 15.0]},
        {"time": [0.0, 0.3, 0.7], "value": [HEAD + 10.0, HEAD - 8.0, HEAD + 15.0], "kind": "step"},
        ramp(0.2, 0.4, HEAD - 8.0, HEAD + 15.0),
    ])))  # fmt: skip
    shown = told(made(places, links, settings))
    if shown.ended == "refused":
        return
    assert shown.ended == "finished"
    assert abs(shown.result.ledger["mass"]["relative"]) < 1e-8
    assert all(np.all(np.isfinite(values)) for values in shown.rows.values())


@pytest.mark.parametrize("table, kind", PARTS)
@examples(4)
@given(data=st.data(), settings=numerics())
def test_at_rest_it_stays_at_rest(table, kind, data, settings):
    """With equal heads on all sides and an inactive part, no flow starts and no pressure changes.

    Under a tolerance pressures may err by this tolerance times 3 bar. The flow of a valve at zero drop may err by its
    root.
    """
    part = data.draw((LINKS if table == "links" else NODES)[kind])
    still = {
        "pump": {"speed": 0.0}, "turbine": {"speed": 0.0}, "leak": {"opening": 0.0}, "junction": {"demand": 0.0},
        "inflow": {"flow": 0.0}, "tank": {"level": HEAD}, "reservoir": {"head": HEAD},
    }.get(kind, {})  # fmt: skip
    part |= still
    shown = told(made(*data.draw(joined(table, part, settings)), settings))
    if shown.ended == "refused":
        return
    assert shown.ended == "finished"
    by_courant = "courant" in settings and METHODS[settings["method"]].explicit
    rtol = settings.get("rtol", 1e-6)
    swings, flows = (1e-3, 1e-9) if by_courant else (max(1.0, 3e5 * rtol), 0.1 * rtol**0.5)
    assert max(np.ptp(values) for name, values in shown.rows.items() if ".pressure" in name) < swings
    assert max(np.max(np.abs(values)) for name, values in shown.rows.items() if ".flow" in name) < flows
