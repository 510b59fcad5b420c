"""Driven patches: stage, discharge, rating, uniform slope and free overfall against exact solutions and schedules."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import ended, model_of, on_sides
from reference.meshes import boundary, corner_lists, triangles, write
from reference.scenes import GRAVITY as G
from reference.scenes import scene

import fvsolve
from fvsolve.mesh.rectangles import rectangle

DEEP, LONG, PERIOD = 1.0, 30.0, 4.0
NUMERICS = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}


def reach(patches, size=(LONG, 2.0), cells=(100, 2), end=PERIOD, numerics=None, probes=(), **basin) -> dict:
    own = {"type": "basin", "size": list(size), "cells": list(cells), "level": DEEP, "elevation": 0.0, **basin}
    given = {key: value for key, value in (NUMERICS | (numerics or {})).items() if value is not None}
    return scene({"reach": own | {"patches": patches}}, {}, end, given, probes, end / 10)


def simple_wave(x: np.ndarray, t: float, depth_at) -> np.ndarray:
    """Depth at time t of a wave into still water : characteristics dx/dt = 3 c - 2 c0 keep the depth at x = 0."""
    c0 = math.sqrt(G * DEEP)
    low, high = np.zeros(x.size), np.full(x.size, t)
    for _ in range(80):  # bisection for the time at which the characteristic starts
        middle = 0.5 * (low + high)
        ahead = (3.0 * np.sqrt(G * depth_at(middle)) - 2.0 * c0) * (t - middle) > x
        low, high = np.where(ahead, middle, low), np.where(ahead, high, middle)
    return np.where(x >= c0 * t, DEEP, depth_at(0.5 * (low + high)))


def stage_of(t):
    return DEEP + 0.1 * np.sin(np.pi * t / PERIOD) ** 4


def depth_of_flow(t):
    """Depth of a simple wave with the unit flow 0.4 sin^4 : q = 2 h (c - c0)."""
    flow, c0 = 0.4 * np.sin(np.pi * t / PERIOD) ** 4, math.sqrt(G * DEEP)
    c = np.full(np.shape(t), c0)
    for _ in range(60):
        c = c - (2.0 * c * c * (c - c0) / G - flow) * G / (6.0 * c * c - 4.0 * c * c0)
    return c * c / G


WAVES = {
    "stage": ({"stage": {"formula": f"{DEEP} + 0.1*sin(pi*t/{PERIOD})^4"}}, stage_of),
    "discharge": ({"discharge": {"formula": f"0.8*sin(pi*t/{PERIOD})^4"}}, depth_of_flow),
}


def on_mesh(case: dict, size, spacing: float, sides, folder) -> dict:
    """The same case with triangles."""
    points, cells = triangles(size, spacing)
    write(folder / "t.msh", points, cells.tolist(), on_sides(points, boundary(cells), size, sides))
    basin = {key: value for key, value in case["nodes"]["reach"].items() if key not in ("size", "cells")}
    patches = {name: {k: v for k, v in one.items() if k != "side"} for name, one in basin["patches"].items()}
    return case | {"nodes": {"reach": basin | {"mesh": {"file": str(folder / "t.msh")}, "patches": patches}}}


def depths(model, state) -> np.ndarray:
    return model.basins[0].depth + model.basins[0].deviations(state.y)[0]


def mean_error(n: int, kind: str, folder=None, **numerics) -> float:
    """Mean error of the depths in cells of a simple wave that a patch sends in from the west; folder : for triangles"""
    closure, depth_at = WAVES[kind]
    case = reach({"west": {"side": "west", **closure}}, cells=(n, 2), numerics=numerics)
    if folder is not None:
        case = on_mesh(case, (LONG, 2.0), LONG / n, ["west"], folder)
    model, state = ended(case)
    field = model.basins[0]
    places = ((0.0, 18.0),) if folder else ((-math.sqrt(0.6), 5.0), (0.0, 8.0), (math.sqrt(0.6), 5.0))  # of Gauss
    exact = sum(w / 18.0 * simple_wave(field.x + 0.5 * at * LONG / n, PERIOD, depth_at) for at, w in places)
    return float(np.average(np.abs(depths(model, state) - exact), weights=field.mesh.area))


@pytest.mark.parametrize("kind", WAVES)
@pytest.mark.parametrize("scheme, courant, most", [("muscl", 0.9, 3e-5), ("weno5", 0.35, 1e-6)])
def test_a_simple_wave_enters_at_the_order_of_the_scheme(kind, scheme, courant, most):
    errors = [mean_error(n, kind, scheme=scheme, courant=courant) for n in (200, 400)]
    assert math.log2(errors[0] / errors[1]) > 1.8 and errors[1] < most


@pytest.mark.parametrize("kind", WAVES)
def test_a_simple_wave_enters_triangles_at_second_order(kind, tmp_path):
    errors = [mean_error(n, kind, tmp_path) for n in (60, 120)]
    assert math.log2(errors[0] / errors[1]) > 1.6 and errors[1] < 1e-4


ROUGH = "0.3*sin(1.7*x)*cos(2.3*y) + 0.04*x"  # with dry cells at the level 1 m
AT_REST = {"stage": {"stage": DEEP}, "discharge": {"discharge": 0.0},
           "rating": {"rating": {"level": [DEEP, 2.0], "flow": [0.0, 5.0]}}}  # fmt: skip


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("kind", AT_REST)
@pytest.mark.parametrize("path", ["grid", "triangles"])
def test_at_rest_not_a_bit_moves(kind, path, scheme, tmp_path):
    sides = ("west", "north")
    patches = {side: {"side": side, **AT_REST[kind]} for side in sides}
    case = reach(patches, cells=(60, 4), bed=ROUGH, numerics={"scheme": scheme})
    model = model_of(case if path == "grid" else on_mesh(case, (LONG, 2.0), 0.5, sides, tmp_path))
    assert (model.basins[0].depth == 0.0).any()
    dydt, out = model.evaluate(0.0, np.zeros(model.y_size))
    assert not dydt.any() and not out[model.layout["supply"] :][: model.ledgers].any()


SCHEDULES = {  # of a discharge -> its integral over 5 s, by hand
    "linear": ({"time": [0, 2, 3, 6], "value": [0, 3, 3, -1]}, 3.0 + 3.0 + 2.0 * (3.0 + 1.0 / 3.0) / 2.0),
    "step": ({"time": [0, 1, 2], "value": [1, 3, 0.5], "kind": "step"}, 1.0 + 3.0 + 1.5),
}
METHODS = {"ssp-rk2": {"courant": 0.9}, "rk4": {"courant": 0.9}, "dormand-prince": {"rtol": 1e-6},
           "implicit-midpoint": {"step": 0.05}, "radau-iia-5": {"rtol": 1e-6}, "rodas-5p": {"rtol": 1e-6}}  # fmt: skip


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", SCHEDULES)
@pytest.mark.parametrize("ground", [("0", DEEP), ("0.05*x + 0.1*sin(3*x)", -1.0)], ids=["deep", "dry"])
@pytest.mark.parametrize("method", METHODS)
def test_the_volume_that_enters_is_the_integral_of_the_discharge(method, ground, kind):
    schedule, volume = SCHEDULES[kind]
    case = reach({"up": {"side": "west", "discharge": schedule}}, cells=(30, 4), bed=ground[0], level=ground[1])
    case["numerics"] = {"end": 5.0, "scheme": "muscl", "method": method} | METHODS[method]
    model, state = ended(case)
    gained = np.sum(model.basins[0].mesh.area * model.basins[0].deviations(state.y)[0])
    assert gained == approx(volume, rel=1e-12) and depths(model, state).min() >= 0.0


DRIVEN = {"up": {"side": "west", "discharge": {"start": 0, "duration": 20, "value": [0, 15]}},
          "down": {"side": "east", "stage": {"start": 0, "duration": 20, "value": [2, 2.2]}}}  # fmt: skip


def test_driven_patches_take_the_steps_of_open_sides():
    counts = []
    for patches in (DRIVEN, {name: {"side": patch["side"], "boundary": "open"} for name, patch in DRIVEN.items()}):
        found = fvsolve.run(reach(patches, (100.0, 10.0), (100, 10), 20.0, level=2.0))
        counts.append(found.summary["steps"])
    assert counts[0] < 1.1 * counts[1]


SLOPE, ROUGHNESS, UNIT = 0.001, 0.03, 1.0  # bed slope, Manning's n, unit flow [m2/s]
NORMAL = (ROUGHNESS * UNIT / math.sqrt(SLOPE)) ** 0.6


def backwater(long: float, depth: float, x: np.ndarray) -> np.ndarray:
    """Depth of gradually varied flow above a given depth at the end : RK4 of dh/dx = (S - S_f) / (1 - Fr^2)."""

    def slope(h):
        return (SLOPE - (ROUGHNESS * UNIT) ** 2 * h ** (-10.0 / 3.0)) / (1.0 - UNIT**2 / (G * h**3))

    places, found = np.linspace(long, 0.0, 8001), [depth]
    step = places[1] - places[0]
    for _ in places[1:]:
        h = found[-1]
        a = slope(h)
        b = slope(h + 0.5 * step * a)
        c = slope(h + 0.5 * step * b)
        found.append(h + step / 6.0 * (a + 2.0 * b + 2.0 * c + slope(h + step * c)))
    return np.interp(x, places[::-1], found[::-1])


ENDS = {"M1 stage": ({"stage": 2.0}, 2.0), "M1 rating": ({"rating": {"level": [1.0, 3.0], "flow": [0.0, 4.0]}}, 2.0),
        "M2 stage": ({"stage": 0.9}, 0.9), "normal_slope": ({"normal_slope": SLOPE}, NORMAL)}  # fmt: skip


@pytest.mark.parametrize("kind", ENDS)
def test_backwater_is_gradually_varied_flow(kind):
    end, depth = ENDS[kind]
    long, errors = 1000.0, []
    for n in (100, 200):
        start = {"level": f"max({SLOPE}*({long}-x) + {NORMAL}, {depth})", "u": UNIT / NORMAL}
        patches = {"up": {"side": "west", "discharge": 2.0 * UNIT}, "down": {"side": "east", **end}}
        case = reach(patches, (long, 2.0), (n, 1), 16000.0, level=0.0, start=start,
                     bed=f"{SLOPE}*({long}-x)", manning=ROUGHNESS)  # fmt: skip
        model, state = ended(case)
        h = depths(model, state)
        errors.append(np.abs(h / backwater(long, depth, model.basins[0].x) - 1.0).max())
    assert errors[1] < 2e-5
    assert kind == "normal_slope" or math.log2(errors[0] / errors[1]) > 1.8


def test_more_outflow_than_critical_is_held_there_and_the_volume_that_lacks_is_stated():
    case = reach({"out": {"side": "east", "discharge": -10.0}}, (20.0, 2.0), (40, 2), 4.0, probes=["reach.out.flow"])
    found = fvsolve.run(case)
    (mark,), flow = found.marks, found["reach.out.flow"]
    assert not found.ok and mark.place == "nodes.reach.out" and mark.time == 0.0
    critical = 2.0 * math.sqrt(G) * (2.0 / 3.0) ** 3  # of still water, c_b = 2 c / 3
    assert flow[0] == approx(-critical, rel=1e-12)
    assert mark.volume == approx(40.0 + np.trapezoid(flow, found.t), rel=1e-3)


def test_no_water_passes_a_patch_of_zero_discharge():
    """A slosh lies against it as at a wall: the flow is zero to rounding, and nothing is held."""
    case = reach({"shut": {"side": "east", "discharge": 0.0}}, (20.0, 2.0), (40, 3), 6.0, probes=["reach.shut.flow"],
                 start={"level": "1 + 0.2*cos(0.3*x)", "u": "0.3*sin(x)"})  # fmt: skip
    found = fvsolve.run(case)
    assert found.ok and abs(found["reach.shut.flow"]).max() < 1e-15


def test_a_discharge_within_critical_flow_has_no_mark():
    assert fvsolve.run(reach({"out": {"side": "east", "discharge": -0.5}}, end=1.0)).ok


def test_probes_of_a_driven_patch_are_its_level_head_and_froude_number():
    probes = [f"reach.in.{name}" for name in ("level", "head", "froude", "flow")]
    patch = {"side": "west", "stage": {"time": [0.0, 2.0], "value": [1.0, 1.1]}}
    found = fvsolve.run(reach({"in": patch}, end=2.0, probes=probes, elevation=5.0))
    level, head, froude, flow = (found[probe] for probe in probes)
    assert level == approx(1.0 + 0.05 * found.t, rel=1e-12) and head == approx(5.0 + level, rel=1e-12)
    assert froude == approx(np.abs(flow) / (2.0 * level * np.sqrt(G * level)), rel=1e-9)


def test_the_level_of_a_tide_is_that_of_its_schedule_while_banks_drain():
    """The bank beside a channel is above the tide; its film leaves by critical flow, at a surface above the tide."""
    bed = "where(y < 1, 0, 1.2)"
    case = reach({"sea": {"side": "west", "stage": {"time": [0, 40], "value": [1.5, 0.5]}}}, end=40.0, bed=bed,
                 level=1.5, cells=(30, 4), probes=["reach.sea.level", "reach.depth@0.5,1.75"])  # fmt: skip
    found = fvsolve.run(case)
    assert found["reach.sea.level"] == approx(1.5 - found.t / 40.0, rel=1e-12)
    assert 1e-3 < found["reach.depth@0.5,1.75"][found.t == 16.0][0] < 0.2


@pytest.mark.parametrize("path", ["turned", "mirrored", "north", "mesh"])
def test_a_restated_reach_gives_the_same(path, tmp_path):
    """Discharge in the west and rating in the east; the same along y, against x, and as a mesh (upwind)."""
    closures = {"up": WAVES["discharge"][0], "down": {"rating": {"level": [1.0, 1.2], "flow": [0.0, 1.0]}}}
    numerics = {"scheme": "upwind", "step": 0.02, "courant": None} if path == "mesh" else {}

    def depth(sides, size, cells, folder=None):
        patches = {name: {"side": side, **closures[name]} for name, side in zip(closures, sides, strict=True)}
        case = reach(patches, size, cells, numerics=numerics, bed="0.01*x" if path == "mesh" else "0")
        if folder is not None:
            grid = rectangle(size, cells)
            lines = on_sides(grid.points, grid.ends[grid.inner :], size)
            write(folder / "g.msh", grid.points, corner_lists(grid), {"up": lines["west"], "down": lines["east"]})
            basin = case["nodes"]["reach"]
            del basin["size"], basin["cells"]
            basin["mesh"] = {"file": str(folder / "g.msh")}
            basin["patches"] = {name: {k: v for k, v in one.items() if k != "side"} for name, one in patches.items()}
        model, state = ended(case)
        field = model.basins[0]
        return depths(model, state), field.x, field.y

    here, x, y = depth(("west", "east"), (12.0, 2.0), (24, 4))
    if path == "mesh":
        there, u, v = depth(("west", "east"), (12.0, 2.0), (24, 4), tmp_path)
    elif path == "mirrored":
        there, u, v = depth(("east", "west"), (12.0, 2.0), (24, 4))
        u = 12.0 - u
    else:
        sides = ("south", "north") if path == "turned" else ("north", "south")
        there, v, u = depth(sides, (2.0, 12.0), (4, 24))
        u = u if path == "turned" else 12.0 - u
    same, other = np.lexsort((np.round(y, 6), np.round(x, 6))), np.lexsort((np.round(v, 6), np.round(u, 6)))
    assert there[other] == approx(here[same], rel=1e-11)


@pytest.mark.parametrize("threads", [2, 3])
def test_any_number_of_threads_gives_the_bits_of_one(threads):
    case = reach(DRIVEN, (100.0, 10.0), (100, 12), 5.0, level=2.0, bed="0.2*sin(x)*cos(y)", probes=["reach.up.flow"])
    one, more = (fvsolve.run(case, threads=count) for count in (1, threads))
    assert (one["reach.up.flow"] == more["reach.up.flow"]).all() and more.summary["threads"] == threads


FAULTS = {
    "stage and discharge are given": {"stage": 1.0, "discharge": 1.0},
    "boundary and stage are given": {"stage": 1.0, "boundary": "open"},
    "give `discharge` too": {"stage": 1.0, "depth": 1.0},
    "give `manning` of the basin too": {"normal_slope": 0.001},
    "expected a value above 0": {"normal_slope": 0.0},
    "expected 0 at the lowest level": {"rating": {"level": [0, 1], "flow": [1, 2]}},
    "expected a flow for each": {"rating": {"level": [0, 1, 2], "flow": [0, 1]}},
    "expected flows that rise": {"rating": {"level": [0, 1, 2], "flow": [0, 2, 1]}},
    "below the bed": {"rating": {"level": [-1, 1, 2], "flow": [0, 2, 3]}},
    "this is a moving wall": {"stage": 1.0, "travel": 1.0},
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_closure_that_cannot_be_is_named(text):
    with pytest.raises(fvsolve.FvsolveError, match=f"patches.up.*{text}"):
        fvsolve.load(reach({"up": {"side": "west", **FAULTS[text]}}))


def test_a_file_of_a_stage_states_its_unit(tmp_path):
    for header, unit, text in (("t [s],z", {}, "has no unit"), ("t [s],z [m]", {"unit": "m"}, "has its own unit")):
        (tmp_path / "tide.csv").write_text(f"{header}\n0,1\n10,2\n")
        with pytest.raises(fvsolve.FvsolveError, match=text):
            fvsolve.load(reach({"up": {"side": "west", "stage": {"file": str(tmp_path / "tide.csv"), **unit}}}))
    (tmp_path / "tide.csv").write_text("t [s],z\n0,100\n10,120\n")
    stage = {"file": str(tmp_path / "tide.csv"), "unit": "cm"}
    case = fvsolve.load(reach({"up": {"side": "west", "stage": stage}}))
    assert case.nodes["reach"].patches["up"].stage.value.tolist() == [1.0, 1.2]
