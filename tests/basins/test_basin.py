"""Shallow water in basins: dam breaks, a lake at rest, sloshing, symmetry, starts, and coupling to a network."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import (
    PLANE,
    alone,
    assert_equal_files,
    basin,
    ended,
    model_of,
    run_in_two_parts,
)
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    WATER,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    tank,
    valve,
)
from scipy.optimize import brentq

import fvsolve
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.accuracy.model_hierarchy import ladder
from fvsolve.studies.failure_map import failure_map


def depths(case: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return (depth, velocity) of the basin at the end of a case, by rows and columns."""
    model, state = ended(case, case["numerics"]["end"])
    nx, ny = case["nodes"]["pool"]["cells"]
    found = model.fields(state.y, model.new_out())["pool"]
    return found["depth"].reshape(ny, nx), found["velocity"].reshape(ny, nx, 3)


def dam(x, t, high, low):
    """Depth of Stoker's dam break (1957), or of Ritter's (1892) for low = 0, at the distance x from the dam."""
    c = math.sqrt(GRAVITY * high)
    if low == 0.0:
        return np.where(
            x < -c * t, high, np.where(x < 2 * c * t, (2 * c - x / t) ** 2 / (9 * GRAVITY), 0.0)
        )
    a, b = low, high
    # bisection on the middle depth: rarefaction on the left, shock on the right
    for _ in range(200):
        h = 0.5 * (a + b)
        u = 2 * (c - math.sqrt(GRAVITY * h))
        if u > (h - low) * math.sqrt(0.5 * GRAVITY * (h + low) / (h * low)):
            a = h
        else:
            b = h
    s = h * u / (h - low)
    fan = (2 * c - x / t) ** 2 / (9 * GRAVITY)
    rest = np.where(x < s * t, h, low)
    return np.where(x < -c * t, high, np.where(x < (u - math.sqrt(GRAVITY * h)) * t, fan, rest))


@pytest.mark.parametrize("low", [0.4, 0.0], ids=["wet", "dry"])
def test_a_dam_breaks_as_in_the_exact_solution(low):
    """The L1 error of the depth falls at first order, the limit at a front, and mass is constant."""
    errors = []
    for nx in (100, 200, 400):
        h, _ = depths(
            alone(
                basin((20.0, 1.0), (nx, 3), 1.0, start={"level": f"where(x < 10, 1, {low})"}), 1.2
            )
        )
        x = (np.arange(nx) + 0.5) * 20.0 / nx - 10.0
        errors.append(np.abs(h[1] - dam(x, 1.2, 1.0, low)).mean() * 20.0)
        assert h.min() >= 0.0 and np.array_equal(h[0], h[2])
        assert h.mean() == approx(0.5 * (1.0 + low), rel=1e-13)
    assert errors[-1] < 0.02 and errors[0] / errors[2] > 4.0**0.95


def test_a_lake_at_rest_does_not_change_any_bit_on_a_bank_and_behind_a_shut_valve():
    case = alone(basin((20.0, 10.0), (40, 20), 1.0, bed="0.13*x + 0.07*y"), 20.0)
    model = model_of(case)
    # dry bank
    assert (
        model.fields(np.zeros(model.y_size), model.new_out())["pool"]["depth"] == 0.0
    ).sum() > 100
    state = fvsolve.advance(model, fvsolve.initial_state(model), 20.0)
    assert not state.y.any()


