"""Basins in case files: kernels on grids and on meshes, boundaries, links, scalars, and patches that fall dry."""

import copy
import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import ended, model_of
from reference.meshes import boundary, triangles, write
from reference.scenes import AMBIENT, RHO, lake, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.core.mesh import rectangle
from fvsolve.errors import CaseError

STEPS = {"scheme": "muscl", "limiter": "van-leer", "method": "ssp-rk2", "courant": 0.8}
HOLE = [[3.0, 0.0, 4.0, 1.0]]
WAVY = {"level": "1 + 0.2*cos(pi*x/4)*cos(pi*y/2)"}
SPEED = math.sqrt(2.2e9 / RHO)


def basin(**more) -> dict:
    return {"type": "basin", "size": [4.0, 2.0], "cells": [32, 16], **more}


def water(**more) -> dict:
    return basin(level=1.0, **more)


def liquid(**more) -> dict:
    return basin(physics="liquid", pressure=2e6, thickness=0.1, **more)


def case(pool: dict, end: float, numerics: dict | None = None, **top) -> dict:
    made = scene({"pool": pool}, {}, end, STEPS | (numerics or {}), (), end / 10, **top)
    return {key: value for key, value in made.items() if key != "links"}


def triangulated(tmp_path, spacing: float = 0.25) -> dict:
    """Return a basin of triangles in the rectangle of `basin`."""
    points, cells = triangles((4.0, 2.0), spacing)
    write(tmp_path / "t.msh", points, cells.tolist())
    assert len(boundary(cells)) == len(np.unique(boundary(cells), axis=0))
    return {"type": "basin", "mesh": {"file": str(tmp_path / "t.msh")}}


@pytest.mark.parametrize("shape", ["triangles", "quadrilaterals"])
@pytest.mark.parametrize(("manning", "most"), [(0.03, 2e-5), (None, 2e-4)], ids=["rough", "smooth"])
def test_water_on_a_sloping_shore_of_a_mesh_comes_to_rest(shape, manning, most, tmp_path):
    """A tilt of 5 mm in a pond 9 cm deep. Slopes that followed the dry bank left waves of 1 to 5 mm for good."""
    if shape == "triangles":
        points, cells = triangles((40.0, 12.0), 2.0)
        write(tmp_path / "t.msh", points, cells.tolist())
        plan = {"mesh": {"file": str(tmp_path / "t.msh")}}
    else:
        plan = {"size": [40.0, 12.0], "cells": [20, 6], "holes": [[0.0, 0.0, 2.0, 2.0]]}
    pond = {"type": "basin", "level": 0.0, "bed": "0.4 - 0.01*x + 0.004*(y - 6)^2", **plan}
    pond |= {"start": {"level": "0.0875 + 0.0005*x*(x > 30)"}} | (
        {"manning": manning} if manning else {}
    )
    scene = case(pond, 1500.0) | {"output": {"probes": ["pool.depth@39,6"], "every": 1.0}}
    last = fvsolve.run(scene).si("pool.depth@39,6")[-200:]
    assert np.ptp(last) < most


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
@pytest.mark.parametrize("path", ["grid", "graded", "holes", "triangles"])
def test_a_uniform_scalar_stays_uniform_in_sloshing_water(scheme, path, tmp_path):
    pool = water(start=WAVY)
    if path == "triangles":
        pool = triangulated(tmp_path) | {"level": 1.0, "start": WAVY}
    pool |= {"graded": {"grading": [2.0, 1.5]}, "holes": {"holes": HOLE}}.get(path, {})
    model, state = ended(case(pool, 2.0, {"scheme": scheme}, scalars={"dye": {"initial": 3.0}}))
    found = model.meshed[0].values(state.y)["dye"]
    assert np.abs(found - 3.0).max() < 1e-13
    assert np.abs(model.meshed[0].deviations(state.y)).max() > 0.05


