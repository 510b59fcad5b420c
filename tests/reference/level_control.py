"""Cases of a tank whose level is controlled by a valve."""

import numpy as np

import fvsolve
from reference.scenes import GRAVITY, lake, scene, tank, valve

METHODS = ("dormand-prince", "radau-iia-5", "rodas-5p", "auto")
SECTION, ORIFICE, SUPPLY = 2.0, 20e-4, 20.0


def orifice_flow(opening, head):
    """Flow through a valve of `tower` [m3/s]."""
    return opening * ORIFICE * np.sign(head) * np.sqrt(2.0 * GRAVITY * abs(head))


def tower(inlet, outlet, level=4.0, end=300.0, numerics=None, **top):
    """Case of a tank between a lake and the air, with the openings of both valves."""
    nodes = {
        "source": lake(SUPPLY, elevation=0.0),
        "tower": tank(SECTION, level, elevation=0.0),
        "town": lake(0.0, elevation=0.0),
    }
    links = {
        "inlet": valve("source", "tower", ORIFICE, inlet),
        "outlet": valve("tower", "town", ORIFICE, outlet),
    }
    probes = ["tower.level", *(f"controls.{name}.output" for name in top.get("controls", {}))]
    return scene(nodes, links, end, numerics or {"rtol": 1e-10}, probes, end / 100, **top)


def pi(setpoint, gain=0.8, integral=120.0, **more):
    more |= {} if integral is None else {"integral_time": integral}
    return {"type": "pi", "input": "tower.level", "setpoint": setpoint, "gain": gain, **more}


def final(case, method, **numerics):
    """Values of the probes at the end of a case, by a method with a tolerance of 1e-10."""
    model = fvsolve.build(
        fvsolve.load(case, {"numerics.method": method, "numerics.rtol": 1e-10, **numerics})
    )
    state = fvsolve.advance(model, fvsolve.initial_state(model), model.case.numerics.end)
    return model.observe(state)


FINE = {"rtol": 1e-12, "atol": 1e-13}