@pytest.mark.parametrize("mode", [1, 2])
def test_small_waves_slosh_at_the_periods_of_long_waves(mode):
    """Standing wave a cos(k x) in a closed box, with period 2 L / (n sqrt(g h)) and an amplitude of 0.01 mm.

    The loss of amplitude after 2 periods falls at third order, the error at the zero after 1.25 periods at second.
    """
    size, lost, late = 10.0, [], []
    for nx in (40 * mode, 80 * mode):
        model = model_of(alone(basin((size, 2.0), (nx, 2), 1.0), 10.0))
        x = (np.arange(nx) + 0.5) * size / nx
        state = fvsolve.initial_state(model)
        shape = 1e-5 * np.cos(mode * math.pi * x / size)
        state.y[: 2 * nx] = np.tile(shape, 2)
        period = 2.0 * size / (mode * math.sqrt(GRAVITY))
        after = [
            fvsolve.advance(model, state, n * period).y[:nx] @ shape / (shape @ shape)
            for n in (2.0, 1.25)
        ]
        lost.append(abs(after[0] - 1.0))
        late.append(abs(after[1]))
    assert lost[1] < 3e-4 and lost[0] / lost[1] > 2.0**2.8
    assert late[1] < 2e-3 and late[0] / late[1] > 2.0**1.8


def test_a_dam_over_a_step_of_the_bed_has_the_error_that_the_page_states():
    """The error at a step of the bed, up to 1.7 %, does not fall with the size of cells.

    Exact solution: a fan to h, u on the left, constant flow and energy over the step, and a shock on the right.
    """
    left, right, rise = 1.0, 0.4, 0.2

    def level_excess(h):
        u = 2.0 * (math.sqrt(GRAVITY * left) - math.sqrt(GRAVITY * h))
        flow, head = h * u, h + u * u / (2.0 * GRAVITY) - rise
        over = brentq(
            lambda d: d + flow**2 / (2.0 * GRAVITY * d * d) - head,
            (flow**2 / GRAVITY) ** (1 / 3),
            left,
        )
        return h, u, over, flow / over

    def amiss(h):
        _, _, d, u = level_excess(h)
        return u - (d - right) * math.sqrt(0.5 * GRAVITY * (1.0 / d + 1.0 / right))

    exact, off = np.array(level_excess(brentq(amiss, 0.75, 0.999))), []
    for cells in (200, 400):
        bed, start = (
            f"where(x < 20, 0, {rise})",
            {"level": f"where(x < 20, {left}, {right + rise})"},
        )
        depth, velocity = depths(
            alone(basin((40.0, 0.4), (cells, 2), 1.0, bed=bed, start=start), 3.0)
        )
        x = (np.arange(cells) + 0.5) * 40.0 / cells
        west, east = (x > 18.8) & (x < 19.4), (x > 20.6) & (x < 21.5)
        found = [f[0, side].mean() for side in (west, east) for f in (depth, velocity[..., 0])]
        off.append(np.array(found) / exact - 1.0)
    assert np.abs(off).max() < 0.017 and np.abs(off[1]).min() > 0.002
    assert off[1] == approx(off[0], rel=0.15)


def test_a_mirrored_and_a_turned_basin_have_the_same_bits():
    lying = alone(basin((12.0, 6.0), (24, 12), 1.0, bed="0.1*x"), 1.0)
    model = model_of(lying)
    case = alone(basin((6.0, 12.0), (12, 24), 1.0, bed="0.1*y"), 1.0)
    case["nodes"]["pool"]["patches"]["east"]["side"] = "north"
    standing = model_of(case)
    rng = np.random.default_rng(3)
    h, u, v = 0.1 * rng.random((3, 12, 24))
    y = np.concatenate([h.ravel(), u.ravel(), v.ravel()])
    rates = model.rhs(0.0, y).reshape(3, 12, 24)
    up = np.concatenate([h[::-1].ravel(), u[::-1].ravel(), -v[::-1].ravel()])
    mirrored = model.rhs(0.0, up).reshape(3, 12, 24)
    assert np.array_equal(mirrored[:2, ::-1], rates[:2]) and np.array_equal(
        mirrored[2, ::-1], -rates[2]
    )
    turned = standing.rhs(0.0, np.concatenate([h.T.ravel(), v.T.ravel(), u.T.ravel()])).reshape(
        3, 24, 12
    )
    scale = np.abs(rates).max()
    assert np.abs(turned[0].T - rates[0]).max() < 1e-13 * scale  # sums in another order
    assert np.abs(turned[1].T - rates[2]).max() < 1e-13 * scale


