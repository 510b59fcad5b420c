"""Interior patches: gullies, manholes and springs inside a basin, against closed forms and other arrangements."""

import math
from importlib import import_module

import numpy as np
import pytest
from pytest import approx
from reference import structures
from reference.basins import assert_equal_files, ended, model_of, run_in_two_parts
from reference.meshes import boundary, triangles, write
from reference.scenes import GRAVITY as G
from reference.scenes import lake, scene
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.errors import CaseError

SIZE = 10.0
HOLE = {"at": [4.5, 5.5], "area": 1.0}
LID = {
    "type": "manhole",
    "from": "pond.hole",
    "to": "shaft",
    "crest": 0.2,
    "area": 0.28,
    "perimeter": 1.9,
}
SHAFT = {"type": "tank", "area": 4.0, "elevation": -2.0, "level": 0.5}
WIDE = {
    "type": "orifice",
    "from": "pond.hole",
    "to": "shaft",
    "area": 20.0,
    "discharge_coefficient": 0.6,
}


def pond(
    link=LID, shaft=SHAFT, end=20.0, cells=(10, 10), numerics=None, hole=HOLE, probes=(), **basin
):
    """Square pond with an interior patch that a link joins to a shaft."""
    own = {
        "type": "basin",
        "size": [SIZE, SIZE],
        "cells": list(cells),
        "level": 1.0,
        "elevation": 0.0,
        "patches": {"hole": hole},
        **basin,
    }
    given = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9} | (numerics or {})
    given = {key: value for key, value in given.items() if value is not None}
    links, nodes = ({"lid": link}, {"pond": own, "shaft": shaft}) if link else ({}, {"pond": own})
    names = [*(["lid.flow", "shaft.level"] if link else []), "pond.hole.level", "pond.volume"]
    return scene(
        nodes,
        links,
        end,
        given,
        probes or names[:: 1 if shaft.get("type") == "tank" else 2],
        end / 50,
    )


@pytest.mark.parametrize("cells", [(10, 10), (20, 20)])
def test_a_pond_fills_a_shaft_through_a_manhole_as_a_tank_does(cells):
    law = structures.manhole(0.2, 0.28, 1.9)
    found = fvsolve.run(pond(cells=cells, hole={"at": [5.0, 5.0], "area": 1.0}, end=100.0))

    def rates(t, levels):
        q = law(levels[0], levels[1] - 2.0)
        return [-q / SIZE**2, q / 4.0]

    tanks = solve_ivp(rates, (0.0, 100.0), [1.0, 0.5], rtol=1e-10, atol=1e-12, t_eval=found.t)
    assert found["shaft.level"] == approx(tanks.y[1], abs=2e-3)
    assert found["shaft.level"][-1] == approx(tanks.y[1][-1], abs=1e-4)
    assert abs(found.ledger["mass"]["relative"]) < 1e-12 and found.ok


def test_the_level_of_a_spring_is_that_around_it():
    """A steady radial inflow q = Q / (2 pi r) has the level of its surroundings, less its velocity head."""
    flow = 0.05
    case = pond(
        None, end=6.0, cells=(101, 101), hole={"at": [5.05, 4.95], "area": 0.01, "discharge": flow}
    )
    found = fvsolve.run(case)
    assert found["pond.volume"][-1] - found["pond.volume"][0] == approx(6.0 * flow, abs=1e-10)
    mean = 1.0 + 6.0 * flow / SIZE**2
    # 5 percent of the drop Q / (c P / 4)
    assert found["pond.hole.level"][-1] == approx(mean, abs=2.5e-3)


@pytest.mark.parametrize("link", [WIDE, LID], ids=["orifice", "manhole"])
def test_links_at_interior_patches_take_the_steps_of_waves(link):
    rising = lake({"time": [0, 20], "value": [1.0, 1.2]}, elevation=0.0)
    found = fvsolve.run(pond(link, rising, cells=(20, 20)))
    waves = fvsolve.run(pond(None, cells=(20, 20), start={"level": "1 + 1e-3*cos(0.3*x)"}))
    assert found.summary["steps"] < 1.2 * waves.summary["steps"]


ROUGH = "0.3*sin(1.7*x)*cos(2.3*y) + 0.15*x - 0.4"  # with dry cells at the level 0.6 m


