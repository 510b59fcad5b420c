"""Bounds of scalars in basins: kept by default in steps, rows and frames; a notice where a choice breaks them."""

import numpy as np
import pytest
from reference.basins import model_of
from reference.face_fields import triangles
from reference.scenes import pipe, reservoir, scene

import fvsolve

ROUND = 1e-12
DISK = "where((hypot(x - 0.5, y - 0.7) < 0.2)*(abs(x - 0.5) > 0.04), 1, 0)"
PROBES = [f"sheet.dye@{x:.2f},{y:.2f}" for x in (0.25, 0.5, 0.75) for y in (0.25, 0.5, 0.75)]


def shaped(path, shape: str, cells: int = 24) -> dict:
    """Return keys of a unit square of distorted triangles or quadrilaterals, or of rectangles."""
    if shape == "rectangle":
        return {"size": [1.0, 1.0], "cells": [cells, cells]}
    triangles(path, cells, cells, quads=shape == "quadrilaterals")
    return {"mesh": {"file": str(path / f"{cells}x{cells}{shape == 'quadrilaterals'}.vtk")}}


def swirled(shape: dict, numerics: dict, every: float = 0.0031, **dye) -> dict:
    """Return a case of a slotted disk of value 1 in 0, which a vortex distorts."""
    velocity = {"expression": "swirl", "speed": 2.0}
    sheet = {
        "type": "basin",
        "physics": "transport",
        "velocity": velocity,
        "scalars": {"dye": DISK},
        **shape,
    }
    return scene({"sheet": sheet}, {}, 0.3, numerics, PROBES, every, scalars={"dye": dye})


def rows(case: dict, probes=PROBES) -> np.ndarray:
    result = fvsolve.run(case)
    return np.array([result[probe] for probe in probes])


def notices(case: dict) -> list:
    return [one for one in model_of(case).warnings if one.kind == "bounds"]


