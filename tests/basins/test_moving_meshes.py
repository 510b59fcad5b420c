"""Moving walls on meshes: geometry of moved corners, conservation, closed forms, and equivalent cases."""

import math

import numpy as np
import pytest
from reference.basins import SIDES, ended, model_of, on_sides, straight
from reference.meshes import write
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, ramp, scene, smooth_ramp, smooth_step
from scipy.integrate import trapezoid
from scipy.optimize import brentq

from fvsolve import load, run
from fvsolve.core.assembly.features import with_slot
from fvsolve.core.mesh import rectangle
from fvsolve.core.mesh.mesh import assemble, edges_of
from fvsolve.errors import CaseError
from fvsolve.features.basins.lower_motion import lower_mesh
from fvsolve.features.basins.tables import SLOT
from fvsolve.studies.energy_balance import energy

STEPPED = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk2"}
EXACT = ["euler", "ssp-rk2", "rk4", "implicit-midpoint", "gauss-4"]


def tub(tmp_path, kind="mixed", many=(12, 4), size=(2.0, 1.0), turned=False, seed=5, reach=0.25):
    """Return the name of a mesh file of distorted triangles, quads or both, whose sides are groups of lines."""
    mesh = rectangle(size, many)
    points = mesh.points.copy()
    inside = (points > points.min(0) + 1e-9).all(1) & (points < points.max(0) - 1e-9).all(1)
    step = reach * np.array(size) / many
    points[inside] += np.random.default_rng(seed).uniform(-1.0, 1.0, (inside.sum(), 2)) * step
    cut = {"triangles": lambda k: True, "quads": lambda k: False, "mixed": lambda k: k % 3 == 0}[
        kind
    ]
    cells = [[c[:3], [c[0], *c[2:]]] if cut(k) else [c] for k, c in enumerate(mesh.cells.tolist())]
    groups = on_sides(mesh.points, mesh.ends[mesh.inner :], size)
    if turned:  # by 90 degrees: x, y -> -y, x
        points = np.column_stack([size[1] - points[:, 1], points[:, 0]])
        groups = {
            {"west": "south", "south": "east", "east": "north", "north": "west"}[k]: v
            for k, v in groups.items()
        }
    return str(
        write(tmp_path / f"{kind}{many[0]}x{many[1]}{turned}.msh", points, sum(cells, []), groups)
    )


def pool(file, patches, physics="free-surface", **more):
    rest = {"level": 1.0} if physics == "free-surface" else {"pressure": 2e5, "thickness": 0.1}
    return {
        "type": "basin",
        "physics": physics,
        "mesh": {"file": file},
        "patches": patches,
        **rest,
        **more,
    }


def as_it_is(mesh, points):
    """Return the mesh with its corners at `points`."""
    edges = edges_of(mesh.cells, len(points))
    patch = -1 - mesh.right[mesh.inner :]
    place = {key: k for k, key in enumerate(map(frozenset, mesh.ends[mesh.inner :].tolist()))}
    order = [
        place[frozenset((a, b))]
        for a, b in zip(edges.start[edges.outer], edges.stop[edges.outer], strict=True)
    ]
    return assemble(points, mesh.cells, edges, mesh.patches, patch[order])


# geometry -------------------------------------------------------------------------------------------------------


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", ["triangles", "quads", "mixed"])
@pytest.mark.parametrize("many", [(12, 4), (40, 9)])
def test_geometry_of_sides_is_that_of_the_mesh_with_moved_corners(tmp_path, kind, many):
    patches = {"west": {"travel": straight(0.2), "zone": 0.7}, "east": {"travel": straight(-0.3)}}
    case = scene(
        {"b": pool(tub(tmp_path, kind, many), patches)},
        {},
        1.0,
        {**STEPPED, "step": 0.01},
        scalars={"dye": {"initial": 1.0, "diffusivity": 1e-3}},
    )
    model = model_of(case)
    basin, y = model.meshed[0], model.start.copy()
    y[[int(row["y"]) for row in with_slot(model.features, SLOT).walls]] = 0.2, -0.3
    with model.run_data() as slate:
        model.functions.rhs(0.0, y, np.zeros(y.size), model.new_out(), slate.handle)
    now = as_it_is(
        basin.mesh, basin.mesh.points + sum(y[at] * goes for at, _, goes in basin.stretches)
    )
    assert now.area / basin.mesh.area == pytest.approx(basin.area_ratios(y), rel=1e-13)
    floats, integers = lower_mesh(now, basin.steepest)
    assert (integers == basin.integers).all()
    at = int(basin.row["mesh"])
    assert slate.tables.plane[at : at + floats.size] == pytest.approx(floats, rel=1e-10, abs=1e-11)