def drained(place: str, nodes: dict, end: float) -> dict:
    links = {"tap": valve(place, "out", 0.012, ramp(0.0, 20.0, 0.0, 1.0))}
    return scene(nodes | {"out": reservoir(AMBIENT)}, links, end, {}, ["tap.flow"], 1.0)


def test_a_deep_and_quiet_basin_drains_as_its_tank_and_as_torricelli():
    pool = basin(
        (10.0, 4.0), (20, 8), 2.0, patches={"outlet": {"side": "east", "span": [1.0, 3.0]}}
    )
    case = drained("pool.outlet", {"pool": pool}, 200.0)
    case["numerics"] |= PLANE
    found = fvsolve.run(case)
    twin = fvsolve.run(drained("pool", {"pool": tank(40.0, 2.0)}, 200.0))
    # of 0.075: waves of the start
    assert found.ok and found["tap.flow"] == approx(twin["tap.flow"], abs=5e-5)
    assert abs(found.ledger["mass"]["relative"]) < 1e-13
    # the ramp counts for half of its 20 s
    level = (math.sqrt(2.0) - 0.012 * math.sqrt(2 * GRAVITY) / 80.0 * 190.0) ** 2
    assert twin["tap.flow"][-1] == approx(0.012 * math.sqrt(2 * GRAVITY * level), rel=1e-9)
    assert found["tap.flow"][-1] == approx(twin["tap.flow"][-1], rel=5e-4)


def test_a_patch_that_falls_dry_stops_the_outflow_and_no_depth_falls_below_zero():
    pool = basin((4.0, 2.0), (8, 4), 0.2, patches={"outlet": {"side": "east"}}, elevation=5.0)
    nodes = {"pool": pool, "out": reservoir(AMBIENT) | {"elevation": 0.0}}
    case = scene(nodes, {"tap": valve("pool.outlet", "out", 0.02)}, 60.0, PLANE, ["tap.flow"], 1.0)
    model, state = ended(case, 60.0)
    depth = model.fields(state.y, model.new_out())["pool"]["depth"]
    assert depth.min() >= 0.0 and depth.max() < 5e-3
    result = fvsolve.run(case)
    mass = result.ledger["mass"]
    assert mass["relative"] < 1e-13 and mass["final"] == approx(depth.mean() * 8000.0, rel=1e-9)
    assert mass["outflow"] == approx(1600.0 - mass["final"], rel=1e-12) and mass["made_up"] == 0.0
    assert result.ok and not result.summary["marks"]


def test_a_pipe_that_discharges_into_two_joined_basins_conserves_mass(tmp_path):
    west = basin(
        (6.0, 3.0),
        (12, 6),
        1.0,
        patches={"in": {"side": "west"}, "gate": {"side": "east"}},
        elevation=0.0,
    )
    east = basin((3.0, 3.0), (6, 6), 1.0, patches={"gate": {"side": "west"}}, elevation=0.0)
    nodes = {
        "west": west,
        "east": east,
        "lake": lake(3.0, elevation=0.0),
        "end": junction(elevation=0.0),
    }
    links = {
        "main": pipe(
            "lake", "end", 200.0, 0.3, 1000.0, 20, friction={"model": "steady", "factor": 0.02}
        ),
        "tap": valve("end", "west.in", 0.02, ramp(1.0, 2.0, 0.0, 1.0)),
        "hole": valve("west.gate", "east.gate", 0.05),
    }
    numerics = PLANE | {"scheme": "muscl"}
    case = scene(
        nodes,
        links,
        20.0,
        numerics,
        ["west.gate.head", "east.gate.head", "hole.flow"],
        0.5,
        fluid=WATER,
    )
    case["output"]["fields"] = 3
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    assert result.ok and abs(result.ledger["mass"]["relative"]) < 1e-13
    assert result["hole.flow"][-1] > 0.0 and result["east.gate.head"][-1] > 1.01
    import meshio
    import pyvista

    for name, cells in (("west", 72), ("east", 36)):
        file = tmp_path / "run" / "fields" / f"{name}-000003.vtu"
        assert meshio.read(file).cell_data["depth"][0].shape == (cells,)
        assert pyvista.read(file)["surface"].min() > 0.9


