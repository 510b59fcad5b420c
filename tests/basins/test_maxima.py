"""Greatest depths, speeds, times of arrival and durations of wetting in cells of water, and run-up on shores."""

import math
from importlib import import_module

import meshio
import numpy as np
import pytest
from pytest import approx
from reference.basins import PLANE, assert_equal_files, halved, model_of, run_in_two_parts
from reference.meshes import write
from reference.scenes import GRAVITY, scene

import fvsolve
from fvsolve.errors import CaseError, FvsolveError

# Thacker's bowl of radius 1 m: depth [m], and displacement of the water over the radius
DEEP, ETA = 0.1, 0.5
RATE = math.sqrt(2.0 * GRAVITY * DEEP)  # angular velocity of the water [1/s]
PERIOD = 2.0 * math.pi / RATE
ABOUT = {"shore": {"basin": "bowl", "about": [2.0, 2.0], "sectors": 16}}


def bowl(n=48, output=None, end=PERIOD, **more) -> dict:
    """Case of Thacker's planar surface (1981), which rotates in the bowl -DEEP (1 - r^2) around (2, 2)."""
    water = {"level": f"{ETA * DEEP}*(2*(x - 2) - {ETA})", "u": 0.0, "v": ETA * RATE}
    basin = {
        "type": "basin",
        "size": [4.0, 4.0],
        "cells": [n, n],
        "level": 0.0,
        "start": water,
        "bed": f"{-DEEP}*(1 - (x - 2)^2 - (y - 2)^2)",
        **more,
    }
    case = scene({"bowl": basin}, {}, end, PLANE, [], end)
    case["output"] |= {"fields": 1, "maxima": ["bowl"], "wet_depth": 1e-3, "run_up": ABOUT} | (
        output or {}
    )
    return case


@pytest.mark.parametrize("more", [{}, {"holes": [[0.0, 0.0, 0.25, 0.25]]}], ids=["grid", "faces"])
def test_rotating_water_in_a_bowl_reaches_the_depths_speeds_and_times_of_thacker(more):
    """A cell at (r, angle) is wet while cos(w t - angle) > c: |r - ETA (cos w t, sin w t)|^2 < 1 - wet depth / DEEP."""
    case = bowl(**more)
    found, centre = fvsolve.run(case).maxima["bowl"], fvsolve.load(case).meshes["bowl"].centre - 2.0
    r, angle = np.hypot(*centre.T), np.arctan2(centre[:, 1], centre[:, 0])
    cosine = (r**2 + ETA**2 - 1.0 + 0.01) / (2.0 * ETA * r)
    half, depth = np.arccos(np.clip(cosine, -1.0, 1.0)) / RATE, DEEP * (1.0 - (r - ETA) ** 2)
    begins, inner, once = (
        (angle / RATE - half) % PERIOD,
        r < 0.25,
        (cosine > -0.95) & (cosine < 0.9),
    )
    dry = once & (cosine > np.cos(angle) + 0.1) & (begins < 0.95 * PERIOD)

    def error(name, exact, where):
        return np.mean(np.abs(found[name] - exact)[where])

    assert error("max_depth", depth, cosine < 0.9) < 0.02 * DEEP
    assert (
        error("max_surface", found["max_depth"] - DEEP * (1.0 - r**2), cosine < 0.9) < 0.002 * DEEP
    )
    assert error("max_speed", ETA * RATE, inner) < 0.03 * ETA * RATE
    assert error("max_hazard", ETA * RATE * depth, inner) < 0.03 * ETA * RATE * DEEP
    assert error("wet_duration", 2.0 * half, once) < 0.01 * PERIOD
    assert dry.sum() > 400 and error("arrival_time", begins, dry) < 0.012 * PERIOD
    assert (
        found["wet_duration"][inner] == approx(PERIOD, rel=1e-9)
        and not found["arrival_time"][inner].any()
    )
    never = r > 1.0 + ETA + 0.1
    for name in ("max_depth", "max_surface", "max_speed", "max_hazard", "arrival_time"):
        assert np.isnan(found[name][never]).all() and np.isfinite(found[name][r < 1.0]).all()
    assert not found["wet_duration"][never].any()


