"""Walls that move on meshes of any cells: geometry as it is now, what is conserved, closed forms, restatements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from truth.meshes import write

from fvsolve import advance, build, load, run
from fvsolve.basins.lower_mesh import lower_mesh
from fvsolve.errors import CaseError
from fvsolve.mesh import rectangle
from fvsolve.mesh.edges import edges_of
from fvsolve.mesh.shapes import assemble
from fvsolve.model.model import State
from tests.truth.scenes import GRAVITY, RHO, ramp, scene

SIDES = {"west": (0, 0.0), "east": (0, 1.0), "south": (1, 0.0), "north": (1, 1.0)}
STEPPED = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk2"}
EXACT = ["euler", "ssp-rk2", "rk4", "implicit-midpoint", "gauss-4"]


def straight(speed, end=10.0):
    return {"time": [0.0, end], "value": [0.0, speed * end]}


def tub(tmp_path, kind="mixed", many=(12, 4), size=(2.0, 1.0), turned=False, seed=5, reach=0.25):
    """The name of a file of a shaken grid of cells, triangles, quads or both, whose sides are groups of lines."""
    mesh = rectangle(size, many)
    points = mesh.points.copy()
    inside = (points > points.min(0) + 1e-9).all(1) & (points < points.max(0) - 1e-9).all(1)
    step = reach * np.array(size) / many
    points[inside] += np.random.default_rng(seed).uniform(-1.0, 1.0, (inside.sum(), 2)) * step
    cut = {"triangles": lambda k: True, "quads": lambda k: False, "mixed": lambda k: k % 3 == 0}[kind]
    cells = [[c[:3], [c[0], *c[2:]]] if cut(k) else [c] for k, c in enumerate(mesh.cells.tolist())]
    outer = mesh.ends[mesh.inner :]
    middle = mesh.points[outer].mean(axis=1)
    groups = {
        side: outer[np.abs(middle[:, axis] - at * size[axis]) < 1e-9].tolist() for side, (axis, at) in SIDES.items()
    }
    if turned:  # by 90 degrees: x, y -> -y, x
        points = np.column_stack([size[1] - points[:, 1], points[:, 0]])
        groups = {{"west": "south", "south": "east", "east": "north", "north": "west"}[k]: v for k, v in groups.items()}
    return str(write(tmp_path / f"{kind}{many[0]}x{many[1]}{turned}.msh", points, sum(cells, []), groups))


def pool(file, patches, physics="free-surface", **more):
    rest = {"level": 1.0} if physics == "free-surface" else {"pressure": 2e5, "thickness": 0.1}
    return {"type": "basin", "physics": physics, "mesh": {"file": file}, "patches": patches, **rest, **more}


def moved(case, until):
    """(model, state) at a time."""
    model = build(load(case))
    return model, advance(model, State(case["numerics"].get("start", 0.0), model.start.copy()), until)


def as_it_is(mesh, points):
    """The mesh with its corners elsewhere."""
    edges = edges_of(mesh.cells, len(points))
    patch = -1 - mesh.right[mesh.inner :]
    place = {key: k for k, key in enumerate(map(frozenset, mesh.ends[mesh.inner :].tolist()))}
    order = [place[frozenset((a, b))] for a, b in zip(edges.start[edges.outer], edges.stop[edges.outer], strict=True)]
    return assemble(points, mesh.cells, edges, mesh.patches, patch[order])


# geometry -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["triangles", "quads", "mixed"])
@pytest.mark.parametrize("many", [(12, 4), (40, 9)])
def test_what_is_known_of_sides_is_that_of_the_mesh_with_corners_where_they_are(tmp_path, kind, many):
    patches = {"west": {"travel": straight(0.2), "zone": 0.7}, "east": {"travel": straight(-0.3)}}
    case = scene({"b": pool(tub(tmp_path, kind, many), patches)}, {}, 1.0, {**STEPPED, "step": 0.01})
    model = build(load(case))
    basin, y = model.basins[0], model.start.copy()
    y[[int(row["y"]) for row in model.tables.walls]] = 0.2, -0.3
    with model.slate() as slate:
        model.functions.rhs(0.0, y, np.zeros(y.size), model.new_out(), slate.handle)
    now = as_it_is(basin.mesh, basin.points_at(y))
    assert now.area / basin.mesh.area == pytest.approx(basin.stretched(y), rel=1e-13)
    floats, integers = lower_mesh(now)
    assert (integers == basin.integers).all()
    at = int(basin.row["mesh"])
    assert slate.tables.plane[at : at + floats.size] == pytest.approx(floats, rel=1e-10, abs=1e-11)


# water ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [*EXACT, "rodas-4"])
@pytest.mark.parametrize("kind", ["triangles", "mixed"])
def test_homologous_expansion_is_exact_to_round_off_under_every_method(tmp_path, kind, method):
    rate = 0.4
    for side, axis in (("east", 0), ("north", 1)):
        patches = {side: {"travel": straight((2.0 if side == "east" else 1.0) * rate)}}
        start = {"uv"[axis]: f"{rate} * {'xy'[axis]}"}
        case = scene({"b": pool(tub(tmp_path, kind), patches, start=start)}, {}, 0.5,
                     {**STEPPED, "method": method, "step": 5e-3})  # fmt: skip
        model, state = moved(case, 0.5)
        basin = model.basins[0]
        found, grown = basin.of(state.y), 1.0 + 0.5 * rate
        # Rosenbrock methods step by differences for a Jacobian; the iteration for two stages ends short of round-off
        close = {"rodas-4": 1e-10, "gauss-4": 2e-12}.get(method, 1e-13)
        assert 1.0 + found[0] == pytest.approx(1.0 / grown, abs=close)
        assert found[1 + axis] / (1.0 + found[0]) == pytest.approx(rate * basin.mesh.centre[:, axis], abs=close)
        assert abs(model.contents(state.y)[1]) < 1e-12 * model.contents(state.y)[0]


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
@pytest.mark.parametrize("method", EXACT)
def test_between_walls_that_swing_a_lake_of_uniform_content_is_wherever_lines_are_and_mass_is_kept(
    tmp_path, method, scheme
):
    swings = {"mean": 0.1, "amplitude": 0.25, "period": 1.1, "phase": 0.4}
    patches = {"west": {"travel": swings, "zone": 0.9}, "east": {"travel": straight(-0.3)}}
    start = {"level": "1 + 0.1 * cos(3 * x) * cos(2 * y)", "u": "0.2 * x", "v": "0.1 * y"}
    more = {"start": start, "scalars": {"even": 3.0, "patchy": "1 + x"}}
    case = scene({"b": pool(tub(tmp_path, many=(10, 3)), patches, **more)}, {}, 0.4,
                 {**STEPPED, "scheme": scheme, "method": method, "step": 4e-3},
                 scalars={"even": {"initial": 3.0}, "patchy": {"initial": 1.0}})  # fmt: skip
    model, state = moved(case, 0.4)
    basin = model.basins[0]
    values = basin.values(state.y)
    assert values["even"] == pytest.approx(3.0, abs=1e-9 if method in EXACT[3:] else 1e-12)
    assert np.ptp(values["patchy"]) > 0.5
    assert abs(model.contents(state.y)[1]) < 1e-11 * model.contents(state.y)[0]


@pytest.mark.parametrize("method", EXACT[:3])
def test_where_no_wave_has_come_yet_lines_that_swing_leave_a_lake_as_it_is(tmp_path, method):
    swings = {"mean": 0.1, "amplitude": 0.25, "period": 1.1, "phase": 0.4}
    patches = {"west": {"travel": swings}, "east": {"travel": straight(-0.3)}}
    case = scene({"b": pool(tub(tmp_path, many=(30, 2)), patches)}, {}, 1.0,
                 {"scheme": "upwind", "method": method, "step": 2e-3})  # fmt: skip
    model, state = moved(case, 6e-3)  # three steps of four stages at most, each of which looks one cell further
    basin = model.basins[0]
    far = np.abs(basin.mesh.centre[:, 0] - 1.0) < 0.1
    assert np.abs(basin.stretched(state.y)[far] - 1.0).min() > 1e-5
    assert basin.of(state.y)[:, far] == pytest.approx(np.zeros((3, far.sum())), abs=1e-15)
    assert np.abs(basin.of(state.y)[0]).max() > 1e-4


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_wall_that_is_pushed_in_sends_out_the_exact_shock_and_does_its_work(tmp_path, side, scheme):
    speed, sign = 0.8, 1.0 if side in ("west", "south") else -1.0
    many, size = ((60, 2), (2.0, 0.2)) if side in ("west", "east") else ((2, 60), (0.2, 2.0))
    file = tub(tmp_path, "triangles", many, size, reach=0.0)
    nodes = {"b": pool(file, {side: {"travel": straight(sign * speed, 0.5)}})}
    case = scene(nodes, {}, 0.3, {"scheme": scheme, "method": "ssp-rk2", "courant": 0.8},
                 [f"b.{side}.force", f"b.{side}.power", f"b.{side}.travel"], every=0.02)  # fmt: skip
    depth = brentq(lambda h: (h - 1.0) * math.sqrt(0.5 * GRAVITY * (h + 1.0) / h) - speed, 1.0, 3.0)
    force = 0.5 * RHO * GRAVITY * depth**2 * 0.2
    result = run(case)
    close = 3e-3 if scheme == "upwind" else 5e-4  # a wall that starts at once leaves some of its start behind
    assert result[f"b.{side}.force"][-1] == pytest.approx(force, rel=close)
    assert result[f"b.{side}.power"][-1] == pytest.approx(result[f"b.{side}.force"][-1] * speed, rel=1e-15)
    assert result[f"b.{side}.travel"][-1] == pytest.approx(sign * speed * 0.3, rel=1e-13)


def test_walls_of_a_file_that_cannot_move_are_refused_by_name(tmp_path):
    step = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (1, 2), (2, 2)]
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [4, 5, 7, 6]]
    groups = {"inlet": [3, 0], "shoulder": [6, 4], "end": [2, 5], "top": [7, 6], "upper": [5, 7]}
    lean = [(0, 0), (1, 0), (2, 0.5), (0, 1), (1, 1), (2, 1)]
    files = {
        "stair": str(write(tmp_path / "stair.msh", step, cells, groups)),
        "funnel": str(write(tmp_path / "funnel.msh", lean, cells[:2], {"east": [2, 5], "west": [0, 3]})),
    }
    wanted = {
        ("stair", "shoulder"): "does not lie where the basin ends along x, at 0 m",
        ("stair", "inlet"): r"would take along the outline at 1,1.5 m, which does not run along x; wanted an outline",
        ("stair", "end"): r"would take along the outline at",
        ("funnel", "east"): r"would take along the outline at 1.5,0.25 m",
        ("funnel", "west"): r"would take along the outline at 1.5,0.25 m",
    }
    for (name, patch), text in wanted.items():
        for more in ({"zone": 1.0}, {}):
            nodes = {"b": pool(files[name], {patch: {"travel": straight(0.01), **more}})}
            case = scene(nodes, {}, 1.0, {**STEPPED, "step": 0.01})
            if more and patch in ("inlet", "west"):  # whose zone ends before what leans
                load(case)
                continue
            with pytest.raises(CaseError, match=rf"nodes.b.patches.{patch}: {text}"):
                load(case)


def test_a_travel_that_turns_a_cell_over_where_its_zone_ends_is_refused(tmp_path):
    points = [(0, 0), (3, 0), (3, 1), (2, 1), (0, 1), (1, 0.55)]
    cells = [[0, 3, 5], [0, 5, 4], [5, 3, 4], [0, 1, 3], [1, 2, 3]]
    file = str(write(tmp_path / "thin.msh", points, cells, {"east": [1, 2]}))
    cases = [
        scene({"b": pool(file, {"east": {"travel": ramp(0.0, 1.0, 0.0, -1.5), "zone": zone}})}, {}, 1.0,
              {**STEPPED, "step": 0.01}) for zone in ("2 m", "3 m")
    ]  # fmt: skip
    with pytest.raises(CaseError, match=r"travel: turns over the cell at 1,0.516667 m, in which the zone ends"):
        load(cases[0])
    load(cases[1])


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_mesh_that_is_turned_by_a_right_angle_has_the_same_waves(tmp_path, scheme):
    travel, found = {"mean": 0, "amplitude": 0.2, "period": 1.3}, []
    for turned in (False, True):
        file = tub(tmp_path, many=(10, 4), turned=turned)
        start = {"u": "0.3 * sin(x)"} if not turned else {"v": "0.3 * sin(y)"}
        nodes = {"b": pool(file, {"north" if turned else "east": {"travel": travel, "zone": 1.5}}, start=start)}
        model, state = moved(scene(nodes, {}, 0.5, {**STEPPED, "scheme": scheme, "step": 5e-3}), 0.5)
        basin = model.basins[0]
        depth, x, y = basin.of(state.y)[0], *basin.mesh.centre.T
        x, y = (y, 1.0 - x) if turned else (x, y)
        found.append(depth[np.lexsort((np.round(y, 9), np.round(x, 9)))])
    assert np.abs(found[0]).max() > 0.01
    assert found[1] == pytest.approx(found[0], abs=1e-12)