# water ----------------------------------------------------------------------------------------------------------


@pytest.mark.in_turn
@pytest.mark.parametrize("method", [*EXACT, "rodas-4"])
@pytest.mark.parametrize("kind", ["triangles", "mixed"])
def test_homologous_expansion_is_exact_to_round_off_under_every_method(tmp_path, kind, method):
    rate = 0.4
    for side, axis in (("east", 0), ("north", 1)):
        patches = {side: {"travel": straight((2.0 if side == "east" else 1.0) * rate)}}
        start = {"uv"[axis]: f"{rate} * {'xy'[axis]}"}
        case = scene(
            {"b": pool(tub(tmp_path, kind), patches, start=start)},
            {},
            0.5,
            {**STEPPED, "method": method, "step": 5e-3},
        )
        model, state = ended(case, 0.5)
        basin = model.meshed[0]
        found, grown = basin.deviations(state.y), 1.0 + 0.5 * rate
        # Jacobians by differences limit Rosenbrock methods, iterations limit methods of two stages
        close = {"rodas-4": 1e-10, "gauss-4": 2e-12}.get(method, 1e-13)
        assert 1.0 + found[0] == pytest.approx(1.0 / grown, abs=close)
        assert found[1 + axis] / (1.0 + found[0]) == pytest.approx(
            rate * basin.mesh.centre[:, axis], abs=close
        )
        assert abs(model.contents(state.y)[1]) < 1e-12 * model.contents(state.y)[0]


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
@pytest.mark.parametrize("method", EXACT)
def test_between_oscillating_walls_a_uniform_lake_stays_uniform_at_any_lines_and_conserves_mass(
    tmp_path, method, scheme
):
    swings = {"mean": 0.1, "amplitude": 0.25, "period": 1.1, "phase": 0.4}
    patches = {"west": {"travel": swings, "zone": 0.9}, "east": {"travel": straight(-0.3)}}
    start = {"level": "1 + 0.1 * cos(3 * x) * cos(2 * y)", "u": "0.2 * x", "v": "0.1 * y"}
    more = {"start": start, "scalars": {"even": 3.0, "patchy": "1 + x"}}
    case = scene(
        {"b": pool(tub(tmp_path, many=(10, 3)), patches, **more)},
        {},
        0.4,
        {**STEPPED, "scheme": scheme, "method": method, "step": 4e-3},
        scalars={"even": {"initial": 3.0}, "patchy": {"initial": 1.0}},
    )
    model, state = ended(case, 0.4)
    basin = model.meshed[0]
    values = basin.values(state.y)
    assert values["even"] == pytest.approx(3.0, abs=1e-9 if method in EXACT[3:] else 1e-12)
    assert np.ptp(values["patchy"]) > 0.5
    assert abs(model.contents(state.y)[1]) < 1e-11 * model.contents(state.y)[0]


@pytest.mark.parametrize("method", EXACT[:3])
def test_where_no_wave_has_come_yet_lines_that_swing_leave_a_lake_as_it_is(tmp_path, method):
    swings = {"mean": 0.1, "amplitude": 0.25, "period": 1.1, "phase": 0.4}
    patches = {"west": {"travel": swings}, "east": {"travel": straight(-0.3)}}
    case = scene(
        {"b": pool(tub(tmp_path, many=(30, 2)), patches)},
        {},
        1.0,
        {"scheme": "upwind", "method": method, "step": 2e-3},
    )
    model, state = ended(case, 6e-3)  # at most three steps of four stages, each one cell further
    basin = model.meshed[0]
    far = np.abs(basin.mesh.centre[:, 0] - 1.0) < 0.1
    assert np.abs(basin.area_ratios(state.y)[far] - 1.0).min() > 1e-5
    assert basin.deviations(state.y)[:, far] == pytest.approx(np.zeros((3, far.sum())), abs=1e-15)
    assert np.abs(basin.deviations(state.y)[0]).max() > 1e-4


