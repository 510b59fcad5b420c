"""Specimens: a small scene for each kind of part, each feature and each physics, for tests of generic properties.

Each scene takes few steps from a state that is not at rest. A new kind of part gets all properties of
`tests/invariance/test_specimens.py` by an entry here.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from reference.scenes import (
    AMBIENT,
    WATER,
    chamber,
    inflow,
    junction,
    lake,
    pipe,
    reservoir,
    scene,
    tank,
    valve,
)

PROPERTIES = (
    "ledger",
    "restated",
    "bits",
    "resumed",
    "linearised",
    "pattern",
    "implicit",
    "units",
    "order",
    "names",
)
WITH_REASON = {"linearised", "order"}  # properties that a specimen may lack, with the reason
# greatest differences of runs, over the greatest value of a quantity
NEAR = {"restated": 1e-9, "implicit": 1e-6}
ADAPTIVE = {"scheme": "upwind5", "method": "dormand-prince", "rtol": 1e-6}


@dataclass(frozen=True)
class Specimen:
    """Scene with its settings for the generic tests.

    step : greatest step of a method of second order for the observed order; halves and quarters follow [s]
    lacks : properties that are not defined for this scene, with the reason
    near : greatest differences of runs for some properties, over the greatest value of a quantity
    """

    case: dict
    step: float
    lacks: dict[str, str] = field(default_factory=dict)
    near: dict[str, float] = field(default_factory=lambda: NEAR)


SPECIMENS: dict[str, Specimen] = {}


def add(
    name: str,
    nodes: dict,
    links: dict,
    end: float,
    probes: Iterable[str],
    lacks=None,
    steps=20,
    near=None,
    **top,
) -> None:
    """Add a specimen; probes : "GROUP.NAME.QUANTITY"; steps : number of steps of the coarsest run for the order."""
    case = scene(nodes, links, end, ADAPTIVE | top.pop("numerics", {}), probes, end / 10, **top)
    assert name not in SPECIMENS and set(lacks or {}) <= WITH_REASON
    SPECIMENS[name] = Specimen(case, end / steps, lacks or {}, NEAR | (near or {}))


JUMPS = {"order": "an event within the run ends a step at a place that depends on the step"}
SWITCHES = {"linearised": "its action is an event without a slope", **JUMPS}
SIZE = {"area": 1e-3, "discharge_coefficient": 0.61}
ROUGH = {"model": "steady", "factor": 0.02}

# links between a reservoir and a chamber that a valve empties -------------------------------------------------------


def add_link(
    name: str, part: dict, lacks=None, ends=("high", "mid"), near=None, end=0.005, **nodes: dict
) -> None:
    """Add a specimen of a link; ends : its ends, or () for a part with ports of its own."""
    places = {"high": reservoir(4e5), "mid": chamber(0.5, 3e5), "low": reservoir(1.5e5), **nodes}
    part = part | dict(zip(("from", "to"), ends, strict=False))
    links = {"part": part, "drain": valve("mid", "low", 1e-3)}
    touched = {*part.get("ports", {}).values(), part.get("from"), part.get("to"), "mid", "low"}
    places = {key: node for key, node in places.items() if key in touched}
    probes = [
        "nodes.mid.pressure",
        "links.drain.flow",
        *([] if "ports" in part else ["links.part.flow"]),
    ]
    add(name, places, links, end, probes, lacks, 80, near)


HILL = [
    {
        "opening": 0.3,
        "unit_speed": [30, 70, 110],
        "unit_flow": [0.32, 0.3, 0.2],
        "efficiency": [0.6, 0.8, 0.1],
    },
    {
        "opening": 1.0,
        "unit_speed": [110, 70, 30],
        "unit_flow": [0.7, 1.0, 1.05],
        "efficiency": [0.2, 0.9, 0.6],
    },
]
SLOW = {"time_constant": 0.05}
AT_LIMIT = {"linearised": "its opening starts at the end of its range"}
add_link("orifice", {"type": "orifice", **SIZE})
add_link(
    "valve",
    {"type": "valve", **SIZE, "opening": {"start": 0.0, "duration": 0.005, "value": [0.2, 0.9]}},
)
add_link("check-valve", {"type": "check-valve", **SIZE})
add_link(
    "check-valve-with-disc",
    {"type": "check-valve", **SIZE, "time_constant": 0.05, "overpressure": 2e5},
)
add_link(
    "relief-valve", {"type": "relief-valve", **SIZE, "set_pressure": 3.5e5, "overpressure": 1e5}
)
add_link(
    "relief-valve-with-disc",
    {
        "type": "relief-valve",
        **SIZE,
        "set_pressure": 3e5,
        "overpressure": 3e5,
        "natural_frequency": 20.0,
        "damping_ratio": 0.7,
    },
)
add_link(
    "counterbalance",
    {
        "type": "counterbalance",
        **SIZE,
        "set_pressure": 5e5,
        "overpressure": 5e5,
        "pilot": "high",
        "pilot_ratio": 1.0,
    },
)
add_link("pilot-check", {"type": "pilot-check", **SIZE, "pilot": "high", "pilot_ratio": 2.0})
add_link(
    "pressure-compensator",
    {
        "type": "pressure-compensator",
        **SIZE,
        "set_drop": 1e5,
        "overpressure": 2e5,
        "senses": ["high", "mid"],
    },
    AT_LIMIT,
)
add_link("loss-curve", {"type": "loss-curve", "loss": {"flow": [0.01], "drop": [5e4]}})
add_link("rupture-disc", {"type": "rupture-disc", **SIZE, "burst_pressure": 6e5}, end=0.001)
add_link(
    "surge-anticipating",
    {
        "type": "surge-anticipating",
        **SIZE,
        "trip": 0.001,
        "low_set": 1e5,
        "opening_time": 0.002,
        "closing_time": 0.002,
    },
    SWITCHES,
    ("mid", "low"),
    {"implicit": 1e-5},
)
add_link(
    "pressure-reducing",
    {"type": "pressure-reducing", **SIZE, **SLOW, "set_pressure": 2.5e5},
    AT_LIMIT,
)
add_link(
    "pressure-sustaining",
    {"type": "pressure-sustaining", **SIZE, **SLOW, "set_pressure": 3.5e5},
    AT_LIMIT,
)
add_link("flow-control", {"type": "flow-control", **SIZE, **SLOW, "set_flow": 5e-3})
add_link("pump", {"type": "pump", "curve": {"flow": [0.01], "head": [20.0]}}, None, ("low", "mid"))
add_link(
    "pump-trip",
    {
        "type": "pump",
        "curve": {"flow": [0.01], "head": [20.0]},
        "rated_speed": 150.0,
        "inertia": 0.05,
        "trip": 0.0,
    },
    None,
    ("low", "mid"),
)
add_link(
    "pumps-in-parallel",
    {
        "type": "pump",
        "count": 3,
        "curve": {"flow": [0.004], "head": [20.0]},
        "rated_speed": 150.0,
        "inertia": 0.02,
        "trip": 0.0,
    },
    None,
    ("low", "mid"),
)
add_link("turbine", {"type": "turbine", "diameter": 0.05, "speed": 100.0, "hill_chart": HILL})
for kind in ("pump", "motor"):
    machine = {
        "type": f"displacement-{kind}",
        "displacement": 1e-5,
        "speed": 100.0,
        "leakage": 1e-8,
    }
    add_link(
        f"displacement-{kind}", machine, None, ("low", "mid") if kind == "pump" else ("high", "mid")
    )
add_link("hydrant", {"type": "hydrant", "flow": 1e-3, "from": "mid"}, None, (), end=0.001)
add_link("leak", {"type": "leak", "coefficient": 1e-5, "from": "mid"}, None, (), end=0.001)
add_link(
    "spool-valve",
    {
        "type": "spool-valve",
        **SIZE,
        "command": 0.5,
        "natural_frequency": 30.0,
        "damping_ratio": 0.7,
        "ports": {"P": "high", "T": "low", "A": "mid", "B": "side"},
    },
    None,
    (),
    side=chamber(0.3, 2e5),
)
add_link(
    "shuttle",
    {"type": "shuttle", **SIZE, "ports": {"A": "high", "B": "low", "out": "mid"}},
    None,
    (),
)

# nodes --------------------------------------------------------------------------------------------------------------


def add_node(name: str, node: dict, quantity="pressure", lacks=None) -> None:
    """Add a specimen of a node between a reservoir and a chamber."""
    nodes = {
        "high": reservoir(4e5),
        "part": node,
        "mid": chamber(0.5, 3e5),
        "low": reservoir(1.5e5),
    }
    links = {
        "in": valve("high", "part", 1e-3),
        "out": valve("part", "mid", 1e-3),
        "drain": valve("mid", "low", 1e-3),
    }
    add(
        name,
        nodes,
        links,
        0.005,
        [f"nodes.part.{quantity}", "nodes.mid.pressure", "links.out.flow"],
        lacks,
        80,
    )


GAS = {"type": "accumulator", "volume": 0.02}
add_node("junction", junction({"start": 0.0, "duration": 0.005, "value": [1e-3, 4e-3]}))
add_node("inflow", inflow(2e-3))
add_node("chamber", chamber(0.3, 3.5e5))
add_node(
    "tank", tank(0.5, 25.0, connection={"area": 1e-3, "loss_in": 2.0, "loss_out": 1.0}), "level"
)
add_node("accumulator", {**GAS, "gas_volume": 0.005, "initial_pressure": 3.5e5})
add_node("bladder", {**GAS, "precharge": 1.5e5, "initial_pressure": 3.5e5, "exponent": 1.3})
add_node("air-valve", {"type": "air-valve", "inlet": 0.05, "outlet": 0.02})

# tanks with free surfaces -------------------------------------------------------------------------------------------


def add_tanks(name: str, part: dict, lacks=None, levels=(2.0, 0.5), end=2.0, **keys) -> None:
    nodes = {
        "high": tank(2.0, levels[0], elevation=0.0),
        "low": tank(1.0, levels[1], elevation=0.0),
    }
    probes = ["nodes.high.level", "nodes.low.level", "links.part.flow"]
    add(name, nodes, {"part": part | {"from": "high", "to": "low"}}, end, probes, lacks, **keys)


CULVERT = {
    "type": "culvert",
    "diameter": 0.3,
    "length": 5.0,
    "manning": 0.012,
    "inverts": [0.2, 0.1],
    "inlet": "circular-concrete-square-edge",
}
add_tanks("weir", {"type": "weir", "width": 0.1, "crest": 1.0})
add_tanks("sluice-gate", {"type": "sluice-gate", "width": 0.1, "sill": 0.0, "opening": 0.1})
add_tanks("culvert", CULVERT, {"order": "regimes of a culvert join with kinks"})
add_tanks("manhole", {"type": "manhole", "crest": 1.0, "area": 1e-2, "perimeter": 0.4})
add_tanks(
    "rigid-column",
    {"type": "rigid-column", "length": 20.0, "diameter": 0.1, "friction": ROUGH},
    end=2.0,
)
add_tanks(
    "altitude-valve",
    {"type": "altitude-valve", "diameter": 0.2, "loss_coefficient": 50.0, "full_level": 1.9},
)
QUICK = {"type": "pipe", "pipe_model": "quasi-steady", "length": 50.0, "diameter": 0.1}
for model, value in {
    "steady": {"factor": 0.02},
    "hazen-williams": {"coefficient": 110.0},
    "chezy-manning": {"coefficient": 0.012},
    "swamee-jain": {"roughness": 1e-4},
    "quasi-steady": {"roughness": 1e-4},
}.items():
    add_tanks(
        f"{model}-pipe-without-waves",
        QUICK | {"friction": {"model": model, **value}, "minor_loss": 2.0},
    )

# pipes with waves ---------------------------------------------------------------------------------------------------


def add_pipe(
    name: str, friction=ROUGH, numerics=None, lacks=None, fluid=None, near=None, **keys
) -> None:
    nodes = {"high": tank(1.0, 40.0, elevation=0.0), "end": chamber(0.5, 4e5, elevation=1.0)}
    links = {"p": pipe("high", "end", 60.0, 0.2, 1000.0, 5, friction=friction) | keys}
    links["p"] = {key: value for key, value in links["p"].items() if value is not None}
    probes = ["nodes.end.pressure", "links.p.flow", "links.p.flow@1", "links.p.pressure@0.37"]
    add(
        name,
        nodes,
        links,
        0.3,
        probes,
        lacks,
        400,
        near,
        numerics=numerics or {},
        fluid=fluid or WATER,
    )


LIMITED = {"linearised": "a limiter has no derivative", "order": "a limiter has kinks"}
add_pipe("pipe")
add_pipe("pipe-quasi-steady-friction", {"model": "quasi-steady", "roughness": 1e-4})
add_pipe(
    "pipe-profile",
    minor_loss=2.0,
    profile={"chainage": [0.0, 30.0, 60.0], "elevation": [0.0, 3.0, 1.0]},
)
for scheme in ("upwind", "upwind3", "fromm", "linear-upwind", "central"):
    add_pipe(f"pipe-{scheme}", numerics={"scheme": scheme})
for scheme in ("muscl", "weno5"):  # a limiter amplifies rounding up to the tolerance of steps
    add_pipe(
        f"pipe-{scheme}",
        numerics={"scheme": scheme},
        lacks=LIMITED,
        near={"restated": 1e-4, "implicit": 1e-4},
    )
add_pipe("pipe-log-law", fluid=WATER | {"law": "log"})
add_pipe(
    "pipe-mixture-law",
    numerics={"scheme": "upwind"},
    fluid=WATER | {"law": "mixture", "air_fraction": 1e-3},
)
add_pipe("pipe-table-law", fluid={"name": "Water", "temperature": 293.15, "law": "table"})
add_pipe(
    "pipe-creep",
    wave_speed=None,
    wall={
        "youngs_modulus": 1.43e9,
        "thickness": 0.02,
        "creep": {"compliance": [1e-10, 2e-10], "time": [0.05, 0.5]},
    },
)
add_pipe("pipe-unsteady-friction", {"model": "unsteady", "roughness": 0.0})

# scalars, reactions, heat -------------------------------------------------------------------------------------------


def add_scalars(name: str, scalars: dict, inside: dict, lacks=None, **top) -> None:
    first = next(iter(scalars))
    nodes = {"high": tank(1.0, 3.0, scalars=inside), "low": tank(0.5, 1.0)}
    probes = [f"nodes.{node}.{scalar}" for node in nodes for scalar in scalars] + ["links.v.flow"]
    add(name, nodes, {"v": valve("high", "low", 0.01)}, 10.0, probes, lacks, scalars=scalars, **top)
    assert first in inside


add_scalars(
    "scalar", {"dye": {"unit": "g/l", "initial": 0.2, "decay": 0.05, "ambient": 0.1}}, {"dye": 1.0}
)
add_scalars(
    "reactions",
    {
        name: {"unit": "mol/m3", "initial": value}
        for name, value in {"A": 1.0, "B": 2.0, "P": 0.0}.items()
    },
    {"A": 2.0},
    reactions={"pair": {"equation": "A + B -> P", "forward": 0.05, "reverse": 0.01}},
)
SALT = {"dye": {"unit": "g/l", "initial": 0.2, "decay": 0.05}}
add(
    "scalar-in-pipe",
    {"high": tank(1.0, 40.0, scalars={"dye": 1.0}), "mid": junction(), "low": tank(1.0, 38.0)},
    {"p": pipe("high", "mid", 20.0, 0.2, 40.0, 4, friction=ROUGH), "v": valve("mid", "low", 0.01)},
    2.0,
    ["nodes.low.dye", "nodes.mid.dye", "links.v.flow"],
    steps=100,
    scalars=SALT,
)
WARM = {
    "temperature": {
        "heat": True,
        "specific_heat": 1900.0,
        "unit": "degC",
        "initial": 40.0,
        "heat_from": ["v"],
    }
}
add(
    "heat",
    {
        "high": tank(1.0, 3.0),
        "low": tank(0.5, 1.0),
        "air": {"type": "ambient", "temperature": 290.0},
    },
    {
        "v": valve("high", "low", 0.01),
        "cooler": {"type": "heat-exchanger", "from": "low", "to": "air", "conductance": 5e4},
    },
    10.0,
    ["nodes.low.temperature", "links.cooler.heat", "links.v.flow"],
    scalars=WARM,
)

# controls -----------------------------------------------------------------------------------------------------------


def add_control(name: str, controls: dict, lacks=None) -> None:
    """Add a specimen of blocks; "act" drives the inlet of a tank."""
    nodes = {"source": lake(20.0), "tower": tank(1.0, 4.0), "town": reservoir(AMBIENT)}
    links = {
        "inlet": valve("source", "tower", 2e-2, {"control": "act"}),
        "outlet": valve("tower", "town", 2e-2, 0.5),
    }
    probes = ["nodes.tower.level", *(f"controls.{block}.output" for block in controls)]
    add(name, nodes, links, 20.0, probes, lacks, 160, controls=controls)


LEVEL = {
    "input": "tower.level",
    "setpoint": 5.0,
    "gain": 0.2,
    "integral_time": 20.0,
    "initial": 0.3,
}
FORMULA = {"type": "function", "inputs": {"h": "tower.level"}, "formula": "0.8 - 0.1*h"}
add_control("pi", {"act": {"type": "pi", **LEVEL}})
add_control("pid", {"act": {"type": "pid", **LEVEL, "derivative_time": 2.0}})
add_control("function", {"act": FORMULA})
add_control(
    "table",
    {
        "act": {
            "type": "table",
            "input": "tower.level",
            "table": {"input": [0.0, 5.0, 10.0], "output": [0.9, 0.4, 0.1]},
        }
    },
)
add_control(
    "transfer-function",
    {
        "act": {
            "type": "transfer-function",
            "input": "controls.law",
            "numerator": [1.0],
            "denominator": [3.0, 1.0],
        },
        "law": FORMULA,
    },
)
add_control(
    "rate-limit",
    {
        "act": {
            "type": "rate-limit",
            "input": "controls.law",
            "rising": 1.0,
            "falling": 1.0,
            "time_constant": 2.0,
        },
        "law": FORMULA,
    },
)
PAST = {
    "linearised": "a delay has no finite matrix",
    "order": "histories of a delay are polynomials",
}
add_control(
    "delay", {"act": {"type": "delay", "input": "controls.law", "delay": 3.0}, "law": FORMULA}, PAST
)
RELAY = {"type": "relay", "input": "tower.level", "on": 4.5, "off": 5.0, "initial": 1}
add_control("relay", {"act": RELAY}, JUMPS)
add_control(
    "latch",
    {
        "act": {"type": "latch", "set": "controls.low", "reset": "controls.high", "initial": 0},
        "low": {**FORMULA, "formula": "5 - h"},
        "high": {**FORMULA, "formula": "h - 5.5"},
    },
    JUMPS,
)
add_control(
    "timer",
    {
        "act": {"type": "timer", "input": "controls.low", "on_delay": 3.0, "off_delay": 3.0},
        "low": {**FORMULA, "formula": "5 - h"},
    },
    JUMPS,
)

# delay lines --------------------------------------------------------------------------------------------------------

LINE = {"order": "a delay line is exact or interpolates its history"}
add_pipe("delay-line", ROUGH, {"pipe_model": "delay-line"}, LINE, near={"implicit": 1e-2}, cells=1)

# masses on an axis, and bodies --------------------------------------------------------------------------------------

WALL, LOAD = (
    {"type": "frame"},
    {"type": "mass", "mass": 2.0, "initial_position": 0.1, "initial_velocity": 0.5},
)


def add_mass(
    name: str, links: dict, lacks=None, end=0.2, steps=50, probes=(), nodes=None, **top
) -> None:
    """Add a specimen of a mass that moves along an axis."""
    links = {
        key: {"from": "wall", "to": "load", **link} if "ports" not in link else link
        for key, link in links.items()
    }
    listed = ["nodes.load.position", "nodes.load.velocity", *probes]
    add(name, {"wall": WALL, "load": LOAD} | (nodes or {}), links, end, listed, lacks, steps, **top)


SPRING = {"type": "spring", "stiffness": 200.0, "free_length": 0.05}
add_mass("spring", {"s": SPRING})
add_mass("damper", {"s": SPRING, "d": {"type": "damper", "damping": 10.0}})
add_mass(
    "force",
    {
        "s": SPRING,
        "f": {"type": "force", "force": {"start": 0.0, "duration": 0.2, "value": [0.0, 20.0]}},
    },
)
add_mass(
    "end-stop",
    {"s": SPRING, "e": {"type": "end-stop", "stiffness": 1e4, "damping": 20.0, "maximum": 0.12}},
    JUMPS,
)
add_mass(
    "cylinder",
    {
        "c": {
            "type": "cylinder",
            "ports": {"rod": "load", "case": "wall"},
            "stroke": 0.2,
            "area_A": 1e-3,
            "area_B": 8e-4,
            "dead_volume_A": 2e-5,
            "dead_volume_B": 2e-5,
            "initial_pressure_A": 2e6,
            "initial_pressure_B": 2.5e6,
            "leakage": 1e-12,
            "viscous_friction": 50.0,
        }
    },
    None,
    0.01,
    400,
    ["links.c.force"],
    fluid=WATER | {"law": "log"},
)
ROD = {
    "type": "body",
    "mass": 2.0,
    "inertia": [0.2, 0.2, 0.0],
    "centre_of_mass": [0, 0, -0.5],
    "points": {"end": [0, 0, -1]},
}


def hinge(angle: float, **more) -> dict:
    return {"kind": "revolute", "axis": [0, 1, 0], "angle": angle, **more}


def add_bodies(name: str, nodes: dict, links: dict, probes, lacks=None) -> None:
    add(name, nodes, links, 0.5, probes, lacks, 50)


add_bodies(
    "body",
    {"rod": ROD | {"joint": hinge(1.0)}, "arm": ROD | {"joint": hinge(0.3, on="rod.end")}},
    {},
    ["nodes.rod.angle", "nodes.arm.angle"],
)
add_bodies(
    "torque",
    {"rod": ROD | {"joint": hinge(1.0)}},
    {"t": {"type": "torque", "to": "rod", "torque": 3.0, "axis": [0, 1, 0]}},
    ["nodes.rod.angle"],
)
CRANKS = {"one": ROD | {"joint": hinge(1.0)}, "two": ROD | {"joint": hinge(1.0, at=[1.5, 0, 0])}}
COUPLER = {
    "type": "body",
    "mass": 3.0,
    "inertia": [0.0, 0.6, 0.6],
    "centre_of_mass": [0.75, 0, 0],
    "points": {"end": [1.5, 0, 0]},
    "joint": hinge(-1.0, on="one.end"),
}
add_bodies(
    "pin",
    {**CRANKS, "coupler": COUPLER},
    {"loop": {"type": "pin", "from": "two.end", "to": "coupler.end", "axis": [0, 1, 0]}},
    ["nodes.one.angle", "nodes.two.angle"],
)
add_bodies(
    "bushing",
    CRANKS,
    {
        "b": {
            "type": "bushing",
            "from": "one.end",
            "to": "two.end",
            "stiffness": 20.0,
            "damping": 1.0,
        }
    },
    ["nodes.one.angle", "nodes.two.angle"],
)

# networks of rotation, electricity and heat -------------------------------------------------------------------------

GROUND = {"gnd": {"type": "ground"}}
TERMINALS = GROUND | {name: {"type": "terminal"} for name in ("a", "b", "c")}
SHAFTS = {
    "frame": {"type": "housing"},
    "a": {"type": "shaft", "inertia": 2.0, "initial_speed": 3.0},
    "b": {"type": "shaft", "inertia": 1.0, "initial_speed": 0.0},
}


def between(kind: str, start: str, end: str, **keys) -> dict:
    return {"type": kind, "from": start, "to": end, **keys}


SPEEDS = ["nodes.a.speed", "nodes.b.speed"]
BEARING = between("bearing", "b", "frame", damping=0.5)
TWIST = between("torsion-spring", "a", "b", stiffness=50.0, damping=1.0, initial_torque=0.0)
add("shaft", SHAFTS, {"k": TWIST, "f": BEARING}, 1.0, SPEEDS)
add(
    "gear",
    SHAFTS
    | {
        "b": {"type": "shaft", "inertia": 1.0},
        "c": {"type": "shaft", "inertia": 0.5, "initial_speed": 0.0},
    },
    {
        "g": between("gear", "a", "b", ratio=2.0),
        "k": between("torsion-spring", "b", "c", stiffness=20.0, initial_torque=0.0),
        "f": BEARING,
    },
    1.0,
    SPEEDS,
)
add("clutch", SHAFTS, {"c": between("clutch", "a", "b", torque=0.5), "f": BEARING}, 0.5, SPEEDS)
add(
    "rack",
    {
        "wall": WALL,
        "axle": {"type": "shaft", "inertia": 0.02},
        "cart": {"type": "mass", "mass": 5.0, "initial_velocity": 0.0},
    },
    {
        "r": {"type": "rack", "ports": {"shaft": "axle", "mass": "cart"}, "radius": 0.1},
        "t": {"type": "torque", "to": "axle", "torque": 3.0},
        "d": between("damper", "wall", "cart", damping=4.0),
    },
    2.0,
    ["nodes.axle.speed", "nodes.cart.velocity"],
)
COIL = between("inductor", "b", "c", inductance=3e-3, initial_current=0.0)
STORE = between("capacitor", "c", "gnd", capacitance=1e-4, initial_voltage=0.0)
RESISTOR = between("resistor", "a", "b", resistance=2.0)
CURRENTS = ["nodes.c.voltage", "links.coil.current"]
add(
    "circuit",
    TERMINALS,
    {
        "v": between("voltage-source", "gnd", "a", voltage=10.0),
        "r": RESISTOR,
        "coil": COIL,
        "store": STORE,
    },
    5e-3,
    CURRENTS,
    steps=50,
)
add(
    "current-source",
    TERMINALS,
    {
        "i": between("current-source", "c", "gnd", current=0.5),
        "r": RESISTOR,
        "coil": COIL,
        "store": STORE,
        "d": between("diode", "gnd", "a", forward_voltage=0.7),
    },
    2e-3,
    CURRENTS,
    steps=50,
)
add(
    "switch",
    TERMINALS,
    {
        "v": between("voltage-source", "gnd", "a", voltage=10.0),
        "coil": COIL,
        "store": STORE,
        "s": between("switch", "a", "b", closed=1.0, resistance=2.0),
    },
    5e-3,
    CURRENTS,
    steps=50,
)
add(
    "dc-motor",
    GROUND
    | {
        "plus": {"type": "terminal"},
        "frame": {"type": "housing"},
        "axle": {"type": "shaft", "inertia": 3e-3, "initial_speed": 0.0},
    },
    {
        "v": between("voltage-source", "gnd", "plus", voltage=24.0),
        "f": between("bearing", "axle", "frame", damping=1e-3),
        "m": {
            "type": "dc-motor",
            "ports": {"p": "plus", "n": "gnd", "shaft": "axle"},
            "torque_constant": 0.12,
            "resistance": 0.8,
            "inductance": 2e-3,
            "initial_current": 0.0,
        },
    },
    0.02,
    ["nodes.axle.speed", "links.m.current"],
    steps=50,
)
add(
    "solenoid",
    GROUND
    | {
        "a": {"type": "terminal"},
        "b": {"type": "terminal"},
        "base": {"type": "frame", "initial_position": -0.01},
        "plunger": {"type": "mass", "mass": 0.02, "initial_position": 1e-3},
    },
    {
        "v": between("voltage-source", "gnd", "a", voltage=24.0),
        "r": between("resistor", "a", "b", resistance=12.0),
        "coil": {
            "type": "solenoid",
            "ports": {"p": "b", "n": "gnd", "armature": "plunger"},
            "turns": 800.0,
            "pole_area": 8e-5,
            "closed_position": 3e-3,
            "core_reluctance": 4e6,
            "initial_flux": 0.0,
        },
        "s": between("spring", "base", "plunger", stiffness=900.0, free_length=0.011),
    },
    5e-3,
    ["links.coil.current", "nodes.plunger.position"],
    steps=50,
)
add(
    "heat-network",
    {
        "air": {"type": "ambient", "temperature": 290.0},
        "skin": {"type": "heat-capacity", "heat_capacity": 500.0, "initial_temperature": 300.0},
        "body": {"type": "heat-capacity", "heat_capacity": 4e3, "initial_temperature": 350.0},
    },
    {
        "q": {"type": "heat-source", "to": "body", "heat": 100.0},
        "w": between("thermal-conductor", "body", "skin", conductance=5.0),
        "o": between("convection", "skin", "air", coefficient=25.0, area=0.4),
    },
    100.0,
    ["nodes.body.temperature", "nodes.skin.temperature"],
)

# basins and conduits ------------------------------------------------------------------------------------------------

KINKED = {"linearised": "fluxes of equal speeds from both sides have a kink"}
FLUXES = {"order": "fluxes of the surface have kinks"}
DRY = {"linearised": "fluxes of the surface have kinks", **FLUXES}
PLANE = {"scheme": "upwind"}
POOL = {
    "type": "basin",
    "size": [3.0, 2.0],
    "cells": [4, 3],
    "level": 0.5,
    "elevation": 0.0,
    "manning": 0.02,
    "start": {"level": "0.5 + 0.02*x - 0.01*y"},
}


def add_basin(
    name: str, links=None, probes=(), lacks=None, end=0.2, nodes=None, numerics=PLANE, **keys
) -> None:
    pool = {key: value for key, value in (POOL | keys).items() if value is not None}
    add(
        name, {"pool": pool} | (nodes or {}), links or {}, end, probes, lacks, 40, numerics=numerics
    )


DEPTHS = ["nodes.pool.depth@1.1,1.3", "nodes.pool.u@2,0.9"]
add_basin("free-surface", probes=DEPTHS, lacks=KINKED)
add_basin("free-surface-muscl", probes=DEPTHS, numerics={"scheme": "muscl"}, lacks=LIMITED)
add_basin("free-surface-bed", probes=DEPTHS, bed="0.2*exp(-(x-1)^2-(y-1)^2)", lacks=DRY)
add_basin(
    "rain",
    probes=DEPTHS,
    rain=1e-3,
    infiltration={"model": "horton", "initial": 1e-4, "final": 1e-5, "decay": 1e-2},
    lacks=KINKED,
)
add_basin(
    "open-side", probes=DEPTHS, patches={"far": {"side": "east", "boundary": "open"}}, lacks=DRY
)
add_basin(
    "patch",
    {"v": valve("pool.near", "river", 0.05)},
    [*DEPTHS, "links.v.flow"],
    lacks=DRY,
    nodes={"river": reservoir(AMBIENT + 2e3, elevation=0.0)},
    patches={"near": {"side": "west"}},
)
add_basin(
    "liquid",
    probes=["nodes.pool.pressure@0.2,0.3"],
    end=1e-3,
    physics="liquid",
    size=[0.4, 0.5],
    level=None,
    manning=None,
    elevation=None,
    pressure=1e6,
    thickness=0.1,
    start={"pressure": "1e6 + 1e5*x"},
)
add(
    "transport",
    {
        "sheet": {
            "type": "basin",
            "physics": "transport",
            "size": [1.0, 1.0],
            "cells": [5, 6],
            "velocity": {"expression": "swirl", "period": 1.0},
            "scalars": {"dye": "exp(-20*((x-0.3)^2+(y-0.5)^2))"},
        }
    },
    {},
    0.25,
    ["nodes.sheet.dye@0.3,0.5"],
    None,
    40,
    numerics=PLANE,
    scalars={"dye": {"unit": "mg/l"}},
)
add_tanks(
    "conduit",
    {
        "type": "conduit",
        "manning": 0.013,
        "diameter": 0.5,
        "length": 20.0,
        "inverts": [0.2, 0.1],
        "cells": 5,
        "initial_flow": 0.0,
    },
    FLUXES,
    (1.0, 0.5),
    1.0,
    steps=50,
    numerics=PLANE,
)