def test_flow_from_the_network_is_the_gain_of_the_basin():
    """Inflow through a patch raises the content by its amount."""
    pool = basin((5.0, 5.0), (10, 10), 0.5, patches={"in": {"side": "south", "span": [2.0, 3.0]}})
    nodes = {"pool": pool, "pump": {"type": "inflow", "flow": 0.05}}
    case = scene(nodes, {"way": valve("pump", "pool.in", 0.1)}, 10.0, PLANE, ["pool.in.head"], 1.0)
    h, _ = depths(case)
    assert h.mean() * 25.0 == approx(0.5 * 25.0 + 0.5, rel=1e-13)


def patches(east: dict, **more) -> dict:
    return {"patches": {"east": {"side": "east"} | east, **more}}


FAULTS = {
    "cut": (
        patches({"span": [0.3, 1.4]}),
        "not consist of whole faces .*; nearest is 0.5 to 1.5 m",
    ),
    "span": (patches({"span": [1.0, 9.0]}), "not consist of whole faces of the east side"),
    "side": (
        patches({"side": "wst"}),
        r'patches.east.side: no side named "wst"; did you mean "west"',
    ),
    "shared": (patches({}, b={"side": "east", "span": [0.0, 1.0]}), 'overlaps "east"'),
    "cells": ({"cells": [4.5, 3]}, "not a pair of numbers of cells"),
    "physics": (
        {"pressure": "1 bar"},
        'is not a key of physics "free-surface"; it belongs to liquid',
    ),
    "needs": ({"physics": "liquid"}, "thickness is missing"),
    "start": (
        {"start": {"pressure": "1 bar"}},
        'start.pressure: does not apply to physics "free-surface"',
    ),
    "formula": ({"bed": "0.1*z"}, "z is unknown"),
    "number": ({"bed": "sqrt(x - 1)"}, "is not a number at x = 0.25 m"),
    "holes": ({"holes": [[0.1, 0.0, 1.0, 1.0]]}, "holes.0.: x0 = 0.1 m is on no grid line"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults(name):
    change, words = FAULTS[name]
    case = alone(basin((4.0, 2.0), (8, 4), 0.2), 1.0)
    case["nodes"]["pool"] |= change
    with pytest.raises(CaseError, match=words):
        fvsolve.load(case)


def test_features_that_basins_do_not_support_are_refused():
    case = alone(basin((4.0, 2.0), (8, 4), 0.2), 1.0)
    with pytest.raises(CaseError, match="one density"):
        fvsolve.load(case | {"fluid": {**case["fluid"], "law": "log"}})
    for study in (ladder, lambda case: failure_map(fvsolve.load(case))):
        with pytest.raises(FvsolveError, match="basins"):
            study(case)


def test_a_run_interrupted_and_resumed_equals_the_uninterrupted_run_with_its_frames(tmp_path):
    case = alone(
        basin((40.0, 20.0), (160, 80), 0.2, start={"level": "where(x < 20, 0.2, 0.1)"}), 60.0
    )
    case["output"] |= {"fields": 12, "every": 1.0}
    run_in_two_parts(case, tmp_path, 5.0)
    assert_equal_files(
        tmp_path, ["history.csv", *(f"fields/pool-{k:06d}.vtu" for k in range(13)), "fields.pvd"]
    )


def test_faults_of_a_mesh_file_name_the_file_and_no_key(tmp_path):
    import meshio

    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)

    def mesh_message(cells, **keys) -> list:
        meshio.write(tmp_path / "square.vtu", meshio.Mesh(points, [("quad", np.array([cells]))]))
        basin = {
            "type": "basin",
            "mesh": {"file": str(tmp_path / "square.vtu")},
            "level": 1.0,
            **keys,
        }
        with pytest.raises(CaseError) as caught:
            fvsolve.load(scene({"pool": basin}, {}, 1.0, {}))
        return [(fault.place, fault.message) for fault in caught.value.faults]

    ((place, message),) = mesh_message([0, 1, 3, 2])
    assert (
        place == "nodes.pool.mesh"
        and message.startswith("square.vtu: cells: ")
        and "cross themselves" in message
    )
    ((place, message),) = mesh_message([0, 1, 2, 3], patches={"west": {}})
    assert place == "nodes.pool.patches.west"
    assert (
        "square.vtu has no named groups of lines; in Gmsh name the lines of this patch" in message
    )
    assert message.endswith('Physical Curve("west") = {1, 2};')


PARABOLOID = "0.1*((x - 1.5)^2 + (y - 1.5)^2)"


def at_start(level: str, bed: str = PARABOLOID, rest: float = 0.05, cells: int = 24, **more):
    """Return (depths, areas) of a square bowl for a level at the start."""
    pool = basin((3.0, 3.0), (cells, cells), rest, bed=bed, start={"level": level}, **more)
    model = model_of(alone(pool, 1.0))
    return model.meshed[0].fields(model.meshed[0].start())["depth"], model.meshed[0].mesh.area


@pytest.mark.parametrize("holes", [{}, {"holes": [[0.0, 0.0, 0.5, 0.5]]}])
def test_a_level_on_the_bed_is_no_water_whatever_its_shape(holes):
    for bed in (PARABOLOID, "0.3*sin(2*x)*cos(3*y)", "0.2*x + 0.1*y"):
        assert at_start(bed, bed, **holes)[0].max() == 0.0
    same = "0.1*(x^2 + y^2) - 0.3*(x + y) + 0.45"  # the paraboloid, except for rounding
    assert at_start(same, **holes)[0].max() < 1e-12


def test_a_level_never_below_the_bed_acts_as_a_level_that_continues_below_it():
    for surface in ("0.1", "0.1 + 0.05*x", "0.05 + 0.02*sin(3*x)*y"):
        over, under = at_start(f"max({PARABOLOID}, {surface})")[0], at_start(surface)[0]
        assert np.array_equal(over, under) and (over == 0.0).any() and (over > 0.0).any()


def test_a_start_at_rest_is_rest_to_the_bit_on_banks_too():
    for level in ("0.05", f"max({PARABOLOID}, 0.05)"):
        pool = basin((3.0, 3.0), (24, 24), 0.05, bed=PARABOLOID, start={"level": level})
        model = model_of(alone(pool, 1.0))
        assert np.all(model.start == 0.0)


def test_the_initial_volume_is_the_integral_of_depths_above_the_bed():
    """Exact for a film and for a column on a slope; order 2 for a bowl, a cap of volume pi h^2 / (2 k)."""
    depth, area = at_start(f"{PARABOLOID} + 0.01")
    assert depth == approx(np.full(depth.size, 0.01), rel=1e-12)
    # the edge is the middle of a cell
    depth, area = at_start("where(x < 1.0625, 1, 0.2*x)", "0.2*x", rest=-1.0)
    x = 0.0625 + 0.125 * np.arange(24)
    means = np.where(x < 1.0, 1.0 - 0.2 * x, 0.0)
    assert depth.reshape(24, 24)[:, np.abs(x - 1.0625) > 0.1] == approx(
        np.tile(means[np.abs(x - 1.0625) > 0.1], (24, 1)), rel=1e-12, abs=1e-15
    )
    errors = []
    for cells in (24, 48):  # second order, as the bed of a cell is flat
        depth, area = at_start("0.15", cells=cells)
        errors.append(np.sum(depth * area) / (math.pi * 0.15**2 / (2.0 * 0.1)) - 1.0)
    assert abs(errors[0]) < 5e-3 and abs(errors[1]) < abs(errors[0]) / 3.0
