"""Starts with `initial = "equilibrium"` against closed forms and against SciPy on potentials and forces."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.bodies import Crane, bodies, body, pendulum
from reference.scenes import AMBIENT, GRAVITY, RHO, WATER, reservoir, valve
from scipy.optimize import brentq, minimize, root
from scipy.spatial.transform import Rotation

import fvsolve
from fvsolve.case.changes import changes
from fvsolve.core.model.build import tables_with_start
from fvsolve.errors import CaseError
from fvsolve.features.motion.equilibrium_search import Configuration
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.studies import order

CEILING = {"type": "frame", "points": {"a": [0, 0, 0]}}


def balanced(
    nodes: dict, links: dict | None = None, probes=(), end: float = 1.0, **numerics
) -> dict:
    numerics = {"method": "dormand-prince", "rtol": 1e-9, **numerics}
    return bodies(nodes, end, probes, links, 0.1, **numerics, initial="equilibrium")


def built(case: dict, **top):
    return fvsolve.build(fvsolve.load({**case, **top}))


def angles(model) -> list[float]:
    return [float(row["start"][0]) for row in motion_of(model).body_table]


def hinged(
    on: str | None = None, angle: float = 0.0, length: float = 1.0, mass: float = 3.0, **more
) -> dict:
    """Rod along x on a hinge about -y, so that a positive angle lifts it."""
    joint = {
        "kind": "revolute",
        "axis": [0, -1, 0],
        "angle": angle,
        **({} if on is None else {"on": on}),
    }
    moment = mass * length**2 / 12.0
    return body(
        mass,
        [1e-3 * moment, moment, moment],
        joint,
        centre_of_mass=[0.5 * length, 0, 0],
        points={"tip": [length, 0, 0], "middle": [0.5 * length, 0, 0]},
        **more,
    )


def spring(first: str, second: str, stiffness: float, length: float = 0.0, **more) -> dict:
    return {
        "type": "spring",
        "from": first,
        "to": second,
        "stiffness": stiffness,
        "free_length": length,
        **more,
    }


# positions ------------------------------------------------------------------------------------------------------


def test_a_beam_on_rubber_sags_by_the_closed_form():
    """A beam on a bushing sags by m g (L / 2) cos a = -h sin a, with the torque h sin a of the bushing."""
    nodes = {"wall": CEILING, "beam": hinged()}
    links = {
        "rubber": {"type": "bushing", "from": "wall.a", "to": "beam", "rotational_stiffness": 40.0}
    }
    model = built(balanced(nodes, links))
    assert angles(model) == approx([math.atan(-3.0 * GRAVITY * 0.5 / 40.0)], rel=1e-12)
    assert model.steady["moving"] == []


def arm_on_springs(first: float = 0.3, second: float = -0.4) -> tuple[dict, dict]:
    nodes = {
        "top": {"type": "frame", "points": {"a": [0.5, 0, 1.5], "b": [1.8, 0, 1.2]}},
        "arm": hinged(angle=first),
        "hand": hinged("arm.tip", second, 0.7, 2.0),
    }
    return nodes, {
        "one": spring("top.a", "arm.tip", 90.0, 0.8),
        "two": spring("top.b", "hand.tip", 60.0, 0.5),
    }


def slope_of_arm(q) -> list[float]:
    """Gradient over the angles of the potential m g z + k (l - l0)^2 / 2 of the arm [N m]."""
    a, b = q
    e, f = np.array([math.cos(a), math.sin(a)]), np.array([math.cos(a + b), math.sin(a + b)])
    de, df = np.array([-e[1], e[0]]), np.array([-f[1], f[0]])
    slope = np.array([3.0 * 0.5 * e[0] + 2.0 * (e[0] + 0.35 * f[0]), 2.0 * 0.35 * f[0]]) * GRAVITY
    for at, k, free, far in (((0.5, 1.5), 90.0, 0.8, 0.0), ((1.8, 1.2), 60.0, 0.5, 0.7)):
        rope = e + far * f - at
        pull = k * (1.0 - free / np.linalg.norm(rope)) * rope
        slope += [pull @ (de + far * df), pull @ (far * df)]
    return slope.tolist()


def test_two_links_on_two_springs_stand_where_the_slope_of_their_potential_vanishes():
    truth = root(slope_of_arm, [0.3, -0.4], tol=1e-13)
    assert truth.success
    assert angles(built(balanced(*arm_on_springs()))) == approx(truth.x, abs=1e-12)


def four_bar(angle: float = -1.0, axis: int = 1) -> tuple[dict, dict]:
    """Three rods between two points 1.2 m apart, closed by a pin; the stated angles are rounded."""
    lengths = 0.6, 0.8, 0.7
    a = angle
    start = np.array([lengths[0] * math.cos(a), lengths[0] * math.sin(a)])
    rest = np.array([1.2, 0.0]) - start
    far, way = np.linalg.norm(rest), math.atan2(rest[1], rest[0])
    inner = math.acos((far**2 + 0.8**2 - 0.7**2) / (2 * far * 0.8))
    b = way - inner
    knee = start + 0.8 * np.array([math.cos(b), math.sin(b)])
    c = math.atan2(-knee[1], 1.2 - knee[0])
    typed = [round(one, 5) for one in (a, b - a, c - b)]
    nodes = {
        "top": {"type": "frame", "points": {"left": [0, 0, 0], "right": [1.2, 0, 0]}},
        "one": hinged("top.left", typed[0], 0.6, 1.0),
        "two": hinged("one.tip", typed[1], 0.8, 2.5),
        "three": hinged("two.tip", typed[2], 0.7, 1.5),
    }
    return nodes, {
        "pin": {"type": "pin", "from": "three.tip", "to": "top.right", "axis": [0, 1, 0]}
    }


def test_a_chain_hangs_at_its_least_potential_and_its_pin_is_shut():
    model = built(balanced(*four_bar(), ["pin.gap"]))
    found = np.cumsum(angles(model))
    lengths, weights = np.array([0.6, 0.8, 0.7]), np.array([1.0, 2.5, 1.5])

    def height(q):
        z = np.cumsum(lengths * np.sin(q))
        return weights @ (z - 0.5 * lengths * np.sin(q))

    def ends(q):
        return [lengths @ np.cos(q) - 1.2, lengths @ np.sin(q)]

    truth = minimize(
        height,
        found + 0.05,
        constraints={"type": "eq", "fun": ends},
        tol=1e-15,
        options={"maxiter": 500},
    )
    assert found == approx(truth.x, abs=1e-6)
    assert ends(found) == approx([0.0, 0.0], abs=1e-14)
    assert model.observe(fvsolve.initial_state(model)) == approx([0.0], abs=1e-14)


def test_a_rod_on_a_ball_joint_points_along_the_sum_of_weight_and_pull():
    pull = np.array([12.0, -7.0, 0.0])
    joint = {"kind": "ball", "attitude": {"roll": 0.4, "pitch": -0.3, "yaw": 0.8}}
    rod = body(
        2.0, [0.1, 0.1, 0.02], joint, centre_of_mass=[0, 0, -0.5], points={"end": [0, 0, -0.5]}
    )
    links = {
        name: {"type": "force", "to": "rod.end", "force": float(size), "direction": way}
        for name, size, way in (("x", pull[0], [1, 0, 0]), ("y", pull[1], [0, 1, 0]))
    }
    model = built(balanced({"rod": rod}, links))
    resultant = pull - [0, 0, 2.0 * GRAVITY]
    assert -model.case.poses["rod"].attitude[:, 2] == approx(
        resultant / np.linalg.norm(resultant), abs=1e-13
    )
    # no torque about the rod, so the rotation is the shortest, about an axis normal to the resultant
    turn = model.case.poses["rod"].attitude @ model.case.as_stated.poses["rod"].attitude.T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    assert axis @ resultant == approx(
        0.0, abs=0.05 * np.linalg.norm(axis) * np.linalg.norm(resultant)
    )


def raft(kind: str, load=(0.0, 0.0), **joint) -> tuple[dict, dict]:
    """Free plate on four bushings, or on four springs that are much longer than its displacement."""
    corners = {"a": [1, 0.5, 0], "b": [1, -0.5, 0], "c": [-1, 0.5, 0], "d": [-1, -0.5, 0]}
    below = -1000.0 if kind == "spring" else 0.0
    plate = body(
        20.0, [3, 7, 9], {"kind": "free", **joint}, centre_of_mass=[*load, 0.0], points=corners
    )
    ground = {
        "type": "frame",
        "points": {name: [x, y, below] for name, (x, y, _) in corners.items()},
    }
    links = {
        name: {
            "type": "bushing",
            "from": f"ground.{name}",
            "to": f"plate.{name}",
            "stiffness": 500.0,
        }
        if kind == "bushing"
        else spring(f"ground.{name}", f"plate.{name}", 500.0, 1000.0)
        for name in corners
    }
    return {"plate": plate, "ground": ground}, links


@pytest.mark.parametrize("kind", ["bushing", "spring"])
def test_a_free_plate_sinks_by_its_weight_over_its_springs(kind):
    model = built(balanced(*raft(kind, attitude={"yaw": 0.0})))
    pose = model.case.poses["plate"]
    assert pose.place == approx([0.0, 0.0, -20.0 * GRAVITY / 2000.0], abs=1e-12)
    assert pose.attitude == approx(np.eye(3), abs=1e-12)


def test_a_plate_with_its_mass_off_centre_tilts_as_well():
    """A plate on bushings with an eccentric mass is in balance of forces and moments in the plane x z, by SciPy."""
    model = built(balanced(*raft("bushing", load=(0.3, 0.0))))
    pose = model.case.poses["plate"]

    def left(q):
        x, z, a = q  # position of the origin, pitch
        c, s = math.cos(a), math.sin(a)
        points = [np.array([x + c * p, z - s * p]) for p in (1.0, -1.0)]
        pulls = [-1000.0 * (one - [p, 0.0]) for one, p in zip(points, (1.0, -1.0), strict=True)]
        force = pulls[0] + pulls[1] - [0.0, 20.0 * GRAVITY]
        arms = [(points[0] - [x, z], pulls[0]), (points[1] - [x, z], pulls[1])]
        arms.append((np.array([c * 0.3, -s * 0.3]), np.array([0.0, -20.0 * GRAVITY])))
        return [*force, sum(r[1] * f[0] - r[0] * f[1] for r, f in arms)]

    truth = root(left, [0.0, -0.1, 0.03], tol=1e-13).x
    pitch = math.atan2(-pose.attitude[2, 0], pose.attitude[0, 0])
    assert [pose.place[0], pose.place[2], pitch] == approx(truth, abs=1e-11)


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (3.0, 0.2, 0.1), (-1.5, 1.2, 0.4)])
def test_a_plate_on_four_ropes_hangs_at_its_least_potential_from_wherever_it_is_let_go(attitude):
    """A plate on four springs is at the minimum of m g z_c + sum of k (l - l0)^2 / 2 over six freedoms, by SciPy."""
    corners = np.array([[1, 0.5, 0], [1, -0.5, 0], [-1, 0.5, 0], [-1, -0.5, 0]])
    hooks = np.array([[1.3, 0.7, 3.0], [1.1, -0.9, 2.6], [-1.2, 0.6, 3.2], [-0.9, -0.7, 2.8]])
    centre = np.array([0.2, 0.1, -0.05])
    said = dict(zip(("roll", "pitch", "yaw"), attitude, strict=True))
    points = {f"c{i}": p.tolist() for i, p in enumerate(corners)}
    plate = body(
        25.0,
        [3, 7, 9],
        {"kind": "free", "at": [0, 0, 0.5], "attitude": said},
        centre_of_mass=centre.tolist(),
        points=points,
    )
    top = {"type": "frame", "points": {f"c{i}": p.tolist() for i, p in enumerate(hooks)}}
    links = {f"r{i}": spring(f"top.c{i}", f"plate.c{i}", 300.0, 2.0) for i in range(4)}
    model = built(balanced({"plate": plate, "top": top}, links))

    def potential(q):
        turn = Rotation.from_rotvec(q[3:])
        ropes = np.linalg.norm(turn.apply(corners) + q[:3] - hooks, axis=1)
        return 25.0 * GRAVITY * (q[:3] + turn.apply(centre))[2] + 150.0 * np.sum((ropes - 2.0) ** 2)

    pose = model.case.poses["plate"]
    found = np.concatenate([pose.place, Rotation.from_matrix(pose.attitude).as_rotvec()])
    truth = minimize(
        potential, [0.0, 0.0, 0.5, 0.0, 0.0, 0.0], method="BFGS", options={"gtol": 1e-7}
    )
    assert found == approx(truth.x, abs=1e-6)
    assert potential(found) <= truth.fun * (1.0 + 1e-14)


def test_a_boom_stands_where_the_pressures_of_its_cylinder_carry_it():
    crane = Crane()
    force = 1.1 * crane.areas[0] * (crane.p_a - AMBIENT) - crane.areas[1] * (crane.p_b - AMBIENT)

    def left(a):
        eye = crane.eye * np.array([math.cos(a), math.sin(a)])
        rope = eye - [0.0, crane.low]
        turn = (eye[0] * rope[1] - eye[1] * rope[0]) / np.linalg.norm(rope)
        return force * turn - crane.mass * GRAVITY * crane.length / 2 * math.cos(a)

    spring_back = {"gas": spring("ground.up", "boom.tip", 3000.0, 0.9)}
    nodes = crane.nodes(angle=0.1)
    nodes["ground"]["points"]["up"] = [1.0, 0, 1.0]
    links = crane.links(initial_pressure_A=AMBIENT + 1.1 * (crane.p_a - AMBIENT))

    def with_gas(a):
        tip = np.array([math.cos(a), math.sin(a)])
        rope = tip - [1.0, 1.0]
        length = np.linalg.norm(rope)
        pull = -3000.0 * (length - 0.9) * rope / length
        return left(a) + tip[0] * pull[1] - tip[1] * pull[0]

    model = built(balanced(nodes, links | spring_back))
    assert angles(model) == approx([brentq(with_gas, -0.3, 0.6, xtol=1e-14)], abs=1e-12)
    rows = {name: row for name, row in zip(model.node_names, model.tables.nodes, strict=True)}
    x = crane.x + math.hypot(
        crane.eye * math.cos(angles(model)[0]), crane.eye * math.sin(angles(model)[0]) + 0.25
    )
    assert rows["lift.A"]["volume"] == approx(
        crane.dead[0] + crane.areas[0] * (x - crane.distance), rel=1e-12
    )


# water ----------------------------------------------------------------------------------------------------------


def hull(sloshing: str, off: float = 0.6, angle: float = 0.0, cells: int = 40, **tank) -> dict:
    """Hull of 4 t that rolls about its origin, with its centre of mass 0.5 m below and a tank off its middle."""
    ship = body(
        4000.0,
        [4000, 9000, 9000],
        {"kind": "revolute", "axis": [1, 0, 0], "angle": angle},
        centre_of_mass=[0, 0, -0.5],
    )
    basin = {
        "type": "basin",
        "physics": "free-surface",
        "on": "hull",
        "at": [0, off, -0.3],
        "sloshing": sloshing,
        "size": [1.0, 1.6],
        "cells": [1, cells],
        "level": 0.4,
        **tank,
    }
    return {"hull": ship, "pool": {**basin, "at": [-0.5, off - 0.8, -0.3]}}


def test_a_hull_with_frozen_water_off_its_middle_heels_by_the_closed_form():
    mass, off = RHO * 1.6 * 0.4, 0.6
    model = built(balanced(hull("frozen", off)))
    heel = math.atan2(mass * off, 4000.0 * 0.5 + mass * 0.1)
    assert angles(model) == approx([-heel], rel=1e-12)
    assert any(one.key == "joint.angle" and one.value == approx(-heel) for one in model.warnings)


def test_a_hull_with_free_water_heels_further_and_its_water_lies_level():
    """A hull with free water has the heel at which the moments of a level surface and of the hull balance."""
    model = built(balanced(hull("cells", 0.3), probes=["hull.angle"]))
    y = -0.8 + (np.arange(40) + 0.5) * 0.04

    def left(heel):
        # depths normal to the bed, with a level surface in the world
        depth = 0.4 - y * math.tan(heel)
        mass = RHO * 0.04 * depth
        away, up = 0.3 + y, -0.3 + 0.5 * depth
        arm = away * math.cos(heel) - up * math.sin(heel)
        return GRAVITY * (-mass @ arm + 4000.0 * 0.5 * -math.sin(heel))

    heel = brentq(left, -0.5, 0.2, xtol=1e-14)
    assert angles(model) == approx([heel], abs=1e-11)
    frozen = angles(built(balanced(hull("frozen", 0.3))))[0]
    assert heel < 1.05 * frozen < 0.0
    rate = model.rhs(0.0, model.start)
    assert np.max(np.abs(rate)) < 1e-11


def test_the_modes_of_a_tank_heel_a_hull_as_springs_do_and_nearly_as_its_cells():
    """Sloshing modes increase the heel of a hull as the cells do, within 5 %."""
    cells, modes = (angles(built(balanced(hull(kind, 0.3))))[0] for kind in ("cells", "modes"))
    frozen = angles(built(balanced(hull("frozen", 0.3))))[0]
    assert modes < frozen and modes - frozen == approx(cells - frozen, rel=0.05)


def test_a_tank_on_two_sides_and_its_duct_do_not_move_where_their_levels_agree():
    tub = {"type": "tank", "on": "hull", "area": 6.0, "level": 2.0}
    ship = body(
        4e5,
        [8e6, 3e7, 3e7],
        {"kind": "revolute", "axis": [1, 0, 0], "angle": 0.05},
        centre_of_mass=[0, 0, -1.1],
    )
    nodes = {
        "hull": ship,
        "port": {**tub, "at": [0, 5, -1]},
        "starboard": {**tub, "at": [0, -5, -1]},
    }
    duct = {
        "type": "rigid-column",
        "from": "starboard",
        "to": "port",
        "length": 10.0,
        "diameter": 1.38,
    }
    result = fvsolve.run(balanced(nodes, {"duct": duct}, ["hull.angle", "duct.flow"]))
    assert result["hull.angle"] == approx(0.0, abs=1e-12) and result["duct.flow"] == approx(
        0.0, abs=1e-9
    )
    nodes["hull"]["centre_of_mass"] = [0, 0.05, -1.1]
    with pytest.raises(
        CaseError,
        match="expects that nothing moves, but rigid column duct: an unbalanced pressure of 4777 Pa drives its flow",
    ):
        built(balanced(nodes, {"duct": duct}))


# stability in time ----------------------------------------------------------------------------------------------

SCENES = {
    "arm": lambda: arm_on_springs(),
    "chain": lambda: four_bar(),
    "plate": lambda: raft("bushing", load=(0.3, 0.1)),
    "hull": lambda: (hull("cells", 0.3), {}),
    "modes": lambda: (hull("modes", 0.3), {}),
}
METHODS = {
    "dormand-prince": {"rtol": 1e-8},
    "radau-iia-5": {"rtol": 1e-6},
    "rodas-4": {"rtol": 1e-6},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", SCENES)
def test_bodies_in_balance_stay_at_rest(scene, method):
    probe = {"arm": "hand.tip.z", "chain": "two.tip.z", "plate": "plate.z"}.get(scene, "hull.angle")
    case = balanced(*SCENES[scene](), [probe], 2.0, method=method, **METHODS[method])
    result = fvsolve.run(case)
    assert result.ok
    assert np.ptp(result[probe]) <= (1e-10 if scene in ("hull", "modes") else 0.0)


def with_stated_places(nodes: dict, model) -> dict:
    """Nodes with the positions of the equilibrium as stated values."""
    again = {name: {**node} for name, node in nodes.items()}
    for name, node in model.case.equilibrium_nodes.items():
        joint = again[name]["joint"]
        if node.joint.kind == "revolute":
            again[name]["joint"] = {**joint, "angle": node.joint.angle.first}
        else:
            parameters = list(node.joint.attitude.euler_parameters)
            again[name]["joint"] = {
                **joint,
                "at": list(node.joint.at),
                "attitude": {"euler_parameters": parameters},
            }
    return again


@pytest.mark.in_turn
@pytest.mark.parametrize("initial", ["steady", "equilibrium"])
@pytest.mark.parametrize("scene", SCENES)
def test_a_balance_is_the_same_scene_with_the_computed_places_written_explicitly(scene, initial):
    nodes, links = SCENES[scene]()
    case = balanced(nodes, links)
    model = built(case)
    assert model.case.equilibrium_nodes
    other = built(
        {
            **case,
            "nodes": with_stated_places(case["nodes"], model),
            "numerics": {**case["numerics"], "initial": initial},
        }
    )
    if initial == "equilibrium":
        assert not [one for one in other.warnings if one.key in ("joint.angle", "joint.at")]
    tables = [
        {"nodes": own.tables.nodes, **motion_of(own).tables()._asdict()} for own in (model, other)
    ]
    for name in ("bodies", "lines", "nodes", "pins"):
        mine, its = (own[name] for own in tables)
        for key in mine.dtype.names:
            assert np.all(
                np.abs(mine[key] - its[key])
                <= 1e-11 * (1.0 + np.abs(mine[key])) * (key != "force") + 1e-8 * (key == "force")
            ), key
    assert np.max(np.abs(model.start - other.start), initial=0.0) < 1e-13
    assert np.max(np.abs(other.rhs(0.0, other.start)), initial=0.0) < 1e-9


# equivalent cases -----------------------------------------------------------------------------------------------


def test_the_order_of_a_file_its_axes_and_where_the_search_begins_do_not_matter():
    nodes, links = arm_on_springs()
    truth = angles(built(balanced(nodes, links)))
    backwards = dict(reversed(nodes.items())), dict(reversed(links.items()))
    model = built(balanced(*backwards))
    assert dict(zip(motion_of(model).body_names, angles(model), strict=True)) == approx(
        {"arm": truth[0], "hand": truth[1]}, abs=1e-13
    )
    turned = {
        **nodes,
        "arm": {
            **nodes["arm"],
            "joint": {**nodes["arm"]["joint"], "axis": [0, 1, 0], "angle": -0.3},
        },
    }
    assert angles(built(balanced(turned, links))) == approx([-truth[0], truth[1]], abs=1e-13)
    swapped = {
        name: {**link, "from": link["to"], "to": link["from"]} for name, link in links.items()
    }
    assert angles(built(balanced(nodes, swapped))) == approx(truth, abs=1e-13)
    for first, second in ((0.9, -1.5), (-0.2, 0.3), (0.4, 0.0)):
        assert angles(built(balanced(*arm_on_springs(first, second)))) == approx(truth, abs=1e-12)


def test_units_and_a_mirrored_scene_give_the_same_balance():
    nodes, links = arm_on_springs()
    truth = angles(built(balanced(nodes, links)))
    hand = {**nodes["hand"], "joint": {**nodes["hand"]["joint"], "angle": "-22.9 deg"}}
    said = {**nodes, "arm": {**nodes["arm"], "mass": "3000 g"}, "hand": hand}
    loose = {
        name: {**link, "stiffness": f"{link['stiffness'] / 1e3} N/mm"}
        for name, link in links.items()
    }
    assert angles(built(balanced(said, loose))) == approx(truth, abs=1e-12)

    def mirror(point):
        return [-point[0], *point[1:]]

    mirrored = {}
    for name, node in nodes.items():
        mirrored[name] = {
            **node,
            "points": {key: mirror(point) for key, point in node["points"].items()},
        }
        if node["type"] == "body":
            joint = {**node["joint"], "axis": [0, 1, 0]}
            mirrored[name] |= {"joint": joint, "centre_of_mass": mirror(node["centre_of_mass"])}
    assert angles(built(balanced(mirrored, links))) == approx(truth, abs=1e-12)


# stability of chambers, and faults ------------------------------------------------------------------------------


def test_a_boom_on_shut_chambers_stays_at_its_stated_place_and_its_load_settles():
    crane = Crane()
    free = {"initial_pressure_A": None, "initial_pressure_B": None}
    links = {
        "lift": {key: one for key, one in (crane.links()["lift"] | free).items() if one is not None}
    }
    nodes = crane.nodes(angle=0.2) | {
        "load": {
            **pendulum(0.5),
            "joint": {"kind": "revolute", "axis": [0, -1, 0], "angle": 0.5, "on": "boom.tip"},
        }
    }
    case = balanced(nodes, links, ["boom.angle", "load.angle"])
    model = built(case)
    assert (
        angles(model) == approx([0.2, -0.2], abs=1e-14)
        and "boom" not in model.case.equilibrium_nodes
    )
    weight = GRAVITY * (120.0 * 0.5 + 2.0) * math.cos(0.2)
    eye = 0.25 * np.array([math.cos(0.2), math.sin(0.2)])
    rope = eye + [0.0, 0.25]
    lever = (eye[0] * rope[1] - eye[1] * rope[0]) / np.linalg.norm(rope)
    rows = {name: row for name, row in zip(model.node_names, model.tables.nodes, strict=True)}
    assert rows["lift.A"]["pressure"] == approx(AMBIENT + weight / lever / crane.areas[0], rel=1e-9)
    result = fvsolve.run(case)
    assert np.ptp(result["boom.angle"]) == np.ptp(result["load.angle"]) == 0.0


def test_a_standing_pendulum_stays_and_is_reported():
    model = built(balanced({"arm": pendulum(math.pi)}))
    (told,) = [one for one in model.warnings if one.key == "stability"]
    assert "equilibrium is unstable" in told.text and told.value == approx(
        math.sqrt(GRAVITY / 0.7), rel=1e-8
    )
    assert not model.case.equilibrium_nodes
    assert angles(built(balanced({"arm": pendulum(3.0)}))) == approx([0.0], abs=1e-15)
    assert angles(built(balanced({"arm": pendulum(3.14159)}))) == approx([math.pi], abs=1e-15)


@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("shut", [True, False])
def test_shut_oil_holds_a_boom_that_open_valves_do_not(shut, law):
    """A boom is stable on closed chambers and unstable on constant pressures, as the lever grows with the angle."""
    crane, lug = Crane(), np.array([0.5, -0.25])

    def lever(a):
        eye = crane.eye * np.array([math.cos(a), math.sin(a)])
        rope = eye - lug
        return (eye[0] * rope[1] - eye[1] * rope[0]) / np.linalg.norm(rope), np.linalg.norm(rope)

    turn, length = lever(0.9)
    weight = crane.mass * GRAVITY * crane.length / 2.0
    force = weight * math.cos(0.9) / turn
    pressure = AMBIENT + (force + crane.areas[1] * (crane.p_b - AMBIENT)) / crane.areas[0]
    nodes = crane.nodes(angle=0.9)
    nodes["ground"]["points"]["lug"] = [0.5, 0, -0.25]
    links = crane.links(initial_pressure_A=float(pressure), closed_length=float(length) - 0.1)
    if not shut:
        nodes |= {"high": reservoir(float(pressure)), "low": reservoir(crane.p_b)}
        links |= {"a": valve("high", "lift.A", 1e-5), "b": valve("low", "lift.B", 1e-5)}
    model = built(balanced(nodes, links), fluid={**WATER, "law": law})
    grows = force * (lever(0.9 + 1e-5)[0] - lever(0.9 - 1e-5)[0]) / 2e-5 + weight * math.sin(0.9)
    assert grows > 0.0 and not model.case.equilibrium_nodes
    told = [one.value for one in model.warnings if one.key == "stability"]
    assert told == ([] if shut else [approx(math.sqrt(grows / crane.inertia), rel=1e-6)])


@pytest.mark.parametrize("law", ["linear", "log"])
def test_oil_that_is_shut_in_is_the_spring_of_both_chambers(law):
    crane = Crane()
    at = Configuration(tables_with_start(fvsolve.load(crane.case(1.0, law=law))))
    assert at.fluid_stiffness(at.y) == approx(
        np.array([[crane.spring(law) * crane.lever**2]]), rel=1e-12
    )


def test_a_body_without_support_has_no_balance_and_is_named():
    with pytest.raises(CaseError) as told:
        built(balanced({"stone": body(2.0, [1, 1, 1], {"kind": "free"})}))
    assert (
        'nodes.stone: "equilibrium" finds no position where the forces on stone balance: 19.61 N remain'
        in str(told.value)
    )
    assert "add a spring" in str(told.value)


def test_a_hull_that_would_turn_over_with_its_water_is_a_fault():
    nodes = hull("cells", 0.1, 0.2, 10)
    nodes["hull"]["centre_of_mass"] = [0, 0, 0.8]
    with pytest.raises(CaseError, match="nodes.pool: pool is turned over in the equilibrium found"):
        built(balanced(nodes))


def test_motion_at_a_stated_rate_is_a_fault_as_before():
    with pytest.raises(
        CaseError, match="expects that nothing moves, but body arm turns at 2 rad/s"
    ):
        built(balanced({"arm": pendulum(1.0, rate=2.0)}))


def test_a_piston_that_balance_would_take_beyond_its_stroke_is_a_fault_there():
    crane = Crane()
    links = crane.links(initial_pressure_A=AMBIENT + 1e5, initial_pressure_B=AMBIENT)
    with pytest.raises(
        CaseError, match="links.lift.stroke: where forces balance the piston starts at"
    ):
        built(balanced(crane.nodes(), links))


def test_bushings_and_preloads_count_from_stated_places():
    nodes = {
        "top": {"type": "frame", "points": {"a": [0, 0, 1.0]}},
        "bob": body(2.0, [1, 1, 1], {"kind": "prismatic", "axis": [0, 0, 1], "travel": 0.1}),
    }
    links = {
        "rope": {
            "type": "spring",
            "from": "top.a",
            "to": "bob",
            "stiffness": 400.0,
            "preload": -5.0,
        }
    }
    model = built(balanced(nodes, links, ["rope.force"]))
    assert angles(model) == approx([0.1 - (2.0 * GRAVITY - 5.0) / 400.0], rel=1e-12)
    assert model.observe(fvsolve.initial_state(model)) == approx([-2.0 * GRAVITY], rel=1e-12)
    rubber = {
        "rubber": {"type": "bushing", "from": "top.a", "to": "rod", "rotational_stiffness": 30.0}
    }
    rod = {
        "rod": body(
            2.0,
            [0.1, 0.1, 0.1],
            {"kind": "revolute", "axis": [0, -1, 0]},
            centre_of_mass=[0.5, 0, 0],
        )
    }
    model = built(balanced({"top": nodes["top"], **rod}, rubber, ["rod.angle", "rubber.torque"]))
    angle, torque = model.observe(fvsolve.initial_state(model))
    assert torque == approx(GRAVITY * math.cos(angle), rel=1e-12) and angle == approx(
        -math.atan(GRAVITY / 30.0)
    )
    stored = motion_of(model).bushing_table["energy"]  # at t = 0
    assert stored == approx([2.0 * 30.0 * math.sin(0.5 * angle) ** 2], rel=1e-12)


def test_a_mass_on_an_axis_goes_to_where_its_spring_balances_its_load():
    nodes = {
        "wall": {"type": "frame"},
        "load": {"type": "mass", "mass": 4.0, "initial_position": 0.2},
    }
    links = {
        "coil": spring("wall", "load", 800.0, 0.3),
        "push": {"type": "force", "to": "load", "force": 100.0},
    }
    case = balanced(nodes, links, ["load.position"])
    result = fvsolve.run(case)
    assert np.all(result["load.position"] == result["load.position"][0])
    assert result["load.position"][0] == approx(0.3 + 100.0 / 800.0, rel=1e-14)
    (told,) = result.warnings
    assert (told.place, told.key, told.limit) == ("nodes.load", "initial_position", 0.2)


def test_a_body_comes_to_rest_on_a_stop():
    nodes = {
        "floor": {"type": "frame", "points": {"a": [0, 0, 0]}},
        "box": body(5.0, [1, 1, 1], {"kind": "prismatic", "axis": [0, 0, 1], "travel": 1.0}),
    }
    links = {
        "stop": {
            "type": "end-stop",
            "from": "floor.a",
            "to": "box",
            "stiffness": 1e5,
            "minimum": 0.5,
        },
        "soft": spring("floor.a", "box", 10.0, 1.0),
    }
    model = built(balanced(nodes, links))
    truth = (1e5 * 0.5 + 10.0 - 5.0 * GRAVITY) / (1e5 + 10.0)
    assert angles(model) == approx([truth], rel=1e-12)


# studies --------------------------------------------------------------------------------------------------------


def test_a_key_that_a_run_takes_as_a_value_changes_the_start_where_it_is_part_of_a_balance():
    rubber = {"type": "bushing", "from": "wall.a", "to": "beam", "rotational_stiffness": 40.0}
    case, key = (
        balanced({"wall": CEILING, "beam": hinged()}, {"rubber": rubber}),
        "links.rubber.rotational_stiffness",
    )
    assert changes(fvsolve.load(case), key) == "profile"
    assert changes(fvsolve.load(case, {"numerics.initial": "steady"}), key) == "value"


@pytest.mark.parametrize("sloshing", ["frozen", "modes"])
def test_studies_refine_no_cells_of_water_that_has_none(sloshing):
    nodes = hull(sloshing, 0.3)
    nodes["hull"]["joint"]["rate"] = 0.2
    found = order(
        fvsolve.load(bodies(nodes, 0.5, ["hull.angle"], None, 0.1, method="rk4", step=0.05)),
        levels=3,
    )
    assert found.rows


def test_a_hull_oscillates_about_the_computed_heel():
    """w^2 = g sqrt((M z)^2 + (m y)^2) / J about the axis of the hull, with frozen water at any place."""
    model = built(balanced(hull("frozen", 0.6), probes=["hull.angle"]))
    mass = RHO * 1.6 * 0.4
    inertia = 4000.0 + 4000.0 * 0.25 + mass * (1.6**2 + 0.4**2) / 12.0 + mass * (0.6**2 + 0.1**2)
    truth = math.sqrt(GRAVITY * math.hypot(4000.0 * 0.5 + mass * 0.1, mass * 0.6) / inertia)
    values = np.linalg.eigvals(model.jacobian(0.0, model.start))
    assert np.max(values.imag) == approx(truth, rel=1e-7) and np.max(np.abs(values.real)) < 1e-6
