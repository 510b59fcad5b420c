"""Face flows of expressions, stream functions and files, against integrals of velocities over faces."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import model_of
from reference.meshes import shaken, triangles, write, write_msh
from reference.scenes import scene

import fvsolve
from fvsolve.core.mesh import read, rectangle
from fvsolve.errors import CaseError, MeshError
from fvsolve.features.basins.transport.lower import EXPRESSIONS, face_flows, grid_flows

PI = np.pi
BUMP = "exp(-50*((x - 0.4)**2 + (y - 0.5)**2))"
MUSCL = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk3", "courant": 0.5}
# Name: (parameters, velocities u, v (x, y) as in its source).
VELOCITIES = {
    "constant": ({"u": 2.0, "v": -3.0}, lambda x, y: (2.0 + 0 * x, -3.0 + 0 * x)),
    "rotation": (
        {"centre": (0.3, 0.6), "angular_velocity": 2.0},
        lambda x, y: (-2.0 * (y - 0.6), 2.0 * (x - 0.3)),
    ),
    "swirl": (
        {},
        lambda x, y: (
            np.sin(PI * x) ** 2 * np.sin(2 * PI * y),
            -(np.sin(PI * y) ** 2) * np.sin(2 * PI * x),
        ),
    ),
    "shear": ({"rate": 3.0, "y0": 0.5, "u": 1.0}, lambda x, y: (1.0 + 3.0 * (y - 0.5), 0 * x)),
    "parabolic": (
        {"speed": 2.0, "south": 0.5, "north": 2.5},
        lambda x, y: (2.0 * 1.5 * (1.0 - (y - 1.5) ** 2), 0 * x),
    ),
    "cellular": (
        {"speed": 2.0, "width": 0.5, "height": 1.0},
        lambda x, y: (
            2.0 * np.sin(2 * PI * x) * np.cos(PI * y),
            -4.0 * np.cos(2 * PI * x) * np.sin(PI * y),
        ),
    ),
}


@pytest.fixture
def mixed(tmp_path):
    """Mesh of triangles and quads, without parallelograms, from (-1, 0.5) to (2, 2.5)."""
    return read(write(tmp_path / "shaken.msh", *shaken()))


def integral(mesh, velocity):
    """Flow of u, v (x, y) through every face, by Gauss's rule with six points."""
    a, b = mesh.points[mesh.ends[:, 0]], mesh.points[mesh.ends[:, 1]]
    total = 0.0
    for at, weight in zip(*np.polynomial.legendre.leggauss(6), strict=True):
        place = 0.5 * (1.0 - at) * a + 0.5 * (1.0 + at) * b
        total = total + 0.5 * weight * np.sum(
            np.stack(velocity(*place.T), axis=1) * mesh.normal, axis=1
        )
    return total * mesh.length


def divergence(mesh, flows):
    """Net outflow of every cell."""
    out = np.zeros(len(mesh.cells))
    np.add.at(out, mesh.left, flows)
    inner = mesh.right >= 0
    np.subtract.at(out, mesh.right[inner], flows[inner])
    return out


def test_every_name_is_tried():
    assert VELOCITIES.keys() == EXPRESSIONS.keys()


@pytest.mark.parametrize("name", VELOCITIES)
def test_flows_by_name_are_the_integrals_of_their_velocity_and_leave_no_divergence_to_the_bit(
    name, mixed
):
    parameters, velocity = VELOCITIES[name]
    flows = face_flows(mixed, {"expression": name, **parameters})
    assert flows == approx(integral(mixed, velocity), rel=1e-6, abs=1e-6)
    assert np.all(divergence(mixed, flows) == 0.0)


def test_names_describe_themselves_in_a_single_line():
    for function in EXPRESSIONS.values():
        assert function.__doc__ and "\n" not in function.__doc__


def test_random_stream_functions_leave_no_divergence_to_the_bit(mixed):
    for seed in range(20):
        stream = np.random.default_rng(seed).normal(size=len(mixed.points)) * 10.0**seed
        assert np.all(divergence(mixed, face_flows(mixed, {"stream": stream})) == 0.0)


@pytest.mark.parametrize("cells", [(4, 3), (1, 3), (4, 1), (1, 1)])
def test_flows_of_a_grid_go_east_and_north(cells):
    mesh = rectangle((2.0, 1.0), cells, grading=(1.0, 1.0), patches={"in": "west", "top": "north"})
    nx, ny = cells
    x, y = grid_flows(
        mesh,
        face_flows(mesh, {"expression": "rotation", "centre": (0.0, 0.0), "angular_velocity": 2.0}),
    )
    dx, dy = 2.0 / nx, 1.0 / ny
    middle = -2.0 * (np.arange(ny) + 0.5) * dy
    assert x.reshape(ny, nx + 1) == approx(np.tile(middle[:, None] * dy, nx + 1))
    assert y.reshape(ny + 1, nx) == approx(
        np.tile(2.0 * (np.arange(nx) + 0.5) * dx * dx, (ny + 1, 1))
    )