def test_run_up_in_the_bowl_is_that_of_thacker_in_every_direction():
    """The shoreline reaches r = 1 + ETA, the height DEEP (r^2 - 1); the error is about half a cell times the slope."""
    exact, errors = DEEP * ((1.0 + ETA) ** 2 - 1.0), []
    for n in (20, 60):
        run = fvsolve.run(bowl(n, end=1.1 * PERIOD, output={"fields": 0}))
        run_up, slope = run.run_up["shore"]["run_up"], 2.0 * DEEP * (1.0 + ETA)
        errors.append(np.abs(run_up - exact).mean() / (0.5 * slope * 4.0 / n))
        assert np.abs(run_up - exact).max() < 2.0 * slope * 4.0 / n
        assert run.summary["run_up"]["shore"]["greatest"] == run_up.max()
    assert max(errors) < 1.0


def dam(**numerics) -> dict:
    """Case of a dam at x = 20 m that breaks over a dry bed; the water before it is 1 m deep."""
    basin = {
        "type": "basin",
        "size": [60.0, 1.0],
        "cells": [300, 1],
        "level": 0.0,
        "start": {"level": "where(x < 20, 1, 0)"},
    }
    case = scene({"flume": basin}, {}, 4.0, PLANE | numerics, [], 4.0)
    case["output"] |= {"maxima": ["flume"], "wet_depth": 0.05, "fields": 0}
    return case


@pytest.mark.parametrize(
    "numerics", [{}, {"method": "rodas-5p", "rtol": 1e-4}], ids=["explicit", "implicit"]
)
def test_the_tongue_of_a_dam_break_arrives_at_ritters_time(numerics):
    """Depth (2 c - x / t)^2 / (9 g) reaches d at t = x / (2 c - 3 sqrt(g d)), and stays above it."""
    case = dam(**numerics)
    if "rtol" in numerics:
        del case["numerics"]["courant"]
    found = fvsolve.run(case).maxima["flume"]
    x = (np.arange(300) + 0.5) * 0.2 - 20.0
    at = (x > 4.0) & (x < 12.0)
    exact = x[at] / (2.0 * math.sqrt(GRAVITY) - 3.0 * math.sqrt(GRAVITY * 0.05))
    assert found["arrival_time"][at] == approx(exact, rel=0.05)
    assert found["wet_duration"][at] == approx(4.0 - found["arrival_time"][at], rel=1e-9)


def slope(**more) -> dict:
    """Case of a hump of water that runs up a beach along x, higher where y is small."""
    start = {"level": "0.3 + 0.1*exp(-(x - 1)^2) * (1 + 0.5*cos(y))"}
    beach = {
        "type": "basin",
        "size": [6.0, 3.0],
        "cells": [60, 30],
        "level": 0.3,
        "bed": "max(0, 0.15*(x - 2))",
    }
    case = scene({"beach": beach | {"start": start} | more}, {}, 3.0, PLANE, [], 0.1)
    line = {"basin": "beach", "from": [0, 0], "to": [0, 3], "sectors": 10}
    case["output"] |= {"fields": 2, "run_up": {"shore": line}}
    return case


def test_run_up_of_a_turned_scene_is_the_same_along_the_turned_line_and_at_the_shifted_angle():
    turned = slope(
        size=[3.0, 6.0],
        cells=[30, 60],
        bed="max(0, 0.15*(y - 2))",
        start={"level": "0.3 + 0.1*exp(-(y - 1)^2) * (1 + 0.5*cos(3 - x))"},
    )
    about, far = (
        {"basin": "beach", "about": [1.02, 1.47]},
        {"basin": "beach", "about": [1.53, 1.02], "radius": 2.5},
    )
    cases = slope(), turned
    cases[0]["output"]["run_up"] |= {"round": about, "near": about | {"radius": 2.5}}
    cases[1]["output"]["run_up"] = {
        "shore": {"basin": "beach", "from": [3, 0], "to": [0, 0], "sectors": 10},
        "round": {**far, "radius": 99},
        "near": far,
    }
    one, other = (fvsolve.run(case) for case in cases)
    assert one.run_up["shore"]["run_up"] == approx(other.run_up["shore"]["run_up"], abs=1e-13)
    assert np.ptp(one.run_up["shore"]["run_up"]) > 0.02
    for name in ("round", "near"):
        values, again = (run.run_up[name]["run_up"] for run in (one, other))
        # 90 deg are 12 of 48 sectors
        assert values == approx(np.roll(again, -12), abs=1e-13, nan_ok=True)
    assert not np.array_equal(
        one.run_up["round"]["run_up"], one.run_up["near"]["run_up"], equal_nan=True
    )
    assert one.run_up["round"]["angle"][12] == 90.0