@pytest.mark.parametrize("end", [2.0, 12.0])
def test_a_uniform_scalar_stays_uniform_next_to_films_that_a_pipe_fills(end):
    """Films had up to 1.011 and deep water 0.9988 to 1.0021 of a tracer that all sources have as 1."""
    film = {
        "type": "basin",
        "elevation": 0.0,
        "size": [20.0, 12.0],
        "cells": [8, 8],
        "level": -50.0,
        "bed": "0.01*(20-x)+0.22*sin(0.93*x)*cos(0.892*y)+0.053*abs(y-6)",
        "start": {"level": 0.19843786090757914},
        "scalars": {"dye": 1.0},
        "patches": {"west": {"side": "west", "span": [0.0, 4.5]}},
    }
    feed = pipe("lake", "film.west", 20.0, 0.4, 50.0, 6, minor_loss=1.5) | {"scalars": {"dye": 1.0}}
    nodes = {"film": film, "lake": lake(0.55, elevation=0.0) | {"scalars": {"dye": 1.0}}}
    numerics = {"end": end, "scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    dyed = {
        "fluid": {"name": "Water", "law": "linear"},
        "scalars": {"dye": {"initial": 1.0}},
        "nodes": nodes,
    }
    model, state = ended(
        dyed | {"links": {"feed": feed}, "numerics": numerics, "output": {"every": end}}
    )
    pool = model.meshed[0]
    dye, depth = pool.values(state.y)["dye"], pool.depth + pool.deviations(state.y)[0]
    wet, deep = depth > 1e-9, depth > 1e-3
    assert 0 < np.count_nonzero(~wet) and np.count_nonzero(deep) > 10
    assert np.abs(dye[wet] - 1.0).max() < 1e-9 and np.abs(dye[deep] - 1.0).max() < 1e-12


@pytest.mark.parametrize("law", ["linear", "log", "table"])
def test_first_order_on_a_rectangle_is_the_same_by_both_paths(law, tmp_path):
    """Loops over faces give the rates of loops over rows, for the same cells from a file."""
    mesh = rectangle((4.0, 2.0), (32, 16))
    write(tmp_path / "q.msh", mesh.points, mesh.cells.tolist())
    outline = {"type": "basin", "mesh": {"file": str(tmp_path / "q.msh")}}
    start = {"pressure": "1e5*exp(-((x - 1.5)^2 + (y - 1.2)^2))", "u": "0.1*x", "v": "-0.2*y"}
    physics = {"physics": "liquid", "pressure": 2e6, "thickness": 0.1, "start": start}
    pairs = [(liquid(start=start), physics)]
    if law == "linear":
        pairs.append((water(start=WAVY), {"level": 1.0, "start": WAVY}))
    for plain, other in pairs:
        fluid = (
            {"name": "Water", "law": "table"}
            if law == "table"
            else case(plain, 1.0)["fluid"] | {"law": law}
        )
        one, two = (
            model_of(case(pool, 1.0, {"scheme": "upwind"}, fluid=fluid))
            for pool in (plain, outline | other)
        )
        a, b = (model.meshed[0] for model in (one, two))
        order = np.lexsort((b.x, b.y))
        same = two.start.copy()  # averages of cells, not values at centres
        b.deviations(same)[:, order] = a.deviations(one.start)
        rates = a.deviations(one.rhs(0.0, one.start)), b.deviations(two.rhs(0.0, same))[:, order]
        assert np.allclose(b.x[order], a.x, atol=1e-12) and np.allclose(b.y[order], a.y, atol=1e-12)
        for k in range(3):
            assert np.abs(rates[0][k] - rates[1][k]).max() < 1e-11 * np.abs(rates[0][k]).max()


def test_a_plane_wave_of_a_liquid_is_that_of_a_pipe():
    """A valve opens at the end of a channel: its flow equals that at the end of a pipe of the same section."""
    length, wide, thick = 40.0, 0.4, 0.1
    section = {
        "size": [length, wide],
        "cells": [160, 2],
        "physics": "liquid",
        "thickness": thick,
        "pressure": 1e6,
    }
    channel = (
        basin()
        | section
        | {"patches": {"end": {"side": "east"}, "far": {"side": "west", "boundary": "open"}}}
    )
    bore = math.sqrt(4 * wide * thick / math.pi)
    closure = ramp(0.002, 0.02, 0.0, 1.0)
    probes, numerics = ["tap.flow"], STEPS | {"initial": "rest"}
    nodes = {"pool": channel, "out": reservoir(0.9e6)}
    there = fvsolve.run(
        scene(
            nodes, {"tap": valve("pool.end", "out", 0.002, closure)}, 0.025, numerics, probes, 1e-4
        )
    )
    long = {"lake": reservoir(1e6), "end": {"type": "junction"}, "out": reservoir(0.9e6)}
    main = pipe("lake", "end", length, bore, SPEED, 160)
    here = fvsolve.run(
        scene(
            long,
            {"main": main, "tap": valve("end", "out", 0.002, closure)},
            0.025,
            numerics,
            probes,
            1e-4,
        )
    )
    assert there.ok and here.ok
    moved = np.abs(here["tap.flow"]).max()
    # delay of a cell
    assert moved > 2e-3 and np.abs(there["tap.flow"] - here["tap.flow"]).max() < 0.02 * moved
    assert there["tap.flow"][-1] == approx(here["tap.flow"][-1], rel=1e-9)


