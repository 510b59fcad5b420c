"""A mirrored or turned basin gives the mirrored or turned results.

The results agree to rounding, which limited slopes may increase; a repeated run agrees to the bit.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference.scenes import WATER, reservoir, scene, step, valve

import fvsolve
from invariance.random_scenes import between
from invariance.result_comparison import alike, outcome_of, with_frames

LENGTH, WIDTH = 8.0, 4.0  # exact in binary, like the points of probes
POINTS = [(1.25, 0.75), (4.0, 2.0), (6.5, 3.25)]
SIDES = {
    "x": {"west": "east", "east": "west", "south": "south", "north": "north"},
    "y": {"west": "west", "east": "east", "south": "north", "north": "south"},
    "turned": {"west": "south", "east": "north", "south": "west", "north": "east"},
}
SCHEMES = ["upwind", "muscl", "upwind5", "weno5"]
HUMP = "exp(-2*((({x}) - {a})^2 + (({y}) - {b})^2))"


def at(mirror: str, x: float, y: float) -> tuple[float, float]:
    """Point of the mirrored or turned basin that corresponds to (x, y)."""
    return {"x": (LENGTH - x, y), "y": (x, WIDTH - y), "turned": (y, x), "": (x, y)}[mirror]


def formula(mirror: str, height: float, a: float, b: float) -> str:
    """Formula of a hump at the point that corresponds to (a, b)."""
    x, y = {
        "x": (f"{LENGTH} - x", "y"),
        "y": ("x", f"{WIDTH} - y"),
        "turned": ("y", "x"),
        "": ("x", "y"),
    }[mirror]
    return f"{height}*" + HUMP.format(x=x, y=y, a=a, b=b)


def basin(mirror: str, drawing: dict) -> dict:
    """Case of a drawn basin, mirrored, turned or unchanged (mirror ""), drained by a valve at one side."""
    numerics, cells = drawing["numerics"], drawing["cells"]
    side = drawing["side"] if not mirror else SIDES[mirror][drawing["side"]]
    turn = (lambda pair: pair[::-1]) if mirror == "turned" else list
    pool = {
        "type": "basin",
        "physics": drawing["physics"],
        "size": turn([LENGTH, WIDTH]),
        "cells": turn(cells),
        "patches": {"gate": {"side": side}},
    }
    hump = formula(mirror, drawing["height"], *drawing["hump"])
    if drawing["physics"] == "free-surface":
        pool |= {"level": 1.0, "start": {"level": f"1 + {hump}"}, "manning": 0.02}
        pool["bed"] = formula(mirror, drawing["bed"], 5.0, 1.5)
        seen = "depth"
    else:
        pool |= {"pressure": 2e5, "thickness": 0.5, "start": {"pressure": f"1e5*{hump}"}}
        seen = "pressure"
    links = {"tap": valve("pool.gate", "out", 0.02, step(0.5 * drawing["end"], 1.0, 0.4))}
    probes = ["pool.gate.flow", "tap.flow"]
    for x, y in POINTS:
        x, y = at(mirror, x, y)
        probes += [f"pool.{seen}@{x},{y}", f"pool.u@{x},{y}", f"pool.v@{x},{y}"]
    pressure = 101325.0 if drawing["physics"] == "free-surface" else 1.9e5
    case = scene(
        {"pool": pool, "out": reservoir(pressure)},
        links,
        drawing["end"],
        numerics,
        probes,
        drawing["end"] / 16,
    )
    case["output"]["fields"] = 0
    law = drawing["law"]
    return case | {"fluid": {**WATER, "law": law, "bulk_modulus": 2.2e7}}


@st.composite
def basins(draw) -> dict:
    """Strategy for the settings that a basin and its mirror images share."""
    physics = draw(st.sampled_from(["free-surface", "liquid"]))
    settings = draw(
        st.sampled_from(
            [
                {"method": "ssp-rk3", "courant": 0.5},
                {"method": "ssp-rk2", "courant": 0.4},
                {"method": "rk4", "courant": 0.5},
                {"method": "rodas-5p", "rtol": 1e-5},
            ]
        )
    )
    return {
        "physics": physics,
        "law": draw(st.sampled_from(["linear", "log"])) if physics == "liquid" else "linear",
        "numerics": {"scheme": draw(st.sampled_from(SCHEMES)), **settings},
        "cells": [draw(st.sampled_from([8, 12, 16])), draw(st.sampled_from([6, 8]))],
        "side": draw(st.sampled_from(["west", "east", "south", "north"])),
        "height": draw(between(0.05, 0.3)),
        "hump": [draw(between(1.0, 7.0)), draw(between(1.0, 3.0))],
        "bed": draw(st.sampled_from([0.0, 0.3, 1.2])),  # flat, submerged hump, island
        "end": 1.0 if physics == "free-surface" else 0.05,
    }


@pytest.mark.parametrize("mirror", SIDES)
@examples(10)
@given(drawing=basins())
def test_in_a_mirror_or_turned(mirror, drawing):
    """A mirrored or turned basin agrees to rounding, because formulas are evaluated at mirrored points."""
    one = outcome_of(basin("", drawing))
    assert one.ended == "finished"
    assert max(np.ptp(values) for values in one.rows.values()) > 0.0

    def name(probe):
        what, _, place = probe.partition("@")
        if not place:
            return probe
        x, y = (float(one) for one in place.split(","))
        x, y = at(mirror, x, y)
        part, quantity = what.split(".")
        if mirror == "turned":
            quantity = {"u": "v", "v": "u"}.get(quantity, quantity)
        return f"{part}.{quantity}@{x},{y}"

    def sign(probe, values):
        return (
            -values if probe.split("@")[0] == {"x": "pool.u", "y": "pool.v"}.get(mirror) else values
        )

    within = 10 * drawing["numerics"].get("rtol", 1e-10)
    alike(one, outcome_of(basin(mirror, drawing)), within, name, sign)


@examples(10)
@given(drawing=basins(), frames=st.integers(1, 7))
def test_again_and_with_frames(drawing, frames):
    """Field frames and earlier runs of the model do not change a bit."""
    case = basin("", drawing)
    one = outcome_of(case)
    case["output"]["fields"] = frames
    model = fvsolve.build(fvsolve.load(case))
    with with_frames():
        alike(one, outcome_of(model))
    alike(one, outcome_of(model))
