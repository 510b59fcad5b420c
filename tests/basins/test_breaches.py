"""Breaches, walls whose crests move: against the law of a weir, dam breaks, rest, and walls of constant crests."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.basins import assert_equal_files, ended, run_in_two_parts
from reference.face_walls import ACROSS, METHODS, C, dam, depth, on_triangles, pool, with_mesh
from reference.meshes import corner_lists, write
from reference.refusals import refused
from reference.scenes import GRAVITY as G
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.core.mesh import rectangle
from fvsolve.exact import shallow_water


def crested(case: dict, crest, **walls) -> dict:
    """The same case with another crest of the levee, and with further walls."""
    own = case["nodes"]["reach"]
    levee = own["walls"]["levee"] | {"crest": crest}
    return case | {"nodes": {"reach": own | {"walls": {"levee": levee} | walls}}}


def fall(*points, kind="linear") -> dict:
    times, crests = zip(*points, strict=True)
    return {"time": [f"{t} s" for t in times], "value": [f"{z} m" for z in crests], "kind": kind}


@pytest.mark.parametrize("numerics", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_pool_drains_over_a_falling_crest_by_the_law_of_a_weir(scheme, numerics):
    """Each side of the wall is a single cell, so that its level obeys an ordinary differential equation."""
    times, crests = [0.0, 5.0, 25.0, 40.0], [1.5, 1.5, 1.1, 1.3]
    case = pool(
        cells=(2, 1),
        start={"level": "where(x < 12, 1.52, 0)"},
        end=40.0,
        numerics={"scheme": scheme} | numerics,
        probes=["reach.depth@6,3"],
    )
    case = crested(case, fall(*zip(times, crests, strict=True)))
    if "rtol" not in numerics:
        del case["numerics"]["courant"]
        case["numerics"]["step"] = 0.05

    def rate(t, level):
        head = np.maximum(level - np.interp(t, times, crests), 0.0)
        return -2.0 / 3.0 * C * math.sqrt(2.0 * G) * head**1.5 / 12.0

    found = fvsolve.run(case)
    exact = [1.52]
    for start, stop in zip(times[:-1], times[1:], strict=True):
        part = solve_ivp(rate, (start, stop), [exact[-1]], rtol=1e-10, atol=1e-12)
        exact.append(part.y[0, -1])
    level = found["reach.depth@6,3"]
    assert np.interp(times, found.seconds, level) == approx(exact, abs=1e-3 * (1.52 - exact[-1]))
    assert exact[-1] < 1.35 and abs(found.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_an_instant_breach_is_a_dam_break(scheme, triangular, tmp_path):
    start = {"level": f"where(x < {12.05 if triangular else 12}, 2, 0.5)"}
    case = pool(start=start, end=3.0, cells=(96, 2), numerics={"scheme": scheme, "courant": 0.5})
    case = on_triangles(case, tmp_path, 0.5) if triangular else case
    case = crested(case, fall((0, 3.0), (1, -1.0), kind="step"))
    without = case | {"nodes": {"reach": case["nodes"]["reach"] | {"walls": {}}}}
    without["numerics"] = case["numerics"] | {"end": 2.0}
    (model, state), free = ended(case), ended(without)
    assert depth(model, state) == approx(depth(*free), abs=1e-11)
    if scheme == "muscl" and not triangular:
        flow = shallow_water.dam_break(model.meshed[0].x, 2.0, left=2.0, right=0.5, dam=12.0)
        assert np.abs(depth(model, state) - flow.depth).mean() < 0.01


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
@pytest.mark.parametrize("scheme", ["upwind", "muscl"])
def test_a_schedule_of_equal_crests_changes_no_bit(scheme, triangular, tmp_path):
    case = dam(scheme, end=4.0)
    case = on_triangles(case, tmp_path) if triangular else case
    further = {"low": {"line": ACROSS, "crest": 1.2}, "high": {"line": ACROSS, "crest": 1.7}}
    still = crested(case, 1.5, **further)
    moving = crested(case, fall((0, 1.5), (9, 1.5)), **further)
    assert np.array_equal(ended(moving)[1].y, ended(still)[1].y)


@pytest.mark.parametrize("numerics", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
def test_water_below_a_falling_crest_does_not_move(triangular, numerics, tmp_path):
    case = pool(
        bed="where(x < 12.05, 0.3*sin(x) + x*y/50, 0)",
        # on the uneven bed at the level of rest
        start={"level": "where(x < 12.05, 1, 1.2)"},
        numerics=numerics,
        end=3.0,
    )
    case = on_triangles(case, tmp_path) if triangular else case
    model, state = ended(crested(case, fall((0, 3.0), (2, 1.21), (3, 2.0))))
    assert np.array_equal(state.y, fvsolve.initial_state(model).y)


def test_a_crest_that_falls_to_the_bed_and_rises_again_is_a_wall_again():
    """Water flows between 2 s and 6 s. The crest is then above all waves, and both sides keep their volumes."""
    section = {"gate": {"basin": "reach", "from": [12.0, 0.0], "to": [12.0, 6.0]}}
    case = pool(
        start={"level": "where(x < 12, 1.4, 1)"}, end=30.0, sections=section, probes=["gate.flow"]
    )
    found = fvsolve.run(crested(case, fall((2, 3), (3, -5), (5, -5), (6, 3))))
    flow, t = found["gate.flow"], found.seconds
    assert not flow[(t <= 2.0) | (t >= 6.0)].any() and np.abs(flow[(t > 3.0) & (t < 5.0)]).min() > 1
    assert abs(found.ledger["mass"]["relative"]) < 1e-13


def levee(**more) -> dict:
    """A levee of three pieces, of which the middle piece falls."""
    case = pool(start={"level": "where(x < 12, 1.4, 0.5)"}, end=20.0, cells=(48, 12), **more)
    pieces = {"left": [[12, 4], [12, 6]], "breach": [[12, 2], [12, 4]], "right": [[12, 0], [12, 2]]}
    walls = {name: {"line": line, "crest": 2.0} for name, line in pieces.items()}
    walls["breach"]["crest"] = fall((0, 2.0), (2, 2.0), (6, 0.2))
    sections = {
        name: {"basin": "reach", "from": line[0], "to": line[1]} for name, line in pieces.items()
    }
    case["output"] |= {"sections": sections}
    case["nodes"]["reach"] |= {"walls": walls}
    case["output"]["probes"] = ["reach.depth@20,3", *(f"{name}.flow" for name in pieces)]
    return case


def test_water_passes_a_levee_only_through_the_piece_that_falls():
    found = fvsolve.run(levee())
    early = found.seconds <= 2.0
    assert not found["left.flow"].any() and not found["right.flow"].any()
    assert not found["breach.flow"][early].any() and abs(found["breach.flow"]).max() > 1.0
    assert abs(found.ledger["mass"]["relative"]) < 1e-12
    assert found["reach.depth@20,3"][-1] > 0.6


@pytest.mark.parametrize("triangular", [False, True], ids=["grid", "triangles"])
def test_threads_and_resumed_runs_of_a_breach_have_the_same_bits(triangular, tmp_path):
    case = levee(numerics={"courant": 0.2})
    case = on_triangles(case, tmp_path, 0.5) if triangular else case
    alone, four = fvsolve.run(case), fvsolve.run(case, threads=4)
    for name in ("reach.depth@20,3", "breach.flow"):
        assert np.array_equal(alone[name], four[name])
    if not triangular:
        case["numerics"]["courant"] = 0.05
        run_in_two_parts(case, tmp_path, 4.0)
        assert_equal_files(tmp_path, ["history.csv"])


def test_a_grid_and_the_same_mesh_have_the_same_depths_behind_a_breach(tmp_path):
    grid = rectangle((24.0, 6.0), (48, 12))
    write(tmp_path / "g.msh", grid.points, corner_lists(grid))
    case = levee()
    case["numerics"] = {"end": 12.0, "scheme": "upwind", "method": "ssp-rk2", "step": 0.02}
    model, state = ended(case)
    other, found = ended(with_mesh(case, tmp_path / "g.msh"))
    centres = other.case.meshes["reach"].centre
    order = np.lexsort((centres[:, 0].round(6), centres[:, 1].round(6)))
    assert depth(other, found)[order] == approx(depth(model, state), rel=1e-10)


def test_the_higher_of_two_moving_walls_on_a_face_counts_at_each_time():
    """The crests cross at 5 s; a single wall with the greater of both passes the same flow."""
    case = pool(start={"level": "where(x < 12, 1.5, 0.5)"}, end=10.0)
    both = crested(
        case, fall((0, 1.6), (10, 1.0)), bank={"line": ACROSS, "crest": fall((0, 1.0), (10, 1.6))}
    )
    greater = crested(case, fall((0, 1.6), (5, 1.3), (10, 1.6)))
    for made in (both, greater):
        made["numerics"] = {"end": 10.0, "scheme": "upwind", "method": "ssp-rk2", "step": 0.02}
    assert ended(both)[1].y == approx(ended(greater)[1].y, abs=1e-12)


def test_a_crest_follows_a_signal_and_a_formula():
    case = pool(start={"level": "where(x < 12, 1.4, 0.5)"}, end=6.0)
    case["numerics"] = {"end": 6.0, "scheme": "upwind", "method": "ssp-rk2", "step": 0.02}
    table = fall((0, 2.0), (6, 0.5))
    expected = ended(crested(case, table))[1].y
    named = crested(case, {"signal": "crest"}) | {"signals": {"crest": table}}
    assert np.array_equal(ended(named)[1].y, expected)
    formula = crested(case, {"formula": "2 - 0.25*t", "unit": "m"})
    assert ended(formula)[1].y == approx(expected, abs=1e-9)


def test_a_crest_by_a_control_of_a_constant_value_is_that_of_the_constant():
    case = pool(start={"level": "where(x < 12, 1.4, 0.5)"}, end=6.0)
    case["numerics"] = {"end": 6.0, "scheme": "upwind", "method": "ssp-rk2", "step": 0.02}
    gate = {"type": "function", "inputs": {"h": "reach.depth@6,3"}, "formula": "1.2 + 0*h"}
    by_control = crested(case, {"control": "gate"}) | {"controls": {"gate": gate}}
    expected = ended(crested(case, 1.2))[1].y
    model, state = ended(by_control)
    assert np.array_equal(state.y, expected)
    assert "crest by a control" in model.meshed[0].chain_texts()[0]


def test_faulty_schedules_of_crests_are_named():
    refused(crested(pool(), {"time": [0, 1], "value": ["2 m"]}), "levee.crest.value.*length 1")
    refused(crested(pool(), {"time": [1, 0], "value": [2, 1]}), "levee.crest.time")
    refused(crested(pool(), {"time": [0, 1], "value": ["2 m", "1 kg"]}), "levee.crest.value.*kg")


def test_a_falling_crest_always_below_the_bed_is_noted():
    case = pool(start={"level": "where(x < 12, 1.5, 1)"}, bed="0.2", end=1.0)
    model, _ = ended(crested(case, fall((0, 0.15), (1, 0.1))))
    assert ["levee has no effect" in note.text for note in model.warnings] == [True]
