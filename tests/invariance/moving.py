"""Cases with moving parts: mechanisms, moving walls, basin frames, tanks on bodies and moving networks."""

from collections.abc import Callable

from reference.bodies import OIL, bodies, body
from reference.scenes import GRAVITY, RHO, WATER, scene

LAWS = {
    "linear": {**OIL, "law": "linear"},
    "log": {**OIL, "law": "log"},
    "table": {"name": "Water", "temperature": 293.15, "law": "table"},
    "mixture": {**OIL, "law": "mixture", "air_fraction": 1e-3},
}
METHODS = {
    "ssp-rk3": {},
    "rk4": {},
    "gauss-4": {},
    "implicit-midpoint": {},
    "rodas-4": {},
    "radau-iia-5": {},
    "dormand-prince": {"rtol": 1e-8},
}
EXPLICIT = ("ssp-rk3", "rk4", "dormand-prince")
END = 0.4


def stepped(method: str, step: float) -> dict:
    """Keys of `numerics` for a method at step `step`, or at its tolerance if it has one."""
    return {"scheme": "muscl", "method": method, **(METHODS[method] or {"step": step})}


def seen(*names: str) -> list[str]:
    """Probes of position, velocity and acceleration of bodies and points."""
    return [f"{name}.{one}{axis}" for name in names for one in ("", "v", "a") for axis in "xyz"]


def machine(method: str = "rk4", law: str = "linear", **more) -> dict:
    """Case of a tree with joints of every kind, a free body, and links of every kind except pins."""
    wave = {"mean": 0.1, "amplitude": 0.2, "period": 0.9, "phase": 0.4}
    nodes = {
        "world": {"type": "frame", "points": {"foot": [0.1, -0.2, 0.3], "lug": [0.5, 0.1, -0.6], "hook": [1.0,
            2.0, 3.0]}},
        "base": body(5.0, [1.0, 1.2, 1.1], {"kind": "revolute", "axis": [0, 0, 1], "angle": wave},
                     points={"top": [0, 0.2, 0.5], "side": [0.4, -0.1, 0.1]}),
        "arm": body(3.0, [0.2, 0.5, 0.4], {"kind": "revolute", "on": "base.top", "axis": [0.6, -0.8, 0], "angle": 0.3,
                                          "rate": 0.4, "damping": 0.2, "attitude": {"roll": 0.2, "yaw": -0.4}},
                    centre_of_mass=[0.4, 0.1, 0.05], points={"eye": [0.5, 0.0, -0.1], "end": [1.0, 0.1, 0.0]}),
        "slider": body(1.5, [0.1, 0.12, 0.15], {"kind": "prismatic", "on": "arm.end", "axis": [0.8, 0.0, 0.6],
                                               "travel": 0.1, "rate": -0.2, "damping": 1.0},
                       points={"tip": [0.3, 0.0, 0.1]}),
        "wrist": body(0.8, [0.04, 0.05, 0.06], {"kind": "ball", "on": "slider.tip", "rate": [0.5, -0.3, 0.8],
                                               "attitude": {"pitch": 0.3, "yaw": 0.2}},
                      centre_of_mass=[0.05, 0.1, -0.15], points={"grip": [0.1, 0.2, -0.3]}),
        "plate": body(0.4, [0.02, 0.01, 0.02], {"kind": "fixed", "on": "wrist", "at": [0.1, 0.0, -0.2],
                                               "attitude": {"roll": 0.5}}, points={"edge": [0.2, 0.1, 0.0]}),
        "kite": body(0.6, [[0.03, 0.002, 0], [0.002, 0.04, -0.001], [0, -0.001, 0.05]],
                     {"kind": "free", "at": [1.4, 0.3, 1.2], "velocity": [0.2, -0.1, 0.3], "rate": [1.0, 0.5, -0.7],
                      "attitude": {"roll": -0.3, "pitch": 0.4, "yaw": 1.0}},
                     centre_of_mass=[0.02, -0.03, 0.01], points={"nose": [0.3, 0.1, 0.0], "tail": [-0.3, 0.0, 0.1]}),
    }  # fmt: skip
    links = {
        "lift": {
            "type": "cylinder",
            "ports": {"case": "world.lug", "rod": "arm.eye"},
            "closed_length": 0.6,
            "stroke": 1.5,
            "area_A": 1e-4,
            "area_B": 6e-5,
            "dead_volume_A": 5e-4,
            "dead_volume_B": 5e-4,
            "viscous_friction": 5.0,
        },
        "string": {
            "type": "spring",
            "from": "world.hook",
            "to": "kite.nose",
            "stiffness": 30.0,
            "free_length": 1.0,
        },
        "strap": {
            "type": "spring",
            "from": "plate.edge",
            "to": "kite.tail",
            "stiffness": 20.0,
            "preload": -2.0,
        },
        "brake": {"type": "damper", "from": "base.side", "to": "slider.tip", "damping": 2.0},
        "rope": {
            "type": "end-stop",
            "from": "base.side",
            "to": "kite.tail",
            "maximum": 0.9,
            "stiffness": 40.0,
            "damping": 0.5,
        },
        "wind": {
            "type": "force",
            "to": "kite.nose",
            "force": {"mean": 1.0, "amplitude": 3.0, "period": 0.7},
            "direction": [1, 2, 0.5],
        },
        "push": {"type": "force", "from": "arm.eye", "to": "wrist.grip", "force": 4.0},
        "motor": {
            "type": "torque",
            "from": "arm",
            "to": "wrist",
            "torque": 0.3,
            "axis": [0, 0.6, 0.8],
        },
        "rubber": {
            "type": "bushing",
            "from": "slider.tip",
            "to": "plate.edge",
            "stiffness": 25.0,
            "damping": 0.8,
            "rotational_stiffness": 1.5,
            "rotational_damping": 0.05,
        },
    }
    probes = seen("arm.eye", "slider.tip", "wrist.grip", "plate.edge", "kite.nose", "kite")
    probes += [
        f"{one}.{what}{axis}"
        for one in ("arm", "kite", "wrist")
        for what in ("w", "angular_momentum_")
        for axis in "xyz"
    ]
    probes += [f"arm.joint_f{axis}" for axis in "xyz"] + [f"base.joint_t{axis}" for axis in "xyz"]
    probes += [
        "lift.force",
        "lift.A.pressure",
        "lift.B.pressure",
        "string.force",
        "rubber.torque",
        "rope.force",
        "arm.rate",
        "slider.rate",
        "kite.kinetic_energy",
    ]
    made = bodies(nodes, END, probes, links, 1 / 32, **stepped(method, 2e-3))
    made["fluid"] = dict(LAWS[law])
    return made | more