def test_flows_of_a_grid_want_a_full_rectangle(mixed):
    holed = rectangle((1.0, 1.0), (4, 4), holes=[(0.5, 0.5, 1.0, 1.0)])
    for mesh in (mixed, holed):
        with pytest.raises(ValueError, match="not a full rectangle"):
            grid_flows(mesh, np.zeros(mesh.left.size))


def written(path, header, *columns):
    """Write a CSV file of columns and return it as { file }."""
    rows = "\n".join(
        ",".join(map(repr, map(float, row))) for row in zip(*map(np.ravel, columns), strict=True)
    )
    path.write_text(f"{header}\n{rows}\n", encoding="utf-8")
    return {"file": str(path)}


def test_velocities_from_a_file_are_interpolated_linearly(tmp_path, mixed):
    x, y = np.meshgrid(np.linspace(-1.0, 2.0, 5), np.linspace(0.5, 2.5, 4))
    flows = face_flows(
        mixed, written(tmp_path / "v.csv", "x, y, u, v", x, y, 1.0 + 2.0 * x - y, x + 3.0 * y)
    )
    assert flows == approx(
        integral(mixed, lambda x, y: (1.0 + 2.0 * x - y, x + 3.0 * y)), abs=1e-12
    )


def test_a_stream_function_from_a_file_leaves_no_divergence(tmp_path, mixed):
    x, y = np.meshgrid(np.linspace(-1.0, 2.0, 31), np.linspace(0.5, 2.5, 21))
    flows = face_flows(mixed, written(tmp_path / "psi.csv", "psi,x,y", np.sin(x) * np.cos(y), x, y))
    assert np.all(divergence(mixed, flows) == 0.0)
    assert flows == approx(
        integral(mixed, lambda x, y: (-np.sin(x) * np.sin(y), -np.cos(x) * np.cos(y))), abs=0.01
    )