@pytest.mark.in_turn
@pytest.mark.parametrize(
    ("boundary", "left"), [({"boundary": "open"}, 0.0), ({"impedance": 3.0 * RHO * SPEED}, 0.5)]
)
@pytest.mark.parametrize("holes", [None, [[3.9, 0.0, 4.0, 0.2]]], ids=["grid", "faces"])
def test_a_boundary_reflects_a_known_part_of_a_wave(boundary, left, holes):
    """A pulse returns with the factor (Z - rho a) / (Z + rho a), and the mass balance closes."""
    pool = liquid(cells=[320, 10], patches={"far": {"side": "west", **boundary}})
    pool["start"] = {
        "pressure": "1e5*exp(-12*(x - 1.5)^2)",
        "u": f"-1e5*exp(-12*(x - 1.5)^2)/{RHO * SPEED}",
    }
    if holes:
        pool["holes"] = holes
    given = case(pool, 3.0 / SPEED)
    model, state = ended(given)
    found = model.meshed[0].fields(model.meshed[0].deviations(state.y))["pressure"] - 2e6
    assert found.max() == approx(left * 1e5, abs=1.5e3) and found.min() > -1.5e3
    ledger = fvsolve.run(given).ledger["mass"]
    assert abs(ledger["relative"]) < 1e-13 and (ledger["outflow"] > 0.0 or left > 0.0)


def test_outflow_through_an_open_side_is_no_mark():
    """Outflow through an open side is not marked as spilling or running dry."""
    pool = water(start=WAVY, patches={"sea": {"side": "east", "boundary": "open"}})
    result = fvsolve.run(case(pool, 2.0))
    assert result.ledger["mass"]["by_node"]["pool.sea"] != 0.0 and result.marks == []


@pytest.mark.parametrize("path", ["grid", "holes"])
def test_a_uniform_value_leaves_unchanged_through_open_sides_and_drains(path):
    """A uniform dye, equal to that beyond an open side, stays uniform, and its balance closes to rounding."""
    patches = {
        "sea": {"side": "east", "boundary": "open", "scalars": {"dye": 3.0}},
        "drain": {"side": "south"},
    }
    pool = basin(
        level=0.6, bed="0.1*y + 0.05*x", start={"level": "0.6 + 0.1*cos(pi*x/4)"}, patches=patches
    )
    pool |= {"holes": HOLE} if path == "holes" else {}
    tap = {"tap": valve("pool.drain", "below", 0.02)}
    given = scene(
        {"pool": pool, "below": reservoir(AMBIENT)},
        tap,
        4.0,
        STEPS,
        scalars={"dye": {"initial": 3.0}},
    )
    model, state = ended(given)
    assert np.abs(model.meshed[0].values(state.y)["dye"] - 3.0).max() < 1e-12
    book = fvsolve.run(given).ledger
    assert abs(book["dye"]["relative"]) < 1e-13 and book["dye"]["outflow"] == approx(
        3.0 * book["mass"]["outflow"]
    )


@pytest.mark.parametrize(
    "method, apart", [("radau-iia-5", 1e-6), ("rodas-5p", 1e-6), ("tr-bdf2", 1e-4), ("auto", 1e-6)]
)
def test_implicit_steps_carry_scalars_of_water_as_explicit_ones_do(method, apart):
    """Decay, diffusion, an open side, and a link with another value of the dye."""
    patches = {
        "sea": {"side": "east", "boundary": "open"},
        "in": {"side": "west", "span": [0.5, 1.0]},
    }
    pool = basin(cells=[8, 4], level=0.6, bed="0.02*x", scalars={"dye": "x"}, patches=patches)
    nodes = {"works": {"type": "inflow", "flow": 0.05, "scalars": {"dye": 9.0}}, "pool": pool}
    links = {"feed": pipe("works", "pool.in", 5.0, 0.3, 50.0, 4)}
    scalars = {"dye": {"decay": 0.1, "diffusivity": 1e-3}, "heat": {"initial": 2.0}}
    probes = ["pool.dye@1,1", "pool.dye@3.9,1", "pool.heat@2,1"]
    found = []
    for numerics in ({"method": "rk4", "courant": 0.4}, {"method": method, "rtol": 1e-7}):
        given = scene(
            nodes, links, 4.0, {"scheme": "upwind"} | numerics, probes, 4.0, scalars=scalars
        )
        result = fvsolve.run(copy.deepcopy(given))
        assert max(abs(result.ledger[name]["relative"]) for name in ("mass", "dye", "heat")) < 1e-11
        found.append([*(result[probe][-1] for probe in probes), result.ledger["dye"]["decayed"]])
    assert found[1] == approx(found[0], rel=apart)


