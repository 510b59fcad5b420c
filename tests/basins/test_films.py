"""Films of water on rough beds with the steps of waves: Manning's and Darcy's law, backwater, lakes, notices."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import ended, halved, model_of
from reference.meshes import write
from reference.scenes import GRAVITY as G
from reference.scenes import reservoir, scene

import fvsolve

LONG, WIDE = 200.0, 6.0


def sheet(
    slope, depth, u, numerics=None, friction=None, cells=(100, 3), long=LONG, end=30.0, **basin
):
    """Return (result, velocity, depth in the middle) of a sheet of water on a plane that falls to an open side."""
    bed = f"{slope}*({long}-x)"
    own = {
        "size": [long, WIDE],
        "cells": list(cells),
        "patches": {"down": {"side": "east", "boundary": "open"}},
    }
    hill = {
        "type": "basin",
        "level": -1.0,
        "elevation": 0.0,
        "bed": bed,
        **(own | (friction or {}) | basin),
    }
    hill["start"] = {"level": f"{bed} + {depth}", "u": str(u)}
    place = f"@{0.5 * long},{0.5 * WIDE}"
    case = scene(
        {"hill": hill},
        {},
        end,
        {"scheme": "muscl", **(numerics or {})},
        [f"hill.u{place}", f"hill.depth{place}"],
        every=end / 10,
    )
    found = fvsolve.run(case)
    return found, found[f"hill.u{place}"], found[f"hill.depth{place}"]


def manning(slope, n, depth):
    """Velocity of uniform flow [m/s]."""
    return depth ** (2.0 / 3.0) * math.sqrt(slope) / n


def kinds(found):
    return {one["kind"] for one in found.summary["warnings"]}


@pytest.mark.in_turn
@pytest.mark.parametrize("begins", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("depth", [0.002, 0.005])
@pytest.mark.parametrize("n", [0.02, 0.1])
@pytest.mark.parametrize("slope", [0.05, 0.02])
def test_films_flow_by_manning_at_the_steps_of_their_waves(slope, n, depth, begins):
    right = manning(slope, n, depth)
    found, u, h = sheet(slope, depth, begins * right, friction={"manning": n})
    assert u[-1] == approx(right, rel=1e-6) and h[-1] == approx(depth, rel=1e-6)
    assert found.summary["steps"] < 50 and not kinds(found)


NUMERICS = {
    "euler": {"method": "euler"},
    "ssp-rk2": {"method": "ssp-rk2"},
    "ssp-rk3": {"method": "ssp-rk3"},
    "step": {"method": "ssp-rk2", "step": 1.0},
    "auto": {"method": "auto"},
    "rodas-5p": {"method": "rodas-5p"},
    "weno5": {"scheme": "weno5"},
}


@pytest.mark.parametrize("numerics", NUMERICS)
def test_no_method_that_is_right_at_films_depends_on_its_steps(numerics):
    right = manning(0.02, 0.1, 0.002)
    found, u, _ = sheet(0.02, 0.002, 0.0, NUMERICS[numerics], {"manning": 0.1})
    assert u[-1] == approx(right, rel=1e-6) and "friction" not in kinds(found)


def test_films_flow_by_darcy():
    right = math.sqrt(8.0 * G * 0.003 * 0.05 / 0.5)
    assert sheet(0.05, 0.003, 0.0, friction={"factor": 0.5})[1][-1] == approx(right, rel=1e-6)


def test_films_flow_by_manning_on_triangles_and_down_a_diagonal(tmp_path):
    points, cells, _ = halved((60.0, 60.0), (30, 30))
    right, bed = manning(0.05, 0.1, 0.005), "0.05*(60.0-(x + y)/sqrt(2))"
    hill = {
        "type": "basin",
        "mesh": {"file": str(write(tmp_path / "hill.vtk", points, cells))},
        "level": -9.0,
        "elevation": 0.0,
        "bed": bed,
        "manning": 0.1,
        "start": {"level": f"{bed} + 0.005"},
    }
    found = fvsolve.run(
        scene(
            {"hill": hill},
            {},
            10.0,
            {"scheme": "muscl"},
            ["hill.u@30,30", "hill.v@30,30"],
            every=1.0,
        )
    )
    for name in ("hill.u@30,30", "hill.v@30,30"):
        assert found[name][-1] == approx(right / math.sqrt(2.0), rel=2e-3)


@pytest.mark.parametrize(("method", "order"), [("euler", 1.0), ("ssp-rk2", 2.0), ("ssp-rk3", 2.0)])
def test_flow_comes_to_its_speed_with_the_order_of_the_method(method, order):
    """du/dt = g S - C u^2 at uniform depth, so u = v tanh(g S t / v)."""
    right, errors = manning(0.005, 0.03, 0.5), []
    for step in (8.0, 4.0, 2.0):
        _, u, _ = sheet(
            0.005,
            0.5,
            0.0,
            {"method": method, "step": step},
            {"manning": 0.03},
            (20, 1),
            4000.0,
            32.0,
        )
        errors.append(abs(u[-1] - right * math.tanh(G * 0.005 * 32.0 / right)))
    assert math.log2(errors[1] / errors[2]) > order - 0.2


def backwater(cells):
    """Return (x, depth, depth of gradually varied flow) of 1 m2/s from uniform flow into a lake."""
    long, n, slope, wide = 2000.0, 0.03, 0.001, 20.0
    bed = f"{slope}*({long}-x)"
    river = {
        "type": "basin",
        "size": [long, wide],
        "cells": [cells, 1],
        "level": 2.0,
        "elevation": 0.0,
        "bed": bed,
        "manning": n,
        "start": {"level": f"max(2.0, {bed} + 1.0)", "u": "0.9"},
        "patches": {"up": {"side": "west"}, "down": {"side": "east"}},
    }
    nodes = {
        "river": river,
        "spring": reservoir(101325.0 + 1e7, elevation=0.0),
        "sea": reservoir(101325.0 + 1000.0 * G * 1.8, elevation=0.0),
    }
    area = wide / (0.6 * math.sqrt(2.0 * 1e7 / 1000.0))
    out = wide / (0.6 * math.sqrt(2.0 * G * 0.2))
    valve = {"type": "valve", "discharge_coefficient": 0.6}
    links = {
        "in": valve | {"from": "spring", "to": "river.up", "area": area},
        "out": valve | {"from": "river.down", "to": "sea", "area": out},
    }
    x = (np.arange(cells) + 0.5) * long / cells
    probes = [f"river.depth@{at:.10g},{wide / 2}" for at in x]
    found = fvsolve.run(
        scene(nodes, links, 10000.0, {"scheme": "muscl"}, [*probes, "in.flow"], every=1000.0)
    )
    before, depth = (np.array([found[name][k] for name in probes]) for k in (-2, -1))
    assert np.abs(depth - before).max() < 1e-6  # steady
    return x, depth, varied(x, depth, found.si("in.flow")[-1] / wide, slope, n)


def varied(x, depth, q, slope, n):
    """Depth by dh/dx = (S - n^2 q^2 / h^(10/3)) / (1 - q^2 / (g h^3)), by RK4 upstream from 0.9 of the length."""

    def rise(h):
        return (slope - n * n * q * q / h ** (10.0 / 3.0)) / (1.0 - q * q / (G * h**3))

    found, last = np.full(x.size, np.nan), int(0.9 * x.size)
    found[last] = h = depth[last]
    for k in range(last, 0, -1):
        for _ in range(20):
            step = (x[k - 1] - x[k]) / 20
            a = rise(h)
            b = rise(h + 0.5 * step * a)
            c = rise(h + 0.5 * step * b)
            h += step * (a + 2.0 * b + 2.0 * c + rise(h + step * c)) / 6.0
        found[k - 1] = h
    return found


def test_backwater_is_of_second_order():
    errors = []
    for cells in (50, 100):
        x, depth, exact = backwater(cells)
        inner = (x > 200.0) & (x < 1800.0)
        errors.append(np.nanmax(np.abs(depth - exact)[inner]))
    assert math.log2(errors[0] / errors[1]) > 1.7 and errors[1] < 3e-5


def both_ends(basin, end):
    """Return the states of a basin at the start and at the end."""
    model = model_of(scene({"box": basin}, {}, end, {"scheme": "muscl"}))
    start = fvsolve.initial_state(model)
    return start.y.copy(), fvsolve.advance(model, start, end).y


def test_a_lake_with_islands_and_friction_lies_still():
    lake = {
        "type": "basin",
        "size": [10.0, 8.0],
        "cells": [40, 30],
        "level": 0.0,
        "manning": 0.1,
        "bed": "0.5*sin(3*x)*cos(2*y) - 0.3",
    }
    for y in both_ends(lake, 5.0):
        assert not y.any()


def test_water_that_breaks_over_a_rough_dry_slope_is_all_there():
    box = {
        "type": "basin",
        "size": [60.0, 6.0],
        "cells": [60, 6],
        "level": -1.0,
        "elevation": 0.0,
        "manning": 0.05,
        "bed": "0.02*(60-x)",
        "start": {"level": "where(x < 15, 2, -1)"},
    }
    before, after = both_ends(box, 60.0)
    assert after[:360].min() >= 0.0 and after[:360].sum() == approx(before[:360].sum(), rel=1e-13)
    assert after[:360].reshape(6, 60)[:, -1].min() > 0.1


def test_upwind_states_by_how_much_films_are_too_slow():
    right = manning(0.05, 0.1, 0.005)
    found, u, _ = sheet(0.05, 0.005, right, {"scheme": "upwind"}, {"manning": 0.1})
    (one,) = [one for one in found.summary["warnings"] if one["kind"] == "film"]
    assert (one["place"], one["key"]) == ("nodes.hill", "scheme")
    assert one["value"] == approx(1.0 - u[-1] / right, abs=0.01) and one["value"] == approx(
        0.84, abs=0.01
    )
    assert "film" not in kinds(
        sheet(0.05, 0.5, 1.0, {"scheme": "upwind"}, {"manning": 0.03}, end=1.0)[0]
    )


def test_upwind_states_nothing_of_a_lake_and_its_shore():
    shape = {"size": [20.0, 2.0], "cells": [20, 2], "bed": "0.3*(x - 10.2)"}
    lake = {"type": "basin", "level": 0.0, "manning": 0.1, **shape}
    assert "film" not in kinds(
        fvsolve.run(scene({"lake": lake}, {}, 1.0, {"scheme": "upwind"}, every=0.5))
    )


@pytest.mark.in_turn
@pytest.mark.parametrize(
    "numerics", [{"method": "rk4"}, {"method": "dormand-prince", "rtol": 1e-6}], ids=["rk4", "rtol"]
)
@pytest.mark.parametrize(
    "friction", [{"manning": 0.1}, {"factor": 8 * G * 0.1**2 / 0.005 ** (1 / 3)}], ids=["n", "f"]
)
def test_methods_that_freeze_friction_state_by_how_much_films_are_too_fast(numerics, friction):
    right = manning(0.05, 0.1, 0.005)
    found, u, _ = sheet(0.05, 0.005, 0.5 * right, numerics, friction)
    worst = max(
        (one for one in found.summary["warnings"] if one["kind"] == "friction"),
        key=lambda one: one["value"],
    )
    assert (worst["place"], worst["key"]) == ("nodes.hill", "method")
    assert worst["value"] == approx(u[-1] / right - 1.0, abs=0.01) and worst["value"] == approx(
        0.205, abs=0.01
    )
    deep = sheet(0.001, 2.0, 1.0, numerics, {"manning": 0.03}, end=1.0)[0]
    assert "friction" not in kinds(deep)


SHAKEN = {"mean": 0.0, "amplitude": 0.1, "period": 1.0}
SLOWLY = {"time": [0.0, 2.0], "value": [0.0, -0.4]}
THIN = {"type": "basin", "size": [2.0, 1.0], "cells": [20, 2], "level": 0.005, "manning": 0.1}
PLATE = {"type": "body", "mass": 1e3, "inertia": [1e3, 1e3, 1e3]}


def slid(joint):
    plate = {**PLATE, "joint": {"kind": "prismatic", "axis": [1, 0, 0], **joint}}
    return {"plate": plate, "b": {**THIN, "on": "plate"}}


def between_walls(tmp_path, kind):
    """Return nodes with a film that a moving wall compresses, on a rectangle or on triangles."""
    if kind == "wall":
        return {"b": {**THIN, "patches": {"lid": {"side": "east", "travel": SLOWLY}}}}
    points, cells, sides = halved((2.0, 1.0), (20, 2))
    file = write(tmp_path / "film.msh", points, cells, {"lid": sides["east"]})
    rest = {key: one for key, one in THIN.items() if key not in ("size", "cells")}
    return {"b": {**rest, "mesh": {"file": str(file)}, "patches": {"lid": {"travel": SLOWLY}}}}


@pytest.mark.parametrize("kind", ["wall", "triangles", "body"])
def test_films_that_move_go_as_an_implicit_method_has_them(tmp_path, kind):
    nodes, found = slid({"travel": SHAKEN}) if kind == "body" else between_walls(tmp_path, kind), []
    for numerics in ({"method": "ssp-rk2", "courant": 0.5}, {"method": "rodas-5p", "rtol": 1e-6}):
        model, state = ended(scene(nodes, {}, 0.8, {"scheme": "muscl", **numerics}), 0.8)
        found.append(model.meshed[0].deviations(state.y)[1])
    size = np.abs(found[1]).max()
    assert size > 1e-4 and np.abs(found[0] - found[1]).max() < 0.02 * size


def test_a_film_on_a_body_that_its_force_moves_is_frozen_with_a_notice():
    nodes = slid({}) | {"b": {**THIN, "on": "plate", "start": {"u": "0.3"}}}
    for method, said in (({"method": "ssp-rk2"}, True), ({"method": "rodas-5p"}, False)):
        found = fvsolve.run(scene(nodes, {}, 0.1, {"scheme": "muscl", **method}, every=0.05))
        assert ("friction" in kinds(found)) == said


FILLED = {
    "explicit": ("muscl", "ssp-rk2", {"courant": 0.8}),
    "capped": ("muscl", "rk4", {"courant": 0.8}),
    "error control": ("muscl", "dormand-prince", {"rtol": 1e-4}),
    "implicit": ("upwind", "gauss-4", {"courant": 0.2}),
    "rosenbrock": ("upwind", "rodas-4", {"rtol": 1e-4}),
}


@pytest.mark.in_turn
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("way", FILLED)
def test_a_dry_basin_that_a_hydrograph_fills_has_short_steps_from_the_start(way, order):
    """A first step without a limit once put 30 s of inflow into one cell."""
    scheme, method, steps = FILLED[way]
    nodes = {
        "river": {"type": "inflow", "flow": {"time": [0.0, 20.0, 30.0], "value": [0.0, 4.0, 4.0]}},
        "plain": {
            "type": "basin",
            "size": [40.0, 10.0],
            "cells": [40, 10],
            "level": -1.0,
            "bed": "-0.002*x",
            "manning": 0.03,
            "patches": {"west": {"side": "west"}},
        },
    }
    case = {
        "schema": 1,
        "fluid": {"name": "Water", "law": "linear"},
        "nodes": dict(list(nodes.items())[::order]),
        "links": {"entry": {"type": "valve", "from": "river", "to": "plain.west", "area": 2.0}},
        "numerics": {"end": 30.0, "scheme": scheme, "method": method, **steps},
        "output": {"probes": ["plain.depth@0.5,5", "entry.flow"], "fields": 0},
    }
    if "courant" in steps:
        checks = fvsolve.build(fvsolve.load(case)).checks
        assert 0.0 < checks["step"] < 1.0 and "almost dry" in checks["step_set_by"]
    result = fvsolve.run(case, pictures=False)
    assert result.reason == "finished" and result.summary["steps"] > 60
    critical = ((4.0 / 10.0) ** 2 / 9.81) ** (1.0 / 3.0)
    deepest = result.extremes["plain.depth@0.5,5"].maximum
    assert critical < deepest < 3.0 * critical and deepest == pytest.approx(0.33, rel=0.05)
    stored = result.summary["ledgers"]["mass"]["final"] / fvsolve.load(case).properties.density
    assert stored == pytest.approx(4.0 * (10.0 + 10.0), rel=1e-9)
