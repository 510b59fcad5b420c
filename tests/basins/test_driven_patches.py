"""Driven patches: stage, discharge, rating, uniform slope and free overfall against exact solutions and schedules."""

import math
from pathlib import Path

import numpy as np
import pytest
from pytest import approx
from reference.basins import ended, model_of, on_sides
from reference.meshes import boundary, corner_lists, triangles, write
from reference.scenes import GRAVITY as G
from reference.scenes import scene
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.core.mesh.rectangles import rectangle

DEEP, LONG, PERIOD = 1.0, 30.0, 4.0
NUMERICS = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}


def reach(
    patches, size=(LONG, 2.0), cells=(100, 2), end=PERIOD, numerics=None, probes=(), **basin
) -> dict:
    own = {
        "type": "basin",
        "size": list(size),
        "cells": list(cells),
        "level": DEEP,
        "elevation": 0.0,
        **basin,
    }
    given = {
        key: value for key, value in (NUMERICS | (numerics or {})).items() if value is not None
    }
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
    basin = {
        key: value for key, value in case["nodes"]["reach"].items() if key not in ("size", "cells")
    }
    patches = {
        name: {k: v for k, v in one.items() if k != "side"}
        for name, one in basin["patches"].items()
    }
    return case | {
        "nodes": {"reach": basin | {"mesh": {"file": str(folder / "t.msh")}, "patches": patches}}
    }


def depths(model, state) -> np.ndarray:
    return model.meshed[0].depth + model.meshed[0].deviations(state.y)[0]


def mean_error(n: int, kind: str, folder=None, **numerics) -> float:
    """Mean error of the depths in cells of a simple wave that a patch sends in from the west; folder : for triangles"""
    closure, depth_at = WAVES[kind]
    case = reach({"west": {"side": "west", **closure}}, cells=(n, 2), numerics=numerics)
    if folder is not None:
        case = on_mesh(case, (LONG, 2.0), LONG / n, ["west"], folder)
    model, state = ended(case)
    field = model.meshed[0]
    # of Gauss
    places = (
        ((0.0, 18.0),) if folder else ((-math.sqrt(0.6), 5.0), (0.0, 8.0), (math.sqrt(0.6), 5.0))
    )
    exact = sum(
        w / 18.0 * simple_wave(field.x + 0.5 * at * LONG / n, PERIOD, depth_at) for at, w in places
    )
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
AT_REST = {
    "stage": {"stage": DEEP},
    "discharge": {"discharge": 0.0},
    "rating": {"rating": {"level": [DEEP, 2.0], "flow": [0.0, 5.0]}},
}


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("kind", AT_REST)
@pytest.mark.parametrize("path", ["grid", "triangles"])
def test_at_rest_not_a_bit_moves(kind, path, scheme, tmp_path):
    sides = ("west", "north")
    patches = {side: {"side": side, **AT_REST[kind]} for side in sides}
    case = reach(patches, cells=(60, 4), bed=ROUGH, numerics={"scheme": scheme})
    model = model_of(case if path == "grid" else on_mesh(case, (LONG, 2.0), 0.5, sides, tmp_path))
    assert (model.meshed[0].depth == 0.0).any()
    dydt, out = model.evaluate(0.0, np.zeros(model.y_size))
    assert not dydt.any() and not out[model.layout["supply"] :][: model.ledgers].any()


