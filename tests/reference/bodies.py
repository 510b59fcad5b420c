"""Cases with bodies in space, in SI units; random trees of bodies, and their models in Pinocchio."""

import math
from typing import Any

import numpy as np

from reference.scenes import AMBIENT, GRAVITY, scene

AXES = ("X", "Y", "Z")


def body(mass: float, inertia: Any, joint: dict, **more: Any) -> dict:
    return {"type": "body", "mass": mass, "inertia": inertia, "joint": joint, **more}


def turn(rng) -> np.ndarray:
    """Random rotation matrix, from random Euler parameters."""
    h, a, b, c = (e := rng.standard_normal(4)) / np.linalg.norm(e)
    return np.array([
        [1 - 2 * (b * b + c * c), 2 * (a * b - h * c), 2 * (a * c + h * b)],
        [2 * (a * b + h * c), 1 - 2 * (a * a + c * c), 2 * (b * c - h * a)],
        [2 * (a * c - h * b), 2 * (b * c + h * a), 1 - 2 * (a * a + b * b)],
    ])  # fmt: skip


def random_tree(
    rng, many: int, first: str = "", kinds=("revolute", "prismatic", "ball")
) -> dict[str, dict]:
    """Bodies b0, b1, ... of a random tree; `first` is the kind of joint of b0, by default random."""
    found = {}
    for i in range(many):
        kind = first if i == 0 and first else str(rng.choice(kinds))
        # principal moments obey the triangle inequality
        spread, frame = rng.uniform(0.5, 1.5, 3), turn(rng)
        moments = np.diag(np.sum(spread) - spread) * 0.3
        joint: dict[str, Any] = {
            "kind": kind,
            "at": rng.uniform(-1, 1, 3).tolist(),
            "attitude": {"matrix": turn(rng).tolist()},
        }
        if i > 0:
            joint["on"] = f"b{rng.integers(0, i)}"
        if kind in ("revolute", "prismatic"):
            axis = rng.standard_normal(3)
            joint |= {
                "axis": (axis / np.linalg.norm(axis)).tolist(),
                "rate": float(rng.uniform(-1, 1)),
            }
            joint["angle" if kind == "revolute" else "travel"] = float(rng.uniform(-1, 1))
        if kind in ("ball", "free"):
            joint["rate"] = rng.uniform(-1, 1, 3).tolist()
        if kind == "free":
            joint["velocity"] = rng.uniform(-1, 1, 3).tolist()
        found[f"b{i}"] = body(
            float(rng.uniform(0.5, 3.0)),
            (frame @ moments @ frame.T).tolist(),
            joint,
            centre_of_mass=rng.uniform(-0.5, 0.5, 3).tolist(),
            points={"p": rng.uniform(-1, 1, 3).tolist()},
        )
    return found


def pinocchio_of(bodies: dict[str, dict], gravity: float):
    """(pinocchio, model, data, q, v, first row of v of each body), with bodies in the order of the file."""
    import pinocchio as pin

    model, joints, start = pin.Model(), {}, {}
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    for name, one in bodies.items():
        joint = one["joint"]
        kind, axis = joint["kind"], np.array(joint.get("axis", [0.0, 0.0, 1.0]))
        made = {
            "revolute": lambda axis=axis: pin.JointModelRevoluteUnaligned(axis),
            "prismatic": lambda axis=axis: pin.JointModelPrismaticUnaligned(axis),
            "ball": pin.JointModelSpherical,
            "free": pin.JointModelFreeFlyer,
        }[kind]()
        rotation = np.array(joint.get("attitude", {}).get("matrix", np.eye(3).tolist()))
        frame = pin.SE3(rotation, np.array(joint.get("at", [0.0, 0.0, 0.0])))
        up = joints[joint["on"]] if "on" in joint else 0
        joints[name] = j = model.addJoint(up, made, frame, name)
        inertia = np.array(one["inertia"], dtype=float)
        inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
        centre = np.array(one.get("centre_of_mass", [0.0, 0.0, 0.0]))
        model.appendBodyToJoint(j, pin.Inertia(one["mass"], centre, inertia), pin.SE3.Identity())
        start[name] = (kind, joint, rotation, centre)
    data, q, v = model.createData(), pin.neutral(model), np.zeros(model.nv)
    rows = {}
    for name, (kind, joint, rotation, centre) in start.items():
        j = model.joints[joints[name]]
        if kind in ("revolute", "prismatic"):
            q[j.idx_q], v[j.idx_v] = (
                joint.get("angle", joint.get("travel", 0.0)),
                joint.get("rate", 0.0),
            )
        elif kind == "ball":
            v[j.idx_v : j.idx_v + 3] = joint.get("rate", [0.0] * 3)
        else:  # velocities of the origin of the body, in its axes
            w = np.array(joint.get("rate", [0.0] * 3))
            v[j.idx_v + 3 : j.idx_v + 6] = w
            v[j.idx_v : j.idx_v + 3] = rotation.T @ np.array(
                joint.get("velocity", [0.0] * 3)
            ) - np.cross(w, centre)
        rows[name] = j.idx_v
    return pin, model, data, q, v, rows