@pytest.mark.parametrize("at", [[4.5, 5.5], [7.7, 2.2]])  # the second place is half dry
@pytest.mark.parametrize("path", ["grid", "triangles"])
def test_at_rest_not_a_bit_moves(at, path, tmp_path):
    case = pond(
        WIDE,
        lake(0.6, elevation=0.0),
        level=0.6,
        bed=ROUGH,
        cells=(20, 20),
        hole={"at": at, "area": 4.0},
    )
    model = model_of(case if path == "grid" else on_triangles(case, tmp_path))
    assert (model.meshed[0].depth == 0.0).any()
    dydt, out = model.evaluate(0.0, np.zeros(model.y_size))
    assert not dydt.any() and not out[model.layout["supply"] :][: model.ledgers].any()


def on_triangles(case: dict, folder) -> dict:
    """The same case with triangles."""
    points, cells = triangles((SIZE, SIZE), 0.5)
    write(folder / "t.msh", points, cells.tolist(), {"rim": boundary(cells)})
    basin = {
        key: value for key, value in case["nodes"]["pond"].items() if key not in ("size", "cells")
    }
    return case | {
        "nodes": case["nodes"] | {"pond": basin | {"mesh": {"file": str(folder / "t.msh")}}}
    }


METHODS = {
    "ssp-rk2": {},
    "rk4": {},
    "dormand-prince": {"rtol": 1e-7, "courant": None},
    "implicit-midpoint": {"step": 0.05, "courant": None},
    "radau-iia-5": {"rtol": 1e-7, "courant": None},
    "rodas-5p": {"rtol": 1e-7, "courant": None},
}


@pytest.mark.parametrize("method", METHODS)
def test_all_methods_give_the_same_flow(method):
    numerics = {"method": method, **METHODS[method], "scheme": "upwind"}
    found = fvsolve.run(pond(numerics=numerics, end=5.0))
    exact = fvsolve.run(
        pond(numerics={"method": "rk4", "courant": 0.1, "scheme": "upwind"}, end=5.0)
    )
    assert found["lid.flow"] == approx(exact["lid.flow"], rel=2e-3)
    assert found["shaft.level"][-1] == approx(exact["shaft.level"][-1], rel=1e-5)


@pytest.mark.parametrize("ground", ["0", "0.05*x + 0.1*sin(3*x)"])
@pytest.mark.parametrize("head", [-1.0, 1.6])
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_a_pond_that_empties_and_fills_conserves_its_volume(ground, head, scheme):
    tide = {"time": [0, 4, 8, 12], "value": [head, head, 1.5, -1.0]}
    numerics = {"scheme": scheme, "courant": 0.3 if scheme == "weno5" else 0.9}
    case = pond(WIDE, lake(tide, elevation=0.0), 20.0, bed=ground, level=0.2, numerics=numerics)
    found = fvsolve.run(case)
    _, state = ended(case)
    assert found.ok and abs(found.ledger["mass"]["relative"]) < 1e-12
    model = model_of(case)
    assert (model.meshed[0].depth + model.meshed[0].states_of(state.y)[0]).min() > -1e-12


@pytest.mark.parametrize(
    "path", ["mirrored", "turned", "drawn the other way", "polygon", "resumed", "threads"]
)
def test_a_restated_pond_gives_the_same(path, tmp_path, monkeypatch):
    bed = "0.02*x + 0.05*y"
    here = fvsolve.run(pond(bed=bed))
    if path == "resumed":
        # checkpoints after 1000, 1250, ... steps
        for name in ("CHECKPOINT_SECONDS", "CHUNK_SECONDS"):
            monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), name, 0.0)
        run_in_two_parts(pond(bed=bed, numerics={"step": 5e-3, "courant": None}), tmp_path, 8.0)
        assert_equal_files(tmp_path, ["history.csv"])
    elif path == "threads":
        one, three = (
            fvsolve.run(pond(bed=bed, cells=(40, 36), probes=["lid.flow"]), threads=count)
            for count in (1, 3)
        )
        assert (one["lid.flow"] == three["lid.flow"]).all() and three.summary["threads"] == 3
    elif path == "drawn the other way":
        there = fvsolve.run(pond({**LID, "from": "shaft", "to": "pond.hole"}, bed=bed))
        assert -there["lid.flow"] == approx(here["lid.flow"], rel=1e-12)
    else:
        others = {
            "mirrored": ("0.02*(10 - x) + 0.05*y", {"at": [5.5, 5.5], "area": 1.0}),
            "turned": ("0.02*y + 0.05*(10 - x)", {"at": [4.5, 4.5], "area": 1.0}),
            "polygon": (bed, {"polygon": [[4.1, 5.1], [4.9, 5.1], [4.5, 5.9]]}),
        }
        there = fvsolve.run(pond(bed=others[path][0], hole=others[path][1]))
        assert there["lid.flow"] == approx(here["lid.flow"], rel=1e-11)


