"""Events between two states of a step: an event function reaches zero and returns within one step.

Every scene drives one event function through a single peak that passes its threshold by 1e-3 to 1e-1 of its range. The
driving quantity has a closed form: a parabola, or the half of a sine, so that the event must happen. Each kind of event
runs with each kind of method, at random sizes, margins and tolerances or given steps.

python benchmarks/hidden_events.py          # 4 scenes of each kind and method
python benchmarks/hidden_events.py 20 --seed 3 --kinds relay,spilling --methods auto
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
from measure import parser

import fvsolve
from fvsolve.errors import FvsolveError

FLUID = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": "2.2 GPa",
    "viscosity": "1 mPa s",
    "vapor_pressure": "0 Pa",
    "law": "linear",
}
GRAVITY, AMBIENT = 9.80665, 101325.0
ADAPTIVE = (
    "bogacki-shampine",
    "dormand-prince",
    "verner-7",
    "tr-bdf2",
    "esdirk-4",
    "radau-iia-5",
    "rodas-4",
    "rodas-5p",
    "auto",
)
GIVEN = (
    "euler",
    "heun",
    "rk4",
    "ssp-rk3",
    "implicit-euler",
    "trapezoid",
    "gauss-4",
    "radau-iia-3",
    "lobatto-iiic-4",
)
METHODS = (*ADAPTIVE, *GIVEN)
VALVE = {"type": "valve", "area": "0.1 m2"}
EXACT, PARABOLA, FIRST = 0, 1, 2
ACCURACY = {"euler": PARABOLA, "implicit-euler": FIRST} | dict.fromkeys(
    GIVEN[1:4] + GIVEN[5:], PARABOLA
)


class Drive:
    """Quantity with a single peak: `base` + `rise` at the time `peak` [s], from `base` at t = 0.

    `rate` is its derivative as a formula of t, and `value` itself. `accuracy` of the method says which drives it
    follows: EXACT both, PARABOLA a parabola, FIRST a parabola with an error of its step.
    """

    accuracy = 0

    def __init__(self, rng: np.random.Generator, base: float, rise: float) -> None:
        self.base, self.rise, self.peak = base, rise, 10.0 ** rng.uniform(-1.0, 3.0)
        self.end = self.peak * rng.uniform(1.5, 1.9)
        self.steps = rng.uniform(1.0, 6.0)  # given steps to the peak
        self.margin = 10.0 ** rng.uniform(-3.0, -1.0)
        if self.accuracy == EXACT and rng.random() < 0.5:
            w = 0.5 * math.pi / self.peak
            self.rate, self.value = (
                f"{rise * w!r}*cos({w!r}*t)",
                f"{base!r} + {rise!r}*sin({w!r}*t)",
            )
        else:
            first = 2.0 * rise / self.peak
            self.rate = f"{first!r}*(1 - t/{self.peak!r})"
            self.value = f"{base!r} + {first!r}*t*(1 - t/{2 * self.peak!r})"
        # a step of the implicit Euler method is short by the fall of the rate within it
        if self.accuracy == FIRST:
            self.steps += 3.0
            self.margin += 1.2 / self.steps

    @property
    def threshold(self) -> float:
        return self.base + (1.0 - self.margin) * self.rise


def filled_tank(rng: np.random.Generator, falls: bool = False) -> tuple[dict[str, Any], Drive]:
    """Case with a tank `pot` whose level has a peak, or with `falls` a valley at nearly zero."""
    rise = 10.0 ** rng.uniform(-1.0, 1.0)
    drive = Drive(rng, rise * rng.uniform(1.0, 3.0), rise)
    area = 10.0 ** rng.uniform(-1.0, 2.0)
    factor, level = (-area, (1.0 - drive.margin) * rise) if falls else (area, drive.base)
    return {
        "fluid": FLUID,
        "nodes": {
            "src": {"type": "inflow", "flow": f"{factor!r}*({drive.rate})"},
            "pot": {"type": "tank", "area": area, "level": level},
        },
        "links": {"fill": VALVE | {"from": "src", "to": "pot"}},
    }, drive


def block(case: dict[str, Any], **keys: Any) -> dict[str, Any]:
    """Case with a block `controls.b` that drives a shut valve beside the tank."""
    case["nodes"]["out"] = {"type": "reservoir", "head": 0.0}
    case["links"]["drain"] = VALVE | {"from": "pot", "to": "out", "opening": 0.0}
    return case | {"controls": {"b": keys}}


def bottom_pressure(level: float) -> float:
    """Gauge pressure at the bottom of a tank [Pa]."""
    return 1000.0 * GRAVITY * level


def relay(rng):
    case, drive = filled_tank(rng)
    return block(
        case, type="relay", input="pot.level", on=drive.threshold, off=drive.base * 0.5, initial=0
    ), drive


def latch(rng):
    case, drive = filled_tank(rng)
    scene = block(case, type="latch", set="controls.a", reset="controls.z", initial=0)
    scale = 0.5 / drive.threshold
    scene["controls"]["a"] = {
        "type": "function",
        "inputs": {"x": "pot.level"},
        "formula": f"{scale!r}*x",
    }
    scene["controls"]["z"] = {"type": "function", "inputs": {"x": "pot.level"}, "formula": "0*x"}
    return scene, drive


def limit_of_a_block(rng):
    case, drive = filled_tank(rng)
    top = drive.threshold
    return block(
        case, type="function", inputs={"x": "pot.level"}, formula="x", limits=[0.0, top]
    ), drive


def rupture_disc(rng):
    case, drive = filled_tank(rng)
    case["links"]["disc"] = {
        "type": "rupture-disc",
        "from": "pot",
        "area": "1e-4 m2",
        "burst_pressure": bottom_pressure(drive.threshold),
    }
    return case, drive


def surge_anticipating(rng):
    case, drive = filled_tank(rng)
    case["links"]["valve"] = {
        "type": "surge-anticipating",
        "from": "pot",
        "area": "1e-5 m2",
        "high_set": AMBIENT + bottom_pressure(drive.threshold),
        "opening_time": drive.end,
        "closing_time": drive.end,
    }
    return case, drive


def relief_valve(rng):
    case, drive = filled_tank(rng)
    case["nodes"]["out"] = {"type": "reservoir", "pressure": AMBIENT}
    case["links"]["valve"] = {
        "type": "relief-valve",
        "from": "pot",
        "to": "out",
        "area": "1e-6 m2",
        "set_pressure": AMBIENT + bottom_pressure(drive.threshold),
        "overpressure": bottom_pressure(drive.rise),
    }
    return case, drive


def counterbalance(rng):
    case, drive = relief_valve(rng)
    case["links"]["valve"] |= {"type": "counterbalance", "pilot": "out", "pilot_ratio": 1.0}
    return case, drive


def check_valve(rng):
    case, drive = filled_tank(rng)
    case["nodes"]["lake"] = {"type": "reservoir", "head": drive.threshold}
    case["links"]["valve"] = {"type": "check-valve", "from": "pot", "to": "lake", "area": "1e-6 m2"}
    return case, drive


def closing_check_valve(rng):
    """Open check valve whose flow reverses for a moment: the tank of the valley is below the lake."""
    case, drive = filled_tank(rng)
    case["nodes"]["lake"] = {"type": "reservoir", "head": drive.threshold}
    case["links"]["valve"] = {"type": "check-valve", "from": "lake", "to": "pot", "area": "1e-6 m2"}
    return case, drive


def pilot_check(rng):
    case, drive = check_valve(rng)
    case["nodes"]["far"] = {"type": "reservoir", "head": 0.0}
    case["links"]["valve"] |= {"type": "pilot-check", "pilot": "far", "pilot_ratio": 1.0}
    return case, drive


def spilling(rng):
    case, drive = filled_tank(rng)
    case["nodes"]["pot"]["height"] = drive.threshold
    return case, drive


def dry(rng):
    return filled_tank(rng, falls=True)


def end_stop(rng):
    """Mass under a given force, which meets a soft stop near the end of its way."""
    rise = 10.0 ** rng.uniform(-2.0, 0.0)
    drive, mass = Drive(rng, 0.0, rise), 10.0 ** rng.uniform(-1.0, 2.0)
    speed, braking = 2.0 * rise / drive.peak, 2.0 * rise / drive.peak**2
    return {
        "fluid": FLUID,
        "nodes": {
            "ground": {"type": "frame"},
            "m": {"type": "mass", "mass": mass, "initial_velocity": speed},
        },
        "links": {
            "weight": {"type": "force", "to": "m", "force": -braking * mass},
            "stop": {
                "type": "end-stop",
                "from": "ground",
                "to": "m",
                "maximum": drive.threshold,
                "stiffness": mass / drive.peak**2,
            },
        },
    }, drive


def diode(rng):
    """Capacitor charged by a current; the diode conducts to a battery at its greatest voltage."""
    drive, capacity = Drive(rng, 10.0, 10.0), 10.0 ** rng.uniform(-3.0, 0.0)
    return {
        "nodes": {"c": {"type": "terminal"}, "b": {"type": "terminal"}, "gnd": {"type": "ground"}},
        "links": {
            "i": {
                "type": "current-source",
                "from": "gnd",
                "to": "c",
                "current": f"{capacity!r}*({drive.rate})",
            },
            "cap": {
                "type": "capacitor",
                "from": "c",
                "to": "gnd",
                "capacitance": capacity,
                "initial_voltage": drive.base,
            },
            "bat": {"type": "voltage-source", "from": "gnd", "to": "b", "voltage": drive.threshold},
            "d": {
                "type": "diode",
                "from": "c",
                "to": "b",
                "resistance": drive.peak / capacity * 1e3,
            },
        },
    }, drive


def clutch(rng):
    """Shaft that sticks to a housing until the torque exceeds that at rest."""
    drive = Drive(rng, 1.0, 10.0)
    return {
        "nodes": {
            "wheel": {"type": "shaft", "inertia": 1.0, "initial_speed": 0.0},
            "fixed": {"type": "housing"},
        },
        "links": {
            "drive": {"type": "torque", "to": "wheel", "torque": drive.value},
            "brake": {
                "type": "bearing",
                "from": "fixed",
                "to": "wheel",
                "friction_torque": drive.threshold,
            },
        },
    }, drive


def by_event(result, drive) -> bool:
    """True if the summary of a run has an event."""
    return bool(result.summary["events"])


def by_spilling(result, drive) -> bool:
    """True if the level stayed at the rim."""
    return result.extremes["pot.level"].maximum <= drive.threshold * (1.0 + 1e-9)


def by_mark(result, drive) -> bool:
    """True if a mark reports the dry tank."""
    return any(mark.place == "nodes.pot" for mark in result.marks)


def by_force(result, drive) -> bool:
    """True if a step ended where contact begins, or the stop was loaded in an accepted state.

    A step may span the whole contact: then it ends where contact does, and no accepted state is loaded.
    """
    force, position = result.extremes["stop.force"], result.extremes["m.position"]
    begins = abs(position.maximum - drive.threshold) < 1e-9 * drive.rise
    return begins or force.maximum > 0.0 or force.minimum < 0.0


KINDS: dict[str, tuple[Callable, Callable]] = {
    "relay": (relay, by_event),
    "latch": (latch, by_event),
    "limit of a block": (limit_of_a_block, by_event),
    "rupture disc": (rupture_disc, by_event),
    "surge-anticipating": (surge_anticipating, by_event),
    "relief valve": (relief_valve, by_event),
    "counterbalance": (counterbalance, by_event),
    "check valve": (check_valve, by_event),
    "closing check valve": (closing_check_valve, by_event),
    "pilot check": (pilot_check, by_event),
    "spilling": (spilling, by_spilling),
    "dry": (dry, by_mark),
    "end-stop": (end_stop, by_force),
    "diode": (diode, by_event),
    "clutch": (clutch, by_event),
}


def scene(kind: str, method: str, rng: np.random.Generator) -> tuple[dict[str, Any], Drive]:
    """Random case of this kind with this method: a tolerance of 1e-9 to 1e-3, or 1 to 6 given steps to the peak."""
    Drive.accuracy = ACCURACY.get(method, EXACT)
    case, drive = KINDS[kind][0](rng)
    numerics = {"end": drive.end, "method": method}
    if method in ADAPTIVE:
        numerics["rtol"] = 10.0 ** rng.uniform(-9.0, -3.0)
    else:
        numerics["step"] = drive.peak / drive.steps
    probes = {"end-stop": ["m.position", "stop.force"]}.get(kind)
    output = {"every": drive.end, "fields": 0} | ({"probes": probes} if probes else {})
    return case | {"schema": 1, "numerics": numerics, "output": output}, drive


def main() -> None:
    """Print for each kind of event how many events were missed, of how many."""
    options = parser(__doc__)
    options.add_argument(
        "count", type=int, nargs="?", default=4, help="scenes of each kind and method"
    )
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--kinds", default=",".join(KINDS))
    options.add_argument("--methods", default=",".join(METHODS))
    given = options.parse_args()
    if given.quick:
        given.count, given.methods = 1, "dormand-prince,rk4"
    missed, failed, total, by_method = Counter(), Counter(), Counter(), Counter()
    for kind in given.kinds.split(","):
        for method in given.methods.split(","):
            for k in range(given.count):
                seed = [given.seed, [*KINDS].index(kind), METHODS.index(method), k]
                case, drive = scene(kind, method, np.random.default_rng(seed))
                total[kind] += 1
                try:
                    result = fvsolve.run(case)
                except FvsolveError as error:
                    failed[kind] += 1
                    print(f"  refused: {kind}, {method}, {seed}: {str(error)[:300]}")
                    continue
                if not KINDS[kind][1](result, drive):
                    missed[kind] += 1
                    by_method[method] += 1
                    print(
                        f"  missed: {kind}, {method}, {seed}, {result.summary['steps']} steps, {result.reason}"
                    )
        print(
            f"{kind:20} {missed[kind]:4} missed, {failed[kind]:3} refused, of {total[kind]:4}",
            flush=True,
        )
    print(
        f"{'all':20} {sum(missed.values()):4} missed, {sum(failed.values()):3} refused, of {sum(total.values()):4}"
    )
    print("missed by method:", dict(by_method))


if __name__ == "__main__":
    main()