def test_a_plug_is_carried_through_a_channel_and_all_of_it_is_booked():
    """At 0.5 m/s, inflow of value 1 for 2 s is between 1 m and 2 m after 4 s."""
    inlet = {"time": [0.0, 2.0], "value": [1.0, 0.0], "kind": "step"}
    patches = {"in": {"side": "west", "scalars": {"dye": inlet}}, "out": {"side": "east"}}
    pool = basin(physics="transport", velocity={"u": 0.5}, patches=patches, cells=[160, 4])
    given = case(pool, 4.0, scalars={"dye": {}})
    result = fvsolve.run(given)
    model, state = ended(given)
    dye, x = model.meshed[0].values(state.y)["dye"], model.meshed[0].x
    assert (
        np.abs(dye - ((x > 1.0) & (x < 2.0))).mean() < 0.04
        and dye.min() > -1e-12
        and dye.max() < 1.0 + 1e-12
    )
    ledger = result.ledger["dye"]
    assert abs(ledger["relative"]) < 1e-13
    # density, width, velocity, time
    assert ledger["by_node"]["pool.in"] == approx(RHO * 2.0 * 0.5 * 2.0, rel=1e-12)
    long = fvsolve.run(given | {"numerics": given["numerics"] | {"end": 12.0}}).ledger["dye"]
    assert long["outflow"] == approx(long["inflow"], rel=1e-6) and abs(long["relative"]) < 1e-13


def test_dye_that_a_pipe_brings_leaves_by_another_and_none_is_lost():
    pool = basin(
        level=0.5, patches={"in": {"side": "west"}, "out": {"side": "east"}}, cells=[16, 8]
    )
    nodes = {
        "works": {"type": "inflow", "flow": 0.1, "scalars": {"dye": 2.0}},
        "pool": pool,
        "river": lake(0.45),
    }
    links = {
        "feed": pipe("works", "pool.in", 5.0, 0.3, 100.0, 5),
        "tap": valve("pool.out", "river", 0.1),
    }
    given = scene(
        nodes, links, 400.0, STEPS | {"method": "ssp-rk3"}, ["pool.out.dye", "feed.dye@1"], 10.0
    )
    result = fvsolve.run(given | {"scalars": {"dye": {}}})
    assert result.ok and result["feed.dye@1"][-1] == approx(2.0, rel=1e-9)
    assert (
        result["pool.out.dye"][-1] == approx(2.0, rel=1e-3) and result["pool.out.dye"].max() < 2.001
    )
    ledger = result.ledger["dye"]
    assert abs(ledger["relative"]) < 1e-13 and ledger["outflow"] > 0.0


def test_decay_and_diffusion_of_a_still_pool_have_their_closed_form():
    """A cosine between walls falls as exp(-(D k^2 + r) t)."""
    k, diffusivity, rate = math.pi / 4.0, 0.05, 0.1
    pool = water(scalars={"heat": f"1 + cos({k}*x)"})
    given = case(
        pool, 3.0, scalars={"heat": {"diffusivity": diffusivity, "decay": rate, "ambient": 1.0}}
    )
    model, state = ended(given)
    value, x = model.meshed[0].values(state.y)["heat"], model.meshed[0].x
    exact = 1.0 + np.cos(k * x) * math.exp(-(diffusivity * k * k + rate) * 3.0)
    assert np.abs(value - exact).max() < 2e-3
    assert abs(fvsolve.run(given).ledger["heat"]["relative"]) < 1e-13