def loop(method: str = "rk4", **more) -> dict:
    """Case of a parallelogram of three bars in an inclined plane, closed by a pin, with a spring."""
    bar = {
        "mass": 2.0,
        "inertia": [1 / 6, 1 / 6, 0.01],
        "centre_of_mass": [0, 0, -0.5],
        "points": {"end": [0, 0, -1.0]},
    }
    aslant = {"attitude": {"roll": 0.3, "yaw": 0.5}}
    nodes = {
        "world": {"type": "frame", "points": {"hook": [0.5, 0.4, -2.0]}},
        "rig": body(9.0, [1, 1, 1], {"kind": "fixed", "at": [0.3, -0.2, 0.1], **aslant}),
        "one": body(
            joint={"kind": "revolute", "on": "rig", "axis": [0, 1, 0], "angle": 0.7, "rate": 0.5},
            **bar,
        ),
        "two": body(
            joint={
                "kind": "revolute",
                "on": "rig",
                "at": [1.5, 0, 0],
                "axis": [0, 1, 0],
                "angle": 0.7,
                "rate": 0.5,
            },
            **bar,
        ),
        "coupler": body(
            3.0,
            [0.01, 0.5625, 0.5625],
            {"kind": "revolute", "on": "one.end", "axis": [0, 1, 0], "angle": -0.7, "rate": -0.5},
            centre_of_mass=[0.75, 0, 0],
            points={"end": [1.5, 0, 0], "mid": [0.75, 0, 0.1]},
        ),
    }
    links = {
        "loop": {"type": "pin", "from": "two.end", "to": "coupler.end", "axis": [0, 1, 0]},
        "pull": {"type": "spring", "from": "world.hook", "to": "coupler.mid", "stiffness": 80.0},
    }
    probes = seen("coupler.mid", "two.end") + [
        "one.angle",
        "two.rate",
        "loop.force",
        "pull.force",
        *(f"one.joint_f{axis}" for axis in "xyz"),
    ]
    return bodies(nodes, END, probes, links, 1 / 32, **stepped(method, 4e-3)) | more


