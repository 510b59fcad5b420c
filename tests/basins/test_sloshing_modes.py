"""Water as linear modes: potential theory by finite elements, frequencies of hulls, rest, momentum, energy, faults."""

import math

import meshio
import numpy as np
import pytest
from reference.basins import model_of
from reference.potential import added
from reference.scenes import GRAVITY, RHO, scene, smooth_ramp
from scipy.optimize import brentq

from fvsolve import advance, load, run
from fvsolve.case import sloshing
from fvsolve.core.model.model import State
from fvsolve.errors import CaseError
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.studies import linearise
from fvsolve.studies.energy_balance import energy

SIDE, DEPTH = 2.0, 0.8
BOX = sloshing.Outline((SIDE, 1.0), np.zeros(2), False)
CYLINDER = sloshing.Outline((SIDE, SIDE), np.zeros(2), True)


def tank(on="hull", size=(SIDE, 1.0), level=DEPTH, **more):
    return {
        "type": "basin",
        "on": on,
        "size": list(size),
        "cells": [4, 4],
        "level": level,
        "sloshing": "modes",
        **more,
    }


def disc(path, rings=4, around=48):
    """Write a mesh of a circle about (0.3, -0.2) and return its name."""
    angles = 2.0 * np.pi * np.arange(around) / around
    points = [(0.3, -0.2, 0.0)]
    for k in range(1, rings + 1):
        r = 0.5 * SIDE * k / rings
        points += [(0.3 + r * math.cos(a), -0.2 + r * math.sin(a), 0.0) for a in angles]
    after = [*range(1, around), 0]
    triangles = [(0, 1 + k, 1 + after[k]) for k in range(around)]
    quads = [
        (
            1 + (m - 1) * around + k,
            1 + m * around + k,
            1 + m * around + after[k],
            1 + (m - 1) * around + after[k],
        )
        for m in range(1, rings)
        for k in range(around)
    ]
    meshio.Mesh(points, [("triangle", triangles), ("quad", quads)]).write(path)
    return str(path)


def hull(joint, mass=900.0, inertia=(400.0, 500.0, 600.0), **more):
    return {"type": "body", "mass": mass, "inertia": list(inertia), "joint": joint, **more}


def case_of(body, basin, end=1.0, numerics=None, probes=(), links=None, **more):
    numerics = (
        numerics
        if numerics and "courant" in numerics
        else {"method": "rk4", "step": 0.01, **(numerics or {})}
    )
    return scene({"hull": body, "b": basin}, links or {}, end, numerics, probes, **more)


def frequencies(case):
    """Frequencies of small oscillations about the start [rad/s], in rising order."""
    values = np.linalg.eigvals(linearise(case).a)
    assert np.abs(values.real).max() < 1e-6 * np.abs(values.imag).max()
    return np.sort(values.imag[values.imag > 0.0])


# potential theory ----------


