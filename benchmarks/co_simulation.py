"""Cost of steps from outside: `advance`, an FMU in FMPy, and a controller in Python beside the same one in the case.

    python benchmarks/co_simulation.py [--quick]

Time of a step of 1 ms without the time of the compiled solver for the same step, least of several turns. Rows of FMUs
need PythonFMU and FMPy (`pip install "fvsolve[fmi]"`). A step of an FMU is fmi2SetReal, fmi2DoStep and fmi2GetReal of
all outputs.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from measure import parser, peer_module

from fvsolve import advance, build, initial_state, load
from fvsolve.core.solve.reused_loop import ReusedLoop
from fvsolve.core.solve.run_loop import NO_LIMIT

STEP = 1e-3  # [s]
GOAL = 100.0  # of a step of an FMU beside the solver [us]
CASES = {
    "two-tanks": {"hole.opening": 0.5},
    "valve-closure": {"valve.opening": 0.5},
    "governor": {"controls.governor.setpoint": 1.0},
}
PERIOD, CHUNK = 0.1, 1000  # period of the controller [s]; samples of a turn in the case
FLUID = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": 2.2e9,
    "viscosity": 1e-3,
    "vapor_pressure": 2300.0,
}


def least(action, steps: int, turns: int) -> float:
    """Least time of a step [us]; action(k) takes step k."""
    times = []
    for turn in range(turns):
        begun = time.perf_counter()
        for k in range(turn * steps, (turn + 1) * steps):
            action(k)
        times.append((time.perf_counter() - begun) / steps)
    return 1e6 * min(times)


def advancing(model, held):
    """Action that advances the state of a model by a step."""
    states = [initial_state(model)]

    def step(k: int) -> None:
        states[0] = advance(model, states[0], (k + 1) * STEP, held)

    return step


def solving(model, held):
    """Action that runs the compiled solver alone over a step."""
    loop = ReusedLoop(model, held).start(initial_state(model))
    loop.begin(STEP, NO_LIMIT)

    def step(k: int) -> None:
        loop.control["end"] = (k + 1) * STEP
        loop.stepper.restart_segment()
        loop.run(NO_LIMIT)

    return step


def hosted(case, held, folder: Path):
    """Action that takes a step of the FMU of a case in FMPy: inputs, step, outputs."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    from fvsolve.exchange.fmi.export import write_fmu

    path, variables = write_fmu(case, folder / f"{case.name}.fmu")
    about, unpacked = (
        fmpy.read_model_description(str(path)),
        fmpy.extract(str(path), str(folder / case.name)),
    )
    identifier = about.coSimulation.modelIdentifier
    fmu = FMU2Slave(
        guid=about.guid, unzipDirectory=unpacked, modelIdentifier=identifier, instanceName=case.name
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    inputs = [k for k, variable in enumerate(variables) if variable.name in held]
    outputs = [k for k, variable in enumerate(variables) if not variable.is_input]

    def step(k: int) -> None:
        fmu.setReal(inputs, [*held.values()])
        fmu.doStep(k * STEP, STEP)
        fmu.getReal(outputs)

    return step


def tower(controls: dict) -> dict:
    """Case of a tank between a lake and the air, with a valve that a PI with samples moves, or a Python program."""
    nodes = {
        "source": {"type": "reservoir", "head": 20.0, "elevation": 0.0},
        "tower": {"type": "tank", "area": 2.0, "level": 4.0, "elevation": 0.0},
        "town": {"type": "reservoir", "head": 0.0, "elevation": 0.0},
    }
    valve = {"type": "valve", "area": 2e-3, "discharge_coefficient": 0.61}
    opening = {"control": "hold"} if controls else 0.25
    links = {
        "inlet": {**valve, "from": "source", "to": "tower", "opening": opening},
        "outlet": {**valve, "from": "tower", "to": "town", "opening": 0.5},
    }
    numerics = {"end": 1e5, "method": "rk4", "step": PERIOD}
    case = {"fluid": FLUID, "nodes": nodes, "links": links, "numerics": numerics}
    return case | {
        "output": {"probes": ["tower.level"], "every": numerics["end"]},
        "controls": controls,
    }


def controller_cost(turns: int) -> tuple[float, float]:
    """Time of a sample of a PI in the case, and in Python with `advance` [us]."""
    block = {
        "type": "pi",
        "input": "tower.level",
        "setpoint": 4.5,
        "gain": 0.8,
        "integral_time": 120.0,
    }
    own = build(
        load(tower({"hold": block | {"limits": [0.0, 1.0], "period": PERIOD, "initial": 0.25}}))
    )
    free = build(load(tower({})))

    loop = ReusedLoop(own, {}).start(initial_state(own))
    loop.begin(PERIOD, NO_LIMIT)
    states, integrals = [initial_state(free)], [0.25]

    def in_case(k: int) -> None:
        loop.control["end"] = PERIOD * CHUNK * (k + 1)
        loop.stepper.restart_segment()
        loop.run(NO_LIMIT)

    def in_python(k: int) -> None:
        error = 4.5 - free.observe(states[0])[0]
        integrals[0] += 0.8 * PERIOD * error / 120.0
        opening = min(max(0.8 * error + integrals[0], 0.0), 1.0)
        states[0] = advance(free, states[0], (k + 1) * PERIOD, {"inlet.opening": opening})

    return least(in_case, 1, turns) / CHUNK, least(in_python, 20, turns)


def main() -> None:
    """Print the tables."""
    quick = parser(__doc__).parse_args().quick
    steps, turns = (20, 5) if quick else (20, 200)
    peers = [
        peer_module(name, wheel) for name, wheel in (("pythonfmu", "PythonFMU"), ("fmpy", "FMPy"))
    ]
    print("us a step of 1 ms, beside the solver\n")
    print(
        "| case | solver | `advance` | `advance` with an input | FMU in FMPy | goal |\n|---|---|---|---|---|---|"
    )
    for name, held in CASES.items():
        case = load(name)
        model = build(case)
        own = least(solving(model, {}), steps, turns)
        bare, held_cost = (
            least(advancing(model, inputs), steps, turns) - own for inputs in ({}, held)
        )
        text = f"| {name} | {own:.0f} | {bare:.0f} | {held_cost:.0f} "
        if None in peers:
            print(f"{text}| - | - |")
            continue
        with tempfile.TemporaryDirectory() as folder:
            cost = least(hosted(case, held, Path(folder)), steps, turns) - own
        print(f"{text}| {cost:.0f} | at most {GOAL:g}: {'met' if cost <= GOAL else 'missed'} |")
    in_case, in_python = controller_cost(turns)
    print(
        f"\na sample of a PI, with its step: {in_case:.2f} us in the case, {in_python:.0f} us in Python"
    )


if __name__ == "__main__":
    main()