@pytest.mark.parametrize(
    "velocity, words",
    [
        (
            {"expression": "rotaton"},
            'unknown velocity "rotaton"; expected .*; did you mean "rotation"',
        ),
        (
            {"expression": "rotation", "centre": (0, 0)},
            "needs values of more parameters: angular_velocity",
        ),
        (
            {"expression": "shear", "rate": 1.0, "slope": 2.0},
            "has no parameter slope; expected rate, u, y0",
        ),
        ({"expression": "swirl", "size": 0.0}, "not finite at"),
        ({"stream": np.zeros(3)}, r"expected a value for each of 20 corners"),
        ({}, "velocity has nothing; expected one of expression, file, stream"),
        ({"file": "a.csv", "stream": np.zeros(20)}, "velocity has file, stream; expected one"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_velocities_that_are_impossible_are_refused_with_the_expected_form(velocity, words):
    with pytest.raises(ValueError, match=words):
        face_flows(rectangle((1.0, 1.0), (4, 3)), velocity)


@pytest.mark.parametrize(
    "text, words",
    [
        (None, "No such file"),
        ("", "has no rows; expected a header"),
        ("x,y,u\n0,0,1\n", 'line 1: its header is "x, y, u"; expected x, y, u, v or x, y, psi'),
        ("x,y,psi\n0,0,1\n1,0,b\n", 'line 3: "b" is not a number in column "psi"'),
        ("x,y,psi\n0,0,1\n1,0,2\n", "too few points (2); expected at least three"),
        ("x,y,psi\n0,0,1\n1,0,2\n2,0,3\n", "lie on one line"),
        (
            "x,y,psi\n0,0,1\n1,0,2\n0,1,3\n",
            "do not enclose 9 of 20 positions of the mesh, the first",
        ),
    ],
)
def test_files_that_do_not_do_are_refused_with_the_line(tmp_path, text, words):
    path = tmp_path / "velocity.csv"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(MeshError) as refused:
        face_flows(rectangle((1.0, 1.0), (4, 3)), {"file": path})
    assert words in str(refused.value) and "velocity.csv" in str(refused.value)


@pytest.mark.parametrize("path", ["grid", "faces"])
def test_steps_follow_a_velocity_that_stands_for_a_moment(path, tmp_path):
    """A bump in a vortex that reverses returns with an error that falls with every refinement."""
    errors = []
    for cells in (24, 28, 32, 36, 40):
        shape = {"size": [1.0, 1.0], "cells": [cells, cells]}
        if path == "faces":
            write_msh(tmp_path / "sheet.msh", *triangles((1.0, 1.0), 1.5 / cells), {})
            shape = {"mesh": {"file": str(tmp_path / "sheet.msh")}}
        velocity = {"expression": "swirl", "period": 1.0}
        sheet = {
            "type": "basin",
            "physics": "transport",
            "velocity": velocity,
            "scalars": {"dye": BUMP},
            **shape,
        }
        case = scene({"sheet": sheet}, {}, 1.0, MUSCL, [], 0.5, scalars={"dye": {}})
        model = model_of(case)
        start = fvsolve.initial_state(model)
        errors.append(np.abs(fvsolve.advance(model, start, 1.0).y - start.y).sum() / start.y.sum())
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.03


def carrying(velocity, mesh=None, **more) -> dict:
    """Return a case of a scalar in a given velocity, in a closed basin."""
    pool = {
        "type": "basin",
        "physics": "transport",
        "velocity": velocity,
        "scalars": {"dye": "where(x < 1, 1, 0)"},
    }
    pool |= {"mesh": {"file": str(mesh)}} if mesh else more
    return scene({"pool": pool}, {}, 0.1, MUSCL, [], 0.1) | {"scalars": {"dye": {}}}


@pytest.mark.parametrize("key", ["u", "level"])
def test_an_advected_scalar_starts_without_a_flow_of_its_own(key):
    case = carrying(
        {"stream": "sin(pi*x)*sin(pi*y)"}, size=[1.0, 1.0], cells=[4, 4], start={key: 1.0}
    )
    with pytest.raises(CaseError, match=f'start.{key}: does not apply to physics "transport"'):
        fvsolve.load(case)


@pytest.mark.parametrize("length", [1.0, 6.0, 8.0, 10.0, 1000.0])
@pytest.mark.parametrize("velocity", [
    {"stream": "0.1*sin(pi*x)*sin(pi*y)"},
    {"stream": "7 + 0.1*sin(pi*x)*sin(pi*y)"},
    {"u": "0.1*pi*sin(pi*x)*cos(pi*y)", "v": "-0.1*pi*cos(pi*x)*sin(pi*y)"},
])  # fmt: skip
def test_a_field_that_is_closed_but_for_rounding_passes_no_outline(velocity, length):
    case = carrying(velocity, size=[length, length], cells=[32, 32])
    pool = model_of(case).meshed[0]
    assert pool.passing == []


@pytest.mark.parametrize("velocity", [
    {"u": "2*cos(0.3)", "v": "2*sin(0.3)"},
    {"u": "1.91067297825", "v": "0.591040413323"},
    {"stream": "2*(y*cos(0.3) - x*sin(0.3))"},
    {"expression": "constant", "u": 2.0 * math.cos(0.3), "v": 2.0 * math.sin(0.3)},
])  # fmt: skip
def test_a_slanted_channel_passes_its_ends_alone(velocity, tmp_path):
    points, cells = triangles((4.0, 1.0), 0.25)
    turn, away = (
        np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]]),
        np.array([100.0, 50.0]),
    )
    ends = {"in": lambda x, y: along(x, y) < 1e-6, "out": lambda x, y: along(x, y) > 4.0 - 1e-6}

    def along(x, y):
        return (x - away[0]) * np.cos(0.3) + (y - away[1]) * np.sin(0.3)

    write_msh(tmp_path / "channel.msh", points @ turn + away, cells, ends)
    case = carrying(velocity, tmp_path / "channel.msh")
    pool = model_of(case).meshed[0]
    assert sorted(pool.passing) == ["in", "out"]
    if "stream" in velocity or "expression" in velocity:
        flows = pool.flows(None)
        assert np.all(divergence(pool.mesh, flows) == 0.0)


def test_a_stream_that_passes_the_outline_by_little_is_still_refused():
    case = carrying({"stream": "0.1*sin(pi*x)*sin(pi*y) + 1e-9*x*y"}, size=[1.0, 1.0], cells=[8, 8])
    with pytest.raises(CaseError, match="crosses the outline at"):
        model_of(case)


@pytest.mark.parametrize(
    ("stream", "leak"), [("x*y*(2 - x)", "y = 1 m"), ("y", "x = [02] m"), ("0.1*x", "y = [01] m")]
)
def test_a_wall_that_leaks_is_named_and_not_the_hole_behind_it(stream, leak):
    case = carrying(
        {"stream": stream}, size=[2.0, 1.0], cells=[20, 10], holes=[[0.8, 0.4, 1.2, 0.6]]
    )
    with pytest.raises(CaseError, match=f"nodes.pool.velocity: .*outline at .*{leak}"):
        model_of(case)


def test_a_hole_that_leaks_alone_is_named():
    case = carrying(
        {"stream": "where((x - 1)**2 + (y - 0.5)**2 < 0.09, x, 0)"},
        size=[2.0, 1.0],
        cells=[20, 10],
        holes=[[0.8, 0.4, 1.2, 0.6]],
    )
    with pytest.raises(CaseError, match=r"outline at x = (0\.[89]|1)[\d.]* m, y = 0\.[456]"):
        model_of(case)
