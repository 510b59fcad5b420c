"""Balances of basins: flow through open sides and by given velocities is booked at the patch that it passes."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import SIDES, model_of, on_sides
from reference.jacobians import stray
from reference.meshes import boundary, triangles, write
from reference.pairs import pairs
from reference.scenes import RHO, WATER, scene

import fvsolve

SIZE = (4.0, 2.0)
MIDDLES = {"west": (0.0, 1.0), "east": (4.0, 1.0), "south": (2.0, 0.0), "north": (2.0, 2.0)}
PATHS = ["grid", "graded", "holes", "triangles"]
OPEN = {side: {"side": side, "boundary": "open"} for side in SIDES}
IMPEDANCE = {side: {"side": side, "impedance": (k + 1) * 1e6} for k, side in enumerate(SIDES)}
TABLE = {"name": "Water", "law": "table"}
SPEED = math.sqrt(2.2e9 / RHO)


def pool(path: str, folder, patches: dict, **more) -> dict:
    """Return a basin of 4 m x 2 m."""
    if path != "triangles":
        shape = {"graded": {"grading": [2.0, 1.5]}, "holes": {"holes": [[1.0, 0.5, 1.5, 1.0]]}}.get(
            path, {}
        )
        return {
            "type": "basin",
            "size": list(SIZE),
            "cells": [32, 16],
            "patches": patches,
            **shape,
            **more,
        }
    points, cells = triangles(SIZE, 0.125)
    write(
        folder / "t.msh", points, cells.tolist(), on_sides(points, boundary(cells), SIZE, patches)
    )
    stated = {
        name: {key: value for key, value in patch.items() if key != "side"}
        for name, patch in patches.items()
    }
    return {"type": "basin", "mesh": {"file": str(folder / "t.msh")}, "patches": stated, **more}


def case(basin: dict, end: float, scheme: str, probes=(), **top) -> dict:
    numerics = {"scheme": scheme, "limiter": "van-leer", "method": "ssp-rk2", "courant": 0.4}
    return scene({"pool": basin}, {}, end, numerics, probes, end / 10, **top)


def physics(law: str) -> dict:
    if law == "water":
        return {"level": 1.0}
    return {"physics": "liquid", "pressure": 2e6, "thickness": 0.1}


def fluid(law: str) -> dict:
    return TABLE if law == "table" else WATER | {"law": "linear" if law == "water" else law}


def schemes(path: str) -> list[str]:
    return ["upwind", "muscl"] + (["upwind5", "weno5"] if path in ("grid", "graded") else [])


LAWS = ["water", "linear", "log", "table"]


@pytest.mark.parametrize(
    "path, scheme, law",
    [one for one in pairs(PATHS, schemes("grid"), LAWS) if one[1] in schemes(one[0])],
)
def test_gain_of_cells_at_an_open_side_is_accounted_to_it(path, scheme, law, tmp_path):
    """Noise near the middle of a side is booked at this side alone; noise everywhere, at all sides."""
    patches = OPEN if law == "water" else IMPEDANCE
    basin = pool(path, tmp_path, patches, **physics(law))
    model = model_of(case(basin, 1.0, scheme, fluid=fluid(law)))
    field, rng = model.meshed[0], np.random.default_rng(0)
    _, per = field.mass()
    noise = 0.1 * model.scale * rng.normal(size=model.y_size)
    for side in (*SIDES, None):
        y, x0 = noise.copy(), MIDDLES.get(side)
        if side is not None:
            field.deviations(y)[:, (field.x - x0[0]) ** 2 + (field.y - x0[1]) ** 2 > 0.09] = 0.0
        dydt, out = model.evaluate(0.0, y)
        booked = out[model.layout["supply"] :][: model.ledgers]
        gains = per * field.deviations(dydt)[0]
        assert np.sum(booked) == approx(np.sum(gains), abs=1e-13 * np.sum(np.abs(gains)))
        for other in SIDES:
            found = booked[model.node_names.index(f"pool.{other}")]
            if side in (None, other):
                assert abs(found) > 1e-6 * np.sum(np.abs(gains))
            else:
                assert found == 0.0


@pytest.mark.parametrize("path", PATHS)
def test_a_stream_through_two_open_sides_shows_at_both(path, tmp_path):
    """1 m3/s enters at the west side and leaves at the east side for 2 s."""
    patches = {side: OPEN[side] for side in ("west", "east")}
    basin = pool(path, tmp_path, patches, level=1.0, start={"u": 0.5})
    if path == "holes":
        basin["holes"] = [[0.0, 0.0, 4.0, 0.5]]
        basin["start"]["u"] = 1.0 / 1.5
    result = fvsolve.run(case(basin, 2.0, "muscl", ["pool.west.flow", "pool.east.flow"]))
    assert result["pool.west.flow"] == approx(1.0, rel=1e-12)
    assert result["pool.east.flow"] == approx(-1.0, rel=1e-12)
    mass = result.ledger["mass"]
    assert mass["by_node"] == {"pool.west": approx(2.0 * RHO), "pool.east": approx(-2.0 * RHO)}
    assert mass["inflow"] == approx(2.0 * RHO) and mass["outflow"] == approx(2.0 * RHO)
    assert abs(mass["relative"]) < 1e-13 and result.marks == []


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "table"])
@pytest.mark.parametrize("path", PATHS)
def test_a_wave_into_an_empty_half_leaves_half_its_flow_at_either_end(path, law, tmp_path):
    """rho u A / 2 at both ends at the start, as no wave enters; Mach numbers under `log` and `table` are small."""
    patches = {side: OPEN[side] for side in ("west", "east")}
    basin = pool(path, tmp_path, patches, **physics(law), start={"u": 0.01})
    if path == "holes":
        basin["holes"] = [[0.0, 0.0, 4.0, 0.5]]
    model = model_of(case(basin, 0.01, "muscl", fluid=fluid(law)))
    _, out = model.evaluate(0.0, model.start)
    booked, density = out[model.layout["supply"] :], model.meshed[0].row["density"]
    half = 0.5 * density * 0.01 * 0.1 * (1.5 if path == "holes" else 2.0)
    rel = 1e-12 if law == "linear" else 1e-5
    assert booked[model.node_names.index("pool.west")] == approx(half, rel=rel)
    assert booked[model.node_names.index("pool.east")] == approx(-half, rel=rel)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["water", "linear", "log"])
@pytest.mark.parametrize("path", ["graded", "triangles"])
def test_ledgers_with_four_open_sides_close(path, law, tmp_path):
    """A mound leaves through all sides; water also carries a dye."""
    bump = "exp(-4*((x - 1.5)^2 + (y - 0.8)^2))"
    start = (
        {"level": f"1 + 0.2*{bump}", "u": 0.3} if law == "water" else {"pressure": f"1e5*{bump}"}
    )
    basin = pool(path, tmp_path, OPEN, **physics(law), start=start)
    dye = {"scalars": {"dye": {"initial": 1.0}}} if law == "water" else {}
    end = 2.0 if law == "water" else 3.0 / SPEED
    result = fvsolve.run(case(basin, end, "weno5", fluid=fluid(law), **dye))
    for ledger in result.ledger.values():
        assert abs(ledger["relative"]) < 1e-13
    mass = result.ledger["mass"]
    assert set(mass["by_node"]) == {f"pool.{side}" for side in SIDES}
    assert mass["final"] - mass["initial"] == approx(sum(mass["by_node"].values()), rel=1e-9)


@pytest.mark.parametrize("path", PATHS)
def test_a_given_velocity_shows_at_the_patches_that_it_passes(path, tmp_path):
    """0.5 m/s through 2 m x 0.3 m, reversed by `period`; no mass is booked, as the flow is not part of the network."""
    patches = {side: {"side": side} for side in ("west", "east", "north")}
    velocity = {"u": 0.5, "period": 4.0}
    basin = pool(path, tmp_path, patches, physics="transport", velocity=velocity, thickness=0.3)
    if path == "holes":
        basin["holes"] = [[0.0, 0.0, 4.0, 0.5]]
    probes = [f"pool.{side}.flow" for side in patches]
    result = fvsolve.run(case(basin, 3.0, "muscl", probes, scalars={"dye": {"initial": 2.0}}))
    flow = 0.5 * 0.3 * (1.5 if path == "holes" else 2.0) * np.cos(math.pi * result.t / 4.0)
    assert result["pool.west.flow"] == approx(flow, rel=1e-12, abs=1e-12)
    assert result["pool.east.flow"] == approx(-flow, rel=1e-12, abs=1e-12)
    assert not result["pool.north.flow"].any() and result.ledger["mass"]["by_node"] == {}
    assert abs(result.ledger["dye"]["relative"]) < 1e-13


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["water", "linear", "log"])
@pytest.mark.parametrize(
    ("path", "scheme"), [("grid", s) for s in schemes("grid")] + [("triangles", "muscl")]
)
def test_flow_through_open_sides_stays_within_its_pattern(path, scheme, law, tmp_path):
    patches = OPEN if law == "water" else IMPEDANCE
    basin = pool(path, tmp_path, patches, **physics(law))
    if path == "grid":
        basin["cells"] = [14, 12]
    model = model_of(case(basin, 1.0, scheme, fluid=fluid(law)))
    y = model.scale * np.random.default_rng(0).normal(scale=0.02, size=model.y_size)
    assert stray(model, 0.0, y) < 1e-7