@pytest.mark.in_turn
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_wall_that_is_pushed_in_sends_out_the_exact_shock_and_does_its_work(
    tmp_path, side, scheme
):
    speed, sign = 0.8, 1.0 if side in ("west", "south") else -1.0
    many, size = ((60, 2), (2.0, 0.2)) if side in ("west", "east") else ((2, 60), (0.2, 2.0))
    file = tub(tmp_path, "triangles", many, size, reach=0.0)
    nodes = {"b": pool(file, {side: {"travel": straight(sign * speed, 0.5)}})}
    case = scene(
        nodes,
        {},
        0.3,
        {"scheme": scheme, "method": "ssp-rk2", "courant": 0.8},
        [f"b.{side}.force", f"b.{side}.power", f"b.{side}.travel"],
        every=0.02,
    )
    depth = brentq(lambda h: (h - 1.0) * math.sqrt(0.5 * GRAVITY * (h + 1.0) / h) - speed, 1.0, 3.0)
    force = 0.5 * RHO * GRAVITY * depth**2 * 0.2
    result = run(case)
    close = 3e-3 if scheme == "upwind" else 5e-4  # error of the sudden start of the wall
    assert result[f"b.{side}.force"][-1] == pytest.approx(force, rel=close)
    assert result[f"b.{side}.power"][-1] == pytest.approx(
        result[f"b.{side}.force"][-1] * speed, rel=1e-15
    )
    assert result[f"b.{side}.travel"][-1] == pytest.approx(sign * speed * 0.3, rel=1e-13)


def test_walls_of_a_file_that_cannot_move_are_refused_by_name(tmp_path):
    step = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (1, 2), (2, 2)]
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [4, 5, 7, 6]]
    groups = {"inlet": [3, 0], "shoulder": [6, 4], "end": [2, 5], "top": [7, 6], "upper": [5, 7]}
    lean = [(0, 0), (1, 0), (2, 0.5), (0, 1), (1, 1), (2, 1)]
    files = {
        "stair": str(write(tmp_path / "stair.msh", step, cells, groups)),
        "funnel": str(
            write(tmp_path / "funnel.msh", lean, cells[:2], {"east": [2, 5], "west": [0, 3]})
        ),
    }
    wanted = {
        ("stair", "shoulder"): "does not lie where the basin ends along x, at 0 m",
        (
            "stair",
            "inlet",
        ): r"would move the outline at 1,1.5 m, which is not parallel to x; expected a parallel outline",
        ("stair", "end"): r"would move the outline at",
        ("funnel", "east"): r"would move the outline at 1.5,0.25 m",
        ("funnel", "west"): r"would move the outline at 1.5,0.25 m",
    }
    for (name, patch), text in wanted.items():
        for more in ({"zone": 1.0}, {}):
            nodes = {"b": pool(files[name], {patch: {"travel": straight(0.01), **more}})}
            case = scene(nodes, {}, 1.0, {**STEPPED, "step": 0.01})
            if more and patch in ("inlet", "west"):  # the zone ends before the inclined outline
                load(case)
                continue
            with pytest.raises(CaseError, match=rf"nodes.b.patches.{patch}: {text}"):
                load(case)