def piston(method: str = "rk4", law: str = "", by: str = "mass", **more) -> dict:
    """Case of a basin of water or liquid whose east wall moves with a sprung mass or body."""
    rest = 0.5 * RHO * GRAVITY * 0.5
    pool = {
        "type": "basin",
        "size": [1.0, 0.5],
        "cells": [8, 2],
        "patches": {"lid": {"side": "east", "body": "lid"}},
    }
    if law:
        fluid = (
            LAWS[law]
            if law in ("table", "mixture")
            else {**WATER, "law": law, "bulk_modulus": 2.2e7}
        )
        pool |= {
            "physics": "liquid",
            "pressure": 1.2e5,
            "thickness": 0.1,
            "start": {"pressure": "1e3 * cos(3 * x)"},
        }
        rest = (1.2e5 - 101325.0) * 0.05
    else:
        pool |= {"level": 1.0, "start": {"level": "1 + 0.05 * cos(3.141592653589793 * x)"}}
        fluid = WATER
    start = {"initial_velocity": 0.1}
    lid = {"type": "mass", "mass": 400.0, **start}
    ground = {"type": "frame", "initial_position": 1.0}
    end = {"from": "lid", "to": "ground"}
    if by == "body":
        lid = body(
            400.0,
            [1, 1, 1],
            {"kind": "prismatic", "axis": [1, 0, 0], "rate": 0.1},
            points={"eye": [0, 0, 0]},
        )
        ground, end = (
            {"type": "frame", "points": {"far": [1.0, 0, 0]}},
            {"from": "lid.eye", "to": "ground.far"},
        )
    links = {
        "spring": {"type": "spring", **end, "stiffness": 2e4, "preload": rest},
        "brake": {"type": "damper", **end, "damping": 50.0},
    }
    probes = [
        "b.lid.force",
        "b.lid.power",
        "b.lid.travel",
        "b.depth@0.3,0.2" if not law else "b.pressure@0.3,0.2",
    ]
    step = {"": 8e-3, "linear": 4e-4, "log": 4e-4, "table": 2e-5, "mixture": 1e-4}[law]
    made = scene(
        {"b": pool, "lid": lid, "ground": ground},
        links,
        16 * step,
        stepped(method, step),
        probes,
        2 * step,
    )
    return made | {"fluid": dict(fluid)} | more


def flume(method: str = "rk4", **more) -> dict:
    """Case of a basin with a scheduled motion of its west wall, a wall zone inside the basin, and a valve at a side."""
    swing = {"mean": 0.0, "amplitude": 0.05, "period": 1.1, "phase": 0.3}
    patches = {"paddle": {"side": "west", "travel": swing, "zone": 0.5}, "gate": {"side": "south"}}
    pool = {
        "type": "basin",
        "size": [1.5, 0.5],
        "cells": [12, 3],
        "level": 1.0,
        "patches": patches,
        "start": {"level": "1 + 0.03 * cos(2 * x)"},
    }
    links = {"tap": {"type": "valve", "from": "b.gate", "to": "t", "area": 0.02}}
    nodes = {"b": pool, "t": {"type": "tank", "area": 0.3, "level": 0.9}}
    probes = [
        "b.paddle.force",
        "b.paddle.power",
        "b.paddle.travel",
        "b.depth@0.3,0.2",
        "b.u@0.9,0.1",
        "tap.flow",
        "t.level",
    ]
    return scene(nodes, links, END, stepped(method, 8e-3), probes, 1 / 32) | more