def test_a_narrow_strip_along_a_line_leaves_out_the_beach_behind_it():
    case = slope()
    case["output"]["run_up"]["strip"] = case["output"]["run_up"]["shore"] | {"width": 2.0}
    case["output"]["run_up"]["part"] = case["output"]["run_up"]["shore"] | {
        "to": [0, 1.5],
        "sectors": 5,
    }
    found = fvsolve.run(case).run_up
    assert (found["shore"]["x"] > 3.0).all() and (found["strip"]["x"] < 2.0).all()
    assert np.array_equal(found["part"]["run_up"], found["shore"]["run_up"][:5])
    assert np.array_equal(found["part"]["distance"], found["shore"]["distance"][:5])


def test_a_wall_that_moves_in_raises_the_greatest_depth(tmp_path):
    """Slow displacement of a tenth of a basin: the depth becomes 1 / 0.9 of the former, on the grid and on faces."""
    travel, size, cells = {"time": [0.0, 20.0], "value": [0.0, 0.1]}, (1.0, 0.3), (10, 3)
    mesh = write(tmp_path / "halved.msh", *halved(size, cells))
    for shape, side in (
        ({"size": size, "cells": cells}, {"side": "west"}),
        ({"mesh": {"file": str(mesh)}}, {}),
    ):
        patches = {"west": {"travel": travel, **side}}
        case = scene(
            {"tank": {"type": "basin", "level": 0.2, "patches": patches, **shape}},
            {},
            20.0,
            PLANE,
            [],
            20.0,
        )
        case["output"] |= {"maxima": ["tank"]}
        assert fvsolve.run(case).maxima["tank"]["max_depth"] == approx(0.2 / 0.9, rel=0.01)


def test_a_resumed_run_has_the_same_files_of_greatest_values(tmp_path, monkeypatch):
    for name in ("CHECKPOINT_SECONDS", "CHUNK_SECONDS"):  # checkpoints after 1000, 1250, ... steps
        monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), name, 0.0)
    case = slope()
    case["numerics"] = {"end": 3.0, "scheme": "muscl", "method": "ssp-rk2", "step": 2e-3}
    run_in_two_parts(case, tmp_path, 2.0)
    assert_equal_files(
        tmp_path, ["maxima-beach.vtu", "run_up-shore.csv", "fields/beach-000002.vtu", "history.csv"]
    )
    assert (tmp_path / "run" / "run_up-shore.png").is_file()


@pytest.mark.parametrize("order", [("plain", "bowl", "other"), ("other", "plain", "bowl")])
def test_each_of_several_basins_has_the_greatest_values_of_a_case_of_its_own(order):
    """Two basins record them, one does not; basins without links do not depend on each other, nor do probes."""
    alone = bowl(12)
    alone["output"].pop("run_up")
    alone["numerics"] = {"end": 1.0, "scheme": "muscl", "method": "ssp-rk2", "step": 5e-3}
    basin = alone["nodes"]["bowl"]
    other = basin | {"start": {"level": f"{0.5 * ETA * DEEP}*x", "u": 0.0, "v": 0.0}}
    other["cells"] = [14, 10]
    found, points = {}, {}
    for name, node in (("bowl", basin), ("other", other)):
        case = alone | {"nodes": {name: node}}
        probe = f"{name}.depth@1.9,2.3"
        case["output"] = alone["output"] | {"maxima": [name], "probes": [probe]}
        result = fvsolve.run(case)
        found[name], points[probe] = result.maxima[name], result[probe]
    nodes = {"plain": other, "bowl": basin, "other": other}
    together = alone | {"nodes": {name: nodes[name] for name in order}}
    together["output"] = alone["output"] | {"maxima": ["bowl", "other"], "probes": [*points]}
    run = fvsolve.run(together)
    for probe, values in points.items():
        assert np.array_equal(run[probe], values)
    assert sorted(run.maxima) == ["bowl", "other"]
    for name, expected in found.items():
        for quantity, values in expected.items():
            assert np.array_equal(run.maxima[name][quantity], values, equal_nan=True), quantity