def test_a_travel_that_turns_a_cell_over_where_its_zone_ends_is_refused(tmp_path):
    points = [(0, 0), (3, 0), (3, 1), (2, 1), (0, 1), (1, 0.55)]
    cells = [[0, 3, 5], [0, 5, 4], [5, 3, 4], [0, 1, 3], [1, 2, 3]]
    file = str(write(tmp_path / "thin.msh", points, cells, {"east": [1, 2]}))
    cases = [
        scene(
            {"b": pool(file, {"east": {"travel": ramp(0.0, 1.0, 0.0, -1.5), "zone": zone}})},
            {},
            1.0,
            {**STEPPED, "step": 0.01},
        )
        for zone in ("2 m", "3 m")
    ]
    with pytest.raises(
        CaseError, match=r"travel: inverts the cell at 1,0.516667 m, in which the zone ends"
    ):
        load(cases[0])
    load(cases[1])


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_mesh_that_is_turned_by_a_right_angle_has_the_same_waves(tmp_path, scheme):
    travel, found = {"mean": 0, "amplitude": 0.2, "period": 1.3}, []
    for turned in (False, True):
        file = tub(tmp_path, many=(10, 4), turned=turned)
        start = {"u": "0.3 * sin(x)"} if not turned else {"v": "0.3 * sin(y)"}
        nodes = {
            "b": pool(
                file, {"north" if turned else "east": {"travel": travel, "zone": 1.5}}, start=start
            )
        }
        model, state = ended(
            scene(nodes, {}, 0.5, {**STEPPED, "scheme": scheme, "step": 5e-3}), 0.5
        )
        basin = model.meshed[0]
        depth, x, y = basin.deviations(state.y)[0], *basin.mesh.centre.T
        x, y = (y, 1.0 - x) if turned else (x, y)
        found.append(depth[np.lexsort((np.round(y, 9), np.round(x, 9)))])
    assert np.abs(found[0]).max() > 0.01
    assert found[1] == pytest.approx(found[0], abs=1e-12)


# liquids --------------------------------------------------------------------------------------------------------

CO2 = {"name": "CO2", "temperature": 280.0, "pressure": 6e6, "law": "table"}


def fluid(law):
    return CO2 if law == "table" else {**WATER, "law": law}


def column(law, patches, cells=12, side="east", file=None, length=2.0, wide=0.05, **more):
    """Return a basin of liquid in the direction of the wall on a side: a rectangle, or triangles with `file`."""
    along = side in ("west", "east")
    shape = {
        "size": [length, wide] if along else [wide, length],
        "cells": [cells, 1] if along else [1, cells],
    }
    if file is not None:
        shape = {"mesh": {"file": tub(file, "triangles", shape["cells"], shape["size"], reach=0.0)}}
    pressure = 6e6 if law == "table" else 2e5
    if file is None:
        patches = {name: {"side": name, **one} for name, one in patches.items()}
    return {
        "type": "basin",
        "physics": "liquid",
        "pressure": pressure,
        "thickness": 0.1,
        "patches": patches,
        **shape,
        **more,
    }


