"""Cost of controls and networks: a PI with filter and limits, an operation of a formula, a sample, a motor, an entry.

The last rows compare the servo axis, with PI and spool, with SciPy's LSODA on rates written by hand, at equal error.

    python benchmarks/loops.py [--quick]

Each number is the difference of two runs of the same scene in this process, with and without the block, by `rk4` with a
given step, divided by the number of stages, operations or samples. Least of several turns, everything compiled before.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from measure import parser
from numba import njit
from scipy.integrate import solve_ivp

from fvsolve import build, load
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.parts.network_elements import network_of

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from reference import servo_axis as axis  # noqa: E402

STEP, STAGES = 1e-2, 4  # [s], of rk4
GOALS = {  # [ns]; of a network 25 ns and 4 ns an entry, beside 9 ns of rates written by hand
    "PI with filter and limits, a stage": 60.0,
    "formula, an operation": 6.0,
    "sample": 2000.0,
    "motor and shaft of 6 entries, a stage": 58.0,
    "entry of a network, a stage": 4.0,
}
FLUID = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2300.0,
}
OPERATIONS = 18  # of the longer formula, in addition to that of the shorter one
SHORT, LONG = "0.25 + 0*t", "0.25 + 0*t + 0*t + 0*t - 0*t - 0*t + 0"


def tower(opening, controls=None) -> dict:
    """Case of a tank between a lake and the air."""
    nodes = {
        "source": {"type": "reservoir", "head": 20.0, "elevation": 0.0},
        "tower": {"type": "tank", "area": 2.0, "level": 4.0, "elevation": 0.0},
        "town": {"type": "reservoir", "head": 0.0, "elevation": 0.0},
    }
    valve = {"type": "valve", "area": 2e-3, "discharge_coefficient": 0.61}
    links = {
        "inlet": {**valve, "from": "source", "to": "tower", "opening": opening},
        "outlet": {**valve, "from": "tower", "to": "town", "opening": 0.5},
    }
    case = {
        "fluid": FLUID,
        "nodes": nodes,
        "links": links,
        "output": {"probes": ["tower.level"]},
        "numerics": {"end": 1.0, "method": "rk4", "step": STEP},
    }
    return case | ({"controls": controls} if controls else {})


def pi(**more) -> dict:
    block = {
        "type": "pi",
        "input": "tower.level",
        "setpoint": 4.0,
        "gain": 0.8,
        "integral_time": 120.0,
    }
    return {"hold": block | more}


def motor(case: dict) -> dict:
    """Case with a motor on a shaft with a bearing: two states, six entries."""
    nodes = {
        "gnd": {"type": "ground"},
        "plus": {"type": "terminal"},
        "frame": {"type": "housing"},
        "axle": {"type": "shaft", "inertia": 3e-3, "initial_speed": 0.0},
    }
    links = {
        "supply": {"type": "voltage-source", "from": "gnd", "to": "plus", "voltage": 24.0},
        "motor": {
            "type": "dc-motor",
            "ports": {"p": "plus", "n": "gnd", "shaft": "axle"},
            "torque_constant": 0.12,
            "resistance": 0.8,
            "inductance": 0.2,
        },
        "bearing": {"type": "bearing", "from": "axle", "to": "frame", "damping": 1e-3},
    }
    return case | {"nodes": case["nodes"] | nodes, "links": case["links"] | links}


def ladder(case: dict, sections: int) -> dict:
    """Case with a chain of inductors, resistors and capacitors; a section has two states and five entries."""
    nodes = {"gnd": {"type": "ground"}} | {
        f"n{k}": {"type": "terminal"} for k in range(sections + 1)
    }
    nodes |= {f"m{k}": {"type": "terminal"} for k in range(sections)}
    links = {
        "end": {"type": "resistor", "from": f"n{sections}", "to": "gnd", "resistance": 1.0},
        "last": {"type": "capacitor", "from": f"n{sections}", "to": "gnd", "capacitance": 1.0},
    }
    for k in range(sections):
        links[f"c{k}"] = {"type": "capacitor", "from": f"n{k}", "to": "gnd", "capacitance": 1.0}
        links[f"l{k}"] = {"type": "inductor", "from": f"n{k}", "to": f"m{k}", "inductance": 1.0}
        links[f"r{k}"] = {"type": "resistor", "from": f"m{k}", "to": f"n{k + 1}", "resistance": 1.0}
    return case | {"nodes": case["nodes"] | nodes, "links": case["links"] | links}


def entries(case: dict) -> int:
    """Number of entries of all rates of a network."""
    network = network_of(build(load(case)))
    return sum(len(terms) for terms in network.terms(network.conducting)[: len(network.states)])


def seconds_per_step(case: dict, steps: int, turns: int) -> float:
    """Least CPU time of a step [s]."""
    model, found = (
        build(load(case, {"numerics.end": (steps + 10) * STEP, "output.every": steps * STEP})),
        [],
    )
    for _ in range(turns):
        loop = RunLoop(model)
        loop.begin(model.case.numerics.end, NO_LIMIT)
        loop.run(10.0)
        begun = time.process_time()
        loop.run(float(steps))
        found.append((time.process_time() - begun) / steps)
    return min(found)


# servo axis -------------------------------------------------------------------------------------------------------

# times the CPU
AXIS_GOALS = {
    "servo axis, LSODA with Python rates": 2.5,
    "servo axis, LSODA with compiled rates": 1.0,
}
AXIS_STATES = ("load.position", "load.velocity", "spool.position", "spool.speed")
AXIS_SCALE = np.array([1e-2, 0.1, 0.1, 10.0])
# of the spool, which then stays within its stops; below its greatest speed: LSODA has no events
DAMPING = 1.0
SMOOTH = {"links.spool.damping_ratio": DAMPING, "links.spool.stroke_time": 1e-3}


def least_time(function, turns: int) -> tuple[float, np.ndarray]:
    """(least CPU time of a call [s], its result)."""
    found = []
    for _ in range(turns):
        begun = time.process_time()
        result = function()
        found.append(time.process_time() - begun)
    return min(found), result


def axis_by_lsoda(rates, rtol: float) -> np.ndarray:
    """State at the end by LSODA, started again at each jump."""
    d, y, begin = np.empty(7), axis.start(), 0.0
    for end in (axis.STEP, axis.LOADED, axis.END):
        last = np.nextafter(end, 0.0)

        def follow(t, y, last=last):
            rates(min(t, last), y, d, False)
            return d

        y = solve_ivp(follow, (begin, end), y, "LSODA", rtol=rtol, atol=rtol * axis.SCALE).y[:, -1]
        begin = end
    return y[[0, 1, 4, 5]]


def axis_here(rtol: float):
    """Function that runs the case `servo-axis` with this tolerance and returns its last state."""
    model = build(load("servo-axis", {"numerics.rtol": rtol, "expect": {}} | SMOOTH))
    places = [model.state_names.index(name) for name in AXIS_STATES]
    start = np.array([0.05, 0.0, 0.0, 0.0])

    def run() -> np.ndarray:
        loop = RunLoop(model)
        for end in (axis.STEP, axis.LOADED, axis.END):
            loop.begin(end, NO_LIMIT)
            loop.run(NO_LIMIT)
        return start + loop.now[places]

    return run


def cost_at_error(function, error, tolerances, near, turns) -> float:
    """CPU time at an error `near`, interpolated in logarithms over tolerances [s]; prints each."""
    times, errors = [], []
    for rtol in tolerances:
        call = function(rtol)
        call()
        seconds, found = least_time(call, turns)
        times.append(seconds)
        errors.append(error(found))
    order = np.argsort(errors)
    return float(np.exp(np.interp(np.log(near), np.log(errors)[order], np.log(times)[order])))


def servo_axis(turns: int) -> dict[str, float]:
    """CPU time [s] of the axis at an error of 1e-6 of its scales, here and by LSODA with both kinds of rates."""
    plain, compiled = axis.axis(damping=DAMPING, fastest=np.inf), axis.axis(njit, DAMPING, np.inf)
    truth = axis_by_lsoda(compiled, 1e-12)
    tolerances, error = (
        10.0 ** np.arange(-9.0, -3.5),
        lambda y: float(np.max(np.abs(y - truth) / AXIS_SCALE)),
    )
    calls = {
        "here": axis_here,
        "Python": lambda rtol: lambda: axis_by_lsoda(plain, rtol),
        "compiled": lambda rtol: lambda: axis_by_lsoda(compiled, rtol),
    }
    return {
        name: cost_at_error(call, error, tolerances, 1e-6, turns) for name, call in calls.items()
    }


def main() -> None:
    """Print the table."""
    quick = parser(__doc__).parse_args().quick
    steps, turns = (2_000, 2) if quick else (50_000, 9)
    plain, held = tower(0.25), tower({"control": "hold"}, pi(filter=0.5, limits=[0.0, 1.0]))
    sampled = tower({"control": "hold"}, pi(limits=[0.0, 1.0], period=STEP))
    rare = tower({"control": "hold"}, pi(limits=[0.0, 1.0], period=1e6))
    cases = {
        "plain": plain,
        "held": held,
        "short": tower(SHORT),
        "long": tower(LONG),
        "sampled": sampled,
        "rare": rare,
    }
    cases |= {"motor": motor(plain), "few": ladder(plain, 4), "many": ladder(plain, 84)}
    cost = {name: 1e9 * seconds_per_step(case, steps, turns) for name, case in cases.items()}
    more = entries(cases["many"]) - entries(cases["few"])
    found = {
        "PI with filter and limits, a stage": (cost["held"] - cost["plain"]) / STAGES,
        "formula, an operation": (cost["long"] - cost["short"]) / STAGES / OPERATIONS,
        "sample": cost["sampled"] - cost["rare"],
        "motor and shaft of 6 entries, a stage": (cost["motor"] - cost["plain"]) / STAGES,
        "entry of a network, a stage": (cost["many"] - cost["few"]) / STAGES / more,
    }
    print("| | ns | goal |\n|---|---|---|")
    for name, value in found.items():
        factor = GOALS[name] / value
        print(
            f"| {name} | {value:.1f} | at most {GOALS[name]:g}: {'met' if factor >= 1.0 else 'missed'} |"
        )
    axis_cost = servo_axis(2 if quick else 5)
    for (name, goal), kind in zip(AXIS_GOALS.items(), ("Python", "compiled"), strict=True):
        ratio = axis_cost[kind] / axis_cost["here"]
        print(
            f"| {name} | {ratio:.2f} times | at least {goal:g} times: {'met' if ratio >= goal else 'missed'} |"
        )
    print(
        "ms of the servo axis: "
        + ", ".join(f"{name} {1e3 * value:.2f}" for name, value in axis_cost.items())
    )
    print("ns a step: " + ", ".join(f"{name} {value:.0f}" for name, value in cost.items()))


if __name__ == "__main__":
    main()
