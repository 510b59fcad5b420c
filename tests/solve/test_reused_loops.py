"""`advance` uses its loops again: each call gives the bits of a new loop, with any method, part and input."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from reference.scenes import scene, tank, valve

import fvsolve
from fvsolve import FvsolveError, advance, initial_state
from fvsolve.core.assembly.features import with_slot
from fvsolve.core.solve.advance import observe
from fvsolve.core.solve.held_inputs import hold
from fvsolve.features.controls.kernels.tables import SLOT

ADAPTIVE = {"numerics.rtol": 1e-6}
CASES = {
    "tanks": ("two-tanks", {}, "hole.opening", (0.4, 1.0)),
    "tanks, implicit": (
        "two-tanks",
        {"numerics.method": "radau-iia-5"},
        "hole.opening",
        (0.4, 1.0),
    ),
    "events and columns": ("governor", {}, "controls.governor.setpoint", (1.01, 0.99)),
    "control that is cut": ("governor", {}, "controls.servomotor.output", (0.5, 0.6)),
    "log law": (
        "cylinder-servo",
        {"numerics.method": "dormand-prince", **ADAPTIVE},
        "spool.position",
        (0.3, -0.2),
    ),
    "change of the method": (
        "cylinder-servo",
        {"numerics.method": "auto", **ADAPTIVE},
        "spool.position",
        (0.3, -0.2),
    ),
    "Rosenbrock": (
        "cylinder-servo",
        {"numerics.method": "rodas-5p", **ADAPTIVE},
        "spool.position",
        (0.3, -0.2),
    ),
    "delay and samples": ("digital-pressure", {}, "town.demand", (0.02, 0.04)),
    "network with switches": ("dc-motor-pump", {}, None, ()),
    "delay lines": (
        "valve-closure",
        {"numerics.pipe_model": "delay-line"},
        "valve.opening",
        (0.5, 0.7),
    ),
    "head of a lake": ("valve-closure", {}, "lake.head", (46.0, 45.0)),
    "check valve": ("check-valve-slam", {}, None, ()),
    "basin": ("tracer-basin", {}, None, ()),
}


def model_of(name):
    case, changes, key, values = CASES[name]
    return fvsolve.build(fvsolve.load(case, changes)), [{key: value} for value in values]


def bits(state) -> tuple:
    return (
        state.t,
        state.y.tobytes(),
        {name: array.tobytes() for name, array in state.memory.items()},
    )


def walk(model, inputs, fresh: bool) -> list[tuple]:
    """Bits of the states of a walk whose calls differ in inputs, length and start."""
    start, states = initial_state(model), []
    step = min((model.case.numerics.end - start.t) / 40, 0.02)
    for held in ({}, *inputs, {}):
        state = start
        for length in (1.0, 0.5, 2.5):
            if fresh:
                model.idle_loops.clear()
            state = advance(model, state, state.t + length * step, held)
            states.append(bits(state))
    return states


@pytest.mark.parametrize("name", CASES)
def test_a_used_loop_gives_the_bits_of_a_new_loop(name):
    model, inputs = model_of(name)
    assert walk(model, inputs, fresh=False) == walk(model, inputs, fresh=True)


@pytest.mark.parametrize(
    "name", ["tanks", "events and columns", "log law", "delay and samples", "delay lines"]
)
def test_probes_with_held_inputs_are_those_of_the_held_model(name):
    model, (first, second) = model_of(name)
    state = initial_state(model)
    for held in (first, second, second, {}):
        assert np.array_equal(observe(model, state, held), hold(model, held).observe(state))
        state = advance(model, state, state.t + 0.01, held)
        assert np.array_equal(observe(model, state, held), hold(model, held).observe(state))


def test_loops_are_used_again_until_the_inputs_change():
    model, (first, second) = model_of("tanks")
    state, loops = initial_state(model), []
    for held in ({}, {}, first, second, {}):
        state = advance(model, state, state.t + 0.1, held)
        loops.append(id(model.idle_loops[-1]))
    assert len(model.idle_loops) == 1
    assert [a == b for a, b in zip(loops, loops[1:], strict=False)] == [True, False, True, False]


def test_threads_share_a_model_but_no_loop():
    model, (held, _) = model_of("tanks")

    def last(_) -> tuple:
        state = initial_state(model)
        for k in range(20):
            state = advance(model, state, 0.1 * (k + 1), held)
        return bits(state)

    with ThreadPoolExecutor(4) as pool:
        ends = list(pool.map(last, range(8)))
    assert all(end == ends[0] for end in ends)


def test_a_call_that_fails_leaves_no_trace():
    nodes = {"a": tank(1.0, 2.0), "b": tank(1.0, 1.0)}
    numerics = {"scheme": "upwind", "method": "rk4", "step": 0.01}
    model = fvsolve.build(fvsolve.load(scene(nodes, {"v": valve("a", "b", 0.01)}, 1.0, numerics)))
    start = initial_state(model)
    good = bits(advance(model, start, 0.1, {"v.opening": 0.5}))
    for wrong in ({"v.opening": 2.0}, {"v.position": 0.5}, {"v.opening": "open"}):
        with pytest.raises(FvsolveError):
            advance(model, start, 0.1, wrong)
    assert bits(advance(model, start, 0.1, {"v.opening": 0.5})) == good


def test_probes_of_a_state_see_the_last_sample():
    """A sampled control holds its output, so the pump runs with it; the probe at the station shows it at once."""
    model, _ = model_of("delay and samples")
    start = initial_state(model)
    later = advance(model, start, 1.0, {"town.demand": 0.031})
    later = advance(model, later, 3.2, {"town.demand": 0.031})
    blank = fvsolve.State(
        later.t,
        later.y,
        later.memory | {"discrete": np.array(with_slot(model.features, SLOT).discrete)},
    )
    output = [probe.text for probe in model.probes].index("controls.pressure.output")
    assert (
        model.observe(later)[output] != model.observe(start)[output] == model.observe(blank)[output]
    )