def test_the_ledger_of_each_scalar_is_its_own():
    """In a closed basin a scalar keeps its amount, and a second scalar decays to 1 / e of its amount."""
    given = case(
        water(), 2.0, scalars={"one": {"initial": 1.0}, "other": {"initial": 3.0, "decay": 0.5}}
    )
    ledger = fvsolve.run(given).ledger
    held = 4.0 * 2.0 * RHO
    assert ledger["one"]["final"] == approx(held) and ledger["other"]["final"] == approx(
        3.0 * held / math.e, rel=1e-4
    )
    assert max(abs(ledger[name]["relative"]) for name in ("one", "other")) < 1e-13


def test_a_basin_under_law_log_is_relieved_into_the_network():
    """For small waves the flow is that under the law `linear`, except for the change of density."""
    pool = liquid(patches={"out": {"side": "east", "span": [0.5, 1.5]}})
    links = {"tap": valve("pool.out", "out", 1e-3, ramp(0.0, 0.002, 0.0, 1.0))}
    found = []
    for law in ("linear", "log"):
        given = scene(
            {"pool": pool, "out": reservoir(AMBIENT)},
            links,
            0.01,
            STEPS | {"initial": "rest"},
            ["tap.flow"],
            1e-3,
        )
        given["fluid"] = given["fluid"] | {"law": law}
        result = fvsolve.run(given)
        assert result.ok and abs(result.ledger["mass"]["relative"]) < 1e-13
        found.append(result["tap.flow"])
    assert found[0].max() > 0.01 and np.abs(found[1] - found[0]).max() < 2e-3 * found[0].max()


@pytest.mark.parametrize(
    "pool",
    [water(start=WAVY), liquid(start={"pressure": "1e4*cos(pi*x/4)"})],
    ids=["water", "liquid"],
)
def test_implicit_steps_of_a_basin_agree_with_explicit_ones(pool):
    pool = pool | {"cells": [8, 4]}
    end = 1.0 if "level" in pool else 2.0 / SPEED
    given = case(pool, end, {"scheme": "upwind"})
    tight = copy.deepcopy(given)
    tight["numerics"] = {"end": end, "scheme": "upwind", "method": "radau-iia-5", "rtol": 1e-7}
    fine = copy.deepcopy(given)
    fine["numerics"] = {"end": end, "scheme": "upwind", "method": "dormand-prince", "rtol": 1e-9}
    (_, one), (_, two) = ended(tight), ended(fine)
    assert np.abs(one.y - two.y).max() < 2e-6 * np.abs(two.y).max()


def test_normal_flow_down_a_slope_has_the_velocity_of_manning():
    """u = h^(2/3) sqrt(S) / n far from both open ends, with h = 0.2 m, S = 0.01 and n = 0.03."""
    pool = basin(size=[100.0, 2.0], cells=[100, 2], level=-1.0, bed="1 - 0.01*x", manning=0.03)
    pool["start"] = {"level": "1.2 - 0.01*x", "u": 1.0}
    model, state = ended(case(pool, 12.0))
    found = model.meshed[0].fields(model.meshed[0].deviations(state.y))["velocity"][:, 0]
    middle = np.abs(model.meshed[0].x - 60.0) < 3.0
    assert found[middle] == approx(0.2 ** (2 / 3) * 0.1 / 0.03, rel=0.02)