def test_a_grid_and_the_same_cells_as_a_mesh_give_the_same(tmp_path):
    numerics = {"scheme": "upwind"}
    case = pond(bed="0.02*x + 0.05*y", numerics=numerics)
    x, y = (array.ravel() for array in np.meshgrid(np.arange(11.0), np.arange(11.0)))
    corner = (11 * np.arange(10)[:, None] + np.arange(10)).ravel()
    cells = np.stack([corner, corner + 1, corner + 12, corner + 11], axis=1)
    write(tmp_path / "q.msh", np.column_stack([x, y]), cells.tolist(), {"rim": [[0, 1]]})
    basin = {
        key: value for key, value in case["nodes"]["pond"].items() if key not in ("size", "cells")
    }
    other = case | {
        "nodes": case["nodes"] | {"pond": basin | {"mesh": {"file": str(tmp_path / "q.msh")}}}
    }
    there, here = fvsolve.run(other), fvsolve.run(case)
    # to the tolerance of Newton's method
    assert there["lid.flow"] == approx(here["lid.flow"], rel=1e-8)
    assert there["pond.volume"] == approx(here["pond.volume"], rel=1e-11)


def test_street_manhole_shaft_and_sewer_keep_their_volume_and_the_flow_turns_once():
    street = {
        "type": "basin",
        "size": [40.0, 8.0],
        "cells": [40, 8],
        "level": 0.05,
        "elevation": 0.0,
        "bed": "0.002*(40 - x)",
        "manning": 0.015,
        "patches": {"hole": {"at": [35, 4], "area": 4}},
    }
    tide = {"time": [0, 60, 180, 300, 360], "value": [-1.5, -1.5, 1.0, 1.0, -1.5]}
    nodes = {
        "street": street,
        "shaft": {"type": "tank", "area": 0.8, "elevation": -2.0, "level": 0.5},
        "river": lake(tide, elevation=0.0),
    }
    links = {
        "lid": {**LID, "from": "street.hole", "crest": 0.01},
        "sewer": {
            "type": "pipe",
            "from": "shaft",
            "to": "river",
            "length": 50.0,
            "diameter": 0.3,
            "wave_speed": 400.0,
            "cells": 5,
            "friction": {"model": "steady", "factor": 0.02},
        },
    }
    probes = ["lid.flow", "sewer.flow@0", "street.hole.head", "shaft.head", "street.volume"]
    numerics = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.4}
    found = fvsolve.run(scene(nodes, links, 400.0, numerics, probes, 1.0))
    assert found.ok and abs(found.ledger["mass"]["relative"]) < 1e-12
    flow, drive = found["lid.flow"], found["street.hole.head"] - found["shaft.head"]
    turns = np.flatnonzero(np.diff(np.sign(flow[1:]))) + 1
    assert turns.size == 2 and flow[turns[0]] > 0.0 > flow[turns[1]] and flow[-1] > 0.0
    assert (flow * drive >= 0.0).all()  # the flow turns at equal heads


@pytest.mark.parametrize("method", ["ssp-rk2", "radau-iia-5", "rodas-5p"])
@pytest.mark.parametrize("drawn_by", ["discharge", "demand"])
def test_more_than_critical_outflow_is_held_with_a_mark(drawn_by, method):
    """The pond loses its initial volume at most; the rest of the demand has a line in the ledger."""
    asked, own = 8.0, {"rtol": 1e-6, "courant": None} if method != "ssp-rk2" else {}
    numerics = {"scheme": "upwind", "method": method, **own}
    if drawn_by == "discharge":
        case = pond(
            None, end=20.0, hole={**HOLE, "discharge": -asked}, level=0.5, numerics=numerics
        )
    else:
        shaft = {"type": "junction", "elevation": 0.0, "demand": asked}
        case = pond(WIDE, shaft, end=20.0, level=0.5, numerics=numerics, probes=["pond.volume"])
    found = fvsolve.run(case)
    mark, left = found.marks[-1], found["pond.volume"]
    assert found.reason == "finished" and not found.ok
    assert mark.what == "discharge held" and mark.place == "nodes.pond.hole"
    assert (
        mark.volume == approx(asked * 20.0 - (left[0] - left[-1]), rel=1e-9) and left.min() >= 0.0
    )
    assert abs(found.ledger["mass"]["relative"]) < 1e-12
    early = (
        -np.diff(left)[0] / 0.4
    )  # critical outflow of still water through four faces of one metre, until waves return
    assert early == approx(4.0 * 8.0 / 27.0 * math.sqrt(G) * 0.5**1.5, rel=0.2)