def test_greatest_values_change_no_bit_of_a_run_and_are_in_the_last_frame(tmp_path):
    with_maxima, without = slope(), slope()
    del without["output"]["run_up"]
    run = fvsolve.run(with_maxima, out=tmp_path / "run", pictures=False)
    assert fvsolve.run(without, out=tmp_path / "whole", pictures=False).ok
    assert_equal_files(
        tmp_path, ["history.csv", "fields/beach-000000.vtu", "fields/beach-000001.vtu"]
    )
    last = meshio.read(tmp_path / "run" / "fields" / "beach-000002.vtu").cell_data
    first = meshio.read(tmp_path / "run" / "fields" / "beach-000001.vtu").cell_data
    assert set(last) - set(first) == set(run.maxima["beach"]) and len(run.maxima["beach"]) == 6
    in_memory = fvsolve.run(with_maxima).maxima["beach"]
    for name, values in fvsolve.open_run(tmp_path / "run").maxima["beach"].items():
        assert np.array_equal(values, last[name][0], equal_nan=True)
        assert np.array_equal(values, in_memory[name], equal_nan=True)
    model = model_of(without)
    records = [terms.record for terms in model.functions.cast.components()]
    assert model.shapes.maxima == 0 and "surface_maxima: record_maxima" not in records
    fvsolve.run(without, out=tmp_path / "run", force=True, pictures=False)
    assert not list((tmp_path / "run").glob("*maxima*")) and not list(
        (tmp_path / "run").glob("run_up*")
    )


def test_expectations_on_a_run_up_name_its_greatest_value_and_that_at_a_place():
    case = slope()
    case["output"]["run_up"]["round"] = {"basin": "beach", "about": [1.0, 1.5]}
    run_up = fvsolve.run(case).run_up
    shore, angles = run_up["shore"]["run_up"], run_up["round"]["run_up"]
    claims = {
        "max(run_up.shore)": shore.max(),
        "min(run_up.shore)": shore.min(),
        "at(run_up.shore, 0.4)": shore[1],
        "at(run_up.shore, 290 cm)": shore[9],
        "at(run_up.round, -5)": angles[47],
    }
    case["expect"] = {
        text: {"value": float(value), "rtol": 1e-12} for text, value in claims.items()
    }
    assert [claim.state for claim in fvsolve.run(case).expectations] == ["holds"] * 5
    case["expect"] = {"max(run_up.shore)": {"value": "1 m", "rtol": 0.1}}
    assert fvsolve.run(case).expectations[0].state == "fails"


def test_faults_of_maxima_and_run_ups_are_named_all_at_once():
    case = slope()
    case["nodes"]["block"] = {
        "type": "basin",
        "physics": "liquid",
        "size": [1, 1],
        "cells": [2, 2],
        "pressure": 5e5,
        "thickness": 0.1,
    }
    case["output"] |= {
        "maxima": ["beech", "block", 3],
        "run_up": {
            "a": {"basin": "block", "about": [0, 0]},
            "b": {"basin": "beach", "from": [1, 1], "to": [1, 1]},
        },
    }
    case["expect"] = {
        "max(run_up.c)": {"value": 1, "rtol": 1},
        "at(run_up.b)": {"value": 1, "rtol": 1},
        "mean(run_up.b)": {"value": 1, "rtol": 1},
    }
    with pytest.raises(CaseError) as error:
        fvsolve.load(case)
    for text in (
        'output.maxima[0]: no basin named "beech"; did you mean "beach"?',
        'block has the physics "liquid"; expected a basin with cells and the physics "free-surface"',
        "output.maxima[2]: no basin named 3",
        "output.run_up.b.to: is also the start of the line",
        'output.run_up.a.basin: block has the physics "liquid"',
        'no run-up named "c"',
        "expected at(run_up.NAME, PLACE)",
        "a run-up has no mean",
    ):
        assert text in str(error.value)
    case["output"] |= {
        "maxima": [],
        "run_up": {
            "a": {"basin": "beach"},
            "b": {"basin": "beach", "to": [1, 1]},
            "c": {"basin": "beach", "about": [0, 0], "width": 1},
        },
        "wet_depth": 0.0,
    }
    case["expect"] = {"at(run_up.shore, 4 m)": {"value": 1, "rtol": 1}}
    with pytest.raises(CaseError) as error:
        fvsolve.load(case)
    for text in (
        "output.run_up.a: expected one of about, from, to",
        "output.run_up.b: from is missing",
        "about and width are given",
        "output.wet_depth: 0",
    ):
        assert text in str(error.value)
    case = slope()
    case["expect"] = {"at(run_up.shore, 4 m)": {"value": 1, "rtol": 1}}
    with pytest.raises(CaseError, match="4 m"):
        fvsolve.load(case)


def test_an_unknown_run_up_of_a_result_is_named(tmp_path):
    run = fvsolve.run(slope())
    assert run.plot_run_up("shore").axes[0].get_xlabel() == "distance [m]"
    with pytest.raises(FvsolveError, match='no run-up "shor"; did you mean "shore"'):
        run.plot_run_up("shor")