FAULTS = {
    "join": ({"physics": "transport", "velocity": {"u": 1.0}}, "the key `velocity` gives the flow"),
    "expression": (
        {"physics": "transport", "velocity": {"expression": "swril"}},
        'did you mean "swirl"',
    ),
    "ways": ({"physics": "transport", "velocity": {"u": 1.0, "stream": "x"}}, "expected"),
    "impedance": (
        {"level": 1.0, "patches": {"out": {"side": "east", "impedance": 1.0}}},
        "does not apply to physics",
    ),
    "scalar": ({"level": 1.0, "scalars": {"dye": 1.0}}, "no scalar named"),
    "start": ({"level": 1.0, "start": {"pressure": 1.0}}, "does not apply to physics"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults(name):
    more, words = FAULTS[name]
    nodes, links = {"pool": basin(**({"patches": {"out": {"side": "east"}}} | more))}, {}
    if name == "join":
        nodes["end"], links["tap"] = reservoir(AMBIENT), valve("pool.out", "end", 0.1)
    with pytest.raises(CaseError, match=words):
        model_of(scene(nodes, links, 1.0, STEPS, (), 0.1))


def test_a_patch_that_runs_dry_does_not_shorten_steps():
    """The flow falls with the depth, so that steps do not shrink at zero drop."""
    pool = basin(level=0.05, cells=[8, 4], patches={"out": {"side": "east"}})
    links = {"tap": valve("pool.out", "out", 0.05)}
    result = fvsolve.run(
        scene({"pool": pool, "out": reservoir(AMBIENT)}, links, 600.0, STEPS, ["tap.flow"], 10.0)
    )
    assert result.ok and result.summary["steps"] < 20000 and 0.0 <= result["tap.flow"][-1] < 1e-3
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


# half of the outlet is above the water
BANK = {"cells": [8, 8], "bed": "0.5*y", "patches": {"out": {"side": "east"}}}


def test_a_patch_up_a_bank_stands_at_the_level_of_its_water():
    """The head at the patch is the level, and beside a reservoir of this level the mass is constant to the bit."""
    tap = {"tap": valve("pool.out", "sea", 0.05)}
    given = scene(
        {"pool": basin(level=0.5, **BANK), "sea": lake(0.5)}, tap, 0.1, STEPS, ["pool.out.head"]
    )
    result = fvsolve.run(given)
    assert result["pool.out.head"] == approx(0.5, rel=1e-14)
    assert result.ledger["mass"]["final"] == result.ledger["mass"]["initial"]


@pytest.mark.parametrize("path", ["grid", "holes"])
def test_a_bank_gives_no_water_that_it_has_not(path):
    """No depth is negative, and the level falls until the outlet is dry."""
    pool = basin(level=0.5, manning=0.02, **BANK) | (
        {"holes": [[0.0, 1.0, 1.0, 2.0]]} if path == "holes" else {}
    )
    given = scene(
        {"pool": pool, "outside": reservoir(AMBIENT)},
        {"tap": valve("pool.out", "outside", 0.05)},
        60.0,
        STEPS,
    )
    model, state = ended(given)
    depth = model.meshed[0].depth + model.meshed[0].deviations(state.y)[0]
    assert depth.min() >= 0.0 and 0.0 < depth.max() < 0.25
    assert fvsolve.run(given).ledger["mass"]["final"] == approx(
        RHO * np.sum(model.meshed[0].mesh.area * depth)
    )


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_a_tank_without_friction_drains_to_the_last_film(scheme):
    """Cells behind the outlet fall dry one after another, and no water returns (Torricelli: empty after 409 s)."""
    pool = {"type": "basin", "size": [4.0, 2.0], "cells": [8, 4], "level": 2.0}
    pool["patches"] = {"out": {"side": "south", "span": [1.0, 3.0]}}
    tap = valve(
        "pool.out", "outside", math.pi * 0.15**2 / 4.0 / math.sqrt(2.0), discharge_coefficient=1.0
    )
    given = scene(
        {"pool": pool, "outside": reservoir(AMBIENT)},
        {"tap": tap},
        600.0,
        STEPS | {"scheme": scheme},
    )
    model, state = ended(given)
    depth = model.meshed[0].depth + model.meshed[0].deviations(state.y)[0]
    assert depth.min() >= 0.0 and depth.max() < 1e-3


def test_a_run_stores_its_mesh_and_its_resolved_case_reads_back(tmp_path):
    (tmp_path / "meshes").mkdir()
    points, cells = triangles((4.0, 2.0), 0.5)
    write(tmp_path / "meshes" / "t.msh", points, cells.tolist())
    (tmp_path / "v.csv").write_text("x,y,u,v\n-1,-1,0,0\n9,-1,0,0\n-1,9,0,0\n9,9,0,0\n")
    velocity = {"file": "v.csv"}
    pool = {
        "type": "basin",
        "physics": "transport",
        "velocity": velocity,
        "mesh": {"file": "meshes/t.msh"},
    }
    text = fvsolve.case.text.write(case(pool, 1.0, scalars={"dye": {"initial": 1.0}}))
    (tmp_path / "c.toml").write_text(text)
    assert fvsolve.run(tmp_path / "c.toml", out=tmp_path / "run").ok
    (tmp_path / "meshes" / "t.msh").unlink()
    (tmp_path / "v.csv").unlink()
    again = fvsolve.load(tmp_path / "run" / "case.toml")
    assert (
        again.meshes["pool"].area.sum() == approx(8.0) and again.nodes["pool"].mesh.file == "t.msh"
    )
    assert fvsolve.run(again).ok