FAULTS = {
    "outside": ({"at": [12.0, 5.0], "area": 1.0}, {}, "lies outside the mesh or in a hole"),
    "in a hole": (HOLE, {"holes": [[4, 5, 5, 6]]}, "lies outside the mesh or in a hole"),
    "without area": ({"at": [4.5, 5.5]}, {}, "area is missing"),
    "with a side": ({**HOLE, "side": "west"}, {}, "keep one"),
    "without area, with a side": (
        {"at": [4.5, 5.5], "side": "west", "stage": "1 m"},
        {},
        "keep one",
    ),
    "an area of a polygon": (
        {"polygon": [[1, 1], [3, 1], [3, 3]], "area": 2.0},
        {},
        "area and polygon are given",
    ),
    "two shapes": ({"at": [4.5, 5.5], "polygon": [[1, 1], [2, 2], [1, 2]]}, {}, "keep one"),
    "with a closure": (
        {**HOLE, "stage": "1 m"},
        {},
        "this is an interior patch; leave this key out",
    ),
    "two corners": ({"polygon": [[1, 1], [2, 2]]}, {}, "list of 3 or more points"),
    "the whole basin": ({"at": [5.0, 5.0], "area": 200.0}, {}, "contains all cells"),
    "overlap": (
        HOLE,
        {"patches": {"hole": HOLE, "other": {"at": [4.8, 5.8], "area": 0.1}}},
        "has a cell of hole too",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_interior_patch_is_named(name):
    hole, basin, text = FAULTS[name]
    with pytest.raises(CaseError, match=text) as error:
        fvsolve.load(pond(hole=hole, **basin))
    assert "patches" in str(error.value) and "1 fault" in str(error.value)


@pytest.mark.parametrize("fall", [False, True], ids=["demand", "deep fall"])
def test_outflow_of_an_interior_patch_is_at_most_critical(fall):
    """The rim of four cells of 1 m passes Ritter's flow at first; a demand has a mark, a deep fall has none."""
    pool = {
        "type": "basin",
        "elevation": 0.0,
        "size": [20.0, 20.0],
        "cells": [20, 20],
        "level": 0.5,
        "patches": {"gully": {"at": [10.0, 10.0], "area": 4.0}},
    }
    low = {"type": "reservoir", "head": -50.0, "elevation": -60.0}
    use = low if fall else {"type": "junction", "elevation": -1.0, "demand": 30.0}
    gate = {
        "type": "orifice",
        "from": "pool.gully",
        "to": "use",
        "area": 100.0,
        "discharge_coefficient": 0.6,
    }
    numerics = {"courant": 0.5, "end": 0.5}
    result = fvsolve.run(
        {
            "schema": 1,
            "title": "fall",
            "fluid": {"name": "Water", "temperature": 293.15},
            "nodes": {"pool": pool, "use": use},
            "links": {"gate": gate},
            "numerics": numerics,
            "output": {"every": 0.5, "probes": ["pool.gully.flow"]},
        }
    )
    assert result["pool.gully.flow"][0] == pytest.approx(
        -8.0 * 8.0 / 27.0 * (9.80665 * 0.5**3) ** 0.5, rel=1e-6
    )
    assert result.reason == "finished" and result.ok is fall
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
    held = [mark for mark in result.marks if mark.what == "discharge held"]
    assert bool(held) is not fall
    assert not held or 13.0 < held[0].volume < 30.0 * 0.5


def test_an_interior_patch_without_a_link_gives_a_notice():
    model = model_of(pond(None, probes=["pond.volume"]))
    assert any("no link joins the interior patch hole" in notice.text for notice in model.warnings)