@pytest.mark.in_turn
@pytest.mark.parametrize("outline", [BOX, CYLINDER], ids=["box", "cylinder"])
@pytest.mark.parametrize("depth", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("turns", [False, True], ids=["sway", "roll"])
def test_masses_heights_and_the_inertia_under_a_lid_are_those_of_potential_flow(
    outline, depth, turns
):
    wide = 1.0 if not outline.is_round else None
    every = [one for one in sloshing.modes(outline, depth, 1.0, GRAVITY, 60) if one.along == 0]
    for square, low in ((0.5 * every[0].square, 0.4), (2.2 * every[0].square, -2.0)):
        whole = sloshing.area_of(outline) * depth
        if turns:
            found = (
                sloshing.lid_inertia(outline, depth, 1.0)[1, 1] + whole * (low + 0.5 * depth) ** 2
            )
            still = math.pi / 4.0 * (0.5 * SIDE) ** 4 if outline.is_round else SIDE**3 / 12.0 * wide
            # gravity on a level surface, not part of the reference
            found -= GRAVITY * still / square
            for one in every:
                arm = one.height + low
                found += one.mass * (arm * square + GRAVITY) ** 2 / (one.square - square) / square
        else:
            found = whole + sum(one.mass * square / (one.square - square) for one in every)
        truth = added(
            SIDE,
            depth,
            low,
            square,
            GRAVITY,
            turns,
            outline.is_round,
            30 if outline.is_round else 60,
        )
        assert found == pytest.approx(truth, rel=4e-4)


def test_water_that_is_held_is_a_disc_of_ice_when_thin_and_a_rod_when_slender():
    thin, slender = (sloshing.lid_inertia(CYLINDER, depth, 1.0) for depth in (1e-3, 400.0))
    assert thin[0, 0] == pytest.approx(math.pi * 1e-3 / 4.0, rel=1e-5)
    assert slender[0, 0] == pytest.approx(math.pi * 400.0**3 / 12.0, rel=1e-4)
    assert thin[2, 2] == slender[2, 2] == 0.0
    square = sloshing.lid_inertia(sloshing.Outline((1.0, 1.0), np.zeros(2), False), 1.0, 1.0)
    # minus the torsion constant
    assert np.diag(square) == pytest.approx(1.0 / 6.0 - 0.140577, abs=1e-6)


# through the case file ----------


@pytest.mark.in_turn
@pytest.mark.parametrize("low", [0.3, -1.5], ids=["tank above the axis", "tank below it"])
@pytest.mark.parametrize("shape", ["box", "box turned", "cylinder"])
def test_a_hull_rolls_at_the_frequencies_of_potential_flow(shape, low, tmp_path):
    own, stiff, is_round = 500.0, 6e4, shape == "cylinder"
    if is_round:
        basin = tank(at=[-0.3, 0.2, low], mesh={"file": disc(tmp_path / "disc.msh")})
        del basin["size"], basin["cells"]
    elif shape == "box":
        basin = tank(at=[-0.5 * SIDE, -0.5, low])
    else:
        basin = tank(
            at=[-0.5 * SIDE, 0.5, low], size=(1.0, SIDE), attitude={"yaw": math.radians(-90.0)}
        )
    case = case_of(hull({"kind": "revolute", "axis": [0, 1, 0], "stiffness": stiff}), basin)
    found = frequencies(case)
    # of equal area
    side = SIDE * math.sqrt(math.sin(2 * math.pi / 48) / (2 * math.pi / 48)) if is_round else SIDE
    area, still = (
        (math.pi / 4 * side**2, math.pi / 4 * (0.5 * side) ** 4)
        if is_round
        else (SIDE, SIDE**3 / 12.0)
    )
    rights = stiff - RHO * GRAVITY * (area * DEPTH * (low + 0.5 * DEPTH) + still)

    def law(w):
        return rights - w * w * (
            own + RHO * added(side, DEPTH, low, w * w, GRAVITY, True, is_round, n=24)
        )

    laws = [(law(0.998 * w), abs(law(w)), law(1.002 * w)) for w in found[:5]]
    # roots, not poles; some are transverse
    met = [a * b < 0.0 and at < min(abs(a), abs(b)) for a, at, b in laws]
    assert sum(met) >= 2 and any(met[:2])


def test_shallow_water_on_a_cart_swings_by_the_tangent_law():
    mass, stiff, depth = 100.0, 3e3, 0.02
    c, water = math.sqrt(GRAVITY * depth), RHO * depth * SIDE

    def law(w):
        s = 0.5 * w * SIDE / c
        return stiff - mass * w * w - water * w * w * math.tan(s) / s

    truth = brentq(law, 0.2, math.pi * c / SIDE * 0.999)
    body = hull({"kind": "prismatic", "axis": [1, 0, 0], "stiffness": stiff}, mass)
    assert frequencies(case_of(body, tank(level=depth)))[0] == pytest.approx(truth, rel=1e-3)


def test_in_a_rotating_cylinder_water_oscillates_as_in_a_fixed_cylinder(tmp_path):
    rate = 0.4
    basin = tank(at=[-0.3, 0.2, 0.0], mesh={"file": disc(tmp_path / "disc.msh")})
    del basin["size"], basin["cells"]
    turning = {"time": [-100.0, 100.0], "value": [-100.0 * rate, 100.0 * rate]}
    found = frequencies(
        case_of(hull({"kind": "revolute", "axis": [0, 0, 1], "angle": turning}), basin)
    )
    still = frequencies(case_of(hull({"kind": "fixed"}), basin))
    assert still[::2] == pytest.approx(still[1::2], rel=1e-9)  # equal along x and y
    assert found == pytest.approx(np.sort([*(still[::2] - rate), *(still[::2] + rate)]), rel=1e-9)


# rest, momentum, energy ----------


@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
def test_water_that_is_level_in_a_tank_that_leans_rests(method):
    lean = {"roll": math.radians(4.0), "pitch": math.radians(-3.0)}
    basin = tank(at=[0.2, 0.1, 0.5], attitude={"yaw": 0.3})
    probes = ["b.depth@0.1,0.2", "b.depth@1.9,0.9", "hull.joint_tx"]
    result = run(
        case_of(hull({"kind": "fixed", "attitude": lean}), basin, 1.0, {"method": method}, probes)
    )
    model = model_of(
        case_of(hull({"kind": "fixed", "attitude": lean}), basin, 1.0, {"method": method}, probes)
    )
    turn = model.case.poses["hull"].attitude @ model.case.nodes["b"].rotation
    slope = -turn[2, :2]  # gravity along the bed over g: a level surface to first order
    for place, name in (((0.1, 0.2), probes[0]), ((1.9, 0.9), probes[1])):
        truth = DEPTH + slope @ (np.array(place) - (0.5 * SIDE, 0.5))
        assert np.abs(result[name] - truth).max() < 1e-12
    assert np.ptp(result["hull.joint_tx"]) < 1e-9 * abs(result["hull.joint_tx"][0])


def test_a_free_tank_on_rails_conserves_its_momentum():
    body = hull({"kind": "prismatic", "axis": [1, 0, 0], "rate": 0.3, "stiffness": 0.0}, 50.0)
    push = {
        "type": "force",
        "from": "world.o",
        "to": "hull",
        "direction": [1, 0, 0],
        "force": {"time": [0.0, 0.2, 0.2 + 1e-9], "value": [60.0, 60.0, 0.0]},
    }
    case = case_of(body, tank(), 3.0, {"step": 0.01}, links={"push": push})
    case["nodes"]["world"] = {"type": "frame", "points": {"o": [-5, 0, 0]}}
    model = model_of(case)
    bodies, names = motion_of(model).body_table, motion_of(model).body_names

    def momentum(state):
        out = model.evaluate(state.t, state.y)[1]
        from fvsolve.core.kernels.moving_frames import body_row
        from fvsolve.features.motion.kernels.body_kinematics import centre_of

        return sum(
            row["mass"] * centre_of(row, out, body_row(model.tables, k))[3]
            for k, row in enumerate(bodies)
        )

    first = advance(model, State(0.0, model.start.copy()), 0.5)
    last = advance(model, first, 3.0)
    still = model.state_names.index("b x1.travel")
    assert abs(last.y[still] - first.y[still]) > 1e-4 and "b held" in names
    assert momentum(last) == pytest.approx(momentum(first), rel=1e-12)


def test_energy_is_conserved_to_the_order_of_the_method():
    body = hull({"kind": "revolute", "axis": [0, 1, 0], "stiffness": 3e4, "angle": 0.1})
    lost = []
    for step in (0.02, 0.01):
        found = energy(case_of(body, tank(at=[-1.0, -0.5, 0.2]), 4.0, {"step": step}))
        lost.append(abs(found.step[-1]))
    assert lost[1] < lost[0] / 12.0 and lost[1] < 1e-3 * max(
        np.abs(one).max() for one in found.stored.values()
    )


# comparison with cells and frozen water ----------


def test_modes_lie_on_cells_where_water_is_shallow_and_waves_small():
    depth, size = 0.05, (SIDE, 0.1)
    driven = smooth_ramp(0.2, 3.0, 0.0, 2e-3)
    body = hull({"kind": "prismatic", "axis": [1, 0, 0], "travel": driven})
    probes = ["b.depth@0.01,0.05", "hull.joint_fx"]
    cells = tank(size=size, level=depth, sloshing="cells") | {"cells": [100, 1]}
    fine = run(
        case_of(body, cells, 5.0, {"method": "rk4", "scheme": "upwind5", "step": 0.01}, probes)
    )
    found = run(case_of(body, tank(size=size, level=depth), 5.0, probes=probes))
    rise = np.abs(fine[probes[0]] - depth).max()
    assert np.abs(found[probes[0]] - fine[probes[0]]).max() < 0.06 * rise
    force = np.abs(fine[probes[1]]).max()
    assert np.abs(found[probes[1]] - fine[probes[1]]).max() < 0.03 * force


def test_check_warns_where_shallow_water_is_no_valid_model_and_a_run_where_modes_are_not():
    deep, shallow = (
        model_of(
            case_of(
                hull({"kind": "fixed"}),
                tank(level=level, sloshing="cells"),
                numerics={"method": "ssp-rk3", "courant": 0.5},
            )
        )
        for level in (DEPTH, 0.05)
    )
    (said,) = [one for one in deep.warnings if one.kind == "dispersion"]
    kh = math.pi * DEPTH / SIDE
    assert (
        said.value == pytest.approx(math.sqrt(kh / math.tanh(kh)) - 1.0)
        and "22 % too fast" in said.text
    )
    assert not [one for one in shallow.warnings if one.kind == "dispersion"]
    for tilt, many in ((0.02, 0), (0.3, 1)):
        body = hull({"kind": "revolute", "axis": [0, 1, 0], "stiffness": 8e4, "angle": tilt})
        told = [
            one
            for one in run(case_of(body, tank(at=[-1.0, -0.5, 0.0]), 2.0)).warnings
            if one.kind == "sloshing"
        ]
        assert len(told) == many
    assert told[0].place == "nodes.b" and told[0].value > 0.2 and told[0].text.startswith("b: at ")


@pytest.mark.parametrize("sloshing", ["modes", "cells"])
def test_a_body_that_falls_freely_ends_by_name_for_its_water_has_no_weight_left(sloshing):
    numerics = {"method": "ssp-rk3", "courant": 0.5} if sloshing == "cells" else {}
    result = run(
        case_of(hull({"kind": "free"}), tank(at=[-1, -0.5, 0], sloshing=sloshing), 0.5, numerics)
    )
    assert not result.ok and "the water in b has no weight left" in result.reason
    still = run(case_of(hull({"kind": "free"}), tank(at=[-1, -0.5, 0], sloshing="frozen"), 0.5))
    assert still.ok


def test_weight_that_a_lift_adds_is_noted_for_modes_that_neglect_it():
    told = []
    for share in (0.05, 0.5):
        travel = {
            "start": -2.0,
            "duration": 4.0,
            "value": [0.0, -8.0 * share * GRAVITY],
            "exponent": 2,
        }
        body = hull({"kind": "prismatic", "axis": [0, 0, 1], "travel": travel})
        told.append(
            [one for one in run(case_of(body, tank(), 1.0)).warnings if one.kind == "weight"]
        )
    assert not told[0] and len(told[1]) == 1
    assert told[1][0].value == pytest.approx(0.5, rel=1e-6) and told[1][0].place == "nodes.b"


def test_depth_is_level_at_the_start_however_suddenly_its_body_is_let_go():
    body = hull({"kind": "revolute", "axis": [0, 1, 0], "angle": 0.05, "stiffness": 1e6})
    probes = ["b.depth@0.05,0.5", "b.depth@1.95,0.5"]
    result = run(case_of(body, tank(at=[-1.0, -0.5, 0.2]), 0.02, {"step": 1e-3}, probes))
    for name, x in zip(probes, (-0.95, 0.95), strict=True):
        assert result[name][0] == pytest.approx(DEPTH + x * math.sin(0.05), abs=1e-12)
        assert np.abs(np.diff(result[name])).max() < 0.02


# bad input ----------


@pytest.mark.parametrize(
    ("change", "place", "said"),
    [
        (
            {"on": None},
            "nodes.b.sloshing",
            "applies only to water on a body; give the body as `on = BODY`",
        ),
        (
            {"holes": [[0, 0, 0.5, 0.25]]},
            "nodes.b.sloshing",
            "modes are known only for boxes and upright cylinders",
        ),
        ({"bed": "0.1 * x"}, "nodes.b.bed", "modes are known only over a flat bed"),
        ({"bed": 1.0}, "nodes.b.level", "is not above the bed, at 1 m"),
        (
            {"attitude": {"roll": 0.6}},
            "nodes.b.sloshing",
            "the bed is 34.4 deg off level at the start",
        ),
        ({"manning": 0.02}, "nodes.b.manning", "modes have no friction"),
        ({"start": {"u": 0.1}}, "nodes.b.start.u", "modes start from level water at rest"),
        (
            {"patches": {"out": {"side": "west", "boundary": "open"}}},
            "nodes.b.patches.out.boundary",
            "only with walls",
        ),
    ],
)
def test_features_that_modes_do_not_support_are_named(change, place, said):
    basin = {key: value for key, value in {**tank(), **change}.items() if value is not None}
    with pytest.raises(CaseError) as error:
        load(case_of(hull({"kind": "fixed"}), basin))
    found = [fault for fault in error.value.faults if fault.place == place]
    assert len(found) == 1 and said in found[0].message


def test_only_depth_is_read_of_water_in_modes():
    with pytest.raises(CaseError, match='b is a basin, which has no "u"; it has depth'):
        load(case_of(hull({"kind": "fixed"}), tank(), probes=["b.u@1,0.5"]))


def test_without_gravity_no_water_stands():
    for rung in ("modes", "cells"):
        with pytest.raises(CaseError) as error:
            load(case_of(hull({"kind": "fixed"}), tank(sloshing=rung), gravity=0.0))
        assert [fault.place for fault in error.value.faults] == ["gravity"]
    load(case_of(hull({"kind": "fixed"}), tank(sloshing="frozen"), gravity=0.0))


def test_nothing_is_read_of_frozen_water():
    with pytest.raises(
        CaseError, match='b is a basin, which has no "depth"; with sloshing = "frozen" its water'
    ):
        load(case_of(hull({"kind": "fixed"}), tank(sloshing="frozen"), probes=["b.depth@1,0.5"]))