ROCK = {"mean": 0.02, "amplitude": 0.05, "period": 1.3, "phase": 0.5}


def carried(method: str = "rk4", **more) -> dict:
    """Case of a basin on a body with a driven inclined hinge, whose carrier has a driven slider."""
    nodes = {
        "cart": body(
            5.0,
            [1, 1, 1],
            {"kind": "prismatic", "axis": [0.6, 0.8, 0], "travel": {**ROCK, "period": 0.9}},
        ),
        "cradle": body(
            5.0,
            [1, 1, 1],
            {
                "kind": "revolute",
                "on": "cart",
                "at": [0.2, 0.1, 0.5],
                "axis": [0.36, 0.48, 0.8],
                "angle": ROCK,
            },
        ),
        "b": {
            "type": "basin",
            "on": "cradle",
            "at": [-0.5, -0.4, 0.3],
            "attitude": {"yaw": 0.4, "roll": 0.02},
            "size": [1.0, 0.8],
            "cells": [6, 5],
            "level": 0.3,
        },
    }
    probes = [
        "b.depth@0.2,0.3",
        "b.u@0.7,0.4",
        "b.v@0.7,0.4",
        *(f"cradle.joint_t{axis}" for axis in "xyz"),
    ]
    return scene(nodes, {}, END, stepped(method, 0.01), probes, 1 / 32) | more


def full(method: str = "rk4", law: str = "linear", free: bool = False, **more) -> dict:
    """Case of a box full of liquid, inclined on a body with an inclined hinge, driven or free."""
    turns = {"angle": 0.3, "rate": 1.5} if free else {"angle": {**ROCK, "period": 0.3}}
    nodes = {
        "cradle": body(
            9.0,
            [1, 1, 1],
            {"kind": "revolute", "at": [0.2, 0.1, 0.5], "axis": [0.36, 0.48, 0.8], **turns},
        ),
        "b": {
            "type": "basin",
            "physics": "liquid",
            "on": "cradle",
            "at": [-0.5, -0.4, 0.3],
            "wave_speed": 600.0,
            "attitude": {"yaw": 0.4, "roll": 1.2},
            "size": [1.0, 0.8],
            "cells": [6, 5],
            "pressure": 3e5,
            "thickness": 0.05,
        },
    }
    probes = [
        "b.pressure@0.2,0.3",
        "b.u@0.7,0.4",
        "b.v@0.7,0.4",
        "cradle.angle",
        *(f"cradle.w{axis}" for axis in "xyz"),
    ]
    numerics = stepped(method, 1e-4) | {"scheme": "upwind5"}
    return scene(nodes, {}, 0.01, numerics, probes, 1 / 1024) | {"fluid": dict(LAWS[law])} | more


def rocking(method: str = "rk4", sloshing: str = "cells", **more) -> dict:
    """Case of a basin that moves its body, which hangs on a ball joint and two springs."""
    hull = body(
        400.0,
        [300.0, 400.0, 500.0],
        {
            "kind": "ball",
            "at": [0.1, 0.2, 1.0],
            "attitude": {"roll": 0.05, "pitch": -0.03, "yaw": 0.4},
            "rate": [0.1, -0.05, 0.2],
        },
        centre_of_mass=[0.05, 0, -0.8],
        points={"right": [0, 1.0, 0], "left": [0, -1.0, 0]},
    )
    pool = {
        "type": "basin",
        "on": "hull",
        "at": [-0.5, -0.4, -0.9],
        "size": [1.0, 0.8],
        "cells": [6, 5],
        "level": 0.25,
        "sloshing": sloshing,
    }
    nodes = {
        "hull": hull,
        "b": pool,
        "world": {"type": "frame", "points": {"right": [0, 1.5, -1.0], "left": [0, -1.5, -1.0]}},
    }
    links = {
        side: {
            "type": "spring",
            "from": f"world.{side}",
            "to": f"hull.{side}",
            "stiffness": 900.0,
            "preload": 0.0,
        }
        for side in ("right", "left")
    }
    probes = seen("hull.right") + [f"hull.w{axis}" for axis in "xyz"]
    if sloshing != "frozen":
        probes += ["b.depth@0.2,0.3"]
    if sloshing == "cells":
        probes += ["b.u@0.7,0.4", "b.v@0.7,0.4"]
    return scene(nodes, links, END, stepped(method, 0.01), probes, 1 / 32) | more


