"""Walls on faces against Villemonte's law, rest, mirrored and other meshes; sections against flows and volumes."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import assert_equal_files, ended, model_of, run_in_two_parts
from reference.face_walls import (
    ACROSS,
    CREST,
    LINES,
    METHODS,
    NUMERICS,
    SIZE,
    C,
    dam,
    depth,
    on_triangles,
    pool,
    with_mesh,
)
from reference.meshes import corner_lists, triangles, write
from reference.refusals import refused
from reference.scenes import GRAVITY as G
from reference.scenes import scene

import fvsolve
from fvsolve.core.mesh import read, rectangle
from fvsolve.core.mesh.face_chains import chain_along


def villemonte(upper: float, lower: float) -> float:
    h = upper - CREST
    r = max(lower - CREST, 0.0) / h
    return 2.0 / 3.0 * C * math.sqrt(2.0 * G) * h**1.5 * (1.0 - r**1.5) ** 0.385


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize(("tail", "turned"), [(1.0, False), (1.0, True), (1.8, False)])
def test_steady_flow_over_a_wall_has_the_levels_of_villemonte(
    line, tail, turned, triangular, tmp_path
):
    ends = {"discharge": 3.6}, {"stage": f"{tail} m"}
    patches = dict(zip(("down", "up") if turned else ("up", "down"), ends, strict=True))
    case = pool(
        LINES[line],
        patches,
        (48, 12),
        150.0,
        start={"level": 1.9},
        probes=["reach.depth@3,3", "reach.depth@21,3"],
    )
    result = fvsolve.run(on_triangles(case, tmp_path, 0.8) if triangular else case)
    upper, lower = sorted(
        (result["reach.depth@3,3"][-1], result["reach.depth@21,3"][-1]), reverse=True
    )
    length = math.dist(*LINES[line])
    assert villemonte(upper, lower) * length == approx(3.6, rel=0.02)
    if line == "across" and not triangular:
        assert villemonte(upper, lower) * length == approx(3.6, rel=2e-3)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("numerics", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
@pytest.mark.parametrize("beyond", ["1.25", "0"], ids=["wet", "dry"])
def test_water_at_rest_next_to_a_wall_does_not_move(beyond, triangular, scheme, numerics, tmp_path):
    start = {"level": f"where(x < 12.05, 1, {beyond})"}
    # with dry islands; west of the wall at the level of rest
    bed = "where(x < 12.05, 0.3*sin(x) + x*y/50, 0)"
    case = pool(bed=bed, start=start, numerics={"scheme": scheme} | numerics, end=3.0)
    case = on_triangles(case, tmp_path) if triangular else case
    model, state = ended(case)
    assert np.array_equal(state.y, fvsolve.initial_state(model).y)
    assert np.ptp(depth(model, state)) > 0.1


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
def test_water_between_a_wall_and_a_patch_with_a_link_does_not_move(triangular, tmp_path):
    """The level at the patch is extrapolated from two cells, but not across the wall."""
    case = pool(
        [[23.0, -1.0], [23.0, 7.0]],
        {"down": {}},
        level=1.2,
        start={"level": "where(x < 23, 0.7, 1.2)"},
        end=3.0,
    )
    case = on_triangles(case, tmp_path) if triangular else case
    case["nodes"]["tank"] = {"type": "tank", "area": 5.0, "elevation": 0.0, "level": 1.2}
    case["links"] = {"o": {"type": "orifice", "from": "reach.down", "to": "tank", "diameter": 0.3}}
    model, state = ended(case)
    assert np.array_equal(state.y, fvsolve.initial_state(model).y)


def test_a_wall_that_ends_in_the_basin_lets_water_around(tmp_path):
    case = pool(
        [[12.0, 0.0], [12.0, 4.0]],
        start={"level": "where(x < 12, 1.4, 1)"},
        end=200.0,
        manning=0.05,
    )
    model, state = ended(case)
    assert depth(model, state) == approx(1.2, abs=0.01)


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
def test_deep_flow_over_a_wall_is_as_without_it(triangular, tmp_path):
    patches = {"up": {"discharge": 6.0}, "down": {"stage": "2 m"}}
    probes = ["reach.depth@3,3", "reach.depth@11.5,3", "reach.u@12.5,3"]
    case = pool(ACROSS, patches, start={"level": 2.0}, manning=0.03, probes=probes)
    # the lower depth over it is 3 times its height
    case["nodes"]["reach"]["walls"]["levee"]["crest"] = 0.5
    case = on_triangles(case, tmp_path) if triangular else case
    without = case | {"nodes": {"reach": case["nodes"]["reach"] | {"walls": {}}}}
    one, other = fvsolve.run(case), fvsolve.run(without)
    for probe in probes:
        assert one[probe] == approx(other[probe], rel=0.01)


def mirrored(case: dict) -> dict:
    walls = {"levee": {"line": [[24.0 - x, y] for x, y in LINES["steep"]], "crest": CREST}}
    basin = case["nodes"]["reach"] | {
        "walls": walls,
        "start": {"level": "where(x > 18, 2.2, 1)", "v": 0.1},
    }
    return case | {"nodes": {"reach": basin}}


def turned(case: dict) -> dict:
    """Turned by 90 degrees: x, y become -y + 6, x."""
    walls = {"levee": {"line": [[6.0 - y, x] for x, y in LINES["steep"]], "crest": CREST}}
    basin = case["nodes"]["reach"] | {
        "walls": walls,
        "start": {"level": "where(y < 6, 2.2, 1)", "u": -0.1},
    }
    return case | {"nodes": {"reach": basin | {"size": [6.0, 24.0], "cells": [6, 24]}}}


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_mirrored_and_turned_walls_have_the_same_depths(scheme):
    model, state = ended(dam(scheme))
    base = depth(model, state).reshape(6, 24)
    assert base[:, 14:].mean() > 1.05  # water has passed
    other = depth(*ended(mirrored(dam(scheme)))).reshape(6, 24)
    assert other[:, ::-1] == approx(base, rel=1e-11)
    other = depth(*ended(turned(dam(scheme)))).reshape(24, 6)
    assert other[:, ::-1].T == approx(base, rel=1e-11)


def test_a_grid_and_the_same_mesh_have_the_same_depths(tmp_path):
    grid = rectangle(SIZE, (24, 6))
    write(tmp_path / "g.msh", grid.points, corner_lists(grid))
    case = dam("upwind")
    case["numerics"] = {"end": 12.0, "scheme": "upwind", "method": "ssp-rk2", "step": 0.02}
    model, state = ended(case)
    other, found = ended(with_mesh(case, tmp_path / "g.msh"))
    centres, depths = other.case.meshes["reach"].centre, depth(other, found)
    order = np.lexsort((centres[:, 0].round(6), centres[:, 1].round(6)))
    assert depths[order] == approx(depth(model, state), rel=1e-11)


def test_a_group_of_a_mesh_file_is_the_wall_on_its_lines(tmp_path):
    points, cells = triangles(SIZE, 1.0)
    path = write(tmp_path / "t.msh", points, cells.tolist())
    chain = chain_along(mesh := read(path), ACROSS)
    ends = mesh.points[mesh.ends[chain.faces]]
    numbers = np.argmin(np.linalg.norm(points[None, None] - ends[:, :, None], axis=3), axis=2)
    write(tmp_path / "g.msh", points, cells.tolist(), {"levee": numbers})
    case = on_triangles(dam("muscl"), tmp_path)
    by_line = with_mesh(case | {"nodes": {"reach": case["nodes"]["reach"]}}, path)
    by_line["nodes"]["reach"]["walls"] = {"levee": {"line": ACROSS, "crest": CREST}}
    by_group = with_mesh(by_line, tmp_path / "g.msh")
    by_group["nodes"]["reach"]["walls"] = {"levee": {"group": "levee", "crest": CREST}}
    one, other = model_of(by_line).meshed[0].marks, model_of(by_group).meshed[0].marks
    assert np.array_equal(one.faces, other.faces) and (other.cosine == 1.0).all()
    assert np.isfinite(depth(*ended(by_group))).all()
    by_group["nodes"]["reach"]["walls"]["levee"]["group"] = "leve"
    refused(by_group, 'no such group in g.msh; did you mean "levee"')


@pytest.mark.parametrize("numerics", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
def test_all_methods_spill_the_same_volume(triangular, numerics, tmp_path):
    end = (
        60.0 if not triangular or numerics.get("method") != "radau-iia-5" else 25.0
    )  # there it takes a second a second
    case = pool(
        start={"level": "where(x < 12.05, 1.52, 0)"},
        end=end,
        numerics=numerics,
        probes=["reach.volume"],
    )
    case = on_triangles(case, tmp_path) if triangular else case
    assert abs(fvsolve.run(case, {"numerics.end": 5.0}).ledger["mass"]["relative"]) < 1e-12
    model, state = ended(case)
    found, start = depth(model, state), depth(model, fvsolve.initial_state(model))
    behind, cells = model.meshed[0].x > 12.05, model.meshed[0].mesh.area
    spilled, area = float(found[behind] @ cells[behind]), cells[~behind].sum()
    # of a pool with one level: dh/dt = -rate h^1.5
    rate = villemonte(CREST + 1.0, 0.0) * SIZE[1] / area
    assert spilled == approx(area * (0.02 - (0.02**-0.5 + 0.5 * rate * end) ** -2), rel=0.03)
    assert found.min() >= 0.0 and found @ cells == approx(start @ cells, rel=1e-12)


@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_threads_and_resumed_runs_have_the_same_bits(scheme, tmp_path):
    case = dam(scheme, cells=(96, 24), probes=["reach.depth@12,3"])
    one, four = fvsolve.run(case), fvsolve.run(case, threads=4)
    assert np.array_equal(one["reach.depth@12,3"], four["reach.depth@12,3"])
    if scheme == "muscl":
        case["numerics"]["courant"] = 0.05  # so many steps that the run can be interrupted
        run_in_two_parts(case, tmp_path, 2.0)
        assert_equal_files(tmp_path, ["history.csv"])


BRIDGE = {"bridge": {"basin": "reach", "from": [6.0, 0.0], "to": [6.0, 6.0]}}


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
@pytest.mark.parametrize(
    "line", [[[6.0, 0.0], [6.0, 6.0]], [[4.0, 6.0], [9.0, 0.0]]], ids=["across", "oblique"]
)
def test_a_section_of_steady_flow_passes_the_discharge(line, triangular, tmp_path):
    patches = {"up": {"discharge": 3.6}, "down": {"stage": "2 m"}}
    section = {"bridge": {"basin": "reach", "from": line[0], "to": line[1]}}
    steps = {"scheme": "upwind", "method": "radau-iia-3", "courant": None, "step": 20.0}
    case = pool(
        patches=patches,
        start={"level": 2.0, "u": 0.3},
        sections=section,
        probes=["bridge.flow"],
        end=2000.0,
        numerics=steps,
    )
    case["nodes"]["reach"]["walls"] = {}
    case["nodes"]["reach"]["manning"] = 0.2
    result = fvsolve.run(on_triangles(case, tmp_path) if triangular else case)
    sign = -1.0 if line[0][1] < line[1][1] else 1.0  # to the left of a line to the north is west
    assert result["bridge.flow"][-1] == approx(sign * 3.6, rel=1e-10)


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_the_integral_of_a_section_is_the_change_of_the_volume_beyond(scheme):
    start = {"level": "1 + 0.3*exp(-(x - 8)^2/4)"}
    case = pool(
        start=start,
        sections=BRIDGE,
        probes=["bridge.flow"],
        end=3.0,
        numerics={"scheme": scheme, "courant": None},
    )
    case["nodes"]["reach"]["walls"] = {}
    case["output"]["every"] = case["numerics"]["step"] = 0.005
    result, (model, state) = fvsolve.run(case), ended(case)
    t, flow = result.seconds, result["bridge.flow"]
    integral = float(np.sum(0.5 * (flow[1:] + flow[:-1]) * np.diff(t)))
    west = model.meshed[0].x < 6.0
    gain = (depth(model, state) - depth(model, fvsolve.initial_state(model)))[west] @ model.meshed[
        0
    ].mesh.area[west]
    assert abs(gain) > 0.5 and integral == approx(gain, rel=4.0 * case["numerics"]["step"] ** 2)
    back = {"bridge": {"basin": "reach", "from": [6.0, 6.0], "to": [6.0, 0.0]}}
    again = fvsolve.run(case | {"output": case["output"] | {"sections": back}})
    assert np.array_equal(again["bridge.flow"], -flow)


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
def test_a_section_changes_no_bit(scheme, triangular, tmp_path):
    case = pool(
        start={"level": "where(x < 12, 1.5, 1)", "v": 0.1}, end=3.0, numerics={"scheme": scheme}
    )
    case["nodes"]["reach"]["walls"] = {}
    case = on_triangles(case, tmp_path) if triangular else case
    plain = ended(case)[1].y
    assert np.array_equal(
        ended(case | {"output": case["output"] | {"sections": BRIDGE}})[1].y, plain
    )


FAULTS = {
    "outside": (
        {"line": [[30, 0], [30, 6]], "crest": 2},
        "levee.line: cuts no face between two cells.*24, 6",
    ),
    "point": ({"line": [[3, 0]], "crest": 2}, "is not a list of 2 or more points"),
    "equal": ({"line": [[3, 0], [3, 0]], "crest": 2}, "two equal points"),
    "both": ({"line": ACROSS, "group": "a", "crest": 2}, "line.*group"),
    "neither": ({"crest": 2}, "line.*group"),
    "crest": ({"line": ACROSS}, "crest is missing"),
    "group": ({"group": "levee", "crest": 2}, "a rectangle has no groups; expected `line`"),
    "coefficient": ({"line": ACROSS, "crest": 2, "coefficient": 1.5}, "coefficient.*1.5"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_walls_are_named(fault):
    wall, text = FAULTS[fault]
    refused(pool(walls={"levee": wall}), text)


def test_walls_that_cannot_be_are_named(tmp_path):
    refused(
        pool(patches={"up": {}}, walls={"up": {"line": ACROSS, "crest": 2}}),
        "up is also the name of a patch",
    )
    refused(pool(walls={"a b": {"line": ACROSS, "crest": 2}}), "not a valid name")
    moving = pool(patches={"up": {"travel": 0.0}})
    refused(moving, "walls: is not supported for a basin with a moving wall")
    mesh = on_triangles(pool(patches={"up": {}, "down": {}}), tmp_path)
    mesh["nodes"]["reach"]["walls"] = {"levee": {"group": "leve", "crest": 2}}
    refused(
        mesh, "no such group in t.msh; groups of its outline are down and up|no such group in t.msh"
    )
    mesh["nodes"]["reach"] |= {"walls": {"levee": {"group": "up", "crest": 2}}, "patches": {}}
    refused(mesh, "levee.group: cuts no face")
    liquid = {
        "type": "basin",
        "physics": "liquid",
        "size": [1, 1],
        "cells": [2, 2],
        "pressure": 1e5,
        "thickness": 1,
    }
    refused(
        scene({"a": liquid | {"walls": {}}}, {}, 1.0, NUMERICS), "walls: is not a key of physics"
    )
    sections = {"s": {"basin": "a", "from": [0.5, 0], "to": [0.5, 1]}}
    refused(
        scene({"a": liquid}, {}, 1.0, NUMERICS, output={"sections": sections}),
        "a has the physics .liquid.; exp",
    )


def test_a_wall_below_the_bed_is_noted_and_changes_no_bit():
    case = pool(start={"level": "where(x < 12, 1.5, 1)"}, bed="0.2", end=2.0)
    case["nodes"]["reach"]["walls"]["levee"]["crest"] = 0.1
    model, state = ended(case)
    assert ["levee has no effect" in note.text for note in model.warnings] == [True]
    assert np.array_equal(
        state.y, ended(case | {"nodes": {"reach": case["nodes"]["reach"] | {"walls": {}}}})[1].y
    )


SECTIONS = {
    "outside": (
        {"basin": "reach", "from": [3, -1], "to": [3, 6]},
        "bridge.from: 3,-1 m lies outside the mesh",
    ),
    "in a hole": (
        {"basin": "reach", "from": [8.5, 2.5], "to": [3, 6]},
        "bridge.from: 8.5,2.5 m lies outside the mesh or",
    ),
    "short": (
        {"basin": "reach", "from": [3.1, 1.1], "to": [3.2, 1.2]},
        "cuts no face between two cells",
    ),
    "nowhere": (
        {"basin": "reech", "from": [3, 0], "to": [3, 6]},
        "no basin named .reech.; did you mean .reach",
    ),
    "point": ({"basin": "reach", "from": [3, 0], "to": [3, 0]}, "also the start of the line"),
}


@pytest.mark.parametrize("fault", SECTIONS)
def test_faulty_sections_are_named(fault):
    section, text = SECTIONS[fault]
    refused(pool(sections={"bridge": section}, holes=[[8, 2, 10, 4]]), text)


def test_names_of_sections_differ_from_those_of_parts_and_their_probes_are_known():
    section = {"basin": "reach", "from": [3, 0], "to": [3, 6]}
    refused(
        pool(sections={"reach": section}), "reach is also a name in `nodes`; expected another name"
    )
    refused(
        pool(sections={"bridge": section}, probes=["brige.flow"]),
        "no part named .brige.*did you mean .bridge",
    )
    refused(
        pool(sections={"bridge": section}, probes=["bridge.depth"]),
        "section, which has no .depth.; it has flow",
    )
    case = pool(sections={"bridge": section}, end=0.1)
    assert "bridge.flow" in fvsolve.run(case).probes  # by default


def test_a_basin_has_walls_and_interior_patches_together():
    """Water behind a wall drains through a gully; the other side keeps its level, at rest to the bit."""
    gully = {"at": [1.5, 1.5], "area": 1.0}
    basin = {
        "type": "basin",
        "size": [10.0, 4.0],
        "cells": [20, 8],
        "level": 0.5,
        "elevation": 0.0,
        "walls": {"bund": {"line": [[5, -1], [5, 5]], "crest": 0.8}},
        "patches": {"gully": gully},
    }
    lid = {
        "type": "manhole",
        "from": "yard.gully",
        "to": "shaft",
        "crest": 0.0,
        "area": 0.28,
        "perimeter": 1.9,
    }
    nodes = {"yard": basin, "shaft": {"type": "tank", "area": 2.0, "elevation": -2.0, "level": 0.5}}
    numerics = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}
    found = fvsolve.run(
        scene(
            nodes,
            {"lid": lid},
            30.0,
            numerics,
            ["yard.depth@8,2", "yard.volume", "shaft.level"],
            1.0,
        )
    )
    assert (found["yard.depth@8,2"] == 0.5).all()
    assert found["yard.volume"] + 2.0 * found["shaft.level"] == approx(20.0 + 1.0, rel=1e-12)
    assert found["shaft.level"][-1] > 1.0 and abs(found.ledger["mass"]["relative"]) < 1e-12
