"""Texts of case files."""

SCENE = """\
schema = 1
title = "A valve shuts"

[fluid]
name = "user"
density = 998
bulk_modulus = "2.2 GPa"
viscosity = 1e-3
vapor_pressure = 2339

[nodes.lake]
type = "reservoir"
head = "45.72 m"

[nodes.gate]
type = "junction"

[nodes.outfall]
type = "reservoir"
pressure = "0 barg"

[links.main]
type = "pipe"
from = "lake"
to = "gate"
length = "914.4 m"
diameter = "304.8 mm"
wave_speed = "1219.2 m/s"
friction = { model = "steady", roughness = "0.26 mm" }
cells = 200

[links.valve]
type = "valve"
from = "gate"
to = "outfall"
area = "0.001768 m2"
discharge_coefficient = 0.6
opening = { start = "1 s", duration = "0.05 s", value = [1.0, 0.0] }

[numerics]
end = "10 s"
courant = 0.9

[output]
probes = ["gate.pressure"]
"""
# The same scene with all settings of its scheme, its output and an expectation.
DETAILED = "\n" + SCENE
for plain, full in {
    'title = "A valve shuts"': 'title = "A valve shuts at the end of a 914 m main"',
    "density = 998": "density = 1000",
    "viscosity = 1e-3": 'viscosity = "1 cSt"',
    "vapor_pressure = 2339": 'vapor_pressure = "2339 Pa"',
    "courant = 0.9": 'scheme = "muscl"\nlimiter = "van-leer"\nmethod = "ssp-rk3"\ncourant = 0.9',
    'probes = ["gate.pressure"]': """\
every = "10 ms"
fields = 50
probes = ["gate.pressure", "gate.head", "valve.flow", "main.pressure@0.5"]

[expect]
"max(gate.pressure)" = { value = "1.0751 MPa", rtol = 1e-2 }""",
}.items():
    DETAILED = DETAILED.replace(plain, full)

TANK = """
[nodes.t]
type = "tank"
area = 1
level = 1
[links.hole]
type = "orifice"
from = "t"
to = "gate"
Kv = 1
"""
CHAMBER = TANK.replace("tank", "chamber").replace(
    "area = 1\nlevel = 1", 'volume = 1\ninitial_pressure = "0 bar"'
)


def two_tanks():
    return {
        "fluid": {"name": "user", "density": 1000, "bulk_modulus": 2e9},
        "nodes": {
            "a": {"type": "tank", "area": 1, "level": 2},
            "b": {"type": "tank", "area": 1, "level": 1},
        },
        "links": {"hole": {"type": "orifice", "from": "a", "to": "b", "area": 0.01}},
        "numerics": {"end": 10},
    }