def law_of(basin, law, ratio):
    """Pressure above that at rest [Pa] where the density is `ratio` times that at rest."""
    if law == "table":
        return float(basin.pressure(np.array([basin.density * (ratio - 1.0)]))[0])
    return basin.density * basin.speed**2 * (ratio - 1.0 if law == "linear" else math.log(ratio))


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "table"])
@pytest.mark.parametrize("method", ["ssp-rk3", "rodas-4"])
def test_a_liquid_that_is_compressed_evenly_follows_its_law_as_a_chamber_of_the_same_length_does(
    tmp_path, law, method
):
    for side, file in (("east", tmp_path), ("south", None)):
        travel = smooth_ramp(0.0, 0.2, 0.0, -0.004 if side == "east" else 0.004)
        nodes = {"b": column(law, {side: {"travel": travel}}, side=side, file=file)}
        step = {"courant": 0.8} if method == "ssp-rk3" else {"rtol": 1e-6}
        case = scene(
            nodes,
            {},
            0.2,
            {"scheme": "muscl", "method": method, **step},
            [f"b.{side}.force"],
            every=0.05,
            fluid=fluid(law),
        )
        model, state = ended(case, 0.2)
        basin, ratio = model.meshed[0], 2.0 / 1.996
        wanted = law_of(basin, law, ratio)
        assert basin.pressure(basin.deviations(state.y)[0]) == pytest.approx(wanted, rel=2e-3)
        now = 1.0 / basin.area_ratios(state.y)[0]
        assert now == pytest.approx(ratio, rel=1e-8)
        mean = np.average(basin.deviations(state.y)[0], weights=basin.mesh.area)
        assert mean == pytest.approx(basin.density * (now - 1.0), rel=1e-9)
        assert abs(model.contents(state.y)[1]) < 1e-12 * model.contents(state.y)[0]
        force = run(case)[f"b.{side}.force"]
        rest = (basin.part.pressure - AMBIENT) * 0.1 * 0.05
        assert force[0] == pytest.approx(rest, rel=1e-12)
        assert force[-1] - rest == pytest.approx(wanted * 0.1 * 0.05, rel=3e-3)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_piston_that_starts_at_once_makes_a_water_hammer(tmp_path, law, side, speed):
    inward = speed if side in ("west", "south") else -speed
    for file in (None, tmp_path):
        nodes = {"b": column(law, {side: {"travel": straight(inward)}}, 60, side=side, file=file)}
        case = scene(
            nodes,
            {},
            1e-3,
            {"scheme": "upwind", "method": "ssp-rk2", "courant": 0.8},
            [f"b.{side}.force", f"b.{side}.power"],
            every=1e-4,
            fluid=fluid(law),
        )
        result, basin = run(case), model_of(case).meshed[0]
        rho, c = basin.density, basin.speed
        wanted = rho * c * speed / (1.0 - speed / c)  # m = c r = speed (rho + r)
        if law == "log":  # a simple wave: c falls by half the speed
            wanted = -2.0 * rho * c * c * math.log1p(-0.5 * speed / c)
        assert wanted == pytest.approx(rho * c * speed, rel=1e-3)  # Joukowsky
        force = result[f"b.{side}.force"]
        assert (force[-1] - force[0]) / (0.1 * 0.05) == pytest.approx(wanted, rel=2e-5)
        assert result[f"b.{side}.power"][-1] == pytest.approx(force[-1] * speed, rel=1e-15)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "table"])
@pytest.mark.parametrize("method", [*EXACT[:3]])
def test_where_no_wave_has_come_yet_lines_that_swing_leave_a_liquid_as_it_is(tmp_path, law, method):
    patches = {
        "west": {"travel": {"mean": 0.0, "amplitude": 0.01, "period": 1e-2}},
        "east": {"travel": straight(-1.0)},
    }
    nodes = {
        "b": pool(tub(tmp_path, many=(30, 2)), patches, "liquid")
        | ({"pressure": 6e6} if law == "table" else {})
    }
    case = scene(
        nodes, {}, 1.0, {"scheme": "upwind", "method": method, "step": 1e-5}, fluid=fluid(law)
    )
    model, state = ended(case, 3e-5)
    basin = model.meshed[0]
    far = np.abs(basin.mesh.centre[:, 0] - 1.0) < 0.1
    found = basin.deviations(state.y)
    assert np.abs(basin.area_ratios(state.y)[far] - 1.0).min() > 1e-6
    assert np.abs(found[0, far]).max() < 1e-12 * basin.density
    assert np.abs(found[1:, far]).max() < 1e-12 * basin.density * basin.speed
    assert np.abs(found[0]).max() > 1e-4 * basin.density * 1e-3


