"""Cylinders, masses and spool valves in a case file: values as read, and a bad file for each message."""

from __future__ import annotations

import pytest

import fvsolve
from fvsolve.case import load
from fvsolve.errors import CaseError

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
    assert [case.links[name].ports for name in ("push", "spring")] == [{"to": "load"}, {"from": "ground", "to": "load"}]
    assert [probe.dimension for probe in case.probes] == ["pressure", "force", "position", "flow"]
    assert load_text(case.resolved()) == case


def test_no_probes_means_bodies_chambers_and_forces_too():
    found = [probe.text for probe in load_text(SCENE[: SCENE.index("[output]")]).probes]
    for wanted in ("cyl.A.pressure", "load.velocity", "ground.position", "spool.flow_B", "cyl.force", "stop.force"):
        assert wanted in found


def load_text(text: str):
    import tomllib

    return load(tomllib.loads(text))


def swap(old: str, new: str) -> str:
    assert old in SCENE, old
    return SCENE.replace(old, new, 1)


SPOOL = 'ports = { P = "pump", T = "sump", A = "cyl.A", B = "cyl.B" }'
BAD = {
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
    "a cylinder for its chamber": (swap('"cyl.A"', '"cyl"'), '"cyl" is a cylinder; its places are cyl.A, cyl.B'),
    "no such chamber": (swap('"cyl.A"', '"cyl.C"'), 'no place named "cyl.C"; places are cyl.A, cyl.B, ground, load'),
    "two ports at a place": (swap('A = "cyl.A"', 'A = "pump"'), 'links.spool.ports.A: joins "pump" to itself'),
    "rod and case alike": (swap('case = "ground"', 'case = "load"'), 'links.cyl.ports.case: joins "load" to itself'),
    "a port too few": (swap(', B = "cyl.B"', ""), "links.spool.ports: B is missing"),
    "a port too many": (swap(', B = "cyl.B"', ', B = "cyl.B", X = "pump"'), "links.spool.ports.X: unknown key"),
    "ports that are none": (swap(SPOOL, "ports = 3"), 'links.spool.ports: 3 is not a table; expected { P = "...", T ='),
    "no ports": (swap(SPOOL, ""), "links.spool: ports is missing"),
    "from and to": (swap(SPOOL, 'from = "pump"'), "links.spool.from: unknown key; keys are "),
    "a force for a stiffness": (
        swap('"20 N/mm"', '"20 N"'),
        'links.spring.stiffness: "20 N" is a force; expected a stiffness, for example "50 N/mm"',
    ),
    "a pressure for a force": (swap('"-1.5 kN"', '"3 bar"'), '"3 bar" is a pressure; expected a force'),
    "a length for a damping": (swap('"0.1 N s/mm"', '"3 m"'), '"3 m" is a length; expected a damping'),
    "a flow for a leakage": (
        swap('"0.01 l/min/bar"', '"1 l/min"'),
        'links.cyl.leakage: "1 l/min" is a flow; expected a leakage, for example "0.1 l/min/bar"',
    ),
    "a volume for a mass": (swap('"50 kg"', '"50 l"'), 'nodes.load.mass: "50 l" is a volume; expected a mass'),
    "a piston outside": (
        swap('"100 mm"', '"300 mm"'),
        "links.cyl.stroke: the piston starts at 0.3 m (distance from ground to load); expected 0 to 0.2 m",
    ),
    "no area": (swap('piston_diameter = "40 mm"', ""), "links.cyl: area_A or piston_diameter is missing"),
    "no area at B": (swap('rod_diameter = "25 mm"', ""), "links.cyl: area_B or rod_diameter is missing"),
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
    "a stop without room": (swap('"199 mm"', '"1 mm"'), "links.stop.maximum: 0.001 m is not above `minimum`, 0.001 m"),
    "a force on nothing": (swap('to = "load"\nforce', "force"), "links.push: to is missing"),
    "a loose mass": (
        swap("[nodes.ground]", '[nodes.m]\ntype = "mass"\nmass = 1\n[nodes.ground]'),
        "no link touches it",
    ),
    "an elevation missing": (
        swap('"100 barg"', '"100 barg"\nelevation = 1').replace('"0 barg"', '"0 barg"\nelevation = 1'),
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
    "a chamber's probe misspelt": (swap('"cyl.A.pressure"', '"cyl.A.presure"'), 'did you mean "pressure"?'),
    "a mass among links": (swap('type = "damper"', 'type = "mass"'), "it belongs under [nodes]"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_gets_its_message(name, tmp_path):
    text, message = BAD[name]
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        load(tmp_path / "scene.toml")
    assert message in str(caught.value)


def test_what_has_no_masses_loads_none_of_their_kernels(tmp_path):
    """A case without masses does not import `mass_dynamics` and has no states of masses."""
    import subprocess
    import sys

    code = ("import sys, fvsolve; result = fvsolve.run('cases/chamber-and-orifice.toml');"
            "print([name for name in sys.modules"
            " if name.endswith(('mechanics_tables', 'mass_dynamics'))])")  # fmt: skip
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['fvsolve.model.mechanics_tables']"
    model = fvsolve.build(fvsolve.load("cases/chamber-and-orifice.toml"))
    assert model.state_names == ["bottle.mass"]
