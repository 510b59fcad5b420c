"""Links at patches of basins on bodies: rest in accelerated frames, and oscillations like those of a column."""

import math

import numpy as np
import pytest
from reference.basins import model_of, on_sides, slowing, straight
from reference.jacobians import stray
from reference.meshes import boundary, triangles, write
from reference.scenes import AMBIENT, GRAVITY, RHO, scene
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import fvsolve as fv
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.energy_balance import energy

SOLID = {"type": "body", "mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
SIZE, CELLS, LEVEL = (2.0, 1.0), (8, 4), 0.4
BORE, WAY = 0.2, 1.0  # bore and length of the link [m]
COLUMN = {"type": "rigid-column", "diameter": BORE}
PIPE = {"type": "pipe", "diameter": BORE, "wave_speed": 1000.0, "cells": 10}
FLOW = {"rigid-column": "duct.flow", "pipe": "duct.flow@0"}
TILT = {"roll": "4 deg", "pitch": "-3 deg", "yaw": "20 deg"}


def hull(**joint):
    """Return a body with a driven or fixed joint."""
    return {**SOLID, "joint": joint}


def basin(at, side, folder=None, **more):
    """Return a basin of SIZE with the patch `gap` in the middle of a side; of triangles if `folder` is given."""
    more = {"level": LEVEL, **more}
    if folder is None:
        span = {"span": [0.25, 0.75]} if side in ("west", "east") else {"span": [0.75, 1.25]}
        shape = {"size": SIZE, "cells": CELLS, "patches": {"gap": {"side": side, **span}}}
    else:
        points, cells = triangles(SIZE, 0.25)
        ends = on_sides(points, boundary(cells), SIZE)[side]
        middle = np.abs(points[ends].mean(axis=1)[:, 1] - 0.5) < 0.25
        file = write(folder / f"{side}.msh", points, cells.tolist(), {"gap": ends[middle]})
        shape = {"mesh": {"file": str(file)}}
    return {"type": "basin", "on": "hull", "at": list(at), **shape, **more}


def twins(joint, link, swap=False, turned=False, folder=None, start=None, end=1.0, numerics=None):
    """Return a case of two basins in line along x, with a link from the east side of `a` to the west side of `b`.

    turned : True to reverse the x axis of `b`; start : surface as a function of x and y of the body
    """
    far = SIZE[0] + WAY
    given = [
        {} if start is None else {"start": {"level": start(f"(x + ({x}))", "y")}}
        for x in (0.0, far)
    ]
    second = {"at": (far, 0.0, 0.0), "side": "west"}
    if turned:
        second = {
            "at": (far + SIZE[0], SIZE[1], 0.0),
            "side": "east",
            "attitude": {"yaw": "180 deg"},
        }
        if start is not None:
            given[1] = {"start": {"level": start(f"({far + SIZE[0]} - x)", f"({SIZE[1]} - y)")}}
    nodes = {
        "hull": hull(**joint),
        "a": basin((0, 0, 0), "east", folder, **given[0]),
        "b": basin(folder=folder, **second, **given[1]),
    }
    ends = ("b.gap", "a.gap") if swap else ("a.gap", "b.gap")
    links = {"duct": {**link, "from": ends[0], "to": ends[1], "length": WAY}}
    numerics = {
        "initial": "rest",
        "scheme": "muscl",
        "method": "ssp-rk3",
        "courant": 0.5,
        **(numerics or {}),
    }
    numerics = {key: one for key, one in numerics.items() if one is not None}
    return scene(nodes, links, end, numerics, [FLOW[link["type"]]], every=end / 20)


def spin(rate):
    return {"kind": "revolute", "axis": [0, 0, 1], "angle": straight(rate, 100.0)}


SLOWS = 0.3  # [m/s2], along -x
RATE = 1.0  # [rad/s], about an axis outside of both basins


FRAMES = {  # (joint, surface at rest in its frame)
    "slows down": (
        {"kind": "prismatic", "axis": [1, 0, 0], "travel": slowing(SLOWS)},
        lambda x, y: f"{LEVEL} + {SLOWS / GRAVITY} * ({x} - 2.5)",
    ),
    "turns": (spin(RATE), lambda x, y: f"0.2 + {RATE**2 / (2 * GRAVITY)} * ({x}**2 + {y}**2)"),
}
WAYS = {
    "as drawn": {},
    "column back": {"swap": True},
    "turned": {"turned": True},
    "mesh": {"folder": True},
    "weno5": {"numerics": {"scheme": "weno5"}},
    "implicit": {"numerics": {"method": "gauss-4", "courant": None, "step": 0.1}},
}


def rests(case, loose=1e-13):
    """Return the model of a case, after a check that its state stays within `loose` of the start."""
    model = model_of(case)
    last = fv.advance(model, fv.initial_state(model), case["numerics"]["end"]).y
    assert np.abs(last - model.start).max() < loose
    return model


@pytest.mark.in_turn
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("frame", FRAMES)
def test_basins_joined_by_a_column_on_a_body_rest_where_a_surface_rests_in_their_frame(
    frame, way, tmp_path
):
    (joint, start), more = FRAMES[frame], {"link": COLUMN, **WAYS[way]}
    if "folder" in more:
        more["folder"] = tmp_path
    model = rests(twins(joint, start=start, **more), 1e-8 if way == "implicit" else 1e-11)
    assert all(np.ptp(one.deviations(model.start)[0]) > 0.01 for one in model.meshed)


@pytest.mark.in_turn
@pytest.mark.parametrize("link", [COLUMN, PIPE], ids=["column", "pipe"])
@pytest.mark.parametrize(
    "way", [{}, {"swap": True}, {"turned": True}, {"folder": True}, {"held": False}]
)
def test_basins_joined_by_a_link_on_a_body_rest_on_a_common_level_in_the_world(way, link, tmp_path):
    """The body or its carrier is tilted; the levels of both basins form one horizontal surface."""
    down = Rotation.from_euler("ZYX", [20, -3, 4], degrees=True).inv().apply([0, 0, -1])
    more = {key: tmp_path if key == "folder" else one for key, one in way.items() if key != "held"}
    case = twins({"kind": "fixed", "attitude": TILT}, link, **more)
    case["nodes"]["b"]["level"] = LEVEL - down[0] / down[2] * (SIZE[0] + WAY)
    if way == {"held": False}:  # two rotations in succession
        case["nodes"]["frame"] = hull(kind="fixed", attitude=TILT)
        case["nodes"]["hull"]["joint"] = {"kind": "fixed", "on": "frame"}
    model = rests(case, 1e-9)
    a, b = (model.elevation[f"{one}.gap"] + model.case.places[f"{one}.gap"].depth for one in "ab")
    assert a == pytest.approx(b, abs=1e-12)


HALF, DEEP, HIGH, DUCT, LOSS = 4.0, 1.5, 0.8, 0.6, 3.0  # U-tube with a basin as one arm [m]
WIDE, LONG = 0.3, 4.0  # of this basin, across and along the axis of roll [m]
AREA, BED = WIDE * LONG, 0.1  # its area [m2]; height of its bed above the bottom of the tank [m]
SWING = {"mean": 0.0, "amplitude": 0.05, "period": 7.0}
SWAY = {"mean": 0.0, "amplitude": 0.3, "period": 7.0}


def half_u(joint, grid=(1, 1), swap=False, turned=False, later=False, **link):
    """Return a case of a U-tube with a basin to port, about y = -HALF, and a tank to starboard.

    turned : True to reverse the x and y axes of the basin; later : True to list the tank first
    """
    north = -HALF + 0.5 * WIDE
    at, way = (-0.5 * LONG, north - WIDE, BED - DEEP), {}
    if turned:
        at, way = (0.5 * LONG, north, BED - DEEP), {"attitude": {"yaw": "180 deg"}}
    gap = {"gap": {"side": "south" if turned else "north"}}
    arm = {
        "type": "basin",
        "on": "hull",
        "at": list(at),
        "size": [LONG, WIDE],
        "cells": list(grid),
        "level": HIGH - BED,
        "patches": gap,
        **way,
    }
    far = {"type": "tank", "on": "hull", "at": [0, HALF, -DEEP], "area": AREA, "level": HIGH}
    arms = {"port": arm, "far": far}
    ends = ("far", "port.gap") if swap else ("port.gap", "far")
    nodes = {"hull": hull(**joint)} | (dict(reversed(arms.items())) if later else arms)
    duct = {
        "type": "rigid-column",
        "from": ends[0],
        "to": ends[1],
        "length": 2 * HALF,
        "diameter": DUCT,
        "minor_loss": LOSS,
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.5}
    return scene(nodes, {"duct": duct | link}, 10.0, numerics, ["far.level"], every=0.1)


def rolls(t):
    """Return (G_y, G_z) at the axis [m/s2], f' [rad/s] and f'' [rad/s2] of a rolling hull."""
    w = 2 * math.pi / SWING["period"]
    f = SWING["amplitude"] * math.sin(w * t)
    turn, quicker = SWING["amplitude"] * w * math.cos(w * t), -w * w * f
    return -GRAVITY * math.sin(f), -GRAVITY * math.cos(f), turn, quicker


def sways(t):
    """Return the values of `rolls` for a hull that sways."""
    w = 2 * math.pi / SWAY["period"]
    return SWAY["amplitude"] * w * w * math.sin(w * t), -GRAVITY, 0.0, 0.0


def column_rate(t, state, force):
    """Rates of the flow to starboard [m3/s] and of the level there, for a column along bed, duct and tank.

    Along a line from r1 to r2 the driving term is G . (r2 - r1) - f'' (y1 z2 - z1 y2) + f'^2 (r2^2 - r1^2) / 2. The
    surface in the basin is normal to the effective gravity.
    """
    q, level = state
    gy, gz, turn, quicker = force(t)
    rise = level - HIGH

    def along(y1, z1, y2, z2):
        square = y2 * y2 + z2 * z2 - y1 * y1 - z1 * z1
        return (
            gy * (y2 - y1) + gz * (z2 - z1) - quicker * (y1 * z2 - z1 * y2) + 0.5 * turn**2 * square
        )

    bed, face = BED - DEEP, -HALF + 0.5 * WIDE
    weight = -(gz + quicker * HALF + turn**2 * bed)  # at y = -HALF on the bed
    drive = (
        weight * (HIGH - BED - rise) + along(-HALF, bed, face, bed) + along(face, bed, HALF, -DEEP)
    )
    drive += along(HALF, -DEEP, HALF, -DEEP + level)
    bore = 0.25 * math.pi * DUCT**2
    return [bore / (2 * HALF) * (drive - 0.5 * LOSS * abs(q) * q / bore**2), q / AREA]


JOINTS = {
    "rolls": ({"kind": "revolute", "axis": [1, 0, 0], "angle": SWING}, rolls),
    "sways": ({"kind": "prismatic", "axis": [0, 1, 0], "travel": SWAY}, sways),
}
DRAWN = {
    "as drawn": {},
    "the duct to port": {"swap": True},
    "turned": {"turned": True},
    "tank first": {"later": True},
}


QUICK = {
    "of many cells": {"grid": (2, 4)},
    "a pipe": {"type": "pipe", "wave_speed": 200.0, "cells": 8},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("drawn", [*DRAWN, *QUICK])
@pytest.mark.parametrize("joint", JOINTS)
def test_a_basin_and_a_tank_oscillate_as_a_single_column_of_water(joint, drawn):
    """A basin of one cell is equivalent to a column; many cells, or a pipe, are so far as their waves are fast."""
    moves, force = JOINTS[joint]
    result = fv.run(half_u(moves, **(DRAWN | QUICK)[drawn]))
    t = result.t
    truth = solve_ivp(
        column_rate, (0, 10), [0.0, HIGH], t_eval=t, args=(force,), rtol=1e-11, atol=1e-12
    )
    rise = truth.y[1] - HIGH
    assert np.ptp(rise) > 0.1
    close = (1e-2 if drawn in QUICK else 1e-5) * np.ptp(rise)
    assert result["far.level"] - HIGH == pytest.approx(rise, abs=close)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12 and result.marks == []


@pytest.mark.parametrize("link", [{}, QUICK["a pipe"]], ids=["column", "pipe"])
def test_rates_hang_on_the_states_that_the_pattern_of_implicit_methods_has(link):
    model = model_of(half_u(JOINTS["rolls"][0], grid=(4, 4), **link))
    y = model.start + 0.01 * model.scale * np.random.default_rng(0).normal(size=model.y_size)
    assert stray(model, 1.0, y) < 1e-7


# valves, faults ----------


def test_a_valve_between_basins_that_touch_lets_them_reach_a_common_level_in_the_world():
    joint = {"kind": "fixed", "attitude": {"pitch": "4 deg"}}
    case = twins(joint, COLUMN, end=20.0)
    case["links"] = {"gate": {"type": "valve", "from": "a.gap", "to": "b.gap", "area": 0.1}}
    case["nodes"]["b"]["at"] = [SIZE[0], 0.0, 0.0]
    case["output"]["probes"] = ["a.gap.head", "b.gap.head", "gate.flow"]
    result = fv.run(case)
    heads = np.array([result["a.gap.head"], result["b.gap.head"]])
    assert abs(heads[0, 0] - heads[1, 0]) == pytest.approx(
        SIZE[0] * math.sin(math.radians(4.0)), rel=1e-3
    )
    assert heads[0, -1] == pytest.approx(heads[1, -1], abs=5e-3)
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


STANDS = {
    "type": "basin",
    "size": [1, 1],
    "cells": [2, 2],
    "level": 1.0,
    "elevation": 0.0,
    "patches": {"gap": {"side": "west"}},
}
FAULTS = {  # text: (keys of nodes, of the link)
    "joins a.gap, on hull and b.gap, which is fixed: this would be a flexible hose": (
        {"b": STANDS},
        {},
    ),
    "joins a.gap, on hull and b.gap, on deck: this would be a flexible hose": (
        {"deck": hull(kind="fixed", on="hull"), "b": basin((0, 0, 0), "west") | {"on": "deck"}},
        {},
    ),
    "0.9 m is too short: the route on hull is 1 m long (a.gap at [2, 0.5, 0] and b.gap at [3, 0.5, 0])": (
        {},
        {"length": 0.9},
    ),
    "the ends lie 1 m apart (a.gap at [2, 0.5, 0] and b.gap at [3, 0.5, 0]), and a valve has no length": (
        {},
        {"type": "valve", "area": 0.1, "length": None, "diameter": None},
    ),
    'joins a.gap, a patch of a basin without cells; expected sloshing = "cells" in this basin': (
        {"a": {"sloshing": "frozen"}},
        {},
    ),
    'joins a.gap of a basin on a body, which physics "liquid" does not support yet': (
        {"a": {"physics": "liquid", "pressure": 2e5, "thickness": 0.1, "level": None}},
        {},
    ),
    "the reaction of the flow through a.gap is not modelled yet; "
    "expected a tank instead of the basin, or a driven joint": (
        {"hull": hull(kind="revolute", axis=[1, 0, 0])},
        {},
    ),
}


def changed(case, nodes, link):
    """Return a case with other keys, without those of value None; keys with a type replace a part."""
    for name, keys in nodes.items():
        case["nodes"][name] = keys if "type" in keys else case["nodes"][name] | keys
    case["links"]["duct"] |= link
    for table in (case["nodes"], case["links"]):
        for name, part in table.items():
            table[name] = {key: one for key, one in part.items() if one is not None}
    return case


@pytest.mark.parametrize("text", FAULTS)
def test_links_that_cannot_be_are_refused_by_name(text):
    with pytest.raises(CaseError) as found:
        fv.load(changed(twins({"kind": "fixed"}, COLUMN), *FAULTS[text]))
    assert text in str(found.value)


@pytest.mark.parametrize(
    "link", [COLUMN, {"type": "valve", "diameter": BORE, "length": None}], ids=["column", "valve"]
)
def test_joint_forces_and_energy_are_refused_where_a_link_joins_a_basin_on_a_body(link):
    case = changed(
        twins({"kind": "fixed"}, COLUMN),
        {"b": {"at": [2, 0, 0]} if link["type"] == "valve" else {}},
        {},
    )
    case["links"]["duct"] = changed(
        {"nodes": {}, "links": {"duct": case["links"]["duct"]}}, {}, link
    )["links"]["duct"]
    with pytest.raises(
        FvsolveError,
        match="not supported; links.duct: the reaction of the flow through a.gap is not modelled yet",
    ):
        energy(case)
    case["output"]["probes"] = ["hull.joint_fx"]
    with pytest.raises(
        CaseError,
        match="a probe reads forces of joints, but the reaction of the flow through a.gap is not modelled",
    ):
        model_of(case)


def test_a_patch_has_the_pressure_on_the_bed_at_the_middle_of_its_faces():
    """In a decelerated box: rho g times the surface at the faces of the patch minus the bed of the cells behind."""
    joint, _ = FRAMES["slows down"]
    bed = {"bed": "0.1 * x", "start": {"level": f"{LEVEL} + {SLOWS / GRAVITY} * x"}}
    case = twins(joint, COLUMN)
    case["nodes"]["a"] |= bed
    del case["nodes"]["b"], case["links"]["duct"]
    case["nodes"]["far"] = {
        "type": "tank",
        "on": "hull",
        "at": [3, 0.5, 0],
        "area": 1.0,
        "level": 0.1,
    }
    case["links"]["duct"] = {**COLUMN, "from": "a.gap", "to": "far", "length": 2.0}
    case["output"]["probes"] = ["a.gap.pressure"]
    case["numerics"]["end"] = 1e-3
    behind = 0.1 * (SIZE[0] - 0.5 * SIZE[0] / CELLS[0])  # bed of the cells behind
    deep = LEVEL + SLOWS / GRAVITY * SIZE[0] - behind
    assert fv.run(case)["a.gap.pressure"][-1] == pytest.approx(
        AMBIENT + RHO * GRAVITY * deep, rel=1e-6
    )