@pytest.mark.parametrize(
    ("law", "method"), [("linear", "ssp-rk3"), ("log", "ssp-rk3"), ("linear", "rodas-4")]
)
def test_a_mass_on_a_spring_at_a_column_of_liquid_oscillates_at_the_root_of_the_cotangent_law(
    law, method
):
    mass, length, section = 2.0, 2.0, 0.1 * 0.05
    for side in ("east", "south") if method == "ssp-rk3" else ("north",):
        errors = []
        for n in (20, 40):
            nodes = {
                "b": column(law, {side: {"body": "lid"}}, n, side=side),
                "lid": {"type": "mass", "mass": mass, "initial_velocity": 1e-4},
                "ground": {"type": "frame"},
            }
            case = scene(
                nodes,
                {},
                1.0,
                {"scheme": "muscl", "limiter": "van-leer", "method": method},
                ["lid.velocity"],
                fluid=fluid(law),
            )
            rho = RHO * math.exp((2e5 - AMBIENT) / 2.2e9) if law == "log" else RHO
            c = math.sqrt(2.2e9 / rho)
            w = 2.0 * c / length
            # K - M w^2 + rho c A w cot(w L / c) = 0
            stiff = mass * w * w - rho * c * section * w / math.tan(2.0)
            x = {"east": "x", "south": f"(x - x + {length} - y)", "north": "y"}[side]
            shape = f"1e-4 * sin({w / c} * {x}) / {math.sin(w / c * length)}"
            nodes["b"]["start"] = {"u": shape} if side == "east" else {"v": shape}
            rest = (2e5 - AMBIENT) * section * (-1.0 if side == "south" else 1.0)
            case["nodes"] = nodes
            case["links"] = {
                "spring": {
                    "type": "spring",
                    "from": "lid",
                    "to": "ground",
                    "stiffness": stiff,
                    "preload": rest,
                }
            }
            case["numerics"] |= {"end": 4.0 * math.pi / w, "step": 0.4 * length / n / c}
            case["output"]["every"] = 0.1 / w
            result = run(case)
            errors.append(np.abs(result["lid.velocity"] - 1e-4 * np.cos(w * result.t)).max() / 1e-4)

        assert errors[1] < 0.35 * errors[0] and errors[1] < 0.02


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["log", "linear"])
@pytest.mark.parametrize("method", ["ssp-rk3", "rodas-4"])
def test_a_box_and_a_chamber_of_equal_length_that_a_mass_compresses_have_equal_pressures(
    law, method
):
    """A heavy mass, slow compared with the waves of the box, sweeps A dx in the box and in the chamber."""
    nodes = {
        "b": column(law, {"west": {"body": "lid"}}, 4),
        "lid": {"type": "mass", "mass": 4e5, "initial_velocity": 0.05},
        "ground": {"type": "frame"},
    }
    links = {
        "cyl": {
            "type": "cylinder",
            "ports": {"rod": "lid", "case": "ground"},
            "stroke": 0.4,
            "area_A": 5e-3,
            "area_B": 5e-3,
            "dead_volume_A": 1.0,
            "dead_volume_B": 5e-3 * 2.0 - 5e-3 * 0.4,
            "initial_pressure_A": 2e5,
            "initial_pressure_B": 2e5,
        }
    }
    step = {"courant": 0.8} if method == "ssp-rk3" else {"rtol": 1e-7}
    case = scene(
        nodes,
        links,
        0.2,
        {"scheme": "muscl", "method": method, **step},
        ["b.west.force", "cyl.B.pressure", "lid.position"],
        every=0.02,
        fluid=fluid(law),
    )
    result = run(case)
    box = result["b.west.force"] / 5e-3 + AMBIENT
    assert result["cyl.B.pressure"].max() > 2e6
    # differences by inertia of the liquid, rho a L / 3, and by waves of the start, rho c v
    assert np.abs(box - result["cyl.B.pressure"])[1:].max() < 1.2 * RHO * 1483.0 * 0.05
    assert np.mean(box - result["cyl.B.pressure"]) == pytest.approx(0.0, abs=0.02 * box.max())


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "table", "water"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_momentum_changes_by_the_forces_of_both_walls_alone(tmp_path, law, scheme):
    patches = {"west": {"travel": straight(0.7)}, "east": {"travel": straight(-1.1), "zone": 1.5}}
    water = law == "water"
    start = {"u": "0.5 * sin(3 * x) * cos(2 * y)", "v": "0.4 * cos(4 * x * y)"}
    start |= {"level": "1 + 0.2 * cos(5 * x)"} if water else {"pressure": "1e6 * cos(5 * x)"}
    more = {"start": start} | ({"pressure": 6e6} if law == "table" else {})
    nodes = {"b": pool(tub(tmp_path), patches, "free-surface" if water else "liquid", **more)}
    case = scene(
        nodes,
        {},
        0.9,
        {"scheme": scheme, "step": 1e-3, "method": "euler"},
        fluid=fluid("linear" if water else law),
    )
    model = model_of(case)
    basin, y = model.meshed[0], model.start
    dydt, out = model.evaluate(0.0, y)
    west, east = out[int(model.layout["wall"]) :][:2]
    rate = np.sum(basin.mesh.area * basin.states_of(dydt)[1]) * (
        RHO if water else basin.part.thickness
    )
    swept = 0.0
    if law == "linear":  # momentum does not move with the grid: w m stays behind, m = w (rho + r)
        for wall, force, speed in (("west", west, 0.7), ("east", east, -1.1)):
            length = basin.mesh.length[basin.mesh.patch(wall)].sum() * basin.part.thickness
            dense = force / length / basin.speed**2
            swept += (1.0 if wall == "east" else -1.0) * speed**2 * (basin.density + dense) * length
    assert rate == pytest.approx(west - east + swept, rel=1e-11, abs=1e-11 * abs(east))
    mass = np.sum(basin.mesh.area * basin.states_of(dydt)[0])
    assert abs(mass) < 1e-12 * np.abs(basin.mesh.area * basin.states_of(dydt)[0]).sum()


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("method", ["ssp-rk3", "implicit-midpoint", "rodas-4"])
def test_a_rotated_or_mirrored_liquid_has_the_same_results(law, method):
    found = []
    for side, sign in (("west", 1.0), ("east", -1.0), ("south", 1.0), ("north", -1.0)):
        travel = {"mean": 0.0, "amplitude": sign * 1e-3, "period": 5e-3}
        nodes = {"b": column(law, {side: {"travel": travel, "zone": 0.7}}, 24, side=side)}
        # a Jacobian by differences is one-sided at kinks of limiters
        scheme = "upwind" if method == "rodas-4" else "muscl"
        case = scene(
            nodes,
            {},
            3e-3,
            {"scheme": scheme, "method": method, "step": 2.5e-5},
            [f"b.{side}.force", f"b.{side}.power"],
            every=3e-4,
            fluid=fluid(law),
        )
        result = run(case)
        found.append(np.column_stack([result[f"b.{side}.force"], result[f"b.{side}.power"]]))
    for other in found[1:]:
        # accuracy of iterations and difference quotients
        close = 1e-9 if method == "ssp-rk3" else 1e-8
        assert other == pytest.approx(found[0], rel=close, abs=close * np.abs(found[0]).max())


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log", "table"])
@pytest.mark.parametrize("ways", [("west", "east"), ("south", "north")])
def test_a_grid_and_a_mesh_of_the_same_rectangles_find_the_same_rates(tmp_path, law, ways):
    one, other = ways
    walls, found = (
        {one: {"travel": straight(5.0)}, other: {"travel": straight(-3.0), "zone": 0.6}},
        [],
    )
    for file in (None, tmp_path):
        shape = {"size": [2.0, 1.0], "cells": [9, 7]}
        if file is not None:
            shape = {"mesh": {"file": tub(file, "quads", (9, 7), reach=0.0)}}
        patches = {
            side: {"side": side, **one} if file is None else one for side, one in walls.items()
        }
        nodes = {
            "b": {
                "type": "basin",
                "physics": "liquid",
                "thickness": 0.1,
                "patches": patches,
                "pressure": 6e6 if law == "table" else 2e5,
                **shape,
            }
        }
        model = model_of(
            scene(
                nodes,
                {},
                0.09,
                {"scheme": "upwind", "method": "euler", "step": 1e-6},
                fluid=fluid(law),
            )
        )
        basin, y = model.meshed[0], model.start.copy()
        y[[int(row["y"]) for row in with_slot(model.features, SLOT).walls]] = 0.1, -0.05
        x, z = basin.mesh.centre.T
        deviation = np.array(
            [0.4 * np.cos(5 * x) * np.cos(4 * z), 2e3 * np.sin(3 * x + z), 1e3 * np.cos(4 * x * z)]
        )
        if law == "linear":  # tangential flow at faces: a mean on grids, upwind on meshes
            deviation[2 if one == "west" else 1] = 0.0
        basin.states_of(y)[:] = basin.area_ratios(y) * deviation
        basin.states_of(y)[0] += basin.density * (basin.area_ratios(y) - 1.0)
        dydt, out = model.evaluate(0.0, y)
        order = np.lexsort(np.round(basin.mesh.centre.T, 9))
        walls_feel = out[int(model.layout["wall"]) :][:2]
        found.append([*(row[order] for row in basin.states_of(dydt)), walls_feel])
        assert (
            abs(np.sum(basin.mesh.area * basin.states_of(dydt)[0]))
            < 1e-12 * np.abs(basin.states_of(dydt)[0]).sum()
        )
    for grid, mesh in zip(*found, strict=True):
        assert grid == pytest.approx(mesh, rel=1e-10, abs=1e-11 * np.abs(mesh).max())