OIL = {
    "name": "user",
    "density": 870.0,
    "bulk_modulus": 1.2e9,
    "viscosity": 0.028,
    "vapor_pressure": 100.0,
}
CLOSE = {"method": "dormand-prince", "rtol": 1e-10}


def bodies(
    nodes: dict, end: float, probes=(), links: dict | None = None, every: float = 0.01, **more: Any
) -> dict:
    """Case of bodies; `more` are keys of `numerics`."""
    return scene(nodes, links or {}, end, more or CLOSE, probes, every)


def pendulum(angle: float = 1.0, length: float = 0.7, mass: float = 2.0, **joint: Any) -> dict:
    """Point mass on a massless rod that turns about y; the rod hangs vertically at angle 0."""
    hinge = {"kind": "revolute", "axis": [0, 1, 0], "angle": angle, **joint}
    return body(
        mass, [0, 0, 0], hinge, centre_of_mass=[0, 0, -length], points={"bob": [0, 0, -length]}
    )


class Crane:
    """Boom of mass m and length L, supported near its pivot by a cylinder from below.

    The boom is horizontal at angle 0, and a positive angle lifts it.
    """

    mass, length, gyration = 120.0, 1.0, 10.0
    areas, dead, stroke, x = (1e-3, 6e-4), (1e-4, 1e-4), 0.3, 0.1
    low, eye = -0.25, 0.25
    p_b = AMBIENT + 5e5

    @property
    def distance(self) -> float:
        return math.hypot(self.low, self.eye)

    @property
    def lever(self) -> float:
        return self.eye * -self.low / self.distance

    @property
    def inertia(self) -> float:
        return self.gyration + self.mass * self.length**2 / 4.0

    @property
    def p_a(self) -> float:
        """Pressure in chamber A that supports the boom [Pa]."""
        force = self.mass * GRAVITY * self.length / 2.0 / self.lever
        return AMBIENT + (force + self.areas[1] * (self.p_b - AMBIENT)) / self.areas[0]

    def spring(self, law: str = "log") -> float:
        """Stiffness of the fluid in both chambers [N/m].

        Under the law `linear`, dp = -(beta + p') dV / V in a closed volume, with p' the gauge pressure.
        """
        volumes = (
            self.dead[0] + self.areas[0] * self.x,
            self.dead[1] + self.areas[1] * (self.stroke - self.x),
        )
        beta, total = OIL["bulk_modulus"], 0.0
        for area, volume, pressure in zip(self.areas, volumes, (self.p_a, self.p_b), strict=True):
            total += area**2 / volume * (beta + (pressure - AMBIENT if law == "linear" else 0.0))
        return total

    def nodes(self, **joint: Any) -> dict:
        hinge = {"kind": "revolute", "axis": [0, -1, 0], **joint}
        boom = body(
            self.mass,
            [1.0, self.gyration, self.gyration],
            hinge,
            centre_of_mass=[self.length / 2, 0, 0],
            points={"eye": [self.eye, 0, 0], "tip": [self.length, 0, 0]},
        )
        return {"boom": boom, "ground": {"type": "frame", "points": {"lug": [0, 0, self.low]}}}

    def links(self, **more: Any) -> dict:
        cylinder = {
            "type": "cylinder",
            "ports": {"case": "ground.lug", "rod": "boom.eye"},
            "stroke": self.stroke,
            "closed_length": self.distance - self.x,
            "area_A": self.areas[0],
            "area_B": self.areas[1],
            "dead_volume_A": self.dead[0],
            "dead_volume_B": self.dead[1],
            "initial_pressure_A": self.p_a,
            "initial_pressure_B": self.p_b,
        }
        return {"lift": {**cylinder, **more}}

    def case(
        self,
        end: float,
        probes=(),
        law: str = "linear",
        every: float = 0.01,
        joint=None,
        cylinder=None,
        **more,
    ):
        return scene(
            self.nodes(**(joint or {})),
            self.links(**(cylinder or {})),
            end,
            more or CLOSE,
            probes,
            every,
            fluid={**OIL, "law": law},
        )


CRANK, COUPLER = (2.0, 1.0), (3.0, 1.5)  # mass [kg] and length [m]


def parallelogram(angle: float = 1.0, rate: float = 0.0, **pin) -> tuple[dict, dict]:
    """Return nodes and links of two hanging cranks with a level coupler between their ends, closed by a pin."""
    (m, a), (n, b) = CRANK, COUPLER

    def rod(mass, length, joint):
        inertia = mass * length**2 / 12.0
        return body(
            mass,
            [inertia, inertia, 0.0],
            {"kind": "revolute", "axis": [0, 1, 0], **joint},
            centre_of_mass=[0, 0, -length / 2.0],
            points={"end": [0, 0, -length]},
        )

    nodes = {
        "one": rod(m, a, {"angle": angle, "rate": rate}),
        "two": rod(m, a, {"angle": angle, "at": [b, 0, 0], "rate": rate}),
        "coupler": rod(n, b, {"on": "one.end", "angle": -math.pi / 2.0 - angle, "rate": -rate}),
    }
    return nodes, {
        "loop": {"type": "pin", "from": "two.end", "to": "coupler.end", "axis": [0, 1, 0], **pin}
    }
