"""Strategies for one part of most kinds with random keys, for hypothesis."""

from __future__ import annotations

from hypothesis import strategies as st
from reference.scenes import ramp

from invariance.random_scenes import FRICTIONS, between

ONE, NONE = st.just(1.0), st.just(0.0)
CRACKING = {"cracking_pressure": between(0.0, 5e3)}
SLAMS = {"rate": [1.0, 10.0], "reverse_velocity": [0.05, 1.0]}
COMPRESSOR = {"start": 0.28, "stop": 0.2, "flow": 1e-3}
SWITCHES = {"switch": 3e3, "switch_velocity": 0.1}
SLOW = {"time_constant": between(0.1, 5.0)}
SIZE = st.one_of(
    st.fixed_dictionaries({"area": between(1e-4, 5e-3)}),
    st.fixed_dictionaries({"diameter": between(0.01, 0.08), "loss_coefficient": between(0.5, 20.0)}),
    st.fixed_dictionaries({"Kv": between(3.0, 100.0)}),
)
MOVING = st.one_of(
    st.fixed_dictionaries({"time_constant": between(0.02, 0.5)}),
    st.fixed_dictionaries({"natural_frequency": between(1.0, 10.0), "damping_ratio": between(0.3, 1.5)}),
)
OPENING = st.one_of(st.just(1.0), between(0.1, 1.0), st.builds(ramp, between(0.1, 0.5), between(0.01, 0.4), ONE, NONE))
HILL = [
    {"opening": 0.3, "unit_speed": [30, 70, 110], "unit_flow": [0.32, 0.3, 0.2], "efficiency": [0.6, 0.8, 0.1]},
    {"opening": 1.0, "unit_speed": [110, 70, 30], "unit_flow": [0.7, 1.0, 1.05], "efficiency": [0.2, 0.9, 0.6]},
]
CONDUIT = {"length": between(5.0, 60.0), "diameter": between(0.05, 0.2), "friction": st.sampled_from(FRICTIONS[1:])}
CONNECTION = {"connection": st.fixed_dictionaries(
    {"diameter": between(0.03, 0.1), "loss_in": between(0.5, 5.0), "loss_out": between(0.5, 5.0)}
)}  # fmt: skip


def of(
    kind: str, keys: dict | None = None, maybe: dict | None = None, **tables: st.SearchStrategy
) -> st.SearchStrategy:
    """Strategy for tables of a kind of part, merged with the tables that `tables` draw."""
    plain = st.fixed_dictionaries({"type": st.just(kind), **(keys or {})}, optional=maybe or {})
    return st.builds(
        lambda one, *more: one | {k: v for table in more for k, v in table.items()}, plain, *tables.values()
    )


def disc(one: dict) -> dict:
    """Table with an overpressure, if the valve has a disc with a lag or a mass, or is a relief valve."""
    moves = "time_constant" in one or "natural_frequency" in one
    return one | ({"overpressure": 2e4} if moves or one["type"] == "relief-valve" else {})


LINKS = {
    "pipe": of("pipe", CONDUIT | {"wave_speed": between(600.0, 1300.0), "cells": st.integers(1, 9)}),
    "rigid-column": of("rigid-column", CONDUIT, {"minor_loss": between(0.0, 3.0)}),
    "valve": of("valve", {"opening": OPENING}, {"characteristic": st.just("equal-percentage")}, a=SIZE),
    "orifice": of("orifice", {}, {"laminar_reynolds": between(5.0, 100.0)}, a=SIZE),
    "check-valve": of("check-valve", {}, CRACKING, a=SIZE, b=st.just({}) | MOVING).map(disc)
    | of("check-valve", {"area": between(1e-4, 5e-3), "deceleration": st.just(SLAMS)}, CRACKING),
    "relief-valve": of("relief-valve", {"set_pressure": between(1.5e5, 6e5)}, a=SIZE, b=st.just({}) | MOVING).map(disc),
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
    "leak": of("leak", {"coefficient": between(1e-7, 1e-5), "opening": OPENING}, {"exponent": between(0.5, 1.5)}),
}  # fmt: skip
NODES = {
    "junction": of("junction", {}, {"demand": between(-2e-3, 5e-3)}),
    "inflow": of("inflow", {"flow": between(-2e-3, 5e-3)}),
    "reservoir": of("reservoir", {"head": between(10.0, 30.0)}),
    "tank": of(
        "tank", {"area": between(0.2, 5.0), "level": between(10.0, 25.0)}, {"height": st.just(25.5)} | CONNECTION
    ),
    "chamber": of("chamber", {"volume": between(1e-3, 1.0)}),
    "accumulator": st.one_of(
        of("accumulator", {"volume": between(0.1, 1.0), "gas_volume": between(0.02, 0.09)}, CONNECTION),
        of(
            "accumulator",
            {"volume": between(0.1, 1.0), "diameter": between(0.3, 0.6), "level": between(0.05, 0.25)},
            {"slope": between(0.0, 1.0), "bottom": between(-1.0, 2.0), "compressor": st.just(COMPRESSOR)} | CONNECTION,
        ),
        of(
            "accumulator",
            {"volume": between(0.1, 1.0), "precharge": between(1.2e5, 4e5)},
            {"exponent": between(1.0, 1.4)} | CONNECTION,
        ),
    ),
    "air-valve": of(
        "air-valve",
        {"inlet": between(0.02, 0.08), "outlet": between(0.005, 0.05)},
        {"automatic": between(1e-3, 3e-3)},
        a=st.sampled_from([{}, *({key: value, "throttled_outlet": 4e-3} for key, value in SWITCHES.items())]),
    ),
}  # fmt: skip