# energy ---------------------------------------------------------------------------------------------------------


@pytest.mark.in_turn
@pytest.mark.parametrize("physics", ["free-surface", "liquid"])
@pytest.mark.parametrize("body", [False, True])
def test_the_ledger_of_energy_has_the_work_of_the_wall_and_its_step_part_falls_with_the_step(
    tmp_path, physics, body
):
    parts, water = [], physics == "free-surface"
    slow, more = (
        (1.0, {})
        if water
        else (1e-3, {"elevation": 7.0, "start": {"pressure": "1e6 * sin(3 * x)"}})
    )
    file = tub(tmp_path, "triangles", (20, 2), (2.0, 0.2))
    rest = 0.1 * RHO * GRAVITY if water else (2e5 - AMBIENT) * 0.02
    for step in (4e-3 * slow, 2e-3 * slow):
        wall = {"travel": {"mean": 0.0, "amplitude": 0.1 * slow, "period": 2.0 * slow}, "zone": 1.0}
        nodes, links = (
            {"b": pool(file, {"east": {"body": "lid"} if body else wall}, physics, **more)},
            {},
        )
        if body:
            nodes["lid"] = {"type": "mass", "mass": 50.0 if water else 5.0, "initial_velocity": 0.3}
            nodes["ground"] = {"type": "frame"}
            links = {
                "spring": {
                    "type": "spring",
                    "from": "lid",
                    "to": "ground",
                    "stiffness": 9e3,
                    "preload": rest,
                }
            }
        numerics = {"scheme": "upwind", "method": "ssp-rk3", "step": step}
        found = energy(scene(nodes, links, 0.8 * slow, numerics))
        parts.append(abs(found.step[-1]) / np.ptp(found.stored["b"]))
        assert (np.diff(sum(found.scheme.values())) > 0.0).all()
    assert parts[1] < parts[0] / 6.0
    assert parts[1] < 1e-4