SCHEDULES = {  # of a discharge -> its integral over 5 s, by hand
    "linear": (
        {"time": [0, 2, 3, 6], "value": [0, 3, 3, -1]},
        3.0 + 3.0 + 2.0 * (3.0 + 1.0 / 3.0) / 2.0,
    ),
    "step": ({"time": [0, 1, 2], "value": [1, 3, 0.5], "kind": "step"}, 1.0 + 3.0 + 1.5),
}
METHODS = {
    "ssp-rk2": {"courant": 0.9},
    "rk4": {"courant": 0.9},
    "dormand-prince": {"rtol": 1e-6},
    "implicit-midpoint": {"step": 0.05},
    "radau-iia-5": {"rtol": 1e-6},
    "rodas-5p": {"rtol": 1e-6},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", SCHEDULES)
@pytest.mark.parametrize(
    "ground", [("0", DEEP), ("0.05*x + 0.1*sin(3*x)", -1.0)], ids=["deep", "dry"]
)
@pytest.mark.parametrize("method", METHODS)
def test_the_volume_that_enters_is_the_integral_of_the_discharge(method, ground, kind):
    schedule, volume = SCHEDULES[kind]
    case = reach(
        {"up": {"side": "west", "discharge": schedule}},
        cells=(30, 4),
        bed=ground[0],
        level=ground[1],
    )
    case["numerics"] = {"end": 5.0, "scheme": "muscl", "method": method} | METHODS[method]
    model, state = ended(case)
    gained = np.sum(model.meshed[0].mesh.area * model.meshed[0].deviations(state.y)[0])
    assert gained == approx(volume, rel=1e-12) and depths(model, state).min() >= 0.0


@pytest.mark.parametrize("method, order", [("euler", 1), ("ssp-rk2", 2), ("rk4", 4)])
def test_the_volume_of_a_smooth_discharge_has_the_order_of_the_method(method, order):
    """Integral of 1 + sin(t)^2 over 4 s."""
    errors, exact = [], 4.0 + 2.0 - 0.25 * math.sin(8.0)
    for step in (0.1, 0.05):
        case = reach(
            {"up": {"side": "west", "discharge": {"formula": "1 + sin(t)^2"}}}, cells=(15, 1)
        )
        case["numerics"] = {"end": 4.0, "scheme": "muscl", "method": method, "step": step}
        model, state = ended(case)
        errors.append(
            abs(np.sum(model.meshed[0].mesh.area * model.meshed[0].deviations(state.y)[0]) - exact)
        )
    assert math.log2(errors[0] / errors[1]) == approx(order, abs=0.1)


DRIVEN = {
    "up": {"side": "west", "discharge": {"start": 0, "duration": 20, "value": [0, 15]}},
    "down": {"side": "east", "stage": {"start": 0, "duration": 20, "value": [2, 2.2]}},
}


@pytest.mark.parametrize(
    "end", [{}, {"rating": {"level": [2.0, 3.0], "flow": [0.0, 20.0]}}], ids=["stage", "rating"]
)
def test_driven_patches_take_the_steps_of_open_sides(end):
    counts, driven = [], DRIVEN | ({"down": {"side": "east", **end}} if end else {})
    for patches in (
        driven,
        {name: {"side": patch["side"], "boundary": "open"} for name, patch in driven.items()},
    ):
        case = reach(patches, (100.0, 10.0), (100, 10), 20.0, level=2.0)
        counts.append(fvsolve.run(case).summary["steps"])
        assert 0.5 < model_of(case).checks["steps"] / counts[-1] < 2.0
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


ENDS = {
    "M1 stage": ({"stage": 2.0}, 2.0),
    "M1 rating": ({"rating": {"level": [1.0, 3.0], "flow": [0.0, 4.0]}}, 2.0),
    "M2 stage": ({"stage": 0.9}, 0.9),
    "normal_slope": ({"normal_slope": SLOPE}, NORMAL),
}


@pytest.mark.parametrize("kind", ENDS)
def test_backwater_is_gradually_varied_flow(kind):
    end, depth = ENDS[kind]
    long, errors = 1000.0, []
    for n in (100, 200):
        start = {"level": f"max({SLOPE}*({long}-x) + {NORMAL}, {depth})", "u": UNIT / NORMAL}
        patches = {"up": {"side": "west", "discharge": 2.0 * UNIT}, "down": {"side": "east", **end}}
        case = reach(
            patches,
            (long, 2.0),
            (n, 1),
            16000.0,
            level=0.0,
            start=start,
            bed=f"{SLOPE}*({long}-x)",
            manning=ROUGHNESS,
        )
        model, state = ended(case)
        h = depths(model, state)
        errors.append(np.abs(h / backwater(long, depth, model.meshed[0].x) - 1.0).max())
    assert errors[1] < 2e-5
    assert kind == "normal_slope" or math.log2(errors[0] / errors[1]) > 1.8


@pytest.mark.parametrize(
    "end", [{"stage": 2.5}, {"rating": {"level": [1.5, 3.5], "flow": [0.0, 4.0]}}], ids=["z", "R"]
)
def test_water_behind_a_weir_on_a_steep_slope_is_gradually_varied_flow(end):
    """S1 : above the critical depth of 0.467 m, itself above the uniform depth of 0.394 m."""
    long, slope, errors = 50.0, 0.02, []
    law = solve_ivp(
        lambda x, h: (
            (slope - (ROUGHNESS * UNIT) ** 2 * h ** (-10 / 3)) / (1 - UNIT**2 / (G * h**3))
        ),
        (long, 0.0),
        [2.5],
        rtol=1e-11,
        atol=1e-12,
        dense_output=True,
    )
    for n in (50, 100):
        patches = {"up": {"side": "west", "discharge": 2.0 * UNIT}, "down": {"side": "east", **end}}
        case = reach(
            patches,
            (long, 2.0),
            (n, 1),
            3000.0,
            level=2.5,
            start={"level": 2.5, "u": 0.5},
            bed=f"{slope}*({long}-x)",
            manning=ROUGHNESS,
        )
        model, state = ended(case)
        errors.append(np.abs(depths(model, state) / law.sol(model.meshed[0].x)[0] - 1.0).max())
    assert errors[1] < 1e-5 and math.log2(errors[0] / errors[1]) > 1.8


def short_channel(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(depth, slope of the bed) of MacDonald's channel of 150 m with 2 m2/s, n 0.03; Froude numbers to 0.9."""
    bell = 0.2 * np.exp(-33.75 * (x / 150.0 - 0.5) ** 2)
    h, rise = 0.8 + bell, bell * -67.5 * (x / 150.0 - 0.5) / 150.0
    return h, (4.0 / (G * h**3) - 1.0) * rise - 4.0 * ROUGHNESS**2 / h ** (10.0 / 3.0)


LOWER = float(short_channel(np.array([150.0]))[0][0])
SHORT_ENDS = {
    "stage": {"stage": LOWER},
    "rating": {"rating": {"level": [LOWER - 0.4, LOWER + 0.4], "flow": [0.0, 8.0]}},
    "normal_slope": {"normal_slope": 4.0 * ROUGHNESS**2 / LOWER ** (10.0 / 3.0)},
}


def channel_bed(folder) -> tuple[Path, float]:
    """File with the bed of the short channel at 3000 pixels of 5 cm, and the bed at its west end [m].

    The bed is the integral of its slope by Simpson's rule, zero at the east end. Pixels lie within cells.
    """
    edges, middles = np.linspace(0.0, 150.0, 6001), np.linspace(0.0125, 149.9875, 6000)
    slope, between = short_channel(edges)[1], short_channel(middles)[1]
    bed = np.concatenate([[0.0], np.cumsum(0.025 / 6.0 * (slope[:-1] + 4.0 * between + slope[1:]))])
    rows = [
        f"{x:.10g},{y},{z:.12g}\n"
        for x, z in zip(edges[1::2], bed[1::2] - bed[-1], strict=True)
        for y in (0.5, 1.5)
    ]
    (folder / "bed.csv").write_text("x,y,bed\n" + "".join(rows))
    return folder / "bed.csv", -bed[-1]


@pytest.mark.parametrize(
    ("end", "scheme"), [*((end, "muscl") for end in SHORT_ENDS), ("stage", "weno5")]
)
def test_the_short_channel_of_macdonald_has_its_depths(end, scheme, tmp_path):
    """On 200 cells errors are 6.2e-5 of the depth at the peak and 8e-6 on average (`muscl`), 1.2e-6 (`weno5`)."""
    file, west = channel_bed(tmp_path)
    errors, means = [], []
    for n in (50, 100) if scheme == "weno5" else (100, 200):
        patches = {
            "up": {"side": "west", "discharge": 4.0},
            "down": {"side": "east", **SHORT_ENDS[end]},
        }
        numerics = {"scheme": scheme, "method": "ssp-rk3" if scheme == "weno5" else "ssp-rk2"}
        case = reach(
            patches,
            (150.0, 2.0),
            (n, 1),
            1500.0,
            numerics,
            level=0.0,
            bed={"file": str(file)},
            manning=ROUGHNESS,
            start={"level": f"{west}*(1 - x/150) + 0.85", "u": 2.4},
        )
        model, state = ended(case)
        nodes, weights = np.polynomial.legendre.leggauss(4)
        places = model.meshed[0].x[:, None] + 75.0 / n * nodes
        error = np.abs(depths(model, state) / (short_channel(places)[0] @ weights / 2.0) - 1.0)
        errors.append(error.max())
        means.append(error.mean())
    bound = 2e-5 if scheme == "weno5" else 1e-4
    assert errors[1] < bound and means[1] < 2e-5 and math.log2(means[0] / means[1]) > 1.8


def uniform_flow(
    unit: float, size, cells, end: float, numerics=None, upper=None, start="0"
) -> dict:
    """Flow of a unit discharge [m2/s], 0.8 m deep, down a plane on which it is uniform; start : change of the depth."""
    slope = (unit * ROUGHNESS) ** 2 / 0.8 ** (10.0 / 3.0)
    inflow = {"discharge": unit * size[1]} | (
        {"depth": 0.8} if unit > math.sqrt(G * 0.8**3) else {}
    )
    upper = inflow if upper is None else {"stage": slope * size[0] + 0.8}
    patches = {"west": {"side": "west", **upper}, "east": {"side": "east", "normal_slope": slope}}
    level = f"{slope}*({size[0]} - x) + 0.8"
    return reach(
        patches,
        size,
        cells,
        end,
        numerics,
        level=0.0,
        bed=f"{slope}*({size[0]} - x)",
        manning=ROUGHNESS,
        start={"level": f"{level} + ({start})", "u": unit / 0.8},
    )


@pytest.mark.parametrize("scheme", ["muscl", "weno5"])
@pytest.mark.parametrize("froude", [0.9, 1.12, 1.4])
def test_fast_flow_on_a_slope_has_no_standing_noise(froude, scheme):
    """A bed that is the difference of two limited fields, surface and depth, would keep noise of one per cent."""
    unit = froude * math.sqrt(G * 0.8**3)
    numerics = {"scheme": scheme, "method": "ssp-rk3" if scheme == "weno5" else "ssp-rk2"}
    model, state = ended(
        uniform_flow(unit, (75.0, 2.0), (200, 1), 150.0, numerics, start="1e-3*sin(0.04*x*x)")
    )
    assert depths(model, state) == approx(0.8, rel=1e-6)


@pytest.mark.parametrize(
    "numerics",
    [{}, {"method": "rodas-5p", "rtol": 1e-6, "courant": None}],
    ids=["explicit", "rodas"],
)
def test_films_pass_the_ends_of_triangles_evenly(numerics, tmp_path):
    """Level beds in the cells at the ends would dam up a film that is thinner than the fall of the bed in a cell."""
    depth, slope, n, size = 0.005, 0.05, 0.1, (40.0, 8.0)
    speed = depth ** (2.0 / 3.0) * math.sqrt(slope) / n
    patches = {"west": {"side": "west", "discharge": speed * depth * size[1]}}
    patches["east"] = {"side": "east", "normal_slope": slope}
    start = {"level": f"{depth} - {slope}*x", "u": speed}
    case = reach(
        patches,
        size,
        (10, 1),
        60.0,
        numerics,
        level=-5.0,
        bed=f"-{slope}*x",
        manning=n,
        start=start,
    )
    assert depths(*ended(on_mesh(case, size, 2.0, ["west", "east"], tmp_path))) == approx(
        depth, rel=1e-6
    )


@pytest.mark.parametrize("closure", [{"boundary": "critical"}, {"normal_slope": 0.01}])
def test_the_level_of_faces_of_their_own_is_continuous_where_they_fall_dry(closure):
    """A film of 1e-9 m on the higher of two faces; without water at both the level is that of the lower bed."""

    def level(lower, upper):
        more = {
            "start": {"level": f"({lower})*(y < 1) + ({upper})*(y > 1)"},
            "bed": "1 + (y > 1)",
            "manning": 0.03,
        }
        patches, probes = {"end": {"side": "east", **closure}}, ["reach.end.level"]
        case = reach(patches, (20.0, 2.0), (10, 2), 1e-6, probes=probes, level=5.0, **more)
        return fvsolve.run(case).si("reach.end.level")[0]

    assert level("1.5", "2 + 1e-9") == approx(level("1.5", "2"), abs=1e-8)
    assert 1.0 < level("1.5", "2") < 1.5 and level("1", "2") == 1.0


TURNED_ENDS = {
    "stage": {"stage": 0.0},
    "rating": {"rating": {"level": [-0.55, 0.0, 1.0], "flow": [0.0, 6.0, 30.0]}},
    "normal_slope": {"normal_slope": 0.002},
    "critical": {"boundary": "critical"},
}


def turned(
    degrees: float, spacing: float, scheme: str, lower: dict, folder
) -> tuple[float, np.ndarray]:
    """Volume, and depths of all cells, of a flood through a channel of triangles that is turned by an angle."""
    size, angle = (60.0, 12.0), math.radians(degrees)
    points, cells = triangles(size, spacing)
    groups = on_sides(points, boundary(cells), size, ["west", "east"])
    c, s = math.cos(angle), math.sin(angle)
    write(folder / "t.msh", points @ np.array([[c, s], [-s, c]]), cells.tolist(), groups)
    patches = {
        "west": {"discharge": {"time": [0, 30, 60], "value": [0.0, 10.0, 2.0]}},
        "east": lower,
    }
    more = {
        "mesh": {"file": str(folder / "t.msh")},
        "bed": f"-0.5 - 0.002*({c!r}*x + {s!r}*y)",
        "manning": 0.03,
    }
    case = reach(patches, end=60.0, numerics={"scheme": scheme}, **more | {"level": 0.0})
    case["nodes"]["reach"] = {
        k: v for k, v in case["nodes"]["reach"].items() if k not in ("size", "cells")
    }
    model, state = ended(case)
    found = depths(model, state)
    return float(found @ model.meshed[0].mesh.area), found


@pytest.mark.parametrize("closure", TURNED_ENDS)
def test_a_turned_mesh_has_the_same_depths_but_for_the_limits_of_each_velocity_component(
    closure, tmp_path
):
    """Volumes of `muscl` differ by less than 3e-5 at 30 degrees; those of cells half as long differ by 2e-5 to 2e-4."""
    lower = TURNED_ENDS[closure]
    for scheme, degrees in (("upwind", 30.0), ("muscl", 90.0)):
        (_, before), (_, after) = (
            turned(angle, 2.0, scheme, lower, tmp_path) for angle in (0.0, degrees)
        )
        assert after == approx(before, abs=1e-12)
    before, after = (turned(angle, 2.0, "muscl", lower, tmp_path)[0] for angle in (0.0, 30.0))
    assert after == approx(before, rel=3e-5)


@pytest.mark.parametrize("unit", [1.0, 2.0])
@pytest.mark.parametrize("upper", [None, "stage"], ids=["discharge", "stage"])
def test_inflow_through_sides_of_triangles_stays_even(unit, upper, tmp_path):
    """Each face would have the velocity of its own cell: differences from face to face grew to the flow itself."""
    errors = []
    for spacing in (0.5, 0.25):
        case = on_mesh(
            uniform_flow(unit, (20.0, 3.0), (10, 1), 60.0, upper=upper),
            (20.0, 3.0),
            spacing,
            ["west", "east"],
            tmp_path,
        )
        model, state = ended(case)
        errors.append(np.abs(model.meshed[0].deviations(state.y)[1] / unit - 1.0).max())
    assert max(errors) < 1e-9


def test_the_flow_through_a_side_of_triangles_is_continuous_where_it_turns(tmp_path):
    """The velocity of a cell passes zero while its neighbours flow in; a jump of 1.1 m/s2 let Newton's method stall."""
    patches = {"west": {"side": "west", "stage": 1.1}, "east": {"side": "east", "stage": 1.0}}
    case = reach(patches, (8.0, 4.0), (16, 8), 5.0, {"scheme": "upwind"})
    model = model_of(on_mesh(case, (8.0, 4.0), 0.5, ["west", "east"], tmp_path))
    basin, patch, rates = model.meshed[0], model.meshed[0].all_patches[0], []
    velocities = int(basin.row["y"]) + basin.n
    behind = model.tables.integers[int(patch["ring"]) + int(patch["faces"]) :][
        : int(patch["faces"])
    ]
    for velocity in (1e-9, -1e-9):
        y = model.start.copy()
        y[velocities : velocities + basin.n] = 0.5
        y[velocities + behind[3]] = velocity
        rates.append(np.array(model.evaluate(0.0, y)[0]))
    assert np.abs(rates[0] - rates[1]).max() < 1e-6


def test_neighbours_of_faces_of_a_patch_do_not_depend_on_the_order_in_the_file(tmp_path):
    case = on_mesh(
        uniform_flow(1.0, (4.0, 3.0), (10, 1), 1.0), (4.0, 3.0), 0.5, ["west", "east"], tmp_path
    )
    mesh = model_of(case).meshed[0].mesh
    before, after = mesh.neighbouring_faces("west")
    y = mesh.middle[mesh.patch("west"), 1]
    order = np.argsort(-y)  # the west side runs down, anticlockwise around the basin
    assert np.array_equal(after[order], [*order[1:], order[-1]]) and np.array_equal(
        before[order], [order[0], *order[:-1]]
    )


def returned(end: dict, speed: float, cells: int = 480, bed="0", **more) -> float:
    """Volume that a small pulse brings back from an end, over its own, times the ratio of speeds (c + u) / (c - u).

    The duration of the pulse is kept, so this ratio of lengths leaves that of heights. The pulse is the difference of
    two runs; it starts at 70 m in a flow of the given speed, 1 m deep, and returns there from 120 m.
    """
    c, fields = math.sqrt(G), []
    for height in (0.0, 1e-3):
        level = f"(1 + {height}*exp(-((x-70)/6)^2))"
        start = {"level": level, "u": f"{speed} + 2*(sqrt({G}*{level}) - {c})"}
        patches = {"up": {"side": "west", "boundary": "open"}, "down": {"side": "east", **end}}
        end_time = 50.0 / (c + speed) + 50.0 / (c - speed)
        case = reach(
            patches, (120.0, 2.0), (cells, 1), end_time, level=1.0, start=start, bed=bed, **more
        )
        model, state = ended(case)
        fields.append(depths(model, state))
    x = model.meshed[0].x
    volume = np.sum((fields[1] - fields[0])[(x > 40.0) & (x < 110.0)]) * 120.0 / cells
    return volume / (1e-3 * 6.0 * math.sqrt(math.pi)) * (c + speed) / (c - speed)


def reflected(by_depth: float, by_speed: float) -> float:
    """Ratio of heights of the returned and the incoming small wave, 1 m deep, for an end with F(h, u) = 0.

    by_depth, by_speed : derivatives F_h [1/m] and F_u [s/m] of F
    """
    k = math.sqrt(G)
    return -(by_depth + k * by_speed) / (by_depth - k * by_speed)


RETURNED = {  # end, speed, ratio of heights
    "stage at rest": ({"stage": 1.0}, 0.0, -1.0),
    "stage": ({"stage": 1.0}, 1.0, -1.0),
    # u - sqrt(S) h^(2/3) / n
    "normal_slope": ({"normal_slope": 1e-8}, 1.0, reflected(-2.0 / 3.0, 1.0)),
    # h u - 2 (h - 1/2)
    "rating": ({"rating": {"level": [0.5, 1.5], "flow": [0.0, 4.0]}}, 1.0, reflected(-1.0, 1.0)),
}


@pytest.mark.parametrize("kind", RETURNED)
def test_a_pulse_returns_with_the_height_of_its_closed_form(kind):
    end, speed, ratio = RETURNED[kind]
    more = {"manning": 1e-4} if kind == "normal_slope" else {}
    assert returned(end, speed, **more) == approx(ratio, abs=0.01)


def test_a_pulse_returns_from_a_free_overfall_over_a_sill():
    """Critical flow on the sill : E = h + u^2 / 2g - sill = 3/2 (q^2 / g)^(1/3), whose waves stand still there."""
    critical = (1.0 / G) ** (1.0 / 3.0)
    sill = 1.0 + 0.5 / G - 1.5 * critical
    ratio = reflected(1.0 - critical, 1.0 / G - critical)
    bed = f"{sill}*min(max((x - 117)/2, 0), 1)"
    assert returned({"boundary": "critical"}, 1.0, 960, bed) == approx(ratio, abs=0.015)


def test_more_outflow_than_critical_is_held_there_and_the_volume_that_lacks_is_stated():
    case = reach(
        {"out": {"side": "east", "discharge": -10.0}},
        (20.0, 2.0),
        (40, 2),
        4.0,
        probes=["reach.out.flow"],
    )
    found = fvsolve.run(case)
    (mark,), flow = found.marks, found["reach.out.flow"]
    assert not found.ok and mark.place == "nodes.reach.out" and mark.time == 0.0
    critical = 2.0 * math.sqrt(G) * (2.0 / 3.0) ** 3  # of still water, c_b = 2 c / 3
    assert flow[0] == approx(-critical, rel=1e-12)
    assert mark.volume == approx(40.0 + np.trapezoid(flow, found.t), rel=1e-3)


@pytest.mark.parametrize("path", ["grid", "triangles"])
@pytest.mark.parametrize("end", [{"boundary": "critical"}, {"stage": "-1 m"}, {"discharge": 0.0}])
def test_no_water_enters_behind_a_film_that_runs_away_from_its_patch(end, path, tmp_path):
    """Water that moves inward faster than 2 sqrt(g h) leaves the faces of the patch dry."""
    start = {"level": "0.02", "u": 3.0}
    case = reach(
        {"west": {"side": "west", **end}},
        end=2.0,
        level=0.0,
        start=start,
        probes=["reach.west.flow"],
    )
    model, state = ended(
        case if path == "grid" else on_mesh(case, (LONG, 2.0), 0.5, ["west"], tmp_path)
    )
    volume, start = model.meshed[0].mesh.area @ depths(model, state), 0.02 * LONG * 2.0
    # a little may leave later
    assert volume == approx(start, rel=1e-12 if "discharge" in end else 1e-6)
    assert volume < start * (1.0 + 1e-12)


def test_no_water_passes_a_patch_of_zero_discharge():
    """A slosh lies against it as at a wall: the flow is zero to rounding, and nothing is held."""
    case = reach(
        {"shut": {"side": "east", "discharge": 0.0}},
        (20.0, 2.0),
        (40, 3),
        6.0,
        probes=["reach.shut.flow"],
        start={"level": "1 + 0.2*cos(0.3*x)", "u": "0.3*sin(x)"},
    )
    found = fvsolve.run(case)
    assert found.ok and abs(found["reach.shut.flow"]).max() < 1e-15


def test_a_discharge_within_critical_flow_has_no_mark():
    assert fvsolve.run(reach({"out": {"side": "east", "discharge": -0.5}}, end=1.0)).ok


def test_probes_of_a_driven_patch_are_its_level_head_and_froude_number():
    probes = [f"reach.in.{name}" for name in ("level", "head", "froude", "flow")]
    patch = {"side": "west", "stage": {"time": [0.0, 2.0], "value": [1.0, 1.1]}}
    found = fvsolve.run(reach({"in": patch}, end=2.0, probes=probes, elevation=5.0))
    level, head, froude, flow = (found[probe] for probe in probes)
    assert level == approx(1.0 + 0.05 * found.t, rel=1e-12) and head == approx(
        5.0 + level, rel=1e-12
    )
    assert froude == approx(np.abs(flow) / (2.0 * level * np.sqrt(G * level)), rel=1e-9)


def test_a_slow_tide_fills_a_basin_to_its_stage():
    stage = {"start": 0.0, "duration": 300.0, "value": [1.0, 1.1]}
    model, state = ended(
        reach({"sea": {"side": "west", "stage": stage}}, end=400.0, cells=(30, 2), manning=0.1)
    )
    assert np.mean(depths(model, state)) == approx(1.1, abs=1e-4)


def test_the_level_of_a_tide_is_that_of_its_schedule_while_banks_drain():
    """The bank beside a channel is above the tide; its film leaves by critical flow, at a surface above the tide."""
    bed = "where(y < 1, 0, 1.2)"
    case = reach(
        {"sea": {"side": "west", "stage": {"time": [0, 40], "value": [1.5, 0.5]}}},
        end=40.0,
        bed=bed,
        level=1.5,
        cells=(30, 4),
        probes=["reach.sea.level", "reach.depth@0.5,1.75"],
    )
    found = fvsolve.run(case)
    assert found["reach.sea.level"] == approx(1.5 - found.t / 40.0, rel=1e-12)
    assert 1e-3 < found["reach.depth@0.5,1.75"][found.t == 16.0][0] < 0.2


@pytest.mark.parametrize("path", ["turned", "mirrored", "north", "mesh"])
def test_a_restated_reach_gives_the_same(path, tmp_path):
    """Discharge in the west and rating in the east; the same along y, against x, and as a mesh (upwind)."""
    closures = {
        "up": WAVES["discharge"][0],
        "down": {"rating": {"level": [1.0, 1.2], "flow": [0.0, 1.0]}},
    }
    numerics = {"scheme": "upwind", "step": 0.02, "courant": None} if path == "mesh" else {}

    def depth(sides, size, cells, folder=None):
        patches = {
            name: {"side": side, **closures[name]}
            for name, side in zip(closures, sides, strict=True)
        }
        case = reach(
            patches, size, cells, numerics=numerics, bed="0.01*x" if path == "mesh" else "0"
        )
        if folder is not None:
            grid = rectangle(size, cells)
            lines = on_sides(grid.points, grid.ends[grid.inner :], size)
            write(
                folder / "g.msh",
                grid.points,
                corner_lists(grid),
                {"up": lines["west"], "down": lines["east"]},
            )
            basin = case["nodes"]["reach"]
            del basin["size"], basin["cells"]
            basin["mesh"] = {"file": str(folder / "g.msh")}
            basin["patches"] = {
                name: {k: v for k, v in one.items() if k != "side"} for name, one in patches.items()
            }
        model, state = ended(case)
        field = model.meshed[0]
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
    same, other = (
        np.lexsort((np.round(y, 6), np.round(x, 6))),
        np.lexsort((np.round(v, 6), np.round(u, 6))),
    )
    assert there[other] == approx(here[same], rel=1e-11)


@pytest.mark.parametrize("threads", [2, 3])
def test_any_number_of_threads_gives_the_same_bits(threads):
    case = reach(
        DRIVEN,
        (100.0, 10.0),
        (100, 12),
        5.0,
        level=2.0,
        bed="0.2*sin(x)*cos(y)",
        probes=["reach.up.flow"],
    )
    one, more = (fvsolve.run(case, threads=count) for count in (1, threads))
    assert (one["reach.up.flow"] == more["reach.up.flow"]).all() and more.summary[
        "threads"
    ] == threads


FAULTS = {
    "expected the depth of a supercritical inflow, or no key": {"discharge": 1.0, "depth": 0.0},
    "depth: is never above 0": {
        "discharge": 1.0,
        "depth": {"time": [0.0, 1.0], "value": [0.0, 0.0]},
    },
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
    for header, unit, text in (
        ("t [s],z", {}, "has no unit"),
        ("t [s],z [m]", {"unit": "m"}, "has its own unit"),
    ):
        (tmp_path / "tide.csv").write_text(f"{header}\n0,1\n10,2\n")
        with pytest.raises(fvsolve.FvsolveError, match=text):
            fvsolve.load(
                reach(
                    {"up": {"side": "west", "stage": {"file": str(tmp_path / "tide.csv"), **unit}}}
                )
            )
    (tmp_path / "tide.csv").write_text("t [s],z\n0,100\n10,120\n")
    stage = {"file": str(tmp_path / "tide.csv"), "unit": "cm"}
    case = fvsolve.load(reach({"up": {"side": "west", "stage": stage}}))
    assert case.nodes["reach"].patches["up"].stage.value.tolist() == [1.0, 1.2]


def test_a_rating_may_begin_where_the_bed_touches_the_outline():
    """The mean bed of the last cell, 2.5 mm, lies above the outline, where the rating begins."""
    rating = {"level": [0, 1, 2], "flow": [0, 12, 40]}
    keys = {
        "level": 0.0,
        "bed": "0.001*x",
        "size": (500.0, 2.0),
        "numerics": {"scheme": "muscl"},
        "end": 20.0,
    }
    result = fvsolve.run(
        reach(
            {"up": {"side": "west", "rating": rating}}, rain=1e-4, probes=["reach.up.flow"], **keys
        )
    )
    assert result.ok and result["reach.up.flow"][-1] < 0.0


def test_two_reaches_without_a_link_between_them_form_a_valid_case():
    data = reach(
        {"up": {"side": "west", "discharge": 1.0}}, end=2.0, cells=(20, 2), probes=["reach.volume"]
    )
    alone = fvsolve.run(fvsolve.load(data))
    data["nodes"]["other"] = data["nodes"]["reach"] | {
        "patches": {"sea": {"side": "west", "stage": 0.9 * DEEP}}
    }
    both = fvsolve.run(fvsolve.load(data))
    assert both.ok and both["reach.volume"] == approx(alone["reach.volume"], rel=1e-12)


def test_a_schedule_of_depths_may_begin_at_zero():
    depth = {"time": [0.0, 1.0], "value": [0.0, 0.3]}
    fvsolve.load(reach({"up": {"side": "west", "discharge": 1.0, "depth": depth}}))


DRY_SIDE = {
    "level": -50.0,
    "bed": "0.01*(20-x)+0.2*sin(0.5*x)*cos(0.7*y)",
    "start": {"level": 0.3},
    "size": [20.0, 12.0],
    "cells": [10, 6],
}
DEEP_SIDE = {"level": 1.0, "size": [60.0, 10.0], "cells": [60, 10]}


@pytest.mark.parametrize(
    "basin", [DRY_SIDE, DEEP_SIDE], ids=["an inflow that ends", "a wave through zero"]
)
def test_a_discharge_that_passes_zero_is_not_held(basin):
    """By the rounding of the schedule, -5e-15 and -1e-12 m3/s were more than critical outflow."""
    patch = {
        "side": "south",
        "span": [20.0, 40.0],
        "discharge": {"mean": 0.0, "amplitude": -0.8, "period": 40.0},
    }
    if basin is DRY_SIDE:
        series = {"time": [0.0, 20.0, 29.531621583330534], "value": [0.0, 0.8022074657015001, 0.0]}
        patch = {"side": "west", "discharge": series}
    water = {
        "name": "user",
        "density": 1000.0,
        "bulk_modulus": 2.2e9,
        "viscosity": 1e-3,
        "law": "linear",
    }
    numerics = {"end": 40.0, "scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}
    found = fvsolve.run(
        {
            "fluid": water,
            "nodes": {"p": {"type": "basin", "elevation": 0.0, "patches": {"a": patch}, **basin}},
            "numerics": numerics,
            "output": {"every": 1.0},
        }
    )
    assert found.ok and not found.summary["marks"]


def test_quadrilaterals_of_a_file_have_the_inflow_of_a_grid(tmp_path):
    """Over a bed that is uneven along the patch; means over three faces gave another flow through a stage."""
    bed = "0.2*y"
    patches = {"west": {"side": "west", "stage": 1.2}, "east": {"side": "east", "stage": 1.0}}
    case = reach(patches, (10.0, 4.0), (20, 8), 5.0, {"scheme": "upwind"}, bed=bed)
    mesh = rectangle((10.0, 4.0), (20, 8))
    lines = on_sides(mesh.points, mesh.ends[mesh.inner :], (10.0, 4.0), ["west", "east"])
    write(tmp_path / "t.msh", mesh.points, corner_lists(mesh), lines)
    basin = {
        key: value for key, value in case["nodes"]["reach"].items() if key not in ("size", "cells")
    }
    open_ends = {
        name: {k: v for k, v in one.items() if k != "side"} for name, one in patches.items()
    }
    other = case | {
        "nodes": {
            "reach": basin | {"mesh": {"file": str(tmp_path / "t.msh")}, "patches": open_ends}
        }
    }
    (grid, before), (file, after) = ended(case), ended(other)
    order = np.lexsort((file.meshed[0].x, file.meshed[0].y))
    same = np.lexsort((grid.meshed[0].x, grid.meshed[0].y))
    assert depths(file, after)[order] == approx(depths(grid, before)[same], abs=1e-6)
