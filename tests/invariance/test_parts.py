"""Any part between any neighbours starts or is refused with its name, closes its ledger, and stays at rest.

Hypothesis draws one part of most kinds with random keys.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference.scenes import junction, lake, pipe, ramp, scene, valve

from fvsolve.core.steppers import METHODS
from fvsolve.parts import KINDS
from invariance.random_scenes import FRICTIONS, between, numerics, probes
from invariance.result_comparison import outcome_of

ONE, NONE = st.just(1.0), st.just(0.0)
CRACKING = {"cracking_pressure": between(0.0, 5e3)}
SLAMS = {"rate": [1.0, 10.0], "reverse_velocity": [0.05, 1.0]}
COMPRESSOR = {"start": 0.28, "stop": 0.2, "flow": 1e-3}
SWITCHES = {"switch": 3e3, "switch_velocity": 0.1}
SLOW = {"time_constant": between(0.1, 5.0)}
SIZE = st.one_of(
    st.fixed_dictionaries({"area": between(1e-4, 5e-3)}),
    st.fixed_dictionaries(
        {"diameter": between(0.01, 0.08), "loss_coefficient": between(0.5, 20.0)}
    ),
    st.fixed_dictionaries({"Kv": between(3.0, 100.0)}),
)
MOVING = st.one_of(
    st.fixed_dictionaries({"time_constant": between(0.02, 0.5)}),
    st.fixed_dictionaries(
        {"natural_frequency": between(1.0, 10.0), "damping_ratio": between(0.3, 1.5)}
    ),
)
PILOT = {"pilot": st.sampled_from(["up", "a", "b"]), "pilot_ratio": between(0.5, 5.0)}
SENSES = st.sampled_from([["up", "a"], ["a", "down"], ["b", "down"], ["a", "b"], ["up", "down"]])
OPENING = st.one_of(
    st.just(1.0),
    between(0.1, 1.0),
    st.builds(ramp, between(0.1, 0.5), between(0.01, 0.4), ONE, NONE),
)
HILL = [
    {
        "opening": 0.3,
        "unit_speed": [30, 70, 110],
        "unit_flow": [0.32, 0.3, 0.2],
        "efficiency": [0.6, 0.8, 0.1],
    },
    {
        "opening": 1.0,
        "unit_speed": [110, 70, 30],
        "unit_flow": [0.7, 1.0, 1.05],
        "efficiency": [0.2, 0.9, 0.6],
    },
]
CONDUIT = {
    "length": between(5.0, 60.0),
    "diameter": between(0.05, 0.2),
    "friction": st.sampled_from(FRICTIONS[1:]),
}
CONNECTION = {
    "connection": st.fixed_dictionaries(
        {
            "diameter": between(0.03, 0.1),
            "loss_in": between(0.5, 5.0),
            "loss_out": between(0.5, 5.0),
        }
    )
}


def of(
    kind: str, keys: dict | None = None, maybe: dict | None = None, **tables: st.SearchStrategy
) -> st.SearchStrategy:
    """Strategy for tables of a kind of part, merged with the tables that `tables` draw."""
    plain = st.fixed_dictionaries({"type": st.just(kind), **(keys or {})}, optional=maybe or {})
    return st.builds(
        lambda one, *more: one | {k: v for table in more for k, v in table.items()},
        plain,
        *tables.values(),
    )


def disc(one: dict) -> dict:
    """Table with an overpressure, if the valve has a disc with a lag or a mass, or is a relief valve."""
    moves = "time_constant" in one or "natural_frequency" in one
    return one | (
        {"overpressure": 2e4} if moves or one["type"] in ("relief-valve", "counterbalance") else {}
    )


LINKS = {
    "pipe": of("pipe", CONDUIT | {"wave_speed": between(600.0, 1300.0), "cells": st.integers(1, 9)})
    | of("pipe", CONDUIT | {"pipe_model": st.just("quasi-steady")}, {"minor_loss": between(0.0, 3.0)}),
    "rigid-column": of("rigid-column", CONDUIT, {"minor_loss": between(0.0, 3.0)}),
    "valve": of("valve", {"opening": OPENING}, {"characteristic": st.just("equal-percentage")}, a=SIZE),
    "orifice": of("orifice", {}, {"laminar_reynolds": between(5.0, 100.0)}, a=SIZE),
    "check-valve": of("check-valve", {}, CRACKING, a=SIZE, b=st.just({}) | MOVING).map(disc)
    | of("check-valve", {"area": between(1e-4, 5e-3), "deceleration": st.just(SLAMS)}, CRACKING),
    "relief-valve": of("relief-valve", {"set_pressure": between(1.5e5, 6e5)}, a=SIZE, b=st.just({}) | MOVING).map(disc),
    "counterbalance": of(
        "counterbalance", {"set_pressure": between(3e5, 9e5)} | PILOT, a=SIZE, b=st.just({}) | MOVING
    ).map(disc),
    "pilot-check": of("pilot-check", PILOT, CRACKING, a=SIZE),
    "pressure-compensator": of(
        "pressure-compensator", {"set_drop": between(2e4, 2e5), "senses": SENSES}, a=SIZE, b=st.just({}) | MOVING
    ),
    "loss-curve": of("loss-curve", {"loss": st.sampled_from([
        {"flow": [0.0, 0.005, 0.01], "head": [0.0, 1.0, 4.0]}, {"flow": [0.0, 0.01], "head": [3.0, 3.0]},
        {"flow": [0.01], "drop": [2e4]}, {"flow": [0.0, 0.004, 0.01], "head": [0.0, 0.0, 2.0]},
    ])}),
    "rupture-disc": of("rupture-disc", {"burst_pressure": between(1.1e5, 1.6e5)}, a=SIZE),
    "surge-anticipating": of(
        "surge-anticipating",
        {"opening_time": between(0.05, 0.3), "closing_time": between(0.1, 0.5), "low_set": between(1.5e5, 2.8e5)},
        {"high_set": between(3.2e5, 4e5), "trip": between(0.1, 0.6), "hold": between(0.0, 0.3)},
        a=SIZE,
    ),
    "pressure-reducing": of("pressure-reducing", {"set_pressure": between(1.5e5, 4e5)} | SLOW, a=SIZE),
    "pressure-sustaining": of("pressure-sustaining", {"set_pressure": between(1.5e5, 4e5)} | SLOW, a=SIZE),
    "flow-control": of("flow-control", {"set_flow": between(1e-3, 2e-2)} | SLOW, a=SIZE),
    "pump": of(
        "pump",
        {"curve": st.one_of(
            st.fixed_dictionaries({"flow": st.just([0.01]), "head": st.builds(lambda h: [h], between(3.0, 40.0))}),
            st.just({"flow": [0.0, 0.01, 0.02], "head": [30.0, 25.0, 10.0]}),
            st.just({"flow": [0.0, 0.005, 0.01, 0.02], "head": [30.0, 28.0, 24.0, 8.0]}),
        )},
        {"speed": st.one_of(between(0.5, 1.2), st.builds(ramp, between(0.1, 0.4), between(0.05, 0.4), ONE, NONE)),
         "check_valve": st.booleans()},
        a=st.sampled_from([{}, {"rated_speed": 150.0, "inertia": 0.5}]),
    ),
    "turbine": of(
        "turbine",
        {"diameter": between(0.03, 0.08), "speed": between(0.0, 150.0), "hill_chart": st.just(HILL)},
        {"opening": st.one_of(between(0.1, 1.0), st.builds(ramp, between(0.1, 0.5), between(0.01, 0.4), ONE, NONE))},
        a=st.sampled_from([{}, {"inertia": 0.05, "trip": 0.2}]),
    ),
    **{f"displacement-{kind}": of(
        f"displacement-{kind}",
        {"displacement": between(1e-6, 2e-5), "speed": st.one_of(between(-100.0, 150.0), st.builds(
            ramp, between(0.1, 0.4), between(0.05, 0.4), st.just(100.0), NONE)), "leakage": between(1e-8, 1e-7)},
        {"setting": between(-1.0, 1.0), "setting_time": between(0.02, 0.5), "friction_torque": between(0.0, 5.0)},
    ) for kind in ("pump", "motor")},
    "weir": of("weir", {"width": between(0.01, 0.1), "crest": between(10.0, 25.0)}, {"kind": st.just("broad")}),
    "sluice-gate": of(
        "sluice-gate", {"width": between(0.01, 0.1), "sill": between(10.0, 25.0), "opening": between(0.01, 1.0)}
    ),
    "culvert": of("culvert", {
        "diameter": between(0.02, 0.1), "length": between(2.0, 10.0), "manning": st.just(0.012),
        "inverts": st.sampled_from([[15.0, 15.0], [19.0, 18.5], [22.0, 22.5]]),
        "inlet": st.sampled_from(["circular-concrete-square-edge", "circular-metal-mitred"]),
    }),
    "manhole": of("manhole", {"crest": between(15.0, 24.0), "area": st.just(1e-3), "perimeter": st.just(0.1)}),
    "hydrant": of("hydrant", {"flow": between(1e-4, 5e-3), "opening": OPENING}),
    "leak": of("leak", {"coefficient": between(1e-7, 1e-5), "opening": OPENING}, {"exponent": between(0.5, 1.5)}),
}  # fmt: skip
NODES = {
    "junction": of("junction", {}, {"demand": between(-2e-3, 5e-3)}),
    "inflow": of("inflow", {"flow": between(-2e-3, 5e-3)}),
    "reservoir": of("reservoir", {"head": between(10.0, 30.0)}),
    "tank": of(
        "tank",
        {"area": between(0.2, 5.0), "level": between(10.0, 25.0)},
        {"height": st.just(25.5)} | CONNECTION,
    ),
    "chamber": of("chamber", {"volume": between(1e-3, 1.0)}),
    "accumulator": st.one_of(
        of(
            "accumulator",
            {"volume": between(0.1, 1.0), "gas_volume": between(0.02, 0.09)},
            CONNECTION,
        ),
        of(
            "accumulator",
            {
                "volume": between(0.1, 1.0),
                "diameter": between(0.3, 0.6),
                "level": between(0.05, 0.25),
            },
            {
                "slope": between(0.0, 1.0),
                "bottom": between(-1.0, 2.0),
                "compressor": st.just(COMPRESSOR),
            }
            | CONNECTION,
        ),
        of(
            "accumulator",
            {"volume": between(0.1, 1.0), "precharge": between(1.2e5, 4e5)},
            {"exponent": between(1.0, 1.4)} | CONNECTION,
        ),
    ),
    "air-valve": of(
        "air-valve",
        {
            "inlet": st.one_of(
                between(0.02, 0.08), st.just({"pressure": [2e3, 3e4], "flow": [0.05, 0.15]})
            ),
            "outlet": st.one_of(
                between(0.005, 0.05), st.just({"pressure": [5e3, 5e4], "flow": [0.04, 0.1]})
            ),
        },
        {"automatic": between(1e-3, 3e-3)},
        a=st.sampled_from(
            [{}, *({key: value, "throttled_outlet": 4e-3} for key, value in SWITCHES.items())]
        ),
    ),
}


# warning of numba while it compiles
EXPERIMENTAL = "ignore:First-class function type feature is experimental"
# other warnings fail, such as of NaN values
pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)
ELSEWHERE = {
    "basin",
    "mass",
    "frame",
    "body",
    "cylinder",
    "damper",
    "end-stop",
    "force",
    "spring",
    "spool-valve",
    "torque",
    # it needs a tank, see parts/test_altitude_valve.py
    "pin",
    "bushing",
    "shuttle",
    "altitude-valve",
    "conduit",  # in parts/test_conduit.py
    "solenoid",  # in parts/test_solenoid.py
    # of networks of rotation, electricity and heat, in parts/test_networks.py
    "shaft",
    "housing",
    "gear",
    "torsion-spring",
    "bearing",
    "clutch",
    "rack",
    "terminal",
    "ground",
    "voltage-source",
    "current-source",
    "resistor",
    "inductor",
    "capacitor",
    "switch",
    "diode",
    "dc-motor",
    "heat-capacity",
    "ambient",
    "thermal-conductor",
    "convection",
    "heat-source",
    "heat-exchanger",  # in parts/test_heat_in_fluid.py
}
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
        by_valve = (
            stiff and end == "b" and places[end]["type"] != "junction" and draw(st.booleans())
        )
        links[f"to-{end}"] = valve(side, end, 2e-3) if by_valve else main(side, end)
    return places, links


def main(start: str, end: str) -> dict:
    return pipe(start, end, 60.0, 0.1, 1000.0, 4, friction={"model": "steady", "factor": 0.02})


def case_with_probes(places: dict, links: dict, settings: dict, end: float = 1.0) -> dict:
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
    if part["type"] in ("leak", "hydrant"):
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
def test_with_flow_in_both_directions_the_ledger_closes(table, kind, data, settings):
    """The mass ledger closes and the run finishes while the upper lake falls below the lower lake and rises again."""
    part = data.draw((LINKS if table == "links" else NODES)[kind])
    places, links = data.draw(joined(table, part, settings))
    places["up"] = lake(data.draw(st.sampled_from([
        {"time": [0.0, 0.3, 0.5, 0.8], "value": [HEAD + 10.0, HEAD + 10.0, HEAD - 8.0, HEAD + 15.0]},
        {"time": [0.0, 0.3, 0.7], "value": [HEAD + 10.0, HEAD - 8.0, HEAD + 15.0], "kind": "step"},
        ramp(0.2, 0.4, HEAD - 8.0, HEAD + 15.0),
    ])))  # fmt: skip
    shown = outcome_of(case_with_probes(places, links, settings))
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
        "pump": {"speed": 0.0},
        "turbine": {"speed": 0.0},
        "displacement-pump": {"speed": 0.0},
        "displacement-motor": {"speed": 0.0},
        "leak": {"opening": 0.0},
        "hydrant": {"opening": 0.0},
        "junction": {"demand": 0.0},
        "inflow": {"flow": 0.0},
        "tank": {"level": HEAD},
        "reservoir": {"head": HEAD},
    }.get(kind, {})
    part |= still
    shown = outcome_of(case_with_probes(*data.draw(joined(table, part, settings)), settings))
    if shown.ended == "refused":
        return
    assert shown.ended == "finished"
    by_courant = "courant" in settings and METHODS[settings["method"]].explicit
    rtol = settings.get("rtol", 1e-6)
    swings, flows = (1e-3, 1e-9) if by_courant else (max(1.0, 3e5 * rtol), 0.1 * rtol**0.5)
    assert (
        max(np.ptp(values) for name, values in shown.rows.items() if ".pressure" in name) < swings
    )
    assert (
        max(np.max(np.abs(values)) for name, values in shown.rows.items() if ".flow" in name)
        < flows
    )