def u_tube(method: str = "rk4", free: bool = True, **more) -> dict:
    """Case of two tanks and a rigid column between them on a hull that rolls, free or by a schedule."""
    roll = {"angle": 0.15, "rate": -0.02} if free else {"angle": ROCK}
    nodes = {
        "hull": body(
            60e3,
            [4e5, 8e5, 8e5],
            {"kind": "revolute", "axis": [1, 0, 0], **roll},
            centre_of_mass=[0, 0, -0.8],
        ),
        "port": {"type": "tank", "on": "hull", "at": [0, 4, -1.5], "area": 1.2, "level": 0.8},
        "starboard": {"type": "tank", "on": "hull", "at": [0, -4, -1.5], "area": 1.2, "level": 0.8},
    }
    duct = {
        "type": "rigid-column",
        "from": "port",
        "to": "starboard",
        "length": 8.0,
        "diameter": 0.6,
        "minor_loss": 1.0,
    }
    probes = ["duct.flow", "port.level", "starboard.level", "hull.angle", "hull.ay"]
    return scene(nodes, {"duct": duct}, 10 * END, stepped(method, 0.05), probes, 1 / 8) | more


def hose(method: str = "rk4", law: str = "linear", **more) -> dict:
    """Case of a pipe on a driven body, from a reservoir through a valve to a chamber."""
    nodes = {
        "rig": body(
            1.0,
            [1, 1, 1],
            {"kind": "revolute", "axis": [0, 0.6, 0.8], "angle": {**ROCK, "period": 0.5}},
        ),
        "open": {"type": "reservoir", "pressure": 5e5, "on": "rig", "at": [0, 0, 0.2]},
        "gate": {"type": "junction", "on": "rig", "at": [9, 1, 0]},
        "shut": {"type": "chamber", "volume": 0.01, "on": "rig", "at": [9, 1, 0]},
    }
    links = {
        "pipe": {
            "type": "pipe",
            "from": "open",
            "to": "gate",
            "length": 9.2,
            "diameter": 0.1,
            "wave_speed": 1000.0,
            "cells": 6,
        },
        "valve": {"type": "valve", "from": "gate", "to": "shut", "area": 1e-3},
    }
    probes = ["gate.pressure", "shut.pressure", "pipe.flow@0", "pipe.pressure@0.37", "valve.flow"]
    made = scene(nodes, links, 0.04, stepped(method, 5e-4), probes, 2e-3)
    return made | {"fluid": dict(LAWS[law])} | more


SCENES: dict[str, Callable[..., dict]] = {
    "machine": machine,
    "machine log": lambda method="rk4": machine(method, "log"),
    "machine table": lambda method="rk4": machine(method, "table"),
    "machine mixture": lambda method="rk4": machine(method, "mixture"),
    "loop": loop,
    "piston": piston,
    "piston body": lambda method="rk4": piston(method, by="body"),
    "piston linear": lambda method="rk4": piston(method, "linear"),
    "piston log": lambda method="rk4": piston(method, "log"),
    "piston table": lambda method="rk4": piston(method, "table"),
    "flume": flume,
    "carried": carried,
    "full": full,
    "full log": lambda method="rk4": full(method, "log"),
    "full free": lambda method="rk4": full(method, free=True),
    "full table free": lambda method="rk4": full(method, "table", free=True),
    "rocking": rocking,
    "frozen": lambda method="rk4": rocking(method, "frozen"),
    "modes": lambda method="rk4": rocking(method, "modes"),
    "u-tube free": u_tube,
    "u-tube driven": lambda method="rk4": u_tube(method, free=False),
    "hose linear": hose,
    "hose log": lambda method="rk4": hose(method, "log"),
    "hose table": lambda method="rk4": hose(method, "table"),
}