SHAPES = ("triangles", "quadrilaterals", "rectangle")
WAYS = {  # numerics without a notice of bounds
    "default": {},
    "minmod": {"limiter": "minmod"},
    "monotonized-central": {"limiter": "monotonized-central"},
    "muscl": {"scheme": "muscl"},
    "upwind": {"scheme": "upwind", "method": "ssp-rk2"},
    "ssp-rk2": {"method": "ssp-rk2"},
    "euler": {"method": "euler", "courant": 1.0},
    "ssp-rk3 at 1": {"method": "ssp-rk3", "courant": 1.0},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("way", WAYS)
def test_settings_without_a_notice_stay_within_bounds(way, shape, tmp_path):
    case = swirled(shaped(tmp_path, shape), WAYS[way])
    found, model = rows(case), model_of(case)
    assert notices(case) == []
    assert found.min() > -ROUND and found.max() < 1.0 + ROUND
    state = fvsolve.initial_state(model)
    for t in (0.05, 0.1, 0.2, 0.3):
        state = fvsolve.advance(model, state, t)
        assert state.y.min() > -ROUND and state.y.max() < 1.0 + ROUND


def test_every_row_and_frame_between_steps_stays_within_the_bounds_of_steps(tmp_path):
    """The cubic dense output of upwind with ssp-rk2 at Courant number 0.9 goes from -0.014 to 1.020."""
    import meshio

    case = swirled(
        shaped(tmp_path, "rectangle", 32), {"scheme": "upwind", "method": "ssp-rk2", "courant": 0.9}
    )
    case["output"]["fields"] = 40
    result = fvsolve.run(case, out=tmp_path / "run")
    found = np.array([result[probe] for probe in PROBES])
    assert found.min() >= 0.0 and found.max() <= 1.0
    frames = [
        meshio.read(path).cell_data["dye"][0] for path in sorted((tmp_path / "run").rglob("*.vtu"))
    ]
    assert (
        len(frames) == 41
        and min(f.min() for f in frames) >= 0.0
        and max(f.max() for f in frames) <= 1.0
    )


def test_a_step_that_leaves_the_bounds_is_shown_as_it_is():
    """Rows are limited to the values at both ends of a step, not to the bounds."""
    found = rows(
        swirled({"size": [1.0, 1.0], "cells": [24, 24]}, {"scheme": "upwind5", "method": "ssp-rk3"})
    )
    assert found.max() > 1.01 or found.min() < -0.01


def test_rows_of_pipes_stay_within_the_bounds_of_the_inflow():
    """Rows between steps as long as cell travel times, for a sudden end of the dye."""
    nodes = {
        "a": reservoir(
            2e5, scalars={"dye": {"time": [0.0, 1.0], "value": [1.0, 0.0], "kind": "step"}}
        ),
        "b": reservoir(1e5),
    }
    links = {
        "main": pipe("a", "b", 20.0, 0.3, 20.0, 20, friction={"model": "steady", "factor": 0.03})
    }
    probes = [f"main.dye@{x:.2f}" for x in np.linspace(0.025, 0.975, 20)]
    case = scene(
        nodes,
        links,
        4.0,
        {"scheme": "upwind", "method": "ssp-rk2", "courant": 0.9},
        probes,
        0.013,
        scalars={"dye": {}},
    )
    found = rows(case, probes)
    assert found.max() > 0.5 and found.min() > -ROUND and found.max() < 1.0 + ROUND


@pytest.mark.parametrize("shape", SHAPES)
def test_a_dye_in_sloshing_water_stays_within_its_bounds_by_default(shape, tmp_path):
    pool = {
        "type": "basin",
        "level": 0.5,
        "start": {"level": "0.5 + 0.2*cos(pi*x)"},
        "scalars": {"dye": DISK},
    }
    case = scene(
        {"sheet": pool | shaped(tmp_path, shape)}, {}, 1.0, {}, PROBES, 0.0043, scalars={"dye": {}}
    )
    found = rows(case)
    assert found.min() > -ROUND and found.max() < 1.0 + ROUND and notices(case) == []


def test_decay_alone_does_not_overshoot_its_limit():
    case = swirled(
        {"size": [1.0, 1.0], "cells": [8, 8]}, {"method": "euler"}, decay=400.0, ambient=0.5
    )
    found = rows(case)
    assert found.min() >= 0.0 and found.max() <= 1.0 and np.all(np.abs(found[:, -1] - 0.5) < 1e-9)


TOLD = {  # numerics, shape, key and limit of the notice, its text
    "upwind5": (
        {"scheme": "upwind5", "method": "ssp-rk3"},
        "rectangle",
        ("scheme", None),
        "upwind5; ssp-rk3",
    ),
    "rk4": ({"method": "rk4"}, "triangles", ("method", 0.0), "muscl, van-leer; rk4"),
    "beyond": (
        {"method": "ssp-rk2", "courant": 1.2},
        "rectangle",
        ("courant", 1.0),
        "weno5; ssp-rk2",
    ),
    "rtol": (
        {"method": "radau-iia-5", "rtol": 1e-4},
        "triangles",
        ("rtol", None),
        "muscl, van-leer; radau-iia-5",
    ),
    "step": (
        {"scheme": "muscl", "limiter": "minmod", "method": "ssp-rk2", "step": 0.001},
        "quadrilaterals",
        ("step", None),
        "muscl, minmod; ssp-rk2",
    ),
}


@pytest.mark.parametrize("name", TOLD)
def test_settings_that_violate_bounds_give_a_notice(name, tmp_path):
    numerics, shape, (key, limit), said = TOLD[name]
    (one,) = notices(swirled(shaped(tmp_path, shape, 8), numerics))
    assert (
        (one.place, one.key, one.limit) == ("nodes.sheet", key, limit)
        and f"({said})" in one.text
        and one.ok
    )


def test_diffusion_over_skewed_cells_gives_a_notice_and_over_rectangles_stays_within_bounds(
    tmp_path,
):
    (one,) = notices(swirled(shaped(tmp_path, "triangles", 8), {}, diffusivity=1e-3))
    assert "dye diffuses" in one.text
    case = swirled(shaped(tmp_path, "rectangle", 16), {}, diffusivity=1e-3)
    found = rows(case)
    assert notices(case) == [] and found.min() > -ROUND and found.max() < 1.0 + ROUND


def test_a_velocity_that_converges_gives_a_notice_and_a_velocity_without_divergence_does_not():
    for u, v, told in (
        ("0.1*x*(1 - x)", 0, True),
        ("sin(pi*x)*cos(pi*y)", "-cos(pi*x)*sin(pi*y)", False),
    ):
        case = swirled({"size": [1.0, 1.0], "cells": [8, 8]}, {})
        case["nodes"]["sheet"]["velocity"] = {"u": u, "v": v}
        assert [one.key for one in notices(case)] == ["velocity"] * told
