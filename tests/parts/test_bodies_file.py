"""Faults, notices and values as read of bodies, joints, masses, cylinders and spool valves in a case file."""

import pytest
from reference.bodies import Crane, bodies, body, parallelogram, pendulum
from reference.refusals import refused

import fvsolve
from fvsolve.case import load
from fvsolve.errors import CaseError
from fvsolve.features.motion.kernels.tables import motion_of

PROBES = ["arm.x"]


def refusal_text(nodes: dict, links: dict | None = None, probes=()) -> str:
    with pytest.raises(CaseError) as caught:
        fvsolve.build(fvsolve.load(bodies(nodes, 1.0, probes, links)))
    return str(caught.value)


def arm(**more) -> dict:
    return {"arm": {**pendulum(), **more}}


def hinge(**more) -> dict:
    return {"kind": "revolute", "axis": [0, 1, 0], **more}


BAD = {
    "a mass of zero": (arm(mass=0), "nodes.arm.mass: 0 is out of range; expected a value above 0"),
    "inertia of no body": (arm(inertia=[1, 1, 3]), "nodes.arm.inertia: moments of 1, 1, 3 kg m2 are not possible"),
    "inertia in other units": (arm(inertia=["1 kg m", 1, 1]), 'nodes.arm.inertia[0]: "1 kg m"'),
    "products that are not symmetric": (arm(inertia=[[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]), "is not symmetric"),
    "a matrix of no body": (arm(inertia=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]), "principal moment of -1 kg m2"),
    "inertia of nothing": (
        {**arm(), "b": body(1, [1, 0, 1], hinge(on="arm.bob"))}, "nodes.b.inertia: the inertia of the body is 0",
    ),
    "a joint without axis": (arm(joint={"kind": "revolute"}), "nodes.arm.joint: axis is missing"),
    "an axis of zeros": (arm(joint=hinge(axis=[0, 0, 0])), "nodes.arm.joint.axis: is all zeros"),
    "an axis that is too short": (arm(joint=hinge(axis=[0, 1e-300, 0])), "nodes.arm.joint.axis: is all zeros"),
    "a place beyond all": (
        arm(centre_of_mass=[0, 0, 1e300]), "centre_of_mass[2]: 1e+300 has a magnitude above 1e+30 in SI units",
    ),
    "a place that is none": (arm(points={"bob": [0, 0, float("nan")]}), "nodes.arm.points.bob[2]: nan is not finite"),
    "a mass below zero": (arm(mass="-3 kg"), 'nodes.arm.mass: "-3 kg" is out of range; expected a value above 0'),
    "a mass in words": (arm(mass="heavy"), 'nodes.arm.mass: "heavy" is not a number with a unit; expected a mass'),
    "a length as a mass": (arm(mass="3 m"), 'nodes.arm.mass: "3 m" is a length; expected a mass'),
    "two joints": (
        arm(joint=[hinge(), {"kind": "ball"}]),
        "nodes.arm.joint: is a list of 2 tables; expected a single table, joint to another body or the world",
    ),
    "a travel of a hinge": (arm(joint=hinge(travel=1)), "nodes.arm.joint.travel: is not a key of joints of kind"),
    "a joint of no kind": (arm(joint={"kind": "hinge"}), 'nodes.arm.joint.kind: no joint named "hinge"; use revolute'),
    "a rate along a line": (arm(joint=hinge(rate="1 m/s")), 'nodes.arm.joint.rate: "1 m/s" is a velocity'),
    "a free body on another": (
        {**arm(), "b": body(1, [1, 1, 1], {"kind": "free", "on": "arm"})},
        "nodes.b.joint.on: is not valid for a free joint",
    ),
    "a joint on nothing": (arm(joint=hinge(on="am")), 'nodes.arm.joint.on: "am" is not a node'),
    "a joint on no point": (
        {**arm(), "b": body(1, [1, 1, 1], hinge(on="arm.bop"))}, 'arm has no point "bop"; its points are bob',
    ),
    "a place that is said twice": (
        {**arm(), "b": body(1, [1, 1, 1], hinge(on="arm.bob", at=[0, 0, 1]))},
        "b.joint.at: arm.bob gives the position already",
    ),
    "a rate of what is driven": (
        arm(joint=hinge(angle={"mean": 0, "amplitude": 1, "period": 1}, rate=1)),
        "joint.rate: has no effect, because angle is driven",
    ),
    "points of one number": (arm(points={"tip": [1, 2]}), "nodes.arm.points.tip: [1, 2] has 2 values; expected 3"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_body_gets_its_message(name):
    nodes, message = BAD[name]
    assert message in refusal_text(nodes)


def test_bodies_that_hang_in_a_loop_are_named():
    nodes = {
        name: body(1, [1, 1, 1], hinge(on=on)) for name, on in (("a", "c"), ("b", "a"), ("c", "b"))
    }
    found = refusal_text({**nodes, "d": body(1, [1, 1, 1], hinge(on="c"))})
    assert (
        "is carried by itself: a on c on b on a; remove `on` from one of these bodies" in found
        and found.count("is carried by itself") == 1
    )


CRANE = Crane()
LINKS = {
    "beyond its stroke": (
        CRANE.links(closed_length=0.0),
        "links.lift.stroke: the piston starts at 0.353553 m",
    ),
    "an unknown point": (
        CRANE.links(ports={"case": "ground.lug", "rod": "boom.eyes"}),
        'no place named "boom.eyes"; places are',
    ),
    "a mass and a point": (
        {"s": {"type": "spring", "from": "ground", "to": "boom.eye", "stiffness": 1}},
        '"ground" is a place on the axis of masses, "boom.eye" a place in space',
    ),
    "a force without direction": (
        {"f": {"type": "force", "to": "boom.eye", "force": 1}},
        "direction is missing",
    ),
    "a torque without axis": (
        {"t": {"type": "torque", "to": "boom", "torque": 1}},
        "axis is missing",
    ),
    "points in one place": (
        {"s": {"type": "spring", "from": "ground.top", "to": "boom", "stiffness": 1}},
        "coincide at the start",
    ),
    "a pipe to a point": (
        {"p": {"type": "valve", "from": "boom.eye", "to": "boom.tip", "area": 1}},
        '"boom.eye" is a point, a spatial place, and this port of a valve needs a hydraulic place',
    ),
}


@pytest.mark.parametrize("name", LINKS)
def test_a_link_between_points_gets_its_message(name):
    links, message = LINKS[name]
    nodes = CRANE.nodes()
    nodes["ground"]["points"]["top"] = [0, 0, 0]
    assert message in refusal_text(nodes, links)


def test_an_open_loop_is_reported_with_its_gap_and_a_redundant_loop_with_its_pin():
    nodes, links = parallelogram()
    nodes["two"]["joint"]["at"] = [1.6, 0, 0]
    assert (
        "links.loop: two.end and coupler.end lie 0.1 m apart across the axis of the pin at the start"
        in refusal_text(nodes, links)
    )
    nodes, links = parallelogram()
    del links["loop"]["axis"]
    text = "links.loop: this pin is redundant: in some direction joints or other pins already hold its two points"
    assert text in refusal_text(nodes, links)
    nodes, links = parallelogram()
    nodes["two"]["joint"]["rate"] = 0.5
    assert (
        "links.loop: velocities at the start separate the two points of this pin at"
        in refusal_text(nodes, links)
    )


def test_a_pin_that_opens_across_its_axis_in_a_single_direction_is_refused():
    straight = {f"nodes.{name}.joint.angle": 0.0 for name in ("one", "two", "coupler")}
    with pytest.raises(
        CaseError,
        match="loop: velocities at the start separate the two points of this pin at 1.5 m/s",
    ):
        fvsolve.build(fvsolve.load("four-bar", straight | {"nodes.coupler.joint.rate": 1.0}))


def test_a_probe_that_a_joint_has_not_is_refused():
    found = refusal_text(arm(), probes=["arm.travel", "arm.bob.roll", "arm.bop.x"])
    assert (
        'arm is a body, which has no "travel"' in found
        and 'arm.bob is a point, which has no "roll"' in found
    )
    assert 'no part named "arm.bop"' in found


def test_all_faults_of_bodies_are_reported_at_once():
    found = refusal_text(
        {
            **arm(mass=0, inertia=[1, 1, 9]),
            "b": body(1, [1, 1, 1], {"kind": "revolute", "on": "nobody"}),
        }
    )
    for message in ("mass", "are not possible", "axis is missing"):
        assert message in found


def test_a_faulty_body_is_no_fault_of_parts_that_name_it():
    """Bodies on it or on its points, links between points, tanks and basins on it, and probes add no faults."""
    nodes = {
        **arm(mass=0),
        "b": body(1, [1, 1, 1], hinge(on="arm.bob")),
        "c": body(1, [1, 1, 1], hinge(on="arm")),
        **{
            one: {"type": "tank", "on": "arm", "at": [0, y, 1], "area": 1.0, "level": 1.0}
            for one, y in (("p", 1), ("q", -1))
        },
        "pool": {"type": "basin", "on": "arm", "size": [1, 1], "cells": [2, 2], "level": 1.0},
        "ground": {"type": "frame", "points": {"eye": [0, 0, 3]}},
    }
    links = {
        "s": {"type": "spring", "from": "ground.eye", "to": "arm.bob", "stiffness": 1.0},
        "pin": {"type": "pin", "from": "ground.eye", "to": "arm.bob"},
        "duct": {"type": "rigid-column", "from": "p", "to": "q", "length": 2.0, "diameter": 0.1},
    }
    found = refusal_text(nodes, links, ["arm.x", "arm.bob.x", "b.angle"])
    assert found == "case: 1 fault\n  nodes.arm.mass: 0 is out of range; expected a value above 0"


def test_an_axis_that_is_not_of_unit_length_is_divided_by_it_and_noted():
    model = fvsolve.build(fvsolve.load(bodies(arm(joint=hinge(axis=[0, 2, 0], angle=1.0)), 1.0)))
    assert [one.key for one in model.warnings] == ["joint.axis"] and "not 1" in model.warnings[
        0
    ].text
    assert motion_of(model).body_table[0]["axis"].tolist() == [0.0, 1.0, 0.0]


def test_motion_at_the_start_is_reported():
    case = bodies(arm(joint=hinge(angle=1.0, rate=2.0)), 1.0)
    model = fvsolve.build(fvsolve.load(case))
    assert model.steady["moving"] == [
        "body arm turns at 2 rad/s",
        "body arm accelerates at 11.79 rad/s2",
    ]
    case["numerics"]["initial"] = "equilibrium"
    with pytest.raises(
        CaseError, match="expects that nothing moves, but body arm turns at 2 rad/s"
    ):
        fvsolve.build(fvsolve.load(case))


def test_a_case_of_bodies_reads_back_as_itself():
    case = fvsolve.load(
        Crane().case(1.0, ["boom.angle"], joint={"attitude": {"yaw": 0.3}, "rate": 0.1})
    )
    import tomllib

    again = fvsolve.load(tomllib.loads(case.resolved()))
    assert again == case


ALL = """
schema = 1
[fluid]
name = "user"
density = 1000
bulk_modulus = 2e9
[nodes.ground]
type = "frame"
points = { lug = [0, 0, 0], far = [3, 0, 0] }
[nodes.arm]
type = "body"
mass = 0
inertia = ["1 kg m", 1, 9]
joint = { kind = "revolute" }
[nodes.boom]
type = "body"
mass = 10
inertia = [1, 1, 9]
joint = { kind = "revolute", axis = [0, 2, 0] }
[nodes.a]
type = "body"
mass = 1
inertia = [1, 1, 1]
joint = { on = "b", kind = "revolute", axis = [0, 0, 1] }
[nodes.b]
type = "body"
mass = 1
inertia = [1, 1, 1]
joint = { on = "a", kind = "revolute", axis = [0, 0, 1] }
[nodes.c]
type = "body"
mass = 1
inertia = [1, 1, 1]
joint = { kind = "fixed", attitude = { matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 2]] } }
[nodes.pool]
type = "basin"
size = [1, 1]
cells = [4, 4]
level = 0.5
on = "boon"
elevation = 3
[nodes.flume]
type = "basin"
size = [1, 1]
cells = [4, 4]
level = 0.5
patches = { lid = { side = "west", travel = { start = 0, duration = 1, value = [0, 1.5] } } }
[links.lift]
type = "cylinder"
ports = { case = "ground.lug", rod = "ground.far" }
stroke = 1
area_A = 1e-3
area_B = 1e-3
dead_volume_A = 1e-3
dead_volume_B = 1e-3
[links.s]
type = "spring"
from = "ground.lug"
to = "boom.eye"
stiffness = 1
[numerics]
end = 2
step = 0.01
"""
TOLD = """all.toml: 11 faults
  line 11: nodes.arm.mass: 0 is out of range; expected a value above 0
  line 12: nodes.arm.inertia[0]: "1 kg m" is a quantity of [kg·m]; expected a moment of inertia, for example "12 kg m2"
  line 13: nodes.arm.joint: axis is missing: a revolute joint needs it, for example [0, 1, 0]
  line 17: nodes.boom.inertia: moments of 1, 1, 9 kg m2 are not possible: the largest exceeds the sum of the other two
  line 23: nodes.a.joint.on: is carried by itself: a on b on a; remove `on` from one of these bodies and close the loop by a pin
  line 33: nodes.c.joint.attitude.matrix: is not a rotation: R'R differs from the identity by 3; expected orthogonal columns of length 1
  line 39: nodes.pool.on: "boon" is not a node; expected a body: a, arm, b, boom, c; did you mean "boom"?
  line 40: nodes.pool.elevation: has no effect on a body; give the position in the axes of boon as `at`, and remove this key
  line 46: nodes.flume.patches.lid.travel: moves the wall 1.5 m inward in a zone 1 m wide; expected less travel, or a wider zone
  line 50: links.lift.stroke: the piston starts at 3 m (distance from ground.lug to ground.far); expected 0 to 1 m
  line 58: links.s.to: no place named "boom.eye"; places are a, arm, b, boom, c, flume.lid, ground, ground.far, ground.lug, lift.A, lift.B; did you mean "boom"?"""  # noqa: E501


def test_all_faults_of_moving_parts_are_reported_at_once_with_their_lines_and_nothing_else(
    tmp_path,
):
    (tmp_path / "all.toml").write_text(ALL.lstrip())
    assert str(refused(tmp_path / "all.toml")) == TOLD


SCENE = """\
[fluid]
name = "user"
density = 870
bulk_modulus = "1.2 GPa"
viscosity = "32 cSt"

[nodes.pump]
type = "reservoir"
pressure = "100 barg"

[nodes.sump]
type = "reservoir"
pressure = "0 barg"

[nodes.load]
type = "mass"
mass = "50 kg"
initial_position = "100 mm"

[nodes.ground]
type = "frame"

[links.cyl]
type = "cylinder"
ports = { rod = "load", case = "ground" }
stroke = "200 mm"
piston_diameter = "40 mm"
rod_diameter = "25 mm"
dead_volume_A = "50 cm3"
dead_volume_B = "50 cm3"
leakage = "0.01 l/min/bar"

[links.spool]
type = "spool-valve"
ports = { P = "pump", T = "sump", A = "cyl.A", B = "cyl.B" }
area = "20 mm2"
position = { time = [0, 0.01, 0.03], value = [0, 0.5, -0.5] }

[links.spring]
type = "spring"
from = "ground"
to = "load"
stiffness = "20 N/mm"
free_length = "100 mm"

[links.brake]
type = "damper"
from = "ground"
to = "load"
damping = "0.1 N s/mm"

[links.stop]
type = "end-stop"
from = "ground"
to = "load"
minimum = "1 mm"
maximum = "199 mm"
stiffness = "50 kN/mm"
damping = 1e4

[links.push]
type = "force"
to = "load"
force = "-1.5 kN"

[numerics]
end = 0.05

[output]
probes = ["cyl.A.pressure", "cyl.force", "load.position", "spool.flow_P"]
"""


def test_the_scene_is_read_in_si_and_reads_back_as_itself():
    case = load_text(SCENE)
    cylinder = case.links["cyl"]
    assert cylinder.areas() == pytest.approx((1.25663706e-3, 7.65763213e-4))
    assert case.places["cyl.B"].volume == pytest.approx(50e-6 + 7.65763213e-4 * 0.1)
    assert cylinder.leakage == pytest.approx(1e-5 / 60 / 1e5)
    assert [case.links[name].ports for name in ("push", "spring")] == [
        {"to": "load"},
        {"from": "ground", "to": "load"},
    ]
    assert [probe.dimension for probe in case.probes] == ["pressure", "force", "position", "flow"]
    assert load_text(case.resolved()) == case


def test_no_probes_means_bodies_chambers_and_forces_too():
    found = [probe.text for probe in load_text(SCENE[: SCENE.index("[output]")]).probes]
    for wanted in (
        "cyl.A.pressure",
        "load.velocity",
        "ground.position",
        "spool.flow_B",
        "cyl.force",
        "stop.force",
    ):
        assert wanted in found


def load_text(text: str):
    import tomllib

    return load(tomllib.loads(text))


def swap(old: str, new: str) -> str:
    assert old in SCENE, old
    return SCENE.replace(old, new, 1)


SPOOL = 'ports = { P = "pump", T = "sump", A = "cyl.A", B = "cyl.B" }'
BAD_MECHANICS = {
    "a rod on a reservoir": (
        swap('rod = "load"', 'rod = "pump"'),
        'links.cyl.ports.rod: "pump" is a reservoir, a hydraulic place, and this port of a cylinder '
        "needs a translational or spatial place; "
        "translational or spatial places are ground, load",
    ),
    "a spool on a mass": (
        swap('A = "cyl.A"', 'A = "load"'),
        'links.spool.ports.A: "load" is a mass, a translational place, and this port of a spool-valve '
        "needs a hydraulic place; "
        "hydraulic places are cyl.A, cyl.B, pump, sump",
    ),
    "a spring on a chamber": (
        swap('from = "ground"', 'from = "cyl.A"'),
        'links.spring.from: "cyl.A" is a chamber, a hydraulic place, and this port of a spring '
        "needs a translational or spatial place",
    ),
    "a cylinder for its chamber": (
        swap('"cyl.A"', '"cyl"'),
        '"cyl" is a cylinder; its places are cyl.A, cyl.B',
    ),
    "no such chamber": (
        swap('"cyl.A"', '"cyl.C"'),
        'no place named "cyl.C"; places are cyl.A, cyl.B, ground, load',
    ),
    "two ports at a place": (
        swap('A = "cyl.A"', 'A = "pump"'),
        'links.spool.ports.A: joins "pump" to itself',
    ),
    "rod and case alike": (
        swap('case = "ground"', 'case = "load"'),
        'links.cyl.ports.case: joins "load" to itself',
    ),
    "a port too few": (swap(', B = "cyl.B"', ""), "links.spool.ports: B is missing"),
    "a port too many": (
        swap(', B = "cyl.B"', ', B = "cyl.B", X = "pump"'),
        "links.spool.ports.X: unknown key",
    ),
    "ports that are none": (
        swap(SPOOL, "ports = 3"),
        'links.spool.ports: 3 is not a table; expected { P = "...", T =',
    ),
    "no ports": (swap(SPOOL, ""), "links.spool: ports is missing"),
    "from and to": (swap(SPOOL, 'from = "pump"'), "links.spool.from: unknown key; keys are "),
    "a force for a stiffness": (
        swap('"20 N/mm"', '"20 N"'),
        'links.spring.stiffness: "20 N" is a force; expected a stiffness, for example "50 N/mm"',
    ),
    "a pressure for a force": (
        swap('"-1.5 kN"', '"3 bar"'),
        '"3 bar" is a pressure; expected a force',
    ),
    "a length for a damping": (
        swap('"0.1 N s/mm"', '"3 m"'),
        '"3 m" is a length; expected a damping',
    ),
    "a flow for a leakage": (
        swap('"0.01 l/min/bar"', '"1 l/min"'),
        'links.cyl.leakage: "1 l/min" is a flow; expected a leakage, for example "0.1 l/min/bar"',
    ),
    "a volume for a mass": (
        swap('"50 kg"', '"50 l"'),
        'nodes.load.mass: "50 l" is a volume; expected a mass',
    ),
    "a piston outside": (
        swap('"100 mm"', '"300 mm"'),
        "links.cyl.stroke: the piston starts at 0.3 m (distance from ground to load); expected 0 to 0.2 m",
    ),
    "no area": (
        swap('piston_diameter = "40 mm"', ""),
        "links.cyl: area_A or piston_diameter is missing",
    ),
    "no area at B": (
        swap('rod_diameter = "25 mm"', ""),
        "links.cyl: area_B or rod_diameter is missing",
    ),
    "two areas": (
        swap('piston_diameter = "40 mm"', 'piston_diameter = "40 mm"\narea_A = 1'),
        "area_A and piston_diameter are given; keep one",
    ),
    "an area and a rod": (
        swap('piston_diameter = "40 mm"', "area_A = 1"),
        "links.cyl.rod_diameter: needs the key `piston_diameter`; with `area_A` give `area_B` instead",
    ),
    "a rod too thick": (
        swap('"25 mm"', '"40 mm"'),
        "links.cyl.rod_diameter: leaves no area at B; expected a diameter below",
    ),
    "no dead volume": (
        swap('dead_volume_A = "50 cm3"', "dead_volume_A = 0"),
        "0 is out of range; expected a value above",
    ),
    "a vacuum": (
        swap("[links.spool]", 'initial_pressure_A = "0 bar"\n[links.spool]'),
        'links.cyl.initial_pressure_A: "0 bar" is absolute, a vacuum; did you mean "0 barg"?',
    ),
    "a spool beyond 1": (
        swap("0.5, -0.5]", "0.5, -1.5]"),
        "links.spool.position.value[2]: -1.5 is out of range; expected a value between -1 and 1",
    ),
    "free length and preload": (
        swap('free_length = "100 mm"', 'free_length = "100 mm"\npreload = "3 N"'),
        "free_length and preload are given; keep one",
    ),
    "a spring backwards": (
        swap('from = "ground"\nto = "load"', 'from = "load"\nto = "ground"'),
        "links.spring.to: ground is behind load at the start; exchange the keys `from` and `to`",
    ),
    "a stop without a side": (
        swap('minimum = "1 mm"\nmaximum = "199 mm"', ""),
        "links.stop: expected one of minimum, maximum",
    ),
    "a stop without room": (
        swap('"199 mm"', '"1 mm"'),
        "links.stop.maximum: 0.001 m is not above `minimum`, 0.001 m",
    ),
    "a force on nothing": (swap('to = "load"\nforce', "force"), "links.push: to is missing"),
    "a loose mass": (
        swap("[nodes.ground]", '[nodes.m]\ntype = "mass"\nmass = 1\n[nodes.ground]'),
        "no link touches it",
    ),
    "an elevation missing": (
        swap('"100 barg"', '"100 barg"\nelevation = 1').replace(
            '"0 barg"', '"0 barg"\nelevation = 1'
        ),
        "links.cyl: elevation is missing, but stated for pump, sump",
    ),
    "a pressure of a mass": (
        swap('"load.position"', '"load.pressure"'),
        'load is a mass, which has no "pressure"; it has position, velocity',
    ),
    "a flow of a cylinder": (
        swap('"cyl.force"', '"cyl.flow"'),
        'cyl is a cylinder, which has no "flow"; it has force, position, velocity',
    ),
    "a chamber's probe misspelt": (
        swap('"cyl.A.pressure"', '"cyl.A.presure"'),
        'did you mean "pressure"?',
    ),
    "a mass among links": (swap('type = "damper"', 'type = "mass"'), "it belongs under [nodes]"),
}


@pytest.mark.parametrize("name", BAD_MECHANICS)
def test_a_bad_file_gets_its_message(name, tmp_path):
    text, message = BAD_MECHANICS[name]
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    assert message in str(refused(tmp_path / "scene.toml"))


def test_a_case_without_masses_loads_none_of_their_kernels(tmp_path):
    """A case without masses does not import `mass_dynamics` and has no states of masses."""
    import subprocess
    import sys

    code = (
        "import sys, fvsolve; result = fvsolve.run('cases/chamber-and-orifice.toml');"
        "ends = 'motion.lower', 'mass_dynamics';"
        "print([name for name in sys.modules if name.endswith(ends)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    model = fvsolve.build(fvsolve.load("cases/chamber-and-orifice.toml"))
    assert model.state_names == ["bottle.mass"]