@pytest.mark.parametrize("side", ["east", "south"])
def test_error_of_law_linear_at_a_wall_is_named_and_a_height_does_not_lift(side):
    """Uniform compression: p = c^2 r does work, and w (c^2 r^2 - m^2) / (2 rho) is lost, with m = w (rho + r)."""
    travel, lost = smooth_ramp(0.0, 1.0, 0.0, -0.2 if side == "east" else 0.2, 401), []
    times = np.linspace(0.0, 1.0, 2001)
    x = 2.0 - 0.2 * np.array([smooth_step(t, 0.0, 1.0) for t in times])
    dense, speed, section, square = (
        RHO * (2.0 / x - 1.0),
        np.gradient(x, times),
        0.1 * 0.05,
        50.0**2,
    )
    work = -trapezoid(speed * (2e5 - AMBIENT + square * dense), times) * section
    beside = (
        trapezoid(speed * (square * dense**2 - (speed * (RHO + dense)) ** 2), times)
        * 0.5
        * section
        / RHO
    )
    for height in (0.0, 50.0):
        pond = column(
            "linear", {side: {"travel": travel}}, side=side, wave_speed=50.0, elevation=height
        )
        numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5}
        found = energy(scene({"b": pond}, {}, 1.0, numerics, every=0.1))
        assert found.supplied[f"b.{side}"][-1] == pytest.approx(work, rel=1e-3)  # except for waves
        assert found.law[f"b.{side}"][-1] == pytest.approx(beside, rel=6e-3)
        assert sum(found.scheme.values())[-1] < 0.02 * abs(found.law[f"b.{side}"][-1])
        lost.append([found.stored["b"][-1], found.law[f"b.{side}"][-1]])
    assert lost[1] == pytest.approx(lost[0], rel=1e-9)
